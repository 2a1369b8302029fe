"""The tabulated film against the direct solution, and what must hold anywhere."""

from functools import lru_cache

import numpy as np
import pytest

import spirillum as sp
from spirillum.errors import InputError
from spirillum.fluid.tube import film as film_module
from spirillum.fluid.tube.film import FilmTable, _head, _off_the_wall, film_resistance
from spirillum.fluid.tube.film_surface import FilmBody, Place, frame
from spirillum.fluid.tube.library import find_table
from spirillum.fluid.wire.robot_geometry import RobotGeometry
from spirillum.kernels.core import film_at, smallest_gap
from spirillum.kernels.tube_table import parts_of
from spirillum.robot.batch import RobotBatch
from spirillum.robot.outline import body_outline

TUBE, A = 20e-3, 9e-3
CAPSULE = body_outline("capsule", 2 * A, 35e-3, 0.0, "hemisphere", "flat")
MIRROR = np.diag([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])


@pytest.fixture(scope="module")
def table():
    """The film in the table that is shipped for the paper's robot: to make one takes half a minute."""
    geometry = RobotGeometry.of(RobotBatch.of(sp.load("biorob2012-wide")))
    assert geometry.body == CAPSULE
    return FilmTable(parts_of(find_table(geometry, TUBE).packed).film)


def offset_at(packed, gap, p, psi):
    low, high = 0.0, packed[0]  # R
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if smallest_gap(packed, middle, p, psi) > gap else (low, middle)
    return low


def errors(table, seed, count, pitch, gaps=(1e-3, 0.2)):
    rng = np.random.default_rng(seed)
    found = []
    for _ in range(count):
        gap = A * np.exp(rng.uniform(*np.log(gaps)))
        p, psi = pitch * rng.uniform(-1, 1) * rng.uniform() ** 2, rng.uniform(-0.12, 0.12)
        e = offset_at(table.packed, gap, p, psi)
        film, smallest = table.at(e, p, psi)
        assert smallest == pytest.approx(gap, rel=1e-6)
        direct = film_resistance(CAPSULE, TUBE, e, p, psi)
        roots = np.sqrt(np.diag(direct))
        found.append(np.abs((film - direct) / np.outer(roots, roots)).max())
    return np.array(found)


def test_shipped_table_is_near_the_direct_solution(table):
    found = errors(table, 0, 40, 0.1)
    assert found.max() < 3e-3
    assert np.median(found) < 3e-4


def test_table_gives_back_the_films_that_it_was_made_of(monkeypatch):
    """In single precision; but where a pitch was too steep to be solved for, or the body would have touched."""
    made_of, moved = [], []

    def kept(body, radius, e, p, psi):
        made_of.append((e, p, psi, resistance_of(body, radius, e, p, psi)))
        return made_of[-1][-1]

    def off_the_wall(body, radius, *place):
        found = cleared(body, radius, *place)
        if found != place:
            moved.append(found)
        return found

    resistance_of, cleared = film_module.resistance_of, film_module._off_the_wall
    monkeypatch.setattr(film_module, "resistance_of", kept)
    monkeypatch.setattr(film_module, "_off_the_wall", off_the_wall)
    table = FilmTable.of(CAPSULE, TUBE, intervals=2)
    solved = [(place, film) for *place, film in made_of if abs(place[1]) < 0.45 and tuple(place) not in moved]
    assert len(solved) > 0.7 * len(made_of)
    for place, film in solved:
        roots = np.sqrt(np.diag(film))
        assert np.abs((table.at(*place)[0] - film) / np.outer(roots, roots)).max() < 1e-5


def thin_errors(table, pitch, yaw):
    """Where a robot rests, as thin as asperities: 2e-5 to 1e-3 of the radius."""
    found = []
    for gap in A * np.geomspace(2e-5, 1e-3, 4):
        e = offset_at(table.packed, gap, pitch, yaw)
        direct = film_resistance(CAPSULE, TUBE, e, pitch, yaw)
        roots = np.sqrt(np.diag(direct))
        found.append(np.abs((table.at(e, pitch, yaw)[0] - direct) / np.outer(roots, roots)).max())
    return np.array(found)


@pytest.mark.parametrize(("pitch", "yaw", "most"), [(0.0, 0.0, 1e-2), (0.002, -0.02, 1e-2), (-0.005, 0.1, 2e-2)])
def test_film_as_thin_as_asperities_is_near_the_direct_solution(table, pitch, yaw, most):
    """A level robot is met by the smallest yaw of the nodes; a robot at rest is yawed by a tenth."""
    assert thin_errors(table, pitch, yaw).max() < most


