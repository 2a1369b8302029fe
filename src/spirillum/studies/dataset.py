"""The result of a study as a labelled Dataset, with its cautions: coordinates are the question."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from spirillum.arrays import Flags, Values
from spirillum.errors import InputError
from spirillum.files import loaded_netcdf, open_netcdf
from spirillum.fluid.registry import find_swimmer_model
from spirillum.notes import Note, note_attributes
from spirillum.quantities import QUANTITIES, attributes
from spirillum.robot.limits import broken, reynolds_limits, stokes_flow_problem
from spirillum.studies.columns import BandTask, HeldTask, TrialTask, column_variables, with_band
from spirillum.studies.released_robots import (
    AT_RUNS,
    FACTORS,
    INFERRED,
    INFERRED_BY,
    READ,
    WINDOWS,
    ReleaseTask,
    SettledTask,
    levels,
    levels_of_readings,
    main_effects,
    settled_variables,
)
from spirillum.studies.spec import LaidDown
from spirillum.studies.study_loader import LoadedStudy, ObservedArrays
from spirillum.studies.work import REASONS, ModelTask, Part, flag_attributes, gathered
from spirillum.swimming.cautions import NO_ANSWER, Caution, accuracy_cautions
from spirillum.swimming.motions import STEADY, Swimming
from spirillum.version import versions

if TYPE_CHECKING:
    import xarray as xr


_SOURCE = "runs in the tube, nothing fitted"
_MEANINGS = {
    "azimuth": "change of the azimuth of the body's centre about +x",
    "effective_friction": "B_eff inferred by (18), as the paper does",
    "modelled_forward_velocity": "forward velocity by a model of the paper at the tail rate of a run",
    "modelled_body_rotation_rate": "body rate by a model of the paper at the tail rate of a run",
}


def release_coordinates(ranges: LaidDown) -> dict[str, Any]:
    """Coordinates of the dimensions `run`, `window`, `inferred_by` and `factor`."""
    about = {"units": "1", "source": "design of the runs"}
    found: dict[str, Any] = {
        "window": ("window", np.array(WINDOWS, dtype=str), {**about, "long_name": "what a run is read over"}),
        "inferred_by": ("inferred_by", np.array(INFERRED_BY, dtype=str), {**about, "long_name": "model that infers"}),
        "factor": ("factor", np.array(READ, dtype=str), {**about, "long_name": "what differs between readings"}),
    }
    for column, name in zip(levels().T, FACTORS, strict=True):
        if name != "pitch":
            low, high = getattr(ranges, name)
            meaning = "gap at release" if name == "gap" else None
            values = np.where(column > 0, high, low)
            found[f"{name}_of_run"] = ("run", values, attributes(name, meaning=meaning, source="design of the runs"))
    return found


def release_variables(
    answers: Sequence[tuple[ReleaseTask, Part]], robots: Sequence[str], shape: Sequence[int]
) -> dict[str, Any]:
    """`<quantity>_at_run`, `_predicted_low`, `_predicted_high` and the factors' `_effect`; NaN without runs."""
    found: dict[str, Any] = {}
    for name in (*AT_RUNS, *INFERRED):
        values = gathered(answers, name, shape)
        more = ("inferred_by",) if name in INFERRED else ()
        base = name.removeprefix("modelled_")
        meaning = _MEANINGS.get(name, QUANTITIES[base].meaning)
        axes = (len(shape), len(shape) + 1)
        with np.errstate(invalid="ignore"):
            low, high = (reduce(values, axis=axes) for reduce in (np.fmin.reduce, np.fmax.reduce))
        last = np.moveaxis(values, axes, (-2, -1))
        effects = main_effects(last.reshape(*last.shape[:-2], -1), levels_of_readings())

        def about(words: str, base: str = base, meaning: str = meaning) -> dict[str, Any]:
            return attributes(base, meaning=f"{meaning}, {words}", source=_SOURCE)

        found[f"{name}_at_run"] = ((*robots, "run", "window", *more), values, about("over a window of a run"))
        found[f"{name}_predicted_low"] = ((*robots, *more), low, about("least of all runs and windows"))
        found[f"{name}_predicted_high"] = ((*robots, *more), high, about("largest of all runs and windows"))
        words = "what the high level of a factor adds to the mean at its low one"
        found[f"{name}_effect"] = ((*robots, *more, "factor"), effects, about(words))
    pitch = attributes("pitch", meaning="pitch at release, nose up", source="design of the runs")
    found["pitch_of_run"] = ((*robots, "run"), gathered(answers, "laid_pitch", shape), pitch)
    return found


