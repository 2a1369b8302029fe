/* Colours of a picture between its pixels, and the rotation angle of stripes on a cylinder. */
#include "newey_west.h"
#include <stdlib.h>

/* Bilinear interpolation of the colours at a pixel; NaN outside of the picture. */
static void sample(const uint8_t *image, int64_t height, int64_t width, double u, double v, double colour[3]) {
    if (!(0.0 <= u && u <= (double)width - 1.0 && 0.0 <= v && v <= (double)height - 1.0)) {
        colour[0] = colour[1] = colour[2] = NAN;
        return;
    }
    const int64_t i = (int64_t)smaller(v, (double)height - 2.0), j = (int64_t)smaller(u, (double)width - 2.0);
    const double a = v - (double)i, b = u - (double)j;
    const uint8_t *upper = image + 3 * (i * width + j), *lower = upper + 3 * width;
    for (int c = 0; c < 3; c++) {
        const double above = upper[c] * (1.0 - b) + upper[c + 3] * b, below = lower[c] * (1.0 - b) + lower[c + 3] * b;
        colour[c] = above * (1.0 - a) + below * a;
    }
}

/* Colours of a picture at pixels (u, v), by bilinear interpolation; NaN outside. */
EXPORT void sampled(const uint8_t *image /* (height, width, 3) */, const double (*pixels)[2] /* (count, 2) */,
                    double (*colours)[3] /* (count, 3) */, int64_t height, int64_t width, int64_t count) {
    for (int64_t k = 0; k < count; k++) sample(image, height, width, pixels[k][0], pixels[k][1], colours[k]);
}

/* Insert a value into an ascending series. */
static void insert(double *series, int64_t count, double value) {
    int64_t k = count;
    for (; k > 0 && series[k - 1] > value; k--) series[k] = series[k - 1];
    series[k] = value;
}

/* Interquartile mean of the colours on lines between pixels, which rejects highlights and bubbles.
 *
 * image: the picture; first: start of each line, pixels; last: end of each line, pixels; work: memory, for as many
 * samples as a line has; colours: the colours; NaN where fewer than half of the samples lie in the picture. */
EXPORT void profile_of_rows(const uint8_t *image /* (height, width, 3) */, const double (*first)[2] /* (count, 2) */,
                            const double (*last)[2] /* (count, 2) */, double *work /* (3, rows) */,
                            double (*colours)[3] /* (count, 3) */, int64_t height, int64_t width, int64_t count,
                            int64_t rows) {
    for (int64_t n = 0; n < count; n++) {
        int64_t seen = 0;
        for (int64_t m = 0; m < rows; m++) {
            const double share = ((double)m + 0.5) / (double)rows;
            const double u = first[n][0] + share * (last[n][0] - first[n][0]);
            const double v = first[n][1] + share * (last[n][1] - first[n][1]);
            double colour[3];
            sample(image, height, width, u, v, colour);
            if (isnan(colour[0])) continue;
            for (int c = 0; c < 3; c++) insert(work + c * rows, seen, colour[c]);
            seen++;
        }
        const int64_t low = seen / 4, high = seen - seen / 4;
        for (int c = 0; c < 3; c++) {
            double total = 0.0;
            for (int64_t m = low; m < high; m++) total += work[c * rows + m];
            colours[n][c] = 2 * seen < rows ? NAN : total / (double)(high - low);
        }
    }
}

/* Colours of the stripes in their order around the axis. */
typedef struct {
    const int64_t *order;       /* class of each stripe */
    const double (*palette)[3]; /* colour of each class */
    int64_t stripes, classes;
} Pattern;

/* Colour of blurred stripes at an angle about the axis, for the body's rotation angle `roll`; rad. */
static void stripe_colour(const Pattern *p, double angle, double blur, double roll, double colour[3]) {
    const double width = 2.0 * PI / (double)p->stripes, place = (angle - roll) / width + 0.5, whole = floor(place);
    const double inside = (place - whole) * width; /* behind the edge before */
    const double scale = 1.0 / (sqrt(2.0) * blur);
    const double before = inside * scale < 3.0 ? 0.5 * (1.0 + erf(inside * scale)) : 1.0;
    const double after = (inside - width) * scale > -3.0 ? 0.5 * (1.0 + erf((inside - width) * scale)) : 0.0;
    const double turns = floor(whole / (double)p->stripes);
    const int64_t last = p->stripes - 1, k = (int64_t)(whole - (double)p->stripes * turns);
    const double *one = p->palette[p->order[k > 0 ? k - 1 : last]], *two = p->palette[p->order[k]];
    const double *three = p->palette[p->order[k < last ? k + 1 : 0]];
    for (int c = 0; c < 3; c++) colour[c] = one[c] * (1.0 - before) + two[c] * (before - after) + three[c] * after;
}

