"""A request for the released motions beside a held answer: where they exist, and how they are computed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from spirillum.dynamics.timing import TRIAL_DURATION
from spirillum.dynamics.trial import steady_of, trial_of, why_not_released
from spirillum.dynamics.trial_unknowns import TrialSample, open_unknowns, samples_of, with_interval
from spirillum.dynamics.tube_options import InTube, with_contact
from spirillum.errors import InputError
from spirillum.fitted.fit import Fit, read_fit
from spirillum.robot.load import with_resolution
from spirillum.robot.model_options import Resolution
from spirillum.robot.placement import Placement
from spirillum.robot.robot import Robot
from spirillum.swimming.model_choice import WALLED
from spirillum.swimming.prediction import Prediction
from spirillum.swimming.released_motion import ReleasedMotion


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
        if reason:
            return replace(held, released=dict.fromkeys(("trial", "steady"), partial(ReleasedMotion, reason=reason)))
        return replace(held, released={"trial": partial(self.trial, held), "steady": self.steady})

    def trial(self, held: Prediction) -> ReleasedMotion:
        """Return the trial, with its interval where that is requested."""
        nominal = self._run(held)
        return self._with_interval(held, nominal) if self.interval else nominal

    def steady(self) -> ReleasedMotion:
        """Return the steady motion."""
        from spirillum.dynamics.free_motion import free_motion  # its equations are compiled

        still, shared = self.in_tube.model_copy(update={"wait": None}), self._shared()
        fit = read_fit(shared.pop("calibration"))
        return steady_of(lambda: free_motion(self._resolved(), in_tube=still, fit=fit, **shared).prediction)

    def _run(self, held: Prediction, **sampled: Any) -> ReleasedMotion:
        """The trial, with some settings of a sample in place of those of the request."""
        from spirillum.dynamics.simulation import simulate  # its equations are compiled

        settings = {"robot": self._resolved(), "in_tube": self.in_tube, **self._shared(), **sampled}
        timing = {} if self.duration is None else {"duration": self.duration}
        return trial_of(
            held,
            lambda: simulate(model=WALLED, calibrated=self.calibrated, timing=timing, **settings),
            TRIAL_DURATION if self.duration is None else self.duration,
        )

    def _shared(self) -> dict[str, Any]:
        """What all runs take of the request."""
        names = ("friction", "calibration", "placement", "roughness", "progress")
        return {name: getattr(self, name) for name in names}

    def _resolved(self) -> Robot:
        """The robot with the requested resolution, which a run refuses: the reason of its column."""
        return with_resolution(self.robot, self.resolution, WALLED)

    def _with_interval(self, held: Prediction, nominal: ReleasedMotion) -> ReleasedMotion:
        """The trial with its interval over what neither robot, request nor calibration states."""
        robot = self.fit.central(self.robot)
        rough, touching = with_contact(self.fit.contact(), None if self.roughness is None else 1.0, self.in_tube)
        derived = robot.derived().get("submerged_weight")
        weight = 0.0 if derived is None else derived.value
        stated = {
            "wait": self.in_tube.wait,
            "roughness": rough,
            "friction_coefficient": touching.friction_coefficient,
        }
        unknowns = open_unknowns(robot, weight, stated)

        def run(sample: TrialSample) -> ReleasedMotion:
            values = {"wait": sample.wait, "friction_coefficient": sample.friction_coefficient}
            update = {name: value for name, value in values.items() if value is not None}
            more = {} if sample.roughness is None else {"roughness": sample.roughness}
            return self._run(
                held, robot=sample.robot, in_tube=self.in_tube.model_copy(update=update), progress=None, **more
            )

        return with_interval(nominal, samples_of(robot, weight, unknowns), unknowns, run, self.progress)

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
