"""Table of `prepare` for several robots: the error of each one's table."""

from __future__ import annotations

from rich.console import Console

from spirillum.cli.tables.parts import Answer, grid
from spirillum.units import in_unit


def table(answer: Answer, console: Console) -> None:
    """Table of `prepare` for several robots: the error of each one's table."""
    robots = answer["robots"]
    names = {"forward_velocity": "speed", "body_rotation_rate": "body rate", "sideways_force": "side force"}
    rows = grid("largest errors of the tables, %", "robot", "tail, mm", "tube, mm", *names.values())
    for robot in robots:
        tail = " x ".join(in_unit(robot[name]["value"], "m", "mm") for name in ("wavelength", "amplitude"))
        errors = (f"{100.0 * robot['error'][name]['value']:.2g}" for name in names)
        rows.add_row(robot["robot"], tail, in_unit(robot["channel_diameter"]["value"], "m", "mm"), *errors)
    console.print(rows)
