"""Commands that are made from public functions offer each of their arguments, or say why not."""

import importlib
import inspect

import pytest

from spirillum.cli.app import app, command_line
from spirillum.cli.function_command import GIVEN_OTHERWISE, FunctionSource, declarations
from spirillum.cli.measurement_commands import setup_app
from spirillum.robot.arguments import Options

SOURCES: dict[str, FunctionSource] = {
    str(info.callback.__name__).replace("_", "-"): info.callback.source  # type: ignore[union-attr]
    for info in (*app.registered_commands, *setup_app.registered_commands)
    if hasattr(info.callback, "source")
}


def function_of(source: FunctionSource) -> object:
    module, _, name = source.target.partition(":")
    return inspect.unwrap(getattr(importlib.import_module(module), name))


def excepted(source: FunctionSource) -> set[str]:
    """Arguments and fields that the exceptions of a command name, by a path or by a whole table."""
    return {
        item.path
        for item in source.declarations
        if item.path in source.without or (item.table and item.table in source.without)
    }


@pytest.mark.parametrize("name", SOURCES)
def test_every_argument_is_an_option_or_has_a_reason(name: str) -> None:
    source = SOURCES[name]
    tree = command_line().commands
    offered = {parameter.name for parameter in (tree | tree["setup"].commands)[name].params}
    silent = {item.path for item in source.declarations if item.name not in offered}
    assert not silent - excepted(source)
    assert all(source.without.values())


@pytest.mark.parametrize("name", SOURCES)
def test_exceptions_name_arguments_that_are_there(name: str) -> None:
    there = {word for item in SOURCES[name].declarations for word in (item.path, item.table)}
    assert not SOURCES[name].without.keys() - there


@pytest.mark.parametrize("name", SOURCES)
def test_source_text_tells_what_the_imported_function_has(name: str) -> None:
    """Declarations are read from the source without importing it."""
    function = function_of(SOURCES[name])
    parameters = inspect.signature(function).parameters  # type: ignore[arg-type]
    read = declarations(SOURCES[name].target)
    assert list(dict.fromkeys(item.path.partition(".")[0] for item in read)) == [
        argument for argument in parameters if argument not in GIVEN_OTHERWISE
    ]
    for item in read:
        argument, point, field = item.path.partition(".")
        assert item.text, item.path
        if not point:
            default = parameters[argument].default
            assert item.default == (None if default is inspect.Parameter.empty else default)
        else:
            assert field in table_of(function, argument).model_fields


def table_of(function: object, argument: str) -> type[Options]:
    """The options table in the annotation of an argument."""
    words = inspect.signature(function).parameters[argument].annotation.split(" | ")  # type: ignore[arg-type]
    found = [function.__globals__.get(word) for word in words]  # type: ignore[attr-defined]
    return next(item for item in found if isinstance(item, type) and issubclass(item, Options))


def test_the_tables_of_names_hold_nothing_unused() -> None:
    from spirillum.cli.shared_options import COMPLETIONS, METAVARS, NAMES, TEXTS

    paths = {item.path for source in SOURCES.values() for item in source.declarations}
    assert not {*NAMES, *METAVARS, *TEXTS} - paths
    assert not set(COMPLETIONS) - {path.rpartition(".")[2] for path in paths}


def test_every_row_of_the_own_options_is_a_parameter_of_its_command() -> None:
    from spirillum.cli.measurement_commands import observations_app
    from spirillum.cli.robot_commands import robot_app
    from spirillum.cli.shared_options import OWN

    bodies = [
        info.callback.source.body if hasattr(info.callback, "source") else info.callback
        for part in (app, robot_app, setup_app, observations_app)
        for info in part.registered_commands
    ]
    known = {(body.__name__, name) for body in bodies for name in inspect.signature(body).parameters}
    assert not set(OWN) - known


def pages(command: object, words: tuple[str, ...] = ()) -> list[tuple[str, ...]]:
    """Words of every command."""
    found = [words]
    for name, item in getattr(command, "commands", {}).items():
        found += pages(item, (*words, name))
    return found


@pytest.mark.parametrize("words", pages(command_line()), ids=" ".join)
def test_help_page_tells_every_option(words: tuple[str, ...], run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "120")
    found = run(*words, "--help")
    assert not found.code
    command = command_line()
    for word in words:
        command = command.commands[word]
    for parameter in command.params:
        if not getattr(parameter, "hidden", False):
            option = parameter.opts[0].startswith("-")
            assert (max(parameter.opts, key=len) if option else parameter.metavar or parameter.name) in found.out
            assert getattr(parameter, "help", None) or "--" not in parameter.opts[0]
