"""Commands made from public functions: an option for each argument and for each field of an options table.

Signatures, tables and docstrings are read from the source when a command is resolved, so that neither the start of the
program nor a help page imports a model.
"""

from __future__ import annotations

import ast
import inspect
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache, cached_property
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any, NamedTuple, get_args, get_type_hints

import typer

from spirillum.cli import renderer
from spirillum.cli.inputs import loaded_robot
from spirillum.cli.interrupts import InterruptibleCommand
from spirillum.cli.shared_options import (
    COMPLETERS,
    COMPLETIONS,
    EXAMPLES,
    LISTED,
    METAVARS,
    NAMES,
    OWN,
    PANELS,
    TEXTS,
    NotedCommand,
    RobotArgument,
    Settings,
    choices,
)
from spirillum.data_tables import field_texts
from spirillum.errors import InputError

_SOURCE = Path(__file__).parents[2]
_BY_UNIT = {"m": "LENGTH", "rad": "ANGLE", "s": "TIME", "rad/s": "RATE", "m/s": "VELOCITY"}
_BY_FIELD_TYPE = {
    "Length": "LENGTH",
    "SignedLength": "LENGTH",
    "LengthOrZero": "LENGTH",
    "Time": "TIME",
    "Rate": "RATE",
    "Velocity": "VELOCITY",
    "Angle": "ANGLE",
    "Pitch": "ANGLE",
    "Yaw": "ANGLE",
}
GIVEN_OTHERWISE = ("robot", "progress", "tell")  #: Arguments of functions that every command gives in its own way.


class Declaration(NamedTuple):
    """One argument of a function, or one field of its options tables."""

    path: str  #: `argument`, or `argument.field` of a table.
    annotation: str
    default: Any
    text: str  #: Of the docstring.

    @property
    def name(self) -> str:
        """Of the command's parameter."""
        return self.path.replace(".", "_") if self.path in NAMES else self.path.rpartition(".")[2]

    @property
    def table(self) -> str:
        """The argument with a point, where it is a table; else empty."""
        argument, point, _ = self.path.partition(".")
        return f"{argument}." if point else ""

    @property
    def is_switch(self) -> bool:
        """Whether it is on or off, and off or on otherwise."""
        return "bool" in self.words and "None" not in self.words

    @property
    def words(self) -> set[str]:
        """Names in the annotation."""
        return set(re.findall(r"\w+", self.annotation))


class FunctionSource(NamedTuple):
    """Function, body and exceptions of a command."""

    body: Callable[..., None]
    target: str
    without: Mapping[str, str]  #: Arguments and fields that are no option, with the reason.
    completions: Mapping[str, Any]
    robot: Any  #: Annotation of the argument that names the robot; None for a function without one.
    tables: Mapping[str, Sequence[str]] = {}
    """Arguments that are mappings, with the functions or classes (`module:name`) that declare their fields."""

    @property
    def declarations(self) -> tuple[Declaration, ...]:
        """Arguments of the function and fields of its tables; the first of those of one path."""
        found = {item.path: item for item in declarations(self.target) if item.path not in self.tables}
        for argument, targets in self.tables.items():
            for item in (item for target in targets for item in declarations(target)):
                path = f"{argument}.{item.path}"
                found.setdefault(path, item._replace(path=path))
        return tuple(found.values())


@dataclass
class Request:
    """A call of the public function of a command, with the arguments that were typed."""

    source: FunctionSource
    typed: dict[str, Any]  #: Argument or `argument.field` to its value; what was not typed is left out.
    named_robot: str | None = None
    settings: list[str] | None = None

    @property
    def arguments(self) -> dict[str, Any]:
        """Arguments of the function; the fields of a table together."""
        found: dict[str, Any] = {}
        for path, value in self.typed.items():
            argument, _, field = path.partition(".")
            if field:
                found.setdefault(argument, {})[field] = value
            else:
                found[argument] = value
        return found

    def take(self, argument: str) -> dict[str, Any]:
        """Fields of a table, which then are no argument of the function."""
        prefix = f"{argument}."
        return {path.removeprefix(prefix): self.typed.pop(path) for path in [*self.typed] if path.startswith(prefix)}

    @cached_property
    def robot(self) -> Any:
        """The robot with its fields set; None where none is named."""
        if self.named_robot is None:
            if self.settings:
                raise InputError(
                    f"set = {self.settings[0]} without a robot; allowed: with a preset's name or a robot file"
                )
            return None
        fitted = self.typed.get("calibration"), self.typed.get("posterior")
        return loaded_robot(self.named_robot, self.settings, *fitted)

    def __call__(self, *more: Any, **others: Any) -> Any:
        """Call the function, for the robot where it takes one; `others` join the typed arguments."""
        module, _, name = self.source.target.partition(":")
        first = () if self.source.robot is None else (self.robot,)  # a wrong robot is named before work begins
        return getattr(import_module(module), name)(*first, *more, **{**self.arguments, **others})

    def show(self, *more: Any, json: bool, **others: Any) -> Any:
        """Call the function with a progress bar, print its answer, and return it."""
        with renderer.progress_bar(quiet=json) as progress:
            found = self(*more, progress=progress, **others)
        renderer.show(found.to_dict(), json=json)
        return found


