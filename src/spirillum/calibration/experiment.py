"""Observations as a fit needs them: ratios of rates, robot by robot, with the scatter of their trials.

Everything that swims in a viscous fluid at rest is proportional to the tail's rate. So a trial says as much about the
fluid as its ratios do: advance per radian U/omega and turning Omega/omega. Each trial is divided by its own rate; a
battery that runs down from trial to trial then does no harm.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from spirillum.arrays import Samples
from spirillum.errors import InputError
from spirillum.files import read_bytes
from spirillum.files.limits import LARGEST_TABLE
from spirillum.measurement.observations import (
    ObservationRow,
    all_rates,
    check_driven,
    check_signs,
    driven_sense,
    observation_table,
    read_observations,
    unread_columns,
    without_copies,
)
from spirillum.measurement.rate_checks import convention_doubt, rows_in_words
from spirillum.measurement.statistics import NORMAL, student_t_quantile
from spirillum.notes import Note
from spirillum.robot.robot import Robot, with_numbers
from spirillum.robust import mad_scale
from spirillum.swimming.intervals import error_of_mean

Quantity = Literal["advance", "turning", "motor_rate"]  #: U/omega (or U/omega_m), Omega/omega, omega_m.

_FEWEST_EQUAL = 3  # rows of equal speed that were not measured, if of that many tails or with that many digits
_NEAR_ZERO = 3.0  # standard errors within which a mean may be backwards by chance
_FLOOR = 0.1  # smallest scale of a relative error, over the median of all robots: a mean near zero has none


@dataclass(frozen=True)
class Ratio:
    """One quantity of every robot: mean over the trials, and the error estimated from their scatter."""

    mean: Samples  #: SI; NaN where it was not observed.
    trials: Samples  #: Number of trials in the mean.
    scale: Samples  #: What the error of a trial is relative to: the mean's size.
    squares: Samples  #: Sum of squares of the trials' deviations from the mean, over the scale squared.
    freedom: Samples  #: Degrees of freedom of that sum.
    stated: Samples  #: Relative standard error of one trial in the file, over the scale; NaN where it states none.

    def error_of_mean(self, error: Samples | float) -> Samples:
        """Standard error of each mean, SI, from the relative error of one trial; NaN where it is unknown."""
        return error_of_mean(error, self.stated, self.scale, self.trials)

    def typical_error(self, error: float) -> float:
        """Root mean square over the robots of one trial's relative error; NaN where none is known."""
        used = np.fmax(error, self.stated)[self.is_observed]
        known = used[np.isfinite(used)]
        return float(np.sqrt(np.mean(known**2))) if known.size else float("nan")

    def sampled_error(self, count: int, rng: np.random.Generator) -> Samples:
        """Draws of the relative error of one trial, given the scatter, (count, 1); NaN without repeated trials."""
        # Few trials leave it uncertain (chi-squared), so that a mean with it is distributed as Student's t.
        freedom = float(self.freedom.sum())
        if freedom == 0:
            return np.full((1, 1), np.nan)
        found: Samples = np.sqrt(self.squares.sum() / rng.chisquare(freedom, size=(count, 1)))
        return found

    @property
    def explained(self) -> bool:
        """Whether every mean has an error, stated or by the scatter of trials."""
        return self.freedom.sum() > 0 or bool(np.all(np.isfinite(self.stated[self.is_observed])))

    @property
    def is_observed(self) -> np.ndarray:
        """Whether it was observed, robot by robot."""
        return np.isfinite(self.mean)

    @property
    def pooled_error(self) -> float:
        """Relative error of one trial, from the scatter of all robots; NaN without repeated trials."""
        freedom = float(self.freedom.sum())
        return float(np.sqrt(self.squares.sum() / freedom)) if freedom > 0 else float("nan")


