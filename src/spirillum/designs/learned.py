"""Surrogates of models that solve for the flow, and the search that refines them.

What moves a robot along its tube is A, the symmetric positive definite resistance of (U, Omega, omega). Let
A_0 = L L^T be that of the fast model (slender-body theory without calibration). At a few designs the flow is solved
for, and the logarithm of C = L^-1 A L^-T, six numbers, is interpolated between them by cubic radial basis functions
with a linear part (Duchon 1977, `scipy.interpolate.RBFInterpolator`). So A = L exp(log C) L^T is positive definite
everywhere, exact where it was solved for, and as smooth as the two models. Viscosity, friction, motor and battery do
not change C: what is not known of them costs no solve.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from spirillum.arrays import Axial, Matrix6, Matrix12, PerRobot, Samples
from spirillum.designs.criteria import TURNS, Space, Variable
from spirillum.designs.design_result import Learned
from spirillum.designs.evaluation import Evaluation, SampledRobots, Unknowns
from spirillum.designs.search import Archive, SearchResult, best_design
from spirillum.errors import InputError
from spirillum.fluid.closed.sbt import Sbt
from spirillum.fluid.model import SwimmerModel
from spirillum.fluid.registry import find_swimmer_model, quickest
from spirillum.fluid.tube.domain import pose_limits
from spirillum.fluid.wire.slender import Slender
from spirillum.progress import Progress, tell
from spirillum.robot.batch import RobotBatch
from spirillum.robot.limits import Limit, all_hold
from spirillum.robot.robot import Robot
from spirillum.swimming.balance import joined
from spirillum.swimming.preparation import AUTO, WALLED, ModelChoice, choose_model
from spirillum.swimming.steady import speed_error

_COLUMNS = {
    "tail.wavelength": "wavelength",
    "tail.amplitude": "amplitude",
    "tail.length": "tail_length",
    "tail.wire_diameter": "wire_diameter",
}
_FREE = ("fluid.", "friction.", "motor.", "battery.", "drive.")  # fields that the correction does not depend on
_MOST_FIELDS = 3
_UPPER = np.triu_indices(3)
_PLACES = np.array([0, 1, 3])  # U, Omega, omega in the axial form of both parts; the whole's force stands with the body


@dataclass(frozen=True)
class Points:
    """Designs at which the flow was solved for."""

    variables: tuple[Variable, ...]  #: Fields of the tail that are varied.
    features: Samples  #: Positions of the designs in their ranges, (points, fields).
    logarithms: Samples  #: Upper triangle of log C, (points, 6).

    def without(self, number: int) -> Points:
        """All points but one."""
        rest = np.arange(len(self.features)) != number
        return replace(self, features=self.features[rest], logarithms=self.logarithms[rest])

    def joined(self, more: Points) -> Points:
        """These points and those of others that differ from them."""
        apart = np.abs(more.features[:, None] - self.features)
        new = ~np.any(np.all(apart < 1e-9, axis=2), axis=1)
        features = np.concatenate([self.features, more.features[new]])
        return replace(self, features=features, logarithms=np.concatenate([self.logarithms, more.logarithms[new]]))

    def at(self, features: Samples) -> Samples:
        """Upper triangle of log C at designs, (designs, 6)."""
        count, fields = self.features.shape
        if fields == 0 or count <= fields + 1:
            return np.tile(self.logarithms.mean(axis=0), (len(features), 1))
        from scipy.interpolate import RBFInterpolator

        found: Samples = RBFInterpolator(self.features, self.logarithms, kernel="cubic", degree=1)(features)
        return found


def features_of(batch: RobotBatch, variables: tuple[Variable, ...]) -> Samples:
    """Positions of the robots of a batch in the ranges of some fields of the tail, (robots, fields)."""
    found = np.zeros((batch.size, len(variables)))
    for column, item in enumerate(variables):
        values = batch.tail_length / batch.wavelength if item.path == TURNS else getattr(batch, _COLUMNS[item.path])
        found[:, column] = (values - item.low) / max(item.high - item.low, 1e-300)
    return found


class Corrected(SwimmerModel):
    """`tube`, at the reference pose, or `slender` as it is learned: axial entries only."""

    title = "learned"
    references = ("lighthill1976", "perrin1934")
    known_error = "interpolated between designs that were solved for"
    parts = ()
    axial_only = True

    def __init__(self, name: str, points: Points) -> None:
        """Answer between some points."""
        self.name, self.points = name, points

    def domain(self, batch: RobotBatch) -> list[Limit]:
        """Limits of the model and of the fast model; evaluated once for each tail."""
        features = features_of(batch, self.points.variables)
        _, first, inverse = np.unique(features, axis=0, return_index=True, return_inverse=True)
        few, index = batch.taken(first), np.ravel(inverse)
        walled = self.name == WALLED
        own = pose_limits(few, "robot", Slender().part_domain(few, "robot")) if walled else Slender().domain(few)
        return [_spread(item, index, batch.size) for item in (*own, *Sbt().domain(few))]

    def axial(self, batch: RobotBatch) -> Axial:
        """See `SwimmerModel.axial`."""
        features = features_of(batch, self.points.variables)
        each, inverse = np.unique(features, axis=0, return_inverse=True)
        correction = _exponential(self.points.at(each))[np.ravel(inverse)]
        fast, sound = _fast(batch)
        lower = np.linalg.cholesky(fast)
        whole = lower @ correction @ np.swapaxes(lower, -1, -2) - _of_no_body(batch)
        found = np.zeros((batch.size, 4, 4))
        found[:, _PLACES[:, None], _PLACES] = np.where(sound[:, None, None], whole, np.nan)
        return found

    def resistance(self, batch: RobotBatch, phase: PerRobot) -> Matrix12:  # noqa: ARG002 - not known at any phase
        """Not known: NaN."""
        return np.full((batch.size, 12, 12), np.nan)

    def part_matrix(self, batch: RobotBatch, part: str, phase: PerRobot) -> Matrix6:  # noqa: ARG002 - of no part
        """Not known: NaN."""
        return np.full((batch.size, 6, 6), np.nan)


def _spread(limit: Limit, index: np.ndarray[Any, Any], size: int) -> Limit:
    """A limit of a few tails for all robots that have one of them."""
    few = int(index.max()) + 1

    def all_of(column: Any) -> Any:
        values = np.asarray(column)
        return values[index] if values.size == few and size > 1 else column

    return limit._replace(value=all_of(limit.value), bound=all_of(limit.bound), holds=all_of(limit.holds))


def _fast(batch: RobotBatch) -> tuple[Samples, Samples]:
    """A_0 of the fast model, (robots, 3, 3), one where it has none, and whether it has."""
    with np.errstate(all="ignore"):
        found = np.broadcast_to(joined(Sbt().axial(batch)) + _of_no_body(batch), (batch.size, 3, 3))
    size = np.sqrt(np.abs(np.diagonal(found, axis1=-2, axis2=-1)))
    sound = np.all(np.isfinite(found), axis=(-2, -1)) & np.all(size > 0, axis=-1)
    plain = np.where(sound[:, None, None], found, np.eye(3))
    scale = np.where(sound[:, None], size, 1.0)
    least = np.linalg.eigvalsh(plain / (scale[:, :, None] * scale[:, None, :]))[:, 0]
    sound &= least > 0
    return np.where(sound[:, None, None], plain, np.eye(3)), sound


def _of_no_body(batch: RobotBatch) -> Samples:
    """Stand-in for the rotational drag of the body, (3, 3), of a bare tail: it keeps A positive definite."""
    return np.diag([0.0, float(batch.shape == "none"), 0.0])


def _exponential(upper: Samples) -> Samples:
    """Exponentials of symmetric matrices from their upper triangles, (n, 3, 3)."""
    full = np.zeros((len(upper), 3, 3))
    full[:, _UPPER[0], _UPPER[1]] = upper
    full[:, _UPPER[1], _UPPER[0]] = upper
    return _of_eigenvalues(full, np.exp)


def _of_eigenvalues(matrices: Samples, function: Callable[[Samples], Samples]) -> Samples:
    """A function of symmetric matrices, (n, 3, 3)."""
    values, vectors = np.linalg.eigh(matrices)
    found: Samples = (vectors * function(values)[:, None, :]) @ np.swapaxes(vectors, -1, -2)
    return found


def solved_at(name: str, batch: RobotBatch, variables: tuple[Variable, ...]) -> Points:
    """Solve for the flow around some designs."""
    model = find_swimmer_model(name)
    return points_of(batch, variables, lambda one: quickest(model, one).axial(one))


def points_of(batch: RobotBatch, variables: tuple[Variable, ...], solve: Callable[[RobotBatch], Samples]) -> Points:
    """What some designs teach."""
    found = np.concatenate([joined(solve(one)) for _, one in batch.blocks(1)]) + _of_no_body(batch)
    fast, sound = _fast(batch)
    if not (np.all(np.isfinite(found)) and np.all(sound)):
        raise InputError("the flow around a design is not resolved; allowed: narrower ranges")
    lower = np.linalg.inv(np.linalg.cholesky(fast))
    logarithm = _of_eigenvalues(lower @ found @ np.swapaxes(lower, -1, -2), np.log)
    return Points(variables, features_of(batch, variables), logarithm[:, _UPPER[0], _UPPER[1]])


def is_learned(model: SwimmerModel, space: Space, unknowns: Unknowns) -> bool:
    """Whether a search learns the flow of a model: always with walls, else where the fields allow it."""
    if model.closed_form:  # it is evaluated itself
        return False
    own, strange = _flow_fields(space)
    return model.placed or not unknowns.known or (not strange and len(own) <= _MOST_FIELDS)


def _flow_fields(space: Space, unknown: Sequence[Variable] = ()) -> tuple[tuple[Variable, ...], list[str]]:
    """Fields that are varied and change the flow; names of those, varied or unknown, of which it cannot be learned."""
    own = tuple(item for item in space.variables if not item.path.startswith(_FREE))
    strange = [item.path for item in own if item.path not in (*_COLUMNS, TURNS)]
    return own, strange + [item.path for item in unknown if not item.path.startswith(_FREE)]


def chosen_model(requested: str, robot: Robot, space: Space, unknowns: Unknowns) -> ModelChoice:
    """The named model, or with `auto` the most complete one that applies to the robot."""
    choice = choose_model(requested, robot, fit=unknowns.fit)
    if requested != AUTO or unknowns.posterior is not None:
        return choice
    own, strange = _flow_fields(space, unknowns.ranges)
    if not strange and len(own) <= _MOST_FIELDS:
        return choice
    what = f"{strange[0]} is no field of the tail" if strange else f"{len(own)} fields of the tail are varied"
    why = f"{what}, and the flow is learned around tails alone, {_MOST_FIELDS} fields at most"
    if choice.model == WALLED:
        raise InputError(f"{why}; allowed: such fields, or model 'sbt', which leaves out the walls")
    return ModelChoice("sbt", why)


def check_learnable(name: str, space: Space, unknowns: Unknowns) -> tuple[Variable, ...]:
    """Fields of the tail that are varied, of which the flow has to be learned."""
    if unknowns.posterior is not None:
        raise InputError(f"model = '{name}' with a posterior; allowed: sbt or rft with it, or ranges (unknown)")
    own, strange = _flow_fields(space, unknowns.ranges)
    if strange:
        raise InputError(
            f"{strange[0]} with model = '{name}', which learns the flow around tails; allowed: to vary "
            f"{', '.join(_COLUMNS)}, {TURNS}, and any fields of fluid, friction, motor, battery and drive"
        )
    if len(own) > _MOST_FIELDS:
        raise InputError(f"{len(own)} fields of the tail with model = '{name}'; allowed: at most {_MOST_FIELDS}")
    return own


_AGREES = 2e-3  # relative difference of the objective, learned and solved, at which the search ends
_ROUNDS = 5
_CANDIDATES = 64
_FEWEST, _FOR_EACH = 4, 3  # designs solved before the first search: so many, and so many for each field of the tail

Solve = Callable[[RobotBatch, tuple[Variable, ...]], Points]


def learned_best(
    blank: Evaluation, unknowns: Unknowns, name: str, seed: int, progress: Progress | None, solve: Solve | None = None
) -> tuple[Evaluation, Archive, SearchResult, Learned]:
    """Designs with the learned model, all that the last search has evaluated, the best, and how well it is known."""
    own = check_learnable(name, blank.space, unknowns)
    solving = solve or (lambda batch, variables: solved_at(name, batch, variables))
    empty = replace(blank, model=Corrected(name, Points(own, np.zeros((0, len(own))), np.zeros((0, 6)))))
    first = _first_designs(empty, own, seed)
    points = _solved(empty, first, own, solving, progress, None)
    last = 1.0
    for number in range(_ROUNDS):
        evaluation, archive = replace(blank, model=Corrected(name, points)), Archive()
        best = best_design(evaluation, archive, seed=seed, progress=progress)
        if not best.possible or last <= _AGREES:
            break
        before = _objective(evaluation, best.shares)
        more = [best.shares, *_runner_up(evaluation, archive, best.shares, number)]
        points = _solved(empty, np.stack(more), own, solving, progress, points)
        after = _objective(replace(blank, model=Corrected(name, points)), best.shares)
        last = abs(before / after - 1.0) if after else abs(before - after)
    stated = stated_error(evaluation, name, best.shares) if best.possible else np.nan
    known = Learned(len(points.features), last, _cross_validation_error(evaluation, name, points), stated)
    return evaluation, archive, best, known


def stated_error(evaluation: Evaluation, name: str, best: Samples) -> float:
    """Return the error that a model states of the speed of the best design, of its table or its own refinement."""
    batch = evaluation.space.batch(best[None])
    model = quickest(find_swimmer_model(name), batch)
    if not (finer := model.checked_by(batch)):
        return model.stated_speed_error(batch)
    alone = replace(evaluation, samples=SampledRobots(RobotBatch.of(evaluation.space.robot), {}, 1))
    speeds = [replace(alone, model=one).motion(best[None]).forward_velocity for one in (model, *finer)]
    return float(speed_error(speeds, model.unchecked_error(batch))[0])


def _objective(evaluation: Evaluation, shares: Samples) -> float:
    """Statistic of the first objective of one design."""
    return float(evaluation.scores(shares[None]).values[0, 0])


def _first_designs(empty: Evaluation, own: tuple[Variable, ...], seed: int) -> Samples:
    """Designs that can be built: the corners of the ranges of the tail's fields, and points between, spread evenly."""
    from scipy.stats import qmc

    space = empty.space
    chosen = [n for n, item in enumerate(space.variables) if item in own]
    if not own:
        return np.full((1, space.size), 0.5)
    inner = qmc.Sobol(len(own), rng=np.random.default_rng(seed)).random(_CANDIDATES)
    corners = np.array(list(product((0.0, 1.0), repeat=len(own))))
    anywhere = np.full((len(corners) + len(inner), space.size), 0.5)
    anywhere[:, chosen] = np.concatenate([corners, inner])
    shares = space.settled(anywhere)
    able = np.flatnonzero(empty.unbuildable(shares) <= 0)
    if able.size == 0:
        worst = [limit for limit in empty.limits(shares[len(corners)][None]) if not np.all(limit.holds)]
        raise InputError(
            f"no design of {_CANDIDATES} that were tried can be built, the first of them: "
            f"{worst[0].sentence() if worst else 'it breaks several limits'}; allowed: wider ranges"
        )
    most = int(np.count_nonzero(able < len(corners))) + _FEWEST + _FOR_EACH * len(own)
    _, kept = np.unique(np.round(shares[able], 9), axis=0, return_index=True)
    return shares[able[np.sort(kept)][:most]]


