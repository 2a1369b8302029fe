/* Brightness profiles across edges, displacements of edges, robust pose updates, and scores of a shape's places. */
#include "core.h"
#include <string.h>

/* Weights of four samples about a place, by cubic convolution (R. G. Keys, 1981); t is its distance from the second. */
static void cubic_weights(double t, double weights[4]) {
    weights[0] = ((-0.5 * t + 1.0) * t - 0.5) * t;
    weights[1] = (1.5 * t - 2.5) * t * t + 1.0;
    weights[2] = ((-1.5 * t + 2.0) * t + 0.5) * t;
    weights[3] = (0.5 * t - 0.5) * t * t;
}

/* A place between the pixels of a picture: the first of 4 x 4 pixels about it, and their weights. */
typedef struct {
    const float *first;
    double along[4], down[4];
} Place;

static Place place_at(const float *picture, int64_t width, int64_t channels, double u, double v) {
    const int64_t column = (int64_t)u, row = (int64_t)v;
    Place place = {.first = picture + ((row - 1) * width + column - 1) * channels};
    cubic_weights(u - (double)column, place.along);
    cubic_weights(v - (double)row, place.down);
    return place;
}

/* Values of all channels, `apart` from each other; `below` is the step to the pixel below. */
static inline void values_at(const Place *p, int64_t channels, int64_t below, double *values, int64_t apart) {
    for (int64_t c = 0; c < channels; c++) {
        double column[4];
        for (int k = 0; k < 4; k++) {
            const float *line = p->first + k * channels + c;
            const double upper = p->down[0] * (double)line[0] + p->down[1] * (double)line[below];
            column[k] = upper + p->down[2] * (double)line[2 * below] + p->down[3] * (double)line[3 * below];
        }
        const double left = p->along[0] * column[0] + p->along[1] * column[1];
        values[c * apart] = left + p->along[2] * column[2] + p->along[3] * column[3];
    }
}

/* Brightness profiles along the normals of edge points, by cubic convolution; NaN outside of the region.
 *
 * picture: brightness, or colours, of a region of the picture; origin: pixel (u, v) of the region's upper left corner;
 * pixels: the edge points; normals: unit directions; offsets: distances along them, pixels; profiles: the profiles. */
EXPORT void profiles_across(const float *picture /* (height, width, channels) */, const double origin[2],
                            const double (*pixels)[2] /* (count, 2) */, const double (*normals)[2] /* (count, 2) */,
                            const double *offsets /* (length) */, double *profiles /* (channels, count, length) */,
                            int64_t height, int64_t width, int64_t channels, int64_t count, int64_t length) {
    const double last_u = (double)width - 2.0, last_v = (double)height - 2.0;
    for (int64_t i = 0; i < count; i++) {
        for (int64_t k = 0; k < length; k++) {
            double *profile = profiles + i * length + k;
            const double u = pixels[i][0] + offsets[k] * normals[i][0] - origin[0];
            const double v = pixels[i][1] + offsets[k] * normals[i][1] - origin[1];
            if (!(1.0 <= u && u < last_u && 1.0 <= v && v < last_v)) {
                for (int64_t c = 0; c < channels; c++) profile[c * count * length] = NAN;
                continue;
            }
            const Place place = place_at(picture, width, channels, u, v);
            if (channels == 1) /* brightness: pixels side by side become vector instructions */
                values_at(&place, 1, width, profile, 0);
            else
                values_at(&place, channels, channels * width, profile, count * length);
        }
    }
}

/* Mean of a series and its slope per sample. */
typedef struct {
    double mean, slope;
} Trend;

static Trend trend_of(const double *values, int64_t length) {
    const double size = (double)length, half = 0.5 * (size - 1.0), spread = size * (size * size - 1.0) / 12.0;
    double sum = 0.0, moment = 0.0;
#pragma omp simd reduction(+ : sum, moment)
    for (int64_t k = 0; k < length; k++) {
        sum += values[k];
        moment += values[k] * ((double)k - half);
    }
    return (Trend){sum / size, moment / spread};
}

