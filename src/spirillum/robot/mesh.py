"""The robot as closed surfaces of triangles: one geometry for pictures, exports and hydrodynamics.

Body and coupling are the solids of revolution that the resolved models take, the tail is a round wire along eq. (10).
Parts that the models leave out join the pieces: the motor's shaft into the coupling, a stub of wire from the coupling
to the tail's root, and an arm where the root does not lie on the axis.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from spirillum.argument_validation import as_number
from spirillum.arrays import Samples
from spirillum.data_tables import rows_of
from spirillum.errors import InputError, check_memory
from spirillum.robot.geometry import StripeColour
from spirillum.robot.links import outlines_of
from spirillum.robot.outline import Outline
from spirillum.robot.robot import Robot
from spirillum.robot.surface import Faces, Surface, mass_properties, profile_of, revolved, rod, swept
from spirillum.robot.tail_form import Centreline, centreline

Colour = tuple[float, float, float]


def _colours(of: str) -> dict[Any, Colour]:
    """Colours of stripes or of pieces by name."""
    rows = (row for row in rows_of("robot/colours.csv") if row["of"] == of)
    return {row["name"]: (float(row["red"]), float(row["green"]), float(row["blue"])) for row in rows}


STRIPE_COLOURS: dict[StripeColour, Colour] = _colours("stripe")  #: sRGB of a stripe's colour names, 0 to 1.
COLOURS: dict[str, Colour] = _colours("piece")  #: sRGB of the pieces, 0 to 1, the wire of copper; for pictures only.
_STEEL: Colour = (0.62, 0.64, 0.67)
_WIRES = ("stub", "arm", "tail")
_STEELS = (7000.0, 8300.0)  # densities between which a wire is taken for steel, kg/m^3: brass begins at 8400

_AROUND_BODY, _AROUND_WIRE, _PER_TURN = 96, 24, 48
"""Sides of a body and of a wire, and points along a turn of the tail, at fineness 1."""
_FINENESS = (0.1, 20.0)
_TRIANGLE = 400.0  # memory of a triangle with its share of vertices and colours, and while it is written, bytes
_ROOT = 0.2  # fraction of the tail's length within which a sharp bend belongs to the root
_SHARPEST = 0.9  # largest curvature of a swept wire, times its radius


@dataclass(frozen=True)
class RobotMesh:
    """One piece of the robot: a closed surface, in the frame of the body, m."""

    name: str  #: `body`, `shaft`, `coupling`, `stub`, `arm` or `tail`.
    part: Literal["body", "rotor"]  #: The link that it moves with.
    vertices: Samples = field(repr=False)  #: (n, 3), m.
    faces: Faces = field(repr=False)  #: Triangles, outward oriented, (m, 3).
    colours: Samples = field(repr=False)  #: sRGB of each triangle, 0 to 1, (m, 3).
    regions: tuple[str, ...]
    """Regions of the surface: the piece's name; on the body also `seal`, `stripe 1`, `stripe 2`, ..."""
    region: Faces = field(repr=False)  #: Index of each triangle's region, (m,).

    @property
    def volume(self) -> float:
        """Volume inside the triangles, m^3."""
        return mass_properties(self.vertices, self.faces)[0]

    @property
    def centroid(self) -> Samples:
        """Centroid of that volume, m, (3,)."""
        return mass_properties(self.vertices, self.faces)[1]

    @property
    def area(self) -> float:
        """Area of the triangles, m^2."""
        return mass_properties(self.vertices, self.faces)[2]


@dataclass(frozen=True)
class TailLine:
    """The centreline of the tail, dense enough for a swept wire; m, at phase 0."""

    points: Samples
    tangents: Samples
    xi: Samples  #: Axial distance from the root, m, (k,).


def is_steel(density: float | None) -> bool:
    """Whether a wire of this density, kg/m^3, is shown as steel, not as copper."""
    return density is not None and _STEELS[0] <= density <= _STEELS[1]


