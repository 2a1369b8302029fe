"""The virtual lens: Snell's law, paraxial depth, tilt and distortion, and the sides of the picture."""

import numpy as np
import pytest

from spirillum.virtual.optics import VirtualLens
from spirillum.virtual.trajectory import lab_to_camera

SIZE = (640, 480)


def lens(**changes: object) -> VirtualLens:
    return VirtualLens(**({"eye": 0.21, "surface": 0.06, "index": 1.4, "focal": 740.0, "size": SIZE} | changes))


CASES = [
    lens(),
    lens(leftwards=True),
    lens(tilt=(0.03, -0.02), distortion=(-0.05, 0.01)),
    lens(leftwards=True, tilt=(-0.02, 0.03), distortion=(0.04, 0.0), index=1.33),
]


@pytest.fixture
def points() -> np.ndarray:
    rng = np.random.default_rng(3)
    return rng.uniform([-0.08, -0.06, 0.0], [0.08, 0.06, 0.055], (40, 3))


@pytest.mark.parametrize("case", CASES)
def test_a_pixel_and_its_point_agree(case: VirtualLens, points: np.ndarray) -> None:
    for point in points:
        pixel = case.project(point[None])[:, :2]
        assert np.allclose(case.points(pixel, point[2])[0], point, atol=1e-12)


@pytest.mark.parametrize("case", CASES)
def test_rays_bend_at_the_surface_by_snells_law(case: VirtualLens, points: np.ndarray) -> None:
    for point in points:
        u, v, _ = case.project(point[None])[0]
        x, y, *_ = case.sightlines(np.array([[u, v]]))[0]
        crossing = np.array([x, y, case.surface])
        above, below = np.array([0.0, 0.0, case.eye]) - crossing, point - crossing
        sin_air = np.hypot(*above[:2]) / np.linalg.norm(above)
        sin_oil = np.hypot(*below[:2]) / np.linalg.norm(below)
        assert sin_air == pytest.approx(case.index * sin_oil, rel=1e-10)
        assert above[0] * below[1] == pytest.approx(above[1] * below[0], abs=1e-16)  # one plane


def test_light_takes_the_shortest_optical_path(points: np.ndarray) -> None:
    case = lens()
    for point in points[:8]:
        u, v, _ = case.project(point[None])[0]
        at_x, at_y, *_ = case.sightlines(np.array([[u, v]]))[0]

        def path(x: float, y: float, point: np.ndarray = point) -> float:
            at = np.array([x, y, case.surface])
            return float(np.linalg.norm([x, y, case.surface - case.eye]) + case.index * np.linalg.norm(point - at))

        least = path(at_x, at_y)
        assert all(path(at_x + a, at_y + b) > least for a, b in ((1e-4, 0), (-1e-4, 0), (0, 1e-4), (0, -1e-4)))


def test_near_the_axis_oil_seems_shallower_by_its_index() -> None:
    case, near = lens(), 1e-7
    for height in (0.0, 0.02, 0.05):
        seen = case.project(np.array([[near, 0.0, height]]))[0]
        expected = case.focal * near / (0.15 + (0.06 - height) / 1.4)
        assert seen[0] - case.centre[0] == pytest.approx(expected, rel=1e-9)


def test_without_oil_it_is_a_pinhole(points: np.ndarray) -> None:
    case = lens(index=1.0)
    seen = case.project(points)
    assert np.allclose(seen[:, 0], 319.5 + 740.0 * points[:, 0] / (0.21 - points[:, 2]), atol=1e-9)
    assert np.allclose(seen[:, 1], 239.5 - 740.0 * points[:, 1] / (0.21 - points[:, 2]), atol=1e-9)
    assert np.allclose(lens(surface=0.0).project(points), seen, atol=1e-12)  # above the surface nothing bends


def test_distortion_is_radial_and_of_the_stated_size(points: np.ndarray) -> None:
    plain, bent = lens().project(points), lens(distortion=(-0.1, 0.02)).project(points)
    a, b = (found[:, :2] - lens().centre for found in (plain, bent))
    r2 = (a**2).sum(axis=1) / 740.0**2
    assert np.allclose(b, a * (1.0 - 0.1 * r2 + 0.02 * r2**2)[:, None], atol=1e-9)


def test_a_tilt_turns_the_lines_of_sight() -> None:
    tilt = 0.035
    straight_down = lens(tilt=(0.0, tilt)).project(np.array([[0.0, 0.0, 0.01]]))[0]
    assert abs(straight_down[0] - 319.5) == pytest.approx(740.0 * np.tan(tilt), rel=1e-12)
    assert straight_down[1] == pytest.approx(239.5, abs=1e-9)


@pytest.mark.parametrize("leftwards", [False, True])
@pytest.mark.parametrize("view", ["top", "side"])
def test_nose_and_gravity_are_where_the_setup_says(view: str, leftwards: bool) -> None:
    case, turn = lens(leftwards=leftwards), lab_to_camera(view, leftwards=leftwards)
    assert np.allclose(turn @ turn.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(turn) == pytest.approx(1.0)
    assert np.allclose(turn[:, 0], [1.0, 0.0, 0.0])
    ahead = case.project(np.array([[0.0, 0.0, 0.02], [0.01, 0.0, 0.02]]))
    assert (ahead[1, 0] < ahead[0, 0]) == leftwards
    lower = turn @ np.array([0.0, 0.0, -0.01])
    if view == "side":
        seen = case.project(np.array([[0.0, 0.0, 0.03], lower + np.array([0.0, 0.0, 0.03])]))
        assert seen[1, 1] > seen[0, 1] + 10.0
    else:
        assert lower[2] == pytest.approx(-0.01)
