"""Friction far above or below the fluid's torques: what cancels must not take digits along."""

from fractions import Fraction

import numpy as np
import pytest

from spirillum.motion.balance import TorqueBalance, friction_torques, rates_per_torque

FLUID = {"bb": 1.01e-4, "br": -3.0e-7, "rb": -3.0e-7, "rr": 6.0e-6}
ROTOR = 7e-7


def exact(s: TorqueBalance, reading: str, effective: float) -> tuple[float, float]:
    """Both rates per joint torque in rational arithmetic."""
    b, b_m, zero = Fraction(effective), Fraction(ROTOR), Fraction(0)
    friction = {
        "none": (zero, zero, zero, zero),
        "rotor": (b, -b, -b, b),
        "body": (b_m + b, -b_m, -b_m, b_m),
        "paper": (zero, zero, -b, b),
    }[reading]
    bb, br, rb, rr = (Fraction(float(fluid[0])) + own for fluid, own in zip(s[:4], friction, strict=True))
    determinant = bb * rr - br * rb
    return float(-(rr + br) / determinant), float((bb + rb) / determinant)


@pytest.mark.parametrize("reading", ["none", "rotor", "body", "paper"])
@pytest.mark.parametrize("effective", [1e-12, 1e-6, 1.0, 1e3, 1e6])
@pytest.mark.parametrize("scale", [1.0, 1e-12])
def test_against_rational_arithmetic(reading: str, effective: float, scale: float) -> None:
    entries = {name: np.array([value * scale]) for name, value in FLUID.items()}
    s = TorqueBalance(**entries, u_b=np.zeros(1), u_r=np.zeros(1))
    t = friction_torques(reading, np.array([effective]), np.array([ROTOR]))
    found = [float(value[0]) for value in rates_per_torque(s, t)]
    # `body`: its sum B_m + B is rounded before the fluid's torque is added.
    rtol = 1e-9 if (reading, scale, effective) == ("body", 1e-12, 1e-12) else 1e-12
    np.testing.assert_allclose(found, exact(s, reading, effective), rtol=rtol)
