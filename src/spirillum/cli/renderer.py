"""One renderer for all answers: JSON, or title, cautions and tables; progress as a bar or as plain lines."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from importlib import import_module
from pathlib import Path
from threading import Timer
from typing import TYPE_CHECKING, Any

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from spirillum.cli.progress import StagePace, duration, line_after, progress_lines
from spirillum.cli.shared_options import every_note
from spirillum.cli.wrapping import NARROWEST, wrapped
from spirillum.notes import Note, headline_cautions, notes_in_answer

if TYPE_CHECKING:
    from spirillum.cli.tables.parts import Answer, Block


class _PipedConsole(Console):
    """A console that leaves a reader who has gone, as `| head` does, to the caller."""

    def on_broken_pipe(self) -> None:
        """Hand the error on: the library would end the program with exit code 1."""
        raise BrokenPipeError


def show(answer: Answer, *, json: bool, **options: Any) -> None:
    """Print an answer as JSON, or as title, cautions, tables and the number of its notes, which `--notes` prints."""
    from spirillum.cli.tables import blocks_of  # brings the models
    from spirillum.cli.tables.parts import Detail
    from spirillum.envelope import as_json

    if json:
        try:
            typer.echo(as_json(answer))
        except BrokenPipeError as error:
            raise BrokenPipeError from error  # without its number, by which the library would end with exit code 1
        return
    console = _PipedConsole(emoji=False)
    if console.width < NARROWEST:
        console = _PipedConsole(width=NARROWEST, emoji=False)  # a narrow terminal wraps; it must not lose numbers
    notes, every = notes_in_answer(answer), every_note.get()
    cautions = [] if every else headline_cautions(notes)
    title, *blocks = blocks_of(answer, **options)
    details = [block for block in blocks if isinstance(block, Detail)]
    _print_title(console, title, cautions)
    for block in blocks:
        if every or not isinstance(block, Detail):
            _print(console, block)
    if every:
        for note in notes:
            _print_note(console, note, f" [{note.code}]")
    elif details or len(notes) > len(cautions):
        _print(console, _left_line(notes, cautions))


def _left_line(notes: Sequence[Note], shown: Sequence[Note]) -> str:
    """Return the last line of an answer: codes of cautions that are not shown, and how to read all notes."""
    from spirillum.display import counted

    above = {note.code for note in shown}
    others = dict.fromkeys(note.code for note in notes if note.severity == "caution" and note.code not in above)
    also = f"{counted(len(others), 'more caution')} ({', '.join(others)}) and " if others else ""
    return f"{also}notes: --notes"


def _print(console: Console, block: Block, style: str = "") -> None:
    if isinstance(block, str):
        console.print(wrapped(block), highlight=False, soft_wrap=True, markup=False, style=style or None)
        return
    title, block.title = block.title, None  # else it is wrapped at the width of the table
    if title:
        _print(console, Text.from_markup(str(title)).plain, "bold")
    console.print(block, highlight=False)


def _print_title(console: Console, block: Block, cautions: Sequence[Note]) -> None:
    """The title, which may be that of a table, with the weightiest cautions below it."""
    if isinstance(block, Table):
        title, block.title = Text.from_markup(str(block.title)).plain, None
        _print(console, title, "bold")
    else:
        _print(console, block, "bold")
    for note in cautions:
        _print_note(console, note)
    if isinstance(block, Table):
        _print(console, block)


def _print_note(console: Console, note: Note, code: str = "") -> None:
    colour = "yellow" if note.severity == "caution" else "blue"
    line = Text(wrapped(f"{note.severity}: {note}{code}"))
    line.stylize(colour, 0, len(note.severity) + 1)
    console.print(line, highlight=False, soft_wrap=True)


def with_files(answer: Answer, **files: Any) -> dict[str, Any]:
    """An answer with the files that a command has written for it; its notes stay last."""
    from spirillum.envelope import with_notes_last

    return with_notes_last(answer, **files)


def picture(path: Path | None, example: str, figure: str) -> Callable[[Any], str | None]:
    """A function that draws an answer into a file, which is checked now; it returns the file's name, or None."""
    # `figure` is the function `module:name` that makes the figure, `example` a file's name for the sentence of an
    # error.
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


