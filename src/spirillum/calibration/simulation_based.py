"""Simulation-based calibration: does the posterior know as much as it says?

Truths are drawn from the prior, observations from the model with them, and the rank of each truth among the draws of
its posterior is noted. If sampler and density are right, ranks are uniform (Talts et al., arXiv:1804.06788), and
intervals hold the truth as often as they say. All observations here are synthetic.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from spirillum.arrays import Samples
from spirillum.calibration.experiment import Experiment, Quantity, Ratio, channel_of, with_tail
from spirillum.calibration.least_squares import least_squares_fit
from spirillum.calibration.likelihood import Density
from spirillum.calibration.posterior import Sampling, sampled
from spirillum.calibration.problem import Problem, Progress, posed
from spirillum.errors import InputError
from spirillum.robot.load import PAPER_ROBOTS, load

__all__ = ["PAPER_TAILS", "Ranks", "simulated_ranks", "synthetic_experiment"]

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
    nothing = Ratio(one, trials * one, one, 0.0 * one, 0.0 * one)
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
    """The same problem with trials drawn from the model at the truth."""
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
        found[name] = Ratio(average, trials * one, scale, squares, (trials - 1.0) * one)
    seen = replace(problem.experiment, advance=found["advance"], turning=found["turning"])
    return replace(problem, experiment=seen)
