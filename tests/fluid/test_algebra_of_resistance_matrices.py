"""Reference point, rotation, composition and joint of resistance matrices: round trips and conserved dissipation."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from spirillum.fluid.algebra import (
    about_point,
    axial_entries,
    axis_rotation,
    both_parts,
    joint_locked,
    rotated,
    skew,
    transfer,
    two_parts_axial,
)

few = settings(max_examples=20)
"""Examples of an identity between polynomials."""
numbers = st.floats(-3, 3, allow_subnormal=False)
vectors = arrays(float, 3, elements=numbers)
twists = arrays(float, 6, elements=numbers)
angles = st.floats(-7, 7).map(lambda angle: np.array([angle]))
# L L' of any lower triangle with a sound diagonal: every resistance matrix has this form.
matrices = arrays(float, (1, 6, 6), elements=numbers).map(
    lambda a: (np.tril(a) + 4 * np.eye(6)) @ np.swapaxes(np.tril(a) + 4 * np.eye(6), -1, -2)
)


def assert_same(found: np.ndarray, wanted: np.ndarray) -> None:
    np.testing.assert_allclose(found, wanted, rtol=1e-12, atol=1e-12 * (1 + np.abs(wanted).max()))


@few
@given(p=vectors, v=vectors)
def test_skew_is_the_cross_product(p: np.ndarray, v: np.ndarray) -> None:
    assert_same(skew(p) @ v, np.cross(p, v))
    np.testing.assert_array_equal(skew(p), -skew(p).T)


@few
@given(offset=vectors, twist=twists)
def test_transfer_is_the_velocity_of_a_rigid_body(offset: np.ndarray, twist: np.ndarray) -> None:
    moved = transfer(offset) @ twist
    assert_same(moved[:3], twist[:3] + np.cross(twist[3:], offset))
    np.testing.assert_array_equal(moved[3:], twist[3:])


@few
@given(first=vectors, second=vectors)
def test_transfers_compose_and_invert(first: np.ndarray, second: np.ndarray) -> None:
    assert_same(transfer(first) @ transfer(second), transfer(first + second))
    assert_same(transfer(first) @ transfer(-first), np.eye(6))


@few
@given(matrix=matrices, point=vectors, twist=twists)
def test_dissipation_does_not_know_the_reference_point(
    matrix: np.ndarray, point: np.ndarray, twist: np.ndarray
) -> None:
    """V' B V with the velocity of the new point, U + Omega x point."""
    there = np.concatenate([twist[:3] + np.cross(twist[3:], point), twist[3:]])
    assert_same(there @ about_point(matrix, point)[0] @ there, twist @ matrix[0] @ twist)


@few
@given(matrix=matrices, point=vectors, twist=twists)
def test_wrench_about_another_point(matrix: np.ndarray, point: np.ndarray, twist: np.ndarray) -> None:
    """The force stays, the torque changes by force x lever."""
    there = np.concatenate([twist[:3] + np.cross(twist[3:], point), twist[3:]])
    here, moved = matrix[0] @ twist, about_point(matrix, point)[0] @ there
    assert_same(moved[:3], here[:3])
    np.testing.assert_allclose(moved[3:], here[3:] - np.cross(point, here[:3]), rtol=1e-9, atol=1e-9)


@few
@given(matrix=matrices, first=vectors, second=vectors)
def test_reference_points_compose_and_return(matrix: np.ndarray, first: np.ndarray, second: np.ndarray) -> None:
    scale = 1e-12 * np.abs(matrix).max() * (1 + np.abs(first).max() + np.abs(second).max()) ** 4
    at_first = about_point(matrix, first)
    np.testing.assert_allclose(about_point(at_first, -first), matrix, atol=scale)
    np.testing.assert_allclose(about_point(at_first, second), about_point(matrix, first + second), atol=scale)


