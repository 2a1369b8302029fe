"""Tasks to learn: robots in axial motion in the laboratory of `sp.control`, one time step at a time, as plain arrays.

A step is one frame of the camera. What an agent sees is the frame that the camera's latency lets through, with its
errors; what it commands reaches the drive after the remote's delay, or not at all. Nothing here knows Gymnasium.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np

from spirillum.argument_validation import as_number
from spirillum.arrays import Samples
from spirillum.controllers.lab import Lab
from spirillum.dynamics.axial_batch import AxialBatch
from spirillum.errors import InputError
from spirillum.kernels import core
from spirillum.robot.load import load
from spirillum.robot.placement import Placement
from spirillum.robot.robot import Robot
from spirillum.swimming.preparation import AUTO, choose_model
from spirillum.units import KINDS, parse_option

_MM = 1e3
_LARGEST_GOAL = 1e3  # in m, and as a share of a speed
_SEEN_OVER = 0.5  # time over which the observed speed is an average, s
_LATEST_PULSE = 0.9  # share of an episode in which a pulse of flow may begin


class ObservedNumber(NamedTuple):
    """One number of an observation."""

    name: str
    unit: str
    low: float
    high: float


class TaskEnvironment(ABC):
    """Robots with camera, remote and flow; a task adds goal, actions, observation and score."""

    observed: ClassVar[tuple[ObservedNumber, ...]]  #: The numbers of an observation.
    goals: ClassVar[tuple[float, float]]  #: Least and largest goal, unless others are given.
    on_off: ClassVar[bool]  #: Whether an action is 0 (off) or 1 (on); else it is a duty from 0 to 1.

    def __init__(
        self,
        count: int,
        *,
        robot: str | Path | Mapping[str, Any] | Robot = "biorob2012-wide",
        model: str = AUTO,
        friction: str | None = None,
        placement: Placement | Mapping[str, Any] | None = None,
        lab: Lab | str | Path | Mapping[str, Any] | None = None,
        ranges: Mapping[str, Any] | None = None,
        posterior: str | Path | None = None,
        goal: tuple[float, float] | None = None,
        duration: str | float = 20.0,
    ) -> None:
        """Put robots into their laboratory.

        Args:
            count: how many.
            robot: a preset's name, a robot file, its tables, or a loaded robot, with a `dc-motor` drive.
            model: a hydrodynamic model, or `auto`; only `tube` knows the pulse of flow.
            friction: friction model; None: the robot's own.
            placement: where the robots are held, for `tube`.
            lab: camera, meter, remote, pulse, and how unknown the friction is, as for `sp.control`.
            ranges: what robots are drawn from besides, see `AxialBatch`; a range of `friction` instead of the lab's.
            posterior: file of a calibration's posterior, from whose draws they are taken.
            goal: least and largest goal, between which goals are drawn evenly; None: those of the task.
            duration: of an episode, with its unit or a float in s.
        """
        self.lab = Lab.of(lab)
        self.duration = parse_option("duration", duration, KINDS["time"])
        self.dt = 1.0 / self.lab.camera.fps
        if not self.dt <= self.duration <= 1e5:
            raise InputError(f"duration = {self.duration:g} s; allowed: {self.dt:.3g} to 100000 s")
        loaded, placed = load(robot), Placement.of(placement)
        if loaded.drive is None or loaded.drive.kind != "dc-motor":
            kind = "none" if loaded.drive is None else loaded.drive.kind
            raise InputError(f"drive.kind = '{kind}'; allowed: 'dc-motor', whose current the task measures")
        chosen = choose_model(model, loaded, placement=placed).model
        if chosen == "tube" and self.lab.pulse.velocity and placed.flow is None and placed.ends is None:
            placed = placed.model_copy(update={"flow": 0.0})
        factor = self.lab.unknown.friction_factor
        known = posterior is not None or factor == 1.0
        drawn = {**({} if known else {"friction": (1.0 / factor, factor)}), **(ranges or {})}
        self.plants = AxialBatch(
            loaded, count, model=chosen, friction=friction, placement=placed, ranges=drawn, posterior=posterior
        )
        self.steps = np.zeros(count, dtype=np.int64)
        self.length = max(1, round(self.duration / self.dt))  #: Steps of an episode.
        late, slow = round(self.lab.camera.latency / self.dt), max(1, round(_SEEN_OVER / self.dt))
        self._late, self._slow = late, slow
        self._frames, self._commands = (  # the last values of all robots, the latest last
            deque([np.zeros(count) for _ in range(length)], length)
            for length in (late + slow + 1, round(self.lab.remote.delay / self.dt) + 1)
        )
        self._sent: Samples = np.zeros(count)
        self._wander, self._scale, self._gain = np.zeros(count), np.ones(count), np.ones(count)
        self._pulse_start, self._pulse = np.zeros(count), np.zeros(count)
        self._goal_range = _range_of("goal", self.goals if goal is None else goal)
        self.goal = np.zeros(count)  #: The goal of each robot, SI.

    @property
    def count(self) -> int:
        """Number of robots."""
        return self.plants.count

    @property
    def position(self) -> Samples:
        """True positions, m."""
        return self.plants.states[:, core.AXIAL_STATE_POSITION]

    @property
    def speed(self) -> Samples:
        """True speeds, m/s."""
        return self.plants.observe()["forward_velocity"]

    @property
    def done(self) -> np.ndarray:
        """Whether the episodes are at their end."""
        return self.steps >= self.length

    def reset(self, which: np.ndarray, rng: np.random.Generator) -> None:
        """New robots, goals, errors and flow where `which` is true, at rest with the drive off."""
        new, lab = int(which.sum()), self.lab
        self.plants.redraw(which, rng)
        self.plants.reset(which)
        self.steps[which] = 0
        for values in (*self._frames, *self._commands):
            values[which] = 0.0
        self._sent[which] = 0.0
        self._wander[which] = rng.standard_normal(new)
        self._scale[which] = 1.0 + lab.camera.scale_error * rng.standard_normal(new)
        self._gain[which] = 1.0 + lab.meter.gain_error * rng.standard_normal(new)
        place, side = rng.uniform(size=(2, new))
        start = lab.pulse.start
        self._pulse_start[which] = _LATEST_PULSE * self.duration * place if start is None else start
        sense = np.where(side < 0.5, 1.0, -1.0) if start is None else 1.0
        self._pulse[which] = lab.pulse.velocity * sense
        self.goal[which] = self._goal_scale() * rng.uniform(*self._goal_range, new)

    def step(self, actions: np.ndarray, rng: np.random.Generator) -> Samples:
        """One frame; the reward of each robot: minus its score, times the step in s."""
        self._sent = self._duty(actions)
        lost = rng.random(self.count) < self.lab.remote.lost
        self._commands.append(np.where(lost, self._commands[-1], self._sent))
        self.plants.step(self.dt, duty=self._commands[0], flow=self._flow())
        self.steps += 1
        self._film(rng)
        return -self.scores() * self.dt

    def observe(self, rng: np.random.Generator) -> np.ndarray:
        """What each agent sees, (count, len(observed)), 32-bit floats."""
        seen = np.empty((self.count, len(self.observed)), dtype=np.float32)
        for column, (item, values) in enumerate(zip(self.observed, self._observation(rng), strict=True)):
            np.clip(values, item.low, item.high, out=seen[:, column], casting="same_kind")
        return seen

    @abstractmethod
    def scores(self) -> Samples:
        """How far each robot is from its goal now; the score of an episode is that at its end."""

    @abstractmethod
    def _goal_scale(self) -> float:
        """What a goal of 1 is in SI."""

    @abstractmethod
    def _observation(self, rng: np.random.Generator) -> list[Samples]:
        """The numbers of `observed`, each (count,), before they are cut off at their bounds."""

    def _duty(self, actions: Any) -> Samples:
        try:
            values = np.asarray(actions, dtype=np.float64).reshape(-1)
        except (TypeError, ValueError, OverflowError):
            values = np.empty(0)
        allowed = np.isin(values, (0, 1)) if self.on_off else (values >= 0.0) & (values <= 1.0)
        if len(values) != self.count or not allowed.all():
            words = "0 (off) or 1 (on)" if self.on_off else "a duty from 0 to 1"
            raise InputError(f"action = {str(actions)[:40]}; allowed: {words} for each of {self.count} robots")
        return values * self.plants.axial.duty if self.on_off else values

    def _flow(self) -> Samples | None:
        if self.plants.axial.flow is None:
            return None
        since = self.plants.time + 0.5 * self.dt - self._pulse_start
        return self.plants.axial.flow + np.where((since >= 0.0) & (since < self.lab.pulse.duration), self._pulse, 0.0)

    def _film(self, rng: np.random.Generator) -> None:
        """A new frame: the last row of the frames; one that is lost shows what the one before did."""
        camera, count = self.lab.camera, self.count
        noise, lost = rng.standard_normal((2, count)), rng.random(count) < camera.dropped
        kept = np.exp(-self.dt / camera.memory)
        self._wander = kept * self._wander + np.sqrt(1.0 - kept**2) * noise[1]
        place = self._scale * self.position + camera.position_noise * noise[0] + camera.position_wander * self._wander
        self._frames.append(np.where(lost, self._frames[-1], place))

    def _seen(self) -> tuple[Samples, Samples]:
        """Position and speed as the camera measures them now, m and m/s."""
        last = self._frames[-1 - self._late]
        return last, (last - self._frames[0]) / (self._slow * self.dt)

    def _time_left(self) -> Samples:
        return 1.0 - self.steps / self.length


class StopAt(TaskEnvironment):
    """Stop at a goal, whose distance in m is sampled, with a remote that is on or off."""

    observed = (
        ObservedNumber("distance", "mm", -100.0, 100.0),
        ObservedNumber("speed", "mm/s", -20.0, 20.0),
        ObservedNumber("command", "1", 0.0, 1.0),
        ObservedNumber("time_left", "1", 0.0, 1.0),
    )
    goals = (1e-3, 6e-3)
    on_off = True

    def scores(self) -> Samples:
        """Distance from the goal, mm."""
        return _MM * np.abs(self.position - self.goal)

    def _goal_scale(self) -> float:
        return 1.0

    def _observation(self, rng: np.random.Generator) -> list[Samples]:  # noqa: ARG002 - no sensor but the camera
        place, speed = self._seen()
        return [_MM * (self.goal - place), _MM * speed, (self._sent > 0).astype(float), self._time_left()]


class HoldSpeed(TaskEnvironment):
    """Swim at a speed, sampled as a share of the steady speed of the robot of the file, by the drive's duty."""

    observed = (
        ObservedNumber("target", "mm/s", -20.0, 20.0),
        ObservedNumber("speed", "mm/s", -20.0, 20.0),
        ObservedNumber("current", "mA", -10.0, 10_000.0),
        ObservedNumber("duty", "1", 0.0, 1.0),
        ObservedNumber("time_left", "1", 0.0, 1.0),
    )
    goals = (0.3, 0.8)
    on_off = False

    def scores(self) -> Samples:
        """Relative error of the speed."""
        return np.abs(self.speed / self.goal - 1.0)

    def _goal_scale(self) -> float:
        return self.plants.axial.prediction.forward_velocity

    def _observation(self, rng: np.random.Generator) -> list[Samples]:
        noise = self.lab.meter.current_noise * rng.standard_normal(self.count)
        current = self._gain * np.abs(self.plants.states[:, core.AXIAL_STATE_CURRENT]) + noise
        return [_MM * self.goal, _MM * self._seen()[1], _MM * current, self._sent, self._time_left()]


TASKS: dict[str, type[TaskEnvironment]] = {"spirillum/StopAt-v0": StopAt, "spirillum/HoldSpeed-v0": HoldSpeed}
"""Tasks by the names of their environments."""


def _range_of(name: str, given: Any) -> tuple[float, float]:
    pair = tuple(given) if isinstance(given, (tuple, list)) and len(given) == 2 else ()
    low, high = map(as_number, pair or (None, None))
    if not 0.0 < low <= high < _LARGEST_GOAL:
        raise InputError(
            f"{name} = {str(given)[:60]}; allowed: least and largest value, above 0 and below {_LARGEST_GOAL:g}"
        )
    return low, high
