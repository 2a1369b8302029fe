"""A template of a setup file, reading of a filled one, and what uncertain heights in it do to lengths."""

from __future__ import annotations

import json
import math
import re
import tomllib
from collections.abc import Collection, Iterable, Mapping
from pathlib import Path
from typing import Any

from spirillum.envelope import envelope, quantity
from spirillum.errors import led_by
from spirillum.files import new_file, output_target, parse_toml
from spirillum.notes import Note
from spirillum.robot.fields import field_values, problems_in
from spirillum.robot.robot import Robot
from spirillum.vision.camera.camera import opened, samples_of
from spirillum.vision.camera.scale import pictures_of
from spirillum.vision.flag import Flag
from spirillum.vision.setup import WHAT, Setup, load_setup
from spirillum.vision.track.learning import learnt_from
from spirillum.vision.track.size import checked_scale
from spirillum.vision.track.steadiness import camera_flags

_STEP = 1e-3


def apparent_distance(height: float, camera: float, surface: float | None, index: float) -> float:
    """Distance in air at which a point would look as large: (H - S) + (S - z)/n below a surface at S."""
    if surface is None or height >= surface:
        return camera - height
    return camera - surface + (surface - height) / index


def spacing_at_axis(setup: Setup, changed: str = "", by: float = 0.0) -> float:
    """Length at the robot's axis that looks as long as the ruler's spacing (without one: 1), with one field changed."""

    def number(name: str, value: float) -> float:
        return value + by if name == changed else value

    camera = number("camera.height", setup.camera.height)
    surface = None if setup.tank.surface is None else number("tank.surface", setup.tank.surface)
    index = number("tank.index", setup.tank.index)
    axis = apparent_distance(number("robot.axis_height", setup.robot.axis_height), camera, surface, index)
    ruler = apparent_distance(number("markers.height", setup.markers.height or 0.0), camera, surface, index)
    return number("markers.spacing", setup.markers.spacing or 1.0) * axis / ruler


def depth_shares(setup: Setup) -> dict[str, float]:
    """Relative standard uncertainty of lengths at the height of the axis by what it comes from."""
    markers = setup.markers
    if markers.length_per_pixel is not None:
        share = markers.length_per_pixel_uncertainty / markers.length_per_pixel
        return {"markers.length_per_pixel": share} if share else {}
    uncertain = {
        "camera.height": setup.camera.height_uncertainty,
        "tank.surface": setup.tank.surface_uncertainty if setup.tank.surface is not None else 0.0,
        "tank.index": setup.tank.index_uncertainty if setup.tank.surface is not None else 0.0,
        "markers.spacing": markers.spacing_uncertainty,
        "markers.height": markers.height_uncertainty,
        "robot.axis_height": setup.robot.axis_height_uncertainty,
    }
    scale = spacing_at_axis(setup)
    found = {}
    for name, error in uncertain.items():
        if error > 0:
            change = spacing_at_axis(setup, name, _STEP * error) - spacing_at_axis(setup, name, -_STEP * error)
            found[name] = abs(change / (2.0 * _STEP * scale))
    return found


OPEN = "FILL IN"  #: Placeholder of a number that only the experimenter knows: no file with it is valid.
_YOURS = "CHECK: a usual standard uncertainty, not yours"
_TEMPLATE = Path(__file__).with_name("setup_template.toml")
"""A setup file whose fields have an example and a comment. What is commented out is left out until needed."""
_SECTION = re.compile(r"(?P<off># )?\[(?P<name>[\w.]+)\]")
_FIELD = re.compile(r"(?P<off># )?(?P<name>\w+) = (?P<value>.*?)(?:\s+# (?P<comment>.*))?")
KNOWN = {
    "camera.view": "from above, or level from the side",
    "camera.height": "height of the lens above the reference plane",
    "tank.surface": "height of the surface between air and oil; without one delete all of [tank]",
    "tank.index": "refractive index of the oil",
    "markers.spacing": "from each line of the ruler to the next",
    "markers.height": "height of the ruler above the reference plane",
    "robot.file": "the robot in front of the camera",
    "robot.axis_height": "height of the robot's axis above the reference plane",
}
"""Fields that only the experimenter knows."""


