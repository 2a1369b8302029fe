"""Write a study's figures, `claims.json` and `report.html`, each whole or not at all."""

from __future__ import annotations

import base64
import json
from collections.abc import Callable
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

from spirillum.files import output_folder, write_text
from spirillum.papers.registry import claims_of, figures_of
from spirillum.results.study_content import content
from spirillum.results.study_robot import robot_picture
from spirillum.view.figures.picture import Picture
from spirillum.view.figures.style import save

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["EmbeddedPicture", "write_report"]

_LARGEST_SVG = 2_000_000
"""A larger vector picture is embedded as pixels, bytes."""


@dataclass(frozen=True)
class EmbeddedPicture:
    """A figure as the page shows it."""

    name: str
    title: str
    caption: str
    alternative: str
    source: str
    """The picture itself as a data URI."""


def write_report(dataset: xr.Dataset, folder: Path, tell: Callable[[str, int, int], None]) -> None:
    """Write `figures/` (PNG and SVG), `claims.json` and a self-contained `report.html`.

    Args:
        dataset: what `spirillum.study` returns.
        folder: existing folder of the study.
        tell: called with what is being done, steps done and steps in all.

    Raises:
        InputError: if the folder cannot be written to.
    """
    pictures = _pictures(dataset)
    figures = output_folder(folder / "figures")
    steps = len(pictures) + 1
    embedded = []
    for done, (name, picture) in enumerate(pictures.items()):
        tell(f"figure {name}", done, steps)
        embedded.append(_drawn(name, picture, figures))
    tell("report", len(pictures), steps)
    claims = [claim.to_dict() for claim in claims_of(dataset)]
    write_text(folder / "claims.json", json.dumps(claims, indent=2, allow_nan=False, ensure_ascii=False) + "\n")
    write_text(folder / "report.html", _page(dataset, embedded, claims))
    tell("report", steps, steps)


def _pictures(dataset: xr.Dataset) -> dict[str, Picture]:
    """The robot first, then the figures of the study."""
    robot = robot_picture(dataset)
    return {**({"robot": robot} if robot else {}), **figures_of(dataset)}


def _drawn(name: str, picture: Picture, figures: Path) -> EmbeddedPicture:
    png, svg = save(picture.figure(), figures / name)
    vector = svg.stat().st_size <= _LARGEST_SVG
    data = base64.b64encode((svg if vector else png).read_bytes()).decode("ascii")
    source = f"data:image/{'svg+xml' if vector else 'png'};base64,{data}"
    return EmbeddedPicture(name, picture.title, picture.caption, picture.alternative, source)


def _page(dataset: xr.Dataset, pictures: list[EmbeddedPicture], claims: list[dict[str, str]]) -> str:
    from jinja2 import Environment, StrictUndefined

    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    template = (files("spirillum.results") / "report.html.jinja").read_text(encoding="utf-8")
    return environment.from_string(template).render(pictures=pictures, claims=claims, **content(dataset))
