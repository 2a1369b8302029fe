"""How large the body looks against its file at the stated scale: a second scale, beside that of the ruler.

A wrong spacing, height or robot file makes the body look too large or too small. Its apparent size is where the
brightness of its edges changes most, against where its outline has them; far from the stated one, the size at which
the body stands out most clearly. Rates do not depend on lengths, so that the robot is followed at its apparent size;
lengths are those of the stated scale, and doubted.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.kernels.edges import sums_along
from spirillum.vision.camera.optics import BodyPose
from spirillum.vision.camera.scale import Scale, with_source
from spirillum.vision.flag import Flag
from spirillum.vision.track.body import BodyFinder
from spirillum.vision.track.constants import SIZE
from spirillum.vision.track.search import Candidate, close_places

__all__ = ["LENGTHS", "OutlineFit", "another_size", "clearness", "doubted", "outline_seen", "resized"]

_THREADS = 2
_SIZES = 2.0 ** (np.array([*range(-8, -1), *range(2, 9)]) / 8.0)
"""Sizes that are tried over the stated one; those between are found from the edges."""
_FINE = 8
"""Samples of the edges' steepness in a pixel."""
_SPANS = (0.08, 3.0, 3.0, 0.05), (0.01, 0.5, 0.5, 0.01), (0.002, 0.1, 0.1, 0.002)
"""Reach of size, place (pixels) and heading (rad) in each round of the search."""
_COUNTS = 13, 9, 5

LENGTHS = ("forward_velocity", "lateral_position", "lateral_wobble_at_tail_rate", "lateral_wobble_at_body_rate")
"""Quantities that are proportional to the scale."""


def clearness(found: Sequence[Sequence[Candidate]]) -> float:
    """How clearly something stands out as a robot does: score of the best place over the third best, the usual one.

    Args:
        found: the likeliest places on some frames.
    """
    return float(np.median([some[0].score / max(some[2].score, 1e-9) if len(some) > 2 else 0.0 for some in found]))


def _likeness(found: Sequence[Sequence[Candidate]]) -> float:
    """How much like a robot that is: a part of one may stand out as clearly, but has fainter edges."""
    return clearness(found) * float(np.median([some[0].score if some else 0.0 for some in found]))


def another_size(body: BodyFinder, images: Sequence[np.ndarray], still: Samples) -> float | None:
    """The size, from half to twice the stated one, at which something looks most like the robot.

    Args:
        body: the robot's body at the stated scale.
        images: some frames, 8-bit RGB, (h, w, 3) each.
        still: what stands still in them, (h, w, 3).

    Returns:
        The size over the stated one; None if nothing stands out as a robot does.
    """
    few = [images[k] for k in np.unique(np.linspace(0, len(images) - 1, SIZE.looked_at).round().astype(int))]

    def at(size: float) -> list[list[Candidate]]:
        other = resized(body, float(size))
        return [close_places(image, still, other) for image in few]

    with ThreadPoolExecutor(_THREADS) as pool:  # the compiled loops run side by side
        tried = list(pool.map(at, _SIZES))
    alike = [_likeness(places) if clearness(places) > SIZE.clearness else 0.0 for places in tried]
    best = int(np.argmax(alike))
    return float(_SIZES[best]) if alike[best] > 0.0 else None


def resized(body: BodyFinder, size: float) -> BodyFinder:
    """A finder of this body in front of a camera that shows everything larger; it has not learnt yet.

    Args:
        body: the body.
        size: factor.
    """
    return BodyFinder(body.robot, replace(body.optics, focal=body.optics.focal * size), body.bounds)


class OutlineFit(NamedTuple):
    """How the outline lies against what was taken for it."""

    size: float
    """Its size over that of the robot's file."""
    move: BodyPose
    """What has to be added to the body's places, m and rad."""

    @property
    def resizes(self) -> bool:
        """Whether it is of another size, beyond what light and glare do to edges."""
        return bool(abs(self.size - 1.0) > SIZE.tolerance[0])

    def fits(self, pixel: float) -> bool:
        """Whether it lies as it was taken, to what light and glare do to edges; `pixel` is the length of one, m."""
        off = np.abs([self.size - 1.0, self.move.x / pixel, self.move.y / pixel, self.move.heading])
        return bool(np.all(off <= SIZE.tolerance))


def outline_seen(body: BodyFinder, pose: BodyPose) -> OutlineFit:
    """Where the outline of a body that has learnt lies, and how large it is, within 8 %, 3 pixels and 3 degrees.

    Of all sizes and places, the one is taken at which the steepest brightness lies on most of the outline, each kind of
    edge alike: glare and shades have edges too, which agree on no size.

    Args:
        body: the body.
        pose: where it was taken to be.
    """
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
        if not best.any():  # the stated size is believed before all others
            scores[np.abs(tried[:, 0]) <= SIZE.stated_range] *= SIZE.stated_preference
        best = tried[int(np.argmax(scores))]
    return OutlineFit(1.0 + float(best[0]), BodyPose(*(best[1:] * units).tolist()))


def _blurred(steep: Samples) -> Samples:
    """Steepness with the width to which edges are one."""
    sigma = _FINE * SIZE.edge_width
    far = int(np.ceil(4.0 * sigma))
    bell = np.exp(-0.5 * (np.arange(-far, far + 1) / sigma) ** 2)
    around = np.lib.stride_tricks.sliding_window_view(np.pad(steep, ((0, 0), (far, far))), 2 * far + 1, axis=1)
    return np.asarray(around @ (bell / bell.sum()))


def doubted(scale: Scale, body: BodyFinder, size: float) -> tuple[Scale, tuple[Flag, ...]]:
    """A scale that the apparent size of the body contradicts, with what follows from it.

    Args:
        scale: by the ruler.
        body: the body.
        size: its apparent size over that of its file.
    """
    scale = replace(scale, apparent_size=size)
    half = 0.5 * body.robot.body.length / scale.length_per_pixel
    off = float(abs(np.log(size)))
    if off < SIZE.doubt * np.sqrt(scale.relative_uncertainty**2 + SIZE.build_error**2 + (SIZE.edge_error / half) ** 2):
        return scale, ()
    how = f"{100 * abs(size - 1.0):.1f} % {'larger' if size > 1.0 else 'smaller'} than its file says"
    if off > SIZE.largest_difference:
        how = f"{size:.3g} times as large as its file says"
    sentence = (
        f"the body looks {how} at this scale: spacing, heights or index of the setup, or the robot's size, are wrong; "
    )
    if off > SIZE.largest_difference:
        return scale, (Flag("size-does-not-fit", sentence + "no length and no speed is given", LENGTHS),)
    wider = with_source(scale, "size of the body", off)
    return wider, (Flag("size-does-not-fit", sentence + "the intervals of lengths and speeds are wider for it"),)
