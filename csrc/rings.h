/* Fourier modes of the Stokeslet around rings about one axis; see rings.c. */
#ifndef SPIRILLUM_RINGS_H
#define SPIRILLUM_RINGS_H

#include "core.h"
#include "lanes.h"

/* Pairs of a target ring and a source ring, m. */
typedef struct {
    double dx[LANES];    /* x of the target less x of the source */
    double delta[LANES]; /* rho - rho_s, stated since it is known better than the difference where rings are close */
    double rho[LANES];   /* radius of the target */
    double rho_s[LANES]; /* radius of the source */
    double e2;           /* square of the blob radius; rings that coincide need one */
} RingPairs;

/* Fill A_n and B_n for n < count, count at least 2. Radii of rings that have shrunk to the axis are raised above 0. */
void open_rings(RingPairs *pairs, int64_t count, double (*a)[LANES], double (*b)[LANES]);

/* Integral of v cos(m phi)/r^3 with v = 1 - cos(phi). */
void fill_ring_b_v(const RingPairs *pairs, int64_t m, double (*a)[LANES], double (*b)[LANES], double b_v[LANES]);

/* 3x3 block of mode m, by rows, from a force density on the source to velocities at the target; m + 2 integrals are
 * needed. */
void fill_ring_mode(const RingPairs *pairs, int64_t m, double (*a)[LANES], double (*b)[LANES], double k[9][LANES]);

#endif
