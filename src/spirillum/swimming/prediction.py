"""One robot's predicted swimming, with everything that a reader of the number has to know."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from spirillum.answer import envelope, quantity
from spirillum.errors import InputError
from spirillum.fitted.calibration_file import calibrated_placement, with_calibration
from spirillum.fitted.posterior_file import PosteriorFile, read_posterior
from spirillum.fitted.warnings import fitted_of
from spirillum.fluid.model import SwimmerModel
from spirillum.fluid.registry import check_placement, find_swimmer_model, quickest
from spirillum.robot.actuation import FrictionReading
from spirillum.robot.batch import RobotBatch
from spirillum.robot.limits import all_hold, assembly_limits, broken
from spirillum.robot.load import load, with_resolution
from spirillum.robot.options import Resolution
from spirillum.robot.placement import Placement
from spirillum.robot.robot import Robot
from spirillum.robot.seat import GAP_SHARE
from spirillum.shown import Shown
from spirillum.swimming.answer import STEADY, Intervals, Swimming, headline
from spirillum.swimming.band import Band, band_of
from spirillum.swimming.cautions import accuracy_limits, calibration_warnings, no_band_warnings
from spirillum.swimming.discrepancy import PosteriorFor, posterior_for_of
from spirillum.swimming.drive_warnings import drive_warnings
from spirillum.swimming.dry_friction import swim_on_floor
from spirillum.swimming.freedom import Motion, motion_of
from spirillum.swimming.lying import Lying
from spirillum.swimming.model_choice import AUTO, ModelChoice, choose_model
from spirillum.swimming.other_models import OtherModels, other_models
from spirillum.swimming.steady import (
    calibrated_balance,
    friction_reading,
    requirements,
    speed_difference,
)
from spirillum.units import KINDS, parse_option, show

__all__ = ["Prediction", "checked_batch", "least_gap", "predict", "prepared"]

_GAP_STEP = 1.02
"""Ratio of gaps to which the least one that a model resolves is told."""


@dataclass(frozen=True)
class Prediction(Shown):
    """Steady swimming of one robot, SI, rates signed about +x.

    The quantities are attributes (`prediction.forward_velocity`); NaN where one does not apply.
    """

    robot: Robot
    """The robot."""
    model: SwimmerModel
    """The hydrodynamic model."""
    friction: FrictionReading
    """Reading of the friction."""
    calibrated: bool
    """Whether calibration factors were applied."""
    batch: RobotBatch = field(repr=False)
    """The robot in its place, as a batch of one."""
    swimming: Swimming = field(repr=False)
    """The quantities, as arrays of length one."""
    error_estimate: float
    """Relative difference of the forward velocity from another resolution; NaN for a model in closed form."""
    warnings: tuple[str, ...]
    """What to be careful about, a sentence each."""
    intervals: Intervals | None = field(default=None, repr=False)
    """Intervals of a posterior; None without one."""
    band: Band | None = field(default=None, repr=False)
    """Band over the places that the placement leaves open; None where there are none, or none was asked for."""
    motion: Motion = "held"
    """Lateral motion and tilt held, or released."""
    interval_of: str = ""
    """Whose the intervals are, in half a sentence; empty without a posterior."""
    lying: Lying | None = None
    """Where a free robot comes to lie in its tube, from where it was laid down (`placement`); None for others."""
    choice: ModelChoice | None = None
    """Why the model was taken; None where nobody asked."""
    tail_rate: float | None = None
    """Lab rate of the tail that was asked for, rad/s; None: the robot's drive."""

    def __getattr__(self, name: str) -> float:
        """A quantity by name, as a float."""
        if name.startswith("_") or name not in _QUANTITIES:
            raise AttributeError(name)
        return float(getattr(self.swimming, name)[0])

    @property
    def references(self) -> tuple[str, ...]:
        """Keys of the references that it rests on."""
        return self.model.references

    @property
    def known_error(self) -> str:
        """What the model leaves out of this robot, and what that costs it."""
        if self.lying is not None:
            return "walls, weight and contact are computed, nothing is fitted; roughness and dry friction are assumed"
        return self.model.own_error(self.batch)

    @cached_property
    def placement(self) -> dict[str, Any]:
        """Where the model places the robot; what a band goes over has `low`, `high` and `kind` too."""
        found = self.model.placement_of(self.batch)
        return found if self.band is None else self.band.placed(found)

    @property
    def answered_by(self) -> dict[str, str]:
        """Name of the model, `form` where it has more than one, and `model_reason` where nobody named one."""
        form = {} if self.model.form is None else {"form": self.model.form}
        reason = {"model_reason": self.choice.reason} if self.choice is not None and self.choice.reason else {}
        return {"model": self.model.name, **form, **reason}

    @cached_property
    def other_models(self) -> OtherModels | None:
        """What models say that leave out what this one knows; None where none can be held against it."""
        if self.lying is not None and self.lying.state == "changing":
            return None
        return other_models(
            self.robot,
            self.model,
            self.forward_velocity,
            tail_rate=self.tail_rate,
            friction=self.friction,
            motion=self.motion,
            flow=self.batch.placement.flow,
        )

    def __dir__(self) -> list[str]:
        """Attributes, the quantities among them."""
        return sorted({*super().__dir__(), *_QUANTITIES})

    def _shown(self) -> tuple[dict[str, Any], list[str]]:
        """See `Shown`: the quantities that matter most, without what other models say."""
        answer = self.to_dict(others=False)
        return answer, headline(answer)

    def to_dict(self, *, others: bool = True) -> dict[str, Any]:
        """The answer of `spirillum predict --json`.

        Args:
            others: what other models say stands in it.
        """
        band = self.band
        beside = self.other_models if others else None
        over = band or self.intervals
        quantities = {
            name: quantity(getattr(self, name), unit, **_MORE.get(name, {}), **(over.of(name) if over else {}))
            for name, (unit, _) in _QUANTITIES.items()
        }
        content = {
            "robot": self.robot.name,
            **self.answered_by,
            "friction": self.friction,
            "calibrated": self.calibrated,
            "motion": self.motion,
            **quantities,
            **({"interval_of": self.interval_of} if self.interval_of else {}),
            "placement": self.placement,
            **({"lying": self.lying.to_dict()} if self.lying else {}),
            **({"band": band.to_dict()} if band else {}),
            **({"other_models": beside.to_dict()} if beside else {}),
            "error_estimate": quantity(
                self.error_estimate,
                "1",
                **({} if self.model.error_against is None else {"against": self.model.error_against}),
                statement=self.known_error,
            ),
            "references": list(self.references),
        }
        return envelope("prediction", content, self.warnings)


