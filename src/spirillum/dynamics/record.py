"""A free run as a labelled dataset: path, attitude, rates, powers, energies, and what happened."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from spirillum.answer import versions
from spirillum.arrays import Samples
from spirillum.dynamics.integration import INTEGRATOR, Reach, Trajectory
from spirillum.dynamics.sampling import late_averages
from spirillum.dynamics.two_links import TwoLinks
from spirillum.kernels import two_links as kernel
from spirillum.swimming.motor import battery_voltage, winding_resistance
from spirillum.swimming.prediction import Prediction

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["dataset_of"]

_AXES, _QUATERNION = ("x", "y", "z"), ("w", "x", "y", "z")


class _Series(NamedTuple):
    """A variable of the dataset."""

    values: Samples
    unit: str
    meaning: str
    source: str = "two rigid links, (15) with all rows"


def dataset_of(
    prediction: Prediction, links: TwoLinks, run: Trajectory, reach: Reach, title: str, warnings: tuple[str, ...]
) -> xr.Dataset:
    """The run of a free robot.

    Args:
        prediction: the robot with model, friction and calibration.
        links: its two links.
        run: its motion.
        reach: its channel.
        title: title of the dataset.
        warnings: what to be careful about, a sentence each.
    """
    import xarray as xr

    rotation = _rotations(run.states)
    series = {**_motion(run, rotation), **_powers(links, run, rotation)}
    if prediction.batch.drive == "dc-motor":
        series |= _electrics(prediction, run)
    if prediction.batch.drive == "magnetic":
        series |= _magnetics(links, run, rotation)
    if np.isfinite(links.wall[0]):
        gap = run.observed[:, 8] + links.wall[1]
        series["wall_gap"] = _Series(gap, "m", "smallest distance of body and tail to the channel's wall")
    stored = _potential(links, run, rotation) + run.observed[:, 12]
    series["potential_energy"] = _Series(stored, "J", "energy of weight and buoyancy, and of roughness that is pressed")
    attitude = run.states[:, kernel.ATTITUDE : kernel.ATTITUDE + 4]
    attitude = attitude / np.linalg.norm(attitude, axis=1, keepdims=True)
    velocity = np.einsum("nij,nj->ni", rotation, run.observed[:, :3])
    spin = np.einsum("nij,nj->ni", rotation, run.observed[:, 3:6])
    vectors = {
        "position": ("axis", run.states[:, :3], "m", "place of the body's mid-length; the channel's axis is y = z = 0"),
        "velocity": ("axis", velocity, "m/s", "velocity of the body's mid-length in the lab"),
        "angular_velocity": ("axis", spin, "rad/s", "rotation rate of the body in the lab"),
        "attitude": ("quaternion", attitude, "1", "unit quaternion, body axes to lab"),
    }
    data: dict[str, Any] = {
        name: (
            ("time", along),
            values,
            {"units": unit, "long_name": meaning, "source": _Series._field_defaults["source"]},
        )
        for name, (along, values, unit, meaning) in vectors.items()
    }
    data |= {
        name: ("time", s.values, {"units": s.unit, "long_name": s.meaning, "source": s.source})
        for name, s in series.items()
    }
    dataset = xr.Dataset(
        data,
        coords={
            "time": ("time", run.time, {"units": "s", "long_name": "time"}),
            "axis": ("axis", list(_AXES), {"long_name": "axis of the lab"}),
            "quaternion": ("quaternion", list(_QUATERNION), {"long_name": "part of the quaternion"}),
        },
        attrs=_attributes(prediction, run, reach, title, warnings),
    )
    return dataset.assign(_averages(dataset))


def _attributes(
    prediction: Prediction, run: Trajectory, reach: Reach, title: str, warnings: tuple[str, ...]
) -> dict[str, Any]:
    return {
        "title": title,
        "robot": prediction.robot.name,
        "model": prediction.model.name,
        "friction": prediction.friction,
        "effective_friction": prediction.effective_friction,
        "calibrated": int(prediction.calibrated),
        "error_estimate": prediction.error_estimate,
        "known_error": prediction.model.stated_error(prediction.robot.model),
        "motion": "free",
        "channel_middle": reach.middle,
        "events": json.dumps([{"time": event.time, "what": event.what} for event in run.events]),
        "settings": json.dumps(prediction.robot.model_dump(), sort_keys=True),
        "integrator": INTEGRATOR,
        "references": " ".join(prediction.references),
        "warnings": "\n".join(warnings),
        "versions": versions(),
    }


def _rotations(states: Samples) -> Samples:
    """Rotation matrices, body axes to lab, (n, 3, 3)."""
    from scipy.spatial.transform import Rotation

    attitude = states[:, kernel.ATTITUDE : kernel.ATTITUDE + 4]
    return np.asarray(Rotation.from_quat(attitude, scalar_first=True).as_matrix())


def _motion(run: Trajectory, rotation: Samples) -> dict[str, _Series]:
    rates, states = run.observed, run.states
    axis = rotation[:, :, 0]
    roll, phase = states[:, kernel.ROLL], states[:, kernel.PHASE]
    return {
        "tail_phase": _Series(phase, "rad", "angle of the tail against the body: phase of the wire's equation"),
        "tail_angle": _Series(roll + phase - phase[0], "rad", "integral of the tail's rate about the motor axis"),
        "body_angle": _Series(roll, "rad", "integral of the body's rate about the motor axis"),
        "forward_velocity": _Series(
            np.sum(rotation[:, 0, :] * rates[:, :3], axis=1), "m/s", "velocity along the channel"
        ),
        "tail_rotation_rate": _Series(rates[:, 3] + rates[:, 6], "rad/s", "rate of the tail about the motor axis"),
        "body_rotation_rate": _Series(rates[:, 3], "rad/s", "rate of the body about the motor axis"),
        "motor_rotation_rate": _Series(rates[:, 6], "rad/s", "motor rate omega_m = omega - Omega_x", "(18)"),
        "pitch": _Series(np.arcsin(np.clip(axis[:, 2], -1.0, 1.0)), "rad", "angle by which the nose is raised"),
        "yaw": _Series(np.arctan2(axis[:, 1], axis[:, 0]), "rad", "angle of the motor axis to the left, towards +y"),
        "duty": _Series(run.duty, "1", "duty of the drive; 0 while the remote is off"),
    }


def _powers(links: TwoLinks, run: Trajectory, rotation: Samples) -> dict[str, _Series]:
    rates, states = run.observed, run.states
    drive = rates[:, 7]
    if links.drive[1]:  # one piece, driven from outside
        torque = drive + _field_torque(links, run, rotation)
        shaft = rates[:, 11]
    else:  # what is left of the motor's torque after friction in the joint
        torque = drive - links.friction[6, 3] * rates[:, 3] - links.friction[6, 6] * rates[:, 6]
        shaft = torque * rates[:, 6]
    return {
        "drive_torque": _Series(
            torque, "N m", "torque that turns the rotor (one piece: the robot) against the fluid", "(18)"
        ),
        "drive_power": _Series(rates[:, 11], "W", "power of the drive's torque, before friction", "(18)"),
        "shaft_power": _Series(shaft, "W", "drive torque times motor rate (one piece: power from outside)", "(18)"),
        "friction_power": _Series(rates[:, 9], "W", "power lost to friction", "(18), (19)"),
        "dissipated_power": _Series(rates[:, 10], "W", "viscous dissipation, films at the wall included", "(9)"),
        "drive_energy": _Series(states[:, kernel.DRIVEN], "J", "work of the drive's torque, before friction"),
        "friction_energy": _Series(states[:, kernel.FRICTION], "J", "energy lost to friction"),
        "dissipated_energy": _Series(states[:, kernel.DISSIPATED], "J", "energy dissipated in the fluid"),
    }


def _field_torque(links: TwoLinks, run: Trajectory, rotation: Samples) -> Samples:
    """Torque of the field about its own axis, N m; zero without one."""
    moment, angle = rotation @ links.drive[3:6], links.drive[7] * run.time
    if links.drive[0] != kernel.MAGNETIC:
        return np.zeros_like(angle)
    field = links.drive[6] * np.stack([-np.sin(angle), np.cos(angle)], axis=-1)
    return np.asarray((run.duty > 0) * (moment[:, 1] * field[:, 1] - moment[:, 2] * field[:, 0]))


def _electrics(prediction: Prediction, run: Trajectory) -> dict[str, _Series]:
    motor = prediction.batch.electrics
    assert motor is not None  # noqa: S101 - a dc-motor has one
    sign, inductance = float(motor.polarity[0]), float(motor.inductance[0])
    states = run.states
    current = states[:, kernel.CURRENT]
    voltage = battery_voltage(motor, current)
    return {
        "motor_torque": _Series(run.observed[:, 7], "N m", "motor torque K_m I, before friction", "(18)"),
        "motor_current": _Series(sign * current, "A", "motor current I", "(17)"),
        "motor_resistance": _Series(
            winding_resistance(motor, current), "ohm", "equivalent resistance R(I)", "Table II"
        ),
        "battery_voltage": _Series(voltage, "V", "battery voltage V(I)", "Table II"),
        "electrical_power": _Series(run.duty * voltage * current, "W", "electrical power at the battery's terminals"),
        "electrical_energy": _Series(states[:, kernel.ELECTRICAL], "J", "energy from the battery's terminals"),
        "resistive_energy": _Series(states[:, kernel.RESISTIVE], "J", "energy lost in R(I)", "(17)"),
        "magnetic_energy": _Series(0.5 * inductance * current**2, "J", "energy L I^2/2", "(17)"),
        "conversion_energy": _Series(
            states[:, kernel.CONVERSION],
            "J",
            "unmodelled conversion loss: integral of (K_b - K_m) omega_m I",
            "(17), (18)",
        ),
        "battery_charge_used": _Series(states[:, kernel.CHARGE], "C", "charge drawn from the battery"),
    }


def _magnetics(links: TwoLinks, run: Trajectory, rotation: Samples) -> dict[str, _Series]:
    """Where the moment and the robot's axis point against the field."""
    moment = rotation @ links.drive[3:6]
    field = 0.5 * np.pi + links.drive[7] * run.time
    behind = np.unwrap(field - np.arctan2(moment[:, 2], moment[:, 1])) * np.sign(links.drive[7])
    behind -= 2.0 * np.pi * np.round(behind[0] / (2.0 * np.pi))
    behind = np.where(run.duty > 0, behind, np.nan)
    return {
        "phase_lag": _Series(
            behind, "rad", "angle of the moment behind the turning field, slips counted; NaN while it is off", "m x B"
        ),
        "wobble_angle": _Series(
            np.arccos(np.clip(np.abs(rotation[:, 0, 0]), 0.0, 1.0)),
            "rad",
            "angle between the motor axis and the axis about which the field turns",
        ),
    }


