/* A free robot in six degrees of freedom, on the equations and the integrator of `spirillum.simulate`: stiff_steps.c.
 *
 * Its numbers, in robot_numbers.c: what it is packed to for the equations (DATA), its table (TABLE), the state that it
 * starts from (FIRST), sizes of the state's components (SIZES), and where tube and battery end (LIMITS).
 *
 * The integrator's steps do not end where those of the importer do: the state there lies inside of a step, which is taken
 * again, from its beginning, as far as it goes beyond. Whatever the importer's steps are, the run is the same.
 */
#include <stddef.h>
#include <string.h>

#include "model.h"
#include "stiff_steps.h"

extern const double DATA[], TABLE[], FIRST[STATES], SIZES[STATES + 2], LIMITS[];

enum { WATCHING = GAPS + WATCHED };
enum { STEPS = 64 };      /* of the integrator between two looks */
static const double ROUNDING = 1e-15; /* share of a step within which an end is found */

/* The model's state. */
typedef struct {
    Memory memory;
    double y[STATES];                                /* at the importer's time */
    double before[STATES];                           /* where the integrator's last step began */
    double increments[STAGES][STATES], gaps[WATCHING];
    double duty, flow, spent, begun;                 /* of the last step; whether the battery is empty, and any step taken */
    double data[DATA_SIZE];                          /* begins with what is observed */
} Free;

_Static_assert(sizeof(Free) == STATE * sizeof(double), "the numbers of robot.h");

static Free *free_of(Model *m) { return (Free *)m->state; }
static const Free *seen_of(const Model *m) { return (const Free *)m->state; }

/* The packed robot at a duty, with nothing observed. */
static void pack(Free *f, double duty, double flow) {
    memcpy(f->data, DATA, sizeof f->data);
    f->data[DUTY_PLACE] = duty;
    if (FLOW_INPUT) f->data[DATA_SIZE - 1] = flow;
}

static void observe_at(Free *f, double time, const double *y) {
    double dy[STATES];
    rates(dy, time, y, f->data, TABLE, DATA_SIZE, TABLE_SIZE);
}

static double outside_at(Free *f, double time, const double *y) {
    if (TABLE_SIZE == 0) return 0.0;
    observe_at(f, time, y);
    return ((const Seen *)f->data)->outside;
}

static Limits limits_of(const Free *f) {
    Limits limits;
    memcpy(&limits, LIMITS, sizeof limits);
    if (f->spent != 0.0) limits.most_charge = INFINITY;
    return limits;
}

void start_model(Model *m) {
    Free *f = free_of(m);
    memset(m, 0, sizeof *m);
    m->remote = true;
    m->duty = START_DUTY;
    m->flow = START_FLOW;
    memcpy(f->y, FIRST, sizeof f->y);
    f->memory.step = FIRST_STEP;
    observe_model(m);
}

const char *parameter_problem(int parameter, double value) {
    (void)parameter, (void)value;
    return NULL;
}

static double asked_duty(const Model *m) { return seen_of(m)->spent != 0.0 ? 0.0 : duty_of(m); }

void observe_model(Model *m) {
    Free *f = free_of(m);
    pack(f, asked_duty(m), m->flow);
    observe_at(f, m->time, f->y);
}

/* Something that is watched, at a share of the last step. */
static double watched_at(Free *f, const Limits *limits, const double *end, double share, int place, double *inner) {
    double gaps[WATCHING];
    const double time = f->memory.last_time + share * (f->memory.time - f->memory.last_time);
    interpolate(share, f->before, end, f->increments[0], inner);
    const double outside = place == GAPS + WITHIN ? outside_at(f, time, inner) : 0.0;
    watched(inner, outside, f->data, TABLE, limits, ROUGHNESS, gaps, DATA_SIZE, TABLE_SIZE, WATCHING);
    return gaps[place];
}

