"""What was written, read back by the programs that it is for: a mesh library, a robot library, MuJoCo, VTK."""

import json
import os
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pytest

import spirillum as sp
from spirillum.robot.links import links_of, robot_solids
from spirillum.robot.mesh import STRIPE_COLOURS, robot_mesh

WIDE = "biorob2012-wide"
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
NANO = {
    **MICRO,
    "body.diameter": "60 nm",
    "body.length": "180 nm",
    "coupling.length": "6 nm",
    "tail.wavelength": "120 nm",
    "tail.amplitude": "12 nm",
    "tail.length": "360 nm",
    "tail.wire_diameter": "2 nm",
}
ROBOTS: dict[str, dict[str, Any]] = {
    "paper": {},
    "plain helix": {"tail.taper": "none", "tail.handedness": "left"},
    "sharp root": {"tail.taper": 5000},
    "ball": {"body.shape": "sphere", "body.length": "18 mm", "body.front": None, "body.rear": None, "seal": "none"},
    "no coupling": {"coupling.length": "0 mm"},
    "micrometres": MICRO,
}
PHASE = 0.9


def turned_by(angle: float) -> np.ndarray:
    cos, sin = np.cos(angle), np.sin(angle)
    return np.array([[1, 0, 0], [0, cos, -sin], [0, sin, cos]])


