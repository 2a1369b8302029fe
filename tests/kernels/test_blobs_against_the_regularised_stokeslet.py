"""Sums of regularised Stokeslets against Cortez' closed forms, the Stokeslet, and the equations of Stokes flow."""

import numpy as np
import pytest

from spirillum.kernels.core import add_blobs, add_moments, force_matrix, moment_matrices


def kernel(x: np.ndarray, e: float) -> np.ndarray:
    """Cortez (SIAM J. Sci. Comput. 23:1204, 2001), in his own order of terms: r is the distance itself."""
    r = np.linalg.norm(x)
    big = np.sqrt(r**2 + e**2)
    return (np.eye(3) * (r**2 + 2 * e**2) + np.outer(x, x)) / big**3


def pressure_kernel(x: np.ndarray, e: float) -> np.ndarray:
    r = np.linalg.norm(x)
    return x * (2 * r**2 + 5 * e**2) / np.sqrt(r**2 + e**2) ** 5


@pytest.fixture(scope="module")
def cloud() -> np.ndarray:
    return np.random.default_rng(3).normal(size=(7, 3))


def test_matrix(cloud: np.ndarray) -> None:
    e2 = np.linspace(0.01, 0.3, len(cloud))
    matrix = np.empty((7, 3, 7, 3))
    force_matrix(cloud, e2, matrix)
    matrix = matrix.reshape(21, 21)
    np.testing.assert_array_equal(matrix, matrix.T)
    for i in range(len(cloud)):
        for j in range(len(cloud)):
            block = kernel(cloud[i] - cloud[j], np.sqrt(0.5 * (e2[i] + e2[j])))
            np.testing.assert_allclose(matrix[3 * i : 3 * i + 3, 3 * j : 3 * j + 3], block, rtol=1e-13, atol=1e-14)
    assert np.linalg.eigvalsh(matrix)[0] > 0


@pytest.mark.parametrize("e", [0.0, 0.3])
def test_velocity_and_pressure(cloud: np.ndarray, e: float) -> None:
    """A sum over sources; sums add to what is there."""
    sources, points = cloud[:4], cloud[4:]
    forces = np.random.default_rng(4).normal(size=sources.shape)
    field = np.ones((len(points), 4))
    add_blobs(points, sources, forces, np.full(len(sources), e**2), field)
    for i, point in enumerate(points):
        velocity = sum(kernel(point - s, e) @ f for s, f in zip(sources, forces, strict=True))
        pressure = sum(pressure_kernel(point - s, e) @ f for s, f in zip(sources, forces, strict=True))
        np.testing.assert_allclose(field[i] - 1, [*velocity, pressure], rtol=1e-12)


@pytest.mark.parametrize("e", [0.0, 0.3])
def test_pressure_belongs_to_the_velocity(cloud: np.ndarray, e: float) -> None:
    """Away from a Stokeslet mu lap u = grad p; a blob adds its force, 15 e^4/(8 pi r^7), to the balance."""
    force = np.array([[0.3, -1.0, 0.7]])
    h = 2e-3
    point = np.array([0.9, -0.4, 0.5])
    steps = np.concatenate([np.zeros((1, 3)), h * np.eye(3), -h * np.eye(3)])
    field = np.zeros((7, 4))
    add_blobs(point + steps, np.zeros((1, 3)), force, np.array([e**2]), field)
    laplacian = (field[1:, :3].sum(axis=0) - 6 * field[0, :3]) / h**2
    gradient = (field[1:4, 3] - field[4:, 3]) / (2 * h)
    divergence = np.trace(field[1:4, :3] - field[4:, :3]) / (2 * h)
    blob = 15 * e**4 / np.sqrt(point @ point + e**2) ** 7
    np.testing.assert_allclose(laplacian - gradient, -blob * force[0], atol=2e-5)  # of order h^2
    assert abs(divergence) < 2e-5


def test_flow_of_moments_against_differences_of_blobs(cloud: np.ndarray) -> None:
    """u = -m[b, k] d_k G[a, b], and the pressure alike, by central differences of displaced forces."""
    rng, h, e2 = np.random.default_rng(6), 1e-3, np.array([0.04, 0.09])
    sources, points, moments = cloud[:2], cloud[2:], rng.normal(size=(2, 3, 3))
    moments -= np.trace(moments, axis1=1, axis2=2)[:, None, None] * np.eye(3) / 3
    found, wanted = np.ones((5, 4)), np.zeros((5, 4))
    add_moments(points, sources, moments, e2, found)
    for k in range(3):
        for side in (1, -1):
            add_blobs(points, sources + side * h * np.eye(3)[k], side * moments[:, :, k] / (2 * h), e2, wanted)
    np.testing.assert_allclose(found - 1, wanted, rtol=0, atol=1e-5 * np.abs(wanted).max())


def test_moments_against_differences_of_the_kernel(cloud: np.ndarray) -> None:
    """Velocities -m[b, k] d_k G[a, b], and their gradients along the moments, by central differences."""
    n, q, h = 4, 2, 1e-3
    points, e2 = cloud[:n], np.linspace(0.2, 0.5, n)
    moments = np.random.default_rng(5).normal(size=(n, q, 3, 3))
    moments -= np.trace(moments, axis1=2, axis2=3)[:, :, None, None] * np.eye(3) / 3
    velocities, gradients = np.empty((n, 3, n, q)), np.empty((n, q, n, q))
    moment_matrices(points, e2, moments, velocities, gradients)
    velocities, gradients = velocities.reshape(3 * n, q * n), gradients.reshape(q * n, q * n)
    np.testing.assert_array_equal(gradients, gradients.T)
    steps = h * np.eye(3)
    for i in range(n):
        for j in range(n):
            x, e = points[i] - points[j], np.sqrt(0.5 * (e2[i] + e2[j]))
            slope = np.array([kernel(x + s, e) - kernel(x - s, e) for s in steps]) / (2 * h)
            second = np.array(
                [[kernel(x + s + t, e) - kernel(x + s - t, e) for s in steps] for t in steps]
                + [[kernel(x - s - t, e) - kernel(x - s + t, e) for s in steps] for t in steps]
            )
            second = (second[:3] + second[3:]) / (4 * h**2)
            u = -np.einsum("sbk,kab->as", moments[j], slope)
            g = -np.einsum("tal,lkab,sbk->ts", moments[i], second, moments[j])
            size = np.max(np.abs(kernel(np.zeros(3), 0.4)))
            np.testing.assert_allclose(velocities[3 * i : 3 * i + 3, q * j : q * j + q], u, atol=1e-4 * size)
            np.testing.assert_allclose(gradients[q * i : q * i + q, q * j : q * j + q], g, atol=2e-3 * size)
    assert np.linalg.eigvalsh(gradients)[0] > 0


def test_threads_share_the_points_and_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(3)
    points, sources, forces = (rng.normal(size=(count, 3)) for count in (41, 7, 7))
    fields = []
    for threads in (1, 3):
        monkeypatch.setattr("spirillum.kernels.native._THREADS", threads)
        fields.append(np.zeros((41, 4)))
        add_blobs(points, sources, forces, np.full(7, 0.01), fields[-1])
    np.testing.assert_array_equal(*fields)
    assert np.all(fields[0] != 0)
