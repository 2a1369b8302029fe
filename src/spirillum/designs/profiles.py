"""The objective along one variable through the best design: how exactly it has to be built, and what binds."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from spirillum.arrays import Samples
from spirillum.designs.design_result import ObjectiveProfile
from spirillum.designs.evaluation import Evaluation
from spirillum.robot.limits import broken

_PROFILE_POINTS = 41
_HALVINGS = 12
_FLAT = 0.01
"""Loss of the objective up to which a variable is free, relative."""
_TOUCHES = 1e-3
"""Share of a range, or relative excess of a constraint, within which the best design is at its bound."""


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
    sign = 1.0 if objective.target is not None else objective.sign
    near = np.where(np.isfinite(found), sign * (found[own] - found), np.inf) <= _FLAT * abs(found[own])
    first, last = own, own
    while first > 0 and near[first - 1]:
        first -= 1
    while last < len(near) - 1 and near[last + 1]:
        last += 1
    low, high = float(values[first]), float(values[last])
    if not variable.is_whole:
        low, high = (_edge(searched, best, number, along, side) for side in ((first, -1), (last, 1)))
    return ObjectiveProfile(
        variable.path,
        variable.unit,
        values,
        found,
        low,
        high,
        _binds(searched, shares, found, own),
    )


def _edge(searched: Evaluation, best: Samples, number: int, along: Samples, side: tuple[int, int]) -> float:
    """Value beyond which the objective is lost or a condition broken, between two points of a profile, by bisection."""
    variable, objective = searched.space.variables[number], searched.objectives[0]
    sign = 1.0 if objective.target is not None else objective.sign
    most = float(searched.scores(best[None]).values[0, 0])
    inside, beyond = float(along[side[0]]), side[0] + side[1]
    if not 0 <= beyond < len(along):
        return float(variable.at(np.array([inside]))[0])
    outside = float(along[beyond])
    for _ in range(_HALVINGS):
        middle = best.copy()
        middle[number] = 0.5 * (inside + outside)
        value = float(searched.scores(middle[None]).values[0, 0])
        if sign * (most - value) <= _FLAT * abs(most):
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
            swum = searched.swum(shares[side][None])
            words += [item.words for item in searched.conditions if searched.excess(item, swum)[0] > 0]
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
