"""Swimming in time with two degrees of freedom: the motor's transient (17) and the trajectory that follows.

Inertia is neglected, so every rate follows the joint torque K_m I at once and linearly; the current is the
only state with dynamics of its own. Path, angles and energies are its integrals and are integrated with it.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.dynamics.attributes import run_attributes
from spirillum.dynamics.averages import STEADY, run_averages, stretches_on
from spirillum.dynamics.remote import Switch
from spirillum.dynamics.timing import Timing
from spirillum.errors import InputError
from spirillum.notes import note_attributes
from spirillum.quantities import attributes
from spirillum.robot.batch import Electrics, RobotBatch
from spirillum.swimming.balance import friction_torques, rates_per_torque
from spirillum.swimming.motor import battery_voltage, winding_resistance
from spirillum.swimming.prediction import Prediction
from spirillum.swimming.reynolds import check_stokes_flow, motion_limits
from spirillum.swimming.steady import calibrated_balance
from spirillum.units import show

if TYPE_CHECKING:
    import xarray as xr

_TOLERANCE = 1e-9
# Orders above 4 have so small a region of stability that the decay with L/R needs ten times the steps.
_HIGHEST_ORDER = 4
_MOST_TIME_CONSTANTS = 1e6
_SOURCE = "motor current (17) and the robot's linear response (8), (15)"


class AxialResponse(NamedTuple):
    """Rates and powers of one robot per joint torque (all linear or quadratic in it)."""

    body_rate: float
    """Omega per joint torque, rad/(s N m)."""
    tail_rate: float
    """omega per joint torque, rad/(s N m)."""
    speed: float
    """U per joint torque, m/(s N m)."""
    rotor_load: float
    """Hydrodynamic torque on the rotor per joint torque."""
    dissipated: float
    """Viscous dissipation per joint torque squared, 1/(N m s)."""
    friction: float
    """Friction power per joint torque squared, 1/(N m s)."""

    @property
    def slip(self) -> float:
        """omega_m per joint torque, rad/(s N m)."""
        return self.tail_rate - self.body_rate


@dataclass(frozen=True)
class MotorTransient:
    """Solution of (17) in the motor's own sense (positive the way that the voltage drives), SI."""

    time: Samples
    """Sample times, s."""
    duty: Samples
    """Duty of the voltage at each sample (0 while the remote is off)."""
    current: Samples
    """I, A."""
    charge: Samples
    """Integral of I, A s."""
    current_squared: Samples
    """Integral of I^2, A^2 s."""
    resistive_energy: Samples
    """Integral of R(I) I^2, J."""
    electrical_energy: Samples
    """Integral of duty V(I) I, J."""
    battery_charge: Samples
    """Integral of duty I: charge drawn from the battery, A s."""


def axial_response(batch: RobotBatch, prediction: Prediction) -> AxialResponse:
    """The robot's linear answer to a joint torque, for the prediction's model, friction and calibration."""
    if batch.placement.flow:
        raise InputError(
            f"placement.flow = {show(batch.placement.flow, 'mm/s')}: a run in time starts from rest; allowed: no flow, "
            "or `predict` for the steady motion"
        )
    s = calibrated_balance(batch, prediction.model, calibrated=prediction.calibrated)
    rotor = batch.electrics.joint_rotor_friction if batch.electrics else np.zeros(1)
    t = friction_torques(prediction.friction, np.array([prediction.effective_friction]), rotor)
    body, tail = rates_per_torque(s, t)
    load = s.rotor_load(body, tail)
    values = (
        body,
        tail,
        s.speed(body, tail),
        load,
        load * tail + s.body_load(body, tail) * body,
        t.power(body, tail),
    )
    return AxialResponse(*(float(value[0]) for value in values))


