"""A run as a labelled dataset: path, attitude, rates, powers, energies, what happened, and its attributes."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from spirillum.arrays import Samples
from spirillum.dynamics.free_robot import FreeRobot
from spirillum.dynamics.integration import BATTERY_EMPTY, Reach, Trajectory
from spirillum.dynamics.run_file import rotation_matrix
from spirillum.dynamics.run_summary import STEADY, run_averages, stretches_on
from spirillum.dynamics.timing import Switch
from spirillum.kernels import core
from spirillum.notes import Note, note_attributes
from spirillum.quantities import attributes
from spirillum.swimming.balance import battery_voltage, winding_resistance
from spirillum.swimming.prediction import Prediction
from spirillum.version import versions

if TYPE_CHECKING:
    import xarray as xr


_AXES, _QUATERNION = ("x", "y", "z"), ("w", "x", "y", "z")
_MOMENT = slice(core.DRIVE_MOMENT, core.DRIVE_FIELD)


_SOURCE = "two rigid links, (15) with all rows"
_X = np.array([1.0, 0.0, 0.0])
_MEANINGS = {"wobble_angle": "angle between the motor axis and the axis about which the field turns"}
"""Meanings of quantities that a run in time defines otherwise than steady motion does."""


def dataset_of(
    prediction: Prediction,
    links: FreeRobot,
    run: Trajectory,
    switches: Sequence[Switch],
    more: Mapping[str, Samples],
    attrs: Mapping[str, Any],
) -> xr.Dataset:
    """The run of a free robot."""
    import xarray as xr

    driven = min((event.time for event in run.events if event.what == BATTERY_EMPTY), default=float(run.time[-1]))
    on = stretches_on(switches, driven, float(run.time[0]))
    rotation = _rotations(run.states)
    series = {**series_of(prediction, links, run), **more}
    weight, phase = links.weight, run.states[:, core.STATE_PHASE]
    cos, sin = np.cos(phase), np.sin(phase)
    x, y, z = weight[core.WEIGHT_MOMENT_ROTOR :]
    rotor = np.stack([np.full_like(phase, x), cos * y - sin * z, sin * y + cos * z], axis=-1)
    lift = np.einsum("nj,nj->n", rotation[:, 2, :], weight[core.WEIGHT_MOMENT_BODY : core.WEIGHT_MOMENT_ROTOR] + rotor)
    heavy = weight[core.WEIGHT_BODY] + weight[core.WEIGHT_ROTOR]
    stored = np.asarray(heavy * run.states[:, core.STATE_POSITION + 2] + lift) + run.observed[:, core.SEEN_PRESSED]
    series["potential_energy"] = stored
    attitude = run.states[:, core.STATE_ATTITUDE : core.STATE_ATTITUDE + 4]
    attitude = attitude / np.linalg.norm(attitude, axis=1, keepdims=True)
    velocity = np.einsum("nij,nj->ni", rotation, run.observed[:, : core.SPIN])
    spin = np.einsum("nij,nj->ni", rotation, run.observed[:, core.SPIN : core.JOINT])
    vectors = {
        "position": ("axis", run.states[:, : core.STATE_ATTITUDE]),
        "velocity": ("axis", velocity),
        "angular_velocity": ("axis", spin),
        "attitude": ("quaternion", attitude),
    }
    data: dict[str, Any] = {
        name: (("time", along), values, attributes(name, source=_SOURCE)) for name, (along, values) in vectors.items()
    }
    data |= {
        name: ("time", values, attributes(name, meaning=_MEANINGS.get(name), source=_SOURCE))
        for name, values in series.items()
    }
    dataset = xr.Dataset(
        data,
        coords={
            "time": ("time", run.time, attributes("time")),
            "axis": ("axis", list(_AXES), {"long_name": "axis of the lab"}),
            "quaternion": ("quaternion", list(_QUATERNION), {"long_name": "part of the quaternion"}),
        },
        attrs=dict(attrs),
    )
    integrals = {
        "mean_forward_velocity": (dataset["position"].values[:, 0], "m/s"),
        "mean_tail_rotation_rate": (dataset["tail_angle"].values, "rad/s"),
        "mean_body_rotation_rate": (dataset["body_angle"].values, "rad/s"),
        "mean_drive_power": (dataset["drive_energy"].values, "W"),
    }
    if "electrical_energy" in dataset:
        integrals["mean_electrical_power"] = (dataset["electrical_energy"].values, "W")
    return dataset.assign(run_averages(dataset["time"].values, integrals, on, by_turn=True))


def series_of(prediction: Prediction, links: FreeRobot, run: Trajectory) -> dict[str, Samples]:
    """Angles, rates, torques, powers and energies of a free robot's run by name, each (n,); SI."""
    rotation = _rotations(run.states)
    found = {**_motion(run, rotation), **_powers(links, run, rotation)}
    if prediction.batch.drive == "dc-motor":
        found |= _electrics(prediction, run)
    if prediction.batch.drive == "magnetic":
        moment, rate = _in_field(links, rotation @ links.drive[_MOMENT]), links.drive[core.DRIVE_FIELD_RATE]
        field = 0.5 * np.pi + _field_angle(links, run)
        behind = np.unwrap(field - np.arctan2(moment[:, 2], moment[:, 1])) * np.sign(rate)
        behind -= 2.0 * np.pi * np.round(behind[0] / (2.0 * np.pi))
        found["phase_lag"] = np.where(run.duty > 0, behind, np.nan)
        along = np.abs(_in_field(links, rotation[:, :, 0])[:, 0])
        found["wobble_angle"] = np.arccos(np.clip(along, 0.0, 1.0))
    return found


