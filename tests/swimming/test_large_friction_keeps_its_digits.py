"""Friction far above or below the fluid's torques: what cancels must not take digits along."""

from fractions import Fraction

import numpy as np
import pytest

from spirillum.swimming.balance import TorqueBalance, coasting_rates, friction_torques, rates_per_torque

FLUID = {"bb": 1.01e-4, "br": -3.0e-7, "rb": -3.0e-7, "rr": 6.0e-6}
ROTOR = 7e-7


def exact(
    s: TorqueBalance, reading: str, effective: float, on_body: Fraction, on_rotor: Fraction
) -> tuple[float, float]:
    """Both rates under torques on body and rotor in rational arithmetic."""
    b, b_m, zero = Fraction(effective), Fraction(ROTOR), Fraction(0)
    friction = {
        "none": (zero, zero, zero, zero),
        "rotor": (b, -b, -b, b),
        "body": (b_m + b, -b_m, -b_m, b_m),
        "paper": (zero, zero, -b, b),
    }[reading]
    bb, br, rb, rr = (Fraction(float(fluid[0])) + own for fluid, own in zip(s[:4], friction, strict=True))
    determinant = bb * rr - br * rb
    return float((rr * on_body - br * on_rotor) / determinant), float((bb * on_rotor - rb * on_body) / determinant)


def balance(scale: float) -> TorqueBalance:
    entries = {name: np.array([value * scale]) for name, value in FLUID.items()}
    flow = {"t_b": np.array([3.1e-6 * scale]), "t_r": np.array([-7.7e-7 * scale])}
    return TorqueBalance(**entries, **flow, **dict.fromkeys(("u_b", "u_r", "u_0"), np.zeros(1)))


@pytest.mark.parametrize("reading", ["none", "rotor", "body", "paper"])
@pytest.mark.parametrize("effective", [1e-12, 1e-6, 1.0, 1e3, 1e6])
@pytest.mark.parametrize("scale", [1.0, 1e-12])
def test_against_rational_arithmetic(reading: str, effective: float, scale: float) -> None:
    s = balance(scale)
    t = friction_torques(reading, np.array([effective]), np.array([ROTOR]))
    # `body`: its sum B_m + B is rounded before the fluid's torque is added.
    rtol = 1e-9 if (reading, scale, effective) == ("body", 1e-12, 1e-12) else 1e-12
    found = [float(value[0]) for value in rates_per_torque(s, t)]
    np.testing.assert_allclose(found, exact(s, reading, effective, Fraction(-1), Fraction(1)), rtol=rtol)
    coasting = [float(value[0]) for value in coasting_rates(s, t)]
    flow = (Fraction(float(torque[0])) for torque in (s.t_b, s.t_r))
    np.testing.assert_allclose(coasting, exact(s, reading, effective, *flow), rtol=10 * rtol)
