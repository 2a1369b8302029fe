/* Lubrication films whose pressure is bounded below: the oil cavitates.
 *
 * Across a line contact with the gap h = h0 + x^2/(2 R') Reynolds' equation, both signs of the pressure allowed, is
 *
 *     (h^3 p'/(12 eta))' = u h' + V,      solved by p(x) = -(4 eta u x + 6 eta R' V)/h^2.
 *
 * The oil bears no pressure below -p_c (above the ambient one). The film then ruptures where p = -p_c and p' = 0, and
 * forms again likewise (Swift 1932, Stieber 1933): the pressure is the least one that is not below -p_c and takes up no
 * less than what the gap opens. With x = s xi, s = sqrt(2 R' h0), p = p_c pi(xi), the film before the cavity obeys
 *
 *     pi' = [a (xi^2 - xi_1^2) + b (xi - xi_1)]/(1 + xi^2)^3,    a = 12 eta u s/(p_c h0^2),   b = 24 eta R' V/(p_c h0^2),
 *
 * where xi_1, the edge of the cavity, follows from pi(xi_1) = -1; the film behind it is its mirror image with -a. With
 * K_n the integrals of xi^n/(1 + xi^2)^3 up to the edge, pressure and forces are closed. The force on V is the integral
 * of the pressure, that on u the integral of p h', since the power of pressure and Poiseuille flow is that of
 * p (u h' + V): forces are the gradient of a convex function of V and u, and the film gives no energy.
 */
#include "cavitation.h"

enum { MOMENTS = 5, ROUNDS = 100, GUESSED = 8 };
static const double FAR = 1e8; /* in s: no cavity is as wide */

/* Of xi^(n - 5 - 2 m) in K_n far out: binomial coefficients of (1 + xi^-2)^-3, integrated. */
#define TERM(n, m) ((m % 2 ? -0.5 : 0.5) * (m + 1) * (m + 2) / (n - 5 - 2 * m))
#define ROW(m) {TERM(0, m), TERM(1, m), TERM(2, m), TERM(3, m), TERM(4, m)}
enum { TERMS = 14 };
static const double SERIES[TERMS][MOMENTS] = {ROW(0), ROW(1), ROW(2), ROW(3),  ROW(4),  ROW(5),  ROW(6),
                                              ROW(7), ROW(8), ROW(9), ROW(10), ROW(11), ROW(12), ROW(13)};

/* Integrals K_n of xi^n/(1 + xi^2)^3 from -infinity up to a place, n = 0 to 4. */
static void set_moments(double xi, double k[MOMENTS]) {
    if (xi < -6.0) { /* a series in 1/xi^2, where the closed forms cancel */
        const double inverse = 1.0 / (xi * xi);
        double power = inverse * inverse * inverse * xi;
        for (int n = 0; n < MOMENTS; n++) k[n] = 0.0;
        for (int m = TERMS - 1; m >= 0; m--)
            for (int n = 0; n < MOMENTS; n++) k[n] = k[n] * inverse + SERIES[m][n];
        for (int n = 0; n < MOMENTS; n++, power *= xi) k[n] *= power;
        return;
    }
    const double once = 1.0 / (1.0 + xi * xi), twice = once * once, angle = atan(xi) + 0.5 * PI;
    k[0] = 0.25 * xi * twice + 0.375 * (xi * once + angle);
    k[1] = -0.25 * twice;
    k[2] = -0.25 * xi * twice + 0.125 * (xi * once + angle);
    k[3] = -0.5 * once + 0.25 * twice;
    k[4] = k[0] - xi * once;
}

/* What the pressure at an edge exceeds the bound by: it falls as the edge moves on, while 2 a xi + b > 0. */
static double excess(double a, double b, double xi, double k[MOMENTS]) {
    set_moments(xi, k);
    return a * (k[2] - xi * xi * k[0]) + b * (k[1] - xi * k[0]) + 1.0;
}

/* Newton's step for an edge, with the moments up to the place after it where it is small: the next one is its square. */
static bool step_edge(double a, double b, double *xi, double k[MOMENTS], double *over) {
    *over = excess(a, b, *xi, k);
    const double moved = *over / ((2.0 * a * *xi + b) * k[0]);
    const bool found = fabs(moved) <= 1e-8 * (1.0 + fabs(*xi));
    if (found) {
        const double wide = 1.0 + *xi * *xi;
        double density = moved / (wide * wide * wide);
        for (int n = 0; n < MOMENTS; n++, density *= *xi) k[n] += density;
    }
    *xi += moved;
    return found;
}

/* The edge of the cavity behind a film that comes from -infinity, and the moments up to it: by Newton's method from a
 * guess (NaN: none), else between bounds that are found first. */
