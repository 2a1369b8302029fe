"""Papers by the name that a study file gives as `claims`.

A new paper is a folder beside `biorob2012`, an entry in each of the tables here, and its name in
`spirillum.studies.spec.Study.claims`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from spirillum.papers.biorob2012.claims import evaluated
from spirillum.papers.biorob2012.evidence import Claim
from spirillum.papers.biorob2012.figures import PAPER_FIGURES, more_figures
from spirillum.view.figures.picture import Picture
from spirillum.view.figures.study import study_figures

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["claims_of", "figures_of"]

_CLAIMS = {"biorob2012": evaluated}
_LAYOUTS = {"biorob2012": PAPER_FIGURES}
_FIGURES = {"biorob2012": more_figures}


def claims_of(dataset: xr.Dataset) -> list[Claim]:
    """Statements of the paper that a study names, each with its verdict; empty for a study that names none."""
    paper = str(dataset.attrs.get("claims"))
    return _CLAIMS[paper](dataset) if paper in _CLAIMS else []


def figures_of(dataset: xr.Dataset) -> dict[str, Picture]:
    """Figures of a study by file name, in the layout of the paper that it names, and that paper's own."""
    paper = str(dataset.attrs.get("claims"))
    own = _FIGURES[paper](dataset) if paper in _FIGURES else {}
    return {**study_figures(dataset, _LAYOUTS.get(paper)), **own}
