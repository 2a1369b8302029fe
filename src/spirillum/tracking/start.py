"""The first look at a video: whether the robot is there, where, and what its edges look like."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace

import numpy as np

from spirillum.arrays import Samples
from spirillum.errors import InputError
from spirillum.tracking.body import BodyFinder
from spirillum.tracking.frames import Frame
from spirillum.tracking.optics import BodyPose
from spirillum.tracking.search import Candidate, most_likely, refined
from spirillum.tracking.track import Flag
from spirillum.tracking.warnings import close_places, start_flags

__all__ = ["Start", "first_look", "on_the_way"]

_THREADS = 2
_SEARCHED = 8
"""How many of the frames are searched for the robot without knowing anything."""
_CLEAR = 1.6
"""How much clearer the robot's edges are than those of anything else: score over that of the third best place."""
_OFTEN = 0.25
"""Share of the frames on which it has to be as clear as that."""
_FAINT = 0.4
"""Score of a robot over that on its best frames, below which it is not learnt from: it is partly out of view."""


@dataclass(frozen=True)
class Start:
    """What the first look has told."""

    seen: list[tuple[np.ndarray, BodyPose]] = field(repr=False)
    """Frames on which the robot was found, 8-bit RGB, and where."""
    path: list[tuple[float, BodyPose]]
    """When it was where."""
    score: float
    """How clear its edges usually are, grey per pixel."""
    flags: tuple[Flag, ...]

    def expected(self, time: float) -> BodyPose:
        """Where it should be at a time."""
        return on_the_way(self.path, time)

    def as_clear(self, score: float) -> bool:
        """Whether edges are as clear as a robot's."""
        return score > _FAINT * self.score


def first_look(name: str, body: BodyFinder, frames: Sequence[Frame], still: Samples) -> Start:
    """Find the robot on some frames and learn what its edges look like.

    Args:
        name: name of the video.
        body: the robot's body, which learns.
        frames: frames spread over the video.
        still: what stands still in them, (h, w, 3).

    Raises:
        InputError: if there is no robot.
    """
    times = np.array([frame.time for frame in frames])
    every = np.unique(np.linspace(0, len(frames) - 1, min(_SEARCHED, len(frames))).round().astype(int))
    images = [frames[k].image for k in every]
    with ThreadPoolExecutor(_THREADS) as pool:  # the compiled loops run side by side
        found = list(pool.map(lambda image: close_places(body, image, still), images))
    if not _clear(found):
        advice = _advice(body, images, still)
        raise InputError(f"{name}: no robot like '{body.robot.name}' was found in its pictures; {advice}")
    chosen = most_likely(found, body.robot.body.length)
    known = [(times[k], one.pose) for k, one in zip(every, chosen, strict=True) if one is not None]
    guesses = [Candidate(on_the_way(known, frame.time), 0.0) for frame in frames]
    starts = [
        refined(frame.image, still, guess, body.contour, body.optics, body.bounds)
        for frame, guess in zip(frames, guesses, strict=True)
    ]
    usual = float(np.quantile([start.score for start in starts], 0.8))
    kept = [k for k, start in enumerate(starts) if start.score > _FAINT * usual]
    placed = body.learn([frames[k].image for k in kept], [starts[k].pose for k in kept], times[kept])
    good = [(k, one.pose) for k, one in zip(kept, placed, strict=True) if one.known]
    if not good:
        advice = _advice(body, images, still)
        raise InputError(f"{name}: no robot like '{body.robot.name}' can be followed in it; {advice}")
    flags = start_flags(body, images, still, found, chosen)
    return Start([(frames[k].image, pose) for k, pose in good], [(times[k], pose) for k, pose in good], usual, flags)


def _clear(found: Sequence[list[Candidate]]) -> bool:
    """Whether something stands out of the pictures as a robot does."""
    clear = [len(some) > 0 and (len(some) < 3 or some[0].score > _CLEAR * some[2].score) for some in found]
    return float(np.mean(clear)) >= _OFTEN


def _advice(body: BodyFinder, images: Sequence[np.ndarray], still: Samples) -> str:
    """What may be wrong where no robot is seen: also a scale that is out by a factor of two."""
    clear = {}
    for factor in (0.5, 2.0):
        optics = replace(body.optics, focal=body.optics.focal / factor)
        other = BodyFinder(body.robot, optics, body.bounds)
        found = [close_places(other, image, still) for image in images[::2]]
        clear[factor] = float(np.median([some[0].score / some[2].score if len(some) > 2 else 0.0 for some in found]))
    factor = max(clear, key=lambda value: clear[value])
    if clear[factor] > 1.3 * _CLEAR:
        return (
            f"allowed: a scale that fits the robot, which is there with {factor:g} times the stated spacing or length "
            "per pixel"
        )
    return "allowed: one that is in view, with the right robot.file, heights and scale, or a [region] around it"


def on_the_way(known: list[tuple[float, BodyPose]], time: float) -> BodyPose:
    """Where the body should be at a time, by straight lines between and beyond known places."""
    times = np.array([at for at, _ in known])
    poses = np.array([pose for _, pose in known])
    if len(known) == 1:
        return BodyPose(*poses[0].tolist())
    if times[0] <= time <= times[-1]:
        return BodyPose(*(float(np.interp(time, times, poses[:, k])) for k in range(3)))
    few = slice(0, 4) if time < times[0] else slice(-4, None)
    span = times[few] - times[few].mean()
    slope = span @ (poses[few] - poses[few].mean(axis=0)) / max(float(span @ span), 1e-12)
    edge = 0 if time < times[0] else -1
    there = poses[edge] + slope * (time - times[edge]) * np.array([1.0, 1.0, 0.0])
    return BodyPose(*there.tolist())
