"""Steady state of a million robots, SBT + RFT + motor, against one robot after the other."""

from __future__ import annotations

import json
import resource
import sys
import time

import numpy as np

import spirillum as sp

COUNT = 1_000_000


def main() -> None:
    robot = sp.load("biorob2012-wide")
    one = sp.RobotBatch.of(robot)
    rng = np.random.default_rng(2012)
    tails = {
        "tail.wavelength": rng.uniform(0.010, 0.030, COUNT),
        "tail.amplitude": rng.uniform(0.001, 0.004, COUNT),
    }
    batch = one.with_values(tails)
    for model in ("sbt", "rft"):
        sp.swim(one, model)

    seconds = {}
    for model in ("sbt", "rft"):
        start = time.perf_counter()
        answer = sp.swim(batch, model)
        seconds[model] = time.perf_counter() - start
        assert bool(answer.valid.all())  # noqa: S101
    start = time.perf_counter()
    for _ in range(200):
        sp.swim(one, "sbt")
        sp.swim(one, "rft")
    single = (time.perf_counter() - start) / 200
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)
    total = sum(seconds.values())
    print(
        json.dumps(
            {
                "question": "steady state of a million robots, SBT + RFT + motor",
                "robots": COUNT,
                "seconds": seconds,
                "total_s": total,
                "target_s": 5.0,
                "peak_memory_GiB": peak / 2**30,
                "target_GiB": 2.0,
                "one_robot_both_models_s": single,
                "ratio_one_by_one": single * COUNT / total,
            },
            indent=2,
        )
    )


if __name__ == "__main__":
    main()
