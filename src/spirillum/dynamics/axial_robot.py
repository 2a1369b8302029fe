"""Axial motion: two degrees of freedom, along and about the channel's axis, with motor and battery.

Lateral motion and tilt are constrained and inertia is neglected, so speed and rates follow the motor's torque and an
imposed flow at once and linearly, and the current I (signed about +x) is the only state with dynamics of its own. With
duty d, imposed mean flow U_m, polarity p and joint torque tau = K_m I, (17) and the linear response read

    L dI/dt = p d V(|I|) - R(|I|) I - K_b (omega - Omega),
    (U, Omega, omega) = (a, b, c)_tau tau + (a, b, c)_m U_m.

A motor with a curve of torque against rate has no current: its torque replaces it, with a torque constant of 1,
and follows duty and flow at once.

Runs of `simulate`, batches, systems of python-control and FMUs all rest on these numbers and equations.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from spirillum.arrays import PerRobot, Samples
from spirillum.data_tables import rows_of
from spirillum.dynamics.record import run_attributes
from spirillum.dynamics.run_summary import STEADY, run_averages, stretches_on
from spirillum.dynamics.timing import Switch, Timing
from spirillum.errors import InputError
from spirillum.fitted.fit import read_fit
from spirillum.kernels import core
from spirillum.kernels.core import MOTOR_SIZE, steady_currents, windings
from spirillum.notes import Note, note_attributes
from spirillum.quantities import attributes
from spirillum.robot.batch import Electrics, RobotBatch
from spirillum.robot.limits import (
    body_reynolds,
    check_stokes_flow,
    flow_limit,
    motion_limits,
    reynolds_limits,
    tail_reynolds,
)
from spirillum.robot.load import load
from spirillum.robot.placement import Placement
from spirillum.robot.robot import Robot
from spirillum.swimming.balance import (
    coasting_rates,
    friction_torques,
    packed_curve,
    rates_per_torque,
    winding_resistance,
)
from spirillum.swimming.prediction import Prediction, predict_steady
from spirillum.swimming.steady import calibrated_balance
from spirillum.units import show

if TYPE_CHECKING:
    import xarray as xr


class AxialParameter(NamedTuple):
    """One number of the equations."""

    name: str  #: Field of the robot file, or quantity of the registry.
    unit: str  #: SI.
    meaning: str  #: What it is, in half a sentence.


PARAMETERS = tuple(AxialParameter(**row) for row in rows_of("dynamics/axial_parameters.csv"))
"""The numbers in the order of the compiled equations, which index them by column."""
STATES = ("motor_current", "position", "tail_angle", "body_angle", "battery_charge_used")
"""The state; quantities of the registry. The compiled equations have two integrals of the current behind it."""
INPUTS = ("duty", "mean_flow")  #: Inputs; quantities of the registry.
OUTPUTS = (
    *STATES[1:],
    "forward_velocity",
    "tail_rotation_rate",
    "body_rotation_rate",
    "motor_rotation_rate",
    "motor_current",
    "motor_torque",
    "battery_voltage",
    "electrical_power",
)
"""Outputs; quantities of the registry."""


_ELECTRIC = ("motor_current", "battery_charge_used", "battery_voltage", "electrical_power")
"""States and outputs that a motor with a curve does not have."""


@dataclass(frozen=True)
class AxialRobot:
    """The numbers of a robot in axial motion, SI; rates and current signed about +x."""

    prediction: Prediction  #: The steady motion, with robot, model and friction.
    values: tuple[float, ...]  #: Of `PARAMETERS`; those of motor and battery do not apply to a motor with a curve.

    @classmethod
    def of(cls, steady: Prediction) -> AxialRobot:
        """The robot of a prediction, in axial motion."""
        batch, motor = steady.batch, steady.batch.electrics
        if batch.curve is not None:
            own = np.zeros(core.AXIAL_SPEED)
            own[[core.AXIAL_TORQUE_CONSTANT, core.AXIAL_INDUCTANCE, core.AXIAL_POLARITY]] = (
                1.0,
                1.0,
                batch.curve.sense * batch.hand[0],
            )
        elif batch.drive == "dc-motor" and motor is not None:
            own = np.array([column[0] for column in motor.columns])
        else:
            raise InputError(f"drive.kind = '{batch.drive}' in axial motion; allowed: 'dc-motor' or 'torque-speed'")
        response = responses(steady, batch, np.array([steady.effective_friction]))[0]
        return cls(steady, (*own.tolist(), *response.tolist()))

    @property
    def robot(self) -> Robot:
        """The robot."""
        return self.prediction.robot

    @property
    def flow(self) -> float | None:
        """Mean flow that is imposed at the start, m/s; None: none is, and the equations have no such input."""
        return self.prediction.batch.placement.flow

    @property
    def duty(self) -> float:
        """The drive's own duty."""
        motor = self.prediction.batch.electrics
        return 1.0 if motor is None else float(motor.duty[0])

    @cached_property
    def numbers(self) -> Samples:
        """The numbers as an array, (18,)."""
        return np.array(self.values)

    @cached_property
    def curve(self) -> Samples | None:
        """Curve of the motor as C takes it; None for a DC-motor."""
        curve = self.prediction.batch.curve
        return None if curve is None else packed_curve(curve)

    @property
    def parameters(self) -> dict[AxialParameter, float]:
        """The numbers that its equations have."""
        first = 0 if self.curve is None else core.AXIAL_POLARITY
        return dict(list(zip(PARAMETERS, self.values, strict=True))[first:])

    @property
    def states(self) -> tuple[str, ...]:
        """Those of `STATES` that it has."""
        return STATES if self.curve is None else tuple(name for name in STATES if name not in _ELECTRIC)

    @property
    def outputs(self) -> dict[str, int]:
        """Its outputs, quantities of the registry, and their indices in `OUTPUTS`."""
        if self.curve is None:
            return {name: index for index, name in enumerate(OUTPUTS)}
        other = {"motor_torque": "drive_torque"}
        return {other.get(name, name): index for index, name in enumerate(OUTPUTS) if name not in _ELECTRIC}

    def advance(
        self, numbers: Samples, states: Samples, dt: float, duty: Samples, flow: Samples, fineness: float = 1.0
    ) -> None:
        """Take robots with its motor over a time; arguments as of `core.advance_axial`."""
        if self.curve is None:
            core.advance_axial(numbers, states, dt, duty, flow, fineness)
        else:
            core.advance_on_curve(numbers, states, dt, duty, flow, self.curve)

    def steady_current(self, numbers: Samples, duty: float, flow: float) -> float:
        """Current at which it no longer changes, A; the torque of a motor with a curve, N m."""
        if self.curve is None:
            return steady_current(numbers, duty, flow)
        found = np.zeros((1, core.AXIAL_STATE_SIZE))
        self.advance(numbers[None], found, 0.0, np.array([duty]), np.array([flow]))
        return float(found[0, core.AXIAL_STATE_CURRENT])

    def check_steady(self, duty: float, flow: float) -> list[Note]:
        """Refuse a robot far outside Stokes flow at a steady duty and flow; return a note for each exceeded limit."""
        batch, current = self.prediction.batch, self.steady_current(self.numbers, duty, flow)
        speed, tail, _ = motion(self.numbers, current, flow)
        limits = reynolds_limits(batch, body_reynolds(batch, speed), tail_reynolds(batch, tail))
        return list(check_stokes_flow(batch, [*limits, flow_limit(batch, flow)]).values())


