"""Integration of a free robot's motion in time, with its events.

The gap, dry friction and the motor's current are stiff: csrc/stiff_steps.c takes linearly implicit steps.
Samples and events lie inside them on the method's continuous output, so that a step is as long as the motion allows.
A run keeps the beginning of its last step: continued from there, it is the longer run to rounding.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.dynamics.free_robot import FreeRobot
from spirillum.dynamics.timing import Switch
from spirillum.errors import InputError
from spirillum.kernels import core
from spirillum.progress import Progress, tell

_LITTLE_WORK = 1e-3  # of a robot that only sinks over that of a drive
_STEPS = 64  # between two signs of life
_FIRST = 1e-4  # first step over the time of a turn
RANGE_LEFT = "the range of the robot's table"  #: How the event of a robot that tilts beyond its table begins.
END_OF_CHANNEL = "end of the channel"  #: Event of a robot whose nose or tail reaches the end of its channel.
_STUCK = "no step is small enough"
INTERRUPTED = "interrupted"  #: The event of a run that was interrupted, which keeps what was done.
BATTERY_EMPTY = "battery empty"  #: Event after which the battery drives no longer.


class Event(NamedTuple):
    """Events of a run and their times, s."""

    time: float
    what: str


class Reach(NamedTuple):
    """Limits that end a run or its drive; by default there are none."""

    nose: float = 0.0  #: Position of the nose's tip on the motor axis, m.
    tip: float = 0.0  #: Position of the tail's tip, m.
    channel: float = np.inf  #: Half the channel's length, m; infinite without one.
    middle: float = 0.0  #: Position of the channel's middle, m.
    charge: float = np.inf  #: Charge of the battery, A s; infinite without a rating.


class Checkpoint(NamedTuple):
    """Where a run can be continued exactly."""

    time: float  #: Beginning of its last step, s.
    step: float  #: Length of that step, s.
    state: tuple[float, ...]  #: The state there, (19,).


@dataclass(frozen=True)
class Trajectory:
    """A run at its samples; SI."""

    time: Samples  #: s, (n,).
    duty: Samples  #: Duty of the drive up to each sample, (n,).
    states: Samples  #: States, `State` of csrc/links.h, (n, 19).
    observed: Samples  #: What is observed in them (n, 13), or (n, 31) in a tube.
    events: tuple[Event, ...]  #: What happened, in the order of time.
    last: Checkpoint

    def require_completion(self) -> Trajectory:
        """Return the run; raise KeyboardInterrupt or InputError where it was interrupted or could not be followed."""
        what = self.events[-1].what if self.events else ""
        if what == INTERRUPTED:
            raise KeyboardInterrupt
        if what.startswith(_STUCK):
            raise InputError(
                f"{what}: weight, field or motor move it far faster than the tail turns; allowed: body.mass, "
                "magnetic.moment, magnetic.field, motor.inductance and fluid.viscosity nearer to each other"
            )
        return self


@dataclass
class Steps:
    """A motion step by step: its state, and what the integrator keeps of the last step, see `stiff_steps`."""

    state: Samples
    memory: Samples
    gaps: Samples
    before: Samples  #: The state at the beginning of the last step.
    increments: Samples
    jacobian: Samples

    @classmethod
    def of(cls, robot: FreeRobot, state: Samples, time: float, step: float) -> Steps:
        """From a state at a time, s, by a first step of that length, s."""
        memory = np.zeros(core.MEMORY_SIZE)
        memory[[core.MEMORY_TIME, core.MEMORY_LAST_TIME]] = time
        memory[[core.MEMORY_STEP, core.MEMORY_LAST_STEP]] = step
        gaps = np.ones(robot.gap_count + core.WATCHED)
        return cls(state, memory, gaps, state.copy(), np.zeros((8, core.STATE_SIZE)), np.zeros((8, 8)))

    @property
    def time(self) -> float:
        """Where it is now, s."""
        return float(self.memory[core.MEMORY_TIME])

    @property
    def last(self) -> Checkpoint:
        """The beginning of the last step."""
        time, step = self.memory[[core.MEMORY_LAST_TIME, core.MEMORY_LAST_STEP]].tolist()
        return Checkpoint(time, step, tuple(self.before.tolist()))


def integrate(
    robot: FreeRobot,
    start: Samples | Checkpoint,
    time: Samples,
    switches: Sequence[Switch],
    reach: Reach,
    progress: Progress | None = None,
) -> Trajectory:
    """Integrate a robot's motion, to the end of tube or table, or an interrupt; a spent battery drives no longer."""
    end = float(time[-1])
    going_on = isinstance(start, Checkpoint)
    begun = start if isinstance(start, Checkpoint) else Checkpoint(float(time[0]), first_step(robot), tuple(start))
    run = Steps.of(robot, np.array(begun.state, dtype=float), begun.time, begun.step)
    pieces: list[tuple[Samples, Samples, float]] = []
    events: list[Event] = []

    def reached(moment: float) -> None:
        tell(progress, "motion", int(1000 * (min(moment, end) - begun.time) / (end - begun.time)), 1000)

    spent = False
    if not going_on:
        pieces.append((time[:1], run.state[None].copy(), _duty(switches, float(time[0]))))
    after = time[1:] if not going_on else time[time > time[0]]
    stops = sorted({s.time for s in switches} | set(robot.bends.tolist()))
    while run.time < end:
        duty = 0.0 if spent else _duty(switches, run.time)
        later = bisect_right(stops, run.time)
        stop = stops[later] if later < len(stops) else np.inf
        inside = after[(after > run.time) & (after <= stop)] if not going_on else after[after <= stop]
        going_on = False
        limits = watched_limits(robot, reach, spent=spent)
        here = robot.at_duty(duty).between(run.time, stop)
        times, states, what = _stretch(here, run, limits, inside, stop, end, events, reached)
        pieces.append((times, states, duty))
        if what == BATTERY_EMPTY:
            spent = True
        elif what:
            break
    observed = [
        robot.at_duty(duty).between(float(times[0]), float(times[-1])).observe(times, states)
        for times, states, duty in pieces
        if times.size
    ]
    times, states = (np.concatenate([piece[place] for piece in pieces]) for place in (0, 1))
    duties = np.concatenate([np.full(inside.size, duty) for inside, _, duty in pieces])
    switched = [Event(s.time, f"duty {s.duty:g}") for s in switches if times[0] <= s.time <= times[-1]]
    happened = tuple(sorted([*switched, *events], key=lambda event: event.time))
    return Trajectory(times, duties, states, np.concatenate(observed), happened, run.last)


