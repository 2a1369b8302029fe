"""Run a study: compute what is missing, and assemble the Dataset."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from spirillum.fluid.registry import find_swimmer_model
from spirillum.processes import as_they_come
from spirillum.studies.band import BandTask, band_tasks, left_out
from spirillum.studies.dataset import assembled
from spirillum.studies.laid_down import LaidDownTask, laid_down_tasks, without_answer, without_table
from spirillum.studies.observed import ObservedArrays
from spirillum.studies.spec import LoadedStudy
from spirillum.studies.work import Caution, Part, Task, answer, cautions, keep, kept, summed, tasks
from spirillum.swimming.cautions import calibration_warnings
from spirillum.swimming.comparison import uneven_models
from spirillum.version import own_version

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["Progress", "computed_study", "study_fingerprint"]

Progress = Callable[[str, int, int], None]
"""Called with what is being done, steps done and steps in all."""


def study_fingerprint(loaded: LoadedStudy, observed: ObservedArrays | None) -> str:
    """Hash of question and program: a dataset of another version is computed anew."""
    question = [loaded.fingerprint, observed.question() if observed else None, own_version()]
    return hashlib.sha256(json.dumps(question).encode()).hexdigest()


def computed_study(
    loaded: LoadedStudy,
    observed: ObservedArrays | None,
    fingerprint: str,
    parts: Path | None,
    tell: Progress,
    workers: int = 1,
) -> xr.Dataset:
    """The dataset of a study.

    Args:
        loaded: the study with its robots.
        observed: observed rates and speeds of its robots, if any.
        fingerprint: see `study_fingerprint`.
        parts: folder where finished parts are kept and found again; None: nowhere.
        tell: called with what is being done, steps done and steps in all.
        workers: number of processes in which robots are laid down and let go.
    """
    todo: list[Task | BandTask] = list(tasks(loaded))
    todo += band_tasks(loaded, len(todo))
    runs = list(laid_down_tasks(loaded, len(todo)))
    steps = len(todo) + len(runs)
    answers: list[tuple[Task, Part]] = []
    band: list[tuple[BandTask, Part]] = []
    found: list[Caution] = []
    warnings = list(loaded.cautions)
    warnings += [f"{robot.name}: {sentence}" for robot in loaded.robots for sentence in robot.warnings]
    if any(robot.friction.effective is None and robot.motor for robot in loaded.robots):
        warnings.append(
            "friction.effective is unset: driven by their own motor, robots feel no more friction than the rotor's own "
            "B_m (readings 'rotor' and 'paper'), so that those rates and speeds are upper bounds"
        )
    asked = [find_swimmer_model(name) for name in loaded.study.models]
    warnings += loaded.fitted.idle_warnings(loaded.robots, asked)
    warnings += loaded.fitted.origin_warnings(loaded.robots, asked)
    warnings += loaded.fitted.reading_warnings(loaded.study.friction)
    warnings += loaded.fitted.model_warnings(loaded.study.models, loaded.study.friction)
    if loaded.friction:
        warnings += loaded.fitted.tails_warnings([loaded.robot_at(index) for index in range(loaded.count)])
    models = loaded.study.models
    factors = [name for name in models if any(name in robot.calibration for robot in loaded.robots)]
    warnings += uneven_models(loaded.robots, models, factors)
    for done, task in enumerate(todo):
        tell(task.words, done, steps)
        part = kept(task, parts, (task.size, len(loaded.study.friction)))
        if part is None:
            part = _answered(task, loaded, observed)
            keep(task, part, parts)
        if isinstance(task, BandTask):
            band.append((task, part))
        else:
            answers.append((task, part))
            found += cautions(task, part)
    laid_down = _laid_down(runs, parts, lambda what, done: tell(what, len(todo) + done, steps), workers)
    tell("dataset", steps, steps)
    warnings += summed(found, loaded.count)
    warnings += left_out(band)
    warnings += without_table(loaded, runs)
    warnings += without_answer(part for _, part in laid_down)
    for robot in loaded.robots:
        for name in loaded.study.models:
            warnings += [f"{robot.name}: {sentence}" for sentence in calibration_warnings(robot, name)]
    return assembled(loaded, answers, band, laid_down, observed, fingerprint, list(dict.fromkeys(warnings)))


def _answered(task: Task | BandTask, loaded: LoadedStudy, observed: ObservedArrays | None) -> Part:
    if isinstance(task, BandTask):
        return task.answer(loaded.study.friction)
    return answer(task, loaded, observed)


def _laid_down(
    runs: Sequence[LaidDownTask], parts: Path | None, tell: Callable[[str, int], None], workers: int
) -> list[tuple[LaidDownTask, Part]]:
    """The answers of robots that are laid down, in their order; each is kept as soon as it is done."""
    found = {task.number: kept(task, parts, (1,)) for task in runs}
    todo = [task for task in runs if found[task.number] is None]
    done = len(runs) - len(todo)
    if todo:
        tell(todo[0].words, done)
    for task, made in as_they_come(LaidDownTask.answer, todo, workers):
        found[task.number] = made
        keep(task, made, parts)
        done += 1
        tell(task.words, done)
    return [(task, part) for task in runs if (part := found[task.number]) is not None]