@pytest.mark.parametrize(("tube", "pitch", "yaw"), [(15e-3, -0.0127, -0.1285), (20e-3, -0.0057, -0.1184)])
def test_film_is_resolved_where_the_papers_robots_come_to_rest(tube, pitch, yaw):
    """As thin as asperities, at the largest yaw: the line that is nearest to the wall winds around the body."""
    head = _head(FilmBody.of(CAPSULE), tube, 0.2, 0.2, 15)
    for gap in (0.4e-6, 4e-6):
        e = offset_at(head, gap, pitch, yaw)
        coarse, fine = (film_resistance(CAPSULE, tube, e, pitch, yaw, fineness=f) for f in (1.0, 1.5))
        roots = np.sqrt(np.diag(fine))
        assert np.abs((coarse - fine) / np.outer(roots, roots)).max() < 2e-3


def test_the_line_that_is_nearest_to_the_wall_is_found_with_its_slope():
    rng = np.random.default_rng(5)
    body = FilmBody.of(CAPSULE)
    angles = np.linspace(-1.2, 1.2, 4801)
    ring = np.stack([0.0 * angles, A * np.sin(angles), -A * np.cos(angles)], axis=-1)
    for _ in range(40):
        tube, gap = rng.uniform(13e-3, 30e-3), 1e-3 * A
        axes, x = frame(*rng.uniform(-0.2, 0.2, 2)), rng.uniform(-0.0175, 0.0085)
        low, high = 0.0, tube
        for _ in range(40):
            middle = 0.5 * (low + high)
            gaps = Place(body, tube, middle, axes).clearance(ring + np.array([x, 0.0, 0.0]))
            low, high = (middle, high) if gaps.min() > gap else (low, middle)
        nearest = angles[gaps.argmin()]
        if abs(nearest) > 0.6 or low - x * axes[2, 0] < 0.7 * (tube - A):
            continue
        place = Place(body, tube, low, axes)
        found, slope = place.bottom(np.array([x]), A)
        assert found[0] == pytest.approx(nearest, abs=4e-3)
        ahead, behind = (place.bottom(np.array([x + step]), A)[0][0] for step in (1e-7, -1e-7))
        assert slope[0] == pytest.approx((ahead - behind) / 2e-7, rel=1e-5, abs=1e-4)


@pytest.mark.slow
def test_coarse_table_of_small_yaws_is_near_the_direct_solution():
    """Where the film is thick, and as thin as asperities."""
    table = FilmTable.of(CAPSULE, TUBE, intervals=11)
    found = errors(table, 0, 40, 0.1)
    assert found.max() < 2e-2
    assert np.median(found) < 2e-3
    for pitch, yaw in ((0.0, 0.0), (0.0, 0.004), (0.002, -0.02), (-0.005, 0.1)):
        assert thin_errors(table, pitch, yaw).max() < 1e-2


@pytest.mark.slow
def test_table_is_the_direct_solution():
    table = FilmTable.of(CAPSULE, TUBE)
    few_degrees = errors(table, 0, 200, 0.1)
    assert few_degrees.max() < 3e-3
    assert np.median(few_degrees) < 3e-4
    assert errors(table, 1, 100, 0.2).max() < 1e-2
    thin = errors(table, 2, 100, 0.01, gaps=(2e-5, 1e-3))
    assert thin.max() < 1e-2
    assert np.median(thin) < 5e-4
    assert table.packed.nbytes < 140_000


def test_table_is_symmetric_positive_and_mirrored_anywhere(table):
    rng = np.random.default_rng(2)
    out = np.empty((6, 6))
    for _ in range(300):
        e, p, psi = rng.uniform(0, 12e-3), rng.uniform(-0.4, 0.4), rng.uniform(-0.3, 0.3)
        film_at(table.packed, e, p, psi, out)
        roots = np.sqrt(np.diag(out))
        scaled = out / np.outer(roots, roots)
        assert np.abs(scaled - scaled.T).max() < 1e-10
        mirrored = np.empty((6, 6))
        film_at(table.packed, e, p, -psi, mirrored)
        assert np.abs((MIRROR @ mirrored @ MIRROR - out) / np.outer(roots, roots)).max() < 1e-10
        if smallest_gap(table.packed, e, p, psi) > 1e-5 * A:
            assert np.linalg.eigvalsh(scaled).min() > 0


