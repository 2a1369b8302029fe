"""`observations.csv`: one row a trial (or a mean with its interval), signed about +x."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from decimal import Decimal
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from spirillum.envelope import envelope
from spirillum.errors import InputError
from spirillum.files import MARK, atomic_write, guard_inputs, new_file, output_target
from spirillum.files.reading import number_in
from spirillum.formats.tables import Table, TableRow, check_known, check_present, read_table
from spirillum.measurement.rate_checks import (
    RateTriples,
    check_motor_rates,
    convention_doubt,
    first_of,
    rows_in_words,
    wrong_signs,
)
from spirillum.measurement.statistics import NORMAL, Mean, mean_with_interval
from spirillum.notes import Note
from spirillum.robot.robot import Robot
from spirillum.scalars import plain_minus
from spirillum.units import Hz

_MM = 1e-3
_KEYS = {"channel_diameter_mm": _MM, "wavelength_mm": _MM, "amplitude_mm": _MM}
RATES = {"forward_velocity_mm_s": _MM, "tail_rate_Hz": Hz, "body_rate_Hz": Hz, "motor_rate_Hz": Hz}
"""Measured columns and their factor to SI."""
_FIELDS = tuple(name.rpartition("_")[0].removesuffix("_mm") for name in RATES)
"""Fields of an `ObservationRow` for the measured columns."""
_INTERVALS = {f"{name}_ci95": factor for name, factor in RATES.items()}
COLUMNS = ("robot", *_KEYS, "trial", *RATES, "trials", *_INTERVALS)
"""All columns; those after the trial number may be left out or left empty."""
_NEEDED = tuple(_KEYS)
_WHAT = "an observations file (CSV or Parquet)"
_LARGEST = 64 << 20
_MOST_SHOWN = 8
_LARGEST_NUMBER = 1e6
_DIGITS = ".13g"  # of equal numbers: sums and differences of rates are equal to rounding
_SMALLEST_RATE = 1e-6 * Hz


@dataclass(frozen=True)
class ObservationRow:
    """One row: a trial, or a mean over trials, SI."""

    row: int  #: Line number in the file.
    robot: str
    channel_diameter: float
    wavelength: float
    amplitude: float
    forward_velocity: float  #: m/s; NaN where not measured, as all that follow.
    tail_rate: float
    body_rate: float
    motor_rate: float  #: Observed, else tail less body rate.
    trials: int  #: 1 for a trial, more for a mean.
    intervals: tuple[float, float, float, float]
    """Half widths of 95 % intervals in the same order: of a trial, or of a mean over trials."""
    trial: str = ""  #: Number of the trial without leading zeros, or its name, where the file gives one.
    motor_derived: bool = False  #: Whether the motor's rate was not observed itself.

    @property
    def tail(self) -> tuple[float, float, float]:
        """Channel diameter, wavelength, amplitude, rounded to 1 nm: the key of a robot in a study."""
        return (round(self.channel_diameter, 9), round(self.wavelength, 9), round(self.amplitude, 9))


@dataclass(frozen=True)
class RobotObservations:
    """All that was observed of one robot, with 95 % intervals, SI."""

    forward_velocity: Mean
    tail_rate: Mean
    body_rate: Mean
    motor_rate: Mean


def read_observations(path: str | Path) -> list[ObservationRow]:
    """Read and check an observations file."""
    table = observation_table(path)
    check_known(table, COLUMNS)
    check_present(table, _NEEDED)
    if not set(table.header) & set(RATES):
        raise InputError(f"{table.path} has no measured column; allowed: at least one of {', '.join(RATES)}")
    found = [_observation(row) for row in table.rows()]
    _check_duplicates(table.path, found)
    check_motor_rates(table.path, all_rates(found))
    return found


def all_rates(observations: Iterable[ObservationRow]) -> RateTriples:
    """The rows that hold tail, body and motor rate."""
    rows = [item for item in observations if not item.motor_derived and math.isfinite(item.tail_rate - item.body_rate)]
    columns = [(item.tail_rate, item.body_rate, item.motor_rate, math.hypot(*item.intervals[1:])) for item in rows]
    tail, body, motor, half_width = np.array(columns, dtype=float).reshape(-1, 4).T
    return RateTriples([item.row for item in rows], tail, body, motor, half_width / NORMAL)


def observation_table(path: str | Path) -> Table:
    """Header, rows and comments of an observations file, not yet checked."""
    table = read_table(path, _WHAT, largest=_LARGEST, parquet=True)
    if not table.below:
        raise InputError(f"{path} holds no observations; allowed: a header line and at least one row")
    return table


def unread_columns(table: Table) -> tuple[Note, ...]:
    """A note on the columns of an observations file that are not read; none without such columns."""
    names = table.free_columns(COLUMNS)
    if not names:
        return ()
    shown = ", ".join(name[:40] for name in names[:_MOST_SHOWN]) + (", ..." if len(names) > _MOST_SHOWN else "")
    words = f"column{'' if len(names) == 1 else 's'} {shown}: not read, treated as comments"
    return (Note("input-unused", words, names),)


def _observation(row: TableRow) -> ObservationRow:
    place = row.place
    channel_diameter, wavelength, amplitude = (_number(row, name, _MM, least=1e-6) for name in _KEYS)
    rates = [_number(row, name, factor) for name, factor in RATES.items()]
    if all(math.isnan(value) for value in rates):
        raise InputError(f"{place}: nothing was measured; allowed: at least one of {', '.join(RATES)}")
    velocity, tail, body, motor = rates
    motor_derived = math.isnan(motor)
    motor = tail - body if motor_derived else motor
    for name, rate in (("tail_rate_Hz", tail), ("motor_rate_Hz", motor)):
        if abs(rate) < _SMALLEST_RATE:
            raise InputError(f"{place}, column {name}: {rate / Hz:g}; allowed: a rate other than 0, or empty")
    trial = row.text("trial")
    if not math.isnan(number_in(trial)):
        number = Decimal(plain_minus(trial))  # exact, for numbers such as timestamps
        whole = number.to_integral_value()
        if number != whole:
            raise row.error("trial", trial, "a whole number, or a name")
        trial = f"{whole:f}"  # 1, 01 and 1.0 are one trial
    a, b, c, d = (_number(row, name, factor, least=0.0) for name, factor in _INTERVALS.items())
    trials = _trials(row)
    if math.isnan(d):  # tail and body of a trial are read one by one; over trials they vary together
        d = math.hypot(b, c) if trials == 1 else b + c
    return ObservationRow(
        row.line, row.text("robot"), channel_diameter, wavelength, amplitude, velocity, tail, body, motor,
        trials, (a, b, c, d), trial, motor_derived,
    )  # fmt: skip


def _number(row: TableRow, name: str, factor: float, least: float | None = None) -> float:
    """One cell in SI; NaN where it is empty and may be."""
    low = -_LARGEST_NUMBER if least is None else least
    wanted = f"a number up to {_LARGEST_NUMBER:g}" + (", or empty" if least is None else f" of at least {least:g}")
    blank = () if low > 0.0 else ("",)
    return factor * row.number(name, name, low=low, high=_LARGEST_NUMBER, blank=blank, allowed=wanted)


def _trials(row: TableRow) -> int:
    text = row.text("trials")
    if not text:
        return 1
    if not text.isascii() or not text.isdigit() or not 1 <= int(text[:9]) <= 10**6:
        raise row.error("trials", text, "a whole number from 1")
    return int(text)


def _check_duplicates(path: Path, observations: Iterable[ObservationRow]) -> None:
    """A robot's mean stands alone, and a trial stands once: else something would count twice."""
    seen: dict[tuple[float, float, float], ObservationRow] = {}
    trials: dict[tuple[object, ...], int] = {}
    for item in observations:
        first = trials.setdefault((item.tail, item.trial or item.row), item.row)
        if first != item.row:
            raise InputError(
                f"{path}, rows {first} and {item.row} are both trial {item.trial[:20]}; allowed: once a robot"
            )
        other = seen.setdefault(item.tail, item)
        if other is not item and max(item.trials, other.trials) > 1:
            raise InputError(
                f"{path}, rows {other.row} and {item.row} are of the same robot and one is a mean; "
                "allowed: trials, or one mean"
            )


