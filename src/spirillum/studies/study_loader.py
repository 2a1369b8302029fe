"""A study with its robots and observations: loaded, calibrated and checked together, with its fingerprint."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from spirillum.arrays import PerRobot
from spirillum.errors import InputError, led_by
from spirillum.files import read_toml
from spirillum.fitted.calibration_file import CalibrationFile, FittedFriction, calibrated_robot
from spirillum.fitted.fit import NO_FIT, Fit, check_not_overridden, read_fit
from spirillum.fluid.registry import SWIMMER_MODELS, check_placement
from spirillum.measurement.observations import (
    RobotObservations,
    check_driven,
    read_observations,
    summarised,
    without_copies,
)
from spirillum.notes import Note
from spirillum.robot.arguments import set_fields
from spirillum.robot.fields import problems_in, refused_table
from spirillum.robot.load import load
from spirillum.robot.placement import Placement
from spirillum.robot.robot import Robot
from spirillum.robot.tube_pose import gap_of
from spirillum.studies.spec import LARGEST_STORED, Study
from spirillum.swimming.band import left_open
from spirillum.swimming.preparation import AUTO, IN_CHANNEL, UNBOUNDED, WALLED, ModelChoice, choose_model
from spirillum.units import show_apart

LARGEST_STUDY = 5_000_000  #: Most results (robots times models times friction models times rates) of one study.
_LARGEST_WITH_INTERVALS = 10_000  # most robots of a study with a posterior, each of which swims a thousand times
_WHAT = "a study file (TOML, see `spirillum schema study`)"


@dataclass(frozen=True)
class LoadedStudy:
    """A checked study with its robots."""

    study: Study
    robots: tuple[Robot, ...]  #: One robot a channel of the grid, or the listed robots.
    question: Mapping[str, Any]  #: All that decides the answer, for the fingerprint and the dataset's attributes.
    fit: Fit = NO_FIT  #: Fitted values that act on the robots, or draws over which answers have intervals.
    placements: tuple[Placement, ...] = ()  #: Pose of each of `robots` by a calibration; none if the study states it.
    model_reason: str = ""  #: Why the model in place of `auto` was taken; empty where all models are named.

    def placement_of(self, number: int) -> Placement:
        """Pose of one of `robots`."""
        return self.placements[number] if self.placements else self.study.placement

    def placement_at(self, index: int) -> Placement:
        """Pose of the robot at an index in the flat order of the study."""
        return self.placement_of(index // (self.count // len(self.robots)))

    def with_friction(self, robot: Robot) -> Robot:
        """Return a robot with the B_eff that was fitted to its tail, if any was."""
        return calibrated_robot(robot, CalibrationFile.model_construct(friction=self.friction))

    @property
    def makes_tables(self) -> bool:
        """Whether missing tables of tubes are made first: model `tube` was chosen, not named."""
        return self.model_reason == IN_CHANNEL

    @property
    def friction(self) -> tuple[FittedFriction, ...]:
        """B_eff of tails in a calibration."""
        return self.fit.friction

    @property
    def fingerprint(self) -> str:
        """Hash of the question."""
        text = json.dumps(self.question, sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()

    @property
    def count(self) -> int:
        """Number of robots."""
        grid = self.study.grid
        return len(self.robots) * (1 if grid is None else len(grid.wavelengths) * len(grid.amplitudes))

    def robot_at(self, index: int) -> Robot:
        """The robot at an index in the flat order of the study."""
        grid = self.study.grid
        if grid is None:
            return self.robots[index]
        robot, tail = divmod(index, len(grid.wavelengths) * len(grid.amplitudes))
        wavelength, amplitude = divmod(tail, len(grid.amplitudes))
        own = self.robots[robot]
        changed = {"wavelength": grid.wavelengths[wavelength], "amplitude": grid.amplitudes[amplitude]}
        return own.model_copy(update={"tail": own.tail.model_copy(update=changed)})

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the channels, or of the robots."""
        if self.study.grid is not None:
            return tuple(self.study.grid.channels)
        return tuple(robot.name for robot in self.robots)