/* Share of the last step at which something that is watched, and was positive, no longer is; the state there. */
static double crossing_of(Free *f, const Limits *limits, const double *end, int place, double *inner) {
    double low = 0.0, high = 1.0;
    while (high - low > ROUNDING) {
        const double middle = 0.5 * (low + high);
        if (middle <= low || middle >= high) break;
        if (watched_at(f, limits, end, middle, place, inner) > 0.0) low = middle;
        else high = middle;
    }
    watched_at(f, limits, end, high, place, inner);
    return high;
}

/* What has ended in the last step up to a time, first; its place, or -1. The run is then where it did. */
static int ended_in_step(Free *f, const Limits *limits, const double *gaps, double *y, double stop) {
    const Memory step = f->memory;
    double first = INFINITY, at[STATES];
    int found = -1;
    for (int place = GAPS; place < WATCHING; place++) {
        double inner[STATES];
        if (!(gaps[place] > 0.0 && !(f->gaps[place] > 0.0))) continue;
        const double time = step.last_time + crossing_of(f, limits, y, place, inner) * (step.time - step.last_time);
        if (!(time < first) || time > stop) continue;
        first = time;
        found = place;
        memcpy(at, inner, sizeof at);
    }
    if (found >= 0) {
        memcpy(y, at, sizeof at);
        f->memory.time = first;
        f->memory.step = step.last_step;
    }
    return found;
}

/* How a stretch ended. */
typedef enum { ARRIVED, EMPTY, AT_END, TOO_STIFF } Arrival;

/* Follow the run from its last step to a time, at which its state is written to `y`; `clip`: a step ends there. */
static Arrival follow(Free *f, double duty, double flow, double stop, bool clip, double *y) {
    const Limits limits = limits_of(f);
    double run[STATES], sizes[STATES + 2], samples[1] = {stop}, states[1][STATES], gaps[WATCHING];
    double jacobian[ACTING * ACTING]; /* which a run does not need */
    bool answered = false;
    memcpy(sizes, SIZES, sizeof sizes);
    memcpy(run, y, sizeof run);
    pack(f, duty, flow);
    const double outside = outside_at(f, f->memory.time, run);
    pack(f, duty, flow);
    watched(run, outside, f->data, TABLE, &limits, ROUGHNESS, f->gaps, DATA_SIZE, TABLE_SIZE, WATCHING);
    for (;;) {
        memcpy(gaps, f->gaps, sizeof gaps);
        const int64_t status
            = advance(stop, clip, STEPS, TOLERANCE, &f->memory, run, f->before, f->increments[0], jacobian, f->gaps,
                      samples, states[0], sizes, &limits, ROUGHNESS, f->data, TABLE, WATCHING,
                      answered ? 0 : 1, DATA_SIZE, TABLE_SIZE);
        if (f->memory.answered > 0.0) {
            memcpy(y, states[0], sizeof states[0]);
            answered = true;
        }
        if (status == STUCK) return TOO_STIFF;
        if (status == DONE) break;
        if (status != CROSSED) continue;
        const int place = ended_in_step(f, &limits, gaps, run, stop);
        if (place < 0) continue;
        memcpy(y, run, sizeof run);
        return place == GAPS + CHARGE_LEFT ? EMPTY : AT_END;
    }
    if (clip) memcpy(y, run, sizeof run);
    return ARRIVED;
}

/* Go back to the beginning of the integrator's last step, as it was first tried; the state there. */
static void take_again(Free *f, double *y) {
    f->memory.time = f->memory.last_time;
    f->memory.step = f->memory.last_step;
    memcpy(y, f->before, sizeof f->before);
}

