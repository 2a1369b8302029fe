/* Edges of a coloured seal: how much of a stripe's colour each sample across an edge has. */
#include "core.h"

enum { COLOURS = 3, FIRST = 0, END = 1, FLANK = 2 }; /* FIRST...: columns of `sides` */

/* Profiles across all edges: a colour of a sample is at[(c * edges + edge) * samples + sample]. */
typedef struct {
    const double *at, *offsets;
    int64_t edges, samples;
    double beside;
} Profiles;

static double colour_at(const Profiles *p, int c, int64_t edge, int64_t sample) {
    return p->at[(c * p->edges + edge) * p->samples + sample];
}

/* Mean colour of the samples from one offset to another; NaN out of view. */
static void mean_between(const Profiles *p, int64_t edge, double low, double high, double mean[COLOURS]) {
    for (int c = 0; c < COLOURS; c++) {
        double total = 0.0, count = 0.0;
        for (int64_t k = 0; k < p->samples; k++) {
            if (p->offsets[k] < low || p->offsets[k] > high) continue;
            total += colour_at(p, c, edge, k);
            count += 1.0;
        }
        mean[c] = total / count;
    }
}

static bool is_seen(const double colour[COLOURS]) {
    return isfinite(colour[0]) && isfinite(colour[1]) && isfinite(colour[2]);
}

/* Surroundings of each edge of a side, averaged over its neighbours, in `middle`, (COLOURS, edges); whether enough are
 * in view. The others have the mean of those. */
static bool surroundings(const Profiles *p, const int64_t *side, int64_t fewest, int64_t pooled, double *own,
                         double *middle) {
    double all[COLOURS] = {0.0}, seen = 0.0, mean[COLOURS];
    for (int64_t i = side[FIRST]; i < side[END]; i++) {
        mean_between(p, i, p->beside, INFINITY, mean);
        for (int c = 0; c < COLOURS; c++) own[c * p->edges + i] = mean[c];
        if (!is_seen(mean)) continue;
        for (int c = 0; c < COLOURS; c++) all[c] += mean[c];
        seen += 1.0;
    }
    if (seen < (double)fewest) return false;
    for (int c = 0; c < COLOURS; c++) {
        double *line = own + c * p->edges;
        for (int64_t i = side[FIRST]; i < side[END]; i++) {
            const double alike[COLOURS] = {own[i], own[p->edges + i], own[2 * p->edges + i]};
            middle[c * p->edges + i] = is_seen(alike) ? line[i] : all[c] / seen;
        }
    }
    for (int c = 0; c < COLOURS; c++) {
        double *line = own + c * p->edges, *values = middle + c * p->edges;
        for (int64_t i = side[FIRST]; i < side[END]; i++) line[i] = values[i];
        for (int64_t i = side[FIRST]; i < side[END]; i++) {
            double total = 0.0;
            for (int64_t k = i - pooled; k <= i + pooled; k++)
                total += line[k < side[FIRST] ? side[FIRST] : k >= side[END] ? side[END] - 1 : k];
            values[i] = total / (double)(2 * pooled + 1);
        }
    }
    return true;
}

/* Inverse covariance of what lies beside the edges of a side, with noise and what the ground has farther out. */
static void whitening(const Profiles *p, const int64_t *side, const double *middle,
                      const double ground[COLOURS][COLOURS], double inverse[COLOURS][COLOURS]) {
    double spread[COLOURS][COLOURS] = {{0.0}}, count = 0.0;
    for (int64_t i = side[FIRST]; i < side[END]; i++) {
        for (int64_t k = 0; k < p->samples; k++) {
            double away[COLOURS];
            if (p->offsets[k] < p->beside) continue;
            for (int c = 0; c < COLOURS; c++) away[c] = colour_at(p, c, i, k) - middle[c * p->edges + i];
            if (!is_seen(away)) continue;
            for (int a = 0; a < COLOURS; a++)
                for (int b = 0; b < COLOURS; b++) spread[a][b] += away[a] * away[b];
            count += 1.0;
        }
    }
    for (int a = 0; a < COLOURS; a++)
        for (int b = 0; b < COLOURS; b++) spread[a][b] = spread[a][b] / count + ground[a][b];
    invert((const double *)spread, (double *)inverse);
}

