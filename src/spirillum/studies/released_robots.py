"""Robots of a study released in their tubes: the runs of a factorial experiment, and steady states.

Half of all combinations suffice: with the last factor's level the product of the others' (with five factors a design of
resolution V), no main effect is confounded with another or with an interaction of two (`box2005`).

Publications do not report the initial placement. For the experiment, each robot makes the runs of a design of
experiments over what decides: gap and pitch at release, time until its motor is switched on, height of
the asperities, and coefficient of dry friction. Every run is one of `spirillum.simulate` with the model `tube`, read as
a camera above the channel reads it, and put through the paper's inference: B_eff by (18), the factor on the body's drag
by (15).

For the steady state, each robot is released at the study's placement, with its drive on, and followed as
`spirillum.settle` does.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, Any, NamedTuple, get_args

import numpy as np

from spirillum.arrays import Samples, Values
from spirillum.dynamics.free_motion import free_motion
from spirillum.dynamics.integration import INTERRUPTED
from spirillum.dynamics.simulation import simulate
from spirillum.errors import InputError
from spirillum.fluid.registry import find_swimmer_model
from spirillum.fluid.tube.table import BELOW
from spirillum.notes import Note
from spirillum.quantities import QUANTITIES, attributes
from spirillum.robot.batch import RobotBatch
from spirillum.robot.placement import Placement
from spirillum.robot.robot import Robot
from spirillum.studies.spec import Contact, LaidDown
from spirillum.studies.study_loader import LoadedStudy, ObservedArrays
from spirillum.studies.work import MOVING, OneRobot, Part, flag_attributes, gathered
from spirillum.swimming.band import steepest_pitch
from spirillum.swimming.motions import State
from spirillum.swimming.steady import swim
from spirillum.units import show_height

if TYPE_CHECKING:
    import xarray as xr


Levels = np.ndarray[tuple[int, ...], np.dtype[np.intp]]  #: Levels of factors, (runs, factors): -1 low, +1 high.


def half_fraction(factors: int) -> Levels:
    """Half of all combinations of levels -1 and +1, the last factor's the product of the others', (runs, factors)."""
    # Every column adds up to 0, and any two are orthogonal from three factors on.
    free = np.array(list(product((-1, 1), repeat=factors - 1)), dtype=np.intp)
    return np.concatenate([free, np.prod(free, axis=1, keepdims=True)], axis=1)


def main_effects(values: Values, levels: Levels) -> Values:
    """Mean at the high level less mean at the low one, (..., factors); runs without an answer are left out."""
    known = np.isfinite(values)
    filled = np.where(known, values, 0.0)
    means = []
    for sign in (1, -1):
        chosen = (levels == sign).astype(float)
        count = known.astype(float) @ chosen
        with np.errstate(invalid="ignore", divide="ignore"):
            means.append(filled @ chosen / np.where(count > 0, count, np.nan))
    found: Values = means[0] - means[1]
    return found


FACTORS = ("gap", "pitch", "wait", "roughness", "friction_coefficient")  #: What differs between the runs of a robot.
WINDOWS = ("three turns", "whole run")
"""What a run is read over: the last two of the tail's first three turns, or the last two thirds of it all."""
READ = (*FACTORS, "window")  #: What differs between the readings of a robot.
AT_RUNS = (*MOVING, "azimuth", "contact_share")  #: Quantities of each run and window.
INFERRED = ("effective_friction", "body_drag_factor", "modelled_forward_velocity", "modelled_body_rotation_rate")
"""Quantities that the paper's models give at the rates of a run."""
INFERRED_BY = ("sbt", "rft")  #: The paper's models, each with the robot's own calibration.
_SAMPLES_PER_TURN = 40


class ReleasedRobot(NamedTuple):
    """Release of a robot for one run, SI."""

    gap: float
    pitch: float
    wait: float
    roughness: float
    friction_coefficient: float


def levels() -> Levels:
    """Levels of `FACTORS` in each run, (runs, factors): -1 low, +1 high."""
    return half_fraction(len(FACTORS))


def levels_of_readings() -> Levels:
    """Levels of `READ` in each run and window, the window the faster index, (runs * windows, factors)."""
    runs = levels()
    windows = np.tile([-1, 1], len(runs))[:, None]
    return np.concatenate([np.repeat(runs, len(WINDOWS), axis=0), windows], axis=1)


def release_runs(robot: Robot, ranges: LaidDown) -> list[ReleasedRobot]:
    """Release of a robot in each run; its steepest pitch is what gap and tail allow."""
    batch, found = RobotBatch.of(robot), []
    for signs in levels():
        low_or_high = [getattr(ranges, name)[int(sign > 0)] for name, sign in zip(FACTORS, signs, strict=True)]
        released = ReleasedRobot(*low_or_high)
        found.append(released._replace(pitch=released.pitch * steepest_pitch(batch, released.gap)))
    return found


