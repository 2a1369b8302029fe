"""`spirillum.control`: a robot under control, one run with all its errors, and scores over many."""

from __future__ import annotations

import json
import time as clock
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from spirillum.answer_entries import answer_of
from spirillum.controllers.course_tasks import HoldSpeedTask, RideOutTask, SaveBatteryTask
from spirillum.controllers.estimators import Bank
from spirillum.controllers.lab import Lab
from spirillum.controllers.learning import Learner, RobotEstimate
from spirillum.controllers.loop import LoopRun
from spirillum.controllers.sensors import SampledErrors, Senses, plant_of
from spirillum.controllers.steering import KeepAxisTask
from spirillum.controllers.stop_task import StopAtTask
from spirillum.controllers.task import (
    CONTROLLERS,
    FEEDBACK,
    ControlJob,
    Outcome,
    Score,
    Scores,
    Task,
    draw_plant,
    outcome_of,
    run_job,
    scored,
)
from spirillum.display import DisplayMixin
from spirillum.dynamics.plant import Plant
from spirillum.dynamics.record import run_attributes
from spirillum.dynamics.release import reach_of
from spirillum.dynamics.run_summary import vertical_drift
from spirillum.envelope import quantity
from spirillum.errors import InputError, check_choice, check_memory, check_names, check_range
from spirillum.fitted.fit import read_fit
from spirillum.notes import Note, note_attributes
from spirillum.progress import Progress, tell
from spirillum.quantities import QUANTITIES, attributes
from spirillum.robot.fields import field_values
from spirillum.robot.load import load
from spirillum.robot.robot import Robot
from spirillum.units import show
from spirillum.worker_pool import imap_unordered

if TYPE_CHECKING:
    import xarray as xr


_TASKS: tuple[type[Task], ...] = (StopAtTask, HoldSpeedTask, RideOutTask, SaveBatteryTask, KeepAxisTask)
TASKS = {task.kind: task for task in _TASKS}  #: Tasks by their kinds.


def task_of(value: Task | Mapping[str, Any]) -> Task:
    """A task from what a caller may give."""
    if isinstance(value, Task):
        return value
    if "kind" not in value:
        raise InputError(
            f"task = {str(value)[:60]!r}; allowed: kind ({', '.join(TASKS)}) and the task's fields, by name"
        )
    kind = str(value["kind"])
    check_choice("task", kind, TASKS)
    return TASKS[kind].of({name: item for name, item in value.items() if name != "kind"})


_START = "released at its placement and controlled from time 0, without the waiting of a trial"  # how a run begins
_SEEN = {"position": "seen_position", "heading": "seen_heading", "body_angle": "seen_body_angle"}
_SEEN |= {"tail_phase": "seen_tail_phase", "side": "seen_side", "height": "seen_height"}
_MEANINGS = {"duty": "duty of the drive up to here; 0 while it is off"}


def record(run: LoopRun, plant: Plant) -> xr.Dataset:
    """A controlled run over `time`, `frame_time`, `reading_time` (meter) and `decision_time` (controller), SI."""
    import xarray as xr

    moments = run.moments
    data: dict[str, Any] = {
        "position": (("time", "axis"), run.position, attributes("position")),
        "attitude": (("time", "quaternion"), np.array([m.pose.attitude for m in moments]), attributes("attitude")),
        "imposed_flow": ("time", np.array(run.flows), attributes("imposed_flow")),
    }
    for name in moments[-1].values:
        values = np.array([m.values[name] for m in moments])
        data[name] = ("time", values, attributes(name, meaning=_MEANINGS.get(name)))
    for name, seen in _SEEN.items():
        values = np.array([np.nan if sight is None else getattr(sight, name) for _, sight in run.frames])
        data[seen] = ("frame_time", values, attributes(seen))
    for name in ("current", "voltage"):
        values = np.array([getattr(reading, name) for reading in run.readings], dtype=float)
        data[f"read_{name}"] = ("reading_time", values, attributes(f"read_{name}"))
    data["command"] = ("decision_time", np.array([d.duty for d in run.decisions]), attributes("command"))
    for name in run.decisions[-1].estimate if run.decisions else ():
        values = np.array([d.estimate.get(name, np.nan) for d in run.decisions])
        base, _, end = name.rpartition("_") if name.endswith(("_low", "_high")) else (name, "", "")
        meaning = f"{QUANTITIES[base].meaning}, {end} end of its 95 % interval" if end else None
        data[name] = ("decision_time", values, attributes(base, meaning=meaning))
    coords = {
        "time": ("time", run.time, attributes("time")),
        "frame_time": ("frame_time", np.array([time for time, _ in run.frames]), attributes("frame_time")),
        "reading_time": ("reading_time", np.array([r.time for r in run.readings]), attributes("reading_time")),
        "decision_time": ("decision_time", np.array([d.time for d in run.decisions]), attributes("decision_time")),
        "axis": ("axis", list("xyz"), {"long_name": "axis of the lab"}),
        "quaternion": ("quaternion", list("wxyz"), {"long_name": "part of the quaternion"}),
    }
    attrs = {
        "title": f"Controlled swimming of {plant.robot.name}",
        **run_attributes(plant.steady),
        "motion": "free",
        "channel_middle": reach_of(plant.robot).middle,
        "events": json.dumps([{"time": moments[-1].time, "what": run.ended}] if run.ended else []),
    }
    return xr.Dataset(data, coords=coords, attrs=attrs)


