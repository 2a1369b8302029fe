"""Every controller against doing nothing, open loop and knowing everything, over the same seeds.

    python benchmarks/scoring_controllers.py [stop-at hold-speed ...] [--seeds 100] [--workers 1]

The paper's robot in its wide tube, with a friction of 4.7e-6 N m s/rad that the controller does not know by a factor of
three either way, a pulse of flow of 0.5 mm/s for 2 s, and the laboratory's usual errors. For `keep-axis` and `aim-axis`
(its law `aim`) the same robot is one piece without weight that a field turns at 1 Hz, 7 mm from the wall; the
controller does not know this gap by a factor of 1.5, nor the viscosity by 3 %. Synthetic throughout:
truth and prediction are the same equations. Prints JSON. 100 seeds of `stop-at` take 8 minutes of one core.
"""

import argparse
import json

import spirillum as sp

ASKED = {
    "stop-at": {"at": "3 mm"},
    "hold-speed": {"speed": "0.1 mm/s"},
    "ride-out": {"speed": "0.1 mm/s"},
    "save-battery": {"speed": "0.1 mm/s"},
    "keep-axis": {},
    "aim-axis": {"kind": "keep-axis", "law": "aim"},
}
MAGNETIC = {
    "drive": {"kind": "magnetic", "joint": "fixed"},
    "magnetic": {"moment": "0.3 A m^2", "field": "5 mT", "rotation_rate": "1 Hz"},
    "body.mass": "8.2712 g",  # with the coupling, as heavy as the fluid that they displace
    "tail.density": "985 kg/m^3",
}
IN_FIELD = {
    "lab": {"unknown": {"friction_factor": 1.0, "gap_factor": 1.5, "viscosity_error": 0.03}},
    "plant": {"placement": {"gap": "7 mm"}},
}


def main() -> None:
    """Score the tasks that are named."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("tasks", nargs="*", default=list(ASKED), choices=list(ASKED))
    options.add_argument("--seeds", type=int, default=100)
    options.add_argument("--workers", type=int, default=1)
    asked = options.parse_args()
    found = {}
    for kind in asked.tasks:
        magnetic = kind.endswith("axis")
        robot = sp.load("biorob2012-wide", **(MAGNETIC if magnetic else {"friction.effective": "4.7e-6 N m s/rad"}))
        more = IN_FIELD if magnetic else {}
        answer = sp.control(
            robot, {"kind": kind, **ASKED[kind]}, seeds=asked.seeds, workers=asked.workers, **more
        ).to_dict()
        scores = answer["scores"]
        found[kind] = {name: scores[name] for name in ("error", "controllers", "failed_seeds")}
    print(json.dumps(found, indent=2))


if __name__ == "__main__":
    main()
