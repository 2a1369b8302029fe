"""Common parts of reports: figures written into a folder and embedded in a page from a template."""

from __future__ import annotations

import base64
from collections.abc import Callable, Mapping
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from spirillum.files import output_folder

if TYPE_CHECKING:
    from concurrent.futures import Future, ProcessPoolExecutor

    from spirillum.view.figures.sheet import Picture


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
    """Write `figures/`, PNG and with `vector` also SVG, each file whole or not at all.

    Args:
        pictures: pictures by the names of their files.
        folder: folder of the report.
        on_progress: called with the name of a picture and the number of those before it.
        vector: write SVG too.
        largest_svg: size up to which an SVG is embedded, bytes.
        again: a function that a process can take, which returns the same pictures.
        beside: a process that draws every second picture with it.
    """
    figures = output_folder(folder / "figures", folder)
    theirs: dict[str, Future[list[Path]]] = {}
    if beside is not None and again is not None:
        beside.submit(_take_pictures, again)
        every_second = list(pictures)[1::2]
        theirs = {name: beside.submit(_draw_taken, name, figures, vector=vector) for name in every_second}
    written: dict[str, list[Path]] = {}
    for name in (*(name for name in pictures if name not in theirs), *reversed(theirs)):
        if name not in theirs or theirs[name].cancel():  # of those that the other process has not begun
            on_progress(name, len(written))
            written[name] = _drawn(pictures[name], figures / name, vector=vector)
    found = []
    for name, picture in pictures.items():
        try:
            paths = written[name] if name in written else theirs[name].result()
        except BrokenProcessPool:  # ended from outside, as for want of memory
            paths = _drawn(picture, figures / name, vector=vector)
        if vector and paths[-1].stat().st_size <= largest_svg:
            source = data_uri(paths[-1].read_bytes(), "svg+xml")
        else:
            source = data_uri(paths[0].read_bytes(), "png")
        files = tuple(f"figures/{path.name}" for path in paths)
        found.append(EmbeddedPicture(name, picture.title, picture.caption, picture.alternative, source, files))
    return found


def _drawn(picture: Picture, path: Path, *, vector: bool) -> list[Path]:
    from spirillum.view.figures.style import save

    return save(picture.figure(), path, vector=vector)


_TAKEN: dict[str, Picture] = {}
"""Pictures of a process that draws beside another one."""


def _take_pictures(again: Callable[[], Mapping[str, Picture]]) -> None:
    _TAKEN.update(again())


def _draw_taken(name: str, figures: Path, *, vector: bool) -> list[Path]:
    return _drawn(_TAKEN[name], figures / name, vector=vector)


def data_uri(picture: bytes, kind: str) -> str:
    """A picture as the source of an image in a page; `kind` as in `image/kind`."""
    return f"data:image/{kind};base64,{base64.b64encode(picture).decode('ascii')}"
