"""Directives that write tables from the code itself, so that no page can be older than the program."""

from __future__ import annotations

import re
import typing
from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, ClassVar, Literal

from docutils import nodes
from docutils.parsers.rst import directives
from docutils.statemachine import StringList
from pydantic import BaseModel
from pydantic.fields import FieldInfo
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError
from sphinx.util.docutils import SphinxDirective

from spirillum.robot.fields import Section
from spirillum.robot.meanings import meanings
from spirillum.units import Kind, for_people, show

Rows = Iterable[Sequence[str]]


def inline(text: str) -> list[nodes.Node]:
    """Text with `code` spans."""
    pieces = text.split("`")
    return [
        nodes.literal(piece, piece) if place % 2 else nodes.Text(piece) for place, piece in enumerate(pieces) if piece
    ]


def table(header: Sequence[str], rows: Rows, widths: Sequence[int]) -> nodes.table:
    """A table; cells may hold `code` spans."""
    found = nodes.table(classes=["from-the-code"])
    group = nodes.tgroup(cols=len(header))
    group += [nodes.colspec(colwidth=width) for width in widths]
    head, body = nodes.thead(), nodes.tbody()
    head += _row(header)
    body += [_row(cells) for cells in rows]
    group += [head, body]
    found += group
    return found


def _row(cells: Sequence[str]) -> nodes.row:
    row = nodes.row()
    for cell in cells:
        paragraph = nodes.paragraph()
        paragraph += inline(cell)
        entry = nodes.entry()
        entry += paragraph
        row += entry
    return row


# The robot file and the study file -----------------------------------------------------------------


def _parts_of(annotation: Any) -> Iterator[Any]:
    """An annotation and everything inside it."""
    yield annotation
    for part in typing.get_args(annotation):
        yield from _parts_of(part)


def _metadata(info: FieldInfo) -> Iterator[Any]:
    yield from info.metadata
    for part in _parts_of(info.annotation):
        yield from getattr(part, "__metadata__", ())


def _kind(info: FieldInfo) -> Kind | None:
    return next((item for item in _metadata(info) if isinstance(item, Kind)), None)


def _section(info: FieldInfo) -> type[Section] | None:
    for part in _parts_of(info.annotation):
        if isinstance(part, type) and issubclass(part, BaseModel):
            return typing.cast("type[Section]", part)
    return None


def _bounds(info: FieldInfo) -> tuple[Any, Any]:
    low = next((item.ge for item in _metadata(info) if hasattr(item, "ge")), None)
    high = next((item.le for item in _metadata(info) if hasattr(item, "le")), None)
    return low, high


def _allowed(info: FieldInfo, kind: Kind | None) -> str:
    if kind is not None:
        return f"{kind.allowed}, as in `{kind.example}`".replace("**", "^")
    for item in _metadata(info):
        schema = getattr(item, "json_schema", None) or {}
        if "anyOf" in schema:
            return ", or ".join(_choice(choice) for choice in schema["anyOf"])
    words = [arg for part in _parts_of(info.annotation) if typing.get_origin(part) is Literal for arg in part.__args__]
    if words:
        return ", ".join(f"`{word}`" for word in words)
    return _allowed_number_or_text(info)


def _choice(schema: dict[str, Any]) -> str:
    """One of several forms of a field, from its JSON schema."""
    if "minimum" in schema:
        return f"{schema['minimum']:g} to {schema['maximum']:g}"
    words = schema.get("enum", [schema["const"]] if "const" in schema else ["true", "false"])
    return ", ".join(f"`{word}`" for word in words)


def _allowed_number_or_text(info: FieldInfo) -> str:
    low, high = _bounds(info)
    if low is not None:
        return f"{low:g} to {high:g}"
    parts = list(_parts_of(info.annotation))
    if bool in parts:
        return "`true`, `false`"
    if dict in (typing.get_origin(part) for part in parts):
        return "a table"
    if tuple in (typing.get_origin(part) for part in parts) and float in parts:
        return "two numbers"
    return "a list of texts" if {list, tuple} & {typing.get_origin(part) for part in parts} else "text"


def _default(info: FieldInfo, kind: Kind | None) -> str:
    if info.is_required():
        return "required"
    value = info.get_default(call_default_factory=True)
    if value is None:
        return "unset"
    ends = value if isinstance(value, tuple) else (value,)
    if kind is not None and ends and all(isinstance(end, float) for end in ends):
        unit = for_people(kind.unit)
        return " to ".join(show(end, unit) if unit != kind.unit else f"{end:g} {kind.unit}" for end in ends)
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    if isinstance(value, (tuple, list)):
        return ", ".join(f"`{item}`" for item in value) or "empty"
    return f"{value:g}" if isinstance(value, float) else f"`{value}`" if value != "" else "empty"


