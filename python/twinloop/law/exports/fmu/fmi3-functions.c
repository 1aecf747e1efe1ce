/* A twin as an FMU for co-simulation of FMI 3.0 (https://fmi-standard.org/docs/3.0/). */
#include <stdbool.h>
#include <stdint.h>

#include "fmi-instance.h"

#if defined(FMI3_FUNCTION_PREFIX) && !defined(FMI3_OVERRIDE_FUNCTION_PREFIX)
#define FMI(name) PREFIXED(FMI3_FUNCTION_PREFIX, fmi3##name)
#else
#define FMI(name) fmi3##name
#endif

typedef enum { fmi3OK, fmi3Warning, fmi3Discard, fmi3Error, fmi3Fatal } fmi3Status;
typedef void (*logging)(void *environment, fmi3Status status, const char *category, const char *message);

typedef struct {
    values now;
    void *environment;
    logging log;
    bool logged;
} instance;

static fmi3Status said(const instance *self, const char *wrong)
{
    if (wrong == NULL) {
        return fmi3OK;
    }
    if (self != NULL && self->log != NULL && self->logged) {
        self->log(self->environment, fmi3Error, "logStatusError", wrong);
    }
    return fmi3Error;
}

EXPORT const char *FMI(GetVersion)(void)
{
    return "3.0";
}

EXPORT fmi3Status FMI(SetDebugLogging)(void *c, bool on, size_t n, const char *const categories[])
{
    ((instance *)c)->logged = on;
    return fmi3OK;
}

EXPORT void *FMI(InstantiateCoSimulation)(const char *name, const char *token, const char *resources, bool visible,
    bool on, bool events, bool early, const uint32_t intermediate[], size_t n, void *environment, logging log,
    void (*update)(void))
{
    instance *self = NULL;
    if (token != NULL && strcmp(token, TOKEN) == 0) {
        self = calloc(1, sizeof *self);
    } else if (log != NULL) {
        log(environment, fmi3Error, "logStatusError", "Expected the instantiation token of the model description.");
    }
    if (self != NULL) {
        values_reset(&self->now);
        self->environment = environment;
        self->log = log;
        self->logged = on;
    }
    return self;
}

EXPORT void *FMI(InstantiateModelExchange)(const char *name, const char *token, const char *resources, bool visible,
    bool on, void *environment, logging log)
{
    return NULL;
}

EXPORT void *FMI(InstantiateScheduledExecution)(const char *name, const char *token, const char *resources,
    bool visible, bool on, void *environment, logging log, void (*update)(void), void (*lock)(void),
    void (*unlock)(void))
{
    return NULL;
}

EXPORT void FMI(FreeInstance)(void *c)
{
    free(c);
}

EXPORT fmi3Status FMI(EnterInitializationMode)(void *c, bool tolerates, double tolerance, double start, bool stops,
    double stop)
{
    instance *self = c;
    if (self->now.mode != INSTANTIATED || !isfinite(start)) {
        return said(self, "Expected a new or reset instance, and a finite start.");
    }
    self->now.mode = INITIALISING;
    self->now.time = start;
    return fmi3OK;
}

EXPORT fmi3Status FMI(ExitInitializationMode)(void *c)
{
    instance *self = c;
    if (self->now.mode != INITIALISING) {
        return said(self, "Expected the initialization mode.");
    }
    self->now.mode = STEPPING;
    return fmi3OK;
}

EXPORT fmi3Status FMI(Terminate)(void *c)
{
    ((instance *)c)->now.mode = TERMINATED;
    return fmi3OK;
}

EXPORT fmi3Status FMI(Reset)(void *c)
{
    values_reset(&((instance *)c)->now);
    return fmi3OK;
}

EXPORT fmi3Status FMI(GetFloat64)(void *c, const uint32_t references[], size_t n, double found[], size_t m)
{
    const char *wrong = n == m ? NULL : "Expected a value for each value reference.";
    for (size_t i = 0; i < n && wrong == NULL; ++i) {
        wrong = values_get(&((instance *)c)->now, references[i], &found[i]);
    }
    return said(c, wrong);
}

