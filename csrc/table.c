/* Resistance of a robot anywhere in its tube: lubrication film plus interpolated outer part.
 *
 * A pose is the offset e of the body's mid-length from the tube's axis, pitch p (nose up), yaw psi (nose to the side)
 * and phase phi of the tail. The outer part is interpolated over
 *
 *     t = 1 - e/e_c(p), 0 where a robot without yaw touches the floor of the tube, 1 on its axis,
 *     f = p/p_hi(t) nose up or p/p_lo(t) nose down, 1 at the largest pitch of the table,
 *     g = psi/psi_c(e, p), 1 at the largest yaw of the table there, at which the tail is near the glass.
 *
 * The end of a tail of length L is off the axis by L sin(psi) across the plane of the offset and by L sin(p) - e along
 * it, so that sin(psi_c)^2 is a quadratic polynomial of sin(p) and e.
 *
 * Outside the range the outer part is that of its end: how far beyond it a tail touches the glass depends on its phase.
 * The largest yaw is that at a pitch of the last node with yaw at most: nearer to the touching pitch it goes to zero.
 *
 * Its Cholesky factor, logarithms on the diagonal, is a polynomial in sqrt(t) and in log(1.3 - |f|) between the nodes,
 * one nose up and one nose down, linear in t below the first, a polynomial of degree six in artanh(g/1.2), linear beyond
 * the last node, and a Fourier sum in the phase: the outer part is positive definite everywhere.
 */
#include "table.h"

enum { HEADER = 8, YAW_LIMIT = 7, YAW_ORDERS = 6, MOST_NODES = 12 };

static const double STEEPEST[2]
    = {12.0 * PI / 180.0, 8.0 * PI / 180.0}; /* largest pitch of a table nose up, down, rad */
static const double PITCH_SLACK = 1.1;  /* of the largest pitch: where the glass sets it, the tail touches beyond it */
static const double YAW_SLACK = 1.1;    /* of the largest yaw, likewise */
static const double ROUNDING = 1e-9;    /* of angles given in degrees */
static const double BEYOND = 1.3;       /* the largest pitch, so that the logarithm stays finite at contact */
static const double BEYOND_YAWED = 2.5; /* of what a yaw adds: its largest one is less at such pitches */
static const double BEYOND_YAW = 1.2;   /* the largest yaw, so that the inverse tangent stays finite at contact */
static const double LAST_YAW = 0.95;    /* yaw of the last nodes, over the largest one */
static const double SLOPE_STEP = 1e-7;  /* radii and rad, of differences over which the table is smooth */
static const double LEAST_YAW = 1e-3;   /* rad, where the tail nearly touches the glass without a yaw */

Table table_opened(const double *packed) {
    Table t = {
        .radius = packed[0],
        .rings = (int64_t)packed[1],
        .gaps = (int64_t)packed[2],
        .up = (int64_t)packed[3],
        .down = (int64_t)packed[4],
        .phases = (int64_t)packed[5],
        .yaw_gaps = (int64_t)packed[6],
        .yaw_pitches = (int64_t)packed[7],
    };
    const int64_t block = t.phases * FACTOR;
    t.outline = (const double (*)[4])(packed + HEADER);
    t.gap_nodes = packed + HEADER + 4 * t.rings;
    t.up_nodes = t.gap_nodes + t.gaps;
    t.down_nodes = t.up_nodes + t.up;
    t.most = (const double (*)[2])(t.down_nodes + t.down);
    t.yaw_gap_nodes = t.down_nodes + t.down + 2 * t.gaps;
    t.yaw_pitch_nodes = t.yaw_gap_nodes + t.yaw_gaps;
    t.yaw_limit = t.yaw_pitch_nodes + t.yaw_pitches;
    t.outer = t.yaw_limit + YAW_LIMIT;
    t.yawed = t.outer + t.gaps * (t.up + t.down - 1) * block;
    t.film = (const Film *)(t.yawed + t.yaw_gaps * t.yaw_pitches * YAW_ORDERS * block);
    return t;
}

/* Offset e_c at which a body without yaw touches the floor of the tube, m.
 *
 * The body is the hull of rings about its axis, each the centre of an ellipse: (x, rho, semi-axis along, across), m. */
EXPORT double contact_offset(const double (*rings)[4] /* (count, 4) */, double radius, double pitch, int64_t count) {
    const double c = cos(pitch), s = sin(pitch);
    double reach = -INFINITY;
    for (int64_t i = 0; i < count; i++) {
        const double along = rings[i][2] * s, across = rings[i][3] * c;
        reach = larger(reach, rings[i][1] * c - rings[i][0] * s + sqrt(along * along + across * across));
    }
    return radius - reach;
}