def field_rows(model: type[BaseModel], prefix: str) -> Iterator[tuple[str, str, str, str, str]]:
    """Field, unit, default, allowed and meaning of every field of a table, its own tables included."""
    words = meanings(model)
    for name, info in model.model_fields.items():
        path = f"{prefix}{name}"
        below = _section(info)
        if below is not None:
            yield from field_rows(below, f"{path}.")
            continue
        kind = _kind(info)
        unit = kind.unit.replace("**", "^") if kind else "–"
        yield f"`{path}`", unit, _default(info, kind), _allowed(info, kind), words.get(name, "")


_HEADER = ("Field", "SI unit", "Default", "Allowed", "Meaning")
_WIDTHS = (24, 10, 12, 24, 40)


class RobotFields(SphinxDirective):
    """`robot-fields TABLE`: the fields of one table of the robot file; `root` for the fields outside tables."""

    required_arguments = 1
    option_spec: ClassVar[dict[str, Any]] = {}

    def run(self) -> list[nodes.Node]:
        from spirillum.robot.robot import Robot

        wanted = self.arguments[0]
        documented: set[str] = getattr(self.env.app, "spirillum_tables", set())
        if wanted == "root":
            plain = {name: info for name, info in Robot.model_fields.items() if _section(info) is None}
            documented |= set(plain)
            words = meanings(Robot)
            rows = [
                (f"`{name}`", "–", _default(info, None), "text", words.get(name, "")) for name, info in plain.items()
            ]
            extends = "Preset that the file starts from; its own fields are laid over it."
            rows.append(("`extends`", "–", "unset", "a preset's name", extends))
        else:
            documented.add(wanted)
            info = Robot.model_fields[wanted]
            model = _section(info)
            if model is None:
                raise ExtensionError(f"{wanted} is no table of the robot file")
            prefix = "calibration.<model>." if wanted == "calibration" else f"{wanted}."
            rows = list(field_rows(model, prefix))
        self.env.app.spirillum_tables = documented  # type: ignore[attr-defined]
        return [table(_HEADER, rows, _WIDTHS)]


class StudyFields(SphinxDirective):
    """`study-fields`: the fields of a study file."""

    def run(self) -> list[nodes.Node]:
        from spirillum.studies.spec import Study

        return [table(_HEADER, field_rows(Study, ""), _WIDTHS)]


class Derived(SphinxDirective):
    """`derived-quantities`: what `spirillum robot show` adds to the fields."""

    def run(self) -> list[nodes.Node]:
        from spirillum import load

        derived = load("biorob2012-wide").derived()
        rows = [(f"`{name}`", item.unit, item.meaning) for name, item in derived.items()]
        return [table(("Quantity", "Unit", "Meaning"), rows, (25, 10, 65))]


# Output variables ----------------------------------------------------------------------------------


class Quantities(SphinxDirective):
    """`quantities`: the quantities of a prediction."""

    def run(self) -> list[nodes.Node]:
        from spirillum.swimming.answer import STEADY

        rows = [(f"`{item.name}`", item.unit, item.meaning, item.source) for item in STEADY]
        return [table(("Quantity", "Unit", "Meaning", "Source"), rows, (26, 12, 40, 22))]


@lru_cache(maxsize=1)
def _studied() -> Any:
    from spirillum import study

    return study()


@lru_cache(maxsize=1)
def _observed() -> Any:
    """A study with observations, for the names of its variables; its single row is made up and shown nowhere."""
    from spirillum import study

    with TemporaryDirectory() as folder:
        path = Path(folder) / "observations.csv"
        path.write_text("channel_diameter_mm,wavelength_mm,amplitude_mm,tail_rate_Hz\n40,25,2.5,1\n", encoding="utf-8")
        return study(observations=path)


def _variable_rows(dataset: Any, names: Iterable[str]) -> Rows:
    for name in names:
        variable = dataset[name]
        about = variable.attrs
        over = ", ".join(f"`{dimension}`" for dimension in variable.dims) or "single value"
        yield f"`{name}`", str(about.get("units", "–")), over, str(about["long_name"]), str(about.get("source", "–"))


_VARIABLE = ("Variable", "Unit", "Over", "Meaning", "Source")
_VARIABLE_WIDTHS = (26, 8, 22, 32, 20)


