"""Write the tables and listings that the pages show from the code itself, as plain Markdown.

    python docs/write_listings.py [--pictures] [PAGE...]

Each stands between `<!-- written: NAME ARGUMENTS -->` and `<!-- end of written -->`; NAME is an entry of `LISTINGS`. A
test compares them with what the code says now. `--pictures` also draws the pictures of the paper's study and of the
theory in Python, in `docs/images/study/`.
"""

from __future__ import annotations

import re
import shutil
import sys
import typing
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from spirillum.robot.fields import Section, meanings
from spirillum.units import Kind, for_people, show

DOCS = Path(__file__).parent
ROOT = DOCS.parent
MARKED = re.compile(r"(?<=<!-- written: )([\w-]+)((?: [^\n]*?)?)( -->\n\n)(.*?)(?=\n<!-- end of written -->)", re.S)
DEAR = (
    "study-variables",
    "simulation-variables",
    "sweep-variables",
    "claims",
    "study-figure",
    "validation-sources",
    "validation-case",
)
"""Listings for which robots have to swim: a slow test compares them."""

Rows = Iterable[Sequence[str]]


def table(header: Sequence[str], rows: Rows) -> str:
    """A table in Markdown; cells may hold `code` spans."""
    lines = [header, ["---"] * len(header), *rows]
    return "".join(f"| {' | '.join(_cell(cell) for cell in line)} |\n" for line in lines)


def items(rows: Rows) -> str:
    """A list in Markdown: name, what stands in brackets behind it, meaning."""
    return "".join(f"- {name} ({_cell(about)}): {_cell(text)}\n" for name, about, text in rows)


def _cell(text: str) -> str:
    """Text of a cell, whose code spans show `<` as it is."""
    parts = " ".join(str(text).split()).replace("|", "\\|").split("`")
    return "`".join(part if n % 2 else part.replace("<", "&lt;") for n, part in enumerate(parts)) or " "


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
        return kind.name
    for item in _metadata(info):
        schema = getattr(item, "json_schema", None) or {}
        if "anyOf" in schema:
            return ", or ".join(_choice(choice) for choice in schema["anyOf"])
    words = [arg for part in _parts_of(info.annotation) if typing.get_origin(part) is Literal for arg in part.__args__]
    if words:
        return ", ".join(f"`{word}`" for word in words)
    return _allowed_number_or_text(info)


_FORMS = {"array": "points", "string": "a file", "null": "`none`"}
"""Words for a type in a JSON schema."""


def _choice(schema: dict[str, Any]) -> str:
    """One of several forms of a field, from its JSON schema."""
    if "minimum" in schema:
        return f"{schema['minimum']:g} to {schema['maximum']:g}"
    if schema.get("type") in _FORMS:
        return _FORMS[schema["type"]]
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


def field_rows(model: type[BaseModel], prefix: str) -> Iterator[tuple[str, str, str, str]]:
    """Field, default, allowed and meaning of every field of a table, its own tables included."""
    words = meanings(model)
    for name, info in model.model_fields.items():
        path = f"{prefix}{name}"
        below = _section(info)
        if below is not None:
            yield from field_rows(below, f"{path}.")
            continue
        kind = _kind(info)
        yield f"`{path}`", _default(info, kind), _allowed(info, kind), words.get(name, "").replace(" (here None)", "")


def _fields(rows: Rows) -> str:
    """Fields as a list: what is allowed and the default stand in brackets."""
    shown = (
        (name, allowed if default in ("unset", "empty") else f"{allowed}; {default}", text)
        for name, default, allowed, text in rows
    )
    return items((name.replace("<", "&lt;"), about, text) for name, about, text in shown)


def robot_fields(wanted: str) -> str:
    """The fields of one table of the robot file; `root` for the fields outside tables."""
    from spirillum.robot.robot import Robot

    if wanted == "root":
        plain = {name: info for name, info in Robot.model_fields.items() if _section(info) is None}
        words = meanings(Robot)
        rows = [(f"`{name}`", _default(info, None), "text", words.get(name, "")) for name, info in plain.items()]
        extends = "What the file starts from; its own fields are laid over it."
        rows.append(("`extends`", "unset", "a preset, or a robot file beside this one", extends))
        return _fields(rows)
    model = _section(Robot.model_fields[wanted])
    if model is None:
        raise ValueError(f"{wanted} is no table of the robot file")
    return _fields(field_rows(model, "calibration.<model>." if wanted == "calibration" else f"{wanted}."))


