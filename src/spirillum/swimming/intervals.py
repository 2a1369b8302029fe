"""Swimming with what a calibration does not know: a posterior's draws, each swum, and the intervals over them.

A posterior file (`posterior.nc` of `spirillum calibrate`) holds draws of fitted parameters and of the model's
discrepancy, its relative misfit from tail to tail. Every draw is a robot of its own; a batch of them swims at once. The
discrepancy then goes onto speed and rates, independently for each draw, for a tail that was not observed may be missed
by as much as those that were.
Torques, currents, powers and efficiencies are computed from the rates and speeds that it leaves. An interval is of the
robot's own motion, not of a single measured trial.

A calibration describes the mean y over the trials of a robot by y = f (1 + tau d) + e with the prediction f, d ~
N(0, 1) for each robot, and the error e of the mean. Of a tail that was not observed nothing is known of d but that. Of
one that was observed, its mean tells d: given f, tau and the size of e, d is a normal number again (Gaussian
conditioning), as well known as the mean itself.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Literal, cast, get_args

import numpy as np

from spirillum.arrays import Samples
from spirillum.errors import InputError, check_choice
from spirillum.fitted.posterior_file import ObservedTail, PosteriorFile
from spirillum.fluid.model import SwimmerModel
from spirillum.fluid.tube.library import TabledTube, tabled
from spirillum.robot.batch import CalibrationFactors, RobotBatch
from spirillum.robot.placement import Placement
from spirillum.robot.robot import Robot, without_reynolds_bound
from spirillum.swimming.balance import (
    battery_voltage,
    current_at,
    find_friction_model,
    friction_torques,
    run_time,
    steady_current,
)
from spirillum.swimming.motions import LEVEL, Intervals, Swimming
from spirillum.swimming.sampled_resistance import AxialTable, TubeResistance, chebyshev_points
from spirillum.swimming.steady import KnownResistance, swim_on_floor

PosteriorFor = Literal["new", "measured"]
"""Whose discrepancy an interval holds: of a tail like those that were fitted, or of a fitted one."""


def posterior_for_of(name: str, posterior: PosteriorFile | None, robot: Robot) -> PosteriorFor:
    """The robot whose discrepancy is requested, `new` or `measured`."""
    check_choice("for", name, get_args(PosteriorFor))
    if name == "measured":
        if posterior is None:
            raise InputError("for = 'measured' without a posterior; allowed: with --posterior FILE")
        if not posterior.tails:
            raise InputError(
                f"for = 'measured': {posterior.source} does not hold what was observed of each tail; allowed: 'new', "
                "or a posterior of this version of `spirillum calibrate`"
            )
        if posterior.measured(robot) is None:
            raise InputError(
                f"for = 'measured': {robot.name} with its body, channel and tail is none of the "
                f"{len(posterior.tails)} robots of {posterior.observations}; allowed: 'new', or one of these"
            )
    return cast("PosteriorFor", name)


OF_TORQUE = (
    "tail_torque",
    "drive_torque",
    "effective_friction",
    "motor_residual_torque",
    "shaft_power",
    "friction_power",
    "dissipated_power",
    "hydrodynamic_efficiency",
)
"""Quantities that the torque of the model decides."""
_ELECTRIC = ("torque_constant", "back_emf_constant")
_WIRE_POINTS = 7


def intervals_of(
    robot: Robot,
    model: SwimmerModel,
    posterior: PosteriorFile,
    *,
    tail_rate: float | None,
    friction: str,
    posterior_for: PosteriorFor = "new",
    placement: Placement | None = None,
) -> Intervals:
    """Swim every draw of a posterior and take the limits of 95 % intervals; a stated gap or pitch is not sampled."""
    rng = np.random.default_rng(1)
    draws = posterior.of(robot, rng)
    size = posterior.count
    batch, drawn = _sampled_model(without_reynolds_bound(robot), model, posterior, draws, placement or Placement())
    rates = None if tail_rate is None else np.full(size, tail_rate)
    coefficient = draws.get("friction_coefficient") if model.placed else None
    swum = swim_on_floor(batch, drawn, [robot], coefficient, tail_rate=rates, friction=friction)
    return intervals_over(
        swum, batch, posterior, robot, rng, own_drive=tail_rate is None, friction=friction, posterior_for=posterior_for
    )


def intervals_over(
    swum: Swimming,
    batch: RobotBatch,
    posterior: PosteriorFile,
    robot: Robot,
    rng: np.random.Generator,
    *,
    own_drive: bool,
    friction: str,
    posterior_for: PosteriorFor,
) -> Intervals:
    """Limits of 95 % intervals over the motions of draws, with the model's discrepancy."""
    predicted = {
        "advance": swum.advance_per_radian,
        "turning": swum.body_rotation_rate / swum.tail_rotation_rate,
        "motor_rate": swum.motor_rotation_rate,
    }
    tail = posterior.measured(robot) if posterior_for == "measured" else None
    off = sampled_discrepancy(posterior, predicted, rng, tail)
    values = _with_discrepancy(swum, batch, off, own_drive=own_drive, friction=friction, observed=tail is not None)
    ends = [0.5 - 0.5 * LEVEL, 0.5 + 0.5 * LEVEL, 0.5]
    limits = {name: np.quantile(column[np.isfinite(column)], ends) for name, column in values.items() if _known(column)}
    nan = float("nan")
    low, high, middle = (
        {name: float(limits[name][place]) if name in limits else nan for name in values} for place in range(3)
    )
    return Intervals(low, high, middle)


