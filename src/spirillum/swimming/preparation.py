"""Preparation of a robot: the choice of its model, its pose inside the model's domain, and its table in its tube.

One robot has one answer. What a calibration or a posterior was fitted with answers for what it has fitted. Else a robot
with a channel is predicted in its channel, by `tube`, or refused there, and a robot without one is predicted by
`slender`, which resolves the same robot in unbounded fluid.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from spirillum.answer_entries import content_of
from spirillum.display import DisplayMixin
from spirillum.envelope import envelope
from spirillum.errors import InputError
from spirillum.fitted.fit import NO_FIT, Fit
from spirillum.fluid.model import SwimmerModel
from spirillum.fluid.registry import SWIMMER_MODELS, check_placement, find_swimmer_model, quickest
from spirillum.fluid.tube.cache import check_cache_folder
from spirillum.fluid.tube.domain import in_tube
from spirillum.fluid.tube.library import TabledTube, find_table, has_table_cache, prepared_tables, tabled
from spirillum.fluid.tube.nodes import Places
from spirillum.fluid.tube.stages import RESPONSES, STAGES, StageName, stage_of
from spirillum.fluid.tube.table import TubeTable
from spirillum.fluid.wire.robot_geometry import RobotGeometry
from spirillum.kernels.native import processor_count
from spirillum.kernels.tube_table import range_of
from spirillum.notes import Note
from spirillum.progress import Progress
from spirillum.robot.batch import RobotBatch
from spirillum.robot.limits import Limit, all_hold, assembly_limits, broken, reynolds_limits, stokes_flow_problem
from spirillum.robot.load import load, with_resolution
from spirillum.robot.model_options import ModelOptions, Resolution
from spirillum.robot.placement import Placement
from spirillum.robot.robot import Robot
from spirillum.robot.tube_pose import GAP_SHARE
from spirillum.swimming.steady import swim
from spirillum.units import show, show_apart

AUTO = "auto"  #: Name that leaves the choice of the model to `choose_model`.
WALLED, UNBOUNDED = "tube", "slender"  #: What answers for a robot in a channel, and for one without.
IN_CHANNEL = "the robot is in a channel, whose walls this model computes"  #: Why the model with walls is taken.
NO_CHANNEL = "the robot has no channel"  #: Why the model of unbounded fluid is taken.


def fitted_with(source: str) -> str:
    """Return the reason of a model that a calibration or a posterior of that name was fitted with."""
    return f"{source} was fitted with it"


@dataclass(frozen=True)
class ModelChoice:
    """A hydrodynamic model, and why it was taken."""

    model: str
    reason: str = ""  #: Its reason, in half a sentence; empty where it was named.
    fitted: bool = False  #: Whether it is the model of a calibration or a posterior.


def choose_model(asked: str, robot: Robot, *, placement: Placement | None = None, fit: Fit = NO_FIT) -> ModelChoice:
    """The named model, or with `auto` that of a fit, else the one with the walls of the robot's channel."""
    if asked != AUTO:
        return ModelChoice(find_swimmer_model(asked, AUTO).name)
    names = fit.models
    if len(names) > 1:
        raise InputError(f"{fit.name} holds factors for models {', '.join(names)}; allowed: --model with one of them")
    if names:
        return ModelChoice(names[0], fitted_with(fit.name), fitted=True)
    if robot.channel is None:
        return ModelChoice(UNBOUNDED, NO_CHANNEL)
    batch = RobotBatch.of(robot, placement or Placement())
    outside = broken(find_swimmer_model(WALLED).requirements(batch))
    if outside and (placement is None or not placement.is_set):  # a pose is refused by the model that takes poses
        said = f"{robot.name} with model '{WALLED}', which answers in a channel: {outside[0].sentence()}"
        for name in (UNBOUNDED, *(name for name, model in SWIMMER_MODELS.items() if not model.placed)):
            if not broken(find_swimmer_model(name).requirements(batch)):
                raise InputError(f"{said}; or model '{name}', which leaves out the walls")
        raise InputError(said)
    return ModelChoice(WALLED, IN_CHANNEL)


