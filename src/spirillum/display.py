"""Answers as people read them: rows with units, as text for `print` and as a table for notebooks."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from typing import Any, NamedTuple

from spirillum.answer_entries import answer_of
from spirillum.notes import Note, headline_cautions, notes_in_answer, notes_of
from spirillum.quantities import QUANTITIES
from spirillum.units import among, in_unit, speed_unit


class QuantityRow(NamedTuple):
    """A quantity as people read it."""

    name: str  #: Its name in words.
    value: str
    low: str  #: Least value of its band or interval; empty without one.
    high: str
    unit: str  #: Unit of the three; empty for pure numbers.


def rows_of(items: Mapping[str, Any], only: Iterable[str] | None = None) -> list[QuantityRow]:
    """A row for each quantity of an answer that has a single value."""
    known = {
        name: item
        for name, item in items.items()
        if name != "error_estimate" and _is_quantity(item) and item["value"] is not None
    }
    return [_row(name, known[name], known) for name in (known if only is None else only) if name in known]


def _is_quantity(item: Any) -> bool:
    if not (isinstance(item, Mapping) and "unit" in item and "value" in item and isinstance(item["unit"], str)):
        return False
    return item["value"] is None or isinstance(item["value"], (int, float))


def _row(name: str, item: Mapping[str, Any], known: Mapping[str, Mapping[str, Any]]) -> QuantityRow:
    unit = item["unit"]
    shown = among(item["value"], unit, [other["value"] for other in known.values() if other["unit"] == unit])
    if unit == "m/s" and item["value"]:
        shown = speed_unit(item["value"], known.get("tail_rotation_rate", {}).get("value"))
    value, low, high = ("" if item.get(key) is None else in_unit(item[key], unit, shown) for key in _ENDS)
    return QuantityRow(_LABELS.get(name, name.replace("_", " ")), value, low, high, "" if shown == "1" else shown)


_ENDS = ("value", "low", "high")
_LABELS = {"advance_per_radian": "advance per turn"}
"""Words for quantities whose names do not fit the unit that people read: mm for a turn."""


def counted(number: int, word: str) -> str:
    """A number with its noun, in the plural where it is not one."""
    return f"{number} {word}" if number == 1 else f"{number} {word}s"


def label_of_model(name: str) -> str:
    """A model's name in text: abbreviations in capitals."""
    return name.upper() if len(name) <= 3 else name


def percent(share: float) -> str:
    """A share in per cent, with two significant digits and no exponent up to 1e5."""
    value = 100.0 * share
    return f"{value:.0f} %" if 10 <= abs(value) < 1e5 else f"{value:.2g} %"


def times(ratio: float) -> str:
    """A ratio as a multiple, with two significant digits and no exponent up to 1e5."""
    return f"{ratio:.0f}x" if 10 <= abs(ratio) < 1e5 else f"{ratio:.2g}x"


class DisplayMixin:
    """What every answer gives to `print` and to notebooks: its quantities with units, and its notes."""

    def to_dict(self) -> dict[str, Any]:
        """The answer as data, as the command of the same name prints it with `--json`."""
        return answer_of(self)

    @property
    def notes(self) -> tuple[Note, ...]:
        """What is assumed or violated, what that does to the answer and what to do, each with a code."""
        return notes_of(getattr(self, "warnings", ()))

    def _display_content(self) -> tuple[Mapping[str, Any], Iterable[str] | None]:
        """The answer as data, and the names of the quantities to show; None: all."""
        return self.to_dict(), None

    def __repr__(self) -> str:
        """The answer in a line: whose it is, by which model, and its first quantity."""
        answer, only = self._display_content()
        words = [str(answer[name]) for name in ("robot", "model") if isinstance(answer.get(name), str)]
        for name in answer if only is None else only:
            if rows := rows_of(answer, [name]):
                symbol = QUANTITIES[name].symbol if name in QUANTITIES else rows[0].name
                words.append(f"{symbol} = {rows[0].value} {rows[0].unit}".rstrip())
                break
        words = words or [f"{name} = {text}" for name, text in _words(answer)[:2]]
        return f"{type(self).__name__}({', '.join(words)})"

    def __str__(self) -> str:
        """The answer as text, for `print`."""
        return text_of(*self._display_content())

    def _repr_html_(self) -> str:
        """The answer as a table, for notebooks."""
        return html_of(*self._display_content())


def text_of(answer: Mapping[str, Any], only: Iterable[str] | None = None) -> str:
    """An answer as text: its title, the weightiest cautions, a line for each quantity, the number of its notes."""
    rows = rows_of(answer, only)
    notes = notes_in_answer(answer)
    cautions = headline_cautions(notes)
    lines = [_title(answer), *(f"caution: {note}" for note in cautions), *_lines(rows, "  ")]
    if len(rows) < (whole := len(rows_of(answer))):
        lines.append(f"  and {whole - len(rows)} more: dir(answer), answer.to_dict()")
    lines += [f"  {name}: {text}" for name, text in _words(answer)]
    for title, part in _parts(answer) if only is None else ():
        lines += [f"  {title}", *_lines(part, "    ")]
    lines += [f"{name}: {text}" for name, text in error_words(answer.get("error_estimate"))[:-1]]
    left = len(notes) - len(cautions)
    return "\n".join([*lines, *([f"{counted(left, 'more note')}: answer.notes"] if left else [])])


