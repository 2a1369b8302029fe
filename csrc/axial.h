/* What Python, and the FMU of a robot in axial motion, call of axial.c; see there. */
#ifndef SPIRILLUM_AXIAL_H
#define SPIRILLUM_AXIAL_H

#include "drive.h"

/* One robot, SI; torques and rates at the joint. */
typedef struct {
    Motor motor;
    double speed, body, tail;                /* U, Omega, omega per joint torque */
    double speed_flow, body_flow, tail_flow; /* U, Omega, omega per imposed mean flow */
} Axial;

typedef struct {
    double current, position, tail_angle, body_angle, charge;
    double squared_current, heat; /* integrals of I^2, A^2 s, and of R I^2, J */
} AxialState;

EXPORT void advance_axial(const Axial *robots, AxialState *states, double dt, const double *duty, const double *flow,
                          double fineness, int64_t count);
EXPORT void advance_on_curve(const Axial *robots, AxialState *states, double dt, const double *duty, const double *flow,
                             const Curve *curve, int64_t count);

#endif
