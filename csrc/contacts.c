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

/* N(h), N, of asperities of a height, m, with a load at half of it, N. */
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

static const double LEAST_FILM = 1e-5; /* of the wire's radius: where a trial is inside the wall */

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

/* A point of the centreline and its derivative in body axes; across the tube, d^2, and d(d^2/2)/dxi once and twice. */
typedef struct {
    double point[3], tangent[3], side, up, square, first, second;
} WirePoint;

static WirePoint wire_point(const Wire *wire, const Station *stations, const State *state, const double rotation[3][3],
                            double xi) {
    double at[3][3], across[2];
    if (wire->hand_k != 0.0)
        helix_at(wire, state->phase + stations->turn, xi, at);
    else
        line_at(stations + (xi > stations[1].xi), state->phase, xi, at);
    WirePoint found = {.point = {at[0][0], at[0][1], at[0][2]}, .tangent = {at[1][0], at[1][1], at[1][2]}};
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
    at.xi = xi;
    return at;
}

/* Velocity of a point along a direction as a row against the seven rates. */
static void set_row(const double point[3], const double d[3], double rotor, double out[RATES]) {
    for (int i = 0; i < 3; i++) out[i] = d[i];
    out[3] = point[1] * d[2] - point[2] * d[1];
    out[4] = point[2] * d[0] - point[0] * d[2];
    out[5] = point[0] * d[1] - point[1] * d[0];
    out[6] = rotor * out[3];
}

/* Sliding velocities at a contact as rows against the seven rates: along the tube, and around it. */
void sliding_rows(const Nearest *at, const double rotation[3][3], double rotor, double rows[2][RATES]) {
    const double *x = rotation[0], *n = at->normal, *point = at->point;
    const double around[3] = {x[1] * n[2] - x[2] * n[1], x[2] * n[0] - x[0] * n[2], x[0] * n[1] - x[1] * n[0]};
    set_row(point, x, rotor, rows[0]);
    set_row(point, around, rotor, rows[1]);
}

void forget_cavities(Slices *slices) {
    for (int n = 0; n < MOST_SLICES; n++) slices->edges[n][0] = slices->edges[n][1] = NAN;
}

void clear_slices(Slices *s) {
    for (int n = 0; n < MOST_SLICES / LANES; n++) s->lanes[n] = (SliceLanes){.gap = {0.0}};
    for (int n = 0; n < MOST_SLICES; n++) {
        s->length[n] = 0.0;
        s->scale[n] = (FilmScale){0};
    }
}

/* Add c r r' to a matrix. */
static void add_dyad(double c, const double r[RATES], double matrix[RATES][RATES]) {
    for (int i = 0; i < RATES; i++)
        for (int j = 0; j < RATES; j++) matrix[i][j] += c * r[i] * r[j];
}

/* A point of the wire at xi. */
static WirePoint crest_point(const Crest *c, double xi) {
    const Station *at = c->at < c->last ? c->at : c->last - 1;
    while (at > c->first && at->xi > xi) at--;
    while (at + 1 < c->last && at[1].xi < xi) at++;
    return wire_point(c->wire, at, c->y, c->rotation, xi);
}

/* A slice across the wire at xi, in a lane; its film spans `length`, m, along the wire.
 *
 * V is that of the gap, less the slope along the wire times the mean of both surfaces' velocities along it; u is that
 * across the wire, as seen from the contact line, which the wire's axis takes along. */
static void add_slice_of_wire(const Crest *c, double xi, double span, double reach, Slices *s, int n,
                              double matrix[RATES][RATES]) {
    const WirePoint p = crest_point(c, xi);
    const double b = c->wire->radius, *x = c->rotation[0];
    const double distance = sqrt(p.square), gap = larger(c->radius - distance - b, LEAST_FILM * b);
    if (gap >= reach) return;
    Nearest at;
    set_normal(&at, c->rotation, p.side / distance, p.up / distance);
    const double *normal = at.normal;
    double lean = 0.0, size = 0.0, t[3], surface[3], turn = 0.0;
    for (int i = 0; i < 3; i++) lean += p.tangent[i] * normal[i];
    for (int i = 0; i < 3; i++) size += squared(t[i] = p.tangent[i] - lean * normal[i]);
    for (int i = 0; i < 3; i++) t[i] /= sqrt(size);
    const double e[3] = {normal[1] * t[2] - normal[2] * t[1], normal[2] * t[0] - normal[0] * t[2],
                         normal[0] * t[1] - normal[1] * t[0]};
    for (int i = 0; i < 3; i++) {
        surface[i] = p.point[i] + b * normal[i];
        turn += e[i] * x[i];
    }
    const double around = 1.0 - turn * turn; /* squared share of `e` around the tube */
    const double bend = 1.0 / (1.0 / b - around / c->radius), of_axis = 1.0 + around * b / (c->radius - b);
    double v[RATES], u[RATES], axis[RATES], along[RATES], across[RATES];
    set_row(p.point, normal, 1.0, v);
    set_row(p.point, e, 1.0, axis);
    set_row(surface, e, 1.0, across);
    set_row(surface, t, 1.0, along);
    SliceLanes *lanes = s->lanes + n / LANES;
    for (int i = 0; i < RATES; i++) {
        v[i] = -v[i] + 0.5 * along[i] * lean / sqrt(size); /* the gap falls along the wire where it leans to the wall */
        u[i] = 0.5 * across[i] - of_axis * axis[i];
        lanes->opening[i][n % LANES] = v[i];
        lanes->entrainment[i][n % LANES] = u[i];
    }
    /* what the film has more than at its reach, where the table's resistance of the wire holds */
    const double viscosity = c->viscosity * (1.0 - sqrt(gap / reach)), length = span * sqrt(size);
    const double width = sqrt(2.0 * bend * gap), unit = PI * viscosity * length * width / gap;
    lanes->gap[n % LANES] = gap;
    s->length[n] = length;
    s->scale[n] = film_scale(gap, bend, viscosity, c->bound);
    add_dyad(3.0 * unit * bend / gap, v, matrix);
    add_dyad(4.0 * unit, u, matrix);
    add_dyad(unit, along, matrix);
    add_dyad(unit, across, matrix);
}

