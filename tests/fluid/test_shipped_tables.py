"""The tables that come with the package, against the flow solved for and what holds for any resistance."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

import spirillum as sp
from spirillum.fluid.tube import library
from spirillum.fluid.tube.domain import in_tube
from spirillum.fluid.tube.library import find_table
from spirillum.fluid.tube.nodes import Places
from spirillum.fluid.tube.outer_resistance import even_phases, matrix_of
from spirillum.fluid.tube.solids import Fineness
from spirillum.fluid.tube.stages import RESPONSES, response_errors
from spirillum.fluid.tube.table import TubeTable, key_of
from spirillum.fluid.tube.tube import solved
from spirillum.fluid.wire.robot_geometry import RobotGeometry
from spirillum.fluid.wire.stokeslets import Accuracy
from spirillum.kernels.core import INSIDE, TOO_FAR_PITCHED, largest_yaw, mean_resistance_at
from spirillum.kernels.tube_table import MIRROR, PHASES, YAW_SLACK
from spirillum.papers.biorob2012.published import paper_study
from spirillum.robot.batch import RobotBatch
from spirillum.robot.tube_pose import TubePose
from spirillum.studies.study_loader import load_study

LARGEST = {
    "forward_velocity": 0.011,
    "body_rotation_rate": 0.007,
    "sideways_force": 0.023,
    "pitching_torque": 0.033,
    "yawing_torque": 0.031,
    "normal_resistance": 0.026,
}
"""Above the largest stated errors, which are those of different tails."""
PRESETS = ("biorob2012-wide", "biorob2012-narrow")
WIRES: tuple[Accuracy, ...] = ("standard", "high")
"""They were solved for with the first; their thrust is that of the second."""


@lru_cache
def shipped(name: str) -> tuple[TubeTable, Places]:
    batch = RobotBatch.of(sp.load(name))
    geometry, radius = RobotGeometry.of(batch), 0.5 * float(batch.channel_diameter[0])
    table = find_table(geometry, radius)
    assert table is not None
    return table, Places(geometry, radius)


def over_a_turn(table: TubeTable, pose: TubePose) -> np.ndarray:
    return np.stack([table.at(pose.offset, pose.pitch, pose.yaw, phase)[0] for phase in even_phases()])


@pytest.mark.parametrize("name", PRESETS)
def test_presets_have_tables_that_state_their_errors(name: str) -> None:
    table, _ = shipped(name)
    assert set(table.error) == set(RESPONSES)
    assert 0 < table.error["forward_velocity"] < 0.01
    assert 0 < table.error_without_yaw["forward_velocity"] < 0.01


@pytest.mark.parametrize("name", PRESETS)
def test_a_tail_of_the_other_hand_swims_as_its_mirror_image(name: str) -> None:
    table, places = shipped(name)
    image = find_table(table.geometry._replace(hand=-1.0), table.radius)
    assert image is not None
    assert image.geometry.hand == -1.0
    draw, sign = np.random.default_rng(5), MIRROR[:, None] * MIRROR
    for _ in range(20):
        pose = places.pose_between(draw.uniform(places.gaps[0], 1.0), draw.uniform(-1.0, 1.0))
        yaw = draw.uniform(-1.0, 1.0) * largest_yaw(table.packed, pose.offset, pose.pitch)
        phase = draw.uniform(0.0, 2.0 * np.pi)
        own, left = table.at(pose.offset, pose.pitch, yaw, phase)
        other, image_left = image.at(pose.offset, pose.pitch, -yaw, np.pi - phase)
        scale = np.sqrt(np.diag(own))
        assert (left, image_left) == (INSIDE, INSIDE)
        assert np.abs((sign * other - own) / np.outer(scale, scale)).max() < 1e-10


def test_files_are_small_and_each_is_the_table_of_a_robot_of_the_paper() -> None:
    study = load_study(paper_study())
    batches = [RobotBatch.of(study.robot_at(index)) for index in range(study.count)]
    keys = {key_of(*in_tube(batch)) for batch in batches}
    files = list((Path(library.__file__).parent / "tables").glob("*.table"))
    assert len(files) == 32
    for path in files:
        table = TubeTable.read(path)
        assert path.stem == table.key
        assert table.key in keys
        for stated in (table.error, table.error_without_yaw):
            assert all(0 < stated[name] < most for name, most in LARGEST.items())
        assert path.stat().st_size < 60_000
    films = list(files[0].parent.glob("*.film"))
    assert len(films) == 2
    assert sum(path.stat().st_size for path in (*files, *films)) < 60_000 * len(files)


@pytest.mark.parametrize("name", PRESETS)
def test_positive_definite_and_symmetric_anywhere_in_the_tube(name: str) -> None:
    table, places = shipped(name)
    draw = np.random.default_rng(0)
    for _ in range(100):
        pose = places.pose_between(draw.uniform(places.gaps[0], 1.0), draw.uniform(-1, 1))
        deeper = draw.uniform(0.0, 1.0) * (places.radius - 0.009 - pose.offset) if pose.pitch == 0 else 0.0
        most = largest_yaw(table.packed, pose.offset + deeper, pose.pitch)
        yaw, phase = draw.uniform(-1, 1) * YAW_SLACK * most, draw.uniform(0, 2 * np.pi)
        matrix, left = table.at(pose.offset + deeper, pose.pitch, yaw, phase)
        scale = np.sqrt(np.diag(matrix))
        assert left == INSIDE
        assert np.array_equal(matrix, matrix.T)
        assert np.linalg.eigvalsh(matrix / np.outer(scale, scale))[0] > 1e-4


@pytest.mark.parametrize("name", PRESETS)
def test_means_over_a_turn_need_no_more_phases(name: str) -> None:
    """Where the tail is nearest to the glass, too."""
    table, places = shipped(name)
    for t, f, yaw in ((0.1, 1.0, 0.0), (1.0, 1.0, 0.0), (0.3, 0.3, 1.0)):
        pose = places.pose_between(t, f, yaw * places.largest_yaw(t, f))
        few, many = np.empty((8, 8)), np.empty((8, 8))
        for count, out in ((PHASES, few), (45, many)):
            mean_resistance_at(table.packed, pose.offset, pose.pitch, pose.yaw, count, out)
        scale = np.sqrt(np.diag(many))
        assert np.abs((few - many) / np.outer(scale, scale)).max() < 2e-6


@pytest.mark.parametrize("name", PRESETS)
def test_raised_and_lowered_noses_meet_where_the_robot_is_level(name: str) -> None:
    table, _ = shipped(name)
    for offset in (0.001, 0.004, 0.0055):
        up, down = (table.at(offset, pitch, 0.02, 1.0)[0] for pitch in (1e-9, -1e-9))
        np.testing.assert_allclose(up, down, rtol=1e-5, atol=1e-6 * np.abs(up).max())


@pytest.mark.parametrize("name", PRESETS)
def test_on_the_axis_raised_and_lowered_noses_are_mirror_images(name: str) -> None:
    """A turn of the whole by 180 degrees about the tube's axis."""
    table, places = shipped(name)
    sign = np.array([1.0, -1.0, -1.0, 1.0, -1.0, -1.0, 1.0, 1.0])
    pitch = 0.5 * float(places.most[-1].min())
    up, down = table.at(0.0, pitch, 0.0, 0.7)[0], table.at(0.0, -pitch, 0.0, 0.7 + np.pi)[0]
    allowed = 1.5 * np.array([table.error[response] for response in RESPONSES])
    assert np.all(
        response_errors(sign[:, None] * down * sign, up, over_a_turn(table, TubePose(places.radius, 0.0, pitch)))
        < allowed
    )


