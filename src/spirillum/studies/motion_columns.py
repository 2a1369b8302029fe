"""Columns beside the models of a study: held by `tube`, and the trial of each robot."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from spirillum.dynamics.prediction import predict
from spirillum.dynamics.trial import ASSUMPTION
from spirillum.errors import InputError
from spirillum.fitted.calibration_file import CalibrationFile, calibrated_robot
from spirillum.fluid.registry import find_swimmer_model
from spirillum.notes import Note
from spirillum.quantities import QUANTITIES, attributes
from spirillum.robot.batch import RobotBatch
from spirillum.robot.placement import Placement
from spirillum.robot.robot import Robot
from spirillum.studies.observed import ObservedArrays
from spirillum.studies.spec import Contact
from spirillum.studies.study_loader import LoadedStudy
from spirillum.studies.work import OneRobot, Part, gathered
from spirillum.swimming.model_choice import WALLED, has_table

MOVING = ("forward_velocity", "tail_rotation_rate", "body_rotation_rate", "motor_rotation_rate", "motor_current")
"""Quantities of both columns."""
POSE = ("gap", "pitch", "yaw", "azimuth", "contact_force")
"""Pose and contact of a robot, means over a trial."""
ENDS = ("median", "low", "high")
"""Of an interval over the unknowns."""
TRIAL_STATES = ("no-trial", "swimming", "standing")
"""State of a robot in its trial; the index in this list is the value in the dataset."""
_MOST_HELD = 1000
"""Robots of a study that are computed by `tube` without a request."""


@dataclass(frozen=True)
class HeldTask(OneRobot):
    """One robot held in its tube by `tube`, whatever the models of the study are."""

    placement: Placement

    @property
    def words(self) -> str:
        """Progress message."""
        return f"held, model {WALLED}: {self.robot.with_tail}"

    @property
    def needed(self) -> set[str]:
        """Names of the arrays of its answer."""
        return set(MOVING)

    def answer(self, loaded: LoadedStudy, _observed: ObservedArrays | None, /) -> Part:
        """Compute every quantity, (1,); NaN for a robot outside the model's domain."""
        robot = calibrated_robot(self.robot, CalibrationFile.model_construct(friction=loaded.friction))
        try:
            found = predict(robot, model=WALLED, motion="held", band=False, placement=self.placement)
        except InputError:
            return {name: np.full(1, np.nan) for name in MOVING}
        return {name: np.array([float(getattr(found, name))]) for name in MOVING}


@dataclass(frozen=True)
class TrialTask(OneRobot):
    """The trial of one robot, as `spirillum.predict` has it."""

    placement: Placement
    contact: Contact
    interval: bool

    @property
    def words(self) -> str:
        """Progress message."""
        return f"trial{' with its interval' if self.interval else ''}: {self.robot.with_tail}"

    @property
    def needed(self) -> set[str]:
        """Names of the arrays of its answer."""
        ends = {f"{name}_{end}" for name in MOVING for end in ENDS} if self.interval else set()
        return {*MOVING, *POSE, "state", *ends}

    def answer(self, _loaded: LoadedStudy, _observed: ObservedArrays | None, /) -> Part:
        """Compute every quantity, (1,); NaN for a robot without a trial."""
        part: Part = {name: np.full(1, np.nan) for name in self.needed}
        part["state"] = np.zeros(1)
        stated = self.contact.model_fields_set  # the others are unknowns of the interval
        contact = {name: getattr(self.contact, name) for name in stated}
        roughness = contact.pop("roughness", None)
        try:
            held = predict(
                self.robot, model=WALLED, band=False, placement=self.placement, roughness=roughness, in_tube=contact,
                interval=self.interval,
            )  # fmt: skip
        except InputError:
            return part
        trial = held.trial
        if trial is None or trial.reason:
            return part
        part["state"] = np.array([float(TRIAL_STATES.index(trial.basis["state"]))])
        part |= {name: np.array([trial.values.get(name, np.nan)]) for name in (*MOVING, *POSE)}
        for name, over in trial.intervals.items():
            if name in MOVING:
                part |= {f"{name}_{end}": np.array([getattr(over, end)]) for end in ENDS}
        return part


