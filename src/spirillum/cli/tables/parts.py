"""What tables share: grids, rows of quantities, bands, placement, errors."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from rich.box import SIMPLE_HEAVY
from rich.markup import escape
from rich.table import Table

from spirillum.display import error_words, percent, rows_of
from spirillum.notes import notes_in_answer
from spirillum.units import display_unit, in_unit, speed_unit

Answer = Mapping[str, Any]


class Detail(str):
    """A line that is printed on request only: how the answer came about, and how far it can be trusted."""

    __slots__ = ()


Block = str | Table  #: A line, a detail or a table of an answer; the first one is its title, or has it.
Blocks = Iterator[Block]
_HELD_ENDS = {"low": "held low", "high": "held high"}  # of the column held alone: its band, or a posterior's interval
_RUN = ("last 2/3 of run", "drive on", "steady part")
_NUMBERS = ("value", "low", "high", *_RUN, "held", *_HELD_ENDS.values(), "trial", "steady")
"""Columns of numbers, which are never folded: names are."""


def grid(title: str, *columns: str, rows: Iterable[Iterable[str]] = ()) -> Table:
    """A table in the look of all answers, with `rows` of cells."""
    table = Table(title=escape(title), title_justify="left", title_style="bold", header_style="bold", show_edge=False)
    for column in columns:
        number = column in _NUMBERS
        table.add_column(column, justify="right" if number else "left", overflow="fold", no_wrap=number)
    for cells in rows:
        table.add_row(*cells)
    return table


def series_rows(answer: Answer, units: Mapping[str, str]) -> Iterator[list[str]]:
    """The values of quantities that have as many of them, side by side in these units."""
    columns = [(answer[name], unit) for name, unit in units.items()]
    for values in zip(*(item["value"] for item, _ in columns), strict=True):
        yield [in_unit(value, item["unit"], unit) for value, (item, unit) in zip(values, columns, strict=True)]


def cell(item: Answer, unit: str, key: str = "value") -> str:
    """A number of a quantity in a unit, without it."""
    return in_unit(item.get(key), item["unit"], unit)


def friendly(value: float | None, unit: str) -> tuple[str, str]:
    """An SI value as people read it, and its unit."""
    shown = display_unit(value, unit)
    return in_unit(value, unit, shown), "" if value is None or shown == "1" else shown


def in_words(item: Any) -> str:
    """A quantity with its unit, or a word."""
    return " ".join(friendly(item["value"], item["unit"])).strip() if isinstance(item, Mapping) else str(item)


def quantity_grid(title: str, items: Mapping[str, Any], only: Iterable[str] | None = None) -> Table:
    """A row for each quantity that has a value, or of `only` these: name, value, unit."""
    return grid(title, "quantity", "value", "unit", rows=((r.name, r.value, r.unit) for r in rows_of(items, only)))


def band_grid(title: str, items: Mapping[str, Any], only: Iterable[str] | None = None, of: str = "quantity") -> Table:
    """A row for each quantity that has a value, or of `only` these: name, value, low and high of its band, unit."""
    rows = ((row.name, row.value, row.low or "-", row.high or "-", row.unit) for row in rows_of(items, only))
    return grid(title, of, "value", "low", "high", "unit", rows=rows)


def columns_grid(title: str, answer: Answer, only: Iterable[str] | None = None) -> Table:
    """A row for each quantity of a held robot, or of `only` these, with its band, and those of its released motions."""
    rows = {name: row for name in (answer if only is None else only) for row in rows_of(answer, [name])}
    ends = ("low", "high") if any(row.low for row in rows.values()) else ()
    columns = answered_columns(answer)
    table = grid(title, "quantity", "held", *(_HELD_ENDS[end] for end in ends), *columns)
    if ends:  # six columns at 80 characters: spaces between them, no lines
        table.box, table.padding, table.pad_edge = SIMPLE_HEAVY, (0, 0, 0, 1), False
    for name, row in rows.items():
        released = (answer[column].get(name) for column in columns)
        cells = ["-" if item is None else cell(item, row.unit or "1") for item in released]
        words = "efficiency" if name == "hydrodynamic_efficiency" else row.name
        label = f"{words}, {row.unit}" if row.unit else words
        table.add_row(label, row.value, *(getattr(row, end) or "-" for end in ends), *cells)
    return table


RELEASED_COLUMNS = ("trial", "steady")  #: Entries of an answer beside the held one.


def answered_columns(answer: Answer) -> list[str]:
    """Those released motions of an answer that have values, not the reason why they are missing."""
    return [column for column in RELEASED_COLUMNS if "reason" not in answer.get(column, {"reason": ""})]


def released_columns(answer: Answer, how_sure: str = "") -> Iterator[Block]:
    """Meaning of the columns of released motions, or why one is missing; `how_sure` of a trial without an interval."""
    there = [column for column in RELEASED_COLUMNS if column in answer]
    missing = {column: answer[column]["reason"] for column in there if "reason" in answer[column]}
    for reason in dict.fromkeys(missing.values()):
        line = f"no {' and no '.join(column for column in missing if missing[column] == reason)}: {reason}"
        # Without a band a caution says what a table adds.
        yield line if "band" in answer and "prepare" in reason else Detail(line)
    if "trial" in there and "trial" not in missing:
        wait, duration = (in_words(answer["trial"][name]) for name in ("wait", "duration"))
        basis = f"{answer['trial']['assumption']}{'' if 'runs' in answer['trial'] else how_sure}"
        yield f"trial: released, motor on after {wait}, mean over {duration}; {basis}"
        yield from _over_unknowns(answer["trial"])
        items = [(name, one) for name, one in answer["trial"].items() if isinstance(one, Mapping)]
        lacking = {name: one["reason"] for name, one in items if "reason" in one}
        for reason in dict.fromkeys(lacking.values()):
            names = ", ".join(name.replace("_", " ") for name in lacking if lacking[name] == reason)
            yield Detail(f"no {names} of a trial: {reason}")
    if "steady" in there and "steady" not in missing:
        from spirillum.swimming.motions import END_STATES  # brings the models

        constant = answer["steady"]["time_constant"]["value"]  # it hangs on where the approach is looked at
        after = f", approached with a time constant of {constant:.2g} s" if constant else ""
        yield f"steady: {END_STATES[answer['steady']['state']]}{after}; {answer['steady']['assumption']}"


def _over_unknowns(trial: Answer) -> Iterator[str]:
    """The interval of a trial's speed, what it comes from, and what to state first."""
    speed = trial["forward_velocity"]
    if "unknowns" not in trial:
        if "runs" in trial:
            standing, lost = trial["standing"], trial["without_answer"]
            yield f"no interval of the trial: of {trial['runs']} runs {standing} stand and {lost} have no answer"
        return
    unit = speed_unit(speed["high"], trial.get("tail_rotation_rate", speed)["value"])
    low, high, middle = (cell(speed, unit, key) for key in ("low", "high", "median"))
    parts = sorted(trial["unknowns"], key=lambda one: -float(one["share"]["value"]))
    words = [
        f"{_UNKNOWN.get(one['name'], one['name'].replace('_', ' '))} {percent(one['share']['value'])}" for one in parts
    ]
    stand = f", {trial['standing']} of {trial['runs']} stand" if trial["standing"] else ""
    over = "draws of the fit and what it leaves open" if "interval_of" in trial else "what is not stated"
    level = f"{100 * speed['level']:g} % interval of the speed over {over}"
    yield f"trial, {level}: {low} to {high} {unit}, median {middle} {unit}{stand}"
    at = "the posterior median and nominal unknowns" if "interval_of" in trial else "nominal unknowns"
    yield f"the column trial is one run, at {at}; the median is that of {trial['runs']} runs"
    if words:
        yield f"of its variance: {', '.join(words)}; state the first of them first"


