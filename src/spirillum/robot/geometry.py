"""Body, coupling, tail, channel and fluid of a robot file (Table I), and closed forms of their geometry."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Annotated, Any, Literal, NamedTuple, get_args

import numpy as np
from pydantic import BeforeValidator, ConfigDict, Field, WithJsonSchema, model_validator

from spirillum.arrays import Values, Vectors
from spirillum.robot.fields import (
    NONE,
    UNSET,
    AlsoReads,
    Angle,
    Density,
    Length,
    LengthOrZero,
    Mass,
    Pressure,
    Section,
    SignedLength,
    Viscosity,
)
from spirillum.robot.shape_input import read_along, read_profile, read_tail
from spirillum.robot.tail_form import PLAIN, Along, CurvePoints, TailForm


def _read_taper(value: Any) -> float | None:
    if value == "none" or value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0.1 <= value <= 1e4:
        raise ValueError("a number from 0.1 to 10000, or 'none' for a plain helix")
    return float(value)


def _table_or_none(name: str) -> BeforeValidator:
    def read(value: Any) -> Any:
        if value == "none":
            return None
        if not isinstance(value, (dict, Section)):
            raise ValueError(f"'none', or a [{name}] table")  # noqa: TRY004 - pydantic collects ValueError only
        return value

    return BeforeValidator(read)


def _read_stripes(value: Any) -> Any:
    alike = isinstance(value, (list, tuple)) and len(value) > 0 and all(item == value[0] for item in value)
    if not isinstance(value, (list, tuple)) or alike or len(value) > _MOST_STRIPES:
        raise ValueError(f"a list of 2 to {_MOST_STRIPES} names of colours that are not all the same, or an empty one")
    return tuple(value)


_MOST_STRIPES = 48

Taper = Annotated[
    float | None,
    BeforeValidator(_read_taper),
    WithJsonSchema({"anyOf": [{"type": "number", "minimum": 0.1, "maximum": 1e4}, {"const": "none"}]}),
]


ProfilePoints = tuple[tuple[float, float], ...]  #: Points (x, r) along a body's outline, mm.


Shape = Literal["capsule", "sphere", "spheroid", "cylinder", "profile", "none"]
End = Literal["hemisphere", "flat", "fillet"]

EndOrNone = Annotated[End | None, UNSET, WithJsonSchema({"enum": ["hemisphere", "flat", "fillet", "none"]})]

_DEFAULT_END: dict[str, End] = {"capsule": "hemisphere", "cylinder": "flat"}


class CenterOfMass(Section):
    """Where the mass of the body is centred, without coupling and tail: a battery is seldom in the middle."""

    x: SignedLength | None = None
    """Place along the motor axis from the body's mid-length, positive towards the nose; unset: of uniform density."""
    radial: LengthOrZero = 0.0  #: Distance from the motor axis; the body then rights itself.
    angle: Angle = 0.0  #: Its angle about +x from the lowest place (-z of the body), as an azimuth.


CenterOfMassOrNone = Annotated[CenterOfMass | None, UNSET, NONE]

_NUMBERS = {"type": "array", "items": {"type": "array", "items": {"type": "number"}}}
ProfileOrNone = Annotated[
    ProfilePoints | None, UNSET, WithJsonSchema({"anyOf": [_NUMBERS, {"type": "string"}, {"type": "null"}]})
]


