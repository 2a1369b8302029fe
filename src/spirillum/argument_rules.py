"""Which options exclude or require each other: one table for all commands."""

from __future__ import annotations

from collections.abc import Callable, Collection
from typing import NamedTuple

from spirillum.errors import InputError


class Rule(NamedTuple):
    """Options that a request in some state has no use for."""

    state: str
    """States of the request, such as `run`: its command defines which of them hold."""
    options: tuple[str, ...]
    """Names of the command's parameters."""
    conflict: str
    """Rest of the sentence after the options: the conflict, and what is allowed; the request fills words in braces."""


_FIELDS = ("gap", "eccentricity", "pitch", "yaw", "tail_drop", "ends")
RULES: dict[str, tuple[Rule, ...]] = {
    "calibrate": (
        Rule(
            "no posterior",
            ("seed", "doublings"),
            "with method '{method}', which samples no posterior; allowed: with method posterior",
        ),
    ),
    "export": (
        Rule(
            "recording",
            (
                *("phase", "fineness", "unit", "sidecar", "no_sidecar", "model", "friction", "calibration"),
                *("gap", "pitch", "flow", "settings"),
            ),
            "with .mcap; allowed: --film and --speed, for the run has its robot",
        ),
        Rule("no recording", ("film", "speed"), "with {ending}; allowed: only with .mcap"),
    ),
    "flow": (
        Rule(
            "no plane",
            ("plane", "offset", "resolution"),
            "without a plane (-o FILE), to which it belongs; allowed: both or neither",
        ),
        Rule(
            "no volume",
            ("volume_resolution",),
            "without --volume FILE, to which it belongs; allowed: both or neither",
        ),
        Rule(
            "run",
            ("robot", "tail_rate", "friction", "settings", "phase", *_FIELDS, "flow"),
            "together with a run, which says it; allowed: --run and --time alone",
        ),
        Rule(
            "run with another model", ("model",), "together with a run, which says it; allowed: --run and --time alone"
        ),
    ),
    "measure": (
        Rule(
            "feasibility",
            ("output", "marks", "no_tracking", "track", "no_annotated", "no_figures", "start", "end"),
            "with --feasibility, which measures nothing; allowed: without it",
        ),
        Rule(
            "no feasibility",
            ("expect_tail_rate", "expect_body_rate", "expect_speed", "duration", "fps", "view_width", "width"),
            "without --feasibility; allowed: with it",
        ),
    ),
    "study": (
        Rule("store", ("rows",), "{rows} with --store, which prints no ranking; allowed: a folder of results (-o DIR)"),
    ),
}
"""Rules by command, in the order in which they are checked."""


def check_rules(command: str, states: Collection[str], given: Callable[..., list[str]], **words: object) -> None:
    """Refuse options that conflict with the request.

    Args:
        command: its name.
        states: of the request.
        given: tells which of some parameters were typed, as options.
        words: of the request, for the sentence.
    """
    for rule in RULES[command]:
        if rule.state in states and (found := given(*rule.options)):
            raise InputError(f"{', '.join(found)} {rule.conflict.format(**words)}")
