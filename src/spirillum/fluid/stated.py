"""What each model missed of tails whose surface was resolved, and which of them a robot's own tail is like.

The numbers are those of `docs/accuracy.md`, which `benchmarks/stated_errors.py` computes: bare wires 1 mm thick and
60 mm long in unbounded fluid, model minus truth over truth.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from spirillum.robot.batch import RobotBatch

__all__ = ["CHECKED", "TailError", "said_of_tail", "walls_left_out"]

_WIRE, _LENGTH, _TAPER = 1.0, 60.0, 100.0  # mm, mm, c of the envelope
_ALIKE = 1.5
"""Largest ratio of wavelength, wire, number of turns and mean envelope between tails that count as alike."""


class TailError(NamedTuple):
    """Errors of one model on one tail, percent."""

    drag: float
    """Of B_11."""
    thrust: float
    """Of B_14."""
    torque: float
    """Of B_44."""


CHECKED: dict[str, dict[tuple[float, float], TailError]] = {
    "rft": {
        (25.0, 2.5): TailError(56, 22, -31),
        (10.0, 1.5): TailError(168, 57, -36),
        (15.0, 2.0): TailError(109, 43, -31),
        (10.0, 3.5): TailError(271, 144, 12),
    },
    "sbt": {
        (25.0, 2.5): TailError(-1.5, 8.7, -11),
        (10.0, 1.5): TailError(-2.4, 2.2, -18),
        (15.0, 2.0): TailError(-1.4, 5.3, -14),
        (10.0, 3.5): TailError(1.9, 5.9, -6.7),
    },
    "slender": {
        (25.0, 2.5): TailError(-0.56, -0.52, -0.76),
        (10.0, 1.5): TailError(-1.3, 1.0, -1.0),
        (15.0, 2.0): TailError(-0.81, -0.051, -0.88),
        (10.0, 3.5): TailError(-0.77, 2.7, -1.0),
    },
}
"""Errors by model (`rft` with the printed coefficients, `slender` at standard accuracy) and by tail: wavelength and
amplitude, mm."""


def said_of_tail(batch: RobotBatch, errors: Mapping[tuple[float, float], TailError]) -> str:
    """What a model misses of the tail of a batch of one, or of the checked tail that comes nearest.

    Args:
        batch: one robot.
        errors: of the model, by checked tail.
    """
    own = _shape(float(batch.wavelength[0]), float(batch.amplitude[0]), float(batch.wire_diameter[0]), batch)
    apart = {tail: _apart(own, _checked_shape(*tail)) for tail in errors}
    nearest = min(apart, key=lambda tail: apart[tail])
    drag, thrust, torque = (f"{value:+.{3 if abs(value) >= 100 else 2}g} %" for value in errors[nearest])
    name = "wavelength {:g} mm, amplitude {:g} mm".format(*nearest)
    if apart[nearest] == 0:
        of = f"against a resolved wire of this tail ({name})"
    elif apart[nearest] <= math.log(_ALIKE):
        of = f"against a resolved wire of a tail much like this one ({name}, 1 mm thick)"
    else:
        of = (
            f"this tail (wavelength {own[0]:.2g} and wire {own[1]:.2g} amplitudes, {own[2]:.2g} turns, on average "
            f"{100 * own[3]:.2g} % of the amplitude) was not held against a resolved wire; the nearest that was "
            f"({name}, 1 mm thick, 60 mm long) says"
        )
    return f"{of}: drag {drag}, thrust {thrust}, axial torque {torque} of the tail"


def what_is_fitted(fitted_by: str) -> str:
    """What an answer has from observations, in half a sentence.

    Args:
        fitted_by: file of a calibration or a posterior whose values act on the answer; empty without one.
    """
    return f"what {fitted_by} has fitted is taken from it" if fitted_by else "nothing is fitted"


def walls_left_out(batch: RobotBatch) -> str:
    """That the walls of a robot's channel are left out, after a semicolon; empty for a robot without one."""
    return "; the walls of its channel are not computed" if math.isfinite(float(batch.channel_diameter[0])) else ""


Shape = tuple[float, float, float, float]
"""Wavelength and wire's diameter over the amplitude, number of turns, and mean of the envelope over the amplitude."""


def _shape(wavelength: float, amplitude: float, wire: float, batch: RobotBatch) -> Shape:
    turns = float(batch.tail_length[0]) / wavelength
    return wavelength / amplitude, wire / amplitude, turns, _mean_envelope(float(batch.taper[0]))


def _checked_shape(wavelength: float, amplitude: float) -> Shape:
    return wavelength / amplitude, _WIRE / amplitude, _LENGTH / wavelength, _mean_envelope(_TAPER)


def _mean_envelope(taper: float) -> float:
    """Mean of 1 - exp(-c xi/L_t) over the tail; 1 for a plain helix."""
    return 1.0 if math.isinf(taper) else 1.0 + math.expm1(-taper) / taper


def _apart(own: Shape, other: Shape) -> float:
    """Largest logarithm of a ratio; 0 for the same shape to rounding error."""
    found = max(abs(math.log(a / b)) for a, b in zip(own, other, strict=True))
    return 0.0 if found < 1e-6 else found
