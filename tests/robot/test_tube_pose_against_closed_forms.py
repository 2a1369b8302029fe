"""Where a robot sits in its tube, against closed forms and against points on its surface."""

from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from spirillum.robot.outline import Arc, Outline, body_outline, cylinder_outline, solid_outlines
from spirillum.robot.tail_form import centreline
from spirillum.robot.tube_pose import STEEPEST_PITCH, TubePose, contact_pitch, largest_gap

R = 0.02
SHAPES: dict[str, Outline] = {
    "capsule": body_outline("capsule", 0.018, 0.035, 0.0, "hemisphere", "flat"),
    "rounded": body_outline("capsule", 0.018, 0.035, 0.0, "hemisphere", "hemisphere"),
    "cylinder": body_outline("cylinder", 0.012, 0.03, 0.002, "fillet", "flat"),
    "spheroid": body_outline("spheroid", 0.01, 0.05, 0.0, None, None),
    "sphere": body_outline("sphere", 0.018, 0.018, 0.0, None, None),
}
pitches = st.floats(0.0, np.radians(30))
tilts = st.floats(-np.radians(30), np.radians(30))
offsets = st.floats(-0.009, 0.009)


def in_tube(points: np.ndarray, e: float, pitch: float, yaw: float = 0.0) -> np.ndarray:
    """Distance of points of the robot's frame from the tube's axis, by turning and shifting them."""
    x, y, z = points.T
    along, up = x * np.cos(pitch) - z * np.sin(pitch), x * np.sin(pitch) + z * np.cos(pitch)
    return np.hypot(along * np.sin(yaw) + y * np.cos(yaw), up - e)


def turned(points: np.ndarray, phase: float) -> np.ndarray:
    """Points turned about the x axis."""
    x, y, z = points.T
    c, s = np.cos(phase), np.sin(phase)
    return np.stack([x, c * y - s * z, s * y + c * z], axis=-1)


@lru_cache
def surface(shape: str, along: int = 200, around: int = 181) -> np.ndarray:
    """Points on one side of a surface of revolution, edges included: the other side is its mirror image in y."""
    outline = SHAPES[shape]
    x, rho = (
        np.concatenate(part) for part in zip(*(p.points(np.linspace(0, 1, along)) for p in outline.pieces), strict=True)
    )
    theta = np.linspace(-np.pi / 2, np.pi / 2, around)[:, None]
    return np.stack([x + 0 * theta, rho * np.cos(theta), rho * np.sin(theta)], axis=-1).reshape(-1, 3)


@lru_cache(maxsize=8)
def helix(phase: float = 0.0, count: int = 301) -> np.ndarray:
    """The paper's tail (25, 2.5 mm)."""
    columns = {"root": 0.0275, "wavelength": 0.025, "amplitude": 0.0025, "length": 0.06, "taper": 100.0, "hand": 1.0}
    arrays = {name: np.full(1, value) for name, value in {**columns, "phase": phase}.items()}
    return centreline(np.linspace(0, 0.06, count), **arrays).position


@pytest.mark.parametrize("shape", SHAPES)
@settings(max_examples=10)  # of each of five shapes
@given(e=offsets, pitch=pitches)
def test_gap_against_points_on_the_surface(shape: str, e: float, pitch: float) -> None:
    brute = R - in_tube(surface(shape), e, pitch).max()
    found = TubePose(R, e, pitch).clearance(SHAPES[shape])
    assert found <= brute + 1e-15  # no point of the surface is closer
    assert found == pytest.approx(brute, abs=1e-6)


@pytest.mark.parametrize("shape", SHAPES)
@settings(max_examples=10)  # of each of five shapes
@given(share=st.floats(0.0, 0.999))
def test_level_body(shape: str, share: float) -> None:
    """E = R - a - gap, and no gap is larger than R - a."""
    a = max(float(p.points(np.linspace(0, 1, 3))[1].max()) for p in SHAPES[shape].pieces)
    gap = (R - a) * (1 - share)
    e = TubePose.at_gap(SHAPES[shape], R, gap).offset
    assert e == pytest.approx(R - a - gap, abs=1e-15)
    assert TubePose(R, e).clearance(SHAPES[shape]) == pytest.approx(gap, abs=1e-15)
    assert largest_gap(SHAPES[shape], R) == pytest.approx(R - a, abs=1e-15)
    assert np.isnan(TubePose.at_gap(SHAPES[shape], R, 1.001 * (R - a)).offset)


