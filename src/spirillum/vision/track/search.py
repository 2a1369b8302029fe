"""Detection of the body in a whole picture, without a predicted pose."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple, Self

import numpy as np

from spirillum.arrays import Samples
from spirillum.kernels.core import edge_scores
from spirillum.vision.camera.optics import BodyPose, Optics
from spirillum.vision.track.contour import GROUPS, Contour
from spirillum.vision.video import opencv as cv2


@dataclass(frozen=True)
class SearchConstants:
    """Search for the body in a whole picture."""

    body_width: float = 16.0  #: Apparent width of the body in the reduced picture that is searched first, pixels.
    reduced_width: float = 48.0  #: Least apparent width of the body in a large picture that was reduced before, pixels.
    headings: tuple[float, ...] = (-8.0, -4.0, 0.0, 4.0, 8.0)  #: Headings that are tried, degrees.
    background_share: float = 0.8
    """Share of the background that is subtracted; less than 1, or a robot that hardly moves would vanish too."""
    edge_stride: int = 2  #: Every how many edge points one is used.
    column_step: int = 6  #: Columns of the reduced picture that share one computed outline, pixels.
    peaks: int = 3  #: Best places that are kept of each block of columns and heading.
    candidates: int = 5  #: Candidates that are kept of a picture.
    coarse_blur: float = 1.0  #: Standard deviation of the blur of the reduced picture, pixels.
    fine_blur: float = 1.2  #: Standard deviation of the blur of the full picture, pixels.
    reach: int = 6  #: Largest distance by which a candidate is moved in a round of refinement, pixels.
    margin: int = 24  #: Width of the surroundings of a candidate that are looked at in refinement, pixels.
    travel_penalty: float = 0.5  #: Relative score that a displacement of one body length between two frames costs.


SEARCH = SearchConstants()


class Shape(NamedTuple):
    """A body's edges before a camera, for the search of a whole picture."""

    contour: Contour  #: The apparent edges.
    thin: Contour  #: As many of them as the search uses.
    optics: Optics  #: The camera.
    bounds: tuple[int, int, int, int]  #: Part of the picture to look at: left, top, right, bottom.

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


class PoseCandidate(NamedTuple):
    """A candidate pose of the body."""

    pose: BodyPose
    score: float  #: Edge score at the pose, over the mean gradient of the picture.


