"""Brightness profiles across edges, displacements of edges, and robust pose updates, compiled."""

from __future__ import annotations

import math

import numpy as np

from spirillum.arrays import Samples, Whole
from spirillum.kernels.compiled import compiled
from spirillum.robust import MAD_TO_SIGMA

_RUN = 6
"""Neighbouring edge points whose gradients are averaged with their sign."""


@compiled
def profiles_across(
    picture: Samples, origin: Samples, pixels: Samples, normals: Samples, offsets: Samples, out: Samples
) -> None:
    """Brightness profiles along the normals of edge points, by cubic interpolation.

    Args:
        picture: brightness of a region of the picture, (h, w).
        origin: pixel (u, v) of the region's upper left corner, (2,).
        pixels: the edge points, (n, 2).
        normals: unit directions, (n, 2).
        offsets: distances along them, pixels, (m,).
        out: the profiles, (n, m); NaN outside the region.
    """
    height, width = picture.shape
    for i in range(pixels.shape[0]):
        for k in range(offsets.size):
            u = pixels[i, 0] + offsets[k] * normals[i, 0] - origin[0]
            v = pixels[i, 1] + offsets[k] * normals[i, 1] - origin[1]
            if not (1.0 <= u < width - 2.0 and 1.0 <= v < height - 2.0):
                out[i, k] = math.nan
                continue
            col, row = int(u), int(v)
            a, b = u - col, v - row
            w_0, w_1 = ((-0.5 * a + 1.0) * a - 0.5) * a, (1.5 * a - 2.5) * a * a + 1.0
            w_2, w_3 = ((-1.5 * a + 2.0) * a + 0.5) * a, (0.5 * a - 0.5) * a * a
            total = 0.0
            for j in range(4):
                if j == 0:
                    weight = ((-0.5 * b + 1.0) * b - 0.5) * b
                elif j == 1:
                    weight = (1.5 * b - 2.5) * b * b + 1.0
                elif j == 2:
                    weight = ((-1.5 * b + 2.0) * b + 0.5) * b
                else:
                    weight = (0.5 * b - 0.5) * b * b
                line = row - 1 + j
                total += weight * (
                    w_0 * picture[line, col - 1]
                    + w_1 * picture[line, col]
                    + w_2 * picture[line, col + 1]
                    + w_3 * picture[line, col + 2]
                )
            out[i, k] = total


@compiled
def shifts_of_profiles(
    profiles: Samples, templates: Samples, slopes: Samples, shifts: Samples, strengths: Samples, residuals: Samples
) -> None:
    """Displacement d of each edge along its normal: q(s) = b + c s + a (p(s) - d p'(s)) by least squares.

    Offset b, slope c and contrast a of either sign are free at every point, so that lamp, shadows and the colour of a
    stripe do not bias the displacement.

    Args:
        profiles: brightness q, (n, m).
        templates: template p of the undisplaced edge, without mean and slope, (n, m).
        slopes: derivative p' of the template, per sample, (n, m).
        shifts: d, samples, (n,); NaN where the fit is singular.
        strengths: a, (n,).
        residuals: root mean square residual, (n,).
    """
    count, length = profiles.shape
    half = 0.5 * (length - 1)
    spread = length * (length * length - 1.0) / 12.0
    for i in range(count):
        mean, tilt, bad = 0.0, 0.0, False
        for k in range(length):
            mean += profiles[i, k]
            tilt += profiles[i, k] * (k - half)
        if math.isnan(mean):
            bad = True
        mean, tilt = mean / length, tilt / spread
        m_slope, t_slope = 0.0, 0.0
        for k in range(length):
            m_slope += slopes[i, k]
            t_slope += slopes[i, k] * (k - half)
        m_slope, t_slope = m_slope / length, t_slope / spread
        pp, ps, ss, pq, sq, qq = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for k in range(length):
            q = profiles[i, k] - mean - tilt * (k - half)
            p = templates[i, k]
            s = slopes[i, k] - m_slope - t_slope * (k - half)
            pp += p * p
            ps += p * s
            ss += s * s
            pq += p * q
            sq += s * q
            qq += q * q
        determinant = pp * ss - ps * ps
        if bad or determinant <= 1e-9 * pp * ss or pp == 0.0:
            shifts[i], strengths[i], residuals[i] = math.nan, 0.0, math.nan
            continue
        a = (pq * ss - sq * ps) / determinant
        c = (sq * pp - pq * ps) / determinant
        rest = max(qq - a * pq - c * sq, 0.0)
        strengths[i] = a
        residuals[i] = math.sqrt(rest / (length - 4.0))
        shifts[i] = -c / a if a != 0.0 else math.nan