@pytest.fixture(scope="module")
def described(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the paper's robot as .urdf and .mjcf, at a phase."""
    folder = tmp_path_factory.mktemp("described")
    for ending in ("urdf", "mjcf"):
        sp.export(WIDE, folder / f"robot.{ending}", phase=PHASE, model="rft")
    return folder


@pytest.mark.parametrize("name", ROBOTS)
def test_stl_is_one_watertight_body(tmp_path: Path, name: str) -> None:
    import trimesh

    robot = sp.load(WIDE, **ROBOTS[name])
    found = sp.export(robot, tmp_path / "robot.stl", phase=PHASE)
    read = trimesh.load(tmp_path / "robot.stl")
    assert read.is_watertight
    assert read.is_winding_consistent
    assert read.body_count == 1
    assert read.euler_number == 2
    assert found.solid is not None
    assert found.solid["watertight"]
    assert found.solid["bodies"] == 1
    assert found.warnings == robot.warnings
    scale = {"mm": 1e-3, "um": 1e-6}[found.solid["unit"]]
    np.testing.assert_allclose(read.volume * scale**3, found.solid["volume"]["value"], rtol=1e-6)
    everything = np.concatenate([piece.vertices for piece in robot_mesh(robot, phase=PHASE)])
    np.testing.assert_allclose(scale * np.ptp(read.vertices, axis=0), np.ptp(everything, axis=0), rtol=1e-5)


@pytest.mark.parametrize(
    ("name", "unit"), [("ecoli", "m"), ("ecoli", "mm"), (WIDE, "m"), ("nano", None), ("nano", "mm")]
)
def test_watertight_is_said_of_the_file_as_it_is_read(tmp_path: Path, name: str, unit: str | None) -> None:
    import trimesh

    robot = sp.load(WIDE, **NANO) if name == "nano" else sp.load(name)
    found = sp.export(robot, tmp_path / "robot.stl", unit=unit)
    read = trimesh.load(tmp_path / "robot.stl")
    assert found.solid is not None
    assert found.solid["watertight"] == ((name, unit) not in {("ecoli", "m"), ("nano", "mm")})
    assert read.is_watertight or not found.solid["watertight"]
    assert read.is_watertight == ((name, unit) != ("ecoli", "m"))  # nano in mm: by the luck of how this reader rounds
    said = [sentence for sentence in found.warnings if "not watertight" in sentence]
    assert len(said) == (not found.solid["watertight"])
    assert all(f"use --unit {'mm' if name == 'ecoli' else 'um'}" in sentence for sentence in said)


@pytest.mark.parametrize("name", ["paper", "micrometres"])
def test_pieces_of_a_scene_are_closed_in_single_precision(tmp_path: Path, name: str) -> None:
    import trimesh

    robot = sp.load(WIDE, **ROBOTS[name])
    found = sp.export(robot, tmp_path / "robot.glb")
    surfaces = trimesh.load(tmp_path / "robot.glb", process=False).geometry
    pieces: dict[str, list[np.ndarray]] = {}
    for label, surface in surfaces.items():
        pieces.setdefault(label.partition(":")[0], []).append(np.asarray(surface.vertices)[surface.faces])
    assert set(pieces) == {piece.name for piece in found.pieces}
    for parts in pieces.values():
        corners = np.concatenate(parts).reshape(-1, 3)
        size = np.ptp(corners, axis=0).max()  # the reader's own length of merging would take a small robot apart
        assert trimesh.Trimesh(corners / size, np.arange(len(corners)).reshape(-1, 3)).is_watertight


def test_volume_of_the_printed_body_is_that_of_the_solids_and_what_joins_them() -> None:
    """Extrapolated to smooth surfaces: body, coupling and tail, shaft and stub in the gaps, and a joint at the root.

    The joint gains no more than half a ball and loses no more than the quarter of two crossing rods, 4/3 a^3.
    """
    from spirillum.exports.descriptions import united

    robot = sp.load(WIDE)
    coarse, fine = (united(robot_mesh(robot, fineness=fineness)).volume for fineness in (1.25, 2.5))
    smooth = fine + (fine - coarse) / 3
    solids = sum(solid.volume for solid in robot_solids(robot).values())
    gaps = np.pi * (0.4e-3**2 + 0.5e-3**2) * 0.5e-3
    assert solids + gaps - 4 / 3 * 0.5e-3**3 < smooth < solids + gaps + 2 / 3 * np.pi * 0.5e-3**3


def test_glb_is_a_coloured_scene_with_two_links_and_y_up(tmp_path: Path) -> None:
    import trimesh

    sp.export(WIDE, tmp_path / "robot.glb", phase=PHASE)
    scene = trimesh.load(tmp_path / "robot.glb")
    parents = scene.graph.transforms.parents
    assert (parents["rotor"], parents["body"]) == ("robot", "robot")
    assert parents["tail surface"] == "rotor"
    assert parents["body: stripe 1 surface"] == "body"
    y_up = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])
    np.testing.assert_allclose(scene.graph.get("robot")[0][:3, :3], y_up, atol=1e-12)
    np.testing.assert_allclose(scene.graph.get("rotor")[0][:3, :3], y_up @ turned_by(PHASE), atol=1e-6)
    robot = sp.load(WIDE)
    assert robot.seal is not None
    for piece in robot_mesh(robot, phase=PHASE):
        low = np.min([scene.geometry[name].bounds[0] for name in scene.geometry if name.startswith(piece.name)], axis=0)
        assert low[0] == pytest.approx(piece.vertices[:, 0].min(), rel=1e-6)
    for index, colour in enumerate(robot.seal.stripes):
        node = f"body: stripe {index + 1} surface"
        transform, name = scene.graph.get(node)
        centre = transform[:3, :3] @ scene.geometry[name].vertices.mean(axis=0)
        angle = index * np.pi / 4  # about +x from +z, which is y of the file
        np.testing.assert_allclose(np.arctan2(centre[2], centre[1]), np.angle(np.exp(1j * angle)), atol=1e-6)
        linear = np.array(scene.geometry[name].visual.material.baseColorFactor[:3]) / 255
        shown = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
        np.testing.assert_allclose(shown, STRIPE_COLOURS[colour], atol=0.02)
    for piece in robot_mesh(robot):
        if piece.name != "body":
            np.testing.assert_allclose(scene.geometry[piece.name].volume, piece.volume, rtol=1e-4)