class Body(Section):
    """The robot's body, a solid of revolution about the motor axis."""

    shape: Shape = "capsule"
    """Outline of the body; `profile` is that of `body.profile`, `none`, as `body = "none"`, a bare tail."""
    diameter: Length  #: Largest diameter D_b (Table I).
    length: Length  #: Overall length L_b along the motor axis, ends included (Table I).
    front: EndOrNone = None
    """Front end of a capsule (default `hemisphere`) or cylinder (default `flat`); `none` is as if left out."""
    rear: EndOrNone = None
    """Rear end of a capsule (default `hemisphere`) or cylinder (default `flat`); `none` is as if left out."""
    fillet: Length | None = None  #: Edge radius of an end that is a `fillet`.
    mass: Mass | None = None  #: Mass of body and coupling together (Table I), measured.
    center_of_mass: CenterOfMassOrNone = None
    """Centre of mass of the body alone, or `none` (here None) for a body of uniform density."""
    profile: ProfileOrNone = None
    """Outline from pole to pole: a CSV file beside this one, or points (x, r) in mm; it gives diameter and length."""

    @model_validator(mode="before")
    @classmethod
    def _read(cls, raw: Any) -> Any:
        if not isinstance(raw, Mapping) or raw.get("profile") in (None, "none"):
            return raw
        return read_profile(dict(raw))

    @property
    def points(self) -> ProfilePoints:
        """Points of its profile, also of a table that JSON has made lists of; empty for another shape."""
        return tuple((x, r) for x, r in self.profile or ())

    @property
    def front_end(self) -> End | None:
        """Front end in force; None for a sphere or spheroid, which have no ends of their own."""
        return self.front or _DEFAULT_END.get(self.shape)

    @property
    def rear_end(self) -> End | None:
        """Rear end in force; None for a sphere or spheroid, which have no ends of their own."""
        return self.rear or _DEFAULT_END.get(self.shape)

    def rounding(self, end: End | None) -> float:
        """Radius of the rounding of an end of this body, m: 0 where it is flat."""
        return {"hemisphere": 0.5 * self.diameter, "fillet": self.fillet or 0.0}.get(end or "", 0.0)


def _read_body(value: Any) -> Any:
    none = value == "none" or (isinstance(value, Mapping) and value.get("shape") == "none")
    if not none:
        if not isinstance(value, (Mapping, Body)):
            raise ValueError("'none', or a [body] table")
        return value
    given = [] if value == "none" else [name for name, item in value.items() if name != "shape" and _is_size(item)]
    if given:
        raise ValueError(f"'none' without body.{given[0]}")
    return Body.model_construct(shape="none", diameter=0.0, length=0.0)


def _is_size(value: Any) -> bool:
    return value is not None and not (isinstance(value, str) and re.match(r"[+-]?0(\.0*)?\s", value))


BodyOrNone = Annotated[Body, BeforeValidator(_read_body), NONE]

StripeColour = Literal["red", "yellow", "green", "blue", "white", "black", "orange", "magenta", "cyan"]

Stripes = Annotated[
    tuple[StripeColour, ...],
    BeforeValidator(_read_stripes),
    WithJsonSchema({"type": "array", "items": {"enum": list(get_args(StripeColour))}, "maxItems": _MOST_STRIPES}),
]


class Seal(Section):
    """The rear part of the body's surface and its stripes, by which a camera sees the body turn; for pictures only."""

    length: Length  #: Axial length from the body's rear.
    stripes: Stripes = ()
    """Colours of equally wide stripes around; the first is centred on +z, the next follow from there towards -y."""


SealOrNone = Annotated[Seal | None, _table_or_none("seal"), NONE]


class Coupling(Section):
    """The mechanical coupling between motor and tail; it turns with the tail."""

    diameter: LengthOrZero = 0.0  #: Diameter D_c (Table I); 0 for a bare gap between body and tail.
    length: LengthOrZero = 0.0
    """Axial distance L_c from the body's rear to the tail's root (Table I); 0 for no coupling."""
    clearance: LengthOrZero = 0.0005
    """Axial clearance on both sides; its solid is `length - 2 clearance` long. Assumed: the paper does not say."""


CouplingOrNone = Annotated[Coupling, BeforeValidator(lambda value: {} if value == "none" else value), NONE]

_SIZE = {
    "anyOf": [
        {"type": "object", "properties": {"from": {"type": "string"}, "to": {"type": "string"}}},
        {"type": "array"},
    ]
}
_VARYING = AlsoReads(lambda _: _SIZE)  # A length from the root to the tip, or points (distance from the root, value)

AlongOrNone = Annotated[
    Along | None, BeforeValidator(read_along), WithJsonSchema({"anyOf": [_NUMBERS, {"const": "none"}]})
]
CurveOrNone = Annotated[CurvePoints | None, WithJsonSchema({"anyOf": [_NUMBERS, {"type": "string"}, {"type": "null"}]})]


def _with_curve(schema: dict[str, Any]) -> None:
    """A tail needs its sizes, or a centre line from which they follow."""
    needed = schema.pop("required")
    derived = ("wavelength", "amplitude", "length")
    schema["required"] = [name for name in needed if name not in derived]
    schema |= {"if": {"required": ["curve"]}, "else": {"required": list(derived)}}


