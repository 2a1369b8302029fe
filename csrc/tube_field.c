/* Velocity and pressure in a tube from many forces at once: what its wall reflects, wave by wave.
 *
 * The waves are those of tube_waves.c. Here they stay in amplitudes of their three flows, which are summed over all
 * forces once and evaluated at any number of points; at a point, waves enter as far as their damping between forces,
 * wall and point lets them matter.
 */
#include "tube_waves.h"

static const double TAPER = 0.4; /* part of the waves over which they are faded out */

/* Number of orders up to which waves are no steeper than `steepest`; none if k is. */
static int64_t count_orders(double k, double radius, double steepest, int64_t orders) {
    if (k > steepest) return 0;
    const double around = radius * sqrt(larger(steepest * steepest - k * k, 0.0)) + 3.0;
    return around < (double)orders ? (int64_t)around : orders;
}

/* Places at which waves of one k enter up to their own numbers of orders. */
typedef struct {
    double rho[LANES], cos[LANES], sin[LANES]; /* distance from the axis, m, and polar angle theta */
    int64_t counts[LANES];
} Places;

/* Waves of one k and order p at places. */
typedef struct {
    double k, wall, z[LANES];      /* k R and k rho */
    double scale[LANES];           /* I_p(k rho)/I_p(k R) */
    double cos[LANES], sin[LANES]; /* of p theta */
} Waves;

static Waves waves_at(const Places *at, double k, double radius) {
    Waves w = {.k = k, .wall = k * radius};
    EACH_LANE {
        w.z[l] = larger(k * at->rho[l], 1e-12 * w.wall);
        w.cos[l] = 1.0;
        w.sin[l] = 0.0;
    }
    return w;
}

/* Begin with order 0, and fill the ratios I_{p+1}/I_p; `top` is exp(-k R) I_0(k R). */
static void start_orders(Waves *w, double top, int64_t orders, double (*r)[LANES]) {
    fill_bessel_ratios(w->z, orders + 2, r, w->scale);
    EACH_LANE w->scale[l] *= exp(w->z[l] - w->wall) / top;
}

/* From order p to the next, with I_{p+1}/I_p there and at the wall. */
static void step_order(const Places *at, Waves *w, const double ratio[LANES], double ratio_at_wall) {
    EACH_LANE {
        const double turned = w->cos[l] * at->cos[l] - w->sin[l] * at->sin[l];
        w->sin[l] = w->sin[l] * at->cos[l] + w->cos[l] * at->sin[l];
        w->cos[l] = turned;
        w->scale[l] *= ratio[l] / ratio_at_wall;
    }
}

static int64_t largest_count(const Places *at) {
    int64_t largest = 0;
    for (int l = 0; l < LANES; l++) largest = at->counts[l] > largest ? at->counts[l] : largest;
    return largest;
}

/* Forces along the tube at one angle and distance from the axis: places, and even and odd part along x, rho, theta. */
typedef struct {
    const double *x, *forces;
    int64_t size;
} Column;

/* Sums of exp(i k x) times the forces of columns: parity and direction, for each of LANES columns. */
typedef struct {
    double real[6][LANES], imaginary[6][LANES];
} Sums;

static void sum_along(double k, const Column *column, Sums *sums, int lane) {
    double real[6] = {0.0}, imaginary[6] = {0.0};
    for (int64_t s = 0; s < column->size; s++) {
        const double c = cos(k * column->x[s]), sine = sin(k * column->x[s]);
        for (int d = 0; d < 6; d++) {
            real[d] += column->forces[6 * s + d] * c;
            imaginary[d] += column->forces[6 * s + d] * sine;
        }
    }
    for (int d = 0; d < 6; d++) {
        sums->real[d][lane] = real[d];
        sums->imaginary[d][lane] = imaginary[d];
    }
}

static double sum_of(const double lanes[LANES]) {
    double sum = 0.0;
    for (int l = 0; l < LANES; l++) sum += lanes[l];
    return sum;
}

/* Add what columns move to the amplitudes (2 parities, real and imaginary, most orders, 3) of waves of one k. */
static void add_columns(const Places *at, const Sums *sums, Waves w, const WallFlows *flows, int64_t most,
                        double *amplitudes) {
    const int64_t orders = largest_count(at);
    double r[orders + 2][LANES], v[9][LANES], real[LANES], imaginary[LANES];
    start_orders(&w, flows[0].scaled, orders, r);
    for (int64_t p = 0; p < orders; p++) {
        fill_flows(p, w.z, w.wall, r, v);
        for (int odd = 0; odd < 2; odd++) {
            const double *like = odd ? w.sin : w.cos, *other = odd ? w.cos : w.sin, sign = odd ? -1.0 : 1.0;
            const double (*re)[LANES] = sums->real + 3 * odd, (*im)[LANES] = sums->imaginary + 3 * odd;
            for (int f = 0; f < 3; f++) {
                EACH_LANE {
                    const double scale = p < at->counts[l] ? w.scale[l] : 0.0, as_cos = sign * scale * like[l];
                    const double along = v[f][l] * as_cos, out = v[3 + f][l] * as_cos;
                    const double around = -v[6 + f][l] * (scale * other[l]);
                    real[l] = out * re[1][l] + around * re[2][l] - along * im[0][l];
                    imaginary[l] = out * im[1][l] + around * im[2][l] + along * re[0][l];
                }
                amplitudes[((2 * odd) * most + p) * 3 + f] += sum_of(real);
                amplitudes[((2 * odd + 1) * most + p) * 3 + f] += sum_of(imaginary);
            }
        }
        step_order(at, &w, r[p], flows[p].ratio);
    }
}

