/* A robot in axial motion, on the equations and the integrator of `spirillum.simulate`: axial.c of csrc/.
 *
 * VALUES of robot.h are the parameters, in the order of the enumeration; CURVE is that of a motor whose torque stands in
 * place of the current (0: of none).
 */
#include <string.h>

#include "axial.h"
#include "model.h"

enum {
    TORQUE, EMF, INDUCTANCE, CONSTANT, DECAY, DECAY_RATE, GROWTH, GROWTH_RATE, SLOPE, VOLTAGE, INTERNAL, POLARITY,
    SPEED, BODY, TAIL, SPEED_FLOW, BODY_FLOW, TAIL_FLOW, VALUE_COUNT
};
/* The state, and integrals of I^2 and R I^2. */
enum { CURRENT, POSITION, TAIL_ANGLE, BODY_ANGLE, CHARGE, SQUARE, HEAT, STATE_COUNT };
enum {
    OUT_POSITION, OUT_TAIL_ANGLE, OUT_BODY_ANGLE, OUT_CHARGE, OUT_SPEED, OUT_TAIL_RATE, OUT_BODY_RATE, OUT_MOTOR_RATE,
    OUT_CURRENT, OUT_TORQUE, OUT_VOLTAGE, OUT_POWER, OUTPUT_COUNT
};
_Static_assert(VALUE_COUNT == PARAMETERS && STATE_COUNT == STATE && OUTPUT_COUNT == OUTPUTS, "the numbers of robot.h");

static const double START[PARAMETERS] = VALUES, TORQUES[25] = CURVE;
static const double FINENESS = 16.0; /* pieces of a step as in a run of `simulate` */

void start_model(Model *m) {
    memset(m, 0, sizeof *m);
    memcpy(m->p, START, sizeof START);
    m->remote = true;
    m->duty = START_DUTY;
    m->flow = START_FLOW;
}

const char *parameter_problem(int parameter, double value) {
    return parameter == INDUCTANCE && !(value > 0.0) ? "the inductance is not positive" : NULL;
}

void observe_model(Model *m) { (void)m; }

const char *advance_model(Model *m, double length) {
    const double duty = duty_of(m);
    if (TORQUES[0] > 0.0)
        advance_on_curve(m->p, m->state, length, &duty, &m->flow, TORQUES, 1);
    else
        advance_axial(m->p, m->state, length, &duty, &m->flow, FINENESS, 1);
    m->time += length;
    const bool finite = isfinite(m->state[CURRENT]) && isfinite(m->state[CHARGE]);
    return finite ? NULL : "the motor's current cannot be integrated with these numbers";
}

static double moved(const Model *m, int per_torque, int per_flow) {
    return m->p[per_torque] * m->p[TORQUE] * m->state[CURRENT] + m->p[per_flow] * m->flow;
}

double output_of(const Model *m, int output) {
    const double *p = m->p, i = m->state[CURRENT], voltage = p[VOLTAGE] - p[INTERNAL] * fabs(i);
    const double tail = moved(m, TAIL, TAIL_FLOW), body = moved(m, BODY, BODY_FLOW);
    switch (output) {
    case OUT_POSITION: return m->state[POSITION];
    case OUT_TAIL_ANGLE: return m->state[TAIL_ANGLE];
    case OUT_BODY_ANGLE: return m->state[BODY_ANGLE];
    case OUT_CHARGE: return m->state[CHARGE];
    case OUT_SPEED: return moved(m, SPEED, SPEED_FLOW);
    case OUT_TAIL_RATE: return tail;
    case OUT_BODY_RATE: return body;
    case OUT_MOTOR_RATE: return tail - body;
    case OUT_CURRENT: return i;
    case OUT_TORQUE: return p[TORQUE] * i;
    case OUT_VOLTAGE: return voltage;
    default: return p[POLARITY] * duty_of(m) * voltage * i;
    }
}
