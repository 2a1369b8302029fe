/* Fit of a travelling wave to a ridge in a strip of a picture.
 *
 * Columns j of the strip run across the tail, rows i along it. A wire of phase phi appears as the curve
 *
 *     y' = y + f z + g y z   at   xi' = xi + e z,   y = r cos(a), z = r sin(a), a = K xi + a_0 + phi,
 *
 * where e, f and g are the derivatives with height z of the shift along and across, and of the magnification.
 */
#include "newey_west.h"

/* Ridge filter: contrast of a line at each pixel of a strip to both of its sides.
 *
 * image: the picture; middle: pixel of each row's middle; across: step from one column to the next, pixels; contrast:
 * weight of each channel; inner: half the width of the line, columns; ridge: the strip; NaN in rows that leave the
 * picture. */
EXPORT void ridge_of(const uint8_t *image /* (height, width, 3) */, const double (*middle)[2] /* (rows, 2) */,
                     const double (*across)[2] /* (rows, 2) */, const double contrast[3], int64_t inner,
                     double *work /* (2, columns) */, double *ridge /* (rows, columns) */, int64_t height,
                     int64_t width, int64_t rows, int64_t columns) {
    const double half = 0.5 * ((double)columns - 1.0);
    const int64_t side = 2 * inner + 1;
    double *sums = work; /* through the columns before */
    for (int64_t i = 0; i < rows; i++) {
        double *line = ridge + i * columns;
        int64_t j = 0;
        sums[0] = 0.0;
        for (; j < columns; j++) {
            const double u = middle[i][0] + ((double)j - half) * across[i][0];
            const double v = middle[i][1] + ((double)j - half) * across[i][1];
            if (!(0.0 <= u && u < (double)width - 1.0 && 0.0 <= v && v < (double)height - 1.0)) break;
            const int64_t p = (int64_t)v, q = (int64_t)u;
            const double a = v - (double)p, b = u - (double)q;
            const double one = (1.0 - a) * (1.0 - b), two = (1.0 - a) * b, three = a * (1.0 - b), four = a * b;
            const uint8_t *upper = image + 3 * (p * width + q), *lower = upper + 3 * width;
            double level[3];
            for (int c = 0; c < 3; c++)
                level[c] = one * upper[c] + two * upper[c + 3] + three * lower[c] + four * lower[c + 3];
            sums[j + 1] = sums[j] + (contrast[0] * level[0] + contrast[1] * level[1] + contrast[2] * level[2]);
        }
        const bool whole = j == columns;
        for (j = 0; j < columns; j++) {
            const int64_t low = j > inner ? j - inner : 0, high = j + inner + 1 < columns ? j + inner + 1 : columns;
            const int64_t left = low > side ? low - side : 0, right = high + side < columns ? high + side : columns;
            const double centre = (sums[high] - sums[low]) / (double)(high - low);
            /* The weaker of both steps, so that a single edge gives no ridge. */
            const double before = low > left ? centre - (sums[low] - sums[left]) / (double)(low - left) : INFINITY;
            const double after = right > high ? centre - (sums[right] - sums[high]) / (double)(right - high) : INFINITY;
            const double step = smaller(before, after);
            line[j] = !whole ? NAN : step < INFINITY ? step : 0.0;
        }
    }
}

/* A tapered wire: the Python layer's `wave`. */
typedef struct {
    double wavenumber, angle, decay, amplitude; /* K, a_0, c/L_t (0 or less: no taper), largest radius */
} Wave;

/* Derivatives with height of the shift along (e) and across (f), and of the magnification (g). */
typedef struct {
    double e, f, g;
} Tilt;

static Wave with_taper(const Wave *wave) {
    Wave found = *wave;
    if (!(found.decay > 0.0)) found.decay = 1e12;
    return found;
}

/* Distance of the wire from the axis, m; far from the root, 1 - exp(-40) is 1. */
static double radius_at(const Wave *w, double xi) {
    const double far = w->decay * larger(xi, 0.0);
    return far < 40.0 ? w->amplitude * (1.0 - exp(-far)) : w->amplitude;
}

/* Where the wire crosses a row. */
typedef struct {
    double place, y, turn; /* lateral position; r cos(a); derivative of the position by the phase */
} Crossing;