def models_without_answer(robot: Robot) -> list[str]:
    """A sentence on each model that refuses the robot, level in its channel: for its sizes, or for its own motion."""
    batch = RobotBatch.of(robot)
    found = []
    for name, model in SWIMMER_MODELS.items():
        if model.placed and robot.channel is None:
            continue
        outside = broken(model.requirements(batch))
        if problem := outside[0].sentence() if outside else _beyond_stokes(batch, model):
            found.append(f"model '{name}' has no answer for it: {problem}")
    return found


def _beyond_stokes(batch: RobotBatch, model: SwimmerModel) -> str:
    """Why a model refuses a robot's motion by its drive; empty where it does not, or would solve for long to know."""
    quick = tabled(batch) if model.placed else model
    if batch.drive is None or quick is None:
        return ""
    found = swim(batch, quick)
    return stokes_flow_problem(batch, reynolds_limits(batch, found.reynolds_number, found.tail_reynolds_number))


def has_table(batch: RobotBatch, stage: StageName = "straight") -> bool:
    """Whether the first robot of a batch, which has a channel, has a table for its tube, of a stage at least."""
    return find_table(*in_tube(batch), stage) is not None


_GAP_STEP = 1.02  # Ratio of gaps to which the least one that a model resolves is determined.


def prepared(
    robot: Robot, model: str, *, resolution: Resolution | Mapping[str, Any] | None = None, placement: Placement
) -> tuple[Robot, SwimmerModel, RobotBatch]:
    """A robot with its model and batch, at its pose and inside the model's domain."""
    ready, chosen = with_resolution(robot, resolution, model), find_swimmer_model(model)
    batch = RobotBatch.of(ready, placement)
    if np.all(all_hold(assembly_limits(batch))):  # a table reaches closer to the wall than a direct solution
        chosen = quickest(chosen, batch)
    check_domain(ready, chosen, batch)
    return ready, chosen, batch


def check_domain(robot: Robot, model: SwimmerModel, batch: RobotBatch) -> None:
    """Refuse a robot at its pose, a batch of one, outside a model's domain."""
    check_placement(batch.placement, model)
    outside = broken(model.requirements(batch))
    if outside:
        raise InputError(
            f"{robot.name} with model '{model.name}': {outside[0].sentence()}{_remedy(batch, model, outside)}"
        )


def _remedy(batch: RobotBatch, model: SwimmerModel, outside: list[Limit]) -> str:
    """Where only a thin film keeps a model from an answer: the least gap that it resolves, and what else helps."""
    if not model.placed or model.form == "table":
        return ""
    least = least_gap(batch, model)
    if not np.isfinite(least):
        return ""
    if outside[0].field == "placement.gap":  # its bound is named already
        return "; with a table (`spirillum prepare`) less"
    return f"; here at least placement.gap = {show(least, 'mm')}, or a table (`spirillum prepare`)"


def least_gap(batch: RobotBatch, model: SwimmerModel) -> float:
    """Least gap that a model resolves where only the film is too thin for it, to 2 %, m; NaN where that is not so."""
    given = batch.placement.gap
    if given is None:
        return float("nan")

    def fits(gap: float) -> bool:
        placed = batch.placement.model_copy(update={"gap": gap})
        return not broken(model.requirements(replace(batch, placement=placed)))

    low, high = given, GAP_SHARE * 0.5 * float(batch.body_diameter[0])
    if low >= high or not fits(high):
        return float("nan")
    while high > _GAP_STEP * low:
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if fits(middle) else (middle, high)
    return high


