"""Resistances over gap and pitch, for a model that computes the walls.

Such a model takes seconds for each tail and place, far too long for every draw. It is solved at Chebyshev points over
the places that are possible, for all robots of the experiment, and interpolated between them by polynomials, over the
logarithm of the gap. The points are solved as coarsely as a band. At one more place in between it is solved too, as
coarsely and as finely as `predict` does: how far the interpolated predictions are off there is the stated error, in
which both the interpolation and the resolution are. The model keeps what it has solved, so that the next fit of the
same robots starts at once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import product

import numpy as np

from spirillum.calibration.forward import Forward, TableError, axis_points, tabulated
from spirillum.errors import InputError
from spirillum.fluid.model import SwimmerModel
from spirillum.robot.batch import RobotBatch
from spirillum.robot.placement import Placement
from spirillum.swimming.band import at_place, band_places

__all__ = ["Ranges", "place_ranges", "tube_forward"]

_POINTS = {"gap": 4, "pitch": 3}
_CHECKED_AT = {"gap": 0.36, "pitch": 0.3}
"""Where the interpolation is checked, as a share of each range: away from all points."""

Ranges = dict[str, tuple[float, float]]


def place_ranges(batch: RobotBatch, model: SwimmerModel) -> Ranges:
    """Gaps and pitches that every robot of a batch allows: ends of the bands of `predict`.

    Args:
        batch: the robots.
        model: a model that computes the walls.
    """
    gaps, pitches = [], []
    for _, one in batch.blocks(1):
        places = band_places(one.placed(Placement()), model)
        own = sorted({place.gap or 0.0 for place in places})
        gaps.append((own[0], own[-1]))
        # The steepest pitch depends on the gap; what holds at every gap is the least of them.
        pitches.append(min(max(p.pitch or 0.0 for p in places if p.gap == gap) for gap in own))
    return {"gap": (max(low for low, _ in gaps), min(high for _, high in gaps)), "pitch": (0.0, min(pitches))}


def tube_forward(
    model: SwimmerModel, batch: RobotBatch, names: Sequence[str], tell: Callable[[str, int, int], None]
) -> tuple[Forward, Ranges, TableError]:
    """Solve the model over the places, and check interpolation and resolution.

    Args:
        model: a model that computes the walls.
        batch: the robots of the experiment.
        names: which of `gap` and `pitch` are free; one that is not is the model's reference gap, or level.
        tell: told what is being computed.

    Returns:
        The forward model, the ranges of what is free, and the largest relative errors of a prediction.

    Raises:
        InputError: if the robots share no place.
    """
    viscosity = batch.viscosity
    if not names:
        tell(f"{model.name}, {batch.size} robots", 0, 1)
        return Forward(tabulated([_at(batch, {})], model), batch.electrics, viscosity), {}, TableError()
    ranges = {name: ends for name, ends in place_ranges(batch, model).items() if name in names}
    for name, (low, high) in ranges.items():
        if not low < high:
            raise InputError(
                f"free = '{name}': the robots share no range of it; allowed: robots that fit their channels"
            )
    ordered = [name for name in ("gap", "pitch") if name in names]
    axes = [axis_points(name, _POINTS[name], *ranges[name]) for name in ordered]
    every = [dict(zip(ordered, point, strict=True)) for point in product(*(values.tolist() for _, values in axes))]

    def points() -> Iterator[RobotBatch]:
        for done, place in enumerate(every):
            tell(f"{model.name}, {_words(place)}", done, len(every) + 2)
            yield _at(batch, place)

    table = tabulated(points(), model, ordered, [nodes for nodes, _ in axes])
    forward = Forward(table, batch.electrics, viscosity)
    between = {name: _between(name, *ranges[name]) for name in ordered}
    there = {name: np.full((1, 1), value) for name, value in between.items()}
    tell(f"{model.name}, {_words(between)}: a check", len(every), len(every) + 2)
    coarse = Forward(tabulated([_at(batch, between)], model), batch.electrics, viscosity)
    tell(f"{model.name}, {_words(between)}: a check at full resolution", len(every) + 1, len(every) + 2)
    fine = Forward(tabulated([batch.placed(_place(between))], model), batch.electrics, viscosity)
    error = TableError(
        interpolation=forward.interpolation_error(coarse, there),
        resolution=coarse.interpolation_error(fine, {}),
        total=forward.interpolation_error(fine, there),
    )
    return forward, ranges, error


def _at(batch: RobotBatch, place: dict[str, float]) -> RobotBatch:
    """The robots at a place, resolved as finely as a band needs."""
    return at_place(batch, _place(place))


def _place(place: dict[str, float]) -> Placement:
    return Placement().model_copy(update={"pitch": 0.0, **place})


def _between(name: str, low: float, high: float) -> float:
    share = _CHECKED_AT[name]
    return float(low * (high / low) ** share) if name == "gap" else low + share * (high - low)


def _words(place: dict[str, float]) -> str:
    said = {"gap": lambda v: f"gap {1e3 * v:.3g} mm", "pitch": lambda v: f"pitch {np.degrees(v):.3g} deg"}
    return ", ".join(said[name](value) for name, value in place.items())