def load_study(
    source: str | Path | Mapping[str, Any],
    overrides: Mapping[str, Any] | None = None,
    *,
    calibration: str | Path | None = None,
    posterior: str | Path | None = None,
    largest: int = LARGEST_STUDY,
    **instead: Any,
) -> LoadedStudy:
    """Load a study and its robots; `instead` of what it states: `models`, `band`, ... as of `spirillum.study`."""
    study, name, folder = _read(source, {field: value for field, value in instead.items() if value is not None})
    if study.size > largest:
        store = f", or {LARGEST_STORED} in a store (--store study.zarr)" if largest < LARGEST_STORED else ""
        raise InputError(f"{name}: the study requests {study.size} results; allowed: at most {largest}{store}")
    sources = list(study.grid.channels.values()) if study.grid else study.robots or []
    each = [dict(zip(study.vary, values, strict=True)) for values in product(*study.vary.values())]
    entries = list(product(sources, each))
    robots = tuple(_robot(entry, folder, overrides or {}, varied, name) for entry, varied in entries)
    if study.grid is None:
        _check_different(robots, entries, name)
    robots = _named_apart(robots, [varied for _, varied in entries])
    _check_drives(study, [entry for entry, _ in entries], robots, name)
    fit = _fit(study, calibration, posterior, name)
    set_or_varied = (*set_fields(overrides or {}), *study.vary)
    fitted = tuple(fit.central(robot) for robot in robots)
    for robot, found in zip(robots, fitted, strict=True):
        check_not_overridden(set_or_varied, robot, found, str(posterior or calibration))
    robots = fitted
    _check_varied(study, overrides or {}, name)
    study, reason = _with_models(study, robots, fit, name)
    with led_by(name):
        check_placement(study.placement, *(SWIMMER_MODELS[model] for model in study.models))
    _check_room(study, robots, name)
    _check_contact(study, robots, name)
    placements = _fitted_poses(study, robots, fit)
    question = {"study": study.model_dump(), "robots": [robot.model_dump() for robot in robots]}
    if fit.friction:
        question["friction"] = [item.model_dump() for item in fit.friction]
    if placements:
        question["placements"] = [place.model_dump() for place in placements]
    if fit.posterior:
        question["posterior"] = {"source": fit.posterior.source, "sha256": fit.posterior.sha256}
    loaded = LoadedStudy(study, robots, question, fit, placements, reason)
    if fit.posterior and loaded.count > _LARGEST_WITH_INTERVALS:
        raise InputError(f"{name}: {loaded.count} robots with a posterior; allowed: at most {_LARGEST_WITH_INTERVALS}")
    return loaded


def _read(source: str | Path | Mapping[str, Any], instead: Mapping[str, Any]) -> tuple[Study, str, Path]:
    """A checked study, its name in sentences, and the folder from which its robots are looked for."""
    folder = Path()
    if isinstance(source, Mapping):
        table, name = dict(source), "the study"
    else:
        table, name, folder = read_toml(Path(source), _WHAT), str(source), Path(source).parent
    implied = {"trial": True} if instead.get("interval") else {}
    study = problems_in(Study, {**table, **implied, **instead})
    if isinstance(study, list):
        raise refused_table(study, name)
    return study, name, folder


def _check_different(robots: Sequence[Robot], entries: Sequence[tuple[str, dict[str, Any]]], name: str) -> None:
    """Refuse a duplicate robot in a list, or one value of a varied field in two spellings."""
    seen: dict[str, int] = {}
    for number, robot in enumerate(robots):
        first = seen.setdefault(robot.model_dump_json(), number)
        if first != number:
            one, other = (
                ", ".join([source, *(f"{path} = {value}" for path, value in varied.items())])
                for source, varied in (entries[first], entries[number])
            )
            raise InputError(f"{name}: robots {one} and {other} are the same; allowed: each once")


def _check_room(study: Study, robots: Sequence[Robot], name: str) -> None:
    """Refuse a gap for which none of the channels has room; a robot in a narrower one has no answer, with a note."""
    rooms = [0.5 * (robot.channel.diameter - robot.body.diameter) for robot in robots if robot.channel is not None]
    gap = study.placement.gap
    if gap is not None and rooms and gap > max(rooms) * (1.0 + 1e-9):
        given, most = show_apart(gap, max(rooms), "mm")
        raise InputError(
            f"{name}: placement.gap = {given}; allowed: at most {most}, because there is no more room in any channel"
        )


def _check_contact(study: Study, robots: Sequence[Robot], name: str) -> None:
    """Refuse asperities that would carry more than the weight of a released robot."""
    if not (study.settled or study.trial) or study.contact.roughness is None:
        return
    from spirillum.dynamics.release import check_roughness  # loads compiled loops

    for robot in robots:
        if robot.channel is not None:
            gap = gap_of(study.placement, robot.body.diameter, 0.5 * robot.channel.diameter)
            try:
                check_roughness(study.contact.roughness, gap, robot.body.diameter)
            except InputError as error:
                raise InputError(f"{name}: contact.{error}") from error


