"""Steps in time of a free robot by the linearly implicit method of `rosenbrock`, compiled.

Only place across the tube, attitude, tail phase and current act back on the rates: their columns of the Jacobian, by
finite differences, are all it has; flow and field change with time besides. A step needs no iteration and no memory but
its length, so that a run is continued exactly from the beginning of its last step. The rates are those of `tube_motion`
by the table of the robot in its tube, and with an empty table those of `two_links`.
"""

from __future__ import annotations

import math

import numpy as np

from spirillum.arrays import Samples
from spirillum.kernels.compiled import compiled
from spirillum.kernels.rigid_links import ATTITUDE, CHARGE, CURRENT, FILM, OUTSIDE, PHASE, POSITION, STATES, TAIL_GAP
from spirillum.kernels.rosenbrock import COEFFICIENTS, DENSE, GAMMA, NODES, STAGES, TIMES, WEIGHTS
from spirillum.kernels.tube_motion import gaps_of as gaps_in_tube
from spirillum.kernels.tube_motion import rates as rates_in_tube
from spirillum.kernels.two_links import gaps_of as films_of
from spirillum.kernels.two_links import rates as rates_without_walls

DONE, PAUSED, CROSSED, STUCK = 0, 1, 2, 3
"""The time was reached; the steps are used up; something watched has changed its sign in the last step; no step is
small enough."""

# What a run is watched for, behind the gaps less the roughness: room to the tube's end, charge left, the table's range.
ROOM, CHARGE_LEFT, INSIDE = 0, 1, 2
WATCHED = 3

# Where the tube and the battery end.
CHANNEL, MIDDLE, NOSE, TIP, MOST_CHARGE = 0, 1, 2, 3, 4
LIMITS = 5

# Memory between calls: time, length of the next step; time and length of the last step taken.
TIME, STEP, LAST_TIME, LAST_STEP = 0, 1, 2, 3
MEMORY = 4

_ACTING = np.array(
    [POSITION + 1, POSITION + 2, ATTITUDE, ATTITUDE + 1, ATTITUDE + 2, ATTITUDE + 3, PHASE, CURRENT], dtype=np.int64
)
_N = 8
_WIDER = 30.0  # steps of central differences over those of differences to one side
_SMALLEST = 1e-12  # step over the time that it would be without


@compiled
def rates(dy: Samples, time: float, y: Samples, data: Samples, table: Samples) -> None:
    """Write the time derivative of the state into `dy`, (19,)."""
    if table.size > 0:
        rates_in_tube(dy, time, y, data, table)
    else:
        rates_without_walls(dy, time, y, data)


@compiled
def watched(
    y: Samples, outside: float, data: Samples, table: Samples, limits: Samples, rough: float, gaps: Samples
) -> float:
    """Write what a run is watched for into `gaps`; the smallest gap."""
    sites = gaps.size - WATCHED
    if table.size > 0:
        gaps_in_tube(y, data, gaps)
    else:
        films_of(y, data, gaps)
    smallest = math.inf
    for c in range(sites):
        smallest = min(smallest, gaps[c])
        gaps[c] -= rough
    i, j, k, w = y[ATTITUDE + 1], y[ATTITUDE + 2], y[ATTITUDE + 3], y[ATTITUDE]
    along = 1.0 - 2.0 * (j * j + k * k) / (w * w + i * i + j * j + k * k)
    x = y[POSITION] - limits[MIDDLE]
    gaps[sites + ROOM] = limits[CHANNEL] - max(x + limits[NOSE] * along, -x - limits[TIP] * along)
    gaps[sites + CHARGE_LEFT] = limits[MOST_CHARGE] - y[CHARGE]
    gaps[sites + INSIDE] = 1.0 if outside == 0.0 else -1.0
    return smallest


@compiled
def _jacobian(
    time: float,
    y: Samples,
    f: Samples,
    sizes: Samples,
    data: Samples,
    table: Samples,
    jacobian: Samples,
    moved: Samples,
) -> None:
    """Columns of the derivative of the rates, (19, 8), and that in time, (19,), as the last."""
    near = _nearness(data, sizes)
    trial, other, back = moved[0], moved[1], np.empty(STATES)
    for i in range(STATES):
        trial[i] = y[i]
    for column in range(_N):
        at = _ACTING[column]
        step = sizes[at] * (1e-6 if at == CURRENT else 3e-7 * near)
        first, below = y[at], f
        if table.size == 0 and near < 1.0:  # a thin film, whose rates cost little and are smooth: central differences
            step *= _WIDER
            first, below = y[at] - step, back
            trial[at] = first
            rates(below, time, trial, data, table)
        trial[at] = y[at] + step
        step = trial[at] - first
        rates(other, time, trial, data, table)
        for i in range(STATES):
            jacobian[i, column] = (other[i] - below[i]) / step
        trial[at] = y[at]
    later = sizes[STATES]
    if later > 0.0:
        rates(other, time + later, y, data, table)
    for i in range(STATES):
        jacobian[i, _N] = (other[i] - f[i]) / later if later > 0.0 else 0.0


