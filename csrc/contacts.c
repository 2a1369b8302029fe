/* Where a robot touches the wall of its tube, and the load that asperities carry there.
 *
 * Smooth surfaces in a viscous fluid never touch in finite time; asperities of height s do, and carry the load from then
 * on (J. R. Smart, D. T. Leighton, Phys. Fluids A 1:52, 1989; C. J. Cawthorn, N. J. Balmforth, J. Fluid Mech. 646:327,
 * 2010). With h the gap of the mean surfaces and W a load of the order of the robot's weight,
 *
 *     N(h) = W (s/h - 1)^2,   E(h) = W (s^2/h - h - 2 s log(s/h))   for h < s, zero beyond
 *
 * which is W at h = s/2 and grows without bound as h -> 0, so that no finite load brings the mean surfaces together.
 * Just below s it grows as (s - h)^2, between a single elastic asperity (power 3/2) and many of evenly spread heights
 * (5/2; J. A. Greenwood, J. B. P. Williamson, Proc. R. Soc. A 295:300, 1966). The form is assumed; what follows from it
 * depends on s above all.
 *
 * Sites on the solids are rings about the motor axis that carry a ball: hemisphere, edge, fillet and spheroid. The wire
 * touches where its distance from the tube's axis is a local maximum along it, ends included.
 */
#include "contacts.h"

static const double THINNEST = 1e-3; /* smallest gap over s at which the load is evaluated */

/* N(h), N. */
EXPORT double asperity_load(double gap, double height, double load) {
    if (gap >= height) return 0.0;
    const double over = height / larger(gap, THINNEST * height) - 1.0;
    return load * over * over;
}

/* E(h), J. */
EXPORT double asperity_energy(double gap, double height, double load) {
    if (gap >= height) return 0.0;
    const double h = larger(gap, THINNEST * height);
    return load * (height * height / h - h - 2.0 * height * log(height / h));
}

/* Direction (y, z) across the tube in body axes. */
static void set_normal(Nearest *at, const double rotation[3][3], double y, double z) {
    for (int i = 0; i < 3; i++) at->j[i] = at->normal[i] = rotation[1][i] * y + rotation[2][i] * z;
}

/* Across the tube a site reaches H(n) = c.n + S(n_1) + beta from the tube's axis along a unit vector n, with the ring's
 * centre c, n_1 = n.e_1 and S^2 = rho^2 (1 - n_1^2) + b^2 n_1^2. The gap is R less the largest H, which Newton's method
 * finds from n = c/|c|; its gradient is that at constant n. */
Nearest site_nearest(const Site *site, const State *y, const double rotation[3][3], double radius) {
    const double x = site->x, ring = site->ring, flat = squared(site->half) - squared(ring);
    const double side = y->position[1] + rotation[1][0] * x, up = y->position[2] + rotation[2][0] * x;
    const double e_y = rotation[1][0], e_z = rotation[2][0];
    double n_y, n_z, turn = INFINITY;
    first_normal(side, up, radius, &n_y, &n_z);
    Reach reach = reach_at(e_y, e_z, ring, flat, radius, n_y, n_z);
    for (int round = 0; round < NORMAL_ROUNDS && fabs(turn) > NORMAL_FOUND; round++) {
        turn = turn_to_nearest(&reach, e_y, e_z, side, up, flat, n_y, n_z);
        turn_normal(turn, &n_y, &n_z);
        reach = reach_at(e_y, e_z, ring, flat, radius, n_y, n_z);
    }
    const double arm = x + flat * reach.n_1 / reach.size, ball = ring * ring / reach.size + site->ball;
    Nearest at = {.gap = radius - n_y * side - n_z * up - reach.size - site->ball};
    set_normal(&at, rotation, n_y, n_z);
    for (int i = 0; i < 3; i++) at.point[i] = ball * at.normal[i];
    at.point[0] += arm;
    at.j[4] = -arm * at.normal[2];
    at.j[5] = arm * at.normal[1];
    return at;
}

/* Whether the cylinder in which the tail turns comes within a height of the wall. */
bool tail_reaches(const Wire *wire, const State *y, const double rotation[3][3], double radius, double height) {
    double farthest = 0.0;
    for (int end = 0; end < 2; end++) {
        const double x = wire->root - end * wire->length;
        const double side = y->position[1] + rotation[1][0] * x, up = y->position[2] + rotation[2][0] * x;
        farthest = larger(farthest, hypot(side, up));
    }
    return radius - farthest - wire->amplitude - wire->radius < height;
}

/* Point, tangent and its change by the distance from the root on a helix of one size, in body axes. */
static void helix_at(const Wire *wire, double phase, double xi, double at[3][3]) {
    const double shrink = wire->taper > 0 ? exp(-wire->taper * xi) : 0.0;
    const double r = wire->amplitude * (1.0 - shrink), r_1 = wire->amplitude * wire->taper * shrink;
    const double r_2 = -wire->taper * r_1, x = wire->root - xi, k = wire->hand_k;
    const double angle = k * x + phase, c = cos(angle), s = sin(angle);
    const double found[3][3]
        = {{x, r * c, r * s},
           {-1.0, r_1 * c + k * r * s, r_1 * s - k * r * c},
           {0.0, (r_2 - k * k * r) * c + 2.0 * k * r_1 * s, (r_2 - k * k * r) * s - 2.0 * k * r_1 * c}};
    for (int n = 0; n < 3; n++)
        for (int i = 0; i < 3; i++) at[n][i] = found[n][i];
}

