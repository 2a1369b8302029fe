"""The posterior by an affine-invariant ensemble sampler, with diagnostics that fail loudly.

Several ensembles of walkers start apart from each other and know nothing of one another. R-hat compares all of them,
and the effective sample size counts what their draws are worth. Where either falls short the run goes on for twice as
long, and if that does not help the posterior is marked: whoever uses it is refused.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from spirillum.argument_validation import check_kind
from spirillum.arrays import Samples
from spirillum.calibration.experiment import Quantity
from spirillum.calibration.least_squares import LeastSquares
from spirillum.calibration.likelihood import DISCREPANCY_SCALE, ERROR_SCALE, Density
from spirillum.calibration.problem import Problem
from spirillum.errors import InputError, check_range
from spirillum.progress import Progress, tell

if TYPE_CHECKING:
    from concurrent.futures import Future, ProcessPoolExecutor

LARGEST_RHAT = 1.01  #: Largest R-hat (rank-normalised, split) of a posterior that may be used.
FEWEST_EFFECTIVE = 400.0  #: Smallest effective sample size, of bulk and tails.
ENSEMBLES = 4
_MOST_DOUBLINGS = 10


@dataclass(frozen=True)
class Sampling:
    """How the sampler runs."""

    ensembles: int = ENSEMBLES  #: Independent ensembles.
    walkers: int = 0  #: Walkers of each ensemble; 0: four times the number of coordinates, at least 24.
    warm_up: int = 400  #: Steps that are thrown away.
    steps: int = 800  #: Steps that are kept, at first.
    kept: int = 100  #: Draws of each walker that stay in the answer.
    seed: int = 1  #: Seed of the sampler.
    doublings: int = 3  #: How often the length of the chains is doubled while they have not mixed.

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            check_kind(name, value, "int")
        if self.seed < 0:
            raise InputError(f"seed = {self.seed}; allowed: a whole number from 0")
        check_range("doublings", self.doublings, 0, _MOST_DOUBLINGS)


@dataclass(frozen=True)
class Posterior:
    """Draws of all coordinates, and what they are worth."""

    density: Density
    z: Samples  #: (chains, draws, coordinates); a chain is a walker.
    rhat: dict[str, float]
    effective: dict[str, float]  #: Smaller of the effective sample sizes of bulk and tails.
    steps: int  #: Steps of each ensemble after warming up.
    acceptance: float

    @property
    def converged(self) -> bool:
        """Whether the draws may be used."""
        return not self.problems()

    def problems(self) -> list[str]:
        """What is wrong with the draws, a sentence each."""
        bad = [f"{name} {value:.3f}" for name, value in self.rhat.items() if not value <= LARGEST_RHAT]
        few = [f"{name} {value:.0f}" for name, value in self.effective.items() if not value >= FEWEST_EFFECTIVE]
        found = []
        if bad:
            found.append(f"the chains have not mixed: R-hat above {LARGEST_RHAT:g} for {_first(bad)}")
        if few:
            found.append(f"too few effective draws: below {FEWEST_EFFECTIVE:g} for {_first(few)}")
        return [f"{sentence}; more doublings sample for longer" for sentence in found]

    @property
    def flat(self) -> Samples:
        """All draws, (draws, coordinates)."""
        return self.z.reshape(-1, self.z.shape[-1])

    def values(self) -> dict[str, Samples]:
        """Numbers by label, (chains, draws)."""
        return {name: v.reshape(self.z.shape[:2]) for name, v in self.density.values(self.flat).items()}


def _first(items: Sequence[str]) -> str:
    """The first of several, and how many more there are."""
    return items[0] if len(items) == 1 else f"{items[0]} and {len(items) - 1} more"


def sampled(
    problem: Problem,
    fit: LeastSquares,
    sampling: Sampling | None = None,
    progress: Progress | None = None,
    beside: ProcessPoolExecutor | None = None,
) -> Posterior:
    """Draw from the posterior, every second ensemble in the process beside this one."""
    how = sampling or Sampling()
    density = Density(problem)
    walkers = how.walkers or max(24, 4 * density.size)
    rng = np.random.default_rng(how.seed)
    samplers = [_Ensemble(density, _starts(density, fit, walkers, rng), rng) for _ in range(how.ensembles)]
    chains: list[list[Samples]] = [[] for _ in samplers]
    steps, total, warm_up = how.steps, 0, how.warm_up
    for doubling in range(how.doublings + 1):
        theirs = {} if beside is None else _begun(beside, samplers, steps, warm_up)
        order = [*(number for number in range(len(samplers)) if number not in theirs), *theirs]
        for done, number in enumerate(order):
            tell(progress, f"sampling, {total + steps} steps", done, len(samplers))
            samplers[number], found_steps = _finished(theirs.get(number), samplers[number], steps, warm_up)
            chains[number].append(found_steps)
        warm_up = 0
        total += steps
        steps = total
        found = _thinned(density, [np.concatenate(chain) for chain in chains], samplers, how.kept)
        if found.converged or doubling == how.doublings:
            break
    tell(progress, "sampling", 1, 1)
    return found


def _begun(
    beside: ProcessPoolExecutor, samplers: Sequence[_Ensemble], steps: int, warm_up: int
) -> dict[int, Future[tuple[_Ensemble, Samples]]]:
    """Every second ensemble, sent to the process beside this one; none where that has ended."""
    with suppress(BrokenProcessPool):
        return {
            number: beside.submit(_advanced, samplers[number], steps, warm_up) for number in range(1, len(samplers), 2)
        }
    return {}


def _finished(
    theirs: Future[tuple[_Ensemble, Samples]] | None, sampler: _Ensemble, steps: int, warm_up: int
) -> tuple[_Ensemble, Samples]:
    """An ensemble after its steps, from the process beside this one where that has begun it; and the steps."""
    if theirs is not None:
        with suppress(BrokenProcessPool):  # ended from outside
            return theirs.result()
    return _advanced(sampler, steps, warm_up)


def _advanced(sampler: _Ensemble, steps: int, warm_up: int) -> tuple[_Ensemble, Samples]:
    found = sampler.run(steps, warm_up)
    return sampler, found


def _starts(density: Density, fit: LeastSquares, walkers: int, rng: np.random.Generator) -> Samples:
    """Walkers around the least squares, twice as far apart as its errors; nuisances around what it found."""
    from scipy.special import erf, ndtri

    count = fit.z.size
    spread = np.sqrt(np.clip(np.diag(fit.covariance), 1e-8, 1.0))
    centre = np.zeros(density.size)
    width = np.full(density.size, 0.3)
    centre[:count], width[:count] = np.clip(fit.z, -4.0, 4.0), 2.0 * spread
    names: tuple[Quantity, ...] = density.problem.quantities
    for n, name in enumerate(names):
        guesses = ((0, fit.discrepancy[name], DISCREPANCY_SCALE), (len(names), fit.error[name], ERROR_SCALE))
        for offset, value, scale in guesses:
            size = value if np.isfinite(value) and value > 0 else 0.02
            share = float(np.clip(erf((max(size, 0.003) / scale) / np.sqrt(2.0)), 1e-9, 1.0 - 1e-9))
            centre[count + offset + n] = float(np.clip(ndtri(share), -3.0, 3.0))
    return np.clip(centre + width * rng.normal(size=(walkers, density.size)), -6.0, 6.0)


class _Ensemble:
    """One ensemble of walkers that can go on from where it stopped."""

    def __init__(self, density: Density, start: Samples, rng: np.random.Generator) -> None:
        import emcee

        self._sampler = emcee.EnsembleSampler(
            start.shape[0],
            start.shape[1],
            density,
            vectorize=True,
            moves=[(emcee.moves.DEMove(), 0.7), (emcee.moves.DESnookerMove(), 0.1), (emcee.moves.StretchMove(), 0.2)],
        )
        # emcee wraps the density to print what it raises; an interruption is not its to report. It then takes the
        # values one by one, in a tenth of the time of a step.
        self._sampler.compute_log_prob = partial(_without_blobs, density)
        legacy = np.random.RandomState(int(rng.integers(2**31)))
        self._sampler.random_state = legacy.get_state()
        self._at: Samples | None = start
        self.acceptance = 0.0

    def run(self, steps: int, warm_up: int) -> Samples:
        """Steps of all walkers, (steps, walkers, coordinates)."""
        sampler = self._sampler
        if warm_up:
            self._at = sampler.run_mcmc(self._at, warm_up, skip_initial_state_check=True)
            sampler.reset()
        self._at = sampler.run_mcmc(self._at, steps, skip_initial_state_check=True)
        found: Samples = np.array(sampler.get_chain()[-steps:])
        self.acceptance = float(np.mean(sampler.acceptance_fraction))
        sampler.reset()
        return found


def _without_blobs(density: Density, coordinates: Samples) -> tuple[Samples, None]:
    """Log densities of some walkers, as a sampler asks for them."""
    return density(coordinates), None


def _thinned(density: Density, chains: list[Samples], samplers: list[_Ensemble], kept: int) -> Posterior:
    """Thin the draws and compute their diagnostics; each walker of each ensemble is a chain."""
    whole = np.concatenate([np.moveaxis(chain, 1, 0) for chain in chains])
    thinned = whole[:, :: max(1, whole.shape[1] // kept)]
    rhat, effective = _diagnosed(density, chains, whole)
    return Posterior(
        density, thinned, rhat, effective, whole.shape[1], float(np.mean([sampler.acceptance for sampler in samplers]))
    )


def _diagnosed(density: Density, chains: list[Samples], whole: Samples) -> tuple[dict[str, float], dict[str, float]]:
    """R-hat and effective sample size of every number by ArviZ."""
    # R-hat compares the ensembles, each with all draws of its walkers in the order of steps, in halves; the effective
    # sample size takes each walker for a chain, whose own correlation in time it sees.
    from arviz_stats.base.array import array_stats

    rhat, effective = {}, {}
    for place, name in enumerate(density.labels):
        ensembles = np.stack([chain[:, :, place].reshape(-1) for chain in chains])
        rhat[name] = float(array_stats.rhat(ensembles, chain_axis=0, draw_axis=1))
        draws = whole[:, :, place]
        bulk = float(array_stats.ess(draws, chain_axis=0, draw_axis=1, method="bulk"))
        tail = float(array_stats.ess(draws, chain_axis=0, draw_axis=1, method="tail", prob=(0.05, 0.95)))
        effective[name] = min(bulk, tail)
    return rhat, effective
