"""How often the learner's 95 % intervals hold the friction and the gap that were drawn.

    python benchmarks/learning_friction_and_gap.py [--seeds 200]

The paper's robot in its wide tube with its drive on for 12 s, friction unknown by a factor of three and gap by two
either way, voltage to 1 %, viscosity to 2 %, a pulse of flow, the laboratory's usual errors, no command lost (so that
one bank serves all seeds). Synthetic throughout. Prints JSON. Some five minutes of one core.
"""

import argparse
import json

import numpy as np

import spirillum as sp
from spirillum.controllers.estimators import Bank
from spirillum.controllers.lab import Lab
from spirillum.controllers.learning import learnt
from spirillum.controllers.loop import run_loop
from spirillum.controllers.sensors import draw, plant_of
from spirillum.controllers.stop_task import Timed
from spirillum.dynamics.run_summary import DutyInterval

LAB = {
    "remote": {"lost": 0.0},
    "unknown": {"friction_factor": 3.0, "gap_factor": 2.0, "voltage_error": 0.01, "viscosity_error": 0.02},
}
DURATION = 12.0
"""Of a run, s."""
ENDS = (4.0, 8.0, 12.0)
"""Times at which the intervals are asked for, s."""


def main() -> None:
    """Count."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--seeds", type=int, default=200)
    seeds = options.parse_args().seeds
    robot = sp.load("biorob2012-wide", **{"friction.effective": "4.7e-6 N m s/rad"})
    lab = Lab.of(LAB)
    on = lab.remote.delay
    bank = Bank(robot, lab.unknown)
    bank.follow(on, 0.0)
    bank.follow(DURATION + 0.5, 1.0)
    paths = bank.paths()
    found: dict[tuple[str, float], list[tuple[bool, float, float]]] = {}
    for seed in range(seeds):
        truth = draw(lab.unknown, lab.pulse, seed, DURATION)
        always = Timed(lab, 10.0 * DURATION, 1.0)
        run = run_loop(plant_of(robot, {}, truth), always, lab, DURATION, seed=seed, flow=truth.pulse)
        for end in ENDS:
            sights = [sight for _, sight in run.frames if sight is not None and sight.time <= end]
            readings = [reading for reading in run.readings if reading.time <= end]
            answer = learnt(paths, lab, [DutyInterval(on, end)], sights, readings)
            for name in ("friction", "gap"):
                factor, true = getattr(answer, name), getattr(truth, name)
                row = (factor.low <= true <= factor.high, factor.high / factor.low, factor.value / true)
                found.setdefault((name, end), []).append(row)
    answers = []
    for (name, end), rows in found.items():
        held, ratio, off = np.array(rows, dtype=float).T
        answers.append(
            {
                "factor": name,
                "seconds": end,
                "runs": len(rows),
                "held": float(held.mean()),
                "median_high_over_low": float(np.median(ratio)),
                "rms_relative_error": float(np.sqrt(np.mean(np.log(off) ** 2))),
            }
        )
    print(json.dumps(answers, indent=2))


if __name__ == "__main__":
    main()
