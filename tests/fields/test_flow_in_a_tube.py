"""`sp.flow` with the model `tube`: its motion, its grids in the glass, its frame, and what it refuses."""

from typing import Any

import numpy as np
import pytest

import spirillum as sp
from spirillum.fields.flow import find_tube_pose
from spirillum.fields.grid import box_around, plane_around

WIDE, R = "biorob2012-wide", 0.02
PLACE = {"gap": "5 mm", "pitch": "2 deg"}


@pytest.fixture(scope="module")
def robot() -> sp.Robot:
    """One turn of a thick tail, seen at one phase: what is claimed does not depend on them."""
    return sp.load(WIDE, **{"tail.length": "25 mm", "tail.wire_diameter": "1.5 mm", "model.tube.phases": 1})


@pytest.fixture(scope="module")
def small() -> sp.Robot:
    """With a short tail behind a ball, whose flow is solved for in less time."""
    ball = {"body.shape": "sphere", "body.diameter": "12 mm", "body.length": "12 mm", "coupling.diameter": "0 mm"}
    ends = {"body.front": "none", "body.rear": "none", "tail.length": "20 mm", "tail.wire_diameter": "1.5 mm"}
    return sp.load(WIDE, **ball, **ends, **{"model.tube.phases": 1})


@pytest.fixture(scope="module")
def swimming(small: sp.Robot) -> sp.Flow:
    """It swims nose up in the open tube."""
    return sp.flow(
        small, model="tube", tail_rate="1.2 Hz", phase="40 deg", placement=PLACE, resolution={"tolerance": 0.05}
    )


@pytest.fixture(scope="module")
def section(swimming: sp.Flow) -> Any:
    """A plane across the tube, ahead of the robot."""
    return swimming.plane("yz", offset="30 mm", resolution=41)


def test_motion_is_the_predicted_one(swimming: sp.Flow, small: sp.Robot) -> None:
    alone = sp.predict(
        small, model="tube", tail_rate="1.2 Hz", placement=PLACE, resolution={"tolerance": 0.05}, band=False
    )
    assert swimming.prediction.forward_velocity == alone.forward_velocity
    speed, c, s = alone.forward_velocity, np.cos(np.radians(2.0)), np.sin(np.radians(2.0))
    np.testing.assert_allclose(swimming.heading, [c, 0.0, -s])
    field: Any = swimming.field
    np.testing.assert_allclose(field.twists[[0, 2, 6, 8]], speed * np.array([c, -s, c, -s]))
    assert field.twists[3] == alone.body_rotation_rate
    assert field.twists[9] == alone.tail_rotation_rate
    assert field.mean_flow == alone.plug_velocity != 0.0
    assert not any("wall" in warning for warning in swimming.warnings)


def test_held_force_is_across_the_tube(swimming: sp.Flow) -> None:
    force = swimming.field.wrench()[:3]
    along = float(force @ swimming.heading)
    assert swimming.held_force == pytest.approx(np.sqrt(force @ force - along**2))
    assert abs(along) < 0.3 * swimming.held_force


@pytest.mark.parametrize(("plane", "middle"), [("xz", 0.0), ("xy", 6.0)])
def test_planes_beside_the_tube_are_refused(robot: sp.Robot, plane: str, middle: float) -> None:
    """The body, of radius 9 mm, 5 mm above the floor of a tube of 20 mm: its axis is 6 mm below that of the tube."""
    seat = find_tube_pose(robot, "tube", {"gap": "5 mm"}, None)
    for side in (-1.0, 1.0):
        plane_around(robot, plane, f"{middle + side * 19.99} mm", resolution=8, seat=seat)
        beyond = f"{middle + side * 20.01:g} mm"
        with pytest.raises(sp.InputError, match=f"offset = {beyond} with plane = '{plane}': the plane is outside"):
            plane_around(robot, plane, beyond, resolution=8, seat=seat)