def from_function(
    target: str,
    *,
    without: Mapping[str, str] | None = None,
    complete: Mapping[str, Any] | None = None,
    robot: Any = RobotArgument,
    tables: Mapping[str, Sequence[str]] | None = None,
) -> Callable[[Callable[..., None]], Any]:
    """Decorator that gives a command the arguments of a public function (`module:name`) as options."""
    # The command takes the `Request` and its own options, which replace those of the same name. The arguments are the
    # fields of `FunctionSource`; `complete` is what the shell completes where it is not as in other commands.

    def decorate(body: Callable[..., None]) -> Callable[[], None]:
        def stub() -> None: ...

        stub.__name__, stub.__doc__ = body.__name__, body.__doc__
        completions = {**COMPLETIONS, **(complete or {})}
        stub.source = FunctionSource(body, target, without or {}, completions, robot, tables or {})  # type: ignore[attr-defined]
        return stub

    return decorate


class FunctionCommand(InterruptibleCommand):
    """A command whose parameters are made when they are first needed."""

    @cached_property
    def _made(self) -> Any:
        maker = typer.Typer(add_completion=False)
        maker.command(cls=NotedCommand)(_complete(self._stub.source))
        return typer.main.get_command(maker)

    @property
    def callback(self) -> Any:
        """The function that runs the command."""
        return self._made.callback

    @callback.setter
    def callback(self, stub: Any) -> None:
        self._stub = stub

    @property
    def params(self) -> Any:
        """Arguments and options."""
        return self._made.params

    @params.setter
    def params(self, _none: Any) -> None:
        """There are none yet."""


def _complete(source: FunctionSource) -> Callable[..., None]:
    own = dict(list(inspect.signature(source.body).parameters.items())[1:])
    hints = get_type_hints(source.body, include_extras=True)
    made = {
        item.name: (item, *_option(item, source.completions))
        for item in source.declarations
        if item.name not in own and not {item.path, item.table} & source.without.keys()
    }
    parameters = []
    if source.robot is not None:
        needed = type(None) not in get_args(get_args(source.robot)[0])
        parameters = [_parameter("robot", source.robot, inspect.Parameter.empty if needed else None)]
    parameters += [_parameter(name, kind, default) for name, (_, kind, default) in made.items()]
    command = source.body.__name__
    parameters += [
        _parameter(name, _own_annotation(command, name, hints[name]), item.default) for name, item in own.items()
    ]
    if source.robot is not None:
        parameters.insert(-1, _parameter("settings", Settings, None))

    def run(**given: Any) -> None:
        typed = {
            item.path: not item.default if item.is_switch else given[name]
            for name, (item, _, default) in made.items()
            if given[name] is not None and given[name] != default
        }
        robot = () if source.robot is None else (given["robot"], given["settings"])
        try:
            source.body(Request(source, typed, *robot), **{name: given[name] for name in own})
        except InputError as error:
            raise _with_options(error, [item for item, _, _ in made.values()]) from error

    run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    run.__annotations__ = {item.name: item.annotation for item in parameters}
    run.__doc__ = source.body.__doc__
    return run


def own_options(command: Callable[..., None]) -> Callable[..., None]:
    """A command of no public function, whose options are as `own_options.csv` has them."""
    hints = get_type_hints(command, include_extras=True)
    command.__annotations__ = {name: _own_annotation(command.__name__, name, hint) for name, hint in hints.items()}
    return command