_MOST_SEEDS = 10_000
_EVENT = 3000.0  # memory of an event of a run with what the robot did until then, bytes
_LAST_SEED = 2**31 - 1
_ALLOWED = ("model", "friction", "calibrated", "calibration", "placement", "weight", "roughness", "in_tube")


@dataclass(frozen=True, repr=False)
class Control(DisplayMixin):
    """A controlled run, and scores over many."""

    robot: Robot
    model: str
    model_reason: str  #: Why the model was taken; empty where it was named.
    task: Task
    lab: Lab
    controller: str
    seed: int
    speed: float  #: Predicted while the drive is on, m/s, with its sign.
    drawn: SampledErrors  #: What the robot and the flow of this run were, and the controller did not know.
    score: Score
    run: LoopRun
    dataset: xr.Dataset  #: The run, see `docs/control.md`.
    late: float | None  #: Live: by how much the last decision was late against the clock on the wall, s.
    learnt: RobotEstimate | None
    """Friction and gap as estimated by the end of the run; None without `learn` or with too few data."""
    scores: Scores | None  #: Over many seeds; None without `seeds`.
    interrupted: bool  #: Whether run or scores were interrupted; what was done until then is here.
    warnings: tuple[Note, ...]

    def to_dict(self) -> dict[str, Any]:
        """The answer as data; with `settings`, `task`, `lab` and `seed` the run can be done again."""
        run = self.run
        return answer_of(
            self,
            goal={"kind": self.task.kind, **_fields(self.task)},
            start=_START,
            ended=run.ended or None,
            off=run.moments[-1].values["duty"] == 0.0,
            late_by=quantity(self.late, "s") if self.late is not None else None,
            taken=len(run.frames),
            unseen=sum(sight is None for _, sight in run.frames),
            sent=len(run.decisions),
            settings={name: _fields(getattr(self.lab, name)) for name in Lab.model_fields},
        )

    def _display_content(self) -> tuple[dict[str, Any], None]:
        """See `DisplayMixin`: the task's error first, then every controller's scores."""
        answer = self.to_dict()
        error, scores = answer["error"], answer["scores"] or {}
        controllers = [{"controller": name, **one} for name, one in scores.get("controllers", {}).items()]
        left_out = ("error", "scores", "commands", "frames", "lab")
        kept = {name: item for name, item in answer.items() if name not in left_out}
        verdict = "good enough" if self.score.good else "not good enough"
        return {**kept, error["meaning"]: error, "verdict": verdict, "controllers": controllers}, None


def control(
    robot: str | Path | Mapping[str, Any] | Robot,
    task: Task | Mapping[str, Any],
    *,
    lab: Lab | str | Path | Mapping[str, Any] | None = None,
    controller: str = FEEDBACK,
    seed: int = 0,
    seeds: int = 0,
    plant: Mapping[str, Any] | None = None,
    learn: bool = False,
    workers: int = 1,
    live: bool = False,
    bench: Callable[[Plant, Lab, int], Senses] | None = None,
    progress: Progress | None = None,
) -> Control:
    """Control a robot: plant, sensors, remote and controller in a closed loop, sampled from a seed.

    Args:
        robot: a preset's name, a robot file, its tables, or a loaded robot, with a drive.
        task: `kind` and its fields, as ``{"kind": "stop-at", "at": "80 mm"}``, see `docs/control.md`.
        lab: TOML file (or tables) with camera, meter, remote, pulse and unknown; None: the usual ones.
        controller: `feedback`, or a baseline: `nothing`, `open-loop`, `knowing`.
        seed: of the run: what is unknown of the robot, the flow, and all errors of sensors and remote.
        seeds: also score all controllers over so many seeds, from `seed` on; 0: none.
        plant: further arguments of `spirillum.Plant`: `model`, `placement`, `roughness`, ...
        learn: estimate friction and gap in parallel, from camera and meter, by a bank of robots.
        workers: processes for the scores.
        live: run in real time.
        bench: makes camera, meter and remote of the run from plant, lab and seed in place of the modelled ones, such as
            `spirillum.Bench`: pictures, tracker and a remote at a port. Scores are of the modelled ones.
        progress: called with stage, number done, and total.

    Returns:
        The run and the scores; with an interrupt what was done until then. The drive is off at the end of every run.

    Raises:
        InputError: for wrong input, or a task that the robot cannot be asked for.
    """
    task, lab, arguments = task_of(task), Lab.of(lab), dict(plant or {})
    _check(controller, seed, seeds, workers, arguments)
    robot, arguments["calibration"] = load(robot), read_fit(arguments.get("calibration"))
    nominal = plant_of(robot, arguments, SampledErrors(1.0, 1.0), progress)
    cautions: list[Note] = []
    if nominal.model != "tube" and lab.pulse.velocity:  # without walls there is no imposed flow
        lab = lab.model_copy(update={"pulse": lab.pulse.model_copy(update={"velocity": 0.0})})
        cautions = [Note.named("pulse-left-out", model=nominal.model)]
    job = ControlJob(robot, arguments, task, task.brief(nominal, lab, progress), controller, seed)
    duration, rate = job.brief.duration, lab.camera.fps + lab.meter.rate + 2.0 / lab.remote.period
    cause = f"task.duration = {show(duration, 's')} with {rate:.4g} frames, readings, decisions and commands a second"
    check_memory(cause, duration * rate, "events", _EVENT, "as with a shorter duration or a lower camera.fps")
    actual, drawn = draw_plant(job)
    learner = Learner(lab, Bank(robot, lab.unknown, arguments, progress)) if learn else None
    pace = _Pace() if live else None
    senses = None if bench is None else bench(actual, lab, seed)
    run = run_job(job, actual, drawn, learner, senses=senses, pace=pace, progress=progress)
    scores, cut_short = (None, []) if run.interrupted or not seeds else _scores(job, seeds, workers, progress)
    dataset = _dataset(job, run, actual)
    drift = [] if actual.model == "tube" else vertical_drift(dataset)
    warnings = (*actual.warnings, *drift, *cautions, *cut_short, *_warnings_of(run, lab))
    return Control(
        robot=robot,
        model=actual.model,
        model_reason=actual.steady.answered_by.get("model_reason", ""),
        task=task,
        lab=lab,
        controller=controller,
        seed=seed,
        speed=job.brief.speed,
        drawn=drawn,
        score=task.score(run, job.brief),
        run=run,
        dataset=dataset.assign_attrs(note_attributes(warnings)),
        late=None if pace is None else pace.late,
        learnt=None if learner is None else learner.learnt,
        scores=scores,
        interrupted=run.interrupted or bool(cut_short),
        warnings=warnings,
    )


