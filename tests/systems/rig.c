/* A pendulum of 0.3 kg and 0.4 m as an FMU for co-simulation, FMI 2.0: ten small steps a communication step. */
#include <math.h>
#include <stdlib.h>

typedef struct { double value[5]; } Rig; /* angle, rate, torque, friction, start of the rate */
enum { ANGLE, RATE, TORQUE, FRICTION, RATE_0 };

void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources, const void *functions,
                      int visible, int logging) {
    Rig *rig = calloc(1, sizeof(Rig));
    rig->value[FRICTION] = 0.05;
    (void)name, (void)type, (void)guid, (void)resources, (void)functions, (void)visible, (void)logging;
    return rig;
}
void fmi2FreeInstance(void *c) { free(c); }
int fmi2SetupExperiment(void *c, int d, double t, double start, int s, double stop) {
    return (void)c, (void)d, (void)t, (void)start, (void)s, (void)stop, 0;
}
int fmi2EnterInitializationMode(void *c) { return (void)c, 0; }
int fmi2ExitInitializationMode(void *c) { ((Rig *)c)->value[RATE] = ((Rig *)c)->value[RATE_0]; return 0; }
int fmi2Terminate(void *c) { return (void)c, 0; }
int fmi2Reset(void *c) { return (void)c, 0; }
int fmi2GetReal(void *c, const unsigned *places, size_t n, double *values) {
    for (size_t i = 0; i < n; i++) values[i] = ((Rig *)c)->value[places[i]];
    return 0;
}
int fmi2SetReal(void *c, const unsigned *places, size_t n, const double *values) {
    for (size_t i = 0; i < n; i++) ((Rig *)c)->value[places[i]] = values[i];
    return 0;
}
int fmi2DoStep(void *c, double t, double dt, int keep) {
    double *v = ((Rig *)c)->value;
    if (fabs(v[ANGLE]) > 2.5) return 3; /* fmi2Error: the rig is at its stop */
    for (int i = 0; i < 10; i++) {
        v[RATE] += dt / 10 * (v[TORQUE] - 0.3 * 9.81 * 0.4 * sin(v[ANGLE]) - v[FRICTION] * v[RATE]) / (0.3 * 0.4 * 0.4);
        v[ANGLE] += dt / 10 * v[RATE];
    }
    return (void)t, (void)keep, 0;
}

/* What FMPy looks for and nobody calls here. */
#define UNUSED(name) int fmi2##name(void) { return 3; }
UNUSED(GetTypesPlatform) UNUSED(GetVersion) UNUSED(SetDebugLogging) UNUSED(GetInteger) UNUSED(GetBoolean)
UNUSED(GetString) UNUSED(SetInteger) UNUSED(SetBoolean) UNUSED(SetString) UNUSED(GetFMUstate) UNUSED(SetFMUstate)
UNUSED(FreeFMUstate) UNUSED(SerializedFMUstateSize) UNUSED(SerializeFMUstate) UNUSED(DeSerializeFMUstate)
UNUSED(GetDirectionalDerivative) UNUSED(SetRealInputDerivatives) UNUSED(GetRealOutputDerivatives)
UNUSED(CancelStep) UNUSED(GetStatus) UNUSED(GetRealStatus) UNUSED(GetIntegerStatus) UNUSED(GetBooleanStatus)
UNUSED(GetStringStatus)
