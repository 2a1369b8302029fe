"""Validation cases: published numbers and statements, the robots they are of, and what had to be assumed.

A case is a folder `papers/NAME` with `case.toml` in the form of `Case`, robot files in `robots`, and `recorded.json`:
the program's own values when the case was written, from which a row may not leave.
"""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterator, Mapping
from functools import lru_cache
from importlib.resources import files
from typing import Any, Literal

from pydantic import Field

from spirillum.errors import InputError, did_you_mean
from spirillum.robot.fields import Section

Provenance = Literal["text", "digitised", "deposit", "abstract", "second hand", "memory"]
"""How a published number or statement was read."""


class CaseQuantity(Section):
    """A quantity of the publication and what it is here."""

    label: str
    """Name in words."""
    of: str
    """`swimming.NAME` of `predict`; `tail.drag`, `tail.thrust` or `tail.torque` of the bare tail; `run.NAME` of the
    robot released in its tube."""
    unit: str = "1"
    """Unit of the published values."""
    si_unit: str = ""
    """SI unit; empty: the same."""
    si_value: float = 1.0
    """SI value of one unit."""
    over: float = 1.0
    """Number by which the program's SI value is divided, such as 6 pi."""
    viscosity: int = 0
    """Power of the viscosity by which it is divided."""
    radius: int = 0
    """Power of the helix's radius by which it is divided."""


class CasePoint(Section):
    """One robot at one condition, with what was published of it."""

    label: str
    x: float | None = None
    """Abscissa in the figure."""
    series: str = ""
    """Curve to which it belongs."""
    robot: str = ""
    """Robot file of the case or preset; empty: the case's."""
    model: str = ""
    """Hydrodynamic model; empty: the case's."""
    set: dict[str, Any] = Field(default_factory=dict)
    """Fields of the robot; `unset` takes one out."""
    placement: dict[str, Any] = Field(default_factory=dict)
    run: dict[str, Any] = Field(default_factory=dict)
    """Settings of a run of the released robot, which needs its table; else none is made."""
    assumed: bool = True
    """Whether the case's assumptions are tried on it."""
    over: str = ""
    """Label of the point by whose values this one's are divided."""
    minus: str = ""
    """Label of the point whose values are subtracted."""
    published: dict[str, float] = Field(default_factory=dict)
    """Published values by quantity, in its unit."""
    uncertainty: dict[str, float] = Field(default_factory=dict)
    """Stated uncertainty of a published value, in the same unit."""


class CaseAssumption(Section):
    """Something that the publication does not state, with a range: each value is tried alone."""

    name: str
    values: list[str]
    """The values tried, in words."""
    set: dict[str, list[Any]] = Field(default_factory=dict)
    """Fields of the robot and their value in each trial."""
    scale: dict[str, list[float]] = Field(default_factory=dict)
    """Fields of the robot and the factor on their nominal value in each trial."""
    placement: dict[str, list[Any]] = Field(default_factory=dict)
    """Fields of the placement and their value in each trial."""
    run: dict[str, list[Any]] = Field(default_factory=dict)
    """Settings of the run and their value in each trial."""
    points: list[str] = Field(default_factory=list)
    """Labels of the points that it concerns; empty: all."""


class CaseStatement(Section):
    """A sign or trend that the publication states, judged on the computed values of a series."""

    statement: str
    read: Provenance
    quantity: str
    series: str = ""
    expect: Literal["rises", "falls", "above", "below", "has a maximum inside"]
    than: float = 0.0
    """Bound of `above` and `below`, in the quantity's unit."""
    between: tuple[float, float] | None = None
    """Abscissae between which it is judged."""


class Case(Section):
    """A validation case."""

    title: str
    references: list[str]
    """Keys of `citations.REFERENCES`."""
    source: str
    """Location of the numbers in the publication, and how they were read."""
    read: Provenance
    kind: Literal["experiment", "computation", "statements"]
    cost: Literal["seconds", "minutes"] = "seconds"
    model: Literal["rft", "sbt", "slender", "tube"] = "slender"
    robot: str = ""
    """Robot of points that name none."""
    settings: dict[str, Any] = Field(default_factory=dict)
    """Fields of all robots."""
    x: str = ""
    """Label of the abscissa."""
    curve: bool = False
    """Whether the figure shows the values over the abscissa too."""
    explanation: str
    """Result of the comparison, and the reasons of its misses."""
    recorded_within: float = 0.01
    """Relative distance from the recorded value within which the program's has to be."""
    quantities: dict[str, CaseQuantity] = Field(default_factory=dict)
    points: list[CasePoint] = Field(default_factory=list)
    assumptions: list[CaseAssumption] = Field(default_factory=list)
    statements: list[CaseStatement] = Field(default_factory=list)
    claims: str = ""
    """Paper whose study gives more statements, see `papers.registry`."""

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
