"""Steadiness of a recording: a moved camera or ruler, and changes of the whole picture from frame to frame.

Where frames are missing, the picture changes by more than one step of the motion does. Where the outline hops from one
edge of the body to another, its place jumps, and the angles that are read there with it, but the picture goes on
evenly. How much two steps at once change the picture tells what one lost frame would.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.robust import mad_scale, running_median
from spirillum.vision.camera.optics import project
from spirillum.vision.camera.ruler import Lines, lines_in, still_picture
from spirillum.vision.flag import Flag
from spirillum.vision.track.initial_detection import Start
from spirillum.vision.video import opencv as cv2
from spirillum.vision.video.frames import Frame


@dataclass(frozen=True)
class SteadinessConstants:
    """Whether camera and ruler stayed where they were."""

    parts: int = 4  #: Stretches of the video whose backgrounds are compared.
    fewest_frames: int = 3  #: Fewest frames of a stretch.
    reach: int = 12  #: Largest shift that is searched, pixels.
    peak_range: float = 0.25
    """Range of correlations below the largest one whose peaks are refined: a ruler correlates at many shifts."""
    smooth_share: float = 0.8  #: Share of the picture with the smallest gradients, which is not used.
    most_peaks: int = 6  #: Most peaks of the correlation that are refined, beside zero shift.
    clearly_better: float = 0.7  #: Residual at a shift over that near zero, below which the shift is accepted.
    rows_beside: int = 6  #: Rows beside the robot that its edges change, pixels.
    moved: float = 0.2
    """Shift of a ruler's lines from which on the camera has moved, pixels; at rest within 0.05 on rendered videos."""
    moved_roughly: float = 2.0
    """Shift of the picture alone from which on the camera has moved, pixels.

    At rest within 1 on rendered videos, also under a drifting lamp."""


STEADINESS = SteadinessConstants()


_STEPS, _STILL = 8, 0.01  # most Gauss-Newton steps, and the step below which they end, pixels
_ROW = 100  # edge pixels that are interpolated side by side
_MOST_EDGES = 8000  # about as many edge pixels are compared; more of them would not make a shift more certain
_THREADS, _LARGE = 2, 6_000_000  # threads, and the bytes of a picture from which on one has to do, for its memory


class StillPicture(NamedTuple):
    """What stands still in some pictures."""

    lines: Lines | None  #: The ruler's lines; None without a ruler.
    flat: Samples  #: High-pass filtered brightness; 0 in the rows of the robot, (h, w).


def view_of(images: Sequence[np.ndarray], start: Start, *, ruled: bool) -> StillPicture:
    """What stands still in some pictures, three or more."""
    factor = start.body.optics.size[0] // images[0].shape[1]
    still, bounds = still_picture(list(images)), start.body.shape(factor).bounds
    if start.body.optics.upright:  # the channel's shift is looked for along the rows
        left, top, right, bottom = bounds
        still, bounds = np.ascontiguousarray(np.swapaxes(still, 0, 1)), (top, left, bottom, right)
    return StillPicture(lines_in(still, bounds) if ruled else None, _flat(still, bounds, _rows_of(start, factor)))


def shift_of(first: StillPicture, other: StillPicture) -> tuple[float, bool]:
    """Shift of a view along the channel against another one, pixels, and whether it shows that the camera moved."""
    rough = shift_between(first.flat, other.flat)
    if first.lines is None:
        return rough, abs(rough) > STEADINESS.moved_roughly
    shift = rough if other.lines is None else _by_lines(first.lines, other.lines, rough)
    return shift, abs(shift) > STEADINESS.moved


def camera_flags(frames: Sequence[Frame], start: Start, *, ruled: bool) -> tuple[Flag, ...]:
    """Flag a camera or tank that moved along the channel during the video."""
    parts = [
        part
        for part in np.array_split(np.arange(len(frames)), STEADINESS.parts)
        if len(part) >= STEADINESS.fewest_frames
    ]
    if len(parts) < 2:
        return ()
    factor = start.body.optics.size[0] // frames[0].image.shape[1]
    with ThreadPoolExecutor(1 if frames[0].image.size > _LARGE else _THREADS) as pool:
        views = list(pool.map(lambda part: view_of([frames[k].image for k in part], start, ruled=ruled), parts))
        shifts = [0.0, *pool.map(lambda other: shift_of(views[0], other)[0], views[1:])]
    first = views[0].lines
    bound = STEADINESS.moved if first is not None else STEADINESS.moved_roughly
    if np.ptp(shifts) < bound:
        return ()
    step = int(np.argmax([abs(b - a) for a, b in pairwise(shifts)]))
    before, after = (float(np.median([frames[k].time for k in parts[step + more]])) for more in (0, 1))
    return (Flag.named("camera-moved", shift=factor * np.ptp(shifts), before=before, after=after),)