def _own_annotation(command: str, name: str, kind: Any) -> Any:
    """Annotation of what a command takes beside the function's arguments: by `own_options.csv`, or as it is."""
    row = OWN.get((command, name))
    if row is None:
        return kind
    about: Any = {"metavar": row["placeholder"] or None, "help": row["help"], "rich_help_panel": row["panel"] or None}
    about |= {end: int(row[name]) for end, name in (("min", "least"), ("max", "most")) if row[name]}
    if words := row["completion"].split():
        about["autocompletion"] = COMPLETERS[words[0]] if words[0] in COMPLETERS else choices(*words)
    argument = row["option"] == "argument"
    return Annotated[kind, typer.Argument(**about) if argument else typer.Option(*row["option"].split(), **about)]


def _parameter(name: str, annotation: Any, default: Any) -> inspect.Parameter:
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, annotation=annotation, default=default)


_IN_PYTHON = ("in_tube.", "timing.", "resolution.", "field.", "task.")  # tables of functions whose fields no file has


def _with_options(error: InputError, items: Iterable[Declaration]) -> InputError:
    """The error with options in place of such fields, of arguments that are on, and of names that no option has."""
    sentence = str(error)
    for item in items:
        last = item.path.rpartition(".")[2]
        on = not item.default if item.is_switch else True
        found = rf"{re.escape(item.path)}\b" if item.table in _IN_PYTHON else rf"{last} = {on}\b"
        found += rf"|{last}(?= = )" if "_" in last else ""
        off = item.is_switch and item.default and item.path not in NAMES
        name = f"--no-{_name_of(item)[2:]}" if off else _name_of(item)
        sentence = re.sub(rf"(?<![\w.-])(?:{found})", name, sentence)
    return error if sentence == str(error) else InputError(sentence)


def _name_of(item: Declaration) -> str:
    return NAMES.get(item.path, f"--{item.path.rpartition('.')[2].replace('_', '-')}")


def _option(item: Declaration, completions: Mapping[str, Any]) -> tuple[Any, Any]:
    """Annotation and default of an option."""
    last, words, option = item.path.rpartition(".")[2], item.words, _name_of(item)
    unit = re.search(r"float in ([\w/]+)", item.text)
    metavar = next((_BY_FIELD_TYPE[word] for word in words if word in _BY_FIELD_TYPE), None)
    if metavar is None and {"str", "float"} <= words and unit is not None:
        metavar = _BY_UNIT[unit[1]]
    about: dict[str, Any] = {"help": _help(item, metavar), "rich_help_panel": PANELS.get(item.table or item.path)}
    about |= {"autocompletion": completions.get(last)}
    if item.is_switch:
        name = f"--no-{option[2:]}" if item.default and item.path not in NAMES else option
        return Annotated[bool, typer.Option(name, **about)], False
    if "bool" in words:  # the function decides by default
        return Annotated[bool | None, typer.Option(f"{option}/--no-{option[2:]}", show_default=False, **about)], None
    default = item.default if item.default != () and metavar is None and "." not in item.path else None
    kind, metavar = _value_kind(item, metavar)
    as_typed = "x".join(map(str, item.default)) if isinstance(item.default, tuple) else str(item.default)
    if kind == list[str]:
        about["help"] = f"{str(about['help']).rstrip('.')}; repeatable."
    if default is None:
        kind |= None
    elif isinstance(default, tuple):
        default = as_typed
    if unit is not None and metavar is not None and item.default:
        default = f"{item.default:g}{unit[1]}"
    if "." in item.path and metavar is None and item.default not in (None, ()):
        about["show_default"] = as_typed
    return Annotated[kind, typer.Option(option, metavar=METAVARS.get(item.path, metavar), **about)], default


def _value_kind(item: Declaration, metavar: str | None) -> tuple[Any, str | None]:
    """Type of an option's value, and its placeholder in the help."""
    words = item.words
    if "Path" in words:
        return Path, "FILE"
    if words & {"Sequence", "PerRobot", "Samples"} and METAVARS.get(item.path) != LISTED:
        return list[str], metavar
    if metavar is None and "tuple" not in words and words & {"int", "float"}:
        return int if "int" in words else float, metavar
    return str, metavar


def _help(item: Declaration, metavar: str | None) -> str:
    """The text of an argument for someone who types it: without Python's floats and None."""
    if item.path in TEXTS:
        return TEXTS[item.path]
    text = re.sub(r",?( each)? with (its|their) units? (\([^)]*\) )?or (a float|floats) in [\w/]+", "", item.text)
    text = (
        text.replace("; None: ", "; else ")
        .replace("; unset: ", "; else ")
        .replace(" None: ", " Else: ")
        .replace("``", "`")
    )
    text = f"do not {text}" if item.is_switch and item.default else text
    text = f"{text[:1].upper()}{text[1:]}"
    if metavar is None or "such as" in text:
        return text
    example = EXAMPLES.get(item.path, EXAMPLES[metavar])
    first, mark, rest = text.rstrip(".").partition(";")
    return f"{first}, such as {example}{mark}{rest}."


