"""Form of a tail: its helix, several starts, sizes that vary along it, or a centre line through points."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from spirillum.arrays import Samples, Tensors, Values, Vectors

Along = tuple[tuple[float, float], ...]
"""Factor along the tail: (share of its length, factor) from 0 to 1; empty where it is uniform."""
CurvePoints = tuple[tuple[float, float, float], ...]
"""Points of a centre line in the tail's frame, mm: x from the root to the tip on the motor axis, right-handed."""

_PER_GAP = 24  # samples between two points of a centre line, from which its lengths and bends follow
ROOT_SHARE = 0.05  #: Share of the wires' length in which those of several starts may touch: there they are joined.
_SHARES: Samples = np.linspace(0.0, 1.0, 129)


class TailForm(NamedTuple):
    """Form of a tail beyond its sizes: hashable, shared by the robots of a batch."""

    starts: int = 1  #: Identical wires, evenly spaced around the axis.
    amplitude: Along = ()  #: Local amplitude over the largest.
    wavelength: Along = ()  #: Local wavelength over the mean one, that of as many turns.
    curve: CurvePoints = ()  #: A centre line in place of the helix, mm.
    tolerance: float = 0.0  #: Root mean square distance by which smoothing may move its points, m.

    @classmethod
    def read(cls, values: Sequence[Any]) -> TailForm:
        """From JSON, which has lists."""
        starts, amplitude, wavelength, curve, tolerance = values
        points: list[Any] = [tuple(map(tuple, part)) for part in (amplitude, wavelength, curve)]
        return cls(starts, points[0], points[1], points[2], tolerance)

    @property
    def is_helix(self) -> bool:
        """Whether each wire is a helix of one amplitude and wavelength."""
        return not (self.amplitude or self.wavelength or self.curve)

    @property
    def is_plain(self) -> bool:
        """Whether the tail is one such helix."""
        return self.starts == 1 and self.is_helix

    @property
    def turns(self) -> Samples:
        """Angle of each wire about the axis against the first, rad, (starts,)."""
        return 2.0 * np.pi * np.arange(self.starts) / self.starts

    @property
    def rotations(self) -> Tensors:
        """Rotation of each wire about the axis against the first, (starts, 3, 3)."""
        cos, sin, zero = np.cos(self.turns), np.sin(self.turns), np.zeros(self.starts)
        rows = [[zero + 1.0, zero, zero], [zero, cos, -sin], [zero, sin, cos]]
        return np.moveaxis(np.array(rows), -1, 0)

    @property
    def centre(self) -> CentreLine:
        """The centre line through the points."""
        return centre_line(self.curve, self.tolerance)

    def amplitude_at(self, share: Values) -> tuple[Values, Values]:
        """Local over largest amplitude at shares of the length, and its derivative by the share."""
        line, slope, _ = along_points(self.amplitude)
        top = max(value for _, value in self.amplitude)
        return line(share) / top, slope(share) / top

    def wavenumber_at(self, share: Values) -> tuple[Values, Values]:
        """Local over mean wavenumber at shares of the length, and its integral from the root."""
        rate, _, whole = along_points(self.wavelength, inverse=True)
        return rate(share) / whole(1.0), whole(share) / whole(1.0)

    def widths(self, amplitude: Values, wavelength: Values) -> tuple[Values, Values]:
        """Local amplitude and wavelength at shares along the tail, (..., shares); sizes as they are for a helix."""
        b, wave = np.asarray(amplitude)[..., None], np.asarray(wavelength)[..., None]
        if self.amplitude:
            b = b * self.amplitude_at(_SHARES)[0]
        if self.wavelength:
            wave = wave / self.wavenumber_at(_SHARES)[0]
        return np.broadcast_arrays(b, wave)[0], np.broadcast_arrays(b, wave)[1]

    def arc_length(self, amplitude: Values, wavelength: Values, length: Values) -> Values:
        """Length of a wire without the rise of its amplitude at the root, m."""
        if self.curve:
            return np.full(np.shape(length), self.centre.length)
        b, wave = self.widths(amplitude, wavelength)
        stretch = np.hypot(1.0, 2.0 * np.pi * b / wave)
        mean: Values = np.trapezoid(stretch, _SHARES, axis=-1) if stretch.shape[-1] > 1 else stretch[..., 0]
        return length * mean


