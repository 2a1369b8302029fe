"""Run a study: compute what is missing, and assemble the Dataset."""

from __future__ import annotations

import hashlib
import json
import re
import zipfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numpy as np

from spirillum.dynamics.comparison import uneven_models
from spirillum.files import atomic_write, opened
from spirillum.fluid.model import SwimmerModel
from spirillum.fluid.registry import find_swimmer_model
from spirillum.fluid.tube.library import TabledTube, prepared_tables
from spirillum.fluid.tube.progress_messages import ANNOUNCED, LEVEL, SOLUTION, time_now
from spirillum.fluid.tube.stages import StageName
from spirillum.notes import Note
from spirillum.progress import Progress, tell
from spirillum.robot.batch import RobotBatch
from spirillum.robot.limits import broken
from spirillum.robot.robot import Robot
from spirillum.studies.columns import (
    BandTask,
    HeldTask,
    TrialTask,
    axial_tasks,
    band_tasks,
    missing_pose_notes,
    trial_notes,
)
from spirillum.studies.dataset import BesideModels, cautions, checksum_of, described, labelled_answers
from spirillum.studies.released_robots import (
    ReleaseTask,
    SettledTask,
    not_settled,
    settled_basis,
    without_answer,
)
from spirillum.studies.study_loader import LoadedStudy, ObservedArrays
from spirillum.studies.work import ModelTask, Part, StudyTask, groups, run_job, tasks
from spirillum.swimming.band import left_open
from spirillum.swimming.cautions import calibration_warnings, summed
from spirillum.swimming.preparation import check_may_be_made, has_table, missing_tables
from spirillum.swimming.scenario import CONSTANT_TORQUE
from spirillum.version import package_version
from spirillum.worker_pool import ESTIMATE, WorkerPool, map_tasks

if TYPE_CHECKING:
    import xarray as xr


_PART = "part-{:05d}.npz"  # file of a finished answer by the number of its task
_LARGEST_PART = 1 << 30


def stored_answer(number: int, task: StudyTask, folder: Path | None, leading: tuple[int, ...]) -> Part | None:
    """The answer that an earlier run has kept; None if there is none, or it is damaged or not of this task."""
    if folder is None or not (folder / _PART.format(number)).is_file():
        return None
    try:
        with opened(folder / _PART.format(number), "a part of a study", _LARGEST_PART) as stream:
            items = zipfile.ZipFile(stream).infolist()
            if any((item.compress_type, item.compress_size) != (zipfile.ZIP_STORED, item.file_size) for item in items):
                return None
            with np.load(stream, allow_pickle=False) as stored:
                part = {name: stored[name] for name in stored.files if name != _MARK}
                mark = stored[_MARK]
    except Exception:  # a damaged file raises whatever the libraries meet first
        return None
    whole = task.needed <= set(part) <= task.allowed
    fits = all(array.dtype == np.float64 and array.shape[: len(leading)] == leading for array in part.values())
    return part if whole and fits and np.array_equal(mark, task.mark) else None


_MARK = "task"


def store_answer(number: int, task: StudyTask, part: Part, folder: Path) -> None:
    """Keep a finished answer."""
    with atomic_write(folder / _PART.format(number), replace="any") as path, path.open("wb") as stream:
        np.savez(stream, **cast("dict[str, Any]", {**part, _MARK: task.mark}))


@contextmanager
def _kept_at_times(folder: Path | None) -> Iterator[Callable[[int, StudyTask, Part], None]]:
    """A function that takes finished answers: each second they are kept together, and all of them at an error."""
    waiting: list[tuple[int, StudyTask, Part]] = []
    last = monotonic()

    def keep_all() -> None:
        nonlocal last
        while waiting and folder is not None:
            store_answer(*waiting[0], folder)
            del waiting[0]
        last = monotonic()

    def finished(number: int, task: StudyTask, part: Part) -> None:
        waiting.append((number, task, part))
        if monotonic() - last > _PERIOD:
            keep_all()

    try:
        yield finished
    except BaseException:
        keep_all()
        raise


_PERIOD = 1.0  # between two times at which answers are kept, s: to write one whole takes as long as a quick answer


_Task = TypeVar("_Task", bound=StudyTask)


def study_fingerprint(loaded: LoadedStudy, observed: ObservedArrays | None) -> str:
    """Hash of request and program: a dataset of another version is computed again."""
    question = [loaded.fingerprint, observed.question() if observed else None, package_version()]
    return hashlib.sha256(json.dumps(question).encode()).hexdigest()


