/* Slices of the lubrication film under a body's straight side.
 *
 * Each is a film across a line contact, which may cavitate; see cavitation.c. They depend on the place alone: trials of
 * rates at one place share them.
 */
#include "slices.h"

#include <stddef.h>

static const double THIN = 0.05;       /* of the body's radius: gaps in which films may cavitate */
static const double DEEP = 1e-3;       /* likewise: a trial deeper in the wall is refused without its film */
static const double LEAST_GAP = 1e-12; /* likewise, where a trial is inside the wall */
static const double STRAIGHT = 1.1;   /* velocities between the ends of the side are less than those there times this */
static const double END_LOSS = 1.85;  /* the pressure at d from a flat end is 1 - exp(-1.85 d/s) of that far from it, */
static const double STEEP_END = 0.26; /* d 1/(1 + 0.26 h' s/h) of that where the gap opens from the end on, */
static const double ROUND_END = 0.76; /* and a rounded end of radius r is like 0.76 s sqrt(r/R') more of the side */
static const double ROLLED = 0.8;     /* cavities take less of the film's resistance to rolling */
static const double ALL_OF_IT = 38.0; /* from where on 1 - exp(-x) is 1 */

enum { POWERS = 6 }; /* squarings up to the 64th power */

/* L^-1 S of a lower triangular matrix. */
static void solve_lower(double l[6][6], const double s[6][6], double out[6][6]) {
    for (int i = 0; i < 6; i++) {
        const double over = 1.0 / l[i][i];
        for (int j = 0; j < 6; j++) out[i][j] = s[i][j];
        for (int k = 0; k < i; k++)
            for (int j = 0; j < 6; j++) out[i][j] -= l[i][k] * out[k][j];
        for (int j = 0; j < 6; j++) out[i][j] *= over;
    }
}

/* Largest eigenvalue of F^-1 S of two symmetric matrices, F positive definite, S positive semi-definite, from above by
 * at most 3 %: the 64th root of the trace of the 64th power of L^-1 S L^-T, F = L L'. */
static double largest_share(const double f[6][6], const double s[6][6]) {
    double l[6][6] = {{0.0}}, m[2][6][6], turned[6][6], traces[POWERS + 1], root = 1.0;
    for (int i = 0; i < 6; i++)
        for (int j = 0; j <= i; j++) {
            double left = f[i][j];
            for (int k = 0; k < j; k++) left -= l[i][k] * l[j][k];
            l[i][j] = i == j ? sqrt(left) : left / l[j][j];
        }
    solve_lower(l, s, m[1]);
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++) turned[i][j] = m[1][j][i];
    solve_lower(l, (const double (*)[6])turned, m[0]);
    for (int k = 0; k <= POWERS; k++) {
        const double (*here)[6] = (const double (*)[6])m[k % 2];
        double (*next)[6] = m[(k + 1) % 2];
        traces[k] = 0.0;
        for (int i = 0; i < 6; i++) traces[k] += here[i][i];
        const double over = 1.0 / (traces[k] * traces[k]);
        for (int i = 0; i < 6 && k < POWERS; i++) {
            double row[6] = {0.0};
            for (int n = 0; n < 6; n++)
                for (int j = 0; j < 6; j++) row[j] += here[i][n] * here[n][j];
            for (int j = 0; j < 6; j++) next[i][j] = row[j] * over;
        }
    }
    for (int k = POWERS; k > 0; k--) root = sqrt(root * traces[k]);
    return root * traces[0];
}

/* Places x along the straight side where body and wall are nearest.
 *
 * At a fixed place along the tube the film sees V = dh0/dt + v_x h0'/2 and u = v/2 - dy/dt - v_x y'/2 with the velocities
 * v around and v_x along the tube of the body's surface, and the contact line at y(x, t) around it, which moves
 * c = R/(R - a) times as far as the body's axis. The body takes gap and line along: dh0/dt and dy/dt are less by their
 * slopes times its own velocity along the tube than where they are followed. */
