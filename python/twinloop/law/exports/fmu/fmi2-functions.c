/* A twin as an FMU for co-simulation of FMI 2.0 (https://fmi-standard.org, version 2.0.4). */
#include "fmi-instance.h"

#if defined(FMI2_FUNCTION_PREFIX) && !defined(FMI2_OVERRIDE_FUNCTION_PREFIX)
#define FMI(name) PREFIXED(FMI2_FUNCTION_PREFIX, fmi2##name)
#else
#define FMI(name) fmi2##name
#endif

typedef enum { fmi2OK, fmi2Warning, fmi2Discard, fmi2Error, fmi2Fatal, fmi2Pending } fmi2Status;
typedef void (*logging)(void *environment, const char *instance, fmi2Status status, const char *category,
    const char *message, ...);

typedef struct {
    logging log;
    void *(*allocate)(size_t n, size_t size);
    void (*release)(void *memory);
    void (*finished)(void *environment, fmi2Status status);
    void *environment;
} callbacks;

typedef struct {
    values now;
    callbacks functions;
    int logged;
} instance;

static fmi2Status said(const instance *self, const char *wrong)
{
    if (wrong == NULL) {
        return fmi2OK;
    }
    if (self->functions.log != NULL && self->logged) {
        self->functions.log(self->functions.environment, "twin", fmi2Error, "logStatusError", "%s", wrong);
    }
    return fmi2Error;
}

EXPORT const char *FMI(GetTypesPlatform)(void)
{
    return "default";
}

EXPORT const char *FMI(GetVersion)(void)
{
    return "2.0";
}

EXPORT fmi2Status FMI(SetDebugLogging)(void *c, int on, size_t n, const char *const categories[])
{
    ((instance *)c)->logged = on;
    return fmi2OK;
}

EXPORT void *FMI(Instantiate)(const char *name, int type, const char *token, const char *resources,
    const callbacks *functions, int visible, int on)
{
    instance *self = NULL;
    if (type == 1 && token != NULL && strcmp(token, TOKEN) == 0) {
        self = calloc(1, sizeof *self);
    } else if (functions != NULL && functions->log != NULL) {
        functions->log(functions->environment, name, fmi2Error, "logStatusError",
            "Expected co-simulation with the GUID of the model description.");
    }
    if (self != NULL) {
        values_reset(&self->now);
        if (functions != NULL) {
            self->functions = *functions;
        }
        self->logged = on;
    }
    return self;
}

EXPORT void FMI(FreeInstance)(void *c)
{
    free(c);
}

EXPORT fmi2Status FMI(SetupExperiment)(void *c, int tolerates, double tolerance, double start, int stops, double stop)
{
    instance *self = c;
    if (self->now.mode != INSTANTIATED || !isfinite(start)) {
        return said(self, "Expected a new or reset instance, and a finite start.");
    }
    self->now.time = start;
    return fmi2OK;
}

EXPORT fmi2Status FMI(EnterInitializationMode)(void *c)
{
    instance *self = c;
    if (self->now.mode != INSTANTIATED) {
        return said(self, "Expected a new or reset instance.");
    }
    self->now.mode = INITIALISING;
    return fmi2OK;
}

EXPORT fmi2Status FMI(ExitInitializationMode)(void *c)
{
    instance *self = c;
    if (self->now.mode != INITIALISING) {
        return said(self, "Expected the initialization mode.");
    }
    self->now.mode = STEPPING;
    return fmi2OK;
}

EXPORT fmi2Status FMI(Terminate)(void *c)
{
    ((instance *)c)->now.mode = TERMINATED;
    return fmi2OK;
}

EXPORT fmi2Status FMI(Reset)(void *c)
{
    values_reset(&((instance *)c)->now);
    return fmi2OK;
}

EXPORT fmi2Status FMI(GetReal)(void *c, const unsigned references[], size_t n, double found[])
{
    const char *wrong = NULL;
    for (size_t i = 0; i < n && wrong == NULL; ++i) {
        wrong = values_get(&((instance *)c)->now, references[i], &found[i]);
    }
    return said(c, wrong);
}

