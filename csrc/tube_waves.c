/* Stokes flow in a circular tube as waves exp(i p theta + i k x), each carried by the velocity that it has on the wall.
 *
 * For each p and k the regular flow inside the tube follows from its velocity on the wall: a 3x3 matrix, the extension,
 * made of modified Bessel functions. The wall's reflection of a force is -U S U', with the extension U to target and
 * source, and the single layer S of a cylinder in unbounded fluid: a force on the wall moves nothing.
 *
 * The flows are gradients and curls of the harmonic phi = I_p(k rho) exp(i p theta + i k x), and those that carry the
 * pressure, u = rho d(grad phi)/d rho + e_x d phi/dx (Happel and Brenner, Low Reynolds Number Hydrodynamics, 1965,
 * section 3.3), combined so that they stay apart as k -> 0. In the components u_+- = u_rho +- i u_theta they hold the
 * orders p +- 1. As in rings.c, f_theta = i g and u_theta = i v; with f_x = i F and u_x = i X all matrices are real.
 */
#include "tube_waves.h"

#include <string.h>

/* By backward recurrence (DLMF 10.29, 10.74(v)), which forgets where it starts in orders above z only; the sum of all
 * I_n is exp(z) (DLMF 10.35.5). */
void fill_bessel_ratios(const double z[LANES], int64_t count, double (*r)[LANES], double scaled[LANES]) {
    double ratio[LANES], sum[LANES] = {0.0}, largest = 0.0;
    for (int l = 0; l < LANES; l++) largest = larger(largest, z[l]);
    const int64_t steep = (int64_t)largest, last = (count > steep ? count : steep) + 20;
    const double from = (double)last + 1.0;
    EACH_LANE ratio[l] = z[l] / (from + sqrt(from * from + z[l] * z[l]));
    for (int64_t n = last - 1; n >= 0; n--) {
        const double twice = 2.0 * ((double)n + 1.0);
        EACH_LANE {
            ratio[l] = z[l] / (twice + z[l] * ratio[l]);
            sum[l] = ratio[l] * (1.0 + sum[l]);
        }
        if (n < count) EACH_LANE r[n][l] = ratio[l];
    }
    EACH_LANE scaled[l] = 1.0 / (1.0 + 2.0 * sum[l]);
}

void fill_flows(int64_t p, const double z[LANES], double wall, double (*r)[LANES], double v[9][LANES]) {
    if (p == 0) { /* along, in a plane through the axis with and without a pressure, and around: 2 v = u_- - u_+ */
        EACH_LANE {
            const double up = r[0][l];
            v[0][l] = v[3][l] = v[7][l] = v[8][l] = 0.0;
            v[6][l] = -up / wall;
            v[1][l] = 1.0;
            v[4][l] = up;
            v[2][l] = z[l] * up / (wall * wall);
            v[5][l] = z[l] * (up * r[1][l]) / (wall * wall);
        }
        return;
    }
    const double order = (double)p + 2.0;
    EACH_LANE {
        const double up = r[p][l], plus = (2.0 * up - z[l] * (up * r[p + 1][l])) / wall, minus = -z[l] / wall;
        v[0][l] = wall;
        v[3][l] = v[6][l] = wall / r[p - 1][l];
        v[1][l] = -z[l] * up / wall;
        v[4][l] = 0.5 * (plus + minus);
        v[7][l] = 0.5 * (minus - plus);
        v[2][l] = z[l] * up + order;
        v[5][l] = z[l];
        v[8][l] = 0.0;
    }
}

/* Inverse of a 3x3 matrix by cofactors. */
static void invert(const double a[9], double inverse[9]) {
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            const int b = 3 * ((j + 1) % 3), c = 3 * ((j + 2) % 3), d = (i + 1) % 3, e = (i + 2) % 3;
            inverse[3 * i + j] = a[b + d] * a[c + e] - a[b + e] * a[c + d];
        }
    }
    const double determinant = a[0] * inverse[0] + a[1] * inverse[3] + a[2] * inverse[6];
    for (int e = 0; e < 9; e++) inverse[e] /= determinant;
}