@compiled
def _score(sums: Samples, seen: Samples, all_of: Samples, place: int) -> float:
    """Score at a place: geometric mean of the first four groups' means, plus a share of the fifth's."""
    score, used, groups = 1.0, 0.0, all_of.size
    for g in range(min(groups, 4)):
        if all_of[g] == 0.0:
            continue
        if 2.0 * seen[g, place] < all_of[g]:
            return 0.0
        score *= sums[g, place] / seen[g, place]
        used += 1.0
    if score <= 0.0 or used == 0.0:
        return 0.0
    score = math.sqrt(math.sqrt(score)) if used == 4.0 else score ** (1.0 / used)
    if groups > 4 and seen[4, place] > 0.0:
        score += 0.3 * min(sums[4, place] / seen[4, place], 2.0 * score)
    return float(score)


@compiled
def edge_scores(
    slope_u: Samples,
    slope_v: Samples,
    pixels: Samples,
    normals: Samples,
    group: Whole,
    groups: int,
    first: tuple[float, float],
    scores: Samples,
) -> None:
    """Edge scores of a shape at a grid of places in a picture.

    The score of a group of edges is its mean gradient along the normals: signed over a few neighbouring points, which
    cancels noise and clutter, then in magnitude. The total is the geometric mean of the first four groups (both ends,
    both sides), so that none can replace another, plus a share of the fifth.

    The innermost loops run down the columns of all places, so that they vectorise.

    Args:
        slope_u: brightness gradient along u, transposed, (w, h).
        slope_v: brightness gradient along v, transposed, (w, h).
        pixels: edge points of the shape, (n, 2).
        normals: their unit normals, (n, 2).
        group: index of the group of each point, (n,).
        groups: number of groups.
        first: shift of the shape to the first place, pixels.
        scores: the scores at shifts by whole columns and rows from the first place, (c, r); 0 where more than half of
            a group is outside.
    """
    width, height = slope_u.shape
    columns, rows = scores.shape
    sums, seen, all_of = np.empty((groups, rows)), np.empty((groups, rows)), np.zeros(groups)
    together, length = np.zeros(rows), 0
    for i in range(group.size):
        all_of[group[i]] += 1.0
    for c in range(columns):
        sums[:], seen[:] = 0.0, 0.0
        for i in range(group.size):
            g = group[i]
            col = c + math.floor(pixels[i, 0] + first[0] + 0.5)
            row = math.floor(pixels[i, 1] + first[1] + 0.5)
            low, high = max(0, -row), min(rows, height - row)
            if 0 <= col < width and low < high:
                n_u, n_v, start, there = normals[i, 0], normals[i, 1], np.uint64(low), np.uint64(row + low)
                for r in range(np.uint64(high - low)):
                    together[start + r] += slope_u[col, there + r] * n_u + slope_v[col, there + r] * n_v
                    seen[g, start + r] += 1.0
            length += 1
            if length == _RUN or i == group.size - 1 or group[i + 1] != g:
                for r in range(rows):
                    sums[g, r] += abs(together[r])
                    together[r] = 0.0
                length = 0
        for r in range(rows):
            scores[c, r] = _score(sums, seen, all_of, r)