/* Displacement d of each edge along its normal: q(s) = b + c s + a (p(s) - d p'(s)) by least squares.
 *
 * Offset b, slope c and contrast a of either sign are free at every point, so that lamp, shadows and the colour of a
 * stripe do not bias the displacement.
 *
 * profiles: brightness q; templates: template p of the undisplaced edge, without mean and slope; slopes: derivative p'
 * of the template, per sample; shifts: d, samples; NaN where the fit is singular; strengths: a; residuals: root mean
 * square residual. */
EXPORT void shifts_of_profiles(const double *profiles /* (count, length) */,
                               const double *templates /* (count, length) */,
                               const double *slopes /* (count, length) */, double *shifts /* (count) */,
                               double *strengths /* (count) */, double *residuals /* (count) */, int64_t count,
                               int64_t length) {
    const double half = 0.5 * ((double)length - 1.0);
    for (int64_t i = 0; i < count; i++) {
        const double *profile = profiles + i * length, *template = templates + i * length, *slope = slopes + i * length;
        const Trend own = trend_of(profile, length), bent = trend_of(slope, length);
        double pp = 0.0, ps = 0.0, ss = 0.0, pq = 0.0, sq = 0.0, qq = 0.0; /* products of p, p' and q */
#pragma omp simd reduction(+ : pp, ps, ss, pq, sq, qq)
        for (int64_t k = 0; k < length; k++) {
            const double at = (double)k - half, p = template[k];
            const double q = profile[k] - own.mean - own.slope * at, s = slope[k] - bent.mean - bent.slope * at;
            pp += p * p;
            ps += p * s;
            ss += s * s;
            pq += p * q;
            sq += s * q;
            qq += q * q;
        }
        const double determinant = pp * ss - ps * ps;
        shifts[i] = residuals[i] = NAN;
        strengths[i] = 0.0;
        if (isnan(own.mean) || determinant <= 1e-9 * pp * ss || pp == 0.0) continue;
        const double a = (pq * ss - sq * ps) / determinant, c = (sq * pp - pq * ps) / determinant;
        strengths[i] = a;
        residuals[i] = sqrt(larger(qq - a * pq - c * sq, 0.0) / ((double)length - 4.0));
        if (a != 0.0) shifts[i] = -c / a;
    }
}

enum { GROUPS = 5, RUN = 6 }; /* RUN: neighbouring edge points whose gradients are averaged with their sign */

/* Score at a place: geometric mean of the first four groups' means, plus a share of the fifth's. */
static double score_at(const double *sums, const double *seen, const double all_of[GROUPS], int64_t rows, int64_t row) {
    double score = 1.0, used = 0.0;
    for (int g = 0; g < GROUPS - 1; g++) {
        if (all_of[g] == 0.0) continue;
        if (2.0 * seen[g * rows + row] < all_of[g]) return 0.0;
        score *= sums[g * rows + row] / seen[g * rows + row];
        used += 1.0;
    }
    if (score <= 0.0 || used == 0.0) return 0.0;
    score = used == 4.0 ? sqrt(sqrt(score)) : pow(score, 1.0 / used);
    const double fifth = seen[(GROUPS - 1) * rows + row];
    if (fifth > 0.0) score += 0.3 * smaller(sums[(GROUPS - 1) * rows + row] / fifth, 2.0 * score);
    return score;
}

/* Edge scores of a shape at a grid of places in a picture.
 *
 * The score of a group of edges is its mean gradient along the normals: signed over a few neighbouring points, which
 * cancels noise and clutter, then in magnitude. The total is the geometric mean of the first four groups (both ends,
 * both sides), so that none can replace another, plus a share of the fifth.
 *
 * slope_u: brightness gradient along u, transposed; slope_v: brightness gradient along v, transposed; pixels: edge
 * points of the shape; normals: their unit normals; group: index of the group of each point, 0 to 4; first_u: shift of
 * the shape to the first place along u, pixels; first_v: along v; scores: the scores at shifts by whole columns and
 * rows from the first place; 0 where more than half of a group is outside.
 *
 * The innermost loops run down the columns of all places, so that they vectorise. */
