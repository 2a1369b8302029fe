"""What is built: body, coupling, tail; and where it swims: channel, fluid (the paper's Table I)."""

from __future__ import annotations

from typing import Annotated, Any, Literal, get_args

from pydantic import BeforeValidator, WithJsonSchema

from spirillum.robot.fields import NONE, Density, Length, LengthOrZero, Mass, Section, Viscosity


def _read_taper(value: Any) -> float | None:
    if value == "none" or value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0.1 <= value <= 1e4:
        raise ValueError("a number from 0.1 to 10000, or 'none' for a plain helix")
    return float(value)


def _read_channel(value: Any) -> Any:
    if value == "none":
        return None
    if not isinstance(value, (dict, Channel)):
        raise ValueError("'none', or a [channel] table")  # noqa: TRY004 - pydantic collects ValueError only
    return value


def _read_seal(value: Any) -> Any:
    if value == "none":
        return None
    if not isinstance(value, (dict, Seal)):
        raise ValueError("'none', or a [seal] table")  # noqa: TRY004 - pydantic collects ValueError only
    return value


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


def _read_end(value: Any) -> Any:
    return None if value == "none" else value


Shape = Literal["capsule", "sphere", "spheroid", "cylinder"]
End = Literal["hemisphere", "flat", "fillet"]

EndOrNone = Annotated[
    End | None,
    BeforeValidator(_read_end),
    WithJsonSchema({"enum": ["hemisphere", "flat", "fillet", "none"]}),
]

_DEFAULT_END: dict[str, End] = {"capsule": "hemisphere", "cylinder": "flat"}


class Body(Section):
    """The robot's body, a solid of revolution about the motor axis."""

    shape: Shape = "capsule"
    """Outline of the body."""
    diameter: Length
    """Largest diameter D_b (Table I)."""
    length: Length
    """Overall length L_b along the motor axis, ends included (Table I)."""
    front: EndOrNone = None
    """Front end of a capsule (default `hemisphere`) or cylinder (default `flat`); `none` is as if left out."""
    rear: EndOrNone = None
    """Rear end of a capsule (default `hemisphere`) or cylinder (default `flat`); `none` is as if left out."""
    fillet: Length | None = None
    """Edge radius of an end that is a `fillet`."""
    mass: Mass | None = None
    """Mass of body and coupling together (Table I), measured."""

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


StripeColour = Literal["red", "yellow", "green", "blue", "white", "black", "orange", "magenta", "cyan"]

Stripes = Annotated[
    tuple[StripeColour, ...],
    BeforeValidator(_read_stripes),
    WithJsonSchema({"type": "array", "items": {"enum": list(get_args(StripeColour))}, "maxItems": _MOST_STRIPES}),
]


class Seal(Section):
    """The rear part of the body's surface and its stripes, by which a camera sees the body turn; for pictures only."""

    length: Length
    """Axial length from the body's rear."""
    stripes: Stripes = ()
    """Colours of equally wide stripes around; the first is centred on +z, the next follow from there towards -y."""


SealOrNone = Annotated[Seal | None, BeforeValidator(_read_seal), NONE]


class Coupling(Section):
    """The mechanical coupling between motor and tail; it turns with the tail."""

    diameter: LengthOrZero = 0.0
    """Diameter D_c (Table I); 0 for a bare gap between body and tail."""
    length: LengthOrZero = 0.0
    """Axial distance L_c from the body's rear to the tail's root (Table I); 0 for no coupling."""
    clearance: LengthOrZero = 0.0005
    """Axial clearance on both sides; its solid is `length - 2 clearance` long. Assumed: the paper does not say."""


class Tail(Section):
    """The rigid helical tail, a wire along eq. (10)."""

    wavelength: Length
    """Wavelength lambda of the helix."""
    amplitude: Length
    """Amplitude B_o: radius of the helix's centreline."""
    length: Length
    """Axial length L_t (Table I; the wire itself is longer)."""
    wire_diameter: Length
    """Wire diameter D_t (Table I)."""
    handedness: Literal["right", "left"] = "right"
    """Hand of the helix."""
    taper: Taper = 100.0
    """Shape constant c of the amplitude's rise from the root in eq. (10); `none` (here None) for a plain helix."""
    density: Density | None = None
    """Density of the wire."""


class Channel(Section):
    """A straight circular tube."""

    diameter: Length
    """Inner diameter D_ch (Table I)."""
    length: Length | None = None
    """Length L_ch (Table I)."""


ChannelOrNone = Annotated[Channel | None, BeforeValidator(_read_channel), NONE]


class Fluid(Section):
    """A Newtonian liquid."""

    viscosity: Viscosity
    """Dynamic viscosity mu (Table I)."""
    density: Density
    """Density rho (Table I)."""
