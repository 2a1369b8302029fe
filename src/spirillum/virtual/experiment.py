"""A virtual experiment: several trials of each robot of a study, with planted differences from trial to trial."""

from __future__ import annotations

import hashlib
import json
import sys
import threading
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
from pydantic import BeforeValidator

from spirillum.answer_entries import answer_of
from spirillum.display import DisplayMixin
from spirillum.errors import InputError
from spirillum.files import (
    MARK,
    file_name,
    guard_inputs,
    opened,
    output_folder,
    read_json,
    results_folder,
    text_cell,
    write_text,
    written_by_us,
)
from spirillum.notes import Note
from spirillum.progress import Progress, tell
from spirillum.quantities import in_units
from spirillum.robot.arguments import in_range, whole
from spirillum.robot.fields import Time
from spirillum.robot.load import PAPER_ROBOTS, is_preset, load
from spirillum.robot.placement import Placement
from spirillum.robot.robot import Robot
from spirillum.robot.tube_pose import gap_of
from spirillum.swimming.preparation import AUTO
from spirillum.units import Hz
from spirillum.version import package_version
from spirillum.virtual.artifacts import Degradation
from spirillum.virtual.motion import steady_rates
from spirillum.virtual.optics import swimming_range
from spirillum.virtual.trial import render
from spirillum.virtual.trial_options import CameraOptions, MotionOptions, Seeded, TrialOptions
from spirillum.virtual.truth import SYNTHETIC

_LONGEST = 20.0
_MOST = 10_000
_MARK = "virtual-experiment.json"
_TABLE = "truth-observations.csv"
_COLUMNS = ["robot", "channel_diameter_mm", "wavelength_mm", "amplitude_mm", "trial"]
_RATES = ["forward_velocity_mm_s", "tail_rate_Hz", "body_rate_Hz", "motor_rate_Hz"]


class _Plan(Seeded):
    """Number of trials of each robot, their duration and variation."""

    trials: Annotated[int, BeforeValidator(whole(1, 1000))] = 5
    spread: Annotated[float, BeforeValidator(in_range(0.0, 0.3))] = 0.02
    duration: Time | None = None
    jobs: Annotated[int, BeforeValidator(whole(1, 64))] = 1


@dataclass(frozen=True)
class Planned:
    """One trial to render."""

    folder: str
    robot: Robot
    number: int
    rates: Mapping[str, float]  #: The steady rates times the trial's random factor, SI.
    trial: TrialOptions
    seed: int

    @property
    def name(self) -> str:
        """Name of its files, by which `measure` calls it too."""
        return f"trial-{self.number}"

    @property
    def label(self) -> str:
        """Path of the trial in the experiment's folder."""
        return f"{self.folder}/{self.name}"


