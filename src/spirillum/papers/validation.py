"""The program beside published experiments and computations: a row for each number, a verdict for each statement."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

import numpy as np

from spirillum.answer_entries import answer_of, content_of
from spirillum.citations import REFERENCES
from spirillum.display import DisplayMixin
from spirillum.papers.case import (
    Case,
    CasePoint,
    CaseQuantity,
    CaseStatement,
    CaseTrial,
    CaseValue,
    Provenance,
    has_table,
    load_case,
    recorded_values,
    trials_of,
    values_at,
)
from spirillum.papers.claim import Claim, Verdict
from spirillum.papers.registry import claims_of
from spirillum.papers.studies import study_of
from spirillum.progress import Progress, tell
from spirillum.studies.run import computed_study, study_fingerprint
from spirillum.studies.study_loader import load_study


@dataclass(frozen=True)
class AssumptionEffect:
    """Value of a row under one value of an assumption."""

    assumption: str
    value: str
    ours: float  #: In the unit of the row.


@dataclass(frozen=True)
class ValidationRow:
    """A quantity of one robot at one condition, published and computed, in the unit of the publication."""

    case: str
    point: str
    x: float | None
    series: str
    name: str
    quantity: CaseQuantity
    published: float | None  #: None where only a trend was published.
    uncertainty: float | None  #: Published, in the same unit; None where none is stated.
    ours: float
    stated_error: float | None  #: Relative error that the program states of its value; None where it states none.
    effects: tuple[AssumptionEffect, ...]
    computed: bool  #: Whether ours was computed now; else it is the recorded value, of a run that lacks its table.
    recorded: float  #: The program's value when the case was written.
    recorded_within: float

    @property
    def difference(self) -> float | None:
        """Ours over published, minus one."""
        return None if self.published is None else self.ours / self.published - 1.0

    @cached_property
    def ends(self) -> tuple[float, float]:
        """Ours under the assumptions: the largest fall and rise by each, added in quadrature."""
        falls, rises = [], []
        for name in dict.fromkeys(effect.assumption for effect in self.effects):
            steps = [effect.ours - self.ours for effect in self.effects if effect.assumption == name]
            falls.append(min(0.0, *steps))
            rises.append(max(0.0, *steps))
        return self.ours - math.hypot(*falls), self.ours + math.hypot(*rises)

    @property
    def covered_by(self) -> str | None:
        """Reason why the published value is covered; None without one.

        `stated error`, together with the published uncertainty; these and the `assumptions`; or `nothing`.
        """
        if self.published is None:
            return None
        room = (self.stated_error or 0.0) * abs(self.ours) + (self.uncertainty or 0.0)
        if abs(self.ours - self.published) <= room:
            return "stated error"
        low, high = self.ends
        return "assumptions" if low - room <= self.published <= high + room else "nothing"

    @property
    def is_as_recorded(self) -> bool:
        """Whether ours is within its recorded range."""
        return abs(self.ours - self.recorded) <= self.recorded_within * abs(self.recorded)

    def to_dict(self) -> dict[str, Any]:
        """The row as data, SI."""
        si, covered, (low, high) = self.quantity.si_value, self.covered_by, self.ends
        within = self.recorded_within * abs(self.recorded)
        stated = {"published": self.published, "uncertainty": self.uncertainty}
        return {
            "case": self.case,
            "point": self.point,
            "quantity": self.quantity.label,
            **{name: None if value is None else si * value for name, value in stated.items()},
            "unit": self.quantity.si_unit or self.quantity.unit,
            "ours": si * self.ours,
            "difference": self.difference,
            "stated_error": self.stated_error,
            "low": si * low,
            "high": si * high,
            "covered": None if covered is None else covered != "nothing",
            "covered_by": covered,
            "assumptions": [
                {"name": one.assumption, "value": one.value, "ours": si * one.ours} for one in self.effects
            ],
            "recorded": {"low": si * (self.recorded - within), "high": si * (self.recorded + within)},
            "as_recorded": self.is_as_recorded,
            "computed": self.computed,
        }


@dataclass(frozen=True)
class RatioSummary:
    """Ours over published of all rows of a quantity."""

    quantity: str
    mean: float
    deviation: float  #: Sample standard deviation; zero for a single row.
    count: int
    covered: int


@dataclass(frozen=True)
class CaseResult:
    """A case with its rows and statements."""

    name: str
    case: Case
    rows: tuple[ValidationRow, ...]
    statements: tuple[Claim, ...]
    read: tuple[Provenance, ...]  #: How each of the statements was read.

    @property
    def summaries(self) -> list[RatioSummary]:
        """Ours over published by quantity."""
        found = []
        for name, quantity in self.case.quantities.items():
            rows = [row for row in self.rows if row.name == name and row.published]
            if rows:
                ratios = np.array([row.ours / row.published for row in rows if row.published])
                deviation = float(ratios.std(ddof=1)) if len(rows) > 1 else 0.0
                covered = sum(row.covered_by != "nothing" for row in rows)
                found.append(RatioSummary(quantity.label, float(ratios.mean()), deviation, len(rows), covered))
        return found

    def counted(self) -> dict[str, int]:
        """Number of statements by verdict."""
        verdicts = [claim.verdict for claim in self.statements]
        return {verdict: verdicts.count(verdict) for verdict in dict.fromkeys(verdicts)}

    def to_dict(self) -> dict[str, Any]:
        """The case as data, without its rows."""
        judged = [{**asdict(one), "read": read} for one, read in zip(self.statements, self.read, strict=True)]
        return content_of(self, references=[REFERENCES[key] for key in self.case.references], judged=judged)


@dataclass(frozen=True, repr=False)
class Validation(DisplayMixin):
    """Cases with their rows: published, ours, difference, stated error, covered or not."""

    cases: tuple[CaseResult, ...]
    folder: str | None = None  #: Folder of the report; None without one.

    @property
    def rows(self) -> tuple[ValidationRow, ...]:
        """The rows of all cases."""
        return tuple(row for case in self.cases for row in case.rows)

    @property
    def outside(self) -> tuple[ValidationRow, ...]:
        """Rows that have left their recorded range."""
        return tuple(row for row in self.rows if not row.is_as_recorded)

    def to_dict(self) -> dict[str, Any]:
        """Content of `spirillum validate --json`, SI."""
        return answer_of(self, left=len(self.outside))

    def __repr__(self) -> str:
        """The cases in a line."""
        return f"Validation({', '.join(case.name for case in self.cases)}; {len(self.rows)} rows)"

    def __str__(self) -> str:
        """A line for each case and quantity, for `print`."""
        return "\n".join(line for case in self.cases for line in case_lines(case))


def case_lines(result: CaseResult) -> Iterable[str]:
    """Lines on a case: ours over published by quantity, verdicts on statements."""
    yield f"{result.name}: {result.case.title}"
    for one in result.summaries:
        spread = f" (sd {one.deviation:.2f})" if one.count > 1 else ""
        yield f"  {one.quantity}: ours/published {one.mean:.2f}{spread}, {one.covered} of {one.count} covered"
    if result.statements:
        yield f"  statements: {', '.join(f'{count} {verdict}' for verdict, count in result.counted().items())}"


def compute_case(name: str, progress: Progress | None = None, *, runs: bool = False) -> CaseResult:
    """Compute all rows of a case and judge its statements; those of runs without a table only with `runs`."""
    case, recorded = load_case(name), recorded_values(name)
    values = _values(name, case, progress, runs=runs)
    rows = tuple(
        _row(name, case, point, quantity, values, recorded[point.label][quantity]) for point, quantity in case.rows()
    )
    claims = [judge_trend(case, statement, rows) for statement in case.statements]
    read: list[Provenance] = [statement.read for statement in case.statements]
    if case.claims:
        loaded = load_study(study_of(case.claims))
        fingerprint = study_fingerprint(loaded, None)
        more = claims_of(computed_study(loaded, None, fingerprint, None, None))
        stated: list[Provenance] = ["text"] * len(more)
        claims, read = [*claims, *more], [*read, *stated]
    return CaseResult(name, case, rows, tuple(claims), tuple(read))


_Values = dict[tuple[str, str, str], dict[str, CaseValue]]
"""Quantities by point, assumption and its value; both empty for the case as it is."""


def _values(name: str, case: Case, progress: Progress | None, *, runs: bool) -> _Values:
    """The quantities of all points, under all assumptions."""
    wanted: dict[str, list[str]] = {}
    for point, quantity in case.rows():
        if point.run and not runs and not has_table(case, point):
            continue
        wanted.setdefault(point.label, []).append(quantity)
    work = [(case.point(label), trial) for label in wanted for trial in (None, *trials_of(case, case.point(label)))]
    values: _Values = {}
    for done, (point, trial) in enumerate(work):
        tell(progress, name, done, len(work))
        values[point.label, *_key(trial)] = values_at(case, point, wanted[point.label], trial, progress)
    tell(progress, name, len(work), len(work))
    return values


def _key(trial: CaseTrial | None) -> tuple[str, str]:
    return ("", "") if trial is None else (trial.assumption, trial.value)


def _row(name: str, case: Case, point: CasePoint, quantity: str, values: _Values, recorded: float) -> ValidationRow:
    computed = (point.label, "", "") in values
    ours = values[point.label, "", ""][quantity] if computed else CaseValue(recorded, None)
    effects = tuple(
        AssumptionEffect(trial.assumption, trial.value, values[point.label, *_key(trial)][quantity].value)
        for trial in (trials_of(case, point) if computed else ())
    )
    return ValidationRow(
        case=name,
        point=point.label,
        x=point.x,
        series=point.series,
        name=quantity,
        quantity=case.quantities[quantity],
        published=point.published.get(quantity),
        uncertainty=point.uncertainty.get(quantity),
        ours=ours.value,
        stated_error=ours.stated_error,
        effects=effects,
        computed=computed,
        recorded=recorded,
        recorded_within=case.recorded_within,
    )


def judge_trend(case: Case, statement: CaseStatement, rows: Sequence[ValidationRow]) -> Claim:
    """Return a published sign or trend with its verdict, from the computed values of its series."""
    low, high = statement.between or (-math.inf, math.inf)
    of = [row for row in rows if row.name == statement.quantity and row.series == statement.series]
    known = sorted((row.x or 0.0, row.ours) for row in of if low <= (row.x or 0.0) <= high)
    values = np.array([value for _, value in known])
    steps = np.diff(values)
    best = int(np.argmax(values))
    holds = {
        "rises": bool(np.all(steps > 0)),
        "falls": bool(np.all(steps < 0)),
        "above": bool(np.all(values > statement.than)),
        "below": bool(np.all(values < statement.than)),
        "has a maximum inside": 0 < best < len(values) - 1,
    }[statement.expect]
    quantity = case.quantities[statement.quantity]
    unit = "" if quantity.unit == "1" else f" {quantity.unit}"
    shown = ", ".join(f"{value:.3g}" for value in values)
    abscissa = f" at {case.x} {', '.join(f'{x:g}' for x, _ in known)}" if case.x else ""
    verdict: Verdict = "agrees" if holds else "disagrees"
    bound = f" {statement.than:g}" if statement.expect in ("above", "below") else ""
    reason = f"{quantity.label} {'' if holds else 'not: '}{statement.expect}{bound}"
    return Claim(statement.statement, statement.expect + bound, f"{shown}{unit}{abscissa}", verdict, reason)
