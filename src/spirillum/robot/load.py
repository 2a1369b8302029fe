"""From a preset or a TOML file, with overrides, to a checked robot, and what `robot show` and `robot check` say."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from copy import deepcopy
from functools import cache, lru_cache
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any, NamedTuple

from spirillum.envelope import envelope, quantity
from spirillum.errors import InputError, did_you_mean, led_by
from spirillum.files import new_file, parse_toml, read_toml
from spirillum.notes import Note
from spirillum.robot.arguments import check_set_once
from spirillum.robot.fields import field_of, field_values, problems_in, refused_table
from spirillum.robot.model_options import Resolution
from spirillum.robot.robot import Robot
from spirillum.robot.shape_input import DISPLACED, FILES, smoothing_notes, with_points_of_files
from spirillum.units import show

_WHAT = "a preset's name or a robot file (TOML, see `spirillum robot new`)"
# A measured mass no longer describes the robot once one of these changes (Table I weighs body and coupling).
_WEIGHED = (
    *(f"body.{name}" for name in ("shape", "diameter", "length", "front", "rear", "fillet")),
    *(f"coupling.{name}" for name in ("diameter", "length", "clearance")),
)
_DECIDING = (
    *("body.diameter", "body.length", "body.mass", "coupling.diameter", "coupling.length"),
    *("tail.length", "tail.wire_diameter", "channel.diameter", "fluid.viscosity", "motor.torque_constant"),
)
"""Fields that decide the motion, and that a robot file takes from its base unless it sets them."""
# What belongs to a body of that size: a preset's value does not fit a robot that is scaled.
_SIZED = {"magnetic.moment": "the magnet's", "drive.torque": "the motor's", "drive.torques": "the motor's"}
_SIZE = ("body.diameter", "body.length")
_WORDS = {"name", "description", "reference"}
_DEEPEST = 8
_MOST_LAYERS = 8  # layered robot files
_DENSEST = 22590.0  # density of osmium, kg/m^3 (CRC Handbook of Chemistry and Physics)

PAPER_ROBOTS = ("biorob2012-wide", "biorob2012-narrow")
PAPER_ROBOTS_TAKEN = Note.named("paper-robots", robots=" and ".join(PAPER_ROBOTS))
"""Presets of the paper's robot, one for each of its channels."""


def is_preset(robot: Robot) -> bool:
    """Whether a robot is an unchanged preset."""
    return robot.name in preset_names() and load(robot.name) == robot


@lru_cache(maxsize=1)
def preset_names() -> tuple[str, ...]:
    """Names of the presets."""
    return tuple(sorted(_robots_in(files("spirillum.robot") / "presets")))


@lru_cache(maxsize=1)
def shipped_robots() -> Mapping[str, Traversable]:
    """Robot files that come with the package, by name: the presets and the robots of `papers/NAME/robots`."""
    folders = [paper / "robots" for paper in (files("spirillum") / "papers").iterdir() if (paper / "robots").is_dir()]
    found = dict(item for folder in folders for item in _robots_in(folder).items())
    presets = _robots_in(files("spirillum.robot") / "presets")
    return {**dict(sorted(presets.items())), **dict(sorted(found.items()))}


def _robots_in(folder: Traversable) -> dict[str, Traversable]:
    return {item.name.removesuffix(".toml"): item for item in folder.iterdir() if item.name.endswith(".toml")}


def preset_text(name: str) -> str:
    """Unmodified text of a robot file that comes with the package."""
    return shipped_robots()[name].read_text(encoding="utf-8")


