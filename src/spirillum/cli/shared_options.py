"""Options that several commands share, and what the shell completes."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextvars import ContextVar
from copy import copy
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any, get_args

import typer

from spirillum.cli.interrupts import InterruptibleCommand
from spirillum.data_tables import rows_of

MODEL_PANEL = "Model"  #: Panel of the help: which model answers, with which friction and calibration, how finely.
PLACE_PANEL = "Pose in the channel (model tube)"  #: Panel of the help: pose of the robot in its channel.
START_PANEL = "Start of a free run, and its tube"
TIMING_PANEL = "Timing and remote"
DISTURBANCES_PANEL = "Disturbances"


def starting(words: Iterable[str], incomplete: str) -> list[str]:
    """Words that begin with what is typed."""
    return [word for word in words if word.startswith(incomplete)]


def choices(*words: str) -> Callable[[str], list[str]]:
    """Completion of one of some words."""
    return lambda incomplete: starting(words, incomplete)


def complete_presets(incomplete: str) -> list[str]:
    """Names of the robots that come with the package."""
    package = Path(__file__).parent.parent
    presets = sorted(path.stem for path in package.glob("robot/presets/*.toml"))
    return starting([*presets, *sorted(path.stem for path in package.glob("papers/*/robots/*.toml"))], incomplete)


def complete_robots(incomplete: str) -> list[str]:
    """Presets and robot files."""
    folder = Path(incomplete).parent
    files = sorted(str(path) for path in folder.glob("*.toml")) if folder.is_dir() else []
    return complete_presets(incomplete) + [name for name in files if name.startswith(incomplete)]


def choices_in(target: str, *first: str) -> Callable[[str], list[str]]:
    """Completion of one of some words, or of those that a constant (`module:name`) has, which may be a literal type."""

    def complete(incomplete: str) -> list[str]:
        module, _, name = target.partition(":")
        words = getattr(import_module(module), name)
        return starting((*first, *sorted(get_args(words) or words)), incomplete)

    return complete


complete_models = choices_in("spirillum.fluid.registry:SWIMMER_MODELS")
complete_auto_models = choices_in("spirillum.fluid.registry:SWIMMER_MODELS", "auto")
complete_resistance_models = choices_in("spirillum.fluid.registry:MODELS")
complete_parts = choices("body", "both", "coupling", "robot", "rotor", "tail")
COMPLETERS = {"ROBOTS": complete_robots, "PRESETS": complete_presets, "MODELS": complete_auto_models}
"""Completions that own options name in their table; others list their words."""
COMPLETIONS: dict[str, Callable[[str], list[str]]] = {
    "answer": choices("held", "trial"),
    "accuracy": choices("high", "standard"),
    "ends": choices("closed", "open"),
    "friction": choices("body", "none", "paper", "rotor"),
    "model": complete_auto_models,
    "models": complete_models,
    "motion": choices("free", "held"),
    "part": complete_parts,
    "view": choices("side", "top"),
    "direction": choices("left", "right"),
}
"""Completions of the shell, by argument or field of a table."""


_ROWS = rows_of("cli/options.csv")


def _column(name: str) -> dict[str, str]:
    """A column of `options.csv` by argument or field, which the docstrings of the functions do not have."""
    return {path: row[name] for row in _ROWS for path in row["paths"].split() if row[name]}


NAMES = _column("option")  #: Options that are not named after the argument or field.
METAVARS = _column("placeholder")  #: Placeholder of a value in the help, where its kind does not give one.
EXAMPLES = _column("example")  #: Of quantities, by kind or argument.
TEXTS = _column("help")  #: Helps of arguments that docstrings explain elsewhere.
OWN = {(row["command"], row["parameter"]): row for row in rows_of("cli/own_options.csv")}
"""Options and arguments that a command has beside those of its function."""
PANELS = {
    **dict.fromkeys(("model", "friction", "calibrated", "calibration", "posterior", "posterior_for"), MODEL_PANEL),
    "resolution.": MODEL_PANEL,
    "placement.": PLACE_PANEL,
    **dict.fromkeys(("weight", "roughness", "in_tube.", "field."), START_PANEL),
    "timing.": TIMING_PANEL,
    "camera.": "Camera",
    **dict.fromkeys(("marks", "tracking", "track"), "Instead of the tracker"),
    "feasibility.": "Before an experiment",
    **dict.fromkeys(("task.", "controller"), "Task"),
    **dict.fromkeys(("lab", "live"), "Laboratory"),
    "seeds": "Seeds and scores",
    "degradation.": DISTURBANCES_PANEL,
    **dict.fromkeys(("motion.", "trial."), "Motion"),
    "setup_errors.": "Errors of the setup file",
}
"""Panels of the help by argument, or by table (with a point)."""
LISTED = "NAME,..."  #: Placeholder of names separated by commas.
NO_FORM = {"resolution.form": "an option of the robot, model.tube.form"}
"""Fields of tables that are no options of commands, with the reason; so below."""
NO_START = dict.fromkeys(("in_tube.wait", "in_tube.flow", "in_tube.continued"), "of a run over time: simulate")


def optional_robot(text: str) -> Any:
    """Annotation of the argument that names a robot, where there may be none."""
    return Annotated[str | None, typer.Argument(autocompletion=complete_robots, help=text)]


RobotArgument = Annotated[str, typer.Argument(autocompletion=complete_robots, help="A preset's name or a TOML file.")]
Settings = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="PATH=VALUE", help="Set a field of the robot, such as body.mass=8g; repeatable."),
]
All = Annotated[bool, typer.Option("--all", help="Print all quantities.")]
Json = Annotated[bool, typer.Option("--json", help="Print JSON.")]


class NotedCommand(InterruptibleCommand):
    """A command with the option `--notes` where it has `--json`, and so prints an answer."""

    def __init__(self, *given: Any, **named: Any) -> None:
        super().__init__(*given, **named)
        json = next((parameter for parameter in self.params if "--json" in parameter.opts), None)
        if json is not None:
            notes: Any = copy(json)
            notes.name, notes.opts, notes.secondary_opts, notes.expose_value = "notes", ["--notes"], [], False
            notes.help = "Print all notes with their codes, and the methods used."
            notes.callback = lambda _context, _parameter, value: every_note.set(bool(value))
            self.params.insert(self.params.index(json) + 1, notes)


every_note: ContextVar[bool] = ContextVar("every_note", default=False)  #: Whether the running command has `--notes`.
