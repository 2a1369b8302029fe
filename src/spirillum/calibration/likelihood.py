"""The posterior density of the free numbers, of the trials' errors, and of what the model itself gets wrong.

For robot j and quantity q (advance, turning, motor rate) with the mean y over n trials and the prediction f:

    y = f (1 + tau_q d) + sigma_q |y| e/sqrt(n),   d, e ~ N(0, 1)

tau_q is the model's discrepancy: what it gets wrong from robot to robot, however many trials are made. sigma_q is the
relative error of a trial, which the scatter of repeated trials gives; it is no less than what the trial itself states
of its measurement. Both have half-normal priors and are integrated
over with the rest. Errors of advance and turning within a robot are correlated, since both are divided by the same tail
rate; their correlation is that of the trials.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from spirillum.arrays import Samples
from spirillum.calibration.experiment import Quantity
from spirillum.calibration.problem import Problem

DISCREPANCY_SCALE = 0.3  #: Scale of the half-normal prior of a discrepancy: such models miss by some tens of per cent.
ERROR_SCALE = 0.05  #: Scale of the half-normal prior of a trial's relative error: above 0.1 a trial would be poor.
LEAST_RELATIVE = 1e-4  #: Relative error below which no mean is taken for known: files have a few digits.
_NOTHING = -1e30  # log density where there is none: finite, for the sampler takes differences
_LARGEST = 8.0  # coordinates beyond this many standard deviations of the prior have no density


def half_normal(z: Samples, scale: float = 1.0) -> Samples:
    """A half-normal number at a standard normal coordinate."""
    from scipy.special import ndtr, ndtri

    # ndtri((1 + ndtr(z))/2) by the upper tail, which keeps its digits where z is large
    found: Samples = -scale * ndtri(0.5 * ndtr(-z))
    return found


@dataclass(frozen=True)
class Density:
    """Log posterior density over coordinates: those of the problem, then discrepancies, then errors of a trial."""

    problem: Problem

    @cached_property
    def labels(self) -> tuple[str, ...]:
        """Names of all coordinates."""
        names = self.problem.quantities
        own = tuple(item.label for item in self.problem.coordinates)
        return (*own, *(f"discrepancy_{name}" for name in names), *(f"error_{name}" for name in names))

    @property
    def size(self) -> int:
        """Number of coordinates."""
        return len(self.labels)

    def nuisances(self, z: Samples) -> tuple[dict[Quantity, Samples], dict[Quantity, Samples]]:
        """Discrepancies and errors of a trial by quantity, (draws,) each."""
        first = len(self.problem.coordinates)
        names = self.problem.quantities
        count = len(names)
        both = half_normal(z[:, first:])
        tau = {name: DISCREPANCY_SCALE * both[:, n] for n, name in enumerate(names)}
        sigma = {name: ERROR_SCALE * both[:, count + n] for n, name in enumerate(names)}
        return tau, sigma

    def values(self, z: Samples) -> dict[str, Samples]:
        """All numbers by label, (draws,) each."""
        tau, sigma = self.nuisances(z)
        found = self.problem.values(z)
        found |= {f"discrepancy_{name}": value for name, value in tau.items()}
        return found | {f"error_{name}": value for name, value in sigma.items()}

    def __call__(self, z: Samples) -> Samples:
        """Log density up to a constant, (draws,)."""
        inside = np.all(np.abs(z) < _LARGEST, axis=1)
        kept = np.where(inside[:, None], z, 0.0)
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            found = self.by_robot(kept).sum(axis=1) - 0.5 * np.sum(kept**2, axis=1)
        return np.where(inside & np.isfinite(found), found, _NOTHING)

    def by_robot(self, z: Samples) -> Samples:
        """Log likelihood of each robot's observations, (draws, robots)."""
        tau, sigma = self.nuisances(z)
        predicted = self.problem.predicted(z[:, : len(self.problem.coordinates)])
        total = np.zeros((z.shape[0], self.problem.experiment.size))
        residual: dict[Quantity, Samples] = {}
        noise: dict[Quantity, Samples] = {}
        variance: dict[Quantity, Samples] = {}
        for name, values in predicted.items():
            ratio = self.problem.ratio(name)
            s, t = sigma[name][:, None], tau[name][:, None]
            residual[name] = np.where(ratio.is_observed, ratio.mean - values, 0.0)
            noise[name] = ratio.error_of_mean(s)
            floor = max(LEAST_RELATIVE, self.problem.interpolation_error)
            variance[name] = noise[name] ** 2 + (t * values) ** 2 + (floor * ratio.scale) ** 2
            trial = np.fmax(s, ratio.stated) ** 2 + LEAST_RELATIVE**2
            total += -0.5 * (ratio.freedom * np.log(trial) + ratio.squares / trial)
        for name in predicted:
            if name != "turning" or "advance" not in predicted:
                total += np.where(self.problem.ratio(name).is_observed, _normal(residual[name], variance[name]), 0.0)
        if "turning" in predicted and "advance" in predicted:
            total += self._turning_given_advance(residual, noise, variance)
        return total

    def _turning_given_advance(
        self, residual: dict[Quantity, Samples], noise: dict[Quantity, Samples], variance: dict[Quantity, Samples]
    ) -> Samples:
        """The turning's density, conditional on the advance of the same robot where there is one."""
        seen = self.problem.ratio("turning").is_observed
        both = seen & self.problem.ratio("advance").is_observed
        covariance = np.where(both, self.problem.experiment.correlation * noise["advance"] * noise["turning"], 0.0)
        slope = covariance / variance["advance"]
        left = residual["turning"] - slope * residual["advance"]
        found = _normal(left, variance["turning"] - slope * covariance)
        return np.where(seen, found, 0.0)


def _normal(residual: Samples, variance: Samples) -> Samples:
    """Log density of a normal number."""
    return -0.5 * (residual**2 / variance + np.log(2.0 * np.pi * variance))