def _potential(links: TwoLinks, run: Trajectory, rotation: Samples) -> Samples:
    """Energy of weight less buoyancy above the state at y = z = 0 and level, J."""
    weight, phase = links.weight, run.states[:, kernel.PHASE]
    cos, sin = np.cos(phase), np.sin(phase)
    rotor = np.stack(
        [np.full_like(phase, weight[5]), cos * weight[6] - sin * weight[7], sin * weight[6] + cos * weight[7]], axis=-1
    )
    lift = np.einsum("nj,nj->n", rotation[:, 2, :], weight[2:5] + rotor)
    return np.asarray((weight[0] + weight[1]) * run.states[:, 2] + lift)


def _averages(dataset: xr.Dataset) -> dict[str, Any]:
    """Averages over the last two thirds of the run."""
    integrals = {
        "mean_forward_velocity": (dataset["position"].values[:, 0], "m/s"),
        "mean_tail_rotation_rate": (dataset["tail_angle"].values, "rad/s"),
        "mean_body_rotation_rate": (dataset["body_angle"].values, "rad/s"),
        "mean_drive_power": (dataset["drive_energy"].values, "W"),
    }
    if "electrical_energy" in dataset:
        integrals["mean_electrical_power"] = (dataset["electrical_energy"].values, "W")
    return late_averages(dataset["time"].values, integrals)
