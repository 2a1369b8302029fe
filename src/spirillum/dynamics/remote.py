"""What the remote control does in a run: switching on and off, or a duty that follows a file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from spirillum.errors import InputError
from spirillum.formats.tables import read_series
from spirillum.units import KINDS, parse_option

DUTY_COLUMNS = ("time_s", "duty")
"""Columns of a duty file; each row holds until the next one."""
_WHAT = "a duty file (CSV with the columns time_s and duty)"
_LARGEST = 64 << 20
_LIMITS = dict(zip(DUTY_COLUMNS, ((0.0, 1e9), (0.0, 1.0)), strict=True))

Window = tuple[float, float]
"""Start and stop of a time in which the motor is on, s."""


class Switch(NamedTuple):
    """From a time on, the drive has a duty."""

    time: float
    """s."""
    duty: float
    """0 (off) to 1 (full throttle)."""


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
    """Every switching within a run, the first at 0.

    Args:
        on: times at which the motor has its own duty; None: throughout.
        table: duty file instead.
        duty: the drive's own duty.
        end: length of the run, s.
    """
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
