"""The fit of a calibration: values and draws of its file, how they act on a robot, what they replace, and notes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from spirillum.errors import InputError
from spirillum.fitted.calibration_file import (
    CalibrationFile,
    FittedContact,
    FittedFriction,
    FittedValues,
    calibrated_robot,
    friction_of_tails,
    placement_in,
    read_calibration,
)
from spirillum.fitted.posterior_file import PosteriorFile, read_posterior
from spirillum.fluid.model import SwimmerModel
from spirillum.notes import Note
from spirillum.robot.placement import Placement
from spirillum.robot.robot import Robot
from spirillum.units import show

_COEFFICIENTS = ("normal_factor", "tangential_factor")  # fitted fields that act on `rft` alone

FITTED_HELD = Note.named("posterior-of-held")  #: Caution of a free motion in the tube with a posterior.
FITTED_TRIAL = Note.named("posterior-of-trials")  #: Caution of a held answer with a posterior of trials.


@dataclass(frozen=True)
class Fit:
    """A calibration file or a posterior, read once; without either, a fit of nothing."""

    friction: tuple[FittedFriction, ...] = ()  #: B_eff, tail by tail.
    reading: str = ""  #: Friction model with which it was inferred.
    synthetic: str = ""  #: Name of the observations, if they are synthetic.
    model: str = ""  #: Model whose torque B_eff was inferred with.
    posterior: PosteriorFile | None = None
    file: CalibrationFile | None = None
    name: str = ""  #: Name of the file, with the observations of a posterior.
    channels: tuple[float, ...] = ()  #: Diameters of the channels in which it was fitted, m; none if not stated.
    friction_coefficient: float | None = None  #: Coefficient of dry friction that was fitted; None: none was.

    @property
    def models(self) -> tuple[str, ...]:
        """Models that were fitted; none where the file names none."""
        if self.file is None or self.model:
            return (self.model,) if self.model else ()
        return tuple(self.file.calibration)

    @property
    def of_trials(self) -> bool:
        """Whether it was fitted to trials of released robots."""
        return self.fitted_motion == "trial"

    @property
    def fitted_motion(self) -> str:
        """The motion that was fitted, `held` or `trial`; empty where the file does not state it."""
        source = self.posterior or (None if self.file is None else self.file.provenance)
        return "" if source is None else source.answer

    def central(self, robot: Robot) -> Robot:
        """Return the robot with the fitted values, of a posterior its median, in place of its own."""
        if self.posterior is not None:
            return self.posterior.central(robot)
        return robot if self.file is None else calibrated_robot(robot, self.file)

    def contact(self, draw: int | None = None) -> FittedContact:
        """Return the fitted roughness and dry friction, of a draw or of the posterior median."""
        if self.posterior is not None:
            return self.posterior.contact(draw)
        return FittedContact() if self.file is None else self.file.contact

    def placed(self, robot: Robot, placement: Placement, draw: int | None = None) -> Placement:
        """Return a placement whose open fields are those of a posterior's draw, or of its median."""
        return placement if self.posterior is None else self.posterior.placed(robot, placement, draw)

    def calibrated_placement(self, robot: Robot) -> Placement | None:
        """Return the placement of a calibration file for the robot's channel; None where it has none."""
        return None if self.file is None else placement_in(self.file, robot)

    def dry_friction(self, model: SwimmerModel) -> float | None:
        """Coefficient of dry friction under a robot with a model: only one that computes the walls has any."""
        return self.friction_coefficient if model.placed else None

    def serves(self, robot: Robot, model: SwimmerModel, *, friction: bool = True) -> bool:
        """Whether anything of it acts on a robot's answer with a model."""
        if self.file is None or model.name in self.file.calibration:
            return True
        left_out = (*(() if model.name == "rft" else _COEFFICIENTS), *(() if friction else ("friction",)))
        values = [getattr(self.file.fitted, name) for name in FittedValues.model_fields if name not in left_out]
        placed = model.placed and (placement_in(self.file, robot) is not None or self.file.contact != FittedContact())
        known = any(value is not None for value in values)
        return placed or known or (friction and friction_of_tails(robot, self.friction) != (None, ()))

    def source_of(self, robot: Robot, model: SwimmerModel, *, friction: bool = True) -> str:
        """Name of the file whose values act on a robot's answer with a model; empty where none does."""
        return self._file_name if self.serves(robot, model, friction=friction) else ""

    def unused_model_warnings(
        self, robots: Sequence[Robot], models: Sequence[SwimmerModel], *, friction: bool = True
    ) -> list[Note]:
        """Models to which nothing of a calibration file applies."""
        replaced = self.file is not None and self.file.calibration
        instead = "it is answered without factors" if replaced else "the robot's own numbers are used"
        idle = [model for model in models if not any(self.serves(robot, model, friction=friction) for robot in robots)]
        return [
            Note.named(
                "fit-serves-nobody",
                fit=self.name or "the calibration",
                whom=self._not_for(robots, model),
                instead=instead,
            )
            for model in idle
        ]

    def _is_fitted_in(self, robots: Sequence[Robot]) -> bool:
        """Whether one of the channels in which it was fitted is that of some robot; so where it states none."""
        own = [robot.channel.diameter for robot in robots if robot.channel is not None]
        inside = any(np.isclose(diameter, self.channels, rtol=1e-6, atol=0.0).any() for diameter in own)
        return inside or not self.channels

    def _not_for(self, robots: Sequence[Robot], model: SwimmerModel) -> str:
        """Whom nothing of it is for: robots in another channel than the fitted ones, or the model."""
        factors = self.file is not None and self.file.calibration
        if model.name != self.model or self._is_fitted_in(robots) or factors:
            return f"model '{model.name}'"
        which = "this robot" if len(robots) == 1 else "these robots"
        return f"the channel of {which} (it was fitted in {self._fitted_channels})"

    @property
    def _fitted_channels(self) -> str:
        return " and ".join(show(diameter, "mm") for diameter in self.channels)

    def outside_warnings(self, robot: Robot, model: SwimmerModel, *, friction: bool = True) -> list[Note]:
        """Whether draws of a posterior leave a robot's answer as it is without them."""
        if self.posterior is None or self.posterior.acts_on(robot, walls=model.placed, friction=friction):
            return []
        whom = self._not_for([robot], model)
        return [Note.named("posterior-serves-nobody", fit=self.name, whom=whom)]

    def acting_on(self, robot: Robot, model: SwimmerModel) -> tuple[Fit, list[Note]]:
        """Return the fit, or none and a note where draws of a posterior leave the robot's answer as it is."""
        idle = self.outside_warnings(robot, model)
        return (NO_FIT if idle else self), idle

    def geometry_warnings(self, robots: Sequence[Robot], models: Sequence[SwimmerModel]) -> list[Note]:
        """Whether fitted values act in another channel, or of a posterior on another body, than they were fitted to."""
        # That of a model's own drag factors is `spirillum.swimming.cautions.calibration_warnings`.
        acting = (
            robot
            for robot in robots
            for model in models
            if (model.placed or model.name not in robot.calibration) and self.serves(robot, model)
        )
        apart = next(filter(None, map(self._difference, acting)), "")
        if not apart:
            return []
        what = "its values" if self.posterior is None else "its values and intervals"
        name = self._file_name.partition(" (")[0]
        field = apart.partition(" = ")[0]
        return [Note.named("fit-outside-geometry", name=name, apart=apart, what=what, fields=(field,))]

    def _difference(self, robot: Robot) -> str:
        """The first size of a robot's channel and body that is none of the fitted ones; empty where all are."""
        if not self._is_fitted_in([robot]):
            own = "none" if robot.channel is None else show(robot.channel.diameter, "mm")
            return f"channel.diameter = {own} (fitted to {self._fitted_channels})"
        fitted = () if self.posterior is None else zip(("diameter", "length"), self.posterior.body, strict=True)
        pairs = ((name, float(getattr(robot.body, name)), size) for name, size in fitted)
        differing = (
            f"body.{name} = {show(own, 'mm')} (fitted to {show(size, 'mm')})"
            for name, own, size in pairs
            if not np.isclose(own, size, rtol=1e-6, atol=0.0)
        )
        return next(differing, "")

    @property
    def _file_name(self) -> str:
        return self.name if self.file is None else Path(self.name).name

    def origin_warnings(
        self, robots: Sequence[Robot], models: Sequence[SwimmerModel], *, friction: bool = True
    ) -> list[Note]:
        """Whether anything of it that is used was measured."""
        pairs = ((robot, model) for robot in robots for model in models)
        if not self.synthetic or not any(self.serves(*pair, friction=friction) for pair in pairs):
            return []
        return [Note.named("fit-of-synthetic", observations=self.synthetic)]

    def torque_warnings(self, models: Sequence[str], readings: Sequence[str]) -> list[Note]:
        """Whether B_eff is used with another friction model or model than those that it was inferred with."""
        inferring = [name for name in readings if name in ("rotor", "paper")]
        of = (("friction", self.reading, inferring), ("model", self.model, models if inferring else ()))
        found = []
        for what, own, used in of:
            others = [name for name in used if name != own]
            if self.friction and own and others:
                named = " and ".join(f"'{name}'" for name in (others if what == "model" else others[:1]))
                found.append(Note.named("torque-of-another-fit", what=what, own=own, named=named))
        return found

    def answer_warnings(self, robot: Robot, model: SwimmerModel, reading: str, rate: float | None) -> list[Note]:
        """All notes beside a steady motion."""
        acts = friction_acts(reading, rate)
        idle = self.unused_model_warnings([robot], [model], friction=acts)
        if rate is None:
            return [*idle, *self.run_warnings(robot, model, reading)]
        there = self.geometry_warnings([robot], [model])
        return [*idle, *there, *self.origin_warnings([robot], [model], friction=acts)]

    def run_warnings(self, robot: Robot, model: SwimmerModel, reading: str) -> list[Note]:
        """All notes of a robot that is driven by its own motor."""
        return [
            *self.tail_warnings(robot),
            *self.torque_warnings([model.name], [reading]),
            *self.geometry_warnings([robot], [model]),
            *self.origin_warnings([robot], [model]),
        ]

    def tail_warnings(self, robot: Robot) -> list[Note]:
        """Whose B_eff a robot that is driven by its own motor has."""
        own, others = friction_of_tails(robot, self.friction)
        if own is not None and own > 0:
            return []
        if own is not None:
            return [Note.named("friction-of-tail-negative")]
        if not others:
            return []
        median, least, most = np.median(others), min(others), max(others)
        return [Note.named("friction-of-others", count=len(others), median=median, least=least, most=most)]

    def tails_warnings(self, robots: Sequence[Robot]) -> list[Note]:
        """How many robots have a B_eff that was not fitted, or is negative."""
        found = [friction_of_tails(robot, self.friction) for robot in robots]
        unknown = sum(1 for own, others in found if own is None and others)
        zero = sum(1 for own, _ in found if own is not None and own <= 0)
        sentences = []
        if unknown:
            words = f"B_eff of {unknown} of {len(robots)} tails was not fitted: the median of the fitted tails is used"
            words += ", and intervals include their spread" if self.posterior else ""
            sentences.append(Note("friction-not-fitted", words, ("friction.effective",)))
        if zero:
            sentences.append(Note.named("friction-of-tails-negative", zero=zero, robots=len(robots)))
        return sentences


