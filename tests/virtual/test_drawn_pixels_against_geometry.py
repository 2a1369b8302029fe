"""What is drawn lies at its computed pixel; pixel centres are at whole numbers."""

import numpy as np
import pytest

import spirillum as sp
from spirillum.kernels.core import draw
from spirillum.robot.surface import mass_properties
from spirillum.virtual.optics import VirtualLens, backdrop, spots, tank_of
from spirillum.virtual.pictures import Painter
from spirillum.virtual.solids import solids_of
from spirillum.virtual.trajectory import steady_trajectory


def coverage(corners: np.ndarray, faces: np.ndarray, heights: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """Share of each pixel that triangles cover, drawn from column 3 and row 2 on."""
    rows, columns = size
    places = np.ascontiguousarray(np.swapaxes(spots(4), 1, 2))
    depth = np.full((rows, columns, 16), -1e30, dtype=np.float32)
    picture = np.zeros((rows, columns, 16, 3), dtype=np.float32)
    seen = np.column_stack([corners, heights])
    light = np.ones((len(faces), 3))
    draw(seen, faces, light, light, light, light, places, 0, 1, 3, 2, depth, picture)
    return np.asarray((depth > -1e29).mean(axis=-1))


def test_a_quadrilateral_covers_its_area_about_its_centroid() -> None:
    rng = np.random.default_rng(1)
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    errors = []
    for _ in range(40):
        middle, turn = rng.uniform(12, 16, 2), rng.uniform(0, np.pi)
        half = np.array([5.3, 3.1])
        square = np.array([[-1, -1], [-1, 1], [1, 1], [1, -1]]) * half  # outward triangles turn this way, v downwards
        rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
        share = coverage(square @ rotation.T + middle, faces, np.zeros(4), (30, 30))
        assert share.sum() == pytest.approx(4 * half.prod(), abs=0.03 * 4 * half.sum())  # 0.03 px along its edges
        v, u = np.mgrid[2:32, 3:33]
        errors.append([(share * u).sum() / share.sum() - middle[0], (share * v).sum() / share.sum() - middle[1]])
    assert np.abs(np.mean(errors, axis=0)).max() < 0.005
    assert np.sqrt(np.mean(np.square(errors))) < 0.02


@pytest.mark.parametrize("side", [4, 6])
def test_samples_lie_one_in_each_cell_row_and_column(side: int) -> None:
    places, count = spots(side), side * side
    assert np.abs(places).max() < 0.5
    for place in places:
        fine = np.floor((place + 0.5) * count).astype(int)
        assert sorted(fine[:, 0]) == sorted(fine[:, 1]) == list(range(count))
        assert len({(u // side, v // side) for u, v in fine}) == count
    assert np.abs(places.mean(axis=(0, 1))).max() < 1e-12


def test_the_nearer_triangle_is_in_front_and_the_reverse_is_not_drawn() -> None:
    corners = np.array([[5.0, 5.0], [5.0, 15.0], [15.0, 5.0]])
    both = np.concatenate([corners, corners])
    share = coverage(both, np.array([[0, 1, 2], [3, 4, 5]]), np.array([0.0, 0, 0, 1, 1, 1]), (20, 20))
    assert share.sum() == pytest.approx(50.0, rel=0.02)
    assert coverage(corners, np.array([[0, 2, 1]]), np.zeros(3), (20, 20)).sum() == 0


def test_shortened_triangles_keep_the_robots_volume_and_area() -> None:
    robot = sp.load("biorob2012-wide")
    from spirillum.robot.mesh import robot_mesh

    body = next(piece for piece in robot_mesh(robot) if piece.name == "body")
    solid = solids_of(robot)[0]
    edges = solid.vertices[solid.faces] - solid.vertices[np.roll(solid.faces, 1, axis=1)]
    assert np.linalg.norm(edges, axis=-1).max() <= 5e-3
    assert mass_properties(solid.vertices, solid.faces)[0] == pytest.approx(body.volume, rel=1e-12)
    corners = solid.vertices[solid.faces]
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum()
    assert area == pytest.approx(body.area, rel=1e-12)
    assert np.allclose(np.linalg.norm(solid.normals, axis=-1), 1.0)


@pytest.mark.parametrize("view", ["top", "side"])
def test_straight_edges_stand_for_bent_ones(view: str) -> None:
    robot = sp.load("biorob2012-wide")
    lens = VirtualLens(0.21, 0.06, 1.4, 740.0, (640, 480), distortion=(-0.02, 0.0), tilt=(0.025, -0.025))
    tank = tank_of(robot, view)
    for x in (-0.02, 0.035, 0.062):
        for solid in solids_of(robot):
            ends = solid.vertices + np.array([x, 0.0, tank.tube_height - 0.0105])
            pairs = np.concatenate([solid.faces[:, [0, 1]], solid.faces[:, [1, 2]], solid.faces[:, [2, 0]]])
            first, last = (lens.project(ends[pairs[:, k]])[:, :2] for k in (0, 1))
            middle = lens.project(0.5 * (ends[pairs[:, 0]] + ends[pairs[:, 1]]))[:, :2]
            along, off = last - first, middle - first
            bend = np.abs(along[:, 0] * off[:, 1] - along[:, 1] * off[:, 0]) / np.linalg.norm(along, axis=1)
            assert bend[(middle[:, 0] > 0) & (middle[:, 0] < 639)].max() < 0.01


def test_the_silhouette_of_the_body_moves_as_its_vertices_do() -> None:
    robot = sp.load("biorob2012-wide")
    lens = VirtualLens(20.0, 0.06, 1.4, 20.0 * 740 / 0.19, (320, 120))  # from far away: every part moves alike
    solid = solids_of(robot)[0]
    seen = lens.project(solid.vertices + np.array([0.0, 0.0, 0.0115]))
    v, u = np.mgrid[2:122, 3:323]
    shifts = np.linspace(0.0, 1.0, 11)
    found = []
    for shift in shifts:
        share = coverage(seen[:, :2] + [shift, 0.37 * shift], solid.faces, seen[:, 2], (120, 320))
        found.append([(share * u).sum() / share.sum(), (share * v).sum() / share.sum()])
    moved = np.array(found) - found[0]
    assert np.abs(moved[:, 0] - shifts).max() < 0.01
    assert np.abs(moved[:, 1] - 0.37 * shifts).max() < 0.01


def test_ruler_lines_lie_where_the_lens_sees_them() -> None:
    robot = sp.load("biorob2012-wide", channel="none")
    lens = VirtualLens(0.21, 0.06, 1.4, 740.0, (320, 200), distortion=(-0.02, 0.0))
    tank = tank_of(robot, "top")
    still = backdrop(tank, lens)
    across = tank.ruler + 4e-3
    for x in np.arange(-30, 31, 2) * 1e-3:
        u, v, _ = lens.project(np.array([[x, across, 0.0]]))[0]
        rows, columns = slice(round(v) - 4, round(v) + 5), slice(round(u) - 3, round(u) + 4)
        light = still.light[rows, columns, 1].astype(float).mean(axis=0)
        dark = light.max() - light
        assert (dark * np.arange(320)[columns]).sum() / dark.sum() == pytest.approx(u, abs=0.02)


def test_a_blurred_edge_spreads_over_its_way() -> None:
    robot = sp.load("biorob2012-wide", channel="none")
    lens = VirtualLens(0.21, 0.06, 1.4, 370.0, (320, 240))
    tank = tank_of(robot, "top")
    painter = Painter(robot, tank, lens)
    place = np.array([0.03, 0.0, tank.tube_height])
    rates = {"forward_velocity": 0.0, "body_rotation_rate": 0.0, "tail_rotation_rate": 30.0}
    trajectory = steady_trajectory(1.0, **rates, position=place)
    sharp, blurred = (painter.light(trajectory, 0.5, exposure) for exposure in (0.0, 1 / 60))
    body = lens.project(np.array([[0.02, -0.009, 0.0], [0.04, 0.009, 0.0]]))[:, :2].round().astype(int)
    rows, columns = slice(body[1, 1], body[0, 1]), slice(body[0, 0], body[1, 0])
    assert np.abs(sharp[rows, columns] - blurred[rows, columns]).max() < 0.05  # the body stands still
    tail = slice(0, 120)
    assert np.abs(sharp[:, tail] - blurred[:, tail]).max() > 0.1
    assert sharp[:, tail].mean() == pytest.approx(blurred[:, tail].mean(), rel=2e-3)  # light is kept