@given(e=offsets, pitch=pitches)
def test_sphere_does_not_feel_its_pitch(e: float, pitch: float) -> None:
    assert TubePose(R, e, pitch).clearance(SHAPES["sphere"]) == pytest.approx(R - 0.009 - abs(e), abs=1e-12)
    shifted = Outline((Arc((-0.02, 0.0), (0.004, 0.004), (0.0, np.pi)),), ())  # off the centre of rotation
    centre = abs(-e - 0.02 * np.sin(pitch))
    assert TubePose(R, e, pitch).clearance(shifted) == pytest.approx(R - 0.004 - centre, abs=1e-12)


@given(e=offsets, pitch=pitches)
def test_capsule_is_a_ball_along_a_line(e: float, pitch: float) -> None:
    """Two hemispheres and their hull: the ball's centre is farthest from the axis at one end of the line."""
    ends = np.abs(-e + np.array([1, -1]) * 0.0085 * np.sin(pitch))
    assert TubePose(R, e, pitch).clearance(SHAPES["rounded"]) == pytest.approx(R - 0.009 - ends.max(), abs=1e-12)


@given(gap=st.floats(1e-5, 3e-3), pitch=st.floats(0.0, np.radians(15)))
def test_offset_of_a_pitched_capsule(gap: float, pitch: float) -> None:
    e = TubePose.at_gap(SHAPES["rounded"], R, gap, pitch).offset
    assert e == pytest.approx(R - 0.009 - gap - 0.0085 * np.sin(pitch), abs=1e-12)


@pytest.mark.parametrize("shape", ["capsule", "cylinder", "spheroid"])
@settings(max_examples=10)  # of each of five shapes
@given(gap=st.floats(1e-5, 2e-3), pitch=st.floats(0.0, np.radians(20)))
def test_offset_and_gap_are_inverse(shape: str, gap: float, pitch: float) -> None:
    e = TubePose.at_gap(SHAPES[shape], R, gap, pitch).offset
    assert TubePose(R, e, pitch).clearance(SHAPES[shape]) == pytest.approx(gap, abs=1e-14)
    assert TubePose(R, e + 1e-5, pitch).clearance(SHAPES[shape]) < gap < largest_gap(SHAPES[shape], R, pitch)


def test_nose_at_the_top_leaves_no_place() -> None:
    steep = np.radians(44)
    assert largest_gap(SHAPES["rounded"], R, steep) == pytest.approx(R - 0.009 - 0.0085 * np.sin(steep), abs=1e-9)
    assert np.isnan(TubePose.at_gap(SHAPES["rounded"], R, 0.0052, steep).offset)
    assert not np.isnan(TubePose.at_gap(SHAPES["rounded"], R, 0.005, steep).offset)


@given(e=st.floats(0.0, 0.005), pitch=pitches, drop=st.floats(0.0, 0.002))
def test_straight_rod(e: float, pitch: float, drop: float) -> None:
    """A rod on the motor axis: its far end is lowest, -e - x sin(pitch) - drop cos(pitch)."""
    rod = np.stack([np.linspace(-0.0275, -0.0875, 61), np.zeros(61), np.zeros(61)], axis=-1)
    found = TubePose(R, e, pitch, drop).tail_clearance(rod, 0.0005)
    depth = e + 0.0875 * np.sin(pitch) + drop * np.cos(pitch)
    assert found.clearance == pytest.approx(R - 0.0005 - depth, abs=1e-15)
    assert found.index == 60 or pitch < 1e-12


@settings(max_examples=10)
@given(e=st.floats(0.0, 0.009), pitch=pitches, drop=st.floats(0.0, 0.003))
def test_whole_turn_in_closed_form(e: float, pitch: float, drop: float) -> None:
    """The closed form is the limit of many phases, attained at the phase and point that it names."""
    points = helix(count=301)
    whole = TubePose(R, e, pitch, drop).tail_clearance(points, 0.0005)
    lowered = e + drop * np.cos(pitch)
    phases = np.linspace(0, 2 * np.pi, 361)
    many = min(R - 0.0005 - in_tube(turned(points, phase), lowered, pitch).max() for phase in phases)
    assert 0 <= many - whole.clearance + 1e-15 <= 0.0025 * np.radians(1) ** 2
    there = R - 0.0005 - in_tube(turned(points, whole.phase), lowered, pitch)
    assert there.min() == pytest.approx(whole.clearance, abs=1e-14)
    assert there[whole.index] == pytest.approx(whole.clearance, abs=1e-14)


@given(phase=st.floats(0.0, 6.28), e=st.floats(0.0, 0.009), pitch=pitches)
def test_phase_is_that_of_the_wires_equation(phase: float, e: float, pitch: float) -> None:
    """The phase of closest approach does not depend on the phase at which the centreline is given."""
    pose = TubePose(R, e, pitch)
    found, ahead = (pose.tail_clearance(helix(at, count=301), 0.0005) for at in (0.0, phase))
    assert ahead.clearance == pytest.approx(found.clearance, abs=1e-14)
    there = in_tube(helix(found.phase, count=301), e, pitch)
    assert found.clearance == pytest.approx(R - 0.0005 - there.max(), abs=1e-14)