def toml_value(value: str | float | list[str]) -> str:
    """A text, number or list of texts in TOML: quoted as in JSON, whose escapes TOML shares."""
    return json.dumps(value, ensure_ascii=False)


def setup_text(found: Mapping[str, tuple[str, str]] | None = None, open_fields: Collection[str] = ()) -> str:
    """The example, or a setup file with fields found (value in TOML, comment) and others left to be filled in."""
    text = _TEMPLATE.read_text(encoding="utf-8")
    if found is None:
        return text
    lines, section, off = [], "", False
    for line in text.splitlines():
        if head := _SECTION.fullmatch(line):
            section, off = f"{head['name']}.", head["off"] is not None
        field = _FIELD.fullmatch(line)
        if field is None or off:
            lines.append(line)
            continue
        name, value, comment = f"{field['off'] or ''}{field['name']}", field["value"], field["comment"]
        dotted = section + field["name"]
        if dotted in found:
            name, (value, comment) = field["name"], found[dotted]
        elif dotted in open_fields:
            value = f'"{OPEN}"'
        elif dotted.removesuffix("_uncertainty") in open_fields:
            comment = _YOURS
        elif section and not field["off"]:
            name = f"# {name}"
        lines.append(f"{f'{name} = {value}':<38}{f'# {comment}' if comment else ''}".rstrip())
    return "\n".join(lines) + "\n"


def new_setup_file(path: str | Path, *, overwrite: bool = False) -> None:
    """Write a setup file to fill in.

    Args:
        path: of the file (`.toml`).
        overwrite: overwrite a file that is there.
    """
    new_file(
        output_target(path, {".toml": "a setup file"}, "setup.toml", replace="any" if overwrite else "none"),
        setup_text(),
        overwrite=overwrite,
    )


def setup_answer(path: str | Path, film: str | Path | None = None) -> dict[str, Any]:
    """The answer of `spirillum setup check`: fields in SI, what uncertain heights do to lengths, what a video shows."""
    setup, robot = load_setup(path)
    if setup.camera.checkerboard is not None:
        with led_by(str(path)):
            pictures_of(setup.camera.checkerboard, Path(path).parent)
    fields = {
        name: value if unit is None else quantity(value, unit.replace("**", "^"))
        for name, value, unit in field_values(setup)
    }
    shares = depth_shares(setup)
    total = sum(share**2 for share in shares.values()) ** 0.5
    warnings, confirmed = [], False
    if robot.seal is None or not (setup.robot.stripes or robot.seal.stripes):
        words = "the robot has no stripes: its body's rotation cannot be seen; add seal.stripes"
        warnings.append(Note("setup-incomplete", words, ("seal.stripes",)))
    content = {
        "file": str(path),
        "valid": True,
        "robot": robot.name,
        "fields": fields,
        "scale_uncertainty": total,
        "scale_sources": shares,
    }
    if film is not None:
        content["film"], flags = _detect_in(film, setup, robot, Path(path).parent)
        confirmed = scale_confirmed(content["film"]["apparent_body_size"], flags)
        warnings += [flag.note for flag in flags]
    return envelope("setup-check", content, [*setup_remarks(setup, confirmed=confirmed), *warnings])


_DOUBTS = {"size-does-not-fit", "outline-does-not-fit", "scale-does-not-fit", "focal-lengths-differ"}
"""Flags of a video that contradicts the scale of its setup."""


def scale_confirmed(size: float, flags: Iterable[Flag]) -> bool:
    """Whether a video shows the robot as large as its file and the setup say."""
    return math.isfinite(size) and not any(flag.name in _DOUBTS for flag in flags)


