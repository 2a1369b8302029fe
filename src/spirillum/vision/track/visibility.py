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