def knows_torque(robot: Robot, model: SwimmerModel) -> bool:
    """Whether the discrepancy of a model's torque is known: not where it leaves the walls of a robot's tube out."""
    # Observations are of speeds and rates. What walls do to the torque moves none of them, for B_eff takes it up.
    return model.placed or robot.channel is None


def without_torque(found: Intervals) -> Intervals:
    """Return the intervals without those of torques and of what follows from them."""
    nan = dict.fromkeys(OF_TORQUE, float("nan"))
    return Intervals({**found.low, **nan}, {**found.high, **nan}, found.middle)


def sampled_kinematics(robot: Robot, model: SwimmerModel, posterior: PosteriorFile) -> dict[str, Samples]:
    """Advance per radian and body over tail rate of every draw, without the model's discrepancy, (draws,)."""
    draws = posterior.of(robot, np.random.default_rng(1))
    size = posterior.count
    batch, drawn = _sampled_model(without_reynolds_bound(robot), model, posterior, draws, Placement())
    coefficient = draws.get("friction_coefficient") if model.placed else None
    rate = np.full(size, robot.hand * (posterior.tail_rate or 1.0))
    swum = swim_on_floor(batch, drawn, [robot], coefficient, tail_rate=rate, friction="none")
    return {"advance": swum.advance_per_radian, "turning": swum.body_rotation_rate / swum.tail_rotation_rate}


def _known(column: Samples) -> bool:
    """Whether at least nineteen of twenty draws have an answer, and the draws differ: else nothing acts on it."""
    known = column[np.isfinite(column)]
    if known.size < LEVEL * column.size:
        return False
    return bool(np.ptp(known) > 1e-9 * np.max(np.abs(known)))


def sampled_batch(robot: Robot, model: str, draws: Mapping[str, Samples], size: int) -> RobotBatch:
    """A robot for each draw."""
    one = np.ones(size)
    columns: dict[str, np.ndarray] = {}
    own = robot.friction.effective
    columns["friction.effective"] = np.full(size, np.nan if own is None else own)
    for name, path in (
        ("wire_diameter", "tail.wire_diameter"),
        ("viscosity", "fluid.viscosity"),
        ("shared_friction", "friction.effective"),
        ("friction", "friction.effective"),
    ):
        if name in draws:
            columns[path] = draws[name]
    batch = RobotBatch.of(robot).with_values(columns)
    if batch.electrics is not None:
        motor = {name: draws[name] for name in _ELECTRIC if name in draws}
        batch = replace(batch, electrics=replace(batch.electrics, **motor))
    entry = robot.calibration.get(model)
    if entry is not None:
        factors = CalibrationFactors(
            body_drag=draws.get("body_drag", entry.body_drag * one),
            body_rotation=draws.get("body_rotation", entry.body_rotation * one),
            channel_diameter=entry.fitted_to.channel_diameter * one,
            body_diameter=entry.fitted_to.body_diameter * one,
            body_length=entry.fitted_to.body_length * one,
        )
        batch = replace(batch, calibration={model: factors})
    return batch


def _sampled_model(
    robot: Robot, model: SwimmerModel, posterior: PosteriorFile, draws: Mapping[str, Samples], placement: Placement
) -> tuple[RobotBatch, KnownResistance]:
    """A robot for each draw, and the model with their resistances."""
    batch = sampled_batch(robot, posterior.model, draws, posterior.count)
    columns = {name: values[:, None] for name, values in draws.items()}
    if not model.placed:
        return batch, KnownResistance(model, _table(robot, model, draws).whole(columns)[:, 0])
    place = posterior.placed(robot, placement)
    own = RobotBatch.of(robot, place)
    tables = model if isinstance(model, TabledTube) else tabled(own)
    if tables is None:
        raise InputError(
            f"{robot.name} has no table of its tube that is valid at its pose, which draws of {posterior.source} need; "
            "allowed: after `spirillum prepare`, or its calibration.toml as --calibration"
        )
    if placement.gap is not None or placement.eccentricity is not None:
        columns.pop("gap", None)
    if placement.pitch is not None or placement.eccentricity is not None:
        columns.pop("pitch", None)
    known = TubeResistance.of(own, tables)
    load = np.insert(known.load(columns, place.flow)[:, 0], 2, 0.0, axis=-1) if place.flow else None
    return replace(batch, placement=place), KnownResistance(tables, known.whole(columns)[:, 0], load)


