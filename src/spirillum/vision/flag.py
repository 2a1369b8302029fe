"""A flag: what a video shows that whoever uses its numbers has to know."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from spirillum.data_tables import rows_of
from spirillum.notes import Note

EVERYTHING = ("forward_velocity", "body_rotation_rate", "tail_rotation_rate")  #: All rates of a track.
LENGTHS = ("forward_velocity", "lateral_position", "lateral_wobble_at_tail_rate", "lateral_wobble_at_body_rate")
"""Quantities that are proportional to the scale."""
_GROUPS = {"everything": EVERYTHING, "lengths": LENGTHS, "lateral": LENGTHS[1:]}
_ROWS = {row["name"]: row for row in rows_of("vision/flags.csv")}


@dataclass(frozen=True)
class Flag:
    """Something about a video that whoever uses its numbers has to know."""

    name: str  #: Short, for machines, such as `robot-left-the-view`.
    sentence: str  #: One sentence for people: finding, time, and effect on the numbers.
    spoils: tuple[str, ...] = ()
    """Quantities that are not given because of it: `forward_velocity`, `body_rotation_rate`, `tail_rotation_rate`."""
    frame: int | None = None
    """Order among the measured frames, from 0, of the one that shows it best; None where no single one does."""

    @classmethod
    def named(cls, name: str, /, frame: int | None = None, **values: Any) -> Flag:
        """The flag of `flags.csv` under a name, with values in its sentence."""
        row = _ROWS[name]
        words = row["spoils"].format(**values).split()
        spoils = tuple(quantity for word in words for quantity in _GROUPS.get(word, (word,)))
        return cls((row["code"] or name).format(**values), row["sentence"].format(frame=frame, **values), spoils, frame)

    @property
    def note(self) -> Note:
        """The flag as a note of an answer."""
        return Note(self.name, self.sentence, self.spoils)