PLAIN = TailForm()  #: One plain helix.


@lru_cache(maxsize=64)
def along_points(points: Along, *, inverse: bool = False) -> tuple[Any, Any, Any]:
    """Monotone interpolation of factors, its derivative and integral; of their inverses by many points."""
    from scipy.interpolate import PchipInterpolator

    share, value = np.array(points).T
    line = PchipInterpolator(share, value)
    if inverse:
        fine = np.union1d(share, np.linspace(0.0, 1.0, 257))
        line = PchipInterpolator(fine, 1.0 / line(fine))
    return line, line.derivative(), line.antiderivative()


class CentreLine:
    """A smooth centre line through points in the tail's frame, m; its parameter runs from 0 to 1."""

    def __init__(self, points: Samples, tolerance: float) -> None:
        """Interpolate by cubic splines over the length of chords, or smooth by splines of least knots."""
        from scipy.interpolate import CubicSpline, PPoly, splprep

        chord = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
        self._knots = chord / chord[-1]
        if tolerance > 0:
            (knots, coefficients, degree), _ = splprep(points.T, u=self._knots, s=len(points) * tolerance**2)
            parts = [PPoly.from_spline((knots, each, degree)) for each in coefficients]
            self._spline: Any = PPoly(np.stack([part.c for part in parts], axis=-1), parts[0].x)
        else:
            self._spline = CubicSpline(self._knots, points)
        fine = np.unique(np.linspace(self._knots[:-1], self._knots[1:], _PER_GAP + 1))
        self.samples: Samples = self._spline(fine)  #: Points along it, dense against its bends, (k, 3), m.
        first, second = self._spline(fine, 1), self._spline(fine, 2)
        speed = np.linalg.norm(first, axis=1)
        self.arc: Samples = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(fine) * (speed[1:] + speed[:-1]))])
        """Length from the root to those, m, (k,)."""
        self.length = float(self.arc[-1])  #: Length of the wire, m.
        self.curvature = float(np.max(np.linalg.norm(np.cross(first, second), axis=1) / speed**3))
        """Largest curvature, 1/m."""
        self.amplitude = float(np.max(np.hypot(self.samples[:, 1], self.samples[:, 2])))
        """Largest distance from the axis, m."""
        self.spread = float(np.sqrt(np.sum(np.var(self.samples[:, 1:], axis=0))))
        """Root mean square distance across from its mean position, m."""
        self.reach = float(np.max(self.samples[:, 0]))  #: Largest axial distance from the root, m.
        self.nearest = float(np.min(self.samples[:, 0]))  #: Smallest axial distance from the root, m.
        tangents = first / speed[:, None]
        across = tangents[:, 1] + 1j * tangents[:, 2]
        winding = float(np.sum(np.angle(across[1:] * np.conj(across[:-1]), deg=False)) / (2.0 * np.pi))
        flat = float(np.sum(np.abs(np.diff(across))) / (2.0 * np.pi * max(np.max(np.abs(across)), 1e-12)))
        self.winding, self.turns = winding, max(abs(winding) if flat > 0.5 * abs(winding) else 0.0, flat, 0.25)

    def shares(self, count: float) -> Samples:
        """At least so many parameters, those between which it is a cubic among them."""
        knots = self._spline.x
        steps = int(np.ceil(count / (len(knots) - 1)))
        return np.append(np.linspace(knots[:-1], knots[1:], steps, endpoint=False).T.ravel(), 1.0)

    def at(self, share: Values) -> tuple[Values, Values]:
        """Points (..., 3), m, and derivatives by the parameter."""
        return self._spline(share), self._spline(share, 1)