@pytest.mark.slow
@pytest.mark.parametrize("name", PRESETS)
@pytest.mark.parametrize(
    ("gap", "pitch", "yaw", "phase"), [(0.5, 0.0, 0.0, 0.3), (1.2, 2.0, 1.0, 2.0), (3.0, -2.0, -2.0, 4.0)]
)
def test_tables_agree_with_the_flow_solved_for(name: str, gap: float, pitch: float, yaw: float, phase: float) -> None:
    table, places = shipped(name)
    g = places.geometry
    pose = TubePose.at_gap(g.body, places.radius, 1e-3 * gap, np.radians(pitch), yaw=np.radians(yaw))
    found, left = table.at(pose.offset, pose.pitch, pose.yaw, phase)
    assert left == INSIDE
    allowed = 1.5 * np.array([table.error[response] for response in RESPONSES])
    standard, high = (matrix_of(solved(g, pose, Fineness(wire, 0.005), phase)) for wire in WIRES)
    assert np.all((response_errors(found, standard, over_a_turn(table, pose)) < allowed)[1:])
    # against the finest wire the stated error is that of the interpolation, the wire and the solids together
    assert response_errors(found, high, over_a_turn(table, pose))[0] < 1.5 * table.speed_error_at(pose.yaw)


@pytest.mark.slow
def test_a_film_with_an_extrapolated_rest_agrees_with_the_flow_solved_for() -> None:
    """At 0.1 mm, below the first nodes; coarser modes or fewer nodes to average waves miss a tenth of it and more."""
    table, places = shipped("biorob2012-wide")
    pose = TubePose.at_gap(places.geometry.body, places.radius, 1e-4)
    found, _ = table.at(pose.offset, 0.0, 0.0, 0.3)
    true = matrix_of(solved(places.geometry, pose, Fineness("standard", 1e-3, 6), 0.3))
    size = np.sqrt(np.diag(found))
    np.testing.assert_allclose(true / np.outer(size, size), found / np.outer(size, size), atol=0.015)


