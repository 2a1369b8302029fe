"""Poses from runs: rotations compose, turns between samples are even, angles are counted beyond whole turns."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import spirillum as sp
from spirillum.dynamics.run_file import poses_of, rolled, rotation_matrix

TILTED = np.array([0.5, 0.5, -0.5, 0.5])


def test_matrix_of_a_turn_about_x_turns_y_to_z() -> None:
    assert rotation_matrix(rolled(0.5 * np.pi)) @ [0, 1, 0] == pytest.approx([0, 0, 1], abs=1e-15)


def test_rotor_is_the_body_turned_about_its_own_axis(free_robot: Any, run_of: Callable[..., Any]) -> None:
    run = run_of(free_robot)
    run["attitude"][:] = TILTED
    pose = poses_of(run).at(0.37)
    axis = pose.body[:3, :3] @ [1, 0, 0]
    assert pose.rotor[:3, :3] @ [1, 0, 0] == pytest.approx(axis)
    assert np.arccos(0.5 * (np.trace(pose.body[:3, :3].T @ pose.rotor[:3, :3]) - 1)) == pytest.approx(6.5 * 0.37)
    assert pose.rotor[:3, 3] == pytest.approx(pose.position)


def test_between_samples_a_robot_moves_straight_and_turns_evenly(free_robot: Any, run_of: Callable[..., Any]) -> None:
    run = run_of(free_robot, speed=0.01, body=-2.0).isel(time=[0, 20, 40])
    pose = poses_of(run).at(0.7)
    assert pose.position == pytest.approx([0.007, 0, 0])
    assert pose.body[:3, :3] == pytest.approx(rotation_matrix(rolled(-1.4)))
    assert pose.tail_phase == pytest.approx(8.0 * 0.7)


def test_sign_of_a_quaternion_does_not_matter(free_robot: Any, run_of: Callable[..., Any]) -> None:
    run, turned = run_of(free_robot), run_of(free_robot)
    turned["attitude"][::3] *= -1.0
    for time in (0.0, 0.111, 0.5, 1.0):
        assert poses_of(turned).at(time).body == pytest.approx(poses_of(run).at(time).body)


def test_roll_is_counted_beyond_whole_turns(free_robot: Any, run_of: Callable[..., Any]) -> None:
    poses = poses_of(run_of(free_robot, body=-40.0, tail=100.0))
    assert poses.roll == pytest.approx(-40.0 * poses.time)
    assert poses.tail_angle == pytest.approx(100.0 * poses.time)


def test_roll_of_a_robot_that_only_yaws_is_zero(free_robot: Any, run_of: Callable[..., Any]) -> None:
    run = run_of(free_robot)
    angle = 2.0 * run["time"].values
    run["attitude"][:] = np.stack([np.cos(angle), 0 * angle, 0 * angle, np.sin(angle)], axis=-1)
    assert poses_of(run).roll == pytest.approx(0.0 * angle)


def test_held_run_lies_at_its_height_and_rolls() -> None:
    run = sp.simulate("biorob2012-wide", motion="held", timing={"duration": 0.2, "samples_per_turn": 50}, model="rft")
    poses = poses_of(run, height=-0.011)
    end = poses.at(0.2)
    assert end.position == pytest.approx([float(run["position"][-1]), 0.0, -0.011])
    assert poses.tail_angle == pytest.approx(run["tail_angle"].values)
    assert poses.roll == pytest.approx(run["body_angle"].values)
    assert end.body[:3, :3] == pytest.approx(rotation_matrix(rolled(float(run["body_angle"][-1]))))


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda run: run.isel(time=slice(0, 1)), "has 1 samples of time; allowed: at least 2"),
        (lambda run: run.isel(time=slice(0, 0)), "has 0 samples of time"),
        (lambda run: run.isel(time=slice(None, None, -1)), "increasing"),
        (lambda run: run.drop_vars("tail_phase"), "no variable 'tail_phase'"),
        (lambda run: run.drop_vars("position"), "no variable 'position'"),
        (lambda run: run.drop_vars("attitude"), "'position' has the dimensions"),
        (lambda run: run.isel(axis=[0, 1]), "'position' has the dimensions (time: 41, axis: 2)"),
        (lambda run: run.where(run["time"] < 0.5), "is not finite at time = 0.5 s"),
        (lambda run: run.assign(attitude=0.5 * run["attitude"]), "has the length 0.5; allowed: 1"),
        (lambda run: run.assign(tail_phase=run["tail_phase"].astype(str)), "holds no numbers"),
    ],
)
def test_run_that_cannot_be_shown_is_named(
    free_robot: Any, run_of: Callable[..., Any], spoil: Callable[[Any], Any], words: str
) -> None:
    with pytest.raises(sp.InputError) as error:
        poses_of(spoil(run_of(free_robot)))
    assert words in str(error.value)