def first_step(robot: FreeRobot) -> float:
    """Length of the first step, s."""
    return _FIRST * robot.turn


def run_sizes(robot: FreeRobot) -> Samples:
    """`FreeRobot.step_sizes` of a run, whose works may be those of a robot that only sinks."""
    sizes = robot.step_sizes()
    sizes[core.STATE_DRIVEN : core.STATE_SIZE] *= _LITTLE_WORK
    return sizes


def _duty(switches: Sequence[Switch], time: float) -> float:
    return switches[bisect_right(switches, time, key=lambda switch: switch.time) - 1].duty


def _stretch(
    robot: FreeRobot,
    run: Steps,
    limits: Samples,
    inside: Samples,
    stop: float,
    end: float,
    events: list[Event],
    reached: Callable[[float], None],
) -> tuple[Samples, Samples, str]:
    """A run between two switchings: its moments, its states, and what ended it early, or nothing."""
    data = robot.data
    outside = float(robot.observe_state(run.state)[core.SEEN_OUTSIDE]) if robot.table.size else 0.0
    core.watched(run.state, outside, data, robot.table, limits, robot.roughness, run.gaps)
    states = np.empty((inside.size, core.STATE_SIZE))
    sizes, done = run_sizes(robot), 0
    target, what = min(stop, end), ""
    try:
        while True:
            watched = run.gaps.copy()
            status = core.advance(
                target, stop <= end, _STEPS, robot.tolerance, run.memory, run.state, run.before, run.increments,
                run.jacobian, run.gaps, inside[done:], states[done:], sizes, limits, robot.roughness, data,
                robot.table,
            )  # fmt: skip
            done += int(run.memory[core.MEMORY_ANSWERED])
            reached(run.time)
            if status == core.CROSSED:
                what = _crossed(robot, run, data, limits, watched, target, events)
                if what:
                    done = int(np.count_nonzero(inside[:done] <= run.time))
                    break
            elif status == core.STUCK:
                what = f"{_STUCK}: the motion cannot be followed beyond t = {run.time:.6g} s"
                events.append(Event(run.time, what))
                break
            elif status == core.DONE:
                break
    except KeyboardInterrupt:
        what = INTERRUPTED
        events.append(Event(run.time, what))
    times, states = inside[:done], states[:done]
    if what and what != BATTERY_EMPTY and not (times.size and times[-1] == run.time):
        times, states = np.append(times, run.time), np.concatenate([states, run.state[None]])
    return times, states, what


