"""DC-motor and battery: eq. (17) with the current-dependent R(I) and V(I) of Table II.

Everything here is in the motor's own sense: current, rate and back-emf are positive the way that the
applied voltage drives. The pulse-width controller (400 kHz, far above R/L) is averaged: the motor sees
duty V(I), the battery gives duty I.
"""

from __future__ import annotations

import numpy as np

from spirillum.arrays import Samples, Values
from spirillum.kernels.drive import MOST_POINTS, MOTOR, curve_torques, steady_currents, windings
from spirillum.robot.batch import Electrics
from spirillum.robot.tables import TorqueCurve


def winding_resistance(motor: Electrics, current: Values) -> Values:
    """R(I) of Table II, ohm; takes |I|."""
    rows, shape = _rows(motor, current)
    found = np.empty((rows.shape[0], 2))
    windings(np.ascontiguousarray(rows[:, :MOTOR]), np.ascontiguousarray(rows[:, MOTOR]), found)
    return found[:, 0].reshape(shape)


def battery_voltage(motor: Electrics, current: Values) -> Values:
    """V(I) of Table II at the terminals, V; takes |I|."""
    return motor.voltage - motor.internal_resistance * np.abs(current)


def steady_current(motor: Electrics, back_emf: Values, back_emf_per_current: Values) -> Values:
    """Steady root of (17): R(I) I = duty V(I) - (back_emf + back_emf_per_current I).

    Returns:
        The current, A; negative where the tail drives the motor (back-emf above the voltage), NaN where it
        does so beyond any root, or beyond what the battery's voltage allows. While the motor drives there is a
        single root (the robot file is checked for that).
    """
    rows, shape = _rows(motor, motor.duty, back_emf, back_emf_per_current)
    found = np.empty(rows.shape[0])
    steady_currents(rows, found)
    return found.reshape(shape)


def _rows(motor: Electrics, *more: Values) -> tuple[Samples, tuple[int, ...]]:
    """Motors as C takes them, each with further numbers, (n, 12 + ...), and the shape that all of them share."""
    columns = [*motor.columns, *more]
    shape = np.broadcast_shapes(*(column.shape for column in columns))
    rows = np.empty((*shape, len(columns)))
    for place, column in enumerate(columns):
        rows[..., place] = column
    return rows.reshape(-1, len(columns)), shape


def torque_on_curve(curve: TorqueCurve, coasting: Values, per_torque: Values, duty: float = 1.0) -> Values:
    """Torque of a motor with a curve, N m, in its own sense.

    Args:
        curve: torque against rate.
        coasting: rate of the joint without a torque, rad/s.
        per_torque: what a torque adds to it, 1/(N m s).
        duty: 0 to 1; scales the torques.
    """
    rates, slopes = np.broadcast_arrays(coasting, per_torque)
    found = np.empty(rates.size)
    curve_torques(packed_curve(curve), rates.ravel(), slopes.ravel(), duty, found)
    return found.reshape(rates.shape)


def packed_curve(curve: TorqueCurve) -> Samples:
    """A curve as C takes it, (25,)."""
    found = np.zeros(1 + 2 * MOST_POINTS)
    found[0] = len(curve.rates)
    found[1:].reshape(-1, 2)[: len(curve.rates)] = np.transpose((curve.rates, curve.torques))
    return found


def run_time(motor: Electrics, current: Values) -> Values:
    """Time for which the rated charge lasts at a constant motor current, s; NaN without a rating."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return motor.capacity / (motor.duty * np.abs(current))
