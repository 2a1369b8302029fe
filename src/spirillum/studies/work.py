"""The tasks of a study: blocks of robots, each answered by itself, in this process or another one."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence, Set
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from hashlib import sha256
from typing import Any, ClassVar, NamedTuple

import numpy as np

from spirillum.arrays import PerRobot, Values
from spirillum.data_tables import rows_of
from spirillum.display import counted
from spirillum.errors import InputError
from spirillum.fitted.posterior_file import PosteriorFile
from spirillum.fluid.model import SwimmerModel
from spirillum.fluid.registry import find_swimmer_model, quickest
from spirillum.kernels.native import rows_in_one_thread
from spirillum.robot.batch import RobotBatch, batches
from spirillum.robot.placement import Placement
from spirillum.robot.robot import Robot
from spirillum.studies.study_loader import LoadedStudy, ObservedArrays, observed_at
from spirillum.swimming.intervals import intervals_of, knows_torque, without_torque
from spirillum.swimming.motions import STEADY, Swimming
from spirillum.swimming.steady import one_after_another, speed_error, swim

MOVING = ("forward_velocity", "tail_rotation_rate", "body_rotation_rate", "motor_rotation_rate", "motor_current")
"""Quantities of every motion."""
AT_RATES = (*MOVING, "tail_torque", "effective_friction")  #: Quantities also given at observed and at assumed rates.
WITH_INTERVALS = (
    "forward_velocity",
    "advance_per_radian",
    "tail_rotation_rate",
    "body_rotation_rate",
    "motor_rotation_rate",
    "tail_torque",
    "motor_current",
)
"""Quantities that have intervals where a posterior is given."""
REASONS = tuple(row["reason"] for row in rows_of("studies/reasons.csv"))
"""Why a robot of a study has no answer; the index in this list is the value in the dataset."""

_ENDINGS = ("", "_at_observed_rate", "_at_assumed_rate", "_interval_low", "_interval_high")
"""What the names of a quantity's arrays end with."""
BLOCK = 25_000  #: Robots of a task in closed form: a fifth of a second of work.
_SMALL_BLOCK = 8  # of a model that solves for the flow: some seconds of work between two signs of life
_TABLED_BLOCK = 64  # of one whose robots have tables; without one a robot takes as long, and is a task of its own

Indices = np.ndarray[tuple[int, ...], np.dtype[np.intp]]
Marks = np.ndarray[tuple[int, ...], np.dtype[np.uint8]]

QuickParts = Sequence[tuple[slice, RobotBatch, SwimmerModel]]  #: Indices of parts of a batch, each with its model.

Part = dict[str, Values]  #: Arrays of one task: (robots, friction models) or (robots, friction models, rates).


@dataclass(frozen=True)
class StudyTask(ABC):
    """A block of robots of a study and how it is answered, as a value that other processes can take."""

    indices: Indices  #: Indices of the robots in the flat order of the study.

    @property
    def size(self) -> int:
        """Number of robots."""
        return int(self.indices.size)

    @property
    def mark(self) -> Marks:
        """Digest of what is answered: blocks have other numbers and sizes once tables are made."""
        asked = f"{type(self).__name__} {self.words} {self.indices.tolist()}"
        return np.frombuffer(sha256(asked.encode()).digest(), dtype=np.uint8)

    @property
    def models(self) -> tuple[str, ...]:
        """Models whose linear algebra is limited to one thread."""
        return ()

    @property
    @abstractmethod
    def words(self) -> str:
        """Progress message."""

    @property
    @abstractmethod
    def needed(self) -> Set[str]:
        """Names of the arrays that every answer has."""

    @property
    def allowed(self) -> Set[str]:
        """Names of the arrays that an answer may have."""
        return self.needed

    def leading(self, _readings: int) -> tuple[int, ...]:
        """Return the sizes of the first axes of all arrays, for a number of friction models."""
        return (self.size,)

    def job(self, loaded: LoadedStudy, _observed: ObservedArrays | None, /) -> StudyJob:
        """Return the task with the inputs that its answer needs, and no more."""
        study = loaded.study.model_copy(update={"grid": None, "robots": None})
        small = replace(loaded, study=study, robots=(), placements=(), question={})
        return StudyJob(self, small, None)

    @abstractmethod
    def answer(self, loaded: LoadedStudy, observed: ObservedArrays | None, /) -> Part:
        """Compute the arrays of the answer, the robots along their first axis."""


