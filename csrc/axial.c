/* Robots that are constrained to axial motion: the motor's current (17), many robots at a time, and dry friction.
 *
 * While duty and flow stay, the current I obeys one equation of its own,
 *
 *     L dI/dt = p d V(|I|) - R(|I|) I - K_b (s K_m I + c U_m),
 *
 * with duty d, polarity p, the motor rates s per torque and c per imposed flow U_m. Position, angles, charge and energies
 * are linear in its integrals and those of I^2 and R I^2. A step is cut into pieces of the classical Runge-Kutta method
 * of order 4, whose lengths grow evenly: what is fast lies behind a change of the inputs, hence at the start of a step.
 * From where the current is steady to 1e-12 on, the rest of a step is exact. Robots are advanced in blocks whose loops
 * the processor's vector units take, which is why the exponentials of R(I) are polynomials here.
 *
 * Products and sums are fused where the processor can: a million robots take two thirds of the time.
 */
#if defined(__clang__)
#pragma clang fp contract(fast)
#if defined(__AVX2__)
#pragma clang attribute push(__attribute__((target("fma"))), apply_to = function)
#endif
#elif defined(__GNUC__)
#pragma GCC optimize("fp-contract=fast")
#if defined(__AVX2__)
#pragma GCC target("fma")
#endif
#endif
#include "axial.h"

enum { BLOCK = 64 };                    /* robots of one block: their columns stay in the processor's cache */
static const double PER_CONSTANT = 2.0; /* pieces of a step for each time constant L/R of the motor at rest */
static const double FEWEST = 28.0;      /* and besides; errors below 1e-6 (tested) */
static const double MOST = 1e12;
static const double GROWTH = 3.0, GROWTH_PER = 0.25; /* the last piece over the first, less 1: at most, per constant */
enum { LOOK = 8 };                                   /* pieces between two looks whether the currents are steady */
static const double STEADY = 1e-12; /* relative change within the shortest time constant of a steady current */
static const double LEAST = 1e-3;   /* a current is at least so large here, A */

/* exp(x) for -40 < x < 30, to 2e-8 of the larger of it and 1, as the 32nd power of a polynomial. */
static inline double exponential(double x) {
    const double z = clamped(x, -40.0, 30.0) * 0.03125;
    double y = 1.0 / 720
             + z * (1.0 / 5040 + z * (1.0 / 40320 + z * (1.0 / 362880 + z * (1.0 / 3628800 + z * (1.0 / 39916800)))));
    y = 1.0 + z * (1.0 + z * (1.0 / 2 + z * (1.0 / 6 + z * (1.0 / 24 + z * (1.0 / 120 + z * y)))));
    y *= y;
    y *= y;
    y *= y;
    y *= y;
    return y * y;
}

/* A block of robots: coefficients of (17) over L, and what is integrated. */
typedef struct {
    double always[BLOCK]; /* resistance at rest, with back-emf, over L */
    double falling[BLOCK], fall[BLOCK], rising[BLOCK], rise[BLOCK], bend[BLOCK], supply[BLOCK], sag[BLOCK];
    double current[BLOCK], charge[BLOCK], squares[BLOCK], heat[BLOCK];
} Block;

/* The resistance that dI/dt rests on, back-emf included, over L. */
static inline double resistance(const Block *b, int64_t k, double i) {
    const double size = fabs(i);
    return winding(b->always[k], b->falling[k], exponential(b->fall[k] * size), b->rising[k],
                   exponential(b->rise[k] * size), b->bend[k], size);
}

static inline double slope(const Block *b, int64_t k, double i, double r) {
    return excess_voltage(b->supply[k], b->sag[k], r, i, 0.0);
}

/* Fill a block; the largest rate L/R among its robots, 1/s. */
static double open_block(Block *b, const Axial *robots, const AxialState *states, const double *duty,
                         const double *flow, int64_t width) {
    double fastest = 0.0;
    for (int64_t k = 0; k < width; k++) {
        const Axial *p = robots + k;
        const Motor *m = &p->motor;
        const double over = 1.0 / m->inductance, slip = p->tail - p->body;
        const double driven = m->polarity * duty[k] / m->inductance;
        b->always[k] = (m->constant + m->back_emf * slip * m->torque_constant) * over;
        b->falling[k] = m->decay * over;
        b->fall[k] = -m->decay_rate;
        b->rising[k] = m->growth * over;
        b->rise[k] = m->growth_rate;
        b->bend[k] = m->slope * over;
        b->sag[k] = driven * m->internal_resistance;
        b->supply[k] = driven * m->voltage - m->back_emf * (p->tail_flow - p->body_flow) * flow[k] * over;
        b->current[k] = states[k].current;
        b->charge[k] = b->squares[k] = b->heat[k] = 0.0;
        fastest = larger(fastest, b->always[k] + b->falling[k] + b->rising[k] + fabs(b->sag[k]));
    }
    return fastest;
}

