"""The paper's quantitative statements beside what a study computes, each with a verdict and its reason."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

from spirillum.papers.biorob2012 import claims_predicted, claims_swimming
from spirillum.papers.biorob2012.evidence import Evidence
from spirillum.papers.claim import Claim

if TYPE_CHECKING:
    import xarray as xr


def claims_of_study(dataset: xr.Dataset) -> list[Claim]:
    """Compare a study that names this paper with its statements; empty for one of other channels."""
    if not _of_this_paper(dataset):
        return []
    evidence = Evidence(dataset)
    sources: tuple[Callable[[Evidence], Iterator[Claim]], ...] = (
        claims_swimming.reynolds_numbers,
        claims_swimming.velocity_drops,
        claims_swimming.global_drop,
        claims_swimming.trends,
        claims_swimming.body_rotation,
        claims_swimming.motor_rates,
        claims_swimming.effective_friction,
        claims_swimming.model_comparison,
        claims_predicted.calibration_factors,
        claims_predicted.robot_and_channel,
        claims_predicted.method,
    )
    return [claim for source in sources for claim in source(evidence)]


def predictions_of_study(dataset: xr.Dataset) -> list[Claim]:
    """Evaluate the statements for released robots, verdicts of a third kind; empty without such robots."""
    return claims_predicted.predicted(Evidence(dataset)) if _of_this_paper(dataset) else []


def _of_this_paper(dataset: xr.Dataset) -> bool:
    """Whether a study has the paper's channels."""
    if "channel" not in dataset.dims:
        return False
    return {"wide", "narrow"} <= {str(name) for name in dataset["channel"].values}
