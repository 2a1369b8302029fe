"""The resistance of a robot anywhere in its tube, from its table. Until tables are built: one matrix for all places."""

from __future__ import annotations

from spirillum.arrays import Samples
from spirillum.kernels.compiled import compiled

__all__ = ["resistance_at"]


@compiled
def resistance_at(table: Samples, e: float, p: float, psi: float, phi: float, out: Samples) -> int:  # noqa: ARG001 - see above
    """Resistance M, 8x8 over the viscosity, at a place; 0 inside the table, else which range was left.

    Args:
        table: the table.
        e: offset of the body's mid-length from the tube's axis, m.
        p: pitch, nose away from the wall, rad.
        psi: yaw, rad.
        phi: phase of the tail in the roll-free axes of the body, rad.
        out: result, (8, 8).
    """
    for i in range(8):
        for j in range(8):
            out[i, j] = table[8 * i + j]
    return 0
