"""Films whose pressure is bounded below, csrc/cavitation.c, against Reynolds' equation by differences and limits."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import solve_banded
from scipy.optimize import brentq

from spirillum.kernels.core import lift_of_cavitation

ETA, BEND = 1.0, 0.0164
"""Viscosity, Pa s, and R' of the paper's body in the wide tube, m."""
ATMOSPHERE = 1.0e5


def lift(gap: float, opening: float, entrainment: float, bound: float = ATMOSPHERE) -> np.ndarray:
    """Forces that the bound adds, and their derivatives, (6,)."""
    out = np.empty((1, 6))
    numbers = (np.array([float(number)]) for number in (gap, BEND, opening, entrainment))
    lift_of_cavitation(*numbers, ETA, bound, out)
    return out[0]


def linear(gap: float, opening: float, entrainment: float) -> np.ndarray:
    """Forces of the film without a bound on V and u, N/m."""
    s = np.sqrt(2.0 * BEND * gap)
    return -ETA * np.pi / gap**2 * np.array([3.0 * BEND * s * opening, 2.0 * s**3 / BEND * entrainment])


def reynolds(gap: float, v: float, u: float, bound: float, count: int = 2001) -> np.ndarray:
    """Forces on V and u of Reynolds' equation with p >= -p_c, a complementarity problem, by active sets, N/m."""
    s = np.sqrt(2.0 * BEND * gap)
    angle, step = np.linspace(-1.566, 1.566, count, retstep=True)
    x, width = s * np.tan(angle), s * step / np.cos(angle) ** 2  # finer where the film is thin
    h = gap + x**2 / (2.0 * BEND)
    between = np.diff(x)
    middle = (0.5 * (h[1:] + h[:-1])) ** 3 / (12.0 * ETA * between)
    source = (u * x / BEND + v) * width
    rows = np.zeros((3, count))
    rows[1, [0, -1]] = 1.0
    rows[0, 2:], rows[2, :-2] = middle[1:], middle[:-1]
    rows[1, 1:-1] = -(middle[1:] + middle[:-1])
    source[[0, -1]] = 0.0
    active = np.zeros(count, dtype=bool)
    for _ in range(count):
        matrix, right = rows.copy(), source.copy()
        held = np.flatnonzero(active)
        matrix[1, held], right[held] = 1.0, -bound
        matrix[0, held + 1] = 0.0
        matrix[2, held - 1] = 0.0
        p = solve_banded((1, 1), matrix, right)
        inflow = source - rows[1] * p - np.append(rows[0, 1:] * p[1:], 0.0) - np.append(0.0, rows[2, :-1] * p[:-1])
        new = np.where(active, inflow > -1e-12 * np.abs(source).max(), p < -bound * (1.0 + 1e-9))
        new[[0, -1]] = False
        if (new == active).all():
            break
        active = new
    else:
        raise AssertionError("the active set has not settled")
    return np.array([(p * width).sum(), (p * x / BEND * width).sum()])


CASES = [
    (1e-6, 0.0, 1e-3),
    (1e-6, 0.0, -1e-3),
    (5e-7, 5e-7, 0.0),
    (2e-6, 5e-6, 3e-3),
    (2e-6, -5e-6, 1.5e-2),
    (1e-6, 1e-4, -1e-2),
    (1e-6, 1e-3, 1e-4),
]


@pytest.mark.parametrize(("gap", "opening", "entrainment"), CASES)
def test_forces_are_those_of_reynolds_equation_with_a_bound(gap: float, opening: float, entrainment: float) -> None:
    found = lift(gap, opening, entrainment)[:2]
    # The ends of the grid, where the gap is 200 s away, leave the same of both.
    bounded, free = (reynolds(gap, opening, entrainment, bound) for bound in (ATMOSPHERE, np.inf))
    assert found[0] > 0
    assert (np.abs(found - (bounded - free)) < 1e-4 * np.abs(free).max() + 2e-3 * np.abs(bounded - free)).all()


@pytest.mark.parametrize(("gap", "opening", "entrainment"), CASES)
def test_derivatives_are_those_of_the_forces_and_symmetric(gap: float, opening: float, entrainment: float) -> None:
    found = lift(gap, opening, entrainment)
    size = abs(opening) + 1e-7, abs(entrainment) + 1e-4
    for column, step in ((2, (1e-5 * size[0], 0.0)), (4, (0.0, 1e-5 * size[1]))):
        more = lift(gap, opening + step[0], entrainment + step[1])[:2]
        less = lift(gap, opening - step[0], entrainment - step[1])[:2]
        slope = (more - less) / (2.0 * sum(step))
        np.testing.assert_allclose(found[column : column + 2], slope, rtol=1e-4, atol=1e-5 * np.abs(found[2:]).max())
    assert found[3] == pytest.approx(found[4], rel=1e-9, abs=1e-9 * np.abs(found[2:]).max())


