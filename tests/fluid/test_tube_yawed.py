"""Yawed robots in a tube: symmetries tie the coupled system to the decoupled one, to its mirror image, to itself."""

from functools import lru_cache

import numpy as np
import pytest

from spirillum.fluid.algebra import axis_rotation
from spirillum.fluid.tube.confined import UnitMotions, solve_unit_motions
from spirillum.fluid.tube.solids import Fineness, Solids
from spirillum.fluid.wire.stokeslets import Wire, stations_along
from spirillum.robot.outline import Arc, Outline, body_outline
from spirillum.robot.tube_pose import TubePose

BODIES = {
    "ball": Outline((Arc((0.0, 0.0), (0.4, 0.4), (0.0, np.pi)),), ()),
    "capsule": body_outline("capsule", 0.8, 1.2, 0.0, "hemisphere", "flat"),
}
ROUND_AND_EDGED = ["ball", pytest.param("capsule", marks=pytest.mark.slow)]
"""Symmetries hold for either; a ball has fewer unknowns."""
COARSE = Fineness(tolerance=2e-3, order=4)
"""Symmetries hold far below what the flow is resolved to."""
MIRROR = np.array([1, -1, 1, -1, 1, -1] * 2 + [1.0])  # y to -y


def coil(phase: float = 0.0, hand: float = 1.0) -> Wire:
    """Behind the body, in body axes: y = r cos(h k x + phase), z = r sin(h k x + phase)."""
    x = -0.7 - np.linspace(0.0, 0.8, 140)
    turn = hand * 2 * np.pi * x / 0.8 + phase
    return stations_along(np.stack([x, 0.15 * np.cos(turn), 0.15 * np.sin(turn)], axis=1), 0.05)


@lru_cache(maxsize=4)
def solids(body: str, pose: TubePose, fineness: Fineness) -> Solids:
    wire = coil()
    near = np.stack([wire.points[:, 0], np.hypot(*wire.points[:, 1:].T), np.full(len(wire.points), wire.blob)], axis=1)
    return Solids([(BODIES[body], 0)], pose, fineness, near)


def thirteen(found: UnitMotions) -> np.ndarray:
    whole = np.empty((13, 13))
    whole[:12, :12], whole[12, 12] = found.matrix, found.drag
    whole[:12, 12] = whole[12, :12] = found.load
    return whole


@lru_cache(maxsize=16)
def robot(body: str, pose: TubePose, phase: float = 0.7, hand: float = 1.0, fineness: Fineness = COARSE) -> np.ndarray:
    """R, load and drag in body axes."""
    return thirteen(solve_unit_motions(solids(body, pose, fineness), [(coil(phase, hand), 1)]))


def difference(a: np.ndarray, b: np.ndarray) -> float:
    scale = np.sqrt(np.diag(a))
    return float(np.max(np.abs(a - b) / np.outer(scale, scale)))


