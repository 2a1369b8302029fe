/* Fourier modes of the Stokeslet around rings about one axis.
 *
 * A ring carries a force density (f_x, f_rho, f_theta) that varies as exp(i m theta). Velocities at another ring about
 * the same axis vary alike. With f_theta = i g and u_theta = i v the 3x3 block between (f_x, f_rho, g) and
 * (u_x, u_rho, v) is real, and symmetric under exchange of the rings. All of it follows from
 *
 *     A_n = int cos(n phi)/r dphi,   B_n = int cos(n phi)/r^3 dphi,
 *     r^2 = X^2 + rho^2 + rho'^2 - 2 rho rho' cos(phi) + e^2,
 *
 * Legendre functions of half-integer degree (DLMF 14.19), by integration by parts, such as
 * rho rho' int sin(phi) sin(m phi)/r^3 dphi = m A_m, so that nothing cancels where the rings come close. The kernel is
 * (1/r + e^2/r^3) I + x x'/r^3: the Stokeslet for e = 0, regularised (Cortez, SIAM J. Sci. Comput. 23:1204, 2001)
 * otherwise; the factor 1/(8 pi mu) is left to the caller.
 */
#include "rings.h"

/* Complete elliptic integrals (K, E) from 1 - k^2, by the arithmetic-geometric mean (DLMF 19.8). */
static void elliptic(const double complement[LANES], double big_k[LANES], double big_e[LANES]) {
    double a[LANES], b[LANES], c[LANES], total[LANES], weight = 0.5;
    int slowest = 0; /* the means of the smallest complement are the farthest apart */
    for (int l = 1; l < LANES; l++) slowest = complement[l] < complement[slowest] ? l : slowest;
    EACH_LANE {
        a[l] = 1.0;
        b[l] = sqrt(complement[l]);
        total[l] = 0.5 * (1.0 - complement[l]);
    }
    for (int step = 0; step < 40; step++) {
        weight *= 2.0;
        EACH_LANE {
            c[l] = 0.5 * (a[l] - b[l]);
            b[l] = sqrt(a[l] * b[l]);
            a[l] -= c[l];
            total[l] += weight * c[l] * c[l];
        }
        if (c[slowest] <= 1e-16 * a[slowest]) break;
    }
    EACH_LANE {
        big_k[l] = 0.5 * PI / a[l];
        big_e[l] = big_k[l] * (1.0 - total[l]);
    }
}

/* A_0 and A_1 lead to the others where they hardly fall off (n zeta < 1), and only in the lanes of those. */
static void recur_forward(const double p[LANES], const double s[LANES], const double first[LANES],
                          const int64_t is_level[LANES], int64_t count, double (*a)[LANES]) {
    EACH_LANE a[1][l] = is_level[l] ? first[l] : a[1][l];
    for (int64_t n = 1; n < count - 1; n++) {
        const double twice = 2.0 * (double)n, below = (double)n - 0.5, above = (double)n + 0.5;
        EACH_LANE {
            const double next = (twice * s[l] * a[n][l] - below * p[l] * a[n - 1][l]) / (above * p[l]);
            a[n + 1][l] = is_level[l] ? next : a[n + 1][l];
        }
    }
}

/* A_n is the solution that falls off: ratios by backward recurrence from order `last`. */
static void recur_backward(const double p[LANES], const double s[LANES], int64_t last, int64_t count,
                           double (*a)[LANES]) {
    double ratio[LANES] = {0.0};
    for (int64_t n = last; n > 0; n--) {
        const double twice = 2.0 * (double)n, below = (double)n - 0.5, above = (double)n + 0.5;
        EACH_LANE ratio[l] = below * p[l] / (twice * s[l] - above * p[l] * ratio[l]);
        if (n < count) EACH_LANE a[n][l] = ratio[l];
    }
    for (int64_t n = 1; n < count; n++) EACH_LANE a[n][l] *= a[n - 1][l];
}

void open_rings(RingPairs *r, int64_t count, double (*a)[LANES], double (*b)[LANES]) {
    double p[LANES], near2[LANES], far2[LANES], far[LANES], s[LANES], share[LANES], big_k[LANES], big_e[LANES];
    EACH_LANE {
        const double dx2 = r->dx[l] * r->dx[l], tiny = 1e-14 * (fabs(r->dx[l]) + r->rho[l] + r->rho_s[l]);
        r->rho[l] = larger(r->rho[l], tiny);
        r->rho_s[l] = larger(r->rho_s[l], tiny);
        p[l] = r->rho[l] * r->rho_s[l];
        near2[l] = larger(dx2 + r->delta[l] * r->delta[l] + r->e2, 1e-30 * (p[l] + dx2));
        far2[l] = near2[l] + 4.0 * p[l];
        far[l] = sqrt(far2[l]);
        s[l] = 0.5 * (near2[l] + 2.0 * p[l]);
        share[l] = near2[l] / far2[l];
    }
    elliptic(share, big_k, big_e);
    double first[LANES];
    int64_t is_level[LANES], any_level = 0, last = 0;
    EACH_LANE {
        a[0][l] = 4.0 * big_k[l] / far[l];
        first[l] = (s[l] * a[0][l] - 2.0 * far[l] * big_e[l]) / p[l];
    }
    for (int l = 0; l < LANES; l++) {
        const double excess = near2[l] / (2.0 * p[l]); /* cosh(zeta) - 1: A_n falls off as exp(-n zeta) */
        const double zeta = log1p(excess + sqrt(excess * (excess + 2.0)));
        is_level[l] = (double)count * zeta < 1.0;
        any_level |= is_level[l];
        const int64_t from = is_level[l] ? 0 : count + 2 + (int64_t)(18.0 / zeta);
        last = from > last ? from : last;
    }
    if (last) recur_backward(p, s, last, count, a);
    if (any_level) recur_forward(p, s, first, is_level, count, a);
    double scale[LANES];
    EACH_LANE {
        b[0][l] = 4.0 * big_e[l] / (near2[l] * far[l]);
        scale[l] = 4.0 / (near2[l] * far2[l]);
    }
    for (int64_t n = 1; n < count; n++) {
        EACH_LANE b[n][l] = scale[l] * ((double)n - 0.5) * (p[l] * a[n - 1][l] - s[l] * a[n][l]);
    }
}