class StudyJob(NamedTuple):
    """A task with its inputs, as it is sent to other processes; its robots are numbered from 0."""

    task: StudyTask
    loaded: LoadedStudy  #: The study without robots, or with those of the task where their draws are requested.
    observed: ObservedArrays | None
    number: int = 0  #: Of the task among all of its study.


def run_job(job: StudyJob) -> Part:
    """Return the answer of a job, computed in one thread."""
    with one_thread_each(*job.task.models):
        return job.task.answer(job.loaded, job.observed)


@contextmanager
def one_thread_each(*models: str) -> Iterator[None]:
    """Limit this process to one thread while the block runs: the other processes use the other cores."""
    if all(find_swimmer_model(name).closed_form for name in models):
        yield
        return
    from spirillum.fluid.wire.interaction import one_thread

    with rows_in_one_thread(), one_thread():
        yield


@dataclass(frozen=True)
class OneModel(StudyTask):
    """A task of one model, for all friction models."""

    model: str

    @property
    def models(self) -> tuple[str, ...]:
        """Models whose linear algebra is limited to one thread."""
        return (self.model,)

    def leading(self, readings: int) -> tuple[int, ...]:
        """Return the sizes of the first axes of all arrays: robots, friction models."""
        return self.size, readings


@dataclass(frozen=True)
class ModelTask(OneModel):
    """One model for one block of robots of the same kind."""

    batch: RobotBatch
    needed = frozenset({"outside", *(item.name for item in STEADY)})
    allowed = frozenset({"outside", "error_estimate", *(item.name + at for item in STEADY for at in _ENDINGS)})

    @property
    def words(self) -> str:
        """Progress message."""
        return f"{self.model}, {counted(self.size, 'robot')}"

    def job(self, loaded: LoadedStudy, observed: ObservedArrays | None, /) -> StudyJob:
        """Return the task with its observations, and its robots where their posterior draws are requested."""
        small = super().job(loaded, observed).loaded
        if loaded.fit.posterior is not None:
            small = replace(small, robots=tuple(loaded.robot_at(index) for index in self.indices.tolist()))
        seen = None if observed is None else observed_at(observed, self.indices)
        return StudyJob(replace(self, indices=np.arange(self.size, dtype=np.intp)), small, seen)

    def answer(self, loaded: LoadedStudy, observed: ObservedArrays | None, /) -> Part:
        """Compute steady swimming, (robots, friction models), and the flag `outside` of robots without an answer."""
        study = loaded.study
        readings = study.friction
        quick = quick_parts(self.batch, self.model)
        free = [_swum(quick, reading) for reading in readings]
        part: Part = {item.name: _stacked(free, item.name) for item in STEADY}
        errors = [_speed_errors(quick, reading, found) for reading, found in zip(readings, free, strict=True)]
        if not np.isnan(errors).all():
            part["error_estimate"] = np.stack(errors, axis=-1)
        valid = np.stack([result.valid for result in free], axis=-1)
        reason = _reasons(self.batch, self.model)[:, None]
        reason = np.where(np.isfinite(part["reynolds_number"]) & ~valid, REASONS.index("beyond-stokes"), reason)
        part["outside"] = np.where(valid, 0.0, np.where(reason == 0, REASONS.index("other"), reason))
        if loaded.fit.posterior is not None and self.model == loaded.fit.posterior.model:
            part |= _intervals(self, loaded, loaded.fit.posterior)
        if observed is not None:
            tail, motor = observed.tail_rate[self.indices], observed.motor_rate[self.indices]
            found = [_swum(quick, r, tail, motor) for r in readings]
            part |= {f"{name}_at_observed_rate": _stacked(found, name) for name in AT_RATES}
        if study.assumed_motor_rates and self.batch.electrics is not None:
            polarity = np.broadcast_to(self.batch.electrics.polarity, (self.batch.size,))
            driven = np.outer(study.assumed_motor_rates, polarity)
            curves = [_curve(quick, reading, driven) for reading in readings]
            part |= {
                f"{name}_at_assumed_rate": np.stack([curve[name] for curve in curves], axis=1) for name in AT_RATES
            }
        return part


