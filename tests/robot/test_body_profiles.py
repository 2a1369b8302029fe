"""Bodies of any profile against closed forms, and what is refused of their points."""

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from spirillum import load, resistance
from spirillum.errors import InputError
from spirillum.fluid.closed.perrin import spheroid_drag
from spirillum.robot.links import outlines_of
from spirillum.robot.outline import Segment
from spirillum.robot.robot import robot_text

VISCOSITY = 3.5


def half_ellipse(count: int, a: float, b: float) -> list[list[float]]:
    """Points of a spheroid of semi-axes a along and b across, mm."""
    t = np.linspace(0.0, np.pi, count)
    rows = np.stack([a * np.cos(t), b * np.sin(t)], axis=1)
    rows[[0, -1], 1] = 0.0
    return rows.tolist()  # type: ignore[no-any-return]


def capsule(count: int, *, flat: bool) -> list[list[float]]:
    """Points of the preset's body, with its flat rear or with two hemispheres, mm."""
    quarter = np.array(half_ellipse(2 * count - 1, 9.0, 9.0))[:count] + np.array([8.5, 0.0])
    if flat:
        return [*quarter.tolist(), [-17.5, 9.0], [-17.5, 0.0]]
    return [*quarter.tolist(), *(quarter[::-1] * np.array([-1.0, 1.0])).tolist()]


def body(changes: dict[str, Any], accuracy: str = "high") -> np.ndarray:
    """Diagonal of the resistance of a body alone."""
    robot = load("biorob2012-wide", seal="none", body=changes)
    return np.diag(resistance(robot, model="slender", part="body", accuracy=accuracy).matrix)


def test_a_sphere_of_points_has_stokes_drag() -> None:
    drag = body({"profile": half_ellipse(49, 9.0, 9.0)})
    stokes = VISCOSITY * np.pi * np.array([*[6.0 * 9e-3] * 3, *[8.0 * 9e-3**3] * 3])
    assert np.allclose(drag, stokes, rtol=1e-6, atol=0.0)


def test_a_prolate_spheroid_of_points_has_perrins_drag() -> None:
    drag = body({"profile": half_ellipse(97, 9.0, 3.0)})
    exact = spheroid_drag(np.array([VISCOSITY]), np.array([9e-3]), np.array([3e-3]))
    assert np.allclose(drag[[0, 1, 3, 4]], np.concatenate(exact), rtol=1e-6, atol=0.0)


@pytest.mark.parametrize("flat", [True, False])
def test_a_capsule_of_points_has_the_capsules_drag(flat: bool) -> None:
    own = body({} if flat else {"rear": "hemisphere"})
    assert np.allclose(body({"profile": capsule(25, flat=flat)}), own, rtol=1e-6, atol=0.0)


def test_the_error_of_points_falls_with_the_fourth_power_of_their_spacing() -> None:
    exact = 6.0 * np.pi * VISCOSITY * 9e-3
    errors = [abs(body({"profile": half_ellipse(count, 9.0, 9.0)})[0] / exact - 1.0) for count in (13, 25, 49)]
    assert all(after < before / 8.0 for before, after in pairwise(errors))


def test_volume_and_order_of_points() -> None:
    points = capsule(49, flat=True)
    robot, plain = load("biorob2012-wide", seal="none", body={"profile": points}), load("biorob2012-wide", seal="none")
    for name in ("body_volume", "centre_of_mass", "centre_of_buoyancy"):
        assert robot.derived()[name].value == pytest.approx(plain.derived()[name].value, rel=1e-6)
    turned = load("biorob2012-wide", seal="none", body={"profile": points[::-1]})
    assert outlines_of(turned)["body"] == outlines_of(robot)["body"]


def test_corners_and_long_sides_stay() -> None:
    robot = load("biorob2012-wide", seal="none", body={"profile": [[0, 0], [10, 5], [30, 5], [30, 0]]})
    outline = outlines_of(robot)["body"]
    assert all(isinstance(piece, Segment) for piece in outline.pieces)
    assert outline.corners == (True, True)
    assert robot.derived()["body_volume"].value == pytest.approx(np.pi * 25e-6 * (10e-3 / 3.0 + 20e-3), rel=1e-12)


def test_a_profile_is_found_beside_its_robot_file_and_written_with_it(tmp_path: Path) -> None:
    rows = "\n".join(f"{x!r},{r!r}" for x, r in capsule(25, flat=True))
    (tmp_path / "outline.csv").write_text(f"x_mm,r_mm\n{rows}\n")
    (tmp_path / "robot.toml").write_text(
        'extends = "biorob2012-wide"\nseal = "none"\n[body]\nprofile = "outline.csv"\nmass = "9 g"\n'
    )
    robot = load(tmp_path / "robot.toml")
    assert robot.body.diameter == pytest.approx(18e-3)
    (tmp_path / "written.toml").write_text(robot_text(robot))
    assert load(tmp_path / "written.toml") == robot


@pytest.mark.parametrize(
    ("points", "said"),
    [
        ([[0, 0], [10, 5], [20, 5]], "is open: its last r = 5 mm"),
        ([[0, 2], [10, 5], [20, 0]], "is open: its first r = 2 mm"),
        ([[0, 0], [10, 5], [8, 6], [20, 0]], "folds back at point 3"),
        ([[0, 0], [10, 5], [15, 0], [20, 5], [30, 0]], "point 3 has r = 0 mm"),
        ([[0, 0], [10, -5], [20, 0]], "point 2 has r = -5 mm"),
        ([[0, 0], [10, 5], [10, 5], [20, 0]], "points 2 and 3 are the same"),
        ([[0, 0], [10, float("nan")], [20, 0]], "point 2"),
        ([[0, 0]], "has 1 point"),
        ([[0, 0, 0]] * 3, "is not 2 numbers"),
    ],
)
def test_wrong_profiles_get_a_sentence(points: Any, said: str) -> None:
    with pytest.raises(InputError) as caught:
        load("biorob2012-wide", seal="none", body={"profile": points})
    assert any(said in problem for problem in caught.value.problems)


def test_sizes_beside_a_profile_are_refused() -> None:
    for changes, said in (
        ({"diameter": "3 mm"}, "body.diameter = 3 mm"),
        ({"shape": "sphere"}, "body.shape = 'sphere'"),
    ):
        with pytest.raises(InputError, match=said):
            load("biorob2012-wide", seal="none", body={"profile": capsule(25, flat=True)} | changes)
