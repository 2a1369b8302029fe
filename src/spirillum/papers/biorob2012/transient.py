"""The paper's integration in time: three periods by an Adams-Bashforth-Moulton method, also a reference for tests.

Explicit steps follow the motor's time constant L/R; `simulate` takes none while the current is steady.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from spirillum.arrays import Samples
from spirillum.dynamics.axial_robot import AxialIntegrator, AxialRobot, axial_run, rates
from spirillum.dynamics.timing import Timing
from spirillum.errors import InputError
from spirillum.swimming.prediction import Prediction

if TYPE_CHECKING:
    import xarray as xr

_TOLERANCE = 1e-9
# Orders above 4 have so small a region of stability that the decay with L/R needs ten times the steps.
_HIGHEST_ORDER = 4
_MOST_STEPS = 1_000_000


def paper_run(prediction: Prediction, timing: Timing | None = None) -> xr.Dataset:
    """Axial swimming from rest over the paper's three periods or another time, as `simulate` with motion `held`."""
    return axial_run(prediction, Timing() if timing is None else timing, ADAMS)


def adams_states(robot: AxialRobot, time: Samples, duty: Samples) -> Samples:
    """States from rest, (n, 7), at times, s, by variable-order Adams-Moulton predictor-corrector steps (VODE)."""
    # Time counts from each switching, which (17) does not depend on: VODE refuses a step that is no longer than the
    # rounding error of its end.
    states, begin = np.zeros((time.size, 7)), 0
    while begin < time.size - 1:
        changes = np.flatnonzero(duty[begin + 1 :] != duty[begin + 1])
        end = begin + 1 + (int(changes[0]) if changes.size else time.size - begin - 1)
        since = time[begin + 1 : end] - time[begin]
        states[begin + 1 : end] = _stretch(robot, float(duty[begin + 1]), states[begin], since)
        begin = end - 1
    return states


def _stretch(robot: AxialRobot, duty: float, start: Samples, times: Samples) -> Samples:
    """States at times after a switching, s."""
    from scipy.integrate import ode

    numbers = robot.numbers
    solver = ode(lambda _time, y: rates(numbers, float(y[0]), duty, 0.0))
    solver.set_integrator(
        "vode", method="adams", order=_HIGHEST_ORDER, rtol=_TOLERANCE, atol=1e-3 * _TOLERANCE, nsteps=_MOST_STEPS
    )
    solver.set_initial_value(start, 0.0)
    found = np.array([solver.integrate(time) for time in times])
    if not solver.successful():
        raise InputError(
            f"the motor's transient cannot be integrated beyond {solver.t:.4g} s after a switching; allowed: a shorter "
            "run, or `simulate` with motion 'held'"
        )
    return found


ADAMS = AxialIntegrator(f"VODE Adams, order up to {_HIGHEST_ORDER}, relative tolerance {_TOLERANCE:g}", adams_states)
"""The paper's method."""
