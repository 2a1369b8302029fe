"""The body's place on a frame, to a small part of a pixel, from all of its edges at once."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.extras import required
from spirillum.kernels.edges import profiles_across, robust_change, shifts_of_profiles
from spirillum.robot.robot import Robot
from spirillum.robust import mad_scale, theil_sen_line
from spirillum.vision.camera.optics import BodyPose, Optics
from spirillum.vision.track.constants import OUTLINE
from spirillum.vision.track.contour import GROUPS, Contour, contour_of

__all__ = ["BodyFinder", "Placed", "grey_part"]


class Placed(NamedTuple):
    """Where the body is on a frame."""

    pose: BodyPose
    error: BodyPose
    """Standard errors, m and rad."""
    share: float
    """Share of the edges that fit, 0 to 1."""
    inside: float
    """Share of the edges that lie in the picture."""

    @property
    def known(self) -> bool:
        """Whether it was seen well enough to count."""
        return bool(np.isfinite(self.error.x))


class BodyFinder:
    """A robot's body in front of a camera; learns what its edges look like, then places it frame by frame."""

    def __init__(self, robot: Robot, optics: Optics, bounds: tuple[int, int, int, int]) -> None:
        """Compute where its edges appear.

        Args:
            robot: the robot.
            optics: the camera.
            bounds: part of the picture to look at: left, top, right, bottom.
        """
        self.robot, self.optics, self.bounds = robot, optics, bounds
        self.contour: Contour = contour_of(robot, optics)
        self.half = OUTLINE.half_profile
        self.offsets = np.arange(-self.half, self.half + 1, dtype=float)
        self._usual: Samples | None = None
        self._slopes: Samples = np.empty((0, 0))
        self._strength: Samples = np.empty(0)
        self._steep: Samples = np.empty(0)
        self._offset = np.zeros(len(self.contour.group))
        self._trust = self.contour.floor.copy()
        self.margin = int(self.half + 4 * OUTLINE.blur + 4)
        middle = self.contour.places(BodyPose(float(optics.origin[0]), float(optics.origin[1]), 0.0), optics)[0]
        spacing = float(np.median(np.hypot(*np.diff(middle, axis=0).T)))
        self._together = max(1.0, OUTLINE.noise_correlation / max(spacing, 0.1))

    def learn(self, images: list[np.ndarray], poses: list[BodyPose], times: Samples) -> list[Placed]:
        """Learn the edges' looks from frames with about known places; the places again, better.

        Args:
            images: 8-bit RGB, (h, w, 3) each.
            poses: where the body is on most of them, to a pixel or so.
            times: when they were taken, s, (n,).
        """
        poses = _smooth(list(poses), times)
        self._offset, self._trust = np.zeros(len(self.contour.group)), self.contour.floor.copy()
        found: list[Placed] = []
        parts = [self._part(image, pose) for image, pose in zip(images, poses, strict=True)]
        for turn in range(OUTLINE.learning_rounds):
            stack = []
            for part, pose in zip(parts, poses, strict=True):
                pixels, normals, _, _ = self.contour.places(pose, self.optics)
                stack.append(self._profiles(part, pixels, normals))
            self._take_looks(np.stack(stack))
            found = [self._place(part, pose) for part, pose in zip(parts, poses, strict=True)]
            if turn >= OUTLINE.smoothed_rounds:
                self._take_trust(parts, found)
            poses = [new.pose if new.known else old for new, old in zip(found, poses, strict=True)]
            if turn < OUTLINE.smoothed_rounds:
                poses = _smooth(poses, times)
        return found

    def steepness(self, offsets: Samples) -> tuple[Samples, Samples]:
        """How steep each edge's brightness usually is along its normal, and how much each edge tells.

        Args:
            offsets: pixels outward from the outline, (m,).

        Returns:
            Shares of the edge's whole, (n, m), and weights of the edges, (n,), 0 for those that are not trusted.
        """
        assert self._usual is not None  # noqa: S101 - learnt first
        from scipy.interpolate import CubicSpline

        steep = CubicSpline(self.offsets, self._usual, axis=1)(offsets, 1) ** 2
        weight = np.where(self._trust < OUTLINE.trusted_error, np.minimum(self._strength, OUTLINE.strength_cap), 0.0)
        return steep / np.maximum(steep.sum(axis=1, keepdims=True), 1e-300), weight

    def place(self, image: np.ndarray, guess: BodyPose) -> Placed:
        """The body on a frame, near a guess; errors are NaN where it is not seen well enough.

        Args:
            image: 8-bit RGB, (h, w, 3).
            guess: where it should be, to about two pixels.
        """
        return self._place(self._part(image, guess), guess)

    def _part(self, image: np.ndarray, pose: BodyPose) -> tuple[Samples, Samples]:
        pixels = self.contour.places(pose, self.optics)[0]
        low, high = pixels.min(axis=0) - self.margin, pixels.max(axis=0) + self.margin
        left, top, right, bottom = self.bounds
        ends = [int(np.clip(value, a, b)) for value, a, b in ((low[0], left, right), (low[1], top, bottom))]
        stops = [int(np.clip(value, a, b)) for value, a, b in ((high[0] + 2, left, right), (high[1] + 2, top, bottom))]
        if stops[0] - ends[0] < 4 or stops[1] - ends[1] < 4:
            return np.zeros((1, 1)), np.zeros(2)
        return grey_part(image, (ends[0], ends[1], stops[0], stops[1]), OUTLINE.blur), np.array(ends, dtype=float)

    def _profiles(self, part: tuple[Samples, Samples], pixels: Samples, normals: Samples) -> Samples:
        out = np.empty((len(pixels), self.offsets.size))
        profiles_across(part[0], part[1], pixels, normals, self.offsets, out)
        return out

    def _take_looks(self, stack: Samples) -> None:
        """What each edge is usually like: the strongest pattern in its frames, and in its neighbours'."""
        k = self.offsets
        tilt = np.sum(stack * k, axis=2, keepdims=True) / np.sum(k**2)
        bare = stack - stack.mean(axis=2, keepdims=True) - tilt * k
        bare = np.nan_to_num(bare, nan=0.0)
        count = bare.shape[1]
        usual = np.zeros((count, k.size))
        products = np.einsum("fik,fil->ikl", bare, bare)
        for index, name in enumerate(GROUPS):
            inside = np.flatnonzero(self.contour.group == index)
            for place, point in enumerate(inside):
                if name in ("rear", "seal"):  # stripes pass there: all of the edge looks like one step, up or down
                    together = inside
                    if place:
                        usual[point] = usual[inside[0]]
                        continue
                else:
                    together = inside[max(0, place - OUTLINE.neighbours) : place + OUTLINE.neighbours + 1]
                usual[point] = np.linalg.eigh(products[together].sum(axis=0))[1][:, -1]
        self._usual = usual
        self._slopes = np.gradient(usual, axis=1)
        self._steep = np.sqrt(np.sum(self._slopes**2, axis=1))
        strength = np.sqrt(np.mean(np.einsum("fik,ik->fi", bare, usual) ** 2, axis=0))
        self._strength = strength

    def _take_trust(self, parts: list[tuple[Samples, Samples]], found: list[Placed]) -> None:
        """Where each edge lies on average against all others, and how well it keeps to that: glare moves an edge."""
        rest = []
        for part, one in zip(parts, found, strict=True):
            if one.known:
                pixels, normals, _, _ = self.contour.places(one.pose, self.optics)
                shifts, known, _ = self._shifts(part, pixels, normals)
                rest.append(np.where(known, shifts, np.nan))
        if len(rest) < 6:
            return
        stack = np.array(rest)
        seen = np.isfinite(stack).sum(axis=0)
        enough = seen >= 0.4 * len(rest)
        stack[:, ~enough] = 0.0
        middle = np.nanmedian(stack, axis=0)
        spread = mad_scale(stack - middle, axis=0)
        self._offset = np.where(enough, self._offset + np.clip(middle, -1.0, 1.0), self._offset)
        self._trust = np.where(enough, np.hypot(self.contour.floor, spread), 0.5)

    def _shifts(
        self, part: tuple[Samples, Samples], pixels: Samples, normals: Samples
    ) -> tuple[Samples, np.ndarray, Samples]:
        """How far each edge has moved, whether that can be told, and its variance; pixels."""
        assert self._usual is not None  # noqa: S101 - learnt first
        count = len(pixels)
        shifts, strengths, misses = np.empty(count), np.empty(count), np.empty(count)
        profiles = self._profiles(part, pixels, normals)
        shifts_of_profiles(profiles, self._usual, self._slopes, shifts, strengths, misses)
        known = (
            np.isfinite(shifts)
            & (np.abs(shifts) < OUTLINE.largest_shift)
            & (np.abs(strengths) > OUTLINE.least_strength * self._strength)
        )
        variance = (np.maximum(misses, OUTLINE.rounding_noise) / np.maximum(np.abs(strengths) * self._steep, 1e-9)) ** 2
        return shifts - self._offset, known, np.where(known, variance + self._trust**2, np.inf)

    def _place(self, part: tuple[Samples, Samples], guess: BodyPose) -> Placed:
        count = len(self.contour.group)
        used, change, level = np.empty(count), np.empty(3), 1.0
        pose = np.array(guess)
        lost = Placed(guess, BodyPose(np.nan, np.nan, np.nan), 0.0, 0.0)
        for step in range(OUTLINE.iterations):
            pixels, normals, _, slopes = self.contour.places(BodyPose(*pose), self.optics)
            shifts, known, variance = self._shifts(part, pixels, normals)
            inside = np.isfinite(shifts)
            if known.sum() < 12:
                return lost
            level = robust_change(np.where(known, shifts, 0.0), slopes, 1.0 / variance, used, change)
            pose = pose + change
            if step > 0 and float(np.abs(slopes @ change).max()) < 0.01:
                break
        fitting = np.count_nonzero(used) / max(1, int(np.count_nonzero(inside)))
        share = np.count_nonzero(inside) / count
        found = BodyPose(*pose.tolist())
        try:
            scatter = np.linalg.inv(slopes.T @ (used[:, None] * slopes)) * max(level, 0.5) ** 2 * self._together
        except np.linalg.LinAlgError:  # edges of one direction only
            return Placed(found, lost.error, fitting, share)
        errors = BodyPose(*np.sqrt(np.maximum(np.diagonal(scatter), 0.0)).tolist())
        if (
            fitting < OUTLINE.least_share
            or not 0.0 < errors.x < OUTLINE.largest_error * self.optics.length_per_pixel
            or share < 0.2
        ):
            return Placed(found, lost.error, fitting, share)
        return Placed(found, errors, fitting, share)


def grey_part(image: np.ndarray, bounds: tuple[int, int, int, int], blur: float) -> Samples:
    """Blurred brightness of a part (left, top, right, bottom) of a picture, 8-bit scale."""
    cv2 = required("cv2", "measuring a video", "video")
    left, top, right, bottom = bounds
    grey = cv2.cvtColor(image[top:bottom, left:right].astype(np.float32), cv2.COLOR_RGB2GRAY)
    return np.asarray(cv2.GaussianBlur(grey, (0, 0), blur), dtype=float)


def _smooth(poses: list[BodyPose], times: Samples) -> list[BodyPose]:
    """Places that follow a straight and steady way where they are far from it (Theil and Sen's, of each coordinate)."""
    if len(poses) < 4:
        return poses
    numbers = np.array(poses)
    line = theil_sen_line(times, numbers).at(times[:, None])
    off = np.abs(numbers - line)
    bound = np.maximum(3.0 * np.median(off, axis=0), np.array([1e-3, 5e-4, 0.01]))
    return [BodyPose(*row) for row in np.where(off > bound, line, numbers).tolist()]