def _crossed(
    robot: FreeRobot, run: Steps, data: Samples, limits: Samples, watched: Samples, end: float, events: list[Event]
) -> str:
    """Note what happened in the last step; what ends the stretch, with the state where it does, or nothing."""
    begin, step, _ = run.last
    length = run.time - begin
    new, inner, gaps = run.state.copy(), np.empty(core.STATE_SIZE), np.empty_like(run.gaps)
    dy = np.empty(core.STATE_SIZE)

    def at(index: int, share: float) -> float:
        core.interpolate(share, run.before, new, run.increments, inner)
        outside = 0.0
        if index == gaps.size - core.WATCHED + core.WITHIN:
            core.rates(dy, begin + share * length, inner, data, robot.table)
            outside = float(data[core.SEEN_OUTSIDE])
        core.watched(inner, outside, data, robot.table, limits, robot.roughness, gaps)
        return float(gaps[index])

    crossed = np.flatnonzero((watched > 0) != (run.gaps > 0)).tolist()
    found = [(_crossing(partial(at, index)), index) for index in crossed]
    sites = robot.gap_count
    for share, index in sorted(found):
        moment = begin + share * length
        if moment > end:
            break
        if index < sites:
            events.append(Event(moment, robot.contact_event(index, touches=bool(watched[index] > 0))))
            continue
        at(index, share)
        if index == sites + core.CHARGE_LEFT:
            what = BATTERY_EMPTY
        elif index == sites + core.ROOM:
            what = END_OF_CHANNEL
        else:
            what = robot.range_message(inner, moment)
        run.state[:] = inner
        run.memory[core.MEMORY_TIME] = moment
        run.memory[core.MEMORY_STEP] = step
        events.append(Event(moment, what))
        return what
    return ""


def _crossing(value: Callable[[float], float]) -> float:
    """Share of a step at which what changes its sign within has done so."""
    from scipy.optimize import brentq

    first, last = value(0.0), value(1.0)
    if (first > 0) == (last > 0):  # it touches zero at an end
        return 0.0 if first == 0.0 else 1.0
    share = float(brentq(value, 0.0, 1.0, xtol=1e-15, rtol=1e-15)) if first and last else 1.0
    while share < 1.0 and (value(share) > 0) == (first > 0):
        share = min(1.0, share + 2e-15)
    return share


def watched_limits(robot: FreeRobot, reach: Reach, *, spent: bool = False) -> Samples:
    """Where tube and battery end, `Limits` of csrc/motion.h; a spent battery ends no more."""
    found = np.empty(core.LIMITS_SIZE)
    found[core.LIMITS_CHANNEL], found[core.LIMITS_MIDDLE] = reach.channel, reach.middle
    found[core.LIMITS_NOSE], found[core.LIMITS_TIP] = reach.nose, reach.tip
    motor = robot.drive[core.DRIVE_KIND] == core.MOTOR
    found[core.LIMITS_MOST_CHARGE] = reach.charge if motor and not spent else np.inf
    return found
