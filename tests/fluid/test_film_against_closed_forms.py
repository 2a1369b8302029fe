"""The film between a body and the wall of its tube: limits in closed form, symmetries and convergence."""

import numpy as np
import pytest

from spirillum.errors import InputError
from spirillum.fluid.tube.film import film_resistance
from spirillum.robot.outline import body_outline
from spirillum.robot.tube_pose import TubePose

CAPSULE = body_outline("capsule", 18e-3, 35e-3, 0.0, "hemisphere", "flat")
BODIES = {
    "capsule": CAPSULE,
    "fillets": body_outline("capsule", 18e-3, 35e-3, 3e-3, "fillet", "fillet"),
    "sphere": body_outline("sphere", 18e-3, 18e-3, 0.0, None, None),
    "spheroid": body_outline("spheroid", 18e-3, 40e-3, 0.0, None, None),
}
MIRROR = np.diag([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
PLACES = ((0.0, 0.0), (0.03, 0.0), (-0.03, 0.02), (0.1, 0.05), (-0.1, 0.05), (0.002, 0.1), (-5e-4, 0.01))


def relative(one, other):
    roots = np.sqrt(np.diag(other))
    return np.abs((one - other) / np.outer(roots, roots)).max()


def per_length(radius, tube, gap):
    """Resistance per length of a long cylinder: of two lengths, so that the ends drop out."""
    films = [
        film_resistance(
            body_outline("capsule", 2 * radius, length, 0.0, "flat", "flat"), tube, tube - radius - gap, 0.0, 0.0
        )
        for length in (40 * radius, 30 * radius)
    ]
    return (films[0] - films[1]) / (10 * radius)


@pytest.mark.parametrize("ratio", [0.3, 0.45, 0.6, 0.9])
def test_approach_of_a_long_cylinder_is_the_line_formula(ratio):
    radius, gap = 1.0, 1e-4
    reduced = 1.0 / (1.0 - ratio)
    film = per_length(radius, radius / ratio, gap)[2, 2]
    assert film == pytest.approx(3 * np.sqrt(2) * np.pi * (reduced / gap) ** 1.5, rel=2e-3)


@pytest.mark.parametrize("ratio", [0.3, 0.45, 0.6, 0.9])
def test_singular_film_of_a_journal_orbits_and_slides_as_two_dimensional_theory_says(ratio):
    """Free of force it orbits at Omega lambda^2/(1 + lambda^2); free of torque a Omega/v is a/(R - a)."""
    thin, thick = (per_length(1.0, 1.0 / ratio, gap) for gap in (1e-4, 4e-4))
    film = thin - thick
    assert -film[1, 3] / film[1, 1] == pytest.approx(ratio * (1 - ratio) / (1 + ratio**2), rel=0.01)
    assert -film[3, 1] / film[3, 3] == pytest.approx(ratio / (1 - ratio), rel=0.01)


@pytest.mark.parametrize(
    ("tube", "gap", "force", "lateral", "normal", "torque"),
    [
        (20.0, 2.0, 20.22, 120.07, 402.05, 2.1788),
        (20.0, 0.5, 41.49, 211.16, 2664.1, 4.1272),
        (15.0, 1.0, 61.46, 417.91, 1690.3, 3.3732),
        (15.0, 0.2, 140.99, 826.51, 16460.0, 7.5116),
    ],
)
def test_rest_of_the_two_dimensional_problem_is_small_and_positive(tube, gap, force, lateral, normal, torque):
    """Full Stokes flow between eccentric circles, six digits, computed for this package; per length, a = 9 mm."""
    film = per_length(9.0, tube, gap)
    rest = np.array([[normal - film[2, 2], 0], [0, lateral - film[1, 1]]])
    assert 0 < rest[0, 0] < (0.035 if gap < 1 else 0.2) * normal
    assert 0 < rest[1, 1] < lateral
    assert 0 < force + film[1, 3] / 9.0 < force
    assert 0 < torque - film[3, 3] / (4 * np.pi * 81.0) < torque


def test_rest_of_the_two_dimensional_approach_hardly_knows_the_gap():
    rests = [exact - per_length(9.0, 20.0, gap)[2, 2] for gap, exact in ((2.0, 402.05), (0.5, 2664.1))]
    assert rests[0] == pytest.approx(rests[1], rel=0.25)


def test_sphere_near_a_plane_has_the_leading_terms_of_goldman_cox_and_brenner():
    a, tube = 1.0, 1e4
    sphere = body_outline("sphere", 2 * a, 2 * a, 0.0, None, None)
    thin, thick = (film_resistance(sphere, tube, tube - a - gap, 0.0, 0.0) for gap in (1e-4, 4e-4))
    slope = (thin - thick) / np.log(4.0)
    assert slope[0, 0] == pytest.approx(16 * np.pi / 5, rel=0.01)
    assert slope[4, 4] == pytest.approx(16 * np.pi / 5, rel=0.01)
    assert abs(slope[0, 4]) == pytest.approx(4 * np.pi / 5, rel=0.02)


@pytest.mark.parametrize("gap", [0.1, 0.01, 0.001])
def test_rest_of_a_sphere_near_a_plane_is_regular(gap):
    """Brenner's series to the constant: 6 pi (1/h - ln(h)/5 + 0.971264)."""
    sphere = body_outline("sphere", 2.0, 2.0, 0.0, None, None)
    film = film_resistance(sphere, 1e4, 1e4 - 1.0 - gap, 0.0, 0.0)[2, 2]
    assert 1.5 < 1 / gap - 0.2 * np.log(gap) + 0.971264 - film / (6 * np.pi) < 3.5


@pytest.mark.parametrize(("edge", "most"), [(3e-3, 0.03), (9e-3, 0.01)])
def test_a_rounded_edge_has_the_film_of_an_ellipsoid(edge: float, most: float) -> None:
    """Reynolds' pressure over the gap h + s^2/(2 R1) + t^2/(2 R2): 12 pi (R1 R2)^1.5/((R1 + R2) h)."""
    tube, pitch = 20e-3, 0.1
    body = body_outline("capsule", 18e-3, 35e-3, edge, "fillet", "fillet")
    across = 1.0 / (np.cos(pitch) / (9e-3 - edge + edge * np.cos(pitch)) - 1.0 / tube)
    normal = np.array([np.sin(pitch), 0.0, np.cos(pitch), 0.0, 0.0, 0.0])
    films = []
    for gap in (0.5e-6, 2e-6):
        film = film_resistance(body, tube, TubePose.at_gap(body, tube, gap, pitch).offset, pitch, 0.0)
        films.append(normal @ film @ normal)
    reduced = (edge * across) ** 1.5 / (edge + across)
    assert films[0] - films[1] == pytest.approx(12 * np.pi * reduced * (1 / 0.5e-6 - 1 / 2e-6), rel=most)


@pytest.mark.parametrize("name", BODIES)
def test_resistance_is_symmetric_positive_and_mirrored(name):
    for pitch, yaw in PLACES:
        for offset in (0.0, 9e-3):
            film = film_resistance(BODIES[name], 20e-3, offset, pitch, yaw)
            assert np.abs(film - film.T).max() <= 1e-12 * np.abs(film).max()
            assert np.linalg.eigvalsh(film / np.sqrt(np.outer(np.diag(film), np.diag(film)))).min() > 0
            mirrored = film_resistance(BODIES[name], 20e-3, offset, pitch, -yaw) if yaw else film
            assert relative(MIRROR @ mirrored @ MIRROR, film) < 1e-10


@pytest.mark.parametrize("name", BODIES)
@pytest.mark.parametrize("offset", [10e-3, 10.9e-3, 10.99e-3])
def test_grid_is_converged(name, offset):
    film, fine = (film_resistance(BODIES[name], 20e-3, offset, 0.0, 0.0, fineness=f) for f in (1.0, 1.6))
    assert relative(film, fine) < 1e-4


@pytest.mark.parametrize(("pitch", "yaw"), PLACES)
def test_grid_is_converged_where_the_body_is_turned(pitch, yaw):
    offset = 11e-3 - 0.0176 * abs(pitch) - 4e-3 * abs(yaw) - 1e-5
    coarse, film, fine = (film_resistance(CAPSULE, 20e-3, offset, pitch, yaw, fineness=f) for f in (0.75, 1.0, 1.6))
    assert relative(film, fine) < 1e-4
    assert relative(film, fine) < max(0.3 * relative(coarse, fine), 1e-9)


def test_sphere_does_not_know_its_pitch():
    level, turned = (film_resistance(BODIES["sphere"], 20e-3, 10.5e-3, pitch, 0.0) for pitch in (0.0, 0.2))
    c, s = np.cos(0.2), np.sin(0.2)
    turn = np.kron(np.eye(2), np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]]))
    assert relative(turn @ level @ turn.T, turned) < 1e-8


def test_touching_bodies_are_refused():
    with pytest.raises(InputError, match="touches the wall"):
        film_resistance(CAPSULE, 20e-3, 11.01e-3, 0.0, 0.0)