EXPORT void edge_scores(const double *slope_u /* (width, height) */, const double *slope_v /* (width, height) */,
                        const double (*pixels)[2] /* (count, 2) */, const double (*normals)[2] /* (count, 2) */,
                        const int64_t *group /* (count) */, double first_u, double first_v,
                        double *work /* (2, 5, rows) */, double *scores /* (columns, rows) */, int64_t width,
                        int64_t height, int64_t count, int64_t rows, int64_t columns) {
    double all_of[GROUPS] = {0.0}, *restrict sums = work, *restrict seen = work + GROUPS * rows;
    for (int64_t i = 0; i < count; i++) all_of[group[i]] += 1.0;
    for (int64_t c = 0; c < columns; c++) {
        double *restrict together = scores + c * rows;
        int length = 0;
        memset(work, 0, (size_t)(2 * GROUPS * rows) * sizeof *work);
        memset(together, 0, (size_t)rows * sizeof *together);
        for (int64_t i = 0; i < count; i++) {
            const int64_t g = group[i] * rows;
            const double u = (double)c + floor(pixels[i][0] + first_u + 0.5), v = floor(pixels[i][1] + first_v + 0.5);
            if (0.0 <= u && u < (double)width && -(double)rows < v && v < (double)height) {
                const int64_t row = (int64_t)v, low = row < 0 ? -row : 0, rest = height - row;
                const int64_t high = rows < rest ? rows : rest;
                const double n_u = normals[i][0], n_v = normals[i][1];
                const double *along = slope_u + (int64_t)u * height + row, *down = slope_v + (int64_t)u * height + row;
                for (int64_t r = low; r < high; r++) together[r] += along[r] * n_u + down[r] * n_v;
                for (int64_t r = low; r < high; r++) seen[g + r] += 1.0;
            }
            if (++length < RUN && i < count - 1 && group[i + 1] == group[i]) continue;
            for (int64_t r = 0; r < rows; r++) {
                sums[g + r] += fabs(together[r]);
                together[r] = 0.0;
            }
            length = 0;
        }
        for (int64_t r = 0; r < rows; r++) together[r] = score_at(sums, seen, all_of, rows, r);
    }
}

/* Solve a symmetric positive definite system in place, given its lower triangle, by its Cholesky factor. */
static void solve(double normal[3][3], double right[3]) {
    const double little = 1e-9 * (normal[0][0] + normal[1][1] + normal[2][2]) + 1e-300;
    for (int a = 0; a < 3; a++) {
        for (int b = 0; b <= a; b++) {
            double value = normal[a][b] + (a == b ? little : 0.0);
            for (int c = 0; c < b; c++) value -= normal[a][c] * normal[b][c];
            normal[a][b] = a == b ? sqrt(larger(value, 1e-300)) : value / normal[b][b];
        }
    }
    for (int a = 0; a < 3; a++) {
        for (int b = 0; b < a; b++) right[a] -= normal[a][b] * right[b];
        right[a] /= normal[a][a];
    }
    for (int a = 2; a >= 0; a--) {
        for (int b = a + 1; b < 3; b++) right[a] -= normal[b][a] * right[b];
        right[a] /= normal[a][a];
    }
}

/* Weighted least squares for the pose change; `size` scales its three slopes for conditioning. */
static void least_squares(const double *shifts, const double (*slopes)[3], const double *weights, const double size[3],
                          double change[3], int64_t count) {
    double normal[3][3] = {{0.0}}, right[3] = {0.0};
    for (int64_t i = 0; i < count; i++) {
        if (!(weights[i] > 0.0)) continue;
        for (int a = 0; a < 3; a++) {
            const double share = weights[i] * slopes[i][a] / size[a];
            right[a] += share * shifts[i];
            for (int b = 0; b <= a; b++) normal[a][b] += share * slopes[i][b] / size[b];
        }
    }
    solve(normal, right);
    for (int a = 0; a < 3; a++) change[a] = right[a] / size[a];
}