def _named_apart(robots: tuple[Robot, ...], varied: Sequence[Mapping[str, Any]]) -> tuple[Robot, ...]:
    """The robots with what is varied in their names; the robot's own name only where there are several."""
    several = len({robot.name for robot in robots}) > 1
    every = [dict(_flat(fields)) for fields in varied]
    named = []
    for robot, fields, given in zip(robots, every, varied, strict=True):
        unique = [path for path in fields if path in given or any(other.get(path) != fields[path] for other in every)]
        tail = _tail_words([fields.get(path) for path in _VARIED]) if set(_VARIED) <= set(unique) else ""
        unique = [path for path in unique if not tail or path not in _VARIED]
        short = [path.rpartition(".")[2] for path in unique]
        words = [tail] if tail else []
        words += [
            f"{name if short.count(name) == 1 else path.replace('.', ' ')} {fields[path]}"
            for name, path in zip(short, unique, strict=True)
        ]
        name = ", ".join([robot.name, *words] if several or not words else words)
        named.append(robot.model_copy(update={"name": name[:200]}) if words else robot)
    return tuple(named)


def _tail_words(lengths: Sequence[Any]) -> str:
    """Wavelength and amplitude in one unit, as `20 x 2.5 mm`; empty where they are stated otherwise."""
    (one, unit, *_), (other, same, *_) = ((*str(length).split(), "", "") for length in lengths)
    return f"{one} x {other} {unit}" if unit and unit == same else ""


def _flat(fields: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, Any]]:
    """Fields by their dotted names, those of whole tables one by one."""
    for name, value in fields.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{above}{name}.")
        else:
            yield f"{above}{name}", value


def _fit(study: Study, calibration: str | Path | None, posterior: str | Path | None, name: str) -> Fit:
    for option in ("predicted", "settled", "trial"):
        if getattr(study, option) and not (calibration is None and posterior is None):
            raise InputError(
                f"{name}: {option} together with a calibration or posterior; allowed: one of them, for these motions "
                "are followed with nothing fitted"
            )
    if calibration is not None and posterior is not None:
        raise InputError("posterior together with a calibration; allowed: one of them")
    fit = read_fit(calibration, posterior, *(() if AUTO in study.models else study.models))
    if fit.posterior is not None and fit.posterior.places_robots:
        raise InputError(
            f"{fit.name} has its own pose for the robots of each channel, and a study one for all; allowed: "
            "`predict` of each robot with it, or the study without"
        )
    return fit


_VARIED = ("tail.wavelength", "tail.amplitude")  # fields of a robot that a grid sets


def _check_varied(study: Study, overrides: Mapping[str, Any], name: str) -> None:
    """Refuse to set what the grid varies."""
    twice = [path for path in study.vary if path in overrides]
    if twice:
        raise InputError(f"{twice[0]} is set and varied by vary of {name}, which would win; allowed: one of them")
    both = [path for path in _VARIED if path in overrides] if study.grid is not None else []
    if both:
        own = f"grid.{both[0].removeprefix('tail.')}s"
        raise InputError(
            f"{both[0]} is set and varied by {own} of {name}, which would win; allowed: other fields, or another {own}"
        )


def _fitted_poses(study: Study, robots: Sequence[Robot], fit: Fit) -> tuple[Placement, ...]:
    """Pose of each robot by a calibration, as `predict` takes it; none where the study states it, or none is needed."""
    if fit.file is None or not any(SWIMMER_MODELS[model].placed for model in study.models):
        return ()
    if fit.friction_coefficient:
        raise InputError(
            f"{fit.name} has a friction_coefficient, and a study models no dry friction; allowed: `predict` of each "
            "robot with it"
        )
    if study.placement.is_set:
        return ()
    found = [fit.calibrated_placement(robot) for robot in robots]
    if not any(found):
        return ()
    placements = tuple(place or Placement() for place in found)
    walled = next(SWIMMER_MODELS[model] for model in study.models if SWIMMER_MODELS[model].placed)
    if study.band and not all(left_open(place, walled) for place in placements):
        raise InputError(f"band = true, but {fit.name} gives the robots' pose; allowed: the study without a band")
    return placements


def _with_models(study: Study, robots: Sequence[Robot], fit: Fit, name: str) -> tuple[Study, str]:
    """The study with one model for all robots in place of `auto`, and the reason."""
    if AUTO not in study.models:
        return study, ""
    afloat = [robot.name for robot in robots if robot.channel is None]
    if afloat and len(afloat) < len(robots) and not fit.models:
        raise InputError(
            f"{name}: model 'auto' is one for all robots, and {afloat[0]} has no channel, but others have; allowed: "
            f'robots in channels alone, or models = ["{UNBOUNDED}"], which leaves out the walls'
        )
    # One that does not fit its channel has no answer, and its reason is in the dataset: it decides nothing.
    own = afloat or fit.models
    chosen = choose_model(AUTO, robots[0], fit=fit) if own else ModelChoice(WALLED, IN_CHANNEL)
    models = dict.fromkeys(chosen.model if model == AUTO else model for model in study.models)
    return study.model_copy(update={"models": tuple(models)}), chosen.reason