/* `cos_xi`, `sin_xi` are r cos(a) and r sin(a) at xi; `hand` = -1 mirrors the heights. */
static Crossing crossing_of(const Wave *w, const Tilt *tilt, double xi, double phase, double cos_xi, double sin_xi,
                            double hand) {
    const double at = xi - tilt->e * hand * sin_xi, at_turn = -tilt->e * hand * cos_xi; /* with its derivative by phi */
    const double a = w->wavenumber * at + w->angle + phase, a_turn = 1.0 + w->wavenumber * at_turn;
    const double r = radius_at(w, at), r_turn = at > 0.0 ? (w->amplitude - r) * w->decay * at_turn : 0.0;
    const double c = cos(a), s = sin(a), y = r * c, z = hand * r * s;
    const double y_turn = r_turn * c - r * s * a_turn, z_turn = hand * (r_turn * s + r * c * a_turn);
    return (Crossing){
        .place = y + tilt->f * z + tilt->g * y * z,
        .y = y,
        .turn = y_turn + tilt->f * z_turn + tilt->g * (y_turn * z + y * z_turn),
    };
}

/* Mean ridge along the wire at evenly spaced phases; NaN with fewer than a third of the rows in the picture.
 *
 * ridge: the strip; xi: distance from the root of each row, m; tilt: of each row; packed: of the wire; step: width of a
 * column, m; every: stride of the rows; turns: cosine and sine of the phases; scores: the score of each phase. */
EXPORT void wave_scores(const double *ridge /* (rows, columns) */, const double *xi /* (rows) */,
                        const Tilt *tilt /* (rows) */, const Wave *packed, double step, int64_t every,
                        const double (*turns)[2] /* (phases, 2) */, double *scores /* (phases) */, int64_t rows,
                        int64_t columns, int64_t phases) {
    const Wave wave = with_taper(packed);
    const double half = 0.5 * ((double)columns - 1.0);
    int64_t count = 0;
    for (int64_t n = 0; n < phases; n++) scores[n] = 0.0;
    for (int64_t i = 0; i < rows; i += every) {
        const double *line = ridge + i * columns;
        if (isnan(line[0])) continue;
        count++;
        const double r = radius_at(&wave, xi[i]), a = wave.wavenumber * xi[i] + wave.angle;
        const double c = r * cos(a), s = r * sin(a);
        for (int64_t n = 0; n < phases; n++) {
            const double *turn = turns[n], phase = 2.0 * PI * (double)n / (double)phases;
            const double cos_xi = c * turn[0] - s * turn[1], sin_xi = s * turn[0] + c * turn[1];
            const double place = crossing_of(&wave, tilt + i, xi[i], phase, cos_xi, sin_xi, 1.0).place / step + half;
            const double j = floor(place), b = place - j;
            if (!(0.0 <= j && j < (double)columns - 1.0)) continue;
            scores[n] += (1.0 - b) * line[(int64_t)j] + b * line[(int64_t)j + 1];
        }
    }
    for (int64_t n = 0; n < phases; n++) scores[n] = 3 * count * every >= rows ? scores[n] / (double)count : NAN;
}

/* A row of the strip in the fit of the wave; m. */
typedef struct {
    double residual; /* lateral distance of the ridge from the curve */
    double strength; /* weight of the residual, NaN outside of the picture */
    double weight;   /* with the biweight of its size */
    double basis[3]; /* derivatives of the curve by phase, offset and tilt */
    double y;        /* r cos(a) */
    double mirrored; /* half the distance to the curve of opposite handedness */
    double ridge;    /* on the curve */
    double score;    /* contribution to the fit's gradient by the phase */
} Row;

enum { ROW = 10 };
_Static_assert(sizeof(Row) == ROW * sizeof(double), "the memory that wave_fit is given");

/* A strip of the picture. */
typedef struct {
    const double *ridge, *xi;
    const Tilt *tilt;
    int64_t rows, columns;
    double step, usual; /* width of a column, m; typical ridge on the wire */
} Strip;

