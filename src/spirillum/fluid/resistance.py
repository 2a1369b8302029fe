"""The 6x6 resistance matrix of a robot or one of its parts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from spirillum.answer import envelope, quantity
from spirillum.arrays import Samples
from spirillum.errors import InputError, did_you_mean
from spirillum.fluid.algebra import about_point
from spirillum.fluid.model import PARTS, ResistanceModel
from spirillum.fluid.registry import check_placement, find_model
from spirillum.robot.batch import RobotBatch
from spirillum.robot.limits import broken
from spirillum.robot.load import load, with_resolution
from spirillum.robot.options import Resolution
from spirillum.robot.placement import Placement
from spirillum.robot.robot import Robot
from spirillum.units import KINDS, parse_option

__all__ = ["Resistance", "resistance"]

_UNITS = [["N s/m", "N s"], ["N s", "N m s"]]


@dataclass(frozen=True)
class Resistance:
    """F = -B V for one part: force and torque against velocity and rotation, never calibrated."""

    robot: Robot
    """The robot."""
    model: ResistanceModel
    """The hydrodynamic model."""
    part: str
    """The part."""
    about: str
    """Reference point: the body's mid-length, or the tail's root; both on the motor axis."""
    phase: float
    """Phase of the tail, rad."""
    placement: dict[str, Any]
    """Where the model places the robot."""
    matrix: Samples
    """B, 6x6, SI; NaN where the model does not know an entry."""
    warnings: tuple[str, ...]
    """What to be careful about, a sentence each."""

    @property
    def references(self) -> tuple[str, ...]:
        """Keys of the references that it rests on."""
        return self.model.references

    def to_dict(self) -> dict[str, Any]:
        """The answer of `spirillum resistance --json`."""
        content = {
            "robot": self.robot.name,
            "model": self.model.name,
            "part": self.part,
            "about": self.about,
            "phase": quantity(self.phase, "rad"),
            "placement": self.placement,
            "matrix": {**quantity(self.matrix, ""), "unit": _UNITS},
            "references": list(self.references),
        }
        return envelope("resistance", content, self.warnings)


def resistance(
    robot: str | Path | Mapping[str, Any] | Robot,
    *,
    part: str | None = None,
    model: str = "rft",
    about: str = "body",
    phase: str | float = 0.0,
    resolution: Resolution | Mapping[str, Any] | None = None,
    placement: Placement | Mapping[str, Any] | None = None,
) -> Resistance:
    """Resistance matrix of one part alone in the same fluid.

    Args:
        robot: a preset's name, a robot file, its tables, or a loaded robot.
        part: `body`, `coupling`, `tail`, `rotor` or `robot` (joint locked); None: the robot, or what the model knows.
        model: `perrin` (body only), `rft`, `slender`, `tube`, or `sbt` (axial entries only).
        about: reference point, `body` (the origin) or `tail-root`.
        phase: phase phi of the tail, with its unit (``"90 deg"``) or a float in rad.
        resolution: of the models `slender` and `tube`: `accuracy`, `tolerance`; None: the robot's own.
        placement: where in the channel the robot lies, for a model that computes the walls: `gap`, `eccentricity`,
            `pitch`, `tail_drop`, `ends`, `flow`, each a quantity with its unit or a float in SI.

    Raises:
        InputError: for wrong input, or a part that the model cannot do.
    """
    ready, chosen = load(robot), find_model(model)
    ready = with_resolution(ready, resolution, model)
    if part is None:
        part = "robot" if "robot" in chosen.parts else chosen.parts[0]
    if part not in PARTS:
        raise InputError(f"part = {part!r}{did_you_mean(str(part), PARTS)}; allowed: {', '.join(PARTS)}")
    if part not in chosen.parts:
        raise InputError(f"part = {part!r} with model '{model}'; allowed: {', '.join(chosen.parts)}")
    if about not in ("body", "tail-root"):
        raise InputError(f"about = {about!r}; allowed: body, tail-root")
    angle = parse_option("phase", phase, KINDS["angle"])
    batch = RobotBatch.of(ready, Placement.of(placement))
    check_placement(batch.placement, chosen)
    outside = broken(chosen.part_domain(batch, part))
    if outside:
        raise InputError(f"{ready.name} with model '{model}': {outside[0].sentence()}")
    matrix = chosen.part_matrix(batch, part, np.array([angle]))
    if about == "tail-root":
        # A shift along the axis leaves axial entries as they are, and the others of an axial model stay unknown.
        root = np.array([[-float(batch.root[0]), 0.0, 0.0]])
        matrix = matrix if chosen.axial_only else about_point(matrix, root)
    place = chosen.placement_of(batch)
    return Resistance(ready, chosen, part, about, angle, place, matrix[0], _warnings(ready, chosen, batch, part))


def _warnings(robot: Robot, model: ResistanceModel, batch: RobotBatch, part: str) -> tuple[str, ...]:
    found = list(robot.warnings)
    if part not in ("body", "coupling"):
        found += [limit.sentence() for limit in broken(model.cautions(batch))]
    if model.axial_only:
        found.append(
            f"model '{model.name}' gives the entries along and about the motor axis only; the others are unknown"
        )
    if part in ("rotor", "robot") and robot.coupling.length > 0 and "coupling" not in model.parts:
        found.append(f"model '{model.name}' leaves the coupling out")
    return tuple(found)