def load(robot: str | Path | Mapping[str, Any] | Robot, /, **overrides: Any) -> Robot:
    """Load a robot, apply overrides to its raw tables, and check the whole once.

    Args:
        robot: a preset's name, a TOML file, or the same tables as a mapping. A checked `Robot` is returned as
            it is (then without overrides).
        overrides: dotted fields (``**{"tail.wavelength": "20 mm"}``) or tables
            (``tail={"wavelength": "20 mm"}``); dimensional values carry their unit.

    Returns:
        The robot, SI inside, frozen. What is doubtful is in `robot.warnings`.

    Raises:
        InputError: if the file cannot be read or any field is wrong; `problems` lists every one.
    """
    if isinstance(robot, Robot):
        if overrides:
            raise InputError("overrides of a checked Robot; allowed: a preset's name, a file or a mapping with them")
        return robot
    check_set_once(overrides)
    table, source = raw_table(robot)
    folder = Path() if isinstance(robot, Mapping) else Path(robot).parent
    table, layers = _extended(with_points_of_files(table, folder, source), source, folder)
    for path, value in overrides.items():
        _displace(table, _nested(path, value))
        _set_field(table, path.split("."), value, path)
    table = with_points_of_files(table, Path(), source)
    layers.append(_Layer(source, set().union(*(_paths(_nested(path, value)) for path, value in overrides.items()))))
    changes = [layer.fields for layer in layers[1:]]
    robot = _checked(table, layers, tuple(_stale(table, changes)))
    robot._warnings = (*robot.warnings, *_old_coupling(robot, changes))  # noqa: SLF001 - it is the loader's to set
    return robot


def raw_table(robot: str | Path | Mapping[str, Any]) -> tuple[dict[str, Any], str]:
    """The raw tables of a preset, file or mapping, and what to call it in a sentence."""
    if isinstance(robot, Mapping):
        try:
            return deepcopy(dict(robot)), "the robot"
        except RecursionError as error:
            raise InputError(f"the robot's tables are nested without end; allowed: {_WHAT}") from error
    if isinstance(robot, str) and robot in shipped_robots():
        return deepcopy(_preset_table(robot)), f"preset {robot}"
    try:
        path = Path(robot)
    except TypeError as error:
        raise InputError(f"robot = {str(robot)[:60]!r}; allowed: {_WHAT}") from error
    if not str(robot):
        raise InputError(f"robot = ''; allowed: {_WHAT}")
    if (isinstance(robot, str) and re.fullmatch(r"[\w-]{1,99}", robot) is not None) and not path.exists():
        presets = ", ".join(preset_names())
        hint = did_you_mean(str(robot), shipped_robots())
        raise InputError(f"'{robot}' is neither a preset nor a file{hint}; presets: {presets}")
    return read_toml(path, _WHAT), str(path)


@cache
def _preset_table(preset: str) -> dict[str, Any]:
    """The raw tables of a preset, which its callers may not change."""
    return tomllib.loads(preset_text(preset))


def new_robot_file(path: str | Path, preset: str, *, overwrite: bool = False) -> None:
    """Write a robot file to edit: a preset's own text, whole."""
    if preset not in shipped_robots():
        raise InputError(
            f"preset {preset!r}{did_you_mean(preset, shipped_robots())}; allowed: {', '.join(shipped_robots())}"
        )
    path = Path(path)
    name = re.sub(r"[^\w-]+", "-", path.stem)[:100] or "robot"
    text = preset_text(preset).replace(f'name = "{preset}"', f'name = "{name}"', 1)
    new_file(path, text, overwrite=overwrite)


def parse_setting(text: str, option: str = "--set", example: str = "tail.wavelength=20mm") -> tuple[str, Any]:
    """Split ``PATH=VALUE``; VALUE is read as TOML, else taken as text (a quantity or a word)."""
    path, equals, value = text.partition("=")
    path, value = path.strip(), value.strip()
    if not equals or not path or not value:
        raise InputError(f"{option} {text[:80]!r} is not PATH=VALUE; for example {option} {example}")
    try:
        parsed = parse_toml(f"value = {value}", option, "PATH=VALUE")
    except InputError:
        if "\\" in value and value.startswith('"'):
            raise
        return path, value
    if parsed == {"value": {}}:
        raise InputError(f"{option} {text[:80]!r} sets no field; for example {option} {example}")
    return path, parsed["value"] if set(parsed) == {"value"} else value