void fill_wall_flows(double wall, int64_t orders, WallFlows *flows) {
    double z[LANES], scaled[LANES], r[orders + 2][LANES], v[9][LANES], matrix[9];
    EACH_LANE z[l] = wall;
    fill_bessel_ratios(z, orders + 2, r, scaled);
    for (int64_t p = 0; p < orders; p++) {
        fill_flows(p, z, wall, r, v);
        for (int e = 0; e < 9; e++) matrix[e] = v[e][0];
        invert(matrix, flows[p].inverse);
        flows[p].ratio = r[p][0];
        flows[p].scaled = scaled[0];
    }
}

/* Waves of one k in a tube: k R, and the flows of orders first <= p < end on the wall. */
typedef struct {
    double k, wall;
    int64_t first, end;
    const WallFlows *flows;
} Waves;

/* Fill the velocities (X, u_rho, v) at points for unit velocities on the wall, (orders, 3, 3) each. */
static void fill_extensions(Waves waves, const double rho[LANES], double (*out)[9 * (waves.end - waves.first)]) {
    const double wall = waves.wall;
    double z[LANES], size[LANES], r[waves.end + 2][LANES], v[9][LANES], u[9][LANES];
    EACH_LANE z[l] = larger(waves.k * rho[l], 1e-12 * wall);
    fill_bessel_ratios(z, waves.end + 2, r, size);
    EACH_LANE size[l] *= exp(z[l] - wall) / waves.flows[0].scaled; /* I_p(z)/I_p(k R), first of p = 0 */
    for (int64_t p = 0; p < waves.end; p++) {
        if (p >= waves.first) {
            const double *w = waves.flows[p].inverse;
            fill_flows(p, z, wall, r, v);
            for (int i = 0; i < 9; i += 3) {
                for (int j = 0; j < 3; j++) {
                    EACH_LANE u[i + j][l]
                        = size[l] * (v[i][l] * w[j] + v[i + 1][l] * w[3 + j] + v[i + 2][l] * w[6 + j]);
                }
            }
            for (int l = 0; l < LANES; l++) {
                for (int e = 0; e < 9; e++) out[l][(p - waves.first) * 9 + e] = u[e][l];
            }
        }
        EACH_LANE size[l] *= r[p][l] / waves.flows[p].ratio;
    }
}

/* Velocities (X, u_rho, v) at rho for unit velocities on the cylinder of that radius, (n, orders, 3, 3).
 *
 * first: the first order p. */
EXPORT void wave_extensions(double k, double radius, const double *rho, int64_t first, double *out, int64_t n,
                            int64_t orders) {
    WallFlows flows[first + orders];
    const Waves waves = {k, k * radius, first, first + orders, flows};
    double lanes[LANES], found[LANES][9 * orders];
    fill_wall_flows(waves.wall, waves.end, flows);
    for (int64_t at = 0; at < n; at += LANES) {
        const int some = (int)(n - at < LANES ? n - at : LANES);
        EACH_LANE lanes[l] = rho[at + (l < some ? l : some - 1)];
        fill_extensions(waves, lanes, found);
        memcpy(out + at * 9 * orders, found, (size_t)some * sizeof found[0]);
    }
}

/* I_i K_j for |i - j| at most 1, from w[n] = I_n K_n and the ratios of both; orders may be negative. */
static double product(int64_t i, int64_t j, const double *w, double (*r)[LANES], const double *q) {
    const int64_t a = i < 0 ? -i : i, b = j < 0 ? -j : j;
    if (a == b) return w[a];
    return a > b ? r[b][0] * w[b] : q[a] * w[a];
}

/* Single layer S on a cylinder in unbounded fluid: velocities (X, u_rho, v) from densities (F, f_rho, g).
 *
 * In units of 4 pi R/(8 pi mu), symmetric, (orders, 3, 3); first: K_1(z)/K_0(z). */
