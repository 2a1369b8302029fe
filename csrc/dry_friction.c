/* Rates of two rigid links on which dry friction acts: the root of a balance of forces.
 *
 *     A q + sum_c mu_c N_c J_c' J_c q/sqrt(q' J_c' J_c q + v_r^2) = f
 *
 * for seven rates q, with N_c the loads at contacts and J_c q their sliding velocities (2,). Where A is symmetric the
 * left side is the gradient of a convex function. A joint friction as printed in (15) makes A unsymmetric, still with a
 * positive definite symmetric part. The lift of a film that cavitates, with the film's linear resistance in A, is the
 * gradient of a convex function too; see cavitation.c.
 */
#include "contacts.h"

static const int ROUNDS = 80;         /* steps of the iteration at most */
static const double BALANCED = 1e-13; /* what may be left of the forces */

/* Directions w of sliding at the contacts, |w| <= 1: the duals of Newton's method. */
typedef double Duals[MOST_CONTACTS][2];

Sliding sliding_at(const Contact *contact, const double q[RATES], double slow) {
    double u = 0.0, v = 0.0;
    for (int i = 0; i < RATES; i++) {
        u += contact->rows[0][i] * q[i];
        v += contact->rows[1][i] * q[i];
    }
    return (Sliding){u, v, contact->load / sqrt(u * u + v * v + slow * slow)};
}

void set_pressures(const Slices *slices, int first, const double q[RATES], double a[LANES], double b[LANES]) {
    const SliceLanes *lanes = slices->lanes + first / LANES;
    EACH_LANE a[l] = b[l] = 0.0;
    for (int i = 0; i < RATES; i++) {
        EACH_LANE {
            a[l] += lanes->entrainment[i][l] * q[i];
            b[l] += lanes->opening[i][l] * q[i];
        }
    }
    for (int l = 0; l < LANES; l++) {
        a[l] *= slices->scale[first + l].per_u;
        b[l] *= slices->scale[first + l].per_v;
    }
}

void set_lifts(Slices *slices, double bound, const double q[RATES]) {
    for (int first = 0; first < MOST_SLICES; first += LANES) {
        double a[LANES], b[LANES];
        set_pressures(slices, first, q, a, b);
        for (int l = 0; l < LANES; l++) {
            const int n = first + l;
            double *edges = slices->edges[n];
            if (n > 0 && isnan(edges[0])) { /* its neighbour's are near */
                edges[0] = slices->edges[n - 1][0];
                edges[1] = slices->edges[n - 1][1];
            }
            const double gap = slices->lanes[first / LANES].gap[l];
            slices->lift[n] = cavitation_lift(slices->scale + n, gap, bound, a[l], b[l], edges);
        }
    }
}

static int skipped_row(const Balance *b) { return b->prescribed ? b->along : -1; }

/* What rates leave of the balance, with the lifts of its slices; its size, in the measure of A's diagonal, without the
 * row of a torque. */
static double residual(Balance *b, const double q[RATES], double left[RATES]) {
    for (int i = 0; i < RATES; i++) {
        left[i] = -b->force[i];
        for (int j = 0; j < RATES; j++) left[i] += b->a[i][j] * q[j];
    }
    for (const Contact *c = b->contacts; c < b->contacts + b->count; c++) {
        const Sliding s = sliding_at(c, q, b->slow);
        for (int i = 0; i < RATES; i++) left[i] += s.drag * (c->rows[0][i] * s.u + c->rows[1][i] * s.v);
    }
    for (int k = 0; k < FILMS; k++) {
        Slices *film = b->slices[k];
        if (film) set_lifts(film, b->bound, q);
        for (int n = 0; film && n < MOST_SLICES; n++)
            for (int i = 0; i < RATES && film->lift[n].normal != 0.0; i++) left[i] -= slice_force(film, n, i);
    }
    double size = 0.0;
    for (int i = 0; i < RATES; i++)
        if (i != skipped_row(b)) size += left[i] * left[i] / b->a[i][i];
    return sqrt(size);
}

/* Size of the forces that balance, in the measure of A's diagonal. */
static double scale_of(const Balance *b, const double q[RATES]) {
    double found = 0.0;
    for (int i = 0; i < RATES; i++) {
        double row = fabs(b->force[i]);
        for (const Contact *c = b->contacts; c < b->contacts + b->count; c++)
            row += c->load * (fabs(c->rows[0][i]) + fabs(c->rows[1][i]));
        for (int j = 0; j < RATES; j++) row = larger(row, fabs(b->a[i][j] * q[j]));
        found += row * row / b->a[i][i];
    }
    return sqrt(found);
}

