/* A robot in axial motion, on the equations and the integrator of `spirillum.simulate`: axial.c of csrc/.
 *
 * VALUES of robot.h are the parameters, those of `Axial`; CURVE is that of a motor whose torque stands in
 * place of the current (0: of none).
 */
#include <stddef.h>
#include <string.h>

#include "axial.h"
#include "model.h"

enum {
    OUT_POSITION, OUT_TAIL_ANGLE, OUT_BODY_ANGLE, OUT_CHARGE, OUT_SPEED, OUT_TAIL_RATE, OUT_BODY_RATE, OUT_MOTOR_RATE,
    OUT_CURRENT, OUT_TORQUE, OUT_VOLTAGE, OUT_POWER, OUTPUT_COUNT
};
_Static_assert(sizeof(Axial) == PARAMETERS * sizeof(double) && sizeof(AxialState) == STATE * sizeof(double)
                   && OUTPUT_COUNT == OUTPUTS,
               "the numbers of robot.h");

static const double START[PARAMETERS] = VALUES, TORQUES[25] = CURVE;
static const Curve *const OF_TORQUES = (const Curve *)TORQUES;
static const double FINENESS = 16.0; /* pieces of a step as in a run of `simulate` */

void start_model(Model *m) {
    memset(m, 0, sizeof *m);
    memcpy(m->p, START, sizeof START);
    m->remote = true;
    m->duty = START_DUTY;
    m->flow = START_FLOW;
}

const char *parameter_problem(int parameter, double value) {
    return parameter == offsetof(Axial, motor.inductance) / sizeof(double) && !(value > 0.0) ? "the inductance is not positive" : NULL;
}

void observe_model(Model *m) { (void)m; }

const char *advance_model(Model *m, double length) {
    const Axial *robot = (const Axial *)m->p;
    AxialState *state = (AxialState *)m->state;
    const double duty = duty_of(m);
    if (OF_TORQUES->points > 0.0)
        advance_on_curve(robot, state, length, &duty, &m->flow, OF_TORQUES, 1);
    else
        advance_axial(robot, state, length, &duty, &m->flow, FINENESS, 1);
    m->time += length;
    const bool finite = isfinite(state->current) && isfinite(state->charge);
    return finite ? NULL : "the motor's current cannot be integrated with these numbers";
}

double output_of(const Model *m, int output) {
    const Axial *robot = (const Axial *)m->p;
    const AxialState *state = (const AxialState *)m->state;
    const Motor *motor = &robot->motor;
    const double i = state->current, torque = motor->torque_constant * i;
    const double voltage = motor->voltage - motor->internal_resistance * fabs(i);
    const double tail = robot->tail * torque + robot->tail_flow * m->flow;
    const double body = robot->body * torque + robot->body_flow * m->flow;
    switch (output) {
    case OUT_POSITION: return state->position;
    case OUT_TAIL_ANGLE: return state->tail_angle;
    case OUT_BODY_ANGLE: return state->body_angle;
    case OUT_CHARGE: return state->charge;
    case OUT_SPEED: return robot->speed * torque + robot->speed_flow * m->flow;
    case OUT_TAIL_RATE: return tail;
    case OUT_BODY_RATE: return body;
    case OUT_MOTOR_RATE: return tail - body;
    case OUT_CURRENT: return i;
    case OUT_TORQUE: return torque;
    case OUT_VOLTAGE: return voltage;
    default: return motor->polarity * duty_of(m) * voltage * i;
    }
}
