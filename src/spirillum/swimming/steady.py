"""Steady swimming of a batch of robots: resistance and drive to speed, rates, torques and powers.

Dry friction of a robot that rests on its asperities is an added resistance of its body. The floor carries the robot's
weight in the fluid N through asperities at the body's lowest point, which slides along the tube at U and around it at
a Omega, with the body's radius a. Coulomb friction acts against the sliding:

    F_x = -mu_c N U/s,   T_x = -mu_c N a^2 Omega/s,   s = sqrt(U^2 + (a Omega)^2 + v_r^2),

smooth below the sliding speed v_r. That is the resistance k = mu_c N/s against U and k a^2 against Omega, added to the
body's, with k at the robot's own sliding speed. Unlike all fluid resistance it depends on how fast the tail turns. The
film's forces across the tube are not in N: they vanish for a level robot at the lowest place of its tube.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from spirillum.argument_validation import number_array
from spirillum.arrays import Axial, AxialLoad, AxialWhole, Flags, Matrix12, MeanFlow, PerRobot, Samples, Values
from spirillum.errors import InputError
from spirillum.fluid.closed.perrin import body_axial
from spirillum.fluid.model import AxialFlow, SwimmerModel
from spirillum.fluid.registry import find_swimmer_model
from spirillum.kernels.core import contact_drag
from spirillum.notes import Note
from spirillum.robot.batch import RobotBatch
from spirillum.robot.limits import Limit, all_hold, body_reynolds, is_stokes_flow, reynolds_limits, tail_reynolds
from spirillum.robot.links import links_of
from spirillum.robot.robot import STANDARD_GRAVITY, Robot
from spirillum.robot.tables import FrictionModel
from spirillum.swimming.balance import (
    DriveState,
    TorqueBalance,
    at_rate,
    battery_voltage,
    driven,
    find_friction_model,
    force_free,
    joined,
    one_piece,
    released,
    run_time,
    with_body_factors,
)
from spirillum.swimming.cautions import accuracy_cautions, calibration_cautions, summed
from spirillum.swimming.motions import STEADY, Motion, Screw, Swimming, check_full, motion_of

_BLOCK = 1 << 15  # robots worked on at once: their columns stay in the processor's cache


def calibrated_balance(batch: RobotBatch, model: SwimmerModel, *, calibrated: bool = True) -> TorqueBalance:
    """The force-free torque balance; a calibration factor f adds (f - 1) times the isolated body's drag."""
    return _balance_of(model.axial_flow(batch), batch, model, calibrated=calibrated)


def _balance_of(found: AxialFlow, batch: RobotBatch, model: SwimmerModel, *, calibrated: bool) -> TorqueBalance:
    r = _with_factors(joined(found.resistance), (0, 1), batch, model, calibrated=calibrated)
    return force_free(r, found.load)


def calibrated_resistance(batch: RobotBatch, model: SwimmerModel, *, calibrated: bool = True) -> Matrix12:
    """R of both parts at phase 0 with calibration factors, for a motion that is not constrained to the axis."""
    return _with_factors(model.resistance(batch, np.zeros(1)), (0, 3), batch, model, calibrated=calibrated)


def axial_forces(batch: RobotBatch, model: SwimmerModel, motion: Swimming, *, calibrated: bool = True) -> Samples:
    """Axial force and torque of the fluid on the body, then on the rotor, in steady motion, (robots, 4), N and N m."""
    found = model.axial_flow(batch)
    r = _with_factors(found.resistance, (0, 1), batch, model, calibrated=calibrated)
    rates = (motion.forward_velocity, motion.body_rotation_rate, motion.forward_velocity, motion.tail_rotation_rate)
    # Of the two forces one is drag, one thrust; they cancel, as nothing else pushes along the axis.
    force: Samples = -(r @ np.stack(rates, axis=-1)[..., None])[..., 0]
    return force + found.load


def _with_factors(
    r: Samples, entries: tuple[int, int], batch: RobotBatch, model: SwimmerModel, *, calibrated: bool
) -> Samples:
    """R with the batch's calibration factors for the model, if it has any; `entries` as `with_body_factors`."""
    factors = batch.calibration.get(model.name) if calibrated else None
    if factors is None:
        return r
    return with_body_factors(r, (factors.body_drag, factors.body_rotation), body_axial(batch), entries)


