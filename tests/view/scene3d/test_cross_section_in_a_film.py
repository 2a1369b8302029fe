"""The inset of a film shows the body where it lies in its tube, seen from the front, and touches no pixel beside it."""

import numpy as np
import pytest

import spirillum as sp
from spirillum.dynamics.run_file import Poses, rolled
from spirillum.view.figures.trajectory import silhouette
from spirillum.view.scene3d.film import CrossSection

SIZE = (640, 360)


@pytest.mark.parametrize("azimuth", [-1.0, 0.0, 2.0])
def test_body_lies_at_its_azimuth(azimuth: float) -> None:
    robot = sp.load("biorob2012-wide")
    place = np.array([0.0, 0.0105 * np.sin(azimuth), -0.0105 * np.cos(azimuth)])
    path = np.stack([np.array([0.0, 0.0, 0.0]), place])
    attitude = np.stack([rolled(0.0)] * 2)
    poses = Poses(np.array([0.0, 1.0]), path, attitude, np.zeros(2), np.zeros(2))
    image = np.full((SIZE[1], SIZE[0], 3), 255, dtype=np.uint8)
    CrossSection(SIZE, robot, poses).write(image, 1.0, poses.at(1.0))
    rows, columns = np.nonzero((image != 255).any(axis=-1))
    assert rows.min() > 0.7 * SIZE[1]
    middle = np.array([0.5 * (columns.min() + columns.max()), 0.5 * (rows.min() + rows.max())])
    glass = 0.5 * np.ptp(columns) * 0.90 / 0.93  # the inner surface
    grey = np.argwhere(np.abs(image.astype(int) - (201, 206, 210)).max(axis=-1) < 3)[:, ::-1]
    found = (grey.mean(axis=0) - middle) / glass * 0.02
    assert found == pytest.approx([place[1], -place[2]], abs=7e-4)


def test_silhouette_of_a_capsule_is_that_of_its_ends() -> None:
    """Yawed by psi, the spherical front is seen sin(psi) times its distance to the side, the flat rear to the other."""
    robot, yaw = sp.load("biorob2012-wide"), 0.1
    seen = silhouette(robot, np.zeros(3), np.array([np.cos(0.5 * yaw), 0.0, 0.0, np.sin(0.5 * yaw)]))
    assert seen[:, 0].max() == pytest.approx((0.0175 - 0.009) * np.sin(yaw) + 0.009, rel=1e-3)
    assert seen[:, 0].min() == pytest.approx(-0.0175 * np.sin(yaw) - 0.009 * np.cos(yaw), rel=1e-3)
    assert seen[:, 1].max() == pytest.approx(0.009, rel=1e-3)
