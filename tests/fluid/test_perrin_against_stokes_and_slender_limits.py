"""Perrin's spheroid against Stokes' sphere, the explicit prolate and oblate formulas, limits and a published table."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mpmath import mp, mpf

from spirillum.fluid.algebra import about_point
from spirillum.fluid.closed.perrin import body_axial, body_matrix, semi_axes, spheroid_drag
from spirillum.fluid.registry import find_model

MU = 3.5


def drag(a: float | np.ndarray, b: float | np.ndarray, mu: float = MU) -> np.ndarray:
    """(D_x, D_y, E_x, E_y) in rows."""
    one = np.ones(1)
    return np.array(np.broadcast_arrays(*spheroid_drag(mu * one, a * one, b * one)))


def prolate(a: float, b: float) -> list[float]:
    """Explicit formulas (Perrin 1934; Kim and Karrila, Microhydrodynamics, table 3.4) with 40 digits."""
    with mp.workdps(40):
        A, e = mpf(a), mp.sqrt(1 - (mpf(b) / mpf(a)) ** 2)
        log = mp.log((1 + e) / (1 - e))
        force, torque = 6 * mp.pi * MU * A, 8 * mp.pi * MU * A**3
        return [
            float(force * mpf(8) / 3 * e**3 / (-2 * e + (1 + e**2) * log)),
            float(force * mpf(16) / 3 * e**3 / (2 * e + (3 * e**2 - 1) * log)),
            float(torque * mpf(4) / 3 * e**3 * (1 - e**2) / (2 * e - (1 - e**2) * log)),
            float(torque * mpf(4) / 3 * e**3 * (2 - e**2) / (-2 * e + (1 + e**2) * log)),
        ]


def oblate(a: float, b: float) -> list[float]:
    """Explicit formulas (Kim and Karrila, table 3.6); b is the larger semi-axis."""
    with mp.workdps(40):
        B, e = mpf(b), mp.sqrt(1 - (mpf(a) / mpf(b)) ** 2)
        root = mp.sqrt(1 - e**2)
        c = mp.acot(root / e)
        force, torque = 6 * mp.pi * MU * B, 8 * mp.pi * MU * B**3
        return [
            float(force * mpf(4) / 3 * e**3 / ((2 * e**2 - 1) * c + e * root)),
            float(force * mpf(8) / 3 * e**3 / ((2 * e**2 + 1) * c - e * root)),
            float(torque * mpf(2) / 3 * e**3 / (c - e * root)),
            float(torque * mpf(2) / 3 * e**3 * (2 - e**2) / (e * root - (1 - 2 * e**2) * c)),
        ]


@pytest.mark.parametrize("radius", [1e-6, 9e-3, 1.0])
def test_sphere(radius: float) -> None:
    """Stokes: 6 pi mu a and 8 pi mu a^3."""
    force, torque = 6 * np.pi * MU * radius, 8 * np.pi * MU * radius**3
    np.testing.assert_allclose(drag(radius, radius)[:, 0], [force, force, torque, torque], rtol=1e-14)


@pytest.mark.parametrize("aspect", [1.0001, 1.05, 35 / 18, 5.0, 40.0, 1e4])
def test_prolate(aspect: float) -> None:
    np.testing.assert_allclose(drag(aspect * 2e-3, 2e-3)[:, 0], prolate(aspect * 2e-3, 2e-3), rtol=1e-11)


@pytest.mark.parametrize("aspect", [0.9999, 0.95, 0.5, 0.1, 1e-3])
def test_oblate(aspect: float) -> None:
    np.testing.assert_allclose(drag(aspect * 2e-3, 2e-3)[:, 0], oblate(aspect * 2e-3, 2e-3), rtol=1e-11)


def test_slender_limit() -> None:
    """4 pi mu a/(L - 1/2), 8 pi mu a/(L + 1/2), 16/3 pi mu a b^2, 8/3 pi mu a^3/(L - 1/2) with L = log(2 a/b)."""
    a, b = 1.0, 10.0 ** -np.arange(1.0, 5.0)
    log = np.log(2 * a / b)
    limits = (
        np.pi * MU * np.array([4 * a / (log - 0.5), 8 * a / (log + 0.5), 16 / 3 * a * b**2, 8 / 3 * a**3 / (log - 0.5)])
    )
    errors = np.abs(drag(a, b) / limits - 1)
    assert np.all(errors[:, -1] < 1e-6)
    # The next term is (b/a)^2 log(a/b): two decades in the error for one in b, less a logarithm.
    rates = np.log10(errors[:, :2] / errors[:, 1:3])
    np.testing.assert_allclose(rates, 2.0, atol=0.4)


def test_disk_limit() -> None:
    """16 mu b broadside, 32/3 mu b edgewise, 32/3 mu b^3 about every axis; linear in the thickness."""
    b, thickness = 1.0, np.array([1e-2, 1e-3, 1e-4])
    limits = MU * np.array([16 * b, 32 / 3 * b, 32 / 3 * b**3, 32 / 3 * b**3])[:, None]
    errors = np.abs(drag(thickness, b) / limits - 1)
    assert np.all(errors[:, -1] < 2e-4)
    # Broadside and about a diameter the first correction is of second order.
    rates = np.log10(errors[:, :-1] / errors[:, 1:])
    np.testing.assert_allclose(rates, np.array([[2.0], [1.0], [1.0], [2.0]]) * np.ones(2), atol=0.05)


# Strakl et al., J. Mar. Sci. Eng. 10:369 (2022), boundary elements: the ratio a/c of the semi-axes, and coefficients in
# F = pi mu c K U, T = pi mu c^3 Omega omega, along and across the long axis.
STRAKL = [
    (0.2, 2.1358, 2.8401, 0.2219, 1.4663),
    (0.4, 3.1295, 3.7332, 0.9777, 2.4008),
    (0.6, 4.0879, 4.5242, 2.4122, 3.6824),
    (0.8, 5.0403, 5.2697, 4.6769, 5.4666),
]


@pytest.mark.parametrize("row", STRAKL, ids=lambda row: f"{row[0]:g}")
def test_published_boundary_element_table(row: tuple[float, ...]) -> None:
    """The table's forces are up to 0.3 % low, its torques up to 2 %."""
    ratio, *table = row
    found = drag(1.0, ratio, mu=1 / np.pi)[:, 0]
    np.testing.assert_allclose(found[:2], table[:2], rtol=4e-3)
    np.testing.assert_allclose(found[2:], table[2:], rtol=2.1e-2)