def swim(
    batch: RobotBatch,
    model: str | SwimmerModel = "sbt",
    *,
    tail_rate: PerRobot | Sequence[float] | float | None = None,
    motor_rate: PerRobot | Sequence[float] | float | None = None,
    friction: str | None = None,
    calibrated: bool = True,
    motion: str = "held",
) -> Swimming:
    """Steady swimming of every robot of a batch.

    Args:
        batch: the robots; a million is one call.
        model: a hydrodynamic model, or its name.
        tail_rate: prescribed lab rates of the tail, rad/s, one or one each; without them the robots' drive decides.
            With a DC-motor the current then follows from (17) and the effective friction from (18).
        motor_rate: prescribed (observed) motor rates omega_m, rad/s, alone or together with `tail_rate`.
        friction: friction model; None: the robots' own.
        calibrated: apply the robots' calibration factors for this model.
        motion: `held` (lateral motion and tilt constrained) or `free` (released; without weight).

    Returns:
        One value for each robot; NaN and `valid = False` where a robot cannot be built, is outside the model's
        domain, or moves at a Reynolds number above 10 and its option `model.beyond_stokes` is off: the Reynolds
        numbers themselves are then given.

    Raises:
        InputError: for an unknown model or friction model, rates that do not match the batch, or robots whose drive
            leaves the motion open.
    """
    chosen = find_swimmer_model(model) if isinstance(model, str) else model
    if batch.joint == "fixed" and motor_rate is not None:
        raise InputError("motor_rate with drive.joint = 'fixed': nothing turns in the joint; allowed: a tail rate")
    tail, motor = _per_robot(tail_rate, batch, "tail_rate"), _per_robot(motor_rate, batch, "motor_rate")
    driven_freely = tail_rate is None and motor_rate is None
    reading = find_friction_model(batch.friction if friction is None else friction)
    lateral = motion_of(motion)
    if lateral == "free":
        _check_free(batch, chosen)
    parts, found = [], []
    for cut, block in batch.blocks(_BLOCK):
        part = _swim_block(block, chosen, tail[cut], motor[cut], reading, lateral, driven_freely, calibrated)
        found += accuracy_cautions(chosen, block, part)
        found += calibration_cautions(chosen, block, part.valid) if calibrated else []
        parts.append(part)
    notes = summed(found, batch.size) if batch.size > 1 else [caution.note for caution in found]
    return one_after_another(parts, (*_wall_notes(batch, chosen, calibrated=calibrated), *notes))


def _wall_notes(batch: RobotBatch, model: SwimmerModel, *, calibrated: bool) -> tuple[Note, ...]:
    """Return the note on a model without walls for robots in channels."""
    if model.placed or not np.any(np.isfinite(batch.channel_diameter)):
        return ()
    factors = calibrated and model.name in batch.calibration
    return (Note.named("factors-for-walls" if factors else "swimming-without-walls", model=model.name),)


def one_after_another(parts: Sequence[Swimming], warnings: tuple[Note, ...] = ()) -> Swimming:
    """Concatenate answers, and their notes unless others are given."""
    names = (*(item.name for item in STEADY), "valid")
    arrays = {name: np.concatenate([getattr(part, name) for part in parts]) for name in names}
    return Swimming(**arrays, warnings=warnings or tuple(dict.fromkeys(n for part in parts for n in part.warnings)))


def _check_free(batch: RobotBatch, model: SwimmerModel) -> None:
    """Refuse a free motion that the torque balance about the motor axis does not decide."""
    check_full(model)
    if batch.drive == "magnetic":
        raise InputError(
            "motion = 'free' with drive.kind = 'magnetic': the field does not turn the robot about its own axis then; "
            "allowed: motion 'held', or `magnetic-sweep` and `simulate` for the free robot"
        )


def speed_error(speeds: Sequence[PerRobot], unchecked: float) -> PerRobot:
    """Relative error of the forward velocities of a model that is checked by others."""
    with np.errstate(divide="ignore", invalid="ignore"):
        changes = [np.abs(after / before - 1.0) for before, after in pairwise(speeds)]
    total: PerRobot = np.sum(changes, axis=0) + unchecked
    return total


def _per_robot(rate: PerRobot | Sequence[float] | float | None, batch: RobotBatch, name: str) -> PerRobot:
    """One rate for each robot; NaN where there is none."""
    array = np.atleast_1d(number_array(name, np.nan if rate is None else rate, "numbers in rad/s"))
    if array.ndim != 1 or array.size not in (1, batch.size):
        raise InputError(f"{name} has shape {array.shape}; allowed: one value, or {batch.size}, one for each robot")
    return np.broadcast_to(array, (batch.size,))


