"""Search of the best design, by differential evolution, and trials of the best ones after release in their tubes.

Differential evolution (Storn and Price 1997, `scipy.optimize.differential_evolution`) swims a whole generation under
all draws in one batch. The draws are the same for all designs (common random numbers), so that designs differ by what
they are and not by chance. The best design is then refined by the simplex of Nelder and Mead (1965).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from spirillum.arrays import Flags, Samples
from spirillum.designs.evaluation import BROKEN, REFUSED, Evaluation
from spirillum.dynamics.prediction import predict
from spirillum.progress import Progress, tell
from spirillum.robot.batch import RobotBatch
from spirillum.robot.robot import Robot
from spirillum.swimming.motions import ReleasedMotion
from spirillum.swimming.preparation import WALLED, has_table, preparation_time, prepare_all

_GENERATIONS = 60
_POPULATION = 12  # designs of a generation for each variable
_FEWEST = 24
_CONVERGED = 1e-3
_SAME = 1e-3  # share of a range within which two designs of a front are one
_REFINED = {"xatol": 1e-5, "fatol": 1e-12, "adaptive": True}
_STEPS, _STEPS_ON_FRONT = 400, 80  # designs that the refinement may swim


@dataclass
class Archive:
    """All designs that a search has evaluated."""

    shares: list[Samples] = field(default_factory=list)
    values: list[Samples] = field(default_factory=list)
    """Statistic of every objective; NaN where a design is refused or breaks a condition."""
    refused: int = 0  #: Designs that cannot be built or have no answer.
    breaking: int = 0  #: Designs that break a condition.

    def keep(self, shares: Samples, values: Samples, refused: Flags) -> None:
        """Keep some designs."""
        self.shares.append(shares)
        self.values.append(values)
        self.refused += int(np.count_nonzero(refused))
        self.breaking += int(np.count_nonzero(np.isnan(values[0]) & ~refused))

    @property
    def count(self) -> int:
        """Number of designs."""
        return sum(len(shares) for shares in self.shares)

    def all(self) -> tuple[Samples, Samples]:
        """Shares (designs, variables) and values (objectives, designs)."""
        return np.concatenate(self.shares), np.concatenate(self.values, axis=1)


@dataclass(frozen=True)
class SearchResult:
    """The end of one search."""

    shares: Samples  #: The best design, (variables,).
    cost: float
    possible: bool  #: Whether it can be built and keeps all conditions.


def best_design(
    evaluation: Evaluation,
    archive: Archive,
    *,
    seed: int,
    objective: int = 0,
    above: tuple[int, float] | None = None,
    start: Samples | None = None,
    progress: Progress | None = None,
) -> SearchResult:
    """Minimise the cost of one objective."""
    from scipy.optimize import Bounds, differential_evolution, minimize

    size = evaluation.space.size
    done = [0]

    def costs(shares: Samples) -> Samples:
        scores = evaluation.scores(shares)
        archive.keep(shares, scores.values, scores.refused)
        found = scores.cost[objective]
        if above is not None:
            over = scores.cost[above[0]] - above[1]
            scale = abs(above[1]) or 1.0
            found = np.where(over > 0, np.maximum(found, np.minimum(BROKEN + (over / scale), 0.5 * REFUSED)), found)
        return np.asarray(found)

    def vectorised(columns: Samples) -> Samples:
        return costs(np.clip(columns.T, 0.0, 1.0))

    def generation(intermediate_result: Any) -> bool:
        done[0] += 1
        tell(progress, "designs", min(done[0], _GENERATIONS), _GENERATIONS)
        energies = np.asarray(intermediate_result.population_energies)
        # SciPy's own criterion is relative to the mean, which is large as long as designs are refused.
        return bool(energies.max() < BROKEN and np.ptp(energies) <= _CONVERGED * abs(energies.min()))

    members = max(_FEWEST, _POPULATION * size)
    found = differential_evolution(
        vectorised,
        Bounds(np.zeros(size), np.ones(size)),
        maxiter=_GENERATIONS,
        popsize=max(5, members // size),
        tol=0.0,
        atol=0.0,
        rng=np.random.default_rng(seed),
        callback=generation,
        polish=False,
        init="sobol" if start is None else start,
        updating="deferred",
        vectorized=True,
    )
    best, cost = np.clip(np.asarray(found.x), 0.0, 1.0), float(found.fun)
    free = [n for n, variable in enumerate(evaluation.space.variables) if not variable.is_whole]
    if free and cost < REFUSED:
        whole = best.copy()

        def single(part: Samples) -> float:
            whole[free] = np.clip(part, 0.0, 1.0)
            return float(costs(whole[None])[0])

        edge = 0.02
        simplex = np.tile(best[free], (len(free) + 1, 1))
        for row, _ in enumerate(free):
            simplex[row + 1, row] += edge if simplex[row + 1, row] < 1.0 - edge else -edge
        refined = minimize(
            single,
            best[free],
            method="Nelder-Mead",
            bounds=[(0.0, 1.0)] * len(free),
            options={**_REFINED, "maxfev": _STEPS if above is None else _STEPS_ON_FRONT, "initial_simplex": simplex},
        )
        if refined.fun <= cost:
            best = best.copy()
            best[free], cost = np.clip(refined.x, 0.0, 1.0), float(refined.fun)
    final = evaluation.scores(best[None])
    return SearchResult(best, cost, bool(np.isfinite(final.values[objective, 0])))


def pareto_front(
    evaluation: Evaluation, archive: Archive, *, seed: int, points: int, progress: Progress | None
) -> Samples:
    """Designs of which none is better in both objectives, (points, variables), from one extreme to the other."""
    # The best of the first objective is sought with the second bounded (epsilon-constraint method, Haimes et al. 1971),
    # for bounds that lie evenly between the extremes. Each search begins where all before it have been.
    tell(progress, "designs on the front", 0, points)
    ends = [best_design(evaluation, archive, seed=seed, objective=n) for n in (0, 1)]
    if not all(end.possible for end in ends):
        return np.stack([end.shares for end in ends])
    costs = [evaluation.scores(end.shares[None]).cost[1, 0] for end in ends]
    found = [ends[0].shares]
    for number in range(1, points - 1):
        tell(progress, "designs on the front", number, points)
        bound = float(costs[0] + (costs[1] - costs[0]) * number / (points - 1))
        shares, values = archive.all()
        first, second = (item.direction for item in evaluation.objectives)
        keeps = np.flatnonzero(-second * values[1] <= bound)
        members = max(_FEWEST, _POPULATION * evaluation.space.size)
        rng = np.random.default_rng(len(shares))
        best = keeps[np.argsort(-first * values[0, keeps], kind="stable")][: members // 2]
        anywhere = rng.random((members - len(best), evaluation.space.size))
        start = np.concatenate([shares[best], anywhere])
        one = best_design(evaluation, archive, seed=seed + number, above=(1, bound), start=start)
        found.append(one.shares)
    found.append(ends[1].shares)
    tell(progress, "designs on the front", points, points)
    return _undominated(evaluation, np.stack(found))


def _undominated(evaluation: Evaluation, shares: Samples) -> Samples:
    scores = evaluation.scores(shares)
    cost = scores.cost
    better = np.all(cost[:, None, :] <= cost[:, :, None], axis=0) & np.any(cost[:, None, :] < cost[:, :, None], axis=0)
    kept = evaluation.space.settled(shares[~better.any(axis=1)])
    apart = [n for n in range(len(kept)) if n == 0 or np.max(np.abs(kept[n] - kept[n - 1])) > _SAME]
    return kept[apart]


CONFIRMED = 3  #: Designs that are confirmed.
NEAR = 0.1  #: Designs that are compared differ from each other by at least this share of a range.


@dataclass(frozen=True)
class ConfirmedDesign:
    """One of the best designs with what it does in a trial."""

    shares: Samples  #: Its position in the ranges that are searched, (variables,).
    robot: Robot
    held: float  #: Forward velocity held at its pose, m/s; NaN where that would have to be solved for.
    trial: ReleasedMotion


def best_apart(searched: Evaluation, archive: Archive, best: Samples, count: int) -> list[Samples]:
    """Return the best designs, the best of all first, each of which differs from those before by a tenth of a range."""
    shares, values = archive.all()
    worth = values[0] * searched.objectives[0].direction
    worth = np.where(np.isfinite(worth), worth, -np.inf)
    found = [best]
    while len(found) < count:
        distance = np.max(np.abs(searched.space.settled(shares) - searched.space.settled(found[-1][None])), axis=1)
        worth = np.where(distance >= NEAR, worth, -np.inf)
        first = int(np.argmax(worth))
        if not np.isfinite(worth[first]):
            break
        found.append(shares[first])
    return found


def confirmed(
    designs: Sequence[tuple[Samples, Robot]],
    *,
    make_tables: bool,
    progress: Progress | None = None,
) -> tuple[ConfirmedDesign, ...]:
    """Return the trials of designs, or the reasons why there are none."""
    if make_tables:
        prepare_all([robot for _, robot in designs], stage="yaw", progress=progress)
    found = []
    for number, (shares, robot) in enumerate(designs):
        tell(progress, "trials of the best designs", number, len(designs))
        found.append(ConfirmedDesign(shares, robot, *_trial_of(robot)))
    return tuple(found)


def _trial_of(robot: Robot) -> tuple[float, ReleasedMotion]:
    """Speed held at the pose, and the trial."""
    if robot.channel is not None and not has_table(RobotBatch.of(robot), "yaw"):
        takes = preparation_time(RobotBatch.of(robot), "yaw")
        reason = f"its tube has no table with yawed poses yet; use --confirm, or `spirillum prepare`, in {takes}"
        return float("nan"), ReleasedMotion(reason=reason)
    answer = predict(robot, model=WALLED, band=False)
    trial = answer.trial
    return answer.forward_velocity, ReleasedMotion(reason="it is in no tube") if trial is None else trial
