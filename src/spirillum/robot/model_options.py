"""Options of the models, and the calibration factors of the paper's Table III."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field, WithJsonSchema

from spirillum.robot.arguments import Options, in_range, one_of, whole
from spirillum.robot.fields import AlsoReads, Factor, Length, Section, Text

_TRUE_AS_WORD = BeforeValidator(lambda value: "true" if value is True else value)  # TOML reads a bare `true` as True
_TRUE = AlsoReads(lambda _: {"const": True})


def _read_switch(value: Any) -> bool:
    if value in ("on", "off") or isinstance(value, bool):
        return value in ("on", True)
    raise ValueError("'on' or 'off' (true or false)")


Switch = Annotated[
    bool,
    BeforeValidator(_read_switch),
    WithJsonSchema({"anyOf": [{"type": "boolean"}, {"enum": ["on", "off"]}], "default": False}),
]
"""Something that is on or off."""


class PerrinOptions(Section):
    """Options of Perrin's body formulas."""

    spheroid: Literal["inscribed", "equal-volume"] = "inscribed"
    """Spheroid that stands for a capsule or cylinder: inscribed, or stretched across to the same volume."""


class RftOptions(Section):
    """Options of resistive force theory, eqs (8)-(16)."""

    coefficients: Literal["printed", "gray-hancock", "lighthill", "brennen-winet"] = "printed"
    """Local resistance coefficients; `brennen-winet` are those near a plane floor."""
    axis_height: Length | None = None
    """For `brennen-winet`: height of the tail's axis above the floor; unset: the body's radius (lying on it)."""
    arc_element: Annotated[Literal["printed", "true"], _TRUE_AS_WORD, _TRUE] = "printed"
    """Arc element in (12): printed `(l/L_t) dx`, or the true `ds` on the tapered root."""
    row4: Literal["kept", "zeroed"] = "kept"
    """Row 4 of the tail's matrix in (15): kept (correct), or zeroed as printed, for comparison."""
    spin: Switch = False  #: Add the torque of the wire's own spin, `4 pi mu a^2` per arc length along the tangent.
    normal_factor: Factor = 1.0  #: Fitted factor on the coefficient across the wire, c_n.
    tangential_factor: Factor = 1.0  #: Fitted factor on the coefficient along the wire, c_t.


class SbtOptions(Section):
    """Options of Lighthill's slender-body theory, eqs (1)-(7)."""

    eps_constant: Literal["printed", "exact"] = "printed"
    """Constant of eps: the printed 2.6, or the exact `pi sqrt(e)/2` = 2.58981."""
    spin: Switch = False  #: Add the torque of the wire's own spin, `4 pi mu a^2` per arc length along the tangent.


Accuracy = Literal["standard", "high"]
Tolerance = Annotated[float, Field(strict=True, ge=1e-4, le=0.05, allow_inf_nan=False)]
Phases = Annotated[int, Field(strict=True, ge=1, le=64)]


class SlenderOptions(Section):
    """Options of the resolved tail and body."""

    accuracy: Accuracy = "standard"  #: Form of the wire and resolution of the surfaces.


TubeForm = Literal["auto", "table", "direct"]
"""How `tube` answers: from the robot's table, by solving for the flow, or from the table where there is one."""


class TubeOptions(Section):
    """Options of the robot in its tube; its wires are `high` unless they are long, or `SlenderOptions` asks for it."""

    form: TubeForm = "auto"
    """`table` (see `spirillum prepare`; none is made), `direct` (the flow is solved for), or `auto`: the table where
    there is one; runs make it."""

    tolerance: Tolerance = 0.005  #: Relative tolerance of the speed per turn, from which the resolution follows.
    phases: Phases = 3  #: Number of phases of the tail, evenly over a turn, that an answer is averaged over.


class ModelOptions(Section):
    """Options of the hydrodynamic models."""

    perrin: PerrinOptions = PerrinOptions()  #: Body formulas.
    rft: RftOptions = RftOptions()  #: Resistive force theory.
    sbt: SbtOptions = SbtOptions()  #: Slender-body theory.
    slender: SlenderOptions = SlenderOptions()  #: Resolved tail and body.
    tube: TubeOptions = TubeOptions()  #: Resolved tail and body in their tube.
    beyond_stokes: Switch = False
    """Also answer at Reynolds numbers above 10, where inertia dominates and these models are wrong."""

    @property
    def resolution(self) -> str:
        """The first option that requests a resolution of `tube` which no table has, with its value; empty for none."""
        usual = ModelOptions()
        for section, name in (("slender", "accuracy"), ("tube", "tolerance"), ("tube", "phases")):
            value = getattr(getattr(self, section), name)
            if value != getattr(getattr(usual, section), name):
                return f"model.{section}.{name} = {value!r}"
        return ""


class Resolution(Options, argument="resolution"):
    """Numerical resolution of the models `slender` and `tube`; None keeps the robot's own option."""

    accuracy: Annotated[Accuracy, BeforeValidator(one_of("standard", "high"))] | None = None
    """Of `slender` and `tube`: form of the wire and resolution of the surfaces, `standard` or `high`."""
    tolerance: Annotated[float, BeforeValidator(in_range(1e-4, 0.05))] | None = None
    """Of `tube`: relative tolerance of the speed per turn, 0.0001 to 0.05."""
    phases: Annotated[int, BeforeValidator(whole(1, 64))] | None = None
    """Of `tube`: number of phases of the tail to average over, 1 to 64."""
    form: Annotated[TubeForm, BeforeValidator(one_of("auto", "table", "direct"))] | None = None
    """Of `tube`: from the robot's `table` (none is made), `direct`, or `auto`: the table where there is one; runs make
    it."""


class FittedTo(Section):
    """The geometry that a calibration was fitted to; used outside it, the answer warns."""

    channel_diameter: Length  #: Channel diameter.
    body_diameter: Length  #: Body diameter.
    body_length: Length  #: Body length.


class Calibration(Section):
    """Factors on the isolated body's Perrin drag for one model (Table III)."""

    body_drag: Factor = 1.0  #: Factor on the axial translational drag D_x.
    body_rotation: Factor = 1.0  #: Factor on the axial rotational drag E_x.
    source: Text = Field(min_length=1, max_length=500)  #: Where the factors come from.
    fitted_to: FittedTo  #: Geometry that they were fitted to.


CALIBRATED = ("sbt", "rft", "slender")  #: Models whose drag of the body a calibration may multiply.


def known_model(name: str) -> str:
    """The name of a model that takes factors."""
    if name not in CALIBRATED:
        raise ValueError(f"a model that swims: {', '.join(CALIBRATED)}")
    return name


Calibrations = dict[Annotated[str, AfterValidator(known_model)], Calibration]  #: Calibration factors by model.
