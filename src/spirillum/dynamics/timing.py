"""When a run ends, when it is sampled, and when the remote switches."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
from pydantic import BeforeValidator

from spirillum.arrays import Samples
from spirillum.errors import InputError
from spirillum.formats.tables import read_series
from spirillum.notes import Note
from spirillum.robot.arguments import Options, file_path, in_range, whole
from spirillum.robot.fields import Time
from spirillum.units import KINDS, parse_option

DUTY_COLUMNS = ("time_s", "duty")  #: Columns of a duty file; each row holds until the next one.
_WHAT = "a duty file (CSV with the columns time_s and duty)"
_LARGEST = 64 << 20
_LIMITS = dict(zip(DUTY_COLUMNS, ((0.0, 1e9), (0.0, 1.0)), strict=True))

Window = tuple[float, float]  #: Start and stop of a time in which the motor is on, s.


class Switch(NamedTuple):
    """From a time on, s, the drive has a duty."""

    time: float
    duty: float  #: 0 (off) to 1 (full throttle).


def windows_of(on: Sequence[tuple[str | float, str | float]] | None) -> list[Window] | None:
    """Times at which the motor is on, s; None: throughout."""
    if on is None:
        return None
    pairs = _listed(on) or []
    if not pairs or any(len(_listed(pair) or []) != 2 for pair in pairs):
        raise InputError(f'on = {str(on)[:60]}; allowed: pairs of start and stop, such as [("0 s", "2 s")]')
    return [
        (parse_option("on", start, KINDS["time"]), parse_option("on", stop, KINDS["time"])) for start, stop in pairs
    ]


def _listed(given: Any) -> list[Any] | None:
    """The items of a sequence that is no text; None of anything else."""
    return list(given) if isinstance(given, Sequence) and not isinstance(given, str | bytes | bytearray) else None


def schedule(on: Sequence[Window] | None, table: str | Path | None, duty: float, end: float) -> list[Switch]:
    """Every switching within a run, the first at 0."""
    if table is not None:
        if on is not None:
            raise InputError(f"on and duty = {str(table)[:80]} are given together; allowed: one of them")
        return [step for step in read_duty(table) if step.time < end]
    if on is None:
        return [Switch(0.0, duty)]
    switches = [Switch(0.0, 0.0)]
    before = 0.0
    for start, stop in on:
        if not before <= start < stop:
            raise InputError(f"on = {start:g} s to {stop:g} s; allowed: increasing times from 0 s, start before stop")
        before = stop
        for switch in (Switch(start, duty), Switch(stop, 0.0)):
            if switches[-1].time == switch.time:
                switches[-1] = switch
            elif switch.time < end:
                switches.append(switch)
    return switches


def read_duty(path: str | Path) -> list[Switch]:
    """Read and check a duty file; before its first row the motor is off."""
    switches = [Switch(*row) for row in read_series(path, _WHAT, _LIMITS, _LARGEST)]
    return switches if switches[0].time == 0 else [Switch(0.0, 0.0), *switches]


TRIAL_DURATION = 20.0  #: Length of a run in a tube, and of a trial, where none is given, s.
_LARGEST_SAMPLES = 1_000_000
_SHORTEST = 1e-6  # Shortest run, in turns.
_FEW_SAMPLES = 100  # Number from which on means over a part of a run do not depend on where the samples are.
_ROUNDING = 1e-9  # Difference of two times that is rounding, over the distance of two samples.


def duration_of(turns: float, turn: float, duration: float | None) -> float:
    """Length of a run, s."""
    if duration is None:
        return turns * turn
    if duration < _SHORTEST * turn:
        raise InputError(
            f"duration = {duration:g} s; allowed: at least {_SHORTEST * turn:.3g} s, a millionth of a turn"
        )
    return duration


class Timetable(NamedTuple):
    """Times of one run."""

    end: float  #: Length of the run, s.
    time: Samples  #: Evenly spaced samples from 0 to the end, s.
    switches: list[Switch]  #: Every switching of the remote, the first at 0.
    notes: list[Note]  #: Where the schedule of the remote and the run do not meet, a sentence each.


class Timing(Options, argument="timing"):
    """Length, sampling and remote control of a run; a turn is one of the tail at its steady rate, or of the field."""

    turns: Annotated[float, BeforeValidator(in_range(_SHORTEST, 1e5))] = 3.0
    """Length of the run in turns of the tail, or of the field (the paper's three periods; free in a tube: 20 s)."""
    duration: Time | None = None  #: Length of the run in time instead, with its unit (``"2 s"``) or a float in s.
    samples_per_turn: Annotated[int, BeforeValidator(whole(1, 10_000))] = 100  #: Samples of the output per turn.
    on: Annotated[Sequence[Window] | None, BeforeValidator(windows_of)] = None
    """Times (start, stop) between which the remote switches the drive on, with unit (``"2 s"``) or floats in s; None:
    on throughout."""
    duty: Annotated[str | Path | None, file_path("a duty file; one number is drive.duty of the robot")] = None
    """Duty file instead: CSV with the columns `time_s` and `duty` (0 to 1), each row until the next."""

    def check(self) -> None:
        """Refuse what no run can have, before anything is known of the robot's own rate."""
        if self.duration is not None and "turns" in self.model_fields_set:
            raise InputError(f"turns = {self.turns:g} together with a duration; allowed: one of them")
        schedule(self.on, self.duty, 1.0, math.inf if self.duration is None else self.duration)

    def of_trial(self) -> Timing:
        """This timing with the length of a trial where none is given."""
        given = {"turns", "duration"} & self.model_fields_set
        return self if given else self.model_copy(update={"duration": TRIAL_DURATION})

    def timetable(self, turn: float, duty: float) -> Timetable:
        """The times of a run; a sample that differs from a switching by rounding is at the switching."""
        end = duration_of(self.turns, turn, self.duration)
        switches = schedule(self.on, self.duty, duty, end)
        count = math.ceil(end / turn * self.samples_per_turn)
        if count > _LARGEST_SAMPLES:
            raise InputError(
                f"samples_per_turn = {self.samples_per_turn} makes {count} samples in {end:g} s; allowed: at most "
                f"{_LARGEST_SAMPLES} in all, as of a shorter time"
            )
        if count < _FEW_SAMPLES:  # one of them where the last two thirds begin, over which means are taken
            count = 3 * math.ceil(count / 3)
        time = np.linspace(0.0, end, count + 1)
        for switch in switches:
            nearest = round(switch.time / end * (time.size - 1))
            if 0 < nearest < time.size - 1 and abs(time[nearest] - switch.time) < _ROUNDING * time[1]:
                time[nearest] = switch.time
        return Timetable(end, time, switches, self._unused(switches, end))

    def _unused(self, switches: Sequence[Switch], end: float) -> list[Note]:
        """Parts of the schedule beyond the end of the run, a sentence each."""
        notes = []
        if all(switch.duty == 0 for switch in switches):
            notes.append(Note.named("nothing-switched-on", end=end))
        late = [(start, stop) for start, stop in self.on or () if start >= end]
        if late:
            first, last = late[0]
            also = f" and {len(late) - 1} more" if len(late) > 1 else ""
            notes.append(Note.named("on-beyond-end", first=first, last=last, also=also, end=end))
        return notes