def motor_transient(motor: Electrics, slip: float, time: Samples, switches: Sequence[Switch]) -> MotorTransient:
    """Integrate (17) with variable-order Adams-Moulton predictor-corrector steps (VODE), as the paper does.

    Args:
        motor: motor and battery of one robot.
        slip: omega_m per joint torque, rad/(s N m).
        time: increasing sample times from 0, s.
        switches: (time, duty) of every switching, the first at 0.
    """
    right_hand_side = _right_hand_side(motor, slip)
    _check_stiffness(motor, float(time[-1]))
    rows: list[Samples] = [np.zeros((1, 6))]
    duties: list[Samples] = [np.full(1, switches[0][1])]
    state: Samples = np.zeros(6)
    ends = [*(start for start, _ in switches[1:]), float(time[-1])]
    for (start, duty), end in zip(switches, ends, strict=True):
        inside = time[(time > start) & (time <= end)]
        block, state = _segment(right_hand_side, duty, start, end, state, inside)
        rows.append(block)
        duties.append(np.full(len(inside), duty))
    columns = np.concatenate(rows).T
    return MotorTransient(time, np.concatenate(duties), *columns)


def _check_stiffness(motor: Electrics, end: float) -> None:
    """Refuse runs that are millions of electrical time constants long: explicit steps follow L/R."""
    shortest = float(motor.inductance[0] / (motor.constant[0] + motor.decay[0] + motor.growth[0]))
    if end > _MOST_TIME_CONSTANTS * shortest:
        raise InputError(
            f"duration = {end:.4g} s is more than {_MOST_TIME_CONSTANTS:g} times motor.inductance/resistance "
            f"= {shortest:.4g} s; allowed: a shorter run, or `predict` for the steady motion"
        )


def _right_hand_side(motor: Electrics, slip: float) -> Callable[[float, Samples, float], list[float]]:
    """d/dt of (I, int I, int I^2, int R I^2, int duty V I, int duty I); plain floats, since it is called often."""
    exp = math.exp
    constant, decay, decay_rate = float(motor.constant[0]), float(motor.decay[0]), float(motor.decay_rate[0])
    growth, growth_rate, slope = float(motor.growth[0]), float(motor.growth_rate[0]), float(motor.slope[0])
    voltage, internal = float(motor.voltage[0]), float(motor.internal_resistance[0])
    inductance = float(motor.inductance[0])
    emf = float(motor.joint_back_emf_constant[0] * motor.joint_torque_constant[0]) * slip

    def derivative(time: float, y: Samples, duty: float) -> list[float]:  # noqa: ARG001 - the solver's form
        i = float(y[0])
        size = abs(i)
        r = constant + decay * exp(-decay_rate * size) + growth * exp(growth_rate * size) + slope * size
        supply = duty * (voltage - internal * size)
        return [(supply - (r + emf) * i) / inductance, i, i * i, r * i * i, supply * i, duty * i]

    return derivative


def _segment(
    derivative: Callable[..., list[float]], duty: float, start: float, end: float, state: Samples, samples: Samples
) -> tuple[Samples, Samples]:
    """Integrate between two switchings; states at the samples and at the end.

    Time counts from `start`, which (17) does not depend on: VODE refuses a step that is no longer than the rounding
    error of its end, as from a switching to a sample that differs from it by rounding alone.
    """
    from scipy.integrate import ode

    solver = ode(derivative).set_f_params(duty)
    solver.set_integrator(
        "vode", method="adams", order=_HIGHEST_ORDER, rtol=_TOLERANCE, atol=1e-3 * _TOLERANCE, nsteps=1_000_000
    )
    solver.set_initial_value(state, 0.0)
    block = np.empty((len(samples), 6))
    for row, t in enumerate(samples):
        block[row] = solver.integrate(t - start)
    last = block[-1] if len(samples) and samples[-1] == end else solver.integrate(end - start) if end > start else state
    if not solver.successful():
        raise InputError(
            f"the motor's transient cannot be integrated beyond t = {start + solver.t:.4g} s with these constants"
        )
    return block, np.array(last)


