"""Columns of a study beside its models: bands over open poses, axial motion by `tube`, trials after release.

Robots of one channel that share a pose come one after the other: what is solved for body and wall there serves them
all.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass
from typing import Any

import numpy as np

from spirillum.arrays import Values
from spirillum.dynamics.prediction import predict
from spirillum.fluid.model import SwimmerModel
from spirillum.fluid.registry import find_swimmer_model, quickest
from spirillum.notes import Note
from spirillum.quantities import QUANTITIES, attributes
from spirillum.robot.batch import RobotBatch
from spirillum.robot.limits import all_hold, assembly_limits, broken
from spirillum.robot.placement import Placement
from spirillum.robot.tube_pose import GAP_SHARE
from spirillum.studies.spec import Contact
from spirillum.studies.study_loader import LoadedStudy, ObservedArrays
from spirillum.studies.work import MOVING, OneModel, OneRobot, Part, flag_attributes, gathered, groups
from spirillum.swimming.band import at_pose, band_poses
from spirillum.swimming.motions import ASSUMPTION
from spirillum.swimming.preparation import WALLED, has_table
from spirillum.swimming.steady import one_after_another, swim
from spirillum.units import show

AT_POSES = (
    "forward_velocity",
    "advance_per_radian",
    "tail_rotation_rate",
    "body_rotation_rate",
    "motor_rotation_rate",
    "tail_torque",
    "hydrodynamic_efficiency",
    "plug_velocity",
)
"""Quantities that have a band, and a value at each of its poses."""


@dataclass(frozen=True)
class BandTask(OneModel):
    """One model for the robots of one channel that share a pose of their bands."""

    pose: int  #: Index of the pose in the band of each robot.
    robots: tuple[RobotBatch, ...]  #: The robots at that pose, one by one.

    needed = frozenset(AT_POSES)

    @property
    def words(self) -> str:
        """Progress message."""
        return f"{self.model}, band: {self.where}, {self.size} robots"

    @property
    def where(self) -> str:
        """The pose in words."""
        placement = self.robots[0].placement
        return f"gap {show(placement.gap or 0.0, 'mm')}, pitch {show(placement.pitch or 0.0, 'deg')}"

    def answer(self, loaded: LoadedStudy, _observed: ObservedArrays | None, /) -> Part:
        """Compute steady swimming at this pose, (robots, friction models); NaN where there is none."""
        model = find_swimmer_model(self.model)
        quick = [(robot, quickest(model, robot)) for robot in self.robots]
        # From its table, or solved with the resolution of a band.
        there = [(at_pose(one, one.placement), model) if form is model else (one, form) for one, form in quick]
        found = [
            one_after_another([swim(*pair, friction=reading) for pair in there]) for reading in loaded.study.friction
        ]
        return {name: np.stack([getattr(one, name) for one in found], axis=-1) for name in AT_POSES}


def band_tasks(loaded: LoadedStudy) -> Iterator[BandTask]:
    """The tasks of the band, always in the same order; none where it is not requested."""
    if not loaded.study.band:
        return
    for indices, batch in groups(loaded):
        robots = [block for _, block in batch.blocks(1)]
        for name in loaded.study.models:
            model = find_swimmer_model(name)
            for pose, sharing in _shared_poses(robots, model):
                yield BandTask(indices[list(sharing)], name, pose, tuple(sharing.values()))


def _shared_poses(robots: list[RobotBatch], model: SwimmerModel) -> Iterator[tuple[int, dict[int, RobotBatch]]]:
    """Index of a pose of the band, and the robots that share it, by their index, at that pose."""
    bands = {}
    for index, single in enumerate(robots):
        if bool(np.all(single.known & all_hold([*assembly_limits(single), *model.domain(single)]))):
            bands[index] = band_poses(single, model)
    poses = max((len(band) for band in bands.values()), default=0)
    for pose in range(poses):
        sharing: dict[tuple[float | None, float | None], dict[int, RobotBatch]] = {}
        for index, band in bands.items():
            key = (band[pose].gap, band[pose].pitch)
            sharing.setdefault(key, {})[index] = robots[index].placed(band[pose])
        for there in sharing.values():
            yield pose, there


def reference_pose(settings: Mapping[str, Any]) -> str:
    """Poses of the robots of a study, by its `settings`, for the models that compute the walls, in words."""
    if settings.get("placements"):
        return "where the calibration places them"
    placement = settings.get("study", {}).get("placement") or {}
    if placement.get("eccentricity") is not None:
        return f"level, eccentricity {placement['eccentricity']:g}"
    radii = [0.5 * robot["body"]["diameter"] for robot in settings.get("robots", [])]
    gaps = sorted({show(placement.get("gap") or GAP_SHARE * radius, "mm") for radius in radii}, key=len)
    pitch = placement.get("pitch") or 0.0
    yaw = placement.get("yaw") or 0.0
    tilts = [f"{name} {show(angle, 'deg')}" for name, angle in (("pitch", pitch), ("yaw", yaw)) if angle]
    tilt = ", ".join(tilts) or "level"
    return f"gap {' or '.join(gaps) if len(gaps) <= 2 else 'of the reference pose'}, {tilt}"


def missing_pose_notes(answers: Iterable[tuple[BandTask, Part]]) -> list[Note]:
    """A sentence for each pose at which robots have no answer, though they have one at the reference pose."""
    found = []
    for task, part in answers:
        missing = np.flatnonzero(np.isnan(part["forward_velocity"]).all(axis=-1))
        if missing.size:
            first = task.robots[int(missing[0])]
            outside = broken(find_swimmer_model(task.model).requirements(first))
            why = outside[0].sentence() if outside else "they find no steady motion there"
            found.append(Note.named("band-leaves-out", model=task.model, count=missing.size, where=task.where, why=why))
    return found


def with_band(
    flat: dict[str, Values], answers: Iterable[tuple[BandTask, Part]], models: tuple[str, ...]
) -> dict[str, Values]:
    """`<quantity>_at_place` at all poses, `_low` and `_high` of these and the reference pose; NaN without a band."""
    pairs = list(answers)
    poses = max(task.pose for task, _ in pairs) + 1
    banded = {models.index(task.model) for task, _ in pairs}
    found: dict[str, Values] = {}
    for name in AT_POSES:
        there = np.full((*flat[name].shape, poses), np.nan)
        for task, part in pairs:
            there[models.index(task.model), task.indices, :, task.pose] = part[name]
        everywhere = np.concatenate([there, flat[name][..., None]], axis=-1)
        everywhere[[number for number in range(len(models)) if number not in banded]] = np.nan
        found[f"{name}_at_place"] = there
        found[f"{name}_low"] = np.fmin.reduce(everywhere, axis=-1)
        found[f"{name}_high"] = np.fmax.reduce(everywhere, axis=-1)
    return found


POSE = ("gap", "pitch", "yaw", "azimuth", "contact_force")  #: Pose and contact of a robot, means over a trial.
ENDS = ("median", "low", "high")  #: Of an interval over the unknowns.
TRIAL_STATES = ("no-trial", "swimming", "standing")  #: States of a trial, in the order of the dataset's values.
_MOST_HELD = 1000  # robots of a study that are computed by `tube` without a request


@dataclass(frozen=True)
class HeldTask(OneRobot):
    """One robot held in its tube by `tube`, whatever the models of the study are."""

    placement: Placement

    needed = frozenset({*MOVING, "error_estimate"})
    followed = f"held, model {WALLED}"

    def follow(self, loaded: LoadedStudy, /) -> dict[str, float]:
        """Compute the quantities of a robot within the model's domain."""
        robot = loaded.with_friction(self.robot)
        found = predict(robot, model=WALLED, motion="held", band=False, placement=self.placement)
        return {name: float(getattr(found, name)) for name in self.needed}


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
    def needed(self) -> Set[str]:
        """Names of the arrays of its answer."""
        ends = {f"{name}_{end}" for name in MOVING for end in ENDS} if self.interval else set()
        return {*MOVING, *POSE, "error_estimate", "state", *ends}

    def follow(self, _loaded: LoadedStudy, /) -> dict[str, float]:
        """Compute the quantities of the trial; none without one."""
        stated = self.contact.model_fields_set  # the others are unknowns of the interval
        contact = {name: getattr(self.contact, name) for name in stated}
        roughness = contact.pop("roughness", None)
        trial = predict(
            self.robot, model=WALLED, band=False, placement=self.placement, roughness=roughness, in_tube=contact,
            interval=self.interval,
        ).trial  # fmt: skip
        if trial is None or trial.reason:
            return {}
        found = {"state": float(TRIAL_STATES.index(trial.basis["state"])), "error_estimate": trial.error}
        found |= {name: trial.values.get(name, np.nan) for name in (*MOVING, *POSE)}
        for name, over in trial.intervals.items():
            if name in MOVING:
                found |= {f"{name}_{end}": getattr(over, end) for end in ENDS}
        return found


