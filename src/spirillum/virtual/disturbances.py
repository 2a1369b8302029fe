"""Disturbances of a video's pictures: lamp drift, lost frames, tilt, glare, bubbles, a hand's shadow, noise."""

from __future__ import annotations

from typing import Self

import numpy as np

from spirillum.arrays import Samples
from spirillum.robot.robot import Robot
from spirillum.virtual.artifacts import Degradation
from spirillum.virtual.optics import Tank, VirtualLens

_LAMP, _LOST, _TILT, _GLARE, _BUBBLES, _HAND, _GRAIN = range(10, 17)
_GRAINS = 1 << 21
_GLARE_LIGHT, _BUBBLE_LIGHT = 1.3, 0.9
_HAND_SHADE, _HAND_TIME = 0.45, 4.0  # share of light that a hand blocks, and the time in which it passes, s; assumed
_MIN_DRIFT, _MAX_DRIFT = 0.05e-3, 0.4e-3  # speed of bubbles, m/s; assumed


def tilt_of(degradation: Degradation, seed: int) -> tuple[float, float]:
    """Tilt of the camera about x and about y, rad: of the given size, in a random direction."""
    azimuth = float(np.random.default_rng([seed, _TILT]).uniform(0.0, 2.0 * np.pi))
    return degradation.tilt * float(np.cos(azimuth)), degradation.tilt * float(np.sin(azimuth))


