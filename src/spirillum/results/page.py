"""Common parts of reports: figures written into a folder and embedded in a page from a template."""

from __future__ import annotations

import base64
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

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

    @property
    def files(self) -> tuple[str, str]:
        """Names of its files, as seen from the folder of the report."""
        return f"figures/{self.name}.png", f"figures/{self.name}.svg"


def draw_pictures(
    pictures: Mapping[str, Picture], folder: Path, on_progress: Callable[[str, int], None], *, largest_svg: int = 0
) -> list[EmbeddedPicture]:
    """Write `figures/` (PNG and SVG), each file whole or not at all."""
    from spirillum.view.figures.style import save

    figures = output_folder(folder / "figures", folder)
    found = []
    for done, (name, picture) in enumerate(pictures.items()):
        on_progress(name, done)
        png, svg = save(picture.figure(), figures / name)
        if svg.stat().st_size <= largest_svg:
            source = data_uri(svg.read_bytes(), "svg+xml")
        else:
            source = data_uri(png.read_bytes(), "png")
        found.append(EmbeddedPicture(name, picture.title, picture.caption, picture.alternative, source))
    return found


def data_uri(picture: bytes, kind: str) -> str:
    """A picture as the source of an image in a page; `kind` as in `image/kind`."""
    return f"data:image/{kind};base64,{base64.b64encode(picture).decode('ascii')}"


def page(template: str, **names: Any) -> str:
    """A page from a template of this package, with its text escaped."""
    return rendered(template, {}, escaped=True, **names)


def rendered(template: str, filters: Mapping[str, Callable[..., str]], *, escaped: bool = False, **names: Any) -> str:
    """The text of a template of this package, every name of which has to be given."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("spirillum.results", ""),
        autoescape=escaped,  # noqa: S701 - a table of numbers is no page
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=not escaped,
    )
    environment.filters.update(filters)
    return environment.get_template(template).render(**names)