class StudyVariables(SphinxDirective):
    """`study-variables coordinates|results|observed`: the variables of `dataset.nc`."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        plain, observed = _studied(), _observed()
        which = self.arguments[0]
        if which == "coordinates":
            return [table(_VARIABLE, _variable_rows(plain, map(str, plain.coords)), _VARIABLE_WIDTHS)]
        if which == "observed":
            names = [str(name) for name in observed.data_vars if name not in plain.data_vars]
            return [table(_VARIABLE, _variable_rows(observed, names), _VARIABLE_WIDTHS)]
        return [table(_VARIABLE, _variable_rows(plain, map(str, plain.data_vars)), _VARIABLE_WIDTHS)]


class Flags(SphinxDirective):
    """`outside-flags`: the values of the variable `outside`."""

    def run(self) -> list[nodes.Node]:
        from spirillum.studies.work import REASONS

        rows = [(str(value), f"`{flag}`") for value, flag in enumerate(REASONS)]
        return [table(("Value", "Meaning"), rows, (15, 85))]


class SimulationVariables(SphinxDirective):
    """`simulation-variables free|held`: the variables that `simulate` writes."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        from spirillum import simulate

        dataset = simulate("biorob2012-wide", timing={"duration": "0.1 s"}, motion=self.arguments[0])
        names = [str(name) for name in (*dataset.coords, *dataset.data_vars)]
        return [table(_VARIABLE, _variable_rows(dataset, names), _VARIABLE_WIDTHS)]


class SweepVariables(SphinxDirective):
    """`sweep-variables`: the variables that `magnetic-sweep` writes."""

    def run(self) -> list[nodes.Node]:
        from spirillum import magnetic_sweep

        dataset = magnetic_sweep("magnetic-helix", ["1 Hz"], turns=4.0)
        names = [str(name) for name in (*dataset.coords, *dataset.data_vars)]
        return [table(_VARIABLE, _variable_rows(dataset, names), _VARIABLE_WIDTHS)]


class Claims(SphinxDirective):
    """`claims`: the verdicts of the paper's study without observations."""

    def run(self) -> list[nodes.Node]:
        from spirillum.papers.registry import claims_of

        rows = [(c.claim, c.paper, c.computed, c.verdict, c.reason) for c in claims_of(_studied())]
        header = ("Statement", "Paper", "Computed", "Verdict", "Reason")
        return [table(header, rows, (24, 12, 28, 12, 24))]


class StudyFigures(SphinxDirective):
    """`study-figures NAME...`: figures of the paper's study, with their own captions."""

    required_arguments = 1
    final_argument_whitespace = True

    def run(self) -> list[nodes.Node]:
        from spirillum.papers.registry import figures_of

        pictures = figures_of(_studied())
        found: list[nodes.Node] = []
        for name in self.arguments[0].split():
            figure = nodes.figure()
            caption = nodes.caption()
            caption += inline(pictures[name].caption)
            figure += nodes.image(uri=f"_build/pictures/{name}.png", alt=pictures[name].alternative)
            figure += caption
            found.append(figure)
        return found


# Models, references, commands ----------------------------------------------------------------------


class Models(SphinxDirective):
    """`models`: the hydrodynamic models with what they cost."""

    def run(self) -> list[nodes.Node]:
        from spirillum.fluid.registry import MODELS

        rows = [
            (
                f"`{model.name}`",
                ", ".join(f"`{part}`" for part in model.parts),
                "along and about the axis" if model.axial_only else "all",
                model.known_error,
            )
            for model in MODELS.values()
        ]
        return [table(("Model", "Parts", "Entries", "Known error"), rows, (10, 20, 15, 55))]


class References(SphinxDirective):
    """`reference-list`: every reference with its key, as a target for links."""

    def run(self) -> list[nodes.Node]:
        from spirillum.citations import REFERENCES

        found = nodes.definition_list()
        for key, text in sorted(REFERENCES.items()):
            item, definition, paragraph = nodes.definition_list_item(), nodes.definition(), nodes.paragraph()
            term = nodes.term(names=[f"ref-{key}"])
            self.state.document.note_explicit_target(term)
            term += nodes.literal(key, key)
            paragraph += inline(text)
            definition += paragraph
            item += [term, definition]
            found += item
        return [found]


class CommandOptions(SphinxDirective):
    """`command-options COMMAND`: arguments and options of a command."""

    required_arguments = 1
    final_argument_whitespace = True
    option_spec: ClassVar[dict[str, Any]] = {"class": directives.class_option}

    def run(self) -> list[nodes.Node]:
        import typer

        from spirillum.cli.app import app

        command: Any = typer.main.get_command(app)
        for name in self.arguments[0].split():
            command = command.commands[name]
        rows = [row for parameter in command.params if (row := _parameter(parameter)) is not None]
        return [table(("Argument or option", "Default", "Meaning"), rows, (28, 17, 55))]


def _parameter(parameter: Any) -> tuple[str, str, str] | None:
    if "--help" in parameter.opts:
        return None
    option = parameter.opts[0].startswith("-")
    names = ", ".join(f"`{name}`" for name in parameter.opts) if option else f"`{parameter.name.upper()}`"
    if option and not parameter.is_flag and parameter.metavar:
        names += f" `{parameter.metavar}`"
    value = parameter.default
    shown = "required" if parameter.required else "–" if value in (None, False) else f"`{value}`"
    return names, shown, parameter.help or ""


