/* Panels of an outline, and how they are halved towards a target; see panels.c. */
#ifndef SPIRILLUM_PANELS_H
#define SPIRILLUM_PANELS_H

#include "core.h"

/* Nodes on [-1, 1], their barycentric and Gauss weights, and a finer Gauss rule. */
typedef struct {
    int64_t size;
    const double *nodes, *barycentric, *weights;
    int64_t fine_size;
    const double *fine, *fine_weights;
} PanelRule;

/* x and rho at the nodes, m. */
typedef struct {
    const double *x, *rho;
} Panel;

/* A ring about the axis that panels act on, m; e2 is the square of the blob radius. */
typedef struct {
    double x, rho, e2;
} Target;

/* Part of a panel, on [-1, 1]. */
typedef struct {
    double low, high;
} Piece;

/* Halves of a panel that are still to be done. */
typedef struct {
    Piece pieces[64];
    int depth;
} Halving;

/* Lagrange polynomials of the nodes at u, in barycentric form. */
void fill_cardinals(const PanelRule *rule, double u, double *out);

/* Whether the target is closer to a piece of a panel than the piece is long. */
bool is_near(const PanelRule *rule, const Panel *panel, const Target *target, Piece piece);

/* The next piece that is shorter than its distance from the target, or than `smallest`, if any is left. */
bool has_next_piece(Halving *halving, const PanelRule *rule, const Panel *panel, const Target *target, double smallest,
                    Piece *piece);

#endif
