/* Functions of FMI 3.0 for a co-simulation FMU, around a model (model.h). Inputs stay constant over a step. */
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "model.h"

#define JOINED_(a, b) a##b
#define JOINED(a, b) JOINED_(a, b)
#if defined(_WIN32)
#define FMI_EXPORT __declspec(dllexport)
#else
#define FMI_EXPORT __attribute__((visibility("default")))
#endif
#if defined(FMI3_FUNCTION_PREFIX)
#define FMI(name) JOINED(FMI3_FUNCTION_PREFIX, name)
#else
#define FMI(name) name
#endif

/* The types of FMI 3.0, section 2.2. */
typedef enum { fmi3OK, fmi3Warning, fmi3Discard, fmi3Error, fmi3Fatal } fmi3Status;
typedef const char *fmi3String;
typedef const uint8_t *fmi3Binary;
typedef uint32_t Ref;
typedef void (*Log)(void *environment, fmi3Status status, fmi3String category, fmi3String message);

typedef struct {
    Model now;
    void *environment;
    Log log;
    bool logging;
    char name[128];
} Robot;

static fmi3Status failed(Robot *robot, const char *message) {
    if (robot && robot->log) robot->log(robot->environment, fmi3Error, "logStatusError", message);
    return fmi3Error;
}

/* ---------------------------------------------------------------- life of an instance */

FMI_EXPORT fmi3String FMI(fmi3GetVersion)(void) { return "3.0"; }

FMI_EXPORT fmi3Status FMI(fmi3SetDebugLogging)(void *instance, bool on, size_t count, const fmi3String categories[]) {
    (void)count, (void)categories;
    ((Robot *)instance)->logging = on;
    return fmi3OK;
}

FMI_EXPORT void *FMI(fmi3InstantiateCoSimulation)(fmi3String name, fmi3String token, fmi3String resources, bool visible,
                                              bool logging, bool event_mode, bool early_return, const Ref required[],
                                              size_t count, void *environment, Log log, void *update) {
    (void)resources, (void)visible, (void)event_mode, (void)early_return, (void)required, (void)count, (void)update;
    if (!token || strcmp(token, TOKEN) != 0) {
        if (log) log(environment, fmi3Error, "logStatusError", "the instantiation token is that of another FMU");
        return NULL;
    }
    Robot *robot = calloc(1, sizeof *robot);
    if (!robot) return NULL;
    snprintf(robot->name, sizeof robot->name, "%s", name ? name : "");
    robot->environment = environment;
    robot->log = log;
    robot->logging = logging;
    start_model(&robot->now);
    return robot;
}

FMI_EXPORT void *FMI(fmi3InstantiateModelExchange)(fmi3String name, fmi3String token, fmi3String resources, bool visible,
                                               bool logging, void *environment, Log log) {
    (void)name, (void)token, (void)resources, (void)visible, (void)logging;
    if (log) log(environment, fmi3Error, "logStatusError", "this FMU is for co-simulation");
    return NULL;
}

FMI_EXPORT void *FMI(fmi3InstantiateScheduledExecution)(fmi3String name, fmi3String token, fmi3String resources,
                                                    bool visible, bool logging, void *environment, Log log,
                                                    void *clock, void *lock, void *unlock) {
    (void)clock, (void)lock, (void)unlock;
    return FMI(fmi3InstantiateModelExchange)(name, token, resources, visible, logging, environment, log);
}

FMI_EXPORT void FMI(fmi3FreeInstance)(void *instance) { free(instance); }

FMI_EXPORT fmi3Status FMI(fmi3EnterInitializationMode)(void *instance, bool tolerance_defined, double tolerance,
                                                   double start, bool stop_defined, double stop) {
    Robot *robot = instance;
    (void)tolerance_defined, (void)tolerance, (void)stop_defined, (void)stop;
    if (robot->now.mode != INSTANTIATED) return failed(robot, "initialization has begun already; allowed: reset");
    if (!isfinite(start)) return failed(robot, "the start time is no number");
    robot->now.time = start;
    robot->now.mode = INITIALIZING;
    return fmi3OK;
}

FMI_EXPORT fmi3Status FMI(fmi3ExitInitializationMode)(void *instance) {
    Robot *robot = instance;
    if (robot->now.mode != INITIALIZING) return failed(robot, "initialization has not begun");
    robot->now.mode = STEPPING;
    return fmi3OK;
}

FMI_EXPORT fmi3Status FMI(fmi3Terminate)(void *instance) {
    ((Robot *)instance)->now.mode = TERMINATED;
    return fmi3OK;
}

FMI_EXPORT fmi3Status FMI(fmi3Reset)(void *instance) {
    start_model(&((Robot *)instance)->now);
    return fmi3OK;
}