def _swim_block(
    batch: RobotBatch,
    model: SwimmerModel,
    tail_rate: PerRobot,
    motor_rate: PerRobot,
    friction: FrictionModel,
    motion: Motion,
    driven_freely: bool,  # noqa: FBT001 - passed on by the one caller
    calibrated: bool,  # noqa: FBT001
) -> Swimming:
    valid = batch.known & all_hold(model.requirements(batch))
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        shared = flow = None
        if motion == "held":
            found = model.axial_flow(batch)
            balance, flow = _balance_of(found, batch, model, calibrated=calibrated), found.mean_flow
        else:
            balance, shared = released(calibrated_resistance(batch, model, calibrated=calibrated))
        if batch.joint == "fixed":
            state = one_piece(batch, balance, tail_rate)
        elif driven_freely:
            state = driven(batch, balance, friction)
        else:
            state = at_rate(batch, balance, tail_rate, motor_rate, friction)
        screw = None if shared is None else Screw.of(shared, state.body_rate, state.tail_rate)
        return _answer(batch, flow, balance, state, screw, valid)


def _answer(
    batch: RobotBatch, flow: MeanFlow | None, s: TorqueBalance, state: DriveState, screw: Screw | None, valid: Flags
) -> Swimming:
    body_rate, tail_rate = state.body_rate, state.tail_rate
    speed = s.speed(body_rate, tail_rate) if screw is None else screw.speed
    load = s.rotor_load(body_rate, tail_rate)
    dissipated = load * tail_rate + s.body_load(body_rate, tail_rate) * body_rate
    if batch.joint == "fixed":
        drive = load + s.body_load(body_rate, tail_rate)
        # The mean power of a slipping robot is its mean torque times the rate of the field, not times its own.
        from_field = ~np.isnan(state.driving_rate)
        shaft = drive * np.where(from_field, state.driving_rate, tail_rate)
        dissipated = np.where(from_field, shaft, dissipated)
    else:
        drive, shaft = load, load * (tail_rate - body_rate)
    known = {
        "forward_velocity": speed,
        "tail_rotation_rate": tail_rate,
        "body_rotation_rate": body_rate,
        "tail_torque": np.abs(load),
        "drive_torque": drive,
        "motor_current": state.current,
        "effective_friction": state.effective,
        "motor_residual_torque": state.residual,
        "shaft_power": shaft,
        "friction_power": state.torques.power(body_rate, tail_rate),
        "dissipated_power": dissipated,
        "step_out_rate": state.step_out,
        "phase_lag": state.lag,
    }
    if screw is not None:
        known |= {"wobble_angle": screw.tilt, "path_radius": screw.radius}
    if flow is not None:
        moved = (flow[..., 0] + flow[..., 2]) * speed + flow[..., 1] * body_rate + flow[..., 3] * tail_rate
        known["plug_velocity"] = moved + flow[..., 4]
    return swimming_of(batch, known, valid)


def swimming_of(batch: RobotBatch, known: Mapping[str, PerRobot], valid: Flags) -> Swimming:
    """All quantities of steady swimming from speed, rates, torques, powers and current; NaN for what is not known."""
    speed, tail_rate, shaft = (known[name] for name in ("forward_velocity", "tail_rotation_rate", "shaft_power"))
    current, effective = known["motor_current"], known["effective_friction"]
    none: PerRobot = np.full(1, np.nan)
    towing = body_axial(batch)[0] * speed**2
    motor = batch.electrics
    voltage = electrical = lasting = none
    if motor is not None and batch.drive == "dc-motor":
        voltage = battery_voltage(motor, current)
        electrical = motor.duty * motor.polarity * current * voltage
        lasting = run_time(motor, current)
    wire = 0.25 * np.pi * batch.wire_diameter**2 * batch.arc_length
    values = {
        **{item.name: known.get(item.name, none) for item in STEADY},
        "advance_per_radian": np.where(tail_rate == 0, np.nan, speed / tail_rate),
        "motor_rotation_rate": tail_rate - known["body_rotation_rate"],
        "battery_voltage": voltage,
        "electrical_power": electrical,
        "hydrodynamic_efficiency": towing / shaft,
        "propulsive_power": towing,
        "overall_efficiency": towing / electrical,
        "cost_of_transport": np.where(np.isnan(electrical), shaft, electrical)
        / (STANDARD_GRAVITY * (batch.body_mass + batch.tail_density * wire) * np.abs(speed)),
        "reynolds_number": body_reynolds(batch, speed),
        "tail_reynolds_number": tail_reynolds(batch, tail_rate),
        "battery_run_time": lasting,
    }
    # A motor driven beyond any root of (17), or a friction inferred at rest, is no answer either.
    moving = valid & np.isfinite(speed) & ~np.isinf(effective)
    if motor is not None and batch.drive == "dc-motor" and batch.joint == "revolute":
        moving = moving & np.isfinite(current)
    reynolds = {name: values.pop(name) for name in ("reynolds_number", "tail_reynolds_number")}
    shaped = {name: np.where(moving, value, np.nan) for name, value in reynolds.items()}  # why a motion is refused
    moving = moving & is_stokes_flow(batch, reynolds_limits(batch, *shaped.values()))
    shaped |= {name: np.where(moving, value, np.nan) for name, value in values.items()}
    columns = {**shaped, "valid": moving}
    arrays: dict[str, Any] = {name: np.array(np.broadcast_to(value, (batch.size,))) for name, value in columns.items()}
    return Swimming(**arrays)


