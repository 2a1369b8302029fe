"""The tasks as environments of Gymnasium, and the baselines: what simple rules score in them.

``gymnasium.make("spirillum.interfaces.environments:spirillum/StopAt-v0")`` imports it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from spirillum.errors import InputError, check_choice, check_range, clipped
from spirillum.interfaces.tasks import TASKS, HoldSpeed, StopAt, TaskEnvironment
from spirillum.scalars import is_whole

_LEAD = 0.17  # look-ahead of `lead`, s: the usual latency of camera and remote together
_GAIN = 1.0  # of `integral`: change of the duty per second for a relative error of 1

Rule = Callable[[np.ndarray, TaskEnvironment], np.ndarray]


def _off(seen: np.ndarray, task: TaskEnvironment) -> np.ndarray:
    return np.zeros(len(seen) if task.on_off else (len(seen), 1))


def _own(seen: np.ndarray, task: TaskEnvironment) -> np.ndarray:
    return np.full((len(seen), 1), task.plants.axial.duty)


def _integral(seen: np.ndarray, task: TaskEnvironment) -> np.ndarray:
    wrong = 1.0 - seen[:, 1] / seen[:, 0]
    duty = seen[:, 3] + _GAIN * task.dt * np.clip(wrong, -1.0, 1.0)
    return np.asarray(np.clip(duty, 0.0, 1.0)[:, None])


RULES: Mapping[type[TaskEnvironment], Mapping[str, Rule]] = {
    StopAt: {
        "nothing": _off,
        "bang-bang": lambda seen, _task: (seen[:, 0] > 0).astype(np.int64),
        "lead": lambda seen, _task: (seen[:, 0] > _LEAD * seen[:, 1]).astype(np.int64),
    },
    HoldSpeed: {"nothing": _off, "always-on": _own, "integral": _integral},
}
"""Rules by task and name, from what is seen to actions."""


class Scored(NamedTuple):
    """Scores of many episodes."""

    scores: np.ndarray  #: At the end of each.
    mean: float  #: Their mean.
    margin: float  #: Half the width of its 95 % interval.
    reward: float  #: Mean of the rewards of an episode, summed.


def baseline(task: str, rule: str, *, episodes: int = 1000, seed: int = 0, **options: Any) -> Scored:
    """What a rule scores, over robots, goals, flow and errors that a seed draws, alike for every rule."""
    check_choice("task", task, TASKS)
    rules = RULES[TASKS[task]]
    check_choice("rule", rule, rules)
    check_range("episodes", episodes, 2, 1_000_000)
    rng, robots = np.random.default_rng(seed), TASKS[task](episodes, **options)
    robots.reset(np.ones(episodes, dtype=bool), rng)
    total, seen = np.zeros(episodes), robots.observe(rng)
    for _ in range(robots.length):
        total += robots.step(rules[rule](seen, robots), rng)
        seen = robots.observe(rng)
    scores = robots.scores()
    return Scored(
        scores, float(scores.mean()), float(1.96 * scores.std(ddof=1) / np.sqrt(episodes)), float(total.mean())
    )


_BAR = 40


def _spaces(task: TaskEnvironment) -> tuple[spaces.Box, spaces.Space[Any]]:
    low, high = (np.array([getattr(item, end) for item in task.observed], dtype=np.float32) for end in ("low", "high"))
    actions = spaces.Discrete(2) if task.on_off else spaces.Box(0.0, 1.0, (1,), dtype=np.float32)
    return spaces.Box(low, high, dtype=np.float32), actions


class Environment(gymnasium.Env[np.ndarray, Any]):
    """One robot and its task."""

    metadata: dict[str, Any] = {"render_modes": ["ansi"], "render_fps": 30}  # noqa: RUF012 - as in the base

    def __init__(self, task: str, render_mode: str | None = None, **options: Any) -> None:
        """A task by its registered name.

        Args:
            task: a key of `spirillum.interfaces.tasks.TASKS`.
            render_mode: `ansi`: a line of text; None.
            options: arguments of the task, see `spirillum.interfaces.tasks`.
        """
        if render_mode not in (None, "ansi"):
            raise InputError(f"render_mode = {clipped(render_mode)}; allowed: ansi or None")
        self._task = _task(task, 1, options)
        self.observation_space, self.action_space = _spaces(self._task)
        self.render_mode = render_mode

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[np.ndarray, Any]:
        """A new robot, goal and flow; see `gymnasium.Env.reset`."""
        _check_seed(seed)
        super().reset(seed=seed, options=options)
        self._task.reset(np.ones(1, dtype=bool), self.np_random)
        return self._task.observe(self.np_random)[0], self._info()

    def step(self, action: Any) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """One frame of the camera; see `gymnasium.Env.step`."""
        reward = self._task.step(action, self.np_random)
        seen = self._task.observe(self.np_random)[0]
        return seen, float(reward[0]), False, bool(self._task.done[0]), self._info()

    def render(self) -> Any:
        """The robot and its goal on a line of text."""
        if self.render_mode != "ansi":
            return None
        goal, place = float(self._task.goal[0]), float(self._task.position[0])
        if isinstance(self._task, HoldSpeed):
            return f"{1e3 * float(self._task.speed[0]):.3f} mm/s, wanted {1e3 * goal:.3f} mm/s"
        line = ["-"] * (_BAR + 1)
        line[min(max(round(0.5 * _BAR * place / goal), 0), _BAR)] = "o"
        line[_BAR // 2] = "x" if line[_BAR // 2] == "o" else "|"
        return "".join(line)

    def _info(self) -> dict[str, Any]:
        return {"score": float(self._task.scores()[0]), "position": float(self._task.position[0])}


class BatchEnvironment(VectorEnv[np.ndarray, np.ndarray, np.ndarray]):
    """Many robots that step together; one that is at its end restarts in the next step."""

    metadata: dict[str, Any] = {"render_modes": [], "autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012

    def __init__(self, task: str, num_envs: int = 1, render_mode: str | None = None, **options: Any) -> None:
        """A task by its registered name.

        Args:
            task: a key of `spirillum.interfaces.tasks.TASKS`.
            num_envs: how many robots.
            render_mode: None.
            options: arguments of the task, see `spirillum.interfaces.tasks`.
        """
        if render_mode is not None:
            raise InputError(f"render_mode = {str(render_mode)[:40]} of a batch; allowed: None")
        self._task = _task(task, num_envs, options)
        self.num_envs, self.render_mode = num_envs, None
        self.single_observation_space, self.single_action_space = _spaces(self._task)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._ended = np.zeros(num_envs, dtype=bool)

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """New robots, goals and flow; see `gymnasium.vector.VectorEnv.reset`. One seed draws all of them."""
        if isinstance(seed, list):
            raise InputError("seed is a list; allowed: one whole number, from which all robots are drawn")
        _check_seed(seed)
        super().reset(seed=seed, options=options)
        self._ended = np.zeros(self.num_envs, dtype=bool)
        self._task.reset(~self._ended, self.np_random)
        return self._task.observe(self.np_random), {}

    def step(self, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """One frame of the camera; see `gymnasium.vector.VectorEnv.step`."""
        began = self._ended
        reward = self._task.step(actions, self.np_random)
        info: dict[str, Any] = {}
        if began.any():
            self._task.reset(began, self.np_random)
            reward = np.where(began, 0.0, reward)
        self._ended = self._task.done
        if self._ended.any():
            info = {"score": np.where(self._ended, self._task.scores(), np.nan), "_score": self._ended.copy()}
        never = np.zeros(self.num_envs, dtype=bool)
        return self._task.observe(self.np_random), reward, never, self._ended.copy(), info


def _check_seed(seed: Any) -> None:
    if seed is not None and (not is_whole(seed) or int(seed) < 0):
        raise InputError(f"seed = {clipped(seed)}; allowed: a whole number from 0, or None")


def _task(name: str, count: int, options: dict[str, Any]) -> TaskEnvironment:
    check_choice("task", name, TASKS)
    try:
        return TASKS[name](count, **options)
    except TypeError as error:  # an option that no task has
        raise InputError(f"{name}: {str(error).partition(') ')[2] or error}; allowed: options of its task") from error


for _name in TASKS:
    if _name not in gymnasium.registry:
        gymnasium.register(
            _name,
            entry_point="spirillum.interfaces.environments:Environment",
            vector_entry_point="spirillum.interfaces.environments:BatchEnvironment",
            kwargs={"task": _name},
        )