@compiled
def _nearness(data: Samples, sizes: Samples) -> float:
    """How much smaller than their sizes changes of place have to be where a gap is thin."""
    gap = min(data[FILM], data[TAIL_GAP])
    return float(min(1.0, max(100.0 * gap / sizes[POSITION], 1e-6)))


@compiled
def _factorised(a: Samples, order: Samples) -> None:
    """LU factors of an 8x8 matrix in place, with row exchanges."""
    for k in range(_N):
        best = k
        for i in range(k + 1, _N):
            if abs(a[i, k]) > abs(a[best, k]):
                best = i
        order[k] = best
        if best != k:
            for j in range(_N):
                a[k, j], a[best, j] = a[best, j], a[k, j]
        for i in range(k + 1, _N):
            a[i, k] /= a[k, k]
            for j in range(k + 1, _N):
                a[i, j] -= a[i, k] * a[k, j]


@compiled
def _backward(a: Samples, order: Samples, b: Samples) -> None:
    """Solve with the factors, in place."""
    for k in range(_N):
        best = int(order[k])
        b[k], b[best] = b[best], b[k]
    for i in range(_N):
        for j in range(i):
            b[i] -= a[i, j] * b[j]
    for i in range(_N - 1, -1, -1):
        for j in range(i + 1, _N):
            b[i] -= a[i, j] * b[j]
        b[i] /= a[i, i]


@compiled
def _stage(
    stage: int, step: float, f: Samples, jacobian: Samples, a: Samples, order: Samples, b: Samples, increments: Samples
) -> None:
    """The increment of one stage from the rates at its argument."""
    u, over = increments[stage], 1.0 / (GAMMA * step)
    for i in range(STATES):
        u[i] = f[i] + TIMES[stage] * step * jacobian[i, _N]
    for j in range(stage):
        c = COEFFICIENTS[stage, j] / step
        for i in range(STATES):
            u[i] += c * increments[j, i]
    for i in range(_N):
        b[i] = u[_ACTING[i]]
    _backward(a, order, b)
    for i in range(STATES):
        for j in range(_N):
            u[i] += jacobian[i, j] * b[j]
        u[i] /= over
    for i in range(_N):
        u[_ACTING[i]] = b[i]


@compiled
def _step(
    time: float,
    step: float,
    y: Samples,
    f: Samples,
    jacobian: Samples,
    data: Samples,
    table: Samples,
    increments: Samples,
    moved: Samples,
    new: Samples,
) -> None:
    """One step: the increments u_i, (8, 19), and the new state."""
    a, order, b = np.empty((_N, _N)), np.empty(_N), np.empty(_N)
    for i in range(_N):
        for j in range(_N):
            a[i, j] = -jacobian[_ACTING[i], j]
        a[i, i] += 1.0 / (GAMMA * step)
    _factorised(a, order)
    for i in range(STATES):
        moved[1, i] = f[i]
    for stage in range(STAGES):  # one call of `_stage`: a stage that is a literal is compiled apart
        for i in range(STATES):
            new[i] = y[i]
        for j in range(stage):
            for i in range(STATES):
                new[i] += WEIGHTS[stage, j] * increments[j, i]
        if stage > 0:
            rates(moved[1], time + NODES[stage] * step, new, data, table)
        _stage(stage, step, moved[1], jacobian, a, order, b, increments)
    for i in range(STATES):
        new[i] += increments[STAGES - 1, i]


@compiled
def _error(y: Samples, new: Samples, u: Samples, sizes: Samples, near: float, tolerance: float) -> float:
    """Largest error of a step over what is allowed; infinite if it is no number."""
    largest = 0.0
    for i in range(STATES):
        size = sizes[i]
        if i < PHASE and i != POSITION:
            size *= near
        elif i > CURRENT:
            size = max(size, abs(y[i]), abs(new[i]))
        share = abs(u[i]) / (tolerance * size)
        if not share <= 1e300:
            return math.inf
        largest = max(largest, share)
    return largest