bool add_crest_film(const Crest *c, const Nearest *nearest, Slices *slices, int first, double matrix[RATES][RATES]) {
    const double reach = CREST_REACH * c->wire->radius, gap = larger(nearest->gap, LEAST_FILM * c->wire->radius);
    if (gap >= reach) return false;
    const double from = c->first->xi, to = c->last->xi;
    const WirePoint p = crest_point(c, nearest->xi);
    /* The gap along the wire: a parabola, with a slope at an end of it. */
    const double distance = sqrt(p.square), slope = fabs(p.first) / distance;
    const double bend = larger(-p.second / distance, LEAST_FILM * reach / squared(to - from));
    const double width = 1.0 / (1.0 / sqrt(2.0 * gap / bend) + slope / gap);
    const double far = asinh(1.0 / (1.0 / sqrt(2.0 * (reach - gap) / bend) + slope / (reach - gap)) / width);
    for (int n = 0; n < LANES; n++) {
        const double at = far * ((2.0 * n + 1.0) / LANES - 1.0), span = width * cosh(at) * far * 2.0 / LANES;
        const double xi = nearest->xi + width * sinh(at);
        const double low = larger(xi - 0.5 * span, from), high = smaller(xi + 0.5 * span, to);
        if (low < high) add_slice_of_wire(c, clamped(xi, from, to), high - low, reach, slices, first + n, matrix);
    }
    return true;
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

/* Return the gap between the wall and one site, m.
 *
 * y: the state; rotation: body axes to lab; radius: R of the tube; site: row of sites; normal: wall's
 * normal at the nearest point in body axes; point: touching point from the origin in body axes, m; j:
 * (7,): the gap closes at j.q at the rates q. */
EXPORT double ring_gap(const State *y, const double (*rotation)[3] /* (3, 3) */, double radius, const Site *site,
                       double *normal /* (3) */, double *point /* (3) */, double *j /* (7) */) {
    return told(site_nearest(site, y, rotation, radius), normal, point, j);
}

/* Return the gap between the wall and the wire where it is farthest from the tube's axis, m.
 *
 * Arguments as of `ring_gap`; `bracket` is where along the wire to look: from, first guess, to; m from the root;
 * `stations` are those that it spans, two or three. */
EXPORT double crest(const State *y, const double (*rotation)[3] /* (3, 3) */, double radius, const Wire *wire,
                    const Station *stations /* (count) */, const double *bracket /* (3) */, double *normal /* (3) */,
                    double *point /* (3) */, double *j /* (7) */, int64_t count) {
    (void)count;
    return told(wire_nearest(wire, stations, y, rotation, radius, bracket), normal, point, j);
}

/* Return the gap as `crest` does, and write the forces of the lubrication film there.
 *
 * y: state, as of `ring_gap`; wire: columns of the wire; stations: all those of one wire; bracket: as of `crest`;
 * viscosity: Pa s; bound: p_c, Pa; rates: q; force: result against the rates, N and N m. */
EXPORT double crest_film(const State *y, const double (*rotation)[3] /* (3, 3) */, double radius, const Wire *wire,
                         const Station *stations /* (count) */, const double *bracket /* (3) */, double viscosity,
                         double bound, const double *rates /* (7) */, double *force /* (7) */, int64_t count) {
    const Station *last = stations + count - 1, *at = stations;
    while (at + 1 < last && at[1].xi <= bracket[0]) at++;
    const Crest crest = {wire, at, stations, last, y, rotation, radius, viscosity, bound};
    const Nearest nearest = wire_nearest(wire, at, y, rotation, radius, bracket);
    double matrix[RATES][RATES] = {{0.0}};
    Slices slices;
    clear_slices(&slices);
    forget_cavities(&slices);
    add_crest_film(&crest, &nearest, &slices, 0, matrix);
    set_lifts(&slices, bound, rates);
    for (int i = 0; i < RATES; i++) {
        force[i] = 0.0;
        for (int j = 0; j < RATES; j++) force[i] -= matrix[i][j] * rates[j];
        for (int n = 0; n < LANES; n++) force[i] += slice_force(&slices, n, i);
    }
    return nearest.gap;
}
