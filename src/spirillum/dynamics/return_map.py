"""Return map of a robot's pose in its tube over one turn of the tail, and its fixed point.

The state is seen whenever the tail stands at the same angle against the wall: a turn then maps place and attitude to
place and attitude. A steady motion is a fixed point of that map, whatever happens within a turn, and the eigenvalues
of the map's derivative say how a small distance from it grows or shrinks in a turn. Steps and equations are those of a
run.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.dynamics.integration import Reach, observed_at, watched_limits
from spirillum.dynamics.tube_robot import TubeRobot
from spirillum.dynamics.tube_start import StartPlace, state_at
from spirillum.errors import InputError
from spirillum.kernels import rigid_links, stiff_steps
from spirillum.kernels import tube_motion as kernel
from spirillum.kernels.contacts import SITE_ROTOR

_SEARCHING = 10.0 * TubeRobot.tolerance
"""Error of a time step while a fixed point is searched; it is refined at that of a run, as are its multipliers: one
close to 1 is the rate of approach.
"""
_ON = False  # a step may go beyond where it is asked to stop
_FIRST = 1e-3  # first step over the time of a turn
_STALLED = 50.0  # turns at the steady rate in which the tail has to turn once
_MOST_STEPS = 75_000
"""Steps in time of a run and of all searches for its fixed point: some 1,300 turns, fewer where the tail touches."""
_NOWHERE = Reach(nose=0.0, tip=0.0, channel=np.inf, middle=0.0, charge=np.inf)
_COUNTED = [rigid_links.POSITION, rigid_links.ROLL, *range(rigid_links.CURRENT + 1, rigid_links.STATES)]
"""What counts from the start of a turn."""

STEPS = ("time", "x", "roll", "gap", "azimuth", "pitch", "yaw", "contact_force", "offset")
"""What is noted at every step; azimuth between -pi and pi."""

_SIZES = np.array([1.0, 0.1, 100.0, 1.0])
"""Weights of azimuth (rad), logarithm of the gap, pitch (rad) and yaw (rad) in the size of a change."""
_LONGEST = np.array([0.3, 1.0, 0.05, 0.1])
"""Longest steps of Newton's method."""
_ROUNDS, _RELAXING = 10, 8
_STILL, _SMALLEST = 1e-8, 2e-4
"""Size of a turn's change below which nothing changes at all; of a step of Newton's method that is the last."""


class Turn(NamedTuple):
    """What a turn of the tail does."""

    state: Samples
    """The state after it, (19,); path, roll, works and charge count from its start."""
    time: float
    """How long it takes, s."""
    steps: Samples
    """What is in `STEPS` at each step, all from the start of the turn, (n, 9)."""


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
    """The robot, at its duty."""
    sign: float
    """Sense in which the tail turns in the lab."""
    tolerance: float = TubeRobot.tolerance
    """Error of a step over the sizes of the state's components."""
    steps: list[int] = field(default_factory=lambda: [0])
    """Number of steps that were taken, shared with maps of other tolerances."""

    def after(self, state: Samples) -> Turn:
        """The next turn of the tail from a state, (19,).

        Raises:
            EndedTurnError: if the turn cannot be followed to its end.
        """
        robot, data = self.robot, self.robot.data
        limits, sizes = watched_limits(robot, _NOWHERE), robot.step_sizes()
        y = state.copy()
        y[_COUNTED] = 0.0
        memory = np.zeros(stiff_steps.MEMORY)
        memory[stiff_steps.STEP] = _FIRST * robot.turn
        gaps = np.ones(robot.gap_count + stiff_steps.WATCHED)
        increments, before = np.zeros((8, rigid_links.STATES)), y.copy()
        stiff_steps.watched(y, 0.0, data, robot.table, limits, robot.roughness, gaps)
        nothing, none = np.empty(0), np.empty((0, rigid_links.STATES))
        begun = observed_at(robot, y)[kernel.TURN], y[rigid_links.PHASE]
        noted: list[tuple[float, ...]] = []
        while self._turned(y, data[kernel.TURN], begun) < 2.0 * np.pi or not noted:
            status = stiff_steps.advance(
                np.inf, _ON, 1, self.tolerance, memory, y, before, increments, gaps, nothing, none, sizes,
                limits, robot.roughness, data, robot.table,
            )  # fmt: skip
            time = float(memory[stiff_steps.TIME])
            self.steps[0] += 1
            if words := self._ended(status, y, time, gaps):
                part = Turn(before.copy(), noted[-1][0], np.array(noted)) if len(noted) > 1 else None
                raise EndedTurnError(words, part)
            noted.append(_noted(time, y, data))
        end, share = self._at_the_angle(before, y, increments, begun)
        last = float(memory[stiff_steps.LAST_TIME])
        time = last + share * (float(memory[stiff_steps.TIME]) - last)
        steps = np.array(noted)
        return Turn(end, time, steps[steps[:, 0] <= time])

    def _ended(self, status: int, y: Samples, time: float, gaps: Samples) -> str:
        """Why a turn ends after a step, before the tail has turned; empty where it goes on."""
        if status == stiff_steps.STUCK:
            return "no step is small enough to follow the motion; allowed: a larger roughness"
        if gaps[-stiff_steps.WATCHED + stiff_steps.INSIDE] < 0:
            return f"{self.robot.range_left(y, time)}; allowed: another start, or motion 'held'"
        if time > _STALLED * self.robot.turn:
            return "the tail hardly turns there; allowed: a stronger drive, or motion 'held'"
        if self.steps[0] > _MOST_STEPS:
            return "the motion still changes, and its steps are too short to follow it on; allowed: `simulate`"
        return ""

    def _turned(self, y: Samples, turn: float, begun: tuple[float, float]) -> float:
        """Angle by which the tail has turned relative to the nearest wall, rad."""
        raw = turn + y[rigid_links.PHASE] - begun[0] - begun[1]
        counted = y[rigid_links.ROLL] + y[rigid_links.PHASE] - begun[1]
        return float(self.sign * (raw + 2.0 * np.pi * np.round((counted - raw) / (2.0 * np.pi))))

    def _at_the_angle(
        self, before: Samples, new: Samples, increments: Samples, begun: tuple[float, float]
    ) -> tuple[Samples, float]:
        """State and share of the last step at which the turn is complete."""
        from scipy.optimize import brentq

        inner = np.empty(rigid_links.STATES)

        def left(share: float) -> float:
            stiff_steps.interpolate(share, before, new, increments, inner)
            return self._turned(inner, observed_at(self.robot, inner)[kernel.TURN], begun) - 2.0 * np.pi

        share = float(brentq(left, 0.0, 1.0, xtol=1e-13))
        left(share)
        return inner.copy(), share


