/*
 * A robot in axial motion, as a co-simulation FMU (FMI 3.0), on the equations and the integrator of `spirillum.simulate`:
 * drive.c and axial.c are those of the package. Inputs stay constant over a step.
 *
 * robot.h, written with this file, holds the robot: TOKEN, FLOW_INPUT, VALUES, in the order of the enumerations, and CURVE,
 * that of a motor whose torque stands in place of the current (0: of none).
 */
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core.h"
#include "robot.h"

#define JOINED_(a, b) a##b
#define JOINED(a, b) JOINED_(a, b)
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

/* Places in VALUES, the parameters. */
enum {
    TORQUE, EMF, INDUCTANCE, CONSTANT, DECAY, DECAY_RATE, GROWTH, GROWTH_RATE, SLOPE, VOLTAGE, INTERNAL, POLARITY,
    SPEED, BODY, TAIL, SPEED_FLOW, BODY_FLOW, TAIL_FLOW, PARAMETERS
};
/* The state, and integrals of I^2 and R I^2. */
enum { CURRENT, POSITION, TAIL_ANGLE, BODY_ANGLE, CHARGE, SQUARE, HEAT, STATES };
/* Value references: time, inputs, outputs from FIRST_OUTPUT on in this order, parameters from FIRST_PARAMETER on. */
enum { TIME = 0, REMOTE = 1, DUTY = 2, FLOW = 3, FIRST_OUTPUT = 10, FIRST_PARAMETER = 100 };
enum {
    OUT_POSITION, OUT_TAIL_ANGLE, OUT_BODY_ANGLE, OUT_CHARGE, OUT_SPEED, OUT_TAIL_RATE, OUT_BODY_RATE, OUT_MOTOR_RATE,
    OUT_CURRENT, OUT_TORQUE, OUT_VOLTAGE, OUT_POWER, OUTPUTS
};
typedef enum { INSTANTIATED, INITIALIZING, STEPPING, TERMINATED, BROKEN } Mode;

typedef struct {
    double time, duty, flow;
    bool remote;
    double p[PARAMETERS];
    double state[STATES];
    Mode mode;
} Model;

typedef struct {
    Model now;
    void *environment;
    Log log;
    bool logging;
    char name[128];
} Robot;

static const double START[PARAMETERS] = VALUES, TORQUES[25] = CURVE;

static fmi3Status failed(Robot *robot, const char *message) {
    if (robot && robot->log) robot->log(robot->environment, fmi3Error, "logStatusError", message);
    return fmi3Error;
}

/* ---------------------------------------------------------------- equations */

/* See axial.c; pieces of a step as in a run of `simulate`. */
void advance_axial(const double *parameters, double *states, double dt, const double *duty, const double *flow,
                   double fineness, int64_t count);
void advance_on_curve(const double *parameters, double *states, double dt, const double *duty, const double *flow,
                      const double *curve, int64_t count);
static const double FINENESS = 16.0;

static double moved(const double *p, int per_torque, int per_flow, double current, double flow) {
    return p[per_torque] * p[TORQUE] * current + p[per_flow] * flow;
}

static double duty_of(const Model *m) { return m->remote ? fmin(fmax(m->duty, 0.0), 1.0) : 0.0; }

static double output(const Model *m, int which) {
    const double *p = m->p, i = m->state[CURRENT], voltage = p[VOLTAGE] - p[INTERNAL] * fabs(i);
    double tail = moved(p, TAIL, TAIL_FLOW, i, m->flow), body = moved(p, BODY, BODY_FLOW, i, m->flow);
    switch (which) {
    case OUT_POSITION: return m->state[POSITION];
    case OUT_TAIL_ANGLE: return m->state[TAIL_ANGLE];
    case OUT_BODY_ANGLE: return m->state[BODY_ANGLE];
    case OUT_CHARGE: return m->state[CHARGE];
    case OUT_SPEED: return moved(p, SPEED, SPEED_FLOW, i, m->flow);
    case OUT_TAIL_RATE: return tail;
    case OUT_BODY_RATE: return body;
    case OUT_MOTOR_RATE: return tail - body;
    case OUT_CURRENT: return i;
    case OUT_TORQUE: return p[TORQUE] * i;
    case OUT_VOLTAGE: return voltage;
    default: return p[POLARITY] * duty_of(m) * voltage * i;
    }
}