@dataclass(frozen=True, repr=False)
class VirtualExperiment(DisplayMixin):
    """A virtual experiment that was written."""

    folder: Path
    robots: tuple[str, ...]  #: Folder of each robot.
    trials: int  #: Trials of each robot.
    kept: int  #: Trials that were there already.
    spread: float  #: Planted standard deviation of the motor's rate from trial to trial, relative.
    observations: Path  #: The true rates of all trials as an observations file.
    rates: Mapping[str, Mapping[str, float]]  #: Rates of each robot without the planted differences, SI.
    models: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    """Of each robot, what its rates are from, and why that model was taken."""
    warnings: tuple[Note, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """The experiment's facts, as ``virtual-experiment --json`` prints them."""
        filmed = []
        for name in self.robots:
            known = zip(("model", "model_reason"), self.models.get(name, ("", "")), strict=True)
            answered = {key: text for key, text in known if text}  # without a reason where the model was named
            filmed.append({"robot": name, **answered, **in_units(self.rates[name])})
        return answer_of(self, filmed=filmed)


def virtual_experiment(
    study: str | Path | Mapping[str, Any] | None = None,
    output: str | Path = "spirillum-virtual-experiment",
    *,
    trials: int = 5,
    motion: MotionOptions | Mapping[str, Any] | None = None,
    spread: float = 0.02,
    duration: str | float | None = None,
    camera: CameraOptions | Mapping[str, Any] | None = None,
    degradation: str | Degradation | Mapping[str, Any] | None = None,
    seed: int = 0,
    jobs: int = 1,
    progress: Progress | None = None,
) -> VirtualExperiment:
    """Render several trials of each robot of a study; all of it is synthetic.

    Every trial has the model's steady rates times one random factor, the planted spread of the motor's rate: without
    inertia all rates are proportional to it. Positions and phases at the start are random.

    Args:
        study: study file or its tables; None: the paper's robots in both of its tubes.
        output: folder; a finished trial that is there and whole is kept, another experiment in it is refused.
        trials: of each robot, 1 to 1000.
        motion: `MotionOptions`: model, tail rate, friction, prescribed rates; the model is by default the study's
            first, without a study the one of `predict`.
        spread: relative standard deviation of the motor's rate from trial to trial, 0 to 0.3.
        duration: of each trial, with its unit or a float in s; None: as long as the robot is in view, at most 20 s.
        camera: `CameraOptions`: view, direction, frame rate, size of the picture, exposure, field of view, distortion.
        degradation: `clean`, `degraded`, or `Degradation`: noise, compression, lost frames, ...
        seed: of all random numbers.
        jobs: number of parallel renderings, 1 to 64.
        progress: called with stage, number done, and total.

    Returns:
        What was written.

    Raises:
        InputError: for wrong input, or a folder of another experiment.
    """
    plan = _Plan.of({"trials": trials, "jobs": jobs, "seed": seed, "spread": spread, "duration": duration})
    motion, camera, degradation = MotionOptions.of(motion), CameraOptions.of(camera), Degradation.of(degradation)
    if plan.duration is not None and plan.duration * camera.fps < 1.0:
        frame = 1.0 / camera.fps
        raise InputError(f"duration = {plan.duration:g} s; allowed: at least the {frame:.4g} s of a frame")
    robots, default_model, placement = _robots(study)
    if len(robots) * plan.trials > _MOST:
        raise InputError(f"{len(robots)} robots with {plan.trials} trials each; allowed: at most {_MOST} videos")
    steady, models, warnings = {}, {}, []
    for name, robot in robots.items():
        steady[name], source, notes, reason = steady_rates(robot, motion, default_model, placement)
        models[name] = source, reason
        warnings += [note.prefixed(f"{name}: ") for note in notes]
    question = {
        "robots": {name: robot.model_dump(mode="json") for name, robot in robots.items()},
        "rates": steady,
        "plan": plan.model_dump(exclude={"jobs"}),
        "camera": camera.model_dump(),
        "degradation": degradation.model_dump(),
        "version": package_version(),
    }
    mark = {
        "schema": "spirillum.virtual-experiment-folder/1",
        "synthetic": True,
        "fingerprint": hashlib.sha256(json.dumps(question, sort_keys=True).encode()).hexdigest(),
        "spread": plan.spread,
        "seed": plan.seed,
    }
    planned = [
        item
        for index, (name, robot) in enumerate(robots.items())
        for item in _planned((index, name), robot, placement, steady[name], plan, camera)
    ]
    claim = {"mark": _MARK, "content": mark, "what": "virtual experiment"}
    inputs = study if isinstance(study, (str, Path)) else None
    with guard_inputs(inputs), results_folder(output, claim=claim) as folder:
        missing = [item for item in planned if not _finished(folder, item)]
        for name in robots:
            output_folder(folder / name, folder)
        render_one = partial(_render_one, folder, camera, degradation)
        _render_all(render_one, missing, len(planned), plan.jobs, progress)
        table = folder / _TABLE
        write_text(table, _table(planned))
    return VirtualExperiment(
        folder=folder,
        robots=tuple(robots),
        trials=plan.trials,
        kept=len(planned) - len(missing),
        spread=plan.spread,
        observations=table,
        rates=steady,
        models=models,
        warnings=tuple(dict.fromkeys(warnings)),
    )


class _Filmed(NamedTuple):
    """Content of an experiment: robots and trials."""

    robots: dict[str, Robot]  # by the names of their folders
    model: str  # the study's first
    placement: Placement | None  # poses of the robots in the study


def _robots(study: str | Path | Mapping[str, Any] | None) -> _Filmed:
    if study is None:
        return _Filmed({name: load(name) for name in PAPER_ROBOTS}, AUTO, None)
    from spirillum.studies.study_loader import load_study

    loaded = load_study(study)
    if loaded.count > _MOST:
        raise InputError(f"the study has {loaded.count} robots; allowed: at most {_MOST} videos")
    found: dict[str, Robot] = {}
    for index in range(loaded.count):
        robot = loaded.robot_at(index)
        name = robot.name
        if loaded.study.grid is not None:
            tail = robot.tail
            name = f"{name}-{1e3 * tail.wavelength:g}-{1e3 * tail.amplitude:g}"
            robot = robot.model_copy(update={"name": name})
        found[file_name(name, {*found, _MARK, _TABLE})] = robot
    placement = loaded.study.placement if loaded.study.placement.is_set else None
    return _Filmed(found, loaded.study.models[0], placement)


def _planned(
    numbered: tuple[int, str],
    robot: Robot,
    placement: Placement | None,
    steady: Mapping[str, float],
    plan: _Plan,
    camera: CameraOptions,
) -> list[Planned]:
    """The trials of one robot, which has its number and the name of its folder."""
    (index, name), gap, planned = numbered, None, []
    if placement is not None and robot.channel is not None:  # else it is shown at the reference pose
        gap = gap_of(placement, robot.body.diameter, 0.5 * robot.channel.diameter)
    low, high = swimming_range(robot, camera)
    for number in range(1, plan.trials + 1):
        rng = np.random.default_rng([plan.seed, index, number])
        factor = float(max(1.0 + plan.spread * rng.standard_normal(), 0.1))
        rates = {key: factor * value for key, value in steady.items()}
        velocity = rates["forward_velocity"]
        duration = plan.duration
        if duration is None:
            duration = min(_LONGEST, 0.9 * max(high - low, 0.1 * robot.body.length) / max(abs(velocity), 1e-12))
        spare = max(high - low - abs(velocity) * duration, 0.0)
        start = low + float(rng.uniform(0.1, 0.9)) * spare + (abs(velocity) * duration if velocity < 0 else 0.0)
        trial = TrialOptions.of(
            {
                "duration": duration,
                "start": start,
                "body_angle": float(rng.uniform(0.0, 2.0 * np.pi)),
                "tail_phase": float(rng.uniform(0.0, 2.0 * np.pi)),
                "gap": gap,
            }
        )
        planned.append(Planned(name, robot, number, rates, trial, int(rng.integers(2**31))))
    return planned


def _finished(folder: Path, planned: Planned) -> bool:
    """Whether a trial is there, with no file missing or visibly damaged."""
    trial = folder / planned.label
    known = ["setup.toml"] if is_preset(planned.robot) else ["setup.toml", "robot.toml"]
    try:
        read_json(trial.with_name(f"{trial.name}.truth.json"), "the truth of a trial")
        with opened(trial.with_name(f"{trial.name}.truth.nc"), "a file of a trial", sys.maxsize) as file:
            begins = file.read(8)
        whole = _is_complete_video(trial.with_name(f"{trial.name}.mp4")) and begins == b"\x89HDF\r\n\x1a\n"
        return whole and all((trial.parent / name).stat().st_size > 0 for name in known)
    except (OSError, ValueError):
        return False


def _is_complete_video(path: Path) -> bool:
    """Whether a file is a complete MP4 video: its boxes, each with its length first, fill it."""
    size, offset, kinds = path.stat().st_size, 0, set()
    with opened(path, "a video of a trial", sys.maxsize) as file:
        while offset < size:
            file.seek(offset)
            head = file.read(16)
            length, kind = int.from_bytes(head[:4], "big"), head[4:8]
            if length == 1:  # its length follows, in 64 bits
                length = int.from_bytes(head[8:], "big")
            if length < len(head[:8]) or len(head) < 8:
                return False
            kinds.add(kind)
            offset += length
    return offset == size and {b"ftyp", b"moov", b"mdat"} <= kinds


class _Stopped(Exception):  # noqa: N818
    """Rendering was interrupted."""


def _render_one(
    folder: Path, camera: CameraOptions, degradation: Degradation, planned: Planned, stop: threading.Event
) -> None:
    """Render one trial into a folder, until an event stops it."""

    def check_stop(_what: str, _done: int, _total: int) -> None:
        if stop.is_set():
            raise _Stopped

    trial = folder / planned.label
    beside = [trial.with_name(f"{trial.name}.{end}") for end in ("mp4", "truth.json", "truth.nc")]
    for damaged in (*beside, trial.parent / "setup.toml", trial.parent / "robot.toml"):
        if damaged.is_file() and not written_by_us(damaged):  # the folder is claimed: it was ours
            damaged.unlink()
    render(
        planned.robot,
        beside[0],
        motion={
            "forward_velocity": planned.rates["forward_velocity"],
            "tail_rate": planned.rates["tail_rotation_rate"],
            "body_rate": planned.rates["body_rotation_rate"],
        },
        trial=planned.trial,
        camera=camera,
        degradation=degradation,
        setup=trial.parent / "setup.toml",
        seed=planned.seed,
        progress=check_stop,
    )


def _render_all(
    render_one: Callable[[Planned, threading.Event], None],
    missing: list[Planned],
    total: int,
    jobs: int,
    progress: Progress | None,
) -> None:
    """Render what is missing; after an interruption, finished trials stay and no unfinished one is left."""
    stop = threading.Event()
    done = total - len(missing)
    tell(progress, "virtual experiment", done, total)
    with ThreadPoolExecutor(jobs) as pool:
        labels = {pool.submit(render_one, planned, stop): planned.label for planned in missing}
        try:
            for future in as_completed(labels):
                future.result()
                done += 1
                tell(progress, labels[future], done, total)
        except BaseException:
            stop.set()
            for future in labels:
                future.cancel()
            raise


def _table(planned: list[Planned]) -> str:
    """The truth as an observations file; robots and trials have the names that `measure` gives them."""
    about = f"# {SYNTHETIC.replace('synthetic', 'SYNTHETIC', 1)}; true rates, with planted differences between trials"
    lines = [about, f"# {MARK}", ",".join(_COLUMNS + _RATES)]
    for item in planned:
        robot, rates = item.robot, item.rates
        channel = "" if robot.channel is None else f"{1e3 * robot.channel.diameter:.9g}"
        tail, body = rates["tail_rotation_rate"] / Hz, rates["body_rotation_rate"] / Hz
        numbers = (1e3 * rates["forward_velocity"], tail, body, tail - body)
        shape = f"{channel},{1e3 * robot.tail.wavelength:.9g},{1e3 * robot.tail.amplitude:.9g}"
        lines.append(f"{text_cell(robot.name)},{shape},{item.name},{','.join(f'{value:.9g}' for value in numbers)}")
    return "\n".join(lines) + "\n"
