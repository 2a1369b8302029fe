"""Initial pose of a robot in its tube."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spirillum.arrays import Samples
from spirillum.dynamics.tube_robot import TubeRobot
from spirillum.errors import InputError
from spirillum.fluid.tube.tabled import THINNEST_GAP
from spirillum.kernels import rigid_links
from spirillum.kernels import tube_motion as kernel
from spirillum.robot.links import outlines_of
from spirillum.robot.robot import Robot
from spirillum.robot.tube_pose import GAP_SHARE, Seat, largest_gap
from spirillum.units import show


@dataclass(frozen=True)
class StartPlace:
    """A pose in the tube; SI, angles in rad."""

    gap: float | None = None
    """Smallest distance of the body to the wall; None: that of the eccentricity, or 1/18 of the body's radius."""
    eccentricity: float | None = None
    """Offset of the body's mid-length over R - a instead."""
    pitch: float = 0.0
    """Angle of the nose away from the nearest wall: up, at the lowest point of the tube."""
    yaw: float = 0.0
    """Angle of the nose across the plane of tube and body, to +y at the lowest point of the tube."""
    azimuth: float = 0.0
    """Azimuth of the body's mid-length about +x from the lowest point of the tube."""
    phase: float = 0.0
    """Phase of the tail relative to the body, which has not rolled since release."""


def laid_down(robot: Robot, links: TubeRobot, start: StartPlace) -> Samples:
    """The state of a robot at rest at a pose, (19,)."""
    radius, a = float(links.tube[kernel.RADIUS]), 0.5 * robot.body.diameter
    if start.eccentricity is not None:
        state = state_at(start, start.eccentricity * (radius - a))
    else:
        state = state_at(start, _offset(robot, start, GAP_SHARE * a if start.gap is None else start.gap, radius))
    gaps = links.gaps(state)
    if gaps.min() <= 0.0:
        name = links.names[int(np.argmin(gaps))]
        raise InputError(
            f"placement: the {name} would cut {show(-float(gaps.min()), 'mm')} into the wall; allowed: a larger gap, a "
            "smaller pitch or yaw"
        )
    return state


def check_roughness(roughness: float, gap: float, diameter: float) -> None:
    """Refuse asperities that films thinner than a table holds would cover, or that are pressed by more than the weight.

    Args:
        roughness: height of the asperities, m.
        gap: smallest gap of the robot at its start, m.
        diameter: of its body, m.
    """
    if roughness < THINNEST_GAP * diameter:
        raise InputError(
            f"roughness = {show(roughness, 'um')}; allowed: at least {show(THINNEST_GAP * diameter, 'um')}, because "
            "thinner films are not resolved"
        )
    if gap < 0.5 * roughness:
        raise InputError(
            f"roughness = {show(roughness, 'um')} with a gap of {show(gap, 'um')} at the start: asperities would "
            "carry more than its weight; allowed: a roughness below twice the gap, or a larger gap"
        )


def check_in_table(links: TubeRobot, state: Samples, outside: float) -> None:
    """Refuse a start that the table does not hold."""
    if outside:
        gap = float(links.gaps(state).min())
        raise InputError(
            f"placement: a gap of {show(gap, 'mm')} with that pitch and yaw lies outside the robot's table; allowed: a "
            "place nearer to level"
        )


def state_at(start: StartPlace, offset: float) -> Samples:
    """The state, (19,), of a robot at rest whose body's mid-length is at an offset, m, in place of the start's gap."""
    from scipy.spatial.transform import Rotation

    state = np.zeros(rigid_links.STATES)
    turned = Rotation.from_euler("XZY", [start.azimuth, start.yaw, -start.pitch])
    state[rigid_links.ATTITUDE : rigid_links.ATTITUDE + 4] = turned.as_quat(scalar_first=True)
    state[rigid_links.PHASE] = start.phase
    state[rigid_links.POSITION + 1] = offset * np.sin(start.azimuth)
    state[rigid_links.POSITION + 2] = -offset * np.cos(start.azimuth)
    return state


def _offset(robot: Robot, start: StartPlace, gap: float, radius: float) -> float:
    """Offset at which the body's smallest gap is `gap`, m."""
    body = outlines_of(robot)["body"]
    offset = Seat.at_gap(body, radius, gap, start.pitch, yaw=start.yaw).offset
    if not offset >= -1e-12 * radius:
        most = max(largest_gap(body, radius, start.pitch, start.yaw), 0.0)
        raise InputError(
            f"placement.gap = {show(gap, 'mm')}: the body does not fit with that pitch and yaw; allowed: at most "
            f"{show(most, 'mm')}, or a smaller pitch or yaw"
        )
    return max(offset, 0.0)
