"""Robots of a study let go in their tubes, and followed to their steady motions.

Each is laid down where the study's placement says, with its drive on, and followed as `spirillum.settle` does: weight,
film, contact and its own motion decide where it lies, and so how fast it swims.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from spirillum.dynamics.free_motion import free_motion
from spirillum.errors import InputError
from spirillum.notes import Note
from spirillum.quantities import QUANTITIES, attributes
from spirillum.robot.placement import Placement
from spirillum.robot.robot import Robot
from spirillum.studies.spec import Contact
from spirillum.studies.study_loader import LoadedStudy
from spirillum.studies.work import OneRobot, Part, gathered
from spirillum.units import show

SETTLED = (
    "forward_velocity",
    "tail_rotation_rate",
    "body_rotation_rate",
    "motor_rotation_rate",
    "motor_current",
    "shaft_power",
    "hydrodynamic_efficiency",
)
"""Quantities of a steady motion."""
PLACE = ("gap", "pitch", "yaw", "azimuth", "approach_time")
"""Where a robot lies in it, and how fast it comes there."""
STATES = ("not followed", "steady", "orbits", "goes around", "changing")
"""What became of a robot; the index in this list is the value in the dataset."""


@dataclass(frozen=True)
class SettledTask(OneRobot):
    """One robot that is let go."""

    placement: Placement
    """Where it is laid down."""
    contact: Contact
    """What it rests on."""

    @property
    def words(self) -> str:
        """What is computed, in a few words."""
        return f"let go: {self.robot.with_tail}"

    @property
    def needed(self) -> set[str]:
        """Names of the arrays of its answer."""
        return {*SETTLED, *PLACE, "error_estimate", "near", "state"}

    def answer(self) -> Part:
        """Every quantity, (1,); NaN for a robot that cannot be followed, or reaches no steady motion."""
        nothing = {name: np.full(1, np.nan) for name in (*SETTLED, *PLACE, "error_estimate", "near")}
        try:
            motion = free_motion(
                self.robot,
                placement=self.placement,
                roughness=self.contact.roughness,
                in_tube={"friction_coefficient": self.contact.friction_coefficient},
            )
        except InputError:
            return {**nothing, "state": np.zeros(1)}
        found = motion.prediction
        lying = found.lying
        assert lying is not None  # noqa: S101 - a free motion has one
        state = np.array([float(STATES.index(lying.state))])
        if lying.state == "changing":  # its means depend on when they are taken
            return {**nothing, "state": state}
        values = {name: float(getattr(found.swimming, name)[0]) for name in SETTLED}
        values |= {name: float(getattr(lying, name)) for name in PLACE}
        values |= {"error_estimate": found.error_estimate, "near": float(motion.checked.near)}
        return {**{name: np.array([value]) for name, value in values.items()}, "state": state}


def settled_tasks(loaded: LoadedStudy, robots: Mapping[int, Robot], first: int) -> Iterator[SettledTask]:
    """One task for each robot, numbered from `first`; none where none is asked for."""
    if loaded.study.settled:
        tails = loaded.count // len(loaded.robots)
        for number, (index, robot) in enumerate(robots.items(), start=first):
            yield SettledTask(number, index, robot, loaded.placement_of(index // tails), loaded.study.contact)


def settled_basis(contact: Contact) -> Note:
    """What settled speeds are, and rest on."""
    height = "1e-4 of its radius" if contact.roughness is None else show(contact.roughness, "um")
    words = (
        f"settled speeds assume asperities of {height} and a friction coefficient of {contact.friction_coefficient:g}; "
        "a trial of some turns does not reach them"
    )
    return Note("settled-basis", words, ("contact",))


def not_settled(answers: Sequence[tuple[SettledTask, Part]]) -> list[Note]:
    """Notes on robots without a steady motion, and on steady motions beyond what the tables were checked for."""
    lost = [task for task, part in answers if not np.isfinite(part["forward_velocity"][0])]
    far = [task for task, part in answers if task not in lost and np.isnan(part["error_estimate"][0])]
    near = [task for task, part in answers if part["near"][0] == 1.0 and task not in far]
    found = []
    if far:
        words = (
            f"{len(far)} of {len(answers)} robots yaw further than their tables were checked for: settled speeds "
            "have no "
            f"error estimate; the first: {far[0].robot.with_tail}"
        )
        found.append(Note("table-not-checked", words, ("settled_forward_velocity",)))
    if near:
        words = (
            f"{len(near)} of {len(answers)} robots come nearer to the wall than their tables were checked for: error "
            f"estimates are of wider gaps; the first: {near[0].robot.with_tail}"
        )
        found.append(Note("table-not-checked", words, ("settled_forward_velocity",)))
    if lost:
        words = (
            f"{len(lost)} of {len(answers)} robots have no steady motion that could be found, the first: "
            f"{lost[0].robot.with_tail}; `spirillum settle` says why"
        )
        found.append(Note("without-answer", words, ("settled_forward_velocity",)))
    return found


def settled_variables(
    answers: Sequence[tuple[SettledTask, Part]], robots: Sequence[str], shape: Sequence[int]
) -> dict[str, Any]:
    """The steady motions as variables of a dataset.

    Returns:
        `<quantity>_settled` over the robots, NaN for those without a steady motion, and `settled`, what became of them.
    """
    found: dict[str, Any] = {}
    for name in (*SETTLED, *PLACE):
        about = attributes(
            name, meaning=f"{QUANTITIES[name].meaning}, in steady motion", source="free motion in the tube"
        )
        found[f"{name}_settled"] = (tuple(robots), gathered(answers, name, shape), about)
    state = np.clip(np.nan_to_num(gathered(answers, "state", shape)), 0, len(STATES) - 1).astype("int8")
    about = {
        "units": "1",
        "long_name": "what became of a robot that was let go",
        "source": "free motion in the tube",
        "flag_values": np.arange(len(STATES), dtype="int8"),
        "flag_meanings": " ".join(word.replace(" ", "-") for word in STATES),
    }
    about_error = attributes(
        "error_estimate",
        meaning="relative error of the speed in steady motion; NaN beyond the yaws that the table was checked for",
        source="table of the tube",
    )
    error = (tuple(robots), gathered(answers, "error_estimate", shape), about_error)
    return {**found, "error_estimate_settled": error, "settled": (tuple(robots), state, about)}
