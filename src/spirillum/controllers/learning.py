"""Friction and gap from the data of camera and meter: the posterior on a bank of robots.

Blocks of a second of the tail's phase and the body's angle, and the mean current and voltage, are compared with what
the bank did under the same commands (multiple-model estimation, Magill 1965). Given the unknown factors theta all else
is linear and Gaussian, and is integrated out:

    z = m(theta) + H eta + e,   eta ~ N(0, P),  e ~ N(0, R),   log p(z | theta) = -r' (R + H P H')^-1 r / 2 + const,

with r = z - m(theta). In eta are the relative errors of voltage and viscosity, the gains of the meter, and where each
angle began (unknown). R holds the camera's errors of a frame and its slow ones, averaged over blocks, and the bank's
errors of the rates. The prior is even in the logarithms of the factors.

The learner beside a controller infers from the meter when the drive is on, simulates its bank, and estimates. The
current follows a switching within milliseconds, so that a reading tells whether a command has arrived; without a meter
the commands are believed as they were sent.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from spirillum.arrays import Samples
from spirillum.controllers.estimators import Bank, Paths, interpolation, points
from spirillum.controllers.lab import Lab
from spirillum.controllers.sensors import Command, Controller, Detection, Message, MeterReading
from spirillum.dynamics.run_summary import DutyInterval
from spirillum.envelope import quantity

BLOCK = 1.0  #: Length of a block, s.
SETTLING = 0.3  #: Readings within this time after a switch of the drive are left out, s.
_FEWEST = 4  # frames of a block at least
_BANK_ERROR = 1e-2
"""Relative standard deviation of the bank's rates of tail and body: interpolation, a pulse of flow, which lifts the
robot a little, and voltage and viscosity, which change more than a factor once the robot's rear touches the wall.
Chosen on 120 seeds, checked on others, see `docs/control-background.md`."""
_BANK_MEMORY = 4.0  # correlation time of the bank's errors, s
_ANYWHERE = 1e2  # standard deviation of where an angle began, rad
_COARSE, _FINE = 41, 61
_NEGLIGIBLE = 15.0  # points whose log posterior is below the maximum by more than this are left out of the finer grid
_UNINFORMED = 0.8  # a factor counts as not learnt where its 95 % interval is at least this share of the prior's


@dataclass(frozen=True)
class Factor:
    """What is known of a factor: median and 95 % interval."""

    value: float
    low: float
    high: float
    told: bool  #: Whether the data are more informative than the prior.

    def to_dict(self) -> dict[str, Any]:
        """The factor as data."""
        return quantity(self.value, "1", low=self.low, high=self.high, kind="interval", level=0.95, told=self.told)


@dataclass(frozen=True)
class RobotEstimate:
    """What is known of the robot."""

    friction: Factor
    gap: Factor


@dataclass(frozen=True)
class _Block:
    """Means over a second."""

    stretch: int
    start: float
    frames: int
    seen: tuple[float, float]  # tail's phase and body's angle, rad
    predicted: Samples  # tail's phase and body's angle of every member of the bank, rad, (friction, gap, 2)
    sensitivity: Samples  # (friction, 2, 2): voltage and viscosity, by quantity


def learnt(
    paths: Paths,
    lab: Lab,
    stretches: Sequence[DutyInterval],
    sights: Sequence[Detection],
    readings: Sequence[MeterReading],
) -> RobotEstimate | None:
    """Medians and 95 % intervals of friction and gap; None before there are two blocks."""
    blocks = [block for number, one in enumerate(stretches) for block in _blocks(paths, number, one, sights)]
    if len(blocks) < 2:
        return None
    means, electric = _electric(paths, lab, stretches, readings)
    nodes = points(lab.unknown.friction_factor), points(lab.unknown.gap_factor)
    members = np.concatenate(
        [np.moveaxis(np.array([block.predicted for block in blocks]), 0, -2), electric.predicted], axis=-2
    )
    flat = members.reshape(nodes[0].size, nodes[1].size, -1)
    seen = np.concatenate([[block.seen for block in blocks], means]).ravel()
    axes = [np.linspace(-1.0, 1.0, _COARSE) if node.size > 1 else np.zeros(1) for node in nodes]
    best = [np.zeros(1), np.zeros(1)]
    for refine in (True, True, False):
        covariance = _covariance(lab, blocks, electric, flat, nodes, best)
        log = _log_likelihood(seen, _interpolated(flat, nodes, axes), covariance)
        if refine:
            best = [axis[[at]] for axis, at in zip(axes, np.unravel_index(np.argmax(log), log.shape), strict=True)]
            near = log > log.max() - _NEGLIGIBLE
            axes = [_refined(axis, near.any(axis=1 - side)) for side, axis in enumerate(axes)]
    weight = np.exp(log - log.max())
    return RobotEstimate(
        _factor(axes[0], weight.sum(axis=1), lab.unknown.friction_factor),
        _factor(axes[1], weight.sum(axis=0), lab.unknown.gap_factor),
    )


@dataclass(frozen=True)
class _Electric:
    """Current and voltage; one row, or none without a meter."""

    predicted: Samples  # (friction, gap, rows, 2)
    sensitivity: Samples  # (rows, friction, 2, 2)
    noise: Samples  # variances of the means, (rows, 2)


def _blocks(paths: Paths, number: int, stretch: DutyInterval, sights: Sequence[Detection]) -> list[_Block]:
    """Blocks of one stretch, without those that have too few frames."""
    blocks: list[_Block] = []
    begin, end = stretch.start + SETTLING, min(stretch.end, float(paths.time[-1]))
    inside = [sight for sight in sights if begin <= sight.time <= end]
    for part in range(int((end - begin) / BLOCK)):
        start = begin + part * BLOCK
        frames = [sight for sight in inside if start <= sight.time < start + BLOCK]
        if len(frames) < _FEWEST:
            continue
        weights = _means_at(paths.time, np.array([sight.time for sight in frames]))
        seen = (
            float(np.mean([sight.tail_phase for sight in frames])),
            float(np.mean([sight.body_angle for sight in frames])),
        )
        predicted, sensitivity = paths.members[:, :, :2] @ weights, paths.sensitivity[:, :, :2] @ weights
        blocks.append(_Block(number, start, len(frames), seen, predicted, sensitivity))
    return blocks


def _means_at(time: Samples, moments: Samples) -> Samples:
    """Weights of values at times for their mean, interpolated linearly, at moments, (n,)."""
    after = np.clip(np.searchsorted(time, moments), 1, time.size - 1)
    share = np.clip((moments - time[after - 1]) / (time[after] - time[after - 1]), 0.0, 1.0)
    weights = np.zeros(time.size)
    np.add.at(weights, after, share)
    np.add.at(weights, after - 1, 1.0 - share)
    return weights / moments.size


def _electric(
    paths: Paths, lab: Lab, stretches: Sequence[DutyInterval], readings: Sequence[MeterReading]
) -> tuple[Samples, _Electric]:
    end = float(paths.time[-1])
    inside = [one for one in readings if any(s.start + SETTLING <= one.time <= min(s.end, end) for s in stretches)]
    shape = paths.members.shape
    if not inside:
        return np.empty((0, 2)), _Electric(
            np.empty((*shape[:2], 0, 2)), np.empty((0, shape[0], 2, 2)), np.empty((0, 2))
        )
    weights = _means_at(paths.time, np.array([one.time for one in inside]))
    predicted, sensitivity = paths.members[:, :, 2:] @ weights, paths.sensitivity[:, :, 2:] @ weights
    means = np.array([[np.mean([one.current for one in inside]), np.mean([one.voltage for one in inside])]])
    meter = lab.meter
    noise = np.array([[meter.current_noise, meter.voltage_noise * abs(means[0, 1])]]) ** 2 / len(inside)
    return means, _Electric(predicted[:, :, None], sensitivity[None], noise)


def _interpolated(flat: Samples, nodes: Sequence[Samples], axes: Sequence[Samples]) -> Samples:
    """Predicted data of robots between the members, (friction, gap, data)."""
    first, second = (interpolation(node, axis) for node, axis in zip(nodes, axes, strict=True))
    return np.asarray(np.einsum("ai,ijd,bj->abd", first, flat, second))


def _covariance(
    lab: Lab,
    blocks: Sequence[_Block],
    electric: _Electric,
    flat: Samples,
    nodes: Sequence[Samples],
    best: Sequence[Samples],
) -> Samples:
    """R + H P H' of the data, as it is for the robot that is the best estimate so far, (data, data)."""
    rows = len(blocks)
    predicted = _interpolated(flat, nodes, best)[0, 0].reshape(-1, 2)
    weights = interpolation(nodes[0], best[0])[0]
    members = np.concatenate([[block.sensitivity for block in blocks], electric.sensitivity])
    sensitivity = np.tensordot(members, weights, axes=(1, 0))
    columns: list[Samples] = []
    for number, size in enumerate((lab.unknown.voltage_error, lab.unknown.viscosity_error)):
        columns.append(size * (predicted * sensitivity[:, number]).ravel())
    for part in range(2):
        gain = np.zeros_like(predicted)
        gain[rows:, part] = lab.meter.gain_error * predicted[rows:, part]
        columns.append(gain.ravel())
        for stretch in {block.stretch for block in blocks}:
            offset = np.zeros_like(predicted)
            offset[:rows, part] = [_ANYWHERE * (block.stretch == stretch) for block in blocks]
            columns.append(offset.ravel())
    across = np.array(columns)
    covariance: Samples = across.T @ across
    for angle, name in enumerate(("tail_phase", "body_angle")):
        of_angle = slice(angle, 2 * rows, 2)
        covariance[of_angle, of_angle] += _errors_of_blocks(lab, blocks, name)
        covariance[of_angle, of_angle] += _errors_of_bank(blocks, predicted[:rows, angle])
    last = np.arange(2 * rows, covariance.shape[0])
    covariance[last, last] += electric.noise.ravel() + 1e-12
    return covariance