def check_signs(
    path: str | Path, observations: Sequence[ObservationRow], columns: Iterable[str], expected: float, allowed: str
) -> None:
    """Refuse values whose sign contradicts the physics by more than their own error."""
    for column in columns:
        place = list(RATES).index(column)
        values = [getattr(item, _FIELDS[place]) for item in observations]
        stated = np.array([item.intervals[place] for item in observations]) / NORMAL
        wrong = wrong_signs(np.array(values), expected, stated, [item.tail for item in observations])
        if wrong.size:
            rows, first = [observations[index].row for index in wrong.tolist()], int(wrong[0])
            raise InputError(
                f"{path}, {rows_in_words(rows)}, column {column}: {values[first] / RATES[column]:.4g}{first_of(rows)}; "
                f"allowed: {allowed}"
            )


def driven_sense(robot: Robot) -> float:
    """Sign of the rate about +x at which a robot's tail is driven forwards."""
    reverse = robot.motor is not None and robot.motor.polarity == "reverse"
    return float(-robot.hand if reverse else robot.hand)


def check_driven(path: str | Path, observations: Sequence[ObservationRow], robot: Robot) -> None:
    """Refuse rates of a tail that turns against the sense in which it is driven, see `check_signs`."""
    sense = driven_sense(robot)
    allowed = f"{'positive' if sense > 0 else 'negative'}, as the {robot.tail.handedness}-handed tail is driven"
    check_signs(path, observations, ("tail_rate_Hz", "motor_rate_Hz"), sense, allowed)