def computed_study(
    loaded: LoadedStudy,
    observed: ObservedArrays | None,
    fingerprint: str,
    parts: Path | None,
    progress: Progress | None,
    pool: WorkerPool | None = None,
) -> xr.Dataset:
    """The dataset of a study; finished parts are kept in and reused from the folder `parts`."""
    followed = loaded.study.predicted or loaded.study.settled or loaded.study.trial
    every = enumerate(loaded.robot_at(index) for index in range(loaded.count)) if followed else ()
    with_table = {index: one for index, one in every if one.channel and has_table(RobotBatch.of(one), "yaw")}
    requested: list[StudyTask] = [
        *tasks(loaded),
        *band_tasks(loaded),
        *axial_tasks(loaded),
        *_followed_tasks(loaded, with_table),
    ]
    readings = len(loaded.study.friction)
    found = [stored_answer(number, task, parts, task.leading(readings)) for number, task in enumerate(requested)]
    numbers = [number for number, part in enumerate(found) if part is None]
    missing = [requested[number] for number in numbers]
    done = len(requested) - len(missing)
    if missing:
        walled = (task for task in missing if isinstance(task, ModelTask) and find_swimmer_model(task.model).placed)
        count = sum(len(missing_tables(task.batch, "straight")) for task in walled)
        if count:
            words = f"the flow is solved for at one pose of each robot without a table of its tube ({count} of them)"
            fast, slow = SOLUTION[LEVEL]
            takes = time_now((count * fast, count * slow), (pool or WorkerPool()).workers)
            tell(progress, f"{ESTIMATE}{words}, in {takes}; `prepare` makes tables", 0, 0)
        tell(progress, missing[0].words, done, len(requested))
    jobs = (requested[number].job(loaded, observed)._replace(number=number) for number in numbers)
    at_work = _worth(missing, pool or WorkerPool())
    with _kept_at_times(parts) as finished:
        for job, part in map_tasks(run_job, jobs, at_work, besides=_KEPT if parts else ""):
            found[job.number] = part
            finished(job.number, requested[job.number], part)
            done += 1
            tell(progress, requested[job.number].words, done, len(requested))
    tell(progress, "dataset", len(requested), len(requested))

    def answered(kind: type[_Task]) -> list[tuple[_Task, Part]]:
        pairs = zip(requested, found, strict=True)
        return [(task, part) for task, part in pairs if isinstance(task, kind) and part is not None]

    answers, band = answered(ModelTask), answered(BandTask)
    beside = BesideModels(answered(ReleaseTask), answered(SettledTask), answered(HeldTask), answered(TrialTask))
    warnings = warnings_of(loaded, observed)
    warnings += [settled_basis(loaded.study.contact)] if beside.settled else []
    warnings += summed((caution for pair in answers for caution in cautions(*pair)), loaded.count)
    warnings += missing_pose_notes(band)
    if followed:
        warnings += _without_table(loaded, with_table)
    warnings += without_answer(part for _, part in beside.released)
    warnings += not_settled(beside.settled)
    warnings += trial_notes(beside.trials)
    warnings += warnings_of_calibrations(loaded)
    dataset = labelled_answers(loaded, answers, band, beside, observed)
    dataset.attrs = described(loaded, observed, fingerprint, list(dict.fromkeys(warnings)))
    dataset.attrs["checksum"] = checksum_of(dataset)
    return dataset


def _followed_tasks(loaded: LoadedStudy, robots: Mapping[int, Robot]) -> Iterator[StudyTask]:
    """The tasks of robots that are followed in their tubes after release, as far as the study requests them."""
    study = loaded.study
    for index, robot in robots.items():
        at, placement = np.array([index]), loaded.placement_at(index)
        if study.predicted:
            yield ReleaseTask(at, robot, study.laid_down)
        if study.settled:
            yield SettledTask(at, robot, placement, study.contact)
        if study.trial:
            yield TrialTask(at, robot, placement, study.contact, interval=study.interval)


_KEPT = "; what was answered is kept"
_SHORT = 600_000  # robots in closed form below which other processes would start longer than they work


def _worth(missing: Sequence[StudyTask], pool: WorkerPool) -> WorkerPool:
    """Who computes: this process where the others would start longer than they work."""
    quick = all(
        isinstance(task, HeldTask) or (isinstance(task, ModelTask) and find_swimmer_model(task.model).closed_form)
        for task in missing
    )
    short = quick and sum(task.size for task in missing) < _SHORT
    return WorkerPool() if short and pool.cluster is None else pool