def study_fields() -> str:
    """The fields of a study file."""
    from spirillum.studies.spec import Study

    rows = list(field_rows(Study, ""))
    pose = [row[0] for row in rows if row[0].startswith("`placement.")]
    words = f"The pose ({', '.join(pose)}) has the meaning of the shared options of these names.\n"
    return _fields(row for row in rows if row[0] not in pose) + f"\n{words}"


def derived_quantities() -> str:
    """What `spirillum robot show` adds to the fields."""
    from spirillum import load

    derived = load("biorob2012-wide").derived()
    return items((f"`{name}`", item.unit, item.meaning) for name, item in derived.items())


def quantities() -> str:
    """The quantities of a prediction."""
    from spirillum.swimming.motions import STEADY

    return items((f"`{item.name}`", item.unit, item.meaning) for item in STEADY)


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


class _Families(typing.NamedTuple):
    """Variables of a dataset, sorted by how they are listed."""

    plain: list[tuple[str, str, str]]
    """Name, unit and meaning of those that stand by themselves."""
    predicted: dict[tuple[str, str], list[str]]
    """Quantities of `predict`, by the pattern of the name and the dimensions."""
    means: list[str]
    """Averages of other variables over the run."""
    variants: dict[str, list[str]]
    """Variables that differ from another one by an ending, by that ending."""


def _variables(dataset: Any, names: Iterable[str]) -> str:
    """Variables of a dataset; what most of them share, and families of names, stand once above the list."""
    rows = []
    for name in names:
        about = dataset[name].attrs
        over = ", ".join(f"`{dimension}`" for dimension in dataset[name].dims) or "single value"
        unit, source = str(about.get("units", "–")), str(about.get("source", "–"))
        rows.append((f"`{name}`", unit, str(about["long_name"]), over, source))
    usual = [Counter(row[column] for row in rows).most_common(1)[0][0] for column in (3, 4)]
    found = _families(rows, usual)
    head = [f"Unless stated otherwise over {usual[0]}; source: {usual[1]}."]
    for (pattern, over), same in found.predicted.items():
        named = f", named `{pattern}`" if pattern != "<quantity>" else ""
        head.append(f"As in `predict`{named}{f', over {over}' if over != usual[0] else ''}: {_all_or(same)}.")
    if found.means:
        head.append(f"Averages over the last two thirds of the run: {', '.join(f'`{name}`' for name in found.means)}.")
    head += [f"`{_common(bases)}{suffix}` is {_VARIANTS[suffix]}." for suffix, bases in found.variants.items()]
    return f"{' '.join(head)}\n\n" + items(found.plain)


def _families(rows: Sequence[tuple[str, str, str, str, str]], usual: Sequence[str]) -> _Families:
    """Sort variables by how they are listed."""
    found = _Families([], {}, [], {})
    known = {row[0].strip("`") for row in rows}
    for row in rows:
        suffix = next((end for end in _VARIANTS if row[0].endswith(f"{end}`")), "")
        base = row[0].strip("`").removesuffix(suffix)
        if suffix and base in known:
            found.variants.setdefault(suffix, []).append(base)
        elif base.startswith("mean_") and base.removeprefix("mean_") in known:
            found.means.append(base)
        elif pattern := _pattern(row, usual[0]):
            name = row[0].replace(pattern.removeprefix("<quantity>"), "")
            found.predicted.setdefault((pattern, row[3]), []).append(name)
        else:
            name, unit, text, *others = row
            found.plain.append((name, unit, _unusual(text, others, usual)))
    return found


_VARIANTS = {
    "_ci95": "the half width of its 95 % interval",
    "_on": "the average while the drive is on",
    "_steady": "that while the motion is steady too",
}
"""What an ending of a variable's name says of the variable without it."""


