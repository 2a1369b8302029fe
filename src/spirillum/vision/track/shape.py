"""The body as it is looked for in a whole picture: its apparent edges, thinned, before a camera."""

from __future__ import annotations

from typing import NamedTuple, Self

import numpy as np

from spirillum.vision.camera.optics import BodyPose, Optics
from spirillum.vision.track.constants import SEARCH
from spirillum.vision.track.contour import Contour


class Shape(NamedTuple):
    """A body's edges before a camera, for the search of a whole picture."""

    contour: Contour
    """The apparent edges."""
    thin: Contour
    """As many of them as the search uses."""
    optics: Optics
    """The camera."""
    bounds: tuple[int, int, int, int]
    """Part of the picture to look at: left, top, right, bottom."""

    @classmethod
    def of(cls, contour: Contour, optics: Optics, bounds: tuple[int, int, int, int], factor: int = 1) -> Self:
        """The edges of a body before a camera."""
        left, top, right, bottom = bounds
        return cls(
            contour,
            contour.thinned(SEARCH.edge_stride),
            optics,
            (left // factor, top // factor, right // factor, bottom // factor),
        )

    @property
    def width(self) -> float:
        """Height of the body's picture in the middle of the picture, pixels."""
        x, y, _ = self.optics.origin
        return float(np.ptp(self.contour.places(BodyPose(float(x), float(y), 0.0), self.optics)[0][:, 1]))
