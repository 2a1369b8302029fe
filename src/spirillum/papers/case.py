"""Validation cases: published numbers and statements, the robots they are of, and the program's values for them.

A case is a folder `papers/NAME` with `case.toml` in the form of `Case`, robot files in `robots`, and `recorded.json`:
the program's own values when the case was written, from which a row may not leave.
"""

from __future__ import annotations

import json
import math
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import lru_cache
from importlib.resources import files
from operator import sub, truediv
from typing import Any, Literal, NamedTuple

from pydantic import Field

from spirillum.errors import InputError, did_you_mean
from spirillum.fluid.reference_errors import CHECKED, tail_error
from spirillum.fluid.registry import resistance
from spirillum.papers.caldag2019.released import released_motion
from spirillum.progress import Progress
from spirillum.robot.batch import RobotBatch
from spirillum.robot.fields import Section, field_values
from spirillum.robot.load import load
from spirillum.robot.placement import Placement
from spirillum.robot.robot import Robot
from spirillum.swimming.prediction import predict_steady
from spirillum.swimming.preparation import missing_tables
from spirillum.swimming.steady import swim

Provenance = Literal["text", "digitised", "deposit", "abstract", "second hand", "memory"]  #: How it was read.


class CaseQuantity(Section):
    """A quantity of the publication and what it is here."""

    label: str  #: Name in words.
    of: str
    """`swimming.NAME` of `predict`; `tail.drag`, `tail.thrust` or `tail.torque` of the bare tail; `run.NAME` of the
    robot released in its tube."""
    unit: str = "1"  #: Unit of the published values.
    si_unit: str = ""  #: SI unit; empty: the same.
    si_value: float = 1.0  #: SI value of one unit.
    over: float = 1.0  #: Number by which the program's SI value is divided, such as 6 pi.
    viscosity: int = 0  #: Power of the viscosity by which it is divided.
    radius: int = 0  #: Power of the helix's radius by which it is divided.


class CasePoint(Section):
    """One robot at one condition, with what was published of it."""

    label: str
    x: float | None = None  #: Abscissa in the figure.
    series: str = ""  #: Curve to which it belongs.
    robot: str = ""  #: Robot file of the case or preset; empty: the case's.
    model: str = ""  #: Hydrodynamic model; empty: the case's.
    set: dict[str, Any] = Field(default_factory=dict)  #: Fields of the robot; `unset` takes one out.
    placement: dict[str, Any] = Field(default_factory=dict)
    run: dict[str, Any] = Field(default_factory=dict)
    """Settings of a run of the released robot, which needs its table; else none is made."""
    assumed: bool = True  #: Whether the case's assumptions are tried on it.
    over: str = ""  #: Label of the point by whose values this one's are divided.
    minus: str = ""  #: Label of the point whose values are subtracted.
    published: dict[str, float] = Field(default_factory=dict)  #: Published values by quantity, in its unit.
    uncertainty: dict[str, float] = Field(default_factory=dict)
    """Stated uncertainty of a published value, in the same unit."""


class CaseAssumption(Section):
    """Something that the publication does not state, with a range: each value is tried alone."""

    name: str
    values: list[str]  #: The values tried, in words.
    set: dict[str, list[Any]] = Field(default_factory=dict)  #: Fields of the robot and their value in each trial.
    scale: dict[str, list[float]] = Field(default_factory=dict)
    """Fields of the robot and the factor on their nominal value in each trial."""
    placement: dict[str, list[Any]] = Field(default_factory=dict)
    """Fields of the placement and their value in each trial."""
    run: dict[str, list[Any]] = Field(default_factory=dict)  #: Settings of the run and their value in each trial.
    points: list[str] = Field(default_factory=list)  #: Labels of the points that it concerns; empty: all.


class CaseStatement(Section):
    """A sign or trend that the publication states, judged on the computed values of a series."""

    statement: str
    read: Provenance
    quantity: str
    series: str = ""
    expect: Literal["rises", "falls", "above", "below", "has a maximum inside"]
    than: float = 0.0  #: Bound of `above` and `below`, in the quantity's unit.
    between: tuple[float, float] | None = None  #: Abscissae between which it is judged.


class Case(Section):
    """A validation case."""

    title: str
    references: list[str]  #: Keys of `citations.REFERENCES`.
    source: str  #: Location of the numbers in the publication, and how they were read.
    read: Provenance
    kind: Literal["experiment", "computation", "statements"]
    cost: Literal["seconds", "minutes"] = "seconds"
    model: Literal["rft", "sbt", "slender", "tube"] = "slender"
    robot: str = ""  #: Robot of points that name none.
    settings: dict[str, Any] = Field(default_factory=dict)  #: Fields of all robots.
    x: str = ""  #: Label of the abscissa.
    curve: bool = False  #: Whether the figure shows the values over the abscissa too.
    explanation: str  #: Result of the comparison, and the reasons of its misses.
    recorded_within: float = 0.01  #: Relative distance from the recorded value within which the program's has to be.
    quantities: dict[str, CaseQuantity] = Field(default_factory=dict)
    points: list[CasePoint] = Field(default_factory=list)
    assumptions: list[CaseAssumption] = Field(default_factory=list)
    statements: list[CaseStatement] = Field(default_factory=list)
    claims: str = ""  #: Paper whose study gives more statements, see `papers.registry`.

    def point(self, label: str) -> CasePoint:
        """Return the point of a label."""
        return next(point for point in self.points if point.label == label)

    def rows(self) -> Iterator[tuple[CasePoint, str]]:
        """Points and their quantities: those published, all of a trend; none of a point that only others refer to."""
        beside = {label for point in self.points for label in (point.over, point.minus)}
        for point in self.points:
            trend = () if point.label in beside else self.quantities
            yield from ((point, quantity) for quantity in point.published or trend)