def _noted(time: float, y: Samples, data: Samples) -> tuple[float, ...]:
    return (
        time,
        float(y[rigid_links.POSITION]),
        float(y[rigid_links.ROLL]),
        *(float(data[place]) for place in (rigid_links.FILM, kernel.AZIMUTH, kernel.WALL_PITCH, kernel.WALL_YAW)),
        float(data[kernel.CONTACT_FORCE]),
        float(data[kernel.OFFSET]),
    )


class FixedPoint(NamedTuple):
    """A fixed point of the return map, in a tube without gravity up to its azimuth."""

    turn: Turn
    """The turn from there."""
    state: Samples
    """The state at its start, (19,)."""
    multipliers: np.ndarray
    """By what small distances from it are multiplied in a turn, complex, largest first."""


def fixed_place(turns: ReturnMap, state: Samples, *, heavy: bool) -> FixedPoint | None:
    """The fixed point near a state by Newton's method, if it is found.

    After each step some turns let go by what dies out within a few, such as gaps. It is looked for with longer
    steps in time than those of a run, and settled with these.

    Args:
        turns: the map.
        state: where to begin, (19,).
        heavy: whether the azimuth counts, too.
    """
    free = np.arange(0 if heavy else 1, 4)
    place = _Place(replace(turns, tolerance=_SEARCHING), state)
    near = _newton(place, place.coordinates(state), free)
    if near is None:
        return None
    place = _Place(turns, place.state(near.x))
    found = _newton(place, near.x, free)
    if found is None:
        return None
    multipliers = _multipliers(place, found, free)
    return FixedPoint(found.turn, place.state(found.x), multipliers[np.argsort(-np.abs(multipliers))])


class _Found(NamedTuple):
    """Where Newton's method has ended."""

    x: Samples
    """Coordinates of the pose, (4,)."""
    turn: Turn
    """The turn from there."""
    derivative: Samples
    """Derivative of the map there, by differences to one side."""


def _newton(place: _Place, x: Samples, free: np.ndarray) -> _Found | None:
    """Newton's method for the fixed point of the return map, from coordinates (4,); None where it fails."""
    found = place.change(x)
    for _ in range(_ROUNDS):
        if found is None:
            return None
        turn, change = found
        place.current = float(turn.state[rigid_links.CURRENT])
        size = _size(change[free])
        derivative = _derivative(place, x, turn, free)
        if derivative is None:
            return None
        step = np.zeros(4)
        step[free] = np.linalg.lstsq(np.eye(free.size) - derivative, change[free], rcond=None)[0]
        if size < _STILL:  # where many places are brought back, a step would go to another of them
            return _Found(x, turn, derivative)
        if _size(step[free]) < _SMALLEST:
            last = place.change(x + step)
            return _Found(x, turn, derivative) if last is None else _Found(x + step, last[0], derivative)
        share = min(1.0, float(np.min(_LONGEST / np.maximum(np.abs(step), 1e-300))))
        for tried in (share, 0.25 * share):
            x_new, found = place.relaxed(x + tried * step)
            if found is not None and _size(found[1][free]) < size:
                break
        else:
            return None
        x = x_new
    return None