def held_run(prediction: Prediction, timing: Timing) -> xr.Dataset:
    """Axial swimming (two degrees of freedom) from rest.

    Returns:
        Dataset over `time` with position, angles, rates, current, torques, powers, energies and efficiency;
        averages over the last two thirds of the run, while on and while steady as scalars; settings in the attributes.
    """
    batch = prediction.batch
    if batch.drive != "dc-motor" or batch.electrics is None:
        raise InputError(f"drive.kind = '{batch.drive}'; allowed: 'dc-motor', which alone has a transient")
    if prediction.tail_rotation_rate == 0:
        raise InputError("drive.duty = 0: the tail does not turn; allowed: more than 0, and `on` for switching off")
    turn = 2.0 * np.pi / abs(prediction.tail_rotation_rate)
    end, time, switches, unused = timing.timetable(turn, float(batch.electrics.duty[0]))
    response = axial_response(batch, prediction)
    moments = np.union1d(time, [switch.time for switch in switches])
    transient = motor_transient(batch.electrics, response.slip, moments, switches)
    dataset = _dataset(prediction, batch.electrics, response, transient, switches)
    averages = _averages(dataset, prediction, switches, end)
    limits = motion_limits(batch, dataset["forward_velocity"].values, dataset["tail_rotation_rate"].values)
    said = [*prediction.warnings, *unused, *check_stokes_flow(batch, limits).values()]
    return dataset.isel(time=np.isin(moments, time)).assign(averages).assign_attrs(note_attributes(said))


def _dataset(
    prediction: Prediction,
    motor: Electrics,
    r: AxialResponse,
    m: MotorTransient,
    switches: Sequence[Switch],
) -> xr.Dataset:
    import xarray as xr

    sign = float(motor.polarity[0])
    k_m, k_b = float(motor.joint_torque_constant[0]), float(motor.joint_back_emf_constant[0])
    torque = sign * k_m * m.current
    impulse = sign * k_m * m.charge
    torque2 = k_m**2 * m.current_squared
    shaft = r.rotor_load * r.slip * torque**2
    voltage = battery_voltage(motor, m.current)
    series = {
        "position": r.speed * impulse,
        "tail_angle": r.tail_rate * impulse,
        "body_angle": r.body_rate * impulse,
        "forward_velocity": r.speed * torque,
        "tail_rotation_rate": r.tail_rate * torque,
        "body_rotation_rate": r.body_rate * torque,
        "motor_rotation_rate": r.slip * torque,
        "motor_current": sign * m.current,
        "motor_resistance": winding_resistance(motor, m.current),
        "battery_voltage": voltage,
        "duty": m.duty,
        "motor_torque": torque,
        "tail_torque": np.abs(r.rotor_load * torque),
        "electrical_power": m.duty * voltage * m.current,
        "shaft_power": shaft,
        "friction_power": r.friction * torque**2,
        "dissipated_power": r.dissipated * torque**2,
        "electrical_energy": m.electrical_energy,
        "resistive_energy": m.resistive_energy,
        "magnetic_energy": 0.5 * float(motor.inductance[0]) * m.current**2,
        "conversion_energy": (k_b / k_m - 1.0) * r.slip * torque2,
        "friction_energy": r.friction * torque2,
        "dissipated_energy": r.dissipated * torque2,
        "battery_charge_used": m.battery_charge,
    }
    data = {name: ("time", values, attributes(name, source=_SOURCE)) for name, values in series.items()}
    data["position"] = (
        "time",
        series["position"],
        attributes("position", meaning="distance swum along x", source=_SOURCE),
    )
    return xr.Dataset(
        data,
        coords={"time": ("time", m.time, attributes("time"))},
        attrs={
            "title": f"Axial swimming of {prediction.robot.name} (two degrees of freedom)",
            **run_attributes(prediction),
            "motion": "held",
            "placement": json.dumps(prediction.placement),
            "steady": STEADY,
            "events": json.dumps([{"time": time, "what": f"duty {duty:g}"} for time, duty in switches]),
            "switches": ", ".join(f"duty {duty:g} from {start:g} s" for start, duty in switches),
            "integrator": f"VODE Adams, order up to {_HIGHEST_ORDER}, relative tolerance {_TOLERANCE:g}",
        },
    )


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
        {name: (dataset[of].values, unit) for name, (of, unit) in integrals.items()},
        stretches_on(switches, end),
        by_turn=False,
    )
    found["hydrodynamic_efficiency"] = (
        (),
        prediction.hydrodynamic_efficiency,
        attributes("hydrodynamic_efficiency", source="eq. (16) of BioRob 2012; constant in time"),
    )
    return found
