"""Trials of the best designs: the search holds robots at their pose, the trial releases them in their tubes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from spirillum.arrays import Samples
from spirillum.designs.evaluation import Evaluation
from spirillum.designs.search import Archive
from spirillum.dynamics.prediction import predict
from spirillum.robot.batch import RobotBatch
from spirillum.robot.robot import Robot
from spirillum.swimming.model_choice import WALLED, has_table
from spirillum.swimming.preparation import prepare_all
from spirillum.swimming.released_motion import ReleasedMotion

CONFIRMED = 3
"""Designs that are confirmed."""
NEAR = 0.1
"""Designs that are compared differ from each other by at least this share of a range."""
_NO_TABLE = (
    "its tube has no table with yawed poses yet, which takes 4 to 12 minutes of one core; use --confirm, or `spirillum "
    "prepare` with its robot file"
)


@dataclass(frozen=True)
class ConfirmedDesign:
    """One of the best designs with what it does in a trial."""

    shares: Samples
    """Its place in the ranges that are searched, (variables,)."""
    robot: Robot
    held: float
    """Forward velocity held at its pose, m/s; NaN where that would have to be solved for."""
    trial: ReleasedMotion


def best_apart(searched: Evaluation, archive: Archive, best: Samples, count: int) -> list[Samples]:
    """Return the best designs, the best of all first, each of which differs from those before it by a tenth of a range.

    Args:
        searched: designs under the draws of the search.
        archive: all designs of the search.
        best: the best of all.
        count: how many at most.
    """
    shares, values = archive.all()
    objective = searched.objectives[0]
    worth = values[0] * (1.0 if objective.target is not None else objective.sign)
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
    progress: Callable[[str, int, int], None] | None = None,
) -> tuple[ConfirmedDesign, ...]:
    """Return the trials of designs, or the reasons why there are none.

    Args:
        designs: place in the ranges and robot of each.
        make_tables: make tables that are not there, which takes minutes each.
        progress: told what is being computed, how much is done, and of how much.
    """
    if make_tables:
        prepare_all([robot for _, robot in designs], stage="yaw", progress=progress)
    found = []
    for number, (shares, robot) in enumerate(designs):
        if progress is not None:
            progress("trials of the best designs", number, len(designs))
        found.append(ConfirmedDesign(shares, robot, *_trial_of(robot)))
    return tuple(found)


def _trial_of(robot: Robot) -> tuple[float, ReleasedMotion]:
    """Speed held at the pose, and the trial."""
    if robot.channel is not None and not has_table(RobotBatch.of(robot), "yaw"):
        return float("nan"), ReleasedMotion(reason=_NO_TABLE)
    answer = predict(robot, model=WALLED, band=False)
    trial = answer.trial
    return answer.forward_velocity, ReleasedMotion(reason="it is in no tube") if trial is None else trial
