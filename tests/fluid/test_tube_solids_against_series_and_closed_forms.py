"""Spheres, capsules and long cylinders in a tube against series, meshed walls, closed forms and lubrication."""

import json
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from spirillum.fluid.tube.confined import UnitMotions, solve_unit_motions
from spirillum.fluid.tube.solids import Fineness, Solids
from spirillum.fluid.tube.tube import END_LOSS
from spirillum.robot.outline import Outline, body_outline
from spirillum.robot.tube_pose import TubePose

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
REFERENCE = json.loads((BENCHMARKS / "tube_reference.json").read_text(encoding="utf-8"))
SPHERES = [row for row in REFERENCE["sphere_on_axis"]["rows"] if row["radius_ratio"] < 0.85]
PLANE = next(row for row in REFERENCE["sphere_near_plane"]["rows"] if row["h_over_a"] == 1.1276)
MIRROR = np.array([1, 0, 1, 0, 1, 0], dtype=bool)
"""Motions that a body below the axis shares with its mirror image: along x and z, about y."""


def sphere(radius: float) -> Outline:
    return body_outline("sphere", 2 * radius, 2 * radius, 0.0, None, None)


def capsule(length: float, rear: Any = "hemisphere") -> Outline:
    """The paper's body, in mm, of any length."""
    return body_outline("capsule", 18.0, length, 0.0, "hemisphere", rear)


@lru_cache(maxsize=64)
def held(outline: Outline, radius: float, gap: float | None, fineness: Fineness, size: float = 9.0) -> UnitMotions:
    """A body of radius `size` at a gap from the floor; None: on the axis."""
    offset = 0.0 if gap is None else radius - size - gap
    return solve_unit_motions(Solids([(outline, 0)], TubePose(radius, offset), fineness), [])


def thirteen(found: UnitMotions) -> np.ndarray:
    """R, load and drag of a body alone, (7, 7), over the roots of its diagonal."""
    whole = np.empty((7, 7))
    whole[:6, :6], whole[6, 6] = found.matrix[:6, :6], found.drag
    whole[:6, 6] = whole[6, :6] = found.load[:6]
    scale = np.sqrt(np.diag(whole))
    normal: np.ndarray = whole / np.outer(scale, scale)
    return normal


@pytest.mark.parametrize("row", SPHERES, ids=lambda row: f"{row['radius_ratio']}")
def test_a_sphere_on_the_axis(row: dict[str, float]) -> None:
    """Drag, torque and force in a flow, against Stokes multipoles in 40 digits."""
    a = row["radius_ratio"]
    found = held(sphere(a), 1.0, None, Fineness(order=12, tolerance=1e-10, panel=1.5))
    drag, turn = 6 * np.pi * a, 8 * np.pi * a**3
    np.testing.assert_allclose(found.matrix[0, 0] / drag, row["drag"], rtol=2e-8)
    np.testing.assert_allclose(found.matrix[3, 3] / turn, row["torque"], rtol=1e-9)
    np.testing.assert_allclose(found.load[0] / drag, row["held_in_poiseuille"], rtol=2e-8)
    matrix, still = found.matrix[:6, :6], np.abs(found.load)
    still[0] = 0.0
    np.testing.assert_allclose(still, 0.0, atol=1e-10 * found.load[0])
    np.testing.assert_allclose(matrix[1:3, 1:3], matrix[1, 1] * np.eye(2), atol=1e-9 * matrix[1, 1])
    assert np.linalg.eigvalsh(matrix)[0] > 0
    assert matrix[1, 1] > drag
    assert matrix[4, 4] > turn
    assert found.matrix[6:].max() == 0


def test_a_small_sphere() -> None:
    """Faxen's series in a/R for the axis: 2.104443 along, 1.804360 across, 0.796824 (a/R)^3 for rotation."""
    for a in (0.02, 0.04):
        found = held(sphere(a), 1.0, None, Fineness(order=12, tolerance=1e-10))
        diagonal = np.diag(found.matrix)[:6] / np.repeat([6 * np.pi * a, 8 * np.pi * a**3], 3)
        wanted = [1 / (1 - 2.104443 * a + 2.08877 * a**3), *2 * [1 / (1 - 1.804360 * a + 1.430 * a**3)]]
        np.testing.assert_allclose(diagonal[:3], wanted, rtol=0.6 * a**3)
        np.testing.assert_allclose(diagonal[3] - 1, 0.796824 * a**3, rtol=0.01)