def _rows_of(start: Start, factor: int) -> tuple[int, int]:
    """First and last row of a reduced picture that the robot ever covers; columns, if the channel runs along these."""
    body = start.body
    wide = max(0.5 * body.robot.body.diameter, body.robot.tail.amplitude) + body.robot.tail.wire_diameter
    sides = np.array([[0.0, -wide, 0.0], [0.0, wide, 0.0]])
    across = 0 if body.optics.upright else 1
    optics = body.shape(factor).optics
    rows = [project(sides, pose, optics)[:, across] for _, pose in start.path]
    low, high = np.nanmin(rows) - STEADINESS.rows_beside, np.nanmax(rows) + STEADINESS.rows_beside
    return max(0, int(low)), max(0, int(high))


def shift_between(one: Samples, other: Samples) -> float:
    """Shift of a picture to the right of another one, pixels, robust to objects that move in it."""
    # Peaks of the normalised cross-correlation are refined by robust Gauss-Newton image alignment; the shift with the
    # least median residual is taken, or the one nearest to 0 if it fits about as well.
    inside = slice(STEADINESS.reach, -STEADINESS.reach), slice(STEADINESS.reach, -STEADINESS.reach)
    correlation = cv2.matchTemplate(other, np.ascontiguousarray(one[inside]), cv2.TM_CCOEFF_NORMED)
    peaks = np.argwhere(
        (correlation >= cv2.dilate(correlation, np.ones((3, 3))))
        & (correlation > correlation.max() - STEADINESS.peak_range)
    )
    peaks = peaks[np.argsort(-correlation[tuple(peaks.T)])[: STEADINESS.most_peaks]].tolist()
    slope_u, slope_v = (0.5 * cv2.Sobel(one, cv2.CV_32F, *order, ksize=1)[inside] for order in ((1, 0), (0, 1)))
    steep = np.hypot(slope_u, slope_v)
    edge = np.flatnonzero(steep > np.quantile(steep, STEADINESS.smooth_share))
    edge = edge[:: max(1, edge.size // _MOST_EDGES)]
    edge = edge[: edge.size // _ROW * _ROW]
    if not edge.size:
        return 0.0
    slopes, there = np.stack([slope_u.flat[edge], slope_v.flat[edge]], axis=1), one[inside].flat[edge]
    row_of, column_of = (at.reshape(-1, _ROW) + STEADINESS.reach for at in np.unravel_index(edge, steep.shape))
    found = []
    for row, column in [*peaks, [STEADINESS.reach, STEADINESS.reach]]:
        shift = np.array([column, row], dtype=float) - STEADINESS.reach
        residual = np.zeros(0)
        for _ in range(_STEPS):
            at_u, at_v = (column_of + shift[0]).astype(np.float32), (row_of + shift[1]).astype(np.float32)
            residual = cv2.remap(other, at_u, at_v, cv2.INTER_CUBIC).ravel() - there
            scale = 3.0 * float(mad_scale(residual)) + 1e-3
            weight = np.clip(1.0 - (residual / scale) ** 2, 0.0, None) ** 2
            normal = (slopes * weight[:, None]).T @ slopes + 1e-9 * np.eye(2)
            step = np.clip(np.linalg.solve(normal, slopes.T @ (weight * residual)), -1.0, 1.0)
            shift -= step
            if np.abs(step).max() < _STILL:
                break
        found.append((float(np.median(np.abs(residual))), float(shift[0])))
    best, near = min(found), min(found, key=lambda one: abs(one[1]))
    return best[1] if best[0] < STEADINESS.clearly_better * near[0] else near[1]


def _flat(still: Samples, bounds: tuple[int, int, int, int], rows: tuple[int, int]) -> Samples:
    """High-pass filtered brightness; 0 in the rows of the robot."""
    left, top, right, bottom = bounds
    grey = cv2.cvtColor(still[top:bottom, left:right].astype(np.float32, copy=False), cv2.COLOR_RGB2GRAY)
    flat = np.clip(grey / np.maximum(cv2.GaussianBlur(grey, (0, 0), 15.0), 1.0) - 1.0, -0.6, 0.6)
    flat = cv2.GaussianBlur(flat, (0, 0), 1.0)
    flat[max(0, rows[0] - top) : max(0, rows[1] - top)] = 0.0
    return np.asarray(flat)


def _by_lines(one: Lines, other: Lines, rough: float) -> float:
    """The shift by the phase of the ruler's lines, pixels; the rough shift resolves its multiple of the distance."""
    at = {(u, v): number for (u, v), number in zip(one.pixels.tolist(), one.number.tolist(), strict=True)}
    pairs = zip(other.pixels.tolist(), other.number.tolist(), strict=True)
    turns = np.array([number - at[u, v] for (u, v), number in pairs if (u, v) in at])
    if turns.size < STEADINESS.fewest_frames:
        return rough
    middle = np.angle(np.mean(np.exp(2j * np.pi * turns))) / (2.0 * np.pi)
    lines = -(middle + float(np.median((turns - middle + 0.5) % 1.0 - 0.5)))
    return one.distance * float(lines + np.round(rough / one.distance - lines))


@dataclass(frozen=True)
class PictureChangeConstants:
    """Change of the picture from frame to frame."""

    width: float = 320.0  #: Longer side to which the pictures are reduced, pixels.
    blur: float = 1.0  #: Standard deviation of the blur that takes noise away, pixels of the reduced picture.
    fewest: int = 20  #: Fewest frames for the usual change.
    around: int = 15  #: Steps of the running median.
    least: float = 1.1  #: Least change by two steps over that by one; with less, noise hides the motion.
    scatter: float = 0.4  #: Largest scatter of the change over the rise by two steps.
    share: float = 0.5  #: Share of the rise by two steps from which on a frame is missing.
    rest: float = 0.6  #: Change over the usual one below which a frame repeats the one before.


PICTURE_CHANGE = PictureChangeConstants()


class PictureChange:
    """Compares each picture with the last two."""

    def __init__(self, bounds: tuple[int, int, int, int]) -> None:
        self.bounds = bounds
        self._last: list[np.ndarray] = []

    def of(self, image: np.ndarray) -> tuple[float, float]:
        """Root mean square change of brightness from the last picture and the one before, of 255; NaN without one."""
        left, top, right, bottom = self.bounds
        part = cv2.cvtColor(image[top:bottom, left:right], cv2.COLOR_RGB2GRAY)
        share = min(1.0, PICTURE_CHANGE.width / max(part.shape))
        size = max(1, round(share * part.shape[1])), max(1, round(share * part.shape[0]))
        grey = cv2.resize(part, size, interpolation=cv2.INTER_AREA).astype(np.float32)
        grey = cv2.GaussianBlur(grey, (0, 0), PICTURE_CHANGE.blur)
        found = [cv2.norm(grey, other) / math.sqrt(grey.size) for other in self._last]
        self._last = [grey, *self._last[:1]]
        one, two = [*found, np.nan, np.nan][:2]
        return one, two


class PictureSteps(NamedTuple):
    """Evidence of the pictures about each step from a frame to the next."""

    jumps: np.ndarray  #: Mask of the steps on which the picture changes as if a frame or more were missing, (n - 1,).
    rests: np.ndarray  #: Mask of the steps on which it hardly changes, as on a repeated frame, (n - 1,).

    def jump_near(self, step: int) -> bool:
        """Whether the picture jumps at a step or beside it."""
        return bool(self.jumps[max(0, step - 1) : step + 2].any())


def picture_steps(change: Samples) -> PictureSteps | None:
    """Evidence of changes, (n, 2), about lost and repeated frames; None where they are too small or uneven."""
    if len(change) < PICTURE_CHANGE.fewest:
        return None
    one, two = change[1:, 0], change[1:, 1]
    usual = running_median(one, PICTURE_CHANGE.around)
    if not np.all(usual > 0.0):
        return None
    lost = float(np.median(two[1:] / usual[1:]))  # of the usual change, if one frame was missing
    scatter = float(mad_scale(one / usual - 1.0))
    if lost < PICTURE_CHANGE.least or scatter > PICTURE_CHANGE.scatter * (lost - 1.0):
        return None
    missing = (1.0 + PICTURE_CHANGE.share * (lost - 1.0)) * usual
    return PictureSteps(np.asarray(one > missing), np.asarray(one < PICTURE_CHANGE.rest * usual))
