"""The robot: checked tables whose parts fit together, what follows from them, and its text as a robot file."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any, NamedTuple, Self

import numpy as np
from pydantic import model_validator

from spirillum.data_tables import rows_of
from spirillum.files import MARK
from spirillum.kernels.core import AXIAL_CONSTANT, AXIAL_SLOPE, MOTOR_SIZE, windings
from spirillum.notes import Note
from spirillum.robot.batch import RobotBatch
from spirillum.robot.fields import default_of, field_values, refuse
from spirillum.robot.limits import assembly_limits, broken
from spirillum.robot.links import links_of, robot_solids
from spirillum.robot.tables import Battery, Motor, RobotTables
from spirillum.units import USUAL, Kind, display_unit, for_people, in_unit, parse_quantity, show, shown_in

STANDARD_GRAVITY = 9.80665  #: Standard acceleration of gravity, m/s^2 (3rd CGPM, 1901).


class Derived(NamedTuple):
    """A quantity that follows from the robot's fields."""

    value: float
    unit: str
    meaning: str


def motor_current_problem(motor: Motor, battery: Battery) -> str:
    """A sentence where (17) has no single steady current; empty where it has one."""
    # It has one if R(I) I - V(I) rises with I and R(I) is positive, up to the stall current.
    current = np.linspace(0.0, 1.1 * battery.voltage / max(battery.internal_resistance, 1e-3 * battery.voltage), 4001)
    r, motors, found = motor.resistance, np.zeros((current.size, MOTOR_SIZE)), np.empty((current.size, 2))
    motors[:, AXIAL_CONSTANT : AXIAL_SLOPE + 1] = (
        r.constant,
        r.decay,
        r.decay_rate,
        r.growth,
        r.growth_rate,
        r.slope,
    )
    windings(motors, current, found)
    resistance = found[:, 0]
    with np.errstate(over="ignore"):
        drop = resistance * current + battery.internal_resistance * current
    stall = int(np.searchsorted(np.maximum.accumulate(drop), battery.voltage))
    upto = slice(0, min(stall + 2, current.size))
    if np.all(resistance[upto] > 0) and np.all(np.diff(drop[upto]) > 0):
        return ""
    return (
        "motor.resistance: R(I) falls so steeply with current that (17) has no single steady current; "
        "allowed: R(I) > 0 and R(I) I - V(I) rising up to the stall current"
    )


def _in_words(value: Any, unit: str | None) -> str:
    """A field's value with the unit in which people read it."""
    if isinstance(value, tuple) and value and isinstance(value[0], tuple):
        return f"{len(value)} points"
    if unit is not None and isinstance(value, tuple):
        return ", ".join(_in_words(item, unit) for item in value)
    if unit is None or not isinstance(value, float):
        return str(value)
    si = unit.replace("**", "^")
    shown = display_unit(value, si)
    return f"{in_unit(value, si, shown)} {'' if shown == '1' else shown}".rstrip()


