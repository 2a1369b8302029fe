"""A robot whose middle lies on the tube's axis: every tilt is a pitch, seen from another side.

A table needs lowered and yawed noses there too. All of them follow from raised ones by a rotation about the tube's
axis, and by one about the robot's own that brings the tail's phase along.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spirillum.arrays import Samples
from spirillum.fluid.tube.rest import even_phases, factor_of, fourier, matrices_at
from spirillum.kernels.tube_table import MOTIONS

__all__ = ["OnAxis"]

_HALF_TURN = np.array([1.0, -1.0, -1.0, 1.0, -1.0, -1.0, 1.0, 1.0])


@dataclass(frozen=True)
class OnAxis:
    """Resistance of a robot at offset 0 for any pitch and yaw."""

    pitches: Samples
    """Pitches of both signs, increasing, rad."""
    values: Samples
    """Fourier coefficients of the factor there, (pitches, phases, 36)."""

    @classmethod
    def of(cls, pitches: Samples, values: Samples) -> OnAxis:
        """From raised noses.

        Args:
            pitches: from 0, increasing, rad.
            values: Fourier coefficients of the factor, (pitches, phases, 36).
        """
        signs = (_HALF_TURN[:, None] * _HALF_TURN)[np.tril_indices(MOTIONS)]
        harmonic = (np.arange(values.shape[1]) + 1) // 2
        lowered = values[1:] * signs * ((-1.0) ** harmonic)[:, None]
        return cls(np.concatenate([-pitches[:0:-1], pitches]), np.concatenate([lowered[::-1], values]))

    def coefficients(self, pitch: float, yaw: float = 0.0) -> Samples:
        """Fourier coefficients of the factor at a pitch and yaw, (phases, 36)."""
        if yaw == 0.0:
            return self._at(pitch)
        axis = np.array([np.cos(pitch) * np.cos(yaw), np.cos(pitch) * np.sin(yaw), np.sin(pitch)])
        side = np.array([-np.sin(yaw), np.cos(yaw), 0.0])
        tilt = float(np.arctan2(np.hypot(axis[1], axis[2]), axis[0]))
        level = np.array([0.0, axis[2], -axis[1]]) / np.hypot(axis[1], axis[2])  # y' of the frame without yaw
        turn = float(np.arctan2(level @ np.cross(axis, side), level @ side))
        count = self.values.shape[1]
        phases = np.array(even_phases(count))
        rotation = _about_x(turn)
        matrices = rotation @ matrices_at(self._at(tilt), phases - turn) @ rotation.T
        return fourier(factor_of(matrices, "on the tube's axis"))

    def _at(self, pitch: float) -> Samples:
        apart = self.pitches[:, None] - self.pitches + np.eye(self.pitches.size)
        ahead = np.where(np.eye(self.pitches.size, dtype=bool), 1.0, (pitch - self.pitches) / apart)
        found: Samples = np.tensordot(np.prod(ahead, axis=1), self.values, axes=1)
        return found


def _about_x(angle: float) -> Samples:
    """From rates in a frame that is turned about x by an angle to those in the frame that is not, (8, 8)."""
    c, s = np.cos(angle), np.sin(angle)
    found = np.eye(MOTIONS)
    for first in (1, 4):
        found[first : first + 2, first : first + 2] = [[c, -s], [s, c]]
    return found