def robot_mesh(robot: Robot, *, phase: float = 0.0, fineness: float = 1.0) -> tuple[RobotMesh, ...]:
    """The robot's pieces, each one closed surface by itself; neighbours overlap where they are joined.

    Vertices lie on the true surfaces, so that volumes converge from below with the inverse square of `fineness`, 0.1 to
    20. The seal's first stripe is centred on +z; the next ones follow in the positive sense about +x, from +z towards
    -y.
    """
    if not _FINENESS[0] <= as_number(fineness) <= _FINENESS[1]:
        raise InputError(f"fineness = {fineness!r}; allowed: {_FINENESS[0]} to {_FINENESS[1]}")
    around, sides = (max(6, round(count * fineness)) for count in (_AROUND_BODY, _AROUND_WIRE))
    outlines = outlines_of(robot)
    pieces = [_body(robot, outlines["body"], around)] if robot.has_body else []
    for name, surface in _rotor(robot, outlines.get("coupling"), around, sides, fineness):
        cos, sin = np.cos(phase), np.sin(phase)
        turn = np.array([[1.0, 0.0, 0.0], [0.0, cos, -sin], [0.0, sin, cos]])
        turned = surface._replace(vertices=surface.vertices @ turn.T)
        colour = _STEEL if name in _WIRES and is_steel(robot.tail.density) else COLOURS[name]
        pieces.append(_piece(name, "rotor", turned, (name,), (colour,)))
    return tuple(pieces)


def _piece(
    name: str,
    part: Literal["body", "rotor"],
    surface: Surface,
    regions: tuple[str, ...],
    palette: tuple[Colour, ...],
    region: Faces | None = None,
) -> RobotMesh:
    """A piece whose triangles have the colours of their regions; by default the first."""
    which = np.zeros(len(surface.faces), dtype=np.int64) if region is None else region
    return RobotMesh(name, part, surface.vertices, surface.faces, np.array(palette)[which], regions, which)


