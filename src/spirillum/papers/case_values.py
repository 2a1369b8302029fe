"""Values of a validation case by the program: of a point as it is, and under each assumption."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from operator import sub, truediv
from typing import Any, NamedTuple

from spirillum.dynamics.integration import Progress
from spirillum.errors import InputError
from spirillum.fluid.reference_errors import CHECKED, tail_error
from spirillum.fluid.resistance import resistance
from spirillum.papers.caldag2019.released import released_motion
from spirillum.papers.case import Case, CaseAssumption, CasePoint, CaseQuantity
from spirillum.robot.batch import RobotBatch
from spirillum.robot.fields import field_values
from spirillum.robot.load import load
from spirillum.robot.placement import Placement
from spirillum.robot.robot import Robot
from spirillum.swimming.prediction import predict
from spirillum.swimming.preparation import missing_tables
from spirillum.swimming.steady import swim
from spirillum.swimming.steady_quantities import STEADY

_ENTRIES = {"drag": (0, 0), "thrust": (0, 3), "torque": (3, 3)}
"""Entries of the tail's resistance along and about its axis."""


class CaseValue(NamedTuple):
    """A quantity of a point, in the unit of the case."""

    value: float
    stated_error: float | None
    """Relative error that the program states; None where it states none."""


class CaseTrial(NamedTuple):
    """One value of an assumption."""

    assumption: str
    value: str
    set: Mapping[str, Any]
    scale: Mapping[str, float]
    placement: Mapping[str, Any]
    run: Mapping[str, Any]


def trials_of(case: Case, point: CasePoint) -> Iterator[CaseTrial]:
    """The trials of all assumptions that concern a point."""
    for assumption in case.assumptions:
        if point.assumed and (not assumption.points or point.label in assumption.points):
            yield from _trials(assumption)


def _trials(assumption: CaseAssumption) -> Iterator[CaseTrial]:
    for number, value in enumerate(assumption.values):
        fields = {path: values[number] for path, values in assumption.set.items()}
        factors = {path: values[number] for path, values in assumption.scale.items()}
        place = {name: values[number] for name, values in assumption.placement.items()}
        run = {name: values[number] for name, values in assumption.run.items()}
        yield CaseTrial(assumption.name, value, fields, factors, place, run)


def has_table(case: Case, point: CasePoint) -> bool:
    """Whether the robot of a point has a table for motion in its tube, or none is made of it."""
    return not missing_tables(RobotBatch.of(robot_of(case, point)), "yaw")


def values_at(
    case: Case,
    point: CasePoint,
    names: Iterable[str],
    trial: CaseTrial | None = None,
    progress: Progress | None = None,
) -> dict[str, CaseValue]:
    """Return quantities of a point by name; with a trial without stated errors."""
    found = _own_values(case, point, names, trial, progress)
    other, combine = (point.over, truediv) if point.over else (point.minus, sub)
    if not other:
        return found
    beside = _own_values(case, case.point(other), names, trial, progress)
    return {name: CaseValue(combine(one.value, beside[name].value), None) for name, one in found.items()}


def _own_values(
    case: Case, point: CasePoint, names: Iterable[str], trial: CaseTrial | None, progress: Progress | None
) -> dict[str, CaseValue]:
    robot = robot_of(case, point, trial)
    known: dict[str, CaseValue] = {}
    if trial is not None:
        changed = {"placement": {**point.placement, **trial.placement}, "run": {**point.run, **trial.run}}
        point = point.model_copy(update=changed)
    quantities = {name: case.quantities[name] for name in names}
    for kind in dict.fromkeys(quantity.of.partition(".")[0] for quantity in quantities.values()):
        if kind == "run":
            values = _run(robot, point, progress)
        else:
            values = _KINDS[kind](robot, point.model or case.model, point, trial is None)
        known |= {f"{kind}.{name}": value for name, value in values.items()}
    return {name: _in_unit(known[quantity.of], quantity, robot) for name, quantity in quantities.items()}


def robot_of(case: Case, point: CasePoint, trial: CaseTrial | None = None) -> Robot:
    """Return the robot of a point, with what a trial changes."""
    name, given = point.robot or case.robot, {**case.settings, **point.set}
    if trial is None:
        return load(name, **_unset(given))
    nominal = {item.path: item for item in field_values(load(name, **_unset(given)))}
    scaled = {path: f"{factor * nominal[path].value!r} {nominal[path].unit}" for path, factor in trial.scale.items()}
    return load(name, **_unset({**given, **trial.set, **scaled}))


def _unset(fields: Mapping[str, Any]) -> dict[str, Any]:
    """Fields of a robot; None takes one out."""
    return {path: None if value == "unset" else value for path, value in fields.items()}


def _in_unit(found: CaseValue, quantity: CaseQuantity, robot: Robot) -> CaseValue:
    divisor = quantity.over * robot.fluid.viscosity**quantity.viscosity * robot.tail.amplitude**quantity.radius
    return CaseValue(found.value / divisor / quantity.si_value, found.stated_error)


def _swimming(robot: Robot, model: str, point: CasePoint, is_nominal: bool) -> dict[str, CaseValue]:  # noqa: FBT001
    """All quantities of steady swimming, SI; the program states an error of the speed alone."""
    error = math.nan
    if is_nominal or model == "tube":  # which takes the robot's table where there is one
        found = predict(robot, model=model, placement=point.placement, band=False)
        swum, error = found.swimming, found.error_estimate
    else:
        swum = swim(RobotBatch.of(robot, Placement.of(point.placement)), model)
        if not swum.valid[0]:
            raise InputError(f"{robot.name}: model {model!r} has no answer under an assumption of its case")
    values = {item.name: abs(float(getattr(swum, item.name)[0])) for item in STEADY}
    stated = error if math.isfinite(error) else None
    return {name: CaseValue(value, stated if name in _OF_SPEED else None) for name, value in values.items()}


_OF_SPEED = ("forward_velocity", "advance_per_radian")


def _tail(robot: Robot, model: str, _point: CasePoint, _is_nominal: bool) -> dict[str, CaseValue]:  # noqa: FBT001
    """Entries of the bare tail along and about its axis, SI, with the model's errors on resolved tails."""
    matrix = resistance(robot, part="tail", model=model, about="tail-root").matrix
    errors = tail_error(RobotBatch.of(robot), CHECKED[model])._asdict()
    return {name: CaseValue(abs(float(matrix[place])), abs(errors[name]) / 100.0) for name, place in _ENTRIES.items()}


def _run(robot: Robot, point: CasePoint, progress: Progress | None) -> dict[str, CaseValue]:
    """Motion of the robot released in its tube, SI."""
    return {name: CaseValue(value, None) for name, value in released_motion(robot, point.run, progress).items()}


_KINDS: Mapping[str, Callable[[Robot, str, CasePoint, bool], dict[str, CaseValue]]] = {
    "swimming": _swimming,
    "tail": _tail,
}
"""Kinds of quantities of a robot at a pose."""
