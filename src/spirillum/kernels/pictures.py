"""Sampling of a picture between its pixels, and a fit of stripes on a cylinder, compiled."""

from __future__ import annotations

import math

import numpy as np

from spirillum.arrays import Samples, Whole
from spirillum.kernels.compiled import compiled
from spirillum.kernels.newey_west import variance_of_sum

_CHANNELS = 3
_STEPS, _LAST = 8, 2e-5
"""Most Gauss-Newton steps, and the step below which they end, rad."""
_AHEAD = 0.008
"""Step of the central differences in the angle, rad."""
_OBLIQUE = 0.15
"""Scale over the largest one below which the surface is too oblique to be used."""
_VISIBLE = 0.3
"""Least visible share of the surface."""
_CORRELATED = 6
"""Largest lag, in angles, at which residuals are taken as correlated."""


@compiled
def sampled(image: Samples, pixels: Samples, out: Samples) -> None:
    """Colours (k, 3) of a picture (h, w, 3) at pixels (k, 2), by bilinear interpolation; NaN outside."""
    height, width = image.shape[0], image.shape[1]
    for k in range(len(pixels)):
        u, v = pixels[k, 0], pixels[k, 1]
        if not (0.0 <= u <= width - 1.0 and 0.0 <= v <= height - 1.0):
            out[k, 0] = out[k, 1] = out[k, 2] = math.nan
            continue
        i, j = min(int(v), height - 2), min(int(u), width - 2)
        a, b = v - i, u - j
        for c in range(_CHANNELS):
            upper = image[i, j, c] * (1.0 - b) + image[i, j + 1, c] * b
            lower = image[i + 1, j, c] * (1.0 - b) + image[i + 1, j + 1, c] * b
            out[k, c] = upper * (1.0 - a) + lower * a


@compiled
def profile_of_rows(image: Samples, first: Samples, last: Samples, rows: int, out: Samples) -> None:
    """Interquartile mean of the colours on lines between pixels, which rejects highlights and bubbles.

    Args:
        image: the picture, (h, w, 3).
        first: start of each line, pixels, (n, 2).
        last: end of each line, pixels, (n, 2).
        rows: number of samples on a line.
        out: the colours, (n, 3); NaN where fewer than half of the samples lie in the picture.
    """
    pixels, colours, line = np.empty((rows, 2)), np.empty((rows, _CHANNELS)), np.empty(rows)
    for n in range(len(first)):
        for m in range(rows):
            share = (m + 0.5) / rows
            pixels[m, 0] = first[n, 0] + share * (last[n, 0] - first[n, 0])
            pixels[m, 1] = first[n, 1] + share * (last[n, 1] - first[n, 1])
        sampled(image, pixels, colours)
        for c in range(_CHANNELS):
            seen = 0
            for m in range(rows):  # insertion sort of the samples inside the picture
                value = colours[m, c]
                if math.isnan(value):
                    continue
                k = seen
                while k > 0 and line[k - 1] > value:
                    line[k] = line[k - 1]
                    k -= 1
                line[k] = value
                seen += 1
            if 2 * seen < rows:
                out[n, c] = math.nan
                continue
            low, high = seen // 4, seen - seen // 4
            total = 0.0
            for m in range(low, high):
                total += line[m]
            out[n, c] = total / (high - low)


@compiled
def stripes_at(angles: Samples, blur: Samples, roll: float, order: Whole, palette: Samples, out: Samples) -> None:
    """Colours of blurred stripes at angles about the axis, for the body's rotation angle `roll`.

    Args:
        angles: angles about the axis, rad, (n,).
        blur: standard deviation of the blur at each angle, rad, (n,).
        roll: angle of the first stripe's middle, rad.
        order: class of each stripe, (s,).
        palette: colour of each class, (classes, 3).
        out: the colours, (n, 3).
    """
    stripes = len(order)
    width = 2.0 * math.pi / stripes
    for n in range(len(angles)):
        place = (angles[n] - roll) / width + 0.5
        whole = math.floor(place)
        k = int(whole) % stripes
        inside = (place - whole) * width  # rad behind the edge before
        scale = 1.0 / (math.sqrt(2.0) * blur[n])
        before, after = 1.0, 0.0
        if inside * scale < 3.0:
            before = 0.5 * (1.0 + math.erf(inside * scale))
        if (inside - width) * scale > -3.0:
            after = 0.5 * (1.0 + math.erf((inside - width) * scale))
        one, two, three = order[(k - 1) % stripes], order[k], order[(k + 1) % stripes]
        for c in range(_CHANNELS):
            out[n, c] = (
                palette[one, c] * (1.0 - before) + palette[two, c] * (before - after) + palette[three, c] * after
            )