@pytest.mark.parametrize("row", REFERENCE["capsule_on_axis"]["closed_tube_zero_net_flux"], ids=lambda r: f"{r['drag']}")
def test_the_papers_capsule_on_the_axis(row: dict[str, Any]) -> None:
    """Against a meshed wall: closed and, with the losses at the ends, open tubes of finite length."""
    radius = 0.5 * row["tube_diameter"]
    errors = []
    for tolerance, order in ((1e-4, 8), (1e-7, 12)):
        found = held(capsule(35.0, "flat"), radius, None, Fineness(tolerance=tolerance, order=order))
        pairs = (
            (found.matrix[0, 0], row["drag"]),
            (found.matrix[3, 3], row["torque"]),
            (found.load[0], row["held_in_poiseuille"]),
            (found.drag, row["added_pressure_loss"]),
        )
        errors.append(max(abs(value / wanted - 1) for value, wanted in pairs))
    assert errors[0] < 1e-4
    assert errors[1] < 2e-7
    for open_ in REFERENCE["capsule_on_axis"]["open_tube_in_a_bath"]:
        if open_["tube_diameter"] == row["tube_diameter"] and open_["wall_thickness"] == 0:
            length = open_["tube_length"] + END_LOSS * radius
            flow = found.load[0] / (8 * np.pi * length + found.drag)
            np.testing.assert_allclose(flow, open_["mean_velocity"], rtol=1e-3)
            np.testing.assert_allclose(found.matrix[0, 0] - found.load[0] * flow, open_["drag"], rtol=1.5e-3)


@pytest.fixture(scope="module")
def closed_forms() -> Any:
    """The functions of `benchmarks/tube_reference.py`."""
    import runpy

    return runpy.run_path(str(BENCHMARKS / "tube_reference.py"))


CYLINDERS = [
    (20.0, 3.0, 1e-3, 2e-4, 80.0),
    pytest.param(20.0, 2.0, 1e-4, 2e-4, 80.0, marks=pytest.mark.slow),
    pytest.param(15.0, 2.0, 1e-4, 2e-4, 80.0, marks=pytest.mark.slow),
    (15.0, 0.9, 1e-2, 2e-3, 50.0),
    pytest.param(15.0, 0.5, 1e-2, 2e-3, 50.0, marks=pytest.mark.slow),
]
"""Radius and gap, tolerance, error allowed, length of the longer one."""


@pytest.mark.parametrize(("radius", "gap", "tolerance", "error", "length"), CYLINDERS)
def test_the_eccentric_annulus(
    radius: float,
    gap: float,
    tolerance: float,
    error: float,
    length: float,
    closed_forms: dict[str, Callable[..., Any]],
) -> None:
    """What a longer capsule resists more, per length; the flow past the ends differs by less."""
    short, long = (held(capsule(size), radius, gap, Fineness(tolerance=tolerance)) for size in (length - 15.0, length))
    place = 9.0, radius, radius - 9.0 - gap

    def slope(value: Callable[[UnitMotions], float]) -> float:
        return (value(long) - value(short)) / 15.0

    drag, load, loss = slope(lambda h: h.matrix[0, 0]), slope(lambda h: h.load[0]), slope(lambda h: h.drag)
    np.testing.assert_allclose(drag, closed_forms["annulus_axial_drag_no_flux"](*place), rtol=error)
    no_gradient = drag - load**2 / (8 * np.pi + loss)
    np.testing.assert_allclose(no_gradient, closed_forms["annulus_axial_drag"](*place), rtol=error)
    poiseuille = (np.pi * radius**2) ** 2 / (8 * np.pi + loss)
    np.testing.assert_allclose(poiseuille, closed_forms["annulus_poiseuille_flux"](*place), rtol=error)
    # what turns pumps around the cylinder, which takes longer than the drag to forget the ends
    journal, torque = closed_forms["annulus_rotation"](*place)
    np.testing.assert_allclose(slope(lambda h: h.matrix[3, 3]), torque, rtol=0.02 if gap < 1 else 3e-3)
    np.testing.assert_allclose(slope(lambda h: h.matrix[1, 3]), -journal, rtol=0.06 if gap < 1 else 2e-2)


def test_the_papers_capsule_lying() -> None:
    """Mirror images, positive power, reciprocity, and the error that a tolerance announces."""
    outline = capsule(35.0, "flat")
    fine = held(outline, 20.0, 2.0, Fineness(tolerance=1e-5, order=12))
    fine_values = np.array([fine.matrix[0, 0], fine.matrix[3, 3], fine.load[0], fine.drag])
    for tolerance in (1e-2, 1e-4):
        found = held(outline, 20.0, 2.0, Fineness(tolerance=tolerance))
        values = np.array([found.matrix[0, 0], found.matrix[3, 3], found.load[0], found.drag])
        errors = np.abs(values / fine_values - 1)
        assert np.max(errors[[0, 2, 3]]) < 0.1 * tolerance + 1e-5
        assert errors[1] < 0.6 * tolerance + 1e-5
        assert found.asymmetry < 1e-3
        assert np.linalg.eigvalsh(thirteen(found))[0] > 0.01
    assert fine.asymmetry < 1e-5
    both = thirteen(fine)
    like = np.append(MIRROR, True)
    assert np.max(np.abs(both[np.ix_(like, ~like)])) < 1e-9
    # lying on the floor and turned as a wheel rolls, it is pushed back by the wall: the film is narrow below
    assert fine.matrix[1, 3] < 0
    assert fine.load[0] > 0
    assert fine.matrix[2, 2] > 3 * fine.matrix[1, 1]  # squeezing the film


