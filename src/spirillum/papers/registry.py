"""Papers by the name that a study file gives as `claims`.

A new paper is a folder beside `biorob2012`, one entry of `_PAPERS` and of `_STUDIES` in `spirillum.papers.studies`, and
its name in `spirillum.studies.spec.Study.claims`.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import TYPE_CHECKING, NamedTuple

from spirillum.papers.biorob2012.claims_predicted import claims_of_study, predictions_of_study
from spirillum.papers.claim import Claim

if TYPE_CHECKING:
    import xarray as xr

    from spirillum.view.figures.sheet import Picture


class Paper(NamedTuple):
    """Claims and figures of a paper for a study that names it."""

    claims: Callable[[xr.Dataset], list[Claim]]  #: Its statements, each with its verdict.
    predictions: Callable[[xr.Dataset], list[Claim]]  #: Its statements with verdicts from released robots.
    figures: str  #: Module with `PAPER_FIGURES`, the layout of its channels' figures, and `more_figures`.


_PAPERS = {"biorob2012": Paper(claims_of_study, predictions_of_study, "spirillum.papers.biorob2012.figures")}


def _paper_of(dataset: xr.Dataset) -> Paper | None:
    return _PAPERS.get(str(dataset.attrs.get("claims")))


def claims_of(dataset: xr.Dataset) -> list[Claim]:
    """Statements of the paper that a study names, each with its verdict; empty for a study that names none."""
    paper = _paper_of(dataset)
    return paper.claims(dataset) if paper else []


def predictions_of(dataset: xr.Dataset) -> list[Claim]:
    """Statements of the paper with verdicts from released robots; empty without such robots."""
    paper = _paper_of(dataset)
    return paper.predictions(dataset) if paper else []


def figures_of(dataset: xr.Dataset) -> dict[str, Picture]:
    """Figures of a study by file name, in the layout of the paper that it names, and that paper's own."""
    from spirillum.view.figures.study import study_figures

    paper = _paper_of(dataset)
    if paper is None:
        return study_figures(dataset)
    own = import_module(paper.figures)
    return {**study_figures(dataset, own.PAPER_FIGURES), **own.more_figures(dataset)}
