"""Errors of a table's resistance matrices, by the robot's response to its turning tail."""

from __future__ import annotations

import numpy as np

from spirillum.arrays import Samples

RESPONSES = {
    "forward_velocity": 0.01,
    "body_rotation_rate": 0.01,
    "sideways_force": 0.02,
    "pitching_torque": 0.03,
    "yawing_torque": 0.03,
    "normal_resistance": 0.05,
}
"""Quantities by which a table is judged, and the largest relative error that each should have."""


def response_of(matrix: Samples) -> Samples:
    """Response to a tail turning at 1 rad/s, constrained laterally and in tilt, closed ends, viscosity 1.

    Returns:
        Forward velocity, body rate, forces y and z, torques y and z of the fluid, and the normal resistance, (7,).
    """
    free = [0, 3]
    tail = matrix[:, 6]  # the rotor's lab rate is Omega + omega_m = 1
    a = matrix[np.ix_(free, free)] - np.outer(tail[free], [0.0, 1.0])
    speed, roll = np.linalg.solve(a, -tail[free])
    rates = np.zeros(len(matrix))
    rates[[0, 3, 6]] = speed, roll, 1.0 - roll
    force = -matrix @ rates
    return np.array([speed, roll, force[1], force[2], force[4], force[5], matrix[2, 2]])


def response_errors(matrix: Samples, true: Samples, turn: Samples | None = None) -> Samples:
    """Errors of `RESPONSES`, over the size of what acts on the robot, sideways force and torques over those in all.

    Args:
        matrix: the 8x8 judged.
        true: what it should be.
        turn: of the place at phases over a turn of the tail, (n, 8, 8): sizes are then root mean squares over them, for
            a force that nearly vanishes at one phase moves nothing; None: sizes are those of `true`.
    """
    a, b = response_of(matrix), response_of(true)
    sizes = np.stack([response_of(some) for some in (true[None] if turn is None else turn)])
    force, torque = (np.hypot(sizes[:, first], sizes[:, first + 1]) for first in (2, 4))
    of_each = np.stack([sizes[:, 0], sizes[:, 1], force, torque, torque, sizes[:, 6]])
    found: Samples = np.abs(a - b)[[0, 1, 2, 4, 5, 6]] / np.sqrt(np.mean(of_each**2, axis=1))
    return found


SOLIDS_ERROR = 2e-4
"""Relative error of the drag of a body in a tube at the coarsest tolerance of a table; see `docs/accuracy.md`."""
LARGEST_WIRE_ERROR = 0.0267
"""Of the forward velocity with `standard` wires against `high` ones: the largest of `benchmarks/tube_wires.py`, 2.42 %,
and a tenth more for other poses."""