class Disturbances:
    """Disturbances of one video, sampled from its seed; each kind from an independent stream."""

    @classmethod
    def of_robot(
        cls, degradation: Degradation, seed: int, lens: VirtualLens, duration: float, robot: Robot, tank: Tank
    ) -> Self:
        """Those of a video of a robot in its tank, with bubbles above the robot and below the oil's surface."""
        length, diameter = robot.body.length, robot.body.diameter
        top = min(tank.tube_height + 0.8 * (tank.tube or 1.5 * diameter), 0.95 * lens.surface)
        return cls(degradation, seed, lens, duration, (length, diameter), top)

    def __init__(
        self,
        degradation: Degradation,
        seed: int,
        lens: VirtualLens,
        duration: float,
        body: tuple[float, float],
        top: float,
    ) -> None:
        self._degradation, self._seed, self._lens, self._body = degradation, seed, lens, body
        rng = np.random.default_rng([seed, _LAMP])
        self._linear = bool(rng.integers(2))
        self._phase, self._period = rng.uniform(0.0, 2.0 * np.pi), duration / rng.uniform(0.5, 1.5)
        self._sign = rng.choice([-1.0, 1.0])
        self._duration = duration
        rng = np.random.default_rng([seed, _GLARE])
        self._glare_at = rng.uniform([-0.25, -0.15], [0.25, 0.15]) * np.array(body)
        rng = np.random.default_rng([seed, _BUBBLES])
        count = degradation.bubbles
        reach = 0.5 * lens.size[0] / lens.focal * lens.eye
        positions = rng.uniform([-reach, -0.35 * reach / 2], [reach, 0.35 * reach / 2], (count, 2))
        self._bubbles = np.column_stack([positions, np.full(count, top)])
        self._bubble_radius = rng.uniform(0.4e-3, 1.3e-3, count)
        speed, azimuth = rng.uniform(_MIN_DRIFT, _MAX_DRIFT, count), rng.uniform(0.0, 2.0 * np.pi, count)
        self._drift = np.column_stack([speed * np.cos(azimuth), 0.2 * speed * np.sin(azimuth), np.zeros(count)])
        rng = np.random.default_rng([seed, _HAND])
        self._hand_time = rng.uniform(0.2, 0.8) * duration
        self._hand_sign = rng.choice([-1.0, 1.0])
        self._hand_height = rng.uniform(0.3, 0.7)
        self.noise = float(degradation.noise)  #: Standard deviation of the noise, bytes.
        self._grain_rng = np.random.default_rng([seed, _GRAIN])
        self.grain = self._grain_rng.standard_normal(_GRAINS if degradation.noise > 0 else 1, dtype=np.float32)
        """A pool of normal noise; every row of every picture starts at a random index of it."""

    def retained_frames(self, count: int) -> np.ndarray:
        """Whether each of a number of frames is kept, (count,); the first and the last always are."""
        lost = round(self._degradation.dropped * count)
        kept = np.ones(count, dtype=bool)
        if count > 2:
            chosen = np.random.default_rng([self._seed, _LOST]).permutation(count - 2)[: min(lost, count - 2)]
            kept[1 + chosen] = False
        return kept

    def gain(self, time: float) -> Samples:
        """(3,) brightness of the lamp in red, green and blue."""
        share = time / self._duration if self._duration > 0 else 0.0
        swing = float(np.sin(2.0 * np.pi * time / self._period + self._phase))
        drift = self._degradation.lamp_drift * (self._sign * share if self._linear else swing)
        return np.asarray((1.0 + drift) * (1.0 + 0.25 * drift * np.array([1.0, 0.0, -1.0])))

    def starts(self, rows: int) -> np.ndarray:
        """Start of each row of the next picture in the pool of noise, (rows,)."""
        return self._grain_rng.integers(0, self.grain.size, rows)

    def disturb(self, light: Samples, time: float, position: Samples) -> None:
        """Add shadow, bubbles and glare to linear light, (rows, columns, 3), which is changed."""
        if self._degradation.hand:
            self._shade(light, time)
        if self._degradation.bubbles:
            self._add_bubbles(light, time)
        if self._degradation.glare > 0:
            self._add_glare(light, position)

    def _shade(self, light: Samples, time: float) -> None:
        rows, columns, _ = light.shape
        share = (time - self._hand_time) / _HAND_TIME
        middle = columns * (0.5 + self._hand_sign * 1.6 * share)
        across = np.exp(-(((np.arange(columns) - middle) / (0.28 * columns)) ** 4))
        along = np.exp(-(((np.arange(rows) - self._hand_height * rows) / (0.55 * rows)) ** 4))
        if across.max() > 1e-3:
            light *= (1.0 - _HAND_SHADE * along[:, None] * across[None, :])[..., None]

    def _add_bubbles(self, light: Samples, time: float) -> None:
        positions = self._bubbles + time * self._drift
        middle = self._lens.project(positions)
        edge = self._lens.project(positions + np.column_stack([self._bubble_radius, 0 * positions[:, :2]]))
        for (u, v, _), radius in zip(middle, np.abs(edge[:, 0] - middle[:, 0]), strict=True):
            window, du, dv = _around(light, u, v, 1.5 * radius + 2)
            far = np.hypot(du, dv) / radius
            rim = np.exp(-(((far - 0.88) / 0.13) ** 2))
            spot = np.exp(-((np.hypot(du + 0.35 * radius, dv + 0.35 * radius) / (0.25 * radius)) ** 2))
            light[window] *= (1.0 - 0.55 * rim)[..., None]
            light[window] += (_BUBBLE_LIGHT * spot + 0.06 * (far < 0.9))[..., None]

    def _add_glare(self, light: Samples, position: Samples) -> None:
        glare = position.copy() if self._degradation.glare_moves else np.array([0.0, 0.0, position[2]])
        glare[:2] += self._glare_at
        length, diameter = self._body
        ends = self._lens.project(glare + np.array([[0.0, 0.0, 0.0], [1e-3, 0.0, 0.0]]))
        scale = abs(ends[1, 0] - ends[0, 0]) / 1e-3
        area = self._degradation.glare * scale**2 * length * diameter * 0.94  # of an ellipse of axes 1.6 to 1
        minor = np.sqrt(area / (np.pi * 1.6))
        u, v = float(ends[0, 0]), float(ends[0, 1])
        window, du, dv = _around(light, u, v, 2.4 * minor + 2)
        far2 = (du / (1.6 * minor)) ** 2 + (dv / minor) ** 2
        light[window] += (_GLARE_LIGHT * np.exp(-(far2**2)))[..., None]


def _around(light: Samples, u: float, v: float, reach: float) -> tuple[tuple[slice, slice], Samples, Samples]:
    """A window about a pixel, and the distances from it along u and v of the window's pixels."""
    rows, columns, _ = light.shape
    left, right = (int(np.clip(value, 0, columns)) for value in (np.floor(u - reach), np.ceil(u + reach) + 1))
    top, bottom = (int(np.clip(value, 0, rows)) for value in (np.floor(v - reach), np.ceil(v + reach) + 1))
    du, dv = np.meshgrid(np.arange(left, right) - u, np.arange(top, bottom) - v)
    return (slice(top, bottom), slice(left, right)), du, dv
