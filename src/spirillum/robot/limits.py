"""Requirements on robots, over arrays: field, value, allowed range, reason. Their words stand in `limits.csv`.

The range of Reynolds numbers in which Stokes flow holds is one rule for every answer that has a speed. Above
`LOW_REYNOLDS` an answer has a warning. Above `BEYOND_STOKES` it is refused, unless the robot's own option
`model.beyond_stokes` is on; it then has no error estimate, because no other solution of Stokes flow knows inertia.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Literal, NamedTuple

import numpy as np

from spirillum.arrays import Flags, PerRobot, Samples
from spirillum.data_tables import rows_of
from spirillum.errors import InputError
from spirillum.notes import Note
from spirillum.robot.batch import RobotBatch
from spirillum.robot.geometry import shortest_body
from spirillum.robot.tail_form import ROOT_SHARE, closest_strands, coil_curvature, coil_spacing, strand_spacing
from spirillum.units import show, show_apart

_WORDS: dict[str, dict[str, Any]] = {row.pop("name"): dict(row) for row in rows_of("limits.csv")}
"""Field, relation, unit, reason and flag of requirements by their names."""


class Limit(NamedTuple):
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
        if relation == "more than":
            return cls(field, value, relation, limit, unit, why, value > limit, flag)
        if relation == "less than":
            return cls(field, value, relation, limit, unit, why, value < limit, flag)
        slack = 1e-12 * np.abs(np.where(np.isinf(limit), 0.0, limit))
        if relation == "at least":
            holds = value >= limit - slack
        elif relation == "at most":
            holds = value <= limit + slack
        else:
            holds = np.abs(value - limit) <= slack
        return cls(field, value, relation, limit, unit, why, holds, flag)

    @classmethod
    def named(cls, name: str, value: PerRobot, bound: PerRobot | float, /, **words: Any) -> Limit:
        """Require what `limits.csv` states under a name, with `words` in its texts."""
        row = {column: text.format(**words) if words else text for column, text in _WORDS[name].items()}
        return cls.of(value=value, bound=bound, **row)

    def caution(self, index: int = 0) -> Note:
        """The note where an answer is given although the requirement is broken, for robot number `index`."""
        code = "inertia" if self.flag.endswith("reynolds-number") else "outside-validity"
        return Note(code, self._statement(index, "accurate"), (self.field,))

    def sentence(self, index: int = 0) -> str:
        """Message about the violated requirement, for robot number `index`."""
        return self._statement(index, "allowed")

    def bound_in_words(self) -> str:
        """What is allowed, for the first robot; empty where there is no bound."""
        bound = float(self.bound[0])
        return f"{self.relation} {show(bound, self.unit)}" if np.isfinite(bound) else ""

    def _statement(self, index: int, word: str) -> str:
        value, bound = (a[index if a.size > 1 else 0] for a in (self.value, self.bound))
        lack, colon, name = self.field.partition(": ")
        if colon and np.isinf(value):  # there is none
            return f"{lack}; {word}: a robot with a {name}, because {self.why}"
        said, allowed = show_apart(float(value), float(bound), self.unit)
        return f"{self.field} = {said}; {word}: {self.relation} {allowed}, because {self.why}"


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
    across = 0.5 * (b.channel_diameter - b.wire_diameter)
    behind = b.channel_length - b.coupling_length
    return [
        Limit.named("body-in-channel", b.body_diameter, b.channel_diameter),
        Limit.named("coupling-in-channel", b.coupling_diameter, b.channel_diameter),
        Limit.named(
            "tail-in-channel", b.amplitude, across, tail="tail.curve: amplitude" if b.form.curve else "tail.amplitude"
        ),
        Limit.named("body-along-channel", b.body_length, behind),
        Limit.named("robot-along-channel", b.tail_length, b.channel_length - b.body_length - b.coupling_length),
    ]


def _body_limits(b: RobotBatch) -> list[Limit]:
    coupled = b.coupling_length > 0
    room = np.where(coupled, 0.5 * b.coupling_length, np.inf)
    limits = [Limit.named("coupling-clearance", np.where(coupled, b.coupling_clearance, 0.0), room)]
    if b.shape in ("spheroid", "profile", "none"):
        return limits
    if b.shape == "sphere":
        return [Limit.named("sphere", b.body_length, b.body_diameter), *limits]
    shortest = shortest_body(b.body_diameter, b.fillet, b.front, b.rear)
    ends = Limit.named("body-ends", b.body_length, shortest)
    return [Limit.named("fillet", b.fillet, 0.5 * b.body_diameter), ends, *limits]


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
    tightest = np.divide(2.0, curvature, out=np.full_like(curvature, np.inf), where=curvature > 0)
    return [
        Limit.named("wire-between-turns", b.wire_diameter, spacing, whose=whose, between=between),
        Limit.named("wire-in-bend", b.wire_diameter, tightest, bend="curve's" if b.form.curve else "coil's"),
        Limit.named("turns", b.tail_length, 1000.0 * b.wavelength),
    ]


LOW_REYNOLDS = 0.1  #: Reynolds number above which an answer has a warning.
BEYOND_STOKES = 10.0
"""Reynolds number above which inertia dominates: an answer is refused unless `beyond_stokes` is set."""
_BODY, _TAIL, _FLOW = "reynolds-number", "tail-reynolds-number", "flow-reynolds-number"


def body_reynolds(batch: RobotBatch, speed: Samples | float) -> Samples:
    """Return rho |U| D_b/mu, the Reynolds number on the body's diameter."""
    return batch.density * np.abs(speed) * batch.body_diameter / batch.viscosity


