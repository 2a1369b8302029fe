/* Velocity and pressure at points, from a single layer on solids of revolution and from blobs along wires.
 *
 * Both come without factors: velocity times 8 pi mu, pressure times 8 pi. They are added to what is there, (n, 4).
 */
#include "panels.h"

/* Add the flow of regularised Stokeslets to `field`, velocity and pressure; e2 are squares of the blob radii.
 *
 * p = (x.f)(2 r^2 + 3 e^2)/r^5 (Cortez, SIAM J. Sci. Comput. 23:1204, 2001).
 *
 * Threads share n. */
EXPORT void add_blobs(const double *points /* (n, 3) */, const double *sources /* (count, 3) */,
                      const double *forces /* (count, 3) */, const double *e2 /* (count) */, double *field /* (n, 4) */,
                      int64_t n, int64_t count) {
    for (int64_t i = 0; i < n; i++) {
        const double *at = points + 3 * i;
        double u = field[4 * i], v = field[4 * i + 1], w = field[4 * i + 2], pressure = field[4 * i + 3];
        for (int64_t j = 0; j < count; j++) {
            const double *f = forces + 3 * j, *from = sources + 3 * j;
            const double x = at[0] - from[0], y = at[1] - from[1], z = at[2] - from[2];
            const double r2 = x * x + y * y + z * z + e2[j], cube = 1.0 / (r2 * sqrt(r2));
            const double diagonal = (r2 + e2[j]) * cube, dot = (x * f[0] + y * f[1] + z * f[2]) * cube;
            u += diagonal * f[0] + dot * x;
            v += diagonal * f[1] + dot * y;
            w += diagonal * f[2] + dot * z;
            pressure += dot * (2.0 + 3.0 * e2[j] / r2);
        }
        field[4 * i] = u;
        field[4 * i + 1] = v;
        field[4 * i + 2] = w;
        field[4 * i + 3] = pressure;
    }
}

/* Add the flow of first moments m of forces, trace-free, force by displacement: u_a = -m[b, k] d_k G[a, b], and its
 * pressure; e2 are squares of the blob radii.
 *
 * Threads share n. */
EXPORT void add_moments(const double *points /* (n, 3) */, const double *sources /* (count, 3) */,
                        const double *moments /* (count, 3, 3) */, const double *e2 /* (count) */,
                        double *field /* (n, 4) */, int64_t n, int64_t count) {
    for (int64_t i = 0; i < n; i++) {
        double *out = field + 4 * i;
        for (int64_t j = 0; j < count; j++) {
            const double *m = moments + 9 * j;
            double x[3], along = 0.0;
            for (int c = 0; c < 3; c++) x[c] = points[3 * i + c] - sources[3 * j + c];
            const double r2 = x[0] * x[0] + x[1] * x[1] + x[2] * x[2] + e2[j];
            const double i3 = 1.0 / (r2 * sqrt(r2)), i5 = i3 / r2;
            for (int c = 0; c < 3; c++) {
                const double mx = m[3 * c] * x[0] + m[3 * c + 1] * x[1] + m[3 * c + 2] * x[2];
                const double xm = m[c] * x[0] + m[3 + c] * x[1] + m[6 + c] * x[2];
                along += mx * x[c];
                out[c] += (i3 + 3.0 * e2[j] * i5) * mx - i3 * xm;
            }
            for (int c = 0; c < 3; c++) out[c] += 3.0 * i5 * along * x[c];
            out[3] += along * (6.0 + 15.0 * e2[j] / r2) * i5;
        }
    }
}

/* A complex number, as arrays of NumPy have it. */
typedef struct {
    double re, im;
} Amplitude;

/* What a panel does at one point: exp(i m theta) there, densities on the nodes (nodes, modes, 3), and the sum of
 * cylindrical velocity and pressure, lane by lane. */
typedef struct {
    int64_t modes, nodes;
    const Amplitude *turns, *density;
    double (*out)[LANES];
} PanelFlow;

/* Numbers of modes that reach a point: the others are below exp(-25). Returns the largest. */
static int64_t count_modes(const RingPairs *r, int64_t most, int64_t counts[LANES]) {
    int64_t largest = 0;
    for (int l = 0; l < LANES; l++) {
        const double near2 = r->dx[l] * r->dx[l] + r->delta[l] * r->delta[l];
        const double zeta = acosh(1.0 + near2 / (2.0 * larger(r->rho[l] * r->rho_s[l], 1e-300)));
        const int64_t count = 3 + (int64_t)(25.0 / larger(zeta, 1e-3));
        counts[l] = count < most ? count : most;
        largest = counts[l] > largest ? counts[l] : largest;
    }
    return largest;
}

