"""Cautions of a steady motion, of one robot or of a batch: accuracy of the model, geometry of the calibration."""

from __future__ import annotations

from collections.abc import Iterable
from functools import reduce
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Flags
from spirillum.fluid.model import SwimmerModel
from spirillum.fluid.registry import find_swimmer_model
from spirillum.notes import Note
from spirillum.robot.batch import RobotBatch
from spirillum.robot.limits import reynolds_limits
from spirillum.robot.robot import Robot
from spirillum.swimming.motions import Swimming
from spirillum.units import show


class Caution(NamedTuple):
    """A requirement that robots break: one of accuracy, or one without which they have no answer."""

    model: str
    flag: str
    robots: int
    code: str  #: Of its note.
    sentence: str  #: The first of them in words.
    fields: tuple[str, ...] = ()

    @property
    def note(self) -> Note:
        """The note on the first of them."""
        return Note(self.code, self.sentence, self.fields)


NO_ANSWER = "without-answer"  #: Code of robots that have no answer.


def accuracy_cautions(model: SwimmerModel, batch: RobotBatch, result: Swimming) -> list[Caution]:
    """Return a caution for each limit of accuracy that robots with an answer break."""
    found = []
    for limit in (
        *model.cautions(batch),
        *reynolds_limits(batch, result.reynolds_number, result.tail_reynolds_number),
    ):
        outside = ~limit.holds & ~np.isnan(limit.value) & result.valid
        if count := int(np.count_nonzero(outside)):
            note = limit.caution(int(np.argmax(outside)))
            found.append(Caution(model.name, limit.flag, count, note.code, str(note), note.fields))
    return found


_FITTED_TO = ("channel.diameter", "body.diameter", "body.length")
_SAME = 1e-6  # relative difference of lengths that are the same


def calibration_cautions(model: SwimmerModel, batch: RobotBatch, answered: Flags) -> list[Caution]:
    """Return the caution of drag factors that act on robots with an answer and of another geometry, if there is one."""
    factors = batch.calibration.get(model.name)
    if factors is None or model.placed:
        return []
    lengths = {path: [getattr(of, path.replace(".", "_")) for of in (batch, factors)] for path in _FITTED_TO}
    apart = {path: ~(np.abs(own - fitted) <= _SAME * fitted) for path, (own, fitted) in lengths.items()}
    outside = reduce(np.logical_or, apart.values()) & answered
    if not (count := int(np.count_nonzero(outside))):
        return []
    first = int(np.argmax(outside))
    differing = {
        path: f"{path} = {show(own, 'mm') if np.isfinite(own) else 'none'} (fitted to {show(fitted, 'mm')})"
        for path, pair in lengths.items()
        for own, fitted in [(float(np.broadcast_to(one, outside.shape)[first]) for one in pair)]
        if np.broadcast_to(apart[path], outside.shape)[first]
    }
    more = f" and {len(differing) - 1} more" if len(differing) > 1 else ""
    words = {"differs": next(iter(differing.values())), "more": more, "fields": list(differing)}
    note = Note.named("calibrated-elsewhere", model=model.name, **words)
    return [Caution(model.name, "calibrated-elsewhere", count, note.code, str(note), note.fields)]


def calibration_warnings(robot: Robot, model: str) -> list[Note]:
    """Return notes on a robot's calibration for a model; a model that computes the walls takes none."""
    chosen = find_swimmer_model(model)
    if model not in robot.calibration:  # nothing represents the walls
        return [] if chosen.placed or robot.channel is None else [Note.named("not-calibrated", model=model)]
    return [found.note for found in calibration_cautions(chosen, RobotBatch.of(robot), np.ones(1, dtype=bool))]


def summed(found: Iterable[Caution], robots: int) -> list[Note]:
    """Return a note for each kind of caution, over all parts of a batch or a study, with how many robots it is of."""
    groups: dict[tuple[str, str, str], list[Caution]] = {}
    for caution in found:
        groups.setdefault((caution.model, caution.flag, caution.code), []).append(caution)
    return [
        group[0].note.prefixed(
            f"{sum(caution.robots for caution in group)} of {robots} robots "
            f"{'have no answer ' if code == NO_ANSWER else ''}({model}), the first: "
        )
        for (model, _, code), group in groups.items()
    ]