/* The value of rank k, from 0; the values are reordered: none before it is larger (C. A. R. Hoare's FIND, 1961). */
static double ranked(double *values, int64_t count, int64_t k) {
    for (int64_t low = 0, high = count - 1; low < high;) {
        const double pivot = values[k];
        int64_t i = low, j = high;
        while (i <= j) {
            while (values[i] < pivot) i++;
            while (pivot < values[j]) j--;
            if (i > j) break;
            const double value = values[i];
            values[i++] = values[j];
            values[j--] = value;
        }
        if (j < k) low = i;
        if (k < i) high = j;
    }
    return values[k];
}

/* Median; the values are reordered. */
static double median(double *values, int64_t count) {
    if (count == 0) return NAN;
    const double upper = ranked(values, count, count / 2);
    if (count % 2) return upper;
    double lower = values[0];
    for (int64_t i = 1; i < count / 2; i++) lower = larger(lower, values[i]);
    return 0.5 * (lower + upper);
}

/* Robust least squares of a pose change, by reweighting with Tukey's biweight.
 *
 * Returns The residual scale over the expected one, at least 1/2.
 *
 * shifts: displacement of each edge along its normal, pixels; slopes: Jacobian of the displacements; weights: inverse
 * variances, 0 for invalid edges; least: residual scale over the expected one below which the biweight gets no
 * narrower; used: the final weights, 0 for outliers; change: the pose change. */
EXPORT double robust_change(const double *shifts /* (count) */, const double (*slopes)[3] /* (count, 3) */,
                            const double *weights /* (count) */, double least, double *work /* (2, count) */,
                            double *used /* (count) */, double change[3], int64_t count) {
    const double mad_to_sigma = 1.4826; /* of a normal distribution, 1/Phi^-1(3/4) */
    double size[3] = {1e-300, 1e-300, 1e-300}, level = 1.0, *misses = work, *known = work + count;
    for (int64_t i = 0; i < count; i++) {
        used[i] = weights[i] * smaller(1.0, 0.5 / larger(fabs(shifts[i]), 1e-9));
        for (int a = 0; a < 3; a++) size[a] = larger(size[a], fabs(slopes[i][a]));
    }
    for (int repeat = 0; repeat < 6; repeat++) {
        int64_t edges = 0;
        least_squares(shifts, slopes, used, size, change, count);
        for (int64_t i = 0; i < count; i++) {
            if (!(weights[i] > 0.0)) continue;
            const double *slope = slopes[i];
            const double miss = shifts[i] - slope[0] * change[0] - slope[1] * change[1] - slope[2] * change[2];
            known[edges++] = misses[i] = fabs(miss) * sqrt(weights[i]);
        }
        level = larger(0.5, mad_to_sigma * median(known, edges));
        for (int64_t i = 0; i < count; i++) {
            const double share = weights[i] > 0.0 ? misses[i] / (4.685 * larger(least, level)) : 1.0;
            used[i] = share < 1.0 ? weights[i] * squared(1.0 - share * share) : 0.0;
        }
    }
    return level;
}

/* Sums of one sample from each row, at positions linear in four parameters; 0 beyond the rows' ends.
 *
 * rows: samples; design: Jacobian of the position in each row, samples; middle: position where all parameters are zero,
 * samples; trials: the trial parameters; sums: the sums. */
EXPORT void sums_along(const double *rows /* (count, length) */, const double (*design)[4] /* (count, 4) */,
                       double middle, const double (*trials)[4] /* (tried, 4) */, double *sums /* (tried) */,
                       int64_t count, int64_t length, int64_t tried) {
    for (int64_t q = 0; q < tried; q++) {
        double total = 0.0;
        for (int64_t i = 0; i < count; i++) {
            double place = middle;
            for (int k = 0; k < 4; k++) place += design[i][k] * trials[q][k];
            place = rint(place);
            if (0.0 <= place && place < (double)length) total += rows[i * length + (int64_t)place];
        }
        sums[q] = total;
    }
}
