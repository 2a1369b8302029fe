/* What Python, and the FMU of a robot in axial motion, call of axial.c; see there. */
#ifndef SPIRILLUM_AXIAL_H
#define SPIRILLUM_AXIAL_H

#include "core.h"

EXPORT void advance_axial(const double *parameters, double *states, double dt, const double *duty, const double *flow,
                          double fineness, int64_t count);
EXPORT void advance_on_curve(const double *parameters, double *states, double dt, const double *duty,
                             const double *flow, const double *curve, int64_t count);

#endif
