"""A camera that is not still: each picture is registered to one of them, and moved to where that lies.

A ruler's lines look alike at every multiple of their distance, so that two pictures far apart in time do not show by
how many of them the camera has moved. From frame to frame they do: even the robot has hardly moved. The coarse shift
between neighbouring frames is therefore added up, and robust Gauss-Newton image alignment with the anchor takes it from
there, for shift and roll, to some hundredths of a pixel. What moves against the background is left out as outliers.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.robust import mad_scale
from spirillum.vision.video import opencv as cv2
from spirillum.vision.video.frames import Frame
from spirillum.vision.video.pictures import reduced, reduction

_COARSE = 160  # width of the reduced picture whose coarse structure is compared, pixels
_REACH = 10  # largest shift that is looked for there, pixels
_BLUR = 12.0  # standard deviation of the widest blur, pixels; wider ones take long and are made on a reduced picture
_SWAYS = 0.15  # scatter of the pictures' height, or of their sides by roll, from which on the camera sways, pixels
_STEPS, _STILL = 12, 0.005  # most Gauss-Newton steps, and the step below which they end, pixels
_STEEP = 0.85  # share of the picture with the smallest gradients, which is not used
_MOST_EDGES = 40_000  # most edge pixels that are used
_ROW = 100  # edge pixels that are interpolated side by side
_OUTLIER = 3.0  # residual over the usual one from which on a pixel does not count


class PictureRegistration(NamedTuple):
    """How a picture lies against the anchor."""

    right: float  #: Shift to the right, pixels.
    down: float  #: Shift downwards, pixels.
    roll: float  #: Angle by which it is turned clockwise about its middle, rad.


@dataclass(frozen=True)
class Anchor:
    """What stands still in the pictures of a video, to which each of them is registered."""

    flat: Samples = field(repr=False)  #: High-pass filtered brightness, (h, w).

    def pose(self, flat: Samples, start: PictureRegistration) -> PictureRegistration:
        """How a high-pass filtered picture lies against the anchor; `start` where the anchor shows no edge."""
        rows, columns, slopes, there = self._edges
        if not rows.size:
            return start
        pose = np.array(start)
        for _ in range(_STEPS):
            matrix = _matrix(PictureRegistration(*pose.tolist()), (flat.shape[1], flat.shape[0]))
            at = matrix @ np.stack([columns, rows, np.ones(rows.size)])
            at_u, at_v = at.astype(np.float32).reshape(2, -1, _ROW)
            now = cv2.remap(flat, at_u, at_v, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE).ravel()
            residual = now - there
            scale = _OUTLIER * float(mad_scale(residual)) + 1e-3
            weight = np.clip(1.0 - (residual / scale) ** 2, 0.0, None) ** 2
            normal = (slopes * weight[:, None]).T @ slopes + 1e-9 * np.eye(3)
            step = np.linalg.solve(normal, slopes.T @ (weight * residual))
            step *= min(1.0, 1.0 / max(float(np.abs(step[:2]).max()), 1e-9))
            pose -= step
            if max(np.abs(step[:2]).max(), 0.5 * flat.shape[1] * abs(step[2])) < _STILL:
                break
        return PictureRegistration(*pose.tolist())

    def steadied(self, image: np.ndarray, pose: PictureRegistration) -> np.ndarray:
        """A picture moved to where the anchor is; beyond its borders they go on as they are."""
        size = (image.shape[1], image.shape[0])
        flags = cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP
        moved = cv2.warpAffine(image, _matrix(pose, size), size, flags=flags, borderMode=cv2.BORDER_REPLICATE)
        return np.asarray(moved)

    @cached_property
    def _edges(self) -> tuple[np.ndarray, np.ndarray, Samples, Samples]:
        """Rows and columns of the steepest pixels, slopes by right, down and roll, and their brightness."""
        slope_u, slope_v = (0.5 * cv2.Sobel(self.flat, cv2.CV_32F, *order, ksize=1) for order in ((1, 0), (0, 1)))
        steep = np.hypot(slope_u, slope_v)
        margin = _REACH * self.flat.shape[1] // _COARSE
        steep[:margin] = steep[-margin:] = 0.0
        steep[:, :margin] = steep[:, -margin:] = 0.0
        chosen = np.argwhere(steep > np.quantile(steep, _STEEP))
        chosen = chosen[:: max(1, len(chosen) // _MOST_EDGES)]
        rows, columns = chosen[: len(chosen) // _ROW * _ROW].T
        u, v = slope_u[rows, columns].astype(float), slope_v[rows, columns].astype(float)
        height, width = self.flat.shape
        x, y = columns - 0.5 * (width - 1), rows - 0.5 * (height - 1)
        return rows, columns, np.stack([u, v, v * x - u * y], axis=1), self.flat[rows, columns].astype(float)


class Steadied(NamedTuple):
    """How a camera swayed during a video."""

    anchor: Anchor  #: The first picture, reduced where it is large.
    times: Samples  #: Times of the frames, s, (n,).
    poses: Samples  #: How each lies against the anchor: right and down, pixels, roll, rad, (n, 3).

    def frame(self, frame: Frame) -> Frame:
        """A frame as a camera would have taken it that did not move."""
        place = int(np.argmin(np.abs(self.times - frame.time)))
        pose = PictureRegistration(*self.poses[place].tolist())
        return replace(frame, image=self.anchor.steadied(frame.image, pose))


def sways(frames: Sequence[Frame]) -> bool:
    """Whether some pictures lie higher and lower than others, or are turned, as those of a camera in a hand."""
    # Along the rows a ruler's lines may hide it: a hand does not move in one direction alone.
    flats = (_flat(frame.reduced(_reduction(frame))) for frame in frames)
    anchor = Anchor(next(flats))
    poses = np.array(
        [PictureRegistration(0.0, 0.0, 0.0), *(anchor.pose(flat, PictureRegistration(0.0, 0.0, 0.0)) for flat in flats)]
    )
    down, turned = poses[:, 1], 0.5 * anchor.flat.shape[1] * poses[:, 2]
    return max(float(mad_scale(values - np.median(values))) for values in (down, turned)) > _SWAYS


def steadied(frames: Iterable[Frame]) -> Steadied:
    """Register all frames of a video to the first one."""
    anchor: Anchor | None = None
    before: Samples = np.empty((0, 0, 0))
    times, poses = [], []
    pose = PictureRegistration(0.0, 0.0, 0.0)
    factor = 1
    for frame in frames:
        factor = _reduction(frame)
        flat = _flat(reduced(frame.image, factor))
        now = _texture(flat)
        if anchor is None:
            anchor = Anchor(flat)
        else:
            right, down = _coarse_shift(before, now, flat.shape[1])
            pose = anchor.pose(flat, PictureRegistration(pose.right + right, pose.down + down, pose.roll))
        before = now
        times.append(frame.time)
        poses.append(pose)
    assert anchor is not None  # noqa: S101 - a video has a frame
    return Steadied(anchor, np.array(times), np.array(poses) * np.array([factor, factor, 1.0]))


def _reduction(frame: Frame) -> int:
    """Factor by which a frame is reduced before it is registered."""
    return reduction((frame.image.shape[1], frame.image.shape[0]))


def _matrix(pose: PictureRegistration, size: tuple[int, int]) -> Samples:
    """From places in the anchor to places in the picture, (2, 3)."""
    c, s = np.cos(pose.roll), np.sin(pose.roll)
    x, y = 0.5 * (size[0] - 1), 0.5 * (size[1] - 1)
    return np.array([[c, -s, x - c * x + s * y + pose.right], [s, c, y - s * x - c * y + pose.down]])


def _flat(image: np.ndarray) -> Samples:
    grey = cv2.cvtColor(image.astype(np.float32), cv2.COLOR_RGB2GRAY)
    wide = max(15.0, grey.shape[1] / 20.0)
    few = max(1, int(wide / _BLUR))
    size = grey.shape[::-1]
    small = grey if few == 1 else cv2.resize(grey, (size[0] // few, size[1] // few), interpolation=cv2.INTER_AREA)
    ground = cv2.GaussianBlur(small, (0, 0), wide / few)
    ground = ground if few == 1 else cv2.resize(ground, size)
    flat = np.divide(grey, np.maximum(ground, 1.0, out=ground), out=grey)
    flat -= 1.0
    return np.asarray(cv2.GaussianBlur(np.clip(flat, -0.6, 0.6, out=flat), (0, 0), 1.0))


def _texture(flat: Samples) -> Samples:
    """Coarse structure in a reduced picture, bounded."""
    factor = max(1, flat.shape[1] // _COARSE)
    blurred = cv2.GaussianBlur(flat, (0, 0), flat.shape[1] / _COARSE)
    size = flat.shape[1] // factor, flat.shape[0] // factor
    small = cv2.resize(blurred[: size[1] * factor, : size[0] * factor], size, interpolation=cv2.INTER_AREA)
    slope = cv2.Sobel(small, cv2.CV_32F, 1, 0, ksize=1)  # along the rows tube and paper are uniform
    return np.stack([small, slope]).astype(np.float32)


def _coarse_shift(one: Samples, other: Samples, width: int) -> tuple[float, float]:
    """Shift of the second texture against the first one, pixels of the full picture."""
    inside = np.ascontiguousarray(one[:, _REACH:-_REACH, _REACH:-_REACH])
    score = sum(cv2.matchTemplate(b, a, cv2.TM_CCOEFF_NORMED) for a, b in zip(inside, other, strict=True))
    row, column = (int(place) for place in np.unravel_index(int(np.argmax(score)), score.shape))
    fine = [_peak(score[row, :], column), _peak(score[:, column], row)]
    factor = max(1, width // _COARSE)
    return factor * (fine[0] - _REACH), factor * (fine[1] - _REACH)


def _peak(values: Samples, at: int) -> float:
    """Place of a maximum by the parabola through it and its neighbours."""
    if not 0 < at < values.size - 1:
        return float(at)
    low, middle, high = (float(values[at + k]) for k in (-1, 0, 1))
    return at + 0.5 * (low - high) / min(low - 2.0 * middle + high, -1e-12)
