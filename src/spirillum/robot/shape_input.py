"""Reading of a tail or a body that is given by points or as a function along it, into the numbers of its table."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from itertools import pairwise
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from spirillum.errors import InputError, led_by
from spirillum.files import read_text
from spirillum.files.limits import MOST_POINTS
from spirillum.files.reading import csv_rows, number_in
from spirillum.notes import Note
from spirillum.robot.fields import refuse
from spirillum.robot.tail_form import Along, CurvePoints, TailForm, along_points, centre_line
from spirillum.scalars import is_number
from spirillum.units import KINDS, parse_quantity, show

FILES = {("tail", "curve"): ("x", "y", "z"), ("body", "profile"): ("x", "r")}
"""Fields that name a file of points, mm, and its columns."""
DISPLACED = {
    "tail.curve": ("wavelength", "amplitude", "length", "taper", "handedness", "amplitude_along", "wavelength_along"),
    "tail.amplitude": ("amplitude_along",),
    "tail.wavelength": ("wavelength_along",),
    "body.profile": ("shape", "diameter", "length", "front", "rear", "fillet"),
    "body.shape": ("profile",),
}
"""Fields of the layer below that a field of a layer replaces."""


def source_of(field: str, *, curve: bool, profile: bool) -> str | None:
    """Field with the points from which a field follows, where there are any; None for one of its own."""
    table, _, name = field.partition(".")
    for source, there in (("tail.curve", curve), ("body.profile", profile)):
        if there and source.startswith(f"{table}.") and name in DISPLACED[source]:
            return source
    return None


_COLUMN = re.compile(r"(\w+?)(?:(?:[\s_]+|\s*(?=[\[(]))[\[(]?([a-zµμ]+)[\])]?)?")
"""The name of a column and the unit behind it."""
_SMOOTHED = {"spread": 0.02, "amplitude": 0.05, "length": 0.05}
"""Largest relative changes by smoothing without a caution, of `CentreLine`."""
_TURNED = 0.5  # cosine of the largest angle between neighbouring chords of a centre line


def read_points(path: Path, columns: Sequence[str], field: str) -> list[list[float]]:
    """Points of a file, one a row, mm; a first row of words names the columns, which are in mm or in its unit."""
    what = f"for {field} a CSV file of points ({', '.join(columns)}) in mm"
    rows, scale = csv_rows(read_text(path, what), path, what), 1.0
    if rows and not any(map(_is_written_number, rows[0][1])):
        scale = _scale_of(rows[0][1], columns)
        if not scale:
            shown = ", ".join(rows[0][1])[:60]
            named = f"with no names or these, or in another length, as {columns[0]}_m"
            raise InputError(f"{path}, line {rows[0][0]}: columns {shown!r}; allowed: {what}, {named}")
        rows = rows[1:]
    if len(rows) > MOST_POINTS:
        raise InputError(f"{path} has {len(rows)} points; allowed: {what}, at most {MOST_POINTS}")
    found = []
    for line, cells in rows:
        numbers = [scale * number_in(cell) if _is_written_number(cell) else float("nan") for cell in cells]
        if len(numbers) != len(columns) or not all(map(isfinite, numbers)):
            shown = ", ".join(cells)[:60]
            raise InputError(f"{path}, line {line}: {shown!r} is no point; allowed: {what}, {len(columns)} numbers")
        found.append(numbers)
    return found


def _scale_of(header: Sequence[str], columns: Sequence[str]) -> float:
    """The unit of the columns that a header names, mm; 0 where it names others."""
    parts = [found.groups(default="mm") for cell in header if (found := _COLUMN.fullmatch(cell.strip().lower()))]
    units = {unit for _, unit in parts}
    if [name for name, _ in parts] != list(columns) or len(parts) != len(header) or len(units) != 1:
        return 0.0
    try:
        return 1.0 if units == {"mm"} else 1e3 * parse_quantity(f"1 {units.pop()}", KINDS["length"])
    except InputError:
        return 0.0


def _is_written_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def with_points_of_files(table: dict[str, Any], folder: Path, source: str) -> dict[str, Any]:
    """The raw tables of a robot from `source` with the points of the files that they name, looked for from a folder."""
    for (section, name), columns in FILES.items():
        inner = table.get(section)
        if isinstance(inner, Mapping) and isinstance(inner.get(name), (str, Path)) and inner[name] != "none":
            with led_by(source):
                points = read_points(folder / str(inner[name]), columns, f"{section}.{name}")
            table = {**table, section: {**inner, name: points}}
    return table


def checked_points(points: Any, columns: Sequence[str], field: str, least: int) -> tuple[tuple[float, ...], ...]:
    """Points as tuples of finite numbers, no two neighbours the same."""
    allowed = f"at least {least} and at most {MOST_POINTS} points ({', '.join(columns)}) in mm, or a CSV file of them"
    if isinstance(points, str) or not isinstance(points, Sequence):
        raise refuse(f"{field} = {str(points)[:40]!r} is no list of points; allowed: {allowed}")
    if not least <= len(points) <= MOST_POINTS:
        raise refuse(f"{field} has {len(points)} point{'s' * (len(points) != 1)}; allowed: {allowed}")
    found: list[tuple[float, ...]] = []
    for number, point in enumerate(points, 1):
        if not isinstance(point, Sequence) or isinstance(point, str) or len(point) != len(columns):
            raise refuse(
                f"{field}: point {number} = {str(point)[:60]} is not {len(columns)} numbers; allowed: {allowed}"
            )
        if not all(is_number(value) and isfinite(value) and abs(value) <= 1e5 for value in point):
            raise refuse(
                f"{field}: point {number} = {str(point)[:60]} has other than finite numbers of at most 1e5; allowed: "
                f"{allowed}"
            )
        found.append(tuple(float(value) for value in point))
        if number > 1 and found[-1] == found[-2]:
            raise refuse(f"{field}: points {number - 1} and {number} are the same; allowed: each point once")
    return tuple(found)


def read_tail(raw: Any) -> Any:
    """A raw [tail] table whose sizes are numbers: functions along the tail and centre lines are taken apart."""
    if not isinstance(raw, Mapping):
        return raw
    table = dict(raw)
    if table.get("curve") in (None, "none"):
        table.pop("curve", None)
        for name in ("amplitude", "wavelength"):
            if isinstance(table.get(name), (Mapping, list, tuple)):
                if table.get(f"{name}_along"):
                    raise refuse(f"tail.{name} and tail.{name}_along both vary along the tail; allowed: one of them")
                table[name], table[f"{name}_along"] = _read_along(table[name], name, table.get("length"))
        tolerance = table.get("curve_tolerance")
        if tolerance is not None and parse_or_refuse("tail.curve_tolerance", tolerance, "length or zero") > 0:
            raise refuse("tail.curve_tolerance is set without tail.curve; allowed: both, or neither")
        return table
    return _read_curve(table)


def parse_or_refuse(field: str, value: Any, kind: str) -> float:
    """A quantity of a kind, SI."""
    try:
        return parse_quantity(value, KINDS[kind])
    except InputError as error:
        raise refuse(f"{field} {error}") from error


def _read_along(value: Any, name: str, length: Any) -> tuple[str, Along]:
    """The size of a function along the tail, with its unit, and the function over it."""
    field = f"tail.{name}"
    pairs_of = '["distance from the root", "value"] up to tail.length'
    allowed = f'a length, for example "18 mm", {{ from = "1 mm", to = "3 mm" }}, or a list of {pairs_of}'
    if isinstance(value, Mapping) and set(value) == {"cone"} and isinstance(value["cone"], Mapping):
        value = value["cone"]
    if isinstance(value, Mapping):
        if set(value) != {"from", "to"}:
            raise refuse(f"{field} = {str(dict(value))[:60]} is no cone; allowed: {allowed}")
        ends = (parse_or_refuse(f"{field}.{end}", value[end], "length") for end in ("from", "to"))
        pairs = list(zip((0.0, 1.0), ends, strict=True))
    else:
        pairs = _table_along(value, field, length, allowed)
    along = tuple(pairs)
    size = (
        max(item for _, item in along)
        if name == "amplitude"
        else 1.0 / float(along_points(along, inverse=True)[2](1.0))
    )
    return f"{size!r} m", tuple((share, item / size) for share, item in along)


def _table_along(value: Sequence[Any], field: str, length: Any, allowed: str) -> list[tuple[float, float]]:
    whole = parse_or_refuse("tail.length", length, "length")
    if not 2 <= len(value) <= MOST_POINTS:
        raise refuse(f"{field} = {str(value)[:60]} is not from 2 to {MOST_POINTS} points; allowed: {allowed}")
    pairs: list[tuple[float, float]] = []
    for number, row in enumerate(value, 1):
        if not isinstance(row, Sequence) or isinstance(row, str) or len(row) != 2:
            raise refuse(f"{field}: point {number} = {str(row)[:60]} is no pair; allowed: {allowed}")
        place = parse_or_refuse(f"{field}: distance {number}", row[0], "length or zero") / whole
        pairs.append((place, parse_or_refuse(f"{field}: value {number}", row[1], "length")))
        if number > 1 and not place > pairs[-2][0]:
            raise refuse(f"{field}: distance {number} is not beyond the one before; allowed: distances that increase")
    if abs(pairs[0][0]) > 1e-9 or abs(pairs[-1][0] - 1.0) > 1e-9:
        raise refuse(f"{field} is not given from the root to the tip; allowed: {allowed}")
    pairs[0], pairs[-1] = (0.0, pairs[0][1]), (1.0, pairs[-1][1])
    return pairs


def read_along(value: Any) -> Any:
    """A function along the tail as pairs of a share and a factor."""
    if value is None or value == "none":
        return None
    pairs = value if isinstance(value, (list, tuple)) and value else None
    good = pairs is not None and all(
        isinstance(pair, (list, tuple)) and len(pair) == 2 and all(is_number(item) for item in pair) for pair in pairs
    )
    if pairs is None or not good or len(pairs) > MOST_POINTS:
        raise ValueError("a list of [share of the length, factor]")
    found = tuple((float(share), float(factor)) for share, factor in pairs)
    shares = [share for share, _ in found]
    rising = all(after > before for before, after in pairwise(shares))
    if not (rising and (shares[0], shares[-1]) == (0.0, 1.0) and all(1e-6 <= f <= 1e6 for _, f in found)):
        raise ValueError("shares that increase from 0 to 1, each with a factor above 0")
    return found


def _read_curve(table: dict[str, Any]) -> dict[str, Any]:
    """A tail along a centre line: the sizes that follow from it, as text with their unit."""
    points: CurvePoints = checked_points(table["curve"], ("x", "y", "z"), "tail.curve", 4)  # type: ignore[assignment]
    tolerance = parse_or_refuse("tail.curve_tolerance", table.get("curve_tolerance") or "0 mm", "length or zero")
    _check_order(points)
    line = centre_line(points, tolerance)
    follows = {
        "wavelength": f"{line.reach / line.turns!r} m",
        "amplitude": f"{line.amplitude!r} m",
        "length": f"{line.reach!r} m",
        "handedness": "left" if line.winding < 0 else "right",
    }
    for name, value in follows.items():
        own = table.get(name)
        if own is None:
            continue
        same = own == value if name == "handedness" else _same_length(f"tail.{name}", own, value)
        if not same:
            raise refuse(
                f"tail.{name} = {str(own)[:40]} with tail.curve, which makes it {_format_size(value)}; "
                "allowed: leave it out"
            )
    for name in ("amplitude_along", "wavelength_along"):
        if table.get(name):
            raise refuse(f"tail.{name} with tail.curve; allowed: one of them")
    if table.get("taper", "none") not in (None, "none"):
        raise refuse(f"tail.taper = {str(table['taper'])[:40]} with tail.curve; allowed: leave it out")
    return {**table, **follows, "curve": points, "taper": "none"}


def smoothing_notes(form: TailForm) -> tuple[Note, ...]:
    """Warn where smoothing changes the shape of a centre line by more than the removal of noise does."""
    if not form.tolerance:
        return ()
    smooth, exact = form.centre, centre_line(form.curve, 0.0)
    # Noise leaves the radius as it is, to the square of its share, but makes a wire longer.
    changes = {name: getattr(smooth, name) / getattr(exact, name) - 1.0 for name in _SMOOTHED}
    if all(abs(change) <= _SMOOTHED[name] for name, change in changes.items()):
        return ()
    radius, amplitude, length = (f"{100.0 * change:+.2g} %" for change in changes.values())
    sizes = {"tolerance": show(form.tolerance, "mm"), "radius": radius, "amplitude": amplitude, "length": length}
    return (Note.named("curve-smoothed", **sizes),)


def read_profile(table: dict[str, Any]) -> dict[str, Any]:
    """A [body] table whose outline is given by points: the sizes that follow from them, as text with their unit."""
    points = checked_points(table["profile"], ("x", "r"), "body.profile", 3)
    _check_profile(points)
    x, r = np.array(points).T
    follows = {"length": f"{1e-3 * float(np.ptp(x))!r} m", "diameter": f"{2e-3 * float(np.max(r))!r} m"}
    for name, value in follows.items():
        if table.get(name) is not None and not _same_length(f"body.{name}", table[name], value):
            raise refuse(
                f"body.{name} = {table[name]} with body.profile, which makes it {_format_size(value)}; "
                "allowed: leave it out"
            )
    if table.get("shape", "profile") != "profile":
        raise refuse(f"body.shape = {str(table['shape'])[:40]!r} with body.profile; allowed: leave it out")
    return {**table, **follows, "shape": "profile", "profile": points}


def _check_profile(points: tuple[tuple[float, ...], ...]) -> None:
    """Refuse an outline that is open, folds back, or touches the axis between its ends."""
    x, r = np.array(points).T
    allowed = "points (x, r) from one pole to the other, r = 0 at both and above 0 between them, x in one direction"
    for at, end in ((0, "first"), (-1, "last")):
        if r[at] != 0.0:
            raise refuse(f"body.profile is open: its {end} r = {r[at]:g} mm; allowed: {allowed}")
    if np.any(r[1:-1] <= 0.0):
        at = int(np.argmax(r[1:-1] <= 0.0)) + 1
        raise refuse(f"body.profile: point {at + 1} has r = {r[at]:g} mm; allowed: {allowed}")
    steps = np.diff(x) * np.sign(x[-1] - x[0])
    if x[0] == x[-1] or np.any(steps < 0.0):
        raise refuse(f"body.profile folds back at point {int(np.argmin(steps)) + 2}; allowed: {allowed}")


def _format_size(value: str) -> str:
    """A derived size in words; a hand is one."""
    return show(parse_quantity(value, KINDS["length"]), "mm") if value.endswith(" m") else value


def _same_length(field: str, own: Any, value: str) -> bool:
    length = parse_quantity(value, KINDS["length"])
    return abs(parse_or_refuse(field, own, "length") / length - 1.0) < 1e-9


def _check_order(points: CurvePoints) -> None:
    """Refuse points that are not in order along a wire behind the root."""
    line = np.array(points)
    chords = np.diff(line, axis=0)
    chords /= np.linalg.norm(chords, axis=1, keepdims=True)
    bent = np.sum(chords[1:] * chords[:-1], axis=1)
    if np.min(bent, initial=1.0) < _TURNED:
        at = int(np.argmin(bent)) + 2
        angle = np.degrees(np.arccos(np.clip(bent[at - 2], -1.0, 1.0)))
        raise refuse(
            f"tail.curve turns by {angle:.3g} deg at point {at}; allowed: points in order along the wire, by at most "
            "60 deg from one chord to the next"
        )
    if np.min(line[:, 0]) < 0.0:
        at = int(np.argmin(line[:, 0]))
        raise refuse(
            f"tail.curve: point {at + 1} lies {-line[at, 0]:.3g} mm before the root; "
            "allowed: x from 0 on, increasing from the root to the tip"
        )
    if np.max(line[:, 0]) <= 0.0 or np.max(np.hypot(line[:, 1], line[:, 2])) <= 0.0:
        raise refuse(
            "tail.curve does not leave the root's plane and the axis; allowed: a line behind the root, off the axis"
        )
