"""A request for a steady motion, resolved once: robot, pose, model, fit, drive and friction model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from spirillum.errors import InputError
from spirillum.fitted.fit import NO_FIT, Fit
from spirillum.fluid.model import SwimmerModel
from spirillum.robot.batch import RobotBatch
from spirillum.robot.load import load
from spirillum.robot.model_options import Resolution
from spirillum.robot.placement import Placement
from spirillum.robot.robot import Robot
from spirillum.robot.tables import FrictionReading
from spirillum.swimming.drawn_resistance import PosteriorFor, posterior_for_of
from spirillum.swimming.dry_friction import swim_on_floor
from spirillum.swimming.model_choice import AUTO, ModelChoice, choose_model
from spirillum.swimming.preparation import prepared
from spirillum.swimming.reynolds import in_stokes_flow, reynolds_limits, stokes_flow_problem
from spirillum.swimming.steady import Swimming, calibrated_balance, friction_reading, speed_error
from spirillum.units import KINDS, parse_option


@dataclass(frozen=True)
class Scenario:
    """A robot in its pose, its model, and all else that its steady motion follows from; SI."""

    robot: Robot
    """The robot, with fitted values in place of its own."""
    model: SwimmerModel
    batch: RobotBatch
    """The robot in its pose, as a batch of one."""
    friction: FrictionReading
    tail_rate: float | None
    """Lab rate of the tail, rad/s; None: the robot's drive."""
    calibrated: bool
    """Whether calibration factors are applied."""
    motion: str
    """Lateral motion and tilt constrained (`held`), or `free`."""
    fit: Fit
    """Fitted values that act on the robot."""
    choice: ModelChoice
    """Why the model was taken."""
    placement: Placement
    """The requested placement, without fitted fields."""
    posterior_for: PosteriorFor
    """Whose discrepancy intervals contain."""
    names_friction: bool
    """Whether the robot itself, before the fit, states its effective friction."""

    def swim(self, batch: RobotBatch, model: SwimmerModel | None = None) -> Swimming:
        """Steady swimming of the robot at some poses, by its model or by another."""
        model = model or self.model
        return swim_on_floor(
            batch,
            model,
            [self.robot],
            self.fit.dry_friction(model),
            tail_rate=None if self.tail_rate is None else np.array([self.tail_rate]),
            friction=self.friction,
            calibrated=self.calibrated,
            motion=self.motion,
        )

    def checked(self) -> list[Swimming]:
        """Steady swimming at other resolutions, for the error estimate; none where the model has none."""
        return [self.swim(self.batch, other) for other in self.model.checked_by(self.batch)]

    def error_estimate(self, result: Swimming, checks: Sequence[Swimming]) -> float:
        """Relative error of the forward velocity: the sum of what is known of it, see `SwimmerModel.checked_by`.

        NaN for a model in closed form, and where inertia rules.
        """
        found = self.model.stated_speed_error(self.batch)
        if checks:
            speeds = [one.forward_velocity for one in (result, *checks)]
            found = float(speed_error(speeds, self.model.unchecked_error(self.batch))[0])
        return in_stokes_flow(found, *reynolds_limits(self.batch, result.reynolds_number, result.tail_reynolds_number))

    def has_weight_or_place(self) -> bool:
        """Whether it is known that the robot's weight keeps it on the floor, or where else it is."""
        place = self.batch.placement
        known = self.robot.body.mass is not None and self.robot.tail.density is not None
        return known or place.gap is not None or place.eccentricity is not None

    def why_not(self, result: Swimming) -> str:
        """Why there is no steady motion."""
        limits = reynolds_limits(self.batch, result.reynolds_number, result.tail_reynolds_number)
        if problem := stokes_flow_problem(self.batch, limits):
            return problem
        if self.tail_rate is not None:
            paper = ", and with friction model 'paper' not so slow that B_eff exceeds E_x"
            return (
                f"tail-rate = {self.tail_rate:.4g} rad/s: motor and battery have no steady state there; allowed: a "
                "rate at which (17) has a root with a positive battery voltage"
                f"{paper if self.friction == 'paper' else ''}"
            )
        if self.friction == "paper":
            limit = calibrated_balance(self.batch, self.model, calibrated=self.calibrated).bb[0]
            return (
                f"friction.effective = {self.batch.effective_friction[0]:.4g} N m s/rad; allowed: less than "
                f"E_x = {limit:.4g} N m s/rad with friction model 'paper', which would turn the tail backwards"
            )
        return f"model '{self.model.name}' finds no steady motion for this robot; allowed: a robot inside its domain"


def resolve_scenario(
    robot: str | Path | Mapping[str, Any] | Robot,
    *,
    model: str | ModelChoice = AUTO,
    tail_rate: str | float | None = None,
    friction: str | None = None,
    calibrated: bool = True,
    fit: Fit = NO_FIT,
    posterior_for: str = "new",
    resolution: Resolution | Mapping[str, Any] | None = None,
    placement: Placement | Mapping[str, Any] | None = None,
    motion: str = "held",
) -> Scenario:
    """Return the scenario of a request; the arguments are those of `spirillum.swimming.prediction.predict`."""
    own, given = load(robot), Placement.of(placement)
    central = own if fit.posterior is None else fit.central(own)
    where = fit.placed(central, given)
    choice = model
    if not isinstance(choice, ModelChoice):
        choice = choose_model(choice, central, placement=where, fit=fit)
    ready, chosen, batch = prepared(
        central, choice.model, fit=fit, resolution=resolution, placement=where if where.is_given else None
    )
    reading = friction_reading(ready.friction.reading if friction is None else friction)
    rate = _rate(tail_rate, batch.placement)
    if rate is None and ready.drive is None:
        raise InputError(f"{ready.name} has no [drive]; allowed: a drive, or a tail rate (--tail-rate '1 Hz')")
    return Scenario(
        robot=ready,
        model=chosen,
        batch=batch,
        friction=reading,
        tail_rate=rate,
        calibrated=calibrated,
        motion=motion,
        fit=fit,
        choice=choice,
        placement=given,
        posterior_for=posterior_for_of(posterior_for, fit.posterior, ready),
        names_friction=own.friction.effective is not None,
    )


def _rate(value: str | float | None, placement: Placement) -> float | None:
    if value is None:
        return None
    rate = parse_option("tail-rate", value, KINDS["rate"])
    if rate == 0 and not placement.flow:
        raise InputError("tail-rate = 0 Hz: a tail at rest drives nothing; allowed: any other rate")
    return rate