def free_attributes(
    prediction: Prediction, links: FreeRobot, run: Trajectory, reach: Reach, title: str, notes: Sequence[Note]
) -> dict[str, Any]:
    """Attributes of a free robot's run."""
    return {
        "title": title,
        **run_attributes(prediction),
        "motion": "free",
        "steady": STEADY,
        "channel_middle": reach.middle,
        "events": json.dumps([{"time": event.time, "what": event.what} for event in run.events]),
        "integrator": links.integrator(),
        **note_attributes(notes),
    }


def _rotations(states: Samples) -> Samples:
    """Rotation matrices, body axes to lab, (n, 3, 3)."""
    return rotation_matrix(states[:, core.STATE_ATTITUDE : core.STATE_ATTITUDE + 4])


def tail_angle_of(states: Samples, begun: float) -> Samples:
    """Angle of the tail in the lab, rad, (n,), from the phase at the start of the run, rad."""
    return np.asarray(states[:, core.STATE_ROLL] + states[:, core.STATE_PHASE] - begun)


def _motion(run: Trajectory, rotation: Samples) -> dict[str, Samples]:
    rates, states = run.observed, run.states
    axis = rotation[:, :, 0]
    roll, phase = states[:, core.STATE_ROLL], states[:, core.STATE_PHASE]
    body_rate, motor_rate = rates[:, core.SPIN], rates[:, core.JOINT]
    return {
        "tail_phase": phase,
        "tail_angle": tail_angle_of(states, float(phase[0])),
        "body_angle": roll,
        "forward_velocity": np.sum(rotation[:, 0, :] * rates[:, : core.SPIN], axis=1),
        "tail_rotation_rate": body_rate + motor_rate,
        "body_rotation_rate": body_rate,
        "motor_rotation_rate": motor_rate,
        "pitch": np.arcsin(np.clip(axis[:, 2], -1.0, 1.0)),
        "yaw": np.arctan2(axis[:, 1], axis[:, 0]),
        "duty": run.duty,
    }


