"""Write a study's figures, `claims.json`, `ranking.csv` and `report.html`, each whole or not at all."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from spirillum.files import write_text
from spirillum.papers.registry import claims_of, figures_of, predictions_of
from spirillum.results.page import draw_pictures, page
from spirillum.results.study_content import content, shown_ranking
from spirillum.results.study_robot import robot_picture
from spirillum.studies.ranking import StudyRanking, ranking_of, unit_of_ranked
from spirillum.view.figures.laid_down import laid_down_picture
from spirillum.view.figures.picture import Picture
from spirillum.view.figures.ranking import ranking_picture

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["write_report"]

_LARGEST_SVG = 2_000_000
"""A larger vector picture is embedded as pixels, bytes."""


def write_report(dataset: xr.Dataset, folder: Path, tell: Callable[[str, int, int], None]) -> None:
    """Write `figures/` (PNG and SVG), `claims.json`, `ranking.csv` and a self-contained `report.html`.

    Args:
        dataset: what `spirillum.study` returns.
        folder: existing folder of the study.
        tell: called with what is being done, steps done and steps in all.

    Raises:
        InputError: if the folder cannot be written to.
    """
    pictures = _pictures(dataset)
    steps = len(pictures) + 1
    embedded = draw_pictures(
        pictures, folder, lambda name, done: tell(f"figure {name}", done, steps), largest_svg=_LARGEST_SVG
    )
    tell("report", len(pictures), steps)
    claims, predictions = ([claim.to_dict() for claim in found(dataset)] for found in (claims_of, predictions_of))
    text = json.dumps(claims + predictions, indent=2, allow_nan=False, ensure_ascii=False)
    write_text(folder / "claims.json", text + "\n", replace="any")
    ranking = ranking_of(dataset)
    write_text(folder / "ranking.csv", _ranking_rows(ranking), replace="any")
    names = {
        "ranking": shown_ranking(ranking),
        "pictures": embedded,
        "claims": claims,
        "predictions": predictions,
        **content(dataset),
    }
    write_text(folder / "report.html", page("report.html.jinja", **names))
    tell("report", steps, steps)


def _pictures(dataset: xr.Dataset) -> dict[str, Picture]:
    """The ranking first, then the robot and the figures of the study."""
    ranking = ranking_of(dataset)
    robot = robot_picture(dataset, ranking)
    first = {"ranking": ranking_picture(ranking)} if ranking.robots else {}
    laid_down = laid_down_picture(dataset, ranking)
    drawn = {"robot": robot, "laid-down": laid_down}
    return {**first, **{name: picture for name, picture in drawn.items() if picture}, **figures_of(dataset)}


def _ranking_rows(ranking: StudyRanking) -> str:
    """The ranking as CSV, all of its robots; SI."""
    names = ranking.quantities
    header = ["rank", "robot", *(f"{name}{end}_{_COLUMN[unit_of_ranked(name)]}" for name in names for end in _ENDS)]
    table = io.StringIO()
    writer = csv.writer(table, lineterminator="\n")
    writer.writerow([title.rstrip("_") for title in header])
    for rank, robot in enumerate(ranking.robots, start=1):
        values = [of[name] for name in names for of in (robot.values, robot.low, robot.high)]
        writer.writerow([rank, robot.name, *("" if math.isnan(value) else repr(value) for value in values)])
    return table.getvalue()


_ENDS = ("", "_low", "_high")
_COLUMN = {"m/s": "m_s", "1": "", "A": "A", "W": "W"}
