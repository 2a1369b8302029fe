/* Lubrication films whose pressure is bounded below: the oil cavitates. */
#ifndef SPIRILLUM_CAVITATION_H
#define SPIRILLUM_CAVITATION_H

#include "core.h"

/* A film across a line contact: gap h0 + x^2/(2 R') at x across the body's axis. */
typedef struct {
    double gap, bend;   /* h0, R', m */
    double opening;     /* V = dh0/dt, m/s */
    double entrainment; /* u, mean velocity of both surfaces along x, as seen from the contact line, m/s */
} LineContact;

/* What the bound of the pressure adds per length, and its derivatives. */
typedef struct {
    double normal;            /* force that opens the gap, N/m */
    double along;             /* force that works on u, N/m */
    double of_opening[2];     /* derivatives of both in V */
    double of_entrainment[2]; /* derivatives of both in u */
} Lift;

bool is_near_cavitation(const LineContact *contact, double viscosity, double bound);
/* `edges` of the cavity, over s, are guesses (NaN: none), and become those that were found. */
Lift cavitation_lift(const LineContact *contact, double viscosity, double bound, double edges[2]);

#endif