@compiled
def _least_squares(shifts: Samples, slopes: Samples, weights: Samples, size: Samples, change: Samples) -> None:
    """Weighted least squares for the pose change (3,); `size` scales its three slopes for conditioning."""
    normal, right = np.zeros((3, 3)), np.zeros(3)
    for i in range(shifts.size):
        if weights[i] > 0.0:
            for a in range(3):
                share = weights[i] * slopes[i, a] / size[a]
                right[a] += share * shifts[i]
                for b in range(a + 1):
                    normal[a, b] += share * slopes[i, b] / size[b]
    _solve(normal, right)
    for a in range(3):
        change[a] = right[a] / size[a]


@compiled
def _solve(normal: Samples, right: Samples) -> None:
    """Solve a symmetric positive definite (3, 3) system in place, given the lower triangle."""
    little = 1e-9 * (normal[0, 0] + normal[1, 1] + normal[2, 2]) + 1e-300
    for a in range(3):  # Cholesky factor in the lower triangle
        for b in range(a + 1):
            value = normal[a, b] + (little if a == b else 0.0)
            for c in range(b):
                value -= normal[a, c] * normal[b, c]
            normal[a, b] = math.sqrt(max(value, 1e-300)) if a == b else value / normal[b, b]
    for a in range(3):
        for b in range(a):
            right[a] -= normal[a, b] * right[b]
        right[a] /= normal[a, a]
    for a in range(2, -1, -1):
        for b in range(a + 1, 3):
            right[a] -= normal[b, a] * right[b]
        right[a] /= normal[a, a]


@compiled
def robust_change(shifts: Samples, slopes: Samples, weights: Samples, used: Samples, change: Samples) -> float:
    """Robust least squares of a pose change, by reweighting with Tukey's biweight.

    Args:
        shifts: displacement of each edge along its normal, pixels, (n,).
        slopes: Jacobian of the displacements, (n, 3).
        weights: inverse variances, 0 for invalid edges, (n,).
        used: the final weights, 0 for outliers, (n,).
        change: the pose change, (3,).

    Returns:
        The residual scale over the expected one, at least 1/2.
    """
    count = shifts.size
    size = np.full(3, 1e-300)
    known = 0
    for i in range(count):
        used[i] = weights[i] * min(1.0, 0.5 / max(abs(shifts[i]), 1e-9))
        known += weights[i] > 0.0
        for a in range(3):
            size[a] = max(size[a], abs(slopes[i, a]))
    rest, miss = np.empty(known), np.empty(count)
    level = 1.0
    for _ in range(6):
        _least_squares(shifts, slopes, used, size, change)
        k = 0
        for i in range(count):
            if weights[i] > 0.0:
                left = shifts[i] - slopes[i, 0] * change[0] - slopes[i, 1] * change[1] - slopes[i, 2] * change[2]
                miss[i] = abs(left) * math.sqrt(weights[i])
                rest[k] = miss[i]
                k += 1
        level = max(0.5, MAD_TO_SIGMA * np.median(rest))
        for i in range(count):
            share = miss[i] / (4.685 * level) if weights[i] > 0.0 else 1.0
            used[i] = weights[i] * (1.0 - share * share) ** 2 if share < 1.0 else 0.0
    return level


@compiled
def sums_along(rows: Samples, design: Samples, middle: float, numbers: Samples, out: Samples) -> None:
    """Sums of one sample from each row, at positions linear in trial parameters; 0 beyond the rows' ends.

    Args:
        rows: samples, (n, m).
        design: Jacobian of the position in each row, samples, (n, k).
        middle: position where all parameters are zero, samples.
        numbers: the trial parameters, (q, k).
        out: the sums, (q,).
    """
    for q in range(numbers.shape[0]):
        total = 0.0
        for i in range(rows.shape[0]):
            place = middle
            for k in range(design.shape[1]):
                place += design[i, k] * numbers[q, k]
            at = round(place)
            if 0 <= at < rows.shape[1]:
                total += rows[i, at]
        out[q] = total