def test_film_below_the_table_goes_on_as_the_power_law(table):
    thin, thinner = (table.at(11e-3 - gap, 0.0, 0.0)[0][2, 2] for gap in (4e-5 * A, 2e-5 * A))
    assert thinner / thin == pytest.approx(2**1.5, rel=0.1)


def test_film_is_smooth_along_offset_pitch_and_yaw(table):
    """No jumps of the second differences, through knots and through the tube's axis in pitch."""
    for path in (
        lambda t: (11e-3 * (1 - 10 ** (-0.2 - 3.0 * t)), 0.15 * 10 ** (-0.2 - 3.0 * t), 0.0),
        lambda t: (8e-3, -0.1 + 0.2 * t, 0.02),
        lambda t: (10e-3, 0.01, -0.12 + 0.24 * t),
        lambda t: (4e-3 * t, 0.03, 0.02),
    ):
        logs = np.array([np.log(np.diag(table.at(*path(t))[0])) for t in np.linspace(0, 1, 801)])
        bends = np.diff(logs, 2, axis=0)
        assert np.abs(np.diff(bends, axis=0)).max() < 2e-5


def test_smallest_gap_is_that_of_the_surface(table):
    s, theta = np.linspace(0, 1, 801), np.linspace(-np.pi, np.pi, 1441)
    for e, p, psi in ((8e-3, 0.1, 0.05), (8e-3, -0.1, 0.05), (5e-3, -0.2, -0.1), (9e-3, 0.02, 0.1), (2e-3, 0.3, 0.1)):
        axis = np.array([np.cos(p) * np.cos(psi), np.cos(p) * np.sin(psi), np.sin(p)])
        side = np.array([-np.sin(psi), np.cos(psi), 0.0])
        up = np.cross(axis, side)
        nearest = np.inf
        for piece in CAPSULE.pieces:
            x, rho = (part[:, None] for part in piece.points(s))
            y = x * axis[1] + rho * (np.sin(theta) * side[1] - np.cos(theta) * up[1])
            z = x * axis[2] + rho * (np.sin(theta) * side[2] - np.cos(theta) * up[2]) - e
            nearest = min(nearest, (TUBE - np.hypot(y, z)).min())
        assert smallest_gap(table.packed, e, p, psi) == pytest.approx(nearest, abs=2e-7)


def test_table_of_a_sphere_turns_with_it(monkeypatch):
    """Made of one film at each offset: under a sphere that is turned it is that of a level one."""
    sphere, resistance_of = body_outline("sphere", 2 * A, 2 * A, 0.0, None, None), film_module.resistance_of

    @lru_cache
    def level(body, e):
        return resistance_of(body, TUBE, e, 0.0, 0.0)

    def turned(body, _radius, e, p, psi):
        turn = np.kron(np.eye(2), frame(p, psi))
        return turn.T @ level(body, round(e, 12)) @ turn

    with monkeypatch.context() as patch:
        patch.setattr(film_module, "resistance_of", turned)
        table = FilmTable.of(sphere, TUBE, intervals=9)
    for e, p, psi in ((10.9e-3, 0.3, 0.05), (10.99e-3, -0.1, -0.1), (5e-3, 0.0, 0.02), (0.0, 0.1, 0.0)):
        direct = film_resistance(sphere, TUBE, e, p, psi)
        roots = np.sqrt(np.diag(direct))
        assert np.abs((table.at(e, p, psi)[0] - direct) / np.outer(roots, roots)).max() < 3e-3


def test_bodies_without_a_table_are_refused():
    with pytest.raises(InputError, match="does not fit"):
        FilmTable.of(CAPSULE, 8e-3)
    with pytest.raises(InputError, match="straight side of"):
        FilmTable.of(body_outline("capsule", 2 * A, 19e-3, 0.0, "hemisphere", "hemisphere"), TUBE)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_nodes_beyond_the_wall_of_a_narrow_tube_come_off_it(side):
    """Above the body too, where a long one in a narrow tube has its widest gaps below: the table was never finished."""
    body, tube = FilmBody.of(body_outline("capsule", 16e-3, 40e-3, 0.0, "hemisphere", "flat")), 12e-3
    e, p, psi = _off_the_wall(body, tube, side * 4.0004e-3, -1.3e-5, 3.6e-3)
    assert 0.0 < Place(body, tube, e, frame(p, psi)).ends().min() < 1e-4 * A
    assert abs(e) < tube - body.radius
