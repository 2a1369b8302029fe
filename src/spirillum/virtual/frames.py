"""From linear light to the bytes of a frame: disturbances, lamp, vignetting, noise, and the label `synthetic`."""

from __future__ import annotations

import numpy as np

from spirillum.kernels.raster import develop
from spirillum.virtual.artifacts import ViewArtifacts
from spirillum.virtual.disturbances import Disturbances
from spirillum.virtual.painter import Painter
from spirillum.virtual.trajectory import TrialTrajectory

_TEXT = "synthetic"
_LETTERS = {  # 3 x 5 pixels, rows from the top
    "s": "011 100 010 001 110",
    "y": "000 101 011 001 110",
    "n": "000 110 101 101 101",
    "t": "010 111 010 010 011",
    "h": "100 100 110 101 101",
    "e": "000 010 111 100 011",
    "i": "010 000 010 010 010",
    "c": "000 011 100 100 011",
}
_LARGE = 480
"""Width of a picture above which the letters are twice as large, pixels."""


def stamp(image: np.ndarray) -> None:
    """Write the label into the lower right corner of a picture.

    Args:
        image: (height, width, 3) bytes; changed.
    """
    mask = np.zeros((5, 4 * len(_TEXT) - 1), dtype=bool)
    for place, letter in enumerate(_TEXT):
        rows = [[digit == "1" for digit in row] for row in _LETTERS[letter].split()]
        mask[:, 4 * place : 4 * place + 3] = rows
    times = 2 if image.shape[1] >= _LARGE else 1
    mask = np.repeat(np.repeat(mask, times, axis=0), times, axis=1)
    height, width = mask.shape
    corner = image[-height - 3 : -3, -width - 3 : -3]
    corner[mask] = (60, 60, 66)


_VIGNETTING = 0.20
"""Relative loss of light in the corners; assumed."""
_STEPS = 1 << 14
_BRIGHTNESS = 1.05
"""Exposure of the camera: linear light of white paper is about 0.8."""


class FrameEncoder:
    """The frames of one video, in order: noise differs from frame to frame."""

    def __init__(
        self,
        painter: Painter,
        disturbances: Disturbances,
        trajectory: TrialTrajectory,
        exposure: float,
        view: ViewArtifacts | None = None,
    ) -> None:
        """Prepare.

        Args:
            painter: draws robot and tank.
            disturbances: of the pictures.
            trajectory: of the robot.
            exposure: of a frame, s.
            view: what lies between robot and picture; None: nothing, and the camera stands still.
        """
        self._view = view
        self._painter, self._disturbances, self._trajectory = painter, disturbances, trajectory
        self._exposure = exposure
        width, height = painter.lens.size
        v, u = np.meshgrid(np.linspace(-1, 1, height) * height, np.linspace(-1, 1, width) * width, indexing="ij")
        self._vignette = 1.0 - _VIGNETTING * (u**2 + v**2) / (width**2 + height**2)
        light = np.linspace(0.0, 1.0, _STEPS)
        self._curve = 255.0 * np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)

    def image(self, time: float) -> np.ndarray:
        """(height, width, 3) sRGB bytes of the frame at a time."""
        disturbances = self._disturbances
        light = self._painter.light(self._trajectory, time, self._exposure)
        disturbances.disturb(light, time, self._trajectory.at(time).position)
        if self._view is not None:
            light = self._view.seen(light, time)
        image = np.empty(light.shape, dtype=np.uint8)
        gain = _BRIGHTNESS * disturbances.gain(time)
        starts = disturbances.starts(light.shape[0])
        develop(light, self._vignette, gain, self._curve, disturbances.grain, starts, disturbances.noise, image)
        stamp(image)
        return image
