"""The model `tube` from tables: what solving for the flow gives, in microseconds.

What a motion along and about the axis needs is averaged over the phases of the tail. A table knows the robot with its
turning tail, not the forces that its two parts exert on each other across their joint: the force on the whole stands
with the body here, and nothing that follows from a force balance of the whole is changed by that.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from spirillum.arrays import Samples
from spirillum.fluid.model import SwimmerModel
from spirillum.fluid.tube.domain import seat_limits, seat_of, tube_radius
from spirillum.fluid.tube.library import find_table
from spirillum.fluid.tube.table import TubeTable, key_of
from spirillum.fluid.tube.tube import Tube
from spirillum.fluid.wire.robot_geometry import RobotGeometry, number_of
from spirillum.fluid.wire.slender import Slender
from spirillum.kernels.tube_table import INSIDE, MOTIONS
from spirillum.robot.batch import RobotBatch
from spirillum.robot.limits import Limit, within
from spirillum.robot.options import ModelOptions
from spirillum.robot.seat import Seat

__all__ = ["TabledTube", "along_the_tube", "tabled"]

_AVERAGED = 8
"""Phases over which a table is averaged: more than its two harmonics need."""


def along_the_tube(seat: Seat) -> Samples:
    """Rates of a table, (8, 5), from U along the tube and rate about the axis of body and rotor, and mean flow."""
    c, s, c_yaw, s_yaw = np.cos(seat.pitch), np.sin(seat.pitch), np.cos(seat.yaw), np.sin(seat.yaw)
    found = np.zeros((MOTIONS, 5))
    found[:3, 0] = c * c_yaw, -s_yaw, -s * c_yaw
    found[3, 1], found[6, 1] = 1.0, -1.0  # the body turns, the rotor does not
    found[6, 3] = found[7, 4] = 1.0
    return found


class TabledTube(Tube):
    """The model `tube` for robots that have tables."""

    form = "table"
    error_against = "places that are no nodes of its table"

    def __init__(self, tables: Mapping[str, TubeTable]) -> None:
        """Answer from tables.

        Args:
            tables: by key, one for every robot that will be asked for.
        """
        super().__init__()
        self._tables = tables

    def table_of(self, batch: RobotBatch, index: int = 0) -> TubeTable:
        """The table of one robot."""
        return self._tables[_key(batch, index)]

    def checked_by(self, options: ModelOptions) -> SwimmerModel | None:
        """None: the error of a table is known, see `stated_speed_error`."""
        return None

    def stated_speed_error(self, batch: RobotBatch) -> float:
        """See `SwimmerModel.stated_speed_error`."""
        return self.table_of(batch).error["forward_velocity"]

    def part_domain(self, batch: RobotBatch, part: str) -> list[Limit]:
        """See `ResistanceModel.part_domain`."""
        return [*Slender().part_domain(batch, part), *seat_limits(batch, part)]

    def _axial(self, batch: RobotBatch) -> tuple[Samples, Samples]:
        found = np.full((batch.size, 5, 5), np.nan)
        for index in within(batch, self.part_domain(batch, "robot")):
            seat, table = seat_of(batch, index), self.table_of(batch, index)
            phases = 2.0 * np.pi * np.arange(_AVERAGED) / _AVERAGED
            mean = np.mean([table.at(seat.offset, seat.pitch, seat.yaw, float(phase))[0] for phase in phases], axis=0)
            along = along_the_tube(seat)
            found[index] = number_of(batch.viscosity, index) * along.T @ mean @ along
        return self._with_ends(batch, found)


def tabled(batch: RobotBatch) -> TabledTube | None:
    """The model `tube` from the tables of a batch; None unless every robot has one that holds where it lies."""
    if batch.placement.tail_drop:
        return None
    found: dict[str, TubeTable] = {}
    for index in range(batch.size):
        radius = tube_radius(batch, index)
        if not np.isfinite(radius):
            return None
        table = find_table(RobotGeometry.of(batch, index), radius)
        if table is None:
            return None
        seat = seat_of(batch, index)
        if np.isfinite(seat.offset) and table.at(seat.offset, seat.pitch, seat.yaw)[1] != INSIDE:
            return None
        found[_key(batch, index)] = table
    return TabledTube(found)


def _key(batch: RobotBatch, index: int) -> str:
    return key_of(RobotGeometry.of(batch, index), tube_radius(batch, index))