def axial_robot(
    robot: str | Path | Mapping[str, Any] | Robot,
    *,
    calibration: str | Path | None = None,
    placement: Placement | Mapping[str, Any] | None = None,
    **asked: Any,
) -> AxialRobot:
    """A robot in axial motion, as in a held run of `simulate`; arguments as of `predict`, a `flow` is an input."""
    placed = Placement.of(placement)
    pose = placed if placed.is_set else None
    return AxialRobot.of(predict_steady(load(robot), fit=read_fit(calibration), placement=pose, band=False, **asked))


def responses(steady: Prediction, batch: RobotBatch, effective: PerRobot, viscosity: PerRobot | None = None) -> Samples:
    """(U, Omega, omega) per joint torque, then per imposed flow, of robots, (n, 6); the latter 0 without a flow."""
    pose = steady.batch.placement
    batch = batch.placed(pose if pose.flow is None else pose.model_copy(update={"flow": 1.0}))
    s = calibrated_balance(batch, steady.model, calibrated=steady.calibrated)
    if viscosity is not None:
        s = s._replace(**{name: getattr(s, name) * viscosity for name in ("bb", "br", "rb", "rr", "t_b", "t_r")})
    rotor = np.zeros(1) if batch.electrics is None else batch.electrics.joint_rotor_friction
    t = friction_torques(steady.friction, effective, rotor)
    body, tail = rates_per_torque(s, t)
    coasting_body, coasting_tail = coasting_rates(s, t)
    columns = [s._replace(u_0=np.zeros(1)).speed(body, tail), body, tail]
    columns += [s.speed(coasting_body, coasting_tail), coasting_body, coasting_tail]
    return np.stack([np.broadcast_to(column, effective.shape) for column in columns], axis=-1)