def _check_drives(study: Study, sources: Sequence[str], robots: Sequence[Robot], name: str) -> None:
    """Every robot needs a drive to swim by, and a joint that turns where motor rates are assumed."""
    for source, robot in zip(sources, robots, strict=True):
        if robot.drive is None:
            raise InputError(f"{name}: robot {source} has no [drive]; allowed: robots with a drive, by which they swim")
        if study.assumed_motor_rates and robot.drive.joint == "fixed":
            raise InputError(
                f"{name}: robot {source} has drive.joint = 'fixed', but the study names assumed_motor_rates; "
                "allowed: 'revolute', or no assumed_motor_rates"
            )


def _robot(entry: str, folder: Path, overrides: Mapping[str, Any], varied: Mapping[str, Any], name: str) -> Robot:
    """A robot of the study; a file stands relative to the study's folder."""
    beside = folder / entry
    source = beside if Path(entry).suffix and not Path(entry).is_absolute() else entry
    with led_by(f"{name}, with vary" if varied else name):
        return load(source, **{**overrides, **varied})


_NAMES = ("forward_velocity", "tail_rate", "body_rate", "motor_rate")


@dataclass(frozen=True)
class ObservedArrays:
    """Means and half widths of 95 % intervals in the flat order of a study, SI; NaN where not observed."""

    forward_velocity: PerRobot
    tail_rate: PerRobot
    body_rate: PerRobot
    motor_rate: PerRobot
    intervals: Mapping[str, PerRobot]
    trials: PerRobot
    source: str
    notes: tuple[Note, ...] = ()  #: On rows that do not count.

    def question(self) -> dict[str, Any]:
        """What of the observations decides the answer."""
        columns = {name: getattr(self, name).tolist() for name in _NAMES}
        return {name: [repr(value) for value in values] for name, values in columns.items()}


def observed_at(observed: ObservedArrays, indices: np.ndarray) -> ObservedArrays:
    """What was observed of some robots, by their indices in the flat order of the study."""
    columns = {name: getattr(observed, name)[indices] for name in (*_NAMES, "trials")}
    return replace(
        observed, **columns, intervals={name: column[indices] for name, column in observed.intervals.items()}
    )


def observed_arrays(path: str | Path, loaded: LoadedStudy) -> ObservedArrays:
    """Read observations and match them with the study's robots by channel, wavelength and amplitude."""
    observations = read_observations(path)
    tails = _tails(loaded)
    for item in observations:
        if item.tail not in tails:
            raise InputError(
                f"{path}, row {item.row}: no robot of the study has channel {item.channel_diameter * 1e3:g} mm, "
                f"wavelength {item.wavelength * 1e3:g} mm and amplitude {item.amplitude * 1e3:g} mm; "
                "allowed: tails of the study"
            )
    for robot in {id(tails[item.tail]): tails[item.tail] for item in observations}.values():
        check_driven(path, [item for item in observations if tails[item.tail] is robot], robot)
    kept, copies = without_copies(observations)
    means = summarised(kept)
    rows = [means.get(tail) for tail in tails]
    columns = {name: _column(rows, name, 0) for name in _NAMES}
    return ObservedArrays(
        **columns,
        intervals={name: _column(rows, name, 1) for name in _NAMES},
        trials=np.array([0 if row is None else max(getattr(row, name).trials for name in _NAMES) for row in rows])
        * 1.0,
        source=Path(path).name,
        notes=copies,
    )


def _tails(loaded: LoadedStudy) -> dict[tuple[float, float, float], Robot]:
    """(channel diameter, wavelength, amplitude) of every robot, in the flat order of the study."""
    grid = loaded.study.grid
    listed = []
    for robot in loaded.robots:
        channel = robot.channel.diameter if robot.channel else float("inf")
        wavelengths = grid.wavelengths if grid else [robot.tail.wavelength]
        amplitudes = grid.amplitudes if grid else [robot.tail.amplitude]
        listed += [((channel, w, a), robot) for w in wavelengths for a in amplitudes]
    found = {(round(c, 9), round(w, 9), round(a, 9)): robot for (c, w, a), robot in listed}
    if len(found) != len(listed):
        raise InputError(
            "two robots of the study share channel diameter, wavelength and amplitude, so that observations cannot "
            "distinguish them; allowed: robots that differ in one of them"
        )
    return found


def _column(rows: Sequence[RobotObservations | None], name: str, item: int) -> PerRobot:
    return np.array([np.nan if row is None else getattr(row, name)[item] for row in rows])