/* Density of one mode and component at points, turned to the angle of the field's point: as cosine and as sine. */
static void turn_density(const PanelFlow *flow, const PanelPoints *points, int64_t m, int d, double like[LANES],
                         double other[LANES]) {
    const Amplitude turn = flow->turns[m], *density = flow->density + 3 * m + d;
    EACH_LANE like[l] = other[l] = 0.0;
    for (int64_t j = 0; j < flow->nodes; j++, density += 3 * flow->modes) {
        const double as_cos = density->re * turn.re - density->im * turn.im;
        const double as_sin = -(density->re * turn.im + density->im * turn.re);
        EACH_LANE {
            like[l] += points->cardinals[j][l] * as_cos;
            other[l] += points->cardinals[j][l] * as_sin;
        }
    }
}

/* Add the flow of rings at some points of a panel. */
static void add_rings(const void *context, PanelPoints *points) {
    const PanelFlow *flow = context;
    const RingPairs *r = &points->pairs;
    int64_t counts[LANES];
    const int64_t modes = count_modes(r, flow->modes, counts);
    double a[modes + 1][LANES], b[modes + 1][LANES], k[9][LANES], b_v[LANES], push[3][LANES], like[LANES], other[LANES];
    open_rings(&points->pairs, modes + 1, a, b);
    for (int64_t m = 0; m < modes; m++) {
        fill_ring_mode(r, m, a, b, k);
        fill_ring_b_v(r, m, a, b, b_v);
        EACH_LANE {
            push[0][l] = r->dx[l] * b[m][l];
            push[1][l] = r->delta[l] * b[m][l] - r->rho[l] * b_v[l];
            push[2][l] = (double)m * a[m][l] / r->rho_s[l];
        }
        for (int d = 0; d < 3; d++) {
            turn_density(flow, points, m, d, like, other);
            EACH_LANE {
                const double weight = m < counts[l] ? points->weights[l] : 0.0;
                flow->out[0][l] += weight * k[d][l] * like[l];
                flow->out[1][l] += weight * k[3 + d][l] * like[l];
                flow->out[2][l] += weight * k[6 + d][l] * other[l];
                flow->out[3][l] += 2.0 * weight * push[d][l] * like[l];
            }
        }
    }
}

/* Add the flow of a single layer on panels.
 *
 * points: where; x_p: nodes of the panels; rho_p: nodes of the panels; density: complex modes (f_x, f_rho, g) ds/du on
 * the nodes; nodes: on [-1, 1]; barycentric: weights of the nodes; fine: abscissas of a finer Gauss rule, for panels
 * near a point; fine_weights: their weights; weights: Gauss weights of the nodes; field: velocity and pressure to add
 * to.
 *
 * Threads share n. */
EXPORT void add_layer(const double *points /* (n, 3) */, const double *x_p /* (panels, size) */,
                      const double *rho_p /* (panels, size) */, const Amplitude *density /* (panels, size, modes, 3) */,
                      const double *nodes /* (size) */, const double *barycentric /* (size) */,
                      const double *fine /* (fine_size) */, const double *fine_weights /* (fine_size) */,
                      const double *weights /* (size) */, double *field /* (n, 4) */, int64_t n, int64_t panels,
                      int64_t size, int64_t modes, int64_t fine_size) {
    const PanelRule rule = {size, nodes, barycentric, weights, fine_size, fine, fine_weights};
    Amplitude turns[modes];
    for (int64_t i = 0; i < n; i++) {
        const double *at = points + 3 * i, theta = atan2(at[2], at[1]), c = cos(theta), s = sin(theta);
        for (int64_t m = 0; m < modes; m++) turns[m] = (Amplitude){cos((double)m * theta), sin((double)m * theta)};
        const Target target = {at[0], hypot(at[1], at[2]), 0.0};
        double lanes[4][LANES] = {{0.0}}, out[4] = {0.0};
        for (int64_t q = 0; q < panels; q++) {
            const Panel panel = {x_p + q * size, rho_p + q * size};
            const PanelFlow flow = {modes, size, turns, density + q * size * 3 * modes, lanes};
            integrate(&rule, &panel, &target, 1e-6, &(Integrand){add_rings, &flow});
        }
        for (int d = 0; d < 4; d++) {
            for (int l = 0; l < LANES; l++) out[d] += lanes[d][l];
        }
        field[4 * i] += out[0];
        field[4 * i + 1] += out[1] * c - out[2] * s;
        field[4 * i + 2] += out[1] * s + out[2] * c;
        field[4 * i + 3] += out[3];
    }
}
