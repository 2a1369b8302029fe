/* Quadrature over panels of an outline; see panels.c. */
#ifndef SPIRILLUM_PANELS_H
#define SPIRILLUM_PANELS_H

#include "rings.h"

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

/* Points of a quadrature over a panel, with the target: weights are those of rho du, zero in lanes that are free;
 * `cardinals` are the Lagrange polynomials of the nodes there, (nodes, LANES). */
typedef struct {
    RingPairs pairs;
    double weights[LANES], (*cardinals)[LANES];
} PanelPoints;

/* What is done at the points. */
typedef struct {
    void (*add)(const void *context, PanelPoints *points);
    const void *context;
} Integrand;

/* Integrate over a panel that the target lies off. Where it is close, the panel is halved until each piece is shorter
 * than its distance, or than `smallest`. */
void integrate(const PanelRule *rule, const Panel *panel, const Target *target, double smallest, const Integrand *of);

/* Over the panel that the target lies on, at u_0. */
void integrate_own(const PanelRule *rule, const Panel *panel, const Target *target, double u_0, const Integrand *of);

#endif
