"""What B_eff rests on besides the observations: viscosity and motor constants, which (17) and (18) take from the robot.

An observed motor rate gives the motor's torque and the fluid's torque on the tail only with these constants. B_eff
follows from the difference of both torques, so that an error of a constant goes straight into it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from spirillum.arrays import Samples
from spirillum.calibration.estimate import Estimate
from spirillum.calibration.parameters import ASSUMABLE
from spirillum.calibration.problem import Problem
from spirillum.fluid.reference_errors import CHECKED, tail_error
from spirillum.robot.batch import RobotBatch

_STEP = 1e-4


def friction_sensitivity(problem: Problem, z: Samples, reading: str) -> dict[str, Samples]:
    """Change of B_eff of every robot per relative change of each constant, N m s/rad, (robots,), by its field."""
    if "friction" not in problem.free:
        return {}
    rates = problem.experiment.motor_rate.mean[None]
    found = {}
    for field, name in ASSUMABLE.items():
        up, down = (
            problem.friction(z[None], rates, reading, {name: np.full((1, 1), 1.0 + step)})[0]
            for step in (_STEP, -_STEP)
        )
        found[field] = (up - down) / (2.0 * _STEP)
    return found


def torque_error(problem: Problem) -> float | None:
    """Return half of the relative 95 % interval of the model's torque on the tails: the largest error that is known.

    That of the wire, as against resolved wires, and of the table. None for a model that leaves the walls of the robots'
    tubes out: nothing that is observed tells what these do to the torque.
    """
    if not problem.model.placed:
        return None
    robots = problem.experiment.robots
    wire = max(abs(tail_error(RobotBatch.of(robot), CHECKED["slender"]).torque) for robot in robots)
    return 0.01 * wire + problem.interpolation_error


def friction_statement(problem: Problem, friction: Sequence[Estimate], sensitivity: Mapping[str, Samples]) -> str:
    """Constants that the intervals of B_eff take as exact, with its sensitivity to each; empty without B_eff."""
    middle = np.array([item.value for item in friction])
    middle = np.abs(middle[np.isfinite(middle)])
    if middle.size == 0 or not np.median(middle) > 0:
        return ""
    moves = ", ".join(
        f"{np.nanmedian(change) / np.median(middle):+.2g} % ({field})" for field, change in sensitivity.items()
    )
    known = problem.assumed
    stated = [f"{field} ({100 * known[name]:g} %)" for field, name in ASSUMABLE.items() if name in known]
    exact = [field for field, name in ASSUMABLE.items() if name not in known]
    said = [f"hold the stated uncertainty of {_listed(stated)}"] if stated else []
    said += [f"take {_listed(exact)} as exact"] if exact else []
    subject, verbs, advice = "intervals of B_eff", " and ".join(said), ""
    if not any(np.isfinite(item.low) for item in friction):
        subject, verbs = "B_eff", verbs.replace("take ", "takes ", 1)
    elif exact:
        advice = f"; --assume-uncertainty {exact[0]}=5% would put 5 % into them"
    rests = f"{verbs}: one per cent more of it moves B_eff by {moves}, medians of the tails{advice}"
    model, off = f"model '{problem.model.name}'", torque_error(problem)
    if off is not None:
        return f"{subject} {rests}; an error of {100 * off:.2g} % of the torque by {model} is in them"
    missed = f"B_eff also holds what {model} misses of the torque, walls above all, so that it is given no interval"
    if subject == "B_eff":
        return f"{subject} {rests}; {missed}"
    half = float(np.nanmedian([0.5 * (item.high - item.low) for item in friction]) / np.median(middle))
    return f"were the model exact, {subject} would reach {100 * half:.2g} % to either side and {rests}; {missed}"


def _listed(items: Sequence[str]) -> str:
    return items[0] if len(items) == 1 else f"{', '.join(items[:-1])} and {items[-1]}"
