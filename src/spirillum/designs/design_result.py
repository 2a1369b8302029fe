"""The result of a design: the best values, their profiles, and whether they are better than others."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from spirillum.answer_entries import answer_of, content_of
from spirillum.arrays import Samples
from spirillum.designs.evaluation import Evaluation, Objective
from spirillum.designs.search import ConfirmedDesign
from spirillum.display import DisplayMixin, percent
from spirillum.envelope import interval, quantity
from spirillum.fluid.registry import find_swimmer_model
from spirillum.notes import Note
from spirillum.robot.limits import broken
from spirillum.robot.robot import Robot
from spirillum.swimming.motions import LEVEL, STEADY

_LANDSCAPE_POINTS = 41


@dataclass(frozen=True)
class Alternative:
    """A design to compare with; SI."""

    name: str  #: `today` or `runner_up`.
    values: Mapping[str, float]  #: Fields with their values.
    objective: float
    beaten: float  #: Share of the draws in which the best design is better; without unknowns 0 or 1.
    beaten_low: float  #: Lower end of the 95 % interval of that probability, from the finite number of draws.
    beaten_high: float  #: Upper end.
    keeps: bool  #: Whether it can be built and keeps all conditions.


@dataclass(frozen=True)
class ObjectiveProfile:
    """The objective along one variable, the others as in the best design; SI."""

    path: str
    unit: str
    values: Samples  #: Of the variable, (points,).
    objective: Samples  #: (points,); NaN where a design is refused or breaks a condition.
    low: float  #: Least value at which the objective is within one per cent of the best.
    high: float  #: Largest such value.
    binds: str  #: What ends the range that is allowed, beside the best value; empty where nothing does.


@dataclass(frozen=True)
class Uncertainty:
    """What the unknowns make of the best design."""

    draws: int  #: Number of draws from which it is stated; none of them was used in the search.
    low: Mapping[str, float]  #: Lower ends of the 95 % intervals of all quantities, SI.
    high: Mapping[str, float]
    probability: tuple[float, float, float] | None  #: That the target is met, with its 95 % interval; None without one.
    deciding: Mapping[str, float]
    """Unknown to the share of the objective's spread that goes with it: squared rank correlation over the draws."""


class Learned(NamedTuple):
    """How well a model that is learned is known where the best design is."""

    solves: int  #: Designs around which the flow was solved for.
    last: float  #: Relative difference of the objective of the best design, learned and then solved.
    left_out: float
    """Root mean square error of the objective of the better half of the solved designs, each learned from the others,
    relative."""
    stated: float = math.nan  #: Relative error that the model states of the best design's speed; NaN for none.