/* The same on any other wire: a cubic between the stations about xi, with their points and tangents. */
static void line_at(const Station *s, double phase, double xi, double at[3][3]) {
    const double h = s[1].xi - s[0].xi, t = (xi - s[0].xi) / h, c = cos(phase), sine = sin(phase);
    const double weights[3][4] = {
        {1.0 - t * t * (3.0 - 2.0 * t), t * (1.0 - t) * (1.0 - t) * h, t * t * (3.0 - 2.0 * t), t * t * (t - 1.0) * h},
        {6.0 * t * (t - 1.0) / h, (1.0 - t) * (1.0 - 3.0 * t), 6.0 * t * (1.0 - t) / h, t * (3.0 * t - 2.0)},
        {(12.0 * t - 6.0) / (h * h), (6.0 * t - 4.0) / h, (6.0 - 12.0 * t) / (h * h), (6.0 * t - 2.0) / h}};
    for (int n = 0; n < 3; n++) {
        const double *w = weights[n];
        double p[3];
        for (int i = 0; i < 3; i++)
            p[i] = w[0] * s[0].point[i] + w[1] * s[0].slope[i] + w[2] * s[1].point[i] + w[3] * s[1].slope[i];
        at[n][0] = p[0];
        at[n][1] = c * p[1] - sine * p[2];
        at[n][2] = sine * p[1] + c * p[2];
    }
}

/* A point of the centreline: in body axes, across the tube, d^2, and d(d^2/2)/dxi once and twice. */
typedef struct {
    double point[3], side, up, square, first, second;
} WirePoint;

static WirePoint wire_point(const Wire *wire, const Station *stations, const State *state, const double rotation[3][3],
                            double xi) {
    double at[3][3], across[2];
    if (wire->hand_k != 0.0)
        helix_at(wire, state->phase + stations->turn, xi, at);
    else
        line_at(stations + (xi > stations[1].xi), state->phase, xi, at);
    WirePoint found = {.point = {at[0][0], at[0][1], at[0][2]}};
    for (int n = 0; n < 2; n++) {
        const double *row = rotation[n + 1];
        double d[3];
        for (int k = 0; k < 3; k++)
            d[k] = (k == 0 ? state->position[n + 1] : 0.0) + row[0] * at[k][0] + row[1] * at[k][1] + row[2] * at[k][2];
        across[n] = d[0];
        found.square += d[0] * d[0];
        found.first += d[0] * d[1];
        found.second += d[1] * d[1] + d[0] * d[2];
    }
    found.side = across[0];
    found.up = across[1];
    return found;
}

/* Where the wire is farthest from the tube's axis; bracket: where to look, from, first guess, to, from the root; stations:
 * those of the bracket. */
Nearest wire_nearest(const Wire *wire, const Station *stations, const State *y, const double rotation[3][3],
                     double radius, const double bracket[3]) {
    double low = bracket[0], xi = bracket[1], high = bracket[2];
    WirePoint p = wire_point(wire, stations, y, rotation, xi);
    for (int round = 0; round < 50; round++) {
        *(p.first > 0 ? &low : &high) = xi;
        if ((xi == bracket[0] && p.first <= 0) || (xi == bracket[2] && p.first >= 0)) break; /* an end of the wire */
        double next = p.second < 0 ? xi - p.first / p.second : low;
        if (!(low < next && next < high)) next = 0.5 * (low + high);
        const double moved = fabs(next - xi);
        xi = next;
        p = wire_point(wire, stations, y, rotation, xi);
        if (moved < 1e-13 * wire->length) break;
    }
    const double distance = larger(sqrt(p.square), 1e-9 * radius);
    Nearest at = {.gap = radius - distance - wire->radius};
    set_normal(&at, rotation, p.side / distance, p.up / distance);
    const double *n = at.normal, *point = p.point;
    at.j[3] = at.j[6] = point[1] * n[2] - point[2] * n[1];
    at.j[4] = point[2] * n[0] - point[0] * n[2];
    at.j[5] = point[0] * n[1] - point[1] * n[0];
    for (int i = 0; i < 3; i++) at.point[i] = point[i] + wire->radius * n[i];
    return at;
}

/* Sliding velocities at a contact as rows against the seven rates: along the tube, and around it. */
void sliding_rows(const Nearest *at, const double rotation[3][3], double rotor, double rows[2][RATES]) {
    const double *x = rotation[0], *n = at->normal, *point = at->point;
    const double around[3] = {x[1] * n[2] - x[2] * n[1], x[2] * n[0] - x[0] * n[2], x[0] * n[1] - x[1] * n[0]};
    for (int row = 0; row < 2; row++) {
        const double *d = row == 0 ? x : around;
        double *out = rows[row];
        for (int i = 0; i < 3; i++) out[i] = d[i];
        out[3] = point[1] * d[2] - point[2] * d[1];
        out[4] = point[2] * d[0] - point[0] * d[2];
        out[5] = point[0] * d[1] - point[1] * d[0];
        out[6] = rotor * out[3];
    }
}

/* Write what is nearest; its gap. */
static double told(Nearest at, double *normal, double *point, double *j) {
    for (int i = 0; i < 3; i++) {
        normal[i] = at.normal[i];
        point[i] = at.point[i];
    }
    for (int i = 0; i < RATES; i++) j[i] = at.j[i];
    return at.gap;
}

EXPORT double ring_gap(const double *y, const double *rotation, double radius, const double *site, double *normal,
                       double *point, double *j) {
    const double (*axes)[3] = (const double (*)[3])rotation;
    return told(site_nearest((const Site *)site, (const State *)y, axes, radius), normal, point, j);
}

EXPORT double crest(const double *y, const double *rotation, double radius, const double *wire, const double *stations,
                    const double *bracket, double *normal, double *point, double *j, int64_t count) {
    (void)count;
    const double (*axes)[3] = (const double (*)[3])rotation;
    const Station *about = (const Station *)stations;
    return told(wire_nearest((const Wire *)wire, about, (const State *)y, axes, radius, bracket), normal, point, j);
}
