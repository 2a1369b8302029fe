"""Does the posterior of `calibrate` know as much as it says, on experiments of the paper's size?

    python benchmarks/simulation_based_calibration.py [--experiments 300] [--model sbt]

Simulation-based calibration (Talts et al., arXiv:1804.06788): truths are drawn from the prior, synthetic observations
(16 tails x 2 channels x 5 trials) from the model with them, and the rank of each truth among the draws of its posterior
is noted. If sampler and density are right, ranks are uniform, and intervals hold the truth as often as they say.
Prints, as JSON, for each number the p-value of uniform ranks (Kolmogorov and Smirnov) and how often its 95 % interval
holds the truth; the limits are p > 0.01 for all of them together (Bonferroni) and 90 to 99 %.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import kstest

from spirillum.arrays import Samples
from spirillum.calibration.experiment import Experiment, Quantity, Ratio, channel_of, with_tail
from spirillum.calibration.least_squares import least_squares_fit
from spirillum.calibration.likelihood import Density
from spirillum.calibration.posterior import Sampling, sampled
from spirillum.calibration.problem import Problem, posed
from spirillum.errors import InputError
from spirillum.progress import Progress
from spirillum.robot.load import PAPER_ROBOTS, load

PAPER_TAILS = tuple((w, a) for w in (10.0, 15.0, 20.0, 25.0) for a in (1.5, 2.0, 2.5, 3.5))
"""Wavelength and amplitude, mm, of the paper's sixteen tails (the grid is assumed, see `docs/study`)."""
_SAMPLING = Sampling(ensembles=1, walkers=64, warm_up=260, steps=120, kept=30, doublings=0)
"""Many walkers and few steps: walkers are nearly independent, and a step costs little more with more of them."""


@dataclass(frozen=True)
class Ranks:
    """What a simulation-based calibration found."""

    ranks: dict[str, Samples]
    """Share of a posterior's draws below the truth, one for each experiment, by number."""
    inside: dict[str, np.ndarray]
    """Whether the 95 % interval holds the truth."""


def synthetic_experiment(
    tails: Sequence[tuple[float, float]] = PAPER_TAILS,
    trials: int = 5,
    robots: Sequence[str] = PAPER_ROBOTS,
) -> Experiment:
    """The robots of an experiment of the paper's size, with nothing observed yet.

    Args:
        tails: wavelength and amplitude, mm.
        trials: of each tail.
        robots: one for each channel.
    """
    loaded = sorted((load(name) for name in robots), key=lambda r: r.channel.diameter if r.channel else 0.0)
    every = [(n, with_tail(r, 1e-3 * w, 1e-3 * a)) for n, r in enumerate(loaded) for w, a in tails]
    size = len(every)
    one = np.ones(size)
    nothing = Ratio(one, trials * one, one, 0.0 * one, 0.0 * one, np.nan * one)
    return Experiment(
        robots=tuple(robot for _, robot in every),
        channels=tuple(channel_of(robot) for robot in loaded),
        channel=np.array([n for n, _ in every]),
        rows=tuple((n + 1,) for n in range(size)),
        advance=nothing,
        by_motor=np.zeros(size, dtype=bool),
        turning=nothing,
        motor_rate=nothing,
        tail_rate=2.0 * np.pi * one,
        correlation=0.0,
        source="synthetic",
        sha256="",
        synthetic=True,
    )


def simulated_ranks(
    *,
    experiments: int = 200,
    tails: Sequence[tuple[float, float]] = PAPER_TAILS,
    trials: int = 5,
    model: str = "sbt",
    free: Sequence[str] = ("body_drag", "body_rotation"),
    seed: int = 1,
    sampling: Sampling = _SAMPLING,
    progress: Progress | None = None,
) -> Ranks:
    """Run a simulation-based calibration on synthetic experiments.

    Args:
        experiments: how many.
        tails: wavelength and amplitude of the tails, mm, in both channels of the paper.
        trials: of each tail.
        model: hydrodynamic model, of truth and fit.
        free: names of the free parameters.
        seed: of truths, observations and sampler.
        sampling: how each posterior is sampled.
        progress: told which experiment is at work.

    Raises:
        InputError: if a parameter acts on the motor, which is not simulated here.
    """
    rng = np.random.default_rng(seed)
    problem = posed(synthetic_experiment(tails, trials), model, tuple(free))
    if problem.by_motor_rate:
        raise InputError("free: a parameter that acts on the motor; allowed: parameters of the fluid's resistance")
    density = Density(problem)
    ranks: dict[str, list[float]] = {name: [] for name in density.labels}
    inside: dict[str, list[bool]] = {name: [] for name in density.labels}
    for number in range(experiments):
        if progress:
            progress("experiment", number, experiments)
        truth = rng.normal(size=(1, density.size))
        observed = _observed(problem, truth, trials, rng)
        posterior = sampled(observed, least_squares_fit(observed), replace(sampling, seed=int(rng.integers(2**31))))
        for place, name in enumerate(density.labels):
            draws = posterior.flat[:, place]
            rank = float(np.mean(draws < truth[0, place]))
            ranks[name].append(rank)
            inside[name].append(0.025 <= rank <= 0.975)
    return Ranks(
        {name: np.array(values) for name, values in ranks.items()},
        {name: np.array(values) for name, values in inside.items()},
    )


def _observed(problem: Problem, truth: Samples, trials: int, rng: np.random.Generator) -> Problem:
    """The problem with trials drawn from the model at the truth."""
    density = Density(problem)
    tau, sigma = density.nuisances(truth)
    predicted = problem.predicted(truth[:, : len(problem.coordinates)])
    found: dict[Quantity, Ratio] = {}
    for name, values in predicted.items():
        size = values.shape[1]
        mean = values[0] * (1.0 + tau[name] * rng.normal(size=size))
        trial = mean * (1.0 + sigma[name] * rng.normal(size=(trials, size)))
        average = trial.mean(axis=0)
        scale = np.abs(average)
        squares = np.sum(((trial - average) / scale) ** 2, axis=0)
        one = np.ones(size)
        found[name] = Ratio(average, trials * one, scale, squares, (trials - 1.0) * one, np.nan * one)
    seen = replace(problem.experiment, advance=found["advance"], turning=found["turning"])
    return replace(problem, experiment=seen)


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
