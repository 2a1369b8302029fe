"""Waves in a tube against the equations of Stokes, closed forms, ring kernels and the plane wall."""

from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.special import ive, k0e, k1e

from spirillum.kernels.core import (
    circle_waves,
    point_waves,
    ring_blocks,
    ring_waves,
    single_point_waves,
    single_ring_waves,
    subtract_block,
    wall_layers,
    wave_extensions,
)

WAVES = [(0.3, 0), (2.0, 0), (1.0, 1), (3.0, 1), (0.5, 2), (2.0, 5)]
"""k R and order p."""


def extensions(k: float, rho: np.ndarray, orders: int, radius: float = 1.0) -> np.ndarray:
    rho = np.asarray(rho, dtype=float)
    out = np.empty((rho.size, orders, 3, 3))
    wave_extensions(k, radius, rho, out)
    return out


def layers(z: float, orders: int) -> np.ndarray:
    out = np.empty((orders, 3, 3))
    wall_layers(z, float(k1e(z) / k0e(z)), out)
    return out


def wave(k: float, p: int, points: np.ndarray, turn: float = 1.0) -> np.ndarray:
    """Complex velocities (x, y, z) at points of the waves with unit (X, u_rho, v) on the wall, (n, 3, 3).

    With `turn` -1 those that turn the other way, exp(-i p theta), with v reversed.
    """
    x, y, z = points.T
    rho, angle = np.hypot(y, z), np.arctan2(z, y)
    along, radial, around = np.moveaxis(extensions(k, rho, p + 1)[:, p], 1, 0)
    c, s = np.cos(angle)[:, None], np.sin(angle)[:, None]
    cartesian = np.stack([1j * along, radial * c - 1j * turn * around * s, radial * s + 1j * turn * around * c], axis=1)
    return np.exp(1j * (k * x + turn * p * angle))[:, None, None] * cartesian


@settings(max_examples=40)
@given(
    z=st.floats(-5, 2.5).map(lambda power: 10.0**power),
    radius=st.floats(-3, 3).map(lambda power: 10.0**power),
    orders=st.integers(1, 60),
)
def test_a_wave_is_its_own_velocity_on_the_wall(z: float, radius: float, orders: int) -> None:
    found = extensions(z / radius, np.array([radius]), orders, radius)[0]
    np.testing.assert_allclose(found, np.tile(np.eye(3), (orders, 1, 1)), atol=1e-10)


@pytest.mark.parametrize(("k", "p"), WAVES)
def test_the_equations_of_stokes(k: float, p: int) -> None:
    """div u = 0 and curl of the Laplacian of u = 0: both by polynomials through a small cube of points."""
    count, half = 10, 0.2
    nodes = np.cos(np.pi * np.arange(count) / (count - 1))
    weights = (-1.0) ** np.arange(count) * np.where(np.isin(np.arange(count), (0, count - 1)), 0.5, 1.0)
    slopes = weights[None, :] / weights[:, None] / (nodes[:, None] - nodes[None, :] + np.eye(count))
    np.fill_diagonal(slopes, 0.0)
    np.fill_diagonal(slopes, -slopes.sum(axis=1))
    slopes /= half
    grid = np.stack(np.meshgrid(nodes, nodes, nodes, indexing="ij"), axis=-1).reshape(-1, 3)
    points = np.array([0.7, 0.5, -0.3]) + half * grid
    u = wave(k, p, points).reshape(count, count, count, 3, 3)

    def along(axis: int, field: np.ndarray) -> np.ndarray:
        return np.moveaxis(np.tensordot(slopes, field, axes=(1, axis)), 0, axis)

    inner = (slice(3, -3),) * 3
    first = [along(axis, u) for axis in range(3)]
    divergence = sum(first[axis][..., axis, :] for axis in range(3))
    size = np.max(np.abs(first[0]) + np.abs(first[1]) + np.abs(first[2]))
    assert np.max(np.abs(divergence[inner])) < 1e-7 * size
    laplacian = sum(along(axis, first[axis]) for axis in range(3))
    curl = [along(a, laplacian)[..., b, :] - along(b, laplacian)[..., a, :] for a, b in ((1, 2), (2, 0), (0, 1))]
    slope = max(float(np.max(np.abs(along(a, laplacian)[inner]))) for a in range(3))
    assert slope > 1e-3 * size  # there is a pressure
    assert max(float(np.max(np.abs(part[inner]))) for part in curl) < 1e-4 * slope