_SMOOTH = 1e-4
"""v_r over the sliding speed of a body that turns as fast as its tail, as in a run with six degrees of freedom."""
_ROUNDS = 60
_SETTLED = 1e-12
_WHOLE = (0, 1, 3)
"""Indices of U, Omega and omega in the axial form of both parts, where the force on the whole belongs to the body."""


def weights_in_fluid(robots: Sequence[Robot]) -> PerRobot:
    """Weight less buoyancy of whole robots, N; NaN where a mass is not known."""
    return np.array(
        [
            STANDARD_GRAVITY * sum(link.mass - robot.fluid.density * link.volume for link in links_of(robot))
            for robot in robots
        ]
    )


def with_dry_friction(r: AxialWhole, force: Values, radius: Values, tail_rate: Values) -> Samples:
    """R of whole robots, (..., 3, 3), with dry friction mu_c N at the sliding speed that the tail's rate gives."""
    shape = np.broadcast_shapes(r.shape[:-2], *(np.shape(item) for item in (force, radius, tail_rate)))
    full = np.broadcast_to(r, (*shape, 3, 3)).reshape(-1, 3, 3)
    pressed, radii, rates = (np.broadcast_to(item, shape).ravel() for item in (force, radius, tail_rate))
    drag = np.empty(len(full))
    contact_drag(full, pressed, radii, rates, _SMOOTH, drag)
    k, two = drag.reshape(shape), np.full(1, 2.0)
    return with_body_factors(r, (two, two), (k, k * np.asarray(radius) ** 2))


class KnownResistance(SwimmerModel):
    """A model whose resistances along the axis are known beforehand, for each robot of a batch."""

    parts = ()

    def __init__(
        self, model: SwimmerModel, whole: AxialWhole, load: AxialLoad | None = None, flow: MeanFlow | None = None
    ) -> None:
        """Answer with resistances of whole robots; `model` answers all else."""
        self.name = model.name
        self.placed = model.placed  # type: ignore[misc]
        resistance = np.zeros((*whole.shape[:-2], 4, 4))
        resistance[..., np.array(_WHOLE)[:, None], _WHOLE] = whole
        self.model, self._known = model, AxialFlow(resistance, np.zeros((1, 4)) if load is None else load, flow)

    def domain(self, batch: RobotBatch) -> list[Limit]:
        """See `ResistanceModel.domain`."""
        return self.model.domain(batch)

    def axial(self, batch: RobotBatch) -> Axial:  # noqa: ARG002 - one interface for all models
        """See `SwimmerModel.axial`."""
        return self._known.resistance

    def axial_flow(self, batch: RobotBatch) -> AxialFlow:  # noqa: ARG002 - as above
        """See `SwimmerModel.axial_flow`."""
        return self._known

    def resistance(self, batch: RobotBatch, phase: PerRobot) -> Any:
        """See `SwimmerModel.resistance`."""
        return self.model.resistance(batch, phase)

    def part_matrix(self, batch: RobotBatch, part: str, phase: PerRobot) -> Any:
        """See `ResistanceModel.part_matrix`."""
        return self.model.part_matrix(batch, part, phase)


def swim_on_floor(
    batch: RobotBatch, model: SwimmerModel, robots: Sequence[Robot], coefficient: Values | float | None, **asked: Any
) -> Swimming:
    """Steady swimming with dry friction, which dissipates too, under the whole weight; free, or without, as `swim`."""
    mu = np.zeros(1) if coefficient is None else np.atleast_1d(np.asarray(coefficient, dtype=float))
    free = swim(batch, model, **asked)
    if not np.any(mu > 0) or asked.get("motion") == "free":
        return free
    weight = weights_in_fluid(robots)
    if batch.joint == "fixed" or not np.all(weight > 0):
        why = "drive.joint = 'fixed'" if batch.joint == "fixed" else "a robot that has no weight in the fluid"
        raise InputError(f"friction_coefficient = {mu[0]:.3g} with {why}; allowed: 0, or a revolute joint and a weight")
    without = model.axial_flow(batch)
    whole = joined(without.resistance)
    rate, found = free.tail_rotation_rate, free
    for _ in range(_ROUNDS):
        rubbed = with_dry_friction(whole, mu * weight, 0.5 * batch.body_diameter, np.nan_to_num(rate))
        found = swim(batch, KnownResistance(model, rubbed, without.load, without.mean_flow), **asked)
        before, rate = rate, found.tail_rotation_rate
        if not np.any(np.abs(rate - before) > _SETTLED * np.abs(rate)):
            break
    return found