/* Colours of blurred stripes at angles about the axis, for the body's rotation angle `roll`.
 *
 * angles: angles about the axis, rad; blur: standard deviation of the blur at each angle, rad; roll: angle of the first
 * stripe's middle, rad; order: class of each stripe; palette: colour of each class; colours: the colours. */
EXPORT void stripes_at(const double *angles /* (count) */, const double *blur /* (count) */, double roll,
                       const int64_t *order /* (stripes) */, const double (*palette)[3] /* (classes, 3) */,
                       double (*colours)[3] /* (count, 3) */, int64_t count, int64_t stripes, int64_t classes) {
    const Pattern pattern = {order, palette, stripes, classes};
    for (int64_t n = 0; n < count; n++) stripe_colour(&pattern, angles[n], blur[n], roll, colours[n]);
}

/* A sample of a colour profile, and what the fit makes of it. */
typedef struct {
    double angle, blur;        /* rad; standard deviation of the blur there */
    double colour[3];          /* observed; 0 where invisible */
    double shade[3], sheen[3]; /* shading factor and additive sheen of each channel */
    double model[3];           /* colour of the stripes */
    double base, weight;       /* weight of the angle, and that of its residual */
    double score;              /* its contribution to the fit's gradient */
} Sample;

enum { SAMPLE = 17 };
_Static_assert(sizeof(Sample) == SAMPLE * sizeof(double), "the memory that stripe_fit is given");

/* Samples of a profile, or every other one. */
typedef struct {
    Sample *first;
    int64_t count, stride;
} Profile;

typedef struct {
    double tint, cut; /* strength of the prior on the channels' common gain; residual beyond which a sample is stray */
} Robustness;

static double lit(const Sample *s, int c) { return s->shade[c] * s->model[c] + s->sheen[c]; }

/* Gain of each channel by least squares, with a prior of strength `tint` at their common gain. */
static void find_gains(Profile p, double tint, double gain[3]) {
    double top[3] = {0.0}, bottom[3] = {0.0};
    for (int64_t n = 0; n < p.count; n++) {
        const Sample *s = p.first + n * p.stride;
        for (int c = 0; c < 3; c++) {
            const double m = lit(s, c);
            top[c] += s->weight * m * s->colour[c];
            bottom[c] += s->weight * m * m;
        }
    }
    const double common = (top[0] + top[1] + top[2]) / (bottom[0] + bottom[1] + bottom[2] + 1e-12);
    for (int c = 0; c < 3; c++) gain[c] = (top[c] + tint * bottom[c] * common) / ((1.0 + tint) * bottom[c] + 1e-12);
}

/* Biweight weights of the residuals; returns the mean loss relative to its largest value. */
static double reweight(Profile p, const double gain[3], double cut) {
    double loss = 0.0, total = 0.0;
    for (int64_t n = 0; n < p.count; n++) {
        Sample *s = p.first + n * p.stride;
        double square = 0.0;
        for (int c = 0; c < 3; c++) square += squared(s->colour[c] - gain[c] * lit(s, c));
        const double kept = 1.0 - smaller(square / (cut * cut), 1.0);
        s->weight = s->base * (kept * kept);
        loss += s->base * (1.0 - kept * kept * kept);
        total += s->base;
    }
    return loss / (total + 1e-12);
}

/* Fit the gains to the stripes at an angle, and weight the residuals; returns the loss. */
static double fit_gains(Profile p, Robustness r, double gain[3]) {
    find_gains(p, r.tint, gain);
    return reweight(p, gain, r.cut);
}

static void set_stripes(Profile p, const Pattern *pattern, double roll) {
    for (int64_t n = 0; n < p.count; n++) {
        Sample *s = p.first + n * p.stride;
        stripe_colour(pattern, s->angle, s->blur, roll, s->model);
    }
}

