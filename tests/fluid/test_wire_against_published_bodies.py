"""Wires of any shape against slender-body asymptotics, exact tori, solid rods, Rodenborn's helices, and symmetries."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from comparisons import assert_matrices_close
from rings import ring_wire
from spirillum.fluid.algebra import about_point
from spirillum.fluid.wire.interaction import Discretisation, solve
from spirillum.fluid.wire.stokeslets import Wire, closest_approach, station_count, stations_along
from spirillum.robot.outline import cylinder_outline

both = pytest.mark.parametrize("accuracy", ["standard", "high"])


def matrix_of(*wires: Wire, accuracy: str = "standard") -> np.ndarray:
    """6x6 of wires that move together, viscosity 1."""
    return solve([], [(wire, 1) for wire in wires], Discretisation(accuracy)).matrix[6:, 6:]


def straight(length: float) -> np.ndarray:
    """From the origin backwards along the axis."""
    x = np.linspace(0.0, length, 200)
    return np.stack([-x, 0 * x, 0 * x], axis=1)


def bent(seed: int) -> np.ndarray:
    """A smooth curve in space of length near 6, bending on the scale 1."""
    t = np.linspace(0.0, 1.0, 501)[:, None]
    waves = np.random.default_rng(seed).normal(size=(3, 3))
    wiggle = sum(np.sin(2 * np.pi * (0.5 * k + 0.5) * t + 2 * waves[k]) * waves[k] / (k + 1) for k in range(3))
    return np.array([6.0, 0.0, 0.0]) * t + 0.4 * wiggle


@both
@pytest.mark.parametrize("slenderness", [5.0, 20.0, 60.0])
def test_rods_against_solid_cylinders(accuracy: str, slenderness: float) -> None:
    """Cylinders with their flat ends, solved for on their surface: along, across, and end over end."""
    wire = stations_along(straight(2 * slenderness), 1.0)
    found = np.diag(matrix_of(wire, accuracy=accuracy))
    cylinder = cylinder_outline(2.0, 0.0, -2 * slenderness)
    wanted = np.diag(solve([(cylinder, 1)], [], Discretisation(order=12)).matrix)[6:]
    np.testing.assert_allclose(found[:3], wanted[:3], rtol=0.001 + 0.06 / slenderness)
    np.testing.assert_allclose(found[4:], wanted[4:], rtol=0.001 + 0.09 / slenderness)
    # Its spin is that of an infinite cylinder, 4 pi a^2 per length, and more for the ends, which the wire leaves out.
    np.testing.assert_allclose(found[3], wanted[3], rtol=0.01 + 0.6 / slenderness)


@both
def test_rods_against_slender_body_theory(accuracy: str) -> None:
    """Batchelor (J. Fluid Mech. 44:419, 1970): what remains of his series is its fourth power of 1/log(L/a)."""
    for p in (30.0, 100.0, 300.0 if accuracy == "standard" else 150.0):
        epsilon = 1 / np.log(2 * p)
        along = epsilon * (1 + 0.307 * epsilon) / (1 - 0.5 * epsilon) + 0.426 * epsilon**3
        across = epsilon * (1 + 0.307 * epsilon) / (1 + 0.5 * epsilon) + 0.119 * epsilon**3
        drag = np.diag(matrix_of(stations_along(straight(2 * p), 1.0), accuracy=accuracy))
        assert 0 < drag[0] / (4 * np.pi * p) - along < 3.5 * epsilon**4
        assert 0 < drag[1] / (8 * np.pi * p) - across < 1.5 * epsilon**4


# Mitchell et al., arXiv:2102.01791, Table 2: F/(6 pi mu U (R + a)) of a torus broadside on, exact.
EXACT_TORUS = 6 * np.pi * 1.1 * 0.7843079118776118


@pytest.mark.parametrize(
    ("accuracy", "spacing", "error"), [("standard", 1.0, 7e-3), ("high", 1.0, 6e-4), ("high", 0.5, 1e-4)]
)
def test_exact_torus(accuracy: str, spacing: float, error: float) -> None:
    """A wire bent to a radius of only ten of its own."""
    found = matrix_of(ring_wire(0.1, spacing=spacing), accuracy=accuracy)
    assert found[0, 0] == pytest.approx(EXACT_TORUS, rel=error)


def torus(ratio: float) -> tuple[float, float]:
    """Broadside and edgewise drag of a thin torus (Johnson and Wu, J. Fluid Mech. 95:263, 1979), R = 1.

    The first with its next term, 0.235 (a/R)^2 log(R/a).
    """
    q = np.log(8 / ratio)
    broadside = 16 * np.pi**2 / (1 + 2 * q) * (1 + 0.235 * ratio**2 * np.log(1 / ratio))
    edgewise = 2 * np.pi**2 * (3 * q - 8.5) / ((q - 0.5) * (q - 2) - 2)
    return broadside, edgewise


def test_thin_torus_is_approached_with_the_square_of_its_thickness() -> None:
    """With stations close enough to see it; at the usual spacing the sums alone cost 3e-4."""
    ratios = np.array([0.08, 0.04, 0.02])
    drags = [matrix_of(ring_wire(a, spacing=0.4)) for a in ratios]
    broadside = np.array([1 - drag[0, 0] / torus(a)[0] for drag, a in zip(drags, ratios, strict=True)])
    edgewise = np.array([abs(1 - drag[1, 1] / torus(a)[1]) for drag, a in zip(drags, ratios, strict=True)])
    assert np.all(broadside > 0)
    rates = np.log2(broadside[:-1] / broadside[1:])
    assert np.all((rates > 1.6) & (rates < 2.1))
    assert broadside[-1] < 5e-4
    assert np.all(edgewise < 2 * ratios**2 * np.log(1 / ratios))
    for spacing, error in ((1.0, 4e-4), (0.6, 2e-4)):
        found = matrix_of(ring_wire(0.01, spacing=spacing))
        assert found[0, 0] == pytest.approx(torus(0.01)[0], rel=error)


def test_moments_bring_the_effect_of_curvature() -> None:
    """Against the same torus `high` is an order of magnitude nearer, which its closed form grants to 1e-4."""
    for ratio in (0.1, 0.05):
        wanted = torus(ratio)[0] if ratio < 0.1 else EXACT_TORUS
        wire = ring_wire(ratio, spacing=0.5)
        errors = [abs(matrix_of(wire, accuracy=kind)[0, 0] / wanted - 1) for kind in ("standard", "high")]
        assert errors[1] < 0.1 * errors[0]


# Rodenborn et al., PNAS 110:E338 (2013), Fig. 2, measured: wavelength/R, thrust/(mu Omega R^2), torque/(mu Omega R^3),
# drag/(mu U R) of helices with R = 6.3 mm, a = 0.397 mm, axial length 130 mm; digitised, so good to a percent or two.
RODENBORN = [
    (2.226, 6.2644, 131.928, 52.0588, 0.05),
    (6.509, 11.0345, 81.928, 39.4118, 0.065),
    (15.241, 7.8448, 68.072, 34.1176, 0.12),  # the largest wavelength is the worst
]


def helix(wavelength: float, radius: float, length: float) -> np.ndarray:
    x = -np.linspace(0.0, length, int(150 * length / wavelength))
    angle = 2 * np.pi / wavelength * x
    return np.stack([x, radius * np.cos(angle), radius * np.sin(angle)], axis=1)


@pytest.mark.parametrize(
    ("accuracy", "row"),
    [
        *(("standard", row) for row in RODENBORN),
        *(pytest.param("high", row, marks=pytest.mark.slow) for row in RODENBORN[:2]),  # 400 and 800 stations
        ("high", RODENBORN[2]),
    ],
)
def test_measured_helices(accuracy: str, row: tuple[float, ...]) -> None:
    """Computed thrust, torque and drag lie within 5 % at the short wavelength and up to 12 % low at the longest."""
    ratio, thrust, torque, drag, error = row
    R = 6.3
    found = matrix_of(stations_along(helix(ratio * R, R, 130.0), 0.397), accuracy=accuracy)
    ratios = [-found[0, 3] / R**2 / thrust, found[3, 3] / R**3 / torque, found[0, 0] / R / drag]
    np.testing.assert_allclose(ratios, 1.0, atol=error)


@both
@settings(max_examples=5)
@given(seed=st.integers(0, 10**6), a=st.floats(0.04, 0.12))
def test_symmetric_positive_definite(accuracy: str, seed: int, a: float) -> None:
    solution = solve([], [(stations_along(bent(seed), a), 1)], Discretisation(accuracy))
    assert solution.asymmetry < 1e-12
    matrix = about_point(solution.matrix[None, 6:, 6:], bent(seed).mean(axis=0)[None])[0]
    scale = np.sqrt(np.diag(matrix))
    assert np.linalg.eigvalsh(matrix / np.outer(scale, scale))[0] > 1e-2


@both
@settings(max_examples=4)
@given(seed=st.integers(0, 10**6), power=st.floats(-5, 2), x=st.floats(-5, 5))
def test_turned_mirrored_scaled_and_reversed(accuracy: str, seed: int, power: float, x: float) -> None:
    """Stations are laid alike from either end."""
    curve, a = bent(seed), 0.08
    matrix = matrix_of(stations_along(curve, a), accuracy=accuracy)

    def changed(points: np.ndarray, radius: float = a) -> np.ndarray:
        return matrix_of(stations_along(points, radius), accuracy=accuracy)

    turn = Rotation.random(rng=np.random.default_rng(seed)).as_matrix()
    both_turned = np.kron(np.eye(2), turn)
    assert_matrices_close(changed(curve @ turn.T), both_turned @ matrix @ both_turned.T, 1e-9)
    mirror = np.diag([1.0, -1, 1, -1, 1, -1])
    assert_matrices_close(changed(curve * [1, -1, 1]), mirror @ matrix @ mirror, 1e-9)
    s = 10.0**power
    units = np.diag([1.0, 1, 1, s, s, s])
    assert_matrices_close(changed(s * curve, s * a), s * units @ matrix @ units, 1e-9)
    assert_matrices_close(changed(curve[::-1]), matrix, 1e-8)
    offset = np.array([x, 1.0, -2.0])
    assert_matrices_close(changed(curve + offset), about_point(matrix[None], -offset[None])[0], 1e-9)


def test_ring_starts_anywhere() -> None:
    wires = [ring_wire(0.1, start=start) for start in (0.0, 1.2345)]
    assert_matrices_close(matrix_of(wires[1]), matrix_of(wires[0]), 1e-5)
    # The sense of a ring has no meaning, and about its axis it turns in itself: no coupling at all.
    matrix = matrix_of(wires[0])
    assert_matrices_close(matrix, np.diag(np.diag(matrix)), 1e-6)


def test_points_along_the_given_curve_do_not_matter() -> None:
    coarse, fine = bent(3)[::5], bent(3)
    assert_matrices_close(matrix_of(stations_along(coarse, 0.1)), matrix_of(stations_along(fine, 0.1)), 1e-4)


def test_several_wires() -> None:
    """Far apart they add up; as two parts they make the same sum; a flagellar bundle drags less than its wires."""
    rod = straight(10.0)
    one = matrix_of(stations_along(rod, 0.2))
    shifts = [np.array([0.0, d, 0.0]) for d in (50.0, 100.0, 200.0)]
    lost = []
    for shift in shifts:
        pair = [stations_along(rod, 0.2), stations_along(rod + shift, 0.2)]
        together = matrix_of(*pair)
        lost.append(1 - together[0, 0] / (2 * one[0, 0]))
        apart = solve([], [(pair[0], 0), (pair[1], 1)], Discretisation()).matrix
        locked = apart[:6, :6] + apart[:6, 6:] + apart[6:, :6] + apart[6:, 6:]
        assert_matrices_close(locked, together, 1e-10)
    np.testing.assert_allclose(np.log2(np.array(lost[:-1]) / lost[1:]), 1.0, atol=0.05)
    # A Stokeslet in the distance d: u = F/(8 pi mu d).
    assert lost[-1] == pytest.approx(one[0, 0] / (8 * np.pi * 200.0), rel=0.01)
    bundle = matrix_of(*[stations_along(rod + np.array([0.0, y, 0.0]), 0.2) for y in (0.0, 0.6, 1.2)])
    assert one[0, 0] < bundle[0, 0] < 2 * one[0, 0]


def test_stations() -> None:
    """As many as announced, evenly spaced, and together as long as the wire."""
    for length, a in ((10.0, 0.1), (3.0, 0.5), (0.7, 1.0)):
        wire = stations_along(straight(length), a)
        assert len(wire.points) == station_count(np.array([length]), np.array([a]))[0]
        assert np.sum(wire.lengths) == pytest.approx(length, rel=1e-12)
        np.testing.assert_allclose(wire.tangents, [[-1.0, 0, 0]] * len(wire.points), atol=1e-12)
        centre = wire.points.mean(axis=0)
        np.testing.assert_allclose(centre, [-0.5 * length, 0, 0], atol=1e-9 * length)
    steps = np.linalg.norm(np.diff(stations_along(bent(1), 0.05).points, axis=0), axis=1)
    np.testing.assert_allclose(steps, steps.mean(), rtol=5e-3)


def test_distance_from_the_centreline() -> None:
    wire = stations_along(straight(10.0), 0.1)
    x = np.linspace(-9.9, -0.1, 23)
    points = np.stack([x, 0.03 + 0 * x, -0.04 + 0 * x], axis=1)
    np.testing.assert_allclose(wire.distance(points), 0.05, rtol=1e-9)
    np.testing.assert_allclose(wire.distance(np.array([[2.0, 0.0, 0.0], [-13.0, 4.0, 0.0]])), [2.0, 5.0], rtol=1e-2)


def test_a_wire_that_would_cut_itself_is_seen() -> None:
    """Turns of a wide helix are a wavelength apart, which is less than this wire is thick."""
    assert closest_approach(stations_along(helix(0.5, 1.0, 3.0), 0.3)) == pytest.approx(0.5, rel=0.02)
