"""Tables of `prepare`: errors at places that were not used, and where the table holds."""

from __future__ import annotations

from rich.console import Console

from spirillum.cli.tables.parts import Answer, grid
from spirillum.units import in_unit


def table(answer: Answer, console: Console) -> None:
    """Tables of `prepare`: errors at places that were not used, and where the table holds."""
    rows = grid(f"{answer['robot']}: error of its table", "quantity", "largest error without yaw, %", "with yaw, %")
    for name, item in answer["error"].items():
        level = answer["error_without_yaw"][name]
        rows.add_row(name.replace("_", " "), f"{100.0 * level['value']:.2g}", f"{100.0 * item['value']:.2g}")
    console.print(rows)
    valid = answer["valid"]
    ranges = grid("where it holds", "gap, level, mm", "pitch up to, deg", "nose down to, deg", "yaw, level, to, deg")
    units = (("gap", "mm"), ("pitch_up", "deg"), ("pitch_down", "deg"), ("yaw", "deg"))
    columns = [(valid[name]["value"], unit) for name, unit in units]
    for index in range(len(valid["gap"]["value"])):
        ranges.add_row(*(in_unit(values[index], "m" if unit == "mm" else "rad", unit) for values, unit in columns))
    console.print(ranges)
    console.print(f"{answer['places']} places in {answer['seconds']['value']:.0f} s", highlight=False)