_PAPER = "BioRob 2012"
_PLACED = {
    "gap_at_place": attributes("gap", source="poses of the band"),
    "pitch_at_place": attributes("pitch", source="poses of the band: level, half and all that gap and tail allow"),
}
_BAND = {
    "_at_place": ("at a pose of the band", "poses of the band"),
    "_interval_low": ("lower limit of the 95 % interval", "posterior of a calibration, discrepancy included"),
    "_interval_high": ("upper limit of the 95 % interval", "posterior of a calibration, discrepancy included"),
    "_low": ("least of the band over gap and pitch", "least of all poses, the reference pose among them"),
    "_high": ("largest of the band over gap and pitch", "largest of all poses, the reference pose among them"),
}


class BesideModels(NamedTuple):
    """Answers of robots one by one, beside those of the models."""

    released: Sequence[tuple[ReleaseTask, Part]] = ()  #: Of robots that made the runs of a design.
    settled: Sequence[tuple[SettledTask, Part]] = ()  #: Of those that were followed to their steady motions.
    held: Sequence[tuple[HeldTask, Part]] = ()  #: Of those that `tube` holds, in a study without that model.
    trials: Sequence[tuple[TrialTask, Part]] = ()  #: Of those that made a trial.


_NOTHING_BESIDE = BesideModels()


def described(
    loaded: LoadedStudy, observed: ObservedArrays | None, fingerprint: str, warnings: Sequence[Note]
) -> dict[str, str]:
    """Attributes of a dataset: the question, and what is to be known of the answer."""
    study = loaded.study
    references = [key for name in study.models for key in find_swimmer_model(name).references]
    return {
        "title": study.title,
        "note": study.note.strip(),
        "settings": json.dumps(loaded.question, sort_keys=True),
        "fingerprint": fingerprint,
        "observations": observed.source if observed else "none: nothing in this dataset is measured",
        "claims": study.claims,
        **({"model_reason": loaded.model_reason} if loaded.model_reason else {}),
        "references": " ".join(dict.fromkeys(references)),
        **note_attributes(warnings),
        "versions": versions(),
        "Conventions": "CF-1.11",
    }


def labelled_answers(
    loaded: LoadedStudy,
    answers: Iterable[tuple[ModelTask, Part]],
    band: Sequence[tuple[BandTask, Part]] = (),
    beside: BesideModels = _NOTHING_BESIDE,
    observed: ObservedArrays | None = None,
) -> xr.Dataset:
    """Answers as labelled arrays, without attributes of the whole."""
    import xarray as xr

    study = loaded.study
    grid = study.grid
    robots = ("robot",) if grid is None else ("channel", "wavelength", "amplitude")
    shape = (loaded.count,) if grid is None else (len(grid.channels), len(grid.wavelengths), len(grid.amplitudes))
    count = int(np.prod(shape))
    flat = _gathered(loaded, answers, count)
    if band:
        flat |= with_band(flat, band, study.models)
    data: dict[str, Any] = {}
    for name, values in flat.items():
        axis_last = np.moveaxis(values, 0, 1)  # (robots, models, friction[, rates or places])
        moved = axis_last.reshape(*shape, *axis_last.shape[1:])
        more = ("place" if name.endswith("_at_place") else "assumed_motor_rate",)[: axis_last.ndim - 3]
        data[name] = ((*robots, "model", "friction", *more), moved, _attributes_of(name))
    if band:
        tasks = [task for task, _ in band]
        poses = max(task.pose for task in tasks) + 1
        names = ("gap_at_place", "pitch_at_place")
        found: dict[str, Values] = {name: np.full((count, poses), np.nan) for name in names}
        for task in tasks:
            found["gap_at_place"][task.indices, task.pose] = task.robots[0].placement.gap
            found["pitch_at_place"][task.indices, task.pose] = task.robots[0].placement.pitch
        for name, values in found.items():
            data[name] = ((*robots, "place"), values.reshape(*shape, -1), _PLACED[name])
    data["outside"] = (data["outside"][0], data["outside"][1].astype("int8"), _attributes_of("outside"))
    if observed is not None:
        data |= _observed_variables(observed, robots, shape)
    coordinates = coordinates_of(loaded)
    data |= column_variables(beside.held, beside.trials, robots, shape)
    if beside.settled:
        data |= settled_variables(beside.settled, robots, shape)
    if beside.released:
        data |= release_variables(beside.released, robots, shape)
        coordinates |= release_coordinates(study.laid_down)
    return xr.Dataset(data, coords=coordinates)


