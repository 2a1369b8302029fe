"""Return map of a robot's pose in its tube over one turn of the tail, and its fixed point.

The state is seen whenever the tail stands at the same angle against the wall: a turn then maps position and attitude to
position and attitude. A steady motion is a fixed point of that map, whatever happens within a turn, and the eigenvalues
of the map's derivative give how a small distance from it grows or shrinks in a turn. Steps and equations are those of a
run.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import reduce
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.dynamics.integration import Reach, Steps, watched_limits
from spirillum.dynamics.release import state_at
from spirillum.dynamics.tube_robot import TubeRobot
from spirillum.errors import InputError
from spirillum.kernels import core
from spirillum.kernels.core import SITE_ROTOR

SEARCHING = 10.0 * TubeRobot.tolerance
"""Error of a time step during the search for a fixed point, which is refined at that of a run, as is its multiplier."""
_ON = False  # a step may exceed the requested end
_FIRST = 1e-3  # first step over the time of a turn
_STALLED = 50.0  # turns at the steady rate in which the tail has to turn once
_MOST_STEPS = 75_000
"""Steps in time of a run and of all searches for its fixed point: some 1,300 turns, fewer where the tail touches."""
_COUNTED = [core.STATE_POSITION, core.STATE_ROLL, *range(core.STATE_CURRENT + 1, core.STATE_SIZE)]
"""What counts from the start of a turn."""

STEPS = ("time", "x", "roll", "gap", "azimuth", "pitch", "yaw", "contact_force", "offset")
"""Columns recorded at every step: the time, two components of the state, and quantities computed from it."""
_OF_STATE = [core.STATE_POSITION, core.STATE_ROLL]
_SEEN = [
    *(core.SEEN_FILM, core.SEEN_AZIMUTH, core.SEEN_PITCH, core.SEEN_YAW),
    *(core.SEEN_CONTACT_FORCE, core.SEEN_OFFSET),
]
"""Places of the computed quantities, in the order of `STEPS`; azimuth between -pi and pi."""

_SIZES = np.array([1.0, 0.1, 100.0, 1.0])
"""Weights of azimuth (rad), logarithm of the gap, pitch (rad) and yaw (rad) in the size of a change."""
_LONGEST = np.array([0.3, 1.0, 0.05, 0.1])  # Longest steps of the search.
_ROUNDS, _FIRST_TURNS = 25, 4.0  #: Steps of the search at most; turns of the tail that the first one is over.
_GROWTH = (0.25, 10.0)  # By what the turns that a step is over are multiplied at least and at most.
_STILL, _SMALLEST, _SMALL = 1e-8, 2e-4, 2e-2
"""Size of a turn's change below which nothing changes at all; of a step of Newton's method that is the last; of a step
after which no turn is needed for what dies out within one."""
_APART = 0.01 * _LONGEST  # Distances from a fixed point at which its multiplier is measured.
_LITTLE = 1e-6  # Differences of a state's components over their sizes and the gap.
ACTING = (
    *(core.STATE_POSITION + 1, core.STATE_POSITION + 2),
    *range(core.STATE_ATTITUDE, core.STATE_ATTITUDE + 4),
    *(core.STATE_PHASE, core.STATE_CURRENT),
)
"""Components of the state on which the rates depend: position across the tube, attitude, tail phase, current."""
_TAIL, _ANGLES = 4, [0, 4, 5]  #: Where a chart has the angle of the tail, and angles that are the same after a turn.


class Turn(NamedTuple):
    """What a turn of the tail does."""

    state: Samples  #: The state after it, (19,); path, roll, works and charge count from its start.
    time: float  #: How long it takes, s.
    steps: Samples  #: What is in `STEPS` at each step, all from the start of the turn, (n, 9).
    tangent: Samples  #: Derivative of what acts (`ACTING`) after `time` by that at its start, (8, 8).


class EndedTurnError(InputError):
    """A turn that cannot be followed to its end."""

    def __init__(self, words: str, turn: Turn | None) -> None:
        """Keep the part of the turn that was followed; None where not even a step was."""
        super().__init__(words)
        self.turn = turn


@dataclass
class ReturnMap:
    """Turns of the tail of one robot with its drive on."""

    robot: TubeRobot
    sign: float  #: Sense in which the tail turns in the lab.
    tolerance: float = TubeRobot.tolerance  #: Error of a step over the sizes of the state's components.
    steps: list[int] = field(default_factory=lambda: [0])
    """Number of steps that were taken, shared with maps of other tolerances."""

    def after(self, state: Samples) -> Turn:
        """The next turn of the tail from a state, (19,); `EndedTurnError` if it cannot be followed to its end."""
        robot, data = self.robot, self.robot.data
        limits, sizes = watched_limits(robot, Reach()), robot.step_sizes()
        y = state.copy()
        y[_COUNTED] = 0.0
        run = Steps.of(robot, y, 0.0, _FIRST * robot.turn)
        core.watched(y, 0.0, data, robot.table, limits, robot.roughness, run.gaps)
        nothing, none = np.empty(0), np.empty((0, core.STATE_SIZE))
        begun = robot.observe_state(y)[core.SEEN_TURN], y[core.STATE_PHASE]
        noted: list[Samples] = []
        jacobians: list[Samples] = []
        while self._turned(y, data[core.SEEN_TURN], begun) < 2.0 * np.pi or not noted:
            status = core.advance(
                np.inf, _ON, 1, self.tolerance, run.memory, y, run.before, run.increments, run.jacobian, run.gaps,
                nothing, none, sizes, limits, robot.roughness, data, robot.table,
            )  # fmt: skip
            self.steps[0] += 1
            if words := self._ended(status, y, run.time, run.gaps):
                raise EndedTurnError(words, _part(run.before, noted, jacobians))
            noted.append(np.concatenate([[run.time], y[_OF_STATE], data[_SEEN]]))
            jacobians.append(run.jacobian.copy())
        end, share = self._at_the_angle(run.before, y, run.increments, begun)
        time = run.last.time + share * (run.time - run.last.time)
        steps = np.array(noted)
        tangent = _tangent(np.array([0.0, *steps[:-1, 0], time]), np.array(jacobians))
        return Turn(end, time, steps[steps[:, 0] <= time], tangent)

    def _ended(self, status: int, y: Samples, time: float, gaps: Samples) -> str:
        """Why a turn ends after a step, before the tail has turned; empty where it continues."""
        if status == core.STUCK:
            return "no step is small enough to follow the motion; allowed: a larger roughness"
        if gaps[-core.WATCHED + core.WITHIN] < 0:
            return f"{self.robot.range_message(y, time)}; allowed: another start, or motion 'held'"
        if time > _STALLED * self.robot.turn:
            return "the tail hardly turns there; allowed: a stronger drive, or motion 'held'"
        if self.steps[0] > _MOST_STEPS:
            return "the motion still changes, and its steps are too short to follow it on; allowed: `simulate`"
        return ""

    def _turned(self, y: Samples, turn: float, begun: tuple[float, float]) -> float:
        """Angle by which the tail has turned relative to the nearest wall, rad."""
        raw = turn + y[core.STATE_PHASE] - begun[0] - begun[1]
        counted = y[core.STATE_ROLL] + y[core.STATE_PHASE] - begun[1]
        return float(self.sign * (raw + 2.0 * np.pi * np.round((counted - raw) / (2.0 * np.pi))))

    def _at_the_angle(
        self, before: Samples, new: Samples, increments: Samples, begun: tuple[float, float]
    ) -> tuple[Samples, float]:
        """State and share of the last step at which the turn is complete."""
        from scipy.optimize import brentq

        inner = np.empty(core.STATE_SIZE)

        def left(share: float) -> float:
            core.interpolate(share, before, new, increments, inner)
            return self._turned(inner, self.robot.observe_state(inner)[core.SEEN_TURN], begun) - 2.0 * np.pi

        share = float(brentq(left, 0.0, 1.0, xtol=1e-13))
        left(share)
        return inner.copy(), share


def _part(state: Samples, noted: list[Samples], jacobians: list[Samples]) -> Turn | None:
    """A turn as far as it was followed."""
    if len(noted) < 2:
        return None
    steps = np.array(noted)
    return Turn(state.copy(), float(steps[-1, 0]), steps, _tangent(np.array([0.0, *steps[:, 0]]), np.array(jacobians)))


def _tangent(times: Samples, jacobians: Samples) -> Samples:
    """Derivative of a state by that at the start, by the Jacobians at the beginning of steps (Magnus, order 2)."""
    from scipy.linalg import expm

    after = np.concatenate([jacobians[1:], jacobians[-1:]])
    factors = expm(np.diff(times)[:, None, None] * 0.5 * (jacobians + after))
    return reduce(lambda total, factor: factor @ total, factors)


class FixedPoint(NamedTuple):
    """A fixed point of the return map, in a tube without gravity up to its azimuth."""

    turn: Turn  #: The turn from there.
    state: Samples  #: The state at its start, (19,).
    multiplier: complex  #: By what a small distance from it is multiplied in a turn, after some turns.


def fixed_place(turns: ReturnMap, state: Samples, *, heavy: bool) -> FixedPoint | None:
    """The fixed point to which the motion from a state leads, if it is found."""
    free = np.arange(0 if heavy else 1, 4)
    # Looked for with longer steps in time than those of a run, and settled with these.
    chart = _Chart(replace(turns, tolerance=SEARCHING), state)
    near = _continued(chart, chart.coordinates(state), free, _FIRST_TURNS)
    if near is None:
        return None
    chart = _Chart(turns, chart.state(near.x))
    found = _continued(chart, near.x, free, np.inf)
    if found is None:
        return None
    return FixedPoint(found.turn, chart.state(found.x), _multiplier(chart, found, free))


def _multiplier(chart: _Chart, found: _Change, free: np.ndarray) -> complex:
    """The leading eigenvalue of the derivative, which may be close to 1: by turns from both sides of the point."""
    values, right = np.linalg.eig(found.derivative[np.ix_(free, free)])
    number = int(np.argmax(np.abs(values)))
    left, along = np.linalg.inv(right)[number], np.zeros(4, dtype=complex)
    along[free] = right[:, number]
    multiplier = 0.0j
    for unit, part in ((1.0, along.real), (1.0j, along.imag)):
        if part.any():
            length = float(np.min(_APART / np.maximum(np.abs(part), 1e-300)))
            ahead, behind = chart.change(found.x + length * part), chart.change(found.x - length * part)
            if ahead is None or behind is None:
                return complex(values[number])
            moved = part + (ahead.change - behind.change) / (2.0 * length)
            multiplier += unit * complex(left @ moved[free])
    return multiplier


class _Change(NamedTuple):
    """A turn from coordinates."""

    x: Samples  #: Coordinates of the pose, (4,).
    turn: Turn  #: The turn from there.
    change: Samples  #: What it changes, (4,).
    derivative: Samples  #: Derivative of the coordinates after it by those at its start, (4, 4).


def _continued(chart: _Chart, x: Samples, free: np.ndarray, turns: float) -> _Change | None:
    """The fixed point of the return map to which coordinates, (4,), lead; None where the search fails."""
    # Pseudo-transient continuation: implicit Euler steps over turns of the tail, more of them as the change of a turn
    # falls, and at last Newton's method (C. T. Kelley, D. E. Keyes, SIAM J. Numer. Anal. 35:508, 1998). What dies out
    # within a turn, such as gaps in contact, does so in one turn after each step.
    here = chart.change(x)
    for _ in range(_ROUNDS):
        if here is None:
            return None
        size = _size(here.change[free])
        slope = np.eye(free.size) - here.derivative[np.ix_(free, free)]
        newton, step = np.zeros(4), np.zeros(4)
        newton[free] = np.linalg.lstsq(slope, here.change[free], rcond=None)[0]
        if size < _STILL:  # where many fixed points are close, a step would go to another
            return here
        if _size(newton[free]) < _SMALLEST:
            return chart.change(here.x + newton) or here
        step[free] = np.linalg.lstsq(slope + np.eye(free.size) / turns, here.change[free], rcond=None)[0]
        share = min(1.0, float(np.min(_LONGEST / np.maximum(np.abs(step), 1e-300))))
        new = chart.change(here.x + share * step)
        if new is not None and _size(step[free]) > _SMALL:
            new = chart.change(new.x + new.change)
        turns *= 0.1 if new is None else float(np.clip(size / _size(new.change[free]), *_GROWTH))
        if turns < 1.0:  # the run itself leads as far
            return None
        here = new or here
    return None


def _size(change: Samples) -> float:
    return float(np.linalg.norm(_SIZES[-change.size :] * change))


def _wrapped(change: Samples) -> Samples:
    """A change of a chart with those of its angles between -pi and pi."""
    found = change.copy()
    found[_ANGLES] = (found[_ANGLES] + np.pi) % (2.0 * np.pi) - np.pi
    return found


class _Chart:
    """Azimuth, mean logarithm of the gaps, pitch and yaw as coordinates of states with the tail at one angle.

    A yaw or pitch that changes alone would close a thin gap many times over: gaps are kept instead of the offset.
    """

    def __init__(self, turns: ReturnMap, state: Samples) -> None:
        self._turns, self._robot = turns, turns.robot
        self._phase = float(self._robot.observe_state(state)[core.SEEN_TURN] + state[core.STATE_PHASE])
        self.current = float(state[core.STATE_CURRENT])
        """Current of the motor, A: it follows the motion within a small part of a turn."""

    def coordinates(self, state: Samples) -> Samples:
        """Coordinates of a state, (4,)."""
        return self._chart(state)[:4]

    def state(self, x: Samples) -> Samples:
        """The state at coordinates, (19,)."""
        from scipy.optimize import brentq

        azimuth, closeness, pitch, yaw = map(float, x)

        def at(offset: float) -> Samples:
            return state_at(offset, self._phase, pitch, yaw, azimuth)

        low, high = (share * float(self._robot.tube[core.TUBE_RADIUS]) for share in (1e-6, 1.0))
        offset = brentq(lambda e: self._closeness(at(e)) - closeness, low, high, xtol=1e-15 * high, rtol=1e-15)
        found = at(float(offset))
        found[core.STATE_CURRENT] = self.current
        return found

    def change(self, x: Samples) -> _Change | None:
        """The turn from coordinates, (4,); None where there is none."""
        try:
            start = self.state(x)
            turn = self._turns.after(start)
        except (InputError, ValueError):
            return None
        self.current = float(turn.state[core.STATE_CURRENT])
        rates = np.empty(core.STATE_SIZE)
        core.rates(rates, 0.0, turn.state, self._robot.data, self._robot.table)
        after, rate = self._chart_derivative(turn.state), rates[list(ACTING)]
        moved = after @ turn.tangent @ np.linalg.inv(self._chart_derivative(start))[:, :4]
        drift = after @ rate  # the turn ends where the tail is at its angle again
        derivative = moved[:4] - np.outer(drift[:4], moved[_TAIL]) / drift[_TAIL]
        return _Change(x, turn, _wrapped(self._chart(turn.state) - self._chart(start))[:4], derivative)

    def _chart(self, state: Samples) -> Samples:
        """What acts as these four coordinates, angles of tail and body against the wall, |q| and current, (8,)."""
        seen, attitude = self._robot.observe_state(state), state[core.STATE_ATTITUDE : core.STATE_PHASE]
        tail = seen[core.SEEN_TURN] + state[core.STATE_PHASE]
        pose = seen[core.SEEN_AZIMUTH], self._closeness(state), seen[core.SEEN_PITCH], seen[core.SEEN_YAW]
        return np.array([*pose, tail, seen[core.SEEN_TURN], np.linalg.norm(attitude), state[core.STATE_CURRENT]])

    def _chart_derivative(self, state: Samples) -> Samples:
        """Derivative of the chart by what acts, (8, 8)."""
        sizes = _LITTLE * self._robot.step_sizes()
        sizes[: core.STATE_PHASE] *= min(1.0, float(np.exp(self._closeness(state))) / self._robot.length)
        columns = []
        for at in ACTING:
            ahead, behind = state.copy(), state.copy()
            ahead[at] += sizes[at]
            behind[at] -= sizes[at]
            columns.append(_wrapped(self._chart(ahead) - self._chart(behind)) / (ahead[at] - behind[at]))
        return np.stack(columns, axis=1)

    def _closeness(self, state: Samples) -> float:
        """Mean logarithm of the body's gaps (m): unlike the smallest gap it is smooth where the nearest end changes."""
        gaps = self._robot.gaps(state)[:-1][self._robot.sites[:, SITE_ROTOR] == 0]
        return float(np.mean(np.log(np.maximum(gaps, 1e-300))))