def with_resolution(robot: Robot, resolution: Resolution | Mapping[str, Any] | None, *models: str) -> Robot:
    """The robot with another resolution of the models `slender` and `tube`."""
    options = robot.model
    given = Resolution.of(resolution).model_dump(exclude_none=True)
    resolved = next((name for name in given if name != "form"), "")
    in_tube = not models or "tube" in models
    # A table has its own: with an accuracy, a tolerance or a number of phases, whatever their values, `tube` solves for
    # the flow.
    if resolved and in_tube and given.get("form", options.tube.form) == "table":
        said = f"{resolved} = {given[resolved]!r} with form = 'table', which has its own"
        raise InputError(f"{said}; allowed: form 'direct' or 'auto'")
    for name, value in given.items():
        section, readers = ("slender", ("slender", "tube")) if name == "accuracy" else ("tube", ("tube",))
        if models and not set(models) & set(readers):
            asked = f"model{'s' if len(models) > 1 else ''} {' and '.join(repr(model) for model in models)}"
            allowed = " or ".join(f"'{reader}'" for reader in readers)
            raise InputError(f"{name} = {value!r} with {asked}; allowed: only with model {allowed}")
        changed = getattr(options, section).model_copy(update={name: value})
        options = options.model_copy(update={section: changed})
    if resolved and in_tube and not options.resolution:  # that of tables, asked for
        options = options.model_copy(update={"tube": options.tube.model_copy(update={"form": "direct"})})
    return robot.model_copy(update={"model": options})


class _Layer(NamedTuple):
    """A robot file of a chain, or its overrides."""

    source: str  #: Its name after those of the files that lead to it.
    fields: set[str]  #: The fields and tables that it sets, by their dotted names.


def _extended(
    table: dict[str, Any], source: str, folder: Path, above: tuple[Path, ...] = ()
) -> tuple[dict[str, Any], list[_Layer]]:
    """Merge the table over what its `extends` names; return the tables, and the layers from the lowest on."""
    base = table.pop("extends", None)
    own_layer = _Layer(source, _paths(table))
    if base is None:
        return table, [own_layer]
    own = isinstance(base, str) and base.endswith(".toml")
    if not own and (not isinstance(base, str) or base not in shipped_robots()):
        hint = did_you_mean(str(base), shipped_robots())
        allowed = f"{', '.join(preset_names())}, or a robot file (.toml) beside this one"
        raise InputError(f"{source}: extends = {str(base)[:60]!r}{hint}; allowed: {allowed}")
    if not own:
        below, layers = _extended(tomllib.loads(preset_text(base)), f"preset {base}", folder, above)
        return _merge_tables(below, base, table), [*_led(layers, source), own_layer]
    path = folder / base
    if len(above) >= _MOST_LAYERS or _resolved(path, source) in above:
        raise InputError(
            f"{source}: extends = {base[:60]!r} leads back to itself or through more than {_MOST_LAYERS} files; "
            f"allowed: a chain of files that ends at a whole robot or a preset ({', '.join(preset_names())})"
        )
    with led_by(f"{source}: extends"):
        under = with_points_of_files(read_toml(path, _WHAT), path.parent, str(path))
        below, layers = _extended(under, str(path), path.parent, (*above, _resolved(path, source)))
    return _merge_tables(below, base, table), [*_led(layers, source), own_layer]


def _led(layers: Sequence[_Layer], source: str) -> Iterator[_Layer]:
    return (layer._replace(source=f"{source}: extends: {layer.source}") for layer in layers)


def _merge_tables(below: dict[str, Any], base: str, table: dict[str, Any]) -> dict[str, Any]:
    """A robot's tables over those of its base, with a description that holds for a robot with other values."""
    changed = _touched(table) | {name for name, value in table.items() if not isinstance(value, Mapping)} - _WORDS
    if changed:
        below = {**below, "description": f"{base} with other {', '.join(sorted(changed))}"[:2000]}
    _displace(below, table)
    return _merged(below, table)


