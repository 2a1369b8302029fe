"""A request for the released motions beside a held answer: where they exist, and how they are computed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from spirillum.dynamics.timing import TRIAL_DURATION, Timing
from spirillum.dynamics.trial import steady_of, trial_of, why_not_released
from spirillum.dynamics.trial_unknowns import TrialSample, open_unknowns, samples_of, with_interval
from spirillum.dynamics.tube_options import InTube, with_contact
from spirillum.dynamics.turning_field import Field
from spirillum.errors import InputError
from spirillum.fitted.fit import Fit, read_fit
from spirillum.robot.batch import RobotBatch
from spirillum.robot.load import with_resolution
from spirillum.robot.model_options import Resolution
from spirillum.robot.placement import Placement
from spirillum.robot.robot import Robot
from spirillum.swimming.model_choice import WALLED
from spirillum.swimming.prediction import Prediction, predict
from spirillum.swimming.preparation import table_for
from spirillum.swimming.released_motion import SPEED_OF, ReleasedMotion
from spirillum.units import KINDS, display_unit, parse_option, show

if TYPE_CHECKING:
    import xarray as xr

_TOLERANCE = 1e-4
"""Error of a time step of the runs over the unknowns: their speeds are accurate to a thousandth."""
_SAMPLES_PER_TURN = 12
"""Samples over which their means are taken."""


@dataclass(frozen=True)
class TrialRequest:
    """Arguments of `spirillum.predict` that decide the released motions of a robot."""

    robot: Robot
    friction: str | None
    calibrated: bool
    calibration: str | Path | None
    fit: Fit
    resolution: Resolution | Mapping[str, Any] | None
    placement: Placement | Mapping[str, Any] | None
    roughness: str | float | None
    in_tube: InTube
    duration: float | None
    """Of the trial, s; None: that of a run by its defaults."""
    interval: bool
    progress: Callable[[str, int, int], None] | None

    def beside(self, held: Prediction, *, wanted: bool) -> Prediction:
        """Return the held answer with what gives its released motions, or with the reason why there are none.

        Args:
            held: the answer.
            wanted: whether they are wanted.
        """
        if self.duration is not None and self.duration <= 0.0:
            raise InputError(f"duration = {self.duration:g} s; allowed: more than 0 s")
        reason = why_not_released(held, fitted=self.fit.posterior is not None)
        if not wanted or reason:
            self._check_unused(reason)
        if not wanted:
            return held
        self._announce("held", held.forward_velocity)
        if reason:
            return replace(held, released=dict.fromkeys(("trial", "steady"), partial(ReleasedMotion, reason=reason)))
        return replace(held, released={"trial": partial(self.trial, held), "steady": self.steady})

    def trial(self, held: Prediction) -> ReleasedMotion:
        """Return the trial, with its interval where that is requested."""
        nominal = self._run(held)
        self._announce("trial", nominal.values.get("forward_velocity"))
        return self._with_interval(held, nominal) if self.interval else nominal

    def steady(self) -> ReleasedMotion:
        """Return the steady motion; it is found in seconds, which no progress is told of."""
        from spirillum.dynamics.free_motion import free_motion  # its equations are compiled

        still = self.in_tube.model_copy(update={"wait": None})
        shared = {**self._shared(), "progress": None}
        fit = read_fit(shared.pop("calibration"))
        found = steady_of(lambda: free_motion(self._resolved(), in_tube=still, fit=fit, **shared).prediction)
        self._announce("steady", found.values.get("forward_velocity"))
        return found

    def _run(self, held: Prediction) -> ReleasedMotion:
        """The trial at nominal unknowns."""
        from spirillum.dynamics.simulation import simulate  # its equations are compiled

        robot, length = self._resolved(), self._length
        settings = {"in_tube": self.in_tube, "timing": {"duration": length}, **self._shared()}
        return trial_of(held, lambda: simulate(robot, model=WALLED, calibrated=self.calibrated, **settings), length)

    @property
    def _length(self) -> float:
        """Time with the motor on, s."""
        return TRIAL_DURATION if self.duration is None else self.duration

    def _shared(self) -> dict[str, Any]:
        """What all runs take of the request."""
        names = ("friction", "calibration", "placement", "roughness", "progress")
        return {name: getattr(self, name) for name in names}

    def _resolved(self) -> Robot:
        """The robot with the requested resolution, which a run refuses: the reason of its column."""
        return with_resolution(self.robot, self.resolution, WALLED)

    def _with_interval(self, held: Prediction, nominal: ReleasedMotion) -> ReleasedMotion:
        """The trial with its interval over what neither robot, request nor calibration states."""
        from spirillum.dynamics.tube_simulation import run_in_tube  # its equations are compiled

        robot, placed = self.fit.central(self.robot), Placement.of(self.placement)
        given = None if self.roughness is None else parse_option("roughness", self.roughness, KINDS["length"])
        rough, touching = with_contact(self.fit.contact(), given, self.in_tube)
        derived = robot.derived().get("submerged_weight")
        weight = 0.0 if derived is None else derived.value
        stated = {"wait": touching.wait, "roughness": rough, "friction_coefficient": touching.friction_coefficient}
        table = table_for(RobotBatch.of(robot, placed))
        times = Timing(duration=self._length, samples_per_turn=_SAMPLES_PER_TURN)
        unknowns = open_unknowns(robot, weight, stated)

        def run(sample: TrialSample) -> ReleasedMotion:
            values = {"wait": sample.wait, "friction_coefficient": sample.friction_coefficient}
            update = {name: value for name, value in values.items() if value is not None}
            asked = touching.model_copy(update=update).of_trial(placed)
            height = rough if sample.roughness is None else sample.roughness

            def quick() -> xr.Dataset:
                steady = predict(
                    sample.robot,
                    model=WALLED,
                    friction=self.friction,
                    calibrated=self.calibrated,
                    fit=self.fit,
                    placement=placed,
                    band=False,
                )
                return run_in_tube(
                    steady,
                    table,
                    times,
                    placed,
                    asked,
                    height,
                    Field(),
                    weight=True,
                    progress=None,
                    tolerance=_TOLERANCE,
                )

            return trial_of(held, quick, self._length)

        return with_interval(nominal, samples_of(robot, weight, unknowns), unknowns, run, self.progress)

    def _announce(self, column: str, speed: float | None) -> None:
        """Tell of a column as soon as it is there."""
        if self.progress is not None and speed is not None:
            self.progress(f"{SPEED_OF}{column}: {show(speed, display_unit(speed, 'm/s'))}", 1, 1)

    def _check_unused(self, reason: str) -> None:
        """Refuse settings of a released motion for an answer without one, with the reason."""
        given = {"roughness": self.roughness, "duration": self.duration, "interval": self.interval or None}
        given |= {f"in_tube.{name}": self.in_tube.model_dump()[name] for name in self.in_tube.model_fields_set}
        for name, value in given.items():
            if value is not None:
                why = f" ({reason})" if reason else ""
                raise InputError(
                    f"{name} = {str(value)[:40]} is of released motion in the tube, which this request does not "
                    f"compute{why}; allowed: with model 'tube', without tail rate and motion 'held'"
                )