@dataclass(frozen=True)
class OneRobot(StudyTask):
    """One robot that is followed in its tube, as a separate task."""

    followed: ClassVar[str]  #: What is followed, for the progress message.
    robot: Robot

    @property
    def words(self) -> str:
        """Progress message."""
        return f"{self.followed}: {self.robot.with_tail}"

    def answer(self, loaded: LoadedStudy, _observed: ObservedArrays | None, /) -> Part:
        """Compute every quantity, (1,); NaN, and the state 0, for a robot that cannot be followed."""
        found: dict[str, float] = dict.fromkeys(self.needed, np.nan)
        found |= {"state": 0.0} if "state" in self.needed else {}
        with suppress(InputError):
            found |= self.follow(loaded)
        return {name: np.array([value]) for name, value in found.items()}

    def follow(self, loaded: LoadedStudy, /) -> dict[str, float]:
        """Compute the quantities that the robot has."""
        raise NotImplementedError


def flag_attributes(meaning: str, source: str, names: Sequence[str]) -> dict[str, Any]:
    """Attributes of a variable whose values are indices of names."""
    about = {"units": "1", "long_name": meaning, "source": source}
    values = np.arange(len(names), dtype="int8")
    return {**about, "flag_values": values, "flag_meanings": " ".join(name.replace(" ", "-") for name in names)}


def gathered(answers: Sequence[tuple[OneRobot, Part]], name: str, shape: Sequence[int]) -> Values:
    """A quantity of robots that were followed one by one, over all robots of the study; NaN for those that were not."""
    first = answers[0][1][name]
    values = np.full((int(np.prod(shape)), *first.shape[1:]), np.nan)
    for task, part in answers:
        values[task.indices[0]] = part[name][0]
    return values.reshape(*shape, *first.shape[1:])


def tasks(loaded: LoadedStudy) -> Iterator[ModelTask]:
    """All tasks of a study, always in the same order."""
    for indices, batch in groups(loaded):
        for name in loaded.study.models:
            for cut, block in batch.blocks(_block_size(find_swimmer_model(name), batch)):
                yield ModelTask(indices[cut], name, block)


def _block_size(model: SwimmerModel, batch: RobotBatch) -> int:
    if model.closed_form:
        return BLOCK
    if not model.placed:
        return _SMALL_BLOCK
    return 1 if quickest(model, batch) is model else _TABLED_BLOCK


def groups(loaded: LoadedStudy) -> Iterator[tuple[Indices, RobotBatch]]:
    """Batches of robots with their indices in the study: one a channel of the grid, or one a kind of listed robots."""
    grid = loaded.study.grid
    if grid is None:
        alike: dict[Placement, list[int]] = {}
        for number in range(len(loaded.robots)):
            alike.setdefault(loaded.placement_of(number), []).append(number)
        for placement, numbers in alike.items():
            for indices, batch in batches([loaded.robots[number] for number in numbers], placement):
                yield np.array(numbers, dtype=np.intp)[indices], batch
        return
    wavelength, amplitude = (column.ravel() for column in np.meshgrid(grid.wavelengths, grid.amplitudes, indexing="ij"))
    for index, robot in enumerate(loaded.robots):
        tails = {"tail.wavelength": wavelength, "tail.amplitude": amplitude}
        if loaded.friction:
            every = range(index * wavelength.size, (index + 1) * wavelength.size)
            fitted = [loaded.with_friction(loaded.robot_at(tail)).friction.effective for tail in every]
            tails["friction.effective"] = np.array(fitted, dtype=float)  # NaN where unset
        yield (
            index * wavelength.size + np.arange(wavelength.size),
            RobotBatch.of(robot, loaded.placement_of(index)).with_values(tails),
        )


