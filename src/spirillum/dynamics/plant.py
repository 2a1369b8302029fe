"""A robot's motion step by step, with remote, duty and flow in hand: what a controller, or a page, drives.

A step is a piece of the run that `spirillum.simulate` computes: the same start, equations, integrator and tolerances,
continued from where the last piece ended.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from spirillum.argument_validation import as_duty, as_number, as_step, check_kind, validate_arguments
from spirillum.arrays import Samples
from spirillum.dynamics.free_robot import FreeRobot, TwoLinks, two_links
from spirillum.dynamics.integration import BATTERY_EMPTY, INTERRUPTED, Checkpoint, Reach, Trajectory, integrate
from spirillum.dynamics.record import series_of, tail_angle_of
from spirillum.dynamics.release import InTube, Release, reach_of, released_state, resting_state
from spirillum.dynamics.rotating_field import Field, TurningField
from spirillum.dynamics.run_file import RobotPose
from spirillum.dynamics.timing import Switch
from spirillum.dynamics.tube_robot import TubeRobot
from spirillum.dynamics.tube_run import series_in_tube
from spirillum.dynamics.tube_simulation import check_in_tube, links_in_tube
from spirillum.errors import InputError
from spirillum.fitted.fit import Fit, read_fit
from spirillum.fluid.registry import find_swimmer_model
from spirillum.kernels import core
from spirillum.notes import Note
from spirillum.progress import Progress
from spirillum.robot.batch import RobotBatch
from spirillum.robot.limits import check_stokes_flow, flow_limit, motion_limits
from spirillum.robot.load import load
from spirillum.robot.placement import Placement
from spirillum.robot.robot import Robot
from spirillum.swimming.motions import check_full
from spirillum.swimming.prediction import Prediction, predict_steady
from spirillum.swimming.preparation import AUTO, choose_model, table_for
from spirillum.units import KINDS, as_given, parse_option

_LONGEST = 1e6  # The longest step, s.
_TURN = 2.0 * np.pi


@dataclass(frozen=True)
class Snapshot:
    """A robot at one moment of its run, SI."""

    time: float
    pose: RobotPose
    values: dict[str, float]  #: Quantities by name, SI; NaN where one has no value.
    ended: str  #: Why the run ended, in half a sentence; empty while it continues.


@dataclass(frozen=True)
class PlantState:
    """Complete state for the next step of a plant, SI; another plant of the same robot can continue from it."""

    time: float
    state: tuple[float, ...]
    duty: float  #: Duty of the last step, which the drive has.
    command: float  #: Duty of the next step if none is given.
    flow: float | None  #: Mean flow that is imposed, m/s; None: none is.
    field: TurningField | None  #: Field that turns the robot; None for another drive.
    spent: bool
    ended: str  #: Why the run has ended; empty while it continues.
    azimuth: float  #: Azimuth counted over whole turns, rad.
    checkpoint: Checkpoint | None  #: Beginning of the integrator's last step.
    model: str


def uninterrupted(moment: Snapshot) -> Snapshot:
    """The moment at the end of a step of a look ahead; an interrupt of the step is raised as `KeyboardInterrupt`."""
    if moment.ended == INTERRUPTED:
        raise KeyboardInterrupt
    return moment


class Plant:
    """A free robot in motion from rest, one step at a time; not thread-safe."""

    @validate_arguments
    def __init__(
        self,
        robot: str | Path | Mapping[str, Any] | Robot,
        *,
        model: str = AUTO,
        friction: str | None = None,
        calibrated: bool = True,
        calibration: str | Path | Fit | None = None,
        placement: Placement | Mapping[str, Any] | None = None,
        weight: bool = True,
        roughness: str | float | None = None,
        in_tube: InTube | Mapping[str, Any] | None = None,
        progress: Progress | None = None,
    ) -> None:
        """Release a robot from rest.

        Args:
            robot: a preset's name, a robot file, its tables, or a loaded robot, with a drive.
            model: `tube`, `slender` or `rft`; or `auto`: `tube` for a robot in a channel, else `slender`.
            friction: friction model; None: the robot's own.
            calibrated: apply the robot's calibration factors for this model.
            calibration: calibration file, or a fit read from one, whose factors replace the robot's.
            placement: `gap` or `eccentricity`, and `pitch`; with `tube` also yaw, ends and an imposed flow.
            weight: let weight and buoyancy act, if the masses are known.
            roughness: of the wall, with its unit or a float in m; None: 1e-4 of the body's radius.
            in_tube: with `tube`: `azimuth`, `friction_coefficient`, and `flow` over time, see `InTube`.
            progress: called while a table is made.

        Raises:
            InputError: for wrong input, or a robot or a pose outside the model's domain.
        """
        release = self._release = Release.of(placement, in_tube, roughness, weight=weight)
        own = load(robot)
        if own.drive is None:
            raise InputError(f"{own.name} has no [drive]; allowed: a robot with one")
        fit = read_fit(calibration)
        chosen = choose_model(model, own, placement=release.placement, fit=fit)
        walled = chosen.model == "tube"
        if not walled:
            check_full(find_swimmer_model(chosen.model))
        if release.in_tube.wait:
            raise InputError("in_tube.wait is given to a plant; allowed: a step with the remote off")
        if not walled and release.in_tube != InTube():
            raise InputError(f"in_tube is given with model '{chosen.model}'; allowed: only with model 'tube'")
        if walled:
            check_in_tube(own, release)
        self.steady: Prediction = predict_steady(
            own,
            model=chosen,
            friction=friction,
            calibrated=calibrated,
            fit=fit,
            placement=release.placement if walled else None,
            band=False,
        )
        """The steady state of the robot held where it starts, by the same model."""
        self.warnings: tuple[Note, ...] = self.steady.warnings
        """What to be careful about, a sentence each; a step that leaves Stokes flow adds to them."""
        self._inertia: tuple[str, ...] = ()
        self._table = table_for(RobotBatch.of(own, release.placement), progress=progress).packed if walled else None
        self._reach = reach_of(own)
        self._links: FreeRobot
        if self._table is None:
            self._links = without_walls = two_links(self.steady, release.roughness, weight=weight)
            first = resting_state(own, without_walls, release.placement)
        else:
            self._links = links = links_in_tube(self.steady, self._table, release)
            first = released_state(own, links, release.placement, release.in_tube.azimuth)
        on = own.drive.duty
        self._first = PlantState(
            time=0.0,
            state=tuple(first.tolist()),
            duty=on,
            command=on,
            flow=release.placement.flow,
            field=TurningField.of(self._links),
            spent=False,
            ended="",
            azimuth=0.0,
            checkpoint=None,
            model=self.model,
        )
        self._now = self._first

    @property
    def robot(self) -> Robot:
        """The robot."""
        return self.steady.robot

    @property
    def model(self) -> str:
        """Name of the hydrodynamic model."""
        return self.steady.model.name

    @property
    def state(self) -> PlantState:
        """All that the next step follows from."""
        return self._now

    @property
    def links(self) -> FreeRobot:
        """What the robot's rates follow from."""
        return self._links

    @property
    def reach(self) -> Reach:
        """What ends a run, or its drive."""
        return self._reach

    @property
    def roughness(self) -> float | None:
        """Height of the wall's asperities, m; None without a wall."""
        links = self._links
        return None if isinstance(links, TwoLinks) and not links.is_walled else links.roughness

    def reset(self, state: PlantState | None = None) -> Snapshot:
        """Go back to rest at the start, or to a state that was noted.

        Args:
            state: of this plant, or of another one of the same robot, model and surroundings; None: the start.

        Raises:
            InputError: for a state of another kind of plant.
        """
        state = self._first if state is None else state
        check_kind("state", state, "PlantState")
        if state.model != self.model:
            raise InputError("state is none of this plant; allowed: its own, or that of the same robot and model")
        if state.flow != self._now.flow:
            self._impose(state.flow)
        if state.field is not None:
            self._links = state.field.on(self._links)
        self._now = state
        return self.observe()

    def copy(self) -> Plant:
        """An independent plant in the same state; geometry and table are shared."""
        return copy.copy(self)

    def step(
        self,
        dt: float,
        *,
        remote: bool | None = None,
        duty: float | None = None,
        flow: str | float | None = None,
        field: Field | Mapping[str, Any] | None = None,
    ) -> Snapshot:
        """Advance by a time; what is not given stays as it was, and at first the drive is on.

        Args:
            dt: s, positive. The run ends earlier at the end of the channel, or of the table's range.
            remote: switch the drive on (at the robot's own duty) or off.
            duty: of the drive instead, 0 (off) to 1.
            flow: with `tube`, the mean flow that is imposed from now on, with its unit or a float in m/s.
            field: for a magnetic robot, what changes of the field that turns it: `rotation_rate`, `yaw` and `pitch` of
                its axis, `strength`, see `Field`.

        Returns:
            The moment at the end of the step; `ended` gives the reason if it came early.

        Raises:
            InputError: for wrong input, a run that has ended, or a motion far outside Stokes flow; nothing has then
                moved.
        """
        dt = as_step(dt, _LONGEST)
        if self._now.time + dt == self._now.time:
            raise InputError(f"dt = {dt:g} s is none at t = {self._now.time:g} s; allowed: above its rounding error")
        if self._now.ended:
            raise InputError(f"the run has ended: {self._now.ended}; allowed: reset")
        before = (self._now, self._links)
        command = self._commanded(remote=remote, duty=duty)
        asked_field = None if field is None else Field.of(field)
        if asked_field is not None and self._now.field is None:
            raise InputError(f"field is given to {self.robot.name}; allowed: a robot with drive.kind 'magnetic'")
        if flow is not None:
            self.impose_flow(parse_option("flow", flow, KINDS["velocity"]))
        if asked_field is not None:
            self.impose_field(asked_field)
        requested = 0.0 if self._now.spent else command
        run = self._moved(dt, requested)
        try:
            self._check_stokes(run)
        except InputError:
            self._now, self._links = before
            raise
        spent = self._now.spent or any(event.what == BATTERY_EMPTY for event in run.events)
        ended = ""
        if run.time[-1] < (self._now.time + dt) * (1.0 - 1e-9):
            ended = run.events[-1].what if run.events else "the equations have no next step"
        self._now = replace(
            self._now,
            time=float(run.time[-1]),
            state=tuple(run.states[-1].tolist()),
            duty=requested,
            command=command,
            spent=spent,
            ended=ended,
            azimuth=self._azimuth(run),
            checkpoint=run.last,
        )
        return self._moment(run)

    def observe(self) -> Snapshot:
        """The robot where it is: pose and true values of its quantities."""
        now, state = self._now, np.array([self._now.state])
        time = np.array([now.time])
        observed = self._links.at_duty(now.duty).observe(time, state)
        return self._moment(Trajectory(time, np.full(1, now.duty), state, observed, (), Checkpoint(0.0, 0.0, ())))

    @validate_arguments
    def impose_flow(self, velocity: float | None) -> None:
        """From now on another mean flow is imposed.

        Args:
            velocity: m/s; None: none is, and the ends of the tube decide.

        Raises:
            InputError: for a velocity that is not finite, or a model without one.
        """
        if velocity is not None and not math.isfinite(as_number(velocity)):
            raise InputError(f"velocity = {as_given(velocity, 'm/s')}; allowed: a finite number of m/s, or None")
        if velocity == self._now.flow:
            return
        self._impose(velocity)
        self._now = replace(self._now, flow=velocity, checkpoint=self._begun_anew())

    @validate_arguments
    def impose_field(self, asked: Field) -> None:
        """From now on the field of a magnetic robot is another one; its angle does not jump.

        Args:
            asked: what changes of it.

        Raises:
            InputError: for a robot that no field turns.
        """
        old = self._now.field
        if old is None:
            raise InputError(f"{self.robot.name} has no magnet: no field turns it; allowed: drive.kind = 'magnetic'")
        field = old.changed(asked, self._now.time)
        if field != old:
            self._links = field.on(self._links)
            self._now = replace(self._now, field=field, checkpoint=self._begun_anew())

    def _check_stokes(self, run: Trajectory) -> None:
        """Add what a step breaks of Stokes flow to the warnings, once for each limit."""
        seen, batch = run.observed, self.steady.batch
        rates = seen[:, core.SPIN] + seen[:, core.JOINT]
        limits = motion_limits(batch, seen[:, : core.SPIN], rates)
        limits.append(flow_limit(batch, abs(self._now.flow or 0.0)))
        new = {flag: note for flag, note in check_stokes_flow(batch, limits).items() if flag not in self._inertia}
        self._inertia += tuple(new)
        self.warnings += tuple(new.values())

    def _begun_anew(self) -> Checkpoint | None:
        """Beginning of the next step of the integrator: here, for the last one was taken under other conditions."""
        kept = self._now.checkpoint
        return None if kept is None else Checkpoint(self._now.time, kept.step, self._now.state)

    def _impose(self, velocity: float | None) -> None:
        if self._table is None:
            if velocity is not None:
                raise InputError("flow is known only to model 'tube'; allowed: another model, or no flow")
            return
        placed = self._release.placement.model_copy(update={"flow": velocity})
        links = links_in_tube(self.steady, self._table, self._release._replace(placement=placed))
        self._links = links if self._now.field is None else self._now.field.on(links)

    def _commanded(self, *, remote: bool | None, duty: float | None) -> float:
        """Commanded duty."""
        if remote is not None and duty is not None:
            raise InputError("remote and duty are given together; allowed: one of them")
        if remote is not None:
            if not isinstance(remote, (bool, np.bool_)):
                raise InputError(f"remote = {str(remote)[:40]}; allowed: True or False")
            return self._first.command if remote else 0.0
        return self._now.command if duty is None else as_duty(duty)

    def _moved(self, dt: float, duty: float) -> Trajectory:
        now = self._now
        times = np.array([now.time, now.time + dt])
        switches = [Switch(now.time, duty)]
        if now.checkpoint is not None:  # its last step is taken again, as far as it exceeds the requested time
            old = [] if now.checkpoint.time == now.time else [Switch(now.checkpoint.time, now.duty)]
            switches = [*old, *(switches if duty != now.duty or not old else [])]
        start = now.checkpoint or np.array(now.state)
        return integrate(self._links, start, times, switches, self._reach)

    def _azimuth(self, run: Trajectory) -> float:
        if not isinstance(self._links, TubeRobot):
            return 0.0
        found = float(run.observed[-1, core.SEEN_AZIMUTH])
        return found + _TURN * round((self._now.azimuth - found) / _TURN)

    def _moment(self, run: Trajectory) -> Snapshot:
        series: dict[str, Samples] = dict(series_of(self.steady, self._links, run))
        series["tail_angle"] = tail_angle_of(run.states, self._first.state[core.STATE_PHASE])
        if isinstance(self._links, TubeRobot):
            series |= series_in_tube(run) | {"azimuth": np.array([self._azimuth(run)])}
        elif self.roughness is not None:
            series["wall_gap"] = run.observed[:, core.SEEN_FILM] + self.roughness
        state = run.states[-1]
        attitude = state[core.STATE_ATTITUDE : core.STATE_ATTITUDE + 4]
        pose = RobotPose(
            state[core.STATE_POSITION : core.STATE_POSITION + 3].copy(),
            attitude / np.linalg.norm(attitude),
            float(state[core.STATE_PHASE]),
        )
        values = {name: float(column[-1]) for name, column in series.items()}
        return Snapshot(float(run.time[-1]), pose, values, self._now.ended)