EXPORT fmi3Status FMI(SetFloat64)(void *c, const uint32_t references[], size_t n, const double given[], size_t m)
{
    const char *wrong = n == m ? NULL : "Expected a value for each value reference.";
    for (size_t i = 0; i < n && wrong == NULL; ++i) {
        wrong = values_set(&((instance *)c)->now, references[i], given[i]);
    }
    return said(c, wrong);
}

EXPORT fmi3Status FMI(DoStep)(void *c, double from, double step, bool forgets, bool *events, bool *ends, bool *early,
    double *reached)
{
    instance *self = c;
    const char *wrong = values_step(&self->now, from, step);
    *events = *ends = *early = false;
    *reached = self->now.time;
    return said(self, wrong);
}

EXPORT fmi3Status FMI(EnterStepMode)(void *c)
{
    return fmi3OK;
}

EXPORT fmi3Status FMI(GetFMUState)(void *c, void **state)
{
    if (*state == NULL) {
        *state = malloc(sizeof(values));
    }
    if (*state == NULL) {
        return said(c, "Expected memory for a state of the FMU, found none.");
    }
    memcpy(*state, &((instance *)c)->now, sizeof(values));
    return fmi3OK;
}

EXPORT fmi3Status FMI(SetFMUState)(void *c, void *state)
{
    memcpy(&((instance *)c)->now, state, sizeof(values));
    return fmi3OK;
}

EXPORT fmi3Status FMI(FreeFMUState)(void *c, void **state)
{
    free(*state);
    *state = NULL;
    return fmi3OK;
}

EXPORT fmi3Status FMI(SerializedFMUStateSize)(void *c, void *state, size_t *size)
{
    *size = sizeof(values);
    return fmi3OK;
}

EXPORT fmi3Status FMI(SerializeFMUState)(void *c, void *state, uint8_t bytes[], size_t size)
{
    if (size != sizeof(values)) {
        return said(c, "Expected as many bytes as a state of the FMU has.");
    }
    memcpy(bytes, state, size);
    return fmi3OK;
}

EXPORT fmi3Status FMI(DeserializeFMUState)(void *c, const uint8_t bytes[], size_t size, void **state)
{
    if (size != sizeof(values)) {
        return said(c, "Expected as many bytes as a state of the FMU has.");
    }
    if (*state == NULL) {
        *state = malloc(sizeof(values));
    }
    if (*state == NULL) {
        return said(c, "Expected memory for a state of the FMU, found none.");
    }
    memcpy(*state, bytes, size);
    return fmi3OK;
}

/* What a twin has none of: variables of other types, clocks, events, derivatives, other kinds of simulation. */