/* Loss of a uniform colour: the mean of the palette. */
static double even_loss(Profile p, const Pattern *pattern, double cut) {
    double gain[3], even[3] = {0.0}, loss = 1.0;
    for (int64_t k = 0; k < pattern->classes; k++)
        for (int c = 0; c < 3; c++) even[c] += pattern->palette[k][c] / (double)pattern->classes;
    for (int64_t n = 0; n < p.count; n++) {
        Sample *s = p.first + n * p.stride;
        s->weight = s->base;
        for (int c = 0; c < 3; c++) s->model[c] = even[c];
    }
    for (int repeat = 0; repeat < 3; repeat++) loss = fit_gains(p, (Robustness){0.0, cut}, gain);
    return loss;
}

/* Losses on a grid of rotation angles; returns the index of the least. Only every other sample is used. */
static int64_t search_grid(Profile p, const Pattern *pattern, Robustness r, double period, double *losses,
                           int64_t tries) {
    const Profile some = {p.first, (p.count + 1) / 2, 2};
    double gain[3];
    int64_t best = 0;
    for (int64_t trial = 0; trial < tries; trial++) {
        set_stripes(some, pattern, (double)trial * period / (double)tries);
        for (int64_t n = 0; n < some.count; n++) some.first[2 * n].weight = some.first[2 * n].base;
        for (int repeat = 0; repeat < 2; repeat++) losses[trial] = fit_gains(some, r, gain);
        if (losses[trial] < losses[best]) best = trial;
    }
    return best;
}

/* Sums of a Gauss-Newton step in the angle. */
typedef struct {
    double gradient, information; /* weighted sums of slope times residual, and of the slope's square */
    double squares, total;        /* weighted sum of the residual's square over the channels; sum of the weights */
} Sums;

/* Slopes by central differences in the angle. */
static Sums sums_about(Profile p, const Pattern *pattern, double roll, const double gain[3]) {
    const double ahead_by = 0.008; /* rad */
    Sums sums = {0.0, 1e-300, 0.0, 0.0};
    for (int64_t n = 0; n < p.count; n++) {
        Sample *s = p.first + n * p.stride;
        double ahead[3], behind[3];
        stripe_colour(pattern, s->angle, s->blur, roll + ahead_by, ahead);
        stripe_colour(pattern, s->angle, s->blur, roll - ahead_by, behind);
        s->score = 0.0;
        for (int c = 0; c < 3; c++) {
            const double slope = gain[c] * s->shade[c] * (ahead[c] - behind[c]) / (2.0 * ahead_by);
            const double residual = s->colour[c] - gain[c] * lit(s, c);
            s->score += s->weight * slope * residual;
            sums.gradient += s->weight * slope * residual;
            sums.information += s->weight * (slope * slope);
            sums.squares += s->weight * (residual * residual) / 3.0;
        }
        sums.total += s->weight;
    }
    return sums;
}

/* Standard error of the angle; neighbouring angles share pixels, so that residuals are correlated. */
static double error_of(Profile p, const Sums *sums, double usual) {
    enum { CORRELATED = 6 };                  /* largest lag, in angles */
    if (sums->information < 1e-6) return NAN; /* the colours do not depend on the angle */
    double most = 0.0;
    for (int64_t n = 0; n < p.count; n++) most = larger(most, p.first[n].base);
    const double variance = larger(sums->squares / (sums->total + 1e-12), usual * usual);
    const double plain = 3.0 * variance * most / sums->information;
    const double correlated = variance_of_sum(&p.first->score, SAMPLE, p.count, CORRELATED);
    return sqrt(larger(plain, correlated / (sums->information * sums->information)));
}