def _table(robot: Robot, model: SwimmerModel, draws: Mapping[str, Samples]) -> AxialTable:
    """Resistances over what the draws change, of a model without a pose."""
    wires = None
    if "wire_diameter" in draws:
        wires = chebyshev_points(_WIRE_POINTS, float(draws["wire_diameter"].min()), float(draws["wire_diameter"].max()))
    return AxialTable.of(
        RobotBatch.of(robot), model, wires=wires, coefficients="normal_factor" in draws or "tangential_factor" in draws
    )


def _with_discrepancy(
    swum: Swimming, batch: RobotBatch, off: Mapping[str, Samples], *, own_drive: bool, friction: str, observed: bool
) -> dict[str, Samples]:
    """All quantities, (draws,), with the model's discrepancy on speed and rates, and on what follows from them."""
    values: dict[str, Samples] = swum.quantities
    one = np.ones(swum.forward_velocity.size)

    advance, turning, motor = off["advance"], off["turning"], off["motor_rate"]
    # A fixed joint turns body and tail alike, and a drive that prescribes the rate is not missed by the model.
    turning = one if batch.joint == "fixed" else turning
    pace: Samples = one
    if own_drive and batch.drive == "dc-motor":
        pace = motor * _pace_at(swum, batch, turning) if observed and batch.joint != "fixed" else motor
    tail = values["tail_rotation_rate"] * pace
    body = values["body_rotation_rate"] * turning * pace
    speed = advance * pace
    values |= {
        "forward_velocity": values["forward_velocity"] * speed,
        "advance_per_radian": values["advance_per_radian"] * advance,
        "reynolds_number": values["reynolds_number"] * np.abs(speed),
        "tail_reynolds_number": values["tail_reynolds_number"] * np.abs(pace),
        "propulsive_power": values["propulsive_power"] * speed**2,
        "tail_rotation_rate": tail,
        "body_rotation_rate": body,
        "motor_rotation_rate": tail - body,
    }
    with np.errstate(divide="ignore", invalid="ignore"):
        if batch.joint != "fixed":
            values |= _torques_and_powers(swum, values, batch, pace, own_drive=own_drive, friction=friction)
        shaft, electrical = (values[name] / getattr(swum, name) for name in ("shaft_power", "electrical_power"))
        spent = np.where(np.isnan(electrical), shaft, electrical)
        return values | {
            "hydrodynamic_efficiency": swum.hydrodynamic_efficiency * speed**2 / shaft,
            "overall_efficiency": swum.overall_efficiency * speed**2 / electrical,
            "cost_of_transport": swum.cost_of_transport * spent / np.abs(speed),
        }


def _pace_at(swum: Swimming, batch: RobotBatch, turning: Samples) -> Samples:
    """Tail rate of a motor whose body turns otherwise by a factor, over that before, (draws,)."""
    # The fluid's torque on the rotor grows with the tail's rate, what else loads the motor with that at the joint; (17)
    # with both gives the current. B_eff was inferred with the body rate that was observed: with that of a draw, which
    # the model misses, it would not give back the tail rate that was.
    motor = batch.electrics
    if motor is None:
        return np.ones_like(turning)
    tail, slip = swum.tail_rotation_rate, swum.motor_rotation_rate
    with np.errstate(divide="ignore", invalid="ignore"):
        share = 1.0 - turning * swum.body_rotation_rate / tail  # of the joint's rate in the tail's
        rest = motor.joint_torque_constant * current_at(motor, slip) - swum.drive_torque
        load = swum.drive_torque / tail / share + rest / slip
        across = motor.joint_back_emf_constant * motor.joint_torque_constant / load
        found = motor.polarity * steady_current(motor, np.zeros_like(load), across) * motor.joint_torque_constant / load
        pace = found / share / tail
    return np.where(np.isfinite(pace), pace, 1.0)


