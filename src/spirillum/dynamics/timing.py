"""When a run ends, when it is sampled, and when the remote switches."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from numbers import Integral
from pathlib import Path
from typing import Annotated, Any, NamedTuple

from pydantic import BeforeValidator, StrictFloat, StrictStr, ValidationError

from spirillum.arrays import Samples
from spirillum.dynamics.remote import Switch, Window, schedule, windows_of
from spirillum.dynamics.sampling import duration_of, sample_times
from spirillum.errors import InputError, did_you_mean
from spirillum.robot.fields import Section

__all__ = ["Timetable", "Timing"]


def _whole(value: Any) -> Any:
    if isinstance(value, bool) or not isinstance(value, Integral):
        raise InputError(f"samples-per-turn = {str(value)[:40]}; allowed: a whole number from 1 to 10000")
    return int(value)


def _duty_file(value: Any) -> Any:
    if not (value is None or isinstance(value, (str, Path))):
        raise InputError(f"duty = {str(value)[:40]}; allowed: a duty file; one number is drive.duty of the robot")
    return value


class Timetable(NamedTuple):
    """Times of one run."""

    end: float
    """Length of the run, s."""
    time: Samples
    """Evenly spaced samples from 0 to the end, s."""
    switches: list[Switch]
    """Every switching of the remote, the first at 0."""


class Timing(Section):
    """Length, sampling and remote control of a run; a turn is one of the tail at its steady rate, or of the field."""

    turns: StrictFloat = 3.0
    """Length of the run in turns (the paper's three periods)."""
    duration: StrictStr | StrictFloat | None = None
    """Length of the run instead, with its unit (``"2 s"``) or a float in s."""
    samples_per_turn: Annotated[int, BeforeValidator(_whole)] = 100
    """Samples of the output per turn."""
    on: Annotated[Sequence[Window] | None, BeforeValidator(windows_of)] = None
    """Times (start, stop) between which the remote switches the drive on, with unit (``"2 s"``) or floats in s; None:
    on throughout."""
    duty: Annotated[str | Path | None, BeforeValidator(_duty_file)] = None
    """Duty file instead: CSV with the columns `time_s` and `duty` (0 to 1), each row until the next."""

    @classmethod
    def of(cls, value: Timing | Mapping[str, Any] | None) -> Timing:
        """A timing from what a caller may give.

        Args:
            value: a timing, its fields by name, or None: three turns, on throughout.

        Raises:
            InputError: for an unknown field or a wrong value.
        """
        if isinstance(value, cls):
            return value
        names = ", ".join(cls.model_fields)
        if not (value is None or isinstance(value, Mapping)):
            raise InputError(f"timing = {str(value)[:60]!r}; allowed: {names}, each by name")
        for name in value or {}:
            if name not in cls.model_fields:
                hint = did_you_mean(str(name)[:60], cls.model_fields)
                raise InputError(f"timing.{name} is not a known field{hint}; allowed: {names}")
        try:
            return cls(**(value or {}))
        except ValidationError as error:
            first = error.errors()[0]
            cause = first.get("ctx", {}).get("error")
            if isinstance(cause, InputError):
                raise cause from error
            name = str(first["loc"][0])
            allowed = {"turns": "a number of turns", "duration": "a time, as in 2 s, or a float in s"}.get(name, names)
            raise InputError(f"{name} = {str(first['input'])[:40]}; allowed: {allowed}") from error

    def timetable(self, turn: float, duty: float) -> Timetable:
        """The times of a run.

        Args:
            turn: time of a turn, s.
            duty: the drive's own duty.

        Raises:
            InputError: for a length that is none, too many samples, times that go back, or a wrong duty file.
        """
        end = duration_of(self.turns, turn, self.duration)
        time = sample_times(end, turn, self.samples_per_turn)
        return Timetable(end, time, schedule(self.on, self.duty, duty, end))
