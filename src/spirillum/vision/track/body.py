"""Pose of the body on a frame, to subpixel accuracy, by a robust fit to all of its edges."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.kernels.core import profiles_across, robust_change, shifts_of_profiles
from spirillum.robot.robot import Robot
from spirillum.robust import mad_scale, theil_sen_line
from spirillum.vision.camera.optics import BodyPose, Optics
from spirillum.vision.track.constants import OUTLINE, SEAL
from spirillum.vision.track.contour import GROUPS, Contour, contour_of
from spirillum.vision.track.seal import ColourPart, SealEdges, colour_part
from spirillum.vision.track.search import Shape
from spirillum.vision.track.track import cue_shifts
from spirillum.vision.video import opencv as cv2


class PoseFit(NamedTuple):
    """Pose of the body on a frame, with its quality of fit."""

    pose: BodyPose
    error: BodyPose  #: Standard errors, m and rad; NaN where the fit failed.
    share: float  #: Inlier share of the edges in view, 0 to 1.
    inside: float  #: Share of the edges that lie in the picture, 0 to 1.
    elongation: float = np.nan
    """By how much nose and rear lie farther apart than the level body's edges do, m; NaN without edges at both."""
    cues: Samples | None = None
    """Displacement of each cue of edges from the pose, and its standard error: see `cue_shifts`; None if unknown."""
    sideways: float = np.nan
    """Displacement of the seal's flanks from the pose, across the channel, m; NaN where they are hidden."""

    @property
    def known(self) -> bool:
        """Whether the fit succeeded."""
        return bool(np.isfinite(self.error.x))


@dataclass
class _Part:
    """A part of a picture, blurred a little, and the outline there at the last pose that was looked at."""

    grey: np.ndarray  # brightness, (h, w, 1), single precision
    origin: Samples  # pixel (u, v) of its upper left corner, (2,)
    colours: ColourPart | None  # its colours; None where they are not needed, or nothing is in view
    pose: BodyPose  # the pose
    places: tuple[Samples, Samples, Samples, Samples]  # the edges at this pose: see `Contour.places`
    profiles: Samples | None = None  # brightness across them; None where it was not needed yet


class _Edges(NamedTuple):
    """Edges on a frame."""

    shifts: Samples  # displacements along their normals, pixels, (n,)
    known: np.ndarray  # whether they are valid, (n,)
    variance: Samples  # their variances, pixels^2, (n,); infinite where invalid
    slopes: Samples  # jacobian of the displacements by the pose, (n, 3)
    inside: np.ndarray  # whether the edge lies in the picture, (n,)
    votes: np.ndarray  # whether it moves with the body, (n,)


