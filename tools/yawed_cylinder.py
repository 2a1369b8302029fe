"""A heavy cylinder on the floor of a tube, with a yawing moment: the simplest robot that its film holds down.

The moment turns it, so that it stands up on its ends; asperities carry them. Level and without rotation it has two
rates, those of its offset and its yaw. The motion follows from the package's film, and the same poses and rates are
given to finite differences of Reynolds' equation.

    python tools/yawed_cylinder.py      # prints both
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spirillum.fluid.tube.film import film_resistance
from spirillum.kernels.core import asperity_load, lift_of_cavitation
from spirillum.robot.outline import body_outline

sys.path.insert(0, str(Path(__file__).parents[1]))
from tests.support.reynolds import ShortCylinder

Pair = NDArray[np.float64]
"""Of the offset and of the yaw: rates or forces."""

RADIUS, TUBE, LENGTH = 9e-3, 20e-3, 26e-3
VISCOSITY, WEIGHT, MOMENT, ROUGHNESS = 3.5, 28e-3, 20e-6, 0.9e-6
OUTLINE = body_outline("capsule", 2.0 * RADIUS, LENGTH, 0.0, "flat", "flat")
X = np.linspace(-0.5, 0.5, 61) * LENGTH


def gap(offset: float, yaw: float, x: Any) -> Any:
    """Distance from the wall at places along the cylinder, m."""
    return TUBE - RADIUS - np.hypot(offset, x * yaw)


def film_force(offset: float, yaw: float, rates: Pair, bound: float) -> Pair:
    """Force of the film towards the tube's axis, and its yawing torque."""
    film = film_resistance(OUTLINE, TUBE, offset, 0.0, yaw)[np.ix_([2, 5], [2, 5])]
    found = -VISCOSITY * film @ rates
    if not np.isfinite(bound):
        return np.asarray(found)
    reach, slip = np.hypot(offset, X * yaw), 0.5 - TUBE / (TUBE - RADIUS)
    opening = (offset * rates[0] - X**2 * yaw * rates[1]) / reach
    out = np.empty((X.size, 6))
    bend = np.full_like(X, RADIUS * TUBE / (TUBE - RADIUS))
    lift_of_cavitation(gap(offset, yaw, X), bend, opening, X * rates[1] * slip, VISCOSITY, bound, out)
    along = np.stack([out[:, 0] * offset / reach, out[:, 1] * X * slip - out[:, 0] * X**2 * yaw / reach])
    return np.asarray(found + np.trapezoid(along, X))


def rates_at(offset: float, yaw: float, bound: float) -> Pair:
    """Rates at which film, asperities at both ends, weight and moment are in balance."""
    from scipy.optimize import fsolve

    end = 0.5 * LENGTH
    load, reach = 2.0 * asperity_load(float(gap(offset, yaw, end)), ROUGHNESS, WEIGHT), np.hypot(offset, end * yaw)
    given = np.array([load * offset / reach - WEIGHT, MOMENT - load * end**2 * yaw / reach])
    film = film_resistance(OUTLINE, TUBE, offset, 0.0, yaw)[np.ix_([2, 5], [2, 5])]
    linear = np.linalg.solve(VISCOSITY * film, given)
    if not np.isfinite(bound):
        return np.asarray(linear)
    sizes = np.array([WEIGHT, MOMENT])
    found = fsolve(lambda share: (film_force(offset, yaw, share * linear, bound) + given) / sizes, np.ones(2))
    return np.asarray(found * linear)


def motion(bound: float, duration: float = 20.0) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Times, s, and offset, m, with yaw, rad, (2, n), from a gap of 0.5 um on."""
    from scipy.integrate import solve_ivp

    def slopes(_: float, state: Pair) -> Pair:
        rates = rates_at(1e-6 * state[0], state[1], bound)
        return np.array([-1e6 * rates[0], rates[1]])

    start, times = [1e6 * (TUBE - RADIUS) - 0.5, 1e-4], np.linspace(0.0, duration, 41)
    run = solve_ivp(slopes, (0.0, duration), start, method="LSODA", rtol=1e-4, atol=[1e-5, 1e-7], t_eval=times)
    return run.t, run.y * np.array([[1e-6], [1.0]])


def pulls(bound: float, every: int = 8) -> dict[str, NDArray[np.float64]]:
    """The film's pull over time, and that of finite differences at some of the times."""
    time, states = motion(bound)
    own = [-film_force(*state, rates_at(*state, bound), bound)[0] for state in states.T]
    some = range(1, time.size, every)
    other = []
    for k in some:
        offset, yaw = states[:, k]
        rates = rates_at(offset, yaw, bound)
        cylinder = ShortCylinder(RADIUS, LENGTH, TUBE, offset, 0.0, yaw, (60, 180))
        other.append(-cylinder.solve({2: rates[0], 5: rates[1]}, VISCOSITY, bound)[0][2])
    return {"time": time, "pull": np.array(own), "at": time[list(some)], "reynolds": np.array(other)}


def main() -> None:
    """Print both."""
    for bound in (np.inf, 1e4):
        found = pulls(bound)
        for at, other in zip(found["at"], found["reynolds"], strict=True):
            own = float(np.interp(at, found["time"], found["pull"]))
            print(f"p_c {bound:g} Pa, {at:.1f} s: {1e3 * own:.1f} mN, Reynolds {1e3 * other:.1f} mN")


if __name__ == "__main__":
    main()