def in_other_axes(matrix: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    whole = np.eye(13)
    whole[:12, :12] = np.kron(np.eye(4), rotation)
    turned: np.ndarray = whole @ matrix @ whole.T
    return turned


@pytest.mark.parametrize(
    ("body", "pitch", "yaw"),
    [
        ("ball", 0.1, 0.15),
        *(pytest.param(*case, marks=pytest.mark.slow) for case in (("ball", 0.0, -0.1), ("capsule", 0.1, 0.15))),
    ],
)
def test_mirror_image(body: str, pitch: float, yaw: float) -> None:
    """Yaw, phase and hand mirrored: so is everything."""
    one = robot(body, TubePose(1.0, 0.1, pitch, yaw=yaw), 0.7)
    other = robot(body, TubePose(1.0, 0.1, pitch, yaw=-yaw), np.pi - 0.7, -1.0)
    assert difference(one, MIRROR[:, None] * other * MIRROR) < 1e-8


@pytest.mark.parametrize("body", ROUND_AND_EDGED)
def test_on_the_axis_yaw_is_pitch_a_quarter_turn_away(body: str) -> None:
    """Two decoupled systems against the coupled one: nose up and the tail at phi, nose to the left at phi + 90 deg."""
    pitched = robot(body, TubePose(1.0, 0.0, -0.12), 0.7)
    yawed = robot(body, TubePose(1.0, 0.0, yaw=0.12), 0.7 + 0.5 * np.pi)
    quarter = axis_rotation(np.array([0.5 * np.pi]))[0]  # z to -y
    np.testing.assert_allclose(quarter @ [0, 0, 1], [0, -1, 0], atol=1e-15)
    assert difference(yawed, in_other_axes(pitched, quarter)) < 1e-8


def test_below_the_axis_against_the_same_place_seen_from_another_side() -> None:
    """Offset and pitch in one vertical plane: from 180 degrees further, above the axis and pitched the other way."""
    below = robot("ball", TubePose(1.0, 0.1, 0.1, yaw=0.15), 0.7)
    above = robot("ball", TubePose(1.0, -0.1, -0.1, yaw=-0.15), 0.7 + np.pi)
    half = axis_rotation(np.array([np.pi]))[0]
    assert difference(below, in_other_axes(above, half)) < 1e-8


@pytest.mark.parametrize("body", [pytest.param("ball", marks=pytest.mark.slow), "capsule"])
def test_reciprocal_and_positive(body: str) -> None:
    """Edges limit reciprocity to the order of the quadrature, yawed as pitched."""
    found = solve_unit_motions(
        solids(body, TubePose(1.0, 0.2, 0.1, yaw=0.15), Fineness(tolerance=4e-3)), [(coil(0.7), 1)]
    )
    whole = thirteen(found)
    scale = np.sqrt(np.diag(whole))
    assert found.asymmetry < {"ball": 3e-8, "capsule": 5e-5}[body]
    assert np.linalg.eigvalsh(whole / np.outer(scale, scale))[0] > 0.005


@pytest.mark.parametrize("body", ROUND_AND_EDGED)
@pytest.mark.parametrize(
    ("pitch", "yaw", "error"),
    [(0.1, 1e-9, 5e-8), (0.0, 1e-9, 2e-8), pytest.param(0.1, -1e-3, 2e-3, marks=pytest.mark.slow)],
)
def test_continuous_where_the_yaw_goes_to_zero(body: str, pitch: float, yaw: float, error: float) -> None:
    """Pitched, and level on rings that meet every wave by themselves."""
    straight, hardly = (robot(body, TubePose(1.0, 0.1, pitch, yaw=angle)) for angle in (0.0, yaw))
    assert difference(straight, hardly) < error


def test_a_sphere_does_not_feel_its_yaw() -> None:
    fineness, ball = Fineness(tolerance=1e-4, order=8), [(BODIES["ball"], 0)]
    level = thirteen(solve_unit_motions(Solids(ball, TubePose(1.0, 0.3), fineness), []))
    pose = TubePose(1.0, 0.3, -0.2, yaw=0.3)
    yawed = thirteen(solve_unit_motions(Solids(ball, pose, fineness), []))
    c, s, cos, sin = np.cos(0.2), np.sin(-0.2), np.cos(0.3), np.sin(0.3)
    to_place = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]]) @ np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])
    scale = np.sqrt(np.diag(level))
    scale[6:12] = 1.0
    np.testing.assert_allclose(
        in_other_axes(yawed, to_place) / np.outer(scale, scale), level / np.outer(scale, scale), atol=1e-7
    )


@pytest.mark.slow
def test_convergence_with_fineness() -> None:
    place = TubePose(1.0, 0.35, 0.1, yaw=0.1)
    coarse, fine, finest = (
        robot("capsule", place, fineness=Fineness(tolerance=tolerance)) for tolerance in (3e-3, 3e-4, 1e-4)
    )
    assert difference(coarse, finest) < 3e-3
    assert difference(fine, finest) < 0.5 * difference(coarse, finest)


def test_several_tails_against_one_factorisation() -> None:
    """A table's way: solids once, any tail at any phase."""
    pose = TubePose(1.0, 0.1, 0.1, yaw=0.15)
    shared = solids("ball", pose, COARSE)
    solve_unit_motions(shared, [(coil(), 1)])
    alone = Solids([(BODIES["ball"], 0)], pose, shared.fineness, np.array([[-0.7, 0.15, coil().blob]]))
    one, other = (thirteen(solve_unit_motions(s, [(coil(2.0, -1.0), 1)])) for s in (shared, alone))
    assert difference(one, other) < 1e-3
    assert len(shared.factors) == 1