/* Lateral distance of the ridge from the curve in a row, within a search window; `aside` is the curve's offset. */
static void find_residual(const Strip *strip, const Wave *wave, double phase, double window, double aside, int64_t i,
                          Row *row) {
    const double *line = strip->ridge + i * strip->columns, xi = strip->xi[i], step = strip->step, usual = strip->usual;
    const double half = 0.5 * ((double)strip->columns - 1.0), last = (double)strip->columns - 1.0;
    row->residual = row->basis[0] = row->y = row->mirrored = row->ridge = 0.0;
    row->strength = NAN;
    if (isnan(line[0])) return;
    const double r = radius_at(wave, xi), a = wave->wavenumber * xi + wave->angle + phase;
    const Crossing own = crossing_of(wave, strip->tilt + i, xi, phase, r * cos(a), r * sin(a), 1.0);
    const Crossing other = crossing_of(wave, strip->tilt + i, xi, phase, r * cos(a), r * sin(a), -1.0);
    const double curve = own.place + aside, at = floor(curve / step + half + 0.5);
    const int64_t low = (int64_t)fmin(last + 1.0, fmax(0.0, ceil((curve - window) / step + half)));
    const int64_t high = (int64_t)fmin(last, fmax(-1.0, floor((curve + window) / step + half)));
    double top = 0.0, bottom = 0.0;
    for (int64_t j = low; j <= high; j++) {
        const double away = ((double)j - half) * step - curve;
        const double bright = 0.5 * (line[j] + fabs(line[j])); /* 0 where it is negative, without a branch */
        const double value = bright * bright * (1.0 - squared(away / window));
        top += value * away;
        bottom += value;
    }
    const double strength = high >= low ? bottom / (double)(high - low + 1) : 0.0;
    row->residual = bottom > 0.0 ? top / bottom : 0.0;
    row->strength = smaller(1.0, usual > 0.0 ? strength / (usual * usual) : strength);
    row->basis[0] = own.turn;
    row->y = own.y;
    row->mirrored = 0.5 * (own.place - other.place);
    row->ridge = 0.0 <= at && at <= last ? line[(int64_t)at] : 0.0;
}

/* Sums over the rows in view. */
typedef struct {
    double total, spread; /* sum of the weights; mean absolute residual */
    int64_t inside;       /* number of the rows */
} View;

/* Biweight weights of the residuals. */
static View weight_rows(Row *rows, int64_t count, double scale, double width) {
    View view = {0.0, 0.0, 0};
    for (int64_t i = 0; i < count; i++) {
        Row *row = rows + i;
        row->weight = 0.0;
        if (isnan(row->strength)) continue;
        const double far = fabs(row->residual), share = smaller(far / (3.0 * scale), 1.0);
        row->weight = row->strength * squared(1.0 - share * share);
        view.total += row->weight;
        view.spread += row->weight * smaller(far, width);
        view.inside++;
    }
    view.spread /= larger(view.total, 1e-300);
    return view;
}

/* Normal equations of weighted least squares with three unknowns. */
typedef struct {
    double matrix[3][3], right[3];
} Normal;

static Normal normal_of(const Row *rows, int64_t count, bool of_mirrored) {
    Normal normal = {{{0.0}}, {0.0}};
    for (int64_t i = 0; i < count; i++) {
        const double *basis = rows[i].basis, wanted = of_mirrored ? rows[i].mirrored : rows[i].residual;
        for (int a = 0; a < 3; a++) {
            const double share = rows[i].weight * basis[a];
            normal.right[a] += share * wanted;
            for (int b = 0; b < 3; b++) normal.matrix[a][b] += share * basis[b];
        }
    }
    return normal;
}

