"""Measured trials as rows of `observations.csv`."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence

from spirillum.files import MARK, text_cell
from spirillum.measurement.observations import RATES
from spirillum.measurement.trials import Measured, Trial
from spirillum.robot.robot import Robot

_KEYS = ("robot", "channel_diameter_mm", "wavelength_mm", "amplitude_mm", "trial")
_SEEN = {
    "forward_velocity": "forward_velocity_mm_s",
    "tail_rotation_rate": "tail_rate_Hz",
    "body_rotation_rate": "body_rate_Hz",
}
"""What a camera sees. The motor's rate follows from two of them; a column of its own would count them twice."""


def observation_rows(trials: Sequence[Trial], robot: Robot, setup: str) -> str | None:
    """Text of an observations file, a row a trial with its own intervals, as `spirillum calibrate` reads it.

    Returns:
        The text; None if the robot swims in no channel, or nothing was measured.
    """
    if robot.channel is None:
        return None
    kept = [trial for trial in trials if any(math.isfinite(trial.quantities[name].value) for name in _SEEN)]
    if not kept:
        return None
    text = io.StringIO()
    if any(trial.synthetic for trial in kept):
        text.write("# SYNTHETIC: the videos say that they are computed; nothing was measured.\n")
    text.write(
        f"# Measured from video with {_safe(setup)}, {MARK}: one row a trial, signed about the swimming direction.\n"
    )
    for trial in kept:
        flags = ", ".join(dict.fromkeys(flag.name for flag in trial.flags))
        text.write(f"# trial {_safe(trial.name)}: {_safe(trial.video)}{'; flags: ' + flags if flags else ''}\n")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow((*_KEYS, *_SEEN.values(), *(f"{column}_ci95" for column in _SEEN.values())))
    where = [
        _safe(robot.name),
        *(f"{1e3 * length:.9g}" for length in (robot.channel.diameter, robot.tail.wavelength, robot.tail.amplitude)),
    ]
    for trial in kept:
        seen = [(trial.quantities[name], RATES[column]) for name, column in _SEEN.items()]
        cells = [_cell(item.value, factor) for item, factor in seen]
        halves = [_half_width(item, factor) if cell else "" for (item, factor), cell in zip(seen, cells, strict=True)]
        writer.writerow([*where, _trial(trial.name), *cells, *halves])
    return text.getvalue()


def _cell(value: float, factor: float) -> str:
    """A value in the column's unit; empty where it was not measured."""
    return f"{value / factor:.7g}" if math.isfinite(value) and value != 0 else ""


def _half_width(item: Measured, factor: float) -> str:
    """The larger half of a 95 % interval in the column's unit; empty where there is none."""
    half = max(item.high - item.value, item.value - item.low) / factor
    return f"{half:.4g}" if math.isfinite(half) else ""


def _trial(name: str) -> str:
    """A trial's name; one that reads as a fraction would be taken for a slip of the column."""
    safe = _safe(name)
    return f"trial {safe}" if safe.replace(".", "", 1).isdigit() and not safe.isdigit() else safe


def _safe(text: str) -> str:
    """One printable line, and no comment sign at its beginning."""
    return text_cell(text).lstrip("#").strip()[:200] or "trial"