@pytest.mark.parametrize("k", [1e-3, 0.1, 2.0, 40.0, 300.0])
def test_flux_and_torsion_without_turning_waves(k: float) -> None:
    """Order 0: what comes through the wall goes along the tube, and swirl is I_1(k rho)/I_1(k)."""
    nodes, weights = np.polynomial.legendre.leggauss(200)
    rho = 0.5 * (1.0 + nodes)
    found = extensions(k, rho, 1)[:, 0]
    flux = 0.5 * k * np.einsum("n,nj->j", weights * rho, found[:, 0])
    np.testing.assert_allclose(flux, [0.0, 1.0, 0.0], atol=1e-10)
    swirl = ive(1, k * rho) / ive(1, k) * np.exp(k * (rho - 1.0))
    np.testing.assert_allclose(found[:, 2, 2], swirl, rtol=1e-11, atol=1e-300)
    assert np.all(found[:, 2, :2] == 0)
    assert np.all(found[:, :2, 2] == 0)


def test_long_waves() -> None:
    """k to 0: a sliding wall drags the fluid with no net flux, 2 rho^2 - 1, and a wall that is carried along carries
    it whole; the difference falls off with k^2 log k."""
    rho = np.array([0.0, 0.3, 0.8])
    errors = []
    for k in (1e-2, 1e-3):
        found = extensions(k, rho, 2)
        whole = found[:, 1] @ np.array([0.0, 1.0, 1.0])
        errors.append([np.max(np.abs(found[:, 0, 0, 0] - 2 * rho**2 + 1)), np.max(np.abs(whole - [0, 1, 1]))])
    assert np.all(np.array(errors[1]) < 3e-3)
    assert np.all(np.array(errors[1]) < 0.15 * np.array(errors[0]))


@pytest.mark.parametrize("p", [0, 1, 3])
@pytest.mark.parametrize("k", [0.4, 2.5])
def test_layers_against_rings_of_forces(k: float, p: int) -> None:
    """S is the Fourier transform along the tube of the ring kernels on a cylinder of radius 1, over 4 pi."""
    blocks = np.empty((p + 1, 1, 3, 1, 3))

    def entry(i: int, j: int, dx: float) -> float:
        ring_blocks(*np.array([[dx], [1.0], [0.0], [1.0]]), 0.0, blocks)
        return float(blocks[p, 0, i, 0, j])

    def transform(i: int, j: int) -> complex:
        """Over all dx of the kernel times exp(-i k dx); entries between x and the others are odd."""
        odd = (i == 0) != (j == 0)
        turn = np.sin if odd else np.cos
        near = [
            quad(lambda dx: entry(i, j, dx) * turn(k * dx), low, high, limit=200)[0]
            for low, high in ((1e-14, 1e-3), (1e-3, 1.0))
        ]
        far = quad(partial(entry, i, j), 1.0, np.inf, weight="sin" if odd else "cos", wvar=k, limit=500)[0]
        return (-2j if odd else 2.0) * (sum(near) + far)

    phase = np.array([1j, 1.0, 1.0])
    whole = np.array([[transform(i, j) for j in range(3)] for i in range(3)])
    wanted = whole * phase[None, :] / phase[:, None] / (4 * np.pi)
    assert np.max(np.abs(wanted.imag)) < 1e-9
    np.testing.assert_allclose(layers(k, p + 1)[p], wanted.real, atol=2e-8)


@settings(max_examples=60)
@given(z=st.floats(-3, 2.7).map(lambda power: 10.0**power), orders=st.integers(1, 60))
def test_forces_on_the_wall_take_power(z: float, orders: int) -> None:
    """S is symmetric and positive definite, scaled by its diagonal."""
    found = layers(z, orders)
    np.testing.assert_array_equal(found, found.swapaxes(1, 2))
    diagonal = np.sqrt(np.diagonal(found, axis1=1, axis2=2))
    assert np.all(diagonal > 0)
    assert np.min(np.linalg.eigvalsh(found / (diagonal[:, :, None] * diagonal[:, None, :]))) > 0


def test_short_waves_see_a_plane() -> None:
    """The single layer of a plane, (1 - k k/2 q^2)/q along it and 1/2q across; curvature adds a part in q."""
    errors = []
    for z, p in ((60.0, 45), (120.0, 90), (240.0, 180)):
        q = np.hypot(z, p)
        wanted = np.diag([1 - 0.5 * (z / q) ** 2, 0.5, 1 - 0.5 * (p / q) ** 2])
        wanted[0, 2] = wanted[2, 0] = -0.5 * z * p / q**2
        errors.append(np.max(np.abs(q * layers(z, p + 1)[p] - wanted)))
    assert errors[0] < 0.02
    np.testing.assert_allclose(np.log2(np.array(errors[:-1]) / errors[1:]), 1.0, atol=0.1)


