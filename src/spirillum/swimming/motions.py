"""Motions as data: steady swimming of a batch, the released motion beside an axial answer, and its steady state.

Held, the whole robot has one velocity along x. Released, no force and no lateral torque acts on it, and the motion is
a screw: seen from the tail, the velocity U of the origin and the rotation w = (omega, Omega_y, Omega_z) of the tail are
constant, so that the robot advances along the fixed direction of w at U.w/|w| while its axis circles around it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any, Literal, NamedTuple, cast, get_args

import numpy as np

from spirillum.answer_entries import content_of
from spirillum.arrays import Flags, PerRobot, Samples
from spirillum.data_tables import rows_of
from spirillum.display import DisplayMixin
from spirillum.envelope import envelope, interval, quantity
from spirillum.errors import InputError, check_choice
from spirillum.fluid.model import SwimmerModel
from spirillum.notes import Note
from spirillum.quantities import QUANTITIES, Quantity

LEVEL = 0.95  #: Level of the intervals.


@dataclass(frozen=True, repr=False)
class Swimming(DisplayMixin):
    """Steady motion of a batch, one value for each robot, SI, rates signed about +x; NaN where not `valid`.

    Units, meanings and sources stand in `spirillum.quantities`.
    """

    forward_velocity: PerRobot
    advance_per_radian: PerRobot
    tail_rotation_rate: PerRobot
    body_rotation_rate: PerRobot
    motor_rotation_rate: PerRobot
    tail_torque: PerRobot
    drive_torque: PerRobot
    motor_current: PerRobot
    battery_voltage: PerRobot
    effective_friction: PerRobot
    motor_residual_torque: PerRobot
    electrical_power: PerRobot
    shaft_power: PerRobot
    friction_power: PerRobot
    dissipated_power: PerRobot
    hydrodynamic_efficiency: PerRobot
    propulsive_power: PerRobot
    overall_efficiency: PerRobot
    cost_of_transport: PerRobot
    reynolds_number: PerRobot
    tail_reynolds_number: PerRobot
    battery_run_time: PerRobot
    plug_velocity: PerRobot
    wobble_angle: PerRobot
    path_radius: PerRobot
    step_out_rate: PerRobot
    phase_lag: PerRobot
    valid: Flags
    warnings: tuple[Note, ...] = ()  #: Of the whole batch.

    @property
    def quantities(self) -> dict[str, PerRobot]:
        """The arrays of the quantities by name, without `valid` and `warnings`."""
        return {item.name: getattr(self, item.name) for item in STEADY}

    def to_dict(self) -> dict[str, Any]:
        """Median, least and largest of every quantity over the robots, as data."""
        found = {name: np.asarray(column)[self.valid] for name, column in self.quantities.items()}
        known = {name: column[np.isfinite(column)] for name, column in found.items()}
        content = {
            "robots": int(self.valid.size),
            "valid": int(np.count_nonzero(self.valid)),
            **{
                name: quantity(np.median(column), QUANTITIES[name].unit, low=column.min(), high=column.max())
                for name, column in known.items()
                if column.size
            },
        }
        return envelope("swimming", content, self.warnings)

    def _display_content(self) -> tuple[Mapping[str, Any], list[str]]:
        """See `DisplayMixin`: the quantities that matter most."""
        answer = self.to_dict()
        return answer, [name for name in HEADLINE if name in answer][:_SHOWN]


STEADY: tuple[Quantity, ...] = tuple(QUANTITIES[item.name] for item in fields(Swimming) if item.type == "PerRobot")
"""The quantities of steady swimming, in their order."""


HEADLINE: tuple[str, ...] = (
    "forward_velocity",
    "tail_rotation_rate",
    "body_rotation_rate",
    "motor_current",
    "step_out_rate",
    "hydrodynamic_efficiency",
    "tail_torque",
)
"""The quantities that matter most, most first: an answer shows the first five of them that apply."""
_SHOWN = 5


def headline(answer: Mapping[str, Any]) -> list[str]:
    """Names of the five quantities of a robot's JSON that matter most."""
    return [name for name in HEADLINE if answer[name]["value"] is not None][:_SHOWN]