def _displace(table: dict[str, Any], above: Mapping[str, Any]) -> None:
    """Take out what fields of the layer above replace; points that are `none` replace nothing."""
    for field in _touched(above):
        section, _, name = field.partition(".")
        inner = table.get(section)
        if isinstance(inner, dict) and not ((section, name) in FILES and above[section][name] in (None, "none")):
            for other in DISPLACED.get(field, ()):
                inner.pop(other, None)


def _resolved(path: Path, source: str) -> Path:
    try:
        return path.resolve()
    except (OSError, ValueError) as error:  # such as for a name with a null character
        raise InputError(
            f"{source}: extends = {str(path)[:60]!r} is no name of a file; allowed: one beside it"
        ) from error


def _merged(below: dict[str, Any], above: Mapping[str, Any], depth: int = 0) -> dict[str, Any]:
    if depth > _DEEPEST:
        raise InputError(
            f"tables are nested more deeply than {_DEEPEST}; allowed: those of a robot file (`spirillum schema robot`)"
        )
    for key, value in above.items():
        if isinstance(value, Mapping) and isinstance(below.get(key), dict):
            below[key] = _merged(below[key], value, depth + 1)
        else:
            below[key] = dict(value) if isinstance(value, Mapping) else value
    return below


def _nested(path: str, value: Any) -> dict[str, Any]:
    *parents, last = path.split(".")
    table: dict[str, Any] = {last: value}
    for name in reversed(parents):
        table = {name: table}
    return table


_NONE_IS_A_VALUE = ("tail.taper",)  # fields whose None, a plain helix, is another thing than their default


def _set_field(table: dict[str, Any], names: list[str], value: Any, path: str) -> None:
    """Set one dotted field; a table merges into a table, None takes the field out, but where None is a value."""
    if len(names) > _DEEPEST or not all(names):
        raise InputError(f"{path[:80]!r} is no field; allowed: a dotted field such as tail.wavelength")
    for name in names[:-1]:
        below = table.setdefault(name, {})
        if not isinstance(below, dict):
            # `channel = "none"` gives way to `channel.diameter`; other text is left for the check to name.
            below = table[name] = {}
        table = below
    if value is None and path not in _NONE_IS_A_VALUE:
        table.pop(names[-1], None)
    elif isinstance(value, Mapping) and isinstance(table.get(names[-1]), dict):
        table[names[-1]] = _merged(table[names[-1]], value)
    else:
        table[names[-1]] = value


def _touched(table: Mapping[str, Any]) -> set[str]:
    return {
        f"{section}.{name}" for section, entries in table.items() if isinstance(entries, Mapping) for name in entries
    }


def _paths(table: Mapping[str, Any], under: str = "") -> set[str]:
    """Dotted names of all tables and fields."""
    found = {f"{under}{name}" for name in table}
    if under.count(".") < _DEEPEST:
        inner = ((name, value) for name, value in table.items() if isinstance(value, Mapping))
        found.update(*(_paths(value, f"{under}{name}.") for name, value in inner))
    return found


def _source_of(problem: str, layers: Sequence[_Layer]) -> str:
    """The topmost layer that sets a field of a problem; of an unknown one the field itself, not its remedy."""
    others = [] if "is not a known field" in problem else re.findall(r"\w+(?:\.\w+)+", problem)
    named = {field_of(problem), *others}
    return next((layer.source for layer in reversed(layers) if named & layer.fields), layers[-1].source)


def _older(changes: Sequence[set[str]], field: str, than: Sequence[str]) -> list[str]:
    """The fields among `than` that layers have changed since one set a field."""
    newer: list[str] = []
    for changed in changes:
        newer = [] if field in changed else newer + [name for name in than if name in changed]
    return newer


def _stale(table: Mapping[str, Any], changes: Sequence[set[str]]) -> Iterator[Note]:
    """Warn of a mass that is older than the geometry it weighs, and of what belongs to a body of another size."""
    body = table.get("body")
    newer = _older(changes, "body.mass", _WEIGHED)
    if newer and isinstance(body, dict) and "mass" in body:
        yield Note.named("mass-before-changes", mass=body["mass"], changed=", ".join(newer), newer=" ".join(newer))
    for field, whose in _SIZED.items():
        section, name = field.split(".")
        newer, held = _older(changes, field, _SIZE), table.get(section)
        if newer and isinstance(held, dict) and held.get(name) is not None:
            names = {"changed": ", ".join(newer), "newer": " ".join(newer)}
            yield Note.named("of-another-size", field=field, value=held[name], whose=whose, **names)


