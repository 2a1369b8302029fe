"""Where a run begins: the robot's place in its channel, at rest."""

from __future__ import annotations

import numpy as np

from spirillum.arrays import Samples
from spirillum.dynamics.integration import Reach
from spirillum.errors import InputError
from spirillum.fluid.tube.place import GAP_SHARE
from spirillum.kernels.two_links import ATTITUDE, STATES
from spirillum.robot.links import outlines_of
from spirillum.robot.placement import Placement
from spirillum.robot.robot import Robot
from spirillum.robot.seat import body_gap, largest_gap, offset_for_gap
from spirillum.units import show

__all__ = ["reach_of", "start_state"]


def start_state(robot: Robot, placement: Placement, *, lying: bool) -> Samples:
    """The state of a robot at rest in its place, (17,).

    Args:
        robot: the robot.
        placement: its `gap` or `eccentricity`, and `pitch`; what is left open is level, and where the gap is open the
            robot lies at a gap of `GAP_SHARE` of its radius, or in the middle.
        lying: whether a robot whose gap is open lies low.

    Raises:
        InputError: for a placement without a channel or for more than a run knows, or where the body does not fit.
    """
    _check(robot, placement)
    state = np.zeros(STATES)
    pitch = placement.pitch or 0.0
    state[ATTITUDE], state[ATTITUDE + 2] = np.cos(0.5 * pitch), -np.sin(0.5 * pitch)
    if robot.channel is None:
        return state
    state[2] = -_offset(robot, placement, pitch, lying=lying)
    return state


def _check(robot: Robot, placement: Placement) -> None:
    unset = Placement()
    for name in ("tail_drop", "ends", "flow"):
        if getattr(placement, name) != getattr(unset, name):
            raise InputError(
                f"placement.{name} = {getattr(placement, name)} is nothing that a free run knows; allowed: gap or "
                "eccentricity, and pitch"
            )
    if robot.channel is None and (placement.gap is not None or placement.eccentricity is not None):
        name = "gap" if placement.gap is not None else "eccentricity"
        raise InputError(f"placement.{name} is set, but the robot has no channel; allowed: a pitch, or a [channel]")


def _offset(robot: Robot, placement: Placement, pitch: float, *, lying: bool) -> float:
    """How far below the channel's axis the body's mid-length lies, m."""
    channel = robot.channel
    assert channel is not None  # noqa: S101 - the caller asked
    radius, body = 0.5 * channel.diameter, outlines_of(robot)["body"]
    room = radius - 0.5 * robot.body.diameter
    if placement.eccentricity is not None:
        return placement.eccentricity * room
    most = largest_gap(body, radius, pitch)
    if placement.gap is None:
        gap = min(GAP_SHARE * 0.5 * robot.body.diameter, most) if lying else None
    elif placement.gap <= most:
        gap = placement.gap
    else:
        raise InputError(f"placement.gap = {show(placement.gap, 'mm')}; allowed: at most {show(most, 'mm')}")
    if gap is None:
        offset = 0.0
        if body_gap(body, radius, offset, pitch) > 0:
            return offset
        raise InputError(f"placement.pitch = {show(pitch, 'deg')}: the body does not fit; allowed: a smaller pitch")
    offset = offset_for_gap(body, radius, gap, pitch)
    if not np.isfinite(offset):
        raise InputError(f"placement.pitch = {show(pitch, 'deg')}: the body does not fit; allowed: a smaller pitch")
    return offset


def reach_of(robot: Robot) -> Reach:
    """How far a robot can go and be driven."""
    half = 0.5 * robot.body.length
    length = robot.channel.length if robot.channel is not None else None
    charge = robot.battery.capacity if robot.battery is not None else None
    return Reach(
        nose=half,
        tip=-half - robot.coupling.length - robot.tail.length,
        channel=np.inf if length is None else 0.5 * length,
        middle=-0.5 * (robot.coupling.length + robot.tail.length),  # where the robot's own middle is at first
        charge=np.inf if charge is None else charge,
    )