@dataclass(frozen=True)
class Experiment:
    """The robots of an observations file, and what was seen of each."""

    robots: tuple[Robot, ...]  #: One for each tail in each channel.
    channels: tuple[float, ...]  #: Channel diameters, m, ascending.
    channel: np.ndarray  #: Index of each robot's channel in `channels`.
    observed: tuple[tuple[ObservationRow, ...], ...]  #: Rows of the file that belong to each robot.
    advance: Ratio  #: U/omega, m/rad; where the tail's rate was not observed U/omega_m.
    by_motor: np.ndarray  #: Whether the advance is over the motor's rate.
    turning: Ratio  #: Omega/omega.
    motor_rate: Ratio  #: omega_m, rad/s.
    tail_rate: Samples
    correlation: float  #: Between the errors of advance and turning in a robot's trials, which share their tail rate.
    source: str
    sha256: str
    synthetic: bool  #: Whether the file states that its numbers are synthetic.
    outliers: tuple[Note, ...] = ()  #: Trials that are far off the others of their tail, a sentence each.
    doubts: tuple[Note, ...] = ()
    """Notes on doubtful rows, such as copies of a trial, which do not count."""

    @property
    def size(self) -> int:
        """Number of robots."""
        return len(self.robots)

    @property
    def rows(self) -> tuple[tuple[int, ...], ...]:
        """Numbers of the rows of each robot."""
        return tuple(tuple(item.row for item in group) for group in self.observed)

    def labels(self) -> list[str]:
        """Each robot in a few words."""
        return [tail_words(robot) for robot in self.robots]


def channel_of(robot: Robot) -> float:
    """Diameter of a robot's channel, m; infinite without one."""
    return robot.channel.diameter if robot.channel else float("inf")


def tail_words(robot: Robot) -> str:
    """Channel and tail of a robot in a few words."""
    tail = robot.tail
    return f"channel {channel_of(robot) * 1e3:g} mm, tail {tail.wavelength * 1e3:g} x {tail.amplitude * 1e3:g} mm"


def with_tail(robot: Robot, wavelength: float, amplitude: float) -> Robot:
    """A robot with another tail, m."""
    return with_numbers(robot, {"tail.wavelength": wavelength, "tail.amplitude": amplitude})


def read_experiment(path: str | Path, robots: Sequence[Robot]) -> Experiment:
    """Read observations and lay them onto robots: by channel diameter; the tail is that of the row."""
    path = Path(path)
    observations = read_observations(path)
    kept, copies = without_copies(observations)
    allowed = "robots with the channels of the observations"
    by_channel = robots_by_channel(robots, allowed, "by which rows are matched")
    groups: dict[tuple[float, float, float], list[ObservationRow]] = {}
    for item in kept:
        robot = by_channel.get(round(item.channel_diameter, 9))
        if robot is None:
            raise InputError(
                f"{path}, row {item.row}, column channel_diameter_mm: {item.channel_diameter * 1e3:g}; allowed: the "
                f"channel of a robot that was given ({', '.join(f'{c * 1e3:g} mm' for c in sorted(by_channel))})"
            )
        _check_name(path, item, robot, robots)
        groups.setdefault(item.tail, []).append(item)
    _check_signs(path, observations, by_channel)
    _check_variety(path, observations)
    for name, column in (("forward_velocity", "forward_velocity_mm_s"), ("body_rate", "body_rate_Hz")):
        known = [item for item in observations if np.isfinite(getattr(item, name))]
        if known and all(getattr(item, name) == 0.0 for item in known):
            raise InputError(
                f"{path}, row {known[0].row}, column {column}: 0, as in all rows; allowed: what was observed, or an "
                "empty column where it was not"
            )
    items = list(groups.values())
    channels = tuple(sorted({group[0].tail[0] for group in items}))
    for group in items:
        _check_direction(path, group)
    ratios = [_ratios(path, group, by_channel[group[0].tail[0]].hand) for group in items]
    speeds = [item for item in observations if np.isfinite(item.forward_velocity)]
    if speeds and not any(np.isfinite(seen.advance.mean) for seen in ratios):
        raise InputError(
            f"{path}, row {speeds[0].row}, column tail_rate_Hz: empty, as in all rows with a speed; allowed: "
            "tail_rate_Hz or motor_rate_Hz beside each speed, which is compared per rate"
        )
    table = observation_table(path)
    return Experiment(
        robots=tuple(
            with_tail(by_channel[group[0].tail[0]], group[0].wavelength, group[0].amplitude) for group in items
        ),
        channels=channels,
        channel=np.array([channels.index(group[0].tail[0]) for group in items]),
        observed=tuple(map(tuple, items)),
        advance=_ratio([found.advance for found in ratios]),
        by_motor=np.array([found.by_motor for found in ratios]),
        turning=_ratio([found.turning for found in ratios]),
        motor_rate=_ratio([found.motor_rate for found in ratios]),
        tail_rate=np.array([found.tail_rate for found in ratios]),
        correlation=_correlation([(found.advance.values, found.turning.values) for found in ratios]),
        source=path.name,
        sha256=hashlib.sha256(read_bytes(path, "an observations file", LARGEST_TABLE)).hexdigest(),
        synthetic="synthetic" in " ".join(table.comments).lower(),
        doubts=(
            *unread_columns(table),
            *convention_doubt(all_rates(observations)),
            *copies,
        ),
        outliers=_outlying_trials(items, [(found.advance.values, found.turning.values) for found in ratios]),
    )