def friction_acts(reading: str, rate: float | None) -> bool:
    """Whether B_eff acts on an answer: at a prescribed tail rate only where it brakes the body."""
    return rate is None or reading == "body"


NO_FIT = Fit()  #: The fit of nothing: a robot keeps its own values.


def read_fit(
    calibration: str | Path | Fit | None = None,
    posterior: str | Path | None = None,
    *models: str,
    calibrated: bool = True,
    answer: str | None = "held",
) -> Fit:
    """Read a calibration file or a posterior (of held motion, of a trial, or of either: None), once for a request."""
    if posterior is not None:
        if calibration is not None or not calibrated:
            raise InputError("posterior together with another calibration, or with none; allowed: a posterior alone")
        return fit_of_posterior(read_posterior(posterior, *models, answer=answer))
    if calibration is None or calibration == NO_FIT:
        return NO_FIT
    if not calibrated:
        raise InputError("calibration together with no-calibration (calibrated = False); allowed: one of them")
    if isinstance(calibration, Fit):
        return calibration
    file = read_calibration(calibration)
    provenance = file.provenance
    places = {place.channel_diameter for place in file.placement} | {tail.channel_diameter for tail in file.friction}
    return Fit(
        friction=file.friction,
        reading=provenance.friction_reading,
        synthetic=(provenance.observations or "the calibration") if provenance.synthetic else "",
        model=provenance.model,
        file=file,
        name=str(calibration),
        channels=tuple(sorted(places)),
        friction_coefficient=file.contact.friction_coefficient,
    )


