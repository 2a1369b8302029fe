"""Body, coupling, tail, channel and fluid of a robot file (Table I), and closed forms of their geometry."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Annotated, Any, Literal, get_args

import numpy as np
from pydantic import BeforeValidator, ConfigDict, Field, WithJsonSchema, model_validator

from spirillum.arrays import Values
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
from spirillum.robot.tail_form import Along, CurvePoints, TailForm


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