def test_normals_of_the_scene_are_those_of_the_smooth_surface() -> None:
    """Radial on the wire and on the nose; along the axis on flat faces, whose edges stay sharp."""
    from spirillum.robot.mesh import tail_line
    from spirillum.robot.surface import corner_normals

    robot = sp.load(WIDE)
    pieces = {piece.name: piece for piece in robot_mesh(robot)}
    body = pieces["body"]
    normals, corners = corner_normals(body.vertices, body.faces, np.deg2rad(40)), body.vertices[body.faces]
    nose = (corners[..., 0] > 8.5e-3 + 1e-6).all(axis=1)
    radial = corners[nose] - [8.5e-3, 0, 0]
    radial /= np.linalg.norm(radial, axis=-1, keepdims=True)
    assert np.min(np.sum(radial * normals[nose], axis=-1)) > np.cos(np.deg2rad(2))
    rear = (corners[..., 0] < -17.5e-3 + 1e-9).all(axis=1)
    np.testing.assert_allclose(normals[rear], np.broadcast_to([-1.0, 0, 0], (rear.sum(), 3, 3)), atol=1e-12)
    tail, line = pieces["tail"], tail_line(robot)
    normals = corner_normals(tail.vertices, tail.faces, np.deg2rad(40))
    ring = (tail.faces - 1) // 24
    inner = ((tail.faces > 24) & (tail.faces < len(tail.vertices) - 25)).all(axis=1)
    radial = (tail.vertices[tail.faces] - line.points[np.clip(ring, 0, len(line.points) - 1)])[inner]
    radial /= np.linalg.norm(radial, axis=-1, keepdims=True)
    assert np.min(np.sum(radial * normals[inner], axis=-1)) > np.cos(np.deg2rad(10))


def test_vtp_is_closed_and_knows_parts_and_colours(tmp_path: Path) -> None:
    os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")
    pyvista = pytest.importorskip("pyvista")
    robot = sp.load(WIDE)
    sp.export(robot, tmp_path / "robot.vtp", phase=PHASE)
    read = pyvista.read(tmp_path / "robot.vtp")
    pieces = robot_mesh(robot, phase=PHASE)
    np.testing.assert_array_equal(read.points, np.concatenate([piece.vertices for piece in pieces]))
    assert read.is_manifold
    assert read.volume == pytest.approx(sum(piece.volume for piece in pieces), rel=1e-9, abs=0)
    colours = np.round(255 * np.concatenate([piece.colours for piece in pieces]))
    np.testing.assert_array_equal(read.cell_data["colour"], colours)
    comment = (tmp_path / "robot.vtp").read_text("latin-1").split("<!-- ")[1].split(" -->")[0]
    words = json.loads(comment)
    assert (words["robot"], words["unit"], words["phase"]) == (WIDE, "m", PHASE)
    wanted = [name for piece in pieces for name in np.array(piece.regions)[piece.region]]
    assert list(np.array(words["region"])[read.cell_data["region"]]) == wanted
    parts = np.array(words["part"])[read.cell_data["part"]]
    assert list(parts) == [piece.part for piece in pieces for _ in piece.faces]


def test_urdf_has_masses_joint_and_meshes(described: Path) -> None:
    yourdfpy = pytest.importorskip("yourdfpy")
    import trimesh

    model = yourdfpy.URDF.load(str(described / "robot.urdf"))
    assert model.validate()
    assert model.joint_map["motor"].type == "continuous"
    np.testing.assert_array_equal(model.joint_map["motor"].axis, [1, 0, 0])
    np.testing.assert_allclose(model.joint_map["motor"].origin[:3, :3], turned_by(PHASE), atol=1e-12)
    robot = sp.load(WIDE)
    for name, link in zip(("body", "rotor"), links_of(robot), strict=True):
        inertial = model.link_map[name].inertial
        assert inertial.mass == pytest.approx(link.mass, rel=1e-14, abs=0)
        np.testing.assert_allclose(inertial.inertia, link.inertia, rtol=1e-14, atol=0)
        np.testing.assert_allclose(inertial.origin[:3, 3], link.centre, rtol=1e-14, atol=0)
    everything = np.concatenate([piece.vertices for piece in robot_mesh(robot, phase=PHASE)])
    np.testing.assert_allclose(model.scene.bounds, [everything.min(axis=0), everything.max(axis=0)], atol=1e-8)
    shown = {tuple(item.material.color.rgba[:3]) for item in model.link_map["body"].visuals}
    assert {STRIPE_COLOURS[name] for name in ("red", "yellow", "green", "blue")} <= shown
    solids = robot_solids(robot)
    for name, wanted in (("body", solids["body"].volume), ("rotor", links_of(robot).rotor.volume)):
        (geometry,) = (item.geometry.mesh for item in model.link_map[name].collisions)
        read = trimesh.load(described / geometry.filename)
        assert read.is_watertight
        assert read.body_count == 1
        assert read.volume * np.prod(geometry.scale) == pytest.approx(wanted, rel=0.02, abs=0)


