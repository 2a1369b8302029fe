"""The search with a model that is learned: solve a few designs, search, solve the best again, until both agree."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import product

import numpy as np

from spirillum.arrays import Samples
from spirillum.designs.design_result import Learned
from spirillum.designs.evaluation import Evaluation
from spirillum.designs.learned import Points, check_learnable, corrected, solved_at
from spirillum.designs.search import Archive, Found, Tell, best_design
from spirillum.designs.space import Variable
from spirillum.designs.unknowns import Unknowns
from spirillum.errors import InputError
from spirillum.robot.batch import RobotBatch
from spirillum.robot.limits import all_hold

_AGREES = 2e-3
"""Relative difference of the objective, learned and solved, at which the search ends."""
_ROUNDS = 5
_CANDIDATES = 64
_FEWEST, _FOR_EACH = 4, 3
"""Designs that are solved before the first search: so many, and for each field of the tail so many more."""

Solve = Callable[[RobotBatch, tuple[Variable, ...]], Points]


def learned_best(
    blank: Evaluation, unknowns: Unknowns, name: str, seed: int, tell: Tell, solve: Solve | None = None
) -> tuple[Evaluation, Archive, Found, Learned]:
    """The best design by a model that solves for the flow.

    Args:
        blank: designs under their draws, with any model.
        unknowns: what is not known.
        name: of the model.
        seed: of the search.
        tell: told what is being done.
        solve: solves for some designs; None: the model does.

    Returns:
        Designs with the learned model, all that the last search has swum, the best of them, and how well it is known.
    """
    own = check_learnable(name, blank.space, unknowns)
    solving = solve or (lambda batch, variables: solved_at(name, batch, variables))
    empty = replace(blank, model=corrected(name, Points(own, np.zeros((0, len(own))), np.zeros((0, 6)))))
    first = _first_designs(empty, own, seed)
    points = _solved(empty, first, own, solving, tell, None)
    last = 1.0
    for number in range(_ROUNDS):
        evaluation, archive = replace(blank, model=corrected(name, points)), Archive()
        best = best_design(evaluation, archive, seed=seed, tell=tell)
        if not best.possible or last <= _AGREES:
            break
        before = _objective(evaluation, best.shares)
        more = [best.shares, *_runner_up(evaluation, archive, best.shares, number)]
        points = _solved(empty, np.stack(more), own, solving, tell, points)
        after = _objective(replace(blank, model=corrected(name, points)), best.shares)
        last = abs(before / after - 1.0) if after else abs(before - after)
    return evaluation, archive, best, Learned(len(points.features), last, _left_out(evaluation, name, points))


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
    found: Samples = shares[able[np.sort(kept)][:most]]
    return found


def _solved(
    empty: Evaluation, shares: Samples, own: tuple[Variable, ...], solving: Solve, tell: Tell, points: Points | None
) -> Points:
    """Solve for designs one by one, first of all for today's, and add what they teach."""
    batches = [block for _, block in empty.space.batch(shares).blocks(1)] if len(shares) else []
    if points is None:
        today = RobotBatch.of(empty.space.robot)
        batches = [*([today] if bool(np.all(all_hold(empty.limits(None)))) else []), *batches]
    for number, batch in enumerate(batches):
        tell("tails that are solved for", number, len(batches))
        more = solving(batch, own)
        points = more if points is None else points.joined(more)
    assert points is not None  # noqa: S101 - there is a design
    return points


def _runner_up(evaluation: Evaluation, archive: Archive, best: Samples, number: int) -> list[Samples]:
    """Another good design, farther from the best one in earlier rounds: it may be better than it is thought to be."""
    shares, values = archive.all()
    objective = evaluation.objectives[0]
    worth = values[0] * (1.0 if objective.target is not None else objective.sign)
    apart = np.max(np.abs(shares - best), axis=1) >= 0.2 / (1 + number)
    worth = np.where(apart & np.isfinite(worth), worth, -np.inf)
    first = int(np.argmax(worth))
    return [shares[first]] if np.isfinite(worth[first]) else []


def _left_out(evaluation: Evaluation, name: str, points: Points) -> float:
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
        guess = _objective(replace(evaluation, model=corrected(name, points.without(number))), shares)
        if np.isfinite(true) and np.isfinite(guess) and true:
            errors.append((evaluation.objectives[0].sign * true, guess / true - 1.0))
    better = [error for _, error in sorted(errors, reverse=True)[: (len(errors) + 1) // 2]]
    return float(np.sqrt(np.mean(np.square(better)))) if better else float("nan")
