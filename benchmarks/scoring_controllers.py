"""Every controller against doing nothing, open loop and knowing everything, over the same seeds.

    python benchmarks/scoring_controllers.py [stop-at hold-speed ride-out save-battery] [--seeds 100] [--workers 1]

The paper's robot in its wide tube, with a friction of 4.7e-6 N m s/rad that the controller does not know by a factor of
three either way, a pulse of flow of 0.5 mm/s for 2 s, and the laboratory's usual errors. Synthetic throughout: truth
and prediction are the same equations. Prints JSON. 100 seeds of `stop-at` take 8 minutes of one core.
"""

import argparse
import json

import spirillum as sp

ASKED = {
    "stop-at": {"at": "3 mm"},
    "hold-speed": {"speed": "0.1 mm/s"},
    "ride-out": {"speed": "0.1 mm/s"},
    "save-battery": {"speed": "0.1 mm/s"},
}


def main() -> None:
    """Score the tasks that are named."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("tasks", nargs="*", default=list(ASKED), choices=list(ASKED))
    options.add_argument("--seeds", type=int, default=100)
    options.add_argument("--workers", type=int, default=1)
    asked = options.parse_args()
    robot = sp.load("biorob2012-wide", **{"friction.effective": "4.7e-6 N m s/rad"})
    found = {}
    for kind in asked.tasks:
        answer = sp.control(robot, {"kind": kind, **ASKED[kind]}, seeds=asked.seeds, workers=asked.workers).to_dict()
        scores = answer["scores"]
        found[kind] = {name: scores[name] for name in ("error", "controllers", "failed_seeds")}
    print(json.dumps(found, indent=2))


if __name__ == "__main__":
    main()
