"""The wall's reflection of point forces: no slip, no net flux, Faxen's constants, the plane wall, nodes in k."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import exp1

from spirillum.fluid.tube.wall import point_reflection, point_waves, waves_between
from spirillum.robot.tube_pose import TubePose

EULER = 0.5772156649015329


def stokeslets(targets: np.ndarray, source: np.ndarray) -> np.ndarray:
    """8 pi mu times velocities from unit forces, (n, 3, 3)."""
    d = targets - source
    r = np.linalg.norm(d, axis=1)[:, None, None]
    found: np.ndarray = np.eye(3) / r + d[:, :, None] * d[:, None, :] / r**3
    return found


def reflected(targets: np.ndarray, source: np.ndarray, radius: float, tolerance: float = 1e-8) -> np.ndarray:
    """What the wall adds to them, (n, 3, 3)."""
    points = np.concatenate([source[None], targets])
    distances = radius - np.hypot(points[:, 1], points[:, 2])
    mean = 0.5 * (distances[0] + distances[1:].min())
    waves = waves_between(radius, float(np.ptp(points[:, 0])), float(mean), tolerance)
    both = point_reflection(points, waves).reshape(len(points), 3, len(points), 3)
    np.testing.assert_allclose(both, both.transpose(2, 3, 0, 1), atol=1e-12 * np.max(np.abs(both)))
    found: np.ndarray = -both[1:, :, 0]
    return found


@settings(max_examples=6)
@given(
    radius=st.floats(-2, 2).map(lambda power: 10.0**power),
    share=st.floats(0.0, 0.8),
    angle=st.floats(-np.pi, np.pi),
    seed=st.integers(0, 1000),
)
def test_no_slip_on_the_wall(radius: float, share: float, angle: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    theta, x = rng.uniform(0, 2 * np.pi, 6), rng.uniform(-2, 2, 6)
    targets = radius * np.stack([x, np.cos(theta), np.sin(theta)], axis=1)
    source = radius * np.array([0.3, share * np.cos(angle), share * np.sin(angle)])
    free = stokeslets(targets, source)
    left = free + reflected(targets, source, radius)
    np.testing.assert_allclose(left, 0.0, atol=1e-6 * np.max(np.abs(free)))


@pytest.mark.parametrize("x", [1.0, 3.0])
def test_no_net_flux(x: float) -> None:
    """Through any section of the tube; and far from the force the fluid rests."""
    nodes, weights = np.polynomial.legendre.leggauss(7)
    rho = 0.5 * (1.0 + nodes)
    theta = 2 * np.pi * np.arange(9) / 9
    disk = np.stack(np.broadcast_arrays(x, rho[:, None] * np.cos(theta), rho[:, None] * np.sin(theta)), axis=-1)
    source = np.array([0.0, 0.3, -0.2])
    targets = disk.reshape(-1, 3)
    total = stokeslets(targets, source) + reflected(targets, source, 1.0, 1e-6)
    area = np.repeat(0.5 * weights * rho, 9) * 2 * np.pi / 9
    free = np.max(np.abs(area @ stokeslets(targets, source)[:, 0]))
    np.testing.assert_allclose(area @ total[:, 0], 0.0, atol=2e-4 * free)
    if x == 3.0:
        assert np.max(np.abs(total)) < 1e-3 * free


def test_a_small_sphere_on_the_axis() -> None:
    """Mobility 1 - c a/R of a small sphere: c = 2.104443 along, 1.804360 across (Happel and Brenner, 1965, ch. 7)."""
    for radius in (1.0, 0.02):
        found = point_reflection(np.zeros((1, 3)), waves_between(radius, 0.0, radius, 1e-12)) * radius * 6 / 8
        np.testing.assert_allclose(found, np.diag([2.104443, 1.804360, 1.804360]), atol=1e-6)


def test_near_the_wall_it_is_a_plane() -> None:
    """Lorentz's plane: 9/16 a/h along, 9/8 a/h across; the tube's curvature adds a part in h/R."""
    errors = []
    for h in (0.04, 0.02, 0.01):
        source = np.array([[0.0, h - 1.0, 0.0]])
        found = point_reflection(source, waves_between(1.0, 0.0, h, 1e-6)) * 0.75 * h
        errors.append(np.abs(np.diag(found) - np.array([9 / 16, 9 / 8, 9 / 16])))
        assert np.max(np.abs(found - np.diag(np.diag(found)))) < 1e-9
    assert np.all(errors[-1] < 0.01)
    np.testing.assert_allclose(np.log2(np.array(errors[:-1]) / errors[1:]), 1.0, atol=0.12)


@settings(max_examples=30)
@given(
    radius=st.floats(-3, 1).map(lambda power: 10.0**power),
    reach=st.floats(0.0, 20.0),
    distance=st.floats(0.02, 1.0),
)
def test_nodes_in_k(radius: float, reach: float, distance: float) -> None:
    """exp(-k) and exp(-k) log(k), k in units of the tolerated decay: what is singular at k = 0 is integrated."""
    waves = waves_between(radius, reach * radius, distance * radius, 1e-12)
    weight = 0.5 * np.pi * waves.weight * radius
    k = waves.k * radius
    last = k[-1]
    scale = 2.0 * distance
    rest = np.exp(-scale * last)
    np.testing.assert_allclose(weight @ np.exp(-scale * k), (1 - rest) / scale, rtol=2e-8)
    wanted = (-EULER - np.log(scale) - exp1(scale * last) - rest * np.log(last)) / scale
    np.testing.assert_allclose(weight @ (np.exp(-scale * k) * np.log(k)), wanted, rtol=0, atol=2e-7 / scale)


def test_waves_that_are_left_out_are_damped() -> None:
    """A smaller tolerance: the answer changes by as much as it says."""
    points = np.array([[0.0, -0.7, 0.1], [0.4, 0.2, 0.5], [1.0, -0.3, -0.6]])
    distance = 1.0 - np.max(np.hypot(points[:, 1], points[:, 2]))
    fine = point_reflection(points, waves_between(1.0, 1.0, distance, 1e-13))
    errors = []
    for tolerance in (1e-2, 1e-4, 1e-6):
        found = point_reflection(points, waves_between(1.0, 1.0, distance, tolerance))
        errors.append(float(np.max(np.abs(found - fine)) / np.max(fine)) / tolerance)
        assert np.linalg.eigvalsh(found)[0] > 0
    assert max(errors) < 30.0
    assert min(errors) > 1e-3  # and no more waves than it takes


def test_poses() -> None:
    """A pose's rotation, places and distances by hand."""
    pose = TubePose(2.0, 0.5, 0.3)
    c, s = np.cos(0.3), np.sin(0.3)
    np.testing.assert_allclose(pose.placed(np.array([[1.0, 0.0, 0.0]])), [[c, s - 0.5, 0.0]])
    np.testing.assert_allclose(pose.placed(np.array([[0.0, 1.0, 2.0]])), [[-s, c - 0.5, 2.0]])
    found = pose.distances(np.array([0.0]), np.array([0.4]))
    theta = np.linspace(0, 2 * np.pi, 20001)
    ring = pose.placed(np.stack([0 * theta, 0.4 * np.cos(theta), 0.4 * np.sin(theta)], axis=1))
    np.testing.assert_allclose(found, 2.0 - np.max(np.hypot(ring[:, 1], ring[:, 2])), rtol=1e-6)


def test_waves_at_points_of_the_wall() -> None:
    """Unit velocities: real and imaginary part, even and odd waves, in Cartesian components."""
    waves = waves_between(1.5, 1.0, 1.0, 1e-6)
    number = int(np.argmin(np.abs(waves.k - 0.8)))
    found = point_waves(np.array([[0.4, 1.5, 0.0]]), waves, number)
    c, s = np.cos(0.4 * waves.k[number]), np.sin(0.4 * waves.k[number])
    wanted = np.zeros(
        (waves.orders[number], 2, 2, 3, 3)
    )  # order; even, odd; real, imaginary; wall component; component
    wanted[:, 0, :, 0, 0] = -s, c
    wanted[:, 0, :, 1, 1] = c, s
    wanted[:, 1, :, 2, 2] = -c, -s
    np.testing.assert_allclose(found, wanted, atol=1e-12)