def test_scale() -> None:
    """All lengths times s: forces times s, couplings s^2, torques s^3, exactly; loads as forces and torques."""
    s = 2.0**-10
    fineness = Fineness(tolerance=1e-3)
    large = held(capsule(35.0, "flat"), 20.0, 2.0, fineness)
    small_outline = body_outline("capsule", 18 * s, 35 * s, 0.0, "hemisphere", "flat")
    small = held(small_outline, 20 * s, 2 * s, fineness, 9 * s)
    units = np.diag(np.tile([1.0, 1, 1, s, s, s], 2))
    wanted = s * units @ large.matrix @ units
    scale = np.sqrt(np.maximum(np.outer(np.diag(wanted), np.diag(wanted)), 1e-300))
    np.testing.assert_allclose(small.matrix / scale, wanted / scale, atol=1e-10)
    np.testing.assert_allclose(small.load, s * units @ large.load, rtol=1e-9, atol=1e-10 * s * large.load[0])
    np.testing.assert_allclose(small.drag, s * large.drag, rtol=1e-10)


def test_a_sphere_near_the_wall_feels_a_film() -> None:
    """Reynolds' equation for h = gap + x^2/2A + y^2/2B, A = a along, 1/B = 1/a - 1/R around.

    The pressure of a squeezed film is 6 mu V/(1/A + 1/B)/h^2: a force of 12 pi mu V sqrt(AB)/(1/A + 1/B)/gap. That
    of a sphere which moves along a wall is P mu U x/h^2: its drag grows by a multiple of 2 pi mu U sqrt(AB) for each
    factor e that the gap shrinks. For a plane these are 6 pi mu V a^2/gap and 6 pi mu U a 8/15.
    """
    a, radius = 0.5, 1.0
    along, around = 1 / a, 1 / a - 1 / radius
    root = 1 / np.sqrt(along * around)
    gaps = np.array([0.16, 0.08, 0.04, 0.02])
    fineness = Fineness(tolerance=1e-3)
    matrices = np.array([held(sphere(a), radius, gap, fineness, a).matrix for gap in gaps])
    squeezed = np.diff(matrices[:, 2, 2]) / np.diff(1 / gaps) / (12 * np.pi * root / (along + around))
    pressure = 6 * along / (3 * along + 2 * around)
    forward = np.diff(matrices[:, 0, 0]) / np.diff(-np.log(gaps)) / (2 * np.pi * root * (1 + pressure / 2))
    # sideways the film thickens as h, but the sphere's surface and not the wall's moves
    pressure = 6 * (around + 2 / radius) / (3 * around + 2 * along)
    factor = 1 - pressure / 2 + pressure / (a * around)
    sideways = np.diff(matrices[:, 1, 1]) / np.diff(-np.log(gaps)) / (2 * np.pi * root * factor)
    np.testing.assert_allclose(squeezed[-1], 1.0, atol=0.02)
    np.testing.assert_allclose(forward[-1], 1.0, atol=0.3)
    np.testing.assert_allclose(sideways[-1], 1.0, atol=0.21)
    for found in (squeezed, forward, sideways):  # the rest falls off with the gap
        assert np.all(np.diff(np.abs(found - 1)) < 0)
    # forward the plug counts too, until the film does: more than a third less of what is missing for half the gap
    assert abs(forward[-1] - 1) < 0.66 * abs(forward[-2] - 1)


def test_in_a_wide_tube_the_wall_is_a_plane() -> None:
    """R to infinity at a fixed gap, extrapolated in a/R, against O'Neill, and Goldman, Cox and Brenner."""
    radii = np.array([5.0, 10.0, 20.0])
    found = []
    for radius in radii:
        m = held(sphere(1.0), float(radius), PLANE["h_over_a"] - 1, Fineness(tolerance=1e-2), 1.0).matrix
        force, turn = 6 * np.pi, 8 * np.pi
        found.append(
            [m[0, 0] / force, m[1, 1] / force, m[4, 4] / turn, m[3, 3] / turn, m[0, 4] / force, m[4, 0] / turn]
        )
    names = ("translation_force", "translation_force", "rotation_torque", "rotation_torque")
    wanted = [PLANE[name] for name in names] + [-PLANE["rotation_force"], -PLANE["translation_torque"]]
    errors = np.array(found) / wanted - 1
    assert np.all(np.abs(errors[1:]) < 0.62 * np.abs(errors[:-1]))
    extrapolated = (errors[0] - 6 * errors[1] + 8 * errors[2]) / 3
    np.testing.assert_allclose(extrapolated[:4], 0.0, atol=0.012)
    np.testing.assert_allclose(extrapolated[4:], 0.0, atol=0.06)
