"""Apparent size of the body, a check of the ruler, and the direction of the channel where there is no ruler.

A wrong spacing, height or robot file makes the body appear too large or too small. The apparent size is fitted by
matching the outline to the steepest brightness gradients; far from 1, by the size at which the body is detected most
clearly. The robot is followed at its apparent size, as rates do not depend on lengths. Lengths are those of the stated
scale, with a larger uncertainty.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.kernels.core import sums_along
from spirillum.robust import mad_scale, repeated_median_line
from spirillum.vision.camera.optics import BodyPose, Optics
from spirillum.vision.camera.scale import Scale, with_source
from spirillum.vision.flag import Flag
from spirillum.vision.track.body import BodyFinder
from spirillum.vision.track.constants import SIZE
from spirillum.vision.track.contour import contour_of
from spirillum.vision.track.search import PoseCandidate, Shape, close_places

_THREADS = 2
_SIZES = 2.0 ** (np.array([*range(-8, -1), *range(2, 9)]) / 8.0)
"""Candidate sizes over the expected one; sizes in between are fitted to the edges."""
_RUNS = tuple(map(tuple, np.split(_SIZES, 2)))
"""Sizes that are looked for with one computed outline, that of the least of them: its camera sees farthest."""
_FINE = 8  # samples of the edges' gradient profile per pixel
_SPANS = (0.08, 3.0, 3.0, 0.05), (0.01, 0.5, 0.5, 0.01), (0.002, 0.1, 0.1, 0.002)
"""Half ranges of size, position (pixels) and heading (rad) in each round of the grid search."""
_COUNTS = 13, 9, 5  # grid points of each parameter in each round


def clearness(found: Sequence[Sequence[PoseCandidate]]) -> float:
    """Clearness of a detection: median score of the best candidate over that of the third best, which is clutter."""
    return float(np.median([some[0].score / max(some[2].score, 1e-9) if len(some) > 2 else 0.0 for some in found]))


def best_other_size(
    body: BodyFinder, images: Sequence[np.ndarray], still: Samples, least: float = SIZE.clearness, about: float = 1.0
) -> float | None:
    """The size, half to twice the expected one, at which an object resembles the robot most; None if unclear."""
    few = [images[k] for k in np.unique(np.linspace(0, len(images) - 1, SIZE.looked_at).round().astype(int))]
    factor = body.optics.size[0] // still.shape[1]
    expected = _magnified(body.optics, about)
    contours = {run: contour_of(body.robot, _magnified(expected, min(run))) for run in _RUNS}

    def at(size: float) -> float:
        [contour] = [contour for run, contour in contours.items() if size in run]
        other = Shape.of(contour, _magnified(expected, size).reduced(factor), body.bounds, factor)
        places: list[list[PoseCandidate]] = []
        for image in few:
            places.append(close_places(image, still, other))
            unclear = [one for one in places if clearness([one]) <= least]
            if 2 * len(unclear) >= len(few) + 1:
                return 0.0  # the others do not raise the median
        if (clear := clearness(places)) <= least:
            return 0.0
        # A part of a robot may be as clear, but has fainter edges.
        return clear * float(np.median([some[0].score if some else 0.0 for some in places]))

    with ThreadPoolExecutor(_THREADS) as pool:  # the compiled loops release the GIL
        resemblance = list(pool.map(at, _SIZES.tolist()))
    best = int(np.argmax(resemblance))
    return float(_SIZES[best]) if resemblance[best] > 0.0 else None


def resized(body: BodyFinder, size: float) -> BodyFinder:
    """An untrained finder of a body under a camera with a larger magnification."""
    contour = body.contour if size == 1.0 else None
    return BodyFinder(body.robot, _magnified(body.optics, size), body.bounds, contour, colours=body.colours)


def _magnified(optics: Optics, size: float) -> Optics:
    """A camera before which everything looks larger by a factor."""
    return replace(optics, focal=optics.focal * size)


class OutlineFit(NamedTuple):
    """Misfit of an outline against the edges in the picture."""

    size: float  #: Apparent size over that of the robot file.
    move: BodyPose  #: Correction to be added to the pose, m and rad.

    @property
    def resizes(self) -> bool:
        """Whether the size differs from 1 beyond the bias of shading and glare."""
        return bool(abs(self.size - 1.0) > SIZE.tolerance[0])

    def fits(self, pixel: float, *, stated: bool = True) -> bool:
        """Whether size and pose are correct within the bias of shading and glare."""
        off = np.abs([self.size - 1.0, self.move.x / pixel, self.move.y / pixel, self.move.heading])
        return bool(np.all(off <= SIZE.tolerance)) and (stated or bool(off[0] <= SIZE.found))


def apparent_outline(body: BodyFinder, pose: BodyPose) -> OutlineFit:
    """Size and pose correction of the outline, by a grid search within 8 %, 3 pixels and 3 degrees."""
    # Maximises the mean squared gradient along the outline, with equal weights of the groups of edges. Edges of glare
    # and shadows agree on no size, so that they do not bias the maximum.
    pixels, normals, _, slopes = body.contour.places(pose, body.optics)
    middle = body.optics.pixels(np.array([[pose.x, pose.y, body.optics.axis_height]]))
    units = np.array([body.optics.length_per_pixel, body.optics.length_per_pixel, 1.0])
    design = np.column_stack([np.sum((pixels - middle) * normals, axis=1), slopes * units])
    offsets = np.linspace(-body.half, body.half, _FINE * 2 * body.half + 1)
    steep, weight = body.steepness(offsets)
    group = body.contour.group
    weight = weight / np.maximum(np.bincount(group, weight)[group], 1e-300)
    steep = np.ascontiguousarray(weight[:, None] * _blurred(steep))
    best = np.zeros(4)
    for span, count in zip(_SPANS, _COUNTS, strict=True):
        grids = [at + np.linspace(-far, far, count) for at, far in zip(best, span, strict=True)]
        tried = np.stack([grid.ravel() for grid in np.meshgrid(*grids, indexing="ij")], axis=1)
        scores = np.empty(len(tried))
        sums_along(steep, design * _FINE, float(body.half * _FINE), tried, scores)
        if not best.any():  # prior for the stated size
            scores[np.abs(tried[:, 0]) <= SIZE.stated_range] *= SIZE.stated_preference
        best = tried[int(np.argmax(scores))]
    return OutlineFit(1.0 + float(best[0]), BodyPose(*(best[1:] * units).tolist()))


def _blurred(steep: Samples) -> Samples:
    """Gradient profiles, smoothed over the width within which edges count as coincident."""
    sigma = _FINE * SIZE.edge_width
    far = int(np.ceil(4.0 * sigma))
    bell = np.exp(-0.5 * (np.arange(-far, far + 1) / sigma) ** 2)
    around = np.lib.stride_tricks.sliding_window_view(np.pad(steep, ((0, 0), (far, far))), 2 * far + 1, axis=1)
    return np.asarray(around @ (bell / bell.sum()))


class CheckedScale(NamedTuple):
    """The scale as the apparent sizes of body and tail leave it."""

    scale: Scale  #: With the apparent size, and a larger uncertainty where the ruler is doubted.
    flags: tuple[Flag, ...]  #: What contradicts it.
    roll_error: float  #: Standard error of the body's angle by an outline that is not the body's, rad.


def checked_scale(
    scale: Scale, body: BodyFinder, size: float, spacing: float | None = None, tail: float = np.nan
) -> CheckedScale:
    """Compare the scale with the apparent sizes of body and tail."""
    # A body of another size alone is a reason to doubt its outline: the rim of a glass cover, its contents or a grid
    # may be taken for it. Where the tail, whose wavelength is measured apart from any outline, agrees with the body,
    # the ruler or the heights are doubted; where it agrees with the ruler, the outline.
    scale = replace(scale, apparent_size=size)
    half = 0.5 * body.robot.body.length / scale.length_per_pixel
    off = float(abs(np.log(size)))
    if off < SIZE.doubt * np.sqrt(scale.relative_uncertainty**2 + SIZE.build_error**2 + (SIZE.edge_error / half) ** 2):
        return CheckedScale(scale, (), 0.0)
    agrees = SIZE.tail_agrees * off
    if abs(np.log(tail / size)) < agrees:
        return _doubtful_ruler(scale, size, off, spacing)
    return _doubtful_outline(scale, size, off, tail, ruler=bool(abs(np.log(tail)) < agrees))


def _doubtful_ruler(scale: Scale, size: float, off: float, spacing: float | None) -> CheckedScale:
    """What follows where body and tail agree on another scale."""
    would = (
        ""
        if spacing is None
        else f" (about markers.spacing = {1e3 * spacing / size:.3g} mm in place of {1e3 * spacing:.3g} mm would fit)"
    )
    far = off > SIZE.largest_difference
    flag = Flag.named("size-far-off" if far else "size-does-not-fit", ratio=_describe_ratio(size), would=would)
    return CheckedScale(scale if far else with_source(scale, "size of the body", off), (flag,), 0.0)


def _doubtful_outline(scale: Scale, size: float, off: float, tail: float, *, ruler: bool) -> CheckedScale:
    """What follows where nothing but the body's outline contradicts the scale."""
    if ruler:
        why = f"the tail is as long as it should be within {100 * abs(tail - 1.0):.1f} %"
        remedy = "correct body.length and body.diameter of the robot file only where it lies on the body"
    else:
        why = "the tail says nothing of it" if np.isnan(tail) else "the tail agrees with neither"
        remedy = "where it lies on the body, measure spacing, heights, index and body again"
    wider = scale if ruler else with_source(scale, "size of the body", off)
    far = off > (SIZE.largest_difference if ruler else SIZE.unconfirmed)
    name = "outline-far-off" if far else "outline-does-not-fit"
    flag = Flag.named(name, ratio=_describe_ratio(size), why=why, remedy=remedy)
    return CheckedScale(wider, (flag,), SIZE.roll_error * off)