def _lines(rows: Sequence[QuantityRow], indent: str) -> list[str]:
    width = max((len(row.name) for row in rows), default=0)
    ends = [f" ({row.low} to {row.high})" if row.low and row.low != row.high else "" for row in rows]
    sizes = [f"{row.value} {row.unit}".rstrip() + end for row, end in zip(rows, ends, strict=True)]
    return [f"{indent}{row.name:<{width}}  {size}" for row, size in zip(rows, sizes, strict=True)]


def html_of(answer: Mapping[str, Any], only: Iterable[str] | None = None) -> str:
    """An answer as a table in HTML; everything in it is escaped."""
    parts = [("", rows_of(answer, only)), *(_parts(answer) if only is None else ())]
    banded = any(row.low for _, rows in parts for row in rows)
    header = ("quantity", "value", *(("low", "high") if banded else ()), "unit")
    lines = []
    for title, rows in parts:
        lines += [f'<tr><th colspan="{len(header)}">{escape(title)}</th></tr>'] if title else []
        lines += [_cells((row.name, row.value, *((row.low, row.high) if banded else ()), row.unit)) for row in rows]
    head = "".join(f"<th>{name}</th>" for name in header)
    said = "".join(
        f"<p><b>{escape(name)}:</b> {escape(text)}</p>"
        for name, text in (*_words(answer), *error_words(answer.get("error_estimate")))
    )
    notes = "".join(f"<p><b>{note.severity}:</b> {escape(note)}</p>" for note in notes_in_answer(answer))
    table = f"<thead><tr>{head}</tr></thead><tbody>{''.join(lines)}</tbody>"
    return f"<table><caption>{escape(_title(answer))}</caption>{table}</table>{said}{notes}"


def _cells(texts: Iterable[str]) -> str:
    return f"<tr>{''.join(f'<td>{escape(text)}</td>' for text in texts)}</tr>"


def _title(answer: Mapping[str, Any]) -> str:
    """Whose answer it is, of which kind, by which model."""
    kind = str(answer["schema"]).removeprefix("spirillum.").partition("/")[0].replace("-", " ")
    words = [kind, *(f"{name} {answer[name]}" for name in ("model", "friction") if isinstance(answer.get(name), str))]
    if isinstance(answer.get("calibrated"), bool):
        words.append(fitted_words(answer["calibrated"], answer.get("fitted_by", "")))
    title = ", ".join(words)
    return f"{answer['robot']}: {title}" if isinstance(answer.get("robot"), str) else title


def fitted_words(calibrated: bool, fitted_by: str) -> str:  # noqa: FBT001 - as answers say it
    """Whether numbers of an answer were fitted, for its title."""
    if fitted_by:
        return f"fitted by {fitted_by}"
    return "calibrated" if calibrated else "not calibrated"


_LONGEST, _MOST, _OF_A_LIST = 100, 10, 5
_IN_TITLE = ("schema", "robot", "model", "friction", "model_reason", "fitted_by", "motion", "form")


def _words(answer: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Values of an answer as short text or plain numbers: files, counts, verdicts."""
    return [
        (name.replace("_", " "), str(item))
        for name, item in answer.items()
        if name not in _IN_TITLE
        and isinstance(item, (str, int))
        and not isinstance(item, bool)
        and len(str(item)) < _LONGEST
    ]


def _parts(answer: Mapping[str, Any]) -> list[tuple[str, list[QuantityRow]]]:
    """Parts of an answer with quantities of their own: tables, and the first items of lists."""
    found = []
    for name, item in answer.items():
        title = name.replace("_", " ")
        if isinstance(item, Mapping) and not _is_quantity(item):
            found.append((title, rows_of(item)))
        elif isinstance(item, list):
            tables = [table for table in item[:_MOST] if isinstance(table, Mapping)]
            found += [(f"{title}: {_name(table, n)}", rows_of(table)[:_OF_A_LIST]) for n, table in enumerate(tables)]
    return [(title, rows) for title, rows in found if rows]


def _name(table: Mapping[str, Any], number: int) -> str:
    return next((str(item) for item in table.values() if isinstance(item, str)), str(number + 1))


def error_words(error: Any) -> list[tuple[str, str]]:
    """A model's own estimate of its error, where it has one, and its known error in words."""
    if not (isinstance(error, Mapping) and "statement" in error):
        return []
    known = ("known error", str(error["statement"]))
    if error["value"] is None:
        return [known]
    against = error.get("against", "another resolution")
    estimate = f"{percent(error['value'])} of the forward velocity, against {against}"
    return [("numerical error, no interval", estimate), known]
