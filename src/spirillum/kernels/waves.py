"""Fit of a travelling wave to a ridge in a strip of a picture, compiled.

Columns j of the strip run across the tail, rows i along it. A wire of phase phi appears as the curve

    y' = y + f z + g y z   at   xi' = xi + e z,   y = r cos(a), z = r sin(a), a = K xi + a_0 + phi,

where e, f and g are the derivatives with height z of the shift along and across, and of the magnification.
"""

from __future__ import annotations

import math

import numpy as np

from spirillum.arrays import Samples
from spirillum.kernels.compiled import compiled
from spirillum.kernels.newey_west import variance_of_sum

_STEPS = 8
"""Most Gauss-Newton steps."""


@compiled
def ridge_of(image: Samples, middle: Samples, across: Samples, contrast: Samples, inner: int, ridge: Samples) -> None:
    """Ridge filter: contrast of a line at each pixel of a strip to both of its sides.

    Args:
        image: the picture, (h, w, 3).
        middle: pixel of each row's middle, (rows, 2).
        across: step from one column to the next, pixels, (rows, 2).
        contrast: weight of each channel, (3,).
        inner: half the width of the line, columns.
        ridge: output, (rows, columns); NaN where the strip leaves the picture.
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
            p, q = np.uint64(v), np.uint64(u)
            r, s = p + np.uint64(1), q + np.uint64(1)
            a, b = v - p, u - q
            one, two = (1.0 - a) * (1.0 - b), (1.0 - a) * b
            three, four = a * (1.0 - b), a * b
            line[j] = (
                c_r * (one * image[p, q, 0] + two * image[p, s, 0] + three * image[r, q, 0] + four * image[r, s, 0])
                + c_g * (one * image[p, q, 1] + two * image[p, s, 1] + three * image[r, q, 1] + four * image[r, s, 1])
                + c_b * (one * image[p, q, 2] + two * image[p, s, 2] + three * image[r, q, 2] + four * image[r, s, 2])
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
            # The weaker of both steps, so that a single edge gives no ridge.
            before = centre - (sums[low] - sums[left]) / (low - left) if low > left else math.inf
            after = centre - (sums[right] - sums[high]) / (right - high) if right > high else math.inf
            step = min(before, after)
            ridge[i, j] = step if step < math.inf else 0.0


@compiled
def _radius(at: float, decay: float, amplitude: float) -> float:
    """Distance of the tapered wire from the axis, m."""
    return amplitude * (1.0 - math.exp(-decay * max(at, 0.0)))


@compiled
def _crossing(
    xi: float,
    phase: float,
    first: tuple[float, float],
    wave: Samples,
    decay: float,
    tilt: tuple[float, float, float],
    hand: float,
) -> tuple[float, float, float]:
    """Lateral position of the wire in a row, r cos(a) there, and the derivative of the position by the phase.

    `first` are r cos(a) and r sin(a) at xi; `hand` = -1 mirrors the heights.
    """
    e, f, g = tilt
    at, at_turn = xi - e * hand * first[1], -e * hand * first[0]  # with its derivative by the phase
    a, a_turn = wave[0] * at + wave[1] + phase, 1.0 + wave[0] * at_turn
    r = _radius(at, decay, wave[3])
    r_turn = (wave[3] - r) * decay * at_turn if at > 0.0 else 0.0
    cos, sin = math.cos(a), math.sin(a)
    y, z = r * cos, hand * r * sin
    y_turn, z_turn = r_turn * cos - r * sin * a_turn, hand * (r_turn * sin + r * cos * a_turn)
    return y + f * z + g * y * z, y, y_turn + f * z_turn + g * (y_turn * z + y * z_turn)


@compiled
def wave_scores(
    ridge: Samples, xi: Samples, tilt: Samples, wave: Samples, step: float, every: int, scores: Samples
) -> None:
    """Mean ridge along the wire at evenly spaced phases; NaN with fewer than a third of the rows in the picture.

    Args:
        ridge: the strip, (rows, columns).
        xi: distance from the root of each row, m, (rows,).
        tilt: e, f and g of each row, (rows, 3).
        wave: K, a_0, c/L_t (0 or less: no taper), amplitude.
        step: width of a column, m.
        every: stride of the rows.
        scores: output, one for each phase.
    """
    rows, columns = ridge.shape
    half, count = 0.5 * (columns - 1), 0
    decay = wave[2] if wave[2] > 0.0 else 1e12
    turns = np.empty((len(scores), 2))
    for n in range(len(scores)):
        phase = 2.0 * math.pi * n / len(scores)
        turns[n, 0], turns[n, 1], scores[n] = math.cos(phase), math.sin(phase), 0.0
    for i in range(0, rows, every):
        if math.isnan(ridge[i, 0]):
            continue
        count += 1
        r, a = _radius(xi[i], decay, wave[3]), wave[0] * xi[i] + wave[1]
        cos, sin = r * math.cos(a), r * math.sin(a)
        tilted = tilt[i, 0], tilt[i, 1], tilt[i, 2]
        for n in range(len(scores)):
            first = cos * turns[n, 0] - sin * turns[n, 1], sin * turns[n, 0] + cos * turns[n, 1]
            y, _, _ = _crossing(xi[i], 2.0 * math.pi * n / len(scores), first, wave, decay, tilted, 1.0)
            place = y / step + half
            j = math.floor(place)
            if 0 <= j < columns - 1:
                b = place - j
                scores[n] += (1.0 - b) * ridge[i, j] + b * ridge[i, j + 1]
    for n in range(len(scores)):
        scores[n] = scores[n] / count if 3 * count * every >= rows else math.nan


@compiled
def _residuals(
    ridge: Samples,
    xi: Samples,
    tilt: Samples,
    wave: Samples,
    settings: tuple[float, float, float, float],
    aside: Samples,
    fit: Samples,
) -> None:
    """Lateral distance of the ridge from the curve in each row.

    Args:
        ridge: the strip, (rows, columns).
        xi: distance from the root of each row, m, (rows,).
        tilt: e, f and g of each row, (rows, 3).
        wave: K, a_0, c/L_t (0 or less: no taper), amplitude.
        settings: phase, rad; width of a column, m; half width of the search window, m; typical ridge on the wire.
        aside: lateral offset of the curve in each row, m, (rows,).
        fit: output, (rows, 6): residual, its weight (NaN outside the picture), derivative of the curve by the phase,
            r cos(a), half the distance to the curve of opposite handedness, ridge on the curve.
    """
    rows, columns = ridge.shape
    half = 0.5 * (columns - 1)
    decay = wave[2] if wave[2] > 0.0 else 1e12
    phase, step, window, usual = settings
    for i in range(rows):
        if math.isnan(ridge[i, 0]):
            for k in range(6):
                fit[i, k] = 0.0
            fit[i, 1] = math.nan
            continue
        r, a = _radius(xi[i], decay, wave[3]), wave[0] * xi[i] + wave[1] + phase
        first, tilted = (r * math.cos(a), r * math.sin(a)), (tilt[i, 0], tilt[i, 1], tilt[i, 2])
        base, fit[i, 3], fit[i, 2] = _crossing(xi[i], phase, first, wave, decay, tilted, 1.0)
        mirrored, _, _ = _crossing(xi[i], phase, first, wave, decay, tilted, -1.0)
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


@compiled
def _inverse(matrix: Samples, out: Samples) -> None:
    """Inverse of a symmetric (3, 3) matrix by cofactors."""
    for a in range(3):
        b, c = (a + 1) % 3, (a + 2) % 3
        for d in range(3):
            e, f = (d + 1) % 3, (d + 2) % 3
            out[d, a] = matrix[b, e] * matrix[c, f] - matrix[b, f] * matrix[c, e]
    determinant = matrix[0, 0] * out[0, 0] + matrix[0, 1] * out[1, 0] + matrix[0, 2] * out[2, 0]
    for a in range(3):
        for d in range(3):
            out[a, d] /= determinant


@compiled
def _row_times(matrix: Samples, row: int, vector: Samples) -> float:
    """One component of the product of a (3, 3) matrix and a vector."""
    return float(matrix[row, 0] * vector[0] + matrix[row, 1] * vector[1] + matrix[row, 2] * vector[2])


@compiled
def _normal(basis: Samples, weight: Samples, wanted: Samples, normal: Samples, right: Samples) -> None:
    """Normal equations of weighted least squares with three unknowns."""
    normal[:], right[:] = 0.0, 0.0
    for i in range(weight.size):
        for a in range(3):
            share = weight[i] * basis[i, a]
            right[a] += share * wanted[i]
            for b in range(3):
                normal[a, b] += share * basis[i, b]


@compiled
def _weights(fit: Samples, scale: float, width: float, weight: Samples) -> tuple[float, float, int]:
    """Biweight weights of the residuals; returns their sum, the mean absolute residual, and the rows in view."""
    total, spread, inside = 0.0, 0.0, 0
    for i in range(weight.size):
        if math.isnan(fit[i, 1]):
            weight[i] = 0.0
            continue
        far = abs(fit[i, 0])
        share = min(far / (3.0 * scale), 1.0)
        weight[i] = fit[i, 1] * (1.0 - share * share) ** 2
        total += weight[i]
        spread += weight[i] * min(far, width)
        inside += 1
    return total, spread / max(total, 1e-300), inside


@compiled
def wave_fit(
    ridge: Samples,
    xi: Samples,
    tilt: Samples,
    wave: Samples,
    settings: tuple[float, float, float, float, float, float],
    answer: Samples,
) -> None:
    """Robust Gauss-Newton fit of phase, lateral offset and tilt of a wire, from a phase nearby.

    Args:
        ridge: the strip, (rows, columns).
        xi: distance from the root of each row, m, (rows,).
        tilt: e, f and g of each row, (rows, 3).
        wave: K, a_0, c/L_t (0 or less: no taper), amplitude.
        settings: phase, rad; width of a column, m; width of the wire, m; typical ridge on the wire; prior standard
            deviations of the offset and of the difference of offsets from end to end, m.
        answer: output, (10,): phase, its standard error, inlier share of the rows, offset, tilt, numerator and
            denominator of the handedness (0 as assumed, -2 opposite) and of the relative error of the amplitude, mean
            ridge; unchanged where too little is in view.
    """
    phase, step, width, usual, likely_offset, likely_lean = settings
    rows, length = xi.size, xi[-1] - xi[0]
    fit, aside, weight = np.zeros((rows, 6)), np.zeros(rows), np.zeros(rows)
    basis, normal, inverse, right = np.ones((rows, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    middle = xi.mean()
    for i in range(rows):
        basis[i, 2] = (xi[i] - middle) / length
    offset, lean, scale, total, inside = 0.0, 0.0, width, 0.0, 0
    for repeat in range(_STEPS):
        for i in range(rows):
            aside[i] = offset + basis[i, 2] * lean
        window = (2.0 if repeat < 2 else 1.25) * width
        _residuals(ridge, xi, tilt, wave, (phase, step, window, usual), aside, fit)
        total, spread, inside = _weights(fit, scale, width, weight)
        if total < 1e-6 or 3 * inside < rows:
            return
        scale = max(1.5 * spread, 0.15 * width)
        noise = max(1.25 * spread, 0.03 * width) ** 2
        for i in range(rows):
            basis[i, 0] = fit[i, 2]
        _normal(basis, weight, fit[:, 0], normal, right)
        prior_offset, prior_lean = noise / likely_offset**2, noise / likely_lean**2  # Gaussian priors at zero
        normal[0, 0] += 1e-300
        normal[1, 1] += prior_offset
        normal[2, 2] += prior_lean
        right[1] -= prior_offset * offset
        right[2] -= prior_lean * lean
        _inverse(normal, inverse)
        change = _row_times(inverse, 0, right)
        phase += 1.2 * min(max(change, -0.5), 0.5)
        offset += _row_times(inverse, 1, right)
        lean += _row_times(inverse, 2, right)
        if repeat > 2 and abs(change) < 2e-4:
            break
    answer[0], answer[3], answer[4] = phase, offset, lean / length
    _assess(xi, width, total, inside, fit, weight, basis, normal, inverse, answer)


@compiled
def _assess(
    xi: Samples,
    width: float,
    total: float,
    inside: int,
    fit: Samples,
    weight: Samples,
    basis: Samples,
    normal: Samples,
    inverse: Samples,
    answer: Samples,
) -> None:
    """Standard error, inlier share, handedness and amplitude error of a converged `wave_fit`."""
    rows = xi.size
    close, square, mean = 0.0, 0.0, 0.0
    scores = np.empty(rows)
    for i in range(rows):
        scores[i] = weight[i] * fit[i, 0]
        scores[i] *= basis[i, 0] * inverse[0, 0] + basis[i, 1] * inverse[0, 1] + basis[i, 2] * inverse[0, 2]
        square += weight[i] * fit[i, 0] ** 2
        if not math.isnan(fit[i, 1]):
            close += weight[i] > 0.15 and abs(fit[i, 0]) < 0.5 * width
            mean += fit[i, 5]
    # Errors of neighbouring rows are correlated.
    reach = max(4, int(3.0 * width / (xi[1] - xi[0])))
    plain = square / total * inverse[0, 0] * max(1.0, 0.5 * reach)
    answer[1] = math.sqrt(max(plain, variance_of_sum(scores, reach)))
    answer[2], answer[9] = close / inside, mean / inside
    # The effect of opposite handedness, orthogonal to those of phase, offset and tilt.
    gram, right, other = np.empty((3, 3)), np.empty(3), np.empty((3, 3))
    _normal(basis, weight, fit[:, 4], gram, right)
    for a in range(3):
        gram[a, a] += 1e-12 * normal[a, a]
    _inverse(gram, other)
    for k in range(5, 9):
        answer[k] = 0.0
    for i in range(rows):
        residual = fit[i, 4]
        for a in range(3):
            residual -= basis[i, a] * _row_times(other, a, right)
        answer[5] += weight[i] * residual * fit[i, 0]
        answer[6] += weight[i] * residual * residual
        answer[7] += weight[i] * fit[i, 3] * fit[i, 0]
        answer[8] += weight[i] * fit[i, 3] ** 2