def quick_parts(batch: RobotBatch, name: str) -> QuickParts:
    """A batch with the form of a model that answers first, robot by robot where some have a table and some have not."""
    model = find_swimmer_model(name)
    whole = quickest(model, batch)
    if model.placed and whole is model:
        parts = [(cut, block, quickest(model, block)) for cut, block in batch.blocks(1)]
        if any(quick is not model for _, _, quick in parts):
            return parts
    return [(slice(0, batch.size), batch, whole)]


def _swum(
    quick: QuickParts, reading: str, tail_rate: PerRobot | None = None, motor_rate: PerRobot | None = None
) -> Swimming:
    """Steady swimming of all parts of a batch."""
    found = []
    for cut, batch, model in quick:
        tail, motor = (None if rate is None else rate[cut] for rate in (tail_rate, motor_rate))
        found.append(swim(batch, model, tail_rate=tail, motor_rate=motor, friction=reading))
    return one_after_another(found)


def _speed_errors(quick: QuickParts, reading: str, found: Swimming) -> PerRobot:
    """Relative error of the forward velocities: against another resolution, or that of a table; NaN where unknown."""
    errors = np.full(found.forward_velocity.size, np.nan)
    for cut, batch, model in quick:
        checks = [swim(batch, check, friction=reading).forward_velocity for check in model.checked_by(batch)]
        if checks:
            errors[cut] = speed_error([found.forward_velocity[cut], *checks], model.unchecked_error(batch))
        elif not model.closed_form:
            errors[cut] = [model.stated_speed_error(block) for _, block in batch.blocks(1)]
    return errors


def _intervals(task: ModelTask, loaded: LoadedStudy, posterior: PosteriorFile) -> Part:
    """Limits of the intervals of every robot by itself, driven by its own drive; NaN where there is no answer."""
    readings, model = loaded.study.friction, find_swimmer_model(task.model)
    shape = (task.size, len(readings))
    part: Part = {
        f"{name}_interval_{end}": np.full(shape, np.nan) for name in WITH_INTERVALS for end in ("low", "high")
    }
    inside = _reasons(task.batch, task.model) == 0
    for number, index in enumerate(task.indices.tolist()):
        if not inside[number]:
            continue
        robot = loaded.with_friction(loaded.robot_at(index))
        for column, reading in enumerate(readings):
            found = intervals_of(robot, model, posterior, tail_rate=None, friction=reading)
            found = found if knows_torque(robot, model) else without_torque(found)
            for name in WITH_INTERVALS:
                part[f"{name}_interval_low"][number, column] = found.low[name]
                part[f"{name}_interval_high"][number, column] = found.high[name]
    return part


def _stacked(results: Sequence[Swimming], name: str) -> Values:
    return np.stack([getattr(result, name) for result in results], axis=-1)


def _curve(quick: QuickParts, reading: str, driven: Values) -> Part:
    """Steady swimming at motor rates (rate, robot); a closed form answers for all of them at once. (robot, rate)."""
    _, batch, model = quick[0]
    if len(quick) == 1 and model.closed_form and batch.size > 1:
        rows = np.tile(np.arange(batch.size), len(driven))
        found = swim(batch.taken(rows), model, motor_rate=driven.ravel(), friction=reading)
        return {name: getattr(found, name).reshape(driven.shape).T for name in AT_RATES}
    swum = [_swum(quick, reading, motor_rate=rates) for rates in driven]
    return {name: _stacked(swum, name) for name in AT_RATES}


def _reasons(batch: RobotBatch, model: str) -> PerRobot:
    """For each robot the first requirement that it breaks, as its index in `REASONS`."""
    reason = np.zeros(batch.size)
    for limit in find_swimmer_model(model).requirements(batch):
        code = REASONS.index(limit.flag) if limit.flag in REASONS else REASONS.index("other")
        reason = np.where((reason == 0) & ~np.broadcast_to(limit.holds, reason.shape), code, reason)
    return reason