@lru_cache(maxsize=64)
def centre_line(points: CurvePoints, tolerance: float) -> CentreLine:
    """The centre line through points, mm, smoothed by a tolerance, m."""
    return CentreLine(1e-3 * np.array(points), tolerance)


def closest_strands(strands: Sequence[Samples], along: Samples, radius: float) -> float:
    """Least distance between points of wires, on one wire half a tightest turn apart, m; infinite: over a diameter."""
    from scipy.spatial import cKDTree

    points = np.concatenate(strands)
    wire, at = np.repeat(np.arange(len(strands)), len(along)), np.tile(along, len(strands))
    pairs = cKDTree(points).query_pairs(2.0 * radius, output_type="ndarray")
    one, other = pairs.T
    apart = (wire[one] != wire[other]) | (np.abs(at[one] - at[other]) > np.pi * radius)
    distances = np.linalg.norm(points[one[apart]] - points[other[apart]], axis=1)
    return float(np.min(distances, initial=np.inf))


def strand_spacing(wavelength: Values, amplitude: Values, starts: int) -> Values:
    """Least distance between neighbouring wires of a tail with several starts, m."""
    # Points a turn t apart on neighbouring wires have d^2 = 2 b^2 (1 - cos t) + p^2 (t - 2 pi/n)^2 with
    # p = lambda/2 pi; its first minimum is found by bisection.
    whole, p2 = 2.0 * np.pi / starts, (np.asarray(wavelength) / (2.0 * np.pi)) ** 2
    b2 = np.asarray(amplitude) ** 2
    low, high = np.zeros(np.broadcast_shapes(p2.shape, b2.shape)), np.full(1, whole)
    for _ in range(50):
        middle = 0.5 * (low + high)
        rising = b2 * np.sin(middle) + p2 * (middle - whole) > 0
        low, high = np.where(rising, low, middle), np.where(rising, middle, high)
    t = 0.5 * (low + high)
    found: Values = np.sqrt(2.0 * b2 * (1.0 - np.cos(t)) + p2 * (t - whole) ** 2)
    return found


def arc_fraction(wavelength: Values, amplitude: Values) -> Values:
    """Alpha = [1 + (2 pi B_o/lambda)^2]^(-1/2): axial over arc length of a plain helix (Section II-B)."""
    return 1.0 / np.sqrt(1.0 + (2.0 * np.pi * amplitude / wavelength) ** 2)


def coil_curvature(wavelength: Values, amplitude: Values) -> Values:
    """Curvature of a plain helix, B_o k^2 alpha^2 with k = 2 pi/lambda, 1/m."""
    return amplitude * (2.0 * np.pi / wavelength) ** 2 * arc_fraction(wavelength, amplitude) ** 2


def amplitude_envelope(xi: Values, amplitude: Values, length: Values, taper: Values) -> tuple[Values, Values]:
    """Local amplitude of eq. (10), r = B_o (1 - exp(-c xi/L_t)), and its slope; c is infinite for a plain helix."""
    with np.errstate(invalid="ignore"):
        decay = np.where(np.isinf(taper), 0.0, np.exp(-taper * xi / length))
        slope = np.where(np.isinf(taper), 0.0, amplitude * taper / length * decay)
    return amplitude * (1.0 - decay), slope


class Centreline(NamedTuple):
    """The wire's centreline in the frame of the body (origin at its mid-length on the motor axis)."""

    position: Vectors  #: Points, m.
    tangent: Vectors  #: Unit tangents, pointing away from the root.
    stretch: Values  #: Arc length per axial length, ds/dxi.