@lru_cache(maxsize=1)
def case_names() -> tuple[str, ...]:
    """Names of the cases that ship."""
    folders = (files("spirillum") / "papers").iterdir()
    return tuple(sorted(folder.name for folder in folders if (folder / "case.toml").is_file()))


def load_case(name: str) -> Case:
    """Return a case by its name."""
    if name not in case_names():
        raise InputError(f"unknown case {name!r}{did_you_mean(name, case_names())}; allowed: {', '.join(case_names())}")
    return Case.model_validate(tomllib.loads(_text(name, "case.toml")))


def recorded_values(name: str) -> Mapping[str, Mapping[str, float]]:
    """Return the program's recorded values of a case by point and quantity, in the quantity's unit."""
    return dict(json.loads(_text(name, "recorded.json")))


def _text(name: str, file: str) -> str:
    return (files("spirillum") / "papers" / name / file).read_text(encoding="utf-8")


_ENTRIES = {"drag": (0, 0), "thrust": (0, 3), "torque": (3, 3)}  # of the tail's resistance along and about its axis


class CaseValue(NamedTuple):
    """A quantity of a point, in the unit of the case."""

    value: float
    stated_error: float | None  #: Relative error that the program states; None where it states none.


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
    for one in case.assumptions:
        if point.assumed and (not one.points or point.label in one.points):
            for number, value in enumerate(one.values):
                changed: list[dict[str, Any]] = [
                    {name: values[number] for name, values in table.items()}
                    for table in (one.set, one.scale, one.placement, one.run)
                ]
                yield CaseTrial(one.name, value, *changed)


def has_table(case: Case, point: CasePoint) -> bool:
    """Whether the robot of a point has a table for motion in its tube, or none is made of it."""
    return not missing_tables(RobotBatch.of(robot_of(case, point)), "yaw")


def values_at(
    case: Case, point: CasePoint, names: Iterable[str], trial: CaseTrial | None = None, progress: Progress | None = None
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
            values = {
                name: CaseValue(value, None) for name, value in released_motion(robot, point.run, progress).items()
            }
        else:
            values = _KINDS[kind](robot, point.model or case.model, point, trial is None)
        known |= {f"{kind}.{name}": value for name, value in values.items()}
    found = {}
    for name, one in quantities.items():
        divisor = one.over * robot.fluid.viscosity**one.viscosity * robot.tail.amplitude**one.radius * one.si_value
        found[name] = CaseValue(known[one.of].value / divisor, known[one.of].stated_error)
    return found


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


def _swimming(robot: Robot, model: str, point: CasePoint, is_nominal: bool) -> dict[str, CaseValue]:  # noqa: FBT001
    """All quantities of steady swimming, SI; the program states an error of the speed alone."""
    error = math.nan
    if is_nominal or model == "tube":  # which takes the robot's table where there is one
        found = predict_steady(robot, model=model, placement=point.placement, band=False)
        swum, error = found.swimming, found.error_estimate
    else:
        swum = swim(RobotBatch.of(robot, Placement.of(point.placement)), model)
        if not swum.valid[0]:
            raise InputError(f"{robot.name}: model {model!r} has no answer under an assumption of its case")
    values = {name: abs(float(column[0])) for name, column in swum.quantities.items()}
    stated = error if math.isfinite(error) else None
    return {name: CaseValue(value, stated if name in _OF_SPEED else None) for name, value in values.items()}


_OF_SPEED = ("forward_velocity", "advance_per_radian")


def _tail(robot: Robot, model: str, _point: CasePoint, _is_nominal: bool) -> dict[str, CaseValue]:  # noqa: FBT001
    """Entries of the bare tail along and about its axis, SI, with the model's errors on resolved tails."""
    matrix = resistance(robot, part="tail", model=model, about="tail-root").matrix
    errors = tail_error(RobotBatch.of(robot), CHECKED[model])._asdict()
    return {name: CaseValue(abs(float(matrix[index])), abs(errors[name]) / 100.0) for name, index in _ENTRIES.items()}


_KINDS: Mapping[str, Callable[[Robot, str, CasePoint, bool], dict[str, CaseValue]]] = {
    "swimming": _swimming,
    "tail": _tail,
}
"""Kinds of quantities of a robot at a pose."""