@dataclass(frozen=True, repr=False)
class Prepared(DisplayMixin):
    """A robot and the table of its tube; SI."""

    robot: Robot
    table: TubeTable = field(repr=False)

    @property
    def warnings(self) -> tuple[Note, ...]:
        """Notes on the robot and on the errors of its table, the worst error first."""
        return (*self.robot.warnings, *(note for _, note in self.excesses))

    @property
    def excesses(self) -> list[tuple[float, Note]]:
        """Errors of the table over those that are allowed, where they are larger, the worst first, with their notes."""
        stage = STAGES[self.table.stage]
        where = "at yawed poses between" if stage.yawed else "between"
        worse = []
        for name, allowed in RESPONSES.items():
            error, most = self.table.error[name], stage.accuracy * allowed
            if error > most:
                off, bound = show_apart(100.0 * error, 100.0 * most, "1", least=2)
                words = {"what": name.replace("_", " "), "off": off, "where": where, "most": bound}
                worse.append((error / most, Note.named("table-error", name=name, **words)))
        return sorted(worse, key=lambda one: -one[0])

    def to_dict(self) -> dict[str, Any]:
        """The answer of `spirillum prepare --json`."""
        return envelope("preparation", self.content, self.warnings)

    @property
    def content(self) -> dict[str, Any]:
        """The answer without its schema and warnings."""
        return content_of(self, diameter=2.0 * self.table.radius, held=range_of(self.table.packed))


def preparations_answer(found: Sequence[Prepared]) -> dict[str, Any]:
    """The answer of `spirillum prepare --json` for several robots, whom its notes name, the worst error first."""
    several = len({one.robot.name for one in found}) < len(found)
    named: dict[str, dict[str, list[Note]]] = {}
    for one in sorted(found, key=lambda one: -max((excess for excess, _ in one.excesses), default=0.0)):
        for note in one.warnings:
            name = one.robot.with_tail if several else one.robot.name
            named.setdefault(note.code, {}).setdefault(name, []).append(note)
    notes = []  # The first note of each code counts the others, which a terminal does not show.
    for robots in named.values():
        first, *others = [note.prefixed(f"{name}: ") for name, own in robots.items() for note in own]
        more = f" (and {len(robots) - 1} more of {len(found)} robots: --notes)" if len(robots) > 1 else ""
        notes += [Note(first.code, f"{first}{more}", first.fields), *others]
    return envelope("preparations", {"robots": [one.content for one in found]}, notes)


def prepare(
    robot: str | Path | Mapping[str, Any] | Robot,
    *,
    stage: str = "yaw",
    workers: int = 1,
    progress: Progress | None = None,
) -> Prepared:
    """Make the table of a robot in its tube, or read the one that is there, of this stage or a finer one.

    With it the model `tube` answers in microseconds, for any viscosity, drive, weight, friction and roughness, and
    `simulate` moves the robot in its tube. Poses that were solved for are kept as they come: an interrupted
    preparation goes on where it was. A robot whose mirror image has a table needs none.

    Args:
        robot: a preset's name, a robot file, its tables, or a loaded robot, with a channel.
        stage: `straight` (poses without yaw, for constrained motion), `yaw` (for motion after release too), or `fine`
            (more nodes, and the finest resolution of the flow); each takes about four times as long as the one before.
        workers: number of processes.
        progress: called with stage, number done, and total.

    Raises:
        InputError: for wrong input, or a robot that the model `tube` does not know or that has no table.
    """
    return prepare_all([robot], stage=stage, workers=workers, progress=progress)[0]


def prepare_all(
    robots: Sequence[str | Path | Mapping[str, Any] | Robot],
    *,
    stage: str = "yaw",
    workers: int = 1,
    progress: Progress | None = None,
) -> tuple[Prepared, ...]:
    """Make the tables of several robots, as `prepare` does that of one.

    Robots that differ in their tails share wall and body at every place that they have in common: tails of one
    amplitude have all of them, others about half.

    Args:
        robots: see `prepare`.
        stage: see `prepare`.
        workers: number of processes.
        progress: called with stage, number done, and total.

    Raises:
        InputError: for wrong input, a robot that the model `tube` does not know or that has no table, or no folder in
            which a new table can be kept.
    """
    if isinstance(workers, bool) or not 1 <= workers <= _MOST_WORKERS:
        raise InputError(f"workers = {workers}; allowed: 1 to {_MOST_WORKERS}")
    chosen = stage_of(stage)
    loaded = [load(robot) for robot in robots]
    asked = checked_geometries(loaded)
    if any(find_table(*robot, chosen) is None for robot in asked):
        check_cache_folder()
        if not has_table_cache():
            raise InputError(
                "a table would be lost when the command ends, for SPIRILLUM_CACHE is off or no home folder is known; "
                "allowed: SPIRILLUM_CACHE = a folder you may write to"
            )
    tables = prepared_tables(asked, stage=chosen, workers=workers, progress=progress)
    return tuple(Prepared(robot, table) for robot, table in zip(loaded, tables, strict=True))


