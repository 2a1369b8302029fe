"""Where a robot comes to lie in its tube: how far it climbs the wall, how it rests, and how fast it sinks.

The model `tube` holds sideways motion and tilt. Here are the forces that this takes, against the submerged weight:
the azimuth at which they are in balance, the place at which the floor has to push, and the time in which the film
under a level robot drains (`lying`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from spirillum.answer import envelope, quantity
from spirillum.arrays import Samples
from spirillum.dynamics.resting_forces import (
    Descent,
    Film,
    contact_line,
    descent_of,
    film_of,
    lubrication_resistance,
    orbit_period,
    settled_azimuth,
    settling_time,
)
from spirillum.errors import InputError
from spirillum.fields.grid import Progress
from spirillum.fluid.model import SwimmerModel
from spirillum.fluid.tube.domain import seat_of
from spirillum.fluid.wire.robot_geometry import RobotGeometry
from spirillum.robot.batch import RobotBatch
from spirillum.robot.options import Resolution
from spirillum.robot.placement import Placement
from spirillum.robot.robot import STANDARD_GRAVITY, Robot
from spirillum.robot.seat import GAP_BAND, contact_pitch, gap_of
from spirillum.swimming.prediction import Prediction, checked_batch, predict, prepared
from spirillum.swimming.steady import swim
from spirillum.units import KINDS, parse_option, show

__all__ = ["Settling", "settle"]

MODEL = "tube"
"""The model that knows the walls."""
_GAP_RANGE = 5.0
"""Largest over smallest gap of the draining film, where none are given."""
_FEWEST, _MOST = 2, 32
_PARTS = (
    ("sideways_force", "N", "of the fluid on the robot, along +y at the lowest place"),
    ("normal_force", "N", "of the fluid on the robot, away from the wall"),
    ("pitching_torque", "N m", "of the fluid about mid-length, nose up"),
    ("yawing_torque", "N m", "of the fluid about mid-length, nose to +y"),
)
_KNOWN_ERROR = (
    "a coarsely resolved film resists normal and sideways motion too little: for the paper's robot at "
    "model.tube.tolerance = 0.005 some 0.5 % at a gap of 0.2 mm and 1 % at 0.1 mm; the robot is held level, "
    "while a film that drains also tilts it"
)


@dataclass(frozen=True)
class Settling:
    """Where a level robot comes to lie; SI, azimuths about +x from the lowest place, pitch nose up."""

    prediction: Prediction
    """The motion along the tube."""
    weight: float
    """Submerged weight W, N."""
    film: Film
    """Forces and resistances where the robot was placed."""
    force_error: float
    """Difference of the sideways force from another resolution, over its size."""
    films: tuple[Film, ...]
    """Forces and resistances at the gaps of the draining film, largest first."""
    descent: Descent
    """The way of a level robot from the lowest place at the largest gap."""
    _batch: RobotBatch = field(repr=False)

    @property
    def robot(self) -> Robot:
        """The robot."""
        return self.prediction.robot

    @property
    def sideways_force(self) -> float:
        """Force of the fluid along the wall, N: positive towards a positive azimuth."""
        return self.film.sideways_force

    @property
    def azimuth(self) -> float:
        """Azimuth to which the robot climbs at its gap, rad; NaN where it goes around the tube."""
        return settled_azimuth(self.film.sideways_force, self.weight)

    @property
    def contact(self) -> tuple[float, float]:
        """From where to where (x, rear and front) the body would touch the wall, m."""
        return contact_line(RobotGeometry.of(self._batch).body)

    @property
    def centre_of_weight(self) -> float:
        """Where on x the submerged weight acts, m; body.mass is taken as spread evenly over body and coupling."""
        d = {name: item.value for name, item in self.robot.derived().items()}
        lifted = d["mass"] - self.weight / STANDARD_GRAVITY
        moment = d["mass"] * d["centre_of_mass"] - lifted * d["centre_of_buoyancy"]
        return moment * STANDARD_GRAVITY / self.weight

    @property
    def load(self) -> float:
        """Force with which the robot presses on the wall at its azimuth, N; NaN where it goes around."""
        return self.weight * float(np.cos(self.azimuth)) - self.film.normal_force

    @property
    def centre_of_load(self) -> float:
        """Where on x the wall, or the film on it, has to push to hold the robot level, m."""
        turning = self.film.pitching_torque - self.centre_of_weight * self.weight * float(np.cos(self.azimuth))
        return -turning / self.load

    @property
    def rests(self) -> str:
        """How it rests on the wall once the film is gone: `level`, `tail down`, `nose down`; or `goes around`."""
        rear, front = self.contact
        if np.isnan(self.azimuth):
            return "goes around"
        if self.centre_of_load < rear:
            return "tail down"
        return "nose down" if self.centre_of_load > front else "level"

    @property
    def resting_pitch(self) -> float:
        """Pitch at rest, rad: 0, or that at which the tail touches; NaN nose down, or where it goes around."""
        if self.rests == "level":
            return 0.0
        if self.rests != "tail down":
            return np.nan
        g, radius = RobotGeometry.of(self._batch), seat_of(self._batch).radius
        wire, coupling = g.wire(), g.outlines.get("coupling")
        return contact_pitch(g.body, wire.points, wire.radius, radius, self.film.gap, coupling=coupling)

    @property
    def tilting(self) -> tuple[float, float]:
        """How it starts to sink at its gap, free to tilt: velocity away from the wall, m/s, and nose-up rate, rad/s."""
        turning = self.film.pitching_torque - self.centre_of_weight * self.weight * float(np.cos(self.azimuth))
        return self.film.sinking(-self.load, turning)

    @property
    def touching_time(self) -> float:
        """Gap over the rate at which the nearer end of the contact line starts to come closer, s."""
        velocity, rate = self.tilting
        nearing = max(-(velocity + x * rate) for x in self.contact)
        return self.film.gap / nearing if nearing > 0 else np.nan

    @property
    def drainage_time(self) -> float:
        """Time from the largest to the smallest gap, s; NaN where the robot is carried up before."""
        return float(self.descent.time[-1]) if self.descent.drained else np.nan

    @property
    def exponents(self) -> Samples:
        """d(ln S_z)/d(ln h) at the gaps of the draining film: -3/2 in a thin one."""
        log = np.log([[film.gap, film.normal_resistance] for film in self.films])
        return np.asarray(np.gradient(log[:, 1], log[:, 0]))

    @property
    def lubrication_ratios(self) -> Samples:
        """S_z over that of the cylindrical part in a thin film, at those gaps; NaN for a body without one."""
        rear, front = self.contact
        seat, viscosity = seat_of(self._batch), self.robot.fluid.viscosity
        radius = 0.5 * self.robot.body.diameter
        with np.errstate(divide="ignore", invalid="ignore"):
            thin = [lubrication_resistance(viscosity, front - rear, radius, seat.radius, f.gap) for f in self.films]
            return np.where(front > rear, [f.normal_resistance for f in self.films] / np.array(thin), np.nan)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What to be careful about, a sentence each."""
        found = list(self.prediction.warnings)
        if np.isnan(self.azimuth):
            found.append(
                f"the sideways force {show(self.sideways_force, 'mN')} exceeds the submerged weight "
                f"{show(self.weight, 'mN')}: at this gap the robot goes around the tube"
            )
        if not self.descent.drained:
            found.append(
                "the film does not drain: what turns in the fluid lifts the robot, or carries it up the wall, where "
                "its weight no longer presses on it"
            )
        return tuple(found)

    def to_dict(self) -> dict[str, Any]:
        """The answer of `spirillum settle --json`."""
        motion, film = self.prediction, self.film
        velocity, rate = self.tilting
        forces = {
            name: quantity(
                float(film.forces[:, place].mean()),
                unit,
                low=float(film.forces[:, place].min()),
                high=float(film.forces[:, place].max()),
                kind="band",
                over="phases of the tail",
                meaning=meaning,
            )
            for place, (name, unit, meaning) in enumerate(_PARTS)
        }
        drainage = {
            "gap": quantity([f.gap for f in self.films], "m"),
            "normal_resistance": quantity([f.normal_resistance for f in self.films], "N s/m"),
            "over_lubrication": quantity(self.lubrication_ratios, "1"),
            "exponent": quantity(self.exponents, "1"),
            "sideways_force": quantity([f.sideways_force for f in self.films], "N"),
            "sideways_resistance": quantity([f.sideways_resistance for f in self.films], "N s/m"),
            "body_rotation_rate": quantity([f.body_rate for f in self.films], "rad/s"),
            "azimuth": quantity([settled_azimuth(f.sideways_force, self.weight) for f in self.films], "rad"),
            "time": quantity(self.descent.time, "s"),
            "gap_over_time": quantity(self.descent.gap, "m"),
            "azimuth_over_time": quantity(self.descent.azimuth, "rad"),
        }
        content = {
            "robot": self.robot.name,
            "model": motion.model.name,
            "forward_velocity": quantity(motion.forward_velocity, "m/s"),
            "tail_rotation_rate": quantity(motion.tail_rotation_rate, "rad/s"),
            "body_rotation_rate": quantity(motion.body_rotation_rate, "rad/s"),
            "submerged_weight": quantity(self.weight, "N"),
            **forces,
            "sideways_force_over_weight": quantity(self.sideways_force / self.weight, "1"),
            "azimuth": quantity(self.azimuth, "rad"),
            "azimuth_time": quantity(settling_time(film, self.weight), "s"),
            "orbit_period": quantity(orbit_period(film, self.weight), "s"),
            "centre_of_weight": quantity(self.centre_of_weight, "m"),
            "centre_of_load": quantity(self.centre_of_load, "m"),
            "contact_rear": quantity(self.contact[0], "m"),
            "contact_front": quantity(self.contact[1], "m"),
            "rests": self.rests,
            "resting_pitch": quantity(self.resting_pitch, "rad"),
            "sideways_resistance": quantity(film.sideways_resistance, "N s/m"),
            "normal_resistance": quantity(film.normal_resistance, "N s/m"),
            "level_sinking_velocity": quantity(self.load / film.normal_resistance, "m/s"),
            "sinking_velocity": quantity(-velocity, "m/s"),
            "nose_up_rate": quantity(rate, "rad/s"),
            "touching_time": quantity(self.touching_time, "s"),
            "drainage_time": quantity(self.drainage_time, "s"),
            "drainage": drainage,
            "placement": motion.placement,
            "error_estimate": quantity(self.force_error, "1", statement=_KNOWN_ERROR),
            "references": list(motion.references),
        }
        return envelope("settling", content, self.warnings)


