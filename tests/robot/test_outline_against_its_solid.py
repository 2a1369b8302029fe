"""Outlines of body and coupling against the volumes and profiles of the solids that they bound."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spirillum.robot import geometry
from spirillum.robot.outline import Arc, Outline, Segment, body_outline, cylinder_outline

ENDS = ["hemisphere", "flat", "fillet"]
DIAMETER, LENGTH, FILLET = 0.018, 0.035, 0.0037


def volume_and_moment(outline: Outline) -> np.ndarray:
    """pi int rho^2 dx and pi int rho^2 x dx along the pieces, from front to rear, by Gauss quadrature."""
    nodes, weights = np.polynomial.legendre.leggauss(60)
    t = 0.5 * (1 + nodes)
    total = np.zeros(2)
    for piece in outline.pieces:
        x, rho = piece.points(t)
        speed = (piece.points(t + 1e-6)[0] - piece.points(t - 1e-6)[0]) / 2e-6
        total -= 0.5 * np.pi * np.array([weights @ (rho**2 * speed), weights @ (rho**2 * x * speed)])
    return total


def end_volume_and_moment(end: str) -> tuple[float, float, float]:
    """Volume of an end, its first moment about the plane where it joins the straight part, and its height."""
    R, f = DIAMETER / 2, FILLET
    core = R - f
    return {
        "hemisphere": (2 / 3 * np.pi * R**3, np.pi * R**4 / 4, R),
        "fillet": (
            np.pi * (core**2 * f + np.pi / 2 * core * f**2 + 2 / 3 * f**3),
            np.pi * (core**2 * f**2 / 2 + 2 / 3 * core * f**3 + f**4 / 4),
            f,
        ),
        "flat": (0.0, 0.0, 0.0),
    }[end]


@pytest.mark.parametrize("front", ENDS)
@pytest.mark.parametrize("rear", ENDS)
def test_volume_and_centroid(front: str, rear: str) -> None:
    outline = body_outline("cylinder", DIAMETER, LENGTH, FILLET, front, rear)
    columns = [np.array([value]) for value in (DIAMETER, LENGTH, FILLET)]
    volume = geometry.body_volume("cylinder", *columns, front, rear)[0]
    (v_f, m_f, h_f), (v_r, m_r, h_r) = end_volume_and_moment(front), end_volume_and_moment(rear)
    x_f, x_r = LENGTH / 2 - h_f, -LENGTH / 2 + h_r
    straight = np.pi * DIAMETER**2 / 8 * (x_f**2 - x_r**2)
    centroid = (straight + v_f * x_f + m_f + v_r * x_r - m_r) / volume
    found, moment = volume_and_moment(outline)
    assert found == pytest.approx(volume, rel=1e-9)
    assert moment / found == pytest.approx(centroid, rel=1e-7, abs=1e-9 * LENGTH)


@pytest.mark.parametrize(("shape", "length"), [("sphere", DIAMETER), ("spheroid", LENGTH)])
def test_spheroid(shape: str, length: float) -> None:
    outline = body_outline(shape, DIAMETER, length, 0.0, None, None)
    assert volume_and_moment(outline)[0] == pytest.approx(np.pi / 6 * DIAMETER**2 * length, rel=1e-9)
    assert outline.corners == ()


CASES = {
    **{f"{f}-{r}": body_outline("cylinder", DIAMETER, LENGTH, FILLET, f, r) for f in ENDS for r in ENDS},
    "sphere": body_outline("sphere", DIAMETER, DIAMETER, 0.0, None, None),
    "spheroid": body_outline("spheroid", DIAMETER, LENGTH, 0.0, None, None),
    "ball of two caps": body_outline("capsule", DIAMETER, DIAMETER, 0.0, "hemisphere", "hemisphere"),
    "cap": body_outline("capsule", DIAMETER, 0.5 * DIAMETER, 0.0, "hemisphere", "flat"),
    "full fillet": body_outline("cylinder", DIAMETER, LENGTH, 0.5 * DIAMETER, "fillet", "flat"),
    "coupling": cylinder_outline(0.006, -0.018, -0.027),
}


def test_the_plane_between_two_caps_is_inside() -> None:
    """cos(pi/2) is 6e-17: neither cap alone reaches the middle."""
    assert CASES["ball of two caps"].contains(np.zeros(2), np.array([0.0, 0.4 * DIAMETER])).all()


@pytest.mark.parametrize("name", CASES)
def test_closed_line_from_pole_to_pole(name: str) -> None:
    """Pieces join, start and end on the axis, run from front to rear, and are as wide and long as the solid."""
    outline = CASES[name]
    ends = [[piece.points(np.array([t])) for t in (0.0, 1.0)] for piece in outline.pieces]
    for (_, before), (after, _) in pairwise(ends):
        np.testing.assert_allclose(before, after, atol=1e-15)
    assert ends[0][0][1][0] == pytest.approx(0.0, abs=1e-17)
    assert ends[-1][1][1][0] == pytest.approx(0.0, abs=1e-17)
    assert ends[0][0][0][0] > ends[-1][1][0][0]
    assert all(piece.length > 0 for piece in outline.pieces)
    x, rho = (
        np.concatenate(part) for part in zip(*(p.points(np.linspace(0, 1, 400)) for p in outline.pieces), strict=True)
    )
    assert np.all(np.diff(x) <= 1e-15)
    assert np.max(rho) == pytest.approx(0.003 if name == "coupling" else DIAMETER / 2, rel=1e-4)


@pytest.mark.parametrize("name", CASES)
def test_corners_are_where_the_tangent_turns(name: str) -> None:
    """Sharp edges are marked, smooth joints are not, and no edge lies on the axis."""
    outline = CASES[name]
    assert len(outline.corners) == len(outline.pieces) - 1

    def direction(piece: Segment | Arc, t: float) -> np.ndarray:
        (x, rho) = piece.points(np.array([t, t + 1e-7]))
        step = np.array([x[1] - x[0], rho[1] - rho[0]])
        return step / np.linalg.norm(step)

    for (before, after), sharp in zip(pairwise(outline.pieces), outline.corners, strict=True):
        turn = direction(before, 1.0 - 1e-7) @ direction(after, 0.0)
        assert turn == pytest.approx(0.0 if sharp else 1.0, abs=1e-5)


@pytest.mark.parametrize("name", CASES)
def test_contains_and_distance(name: str) -> None:
    """Points moved off the line along its normal lie inside or outside, at that distance."""
    outline = CASES[name]
    step = 2e-4
    for piece in outline.pieces:
        t = np.linspace(0.1, 0.9, 9)
        x, rho = piece.points(t)
        (x_b, rho_b), (x_a, rho_a) = piece.points(t - 1e-6), piece.points(t + 1e-6)
        tangent = np.stack([x_a - x_b, rho_a - rho_b])
        normal = np.stack([tangent[1], -tangent[0]]) / np.hypot(*tangent)
        out = x + step * normal[0], rho + step * normal[1]
        inner = x - step * normal[0], rho - step * normal[1]
        assert not np.any(outline.contains(*out))
        keep = inner[1] > 0
        assert np.all(outline.contains(inner[0][keep], inner[1][keep]))
        np.testing.assert_allclose(outline.distance(*out), step, rtol=0.02)
    assert not np.any(outline.contains(np.array([1.0, -1.0, 0.0]), np.array([0.0, 0.0, 1.0])))


@given(
    diameter=st.floats(1e-3, 1e-1),
    aspect=st.floats(1.0, 8.0),
    share=st.floats(0.01, 1.0),
    front=st.sampled_from(ENDS),
    rear=st.sampled_from(ENDS),
    x=st.floats(-0.7, 0.7),
    rho=st.floats(0.0, 0.7),
)
def test_turned_end_for_end(
    diameter: float, aspect: float, share: float, front: str, rear: str, x: float, rho: float
) -> None:
    """The body with its ends exchanged is the mirror image."""
    length = diameter * aspect
    there = body_outline("capsule", diameter, length, 0.5 * share * diameter, front, rear)
    back = body_outline("capsule", diameter, length, 0.5 * share * diameter, rear, front)
    point = np.array([x * length]), np.array([rho * diameter])
    assert there.contains(*point)[0] == back.contains(-point[0], point[1])[0]
    assert there.distance(*point)[0] == pytest.approx(
        back.distance(-point[0], point[1])[0], rel=1e-6, abs=1e-3 * diameter
    )
    assert there.corners == back.corners[::-1]


def test_shapes_that_are_the_same_solid() -> None:
    """A hemisphere is the largest fillet; a capsule without a side is a sphere."""
    x, rho = np.meshgrid(np.linspace(-0.02, 0.021, 42), np.linspace(0.0, 0.012, 31))
    round_ends = body_outline("capsule", DIAMETER, LENGTH, 0.0, "hemisphere", "hemisphere")
    fillets = body_outline("cylinder", DIAMETER, LENGTH, 0.5 * DIAMETER, "fillet", "fillet")
    np.testing.assert_array_equal(round_ends.contains(x, rho), fillets.contains(x, rho))
    sphere, caps = CASES["sphere"], CASES["ball of two caps"]
    off = (np.abs(np.hypot(x, rho) - 0.5 * DIAMETER) > 1e-6) & (np.abs(x) > 1e-9)
    np.testing.assert_array_equal(sphere.contains(x, rho)[off], caps.contains(x, rho)[off])
    np.testing.assert_array_equal(sphere.contains(x, rho)[off], (np.hypot(x, rho) < 0.5 * DIAMETER)[off])
    assert len(caps.pieces) == 2
