"""Drag of the body alone: Perrin's spheroid, of which Stokes' sphere is a case.

Perrin's closed forms (J. Phys. Radium 5:497, 1934; 7:1, 1936) have one branch for prolate and one for
oblate spheroids and cancel near the sphere. The same integrals are written here with Carlson's symmetric
elliptic integrals R_F and R_D (DLMF 19.16), which hold for all shapes: Oberbeck's force and Edwardes'
torque on an ellipsoid (Happel and Brenner, Low Reynolds Number Hydrodynamics, sections 5-11).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spirillum.arrays import Matrix6, PerRobot
from spirillum.fluid.model import ResistanceModel
from spirillum.fluid.reference_errors import STATED
from spirillum.robot.batch import RobotBatch
from spirillum.robot.limits import Limit


class SpheroidDrag(NamedTuple):
    """Diagonal of a spheroid's resistance matrix about its centre."""

    axial: PerRobot  #: D_x, force per velocity along the axis, N s/m.
    transverse: PerRobot  #: D_y = D_z, N s/m.
    axial_rotation: PerRobot  #: E_x, torque per rate about the axis, N m s.
    transverse_rotation: PerRobot  #: E_y = E_z, N m s.


def spheroid_drag(viscosity: PerRobot, a: PerRobot, b: PerRobot) -> SpheroidDrag:
    """Resistance of a spheroid in unbounded fluid, of semi-axes a along the axis of revolution and b across it."""
    from scipy.special import elliprd, elliprf

    a2, b2 = a * a, b * b
    chi = 2.0 * elliprf(a2, b2, b2)
    alpha = 2.0 / 3.0 * elliprd(b2, b2, a2)
    beta = 2.0 / 3.0 * elliprd(a2, b2, b2)
    factor = 16.0 * np.pi * viscosity
    return SpheroidDrag(
        axial=factor / (chi + a2 * alpha),
        transverse=factor / (chi + b2 * beta),
        axial_rotation=factor * 2.0 * b2 / (3.0 * 2.0 * b2 * beta),
        transverse_rotation=factor * (a2 + b2) / (3.0 * (a2 * alpha + b2 * beta)),
    )


def semi_axes(batch: RobotBatch) -> tuple[PerRobot, PerRobot]:
    """Semi-axes (a, b) of the equivalent spheroid of each body, m; `equal-volume` widens b to the body's own volume."""
    a = 0.5 * batch.body_length
    if batch.options.perrin.spheroid == "equal-volume":
        return a, np.sqrt(batch.body_volume / (4.0 / 3.0 * np.pi * a))
    return a, 0.5 * batch.body_diameter


def body_axial(batch: RobotBatch) -> tuple[PerRobot, PerRobot]:
    """D_x (N s/m) and E_x (N m s) of the isolated body, dimensional as in eq. (16)."""
    drag = _drag_of(batch)
    return drag.axial, drag.axial_rotation


def _drag_of(batch: RobotBatch) -> SpheroidDrag:
    """Drag of the body; none without one."""
    if batch.shape == "none":
        return SpheroidDrag(*(np.zeros_like(batch.viscosity) for _ in SpheroidDrag._fields))
    return spheroid_drag(batch.viscosity, *semi_axes(batch))


def body_matrix(batch: RobotBatch) -> Matrix6:
    """B_b of eq. (16) about the body's mid-length, where G = 0."""
    drag = _drag_of(batch)
    entries = (drag.axial, drag.transverse, drag.transverse)
    rotations = (drag.axial_rotation, drag.transverse_rotation, drag.transverse_rotation)
    diagonal = np.stack(np.broadcast_arrays(*entries, *rotations), axis=-1)
    return diagonal[..., None] * np.eye(6)


class Perrin(ResistanceModel):
    """The body alone, as a spheroid."""

    name = "perrin"
    title = "Perrin's spheroid"
    references = ("perrin1934", "happel1983")
    known_error = STATED["perrin"]
    parts = ("body",)

    def domain(self, batch: RobotBatch) -> list[Limit]:
        """Holds for every body."""
        return []

    def part_matrix(self, batch: RobotBatch, part: str, phase: PerRobot) -> Matrix6:
        """See `ResistanceModel.part_matrix`."""
        self.check_part(batch, part)
        return body_matrix(batch)
