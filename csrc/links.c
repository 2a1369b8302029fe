/* What acts on two rigid links beside the fluid, their motor, and the derivative of their state. */
#include "links.h"

/* Rotation matrix, body axes to lab, of the state's quaternion made a unit one. */
void axes_of(const State *y, double rotation[3][3]) {
    const double w = y->attitude[0], i = y->attitude[1], j = y->attitude[2], k = y->attitude[3];
    const double s = 2.0 / (w * w + i * i + j * j + k * k);
    rotation[0][0] = 1 - s * (j * j + k * k);
    rotation[0][1] = s * (i * j - k * w);
    rotation[0][2] = s * (i * k + j * w);
    rotation[1][0] = s * (i * j + k * w);
    rotation[1][1] = 1 - s * (i * i + k * k);
    rotation[1][2] = s * (j * k - i * w);
    rotation[2][0] = s * (i * k - j * w);
    rotation[2][1] = s * (j * k + i * w);
    rotation[2][2] = 1 - s * (i * i + j * j);
}

/* Generalised force of weight and buoyancy on both links. */
void weight_loads(const Weight *weight, double phase, const double rotation[3][3], double force[RATES]) {
    const double down[3] = {-rotation[2][0], -rotation[2][1], -rotation[2][2]};
    const double c = cos(phase), s = sin(phase);
    const double *body = weight->moment_body, *rotor = weight->moment_rotor;
    const double rotor_y = c * rotor[1] - s * rotor[2], rotor_z = s * rotor[1] + c * rotor[2];
    const double x = body[0] + rotor[0], y = body[1] + rotor_y, z = body[2] + rotor_z;
    const double total = weight->body + weight->rotor;
    for (int i = 0; i < 3; i++) force[i] = total * down[i];
    force[3] = y * down[2] - z * down[1];
    force[4] = z * down[0] - x * down[2];
    force[5] = x * down[1] - y * down[0];
    force[6] = rotor_y * down[2] - rotor_z * down[1];
}

/* The field in the lab at a time, s, in T: it turns about its axis n, at right angles to it.
 *
 * About x it is b = B (0, -sin a, cos a), a = rate t + phase, up at a = 0. The least rotation that takes x to n takes
 * it to b - n.b (x + n)/(1 + n_x). */
EXPORT void field_at(double time, const Drive *drive, double *out /* (3) */) {
    const double angle = drive->field_rate * time + drive->field_phase;
    const double along = -drive->field * sin(angle), up = drive->field * cos(angle);
    const double n_y = drive->axis_y, n_z = drive->axis_z, n_x = sqrt(1.0 - n_y * n_y - n_z * n_z);
    const double share = (n_y * along + n_z * up) / (1.0 + n_x);
    out[0] = -share * (1.0 + n_x);
    out[1] = along - share * n_y;
    out[2] = up - share * n_z;
}

/* Torque m x B of a field B that turns about its axis; m is fixed in the body. */
void field_loads(const Drive *drive, double time, const double rotation[3][3], double force[RATES]) {
    for (int i = 0; i < RATES; i++) force[i] = 0.0;
    if (drive->kind != MAGNETIC || !(drive->duty > 0.0)) return;
    double field[3], b[3];
    field_at(time, drive, field);
    for (int i = 0; i < 3; i++)
        b[i] = rotation[0][i] * field[0] + rotation[1][i] * field[1] + rotation[2][i] * field[2];
    const double *m = drive->moment;
    force[3] = m[1] * b[2] - m[2] * b[1];
    force[4] = m[2] * b[0] - m[0] * b[2];
    force[5] = m[0] * b[1] - m[1] * b[0];
}

/* The matrix of the balance; friction is between Omega_x and omega_m only. */
void assemble(const double fluid[RATES][RATES], const Links *links, double a[RATES][RATES]) {
    for (int i = 0; i < RATES; i++)
        for (int j = 0; j < RATES; j++) a[i][j] = fluid[i][j];
    for (int i = SPIN; i <= JOINT; i += JOINT - SPIN) {
        a[i][SPIN] += links->friction[i][SPIN];
        a[i][JOINT] += links->friction[i][JOINT];
    }
    if (links->drive.fixed == 0.0) return;
    for (int i = 0; i < RATES; i++) a[JOINT][i] = a[i][JOINT] = 0.0;
    a[JOINT][JOINT] = 1.0;
}

/* Torque of the drive along its direction, N m; the rates without that torque, and what the torque adds to each. */
double drive_torque(const Drive *drive, double current, const double free[RATES], const double per_torque[RATES]) {
    const double sense = drive->motor.polarity;
    if (drive->kind == MOTOR) return sense * drive->motor.torque_constant * current;
    if (drive->kind == CURVE)
        return sense * curve_torque(&drive->curve, drive->duty, sense * free[JOINT], per_torque[JOINT]);
    if (drive->kind == TORQUE) return drive->duty * drive->given;
    if (drive->kind == RATE && drive->duty > 0.0)
        return (drive->given - free[SPIN] - free[JOINT]) / (per_torque[SPIN] + per_torque[JOINT]);
    return 0.0;
}

