/* Where a robot touches the wall of its tube, the load that asperities carry there, and dry friction. */
#ifndef SPIRILLUM_CONTACTS_H
#define SPIRILLUM_CONTACTS_H

#include "cavitation.h"
#include "lanes.h"
#include "links.h"

/* A site on body or coupling: a ring about the motor axis that carries a ball */
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
    double xi;        /* of a wire: of the point */
} Nearest;

/* A contact with dry friction: mu_c N_c, N, and the sliding velocities along the tube and around it per rate, J_c. */
typedef struct {
    double load, rows[2][RATES];
} Contact;

enum { MOST_CONTACTS = 32 }; /* at once */

/* How far a site reaches from its ring's centre along a unit vector n = (y, z) across the tube: n_1 = n.e_1, and S. */
typedef struct {
    double n_1, size;
} Reach;

enum { NORMAL_ROUNDS = 12 };
static const double NORMAL_FOUND = 1e-8; /* rad: the next turn of the normal is the square of one as small */

/* First guess of the normal at a ring's centre (side, up): away from the tube's axis. */
static inline void first_normal(double side, double up, double radius, double *y, double *z) {
    const double size = sqrt(side * side + up * up), far = size > 1e-9 * radius ? 1.0 : 0.0;
    const double over = 1.0 / (far > 0.0 ? size : 1.0);
    *y = far * side * over;
    *z = far * up * over - (1.0 - far);
}

/* (e_y, e_z): the motor axis across the tube; `flat` is b^2 - rho^2. */
static inline Reach reach_at(double e_y, double e_z, double ring, double flat, double radius, double y, double z) {
    const double n_1 = y * e_y + z * e_z;
    const double square = larger(ring * ring + flat * n_1 * n_1, 1e-36 * radius * radius);
    return (Reach){n_1, copysign(sqrt(square), ring)};
}

/* Newton's step for the angle of n at which H is largest; 0 where it is none. */
static inline double turn_to_nearest(const Reach *reach, double e_y, double e_z, double side, double up, double flat,
                                     double y, double z) {
    const double turned = y * e_z - z * e_y, slope = flat * reach->n_1 * turned / reach->size;
    const double first = y * up - z * side + slope;
    const double second
        = -y * side - z * up + (flat * (turned * turned - reach->n_1 * reach->n_1) - slope * slope) / reach->size;
    return second < 0.0 ? clamped(-first / second, -0.5, 0.5) : 0.0;
}

/* Turn a unit vector by the arc tangent of a turn. */
static inline void turn_normal(double turn, double *y, double *z) {
    const double over = 1.0 / sqrt(1.0 + turn * turn), here = *y;
    *y = (here - turn * *z) * over;
    *z = (*z + turn * here) * over;
}

EXPORT double asperity_load(double gap, double height, double load);
EXPORT double asperity_energy(double gap, double height, double load);
Nearest site_nearest(const Site *site, const State *y, const double rotation[3][3], double radius);
bool tail_reaches(const Wire *wire, const State *y, const double rotation[3][3], double radius, double height);
Nearest wire_nearest(const Wire *wire, const Station *stations, const State *y, const double rotation[3][3],
                     double radius, const double bracket[3]);
/* A crest of the wire, found near the station `at` among those of its wire; the tube, and the liquid in it. */
typedef struct {
    const Wire *wire;
    const Station *at, *first, *last;
    const State *y;
    const double (*rotation)[3];
    double radius, viscosity, bound;
} Crest;

void sliding_rows(const Nearest *at, const double rotation[3][3], double rotor, double rows[2][RATES]);

typedef struct {
    double u, v, drag; /* sliding velocity, m/s, and dry friction over it, N s/m */
} Sliding;

enum { MOST_SLICES = 3 * LANES };

/* Slices of the lubrication film under the body's straight side: h0, m, its slope along the body; V and u per rate. */
typedef struct {
    double gap[LANES], slope[LANES], opening[RATES][LANES], entrainment[RATES][LANES];
} SliceLanes;

typedef struct {
    SliceLanes lanes[MOST_SLICES / LANES];
    double length[MOST_SLICES]; /* along the body, m */
    double share[MOST_SLICES];  /* of their pressure that the ends of the film leave */
    FilmScale scale[MOST_SLICES];
    double edges[MOST_SLICES][2]; /* of their cavities where they were last looked for, over s; NaN: nowhere */
    Lift lift[MOST_SLICES];       /* at the rates that were last tried */
} Slices;

enum { BODY_FILM, CREST_FILMS, FILMS };

static const double CREST_REACH = 0.75; /* of the wire's radius: thinnest film that a table's resistance has under it */

/* Forces that balance: A q + sum of dry friction - lift of cavitation = f; see dry_friction.c. */
typedef struct {
    double a[RATES][RATES], force[RATES];
    Contact contacts[MOST_CONTACTS];
    int64_t count;
    Slices *slices[FILMS]; /* of films that may cavitate, or NULL */
    double bound;          /* their pressure is not below -p_c, Pa */
    double slow;           /* v_r, below which dry friction is smooth, m/s */
    int along;             /* the rate along which a torque keeps a prescribed spin */
    bool prescribed;       /* whether the spin q_3 + q_6 is */
    bool once;             /* whether one step of Newton's method is enough: the first guess is close */
} Balance;

/* a and b of the slices' pressure in lanes from `first`; see cavitation.c. */
void set_pressures(const Slices *slices, int first, const double q[RATES], double a[LANES], double b[LANES]);

/* Force of a slice's lift on a rate, N or N m. */
static inline double slice_force(const Slices *slices, int n, int i) {
    const SliceLanes *lanes = slices->lanes + n / LANES;
    const Lift *lift = slices->lift + n;
    const int l = n % LANES;
    return slices->length[n] * (lift->normal * lanes->opening[i][l] + lift->along * lanes->entrainment[i][l]);
}

void forget_cavities(Slices *slices);
/* Set the lifts of slices at rates. */
void set_lifts(Slices *slices, double bound, const double q[RATES]);
/* Take all slices away, but for the edges of cavities, which are guesses. */
void clear_slices(Slices *slices);
/* Whether the film of a crest is thin; then it is added: its slices, in lanes from `first`, and its linear resistance. */
bool add_crest_film(const Crest *crest, const Nearest *nearest, Slices *slices, int first, double matrix[RATES][RATES]);
Sliding sliding_at(const Contact *contact, const double q[RATES], double slow);
double balance_rates(Balance *balance, double q[RATES], double left[RATES]);

#endif