@given(st.floats(-7, -4), st.floats(-1e-5, 1e-5), st.floats(-1e-2, 1e-2), st.floats(2, 6))
def test_mirror_energy_and_convexity(log_gap: float, v: float, u: float, log_bound: float) -> None:
    gap, bound = 10.0**log_gap, 10.0**log_bound
    found, whole = lift(gap, v, u, bound), linear(gap, v, u)
    assert np.isfinite(found).all()
    np.testing.assert_allclose(lift(gap, v, -u, bound)[:2], found[:2] * [1, -1], rtol=1e-9, atol=1e-12)
    lost = -(whole + found[:2]) @ [v, u]
    assert lost >= -1e-9 * abs(whole @ [v, u])
    # The derivative of the whole film's forces is negative definite: what is left of the linear resistance.
    of_v, of_u = linear(gap, 1.0, 0.0)[0], linear(gap, 0.0, 1.0)[1]
    left = np.array([[of_v + found[2], found[4]], [found[3], of_u + found[5]]])
    scale = np.sqrt(np.outer([of_v, of_u], [of_v, of_u]))
    assert np.linalg.eigvalsh(0.5 * (left + left.T) / scale).max() <= 1e-7


@given(st.floats(-1e4, 600.0), st.floats(-6, 6), st.sampled_from([-1.0, 1.0]))
def test_cavities_leave_a_fifth_of_the_resistance_to_rolling(pull: float, log_a: float, side: float) -> None:
    """As csrc/slices.c relies on, as long as the linear film pulls with less than 600 p_c."""
    gap = 1e-6
    v = pull * ATMOSPHERE * gap**2 / (6.0 * ETA * BEND)
    found = lift(gap, v, side * 10.0**log_a * ATMOSPHERE * gap**1.5 / (12.0 * ETA * np.sqrt(2.0 * BEND)))
    of_v, of_u = -linear(gap, 1.0, 0.0)[0], -linear(gap, 0.0, 1.0)[1]
    left = np.array([[of_v - found[2], -found[4]], [-found[3], 0.8 * of_u - found[5]]])
    assert np.linalg.eigvalsh(left / np.sqrt(np.outer([of_v, of_u], [of_v, of_u]))).min() >= -1e-7


def test_without_a_bound_and_on_approach_nothing_is_added() -> None:
    assert (lift(1e-6, 1e-7, 1e-3, 1e12) == 0.0).all()
    assert (lift(1e-6, 1e-3, 1e-3, np.inf) == 0.0).all()
    assert (lift(1e-6, -1e-3, 0.0) == 0.0).all()


def test_entrainment_without_tension_bears_martins_load() -> None:
    """H. M. Martin, Engineering 102:119, 1916, and L. Guembel: 4.9 eta u R'/h0."""
    gap, u = 1e-6, 1e-3
    assert lift(gap, 0.0, u, 1e-4)[0] == pytest.approx(4.896 * ETA * u * BEND / gap, rel=1e-3)


@pytest.mark.parametrize("bound", [np.inf, 1e5, 1e4])
def test_a_heavy_cylinder_in_a_turning_drum_is_borne_and_turned_by_its_cavity(bound: float) -> None:
    """At a fixed place, free of torque: the signs of J. Ashmore, C. del Pino, T. Mullin, PRL 94:124501, 2005."""
    gap, drum = 1e-6, 2e-3
    shear = np.pi * ETA * np.sqrt(2.0 * BEND * gap) / gap

    def torque(surface: float) -> float:
        u = 0.5 * (drum + surface)
        pressed = float(linear(gap, 0.0, u)[1] + lift(gap, 0.0, u, bound)[1])
        return (0.5 * pressed - shear * (surface - drum)) / (shear * drum)

    surface = brentq(torque, -drum, drum)
    load = lift(gap, 0.0, 0.5 * (drum + surface), bound)[0]
    if np.isfinite(bound):
        assert 0.0 < surface < drum
        assert load > 0.0
    else:  # pressure and shear of the linear film hold it at rest, and it bears nothing
        assert abs(surface) < 1e-9 * drum
        assert load == 0.0


def test_the_pull_is_bounded_by_that_of_a_cavity() -> None:
    """However fast the gap opens, the pull is p_c over where the pressure would be lower, and little beside it."""
    gap = 1e-6
    s = np.sqrt(2.0 * BEND * gap)
    for v in (1e-5, 1e-3, 1e-1):
        pull = -(linear(gap, v, 0.0) + lift(gap, v, 0.0)[:2])[0]
        edge = s * np.sqrt(np.sqrt(6.0 * ETA * BEND * v / (ATMOSPHERE * gap**2)) - 1.0)
        assert 1.0 < pull / (2.0 * ATMOSPHERE * edge) < 1.4


def test_the_film_cavitates_from_where_entrainment_alone_reaches_the_bound() -> None:
    u = 1.4e-3
    h_c = (9 / 4 * np.sqrt(2 / 3) * ETA * u * np.sqrt(BEND) / ATMOSPHERE) ** (2 / 3)
    assert lift(1.001 * h_c, 0.0, u)[0] == 0.0
    assert 0.0 < lift(0.9999 * h_c, 0.0, u)[0] < lift(0.99 * h_c, 0.0, u)[0]