static double edge_of(double a, double b, double guess, double k[MOMENTS]) {
    double over;
    for (int round = 0; round < GUESSED && 2.0 * a * guess + b > 0.0; round++)
        if (step_edge(a, b, &guess, k, &over)) return guess;
    const double turn = clamped(-0.5 * b / a, -FAR, FAR); /* where 2 a xi + b is zero; none without a */
    double low = a > 0.0 ? turn : -1.0, high = a < 0.0 ? turn : 1.0;
    for (double far = 1.0; !(a > 0.0) && excess(a, b, low, k) < 0.0; far *= 2.0) low = high - 2.0 * far - 1.0;
    for (double far = 1.0; !(a < 0.0) && (high <= low || excess(a, b, high, k) > 0.0); far *= 2.0) high = low + far;
    double xi = 0.5 * (low + high);
    for (int round = 0; round < ROUNDS; round++) {
        double next = xi;
        if (step_edge(a, b, &next, k, &over)) return next;
        *(over > 0.0 ? &low : &high) = xi;
        xi = low < next && next < high ? next : 0.5 * (low + high);
    }
    set_moments(xi, k);
    return xi;
}

/* Integrals of pi and of xi pi over one side, without what both sides cancel, and their derivatives in a and b. */
typedef struct {
    double normal, along;
    double normal_a, normal_b, along_a, along_b; /* normal_a is twice along_b */
} Side;

static Side side_of(double a, double b, double *guess) {
    double k[MOMENTS];
    const double edge = *guess = edge_of(a, b, *guess, k);
    return (Side){
        .normal = -(a * (k[3] - edge * edge * k[1]) + b * (k[2] - edge * k[1])),
        .along = -0.5 * (a * (k[4] - edge * edge * k[2]) + b * (k[3] - edge * k[2])),
        .normal_a = -(k[3] - k[1] * k[2] / k[0]),
        .normal_b = -(k[2] - k[1] * k[1] / k[0]),
        .along_a = -0.5 * (k[4] - k[2] * k[2] / k[0]),
        .along_b = -0.5 * (k[3] - k[1] * k[2] / k[0]),
    };
}

/* 3 (1 + xi^2)^2 < a xi + 3 b/4 somewhere. */
bool cavitates(double a, double b) {
    if (!is_near_cavitation(a, b)) return false;
    if (b > 4.0 || fabs(a) + 1.5 * b > 9.375 || fabs(a) + 0.75 * b > 12.0) return true; /* at |xi| = 0, 1/2 and 1 */
    const double root3 = sqrt(3.0);
    const double xi
        = 2.0 / root3 * sinh(asinh(0.125 * root3 * a) / 3.0); /* of the least difference: xi^3 + xi = a/12 */
    const double wide = 1.0 + xi * xi;
    return wide * wide < a * xi / 3.0 + 0.25 * b;
}

Lift cavitation_lift(const FilmScale *film, double gap, double bound, double a, double b, double edges[2]) {
    if (!cavitates(a, b)) return (Lift){0};
    const double s = film->s, per_u = film->per_u, per_v = film->per_v;
    /* less the linear film, whose integrals are -pi b/8 and -pi a/6 */
    const Side before = side_of(a, b, edges), behind = side_of(-a, b, edges + 1);
    const double normal = bound * s, along = 2.0 * bound * gap; /* s^2/R' = 2 h0 */
    return (Lift){
        .normal = normal * (before.normal + behind.normal + 0.125 * PI * b),
        .along = along * (before.along - behind.along + PI * a / 6.0),
        .of_opening = {normal * per_v * (before.normal_b + behind.normal_b + 0.125 * PI),
                       along * per_v * (before.along_b - behind.along_b)},
        .of_entrainment = {normal * per_u * (before.normal_a - behind.normal_a),
                           along * per_u * (before.along_a + behind.along_a + PI / 6.0)},
    };
}

/* Fill what the bound of the pressure adds to the forces of line contacts, per length, N/m.
 *
 * gap: smallest gaps h0, m; bend: R' of the gaps h0 + x^2/(2 R'), m; opening: V = dh0/dt, m/s; entrainment: u, mean
 * velocity of both surfaces as seen from the contact line, m/s; viscosity: Pa s; bound: p_c, the pressure is not below
 * -p_c, Pa; out: force that opens the gap, force that works on u, their derivatives in V, and in u. */
EXPORT void lift_of_cavitation(const double *gap /* (count) */, const double *bend /* (count) */,
                               const double *opening /* (count) */, const double *entrainment /* (count) */,
                               double viscosity, double bound, double *out /* (count, 6) */, int64_t count) {
    for (int64_t n = 0; n < count; n++) {
        const FilmScale film = film_scale(gap[n], bend[n], viscosity, bound);
        const double a = film.per_u * entrainment[n], b = film.per_v * opening[n];
        double edges[2] = {NAN, NAN};
        const Lift lift = cavitation_lift(&film, gap[n], bound, a, b, edges);
        const double row[6]
            = {lift.normal,           lift.along, lift.of_opening[0], lift.of_opening[1], lift.of_entrainment[0],
               lift.of_entrainment[1]};
        for (int k = 0; k < 6; k++) out[6 * n + k] = row[k];
    }
}
