"""Regions of a large study: blocks of robots that are computed, written and found again; their time and memory.

A region is one chunk of every variable, so that no two regions share a chunk.
"""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import ceil, prod
from time import monotonic
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from spirillum.envelope import as_json
from spirillum.files import Stored, chunk_key, region_files
from spirillum.fluid.registry import find_swimmer_model, quickest
from spirillum.studies.dataset import cautions, coordinates_of, labelled_answers
from spirillum.studies.study_loader import LoadedStudy, ObservedArrays, observed_at
from spirillum.studies.work import AT_RATES, BLOCK, WITH_INTERVALS, Indices, Part, groups, one_thread_each, tasks
from spirillum.swimming.motions import STEADY
from spirillum.worker_pool import AHEAD, ESTIMATE, WorkerPool, memory_in_use

if TYPE_CHECKING:
    import xarray as xr


_SOLVED_BLOCK, _PLACED_BLOCK = 128, 64
"""Robots of a region for a model that solves for the flow: some ten seconds of work; and for one that solves for body
and walls once, for all tails at one pose.
"""


class RobotBlock(NamedTuple):
    """A block of robots."""

    number: int
    start: tuple[int, ...]  #: First index along each dimension of the robots.
    stop: tuple[int, ...]  #: First index behind it.

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

    dimensions: tuple[str, ...]  #: Of the robots, as in the dataset.
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
        return np.ravel_multi_index(np.meshgrid(*along, indexing="ij"), self.shape).ravel()


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
        loaded, study=small, robots=loaded.robots[parts[0]], placements=loaded.placements[parts[0]], question={}
    )
    return own, None if observed is None else observed_at(observed, layout.indices(region))


_LAST = "outside"  # the variable whose chunk is written last: it marks a complete region


class Plan(NamedTuple):
    """What a store of a study holds."""

    layout: Layout
    variables: Mapping[str, Stored]
    coordinates: Mapping[str, np.ndarray[Any, Any]]  #: Variables that it holds whole.
    others: tuple[str, ...]  #: Coordinates that are no dimension.

    @property
    def regional(self) -> tuple[str, ...]:
        """Variables that are written by regions, the last one last."""
        return (*(name for name in self.variables if name not in (*self.coordinates, _LAST)), _LAST)

    @property
    def bytes_of_results(self) -> int:
        """Size of all variables before compression."""
        items = [item for item in self.variables.values() if item.dtype != "str"]
        return int(sum(np.prod(item.shape, dtype=float) * np.dtype(item.dtype).itemsize for item in items))

    def place(self, name: str, region: RobotBlock) -> list[tuple[int, int]]:
        """Slices of a region in a variable: its robots, and all of the dimensions behind them."""
        own = list(zip(region.start, region.stop, strict=True))
        return own + [(0, size) for size in self.variables[name].shape[len(own) :]]

    def note(self, region: RobotBlock) -> str:
        """Path within the store of a region's notes, while the study runs."""
        return f"notes/{region.number:07d}.json"

    def pieces(self, region: RobotBlock) -> list[str]:
        """Paths within the store of all files of a region, in the order in which they are written."""
        keys = [chunk_key(name, self.variables[name], self.place(name, region)) for name in self.regional]
        return [*keys[:-1], self.note(region), keys[-1]]


class RegionJob(NamedTuple):
    """A region with all that it is computed from."""

    region: RobotBlock
    loaded: LoadedStudy  #: The study of its robots.
    observed: ObservedArrays | None
    plan: Plan  #: Without values.


def plan_of(loaded: LoadedStudy, observed: ObservedArrays | None, layout: Layout) -> Plan:
    """What a store of a study holds: known before anything is computed."""
    import xarray as xr

    own, seen = cut(loaded, observed, layout, next(layout.regions()).of_one)
    empty = _empty(loaded, observed)
    template = labelled_answers(own, [(task, empty) for task in tasks(own)], observed=seen)
    whole = xr.Dataset(coords=coordinates_of(loaded))
    robots = len(layout.dimensions)
    variables = {}
    for name, array in whole.coords.items():
        variables[str(name)] = Stored(tuple(map(str, array.dims)), array.shape, array.shape, _kind(array), array.attrs)
    for name, array in template.data_vars.items():
        shape = (*layout.shape, *array.shape[robots:])
        chunk = (*layout.chunk, *array.shape[robots:])
        variables[str(name)] = Stored(tuple(map(str, array.dims)), shape, chunk, _kind(array), array.attrs)
    coordinates = {str(name): array.values for name, array in whole.coords.items()}
    return Plan(layout, variables, coordinates, tuple(str(name) for name in whole.coords if name not in whole.dims))