def _errors_of_blocks(lab: Lab, blocks: Sequence[_Block], name: str) -> Samples:
    """Covariance of the camera's errors of block means: white ones, and an Ornstein-Uhlenbeck process averaged."""
    camera = lab.camera
    white, slow = getattr(camera, f"{name}_noise"), getattr(camera, f"{name}_wander")
    starts = np.array([block.start for block in blocks])
    over = BLOCK / camera.memory
    apart = np.abs(starts[:, None] - starts) / camera.memory
    covariance = slow**2 * ((1.0 - np.exp(-over)) / over) ** 2 * np.exp(-np.maximum(apart - over, 0.0))
    same = 2.0 * slow**2 * (over - 1.0 + np.exp(-over)) / over**2
    np.fill_diagonal(covariance, same + white**2 / np.array([block.frames for block in blocks]) + 1e-10)
    return np.asarray(covariance)


def _errors_of_bank(blocks: Sequence[_Block], predicted: Samples) -> Samples:
    """Covariance of the bank's error of an angle: the integral of a rate's relative error, which has a memory."""
    starts = np.array([block.start for block in blocks])
    alike = np.exp(-np.abs(starts[:, None] - starts) / _BANK_MEMORY)
    sums = np.tril(np.ones((predicted.size, predicted.size))) * np.diff(predicted, prepend=predicted[0])
    return np.asarray(_BANK_ERROR**2 * sums @ alike @ sums.T)


