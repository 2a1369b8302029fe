"""The field of coils in a controller's hand: it turns about any axis, and its angle does not jump."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import spirillum as sp
from spirillum.dynamics.plant import Plant
from spirillum.kernels.core import (
    DRIVE_AXIS_Y,
    DRIVE_AXIS_Z,
    DRIVE_FIELD,
    DRIVE_FIELD_PHASE,
    DRIVE_FIELD_RATE,
    DRIVE_SIZE,
    field_at,
)


@pytest.mark.parametrize(("yaw", "pitch"), [(0.0, 0.0), (0.3, 0.0), (-0.2, 0.5)])
def test_the_field_is_that_about_x_rotated_to_its_axis(yaw: float, pitch: float) -> None:
    """It keeps its strength, is at right angles to its axis, and turns about it at its rate."""
    axis = np.array([np.cos(pitch) * np.cos(yaw), np.cos(pitch) * np.sin(yaw), np.sin(pitch)])
    drive = np.zeros(DRIVE_SIZE)
    drive[[DRIVE_FIELD, DRIVE_FIELD_RATE, DRIVE_FIELD_PHASE, DRIVE_AXIS_Y, DRIVE_AXIS_Z]] = (
        2.0,
        3.0,
        0.4,
        axis[1],
        axis[2],
    )
    times = np.linspace(0.0, 2.0, 9)
    found = np.empty((9, 3))
    for row, time in zip(found, times, strict=True):
        field_at(time, drive, row)
    assert np.linalg.norm(found, axis=1) == pytest.approx(np.full(9, 2.0))
    assert found @ axis == pytest.approx(np.zeros(9), abs=1e-12)
    turned = [Rotation.from_rotvec(3.0 * time * axis).apply(found[0]) for time in times]
    assert found == pytest.approx(np.array(turned), abs=1e-12)


def test_a_robot_goes_along_the_axis_of_its_field() -> None:
    """Without walls space has no directions: with the axis yawed the run is the same one, turned."""
    straight, aside = (
        Plant("magnetic-helix", model="rft", weight=False),
        Plant("magnetic-helix", model="rft", weight=False),
    )
    yaw = 0.4
    turn = Rotation.from_euler("z", yaw)
    state = aside.state
    attitude = (turn * Rotation.from_quat(state.state[3:7], scalar_first=True)).as_quat(scalar_first=True)
    aside.reset(type(state)(**{**vars(state), "state": (*state.state[:3], *attitude, *state.state[7:])}))
    for _ in range(4):
        one, other = straight.step(0.8), aside.step(0.8, field={"yaw": yaw})
    assert other.pose.position == pytest.approx(turn.apply(one.pose.position), abs=1e-8)
    for name in ("phase_lag", "wobble_angle", "drive_torque"):
        assert other.values[name] == pytest.approx(one.values[name], rel=1e-4, abs=1e-6)


def test_a_run_in_a_tilted_field_comes_to_swim_along_its_axis() -> None:
    """From its start along x it turns into the axis; then it is the run in a straight field, turned."""
    yaw, pitch = np.radians(20.0), np.radians(10.0)
    axis = np.array([np.cos(pitch) * np.cos(yaw), np.cos(pitch) * np.sin(yaw), np.sin(pitch)])
    last = 200  # samples of ten turns
    speeds = []
    for field, along in ((None, np.eye(3)[0]), ({"yaw": "20 deg", "pitch": "10 deg"}, axis)):
        timing = {"turns": 40.0, "samples_per_turn": 20}
        run = sp.simulate("magnetic-helix", model="rft", weight=False, timing=timing, field=field)
        way = run["position"].values[-1] - run["position"].values[-1 - last]
        speeds.append(float(np.linalg.norm(way)) / float(run["time"][-1] - run["time"][-1 - last]))
        assert way @ along == pytest.approx(np.linalg.norm(way), rel=1e-5)
        lags = run["phase_lag"].values[-last:], run["wobble_angle"].values[-last:]
        speeds += [float(np.mean(lag)) for lag in lags]
    assert speeds[3:] == pytest.approx(speeds[:3], rel=1e-3)
    assert run.attrs["field_yaw"] == pytest.approx(yaw)
    said = run.attrs["warnings"]
    assert "(yaw 20 deg, pitch 10 deg): velocities are those along x" in said
    assert float(said.partition("it swims at ")[2].split()[0]) == pytest.approx(1e3 * speeds[0], rel=0.01)


@pytest.mark.parametrize(
    ("robot", "motion", "field", "words"),
    [
        ("biorob2012-wide", "free", {"yaw": 0.1}, "field.yaw without a field; allowed: with drive.kind = 'magnetic'"),
        ("biorob2012-wide", "held", {"yaw": 0.1}, "field with motion 'held'"),
        ("magnetic-helix", "free", {"strength": 1e-3}, "field.strength of a run; allowed: magnetic.field of the robot"),
        ("magnetic-helix", "free", {"pitch": "80 deg"}, "field.pitch"),
    ],
)
def test_wrong_fields_of_a_run_are_a_sentence(robot: str, motion: str, field: dict[str, object], words: str) -> None:
    with pytest.raises(sp.InputError, match=words):
        sp.simulate(robot, model="rft", motion=motion, field=field)


def test_the_angle_of_the_field_does_not_jump() -> None:
    """A rate that changes for no time changes nothing; a tilted axis that is set again is no change."""
    one, other = Plant("magnetic-helix", model="rft"), Plant("magnetic-helix", model="rft")
    one.step(1.3)
    other.step(0.7)
    other.step(1e-7, field={"rotation_rate": "1.7 Hz"})
    last = other.step(0.6 - 1e-7, field={"rotation_rate": "1 Hz"})
    assert last.pose.position == pytest.approx(one.observe().pose.position, abs=1e-8)
    assert last.values["phase_lag"] == pytest.approx(one.observe().values["phase_lag"], abs=1e-4)
    kept = other.state
    ahead = other.step(0.5, field={"yaw": 0.1})
    other.reset(kept)
    assert other.step(0.5, field={"yaw": "0.1 rad"}).pose.position == pytest.approx(ahead.pose.position, abs=1e-12)


def test_wrong_fields_are_a_sentence_and_nothing_moves() -> None:
    plant = Plant("magnetic-helix", model="rft")
    for field, sentence in (
        ({"yaw": "80 deg"}, "field.yaw"),
        ({"speed": 1.0}, "field.speed is not a known field"),
        ({"strength": -1.0}, "field.strength"),
    ):
        with pytest.raises(sp.InputError, match=sentence):
            plant.step(0.1, field=field)
    assert plant.state.time == 0.0
    with pytest.raises(sp.InputError, match=r"field is given to biorob2012-wide; allowed: .* 'magnetic'"):
        Plant("biorob2012-wide", model="rft").step(0.1, field={"yaw": 0.1})