EXPORT void wall_layers(double z, double first, double *layers, int64_t orders) {
    double r[orders + 3][LANES], q[orders + 3], w[orders + 3], lanes[LANES], scaled[LANES];
    EACH_LANE lanes[l] = z;
    fill_bessel_ratios(lanes, orders + 3, r, scaled);
    q[0] = first;
    for (int64_t n = 1; n < orders + 3; n++) q[n] = 2.0 * (double)n / z + 1.0 / q[n - 1];
    for (int64_t n = 0; n < orders + 3; n++) w[n] = 1.0 / (z * (r[n][0] + q[n]));
    for (int64_t p = 0; p < orders; p++) {
        const double below = w[p ? p - 1 : 1], above = w[p + 1];
        const double up = product(p + 1, p, w, r, q), down = product(p - 1, p, w, r, q);
        const double plus = above + 0.5 * z * (up - product(p + 2, p + 1, w, r, q));
        const double minus = below + 0.5 * z * (down - product(p - 2, p - 1, w, r, q));
        const double mixed = 0.5 * z * (up - product(p, p - 1, w, r, q));
        double *s = layers + 9 * p;
        s[0] = 2.0 * (1.0 + (double)p) * w[p] + z * w[p] * (r[p][0] - q[p]);
        s[1] = s[3] = 0.5 * z * (2.0 * w[p] - above - below);
        s[2] = s[6] = 0.5 * z * (above - below);
        s[4] = 0.5 * (plus + minus) + mixed;
        s[8] = 0.5 * (plus + minus) - mixed;
        s[5] = s[7] = 0.5 * (minus - plus);
    }
}

/* Rows of numbers, one for each order and wall component (orders, 3), of the waves at one point. */
enum { X, RHO, V, COS, SIN, POINT_ROWS };

typedef struct {
    double cos, sin;
} Angle;

static Angle angle_of(double radians) { return (Angle){cos(radians), sin(radians)}; }

static Angle sum_of(Angle a, Angle b) { return (Angle){a.cos * b.cos - a.sin * b.sin, a.sin * b.cos + a.cos * b.sin}; }

/* A few points (x, y, z), of which the last one stands in all lanes that are free. */
typedef struct {
    int some;
    double x[LANES], rho[LANES];
    Angle theta[LANES];
} Points;

static Points points_at(const double *points, int64_t at, int64_t n) {
    Points found = {.some = (int)(n - at < LANES ? n - at : LANES)};
    for (int l = 0; l < LANES; l++) {
        const double *point = points + 3 * (at + (l < found.some ? l : found.some - 1));
        const double rho = hypot(point[1], point[2]);
        found.x[l] = point[0];
        found.rho[l] = rho;
        found.theta[l] = rho > 0.0 ? (Angle){point[1] / rho, point[2] / rho} : (Angle){1.0, 0.0};
    }
    return found;
}

/* Fill the extensions X, u_rho, v and cos, sin of p theta. */
static void fill_point(Waves waves, const double *restrict extensions, Angle theta,
                       double rows[restrict POINT_ROWS][3 * (waves.end - waves.first)]) {
    Angle turned = {1.0, 0.0};
    if (waves.first) turned = angle_of((double)waves.first * atan2(theta.sin, theta.cos));
    for (int64_t p = 0; p < waves.end - waves.first; p++) {
        for (int64_t w = 0; w < 3; w++) {
            for (int e = X; e <= V; e++) rows[e][3 * p + w] = extensions[9 * p + 3 * e + w];
            rows[COS][3 * p + w] = turned.cos;
            rows[SIN][3 * p + w] = turned.sin;
        }
        turned = sum_of(turned, theta);
    }
}

/* Fill the amplitudes of u_x and of two components across, u_rho and u_theta turned by an angle.
 *
 * The even wave of order p has X and u_rho as cos(p theta), the odd one as -sin(p theta); u_x comes times i. */
static void fill_wave(int64_t size, double rows[POINT_ROWS][size], bool is_odd, Angle turn,
                      double wave[restrict 3][size]) {
    const double *like = rows[is_odd ? SIN : COS], *other = rows[is_odd ? COS : SIN], sign = is_odd ? -1.0 : 1.0;
    for (int64_t e = 0; e < size; e++) {
        const double radial = rows[RHO][e] * (sign * like[e]), around = -rows[V][e] * other[e];
        wave[0][e] = rows[X][e] * (sign * like[e]);
        wave[1][e] = radial * turn.cos - around * turn.sin;
        wave[2][e] = radial * turn.sin + around * turn.cos;
    }
}

/* Velocities (x, rho, theta) of waves around a cylinder, in cylindrical components about its own, parallel axis.
 *
 * reference: its radius; offset: of its axis below the tube's; theta: angles about it.
 * out: even, odd; component; point; order; wall component. */