/* Share w of the film at t: 1 at contact, 0 on the axis, where no side is the nearer one. */
EXPORT double cut_of_film(double t) { return t >= 1.0 ? 0.0 : squared(1.0 - squared(larger(t, 0.0))); }

/* What the outer part is a polynomial of: what nears the glass varies as the logarithm of its clearance. */
EXPORT double stretched_yaw(double share) { return atanh(share / BEYOND_YAW); }

/* Weights of Lagrange's polynomials at a place. */
static void lagrange_weights(const double *nodes, int64_t count, double at, double *out) {
    for (int64_t j = 0; j < count; j++) {
        double weight = 1.0;
        for (int64_t m = 0; m < count; m++)
            if (m != j) weight *= (at - nodes[m]) / (nodes[j] - nodes[m]);
        out[j] = weight;
    }
}

/* Weights in log(beyond - f): what nears the glass varies as the logarithm of its clearance. */
static void pitch_weights(const double *nodes, int64_t count, double f, double beyond, double *out) {
    double logarithms[MOST_NODES];
    for (int64_t j = 0; j < count; j++) logarithms[j] = log(beyond - nodes[j]);
    lagrange_weights(logarithms, count, log(beyond - f), out);
}

/* Weights in the square root of t, linear in t below the first node. */
static void gap_weights(const double *nodes, int64_t count, double t, double *out) {
    double roots[MOST_NODES];
    for (int64_t j = 0; j < count; j++) roots[j] = sqrt(nodes[j]);
    lagrange_weights(roots, count, sqrt(larger(t, nodes[0])), out);
    if (t >= nodes[0]) return;
    const double first = roots[0], slope = 0.5 / first * (t - nodes[0]);
    for (int64_t j = 1; j < count; j++) { /* slopes of the polynomials at the first node */
        double factor = slope / (roots[j] - first);
        for (int64_t m = 1; m < count; m++)
            if (m != j) factor *= (first - roots[m]) / (roots[j] - roots[m]);
        out[j] += factor;
        out[0] -= factor;
    }
}

/* Where a pose is among the nodes. */
typedef struct {
    double t, f;
    double of_gap[MOST_NODES]; /* weights of the nodes in t */
    double yawed_pitch;        /* at which the largest yaw is taken, rad */
    bool within;               /* the range of pitches */
} Position;

static Position position_of(const Table *table, Pose pose) {
    Position p;
    const int lowered = pose.pitch < 0.0;
    const double contact = contact_offset(table->outline, table->radius, pose.pitch, table->rings);
    p.t = clamped(1.0 - pose.offset / contact, 0.0, 1.0);
    gap_weights(table->gap_nodes, table->gaps, p.t, p.of_gap);
    double most = 0.0;
    for (int64_t i = 0; i < table->gaps; i++) most += p.of_gap[i] * table->most[i][lowered];
    p.f = pose.pitch / most;
    p.within = fabs(p.f) <= PITCH_SLACK && fabs(pose.pitch) <= STEEPEST[lowered] * (1.0 + ROUNDING);
    p.f = copysign(smaller(fabs(p.f), smaller(PITCH_SLACK, STEEPEST[lowered] / most)), p.f);
    p.yawed_pitch = pose.pitch;
    if (table->yaw_pitches > 0) {
        const double last = fabs(table->yaw_pitch_nodes[lowered ? 0 : table->yaw_pitches - 1]) * most;
        p.yawed_pitch = clamped(pose.pitch, -last, last);
    }
    return p;
}

/* Largest yaw at a place, rad: x is the offset of the body's mid-length over R, `limit` the polynomial and the largest yaw
 * anywhere, of `yaw_limit_of`. */
EXPORT double limited_yaw(const double *limit /* (7) */, double x, double pitch) {
    const double p = sin(pitch);
    const double sine = limit[0] + p * (limit[1] + p * limit[2]) + x * (limit[3] + p * limit[4] + x * limit[5]);
    return smaller(asin(sqrt(clamped(sine, LEAST_YAW * LEAST_YAW, 1.0))), limit[6]);
}

/* Powers of the stretched yaw from the first; beyond the last node their tangents there. */
static void yaw_powers(double share, double out[YAW_ORDERS]) {
    const double here = stretched_yaw(share);
    const double beyond = fabs(share) > LAST_YAW ? here - stretched_yaw(copysign(LAST_YAW, share)) : 0.0;
    const double s = here - beyond;
    double power = 1.0;
    for (int n = 0; n < YAW_ORDERS; n++) {
        out[n] = power * (s + beyond * (n + 1));
        power *= s;
    }
}