/* Whether enough of the surface is visible: neither hidden nor too oblique. */
static bool is_visible(const double (*profile)[3], const double *scale, const double *trust, double blur,
                       Sample *samples, int64_t count) {
    const double oblique = 0.15, least = 0.3; /* of the largest scale, and of the surface */
    double most = scale[0], seen = 0.0, all_of = 0.0;
    for (int64_t n = 1; n < count; n++) most = larger(most, scale[n]);
    for (int64_t n = 0; n < count; n++) {
        Sample *s = samples + n;
        const bool finite = isfinite(profile[n][0]) && isfinite(profile[n][1]) && isfinite(profile[n][2]);
        const bool good = finite && scale[n] > oblique * most;
        for (int c = 0; c < 3; c++) s->colour[c] = good ? profile[n][c] : 0.0;
        s->base = s->weight = good ? trust[n] * scale[n] / most : 0.0;
        s->blur = clamped(blur / larger(scale[n], 1e-9), 0.004, 0.5);
        all_of += scale[n] / most;
        seen += good ? scale[n] / most : 0.0;
    }
    return seen >= least * all_of;
}

/* Least loss on the grid at angles that are not near the best one. */
static double distant_loss(const double *losses, int64_t tries, int64_t best, int64_t away) {
    double least = INFINITY;
    for (int64_t trial = 0; trial < tries; trial++) {
        const int64_t apart = llabs(trial - best), around = apart < tries - apart ? apart : tries - apart;
        if (around > away) least = smaller(least, losses[trial]);
    }
    return least;
}

/* Fit the rotation angle of stripes to a colour profile: grid search, then robust Gauss-Newton steps.
 *
 * profile: colours along the angle; NaN where invisible; scale: pixels per radian at each angle; trust: weight of each
 * angle, beside that of its scale; angles: angles about the axis, rad; shade: shading factor and additive sheen at each
 * angle, in each channel; order: class of each stripe; palette: colour of each class; period: of the pattern, rad;
 * tint: strength of the prior on the channels' common gain; cut: residual beyond which a sample is an outlier; usual:
 * least expected residual; blur: standard deviation of the blur, pixels; losses: loss at each angle of the grid, 0 to
 * 1; answer: angle, its standard error, loss, least loss at a distant angle, loss of a uniform colour, gains of the
 * channels; unchanged where too little is visible. */
EXPORT void stripe_fit(const double (*profile)[3] /* (count, 3) */, const double *scale /* (count) */,
                       const double *trust /* (count) */, const double *angles /* (count) */,
                       const double (*shade)[6] /* (count, 6) */, const int64_t *order /* (stripes) */,
                       const double (*palette)[3] /* (classes, 3) */, double period, double tint, double cut,
                       double usual, double blur, double *work /* (count, 17) */, double *losses /* (tries) */,
                       double answer[8], int64_t count, int64_t stripes, int64_t classes, int64_t tries) {
    const Pattern pattern = {order, palette, stripes, classes};
    const Profile all = {(Sample *)work, count, 1};
    const Robustness robust = {tint, cut};
    if (!is_visible(profile, scale, trust, blur, all.first, count)) return;
    for (int64_t n = 0; n < count; n++) {
        Sample *s = all.first + n;
        s->angle = angles[n];
        for (int c = 0; c < 3; c++) {
            s->shade[c] = shade[n][c];
            s->sheen[c] = shade[n][3 + c];
        }
    }
    const int64_t best = search_grid(all, &pattern, robust, period, losses, tries);
    double gain[3], roll = (double)best * period / (double)tries, loss = 1.0;
    for (int64_t n = 0; n < count; n++) all.first[n].weight = all.first[n].base;
    set_stripes(all, &pattern, roll);
    fit_gains(all, robust, gain); /* a first pass only sets the weights */
    Sums sums = {0.0, 0.0, 0.0, 0.0};
    for (int step = 0; step < 8; step++) {
        set_stripes(all, &pattern, roll);
        loss = fit_gains(all, robust, gain);
        sums = sums_about(all, &pattern, roll, gain);
        const double change = sums.gradient / sums.information;
        roll += clamped(change, -0.1, 0.1);
        if (fabs(change) < 2e-5) break;
    }
    const int64_t away = (int64_t)((double)tries * 0.35 * 2.0 * PI / (double)stripes / period);
    answer[0] = fmod(roll, period);
    if (answer[0] < 0.0) answer[0] += period;
    answer[1] = error_of(all, &sums, usual);
    answer[2] = loss;
    answer[3] = distant_loss(losses, tries, best, away > 1 ? away : 1);
    answer[4] = even_loss(all, &pattern, cut);
    for (int c = 0; c < 3; c++) answer[5 + c] = gain[c];
}
