"""Cautions about the answers of a study, and why robots have none: counted, with a sentence for each kind."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Flags
from spirillum.fluid.registry import find_swimmer_model
from spirillum.notes import Note
from spirillum.robot.limits import broken, caution_code
from spirillum.studies.work import REASONS, ModelTask, Part
from spirillum.swimming.cautions import accuracy_limits
from spirillum.swimming.reynolds import reynolds_limits, stokes_flow_problem
from spirillum.swimming.steady import requirements
from spirillum.swimming.steady_quantities import STEADY, Swimming


class Caution(NamedTuple):
    """A requirement that robots of a task break: one of accuracy, or one without which they have no answer."""

    model: str
    flag: str
    robots: int
    """How many."""
    sentence: str
    """The first of them in words."""
    refused: bool = False
    """Whether they have no answer for it."""


def _refusals(task: ModelTask, part: Part) -> list[Caution]:
    """Why robots of a task have no answer, one for each requirement; each robot counts for the first that it breaks."""
    left = np.any(part["outside"] != 0, axis=-1)
    found = []
    for limit in broken(requirements(task.batch, find_swimmer_model(task.model))):
        of_this = left & ~np.broadcast_to(limit.holds, left.shape)
        if of_this.any():
            sentence = limit.sentence(int(np.argmax(of_this)))
            found.append(Caution(task.model, limit.flag, int(np.count_nonzero(of_this)), sentence, refused=True))
        left &= ~of_this
    found += _beyond_stokes(task, part, left)
    left &= ~np.any(part["outside"] == REASONS.index("beyond-stokes"), axis=-1)
    if left.any():
        lacking = np.count_nonzero(part["outside"][int(np.argmax(left))])
        sentence = f"no steady motion under {lacking} of {part['outside'].shape[-1]} readings of the friction"
        found.append(Caution(task.model, "other", int(np.count_nonzero(left)), sentence, refused=True))
    return found


def _beyond_stokes(task: ModelTask, part: Part, left: Flags) -> list[Caution]:
    """The refusal of robots that move far outside Stokes flow, under the first reading of the friction that has one."""
    code = REASONS.index("beyond-stokes")
    refused = left & np.any(part["outside"] == code, axis=-1)
    if not refused.any():
        return []
    rows, reading = np.flatnonzero(refused), int(np.argmax(part["outside"][int(np.argmax(refused))] == code))
    numbers = [part[name][rows, reading] for name in ("reynolds_number", "tail_reynolds_number")]
    batch = task.batch.taken(rows)
    sentence = stokes_flow_problem(batch, reynolds_limits(batch, *numbers))
    return [Caution(task.model, "beyond-stokes", len(rows), sentence, refused=True)]


def cautions(task: ModelTask, part: Part) -> list[Caution]:
    """What to be careful about in a task's answer, and why robots have none, one for each kind."""
    size = task.batch.size
    first = Swimming(**{item.name: part[item.name][:, 0] for item in STEADY}, valid=part["outside"][:, 0] == 0)
    found = _refusals(task, part)
    for limit in broken(accuracy_limits(task.batch, find_swimmer_model(task.model), first)):
        holds = np.broadcast_to(limit.holds, (size,)) | np.isnan(np.broadcast_to(limit.value, (size,)))
        holds |= part["outside"][:, 0] == REASONS.index("beyond-stokes")
        count = int(np.count_nonzero(~holds))
        if count:
            found.append(Caution(task.model, limit.flag, count, limit.caution(int(np.argmin(holds)))))
    return found


def summed(found: Iterable[Caution], robots: int) -> list[Note]:
    """A note for each kind of caution, over all tasks of a study."""
    groups: dict[tuple[str, str, bool], list[Caution]] = {}
    for caution in found:
        groups.setdefault((caution.model, caution.flag, caution.refused), []).append(caution)
    return [
        Note(
            "without-answer" if refused else caution_code(flag),
            f"{sum(caution.robots for caution in group)} of {robots} robots "
            f"{'have no answer ' if refused else ''}({model}), the first: {group[0].sentence}",
        )
        for (model, flag, refused), group in groups.items()
    ]
