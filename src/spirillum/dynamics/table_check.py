"""Whether the error of a robot's table says anything of a motion: its places were checked, and it slides freely."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.dynamics.tube_robot import TubeRobot
from spirillum.fluid.tube.table import least_checked_gap
from spirillum.kernels import tube_motion as kernel
from spirillum.kernels.tube_table import largest_yaw
from spirillum.notes import Note
from spirillum.units import show


class Checked(NamedTuple):
    """What the stated error of a table says of a motion."""

    known: bool
    """Whether the motion keeps to yaws at which the table was checked."""
    near: bool
    """Whether it comes nearer to the glass than where the table was checked."""
    said: list[Note]
    """What there is to say of both, a sentence each."""


def held_against_check(
    table: Samples, *, gap: Samples, offset: Samples, pitch: Samples, yaw: Samples, time: Samples | None = None
) -> Checked:
    """Hold the places of a motion against those at which its table was checked.

    Args:
        table: the packed table.
        gap: smallest distance of body and wall, (n,), m.
        offset: of the body's mid-length from the tube's axis, (n,), m.
        pitch: nose up, (n,), rad.
        yaw: nose to the side, (n,), rad.
        time: of the places, (n,), s, where one differs from another; None: a motion that repeats itself.
    """
    said = []
    checked = np.array([largest_yaw(table, *place) for place in zip(offset, pitch, strict=True)])
    beyond = np.flatnonzero(np.abs(yaw) > checked)
    if beyond.size:
        most = beyond[np.argmax(np.abs(yaw[beyond]))]
        words = (
            f"{_from(time, beyond[0])}it yaws by up to {np.degrees(np.abs(yaw[most])):.3g} deg, and its table was "
            "checked "
            f"up to {np.degrees(checked[most]):.3g} deg there: there is no error estimate"
        )
        said.append(Note("table-not-checked", words, ("wall_yaw", "error_estimate")))
    least = least_checked_gap(table)
    near = np.flatnonzero(gap < least)
    if near.size and not beyond.size:
        words = (
            f"{_falls(time, near[0])} {_length(float(gap[near].min()))}, and its table was checked from "
            f"{_length(least)} on: the error estimate is that of larger gaps"
        )
        said.append(Note("table-not-checked", words, ("wall_gap", "error_estimate")))
    return Checked(not beyond.size, bool(near.size), said)


def held_by_friction(robot: TubeRobot, *, forward: float, turning: float, contact_force: float) -> list[Note]:
    """A sentence on a body that slides more slowly than dry friction is resolved; none on any other.

    Args:
        robot: what its rates in the tube follow from.
        forward: mean forward velocity, m/s.
        turning: mean speed of the body's surface by its rotation, m/s.
        contact_force: mean force of the asperities, N.
    """
    smoothed = float(robot.tube[kernel.SLIDING])
    if not contact_force > 0.0 or not np.hypot(forward, turning) < smoothed:
        return []
    words = (
        f"dry friction (coefficient {float(robot.tube[kernel.COEFFICIENT]):g}) holds the robot: it slides below "
        f"{show(smoothed, 'um/s')}, where the friction law is smoothed, and has no error estimate"
    )
    return [Note("held-by-friction", words, ("in_tube.friction_coefficient", "forward_velocity"))]


def _falls(time: Samples | None, first: int) -> str:
    return "its least gap within a turn is" if time is None else f"{_from(time, first)}its gap falls to"


def _from(time: Samples | None, first: int) -> str:
    return "" if time is None else f"from {float(time[first]):.3g} s on "


def _length(value: float) -> str:
    return show(float(f"{value:.2g}"), "mm" if value >= 1e-4 else "um")
