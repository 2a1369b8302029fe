"""Free motion of a robot in its tube: resting pose and swimming under weight, film, contact and its own motor.

The motion is the run of `simulate`, followed to where it no longer changes from turn to turn of the tail; every
quantity is the mean over such a turn.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.dynamics.integration import Reach, integrate
from spirillum.dynamics.record import dataset_of
from spirillum.dynamics.release import InTube, Release, released_state
from spirillum.dynamics.return_map import SEARCHING, STEPS, EndedTurnError, ReturnMap, Turn, fixed_place
from spirillum.dynamics.timing import Switch
from spirillum.dynamics.tube_robot import TubeRobot
from spirillum.dynamics.tube_simulation import Checked, compare_with_check, links_in_tube, sticking_notes, table_of_run
from spirillum.errors import InputError
from spirillum.fitted.fit import NO_FIT, Fit, friction_acts
from spirillum.kernels import core
from spirillum.notes import Note
from spirillum.progress import Progress
from spirillum.robot.fields import field_values
from spirillum.robot.limits import check_stokes_flow, in_stokes_flow, reynolds_limits
from spirillum.robot.placement import Placement
from spirillum.robot.robot import Robot
from spirillum.robot.tube_pose import gap_of
from spirillum.swimming.balance import current_at
from spirillum.swimming.motions import State, SteadyState, Swimming
from spirillum.swimming.prediction import Prediction, predict_steady
from spirillum.swimming.scenario import NO_WEIGHT
from spirillum.swimming.steady import swimming_of
from spirillum.units import show

_MOST_TURNS = 300  # Turns that are followed at most.
_SEARCHES = (10, *range(30, _MOST_TURNS + 1, 30))
"""Turns after which the fixed point of the return map is searched for."""
STABLE = 1.0 + 1e-4  #: Largest multiplier of a motion that stays where it is.
_PLACES = {name: place for place, name in enumerate(STEPS)}


@dataclass
class FollowedPath:
    """Position and attitude at every step of a run, from release."""

    steps: list[Samples] = field(default_factory=list)
    """Columns of `return_map.STEPS` for each turn; time, x and roll accumulate, and the azimuth is unwrapped."""

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
        """One of `return_map.STEPS` over the run."""
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

    path: FollowedPath  #: The run that was followed.
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
    turns, path = ReturnMap(robot, sign), FollowedPath()
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
    return LongRun(path, turn, states[-2], turn.time, _lying("changing", turn, followed, ended=ended))


def _lying(state: State, turn: Turn, followed: float, approach: float = np.nan, ended: str = "") -> SteadyState:
    """The steady state over a turn of the tail."""
    values = {name: turn.steps[:, place] for name, place in _PLACES.items()}
    values["azimuth"] = np.unwrap(values["azimuth"])
    time = np.append(values["time"], turn.time)
    length = np.diff(np.append(0.0, 0.5 * (time[:-1] + time[1:])))
    return _steady_state(state, values, length, followed, approach, ended)


def _around(path: FollowedPath, turn: Turn, states: list[Samples]) -> LongRun:
    """A robot that its weight does not hold: over the last circuit; `states` are those at the ends of all turns."""
    azimuth, time = path.of("azimuth"), path.of("time")
    begin = int(np.argmin(np.abs(azimuth - azimuth[-1] + np.sign(azimuth[-1] - azimuth[0]) * 2.0 * np.pi)))
    values = {name: path.of(name)[begin:] for name in STEPS}
    lying = _steady_state("goes around", values, np.gradient(time[begin:]), float(time[-1]))
    ends = np.cumsum([0.0, *(steps.shape[0] for steps in path.steps)]).astype(int)
    first = int(np.searchsorted(ends, begin, side="right")) - 1  # the turn in which the circuit begins
    return LongRun(path, turn, states[first], float(time[-1] - time[begin]), lying)


def _steady_state(
    state: State,
    values: Mapping[str, Samples],
    length: Samples,
    followed: float,
    approach: float = np.nan,
    ended: str = "",
) -> SteadyState:
    """Means of `STEPS`, each of which counts for a length of time, s."""

    def mean(name: str) -> float:
        return float(np.sum(length * values[name]) / np.sum(length))

    turned, over = (float(values[name][-1] - values[name][0]) for name in ("azimuth", "time"))
    return SteadyState(
        state=state,
        azimuth=np.nan if state in ("orbits", "goes around") else mean("azimuth"),
        gap=mean("gap"),
        gap_range=(float(values["gap"].min()), float(values["gap"].max())),
        pitch=mean("pitch"),
        yaw=mean("yaw"),
        orbit_rate=0.0 if state == "steady" else turned / over,
        contact_force=mean("contact_force"),
        time=followed,
        approach_time=approach,
        ended=ended,
    )


_SAMPLES = 240  # Samples of a turn over which means are taken.
_MOST_SAMPLES = 20_000
_FEW_TURNS = 6  # Turns of the tail within which a trial reaches its steady motion.
_LIGHT = 1e-9  # Weight in the fluid, over the forces that act, below which a robot has none.


class FreeMotion(NamedTuple):
    """A free robot in its tube, followed to its steady motion."""

    prediction: Prediction  #: The steady motion; its pose is `prediction.steady_state`.
    run: LongRun  #: How it came there.
    robot: TubeRobot  #: What its rates follow from.
    start_gap: float  #: Smallest distance between body and wall at release, m.
    release: Release  #: As requested, without what is fitted of the contact.
    checked: Checked  #: Whether its table was checked at this pose.


def free_motion(
    robot: Robot,
    *,
    tail_rate: str | float | None = None,
    friction: str | None = None,
    fit: Fit = NO_FIT,
    placement: Placement | Mapping[str, Any] | None = None,
    weight: bool = True,
    roughness: str | float | None = None,
    in_tube: InTube | Mapping[str, Any] | None = None,
    until: float | None = None,
    turns_shown: int = 0,
    progress: Progress | None = None,
) -> FreeMotion:
    """Follow a robot after release in its tube to its steady motion, or to the gap `until`; otherwise as `settle`."""
    requested = Release.of(placement, in_tube, roughness, weight=weight)
    for item in field_values(requested.in_tube):
        if item.path in ("wait", "flow") and item.value is not None:
            raise InputError(f"in_tube.{item.path} = {item.text} has no steady motion; allowed: with `simulate`")
    ready = fit.central(robot)
    requested = requested._replace(placement=fit.placed(ready, requested.placement))
    release = requested.with_contact(fit.contact())
    if ready.channel is not None:  # without one, its table is refused
        if ready.drive is not None and ready.drive.kind == "magnetic":
            raise InputError(
                "drive.kind = 'magnetic': the motion depends on the phase of the field; allowed: drive.kind = "
                "'dc-motor', 'rate' or 'torque', `simulate`, or motion 'held'"
            )
        _check_until(until, gap_of(release.placement, ready.body.diameter, 0.5 * ready.channel.diameter))
    table = table_of_run(ready, release, progress)
    held, links = prepare_release(ready, table.packed, release, tail_rate, friction)
    state = released_state(ready, links, release.placement, release.in_tube.azimuth)
    gap = float(links.observe_state(state)[core.SEEN_FILM])
    _check_until(until, gap)
    load_size = abs(float(links.weight[: core.WEIGHT_MOMENT_BODY].sum())) * links.length
    heavy = load_size > _LIGHT * links.torque
    tell = progress or (lambda _what, _done, _total: None)
    sign = float(np.sign(held.tail_rotation_rate))
    run = long_run(links, state, sign, heavy=heavy, until=until, progress=tell, turns_shown=turns_shown)
    swimming = means_over(held, links, run.start, run.time, int(np.ceil(run.time / run.turn.time)))
    limits = reynolds_limits(held.batch, swimming.reynolds_number, swimming.tail_reynolds_number)
    inertia = check_stokes_flow(held.batch, limits)
    names = ("gap", "offset", "pitch", "yaw")
    checked = compare_with_check(links.table, **{name: run.turn.steps[:, STEPS.index(name)] for name in names})
    lies, slow = run.lying.state in ("steady", "orbits"), run.lying.approach_time
    stuck = sticking_notes(
        links,
        forward=float(swimming.forward_velocity[0]),
        turning=0.5 * ready.body.diameter * float(swimming.body_rotation_rate[0]),
        contact_force=run.lying.contact_force,
    )
    few_turns = _FEW_TURNS * run.turn.time
    warnings = (
        *(note for note in held.warnings if note.code != "robot-floats"),  # its weight acts
        *(note for note in inertia.values() if note not in held.warnings),
        *(checked.notes if lies and not stuck else ()),
        *([NO_WEIGHT] if weight and not links.weight.any() else []),
        *([Note.named("slow-approach", time=slow)] if run.lying.state == "steady" and slow > few_turns else []),
        *stuck,
    )
    known = lies and checked.known and not stuck
    error = table.speed_error_at(run.lying.yaw) if known else float("nan")
    error = in_stokes_flow(error, *limits)
    acts = friction_acts(held.friction, held.tail_rate)
    source = fit.source_of(ready, held.model, friction=acts)
    found = replace(held, swimming=swimming, error_estimate=error, warnings=warnings, motion="free", fitted_by=source)
    found = replace(found, steady_state=run.lying)
    return FreeMotion(found, run, links, gap, requested, checked)


def prepare_release(
    robot: Robot, table: Samples, release: Release, tail_rate: str | float | None, friction: str | None
) -> tuple[Prediction, TubeRobot]:
    """The robot held at its initial pose, and the coefficients of its rates with its drive on, by its packed table."""
    placed = release.placement
    held = predict_steady(robot, model="tube", tail_rate=tail_rate, friction=friction, placement=placed, band=False)
    links = links_in_tube(held, table, release)
    if held.tail_rate is None:
        drive = held.robot.drive
        return held, links.at_duty(1.0 if drive is None else drive.duty)
    changed = links.drive.copy()
    changed[core.DRIVE_KIND], changed[core.DRIVE_DUTY] = core.RATE, 1.0
    changed[core.DRIVE_GIVEN] = held.tail_rotation_rate
    return held, replace(links, drive=changed)


def _check_until(until: float | None, gap: float) -> None:
    """Refuse a final gap that does not lie below the initial one."""
    if until is not None and not until < gap:
        raise InputError(f"until = {show(until, 'mm')}; allowed: less than {show(gap, 'mm')}, the gap at the start")


def means_over(held: Prediction, links: TubeRobot, state: Samples, time: float, turns: int) -> Swimming:
    """Means of a motion from a state, (19,), over a time, s, with `turns` of the tail in it."""
    samples = min(turns * _SAMPLES, _MOST_SAMPLES)
    moments = np.linspace(0.0, time, samples + 1)
    duty = float(links.drive[core.DRIVE_DUTY])
    start = state.copy()
    start[[core.STATE_POSITION, core.STATE_ROLL]] = 0.0
    start[core.STATE_CURRENT + 1 :] = 0.0
    switches = [Switch(0.0, duty)]
    followed = integrate(links, start, moments, switches, Reach())
    more = {"mean_flow": followed.observed[:, core.SEEN_MEAN_FLOW]}
    series = dataset_of(held, links, followed, switches, more, {})

    def mean(name: str) -> float:
        return float(np.trapezoid(series[name].values, followed.time) / followed.time[-1])

    tail = mean("tail_rotation_rate")
    body = mean("body_rotation_rate")
    load_torque = mean("drive_torque")
    current, effective, residual = held.motor_current, held.effective_friction, np.nan
    motor = held.batch.electrics
    if motor is not None and held.batch.drive == "dc-motor":
        if held.tail_rate is not None:
            slip = tail - body
            current = float(current_at(motor, np.array([slip]))[0])
            spare = float(motor.joint_torque_constant[0]) * current - load_torque
            if held.friction == "rotor":
                effective = spare / slip
            else:
                residual = spare - (float(motor.joint_rotor_friction[0]) * slip if held.friction == "body" else 0.0)
        else:
            current = mean("motor_current")
    inferred = held.tail_rate is not None and held.friction == "rotor"
    known = {
        "forward_velocity": mean("forward_velocity"),
        "body_rotation_rate": body,
        "tail_rotation_rate": tail,
        "tail_torque": abs(load_torque),
        "drive_torque": load_torque,
        "shaft_power": mean("shaft_power"),
        "friction_power": effective * (tail - body) ** 2 if inferred else mean("friction_power"),
        "dissipated_power": mean("dissipated_power"),
        "motor_current": current,
        "effective_friction": effective,
        "motor_residual_torque": residual,
        "plug_velocity": mean("mean_flow"),
    }
    return swimming_of(held.batch, {name: np.array([value]) for name, value in known.items()}, np.array([True]))
