"""Axial swimming in time: a batch of one robot from rest, sampled, with the energies of its motor (17)."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.dynamics.averages import STEADY, run_averages, stretches_on
from spirillum.dynamics.axial_robot import AxialRobot, outputs
from spirillum.dynamics.record import run_attributes
from spirillum.dynamics.timing import Switch, Timing
from spirillum.errors import InputError
from spirillum.kernels import axial_motor as kernel
from spirillum.notes import note_attributes
from spirillum.quantities import attributes
from spirillum.robot.batch import Electrics
from spirillum.swimming.motor import winding_resistance
from spirillum.swimming.prediction import Prediction
from spirillum.swimming.reynolds import check_stokes_flow, motion_limits
from spirillum.units import show

if TYPE_CHECKING:
    import xarray as xr

_SOURCE = "motor current (17) and the robot's linear response (8), (15)"
_FINENESS = 16.0
"""Pieces of a step over those of a batch: errors of 1e-9 however far apart the samples are."""


class AxialIntegrator(NamedTuple):
    """A method that integrates (17) and what rests on the current."""

    name: str
    """Method, order and tolerance in words."""
    states: Callable[[AxialRobot, Samples, Samples], Samples]
    """States from rest, (n, 7), at times, s, (n,), among them every switching, with the duty up to each, (n,)."""


def _advanced(robot: AxialRobot, time: Samples, duty: Samples) -> Samples:
    """States at times, (n, 7): a batch of one, from sample to sample."""
    numbers, still = robot.numbers[None], np.zeros(1)
    states = np.zeros((time.size, kernel.STATES))
    if robot.curve is not None:  # its torque is there at once
        states[:1, kernel.CURRENT] = robot.steady_current(robot.numbers, float(duty[0]), 0.0)
    for n in range(1, time.size):
        states[n] = states[n - 1]
        robot.advance(numbers, states[n : n + 1], time[n] - time[n - 1], duty[n : n + 1], still, _FINENESS)
    return states


RUNGE_KUTTA = AxialIntegrator("Runge-Kutta, order 4; exact from where the current is steady", _advanced)
"""The integrator of batches."""


def axial_run(prediction: Prediction, timing: Timing, integrator: AxialIntegrator = RUNGE_KUTTA) -> xr.Dataset:
    """Axial swimming (two degrees of freedom) from rest.

    Returns:
        Dataset over `time` with position, angles, rates, current, torques, powers, energies and efficiency;
        averages over the last two thirds of the run, while on and while steady as scalars; settings in the attributes.
    """
    batch, robot = prediction.batch, AxialRobot.of(prediction)
    if prediction.tail_rotation_rate == 0:
        raise InputError("drive.duty = 0: the tail does not turn; allowed: more than 0, and `on` for switching off")
    turn = 2.0 * np.pi / abs(prediction.tail_rotation_rate)
    end, time, switches, unused = timing.timetable(turn, robot.duty)
    if robot.flow:
        raise InputError(
            f"placement.flow = {show(robot.flow, 'mm/s')}: a run in time starts from rest; allowed: no flow, or "
            "`predict` for the steady motion"
        )
    moments = np.union1d(time, [switch.time for switch in switches])
    begun = np.searchsorted([switch.time for switch in switches], moments, side="left")
    duty = np.array([switch.duty for switch in switches])[np.maximum(begun - 1, 0)]
    dataset = _dataset(robot, moments, duty, integrator.states(robot, moments, duty))
    events = [{"time": switch.time, "what": f"duty {switch.duty:g}"} for switch in switches]
    limits = motion_limits(batch, dataset["forward_velocity"].values, dataset["tail_rotation_rate"].values)
    said = [*prediction.warnings, *unused, *check_stokes_flow(batch, limits).values()]
    found = dataset.isel(time=np.isin(moments, time)).assign(_averages(dataset, prediction, switches, end))
    return found.assign_attrs(
        events=json.dumps(events),
        switches=", ".join(f"duty {duty:g} from {start:g} s" for start, duty in switches),
        integrator=integrator.name,
        **note_attributes(said),
    )


def _dataset(robot: AxialRobot, time: Samples, duty: Samples, states: Samples) -> xr.Dataset:
    import xarray as xr

    steady, p = robot.prediction, robot.numbers
    found = outputs(p, states.T, duty, 0.0)
    series = {name: found[place] for name, place in robot.outputs.items()}
    motor = steady.batch.electrics if robot.curve is None else None
    series |= {"duty": duty, **_electrics(motor, p, duty, states)}
    # Without inertia torques are in proportion to the current, and powers to its square.
    whole = steady.motor_current if robot.curve is None else steady.drive_torque
    share, square = states[:, kernel.CURRENT] / whole, states[:, kernel.SQUARE] / whole**2
    series |= {
        "tail_torque": steady.tail_torque * np.abs(share),
        "shaft_power": steady.shaft_power * share**2,
        "friction_power": steady.friction_power * share**2,
        "dissipated_power": steady.dissipated_power * share**2,
        "friction_energy": steady.friction_power * square,
        "dissipated_energy": steady.dissipated_power * square,
    }
    meanings = {"position": "distance swum along x"}
    data = {
        name: ("time", values, attributes(name, meaning=meanings.get(name), source=_SOURCE))
        for name, values in series.items()
    }
    return xr.Dataset(
        data,
        coords={"time": ("time", time, attributes("time"))},
        attrs={
            "title": f"Axial swimming of {steady.robot.name} (two degrees of freedom)",
            **run_attributes(steady),
            "motion": "held",
            "placement": json.dumps(steady.placement),
            "steady": STEADY,
        },
    )


def _electrics(motor: Electrics | None, p: Samples, duty: Samples, states: Samples) -> dict[str, Samples]:
    """Resistance and energies of a DC-motor, from the battery to the winding, by name."""
    if motor is None:
        return {}
    current, square, slip = states[:, kernel.CURRENT], states[:, kernel.SQUARE], p[kernel.TAIL] - p[kernel.BODY]
    drawn = np.cumsum(duty * np.diff(square, prepend=0.0))  # the current drives in its own sense throughout
    return {
        "motor_resistance": winding_resistance(motor, np.abs(current)),
        "electrical_energy": p[kernel.VOLTAGE] * states[:, kernel.CHARGE] - p[kernel.INTERNAL] * drawn,
        "resistive_energy": states[:, kernel.HEAT],
        "magnetic_energy": 0.5 * p[kernel.INDUCTANCE] * current**2,
        "conversion_energy": (p[kernel.EMF] - p[kernel.TORQUE]) * slip * p[kernel.TORQUE] * square,
    }


def _averages(
    dataset: xr.Dataset, prediction: Prediction, switches: Sequence[Switch], end: float
) -> dict[str, tuple[Any, ...]]:
    """Averages of the run, and its efficiency."""
    integrals = {
        "mean_forward_velocity": ("position", "m/s"),
        "mean_tail_rotation_rate": ("tail_angle", "rad/s"),
        "mean_body_rotation_rate": ("body_angle", "rad/s"),
        "mean_electrical_power": ("electrical_energy", "W"),
    }
    found = run_averages(
        dataset["time"].values,
        {name: (dataset[of].values, unit) for name, (of, unit) in integrals.items() if of in dataset},
        stretches_on(switches, end),
        by_turn=False,
    )
    found["hydrodynamic_efficiency"] = (
        (),
        prediction.hydrodynamic_efficiency,
        attributes("hydrodynamic_efficiency", source="eq. (16) of BioRob 2012; constant in time"),
    )
    return found
