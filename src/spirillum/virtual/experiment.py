"""A virtual experiment: several trials of each robot of a study, with planted differences from trial to trial."""

from __future__ import annotations

import hashlib
import json
import re
import threading
from collections.abc import Callable, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from spirillum.answer import envelope
from spirillum.errors import InputError
from spirillum.files import claim_folder, output_folder, write_text
from spirillum.robot.load import PAPER_ROBOTS, load
from spirillum.robot.robot import Robot
from spirillum.units import KINDS, Hz, parse_option
from spirillum.version import own_version
from spirillum.virtual.degradation import Degradation, degradation_of
from spirillum.virtual.motion import steady_rates
from spirillum.virtual.options import DIRECTIONS, VIEWS, checked_fps, checked_seed, checked_size, one_of, whole_number
from spirillum.virtual.robot_file import is_preset
from spirillum.virtual.trial import render, room
from spirillum.virtual.truth import SYNTHETIC, rate_quantities

__all__ = ["Planned", "VirtualExperiment", "virtual_experiment"]

_LONGEST = 20.0
_MOST = 10_000
_MARK = "virtual-experiment.json"
_TABLE = "truth-observations.csv"
_COLUMNS = ["robot", "channel_diameter_mm", "wavelength_mm", "amplitude_mm", "trial"]
_RATES = ["forward_velocity_mm_s", "tail_rate_Hz", "body_rate_Hz", "motor_rate_Hz"]


@dataclass(frozen=True)
class Planned:
    """One trial to render."""

    folder: str
    robot: Robot
    number: int
    rates: Mapping[str, float]
    duration: float
    options: Mapping[str, Any]

    @property
    def words(self) -> str:
        """What it is called."""
        return f"{self.folder}/trial-{self.number}"


@dataclass(frozen=True)
class VirtualExperiment:
    """A virtual experiment that was written."""

    folder: Path
    robots: tuple[str, ...]
    """Folder of each robot."""
    trials: int
    """Trials of each robot."""
    kept: int
    """Trials that were there already."""
    spread: float
    """Planted standard deviation of the motor's rate from trial to trial, relative."""
    observations: Path
    """The true rates of all trials as an observations file."""
    rates: Mapping[str, Mapping[str, float]]
    """Rates of each robot without the planted differences, SI."""
    warnings: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """The experiment's facts, as ``virtual-experiment --json`` prints them."""
        robots = [{"robot": name, **rate_quantities(self.rates[name])} for name in self.robots]
        content = {
            "synthetic": True,
            "folder": str(self.folder),
            "robots": robots,
            "trials": self.trials,
            "kept": self.kept,
            "spread": self.spread,
            "observations": str(self.observations),
        }
        return envelope("virtual-experiment", content, self.warnings)