EXPORT void circle_waves(double k, double radius, double reference, double offset, const double *theta, double *out,
                         int64_t n, int64_t orders) {
    const int64_t size = 3 * orders;
    WallFlows flows[orders];
    const Waves waves = {k, k * radius, 0, orders, flows};
    double places[n][3], extensions[LANES][9 * orders], rows[POINT_ROWS][size], wave[3][size];
    fill_wall_flows(waves.wall, orders, flows);
    for (int64_t i = 0; i < n; i++) {
        places[i][0] = 0.0;
        places[i][1] = reference * cos(theta[i]) - offset;
        places[i][2] = reference * sin(theta[i]);
    }
    for (int64_t at = 0; at < n; at += LANES) {
        const Points points = points_at(&places[0][0], at, n);
        fill_extensions(waves, points.rho, extensions);
        for (int l = 0; l < points.some; l++) {
            const Angle turn = sum_of(points.theta[l], angle_of(-theta[at + l]));
            fill_point(waves, extensions[l], points.theta[l], rows);
            for (int odd = 0; odd < 2; odd++) {
                fill_wave(size, rows, odd, turn, wave);
                for (int c = 0; c < 3; c++) {
                    memcpy(out + ((3 * odd + c) * n + at + l) * size, wave[c], sizeof wave[c]);
                }
            }
        }
    }
}

enum { PARTS = 12 }; /* component; even, odd; real, imaginary part */

/* Fill the velocities of waves along three axes at each of a few points, (lanes, PARTS, orders, wall component).
 *
 * axes: at each point, by rows (x, y, z). */
static void fill_velocities(Waves waves, const Points *points, double axes[3][3][LANES],
                            double (*out)[PARTS][3 * (waves.end - waves.first)]) {
    const int64_t size = 3 * (waves.end - waves.first);
    double cos_p[LANES], sin_p[LANES], real[LANES], imaginary[LANES], radial[3][LANES], around[3][LANES];
    double values[PARTS][LANES];
    double extensions[LANES][3 * size];
    fill_extensions(waves, points->rho, extensions);
    for (int l = 0; l < LANES; l++) {
        const Angle theta = points->theta[l], along = angle_of(waves.k * points->x[l]);
        Angle turned = {1.0, 0.0};
        if (waves.first) turned = angle_of((double)waves.first * atan2(theta.sin, theta.cos));
        cos_p[l] = turned.cos, sin_p[l] = turned.sin;
        real[l] = along.cos, imaginary[l] = along.sin;
        for (int c = 0; c < 3; c++) {
            radial[c][l] = axes[c][1][l] * theta.cos + axes[c][2][l] * theta.sin;
            around[c][l] = axes[c][2][l] * theta.cos - axes[c][1][l] * theta.sin;
        }
    }
    for (int64_t e = 0; e < size; e++) {
        const int64_t at = 9 * (e / 3) + e % 3;
        double x[LANES], rho[LANES], v[LANES];
        for (int l = 0; l < LANES; l++) {
            x[l] = extensions[l][at];
            rho[l] = extensions[l][at + 3];
            v[l] = extensions[l][at + 6];
        }
        for (int odd = 0; odd < 2; odd++) { /* X and u_rho go as cos(p theta) or -sin(p theta), u_x comes times i */
            const double *like = odd ? sin_p : cos_p, *other = odd ? cos_p : sin_p, sign = odd ? -1.0 : 1.0;
            for (int c = 0; c < 3; c++) {
                double *re = values[4 * c + 2 * odd], *im = values[4 * c + 2 * odd + 1];
                EACH_LANE {
                    const double along = axes[c][0][l] * x[l] * (sign * like[l]);
                    const double across = radial[c][l] * rho[l] * (sign * like[l]) - around[c][l] * v[l] * other[l];
                    re[l] = across * real[l] - along * imaginary[l];
                    im[l] = across * imaginary[l] + along * real[l];
                }
            }
        }
        for (int l = 0; l < LANES; l++) {
            for (int i = 0; i < PARTS; i++) out[l][i][e] = values[i][l];
        }
        if (e % 3 == 2) {
            EACH_LANE {
                const double next = cos_p[l] * points->theta[l].cos - sin_p[l] * points->theta[l].sin;
                sin_p[l] = sin_p[l] * points->theta[l].cos + cos_p[l] * points->theta[l].sin;
                cos_p[l] = next;
            }
        }
    }
}

/* Velocities (x, y, z) of waves at points.
 *
 * out: point; component; real, imaginary part; even, odd; order from the first one; wall component. */
