"""Tables in stages: each is near the finest one between its nodes, and refuses poses for which it has no nodes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from spirillum.fluid.tube import building, library
from spirillum.fluid.tube.library import find_table
from spirillum.fluid.tube.nodes import Places
from spirillum.fluid.tube.outer_resistance import NodeSolution
from spirillum.fluid.tube.stages import FINE, RESPONSES, STAGES, STRAIGHT, YAW, response_errors
from spirillum.fluid.tube.table import TubeTable
from spirillum.fluid.wire.robot_geometry import RobotGeometry
from spirillum.kernels.core import INSIDE, TOO_FAR_YAWED
from spirillum.kernels.tube_table import parts_of
from spirillum.robot.batch import RobotBatch
from spirillum.robot.load import load


@pytest.fixture(scope="module", params=["biorob2012-wide", "biorob2012-narrow"])
def shipped(request: pytest.FixtureRequest) -> TubeTable:
    """The table of a preset, which stands for the solved flow."""
    batch = RobotBatch.of(load(request.param))
    table = find_table(RobotGeometry.of(batch), 0.5 * float(batch.channel_diameter[0]), "fine")
    assert table is not None
    return table


def solve_by(table: TubeTable, monkeypatch: pytest.MonkeyPatch) -> TubeTable:
    """Take every solution and the film from a table."""

    def solutions(nodes: Sequence[NodeSolution], *_: Any) -> list[list[np.ndarray]]:
        sides = {geometry.hand: one for one in (table, table.mirrored()) for geometry in [one.geometry]}
        return [
            [
                np.stack([sides[g.hand].at(n.pose.offset, n.pose.pitch, n.pose.yaw, phase)[0] for phase in phases])
                for g, phases in n.tails
            ]
            for n in nodes
        ]

    monkeypatch.setattr(building, "solutions", solutions)
    monkeypatch.setattr(building, "_tabulated_film", lambda *_: parts_of(table.packed).film)
    return table


@pytest.fixture
def solved_by(shipped: TubeTable, monkeypatch: pytest.MonkeyPatch) -> TubeTable:
    """The table of a preset, from which every solution and the film are taken."""
    return solve_by(shipped, monkeypatch)


_MADE: dict[tuple[float, str], TubeTable] = {}


def made(table: TubeTable, stage: Any) -> TubeTable:
    """A table in a stage; each is made once."""
    key = table.radius, stage.name
    if key not in _MADE:
        (_MADE[key],) = building.built_tables([(table.geometry, table.radius)], stage=stage)
    return _MADE[key]


def errors_between_nodes(table: TubeTable, truth: TubeTable, *, yawed: bool) -> dict[str, float]:
    """Largest errors of `RESPONSES` at random poses of the truth's range."""
    places, draw = Places(truth.geometry, truth.radius), np.random.default_rng(5)
    worst = np.zeros(len(RESPONSES))
    for _ in range(60):
        t, f = float(np.exp(draw.uniform(np.log(places.gaps[0]), 0.0))), float(draw.uniform(-0.9, 0.95))
        yaw = float(draw.uniform(-0.9, 0.9)) * places.largest_yaw(t, f) if yawed else 0.0
        pose = places.pose_between(t, f, yaw)
        turn = 2.0 * np.pi * np.arange(9) / 9
        own, true = (
            np.stack([one.at(pose.offset, pose.pitch, pose.yaw, phase)[0] for phase in turn]) for one in (table, truth)
        )
        worst = np.maximum(worst, response_errors(own[4], true[4], true))
    return dict(zip(RESPONSES, worst.tolist(), strict=True))