def _common(names: Sequence[str]) -> str:
    """A pattern for names, of which all may have the same first word."""
    first = names[0].partition("_")[0]
    return f"{first}_<...>" if all(name.startswith(f"{first}_") for name in names) else "<...>"


def _all_or(found: Sequence[str]) -> str:
    """Names of quantities of `predict`, or that it is all of them."""
    from spirillum.swimming.motions import STEADY

    return "all quantities" if len(found) == len(STEADY) else ", ".join(found)


_PREDICTED = ("_at_observed_rate", "_at_assumed_rate", "_held")
"""Endings of variables that are quantities of `predict` under other circumstances."""


def _pattern(row: Sequence[str], over: str) -> str:
    """How a variable is named after a quantity of `predict`, listed on the same page; empty if it is not."""
    from spirillum.swimming.motions import STEADY

    suffix = next((end for end in _PREDICTED if row[0].endswith(f"{end}`")), "")
    name = row[0].strip("`").removesuffix(suffix)
    known = any(name == item.name and row[1] == item.unit for item in STEADY)
    return f"<quantity>{suffix}" if known and (suffix or row[3] == over) else ""


def _unusual(meaning: str, others: Sequence[str], usual: Sequence[str]) -> str:
    """A meaning with dimensions and source where they are not the usual ones."""
    over, source = (value if value not in (common, "–") else "" for value, common in zip(others, usual, strict=True))
    return meaning + (f"; over {over}" if over else "") + (f"; source: {source}" if source else "")


def study_variables(which: str) -> str:
    """The variables of `dataset.nc`: `coordinates`, `results`, `observed`."""
    plain = _studied()
    if which == "coordinates":
        return _variables(plain, map(str, plain.coords))
    if which == "observed":
        observed = _observed()
        return _variables(observed, [str(name) for name in observed.data_vars if name not in plain.data_vars])
    return _variables(plain, map(str, plain.data_vars))


def outside_flags() -> str:
    """The values of the variable `outside`."""
    from spirillum.studies.work import REASONS

    return ", ".join(f"{value} `{flag}`" for value, flag in enumerate(REASONS)) + ".\n"


def simulation_variables(motion: str) -> str:
    """The variables that `simulate` writes, `free` or `held`."""
    from spirillum import simulate

    dataset = simulate("biorob2012-wide", timing={"duration": "0.1 s"}, motion=motion)
    names = [str(name) for name in (*dataset.coords, *dataset.data_vars)]
    if motion == "free":
        return _variables(dataset, names)
    free = simulate("biorob2012-wide", timing={"duration": "0.1 s"}, motion="free")
    same = [name for name in names if name in free and _about(free[name]) == _about(dataset[name])]
    words = f"As in a free run: {', '.join(f'`{name}`' for name in same)}.\n"
    return _variables(dataset, [name for name in names if name not in same]) + f"\n{words}"


def _about(variable: Any) -> tuple[str, ...]:
    """What a variable is, whatever its source."""
    return str(variable.attrs.get("units")), str(variable.attrs["long_name"]), *map(str, variable.dims)


def sweep_variables() -> str:
    """The variables that `magnetic-sweep` writes."""
    from spirillum import magnetic_sweep

    dataset = magnetic_sweep("magnetic-helix", ["1 Hz"], turns=4.0)
    return _variables(dataset, [str(name) for name in (*dataset.coords, *dataset.data_vars)])


def claims() -> str:
    """The verdicts of the paper's study without observations: a table of what is decided, a count of what is not."""
    from spirillum.papers.registry import claims_of

    found = claims_of(_studied())
    rows = [(c.claim, c.paper, c.computed, c.verdict) for c in found if c.verdict != "undecidable"]
    others = f"Undecidable: {len(found) - len(rows)} statements.\n"
    return table(("Statement", "Paper", "Computed", "Verdict"), rows) + f"\n{others}"