FMI_EXPORT fmi3Status FMI(fmi3DoStep)(void *instance, double time, double length, bool no_way_back, bool *event,
                                  bool *terminate, bool *early, double *last) {
    Robot *robot = instance;
    Model *m = &robot->now;
    (void)no_way_back;
    if (event) *event = false;
    if (terminate) *terminate = false;
    if (early) *early = false;
    if (last) *last = m->time;
    if (m->mode == ENDED) return failed(robot, "the run has ended; allowed: reset");
    if (m->mode != STEPPING) return failed(robot, "a step outside step mode; allowed: after initialization");
    if (!(length > 0.0) || !isfinite(length)) return failed(robot, "the step is no positive time");
    if (!(fabs(time - m->time) <= 1e-9 * fmax(1.0, fabs(time)) + 1e-6 * length))
        return failed(robot, "the step does not begin where the last one ended");
    const char *problem = advance_model(m, length);
    if (problem) {
        m->mode = BROKEN;
        return failed(robot, problem);
    }
    if (last) *last = m->time;
    if (m->mode == ENDED && terminate) *terminate = true;
    return fmi3OK;
}

/* ---------------------------------------------------------------- values */

FMI_EXPORT fmi3Status FMI(fmi3GetFloat64)(void *instance, const Ref refs[], size_t count, double values[], size_t size) {
    Robot *robot = instance;
    const Model *m = &robot->now;
    if (size != count) return failed(robot, "as many values as references are asked for");
    for (size_t n = 0; n < count; n++) {
        Ref r = refs[n];
        if (r == TIME) values[n] = m->time;
        else if (r == DUTY) values[n] = m->duty;
        else if (r == FLOW && FLOW_INPUT) values[n] = m->flow;
        else if (r >= FIRST_OUTPUT && r < FIRST_OUTPUT + OUTPUTS) values[n] = output_of(m, (int)(r - FIRST_OUTPUT));
        else if (r >= FIRST_PARAMETER && r < FIRST_PARAMETER + PARAMETERS) values[n] = m->p[r - FIRST_PARAMETER];
        else return failed(robot, "an unknown value reference of a Float64");
    }
    return fmi3OK;
}

FMI_EXPORT fmi3Status FMI(fmi3SetFloat64)(void *instance, const Ref refs[], size_t count, const double values[],
                                      size_t size) {
    Robot *robot = instance;
    Model *m = &robot->now;
    if (size != count) return failed(robot, "as many values as references are asked for");
    for (size_t n = 0; n < count; n++) { /* nothing is set where one of them is wrong */
        Ref r = refs[n];
        bool parameter = r >= FIRST_PARAMETER && r < FIRST_PARAMETER + PARAMETERS;
        if (!(r == DUTY || (r == FLOW && FLOW_INPUT) || parameter))
            return failed(robot, "an unknown value reference of a Float64 that can be set");
        if (!isfinite(values[n])) return failed(robot, "an input or parameter is no number");
        if (r == DUTY && !(values[n] >= 0.0 && values[n] <= 1.0)) return failed(robot, "duty is not from 0 to 1");
        if (parameter && m->mode > INITIALIZING) return failed(robot, "a parameter is set after initialization");
        const char *problem = parameter ? parameter_problem((int)(r - FIRST_PARAMETER), values[n]) : NULL;
        if (problem) return failed(robot, problem);
    }
    for (size_t n = 0; n < count; n++) {
        Ref r = refs[n];
        if (r == DUTY) m->duty = values[n];
        else if (r == FLOW) m->flow = values[n];
        else m->p[r - FIRST_PARAMETER] = values[n];
    }
    observe_model(m);
    return fmi3OK;
}

FMI_EXPORT fmi3Status FMI(fmi3GetBoolean)(void *instance, const Ref refs[], size_t count, bool values[], size_t size) {
    Robot *robot = instance;
    for (size_t n = 0; n < count; n++) {
        if (refs[n] != REMOTE || size != count) return failed(robot, "an unknown value reference of a Boolean");
        values[n] = robot->now.remote;
    }
    return fmi3OK;
}

FMI_EXPORT fmi3Status FMI(fmi3SetBoolean)(void *instance, const Ref refs[], size_t count, const bool values[],
                                      size_t size) {
    Robot *robot = instance;
    for (size_t n = 0; n < count; n++)
        if (refs[n] != REMOTE || size != count) return failed(robot, "an unknown value reference of a Boolean");
    for (size_t n = 0; n < count; n++) robot->now.remote = values[n];
    observe_model(&robot->now);
    return fmi3OK;
}

FMI_EXPORT fmi3Status FMI(fmi3GetFMUState)(void *instance, void **state) {
    Robot *robot = instance;
    if (!*state) *state = malloc(sizeof(Model));
    if (!*state) return failed(robot, "no memory is left");
    memcpy(*state, &robot->now, sizeof(Model));
    return fmi3OK;
}

