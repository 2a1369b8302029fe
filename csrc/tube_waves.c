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

/* A few points at which the waves are taken order by order: p, k rho, I_p(k rho)/I_p(k R), ratios of Bessel functions. */
typedef struct {
    const Waves *waves;
    int64_t p;
    double z[LANES], size[LANES], (*ratios)[LANES];
} Orders;

static void step_order(Orders *at) {
    const double wall = at->waves->flows[at->p].ratio;
    EACH_LANE at->size[l] *= at->ratios[at->p][l] / wall;
    at->p++;
}

/* Begin with the first order; ratios: memory, (end + 2, LANES). */
static Orders begin_orders(const Waves *waves, const double rho[LANES], double (*ratios)[LANES]) {
    Orders at = {.waves = waves, .ratios = ratios};
    EACH_LANE at.z[l] = larger(waves->k * rho[l], 1e-12 * waves->wall);
    fill_bessel_ratios(at.z, waves->end + 2, ratios, at.size);
    EACH_LANE at.size[l] *= exp(at.z[l] - waves->wall) / waves->flows[0].scaled;
    while (at.p < waves->first) step_order(&at);
    return at;
}

/* Velocities (X, u_rho, v) for unit velocities on the wall, (3, 3), of this order, and on to the next. */
static void next_extension(Orders *at, double u[9][LANES]) {
    const double *w = at->waves->flows[at->p].inverse;
    double v[9][LANES];
    fill_flows(at->p, at->z, at->waves->wall, at->ratios, v);
    for (int i = 0; i < 9; i += 3) {
        for (int j = 0; j < 3; j++) {
            EACH_LANE u[i + j][l] = at->size[l] * (v[i][l] * w[j] + v[i + 1][l] * w[3 + j] + v[i + 2][l] * w[6 + j]);
        }
    }
    step_order(at);
}

/* Fill in the velocities (X, u_rho, v) at rho for unit velocities at the radius.
 *
 * k: wave number, above 0; radius: of the cylinder on which the waves are one; rho: where. */
EXPORT void wave_extensions(double k, double radius, const double *rho /* (n) */, double *out /* (n, orders, 3, 3) */,
                            int64_t n, int64_t orders) {
    WallFlows flows[orders];
    const Waves waves = {k, k * radius, 0, orders, flows};
    double lanes[LANES], ratios[orders + 2][LANES], u[9][LANES];
    fill_wall_flows(waves.wall, orders, flows);
    for (int64_t first = 0; first < n; first += LANES) {
        const int some = (int)(n - first < LANES ? n - first : LANES);
        EACH_LANE lanes[l] = rho[first + (l < some ? l : some - 1)];
        Orders at = begin_orders(&waves, lanes, ratios);
        while (at.p < orders) {
            double *here = out + (first * orders + at.p) * 9;
            next_extension(&at, u);
            for (int l = 0; l < some; l++)
                for (int e = 0; e < 9; e++) here[l * orders * 9 + e] = u[e][l];
        }
    }
}

/* I_i K_j for |i - j| at most 1, from w[n] = I_n K_n and the ratios of both; orders may be negative. */
static double product(int64_t i, int64_t j, const double *w, double (*r)[LANES], const double *q) {
    const int64_t a = i < 0 ? -i : i, b = j < 0 ? -j : j;
    if (a == b) return w[a];
    return a > b ? r[b][0] * w[b] : q[a] * w[a];
}

/* Fill in the single layer S on a cylinder in unbounded fluid, in units of 4 pi R/(8 pi mu).
 *
 * z: k times the radius R; first: K_1(z)/K_0(z); layers: velocities (X, u_rho, v) from densities (F, f_rho, g),
 * symmetric. */
