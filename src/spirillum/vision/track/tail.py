"""Phase of the tail on each frame: a travelling wave fitted to the image of the wire."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.kernels.core import ridge_of, sampled, wave_fit, wave_scores
from spirillum.robot.robot import Robot
from spirillum.robust import mad_scale
from spirillum.vision.camera.optics import BodyPose, Optics, project
from spirillum.vision.flag import Flag
from spirillum.vision.setup import Setup
from spirillum.vision.track.constants import TAIL

_COARSE = 13  # stations along the tail at which the optics are evaluated
_CONTRASTS = ((-1, -1, -1), (1, 1, 1), (0, 0, -1), (0, 0, 1), (1, 0, -1), (-1, 0, 1), (0, -1, 0), (0, 1, 0))
"""First candidates of the contrast, as weights of red, green and blue: a darker, brighter, more yellow, ... wire."""
_FACTORS = np.arange(0.60, 1.66, 0.03)  # candidate wavelengths, over that of the robot file
_NEAR = np.linspace(0.84, 1.16, 17)  # wavelengths over the robot file's among which the apparent one is interpolated
_AMPLITUDES = (0.5, 0.63, 0.8, 1.0, 1.25, 1.6, 2.0)
"""Candidate amplitudes where the tail does not fit, over that of the robot file."""
_UNSEEN = Flag.named("tail-unreadable")
_PHASES = 2.0 * np.pi * np.arange(TAIL.phases) / TAIL.phases
_TURNS = np.column_stack([np.cos(_PHASES), np.sin(_PHASES)])


class _Strip(NamedTuple):
    """A grid of pixels along and across the tail."""

    middle: Samples  # pixel of the tail's axis in each row, (rows, 2)
    across: Samples  # step from one column to the next, pixels, (rows, 2)
    tilt: Samples  # derivatives with height of the shifts along (e) and across (f) and the magnification (g), (rows, 3)


class _SeenShape(NamedTuple):
    """The shape of the tail in the picture."""

    wavelength: float  # over that of the robot file
    amplitude: float  # over that of the robot file


class TailWave:
    """Reads the phase phi of the tail in the lab, modulo 2 pi.

    Wavelength, amplitude, taper and handedness are those of the robot; phase, lateral offset and tilt are fitted. The
    direction in which the wave travels and the handedness determine the sense of rotation. Perspective reveals the
    handedness weakly: higher points appear larger and further from the centre of the picture.
    """

    period = 2.0 * np.pi

    def __init__(self, robot: Robot, setup: Setup, optics: Optics) -> None:  # noqa: ARG002 - as Stripes
        self.robot, self.optics = robot, optics
        tail = robot.tail
        root = 0.5 * robot.body.length + robot.coupling.length
        wavenumber = 2.0 * np.pi / tail.wavelength
        self.wave = np.array(
            [
                -robot.hand * wavenumber,
                -robot.hand * wavenumber * root,
                0.0 if tail.taper is None else tail.taper / tail.length,
                tail.amplitude,
            ]
        )
        pixel = optics.length_per_pixel
        first = min(2.0 * tail.wire_diameter, 0.1 * tail.length)
        rows = int(np.clip(round((tail.length - first) / (TAIL.row_spacing * pixel)), 40, 400))
        self.xi = np.linspace(first, tail.length, rows)
        step = float(np.clip(TAIL.column_spacing * tail.wire_diameter, 0.4 * pixel, pixel))
        self.inner = max(1, round(0.5 * tail.wire_diameter / step))
        reach = tail.amplitude + TAIL.border * max(tail.wire_diameter, 2.0 * pixel)
        self.columns = 1 + 2 * int(np.ceil(reach / step))
        self.step = step
        self.width = max(tail.wire_diameter, 2.0 * pixel)
        self.contrast: Samples | None = None
        self.usual = 0.0
        self.readable = 0.0
        self.stretch = np.nan
        self._flags: list[Flag] = []
        self._hand: list[tuple[float, float]] = []
        coarse = np.linspace(first, tail.length, _COARSE)
        from scipy.interpolate import CubicSpline

        self._between = np.ascontiguousarray(CubicSpline(coarse, np.eye(_COARSE))(self.xi))
        b = self.lift = tail.amplitude
        corners = np.array([[0, 0], [b, 0], [-b, 0], [0, b], [0, -b], [b, b], [-b, -b], [b, -b], [-b, b]], dtype=float)
        x = np.broadcast_to((-root - coarse)[:, None], (_COARSE, len(corners)))
        y, z = (np.broadcast_to(corners[:, k], x.shape) for k in (0, 1))
        self._points = np.stack([x, y, z], axis=-1).reshape(-1, 3)
        self._slope = np.gradient(np.eye(_COARSE), coarse[1] - coarse[0], axis=0, edge_order=2)

    def learn(self, samples: Sequence[tuple[np.ndarray, BodyPose]]) -> None:
        """Learn the contrast of the wire to its surroundings, and check its shape against the robot file."""
        if not self.robot.tail.form.is_plain:
            self._flags = [Flag.named("tail-no-helix")]
            return
        strips = [(image, self._strip(pose)) for image, pose in samples]
        best, chosen = 0.0, None
        for weights in _CONTRASTS:
            contrast = np.array(weights, dtype=float)
            contrast /= np.linalg.norm(contrast)
            found = np.array([self._clearness(image, strip, contrast) for image, strip in strips])
            found = found[np.isfinite(found)]
            clear = float(found.mean()) if found.size else 0.0
            if clear > best:
                best, chosen = clear, contrast
        self.contrast = chosen
        if chosen is None:
            self._flags = [_UNSEEN]
            return
        fits = np.array([answer for answer, _ in self.settled(strips)])
        readable = fits[:, 2] > TAIL.least_share
        self.readable = float(np.mean(readable))
        self._check_shape(strips, fits[readable], self.readable)
        if self.readable > TAIL.seen_share and not self._flags:
            self.stretch = self._apparent_stretch([strips[k] for k in np.flatnonzero(readable)])
        if self.readable < 0.2 and not self._flags:
            self._flags = [_UNSEEN]

    def _apparent_stretch(self, strips: Sequence[tuple[np.ndarray, _Strip]]) -> float:
        """Apparent wavelength over that of the robot file at the scale of this camera, median over some frames."""
        # NaN where its standard error is above `TAIL.stretch_error`.
        assert self.contrast is not None  # noqa: S101 - learnt
        found = []
        for image, strip in strips[:: max(1, len(strips) // 12)]:
            ridge = self._ridge(image, strip, self.contrast)
            scores = [self._scores(ridge, strip, self._shaped(_SeenShape(factor, 1.0))).max() for factor in _NEAR]
            best = int(np.argmax(scores))
            if 0 < best < len(_NEAR) - 1:
                before, top, after = scores[best - 1 : best + 2]
                share = 0.5 * (before - after) / (before - 2.0 * top + after)
                found.append(float(_NEAR[best] + share * (_NEAR[1] - _NEAR[0])))
        if len(found) < TAIL.stretch_frames:
            return np.nan
        error = float(mad_scale(np.array(found) - np.median(found))) / np.sqrt(len(found))
        return float(np.median(found)) if error < TAIL.stretch_error else np.nan

    def settled(self, strips: Sequence[tuple[np.ndarray, _Strip]]) -> list[tuple[Samples, float]]:
        """Refit the contrast from a first one; fit and rival (see `_fit`) on each frame."""
        self.usual = 0.0
        for _ in range(2):
            self._refit_contrast(strips)
        peaks = [answer[9] for answer, _ in (self._fit(image, strip) for image, strip in strips) if answer[2] > 0.3]
        self.usual = 0.5 * float(np.median(peaks)) if peaks else 0.0
        return [self._fit(image, strip) for image, strip in strips]

    def read(self, image: np.ndarray, pose: BodyPose) -> tuple[float, float]:
        """Phase of the tail and its standard error, rad; NaN where it is unreadable."""
        found, hand = self._reading(image, pose)
        if hand is not None:
            self._hand.append(hand)
        return found

    def reads(self, image: np.ndarray, pose: BodyPose) -> bool:
        """Whether a tail like the robot's is found at a pose; does not change the state of the reader."""
        return bool(np.isfinite(self._reading(image, pose)[0][0]))

    def _reading(self, image: np.ndarray, pose: BodyPose) -> tuple[tuple[float, float], tuple[float, float] | None]:
        """Phase with its standard error, and the frame's evidence on handedness; None without evidence."""
        nothing = (np.nan, np.nan), None
        if self.contrast is None:
            return nothing
        answer, rival = self._fit(image, self._strip(pose))
        if not np.isfinite(answer[:2]).all() or answer[2] < TAIL.least_share or rival > TAIL.largest_rival:
            return nothing
        hand = (float(answer[5]), float(answer[6])) if answer[6] > 0.0 else None
        return (float(answer[0] % (2.0 * np.pi)), float(np.hypot(answer[1], TAIL.floor))), hand

    @property
    def flags(self) -> tuple[Flag, ...]:
        """Warnings, including that on the handedness seen on the frames read so far."""
        flags = list(self._flags)
        if self.handedness() == -1:
            hand = self.robot.tail.handedness
            flags.append(Flag.named("tail-of-other-hand", seen="left" if hand == "right" else "right", hand=hand))
        return tuple(flags)

    def flags_given_doubt(self, *, doubtful: bool) -> tuple[Flag, ...]:
        """Warnings, where the place of the body or the light may be the reason why the tail does not fit its file."""
        if not doubtful:
            return self.flags
        other = [flag for flag in self.flags if flag.name != "tail-does-not-fit"]
        return (*other, _UNSEEN) if any(flag.spoils for flag in set(self.flags) - set(other)) else tuple(other)

    def handedness(self) -> int:
        """Handedness by perspective: 1 as in the robot file, -1 the opposite one, 0 undecided."""
        if len(self._hand) < 20:
            return 0
        top, bottom = np.array(self._hand).T
        misfit = top.sum() / bottom.sum()
        residual = top - misfit * bottom
        blocks = np.array_split(residual, min(12, residual.size // 5))  # errors of neighbouring frames are correlated
        sums = np.array([block.sum() for block in blocks])
        error = np.sqrt(np.sum(sums**2)) / bottom.sum()
        if abs(misfit + 1.0) < max(4.0 * error, 0.35):
            return 0
        return 1 if misfit > -1.0 else -1

    def _strip(self, pose: BodyPose) -> _Strip:
        pixels = project(self._points, pose, self.optics).reshape(_COARSE, -1, 2)
        b = self.lift
        axis = pixels[:, 0]
        y = (pixels[:, 1] - pixels[:, 2]) / (2.0 * b)
        z = (pixels[:, 3] - pixels[:, 4]) / (2.0 * b)
        yz = (pixels[:, 5] + pixels[:, 6] - pixels[:, 7] - pixels[:, 8]) / (4.0 * b * b)
        along = self._slope @ axis
        det = along[:, 0] * y[:, 1] - along[:, 1] * y[:, 0]
        e = (z[:, 0] * y[:, 1] - z[:, 1] * y[:, 0]) / det
        f = (along[:, 0] * z[:, 1] - along[:, 1] * z[:, 0]) / det
        g = (along[:, 0] * yz[:, 1] - along[:, 1] * yz[:, 0]) / det
        fine = self._between @ np.column_stack([axis, y * self.step, e, f, g])
        return _Strip(
            np.ascontiguousarray(fine[:, :2]), np.ascontiguousarray(fine[:, 2:4]), np.ascontiguousarray(fine[:, 4:])
        )

    def _ridge(self, image: np.ndarray, strip: _Strip, contrast: Samples) -> Samples:
        ridge = np.empty((len(strip.middle), self.columns))
        ridge_of(image, strip.middle, strip.across, contrast, self.inner, np.empty((2, self.columns)), ridge)
        return ridge

    def _scores(self, ridge: Samples, strip: _Strip, wave: Samples) -> Samples:
        scores = np.empty(TAIL.phases)
        wave_scores(ridge, self.xi, strip.tilt, wave, self.step, TAIL.row_stride, _TURNS, scores)
        return scores

    def _clearness(self, image: np.ndarray, strip: _Strip, contrast: Samples) -> float:
        """Contrast of the best phase against the others, over the root mean square ridge of the strip."""
        # Only the rows are filtered that the scores are summed over.
        xi, *rows = (rows[:: TAIL.row_stride] for rows in (self.xi, *strip))
        few = _Strip(*rows)
        ridge, scores = self._ridge(image, few, contrast), np.empty(TAIL.phases)
        wave_scores(ridge, xi, few.tilt, self.wave, self.step, 1, _TURNS, scores)
        if not np.isfinite(scores).all():
            return np.nan
        return float((scores.max() - np.median(scores)) / (np.sqrt(np.nanmean(ridge**2)) + 0.5))

    def _fit(self, image: np.ndarray, strip: _Strip) -> tuple[Samples, float]:
        """The result of `wave_fit`, and the best score of a distant phase over the best one."""
        answer = np.full(10, np.nan)
        answer[2] = 0.0
        if self.contrast is None:
            return answer, np.inf
        ridge = self._ridge(image, strip, self.contrast)
        scores = self._scores(ridge, strip, self.wave)
        if not np.isfinite(scores).all() or scores.max() <= 0.0:
            return answer, np.inf
        best = int(np.argmax(scores))
        count = scores.size
        apart = np.abs((np.arange(count) - best + count // 2) % count - count // 2) > count / 6
        likely = TAIL.offset * self.width, TAIL.tilt * (self.xi[-1] - self.xi[0])
        settings = (2.0 * np.pi * best / count, self.step, self.width, self.usual, *likely)
        wave_fit(ridge, self.xi, strip.tilt, self.wave, *settings, np.empty((self.xi.size, 10)), answer)
        return answer, float(scores[apart].max() / scores[best])

    def _curve(self, strip: _Strip, answer: Samples) -> Samples:
        """Pixels of the fitted wire, (rows, 2), to first order in height."""
        wave = self.wave
        r = wave[3] * (1.0 - np.exp(-(wave[2] if wave[2] > 0 else 1e12) * self.xi))
        a = wave[0] * self.xi + wave[1] + answer[0]
        y = r * np.cos(a) + answer[3] + answer[4] * (self.xi - self.xi.mean())
        z = r * np.sin(a)
        e, f, g = strip.tilt.T
        sideways = (y + f * z + g * y * z) / self.step
        along = np.gradient(strip.middle, self.xi, axis=0)
        return np.asarray(strip.middle + sideways[:, None] * strip.across + (e * z)[:, None] * along)

    def _refit_contrast(self, strips: Sequence[tuple[np.ndarray, _Strip]]) -> None:
        """Refit the contrast: the linear discriminant of the wire's colours against those of both its sides."""
        steps, spreads = [], []
        for image, strip in strips:
            answer, rival = self._fit(image, strip)
            if answer[2] < 0.3 or rival > 0.95:
                continue
            curve = self._curve(strip, answer)
            colours = []
            for shift in (0.0, 1.6, -1.6, 2.2, -2.2):
                found = np.empty((len(curve), 3))
                sampled(image, curve + shift * self.width / self.step * strip.across, found)
                colours.append(found)
            sides = np.stack(colours[1:])
            rest = sides.reshape(-1, 3)
            rest = rest[np.isfinite(rest).all(axis=1)]
            if not len(rest):
                continue
            steps.append(np.nanmedian(colours[0] - sides.mean(axis=0), axis=0))
            rest -= rest.mean(axis=0)
            spreads.append(rest.T @ rest / len(rest))
        if steps:
            step = np.median(steps, axis=0)
            noise = np.median(spreads, axis=0) + 9.0 * np.eye(3)
            contrast = np.linalg.solve(noise, step)
            if (size := np.linalg.norm(contrast)) > 0.0:  # a flat drawing has places where nothing differs
                self.contrast = np.asarray(contrast / size)

    def _check_shape(self, strips: Sequence[tuple[np.ndarray, _Strip]], fits: Samples, readable: float) -> None:
        """Flag a wavelength or amplitude that fits better than that of the robot file."""
        if self.contrast is None:
            return
        few = strips[:: max(1, len(strips) // 12)]
        ridges = [(self._ridge(image, strip, self.contrast), strip) for image, strip in few]
        scores = self.scores_by_wavelength(ridges, 1.0)
        if scores is None:
            return
        own, best = float(np.interp(1.0, _FACTORS, scores)), int(np.argmax(scores))
        if abs(_FACTORS[best] - 1.0) > 0.07 and scores[best] > 1.15 * own:
            spoils = readable < 0.8 or own < 0.7 * scores[best]
            shape = self._apparent_shape(few)
            if shape is not None:
                name = "tail-far-off" if spoils else "tail-does-not-fit"
                self._flags.append(Flag.named(name, how=self._describe_difference(shape)))
            elif spoils:
                self._flags.append(_UNSEEN)
            return
        tail = self.robot.tail
        if len(fits):
            share = float(fits[:, 7].sum() / max(fits[:, 8].sum(), 1e-300))
            other = self.scores_by_wavelength(ridges, 1.0 + share) if abs(share) > 0.2 else None
            if other is not None and float(np.interp(1.0, _FACTORS, other)) > own:  # it lies more on the wire
                given = tail.amplitude * 1e3
                self._flags.append(Flag.named("tail-of-other-amplitude", seen=(1.0 + share) * given, given=given))

    def _apparent_shape(self, strips: Sequence[tuple[np.ndarray, _Strip]]) -> _SeenShape | None:
        """The best-fitting wavelength and amplitude over all candidate contrasts; None if no such tail is seen."""
        # Noise has a best-fitting shape too: on half of the frames the tail has to be readable in that shape.
        found = []
        for weights in _CONTRASTS:
            contrast = np.array(weights) / np.linalg.norm(weights)
            ridges = [(self._ridge(image, strip, contrast), strip) for image, strip in strips[::3]]
            ridges = [(ridge / (np.sqrt(np.mean(np.nan_to_num(ridge) ** 2)) + 0.5), strip) for ridge, strip in ridges]
            for amplitude in _AMPLITUDES:
                by_wavelength = self.scores_by_wavelength(ridges, amplitude)
                if by_wavelength is not None:
                    shape = _SeenShape(_FACTORS[int(np.argmax(by_wavelength))], amplitude)
                    found.append((by_wavelength.max(), shape, weights))
        score, shape, weights = max(found, default=(0.0, _SeenShape(1.0, 1.0), _CONTRASTS[0]))
        if score <= 0.0:
            return None
        other = copy(self)
        other.wave, other.contrast = self._shaped(shape), np.array(weights) / np.linalg.norm(weights)
        read = [fit[2] > TAIL.least_share and rival < TAIL.largest_rival for fit, rival in other.settled(strips)]
        return shape if np.mean(read) > TAIL.seen_share and other.halves_agree(strips) else None

    def halves_agree(self, strips: Sequence[tuple[np.ndarray, _Strip]]) -> bool:
        """Whether the front and the rear half of the tail show the same wavelength, each by itself."""
        # A ruler, a grid or the rim of a reflection may look like a wave of some length, but not like one in both
        # halves.
        assert self.contrast is not None  # noqa: S101 - only of a wave that was read
        ridges = [(self._ridge(image, strip, self.contrast), strip) for image, strip in strips]
        middle = self.xi.size // 2
        found = []
        for rows in (slice(None, middle), slice(middle, None)):
            half = copy(self)
            half.xi = self.xi[rows]
            parts = [(ridge[rows], _Strip(*(part[rows] for part in strip))) for ridge, strip in ridges]
            scores = half.scores_by_wavelength(parts, 1.0)
            if scores is None:
                return False
            found.append(float(_FACTORS[int(np.argmax(scores))]))
        return max(abs(factor - 1.0) for factor in found) < TAIL.halves_agree

    def _shaped(self, shape: _SeenShape) -> Samples:
        """The wave of a tail of another shape."""
        return np.asarray(self.wave * np.array([1.0 / shape.wavelength, 1.0 / shape.wavelength, 1.0, shape.amplitude]))

    def _describe_difference(self, shape: _SeenShape) -> str:
        """In words, how a shape differs from that of the robot file."""
        seen = []
        for name, least in (("wavelength", 0.07), ("amplitude", 0.0)):
            factor = getattr(shape, name)
            if abs(factor - 1.0) > least:
                given = getattr(self.robot.tail, name) * 1e3
                seen.append(f"tail.{name} looks like {factor * given:.1f} mm, and is {given:.3g} mm there")
        return f" ({'; '.join(seen)})" if seen else ""

    def scores_by_wavelength(self, ridges: Sequence[tuple[Samples, _Strip]], amplitude: float) -> Samples | None:
        """Scores of waves of `_FACTORS` times the wavelength; None where too little of the tail is in view."""
        found = []
        for ridge, strip in ridges:
            waves = [self._shaped(_SeenShape(factor, amplitude)) for factor in _FACTORS]
            scores = np.array([self._scores(ridge, strip, wave).max() for wave in waves])
            if np.isfinite(scores).all():
                found.append(scores)
        return np.sum(found, axis=0) if found else None
