"""Errors of each model on tails whose surface was resolved, interpolated to a robot's own tail; errors of a speed.

The numbers are those of `docs/accuracy.md`, which `benchmarks/stated_errors.py` computes: bare wires 1 mm thick and
60 mm long in unbounded fluid, and the paper's tail behind a capsule; model minus truth over truth.

In Stokes flow the relative errors of a tail depend on its shape alone: wavelength, wire diameter and length over the
amplitude, and the taper. The resolved tails differ in the first two independently. In the logarithms of these the
logarithm of model over truth is interpolated: a linear trend, and what it leaves at the resolved tails with weights of
one over the distance squared (D. Shepard, Proc. 23rd ACM National Conference, 517, 1968). That is continuous, and exact
at the resolved tails; beyond their range the value at its edge is taken. How far the closest of them is, in all four
numbers, the note says.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.data_tables import rows_of
from spirillum.robot.batch import RobotBatch

_WIRE, _LENGTH, _TAPER = 1.0, 60.0, 100.0  # mm, mm, c of the envelope
_SHAPE = ("wavelength over amplitude", "wire diameter over amplitude", "length over amplitude", "mean envelope")
"""Parameters of the tail on which its errors depend."""
_RESOLVED = 2  # Number of parameters that the reference tails vary: all are 60 wire diameters long and have one taper.
_SAME = 1e-6  # Distance below which a tail is a resolved one, to rounding error.


class TailError(NamedTuple):
    """Errors of B_11, B_14 and B_44 of one model on one tail, percent."""

    drag: float
    thrust: float
    torque: float


CHECKED: dict[str, dict[tuple[float, float], TailError]] = {}
"""Errors by model (`rft` with the printed coefficients, `slender` at standard accuracy) and by tail: wavelength and
amplitude, mm."""
for _row in rows_of("fluid/reference_errors.csv"):
    _wavelength, _amplitude, *_errors = (float(_row[name]) for name in ("wavelength", "amplitude", *TailError._fields))
    CHECKED.setdefault(_row["model"], {})[_wavelength, _amplitude] = TailError(*_errors)


SPEED_ERRORS = {"rft": 21, "sbt": 31}
"""Errors of the speed of the reference robot, percent: the paper's tail behind a capsule, in unbounded fluid."""
WITHOUT_INTERACTION = 14  #: Error of that speed, percent, from leaving out the flow between body and tail alone.
STATED = {row["of"]: row["error"].format(interaction=WITHOUT_INTERACTION) for row in rows_of("fluid/stated_errors.csv")}
"""Neglected effects and their errors, as text, by model and by its options."""


def validation_note(batch: RobotBatch, errors: Mapping[tuple[float, float], TailError]) -> str:
    """Return the errors of a model on the tail of a batch of one, and how far the closest resolved tail is."""
    own = _shape(batch)
    apart = {tail: np.log(own / _resolved_shape(*tail)) for tail in errors}
    closest = min(apart, key=lambda tail: float(np.linalg.norm(apart[tail])))
    name = "wavelength {:g} mm, amplitude {:g} mm".format(*closest)
    if np.linalg.norm(apart[closest]) < _SAME:
        of = f"against a resolved wire of this tail ({name})"
    else:
        most = int(np.argmax(np.abs(apart[closest])))
        factor = float(np.exp(abs(apart[closest][most])))
        of = (
            f"interpolated between resolved wires, the closest of which ({name}, 1 mm thick, 60 mm long) differs from "
            f"this tail by up to a factor of {factor:.3g} ({_SHAPE[most]} {_resolved_shape(*closest)[most]:.3g}, here "
            f"{own[most]:.3g})"
        )
    drag, thrust, torque = (f"{value:+.{3 if abs(value) >= 100 else 2}g} %" for value in tail_error(batch, errors))
    return f"{of}: drag {drag}, thrust {thrust}, axial torque {torque} of the tail"


def tail_error(batch: RobotBatch, errors: Mapping[tuple[float, float], TailError]) -> TailError:
    """Return the errors of a model on the tail of a batch of one, interpolated between the resolved tails."""
    own = _shape(batch)
    at = np.log([_resolved_shape(*tail)[:_RESOLVED] for tail in errors])
    place = np.clip(np.log(own[:_RESOLVED]), at.min(axis=0), at.max(axis=0))
    known = np.log1p(0.01 * np.array(list(errors.values())))
    design = np.column_stack([np.ones(len(at)), at])
    trend = np.linalg.lstsq(design, known, rcond=None)[0]
    weights = 1.0 / np.maximum(np.sum((at - place) ** 2, axis=1), _SAME**2)
    left = weights @ (known - design @ trend) / weights.sum()
    return TailError(*(100.0 * np.expm1(np.array([1.0, *place]) @ trend + left)).tolist())


def speed_note(model: str) -> str:
    """Return by how much a model without the flow between body and tail misses the reference robot's speed."""
    return (
        f"body and tail do not interact, which alone adds {WITHOUT_INTERACTION} % to the speed of a robot with the "
        f"paper's tail; in all that speed is {SPEED_ERRORS[model]:+d} % off"
    )


def fit_clause(fitted_by: str) -> str:
    """Clause on the fitted part of a result."""
    return f"what {fitted_by} has fitted is taken from it" if fitted_by else "nothing is fitted"


def wall_clause(batch: RobotBatch) -> str:
    """Clause on neglected walls of a robot's channel, after a semicolon; empty without a channel."""
    return "; the walls of its channel are not computed" if math.isfinite(float(batch.channel_diameter[0])) else ""


def _shape(batch: RobotBatch) -> Samples:
    """The numbers of `_SHAPE` of the tail of a batch of one, (4,)."""
    amplitude = float(batch.amplitude[0])
    lengths = (float(getattr(batch, name)[0]) for name in ("wavelength", "wire_diameter", "tail_length"))
    return np.array([*(length / amplitude for length in lengths), _mean_envelope(float(batch.taper[0]))])


def _resolved_shape(wavelength: float, amplitude: float) -> Samples:
    return np.array([wavelength / amplitude, _WIRE / amplitude, _LENGTH / amplitude, _mean_envelope(_TAPER)])


def _mean_envelope(taper: float) -> float:
    """Mean of 1 - exp(-c xi/L_t) over the tail; 1 for a plain helix."""
    return 1.0 if math.isinf(taper) else 1.0 + math.expm1(-taper) / taper