EXPORT void wall_layers(double z, double first, double *layers /* (orders, 3, 3) */, int64_t orders) {
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

typedef struct {
    double cos, sin;
} Angle;

static Angle angle_of(double radians) { return (Angle){cos(radians), sin(radians)}; }

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

enum { PARTS = 12 }; /* component; even, odd; real, imaginary part */

/* Waves along three axes at a few points, order by order: exp(i p theta), and exp(i k x) times the axes along x (times
 * i), rho and theta, real and imaginary. */
typedef struct {
    Orders orders;
    const Points *points;
    Angle turned[LANES];
    double along[3][2][LANES], radial[3][2][LANES], around[3][2][LANES];
} Velocities;

/* axes: at each point, by rows (x, y, z); ratios: memory, (end + 2, LANES). */
static Velocities begin_velocities(const Waves *waves, const Points *points, double axes[3][3][LANES],
                                   double (*ratios)[LANES]) {
    Velocities found = {.orders = begin_orders(waves, points->rho, ratios), .points = points};
    for (int l = 0; l < LANES; l++) {
        const Angle theta = points->theta[l], phase = angle_of(waves->k * points->x[l]);
        found.turned[l]
            = waves->first ? angle_of((double)waves->first * atan2(theta.sin, theta.cos)) : (Angle){1.0, 0.0};
        for (int c = 0; c < 3; c++) {
            const double radial = axes[c][1][l] * theta.cos + axes[c][2][l] * theta.sin;
            const double around = axes[c][2][l] * theta.cos - axes[c][1][l] * theta.sin;
            found.along[c][0][l] = -axes[c][0][l] * phase.sin;
            found.along[c][1][l] = axes[c][0][l] * phase.cos;
            found.radial[c][0][l] = radial * phase.cos;
            found.radial[c][1][l] = radial * phase.sin;
            found.around[c][0][l] = around * phase.cos;
            found.around[c][1][l] = around * phase.sin;
        }
    }
    return found;
}

/* Velocities of this order, by parts and wall components, and on to the next.
 *
 * X and u_rho go as cos(p theta) or -sin(p theta), v as the other; u_x comes times i. */
static void next_velocities(Velocities *at, double out[PARTS][3][LANES]) {
    double u[9][LANES], like[2][LANES], other[2][LANES];
    next_extension(&at->orders, u);
    for (int l = 0; l < LANES; l++) {
        like[0][l] = other[1][l] = at->turned[l].cos;
        other[0][l] = at->turned[l].sin;
        like[1][l] = -at->turned[l].sin;
    }
    for (int odd = 0; odd < 2; odd++) {
        for (int w = 0; w < 3; w++) {
            double x[LANES], rho[LANES], theta[LANES];
            EACH_LANE {
                x[l] = u[w][l] * like[odd][l];
                rho[l] = u[3 + w][l] * like[odd][l];
                theta[l] = u[6 + w][l] * other[odd][l];
            }
            for (int c = 0; c < 3; c++) {
                for (int part = 0; part < 2; part++) {
                    const double *along = at->along[c][part], *radial = at->radial[c][part];
                    const double *around = at->around[c][part];
                    double *here = out[4 * c + 2 * odd + part][w];
                    EACH_LANE here[l] = radial[l] * rho[l] - around[l] * theta[l] + along[l] * x[l];
                }
            }
        }
    }
    for (int l = 0; l < LANES; l++) {
        const Angle here = at->turned[l], theta = at->points->theta[l];
        at->turned[l].cos = here.cos * theta.cos - here.sin * theta.sin;
        at->turned[l].sin = here.sin * theta.cos + here.cos * theta.sin;
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

/* Velocities (x, rho, theta) of even and odd waves in cylindrical components about a second, parallel axis.
 *
 * k: wave number, above 0; radius: of the tube; reference: radius of the cylinder about the second axis; offset: of the
 * second axis below the tube's; theta: angles about the second axis; out: to be filled: even, odd; component; point;
 * order; wall component. u_x comes times i. */
EXPORT void circle_waves(double k, double radius, double reference, double offset, const double *theta /* (n) */,
                         double *out /* (2, 3, n, orders, 3) */, int64_t n, int64_t orders) {
    static const double level[9] = {1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0};
    const int64_t size = 3 * orders;
    WallFlows flows[orders];
    const Waves waves = {k, k * radius, 0, orders, flows};
    double places[LANES][3] = {{0.0}}, ratios[orders + 2][LANES], axes[3][3][LANES], found[PARTS][3][LANES];
    fill_wall_flows(waves.wall, orders, flows);
    for (int64_t first = 0; first < n; first += LANES) {
        const int some = (int)(n - first < LANES ? n - first : LANES);
        for (int l = 0; l < LANES; l++) {
            const Angle about = angle_of(theta[first + (l < some ? l : some - 1)]);
            places[l][1] = reference * about.cos - offset;
            places[l][2] = reference * about.sin;
            fill_axes(level, about, l, axes);
        }
        const Points points = points_at(&places[0][0], 0, LANES);
        Velocities at = begin_velocities(&waves, &points, axes, ratios);
        for (int64_t p = 0; p < orders; p++) {
            next_velocities(&at, found);
            for (int l = 0; l < some; l++)
                for (int odd = 0; odd < 2; odd++)
                    for (int c = 0; c < 3; c++) { /* u_x comes times i */
                        double *here = out + ((3 * odd + c) * n + first + l) * size + 3 * p;
                        for (int w = 0; w < 3; w++) here[w] = found[4 * c + 2 * odd + (c == 0)][w][l];
                    }
        }
    }
}

/* To one of both arrays, the other one is NULL. */
static void fill_points(double k, double radius, const double *places, int64_t first, double *out, float *single,
                        int64_t n, int64_t orders) {
    WallFlows flows[first + orders];
    const Waves waves = {k, k * radius, first, first + orders, flows};
    double ratios[waves.end + 2][LANES], axes[3][3][LANES] = {{{0.0}}}, found[PARTS][3][LANES];
    for (int c = 0; c < 3; c++) EACH_LANE axes[c][c][l] = 1.0;
    fill_wall_flows(waves.wall, waves.end, flows);
    for (int64_t at = 0; at < n; at += LANES) {
        const Points points = points_at(places, at, n);
        Velocities velocities = begin_velocities(&waves, &points, axes, ratios);
        for (int64_t p = 0; p < orders; p++) {
            next_velocities(&velocities, found);
            for (int part = 0; part < PARTS; part++)
                for (int w = 0; w < 3; w++) {
                    const int64_t row = 3 * (4 * p + part % 4) + w, place = 3 * (row * n + at) + part / 4;
                    for (int l = 0; out && l < points.some; l++) out[place + 3 * l] = found[part][w][l];
                    for (int l = 0; single && l < points.some; l++) single[place + 3 * l] = (float)found[part][w][l];
                }
        }
    }
}

/* Velocities (x, y, z) of waves at points.
 *
 * k: wave number, above 0; radius: of the tube; places: points about the tube's axis; first: the first order p; out: to
 * be filled: order; even, odd; real, imaginary part; wall component; point; component. */
EXPORT void point_waves(double k, double radius, const double *places /* (n, 3) */, int64_t first,
                        double *out /* (orders, 2, 2, 3, n, 3) */, int64_t n, int64_t orders) {
    fill_points(k, radius, places, first, out, NULL, n, orders);
}

/* See `point_waves`; in single precision. */
EXPORT void single_point_waves(double k, double radius, const double *places /* (n, 3) */, int64_t first,
                               float *out /* (orders, 2, 2, 3, n, 3) */, int64_t n, int64_t orders) {
    fill_points(k, radius, places, first, NULL, out, n, orders);
}

/* To one of both arrays, the other one is NULL. */
static void fill_rings(double k, double radius, const double *places, const double *around, const double *rotation,
                       int64_t first, double *out, float *single, int64_t n, int64_t angles, int64_t orders) {
    const int64_t count = n * angles, ring = 6 * orders * angles;
    WallFlows flows[first + orders];
    const Waves waves = {k, k * radius, first, first + orders, flows};
    double ratios[waves.end + 2][LANES], axes[3][3][LANES], found[PARTS][3][LANES];
    fill_wall_flows(waves.wall, waves.end, flows);
    for (int64_t at = 0; at < count; at += LANES) {
        const Points points = points_at(places, at, count);
        const bool alike = at / angles == (at + LANES - 1) / angles && points.some == LANES; /* all on one ring */
        int64_t begin[LANES];
        for (int l = 0; l < LANES; l++) {
            const int64_t point = at + (l < points.some ? l : 0);
            fill_axes(rotation, angle_of(around[point % angles]), l, axes);
            begin[l] = point / angles * ring + point % angles;
        }
        Velocities velocities = begin_velocities(&waves, &points, axes, ratios);
        for (int64_t p = 0; p < orders; p++) {
            next_velocities(&velocities, found);
            for (int part = 0; part < PARTS; part++) {
                const int64_t family = (part / 2 % 2 * 3 + part / 4) * n * ring; /* even, odd; component */
                for (int w = 0; w < 3; w++) {
                    const int64_t row = family + (6 * p + 3 * (part % 2) + w) * angles;
                    const double *from = found[part][w];
                    if (alike && single)
                        EACH_LANE single[row + begin[0] + l] = (float)from[l];
                    else if (single)
                        for (int l = 0; l < points.some; l++) single[row + begin[l]] = (float)from[l];
                    else
                        for (int l = 0; l < points.some; l++) out[row + begin[l]] = from[l];
                }
            }
        }
    }
}

/* Velocities (x, rho, theta) of waves on rings about a tilted axis, in cylindrical components about it.
 *
 * k: wave number, above 0; radius: of the tube; places: points on the rings, about the tube's axis; theta: angles about
 * the rings' axis; rotation: from the rings' axes to the tube's; first: the first order p; out: to be filled: even,
 * odd; component; ring; order; real, imaginary part; wall component; angle. */
EXPORT void ring_waves(double k, double radius, const double *places /* (n, angles, 3) */,
                       const double *theta /* (angles) */, const double *rotation /* (3, 3) */, int64_t first,
                       double *out /* (2, 3, n, orders, 2, 3, angles) */, int64_t n, int64_t angles, int64_t orders) {
    fill_rings(k, radius, places, theta, rotation, first, out, NULL, n, angles, orders);
}

/* See `ring_waves`; in single precision. */
EXPORT void single_ring_waves(double k, double radius, const double *places /* (n, angles, 3) */,
                              const double *theta /* (angles) */, const double *rotation /* (3, 3) */, int64_t first,
                              float *out /* (2, 3, n, orders, 2, 3, angles) */, int64_t n, int64_t angles,
                              int64_t orders) {
    fill_rings(k, radius, places, theta, rotation, first, NULL, out, n, angles, orders);
}

/* Subtract a block from rows and columns of a square matrix, times a number for each column of the matrix.
 *
 * block: its columns, one after the other; columns: of the matrix; rows: of the matrix; scale: number of each column of
 * the matrix; matrix: its columns, one after the other. */
EXPORT void subtract_block(const double *block /* (m, n) */, const int64_t *columns /* (m) */,
                           const int64_t *rows /* (n) */, const double *scale /* (size) */,
                           double *matrix /* (size, size) */, int64_t m, int64_t n, int64_t size) {
    for (int64_t j = 0; j < m; j++, block += n) {
        double *restrict column = matrix + columns[j] * size;
        for (int64_t i = 0; i < n; i++) column[rows[i]] -= scale[columns[j]] * block[i];
    }
}