_ANY = "surrogatepass"  # damaged names are summed, too


def checksum_of(dataset: xr.Dataset) -> str:
    """Checksum of all other values and attributes: damage is detected, and the dataset computed again."""
    found = hashlib.sha256()
    for name, value in sorted((str(name), value) for name, value in dataset.attrs.items() if name != "checksum"):
        found.update(f"{name}={value}\n".encode(errors=_ANY))
    for name in sorted(map(str, dataset.variables)):
        variable = dataset.variables[name]
        found.update(f"{name} {variable.dims} {variable.shape}\n".encode(errors=_ANY))
        if variable.dtype.kind in "OUS":
            found.update("\n".join(map(str, variable.values.flat)).encode(errors=_ANY))
        else:
            found.update(np.ascontiguousarray(variable.values, dtype="<f8").tobytes())
        found.update(" ".join(f"{key}={variable.attrs[key]}" for key in sorted(variable.attrs)).encode(errors=_ANY))
    return found.hexdigest()


def _gathered(loaded: LoadedStudy, answers: Iterable[tuple[ModelTask, Part]], count: int) -> dict[str, Values]:
    """All parts in arrays of (models, robots, ...); NaN where a part does not have a quantity."""
    models = loaded.study.models
    flat: dict[str, Values] = {}
    for task, part in answers:
        for name, values in part.items():
            if name not in flat:
                flat[name] = np.full((len(models), count, *values.shape[1:]), np.nan)
            flat[name][models.index(task.model), task.indices] = values
    return flat


def coordinates_of(loaded: LoadedStudy) -> dict[str, Any]:
    """The question of a study: names, sizes, models, readings, rates."""
    study, robots, source = loaded.study, loaded.robots, "input of the study"
    channel = [robot.channel.diameter if robot.channel else np.inf for robot in robots]
    first = "channel" if study.grid else "robot"

    def labels(words: Sequence[str], meaning: str) -> tuple[Any, ...]:
        return np.array(words, dtype=str), {"units": "1", "long_name": meaning, "source": source}

    coordinates: dict[str, Any] = {
        first: (first, *labels(loaded.names, f"name of the {first}")),
        "channel_diameter": (first, channel, attributes("channel_diameter")),
        "model": ("model", *labels(study.models, "hydrodynamic model")),
        "friction": ("friction", *labels(study.friction, "reading of the effective friction")),
    }
    tail = {
        "wavelength": study.grid.wavelengths if study.grid else [r.tail.wavelength for r in robots],
        "amplitude": study.grid.amplitudes if study.grid else [r.tail.amplitude for r in robots],
    }
    for name, values in tail.items():
        coordinates[name] = (name if study.grid else first, values, attributes(name, source=source))
    if study.assumed_motor_rates:
        rates, name = list(study.assumed_motor_rates), "assumed_motor_rate"
        coordinates[name] = (name, rates, attributes(name))
    return coordinates


def _attributes_of(name: str) -> dict[str, Any]:
    if name == "outside":
        source = "domain of the model, fit of the parts"
        return flag_attributes("why there is no answer (0: answered)", source, REASONS)
    if name == "error_estimate":
        return attributes(name)
    for ending, (words, source) in _BAND.items():
        if name.endswith(ending):
            base = name.removesuffix(ending)
            return attributes(base, meaning=f"{QUANTITIES[base].meaning}, {words}", source=source)
    base, _, at = name.partition("_at_")
    item = QUANTITIES[base]
    suffix = f", at the {at.replace('_rate', '').replace('_', ' ')} rate" if at else ", driven by its own drive"
    source = f"{item.source} of {_PAPER}" if item.source.startswith(("eq", "Table")) else item.source
    return attributes(base, meaning=item.meaning + suffix, source=source)