def axial_tasks(loaded: LoadedStudy) -> Iterator[HeldTask]:
    """One task for each robot with a table, where no model of the study computes walls."""
    if any(find_swimmer_model(name).placed for name in loaded.study.models) or loaded.count > _MOST_HELD:
        return
    for index in range(loaded.count):
        robot = loaded.robot_at(index)
        if robot.channel is not None and has_table(RobotBatch.of(robot)):
            yield HeldTask(np.array([index]), robot, loaded.placement_at(index))


def trial_notes(answers: Sequence[tuple[TrialTask, Part]]) -> list[Note]:
    """Assumptions of the trials, and the robots without one."""
    if not answers:
        return []
    found = [Note.named("trial-basis", assumption=ASSUMPTION)]
    lost = [task for task, part in answers if part["state"][0] == 0.0]
    if lost:
        found.append(
            Note.named("robots-without-trial", count=len(lost), robots=len(answers), first=lost[0].robot.with_tail)
        )
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

    for name in (*MOVING, "error_estimate") if held else ():
        add(held, name, "held", "held at its pose", f"model {WALLED}")
    for name in sorted(trials[0][0].needed - {"state"}) if trials else ():
        end = name.rpartition("_")[2]
        over = f"over what is not stated of a trial: {end} (90 % interval)"
        add(trials, name, "trial", over if end in ENDS else "mean over a trial", f"model {WALLED}, {ASSUMPTION}")
    if trials:
        about = flag_attributes("what became of a robot in its trial", "trial in the tube", TRIAL_STATES)
        state = np.nan_to_num(gathered(trials, "state", shape)).astype("int8")
        found["trial"] = (tuple(robots), state, about)
    return found
