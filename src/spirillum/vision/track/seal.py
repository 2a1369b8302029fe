"""Edges of the seal: an opaque, coloured band of known size, whatever lies under the body.

Along each edge, colours are projected onto the direction that separates a stripe best from its surroundings (Fisher's
linear discriminant). What varies in the surroundings, such as the lines of a grid under the robot, is left out by it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.kernels.core import profiles_across, seal_shares, seal_shifts
from spirillum.vision.track.constants import OUTLINE, SEAL, STRIPES
from spirillum.vision.track.contour import GROUPS, Contour
from spirillum.vision.video import opencv as cv2

_SIDES = tuple(GROUPS.index(name) for name in ("rear", "left", "right", "seal"))
_FLANKS = False, True, True, False  # which of the sides are silhouettes


class ColourPart(NamedTuple):
    """Blurred colours of a part of a picture."""

    picture: np.ndarray  #: Red, green and blue, (h, w, 3), single precision.
    origin: Samples  #: Pixel (u, v) of its upper left corner, (2,).


class SealShifts(NamedTuple):
    """Displacements of the seal's edges along their normals on a frame."""

    shifts: Samples  #: Displacements, pixels, (n,).
    known: np.ndarray  #: Whether the displacement is valid, (n,).
    variance: Samples  #: Variances by the misfit of the profiles, pixels^2, (n,).
    kind: np.ndarray  #: Class of the colour at each edge, (n,).


class _Profiles(NamedTuple):
    """Profiles across the seal's edges."""

    share: Samples  # share of the stripe's colour, 1 inside to 0 outside, (n, m)
    distance: Samples  # fisher's squared distance of the stripe from its surroundings, (n,); 0 where they look alike
    kind: np.ndarray  # class of the colour at each edge, (n,)


