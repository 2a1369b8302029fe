"""The range of Reynolds numbers in which Stokes flow holds: one rule for every answer that has a speed.

Above `LOW_REYNOLDS` an answer has a warning. Above `BEYOND_STOKES` it is refused, unless the robot's own option
`model.beyond_stokes` is on; it then has no error estimate, because no other solution of Stokes flow knows inertia.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from spirillum.arrays import Flags, PerRobot, Samples
from spirillum.errors import InputError
from spirillum.notes import Note
from spirillum.robot.batch import RobotBatch
from spirillum.robot.limits import Limit, all_hold, broken
from spirillum.robot.robot import Robot
from spirillum.units import show

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


def without_reynolds_bound(robot: Robot) -> Robot:
    """Return the robot with its option `model.beyond_stokes` on."""
    return robot.model_copy(update={"model": robot.model.model_copy(update={"beyond_stokes": True})})
