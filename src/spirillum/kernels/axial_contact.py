"""Dry friction under a robot that is constrained to axial motion and slides along its tube, compiled."""

from __future__ import annotations

import math

from spirillum.arrays import Samples
from spirillum.kernels.compiled import compiled

_HALVINGS = 80


@compiled
def _sliding(r: Samples, drag: float, radius: float, rate: float, slow: float) -> float:
    """Smoothed sliding speed of a body with a drag at its lowest point, m/s; the tail's rate is prescribed."""
    a, b = r[0, 0] + drag, r[0, 1]
    c, d = r[1, 0] + r[2, 0], r[1, 1] + r[2, 1] + drag * radius * radius
    e, f = r[0, 2] * rate, (r[1, 2] + r[2, 2]) * rate
    determinant = a * d - b * c
    speed, spin = (b * f - d * e) / determinant, (c * e - a * f) / determinant
    return math.sqrt(speed * speed + radius * radius * spin * spin + slow * slow)


@compiled
def contact_drag(r: Samples, force: Samples, radius: Samples, rate: Samples, smooth: float, out: Samples) -> None:
    """Fill the drag k = force/s of dry friction at a contact that slides at s, N s/m, see `swimming.dry_friction`.

    Args:
        r: resistance of the whole robot against U, Omega and omega, (n, 3, 3).
        force: mu_c N, N, (n,).
        radius: of the body, m, (n,).
        rate: omega of the tail, rad/s, (n,).
        smooth: v_r over the speed of a body that turns as fast as its tail.
        out: to be filled, (n,).
    """
    for n in range(force.shape[0]):
        slow = smooth * radius[n] * abs(rate[n])
        if not force[n] > 0.0 or not slow > 0.0:
            out[n] = 0.0 * force[n]
            continue
        # k s(k) grows with k: bisect its logarithm between free sliding and sticking
        low, high = force[n] / _sliding(r[n], 0.0, radius[n], rate[n], slow), force[n] / slow
        for _ in range(_HALVINGS):
            if high - low <= 1e-14 * high:
                break
            k = math.sqrt(low * high)
            if k * _sliding(r[n], k, radius[n], rate[n], slow) > force[n]:
                high = k
            else:
                low = k
        out[n] = math.sqrt(low * high)
