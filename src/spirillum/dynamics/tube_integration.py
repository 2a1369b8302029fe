"""Integration of a robot's motion in its tube, with what happens on the way.

The gap, dry friction and the motor's current are stiff: `spirillum.kernels.tube_steps` takes linearly implicit steps.
Samples and events lie inside them on the method's continuous output, so that a step is as long as the motion allows.
A run keeps the beginning of its last step: continued from there, it is the longer run to rounding.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.dynamics.acting import state_sizes
from spirillum.dynamics.integration import BATTERY_EMPTY, Event, Progress, Reach, Trajectory
from spirillum.dynamics.remote import Switch
from spirillum.dynamics.tube_robot import TubeRobot
from spirillum.kernels import rigid_links, tube_motion, tube_steps, tube_table

TOLERANCE = 1e-7
"""Error of a step over the sizes of the state's components: path and place of a minute in contact are then good to some
parts in 1e7, energies to 1e-6; a tenth of it takes two and a half times as long."""
INTEGRATOR = f"Rodas5P, tolerance {TOLERANCE:g}"
_LITTLE_WORK = 1e-3  # of a robot that only sinks over that of a drive
_STEPS = 64  # between two signs of life
_FIRST = 1e-4  # first step over the time of a turn
_END = "end of the channel"
INTERRUPTED = "interrupted"
"""The event of a run that was interrupted, which keeps what was done."""


class Checkpoint(NamedTuple):
    """Where a run can be continued exactly."""

    time: float
    """Beginning of its last step, s."""
    step: float
    """Length of that step, s."""
    state: tuple[float, ...]
    """The state there, (19,)."""


@dataclass(frozen=True)
class TubeTrajectory(Trajectory):
    """A run in a tube at its samples; SI. States and what is observed: see `spirillum.kernels.tube_motion`."""

    last: Checkpoint
    """From where it can be continued."""


@dataclass
class _Run:
    """A run while it is computed."""

    robot: TubeRobot
    reach: Reach
    state: Samples
    memory: Samples
    gaps: Samples
    before: Samples
    increments: Samples = field(default_factory=lambda: np.zeros((8, tube_motion.STATES)))

    @property
    def time(self) -> float:
        return float(self.memory[tube_steps.TIME])


def integrate_in_tube(
    robot: TubeRobot,
    start: Samples | Checkpoint,
    time: Samples,
    switches: Sequence[Switch],
    reach: Reach,
    progress: Progress | None = None,
) -> TubeTrajectory:
    """Integrate a robot's motion in its tube.

    The run ends early where nose or tail reach the end of the tube, where a range of the table is left, or when it is
    interrupted; a spent battery drives no longer.

    Args:
        robot: the robot.
        start: state at the first sample, (19,), or the checkpoint of a run that ended there.
        time: increasing sample times, s.
        switches: every switching, the first not after the first sample.
        reach: what ends the run, or its drive.
        progress: told what is being computed, how much is done, and of how much.
    """
    end = float(time[-1])
    going_on = isinstance(start, Checkpoint)
    state = np.array(start.state if isinstance(start, Checkpoint) else start, dtype=float)
    memory = np.zeros(tube_steps.MEMORY)
    memory[tube_steps.TIME] = start.time if isinstance(start, Checkpoint) else time[0]
    memory[tube_steps.STEP] = start.step if isinstance(start, Checkpoint) else _FIRST * robot.turn
    memory[tube_steps.LAST_TIME], memory[tube_steps.LAST_STEP] = memory[tube_steps.TIME], memory[tube_steps.STEP]
    run = _Run(robot, reach, state, memory, np.ones(len(robot.names) + tube_steps.WATCHED), state.copy())
    pieces: list[tuple[Samples, Samples, float]] = []
    events: list[Event] = []
    first = run.time

    def tell(moment: float) -> None:
        if progress is not None:
            progress("motion", int(1000 * (min(moment, end) - first) / (end - first)), 1000)

    spent = False
    if not going_on:
        pieces.append((time[:1], state[None].copy(), _duty(switches, float(time[0]))))
    after = time[1:] if not going_on else time[time > time[0]]
    stops = sorted({s.time for s in switches} | {float(t) for t in robot.flow[:, 0]})
    while run.time < end:
        duty = 0.0 if spent else _duty(switches, run.time)
        later = bisect_right(stops, run.time)
        stop = stops[later] if later < len(stops) else np.inf
        inside = after[(after > run.time) & (after <= stop)] if not going_on else after[after <= stop]
        going_on = False
        stretch = _stretch(run, duty, stop, end, inside, spent=spent, tell=tell)
        events += stretch.events
        pieces.append((stretch.times, stretch.states, duty))
        if stretch.what == BATTERY_EMPTY:
            spent = True
        elif stretch.what:
            break
    return _joined(robot, pieces, events, switches, run)


def observed_at(robot: TubeRobot, state: Samples, time: float = 0.0) -> Samples:
    """What `spirillum.kernels.tube_motion` observes in one state, (26,)."""
    out = np.empty((1, tube_motion.OBSERVED))
    tube_motion.observe(np.array([time]), state[None], robot.data, robot.table, out)
    return np.asarray(out[0])


def _duty(switches: Sequence[Switch], time: float) -> float:
    return switches[bisect_right(switches, time, key=lambda switch: switch.time) - 1].duty


def _over(robot: TubeRobot, duty: float, start: float, stop: float) -> TubeRobot:
    """The robot at a duty, with what of the imposed flow matters from one time to another: few rows are copied."""
    times = robot.flow[:, 0]
    first = max(int(np.searchsorted(times, start, "right")) - 1, 0)
    return replace(robot.at_duty(duty), flow=robot.flow[first : int(np.searchsorted(times, stop, "left")) + 1])


class _Stretch(NamedTuple):
    """A run between two switchings."""

    times: Samples
    states: Samples
    events: list[Event]
    what: str
    """What ended it early, or nothing."""


def _stretch(
    run: _Run, duty: float, stop: float, end: float, inside: Samples, *, spent: bool, tell: Callable[[float], None]
) -> _Stretch:
    robot = _over(run.robot, duty, run.time, stop)
    data, limits = robot.data, watched_limits(robot, run.reach, spent=spent)
    tube_steps.watched(run.state, 0.0, data, limits, robot.roughness, run.gaps)
    states = np.empty((inside.size, tube_motion.STATES))
    sizes, done = step_sizes(robot), 0
    sizes[rigid_links.DRIVEN : tube_motion.STATES] *= _LITTLE_WORK
    events: list[Event] = []
    clip = stop <= end
    target, what = min(stop, end), ""
    try:
        while True:
            watched = run.gaps.copy()
            status, answered = tube_steps.advance(
                target, clip, _STEPS, TOLERANCE, run.memory, run.state, run.before, run.increments, run.gaps,
                inside[done:], states[done:], sizes, limits, robot.roughness, data, robot.table,
            )  # fmt: skip
            done += answered
            tell(run.time)
            if status == tube_steps.CROSSED:
                what = _crossed(run, robot, data, limits, watched, min(end, target), events)
                if what:
                    done = int(np.count_nonzero(inside[:done] <= run.time))
                    break
            elif status == tube_steps.STUCK:
                what = f"no step is small enough: the motion cannot be followed beyond t = {run.time:.6g} s"
                events.append(Event(run.time, what))
                break
            elif status == tube_steps.DONE:
                break
    except KeyboardInterrupt:
        what = INTERRUPTED
        events.append(Event(run.time, what))
    times, states = inside[:done], states[:done]
    if what and what != BATTERY_EMPTY and not (times.size and times[-1] == run.time):
        times, states = np.append(times, run.time), np.concatenate([states, run.state[None]])
    return _Stretch(times, states, events, what)


def _crossed(
    run: _Run, robot: TubeRobot, data: Samples, limits: Samples, watched: Samples, end: float, events: list[Event]
) -> str:
    """Note what happened in the last step; what ends the stretch, with the state where it does, or nothing."""
    begin = float(run.memory[tube_steps.LAST_TIME])
    length = run.time - begin
    new, inner, gaps = run.state.copy(), np.empty(tube_motion.STATES), np.empty_like(run.gaps)
    dy = np.empty(tube_motion.STATES)

    def at(share: float, place: int) -> float:
        tube_steps.interpolate(share, run.before, new, run.increments, inner)
        outside = 0.0
        if place == gaps.size - tube_steps.WATCHED + tube_steps.INSIDE:
            tube_motion.rates(dy, begin + share * length, inner, data, robot.table)
            outside = float(data[tube_motion.OUTSIDE])
        tube_steps.watched(inner, outside, data, limits, robot.roughness, gaps)
        return float(gaps[place])

    found: list[tuple[float, int]] = []
    for place in np.flatnonzero((watched > 0) != (run.gaps > 0)).tolist():
        low, high = 0.0, 1.0
        for _ in range(60):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if (at(middle, place) > 0) == (watched[place] > 0) else (low, middle)
        found.append((high, place))
    sites = len(robot.names)
    for share, place in sorted(found):
        moment = begin + share * length
        if moment > end:
            break
        if place < sites:
            done = "touches" if watched[place] > 0 else "leaves"
            events.append(Event(moment, f"{robot.names[place]} {done} the wall"))
            continue
        at(share, place)
        if place == sites + tube_steps.CHARGE_LEFT:
            what = BATTERY_EMPTY
        elif place == sites + tube_steps.ROOM:
            what = _END
        else:
            what = range_left(robot, inner, moment, data)
        run.state[:] = inner
        run.memory[tube_steps.TIME] = moment
        run.memory[tube_steps.STEP] = run.memory[tube_steps.LAST_STEP]
        events.append(Event(moment, what))
        return what
    return ""


_RANGES = {tube_table.TOO_FAR_PITCHED: "pitch", tube_table.TOO_FAR_YAWED: "yaw"}
"""What `resistance_at` says was left."""


def range_left(robot: TubeRobot, state: Samples, time: float, data: Samples) -> str:
    """A sentence on the range of the table that was left."""
    tube_motion.rates(np.empty(tube_motion.STATES), time, state, data, robot.table)
    name = _RANGES.get(int(data[tube_motion.OUTSIDE]), "place")
    offset, pitch, yaw = (data[place] for place in (tube_motion.OFFSET, tube_motion.WALL_PITCH, tube_motion.WALL_YAW))
    return (
        f"the range of the robot's table in {name} is left, at an offset of {1e3 * offset:.4g} mm, a pitch of "
        f"{np.degrees(pitch):.3g} deg and a yaw of {np.degrees(yaw):.3g} deg against the wall"
    )


def watched_limits(robot: TubeRobot, reach: Reach, *, spent: bool = False) -> Samples:
    """Where tube and battery end, as `spirillum.kernels.tube_steps` reads it; a spent battery ends no more."""
    found = np.empty(tube_steps.LIMITS)
    found[tube_steps.CHANNEL], found[tube_steps.MIDDLE] = reach.channel, reach.middle
    found[tube_steps.NOSE], found[tube_steps.TIP] = reach.nose, reach.tip
    motor = robot.drive[rigid_links.KIND] == rigid_links.MOTOR
    found[tube_steps.MOST_CHARGE] = reach.charge if motor and not spent else np.inf
    return found


def step_sizes(robot: TubeRobot) -> Samples:
    """Sizes of the state's components below which nothing matters; a small change of time; the time of a turn."""
    sizes = state_sizes(robot.drive, robot.length, robot.torque, tube_motion.STATES)
    changing = robot.drive[rigid_links.KIND] == rigid_links.MAGNETIC or len(robot.flow) > 1
    return np.append(sizes, [1e-6 * robot.turn if changing else 0.0, robot.turn])


def _joined(
    robot: TubeRobot,
    pieces: Sequence[tuple[Samples, Samples, float]],
    events: list[Event],
    switches: Sequence[Switch],
    run: _Run,
) -> TubeTrajectory:
    times = np.concatenate([piece[0] for piece in pieces])
    states = np.concatenate([piece[1] for piece in pieces])
    duties = np.concatenate([np.full(piece[0].size, piece[2]) for piece in pieces])
    observed = np.empty((times.size, tube_motion.OBSERVED))
    first = 0
    for time, inside, duty in pieces:
        here = _over(robot, duty, float(time[0]), float(time[-1])) if time.size else robot
        tube_motion.observe(time, np.ascontiguousarray(inside), here.data, robot.table, observed[first:])
        first += time.size
    switched = [Event(s.time, f"duty {s.duty:g}") for s in switches if times[0] <= s.time <= times[-1]]
    happened = tuple(sorted([*switched, *events], key=lambda event: event.time))
    last = Checkpoint(
        float(run.memory[tube_steps.LAST_TIME]), float(run.memory[tube_steps.LAST_STEP]), tuple(run.before.tolist())
    )
    return TubeTrajectory(times, duties, states, observed, happened, last)