static void set_lanes(const FilmPlace *p, const double x[LANES], SliceLanes *out) {
    const double a = p->film->body, tube = p->film->tube, of_axis = tube / (tube - a);
    const double (*r)[3] = p->rotation;
    double side[LANES], up[LANES], y[LANES], z[LANES], turn[LANES];
    EACH_LANE {
        side[l] = p->y->position[1] + r[1][0] * x[l];
        up[l] = p->y->position[2] + r[2][0] * x[l];
        first_normal(side[l], up[l], tube, y + l, z + l);
    }
    for (int round = 0; round < NORMAL_ROUNDS; round++) {
        double most = 0.0;
        EACH_LANE {
            const Reach reach = reach_at(r[1][0], r[2][0], a, -a * a, tube, y[l], z[l]);
            turn[l] = turn_to_nearest(&reach, r[1][0], r[2][0], side[l], up[l], -a * a, y[l], z[l]);
            turn_normal(turn[l], y + l, z + l);
        }
        for (int l = 0; l < LANES; l++) most = larger(most, fabs(turn[l]));
        if (!(most > NORMAL_FOUND)) break;
    }
    EACH_LANE {
        const Reach reach = reach_at(r[1][0], r[2][0], a, -a * a, tube, y[l], z[l]);
        const double arm = x[l] - a * a * reach.n_1 / reach.size, ball = a * a / reach.size;
        const double n[3] = {reach.n_1, r[1][1] * y[l] + r[2][1] * z[l], r[1][2] * y[l] + r[2][2] * z[l]};
        const double p_0 = ball * n[0] + arm, p_1 = ball * n[1], p_2 = ball * n[2];
        const double d[3]
            = {r[0][1] * n[2] - r[0][2] * n[1], r[0][2] * n[0] - r[0][0] * n[2], r[0][0] * n[1] - r[0][1] * n[0]};
        out->gap[l] = larger(tube - y[l] * side[l] - z[l] * up[l] - reach.size, LEAST_GAP * a);
        out->slope[l] = -n[0];
        const double *t = r[0], lean = 0.5 * n[0], skew = of_axis * d[0]; /* h0' = -n_1, y' = c d_1 */
        const double slid[3] = {p_1 * t[2] - p_2 * t[1], p_2 * t[0] - p_0 * t[2], p_0 * t[1] - p_1 * t[0]};
        for (int i = 0; i < 3; i++) {
            out->opening[i][l] = lean * t[i] - n[i];
            out->opening[i + 3][l] = lean * slid[i];
            out->entrainment[i][l] = (0.5 - of_axis) * d[i] + 0.5 * skew * t[i];
            out->entrainment[i + 3][l] = -0.5 * skew * slid[i];
        }
        out->opening[6][l] = out->entrainment[6][l] = 0.0;
        out->opening[4][l] += arm * n[2];
        out->opening[5][l] -= arm * n[1];
        out->entrainment[3][l] += 0.5 * (p_1 * d[2] - p_2 * d[1]);
        out->entrainment[4][l] += 0.5 * (p_2 * d[0] - p_0 * d[2]) + x[l] * (of_axis * d[2] - skew * t[2]);
        out->entrainment[5][l] += 0.5 * (p_0 * d[1] - p_1 * d[0]) - x[l] * (of_axis * d[1] - skew * t[1]);
    }
}

static double bend_of(const Film *film) { return film->body * film->tube / (film->tube - film->body); }

/* Share of its pressure that a film has at a distance from an end, width s = sqrt(2 R' h0), its gap opening from the end
 * on at h' = steep h0/s.
 *
 * Finite elements of Reynolds' equation at the end of a long film: the numbers hold within 10 % of the pressure for
 * squeezing and rolling, 3 % in the mean, for h' s/h0 from 0 to 1.5 and radii r from 0 to 2 R'. */
static double share_at(double distance, double rounded, double width, double steep) {
    const double depth = END_LOSS * (distance / width + rounded) / (1.0 + STEEP_END * larger(steep, 0.0));
    return depth < ALL_OF_IT ? 1.0 - exp(-depth) : 1.0;
}

/* Slices of the film, closer towards its ends. */
static void set_slices(const FilmPlace *p, double bound, Slices *s) {
    const Film *film = p->film;
    const double length = film->front - film->rear, bend = bend_of(film);
    const double rear = ROUND_END * sqrt(film->rear_round / bend), front = ROUND_END * sqrt(film->front_round / bend);
    for (int first = 0; first < MOST_SLICES; first += LANES) {
        double x[LANES];
        SliceLanes *lanes = s->lanes + first / LANES;
        for (int l = 0; l < LANES; l++) {
            const double from = (first + l + 0.5) / MOST_SLICES, to = 1.0 - from;
            const double sum = from * from * from + to * to * to;
            x[l] = film->rear + length * from * from * from / sum;
            s->length[first + l] = 3.0 * length * squared(from * to / sum) / MOST_SLICES;
        }
        set_lanes(p, x, lanes);
        for (int l = 0; l < LANES; l++) {
            const double gap = lanes->gap[l], width = sqrt(2.0 * bend * gap), steep = lanes->slope[l] * width / gap;
            const double share
                = share_at(x[l] - film->rear, rear, width, steep) * share_at(film->front - x[l], front, width, -steep);
            s->share[first + l] = share;
            s->scale[first + l] = film_scale(gap, bend, share * p->viscosity, bound);
        }
    }
}

/* Weaken the slices' lifts, where the balance would not be the gradient of a convex function.
 *
 * The film of the table less what cavities take has to stay positive. They take all of the resistance to opening at
 * most, and less than ROLLED of that to rolling, together with it, while the linear film pulls with less than 600 p_c.
 * To rolling the parabola of a slice resists by up to a fifth more than the table's film, as far from its line as the
 * ends are: there its pressure is small, and does not decide on cavities. */