def setup_remarks(setup: Setup, *, confirmed: bool = False) -> list[Note]:
    """Notes on the uncertainties of a setup; without those of the example where videos confirm the robot's size."""
    found = []
    if not depth_shares(setup):
        words = (
            "the setup states no uncertainty of heights or scale: intervals of lengths lack it; set *_uncertainty "
            "fields"
        )
        found.append(Note("setup-incomplete", words))
    if not confirmed and (same := _as_in_example(setup)):
        words = f"still as in the example of setup new, with its uncertainty: {', '.join(same)}; fill in your own"
        found.append(Note("setup-incomplete", words, same))
    return found


def _as_in_example(setup: Setup) -> list[str]:
    """Fields that only the experimenter knows and that hold value and uncertainty of the example, by dotted names."""
    # A value without an uncertainty, such as the spacing of a ruler, may well be the one of the example.
    example, fields = Setup.model_validate(tomllib.loads(setup_text())), [name.split(".") for name in KNOWN]

    def held(one: Setup, part: str, key: str) -> tuple[float | None, float]:
        table = getattr(one, part)
        return getattr(table, key), getattr(table, f"{key}_uncertainty", 0.0)

    return [
        f"{part}.{key}"
        for part, key in fields
        if (own := held(example, part, key))[1] > 0.0 and held(setup, part, key) == own
    ]


def _detect_in(film: str | Path, setup: Setup, robot: Robot, folder: Path) -> tuple[dict[str, Any], tuple[Flag, ...]]:
    """Findings of the initial detection with a setup, and its cautions."""
    video = opened(film, setup)
    frames = samples_of(video, setup.start, setup.end)
    learnt = learnt_from(video, frames, setup, robot, folder)
    start, known = learnt.known.start, learnt.known
    tail_size = known.tail_size(learnt.sight.optics)
    scale, size_flags, _ = checked_scale(learnt.sight.scale, start.body, known.size, setup.markers.spacing, tail_size)
    few = [frame.small(learnt.sight.reduction) for frame in frames]
    moved = camera_flags(few, start, ruled=setup.markers.spacing is not None)
    seen = {
        "name": video.name,
        "frames": len(frames),
        "frames_with_robot": len(start.path),
        "length_per_pixel": quantity(scale.length_per_pixel, "m"),
        "relative_uncertainty": scale.relative_uncertainty,
        "markers": scale.markers,
        "apparent_body_size": scale.apparent_size,
        "stripes_fit": known.stripes.fits,
        "tail_readable": known.wire.readable,
    }
    return seen, (*video.flags, *learnt.sight.flags, *size_flags, *learnt.flags, *moved)


Fields = Mapping[str, Any]  #: Texts with their unit, numbers and lists of names by dotted field.


def setup_file(fields: Fields) -> str:
    """The text of a setup file."""
    return setup_text({name: (toml_value(value), "") for name, value in fields.items()})


def setup_problems(fields: Fields) -> list[str]:
    """What is missing in a setup or wrong, each in a sentence that names its field; empty where nothing is."""
    tables: dict[str, Any] = {}
    for path, value in fields.items():
        *above, name = path.split(".")
        table = tables
        for part in above:
            table = table.setdefault(part, {})
        table[name] = value
    for name in ("camera", "markers", "robot"):
        tables.setdefault(name, {})
    found = problems_in(Setup, tables)
    return found if isinstance(found, list) else []


def setup_fields(text: str, source: str) -> dict[str, Any]:
    """The fields that the text of a setup file gives, as it gives them."""
    found: dict[str, Any] = {}

    def walk(table: Mapping[str, Any], above: str) -> None:
        for name, value in table.items():
            if isinstance(value, Mapping):
                walk(value, f"{above}{name}.")
            else:
                found[above + name] = value

    walk(parse_toml(text, source, WHAT), "")
    return found
