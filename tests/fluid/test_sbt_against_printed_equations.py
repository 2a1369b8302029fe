"""The resistance block and the force balance against eqs (1) to (7), typed out as the paper prints them.

Reading of the symbols: L_t in (2), (4), (5) is the wire's arc length, k L_t in (6) is 2 pi times the turns, D_x in (4)
and (5) is relative to 3 pi mu D_b, E_x in (2) is dimensional, and (2) gives a magnitude: the body turns back.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pytest

from spirillum.fluid.closed.sbt import helix_functions, lighthill_integrals
from spirillum.swimming.steady import swim

MU, BODY_DIAMETER, BODY_LENGTH, TAIL_LENGTH = 3.5, 18e-3, 35e-3, 60e-3  # Table I
WIRE = 1e-3  # Table I
OMEGA = 2 * np.pi * 1.3


class Printed(NamedTuple):
    speed: float
    body_rate: float
    chi: float
    Psi: float
    psi: float


def perrin_prolate(a: float, b: float) -> tuple[float, float]:
    """D_x and E_x of a prolate spheroid (Happel and Brenner, section 5-11), dimensional."""
    e = np.sqrt(1 - (b / a) ** 2)
    log = np.log((1 + e) / (1 - e))
    drag = 16 * np.pi * MU * a * e**3 / ((1 + e**2) * log - 2 * e)
    rotation = 32 / 3 * np.pi * MU * a**3 * e**3 * (1 - e**2) / (2 * e - (1 - e**2) * log)
    return drag, rotation


def printed_equations(wavelength: float, B_o: float, eps_constant: float, f_drag: float, f_rotation: float) -> Printed:
    """Eqs (1) to (7)."""
    alpha = 1 / np.sqrt(1 + (2 * np.pi * B_o / wavelength) ** 2)
    A1, A2, A3 = (float(value[0]) for value in lighthill_integrals(np.array([alpha])))
    eps = eps_constant * alpha * WIRE / wavelength
    D_x, E_x = perrin_prolate(BODY_LENGTH / 2, BODY_DIAMETER / 2)
    D_x, E_x = f_drag * D_x / (3 * np.pi * MU * BODY_DIAMETER), f_rotation * E_x
    L_t = TAIL_LENGTH / alpha
    kL_t = 2 * np.pi * TAIL_LENGTH / wavelength
    chi = 1 / (-(1 - alpha**2) - (2 - alpha**2) * np.log(eps) + alpha**2 * A1 + 2 * (1 - alpha**2) * A2)  # (3)
    Psi = 1.5 * (
        2
        - alpha**2
        - 3 / alpha
        + 2 / alpha * np.log(kL_t)
        - (1 + alpha**2) * np.log(eps)
        - 2 * A3
        - (1 - alpha**2) * A1
    )  # (6)
    psi = Psi - 1.5 * alpha**2 * (1 - alpha**2) * (-1 - np.log(eps) + A1) ** 2 * chi  # (7)
    C_U = 1 / (1 + 0.5 * D_x * psi * BODY_DIAMETER / L_t)  # (4)
    C_Omega = (1 + 0.5 * D_x * Psi * BODY_DIAMETER / L_t) * C_U  # (5)
    U = wavelength * C_U * (1 - alpha**2) * (-1 - np.log(eps) + A1) * chi * OMEGA / (2 * np.pi)  # (1)
    Omega = 4 * np.pi * MU * B_o**2 * OMEGA * chi * C_Omega * L_t / E_x  # (2)
    return Printed(U, Omega, chi, Psi, psi)


TAILS = [(25e-3, 2.5e-3), (10e-3, 3.5e-3), (20e-3, 1.5e-3), (10e-3, 1.5e-3), (60e-3, 1e-3)]


def robot(batch_of: Callable[..., Any], wavelength: float, amplitude: float, **more: Any) -> Any:
    return batch_of(tail__wavelength=f"{wavelength!r} m", tail__amplitude=f"{amplitude!r} m", **more)


@pytest.mark.parametrize(("wavelength", "amplitude"), TAILS)
@pytest.mark.parametrize(("choice", "constant"), [("printed", 2.6), ("exact", np.pi * np.sqrt(np.e) / 2)])
@pytest.mark.parametrize("hand", ["right", "left"])
def test_uncalibrated(
    batch_of: Callable[..., Any], wavelength: float, amplitude: float, choice: str, constant: float, hand: str
) -> None:
    paper = printed_equations(wavelength, amplitude, constant, 1.0, 1.0)
    batch = robot(batch_of, wavelength, amplitude, model__sbt__eps_constant=choice, tail__handedness=hand)
    sign = 1.0 if hand == "right" else -1.0
    swimming = swim(batch, "sbt", tail_rate=np.array([sign * OMEGA]), friction="none", calibrated=False)
    assert swimming.forward_velocity[0] == pytest.approx(paper.speed, rel=1e-12)
    assert swimming.body_rotation_rate[0] == pytest.approx(-sign * paper.body_rate, rel=1e-12)
    functions = helix_functions(batch)
    assert 1 / functions.torque[0] == pytest.approx(paper.chi, rel=1e-12)
    assert functions.Psi[0] == pytest.approx(paper.Psi, rel=1e-12)
    assert functions.psi[0] == pytest.approx(paper.psi, rel=1e-12)


@pytest.mark.parametrize(("wavelength", "amplitude"), TAILS)
@pytest.mark.parametrize(("preset", "drag_factor"), [("biorob2012-wide", 1.95), ("biorob2012-narrow", 3.6)])
def test_calibrated_with_table_iii(
    batch_of: Callable[..., Any], wavelength: float, amplitude: float, preset: str, drag_factor: float
) -> None:
    """Table III: 1.95 D_x (wide), 3.6 D_x (narrow), 0.6 E_x in both, for the SBT model."""
    paper = printed_equations(wavelength, amplitude, 2.6, drag_factor, 0.6)
    batch = robot(batch_of, wavelength, amplitude, preset=preset)
    swimming = swim(batch, "sbt", tail_rate=np.array([OMEGA]), friction="none")
    assert swimming.forward_velocity[0] == pytest.approx(paper.speed, rel=1e-12)
    assert swimming.body_rotation_rate[0] == pytest.approx(-paper.body_rate, rel=1e-12)


def test_relative_drag_coefficient_matters() -> None:
    """Guards the reading: D_x in SI, put into (4), would give another speed altogether."""
    paper = printed_equations(25e-3, 2.5e-3, 2.6, 1.0, 1.0)
    as_si = printed_equations(25e-3, 2.5e-3, 2.6, 3 * np.pi * MU * BODY_DIAMETER, 1.0)
    assert abs(as_si.speed / paper.speed - 1) > 0.1


@pytest.mark.parametrize("amplitude", [1.5e-3, 2.5e-3, 3.5e-3])
def test_spin_of_the_wire_adds_to_the_rotation_alone(batch_of: Callable[..., Any], amplitude: float) -> None:
    """4 pi mu a^2 (dx/ds)^2 per arc length."""
    from spirillum.fluid.closed.sbt import tail_axial

    without = tail_axial(robot(batch_of, 25e-3, amplitude))
    batch = robot(batch_of, 25e-3, amplitude, model__sbt__spin=True)
    with_spin = tail_axial(batch)
    alpha = 1 / np.sqrt(1 + (2 * np.pi * amplitude / 25e-3) ** 2)
    spin = 4 * np.pi * MU * (WIRE / 2) ** 2 * alpha**2 * (TAIL_LENGTH / alpha)
    assert with_spin[0] == without[0]
    assert with_spin[1] == without[1]
    assert with_spin[2] - without[2] == pytest.approx(spin, rel=1e-9)


@pytest.mark.parametrize("hand", ["right", "left"])
def test_block_is_symmetric_positive_definite_and_known_only_along_the_axis(
    batch_of: Callable[..., Any], hand: str
) -> None:
    from spirillum.fluid.closed.sbt import Sbt
    from spirillum.fluid.registry import find_model

    batch = batch_of(tail__handedness=hand)
    axial = Sbt().axial(batch)[0]
    np.testing.assert_array_equal(axial, axial.T)
    np.linalg.cholesky(axial)
    assert np.sign(axial[2, 3]) == (-1 if hand == "right" else 1)
    whole = Sbt().resistance(batch, np.zeros(1))[0]
    known = np.ix_([0, 3, 6, 9], [0, 3, 6, 9])
    np.testing.assert_array_equal(whole[known], axial)
    assert np.isfinite(whole).sum() == 16
    tail = find_model("sbt").part_matrix(batch, "tail", np.zeros(1))[0]
    body = find_model("sbt").part_matrix(batch, "body", np.zeros(1))[0]
    both = find_model("sbt").part_matrix(batch, "robot", np.zeros(1))[0]
    entries = np.ix_([0, 3], [0, 3])
    np.testing.assert_array_equal(tail[entries], axial[2:, 2:])
    np.testing.assert_array_equal(body[entries], axial[:2, :2])
    np.testing.assert_allclose(both[entries], axial[:2, :2] + axial[2:, 2:], rtol=1e-15)