def test_contact_of_a_straight_rod_against_its_angle() -> None:
    """A ball with a rod behind it: e = R - a - gap at any pitch, and the tip touches where e + l sin(pitch) = R - b."""
    rod = np.stack([np.linspace(-0.0275, -0.0875, 61), np.zeros(61), np.zeros(61)], axis=-1)
    for gap, keep in ((1e-4, 0.0), (5e-4, 0.0), (5e-4, 2e-4)):
        found = contact_pitch(SHAPES["sphere"], rod, 0.0005, R, gap, clearance=keep)
        expected = np.arcsin((R - 0.0005 - keep - (R - 0.009 - gap)) / 0.0875)
        assert found == pytest.approx(expected, abs=1e-9)


def test_contact_of_the_papers_robot(batch_of: Callable[..., Any]) -> None:
    b = batch_of()
    body = body_outline(b.shape, 0.018, 0.035, 0.0, b.front, b.rear)
    coupling = solid_outlines(body, 0.035, 0.008, 0.01, 0.0005)["coupling"]
    for gap in (1e-4, 5e-4, 1e-3):
        found = contact_pitch(body, helix(), 0.0005, R, gap, coupling=coupling)
        e = TubePose.at_gap(body, R, gap, found).offset
        assert TubePose(R, e, found).tail_clearance(helix(), 0.0005).clearance == pytest.approx(0, abs=1e-10)
        steeper = found + 1e-4
        lower = TubePose.at_gap(body, R, gap, steeper).offset
        assert TubePose(R, lower, steeper).tail_clearance(helix(), 0.0005).clearance < 0
        assert contact_pitch(body, helix(), 0.0005, R, gap, tail_drop=1e-3) < found


def test_contact_is_bounded_by_coupling_nose_and_the_largest_pitch() -> None:
    body, stub = SHAPES["sphere"], np.array([[-0.0275, 0.0, 0.0], [-0.028, 0.0, 0.0]])
    thick = cylinder_outline(0.014, -0.0095, -0.027)
    by_coupling = contact_pitch(body, stub, 0.0005, R, 5e-4, coupling=thick)
    e = TubePose.at_gap(body, R, 5e-4, by_coupling).offset
    assert TubePose(R, e, by_coupling).clearance(thick) == pytest.approx(0, abs=1e-10)
    assert contact_pitch(body, stub, 0.0005, 0.03, 0.015) == STEEPEST_PITCH
    assert np.isnan(contact_pitch(body, stub, 0.0005, R, 5e-4, tail_drop=0.012))
    assert np.isnan(contact_pitch(body, stub, 0.0005, R, 0.0111))  # no place for that gap, even level
    # Two hemispheres in a tube hardly wider: the nose reaches the top before a short tail the floor.
    capsule = SHAPES["rounded"]
    found = contact_pitch(capsule, np.array([[-0.018, 0.0, 0.0]]), 0.0005, 0.0095, 1e-4)
    assert found == pytest.approx(np.arcsin((0.0095 - 0.009 - 1e-4) / 0.0085), abs=1e-6)


@pytest.mark.parametrize("shape", SHAPES)
@settings(max_examples=10)  # of each of five shapes
@given(e=offsets, pitch=tilts, yaw=tilts)
def test_yawed_gap_against_points_on_the_surface(shape: str, e: float, pitch: float, yaw: float) -> None:
    one_side = surface(shape)
    brute = R - max(in_tube(one_side * [1, side, 1], e, pitch, yaw).max() for side in (-1, 1))
    found = TubePose(R, e, pitch, yaw=yaw).clearance(SHAPES[shape])
    assert found <= brute + 1e-14
    assert found == pytest.approx(brute, abs=1e-6)
    assert TubePose(R, e, pitch, yaw=-yaw).clearance(SHAPES[shape]) == pytest.approx(found, abs=1e-14)
    turned_over = TubePose(R, -e, -pitch, yaw=yaw).clearance(SHAPES[shape])
    assert turned_over == pytest.approx(found, abs=1e-14)


@settings(max_examples=20)
@given(pitch=tilts)
def test_on_the_axis_yaw_is_pitch_to_the_side(pitch: float) -> None:
    for outline in SHAPES.values():
        up, aside = TubePose(R, 0.0, pitch).clearance(outline), TubePose(R, 0.0, yaw=pitch).clearance(outline)
        assert aside == pytest.approx(up, abs=1e-13)
    up_tail, aside_tail = (
        pose.tail_clearance(helix(), 0.0005) for pose in (TubePose(R, 0.0, pitch), TubePose(R, 0.0, yaw=pitch))
    )
    assert aside_tail.clearance == pytest.approx(up_tail.clearance, abs=1e-13)


