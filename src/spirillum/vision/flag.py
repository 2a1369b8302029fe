"""Flags: what a video shows that whoever uses its numbers has to know."""

from __future__ import annotations

from dataclasses import dataclass

from spirillum.notes import Note


@dataclass(frozen=True)
class Flag:
    """Something about a video that whoever uses its numbers has to know."""

    name: str  #: Short, for machines, such as `robot-left-the-view`.
    sentence: str  #: One sentence for people: finding, time, and effect on the numbers.
    spoils: tuple[str, ...] = ()
    """Quantities that are not given because of it: `forward_velocity`, `body_rotation_rate`, `tail_rotation_rate`."""
    frame: int | None = None
    """Order among the measured frames, from 0, of the one that shows it best; None where no single one does."""

    @property
    def note(self) -> Note:
        """The flag as a note of an answer."""
        return Note(self.name, self.sentence, self.spoils)
