"""Algebra of resistance matrices: reference point, rotation, composition, joint.

A rigid part's resistance matrix B (6x6) gives force and torque, F = -B V with V = (U, Omega) about a
reference point. All functions take leading axes and broadcast over them.
"""

from __future__ import annotations

import numpy as np

from spirillum.arrays import Axial, Matrix6, Matrix12, PerRobot, Tensors, Vectors

_AXIAL_BOTH = np.array([0, 3, 6, 9])


def dyad(vector: Vectors, other: Vectors | None = None) -> Tensors:
    """The dyadic product of two vectors, or of one with itself, 3x3."""
    return vector[..., :, None] * (vector if other is None else other)[..., None, :]


def skew(vector: Vectors) -> Tensors:
    """S of eq. (12): the matrix with S v = p x v."""
    x, y, z = np.moveaxis(np.asarray(vector), -1, 0)
    zero = np.zeros_like(x)
    rows = [[zero, -z, y], [z, zero, -x], [-y, x, zero]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def transfer(offset: Vectors) -> Matrix6:
    """H of B' = H' B H: velocity at the old point, `offset` from the new one, from the twist about the new one."""
    h = np.zeros((*np.shape(offset)[:-1], 6, 6))
    h[..., :3, :3] = h[..., 3:, 3:] = np.eye(3)
    h[..., :3, 3:] = -skew(offset)
    return h


def about_point(matrix: Matrix6, point: Vectors) -> Matrix6:
    """The matrix about a point, from its reference point: eq. (16) with its G, and the E that changes with it."""
    h = transfer(-np.asarray(point))
    return np.swapaxes(h, -1, -2) @ matrix @ h


def axis_rotation(angle: PerRobot) -> Tensors:
    """Rotation by `angle` about the x axis, 3x3."""
    cos, sin = np.cos(angle), np.sin(angle)
    q = np.zeros((*np.shape(angle), 3, 3))
    q[..., 0, 0] = 1.0
    q[..., 1, 1] = q[..., 2, 2] = cos
    q[..., 1, 2], q[..., 2, 1] = -sin, sin
    return q


def rotated(matrix: Matrix6, rotation: Tensors) -> Matrix6:
    """The matrix of the part turned by `rotation` (3x3) about the reference point, Q B Q'."""
    q = np.zeros((*np.shape(rotation)[:-2], 6, 6))
    q[..., :3, :3] = q[..., 3:, 3:] = rotation
    return q @ matrix @ np.swapaxes(q, -1, -2)


def both_parts(body: Matrix6, rotor: Matrix6) -> Matrix12:
    """The 12x12 of two parts without hydrodynamic interaction."""
    body, rotor = np.broadcast_arrays(body, rotor)
    r = np.zeros((*body.shape[:-2], 12, 12))
    r[..., :6, :6] = body
    r[..., 6:, 6:] = rotor
    return r


def joint_locked(matrix: Matrix12) -> Matrix6:
    """The whole robot's 6x6 with its joint locked: both parts share one twist."""
    return matrix[..., :6, :6] + matrix[..., :6, 6:] + matrix[..., 6:, :6] + matrix[..., 6:, 6:]


def axial_entries(matrix: Matrix12) -> Axial:
    """The axial 4x4 of a full 12x12."""
    return matrix[..., _AXIAL_BOTH[:, None], _AXIAL_BOTH]


def two_parts_axial(body: tuple[PerRobot, PerRobot, PerRobot], rotor: tuple[PerRobot, PerRobot, PerRobot]) -> Axial:
    """The axial 4x4 of two parts without hydrodynamic interaction, from (B11, B14, B44) of each."""
    size = np.broadcast_shapes(*(np.shape(entry) for entry in (*body, *rotor)))
    r = np.zeros((*size, 4, 4))
    for first, (drag, coupling, rotation) in ((0, body), (2, rotor)):
        r[..., first, first] = drag
        r[..., first, first + 1] = r[..., first + 1, first] = coupling
        r[..., first + 1, first + 1] = rotation
    return r