def robots_by_channel(robots: Sequence[Robot], allowed: str, use: str) -> dict[float, Robot]:
    """Robots by the diameters of their channels, m, one for each; `allowed` are robots for a `use` of the channels."""
    found: dict[float, Robot] = {}
    for robot in robots:
        if robot.channel is None:
            raise InputError(f"robot {robot.name} has no channel; allowed: {allowed}")
        other = found.setdefault(round(robot.channel.diameter, 9), robot)
        if other is not robot:
            raise InputError(
                f"robots {other.name} and {robot.name} have the same channel.diameter = "
                f"{robot.channel.diameter * 1e3:g} mm, {use}; allowed: one robot for each channel"
            )
    return found


def _check_name(path: Path, item: ObservationRow, robot: Robot, robots: Sequence[Robot]) -> None:
    """A row that names one of the robots must match its channel; any other name is the user's own."""
    if item.robot != robot.name and any(item.robot == other.name for other in robots):
        raise InputError(
            f"{path}, row {item.row}, column robot: '{item.robot[:40]}', but its channel of "
            f"{item.channel_diameter * 1e3:g} mm is that of {robot.name}; allowed: a name and a channel that agree"
        )


def _check_signs(path: Path, observations: Sequence[ObservationRow], by_channel: Mapping[float, Robot]) -> None:
    """A tail turns in the sense in which it is driven, and the body against it."""
    for robot in by_channel.values():
        items = [item for item in observations if by_channel[round(item.channel_diameter, 9)] is robot]
        check_driven(path, items, robot)
        sense = -driven_sense(robot)
        allowed = f"{'positive' if sense > 0 else 'negative'}, for the body turns against the "
        check_signs(path, items, ["body_rate_Hz"], sense, f"{allowed}{robot.tail.handedness}-handed tail")


def _check_variety(path: Path, observations: Sequence[ObservationRow]) -> None:
    """Speeds that are all equal were not measured, but those of one tail that are read to a digit or two."""
    rows = [item for item in observations if np.isfinite(item.forward_velocity)]
    if len(rows) < _FEWEST_EQUAL or len({item.forward_velocity for item in rows}) > 1:
        return
    digits = len(f"{1e3 * rows[0].forward_velocity:.9e}".rpartition("e")[0].rstrip("0").replace(".", "").lstrip("-"))
    if len({item.tail for item in rows}) >= _FEWEST_EQUAL or digits >= _FEWEST_EQUAL:
        raise InputError(
            f"{path}, {rows_in_words(item.row for item in rows)}, column forward_velocity_mm_s: all are "
            f"{1e3 * rows[0].forward_velocity:g}; allowed: measured values, which differ"
        )


