"""The law of a drive, (17) or a curve of torque against rate, and robots in axial motion: csrc/drive.c, axial.c."""

from __future__ import annotations

# A motor under a load: the 12 numbers of a motor as in `axial_motor`, then duty, back-emf, V, and its slope, V/A.
MOTOR, LOADED = 12, 15
MOST_POINTS = 12
"""Points of a curve at most."""


# Parameters of one robot, SI; torques and rates at the joint.
TORQUE, EMF, INDUCTANCE = 0, 1, 2  # K_m, N m/A; K_b, V s/rad; L, H
CONSTANT, DECAY, DECAY_RATE, GROWTH, GROWTH_RATE, SLOPE = 3, 4, 5, 6, 7, 8  # R(I) of Table II
VOLTAGE, INTERNAL, POLARITY = 9, 10, 11  # V(I) of Table II; sign of the driven rate about +x
SPEED, BODY, TAIL = 12, 13, 14  # U, Omega, omega per joint torque
SPEED_FLOW, BODY_FLOW, TAIL_FLOW = 15, 16, 17  # U, Omega, omega per imposed mean flow
PARAMETERS = 18

# The state of one robot.
CURRENT, POSITION, TAIL_ANGLE, BODY_ANGLE, CHARGE = 0, 1, 2, 3, 4
SQUARE, HEAT = 5, 6  # integrals of I^2, A^2 s, and of R I^2, J
STATES = 7
