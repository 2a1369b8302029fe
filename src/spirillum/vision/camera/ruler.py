"""Subpixel detection of a ruler's lines in a picture, by the phase of their fundamental wave."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.vision.video import opencv as cv2

_SHORTEST = 3.0  # shortest resolved distance of lines, pixels
_FEWEST = 8  # fewest lines of a ruler
_WINDOW = 1.5  # standard deviation along the rows of the window of a local phase, over the lines' distance
_ROWS = 2.0  # standard deviation of the window of a local phase across the rows, pixels
_COHERENT = 0.35  # least coherence: amplitude of the ruler's wave over the local contrast
_STRONG = 0.6  # least amplitude of the wave over that inside the strips: at their ends slanted lines bias the phase
_GAP = 12.0  # longest gap of a strip, in lines: a stronger line, as each tenth of millimetre paper, hides fine ones
_WIDE = 25.0  # lines that a strip has to span before its phase is extrapolated by more than a straight line
_CLEAR = 8.0  # least height of the ruler's spectral peak over the local median of the spectrum
_CHANNELS = (0.299, 0.587, 0.114), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
"""Channels in which a ruler is searched, as weights of red, green and blue: brightness, then single colours."""
_ROLLS = tuple(math.radians(sign * angle) for angle in (7.0, 14.0, 21.0, 28.0, 35.0, 42.0) for sign in (1.0, -1.0))
"""Rolls of the camera that are tried where no ruler lies as it should, rad."""
_UPRIGHT = math.radians(6.0)
"""Roll up to which lines are taken as they were found, rad; beyond it they are taken along the channel."""
_PROFILES, _NEAR, _HELD = 8, 0.06, 0.25
"""Profiles along each strip that show whether a reduced picture has lines at their true distance; the relative range
of a spatial frequency in which its power is looked for; and the least power there over that of finer lines."""
_MOST_ROWS = 500  # about as many rows determine the distance of the lines in large pictures
_BAND = 16  # rows sorted at once, so that they stay in the cache


class Lines(NamedTuple):
    """Points in the ruler's strips with their unwrapped phase in lines."""

    pixels: Samples  #: Pixels (u, v) of the points, (n, 2).
    number: Samples  #: Phase in lines from an arbitrary origin of each strip, rising with u, (n,).
    strip: np.ndarray  #: Label of each point's strip, (n,).
    distance: float  #: Distance of neighbouring lines, pixels.

    def enlarged(self, factor: int) -> Lines:
        """The lines in the full picture, if they were seen in one that was reduced by a factor."""
        return self._replace(pixels=factor * self.pixels + 0.5 * (factor - 1), distance=factor * self.distance)

    @property
    def lines(self) -> int:
        """Number of lines in the longest strip."""
        spans = [np.unique(np.round(self.number[self.strip == k])).size for k in np.unique(self.strip)]
        return int(max(spans))

    @property
    def roll(self) -> float:
        """Angle of the channel, across the lines, to the rows of the picture: positive downwards to the right, rad."""
        slopes, weights = [], []
        for label in np.unique(self.strip):
            inside = self.strip == label
            apart = self.pixels[inside] - self.pixels[inside].mean(axis=0)
            number = self.number[inside] - self.number[inside].mean()
            slopes.append(np.linalg.lstsq(apart, number, rcond=None)[0])
            weights.append(np.count_nonzero(inside))
        along, across = np.average(slopes, axis=0, weights=weights)
        return float(np.arctan2(across, along))


def still_picture(images: list[np.ndarray]) -> Samples:
    """Static background of pictures: the interquartile mean of each pixel, 0 to 255, (h, w, 3), in single precision."""
    pairs, quarter = _sorting(len(images)), len(images) // 4
    still: np.ndarray = np.empty(images[0].shape, dtype=np.float32)
    for low in range(0, len(still), _BAND):
        band = [image[low : low + _BAND] for image in images]
        for a, b in pairs:
            band[a], band[b] = np.minimum(band[a], band[b]), np.maximum(band[a], band[b])
        middle = band[quarter : len(band) - quarter]
        still[low : low + _BAND] = sum(middle, np.zeros(1, dtype=np.uint32)) / len(middle)
    return np.asarray(still)


def _sorting(count: int) -> list[tuple[int, int]]:
    """Comparators of a sorting network for `count` values: Batcher's odd-even merge sort."""
    # K. E. Batcher, Sorting networks and their applications, AFIPS Spring Joint Computer Conference 32:307, 1968.
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


def lines_in(picture: Samples, bounds: tuple[int, int, int, int], turn: float = 0.0) -> Lines | None:
    """Detect a ruler in a static picture; None if there is none."""
    # The local phase of the lines' fundamental wave is computed in a Gaussian window, which avoids pixel locking, and
    # unwrapped from the middle of each strip outwards.
    left, top, right, bottom = bounds
    colours: np.ndarray = picture[top:bottom, left:right].astype(np.float32, copy=False)
    back = None
    if turn:
        colours, back = _turned(colours, turn)
    for weights in _CHANNELS:
        found = _lines_of(np.ascontiguousarray(colours @ np.array(weights, dtype=np.float32)))
        if found is not None:
            pixels = found.pixels if back is None else found.pixels @ back[:, :2].T + back[:, 2]
            return found._replace(pixels=pixels + np.array([left, top], dtype=float))
    return None


