"""A travelling wave fitted to a bright ridge in a strip of a picture, compiled.

The strip's columns j lie across, its rows i along the tail. In it a wire of phase phi is the curve

    y' = y + f z + g y z   at   xi' = xi + e z,   y = r cos(a), z = r sin(a), a = K xi + a_0 + phi,

where e, f and g say how the picture moves and grows with the height z.
"""

from __future__ import annotations

import math

import numpy as np

from spirillum.arrays import Samples
from spirillum.kernels.compiled import compiled

__all__ = ["ridge_of", "wave_scores", "wave_step"]


@compiled
def ridge_of(image: Samples, middle: Samples, across: Samples, contrast: Samples, inner: int, ridge: Samples) -> None:
    """How much a line along each place of a strip differs from both of its sides, (rows, columns).

    Args:
        image: the picture, (h, w, 3).
        middle: pixel of each row's middle, (rows, 2).
        across: step from a column to the next, pixels, (rows, 2).
        contrast: weight of each channel, (3,).
        inner: half the width of the line, columns.
        ridge: the answer; NaN where the strip leaves the picture.
    """
    height, width = image.shape[0], image.shape[1]
    rows, columns = ridge.shape
    half = 0.5 * (columns - 1)
    line, sums = np.empty(columns), np.empty(columns + 1)
    c_r, c_g, c_b = contrast[0], contrast[1], contrast[2]
    for i in range(rows):
        whole = True
        for j in range(columns):
            u = middle[i, 0] + (j - half) * across[i, 0]
            v = middle[i, 1] + (j - half) * across[i, 1]
            if not (0.0 <= u < width - 1.0 and 0.0 <= v < height - 1.0):
                whole = False
                break
            p, q = int(v), int(u)
            a, b = v - p, u - q
            one, two = (1.0 - a) * (1.0 - b), (1.0 - a) * b
            three, four = a * (1.0 - b), a * b
            line[j] = (
                c_r * (one * image[p, q, 0] + two * image[p, q + 1, 0] + three * image[p + 1, q, 0])
                + c_g * (one * image[p, q, 1] + two * image[p, q + 1, 1] + three * image[p + 1, q, 1])
                + c_b * (one * image[p, q, 2] + two * image[p, q + 1, 2] + three * image[p + 1, q, 2])
                + four * (c_r * image[p + 1, q + 1, 0] + c_g * image[p + 1, q + 1, 1] + c_b * image[p + 1, q + 1, 2])
            )
        if not whole:
            ridge[i, :] = math.nan
            continue
        sums[0] = 0.0
        for j in range(columns):
            sums[j + 1] = sums[j] + line[j]
        side = 2 * inner + 1
        for j in range(columns):
            low, high = max(0, j - inner), min(columns, j + inner + 1)
            centre = (sums[high] - sums[low]) / (high - low)
            left, right = max(0, low - side), min(columns, high + side)
            # The weaker of both steps: an edge of something else is not a line.
            before = centre - (sums[low] - sums[left]) / (low - left) if low > left else math.inf
            after = centre - (sums[right] - sums[high]) / (right - high) if right > high else math.inf
            step = min(before, after)
            ridge[i, j] = step if step < math.inf else 0.0


@compiled
def _place(
    xi: float, phase: float, wave: Samples, decay: float, amplitude: float, e: float, f: float, g: float, hand: float
) -> tuple[float, float]:
    """Where the wire crosses a row, and r cos(a) there; `hand` -1 mirrors the heights."""
    at = xi
    y = z = 0.0
    for _ in range(2):
        s = max(at, 0.0)
        r = amplitude * (1.0 - math.exp(-decay * s))
        a = wave[0] * at + wave[1] + phase
        y, z = r * math.cos(a), hand * r * math.sin(a)
        if e == 0.0:
            break
        at = xi - e * z
    return y + f * z + g * y * z, y