@dataclass(frozen=True)
class ReleaseTask(OneRobot):
    """All runs of one robot."""

    ranges: LaidDown

    needed = frozenset({*AT_RUNS, *INFERRED, "laid_pitch"})
    followed = "runs after release"

    def answer(self, _loaded: LoadedStudy, _observed: ObservedArrays | None, /) -> Part:
        """Every quantity of every run: (1, runs, windows), what is inferred with one more axis for `INFERRED_BY`."""
        # NaN for a run that its robot cannot make, and over a window that it does not reach.
        runs = release_runs(self.robot, self.ranges)
        read = [self._read(released) for released in runs]
        part: Part = {
            name: np.array([[[window[name] for window in run] for run in read]], dtype=float) for name in AT_RUNS
        }
        part |= {name: values[None] for name, values in inferred(self.robot, part).items()}
        return part | {"laid_pitch": np.array([[released.pitch for released in runs]])}

    def _read(self, released: ReleasedRobot) -> list[dict[str, float]]:
        nothing = [dict.fromkeys(AT_RUNS, float("nan")) for _ in WINDOWS]
        try:
            run = simulate(
                self.robot,
                model="tube",
                timing={"duration": self.ranges.duration, "samples_per_turn": _SAMPLES_PER_TURN},
                placement={"gap": released.gap, "pitch": released.pitch},
                roughness=released.roughness,
                in_tube={"wait": released.wait, "friction_coefficient": released.friction_coefficient},
            )
        except InputError:
            return nothing
        events = [event["what"] for event in json.loads(str(run.attrs["events"]))]
        if INTERRUPTED in events:
            raise KeyboardInterrupt
        return [_observe(run, *_window(run, name, self.ranges.duration)) for name in WINDOWS]


def _window(run: xr.Dataset, name: str, duration: float) -> tuple[float, float]:
    """Beginning and end of what a run is read over, s; NaN if it ended before."""
    time = run["time"].values
    turns = np.abs(run["tail_angle"].values) / (2.0 * np.pi)
    if turns[-1] < 3.0 or (name == "whole run" and time[-1] < duration * (1.0 - 1e-9)):
        return float("nan"), float("nan")
    if name == "whole run":
        return duration / 3.0, duration
    begin, end = (float(time[int(np.argmax(turns >= count))]) for count in (1.0, 3.0))
    return begin, end


def _observe(run: xr.Dataset, begin: float, end: float) -> dict[str, float]:
    """What a camera above the channel sees of a run between two times, and the current."""
    if not np.isfinite(begin):
        return dict.fromkeys(AT_RUNS, float("nan"))
    time = run["time"].values
    inside = (time >= begin) & (time <= end)

    def change(values: Samples) -> float:
        first, last = np.interp([begin, end], time, values)
        return float(last - first)

    length = end - begin
    return {
        "forward_velocity": change(run["position"].values[:, 0]) / length,
        "tail_rotation_rate": change(run["tail_angle"].values) / length,
        "body_rotation_rate": change(run["body_angle"].values) / length,
        "motor_rotation_rate": change(run["tail_phase"].values) / length,
        "motor_current": float(run["motor_current"].values[inside].mean()) if "motor_current" in run else float("nan"),
        "azimuth": change(run["azimuth"].values),
        "contact_share": float(np.mean(run["contact_force"].values[inside] > 0.0)),
    }


def inferred(robot: Robot, seen: Part) -> Part:
    """Quantities that the paper's models give at observed rates, (..., models)."""
    # B_eff follows from (18) with the hydrodynamic torque of the model at the observed rates of tail and motor, as the
    # paper infers it; speed and body rate are the model's at the observed tail rate. The factor on the drag of the
    # isolated body is that with which the axial balance (15) gives the observed speed at the observed tail rate.
    tail, motor = (seen[name].ravel() for name in ("tail_rotation_rate", "motor_rotation_rate"))
    speed = seen["forward_velocity"].ravel()
    batch = RobotBatch.of(robot).with_values({"tail.wavelength": np.full(tail.size, robot.tail.wavelength)})
    columns: dict[str, list[Values]] = {name: [] for name in INFERRED}
    for name in INFERRED_BY:
        moved = swim(batch, name, tail_rate=tail, friction="rotor")
        both = swim(batch, name, tail_rate=tail, motor_rate=motor, friction="rotor")
        drag = find_swimmer_model(name).axial(batch)
        columns["effective_friction"].append(both.effective_friction)
        columns["modelled_forward_velocity"].append(moved.forward_velocity)
        columns["modelled_body_rotation_rate"].append(moved.body_rotation_rate)
        thrust = -drag[..., 2, 3] * tail - drag[..., 2, 2] * speed
        with np.errstate(divide="ignore", invalid="ignore"):
            columns["body_drag_factor"].append(thrust / (drag[..., 0, 0] * speed))
    shape = seen["tail_rotation_rate"].shape[1:]
    return {name: np.stack(values, axis=-1).reshape(*shape, len(INFERRED_BY)) for name, values in columns.items()}


