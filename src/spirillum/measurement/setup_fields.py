"""A setup as a flat list of dotted fields, as a form fills it in, and as the text of its file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from spirillum.files import parse_toml
from spirillum.measurement.setup_template import setup_text, toml_value
from spirillum.robot.problems import problems_in
from spirillum.vision.setup import WHAT, Setup

Fields = Mapping[str, Any]
"""Texts with their unit, numbers and lists of names by dotted field."""


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
