"""A template of an observations file, and what a filled one holds."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from spirillum.envelope import envelope
from spirillum.files import new_file, output_target
from spirillum.measurement.observations import (
    COLUMNS,
    ObservationRow,
    all_rates,
    observation_table,
    read_observations,
    unread_columns,
)
from spirillum.measurement.rate_checks import convention_doubt

_TEMPLATE = """\
# Observed speeds and rates, one row for each trial. Lines that start with # are comments.
# robot: its name, for people. The channel, wavelength and amplitude of the tail say which robot a row belongs to.
# channel_diameter_mm, wavelength_mm, amplitude_mm: needed. amplitude is the radius of the wire's centreline.
# trial: its number; a trial of a tail stands once.
# forward_velocity_mm_s, tail_rate_Hz, body_rate_Hz, motor_rate_Hz: what was measured; leave empty what was not.
#   All are signed about the swimming direction, in the lab; 1 Hz is one turn a second. A right-handed tail drives
#   with a positive rate, the body turns against it, and the motor's rate is the tail's less the body's.
# trials: only for a row that is a mean over that many trials.
# the columns *_ci95: half widths of 95 % intervals, where known: the error of this trial, or of the mean.
# Further columns, such as note, are yours; they are not read.
"""


def new_observations_file(path: str | Path, *, overwrite: bool = False) -> None:
    """Write an empty observations file: comments and the header."""
    target = output_target(path, {".csv": "an observations file"}, "observations.csv", replace="none")
    new_file(target, f"{_TEMPLATE}{','.join(COLUMNS)}\n", overwrite=overwrite)


def observations_answer(path: str | Path) -> dict[str, Any]:
    """The answer of `spirillum observations check`."""
    items = read_observations(path)
    names = ("forward_velocity", "tail_rate", "body_rate", "motor_rate")
    content = {
        "file": str(path),
        "valid": True,
        "rows": len(items),
        "tails": len({item.tail for item in items}),
        "channels": len({item.tail[0] for item in items}),
        "measured": {name: sum(_measured(item, name) for item in items) for name in names},
    }
    doubts = convention_doubt(all_rates(items))
    return envelope("observations", content, (*unread_columns(observation_table(path)), *doubts))


def _measured(item: ObservationRow, name: str) -> bool:
    """Whether a row holds a quantity itself: a motor rate may be tail less body rate."""
    return math.isfinite(getattr(item, name)) and not (name == "motor_rate" and item.motor_derived)
