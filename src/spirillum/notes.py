"""Notes of an answer: what is assumed or violated, its effect on the result, and what to do, each with a code.

A note is its sentence, so that it can be printed, compared and counted as text; its code, severity and fields are for
programs. The code's longer explanation is in `notes.csv` and, written from there, in `docs/notes.md`; sentences with
places for numbers stand in `sentences.csv`.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import Any, Literal, NamedTuple

from spirillum.data_tables import rows_of


def _explanations() -> dict[str, dict[str, str]]:
    """Explanations of `notes.csv` by code, in the order of the file, for each kind of note."""
    found: dict[str, dict[str, str]] = {}
    for row in rows_of("notes.csv"):
        found.setdefault(row["kind"], {}).update(dict.fromkeys(row["codes"].split(), row["explanation"]))
    return found


_EXPLAINED = _explanations()
TRACKING = _EXPLAINED["video"]  #: Flags that the tracker and `measure` raise, by their names, with what they mean.
LONGEST = 160  #: Largest number of characters of a sentence, without the names of robots and files in it.


class NoteKind(NamedTuple):
    """What all notes of one code have in common."""

    severity: Literal["caution", "info"]  #: `caution`: it changes what the numbers mean; `info`: it explains them.
    explanation: str  #: What is assumed or violated, what follows, what to do.


_FIRST = ("posterior-unusable", "synthetic")  # codes that come before all flags of a video
_LIGHT = (
    *("stray-frames", "pixels-not-square", "pixel-aspect-replaced", "pictures-turned", "slant-left-out"),
    *("sixteen-bit-images", "several-films", "by-hand", "corrected-by-hand", "imported", "no-video"),
)
"""Codes of flags of a video that hardly change its numbers: they come last."""
KINDS: dict[str, NoteKind] = {
    **{
        code: NoteKind("caution", (_EXPLAINED["caution"] | TRACKING)[code])
        for code in (*_FIRST, *(name for name in TRACKING if name not in _LIGHT), *_EXPLAINED["caution"], *_LIGHT)
    },
    **{code: NoteKind("info", words) for code, words in _EXPLAINED["info"].items()},
}
"""Kinds of notes by code; cautions in the order in which a terminal shows them."""
_SENTENCES = {row["name"]: row for row in rows_of("sentences.csv")}
"""Code, fields and sentence of notes by their names, with places for words and numbers."""
_FALLBACK = "remark"
_RATES = ("-forward-velocity", "-body-rotation-rate", "-tail-rotation-rate")


class Note(str):
    """A sentence about an answer, with its code; it cannot be changed."""

    __slots__ = ("code", "fields")
    code: str  #: What the note is about, such as `walls-left-out`; a key of `KINDS`.
    fields: tuple[str, ...]  #: Fields or quantities that it concerns, by their dotted names.

    def __new__(cls, code: str, sentence: str, fields: Iterable[str] = ()) -> Note:
        """A note of a known code."""
        note = super().__new__(cls, sentence)
        note.code, note.fields = _known(code), tuple(fields)
        return note

    @classmethod
    def named(cls, name: str, /, **values: Any) -> Note:
        """The note of `sentences.csv` under a name, with values in its sentence; `fields` where they vary."""
        row = _SENTENCES[name]
        fields = values["fields"] if row["fields"] == "{fields}" else row["fields"].format(**values).split()
        return cls(row["code"], row["sentence"].format(**values), fields)

    def __getnewargs__(self) -> tuple[str, str, tuple[str, ...]]:  # type: ignore[override]
        """Arguments with which another process recreates it."""
        return self.code, str(self), self.fields

    @property
    def severity(self) -> Literal["caution", "info"]:
        """Whether it changes what the numbers mean."""
        return KINDS[self.code].severity

    @property
    def sentence(self) -> str:
        """The sentence."""
        return str(self)

    @property
    def explanation(self) -> str:
        """What all notes of its code mean."""
        return KINDS[self.code].explanation

    def prefixed(self, words: str) -> Note:
        """The note with words before its sentence, such as the name of the robot that it is about."""
        return Note(self.code, f"{words}{self}", self.fields)

    def to_dict(self) -> dict[str, Any]:
        """The note as data."""
        return {"code": self.code, "severity": self.severity, "sentence": str(self), "fields": list(self.fields)}


def _known(code: str) -> str:
    """A code of `KINDS`; names of flags that end in a rate are of one kind for all rates."""
    for rate in _RATES:
        code = code.removesuffix(rate)
    if code not in KINDS:
        raise KeyError(f"notes have no code {code!r}; add it to notes.csv")
    return code


def notes_of(sentences: Iterable[str]) -> tuple[Note, ...]:
    """Notes; a sentence without a code, as in files of earlier versions, becomes a remark."""
    return tuple(item if isinstance(item, Note) else Note(_FALLBACK, item) for item in sentences)


def note_attributes(notes: Iterable[str]) -> dict[str, str]:
    """Notes as attributes of a dataset: `warnings` for people, a sentence each line, and `notes` as JSON."""
    found = notes_of(notes)
    return {"warnings": "\n".join(found), "notes": json.dumps([note.to_dict() for note in found])}


def notes_in(attributes: Mapping[Any, Any]) -> tuple[Note, ...]:
    """Notes of a dataset, from its attributes; one of an earlier version has sentences alone."""
    if "notes" not in attributes:
        return notes_of(line for line in str(attributes.get("warnings", "")).split("\n") if line)
    return notes_in_answer({"notes": json.loads(attributes["notes"])})


def notes_in_answer(answer: Mapping[str, Any]) -> tuple[Note, ...]:
    """Notes of an answer that is data."""
    return tuple(Note(item["code"], item["sentence"], item["fields"]) for item in answer.get("notes", ()))


def headline_cautions(notes: Iterable[Note]) -> list[Note]:
    """The weightiest cautions, one of a code, at most three."""
    order = list(KINDS)
    first: dict[str, Note] = {}
    for note in notes:
        if note.severity == "caution":
            first.setdefault(note.code, note)
    return sorted(first.values(), key=lambda note: order.index(note.code))[:3]