/* out = a b', or a b, of 3x3 matrices. */
static void multiply(const double a[9], const double b[9], bool is_transposed, double out[9]) {
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            out[3 * i + j] = 0.0;
            for (int c = 0; c < 3; c++) out[3 * i + j] += a[3 * i + c] * b[is_transposed ? 3 * j + c : 3 * c + j];
        }
    }
}

/* Turn waves times forces into the amplitudes of what the wall reflects of them. */
static void reflect(double weight, const double *layers, const WallFlows *flows, int64_t orders, int64_t most,
                    double *amplitudes) {
    for (int64_t p = 0; p < orders; p++) {
        const double share = p ? -2.0 * weight : -weight;
        double half[9], pressed[9];
        multiply(layers + 9 * p, flows[p].inverse, true, half);
        multiply(flows[p].inverse, half, false, pressed);
        for (int part = 0; part < 4; part++) {
            double *wave = amplitudes + (part * most + p) * 3;
            const double x = wave[0], y = wave[1], z = wave[2];
            for (int i = 0; i < 3; i++) {
                wave[i] = share * (pressed[3 * i] * x + pressed[3 * i + 1] * y + pressed[3 * i + 2] * z);
            }
        }
    }
}

/* Add up the amplitudes of the flows of which each wave of the wall's reflection consists.
 *
 * Sources stand in columns along the tube. Of the forces the even part moves even waves, the odd part odd ones.
 *
 * wave_k: k of each wave; weights: of the nodes in k; counts: numbers of orders p; bessel: K_1/K_0 at k radius; radius:
 * of the tube; rho: distance of each column from the axis; angle: polar angle of each column; steepest: wave that
 * matters for each column; first: number of the first source of each column, and of all sources, (columns + 1,); x: of
 * the sources; forces: even and odd part, along x, rho and theta; steps: to be filled with I_{p+1}/I_p at the wall;
 * amplitudes: zeros, to be filled: even, odd; real, imaginary; order; flow.
 *
 * Threads share waves. */
EXPORT void wave_amplitudes(const double *wave_k /* (waves) */, const double *weights /* (waves) */,
                            const int64_t *counts /* (waves) */, const double *bessel /* (waves) */, double radius,
                            const double *rho /* (columns) */, const double *angle /* (columns) */,
                            const double *steepest /* (columns) */, const int64_t *first /* (edges) */,
                            const double *x /* (n) */, const double *forces /* (n, 2, 3) */,
                            double *steps /* (waves, most) */, double *amplitudes /* (waves, 2, 2, most, 3) */,
                            int64_t waves, int64_t columns, int64_t edges, int64_t n, int64_t most) {
    (void)edges, (void)n;
    for (int64_t i = 0; i < waves; i++, amplitudes += 12 * most, steps += most) {
        const double k = wave_k[i], wall = k * radius;
        WallFlows flows[counts[i]];
        double layers[9 * counts[i]];
        fill_wall_flows(wall, counts[i], flows);
        for (int64_t c = 0; c < columns;) {
            Places at = {.counts = {0}};
            Sums sums = {{{0.0}}, {{0.0}}};
            for (int lane = 0; lane < LANES && c < columns; c++) {
                if (k > steepest[c]) continue;
                const Column column = {x + first[c], forces + 6 * first[c], first[c + 1] - first[c]};
                sum_along(k, &column, &sums, lane);
                at.rho[lane] = rho[c];
                at.cos[lane] = cos(angle[c]);
                at.sin[lane] = sin(angle[c]);
                at.counts[lane++] = count_orders(k, radius, steepest[c], counts[i]);
            }
            add_columns(&at, &sums, waves_at(&at, k, radius), flows, most, amplitudes);
        }
        for (int64_t p = 0; p < counts[i]; p++) steps[p] = flows[p].ratio;
        wall_layers(wall, bessel[i], layers, counts[i]);
        reflect(weights[i], layers, flows, counts[i], most, amplitudes);
    }
}

/* 1 for flat waves, 0 beyond the steepest one, and smooth between: flows keep their derivatives. */
static double taper(double k, int64_t p, double radius, double steepest) {
    const double around = larger((double)p - 2.0, 0.0) / radius;
    const double left = clamped((1.0 - sqrt(k * k + around * around) / steepest) / TAPER, 0.0, 1.0);
    return left * left * left * (10.0 - 15.0 * left + 6.0 * left * left);
}

