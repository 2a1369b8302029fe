"""Edges of a seal, shares of colour across them and displacements, against short NumPy references."""

import numpy as np
import pytest
from scipy.ndimage import uniform_filter1d

from spirillum.kernels.core import seal_shares, seal_shifts

OFFSETS = np.arange(-6.0, 7.0)
SIDES = np.array([[0, 12, 0], [12, 30, 1], [30, 36, 0]])
BESIDE, DISTINCT, WHITE, FEWEST, POOLED = 3.0, 2.0, 235.0, 8, 2
GROUND = np.array([36.0 * np.eye(3), 36.0 * np.eye(3) + np.outer([9.0, 7.0, 2.0], [9.0, 7.0, 2.0])])
"""Of the ends, and of the silhouettes over a grid."""


def side_by_numpy(
    here: np.ndarray, palette: np.ndarray, *, is_flank: bool
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Share, distance and kind at the edges of one side, from its colours, (3, n, m)."""
    beside = OFFSETS >= BESIDE
    means = here[:, :, beside].mean(axis=2)
    seen = np.isfinite(means).all(axis=0)
    means[:, ~seen] = means[:, seen].mean(axis=1, keepdims=True)
    middle = uniform_filter1d(means, 2 * POOLED + 1, axis=-1, mode="nearest")
    away = here - middle[:, :, None]
    rest = away[:, :, beside].reshape(3, -1)
    rest = rest[:, np.isfinite(rest).all(axis=0)]
    spread = rest @ rest.T / rest.shape[1] + GROUND[int(is_flank)]
    low, high = (-BESIDE, -1.0) if is_flank else (-2.0 * BESIDE, -BESIDE)
    inner = here[:, :, (low <= OFFSETS) & (high >= OFFSETS)].mean(axis=2)
    steps = np.stack(
        [inner - middle] if not (is_flank and len(palette)) else [one[:, None] - middle for one in palette]
    )
    towards = np.linalg.solve(spread, steps)
    share = np.einsum("jcn,cnm->jnm", towards, away) / np.sum(towards * steps, axis=1)[:, :, None]
    share = np.clip(share.max(axis=0), -0.2, 1.2) if is_flank and len(palette) else share[0]
    step = inner - middle
    apart = np.sum(step * np.linalg.solve(spread, step), axis=0)
    is_glare = np.maximum(inner.min(axis=0), middle.min(axis=0)) > WHITE
    off = np.sum((np.nan_to_num(inner).T[:, None] - palette) ** 2, axis=2)
    kind = np.argmin(off, axis=1) if len(palette) else np.zeros(len(off), dtype=int)
    return share, np.where((apart > DISTINCT**2) & ~is_glare, apart, 0.0), kind


@pytest.mark.parametrize("kinds", [0, 4])
@pytest.mark.parametrize("hidden", [0.0, 0.2])
def test_shares_are_those_of_plain_numpy(kinds: int, hidden: float) -> None:
    rng = np.random.default_rng(3)
    count = int(SIDES[-1, 1])
    colours = rng.uniform(0.0, 255.0, (3, count, 1)) + rng.normal(0.0, 8.0, (3, count, OFFSETS.size))
    colours[:, 5] = 250.0  # glare
    colours[:, rng.uniform(size=(count, OFFSETS.size)) < hidden / OFFSETS.size] = np.nan
    palette = rng.uniform(0.0, 255.0, (kinds, 3))
    share, distance, kind = np.empty((count, OFFSETS.size)), np.empty(count), np.empty(count, dtype=np.int64)
    limits = BESIDE, DISTINCT, WHITE, FEWEST, POOLED
    seal_shares(colours, OFFSETS, SIDES, palette, GROUND, *limits, np.empty((2, 3, count)), share, distance, kind)
    for first, end, is_flank in SIDES[:2].tolist():
        expected = side_by_numpy(colours[:, first:end].copy(), palette, is_flank=bool(is_flank))
        for found, true in zip((share, distance, kind), expected, strict=True):
            assert np.allclose(found[first:end], true, rtol=1e-9, atol=1e-9, equal_nan=True)
    assert distance[5] == 0.0
    assert np.isnan(share[SIDES[2, 0] :]).all()  # too few edges of this side
    assert not distance[SIDES[2, 0] :].any()


@pytest.mark.parametrize("start", [0, 3])
def test_shifts_are_those_of_linear_least_squares(start: int) -> None:
    """At a silhouette, the second side, the first samples may be left out."""
    rng = np.random.default_rng(4)
    count, template = int(SIDES[1, 1]), -0.5 * np.tanh(OFFSETS / 2.0)
    design = np.column_stack([np.ones(OFFSETS.size), template, np.gradient(template)])
    starts, inverses = np.array([0, start]), np.zeros((2, 3, OFFSETS.size))
    for inverse, first in zip(inverses, starts, strict=True):
        inverse[:, first:] = np.linalg.pinv(design[first:])
    share = 0.5 - 0.5 * np.tanh((OFFSETS - rng.uniform(-3.0, 3.0, (count, 1))) / 2.0)
    share = rng.uniform(0.2, 1.5, (count, 1)) * share + 0.01 * rng.normal(size=share.shape)
    share[4] = np.nan
    distance, kind = rng.uniform(0.0, 9.0, count), rng.integers(0, 4, count)
    distance[7] = 0.0
    bias = rng.normal(size=(2, 4))
    shifts, known, variance = np.empty(count), np.empty(count, dtype=bool), np.empty(count)
    limits = 1.7, 2.5, 0.4, 1.2, 0.03  # steepness, largest shift, contrasts, noise
    given = share, distance, kind, SIDES[:2], bias, design, inverses, starts
    seal_shifts(*given, *limits, shifts, known.view(np.uint8), variance)
    assert 0 < known.sum() < count - 2
    for k in range(count):
        side = int(k >= SIDES[0, 1])
        rows = slice(starts[side], None)
        numbers = np.linalg.pinv(design[rows]) @ share[k, rows]
        shift, miss = -numbers[2] / numbers[1], share[k, rows] - design[rows] @ numbers
        assert shifts[k] == pytest.approx(shift - bias[side, kind[k]], rel=1e-9, nan_ok=True)
        assert known[k] == (distance[k] > 0.0 and abs(shift) < 2.5 and 0.4 < numbers[1] < 1.2)
        if known[k]:
            usual = max(np.sqrt(miss @ miss / (miss.size - 3)), 0.03 / np.sqrt(distance[k]))
            assert variance[k] == pytest.approx((usual / (numbers[1] * 1.7)) ** 2, rel=1e-9)