@cache
def declarations(target: str) -> tuple[Declaration, ...]:
    """Arguments of a function and fields of its tables, without robot and progress; fields of a class."""
    module, _, name = target.partition(":")
    return tuple(_class_fields(module, name) if name.lstrip("_")[0].isupper() else _declared(module, name))


def _declared(module: str, name: str) -> Iterator[Declaration]:
    function = _import_object(module, name, ast.FunctionDef)
    said, names = _argument_texts(ast.get_docstring(function) or ""), function.args
    positional = [*names.posonlyargs, *names.args]
    defaults = [None] * (len(positional) - len(names.defaults)) + list(names.defaults)
    for item, default in zip([*positional, *names.kwonlyargs], [*defaults, *names.kw_defaults], strict=True):
        if item.arg in GIVEN_OTHERWISE:
            continue
        annotation = ast.unparse(item.annotation) if item.annotation is not None else ""
        tables = [part for part in annotation.split(" | ") if "Mapping[str, Any]" in annotation and part.isidentifier()]
        if table := next((part for part in tables if _is_table(module, part)), None):
            yield from (field._replace(path=f"{item.arg}.{field.path}") for field in _class_fields(module, table))
        else:
            yield Declaration(item.arg, annotation, _value(module, default), said.get(item.arg, ""))


def _class_fields(module: str, table: str) -> Iterator[Declaration]:
    """Fields of an options table or dataclass with their meanings."""
    home = _home(module, table)
    found = _import_object(home, table, ast.ClassDef)
    texts = field_texts(found, _source(home).splitlines())
    for item in found.body:
        if isinstance(item, ast.AnnAssign) and "ClassVar" not in (annotation := ast.unparse(item.annotation)):
            name = ast.unparse(item.target)
            yield Declaration(name, annotation, _value(home, item.value), " ".join(texts[name].split()))


def _is_table(module: str, name: str) -> bool:
    home = _home(module, name)
    bases = [item.bases for item in _tree(home).body if isinstance(item, ast.ClassDef) and item.name == name]
    return any(ast.unparse(base) == "Options" for found in bases for base in found)


def _argument_texts(docstring: str) -> dict[str, str]:
    """Texts of the arguments in a docstring."""
    part = re.split(r"\n(?=\S)", docstring.partition("Args:\n")[2])[0]
    entries = re.findall(r"^    (\w+): (.*(?:\n {8,}.*)*)", part, re.MULTILINE)
    return {name: " ".join(text.split()) for name, text in entries}


@cache
def _source(module: str) -> str:
    path = _SOURCE / module.replace(".", "/")
    return (path / "__init__.py" if path.is_dir() else path.with_suffix(".py")).read_text(encoding="utf-8")


@cache
def _tree(module: str) -> ast.Module:
    return ast.parse(_source(module))


def _import_object(module: str, name: str, kind: type[Any]) -> Any:
    """A function or class of a module."""
    return next(item for item in _tree(module).body if isinstance(item, kind) and item.name == name)


@cache
def _imported(module: str) -> dict[str, str]:
    """Names that a module imports from this package, with the modules that they come from."""
    imports = [item for item in ast.walk(_tree(module)) if isinstance(item, ast.ImportFrom)]
    ours = [item for item in reversed(imports) if str(item.module).startswith("spirillum")]
    return {alias.name: str(item.module) for item in ours for alias in item.names}


def _home(module: str, name: str) -> str:
    """The module of this package that a name is imported from; the module itself for other names."""
    return _imported(module).get(name, module)


def _value(module: str, node: ast.expr | None) -> Any:
    """A default: a literal, or a constant by its name; None for a formula."""
    if node is None:
        return None
    if not isinstance(node, ast.Name):
        with suppress(ValueError):
            return ast.literal_eval(node)
        return None
    home = _home(module, node.id)
    for item in _tree(home).body:
        targets = item.targets if isinstance(item, ast.Assign) else [getattr(item, "target", None)]
        if any(isinstance(target, ast.Name) and target.id == node.id for target in targets):
            return _value(home, item.value)  # type: ignore[attr-defined]
    raise LookupError(f"{module}: {node.id} is no constant")