_QUANTITIES: dict[str, tuple[str, str]] = {item.name: (item.unit, item.meaning) for item in STEADY}
_MORE = {
    "reynolds_number": {"length": "body diameter"},
    "tail_reynolds_number": {"length": "tail amplitude", "velocity": "rotation rate times amplitude"},
}


def predict(
    robot: str | Path | Mapping[str, Any] | Robot,
    *,
    model: str = AUTO,
    tail_rate: str | float | None = None,
    friction: str | None = None,
    calibrated: bool = True,
    calibration: str | Path | None = None,
    posterior: str | Path | None = None,
    posterior_for: str = "new",
    resolution: Resolution | Mapping[str, Any] | None = None,
    placement: Placement | Mapping[str, Any] | None = None,
    band: bool | None = None,
    motion: str = "held",
    progress: Callable[[str, int, int], None] | None = None,
) -> Prediction:
    """Predict the steady swimming of one robot.

    Where the answer depends on the robot's place in its channel and `placement` leaves its gap or its pitch open, the
    answer stands at a reference place (a gap of 0.5 mm for the paper's robot, level) and, where the robot has a table
    for its tube (`spirillum.prepare`), has a band over the places that are possible, see `spirillum.swimming.band`.

    Args:
        robot: a preset's name, a robot file, its tables, or a loaded robot.
        model: `sbt`, `rft`, `slender`, `tube`, or `auto`: what the posterior or the calibration was fitted with, else
            `tube` for a robot in a channel and `slender` for one without.
        tail_rate: lab rotation rate of the tail, with its unit (``"1.2 Hz"``) or a float in rad/s; without it
            the robot's drive decides. With a DC-motor the current then follows from (17) at the drive's duty and
            the effective friction from (18).
        friction: reading of the friction, `none`, `rotor`, `body` or `paper`; None: the robot's own.
        calibrated: apply the robot's calibration factors for this model.
        calibration: calibration file whose factors replace the robot's.
        posterior: file of a calibration's posterior: its middle replaces the robot's values, and every quantity has a
            95 % interval, the model's discrepancy included.
        posterior_for: whose discrepancy the intervals hold: `new`, a tail like those that were fitted, or `measured`, a
            robot that was, of which the values are then the middle of what is known of it.
        resolution: of the models `slender` and `tube`: `accuracy`, `tolerance`, `phases`; None: the robot's own.
        placement: where in the channel the robot lies, for a model that computes the walls: `gap`, `eccentricity`,
            `pitch`, `tail_drop`, `ends`, `flow`, each a quantity with its unit or a float in SI.
        band: answer with the band over what the placement leaves open, or at the reference place alone; None: with it
            where the robot has a table, without which it takes minutes.
        motion: `held` (lateral motion and tilt held, as the channel's floor does) or `free`. Free with `rft` or
            `slender` the robot has neither weight nor walls; the forward velocity is then that along the axis of the
            screw on which it moves. (Free with `tube` is `spirillum.dynamics.prediction`, above this room.)
        progress: told what is being computed, how many places are done, and of how many.

    Raises:
        InputError: for wrong input, or a robot outside the model's domain.
    """
    drawn, given = None, Placement.of(placement)
    where = given
    robot = load(robot)
    unset = robot.friction.effective is None
    if posterior is not None:
        if calibration is not None or not calibrated:
            raise InputError("posterior together with another calibration, or with none; allowed: a posterior alone")
        drawn = read_posterior(posterior, *([] if model == AUTO else [model]))
        robot = drawn.central(robot)
        where = drawn.placed(robot, given)
    choice = choose_model(model, robot, placement=where, calibration=calibration, posterior=drawn, motion=motion)
    ready, chosen, batch = prepared(
        robot, choice.model, calibration=calibration, resolution=resolution, placement=where if where.is_given else None
    )
    reading = friction_reading(friction or ready.friction.reading)
    fitted = fitted_of(calibration, drawn)
    rate = _rate(tail_rate, batch.placement)
    if rate is None and ready.drive is None:
        raise InputError(f"{ready.name} has no [drive]; allowed: a drive, or a tail rate (--tail-rate '1 Hz')")

    def answer(there: RobotBatch, of: SwimmerModel = chosen) -> Swimming:
        rates = None if rate is None else np.array([rate])
        asked = {"tail_rate": rates, "friction": reading, "calibrated": calibrated, "motion": motion}
        return swim_on_floor(there, of, [ready], fitted.dry_friction(of), **asked)

    whose = posterior_for_of(posterior_for, drawn, ready)
    known = None
    if drawn is not None:
        from spirillum.swimming.intervals import intervals_of  # loads compiled loops

        known = intervals_of(
            ready, chosen, drawn, tail_rate=rate, friction=reading, posterior_for=whose, placement=given
        )
    tell = progress or (lambda _what, _done, _total: None)
    if not chosen.closed_form:
        tell(f"{chosen.name} (the first time, compiling takes some seconds)", 0, 1)
    result = answer(batch)
    if not result.valid[0]:
        raise InputError(_why_not(batch, chosen, reading, rate, calibrated=calibrated))
    warnings = [
        *ready.warnings,
        *([choice.caution] if choice.caution else []),
        *(calibration_warnings(ready, chosen.name) if calibrated else ()),
        *(limit.sentence() for limit in broken(accuracy_limits(batch, chosen, result))),
        *drive_warnings(_without_fitted_friction(ready) if unset and rate else ready, chosen, reading, result, rate),
    ]
    warnings += _free_warnings(ready, motion)
    applied = calibrated and chosen.name in ready.calibration
    check = chosen.checked_by(ready.model)
    error = (
        chosen.stated_speed_error(batch) if check is None else float(speed_difference(answer(batch, check), result)[0])
    )
    bound = band is True or (band is None and (chosen.closed_form or chosen.form == "table"))
    over = band_of(batch, chosen, result, answer, tell) if bound else None
    left_out = () if over is None else over.left_out
    warnings += no_band_warnings(batch, chosen) if band is None and not bound else []
    if known is not None and whose == "measured":
        middles = {name: np.array([middle]) for name, middle in known.middle.items() if np.isfinite(middle)}
        result = replace(result, **middles)
    warnings += fitted.idle_warnings([ready], [chosen])
    if rate is None:
        warnings += fitted.run_warnings(ready, chosen, reading)
    else:
        warnings += fitted.origin_warnings([ready], [chosen])
    return Prediction(
        ready,
        chosen,
        reading,
        applied,
        batch,
        result,
        error,
        (*warnings, *left_out),
        known,
        over,
        motion_of(motion),
        _interval_statement(drawn, ready, whose),
        choice=choice,
        tail_rate=rate,
    )


