/* Where the edges between stripes lie against an even pattern. */
#include "core.h"

/* Profile of colours along the angle about the axis. */
typedef struct {
    const double (*levels)[3], *angles, *blur, (*shade)[6]; /* shade: factor and sheen of each channel */
    int64_t first, end;                                     /* the samples about an edge */
} Surroundings;

/* Loss of an edge at an angle between two colours: the share of the one behind it is that of a blurred step. */
static double loss_at(const Surroundings *s, double place, const double before[3], const double after[3]) {
    double loss = 0.0;
    for (int64_t n = s->first; n < s->end; n++) {
        const double share = 0.5 * erfc((place - s->angles[n]) / (sqrt(2.0) * s->blur[n]));
        for (int c = 0; c < 3; c++) {
            const double colour = before[c] + share * (after[c] - before[c]);
            loss += squared(s->levels[n][c] - s->shade[n][3 + c] - s->shade[n][c] * colour);
        }
    }
    return loss;
}

/* The samples within `far` of an angle; whether there are enough, and all are seen. */
static bool find_samples(Surroundings *s, double place, double far, int64_t fewest, int64_t count) {
    s->first = s->end = 0;
    for (int64_t n = 0; n < count; n++) {
        if (!(fabs(s->angles[n] - place) < far)) continue;
        if (s->end == 0) s->first = n;
        s->end = n + 1;
        for (int c = 0; c < 3; c++)
            if (!isfinite(s->levels[n][c])) return false;
    }
    return s->end - s->first >= fewest;
}

/* Angles by which the edges between stripes lie beyond their even places, by least squares one by one.
 *
 * levels: colours along the angle; NaN where nothing is seen; angles: angles about the axis, ascending, rad; blur:
 * standard deviation of the blur at each angle, rad; shade: shading factor and additive sheen at each angle, in each
 * channel; colours: of the stripes in their order; roll: angle of the first stripe's middle, rad; tried: shifts that
 * are tried, evenly spaced, rad; step: between them, rad; steepest: largest angle from the direction towards the camera
 * at which an edge is located, rad; around: half width over that of a stripe of the surroundings; contrast: least
 * distance of the colours on either side; fewest: fewest samples in the surroundings; found: the shifts, rad; NaN of
 * edges that are out of view. */
EXPORT void stripe_edges(const double (*levels)[3] /* (count, 3) */, const double *angles /* (count) */,
                         const double *blur /* (count) */, const double (*shade)[6] /* (count, 6) */,
                         const double (*colours)[3] /* (stripes, 3) */, double roll, const double *tried /* (trials) */,
                         double step, double steepest, double around, double contrast, int64_t fewest,
                         double *losses /* (trials) */, double *found /* (stripes) */, int64_t count, int64_t stripes,
                         int64_t trials) {
    Surroundings near = {levels, angles, blur, shade, 0, 0};
    const double width = 2.0 * PI / (double)stripes;
    for (int64_t edge = 0; edge < stripes; edge++) {
        const double *before = colours[edge > 0 ? edge - 1 : stripes - 1], *after = colours[edge];
        const double turned = roll + ((double)edge - 0.5) * width;
        const double place = turned - 2.0 * PI * floor(turned / (2.0 * PI) + 0.5);
        double apart = 0.0;
        for (int c = 0; c < 3; c++) apart += squared(after[c] - before[c]);
        found[edge] = NAN;
        if (fabs(place) > steepest || sqrt(apart) < contrast) continue;
        if (!find_samples(&near, place, around * width, fewest, count)) continue;
        int64_t best = 0;
        for (int64_t k = 0; k < trials; k++) {
            losses[k] = loss_at(&near, place + tried[k], before, after);
            if (losses[k] < losses[best]) best = k;
        }
        if (best == 0 || best == trials - 1) continue;
        const double low = losses[best - 1], middle = losses[best], high = losses[best + 1];
        found[edge] = tried[best] + 0.5 * step * (low - high) / larger(low - 2.0 * middle + high, 1e-300);
    }
}