def _kind(array: xr.DataArray) -> str:
    return "str" if array.dtype.kind in "OUS" else str(array.dtype)


def _empty(loaded: LoadedStudy, observed: ObservedArrays | None) -> Part:
    """An answer without values, with all the arrays that any robot of the study may have."""
    models, rates = loaded.study.models, loaded.study.assumed_motor_rates
    empty = np.full((1, len(loaded.study.friction)), np.nan)
    part: Part = {item.name: empty for item in STEADY}
    if any(not find_swimmer_model(name).closed_form for name in models):
        part["error_estimate"] = empty
    part["outside"] = np.zeros_like(empty)
    if loaded.fit.posterior is not None and loaded.fit.posterior.model in models:
        part |= {f"{name}_interval_{end}": empty for name in WITH_INTERVALS for end in ("low", "high")}
    if observed is not None:
        part |= {f"{name}_at_observed_rate": empty for name in AT_RATES}
    if rates and any(robot.motor and robot.battery for robot in loaded.robots):
        part |= {f"{name}_at_assumed_rate": np.repeat(empty[..., None], len(rates), axis=-1) for name in AT_RATES}
    return part


def region_jobs(
    loaded: LoadedStudy, observed: ObservedArrays | None, plan: Plan, regions: Sequence[RobotBlock]
) -> Iterator[RegionJob]:
    """Regions with what they are computed from, made as they are taken."""
    light = plan._replace(coordinates=dict.fromkeys(plan.coordinates, np.zeros(0)))
    for region in regions:
        yield RegionJob(region, *cut(loaded, observed, plan.layout, region), light)


def encoded_region(job: RegionJob) -> dict[str, bytes]:
    """Compute a region: its files by their paths within the store, in the order in which they are written."""
    region, loaded, observed, plan = job
    with one_thread_each(*loaded.study.models):
        answers = [(task, task.answer(loaded, observed)) for task in tasks(loaded)]
    dataset = labelled_answers(loaded, answers, observed=observed)
    places = {name: plan.place(name, region) for name in plan.regional}
    values = {}
    for name in plan.regional:
        shape = tuple(stop - start for start, stop in places[name])
        values[name] = np.broadcast_to(dataset[name].values, shape) if name in dataset else np.full(shape, np.nan)
    files = region_files(plan.variables, values, places)
    note = {
        "cautions": [list(caution) for pair in answers for caution in cautions(*pair)],
        "unanswered": int(np.count_nonzero(values[_LAST])),
    }
    files[plan.note(region)] = as_json(note).encode()
    return {key: files[key] for key in plan.pieces(region)}


_FEW, _MORE = 200, 2000  # robots that are computed to estimate the memory of the rest
_SOLVING_MEMORY = 5e8  # of a solve of body and walls, bytes; measured for the paper's robot


_ROUNDS, _LEAST_TIME = 3, 2.0  # regions of a process behind its first one, and time, s, from which a pace is taken


class Pace:
    """The time that a study takes as a whole, from when its regions are done."""

    def __init__(self, robots: int, workers: int, clock: Callable[[], float] = monotonic) -> None:
        self._robots, self._workers, self._clock = robots, workers, clock
        self._start = self._from = clock()
        self._regions = self._done = self._before = 0

    def seconds(self, robots: int) -> float | None:
        """Take note of a region that is done, and return the time from begin to end, s; None: not known yet."""
        # The first region of every process is left out of the pace: before it, the process loads what it needs.
        now = self._clock()
        self._regions, self._done = self._regions + 1, self._done + robots
        if self._regions == self._workers:
            self._from, self._before = now, self._done
        if self._regions < (1 + _ROUNDS) * self._workers or now - self._from < _LEAST_TIME:
            return None
        rate = (self._done - self._before) / (now - self._from)
        return now - self._start + (self._robots - self._done) / rate