def test_straight_stage_is_near_the_finest_without_yaw(solved_by: TubeTable) -> None:
    table = made(solved_by, STRAIGHT)
    assert table.places == len(building._level(Places(solved_by.geometry, solved_by.radius, STRAIGHT)))
    found = errors_between_nodes(table, solved_by, yawed=False)
    assert found["forward_velocity"] < 0.02
    assert found["normal_resistance"] < 0.02
    assert found["sideways_force"] < 0.03
    assert max(found.values()) < 0.06
    assert table.error == table.error_without_yaw
    assert all(table.error[name] > 0.7 * found[name] for name in ("forward_velocity", "sideways_force"))
    assert "check poses between the nodes" in table.error_against


@pytest.mark.parametrize("stage", [STRAIGHT, YAW])
def test_nodes_that_are_not_positive_definite_are_solved_for_more_finely(
    solved_by: TubeTable, stage: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    right, asked = building.solutions, []

    def solutions(nodes: Sequence[NodeSolution], *arguments: Any) -> list[list[np.ndarray]]:
        asked.append(list(nodes))
        found = right(nodes, *arguments)
        if len(asked) == 1:
            found[-1][-1] = found[-1][-1] - 2.0 * found[-1][-1].trace(axis1=1, axis2=2)[:, None, None] * np.eye(8)
        return found

    expected = made(solved_by, stage)
    monkeypatch.setattr(building, "solutions", solutions)
    (table,) = building.built_tables([(solved_by.geometry, solved_by.radius)], stage=stage)
    np.testing.assert_array_equal(table.packed, expected.packed)
    ((again,),) = asked[1:]
    assert again.pose == asked[0][-1].pose
    assert again.fineness.tolerance <= asked[0][-1].fineness.tolerance
    assert again.fineness != asked[0][-1].fineness


def test_straight_stage_answers_no_yawed_pose(solved_by: TubeTable) -> None:
    table = made(solved_by, STRAIGHT)
    offset = 0.6 * (table.radius - 0.5 * table.geometry.body_diameter)
    assert table.at(offset, 0.0, 0.0)[1] == INSIDE
    assert table.at(offset, 0.0, 1e-3)[1] == TOO_FAR_YAWED


def test_yaw_stage_is_near_the_finest_with_yaw(solved_by: TubeTable) -> None:
    table = made(solved_by, YAW)
    found = errors_between_nodes(table, solved_by, yawed=True)
    assert found["forward_velocity"] < 0.02
    assert found["sideways_force"] < 0.04
    assert found["normal_resistance"] < 0.05
    assert max(found.values()) < 0.06


@pytest.mark.parametrize("yawed", [False, True])
def test_finest_stage_is_near_a_table_with_more_nodes(solved_by: TubeTable, yawed: bool) -> None:
    found = errors_between_nodes(made(solved_by, FINE), solved_by, yawed=yawed)
    assert found["forward_velocity"] < 0.005
    assert found["sideways_force"] < 0.02
    assert found["normal_resistance"] < 0.005
    assert max(found.values()) < 0.03


def test_nodes_of_a_table_give_it_back(solved_by: TubeTable, monkeypatch: pytest.MonkeyPatch) -> None:
    table = solve_by(made(solved_by, FINE), monkeypatch)
    (again,) = building.built_tables([(table.geometry, table.radius)], stage=FINE)
    np.testing.assert_allclose(parts_of(again.packed).rest, parts_of(table.packed).rest, rtol=0, atol=2e-4)


def test_the_finest_stage_that_there_is_answers(
    solved_by: TubeTable, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SPIRILLUM_CACHE", str(tmp_path))
    monkeypatch.setattr(library, "_SHIPPED", tmp_path / "none")
    robot = solved_by.geometry, solved_by.radius
    assert find_table(*robot) is None
    for stage in STAGES.values():
        library._save(made(solved_by, stage))
        found = find_table(*robot)
        assert found is not None
        assert found.stage == stage.name
        names = list(STAGES)
        assert all(find_table(*robot, name) is None for name in names[names.index(stage.name) + 1 :])
    image = solved_by.geometry._replace(hand=-solved_by.geometry.hand), solved_by.radius
    mirrored = find_table(*image, "yaw")
    assert mirrored is not None
    assert mirrored.stage == "fine"