/* One step; false where the numbers have no motion. */
static bool advance(Model *m, double length) {
    const double duty = duty_of(m);
    if (TORQUES[0] > 0.0)
        advance_on_curve(m->p, m->state, length, &duty, &m->flow, TORQUES, 1);
    else
        advance_axial(m->p, m->state, length, &duty, &m->flow, FINENESS, 1);
    return isfinite(m->state[CURRENT]) && isfinite(m->state[CHARGE]);
}

/* ---------------------------------------------------------------- life of an instance */

static void started(Model *m) {
    memset(m, 0, sizeof *m);
    memcpy(m->p, START, sizeof START);
    m->remote = true;
    m->duty = START_DUTY;
    m->flow = START_FLOW;
    m->mode = INSTANTIATED;
}

EXPORT fmi3String FMI(fmi3GetVersion)(void) { return "3.0"; }

EXPORT fmi3Status FMI(fmi3SetDebugLogging)(void *instance, bool on, size_t count, const fmi3String categories[]) {
    (void)count, (void)categories;
    ((Robot *)instance)->logging = on;
    return fmi3OK;
}

EXPORT void *FMI(fmi3InstantiateCoSimulation)(fmi3String name, fmi3String token, fmi3String resources, bool visible,
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
    started(&robot->now);
    return robot;
}

EXPORT void *FMI(fmi3InstantiateModelExchange)(fmi3String name, fmi3String token, fmi3String resources, bool visible,
                                               bool logging, void *environment, Log log) {
    (void)name, (void)token, (void)resources, (void)visible, (void)logging;
    if (log) log(environment, fmi3Error, "logStatusError", "this FMU is for co-simulation");
    return NULL;
}

EXPORT void *FMI(fmi3InstantiateScheduledExecution)(fmi3String name, fmi3String token, fmi3String resources,
                                                    bool visible, bool logging, void *environment, Log log,
                                                    void *clock, void *lock, void *unlock) {
    (void)clock, (void)lock, (void)unlock;
    return FMI(fmi3InstantiateModelExchange)(name, token, resources, visible, logging, environment, log);
}

EXPORT void FMI(fmi3FreeInstance)(void *instance) { free(instance); }

EXPORT fmi3Status FMI(fmi3EnterInitializationMode)(void *instance, bool tolerance_defined, double tolerance,
                                                   double start, bool stop_defined, double stop) {
    Robot *robot = instance;
    (void)tolerance_defined, (void)tolerance, (void)stop_defined, (void)stop;
    if (robot->now.mode != INSTANTIATED) return failed(robot, "initialization has begun already; allowed: reset");
    if (!isfinite(start)) return failed(robot, "the start time is no number");
    robot->now.time = start;
    robot->now.mode = INITIALIZING;
    return fmi3OK;
}

EXPORT fmi3Status FMI(fmi3ExitInitializationMode)(void *instance) {
    Robot *robot = instance;
    if (robot->now.mode != INITIALIZING) return failed(robot, "initialization has not begun");
    robot->now.mode = STEPPING;
    return fmi3OK;
}

EXPORT fmi3Status FMI(fmi3Terminate)(void *instance) {
    ((Robot *)instance)->now.mode = TERMINATED;
    return fmi3OK;
}

EXPORT fmi3Status FMI(fmi3Reset)(void *instance) {
    started(&((Robot *)instance)->now);
    return fmi3OK;
}

EXPORT fmi3Status FMI(fmi3DoStep)(void *instance, double time, double length, bool no_way_back, bool *event,
                                  bool *terminate, bool *early, double *last) {
    Robot *robot = instance;
    Model *m = &robot->now;
    (void)no_way_back;
    if (event) *event = false;
    if (terminate) *terminate = false;
    if (early) *early = false;
    if (last) *last = m->time;
    if (m->mode != STEPPING) return failed(robot, "a step outside step mode; allowed: after initialization");
    if (!(length > 0.0) || !isfinite(length)) return failed(robot, "the step is no positive time");
    if (!(fabs(time - m->time) <= 1e-9 * fmax(1.0, fabs(time)) + 1e-6 * length))
        return failed(robot, "the step does not begin where the last one ended");
    if (!advance(m, length)) {
        m->mode = BROKEN;
        return failed(robot, "the motor's current cannot be integrated with these numbers");
    }
    m->time = time + length;
    if (last) *last = m->time;
    return fmi3OK;
}

/* ---------------------------------------------------------------- values */