def centreline(
    xi: Values,
    *,
    root: Values,
    wavelength: Values,
    amplitude: Values,
    length: Values,
    taper: Values,
    hand: Values,
    phase: Values,
    form: TailForm = PLAIN,
) -> Centreline:
    """The wire of eq. (10): x = -x_r - xi, y = r cos(h k x + phi), z = r sin(h k x + phi); arguments broadcast."""
    # `root` is x_r = L_b/2 + L_c, `hand` is h = +1 (right) or -1 (left). Where the wavelength varies, k x is an
    # integral from the root; on a centre line through points xi/L_t is its parameter, from 0 to 1.
    if form.curve:
        return _through_points(xi / length, root, length, hand, phase, form)
    wavenumber = 2.0 * np.pi / wavelength
    x = -root - xi
    r, slope = amplitude_envelope(xi, amplitude, length, taper)
    angle = hand * wavenumber * x + phase
    if form.amplitude:
        factor, change = form.amplitude_at(xi / length)
        r, slope = r * factor, slope * factor + r * change / length
    if form.wavelength:
        factor, turned = form.wavenumber_at(xi / length)
        angle = -hand * wavenumber * (root + length * turned) + phase
        wavenumber = wavenumber * factor
    cos, sin = np.cos(angle), np.sin(angle)
    turning = -hand * wavenumber * r  # r d(angle)/dxi
    stretch = np.sqrt(1.0 + slope**2 + turning**2)
    position = np.stack(np.broadcast_arrays(x, r * cos, r * sin), axis=-1)
    direction = np.stack(
        np.broadcast_arrays(-np.ones_like(x), slope * cos - turning * sin, slope * sin + turning * cos), axis=-1
    )
    return Centreline(position, direction / stretch[..., None], stretch)


def _through_points(
    share: Values, root: Values, length: Values, hand: Values, phase: Values, form: TailForm
) -> Centreline:
    """A centre line in the tail's frame, half a turn about y from the body's axes; mirrored for the other hand."""
    point, rate = form.centre.at(share)
    cos, sin, side = np.cos(phase), np.sin(phase), -hand * np.sign(form.centre.winding or 1.0)
    y, z = point[..., 1], side * point[..., 2]
    dy, dz = rate[..., 1], side * rate[..., 2]
    speed = np.linalg.norm(rate, axis=-1)
    position = np.stack(np.broadcast_arrays(-root - point[..., 0], y * cos - z * sin, y * sin + z * cos), axis=-1)
    direction = np.stack(np.broadcast_arrays(-rate[..., 0], dy * cos - dz * sin, dy * sin + dz * cos), axis=-1)
    return Centreline(position, direction / speed[..., None], speed / length)


def coil_spacing(wavelength: Values, amplitude: Values) -> Values:
    """Smallest distance between neighbouring turns of the centreline, m; infinite if turns never come close."""
    # The distance between two points of a helix at an angle t apart is
    # d(t)^2 = 2 b^2 (1 - cos t) + (lambda t/2 pi)^2; its minimum near t = 2 pi solves sin t + (p/b)^2 t = 0
    # with p = lambda/2 pi (Przybyl and Pieranski, Eur. Phys. J. E 4:445, 2001).
    ratio = (wavelength / (2.0 * np.pi * amplitude)) ** 2
    neighbours = ratio * 4.4934 < 0.9761  # sin t = -ratio t has a root beyond the tangent point tan t = t
    t = np.full(np.shape(ratio), 2.0 * np.pi)
    r = np.where(neighbours, ratio, 0.0)
    for _ in range(60):  # monotone from the right where convex; few steps are needed
        step = (np.sin(t) + r * t) / np.maximum(np.cos(t) + r, 1e-3)
        t = np.clip(t - step, 4.4934, 2.0 * np.pi)
        if np.all(np.abs(step) < 1e-9):
            break
    distance = np.sqrt(2.0 * amplitude**2 * (1.0 - np.cos(t)) + (wavelength * t / (2.0 * np.pi)) ** 2)
    return np.where(neighbours, distance, np.inf)