enum { MOST_TERMS = MOST_NODES * MOST_NODES * (1 + YAW_ORDERS) };

/* Terms of the interpolation: weights, and blocks of (phases, FACTOR) values. */
typedef struct {
    int64_t count;
    double weights[MOST_TERMS];
    const double *values[MOST_TERMS];
} Terms;

static void add_term(Terms *terms, double weight, const double *values) {
    terms->weights[terms->count] = weight;
    terms->values[terms->count++] = values;
}

/* Sum the terms in their order, six in one pass over the sums. */
static void sum_terms(const Terms *terms, int64_t count, double *restrict out) {
    int64_t k = 0;
    for (int64_t n = 0; n < count; n++) out[n] = 0.0;
    for (; k + 6 <= terms->count; k += 6) {
        const double *w = terms->weights + k, *const *v = terms->values + k;
        const double *restrict v0 = v[0], *restrict v1 = v[1], *restrict v2 = v[2], *restrict v3 = v[3];
        const double *restrict v4 = v[4], *restrict v5 = v[5];
        const double w0 = w[0], w1 = w[1], w2 = w[2], w3 = w[3], w4 = w[4], w5 = w[5];
#pragma omp simd
        for (int64_t n = 0; n < count; n++)
            out[n] = out[n] + w0 * v0[n] + w1 * v1[n] + w2 * v2[n] + w3 * v3[n] + w4 * v4[n] + w5 * v5[n];
    }
    for (; k < terms->count; k++)
        for (int64_t n = 0; n < count; n++) out[n] += terms->weights[k] * terms->values[k][n];
}

/* Add what a share of the largest yaw makes of the coefficients. */
static void add_yaw(const Table *table, const Position *p, double share, Terms *terms) {
    const int64_t gaps = table->yaw_gaps, pitches = table->yaw_pitches, block = table->phases * FACTOR;
    const double *nodes = table->yaw_pitch_nodes;
    double of_gap[MOST_NODES], of_pitch[MOST_NODES], sizes[MOST_NODES], powers[YAW_ORDERS];
    gap_weights(table->yaw_gap_nodes, gaps, larger(p->t, table->yaw_gap_nodes[0]), of_gap);
    int64_t level = 0;
    while (nodes[level] < 0.0) level++;
    /* nose up and nose down apart: which end is the nearer one changes where it is level */
    const int64_t step = p->f < 0.0 ? -1 : 1, count = p->f < 0.0 ? level + 1 : pitches - level;
    for (int64_t j = 0; j < count; j++) sizes[j] = fabs(nodes[level + step * j]);
    pitch_weights(sizes, count, fabs(p->f), BEYOND_YAWED, of_pitch);
    yaw_powers(clamped(share, -YAW_SLACK, YAW_SLACK), powers);
    for (int64_t i = 0; i < gaps; i++) {
        for (int64_t j = 0; j < count; j++) {
            const double *node = table->yawed + (i * pitches + level + step * j) * YAW_ORDERS * block;
            const double weight = of_gap[i] * of_pitch[j];
            for (int n = 0; n < YAW_ORDERS; n++) add_term(terms, weight * powers[n], node + n * block);
        }
    }
}

/* Fourier coefficients of the outer part's factor, (phases, FACTOR); how the range was left. */
static int fill_coefficients(const Table *table, const Position *p, Pose pose, double *out) {
    const int64_t block = table->phases * FACTOR, columns = table->up + table->down - 1;
    const bool lowered = pose.pitch < 0.0;
    const int64_t pitches = lowered ? table->down : table->up;
    double of_pitch[MOST_NODES];
    pitch_weights(lowered ? table->down_nodes : table->up_nodes, pitches, fabs(p->f), BEYOND, of_pitch);
    Terms terms;
    terms.count = 0;
    for (int64_t i = 0; i < table->gaps; i++) {
        for (int64_t j = 0; j < pitches; j++) {
            const int64_t column = lowered && j > 0 ? table->up + j - 1 : j;
            add_term(&terms, p->of_gap[i] * of_pitch[j], table->outer + (i * columns + column) * block);
        }
    }
    int left = p->within ? INSIDE : TOO_FAR_PITCHED;
    if (pose.yaw != 0.0) {
        const double most = limited_yaw(table->yaw_limit, pose.offset / table->radius, p->yawed_pitch);
        if (table->yaw_gaps > 0) add_yaw(table, p, pose.yaw / most, &terms);
        if (!(table->yaw_gaps > 0 && fabs(pose.yaw) <= YAW_SLACK * most)) left = TOO_FAR_YAWED;
    }
    sum_terms(&terms, block, out);
    return left;
}