EXPORT fmi3Status FMI(fmi3GetFloat64)(void *instance, const Ref refs[], size_t count, double values[], size_t size) {
    Robot *robot = instance;
    const Model *m = &robot->now;
    if (size != count) return failed(robot, "as many values as references are asked for");
    for (size_t n = 0; n < count; n++) {
        Ref r = refs[n];
        if (r == TIME) values[n] = m->time;
        else if (r == DUTY) values[n] = m->duty;
        else if (r == FLOW && FLOW_INPUT) values[n] = m->flow;
        else if (r >= FIRST_OUTPUT && r < FIRST_OUTPUT + OUTPUTS) values[n] = output(m, (int)(r - FIRST_OUTPUT));
        else if (r >= FIRST_PARAMETER && r < FIRST_PARAMETER + PARAMETERS) values[n] = m->p[r - FIRST_PARAMETER];
        else return failed(robot, "an unknown value reference of a Float64");
    }
    return fmi3OK;
}

EXPORT fmi3Status FMI(fmi3SetFloat64)(void *instance, const Ref refs[], size_t count, const double values[],
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
        if (r == FIRST_PARAMETER + INDUCTANCE && !(values[n] > 0.0)) return failed(robot, "the inductance is not positive");
    }
    for (size_t n = 0; n < count; n++) {
        Ref r = refs[n];
        if (r == DUTY) m->duty = values[n];
        else if (r == FLOW) m->flow = values[n];
        else m->p[r - FIRST_PARAMETER] = values[n];
    }
    return fmi3OK;
}

EXPORT fmi3Status FMI(fmi3GetBoolean)(void *instance, const Ref refs[], size_t count, bool values[], size_t size) {
    Robot *robot = instance;
    for (size_t n = 0; n < count; n++) {
        if (refs[n] != REMOTE || size != count) return failed(robot, "an unknown value reference of a Boolean");
        values[n] = robot->now.remote;
    }
    return fmi3OK;
}

EXPORT fmi3Status FMI(fmi3SetBoolean)(void *instance, const Ref refs[], size_t count, const bool values[],
                                      size_t size) {
    Robot *robot = instance;
    for (size_t n = 0; n < count; n++)
        if (refs[n] != REMOTE || size != count) return failed(robot, "an unknown value reference of a Boolean");
    for (size_t n = 0; n < count; n++) robot->now.remote = values[n];
    return fmi3OK;
}

EXPORT fmi3Status FMI(fmi3GetFMUState)(void *instance, void **state) {
    Robot *robot = instance;
    if (!*state) *state = malloc(sizeof(Model));
    if (!*state) return failed(robot, "no memory is left");
    memcpy(*state, &robot->now, sizeof(Model));
    return fmi3OK;
}

EXPORT fmi3Status FMI(fmi3SetFMUState)(void *instance, void *state) {
    if (!state) return failed(instance, "there is no such state");
    memcpy(&((Robot *)instance)->now, state, sizeof(Model));
    return fmi3OK;
}

EXPORT fmi3Status FMI(fmi3FreeFMUState)(void *instance, void **state) {
    (void)instance;
    free(*state);
    *state = NULL;
    return fmi3OK;
}

EXPORT fmi3Status FMI(fmi3SerializedFMUStateSize)(void *instance, void *state, size_t *size) {
    (void)instance, (void)state;
    *size = sizeof(Model);
    return fmi3OK;
}

EXPORT fmi3Status FMI(fmi3SerializeFMUState)(void *instance, void *state, uint8_t bytes[], size_t size) {
    if (!state || size < sizeof(Model)) return failed(instance, "the state does not fit");
    memcpy(bytes, state, sizeof(Model));
    return fmi3OK;
}

EXPORT fmi3Status FMI(fmi3DeserializeFMUState)(void *instance, const uint8_t bytes[], size_t size, void **state) {
    if (size != sizeof(Model)) return failed(instance, "these bytes are no state of this FMU");
    if (!*state) *state = malloc(sizeof(Model));
    if (!*state) return failed(instance, "no memory is left");
    memcpy(*state, bytes, sizeof(Model));
    return fmi3OK;
}

/* ---------------------------------------------------------------- what this FMU does not have */

static fmi3Status absent(void *instance) { return failed(instance, "this FMU does not have this function"); }

#define GET_SET(kind, type)                                                                                            \
    EXPORT fmi3Status FMI(fmi3Get##kind)(void *instance, const Ref refs[], size_t count, type values[], size_t size) { \
        (void)refs, (void)values, (void)size;                                                                          \
        return count ? absent(instance) : fmi3OK;                                                                      \
    }                                                                                                                  \
    EXPORT fmi3Status FMI(fmi3Set##kind)(void *instance, const Ref refs[], size_t count, const type values[],          \
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
    EXPORT fmi3Status FMI(name)(void *instance) { return absent(instance); }
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
