"""Geometry of one robot as the resolved models take it: a hashable key with its solids of revolution and its wire."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from spirillum.arrays import PerRobot, Samples
from spirillum.errors import check_memory
from spirillum.fluid.wire.stokeslets import Wire, station_count, stations_along
from spirillum.robot.batch import RobotBatch
from spirillum.robot.geometry import End, ProfilePoints, Shape
from spirillum.robot.outline import Outline, body_outline, cylinder_outline, solid_outlines
from spirillum.robot.tail_form import PLAIN, TailForm, amplitude_envelope, centreline
from spirillum.units import show

_POINTS_PER_TURN = 200
_SWEPT_CURVE = 1001  # Points along what a centre line through points sweeps.
_STATION = 20_000.0  # Memory of a station while clearances over a turn are sought, bytes.
PIECES = {
    "body": ("body",),
    "coupling": ("coupling",),
    "tail": ("tail",),
    "rotor": ("coupling", "tail"),
    "robot": ("body", "coupling", "tail"),
}
"""Pieces of each part."""


def number_of(column: PerRobot, index: int) -> float:
    """Value of a column of a batch for robot number `index`."""
    return float(column[index if column.size > 1 else 0])


class RobotGeometry(NamedTuple):
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
    form: TailForm = PLAIN
    profile: ProfilePoints = ()

    @classmethod
    def of(cls, batch: RobotBatch, index: int = 0) -> RobotGeometry:
        """Of robot number `index`."""
        shared = {name: getattr(batch, name) for name in ("shape", "front", "rear", "form", "profile")}
        numbers = {name: number_of(getattr(batch, name), index) for name in cls._fields if name not in shared}
        return cls(**shared, **numbers)  # type: ignore[arg-type]

    @classmethod
    def read(cls, table: dict[str, Any]) -> RobotGeometry:
        """From the JSON of its fields."""
        form, profile = table.pop("form", None), tuple(map(tuple, table.pop("profile", ())))
        return cls(**table, form=PLAIN if form is None else TailForm.read(form), profile=profile)

    @property
    def without_tail(self) -> RobotGeometry:
        """Body, coupling and wire, with 0 for the tail's sizes: equal for robots that differ in these alone."""
        return self._replace(wavelength=0.0, amplitude=0.0, tail_length=0.0, taper=0.0, hand=0.0, form=PLAIN)

    @property
    def body(self) -> Outline:
        """Outline of the body; of a bare tail the cylinder that it sweeps, by which its pose in a tube is given."""
        if self.shape == "none":
            x, rho, _ = self.swept(_SWEPT_CURVE).T
            return cylinder_outline(2.0 * float(rho.max()) + self.wire_diameter, float(x.max()), float(x.min()))
        return body_outline(
            self.shape, self.body_diameter, self.body_length, self.fillet, self.front, self.rear, self.profile
        )

    @property
    def outlines(self) -> dict[str, Outline]:
        """Outlines of the solids of revolution by name: `body`, and `coupling` where there is one."""
        coupling = self.coupling_diameter, self.coupling_length, self.coupling_clearance
        return solid_outlines(None if self.shape == "none" else self.body, self.body_length, *coupling)

    @property
    def width(self) -> float:
        """Diameter of the body, or of what a bare tail sweeps."""
        return self.body_diameter if self.shape != "none" else 2.0 * self.body.pieces[1].start[1]  # type: ignore[union-attr]

    def solids(self, part: str) -> list[tuple[Outline, int]]:
        """Outline and link (0 body, 1 rotor) of each solid of one of `PIECES`."""
        return [(outline, int(name != "body")) for name, outline in self.outlines.items() if name in PIECES[part]]

    @property
    def stations(self) -> float:
        """Upper bound of the number of stations along the tail: on its wires and the arms to them."""
        sizes = (np.array([size]) for size in (self.amplitude, self.wavelength, self.tail_length))
        length = self.form.arc_length(*sizes) + self.amplitude
        return self.form.starts * float(station_count(length, np.array([0.5 * self.wire_diameter]))[0])

    def swept(self, count: int) -> Samples:
        """Points of a wire's centreline turned to angle 0 about the axis, (n, 3), m: what it sweeps in a turn."""
        xi = np.linspace(0.0, self.tail_length, count)
        root = -0.5 * self.body_length - self.coupling_length
        if self.form.curve:
            line = self.form.centre.at(np.linspace(0.0, 1.0, _SWEPT_CURVE))[0]
            return np.stack([root - line[:, 0], np.hypot(line[:, 1], line[:, 2]), np.zeros(len(line))], axis=1)
        reach, _ = amplitude_envelope(xi, np.array(self.amplitude), np.array(self.tail_length), np.array(self.taper))
        if self.form.amplitude:
            reach = reach * self.form.amplitude_at(xi / self.tail_length)[0]
        return np.stack([root - xi, reach, np.zeros_like(xi)], axis=1)

    def wires(self, spacing: float = 1.0) -> tuple[Wire, ...]:
        """The tail at phase 0: its wires, the first of which is `wire`."""
        one = self.wire(spacing)
        if self.form.starts == 1:
            return (one,)
        return tuple(replace(one, points=one.points @ q.T, tangents=one.tangents @ q.T) for q in self.form.rotations)

    def wire(self, spacing: float = 1.0) -> Wire:
        """One wire of the tail at phase 0."""
        return _wire(self, spacing)


@lru_cache(maxsize=64)
def _wire(g: RobotGeometry, spacing: float) -> Wire:
    turns = g.tail_length / g.wavelength
    cause = f"tail.wire_diameter = {show(g.wire_diameter, 'mm')}"
    check_memory(cause, g.stations / spacing, "stations along the tail", _STATION, "as with a thicker wire")
    count = int(np.ceil(max(_POINTS_PER_TURN * turns, 24 * len(g.form.curve)))) + 400
    share = np.linspace(0.0, 1.0, count)
    xi = g.tail_length * share
    if np.isfinite(g.taper):  # denser where the root bends
        root = np.linspace(0.0, 1.0, 400) ** 2 * min(1.0, 20.0 / g.taper) * g.tail_length
        xi = np.unique(np.concatenate([xi, root]))
    columns = (g.wavelength, g.amplitude, g.tail_length, g.taper, g.hand, 0.0)
    names = ("wavelength", "amplitude", "length", "taper", "hand", "phase")
    values = {name: np.full(1, value) for name, value in zip(names, columns, strict=True)}
    line = centreline(xi, root=np.full(1, 0.5 * g.body_length + g.coupling_length), form=g.form, **values)
    return stations_along(line.position, 0.5 * g.wire_diameter, spacing)