def settle(
    robot: str | Path | Mapping[str, Any] | Robot,
    *,
    tail_rate: str | float | None = None,
    friction: str | None = None,
    resolution: Resolution | Mapping[str, Any] | None = None,
    placement: Placement | Mapping[str, Any] | None = None,
    drain: tuple[str | float, str | float] | None = None,
    gaps: int = 5,
    progress: Progress | None = None,
) -> Settling:
    """Find where in its tube a robot comes to lie under its submerged weight, and how fast it sinks.

    Everything is for a level robot; the tail keeps the rate that it has where the robot was placed.

    Args:
        robot: a preset's name, a robot file, its tables, or a loaded robot.
        tail_rate: lab rotation rate of the tail, with its unit (``"1.2 Hz"``) or a float in rad/s; without it
            the robot's drive decides.
        friction: reading of the friction, `none`, `rotor`, `body` or `paper`; None: the robot's own.
        resolution: of the model `tube`: `accuracy`, `tolerance`, `phases`; None: the robot's own.
        placement: where the robot lies, level and without an imposed flow, see `predict`.
        drain: largest and smallest gap of the draining film, with units or floats in m; None: a ninth of the body's
            radius (but at most half of the room), and a fifth of that.
        gaps: number of gaps at which the film is computed, 2 to 32.
        progress: told what is being computed, how many gaps are done, and of how many.

    Raises:
        InputError: for wrong input, a robot outside the model's domain, of unknown weight, or that floats.
    """
    if not _FEWEST <= gaps <= _MOST:
        raise InputError(f"gaps = {gaps}; allowed: {_FEWEST} to {_MOST}")
    solved = Resolution.of(resolution).model_copy(update={"form": "direct"})
    ready, model, batch = prepared(robot, MODEL, resolution=solved, placement=_level(placement))
    reference = _closed(batch)
    weight = _weight(ready)
    asked = _drain(drain, batch, gaps)
    placements = [_at_gap(reference, gap) for gap in asked]
    for there in (placements[0], placements[-1]):
        checked_batch(ready, model, there)
    tell = progress or (lambda _what, _done, _total: None)
    tell("settling: where it is placed", 0, gaps + 1)
    motion = predict(ready, model=MODEL, tail_rate=tail_rate, friction=friction, placement=reference, band=False)
    film = _film(motion, motion.batch, motion.model)
    check = motion.model.checked_by(ready.model)
    error = np.nan
    if check is not None and film.sideways_force != 0:
        error = abs(_film(motion, motion.batch, check).sideways_force / film.sideways_force - 1.0)
    films = []
    for done, there in enumerate(placements, start=1):
        tell(f"settling: gap {show(asked[done - 1], 'mm')}", done, gaps + 1)
        films.append(_film(motion, checked_batch(ready, model, there), motion.model))
    tell("settling", gaps + 1, gaps + 1)
    return Settling(motion, weight, film, error, tuple(films), descent_of(films, weight), motion.batch)


