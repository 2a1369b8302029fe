"""The robot's surfaces: closed, outward, on the true surfaces, and converging to the solids at second order."""

from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from spirillum import InputError
from spirillum.robot.links import robot_solids
from spirillum.robot.load import load
from spirillum.robot.mesh import STRIPE_COLOURS, RobotMesh, robot_mesh, tail_line
from spirillum.robot.surface import mass_properties, rod, swept

WIDE = "biorob2012-wide"
BALL = {"body.shape": "sphere", "body.length": "18 mm", "body.front": None, "body.rear": None, "seal": "none"}
MICRO = {
    "body.diameter": "1 um",
    "body.length": "2.5 um",
    "body.mass": "2 pg",
    "seal": "none",
    "coupling.diameter": "0 mm",
    "coupling.length": "0.1 um",
    "coupling.clearance": "0 um",
    "tail.wavelength": "2 um",
    "tail.amplitude": "0.2 um",
    "tail.length": "6 um",
    "tail.wire_diameter": "40 nm",
}
ROBOTS: dict[str, dict[str, Any]] = {
    "paper": {},
    "left": {"tail.handedness": "left"},
    "plain helix": {"tail.taper": "none"},
    "sharp root": {"tail.taper": 5000},
    "slow rise": {"tail.taper": 0.5},
    "ball": BALL,
    "fillets": {"body.shape": "cylinder", "body.front": "fillet", "body.rear": "fillet", "body.fillet": "2 mm"},
    "round rear": {"body.rear": "hemisphere"},
    "flat cap": {"body.length": "9 mm", "seal": "none"},
    "no coupling": {"coupling.length": "0 mm"},
    "micrometres": MICRO,
}


def pieces(fineness: float = 1.0, phase: float = 0.0, **overrides: Any) -> dict[str, RobotMesh]:
    found = robot_mesh(load(WIDE, **overrides), phase=phase, fineness=fineness)
    return {piece.name: piece for piece in found}


def components(faces: np.ndarray) -> int:
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    count = int(faces.max()) + 1
    rows, columns = faces[:, [0, 1, 2]].ravel(), faces[:, [1, 2, 0]].ravel()
    return int(connected_components(coo_matrix((np.ones(rows.size), (rows, columns)), (count, count)))[0])


@pytest.mark.parametrize("name", ROBOTS)
def test_every_piece_is_one_closed_surface_that_faces_outwards(name: str) -> None:
    """Each edge belongs to two triangles that run along it in opposite directions; every vertex is used."""
    for piece in pieces(0.4, **ROBOTS[name]).values():
        faces = piece.faces
        edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
        assert len(np.unique(edges, axis=0)) == len(edges), piece.name
        np.testing.assert_array_equal(np.unique(edges, axis=0), np.unique(edges[:, ::-1], axis=0), piece.name)
        assert components(faces) == 1
        assert len(np.unique(faces)) == len(piece.vertices)
        assert np.isfinite(piece.vertices).all()
        assert piece.volume > 0
        euler = len(piece.vertices) - len(edges) // 2 + len(faces)
        assert euler == 2  # a sphere with no handle
        assert piece.colours.shape == faces.shape
        assert set(piece.region) <= set(range(len(piece.regions)))
        a, b, c = np.moveaxis(piece.vertices[faces], 1, 0)
        doubled = np.linalg.norm(np.cross(b - a, c - a), axis=1)
        assert np.min(doubled) > 0, piece.name


MORE = ("plain helix", "slow rise", "round rear", "micrometres")