def _log_likelihood(seen: Samples, predicted: Samples, covariance: Samples) -> Samples:
    """Log likelihood at each point of a grid, but for a constant, (friction, gap)."""
    from scipy.linalg import cholesky, solve_triangular

    residuals = (seen - predicted).reshape(-1, seen.size).T
    white = solve_triangular(cholesky(covariance, lower=True), residuals, lower=True)
    return np.asarray(-0.5 * np.sum(white**2, axis=0).reshape(predicted.shape[:2]))


def _refined(axis: Samples, near: Samples) -> Samples:
    """A finer axis over the points near the best."""
    if axis.size == 1:
        return axis
    inside = np.flatnonzero(near)
    low, high = max(inside[0] - 1, 0), min(inside[-1] + 1, axis.size - 1)
    return np.linspace(axis[low], axis[high], _FINE)


def _factor(axis: Samples, weight: Samples, largest: float) -> Factor:
    """Median and interval of a factor from its density over the power."""
    if axis.size == 1:
        return Factor(1.0, 1.0, 1.0, told=False)  # a model without walls has no gap to learn
    parts = 0.5 * (weight[1:] + weight[:-1])
    cumulative = np.concatenate([[0.0], np.cumsum(parts)]) / parts.sum()
    low, value, high = np.interp([0.025, 0.5, 0.975], cumulative, axis)
    return Factor(
        float(largest**value), float(largest**low), float(largest**high), told=bool(high - low < 1.9 * _UNINFORMED)
    )