_UNKNOWN = {
    "friction.effective": "effective friction",
    "wait": "waiting time",
    "fluid.cavitation_pressure": "cavitation pressure",
    "body.center_of_mass.x": "centre of mass (axial)",
    "body.center_of_mass.radial": "centre of mass (radial)",
}
"""Unknowns of a trial in words."""


def files_of(answer: Answer, **words: str) -> Iterator[str]:
    """A line for each file of an answer that was written, by its entry."""
    return (f"{what} in {answer[name]}" for name, what in words.items() if answer.get(name))


def sentences_of(answer: Answer, code: str) -> Iterator[str]:
    """The notes of a code, as lines that stand in the answer itself."""
    return (note.sentence for note in notes_in_answer(answer) if note.code == code)


def placement_of(placement: Answer, head: str = "placement") -> Iterator[Detail]:
    """The pose that the model takes, unless nothing is around the robot; `head` begins the line."""
    if len(placement) == 1:
        return
    details = [str(placement["kind"])]
    for name, item in placement.items():
        if isinstance(item, Mapping) and item.get("value") is not None:
            band = f" (open: band over {range_words(item)})" if "low" in item else ""
            details.append(f"{name.replace('_', ' ')} {in_words(item)}{band}")
        elif name != "kind" and isinstance(item, str):
            details.append(f"{name.replace('_', ' ')} {item}")
    yield Detail(f"{head}: {', '.join(details)}")