def _level(placement: Placement | Mapping[str, Any] | None) -> Placement:
    """The placement of a level robot in a fluid that is not made to flow."""
    asked = Placement.of(placement)
    if asked.pitch:
        raise InputError(f"placement.pitch = {show(asked.pitch, 'deg')}; allowed: 0 deg, for a level robot settles")
    if asked.yaw:
        raise InputError(f"placement.yaw = {show(asked.yaw, 'deg')}; allowed: 0 deg, for a level robot settles")
    if asked.flow:
        raise InputError(f"placement.flow = {show(asked.flow, 'mm/s')}; allowed: none, for its lift is not computed")
    return asked


def _at_gap(placement: Placement, gap: float) -> Placement:
    return Placement.of({"gap": gap, "pitch": 0.0, "tail_drop": placement.tail_drop, "ends": placement.ends})


def _closed(batch: RobotBatch) -> Placement:
    """The placement with the model's own gap where none is given."""
    placement = batch.placement
    if placement.eccentricity is not None:
        return placement
    return _at_gap(placement, gap_of(placement, float(batch.body_diameter[0]), 0.5 * float(batch.channel_diameter[0])))


def _room(batch: RobotBatch) -> float:
    return 0.5 * float(batch.channel_diameter[0] - batch.body_diameter[0])


