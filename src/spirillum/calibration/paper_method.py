"""The paper's own procedure: kinematics (15) inverted for the drag factors, then (18) for B_eff, tail by tail.

The rows of (15) are linear in the factors. With advance u = U/omega and turning o = Omega/omega observed, the force on
the whole gives the factor on D_x and the torque on the whole that on E_x:

    f_D = 1 - (F_U u + F_b o + F_r)/(D_x u)        f_E = 1 - (T_U u + T_b o + T_r)/(E_x o)

with the rows F and T of the uncalibrated balance. Each robot has its own pair; a channel's factor is the one that
leaves the least squares of the force (torque) of all its robots at the same tail rate: their mean, weighted with
(D_x u)^2 and (E_x o)^2. As in Table III, resistive force theory keeps E_x as it is, since its friction explains the
rates, and the drag factor is one for each channel.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spirillum.arrays import Samples
from spirillum.calibration.problem import Problem
from spirillum.errors import InputError

_FACTORS = ("body_drag", "body_rotation")


@dataclass(frozen=True)
class PaperFit:
    """Factors by label, and how they differ from tail to tail."""

    values: dict[str, float]
    """Factor of each channel."""
    by_robot: dict[str, Samples]
    """The factor that each robot alone would give, by parameter; NaN where it was not observed."""
    spread: dict[str, float]
    """Standard deviation of these within a channel, by label; NaN for a single robot."""


def paper_fit(problem: Problem) -> PaperFit:
    """Invert (15) for the drag factors."""
    names = [name for name in problem.free if name != "friction"]
    wrong = [name for name in names if name not in _FACTORS]
    if wrong or problem.model.placed:
        raise InputError(
            f"method = 'paper' with free = '{(wrong or names)[0]}' and model '{problem.model.name}'; allowed: "
            "body_drag, body_rotation, friction, with a model that takes drag factors"
        )
    if np.any(problem.experiment.by_motor):
        place = int(np.argmax(problem.experiment.by_motor))
        raise InputError(
            f"{problem.experiment.source}, row {problem.experiment.rows[place][0]}, column tail_rate_Hz: empty; "
            "allowed: a tail rate, which method 'paper' inverts (15) with"
        )
    by_robot, weights = _inverted(problem)
    values: dict[str, float] = {}
    spread: dict[str, float] = {}
    for item in problem.coordinates:
        name, inside = item.parameter.name, problem.experiment.channel == item.channel
        known = inside & np.isfinite(by_robot[name])
        if not np.any(known):
            column = "body_rate_Hz" if name == "body_rotation" else "forward_velocity_mm_s and tail_rate_Hz"
            raise InputError(
                f"{problem.experiment.source} has nothing observed for {item.label}; allowed: a column {column}"
            )
        own, weight = by_robot[name][known], weights[name][known]
        values[item.label] = float(np.sum(weight * own) / np.sum(weight))
        spread[item.label] = float(own.std(ddof=1)) if own.size > 1 else float("nan")
        if values[item.label] <= 0:
            raise InputError(
                f"{problem.experiment.source}: {item.label} comes out as {values[item.label]:.3g}; allowed: "
                f"observations that model '{problem.model.name}' can explain with a positive factor"
            )
    return PaperFit(values, by_robot, spread)


def _inverted(problem: Problem) -> tuple[dict[str, Samples], dict[str, Samples]]:
    """Factors of each robot by itself, and their weights."""
    experiment, isolated = problem.experiment, problem.forward.isolated
    one = np.ones((1, 1))
    m = problem.forward.matrices({"body_drag": one, "body_rotation": one})[0]
    force, torque = m[:, 0, :], m[:, 1, :] + m[:, 2, :]
    u, seen = experiment.advance.mean, experiment.turning.mean
    turning = np.where(np.isnan(seen), problem.forward.predict({}).turning[0], seen)
    rates = np.stack([u, turning, np.ones_like(u)], axis=-1)
    drag, rotation = isolated[0] * u, isolated[1] * seen
    by_robot = {
        "body_drag": 1.0 - np.sum(force * rates, axis=-1) / drag,
        "body_rotation": 1.0 - np.sum(torque * rates, axis=-1) / rotation,
    }
    return by_robot, {"body_drag": drag**2, "body_rotation": rotation**2}
