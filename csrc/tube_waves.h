/* Stokes flow in a circular tube as waves; see tube_waves.c. */
#ifndef SPIRILLUM_TUBE_WAVES_H
#define SPIRILLUM_TUBE_WAVES_H

#include "core.h"
#include "lanes.h"

/* The flows of one order p at the wall: inverse of their velocities (3 x 3), I_{p+1}/I_p, and exp(-k R) I_0. */
typedef struct {
    double inverse[9], ratio, scaled;
} WallFlows;

/* r[n] = I_{n+1}(z)/I_n(z) for n < count, and exp(-z) I_0(z). */
void fill_bessel_ratios(const double z[LANES], int64_t count, double (*r)[LANES], double scaled[LANES]);

/* Velocities (X, rho, v), rows, of three flows, columns, of order p >= 0 at k rho = z, in units of I_p(z).
 * The columns are scaled by `wall` = k R; r are ratios of Bessel functions at z. */
void fill_flows(int64_t p, const double z[LANES], double wall, double (*r)[LANES], double v[9][LANES]);

/* Of the orders below `orders` at k R = wall. */
void fill_wall_flows(double wall, int64_t orders, WallFlows *flows);

/* See tube_waves.c. */
EXPORT void wall_layers(double z, double first, double *layers, int64_t orders);

#endif
