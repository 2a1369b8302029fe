"""The film under a level robot: what resists its sinking, and what pushes it sideways as it swims.

In thin films the resistance to sinking approaches 3 sqrt(2) pi mu L (a_e/h)^(3/2), 1/a_e = 1/a - 1/R, for a cylinder
of length L and radius a (the limit of Jeffrey and Onishi, Q. J. Mech. Appl. Math. 34:129, 1981), so that the gap of a
level cylinder falls as 1/time^2. A body that turns is pushed along the wall the way that its lowest line moves, as a
journal is in its bearing (W. J. Harrison, Trans. Cambridge Philos. Soc. 22:39, 1913).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.fluid.tube.table import TubeTable
from spirillum.swimming.prediction import Prediction

__all__ = ["Film", "film_at", "lubrication_resistance"]

_U, _SIDE, _UP, _ROLL, _JOINT = 0, 1, 2, 3, 6
_PHASES = 8


class Film(NamedTuple):
    """What the fluid does to a level robot that swims at one gap, held to its course; SI, means over phases."""

    gap: float
    """Smallest distance of body and wall, m."""
    normal_resistance: float
    """Resistance to sinking of a robot that is free along the tube and in its body's rotation, N s/m."""
    sideways_force: float
    """Along the wall, towards a positive azimuth, N."""


def film_at(motion: Prediction, table: TubeTable, gap: float, offset: float) -> Film:
    """The film under a level robot.

    Args:
        motion: the robot as it swims at that gap, held level.
        table: its table.
        gap: of the body, m.
        offset: e of its mid-length, m.
    """
    phases = 2.0 * np.pi * np.arange(_PHASES) / _PHASES
    matrices = [table.at(offset, phase=float(phase))[0][:7, :7] for phase in phases]
    full: Samples = motion.robot.fluid.viscosity * np.mean(matrices, axis=0)
    free = [_U] if motion.batch.joint == "fixed" else [_U, _ROLL]
    inner = np.linalg.solve(full[np.ix_(free, free)], full[np.ix_(free, [_UP])])
    resistance = float(full[_UP, _UP] - (full[np.ix_([_UP], free)] @ inner)[0, 0])
    rates = np.zeros(7)
    rates[_U], rates[_ROLL], rates[_JOINT] = (
        motion.forward_velocity,
        motion.body_rotation_rate,
        motion.motor_rotation_rate,
    )
    return Film(gap, resistance, -float(full[_SIDE] @ rates))


def lubrication_resistance(viscosity: float, length: float, radius: float, tube_radius: float, gap: float) -> float:
    """S_z of a long cylinder in a thin film at the wall of a round tube, 3 sqrt(2) pi mu L (a_e/h)^(3/2), N s/m.

    Args:
        viscosity: Pa s.
        length: of the cylinder, m.
        radius: a of the cylinder, m.
        tube_radius: R, m.
        gap: h, m.
    """
    curvature = 1.0 / radius - 1.0 / tube_radius
    return float(3.0 * np.sqrt(2.0) * np.pi * viscosity * length * (curvature * gap) ** -1.5)
