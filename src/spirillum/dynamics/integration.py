"""Integration of a free robot's motion in time, with what happens on the way.

The equations are those of `spirillum.kernels.two_links`; CyRK integrates them by Tsitouras' steps of order 5 (the
motor's L/R bounds the step, not the path) and finds the events.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.dynamics.acting import state_sizes
from spirillum.dynamics.remote import Switch
from spirillum.dynamics.two_links import TwoLinks
from spirillum.errors import InputError
from spirillum.kernels import rigid_links
from spirillum.kernels import two_links as kernel

TOLERANCE = 1e-8
"""Relative tolerance of a step."""
BATTERY_EMPTY = "battery empty"
"""Event after which the battery drives no longer."""
INTEGRATOR = f"CyRK Tsit5, relative tolerance {TOLERANCE:g}"
_STEPS_PER_SAMPLE, _STEPS_AT_LEAST = 400, 100_000
_BREATH = 512  # steps between two signs of life

Progress = Callable[[str, int, int], None]


class Event(NamedTuple):
    """Something that happened in a run."""

    time: float
    """s."""
    what: str
    """In words."""


class Reach(NamedTuple):
    """What ends a run, or its drive."""

    nose: float
    """Place of the nose's tip on the motor axis, m."""
    tip: float
    """Place of the tail's tip, m."""
    channel: float
    """Half the channel's length, m; infinite without one."""
    middle: float
    """Place of the channel's middle, m."""
    charge: float
    """Charge of the battery, A s; infinite without a rating."""


@dataclass(frozen=True)
class Trajectory:
    """A run at its samples; SI."""

    time: Samples
    """s, (n,)."""
    duty: Samples
    """Duty of the drive up to each sample, (n,)."""
    states: Samples
    """States, see `spirillum.kernels.two_links` (n, 17)."""
    observed: Samples
    """What `spirillum.kernels.two_links` observes (n, 13)."""
    events: tuple[Event, ...]
    """What happened, in the order of time."""


class _Watch:
    """An event for the integrator: a function of the state that crosses zero."""

    direction = 0

    def __init__(self, what: str, value: Callable[[Samples], Any], *, last: bool) -> None:
        self.what, self.value = what, value
        self.terminal = 1 if last else 0

    def __call__(self, _time: float, y: Samples, _data: Samples) -> float:
        return float(self.value(y))


def integrate(
    links: TwoLinks,
    start: Samples,
    time: Samples,
    switches: Sequence[Switch],
    reach: Reach,
    progress: Progress | None = None,
) -> Trajectory:
    """Integrate a robot's motion.

    The run ends early where nose or tail reach the end of the channel; a spent battery drives no longer.

    Args:
        links: the robot.
        start: state at the first sample, (17,).
        time: increasing sample times, s.
        switches: every switching, the first at the first sample.
        reach: what ends the run, or its drive.
        progress: told what is being computed, how many stretches are done, and of how many.
    """
    blocks = [_observed(links.at_duty(switches[0].duty), time[:1], start[None])]
    times, states, duties = [time[:1]], [start[None]], [np.full(1, switches[0].duty)]
    events: list[Event] = []
    state, pending, end = start, list(switches), float(time[-1])
    spent = False
    now = float(time[0])

    def tell(moment: float) -> None:
        if progress is not None:
            progress("motion", int(1000 * moment / end), 1000)

    while now < end:
        if len(pending) > 1 and pending[1].time <= now:
            pending.pop(0)
            continue
        duty = 0.0 if spent else pending[0].duty
        stop = min(pending[1].time, end) if len(pending) > 1 else end
        here = links.at_duty(duty)
        inside = time[(time > now) & (time <= stop)]
        stretch = _stretch(here, state, now, stop, inside, _limits(here, reach, spent=spent), tell)
        events += stretch.events
        kept = inside[: len(stretch.states)]
        times.append(kept)
        states.append(stretch.states)
        duties.append(np.full(kept.size, duty))
        blocks.append(_observed(here, kept, stretch.states))
        now, state = stretch.end, stretch.last
        tell(now)
        if stretch.ended:
            events.append(Event(now, stretch.ended))
        if stretch.ended == BATTERY_EMPTY:
            spent = True
        elif stretch.ended:
            times.append(np.array([now]))
            states.append(state[None])
            duties.append(np.full(1, duty))
            blocks.append(_observed(here, np.array([now]), state[None]))
            break
    joined = np.concatenate(times)
    first = np.concatenate([[True], np.diff(joined) > 0])
    switched = [Event(s.time, f"duty {s.duty:g}") for s in switches if s.time <= joined[-1]]
    happened = tuple(sorted([*switched, *events], key=lambda event: event.time))
    return Trajectory(
        joined[first],
        np.concatenate(duties)[first],
        np.concatenate(states)[first],
        np.concatenate(blocks)[first],
        happened,
    )


_END = "end of the channel"
_FILM = "film as thin as the roughness"


class _Stretch(NamedTuple):
    """A run between two switchings."""

    states: Samples
    """At the samples up to where it ended."""
    end: float
    last: Samples
    """The end, and the state there."""
    ended: str
    """What ended it early, or nothing."""
    events: list[Event]


