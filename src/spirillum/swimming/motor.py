"""DC-motor and battery: eq. (17) with the current-dependent R(I) and V(I) of Table II.

Everything here is in the motor's own sense: current, rate and back-emf are positive the way that the
applied voltage drives. The pulse-width controller (400 kHz, far above R/L) is averaged: the motor sees
duty V(I), the battery gives duty I.
"""

from __future__ import annotations

import numpy as np

from spirillum.arrays import Values
from spirillum.robot.batch import Electrics

_LARGEST_START = 1e6
"""Largest current at which the search for the steady one starts, A."""


def winding_resistance(motor: Electrics, current: Values) -> Values:
    """R(I) of Table II, ohm; takes |I|."""
    i = np.abs(current)
    return (
        motor.constant
        + motor.decay * np.exp(-motor.decay_rate * i)
        + motor.growth * np.exp(_bounded(motor.growth_rate * i))
        + motor.slope * i
    )


def _bounded(exponent: Values) -> Values:
    """An exponent whose exponential is still a number: far currents are tried on the way to a root."""
    return np.minimum(exponent, 600.0)


def _resistance_slope(motor: Electrics, i: Values) -> Values:
    return (
        -motor.decay * motor.decay_rate * np.exp(-motor.decay_rate * i)
        + motor.growth * motor.growth_rate * np.exp(_bounded(motor.growth_rate * i))
        + motor.slope
    )


def battery_voltage(motor: Electrics, current: Values) -> Values:
    """V(I) of Table II at the terminals, V; takes |I|."""
    return motor.voltage - motor.internal_resistance * np.abs(current)


def _excess(motor: Electrics, i: Values, linear: Values, drive: Values) -> Values:
    """Voltage that a current takes less the one that drives it, V: zero at the steady current."""
    return (winding_resistance(motor, i) + linear) * i - drive


def _excess_and_step(motor: Electrics, i: Values, linear: Values, drive: Values) -> tuple[Values, Values]:
    """The excess at a current, V, and the next current of Newton's method, A."""
    resistance = winding_resistance(motor, i) + linear
    excess = resistance * i - drive
    return excess, i - excess / (resistance + _resistance_slope(motor, i) * i)


def steady_current(motor: Electrics, back_emf: Values, back_emf_per_current: Values) -> Values:
    """Steady root of (17): R(I) I = duty V(I) - (back_emf + back_emf_per_current I).

    Returns:
        The current, A; negative where the tail drives the motor (back-emf above the voltage), NaN where it
        does so beyond any root, or beyond what the battery's voltage allows. While the motor drives there is a
        single root (the robot file is checked for that), found by Newton steps kept inside a bracket.
    """
    open_voltage = motor.duty * motor.voltage - back_emf
    sense = np.where(open_voltage < 0, -1.0, 1.0)
    drive = np.abs(open_voltage)
    linear = back_emf_per_current + sense * motor.duty * motor.internal_resistance

    low = np.zeros(np.broadcast_shapes(drive.shape, linear.shape, motor.constant.shape))
    at_rest = motor.constant + motor.decay + motor.growth + np.maximum(linear, 0.0)
    # A winding almost without resistance at rest would start beyond what 200 halvings come back from.
    i = low + np.minimum(drive / np.where(at_rest > 0, at_rest, 1.0), _LARGEST_START)
    high = 2.0 * i + 1e-12
    for _ in range(60):
        short = _excess(motor, high, linear, drive) < 0
        if not np.any(short):
            break
        high = np.where(short, 2.0 * high, high)
    # Driven too fast: V(|I|) falls faster than R(I) I rises.
    high = np.where(_excess(motor, high, linear, drive) < 0, np.nan, high)
    last = high - low
    # scipy.optimize.elementwise.find_root is as fast for a million robots, but six times slower for one robot and five
    # times slower for the few hundred currents that every step of a posterior's sampler asks for.
    for _ in range(200):
        f, newton = _excess_and_step(motor, i, linear, drive)
        low, high = np.where(f < 0, i, low), np.where(f < 0, high, i)
        # Newton creeps along an exponential: a step that is not half the one before gives way to bisection.
        good = (newton >= low) & (newton <= high) & (np.abs(newton - i) <= 0.5 * last)
        new = np.where(good, newton, 0.5 * (low + high))
        last, i = np.abs(new - i), new
        if not np.any(last > 1e-9 * np.abs(i)):
            break
    # Newton's error is the square of the step before; where rounding led out of the bracket, the last step halved it.
    _, newton = _excess_and_step(motor, i, linear, drive)
    i = np.where(np.isfinite(newton), np.clip(newton, low, high), i)
    return np.where(battery_voltage(motor, i) < 0, np.nan, sense * i)


def run_time(motor: Electrics, current: Values) -> Values:
    """Time for which the rated charge lasts at a constant motor current, s; NaN without a rating."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return motor.capacity / (motor.duty * np.abs(current))