/* Powers of friction, of the fluid, and of field and drive, from the rates and the drive's torque. */
void note_powers(const double fluid[RATES][RATES], const Links *links, const double field[RATES], Seen *seen) {
    const double *q = seen->rates;
    double dissipated = 0.0, worked = seen->drive_torque * q[driven_rate(&links->drive)];
    for (int i = 0; i < RATES; i++) {
        double against = 0.0;
        for (int m = 0; m < RATES; m++) against += fluid[i][m] * q[m];
        worked += field[i] * q[i];
        dissipated += q[i] * against;
    }
    const double *of_spin = links->friction[SPIN], *of_joint = links->friction[JOINT];
    seen->friction_power = q[SPIN] * (of_spin[SPIN] * q[SPIN] + of_spin[JOINT] * q[JOINT]);
    seen->friction_power += q[JOINT] * (of_joint[SPIN] * q[SPIN] + of_joint[JOINT] * q[JOINT]);
    seen->dissipated_power = dissipated;
    seen->drive_power = worked;
}

/* A(phi) = Q A(0) Q' with Q the rotation by phi about x of velocities and of rotations, 7x7 or larger. */
void turn_about_axis(const double *drag, double phase, double *out, int size) {
    const double c = cos(phase), s = sin(phase);
    for (int i = 0; i < size * size; i++) out[i] = drag[i];
    for (int first = 1; first < 7; first += 3)
        for (int i = 0; i < size; i++) {
            double *row = out + i * size + first;
            const double a = row[0], b = row[1];
            row[0] = c * a - s * b;
            row[1] = s * a + c * b;
        }
    for (int first = 1; first < 7; first += 3)
        for (int j = 0; j < size; j++) {
            double *column = out + first * size + j;
            const double a = column[0], b = column[size];
            column[0] = c * a - s * b;
            column[size] = s * a + c * b;
        }
}

/* Solve a x = b (two right-hand sides) in place by elimination. No pivots: the symmetric part of a is positive definite. */
void eliminate(double a[RATES][RATES], double b[RATES][2]) {
    for (int k = 0; k < RATES; k++) {
        a[k][k] = 1.0 / a[k][k];
        for (int i = k + 1; i < RATES; i++) {
            const double factor = a[i][k] * a[k][k];
            for (int j = k + 1; j < RATES; j++) a[i][j] -= factor * a[k][j];
            b[i][0] -= factor * b[k][0];
            b[i][1] -= factor * b[k][1];
        }
    }
    for (int i = RATES - 1; i >= 0; i--) {
        for (int j = i + 1; j < RATES; j++) {
            b[i][0] -= a[i][j] * b[j][0];
            b[i][1] -= a[i][j] * b[j][1];
        }
        b[i][0] *= a[i][i];
        b[i][1] *= a[i][i];
    }
}

/* Motor current (17) and its integrals; `rate` is that of the joint in the motor's own sense. */
static void differentiate_motor(const Drive *drive, double current, double rate, State *dy) {
    const Motor *m = &drive->motor;
    dy->current = current_rate(m, drive->duty, current, rate);
    dy->electrical = drive->duty * (m->voltage - m->internal_resistance * fabs(current)) * current;
    dy->resistive = winding_resistance(m, current) * current * current;
    dy->conversion = (m->back_emf - m->torque_constant) * rate * current;
    dy->charge = drive->duty * current;
}

/* Time derivative of a state from its rates and powers. */
void differentiate(const State *y, const Drive *drive, const double rotation[3][3], const Seen *seen, State *dy) {
    const double *u = seen->rates, *turn = seen->rates + SPIN;
    const double w = y->attitude[0], i = y->attitude[1], j = y->attitude[2], k = y->attitude[3];
    *dy = (State){
        .attitude = {0.5 * (-i * turn[0] - j * turn[1] - k * turn[2]), 0.5 * (w * turn[0] + j * turn[2] - k * turn[1]),
                     0.5 * (w * turn[1] + k * turn[0] - i * turn[2]), 0.5 * (w * turn[2] + i * turn[1] - j * turn[0])},
        .phase = u[JOINT],
        .roll = u[SPIN],
        .driven = seen->drive_power,
        .friction = seen->friction_power,
        .dissipated = seen->dissipated_power,
        .contact = seen->contact_power,
        .flow = seen->flow_power,
    };
    for (int n = 0; n < 3; n++) dy->position[n] = rotation[n][0] * u[0] + rotation[n][1] * u[1] + rotation[n][2] * u[2];
    if (drive->kind == MOTOR) differentiate_motor(drive, y->current, drive->motor.polarity * u[JOINT], dy);
}
