"""Ring modes of the Stokeslet against quadrature over the angle, Legendre functions and exchange of the rings."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mpmath import mp, mpf
from scipy.special import ellipe, ellipk

from spirillum.kernels.core import ring_blocks, ring_integrals

MODES = 12
# dx, rho of the target, rho of the source, blob radius.
APART = [
    (0.7, 1.0, 0.4, 0.0),
    (-3.0, 1.0, 2.0, 0.0),
    (0.0, 1.0, 1.3, 0.0),
    (0.3, 0.02, 1.1, 0.0),
    (0.4, 0.9, 1e-5, 0.2),
    (200.0, 1.0, 3.0, 0.0),
    (0.2, 1.0, 50.0, 0.1),
    (0.0, 1.0, 1.0, 0.3),
]
CLOSE = [
    (1e-3, 1.0, 1.0, 0.0),
    (-1e-6, 2.0, 2.0 + 1e-6, 0.0),
    (0.0, 1.0, 1.0 - 1e-9, 0.0),
    (2e-4, 0.1, 0.1, 3e-4),
    (0.0, 1.0, 1.0, 1e-5),
    (1e-3, 1e-3, 2e-3, 0.0),
]


def modes_of(dx: float, rho: float, rho_s: float, blob: float, modes: int = MODES) -> np.ndarray:
    blocks = np.empty((modes, 1, 3, 1, 3))
    ring_blocks(*np.array([[dx], [rho], [0.0], [rho_s]]), blob**2, blocks)
    return blocks.reshape(modes, 3, 3)


def by_quadrature(dx: float, rho: float, rho_s: float, blob: float, modes: int = MODES) -> np.ndarray:
    """Velocity at angle 0 from forces (1, 1, i) exp(i m phi): Gauss pieces that halve towards the closest point."""
    nodes, weights = np.polynomial.legendre.leggauss(40)
    edges = np.pi * np.concatenate([[0.0], 2.0 ** -np.arange(40.0, -1.0, -1.0)])
    half = 0.5 * np.diff(edges)[:, None]
    phi = (edges[:-1, None] + half * (1 + nodes)).ravel()
    weight = (half * weights).ravel()
    total = np.zeros((modes, 3, 3), complex)
    for angle in (phi, -phi):
        cos, sin, versine = np.cos(angle), np.sin(angle), 2 * np.sin(0.5 * angle) ** 2
        x = np.stack([dx + 0 * angle, rho - rho_s + rho_s * versine, -rho_s * sin])
        r = np.sqrt(np.sum(x[:1] ** 2, axis=0) + (rho - rho_s) ** 2 + 2 * rho * rho_s * versine + blob**2)
        kernel = (1 / r + blob**2 / r**3) * np.eye(3)[:, :, None] + x[:, None] * x[None] / r**3
        zero, one = np.zeros_like(cos), np.ones_like(cos)
        frame = np.array([[one, zero, zero], [zero, cos, -sin], [zero, sin, cos]])  # columns e_x, e_rho, e_theta
        turned = np.einsum("ijn,jkn->ikn", kernel, frame) * weight
        total += np.einsum("ikn,mn->mik", turned, np.exp(1j * np.arange(modes)[:, None] * angle))
    phase = np.array([1, 1, 1j])
    found = total * phase[None, None, :] / phase[None, :, None]
    assert np.max(np.abs(found.imag)) <= 1e-12 * np.max(np.abs(found))
    return found.real


@pytest.mark.parametrize("case", APART + CLOSE, ids=str)
def test_modes(case: tuple[float, float, float, float]) -> None:
    """All blocks to rounding, relative to the largest entry of mode 0."""
    found, wanted = modes_of(*case), by_quadrature(*case)
    np.testing.assert_allclose(found, wanted, rtol=0, atol=2e-13 * np.max(np.abs(wanted)))


@pytest.mark.parametrize("case", APART + CLOSE, ids=str)
def test_exchange_of_the_rings(case: tuple[float, float, float, float]) -> None:
    """Reciprocity: the block back is the transposed one, mode by mode, to relative accuracy in each mode."""
    dx, rho, rho_s, blob = case
    there, back = modes_of(dx, rho, rho_s, blob), modes_of(-dx, rho_s, rho, blob)
    scale = np.max(np.abs(there), axis=(1, 2), keepdims=True)
    np.testing.assert_array_less(np.abs(there - back.swapaxes(1, 2)) / scale, 1e-12)


@settings(max_examples=40)
@given(
    dx=st.floats(-3, 3),
    rho=st.floats(-3, 0.5).map(lambda power: 10.0**power),
    rho_s=st.floats(-3, 0.5).map(lambda power: 10.0**power),
    gap=st.floats(-8, 0).map(lambda power: 10.0**power),
    blob=st.sampled_from([0.0, 1e-3, 0.1]),
)
def test_modes_of_any_rings(dx: float, rho: float, rho_s: float, gap: float, blob: float) -> None:
    for case in ((dx, rho, rho_s, blob), (gap * rho * dx, rho, rho * (1 + gap), blob)):
        if case[0] ** 2 + (case[1] - case[2]) ** 2 + blob**2 == 0:
            continue
        found, wanted = modes_of(*case), by_quadrature(*case)
        np.testing.assert_allclose(found, wanted, rtol=0, atol=5e-13 * np.max(np.abs(wanted)))


@pytest.mark.parametrize(("rho", "rho_s"), [(0.0, 0.8), (0.8, 0.0), (0.0, 0.0)])
@pytest.mark.parametrize("blob", [0.0, 0.2])
def test_ring_shrunk_to_the_axis(rho: float, rho_s: float, blob: float) -> None:
    """On the axis a mode above the second sends nothing, and u_rho + i u_theta of mode 1 is one vector."""
    found, wanted = modes_of(0.6, rho, rho_s, blob), by_quadrature(0.6, rho, rho_s, blob)
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-12 * np.max(np.abs(wanted)))
    assert np.max(np.abs(found[3:])) < 1e-12


def integrals(dx: float, rho: float, rho_s: float, blob: float, count: int) -> tuple[np.ndarray, np.ndarray]:
    a, b = np.empty(count), np.empty(count)
    ring_integrals(dx, rho - rho_s, rho, rho_s, blob**2, a, b)
    return a, b


@pytest.mark.parametrize(
    "case", [(1e-6, 1.0, 1.0, 0.0), (1e-2, 1.0, 1.02, 0.0), (0.5, 1.0, 0.7, 0.1), (4.0, 1.0, 0.3, 0.0)], ids=str
)
def test_integrals_against_legendre_functions(case: tuple[float, float, float, float]) -> None:
    """A_n = 2 Q_{n-1/2}(chi)/sqrt(rho rho'), B_n = -2 dA_n/d(near^2), each to relative accuracy (DLMF 14.19)."""
    dx, rho, rho_s, blob = case
    a, b = integrals(*case, 30)
    with mp.workdps(60):
        p = mpf(rho) * mpf(rho_s)
        near2 = mpf(dx) ** 2 + (mpf(rho) - mpf(rho_s)) ** 2 + mpf(blob) ** 2
        chi = 1 + near2 / (2 * p)
        for n in (0, 1, 2, 7, 29):
            q, before = (mp.re(mp.legenq(n + half, 0, chi, type=3)) for half in (mpf(-0.5), mpf(-1.5)))
            slope = (n - mpf(0.5)) * (chi * q - before) / (chi**2 - 1)
            assert a[n] == pytest.approx(float(2 * q / mp.sqrt(p)), rel=1e-12)
            assert b[n] == pytest.approx(float(-2 * slope / p ** mpf(1.5)), rel=1e-11)


@given(dx=st.floats(0.01, 5), rho=st.floats(0.01, 5), rho_s=st.floats(0.01, 5))
def test_integrals_against_elliptic_integrals(dx: float, rho: float, rho_s: float) -> None:
    """A_0 = 4 K/far, B_0 = 4 E/(far near^2)."""
    far2, near2 = dx**2 + (rho + rho_s) ** 2, dx**2 + (rho - rho_s) ** 2
    parameter = 4 * rho * rho_s / far2
    a, b = integrals(dx, rho, rho_s, 0.0, 2)
    assert a[0] == pytest.approx(4 * ellipk(parameter) / np.sqrt(far2), rel=1e-10)
    assert b[0] == pytest.approx(4 * ellipe(parameter) / np.sqrt(far2) / near2, rel=1e-10)


@pytest.mark.parametrize("count", [2, 3, 10, 60])
@pytest.mark.parametrize("dx", [1e-5, 0.01, 0.1, 1.0, 30.0])
def test_recurrences_give_what_they_give_with_more_modes(dx: float, count: int) -> None:
    """Forward and backward recurrence meet."""
    few, many = integrals(dx, 1.0, 1.01, 0.0, count), integrals(dx, 1.0, 1.01, 0.0, 90)
    for short, long in zip(few, many, strict=True):
        np.testing.assert_allclose(short, long[:count], rtol=1e-10)


def test_blocks_of_rings_are_the_modes_of_each_pair() -> None:
    x, rho = np.array([0.0, 1.0, 2.5]), np.array([1.0, 0.5, 0.2])
    x_s, rho_s = np.array([-0.3, 4.0]), np.array([0.9, 0.7])
    blocks = np.empty((4, 3, 3, 2, 3))
    ring_blocks(x, rho, x_s, rho_s, 0.01, blocks)
    np.testing.assert_array_equal(blocks[:, 2, :, 1], modes_of(x[2] - x_s[1], rho[2], rho_s[1], 0.1, 4))