EXPORT void point_waves(double k, double radius, const double *places, int64_t first, double *out, int64_t n,
                        int64_t orders) {
    const int64_t size = 3 * orders;
    WallFlows flows[first + orders];
    const Waves waves = {k, k * radius, first, first + orders, flows};
    double found[LANES][PARTS][size], axes[3][3][LANES] = {{{0.0}}};
    for (int c = 0; c < 3; c++) EACH_LANE axes[c][c][l] = 1.0;
    fill_wall_flows(waves.wall, waves.end, flows);
    for (int64_t at = 0; at < n; at += LANES) {
        const Points points = points_at(places, at, n);
        fill_velocities(waves, &points, axes, found);
        for (int l = 0; l < points.some; l++) {
            for (int c = 0; c < 3; c++) {
                for (int part = 0; part < 4; part++, out += size) {
                    memcpy(out, found[l][4 * c + 2 * (part % 2) + part / 2], (size_t)size * sizeof *out);
                }
            }
        }
    }
}

/* Unit vectors along x, rho and theta of a tilted axis, in the tube's; by rows. */
static void fill_axes(const double *rotation, Angle theta, int lane, double axes[3][3][LANES]) {
    for (int i = 0; i < 3; i++) {
        const double x = rotation[3 * i], y = rotation[3 * i + 1], z = rotation[3 * i + 2];
        axes[0][i][lane] = x;
        axes[1][i][lane] = y * theta.cos + z * theta.sin;
        axes[2][i][lane] = z * theta.cos - y * theta.sin;
    }
}

/* To one of both arrays, the other one is NULL. */
static void fill_rings(double k, double radius, const double *places, const double *around, const double *rotation,
                       int64_t first, double *out, float *single, int64_t angles, int64_t n, int64_t orders) {
    const int64_t size = 3 * orders;
    WallFlows flows[first + orders];
    const Waves waves = {k, k * radius, first, first + orders, flows};
    double found[LANES][PARTS][size], axes[3][3][LANES];
    fill_wall_flows(waves.wall, waves.end, flows);
    for (int64_t at = 0; at < angles * n; at += LANES) {
        const Points points = points_at(places, at, angles * n);
        for (int l = 0; l < LANES; l++) {
            fill_axes(rotation, angle_of(around[(at + (l < points.some ? l : 0)) / n]), l, axes);
        }
        fill_velocities(waves, &points, axes, found);
        for (int l = 0; l < points.some; l++) {
            for (int block = 0; block < 6; block++) {
                const int64_t place = (block * angles * n + at + l) * 2 * size;
                const double *values = found[l][2 * block];
                if (out) memcpy(out + place, values, (size_t)(2 * size) * sizeof *values);
                for (int64_t e = 0; single && e < 2 * size; e++) single[place + e] = (float)values[e];
            }
        }
    }
}

/* Velocities (x, rho, theta) of waves on rings about a tilted axis, in cylindrical components about it.
 *
 * places: on the rings, about the tube's axis, (angles, n, 3); theta: angles about the rings' axis; rotation: from the
 * rings' axes to the tube's.
 * out: component; even, odd; angle; ring; real, imaginary part; order from the first one; wall component. */
EXPORT void ring_waves(double k, double radius, const double *places, const double *theta, const double *rotation,
                       int64_t first, double *out, int64_t angles, int64_t n, int64_t orders) {
    fill_rings(k, radius, places, theta, rotation, first, out, NULL, angles, n, orders);
}

/* The same in single precision. */
EXPORT void single_ring_waves(double k, double radius, const double *places, const double *theta,
                              const double *rotation, int64_t first, float *out, int64_t angles, int64_t n,
                              int64_t orders) {
    fill_rings(k, radius, places, theta, rotation, first, NULL, out, angles, n, orders);
}

/* Subtract a block from rows and columns of a square matrix, times a number for each column of the matrix.
 *
 * Both are in column-major order: columns (m, n) and (size, size). */
EXPORT void subtract_block(const double *block, const int64_t *columns, const int64_t *rows, const double *scale,
                           double *matrix, int64_t m, int64_t n, int64_t size) {
    for (int64_t j = 0; j < m; j++, block += n) {
        double *restrict column = matrix + columns[j] * size;
        for (int64_t i = 0; i < n; i++) column[rows[i]] -= scale[columns[j]] * block[i];
    }
}
