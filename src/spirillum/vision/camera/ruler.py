"""Lines of a ruler in a picture: where they are, to a small part of a pixel."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.extras import required

__all__ = ["Lines", "lines_in", "still_picture"]

_SHORTEST = 3.0
"""Shortest distance of lines that a picture resolves, pixels."""
_FEWEST = 8
"""Fewest lines of a ruler."""
_WINDOW = 1.5
"""Width (standard deviation) of the window in which a phase is found, over the lines' distance."""
_ROWS = 2.0
"""Standard deviation of that window across the rows, pixels."""
_COHERENT = 0.35
"""Least share of a place's contrast that is in the ruler's wave."""
_STRONG = 0.6
"""Least strength of that wave over that in the middle of the strips: at their ends slanted lines look shifted."""
_CLEAR = 8.0
"""Least height of the ruler's peak in the spectrum over what is usual beside it."""
_CHANNELS = (0.299, 0.587, 0.114), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
"""Weights of red, green and blue with which a ruler is looked for: brightness, then single colours."""
_BAND = 16
"""Rows of pictures that are sorted at once."""


class Lines(NamedTuple):
    """Places in the ruler's strips, and how many lines of the ruler each of them lies from the strip's first."""

    pixels: Samples
    """(n, 2)."""
    number: Samples
    """Lines from an arbitrary origin of the place's own strip, rising with u, (n,)."""
    strip: np.ndarray
    """Which strip each place belongs to, (n,)."""
    distance: float
    """Distance of neighbouring lines, pixels."""

    @property
    def lines(self) -> int:
        """Number of lines that were seen, of the strip with most of them."""
        spans = [np.unique(np.round(self.number[self.strip == k])).size for k in np.unique(self.strip)]
        return int(max(spans))


def still_picture(images: list[np.ndarray]) -> Samples:
    """What stands still in pictures: the mean of the middle half of each pixel's values, 8-bit scale, (h, w, 3)."""
    pairs, quarter, still = _sorting(len(images)), len(images) // 4, np.empty(images[0].shape)
    for low in range(0, len(still), _BAND):  # what is sorted at once stays near the processor
        band = [image[low : low + _BAND] for image in images]
        for a, b in pairs:
            band[a], band[b] = np.minimum(band[a], band[b]), np.maximum(band[a], band[b])
        middle = band[quarter : len(band) - quarter]
        still[low : low + _BAND] = sum(middle, np.zeros(1, dtype=np.uint32)) / len(middle)
    return still