/* Set the share of the film's resistance. */
static void set_film(const Table *table, Pose pose, double t, double film[6][6]) {
    const double share = cut_of_film(t);
    film_resistance(table->film, pose.offset, pose.pitch, pose.yaw, film);
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++) film[i][j] *= share;
}

/* Add a share of the outer part at a phase, from the Fourier coefficients of its factor. */
static void add_outer(const double *coefficients, int64_t phases, double phase, double share,
                      double out[MOTIONS][MOTIONS]) {
    double factor[FACTOR];
    for (int k = 0; k < FACTOR; k++) factor[k] = coefficients[k];
    const double c = cos(phase), s = sin(phase);
    double cosine = c, sine = s; /* of multiples of the phase */
    for (int64_t m = 1; m < phases; m++) {
        const double weight = m % 2 == 1 ? cosine : sine, last = cosine;
        for (int k = 0; k < FACTOR; k++) factor[k] += weight * coefficients[m * FACTOR + k];
        if (m % 2 == 1) continue;
        cosine = c * last - s * sine;
        sine = s * last + c * sine;
    }
    for (int i = 0; i < MOTIONS; i++) {
        double *row = factor + i * (i + 1) / 2;
        row[i] = exp(row[i]);
        for (int j = 0; j <= i; j++) {
            const double *other = factor + j * (j + 1) / 2;
            double total = 0.0;
            for (int k = 0; k <= j; k++) total += row[k] * other[k];
            out[i][j] += share * total;
            if (j < i) out[j][i] += share * total;
        }
    }
}

void table_place_at(const Table *table, Pose pose, TablePlace *out) {
    const Position p = position_of(table, pose);
    out->pose = pose;
    out->left = fill_coefficients(table, &p, pose, out->coefficients);
    set_film(table, pose, p.t, out->film);
}

void table_slopes_at(const Table *table, const TablePlace *at, TableSlopes *out) {
    const double steps[3] = {SLOPE_STEP * table->radius, SLOPE_STEP, SLOPE_STEP};
    for (int k = 0; k < 3; k++) {
        Pose pose = at->pose;
        double *moved = k == 0 ? &pose.offset : k == 1 ? &pose.pitch : &pose.yaw, *slope = out->of[k];
        const double begin = *moved;
        *moved += steps[k];
        const double over = 1.0 / (*moved - begin);
        const Position p = position_of(table, pose);
        fill_coefficients(table, &p, pose, slope);
        for (int64_t n = 0; n < table->phases * FACTOR; n++) slope[n] = (slope[n] - at->coefficients[n]) * over;
    }
}

void table_place_near(const Table *table, const TablePlace *at, const TableSlopes *slopes, Pose pose, TablePlace *out) {
    const double contact = contact_offset(table->outline, table->radius, pose.pitch, table->rings);
    const double *of_offset = slopes->of[0], *of_pitch = slopes->of[1], *of_yaw = slopes->of[2];
    const double e = pose.offset - at->pose.offset, p = pose.pitch - at->pose.pitch, psi = pose.yaw - at->pose.yaw;
    out->pose = pose;
    out->left = at->left;
    for (int64_t n = 0; n < table->phases * FACTOR; n++)
        out->coefficients[n] = at->coefficients[n] + of_offset[n] * e + of_pitch[n] * p + of_yaw[n] * psi;
    set_film(table, pose, clamped(1.0 - pose.offset / contact, 0.0, 1.0), out->film);
}

static void begin_with_film(const TablePlace *place, double out[MOTIONS][MOTIONS]) {
    for (int i = 0; i < MOTIONS; i++)
        for (int j = 0; j <= i; j++) out[i][j] = out[j][i] = i < 6 ? place->film[i][j] : 0.0;
}

void table_resistance(const Table *table, const TablePlace *place, double phase, double out[MOTIONS][MOTIONS]) {
    begin_with_film(place, out);
    add_outer(place->coefficients, table->phases, phase, 1.0, out);
}

int table_mean_resistance(const Table *table, Pose pose, int64_t phases, double out[MOTIONS][MOTIONS]) {
    TablePlace place;
    table_place_at(table, pose, &place);
    begin_with_film(&place, out);
    for (int64_t n = 0; n < phases; n++)
        add_outer(place.coefficients, table->phases, 2.0 * PI * (double)n / (double)phases, 1.0 / (double)phases, out);
    return place.left;
}

