"""A robot's motion step by step, with the remote, the duty and the flow in hand: what the page drives.

A step is a piece of `spirillum.simulate`'s own run: the same equations, integrator and tolerances, continued from where
the last piece ended.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from spirillum.arrays import Samples
from spirillum.dynamics.integration import BATTERY_EMPTY, Trajectory, integrate
from spirillum.dynamics.poses import Pose
from spirillum.dynamics.record import series_of
from spirillum.dynamics.remote import Switch
from spirillum.dynamics.start import reach_of, start_state
from spirillum.dynamics.tube_integration import Checkpoint, TubeTrajectory, integrate_in_tube, observed_at
from spirillum.dynamics.tube_options import InTube
from spirillum.dynamics.tube_robot import TubeRobot
from spirillum.dynamics.tube_run import series_in_tube
from spirillum.dynamics.tube_simulation import links_in_tube
from spirillum.dynamics.tube_start import check_in_table, check_roughness, laid_down
from spirillum.dynamics.two_links import TwoLinks, two_links
from spirillum.errors import InputError
from spirillum.fluid.tube.table import TubeTable
from spirillum.kernels import rigid_links
from spirillum.kernels import tube_motion as tube
from spirillum.kernels import two_links as kernel
from spirillum.robot.placement import Placement
from spirillum.robot.robot import Robot
from spirillum.swimming.prediction import Prediction, predict
from spirillum.swimming.preparation import table_for

__all__ = ["Moment", "SteppedMotion"]


_AT_ONCE = 1e-9
"""A time in which nothing moves, s."""


@dataclass(frozen=True)
class Moment:
    """A robot at one moment of its run."""

    time: float
    """s."""
    pose: Pose
    """Where it is and how it lies."""
    values: dict[str, float]
    """Quantities by name, SI; NaN where one has no value."""
    ended: str
    """Why the run ended here, in half a sentence; empty while it goes on."""


class SteppedMotion:
    """A free robot on its way, from rest; one writer, no threads."""

    def __init__(
        self,
        robot: Robot,
        *,
        model: str,
        placement: Placement,
        roughness: float | None = None,
        friction_coefficient: float | None = None,
    ) -> None:
        """Lay a robot down.

        Args:
            robot: a checked robot with a drive.
            model: `tube` (the robot has a table), `slender` or `rft`.
            placement: where it is laid down; with `tube` also ends and an imposed flow.
            roughness: height of the wall's asperities, m; None: 1e-4 of the body's radius.
            friction_coefficient: of dry contact, with `tube`; None: 0.1.

        Raises:
            InputError: for a robot or a place that the model does not know.
        """
        self.robot = robot
        self._placed, self._rough = placement, roughness
        self._asked = InTube.of({"friction_coefficient": friction_coefficient} if model == "tube" else None)
        walled = model == "tube"
        self.steady: Prediction = predict(robot, model=model, placement=placement if walled else None, band=False)
        self._reach = reach_of(robot)
        self._time, self._duty, self._spent = 0.0, 0.0, False
        self._checkpoint: Checkpoint | None = None
        self._table: TubeTable | None = None
        self._links: TubeRobot | TwoLinks
        if walled:
            self._table = table_for(self.steady.batch, workers=1)
            links, start = links_in_tube(self.steady, self._table, placement, self._asked, roughness, weight=True)
            self._links, self._state = links, laid_down(robot, links, start)
            check_roughness(links.roughness, float(links.gaps(self._state).min()))
            check_in_table(links, self._state, observed_at(links, self._state)[tube.OUTSIDE])
        else:
            effective = self.steady.effective_friction
            self._links = two_links(
                robot,
                self.steady.batch,
                self.steady.model,
                friction=self.steady.friction,
                effective=0.0 if np.isnan(effective) else effective,
                calibrated=True,
                weight=True,
                roughness=roughness,
            )
            lying = float(self._links.weight[: rigid_links.MOMENT_BODY].sum()) > 0
            self._state = start_state(robot, placement, lying=lying)
        self._ended = ""
        self._azimuth = 0.0

    @property
    def roughness(self) -> float | None:
        """Height of the wall's asperities, m; None without a wall."""
        if isinstance(self._links, TubeRobot):
            return float(self._links.roughness)
        found = float(self._links.wall[kernel.ROUGHNESS])
        return found if np.isfinite(self._links.wall[kernel.RADIUS]) else None

    def flow(self, velocity: float | None) -> None:
        """From now on another mean flow is imposed, m/s; None: none is (with `tube`).

        Raises:
            InputError: for a model that knows none.
        """
        if self._table is None:
            if velocity is not None:
                raise InputError("placement.flow is known only to model 'tube'; allowed: another model, or no flow")
            return
        placed = self._placed.model_copy(update={"flow": velocity})
        self._links, _ = links_in_tube(self.steady, self._table, placed, self._asked, self._rough, weight=True)
        if self._checkpoint is not None:  # the last step was taken with the old flow
            self._checkpoint = Checkpoint(self._time, self._checkpoint.step, tuple(self._state.tolist()))

    def step(self, dt: float, duty: float) -> Moment:
        """Go on for a time.

        Args:
            dt: s, positive.
            duty: of the drive, 0 (off) to 1.
        """
        if self._ended:
            raise InputError(f"the run has ended: {self._ended}; allowed: a new start")
        asked = 0.0 if self._spent else duty
        run = self._in_tube(dt, asked) if isinstance(self._links, TubeRobot) else self._without_walls(dt, asked)
        before = self._time
        self._duty, self._time, self._state = asked, float(run.time[-1]), run.states[-1].copy()
        self._note(run, before + dt)
        return self._moment(run)

    def now(self) -> Moment:
        """The robot where it is, before a step."""
        if isinstance(self._links, TubeRobot):
            time, states = np.array([self._time]), self._state[None].copy()
            observed = np.empty((1, tube.OBSERVED))
            tube.observe(time, states, self._links.at_duty(self._duty).data, self._links.table, observed)
            last = Checkpoint(0.0, 0.0, ())
            return self._moment(TubeTrajectory(time, np.full(1, self._duty), states, observed, (), last))
        links = self._links.at_duty(self._duty)
        times = np.array([self._time, self._time + _AT_ONCE])
        return self._moment(integrate(links, self._state, times, [Switch(self._time, self._duty)], self._reach))

    def _in_tube(self, dt: float, duty: float) -> TubeTrajectory:
        assert isinstance(self._links, TubeRobot)  # noqa: S101 - the caller's promise
        going_on = self._checkpoint is not None
        switches = [Switch(self._checkpoint.time if self._checkpoint else self._time, self._duty)]
        if duty != self._duty or not going_on:
            switches = [*(switches if going_on else []), Switch(self._time, duty)]
        times = np.array([self._time, self._time + dt])
        run = integrate_in_tube(self._links, self._checkpoint or self._state, times, switches, self._reach)
        self._checkpoint = run.last
        return run

    def _without_walls(self, dt: float, duty: float) -> Trajectory:
        assert isinstance(self._links, TwoLinks)  # noqa: S101 - the caller's promise
        times = np.array([self._time, self._time + dt])
        return integrate(self._links, self._state, times, [Switch(self._time, duty)], self._reach)

    def _note(self, run: Trajectory, asked: float) -> None:
        """What happened in a step that was to last until a time."""
        self._spent = self._spent or any(event.what == BATTERY_EMPTY for event in run.events)
        if run.time[-1] < asked - 1e-9 * asked:
            self._ended = run.events[-1].what if run.events else "the equations have no next step"

    def _moment(self, run: Trajectory) -> Moment:
        series: dict[str, Samples] = dict(series_of(self.steady, self._links, run))
        if isinstance(run, TubeTrajectory):
            series |= series_in_tube(run)
            turns = np.round((self._azimuth - series["azimuth"][-1]) / (2.0 * np.pi))
            self._azimuth = float(series["azimuth"][-1] + 2.0 * np.pi * turns)
            series["azimuth"] = np.array([self._azimuth])
        elif isinstance(self._links, TwoLinks) and np.isfinite(self._links.wall[kernel.RADIUS]):
            series["wall_gap"] = run.observed[:, rigid_links.FILM] + self._links.wall[kernel.ROUGHNESS]
        state = run.states[-1]
        attitude = state[rigid_links.ATTITUDE : rigid_links.ATTITUDE + 4]
        pose = Pose(
            state[rigid_links.POSITION : rigid_links.POSITION + 3].copy(),
            attitude / np.linalg.norm(attitude),
            float(state[rigid_links.PHASE]),
        )
        values: dict[str, Any] = {name: float(column[-1]) for name, column in series.items()}
        return Moment(float(run.time[-1]), pose, values, self._ended)