class _Pace:
    """The clock on the wall."""

    def __init__(self) -> None:
        self._start: float | None = None
        self.late = 0.0

    def __call__(self, time: float) -> None:
        """Wait for a time of the run."""
        if self._start is None:
            self._start = clock.monotonic() - time
        left = self._start + time - clock.monotonic()
        if left > 0.0:
            clock.sleep(left)
        self.late = max(0.0, -left)


def _scores(job: ControlJob, seeds: int, workers: int, progress: Progress | None) -> tuple[Scores | None, list[Note]]:
    """Scores of every controller from every seed; with an interrupt of the runs that are done, and a sentence."""
    jobs = [replace(job, controller=name, seed=job.seed + n) for n in range(seeds) for name in CONTROLLERS]
    outcomes: list[Outcome] = []
    try:
        for _job, outcome in imap_unordered(outcome_of, jobs, workers):
            outcomes.append(outcome)
            tell(progress, "scored runs", len(outcomes), len(jobs))
    except KeyboardInterrupt:
        pass
    cut_short = [Note.named("scores-cut-short", done=len(outcomes), all=len(jobs))]
    return scored(job.task, outcomes) if outcomes else None, cut_short if len(outcomes) < len(jobs) else []


def _dataset(job: ControlJob, run: LoopRun, plant: Plant) -> xr.Dataset:
    """The run as a dataset, with all that it can be done again from."""
    settings = {
        "task": {"kind": job.task.kind, **job.task.model_dump()},
        "lab": job.brief.lab.model_dump(),
        "controller": job.controller,
        "seed": job.seed,
    }
    return record(run, plant).assign_attrs(
        control=json.dumps(settings, sort_keys=True), task=job.task.kind, controller=job.controller, seed=job.seed
    )


def _check(controller: str, seed: int, seeds: int, workers: int, arguments: Mapping[str, Any]) -> None:
    check_choice("controller", controller, CONTROLLERS)
    check_range("seeds", seeds, 0, _MOST_SEEDS)
    check_range("seed", seed, 0, _LAST_SEED - seeds)
    check_range("workers", workers, 1, 256)
    if workers > 1 and not seeds:
        raise InputError(f"workers = {workers} without seeds, whose runs they share; allowed: 1, or seeds from 1")
    check_names("plant", arguments, _ALLOWED, "known")


def _warnings_of(run: LoopRun, lab: Lab) -> list[Note]:
    warnings = []
    end, latency = run.moments[-1].time, lab.camera.latency
    if latency >= end:
        warnings.append(Note.named("no-picture-in-time", latency=show(latency, "s"), end=show(end, "s")))
    if run.silent is not None:
        warnings.append(Note.named("camera-silent", time=show(run.silent, "s")))
    if run.ended:
        warnings.append(Note.named("control-ended", time=show(end, "s"), why=run.ended))
    return warnings


def _fields(options: Any) -> dict[str, Any]:
    return {
        item.path: item.value if item.unit is None or item.value is None else quantity(item.value, item.unit)
        for item in field_values(options)
    }