@pytest.mark.parametrize("name", ["paper", "ball", "fillets", *(pytest.param(n, marks=pytest.mark.slow) for n in MORE)])
def test_volume_and_centroid_converge_at_second_order(name: str) -> None:
    robot = load(WIDE, **ROBOTS[name])
    for label, solid in robot_solids(robot).items():
        errors = []
        for fineness in (1.0, 2.0, 4.0):
            piece = next(piece for piece in robot_mesh(robot, fineness=fineness) if piece.name == label)
            shift = np.linalg.norm(piece.centroid - solid.centroid) / solid.volume ** (1 / 3)
            errors.append((1.0 - piece.volume / solid.volume, shift))
        volume, centroid = np.array(errors).T
        assert np.all(volume > 0)
        np.testing.assert_allclose(volume[:-1] / volume[1:], 4.0, rtol=0.1, err_msg=label)
        assert volume[0] < 0.02
        assert centroid[-1] < 1e-12 or centroid[0] / centroid[-1] > 10, label


def test_area_converges_at_second_order() -> None:
    """Hemisphere, side and flat rear of the body; 2 pi a times the arc and two ends of a plain helix's wire."""
    R, a = 9e-3, 0.5e-3
    body = 2 * np.pi * R**2 + 2 * np.pi * R * 26e-3 + np.pi * R**2
    tail = 2 * np.pi * a * 60e-3 * np.hypot(1, 2 * np.pi * 2.5 / 25) + 2 * np.pi * a**2
    found = [pieces(fineness, **{"tail.taper": "none"}) for fineness in (1.0, 2.0, 4.0)]
    for label, area in (("body", body), ("tail", tail)):
        error = np.array([1 - item[label].area / area for item in found])
        np.testing.assert_allclose(error[:-1] / error[1:], 4.0, rtol=0.1, err_msg=label)


@pytest.mark.parametrize("name", ["paper", "left", "plain helix", "slow rise", "micrometres"])
def test_vertices_of_the_tail_lie_half_a_wire_from_its_centreline(name: str) -> None:
    robot = load(WIDE, **ROBOTS[name])
    line = tail_line(robot)
    tail = pieces(**ROBOTS[name])["tail"]
    rings = tail.vertices[1:-1].reshape(len(line.points), -1, 3) - line.points[:, None]
    radius = 0.5 * robot.tail.wire_diameter
    np.testing.assert_allclose(np.linalg.norm(rings, axis=-1), radius, rtol=1e-9)
    np.testing.assert_allclose(np.einsum("kni,ki->kn", rings, line.tangents), 0.0, atol=1e-9 * radius)
    # Eq. (10) itself.
    h = robot.hand
    x = line.points[:, 0]
    assert np.all(np.diff(line.xi) > 0)
    assert line.xi[-1] == pytest.approx(robot.tail.length, rel=1e-12, abs=0)
    np.testing.assert_allclose(-x - line.xi, 0.5 * robot.body.length + robot.coupling.length, rtol=1e-12)
    rise = 1.0 if robot.tail.taper is None else 1 - np.exp(-robot.tail.taper * line.xi / robot.tail.length)
    angle = h * 2 * np.pi / robot.tail.wavelength * x
    wanted = robot.tail.amplitude * np.stack([rise * np.cos(angle), rise * np.sin(angle)], axis=-1)
    np.testing.assert_allclose(line.points[:, 1:], wanted, atol=1e-12 * robot.tail.amplitude)


def test_sections_of_a_wire_do_not_turn_about_it() -> None:
    """Along a helix the carried frame turns back against Frenet's by the torsion: h k alpha per arc length."""
    lam, b, turns, n = 0.02, 0.003, 2.0, 2001
    k = 2 * np.pi / lam
    s = np.linspace(0, turns * lam, n)
    points = np.stack([-s, b * np.cos(k * s), -b * np.sin(k * s)], axis=-1)
    tangents = np.stack([-np.ones(n), -k * b * np.sin(k * s), -k * b * np.cos(k * s)], axis=-1)
    tangents /= np.linalg.norm(tangents, axis=1)[:, None]
    surface = swept(points, tangents, 1e-4, 12)
    first = surface.vertices[1:-1].reshape(n, 12, 3)[:, 0] - points
    inward = -points * [0, 1, 1] / b  # Frenet's normal
    binormal = np.cross(tangents, inward)
    angle = np.unwrap(np.arctan2(np.sum(first * binormal, axis=1), np.sum(first * inward, axis=1)))
    alpha = 1 / np.hypot(1, k * b)
    # The torsion of a right-handed helix is + k alpha^2; its arc is s/alpha.
    assert angle[-1] - angle[0] == pytest.approx(-k * alpha * turns * lam, rel=1e-5)