@compiled
def edge_misfits(
    levels: Samples,
    angles: Samples,
    blur: Samples,
    shade: Samples,
    before: Samples,
    after: Samples,
    shifts: Samples,
    out: Samples,
) -> None:
    """Sums of squared residuals of colours about one blurred edge between stripes, for several places of the edge.

    Args:
        levels: observed colours, (n, 3).
        angles: where, rad, (n,).
        blur: standard deviation of the blur there, rad, (n,).
        shade: shading factor and additive sheen there, in each channel, (n, 6).
        before: colour of the stripe at smaller angles, (3,).
        after: colour of the stripe at larger angles, (3,).
        shifts: angles of the edge, rad, (k,).
        out: the sums, (k,).
    """
    for k in range(shifts.size):
        out[k] = 0.0
        for n in range(angles.size):
            share = 0.5 * (1.0 + math.erf((angles[n] - shifts[k]) / (blur[n] * math.sqrt(2.0))))
            for c in range(_CHANNELS):
                colour = before[c] + (after[c] - before[c]) * share
                residual = levels[n, c] - shade[n, c + _CHANNELS] - shade[n, c] * colour
                out[k] += residual * residual


@compiled
def _gains(profile: Samples, weight: Samples, shade: Samples, model: Samples, tint: float, out: Samples) -> None:
    """Gain of each channel by least squares, with a prior of strength `tint` at their common gain."""
    top, bottom = np.zeros(_CHANNELS), np.zeros(_CHANNELS)
    for n in range(len(profile)):
        for c in range(_CHANNELS):
            m = shade[n, c] * model[n, c] + shade[n, 3 + c]
            top[c] += weight[n] * m * profile[n, c]
            bottom[c] += weight[n] * m * m
    common = (top[0] + top[1] + top[2]) / (bottom[0] + bottom[1] + bottom[2] + 1e-12)
    for c in range(_CHANNELS):
        out[c] = (top[c] + tint * bottom[c] * common) / ((1.0 + tint) * bottom[c] + 1e-12)


@compiled
def _reweighted(
    profile: Samples, base: Samples, shade: Samples, model: Samples, gain: Samples, scale: float, weight: Samples
) -> float:
    """Biweight weights of the residuals, and the mean loss relative to its largest value."""
    loss, total = 0.0, 0.0
    for n in range(len(profile)):
        square = 0.0
        for c in range(_CHANNELS):
            square += (profile[n, c] - gain[c] * (shade[n, c] * model[n, c] + shade[n, 3 + c])) ** 2
        ratio = min(square / (scale * scale), 1.0)
        weight[n] = base[n] * (1.0 - ratio) ** 2
        loss += base[n] * (1.0 - (1.0 - ratio) ** 3)
        total += base[n]
    return loss / (total + 1e-12)


@compiled
def _even_loss(profile: Samples, base: Samples, shade: Samples, palette: Samples, cut: float) -> float:
    """Loss of a uniform colour; arguments as in `stripe_fit`."""
    even, weight, gain, loss = np.zeros((len(base), 3)), np.empty(len(base)), np.empty(3), 1.0
    for n in range(len(base)):
        weight[n] = base[n]
        for c in range(_CHANNELS):
            for k in range(len(palette)):
                even[n, c] += palette[k, c] / len(palette)
    for _ in range(3):
        _gains(profile, weight, shade, even, 0.0, gain)
        loss = _reweighted(profile, base, shade, even, gain, cut, weight)
    return loss


@compiled
def _error(base: Samples, weight: Samples, slope: Samples, residual: Samples, usual: float) -> float:
    """Standard error of the angle, with autocorrelated residuals, as neighbouring angles share pixels."""
    count = len(base)
    information, variance, total, most = 0.0, 0.0, 0.0, 0.0
    scores = np.zeros(count)
    for n in range(count):
        total += weight[n]
        most = max(most, base[n])
        for c in range(_CHANNELS):
            information += weight[n] * slope[n, c] ** 2
            scores[n] += weight[n] * slope[n, c] * residual[n, c]
            variance += weight[n] * residual[n, c] ** 2 / _CHANNELS
    if information < 1e-6:
        return math.nan  # the colours do not depend on the angle
    variance = max(variance / (total + 1e-12), usual**2)
    plain = _CHANNELS * variance * most / information
    return math.sqrt(max(plain, variance_of_sum(scores, _CORRELATED) / information**2))


@compiled
def _visible(profile: Samples, scale: Samples, trust: Samples, clean: Samples, base: Samples) -> bool:
    """Colours with 0 where invisible, and the weight of each angle; returns whether enough is visible."""
    most, seen, all_of = scale.max(), 0.0, 0.0
    for n in range(len(scale)):
        good = scale[n] > _OBLIQUE * most
        for c in range(_CHANNELS):
            good = good and math.isfinite(profile[n, c])
        for c in range(_CHANNELS):
            clean[n, c] = profile[n, c] if good else 0.0
        base[n] = trust[n] * scale[n] / most if good else 0.0
        all_of += scale[n] / most
        seen += scale[n] / most if good else 0.0
    return seen >= _VISIBLE * all_of