def show_with_pictures(
    answer: Answer, source: Any, *, json: bool, draw: Mapping[str, Callable[[Any], str | None]], **options: Any
) -> None:
    """Print an answer with the pictures of its source by their entries, also where one of them cannot be drawn."""
    files: dict[str, str | None] = {}
    with answer_before_error(lambda: with_files(answer, **files), json=json, **options):
        for name, one in draw.items():
            files[name] = one(source)
    show(with_files(answer, **files), json=json, **options)


@contextmanager
def answer_before_error(answer: Callable[[], Answer], *, json: bool, **options: Any) -> Iterator[None]:
    """Print an answer that was computed before the error of the block that writes its files."""
    try:
        yield
    except BaseException:
        show(answer(), json=json, **options)
        raise


def patience(model: str, *, quiet: bool, tilted: bool = False) -> AbstractContextManager[object]:
    """A sign of life while a model solves; its first run on a machine compiles for some seconds."""
    # That a pitched or yawed place is solved for is a line on standard error in any case.
    from spirillum.fluid.registry import MODELS
    from spirillum.fluid.tube.progress_messages import TILTED, solution_message

    if tilted and model in MODELS and MODELS[model].placed:
        _print_line(solution_message(TILTED))
    quick = model not in MODELS or MODELS[model].closed_form
    return at_work("solving for the flow", quiet=quiet or quick)


def at_work(what: str, *, quiet: bool) -> AbstractContextManager[object]:
    """A sign of life on standard error, where it is no terminal a line after some seconds; none for `--json`."""
    console = Console(stderr=True)
    if quiet:
        return nullcontext()
    return console.status(what) if console.is_terminal else line_after(_print_line, what)


def _print_line(line: str) -> None:
    """Print a line on standard error; one that is closed or full changes nothing else."""
    if sys.stderr is not None:
        with suppress(OSError, ValueError):
            sys.stderr.write(f"{wrapped(line)}\n")
            sys.stderr.flush()


_SOON = 2.0  # time after which progress is shown, and why an answer is not there at once, s


@contextmanager
def progress_bar(*, quiet: bool) -> Iterator[Callable[[str, int, int], None]]:
    """A progress bar on standard error with the time left, plain lines where it is no terminal; silent for `--json`."""
    # That a table is made or a pitched or yawed place solved for, which takes minutes, and what a large study will
    # take, are lines of their own on standard error in any case; so is, after two seconds, that there is no table.
    from spirillum.fluid.tube.progress_messages import LEVEL

    waiting: list[Timer] = []
    with _progress(quiet=quiet) as tell:

        def told(what: str, done: int, total: int) -> None:
            if not what.startswith(LEVEL):
                tell(what, done, total)
            elif not waiting:
                waiting.append(Timer(_SOON, tell, (what, done, total)))
                waiting[0].daemon = True
                waiting[0].start()

        try:
            yield told
        finally:
            for timer in waiting:
                timer.cancel()


@contextmanager
def _progress(*, quiet: bool) -> Iterator[Callable[[str, int, int], None]]:
    """A progress bar, or lines, for messages as they come."""
    from spirillum.fluid.tube.progress_messages import ANNOUNCED, LEVEL, OF_A_RUN, TILTED
    from spirillum.swimming.motions import SPEED_OF
    from spirillum.worker_pool import ESTIMATE

    lines = (ANNOUNCED, ESTIMATE, LEVEL, OF_A_RUN, TILTED)
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
        ProgressColumn,
        TextColumn,
        TimeElapsedColumn,
    )

    pace = StagePace()

    class TimeLeft(ProgressColumn):
        """The time left, as the lines have it."""

        def render(self, _task: object) -> Text:
            """Return the text of the column."""
            return Text("" if pace.time_left is None else f"about {duration(pace.time_left)} left")

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeLeft(),
    )
    bar = Progress(*columns, console=console, transient=True)
    task = bar.add_task("starting", total=None)

    def tell(what: str, done: int, total: int | None) -> None:
        silent.cancel()
        if what.startswith((*lines, SPEED_OF)):
            bar.console.print(wrapped(what), highlight=False)
            what, done, total = "at work", 0, None  # without an end, but with the time that goes by
        bar.start()  # not before there is work: an error in the input leaves nothing on the screen
        if total != pace.total or done < pace.done:  # other work
            bar.reset(task)
        pace.step(what, done, total)
        bar.update(task, description=escape(what), completed=done, total=total)

    silent = Timer(_SOON, tell, ("at work", 0, None))  # no work has been told of: a sign of life
    silent.daemon = True
    silent.start()
    try:
        yield tell
    finally:
        silent.cancel()
        bar.stop()