def motion(p: Samples, current: Any, flow: Any) -> Samples:
    """U, omega and Omega, (3, ...), of robots with numbers `p` (..., 18), a current, A, and an imposed flow, m/s."""
    torque = p[..., core.AXIAL_TORQUE_CONSTANT] * current
    pairs = (
        (core.AXIAL_SPEED, core.AXIAL_SPEED_FLOW),
        (core.AXIAL_TAIL, core.AXIAL_TAIL_FLOW),
        (core.AXIAL_BODY, core.AXIAL_BODY_FLOW),
    )
    return np.stack([p[..., per_torque] * torque + p[..., per_flow] * flow for per_torque, per_flow in pairs])


def outputs(p: Samples, states: Samples, duty: Any, flow: Any) -> Samples:
    """All of `OUTPUTS`, (12, ...), of robots with numbers `p` (..., 18) in states (5 or more, ...)."""
    current = states[core.AXIAL_STATE_CURRENT]
    speed, tail, body = motion(p, current, flow)
    voltage = p[..., core.AXIAL_VOLTAGE] - p[..., core.AXIAL_INTERNAL_RESISTANCE] * np.abs(current)
    power = p[..., core.AXIAL_POLARITY] * duty * voltage * current
    torque = p[..., core.AXIAL_TORQUE_CONSTANT] * current
    return np.stack([*states[1:5], speed, tail, body, tail - body, current, torque, voltage, power])


def rates(p: Samples, current: float, duty: float, flow: float) -> Samples:
    """d/dt of the state and its two integrals, (7,), by the robot's numbers, current, duty and imposed mean flow."""
    found = np.empty(core.AXIAL_STATE_SIZE)
    core.axial_rates(p, current, duty, flow, found)
    return found


def slopes(p: Samples, current: float, duty: float) -> tuple[Samples, Samples, Samples, Samples]:
    """A (5, 5), B (5, 2), C (12, 5), D (12, 2) of the equations linearised at a current and duty, in closed form."""
    size, sense, sign = abs(current), math.copysign(1.0, current), p[core.AXIAL_POLARITY]
    found = np.empty((1, 2))
    windings(p[None, :MOTOR_SIZE], np.array([current]), found)
    r, r_slope = found[0]
    emf, inductance, internal = (
        p[core.AXIAL_BACK_EMF],
        p[core.AXIAL_INDUCTANCE],
        p[core.AXIAL_INTERNAL_RESISTANCE],
    )
    voltage = p[core.AXIAL_VOLTAGE] - internal * size
    per_current, per_flow = motion(p, 1.0, 0.0), motion(p, 0.0, 1.0)
    a, b, c, d = np.zeros((5, 5)), np.zeros((5, 2)), np.zeros((12, 5)), np.zeros((12, 2))
    a[0, 0] = -(sign * duty * internal * sense + r + r_slope * size + emf * (per_current[1] - per_current[2]))
    a[0, 0] /= inductance
    a[1:, 0] = [*per_current, sign * duty]
    b[0] = sign * voltage / inductance, -emf * (per_flow[1] - per_flow[2]) / inductance
    b[1:4, 1], b[4, 0] = per_flow, sign * current
    c[:4, 1:] = np.eye(4)
    electrical = [-internal * sense, sign * duty * (voltage - internal * size)]
    c[4:, 0] = [*per_current, per_current[1] - per_current[2], 1.0, p[core.AXIAL_TORQUE_CONSTANT], *electrical]
    d[4:8, 1] = [*per_flow, per_flow[1] - per_flow[2]]
    d[11, 0] = sign * voltage * current
    return a, b, c, d