def tail_reynolds(batch: RobotBatch, tail_rate: Samples | float) -> Samples:
    """Return rho |omega| B_o^2/mu, the Reynolds number on the tail's amplitude."""
    return batch.density * np.abs(tail_rate) * batch.amplitude**2 / batch.viscosity


def reynolds_limits(batch: RobotBatch, body: PerRobot, tail: PerRobot) -> list[Limit]:
    """Return the limits of a steady motion, by its Reynolds numbers, and of the imposed flow."""
    return [
        flow_limit(batch, abs(batch.placement.flow or 0.0)),
        _limit("body diameter", body, _BODY),
        _limit("tail amplitude", tail, _TAIL),
    ]


def motion_limits(batch: RobotBatch, velocity: Samples, tail_rate: Samples) -> list[Limit]:
    """Return the limits of a motion in time, at its largest speed and tail rate; NaN does not count."""
    speed = _largest(np.linalg.norm(velocity, axis=-1) if np.ndim(velocity) > 1 else velocity)
    rate = _largest(tail_rate)
    body = f"body diameter, at the largest speed of the run, {1e3 * speed:.4g} mm/s"
    tail = f"tail amplitude, at the largest tail rate of the run, {show(rate, 'Hz')}"
    return [_limit(body, body_reynolds(batch, speed), _BODY), _limit(tail, tail_reynolds(batch, rate), _TAIL)]


def flow_limit(batch: RobotBatch, flow: float) -> Limit:
    """Return the limit of an imposed flow of `flow` m/s, at its fastest."""
    return _limit("imposed flow, body diameter", body_reynolds(batch, flow), _FLOW)


def _limit(length: str, value: PerRobot, flag: str) -> Limit:
    return Limit.named("stokes-flow", value, LOW_REYNOLDS, length=length, flag=flag)


def _largest(values: Samples) -> float:
    return float(np.max(np.abs(values), initial=0.0, where=np.isfinite(values)))


def is_stokes_flow(batch: RobotBatch, limits: Iterable[Limit]) -> Flags:
    """Return where no Reynolds number is above `BEYOND_STOKES`; everywhere where the robots' option allows any."""
    if batch.options.beyond_stokes:
        return np.ones(1, dtype=bool)
    return all_hold(_refused(limits))


def _refused(limits: Iterable[Limit]) -> list[Limit]:
    """Limits on Reynolds numbers at `BEYOND_STOKES`; a limit without a Reynolds number, NaN, stays as it is."""
    return [
        limit._replace(bound=np.full(1, BEYOND_STOKES), holds=~(np.asarray(limit.value) > BEYOND_STOKES))
        for limit in limits
    ]


def stokes_flow_problem(batch: RobotBatch, limits: Iterable[Limit]) -> str:
    """Return the sentence of the refusal, of the first robot whose motion is refused; empty where none is."""
    if batch.options.beyond_stokes:
        return ""
    for limit in broken(_refused(limits)):
        value = float(limit.value[int(np.argmin(limit.holds))])
        return (
            f"{limit.field} = {value:.3g}; allowed: at most {BEYOND_STOKES:g}, for these models neglect inertia; a "
            "more viscous fluid, a slower or a smaller robot, or model.beyond_stokes = on (--set "
            "model.beyond_stokes=on)"
        )
    return ""


def reynolds_warnings(limits: Iterable[Limit]) -> dict[str, Note]:
    """Return a warning for each limit that a robot exceeds, of its largest Reynolds number, by the limit's flag."""
    return {
        limit.flag: limit.caution(int(np.nanargmax(limit.value)))
        for limit in limits
        if np.any(np.asarray(limit.value) > LOW_REYNOLDS)
    }


def check_stokes_flow(batch: RobotBatch, limits: Iterable[Limit]) -> dict[str, Note]:
    """Refuse a motion far outside Stokes flow; return a note for each limit that it exceeds, by the limit's flag."""
    listed = list(limits)
    if problem := stokes_flow_problem(batch, listed):
        raise InputError(problem)
    return reynolds_warnings(listed)


def in_stokes_flow(error: float, *limits: Limit) -> float:
    """An error estimate against other solutions of Stokes flow; NaN where inertia rules, which none of them knows."""
    return error if bool(np.all(all_hold(_refused(limits)))) else float("nan")