@dataclass(frozen=True, repr=False)
class Design(DisplayMixin):
    """The best values of some fields of a robot, SI."""

    robot: Robot  #: The robot with the best values.
    today: Robot = field(repr=False)  #: The robot as it was given.
    model: str
    objectives: tuple[Objective, ...] = field(repr=False)
    conditions: tuple[str, ...]
    values: Mapping[str, float]  #: Fields with their best values.
    units: Mapping[str, str] = field(repr=False)
    objective: float  #: The objective of the best design, from draws that were not used in the search.
    quantities: Mapping[str, float] = field(repr=False)  #: Every quantity of steady swimming, its mean over the draws.
    uncertainty: Uncertainty | None
    alternatives: tuple[Alternative, ...]
    profiles: tuple[ObjectiveProfile, ...] = field(repr=False)
    front: Mapping[str, Samples] | None = field(repr=False)
    """With two objectives, designs of which none is better in both: fields and both objectives, (points,)."""
    searched: Evaluation = field(repr=False, compare=False)  #: Designs under the draws of the search.
    bound_by: tuple[str, ...]  #: What the best design touches: ends of ranges and conditions.
    swum: int
    refused: int
    breaking: int
    warnings: tuple[Note, ...]
    learned: Learned | None = None  #: Accuracy of a model that solves for the flow; None: it solved for every design.
    model_reason: str = ""  #: Reason of the model, in half a sentence; empty where it was named.
    leading: tuple[Samples, ...] = field(default=(), repr=False)
    """The best design and the next ones, at least a tenth of a range apart: positions in the ranges, (variables,)."""
    confirmed: tuple[ConfirmedDesign, ...] = ()  #: Trials of these, by `tube`; none for other models.

    @property
    def calibrated(self) -> bool:
        """Whether calibration factors for this model, the robot's or a posterior's, apply to every design."""
        return self.model in self.searched.space.robot.calibration

    @property
    def winding(self) -> dict[str, float]:
        """How to wind the tail: mandrel, pitch, turns and length of wire, m."""
        tail = self.robot.tail
        return {
            "mandrel_diameter": 2.0 * tail.amplitude - tail.wire_diameter,
            "pitch": tail.wavelength,
            "turns": tail.length / tail.wavelength,
            "wire_length": self.robot.derived()["arc_length"].value,
        }

    @cached_property
    def landscape(self) -> tuple[Samples, Samples, Samples] | None:
        """With two variables: their values and the objective under the draws of the search, (n,), (m,), (m, n)."""
        variables = self.searched.space.variables
        if len(variables) != 2:
            return None
        axes = []
        for item in variables:
            whole = [item.share(value) for value in np.arange(item.low, item.high + 1.0)] if item.is_whole else None
            axes.append(np.linspace(0.0, 1.0, _LANDSCAPE_POINTS) if whole is None else np.array(whole))
        x, y = np.meshgrid(*axes)
        values = self.searched.scores(np.stack([x.ravel(), y.ravel()], axis=-1)).values[0]
        return variables[0].at(axes[0]), variables[1].at(axes[1]), values.reshape(x.shape)

    def to_dict(self) -> dict[str, Any]:
        """The answer of `spirillum design --json`."""
        named = {item.name: item for item in STEADY}
        unit, known, units = self.objectives[0].unit, self.uncertainty, dict(self.units)
        units |= {item.name: item.unit for item in self.objectives}
        probability = None if known is None else known.probability
        return answer_of(
            self,
            best=self._fields(self.values),
            to_wind={name: quantity(value, "1" if name == "turns" else "m") for name, value in self.winding.items()},
            gives={
                name: quantity(value, named[name].unit, **self._ends(name)) for name, value in self.quantities.items()
            },
            compared=[
                content_of(
                    other,
                    design=self._fields(other.values),
                    unit=unit,
                    better=quantity(other.beaten, "1", **interval(other.beaten_low, other.beaten_high, LEVEL)),
                )
                for other in self.alternatives
            ],
            sensitivity={
                profile.path: content_of(profile, flat=[profile.low, profile.high], of=unit)
                for profile in self.profiles
            },
            trials=[
                {
                    "design": self._fields(self.searched.space.named(one.shares)),
                    "held": {"forward_velocity": quantity(one.held, "m/s")},
                    "trial": one.trial,
                }
                for one in self.confirmed
            ],
            met=None if probability is None else quantity(probability[0], "1", **interval(*probability[1:], LEVEL)),
            both={name: quantity(column, units[name]) for name, column in (self.front or {}).items()},
        )

    def _fields(self, values: Mapping[str, float]) -> dict[str, Any]:
        """Values of the fields that are varied, with their units."""
        return {path: quantity(value, self.units[path]) for path, value in values.items()}

    def _ends(self, name: str) -> dict[str, Any]:
        known = self.uncertainty
        return {} if known is None or name not in known.low else interval(known.low[name], known.high[name], LEVEL)


_PROFILE_POINTS = 41
_HALVINGS = 12
_FLAT = 0.01  # loss of the objective up to which a variable is free, relative
_TOUCHES = 1e-3  # share of a range, or relative excess of a constraint, within which the best design is at its bound


def profile_of(searched: Evaluation, best: Samples, number: int) -> ObjectiveProfile:
    """The objective along one variable through the best design."""
    space, objective = searched.space, searched.objectives[0]
    variable = space.variables[number]
    if variable.is_whole:
        along = np.array([variable.share(value) for value in np.arange(variable.low, variable.high + 1.0)])
    else:
        along = np.union1d(np.linspace(0.0, 1.0, _PROFILE_POINTS), best[number])
    values = variable.at(along)
    shares = np.tile(best, (len(along), 1))
    shares[:, number] = along
    found = searched.scores(shares).values[0]
    own = int(np.argmin(np.abs(values - variable.at(best[None, number])[0])))
    near = np.where(np.isfinite(found), objective.direction * (found[own] - found), np.inf) <= _FLAT * abs(found[own])
    first, last = own, own
    while first > 0 and near[first - 1]:
        first -= 1
    while last < len(near) - 1 and near[last + 1]:
        last += 1
    low, high = float(values[first]), float(values[last])
    if not variable.is_whole:
        low, high = (_edge(searched, best, number, along, side) for side in ((first, -1), (last, 1)))
    return ObjectiveProfile(
        variable.path, variable.unit, values, found, low, high, _binds(searched, shares, found, own)
    )