static bool is_steady(const Block *b, int64_t width, double fastest) {
    for (int64_t k = 0; k < width; k++) {
        const double i = b->current[k];
        if (fabs(slope(b, k, i, resistance(b, k, i))) > STEADY * fastest * larger(fabs(i), LEAST)) return false;
    }
    return true;
}

/* One piece of the classical Runge-Kutta method, and the integrals over it. */
static void take_piece(Block *restrict b, int64_t width, double h) {
    const double half = 0.5 * h, sixth = h / 6.0;
    for (int64_t k = 0; k < width; k++) {
        const double i = b->current[k], r1 = resistance(b, k, i), k1 = slope(b, k, i, r1);
        const double i2 = i + half * k1, r2 = resistance(b, k, i2), k2 = slope(b, k, i2, r2);
        const double i3 = i + half * k2, r3 = resistance(b, k, i3), k3 = slope(b, k, i3, r3);
        const double i4 = i + h * k3, r4 = resistance(b, k, i4), k4 = slope(b, k, i4, r4);
        const double s1 = i * i, s2 = i2 * i2, s3 = i3 * i3, s4 = i4 * i4;
        b->charge[k] += sixth * (i + 2.0 * (i2 + i3) + i4);
        b->squares[k] += sixth * (s1 + 2.0 * (s2 + s3) + s4);
        b->heat[k] += sixth * (r1 * s1 + 2.0 * (r2 * s2 + r3 * s3) + r4 * s4);
        b->current[k] = i + sixth * (k1 + 2.0 * (k2 + k3) + k4);
    }
}

/* Integrate a block over dt; the time at its end during which the currents are steady. */
static double integrate_block(Block *b, int64_t width, double dt, double fastest, double fineness) {
    const double constants = dt * fastest;
    const int64_t pieces = (int64_t)smaller(ceil(fineness * (PER_CONSTANT * constants + FEWEST)), MOST);
    const double growth = smaller(GROWTH, GROWTH_PER * constants);
    const double first = dt / ((double)pieces + 0.5 * growth * (double)(pieces - 1));
    double done = 0.0;
    for (int64_t piece = 0; piece < pieces; piece++) {
        if (piece % LOOK == 0 && is_steady(b, width, fastest)) return dt - done;
        const double h = first * (1.0 + growth * (double)piece / (double)pieces);
        done += h;
        take_piece(b, width, h);
    }
    return 0.0;
}

/* Add a step to a robot, whose current was steady during `rest` at its end; `carried` is the way of the fluid. */
static void close_step(const Block *b, int64_t k, const Axial *p, AxialState *state, double duty, double carried,
                       double rest) {
    const double i = b->current[k], charge = b->charge[k] + i * rest, squares = b->squares[k] + i * i * rest;
    const double loss = b->heat[k] + resistance(b, k, i) * i * i * rest; /* all resistance times I^2, over L */
    const double impulse = p->motor.torque_constant * charge;
    const double emf = p->motor.back_emf * (p->tail - p->body) * p->motor.torque_constant;
    state->current = i;
    state->position += p->speed * impulse + p->speed_flow * carried;
    state->tail_angle += p->tail * impulse + p->tail_flow * carried;
    state->body_angle += p->body * impulse + p->body_flow * carried;
    state->charge += p->motor.polarity * duty * charge;
    state->squared_current += squares;
    state->heat += p->motor.inductance * loss - emf * squares;
}

/* Take robots over a time, each at its own duty and flow.
 *
 * states: changed in place, NaN where duty, flow or robots have none;
 * dt: s, positive; duty: 0 to 1; flow: imposed mean flow, m/s; fineness: number of pieces, relative to the normal one. */
