"""Waves from amplitudes against the wall's reflection operator, Stokes' equations, and a force's pressure rise."""

import numpy as np
import pytest
from scipy.special import k0e, k1e

from spirillum.fluid.tube.wall import point_reflection, waves_between
from spirillum.kernels.core import add_waves, wave_amplitudes

R = 0.02
RNG = np.random.default_rng(4)


def inside(count: int, reach: float, nearest: float = 0.004) -> np.ndarray:
    rho, angle = (R - nearest) * np.sqrt(RNG.uniform(0, 1, count)), RNG.uniform(-np.pi, np.pi, count)
    return np.stack([RNG.uniform(-reach, reach, count), rho * np.cos(angle), rho * np.sin(angle)], axis=1)


def reflected(
    points: np.ndarray, sources: np.ndarray, forces: np.ndarray, *, steepest: float = 1e9, reach: float = 0.06
) -> np.ndarray:
    waves = waves_between(R, reach, 0.004, 1e-5)
    orders = np.array(waves.orders)
    rho, angle = np.hypot(sources[:, 1], sources[:, 2]), np.arctan2(sources[:, 2], sources[:, 1])
    c, s = np.cos(angle), np.sin(angle)
    parts = np.stack([forces[:, 0], forces[:, 1] * c + forces[:, 2] * s, forces[:, 2] * c - forces[:, 1] * s], axis=1)
    steps = np.zeros((orders.size, orders.max()))
    amplitudes = np.zeros((orders.size, 2, 2, orders.max(), 3))
    z = waves.k * R
    wave_amplitudes(
        waves.k,
        waves.weight,
        orders,
        k1e(z) / k0e(z),
        R,
        rho,
        angle,
        np.full(len(rho), 1e9),
        np.arange(len(rho) + 1),
        sources[:, 0].copy(),
        np.stack([parts, parts], axis=1),
        steps,
        amplitudes,
    )
    field = np.zeros((len(points), 4))
    add_waves(points, np.full(len(points), steepest), waves.k, orders, R, steps, amplitudes, field)
    return field


def test_velocities_are_those_of_the_operator() -> None:
    points, forces = inside(12, 0.03), RNG.normal(size=(12, 3))
    operator = point_reflection(points, waves_between(R, 0.06, 0.004, 1e-5))
    wanted = -(operator @ forces.ravel()).reshape(-1, 3)
    np.testing.assert_allclose(reflected(points, points, forces)[:, :3], wanted, atol=1e-10 * np.abs(wanted).max())


def test_columns_of_sources_are_sources() -> None:
    """Two forces one behind the other, as one column and as two."""
    points, sources, forces = inside(6, 0.03), inside(2, 0.03), RNG.normal(size=(2, 3))
    sources[1, 1:] = sources[0, 1:]
    single = reflected(points, sources, forces)
    np.testing.assert_allclose(
        single,
        reflected(points, sources[:1], forces[:1]) + reflected(points, sources[1:], forces[1:]),
        atol=1e-12 * np.abs(single).max(),
    )


def test_waves_obey_the_stokes_equations() -> None:
    """No divergence, and the Laplacian of u is the gradient of p (viscosity 1), wave by wave."""
    points, h = inside(20, 0.03), 2e-4
    sources, forces = inside(3, 0.03), RNG.normal(size=(3, 3))
    offsets = np.array([-2, -1, 0, 1, 2]) * h
    grid = points[:, None, None] + offsets[None, None, :, None] * np.eye(3)[None, :, None]
    found = reflected(grid.reshape(-1, 3), sources, forces).reshape(len(points), 3, 5, 4)
    slope = np.einsum("ndoc,o->ndc", found, np.array([1, -8, 0, 8, -1]) / (12 * h))
    bend = np.einsum("ndoc,o->nc", found, np.array([-1, 16, -30, 16, -1]) / (12 * h**2))
    size = np.abs(slope[..., :3]).max()
    assert np.abs(np.trace(slope[..., :3], axis1=1, axis2=2)).max() < 1e-6 * size
    np.testing.assert_allclose(bend[:, :3], slope[..., 3], atol=1e-4 * np.abs(slope[..., 3]).max())


@pytest.mark.parametrize("place", [0.0, 0.5])
def test_a_force_raises_the_pressure_by_its_share_of_the_section(place: float) -> None:
    """Reciprocal theorem: pi R^2 (p ahead - p behind) = F (2 - 2 rho^2/R^2); here p is 8 pi times that."""
    source = np.array([[0.0, place * R, 0.0]])
    ends = np.array([[x, 0.3 * R, 0.0] for x in (0.09, 0.12, -0.09, -0.12)])
    found = reflected(ends, source, np.array([[1.0, 0.0, 0.0]]), reach=0.26)[:, 3]
    r = ends - source
    found = found + 2.0 * r[:, 0] / np.linalg.norm(r, axis=1) ** 3  # what the force itself exerts
    rise = 8.0 * np.pi * (2.0 - 2.0 * place**2) / (np.pi * R**2)
    np.testing.assert_allclose(found, 0.5 * rise * np.array([1, 1, -1, -1]), rtol=2e-4)