class Learner:
    """What has been seen of a run, and the factors estimated from it."""

    def __init__(self, lab: Lab, bank: Bank) -> None:
        self._lab, self._bank = lab, bank
        self._sights: list[Detection] = []
        self._readings: list[MeterReading] = []
        self._duties: list[tuple[float, float]] = [(0.0, 0.0)]  #: From when on the drive has which duty, s.
        self._sent: list[tuple[float, float]] = [(0.0, 0.0)]
        self._next = SETTLING + 2.0 * BLOCK
        self.learnt: RobotEstimate | None = None

    def take(self, news: Message, duty: float) -> None:
        """Take in what reached a controller, and the duty that it sent."""
        self._sights += news.sights
        acts = news.time + self._lab.remote.delay
        if duty != self._sent[-1][1]:
            self._sent.append((acts, duty))
        if self._lab.meter.rate:
            for reading in news.readings:
                self._hear(reading)
            until = self._readings[-1].time if self._readings else 0.0
        else:
            self._duties, until = list(self._sent), news.time
        if until >= self._next:
            self._learn(until)

    def _hear(self, reading: MeterReading) -> None:
        """Note a reading, and a switching that it shows: halfway to the reading before."""
        on = reading.current > 0.5 * self._bank.current * min(self._last_sent(reading.time), 1.0)
        duty = self._last_sent(reading.time) if on else 0.0
        before = self._readings[-1].time if self._readings else 0.0
        if duty != self._duties[-1][1]:
            self._duties.append((0.5 * (before + reading.time), duty))
        self._readings.append(reading)

    def _last_sent(self, time: float) -> float:
        """Last duty that was sent and not 0; the robot's own if there is none."""
        sent = [duty for start, duty in self._sent if start <= time and duty > 0.0]
        return sent[-1] if sent else self._bank.duty

    def _learn(self, until: float) -> None:
        for (start, duty), (end, _) in zip(self._duties, [*self._duties[1:], (until, 0.0)], strict=True):
            if end > self._bank.time:
                self._bank.follow(min(end, until), duty if start <= until else 0.0)
        self._next = until + BLOCK
        self.learnt = learnt(self._bank.paths(), self._lab, self._on(until), self._sights, self._readings)

    def _on(self, until: float) -> list[DutyInterval]:
        """Stretches of time in which the drive was on."""
        stretches: list[DutyInterval] = []
        for (start, duty), (end, _) in zip(self._duties, [*self._duties[1:], (until, 0.0)], strict=True):
            if duty > 0.0 and stretches and stretches[-1].end == start:
                stretches[-1] = DutyInterval(stretches[-1].start, end)
            elif duty > 0.0:
                stretches.append(DutyInterval(start, end))
        return stretches


class Learning(Controller):
    """A controller with a learner beside it, which leaves its decisions alone."""

    def __init__(self, controller: Controller, learner: Learner) -> None:
        self._controller, self.learner = controller, learner
        self.blind, self.knowing = controller.blind, controller.knowing

    def decide(self, news: Message) -> float | Command:
        """The controller's duty, which the learner takes note of."""
        asked = self._controller.decide(news)
        self.learner.take(news, asked.duty if isinstance(asked, Command) else asked)
        return asked

    def estimate(self) -> Mapping[str, float]:
        """The controller's, and median and 95 % interval of the factors of friction and gap; NaN before."""
        estimate: dict[str, Any] = dict(self._controller.estimate())
        for name in ("friction", "gap"):
            factor = None if self.learner.learnt is None else getattr(self.learner.learnt, name)
            for end, part in (("", "value"), ("_low", "low"), ("_high", "high")):
                estimate[f"estimated_{name}_factor{end}"] = np.nan if factor is None else float(getattr(factor, part))
        return estimate
