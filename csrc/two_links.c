/* Two rigid links in a viscous fluid, weight and a wall: the rates of a robot's state.
 *
 * Unknowns are the seven rates (U, Omega_b, omega_m) in body axes about the origin. Forces balance without inertia:
 *
 *     [A(phi) + friction + sum_c k_c j_c j_c'] (U, Omega_b, omega_m) = weight + field + tau d
 *
 * with A(phi) the resistance of both links, constant in the tail's frame and turned with it; k_c the resistance of the
 * thin film at a point c of the surface against the speed j_c' V with which it nears the wall; and the drive's torque
 * tau along d: the joint, or the robot's axis where the joint is fixed.
 */
#include "motion.h"

TwoLinks two_links_opened(const double *packed, int64_t size) {
    const double *drag = packed + sizeof(Links) / sizeof(double), *wall = drag + RATES * RATES;
    const double *rings = wall + sizeof(Wall) / sizeof(double);
    return (TwoLinks){
        .links = (const Links *)packed,
        .drag = drag,
        .wall = (const Wall *)wall,
        .rings = (const Ring *)rings,
        .ring_count = (packed + size - rings) * (int64_t)sizeof(double) / (int64_t)sizeof(Ring),
    };
}

/* Film between the wall and the surface about one ring of the robot, m; its loss per rate goes into j.
 *
 * The ring of radius a is at x on the axis and has a half-length b along it (0 for an edge). With the ring's middle c
 * off the channel's axis, n = c/|c| across it and n_1 = n.e_1, the film is R - |c| - s less the roughness, where
 * s^2 = b^2 n_1^2 + a^2 (1 - n_1^2) is how far a spheroid with semi-axes b, a reaches along n. j is its gradient: with t
 * across n in the channel's section and s' = ds/dn_1,
 *
 *     j_U = n + s' (t.e_1)/|c| t,   j_Omega = s' e_1 x n + x e_1 x j_U */
EXPORT double film_of(const State *y, const double (*rotation)[3] /* (3, 3) */, const Wall *wall, const Ring *ring,
                      double j[6]) {
    double side = y->position[1] + rotation[1][0] * ring->x, up = y->position[2] + rotation[2][0] * ring->x;
    const double distance = hypot(side, up), a = ring->radius, b = ring->half;
    const bool near_axis = distance < 1e-12 * wall->radius;
    side = near_axis ? 0.0 : side / distance;
    up = near_axis ? -1.0 : up / distance;
    const double n_1 = rotation[1][0] * side + rotation[2][0] * up;
    const double reach = larger(sqrt(squared(b * n_1) + squared(a) * larger(1.0 - n_1 * n_1, 0.0)), 1e-12 * a);
    const double slope = (squared(b) - squared(a)) * n_1 / reach;
    const double turning = near_axis ? 0.0 : slope * (-rotation[1][0] * up + rotation[2][0] * side) / distance;
    double normal[3];
    for (int i = 0; i < 3; i++) {
        const double across = -rotation[1][i] * up + rotation[2][i] * side;
        normal[i] = rotation[1][i] * side + rotation[2][i] * up;
        j[i] = normal[i] + turning * across;
    }
    j[3] = 0.0;
    j[4] = -slope * normal[2] - ring->x * j[2];
    j[5] = slope * normal[1] + ring->x * j[1];
    return wall->radius - (near_axis ? 0.0 : distance) - reach - wall->roughness;
}

/* Resistance of a film, N s/m. */
static double film_resistance_of(const Ring *ring, const Wall *wall, double film) {
    const double share = film / ring->reach;
    const double thinner = ring->power == 1.5 ? 1.0 / (share * sqrt(share)) : 1.0 / share;
    return smaller(ring->resistance * (thinner - 1.0), wall->stiffest);
}

/* Add the films' resistance to the fluid's and the roughness's pressure to the force; note film and pressed energy.
 *
 * Films are counted from the tips of the roughness s. Thinner than s, these are pressed together, with the force
 * N (s/h - 1) and the energy N (s log(s/h) - s + h) for a load N of the robot's order. */
static void add_films(const TwoLinks *robot, const State *y, const double rotation[3][3], double fluid[RATES][RATES],
                      double force[RATES], Seen *seen) {
    const double rough = robot->wall->roughness, load = robot->wall->load;
    seen->film = INFINITY;
    seen->pressed = 0.0;
    for (const Ring *ring = robot->rings; ring < robot->rings + robot->ring_count; ring++) {
        double j[6], film = film_of(y, rotation, robot->wall, ring, j), pressed = 0.0;
        seen->film = smaller(seen->film, film);
        if (film >= ring->reach) continue;
        film = larger(film, 1e-9 * rough);
        const double k = film_resistance_of(ring, robot->wall, film);
        if (film < rough) {
            pressed = load * (rough / film - 1.0);
            seen->pressed += load * (rough * log(rough / film) - rough + film);
        }
        for (int i = 0; i < 6; i++) { /* a ring about the motor axis is pushed without a torque about it */
            force[i] -= pressed * j[i];
            const double pushed = k * j[i];
            for (int m = 0; m < 6; m++) fluid[i][m] += pushed * j[m];
        }
    }
}

/* Write what is observed in a state, and its time derivative. */
void two_links_rates(const TwoLinks *robot, const State *y, double time, Seen *seen, State *dy) {
    const Drive *drive = &robot->links->drive;
    const int along = driven_rate(drive);
    double rotation[3][3], fluid[RATES][RATES], a[RATES][RATES], b[RATES][2], force[RATES], field[RATES];
    axes_of(y, rotation);
    turn_about_axis(robot->drag, y->phase, &fluid[0][0], RATES);
    weight_loads(&robot->links->weight, y->phase, rotation, force);
    add_films(robot, y, rotation, fluid, force, seen);
    assemble(fluid, robot->links, a);
    field_loads(drive, time, rotation, field);
    if (drive->fixed != 0.0) force[JOINT] = 0.0;
    for (int i = 0; i < RATES; i++) {
        b[i][0] = force[i] + field[i];
        b[i][1] = i == along ? 1.0 : 0.0;
    }
    eliminate(a, b); /* the joint's rate is 0 where it is fixed */
    double free[RATES], per_torque[RATES];
    for (int i = 0; i < RATES; i++) {
        free[i] = b[i][0];
        per_torque[i] = b[i][1];
    }
    const double torque = drive_torque(drive, y->current, free, per_torque);
    for (int i = 0; i < RATES; i++) seen->rates[i] = free[i] + torque * per_torque[i];
    seen->drive_torque = torque;
    seen->tail_gap = INFINITY;
    seen->outside = 0.0;
    note_powers(fluid, robot->links, field, seen);
    differentiate(y, drive, rotation, seen, dy);
}

/* Thinnest film between the wall and the robot, from the tips of the roughness, m; infinite without a wall. */
double two_links_film(const TwoLinks *robot, const State *y) {
    double rotation[3][3], j[6], thinnest = INFINITY;
    axes_of(y, rotation);
    for (const Ring *ring = robot->rings; ring < robot->rings + robot->ring_count; ring++)
        thinnest = smaller(thinnest, film_of(y, rotation, robot->wall, ring, j));
    return thinnest;
}