def test_a_fixed_joint_stays_fixed(tmp_path: Path) -> None:
    yourdfpy = pytest.importorskip("yourdfpy")
    mujoco = pytest.importorskip("mujoco")
    robot = sp.load(WIDE, **{"drive.kind": "rate", "drive.joint": "fixed", "drive.rate": "1 Hz"})
    for ending in ("urdf", "xml"):
        sp.export(robot, tmp_path / f"robot.{ending}", sidecar=False)
    assert yourdfpy.URDF.load(str(tmp_path / "robot.urdf")).joint_map["motor"].type == "fixed"
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "robot.xml"))
    assert (model.nv, model.nu) == (6, 0)
    assert not (tmp_path / "robot.resistance.json").exists()


def test_mujoco_loads_the_model_and_its_fluid_is_off(described: Path) -> None:
    mujoco = pytest.importorskip("mujoco")
    text = (described / "robot.mjcf").read_text()
    assert "WARNING: keep density and viscosity at 0" in text
    model = mujoco.MjModel.from_xml_path(str(described / "robot.mjcf"))
    assert (model.opt.density, model.opt.viscosity) == (0, 0)
    assert (model.nq, model.nv, model.nu) == (8, 7, 1)
    robot = sp.load(WIDE)
    assert robot.motor is not None
    assert model.dof_damping[6] == robot.motor.rotor_friction
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    for name, link in zip(("body", "rotor"), links_of(robot), strict=True):
        index = data.body(name).id
        turn = turned_by(PHASE if name == "rotor" else 0.0)
        assert model.body_mass[index] == pytest.approx(link.mass, rel=1e-14, abs=0)
        np.testing.assert_allclose(data.xipos[index], turn @ link.centre, atol=1e-15)
        axes = data.ximat[index].reshape(3, 3)
        inertia = axes @ np.diag(model.body_inertia[index]) @ axes.T
        # MuJoCo keeps principal axes, found to some 1e-8.
        np.testing.assert_allclose(inertia, turn @ link.inertia @ turn.T, atol=1e-7 * np.trace(link.inertia))


def test_one_step_under_our_force_changes_momentum_by_it(described: Path) -> None:
    """From a given motion, without weight: total momentum changes by -R V dt, summed over both links."""
    mujoco = pytest.importorskip("mujoco")
    beside = json.loads((described / "robot.resistance.json").read_text())
    model = mujoco.MjModel.from_xml_path(str(described / "robot.mjcf"))
    model.opt.gravity[:] = 0.0
    model.opt.timestep = 1e-6
    model.dof_damping[:] = 0.0
    data = mujoco.MjData(model)
    speed, spin, rate = np.array([1e-3, 2e-3, -1e-3]), np.array([0.5, 0.02, -0.03]), 7.0
    data.qvel[:] = [*speed, *spin, rate]
    turn = np.kron(np.eye(4), turned_by(beside["joint"]["phase_at_zero"]["value"]))
    resistance = turn @ np.array(beside["matrix"]["value"]) @ turn.T
    wrench = -resistance @ np.concatenate([speed, spin, speed, spin + np.array([rate, 0, 0])])

    def momentum() -> np.ndarray:
        mujoco.mj_forward(model, data)
        mujoco.mj_subtreeVel(model, data)
        return np.array(data.subtree_linvel[data.body("body").id]) * np.sum(model.body_mass)

    before = momentum()
    for first, name in ((0, "body"), (6, "rotor")):
        body = data.body(name)
        mujoco.mj_applyFT(
            model, data, wrench[first : first + 3], wrench[first + 3 : first + 6], body.xpos, body.id, data.qfrc_applied
        )
    mujoco.mj_step(model, data)
    np.testing.assert_allclose((momentum() - before) / 1e-6, wrench[:3] + wrench[6:9], rtol=2e-3, atol=1e-6)


