/* Integrals of the ring modes over panels of an outline.
 *
 * A panel is a polynomial through Gauss nodes, and so is the density on it. Where a target is close, the panel is
 * halved until every piece is shorter than its distance; on the target's own panel, pieces double away from it, and
 * nodes crowd towards the logarithm.
 */
#include "panels.h"

#include <string.h>

#include "rings.h"

void fill_cardinals(const PanelRule *rule, double u, double *out) {
    double total = 0.0;
    for (int64_t j = 0; j < rule->size; j++) {
        const double difference = u - rule->nodes[j];
        if (difference == 0.0) {
            memset(out, 0, (size_t)rule->size * sizeof *out);
            out[j] = 1.0;
            return;
        }
        out[j] = rule->barycentric[j] / difference;
        total += out[j];
    }
    for (int64_t j = 0; j < rule->size; j++) out[j] /= total;
}

/* x and rho at u. */
static Target position(const PanelRule *rule, const Panel *panel, double u) {
    double cardinal[rule->size];
    Target at = {0.0, 0.0, 0.0};
    fill_cardinals(rule, u, cardinal);
    for (int64_t j = 0; j < rule->size; j++) {
        at.x += cardinal[j] * panel->x[j];
        at.rho += cardinal[j] * panel->rho[j];
    }
    return at;
}

bool is_near(const PanelRule *rule, const Panel *panel, const Target *target, Piece piece) {
    const Target a = position(rule, panel, piece.low), b = position(rule, panel, piece.high);
    const Target m = position(rule, panel, 0.5 * (piece.low + piece.high));
    const double length = hypot(m.x - a.x, m.rho - a.rho) + hypot(b.x - m.x, b.rho - m.rho);
    const double distance = hypot(m.x - target->x, m.rho - target->rho);
    return distance * distance + target->e2 < 2.25 * length * length;
}

bool has_next_piece(Halving *halving, const PanelRule *rule, const Panel *panel, const Target *target, double smallest,
                    Piece *piece) {
    if (halving->depth == 0) return false;
    int at = halving->depth - 1;
    while (at < 60 && halving->pieces[at].high - halving->pieces[at].low > smallest) {
        const Piece whole = halving->pieces[at];
        if (!is_near(rule, panel, target, whole)) break;
        const double middle = 0.5 * (whole.low + whole.high);
        halving->pieces[at++] = (Piece){middle, whole.high};
        halving->pieces[at] = (Piece){whole.low, middle};
    }
    halving->depth = at;
    *piece = halving->pieces[at];
    return true;
}

/* Where the block of a panel stands among those of all: rows of 3 components, columns of 3 components of each node. */
typedef struct {
    double *first;
    int64_t row, mode, modes; /* from row to row, from mode to mode; number of modes */
} Block;

/* Points of a quadrature over a panel: LANES of them, some of which may have no weight. */
typedef struct {
    RingPairs pairs;
    double weights[LANES];
} Points;

/* Add to a block what densities at points do that are interpolated between the nodes, cardinals (nodes, LANES). */
static void add_points(const Target *target, Points *points, double (*cardinals)[LANES], int64_t nodes,
                       const Block *block) {
    double a[block->modes + 1][LANES], b[block->modes + 1][LANES], k[9][LANES], weight[LANES];
    points->pairs.e2 = target->e2;
    EACH_LANE {
        points->pairs.rho[l] = target->rho;
        points->pairs.rho_s[l] = target->rho - points->pairs.delta[l];
        weight[l] = points->weights[l] * points->pairs.rho_s[l];
    }
    open_rings(&points->pairs, block->modes + 1, a, b);
    for (int64_t m = 0; m < block->modes; m++) {
        fill_ring_mode(&points->pairs, m, a, b, k);
        for (int e = 0; e < 9; e++) {
            double *out = block->first + m * block->mode + e / 3 * block->row + e % 3;
            EACH_LANE k[e][l] *= weight[l];
            for (int64_t j = 0; j < nodes; j++) {
                double sum = 0.0;
                for (int l = 0; l < LANES; l++) sum += k[e][l] * cardinals[j][l];
                out[3 * j] += sum;
            }
        }
    }
}

/* Add the integral over one piece; with is_crowded, nodes crowd at a logarithm at `centre`, one of its ends:
 * u = centre + (low or high - centre) w^6. */
static void add_piece(const PanelRule *rule, const Panel *panel, const Target *target, Piece piece, bool is_crowded,
                      double centre, const Block *block) {
    const double length = piece.high - piece.low, reach = centre == piece.low ? length : -length;
    for (int64_t first = 0; first < rule->fine_size; first += LANES) {
        double cardinals[rule->size][LANES], cardinal[rule->size];
        Points points = {0};
        for (int l = 0; l < LANES; l++) {
            const int64_t q = first + l < rule->fine_size ? first + l : rule->fine_size - 1;
            const double w = 0.5 * (1.0 + rule->fine[q]), w5 = is_crowded ? w * w * (w * w) * w : 1.0;
            const double u = is_crowded ? centre + reach * (w5 * w) : piece.low + length * w;
            const double weight = 0.5 * rule->fine_weights[q] * length * (is_crowded ? 6.0 * w5 : 1.0);
            points.weights[l] = first + l < rule->fine_size ? weight : 0.0;
            fill_cardinals(rule, u, cardinal);
            for (int64_t j = 0; j < rule->size; j++) { /* of differences: they keep digits where the target is a node */
                cardinals[j][l] = cardinal[j];
                points.pairs.dx[l] += cardinal[j] * (target->x - panel->x[j]);
                points.pairs.delta[l] += cardinal[j] * (target->rho - panel->rho[j]);
            }
        }
        add_points(target, &points, cardinals, rule->size, block);
    }
}