def _limits(links: TwoLinks, reach: Reach, *, spent: bool) -> list[_Watch]:
    """What ends a stretch: positive before, negative beyond."""
    found = []
    if np.isfinite(reach.channel):

        def room(y: Samples) -> Samples:
            w, i, j, k = y[rigid_links.ATTITUDE : rigid_links.ATTITUDE + 4]
            along = 1.0 - 2.0 * (j * j + k * k) / (w * w + i * i + j * j + k * k)
            x = y[rigid_links.POSITION] - reach.middle
            return np.asarray(reach.channel - np.maximum(x + reach.nose * along, -x - reach.tip * along))

        found.append(_Watch(_END, room, last=True))
    if np.isfinite(reach.charge) and links.drive[rigid_links.KIND] == rigid_links.MOTOR and not spent:
        found.append(_Watch(BATTERY_EMPTY, lambda y: reach.charge - y[rigid_links.CHARGE], last=True))
    return found


class _Film(_Watch):
    """Where the robot comes as near to the wall as its roughness, or leaves it.

    Without a wall it never happens, but the integrator comes by at every step: a sign of life for who waits, and a
    chance for Python to see that somebody interrupts.
    """

    def __init__(self, links: TwoLinks, tell: Callable[[float], None]) -> None:
        super().__init__(_FILM, float, last=False)
        self._wall, self._spots, self._rough = links.wall, links.spots, float(links.wall[kernel.ROUGHNESS])
        self._tell, self._calls, self._walled = tell, 0, links.spots.size > 0

    def __call__(self, time: float, y: Samples, _data: Samples) -> float:
        self._calls += 1
        if self._calls % _BREATH == 0:
            self._tell(time)
        return kernel.thinnest_film(y, self._wall, self._spots) - self._rough if self._walled else 1.0


def _stretch(
    links: TwoLinks,
    state: Samples,
    start: float,
    stop: float,
    samples: Samples,
    limits: Sequence[_Watch],
    tell: Callable[[float], None],
) -> _Stretch:
    """Integrate between two switchings; limits are watched only where they are passed, for watching costs time."""
    at = samples if samples.size and samples[-1] == stop else np.append(samples, stop)
    watches: list[_Watch] = [_Film(links, tell)]
    solved = _solved(links, state, at, start, watches)
    y = _states(solved)
    passed = [limit for limit in limits if np.any(limit.value(y.T) < 0)]
    if passed:
        watches += passed
        solved = _solved(links, state, at, start, watches)
        y = _states(solved)
    found = [
        (float(t), watch, np.array(row))
        for watch, times, rows in zip(watches, solved.t_events or (), solved.y_events or (), strict=True)
        for t, row in zip(times, np.asarray(rows).reshape(-1, rigid_links.STATES), strict=True)
    ]
    end, what, last = min(
        ((t, watch.what, row) for t, watch, row in found if watch.terminal),
        key=lambda event: event[0],
        default=(stop, "", state if y.shape[0] == 0 else y[-1]),
    )
    events = [Event(t, watch.what) for t, watch, _ in found if not watch.terminal and t <= end]
    return _Stretch(y[: np.count_nonzero(samples <= end)], end, last, what, events)


def _states(solved: Any) -> Samples:
    return np.ascontiguousarray(np.asarray(solved.y).T)


def _solved(links: TwoLinks, state: Samples, at: Samples, start: float, watches: Sequence[_Watch]) -> Any:
    from CyRK import pysolve_ivp

    solved: Any = pysolve_ivp(
        kernel.rates,
        (start, float(at[-1])),
        np.ascontiguousarray(state),
        method="Tsit5",
        t_eval=at,
        events=tuple(watches),
        args=(links.data,),
        rtol=_tolerances(links),
        atol=1e-3 * TOLERANCE * state_sizes(links.drive, links.length, links.torque, rigid_links.STATES),
        max_num_steps=_STEPS_AT_LEAST + _STEPS_PER_SAMPLE * at.size,
        pass_dy_as_arg=True,
    )
    if not solved.success:
        reached = float(solved.t[-1]) if solved.t.size else start
        raise InputError(
            f"the motion cannot be followed beyond t = {reached:.4g} s in {_STEPS_AT_LEAST} steps and "
            f"{_STEPS_PER_SAMPLE} a sample: weight, field or motor move it far faster than the tail turns; allowed: "
            "body.mass, magnetic.moment, magnetic.field, motor.inductance and fluid.viscosity nearer to each other"
        )
    return solved


def _tolerances(links: TwoLinks) -> Samples:
    """Relative tolerances of the state's components, (17,): finer for place and attitude where a film hangs on them."""
    found = np.full(rigid_links.STATES, TOLERANCE)
    if links.spots.size:
        found[: rigid_links.PHASE] *= 1e-3
    return found


def _observed(links: TwoLinks, time: Samples, states: Samples) -> Samples:
    out = np.empty((time.size, rigid_links.OBSERVED))
    kernel.observe(time, np.ascontiguousarray(states), links.data, out)
    return out