def _solved(
    empty: Evaluation,
    shares: Samples,
    own: tuple[Variable, ...],
    solving: Solve,
    progress: Progress | None,
    points: Points | None,
) -> Points:
    """Solve for designs one by one, first of all for today's, and add what they teach."""
    batches = [block for _, block in empty.space.batch(shares).blocks(1)] if len(shares) else []
    if points is None:
        today = RobotBatch.of(empty.space.robot)
        batches = [*([today] if bool(np.all(all_hold(empty.limits(None)))) else []), *batches]
    for number, batch in enumerate(batches):
        tell(progress, "tails that are solved for", number, len(batches))
        more = solving(batch, own)
        points = more if points is None else points.joined(more)
    assert points is not None  # noqa: S101 - there is a design
    return points


def _runner_up(evaluation: Evaluation, archive: Archive, best: Samples, number: int) -> list[Samples]:
    """Another good design, farther from the best one in earlier rounds: it may be better than it is thought to be."""
    shares, values = archive.all()
    objective = evaluation.objectives[0]
    worth = values[0] * objective.direction
    apart = np.max(np.abs(shares - best), axis=1) >= 0.2 / (1 + number)
    worth = np.where(apart & np.isfinite(worth), worth, -np.inf)
    first = int(np.argmax(worth))
    return [shares[first]] if np.isfinite(worth[first]) else []


def _cross_validation_error(evaluation: Evaluation, name: str, points: Points) -> float:
    """Error of the objective where a solved design is learned from the others, of the better half of them."""
    space = evaluation.space
    chosen = [n for n, item in enumerate(space.variables) if item in points.variables]
    errors = []
    for number, feature in enumerate(points.features):
        shares = np.full(space.size, 0.5)
        shares[chosen] = feature
        if not np.all((feature >= 0) & (feature <= 1)) or len(points.features) < len(chosen) + 3:
            continue
        shares = space.settled(shares[None])[0]
        true = _objective(evaluation, shares)
        guess = _objective(replace(evaluation, model=Corrected(name, points.without(number))), shares)
        if np.isfinite(true) and np.isfinite(guess) and true:
            errors.append((evaluation.objectives[0].sign * true, guess / true - 1.0))
    better = [error for _, error in sorted(errors, reverse=True)[: (len(errors) + 1) // 2]]
    return float(np.sqrt(np.mean(np.square(better)))) if better else float("nan")
