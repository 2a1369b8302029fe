/* What Python, and the FMU of a free robot, call of stiff_steps.c; see there. */
#ifndef SPIRILLUM_STIFF_STEPS_H
#define SPIRILLUM_STIFF_STEPS_H

#include "motion.h"

enum { STAGES = 8 };
enum { ACTING = 8 }; /* components of the state on which the rates depend */

EXPORT void rates(double *dy, double time, const double *y, double *data, const double *table, int64_t size,
                  int64_t table_size);
EXPORT double watched(const double *y, double outside, double *data, const double *table, const Limits *limits,
                      double rough, double *gaps, int64_t size, int64_t table_size, int64_t count);
EXPORT void interpolate(double share, const double *y, const double *end, const double *increments, double *out);
EXPORT int64_t advance(double stop, bool clip, int64_t steps, double tolerance, Memory *memory, double *y,
                       double *before, double *increments, double *jacobian, double *gaps, const double *samples,
                       double *states, const double *sizes, const Limits *limits, double rough, double *data,
                       const double *table, int64_t count, int64_t sample_count, int64_t size, int64_t table_size);

#endif
