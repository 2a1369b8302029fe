"""Warnings on visibility: second robots, dropped frames, a robot out of view, hidden edges, wrong direction."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from spirillum.arrays import Samples
from spirillum.robust import least_squares_line
from spirillum.vision.camera.optics import BodyPose, Optics
from spirillum.vision.flag import Flag
from spirillum.vision.setup import Setup
from spirillum.vision.track.body import BodyFinder, PoseFit
from spirillum.vision.track.constants import VISIBILITY
from spirillum.vision.track.search import PoseCandidate, Shape, close_places

_THREADS = 2
EVERYTHING = ("forward_velocity", "body_rotation_rate", "tail_rotation_rate")  #: All rates of a track.


def rivals_in(
    body: BodyFinder,
    images: Sequence[np.ndarray],
    found: Sequence[list[PoseCandidate]],
    chosen: Sequence[PoseCandidate | None],
) -> list[tuple[np.ndarray, BodyPose]]:
    """Frames with a second detection as clear as the robot's, and its pose; empty unless they are frequent."""
    half, rivals, count = 0.5 * body.robot.body.length, [], 0
    for image, others, one in zip(images, found, chosen, strict=True):
        if one is None:
            continue
        count += 1
        apart = [other for other in others if _apart(other, one, half) and len(others) > 2]
        clear = [
            other
            for other in apart
            if other.score > max(VISIBILITY.second * one.score, VISIBILITY.second_clear * others[2].score)
        ]
        rivals += [(image, other.pose) for other in clear[:1]]
    return rivals if len(rivals) > VISIBILITY.often * count else []


def turned_flags(
    body: Shape,
    images: Sequence[np.ndarray],
    still: Samples,
    found: Sequence[list[PoseCandidate]],
    chosen: Sequence[PoseCandidate | None],
) -> tuple[Flag, ...]:
    """Flag a robot whose nose is at the other end."""
    seen = [(image, some[0].score) for image, some, one in zip(images, found, chosen, strict=True) if one is not None]
    turned = _turned(body, seen[:: VISIBILITY.asked], still)
    if turned > VISIBILITY.maybe_turned:
        turned = _turned(body, seen, still)
    if turned <= VISIBILITY.turned:
        return ()
    return (nose_on_the_other_side(body.optics.direction, f"turned round, it fits {turned:.2g} times better"),)


def nose_on_the_other_side(side: str, why: str = "turned round, it has the robot's tail") -> Flag:
    """Flag a robot whose nose is at the other end."""
    sentence = (
        f"the nose is on the other side than robot.direction = '{side}' says: {why}; all signs would be wrong, so that "
        "nothing is given: give it the other way"
    )
    return Flag("nose-on-the-other-side", sentence, EVERYTHING)


def _turned(body: Shape, seen: Sequence[tuple[np.ndarray, float]], still: Samples) -> float:
    """Median score ratio of the body turned by 180 degrees; `seen` holds each frame with its score as stated."""
    with ThreadPoolExecutor(_THREADS) as pool:  # the compiled loops release the GIL
        backs = pool.map(lambda image: close_places(image, still, body, turn=np.pi), [image for image, _ in seen])
        ratios = [
            back[0].score / max(score, 1e-9) if back else 0.0 for back, (_, score) in zip(backs, seen, strict=True)
        ]
    return float(np.median(ratios)) if ratios else 0.0


def _apart(other: PoseCandidate, one: PoseCandidate, half: float) -> bool:
    """Whether two candidates are too far apart to be one robot."""
    return max(abs(other.pose.x - one.pose.x) / 2.0, abs(other.pose.y - one.pose.y)) > half


