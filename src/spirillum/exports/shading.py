"""Normals for smooth shading: round surfaces look round, edges stay sharp."""

from __future__ import annotations

import numpy as np

from spirillum.arrays import Samples
from spirillum.robot.surface import Faces

__all__ = ["corner_normals"]

_CREASE = np.cos(np.deg2rad(40.0))


def corner_normals(vertices: Samples, faces: Faces) -> Samples:
    """Unit normal at each corner of each triangle, (m, 3, 3).

    The mean of the triangles around the vertex, weighted by area, that turn away from the corner's own by no more
    than 40 degrees.

    Args:
        vertices: (n, 3).
        faces: outward oriented, (m, 3).
    """
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    area: Samples = np.cross(b - a, c - a)
    unit = _unit(area)
    vertex = faces.ravel()
    order = np.argsort(vertex, kind="stable")
    owner = order // 3  # the triangles around each vertex, one vertex after the other
    count = np.bincount(vertex, minlength=len(vertices))
    first = np.concatenate([np.zeros(1, dtype=np.int64), np.cumsum(count)[:-1]])
    around = count[vertex[order]]
    corner = np.repeat(np.arange(order.size), around)
    start = np.repeat(first[vertex[order]], around)
    step = np.arange(corner.size) - np.repeat(np.cumsum(around) - around, around)
    other = owner[start + step]
    near = np.sum(unit[owner[corner]] * unit[other], axis=1) >= _CREASE
    total: Samples = np.stack(
        [np.bincount(corner, np.where(near, area[other, axis], 0.0), order.size) for axis in range(3)], axis=-1
    )
    found: Samples = np.empty_like(total)
    found[order] = _unit(total)
    return found.reshape(-1, 3, 3)


def _unit(vectors: Samples) -> Samples:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    unit: Samples = vectors / np.where(length > 0, length, 1.0)
    return unit