def study_figure(name: str) -> str:
    """A figure of the paper's study with its own caption; `--pictures` draws it."""
    from spirillum.papers.registry import figures_of

    picture = figures_of(_studied())[name]
    return f"![{picture.alternative}](images/study/{name}.png)\n\n*{picture.caption.replace('*', '')}*\n"


@lru_cache(maxsize=1)
def _validated() -> dict[str, Any]:
    """The results of all validation cases by name."""
    from spirillum import validate

    return {result.name: result for result in validate().cases}


def validation_sources() -> str:
    """A row for each validation case."""
    rows = []
    for name, result in _validated().items():
        ratios = "; ".join(
            f"{one.quantity} {one.mean:.2f}{f' (sd {one.deviation:.2f})' if one.count > 1 else ''}"
            for one in result.summaries
        )
        published = sum(one.count for one in result.summaries)
        covered = f"{sum(one.covered for one in result.summaries)} of {published}" if published else ""
        verdicts = ", ".join(f"{count} {verdict}" for verdict, count in result.counted().items())
        rows.append((f"[`{name}`](#{name})", result.case.kind, result.case.read, ratios, covered, verdicts))
    return table(("Case", "Kind", "Read", "Ours over published, mean", "Covered", "Statements"), rows)


def validation_case(name: str) -> str:
    """A validation case: figure, what it shows, its quantities, what the assumptions do, statements, source."""
    from spirillum.results.validation import case_picture

    result = _validated()[name]
    case, picture = result.case, case_picture(result)
    references = ", ".join(f"[`{key}`](references.md#{key})" for key in case.references)
    parts = [
        f"{case.title} ({references}).",
        f"![{picture.alternative}](images/validation/{name}.png)",
        " ".join(case.explanation.split()),
    ]
    if compared := list(_compared(result)):
        parts.append(table(_COMPARED, compared))
    if case.assumptions:
        assumed = (f"{one.name}: {', '.join(one.values)}" for one in case.assumptions)
        parts.append(f"Assumed: {'; '.join(assumed)}.")
    if case.statements:
        told = zip(result.statements, result.read, strict=True)
        claims = [(one.claim, read, one.computed, one.verdict) for one, read in told]
        parts.append(table(("Statement", "Read", "Computed", "Verdict"), claims))
    elif result.statements:
        verdicts = ", ".join(f"{count} {verdict}" for verdict, count in result.counted().items())
        parts.append(f"Statements of the text: {verdicts}; reasons in [the paper's study](study.md).")
    robots = [robot for robot in dict.fromkeys((case.robot, *(point.robot for point in case.points))) if robot]
    files = ", ".join(f"`{robot}`" for robot in robots)
    parts.append(f"Read ({case.read}): {' '.join(case.source.split())}. Robot files: {files}.")
    return "\n\n".join(part.strip() for part in parts) + "\n"


_COMPARED = (
    *("Quantity", "Rows", "Published", "Ours", "Difference", "Stated error", "Assumptions"),
    *("Covered", "if assumed"),
)


def _compared(result: Any) -> Iterator[tuple[str, ...]]:
    """A row for each quantity of a case that was published: ranges over the rows, and how many are covered."""
    for name, quantity in result.case.quantities.items():
        rows = [row for row in result.rows if row.name == name and row.published is not None]
        if not rows:
            continue
        unit = "" if quantity.unit == "1" else f" {quantity.unit}"
        spread = f" ± {rows[0].uncertainty:.3g}" if len(rows) == 1 and rows[0].uncertainty else ""
        ends = [end / row.ours - 1.0 for row in rows if row.effects for end in row.ends]
        errors = [row.stated_error for row in rows if row.stated_error is not None]
        by = Counter(row.covered_by for row in rows)
        yield (
            quantity.label,
            str(len(rows)),
            f"{_span(f'{row.published:.3g}' for row in _sorted(rows, 'published'))}{spread}{unit}",
            f"{_span(f'{row.ours:.3g}' for row in _sorted(rows, 'ours'))}{unit}",
            _span(_percent(row.difference) for row in _sorted(rows, "difference")) + " %",
            f"up to {100.0 * max(errors):.2g} %" if errors else "",
            _span(_percent(end) for end in sorted(ends)) + " %" if ends else "",
            str(by["stated error"]),
            str(by["assumptions"]),
        )


