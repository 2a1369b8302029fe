"""Asymptotic motion of a robot after release in its tube: the run, and its steady state.

The run is followed turn by turn. Now and then the fixed point of the return map to which it leads is looked for
(`return_map`); found and stable, it is what the run approaches, often for many minutes.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.dynamics.return_map import SEARCHING, STEPS, EndedTurnError, ReturnMap, Turn, fixed_place
from spirillum.dynamics.tube_robot import TubeRobot
from spirillum.kernels import core
from spirillum.progress import Progress
from spirillum.swimming.released_motion import State, SteadyState

_MOST_TURNS = 300  # Turns that are followed at most.
_SEARCHES = (10, *range(30, _MOST_TURNS + 1, 30))
"""Turns after which the fixed point of the return map is searched for."""
STABLE = 1.0 + 1e-4  #: Largest multiplier of a motion that stays where it is.
_PLACES = {name: place for place, name in enumerate(STEPS)}


@dataclass
class Path:
    """Position and attitude at every step of a run, from release."""

    steps: list[Samples] = field(default_factory=list)
    """What is in `turn_map.STEPS`, turn after turn; time, x and roll count on, and the azimuth has no jumps."""

    def add(self, turn: Turn) -> None:
        """Add a turn."""
        steps = turn.steps.copy()
        if self.steps and steps.size:
            last = self.steps[-1][-1]
            steps[:, :3] += self._end
            azimuth = _PLACES["azimuth"]
            steps[:, azimuth] += 2.0 * np.pi * np.round((last[azimuth] - steps[0, azimuth]) / (2.0 * np.pi))
        azimuth = _PLACES["azimuth"]
        steps[:, azimuth] = np.unwrap(steps[:, azimuth])
        self._end = (0.0 if not self.steps else self._end) + np.array(
            [turn.time, turn.state[core.STATE_POSITION], turn.state[core.STATE_ROLL]]
        )
        self.steps.append(steps)

    _end: Samples = field(default_factory=lambda: np.zeros(3))

    @property
    def turns(self) -> int:
        """Number of turns."""
        return len(self.steps)

    def of(self, name: str) -> Samples:
        """One of `turn_map.STEPS` over the run."""
        return np.concatenate([steps[:, _PLACES[name]] for steps in self.steps])

    def first_below(self, gap: float) -> float:
        """Time at which the gap first falls to a value, s; NaN if it never does."""
        gaps, times = self.of("gap"), self.of("time")
        below = np.flatnonzero(gaps <= gap)
        if not below.size:
            return float("nan")
        at = int(below[0])
        if at == 0:
            return 0.0
        return float(np.interp(-gap, -gaps[at - 1 : at + 1], times[at - 1 : at + 1]))


class LongRun(NamedTuple):
    """A run and its asymptotic motion."""

    path: Path  #: The run that was followed.
    turn: Turn  #: The last turn: of the asymptotic motion, where one was found.
    start: Samples  #: The state at the start of `time`, (19,).
    time: float  #: Time from then on over which means are taken, s: that turn; around the tube, the last circuit.
    lying: SteadyState  #: Its pose over that time.


def long_run(
    robot: TubeRobot,
    state: Samples,
    sign: float,
    *,
    heavy: bool,
    until: float | None,
    progress: Progress,
    turns_shown: int = 0,
) -> LongRun:
    """Follow a robot in its tube to where its motion no longer changes; not before the gap `until` is reached."""
    turns, path = ReturnMap(robot, sign), Path()
    coarse = replace(turns, tolerance=SEARCHING)
    states, ended = [state], ""
    found, followed = None, 0.0
    while path.turns < _MOST_TURNS and (found is None or path.turns < turns_shown):
        progress("free motion in the tube: turns of the tail", path.turns, _MOST_TURNS)
        try:
            turn = coarse.after(state)
        except EndedTurnError as error:
            if not path.turns:
                if error.turn is None:
                    raise
                turn = error.turn
                path.add(turn)
                states.append(turn.state)
            ended = f"after {path.of('time')[-1]:.4g} s {str(error).partition(';')[0]}"
            break
        path.add(turn)
        state = turn.state
        states.append(state)
        if abs(path.of("azimuth")[-1] - path.of("azimuth")[0]) > 4.0 * np.pi and heavy:
            return _around(path, turn, states)
        waiting = until is not None and path.of("gap").min() > until
        if found is None and path.turns in _SEARCHES and not waiting:
            progress("free motion in the tube: its steady place", path.turns, _MOST_TURNS)
            place = fixed_place(turns, state, heavy=heavy)
            found = place if place is not None and abs(place.multiplier) < STABLE else None
            followed = float(path.of("time")[-1])
    if found is not None:
        progress("free motion in the tube", _MOST_TURNS, _MOST_TURNS)
        largest = abs(found.multiplier)
        slow = float(-found.turn.time / np.log(largest)) if largest < 2.0 - STABLE else float("nan")
        name: State = "steady" if heavy else "orbits"
        lying = _lying(name, found.turn, followed, slow)
        return LongRun(path, found.turn, found.state, found.turn.time, lying)
    followed = float(path.of("time")[-1])
    if not ended:
        ended = f"the motion still changes after {followed:.4g} s, and was not followed on"
    return LongRun(path, turn, states[-2], turn.time, _lying("changing", turn, followed, float("nan"), ended))


def _lying(state: State, turn: Turn, followed: float, approach: float, ended: str = "") -> SteadyState:
    steps = {name: turn.steps[:, place] for name, place in _PLACES.items()}
    azimuth = np.unwrap(steps["azimuth"])
    time = np.append(steps["time"], turn.time)
    length = np.diff(np.append(0.0, 0.5 * (time[:-1] + time[1:])))

    def mean(values: Samples) -> float:
        return float(np.sum(length * values) / np.sum(length))

    slope = (azimuth[-1] - azimuth[0]) / (steps["time"][-1] - steps["time"][0])
    return SteadyState(
        state=state,
        azimuth=np.nan if state == "orbits" else mean(azimuth),
        gap=mean(steps["gap"]),
        gap_range=(float(steps["gap"].min()), float(steps["gap"].max())),
        pitch=mean(steps["pitch"]),
        yaw=mean(steps["yaw"]),
        orbit_rate=0.0 if state == "steady" else float(slope),
        contact_force=mean(steps["contact_force"]),
        time=followed,
        approach_time=approach,
        ended=ended,
    )


def _around(path: Path, turn: Turn, states: list[Samples]) -> LongRun:
    """A robot that its weight does not hold: over the last circuit; `states` are those at the ends of all turns."""
    values = {name: path.of(name) for name in STEPS}
    azimuth, time = values["azimuth"], values["time"]
    begin = int(np.argmin(np.abs(azimuth - azimuth[-1] + np.sign(azimuth[-1] - azimuth[0]) * 2.0 * np.pi)))
    last = slice(begin, None)
    length = np.gradient(time[last])

    def mean(name: str) -> float:
        return float(np.sum(length * values[name][last]) / np.sum(length))

    lying = SteadyState(
        state="goes around",
        azimuth=np.nan,
        gap=mean("gap"),
        gap_range=(float(values["gap"][last].min()), float(values["gap"][last].max())),
        pitch=mean("pitch"),
        yaw=mean("yaw"),
        orbit_rate=float((azimuth[-1] - azimuth[begin]) / (time[-1] - time[begin])),
        contact_force=mean("contact_force"),
        time=float(time[-1]),
        approach_time=np.nan,
    )
    circuit = float(time[-1] - time[begin])
    ends = np.cumsum([0.0, *(steps.shape[0] for steps in path.steps)]).astype(int)
    first = int(np.searchsorted(ends, begin, side="right")) - 1  # the turn in which the circuit begins
    return LongRun(path, turn, states[first], circuit, lying)
