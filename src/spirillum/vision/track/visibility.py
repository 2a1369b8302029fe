"""Whether the robot is what was followed, and in view: second robots, false detections, hidden edges, wrong direction.

Where a still picture hides a slow robot, or clutter looks like a body, the outline may lie beside the robot for a
while and then find it. Over a grid it stays behind where the robot is hidden or taken away. Neither stripes nor tail
can be read meanwhile, as they are looked for where they are not. A robot that is at two places, too far apart for it to
have swum from one to the other, is found in a video of which a piece is missing, or is not the same robot.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from spirillum.arrays import Samples
from spirillum.robust import least_squares_line, mad_scale, repeated_median_line, stretches_of
from spirillum.units import show
from spirillum.vision.camera.optics import BodyPose, Optics
from spirillum.vision.flag import Flag
from spirillum.vision.setup import Setup
from spirillum.vision.track.body import BodyFinder, PoseFit
from spirillum.vision.track.constants import IDENTITY, VISIBILITY
from spirillum.vision.track.search import PoseCandidate, Shape, close_places

_THREADS = 2


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
    why = f"turned round, it fits {turned:.2g} times better"
    return (Flag.named("nose-on-the-other-side", side=body.optics.direction, why=why),)


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
    if missing <= 0:
        return index[0] + whole, ()
    share = 100.0 * missing / (missing + time.size)
    return index[0] + whole, (Flag.named("dropped-frames", missing=missing, share=share, longest=steps.max()),)


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
        return (Flag.named("robot-not-seen"),)
    first, last = np.flatnonzero(known)[[0, -1]]
    inside = np.array([one.inside for one in found])
    if count - 1 - last > max(3, VISIBILITY.lost * count):
        flags.append(Flag.named("robot-left-the-view", last=time[last], end=time[-1]))
    if first > max(3, VISIBILITY.lost * count):
        flags.append(Flag.named("robot-came-late", first=time[first]))
    between = ~known[first : last + 1]
    if between.mean() > VISIBILITY.lost:
        flags.append(Flag.named("robot-lost", count=between.sum(), share=100 * between.mean()))
    part = known & (inside < VISIBILITY.full_view)
    if part.mean() > VISIBILITY.lost:
        then = "they are left out" if cut_off(found).any() else "its place there is less sure"
        flags.append(Flag.named("robot-partly-out-of-view", share=100 * part.mean(), then=then))
    share = np.array([one.share for one in found])
    if (usual := float(np.median(share[known]))) < VISIBILITY.hidden:
        flags.append(Flag.named("edges-hidden", share=100 * usual))
    if known.sum() > 10:
        t, x = time[known], pose[known, 0]
        line = least_squares_line(t, x)
        spread = float(np.std(x - line.at(t))) + float(np.nanmedian(errors[:, 0]))
        if line.slope * (t[-1] - t[0]) < -max(5.0 * spread, 2.0 * optics.length_per_pixel):
            flags.append(Flag.named("moves-backwards", side=setup.robot.direction))
    return tuple(flags)


@dataclass(frozen=True)
class FalseDetectionConstants:
    """Frames on which something else than the robot was followed."""

    fewest: int = 12  #: Fewest frames on which stripes or tail are read.
    shortest: int = 3  #: Fewest frames in a row without them.
    neighbours: int = 5  #: Frames to both sides of a jump whose medians are compared.
    jump: float = 0.15  #: Jump of the place over the body's length.
    leaves: float = 1.0
    """Distance from the path of the marked frames from which on the outline has left the robot, pixels."""
    scatters: float = 6.0
    """Distance from which on it has left the robot, over the scatter of the marked frames about their path."""
    apart: float = 0.5
    """Lasting jump of the place over the body's length that no other edge of the same robot explains."""


FALSE_DETECTION = FalseDetectionConstants()