RELEASED = "released at"  #: Head of the line on the placement of a robot that is released there.


def unsteady(answer: Answer) -> Iterator[str]:
    """Before all numbers, why a free robot has reached no steady motion; nothing where it has."""
    if "steady_state" in answer and answer["steady_state"]["state"] != "steady":
        yield answer["steady_state"]["statement"]


def resting_pose(steady: Answer) -> Iterator[str]:
    """Final motion of a free robot, and what it rests on; its pose on request."""
    from spirillum.swimming.motions import ASSUMPTION  # brings the models

    yield f"{_STATES[steady['state']].format(time=in_words(steady['followed_time']))}; {ASSUMPTION}"
    details = []
    for name, item in steady.items():
        if name != "followed_time" and isinstance(item, Mapping) and item["value"] not in (None, 0.0):
            details.append(f"{_WORDS.get(name, name.replace('_', ' '))} {in_words(item)}{_range_words(item)}".rstrip())
    yield Detail(f"there: {', '.join(details)}")


_WORDS = {
    "approach_time": "approached with a time constant of",
    "contact_force": "borne by asperities with a contact force of",
}
_STATES = {
    "steady": "steady motion (fixed point of a turn, found from the run at {time})",
    "orbits": "orbit around the tube's axis (fixed point of a turn, found from the run at {time})",
    "goes around": "goes around the tube, followed for {time}",
    "changing": "still changing after {time}, in its last turn",
}


def _range_words(item: Mapping[str, Any]) -> str:
    """Over what a value of a steady motion is a mean, and its least value there."""
    if item.get("kind") != "range" or item["low"] is None:
        return ""
    return f" (mean over {item['over']}, at least {' '.join(friendly(item['low'], item['unit']))})"


def range_words(item: Mapping[str, Any]) -> str:
    """Ends of a band in one unit."""
    unit = display_unit(item["high"], item["unit"])
    return f"{cell(item, unit, 'low')} to {cell(item, unit, 'high')} {unit}"


def reason_of(answer: Answer) -> Iterator[Detail]:
    """Reason of the model, where it was chosen automatically."""
    if "model_reason" in answer:
        yield Detail(f"model {answer['model']}: {answer['model_reason']}")


def error_of(error: Answer) -> Iterator[Detail]:
    """A model's own estimate, where it has one, and its known error in words."""
    return (Detail(f"{name}: {text}") for name, text in error_words(error))