/* Take the derivative of a slice's lift from the derivative of the balance. */
static void add_slice(const Slices *s, int n, double h[RATES][RATES]) {
    const Lift lift = s->lift[n];
    double opening[RATES], entrainment[RATES];
    for (int i = 0; i < RATES; i++) {
        opening[i] = s->lanes[n / LANES].opening[i][n % LANES];
        entrainment[i] = s->lanes[n / LANES].entrainment[i][n % LANES];
    }
    for (int i = 0; i < RATES; i++) {
        const double v = s->length[n] * (opening[i] * lift.of_opening[0] + entrainment[i] * lift.of_opening[1]);
        const double u = s->length[n] * (opening[i] * lift.of_entrainment[0] + entrainment[i] * lift.of_entrainment[1]);
        for (int j = 0; j < RATES; j++) h[i][j] -= v * opening[j] + u * entrainment[j];
    }
}

/* The derivative of the balance in q, with the direction of sliding replaced by the duals w in one place.
 *
 * mu_c N_c J_c' (1 - (w v' + v w')/(2 s)) J_c/s with v = J_c q, s = sqrt(|v|^2 + v_r^2): positive definite, and the
 * derivative itself where w = v/s. */
static void set_tangent(const Balance *b, const Duals duals, const double q[RATES], double h[RATES][RATES]) {
    for (int i = 0; i < RATES; i++)
        for (int j = 0; j < RATES; j++) h[i][j] = b->a[i][j];
    for (int64_t n = 0; n < b->count; n++) {
        const Contact *c = b->contacts + n;
        const Sliding s = sliding_at(c, q, b->slow);
        const double less = 0.5 * s.drag / sqrt(s.u * s.u + s.v * s.v + b->slow * b->slow), *w = duals[n];
        const double uu = s.drag - 2.0 * less * w[0] * s.u, uv = -less * (w[0] * s.v + w[1] * s.u);
        const double vv = s.drag - 2.0 * less * w[1] * s.v;
        for (int i = 0; i < RATES; i++) {
            const double x = c->rows[0][i] * uu + c->rows[1][i] * uv, z = c->rows[0][i] * uv + c->rows[1][i] * vv;
            for (int j = 0; j < RATES; j++) h[i][j] += x * c->rows[0][j] + z * c->rows[1][j];
        }
    }
    for (int k = 0; k < FILMS; k++)
        for (int n = 0; b->slices[k] && n < MOST_SLICES; n++)
            if (b->slices[k]->lift[n].normal != 0.0) add_slice(b->slices[k], n, h);
}

/* Largest share of a step from w that stays in the unit circle. */
static double share_in_circle(const double w[2], double more_u, double more_v) {
    const double square = more_u * more_u + more_v * more_v, product = w[0] * more_u + w[1] * more_v;
    const double room = larger(1.0 - w[0] * w[0] - w[1] * w[1], 0.0);
    return square > 0.0 ? smaller(1.0, (sqrt(product * product + square * room) - product) / square) : 1.0;
}

/* Newton's step of the duals, s w = v at the step of q. */
static void move_duals(const Balance *b, const double q[RATES], const double step[RATES], Duals duals) {
    for (int64_t n = 0; n < b->count; n++) {
        const Contact *c = b->contacts + n;
        const Sliding now = sliding_at(c, q, b->slow), change = sliding_at(c, step, b->slow);
        const double s = sqrt(now.u * now.u + now.v * now.v + b->slow * b->slow);
        const double longer = (now.u * change.u + now.v * change.v) / s;
        double *w = duals[n];
        const double more_u = (now.u + change.u - w[0] * longer) / s - w[0];
        const double more_v = (now.v + change.v - w[1] * longer) / s - w[1];
        const double share = share_in_circle(w, more_u, more_v);
        w[0] += share * more_u;
        w[1] += share * more_v;
    }
}

/* Residual along a step: the derivative of the convex function. */
static double along_step(const Balance *b, const double left[RATES], const double step[RATES]) {
    double found = 0.0;
    for (int i = 0; i < RATES; i++)
        if (i != skipped_row(b)) found += left[i] * step[i];
    return found;
}

/* Move q along a step to where the residual along it, which grows, is small; the residual's size. Where a prescribed spin
 * bends the step from that of the convex function, the size decides too. */
static double take_step(Balance *b, double before, const double step[RATES], double q[RATES], double left[RATES]) {
    const double begin = along_step(b, left, step);
    const bool descends = begin < 0.0 || !b->prescribed;
    double low = 0.0, high = INFINITY, share = 1.0, size = 0.0, trial[RATES];
    for (int round = 0; round < (descends ? 60 : 10); round++) {
        for (int i = 0; i < RATES; i++) trial[i] = q[i] + share * step[i];
        size = residual(b, trial, left);
        if (b->prescribed && (size <= 0.5 * before || (!descends && size < before))) break;
        const double here = along_step(b, left, step);
        if (descends && here <= -0.5 * fabs(begin))
            low = share;
        else if (!descends || here > 0.5 * fabs(begin))
            high = share;
        else
            break;
        if (isinf(high)) break;
        share = 0.5 * (low + high);
    }
    for (int i = 0; i < RATES; i++) q[i] = trial[i];
    return size;
}

