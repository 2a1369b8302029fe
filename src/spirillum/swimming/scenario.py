"""A case of steady motion: robot, pose, model, fit, drive and friction model, its motion, errors and cautions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from spirillum.fitted.fit import Fit
from spirillum.fluid.model import SwimmerModel
from spirillum.notes import Note
from spirillum.robot.batch import RobotBatch
from spirillum.robot.limits import broken
from spirillum.robot.robot import Robot
from spirillum.robot.tables import FrictionModel
from spirillum.swimming.cautions import accuracy_limits, calibration_warnings, drive_warnings, film_limits
from spirillum.swimming.dry_friction import swim_on_floor
from spirillum.swimming.reynolds import in_stokes_flow, reynolds_limits, stokes_flow_problem
from spirillum.swimming.steady import Swimming, calibrated_balance, speed_error
from spirillum.units import show


@dataclass(frozen=True)
class Scenario:
    """A robot in its pose, its model, and all else that its steady motion follows from; SI."""

    robot: Robot  #: The robot, with fitted values in place of its own.
    model: SwimmerModel
    batch: RobotBatch  #: The robot in its pose, as a batch of one.
    friction: FrictionModel
    tail_rate: float | None  #: Lab rate of the tail, rad/s; None: the robot's drive.
    calibrated: bool  #: Whether calibration factors are applied.
    motion: str  #: Lateral motion and tilt constrained (`held`), or `free`.
    fit: Fit  #: Fitted values that act on the robot.
    names_friction: bool  #: Whether the robot itself, before the fit, states its effective friction.

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

    def _has_weight_or_place(self) -> bool:
        """Whether it is known that the robot's weight keeps it on the floor, or where else it is."""
        place = self.batch.placement
        known = self.robot.body.mass is not None and self.robot.tail.density is not None
        return known or place.gap is not None or place.eccentricity is not None

    def warnings(self, result: Swimming) -> list[Note]:
        """What to be careful about: calibration, accuracy, drive, what a free motion leaves out."""
        robot, model, batch, rate = self.robot, self.model, self.batch, self.tail_rate
        known = robot  # of the user's file: without the B_eff of a calibration
        if rate and not self.names_friction:
            known = robot.model_copy(update={"friction": robot.friction.model_copy(update={"effective": None})})
        assumed = "assumed-on-floor" if robot.has_body else "assumed-on-axis"
        return [
            *(calibration_warnings(robot, model.name) if self.calibrated else ()),
            *(limit.caution() for limit in broken(accuracy_limits(batch, model, result))),
            *(limit.caution() for limit in broken(film_limits(robot, model, batch, result))),
            *drive_warnings(known, model, self.friction, result, rate),
            *(self._left_out() if self.motion == "free" else ()),
            *([Note.named("in-a-flow")] if batch.placement.flow else []),
            *([Note.named(assumed)] if model.placed and not self._has_weight_or_place() else []),
        ]

    def _left_out(self) -> list[Note]:
        """What a free motion leaves out."""
        if self.robot.channel is not None:
            return [Note.named("free-without-walls")]
        weight = self.robot.derived().get("submerged_weight")
        if weight is None or not weight.value:
            return []
        moves = "sinks" if weight.value > 0 else "rises"
        return [Note.named("free-without-weight", weight=show(weight.value, "N"), moves=moves)]

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