# The build -----------------------------------------------------------------------------------------


def _draw_pictures(app: Sphinx) -> None:
    """Draw the study's figures, and run the tutorial, whose picture its page shows.

    With the tag `check` files of the study's figures only have to be there: tests draw them.
    """
    import contextlib
    import io
    import runpy
    import sys

    from spirillum.papers.registry import figures_of

    folder = Path(app.srcdir) / "_build" / "pictures"
    folder.mkdir(parents=True, exist_ok=True)
    for name, picture in figures_of(_studied()).items():
        path = folder / f"{name}.png"
        if app.tags.has("check"):
            path.touch()
        else:
            picture.figure().savefig(path, dpi=110)
    script = Path(app.srcdir).parent / "examples" / "tutorial.py"
    kept = sys.argv
    sys.argv = [str(script), str(folder)]
    try:
        with contextlib.redirect_stdout(io.StringIO()):
            runpy.run_path(str(script), run_name="__main__")
    finally:
        sys.argv = kept


def _all_tables_documented(app: Sphinx, error: Exception | None) -> None:
    from spirillum.robot.robot import Robot

    documented: set[str] | None = getattr(app, "spirillum_tables", None)
    if error is not None or documented is None:  # nothing was read anew
        return
    missing = set(Robot.model_fields) - documented
    if missing:
        raise ExtensionError(f"robot-file.md says nothing about {', '.join(sorted(missing))}")


_BARS = re.compile(r"(?<![\w`|])\|([^|\s`]+)\|(?![\w`])")
_AS_WRITTEN: dict[str, list[str]] = {}


def _before_napoleon(_app: Sphinx, what: str, name: str, _obj: object, _options: Any, lines: list[str]) -> None:
    """Absolute values: `|I|` would be a substitution in reStructuredText. Keep what napoleon would misread."""
    lines[:] = [_BARS.sub(r"\\|\1\\|", line) for line in lines]
    if what in ("attribute", "data", "property"):
        _AS_WRITTEN[name] = list(lines)


def _after_napoleon(_app: Sphinx, _what: str, name: str, _obj: object, _options: Any, lines: list[str]) -> None:
    """Napoleon takes what stands before a colon in an attribute's docstring for its type: undo that."""
    if name in _AS_WRITTEN:
        lines[:] = _AS_WRITTEN.pop(name)
    if lines and lines[0].startswith("Alias for field number"):  # what Python says of a NamedTuple's fields
        lines.clear()


def _short_signature(
    _app: Sphinx, what: str, _name: str, obj: object, _options: Any, _signature: str | None, _returns: str | None
) -> tuple[str, None] | None:
    """A table of the robot file is made by `load`; its fields stand below, with their types."""
    return ("", None) if what == "class" and isinstance(obj, type) and issubclass(obj, BaseModel) else None


class Room(SphinxDirective):
    """`room NAME`: the reference of every module of a room, so that none can be forgotten."""

    required_arguments = 1
    option_spec: ClassVar[dict[str, Any]] = {}

    def run(self) -> list[nodes.Node]:
        import spirillum

        base = Path(spirillum.__file__).parent
        place = base / self.arguments[0]
        found = sorted(place.rglob("*.py")) if place.is_dir() else [place.with_suffix(".py")]
        lines: list[str] = []
        for path in found:
            if path.stem != "__init__":
                module = ".".join(("spirillum", *path.relative_to(base).with_suffix("").parts))
                lines += [f"## `{module}`", "", "```{eval-rst}", f".. automodule:: {module}", "```", ""]
        section = nodes.section()
        section.document = self.state.document
        self.state.nested_parse(StringList(lines), self.content_offset, section, match_titles=True)
        return section.children


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the directives."""
    for name, directive in {
        "robot-fields": RobotFields,
        "study-fields": StudyFields,
        "derived-quantities": Derived,
        "quantities": Quantities,
        "study-variables": StudyVariables,
        "study-figures": StudyFigures,
        "outside-flags": Flags,
        "simulation-variables": SimulationVariables,
        "sweep-variables": SweepVariables,
        "claims": Claims,
        "models": Models,
        "reference-list": References,
        "command-options": CommandOptions,
        "room": Room,
    }.items():
        app.add_directive(name, directive)
    app.connect("builder-inited", _draw_pictures)
    app.connect("build-finished", _all_tables_documented)
    app.connect("autodoc-process-signature", _short_signature)
    app.connect("autodoc-process-docstring", _before_napoleon, priority=400)
    app.connect("autodoc-process-docstring", _after_napoleon, priority=600)
    return {"version": "1", "parallel_read_safe": False, "parallel_write_safe": True}