def _old_coupling(robot: Robot, changes: Sequence[set[str]]) -> tuple[Note, ...]:
    """Warn of a coupling of an earlier body that is wider than the robot's own, or longer."""
    for name, beyond in (("diameter", "wider"), ("length", "longer")):
        own, body = getattr(robot.coupling, name), getattr(robot.body, name)
        last = next((layer for layer in reversed(changes) if {f"coupling.{name}", f"body.{name}"} & layer), set())
        if robot.has_body and own > body and f"body.{name}" in last and f"coupling.{name}" not in last:
            sizes = {"own": show(own, "mm"), "body": show(body, "mm")}
            return (Note.named("coupling-of-another-body", name=name, beyond=beyond, **sizes),)
    return ()


def _doubts(robot: Robot) -> Iterator[Note]:
    """Warn of a robot that floats, of numbers that hardly fit, and of those that axial motion leaves out."""
    derived = robot.derived()  # once: it integrates the solids
    weight = derived.get("submerged_weight")
    if weight is not None and weight.value <= 0:
        yield Note.named("robot-floats", weight=weight.value)
    if robot.body.center_of_mass is not None:
        yield Note.named("center-of-mass-unused")
    if (mass := robot.body.mass) is not None:
        density = mass / (derived["body_volume"].value + derived["coupling_volume"].value)
        if density > _DENSEST:
            yield Note.named("dense-body", mass=show(mass, "kg"), density=density, densest=_DENSEST)
    own, whole = None if robot.motor is None else robot.motor.joint_rotor_friction, robot.friction.effective
    if own is not None and whole is not None and whole < own:
        yield Note.named("friction-below-rotor", whole=show(whole, "N m s/rad"), own=show(own, "N m s/rad"))
    if (doubt := robot.seal_doubt) is not None:
        yield doubt
    yield from smoothing_notes(robot.tail.form)


def _checked(table: dict[str, Any], layers: Sequence[_Layer], warnings: tuple[Note, ...]) -> Robot:
    robot = problems_in(Robot, table)
    if not isinstance(robot, Robot):
        raise refused_table(robot, lambda problem: _source_of(problem, layers))
    robot._warnings = (*warnings, *_doubts(robot))  # noqa: SLF001 - it is the loader's to set
    return robot


def robot_answer(robot: Robot) -> dict[str, Any]:
    """Fields of a robot and what follows from them, as `spirillum robot show` prints them."""
    derived = {name: quantity(item.value, item.unit, meaning=item.meaning) for name, item in robot.derived().items()}
    fields = {
        path: value if unit is None else quantity(value, unit.replace("**", "^"))
        for path, value, unit in field_values(robot)
    }
    content = {"robot": robot.name, "fields": fields, "derived": derived}
    return envelope("robot", content, robot.warnings)


def inherited(robot: str, overrides: Mapping[str, Any], loaded: Robot) -> dict[str, Any]:
    """Return the base of a robot file and the deciding fields that its robot takes from it; empty without a base."""
    table, _ = raw_table(robot)
    if robot in shipped_robots() or (base := table.get("extends")) is None:
        return {}
    own = _touched(table).union(*(_touched(_nested(path, value)) for path, value in overrides.items()))
    found = field_values(loaded)
    there = {item.path: quantity(item.value, item.unit) for item in found if item.unit and item.value is not None}
    taken = {path: there[path] for path in _DECIDING if path in there and path not in own}
    return {"inherited": {"from": str(base), "fields": taken}} if taken else {}


def checked(robot: str, overrides: Mapping[str, Any]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Problems and warnings of a robot file."""
    raw_table(robot)
    try:
        return (), load(robot, **overrides).warnings
    except InputError as error:
        return error.problems, ()
