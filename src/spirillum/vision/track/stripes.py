"""How far the body has turned, from the stripes on its seal."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from spirillum.arrays import Samples
from spirillum.kernels.pictures import profile_of_rows, stripe_fit, stripes_at
from spirillum.robot.robot import Robot
from spirillum.robust import mad_scale
from spirillum.vision.camera.optics import BodyPose, Optics, seen
from spirillum.vision.flag import Flag
from spirillum.vision.setup import Setup, stripes_of
from spirillum.vision.track.colours import (
    colour_classes,
    named_rightly,
    order_seen,
    pattern_period,
    width_seen,
    without_glare,
)
from spirillum.vision.track.constants import STRIPES

__all__ = ["Stripes"]

_ROWS = 16
"""Samples along the axis."""
_BLURRED = 2
"""Of how many frames one is asked for the blur."""
_HUMPS = 15
"""Humps of what shines along the angle."""


@dataclass
class _Look:
    """What the stripes look like in this video."""

    palette: Samples
    """Colour of each class, (classes, 3)."""
    shade: Samples
    """Brightness of a colour at each angle in each channel, and what shines there whatever the colour, (n, 6)."""
    blur: float
    """Standard deviation, pixels."""
    residual: float
    """Typical residual of a channel, of 255."""
    trust: Samples
    """Weight of each angle: less where frames differ from what is expected, as under a highlight, (n,)."""


class Stripes:
    """Reads the angle by which the body has turned about +x, modulo the period of its stripes.

    The picture is sampled on the surface of the seal where the optics show it, averaged along the axis without the
    brightest and darkest quarters, and compared with the stripes at every angle. Colours, shading and blur are those
    of the video: `learn` finds them, starting from the named colours.
    """

    def __init__(self, robot: Robot, setup: Setup, optics: Optics) -> None:
        self.robot, self.optics = robot, optics
        self.stripes = stripes_of(setup, robot)
        self.names = tuple(dict.fromkeys(self.stripes))
        self.period = pattern_period(self.stripes) if self.stripes else 2.0 * np.pi
        self.order = np.array([self.names.index(name) for name in self.stripes], dtype=np.int64)
        self.look: _Look | None = None
        self.fits = False
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

    def learn(self, samples: Sequence[tuple[np.ndarray, BodyPose]]) -> None:
        """Find colours, shading and blur of the stripes in some frames of the video.

        Args:
            samples: pictures, 8-bit RGB (h, w, 3), and where the body is in each.
        """
        if len(self.names) < 2 or self.robot.seal is None:
            sentence = "the robot has no stripes, so that its body's rotation cannot be seen; it is not given"
            self.flags = (Flag("no-stripes", sentence, ("body_rotation_rate",)),)
            return
        found = [self._profile(image, pose) for image, pose in samples]
        found = [(profile, scale) for profile, scale in found if np.isfinite(profile).all(axis=1).mean() > 0.5]
        if len(found) < 1:
            self.flags = (self._unreadable(),)
            return
        profiles = np.array([profile for profile, _ in found])
        scales = np.array([scale for _, scale in found])
        steep = scales > 0.45 * scales.max(axis=1, keepdims=True)
        facing = profiles[steep & np.isfinite(profiles).all(axis=2)]
        palettes = colour_classes(facing, self.names)
        start = palettes[1]
        seen_steep = np.where(steep[..., None], profiles, np.nan)
        palette, verdict = order_seen(seen_steep, self.angles, palettes, self.stripes, self.names)
        clear = without_glare(profiles, (palette, *palettes[1:]))
        self.look = self._refined(profiles, clear, scales, palette)
        least = self._typical_loss(profiles, scales, self.look)
        if least > STRIPES.good:
            other = self._refined(profiles, clear, scales, start)
            loss = self._typical_loss(profiles, scales, other)
            self.look, least = (other, loss) if loss < least else (self.look, least)
        rightly = named_rightly(self.look.palette, start)
        stated = 2.0 * np.pi / len(self.stripes)
        wide = width_seen(seen_steep, self.angles, (palette, *palettes[1:]), stated) / stated
        counted = not abs(np.log(wide)) > STRIPES.width_range
        if least < STRIPES.fits and rightly and counted:
            self.fits = True
            return  # the order given fits, with the colours that belong to its names
        if verdict in ("reversed", "other"):
            how = "in the reversed order" if verdict == "reversed" else "in another order"
            sentence = (
                f"the stripes are seen {how} than {', '.join(self.stripes)}; the body's rotation is not given: "
                "check robot.stripes"
            )
            self.flags = (Flag("stripe-order", sentence, ("body_rotation_rate",)),)
        elif least >= STRIPES.fits or not counted:
            sentence = (
                f"what is seen on the seal does not look like {len(self.stripes)} stripes, {', '.join(self.stripes)}; "
                "the body's rotation is not given: check robot.stripes"
            )
            self.flags = (Flag("stripes-do-not-fit", sentence, ("body_rotation_rate",)),)
        else:
            self.fits = True

    def _typical_loss(self, profiles: Samples, scales: Samples, look: _Look) -> float:
        """Median loss over that of an even colour."""
        fits = [self._fit(p, s, look) for p, s in zip(profiles, scales, strict=True)]
        return float(np.median([a[2] / a[4] if np.isfinite(a[0]) else 1.0 for a in fits]))

    def read(self, image: np.ndarray, pose: BodyPose) -> tuple[float, float]:
        """Angle by which the body has turned about +x and its standard error, rad; NaN where it cannot be read.

        The angle is modulo `period`.

        Args:
            image: the picture, 8-bit RGB (h, w, 3).
            pose: where the body is in it.
        """
        if self.look is None:
            return np.nan, np.nan
        profile, scale = self._profile(image, pose)
        answer = self._fit(profile, scale, self.look)
        loss, other, flat = answer[2:5]
        if not np.isfinite(answer).all() or loss > STRIPES.unreadable * flat or other < STRIPES.ambiguous * loss:
            return np.nan, np.nan
        return float(answer[0]), float(
            np.sqrt(answer[1] ** 2 + STRIPES.floor**2 + (STRIPES.pixel_locking / scale.max()) ** 2)
        )

    def _unreadable(self) -> Flag:
        sentence = "the stripes are in no frame's view, so that the body's rotation is not given"
        return Flag("stripes-unreadable", sentence, ("body_rotation_rate",))

    def _profile(self, image: np.ndarray, pose: BodyPose) -> tuple[Samples, Samples]:
        """Colours along the angle, (n, 3), and how many pixels a radian is there, (n,); 0 where it faces away."""
        ends = seen(self._surface, pose, self.optics).reshape(2, -1, 2)
        first, last = self._between @ ends[0], self._between @ ends[1]
        along = self._slope @ (0.5 * (ends[0] + ends[1]))
        axis = (last - first).mean(axis=0)
        normal = np.array([axis[1], -axis[0]]) / (np.linalg.norm(axis) + 1e-300)
        scale = along @ normal
        scale = np.maximum(scale * np.sign(scale[scale.size // 2]), 0.0)
        profile = np.empty((self.angles.size, 3))
        profile_of_rows(image, first, last, _ROWS, profile)
        if "white" not in self.names:
            profile[self._dazzled(profile)] = np.nan
        return profile, scale

    def _dazzled(self, profile: Samples) -> np.ndarray:
        """Angles at which wide glare hides every colour, and its halo, (n,)."""
        white = profile.min(axis=1) > STRIPES.white
        if np.count_nonzero(white) < STRIPES.wide_glare:
            return np.zeros(white.shape, dtype=bool)
        return np.asarray(np.convolve(white, np.ones(2 * STRIPES.halo + 1), mode="same") > 0.5)

    def _fit(self, profile: Samples, scale: Samples, look: _Look) -> Samples:
        """The answer of `stripe_fit`; NaN where too little is in view."""
        edges = np.diff(look.palette[np.append(self.order, self.order[0])], axis=0)
        cut = max(STRIPES.cut * look.residual, STRIPES.edge_cut * float(np.median(np.linalg.norm(edges, axis=1))))
        answer, losses = np.full(8, np.nan), np.empty(max(24, round(self.period / np.deg2rad(4.0))))
        settings = self.period, STRIPES.lamp_tint, cut, 0.3 * look.residual, look.blur
        known = profile, scale, look.trust, self.angles, look.shade, self.order, look.palette
        stripe_fit(*known, settings, losses, answer)
        return answer

    def _refined(self, profiles: Samples, clear: Samples, scales: Samples, palette: Samples) -> _Look:
        """Colours, shading and blur with which the stripes fit best; what shines is learnt once the stripes are."""
        even = np.column_stack([np.ones((self.angles.size, 3)), np.zeros((self.angles.size, 3))])
        look = _Look(palette, even, 1.0, STRIPES.first_residual, np.ones(self.angles.size))
        for repeat in range(STRIPES.repeats):
            if repeat in (2, STRIPES.repeats - 1):
                losses = []
                for blur in STRIPES.blurs:
                    trial = _Look(look.palette, look.shade, blur, look.residual, look.trust)
                    some = zip(profiles[::_BLURRED], scales[::_BLURRED], strict=True)
                    losses.append(np.nansum([self._fit(p, s, trial)[2] for p, s in some]))
                look.blur = STRIPES.blurs[int(np.argmin(losses))]
            look = self._relearned(clear if repeat < STRIPES.repeats_without_glare else profiles, scales, look)
        return look

    def _relearned(self, profiles: Samples, scales: Samples, look: _Look) -> _Look:
        """Colours of the classes and shading along the angle, from frames whose angles are known by now."""
        width = 2.0 * np.pi / len(self.order)
        sums, weights = np.zeros_like(look.palette), np.zeros(len(look.palette))
        models, wanted, good_at, residuals, squares = [], [], [], [], []
        fits = [self._fit(p, s, look) for p, s in zip(profiles, scales, strict=True)]
        losses = np.array([a[2] / a[4] if np.isfinite(a[0]) else np.inf for a in fits])
        best = np.argsort(losses)[: max(3, int(0.8 * np.isfinite(losses).sum()))]
        shade, sheen = look.shade[:, :3], look.shade[:, 3:]
        for which in best[np.isfinite(losses[best])]:
            profile, scale, answer = profiles[which], scales[which], fits[which]
            model = np.empty_like(shade)
            blur = np.clip(look.blur / np.maximum(scale, 1e-9), 0.004, 0.5)
            stripes_at(self.angles, blur, answer[0], self.order, look.palette, model)
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
            clear = inside & (sheen.mean(axis=1) < 0.5 * sheen.mean(axis=1).max() + 4.0)  # where little shines
            for index in range(len(look.palette)):
                mine = clear & (classes == index)
                sums[index] += np.sum((level[mine] - sheen[mine]) / shade[mine], axis=0)
                weights[index] += mine.sum()
        if not models:
            return look
        enough = weights > 5
        palette = look.palette.copy()
        palette[enough] = np.maximum(sums[enough] / weights[enough, None], 0.0)
        light = _light(self.angles, np.array(models), np.array(wanted), np.array(good_at))
        rough = np.sqrt(np.median(np.array(squares), axis=0))
        rough = np.convolve(np.pad(rough, 2, mode="edge"), np.ones(5) / 5.0, mode="valid")
        usual = np.median(rough) + 1.0
        trust = 1.0 / (1.0 + STRIPES.doubt * (rough / usual) ** 2)
        return _Look(palette, light, look.blur, float(np.median(residuals)), trust / trust.max())


def _light(angles: Samples, models: Samples, wanted: Samples, kept: np.ndarray) -> Samples:
    """How the surface is lit along the angle: as a factor of its colour, and what shines on it in white.

    Both are smooth: a short series and a row of humps, held to even light where little was seen. Colours tell them
    apart even where the body hardly turned: what shines greys them.

    Args:
        angles: rad, (n,).
        models: colours of the stripes in some frames, (f, n, 3).
        wanted: the picture's colours there, (f, n, 3).
        kept: which of them count, (f, n).
    """
    s = angles / STRIPES.reach
    series = np.stack([s**power for power in range(5)], axis=1)
    centres = np.linspace(-1.0, 1.0, _HUMPS)
    humps = np.maximum(0.0, 1.0 - np.abs(s[:, None] - centres) / (centres[1] - centres[0]))
    count = 5 + 4 * _HUMPS  # series, white humps, and what each channel has besides
    normal, right = np.zeros((count, count)), np.zeros(count)
    for model, level, good in zip(models, wanted, kept, strict=True):
        for channel in range(3):
            basis = np.zeros((angles.size, count))
            basis[:, :5] = series * model[:, channel : channel + 1] / 100.0
            basis[:, 5 : 5 + _HUMPS] = humps
            basis[:, 5 + _HUMPS * (1 + channel) : 5 + _HUMPS * (2 + channel)] = humps
            basis = basis[good]
            normal += basis.T @ basis
            right += basis.T @ level[good, channel]
    share = float(np.sum(kept)) * 3.0 / angles.size
    held = np.concatenate(
        [[0.0], np.full(4, 1.0), np.full(_HUMPS, STRIPES.sheen_prior), np.full(3 * _HUMPS, STRIPES.tint_prior)]
    )
    normal += np.diag(held * share + 1e-6)
    rough = np.diff(np.eye(_HUMPS), 2, axis=0)
    normal[5:, 5:] += STRIPES.roughness_prior * share * np.kron(np.eye(4), rough.T @ rough)
    found = np.linalg.solve(normal, right)
    shade = np.clip(series @ found[:5] / 100.0, 0.2, 3.0)
    white, *tints = found[5:].reshape(4, _HUMPS)
    sheen = np.maximum(np.stack([humps @ (white + tint) for tint in tints], axis=1), 0.0)
    middle = shade[np.abs(s) < 0.6].mean()
    return np.column_stack([shade / middle] * 3 + [sheen])


def _spline(coarse: Samples, fine: Samples) -> tuple[Samples, Samples]:
    """Matrices that take values at some places to a cubic spline's values and slopes at others."""
    from scipy.interpolate import CubicSpline

    spline = CubicSpline(coarse, np.eye(coarse.size))
    return np.ascontiguousarray(spline(fine)), np.ascontiguousarray(spline(fine, 1))
