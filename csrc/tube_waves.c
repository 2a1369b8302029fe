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

/* By backward recurrence (DLMF 10.29, 10.74(v)), which forgets where it starts in orders above z only. */
void fill_bessel_ratios(const double z[LANES], int64_t count, double (*r)[LANES]) {
    double ratio[LANES], largest = 0.0;
    for (int l = 0; l < LANES; l++) largest = larger(largest, z[l]);
    const int64_t steep = (int64_t)largest, last = (count > steep ? count : steep) + 40;
    const double from = (double)last + 1.0;
    EACH_LANE ratio[l] = z[l] / (from + sqrt(from * from + z[l] * z[l]));
    for (int64_t n = last - 1; n >= 0; n--) {
        const double twice = 2.0 * ((double)n + 1.0);
        EACH_LANE ratio[l] = z[l] / (twice + z[l] * ratio[l]);
        if (n < count) EACH_LANE r[n][l] = ratio[l];
    }
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
    double z[LANES], r[orders + 2][LANES], v[9][LANES], matrix[9];
    EACH_LANE z[l] = wall;
    fill_bessel_ratios(z, orders + 2, r);
    for (int64_t p = 0; p < orders; p++) {
        fill_flows(p, z, wall, r, v);
        for (int e = 0; e < 9; e++) matrix[e] = v[e][0];
        invert(matrix, flows[p].inverse);
        flows[p].ratio = r[p][0];
    }
}

/* Velocities (X, u_rho, v) at rho for unit velocities on the cylinder of that radius, (n, orders, 3, 3).
 *
 * scale: I_0(k rho)/I_0(k radius); first: the first order p. */