def _interval_statement(posterior: PosteriorFile | None, robot: Robot, whose: PosteriorFor) -> str:
    """Whose intervals they are, in half a sentence; empty without a posterior."""
    if posterior is None:
        return ""
    if whose == "measured":
        return "of this robot, which was measured: its own observations say how far the model misses it"
    if posterior.measured(robot) is None:
        return "of a tail like those that were fitted, which the model may miss by as much as these"
    return (
        "of a tail like those that were fitted, which the model may miss by as much as these; this one was measured "
        "itself: --for measured"
    )


def _without_fitted_friction(robot: Robot) -> Robot:
    """The robot as its user knows it: nobody set the B_eff that a calibration brought."""
    return robot.model_copy(update={"friction": robot.friction.model_copy(update={"effective": None})})


def prepared(
    robot: str | Path | Mapping[str, Any] | Robot,
    model: str,
    *,
    calibration: str | Path | None = None,
    resolution: Resolution | Mapping[str, Any] | None = None,
    placement: Placement | Mapping[str, Any] | None = None,
) -> tuple[Robot, SwimmerModel, RobotBatch]:
    """A loaded robot with its model and batch, in its place and inside the model's domain; arguments as `predict`.

    Raises:
        InputError: for wrong input, or a robot outside the model's domain.
    """
    ready = load(robot)
    if calibration is not None:
        ready = with_calibration(ready, calibration)
        if not placement and find_swimmer_model(model).placed:
            placement = calibrated_placement(ready, calibration)
    ready = with_resolution(ready, resolution, model)
    chosen = find_swimmer_model(model)
    placed = Placement.of(placement)
    known = RobotBatch.of(ready, placed)
    if np.all(all_hold(assembly_limits(known))):  # a table reaches closer to the wall than a direct solution
        chosen = quickest(chosen, known)
    return ready, chosen, checked_batch(ready, chosen, placed)