def test_a_rod_is_a_cylinder_with_balls() -> None:
    start, end, r = np.array([1.0, 2.0, -1.0]), np.array([1.5, 2.5, 0.5]), 0.2
    length = float(np.linalg.norm(end - start))
    for round_start, round_end in ((False, False), (True, False), (True, True)):
        surface = rod(start, end, r, 400, round_start=round_start, round_end=round_end)
        volume, _, _ = mass_properties(surface.vertices, surface.faces)
        balls = 2 / 3 * np.pi * r**3 * (round_start + round_end)
        assert volume == pytest.approx(np.pi * r**2 * length + balls, rel=2e-4)


@pytest.mark.parametrize("phase", [0.7, np.pi, -2.0])
def test_phase_turns_the_rotor_about_the_motor_axis(phase: float) -> None:
    cos, sin = np.cos(phase), np.sin(phase)
    turn = np.array([[1, 0, 0], [0, cos, -sin], [0, sin, cos]])
    for still, turned in zip(pieces().values(), pieces(phase=phase).values(), strict=True):
        moves = turn if still.part == "rotor" else np.eye(3)
        np.testing.assert_allclose(turned.vertices, still.vertices @ moves.T, atol=1e-16)
    assert [piece.part for piece in pieces().values()] == ["body", "rotor", "rotor", "rotor", "rotor"]


def test_mirrored_tail_is_the_mirror_image() -> None:
    right, left = tail_line(load(WIDE)), tail_line(load(WIDE, **{"tail.handedness": "left"}))
    np.testing.assert_allclose(right.points, left.points * [1, 1, -1], atol=1e-16)


@pytest.mark.parametrize("name", ROBOTS)
def test_neighbouring_pieces_overlap(name: str) -> None:
    """So that the robot hangs together: rods end inside what they join, the tail's first section inside a ball."""
    robot = load(WIDE, **ROBOTS[name])
    found = pieces(**ROBOTS[name])
    x = {label: (p.vertices[:, 0].min(), p.vertices[:, 0].max()) for label, p in found.items()}
    chain = [label for label in ("body", "shaft", "coupling", "stub") if label in found]
    for before, after in pairwise(chain):
        assert x[before][0] < x[after][1]
        assert x[after][0] < x[before][0]
    joint = found["arm" if "arm" in found else "stub"]
    start = tail_line(robot).points[0]
    first = found["tail"].vertices[1:25] - start
    assert np.max(np.linalg.norm(first, axis=1)) <= 0.5 * robot.tail.wire_diameter * (1 + 1e-9)
    lowest = np.linalg.norm(joint.vertices - start, axis=1).min()
    assert lowest <= 0.5 * robot.tail.wire_diameter * (1 + 1e-9)


def test_stripes_lie_where_the_file_says() -> None:
    """First centred on +z, the next towards -y, each an eighth of the seal's side, edges exact, the rear face plain."""
    robot = load(WIDE)
    body = pieces()["body"]
    assert body.regions == ("body", "seal", *(f"stripe {n}" for n in range(1, 9)))
    a, b, c = np.moveaxis(body.vertices[body.faces], 1, 0)
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    middle = (a + b + c) / 3
    angle = np.arctan2(-middle[:, 1], middle[:, 2])  # about +x from +z
    for which in range(8):
        faces = body.region == 2 + which
        assert np.sum(area[faces]) == pytest.approx(2 * np.pi * 9e-3 * 11e-3 / 8, rel=1e-3)
        off = np.angle(np.exp(1j * (angle[faces] - which * np.pi / 4)))
        assert np.max(np.abs(off)) < np.pi / 8
        assert np.all(middle[faces, 0] < -17.5e-3 + 11e-3)
        np.testing.assert_array_equal(
            body.colours[faces], np.tile(STRIPE_COLOURS[robot.seal.stripes[which]], (faces.sum(), 1))
        )
        corners = np.unique(body.faces[faces])
        edge = np.arctan2(-body.vertices[corners, 1], body.vertices[corners, 2])
        off = np.angle(np.exp(1j * (edge - which * np.pi / 4)))
        assert np.max(np.abs(off)) == pytest.approx(np.pi / 8, abs=1e-12)
    rear = np.sum(area[body.region == 1])
    assert rear == pytest.approx(np.pi * 9e-3**2, rel=1e-3)