def _size(change: Samples) -> float:
    return float(np.linalg.norm(_SIZES[-change.size :] * change))


def _wrapped(change: Samples) -> Samples:
    """A change of coordinates with that of the azimuth between -pi and pi."""
    return np.array([(change[0] + np.pi) % (2.0 * np.pi) - np.pi, *change[1:]])


def _derivative(place: _Place, x: Samples, turn: Turn, free: np.ndarray, *, sign: float = 1.0) -> Samples | None:
    """Derivative of the map over the free coordinates, by differences to one side."""
    after = place.coordinates(turn.state)
    columns = []
    for column in free:
        moved = x.copy()
        moved[column] += sign * place.step(x)[column]
        found = place.change(moved)
        if found is None:
            return None
        columns.append(_wrapped(place.coordinates(found[0].state) - after)[free] / (moved - x)[column])
    return np.stack(columns, axis=1)


def _multipliers(place: _Place, found: _Found, free: np.ndarray) -> np.ndarray:
    """Eigenvalues of the derivative: one close to 1 needs differences to both sides."""
    behind = _derivative(place, found.x, found.turn, free, sign=-1.0)
    return np.linalg.eigvals(found.derivative if behind is None else 0.5 * (found.derivative + behind))


class _Place:
    """Azimuth, mean logarithm of the gaps, pitch and yaw as coordinates of states with the tail at one angle.

    A yaw or pitch that changes alone would close a thin gap many times over: gaps are kept instead of the offset.
    """

    def __init__(self, turns: ReturnMap, state: Samples) -> None:
        self._turns, self._robot = turns, turns.robot
        self._phase = float(observed_at(self._robot, state)[kernel.TURN] + state[rigid_links.PHASE])
        self.current = float(state[rigid_links.CURRENT])
        """Current of the motor, A: it follows the motion within a small part of a turn."""

    def coordinates(self, state: Samples) -> Samples:
        """Coordinates of a state, (4,)."""
        seen = observed_at(self._robot, state)
        return np.array(
            [
                seen[kernel.AZIMUTH],
                self._closeness(state),
                seen[kernel.WALL_PITCH],
                seen[kernel.WALL_YAW],
            ]
        )

    def step(self, x: Samples) -> Samples:
        """Small changes of the coordinates."""
        close = min(1.0, float(np.exp(x[1])) / self._robot.length)
        return np.array([min(0.05 * close, 1e-4), 1e-3, 5e-4 * close, min(0.05 * close, 1e-4)])

    def state(self, x: Samples) -> Samples:
        """The state at coordinates, (19,)."""
        from scipy.optimize import brentq

        start = StartPlace(pitch=float(x[2]), yaw=float(x[3]), azimuth=float(x[0]), phase=self._phase)
        radius = float(self._robot.tube[kernel.RADIUS])
        offset = brentq(
            lambda e: self._closeness(state_at(start, e)) - x[1], 1e-6 * radius, radius, xtol=1e-15 * radius, rtol=1e-15
        )
        found = state_at(start, float(offset))
        found[rigid_links.CURRENT] = self.current
        return found

    def change(self, x: Samples) -> tuple[Turn, Samples] | None:
        """The turn from coordinates and what it changes, (4,); None where there is none."""
        try:
            turn = self._turns.after(self.state(x))
        except (InputError, ValueError):
            return None
        return turn, _wrapped(self.coordinates(turn.state) - x)

    def relaxed(self, x: Samples) -> tuple[Samples, tuple[Turn, Samples] | None]:
        """The coordinates some turns later, and what the next turn changes."""
        for _ in range(_RELAXING):
            found = self.change(x)
            if found is None:
                return x, None
            x = x + found[1]
        return x, self.change(x)

    def _closeness(self, state: Samples) -> float:
        """Mean logarithm of the body's gaps (m): unlike the smallest gap it is smooth where the nearest end changes."""
        gaps = self._robot.gaps(state)[:-1][self._robot.sites[:, SITE_ROTOR] == 0]
        return float(np.mean(np.log(np.maximum(gaps, 1e-300))))
