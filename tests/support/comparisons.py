"""Comparisons of arrays that several tests use."""

from typing import Any

import numpy as np


def assert_matrices_close(found: np.ndarray, wanted: np.ndarray, tolerance: float) -> None:
    """Compare entries relative to the geometric mean of their diagonals."""
    scale = np.sqrt(np.outer(np.diag(wanted), np.diag(wanted)))
    np.testing.assert_array_less(np.abs(found - wanted) / scale, tolerance)


def slope(time: np.ndarray, values: np.ndarray) -> float:
    """Return the slope of a line through the finite values."""
    known = np.isfinite(values)
    return float(np.polyfit(time[known], values[known], 1)[0])


def flow_gradients(field: Any, points: np.ndarray, h: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Velocity gradient [point, direction, component], its Laplacian, and the pressure's gradient, of fourth order."""
    offsets = np.array([-2, -1, 0, 1, 2]) * h
    grid = points[:, None, None] + offsets[None, None, :, None] * np.eye(3)[None, :, None]
    velocity, pressure = field.fields(grid.reshape(-1, 3))
    velocity, pressure = velocity.reshape(len(points), 3, 5, 3), pressure.reshape(len(points), 3, 5)
    first = np.array([1, -8, 0, 8, -1]) / (12 * h)
    second = np.array([-1, 16, -30, 16, -1]) / (12 * h**2)
    return (
        np.einsum("ndoc,o->ndc", velocity, first),
        np.einsum("ndoc,o->nc", velocity, second),
        np.einsum("ndo,o->nd", pressure, first),
    )