def _body(robot: Robot, outline: Outline, around: int) -> RobotMesh:
    """The body with its seal as a region of its surface; edges of seal and stripes are edges of triangles."""
    seal = robot.seal
    if seal is None:
        return _piece("body", "body", revolved(profile_of(outline, around), around), ("body",), (COLOURS["body"],))
    if (doubt := robot.seal_doubt) is not None:
        raise InputError(str(doubt))
    front, stripes = seal.length - 0.5 * robot.body.length, len(seal.stripes)
    profile = profile_of(outline, around, (front,))
    sectors = max(stripes, 1)
    around = sectors * int(np.ceil(around / sectors))
    surface = revolved(profile, around, -np.pi / sectors)
    sealed = (0.5 * (profile.x[1:] + profile.x[:-1]) < front)[surface.band]
    region = np.where(sealed, 1, 0)
    if stripes:  # not on the flat rear face: they are seen from the side
        striped = sealed & ~np.array(profile.flat)[surface.band]
        region = np.where(striped, 2 + surface.sector * stripes // around, region)
    names = ("body", "seal", *(f"stripe {index + 1}" for index in range(stripes)))
    palette = (COLOURS["body"], COLOURS["seal"], *(STRIPE_COLOURS[colour] for colour in seal.stripes))
    return _piece("body", "body", surface, names, palette, region)


def _rotor(
    robot: Robot, coupling: Outline | None, around: int, sides: int, fineness: float
) -> list[tuple[str, Surface]]:
    """Surfaces of the rotor at phase 0, by name."""
    rear, radius = -0.5 * robot.body.length, 0.5 * robot.tail.wire_diameter
    root = np.array([rear - robot.coupling.length, 0.0, 0.0])
    # Each is thinner than the next by a little more than its facets: nearly coincident surfaces cannot be united.
    arm = 0.99 * np.cos(np.pi / sides) * radius
    stub = 0.99 * np.cos(np.pi / sides) * arm
    found: list[tuple[str, Surface]] = []
    before = rear + min(2.0 * radius, 0.5 * robot.body.length)  # how far a rod reaches into what holds it
    if coupling is not None:
        front, back = (float(piece.points(np.zeros(1))[0][0]) for piece in (coupling.pieces[0], coupling.pieces[-1]))
        shaft = radius
        if robot.motor is not None and robot.motor.shaft_diameter is not None:
            shaft = 0.5 * robot.motor.shaft_diameter
        shaft = min(shaft, 0.5 * robot.coupling.diameter)
        into = min(2.0 * shaft, 0.5 * (front - back))
        start, end = rear + min(2.0 * shaft, 0.5 * robot.body.length), front - into
        line = np.array([[start, 0.0, 0.0], [end, 0.0, 0.0]])
        found.append(("shaft", rod(line[0], line[1], shaft, sides, round_start=False, round_end=False)))
        found.append(("coupling", revolved(profile_of(coupling, around), around)))
        before = back + min(2.0 * radius, 0.5 * (front - back))
    if before > root[0]:
        found.append(("stub", rod(np.array([before, 0.0, 0.0]), root, stub, sides, round_start=False, round_end=True)))
    wire = tail_line(robot, fineness=fineness)
    if np.linalg.norm(wire.points[0] - root) > 1e-9 * radius:
        bar = rod(root, wire.points[0], arm, sides, round_start=True, round_end=True)
        found += [("arm", copy) for copy in _around(bar, robot)]
    turns = robot.tail.length / robot.tail.wavelength
    cause = f"a mesh of the tail with {turns:.4g} turns (fineness = {fineness:g})"
    triangles = 2.0 * robot.tail.starts * len(wire.points) * sides
    check_memory(cause, triangles, "triangles", _TRIANGLE, "as with a smaller fineness or a longer wavelength")
    found += [("tail", copy) for copy in _around(swept(wire.points, wire.tangents, radius, sides), robot)]
    return found


def _around(one: Surface, robot: Robot) -> list[Surface]:
    """Copies of a surface, one for each start of the tail."""
    if robot.tail.starts == 1:
        return [one]
    return [one._replace(vertices=one.vertices @ turn.T) for turn in robot.tail.form.rotations]


def tail_line(robot: Robot, *, fineness: float = 1.0) -> TailLine:
    """Points along the tail, spaced evenly in the angle by which its tangent and its phase turn."""
    # A wire cannot be swept around a bend sharper than its own radius, as a very large `tail.taper` makes at the root:
    # there the line starts behind the bend.
    tail = robot.tail
    wavenumber = 2.0 * np.pi / tail.wavelength
    form = tail.form
    pieces = max(_PER_TURN * tail.length / tail.wavelength, 12 * len(form.curve))
    xi = np.linspace(0.0, tail.length, 2 + int(np.ceil(pieces)))
    if tail.taper is not None:
        rise = np.arange(0.0, min(40.0, tail.taper), 0.05) * tail.length / tail.taper
        xi = np.unique(np.concatenate([xi, rise]))
    line = centreline_of(robot, xi)
    bend = np.linalg.norm(np.diff(line.tangent, axis=0), axis=1)
    arc = np.linalg.norm(np.diff(line.position, axis=0), axis=1)
    first = 0
    if tail.taper is not None:
        helix = tail.amplitude * wavenumber**2 / (1.0 + (tail.amplitude * wavenumber) ** 2)
        sharp = np.flatnonzero(bend > max(2.0 * _SHARPEST / tail.wire_diameter, 1.2 * helix) * arc)
        behind = int(sharp[-1]) + 1 if sharp.size else 0
        first = behind if xi[behind] < _ROOT * tail.length else 0  # a coil too tight for its wire stays as it is
    turned = np.concatenate([np.zeros(1), np.cumsum(np.hypot(bend, wavenumber * np.diff(xi)))])
    count = max(4, int(np.ceil(fineness * _PER_TURN * (turned[-1] - turned[first]) / (2.0 * np.pi))))
    spaced = np.interp(np.linspace(turned[first], turned[-1], count + 1), turned, xi)
    spaced[-1] = tail.length
    line = centreline_of(robot, spaced)
    return TailLine(line.position, line.tangent, spaced)


def centreline_of(robot: Robot, xi: Samples, phase: float = 0.0) -> Centreline:
    """The first wire's centreline at axial distances from its root, m."""
    tail = robot.tail
    numbers = {
        "root": 0.5 * robot.body.length + robot.coupling.length,
        "wavelength": tail.wavelength,
        "amplitude": tail.amplitude,
        "length": tail.length,
        "taper": np.inf if tail.taper is None else tail.taper,
        "hand": robot.hand,
        "phase": phase,
    }
    return centreline(xi, form=tail.form, **{name: np.full(1, value) for name, value in numbers.items()})
