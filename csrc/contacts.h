/* Where a robot touches the wall of its tube, the load that asperities carry there, and dry friction. */
#ifndef SPIRILLUM_CONTACTS_H
#define SPIRILLUM_CONTACTS_H

#include "cavitation.h"
#include "links.h"

/* A site on body or coupling: a ring about the motor axis that carries a ball; the columns of kernels/contacts.py. */
typedef struct {
    double x, ring, half, ball; /* place; rho, with the semi-axis b along the motor axis; radius beta; m */
    double rotor;               /* 1 where it turns with the rotor */
} Site;

typedef struct {
    double radius, amplitude, taper; /* m; m; taper over length, 1/m (0: none) */
    double hand_k, root, length;     /* h k, rad/m (0: no helix of one size); x of the root and axial length, m */
} Wire;

/* A station along a wire: its distance from the root, m, or any coordinate that increases; place at phase 0, m, and
 * its derivative by that; angle of its wire against the first. */
typedef struct {
    double xi, point[3], slope[3], turn;
} Station;

/* A place of the robot near the wall. */
typedef struct {
    double gap;       /* m */
    double normal[3]; /* n in body axes, towards the wall */
    double point[3];  /* the touching point from the origin in body axes, m */
    double j[RATES];  /* the gap closes at j.q at the rates q */
} Nearest;

/* A contact with dry friction: mu_c N_c, N, and the sliding velocities along the tube and around it per rate, J_c. */
typedef struct {
    double load, rows[2][RATES];
} Contact;

enum { MOST_CONTACTS = 32 }; /* at once */

double asperity_load(double gap, double height, double load);
double asperity_energy(double gap, double height, double load);
Nearest site_nearest(const Site *site, const State *y, const double rotation[3][3], double radius);
bool tail_reaches(const Wire *wire, const State *y, const double rotation[3][3], double radius, double height);
Nearest wire_nearest(const Wire *wire, const Station *stations, const State *y, const double rotation[3][3],
                     double radius, const double bracket[3]);
void sliding_rows(const Nearest *at, const double rotation[3][3], double rotor, double rows[2][RATES]);

typedef struct {
    double u, v, drag; /* sliding velocity, m/s, and dry friction over it, N s/m */
} Sliding;

/* A slice of the lubrication film under the body's straight side: its velocities per rate. */
typedef struct {
    double gap, bend;                          /* h0, R', m */
    double length;                             /* along the body, m */
    double share;                              /* of its pressure that the ends of the film leave */
    double opening[RATES], entrainment[RATES]; /* V and u per rate */
    double edges[2];                           /* of its cavity where it was last looked for, over s; NaN: nowhere */
    Lift lift;                                 /* at the rates that were last tried */
} Slice;

enum { MOST_SLICES = 24 };

/* Forces that balance: A q + sum of dry friction - lift of cavitation = f; see dry_friction.c. */
typedef struct {
    double a[RATES][RATES], force[RATES];
    Contact contacts[MOST_CONTACTS];
    int64_t count;
    Slice slices[MOST_SLICES]; /* of a film that may cavitate */
    int64_t slice_count;
    double viscosity, bound; /* of the slices, Pa s; their pressure is not below -p_c, Pa */
    double slow;             /* v_r, below which dry friction is smooth, m/s */
    int along;               /* the rate along which a torque keeps a prescribed spin */
    bool prescribed;         /* whether the spin q_3 + q_6 is */
} Balance;

void set_lift(const Balance *balance, Slice *slice, const double q[RATES]);
Sliding sliding_at(const Contact *contact, const double q[RATES], double slow);
double balance_rates(Balance *balance, double q[RATES], double left[RATES]);

#endif