def test_waves_at_points_and_around_a_second_axis() -> None:
    """Real parts of the complex waves; the same in the components about an axis that lies off the tube's."""
    k, orders, rng = 1.3, 4, np.random.default_rng(2)
    theta, rho, x = rng.uniform(-np.pi, np.pi, 6), rng.uniform(0.05, 0.5, 6), rng.uniform(-2, 2, 6)
    y, z = rho * np.cos(theta) - 0.4, rho * np.sin(theta)
    points = np.stack([x, y, z], axis=1)
    waves = np.empty((orders, 2, 2, 3, 6, 3))
    point_waves(k, 1.0, points, 0, waves)
    some = np.empty((orders - 2, 2, 2, 3, 6, 3))  # the orders from 2
    point_waves(k, 1.0, points, 2, some)
    np.testing.assert_allclose(some, waves[2:], rtol=1e-12, atol=1e-15)
    single = np.empty(waves.shape, np.float32)
    single_point_waves(k, 1.0, points, 0, single)
    np.testing.assert_array_equal(single, waves.astype(np.float32))
    circle = np.empty((6, 2, 3, orders, 3))  # each point lies on a cylinder of its own
    for own, radius, angle in zip(circle, rho, theta, strict=True):
        circle_waves(k, 1.0, radius, 0.4, np.array([angle]), own[:, :, None])
    circle = np.moveaxis(circle, 0, 2)
    for p in range(orders):
        there, back = wave(k, p, points), wave(k, p, points, turn=-1.0)
        for parity, both in enumerate((0.5 * (there + back), 0.5j * (there - back))):  # cos(p theta), -sin(p theta)
            found = np.moveaxis(waves[p, parity], 1, -1)  # real, imaginary; point; component; wall component
            np.testing.assert_allclose(found, [both.real, both.imag], atol=1e-13)
            turn = both * np.exp(-1j * k * x)[:, None, None]
            c, s = np.cos(theta)[:, None], np.sin(theta)[:, None]
            about = np.stack([-1j * turn[:, 0], turn[:, 1] * c + turn[:, 2] * s, turn[:, 2] * c - turn[:, 1] * s])
            np.testing.assert_allclose(circle[parity][:, :, p], about.real, atol=1e-13)
            np.testing.assert_allclose(about.imag, 0.0, atol=1e-13)


def test_waves_on_rings_about_a_tilted_axis() -> None:
    """Components of the velocities at the same points along the unit vectors of the tilted cylinder."""
    k, orders, first, rng = 1.3, 5, 2, np.random.default_rng(3)
    theta, rings = rng.uniform(-np.pi, np.pi, 4), 3
    rotation = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    points = rng.uniform(-0.5, 0.5, (rings, 4, 3))
    at_points = np.empty((orders - first, 2, 2, 3, 4 * rings, 3))
    point_waves(k, 1.0, points.reshape(-1, 3), first, at_points)
    out = np.array([np.zeros(4), np.cos(theta), np.sin(theta)]), np.array([np.zeros(4), -np.sin(theta), np.cos(theta)])
    axes = rotation @ np.stack([np.tile([[1.0], [0.0], [0.0]], 4), *out])  # (component, xyz, angle)
    wanted = np.einsum("cxt,oprwntx->pcnorwt", axes, at_points.reshape(orders - first, 2, 2, 3, rings, 4, 3))
    found = np.empty(wanted.shape)
    ring_waves(k, 1.0, points, theta, rotation, first, found)
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-14 * np.abs(wanted).max())
    single = np.empty(wanted.shape, np.float32)
    single_ring_waves(k, 1.0, points, theta, rotation, first, single)
    np.testing.assert_array_equal(single, found.astype(np.float32))


@pytest.mark.parametrize("z", [0.1, 0.7, 15.0, 300.0, 4000.0])
def test_extensions_reach_from_the_axis_to_the_wall(z: float) -> None:
    """u_x of the wave of order 0 that is 1 in x on the wall, from SciPy's scaled Bessel functions."""
    rho = np.array([0.0, 0.3, 0.9, 1.0])
    ends = extensions(z, rho, 1)[:, 0, 0, 0]
    x, s = rho * z, ive(0, rho * z) * np.exp(z * (rho - 1.0))
    a = np.array([[ive(0, z), z * ive(1, z) + 2.0 * ive(0, z)], [ive(1, z), z * ive(0, z)]])
    first, second = np.linalg.solve(a, [1.0, 0.0])
    wanted = first * s + second * (x * ive(1, x) * np.exp(z * (rho - 1.0)) + 2.0 * s)
    np.testing.assert_allclose(ends, wanted, rtol=1e-9, atol=1e-300)


def test_blocks_are_subtracted_from_their_rows_and_columns() -> None:
    rng = np.random.default_rng(4)
    matrix, block, scale = rng.normal(size=(7, 7)), rng.normal(size=(3, 2)), rng.normal(size=7)
    rows, columns = np.array([0, 2, 5]), np.array([6, 1])
    wanted = matrix.copy()
    wanted[np.ix_(rows, columns)] -= block * scale[columns]
    found = np.asfortranarray(matrix)
    subtract_block(block.T, columns, rows, scale, found.T)
    np.testing.assert_allclose(found, wanted, rtol=1e-15)