@dataclass(frozen=True)
class Intervals:
    """Limits of the intervals of every quantity of one robot."""

    low: Mapping[str, float]
    high: Mapping[str, float]
    middle: Mapping[str, float]  #: Medians of the draws.

    def of(self, name: str) -> dict[str, Any]:
        """Entries `low`, `high`, `kind` and `level` of a quantity's JSON; none for one that does not apply."""
        return interval(self.low[name], self.high[name], LEVEL)


HELD = "held"
RELEASED = "trial"  #: Motions of a robot in its tube, where a request takes one of both.
ASSUMPTION = "contact assumed, not validated"  #: What a released motion rests on.
SPEED_OF = "speed, "
"""How a progress message begins that has the speed of a column: a terminal shows it as a line of its own."""


class TrialInterval(NamedTuple):
    """A quantity of a trial over its unknowns."""

    median: float
    low: float
    high: float
    level: float


@dataclass(frozen=True, repr=False)
class ReleasedMotion(DisplayMixin):
    """A trial or a steady motion in the tube, or the reason why there is none; SI, rates signed about +x."""

    values: Mapping[str, float] = field(default_factory=dict)
    """Means of the quantities of `predict`, and the pose: `gap`, `pitch`, `yaw`, `azimuth`, `contact_force`."""
    basis: Mapping[str, Any] = field(default_factory=dict)
    """What the motion rests on, and what became of the robot, as entries of its JSON."""
    intervals: Mapping[str, TrialInterval] = field(default_factory=dict)
    """Intervals of the quantities over the unknowns; none where they were not requested."""
    error: float = math.nan  #: Stated error of the table in the forward velocity, relative; NaN where none is stated.
    reason: str = ""  #: Why there is none, in a sentence; empty where there is one.

    def to_dict(self) -> dict[str, Any]:
        """The object `trial` or `steady` of an answer."""
        if self.reason:
            return {"reason": self.reason}
        over = {name: {**found._asdict(), "kind": "interval"} for name, found in self.intervals.items()}
        values = {
            name: quantity(value, QUANTITIES[name].unit, **over.get(name, {})) for name, value in self.values.items()
        }
        error = {"error_estimate": quantity(self.error, "1")} if math.isfinite(self.error) else {}
        return {**self.basis, **error, **values}

    def _display_content(self) -> tuple[dict[str, Any], None]:
        """See `DisplayMixin`: the motion first, then what it rests on."""
        own = self.to_dict()
        first = {name: own[name] for name in self.values if name in own}
        return {"schema": "spirillum.released-motion/1", **first, **own}, None

    def __str__(self) -> str:
        """The motion for `print`, or why there is none."""
        return self.reason or super().__str__()


State = Literal["steady", "orbits", "goes around", "changing"]
"""A fixed point of the return map; one up to the azimuth, without weight; motion around the tube, against its weight;
or none of these within the turns that were followed.
"""

END_STATES = {row["state"]: row["meaning"] for row in rows_of("swimming/end_states.csv")}
"""Final states of a released robot, the first that applies, and what they mean."""


