"""Stokes flow around long cylinders near a wall, per length and viscosity: closed forms for any gap."""

import numpy as np


def rotation_in_a_tube(a: float, R: float, e: float) -> tuple[float, float]:
    """Force across the line of centres and torque per length over mu Omega (Jeffery 1922; Wannier 1950).

    The constants of Jeffery's stream function (1/h)[(A + B xi) cosh xi + (C + D xi) sinh xi + ...] in bipolar
    coordinates, xi = alpha on the cylinder and beta on the tube.
    """
    alpha = np.arccosh((R * R - a * a - e * e) / (2 * a * e))
    beta = np.arccosh((R * R - a * a + e * e) / (2 * R * e))
    d, c = alpha - beta, a * np.sinh(alpha)
    s, size = np.sinh(d), np.sinh(d) ** 2 - d * d
    gap = d - np.tanh(d)
    flow = -a * (d * np.sinh(alpha) - s * np.sinh(beta)) / (d + s * np.cosh(alpha + beta) + size / gap)
    B = -flow / gap
    D = (a * (s * np.cosh(beta) - d * np.cosh(alpha)) - flow * s * np.sinh(alpha + beta)) / size
    return -4 * np.pi * D, 4 * np.pi * c * (B + D / np.tanh(alpha))


def beside_a_plane(a: float, gap: float) -> np.ndarray:
    """Along the axis, across it along the plane, normal to the plane; torque over a^2 about the axis.

    D. J. Jeffrey and Y. Onishi, Q. J. Mech. Appl. Math. 34:129, 1981.
    """
    xi = np.arccosh(1 + gap / a)
    return np.pi * np.array([2 / xi, 4 / xi, 4 / (xi - np.tanh(xi)), 4 / np.tanh(xi)])