def _sorted(rows: Iterable[Any], name: str) -> list[Any]:
    return sorted(rows, key=lambda row: float(getattr(row, name)))


def _span(texts: Iterable[str]) -> str:
    """First and last of ordered texts, one where they are the same."""
    every = [text.replace("-", "−") for text in texts]
    return " to ".join(dict.fromkeys((every[0], every[-1])))


def _percent(share: float) -> str:
    return f"{100.0 * share:+.{0 if abs(share) >= 0.0995 else 1}f}"


def reference_list() -> str:
    """Every reference under its key, to which pages link."""
    from spirillum.citations import REFERENCES

    return "\n".join(f"## {key}\n\n{text}\n" for key, text in sorted(REFERENCES.items()))


def command_options(words: str) -> str:
    """Arguments and options of a command, those that it shares with others by name alone, the usual ones not at all."""
    shared = _shared_options()
    found = [option for option in _options_of(words) if words != "study" or not _is_study_field(option)]
    lines = [_item(option._replace(meaning=_brief(option.meaning))) for option in found if option not in shared]
    names = [option.names[-1] for option in found if option in shared and option.names[-1] not in _USUAL]
    for group, members in _GROUPS.items():
        if set(members) <= set(names):
            names = [group, *(name for name in names if name not in members)]
    words = ", ".join(name if name in _GROUPS else f"`{name}`" for name in names)
    return "".join(lines) + ("\n" if lines and words else "") + (f"Shared: {words}.\n" if words else "")


def _is_study_field(option: Option) -> bool:
    """Whether an option of `study` sets the field of its name, which the study file's list explains."""
    from spirillum.studies.spec import Study

    field = Study.model_fields.get(option.names[-1].removeprefix("--"))
    return field is not None and field.annotation is bool


def _brief(meaning: str) -> str:
    """A help text without long clauses that state neither choices nor a default; `--help` prints the whole."""
    first, *more = re.split(r"(?<=[.;]) (?![^(]*\))", meaning)
    stating = re.compile(r"(?i)else|or\b|auto|`")
    kept = " ".join([first, *(part for part in more if stating.match(part) or len(part.split()) <= 5)])
    return kept[:-1] + "." if kept.endswith(";") else kept


_USUAL = ("--set", "--json", "--notes")
"""Options of nearly every command, which the page names once."""
_GROUPS = {
    "pose": ("--gap", "--eccentricity", "--pitch", "--yaw", "--ends", "--flow"),
    "camera": (
        *("--view", "--direction", "--fps", "--size", "--noise", "--lamp-drift", "--crf", "--dropped", "--tilt"),
        *("--glare", "--glare-fixed", "--bubbles", "--hand", "--preset"),
    ),
}
"""Options that the page names together."""
_EXAMPLE = re.compile(r"(?:, |; )such as -?[\d.]+ ?[A-Za-z/]+(?=[.;,]|$)")
"""An example of a value with its unit, of which the page has one for every kind."""


def shared_options() -> str:
    """The options that several commands have in the same words."""
    return "".join(_item(option) for option in _shared_options())


class Option(typing.NamedTuple):
    """An argument or option of a command as it is listed."""

    names: tuple[str, ...]
    metavar: str
    default: str
    """Empty without one."""
    meaning: str


def _item(option: Option) -> str:
    names = ", ".join(f"`{name}`" for name in option.names) + (f" `{option.metavar}`" if option.metavar else "")
    default = "required" if option.default == "required" else option.default and f"`{option.default}`"
    return f"- {names}{f' ({default})' if default else ''}: {_cell(option.meaning)}\n"


@lru_cache(maxsize=1)
def _shared_options() -> tuple[Option, ...]:
    """Options that several commands have in the same words, the commonest first; of one name one meaning."""
    from spirillum.cli.app import command_line

    counts = Counter(option for words in _commands_of(command_line()) for option in _options_of(words))
    found: dict[str, Option] = {}
    for option, count in counts.most_common():
        if count > 1:
            found.setdefault(option.names[-1], option)
    return tuple(found.values())