@dataclass(frozen=True)
class SteadyState:
    """Pose of a free robot in its tube over its last turn of the tail (around the tube: over the last circuit).

    SI; azimuths about +x from the lowest place, pitch away from the wall, yaw to +y at the lowest place.
    """

    state: State  #: `steady`, `orbits`, `goes around` or `changing`.
    azimuth: float  #: Azimuth of the body's centre, mean, rad; NaN where it goes around.
    gap: float  #: Smallest distance of body and wall, mean, m.
    gap_range: tuple[float, float]  #: Its least and largest value.
    pitch: float  #: Mean pitch against the wall, rad.
    yaw: float  #: Mean yaw against the wall, rad.
    orbit_rate: float  #: Rate of the azimuth, mean, rad/s.
    contact_force: float  #: Load on asperities, mean, N.
    time: float  #: Time over which the motion was followed since release, s.
    approach_time: float
    """Time constant with which a small distance from the steady motion decays, s; NaN where there is none."""
    ended: str = ""  #: Why the motion was not followed to a steady one, in half a sentence; empty where it was.

    @property
    def statement(self) -> str:
        """Whether a steady motion was reached, and what the means are over, a sentence."""
        if self.state == "steady":
            return "a steady motion was reached: each turn of the tail returns to this pose"
        if self.state == "changing":
            return f"no steady motion was reached: {self.ended}; all values are means over the last turn of the tail"
        circuit = abs(2.0 * math.pi / self.orbit_rate) if self.orbit_rate else math.inf
        if self.state == "orbits":
            around = f"orbits the tube's axis in {circuit:.3g} s" if math.isfinite(circuit) else "keeps any azimuth"
            return f"no steady azimuth was reached: all azimuths are equivalent, and the robot {around}"
        return (
            f"no steady motion was reached: its weight does not hold the robot, which goes around the tube in "
            f"{circuit:.3g} s; all values are means over a circuit"
        )

    def to_dict(self) -> dict[str, Any]:
        """The object `steady_state` of an answer."""
        return content_of(self, over="a circuit" if self.state == "goes around" else "a turn of the tail")


Motion = Literal["held", "free"]  #: Lateral motion and tilt constrained, or released.

LINKS = np.zeros((12, 7))
"""Twists of body and rotor from the seven rates (U, Omega_b, omega_m), all about the origin in body axes."""
LINKS[:6, :6] = LINKS[6:, :6] = np.eye(6)
LINKS[9, 6] = 1.0


class Screw(NamedTuple):
    """The free motion, as long as both parts turn steadily; SI."""

    speed: PerRobot  #: Speed along the axis of the screw, positive where the nose leads, m/s.
    tilt: PerRobot  #: Angle between the motor axis and the axis of the screw, rad.
    radius: PerRobot  #: Radius of the helix on which the origin moves, m.

    @classmethod
    def of(cls, shared: Samples, body_rate: PerRobot, tail_rate: PerRobot) -> Screw:
        """The screw of robots with such rates, rad/s, from the motion per rate of `balance.released`."""
        moving = shared[..., 0] * body_rate[..., None] + shared[..., 1] * tail_rate[..., None]
        velocity = moving[..., :3]
        spin = np.concatenate([np.broadcast_to(tail_rate, moving.shape[:-1])[..., None], moving[..., 3:]], axis=-1)
        size = np.linalg.norm(spin, axis=-1)
        turning = np.where(size > 0, size, np.inf)
        forward = np.where(tail_rate < 0, -1.0, 1.0)
        along = forward * np.sum(velocity * spin, axis=-1) / turning
        return cls(
            speed=np.where(size > 0, along, velocity[..., 0]),
            tilt=np.arctan2(np.linalg.norm(spin[..., 1:], axis=-1), np.abs(tail_rate)),
            radius=np.linalg.norm(np.cross(spin, velocity), axis=-1) / turning**2,
        )


def motion_of(name: str) -> Motion:
    """The motion of that name."""
    check_choice("motion", name, get_args(Motion))
    return cast("Motion", name)


def check_full(model: SwimmerModel) -> None:
    """Refuse a model that does not know all that a free motion needs."""
    if model.axial_only:
        why = "has the entries along and about the motor axis only"
    elif model.placed:
        why = "answers at one pose in the channel, which a free robot leaves"
    else:
        return
    raise InputError(f"motion = 'free' with model '{model.name}', which {why}; allowed: motion 'held', or rft, slender")