/* Over the panel that the target lies on, at u_0: towards both ends, in pieces that double. */
static void add_own_panel(const PanelRule *rule, const Panel *panel, const Target *target, double u_0,
                          const Block *block) {
    const double shorter = smaller(smaller(1.0 - u_0, 1.0 + u_0), 0.2);
    for (int side = -1; side <= 1; side += 2) {
        const double reach = 1.0 - side * u_0, step = smaller(shorter, reach);
        double done = 0.0;
        while (done < reach * (1.0 - 1e-12)) {
            double upto = done == 0.0 ? step : smaller(2.0 * done, reach);
            if (reach - upto < 0.3 * (upto - done)) upto = reach;
            const Piece piece = side > 0 ? (Piece){u_0 + done, u_0 + upto} : (Piece){u_0 - upto, u_0 - done};
            add_piece(rule, panel, target, piece, done == 0.0, u_0, block);
            done = upto;
        }
    }
}

/* Over a panel that the target lies off: halved until each piece is shorter than its distance. */
static void add_close_panel(const PanelRule *rule, const Panel *panel, const Target *target, const Block *block) {
    Halving halving = {.pieces = {{-1.0, 1.0}}, .depth = 1};
    Piece piece;
    while (has_next_piece(&halving, rule, panel, target, 1e-9, &piece)) {
        add_piece(rule, panel, target, piece, false, piece.low, block);
    }
}

/* Over a panel by its own nodes. */
static void add_far_panel(const PanelRule *rule, const Panel *panel, const Target *target, const Block *block) {
    double a[block->modes + 1][LANES], b[block->modes + 1][LANES], k[9][LANES], weight[LANES];
    RingPairs pairs = {.e2 = target->e2};
    for (int64_t first = 0; first < rule->size; first += LANES) {
        const int some = (int)(rule->size - first < LANES ? rule->size - first : LANES);
        EACH_LANE {
            const int64_t j = first + (l < some ? l : some - 1);
            pairs.dx[l] = target->x - panel->x[j];
            pairs.delta[l] = target->rho - panel->rho[j];
            pairs.rho[l] = target->rho;
            pairs.rho_s[l] = panel->rho[j];
            weight[l] = rule->weights[j] * panel->rho[j];
        }
        open_rings(&pairs, block->modes + 1, a, b);
        for (int64_t m = 0; m < block->modes; m++) {
            fill_ring_mode(&pairs, m, a, b, k);
            for (int e = 0; e < 9; e++) {
                double *out = block->first + m * block->mode + e / 3 * block->row + e % 3;
                for (int l = 0; l < some; l++) out[3 * (first + l)] = weight[l] * k[e][l];
            }
        }
    }
}

/* Velocities of every mode at rings, from a single layer on the panels of outlines.
 *
 * The density is interpolated between the panel's nodes and multiplied by the length of du, so that the integrals are
 * over rho du. `own` is the index of the node that a target is, panel by panel; -1 for a target off the outline.
 * Blocks are (modes, targets, 3, panels, nodes, 3).
 */
EXPORT void layer_blocks(const double *x, const double *rho, const int64_t *own, const double *x_p, const double *rho_p,
                         double e2, const double *nodes, const double *barycentric, const double *fine,
                         const double *fine_weights, const double *weights, double *blocks, int64_t targets,
                         int64_t panels, int64_t size, int64_t fine_size, int64_t modes) {
    const PanelRule rule = {size, nodes, barycentric, weights, fine_size, fine, fine_weights};
    const int64_t row = 3 * panels * size;
    memset(blocks, 0, (size_t)(modes * targets * 3 * row) * sizeof *blocks);
    for (int64_t i = 0; i < targets; i++) {
        const Target target = {x[i], rho[i], e2};
        for (int64_t q = 0; q < panels; q++) {
            const Panel panel = {x_p + q * size, rho_p + q * size};
            const Block block = {blocks + 3 * i * row + 3 * size * q, row, 3 * targets * row, modes};
            if (own[i] >= 0 && own[i] / size == q) {
                add_own_panel(&rule, &panel, &target, nodes[own[i] % size], &block);
            } else if (is_near(&rule, &panel, &target, (Piece){-1.0, 1.0})) {
                add_close_panel(&rule, &panel, &target, &block);
            } else {
                add_far_panel(&rule, &panel, &target, &block);
            }
        }
    }
}
