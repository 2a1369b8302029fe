"""Common parts of reports: figures written into a folder and embedded in a page from a template."""

from __future__ import annotations

import base64
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from spirillum.files import output_folder

if TYPE_CHECKING:
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
) -> list[EmbeddedPicture]:
    """Write `figures/`, PNG and with `vector` also SVG, each file whole or not at all."""
    from spirillum.view.figures.style import save

    figures = output_folder(folder / "figures", folder)
    found = []
    for done, (name, picture) in enumerate(pictures.items()):
        on_progress(name, done)
        paths = save(picture.figure(), figures / name, vector=vector)
        if vector and paths[-1].stat().st_size <= largest_svg:
            source = data_uri(paths[-1].read_bytes(), "svg+xml")
        else:
            source = data_uri(paths[0].read_bytes(), "png")
        files = tuple(f"figures/{path.name}" for path in paths)
        found.append(EmbeddedPicture(name, picture.title, picture.caption, picture.alternative, source, files))
    return found


def data_uri(picture: bytes, kind: str) -> str:
    """A picture as the source of an image in a page; `kind` as in `image/kind`."""
    return f"data:image/{kind};base64,{base64.b64encode(picture).decode('ascii')}"