def _describe_ratio(size: float) -> str:
    """An apparent size over that of the robot file, in words."""
    if abs(np.log(size)) > SIZE.largest_difference:
        return f"{size:.3g} times as large as the robot file says"
    return f"{100 * abs(size - 1.0):.1f} % {'larger' if size > 1.0 else 'smaller'} than the robot file says"


@dataclass(frozen=True)
class DirectionConstants:
    """Direction of the channel without a ruler."""

    frames: int = 10  #: Fewest frames with a place.
    way: float = 20.0  #: Least displacement of a robot over the scatter of its positions for a direction.
    least: float = 0.026
    """Least angle to the rows of the picture, rad: below it lengths are wrong by less than the lens's 0.03 %."""


DIRECTION = DirectionConstants()


class AlignedTrack(NamedTuple):
    """Places and headings against the channel."""

    position: Samples  #: Along and across the channel, m, (n, 2).
    heading: Samples  #: Angle of the motor axis to the channel, rad, (n,).
    flags: tuple[Flag, ...]


def align_with_path(time: Samples, position: Samples, heading: Samples) -> AlignedTrack:
    """Turn a track so that x runs along the robot's path."""
    # A ruler shows how the camera is rolled against the channel; a stated scale does not. The channel then runs where
    # the robot goes, by robust lines through its places; or, for a robot that hardly moves, along its motor axis.
    known = np.isfinite(position).all(axis=1)
    if np.count_nonzero(known) < DIRECTION.frames:
        return AlignedTrack(position, heading, ())
    at, places = time[known], position[known].T
    lines = [repeated_median_line(at, values) for values in places]
    way = np.array([float(line.slope) for line in lines]) * np.ptp(at)
    scatter = float(mad_scale(np.array([values - line.at(at) for line, values in zip(lines, places, strict=True)])))
    moves = float(np.hypot(*way)) > DIRECTION.way * scatter
    roll = float(np.arctan2(way[1], way[0])) if moves else float(np.nanmedian(heading))
    roll -= np.pi * round(roll / np.pi)  # forwards and backwards are one direction
    if abs(roll) < DIRECTION.least:
        return AlignedTrack(position, heading, ())
    c, s = np.cos(roll), np.sin(roll)
    flag = Flag.named("camera-rolled", how="moves" if moves else "lies", angle=np.degrees(roll))
    return AlignedTrack(position @ np.array([[c, -s], [s, c]]), heading - roll, (flag,))
