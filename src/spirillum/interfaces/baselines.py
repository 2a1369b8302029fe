"""What simple rules score in the tasks: the line that something learnt has to pass."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from spirillum.errors import InputError, did_you_mean
from spirillum.interfaces.tasks import TASKS, HoldSpeed, StopAt, TaskEnvironment

_LEAD = 0.17
"""Look-ahead of `lead`, s: the usual latency of camera and remote together."""
_GAIN = 1.0
"""Of `integral`: change of the duty per second for a relative error of 1."""

Rule = Callable[[np.ndarray, TaskEnvironment], np.ndarray]


def _off(seen: np.ndarray, task: TaskEnvironment) -> np.ndarray:
    return np.zeros(len(seen) if task.on_off else (len(seen), 1))


def _bang_bang(seen: np.ndarray, _task: TaskEnvironment) -> np.ndarray:
    return (seen[:, 0] > 0).astype(np.int64)


def _lead(seen: np.ndarray, _task: TaskEnvironment) -> np.ndarray:
    return (seen[:, 0] > _LEAD * seen[:, 1]).astype(np.int64)


def _own(seen: np.ndarray, task: TaskEnvironment) -> np.ndarray:
    return np.full((len(seen), 1), task.plants.axial.duty)


def _integral(seen: np.ndarray, task: TaskEnvironment) -> np.ndarray:
    wrong = 1.0 - seen[:, 1] / seen[:, 0]
    duty = seen[:, 3] + _GAIN * task.dt * np.clip(wrong, -1.0, 1.0)
    return np.asarray(np.clip(duty, 0.0, 1.0)[:, None])


RULES: Mapping[type[TaskEnvironment], Mapping[str, Rule]] = {
    StopAt: {"nothing": _off, "bang-bang": _bang_bang, "lead": _lead},
    HoldSpeed: {"nothing": _off, "always-on": _own, "integral": _integral},
}
"""Rules by task and name, from what is seen to actions."""


class Scored(NamedTuple):
    """Scores of many episodes."""

    scores: np.ndarray
    """At the end of each."""
    mean: float
    """Their mean."""
    margin: float
    """Half the width of its 95 % interval."""
    reward: float
    """Mean of the rewards of an episode, summed."""


def baseline(task: str, rule: str, *, episodes: int = 1000, seed: int = 0, **options: Any) -> Scored:
    """What a rule scores, over robots, goals, flow and errors that a seed draws, alike for every rule."""
    if task not in TASKS:
        raise InputError(f"task = {task[:60]!r}{did_you_mean(task, TASKS)}; allowed: {', '.join(TASKS)}")
    rules = RULES[TASKS[task]]
    if rule not in rules:
        raise InputError(f"rule = {rule[:60]!r}{did_you_mean(rule, rules)}; allowed: {', '.join(rules)}")
    if not 2 <= episodes <= 1_000_000:
        raise InputError(f"episodes = {episodes}; allowed: 2 to 1000000")
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
