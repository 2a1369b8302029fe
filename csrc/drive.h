/* The law of a drive: what torque a motor gives at its rate. Runs, batches, steady states and FMUs take it from here.
 *
 * A DC-motor with battery obeys (17), with R(I) and V(I) of Table II, in its own sense:
 *
 *     L dI/dt = d V(|I|) - R(|I|) I - K_b omega_m,   V = V_0 - R_i |I|,
 *     R = constant + decay exp(-decay_rate |I|) + growth exp(growth_rate |I|) + slope |I|,   torque K_m I
 *
 * with duty d. Any other motor is a curve of torque against rate, straight between its points; a duty scales its torque.
 */
#ifndef SPIRILLUM_DRIVE_H
#define SPIRILLUM_DRIVE_H

#include "core.h"

/* SI; torques and rates at the joint. */
typedef struct {
    double torque_constant, back_emf, inductance;                   /* K_m, N m/A; K_b, V s/rad; L, H */
    double constant, decay, decay_rate, growth, growth_rate, slope; /* of R(I) */
    double voltage, internal_resistance;                            /* V_0, V; R_i, ohm */
    double polarity;                                                /* sign of the driven rate about +x */
} Motor;

/* A motor under a load: back-emf without a current, V, and what a current adds to it, V/A. */
typedef struct {
    Motor motor;
    double duty, back_emf, back_emf_per_current;
} Loaded;

enum { MOST_POINTS = 12, MOST_TRIALS = MOST_POINTS + 2 }; /* at a point rounding may lead to and fro */

/* Torque against rate in the motor's own sense: rates rise from 0, torques do not, and the last one is 0. The first torque
 * holds for a motor that is turned backwards, the last piece goes on beyond its end, where the motor brakes. */
typedef struct {
    double points;
    struct {
        double rate, torque; /* rad/s; N m */
    } at[MOST_POINTS];
} Curve;

/* A straight piece of a curve: torque without a rate, N m, and its change with the rate, N m s. */
typedef struct {
    double torque, slope;
} Piece;

/* R, ohm, from its terms and both exponentials (other files take coarser ones). */
static inline double winding(double constant, double decay, double falling, double growth, double rising, double slope,
                             double size) {
    return constant + decay * falling + growth * rising + slope * size;
}

/* L dI/dt of (17), V, from d V_0 and d R_i. */
static inline double excess_voltage(double supply, double sag, double resistance, double current, double emf) {
    return supply - sag * fabs(current) - resistance * current - emf;
}

double winding_resistance(const Motor *motor, double current);
double current_rate(const Motor *motor, double duty, double current, double rate);
Piece piece_of(const Curve *curve, int64_t number, double duty);
int64_t next_piece(const Curve *curve, int64_t number, double rate);
double curve_torque(const Curve *curve, double duty, double coasting, double per_torque);

#endif
