"""The small parameter of the thin-wire theories, and when it is not small."""

from __future__ import annotations

import numpy as np

from spirillum.arrays import PerRobot
from spirillum.robot.batch import RobotBatch
from spirillum.robot.limits import Limit

PRINTED_EPS_CONSTANT = 2.6
"""Constant of eps as the paper prints it."""
EXACT_EPS_CONSTANT = 0.5 * np.pi * np.exp(0.5)
"""pi sqrt(e)/2 = 2.58981: Lighthill's cut-off delta = a sqrt(e)/2 (SIAM Rev. 18:161, 1976)."""

_LARGEST_EPS = 0.2
_FEWEST_TURNS = 1.0


def cutoff(batch: RobotBatch, constant: float) -> PerRobot:
    """Eps = k delta = constant alpha D_t/lambda, with k the wavenumber along the wire (Section II-B)."""
    return constant * batch.arc_fraction * batch.wire_diameter / batch.wavelength


def thin_wire_cautions(batch: RobotBatch, constant: float) -> list[Limit]:
    """Where what the theories neglect, of order eps^2, exceeds some 4 %, or the helix has no full turn."""
    return [
        Limit.named("thin-wire", cutoff(batch, constant), _LARGEST_EPS),
        Limit.named("whole-turns", batch.tail_length / batch.wavelength, _FEWEST_TURNS),
    ]