@settings(max_examples=10)
@given(e=offsets, pitch=tilts, yaw=tilts, drop=st.floats(0.0, 0.003))
def test_whole_turn_of_a_yawed_tail(e: float, pitch: float, yaw: float, drop: float) -> None:
    points, lower = helix(count=301), np.array([0.0, 0.0, -drop])
    whole = TubePose(R, e, pitch, drop, yaw).tail_clearance(points, 0.0005)
    phases = np.linspace(0, 2 * np.pi, 361)
    many = min(R - 0.0005 - in_tube(turned(points, phase) + lower, e, pitch, yaw).max() for phase in phases)
    assert -1e-14 <= many - whole.clearance <= 0.0025 * np.radians(1) ** 2
    there = R - 0.0005 - in_tube(turned(points, whole.phase) + lower, e, pitch, yaw)
    assert there.min() == pytest.approx(whole.clearance, abs=1e-14)
    assert there[whole.index] == pytest.approx(whole.clearance, abs=1e-14)


@pytest.mark.parametrize("shape", ["capsule", "spheroid"])
@settings(max_examples=5)
@given(gap=st.floats(1e-5, 2e-3), pitch=st.floats(-0.2, 0.2), yaw=st.floats(-0.2, 0.2))
def test_offset_of_a_yawed_body(shape: str, gap: float, pitch: float, yaw: float) -> None:
    """Nose down as nose up; the lower of the two poses with that gap; continuous where the yaw goes to zero."""
    e = TubePose.at_gap(SHAPES[shape], R, gap, pitch, yaw=yaw).offset
    assert TubePose(R, e, pitch, yaw=yaw).clearance(SHAPES[shape]) == pytest.approx(gap, abs=1e-13)
    assert TubePose(R, e + 1e-5, pitch, yaw=yaw).clearance(SHAPES[shape]) < gap
    assert gap < largest_gap(SHAPES[shape], R, pitch, yaw)
    hardly, straight = (TubePose.at_gap(SHAPES[shape], R, gap, pitch, yaw=angle).offset for angle in (1e-9, 0.0))
    assert hardly == pytest.approx(straight, abs=1e-10)


def test_contact_nose_down_and_yawed() -> None:
    """A ball with a rod behind it, lying: nose down the rod's end touches the roof, yawed it touches sooner."""
    rod = np.stack([np.linspace(-0.0275, -0.0875, 61), np.zeros(61), np.zeros(61)], axis=-1)
    gap, e = 5e-4, R - 0.009 - 5e-4
    down = TubePose.at_gap(SHAPES["sphere"], R, gap, -np.arcsin((R - 0.0005 + e) / 0.0875))
    assert down.tail_clearance(rod, 0.0005).clearance == pytest.approx(0.0, abs=1e-10)
    up, yawed = (contact_pitch(SHAPES["sphere"], rod, 0.0005, R, gap, yaw=yaw) for yaw in (0.0, 0.05))
    assert 0 < yawed < up
    where = np.array([-0.0875 * np.cos(yawed) * np.sin(0.05), -e - 0.0875 * np.sin(yawed)])
    assert np.hypot(*where) == pytest.approx(R - 0.0005, abs=1e-10)


def test_axes_of_the_pose() -> None:
    """Nose to +y with yaw, up with pitch; `forward` is the tube's axis in body axes."""
    pose = TubePose(R, 0.003, 0.2, yaw=0.1)
    nose = pose.placed(np.array([[1.0, 0.0, 0.0]]))[0] + [0.0, 0.003, 0.0]
    wanted = [np.cos(0.2) * np.cos(0.1), np.sin(0.2), -np.cos(0.2) * np.sin(0.1)]  # x, up, right
    np.testing.assert_allclose(nose, wanted, atol=1e-15)
    np.testing.assert_allclose(pose.rotation @ pose.rotation.T, np.eye(3), atol=1e-15)
    assert pose.forward[0] == pytest.approx(np.cos(0.2) * np.cos(0.1))
    assert pose.forward[1] == pytest.approx(-np.sin(0.1))
    x, rho = np.array([0.01, -0.03]), np.array([0.005, 0.002])
    many = [
        R - in_tube(np.stack([0 * t + xi, r * np.cos(t), r * np.sin(t)], axis=1), 0.003, 0.2, 0.1).max()
        for xi, r in zip(x, rho, strict=True)
        for t in [np.linspace(0, 2 * np.pi, 2001)]
    ]
    np.testing.assert_allclose(pose.distances(x, rho), many, atol=1e-6)
