"""How much faster than real time do warm free runs of the paper's robot go, and than SciPy's integrator?

Without walls (`rft`): 100 turns at the tail's rate of the paper's order (1.3 Hz), on the floor of the wide channel,
with all of its energies and the labelled dataset. The baseline integrates the same compiled right-hand side by
`scipy.integrate`. In the tube: a trial of 20 s from where the robot is laid down, and a minute, most of it in contact.
"""

from __future__ import annotations

import json
import time

import numpy as np

import spirillum as sp
from spirillum.dynamics.free_robot import TwoLinks, two_links
from spirillum.dynamics.release import resting_state
from spirillum.kernels import core
from spirillum.robot.placement import Placement

TURNS = 100.0
TRIALS = 20.0, 60.0


def best(function, repeats: int) -> float:
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        function()
        times.append(time.perf_counter() - start)
    return min(times)


def main() -> None:
    from scipy.integrate import solve_ivp

    robot = sp.load("biorob2012-wide", **{"friction.effective": "1.1e-5 N m s/rad"})
    run = sp.simulate(robot, model="rft", timing={"turns": TURNS})
    simulated = float(run["time"][-1])
    whole = best(lambda: sp.simulate(robot, model="rft", timing={"turns": TURNS}), 10)
    sp.simulate(robot, model="tube", timing={"duration": 1.0})
    in_tube = {}
    for length in TRIALS:
        timing = {"duration": length}
        in_tube[length] = best(lambda timing=timing: sp.simulate(robot, timing=timing, in_tube={"wait": 0.0}), 3)
    links = two_links(sp.predict(robot, model="rft", friction="rotor", motion="held"), None, weight=True)
    data, no_table, dy = links.data, links.table, np.empty(core.STATE_SIZE)

    def right_hand_side(t: float, y: np.ndarray) -> np.ndarray:
        core.rates(dy, t, y, data, no_table)
        return dy.copy()

    start, tolerance = resting_state(robot, links, Placement()), TwoLinks.tolerance
    scipy_time = best(
        lambda: solve_ivp(right_hand_side, (0.0, simulated), start, method="RK45", rtol=tolerance, atol=1e-11), 2
    )
    print(
        json.dumps(
            {
                "question": "warm free runs against real time and against scipy.integrate",
                "simulated_s": simulated,
                "whole_run_with_dataset_s": whole,
                "scipy_same_right_hand_side_s": scipy_time,
                "real_time_factor": simulated / whole,
                "ratio_to_scipy": scipy_time / whole,
                "target_real_time_factor": 1000,
                "in_the_tube_real_time_factor": {f"{time:g} s": time / spent for time, spent in in_tube.items()},
                "target_in_the_tube_20_s": 50,
            },
            indent=2,
        )
    )


if __name__ == "__main__":
    main()
