"""A large study cut into regions: blocks of robots that are computed, written and found again each by itself.

A region is one chunk of every variable of the dataset, so that no two of them ever write into one chunk.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import ceil, prod
from typing import NamedTuple

import numpy as np

from spirillum.fluid.registry import find_swimmer_model
from spirillum.studies.observed import ObservedArrays, observed_at
from spirillum.studies.study_loader import LoadedStudy
from spirillum.studies.work import BLOCK, Indices

_SOLVED_BLOCK, _PLACED_BLOCK = 128, 64
"""Robots of a region for a model that solves for the flow: some ten seconds of work; and for one that solves for body
and walls once, for all tails at one place."""


class RobotBlock(NamedTuple):
    """A block of robots."""

    number: int
    start: tuple[int, ...]
    """First place along each dimension of the robots."""
    stop: tuple[int, ...]
    """First place behind it."""

    @property
    def size(self) -> int:
        """Number of robots."""
        return prod(stop - start for start, stop in zip(self.start, self.stop, strict=True))

    @property
    def of_one(self) -> RobotBlock:
        """Its first robot alone."""
        return self._replace(stop=tuple(start + 1 for start in self.start))


@dataclass(frozen=True)
class Layout:
    """How a study is cut."""

    dimensions: tuple[str, ...]
    """Of the robots, as in the dataset."""
    shape: tuple[int, ...]
    chunk: tuple[int, ...]

    @property
    def count(self) -> int:
        """Number of regions."""
        return prod(ceil(size / part) for size, part in zip(self.shape, self.chunk, strict=True))

    def regions(self) -> Iterator[RobotBlock]:
        """All regions, in their order."""
        parts = tuple(ceil(size / part) for size, part in zip(self.shape, self.chunk, strict=True))
        for number, place in enumerate(np.ndindex(*parts)):
            start = tuple(at * part for at, part in zip(place, self.chunk, strict=True))
            ends = zip(start, self.chunk, self.shape, strict=True)
            yield RobotBlock(number, start, tuple(min(first + part, size) for first, part, size in ends))

    def indices(self, region: RobotBlock) -> Indices:
        """Indices of a region's robots in the flat order of the study."""
        along = [np.arange(first, last) for first, last in zip(region.start, region.stop, strict=True)]
        found: Indices = np.ravel_multi_index(np.meshgrid(*along, indexing="ij"), self.shape).ravel()
        return found


def layout_of(loaded: LoadedStudy) -> Layout:
    """Cut a study: one channel, and as many whole rows of amplitudes as make a block; or a block of listed robots."""
    models = [find_swimmer_model(name) for name in loaded.study.models]
    block = BLOCK if all(model.closed_form for model in models) else _SOLVED_BLOCK
    if any(model.placed for model in models):
        block = _PLACED_BLOCK
    grid = loaded.study.grid
    if grid is None:
        count = len(loaded.robots)
        return Layout(("robot",), (count,), (min(block, count),))
    shape = (len(grid.channels), len(grid.wavelengths), len(grid.amplitudes))
    amplitudes = min(block, shape[2])
    wavelengths = min(max(block // amplitudes, 1), shape[1])
    return Layout(("channel", "wavelength", "amplitude"), shape, (1, wavelengths, amplitudes))


def cut(
    loaded: LoadedStudy, observed: ObservedArrays | None, layout: Layout, region: RobotBlock
) -> tuple[LoadedStudy, ObservedArrays | None]:
    """The part of a study that a region is: a study of its own, without what it does not need."""
    grid, study = loaded.study.grid, loaded.study
    parts = [slice(start, stop) for start, stop in zip(region.start, region.stop, strict=True)]
    if grid is not None:
        channels = dict(list(grid.channels.items())[parts[0]])
        tails = {"wavelengths": grid.wavelengths[parts[1]], "amplitudes": grid.amplitudes[parts[2]]}
        small = study.model_copy(update={"grid": grid.model_copy(update={"channels": channels, **tails})})
    else:
        small = study.model_copy(update={"robots": (study.robots or [])[parts[0]]})
    own = replace(
        loaded,
        study=small,
        robots=loaded.robots[parts[0]],
        placements=loaded.placements[parts[0]],
        question={},
        cautions=(),
    )
    return own, None if observed is None else observed_at(observed, layout.indices(region))