@pytest.mark.parametrize("count", [2, 3, 5, 7])
def test_any_number_of_stripes(count: int) -> None:
    body = pieces(0.3, **{"seal.stripes": ["red", "cyan", "black", "white", "orange", "green", "blue"][:count]})["body"]
    stripes = np.bincount(body.region)[2:]
    assert len(stripes) == count
    assert len(set(stripes)) == 1


def test_a_plain_seal_and_a_plain_body() -> None:
    assert pieces(**{"seal.stripes": []})["body"].regions == ("body", "seal")
    assert pieces(seal="none")["body"].regions == ("body",)
    whole = pieces(**{"body.shape": "cylinder", "body.front": "flat", "seal.length": "35 mm"})["body"]
    assert {float(x) for x in whole.vertices[whole.faces[whole.region == 0], 0].ravel()} == {17.5e-3}


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        ({"seal.length": "27 mm"}, "seal.length = 27 mm; allowed: at most 26 mm, where the nose"),
        ({**BALL, "seal": {"length": "11 mm"}}, "seal.length = 11 mm; allowed: at most 9 mm"),
        ({"seal.length": "0 mm"}, "seal.length"),
        ({"seal.length": "11"}, "has no unit"),
        ({"seal.stripes": ["red"]}, "a list of 2 to 48"),
        ({"seal.stripes": "red"}, "a list of 2 to 48"),
        ({"seal.stripes": ["red", "grren"]}, "did you mean green"),
        ({"seal": {"stripes": ["red", "blue"]}, "seal.length": None}, "seal.length is missing"),
        ({"seal": "striped"}, "'none', or a [seal] table"),
    ],
)
def test_an_impossible_seal_is_one_sentence(overrides: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError) as refused:
        pieces(**overrides)
    assert words in str(refused.value)


def test_a_robot_file_says_before_a_picture_that_its_seal_is_too_long() -> None:
    robot = load(WIDE, **{"seal.length": "27 mm"})
    with pytest.raises(InputError) as refused:
        robot_mesh(robot)
    assert str(refused.value) in [str(note) for note in robot.notes if note.code == "robot-file-doubtful"]
    assert load(WIDE, **{"seal.length": "26 mm"}).notes == load(WIDE).notes


@pytest.mark.parametrize("fineness", [0.0, -1.0, float("nan"), 1e6])
def test_fineness_out_of_range_is_refused(fineness: Any) -> None:
    with pytest.raises(InputError, match=r"fineness = .*; allowed: 0\.1 to 20"):
        pieces(fineness)


@pytest.mark.parametrize("turns", [1, 900])
def test_short_and_very_long_tails(turns: int) -> None:
    found = pieces(0.2, **{"tail.length": f"{turns * 25} mm", "channel": "none"})["tail"]
    assert found.volume > 0


@pytest.mark.parametrize(("density", "grey"), [("8960 kg/m^3", False), ("8500 kg/m^3", False), ("7900 kg/m^3", True)])
def test_a_wire_as_dense_as_steel_is_grey_and_others_are_copper(density: str, grey: bool) -> None:
    (tail,) = (
        piece for piece in robot_mesh(load("biorob2012-wide", **{"tail.density": density})) if piece.name == "tail"
    )
    red, _, blue = tail.colours[0]
    assert bool(abs(red - blue) < 0.1) == grey