def _torques_and_powers(
    swum: Swimming, values: dict[str, Samples], batch: RobotBatch, pace: Samples, *, own_drive: bool, friction: str
) -> dict[str, Samples]:
    """Torques are linear in the rates, the current follows from (17), B_eff at a prescribed rate from (18)."""
    tail, body, slip = (values[f"{name}_rotation_rate"] for name in ("tail", "body", "motor"))
    drive = swum.drive_torque * pace
    on_body = (swum.dissipated_power - swum.drive_torque * swum.tail_rotation_rate) / swum.body_rotation_rate
    found = {
        "drive_torque": drive,
        "tail_torque": np.abs(drive),
        "shaft_power": drive * slip,
        "dissipated_power": np.where(body == 0.0, drive * tail, drive * tail + on_body * pace * body),
    }
    effective, motor = swum.effective_friction, batch.electrics
    rotor = motor.joint_rotor_friction if motor is not None else np.zeros(1)
    if motor is not None and batch.drive == "dc-motor":
        current = current_at(motor, slip)
        voltage = battery_voltage(motor, current)
        found |= {
            "motor_current": current,
            "battery_voltage": voltage,
            "electrical_power": motor.duty * motor.polarity * current * voltage,
            "battery_run_time": run_time(motor, current),
        }
        spare = motor.joint_torque_constant * current - drive
        if not own_drive and friction in ("rotor", "paper"):
            effective = spare / slip
        elif not own_drive:
            found["motor_residual_torque"] = spare - (rotor * slip if friction == "body" else 0.0)
    torques = friction_torques(find_friction_model(friction), effective, rotor)
    return found | {"effective_friction": effective, "friction_power": torques.power(body, tail)}


def sampled_discrepancy(
    posterior: PosteriorFile,
    predicted: Mapping[str, Samples],
    rng: np.random.Generator,
    tail: ObservedTail | None = None,
) -> dict[str, Samples]:
    """Factors on advance, turning and motor rate, (draws,) each, of an observed tail or (None) of another one."""
    size = next(iter(predicted.values())).size
    found = {}
    for name in ("advance", "turning", "motor_rate"):
        tau = posterior.discrepancy.get(name)
        found[name] = np.ones(size) if tau is None else 1.0 + tau * rng.normal(size=size)
    if tail is None:
        return found
    names = [name for name in found if name in tail.seen and name in posterior.discrepancy and name in predicted]
    if not names:
        return found
    values = np.stack([_compared(name, predicted, tail) for name in names])
    spread = np.stack([posterior.discrepancy[name] for name in names]) * values
    seen_of = [tail.seen[name] for name in names]
    errors = np.stack(
        [
            error_of_mean(posterior.error[name], one.stated, one.scale, one.trials)
            for name, one in zip(names, seen_of, strict=True)
        ]
    )
    noise = np.einsum("qd,rd->dqr", errors, errors) * _correlations(names, tail.correlation)
    floor = np.array([tail.floor * one.scale for one in seen_of]) ** 2
    noise = noise + np.diag(floor)
    # Matheron's rule: a draw of the prior, moved by what its own observation differs from the one that was made.
    off = values * (np.stack([found[name] for name in names]) - 1.0)
    seen = np.array([one.mean for one in seen_of])[:, None]
    error = np.einsum("dqr,rd->qd", np.linalg.cholesky(noise), rng.normal(size=off.shape))
    whole = noise + spread.T[:, :, None] ** 2 * np.eye(len(names))
    gain = spread.T[:, :, None] ** 2 * np.linalg.inv(whole)
    moved = off + np.einsum("dqr,rd->qd", gain, seen - values - off - error)
    return found | {name: 1.0 + moved[n] / values[n] for n, name in enumerate(names)}


def error_of_mean(
    error: Samples | float, stated: Samples | float, scale: Samples | float, trials: Samples | float
) -> Samples:
    """Standard error of a mean over trials, SI: that of one trial over the root of the number of trials."""
    # The scatter of trials holds the error of each measurement. A trial's error is thus the larger of both, no sum.
    return np.fmax(error, np.fmax(stated, 0.0)) * scale / np.sqrt(np.maximum(trials, 1.0))


def _compared(name: str, predicted: Mapping[str, Samples], tail: ObservedTail) -> Samples:
    """Compared quantities: the advance is over the motor's rate where no tail rate was observed."""
    if name == "advance" and tail.by_motor:
        return predicted["advance"] / (1.0 - predicted["turning"])
    return predicted[name]


def _correlations(names: Sequence[str], correlation: float) -> Samples:
    """Of the errors of advance and turning, which share their tail rate; none with the motor's rate."""
    found = np.eye(len(names))
    if "advance" in names and "turning" in names:
        a, t = names.index("advance"), names.index("turning")
        found[a, t] = found[t, a] = correlation
    return found
