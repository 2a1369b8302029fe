/* Lubrication films whose pressure is bounded below: the oil cavitates. */
#ifndef SPIRILLUM_CAVITATION_H
#define SPIRILLUM_CAVITATION_H

#include "core.h"

/* A film across a line contact, gap h0 + x^2/(2 R') at x across the body's axis, in units of its bound p_c; see
 * cavitation.c. Velocities are V = dh0/dt and u, the mean of both surfaces along x, as seen from the contact line. */
typedef struct {
    double s;            /* sqrt(2 R' h0), m */
    double per_u, per_v; /* a per u and b per V, s/m */
} FilmScale;

/* What the bound of the pressure adds per length, and its derivatives. */
typedef struct {
    double normal;            /* force that opens the gap, N/m */
    double along;             /* force that works on u, N/m */
    double of_opening[2];     /* derivatives of both in V */
    double of_entrainment[2]; /* derivatives of both in u */
} Lift;

static inline FilmScale film_scale(double gap, double bend, double viscosity, double bound) {
    const double s = sqrt(2.0 * bend * gap), unit = 12.0 * viscosity / (bound * gap * gap);
    return (FilmScale){s, s * unit, 2.0 * bend * unit};
}

/* Whether a film may cavitate, which most do not nearly: xi/(1 + xi^2)^2 is at most 3 sqrt(3)/16. One with smaller a, b
 * then does not, if this one does not. */
static inline bool is_near_cavitation(double a, double b) { return !(fabs(a) < 9.2 - 2.3 * larger(b, 0.0)); }

/* Whether the pressure of the linear film falls below the bound. */
bool cavitates(double a, double b);
/* `edges` of the cavity, over s, are guesses (NaN: none), and become those that were found. */
Lift cavitation_lift(const FilmScale *film, double gap, double bound, double a, double b, double edges[2]);

#endif