def resolved(lines: Lines, image: np.ndarray, factor: int) -> bool:
    """Whether lines that were seen in a reduced picture are those of the full one, and not a moire of finer ones."""
    # Lines that are finer than two reduced pixels would show at a spatial frequency that is mirrored about multiples of
    # 1 / factor. The full picture shows at which of these it holds the larger part of its power.
    way = np.array([math.cos(lines.roll), math.sin(lines.roll)])
    side = np.array([-way[1], way[0]])
    power: Samples = np.zeros(1)
    frequency: Samples = np.zeros(1)
    for label in np.unique(lines.strip):
        points = lines.pixels[lines.strip == label]
        along, across = points @ way, np.quantile(points @ side, np.linspace(0.2, 0.8, _PROFILES))
        if label == lines.strip[0] or np.ptp(along) >= frequency.size:
            places = np.arange(along.min(), along.max())
            at = (places[:, None] * way + across[:, None, None] * side).astype(np.float32)
            seen = cv2.remap(image, at[..., 0], at[..., 1], cv2.INTER_LINEAR).mean(axis=2)
            seen = (seen - seen.mean(axis=1, keepdims=True)) * np.hanning(places.size)
            wave = np.fft.rfft(seen, axis=1)
            power = np.asarray(np.sum(wave.real**2 + wave.imag**2, axis=0), dtype=float)
            frequency = np.arange(len(power)) / places.size
    own = 1.0 / lines.distance
    finer = [m / factor + sign * own for m in range(1, factor) for sign in (-1.0, 1.0)]

    def held(at: float) -> float:
        near = np.abs(frequency - at) <= max(_NEAR * own, frequency[1])
        return float(power[near].max()) if near.any() else 0.0

    return held(own) >= _HELD * max(held(at) for at in finer)


def ruler_in(picture: Samples, bounds: tuple[int, int, int, int], turn: float = 0.0) -> Lines | None:
    """Detect a ruler at any roll of the camera; None if there is none."""
    found = lines_in(picture, bounds, turn)
    if found is None:
        tried = [one for roll in _ROLLS if (one := lines_in(picture, bounds, turn + roll)) is not None]
        found = max(tried, key=lambda one: len(one.number), default=None)
    if found is None or abs(math.remainder(found.roll - turn, math.pi)) < _UPRIGHT:
        return found
    return lines_in(picture, bounds, found.roll) or found


def _turned(part: np.ndarray, turn: float) -> tuple[np.ndarray, Samples]:
    """A picture turned against the clock, and the map from its pixels to those of the first one, (2, 3)."""
    height, width = part.shape[:2]
    c, s = abs(math.cos(turn)), abs(math.sin(turn))
    size = math.ceil(c * width + s * height), math.ceil(s * width + c * height)
    matrix = cv2.getRotationMatrix2D((0.5 * (width - 1), 0.5 * (height - 1)), math.degrees(turn), 1.0)
    matrix[:, 2] += 0.5 * (size[0] - width), 0.5 * (size[1] - height)
    ground = np.median(part.reshape(-1, 3), axis=0).tolist()
    turned = cv2.warpAffine(
        part, matrix, size, flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_CONSTANT, borderValue=ground
    )
    return np.asarray(turned), np.asarray(cv2.invertAffineTransform(matrix))


def _lines_of(part: Samples) -> Lines | None:
    """Detect a ruler in one channel of a region, (h, w)."""
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
    along = np.ones((1, 2 * int(0.5 * _GAP * distance) + 1), dtype=np.uint8)
    _, labels = cv2.connectedComponents(cv2.morphologyEx(good.astype(np.uint8), cv2.MORPH_CLOSE, along))
    labels[~good] = 0
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
    found = Lines(np.stack([u, v], axis=1), number, strip, distance)
    return found if found.lines + 2 * 2.5 * _WINDOW >= _FEWEST else None


def _frequency(flat: Samples) -> float | None:
    """Spatial frequency of the clearest wave along the rows, lines per pixel; None without a clear peak."""
    width = flat.shape[1]
    length = 4 * 1 << int(np.ceil(np.log2(width)))
    rows = flat[:: max(2, len(flat) // _MOST_ROWS)]
    spectrum = np.fft.rfft(rows * np.hanning(width).astype(flat.dtype), length, axis=1)
    power = spectrum.real**2
    power += spectrum.imag**2
    frequency = np.fft.rfftfreq(length)
    level = np.sum(power, axis=0)
    # A ruler's wave spans the whole width, so that its peak holds a large share of a row's power.
    share = power / np.maximum(power[:, frequency > 1.0 / width].sum(axis=1, keepdims=True), 1e-9)
    share *= share
    share *= np.sqrt(power, out=power)
    score = np.sum(share, axis=0)
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
    """Unwrap phases, in turns, by a polynomial surface grown from the middle out; with a mask of the inliers."""
    middle_u, middle_v = np.median(u), np.median(v)
    extent = max(float(np.ptp(u)), float(np.ptp(v)), 1.0)
    a, b = (u - middle_u) / extent, (v - middle_v) / extent
    far = np.hypot(u - middle_u, 3.0 * (v - middle_v))
    number, sure = turns.copy(), np.zeros(turns.size, dtype=bool)
    radius = max(4.0 * distance, float(np.quantile(far, min(1.0, 30.0 / far.size))))
    near = far <= radius
    centre = np.angle(np.mean(np.exp(2j * np.pi * turns[near]))) / (2 * np.pi)
    number[near] = turns[near] - np.round(turns[near] - centre)
    sure[near] = np.abs(number[near] - centre) < 0.45
    while True:
        order = 3 if sure.sum() >= 60 and np.ptp(u[sure]) > _WIDE * distance else 1
        terms = np.stack([a**i * b**j for i in range(order + 1) for j in range(min(order + 1 - i, 3))], axis=1)
        fitted = terms @ np.linalg.lstsq(terms[sure], number[sure], rcond=1e-8)[0]
        number = turns - np.round(turns - fitted)
        sure = (far <= radius) & (np.abs(number - fitted) < 0.25)
        if radius >= far.max() or sure.sum() < 6:
            return number, sure
        radius *= 1.25