def checked_geometries(robots: Sequence[Robot]) -> list[tuple[RobotGeometry, float]]:
    """What decides the tables of robots that have one."""
    return [_checked(robot, several=len(robots) > 1) for robot in robots]


def _checked(robot: Robot, *, several: bool) -> tuple[RobotGeometry, float]:
    """What decides the table of a robot that has one; named in the sentence of an error where there are several."""
    # A table is valid for all poses: a robot is checked on the axis, where a tail wider than its body is off the glass.
    _, _, batch = prepared(robot, "tube", placement=Placement(eccentricity=0.0))
    try:
        asked = _table_request(batch)
        _ = Places(*asked).gaps
    except InputError as error:
        if not several:
            raise
        raise InputError(f"{robot.name}: {error}") from error
    return asked


_MOST_WORKERS = 64
_WORKERS = min(2, processor_count())  # Processes that make a table which another request needs.


def check_usual_resolution(options: ModelOptions) -> None:
    """Refuse a resolution of a robot whose table answers."""
    if resolved := options.resolution:
        raise InputError(
            f"{resolved} of a robot whose table is requested, which has its own resolution; allowed: only where the "
            "flow is solved for (predict, or simulate with motion 'held')"
        )


def table_for(batch: RobotBatch, *, progress: Progress | None = None) -> TubeTable:
    """Return the table, with yawed poses, for motion of the first robot of a batch in its tube; made if missing."""
    request = _table_request(batch)
    if find_table(*request, "yaw") is None:
        check_may_be_made(batch, "yaw")
    return prepared_tables([request], stage="yaw", workers=_WORKERS, progress=progress)[0]


def check_may_be_made(batch: RobotBatch, stage: StageName) -> None:
    """Refuse to make a missing table for a robot that answers from one that is there."""
    if batch.options.tube.form == "table":
        raise InputError(
            "model.tube.form = 'table': the robot has no table of its tube yet; allowed: `spirillum prepare` (or "
            f"sp.prepare) first, or form 'auto', which makes it in {preparation_time(batch, stage)}"
        )


def missing_tables(batch: RobotBatch, stage: StageName) -> list[tuple[RobotGeometry, float]]:
    """Return what decides the tables that robots of a batch lack in their tubes, each once."""
    fits = all_hold(TabledTube({}).requirements(batch))
    every = [in_tube(batch, index) for index in np.flatnonzero(fits).tolist()]
    return [one for one in dict.fromkeys(every) if find_table(*one, stage) is None and not why_no_table(*one)]


def why_no_table(geometry: RobotGeometry, radius: float) -> str:
    """Why a robot can have no table in its tube, as one with a tail wider than its body; empty where it can."""
    try:
        _ = Places(geometry, radius).gaps
    except InputError as error:
        return str(error)
    return ""


def preparation_time(batch: RobotBatch, stage: StageName) -> str:
    """Return about how long the table of the first robot of a batch takes with two processes, in words."""
    return Places(*in_tube(batch), STAGES[stage]).time_to_solve()


def _table_request(batch: RobotBatch) -> tuple[RobotGeometry, float]:
    """What decides the table of the first robot of a batch."""
    geometry, radius = in_tube(batch)
    if not np.isfinite(radius):
        raise InputError("there is no [channel]; allowed: a channel.diameter, for a table holds in its tube")
    check_usual_resolution(batch.options)
    return geometry, radius