def _edge(searched: Evaluation, best: Samples, number: int, along: Samples, side: tuple[int, int]) -> float:
    """Value beyond which the objective is lost or a condition broken, between two points of a profile, by bisection."""
    variable, objective = searched.space.variables[number], searched.objectives[0]
    most = float(searched.scores(best[None]).values[0, 0])
    inside, beyond = float(along[side[0]]), side[0] + side[1]
    if not 0 <= beyond < len(along):
        return float(variable.at(np.array([inside]))[0])
    outside = float(along[beyond])
    for _ in range(_HALVINGS):
        middle = best.copy()
        middle[number] = 0.5 * (inside + outside)
        value = float(searched.scores(middle[None]).values[0, 0])
        if objective.direction * (most - value) <= _FLAT * abs(most):
            inside = middle[number]
        else:
            outside = middle[number]
    return float(variable.at(np.array([inside]))[0])


def _binds(searched: Evaluation, shares: Samples, found: Samples, own: int) -> str:
    """What refuses the designs next to the best one along a variable; empty where none is refused."""
    words = []
    for side in (own - 1, own + 1):
        if 0 <= side < len(found) and not np.isfinite(found[side]):
            outside = broken(searched.limits(shares[side][None]))
            if outside:
                words.append(outside[0].why)
                continue
            motion = searched.motion(shares[side][None])
            words += [item.words for item in searched.conditions if searched.excess(item, motion)[0] > 0]
    return "; ".join(dict.fromkeys(words))


def bound_by_of(stated: Evaluation, best: Samples, profiles: Sequence[ObjectiveProfile]) -> tuple[str, ...]:
    """What the best design touches: ends of ranges, and what refuses its neighbours."""
    found = []
    for variable, share in zip(stated.space.variables, best, strict=True):
        value = float(variable.at(np.array([share]))[0])
        for end, where in ((variable.low, "low"), (variable.high, "high")):
            if abs(value - end) <= _TOUCHES * (variable.high - variable.low):
                found.append(f"{variable.path} at the {where} end of its range")
    return (*found, *dict.fromkeys(item.binds for item in profiles if item.binds))


_ALIKE = 1e-9  # relative range of an objective below which it does not change
ALTERNATIVES = {
    "today": "today's design",
    "runner_up": "the best of the designs that differ by a tenth of a range or more",
}
"""What the designs are called that the best one is compared with."""
_SHORT = {"today": "today's design", "runner_up": "the runner-up"}


def margin_warnings(answer: Design) -> tuple[Note, ...]:
    """Notes on fields without influence, on a better design, and on leads below the error of the objective."""
    notes = _without_effect(answer)
    if len(notes) == len(answer.profiles):  # every design is the best one
        return notes
    leads: dict[tuple[float, str], list[str]] = {}
    best, sign = answer.objective, answer.objectives[0].sign
    for other in answer.alternatives:
        error = _error(answer, other)
        if not (other.keeps and math.isfinite(other.objective) and best):
            continue
        lead = sign * (best - other.objective) / abs(best)
        if lead < -_ALIKE and other.name == "today":
            notes += (Note.named("today-is-better", other=ALTERNATIVES[other.name], lead=percent(-lead)),)
        elif lead < error[0]:
            leads.setdefault(error, []).append(f"{_SHORT[other.name]} by {percent(lead)}")
    return notes + tuple(
        Note.named("tied-designs", names=" and ".join(led), error=percent(error), of=of)
        for (error, of), led in leads.items()
    )


def _without_effect(answer: Design) -> tuple[Note, ...]:
    """A sentence for each field along which the objective stays as it is."""
    found = []
    for profile in answer.profiles:
        known = profile.objective[np.isfinite(profile.objective)]
        if known.size > 1 and np.ptp(known) <= _ALIKE * np.abs(known).max():
            name = answer.objectives[0].name.replace("_", " ")
            found.append(Note.named("field-without-effect", name=name, path=profile.path, fields=(profile.path,)))
    return tuple(found)


def _error(answer: Design, other: Alternative) -> tuple[float, str]:
    """The largest relative error that is stated of the objective, and of what it is; 0 where none is stated."""
    objective = answer.objectives[0]
    errors = {}
    if objective.target is None and objective.quantity.name == "forward_velocity":
        stated = find_swimmer_model(answer.model).known_speed_error
        if stated is not None:
            errors[f"that model '{answer.model}' states of a speed"] = stated
        if answer.learned is not None:
            errors[f"that model '{answer.model}' states of both speeds together"] = 2.0 * answer.learned.stated
    if answer.learned is not None:
        known = answer.learned
        errors["of the learned model at the best design"] = known.last
        if other.name != "today":  # today's is solved for
            errors["of the learned model at a design that it was not solved for"] = known.left_out
    finite = {of: error for of, error in errors.items() if math.isfinite(error)}
    of = max(finite, key=lambda name: finite[name], default="")
    return finite.get(of, 0.0), of
