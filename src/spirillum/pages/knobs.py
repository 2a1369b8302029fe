"""Commands of the page: parsing and refusals, and the adjustable fields of robot and run with their ranges."""

from __future__ import annotations

import json
import re
import traceback
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from spirillum.data_tables import records_of
from spirillum.errors import InputError, check_choice, clipped
from spirillum.robot.load import load
from spirillum.robot.placement import Placement
from spirillum.robot.robot import Robot, robot_text
from spirillum.units import KINDS, parse_option, parse_quantity

_SOURCE = re.compile(r"^(preset [\w-]+|the robot): ")
"""Reference to the robot in messages about a field, which the page shows at its control."""


def robot_tables(source: Any) -> dict[str, Any]:
    """A robot as its tables, which can be overridden and do not depend on a file."""
    import tomllib

    return tomllib.loads(robot_text(load(source)))


def text_of(command: Mapping[str, Any], name: str, unset: str | None = None) -> str:
    """A text of a command or a message."""
    value = command.get(name, unset)
    if not isinstance(value, str) or any("\ud800" <= letter <= "\udfff" for letter in value):
        raise InputError(f"{name} = {clipped(value, 40)}; allowed: text")
    return value


def number_of(command: Mapping[str, Any], low: float, high: float) -> float:
    """The number in a command, within limits."""
    value = command.get("value")
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not low <= value <= high:
        raise InputError(f"{command.get('do')} = {str(value)[:40]}; allowed: {low:g} to {high:g}")
    return float(value)


def report_fault(error: BaseException) -> None:
    """Print the traceback of an internal error in a running thread or process; the client gets a sentence."""
    if not isinstance(error, (InputError, MemoryError)):
        traceback.print_exception(error)


def refusal_of(command: Mapping[str, Any], sentence: str) -> str:
    """Response to an invalid command, JSON."""
    name = str(command.get("field") or command.get("do") or "")[:60]
    sentence = _SOURCE.sub("", sentence)
    return json.dumps({"t": "refused", "field": name, "lane": command.get("lane", 0), "sentence": sentence})


_LONGEST = 80  # characters of a value that is typed


@dataclass(frozen=True)
class Knob:
    """One control of a field."""

    field: str  #: Dotted field of the robot file, or of the run (`run.gap`).
    label: str  #: Text of the value.
    group: str  #: Heading of its group.
    unit: str = ""  #: Unit in which it is shown; empty for a choice.
    kind: str = ""  #: Kind of its quantity, of `units.KINDS`; empty for a choice.
    low: float = 0.0  #: Ends of its slider, in that unit; a value outside them can be typed.
    high: float = 1.0
    choices: tuple[str, ...] = ()  #: Options of a choice.
    note: str = ""  #: Description, a sentence.
    logarithmic: bool = False  #: Whether its slider has equal steps of ratio.
    unset: str = ""  #: Meaning of an empty field; empty: a value is required.
    needs: str = ""  #: Table of the robot without which it is not shown.


KNOBS = records_of("pages/knobs.csv", Knob)  #: All knobs, in their order, without the model, the remote and the duty.

MODELS = ("auto", "tube", "slender", "rft")  #: Models that can move a free robot.
_BY_FIELD = {knob.field: knob for knob in KNOBS}


@dataclass(frozen=True)
class Settings:
    """Settings of one robot of the page; frozen, so that undo is a list of them."""

    source: Any  #: Preset's name, file or checked robot that it starts from.
    overrides: Mapping[str, str] = field(default_factory=dict)  #: Changed fields of the robot, with their unit.
    run: Mapping[str, str] = field(default_factory=dict)  #: `gap`, `pitch`, `flow` where they are set, with their unit.
    model: str = "auto"  #: Requested model.

    def robot(self) -> Robot:
        """The robot, checked; a size that varies along the tail is scaled as a whole."""
        changed: dict[str, Any] = dict(self.overrides)
        scaled = [name for name in ("amplitude", "wavelength") if f"tail.{name}" in changed]
        if scaled:
            own = load(self.source).tail
            changed |= {f"tail.{name}_along": getattr(own, f"{name}_along") or "none" for name in scaled}
        return load(self.source, **changed)

    def placement(self) -> Placement:
        """Initial placement."""
        return Placement.of(dict(self.run))

    def changed(self, name: str, value: str) -> Settings:
        """With another value of one control."""
        if len(value) > _LONGEST:
            raise InputError(f"a value of {len(value)} characters; allowed: at most {_LONGEST}")
        value = value.strip()
        if name == "run.model":
            check_choice("model", value, MODELS)
            return replace(self, model=value)
        knob = _BY_FIELD.get(name)
        if knob is None:
            raise InputError(f"{name[:60]!r} is no knob; allowed: {', '.join(_BY_FIELD)}")
        if not value and not knob.unset:
            raise InputError(f"{knob.label.lower()} is empty; allowed: a value such as '{knob.high:g} {knob.unit}'")
        if name.startswith("run."):
            short = name.removeprefix("run.")
            kept = {key: item for key, item in self.run.items() if key != short}
            if value:
                parse_option(short, value, KINDS[knob.kind])
                kept[short] = value
            return replace(self, run=kept)
        return replace(self, overrides={**self.overrides, name: value})

    def knob_data(self, robot: Robot) -> list[dict[str, Any]]:
        """The knobs of this robot with their values, in their units."""
        return [
            _knob_data(knob, self, robot)
            for knob in KNOBS
            if not (knob.needs and getattr(robot, knob.needs) is None) and robot.source_of(knob.field) is None
        ]


def _knob_data(knob: Knob, settings: Settings, robot: Robot) -> dict[str, Any]:
    names = ("field", "label", "group", "unit", "note", "logarithmic", "unset")
    changed = knob.field in settings.overrides or knob.field.removeprefix("run.") in settings.run
    found: dict[str, Any] = {name: getattr(knob, name) for name in names}
    found |= {"choices": list(knob.choices), "changed": changed}
    if knob.field.startswith("run."):
        short = knob.field.removeprefix("run.")
        given = settings.run.get(short)
        si = None if given is None else parse_option(short, given, KINDS[knob.kind])
    else:
        table, name = knob.field.split(".")
        si = getattr(getattr(robot, table), name)
    if knob.choices:
        return found | {"value": si}
    if si is None:
        return found | {"value": None, "low": knob.low, "high": knob.high}
    limit, smaller = _SMALL.get(knob.unit, (0.0, knob.unit))
    unit = smaller if abs(float(si)) < limit else knob.unit
    value = float(si) / parse_quantity(f"1 {unit}", KINDS[knob.kind])
    low, high = _range(knob, value) if unit == knob.unit else _around(value)
    return found | {"unit": unit, "value": float(f"{value:.12g}"), "low": low, "high": high}


_SMALL = {"mm": (2e-5, "um"), "Pa s": (0.02, "mPa s")}
"""Unit of a control to the SI size below which it is shown in another, as a bacterium's."""


def _range(knob: Knob, value: float) -> tuple[float, float]:
    """Ends of the slider: the control's own, or those around a value that is near or beyond them."""
    if value <= 0 or 1.5 * knob.low <= value <= knob.high:
        return knob.low, knob.high
    return _around(value)


def _around(value: float) -> tuple[float, float]:
    """From a quarter of a value to three times it."""
    return float(f"{0.25 * value:.2g}"), float(f"{3.0 * value:.2g}")
