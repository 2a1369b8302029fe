"""Run a study: compute what is missing, assemble the Dataset, write the folder."""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from spirillum.files import claim_folder, output_folder, write_dataset
from spirillum.fluid.registry import find_swimmer_model
from spirillum.studies.dataset import assembled, read_dataset
from spirillum.studies.observed import ObservedArrays, observed_arrays
from spirillum.studies.places import PlaceTask, left_out, place_tasks
from spirillum.studies.spec import LoadedStudy, load_study
from spirillum.studies.work import Caution, Part, Task, answer, cautions, keep, kept, summed, tasks
from spirillum.swimming.comparison import uneven_models
from spirillum.swimming.prediction import calibration_warnings

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["Progress", "study"]

Progress = Callable[[str, int, int], None]
"""Called with what is being done, steps done and steps in all."""

_RESULTS = ("dataset.nc", "figures", "report.html", "claims.json")
"""What a folder without the mark of a study may not hold, for it would be replaced."""


def study(
    source: str | Path | Mapping[str, Any] | None = None,
    *,
    observations: str | Path | None = None,
    output: str | Path | None = None,
    overrides: Mapping[str, Any] | None = None,
    models: Sequence[str] | None = None,
    band: bool | None = None,
    calibration: str | Path | None = None,
    posterior: str | Path | None = None,
    progress: Progress | None = None,
) -> xr.Dataset:
    """Run a study of many robots.

    Args:
        source: study file (see `spirillum schema study`) or its tables; None: the paper's study.
        observations: observations file; the study then also runs at the observed rates and infers B_eff.
        output: folder for `dataset.nc`, `figures/`, `report.html` and `claims.json`; a rerun resumes there.
            None: nothing is written.
        overrides: dotted robot fields, applied to every robot (``{"tail.taper": "none"}``).
        models: hydrodynamic models instead of the study's; None: the study's.
        band: compute models that compute the channel's walls over the places that the placement leaves open too
            (many minutes), or not, instead of what the study says; None: what it says.
        calibration: calibration file, applied to every robot.
        posterior: file of a calibration's posterior: its middle is applied to every robot, and the answers of its
            model have 95 % intervals.
        progress: called as the work goes on.

    Returns:
        Dataset with dimensions `channel`, `wavelength`, `amplitude` (or `robot`), `model`, `friction`.

    Raises:
        InputError: if the study, a robot or the observations are wrong, or the folder holds another study.
    """
    loaded = load_study(source, overrides, models=models, band=band, calibration=calibration, posterior=posterior)
    observed = observed_arrays(observations, loaded) if observations is not None else None
    fingerprint = _fingerprint(loaded, observed)
    tell = progress or (lambda _what, _done, _total: None)
    if output is None:
        return _computed(loaded, observed, fingerprint, None, tell)
    folder = Path(output)
    mark = {"schema": "spirillum.study-folder/1", "title": loaded.study.title, "fingerprint": fingerprint}
    claim_folder(folder, "study.json", mark, "study", _RESULTS)
    dataset = read_dataset(folder / "dataset.nc")
    if dataset is None or dataset.attrs.get("fingerprint") != fingerprint:
        parts = output_folder(folder / f"parts-{fingerprint[:16]}")
        dataset = _computed(loaded, observed, fingerprint, parts, tell)
        write_dataset(dataset, folder / "dataset.nc")
        shutil.rmtree(parts, ignore_errors=True)  # another run of the same study may be at it too
    _write_report(dataset, folder, tell)
    return dataset


def _fingerprint(loaded: LoadedStudy, observed: ObservedArrays | None) -> str:
    """Hash of question and program: a dataset of another version is computed anew."""
    from spirillum import __version__

    question = [loaded.fingerprint, observed.question() if observed else None, __version__]
    return hashlib.sha256(json.dumps(question).encode()).hexdigest()


def _computed(
    loaded: LoadedStudy, observed: ObservedArrays | None, fingerprint: str, parts: Path | None, tell: Progress
) -> xr.Dataset:
    todo: list[Task | PlaceTask] = list(tasks(loaded))
    todo += place_tasks(loaded, len(todo))
    answers: list[tuple[Task, Part]] = []
    band: list[tuple[PlaceTask, Part]] = []
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
        warnings += loaded.fitted.tails_warnings([loaded.robot_at(place) for place in range(loaded.count)])
    models = loaded.study.models
    factors = [name for name in models if any(name in robot.calibration for robot in loaded.robots)]
    warnings += uneven_models(loaded.robots, models, factors)
    for done, task in enumerate(todo):
        tell(task.words, done, len(todo))
        part = kept(task, parts, len(loaded.study.friction))
        if part is None:
            part = _answered(task, loaded, observed)
            keep(task, part, parts)
        if isinstance(task, PlaceTask):
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


def _answered(task: Task | PlaceTask, loaded: LoadedStudy, observed: ObservedArrays | None) -> Part:
    if isinstance(task, PlaceTask):
        return task.answer(loaded.study.friction)
    return answer(task, loaded, observed)


def _write_report(dataset: xr.Dataset, folder: Path, tell: Progress) -> None:
    from spirillum.results.study_report import write_report

    write_report(dataset, folder, tell)