class Robot(RobotTables):
    """A swimmer with one helical tail, its fluid, channel and drive; SI inside, frozen.

    Made by `spirillum.load` from a preset or a TOML file; the fields are the tables of that file.
    """

    @model_validator(mode="after")
    def _can_be_built(self) -> Self:
        problems = [limit.sentence() for limit in broken(assembly_limits(RobotBatch.of(self)))]
        if problems:
            raise refuse(*problems)
        return self

    @model_validator(mode="after")
    def _one_motor_current(self) -> Self:
        """(17) has one steady current."""
        if self.motor is None or self.battery is None:
            return self
        problem = motor_current_problem(self.motor, self.battery)
        if problem:
            raise refuse(problem)
        return self

    def __repr__(self) -> str:
        """The robot in a line: name, body, tail and channel."""
        unit = display_unit(self.tail.amplitude, "m")
        body = show(self.body.diameter, unit) if self.has_body else "none"
        parts = [f"body {body}", f"tail {in_unit(self.tail.wavelength, 'm', unit)} x {show(self.tail.amplitude, unit)}"]
        parts += [f"channel {show(self.channel.diameter, unit)}"] if self.channel is not None else []
        return f"Robot({self.name}, {', '.join(parts)})"

    def __str__(self) -> str:
        """The robot for `print`: its fields with units as in its file, what follows from them, and their limits."""
        fields = [(path, _in_words(value, unit)) for path, value, unit in field_values(self) if value is not None]
        derived = [(name, _in_words(item.value, item.unit)) for name, item in self.derived().items()]
        limits = [(limit.field, limit.bound_in_words()) for limit in assembly_limits(RobotBatch.of(self))]
        known = [(name, words) for name, words in limits if words]
        lines = [repr(self)]
        for title, rows in (("fields", fields), ("what follows", derived), ("limits", known)):
            width = max(len(name) for name, _ in rows)
            lines += [title, *(f"  {name:<{width}}  {words}" for name, words in rows)]
        return "\n".join(lines)

    @property
    def seal_doubt(self) -> Note | None:
        """Note on a seal that reaches beyond the side of the body; None for one that fits."""
        body, seal = self.body, self.seal
        nose = 0.5 * body.length if body.shape in ("sphere", "spheroid", "profile") else body.rounding(body.front_end)
        longest = body.length - nose
        if seal is None or seal.length <= longest * (1.0 + 1e-12):
            return None
        return Note.named("seal-beyond-nose", own=show(seal.length, "mm"), most=show(longest, "mm"))

    @property
    def _tail_size(self) -> str:
        return f"{1e3 * self.tail.wavelength:g} x {1e3 * self.tail.amplitude:g}"

    @property
    def with_tail(self) -> str:
        """Its name and its tail, which tell it apart from the others of a study."""
        size = f"{self._tail_size} mm"
        return self.name if self.name.endswith(size) else f"{self.name}, tail {size}"

    def derived(self) -> dict[str, Derived]:
        """Derived quantities: lengths, volumes, weight, centre of mass.

        Weight and centre of mass need `body.mass` and `tail.density`; without them they are left out. Without
        `body.center_of_mass` the measured mass is assumed to be spread evenly over body and coupling.
        """
        batch, tail = RobotBatch.of(self), self.tail
        alpha, arc = float(batch.arc_fraction[0]), float(batch.arc_length[0])
        solids = robot_solids(self)
        links = links_of(self, solids)
        coupling = solids["coupling"].volume if "coupling" in solids else 0.0
        volumes = np.array([link.volume for link in links])
        volume = float(np.sum(volumes))
        found = {
            "arc_fraction": alpha,
            "pitch_angle": float(np.arccos(alpha)),
            "turns": tail.length / tail.wavelength,
            "arc_length": arc,
            "robot_length": self.body.length + self.coupling.length + tail.length,
            "body_volume": links.body.volume,
            "coupling_volume": coupling,
            "wire_volume": solids["tail"].volume,
            "displaced_volume": volume,
        }
        if (self.body.mass is None and (self.has_body or coupling)) or tail.density is None:
            return _described(found)
        masses = np.array([link.mass for link in links])
        mass = float(np.sum(masses))
        centre = masses @ np.array([link.centre[0] for link in links]) / mass
        assumed = "assumes body.mass spread evenly over body and coupling"
        if self.body.center_of_mass is not None:
            assumed = "with body.center_of_mass"
        buoyancy = volumes @ np.array([link.centroid[0] for link in links]) / volume
        displaced = self.fluid.density * volume
        found |= {
            "tail_mass": tail.density * solids["tail"].volume,
            "mass": mass,
            "submerged_weight": (mass - displaced) * STANDARD_GRAVITY,
            "weight_uncertainty": 0.01 * float(np.hypot(mass, displaced)) * STANDARD_GRAVITY,
            "centre_of_mass": float(centre),
            "centre_of_buoyancy": float(buoyancy),
        }
        return _described(found, assumed)


_DERIVED = {row["name"]: row for row in rows_of("robot/derived.csv")}
"""Units and meanings of what follows from a robot's fields."""


def _described(values: dict[str, float], assumed: str = "") -> dict[str, Derived]:
    """Derived quantities with units and meanings."""
    rows = {name: _DERIVED[name] for name in values}
    return {
        name: Derived(values[name], row["unit"], row["meaning"].format(assumed=assumed)) for name, row in rows.items()
    }


def robot_text(robot: Robot, comment: str = "") -> str:
    """The text of a file from which `spirillum.load` gives the same robot."""
    sections: dict[str, list[str]] = {"": []}
    for path, text in _fields(robot):
        section, _, name = path.rpartition(".")
        sections.setdefault(section, []).append(f"{name} = {text}")
    head = [*comment.splitlines(), f"Every field that is set, {MARK}."]
    lines = [f"# {line}" for line in head] + sections.pop("")
    for section, entries in sections.items():
        lines += ["", f"[{section}]", *entries]
    return "\n".join(lines) + "\n"


def with_numbers(robot: Robot, values: dict[str, float]) -> Robot:
    """The robot with numbers of its tables replaced; the whole is not checked anew."""
    for path, value in values.items():
        robot = _replaced(robot, path.split("."), value)
    return robot


def _replaced(table: Any, names: list[str], value: float) -> Any:
    first, *rest = names
    inner = _replaced(getattr(table, first), rest, value) if rest else value
    return table.model_copy(update={first: inner})


def _fields(robot: Robot) -> Iterator[tuple[str, str]]:
    for path, value, unit in field_values(robot):
        if value is None:
            if default_of(robot, path) is not None:
                yield path, '"none"'
        elif unit is None:
            yield path, json.dumps(list(value) if isinstance(value, (tuple, list)) else value, ensure_ascii=False)
        elif isinstance(value, tuple):
            yield path, json.dumps([_with_unit(item, unit) for item in value], ensure_ascii=False)
        else:
            yield path, f'"{_with_unit(float(value), unit)}"'


def _with_unit(value: float, unit: str) -> str:
    """In the unit that people read where that is exactly the same number, else in SI."""
    shown = for_people(unit)
    if shown in USUAL.get(unit, ()):
        text = f"{shown_in(value, shown):.12g} {shown}"
        if parse_quantity(text, Kind("quantity", unit, f"1 {unit}", f"-1e30 {unit}", f"1e30 {unit}")) == value:
            return text
    return f"{value!r} {unit}"


def without_reynolds_bound(robot: Robot) -> Robot:
    """Return the robot with its option `model.beyond_stokes` on."""
    return robot.model_copy(update={"model": robot.model.model_copy(update={"beyond_stokes": True})})
