"""Two spheres on one axis against Stimson and Jeffery, Brenner, Jeffery, and the method of reflections."""

from collections.abc import Callable
from functools import lru_cache

import numpy as np
import pytest

from spirillum.fluid.wire.interaction import Discretisation, UnitTwistSolution, solve
from spirillum.robot.outline import Arc, Outline


def sphere(centre: float, radius: float = 1.0) -> Outline:
    return Outline((Arc((centre, 0.0), (radius, radius), (0.0, np.pi)),), ())


@lru_cache
def pair(half: float, order: int = 12) -> UnitTwistSolution:
    """Two unit spheres with their centres at +-half; the one in front is the body."""
    return solve([(sphere(half), 0), (sphere(-half), 1)], [], Discretisation(order=order))


def series(half: float) -> tuple[np.ndarray, float]:
    """Bispherical coordinates: n and alpha with cosh(alpha) = half the distance of the centres over the radius."""
    alpha = np.arccosh(half)
    return np.arange(1.0, 36.0 / alpha + 2.0), alpha


def moving_alike(half: float) -> float:
    """Drag over 6 pi mu a U of each of two equal spheres (Stimson and Jeffery, Proc. R. Soc. A 111:110, 1926)."""
    n, alpha = series(half)
    x, sinh = (n + 0.5) * alpha, np.sinh(alpha)
    fraction = (4 * np.sinh(x) ** 2 - (2 * n + 1) ** 2 * sinh**2) / (
        2 * np.sinh(2 * x) + (2 * n + 1) * np.sinh(2 * alpha)
    )
    return float(4 / 3 * sinh * np.sum(n * (n + 1) / ((2 * n - 1) * (2 * n + 3)) * (1 - fraction)))


def moving_apart(half: float) -> float:
    """The same of spheres that part or approach (Brenner, Chem. Eng. Sci. 16:242, 1961: a free plane surface's)."""
    n, alpha = series(half)
    x, sinh = (n + 0.5) * alpha, np.sinh(alpha)
    # The mid-plane is one of symmetry: no flow through it, no shear on it.
    fraction = (4 * np.cosh(x) ** 2 + (2 * n + 1) ** 2 * sinh**2) / (
        2 * np.sinh(2 * x) - (2 * n + 1) * np.sinh(2 * alpha)
    )
    return float(4 / 3 * sinh * np.sum(n * (n + 1) / ((2 * n - 1) * (2 * n + 3)) * (fraction - 1)))


def spinning(half: float, sense: float) -> float:
    """Torque over 8 pi mu a^3 Omega about the line of centres (Jeffery, Proc. Lond. Math. Soc. 14:327, 1915)."""
    n, alpha = series(half)
    return float(np.sinh(alpha) ** 3 * np.sum((-sense) ** (n + 1) / np.sinh(n * alpha) ** 3))


def test_series_at_known_places() -> None:
    """At contact 0.645 for spheres that move alike, zeta(3) and 3/4 zeta(3) for those that spin."""
    assert moving_alike(1 + 1e-7) == pytest.approx(0.6451, abs=2e-4)
    zeta = 1.2020569
    assert spinning(1 + 1e-7, -1.0) == pytest.approx(zeta, abs=1e-4)
    assert spinning(1 + 1e-7, 1.0) == pytest.approx(0.75 * zeta, abs=1e-4)


MOTIONS: dict[str, tuple[Callable[[float], float], int, float]] = {
    "alike": (moving_alike, 0, 1.0),
    "apart": (moving_apart, 0, -1.0),
    "spinning alike": (lambda half: spinning(half, 1.0), 3, 1.0),
    "spinning against": (lambda half: spinning(half, -1.0), 3, -1.0),
}


NEAREST = [pytest.param(half, marks=pytest.mark.slow) for half in (1.0005, 1.001)]


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("half", [*NEAREST, 1.002, 1.005, 1.05, 1.5, 4.0])
def test_exact_series(motion: str, half: float) -> None:
    """Down to gaps of a thousandth of the radius; approaching spheres have a lubrication pressure of 1/gap."""
    exact, entry, sense = MOTIONS[motion]
    matrix = pair(half).matrix
    unit = 6 * np.pi if entry == 0 else 8 * np.pi
    found = (matrix[entry, entry] + sense * matrix[entry, entry + 6]) / unit
    rounding = 1e-12 if motion != "apart" else 1e-13 / (half - 1)
    assert found == pytest.approx(exact(half), rel=max(2e-11, rounding))