class SealEdges:
    """Finds the edges of the seal near expected places; learns its colours and the bias of each of them."""

    def __init__(self, contour: Contour, classes: int) -> None:
        every = np.flatnonzero(contour.seal)
        self.chosen = every[:: max(1, round(every.size / SEAL.edges))]
        groups = contour.group[self.chosen]
        self._sides = [np.flatnonzero(groups == side) for side in _SIDES]
        self._offsets = np.arange(-OUTLINE.half_profile, OUTLINE.half_profile + 1, dtype=float)
        self._ends = np.array(
            [
                [side[0], side[-1] + 1, flank] if side.size else [0, 0, flank]
                for side, flank in zip(self._sides, _FLANKS, strict=True)
            ]
        )
        self._classes = classes + 1  # colours of thin stripes at the silhouette are mixed
        from scipy.special import erf

        self._palette: Samples | None = None
        self._ground = np.tile(SEAL.noise**2 * np.eye(3), (2, 1, 1))
        self._template: Samples = -0.5 * erf(self._offsets / (np.sqrt(2.0) * SEAL.edge_blur))
        self._take(self._template)
        self._bias = np.zeros((len(_SIDES), self._classes))

    def shifts(self, part: ColourPart, pixels: Samples, normals: Samples, *, rough: bool = False) -> SealShifts:
        """Displacement of each edge along its normal."""
        found, count = self._profiles(part, pixels, normals), len(pixels)
        if rough:
            known = (found.distance > 0.0) & np.isfinite(found.share[:, 0])
            return SealShifts(self._areas(found.share), known, np.ones(count), found.kind)
        shifts, known, variance = np.empty(count), np.empty(count, dtype=bool), np.empty(count)
        template = self._ends, self._bias, self._design, self._inverses, self._starts
        limits = self._steepness, OUTLINE.largest_shift, *SEAL.strengths, OUTLINE.rounding_noise / SEAL.noise
        profiles = found.share, found.distance, found.kind
        seal_shifts(*profiles, *template, *limits, shifts, known.view(np.uint8), variance)
        return SealShifts(shifts, known, variance, found.kind)

    def learn_colours(self, parts: Sequence[ColourPart], places: Sequence[tuple[Samples, Samples]]) -> None:
        """Learn the colours at the silhouette, and the profile of an edge."""
        flanks = np.concatenate(self._sides[1:3])
        inside = self._offsets <= -1.0
        self._learn_ground(parts, places)
        colours = [
            self._colours(part, *place)[:, flanks][:, :, inside] for part, place in zip(parts, places, strict=True)
        ]
        samples = np.concatenate([found.reshape(3, -1).T for found in colours])
        samples = samples[np.isfinite(samples).all(axis=1)].astype(np.float32)
        if len(samples) > 10 * self._classes:
            criteria = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_MAX_ITER, 20, 1.0)
            cv2.setRNGSeed(1)
            _, _, centres = cv2.kmeans(samples, self._classes, None, criteria, 2, cv2.KMEANS_PP_CENTERS)
            self._palette = np.asarray(centres, dtype=float)
        shares = np.concatenate([self._profiles(part, *place).share for part, place in zip(parts, places, strict=True)])
        if len(shares := shares[np.isfinite(shares).all(axis=1)]):
            middle = np.median(shares, axis=0)
            self._template = 0.5 * (middle - middle[::-1])
        self._take(self._template)

    def _learn_ground(self, parts: Sequence[ColourPart], places: Sequence[tuple[Samples, Samples]]) -> None:
        """Learn how colours vary beside the silhouettes: a line of a grid that lies along one is no stripe's edge."""
        flanks = np.concatenate(self._sides[1:3])
        offsets, found = np.arange(SEAL.clear_distance, SEAL.ground, 1.0), []
        for part, (pixels, normals) in zip(parts, places, strict=True):
            colours = np.empty((3, flanks.size, offsets.size))
            profiles_across(part.picture, part.origin, pixels[flanks], normals[flanks], offsets, colours)
            found.append(colours.reshape(3, -1))
        seen = np.concatenate(found, axis=1)
        seen = seen[:, np.isfinite(seen).all(axis=0)]
        if seen.shape[1] > SEAL.fewest_of_kind:
            self._ground[1] = SEAL.noise**2 * np.eye(3) + SEAL.along_line * np.cov(seen)

    def learn_bias(self, residuals: Samples, kinds: np.ndarray) -> None:
        """Learn by how much each colour shifts an edge: compression blurs colours and brightness differently."""
        for number, side in enumerate(self._sides):
            for kind in range(self._classes):
                mine = residuals[:, side][kinds[:, side] == kind]
                mine = mine[np.isfinite(mine)]
                if mine.size > SEAL.fewest_of_kind:
                    self._bias[number, kind] += float(np.clip(np.median(mine), -1.0, 1.0))

    def size(self, seen: SealShifts, pixels: Samples, *, rough: bool = False) -> float:
        """Size of the seal over the expected one, by its length and its width; NaN if one is hidden, or they differ."""
        # Of a seal of another size by some pixels, borders of stripes or what lies under it are taken for the
        # silhouette, or nothing is: `rough` takes its length or its width alone where that differs.
        found, distances = np.full(2, np.nan), np.zeros(2)
        for way, ends in enumerate(((0, 3), (1, 2))):
            sides = [self._sides[side] for side in ends]
            known = [side[seen.known[side]] for side in sides]
            if min(len(side) for side in known) < SEAL.fewest_of_side:
                continue
            middles = [np.median(pixels[side], axis=0) for side in sides]
            distances[way] = np.hypot(*(middles[1] - middles[0]))
            found[way] = sum(np.median(seen.shifts[side]) for side in known) / distances[way]
        way = int(np.argmax(np.abs(np.nan_to_num(found))))
        if rough and abs(found[way]) < SEAL.proportions and abs(found[way]) * distances[way] > SEAL.one_way:
            return 1.0 + float(found[way])
        if not abs(found[1] - found[0]) < SEAL.proportions:
            return np.nan
        return 1.0 + float(np.average(found, weights=distances))

    def _colours(self, part: ColourPart, pixels: Samples, normals: Samples) -> Samples:
        """Colour profiles along the normals, (3, n, m)."""
        colours = np.empty((3, len(pixels), self._offsets.size))
        profiles_across(part.picture, part.origin, pixels, normals, self._offsets, colours)
        return colours

    def _profiles(self, part: ColourPart, pixels: Samples, normals: Samples) -> _Profiles:
        """Share of the stripe's colour across each edge."""
        colours, count = self._colours(part, pixels, normals), len(pixels)
        share, distance, kind = np.empty(colours.shape[1:]), np.empty(count), np.empty(count, dtype=np.int64)
        palette = np.empty((0, 3)) if self._palette is None else self._palette
        limits = SEAL.clear_distance, SEAL.distinct, STRIPES.white, SEAL.fewest_of_kind, SEAL.pooled
        known = colours, self._offsets, self._ends, palette, self._ground
        seal_shares(*known, *limits, np.empty((2, 3, count)), share, distance, kind)
        return _Profiles(share, distance, kind)

    def _rows(self, flank: bool) -> slice:  # noqa: FBT001 - of `_FLANKS`
        """Samples of a profile that are used: before the colours are known, the outermost stripe at a silhouette."""
        first = int(OUTLINE.half_profile - SEAL.clear_distance) if flank and self._palette is None else 0
        return slice(first, None)

    def _areas(self, share: Samples) -> Samples:
        """Displacements of edges by several pixels: by how many samples lie inside."""
        shifts = np.empty(len(share))
        for flank, side in zip(_FLANKS, self._sides, strict=True):
            rows = self._rows(flank)
            shifts[side] = np.clip(share[side][:, rows], 0.0, 1.0).sum(axis=1) + self._offsets[rows][0] - 0.5
        return shifts

    def _take(self, template: Samples) -> None:
        """Take a profile of an edge, without displacement and of contrast 1, as the template."""
        slope = np.gradient(template)
        design = np.column_stack([np.ones(template.size), template, slope])
        self._steepness = float(np.sqrt(np.sum(slope**2)))
        self._design, self._inverses = design, np.zeros((2, 3, template.size))
        self._starts = np.array([self._rows(flank).start for flank in (False, True)])
        for inverse, start in zip(self._inverses, self._starts, strict=True):
            inverse[:, start:] = np.linalg.pinv(design[start:])


def colour_part(image: np.ndarray, bounds: tuple[int, int, int, int], blur: float) -> ColourPart:
    """Blurred colours of a part (left, top, right, bottom) of a picture, 0 to 255."""
    left, top, right, bottom = bounds
    part = cv2.GaussianBlur(image[top:bottom, left:right].astype(np.float32), (0, 0), blur)
    return ColourPart(np.asarray(part), np.array([left, top], dtype=float))
