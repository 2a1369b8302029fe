"""The form of a setup: its fields in their order, and what each of them means."""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass
from typing import Any

from spirillum.errors import InputError, clipped

_LONGEST = 200  # characters of a field


@dataclass(frozen=True)
class Entry:
    """One field of the setup file."""

    field: str
    label: str
    group: str
    example: str  #: Placeholder of an empty field: its meaning, or an example.
    note: str
    choices: tuple[str, ...] = ()
    number: bool = False  #: Whether it is a bare number, without a unit.
    uncertain: bool = False  #: Whether it has a standard uncertainty in a field of its own.


FORM: tuple[Entry, ...] = (
    Entry(
        "robot.direction",
        "Nose points",
        "Picture",
        "",
        "Where in the picture the nose points.",
        ("right", "left", "up", "down"),
    ),
    Entry(
        "robot.appearance",
        "Body's cover",
        "Picture",
        "",
        "Opaque, or glass through which its contents and the background show.",
        ("unknown", "opaque", "glass"),
    ),
    Entry(
        "robot.stripes",
        "Stripes",
        "Picture",
        "as in the robot file",
        "Colours in their order, if not those of the robot file; with commas.",
    ),
    Entry(
        "markers.spacing",
        "Ruler spacing",
        "Picture",
        "such as 2 mm",
        "From each line of the ruler to the next.",
        uncertain=True,
    ),
    Entry(
        "markers.length_per_pixel",
        "Or per pixel",
        "Picture",
        "instead of a ruler",
        "Length that one pixel shows at the height of the robot's axis.",
        uncertain=True,
    ),
    Entry(
        "camera.view",
        "View",
        "Heights",
        "",
        "top: from above; side: level, at right angles to the channel.",
        ("top", "side"),
    ),
    Entry(
        "camera.height",
        "Lens",
        "Heights",
        "such as 210 mm",
        "Of the lens above the reference plane: the tank's floor, or its far wall in a side view.",
        uncertain=True,
    ),
    Entry("tank.surface", "Oil surface", "Heights", "none", "Of the flat surface between air and oil.", uncertain=True),
    Entry("tank.index", "Index of oil", "Heights", "1.4", "Refractive index of the oil.", number=True, uncertain=True),
    Entry(
        "markers.height", "Ruler", "Heights", "such as 0 mm", "Of the ruler above the reference plane.", uncertain=True
    ),
    Entry(
        "robot.axis_height",
        "Robot's axis",
        "Heights",
        "such as 13 mm",
        "Of the robot's axis above the reference plane.",
        uncertain=True,
    ),
    Entry(
        "start",
        "From",
        "Time",
        "the beginning",
        "Start of the measurement in the video, such as the end of the start-up.",
    ),
    Entry("end", "Until", "Time", "the end", "Time until which to measure."),
    Entry(
        "camera.frames_per_second",
        "Frame rate",
        "Time",
        "the film's own",
        "Frames per second, instead of the video's time stamps, for slow motion.",
        number=True,
    ),
)
"""Fields of the form, without the robot's file."""

_NUMBERS = {entry.field for entry in FORM if entry.number} | {"tank.index_uncertainty"}
_KNOWN = {entry.field for entry in FORM} | {f"{entry.field}_uncertainty" for entry in FORM if entry.uncertain}


def form_list() -> list[dict[str, Any]]:
    """The form as the page builds it."""
    return [asdict(entry) for entry in FORM]


def form_fields(given: Mapping[str, Any], robots: tuple[str, ...]) -> dict[str, Any]:
    """Fields of a setup from a form or a file, without empty ones."""
    found: dict[str, Any] = {}
    for name, value in given.items():
        if name != "robot.file" and name not in _KNOWN:
            raise InputError(f"{str(name)[:60]} is no field of this form; allowed: {', '.join(sorted(_KNOWN))}")
        if isinstance(value, list) and name == "robot.stripes":
            value = ", ".join(map(str, value))  # noqa: PLW2901
        known = isinstance(value, (str, int, float)) and not isinstance(value, bool)
        text = str(value).strip() if known else clipped(value)
        if not known or len(text) > _LONGEST or not text.isprintable():
            raise InputError(f"{name} = {text[:60]!r}; allowed: a text of at most {_LONGEST} printable characters")
        if name == "robot.file" and text not in robots:
            raise InputError(f"robot.file = {text[:60]!r}; allowed: {', '.join(robots)}")
        if text:
            found[name] = _typed(name, text)
    return found


def _typed(name: str, text: str) -> Any:
    if name == "robot.stripes":
        return [part.strip() for part in text.split(",") if part.strip()]
    if name in _NUMBERS:
        with suppress(ValueError):
            number = float(text.replace(",", "."))
            if math.isfinite(number):  # JSON has no others; as text its field refuses it
                return number
    return text