def fit_of_posterior(posterior: PosteriorFile) -> Fit:
    """Return the fit whose draws are those of a posterior."""
    coefficient = posterior.middle.get("friction_coefficient")
    return Fit(
        friction=posterior.frictions,
        reading=posterior.friction_reading,
        synthetic=posterior.observations if posterior.synthetic else "",
        model=posterior.model,
        posterior=posterior,
        name=posterior.source,
        channels=tuple(float(one) for one in posterior.channels if np.isfinite(one)),
        friction_coefficient=None if coefficient is None else float(coefficient[0]),
    )


def check_not_replaced(
    fields: Iterable[str], robot: Robot, calibration: str | Path | None, posterior: str | Path | None
) -> None:
    """Refuse set fields of a robot whose values a calibration file or a posterior replaces."""
    asked = tuple(fields)
    for paths in ((calibration, None), (None, posterior)):
        if asked and any(paths):
            check_not_overridden(asked, robot, read_fit(*paths, answer=None).central(robot), str(paths[0] or paths[1]))


def check_not_overridden(fields: Iterable[str], before: Robot, after: Robot, source: str) -> None:
    """Refuse set fields that are not the same in a robot before and after fitted values have replaced its own."""
    asked = tuple(fields)
    if not asked or after is before:
        return
    own, fitted = before.model_dump(), after.model_dump()
    for field in asked:
        if _at(own, field) != _at(fitted, field):
            raise InputError(
                f"{field} is set or varied, and replaced by what {source} has fitted; allowed: one of them"
            )


def _at(table: Any, field: str) -> Any:
    """A value among nested tables; None where there is none."""
    for name in field.split("."):
        table = table.get(name) if isinstance(table, Mapping) else None
    return table
