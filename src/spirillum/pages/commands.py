"""Commands of the page, read: what they ask for, and what is answered where they cannot be followed."""

from __future__ import annotations

import json
import re
import traceback
from collections.abc import Mapping
from typing import Any

from spirillum.errors import InputError, clipped
from spirillum.robot.load import load
from spirillum.robot.toml_writer import robot_text

_SOURCE = re.compile(r"^(preset [\w-]+|the robot): ")
"""What a sentence about a field says of where the robot comes from: here it stands at the knob."""


def robot_tables(source: Any) -> dict[str, Any]:
    """A robot as its tables, which fields can be laid over, and which no longer depend on a file."""
    import tomllib

    return tomllib.loads(robot_text(load(source)))


def text_of(command: Mapping[str, Any], name: str, unset: str | None = None) -> str:
    """A text of a command or a message.

    Args:
        command: what a browser has sent.
        name: of the text.
        unset: what stands for a text that is missing; None: it may not be.
    """
    value = command.get(name, unset)
    if not isinstance(value, str) or any("\ud800" <= letter <= "\udfff" for letter in value):
        raise InputError(f"{name} = {clipped(value, 40)}; allowed: text")
    return value


def number_of(command: Mapping[str, Any], low: float, high: float) -> float:
    """The number that a command asks for, within limits."""
    value = command.get("value")
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not low <= value <= high:
        raise InputError(f"{command.get('do')} = {str(value)[:40]}; allowed: {low:g} to {high:g}")
    return float(value)


def report_fault(error: BaseException) -> None:
    """Print the traceback of an internal error in a thread or process that goes on; the client gets a sentence."""
    if not isinstance(error, (InputError, MemoryError)):
        traceback.print_exception(error)


def refusal_of(command: Mapping[str, Any], sentence: str) -> str:
    """What a client is sent whose command cannot be followed, JSON."""
    name = str(command.get("field") or command.get("do") or "")[:60]
    sentence = _SOURCE.sub("", sentence)
    return json.dumps({"t": "refused", "field": name, "lane": command.get("lane", 0), "sentence": sentence})