@compiled
def _grid_search(
    clean: Samples,
    base: Samples,
    angles: Samples,
    blur: Samples,
    shade: Samples,
    order: Whole,
    palette: Samples,
    settings: tuple[float, float, float, float, float],
    losses: Samples,
) -> int:
    """Losses on a grid of rotation angles, and the index of the least; arguments as in `stripe_fit`.

    Only every other sample of the profile is used.
    """
    period, tint, cut, _, _ = settings
    count = (len(angles) + 1) // 2
    some_angles, some_blur, some_base = np.empty(count), np.empty(count), np.empty(count)
    some_colours, some_shade = np.empty((count, 3)), np.empty((count, 6))
    for n in range(count):
        some_angles[n], some_blur[n], some_base[n] = angles[2 * n], blur[2 * n], base[2 * n]
        for c in range(_CHANNELS):
            some_colours[n, c] = clean[2 * n, c]
            some_shade[n, c], some_shade[n, 3 + c] = shade[2 * n, c], shade[2 * n, 3 + c]
    model, weight, gain = np.empty((count, 3)), np.empty(count), np.empty(3)
    best = 0
    for trial in range(len(losses)):
        stripes_at(some_angles, some_blur, trial * period / len(losses), order, palette, model)
        for n in range(count):
            weight[n] = some_base[n]
        for _ in range(2):
            _gains(some_colours, weight, some_shade, model, tint, gain)
            losses[trial] = _reweighted(some_colours, some_base, some_shade, model, gain, cut, weight)
        best = trial if losses[trial] < losses[best] else best
    return best


@compiled
def _slopes(
    clean: Samples,
    ahead: Samples,
    behind: Samples,
    model: Samples,
    shade: Samples,
    weight: Samples,
    gain: Samples,
    slope: Samples,
    residual: Samples,
) -> float:
    """Derivatives of the colours by the angle and residuals, (n, 3); returns the Gauss-Newton step."""
    top, bottom = 0.0, 1e-300
    for n in range(len(weight)):
        for c in range(_CHANNELS):
            slope[n, c] = gain[c] * shade[n, c] * (ahead[n, c] - behind[n, c]) / (2.0 * _AHEAD)
            residual[n, c] = clean[n, c] - gain[c] * (shade[n, c] * model[n, c] + shade[n, 3 + c])
            top += weight[n] * slope[n, c] * residual[n, c]
            bottom += weight[n] * slope[n, c] ** 2
    return top / bottom


@compiled
def stripe_fit(
    profile: Samples,
    scale: Samples,
    trust: Samples,
    angles: Samples,
    shade: Samples,
    order: Whole,
    palette: Samples,
    settings: tuple[float, float, float, float, float],
    losses: Samples,
    answer: Samples,
) -> None:
    """Fit the rotation angle of stripes to a colour profile: grid search, then robust Gauss-Newton steps.

    Args:
        profile: colours along the angle, (n, 3); NaN where invisible.
        scale: pixels per radian at each angle, (n,).
        trust: weight of each angle, beside that of its scale, (n,).
        angles: angles about the axis, rad, (n,).
        shade: shading factor and additive sheen at each angle, in each channel, (n, 6).
        order: class of each stripe, (s,).
        palette: colour of each class, (classes, 3).
        settings: period, rad; strength of the prior on the channels' common gain; residual beyond which a sample is an
            outlier; least expected residual; standard deviation of the blur, pixels.
        losses: output, loss at each angle of the grid, 0 to 1, (t,).
        answer: output, (8,): angle, its standard error, loss, least loss at a distant angle, loss of a uniform colour,
            gains of the channels; unchanged where too little is visible.
    """
    period, tint, cut, usual, blurred = settings
    count, tries = len(angles), len(losses)
    clean, base, blur = np.empty((count, 3)), np.empty(count), np.empty(count)
    if not _visible(profile, scale, trust, clean, base):
        return
    for n in range(count):
        blur[n] = min(max(blurred / max(scale[n], 1e-9), 0.004), 0.5)
    first = _grid_search(clean, base, angles, blur, shade, order, palette, settings, losses)
    model, ahead, behind = np.empty((count, 3)), np.empty((count, 3)), np.empty((count, 3))
    slope, residual, weight, gain = np.empty((count, 3)), np.empty((count, 3)), base.copy(), np.empty(3)
    roll, loss = first * period / tries, 1.0
    for repeat in range(1 + _STEPS):
        stripes_at(angles, blur, roll, order, palette, model)
        _gains(clean, weight, shade, model, tint, gain)
        loss = _reweighted(clean, base, shade, model, gain, cut, weight)
        if repeat == 0:
            continue  # the first pass only sets the weights
        stripes_at(angles, blur, roll + _AHEAD, order, palette, ahead)
        stripes_at(angles, blur, roll - _AHEAD, order, palette, behind)
        change = _slopes(clean, ahead, behind, model, shade, weight, gain, slope, residual)
        roll += min(max(change, -0.1), 0.1)
        if abs(change) < _LAST:
            break
    other, away = math.inf, max(1, int(tries * 0.35 * 2.0 * math.pi / len(order) / period))
    for trial in range(tries):
        if abs((trial - first + tries // 2) % tries - tries // 2) > away:
            other = min(other, losses[trial])
    answer[0], answer[1], answer[2], answer[3] = (
        roll % period,
        _error(base, weight, slope, residual, usual),
        loss,
        other,
    )
    answer[4] = _even_loss(clean, base, shade, palette, cut)
    for c in range(_CHANNELS):
        answer[5 + c] = gain[c]