def steady_current(p: Samples, duty: float, flow: float) -> float:
    """The current at which it no longer changes, A."""
    sense, found = p[core.AXIAL_POLARITY], np.empty(1)
    back_emf = sense * p[core.AXIAL_BACK_EMF] * (p[core.AXIAL_TAIL_FLOW] - p[core.AXIAL_BODY_FLOW]) * flow
    per_current = p[core.AXIAL_BACK_EMF] * (p[core.AXIAL_TAIL] - p[core.AXIAL_BODY]) * p[core.AXIAL_TORQUE_CONSTANT]
    steady_currents(np.array([[*p[:MOTOR_SIZE], duty, back_emf, per_current]]), found)
    return float(sense * found[0])


_SOURCE = "motor current (17) and the robot's linear response (8), (15)"
_FINENESS = 16.0  # Pieces of a step over those of a batch: errors of 1e-9 however far apart the samples are.


class AxialIntegrator(NamedTuple):
    """A method that integrates (17) and what rests on the current."""

    name: str  #: Method, order and tolerance in words.
    states: Callable[[AxialRobot, Samples, Samples], Samples]
    """States from rest, (n, 7), at times, s, (n,), among them every switching, with the duty up to each, (n,)."""


def _advanced(robot: AxialRobot, time: Samples, duty: Samples) -> Samples:
    """States at times, (n, 7): a batch of one, from sample to sample."""
    numbers, still = robot.numbers[None], np.zeros(1)
    states = np.zeros((time.size, core.AXIAL_STATE_SIZE))
    if robot.curve is not None:  # its torque is there at once
        states[:1, core.AXIAL_STATE_CURRENT] = robot.steady_current(robot.numbers, float(duty[0]), 0.0)
    for n in range(1, time.size):
        states[n] = states[n - 1]
        robot.advance(numbers, states[n : n + 1], time[n] - time[n - 1], duty[n : n + 1], still, _FINENESS)
    return states


RUNGE_KUTTA = AxialIntegrator("Runge-Kutta, order 4; exact from where the current is steady", _advanced)
"""The integrator of batches."""


def axial_run(prediction: Prediction, timing: Timing, integrator: AxialIntegrator = RUNGE_KUTTA) -> xr.Dataset:
    """Axial swimming (two degrees of freedom) from rest: the Dataset over `time` of `simulate` with motion `held`."""
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
    notes = [*prediction.warnings, *unused, *check_stokes_flow(batch, limits).values()]
    found = dataset.isel(time=np.isin(moments, time)).assign(_averages(dataset, prediction, switches, end))
    return found.assign_attrs(
        events=json.dumps(events),
        switches=", ".join(f"duty {duty:g} from {start:g} s" for start, duty in switches),
        integrator=integrator.name,
        **note_attributes(notes),
    )


def _dataset(robot: AxialRobot, time: Samples, duty: Samples, states: Samples) -> xr.Dataset:
    import xarray as xr

    steady, p = robot.prediction, robot.numbers
    found = outputs(p, states.T, duty, 0.0)
    series = {name: found[index] for name, index in robot.outputs.items()}
    motor = steady.batch.electrics if robot.curve is None else None
    series |= {"duty": duty, **_electrics(motor, p, duty, states)}
    # Without inertia torques are in proportion to the current, and powers to its square.
    whole = steady.motor_current if robot.curve is None else steady.drive_torque
    share, square = states[:, core.AXIAL_STATE_CURRENT] / whole, states[:, core.AXIAL_STATE_SQUARED_CURRENT] / whole**2
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
    current, square, slip = (
        states[:, core.AXIAL_STATE_CURRENT],
        states[:, core.AXIAL_STATE_SQUARED_CURRENT],
        p[core.AXIAL_TAIL] - p[core.AXIAL_BODY],
    )
    drawn = np.cumsum(duty * np.diff(square, prepend=0.0))  # the current drives in its own sense throughout
    return {
        "motor_resistance": winding_resistance(motor, np.abs(current)),
        "electrical_energy": p[core.AXIAL_VOLTAGE] * states[:, core.AXIAL_STATE_CHARGE]
        - p[core.AXIAL_INTERNAL_RESISTANCE] * drawn,
        "resistive_energy": states[:, core.AXIAL_STATE_HEAT],
        "magnetic_energy": 0.5 * p[core.AXIAL_INDUCTANCE] * current**2,
        "conversion_energy": (p[core.AXIAL_BACK_EMF] - p[core.AXIAL_TORQUE_CONSTANT])
        * slip
        * p[core.AXIAL_TORQUE_CONSTANT]
        * square,
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