/* Follow the run until the time, over changes of duty and an empty battery. */
static Arrival follow_to(Model *m, double stop) {
    Free *f = free_of(m);
    const double now = m->time, flow = m->flow;
    double y[STATES], duty = asked_duty(m);
    memcpy(y, f->y, sizeof y);
    if (f->begun == 0.0) {
        f->memory.time = now;
    } else if (flow != f->flow) {
        f->memory.time = now;
        f->memory.step = f->memory.last_step;
    } else {
        take_again(f, y);
        if (duty != f->duty && f->memory.time < now) {
            const Arrival arrival = follow(f, f->duty, flow, now, true, y);
            if (arrival != ARRIVED) return arrival;
        }
    }
    Arrival arrival = follow(f, duty, flow, stop, false, y);
    if (arrival == EMPTY) {
        f->spent = 1.0;
        duty = 0.0;
        arrival = f->memory.time < stop ? follow(f, duty, flow, stop, false, y) : ARRIVED;
    }
    f->begun = 1.0;
    f->duty = duty;
    f->flow = flow;
    memcpy(f->y, y, sizeof y);
    return arrival;
}

const char *advance_model(Model *m, double length) {
    const double stop = m->time + length;
    const Arrival arrival = follow_to(m, stop);
    if (arrival == TOO_STIFF) return "no step is small enough: the motion cannot be followed";
    if (arrival == AT_END) m->mode = ENDED;
    m->time = arrival == AT_END ? free_of(m)->memory.time : stop;
    observe_model(m);
    return NULL;
}

/* In the order of `spirillum.interfaces.fmu`. */
enum {
    X, Y, Z, QUATERNION_W, QUATERNION_X, QUATERNION_Y, QUATERNION_Z, TAIL_ANGLE, BODY_ANGLE, SPEED, TAIL_RATE, BODY_RATE,
    MOTOR_RATE, PITCH, YAW, DRIVE_ENERGY, OFFSET, AZIMUTH, WALL_PITCH, WALL_YAW, WALL_GAP, CONTACT_FORCE, MEAN_FLOW,
    MOTOR_TORQUE, CURRENT, VOLTAGE, POWER, CHARGE, OUTPUT_COUNT
};
_Static_assert(OUTPUT_COUNT == OUTPUTS, "the numbers of robot.h");

static double unit_quaternion(const State *y, int part) {
    const double *q = y->attitude;
    return q[part] / sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
}

double output_of(const Model *m, int output) {
    const Free *f = seen_of(m);
    const State *y = (const State *)f->y;
    const Seen *seen = (const Seen *)f->data;
    const Motor *motor = &((const Links *)(f->data + SEEN))->drive.motor;
    const double *q = seen->rates, voltage = motor->voltage - motor->internal_resistance * fabs(y->current);
    double rotation[3][3];
    axes_of(y, rotation);
    switch (output) {
    case X:
    case Y:
    case Z: return y->position[output - X];
    case QUATERNION_W:
    case QUATERNION_X:
    case QUATERNION_Y:
    case QUATERNION_Z: return unit_quaternion(y, output - QUATERNION_W);
    case TAIL_ANGLE: return y->roll + y->phase - FIRST[offsetof(State, phase) / sizeof(double)];
    case BODY_ANGLE: return y->roll;
    case SPEED: return rotation[0][0] * q[0] + rotation[0][1] * q[1] + rotation[0][2] * q[2];
    case TAIL_RATE: return q[SPIN] + q[JOINT];
    case BODY_RATE: return q[SPIN];
    case MOTOR_RATE: return q[JOINT];
    case PITCH: return asin(clamped(rotation[2][0], -1.0, 1.0));
    case YAW: return atan2(rotation[1][0], rotation[0][0]);
    case DRIVE_ENERGY: return y->driven;
    case OFFSET: return seen->offset;
    case AZIMUTH: return seen->azimuth;
    case WALL_PITCH: return seen->pitch;
    case WALL_YAW: return seen->yaw;
    case WALL_GAP: return seen->film;
    case CONTACT_FORCE: return seen->contact_force;
    case MEAN_FLOW: return seen->mean_flow;
    case MOTOR_TORQUE: return seen->drive_torque;
    case CURRENT: return motor->polarity * y->current;
    case VOLTAGE: return voltage;
    case POWER: return asked_duty(m) * voltage * y->current;
    default: return y->charge;
    }
}
