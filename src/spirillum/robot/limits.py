"""Requirements on robots, over arrays: field, value, allowed range, reason."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from spirillum.arrays import Flags, PerRobot
from spirillum.notes import Note
from spirillum.robot.batch import RobotBatch
from spirillum.robot.geometry import coil_curvature, coil_spacing, shortest_body
from spirillum.robot.tail_form import ROOT_SHARE, closest_strands, strand_spacing
from spirillum.units import show, show_apart


@dataclass(frozen=True)
class Limit:
    """One requirement on a field, for every robot of a batch."""

    field: str
    value: PerRobot
    relation: str
    bound: PerRobot
    unit: str
    why: str
    holds: Flags
    flag: str

    @classmethod
    def of(
        cls,
        field: str,
        value: PerRobot,
        relation: Literal["more than", "less than", "at least", "at most", "exactly"],
        bound: PerRobot | float,
        unit: str,
        why: str,
        flag: str,
    ) -> Limit:
        """Require `value` in `relation` to `bound`; equality is tested to rounding error."""
        limit = np.atleast_1d(np.asarray(bound, dtype=float))
        slack = 1e-12 * np.abs(np.where(np.isinf(limit), 0.0, limit))
        if relation == "more than":
            holds = value > limit
        elif relation == "less than":
            holds = value < limit
        elif relation == "at least":
            holds = value >= limit - slack
        elif relation == "at most":
            holds = value <= limit + slack
        else:
            holds = np.abs(value - limit) <= slack
        return cls(field, value, relation, limit, unit, why, holds, flag)

    def caution(self, index: int = 0) -> Note:
        """The note where an answer is given although the requirement is broken, for robot number `index`."""
        return Note(caution_code(self.flag), self._said(index, "accurate"), (self.field,))

    def sentence(self, index: int = 0) -> str:
        """Message about the violated requirement, for robot number `index`."""
        return self._said(index, "allowed")

    def bound_in_words(self) -> str:
        """What is allowed, for the first robot; empty where there is no bound."""
        bound = float(self.bound[0])
        return f"{self.relation} {show(bound, self.unit)}" if np.isfinite(bound) else ""

    def _said(self, index: int, word: str) -> str:
        value, bound = (a[index if a.size > 1 else 0] for a in (self.value, self.bound))
        lack, colon, name = self.field.partition(": ")
        if colon and np.isinf(value):  # there is none
            return f"{lack}; {word}: a robot with a {name}, because {self.why}"
        said, allowed = show_apart(float(value), float(bound), self.unit)
        return f"{self.field} = {said}; {word}: {self.relation} {allowed}, because {self.why}"


def caution_code(flag: str) -> str:
    """Code of the note on a broken requirement of accuracy, by its flag."""
    return "inertia" if flag.endswith("reynolds-number") else "outside-validity"


def broken(limits: Iterable[Limit]) -> list[Limit]:
    """The limits that at least one robot breaks."""
    return [limit for limit in limits if not np.all(limit.holds)]


def all_hold(limits: Iterable[Limit]) -> Flags:
    """Where every limit holds."""
    result: Flags = np.ones(1, dtype=bool)
    for limit in limits:
        result = result & limit.holds
    return result


def assembly_limits(batch: RobotBatch) -> list[Limit]:
    """Requirements on a robot that can be built and put into its channel."""
    return [*_body_limits(batch), *_tail_limits(batch), *_channel_limits(batch)]


def within(batch: RobotBatch, limits: Iterable[Limit] = ()) -> list[int]:
    """Indices of the robots that are finite, can be built and satisfy all limits."""
    fit = batch.known & all_hold([*assembly_limits(batch), *limits])
    return [int(index) for index in np.flatnonzero(np.broadcast_to(fit, (batch.size,)))]


def _channel_limits(b: RobotBatch) -> list[Limit]:
    fits = "has to fit into channel.diameter"
    across = 0.5 * (b.channel_diameter - b.wire_diameter)
    along = b.channel_length - b.body_length - b.coupling_length
    return [
        Limit.of(
            "body.diameter",
            b.body_diameter,
            "less than",
            b.channel_diameter,
            "mm",
            f"the body {fits}",
            "body-wider-than-channel",
        ),
        Limit.of(
            "coupling.diameter",
            b.coupling_diameter,
            "less than",
            b.channel_diameter,
            "mm",
            f"the coupling {fits}",
            "coupling-wider-than-channel",
        ),
        Limit.of(
            "tail.curve: amplitude" if b.form.curve else "tail.amplitude",
            b.amplitude,
            "less than",
            across,
            "mm",
            f"the tail with half its wire {fits}",
            "tail-wider-than-channel",
        ),
        Limit.of(
            "body.length",
            b.body_length,
            "less than",
            b.channel_length - b.coupling_length,
            "mm",
            "body and coupling have to fit into channel.length with a tail behind them",
            "robot-longer-than-channel",
        ),
        Limit.of(
            "tail.length",
            b.tail_length,
            "at most",
            along,
            "mm",
            "body, coupling and tail together have to fit into channel.length",
            "robot-longer-than-channel",
        ),
    ]


def _body_limits(b: RobotBatch) -> list[Limit]:
    coupled = b.coupling_length > 0
    clearance = Limit.of(
        "coupling.clearance",
        np.where(coupled, b.coupling_clearance, 0.0),
        "less than",
        np.where(coupled, 0.5 * b.coupling_length, np.inf),
        "mm",
        "it is left free on both sides within coupling.length",
        "clearance-too-large",
    )
    if b.shape in ("spheroid", "profile", "none"):
        return [clearance]
    if b.shape == "sphere":
        why = "a sphere is as long as its diameter"
        return [
            Limit.of("body.length", b.body_length, "exactly", b.body_diameter, "mm", why, "sphere-not-round"),
            clearance,
        ]
    fillet = "an edge radius is at most the body's radius"
    ends = "both ends have to fit into the overall length"
    shortest = shortest_body(b.body_diameter, b.fillet, b.front, b.rear)
    return [
        Limit.of("body.fillet", b.fillet, "at most", 0.5 * b.body_diameter, "mm", fillet, "fillet-too-large"),
        Limit.of("body.length", b.body_length, "at least", shortest, "mm", ends, "body-shorter-than-ends"),
        clearance,
    ]


def _spacing_and_curvature(b: RobotBatch) -> tuple[PerRobot, PerRobot]:
    """Least distance between neighbouring wires or turns, and largest curvature of each tail's centre lines."""
    form = b.form
    if form.curve:
        radius = float(0.5 * np.max(b.wire_diameter))
        line = form.centre
        strands = [line.samples @ turn.T for turn in form.rotations]
        clear = line.arc > (ROOT_SHARE * line.length if form.starts > 1 else -1.0)
        nearest = closest_strands([strand[clear] for strand in strands], line.arc[clear], radius)
        return np.full(1, nearest), np.full(1, line.curvature)
    amplitude, wavelength = (b.amplitude, b.wavelength) if form.is_helix else form.widths(b.amplitude, b.wavelength)
    spacing = coil_spacing(wavelength, amplitude)
    if form.starts > 1:
        spacing = np.minimum(spacing, strand_spacing(wavelength, amplitude, form.starts))
    curvature = coil_curvature(wavelength, amplitude)
    return (spacing, curvature) if form.is_helix else (np.min(spacing, axis=-1), np.max(curvature, axis=-1))


def _tail_limits(b: RobotBatch) -> list[Limit]:
    spacing, curvature = _spacing_and_curvature(b)
    whose = " of tail.curve" if b.form.curve else " of the coil (tail.wavelength, tail.amplitude)"
    between = " or wires (tail.starts)" if b.form.starts > 1 else ""
    bend = "curve's" if b.form.curve else "coil's"
    return [
        Limit.of(
            "tail.wire_diameter",
            b.wire_diameter,
            "less than",
            spacing,
            "mm",
            f"neighbouring turns{whose}{between} would touch",
            "turns-touch",
        ),
        Limit.of(
            "tail.wire_diameter",
            b.wire_diameter,
            "less than",
            np.divide(2.0, curvature, out=np.full_like(curvature, np.inf), where=curvature > 0),
            "mm",
            f"the wire's radius has to stay below the {bend} radius of curvature",
            "wire-too-thick-for-coil",
        ),
        Limit.of(
            "tail.length",
            b.tail_length,
            "less than",
            1000.0 * b.wavelength,
            "mm",
            "a tail has at most 1000 turns of tail.wavelength",
            "too-many-turns",
        ),
    ]
