"""Rotation angle of the body, from the stripes on its seal."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from spirillum.arrays import Samples
from spirillum.kernels.core import profile_of_rows, stripe_fit, stripes_at
from spirillum.robot.robot import Robot
from spirillum.robust import mad_scale
from spirillum.vision.camera.optics import BodyPose, Optics, project
from spirillum.vision.flag import Flag
from spirillum.vision.setup import Setup, stripes_of
from spirillum.vision.track.colours import (
    are_distinguishable,
    check_order,
    colour_classes,
    initial_line_colours,
    is_single,
    named_rightly,
    observed_width,
    pattern_period,
    runs_of,
    without_glare,
)
from spirillum.vision.track.constants import SINGLE_LINE, STRIPES
from spirillum.vision.track.widths import edge_shifts

_ROWS = 16  # samples along the axis
_BLURRED = 2  # stride of the frames on which the blur is fitted
_HATS = 15  # hat functions in which the sheen is expanded along the angle


@dataclass
class _Appearance:
    """Appearance of the stripes in this video."""

    palette: Samples  # colour of each class, (classes, 3)
    shade: Samples  # shading factor and additive sheen at each angle, in each channel, (n, 6)
    blur: float  # standard deviation of the blur, pixels
    residual: float  # median residual of a channel, of 255
    trust: Samples  # weight of each angle, (n,); small where residuals are large, as under a highlight


class Stripes:
    """Reads the rotation angle of the body about +x, modulo the period of its stripes.

    The picture is sampled on the projected surface of the seal and averaged along the axis over the interquartile
    range. The resulting colour profile is fitted by the stripes at every angle. `learn` finds colours, shading and blur
    in the video, starting from the named colours.
    """

    def __init__(self, robot: Robot, setup: Setup, optics: Optics) -> None:
        self.robot, self.optics = robot, optics
        self.stripes = stripes_of(setup, robot)
        self.names = tuple(dict.fromkeys(self.stripes))
        self.period = pattern_period(self.stripes) if self.stripes else 2.0 * np.pi
        self.order = np.array([self.names.index(name) for name in self.stripes], dtype=np.int64)
        self.appearance: _Appearance | None = None
        self.fits = False
        self._hidden: list[float] = []
        self.flags: tuple[Flag, ...] = ()
        count = 1 + 2 * round(STRIPES.reach / STRIPES.step)
        self.angles = np.linspace(-STRIPES.reach, STRIPES.reach, count)
        coarse = np.linspace(-STRIPES.reach, STRIPES.reach, 27)
        self._between, self._slope = _spline(coarse, self.angles)
        length = robot.seal.length if robot.seal is not None else 0.0
        rear, radius = -0.5 * robot.body.length, 0.5 * robot.body.diameter
        ends = rear + length * np.array([STRIPES.margin, 1.0 - STRIPES.margin])
        self._surface = np.concatenate(
            [
                np.stack([np.full(coarse.size, x), -radius * np.sin(coarse), radius * np.cos(coarse)], axis=1)
                for x in ends
            ]
        )

    @cached_property
    def readable(self) -> float:
        """Share of a turn in which an edge between two colours faces the camera: about half for a single line."""
        return float(np.mean([self._faces(angle) for angle in np.linspace(0.0, 2.0 * np.pi, 361)]))

    def _faces(self, angle: float) -> bool:
        """Whether at an angle of the body an edge between two colours faces the camera."""
        count = len(self.stripes)
        edges = [k for k in range(count) if self.stripes[k] != self.stripes[k - 1]]
        return any(np.cos(angle + 2.0 * np.pi / count * (edge - 0.5)) >= np.cos(STRIPES.faces) - 1e-9 for edge in edges)

    def learn(self, samples: Sequence[tuple[np.ndarray, BodyPose]]) -> None:
        """Learn colours, shading and blur of the stripes from some frames of the video."""
        if len(self.names) < 2 or self.robot.seal is None:
            self.flags = (Flag.named("no-stripes"),)
            return
        found = [self._profile(image, pose) for image, pose in samples]
        found = [(profile, scale) for profile, scale in found if np.isfinite(profile).all(axis=1).mean() > 0.5]
        if len(found) < 1:
            self.flags = (Flag.named("stripes-unreadable"),)
            return
        profiles = np.array([profile for profile, _ in found])
        scales = np.array([scale for _, scale in found])
        steep = scales > 0.45 * scales.max(axis=1, keepdims=True)
        if is_single(self.stripes):
            self._learn_line(profiles, scales, steep)
            return
        facing = profiles[steep & np.isfinite(profiles).all(axis=2)]
        palettes = colour_classes(facing, self.names)
        start = palettes[1]
        seen_steep = np.where(steep[..., None], profiles, np.nan)
        palette, verdict = check_order(seen_steep, self.angles, palettes, self.stripes, self.names)
        clear = without_glare(profiles, (palette, *palettes[1:]))
        even = np.zeros((self.angles.size, 3))
        self.appearance = self._refined(profiles, clear, scales, palette, even)
        least = self._typical_loss(self._fits(profiles, scales, self.appearance))
        if least > STRIPES.good:
            other = self._refined(profiles, clear, scales, start, even)
            loss = self._typical_loss(self._fits(profiles, scales, other))
            self.appearance, least = (other, loss) if loss < least else (self.appearance, least)
        if not are_distinguishable(facing, palettes):
            self.flags = (Flag.named("stripes-of-other-colours", names=", ".join(self.names)),)
            return
        rightly = named_rightly(self.appearance.palette, start)
        counted = self._as_wide(seen_steep, (palette, *palettes[1:]))
        if least < STRIPES.fits and rightly and counted:
            self.fits = True
            return  # the stated order fits, with colours that match the names
        if verdict in ("reversed", "other"):
            how = "in the reversed order" if verdict == "reversed" else "in another order"
            self.flags = (Flag.named("stripe-order", how=how, stripes=", ".join(self.stripes)),)
        elif least >= STRIPES.fits or not counted:
            stripes = ", ".join(self.stripes)
            self.flags = (Flag.named("stripes-do-not-fit", count=len(self.stripes), stripes=stripes),)
        else:
            self.fits = True

    def _learn_line(self, profiles: Samples, scales: Samples, facing: np.ndarray) -> None:
        """Learn the appearance of a single line: from what moves, for a highlight stays where it is."""
        line = initial_line_colours(profiles, facing, self.order)
        if line is None:
            self.flags = (Flag.named("no-line-moves"),)
            return
        self.appearance = self._refined(profiles, profiles, scales, line.palette, line.sheen)
        fits = self._fits(profiles, scales, self.appearance)
        count = np.count_nonzero(self._determined_frames(fits))
        contrast, first = (float(np.linalg.norm(np.diff(p, axis=0))) for p in (self.appearance.palette, line.palette))
        if count < SINGLE_LINE.frames:
            self.flags = (Flag.named("line-unreadable", count=count, frames=len(fits)),)
        elif self._typical_loss(fits) >= STRIPES.fits or contrast < SINGLE_LINE.kept * first:
            counts = np.bincount(self.order, minlength=2)
            thin, bare = self.names[int(np.argmin(counts))], self.names[int(np.argmax(counts))]
            wide = 360.0 * counts.min() / counts.sum()
            self.flags = (Flag.named("line-does-not-fit", wide=wide, line=thin, seal=bare),)
        else:
            self.fits = True

    def _as_wide(self, profiles: Samples, palettes: tuple[Samples, Samples, Samples]) -> bool:
        """Whether stripes are seen as wide as stated; of patterns with several widths the fit alone decides."""
        runs = {2.0 * np.pi / len(self.stripes) * run for run in runs_of(self.stripes)}
        if len(runs) != 1:
            return True
        stated = runs.pop()
        return not abs(np.log(observed_width(profiles, self.angles, palettes, stated) / stated)) > STRIPES.width_range

    def _fits(self, profiles: Samples, scales: Samples, appearance: _Appearance) -> Samples:
        """The results of `stripe_fit` on some frames, (f, 8)."""
        return np.array([self._fit(p, s, appearance) for p, s in zip(profiles, scales, strict=True)])

    def _typical_loss(self, fits: Samples) -> float:
        """Median over the frames of the loss relative to that of a uniform colour."""
        ratios = np.where(np.isfinite(fits[:, 0]), fits[:, 2] / fits[:, 4], 1.0)
        told = ratios[self._determined_frames(fits)]
        return float(np.median(told)) if told.size else 1.0

    def _determined_frames(self, fits: Samples) -> np.ndarray:
        """Mask of the frames that determine the angle: where one colour alone is in view, many angles fit alike."""
        if self.readable == 1.0:
            return np.ones(len(fits), dtype=bool)
        return np.asarray(fits[:, 3] >= STRIPES.ambiguous * fits[:, 2])

    def read(self, image: np.ndarray, pose: BodyPose) -> tuple[float, float]:
        """Rotation angle of the body about +x, modulo `period`, and its standard error, rad; NaN where unreadable."""
        return self.read_with_edges(image, pose)[0]

    def read_with_edges(self, image: np.ndarray, pose: BodyPose) -> tuple[tuple[float, float], Samples]:
        """Body angle with its standard error, and the deviations of the edges from an even pattern of stripes."""
        unread = (np.nan, np.nan), np.full(len(self.stripes), np.nan)
        if self.appearance is None:
            return unread
        profile, scale = self._profile(image, pose)
        seen = profile[scale > 0.0]
        self._hidden.append(float(np.isnan(seen).mean()) if len(seen) else np.nan)
        answer = self._fit(profile, scale, self.appearance)
        loss, other, flat = answer[2:5]
        if not np.isfinite(answer).all() or loss > STRIPES.unreadable * flat or other < STRIPES.ambiguous * loss:
            return unread
        if self.readable < 1.0 and not self._faces(float(answer[0])):
            return unread
        error = np.sqrt(answer[1] ** 2 + STRIPES.floor**2 + (STRIPES.pixel_locking / scale.max()) ** 2)
        known, blur = self.appearance, np.clip(self.appearance.blur / np.maximum(scale, 1e-9), 0.004, 0.5)
        colours, angle = known.palette[self.order], float(answer[0])
        shifts = edge_shifts(profile / answer[5:8], self.angles, blur, known.shade, colours, angle)
        return (angle, float(error)), shifts

    @property
    def under_glare(self) -> bool:
        """Whether glare hides much of the stripes on half of the frames that were read so far."""
        known = [share for share in self._hidden if np.isfinite(share)]
        return bool(known) and float(np.median(known)) > STRIPES.hidden

    def _profile(self, image: np.ndarray, pose: BodyPose) -> tuple[Samples, Samples]:
        """Colour profile along the angle, (n, 3), and pixels per radian, (n,); 0 where the surface faces away."""
        ends = project(self._surface, pose, self.optics).reshape(2, -1, 2)
        first, last = self._between @ ends[0], self._between @ ends[1]
        along = self._slope @ (0.5 * (ends[0] + ends[1]))
        axis = (last - first).mean(axis=0)
        normal = np.array([axis[1], -axis[0]]) / (np.linalg.norm(axis) + 1e-300)
        scale = along @ normal
        scale = np.maximum(scale * np.sign(scale[scale.size // 2]), 0.0)
        profile = np.empty((self.angles.size, 3))
        profile_of_rows(image, first, last, np.empty((3, _ROWS)), profile)
        if "white" not in self.names:
            profile[self._dazzled(profile)] = np.nan
        return profile, scale

    def _dazzled(self, profile: Samples) -> np.ndarray:
        """Mask of the angles under wide glare and its halo, (n,)."""
        white = profile.min(axis=1) > STRIPES.white
        if np.count_nonzero(white) < STRIPES.wide_glare:
            return np.zeros(white.shape, dtype=bool)
        return np.asarray(np.convolve(white, np.ones(2 * STRIPES.halo + 1), mode="same") > 0.5)

    def _fit(self, profile: Samples, scale: Samples, appearance: _Appearance) -> Samples:
        """The result of `stripe_fit`; NaN where too little is in view."""
        edges = np.diff(appearance.palette[np.append(self.order, self.order[0])], axis=0)
        apart = np.linalg.norm(edges[np.diff(self.order, append=self.order[0]) != 0], axis=1)
        cut = max(STRIPES.cut * appearance.residual, STRIPES.edge_cut * float(np.median(apart)))
        answer, losses = np.full(8, np.nan), np.empty(max(24, round(self.period / np.deg2rad(4.0))))
        settings = self.period, STRIPES.lamp_tint, cut, 0.3 * appearance.residual, appearance.blur
        known = profile, scale, appearance.trust, self.angles, appearance.shade, self.order, appearance.palette
        stripe_fit(*known, *settings, np.empty((self.angles.size, 17)), losses, answer)
        return answer

    def _refined(
        self, profiles: Samples, clear: Samples, scales: Samples, palette: Samples, sheen: Samples
    ) -> _Appearance:
        """Colours, shading and blur by alternating fits; profiles with glare enter only the last of them."""
        even = np.column_stack([np.ones((self.angles.size, 3)), sheen])
        appearance = _Appearance(palette, even, 1.0, STRIPES.first_residual, np.ones(self.angles.size))
        for repeat in range(STRIPES.repeats):
            if repeat in (2, STRIPES.repeats - 1):
                losses = []
                for blur in STRIPES.blurs:
                    trial = _Appearance(
                        appearance.palette, appearance.shade, blur, appearance.residual, appearance.trust
                    )
                    some = zip(profiles[::_BLURRED], scales[::_BLURRED], strict=True)
                    losses.append(np.nansum([self._fit(p, s, trial)[2] for p, s in some]))
                appearance.blur = STRIPES.blurs[int(np.argmin(losses))]
            appearance = self._relearned(
                clear if repeat < STRIPES.repeats_without_glare else profiles, scales, appearance
            )
        return appearance

    def _relearned(self, profiles: Samples, scales: Samples, appearance: _Appearance) -> _Appearance:
        """Colours of the classes and shading along the angle, from the best frames at their fitted angles."""
        width = 2.0 * np.pi / len(self.order)
        sums, weights = np.zeros_like(appearance.palette), np.zeros(len(appearance.palette))
        models, wanted, good_at, residuals, squares = [], [], [], [], []
        fits = self._fits(profiles, scales, appearance)
        with np.errstate(divide="ignore", invalid="ignore"):  # frames without a readable angle, which do not count
            losses = np.where(np.isfinite(fits[:, 0]) & self._determined_frames(fits), fits[:, 2] / fits[:, 4], np.inf)
        best = np.argsort(losses)[: max(3, int(0.8 * np.isfinite(losses).sum()))]
        shade, sheen = appearance.shade[:, :3], appearance.shade[:, 3:]
        for which in best[np.isfinite(losses[best])]:
            profile, scale, answer = profiles[which], scales[which], fits[which]
            model = np.empty_like(shade)
            blur = np.clip(appearance.blur / np.maximum(scale, 1e-9), 0.004, 0.5)
            stripes_at(self.angles, blur, answer[0], self.order, appearance.palette, model)
            gain = answer[5:8]
            valid = np.isfinite(profile).all(axis=1) & (scale > 0.15 * scale.max())
            level = np.where(valid[:, None], profile, 0.0) / gain
            residual = gain * (level - shade * model - sheen)
            size = np.linalg.norm(residual, axis=1)
            kept = valid & (size < max(4.0 * np.median(size[valid]), 20.0))
            residuals.append(mad_scale(size[valid]) / np.sqrt(3.0))
            models.append(model)
            squares.append(size**2 / 3.0)
            wanted.append(level)
            good_at.append(kept)
            place = (self.angles - answer[0]) / width + 0.5
            edge = np.abs(place - np.round(place)) * width
            inside = kept & (edge > 2.0 * blur) & (scale > 0.4 * scale.max())
            classes = self.order[np.floor(place).astype(int) % len(self.order)]
            clear = inside & (sheen.mean(axis=1) < 0.5 * sheen.mean(axis=1).max() + 4.0)  # where the sheen is weak
            for index in range(len(appearance.palette)):
                mine = clear & (classes == index)
                sums[index] += np.sum((level[mine] - sheen[mine]) / shade[mine], axis=0)
                weights[index] += mine.sum()
        if not models:
            return appearance
        enough = weights > 5
        palette = appearance.palette.copy()
        palette[enough] = np.maximum(sums[enough] / weights[enough, None], 0.0)
        light = _light(self.angles, np.array(models), np.array(wanted), np.array(good_at))
        rough = np.sqrt(np.median(np.array(squares), axis=0))
        rough = np.convolve(np.pad(rough, 2, mode="edge"), np.ones(5) / 5.0, mode="valid")
        usual = np.median(rough) + 1.0
        trust = 1.0 / (1.0 + STRIPES.doubt * (rough / usual) ** 2)
        return _Appearance(palette, light, appearance.blur, float(np.median(residuals)), trust / trust.max())


def _light(angles: Samples, models: Samples, wanted: Samples, kept: np.ndarray) -> Samples:
    """Shading factor and sheen along the angle, (n, 6), by regularised linear least squares."""
    # The factor is a polynomial, the sheen a sum of hat functions with a prior at zero. Differences of colour separate
    # the two even where the body hardly turned, as the sheen is nearly white.
    s = angles / STRIPES.reach
    series = np.stack([s**power for power in range(5)], axis=1)
    centres = np.linspace(-1.0, 1.0, _HATS)
    hats = np.maximum(0.0, 1.0 - np.abs(s[:, None] - centres) / (centres[1] - centres[0]))
    count = 5 + 4 * _HATS  # polynomial, white sheen, and tint of the sheen in each channel
    normal, right = np.zeros((count, count)), np.zeros(count)
    for model, level, good in zip(models, wanted, kept, strict=True):
        for channel in range(3):
            basis = np.zeros((angles.size, count))
            basis[:, :5] = series * model[:, channel : channel + 1] / 100.0
            basis[:, 5 : 5 + _HATS] = hats
            basis[:, 5 + _HATS * (1 + channel) : 5 + _HATS * (2 + channel)] = hats
            basis = basis[good]
            normal += basis.T @ basis
            right += basis.T @ level[good, channel]
    share = float(np.sum(kept)) * 3.0 / angles.size
    prior = np.concatenate(
        [[0.0], np.full(4, 1.0), np.full(_HATS, STRIPES.sheen_prior), np.full(3 * _HATS, STRIPES.tint_prior)]
    )
    normal += np.diag(prior * share + 1e-6)
    rough = np.diff(np.eye(_HATS), 2, axis=0)
    normal[5:, 5:] += STRIPES.roughness_prior * share * np.kron(np.eye(4), rough.T @ rough)
    found = np.linalg.solve(normal, right)
    shade = np.clip(series @ found[:5] / 100.0, 0.2, 3.0)
    white, *tints = found[5:].reshape(4, _HATS)
    sheen = np.maximum(np.stack([hats @ (white + tint) for tint in tints], axis=1), 0.0)
    middle = shade[np.abs(s) < 0.6].mean()
    return np.column_stack([shade / middle] * 3 + [sheen])


def _spline(coarse: Samples, fine: Samples) -> tuple[Samples, Samples]:
    """Matrices that map values at the coarse nodes to values and slopes of their cubic spline at the fine ones."""
    from scipy.interpolate import CubicSpline

    spline = CubicSpline(coarse, np.eye(coarse.size))
    return np.ascontiguousarray(spline(fine)), np.ascontiguousarray(spline(fine, 1))
