"""Common parts of reports: figures written into a folder and embedded in a page from a template."""

from __future__ import annotations

import base64
from collections.abc import Callable, Mapping
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from spirillum.errors import InputError
from spirillum.files import output_folder

if TYPE_CHECKING:
    from concurrent.futures import Future, ProcessPoolExecutor

    from matplotlib.figure import Figure

    from spirillum.view.figures.sheet import Picture


Drawings = Mapping[str, "Callable[[], Figure]"]  #: Functions that draw figures, by the names of their files.


@dataclass(frozen=True)
class EmbeddedPicture:
    """A figure as a page shows it."""

    name: str
    title: str
    caption: str
    alternative: str
    source: str  #: The picture itself as a data URI.
    files: tuple[str, ...]  #: Its files, as seen from the folder of the report: the PNG, then the SVG if there is one.


def draw_pictures(
    pictures: Mapping[str, Picture],
    folder: Path,
    on_progress: Callable[[str, int], None],
    *,
    vector: bool = False,
    largest_svg: int = 0,
    again: Callable[[], Mapping[str, Picture]] | None = None,
    beside: ProcessPoolExecutor | None = None,
) -> list[EmbeddedPicture]:
    """Write `figures/` of a report, PNG and with `vector` also SVG; embed an SVG of at most `largest_svg` bytes."""
    # `again` is a function that a process can take, which returns the same pictures; the one `beside` draws with it.
    figures = output_folder(folder / "figures", folder)
    drawings = {name: picture.figure for name, picture in pictures.items()}
    shared = None if again is None else partial(_drawings_of, again)
    written = draw_together(drawings, figures, on_progress, vector=vector, again=shared, beside=beside)
    found = []
    for name, picture in pictures.items():
        paths = written[name]
        try:
            if vector and paths[-1].stat().st_size <= largest_svg:
                source = data_uri(paths[-1].read_bytes(), "svg+xml")
            else:
                source = data_uri(paths[0].read_bytes(), "png")
        except FileNotFoundError as error:
            raise InputError(
                f"{error.filename} was removed while the report was written; allowed: to leave it"
            ) from error
        files = tuple(f"figures/{path.name}" for path in paths)
        found.append(EmbeddedPicture(name, picture.title, picture.caption, picture.alternative, source, files))
    return found


def _drawings_of(again: Callable[[], Mapping[str, Picture]]) -> Drawings:
    return {name: picture.figure for name, picture in again().items()}


def draw_together(
    drawings: Drawings,
    figures: Path,
    on_progress: Callable[[str, int], None],
    *,
    vector: bool = False,
    again: Callable[[], Drawings] | None = None,
    beside: ProcessPoolExecutor | None = None,
) -> dict[str, list[Path]]:
    """Write figures by name into a folder, every second one in the process beside this one; return their files."""
    from spirillum.view.figures.style import save, save_drawn

    with TemporaryDirectory() as elsewhere:  # this process alone writes into the folder: the other one may be ended
        theirs: dict[str, Future[list[Path]]] = {}
        if beside is not None and again is not None:
            with suppress(BrokenProcessPool):  # ended from outside, as for want of memory
                beside.submit(_take_drawings, again)
                for name in list(drawings)[1::2]:
                    theirs[name] = beside.submit(_draw_taken, name, Path(elsewhere), vector=vector)
        written: dict[str, list[Path]] = {}
        for name in (*(name for name in drawings if name not in theirs), *reversed(theirs)):
            if name not in theirs or theirs[name].cancel():  # of those that the other process has not begun
                on_progress(name, len(written))
                written[name] = save(drawings[name](), figures / name, vector=vector)
        for name in drawings.keys() - written.keys():
            if theirs[name].exception() is None:
                written[name] = save_drawn(theirs[name].result(), figures)
            else:
                written[name] = save(drawings[name](), figures / name, vector=vector)
    return {name: written[name] for name in drawings}


_TAKEN: dict[str, Callable[[], Figure]] = {}  # Figures of a process that draws beside another one.


def _take_drawings(again: Callable[[], Drawings]) -> None:
    _TAKEN.update(again())


def _draw_taken(name: str, figures: Path, *, vector: bool) -> list[Path]:
    from spirillum.view.figures.style import save

    return save(_TAKEN[name](), figures / name, vector=vector)


def load_figures(*modules: str) -> None:
    """Load modules, and fonts and the parser of formulas, in a process that draws beside this one."""
    for module in modules:
        import_module(module)
    from spirillum.view.figures.sheet import Sheet
    from spirillum.view.figures.style import styled

    with styled():
        Sheet("$x$", "", heights=[1.0]).finished()


def data_uri(picture: bytes, kind: str) -> str:
    """A picture as the source of an image in a page; `kind` as in `image/kind`."""
    return f"data:image/{kind};base64,{base64.b64encode(picture).decode('ascii')}"
