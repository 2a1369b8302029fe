/* Two rigid links that move together: their state, and what acts on them beside the fluid.
 *
 * Weight and buoyancy, the field on a magnetic moment, the drive's torque, the motor's current and the powers are the
 * same wherever the robot swims; a robot without walls (two_links.c) and one in its tube (tube_motion.c) differ in the
 * fluid, the wall and their solution. SI.
 */
#ifndef SPIRILLUM_LINKS_H
#define SPIRILLUM_LINKS_H

#include "drive.h"

enum { RATES = 7, SPIN = 3, JOINT = 6 }; /* q = (U, Omega_b, omega_m), body axes about the origin; Omega_x; omega_m */

typedef struct {
    double position[3];                       /* of the origin in the lab, m */
    double attitude[4];                       /* unit quaternion (w, x, y, z), body axes to lab */
    double phase, roll;                       /* tail angle phi against the body; integral of Omega_x, rad */
    double current;                           /* I in the motor's own sense, A */
    double electrical, resistive, conversion; /* integrals of powers, J */
    double charge;                            /* integral of the battery's current, A s */
    double driven, friction, dissipated;      /* work of the drive's torque on both links, and where it goes, J */
    double contact, flow;                     /* work of dry friction, and of an imposed flow, J; zero without a tube */
} State;

/* What is observed in a state; the last half in a tube alone. Its rates are where the next solution begins. */
typedef struct {
    double rates[RATES];       /* m/s; rad/s */
    double drive_torque, film; /* N m; thinnest film (in a tube: smallest gap of the body), m */
    double friction_power, dissipated_power, drive_power; /* W; the last of field and drive */
    double pressed;                                       /* energy of pressed roughness, J */
    double contact_force, contact_friction;               /* normal and tangential, sums over contacts, N */
    double contact_power, flow_power;                     /* lost to dry friction, and from the imposed flow, W */
    double mean_flow;                                     /* m/s */
    double tail_gap;                                      /* smallest gap of the wire where it is near the wall, m */
    double offset, azimuth, pitch, yaw, turn; /* e, A, p, psi; roll of the body against F; see tube_motion.c */
    double outside;                           /* 0 inside the table, else the range that was left */
    double balance;                           /* what the solution leaves of the forces, 1 */
    /* Forces towards the wall at the body's mid-length, N, which sum to zero: of weight and buoyancy, of the film, of the
     * fluid besides (the tail's side force, an imposed flow) and of the asperities. */
    double weight_load, film_load, outer_load, contact_load;
    double lift; /* what the bound of the film's pressure adds away from it, N */
} Seen;

enum { STATES = sizeof(State) / sizeof(double), SEEN = sizeof(Seen) / sizeof(double) };
enum { MOTOR, TORQUE, RATE, MAGNETIC, CURVE }; /* kinds of drives */

typedef struct {
    double kind, fixed, duty; /* one of the kinds; whether the joint is fixed; duty of the remote */
    union {
        double given;     /* prescribed torque, N m, or rate, rad/s */
        double moment[3]; /* magnetic moment, A m^2 */
    };
    double field, field_rate;           /* T; its rotation rate, rad/s */
    Motor motor;                        /* of a curve its polarity alone */
    double axis_y, axis_z, field_phase; /* of the field's axis, a unit vector, across the lab's x; at time 0, rad */
    Curve curve;
} Drive;

/* Submerged weight of body and rotor, N, and its first moments about the origin at phase 0, N m. */
typedef struct {
    double body, rotor;
    double moment_body[3], moment_rotor[3];
} Weight;

/* What both kinds of robots begin with. */
typedef struct {
    double friction[RATES][RATES]; /* of joint and wall, between Omega_x and omega_m only (`paper`: not symmetric) */
    Weight weight;
    Drive drive;
} Links;

static inline int driven_rate(const Drive *drive) { return drive->fixed != 0.0 ? SPIN : JOINT; }

void axes_of(const State *y, double rotation[3][3]);
void weight_loads(const Weight *weight, double phase, const double rotation[3][3], double force[RATES]);
void field_loads(const Drive *drive, double time, const double rotation[3][3], double force[RATES]);
void assemble(const double fluid[RATES][RATES], const Links *links, double a[RATES][RATES]);
double drive_torque(const Drive *drive, double current, const double free[RATES], const double per_torque[RATES]);
void note_powers(const double fluid[RATES][RATES], const Links *links, const double field[RATES], Seen *seen);
void turn_about_axis(const double *drag, double phase, double *out, int size);
void eliminate(double a[RATES][RATES], double b[RATES][2]);
void differentiate(const State *y, const Drive *drive, const double rotation[3][3], const Seen *seen, State *dy);

#endif