class CostEstimate(NamedTuple):
    """What a study takes beside its time."""

    results: int
    memory: float  #: Most that all processes of this machine take together, bytes.
    disk: float  #: Of the results before compression, bytes.
    workers: int

    def words(self, seconds: float) -> str:
        """Return the estimate in a line."""
        return (
            f"{ESTIMATE}{self.results} results, about {_duration(seconds)} with {self.workers} "
            f"worker{'' if self.workers == 1 else 's'}, {self.memory / 1e6:.0f} MB of memory here, at most "
            f"{self.disk / 1e6:.0f} MB on disk"
        )


def _duration(seconds: float) -> str:
    if seconds < 120.0:
        return f"{max(seconds, 1.0):.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 7200.0 else f"{seconds / 3600.0:.1f} h"


_LARGE = 20_000  # robots in closed form below which a study takes less time than its estimate


def is_large(loaded: LoadedStudy) -> bool:
    """Whether a study takes long enough to be estimated."""
    models = [find_swimmer_model(name) for name in loaded.study.models]
    return loaded.count * len(models) >= _LARGE or not all(model.closed_form for model in models)


class _Cost(NamedTuple):
    memory: float
    encoded: float  #: Size of a region's files, bytes.


def estimate_of(
    loaded: LoadedStudy, observed: ObservedArrays | None, plan: Plan, missing: int, pool: WorkerPool
) -> CostEstimate:
    """Estimate what is missing of a study."""
    cost = _tried(loaded, observed, plan) if missing else _Cost(0.0, 0.0)
    workers, base = pool.size, memory_in_use()
    alone = pool.cluster is None and (workers == 1 or missing < 2)
    here = base + (cost.memory if alone else AHEAD * workers * cost.encoded)
    others = 0 if alone or pool.cluster is not None else min(workers, missing)
    return CostEstimate(
        results=loaded.study.size,
        memory=here + others * (base + cost.memory),
        disk=plan.bytes_of_results,
        workers=workers,
    )


def _tried(loaded: LoadedStudy, observed: ObservedArrays | None, plan: Plan) -> _Cost:
    """Memory of a region of full size."""
    layout = plan.layout
    first = next(layout.regions())
    slow = [name for name in loaded.study.models if not _is_quick(name, loaded)]
    if slow:
        readings = len(loaded.study.friction)
        return _Cost(_SOLVING_MEMORY, plan.bytes_of_results / loaded.count / readings * first.size)
    small, large = (_job(loaded, observed, layout, first, count) for count in (_FEW, _MORE))
    few = _traced(small)
    if large.region.size == small.region.size:
        return few
    more = _traced(large)
    share = (first.size - small.region.size) / (large.region.size - small.region.size)
    return _Cost(*(max(a + (b - a) * share, a) for a, b in zip(few, more, strict=True)))


def _is_quick(name: str, loaded: LoadedStudy) -> bool:
    """Whether a model answers in closed form, or from a table."""
    model = find_swimmer_model(name)
    if model.closed_form:
        return True
    layout = layout_of(loaded)
    one = cut(loaded, None, layout, next(layout.regions()).of_one)[0]
    return all(quickest(model, batch) is not model for _, batch in groups(one))


def _job(
    loaded: LoadedStudy, observed: ObservedArrays | None, layout: Layout, first: RobotBlock, count: int
) -> RegionJob:
    """The first region, with about so many of its robots."""
    stop = list(first.stop)
    for axis in range(len(stop)):
        stop[axis] = min(stop[axis], max(count // prod(stop[axis + 1 :]), 1))
    own, seen = cut(loaded, observed, layout, first._replace(stop=tuple(stop)))
    plan = plan_of(own, seen, layout_of(own))
    return RegionJob(next(plan.layout.regions()), own, seen, plan)


def _traced(job: RegionJob) -> _Cost:
    """One region: once to load what it needs, once for the memory."""
    encoded_region(job)
    tracemalloc.start()
    try:
        files = encoded_region(job)
        return _Cost(float(tracemalloc.get_traced_memory()[1]), float(sum(map(len, files.values()))))
    finally:
        tracemalloc.stop()