class Tail(Section):
    """The rigid tail: wires along eq. (10), or along a centre line through points."""

    model_config = ConfigDict(json_schema_extra=_with_curve)

    starts: Annotated[int, Field(strict=True, ge=1, le=12)] = 1
    """Number of identical wires, evenly spaced around the axis."""
    wavelength: Annotated[Length, _VARYING]
    """Wavelength lambda of the helix; `{ from = "20 mm", to = "30 mm" }` or a list of points where it varies."""
    amplitude: Annotated[Length, _VARYING]
    """Amplitude B_o: radius of the helix's centreline; `{ from = "1 mm", to = "3 mm" }` or points."""
    length: Length  #: Axial length L_t (Table I; the wire itself is longer).
    wire_diameter: Length  #: Wire diameter D_t (Table I).
    handedness: Literal["right", "left"] = "right"  #: Hand of the helix.
    taper: Taper = 100.0
    """Shape constant c of the amplitude's rise from the root in eq. (10); `none` (here None) for a plain helix."""
    density: Density | None = None  #: Density of the wire.
    amplitude_along: AlongOrNone = None
    """Local over largest amplitude at shares of the length, written by an amplitude that varies."""
    wavelength_along: AlongOrNone = None
    """Local over mean wavelength at shares of the length, written by a wavelength that varies."""
    curve: CurveOrNone = None
    """A centre line in place of the helix: a CSV file beside this one, or points (x, y, z) in mm from the root on."""
    curve_tolerance: LengthOrZero | None = None
    """Root mean square distance by which smoothing may move the curve's points; unset: it passes through them."""

    @model_validator(mode="before")
    @classmethod
    def _read(cls, raw: Any) -> Any:
        return read_tail(raw)

    @property
    def form(self) -> TailForm:
        """Form of the tail beyond its sizes."""
        points = self.amplitude_along or (), self.wavelength_along or (), self.curve or ()
        return TailForm.read((self.starts, *points, self.curve_tolerance or 0.0))


class Channel(Section):
    """A straight circular tube."""

    diameter: Length  #: Inner diameter D_ch (Table I).
    length: Length | None = None  #: Length L_ch (Table I).


ChannelOrNone = Annotated[Channel | None, _table_or_none("channel"), NONE]


PressureOrNone = Annotated[Pressure | None, UNSET, NONE]


class Fluid(Section):
    """A Newtonian liquid."""

    viscosity: Viscosity  #: Dynamic viscosity mu (Table I).
    density: Density  #: Density rho (Table I).
    cavitation_pressure: PressureOrNone = 1e5
    """How far the pressure of a lubrication film may fall below its surroundings before the liquid cavitates, or `none`
    for films without a bound. Assumed: one atmosphere; a liquid with dissolved air may cavitate at a tenth of it."""


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


def _end_height(end: End | None, radius: Values, fillet: Values) -> Values:
    if end == "hemisphere":
        return radius
    return fillet if end == "fillet" else 0.0 * radius


def _end_volume(end: End | None, radius: Values, fillet: Values) -> Values:
    if end == "hemisphere":
        return 2.0 / 3.0 * np.pi * radius**3
    if end == "fillet":
        core = radius - fillet
        return np.pi * (core**2 * fillet + 0.5 * np.pi * core * fillet**2 + 2.0 / 3.0 * fillet**3)
    return 0.0 * radius


def shortest_body(diameter: Values, fillet: Values, front: End | None, rear: End | None) -> Values:
    """Sum of the heights of both ends: no capsule or cylinder can be shorter, m."""
    radius = 0.5 * diameter
    return _end_height(front, radius, fillet) + _end_height(rear, radius, fillet)


def body_volume(
    shape: Shape, diameter: Values, length: Values, fillet: Values, front: End | None, rear: End | None
) -> Values:
    """Volume of the body, m^3."""
    radius = 0.5 * diameter
    if shape == "none":
        return 0.0 * radius
    if shape in ("sphere", "spheroid"):
        return 4.0 / 3.0 * np.pi * radius**2 * (0.5 * length)
    straight = length - shortest_body(diameter, fillet, front, rear)
    return np.pi * radius**2 * straight + _end_volume(front, radius, fillet) + _end_volume(rear, radius, fillet)