def _observed_variables(observed: ObservedArrays, robots: Sequence[str], shape: Sequence[int]) -> dict[str, Any]:
    meanings = {
        "forward_velocity": ("m/s", "observed forward velocity"),
        "tail_rate": ("rad/s", "observed rotation rate of the tail (lab)"),
        "body_rate": ("rad/s", "observed rotation rate of the body"),
        "motor_rate": ("rad/s", "observed motor rate, else tail less body rate"),
    }
    source = f"observations file {observed.source}"
    found: dict[str, Any] = {}
    for name, (unit, meaning) in meanings.items():
        about = {"units": unit, "long_name": meaning, "source": source}
        found[f"observed_{name}"] = (robots, getattr(observed, name).reshape(shape), about)
        interval = {**about, "long_name": f"half width of the 95 % interval of the {meaning}"}
        found[f"observed_{name}_ci95"] = (robots, observed.intervals[name].reshape(shape), interval)
    trials = {"units": "1", "long_name": "number of trials", "source": source}
    found["trials"] = (robots, observed.trials.reshape(shape).astype("int32"), trials)
    return found


_LARGEST_LEFT, _LARGEST_OF_A_ROBOT = 16 << 20, 1 << 16
"""Bytes of a dataset: of its attributes, and of each of its robots with all models, readings, rates and poses."""


def read_dataset(path: Path, robots: int) -> xr.Dataset | None:
    """A dataset that an earlier run has written; None if there is none, it is damaged, or absurdly large."""
    if not path.is_file():
        return None
    try:
        found = loaded_netcdf(path, "a dataset of this study", _LARGEST_LEFT + _LARGEST_OF_A_ROBOT * robots)
    except InputError:
        return None
    return found if found.attrs.get("checksum") == checksum_of(found) else None


def is_dataset(path: Path) -> bool:
    """Whether a file is the dataset of a study, also one that was changed since it was written."""
    with suppress(InputError), open_netcdf(path, "a dataset of this study") as file:
        return "fingerprint" in file.attrs
    return False


def _refusals(task: ModelTask, part: Part) -> list[Caution]:
    """Why robots of a task have no answer, one for each requirement; each robot counts for the first that it breaks."""
    left = np.any(part["outside"] != 0, axis=-1)
    found = []
    for limit in broken(find_swimmer_model(task.model).requirements(task.batch)):
        of_this = left & ~np.broadcast_to(limit.holds, left.shape)
        if of_this.any():
            sentence = limit.sentence(int(np.argmax(of_this)))
            found.append(Caution(task.model, limit.flag, int(np.count_nonzero(of_this)), NO_ANSWER, sentence))
        left &= ~of_this
    found += _beyond_stokes(task, part, left)
    left &= ~np.any(part["outside"] == REASONS.index("beyond-stokes"), axis=-1)
    if left.any():
        lacking = np.count_nonzero(part["outside"][int(np.argmax(left))])
        sentence = f"no steady motion under {lacking} of {part['outside'].shape[-1]} friction models"
        found.append(Caution(task.model, "other", int(np.count_nonzero(left)), NO_ANSWER, sentence))
    return found


def _beyond_stokes(task: ModelTask, part: Part, left: Flags) -> list[Caution]:
    """The refusal of robots that move far outside Stokes flow, under the first friction model that has one."""
    code = REASONS.index("beyond-stokes")
    refused = left & np.any(part["outside"] == code, axis=-1)
    if not refused.any():
        return []
    rows, reading = np.flatnonzero(refused), int(np.argmax(part["outside"][int(np.argmax(refused))] == code))
    numbers = [part[name][rows, reading] for name in ("reynolds_number", "tail_reynolds_number")]
    batch = task.batch.taken(rows)
    sentence = stokes_flow_problem(batch, reynolds_limits(batch, *numbers))
    return [Caution(task.model, "beyond-stokes", len(rows), NO_ANSWER, sentence)]


def cautions(task: ModelTask, part: Part) -> list[Caution]:
    """What to be careful about in a task's answer, and why robots have none, one for each kind."""
    columns: dict[str, Any] = {item.name: part[item.name][:, 0] for item in STEADY}
    first = Swimming(**columns, valid=part["outside"][:, 0] == 0)
    return [*_refusals(task, part), *accuracy_cautions(find_swimmer_model(task.model), task.batch, first)]