class BodyFinder:
    """Fits the pose of a body frame by frame, with templates of its edges that it learns from the video."""

    def __init__(
        self,
        robot: Robot,
        optics: Optics,
        bounds: tuple[int, int, int, int],
        contour: Contour | None = None,
        *,
        colours: int = 0,
    ) -> None:
        """Compute the apparent contour of the body within bounds (left, top, right, bottom), unless it is given."""
        self.robot, self.optics, self.bounds, self.colours = robot, optics, bounds, colours
        self.contour = contour_of(robot, optics) if contour is None else contour
        self._shapes: dict[int, Shape] = {}
        self.half = OUTLINE.half_profile
        self.offsets = np.arange(-self.half, self.half + 1, dtype=float)
        self._template: Samples | None = None
        self._derivative: Samples = np.empty((0, 0))
        self._strength: Samples = np.empty(0)
        self._steepness: Samples = np.empty(0)
        self._bias = np.zeros(len(self.contour.group))
        self._scatter = self.contour.floor.copy()
        self.seal = SealEdges(self.contour, colours) if colours else None
        self._on_seal = np.empty(0, dtype=np.int64) if self.seal is None else self.seal.chosen
        self._seal_contour = self.contour.some(self._on_seal)
        group = self.contour.group
        self._cue = np.concatenate([self.contour.cue, self.contour.cue[self._on_seal]])
        self._ends = group == GROUPS.index("front"), np.isin(group, [GROUPS.index("rear"), GROUPS.index("seal")])
        flank = np.isin(group[self._on_seal], [GROUPS.index("left"), GROUPS.index("right")])
        self._flanks = [np.flatnonzero(group[self._on_seal] == GROUPS.index(side)) for side in ("left", "right")]
        self._seal_floor = np.where(flank, SEAL.floors[1], SEAL.floors[0])
        self._seal_scatter = self._seal_floor.copy()
        self.margin = int(self.half + 4 * OUTLINE.blur + 4)
        middle = self.contour.places(BodyPose(float(optics.origin[0]), float(optics.origin[1]), 0.0), optics)[0]
        spacing = float(np.median(np.hypot(*np.diff(middle, axis=0).T)))
        self._correlation = max(1.0, OUTLINE.noise_correlation / max(spacing, 0.1))

    def shape(self, factor: int = 1) -> Shape:
        """What is looked for in whole pictures."""
        if factor not in self._shapes:
            self._shapes[factor] = Shape.of(self.contour, self.optics.reduced(factor), self.bounds, factor)
        return self._shapes[factor]

    def look_within(self, bounds: tuple[int, int, int, int]) -> None:
        """Change the part of the picture to look at: left, top, right, bottom."""
        self.bounds, self._shapes = bounds, {}

    def learn(self, images: list[np.ndarray], poses: list[BodyPose], times: Samples) -> list[PoseFit]:
        """Learn the edges' templates from frames with poses known to about a pixel; return the refined poses."""
        poses = _smooth(list(poses), times)
        self._bias, self._scatter = np.zeros(len(self.contour.group)), self.contour.floor.copy()
        parts = [self._part(image, pose) for image, pose in zip(images, poses, strict=True)]
        found: list[PoseFit] = []
        if self.seal is not None:  # what does not move along with the seal is not the body's
            found = self._learn_seal(parts, poses)
            poses = [new.pose if new.known else old for new, old in zip(found, poses, strict=True)]
            poses = _smooth(poses, times, SEAL.off_path)
        for turn in range(OUTLINE.learning_rounds if self.seal is None else SEAL.joint_rounds):
            stack = [self._profiles(part, pose) for part, pose in zip(parts, poses, strict=True)]
            self._learn_profiles(np.stack(stack))
            if self.seal is not None and turn == 0:
                self._learn_biases(parts, found, SEAL.follows_seal)
            found = [self._place(part, pose) for part, pose in zip(parts, poses, strict=True)]
            if self.seal is not None or turn >= OUTLINE.smoothed_rounds:
                self._learn_biases(parts, found)
            poses = [new.pose if new.known else old for new, old in zip(found, poses, strict=True)]
            if self.seal is None and turn < OUTLINE.smoothed_rounds:
                poses = _smooth(poses, times)
        return found

    def _learn_seal(self, parts: list[_Part], poses: list[BodyPose]) -> list[PoseFit]:
        """Learn the seal's colours from frames with approximately known poses; the poses by its edges alone."""
        assert self.seal is not None  # noqa: S101 - checked by the caller
        for turn in range(SEAL.learning_rounds):
            if turn < 2:
                coloured = [part.colours for part in parts if part.colours is not None]
                places = [
                    self._seal_places(pose) for part, pose in zip(parts, poses, strict=True) if part.colours is not None
                ]
                self.seal.learn_colours(coloured, places)
            found = [self._place(part, pose, seal_only=True) for part, pose in zip(parts, poses, strict=True)]
            self._learn_seal_biases(parts, found)
            poses = [new.pose if new.known else old for new, old in zip(found, poses, strict=True)]
        return found

    def _seal_places(self, pose: BodyPose) -> tuple[Samples, Samples]:
        """Pixels and normals of the seal's edges."""
        pixels, normals, _, _ = self._seal_contour.places(pose, self.optics)
        return pixels, normals

    def profiles(self, image: np.ndarray, pose: BodyPose) -> Samples:
        """Brightness across each edge of a body at a pose, of 255, (n, m); NaN out of view."""
        return self._profiles(self._part(image, pose), pose)

    def steepness(self, offsets: Samples) -> tuple[Samples, Samples]:
        """Squared gradient of each edge's template along its normal, and weights of the edges.

        Args:
            offsets: pixels outward from the outline, (m,).

        Returns:
            Squared gradients, normalised to a sum of 1 for each edge, (n, m), and weights, (n,), 0 for unstable edges.
        """
        assert self._template is not None  # noqa: S101 - learnt first
        from scipy.interpolate import CubicSpline

        steep = CubicSpline(self.offsets, self._template, axis=1)(offsets, 1) ** 2
        weight = np.where(self._scatter < OUTLINE.trusted_error, np.minimum(self._strength, OUTLINE.strength_cap), 0.0)
        return steep / np.maximum(steep.sum(axis=1, keepdims=True), 1e-300), weight

    def place(self, image: np.ndarray, guess: BodyPose) -> PoseFit:
        """Fit the pose of the body near a guess that is good to about two pixels."""
        return self._place(self._part(image, guess), guess)

    def place_by_seal(self, image: np.ndarray, guess: BodyPose) -> PoseFit:
        """Fit the pose to the edges of the seal alone, near a guess good to five pixels, before anything is learnt."""
        return self._place(self._part(image, guess), guess, seal_only=True, rough=SEAL.rough_steps)

    def size_by_seal(self, images: Sequence[np.ndarray], poses: Sequence[BodyPose], *, rough: bool = False) -> float:
        """Apparent size of the seal over that of the robot's; NaN unless most frames show all its sides."""
        assert self.seal is not None  # noqa: S101 - checked by the caller
        found = []
        for image, pose in zip(images, poses, strict=True):
            part = self._part(image, pose)
            if part.colours is not None:
                pixels, normals = self._seal_places(pose)
                found.append(self.seal.size(self.seal.shifts(part.colours, pixels, normals), pixels, rough=rough))
        return float(np.nanmedian(found)) if 2 * np.count_nonzero(np.isfinite(found)) > len(found) else np.nan

    @property
    def outline_moves(self) -> bool:
        """Whether enough edges of the outline, and of its nose, move with the seal."""
        moves = np.isfinite(self._scatter[~self.contour.seal])
        nose = np.isfinite(self._scatter[self.contour.group == GROUPS.index("front")])
        return bool(moves.mean() > SEAL.outline_share and nose.mean() > SEAL.nose_share)

    def _part(self, image: np.ndarray, pose: BodyPose) -> _Part:
        places = self.contour.places(pose, self.optics)
        pixels = places[0]
        low, high = pixels.min(axis=0) - self.margin, pixels.max(axis=0) + self.margin
        left, top, right, bottom = self.bounds
        ends = [int(np.clip(value, a, b)) for value, a, b in ((low[0], left, right), (low[1], top, bottom))]
        stops = [int(np.clip(value, a, b)) for value, a, b in ((high[0] + 2, left, right), (high[1] + 2, top, bottom))]
        if stops[0] - ends[0] < 4 or stops[1] - ends[1] < 4:
            return _Part(np.zeros((1, 1, 1), dtype=np.float32), np.zeros(2), None, pose, places)
        if self.seal is None:
            grey = cv2.GaussianBlur(
                grey_of(image[ends[1] : stops[1], ends[0] : stops[0]].astype(np.float32)), (0, 0), OUTLINE.blur
            )
            return _Part(np.asarray(grey)[..., None], np.array(ends, dtype=float), None, pose, places)
        colours = colour_part(image, (ends[0], ends[1], stops[0], stops[1]), OUTLINE.blur)
        return _Part(grey_of(colours.picture), colours.origin, colours, pose, places)

    def _places(self, part: _Part, pose: BodyPose) -> tuple[Samples, Samples, Samples, Samples]:
        """The outline's edges at a pose: see `Contour.places`."""
        if part.pose != pose:
            part.pose, part.places, part.profiles = pose, self.contour.places(pose, self.optics), None
        return part.places

    def _profiles(self, part: _Part, pose: BodyPose) -> Samples:
        """Brightness across each edge of the outline at a pose, of 255, (n, m)."""
        pixels, normals, _, _ = self._places(part, pose)
        if part.profiles is None:
            out = np.empty((1, len(pixels), self.offsets.size))
            profiles_across(part.grey, part.origin, pixels, normals, self.offsets, out)
            part.profiles = np.asarray(out[0])
        return part.profiles

    def _learn_profiles(self, stack: Samples) -> None:
        """Learn each edge's template: the first principal component of its profiles and those of its neighbours."""
        k = self.offsets
        tilt = np.sum(stack * k, axis=2, keepdims=True) / np.sum(k**2)
        bare = stack - stack.mean(axis=2, keepdims=True) - tilt * k
        bare = np.nan_to_num(bare, nan=0.0)
        products = np.einsum("fik,fil->ikl", bare, bare)
        together = np.empty_like(products)
        for index, name in enumerate(GROUPS):
            inside = np.flatnonzero(self.contour.group == index)
            if name in ("rear", "seal"):  # stripes pass: one template for the edge, of either sign
                together[inside] = products[inside].sum(axis=0)
                continue
            for place, point in enumerate(inside):
                near = inside[max(0, place - OUTLINE.neighbours) : place + OUTLINE.neighbours + 1]
                together[point] = products[near].sum(axis=0)
        template = np.ascontiguousarray(np.linalg.eigh(together)[1][:, :, -1])
        self._template = template
        self._derivative = np.gradient(template, axis=1)
        self._steepness = np.sqrt(np.sum(self._derivative**2, axis=1))
        strength = np.sqrt(np.mean(np.einsum("fik,ik->fi", bare, template) ** 2, axis=0))
        self._strength = strength

    def _learn_biases(self, parts: list[_Part], found: list[PoseFit], most: tuple[float, float] = SEAL.follows) -> None:
        """Learn the bias of each edge and the scatter about it, as glare shifts edges."""
        residuals, across = [], []
        for part, one in zip(parts, found, strict=True):
            if one.known:
                shifts, known, _ = self._shifts(part, one.pose)
                residuals.append(np.where(known, shifts, np.nan))
                across.append(self._places(part, one.pose)[3][:, 1:] @ one.pose[1:])
        if len(residuals) < 6:
            return
        middle, spread, enough = _usual(residuals)
        self._bias = np.where(enough, self._bias + np.clip(middle, -1.0, 1.0), self._bias)
        self._scatter = np.where(enough, np.hypot(self.contour.floor, spread), 0.5)
        if self.seal is not None:
            bound = np.hypot(*(self.contour.normals * np.array(most)).T)
            moved = np.array(across) - np.median(across, axis=0)
            fixed = _usual([some + by for some, by in zip(residuals, moved, strict=True)])[1]
            stays, swings = fixed < spread, mad_scale(np.diff(moved, axis=0), axis=0) > SEAL.swings
            # The seal shows a swing across, but drifts as stripes pass its silhouettes: then what stays is believed.
            self._scatter[stays & ~swings & enough] = np.hypot(self.contour.floor, fixed)[stays & ~swings & enough]
            self._scatter[~enough | (self._scatter > bound) | (stays & swings)] = np.inf
            self._learn_seal_biases(parts, found)

    def _learn_seal_biases(self, parts: list[_Part], found: list[PoseFit]) -> None:
        """Learn the bias of each colour of the seal, and the scatter of its edges."""
        assert self.seal is not None  # noqa: S101 - checked by the caller
        seen = [
            self.seal.shifts(part.colours, *self._seal_places(one.pose))
            for part, one in zip(parts, found, strict=True)
            if one.known and part.colours is not None
        ]
        if len(seen) < 6:
            return
        residuals = [np.where(one.known, one.shifts, np.nan) for one in seen]
        self.seal.learn_bias(np.array(residuals), np.array([one.kind for one in seen]))
        _, spread, enough = _usual(residuals)
        self._seal_scatter = np.where(enough, np.hypot(self._seal_floor, spread), 0.5)

    def _shifts(self, part: _Part, pose: BodyPose) -> tuple[Samples, np.ndarray, Samples]:
        """Displacement of each edge along its normal, pixels, its validity, and its variance."""
        assert self._template is not None  # noqa: S101 - learnt first
        count, profiles = len(self.contour.group), self._profiles(part, pose)
        shifts, strengths, misses = np.empty(count), np.empty(count), np.empty(count)
        shifts_of_profiles(profiles, self._template, self._derivative, shifts, strengths, misses)
        known = (
            np.isfinite(shifts)
            & (np.abs(shifts) < OUTLINE.largest_shift)
            & (np.abs(strengths) > OUTLINE.least_strength * self._strength)
        )
        variance = (
            np.maximum(misses, OUTLINE.rounding_noise) / np.maximum(np.abs(strengths) * self._steepness, 1e-9)
        ) ** 2
        return shifts - self._bias, known, np.where(known, variance + self._scatter**2, np.inf)

    def _edge_displacements(self, part: _Part, pose: BodyPose, *, seal_only: bool, rough: bool) -> _Edges:
        """Displacements of all edges: of the outline by brightness, and of the seal by its colours too."""
        if seal_only:
            pixels, normals, _, slopes = self._seal_contour.places(pose, self.optics)
            return self._edges_of_seal(part, pixels, normals, slopes, rough=rough)
        pixels, normals, _, slopes = self._places(part, pose)
        shifts, known, variance = self._shifts(part, pose)
        outline = _Edges(shifts, known, variance, slopes, np.isfinite(shifts), np.isfinite(self._scatter))
        if self.seal is None or part.colours is None:
            return outline
        seal = self._edges_of_seal(part, *(values[self._on_seal] for values in (pixels, normals, slopes)))
        return _Edges(*(np.concatenate(values) for values in zip(outline, seal, strict=True)))

    def _edges_of_seal(
        self, part: _Part, pixels: Samples, normals: Samples, slopes: Samples, *, rough: bool = False
    ) -> _Edges:
        """Displacements of the seal's edges at their places."""
        assert self.seal is not None  # noqa: S101 - checked by the caller
        assert part.colours is not None  # noqa: S101
        seen = self.seal.shifts(part.colours, pixels, normals, rough=rough)
        variance = np.where(seen.known, seen.variance + self._seal_scatter**2, np.inf)
        return _Edges(
            seen.shifts, seen.known, variance, slopes, np.isfinite(seen.shifts), np.isfinite(self._seal_scatter)
        )

    def _place(self, part: _Part, guess: BodyPose, *, seal_only: bool = False, rough: int = 0) -> PoseFit:
        change, level = np.empty(3), 1.0
        least = 0.0 if self.seal is None else SEAL.least_scale
        pose = np.array(guess)
        lost = PoseFit(guess, BodyPose(np.nan, np.nan, np.nan), 0.0, 0.0)
        if seal_only and part.colours is None:
            return lost
        for step in range(rough + OUTLINE.iterations):
            edges = self._edge_displacements(part, BodyPose(*pose), seal_only=seal_only, rough=step < rough)
            known, slopes = edges.known, edges.slopes
            if known.sum() < 12:
                return lost
            used, work = np.empty(known.size), np.empty((2, known.size))
            shifts = np.where(known, edges.shifts, 0.0)
            level = robust_change(shifts, slopes, 1.0 / edges.variance, least, work, used, change)
            pose = pose + change
            if step > rough and float(np.abs(slopes @ change).max()) < 0.01:
                break
        fitting = np.count_nonzero(used) / max(1, int(np.count_nonzero(edges.inside & edges.votes)))
        share = np.count_nonzero(edges.inside) / known.size
        found = BodyPose(*pose.tolist())
        try:
            covariance = np.linalg.inv(slopes.T @ (used[:, None] * slopes)) * max(level, 0.5) ** 2 * self._correlation
        except np.linalg.LinAlgError:  # all edges are parallel
            return PoseFit(found, lost.error, fitting, share)
        errors = BodyPose(*np.sqrt(np.maximum(np.diagonal(covariance), 0.0)).tolist())
        if (
            fitting < OUTLINE.least_share
            or not 0.0 < errors.x < OUTLINE.largest_error * self.optics.length_per_pixel
            or share < 0.2
        ):
            return PoseFit(found, lost.error, fitting, share)
        if seal_only:
            return PoseFit(found, errors, fitting, share)
        count = len(self.contour.group)
        left = shifts - slopes @ change
        elongation = _elongation(left[:count], slopes[:count], used[:count], *self._ends)
        spread = max(level, 0.5) * np.sqrt(self._correlation)
        cues = cue_shifts(left, slopes, used, self._cue, spread)
        return PoseFit(found, errors, fitting, share, elongation, cues, self._sideways(left, slopes, known))

    def _sideways(self, left: Samples, slopes: Samples, known: np.ndarray) -> float:
        """Displacement of the seal's flanks across the channel from what is `left` of all edges, m; NaN if hidden."""
        if self.seal is None:
            return np.nan
        first, found = len(self.contour.group), []
        for side in self._flanks:
            mine = first + side[known[first + side]]
            if mine.size >= SEAL.fewest_of_side:
                found.append(float(np.median(left[mine] / slopes[mine, 1])))
        return float(np.mean(found)) if found else np.nan


