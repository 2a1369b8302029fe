/* Regularised Stokeslets at points, and their gradients: forces and first moments of forces to velocities.
 *
 * The kernel is G = (1/r + e^2/r^3) I + x x'/r^3 with r^2 = |x|^2 + e^2 (Cortez, SIAM J. Sci. Comput. 23:1204, 2001);
 * factors 1/(8 pi mu) are left to the caller. A first moment m of the forces in a blob, m[b, k] = force along b times
 * displacement along k, moves the fluid by -m[b, k] d_k G[a, b], and feels the gradients of the velocity in turn.
 */
#include "core.h"

/* From one blob to another: the square of the blob radius is the mean of both. */
typedef struct {
    double x[3], e2, r2, i3; /* i3 = 1/r^3 */
} Apart;

static Apart apart(const double *points, const double *e2, int64_t i, int64_t j) {
    Apart a = {.e2 = 0.5 * (e2[i] + e2[j])};
    for (int c = 0; c < 3; c++) a.x[c] = points[3 * i + c] - points[3 * j + c];
    a.r2 = a.x[0] * a.x[0] + a.x[1] * a.x[1] + a.x[2] * a.x[2] + a.e2;
    a.i3 = 1.0 / (a.r2 * sqrt(a.r2));
    return a;
}

/* Fill in the velocities at points from unit forces at the same points, symmetric. */
EXPORT void force_matrix(const double *points /* (n, 3) */, const double *e2 /* (n) */,
                         double *matrix /* (n, 3, n, 3) */, int64_t n) {
    for (int64_t i = 0; i < n; i++) {
        for (int64_t j = 0; j <= i; j++) {
            const Apart a = apart(points, e2, i, j);
            const double diagonal = (a.r2 + a.e2) * a.i3;
            for (int c = 0; c < 3; c++) {
                for (int d = 0; d < 3; d++) {
                    const double value = a.x[c] * a.x[d] * a.i3 + (c == d ? diagonal : 0.0);
                    matrix[((3 * i + c) * n + j) * 3 + d] = matrix[((3 * j + d) * n + i) * 3 + c] = value;
                }
            }
        }
    }
}

/* A moment m contracted with x: m x, x m, and x m x. */
typedef struct {
    double mx[3], xm[3], xmx;
} Contracted;

static Contracted contracted(const double m[9], const double x[3]) {
    Contracted found = {.xmx = 0.0};
    for (int c = 0; c < 3; c++) {
        found.mx[c] = m[3 * c] * x[0] + m[3 * c + 1] * x[1] + m[3 * c + 2] * x[2];
        found.xm[c] = m[c] * x[0] + m[3 + c] * x[1] + m[6 + c] * x[2];
        found.xmx += found.mx[c] * x[c];
    }
    return found;
}

/* Velocity from a unit moment; rows of `out` are `stride` apart.
 *
 * G = a_0(r) I + b_0(r) x x'; a_1 is the derivative of a_0 over r, and so on. */
static void fill_velocity(const Apart *a, const Contracted *there, double *out, int64_t stride) {
    const double i5 = a->i3 / a->r2, a_1 = -a->i3 - 3.0 * a->e2 * i5, b_0 = a->i3, b_1 = -3.0 * i5;
    for (int c = 0; c < 3; c++) {
        out[c * stride] = -(a_1 * there->mx[c] + b_0 * there->xm[c] + b_1 * there->xmx * a->x[c]);
    }
}

/* Velocity gradient along a moment m_y here from a unit moment m_x there. */
static double gradient(const Apart *a, const double m_y[9], const Contracted *y, const double m_x[9],
                       const Contracted *x) {
    const double i5 = a->i3 / a->r2, i7 = i5 / a->r2, b_0 = a->i3, b_1 = -3.0 * i5, b_2 = 15.0 * i7;
    const double a_1 = -a->i3 - 3.0 * a->e2 * i5, a_2 = 3.0 * i5 + 15.0 * a->e2 * i7;
    double same = 0.0, crossed = 0.0, outer = 0.0, mixed = 0.0;
    for (int c = 0; c < 3; c++) {
        outer += y->mx[c] * x->mx[c];
        mixed += y->xm[c] * x->xm[c] + y->mx[c] * x->xm[c] + y->xm[c] * x->mx[c];
        for (int d = 0; d < 3; d++) {
            same += m_y[3 * c + d] * m_x[3 * c + d];
            crossed += m_y[3 * c + d] * m_x[3 * d + c];
        }
    }
    return -(a_2 * outer + a_1 * same + b_2 * y->xmx * x->xmx + b_1 * mixed + b_0 * crossed);
}

/* Fill in what unit first moments at points do.
 *
 * points: m; e2: square of the blob radius of each point; moments: trace-free tensors of the moments at each point,
 * force by displacement; gradients: of the velocities along the moments, symmetric. */
EXPORT void moment_matrices(const double *points /* (n, 3) */, const double *e2 /* (n) */,
                            const double *moments /* (n, q, 3, 3) */, double *velocities /* (n, 3, n, q) */,
                            double *gradients /* (n, q, n, q) */, int64_t n, int64_t q) {
    Contracted here[q], there[q];
    for (int64_t i = 0; i < n; i++) {
        for (int64_t j = 0; j < n; j++) {
            const Apart a = apart(points, e2, i, j);
            const double *m_y = moments + 9 * q * i, *m_x = moments + 9 * q * j;
            for (int64_t s = 0; s < q; s++) {
                there[s] = contracted(m_x + 9 * s, a.x);
                fill_velocity(&a, &there[s], velocities + (3 * i * n + j) * q + s, n * q);
            }
            for (int64_t t = 0; t < q && j <= i; t++) here[t] = contracted(m_y + 9 * t, a.x);
            for (int64_t e = 0; e < q * q && j <= i; e++) {
                const int64_t t = e / q, s = e % q;
                const double value = gradient(&a, m_y + 9 * t, &here[t], m_x + 9 * s, &there[s]);
                gradients[((i * q + t) * n + j) * q + s] = gradients[((j * q + s) * n + i) * q + t] = value;
            }
        }
    }
}
