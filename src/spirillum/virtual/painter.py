"""Linear light of a picture: the robot, sampled over the exposure, before the still scene."""

from __future__ import annotations

import numpy as np

from spirillum.arrays import Samples
from spirillum.kernels.raster import Lamps, Shading, Shadow, blend, draw
from spirillum.robot.robot import Robot
from spirillum.virtual.cover import Cover
from spirillum.virtual.lens import Lens
from spirillum.virtual.solids import Solid, solids_of
from spirillum.virtual.tank import Tank, backdrop, spots, tint
from spirillum.virtual.trajectory import Pose, TrialTrajectory

__all__ = ["Painter"]

_STILL = 0.1
"""Motion blur below which an exposure is drawn at one time, pixels."""
_STEP = 0.8
"""Motion blur between two times of an exposure, pixels."""
_MAX_TIMES = 8
_LAMPS = {
    "top": ((0.25, 0.55, 0.85, 0.62), (-0.5, -0.45, 0.75, 0.38)),
    "side": ((0.2, 0.9, 0.5, 0.68), (0.0, 0.1, 1.0, 0.34)),
}
"""Direction towards each lamp (right, up, towards the camera) in the picture, and its strength; assumed."""
_SHADOW = 0.26
"""Relative loss of light in the robot's shadow on the floor; assumed."""
_MARGIN = 3
_SIDE = 4
"""Samples of a pixel along u and along v."""
_SAMPLES = _SIDE**2
_FEW = 13
"""One in so many vertices serves to estimate the motion blur."""


class Painter:
    """Draws the robot before its tank. One painter serves one video: it keeps its buffers between frames."""

    def __init__(
        self, robot: Robot, tank: Tank, lens: Lens, edges: Samples | None = None, *, covered: bool = False
    ) -> None:
        """Prepare.

        Args:
            robot: a checked robot.
            tank: the still parts.
            lens: the camera.
            edges: of the stripes, see `spirillum.virtual.troubles.stripe_edges`; None: even ones.
            covered: whether the body before its seal is a cover of glass.
        """
        self.robot, self.tank, self.lens = robot, tank, lens
        self.body, self.rotor = solids_of(robot, edges=edges, covered=covered)
        self.still = backdrop(tank, lens)
        side = -1.0 if lens.leftwards else 1.0
        self._lamps = _lamps(tank.view, side)
        self._cover = Cover(robot, lens.index, self.still, self._lamps, side) if covered else None
        self._tint = tint(lens.surface - tank.tube_height)
        self._spots = np.swapaxes(spots(_SIDE), 1, 2)
        self._depth = np.empty(0, dtype=np.float32)
        self._samples = np.empty(0, dtype=np.float32)

    def light(self, trajectory: TrialTrajectory, time: float, exposure: float) -> np.ndarray:
        """(rows, columns, 3) linear light of an exposure about a time.

        Args:
            trajectory: of the robot.
            time: the middle of the exposure, s.
            exposure: its length, s.
        """
        middle = trajectory.at(time)
        solids = [(self.body, "body"), (self.rotor, "rotor")]
        if self._cover is not None:
            solids.append((self._cover.solid, "body"))
        parts = self._parts(solids, trajectory, middle, time, exposure)
        picture = self.still.light.copy()
        left, top, right, bottom = self._window([pixels for _, _, moments in parts for pixels in moments])
        if left >= right or top >= bottom:
            return picture
        depth, samples = self._buffers(bottom - top, right - left)

        def sample(part: tuple[Solid, Samples, list[Samples]], shading: Shading) -> None:
            solid, _, moments = part
            for number, pixels in enumerate(moments):
                which = np.arange(number, _SAMPLES, len(moments))  # each time has a share of every pixel's samples
                places = np.ascontiguousarray(self._spots[:, :, which])
                draw(pixels, solid.faces, shading, places, which, left, top, depth, samples)

        glass = None
        if self._cover is not None:
            sample(parts.pop(), self._cover.encoded(middle.body))
            glass = self._cover.decoded(depth, samples)
            self._cover.refract(picture, glass, left, top, float(middle.position[2]))
        for part in parts:
            sample(part, part[0].shading(part[1], self._lamps))
        blend(depth, samples, left, top, self.still, self._shadow(middle), self._tint, picture)
        if self._cover is not None and glass is not None:
            self._cover.shine(picture, glass, left, top)
        return picture

    def _parts(
        self,
        solids: list[tuple[Solid, str]],
        trajectory: TrialTrajectory,
        middle: Pose,
        time: float,
        exposure: float,
    ) -> list[tuple[Solid, Samples, list[Samples]]]:
        """Solids, each with its rotation and the pixels of its vertices at times over the exposure."""
        found = []
        for solid, name in solids:

            def seen(share: float, every: int = 1, solid: Solid = solid, name: str = name) -> Samples:
                pose = trajectory.at(time + share * exposure) if share else middle
                return self.lens.seen(solid.vertices[::every] @ getattr(pose, name).T + pose.position)

            blur = float(np.abs(seen(0.5, _FEW) - seen(-0.5, _FEW))[:, :2].max()) if exposure > 0 else 0.0
            count = 1 if blur < _STILL else int(np.clip(np.ceil(blur / _STEP), 2, _MAX_TIMES))
            shares = (np.arange(count) + 0.5) / count - 0.5
            found.append((solid, getattr(middle, name), [seen(float(share)) for share in shares]))
        return found

    def _window(self, seen: list[Samples]) -> tuple[int, int, int, int]:
        """Columns and rows around all that is drawn: left, top, right, bottom."""
        low = np.min([pixels[:, :2].min(axis=0) for pixels in seen], axis=0)
        high = np.max([pixels[:, :2].max(axis=0) for pixels in seen], axis=0)
        width, height = self.lens.size
        spare = _MARGIN + int(0.25 * (high[1] - low[1]))  # room for the shadow
        left, top = (int(np.floor(value)) - spare for value in low)
        right, bottom = (int(np.ceil(value)) + spare + 1 for value in high)
        return max(left, 0), max(top, 0), min(right, width), min(bottom, height)

    def _buffers(self, rows: int, columns: int) -> tuple[np.ndarray, np.ndarray]:
        need = rows * columns * _SAMPLES
        if self._depth.size < need:
            self._depth = np.full(need, -1e30, dtype=np.float32)
            self._samples = np.empty(3 * need, dtype=np.float32)
        shape = (rows, columns, _SAMPLES)
        return self._depth[:need].reshape(shape), self._samples[: 3 * need].reshape(*shape, 3)

    def _shadow(self, pose: Pose) -> Shadow:
        """The soft shadow; the lamp stands a little to one side."""
        half, radius = 0.5 * self.robot.body.length, 0.5 * self.robot.body.diameter
        x, y, z = (float(value) for value in pose.position)
        drop = (-0.1 if self.lens.leftwards else 0.1) * z
        axis_x, axis_y = (float(value) for value in pose.body[:2, 0])
        return Shadow(x, y - drop, axis_x, axis_y, half - 0.6 * radius, 0.95 * radius, 0.22 * radius, _SHADOW)


def _lamps(view: str, side: float) -> Lamps:
    """The lamps of a view; `side` is -1 where the camera is rotated by half a turn."""
    towards = np.array([direction for *direction, _ in _LAMPS[view]]) * np.array([side, side, 1.0])
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    halfway = towards + np.array([0.0, 0.0, 1.0])
    halfway /= np.linalg.norm(halfway, axis=1, keepdims=True)
    return Lamps(towards, np.array([strength for *_, strength in _LAMPS[view]]), halfway)