def without_copies(observations: Iterable[ObservationRow]) -> tuple[list[ObservationRow], tuple[Note, ...]]:
    """The rows without those that repeat another one of their tail in every number, and a note on each such row.

    Two of the three rates give the third: a row that leaves one out, or an interval, repeats a row that states it.
    """
    items = list(observations)
    alike: dict[tuple[object, ...], list[tuple[int, tuple[str, ...]]]] = {}
    for item in items:
        tail = item.motor_rate + item.body_rate if math.isnan(item.tail_rate) else item.tail_rate
        body = item.tail_rate - item.motor_rate if math.isnan(item.body_rate) else item.body_rate
        optional = (math.nan if item.motor_derived else item.motor_rate, *item.intervals[:3])
        key, own = (tuple(f"{n + 0.0:{_DIGITS}}" for n in of) for of in ((item.forward_velocity, tail, body), optional))
        alike.setdefault((item.tail, key), []).append((item.row, own))
    copies: dict[int, list[int]] = {}
    for rows in alike.values():
        first: dict[tuple[str, ...], int] = {}
        for row, own in sorted(rows, key=lambda one: one[1].count("nan")):
            if own in first:
                copies.setdefault(first[own], []).append(row)
            else:  # and whatever leaves some of its numbers out
                first |= {less: row for less in product(*((n, "nan") for n in own)) if less not in first}
    notes = (Note.named("copied-trials", first=row, rows=rows_in_words(sorted(of))) for row, of in copies.items())
    left_out = {row for of in copies.values() for row in of}
    return [item for item in items if item.row not in left_out], tuple(notes)


def summarised(observations: Iterable[ObservationRow]) -> dict[tuple[float, float, float], RobotObservations]:
    """Mean and 95 % interval of every robot, by (channel diameter, wavelength, amplitude)."""
    groups: dict[tuple[float, float, float], list[ObservationRow]] = {}
    for item in observations:
        groups.setdefault(item.tail, []).append(item)
    return {tail: _observed(items) for tail, items in groups.items()}