@compiled
def interpolate(share: float, y: Samples, new: Samples, increments: Samples, out: Samples) -> None:
    """The state inside a step, of order 4, at a share of it from 0 to 1."""
    for i in range(STATES):
        k_1 = k_2 = k_3 = 0.0
        for j in range(STAGES):
            u = increments[j, i]
            k_1 += DENSE[0, j] * u
            k_2 += DENSE[1, j] * u
            k_3 += DENSE[2, j] * u
        out[i] = (1.0 - share) * y[i] + share * (new[i] + (1.0 - share) * (k_1 + share * (k_2 + share * k_3)))


@compiled
def _sampled(
    time: float,
    step: float,
    end: float,
    y: Samples,
    new: Samples,
    increments: Samples,
    samples: Samples,
    states: Samples,
) -> int:
    """Answer the samples inside a step; how many there are."""
    answered = 0
    while answered < samples.size and samples[answered] <= end:
        interpolate((samples[answered] - time) / step, y, new, increments, states[answered])
        answered += 1
    return answered


@compiled
def _replaced(gaps: Samples, by: Samples) -> bool:
    """Whether anything watched has changed its sign; the new values are kept."""
    crossed = False
    for c in range(gaps.size):
        crossed = crossed or ((by[c] > 0.0) != (gaps[c] > 0.0))
        gaps[c] = by[c]
    return crossed


@compiled
def advance(
    stop: float,
    clip: bool,  # noqa: FBT001 - compiled
    steps: int,
    tolerance: float,
    memory: Samples,
    y: Samples,
    before: Samples,
    increments: Samples,
    gaps: Samples,
    samples: Samples,
    states: Samples,
    sizes: Samples,
    limits: Samples,
    rough: float,
    data: Samples,
    table: Samples,
) -> tuple[int, int]:
    """Step on until a time, an event, or the number of steps is reached.

    Args:
        stop: where to stop, s.
        clip: whether a step ends there; else the last one may go beyond.
        steps: number of steps at most.
        tolerance: error of a step over the sizes.
        memory: time and step length, see the constants; changed.
        y: the state, (19,); changed.
        before: result, the state at the beginning of the last step.
        increments: result, those of the last step, (8, 19).
        gaps: what is watched, at `y`; changed.
        samples: increasing times, s: those in the steps taken are answered.
        states: result, the states at the samples, (n, 19).
        sizes: sizes of the state's components below which nothing matters, (19,); a small change of time, s (0:
            nothing depends on it); a time of the order of the run's, s.
        limits: where tube and battery end.
        rough: height of the asperities, m.
        data: from `packed` of `tube_motion` or `two_links`.
        table: the robot's table, (0,) for one without walls.

    Returns:
        One of `DONE`, `PAUSED`, `CROSSED`, `STUCK`, and the number of samples answered.
    """
    f, new, watch = np.empty(STATES), np.empty(STATES), np.empty(gaps.size)
    jacobian, moved = np.empty((STATES, _N + 1)), np.empty((2, STATES))
    answered = 0
    rates(f, memory[TIME], y, data, table)
    for _ in range(steps):
        time = memory[TIME]
        if time >= stop:
            return DONE, answered
        near = _nearness(data, sizes)
        _jacobian(time, y, f, sizes, data, table, jacobian, moved)
        trial, error = memory[STEP], math.inf
        while not error <= 1.0:
            clipped = clip and time + 1.0001 * trial >= stop
            taken = stop - time if clipped else trial
            _step(time, taken, y, f, jacobian, data, table, increments, moved, new)
            error = _error(y, new, increments[STAGES - 1], sizes, near, tolerance)
            end = stop if clipped else time + taken
            if error <= 1.0:
                rates(moved[0], end, new, data, table)
                if not watched(new, data[OUTSIDE], data, table, limits, rough, watch) > 0.0:
                    error = math.inf  # through the wall
            if not error <= 1.0:
                trial = taken * (max(0.2, 0.9 * error**-0.2) if math.isfinite(error) else 0.25)
                if trial < _SMALLEST * sizes[STATES + 1]:
                    return STUCK, answered
        memory[LAST_TIME], memory[LAST_STEP] = time, memory[STEP]
        grown = taken * min(5.0, 0.9 * max(error, 1e-10) ** -0.2)
        memory[TIME], memory[STEP] = end, max(grown, trial) if clipped else grown
        answered += _sampled(time, taken, end, y, new, increments, samples[answered:], states[answered:])
        for i in range(STATES):
            before[i], y[i], f[i] = y[i], new[i], moved[0, i]
        if _replaced(gaps, watch):
            return CROSSED, answered
    return PAUSED, answered
