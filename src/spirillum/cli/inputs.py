"""Options as typed: conversion into arguments, and the table of those that exclude or require each other."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

from spirillum.data_tables import rows_of
from spirillum.errors import InputError
from spirillum.units import KINDS, parse_option

if TYPE_CHECKING:
    import typer

    from spirillum.robot.robot import Robot


class Rule(NamedTuple):
    """Options that a request in some state has no use for."""

    state: str  #: States of the request, such as `run`: its command defines which of them hold.
    options: tuple[str, ...]  #: Names of the command's parameters.
    conflict: str
    """Rest of the sentence after the options: the conflict, and what is allowed; the request fills words in braces."""


RULES: dict[str, list[Rule]] = {}  #: The rows of `rules.csv` by command, in the order in which they are checked.
for _row in rows_of("cli/rules.csv"):
    _rule = Rule(_row["state"], tuple(_row["options"].split()), _row["conflict"])
    RULES.setdefault(_row["command"], []).append(_rule)


def refuse_conflicts(context: typer.Context, *states: str, **words: object) -> None:
    """Refuse typed options that conflict with the request, by the rules of the command."""
    # Also those that were typed with the value that they have otherwise.
    options = {parameter.name: max(parameter.opts, key=len) for parameter in context.command.params}
    sources = {name: context.get_parameter_source(str(name)) for name in options}
    typed = {name for name, source in sources.items() if source is not None and source.name != "DEFAULT"}
    for rule in RULES[str(context.info_name)]:
        found = [options[name] for name in rule.options if name in typed]
        if rule.state in states and found:
            raise InputError(f"{', '.join(found)} {rule.conflict.format(**words)}")


_V = TypeVar("_V")


def overrides_from(settings: list[str] | None) -> dict[str, Any]:
    """Fields of the robot by `--set`."""
    from spirillum.robot.load import parse_setting

    return each_once(map(parse_setting, settings or []), "--set")


def each_once(pairs: Iterable[tuple[str, _V]], option: str) -> dict[str, _V]:
    """Values by field."""
    found: dict[str, _V] = {}
    for field, value in pairs:
        if field in found:
            raise InputError(f"{option} names {field[:60]} twice; allowed: each field once")
        found[field] = value
    return found


def loaded_robot(
    robot: str, settings: list[str] | None, calibration: Path | None = None, posterior: Path | None = None
) -> Robot:
    """The robot with its fields set, none of which may be one that calibration or posterior replace."""
    from spirillum.robot.load import load

    overrides = overrides_from(settings)
    found = load(robot, **overrides)
    if overrides and not (calibration is None and posterior is None):
        from spirillum.fitted.fit import check_not_replaced
        from spirillum.robot.arguments import set_fields

        check_not_replaced(set_fields(overrides), found, calibration, posterior)
    return found


def pairs_of(items: list[str], option: str) -> dict[str, str]:
    """FIELD=VALUE texts by field."""

    def pair(text: str) -> tuple[str, str]:
        name, equals, value = (part.strip() for part in text.partition("="))
        if not (name and equals and value):
            raise InputError(f"{option} {text[:60]!r} is not FIELD=LOW:HIGH, for example tail.wavelength=5mm:40mm")
        return name, value

    return each_once(map(pair, items), option)


def check_apart(*files: Path | None) -> None:
    """Refuse two results in one file, the second of which would replace the first."""
    given = [path for path in files if path is not None]
    for number, path in enumerate(given):
        if any(path.resolve() == other.resolve() for other in given[:number]):
            raise InputError(f"{path} is named for two results; allowed: a file for each")


def time_window(text: str) -> tuple[float, float]:
    """FROM:TO, such as ``0s:2s``, in s."""
    start, colon, stop = text.partition(":")
    if not colon or ":" in stop:
        raise InputError(f"on = {text[:40]!r} is not FROM:TO, for example 0s:2s")
    return parse_option("on", start, KINDS["time"]), parse_option("on", stop, KINDS["time"])