def _observed(items: Sequence[ObservationRow]) -> RobotObservations:
    columns = [
        [item.forward_velocity for item in items],
        [item.tail_rate for item in items],
        [item.body_rate for item in items],
        [item.motor_rate for item in items],
    ]
    if len(items) == 1:
        only = items[0]
        return RobotObservations(
            *(Mean(column[0], w, only.trials) for column, w in zip(columns, only.intervals, strict=True))
        )
    own = zip(*(item.intervals for item in items), strict=True)
    return RobotObservations(*(mean_with_interval(c, within=w) for c, w in zip(columns, own, strict=True)))


_TABLES = {".csv": "an observations file"}


def join_observations(files: Sequence[str | Path], output: str | Path) -> int:
    """Write the rows of several observation files to one, with all their comments.

    Returns:
        Number of rows.
    """
    paths = [Path(file) for file in files]
    if len(paths) < 2:
        raise InputError(f"{len(paths)} file of observations; allowed: two or more to join")
    with guard_inputs(*paths):
        target = output_target(output, _TABLES, "observations.csv")
    rows: list[dict[str, str]] = []
    comments: list[str] = []
    for path in paths:
        read_observations(path)
        table = observation_table(path)
        comments += [line for line in table.comments if line not in comments]
        rows += [dict(zip(row.header, row.cells, strict=True)) for row in table.rows()]
    names = dict.fromkeys([*COLUMNS, *(name for row in rows for name in row if name)])
    used = [name for name in names if any(row.get(name) for row in rows)]
    text = io.StringIO()
    writer = csv.DictWriter(text, used, restval="", extrasaction="ignore", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    with guard_inputs(*paths), atomic_write(target) as temporary:
        own = [] if any(MARK in line for line in comments) else [f"# joined, {MARK}"]
        temporary.write_text("".join(f"{line}\n" for line in (*comments, *own)) + text.getvalue(), encoding="utf-8")
        try:
            read_observations(temporary)
        except InputError as error:
            raise InputError(str(error).replace(str(temporary), "the joined file")) from error
    return len(rows)


_TEMPLATE = """\
# Observed speeds and rates, one row for each trial. Lines that start with # are comments.
# robot: its name, for people. The channel, wavelength and amplitude of the tail identify the robot of a row.
# channel_diameter_mm, wavelength_mm, amplitude_mm: needed. amplitude is the radius of the wire's centreline.
# trial: its number; a trial of a tail stands once.
# forward_velocity_mm_s, tail_rate_Hz, body_rate_Hz, motor_rate_Hz: what was measured; leave empty what was not.
#   All are signed about the swimming direction, in the lab; 1 Hz is one turn a second. A right-handed tail drives
#   with a positive rate, the body turns against it, and the motor's rate is the tail's less the body's.
# trials: only for a row that is a mean over that many trials.
# the columns *_ci95: half widths of 95 % intervals, where known: the error of this trial, or of the mean.
# Further columns, such as note, are yours; they are not read.
"""


def new_observations_file(path: str | Path, *, overwrite: bool = False) -> None:
    """Write an empty observations file: comments and the header."""
    target = output_target(
        path, {".csv": "an observations file"}, "observations.csv", replace="any" if overwrite else "none"
    )
    new_file(target, f"{_TEMPLATE}{','.join(COLUMNS)}\n", overwrite=overwrite)


def observations_answer(path: str | Path) -> dict[str, Any]:
    """The answer of `spirillum observations check`."""
    items = read_observations(path)
    names = ("forward_velocity", "tail_rate", "body_rate", "motor_rate")
    content = {
        "file": str(path),
        "valid": True,
        "rows": len(items),
        "tails": len({item.tail for item in items}),
        "channels": len({item.tail[0] for item in items}),
        "measured": {name: sum(_measured(item, name) for item in items) for name in names},
    }
    doubts = convention_doubt(all_rates(items))
    notes = (*unread_columns(observation_table(path)), *doubts, *without_copies(items)[1])
    return envelope("observations", content, notes)


def _measured(item: ObservationRow, name: str) -> bool:
    """Whether a row holds a quantity itself: a motor rate may be tail less body rate."""
    return math.isfinite(getattr(item, name)) and not (name == "motor_rate" and item.motor_derived)