EXPORT void wave_extensions(double k, double radius, const double *rho, const double *scale, int64_t first, double *out,
                            int64_t n, int64_t orders) {
    const int64_t end = first + orders;
    const double wall = k * radius;
    WallFlows flows[end];
    double z[LANES], size[LANES], r[end + 2][LANES], v[9][LANES], u[9][LANES];
    fill_wall_flows(wall, end, flows);
    for (int64_t at = 0; at < n; at += LANES) {
        const int some = (int)(n - at < LANES ? n - at : LANES);
        EACH_LANE {
            const int64_t i = at + (l < some ? l : some - 1);
            z[l] = larger(k * rho[i], 1e-12 * wall);
            size[l] = scale[i];
        }
        fill_bessel_ratios(z, end + 2, r);
        for (int64_t p = 0; p < end; p++) {
            if (p >= first) {
                const double *w = flows[p].inverse;
                fill_flows(p, z, wall, r, v);
                for (int i = 0; i < 9; i += 3) {
                    for (int j = 0; j < 3; j++) {
                        EACH_LANE u[i + j][l]
                            = size[l] * (v[i][l] * w[j] + v[i + 1][l] * w[3 + j] + v[i + 2][l] * w[6 + j]);
                    }
                }
                for (int l = 0; l < some; l++) {
                    for (int e = 0; e < 9; e++) out[((at + l) * orders + p - first) * 9 + e] = u[e][l];
                }
            }
            EACH_LANE size[l] *= r[p][l] / flows[p].ratio;
        }
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
    double r[orders + 3][LANES], q[orders + 3], w[orders + 3], lanes[LANES];
    EACH_LANE lanes[l] = z;
    fill_bessel_ratios(lanes, orders + 3, r);
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

/* Fill the extensions X, u_rho, v and cos, sin of p theta, for orders from that one on of which p theta is `turned`. */
static void fill_point(const double *restrict extensions, Angle theta, Angle turned, int64_t orders,
                       double rows[restrict POINT_ROWS][3 * orders]) {
    for (int64_t p = 0; p < orders; p++) {
        for (int64_t w = 0; w < 3; w++) {
            for (int e = X; e <= V; e++) rows[e][3 * p + w] = extensions[9 * p + 3 * e + w];
            rows[COS][3 * p + w] = turned.cos;
            rows[SIN][3 * p + w] = turned.sin;
        }
        const double next = turned.cos * theta.cos - turned.sin * theta.sin;
        turned = (Angle){next, turned.sin * theta.cos + turned.cos * theta.sin};
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

/* Velocities (x, rho, theta) of waves in cylindrical components about a second, parallel axis.
 *
 * angle: polar angles of the points about the tube's axis; turn: those less the angles about the second axis;
 * out: even, odd; component; point; order; wall component. */
EXPORT void circle_waves(const double *extensions, const double *angle, const double *turn, double *out, int64_t n,
                         int64_t orders) {
    const int64_t size = 3 * orders;
    double rows[POINT_ROWS][size], wave[3][size];
    for (int64_t i = 0; i < n; i++) {
        const Angle theta = angle_of(angle[i]), about = angle_of(turn[i]);
        fill_point(extensions + 9 * orders * i, theta, (Angle){1.0, 0.0}, orders, rows);
        for (int odd = 0; odd < 2; odd++) {
            fill_wave(size, rows, odd, about, wave);
            for (int c = 0; c < 3; c++) memcpy(out + ((3 * odd + c) * n + i) * size, wave[c], sizeof wave[c]);
        }
    }
}

/* Velocities (x, y, z) of waves at points; phase: k x there.
 *
 * out: point; component; real, imaginary part; even, odd; order from the first one; wall component. */
EXPORT void station_waves(const double *extensions, const double *angle, const double *phase, int64_t first,
                          double *out, int64_t n, int64_t orders) {
    const int64_t size = 3 * orders;
    double rows[POINT_ROWS][size], wave[3][size];
    for (int64_t i = 0; i < n; i++) {
        const Angle theta = angle_of(angle[i]), along = angle_of(phase[i]);
        fill_point(extensions + 9 * orders * i, theta, angle_of((double)first * angle[i]), orders, rows);
        for (int odd = 0; odd < 2; odd++) {
            fill_wave(size, rows, odd, theta, wave);
            for (int c = 0; c < 3; c++) {
                double *restrict parts = out + ((3 * i + c) * 4 + odd) * size;
                const double a = c ? along.cos : -along.sin, b = c ? along.sin : along.cos;
                for (int64_t e = 0; e < size; e++) {
                    parts[e] = wave[c][e] * a;
                    parts[2 * size + e] = wave[c][e] * b;
                }
            }
        }
    }
}

/* Unit vectors along x, rho and theta of a tilted axis, in the tube's; by rows. */
static void fill_axes(const double *rotation, Angle theta, double axes[3][3]) {
    for (int i = 0; i < 3; i++) {
        const double x = rotation[3 * i], y = rotation[3 * i + 1], z = rotation[3 * i + 2];
        axes[0][i] = x;
        axes[1][i] = y * theta.cos + z * theta.sin;
        axes[2][i] = z * theta.cos - y * theta.sin;
    }
}

/* One component of a wave, times its real and imaginary phase: (2, size). */
static void fill_parts(int64_t size, double wave[3][size], const double axis[3], Angle phase,
                       double parts[restrict 2][size]) {
    for (int64_t e = 0; e < size; e++) {
        const double along = axis[0] * wave[0][e], across = axis[1] * wave[1][e] + axis[2] * wave[2][e];
        parts[0][e] = across * phase.cos - along * phase.sin;
        parts[1][e] = across * phase.sin + along * phase.cos;
    }
}

/* To one of both arrays, the other one is NULL. */
static void fill_tilted(const double *extensions, const double *angle, const double *phase, const double *around,
                        const double *rotation, int64_t first, double *out, float *single, int64_t angles, int64_t n,
                        int64_t orders) {
    const int64_t size = 3 * orders;
    double rows[POINT_ROWS][size], wave[3][size], parts[2][size], axes[3][3];
    const double *values = &parts[0][0];
    for (int64_t i = 0; i < angles * n; i++) {
        const Angle theta = angle_of(angle[i]), along = angle_of(phase[i]);
        if (i % n == 0) fill_axes(rotation, angle_of(around[i / n]), axes);
        fill_point(extensions + 9 * orders * i, theta, angle_of((double)first * angle[i]), orders, rows);
        for (int odd = 0; odd < 2; odd++) {
            fill_wave(size, rows, odd, theta, wave);
            for (int c = 0; c < 3; c++) {
                const int64_t place = ((2 * c + odd) * angles * n + i) * 2 * size;
                fill_parts(size, wave, axes[c], along, parts);
                if (out) memcpy(out + place, parts, sizeof parts);
                for (int64_t e = 0; single && e < 2 * size; e++) single[place + e] = (float)values[e];
            }
        }
    }
}

/* Velocities (x, rho, theta) of waves on rings about a tilted axis, in cylindrical components about it.
 *
 * extensions: (angles, n, orders, 3, 3); angle, phase: polar angles about the tube's axis and k x, (angles, n);
 * theta: angles about the rings' axis; rotation: from the rings' axes to the tube's.
 * out: component; even, odd; angle; ring; real, imaginary part; order from the first one; wall component. */
EXPORT void tilted_waves(const double *extensions, const double *angle, const double *phase, const double *theta,
                         const double *rotation, int64_t first, double *out, int64_t angles, int64_t n,
                         int64_t orders) {
    fill_tilted(extensions, angle, phase, theta, rotation, first, out, NULL, angles, n, orders);
}

/* The same in single precision. */
EXPORT void single_tilted_waves(const double *extensions, const double *angle, const double *phase, const double *theta,
                                const double *rotation, int64_t first, float *out, int64_t angles, int64_t n,
                                int64_t orders) {
    fill_tilted(extensions, angle, phase, theta, rotation, first, NULL, out, angles, n, orders);
}