EXPORT fmi2Status FMI(SetReal)(void *c, const unsigned references[], size_t n, const double given[])
{
    const char *wrong = NULL;
    for (size_t i = 0; i < n && wrong == NULL; ++i) {
        wrong = values_set(&((instance *)c)->now, references[i], given[i]);
    }
    return said(c, wrong);
}

EXPORT fmi2Status FMI(DoStep)(void *c, double from, double step, int forgets)
{
    return said(c, values_step(&((instance *)c)->now, from, step));
}

EXPORT fmi2Status FMI(GetFMUstate)(void *c, void **state)
{
    if (*state == NULL) {
        *state = malloc(sizeof(values));
    }
    if (*state == NULL) {
        return said(c, "Expected memory for a state of the FMU, found none.");
    }
    memcpy(*state, &((instance *)c)->now, sizeof(values));
    return fmi2OK;
}

EXPORT fmi2Status FMI(SetFMUstate)(void *c, void *state)
{
    memcpy(&((instance *)c)->now, state, sizeof(values));
    return fmi2OK;
}

EXPORT fmi2Status FMI(FreeFMUstate)(void *c, void **state)
{
    free(*state);
    *state = NULL;
    return fmi2OK;
}

EXPORT fmi2Status FMI(SerializedFMUstateSize)(void *c, void *state, size_t *size)
{
    *size = sizeof(values);
    return fmi2OK;
}

EXPORT fmi2Status FMI(SerializeFMUstate)(void *c, void *state, char bytes[], size_t size)
{
    if (size != sizeof(values)) {
        return said(c, "Expected as many bytes as a state of the FMU has.");
    }
    memcpy(bytes, state, size);
    return fmi2OK;
}

EXPORT fmi2Status FMI(DeSerializeFMUstate)(void *c, const char bytes[], size_t size, void **state)
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
    return fmi2OK;
}

EXPORT fmi2Status FMI(GetStatus)(void *c, int kind, fmi2Status *found)
{
    *found = fmi2OK;
    return fmi2OK;
}

EXPORT fmi2Status FMI(GetRealStatus)(void *c, int kind, double *found)
{
    *found = ((instance *)c)->now.time; /* the only one: the last successful time */
    return fmi2OK;
}

EXPORT fmi2Status FMI(GetBooleanStatus)(void *c, int kind, int *found)
{
    *found = ((instance *)c)->now.mode == TERMINATED;
    return fmi2OK;
}

/* What a twin has none of: variables of other types, derivatives, steps that go on behind the caller's back. */

#define NO_VARIABLES(type, c_type) \
    EXPORT fmi2Status FMI(Get##type)(void *c, const unsigned references[], size_t n, c_type found[]) \
    { \
        return n == 0 ? fmi2OK : fmi2Error; \
    } \
    EXPORT fmi2Status FMI(Set##type)(void *c, const unsigned references[], size_t n, const c_type given[]) \
    { \
        return n == 0 ? fmi2OK : fmi2Error; \
    }
typedef const char *text;
NO_VARIABLES(Integer, int)
NO_VARIABLES(Boolean, int)
NO_VARIABLES(String, text)

#define NOT_HERE(name, parameters) \
    EXPORT fmi2Status FMI(name) parameters \
    { \
        return fmi2Error; \
    }
NOT_HERE(GetDirectionalDerivative, (void *c, const unsigned unknowns[], size_t n, const unsigned knowns[], size_t m,
    const double seed[], double found[]))
NOT_HERE(SetRealInputDerivatives, (void *c, const unsigned r[], size_t n, const int order[], const double given[]))
NOT_HERE(GetRealOutputDerivatives, (void *c, const unsigned r[], size_t n, const int order[], double found[]))
NOT_HERE(CancelStep, (void *c))
NOT_HERE(GetIntegerStatus, (void *c, int kind, int *found))
NOT_HERE(GetStringStatus, (void *c, int kind, text *found))