def _sorting(count: int) -> list[tuple[int, int]]:
    """Pairs of places that, put in order one after the other, sort so many values: Batcher's odd-even merge sort.

    K. E. Batcher, Sorting networks and their applications, AFIPS Spring Joint Computer Conference 32:307, 1968.
    """
    pairs, run = [], 1
    while run < count:
        step = run
        while step:
            for first in range(step % run, count - step, 2 * step):
                lower = range(first, first + min(step, count - step - first))
                pairs += [(a, a + step) for a in lower if a // (2 * run) == (a + step) // (2 * run)]
            step //= 2
        run *= 2
    return pairs


def lines_in(picture: Samples, bounds: tuple[int, int, int, int]) -> Lines | None:
    """The ruler's places in a still picture; None if no ruler is found.

    Around each place the phase of the lines' fundamental wave is taken in a Gaussian window, which knows no pixels; it
    is unwrapped from the middle of each strip outwards.

    Args:
        picture: 8-bit scale, (h, w, 3).
        bounds: first and last-but-one column and row to look at: left, top, right, bottom.
    """
    left, top, right, bottom = bounds
    colours = picture[top:bottom, left:right].astype(np.float32)
    for weights in _CHANNELS:
        found = _lines_of(np.ascontiguousarray(colours @ np.array(weights, dtype=np.float32)), left, top)
        if found is not None:
            return found
    return None


def _lines_of(part: Samples, left: int, top: int) -> Lines | None:
    """The ruler's places in a part of a picture that begins at some column and row, (h, w)."""
    cv2 = required("cv2", "measuring a video", "video")
    flat = part / np.maximum(cv2.GaussianBlur(part, (0, 0), 15.0), 1.0) - 1.0
    flat = np.clip(flat, -0.6, 0.6)
    frequency = _frequency(flat)
    if frequency is None:
        return None
    distance = 1.0 / frequency
    turn = 2.0 * np.pi * frequency * np.arange(part.shape[1])
    sigma = _WINDOW * distance

    def smooth(values: Samples) -> Samples:
        out: Samples = cv2.GaussianBlur(np.ascontiguousarray(values), (0, 0), sigmaX=sigma, sigmaY=_ROWS)
        return out

    phase = smooth(flat * np.cos(turn).astype(np.float32)) - 1j * smooth(flat * np.sin(turn).astype(np.float32))
    size = np.abs(phase)
    coherence = size / np.sqrt(np.maximum(smooth(flat**2), 1e-12))
    good = coherence > _COHERENT
    if not np.any(good):
        return None
    good &= size > _STRONG * np.quantile(size[good], 0.9, method="nearest")
    margin = int(2.5 * sigma) + 1
    good[:, :margin] = good[:, -margin:] = False
    _, labels = cv2.connectedComponents(good.astype(np.uint8))
    step = max(1, round(distance))
    rows, cols = (grid.ravel() for grid in np.mgrid[0 : part.shape[0] : 2, 0 : part.shape[1] : step])
    kept = labels[rows, cols] > 0
    rows, cols = rows[kept], cols[kept]
    strip, turns = labels[rows, cols], np.angle(phase[rows, cols]) / (2 * np.pi)
    pieces = []
    for label in np.unique(strip):
        inside = strip == label
        u, v = cols[inside].astype(float), rows[inside].astype(float)
        if (u.max() - u.min()) * frequency < _FEWEST - 2 * 2.5 * _WINDOW / 2 or inside.sum() < 12:
            continue
        number, sure = _unwrapped(u, v, turns[inside], distance)
        pieces.append((u[sure], v[sure], number[sure] + frequency * u[sure], np.full(int(sure.sum()), label)))
    if not pieces:
        return None
    u, v, number, strip = (np.concatenate(parts) for parts in zip(*pieces, strict=True))
    found = Lines(np.stack([u + left, v + top], axis=1), number, strip, distance)
    return found if found.lines + 2 * 2.5 * _WINDOW >= _FEWEST else None


def _frequency(flat: Samples) -> float | None:
    """Lines per pixel of the clearest wave along the rows that goes through a good part of them."""
    width = flat.shape[1]
    length = 4 * 1 << int(np.ceil(np.log2(width)))
    spectrum = np.fft.rfft(flat[::2] * np.hanning(width).astype(flat.dtype), length, axis=1)
    power = spectrum.real**2 + spectrum.imag**2
    frequency = np.fft.rfftfreq(length)
    # a ruler's wave runs through the whole width: its peak is as narrow as the width allows, and stands out of a row
    share = power / np.maximum(power[:, frequency > 1.0 / width].sum(axis=1, keepdims=True), 1e-9)
    score = np.sum(share**2 * np.sqrt(power), axis=0)
    level = np.sum(power, axis=0)
    allowed = (frequency < 1.0 / _SHORTEST) & (frequency > _FEWEST / (2.0 * width))
    if not np.any(allowed):
        return None
    peak = int(np.argmax(np.where(allowed, score, 0.0)))
    around = int(40 * length / width) | 1
    usual = np.median(np.pad(level, around // 2, mode="edge")[peak : peak + around])
    if not level[peak] > _CLEAR * usual:
        return None
    return float(frequency[peak])


def _unwrapped(u: Samples, v: Samples, turns: Samples, distance: float) -> tuple[Samples, np.ndarray]:
    """Phases in turns without jumps, and which of them fit their neighbours: a surface grows from the middle out."""
    middle_u, middle_v = np.median(u), np.median(v)
    reach = max(float(np.ptp(u)), float(np.ptp(v)), 1.0)
    a, b = (u - middle_u) / reach, (v - middle_v) / reach
    far = np.hypot(u - middle_u, 3.0 * (v - middle_v))
    number, sure = turns.copy(), np.zeros(turns.size, dtype=bool)
    radius = max(4.0 * distance, float(np.quantile(far, min(1.0, 30.0 / far.size))))
    near = far <= radius
    centre = np.angle(np.mean(np.exp(2j * np.pi * turns[near]))) / (2 * np.pi)
    number[near] = turns[near] - np.round(turns[near] - centre)
    sure[near] = np.abs(number[near] - centre) < 0.45
    while True:
        order = 1 if sure.sum() < 60 else 3
        terms = np.stack([a**i * b**j for i in range(order + 1) for j in range(min(order + 1 - i, 3))], axis=1)
        fitted = terms @ np.linalg.lstsq(terms[sure], number[sure], rcond=1e-8)[0]
        number = turns - np.round(turns - fitted)
        sure = (far <= radius) & (np.abs(number - fitted) < 0.25)
        if radius >= far.max() or sure.sum() < 6:
            return number, sure
        radius *= 1.25
