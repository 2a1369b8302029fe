"""Two rigid links that move together: columns of their arrays, which csrc/links.h has as structs."""

from __future__ import annotations

# The state.
POSITION, ATTITUDE = 0, 3  # of the origin in the lab, m; unit quaternion (w, x, y, z), body axes to lab
PHASE, ROLL = 7, 8  # tail angle phi against the body; integral of Omega_x, rad
CURRENT = 9  # I in the motor's own sense, A
ELECTRICAL, RESISTIVE, CONVERSION, CHARGE = 10, 11, 12, 13  # integrals of powers, J, and of the battery's current, A s
DRIVEN, FRICTION, DISSIPATED = 14, 15, 16  # work of the drive's torque on both links, and where it goes, J
CONTACT, FLOW = 17, 18  # work of dry friction, and of an imposed flow, J; zero outside a tube
STATES = 19

# What is observed: the seven rates first.
VELOCITY, ROTATION, JOINT = 0, 3, 6  # U, m/s; Omega_b, rad/s, body axes; omega_m, rad/s
DRIVE_TORQUE, FILM = 7, 8  # N m; thinnest film, m
FRICTION_POWER, DISSIPATED_POWER, DRIVE_POWER = 9, 10, 11  # W; the last of field and drive
PRESSED = 12  # energy of pressed roughness, J
OBSERVED = 13
TAIL_GAP, OUTSIDE = 18, 24  # what the integrator reads besides, see `tube_motion`
SEEN = 31  # places of all that is observed, wherever the robot swims

# The drive.
KIND, FIXED, DUTY = 0, 1, 2  # one of the kinds below; whether the joint is fixed; duty of the remote
GIVEN = 3  # prescribed torque, N m, or rate, rad/s
MOMENT, FIELD, FIELD_RATE = 3, 6, 7  # magnetic moment (3), A m^2; field, T; its rotation rate, rad/s
TORQUE_CONSTANT, BACK_EMF, INDUCTANCE = 8, 9, 10  # K_m, N m/A; K_b, V s/rad; L, H
CONSTANT, DECAY, DECAY_RATE, GROWTH, GROWTH_RATE, SLOPE = 11, 12, 13, 14, 15, 16  # of R(I), Table II
VOLTAGE, INTERNAL_RESISTANCE, POLARITY = 17, 18, 19  # of the battery, V and ohm; sign of the driven rate
AXIS_Y, AXIS_Z, FIELD_PHASE = 20, 21, 22  # of the field's axis, a unit vector, across the lab's x; at time 0, rad
CURVE_POINTS, CURVE_AT, MOST_POINTS = 23, 24, 12  # of torque against rate: their number; rate, rad/s, and torque, N m
DRIVE = 48
MOTOR, TORQUE, RATE, MAGNETIC, CURVE = 0.0, 1.0, 2.0, 3.0, 4.0  # kinds


# Weight: submerged weight of body and rotor, N, and first moments of the rest, N m, at phase 0.
WEIGHT_BODY, WEIGHT_ROTOR, MOMENT_BODY, MOMENT_ROTOR = 0, 1, 2, 5
WEIGHT = 8