#define NO_VARIABLES(type, c_type) \
    EXPORT fmi3Status FMI(Get##type)(void *c, const uint32_t references[], size_t n, c_type found[], size_t m) \
    { \
        return n == 0 ? fmi3OK : fmi3Error; \
    } \
    EXPORT fmi3Status FMI(Set##type)(void *c, const uint32_t references[], size_t n, const c_type given[], size_t m) \
    { \
        return n == 0 ? fmi3OK : fmi3Error; \
    }
typedef const char *text;
NO_VARIABLES(Float32, float)
NO_VARIABLES(Int8, int8_t)
NO_VARIABLES(UInt8, uint8_t)
NO_VARIABLES(Int16, int16_t)
NO_VARIABLES(UInt16, uint16_t)
NO_VARIABLES(Int32, int32_t)
NO_VARIABLES(UInt32, uint32_t)
NO_VARIABLES(Int64, int64_t)
NO_VARIABLES(UInt64, uint64_t)
NO_VARIABLES(Boolean, bool)
NO_VARIABLES(String, text)

#define NOT_HERE(name, parameters) \
    EXPORT fmi3Status FMI(name) parameters \
    { \
        return fmi3Error; \
    }
typedef const uint8_t *binary;
NOT_HERE(GetBinary, (void *c, const uint32_t r[], size_t n, size_t sizes[], binary found[], size_t m))
NOT_HERE(SetBinary, (void *c, const uint32_t r[], size_t n, const size_t sizes[], const binary given[], size_t m))
NOT_HERE(GetClock, (void *c, const uint32_t r[], size_t n, bool found[]))
NOT_HERE(SetClock, (void *c, const uint32_t r[], size_t n, const bool given[]))
NOT_HERE(GetNumberOfVariableDependencies, (void *c, uint32_t r, size_t *n))
NOT_HERE(GetVariableDependencies, (void *c, uint32_t r, size_t elements[], uint32_t independents[], size_t others[],
    int kinds[], size_t n))
NOT_HERE(GetDirectionalDerivative, (void *c, const uint32_t unknowns[], size_t n, const uint32_t knowns[], size_t m,
    const double seed[], size_t l, double sensitivity[], size_t k))
NOT_HERE(GetAdjointDerivative, (void *c, const uint32_t unknowns[], size_t n, const uint32_t knowns[], size_t m,
    const double seed[], size_t l, double sensitivity[], size_t k))
NOT_HERE(EnterConfigurationMode, (void *c))
NOT_HERE(ExitConfigurationMode, (void *c))
NOT_HERE(GetIntervalDecimal, (void *c, const uint32_t r[], size_t n, double found[], int qualifiers[]))
NOT_HERE(GetIntervalFraction, (void *c, const uint32_t r[], size_t n, uint64_t counters[], uint64_t resolutions[],
    int qualifiers[]))
NOT_HERE(GetShiftDecimal, (void *c, const uint32_t r[], size_t n, double found[]))
NOT_HERE(GetShiftFraction, (void *c, const uint32_t r[], size_t n, uint64_t counters[], uint64_t resolutions[]))
NOT_HERE(SetIntervalDecimal, (void *c, const uint32_t r[], size_t n, const double given[]))
NOT_HERE(SetIntervalFraction, (void *c, const uint32_t r[], size_t n, const uint64_t counters[],
    const uint64_t resolutions[]))
NOT_HERE(SetShiftDecimal, (void *c, const uint32_t r[], size_t n, const double given[]))
NOT_HERE(SetShiftFraction, (void *c, const uint32_t r[], size_t n, const uint64_t counters[],
    const uint64_t resolutions[]))
NOT_HERE(EvaluateDiscreteStates, (void *c))
NOT_HERE(UpdateDiscreteStates, (void *c, bool *again, bool *ends, bool *nominals, bool *states, bool *next, double *time))
NOT_HERE(EnterEventMode, (void *c))
NOT_HERE(EnterContinuousTimeMode, (void *c))
NOT_HERE(CompletedIntegratorStep, (void *c, bool forgets, bool *events, bool *ends))
NOT_HERE(SetTime, (void *c, double time))
NOT_HERE(SetContinuousStates, (void *c, const double given[], size_t n))
NOT_HERE(GetContinuousStateDerivatives, (void *c, double found[], size_t n))
NOT_HERE(GetEventIndicators, (void *c, double found[], size_t n))
NOT_HERE(GetContinuousStates, (void *c, double found[], size_t n))
NOT_HERE(GetNominalsOfContinuousStates, (void *c, double found[], size_t n))
NOT_HERE(GetNumberOfEventIndicators, (void *c, size_t *n))
NOT_HERE(GetNumberOfContinuousStates, (void *c, size_t *n))
NOT_HERE(GetOutputDerivatives, (void *c, const uint32_t r[], size_t n, const int32_t orders[], double found[], size_t m))
NOT_HERE(ActivateModelPartition, (void *c, uint32_t clock, double time))