def checked_batch(robot: Robot, model: SwimmerModel, placement: Placement | None = None) -> RobotBatch:
    """The robot in its place, as a batch of one.

    Raises:
        InputError: if it is outside the model's domain, or placed for a model that does not compute the walls.
    """
    batch = RobotBatch.of(robot, placement)
    check_placement(batch.placement, model)
    outside = broken(requirements(batch, quickest(model, batch)))
    if outside:
        raise InputError(f"{robot.name} with model '{model.name}': {outside[0].sentence()}{_least_gap(batch, model)}")
    return batch


def _least_gap(batch: RobotBatch, model: SwimmerModel) -> str:
    """Where only a thin film keeps a model from an answer: the least gap that it resolves, and what else helps."""
    least = least_gap(batch, model) if model.placed else float("nan")
    if not np.isfinite(least):
        return ""
    return f"; here at least placement.gap = {show(least, 'mm')}, or a table (`spirillum prepare`)"


def least_gap(batch: RobotBatch, model: SwimmerModel) -> float:
    """Least gap that a model resolves where only the film is too thin for it, to 2 %, m; NaN where that is not so.

    It is looked for between the gap that is asked for and the one that is taken where none is.

    Args:
        batch: one robot in its place.
        model: a model that computes the walls.
    """
    asked = batch.placement.gap
    if asked is None:
        return float("nan")

    def fits(gap: float) -> bool:
        placed = batch.placement.model_copy(update={"gap": gap})
        return not broken(requirements(replace(batch, placement=placed), model))

    low, high = asked, GAP_SHARE * 0.5 * float(batch.body_diameter[0])
    if low >= high or not fits(high):
        return float("nan")
    while high > _GAP_STEP * low:
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if fits(middle) else (middle, high)
    return high


def _rate(value: str | float | None, placement: Placement) -> float | None:
    if value is None:
        return None
    rate = parse_option("tail-rate", value, KINDS["rate"])
    if rate == 0 and not placement.flow:
        raise InputError("tail-rate = 0: a tail at rest drives nothing; allowed: any other rate")
    return rate


def _why_not(
    batch: RobotBatch, model: SwimmerModel, reading: FrictionReading, rate: float | None, *, calibrated: bool
) -> str:
    if rate is not None:
        slow = ", and with friction reading 'paper' not so slow that B_eff exceeds E_x" if reading == "paper" else ""
        return (
            f"tail-rate = {rate:.4g} rad/s: motor and battery have no steady state there; allowed: a rate at which "
            f"(17) has a root with a positive battery voltage{slow}"
        )
    if reading == "paper":
        limit = calibrated_balance(batch, model, calibrated=calibrated).bb[0]
        return (
            f"friction.effective = {batch.effective_friction[0]:.4g} N m s/rad; allowed: less than "
            f"E_x = {limit:.4g} N m s/rad with friction reading 'paper', which would turn the tail backwards"
        )
    return f"model '{model.name}' finds no steady motion for this robot; allowed: a robot inside its domain"


def _free_warnings(robot: Robot, motion: str) -> list[str]:
    """What a free motion leaves out."""
    if motion == "held" or robot.channel is None:
        return []
    return ["motion 'free': the robot swims without weight and without walls, which the channel's floor would bear"]
