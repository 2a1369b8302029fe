"""How long a large study takes, from the pace of its first regions, and how much memory, from a few of its robots."""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable
from math import prod
from time import monotonic
from typing import NamedTuple

from spirillum.fluid.registry import find_swimmer_model, quickest
from spirillum.processes import AHEAD, memory_in_use
from spirillum.studies.observed import ObservedArrays
from spirillum.studies.regions import Layout, Plan, RegionJob, RobotBlock, cut, encoded_region, layout_of, plan_of
from spirillum.studies.study_loader import LoadedStudy
from spirillum.studies.work import groups
from spirillum.worker_pool import ESTIMATE, WorkerPool

_FEW, _MORE = 200, 2000
"""Robots that are computed to know the memory of the rest of them."""
_SOLVING_MEMORY = 5e8
"""Of a solve of body and walls, bytes; measured for the paper's robot."""


_ROUNDS, _LEAST_TIME = 3, 2.0
"""Regions of every process behind its first one, and time in s, from which a pace is taken."""


class Pace:
    """The time that a study takes as a whole, from when its regions are done."""

    def __init__(self, robots: int, workers: int, clock: Callable[[], float] = monotonic) -> None:
        """The study begins.

        Args:
            robots: number of robots to compute.
            workers: number of processes.
            clock: time, s.
        """
        self._robots, self._workers, self._clock = robots, workers, clock
        self._start = self._from = clock()
        self._regions = self._done = self._before = 0

    def seconds(self, robots: int) -> float | None:
        """Take note of a region that is done, and return the time from begin to end, s; None: not known yet.

        The first region of every process is left out of the pace: before it, the process loads what it needs.
        """
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
    memory: float
    """Most that all processes of this machine take together, bytes."""
    disk: float
    """Of the results before compression, bytes."""
    workers: int

    def words(self, seconds: float) -> str:
        """Return the estimate in a line.

        Args:
            seconds: time that the study takes, s.
        """
        return (
            f"{ESTIMATE}{self.results} results, about {_duration(seconds)} with {self.workers} "
            f"worker{'' if self.workers == 1 else 's'}, {self.memory / 1e6:.0f} MB of memory here, at most "
            f"{self.disk / 1e6:.0f} MB on disk"
        )


def _duration(seconds: float) -> str:
    if seconds < 120.0:
        return f"{max(seconds, 1.0):.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 7200.0 else f"{seconds / 3600.0:.1f} h"


_LARGE = 20_000
"""Robots in closed form below which a study takes less time than its estimate."""


def is_large(loaded: LoadedStudy) -> bool:
    """Whether a study takes long enough to be estimated."""
    models = [find_swimmer_model(name) for name in loaded.study.models]
    return loaded.count * len(models) >= _LARGE or not all(model.closed_form for model in models)


class _Cost(NamedTuple):
    memory: float
    encoded: float
    """Size of a region's files, bytes."""


def estimate_of(
    loaded: LoadedStudy, observed: ObservedArrays | None, plan: Plan, missing: int, crew: WorkerPool
) -> CostEstimate:
    """Estimate what is missing of a study."""
    cost = _tried(loaded, observed, plan) if missing else _Cost(0.0, 0.0)
    workers, base = crew.size, memory_in_use()
    alone = crew.cluster is None and (workers == 1 or missing < 2)
    here = base + (cost.memory if alone else AHEAD * workers * cost.encoded)
    others = 0 if alone or crew.cluster is not None else min(workers, missing)
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
