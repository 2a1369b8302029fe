"""What a real bench does to a film: troubles as data, and as what they do to frames, stripes and pictures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar, Self

import numpy as np
from pydantic import BeforeValidator

from spirillum.arrays import Samples
from spirillum.errors import InputError, did_you_mean
from spirillum.extras import required
from spirillum.robot.arguments import Options, in_range, within
from spirillum.robot.fields import Angle
from spirillum.robot.robot import Robot

__all__ = ["USUAL", "Shake", "Troubles", "even_times", "repainted", "stripe_edges"]

_LOST, _SHAKE, _PAINT = range(30, 33)
_WAVES, _SLOWEST, _FASTEST = 4, 0.15, 1.2
"""Waves of a hand's sway, and their frequencies, Hz; assumed."""
_JITTER = 1.0 / 3.0
"""Standard deviation of the jitter from frame to frame over the sway; assumed."""
_TURN = 2e-4
"""Roll of a hand-held camera over its sway, rad per pixel; assumed."""


class Troubles(Options):
    """How much of each trouble a film has; the defaults are none."""

    argument: ClassVar[str] = "troubles"

    lost_frames: Annotated[float, BeforeValidator(in_range(0.0, 0.5))] = 0.0
    """Share of frames that are lost while the film's times go on evenly, as simple recording scripts write them."""
    handheld: Annotated[float, BeforeValidator(in_range(0.0, 30.0, " pixels"))] = 0.0
    """Sway of a camera held by hand: standard deviation of its slow part, pixels; a third of it from frame to frame."""
    rolled: Annotated[Angle, within(-0.6, 0.6, "rad")] = 0.0
    """Angle by which the camera is turned about its optical axis against the channel."""
    uneven_stripes: Annotated[float, BeforeValidator(in_range(0.0, 0.5))] = 0.0
    """Widths of hand-painted stripes: largest difference from an even one, over it."""

    @classmethod
    def of(cls, value: str | Self | Mapping[str, Any] | None) -> Self:
        """Troubles from what a caller may give.

        Args:
            value: names of troubles with commas between them, at their usual size (`USUAL`), `Troubles`, its fields by
                name, or None.

        Raises:
            InputError: for an unknown name, or a value out of range.
        """
        if not isinstance(value, str):
            return super().of(value)
        chosen: dict[str, Any] = {}
        for word in (part.strip() for part in value.split(",")):
            name = word.replace("-", "_")
            if name not in USUAL:
                known = [trouble.replace("_", "-") for trouble in USUAL]
                raise InputError(f"trouble {word[:40]!r}{did_you_mean(word[:40], known)}; allowed: {', '.join(known)}")
            chosen[name] = USUAL[name]
        return super().of(chosen)


USUAL: dict[str, Any] = {"lost_frames": 0.03, "handheld": 3.0, "rolled": np.radians(4.0), "uneven_stripes": 0.2}
"""The usual size of each trouble: 7 frames of 240; 3 pixels; 4 degrees; a fifth."""


def even_times(troubles: Troubles, kept: np.ndarray, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Frames that are left after further ones were lost, and the numbers under which the film holds them.

    Args:
        troubles: of the film.
        kept: numbers of the frames as recorded, (n,); the first and the last stay.
        seed: of the random numbers.

    Returns:
        Numbers as recorded, and numbers by which the film counts its times.
    """
    lost = round(troubles.lost_frames * kept.size)
    if not lost or kept.size < 3:
        return kept, kept
    gone = np.random.default_rng([seed, _LOST]).permutation(kept.size - 2)[: min(lost, kept.size - 2)] + 1
    left = np.delete(kept, gone)
    return left, left[0] + np.arange(left.size)


def stripe_edges(troubles: Troubles, count: int, seed: int) -> Samples:
    """Angles of the edges between stripes, from the first one's edge on, rad, (count + 1,); even ones without trouble.

    Args:
        troubles: of the film.
        count: number of stripes.
        seed: of the random numbers.
    """
    even = 2.0 * np.pi / count
    widths = 1.0 + troubles.uneven_stripes * np.random.default_rng([seed, _PAINT]).uniform(-1.0, 1.0, count)
    edges = np.concatenate([[0.0], np.cumsum(widths)]) * (2.0 * np.pi / widths.sum())
    return np.asarray(edges - 0.5 * even, dtype=float)


def repainted(robot: Robot, vertices: Samples, edges: Samples) -> Samples:
    """Vertices of the body turned about its axis so that its stripes have other edges; the shape stays what it is.

    Args:
        robot: the robot, a body of revolution with stripes.
        vertices: of the body, m, (n, 3).
        edges: of `stripe_edges`.
    """
    if robot.seal is None or not robot.seal.stripes:
        return vertices
    x, y, z = vertices.T
    count = len(robot.seal.stripes)
    first = -np.pi / count
    angle = (np.arctan2(-y, z) - first) % (2.0 * np.pi) + first
    new = np.interp(angle, 2.0 * np.pi / count * (np.arange(count + 1) - 0.5), edges)
    radius = np.hypot(y, z)
    return np.stack([x, -radius * np.sin(new), radius * np.cos(new)], axis=1)


@dataclass(frozen=True)
class Shake:
    """How a camera is held: rolled, and swaying."""

    troubles: Troubles
    seed: int
    _waves: Samples = field(init=False, repr=False)

    def __post_init__(self) -> None:
        rng = np.random.default_rng([self.seed, _SHAKE])
        rates = np.exp(rng.uniform(np.log(_SLOWEST), np.log(_FASTEST), (3, _WAVES)))
        phases, sizes = rng.uniform(0.0, 2.0 * np.pi, (3, _WAVES)), rng.uniform(0.5, 1.0, (3, _WAVES))
        sizes *= np.sqrt(2.0) / np.linalg.norm(sizes, axis=1, keepdims=True)
        object.__setattr__(self, "_waves", np.stack([2.0 * np.pi * rates, phases, sizes]))

    def at(self, time: float) -> tuple[float, float, float]:
        """Shift of the picture to the right and downwards, pixels, and its roll, rad, at a time."""
        rates, phases, sizes = self._waves
        sway = np.sum(sizes * np.sin(rates * time + phases), axis=1)
        jitter = _JITTER * np.random.default_rng([self.seed, _SHAKE, round(1e4 * time)]).standard_normal(3)
        u, v, turn = self.troubles.handheld * (sway + jitter)
        return float(u), float(v), self.troubles.rolled + _TURN * float(turn)

    def moved(self, light: np.ndarray, time: float) -> np.ndarray:
        """A picture as the camera sees it; what lies beyond the borders goes on as they are.

        Args:
            light: linear light, (rows, columns, 3).
            time: s.
        """
        if not (self.troubles.handheld or self.troubles.rolled):
            return light
        cv2 = required("cv2", "a camera that is not still", "video")
        u, v, roll = self.at(time)
        rows, columns, _ = light.shape
        matrix = cv2.getRotationMatrix2D((0.5 * (columns - 1), 0.5 * (rows - 1)), np.degrees(roll), 1.0)
        matrix[:, 2] += u, v
        moved = cv2.warpAffine(light, matrix, (columns, rows), flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
        return np.ascontiguousarray(np.maximum(moved, 0.0), dtype=light.dtype)
