"""Detection of the seal in a whole picture: a block of colour of its size, beside which there is less of it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.extras import required
from spirillum.robot.robot import Robot
from spirillum.vision.camera.optics import BodyPose, Optics
from spirillum.vision.track.constants import SEAL
from spirillum.vision.track.search import Candidate

__all__ = ["SealSearch"]


class _Plane(NamedTuple):
    """A grid in the plane through the robot's axis, along and across the channel."""

    x: Samples
    """Positions along, m, (c,)."""
    y: Samples
    """Positions across, m, (r,)."""
    columns: Samples
    """Pixel column of each of its points, (r, c); outside of the picture where the point is not looked at."""
    rows: Samples
    """Pixel row of each of its points, (r, c)."""


class SealSearch:
    """Looks for the seal of a robot in whole pictures."""

    def __init__(self, robot: Robot, optics: Optics, bounds: tuple[int, int, int, int]) -> None:
        """Lay out the grid in which the seal is looked for.

        Args:
            robot: a robot with a striped seal.
            optics: the camera.
            bounds: part of the picture to look at: left, top, right, bottom.
        """
        assert robot.seal is not None  # noqa: S101 - asked by those who know
        self._step = robot.body.diameter / SEAL.search_width
        nearer = 1.0 + 0.5 * robot.body.diameter / (optics.height - optics.axis_height)  # its top is what is seen
        self._long = max(3, round(nearer * robot.seal.length / self._step))
        self._wide = round(robot.body.diameter / self._step)
        self._middle = 0.5 * (robot.seal.length - robot.body.length)
        self._blur = max(0.5 * self._step / optics.length_per_pixel, SEAL.search_blur)
        self._plane = _plane(optics, bounds, self._step)

    def places(self, image: np.ndarray) -> list[Candidate]:
        """Where a seal may be, at most three places, best first; scores are differences of colour, of 255.

        Args:
            image: 8-bit RGB, (h, w, 3).
        """
        score, found = self._score(image), []
        for _ in range(3):
            row, column = np.unravel_index(int(np.argmax(score)), score.shape)
            best = float(score[row, column])
            if best <= 0.0:
                break
            pose = BodyPose(float(self._plane.x[column] - self._middle), float(self._plane.y[row]), 0.0)
            found.append(Candidate(pose, best))
            near = (slice(max(0, at - self._wide), at + self._wide + 1) for at in (row, column))
            score[tuple(near)] = 0.0
        return found

    def _score(self, image: np.ndarray) -> Samples:
        """Colour of a block around each place, over that of the most colourful of its four surroundings."""
        cv2 = required("cv2", "measuring a video", "video")
        flat = cv2.GaussianBlur(image, (0, 0), self._blur)
        flat = cv2.remap(flat, self._plane.columns, self._plane.rows, cv2.INTER_LINEAR, borderValue=(0, 0, 0))
        red, green, blue = np.moveaxis(flat.astype(np.float32), -1, 0)
        colour = np.hypot(red - green, 0.5 * (red + green) - blue)
        long, wide, beside = self._long, self._wide, max(2, self._long // 3)

        def mean(across: int, down: int) -> Samples:
            return np.asarray(cv2.blur(colour, (across, down), borderType=cv2.BORDER_CONSTANT))

        ends, flanks = mean(beside, wide), mean(long, beside)
        far, high = (long + beside) // 2 + 1, (wide + beside) // 2 + 1
        around = [np.roll(ends, far, 1), np.roll(ends, -far, 1), np.roll(flanks, high, 0), np.roll(flanks, -high, 0)]
        return np.asarray(mean(long, round(0.9 * wide)) - np.maximum.reduce(around))


def _plane(optics: Optics, bounds: tuple[int, int, int, int], step: float) -> _Plane:
    """The grid in the plane through the axis that covers a part of the picture."""
    left, top, right, bottom = bounds
    corners = np.array([[u, v] for u in (left, right - 1) for v in (top, bottom - 1)], dtype=float)
    ends = optics.points(corners, optics.axis_height)[:, :2]
    x, y = (
        np.arange(low, high, step) for low, high in zip(np.nanmin(ends, axis=0), np.nanmax(ends, axis=0), strict=True)
    )
    grid = np.stack([*np.meshgrid(x, y), np.full((y.size, x.size), optics.axis_height)], axis=-1)
    pixels = np.nan_to_num(optics.pixels(grid.reshape(-1, 3)), nan=-9.0).reshape(y.size, x.size, 2)
    inside = np.all((pixels >= (left, top)) & (pixels < (right, bottom)), axis=2)
    columns, rows = np.moveaxis(np.where(inside[..., None], pixels, -9.0).astype(np.float32), -1, 0)
    return _Plane(x, y, np.ascontiguousarray(columns), np.ascontiguousarray(rows))