def test_grids_end_at_the_glass(swimming: sp.Flow, section: Any) -> None:
    seat, data = swimming.seat, section
    assert seat is not None
    y, z = np.meshgrid(data["y"], data["z"], indexing="ij")
    c, s = np.cos(seat.pitch), np.sin(seat.pitch)
    rho = np.hypot(y, 0.03 * s + z * c - seat.offset)
    np.testing.assert_array_equal(data["inside"], rho >= R)
    np.testing.assert_array_equal(np.isnan(data["velocity_x"]), rho >= R)
    assert R < float(data["y"][-1]) < 1.2 * R
    assert "outside the tube" in data["inside"].attrs["long_name"]
    assert "mean of both ends" in data["pressure"].attrs["long_name"]
    assert data.attrs["plug_velocity"] == swimming.prediction.plug_velocity
    assert data.attrs["model"] == "tube"


def test_as_much_flows_through_planes_as_the_mean_flow_says(swimming: sp.Flow, section: Any) -> None:
    data = section.fillna(0.0)
    through = data["velocity_x"] * swimming.heading[0] + data["velocity_z"] * swimming.heading[2]
    mean = float(through.integrate(["y", "z"])) / (np.pi * R**2)
    assert mean == pytest.approx(swimming.prediction.plug_velocity, abs=0.02 * float(np.abs(through).max()))


def test_the_body_frame_lacks_the_velocity_along_the_tube(swimming: sp.Flow) -> None:
    from dataclasses import replace

    points = np.array([[0.03, 0.0, 0.0], [-0.05, 0.008, 0.0]])
    difference = swimming.velocity(points) - replace(swimming, frame="body").velocity(points)
    np.testing.assert_allclose(difference, np.tile(swimming.prediction.forward_velocity * swimming.heading, (2, 1)))


def test_boxes_show_a_tube_whole_unless_it_is_wide_or_an_extent_is_given() -> None:
    robot = sp.load(WIDE)
    seat = find_tube_pose(robot, "tube", {"gap": "1 mm"})
    assert seat is not None
    whole = plane_around(robot, "yz", seat=seat).axes
    assert whole[1][-1] == pytest.approx(1.05 * R, rel=0.02)
    assert (whole[2][0], whole[2][-1]) == pytest.approx((0.01 - 1.05 * R, 0.01 + 1.05 * R), abs=2e-4)
    closer = box_around(robot, "3 mm", seat=seat).axes
    assert closer[2][0] == pytest.approx(0.01 - 1.05 * R, abs=1e-3)
    assert closer[2][-1] == pytest.approx(0.012, abs=1e-3)
    broad = sp.load(WIDE, **{"channel.diameter": "300 mm"})
    axes = plane_around(broad, "yz", seat=find_tube_pose(broad, "tube", {"gap": "1 mm"})).axes
    assert axes[2][-1] == pytest.approx(0.009 + 1.2 * 0.018, abs=3e-4)
    assert axes[2][0] == pytest.approx(-0.01 - 0.05 * 0.15, abs=3e-4)
    assert find_tube_pose(robot, "slender") is None


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"model": "sbt"}, "model = 'sbt'.*allowed: auto, slender, tube"),
        ({"model": "tubes"}, "model = 'tubes' .did you mean tube"),
        ({"model": "slender", "placement": {"gap": "0.5 mm"}}, "placement"),
        ({"model": "slender", "resolution": {"tolerance": 0.01}}, "tolerance = 0.01 with model 'slender'"),
        ({"model": "tube", "placement": {"gap": "5 cm"}}, "placement.gap"),
        ({"model": "tube", "placement": {"height": "5 cm"}}, "height"),
        ({"model": "tube", "resolution": {"tolerance": 1.0}}, "tolerance = 1.0; allowed"),
        ({"model": "tube", "robot": {"extends": WIDE, "channel": "none"}}, "channel"),
    ],
)
def test_wrong_questions_are_named(arguments: dict[str, Any], words: str) -> None:
    with pytest.raises(sp.InputError, match=words):
        sp.flow(**{"robot": WIDE, "tail_rate": "1.2 Hz", **arguments})