def virtual_experiment(
    study: str | Path | Mapping[str, Any] | None = None,
    output: str | Path = "spirillum-virtual-experiment",
    *,
    trials: int = 5,
    model: str | None = None,
    friction: str | None = None,
    tail_rate: str | float | None = None,
    spread: float = 0.02,
    duration: str | float | None = None,
    degradation: str | Degradation = "clean",
    view: str = "top",
    direction: str = "right",
    fps: float = 30.0,
    size: str | tuple[int, int] = (640, 480),
    seed: int = 0,
    jobs: int = 1,
    progress: Callable[[str, int, int], None] | None = None,
) -> VirtualExperiment:
    """Render several trials of each robot of a study; all of it is synthetic.

    Every trial has the model's steady rates times one random factor, the planted spread of the motor's rate: without
    inertia all rates go with it. Places and phases at the start are random.

    Args:
        study: study file or its tables; None: the paper's robots in both of its tubes.
        output: folder; a finished trial that is there and whole is kept, another experiment in it is refused.
        trials: of each robot, 1 to 1000.
        model: hydrodynamic model; None: the study's first, `sbt` without a study.
        friction: reading of the friction; None: the robot's own.
        tail_rate: lab rotation rate of the tail, with its unit or a float in rad/s; None: each robot's drive.
        spread: relative standard deviation of the motor's rate from trial to trial, 0 to 0.3.
        duration: of each trial, with its unit or a float in s; None: as long as the robot is in view, at most 20 s.
        degradation: `clean`, `degraded`, or a `Degradation`.
        view: `top` or `side`.
        direction: where the nose points in the picture, `right` or `left`.
        fps: frames a second.
        size: width and height in pixels, even numbers, or ``"640x480"``.
        seed: of all random numbers.
        jobs: trials that are rendered at the same time.
        progress: told what is done, how many trials are done, and how many there are.

    Returns:
        What was written.

    Raises:
        InputError: for wrong input, or a folder of another experiment.
    """
    trials, jobs = whole_number("trials", trials, 1, 1000), whole_number("jobs", jobs, 1, 64)
    seed = checked_seed(seed)
    if isinstance(spread, bool) or not 0.0 <= spread <= 0.3:
        raise InputError(f"spread = {spread!r}; allowed: 0 to 0.3")
    look: dict[str, Any] = {
        "degradation": degradation_of(degradation),
        "view": one_of("view", view, VIEWS),
        "direction": one_of("direction", direction, DIRECTIONS),
        "fps": checked_fps(fps),
        "size": checked_size(size),
    }
    longest = None if duration is None else parse_option("duration", duration, KINDS["time"])
    if longest is not None and longest * look["fps"] < 1.0:
        raise InputError(f"duration = {longest:g} s; allowed: at least the {1.0 / look['fps']:.4g} s of a frame")
    robots, model = _robots(study, model)
    if len(robots) * trials > _MOST:
        raise InputError(f"{len(robots)} robots with {trials} trials each; allowed: at most {_MOST} videos")
    steady, warnings = {}, []
    for name, robot in robots.items():
        rates, _, said = steady_rates(robot, model=model, tail_rate=tail_rate, friction=friction)
        steady[name] = rates
        warnings += [f"{name}: {sentence}" for sentence in said]
    folder = Path(output)
    question = {
        "robots": {name: robot.model_dump(mode="json") for name, robot in robots.items()},
        "rates": steady,
        "trials": trials,
        "spread": spread,
        "duration": longest,
        "seed": seed,
        "look": look | {"degradation": asdict(look["degradation"])},
        "version": own_version(),
    }
    mark = {
        "schema": "spirillum.virtual-experiment-folder/1",
        "synthetic": True,
        "fingerprint": hashlib.sha256(json.dumps(question, sort_keys=True).encode()).hexdigest(),
        "spread": spread,
        "seed": seed,
    }
    claim_folder(folder, _MARK, mark, "virtual experiment")
    planned = [
        plan
        for place, name in enumerate(robots)
        for plan in _planned(name, robots[name], steady[name], trials, spread, longest, look, (seed, place))
    ]
    todo = [plan for plan in planned if not _finished(folder, plan)]
    for name in robots:
        output_folder(folder / name)
    _render_all(folder, todo, len(planned), jobs, progress or (lambda _what, _done, _total: None))
    table = folder / _TABLE
    write_text(table, _table(planned))
    kept = len(planned) - len(todo)
    return VirtualExperiment(folder, tuple(robots), trials, kept, spread, table, steady, tuple(dict.fromkeys(warnings)))


def _robots(study: str | Path | Mapping[str, Any] | None, model: str | None) -> tuple[dict[str, Robot], str]:
    """Robots by the names of their folders, and the model."""
    if study is None:
        return {name: load(name) for name in PAPER_ROBOTS}, model or "sbt"
    from spirillum.studies.spec import load_study

    loaded = load_study(study)
    if loaded.count > _MOST:
        raise InputError(f"the study has {loaded.count} robots; allowed: at most {_MOST} videos")
    found: dict[str, Robot] = {}
    for place in range(loaded.count):
        robot = loaded.robot_at(place)
        name = robot.name
        if loaded.study.grid is not None:
            tail = robot.tail
            name = f"{name}-{1e3 * tail.wavelength:g}-{1e3 * tail.amplitude:g}"
            robot = robot.model_copy(update={"name": name})
        name = re.sub(r"[^\w.-]+", "-", name)[:100]
        if name in found:
            name = f"{name}-{place + 1}"
        found[name] = robot
    return found, model or loaded.study.models[0]


