"""Run a study: compute what is missing, and assemble the Dataset."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from spirillum.fluid.registry import find_swimmer_model
from spirillum.studies.band import BandTask, band_tasks, left_out
from spirillum.studies.dataset import assembled
from spirillum.studies.observed import ObservedArrays
from spirillum.studies.spec import LoadedStudy
from spirillum.studies.work import Caution, Part, Task, answer, cautions, keep, kept, summed, tasks
from spirillum.swimming.comparison import uneven_models
from spirillum.swimming.prediction import calibration_warnings
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
    loaded: LoadedStudy, observed: ObservedArrays | None, fingerprint: str, parts: Path | None, tell: Progress
) -> xr.Dataset:
    """The dataset of a study.

    Args:
        loaded: the study with its robots.
        observed: observed rates and speeds of its robots, if any.
        fingerprint: see `study_fingerprint`.
        parts: folder where finished parts are kept and found again; None: nowhere.
        tell: called with what is being done, steps done and steps in all.
    """
    todo: list[Task | BandTask] = list(tasks(loaded))
    todo += band_tasks(loaded, len(todo))
    answers: list[tuple[Task, Part]] = []
    band: list[tuple[BandTask, Part]] = []
    found: list[Caution] = []
    warnings = [f"{robot.name}: {sentence}" for robot in loaded.robots for sentence in robot.warnings]
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
        tell(task.words, done, len(todo))
        part = kept(task, parts, len(loaded.study.friction))
        if part is None:
            part = _answered(task, loaded, observed)
            keep(task, part, parts)
        if isinstance(task, BandTask):
            band.append((task, part))
        else:
            answers.append((task, part))
            found += cautions(task, part)
    tell("dataset", len(todo), len(todo))
    warnings += summed(found, loaded.count)
    warnings += left_out(band)
    for robot in loaded.robots:
        for name in loaded.study.models:
            warnings += [f"{robot.name}: {sentence}" for sentence in calibration_warnings(robot, name)]
    return assembled(loaded, answers, band, observed, fingerprint, list(dict.fromkeys(warnings)))


def _answered(task: Task | BandTask, loaded: LoadedStudy, observed: ObservedArrays | None) -> Part:
    if isinstance(task, BandTask):
        return task.answer(loaded.study.friction)
    return answer(task, loaded, observed)