def _powers(links: FreeRobot, run: Trajectory, rotation: Samples) -> dict[str, Samples]:
    rates, states = run.observed, run.states
    drive, motor_rate = rates[:, core.SEEN_DRIVE_TORQUE], rates[:, core.JOINT]
    if links.drive[core.DRIVE_FIXED]:  # one piece, driven from outside
        torque = drive + _field_torque(links, run, rotation)
        shaft = rates[:, core.SEEN_DRIVE_POWER]
    else:  # what is left of the motor's torque after friction in the joint
        against_body, against_motor = links.friction[core.JOINT, [core.SPIN, core.JOINT]]
        torque = drive - against_body * rates[:, core.SPIN] - against_motor * motor_rate
        shaft = torque * motor_rate
    return {
        "drive_torque": torque,
        "drive_power": rates[:, core.SEEN_DRIVE_POWER],
        "shaft_power": shaft,
        "friction_power": rates[:, core.SEEN_FRICTION_POWER],
        "dissipated_power": rates[:, core.SEEN_DISSIPATED_POWER],
        "drive_energy": states[:, core.STATE_DRIVEN],
        "friction_energy": states[:, core.STATE_FRICTION],
        "dissipated_energy": states[:, core.STATE_DISSIPATED],
    }


def _field_torque(links: FreeRobot, run: Trajectory, rotation: Samples) -> Samples:
    """Torque of the field about its own axis, N m; zero without one."""
    moment, angle = _in_field(links, rotation @ links.drive[_MOMENT]), _field_angle(links, run)
    if links.drive[core.DRIVE_KIND] != core.MAGNETIC:
        return np.zeros_like(angle)
    field = links.drive[core.DRIVE_FIELD] * np.stack([-np.sin(angle), np.cos(angle)], axis=-1)
    return np.asarray((run.duty > 0) * (moment[:, 1] * field[:, 1] - moment[:, 2] * field[:, 0]))


def _field_angle(links: FreeRobot, run: Trajectory) -> Samples:
    """Angle by which the field has turned since it pointed up, rad."""
    return np.asarray(links.drive[core.DRIVE_FIELD_RATE] * run.time + links.drive[core.DRIVE_FIELD_PHASE])


def _in_field(links: FreeRobot, vectors: Samples) -> Samples:
    """Vectors of the lab along the axis about which the field turns, and across it as y and z are to x, (n, 3)."""
    side, up = links.drive[core.DRIVE_AXIS_Y : core.DRIVE_FIELD_PHASE]
    axis = np.array([np.sqrt(1.0 - side**2 - up**2), side, up])
    across = [e - axis @ e * (axis + _X) / (1.0 + axis[0]) for e in np.eye(3)[1:]]
    return np.asarray(vectors @ np.array([axis, *across]).T)


def _electrics(prediction: Prediction, run: Trajectory) -> dict[str, Samples]:
    motor = prediction.batch.electrics
    assert motor is not None  # noqa: S101 - a dc-motor has one
    sign, inductance = float(motor.polarity[0]), float(motor.inductance[0])
    states = run.states
    current = states[:, core.STATE_CURRENT]
    voltage = battery_voltage(motor, current)
    return {
        "motor_torque": run.observed[:, core.SEEN_DRIVE_TORQUE],
        "motor_current": sign * current,
        "motor_resistance": winding_resistance(motor, current),
        "battery_voltage": voltage,
        "electrical_power": run.duty * voltage * current,
        "electrical_energy": states[:, core.STATE_ELECTRICAL],
        "resistive_energy": states[:, core.STATE_RESISTIVE],
        "magnetic_energy": 0.5 * inductance * current**2,
        "conversion_energy": states[:, core.STATE_CONVERSION],
        "battery_charge_used": states[:, core.STATE_CHARGE],
    }


def run_attributes(prediction: Prediction) -> dict[str, Any]:
    """Robot, model, friction, calibration, errors, settings, references and versions of a run."""
    return {
        "robot": prediction.robot.name,
        "model": prediction.model.name,
        "friction": prediction.friction,
        "effective_friction": prediction.effective_friction,
        "calibrated": int(prediction.calibrated),
        **({"fitted_by": prediction.fitted_by} if prediction.fitted_by else {}),
        "error_estimate": prediction.error_estimate,
        "known_error": prediction.known_error,
        **({} if prediction.model.error_against is None else {"error_against": prediction.model.error_against}),
        "settings": json.dumps(prediction.robot.model_dump(), sort_keys=True),
        "references": " ".join(prediction.references),
        "versions": versions(),
    }