def test_sidecar_is_the_models_matrix_and_the_links(described: Path) -> None:
    from spirillum.fluid.registry import find_swimmer_model
    from spirillum.robot.batch import RobotBatch

    beside = json.loads((described / "robot.resistance.json").read_text())
    assert beside["schema"] == "spirillum.links/1"
    robot = sp.load(WIDE)
    matrix = np.array(beside["matrix"]["value"])
    np.testing.assert_allclose(matrix, find_swimmer_model("rft").resistance(RobotBatch.of(robot), np.zeros(1))[0])
    np.testing.assert_allclose(matrix, matrix.T, rtol=1e-12, atol=1e-18)
    assert np.all(np.linalg.eigvalsh(matrix) > 0)
    assert beside["joint"]["phase_at_zero"]["value"] == PHASE
    assert any("has no coupling" in warning for warning in beside["warnings"])
    for name, link in zip(("body", "rotor"), links_of(robot), strict=True):
        stored = beside["links"][name]
        assert stored["mass"]["value"] == link.mass
        np.testing.assert_array_equal(stored["inertia"]["value"], link.inertia)
        np.testing.assert_array_equal(stored["centre_of_buoyancy"]["value"], link.centroid)


def test_what_is_said_about_turning_the_matrix_is_true() -> None:
    """Q R Q' at the joint's angle is the model's own matrix there."""
    from spirillum.exports.descriptions import sidecar_of
    from spirillum.fluid.registry import find_swimmer_model
    from spirillum.robot.batch import RobotBatch

    robot = sp.load(WIDE)
    for model in ("rft", "slender"):
        beside = np.array(sidecar_of(robot, model, 0.3)["matrix"]["value"])
        turn = np.kron(np.eye(4), turned_by(0.3 + 0.5))
        own = find_swimmer_model(model).resistance(RobotBatch.of(robot), np.array([0.8]))[0]
        np.testing.assert_allclose(turn @ beside @ turn.T, own, rtol=1e-9, atol=1e-12 * np.abs(own).max())


def test_masses_of_a_shape_may_be_unknown(tmp_path: Path) -> None:
    robot = sp.load(WIDE, **{"body.mass": None})
    found = sp.export(robot, tmp_path / "robot.stl", sidecar=True)
    assert [item.path.name for item in found.files] == ["robot.stl", "robot.resistance.json"]
    assert found.to_dict()["links"]["body"]["mass"]["value"] is None
    stored = json.loads((tmp_path / "robot.resistance.json").read_text())
    assert stored["links"]["rotor"]["mass"]["value"] is None
    assert stored["links"]["rotor"]["displaced_volume"]["value"] > 0


def test_a_robots_name_cannot_break_the_files(tmp_path: Path) -> None:
    mujoco = pytest.importorskip("mujoco")
    robot = sp.load(WIDE, name='a "robot" <--> & é')
    for ending in ("stl", "glb", "vtp", "urdf", "mjcf"):
        sp.export(robot, tmp_path / f"my robot.{ending}", sidecar=False, fineness=0.2)
    assert ET.parse(tmp_path / "my robot.urdf").getroot().get("name") == robot.name
    comment = (tmp_path / "my robot.vtp").read_text("latin-1").split("<!-- ")[1].split(" -->")[0]
    assert json.loads(comment)["robot"] == robot.name
    assert mujoco.MjModel.from_xml_path(str(tmp_path / "my robot.mjcf")).nbody == 3


@pytest.mark.parametrize(
    ("reading", "effective", "wanted"),
    [("rotor", None, 7e-7), ("rotor", "2e-5 N m s/rad", 2e-5), ("none", None, 0.0), ("body", "2e-5 N m s/rad", 7e-7)],
)
def test_friction_of_the_joint_is_what_acts_inside_it(reading: str, effective: str | None, wanted: float) -> None:
    from spirillum.exports.descriptions import joint_friction

    robot = sp.load(WIDE, **{"friction.reading": reading, "friction.effective": effective})
    np.testing.assert_allclose(joint_friction(robot), wanted, rtol=1e-14)
