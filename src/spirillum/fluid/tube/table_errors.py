"""Errors of a table's resistance matrices and of the wire resolution `standard`, on which tables are based.

`response_errors` compares matrices by the robot's response to its turning tail. `wire_error` compares `standard` with
`high` wires: a new table at one node, the shipped ones in `benchmarks/tube_wires.py`, level at a gap of 0.4 mm.
"""

from __future__ import annotations

import math

import numpy as np

from spirillum.arrays import Samples
from spirillum.fluid.wire.robot_geometry import RobotGeometry

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


_PLACES = 1.1
"""Largest error at other poses, pitched by up to 3 degrees and at gaps from 0.3 mm up to the axis, over that one."""
SOLIDS_ERROR = 2e-4
"""Relative error of the drag of a body in a tube at the coarsest tolerance of a table; see `docs/accuracy.md`."""
_LEAST = 0.005
"""Least relative error there: where errors of thrust and drag nearly cancel, their sum depends more on the pose."""
_LENGTH, _WIRE = 60.0, 1.0  # of all that were measured, mm
_MEASURED: dict[float, dict[tuple[float, float], float]] = {
    40.0: {
        (25.0, 1.5): 2.02,
        (25.0, 2.0): 1.67,
        (25.0, 2.5): 1.34,
        (25.0, 3.5): 0.77,
        (20.0, 1.5): 2.22,
        (20.0, 2.0): 1.61,
        (20.0, 2.5): 1.09,
        (20.0, 3.5): 0.42,
        (15.0, 1.5): 2.09,
        (15.0, 2.0): 1.05,
        (15.0, 2.5): 0.35,
        (15.0, 3.5): -0.30,
        (10.0, 1.5): 0.47,
        (10.0, 2.0): -0.87,
        (10.0, 2.5): -1.40,
        (10.0, 3.5): -1.37,
    },
    30.0: {
        (25.0, 1.5): 2.31,
        (25.0, 2.0): 2.01,
        (25.0, 2.5): 1.67,
        (25.0, 3.5): 1.13,
        (20.0, 1.5): 2.57,
        (20.0, 2.0): 2.02,
        (20.0, 2.5): 1.50,
        (20.0, 3.5): 0.88,
        (15.0, 1.5): 2.56,
        (15.0, 2.0): 1.57,
        (15.0, 2.5): 0.91,
        (15.0, 3.5): 0.25,
        (10.0, 1.5): 1.19,
        (10.0, 2.0): -0.13,
        (10.0, 2.5): -0.67,
        (10.0, 3.5): -0.60,
    },
}
"""By how much `high` wires are faster, percent: by the tube's diameter, wavelength and amplitude of the tail, mm."""


def at_any_place(compared: float) -> float:
    """Relative error for all poses, from that at the one pose at which both wires were compared."""
    return _PLACES * max(abs(compared), _LEAST)


LARGEST_WIRE_ERROR = at_any_place(max(abs(0.01 * error) for tube in _MEASURED.values() for error in tube.values()))
"""The largest of all that were measured."""


def wire_error(geometry: RobotGeometry, radius: float) -> float:
    """Relative error of the forward velocity that a `standard` wire makes: measured, else the largest that was.

    Args:
        geometry: of the robot.
        radius: R of its tube, m.
    """

    def of(length: float) -> float:
        return round(1e3 * length, 9)

    like = geometry.form.is_plain and math.isclose(of(geometry.tail_length), _LENGTH)
    like = like and math.isclose(of(geometry.wire_diameter), _WIRE)
    known = _MEASURED.get(of(2.0 * radius), {}) if like else {}
    found = known.get((of(geometry.wavelength), of(geometry.amplitude)))
    return LARGEST_WIRE_ERROR if found is None else at_any_place(0.01 * found)