/* Offset e at which the smallest distance between body and wall is `gap`, m, by secants; NaN where none is. */
static double offset_at_gap(const Film *film, double gap, double pitch, double yaw) {
    const double accuracy = 1e-12 * film->tube;
    double e = film->tube - film->body - gap, spare = smallest_gap(film, e, pitch, yaw) - gap;
    double before = e + spare, spare_before = smallest_gap(film, before, pitch, yaw) - gap;
    for (int k = 0; k < 30; k++) {
        if (fabs(spare) <= accuracy) return e;
        double slope = e != before ? (spare - spare_before) / (e - before) : -1.0;
        /* towards the wall the distance falls by nearly as much as the body sinks */
        if (!(-1.5 < slope && slope < -0.05)) slope = -1.0;
        before = e;
        spare_before = spare;
        e -= spare / slope;
        spare = smallest_gap(film, e, pitch, yaw) - gap;
    }
    return NAN;
}

/* Offset at which the body of a packed table touches the floor of the tube without a yaw, m. */
EXPORT double contact_offset_of(const double *packed /* (...) */, double pitch) {
    const Table table = table_opened(packed);
    return contact_offset(table.outline, table.radius, pitch, table.rings);
}

/* Largest yaw to either side at a place, rad: the table's nodes reach up to 0.95 of it. */
EXPORT double largest_yaw(const double *packed /* (...) */, double e, double pitch) {
    const Table table = table_opened(packed);
    return limited_yaw(table.yaw_limit, e / table.radius, pitch);
}

/* Fill the Fourier coefficients of the outer part's factor at a place without yaw, (phases, 36). */
EXPORT void outer_coefficients(const double *packed /* (...) */, double e, double pitch, double *out /* (phases, 36) */,
                               int64_t phases) {
    (void)phases;
    const Table table = table_opened(packed);
    const Pose pose = {e, pitch, 0.0};
    const Position p = position_of(&table, pose);
    fill_coefficients(&table, &p, pose, out);
}

/* Fill the symmetric 8x8 of a place, viscosity 1, in the robot's axes without roll; how the table's range was left.
 *
 * Returns `INSIDE`, or which range was left; then the answer is that of the nearest place inside. */
EXPORT int64_t resistance_at(const double *packed /* (...) */, double e, double pitch, double yaw, double phase,
                             double *out /* (8, 8) */) {
    const Table table = table_opened(packed);
    TablePlace place;
    table_place_at(&table, (Pose){e, pitch, yaw}, &place);
    table_resistance(&table, &place, phase, (double (*)[MOTIONS])out);
    return place.left;
}

/* Fill the 8x8 of a place, averaged over phases of the tail; arguments as `resistance_at`.
 *
 * packed: from `packed`; e: offset of the body's mid-length from the tube's axis, m; pitch: nose up, away from the near
 * wall, rad; yaw: nose to the side, rad; phases: number of phases, evenly spaced. */
EXPORT int64_t mean_resistance_at(const double *packed /* (...) */, double e, double pitch, double yaw, int64_t phases,
                                  double *out /* (8, 8) */) {
    const Table table = table_opened(packed);
    return table_mean_resistance(&table, (Pose){e, pitch, yaw}, phases, (double (*)[MOTIONS])out);
}

/* Fill the 8x8 at many places, averaged over the tail's phase, viscosity 1; NaN outside the table.
 *
 * tables: packed tables, one in each row, see `packed`; which: row of each place's table; gap: smallest distances
 * between body and wall, m; pitch: nose up, rad; yaw: nose to the side, rad; phases: number of phases, evenly spaced. */
EXPORT void mean_resistances(const double *tables /* (rows, size) */, const int64_t *which /* (count) */,
                             const double *gap /* (count) */, const double *pitch /* (count) */,
                             const double *yaw /* (count) */, int64_t phases, double *out /* (count, 8, 8) */,
                             int64_t rows, int64_t size, int64_t count) {
    (void)rows;
    for (int64_t n = 0; n < count; n++) {
        const Table table = table_opened(tables + which[n] * size);
        double (*matrix)[MOTIONS] = (double (*)[MOTIONS])(out + n * MOTIONS * MOTIONS);
        const double e = offset_at_gap(table.film, gap[n], pitch[n], yaw[n]);
        int left = TOO_FAR_PITCHED;
        if (e >= 0.0) left = table_mean_resistance(&table, (Pose){e, pitch[n], yaw[n]}, phases, matrix);
        if (left != INSIDE)
            for (int k = 0; k < MOTIONS * MOTIONS; k++) matrix[0][k] = NAN;
    }
}
