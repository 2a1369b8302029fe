/* Integrals of the ring modes over panels of an outline.
 *
 * A panel is a polynomial through Gauss nodes, and so is the density on it. Where a target is close, the panel is
 * halved until every piece is shorter than its distance; on the target's own panel, pieces double away from it, and
 * nodes crowd towards the logarithm.
 */
#include "panels.h"

#include <string.h>

/* Lagrange polynomials of the nodes at u, in barycentric form. */
static void fill_cardinals(const PanelRule *rule, double u, double *out) {
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

/* Hand over the points at u with the weights of du. */
static void add_points(const PanelRule *rule, const Panel *panel, const Target *target, const double u[LANES],
                       const double weights[LANES], const Integrand *of) {
    double cardinals[rule->size][LANES], cardinal[rule->size];
    PanelPoints points = {.pairs = {.e2 = target->e2}, .cardinals = cardinals};
    for (int l = 0; l < LANES; l++) {
        double dx = 0.0, delta = 0.0; /* of differences: they keep their digits where the target is a node */
        fill_cardinals(rule, u[l], cardinal);
        for (int64_t j = 0; j < rule->size; j++) {
            cardinals[j][l] = cardinal[j];
            dx += cardinal[j] * (target->x - panel->x[j]);
            delta += cardinal[j] * (target->rho - panel->rho[j]);
        }
        points.pairs.dx[l] = dx;
        points.pairs.delta[l] = delta;
        points.pairs.rho[l] = target->rho;
        points.pairs.rho_s[l] = target->rho - delta;
        points.weights[l] = weights[l] * (target->rho - delta);
    }
    of->add(of->context, &points);
}

/* Part of a panel, on [-1, 1]. */
typedef struct {
    double low, high;
} Piece;

/* Over one piece by the finer rule; with is_crowded, u = centre + (low or high - centre) w^6: nodes crowd at a
 * logarithm at `centre`, one of its ends. */
static void add_piece(const PanelRule *rule, const Panel *panel, const Target *target, Piece piece, bool is_crowded,
                      double centre, const Integrand *of) {
    const double length = piece.high - piece.low, reach = centre == piece.low ? length : -length;
    double u[LANES], weights[LANES];
    for (int64_t first = 0; first < rule->fine_size; first += LANES) {
        for (int l = 0; l < LANES; l++) {
            const int64_t q = first + l < rule->fine_size ? first + l : rule->fine_size - 1;
            const double w = 0.5 * (1.0 + rule->fine[q]), w5 = is_crowded ? w * w * (w * w) * w : 1.0;
            u[l] = is_crowded ? centre + reach * (w5 * w) : piece.low + length * w;
            weights[l] = 0.5 * rule->fine_weights[q] * length * (is_crowded ? 6.0 * w5 : 1.0);
            if (first + l >= rule->fine_size) weights[l] = 0.0;
        }
        add_points(rule, panel, target, u, weights, of);
    }
}

/* Over the whole panel by its own nodes. */
static void add_far_panel(const PanelRule *rule, const Panel *panel, const Target *target, const Integrand *of) {
    double u[LANES], weights[LANES];
    for (int64_t first = 0; first < rule->size; first += LANES) {
        for (int l = 0; l < LANES; l++) {
            u[l] = rule->nodes[first + l < rule->size ? first + l : rule->size - 1];
            weights[l] = first + l < rule->size ? rule->weights[first + l] : 0.0;
        }
        add_points(rule, panel, target, u, weights, of);
    }
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

/* Whether the target is closer to a piece of a panel than the piece is long. */
static bool is_near(const PanelRule *rule, const Panel *panel, const Target *target, Piece piece) {
    const Target a = position(rule, panel, piece.low), b = position(rule, panel, piece.high);
    const Target m = position(rule, panel, 0.5 * (piece.low + piece.high));
    const double length = hypot(m.x - a.x, m.rho - a.rho) + hypot(b.x - m.x, b.rho - m.rho);
    const double distance = hypot(m.x - target->x, m.rho - target->rho);
    return distance * distance + target->e2 < 2.25 * length * length;
}

void integrate(const PanelRule *rule, const Panel *panel, const Target *target, double smallest, const Integrand *of) {
    Piece left[64] = {{-1.0, 1.0}};
    if (!is_near(rule, panel, target, left[0])) {
        add_far_panel(rule, panel, target, of);
        return;
    }
    for (int at = 0; at >= 0; at--) {
        while (at < 60 && left[at].high - left[at].low > smallest && is_near(rule, panel, target, left[at])) {
            const Piece whole = left[at];
            const double middle = 0.5 * (whole.low + whole.high);
            left[at++] = (Piece){middle, whole.high};
            left[at] = (Piece){whole.low, middle};
        }
        add_piece(rule, panel, target, left[at], false, left[at].low, of);
    }
}

/* Towards both ends, in pieces that double. */
void integrate_own(const PanelRule *rule, const Panel *panel, const Target *target, double u_0, const Integrand *of) {
    const double shorter = smaller(smaller(1.0 - u_0, 1.0 + u_0), 0.2);
    for (int side = -1; side <= 1; side += 2) {
        const double reach = 1.0 - side * u_0, step = smaller(shorter, reach);
        double done = 0.0;
        while (done < reach * (1.0 - 1e-12)) {
            double upto = done == 0.0 ? step : smaller(2.0 * done, reach);
            if (reach - upto < 0.3 * (upto - done)) upto = reach;
            const Piece piece = side > 0 ? (Piece){u_0 + done, u_0 + upto} : (Piece){u_0 - upto, u_0 - done};
            add_piece(rule, panel, target, piece, done == 0.0, u_0, of);
            done = upto;
        }
    }
}

/* Where the block of a panel stands among those of all: rows of 3 components, columns of 3 components of each node. */
typedef struct {
    double *first;
    int64_t row, mode, modes, nodes; /* from row to row, from mode to mode; numbers of modes and nodes */
} Block;

/* Add what unit densities on the nodes move by way of some points. */
static void add_to_block(const void *context, PanelPoints *points) {
    const Block *block = context;
    double a[block->modes + 1][LANES], b[block->modes + 1][LANES], k[9][LANES];
    open_rings(&points->pairs, block->modes + 1, a, b);
    for (int64_t m = 0; m < block->modes; m++) {
        fill_ring_mode(&points->pairs, m, a, b, k);
        for (int e = 0; e < 9; e++) {
            double *out = block->first + m * block->mode + e / 3 * block->row + e % 3;
            EACH_LANE k[e][l] *= points->weights[l];
            for (int64_t j = 0; j < block->nodes; j++) {
                double sum = 0.0;
                for (int l = 0; l < LANES; l++) sum += k[e][l] * points->cardinals[j][l];
                out[3 * j] += sum;
            }
        }
    }
}

/* Fill the velocities of every mode at rings, from a single layer on the panels of outlines.
 *
 * The density is interpolated between the panel's nodes and multiplied by the length of du, so that the integrals are
 * over rho du.
 *
 * x: targets; rho: targets; own: index of the node that a target is, panel by panel; -1 for a target off the outline;
 * x_p: nodes of the panels; rho_p: nodes of the panels; e2: square of the blob radius; nodes: on [-1, 1]; barycentric:
 * weights of the nodes; fine: abscissas of a finer Gauss rule, for panels near a target; fine_weights: their weights;
 * weights: Gauss weights of the nodes. */
EXPORT void layer_blocks(const double *x /* (targets) */, const double *rho /* (targets) */,
                         const int64_t *own /* (targets) */, const double *x_p /* (panels, size) */,
                         const double *rho_p /* (panels, size) */, double e2, const double *nodes /* (size) */,
                         const double *barycentric /* (size) */, const double *fine /* (fine_size) */,
                         const double *fine_weights /* (fine_size) */, const double *weights /* (size) */,
                         double *blocks /* (modes, targets, 3, panels, size, 3) */, int64_t targets, int64_t panels,
                         int64_t size, int64_t fine_size, int64_t modes) {
    const PanelRule rule = {size, nodes, barycentric, weights, fine_size, fine, fine_weights};
    const int64_t row = 3 * panels * size;
    memset(blocks, 0, (size_t)(modes * targets * 3 * row) * sizeof *blocks);
    for (int64_t i = 0; i < targets; i++) {
        const Target target = {x[i], rho[i], e2};
        for (int64_t q = 0; q < panels; q++) {
            const Panel panel = {x_p + q * size, rho_p + q * size};
            const Block block = {blocks + 3 * i * row + 3 * size * q, row, 3 * targets * row, modes, size};
            const Integrand of = {add_to_block, &block};
            if (own[i] >= 0 && own[i] / size == q) {
                integrate_own(&rule, &panel, &target, nodes[own[i] % size], &of);
            } else {
                integrate(&rule, &panel, &target, 1e-9, &of);
            }
        }
    }
}