def warnings_of(loaded: LoadedStudy, observed: ObservedArrays | None) -> list[Note]:
    """Notes on the robots, models, fit and observations of a study."""
    named = ((robot.name, note) for robot in loaded.robots for note in robot.warnings)
    warnings = _of_robots(named, len(loaded.robots))
    if any(robot.friction.effective is None and robot.motor for robot in loaded.robots):
        warnings.append(Note.named("friction-unset"))
    if any(robot.drive is not None and robot.drive.kind == "torque" for robot in loaded.robots):
        warnings.append(CONSTANT_TORQUE)
    requested = [find_swimmer_model(name) for name in loaded.study.models]
    warnings += _pose_notes(loaded, requested)
    warnings += loaded.fit.unused_model_warnings(loaded.robots, requested)
    warnings += loaded.fit.geometry_warnings(loaded.robots, requested)
    warnings += loaded.fit.origin_warnings(loaded.robots, requested)
    warnings += loaded.fit.torque_warnings(loaded.study.models, loaded.study.friction)
    if loaded.friction:
        warnings += loaded.fit.tails_warnings([loaded.robot_at(index) for index in range(loaded.count)])
    models = loaded.study.models
    factors = [name for name in models if any(name in robot.calibration for robot in loaded.robots)]
    warnings += uneven_models(loaded.robots, models, factors)
    return [*warnings, *(() if observed is None else observed.notes)]


def _pose_notes(loaded: LoadedStudy, models: Sequence[SwimmerModel]) -> list[Note]:
    """Limits of answers for robots held at a pose in their tube."""
    walled = [model.name for model in models if model.placed]
    if not walled:
        return [Note.named("band-without-walls")] if loaded.study.band else []
    held = Note.named("robots-are-held")
    placements = loaded.placements or (loaded.study.placement,)
    found = {name: model.name for model in models for place in placements for name in left_open(place, model)}
    if loaded.study.band or not found:
        return [] if loaded.study.settled else [held]
    are = "are" if len(found) > 1 else "is"
    one_place = Note.named("one-pose-of-many", names=" and ".join(found), are=are, fields=tuple(found))
    return [one_place] if loaded.study.settled else [one_place, held]


def warnings_of_calibrations(loaded: LoadedStudy) -> list[Note]:
    """What to be careful about in the robots' own calibrations."""
    named = (
        (robot.name, note)
        for robot in loaded.robots
        for name in loaded.study.models
        for note in calibration_warnings(robot, name)
    )
    return _of_robots(named, len(loaded.robots))


def make_tables(loaded: LoadedStudy, pool: WorkerPool, progress: Progress) -> None:
    """Make the tables that robots lack in their tubes, where the study left the choice of the model to the program."""
    if not loaded.makes_tables:
        return
    stage: StageName = "yaw" if loaded.study.predicted or loaded.study.settled or loaded.study.trial else "straight"
    lacking = [(batch, found) for _, batch in groups(loaded) if (found := missing_tables(batch, stage))]
    for batch, _ in lacking:
        check_may_be_made(batch, stage)
    missing = dict.fromkeys(one for _, found in lacking for one in found)
    if missing:
        cheaper = "model 'tube' by name solves for one pose of each, 'slender' leaves out the walls"
        holds = "for release" if stage == "yaw" else "for fixed poses"
        what = f"{ANNOUNCED}, of {len(missing)} robots: they are made first, {holds} (stage {stage}); {cheaper}"
        tell(progress, what, 0, 0)
        prepared_tables(list(missing), stage=stage, workers=1 if pool.cluster else pool.size, progress=progress)


def _without_table(loaded: LoadedStudy, with_table: Mapping[int, Robot]) -> list[Note]:
    """A sentence on the robots that are not followed in their tubes for want of a table; none where all are."""
    found: dict[str, list[Robot]] = {}
    for index in range(loaded.count):
        if index not in with_table:
            robot, why = loaded.robot_at(index), "without-yawed-table"
            if robot.channel is None:
                why = "without-channel"
            elif broken(TabledTube({}).requirements(RobotBatch.of(robot, loaded.placement_at(index)))):
                why = "without-room"
            found.setdefault(why, []).append(robot)
    return [
        Note.named(why, count=len(robots), robots=loaded.count, first=robots[0].with_tail)
        for why, robots in found.items()
    ]


def _of_robots(named_notes: Iterable[tuple[str, Note]], robots: int) -> list[Note]:
    """Notes with the name of their robot; of those that differ in numbers alone, the first with how many robots."""
    found: dict[str, list[tuple[str, Note]]] = {}
    for name, note in named_notes:
        found.setdefault(re.sub(r"-?\d[\d.e+-]*", "", note), []).append((name, note))
    return [
        alike[0][1].prefixed(f"{alike[0][0]}: " if len(alike) == 1 else f"{len(alike)} of {robots} robots, the first: ")
        for alike in found.values()
    ]
