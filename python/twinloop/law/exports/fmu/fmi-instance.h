/* An instance of a twin, as FMI 2.0 and FMI 3.0 have it alike: its values, and how they move on.

   Value references: 0 is the time, then come the states, the commands, the hidden states and what late sensors read. */
#ifndef FMI_INSTANCE_H
#define FMI_INSTANCE_H

#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "fmi-twin.h"

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#elif defined(__GNUC__)
#define EXPORT __attribute__((visibility("default")))
/* What the interface asks for and a twin has not takes parameters that nobody reads. */
#pragma GCC diagnostic ignored "-Wunused-parameter"
#else
#define EXPORT
#endif

/* To link several of them into one program, define the prefix of each. */
#define JOINED(a, b) a##b
#define PREFIXED(a, b) JOINED(a, b)

enum mode { INSTANTIATED, INITIALISING, STEPPING, TERMINATED };

/* All that changes, without a pointer: a copy of it is a state of the FMU. */
typedef struct {
    int mode;
    double time;
    double x[STATES];
    double u[COMMANDS];
    twin_memory memory;
#if LATE > 0
    twin_sensors sensors; /* Before they read x. */
#endif
} values;

static void values_reset(values *now)
{
    static const double x[STATES] = STARTS, u[COMMANDS] = RESTS;
    memset(now, 0, sizeof *now);
    memcpy(now->x, x, sizeof x);
    memcpy(now->u, u, sizeof u);
    twin_reset(&now->memory);
#if LATE > 0
    twin_begin(&now->sensors);
#endif
}

/* Each gives NULL, or what is wrong. */

static const char *values_get(const values *now, unsigned reference, double *value)
{
    if (reference == 0) {
        *value = now->time;
    } else if (reference <= STATES) {
        *value = now->x[reference - 1];
    } else if (reference <= STATES + COMMANDS) {
        *value = now->u[reference - 1 - STATES];
    } else if (reference <= STATES + COMMANDS + HIDDEN) {
        *value = now->memory.started ? now->memory.hidden[reference - 1 - STATES - COMMANDS] : 0.0;
#if LATE > 0
    } else if (reference <= STATES + COMMANDS + HIDDEN + LATE) {
        static const int places[LATE] = LATE_PLACES;
        double reading[STATES];
        twin_sensors sensors = now->sensors;
        twin_read(&sensors, now->x, reading);
        *value = reading[places[reference - 1 - STATES - COMMANDS - HIDDEN]];
#endif
    } else {
        return "Expected the value reference of a variable, found another number.";
    }
    return NULL;
}

static const char *values_set(values *now, unsigned reference, double value)
{
    if (!isfinite(value)) {
        return "Expected a finite value.";
    }
    if (now->mode == TERMINATED) {
        return "Expected values before the end of the simulation; reset it.";
    }
    if (reference >= 1 && reference <= STATES) {
        if (now->mode == STEPPING) {
            return "Expected states to be set before the simulation begins; set a state of the FMU instead.";
        }
        now->x[reference - 1] = value;
    } else if (reference > STATES && reference <= STATES + COMMANDS) {
        now->u[reference - 1 - STATES] = value;
    } else {
        return "Expected the value reference of a state or a command, found another number.";
    }
    return NULL;
}

static const char *values_step(values *now, double from, double step)
{
    const double periods = rint(step / PERIOD);
    double u[COMMANDS];
    if (now->mode != STEPPING) {
        return "Expected steps after the initialization and before the end.";
    }
    if (!(periods >= 1.0 && periods <= 1e9 && fabs(step - periods * PERIOD) <= 1e-6 * PERIOD)) {
        return "Expected a communication step of one period, or of several whole ones.";
    }
    if (!(fabs(from - now->time) <= 0.1 * PERIOD)) {
        return "Expected a step from where the last one ended.";
    }
    memcpy(u, now->u, sizeof u);
    twin_clip(u);
    for (double k = 0.0; k < periods; k += 1.0) {
#if LATE > 0
        double reading[STATES];
        twin_read(&now->sensors, now->x, reading);
#endif
        twin_step(&now->memory, now->x, u, now->x);
    }
    now->time = from + step;
    for (int i = 0; i < STATES; ++i) {
        if (!isfinite(now->x[i])) {
            return "Expected finite states, found that the twin diverges.";
        }
    }
    return NULL;
}

#endif