def _check_direction(path: Path, items: Sequence[ObservationRow]) -> None:
    """A trial that swims in the direction opposite to all others of its tail, and no less fast, has a wrong sign."""
    speeds = np.array([item.forward_velocity for item in items])
    for place, speed in enumerate(speeds.tolist()):
        others = np.delete(speeds, place)
        others = others[np.isfinite(others)]
        if others.size == 0 or np.ptp(np.sign(others)) > 0:
            continue
        typical = float(np.median(others))
        if abs(speed) > 0.5 * abs(typical):
            allowed = f"the same sign as the other trials of its tail, which swim at {1e3 * typical:.4g}"
            check_signs(path, items, ["forward_velocity_mm_s"], float(np.sign(typical)), allowed)


@dataclass(frozen=True)
class _Trials:
    """Values of one quantity of one robot, trial by trial, or a mean with its standard error."""

    values: Samples
    mean: float
    trials: int
    squares: float
    freedom: float
    stated: float = float("nan")  #: Relative standard error of one trial, root mean square over those that state one.

    @property
    def is_near_zero(self) -> bool:
        """Whether the mean is compatible with 0, by the scatter of the trials or their stated errors."""
        error = np.sqrt(self.squares / self.freedom) if self.freedom else self.stated * abs(self.mean)
        return bool(abs(self.mean) * np.sqrt(self.trials) <= _NEAR_ZERO * error)


@dataclass(frozen=True)
class _Seen:
    advance: _Trials
    by_motor: bool
    turning: _Trials
    motor_rate: _Trials
    tail_rate: float


def _ratios(path: Path, items: Sequence[ObservationRow], hand: float) -> _Seen:
    velocity, tail, body, motor = (
        np.array([getattr(item, name) for item in items])
        for name in ("forward_velocity", "tail_rate", "body_rate", "motor_rate")
    )
    tail = np.where(np.isnan(tail), motor + body, tail)
    body = np.where(np.isnan(body), tail - motor, body)
    by_motor = not np.any(np.isfinite(tail) & np.isfinite(velocity))
    if len(items) == 1 and items[0].trials > 1:
        found = _of_a_mean(items[0], velocity[0], tail[0], body[0], motor[0], by_motor=by_motor)
    else:
        halves = np.array([item.intervals for item in items]).T
        of_one = np.where([item.motor_derived for item in items], np.fmax(*halves[1:3]), np.nan)
        halves[3] = np.where(np.isnan(halves[3]), of_one, halves[3])
        with np.errstate(divide="ignore", invalid="ignore"):
            u, w, b, m = halves / NORMAL / np.abs((velocity, tail, body, motor))
        found = _Seen(
            _of_trials(velocity / (motor if by_motor else tail), u, m if by_motor else w),
            by_motor,
            _of_trials(body / tail, b, w),
            _of_trials(motor, m),
            _of_trials(tail).mean,
        )
    if found.advance.mean * hand <= 0 and not found.advance.is_near_zero:
        raise InputError(
            f"{path}, {rows_in_words(item.row for item in items)}, column forward_velocity_mm_s: the mean is "
            "backwards; allowed: a robot that swims the way that its tail drives"
        )
    return found


def _of_trials(values: Samples, *relative: Samples) -> _Trials:
    """Mean and scatter of trials."""
    known = values[np.isfinite(values)]
    if known.size == 0:
        return _Trials(values, float("nan"), 0, 0.0, 0.0)
    mean = float(known.mean())
    parts = np.square(np.reshape(relative, (-1, values.size))[:, np.isfinite(values)])
    is_stated = np.isfinite(parts)  # a part that states none adds nothing
    stated = parts.sum(axis=0, where=is_stated)[is_stated.any(axis=0)]
    error = float(np.sqrt(stated.mean())) if stated.size else float("nan")
    return _Trials(values, mean, known.size, float(((known - mean) ** 2).sum()), known.size - 1.0, error)


