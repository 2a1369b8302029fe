"""Scores of a shape at many places at once are those of one place after the other."""

import numpy as np
import pytest

from spirillum.kernels.core import edge_scores

RUN = 6


def score(slopes: np.ndarray, pixels: np.ndarray, normals: np.ndarray, group: np.ndarray) -> float:
    """Geometric mean of the first four groups' mean strengths over runs of points, and a share of the fifth's."""
    strengths = []
    for index in range(5):
        mine = group == index
        there = np.floor(pixels[mine] + 0.5).astype(int)
        inside = np.all((there >= 0) & (there < slopes.shape[:2]), axis=1)
        if index < 4 and 2 * inside.sum() < inside.size:
            return 0.0
        along = [slopes[u, v] @ n if ok else 0.0 for (u, v), n, ok in zip(there, normals[mine], inside, strict=True)]
        runs = [abs(sum(along[start : start + RUN])) for start in range(0, len(along), RUN)]
        strengths.append(sum(runs) / max(1, inside.sum()))
    mean = float(np.prod(strengths[:4]) ** 0.25)
    return mean + 0.3 * min(strengths[4], 2.0 * mean)


def test_all_places_against_one_after_the_other() -> None:
    rng = np.random.default_rng(3)
    slopes = rng.normal(size=(30, 40, 2))
    group = np.repeat(np.arange(5), [7, 8, 13, 12, 5])
    pixels = rng.uniform([4.0, 5.0], [22.0, 33.0], (group.size, 2))
    turn = rng.uniform(0.0, 2.0 * np.pi, group.size)
    normals = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    found, first = np.empty((9, 14)), (-14.0, -7.5)
    u, v = (np.ascontiguousarray(slopes[..., k]) for k in (0, 1))
    edge_scores(u, v, pixels, normals, group, *first, np.empty((2, 5, found.shape[1])), found)
    assert 20 < np.count_nonzero(found) < found.size
    for place in np.ndindex(found.shape):
        moved = pixels + np.array(first) + np.array(place)
        assert found[place] == pytest.approx(score(slopes, moved, normals, group), rel=1e-12)
