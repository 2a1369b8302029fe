"""The tube's cross-section in a corner of a film: where the robot lies, and the way that its middle has gone."""

from __future__ import annotations

import numpy as np

from spirillum.arrays import Samples
from spirillum.dynamics.poses import Pose, Poses
from spirillum.robot.robot import Robot
from spirillum.view.figures.cross_section import silhouette
from spirillum.view.figures.scene import FAINT, INK
from spirillum.view.figures.style import COLOURS

__all__ = ["CrossSection"]

_SIDE, _LEFT, _FOOT = 0.24, 0.125, 0.035
"""Side of the square over the height of a frame; its left edge over the width; room below it over the height."""
_FINE = 3
"""Pixels that are drawn for one that is shown, along each side."""
_RIM, _ROOM = 0.93, 0.90
"""Radius of the glass, drawn and within, over half of the square."""
_GLASS, _WATER, _BODY = "#5d7486", "#eef3f6", "#c9ced2"
_MOST = 600
"""Points of the path that are drawn."""


class CrossSection:
    """The inset of all frames of one film: seen from the front, y to the right and z up."""

    def __init__(self, size: tuple[int, int], robot: Robot, poses: Poses) -> None:
        """Prepare the inset.

        Args:
            size: width and height of the frames.
            robot: the robot, with a channel.
            poses: its way.
        """
        from matplotlib import font_manager
        from PIL import ImageFont

        assert robot.channel is not None  # noqa: S101 - the caller's promise
        self._robot, self._poses = robot, poses
        self._side = max(int(_SIDE * min(size[1], 0.5625 * size[0])), 16)
        left = int(_LEFT * size[0])
        foot = size[1] - int(_FOOT * size[1])
        self._box = np.s_[foot - self._side : foot, left : left + self._side]
        self._scale = _ROOM * 0.5 * self._side * _FINE / (0.5 * robot.channel.diameter)
        self._font = ImageFont.truetype(font_manager.findfont("DejaVu Sans"), max(int(0.085 * self._side), 6) * _FINE)

    def write(self, image: np.ndarray, time: float, pose: Pose) -> None:
        """Draw into a frame.

        Args:
            image: the frame.
            time: of the run, s.
            pose: the robot then.
        """
        from PIL import Image, ImageDraw

        square = Image.fromarray(image[self._box]).resize((self._side * _FINE,) * 2)
        draw = ImageDraw.Draw(square)
        middle, rim = 0.5 * self._side * _FINE, _RIM * 0.5 * self._side * _FINE
        draw.ellipse([middle - rim, middle - rim, middle + rim, middle + rim], fill=_WATER, outline=_GLASS, width=6)
        body = self._pixels(silhouette(self._robot, pose.position, pose.attitude))
        draw.polygon(body, fill=_BODY, outline=INK, width=3)
        way = self._poses.position[self._poses.time <= time, 1:]
        way = np.concatenate([way[:: max(way.shape[0] // _MOST, 1)], pose.position[None, 1:]])
        draw.line(self._pixels(way), fill=COLOURS["blue"], width=5, joint="curve")
        x, y = self._pixels(pose.position[None, 1:])[0]
        draw.ellipse([x - 7, y - 7, x + 7, y + 7], fill=COLOURS["blue"])
        draw.text((middle, 0.25 * middle), "front", anchor="mm", font=self._font, fill=FAINT)
        image[self._box] = np.asarray(square.resize((self._side,) * 2, Image.Resampling.BOX))

    def _pixels(self, places: Samples) -> list[tuple[float, float]]:
        """Pixels of the fine square for y and z, m, (n, 2)."""
        middle = 0.5 * self._side * _FINE
        return [(middle + self._scale * float(y), middle - self._scale * float(z)) for y, z in places]