def _commands_of(command: Any, words: str = "") -> Iterator[str]:
    """Words of every command that has none below it."""
    below = getattr(command, "commands", None)
    if below is None:
        yield words
        return
    for name, item in below.items():
        yield from _commands_of(item, f"{words} {name}".strip())


def _options_of(words: str) -> list[Option]:
    from spirillum.cli.app import command_line

    command = command_line()
    for name in words.split():
        command = command.commands[name]
    return [_option(parameter) for parameter in command.params if "--help" not in parameter.opts]


def _option(parameter: Any) -> Option:
    option = parameter.opts[0].startswith("-")
    names = tuple(parameter.opts) if option else (parameter.name.upper(),)
    metavar = parameter.metavar if option and not parameter.is_flag and parameter.metavar else ""
    stated = getattr(parameter, "show_default", None)  # of options whose default stands in a table
    value = stated if isinstance(stated, str) else parameter.default
    default = "required" if parameter.required else "" if value in (None, False) else str(value)
    return Option(names, metavar, default, _EXAMPLE.sub("", parameter.help or ""))


def notes(severity: str) -> str:
    """The codes of notes of one severity, each with what it means and an anchor of its own."""
    from spirillum.notes import KINDS

    parts: dict[str, list[str]] = {}
    for code, kind in KINDS.items():
        if kind.severity == severity:
            parts.setdefault(kind.explanation, []).append(code)
    return "\n".join(
        "".join(f"(note-{code})=\n" for code in codes) + f"### {', '.join(f'`{code}`' for code in codes)}\n\n{words}\n"
        for words, codes in parts.items()
    )


LISTINGS: dict[str, Callable[..., str]] = {
    "robot-fields": robot_fields,
    "study-fields": study_fields,
    "derived-quantities": derived_quantities,
    "quantities": quantities,
    "study-variables": study_variables,
    "study-figure": study_figure,
    "outside-flags": outside_flags,
    "simulation-variables": simulation_variables,
    "sweep-variables": sweep_variables,
    "claims": claims,
    "validation-sources": validation_sources,
    "validation-case": validation_case,
    "reference-list": reference_list,
    "command-options": command_options,
    "shared-options": shared_options,
    "notes": notes,
}


def written(name: str, arguments: str) -> str:
    """What stands between two marks now."""
    return LISTINGS[name](*([arguments.strip()] if arguments.strip() else []))


def renewed(text: str) -> str:
    """A page with all its listings written anew."""
    return MARKED.sub(lambda mark: f"{mark[1]}{mark[2]}{mark[3]}{written(mark[1], mark[2])}", text)


def draw_validation() -> None:
    """Draw the figures of the validation cases."""
    from spirillum.results.validation import case_picture

    folder = DOCS / "images" / "validation"
    folder.mkdir(parents=True, exist_ok=True)
    for name, result in _validated().items():
        case_picture(result).figure().savefig(folder / f"{name}.png", dpi=150)


def draw_pictures() -> None:
    """Draw the figures of validation and of the paper's study, and run the example whose picture a page shows."""
    import runpy

    from spirillum.papers.registry import figures_of

    draw_validation()
    folder = DOCS / "images" / "study"
    folder.mkdir(parents=True, exist_ok=True)
    for name, picture in figures_of(_studied()).items():
        picture.figure().savefig(folder / f"{name}.png", dpi=150)
    script = ROOT / "examples" / "theory_in_python.py"
    with TemporaryDirectory() as where:
        sys.argv = [str(script), where]
        runpy.run_path(str(script), run_name="__main__")
        shutil.copy(Path(where) / "advance-per-turn.png", folder / "advance-per-turn.png")


def main(arguments: list[str]) -> None:
    """Write the listings of the named pages, or of all."""
    if "--pictures" in arguments:
        draw_pictures()
    names = [Path(name) for name in arguments if not name.startswith("-")]
    for page in names or sorted(DOCS.glob("*.md")):
        text = page.read_text(encoding="utf-8")
        if (new := renewed(text)) != text:
            page.write_text(new, encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