@pytest.mark.parametrize("half", [1.005, 1.5])
def test_series_are_approached_exponentially(half: float) -> None:
    errors = []
    for order in (4, 6, 8):
        matrix = pair(half, order).matrix
        found = [(matrix[e, e] + s * matrix[e, e + 6]) / (6 if e == 0 else 8) / np.pi for _, e, s in MOTIONS.values()]
        wanted = [exact(half) for exact, _, _ in MOTIONS.values()]
        errors.append(np.max(np.abs(np.array(found) / wanted - 1)))
    assert errors[1] < 0.05 * errors[0]
    assert errors[2] < 0.05 * errors[1]
    assert errors[2] < 1e-8


@pytest.mark.parametrize("half", [1.005, 1.5, 4.0])
def test_reciprocity(half: float) -> None:
    solution = pair(half)
    assert solution.asymmetry < 1e-11
    # Which sphere is called the body does not matter: the pair is its own mirror image.
    mirror = np.diag([-1.0, 1, 1, 1, -1, -1])
    matrix = solution.matrix
    np.testing.assert_allclose(mirror @ matrix[6:, 6:] @ mirror, matrix[:6, :6], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(mirror @ matrix[6:, :6] @ mirror, matrix[:6, 6:], rtol=1e-9, atol=1e-9)
    np.linalg.cholesky(matrix)


def mobility_far_apart(x: tuple[float, float], radius: tuple[float, float]) -> np.ndarray:
    """Velocities (translation at each centre, rotation) from forces and torques, viscosity 1, to the first reflection.

    Happel and Brenner, Low Reynolds Number Hydrodynamics, sections 6-1 and 6-2: Faxen's laws in the other's flow.
    """
    d = x[0] - x[1]
    along, r = np.array([1.0, 0.0, 0.0]), abs(d)
    dyad = np.outer(along, along)
    cross = np.array([[0, 0, 0], [0, 0, -1], [0, 1, 0]]) * d  # d times
    m = np.zeros((12, 12))
    for which, a in enumerate(radius):
        at = 6 * which
        m[at : at + 3, at : at + 3] = np.eye(3) / (6 * np.pi * a)
        m[at + 3 : at + 6, at + 3 : at + 6] = np.eye(3) / (8 * np.pi * a**3)
    size = (radius[0] ** 2 + radius[1] ** 2) / r**2
    m[:3, 6:9] = (np.eye(3) + dyad + size * (np.eye(3) / 3 - dyad)) / (8 * np.pi * r)
    m[3:6, 9:] = (3 * dyad - np.eye(3)) / (16 * np.pi * r**3)
    m[3:6, 6:9] = -cross / (8 * np.pi * r**3)  # half the curl of a Stokeslet
    m[:3, 9:] = -cross / (8 * np.pi * r**3)  # a rotlet's velocity, torque times d/(8 pi r^3)
    m[6:9, :3], m[9:, 3:6] = m[:3, 6:9].T, m[3:6, 9:].T
    m[9:, :3], m[6:9, 3:6] = m[:3, 9:].T, m[3:6, 6:9].T
    return m


def test_far_apart() -> None:
    """What the first reflection leaves out of the mobility falls off as 1/r^4 (a stresslet's answer)."""
    radius = (1.0, 0.5)
    worst = []
    for distance in (10.0, 20.0, 40.0):
        x = (0.4 * distance, -0.6 * distance)
        matrix = solve(
            [(sphere(x[0], radius[0]), 0), (sphere(x[1], radius[1]), 1)], [], Discretisation(order=12)
        ).matrix
        to_centre = np.eye(12)  # twists about the origin from twists about the centres
        for which in (0, 1):
            to_centre[6 * which + 1, 6 * which + 5] = -x[which]
            to_centre[6 * which + 2, 6 * which + 4] = x[which]
        wanted = mobility_far_apart(x, radius)
        found = np.linalg.inv(to_centre.T @ matrix @ to_centre)
        scale = np.sqrt(np.outer(np.diag(wanted), np.diag(wanted)))
        worst.append(np.max(np.abs(found - wanted) / scale))
    assert worst[0] < 5e-4
    np.testing.assert_allclose(np.log2(np.array(worst[:-1]) / worst[1:]), 4.0, atol=0.1)


def test_three_spheres_in_a_row() -> None:
    """Two spheres of one part and one of the other: joined, the matrix is that of a chain of three."""
    solids = [(sphere(3.0), 0), (sphere(0.0), 0), (sphere(-3.0), 1)]
    solution = solve(solids, [], Discretisation(order=10))
    assert solution.asymmetry < 1e-10
    whole = solution.matrix[:6, :6] + solution.matrix[:6, 6:] + solution.matrix[6:, :6] + solution.matrix[6:, 6:]
    chain = solve([(outline, 0) for outline, _ in solids], [], Discretisation(order=10)).matrix[:6, :6]
    np.testing.assert_allclose(whole, chain, rtol=1e-10, atol=1e-9)
    assert 6 * np.pi < chain[0, 0] < 2 * moving_alike(1.5) * 6 * np.pi + 6 * np.pi