@compiled
def wave_scores(
    ridge: Samples, xi: Samples, tilt: Samples, wave: Samples, step: float, every: int, scores: Samples
) -> None:
    """Mean ridge along the wire at evenly spaced phases; NaN where fewer than a third of the rows are in the picture.

    Args:
        ridge: the strip, (rows, columns).
        xi: distance from the root of each row, m, (rows,).
        tilt: e, f and g of each row, (rows, 3).
        wave: K, a_0, c/L_t (0 or less: no taper), amplitude.
        step: width of a column, m.
        every: only each such row.
        scores: the answer, one for each phase.
    """
    rows, columns = ridge.shape
    half = 0.5 * (columns - 1)
    decay = wave[2] if wave[2] > 0.0 else 1e12
    for n in range(len(scores)):
        phase = 2.0 * math.pi * n / len(scores)
        total, count = 0.0, 0
        for i in range(0, rows, every):
            if math.isnan(ridge[i, 0]):
                continue
            y, _ = _place(xi[i], phase, wave, decay, wave[3], tilt[i, 0], tilt[i, 1], tilt[i, 2], 1.0)
            place = y / step + half
            j = math.floor(place)
            if 0 <= j < columns - 1:
                b = place - j
                total += (1.0 - b) * ridge[i, j] + b * ridge[i, j + 1]
            count += 1
        scores[n] = total / count if 3 * count * every >= rows else math.nan


@compiled
def wave_step(
    ridge: Samples, xi: Samples, tilt: Samples, wave: Samples, settings: Samples, aside: Samples, fit: Samples
) -> None:
    """Where the ridge lies in each row beside the curve.

    Args:
        ridge: the strip, (rows, columns).
        xi: distance from the root of each row, m, (rows,).
        tilt: e, f and g of each row, (rows, 3).
        wave: K, a_0, c/L_t (0 or less: no taper), amplitude.
        settings: phase, rad; width of a column, m; half width in which the ridge is looked for, m; typical ridge on the
            wire.
        aside: sideways offset of the curve in each row, m, (rows,).
        fit: the answer: what is left beside the curve, its weight, change of the curve with the phase, r cos(a), half
            the distance to the curve of the other hand, the ridge on the curve; weight NaN outside the picture,
            (rows, 6).
    """
    rows, columns = ridge.shape
    half = 0.5 * (columns - 1)
    decay = wave[2] if wave[2] > 0.0 else 1e12
    phase, step, window, usual = settings[0], settings[1], settings[2], settings[3]
    turn = 1e-3
    for i in range(rows):
        if math.isnan(ridge[i, 0]):
            fit[i, :] = 0.0
            fit[i, 1] = math.nan
            continue
        e, f, g = tilt[i, 0], tilt[i, 1], tilt[i, 2]
        base, fit[i, 3] = _place(xi[i], phase, wave, decay, wave[3], e, f, g, 1.0)
        ahead, _ = _place(xi[i], phase + turn, wave, decay, wave[3], e, f, g, 1.0)
        mirrored, _ = _place(xi[i], phase, wave, decay, wave[3], e, f, g, -1.0)
        fit[i, 2] = (ahead - base) / turn
        fit[i, 4] = 0.5 * (base - mirrored)
        curve = base + aside[i]
        low = max(0, math.ceil((curve - window) / step + half))
        high = min(columns - 1, math.floor((curve + window) / step + half))
        top, bottom = 0.0, 0.0
        for j in range(low, high + 1):
            away = (j - half) * step - curve
            value = max(ridge[i, j], 0.0) ** 2 * (1.0 - (away / window) ** 2)
            top += value * away
            bottom += value
        j = math.floor(curve / step + half + 0.5)
        fit[i, 5] = ridge[i, j] if 0 <= j < columns else 0.0
        fit[i, 0] = top / bottom if bottom > 0.0 else 0.0
        strength = bottom / (high - low + 1.0) if high >= low else 0.0
        fit[i, 1] = min(1.0, strength / usual**2) if usual > 0.0 else min(1.0, strength)