def _planned(
    name: str,
    robot: Robot,
    steady: Mapping[str, float],
    trials: int,
    spread: float,
    longest: float | None,
    look: Mapping[str, Any],
    seeds: tuple[int, int],
) -> list[Planned]:
    """The trials of one robot."""
    plans = []
    low, high = room(robot, look["view"], look["size"], leftwards=look["direction"] == "left")
    for number in range(1, trials + 1):
        rng = np.random.default_rng([*seeds, number])
        factor = float(max(1.0 + spread * rng.standard_normal(), 0.1))
        rates = {key: factor * value for key, value in steady.items()}
        speed = abs(rates["forward_velocity"])
        time = longest
        if time is None:
            time = min(_LONGEST, 0.9 * max(high - low, 0.1 * robot.body.length) / max(speed, 1e-12))
        spare = max(high - low - speed * time, 0.0)
        first = low + float(rng.uniform(0.1, 0.9)) * spare + (speed * time if rates["forward_velocity"] < 0 else 0.0)
        options = {
            **look,
            "start": first,
            "body_angle": float(rng.uniform(0.0, 2.0 * np.pi)),
            "tail_phase": float(rng.uniform(0.0, 2.0 * np.pi)),
            "seed": int(rng.integers(2**31)),
        }
        plans.append(Planned(name, robot, number, rates, time, options))
    return plans


def _finished(folder: Path, plan: Planned) -> bool:
    """Whether a trial is there: its files appear together, and none of them was damaged since in a way that shows."""
    trial = folder / plan.folder / f"trial-{plan.number}"
    known = ["setup.toml"] if is_preset(plan.robot) else ["setup.toml", "robot.toml"]
    try:
        json.loads(trial.with_name(f"{trial.name}.truth.json").read_text(encoding="utf-8"))
        begins = {end: _first_bytes(trial.with_name(f"{trial.name}.{end}")) for end in ("mp4", "truth.nc")}
        whole = begins["mp4"][4:] == b"ftyp" and begins["truth.nc"] == b"\x89HDF\r\n\x1a\n"
        return whole and all((trial.parent / name).stat().st_size > 0 for name in known)
    except (OSError, ValueError, RecursionError):
        return False


def _first_bytes(path: Path) -> bytes:
    """The eight bytes that tell a kind of file."""
    with path.open("rb") as file:
        return file.read(8)


def _render_all(
    folder: Path, todo: list[Planned], total: int, jobs: int, tell: Callable[[str, int, int], None]
) -> None:
    """Render what is missing; when interrupted, what is finished stays and nothing half done."""
    stop = threading.Event()
    done = total - len(todo)
    tell("virtual experiment", done, total)
    with ThreadPoolExecutor(jobs) as pool:
        waiting: set[Future[str]] = {pool.submit(_render, folder, plan, stop) for plan in todo}
        try:
            while waiting:
                ready, waiting = wait(waiting, return_when=FIRST_COMPLETED)
                for future in ready:
                    done += 1
                    tell(future.result(), done, total)
        except BaseException:
            stop.set()
            for future in waiting:
                future.cancel()
            raise


class _Stopped(Exception):  # noqa: N818
    """Rendering was interrupted."""


def _render(folder: Path, plan: Planned, stop: threading.Event) -> str:
    def look_up(_what: str, _done: int, _total: int) -> None:
        if stop.is_set():
            raise _Stopped

    render(
        plan.robot,
        folder / plan.folder / f"trial-{plan.number}.mp4",
        forward_velocity=plan.rates["forward_velocity"],
        tail_rate=plan.rates["tail_rotation_rate"],
        body_rate=plan.rates["body_rotation_rate"],
        duration=plan.duration,
        setup=folder / plan.folder / "setup.toml",
        progress=look_up,
        **plan.options,
    )
    return plan.words


def _table(planned: list[Planned]) -> str:
    """The truth as an observations file."""
    about = f"# {SYNTHETIC.replace('synthetic', 'SYNTHETIC', 1)}; true rates, with planted differences between trials"
    lines = [about, ",".join(_COLUMNS + _RATES)]
    for plan in planned:
        robot, rates = plan.robot, plan.rates
        channel = "" if robot.channel is None else f"{1e3 * robot.channel.diameter:.9g}"
        tail, body = rates["tail_rotation_rate"] / Hz, rates["body_rotation_rate"] / Hz
        numbers = (1e3 * rates["forward_velocity"], tail, body, tail - body)
        shape = f"{channel},{1e3 * robot.tail.wavelength:.9g},{1e3 * robot.tail.amplitude:.9g}"
        lines.append(f"{plan.folder},{shape},{plan.number},{','.join(f'{value:.9g}' for value in numbers)}")
    return "\n".join(lines) + "\n"
