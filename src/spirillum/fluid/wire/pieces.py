"""The pieces of one robot as resolved models take them: what decides them, as a key, its solids and its wire."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from spirillum.fluid.wire.stokeslets import Wire, stations_along
from spirillum.robot.batch import RobotBatch
from spirillum.robot.geometry import centreline
from spirillum.robot.outline import Outline, body_outline, solid_outlines
from spirillum.robot.parts import End, Shape

__all__ = ["PIECES", "Geometry", "solids_of_geometry", "wire_of_geometry"]

_POINTS_PER_TURN = 200
PIECES = {
    "body": ("body",),
    "coupling": ("coupling",),
    "tail": ("tail",),
    "rotor": ("coupling", "tail"),
    "robot": ("body", "coupling", "tail"),
}
"""Pieces of each part."""

_NUMBERS = (
    "body_diameter",
    "body_length",
    "fillet",
    "coupling_diameter",
    "coupling_length",
    "coupling_clearance",
    "wavelength",
    "amplitude",
    "tail_length",
    "wire_diameter",
    "taper",
    "hand",
)


class Geometry(NamedTuple):
    """Everything that the resistance depends on, but for the viscosity; lengths in m."""

    shape: Shape
    front: End | None
    rear: End | None
    body_diameter: float
    body_length: float
    fillet: float
    coupling_diameter: float
    coupling_length: float
    coupling_clearance: float
    wavelength: float
    amplitude: float
    tail_length: float
    wire_diameter: float
    taper: float
    hand: float

    @classmethod
    def of(cls, batch: RobotBatch, index: int) -> Geometry:
        """Of robot number `index`."""

        def number(name: str) -> float:
            column = getattr(batch, name)
            return float(column[index if column.size > 1 else 0])

        return cls(
            **{name: number(name) for name in _NUMBERS},
            shape=batch.shape,
            front=batch.front,
            rear=batch.rear,
        )


def solids_of_geometry(g: Geometry) -> Iterator[tuple[str, Outline, int]]:
    """Name, outline and moving part (0 body, 1 rotor) of each solid of revolution."""
    body = body_outline(g.shape, g.body_diameter, g.body_length, g.fillet, g.front, g.rear)
    coupling = g.coupling_diameter, g.coupling_length, g.coupling_clearance
    for name, outline in solid_outlines(body, g.body_length, *coupling).items():
        yield name, outline, 0 if name == "body" else 1


@lru_cache(maxsize=64)
def wire_of_geometry(g: Geometry, spacing: float) -> Wire:
    """The tail at phase 0."""
    turns = g.tail_length / g.wavelength
    count = int(np.ceil(_POINTS_PER_TURN * turns)) + 400
    share = np.linspace(0.0, 1.0, count)
    xi = g.tail_length * share
    if np.isfinite(g.taper):  # denser where the root bends
        root = np.linspace(0.0, 1.0, 400) ** 2 * min(1.0, 20.0 / g.taper) * g.tail_length
        xi = np.unique(np.concatenate([xi, root]))
    columns = (g.wavelength, g.amplitude, g.tail_length, g.taper, g.hand, 0.0)
    names = ("wavelength", "amplitude", "length", "taper", "hand", "phase")
    values = {name: np.full(1, value) for name, value in zip(names, columns, strict=True)}
    line = centreline(xi, root=np.full(1, 0.5 * g.body_length + g.coupling_length), **values)
    return stations_along(line.position, 0.5 * g.wire_diameter, spacing)
