"""The film under a crest of a helical wire against finite differences of Reynolds' equation under an ellipsoid."""

import numpy as np
import pytest
from scipy.sparse import csc_matrix, diags
from scipy.sparse.linalg import spsolve

from spirillum.kernels import core

TUBE, WIRE, AMPLITUDE, WAVELENGTH, OIL = 20e-3, 0.5e-3, 2.5e-3, 25e-3, 3.5
RATE, JOINT = 2.0 * np.pi * 1.5, 6
"""Of the rotor, rad/s."""
K = 2.0 * np.pi / WAVELENGTH
SLOPE = np.arctan(AMPLITUDE * K)
"""Of the wire against the tube's axis, at its crest."""
CURVATURE = AMPLITUDE * (K * np.cos(SLOPE)) ** 2
ACROSS = 1.0 / (1.0 / WIRE - np.cos(SLOPE) ** 2 / TUBE)
ALONG = 1.0 / (CURVATURE / (1.0 + WIRE * CURVATURE) - np.sin(SLOPE) ** 2 / TUBE)
"""Radii of the gap's curvature."""


def film(gap: float, bound: float, *, at: float = 30e-3, is_line: bool = False) -> tuple[float, np.ndarray]:
    """Gap, and forces against the rates of a level robot whose crest is at the bottom of the tube.

    Args:
        gap: m.
        bound: p_c, Pa.
        at: of the crest from the root, m; the tip is at 60 mm.
        is_line: whether the wire is cubics between its stations.
    """
    xi = np.linspace(0.0, 60e-3, 121)
    angle, zero = -K * xi, np.zeros(xi.size)
    point = [-xi, AMPLITUDE * np.cos(angle), AMPLITUDE * np.sin(angle)]
    slope = [zero - 1.0, K * AMPLITUDE * np.sin(angle), -K * AMPLITUDE * np.cos(angle)]
    stations = np.column_stack([xi, *point, *slope, zero])
    wire = np.array([WIRE, AMPLITUDE, 0.0, 0.0 if is_line else K, 0.0, 60e-3])
    state, rates, force = np.zeros(core.STATE_SIZE), np.zeros(7), np.empty(7)
    state[:3] = 0.0, 0.0, -(TUBE - WIRE - AMPLITUDE - gap)
    state[3], rates[JOINT] = 1.0, RATE
    state[7] = -0.5 * np.pi + K * at
    bracket = np.minimum(at + np.array([-0.5e-3, 0.0, 0.5e-3]), 60e-3)
    found = core.crest_film(state, np.eye(3), TUBE, wire, stations, bracket, OIL, bound, rates, force)
    return found, force


def reynolds(gap: float, bound: float, cells: int = 90) -> tuple[float, float]:
    """Load, and the power of pressure and of shear where the gap is thin, over the rate."""
    across = -0.5 * RATE * AMPLITUDE * np.cos(SLOPE)
    along = RATE / K * np.cos(SLOPE) + 0.5 * RATE * AMPLITUDE * np.sin(SLOPE)
    wide, far = np.sqrt(2.0 * np.array([ACROSS, ALONG]) * gap), np.array([0.6 * WIRE, 2.8e-3])
    x, y = (w * np.sinh(np.linspace(-1.0, 1.0, cells + 1) * np.arcsinh(f / w)) for w, f in zip(wide, far, strict=True))
    xm, ym = 0.5 * (x[1:] + x[:-1]), 0.5 * (y[1:] + y[:-1])
    dx, dy = np.diff(x), np.diff(y)

    def h(at_x: np.ndarray, at_y: np.ndarray) -> np.ndarray:
        return gap + at_x[:, None] ** 2 / (2.0 * ACROSS) + at_y[None] ** 2 / (2.0 * ALONG)

    reach = [np.concatenate([[0.5 * d[0]], np.diff(m), [0.5 * d[-1]]]) for d, m in ((dx, xm), (dy, ym))]
    g_x = h(x, ym) ** 3 / (12.0 * OIL) * dy[None] / reach[0][:, None]
    g_y = h(xm, y) ** 3 / (12.0 * OIL) * dx[:, None] / reach[1][None]
    main = (g_x[:-1] + g_x[1:] + g_y[:, :-1] + g_y[:, 1:]).ravel()
    beside = g_y[:, 1:].copy()
    beside[:, -1] = 0.0
    off, beside = g_x[1:-1].ravel(), beside.ravel()[:-1]
    matrix: csc_matrix = diags([main, -off, -off, -beside, -beside], [0, cells, -cells, 1, -1], format="csc")
    slopes = np.diff(h(x, ym), axis=0) * dy[None], np.diff(h(xm, y), axis=1) * dx[:, None]
    source = (across * slopes[0] + along * slopes[1]).ravel()
    p = spsolve(matrix, -source)
    active = p < -bound
    while active.any():
        p = np.full(p.size, -bound)
        free = ~active
        p[free] = spsolve(matrix[free][:, free], -source[free] - matrix[free][:, active] @ p[active])
        now = np.where(active, matrix @ p + source > 0.0, p < -bound)
        if (now == active).all():
            break
        active = now
    area = dx[:, None] * dy[None]
    sheared = OIL * (RATE * (AMPLITUDE + WIRE)) ** 2 * np.sum(area / h(xm, ym))
    return float(np.sum(p.reshape(area.shape) * area)), (sheared - float(p @ source)) / RATE


def test_drag_grows_as_the_film_thins() -> None:
    """What is far from the crest is the same for both gaps."""
    thin, thick = (film(gap, np.inf) for gap in (1e-6, 4e-6))
    assert thin[0] == pytest.approx(1e-6, rel=1e-6)
    torques = [reynolds(gap, np.inf)[1] for gap in (1e-6, 4e-6)]
    assert thick[1][JOINT] - thin[1][JOINT] == pytest.approx(torques[0] - torques[1], rel=0.08)


@pytest.mark.parametrize(("gap", "bound"), [(2e-6, 1e5), (2e-6, 1e4), (5e-6, 1e4)])
def test_a_crest_is_lifted_by_its_cavity(gap: float, bound: float) -> None:
    """The lift is low by what the table's resistance of the wire has of the film."""
    load = reynolds(gap, bound)[0]
    assert film(gap, bound)[1][2] - film(gap, np.inf)[1][2] == pytest.approx(load, rel=0.25)


def test_there_is_no_film_beyond_its_reach() -> None:
    np.testing.assert_array_equal(film(0.76 * WIRE, 1e5)[1], 0.0)
    assert 0.0 < -film(0.74 * WIRE, 1e5)[1][JOINT] < 1e-3 * -film(1e-6, 1e5)[1][JOINT]


@pytest.mark.parametrize("at", [30.1e-3, 60e-3])
@pytest.mark.parametrize("bound", [np.inf, 1e4])
def test_a_wire_along_points_of_a_helix_has_its_film(at: float, bound: float) -> None:
    """In the middle, and at the tip."""
    line, helix = (film(2e-6, bound, at=at, is_line=is_line) for is_line in (True, False))
    assert line[0] == pytest.approx(helix[0], abs=1e-9)
    size = np.abs(helix[1][:3]).max() * np.where(np.arange(7) < 3, 1.0, at)
    np.testing.assert_allclose(line[1] / size, helix[1] / size, rtol=5e-3, atol=1e-3)