def gaps_of(time: Samples, index: Samples) -> tuple[Samples, tuple[Flag, ...]]:
    """Frame numbers that count dropped frames, and a flag on these."""
    if time.size < 3:
        return index, ()
    steps = np.diff(time)
    usual = float(np.median(steps))
    turns = (time - time[0]) / usual
    whole = np.round(turns)
    if np.abs(turns - whole).max() > 0.2 or np.any(np.diff(whole) < 1.0):
        turns = np.concatenate([np.zeros(1), np.cumsum(np.maximum(1.0, np.round(steps / usual)))])
        whole = turns if np.mean(np.abs(steps / usual - np.round(steps / usual)) < 0.2) > 0.95 else index - index[0]
    missing = int(whole[-1] - whole[0]) + 1 - time.size
    flags: tuple[Flag, ...] = ()
    if missing > 0:
        share = 100.0 * missing / (missing + time.size)
        longest = float(steps.max())
        flags = (
            Flag(
                "dropped-frames",
                f"{missing} frames ({share:.1f} %) are missing by the times of the film, which are used; the longest "
                f"gap is {longest:.3g} s",
            ),
        )
    return index[0] + whole, flags


def cut_off(found: Sequence[PoseFit]) -> np.ndarray:
    """Mask of the frames left out as the robot is partly out of view, (n,); all False if few show it whole."""
    part = np.array([one.known and one.inside < VISIBILITY.full_view for one in found])
    whole = np.array([one.known and one.inside >= VISIBILITY.full_view for one in found])
    enough = int(whole.sum()) > VISIBILITY.enough * int((part | whole).sum())
    return part if enough else np.zeros(part.shape, dtype=bool)


def sight_flags(
    time: Samples, pose: Samples, errors: Samples, found: Sequence[PoseFit], optics: Optics, setup: Setup
) -> tuple[Flag, ...]:
    """Flag a robot that leaves, enters late, is partly out of view or hidden, or swims backwards."""
    flags: list[Flag] = []
    known = np.isfinite(pose[:, 0])
    count = known.size
    if not known.any():
        return (Flag("robot-not-seen", "the robot was not seen well enough on any frame", EVERYTHING),)
    first, last = np.flatnonzero(known)[[0, -1]]
    inside = np.array([one.inside for one in found])
    if count - 1 - last > max(3, VISIBILITY.lost * count):
        flags.append(
            Flag(
                "robot-left-the-view",
                f"the robot was last seen at {time[last]:.2f} s of {time[-1]:.2f} s: what was measured until then "
                "is kept",
            )
        )
    if first > max(3, VISIBILITY.lost * count):
        sentence = f"the robot was first seen at {time[first]:.2f} s: the measurement begins there"
        flags.append(Flag("robot-came-late", sentence))
    between = ~known[first : last + 1]
    if between.mean() > VISIBILITY.lost:
        flags.append(
            Flag(
                "robot-lost",
                f"the robot was not seen on {between.sum()} frames ({100 * between.mean():.1f} %) between: they are "
                "left out",
            )
        )
    part = known & (inside < VISIBILITY.full_view)
    if part.mean() > VISIBILITY.lost:
        flags.append(
            Flag(
                "robot-partly-out-of-view",
                f"the robot is partly out of view on {100 * part.mean():.0f} % of the frames: "
                + ("they are left out" if cut_off(found).any() else "its place there is less sure"),
            )
        )
    share = np.array([one.share for one in found])
    if known.sum() and float(np.median(share[known])) < VISIBILITY.hidden:
        flags.append(
            Flag(
                "edges-hidden",
                f"only {100 * float(np.median(share[known])):.0f} % of the body's edges look alike on most frames: "
                "glare, a shadow, bubbles or a wrong robot file; the place rests on the others",
            )
        )
    if known.sum() > 10:
        t, x = time[known], pose[known, 0]
        line = least_squares_line(t, x)
        spread = float(np.std(x - line.at(t))) + float(np.nanmedian(errors[:, 0]))
        if line.slope * (t[-1] - t[0]) < -max(5.0 * spread, 2.0 * optics.length_per_pixel):
            flags.append(
                Flag(
                    "moves-backwards",
                    f"the robot moves away from its nose: is robot.direction = '{setup.robot.direction}' right? If "
                    "it is, the forward velocity is negative",
                )
            )
    return tuple(flags)
