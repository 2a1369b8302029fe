"""Where in a picture a body may be, when nothing is known of its place yet."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.extras import required
from spirillum.kernels.edges import edge_scores
from spirillum.vision.camera.optics import BodyPose, Optics
from spirillum.vision.track.contour import GROUPS, Contour

__all__ = ["Candidate", "candidates", "close_places", "most_likely", "refined"]

_WIDTH = 16.0
"""Width of a body in the picture that is searched first, pixels."""
_HEADINGS = np.deg2rad([-8.0, -4.0, 0.0, 4.0, 8.0])
_STILL = 0.8
"""How much of what stands still is taken off a picture; not all, or a robot that hardly moves would vanish too."""
_EVERY = 2
"""Of how many edge points one is used."""
_STEP = 6
"""Columns of the smaller picture for which the outline is computed once."""
_BEST = 3
"""Places of each heading among them that are kept."""
_KEPT = 5
_REACH = 6
"""How far a candidate is moved to place it better, pixels."""
_ROOM = 24
"""Pixels around a candidate that are looked at to place it better."""


class Candidate(NamedTuple):
    """A place where a body may be."""

    pose: BodyPose
    score: float
    """How clear its edges are there, over the picture's usual gradient."""


def candidates(
    image: np.ndarray,
    still: Samples,
    contour: Contour,
    optics: Optics,
    bounds: tuple[int, int, int, int],
    *,
    turn: float = 0.0,
) -> list[Candidate]:
    """The likeliest places of a body in a picture, best first, at least a body's width apart.

    Args:
        image: 8-bit RGB, (h, w, 3).
        still: what stands still in the video, (h, w, 3).
        contour: the body's apparent edges.
        optics: the camera.
        bounds: part of the picture to look at.
        turn: added to all headings that are tried, rad.
    """
    left, top, _, bottom = bounds
    middle = contour.places(BodyPose(float(optics.origin[0]), float(optics.origin[1]), 0.0), optics)[0]
    width = float(np.ptp(middle[:, 1]))
    factor = max(1, int(width / _WIDTH))
    slope_u, slope_v, usual = _slopes(image, still, bounds, factor, 1.0)
    length, height = slope_u.shape
    thin = np.arange(0, len(contour.group), _EVERY)
    group, shift = contour.group[thin], np.array([-0.5 * _STEP, -0.5 * height])
    scores = np.empty((_STEP, height + 1))
    found: list[tuple[float, BodyPose]] = []
    for column in range(_STEP // 2, length + _STEP // 2, _STEP):
        for heading in _HEADINGS:
            start = np.array([[left + factor * column, 0.5 * (top + bottom)]], dtype=float)
            at = optics.points(start, optics.axis_height)[0]
            if not np.isfinite(at).all():
                continue
            pose = BodyPose(float(at[0]), float(at[1]), float(heading) + turn)
            pixels, normals, _, _ = contour.places(pose, optics)
            small = (pixels[thin] - np.array([left, top])) / factor - 0.5 + 0.5 / factor
            edge_scores(slope_u, slope_v, small, normals[thin], group, len(GROUPS), tuple(shift), scores)
            best = np.argpartition(scores, -_BEST, axis=None)[-_BEST:]
            places = start + factor * (shift + np.column_stack(np.unravel_index(best, scores.shape)))
            for k, there in zip(best, optics.points(places, optics.axis_height), strict=True):
                pose = BodyPose(float(there[0]), float(there[1]), float(heading) + turn)
                found.append((float(scores.flat[k]) / usual, pose))
    return _apart(found, optics, width)


def _apart(found: list[tuple[float, BodyPose]], optics: Optics, width: float) -> list[Candidate]:
    """The best candidates that are not the same one twice."""
    far = width * optics.length_per_pixel
    kept: list[Candidate] = []
    for score, pose in sorted(found, key=lambda entry: -entry[0]):
        if score <= 0.0 or len(kept) == _KEPT:
            break
        if all(np.hypot(pose.x - other.pose.x, pose.y - other.pose.y) > far for other in kept):
            kept.append(Candidate(pose, score))
    return kept


def close_places(
    image: np.ndarray,
    still: Samples,
    contour: Contour,
    optics: Optics,
    bounds: tuple[int, int, int, int],
    *,
    turn: float = 0.0,
) -> list[Candidate]:
    """The three likeliest places, looked at closely, best first.

    Args:
        image: 8-bit RGB, (h, w, 3).
        still: what stands still in the video, (h, w, 3).
        contour: the body's apparent edges.
        optics: the camera.
        bounds: part of the picture to look at.
        turn: angle by which the body is turned round, rad.
    """
    rough = candidates(image, still, contour, optics, bounds, turn=turn)[:3]
    close = [refined(image, still, one, contour, optics, bounds) for one in rough]
    return sorted(close, key=lambda one: -one.score)


def refined(
    image: np.ndarray,
    still: Samples,
    start: Candidate,
    contour: Contour,
    optics: Optics,
    bounds: tuple[int, int, int, int],
) -> Candidate:
    """A candidate moved to where its edges are clearest in the full picture, to a pixel; scored in grey per pixel.

    Args:
        image: 8-bit RGB, (h, w, 3).
        still: what stands still in the video, (h, w, 3).
        start: the candidate.
        contour: the body's apparent edges.
        optics: the camera.
        bounds: part of the picture to look at.
    """
    first = contour.places(start.pose, optics)[0]
    if not np.isfinite(first).all():
        return Candidate(start.pose, 0.0)
    low = np.maximum(first.min(axis=0) - _ROOM, bounds[:2]).astype(int)
    high = np.minimum(first.max(axis=0) + _ROOM, bounds[2:]).astype(int)
    if np.any(high - low < 2 * _ROOM):
        return Candidate(start.pose, 0.0)
    part = int(low[0]), int(low[1]), int(high[0]), int(high[1])
    slope_u, slope_v, _ = _slopes(image, still, part, 1, 1.2, bounded=False)
    thin = np.arange(0, len(contour.group), _EVERY)
    group, best = contour.group[thin], Candidate(start.pose, 0.0)
    scores, shift = np.empty((2 * _REACH + 1, 2 * _REACH + 1)), np.full(2, -float(_REACH))
    for _ in range(2):
        pose = best.pose
        for turn in np.deg2rad([-3.0, -1.5, 0.0, 1.5, 3.0] if best.score == 0.0 else [-0.75, 0.0, 0.75]):
            heading = pose.heading + float(turn)
            pixels, normals, _, _ = contour.places(BodyPose(pose.x, pose.y, heading), optics)
            edge_scores(slope_u, slope_v, pixels[thin] - low, normals[thin], group, len(GROUPS), tuple(shift), scores)
            if scores.max() > best.score:
                place = shift + np.unravel_index(np.argmax(scores), scores.shape)
                middle = optics.pixels(np.array([[pose.x, pose.y, optics.axis_height]])) + place
                at = optics.points(middle, optics.axis_height)[0]
                best = Candidate(BodyPose(float(at[0]), float(at[1]), heading), float(scores.max()))
    return best


def most_likely(found: list[list[Candidate]], size: float) -> list[Candidate | None]:
    """One candidate of each frame, so that clear edges and short ways from frame to frame are balanced.

    Args:
        found: candidates of each frame; a frame may have none.
        size: the body's length, m.
    """
    chosen: list[Candidate | None] = [None] * len(found)
    seen = [index for index, some in enumerate(found) if some]
    if not seen:
        return chosen
    typical = float(np.median([found[index][0].score for index in seen]))
    totals = [np.array([entry.score / typical for entry in found[seen[0]]])]
    came: list[np.ndarray] = []
    for before, now in pairwise(seen):
        a, b = (np.array([entry.pose for entry in found[index]]) for index in (before, now))
        ways = np.hypot(a[:, None, 0] - b[None, :, 0], a[:, None, 1] - b[None, :, 1]) / size
        through = totals[-1][:, None] - 0.5 * ways
        came.append(np.argmax(through, axis=0))
        totals.append(np.max(through, axis=0) + np.array([entry.score / typical for entry in found[now]]))
    last = int(np.argmax(totals[-1]))
    for place in range(len(seen) - 1, -1, -1):
        chosen[seen[place]] = found[seen[place]][last]
        if place:
            last = int(came[place - 1][last])
    return chosen


def _slopes(
    image: np.ndarray,
    still: Samples,
    bounds: tuple[int, int, int, int],
    factor: int,
    blur: float,
    *,
    bounded: bool = True,
) -> tuple[Samples, Samples, float]:
    """Brightness gradients of a part of a picture made smaller, cut off where they are rare, and their usual size.

    Of the gradients, (w, h), the columns lie one after the other.
    """
    cv2 = required("cv2", "measuring a video", "video")
    left, top, right, bottom = bounds
    part = image[top:bottom, left:right].astype(np.float32) - _STILL * still[top:bottom, left:right].astype(np.float32)
    part = cv2.cvtColor(part, cv2.COLOR_RGB2GRAY)
    if factor > 1:
        size = max(1, part.shape[1] // factor), max(1, part.shape[0] // factor)
        part = cv2.resize(part[: size[1] * factor, : size[0] * factor], size, interpolation=cv2.INTER_AREA)
    part = np.ascontiguousarray(cv2.GaussianBlur(part, (0, 0), blur).T)
    slope_u = 0.5 * cv2.Sobel(part, cv2.CV_64F, 0, 1, ksize=1)
    slope_v = 0.5 * cv2.Sobel(part, cv2.CV_64F, 1, 0, ksize=1)
    if not bounded:
        return slope_u, slope_v, 1.0
    size_of = np.hypot(slope_u, slope_v)
    bound = max(float(np.quantile(size_of, 0.95)), 1e-3)
    shrink = np.minimum(1.0, bound / np.maximum(size_of, 1e-9))
    usual = max(float(np.mean(size_of * shrink)), 1e-3)
    return slope_u * shrink, slope_v * shrink, usual