static double dot(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

/* Standard error, inlier share, handedness and amplitude error of a converged fit. */
static void assess(const Strip *strip, Row *rows, const View *view, const Normal *normal, double inverse[3][3],
                   double width, double answer[10]) {
    double close = 0.0, square = 0.0, mean = 0.0, other[3][3];
    for (int64_t i = 0; i < strip->rows; i++) {
        Row *row = rows + i;
        row->score = row->weight * row->residual * dot(row->basis, inverse[0]);
        square += row->weight * squared(row->residual);
        if (isnan(row->strength)) continue;
        close += row->weight > 0.15 && fabs(row->residual) < 0.5 * width;
        mean += row->ridge;
    }
    /* Errors of neighbouring rows are correlated. */
    const double apart = strip->xi[1] - strip->xi[0], reach = larger(4.0, floor(3.0 * width / apart));
    const double plain = square / view->total * inverse[0][0] * larger(1.0, 0.5 * reach);
    answer[1] = sqrt(larger(plain, variance_of_sum(&rows->score, ROW, strip->rows, (int64_t)reach)));
    answer[2] = close / (double)view->inside;
    answer[9] = mean / (double)view->inside;
    /* The effect of opposite handedness, orthogonal to those of phase, offset and tilt. */
    Normal gram = normal_of(rows, strip->rows, true);
    for (int a = 0; a < 3; a++) gram.matrix[a][a] += 1e-12 * normal->matrix[a][a];
    invert((const double *)gram.matrix, (double *)other);
    for (int k = 5; k < 9; k++) answer[k] = 0.0;
    for (int64_t i = 0; i < strip->rows; i++) {
        const Row *row = rows + i;
        double residual = row->mirrored;
        for (int a = 0; a < 3; a++) residual -= row->basis[a] * dot(other[a], gram.right);
        answer[5] += row->weight * residual * row->residual;
        answer[6] += row->weight * residual * residual;
        answer[7] += row->weight * row->y * row->residual;
        answer[8] += row->weight * squared(row->y);
    }
}

/* Robust Gauss-Newton fit of phase, lateral offset and tilt of a wire, from a phase nearby.
 *
 * ridge: the strip; xi: distance from the root of each row, m; tilt: of each row; packed: of the wire; phase: to begin
 * with, rad; step: width of a column, m; width: of the wire, m; usual: typical ridge on the wire; likely_offset: prior
 * standard deviation of the offset, m; likely_lean: prior standard deviation of the difference of offsets from end to
 * end, m; answer: phase, its standard error, inlier share of the rows, offset, tilt, numerator and denominator of the
 * handedness (0 as assumed, -2 opposite) and of the relative error of the amplitude, mean ridge; unchanged where too
 * little is in view. */
EXPORT void wave_fit(const double *ridge /* (count, columns) */, const double *xi /* (count) */,
                     const Tilt *tilt /* (count) */, const Wave *packed, double phase, double step, double width,
                     double usual, double likely_offset, double likely_lean, double *work /* (count, 10) */,
                     double answer[10], int64_t count, int64_t columns) {
    const Wave wave = with_taper(packed);
    const Strip strip = {ridge, xi, tilt, count, columns, step, usual};
    const double length = xi[count - 1] - xi[0];
    Row *rows = (Row *)work;
    double middle = 0.0, offset = 0.0, lean = 0.0, scale = width, inverse[3][3];
    for (int64_t i = 0; i < count; i++) middle += xi[i];
    middle /= (double)count;
    for (int64_t i = 0; i < count; i++) {
        rows[i].basis[1] = 1.0;
        rows[i].basis[2] = (xi[i] - middle) / length;
    }
    View view = {0.0, 0.0, 0};
    Normal normal;
    for (int repeat = 0; repeat < 8; repeat++) {
        const double window = (repeat < 2 ? 2.0 : 1.25) * width;
        for (int64_t i = 0; i < count; i++)
            find_residual(&strip, &wave, phase, window, offset + rows[i].basis[2] * lean, i, rows + i);
        view = weight_rows(rows, count, scale, width);
        if (view.total < 1e-6 || 3 * view.inside < count) return;
        scale = larger(1.5 * view.spread, 0.15 * width);
        normal = normal_of(rows, count, false);
        const double noise = squared(larger(1.25 * view.spread, 0.03 * width)); /* of Gaussian priors at zero */
        const double prior_offset = noise / squared(likely_offset), prior_lean = noise / squared(likely_lean);
        normal.matrix[0][0] += 1e-300;
        normal.matrix[1][1] += prior_offset;
        normal.matrix[2][2] += prior_lean;
        normal.right[1] -= prior_offset * offset;
        normal.right[2] -= prior_lean * lean;
        invert((const double *)normal.matrix, (double *)inverse);
        const double change = dot(inverse[0], normal.right);
        phase += 1.2 * clamped(change, -0.5, 0.5);
        offset += dot(inverse[1], normal.right);
        lean += dot(inverse[2], normal.right);
        if (repeat > 2 && fabs(change) < 2e-4) break;
    }
    answer[0] = phase;
    answer[3] = offset;
    answer[4] = lean / length;
    assess(&strip, rows, &view, &normal, inverse, width, answer);
}