FMI_EXPORT fmi3Status FMI(fmi3SetFMUState)(void *instance, void *state) {
    if (!state) return failed(instance, "there is no such state");
    memcpy(&((Robot *)instance)->now, state, sizeof(Model));
    return fmi3OK;
}

FMI_EXPORT fmi3Status FMI(fmi3FreeFMUState)(void *instance, void **state) {
    (void)instance;
    free(*state);
    *state = NULL;
    return fmi3OK;
}

FMI_EXPORT fmi3Status FMI(fmi3SerializedFMUStateSize)(void *instance, void *state, size_t *size) {
    (void)instance, (void)state;
    *size = sizeof(Model);
    return fmi3OK;
}

FMI_EXPORT fmi3Status FMI(fmi3SerializeFMUState)(void *instance, void *state, uint8_t bytes[], size_t size) {
    if (!state || size < sizeof(Model)) return failed(instance, "the state does not fit");
    memcpy(bytes, state, sizeof(Model));
    return fmi3OK;
}

FMI_EXPORT fmi3Status FMI(fmi3DeserializeFMUState)(void *instance, const uint8_t bytes[], size_t size, void **state) {
    if (size != sizeof(Model)) return failed(instance, "these bytes are no state of this FMU");
    if (!*state) *state = malloc(sizeof(Model));
    if (!*state) return failed(instance, "no memory is left");
    memcpy(*state, bytes, sizeof(Model));
    return fmi3OK;
}

/* ---------------------------------------------------------------- what this FMU does not have */

static fmi3Status absent(void *instance) { return failed(instance, "this FMU does not have this function"); }

#define GET_SET(kind, type)                                                                                            \
    FMI_EXPORT fmi3Status FMI(fmi3Get##kind)(void *instance, const Ref refs[], size_t count, type values[], size_t size) { \
        (void)refs, (void)values, (void)size;                                                                          \
        return count ? absent(instance) : fmi3OK;                                                                      \
    }                                                                                                                  \
    FMI_EXPORT fmi3Status FMI(fmi3Set##kind)(void *instance, const Ref refs[], size_t count, const type values[],          \
                                         size_t size) {                                                                \
        (void)refs, (void)values, (void)size;                                                                          \
        return count ? absent(instance) : fmi3OK;                                                                      \
    }
GET_SET(Float32, float)
GET_SET(Int8, int8_t)
GET_SET(UInt8, uint8_t)
GET_SET(Int16, int16_t)
GET_SET(UInt16, uint16_t)
GET_SET(Int32, int32_t)
GET_SET(UInt32, uint32_t)
GET_SET(Int64, int64_t)
GET_SET(UInt64, uint64_t)
GET_SET(String, fmi3String)

/* Their arguments are never looked at, so that the first one is enough. */
#define ABSENT(name)                                             \
    FMI_EXPORT fmi3Status FMI(name)(void *instance) { return absent(instance); }
ABSENT(fmi3GetBinary)
ABSENT(fmi3SetBinary)
ABSENT(fmi3GetClock)
ABSENT(fmi3SetClock)
ABSENT(fmi3GetNumberOfVariableDependencies)
ABSENT(fmi3GetVariableDependencies)
ABSENT(fmi3GetDirectionalDerivative)
ABSENT(fmi3GetAdjointDerivative)
ABSENT(fmi3EnterConfigurationMode)
ABSENT(fmi3ExitConfigurationMode)
ABSENT(fmi3EnterEventMode)
ABSENT(fmi3EnterStepMode)
ABSENT(fmi3EnterContinuousTimeMode)
ABSENT(fmi3GetIntervalDecimal)
ABSENT(fmi3GetIntervalFraction)
ABSENT(fmi3GetShiftDecimal)
ABSENT(fmi3GetShiftFraction)
ABSENT(fmi3SetIntervalDecimal)
ABSENT(fmi3SetIntervalFraction)
ABSENT(fmi3SetShiftDecimal)
ABSENT(fmi3SetShiftFraction)
ABSENT(fmi3EvaluateDiscreteStates)
ABSENT(fmi3UpdateDiscreteStates)
ABSENT(fmi3GetOutputDerivatives)
ABSENT(fmi3ActivateModelPartition)
ABSENT(fmi3CompletedIntegratorStep)
ABSENT(fmi3SetTime)
ABSENT(fmi3SetContinuousStates)
ABSENT(fmi3GetContinuousStateDerivatives)
ABSENT(fmi3GetEventIndicators)
ABSENT(fmi3GetContinuousStates)
ABSENT(fmi3GetNominalsOfContinuousStates)
ABSENT(fmi3GetNumberOfEventIndicators)
ABSENT(fmi3GetNumberOfContinuousStates)