/* From A_m where the rings are close, since B_m cancels. */
void fill_ring_b_v(const RingPairs *r, int64_t m, double (*a)[LANES], double (*b)[LANES], double b_v[LANES]) {
    const double *before = b[m ? m - 1 : 1];
    EACH_LANE {
        const double p = r->rho[l] * r->rho_s[l];
        const double near2 = r->dx[l] * r->dx[l] + r->delta[l] * r->delta[l] + r->e2;
        const double close = (a[m][l] - near2 * b[m][l]) / (2.0 * p), apart = b[m][l] - 0.5 * (b[m + 1][l] + before[l]);
        b_v[l] = near2 < 0.3 * p ? close : apart;
    }
}

void fill_ring_mode(const RingPairs *r, int64_t m, double (*a)[LANES], double (*b)[LANES], double k[9][LANES]) {
    const double order = (double)m, e2 = r->e2, *before = a[m ? m - 1 : 1];
    double b_v[LANES];
    fill_ring_b_v(r, m, a, b, b_v);
    EACH_LANE {
        const double dx = r->dx[l], delta = r->delta[l], rho = r->rho[l], rho_s = r->rho_s[l];
        const double near2 = dx * dx + delta * delta + e2, a_m = a[m][l], b_m = b[m][l];
        const double a_cos = 0.5 * (a[m + 1][l] + before[l]), a_sin = m ? 0.5 * (before[l] - a[m + 1][l]) : 0.0;
        const double a_v = a_m - a_cos, b_cos = b_m - b_v[l]; /* v = 1 - cos(phi) */
        const double p_b_sin = order * a_m;
        const double h_cos = a_cos + e2 * b_cos, h_sin = a_sin + e2 * p_b_sin / (rho * rho_s);
        const double mixed = h_sin + a_sin + order * a_v, turned = p_b_sin / rho, turned_s = p_b_sin / rho_s;
        k[0][l] = a_m + e2 * b_m + dx * dx * b_m;
        k[1][l] = dx * (delta * b_m - rho * b_v[l]);
        k[2][l] = dx * turned_s;
        k[3][l] = dx * (delta * b_m + rho_s * b_v[l]);
        k[4][l] = h_cos + delta * delta * b_cos - 0.5 * (a_v - near2 * b_v[l]);
        k[5][l] = mixed + delta * turned_s;
        k[6][l] = -dx * turned;
        k[7][l] = mixed - delta * turned;
        k[8][l] = h_cos + a_cos - order * a_sin;
    }
}

/* Fill a[n] = int cos(n phi)/r dphi and b[n] = int cos(n phi)/r^3 dphi.
 *
 * dx: axial distance of the rings; delta: rho - rho_s, known better than the difference where the rings are close; rho:
 * radius of one ring, above 0; rho_s: radius of the other, above 0; e2: square of the blob radius; rings that coincide
 * need one; a: at least 2. */
EXPORT void ring_integrals(double dx, double delta, double rho, double rho_s, double e2, double *a /* (count) */,
                           double *b /* (count) */, int64_t count) {
    double a_lanes[count][LANES], b_lanes[count][LANES];
    RingPairs pairs = {.e2 = e2};
    EACH_LANE {
        pairs.dx[l] = dx;
        pairs.delta[l] = delta;
        pairs.rho[l] = rho;
        pairs.rho_s[l] = rho_s;
    }
    open_rings(&pairs, count, a_lanes, b_lanes);
    for (int64_t n = 0; n < count; n++) {
        a[n] = a_lanes[n][0];
        b[n] = b_lanes[n][0];
    }
}

/* Fill the blocks between all rings of two sets, from the sources (x_s, rho_s) to the targets (x, rho). */
EXPORT void ring_blocks(const double *x /* (targets) */, const double *rho /* (targets) */,
                        const double *x_s /* (sources) */, const double *rho_s /* (sources) */, double e2,
                        double *blocks /* (modes, targets, 3, sources, 3) */, int64_t targets, int64_t sources,
                        int64_t modes) {
    double a[modes + 1][LANES], b[modes + 1][LANES], k[9][LANES];
    RingPairs pairs = {.e2 = e2};
    for (int64_t i = 0; i < targets; i++) {
        for (int64_t first = 0; first < sources; first += LANES) {
            const int some = (int)(sources - first < LANES ? sources - first : LANES);
            EACH_LANE {
                const int64_t j = first + (l < some ? l : some - 1);
                pairs.dx[l] = x[i] - x_s[j];
                pairs.delta[l] = rho[i] - rho_s[j];
                pairs.rho[l] = rho[i];
                pairs.rho_s[l] = rho_s[j];
            }
            open_rings(&pairs, modes + 1, a, b);
            for (int64_t m = 0; m < modes; m++) {
                fill_ring_mode(&pairs, m, a, b, k);
                for (int c = 0; c < 3; c++) {
                    double *row = blocks + 3 * (((m * targets + i) * 3 + c) * sources + first);
                    for (int l = 0; l < some; l++) {
                        for (int d = 0; d < 3; d++) row[3 * l + d] = k[3 * c + d][l];
                    }
                }
            }
        }
    }
}