def held_tasks(loaded: LoadedStudy, first: int) -> Iterator[HeldTask]:
    """One task for each robot with a table, numbered from `first`, where no model of the study computes walls."""
    if any(find_swimmer_model(name).placed for name in loaded.study.models) or loaded.count > _MOST_HELD:
        return
    for index in range(loaded.count):
        robot = loaded.robot_at(index)
        if robot.channel is not None and has_table(RobotBatch.of(robot)):
            yield HeldTask(first, np.array([index]), robot, _placement(loaded, index))
            first += 1


def trial_tasks(loaded: LoadedStudy, robots: Mapping[int, Robot], first: int) -> Iterator[TrialTask]:
    """One task for each of the robots, numbered from `first`; none where no trials are requested."""
    study = loaded.study
    if study.trial:
        for number, (index, robot) in enumerate(robots.items(), start=first):
            yield TrialTask(
                number, np.array([index]), robot, _placement(loaded, index), study.contact, interval=study.interval
            )


def _placement(loaded: LoadedStudy, index: int) -> Placement:
    """Where the robot at an index in the flat order of the study is held, or released."""
    return loaded.placement_of(index // (loaded.count // len(loaded.robots)))


def trial_notes(answers: Sequence[tuple[TrialTask, Part]]) -> list[Note]:
    """Assumptions of the trials, and the robots without one."""
    if not answers:
        return []
    words = f"trial: {ASSUMPTION}; released, 60 s of waiting, 20 s with the motor on, as `spirillum predict` has it"
    found = [Note("settled-basis", words, ("contact",))]
    lost = [task for task, part in answers if part["state"][0] == 0.0]
    if lost:
        words = (
            f"{len(lost)} of {len(answers)} robots have no trial, the first: {lost[0].robot.with_tail}; "
            "`spirillum predict` says why"
        )
        found.append(Note("without-answer", words, ("forward_velocity_trial",)))
    return found


def column_variables(
    held: Sequence[tuple[HeldTask, Part]],
    trials: Sequence[tuple[TrialTask, Part]],
    robots: Sequence[str],
    shape: Sequence[int],
) -> dict[str, Any]:
    """Return the columns as variables over the robots: `<quantity>_held`, `<quantity>_trial`, and the state `trial`."""
    found: dict[str, Any] = {}

    def add(answers: Sequence[tuple[OneRobot, Part]], name: str, column: str, meaning: str, source: str) -> None:
        base = name if name in QUANTITIES else name.rpartition("_")[0]
        about = attributes(base, meaning=f"{QUANTITIES[base].meaning}, {meaning}", source=source)
        found[f"{base}_{column}{name.removeprefix(base)}"] = (tuple(robots), gathered(answers, name, shape), about)

    for name in MOVING if held else ():
        add(held, name, "held", "held at its pose", f"model {WALLED}")
    for name in sorted(trials[0][0].needed - {"state"}) if trials else ():
        add(trials, name, "trial", _meaning(name), f"model {WALLED}, {ASSUMPTION}")
    if trials:
        about = {
            "units": "1",
            "long_name": "what became of a robot in its trial",
            "source": "trial in the tube",
            "flag_values": np.arange(len(TRIAL_STATES), dtype="int8"),
            "flag_meanings": " ".join(TRIAL_STATES),
        }
        state = np.nan_to_num(gathered(trials, "state", shape)).astype("int8")
        found["trial"] = (tuple(robots), state, about)
    return found


def _meaning(name: str) -> str:
    """Meaning of a value of a trial."""
    end = name.rpartition("_")[2]
    return "mean over a trial" if end not in ENDS else f"over what is not stated of a trial: {end} (90 % interval)"