EXPORT void advance_axial(const Axial *robots /* (count) */, AxialState *states /* (count) */, double dt,
                          const double *duty /* (count) */, const double *flow /* (count) */, double fineness,
                          int64_t count) {
    Block block;
    for (int64_t low = 0; low < count; low += BLOCK) {
        const int64_t width = count - low < BLOCK ? count - low : BLOCK;
        const Axial *own = robots + low;
        AxialState *state = states + low;
        const double fastest = open_block(&block, own, state, duty + low, flow + low, width);
        const double rest = integrate_block(&block, width, dt, fastest, fineness);
        for (int64_t k = 0; k < width; k++)
            close_step(&block, k, own + k, state + k, duty[low + k], flow[low + k] * dt, rest);
    }
}

/* The same of robots whose motor has a curve, see `curve_torques`: its torque, N m, stands in place of the current, with a
 * torque constant of 1. It is constant over a step. */
EXPORT void advance_on_curve(const Axial *robots /* (count) */, AxialState *states /* (count) */, double dt,
                             const double *duty /* (count) */, const double *flow /* (count) */, const Curve *curve,
                             int64_t count) {
    for (int64_t n = 0; n < count; n++) {
        const Axial *p = robots + n;
        AxialState *state = states + n;
        const double sense = p->motor.polarity, coasting = sense * (p->tail_flow - p->body_flow) * flow[n];
        const double torque = sense * curve_torque(curve, duty[n], coasting, p->tail - p->body);
        state->current = torque;
        state->position += (p->speed * torque + p->speed_flow * flow[n]) * dt;
        state->tail_angle += (p->tail * torque + p->tail_flow * flow[n]) * dt;
        state->body_angle += (p->body * torque + p->body_flow * flow[n]) * dt;
        state->squared_current += torque * torque * dt;
    }
}

/* Derivative of the state of one robot at a current, A, a duty and an imposed mean flow, m/s. */
EXPORT void axial_rates(const Axial *robot, double current, double duty, double flow, AxialState *out) {
    const Motor *m = &robot->motor;
    const double torque = m->torque_constant * current, square = current * current;
    const double tail = robot->tail * torque + robot->tail_flow * flow,
                 body = robot->body * torque + robot->body_flow * flow;
    *out = (AxialState){
        .current = m->polarity * current_rate(m, duty, m->polarity * current, m->polarity * (tail - body)),
        .position = robot->speed * torque + robot->speed_flow * flow,
        .tail_angle = tail,
        .body_angle = body,
        .charge = m->polarity * duty * current,
        .squared_current = square,
        .heat = winding_resistance(m, current) * square,
    };
}

/* Smoothed sliding speed of a body with a drag at its lowest point, m/s; r is (U, Omega, omega), the tail's rate given. */
static double sliding_speed(const double r[3][3], double drag, double radius, double rate, double slow) {
    const double a = r[0][0] + drag, b = r[0][1];
    const double c = r[1][0] + r[2][0], d = r[1][1] + r[2][1] + drag * radius * radius;
    const double e = r[0][2] * rate, f = (r[1][2] + r[2][2]) * rate, determinant = a * d - b * c;
    const double u = (b * f - d * e) / determinant, spin = (c * e - a * f) / determinant;
    return sqrt(u * u + radius * radius * spin * spin + slow * slow);
}

/* Drag k = force/s of dry friction at a contact that slides at s, N s/m: k s(k) grows with k, so its logarithm is
 * bisected between free sliding and sticking.
 *
 * resistances: resistance of the whole robot against U, Omega and omega; force: mu_c N, N; radius: of the body, m;
 * rate: omega of the tail, rad/s; smooth: v_r over the speed of a body that turns as fast as its tail. */
EXPORT void contact_drag(const double *resistances /* (count, 3, 3) */, const double *force /* (count) */,
                         const double *radius /* (count) */, const double *rate /* (count) */, double smooth,
                         double *out /* (count) */, int64_t count) {
    const double (*r)[3][3] = (const double (*)[3][3])resistances;
    for (int64_t n = 0; n < count; n++) {
        const double slow = smooth * radius[n] * fabs(rate[n]);
        out[n] = 0.0 * force[n];
        if (!(force[n] > 0.0 && slow > 0.0)) continue;
        double low = force[n] / sliding_speed(r[n], 0.0, radius[n], rate[n], slow), high = force[n] / slow;
        for (int step = 0; step < 80 && high - low > 1e-14 * high; step++) {
            const double k = sqrt(low * high);
            if (k * sliding_speed(r[n], k, radius[n], rate[n], slow) > force[n])
                high = k;
            else
                low = k;
        }
        out[n] = sqrt(low * high);
    }
}

#if defined(__clang__) && defined(__AVX2__)
#pragma clang attribute pop
#endif
