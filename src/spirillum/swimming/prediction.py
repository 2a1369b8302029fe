"""One robot's predicted swimming, with everything that a reader of the number has to know."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from spirillum.answer_entries import answer_of
from spirillum.display import DisplayMixin
from spirillum.envelope import quantity
from spirillum.errors import InputError
from spirillum.fitted.fit import NO_FIT, Fit, friction_acts
from spirillum.fitted.posterior_file import PosteriorFile
from spirillum.fluid.model import SwimmerModel
from spirillum.fluid.reference_errors import fit_clause
from spirillum.fluid.registry import SWIMMER_MODELS, find_swimmer_model
from spirillum.fluid.tube.domain import in_tube
from spirillum.fluid.tube.progress_messages import LEVEL, TILTED, solution_message
from spirillum.kernels.native import run_together
from spirillum.notes import Note
from spirillum.progress import Progress, tell
from spirillum.robot.batch import RobotBatch
from spirillum.robot.model_options import Resolution
from spirillum.robot.placement import Placement
from spirillum.robot.robot import Robot
from spirillum.robot.tables import FrictionModel
from spirillum.swimming.balance import find_friction_model
from spirillum.swimming.band import Band, band_of, no_band_warnings
from spirillum.swimming.intervals import PosteriorFor, intervals_of, knows_torque, without_torque
from spirillum.swimming.motions import (
    STEADY,
    Intervals,
    Motion,
    ReleasedMotion,
    SteadyState,
    Swimming,
    headline,
    motion_of,
)
from spirillum.swimming.preparation import AUTO, ModelChoice, choose_model, prepared, why_no_table
from spirillum.swimming.scenario import OtherModels, Scenario, other_models
from spirillum.units import KINDS, parse_option


@dataclass(frozen=True, repr=False)
class Prediction(DisplayMixin):
    """Steady swimming of one robot, SI, rates signed about +x.

    The quantities are attributes (`prediction.forward_velocity`); NaN where one does not apply.
    """

    robot: Robot
    model: SwimmerModel
    friction: FrictionModel
    calibrated: bool
    batch: RobotBatch = field(repr=False)  #: The robot at its pose, as a batch of one.
    swimming: Swimming = field(repr=False)  #: The quantities, as arrays of length one.
    error_estimate: float
    """Relative error of the forward velocity, the sum of what is known of it; NaN for a model in closed form."""
    warnings: tuple[Note, ...]
    intervals: Intervals | None = field(default=None, repr=False)  #: Intervals of a posterior; None without one.
    band: Band | None = field(default=None, repr=False)
    """Band over the poses that the placement leaves open; None where there are none, or none was requested."""
    motion: Motion = "held"  #: Lateral motion and tilt constrained, or released.
    interval_of: str = ""  #: Whose the intervals are, in half a sentence; empty without a posterior.
    steady_state: SteadyState | None = None
    """Steady state of a free robot in its tube after its release (`placement`); None for others."""
    choice: ModelChoice | None = None  #: Reason of the model; None where it was named.
    tail_rate: float | None = None  #: Requested lab rate of the tail, rad/s; None: the robot's drive.
    fitted_by: str = ""  #: File of a calibration or a posterior whose values act on the answer; empty without one.
    released: Mapping[str, Callable[[], ReleasedMotion]] = field(default_factory=dict, repr=False, compare=False)
    """Request for `trial` and `steady`, in seconds; empty where the held motion alone, or a free one, was requested."""

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
        if self.steady_state is not None:
            return free_in_tube(self.fitted_by)
        if self.model.placed and self.intervals is not None and self.band is None:
            return "walls are computed; the interval covers what the posterior leaves open, all else is taken as given"
        return self.model.error_statement(self.batch, self.fitted_by)

    @cached_property
    def placement(self) -> dict[str, Any]:
        """Pose that the model takes; fields with a band have `low`, `high` and `kind` too."""
        found = self.model.placement_of(self.batch)
        return found if self.band is None else self.band.placed(found)

    @property
    def answered_by(self) -> dict[str, str]:
        """The model, its `form` of several, `model_reason` where none was named, `fitted_by` where a file was."""
        form = {} if self.model.form is None else {"form": self.model.form}
        reason = {"model_reason": self.choice.reason} if self.choice is not None and self.choice.reason else {}
        fitted = {"fitted_by": self.fitted_by} if self.fitted_by else {}
        return {"model": self.model.name, **form, **reason, **fitted}

    @cached_property
    def other_models(self) -> OtherModels | None:
        """Predictions of models that leave out effects which this one includes; None where none is comparable."""
        if self.steady_state is not None and self.steady_state.state == "changing":
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

    @cached_property
    def trial(self) -> ReleasedMotion | None:
        """What a trial measures of the robot, released in its tube; contact is assumed, not validated."""
        return self.released["trial"]() if self.released else None

    @cached_property
    def steady(self) -> ReleasedMotion | None:
        """The steady motion that the released robot approaches, as `spirillum.settle` finds it."""
        return self.released["steady"]() if self.released else None

    def __dir__(self) -> list[str]:
        """Attributes, the quantities among them."""
        return sorted({*super().__dir__(), *_QUANTITIES})

    def _display_content(self) -> tuple[dict[str, Any], list[str]]:
        """See `DisplayMixin`: the headline quantities, without those of other models."""
        answer = self.to_dict(others=False)
        return answer, headline(answer)

    def __str__(self) -> str:
        """The held answer as text, and where those of released motion are."""
        where = "\nreleased: answer.trial, answer.steady (values, or why there are none)"
        return super().__str__() + (where if self.released and self.robot.channel is not None else "")

    def to_dict(self, *, others: bool = True, other_models: bool = True) -> dict[str, Any]:
        """The answer of `spirillum predict --json`; with `others`, trial and steady motion stand in these."""
        beside = self.other_models if others and other_models else None
        wanted = {name: compute for name, compute in self.released.items() if others and name not in vars(self)}
        if wanted:
            vars(self).update(zip(wanted, run_together(*wanted.values()), strict=True))
        over = self.band or self.intervals
        quantities = {
            name: quantity(getattr(self, name), unit, **_MORE.get(name, {}), **(over.of(name) if over else {}))
            for name, (unit, _) in _QUANTITIES.items()
        }
        motions = {name: getattr(self, name) for name in self.released} if others else {}
        return answer_of(self, quantities=quantities, beside=beside, motions=motions)


_QUANTITIES: dict[str, tuple[str, str]] = {item.name: (item.unit, item.meaning) for item in STEADY}
_MORE = {
    "reynolds_number": {"length": "body diameter"},
    "tail_reynolds_number": {"length": "tail amplitude", "velocity": "rotation rate times amplitude"},
}


def predict_steady(
    robot: Robot,
    *,
    model: str | ModelChoice = AUTO,
    tail_rate: str | float | None = None,
    friction: str | None = None,
    calibrated: bool = True,
    fit: Fit = NO_FIT,
    posterior_for: PosteriorFor = "new",
    resolution: Resolution | Mapping[str, Any] | None = None,
    placement: Placement | Mapping[str, Any] | None = None,
    band: bool | None = None,
    motion: str = "held",
    progress: Progress | None = None,
) -> Prediction:
    """Predict the steady swimming of one robot with fitted values `fit`; else arguments as of `spirillum.predict`."""
    given, drawn = Placement.of(placement), fit.posterior
    central, choice, where = _chosen(model, robot, fit, given)
    ready, chosen, batch = prepared(central, choice.model, resolution=resolution, placement=where)
    reading = find_friction_model(ready.friction.reading if friction is None else friction)
    rate = _rate(tail_rate, batch.placement)
    if rate is None and ready.drive is None:
        raise InputError(f"{ready.name} has no [drive]; allowed: a drive, or a tail rate (--tail-rate '1 Hz')")
    scenario = Scenario(
        robot=ready,
        model=chosen,
        batch=batch,
        friction=reading,
        tail_rate=rate,
        calibrated=calibrated,
        motion=motion,
        fit=fit,
        names_friction=robot.friction.effective is not None,
    )
    if band:
        _check_band(choice.model)
    intervals, torque = None, []
    if drawn is not None:
        intervals = intervals_of(
            ready,
            chosen,
            drawn,
            tail_rate=rate,
            friction=reading,
            posterior_for=posterior_for,
            placement=given,
        )
        if not knows_torque(ready, chosen):
            intervals, torque = without_torque(intervals), [Note.named("torque-not-fitted")]
    if not chosen.closed_form:
        direct, tilted = chosen.form == "direct", bool(batch.placement.pitch or batch.placement.yaw)
        if direct and not tilted:
            instead = "" if why_no_table(*in_tube(batch)) else "; `spirillum prepare` makes further answers immediate"
            tell(progress, f"{solution_message(LEVEL)}{instead}", 0, 1)
        tell(progress, solution_message(TILTED) if direct and tilted else chosen.name, 0, 1)
    result, error, notes = scenario.solved()
    warnings = [*ready.warnings, *notes]
    with_band = band is True or (band is None and (chosen.closed_form or chosen.form == "table"))
    over = band_of(batch, chosen, result, scenario.swim, progress) if with_band else None
    warnings += no_band_warnings(batch, chosen) if band is None and not with_band else []
    if intervals is not None and posterior_for == "measured":
        result = with_posterior_medians(result, intervals)
    acts = friction_acts(reading, rate)
    idle = fit.outside_warnings(ready, chosen, friction=acts)
    if idle:
        intervals = None
    warnings += idle or [*fit.answer_warnings(ready, chosen, reading, rate), *torque]
    return Prediction(
        robot=ready,
        model=chosen,
        friction=reading,
        calibrated=calibrated and chosen.name in ready.calibration,
        batch=batch,
        swimming=result,
        error_estimate=error,
        warnings=(*warnings, *(() if over is None else over.left_out)),
        intervals=intervals,
        band=over,
        motion=motion_of(motion),
        interval_of="" if idle else interval_statement(drawn, ready, posterior_for),
        choice=choice,
        tail_rate=rate,
        fitted_by="" if idle else fit.source_of(ready, chosen, friction=acts),
    )


def _chosen(model: str | ModelChoice, robot: Robot, fit: Fit, given: Placement) -> tuple[Robot, ModelChoice, Placement]:
    """The robot with the values of a fit, the model, and the placement with what the fit has found where it is open."""
    central = fit.central(robot)
    where = fit.placed(central, given)
    choice = model if isinstance(model, ModelChoice) else choose_model(model, central, placement=where, fit=fit)
    if not where.is_set and find_swimmer_model(choice.model).placed:
        where = fit.calibrated_placement(central) or where
    return central, choice, where


def free_in_tube(fitted_by: str) -> str:
    """What a free motion in the tube rests on."""
    computed = f"walls, weight and contact are computed, {fit_clause(fitted_by)}"
    where = " where it has none" if fitted_by else ""
    return f"{computed}; roughness and dry friction are assumed{where}; contact is not validated against an experiment"


def with_posterior_medians(swum: Swimming, intervals: Intervals) -> Swimming:
    """The steady motion with the medians of intervals where they are known."""
    middles: dict[str, Any] = {
        name: np.array([middle]) for name, middle in intervals.middle.items() if np.isfinite(middle)
    }
    return replace(swum, **middles)


def interval_statement(posterior: PosteriorFile | None, robot: Robot, whose: PosteriorFor) -> str:
    """Whose intervals they are, in half a sentence; empty without a posterior."""
    if posterior is None:
        return ""
    if whose == "measured":
        return "of this robot, which was measured: its own observations show how far the model misses it"
    if posterior.measured(robot) is None:
        return "of a tail like those that were fitted, which the model may miss by as much as these"
    return (
        "of a tail like those that were fitted, which the model may miss by as much as these; this robot was measured "
        "itself: --for measured gives the interval of its own mean"
    )


def _rate(value: str | float | None, placement: Placement) -> float | None:
    if value is None:
        return None
    rate = parse_option("tail-rate", value, KINDS["rate"])
    if rate == 0 and not placement.flow:
        raise InputError("tail-rate = 0 Hz: a tail at rest drives nothing; allowed: any other rate")
    return rate


def _check_band(model: str) -> None:
    """Refuse a band of a model without a pose."""
    walled = [name for name, known in SWIMMER_MODELS.items() if known.placed]
    if model not in walled:
        raise InputError(
            f"band = True with model '{model}'; allowed: only with a model that computes the walls "
            f"({', '.join(walled)})"
        )