/* Direction that separates a step of colour best from the surroundings (Fisher's); returns their squared distance. */
static double separate(const double inverse[COLOURS][COLOURS], const double step[COLOURS], double towards[COLOURS]) {
    double apart = 0.0;
    for (int a = 0; a < COLOURS; a++) {
        towards[a] = inverse[a][0] * step[0] + inverse[a][1] * step[1] + inverse[a][2] * step[2];
        apart += towards[a] * step[a];
    }
    return apart;
}

static int64_t nearest(const double colour[COLOURS], const double (*palette)[COLOURS], int64_t kinds) {
    int64_t best = 0;
    double least = INFINITY;
    for (int64_t j = 0; j < kinds; j++) {
        double off = 0.0;
        for (int c = 0; c < COLOURS; c++) off += squared((isnan(colour[c]) ? 0.0 : colour[c]) - palette[j][c]);
        if (off < least) {
            least = off;
            best = j;
        }
    }
    return best;
}

/* Share of a colour, `step` away from the surroundings, in the samples across an edge; the largest one is kept. */
static void add_share(const Profiles *p, int64_t edge, const double middle[COLOURS], const double towards[COLOURS],
                      double apart, bool is_first, double *share) {
    for (int64_t k = 0; k < p->samples; k++) {
        double value = 0.0;
        for (int c = 0; c < COLOURS; c++) value += towards[c] * (colour_at(p, c, edge, k) - middle[c]);
        share[k] = is_first ? value / apart : larger(share[k], value / apart);
    }
}

/* Share of the stripe's colour in the samples across each edge of a seal.
 *
 * Colours are projected onto the direction that separates a stripe best from the surroundings of its side (Fisher's
 * linear discriminant). At a silhouette of known colours the share is that of the colour of which there is most.
 *
 * colours: profiles across the edges, of 255; NaN out of view; offsets: distances of the samples outward from an edge,
 * pixels; sides: first edge of each side, the one after its last, and whether the side is a silhouette; palette: known
 * colours at the silhouette; none at first; ground: covariance of colours, by noise and by what lies farther out, at
 * ends and at silhouettes, of 255; beside: distance from an edge from which on colours are those of one side, pixels;
 * distinct: least distance of a stripe from its surroundings, standard deviations; white: brightness of glare, of 255,
 * which hides an edge; fewest: fewest edges of a side in view; pooled: edges on either side whose surroundings are
 * averaged; share: 1 in the stripe to 0 beside it; NaN where unknown; distance: squared distance of the stripe from its
 * surroundings; 0 where they look alike; kind: index into the palette of the nearest colour; 0 without one. */
EXPORT void seal_shares(const double *colours /* (3, edges, samples) */, const double *offsets /* (samples) */,
                        const int64_t (*sides)[3] /* (count, 3) */, const double (*palette)[COLOURS] /* (kinds, 3) */,
                        const double (*ground)[COLOURS][COLOURS] /* (2, 3, 3) */, double beside, double distinct,
                        double white, int64_t fewest, int64_t pooled, double *work /* (2, 3, edges) */,
                        double *share /* (edges, samples) */, double *distance /* (edges) */,
                        int64_t *kind /* (edges) */, int64_t edges, int64_t samples, int64_t count, int64_t kinds) {
    const Profiles p = {colours, offsets, edges, samples, beside};
    double *middle = work + COLOURS * edges, inverse[COLOURS][COLOURS];
    for (int64_t i = 0; i < edges; i++) {
        distance[i] = 0.0;
        kind[i] = 0;
        for (int64_t k = 0; k < samples; k++) share[i * samples + k] = NAN;
    }
    for (int64_t s = 0; s < count; s++) {
        const bool is_flank = sides[s][FLANK] != 0;
        if (!surroundings(&p, sides[s], fewest, pooled, work, middle)) continue;
        whitening(&p, sides[s], middle, ground[is_flank], inverse);
        for (int64_t i = sides[s][FIRST]; i < sides[s][END]; i++) {
            double inner[COLOURS], here[COLOURS], step[COLOURS], towards[COLOURS], *line = share + i * samples;
            mean_between(&p, i, is_flank ? -beside : -2.0 * beside, is_flank ? -1.0 : -beside, inner);
            for (int c = 0; c < COLOURS; c++) {
                here[c] = middle[c * edges + i];
                step[c] = inner[c] - here[c];
            }
            const double apart = separate(inverse, step, towards);
            const double low = smaller(smaller(inner[0], inner[1]), inner[2]);
            const bool is_glare = larger(low, smaller(smaller(here[0], here[1]), here[2])) > white; /* it hides all */
            if (apart > squared(distinct) && !is_glare) distance[i] = apart;
            if (kinds > 0) kind[i] = nearest(inner, palette, kinds);
            if (!is_flank || kinds == 0) {
                add_share(&p, i, here, towards, larger(apart, 1e-9), true, line);
                continue;
            }
            for (int64_t j = 0; j < kinds; j++) { /* a thin stripe at the silhouette, another one beside it */
                for (int c = 0; c < COLOURS; c++) step[c] = palette[j][c] - here[c];
                const double far = separate(inverse, step, towards);
                add_share(&p, i, here, towards, far, j == 0, line);
            }
            for (int64_t k = 0; k < samples; k++) line[k] = isnan(line[k]) ? NAN : clamped(line[k], -0.2, 1.2);
        }
    }
}

