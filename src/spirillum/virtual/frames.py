"""From linear light to the bytes of a frame: disturbances, lamp, vignetting, noise, and the word `synthetic`."""

from __future__ import annotations

import numpy as np

from spirillum.arrays import Samples
from spirillum.kernels.raster import develop
from spirillum.virtual.disturbances import Disturbances
from spirillum.virtual.label import stamp
from spirillum.virtual.painter import Painter
from spirillum.virtual.trajectory import Way

__all__ = ["Frames"]

_VIGNETTING = 0.20
"""Share of light that the lens takes from the corners; assumed."""
_STEPS = 1 << 14
_BRIGHTNESS = 1.05
"""Exposure of the camera: linear light of white paper is about 0.8."""


class Frames:
    """The frames of one video, in order: noise goes on from frame to frame."""

    def __init__(self, painter: Painter, troubles: Disturbances, way: Way, exposure: float, noise: float) -> None:
        """Prepare.

        Args:
            painter: draws robot and tank.
            troubles: what spoils the pictures.
            way: where the robot is.
            exposure: of a frame, s.
            noise: its standard deviation, bytes.
        """
        self._painter, self._troubles, self._way = painter, troubles, way
        self._exposure, self._noise = exposure, float(noise)
        width, height = painter.lens.size
        v, u = np.meshgrid(np.linspace(-1, 1, height) * height, np.linspace(-1, 1, width) * width, indexing="ij")
        self._vignette = 1.0 - _VIGNETTING * (u**2 + v**2) / (width**2 + height**2)
        light = np.linspace(0.0, 1.0, _STEPS)
        self._curve = 255.0 * np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)

    def image(self, time: float) -> np.ndarray:
        """(height, width, 3) sRGB bytes of the frame at a time."""
        light = self._painter.light(self._way, time, self._exposure)
        self._troubles.spoil(light, time, self._place(time))
        image = np.empty(light.shape, dtype=np.uint8)
        gain = _BRIGHTNESS * self._troubles.gain(time)
        starts = self._troubles.starts(light.shape[0])
        develop(light, self._vignette, gain, self._curve, self._troubles.grain, starts, self._noise, image)
        stamp(image)
        return image

    def _place(self, time: float) -> Samples:
        return self._way.at(time).position
