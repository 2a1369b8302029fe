"""Does the posterior of `calibrate` know as much as it says, on experiments of the paper's size?

    python benchmarks/simulation_based_calibration.py [--experiments 300] [--model sbt]

Truths from the prior, synthetic observations (16 tails x 2 channels x 5 trials) from the model, ranks of the truths in
the posterior. Prints, as JSON, for each number the p-value of uniform ranks (Kolmogorov and Smirnov) and how often its
95 % interval holds the truth; the limits are p > 0.01 for all of them together (Bonferroni) and 90 to 99 %.
"""

from __future__ import annotations

import argparse
import json
import sys
import time

import numpy as np
from scipy.stats import kstest

from spirillum.calibration.simulation_based import simulated_ranks


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--experiments", type=int, default=300)
    parser.add_argument("--model", default="sbt")
    parser.add_argument("--free", default="body_drag,body_rotation")
    parser.add_argument("--seed", type=int, default=2012)
    chosen = parser.parse_args()
    start = time.perf_counter()
    found = simulated_ranks(
        experiments=chosen.experiments, model=chosen.model, free=chosen.free.split(","), seed=chosen.seed
    )
    seconds = time.perf_counter() - start
    rows = {
        name: {"p": float(kstest(ranks, "uniform").pvalue), "coverage": float(found.inside[name].mean())}
        for name, ranks in found.ranks.items()
    }
    coverage = float(np.mean([row["coverage"] for row in rows.values()]))
    least = min(row["p"] for row in rows.values()) * len(rows)
    report = {
        "question": "does the posterior know as much as it says?",
        "experiments": chosen.experiments,
        "model": chosen.model,
        "seconds": seconds,
        "numbers": rows,
        "p_of_all": min(least, 1.0),
        "coverage_of_all": coverage,
        "limits": {"p": 0.01, "coverage": [0.90, 0.99]},
    }
    print(json.dumps(report, indent=2))
    good = least > 0.01 and 0.90 <= coverage <= 0.99
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