/* Points in the tube: exp(i k x) there, and the steepest waves that matter. */
typedef struct {
    Places at;
    double x[LANES], steepest[LANES], real[LANES], imaginary[LANES];
} FieldPoints;

/* Add cylindrical velocity and pressure of the waves of one k; see `add_waves`. */
static void add_orders(const FieldPoints *f, Waves w, double top, double radius, const double *steps, int64_t most,
                       const double *amplitudes, double total[4][LANES]) {
    const int64_t orders = largest_count(&f->at);
    double r[orders + 2][LANES], v[9][LANES], here[LANES];
    start_orders(&w, top, orders, r);
    for (int64_t p = 0; p < orders; p++) {
        /* the flows u = rho d(grad phi)/d rho + e_x d phi/dx carry a pressure, 2 mu k^2 phi */
        const double push[3] = {0.0, p ? -2.0 * w.k / w.wall : 0.0, p ? 2.0 * w.k : 2.0 * w.k / (w.wall * w.wall)};
        fill_flows(p, w.z, w.wall, r, v);
        EACH_LANE here[l] = p < f->at.counts[l] ? w.scale[l] * taper(w.k, p, radius, f->steepest[l]) : 0.0;
        for (int odd = 0; odd < 2; odd++) {
            const double *like = odd ? w.sin : w.cos, *other = odd ? w.cos : w.sin, sign = odd ? -1.0 : 1.0;
            for (int c = 0; c < 3; c++) {
                const double first = amplitudes[(2 * odd * most + p) * 3 + c];
                const double second = amplitudes[((2 * odd + 1) * most + p) * 3 + c];
                EACH_LANE {
                    const double across = f->real[l] * first + f->imaginary[l] * second;
                    const double along = f->real[l] * second - f->imaginary[l] * first;
                    const double as_cos = sign * here[l] * like[l], as_sin = -here[l] * other[l];
                    total[0][l] += as_cos * v[c][l] * along;
                    total[1][l] += as_cos * v[3 + c][l] * across;
                    total[2][l] += as_sin * v[6 + c][l] * across;
                    total[3][l] += as_cos * push[c] * across;
                }
            }
        }
        step_order(&f->at, &w, r[p], steps[p]);
    }
}

/* Add velocity (times 8 pi mu) and pressure (times 8 pi) of waves.
 *
 * points: (x, y, z) about the tube's axis, no farther from it than the radius; steepest: wave from which on nothing is
 * added at each point; they are faded out towards it; wave_k: k of each wave; counts: numbers of orders p; radius: of
 * the tube; steps: of `wave_amplitudes`; amplitudes: of `wave_amplitudes`; field: velocity (x, y, z) and pressure to
 * add to.
 *
 * Threads share n. */
EXPORT void add_waves(const double *points /* (n, 3) */, const double *steepest /* (n) */,
                      const double *wave_k /* (waves) */, const int64_t *counts /* (waves) */, double radius,
                      const double *steps /* (waves, most) */, const double *amplitudes /* (waves, 2, 2, most, 3) */,
                      double *field /* (n, 4) */, int64_t n, int64_t waves, int64_t most) {
    double tops[waves];
    for (int64_t i = 0; i < waves; i++) {
        WallFlows flows[1];
        fill_wall_flows(wave_k[i] * radius, 1, flows);
        tops[i] = flows[0].scaled;
    }
    for (int64_t first = 0; first < n; first += LANES) {
        const int some = (int)(n - first < LANES ? n - first : LANES);
        FieldPoints f;
        double total[4][LANES] = {{0.0}};
        for (int l = 0; l < LANES; l++) {
            const int64_t j = first + (l < some ? l : some - 1);
            const double *at = points + 3 * j, angle = atan2(at[2], at[1]);
            f.x[l] = at[0];
            f.steepest[l] = steepest[j];
            f.at.rho[l] = hypot(at[1], at[2]);
            f.at.cos[l] = cos(angle);
            f.at.sin[l] = sin(angle);
        }
        for (int64_t i = 0; i < waves; i++) {
            const double k = wave_k[i];
            for (int l = 0; l < LANES; l++) {
                f.at.counts[l] = count_orders(k, radius, f.steepest[l], counts[i]);
                f.real[l] = cos(k * f.x[l]);
                f.imaginary[l] = sin(k * f.x[l]);
            }
            if (largest_count(&f.at) == 0) continue;
            add_orders(&f, waves_at(&f.at, k, radius), tops[i], radius, steps + i * most, most,
                       amplitudes + i * 12 * most, total);
        }
        for (int l = 0; l < some; l++) {
            double *out = field + 4 * (first + l);
            out[0] += total[0][l];
            out[1] += total[1][l] * f.at.cos[l] - total[2][l] * f.at.sin[l];
            out[2] += total[1][l] * f.at.sin[l] + total[2][l] * f.at.cos[l];
            out[3] += total[3][l];
        }
    }
}
