"""Colours of a picture between its pixels, and stripes on a cylinder compared with them, compiled."""

from __future__ import annotations

import math

import numpy as np

from spirillum.arrays import Samples
from spirillum.kernels.compiled import compiled

__all__ = ["even_loss", "profile_of_rows", "sampled", "stripe_losses", "stripe_step", "stripes_at"]

_CHANNELS = 3

Whole = np.ndarray[tuple[int, ...], np.dtype[np.int64]]
"""Whole numbers, as classes of colours."""


@compiled
def sampled(image: Samples, pixels: Samples, out: Samples) -> None:
    """Colours (k, 3) of a picture (h, w, 3) at pixels (k, 2), linear between their centres; NaN outside."""
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
    """Mean of the middle half of the colours on lines between pixels first (n, 2) and last (n, 2), (n, 3).

    Bright spots and bubbles on less than a quarter of a line leave no trace.

    Args:
        image: the picture, (h, w, 3).
        first: where the lines begin, (n, 2).
        last: where they end, (n, 2).
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
            for m in range(rows):  # sorted by insertion, without what lies outside
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
    """Colours (n, 3) of blurred stripes at angles about the axis, when the body has turned by `roll`.

    Args:
        angles: where, rad, (n,).
        blur: standard deviation of the blur there, rad, (n,).
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
def _gains(profile: Samples, weight: Samples, shade: Samples, model: Samples, tint: float, out: Samples) -> None:
    """Brightness of each channel against the model; the channels hold together with the strength `tint`."""
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
    """Weights that leave out what the model cannot explain; the share of the loss (biweight) that remains."""
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
def stripe_losses(
    profile: Samples,
    base: Samples,
    angles: Samples,
    blur: Samples,
    shade: Samples,
    order: Whole,
    palette: Samples,
    settings: Samples,
    losses: Samples,
) -> None:
    """How badly stripes fit when turned by evenly spaced angles of a period.

    Args:
        profile: colours along the angle, (n, 3).
        base: weight of each angle, (n,).
        angles: rad, (n,).
        blur: standard deviation of the blur, rad, (n,).
        shade: brightness of the same colour at each angle, and what shines there whatever the colour, (n, 6).
        order: class of each stripe, (s,).
        palette: colour of each class, (classes, 3).
        settings: period, rad; strength that holds the channels together; residual at which a sample no longer counts.
        losses: the answer, one for each angle, 0 to 1.
    """
    model, weight, gain = np.empty((len(angles), 3)), np.empty(len(angles)), np.empty(3)
    for trial in range(len(losses)):
        stripes_at(angles, blur, trial * settings[0] / len(losses), order, palette, model)
        for n in range(len(base)):
            weight[n] = base[n]
        for _ in range(2):
            _gains(profile, weight, shade, model, settings[1], gain)
            losses[trial] = _reweighted(profile, base, shade, model, gain, settings[2], weight)


@compiled
def even_loss(profile: Samples, base: Samples, shade: Samples, palette: Samples, cut: float) -> float:
    """How badly one even colour fits; arguments as in `stripe_losses`."""
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
def stripe_step(
    profile: Samples,
    base: Samples,
    angles: Samples,
    blur: Samples,
    shade: Samples,
    order: Whole,
    palette: Samples,
    settings: Samples,
    roll: float,
    weight: Samples,
    gain: Samples,
    slope: Samples,
    rest: Samples,
) -> float:
    """What a Gauss-Newton step needs at an angle, and the loss; the first arguments are those of `stripe_losses`.

    Args:
        profile: see there.
        base: see there.
        angles: see there.
        blur: see there.
        shade: see there.
        order: see there.
        palette: see there.
        settings: see there.
        roll: angle, rad.
        weight: from the step before; new ones, (n,).
        gain: brightness of the channels, an answer, (3,).
        slope: change of the colours with the angle, an answer, (n, 3).
        rest: what is left of the colours, an answer, (n, 3).
    """
    count, step = len(angles), 0.008
    model, ahead, behind = np.empty((count, 3)), np.empty((count, 3)), np.empty((count, 3))
    stripes_at(angles, blur, roll, order, palette, model)
    _gains(profile, weight, shade, model, settings[1], gain)
    loss = _reweighted(profile, base, shade, model, gain, settings[2], weight)
    stripes_at(angles, blur, roll + step, order, palette, ahead)
    stripes_at(angles, blur, roll - step, order, palette, behind)
    for n in range(count):
        for c in range(_CHANNELS):
            slope[n, c] = gain[c] * shade[n, c] * (ahead[n, c] - behind[n, c]) / (2.0 * step)
            rest[n, c] = profile[n, c] - gain[c] * (shade[n, c] * model[n, c] + shade[n, 3 + c])
    return loss
