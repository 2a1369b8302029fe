"""What a model misses of one tail: draws of its discrepancy, for a new tail or for one that was measured.

A calibration describes the mean y over the trials of a robot by y = f (1 + tau d) + e with the prediction f, d ~
N(0, 1) for each robot, and the error e of the mean. Of a tail that was not observed nothing is known of d but that. Of
one that was observed, its mean tells d: given f, tau and the size of e, d is a normal number again (Gaussian
conditioning), as well known as the mean itself.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal, cast, get_args

import numpy as np

from spirillum.arrays import Samples
from spirillum.errors import InputError
from spirillum.fitted.posterior_file import PosteriorFile
from spirillum.robot.robot import Robot

PosteriorFor = Literal["new", "measured"]
"""Whose discrepancy an interval holds: of a tail like those that were fitted, or of a fitted one."""


def posterior_for_of(name: str, posterior: PosteriorFile | None, robot: Robot) -> PosteriorFor:
    """The robot whose discrepancy is requested.

    Args:
        name: `new` or `measured`.
        posterior: the posterior; None without one.
        robot: the robot.
    """
    if name not in get_args(PosteriorFor):
        raise InputError(f"for = {name!r}; allowed: {', '.join(get_args(PosteriorFor))}")
    if name == "measured":
        if posterior is None:
            raise InputError("for = 'measured' without a posterior; allowed: with --posterior FILE")
        if not posterior.tails:
            raise InputError(
                f"for = 'measured': {posterior.source} does not hold what was observed of each tail; allowed: 'new', "
                "or a posterior of this version of `spirillum calibrate`"
            )
        if posterior.measured(robot) is None:
            raise InputError(
                f"for = 'measured': {robot.name} with its body, channel and tail is none of the "
                f"{len(posterior.tails)} robots of {posterior.observations}; allowed: 'new', or one of these"
            )
    return cast("PosteriorFor", name)


def drawn_discrepancy(
    posterior: PosteriorFile,
    predicted: Mapping[str, Samples],
    rng: np.random.Generator,
    robot: Robot | None = None,
) -> dict[str, Samples]:
    """Factors on advance, turning and motor rate, (draws,) each; 1 for a quantity that was not compared.

    Args:
        posterior: its draws.
        predicted: advance U/omega, turning Omega/omega and motor_rate omega_m of every draw, (draws,).
        rng: source of chance.
        robot: a robot that was measured; None: any other.
    """
    size = next(iter(predicted.values())).size
    found = {}
    for name in ("advance", "turning", "motor_rate"):
        tau = posterior.discrepancy.get(name)
        found[name] = np.ones(size) if tau is None else 1.0 + tau * rng.normal(size=size)
    tail = None if robot is None else posterior.measured(robot)
    if tail is None:
        return found
    names = [name for name in found if name in tail["seen"] and name in posterior.discrepancy and name in predicted]
    if not names:
        return found
    values = np.stack([_compared(name, predicted, tail) for name in names])
    spread = np.stack([posterior.discrepancy[name] for name in names]) * values
    errors = np.stack([_error_of(posterior.error[name], tail["seen"][name]) for name in names])
    noise = np.einsum("qd,rd->dqr", errors, errors) * _correlations(names, float(tail["correlation"]))
    floor = np.array([float(tail["floor"]) * tail["seen"][name]["scale"] for name in names]) ** 2
    noise = noise + np.diag(floor)
    # Matheron's rule: a draw of the prior, moved by what its own observation differs from the one that was made.
    off = values * (np.stack([found[name] for name in names]) - 1.0)
    seen = np.array([tail["seen"][name]["mean"] for name in names])[:, None]
    error = np.einsum("dqr,rd->qd", np.linalg.cholesky(noise), rng.normal(size=off.shape))
    whole = noise + spread.T[:, :, None] ** 2 * np.eye(len(names))
    gain = spread.T[:, :, None] ** 2 * np.linalg.inv(whole)
    moved = off + np.einsum("dqr,rd->qd", gain, seen - values - off - error)
    return found | {name: 1.0 + moved[n] / values[n] for n, name in enumerate(names)}


def error_of_mean(
    error: Samples | float, stated: Samples | float, scale: Samples | float, trials: Samples | float
) -> Samples:
    """Standard error of a mean over trials, SI: that of one trial over the root of the number of trials.

    The scatter of trials holds the error of each measurement. So a trial's error is the larger of both, not their sum.
    """
    found: Samples = np.fmax(error, np.fmax(stated, 0.0)) * scale / np.sqrt(np.maximum(trials, 1.0))
    return found


def _compared(name: str, predicted: Mapping[str, Samples], tail: Mapping[str, object]) -> Samples:
    """What was compared: the advance is over the motor's rate where no tail rate was observed."""
    if name == "advance" and tail["by_motor"]:
        return predicted["advance"] / (1.0 - predicted["turning"])
    return predicted[name]


def _error_of(error: Samples, seen: Mapping[str, float]) -> Samples:
    return error_of_mean(error, seen.get("stated", 0.0), seen["scale"], seen["trials"])


def _correlations(names: list[str], correlation: float) -> Samples:
    """Of the errors of advance and turning, which share their tail rate; none with the motor's rate."""
    found = np.eye(len(names))
    if "advance" in names and "turning" in names:
        a, t = names.index("advance"), names.index("turning")
        found[a, t] = found[t, a] = correlation
    return found
