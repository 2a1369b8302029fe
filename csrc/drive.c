/* The law of a drive, see drive.h, and the steady states of a motor under a load. */
#include "drive.h"

static const double LARGEST_EXPONENT = 600.0; /* far currents are tried on the way to a root */
static const double LARGEST_START = 1e6;      /* largest current at which the search for the steady one starts, A */

/* R(|I|), ohm, and dR/d|I|, ohm/A. */
typedef struct {
    double resistance, slope;
} Winding;

static inline Winding winding_at(const Motor *m, double current) {
    const double size = fabs(current), falling = exp(-m->decay_rate * size);
    const double rising = exp(smaller(m->growth_rate * size, LARGEST_EXPONENT));
    return (Winding){
        .resistance = winding(m->constant, m->decay, falling, m->growth, rising, m->slope, size),
        .slope = -m->decay * m->decay_rate * falling + m->growth * m->growth_rate * rising + m->slope,
    };
}

double winding_resistance(const Motor *m, double current) { return winding_at(m, current).resistance; }

/* dI/dt of (17), A/s, at a rate of the joint, all in one sense. */
double current_rate(const Motor *m, double duty, double current, double rate) {
    const double supply = duty * (m->voltage - m->internal_resistance * fabs(current));
    return excess_voltage(supply, 0.0, winding_resistance(m, current), current, m->back_emf * rate) / m->inductance;
}

/* What decides the size i of a steady current: voltage that it takes less the one that drives it. */
typedef struct {
    const Motor *motor;
    double linear, drive;
} Search;

/* At a current: the former less the latter, V, and the next current of Newton's method. */
typedef struct {
    double excess, newton;
} Trial;

static inline Trial trial_at(const Search *s, double i) {
    const Winding w = winding_at(s->motor, i);
    const double excess = (w.resistance + s->linear) * i - s->drive;
    return (Trial){excess, i - excess / (w.resistance + s->linear + w.slope * i)};
}

/* Newton steps kept inside a bracket: while the motor drives there is a single root (the robot file is checked for it). */
static double root_of(const Search *s) {
    const Motor *m = s->motor;
    const double at_rest = m->constant + m->decay + m->growth + larger(s->linear, 0.0);
    /* A winding almost without resistance at rest would start beyond what 200 halvings come back from. */
    double i = smaller(s->drive / (at_rest > 0.0 ? at_rest : 1.0), LARGEST_START);
    double low = 0.0, high = 2.0 * i + 1e-12;
    Trial trial = trial_at(s, high);
    for (int n = 0; n < 60 && trial.excess < 0.0; n++) trial = trial_at(s, high *= 2.0);
    if (!(trial.excess >= 0.0)) return NAN; /* driven too fast: V(|I|) falls faster than R(I) I rises */
    double last = high - low;
    trial = trial_at(s, i);
    for (int n = 0; n < 200; n++) {
        *(trial.excess < 0.0 ? &low : &high) = i;
        /* Newton creeps along an exponential: a step that is not half the one before gives way to bisection. */
        const bool good = trial.newton >= low && trial.newton <= high && fabs(trial.newton - i) <= 0.5 * last;
        const double next = good ? trial.newton : 0.5 * (low + high);
        last = fabs(next - i);
        i = next;
        if (good && last <= 1e-9 * fabs(i)) return i; /* the error is the square of the step */
        trial = trial_at(s, i);
        if (!(last > 1e-9 * fabs(i))) break;
    }
    /* Where rounding led out of the bracket, the last step halved it. */
    return isfinite(trial.newton) ? clamped(trial.newton, low, high) : i;
}

/* Steady root of (17), A: R(I) I = d V(I) - (back-emf + back-emf per current I). Negative where the load drives the motor,
 * NaN where it does so beyond any root or beyond what the battery's voltage allows. */
EXPORT void steady_currents(const Loaded *cases /* (count) */, double *out /* (count) */, int64_t count) {
    for (int64_t n = 0; n < count; n++) {
        const Loaded *at = cases + n;
        const double left = at->duty * at->motor.voltage - at->back_emf, sense = left < 0.0 ? -1.0 : 1.0;
        const Search search
            = {&at->motor, at->back_emf_per_current + sense * at->duty * at->motor.internal_resistance, fabs(left)};
        const double i = root_of(&search);
        out[n] = at->motor.voltage - at->motor.internal_resistance * i < 0.0 ? NAN : sense * i;
    }
}

/* Fill R(|I|), ohm, and dR/d|I|, ohm/A, of motors at currents, A. */
EXPORT void windings(const Motor *motors /* (count) */, const double *currents /* (count) */,
                     double *out /* (count, 2) */, int64_t count) {
    for (int64_t n = 0; n < count; n++) {
        const Winding found = winding_at(motors + n, currents[n]);
        out[2 * n] = found.resistance;
        out[2 * n + 1] = found.slope;
    }
}

/* Piece behind a point of the curve, at a duty; that before the first point is level. */
Piece piece_of(const Curve *curve, int64_t number, double duty) {
    if (number < 0) return (Piece){duty * curve->at[0].torque, 0.0};
    const double rate = curve->at[number].rate, torque = curve->at[number].torque;
    const double slope = (curve->at[number + 1].torque - torque) / (curve->at[number + 1].rate - rate);
    return (Piece){duty * (torque - slope * rate), duty * slope};
}

/* The piece itself where it holds at the rate that was found with it, else its neighbour there: torques do not rise with
 * the rate, so that the solution lies on that side. */
int64_t next_piece(const Curve *curve, int64_t number, double rate) {
    const int64_t last = (int64_t)curve->points - 2;
    if (number < last && rate > curve->at[number + 1].rate) return number + 1;
    if (number >= 0 && rate < curve->at[number].rate) return number - 1;
    return number;
}

/* Torque of a motor whose rate is `coasting` without a torque, rad/s, and grows by `per_torque` with it, 1/(N m s). */
double curve_torque(const Curve *curve, double duty, double coasting, double per_torque) {
    double torque = NAN;
    for (int64_t number = -1, before = -2, n = 0; number != before && n < MOST_TRIALS; n++) {
        const Piece piece = piece_of(curve, before = number, duty);
        torque = (piece.torque + piece.slope * coasting) / (1.0 - piece.slope * per_torque);
        number = next_piece(curve, number, coasting + per_torque * torque);
    }
    return torque;
}

/* Fill the torques of a motor with a curve in its own sense, N m.
 *
 * curve: number of points, then rate, rad/s, and torque, N m, of each; of 25 numbers; coasting: rate of the joint
 * without a torque, rad/s; per_torque: what a torque adds to it, 1/(N m s); duty: 0 to 1; scales the torques. */
EXPORT void curve_torques(const Curve *curve, const double *coasting /* (count) */,
                          const double *per_torque /* (count) */, double duty, double *out /* (count) */,
                          int64_t count) {
    for (int64_t n = 0; n < count; n++) out[n] = curve_torque(curve, duty, coasting[n], per_torque[n]);
}