def without_answer(parts: Iterable[Part]) -> list[Note]:
    """A sentence on the runs after release without a result; none where all have one."""
    found = [np.isfinite(part["forward_velocity"]).any(axis=-1) for part in parts]
    known = np.concatenate([part.ravel() for part in found]) if found else np.ones(0, dtype=bool)
    if known.all():
        return []
    return [Note.named("runs-without-answer", count=np.count_nonzero(~known), runs=known.size)]


SETTLED = (*MOVING, "shaft_power", "hydrodynamic_efficiency")  #: Quantities of a steady motion.
POSE = ("gap", "pitch", "yaw", "azimuth", "approach_time")  #: Pose of a robot in it, and its time constant.
SETTLED_STATES = ("not followed", *get_args(State))  #: Outcomes for a robot, in the order of the dataset's values.


@dataclass(frozen=True)
class SettledTask(OneRobot):
    """One released robot."""

    placement: Placement  #: Its initial pose.
    contact: Contact  #: What it rests on.

    needed = frozenset({*SETTLED, *POSE, "error_estimate", "near", "state"})
    followed = "steady state"

    def follow(self, _loaded: LoadedStudy, /) -> dict[str, float]:
        """Compute the quantities of the steady motion; the state alone where there is none."""
        motion = free_motion(
            self.robot,
            placement=self.placement,
            roughness=self.contact.roughness,
            in_tube={"friction_coefficient": self.contact.friction_coefficient},
        )
        found = motion.prediction
        lying = found.steady_state
        assert lying is not None  # noqa: S101 - a free motion has one
        values = {"state": float(SETTLED_STATES.index(lying.state))}
        if lying.state == "changing":  # its means depend on when they are taken
            return values
        values |= {name: float(getattr(found.swimming, name)[0]) for name in SETTLED}
        values |= {name: float(getattr(lying, name)) for name in POSE}
        return values | {"error_estimate": found.error_estimate, "near": float(motion.checked.near)}


def settled_basis(contact: Contact) -> Note:
    """What settled speeds are, and rest on."""
    height = "1e-4 of its radius" if contact.roughness is None else show_height(contact.roughness)
    return Note.named("settled-basis", height=height, friction=contact.friction_coefficient)


def not_settled(answers: Sequence[tuple[SettledTask, Part]]) -> list[Note]:
    """Notes on robots without a steady motion, and on steady motions beyond what the tables were checked for."""
    lost = [task for task, part in answers if not np.isfinite(part["forward_velocity"][0])]
    far = [task for task, part in answers if task not in lost and np.isnan(part["error_estimate"][0])]
    near = [task for task, part in answers if part["near"][0] == 1.0 and task not in far]
    groups = {"yaw-not-checked": far, "gap-not-checked": near, "not-settled": lost}
    return [
        Note.named(name, count=len(group), robots=len(answers), below=BELOW, first=group[0].robot.with_tail)
        for name, group in groups.items()
        if group
    ]


def settled_variables(
    answers: Sequence[tuple[SettledTask, Part]], robots: Sequence[str], shape: Sequence[int]
) -> dict[str, Any]:
    """`<quantity>_settled` of the steady motions, NaN where there is none, and `settled`, what became of each."""
    found: dict[str, Any] = {}
    for name in (*SETTLED, *POSE):
        about = attributes(
            name, meaning=f"{QUANTITIES[name].meaning}, in steady motion", source="free motion in the tube"
        )
        found[f"{name}_settled"] = (tuple(robots), gathered(answers, name, shape), about)
    state = np.clip(np.nan_to_num(gathered(answers, "state", shape)), 0, len(SETTLED_STATES) - 1).astype("int8")
    about = flag_attributes("outcome for a robot after release", "free motion in the tube", SETTLED_STATES)
    about_error = attributes(
        "error_estimate",
        meaning="relative error of the speed in steady motion; NaN beyond the yaws that the table was checked for",
        source="table of the tube",
    )
    error = (tuple(robots), gathered(answers, "error_estimate", shape), about_error)
    return {**found, "error_estimate_settled": error, "settled": (tuple(robots), state, about)}
