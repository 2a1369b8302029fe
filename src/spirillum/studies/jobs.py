"""Work of a study as it is sent to other processes and machines: a task with what its answer needs, and no more."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from spirillum.fluid.registry import find_swimmer_model
from spirillum.kernels.compiled import rows_in_one_thread
from spirillum.studies.band import BandTask
from spirillum.studies.observed import ObservedArrays, observed_at
from spirillum.studies.study_loader import LoadedStudy
from spirillum.studies.work import Indices, ModelTask, OneRobot, Part, answer

AnyTask = ModelTask | BandTask | OneRobot


class StudyJob(NamedTuple):
    """A task with all that it is computed from; its robots are numbered from 0."""

    task: AnyTask
    loaded: LoadedStudy
    """The study without robots, or with those of the task where their draws of a posterior are asked for."""
    observed: ObservedArrays | None


def job_of(task: AnyTask, loaded: LoadedStudy, observed: ObservedArrays | None) -> tuple[int, StudyJob]:
    """A task as a job, with its number."""
    study = loaded.study.model_copy(update={"grid": None, "robots": None})
    small = replace(loaded, study=study, robots=(), placements=(), question={}, cautions=())
    if not isinstance(task, ModelTask):
        return task.number, StudyJob(task, small, None)
    if loaded.fit.posterior is not None:
        small = replace(small, robots=tuple(loaded.robot_at(index) for index in task.indices.tolist()))
    seen = None if observed is None else observed_at(observed, task.indices)
    own: Indices = np.arange(task.size, dtype=np.intp)
    return task.number, StudyJob(replace(task, indices=own), small, seen)


def answered(numbered: tuple[int, StudyJob]) -> Part:
    """The answer of a job."""
    task, loaded, observed = numbered[1]
    if isinstance(task, OneRobot):
        return task.answer()
    with one_thread_each(task.model):
        return task.answer(loaded.study.friction) if isinstance(task, BandTask) else answer(task, loaded, observed)


@contextmanager
def one_thread_each(*models: str) -> Iterator[None]:
    """While the block runs, this process keeps to one thread: the others have the other cores."""
    if all(find_swimmer_model(name).closed_form for name in models):
        yield
        return
    from spirillum.fluid.wire.interaction import one_thread

    with rows_in_one_thread(), one_thread():
        yield