def false_detections(
    time: Samples, pose: Samples, marks: tuple[Samples, Samples], length: float, pixel: float
) -> np.ndarray:
    """Frames of stretches without marks that lie beside the path of those with marks, or jump to them, a mask, (n,).

    Args:
        time: of each frame, s, (n,).
        pose: of the body, whose first two columns are its place, m, (n, 3); NaN where unknown.
        marks: readings of stripes and tail, whose first column is NaN where they cannot be read, each (n, 2).
        length: of the body, m.
        pixel: length per pixel, m.
    """
    place, marked = pose[:, :2], np.isfinite(marks[0][:, 0]) | np.isfinite(marks[1][:, 0])
    found = np.zeros(time.size, dtype=bool)
    known = np.isfinite(place).all(axis=1)
    sure = np.flatnonzero(marked & known)
    if sure.size < FALSE_DETECTION.fewest:
        return found
    speed = np.array([repeated_median_line(time[sure], place[sure, axis]).slope for axis in (0, 1)])
    along = place - speed * (time - time[0])[:, None]  # what does not move as the robot does jumps, or leaves it
    path = np.median(along[sure], axis=0)
    scatter = float(np.hypot(*mad_scale(along[sure] - path, axis=0)))
    off_path = max(FALSE_DETECTION.leaves * pixel, FALSE_DETECTION.scatters * scatter)
    for stretch in stretches_of(~marked & known):
        others = sure[(sure > stretch[-1]) | (sure < stretch[0])]
        after, before = others[others > stretch[-1]], others[others < stretch[0]]
        few = FALSE_DETECTION.neighbours
        sides = [(stretch[-few:], after[:few]), (stretch[:few], before[-few:])]
        jumps = [np.median(along[own], axis=0) - np.median(along[other], axis=0) for own, other in sides if other.size]
        leaves = [np.hypot(*(np.median(along[own], axis=0) - path)) > off_path for own, _ in sides]
        jumps_to_it = all(np.hypot(*jump) > FALSE_DETECTION.jump * length for jump in jumps)
        if stretch.size >= FALSE_DETECTION.shortest and (jumps_to_it or any(leaves)):
            found[stretch] = True
    return found


def false_detection_flag(found: np.ndarray) -> tuple[Flag, ...]:
    """Note on such frames."""
    if not found.any():
        return ()
    return (Flag.named("something-else-followed", count=found.sum(), share=100.0 * found.mean()),)


def marks_lost_flag(place: Samples, roll: Samples, tail: Samples, learnt: float = 1.0) -> tuple[Flag, ...]:
    """Flag a robot followed without stripes and tail, though the tail was read on a large share where it was learnt."""
    followed = np.flatnonzero(np.isfinite(place))
    bare = ~(np.isfinite(roll) | np.isfinite(tail))[followed]
    if learnt <= IDENTITY.sure_share or not followed.size or bare.mean() <= 1.0 - IDENTITY.least_share:
        return ()
    return (Flag.named("marks-lost", int(followed[bare][-1]), share=100.0 * bare.mean()),)


def far_apart(time: Samples, x: Samples, length: float) -> tuple[Flag, ...]:
    """Flag a robot that is at two places, before and after a jump that is too long for another edge of its own.

    Where it comes back, what was followed in between is left out as stray frames.

    Args:
        time: of each frame, s, (n,).
        x: along the channel, m, (n,); NaN where unknown.
        length: of the body, m.
    """
    known, few, allowed = np.flatnonzero(np.isfinite(x)), FALSE_DETECTION.neighbours, FALSE_DETECTION.apart * length
    if known.size < 2 * few:
        return ()
    t, place = time[known], x[known]
    speed = float(np.median(np.diff(place) / np.diff(t)))
    residual = place - speed * t
    level = np.median(sliding_window_view(residual, few), axis=1)
    unseen = t[few : 1 - few] - t[few - 1 : -few]
    steps = np.abs(level[few:] - level[:-few]) - abs(speed) * unseen  # it may have stopped while it was not seen
    largest = int(np.argmax(steps))
    if steps[largest] <= allowed or abs(level[-1] - level[0]) <= allowed:
        return ()
    around = np.abs(np.diff(residual[largest : largest + 2 * few]))
    frame = int(known[largest + 1 + np.argmax(around)])
    return (Flag.named("two-places", frame, apart=show(float(steps[largest]), "mm"), time=time[frame]),)
