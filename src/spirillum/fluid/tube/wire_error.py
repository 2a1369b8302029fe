"""What the form of the wire costs the forward velocity in a tube: solutions with `standard` wires against `high` ones.

Tables are made of solutions with `standard` wires. A table that is made compares both at one place; of those that come
with the package `benchmarks/tube_wires.py` does, level at a gap of 0.4 mm.
"""

from __future__ import annotations

import math

from spirillum.fluid.wire.robot_geometry import RobotGeometry

_PLACES = 1.1
"""Largest error at other places, pitched by up to 3 degrees and at gaps from 0.3 mm up to the axis, over that one."""
SOLIDS_ERROR = 2e-4
"""Relative error of the drag of a body in a tube at the coarsest tolerance of a table; see `docs/accuracy.md`."""
_LEAST = 0.005
"""Least relative error there: where errors of thrust and drag nearly cancel, their sum depends on the place more."""
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
    """Relative error that is stated of all places, from that at the one at which both wires were compared."""
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

    like = math.isclose(of(geometry.tail_length), _LENGTH) and math.isclose(of(geometry.wire_diameter), _WIRE)
    known = _MEASURED.get(of(2.0 * radius), {}) if like else {}
    found = known.get((of(geometry.wavelength), of(geometry.amplitude)))
    return LARGEST_WIRE_ERROR if found is None else at_any_place(0.01 * found)