@few
@given(angle=angles)
def test_rotation_about_x(angle: np.ndarray) -> None:
    """From y towards z, as the tail turns for a positive rate."""
    q = axis_rotation(angle)[0]
    assert_same(q @ q.T, np.eye(3))
    assert np.linalg.det(q) == pytest.approx(1, rel=1e-14)
    assert_same(q @ np.array([1.0, 0, 0]), np.array([1.0, 0, 0]))
    assert_same(q @ np.array([0, 1.0, 0]), np.array([0, np.cos(angle[0]), np.sin(angle[0])]))


@few
@given(matrix=matrices, one=angles, other=angles, twist=twists)
def test_rotations_compose_and_keep_dissipation(
    matrix: np.ndarray, one: np.ndarray, other: np.ndarray, twist: np.ndarray
) -> None:
    turned = rotated(matrix, axis_rotation(one))
    assert_same(rotated(turned, axis_rotation(other)), rotated(matrix, axis_rotation(one + other)))
    assert_same(rotated(turned, axis_rotation(-one)), matrix)
    q = axis_rotation(one)[0]
    moved = np.concatenate([q @ twist[:3], q @ twist[3:]])
    assert_same(moved @ turned[0] @ moved, twist @ matrix[0] @ twist)


@few
@given(matrix=matrices, point=vectors, angle=angles)
def test_turning_and_shifting_commute(matrix: np.ndarray, point: np.ndarray, angle: np.ndarray) -> None:
    q = axis_rotation(angle)
    shifted_first = rotated(about_point(matrix, point), q)
    turned_first = about_point(rotated(matrix, q), (q[0] @ point))
    np.testing.assert_allclose(shifted_first, turned_first, rtol=1e-11, atol=1e-11 * np.abs(shifted_first).max())


@few
@given(body=matrices, rotor=matrices, twist=twists)
def test_locked_joint_adds_the_parts(body: np.ndarray, rotor: np.ndarray, twist: np.ndarray) -> None:
    both = both_parts(body, rotor)
    assert_same(joint_locked(both), body + rotor)
    together = np.concatenate([twist, twist])
    assert_same(together @ both[0] @ together, twist @ joint_locked(both)[0] @ twist)


@few
@given(full=arrays(float, (2, 12, 12), elements=numbers), twist=twists)
def test_locked_joint_keeps_interaction(full: np.ndarray, twist: np.ndarray) -> None:
    spd = full @ np.swapaxes(full, -1, -2)
    together = np.concatenate([twist, twist])
    for i in range(2):
        assert_same(together @ spd[i] @ together, twist @ joint_locked(spd)[i] @ twist)


def test_axial_entries_are_forces_and_torques_along_x() -> None:
    full = np.arange(144.0).reshape(1, 12, 12)
    names = [f"{kind}{axis}{part}" for part in "br" for kind in "FT" for axis in "xyz"]
    wanted = [names.index(name) for name in ("Fxb", "Txb", "Fxr", "Txr")]
    np.testing.assert_array_equal(axial_entries(full)[0], full[0][np.ix_(wanted, wanted)])


@few
@given(body=matrices, rotor=matrices)
def test_axial_form_from_entries(body: np.ndarray, rotor: np.ndarray) -> None:
    def three(m: np.ndarray) -> tuple[Any, Any, Any]:
        return m[:, 0, 0], m[:, 0, 3], m[:, 3, 3]

    np.testing.assert_array_equal(two_parts_axial(three(body), three(rotor)), axial_entries(both_parts(body, rotor)))


def test_leading_axes_broadcast() -> None:
    """Five robots at once, about one point and about five."""
    rng = np.random.default_rng(0)
    half = rng.normal(size=(5, 6, 6))
    many, points = half @ np.swapaxes(half, -1, -2), rng.normal(size=(5, 3))
    turned = axis_rotation(np.linspace(0, 1, 5))
    for i in range(5):
        assert_same(about_point(many, points[0])[i], about_point(many[i : i + 1], points[0])[0])
        assert_same(about_point(many, points)[i], about_point(many[i : i + 1], points[i])[0])
        assert_same(rotated(many, turned)[i], rotated(many[i : i + 1], turned[i : i + 1])[0])
    assert both_parts(many[:1], many).shape == (5, 12, 12)
