"""Tables and films as csrc/ evaluates them, against SciPy's interpolation of the same coefficients."""

import numpy as np
import pytest
from scipy.interpolate import BarycentricInterpolator, BSpline

import spirillum as sp
from spirillum.fluid.tube.domain import in_tube
from spirillum.fluid.tube.library import find_table
from spirillum.kernels import core, tube_table
from spirillum.robot.batch import RobotBatch


@pytest.fixture(scope="module", params=["biorob2012-wide", "biorob2012-narrow"])
def table(request: pytest.FixtureRequest) -> np.ndarray:
    batch = RobotBatch.of(sp.load(request.param))
    found = find_table(*in_tube(batch))
    assert found is not None
    return found.packed


def film_of(film: np.ndarray, e: float, pitch: float, yaw: float) -> np.ndarray:
    """M D M' from a tensor product of splines, turned from the wall's normal to z'."""
    c = np.empty(5)
    core.film_coordinates(film, e, pitch, yaw, c)
    shape = tube_table.shape_of(film)
    values = film[core.FILM_SIZE :].view(np.float32)[: np.prod(shape)].astype(float).reshape(shape)
    for at, (low, high, intervals) in zip(c[:2], (film[7:10], film[10:13]), strict=True):
        knots = low + (high - low) / intervals * np.arange(-3.0, intervals + 4.0)
        values = BSpline(knots, values, 3)(at)
    even = np.array([c[2] ** (2 * n) for n in range(shape[2])]) @ values
    lower, entries = np.eye(6), iter(even[6:])
    for i in range(6):
        for j in range(i):
            lower[i, j] = next(entries) * (c[2] if i >= 3 > j else 1.0)
    d = np.exp(even[:6] + np.array([c[3], 0, 0, 0, 0, 0]))
    order = np.array(tube_table.ORDER)
    size = np.where(order < 3, 1.0, film[core.FILM_BODY])
    found = np.empty((6, 6))
    found[np.ix_(order, order)] = film[core.FILM_BODY] * np.outer(size, size) * (lower * d @ lower.T)
    turn, cos, sin = np.eye(6), np.cos(c[4]), np.sin(c[4])
    turn[np.ix_([0, 2], [0, 2])] = [[cos, sin], [-sin, cos]]
    return turn @ found @ turn.T


def outer_of(table: np.ndarray, t: float, f: float, phase: float) -> np.ndarray:
    """L L' from polynomials between the nodes and a Fourier sum, nose up and without yaw."""
    parts = tube_table.parts_of(table)
    rings, gaps, up = (int(table[n]) for n in (1, 2, 3))
    nodes = table[8 + 4 * rings :]
    over_gaps = BarycentricInterpolator(np.sqrt(nodes[:gaps]), parts.rest[:, :up])(np.sqrt(t))
    coefficients = BarycentricInterpolator(np.log(1.3 - nodes[gaps : gaps + up]), over_gaps)(np.log(1.3 - f))
    harmonic = np.arange(1, len(coefficients)) + 1
    waves = np.where(harmonic % 2 == 0, np.cos(harmonic // 2 * phase), np.sin(harmonic // 2 * phase))
    factor = np.zeros((8, 8))
    factor[np.tril_indices(8)] = coefficients[0] + waves @ coefficients[1:]
    np.fill_diagonal(factor, np.exp(np.diag(factor)))
    return factor @ factor.T


@pytest.mark.parametrize(("t", "f", "phase"), [(0.2, 0.0, 0.0), (0.4, 0.3, 1.0), (0.7, 0.8, -2.0), (0.95, 0.5, 7.0)])
def test_the_table_is_film_and_outer_part_as_scipy_interpolates_them(
    table: np.ndarray, t: float, f: float, phase: float
) -> None:
    gaps, up = int(table[2]), int(table[3])
    nodes = table[8 + 4 * int(table[1]) :]
    most = nodes[gaps + up + int(table[4]) :][: 2 * gaps : 2]
    pitch = f * float(BarycentricInterpolator(np.sqrt(nodes[:gaps]), most)(np.sqrt(t)))
    if pitch > tube_table.STEEPEST[0]:
        pytest.skip("steeper than a table")
    e = (1.0 - t) * core.contact_offset_of(table, pitch)
    expected = outer_of(table, t, f, phase)
    expected[:6, :6] += core.cut_of_film(t) * film_of(tube_table.parts_of(table).film, e, pitch, 0.0)
    found = np.empty((8, 8))
    assert core.resistance_at(table, e, pitch, 0.0, phase, found) == core.INSIDE
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-11 * np.abs(expected).max())


@pytest.mark.parametrize(("pitch", "yaw"), [(0.0, 0.0), (0.01, 0.01), (-0.02, -0.03)])
def test_the_film_is_a_tensor_product_of_splines(table: np.ndarray, pitch: float, yaw: float) -> None:
    film = np.ascontiguousarray(tube_table.parts_of(table).film)
    for share in (0.5, 0.9, 0.97):
        e = share * core.contact_offset_of(table, pitch)
        expected, found = film_of(film, e, pitch, yaw), np.empty((6, 6))
        gap = core.film_at(film, e, pitch, yaw, found)
        assert gap == core.smallest_gap(film, e, pitch, yaw) > 0
        np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-12 * np.abs(expected).max())
