"""A swimmer of your own: two tails on one body, as wires of any curve.

Robot files have one tail. The resolved hydrodynamics takes any number of wires of any shape, so a swimmer with two
tails half a turn apart, a double helix, is a few lines: body, curves, one solution. Two wires this close turn the fluid
between them almost like a solid cylinder: the second nearly doubles the torque and adds no thrust.
"""

import numpy as np

from spirillum.fluid.wire.interaction import Discretisation, solve
from spirillum.fluid.wire.stokeslets import stations_along
from spirillum.robot.outline import body_outline

BODY, ROTOR = 0, 1
VISCOSITY = 3.5  # Pa s

body = body_outline("capsule", 18e-3, 35e-3, 0.0, "hemisphere", "hemisphere")


def tail(phase: float) -> np.ndarray:
    """Centreline of a right-handed helix behind the body, m."""
    xi = np.linspace(0.0, 60e-3, 800)
    x, k = -27.5e-3 - xi, 2 * np.pi / 25e-3
    r = 2.5e-3 * (1 - np.exp(-100 * xi / 60e-3))
    return np.stack([x, r * np.cos(k * x + phase), r * np.sin(k * x + phase)], axis=1)


def matrix(curves: list[np.ndarray]) -> np.ndarray:
    """12x12 resistance of body and rotor, SI."""
    wires = [(stations_along(curve, 0.5e-3), ROTOR) for curve in curves]
    return VISCOSITY * solve([(body, BODY)], wires, Discretisation(wire="high")).matrix


def advance(r: np.ndarray) -> float:
    """Speed over rotor rate, m/rad, with the body held from turning: zero force on the whole."""
    drag = r[0, 0] + 2 * r[0, 6] + r[6, 6]
    return float(-(r[0, 9] + r[6, 9]) / drag)


# The tapered roots of two tails would meet on the axis, so the second one starts where the first has its full width.
single = matrix([tail(0.0)])
double = matrix([tail(0.0), tail(np.pi)[120:]])

thrust = double[6, 9] / single[6, 9]
torque = double[9, 9] / single[9, 9]
print(f"one tail:  {2 * np.pi * 1e3 * advance(single):.3f} mm/turn")
print(f"two tails: {2 * np.pi * 1e3 * advance(double):.3f} mm/turn, thrust x {thrust:.2f}, torque x {torque:.2f}")
assert 0.85 < thrust < 0.95
assert 1.8 < torque < 2.0
assert 0 < advance(double) < advance(single)
assert np.linalg.eigvalsh(double).min() > 0
