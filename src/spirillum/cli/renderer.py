"""One renderer for all answers: JSON for machines, or the table of the answer's kind for people."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from importlib import import_module
from pathlib import Path
from typing import Any

import typer
from rich.console import Console
from rich.markup import escape

from spirillum.cli.progress_lines import progress_lines
from spirillum.cli.tables.parts import Answer
from spirillum.envelope import as_json

_NARROWEST = 80


_PACE = 900.0
"""Time over which the pace of work is averaged, s: a place of a table takes half a minute."""


class _PipedConsole(Console):
    """A console that leaves a reader who has gone, as `| head` does, to the caller."""

    def on_broken_pipe(self) -> None:
        """Hand the error on: the library would end the program with exit code 1."""
        raise BrokenPipeError


def show(answer: Answer, *, json: bool, **options: Any) -> None:
    """Print an answer as JSON, or as the table of its kind followed by its warnings.

    The table is the function `table` of the module in `spirillum.cli.tables` that is named after the answer's schema.
    """
    if json:
        try:
            typer.echo(as_json(answer))
        except BrokenPipeError as error:
            raise BrokenPipeError from error  # without its number, by which the library would end with exit code 1
        return
    console = _PipedConsole()
    if console.width < _NARROWEST:
        console = _PipedConsole(width=_NARROWEST)  # a narrow terminal wraps; it must not lose numbers
    kind = str(answer["schema"]).removeprefix("spirillum.").partition("/")[0]
    import_module(f"spirillum.cli.tables.{kind.replace('-', '_')}").table(answer, console, **options)
    for warning in answer["warnings"]:
        console.print(f"[yellow]warning:[/yellow] {escape(warning)}", highlight=False, soft_wrap=True)


def with_files(answer: Answer, **files: Any) -> dict[str, Any]:
    """An answer with the files that a command has written for it; its warnings stay last."""
    content = {name: item for name, item in answer.items() if name != "warnings"}
    return {**content, **files, "warnings": answer["warnings"]}


def picture(path: Path | None, example: str, figure: str) -> Callable[[Any], str | None]:
    """A function that draws an answer into a file, which is checked now; it returns the file's name, or None.

    Args:
        path: of the picture; None without one.
        example: of a file's name, for the sentence of an error.
        figure: function that makes the figure of an answer, `module:name`.
    """
    from spirillum.files import PICTURES, output_target

    target = None if path is None else output_target(path, PICTURES, example)

    def draw(answer: Any) -> str | None:
        if target is None:
            return None
        from spirillum.view.figures.style import save_as

        module, _, name = figure.partition(":")
        save_as(getattr(import_module(module), name)(answer), target)
        return str(path)

    return draw


def patience(model: str, *, quiet: bool, tilted: bool = False) -> AbstractContextManager[object]:
    """A sign of life while a model solves; its first run on a machine compiles for some seconds.

    That a pitched or yawed place is solved for, which takes minutes, is a line on standard error in any case.
    """
    from spirillum.fluid.registry import MODELS
    from spirillum.fluid.tube.progress_messages import TILTED

    if tilted and model in MODELS and MODELS[model].placed:
        Console(stderr=True, soft_wrap=True).print(TILTED, highlight=False)
    quick = model not in MODELS or MODELS[model].closed_form
    return at_work("solving for the flow (the first time, compiling takes some seconds)", quiet=quiet or quick)


def at_work(what: str, *, quiet: bool) -> AbstractContextManager[object]:
    """A sign of life on standard error that says what is done; none for `--json` and where nobody watches."""
    console = Console(stderr=True)
    return nullcontext() if quiet or not console.is_terminal else console.status(what)


def _print_line(line: str) -> None:
    """Print a line on standard error; one that is closed or full changes nothing else."""
    if sys.stderr is not None:
        with suppress(OSError, ValueError):
            sys.stderr.write(f"{line}\n")
            sys.stderr.flush()


@contextmanager
def progress_bar(*, quiet: bool) -> Iterator[Callable[[str, int, int], None]]:
    """A progress bar on standard error with the time left, plain lines where it is no terminal; silent for `--json`.

    That a table is made or a pitched or yawed place solved for, which takes minutes, and what a large study will take,
    are lines of their own on standard error in any case.
    """
    from spirillum.fluid.tube.progress_messages import ANNOUNCED, OF_A_RUN, TILTED
    from spirillum.worker_pool import ESTIMATE

    lines = (ANNOUNCED, ESTIMATE, OF_A_RUN, TILTED)
    if quiet:

        def announce(what: str, _done: int, _total: int) -> None:
            if what.startswith(lines):
                _print_line(what)

        yield announce
        return
    console = Console(stderr=True, soft_wrap=True)
    if not console.is_terminal:
        with progress_lines(_print_line, lines) as told:
            yield told
        return
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    bar = Progress(*columns, console=console, transient=True, speed_estimate_period=_PACE)
    task = bar.add_task("starting", total=None)
    before: list[int | None] = [0, 0]

    def tell(what: str, done: int, total: int | None) -> None:
        if what.startswith(lines):
            bar.console.print(what, highlight=False)
            what, done, total = "at work", 0, None  # without an end, but with the time that goes by
        bar.start()  # not before there is work: an error in the input leaves nothing on the screen
        if total != before[1] or done < (before[0] or 0):  # other work has another pace
            bar.reset(task)
        before[:] = done, total
        bar.update(task, description=escape(what), completed=done, total=total)

    try:
        yield tell
    finally:
        bar.stop()
