"""Robots, their files, resistances and tables."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.markup import escape
from rich.table import Table

from spirillum.cli.tables.parts import (
    Answer,
    Blocks,
    cell,
    friendly,
    grid,
    in_words,
    placement_of,
    quantity_grid,
    reason_of,
    series_rows,
)
from spirillum.results.installation import report_lines
from spirillum.units import for_people, shown_in


def robot(answer: Answer) -> Blocks:
    """Fields of `robot show`, and what follows from them."""
    fields = answer["fields"]
    yield f"{fields['name']}  {fields['description']}"
    yield from _inherited(answer)
    rows = grid("fields", "field", "value", "unit")
    rows.columns[0].no_wrap, rows.columns[1].no_wrap = True, False  # values may be words
    for name, item in fields.items():
        word = "none" if name in ("tail.taper", "channel", "seal") and item is None else _word(item)
        value, unit = _quantity(item) if isinstance(item, Mapping) else (word, "")
        if name not in ("name", "description", "reference"):
            rows.add_row(name, value, unit)
    yield rows
    found = grid("what follows", "quantity", "value", "unit", "meaning")
    for name, item in answer["derived"].items():
        value, unit = friendly(item["value"], item["unit"])
        found.add_row(name.replace("_", " "), value, unit, item["meaning"])
    yield found


def _inherited(answer: Answer) -> Iterator[str]:
    """Deciding fields that the robot file does not set itself."""
    if "inherited" in answer:
        taken = answer["inherited"]
        fields = ", ".join(f"{path} {in_words(item)}" for path, item in taken["fields"].items())
        yield f"taken from {taken['from']}, to be set where yours differs: {fields}"


def _quantity(item: Mapping[str, Any]) -> tuple[str, str]:
    """A number, or several in one unit, as people read them."""
    if not isinstance(item["value"], (list, tuple)):
        return friendly(item["value"], item["unit"])
    shown = for_people(item["unit"])
    return ", ".join(f"{shown_in(value, shown):.4g}" for value in item["value"]), shown


def _word(value: Any) -> str:
    if value is None:
        return "-"
    if isinstance(value, (tuple, list)):
        if value and isinstance(value[0], (tuple, list)):
            return f"{len(value)} points"
        return escape(", ".join(str(item) for item in value)) or "-"
    return f"{value:.6g}" if isinstance(value, float) else escape(str(value))


def report(answer: Answer) -> Blocks:
    """Versions, platform and extras."""
    yield from report_lines(answer)


def check(answer: Answer) -> Blocks:
    """Text of `robot check`."""
    yield f"{answer['robot']}: {'valid' if answer['valid'] else 'not valid'}"
    yield from (f"problem: {problem}" for problem in answer["problems"])
    yield from _inherited(answer)


def export(answer: Answer) -> Blocks:
    """Files of `export`, then the numbers of the geometry."""
    first, *others = (Path(item["file"]) for item in answer["files"])
    meshes = [path for path in others if path.parent != first.parent]
    lines = [f"{item['file']}: {item['holds']}" for item in answer["files"] if Path(item["file"]) not in meshes]
    if meshes:
        lines.insert(1, f"{meshes[0].parent}: {len(meshes)} mesh files, in mm")
    yield from lines
    if "solid" in answer:
        solid = answer["solid"]
        state = "watertight" if solid["watertight"] else "not watertight"
        bodies = "one body" if solid["bodies"] == 1 else f"{solid['bodies']} bodies"
        yield f"{bodies}, {state}, {solid['triangles']} triangles"
        size = " x ".join(f"{1e3 * value:.4g}" for value in solid["size"]["value"])
        yield f"{size} mm, {1e6 * solid['volume']['value']:.4g} ml"
    elif "parameters" in answer:
        title = f"{answer['robot']}, {answer['motion']}: model {answer['model']}, friction {answer['friction']}"
        if not answer["parameters"]:
            yield title
            return
        rows = ((name, f"{item['value']:.6g}", item["unit"]) for name, item in answer["parameters"].items())
        yield grid(title, "parameter", "value", "unit", rows=rows)
        yield from reason_of(answer)
    else:
        links = answer["links"].items()
        masses = {f"{name} {key}": link[key] for name, link in links for key in ("mass", "displaced_volume")}
        yield quantity_grid(f"{answer['robot']}: links", masses)


def resistance(answer: Answer) -> Blocks:
    """Blocks of the matrix of `resistance`; each 6x6 stands once."""
    title = f"{answer['robot']}: resistance of {answer['part']}, model {answer['model']}, about {answer['about']}"
    if "links" in answer:
        yield title
    matrix, links = answer["matrix"]["value"], answer.get("links", [answer["part"]])
    for number, on in enumerate(links):
        for other in range(number, len(links)):
            block = [row[6 * other : 6 * other + 6] for row in matrix[6 * number : 6 * number + 6]]
            yield _six_by_six(title if len(links) == 1 else f"on the {on}, by motion of the {links[other]}", block)
    yield "N s/m (upper left), N s, N m s (lower right); F = -B V"
    yield from placement_of(answer["placement"])


def _six_by_six(title: str, block: Sequence[Sequence[float | None]]) -> Table:
    rows = grid(title, "")
    rows.padding = (0, 0, 0, 0)
    for name in ("U_x", "U_y", "U_z", "Omega_x", "Omega_y", "Omega_z"):
        rows.add_column(name, justify="right", no_wrap=True, min_width=10)
    for name, row in zip(("F_x", "F_y", "F_z", "T_x", "T_y", "T_z"), block, strict=True):
        rows.add_row(name, *("-" if entry is None else f"{entry:.4g}" for entry in row))
    return rows


def preparation(answer: Answer) -> Blocks:
    """Errors of a table between its poses, and where it holds."""
    rows = grid(f"{answer['robot']}: error of its table", "quantity", "largest error without yaw, %", "with yaw, %")
    for name, item in answer["error"].items():
        level = answer["error_without_yaw"][name]
        yawed = "no yaw" if answer["stage"] == "straight" else f"{100.0 * item['value']:.2g}"
        rows.add_row(name.replace("_", " "), f"{100.0 * level['value']:.2g}", yawed)
    yield rows
    valid = answer["valid"]
    heads = ("gap, level, mm", "pitch up to, deg", "nose down to, deg", "yaw, level, to, deg")
    units = {"gap": "mm", "pitch_up": "deg", "pitch_down": "deg", "yaw": "deg"}
    yield grid("where it holds", *heads, rows=series_rows(valid, units))
    yield f"the table has {answer['places']} poses and took {answer['seconds']['value']:.0f} s to compute"


def preparations(answer: Answer) -> Blocks:
    """The error of each robot's table."""
    names = {"forward_velocity": "speed", "body_rotation_rate": "body rate", "sideways_force": "side force"}
    rows = grid("largest errors of the tables, %", "robot", "tail, mm", "tube, mm", *names.values())
    for one in answer["robots"]:
        tail = " x ".join(cell(one[name], "mm") for name in ("wavelength", "amplitude"))
        errors = (f"{100.0 * one['error'][name]['value']:.2g}" for name in names)
        rows.add_row(one["robot"], tail, cell(one["channel_diameter"], "mm"), *errors)
    yield rows