def _of_a_mean(
    item: ObservationRow, velocity: float, tail: float, body: float, motor: float, *, by_motor: bool
) -> _Seen:
    """A row that is a mean over trials: its interval gives the trials' scatter back (Student's t)."""
    count = item.trials
    quantile = student_t_quantile(0.975, count - 1)
    u, w, b, m = (half * np.sqrt(count) / quantile for half in item.intervals)  # standard deviations of a trial
    rate, of_rate = (motor, m) if by_motor else (tail, w)

    def trials(value: float, *relative: float) -> _Trials:
        known = [part for part in relative if np.isfinite(part)]
        freedom = count - 1.0 if known and np.isfinite(value) else 0.0
        squares = freedom * value**2 * sum(part**2 for part in known) if freedom else 0.0
        return _Trials(np.full(1, np.nan), value, count if np.isfinite(value) else 0, squares, freedom)

    return _Seen(
        trials(velocity / rate, u / abs(velocity), of_rate / abs(rate)),
        by_motor,
        trials(body / tail, b / abs(body) if body else np.nan, w / abs(tail)),
        trials(motor, m / abs(motor)),
        float(tail),
    )


def _ratio(found: Sequence[_Trials]) -> Ratio:
    mean = np.array([item.mean for item in found])
    size = np.abs(mean)
    least = _FLOOR * float(np.median(size[np.isfinite(size)])) if np.any(np.isfinite(size)) else 1.0
    scale = np.where(np.isfinite(size), np.maximum(size, least), 1.0)
    return Ratio(
        mean=mean,
        trials=np.array([float(item.trials) for item in found]),
        scale=scale,
        squares=np.array([item.squares for item in found]) / scale**2,
        freedom=np.array([item.freedom for item in found]),
        stated=np.array([item.stated for item in found]) * size / scale,
    )


_FAR_OFF = 8.0  # robust standard deviations, pooled over all trials, beyond which a trial is an outlier
_LEAST_OFF = 0.15  # relative deviation below which no trial is an outlier
_FEWEST_TRIALS = 3
_CHECKED_COLUMNS = ("forward_velocity_mm_s", "body_rate_Hz")


def _outlying_trials(
    groups: Sequence[Sequence[ObservationRow]], ratios: Sequence[tuple[Samples, Samples]]
) -> tuple[Note, ...]:
    """A sentence for each row whose advance or turning is an outlier among the trials of its tail."""
    found: list[Note] = []
    for number, column in enumerate(_CHECKED_COLUMNS):
        deviations = [_deviations(own[number]) for own in ratios]
        known = np.concatenate([own[np.isfinite(own)] for own in deviations]) if deviations else np.empty(0)
        if known.size == 0:
            continue
        scale = float(mad_scale(known))
        for group, own in zip(groups, deviations, strict=True):
            for item, off in zip(group, own.tolist(), strict=False):
                if np.isfinite(off) and abs(off) > max(_FAR_OFF * scale, _LEAST_OFF):
                    found.append(
                        Note.named("outlying-trial", row=item.row, column=column, times=1.0 + off, fields=(column,))
                    )
    return tuple(found)


def _deviations(values: Samples) -> Samples:
    """Relative deviation of each trial from the median; NaN where there are too few."""
    known = values[np.isfinite(values)]
    if known.size < _FEWEST_TRIALS or np.median(known) == 0:
        return np.full(values.shape, np.nan)
    return values / np.median(known) - 1.0


_FEWEST_PAIRS = 10


def _correlation(pairs: Sequence[tuple[Samples, Samples]]) -> float:
    """Correlation of both ratios' relative deviations within robots, pooled; 0 where too few trials have both."""
    sums = np.zeros(3)
    freedom = 0
    for first, second in pairs:
        both = np.isfinite(first) & np.isfinite(second)
        if np.count_nonzero(both) < 2:
            continue
        a, b = first[both], second[both]
        x, y = (a - a.mean()) / abs(a.mean()), (b - b.mean()) / abs(b.mean())
        sums += np.array([np.sum(x * x), np.sum(y * y), np.sum(x * y)])
        freedom += int(both.sum()) - 1
    if freedom < _FEWEST_PAIRS or sums[0] <= 0 or sums[1] <= 0:
        return 0.0
    return float(np.clip(sums[2] / np.sqrt(sums[0] * sums[1]), -0.95, 0.95))