static void weaken(const FilmPlace *p, Slices *s) {
    double sliced[6][6][LANES] = {{{0.0}}}, total[6][6];
    const double bend = bend_of(p->film);
    for (int first = 0; first < MOST_SLICES; first += LANES) {
        const SliceLanes *lanes = s->lanes + first / LANES;
        double squeeze[LANES], roll[LANES];
        EACH_LANE {
            const double gap = lanes->gap[l], width = sqrt(2.0 * bend * gap);
            const double part = s->length[first + l] * s->share[first + l] * PI * width / squared(gap);
            squeeze[l] = 3.0 * bend * part;
            roll[l] = ROLLED * 2.0 * squared(width) / bend * part;
        }
        for (int i = 0; i < 6; i++)
            for (int j = 0; j <= i; j++)
                EACH_LANE sliced[i][j][l] += squeeze[l] * lanes->opening[i][l] * lanes->opening[j][l]
                                           + roll[l] * lanes->entrainment[i][l] * lanes->entrainment[j][l];
    }
    for (int i = 0; i < 6; i++)
        for (int j = 0; j <= i; j++) {
            double sum = 0.0;
            for (int l = 0; l < LANES; l++) sum += sliced[i][j][l];
            total[i][j] = total[j][i] = sum;
        }
    const double less = 1.0 / larger(largest_share(p->resistance, total), 1.0);
    for (int n = 0; n < MOST_SLICES; n++) s->length[n] *= less;
}

/* Whether the film between the ends of the straight side, which are set, can be thin. */
static bool set_ends(const FilmPlace *p, double bound, SliceLanes *ends) {
    const Film *film = p->film;
    const bool thin = isfinite(bound) && film->front > film->rear && film->half == 0.0
                   && p->thinnest < THIN * film->body && p->thinnest > -DEEP * film->body;
    if (!thin) return false;
    double x[LANES];
    for (int l = 0; l < LANES; l++) x[l] = l == 0 ? film->rear : film->front;
    set_lanes(p, x, ends);
    return true;
}

/* Whether any slice may cavitate at the rates: velocities are nearly straight between the ends, one of which is nearest. */
static bool may_cavitate(const FilmPlace *p, const SliceLanes *ends, double bound, const double q[RATES]) {
    double fastest = 0.0, most = 0.0;
    for (int n = 0; n < 2; n++) {
        double opening = 0.0, entrainment = 0.0;
        for (int i = 0; i < RATES; i++) {
            opening += ends->opening[i][n] * q[i];
            entrainment += ends->entrainment[i][n] * q[i];
        }
        fastest = larger(fastest, STRAIGHT * opening);
        most = larger(most, STRAIGHT * fabs(entrainment));
    }
    const FilmScale worst = film_scale(smaller(ends->gap[0], ends->gap[1]), bend_of(p->film), p->viscosity, bound);
    return is_near_cavitation(worst.per_u * most, worst.per_v * fastest);
}

/* Whether any slice cavitates at the rates. */
static bool cavitates_at(const FilmPlace *p, SlicedFilm *sliced, double bound, const double q[RATES]) {
    Slices *slices = &sliced->slices;
    if (!sliced->has_slices) {
        set_slices(p, bound, slices);
        sliced->has_slices = true;
    }
    for (int first = 0; first < MOST_SLICES; first += LANES) {
        double a[LANES], b[LANES];
        set_pressures(slices, first, q, a, b);
        for (int l = 0; l < LANES; l++)
            if (cavitates(a[l], b[l])) return true;
    }
    return false;
}

void begin_slices(SlicedFilm *sliced, const SlicedFilm *last) {
    for (int n = 0; n < MOST_SLICES; n++)
        for (int k = 0; k < 2; k++) sliced->slices.edges[n][k] = last->slices.edges[n][k];
    sliced->has_ends = sliced->has_slices = sliced->is_weakened = false;
}

double balance_film(const FilmPlace *p, SlicedFilm *sliced, Balance *b, double q[RATES], double left[RATES]) {
    b->slices[BODY_FILM] = NULL;
    if (!sliced->has_ends && !set_ends(p, b->bound, &sliced->ends)) return balance_rates(b, q, left);
    sliced->has_ends = true;
    if (!may_cavitate(p, &sliced->ends, b->bound, q) || !cavitates_at(p, sliced, b->bound, q)) {
        const double size = balance_rates(b, q, left);
        if (!may_cavitate(p, &sliced->ends, b->bound, q) || !cavitates_at(p, sliced, b->bound, q)) return size;
    }
    b->slices[BODY_FILM] = &sliced->slices;
    if (!sliced->is_weakened) weaken(p, &sliced->slices);
    sliced->is_weakened = true;
    return balance_rates(b, q, left);
}