/* The step -H^-1 r; where the spin is prescribed, with a torque that keeps it. */
static void find_step(const Balance *b, double h[RATES][RATES], const double left[RATES], double step[RATES]) {
    double x[RATES][2];
    for (int i = 0; i < RATES; i++) {
        x[i][0] = -left[i];
        x[i][1] = i == b->along ? 1.0 : 0.0;
    }
    eliminate(h, x);
    const double torque = b->prescribed ? -(x[SPIN][0] + x[JOINT][0]) / (x[SPIN][1] + x[JOINT][1]) : 0.0;
    for (int i = 0; i < RATES; i++) step[i] = b->prescribed ? x[i][0] + torque * x[i][1] : x[i][0];
}

/* Take the lifts on along a step. */
static void follow_lifts(Slices *slices, const double step[RATES]) {
    for (int n = 0; n < MOST_SLICES; n++) {
        const SliceLanes *lanes = slices->lanes + n / LANES;
        Lift *lift = slices->lift + n;
        double v = 0.0, u = 0.0;
        for (int i = 0; i < RATES && lift->normal != 0.0; i++) {
            v += lanes->opening[i][n % LANES] * step[i];
            u += lanes->entrainment[i][n % LANES] * step[i];
        }
        lift->normal += lift->of_opening[0] * v + lift->of_entrainment[0] * u;
        lift->along += lift->of_opening[1] * v + lift->of_entrainment[1] * u;
    }
}

/* Find the rates; what is left of the forces, over them.
 *
 * Newton's method for rates and duals, the directions of sliding (T. F. Chan, G. H. Golub, P. Mulet, SIAM J. Sci.
 * Comput. 20:1964, 1999), which converges for any v_r. Where the spin q_3 + q_6 is prescribed, q has it at first and
 * keeps it, and a torque along one rate is left as that row's residual. */
double balance_rates(Balance *b, double q[RATES], double left[RATES]) {
    double h[RATES][RATES], step[RATES];
    Duals duals;
    double size = residual(b, q, left);
    const double scale = larger(scale_of(b, q), 1e-300);
    for (int64_t n = 0; n < b->count; n++) {
        const Sliding s = sliding_at(b->contacts + n, q, b->slow);
        const double speed = sqrt(s.u * s.u + s.v * s.v + b->slow * b->slow);
        duals[n][0] = s.u / speed;
        duals[n][1] = s.v / speed;
    }
    if (b->once) {
        set_tangent(b, duals, q, h);
        find_step(b, h, left, step);
        for (int i = 0; i < RATES; i++) q[i] += step[i];
        if (b->prescribed) size = residual(b, q, left); /* for the torque */
        for (int k = 0; k < FILMS && !b->prescribed; k++)
            if (b->slices[k]) follow_lifts(b->slices[k], step);
        return size / scale;
    }
    for (int round = 0; round < ROUNDS && !(size <= BALANCED * scale); round++) {
        set_tangent(b, duals, q, h);
        find_step(b, h, left, step);
        move_duals(b, q, step, duals);
        const double before = size;
        size = take_step(b, before, step, q, left);
        if (size > 0.5 * before && size <= 1e4 * BALANCED * scale) break; /* rounding */
    }
    return size / scale;
}

/* Find the rates q at which A q and dry friction balance the force; return the rest of the forces, over them.
 *
 * a: A; force: f; loads: mu_c N_c, at most 32; rows: J_c, sliding velocities along the tube and around it per rate;
 * slow: v_r, m/s; q: first guess, and the result; left: remaining forces. */
EXPORT double balanced(const double *a /* (7, 7) */, const double *force /* (7) */, const double *loads /* (count) */,
                       const double *rows /* (count, 2, 7) */, double slow, double *q /* (7) */, double *left /* (7) */,
                       int64_t count) {
    Balance balance = {.count = count, .slow = slow, .along = JOINT};
    for (int i = 0; i < RATES; i++) {
        balance.force[i] = force[i];
        for (int j = 0; j < RATES; j++) balance.a[i][j] = a[i * RATES + j];
    }
    for (int64_t n = 0; n < count; n++) {
        balance.contacts[n].load = loads[n];
        for (int i = 0; i < 2 * RATES; i++) balance.contacts[n].rows[i / RATES][i % RATES] = rows[2 * RATES * n + i];
    }
    return balance_rates(&balance, q, left);
}