/* Least squares of a profile of shares: level, contrast and slope of the template, and the residual. */
typedef struct {
    const double (*design)[3], *inverse; /* template's columns, (samples, 3), and their pseudoinverse, (3, samples) */
    int64_t first;                       /* first sample that is used */
} Template;

static double fit_template(const Template *t, const double *share, int64_t samples, double numbers[3]) {
    double misses = 0.0;
    for (int a = 0; a < 3; a++) {
        numbers[a] = 0.0;
        for (int64_t k = t->first; k < samples; k++) numbers[a] += t->inverse[a * samples + k] * share[k];
    }
    for (int64_t k = t->first; k < samples; k++) {
        const double *row = t->design[k];
        misses += squared(share[k] - row[0] * numbers[0] - row[1] * numbers[1] - row[2] * numbers[2]);
    }
    return sqrt(misses / (double)(samples - t->first - 3));
}

/* Displacement of each edge of a seal along its normal, by least squares of a template.
 *
 * share: share of the stripe's colour in the samples across each edge; distance: squared distance of the stripe from
 * its surroundings; 0 where they look alike; kind: class of the colour at each edge; sides: first edge of each side,
 * the one after its last, and whether the side is a silhouette; bias: displacement by each class of colour at each
 * side, samples; design: the template's columns: level, the edge of contrast 1, its slope; inverses: their
 * pseudoinverses, at other sides and at silhouettes; starts: first sample that is used at these; steepness: root sum
 * square of the slope; largest: largest valid displacement, samples; weakest: least valid contrast; strongest: largest
 * one; noise: least residual, times the distance; shifts: the displacements, samples; NaN out of view; known: 1 where
 * the displacement is valid; variance: its variance, samples^2. */
EXPORT void seal_shifts(const double *share /* (edges, samples) */, const double *distance /* (edges) */,
                        const int64_t *kind /* (edges) */, const int64_t (*sides)[3] /* (count, 3) */,
                        const double *bias /* (count, kinds) */, const double (*design)[3] /* (samples, 3) */,
                        const double *inverses /* (2, 3, samples) */, const int64_t starts[2], double steepness,
                        double largest, double weakest, double strongest, double noise, double *shifts /* (edges) */,
                        uint8_t *known /* (edges) */, double *variance /* (edges) */, int64_t edges, int64_t samples,
                        int64_t count, int64_t kinds) {
    for (int64_t i = 0; i < edges; i++) {
        shifts[i] = variance[i] = NAN;
        known[i] = 0;
    }
    for (int64_t s = 0; s < count; s++) {
        const int64_t which = sides[s][FLANK] != 0;
        const Template template = {design, inverses + which * 3 * samples, starts[which]};
        for (int64_t i = sides[s][FIRST]; i < sides[s][END]; i++) {
            double numbers[3];
            const double miss = fit_template(&template, share + i * samples, samples, numbers);
            const double strength = numbers[1], shift = -numbers[2] / numbers[1];
            const double least = noise / sqrt(larger(distance[i], 1e-9));
            known[i] = distance[i] > 0.0 && fabs(shift) < largest && weakest < strength && strength < strongest;
            shifts[i] = shift - bias[s * kinds + kind[i]];
            variance[i] = squared(larger(miss, least) / larger(fabs(strength) * steepness, 1e-9));
        }
    }
}