@pytest.mark.parametrize("wire", ["standard", pytest.param("high", marks=pytest.mark.slow)])
def test_a_yawed_place_agrees_with_the_flow_solved_for(wire: Accuracy) -> None:
    """To the right, where the nodes are those of the mirror image; far from the glass, where few modes do."""
    table, places = shipped("biorob2012-narrow")
    g = places.geometry
    pose = TubePose.at_gap(g.body, places.radius, 4e-3, np.radians(1.0), yaw=-np.radians(3.0))
    found, left = table.at(pose.offset, pose.pitch, pose.yaw, 4.0)
    assert left == INSIDE
    errors = response_errors(found, matrix_of(solved(g, pose, Fineness(wire, 0.1), 4.0)), over_a_turn(table, pose))
    if wire == "standard":
        assert np.all(errors[1:] < 5e-3)
    else:
        assert errors[0] < 2e-3


def test_nose_down_nothing_is_said_beyond_the_last_node() -> None:
    """The glass does not end the pitch there, so that no slack is the tail's way to its contact."""
    table, places = shipped("biorob2012-wide")
    pose = TubePose.at_gap(places.geometry.body, places.radius, 0.72e-3, -np.radians(8.0))
    assert table.at(pose.offset, pose.pitch)[1] == INSIDE
    last, left = table.at(pose.offset, 1.05 * pose.pitch)
    assert left == TOO_FAR_PITCHED
    assert sp.predict("biorob2012-wide", placement={"gap": "0.72 mm", "pitch": "-8 deg"}).model.form == "table"
    assert np.isfinite(last).all()


def test_a_robot_of_another_size_is_told_from_that_of_a_table() -> None:
    """The table of a prediction answers for its tail in its tube, at any viscosity."""
    robot = sp.load("biorob2012-wide")
    held, one = sp.predict(robot, motion="held", band=False), sp.RobotBatch.of(robot)
    thin = sp.swim(one.with_values({"fluid.viscosity": [1.0, robot.fluid.viscosity]}), held.model)
    assert thin.forward_velocity[1] == held.forward_velocity < thin.forward_velocity[0]
    with pytest.raises(sp.InputError, match=r"robot 1 \(tail 20 x 2.5 mm\) is not the one whose table answers"):
        sp.swim(one.with_values({"tail.wavelength": [robot.tail.wavelength, 0.02]}), held.model)