def candidates(image: np.ndarray, still: Samples, body: Shape, *, turn: float = 0.0) -> list[PoseCandidate]:
    """Candidate poses of the body by a grid search over the reduced picture, best first, a body's width apart."""
    contour, optics, bounds = body.thin, body.optics, body.bounds
    left, top, _, bottom = bounds
    width = body.width
    factor = max(1, int(width / SEARCH.body_width))
    slope_u, slope_v, usual = _slopes(image, still, bounds, factor, SEARCH.coarse_blur)
    length, height = slope_u.shape
    shift = np.array([-0.5 * SEARCH.column_step, -0.5 * height])
    scores, work = np.empty((SEARCH.column_step, height + 1)), np.empty((2, len(GROUPS), height + 1))
    peaks, places, headings = [], [], []
    for column in range(SEARCH.column_step // 2, length + SEARCH.column_step // 2, SEARCH.column_step):
        start = np.array([[left + factor * column, 0.5 * (top + bottom)]], dtype=float)
        at = optics.points(start, optics.axis_height)[0]
        if not np.isfinite(at).all():
            continue
        for heading in (np.deg2rad(SEARCH.headings) + turn).tolist():
            pixels, normals, _, _ = contour.places(BodyPose(float(at[0]), float(at[1]), heading), optics)
            small = (pixels - np.array([left, top])) / factor - 0.5 + 0.5 / factor
            edge_scores(slope_u, slope_v, small, normals, contour.group, float(shift[0]), float(shift[1]), work, scores)
            best = np.argpartition(scores, -SEARCH.peaks, axis=None)[-SEARCH.peaks :]
            peaks.append(scores.ravel()[best])
            places.append(start + factor * (shift + np.column_stack(np.divmod(best, scores.shape[1]))))
            headings.append(np.full(best.size, heading))
    if not peaks:
        return []
    points = optics.points(np.concatenate(places), optics.axis_height)
    poses = np.column_stack([points[:, :2], np.concatenate(headings)])
    return _apart(np.concatenate(peaks) / usual, poses, width * optics.length_per_pixel)


def _apart(scores: Samples, poses: Samples, far: float) -> list[PoseCandidate]:
    """The best candidates (x, y, heading; (n, 3)) without near duplicates."""
    kept: list[PoseCandidate] = []
    left = np.argsort(-scores, kind="stable")
    left = left[scores[left] > 0.0]
    while left.size and len(kept) < SEARCH.candidates:
        best = left[0]
        kept.append(PoseCandidate(BodyPose(*poses[best].tolist()), float(scores[best])))
        left = left[np.hypot(*(poses[left, :2] - poses[best, :2]).T) > far]
    return kept


def searched_at(width: float, most: int) -> int:
    """Factor by which pictures are reduced in which a body is looked for, so that it is not too narrow there."""
    return max(1, min(most, int(width / SEARCH.reduced_width)))


def close_places(image: np.ndarray, still: Samples, body: Shape, *, turn: float = 0.0) -> list[PoseCandidate]:
    """The three best candidates, refined in the full picture, best first."""
    rough = candidates(image, still, body, turn=turn)[:3]
    close = [refined(image, still, body, one) for one in rough]
    return sorted(close, key=lambda one: -one.score)


def refined(image: np.ndarray, still: Samples, body: Shape, start: PoseCandidate) -> PoseCandidate:
    """Refine a candidate to a pixel in the full picture; its score is a gradient, grey values per pixel."""
    contour, optics, bounds = body.thin, body.optics, body.bounds
    first = body.contour.places(start.pose, optics)[0]
    if not np.isfinite(first).all():
        return PoseCandidate(start.pose, 0.0)
    low = np.maximum(first.min(axis=0) - SEARCH.margin, bounds[:2]).astype(int)
    high = np.minimum(first.max(axis=0) + SEARCH.margin, bounds[2:]).astype(int)
    if np.any(high - low < 2 * SEARCH.margin):
        return PoseCandidate(start.pose, 0.0)
    part = int(low[0]), int(low[1]), int(high[0]), int(high[1])
    slope_u, slope_v, _ = _slopes(image, still, part, 1, SEARCH.fine_blur, bounded=False)
    best = PoseCandidate(start.pose, 0.0)
    reach = SEARCH.reach
    count, shift = 2 * reach + 1, np.full(2, -float(reach))
    scores, work = np.empty((count, count)), np.empty((2, len(GROUPS), count))
    for _ in range(2):
        pose = best.pose
        for turn in np.deg2rad([-3.0, -1.5, 0.0, 1.5, 3.0] if best.score == 0.0 else [-0.75, 0.0, 0.75]):
            heading = pose.heading + float(turn)
            pixels, normals, _, _ = contour.places(BodyPose(pose.x, pose.y, heading), optics)
            edge_scores(
                slope_u, slope_v, pixels - low, normals, contour.group, float(shift[0]), float(shift[1]), work, scores
            )
            if scores.max() > best.score:
                place = shift + np.unravel_index(np.argmax(scores), scores.shape)
                middle = optics.pixels(np.array([[pose.x, pose.y, optics.axis_height]])) + place
                at = optics.points(middle, optics.axis_height)[0]
                best = PoseCandidate(BodyPose(float(at[0]), float(at[1]), heading), float(scores.max()))
    return best


def most_likely(found: list[list[PoseCandidate]], size: float) -> list[PoseCandidate | None]:
    """The path of candidates with the best sum of scores, less a penalty on travel (Viterbi's algorithm)."""
    chosen: list[PoseCandidate | None] = [None] * len(found)
    seen = [index for index, some in enumerate(found) if some and some[0].score > 0.0]
    if not seen:
        return chosen
    typical = float(np.median([found[index][0].score for index in seen]))
    totals = [np.array([entry.score / typical for entry in found[seen[0]]])]
    came: list[np.ndarray] = []
    for before, now in pairwise(seen):
        a, b = (np.array([entry.pose for entry in found[index]]) for index in (before, now))
        ways = np.hypot(a[:, None, 0] - b[None, :, 0], a[:, None, 1] - b[None, :, 1]) / size
        through = totals[-1][:, None] - SEARCH.travel_penalty * ways
        came.append(np.argmax(through, axis=0))
        totals.append(np.max(through, axis=0) + np.array([entry.score / typical for entry in found[now]]))
    last = int(np.argmax(totals[-1]))
    for place in range(len(seen) - 1, -1, -1):
        chosen[seen[place]] = found[seen[place]][last]
        if place:
            last = int(came[place - 1][last])
    return chosen


def _background(still: Samples, bounds: tuple[int, int, int, int], factor: int) -> Samples:
    """A part of the background, enlarged if it was reduced by a factor."""
    left, top, right, bottom = bounds
    if factor == 1:
        return still[top:bottom, left:right]
    low, high = np.array([left, top]) // factor, -(-np.array([right, bottom]) // factor)
    part = still[low[1] : high[1], low[0] : high[0]]
    large = cv2.resize(part, (part.shape[1] * factor, part.shape[0] * factor), interpolation=cv2.INTER_LINEAR)
    large = np.pad(large, ((0, factor), (0, factor), (0, 0)), mode="edge")  # beyond the last whole block
    column, row = np.array([left, top]) - factor * low
    return np.asarray(large[row : row + bottom - top, column : column + right - left])


def _slopes(
    image: np.ndarray,
    still: Samples,
    bounds: tuple[int, int, int, int],
    factor: int,
    blur: float,
    *,
    bounded: bool = True,
) -> tuple[Samples, Samples, float]:
    """Brightness gradients of a reduced region, bounded at their 95 % quantile, and their mean magnitude."""
    # The gradients are transposed, (w, h).
    left, top, right, bottom = bounds
    whole, background = (
        cv2.cvtColor(part.astype(np.float32, copy=False), cv2.COLOR_RGB2GRAY)
        for part in (image[top:bottom, left:right], _background(still, bounds, image.shape[1] // still.shape[1]))
    )
    part = whole - SEARCH.background_share * background
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
