"""A thousand held robots as one batch against a thousand one by one, and as environments of Gymnasium."""

from __future__ import annotations

import json
import time
from collections.abc import Callable

import gymnasium
import numpy as np

import spirillum as sp

COUNT, STEPS, DT = 1000, 300, 1.0 / 30.0
ROBOT = "biorob2012-wide"


def seconds(work: Callable[[], None], repeats: int) -> float:
    """Least processor time of a repetition, s."""
    work()
    found = []
    for _ in range(repeats):
        start = time.process_time()
        work()
        found.append(time.process_time() - start)
    return min(found)


def environment_steps(name: str) -> float:
    """Robot steps a second of an environment's batch form, with random actions."""
    tasks = gymnasium.make_vec(f"spirillum.interfaces.environments:spirillum/{name}-v0", num_envs=COUNT, model="rft")
    tasks.reset(seed=1)
    tasks.action_space.seed(1)
    actions = [tasks.action_space.sample() for _ in range(STEPS)]

    def play() -> None:
        for action in actions:
            tasks.step(action)

    return COUNT * STEPS / seconds(play, 3)


def main() -> None:
    rng = np.random.default_rng(1)
    switched = rng.random((STEPS, COUNT)) < 0.5
    batch = sp.AxialBatch(ROBOT, COUNT, model="rft")
    alone = [sp.AxialBatch(ROBOT, 1, model="rft") for _ in range(COUNT)]
    free = [sp.Plant(ROBOT, model="rft") for _ in range(5)]

    def together() -> None:
        for remote in switched:
            batch.step(DT, remote=remote)

    def one_by_one() -> None:
        for robot, on in zip(alone, switched[0], strict=True):
            robot.step(DT, remote=bool(on))

    def with_six_degrees() -> None:
        for robot, on in zip(free, switched[0], strict=False):
            robot.step(DT, remote=bool(on))

    step = seconds(together, 3) / STEPS
    single = seconds(one_by_one, 3)
    six = seconds(with_six_degrees, 3) / len(free) * COUNT
    run = sp.simulate(ROBOT, model="rft", motion="held", timing={"duration": 10.0})
    last = sp.AxialBatch(ROBOT, 1, model="rft")
    for _ in range(300):
        last.step(DT)
    print(
        json.dumps(
            {
                "question": "a batch of held robots against robots one by one; steps of 1/30 s, remote at random",
                "robots": COUNT,
                "robot_steps_per_second": COUNT / step,
                "target_per_second": 1e6,
                "environment_steps_per_second": {name: environment_steps(name) for name in ("StopAt", "HoldSpeed")},
                "ratio_held_one_by_one": single / step,
                "ratio_free_one_by_one": six / step,
                "target_ratio": 20,
                "difference_from_simulate_after_10_s": abs(
                    float(last.observe()["position"][0]) / float(run["position"][-1]) - 1.0
                ),
            },
            indent=2,
        )
    )


if __name__ == "__main__":
    main()
