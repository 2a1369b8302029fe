"""Mass, centre, inertia and buoyancy of the two rigid links, body and rotor.

A solid of revolution needs integrals of rho^2 and rho^4 along its outline, which Gauss quadrature gives to rounding. A
round wire of radius a along a curve p(s) with tangent t needs no curvature: over its section the volume element is
1 - kappa u (Pappus), kappa n is dt/ds, and integration by parts leaves

    volume        = pi a^2 L
    first moment  = pi a^2 (int p ds - a^2/4 [t])
    second moment = pi a^2 (int (p p' + a^2/4 (1 + t t')) ds - a^2/4 [p t' + t p'])

with brackets between the ends. They are exact as long as the wire is thinner than its bends.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Tensors, Vectors
from spirillum.robot.outline import Outline, body_outline, solid_outlines
from spirillum.robot.tables import RobotTables
from spirillum.robot.tail_form import PLAIN, TailForm, centreline

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(16)
_PANELS_PER_TURN = 4
_ROOT_LENGTHS = 60.0  # number of lengths L_t/c after which the amplitude of a tapered wire is complete to rounding


class HomogeneousSolid(NamedTuple):
    """A homogeneous solid of density 1, in the frame of the body at phase 0 of the tail; SI."""

    volume: float  #: Volume, m^3.
    centroid: Vectors  #: Centroid of the volume, m, (3,).
    inertia: Tensors  #: Inertia about the centroid at density 1, m^5, (3, 3).


_NOTHING = HomogeneousSolid(0.0, np.zeros(3), np.zeros((3, 3)))  # A solid that is not there, at the origin


class Link(NamedTuple):
    """A rigid link in the frame of the body at phase 0 of the tail; SI."""

    mass: float  #: Mass, kg; NaN where `body.mass` or `tail.density` is needed and unset.
    centre: Vectors  #: Centre of mass, m, (3,); NaN with the mass.
    inertia: Tensors  #: Inertia about the centre of mass, kg m^2, (3, 3); NaN with the mass.
    volume: float  #: Displaced volume, m^3.
    centroid: Vectors  #: Centroid of the displaced volume (centre of buoyancy), m, (3,).


class Links(NamedTuple):
    """Both links of a robot."""

    body: Link
    rotor: Link


def links_of(robot: RobotTables, solids: Mapping[str, HomogeneousSolid] | None = None) -> Links:
    """Mass, centre, inertia and displaced volume of body and rotor."""
    # `body.mass` is that of body and coupling together, assumed to be of uniform density; where `body.center_of_mass`
    # is given, the body's mass is displaced there as a whole. The wire has `tail.density`.
    solids = robot_solids(robot) if solids is None else solids
    body, wire = solids.get("body", _NOTHING), solids["tail"]
    main = body.volume + (solids["coupling"].volume if "coupling" in solids else 0.0)
    density = np.nan if robot.body.mass is None else robot.body.mass / main
    density = density if main > 0 else 0.0
    wire_density = np.nan if robot.tail.density is None else robot.tail.density
    rotor = [(solids["coupling"], density)] if "coupling" in solids else []
    found = _link([(body, density)])
    if (center := robot.body.center_of_mass) is not None:
        x = float(found.centre[0]) if center.x is None else center.x
        side, up = center.radial * np.sin(center.angle), -center.radial * np.cos(center.angle)
        found = found._replace(centre=np.array([x, side, up]))
    return Links(found, _link([*rotor, (wire, wire_density)]))


def robot_solids(robot: RobotTables) -> dict[str, HomogeneousSolid]:
    """Volume, centroid and inertia of `body`, `coupling` (where there is one) and `tail`, each of density 1."""
    found = {name: revolution_solid(outline) for name, outline in outlines_of(robot).items()}
    tail = robot.tail
    found["tail"] = wire_solid(
        root=0.5 * robot.body.length + robot.coupling.length,
        wavelength=tail.wavelength,
        amplitude=tail.amplitude,
        length=tail.length,
        wire_diameter=tail.wire_diameter,
        taper=np.inf if tail.taper is None else tail.taper,
        hand=robot.hand,
        form=tail.form,
    )
    return found


def outlines_of(robot: RobotTables) -> dict[str, Outline]:
    """Outlines of `body` and `coupling`, where they are."""
    body, coupling = robot.body, robot.coupling
    if not robot.has_body:
        return solid_outlines(None, 0.0, coupling.diameter, coupling.length, coupling.clearance)
    outline = body_outline(
        body.shape, body.diameter, body.length, body.fillet or 0.0, body.front_end, body.rear_end, body.points
    )
    return solid_outlines(outline, body.length, coupling.diameter, coupling.length, coupling.clearance)


def revolution_solid(outline: Outline) -> HomogeneousSolid:
    """A solid of revolution about the motor axis: pi int rho^2 dx and its moments, to rounding."""
    x, square, dx = outline.sections()
    volume = float(np.pi * np.sum(square * dx))
    middle = float(np.pi * np.sum(square * x * dx)) / volume
    about_axis = 0.5 * np.pi * float(np.sum(square**2 * dx))
    across = 0.5 * about_axis + float(np.pi * np.sum(square * (x - middle) ** 2 * dx))
    return HomogeneousSolid(volume, np.array([middle, 0.0, 0.0]), np.diag([about_axis, across, across]))


def wire_solid(
    *,
    root: float,
    wavelength: float,
    amplitude: float,
    length: float,
    wire_diameter: float,
    taper: float,
    hand: float,
    form: TailForm = PLAIN,
) -> HomogeneousSolid:
    """Round wires along eq. (10) at phase 0, their ends cut square; arguments as of `centreline`, SI."""
    pieces = max(_PANELS_PER_TURN * length / wavelength, len(form.curve), 8 * len(form.amplitude + form.wavelength))
    panels = np.linspace(0.0, length, 1 + int(np.ceil(pieces)))
    if np.isfinite(taper):
        rise = np.arange(0.0, min(_ROOT_LENGTHS, taper)) * length / taper
        panels = np.unique(np.concatenate([panels, rise]))
    half = 0.5 * np.diff(panels)
    xi = np.concatenate([[0.0], (panels[:-1] + half)[:, None] + half[:, None] * _NODES, [length]], axis=None)
    numbers = {"wavelength": wavelength, "amplitude": amplitude, "length": length, "taper": taper, "hand": hand}
    columns = {name: np.full(1, value) for name, value in numbers.items()}
    # Relative to the root, so that a short tail far behind the origin loses no digits.
    phase = np.full(1, 0.0 if form.curve else -hand * 2.0 * np.pi * root / wavelength)
    line = centreline(xi, root=np.zeros(1), phase=phase, form=form, **columns)
    p, t = line.position, line.tangent
    ds = (half[:, None] * _WEIGHTS).ravel() * line.stretch[1:-1]
    square = 0.25 * wire_diameter**2  # a^2
    arc = float(np.sum(ds))
    middle = (ds @ p[1:-1] - 0.25 * square * (t[-1] - t[0])) / arc
    p = p - middle
    inner, along = p[1:-1], t[1:-1]
    ends = [np.outer(p[i], t[i]) + np.outer(t[i], p[i]) for i in (0, -1)]
    second = (inner * ds[:, None]).T @ inner
    second += 0.25 * square * (arc * np.eye(3) + (along * ds[:, None]).T @ along - (ends[1] - ends[0]))
    inertia = np.pi * square * (np.trace(second) * np.eye(3) - second)
    one = HomogeneousSolid(np.pi * square * arc, middle - np.array([root, 0.0, 0.0]), inertia)
    return _around(one, form.rotations) if form.starts > 1 else one


def _around(one: HomogeneousSolid, copies: Tensors) -> HomogeneousSolid:
    """Copies of a solid, turned about the x axis."""
    centroids = copies @ one.centroid
    centre = np.mean(centroids, axis=0)
    arms = centroids - centre
    shifted = np.sum(arms**2) * np.eye(3) - arms.T @ arms
    inertia = np.sum(copies @ one.inertia @ np.swapaxes(copies, -1, -2), axis=0) + one.volume * shifted
    return HomogeneousSolid(one.volume * len(copies), centre, inertia)


def _link(parts: list[tuple[HomogeneousSolid, float]]) -> Link:
    """Rigidly joined solids, each with its density, kg/m^3."""
    volumes = np.array([solid.volume for solid, _ in parts])
    masses = np.array([solid.volume * density for solid, density in parts])
    centroids = np.array([solid.centroid for solid, _ in parts])
    mass = float(np.sum(masses))
    centre = masses @ centroids / mass if mass else centroids[0]
    inertia = np.zeros((3, 3))
    for (solid, density), own, centroid in zip(parts, masses, centroids, strict=True):
        arm = centroid - centre
        inertia += density * solid.inertia + own * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    volume = float(np.sum(volumes))
    return Link(mass, centre, inertia, volume, volumes @ centroids / volume if volume else centroids[0])