@given(a=st.floats(1e-4, 1e2), b=st.floats(1e-4, 1e2), s=st.floats(1e-3, 1e3))
def test_scale_and_order(a: float, b: float, s: float) -> None:
    """Forces scale with length, torques with its cube; a spheroid lies between its inner and its outer sphere."""
    small, large = drag(a, b)[:, 0], drag(s * a, s * b)[:, 0]
    np.testing.assert_allclose(large, small * [s, s, s**3, s**3], rtol=1e-12)
    inner, outer = min(a, b), max(a, b)
    unit = np.array([6 * np.pi * MU, 6 * np.pi * MU, 8 * np.pi * MU, 8 * np.pi * MU])
    power = np.array([1, 1, 3, 3])
    assert np.all(small >= unit * inner**power * (1 - 1e-12))
    assert np.all(small <= unit * outer**power * (1 + 1e-12))


def test_body_of_the_paper(wide: Any) -> None:
    """Inscribed spheroid: 17.5 mm by 9 mm."""
    found = body_matrix(wide)[0]
    np.testing.assert_allclose(np.diag(found)[[0, 1, 3, 4]], prolate(17.5e-3, 9e-3), rtol=1e-11)
    np.testing.assert_array_equal(found, np.diag(np.diag(found)))
    assert found[1, 1] == found[2, 2]
    assert found[4, 4] == found[5, 5]
    np.testing.assert_array_equal(np.ravel(body_axial(wide)), [found[0, 0], found[3, 3]])
    np.testing.assert_array_equal(find_model("perrin").part_matrix(wide, "body", np.zeros(1))[0], found)


def test_spheroid_of_equal_volume(batch_of: Callable[..., Any]) -> None:
    """The spheroid has the capsule's length and volume: 4/3 pi a b^2 = 2/3 pi r^3 + pi r^2 h."""
    batch = batch_of(model__perrin__spheroid="equal-volume")
    volume = 2 / 3 * np.pi * 9e-3**3 + np.pi * 9e-3**2 * 26e-3
    a, b = semi_axes(batch)
    assert a[0] == 17.5e-3
    assert 4 / 3 * np.pi * a[0] * b[0] ** 2 == pytest.approx(volume, rel=1e-13)
    # "Equal volume: 11 % more drag".
    inscribed = prolate(17.5e-3, 9e-3)[0]
    assert 1.05 < body_axial(batch)[0][0] / inscribed < 1.16


@given(
    aspect=st.floats(0.05, 20),
    x=st.floats(-0.1, 0.1),
    y=st.floats(-0.1, 0.1),
    z=st.floats(-0.1, 0.1),
)
def test_reciprocity_of_a_shift(aspect: float, x: float, y: float, z: float) -> None:
    """About any point the matrix stays symmetric positive definite; G of (16) is D times the offset."""
    D_x, D_y, E_x, E_y = drag(aspect * 0.01, 0.01)[:, 0]
    matrix = np.diag([D_x, D_y, D_y, E_x, E_y, E_y])[None]
    moved = about_point(matrix, np.array([x, y, z]))[0]
    np.testing.assert_allclose(moved, moved.T, atol=1e-12 * np.abs(moved).max())
    np.linalg.cholesky(moved)
    np.testing.assert_array_equal(moved[:3, :3], matrix[0, :3, :3])
    # Turning about z, at the new point, moves the centre (at -x, -y, -z from it) with (y, -x, 0).
    np.testing.assert_allclose(moved[:3, 5], [D_x * y, -D_y * x, 0], atol=1e-15)
    assert moved[5, 5] == pytest.approx(E_y + D_x * y**2 + D_y * x**2, rel=1e-12)
