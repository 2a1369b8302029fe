"""The models by name, and the 6x6 resistance matrix of a robot or one of its parts, or the 12x12 of its two links."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from spirillum.answer_entries import answer_of
from spirillum.arrays import Samples
from spirillum.display import DisplayMixin
from spirillum.errors import InputError, check_choice
from spirillum.fluid.algebra import transfer
from spirillum.fluid.closed.perrin import Perrin
from spirillum.fluid.closed.rft import Rft
from spirillum.fluid.closed.sbt import Sbt
from spirillum.fluid.model import PARTS, ResistanceModel, SwimmerModel
from spirillum.fluid.tube.tube import Tube
from spirillum.fluid.wire.slender import Slender
from spirillum.notes import Note
from spirillum.robot.batch import RobotBatch
from spirillum.robot.fields import field_values
from spirillum.robot.limits import broken
from spirillum.robot.load import load, with_resolution
from spirillum.robot.model_options import Resolution
from spirillum.robot.placement import Placement
from spirillum.robot.robot import Robot
from spirillum.units import KINDS, parse_option

SWIMMER_MODELS: dict[str, SwimmerModel] = {model.name: model for model in (Sbt(), Rft(), Slender(), Tube())}
"""Models that make a robot swim."""
MODELS: dict[str, ResistanceModel] = {**SWIMMER_MODELS, "perrin": Perrin()}  #: Models that give a resistance matrix.


def find_model(name: str) -> ResistanceModel:
    """The model of that name."""
    check_choice("model", str(name), MODELS)
    return MODELS[name]


def find_swimmer_model(name: str, *more: str) -> SwimmerModel:
    """The model of that name that makes a robot swim."""
    check_choice("model", str(name), (*more, *SWIMMER_MODELS))
    return SWIMMER_MODELS[name]


def quickest(model: SwimmerModel, batch: RobotBatch) -> SwimmerModel:
    """Return the fastest variant of a model: `tube` from tables where available, unless a resolution is requested."""
    options = batch.options.tube
    if not isinstance(model, Tube) or options.form == "direct":
        return model
    from spirillum.fluid.tube.library import tabled

    resolved = batch.options.resolution
    if resolved and options.form == "table":
        allowed = "allowed: form 'direct' or 'auto'"
        raise InputError(f"{resolved} with model.tube.form = 'table', which has its own resolution; {allowed}")
    found = None if resolved else tabled(batch)
    if found is None and options.form == "table":
        raise InputError(
            "model.tube.form = 'table': no table of this robot in this tube covers this pose; "
            "allowed: 'direct', or after `spirillum prepare`"
        )
    return found or model


def check_placement(placement: Placement, *models: ResistanceModel) -> None:
    """Refuse a placement in the channel that none of the models uses."""
    if not placement.is_set or any(model.placed for model in models):
        return
    unset = type(placement)()
    given = next(item for item in field_values(placement) if item.value != getattr(unset, item.path))
    names = " or ".join(f"'{model.name}'" for model in models)
    walled = ", ".join(name for name, model in MODELS.items() if model.placed)
    raise InputError(
        f"placement.{given.path} = {given.text} with model {names}, which does not compute the channel's walls; "
        f"allowed: {f'only with model {walled}' if walled else 'no placement'}"
    )


_UNITS = [["N s/m", "N s"], ["N s", "N m s"]]
_BOTH = "both"
_LINKS = ("body", "rotor")  # Order of the two links in a 12x12.


@dataclass(frozen=True, repr=False)
class Resistance(DisplayMixin):
    """F = -B V for one part or both links: force and torque against velocity and rotation, never calibrated."""

    robot: Robot
    model: ResistanceModel
    part: str  #: The part; `both` for body and rotor, each with a motion of its own.
    about: str  #: Reference point: the body's mid-length, or the tail's root; both on the motor axis.
    phase: float
    placement: dict[str, Any]  #: Assumed pose of the robot.
    matrix: Samples
    """B, 6x6, or 12x12 for body and rotor in this order, SI; NaN where the model does not know an entry."""
    warnings: tuple[Note, ...]

    @property
    def references(self) -> tuple[str, ...]:
        """Keys of the references that it rests on."""
        return self.model.references

    def __str__(self) -> str:
        """The matrix in SI below what it is of, for `print`."""
        rows = np.array2string(
            self.matrix, formatter={"float_kind": lambda value: f"{value:11.4g}"}, max_line_width=200
        )
        return f"{super().__str__()}\nmatrix, SI (forces N, torques N m, over m/s and rad/s):\n{rows}"

    def to_dict(self) -> dict[str, Any]:
        """Content of `spirillum resistance --json`."""
        count = len(self.matrix) // 6
        units = [row * count for row in _UNITS] * count
        return answer_of(self, links=_LINKS if self.part == _BOTH else (), units=units)


def _with_accuracy(
    resolution: Resolution | Mapping[str, Any] | None, accuracy: str | None
) -> Resolution | Mapping[str, Any] | None:
    """The resolution of a request that may name its accuracy alone."""
    if accuracy is None:
        return resolution
    if resolution is not None:
        raise InputError("accuracy and resolution are mutually exclusive; allowed: resolution with its own accuracy")
    return {"accuracy": accuracy}


def resistance(
    robot: str | Path | Mapping[str, Any] | Robot,
    *,
    part: str | None = None,
    model: str = "rft",
    about: str = "body",
    phase: str | float = 0.0,
    accuracy: str | None = None,
    resolution: Resolution | Mapping[str, Any] | None = None,
    placement: Placement | Mapping[str, Any] | None = None,
) -> Resistance:
    """Resistance matrix of one part alone in the same fluid, or of body and rotor together.

    Args:
        robot: a preset's name, a robot file, its tables, or a loaded robot.
        part: `body`, `coupling`, `tail`, `rotor` or `robot` (joint locked), alone in the fluid: 6x6; or `both`, body
            and rotor with motions of their own: 12x12. None: the robot, or what the model knows.
        model: `perrin` (body only), `rft`, `slender`, `tube`, or `sbt` (axial entries only).
        about: reference point, `body` (the origin) or `tail-root`.
        phase: phase phi of the tail, with its unit (``"90 deg"``) or a float in rad.
        accuracy: short for `resolution` with this `accuracy` alone: `standard` or `high`.
        resolution: of the models `slender` and `tube`: `accuracy`, `tolerance`; None: the robot's own.
        placement: where in the channel the robot lies, for a model that computes the walls: `gap`, `eccentricity`,
            `pitch`, `tail_drop`, `ends`, `flow`, each a quantity with its unit or a float in SI.

    Raises:
        InputError: for wrong input, or a part that the model cannot do.
    """
    ready, chosen = load(robot), find_model(model)
    ready = with_resolution(ready, _with_accuracy(resolution, accuracy), model)
    if part is None:
        part = "robot" if "robot" in chosen.parts else chosen.parts[0]
    check_choice("part", part, (*PARTS, _BOTH))
    known = (*chosen.parts, _BOTH) if isinstance(chosen, SwimmerModel) else chosen.parts
    if part not in known:
        raise InputError(f"part = {part!r} with model '{model}'; allowed: {', '.join(known)}")
    if part == "body" and not ready.has_body:
        raise InputError("part = 'body': this robot has none (body = 'none'); allowed: tail or robot")
    check_choice("about", about, ("body", "tail-root"))
    angle = parse_option("phase", phase, KINDS["angle"])
    batch = RobotBatch.of(ready, Placement.of(placement))
    check_placement(batch.placement, chosen)
    outside = broken(chosen.part_domain(batch, "robot" if part == _BOTH else part))
    if outside:
        raise InputError(f"{ready.name} with model '{model}': {outside[0].sentence()}")
    phases = np.array([angle])
    if part == _BOTH and isinstance(chosen, SwimmerModel):
        matrix = chosen.resistance(batch, phases)[0]
    else:
        matrix = chosen.part_matrix(batch, part, phases)[0]
    if about == "tail-root" and not chosen.axial_only:
        # A shift along the axis leaves axial entries as they are, and the others of an axial model stay unknown.
        root = np.array([-float(batch.root[0]), 0.0, 0.0])
        moved = np.kron(np.eye(len(matrix) // 6), transfer(-root))
        matrix = moved.T @ matrix @ moved
    place = chosen.placement_of(batch)
    return Resistance(ready, chosen, part, about, angle, place, matrix, _warnings(ready, chosen, batch, part))


def _warnings(robot: Robot, model: ResistanceModel, batch: RobotBatch, part: str) -> tuple[Note, ...]:
    found = list(robot.warnings)
    if part not in ("body", "coupling"):
        found += [limit.caution() for limit in broken(model.cautions(batch))]
    if robot.channel is not None and not (isinstance(model, SwimmerModel) and model.placed):
        found.append(Note.named("resistance-without-walls", model=model.name))
    if model.axial_only:
        found.append(Note.named("axial-entries", model=model.name))
    if part in ("rotor", "robot", _BOTH) and robot.coupling.length > 0 and "coupling" not in model.parts:
        found.append(Note.named("no-coupling", model=model.name))
    return tuple(found)
