"""The equations of a robot that is held to its channel's axis: rate of its state, quantities, slopes, steady current.

The state is that of `held_model.STATES`: current I (signed about +x), place, angles of tail and body, charge drawn.
With duty d, imposed flow U_m, polarity p and joint torque tau = K_m I, (17) and the linear response read

    L dI/dt = p d V(|I|) - R(|I|) I - K_b (omega - Omega),
    (U, Omega, omega) = (a, b, c)_tau tau + (a, b, c)_m U_m.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from spirillum.arrays import Samples

INPUTS = ("duty", "mean_flow")
"""Inputs; quantities of the registry."""
OUTPUTS = (
    "position",
    "tail_angle",
    "body_angle",
    "battery_charge_used",
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
_HALVINGS = 200


def _winding(p: Mapping[str, float], size: float) -> tuple[float, float]:
    """R and dR/d|I|."""
    falling = p["motor.resistance.decay"] * math.exp(-p["motor.resistance.decay_rate"] * size)
    rising = p["motor.resistance.growth"] * math.exp(min(p["motor.resistance.growth_rate"] * size, 600.0))
    value = p["motor.resistance.constant"] + falling + rising + p["motor.resistance.slope"] * size
    slope = p["motor.resistance.growth_rate"] * rising - p["motor.resistance.decay_rate"] * falling
    return value, slope + p["motor.resistance.slope"]


def _motion(p: Mapping[str, float], of: str, current: float, flow: float) -> float:
    return p[f"{of}_per_torque"] * p["motor.torque_constant"] * current + p[f"{of}_per_flow"] * flow


def _current_rate(p: Mapping[str, float], current: float, duty: float, flow: float) -> float:
    size = abs(current)
    supply = p["polarity"] * duty * (p["battery.voltage"] - p["battery.internal_resistance"] * size)
    slip = _motion(p, "tail_rotation_rate", current, flow) - _motion(p, "body_rotation_rate", current, flow)
    emf = p["motor.back_emf_constant"] * slip
    return (supply - _winding(p, size)[0] * current - emf) / p["motor.inductance"]


def rates(p: Mapping[str, float], current: float, duty: float, flow: float) -> Samples:
    """d/dt of the state, (5,), which depends on the current alone.

    Args:
        p: the robot's numbers by name, see `held_model.PARAMETERS`.
        current: I, A.
        duty: 0 to 1.
        flow: imposed mean flow, m/s.
    """
    moved = [_motion(p, of, current, flow) for of in ("forward_velocity", "tail_rotation_rate", "body_rotation_rate")]
    return np.array([_current_rate(p, current, duty, flow), *moved, p["polarity"] * duty * current])


def outputs(p: Mapping[str, float], state: Samples, duty: float, flow: float) -> Samples:
    """All of `OUTPUTS`, (12,).

    Args:
        p: the robot's numbers by name, see `held_model.PARAMETERS`.
        state: (5,), see `held_model.STATES`.
        duty: 0 to 1.
        flow: imposed mean flow, m/s.
    """
    current = float(state[0])
    speed, tail, body = rates(p, current, duty, flow)[1:4]
    voltage = p["battery.voltage"] - p["battery.internal_resistance"] * abs(current)
    power = p["polarity"] * duty * voltage * current
    torque = p["motor.torque_constant"] * current
    return np.array([*state[1:5], speed, tail, body, tail - body, current, torque, voltage, power])


def slopes(p: Mapping[str, float], current: float, duty: float) -> tuple[Samples, Samples, Samples, Samples]:
    """A (5, 5), B (5, 2), C (12, 5), D (12, 2) of the equations linearised at a current and duty, in closed form."""
    size, sense, sign = abs(current), math.copysign(1.0, current), p["polarity"]
    r, r_slope = _winding(p, size)
    k_m, inductance, internal = p["motor.torque_constant"], p["motor.inductance"], p["battery.internal_resistance"]
    voltage = p["battery.voltage"] - internal * size
    names = ("forward_velocity", "tail_rotation_rate", "body_rotation_rate")
    per_current = [k_m * p[f"{name}_per_torque"] for name in names]
    per_flow = [p[f"{name}_per_flow"] for name in names]
    emf = p["motor.back_emf_constant"]
    a, b, c, d = np.zeros((5, 5)), np.zeros((5, 2)), np.zeros((12, 5)), np.zeros((12, 2))
    a[0, 0] = -(sign * duty * internal * sense + r + r_slope * size + emf * (per_current[1] - per_current[2]))
    a[0, 0] /= inductance
    a[1:, 0] = [*per_current, sign * duty]
    b[0] = sign * voltage / inductance, -emf * (per_flow[1] - per_flow[2]) / inductance
    b[1:4, 1], b[4, 0] = per_flow, sign * current
    c[:4, 1:] = np.eye(4)
    c[4:, 0] = [
        *per_current,
        per_current[1] - per_current[2],
        1.0,
        k_m,
        -internal * sense,
        sign * duty * (voltage - internal * size),
    ]
    d[4:8, 1] = [*per_flow, per_flow[1] - per_flow[2]]
    d[11, 0] = sign * voltage * current
    return a, b, c, d


def steady_state(p: Mapping[str, float], duty: float, flow: float) -> float:
    """The current at which it no longer changes, A: between none and that of the bare resistance, by bisection."""
    at_rest = _current_rate(p, 0.0, duty, flow)
    if at_rest == 0.0:
        return 0.0
    sense, reach = math.copysign(1.0, at_rest), 1e-9
    while sense * _current_rate(p, sense * reach, duty, flow) > 0.0 and reach < 1e9:
        reach *= 2.0
    low, high = 0.0, reach
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        if middle in (low, high):
            break
        if sense * _current_rate(p, sense * middle, duty, flow) > 0.0:
            low = middle
        else:
            high = middle
    return sense * 0.5 * (low + high)