def _weight(robot: Robot) -> float:
    """Submerged weight, N."""
    found = robot.derived().get("submerged_weight")
    if found is None:
        raise InputError(f"{robot.name} has no known weight; allowed: body.mass and tail.density, both")
    if found.value <= 0:
        raise InputError(
            f"{robot.name} floats: its submerged weight is {show(found.value, 'mN')}; allowed: a robot heavier than "
            "the fluid (body.mass, tail.density, fluid.density)"
        )
    return found.value


def _drain(drain: tuple[str | float, str | float] | None, batch: RobotBatch, count: int) -> Samples:
    """Gaps of the draining film, largest first, m."""
    room = _room(batch)
    if drain is None:
        largest = min(GAP_BAND[1] * 0.5 * float(batch.body_diameter[0]), 0.5 * room)
        return np.geomspace(largest, largest / _GAP_RANGE, count)
    largest, smallest = (parse_option("drain", value, KINDS["length"]) for value in drain)
    if not smallest < largest < room:
        raise InputError(
            f"drain = {show(largest, 'mm')} to {show(smallest, 'mm')}; allowed: from a larger gap to a smaller one, "
            f"less than {show(room, 'mm')}, the gap on the tube's axis"
        )
    return np.geomspace(largest, smallest, count)


def _film(motion: Prediction, batch: RobotBatch, model: SwimmerModel) -> Film:
    """The fluid's answer at a place, with the tail at the rate of `motion`."""
    turning = motion.tail_rotation_rate
    state = swim(batch, model, tail_rate=np.array([turning]), friction=motion.friction, calibrated=False)
    seat = seat_of(batch)
    gap = seat.radius - 0.5 * float(batch.body_diameter[0]) - seat.offset  # level
    if not state.valid[0]:
        raise InputError(f"placement.gap = {show(gap, 'mm')}: the robot's drive has no steady motion there")
    count = batch.options.tube.phases
    matrices = np.stack([model.resistance(batch, np.array([2.0 * np.pi * k / count]))[0] for k in range(count)])
    speed, body, tail = (
        float(v[0]) for v in (state.forward_velocity, state.body_rotation_rate, state.tail_rotation_rate)
    )
    twists = np.array([speed, 0.0, 0.0, body, 0.0, 0.0, speed, 0.0, 0.0, tail, 0.0, 0.0])
    rubbing = float(state.effective_friction[0]) if motion.friction in ("body", "paper") else 0.0
    wall = rubbing if motion.friction == "body" else -rubbing
    return film_of(
        matrices, twists, gap, seat.offset, one_piece=batch.joint == "fixed", wall_friction=np.nan_to_num(wall)
    )