def _usual(residuals: list[Samples]) -> tuple[Samples, Samples, np.ndarray]:
    """Median residual of each edge, the scatter about it, and whether it was seen often enough; 0 where it was not."""
    stack = np.array(residuals)
    enough = np.isfinite(stack).sum(axis=0) >= 0.4 * len(residuals)
    stack[:, ~enough] = 0.0
    middle = np.nanmedian(stack, axis=0)
    return middle, mad_scale(stack - middle, axis=0), enough


def _elongation(left: Samples, slopes: Samples, used: Samples, nose: np.ndarray, behind: np.ndarray) -> float:
    """By how much the edges of the nose are ahead of those at rear and seal, by weighted least squares, m."""
    # Both move alike with the body's place. A fourth parameter beside the pose moves those of the nose alone.
    if min(np.count_nonzero(used[nose]), np.count_nonzero(used[behind])) < OUTLINE.fewest_at_end:
        return np.nan
    design = np.column_stack([slopes, np.where(nose, slopes[:, 0], 0.0)])
    normal = design.T @ (used[:, None] * design)
    try:
        return float(np.linalg.solve(normal, design.T @ (used * left))[3])
    except np.linalg.LinAlgError:  # the edges of the nose lie along its path
        return np.nan


def grey_of(colours: np.ndarray) -> np.ndarray:
    """Brightness of a picture in single precision, (h, w, 1)."""
    return np.asarray(cv2.cvtColor(colours, cv2.COLOR_RGB2GRAY))[..., None]


def _smooth(
    poses: list[BodyPose], times: Samples, least: tuple[float, float, float] = (1e-3, 5e-4, 0.01)
) -> list[BodyPose]:
    """Poses with outliers replaced by the Theil-Sen line of each coordinate."""
    if len(poses) < 4:
        return poses
    numbers = np.array(poses)
    line = theil_sen_line(times, numbers).at(times[:, None])
    off = np.abs(numbers - line)
    bound = np.maximum(3.0 * np.median(off, axis=0), least)
    return [BodyPose(*row) for row in np.where(off > bound, line, numbers).tolist()]
