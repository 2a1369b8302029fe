"""Body, coupling and tail in a circular tube: the coupled flow with the wall, for all rigid motions at once.

Solids and wall are factored once for a place in the tube (`solids`), and answer once all that a wire sends them over
a turn (`reduced`); a phase is then a small system for the forces along the wire, which meet the wall by the same waves.

Inside, axes are x along the robot, y up, z to the right; answers come in body axes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from spirillum.arrays import Samples
from spirillum.fluid.algebra import axis_rotation, dyad
from spirillum.fluid.tube.reduced import Answers, Reduced
from spirillum.fluid.tube.solids import MOTIONS, Solids
from spirillum.fluid.tube.wall import point_reflection
from spirillum.fluid.wire.interaction import asymmetry_of, one_thread, solve_wires
from spirillum.fluid.wire.sources import Sources
from spirillum.fluid.wire.stokeslets import Wire, WireSystem, wire_system
from spirillum.robot.tube_pose import TubePose

_EIGHT_PI = 8.0 * np.pi


@dataclass(frozen=True)
class Strengths:
    """Source strengths on solids and wires for each of the 12 unit twists and the imposed flow; viscosity 1."""

    solids: Solids  #: Solids, with the unknowns of `tractions`.
    tractions: tuple[Samples, Samples]  #: Modes of the tractions, even and odd, (unknowns, 13).
    wires: tuple[Wire, ...]
    forces: Samples  #: At the wires' stations, in the axes used here, (3 stations, 13).


@dataclass(frozen=True)
class UnitMotions:
    """Wrenches on the robot for each of the 12 unit twists, and in the flow of unit mean velocity; viscosity 1."""

    matrix: Samples  #: R for zero net flux, 12x12, made symmetric; zero for a part that is not there.
    load: Samples  #: Wrenches on the robot at rest in the flow of unit mean velocity, (12,).
    drag: float  #: Work of the tractions at rest in that flow against it, over the mean velocity squared.
    asymmetry: float
    """Deviation of the matrix from symmetry (reciprocity), relative to the geometric mean of diagonal entries."""
    strengths: Strengths = field(repr=False)  #: Underlying source strengths.


def solve_unit_motions(solids: Solids, wires: Sequence[tuple[Wire, int]], drop: float = 0.0) -> UnitMotions:
    """Resistance of two rigid parts in a tube with no net flux, twists about the origin; wires lie `drop` lower."""
    with one_thread():
        if solids.none:
            return _wires_alone(_Link.of(solids, wires, drop))
        matrix = solids.wrenches(solids.moving)
        tractions = solids.moving
        forces: Samples = np.zeros((0, MOTIONS))
        lines: tuple[Wire, ...] = ()
        if wires:
            link = _Link.of(solids, wires, drop)
            answers, sent = link.answers, link.sent
            mobility, motion = link.mobility.copy(), link.motion.copy()
            for answer, fields in zip(answers, sent, strict=True):
                mobility -= fields.T @ answer.work @ fields
                motion -= fields.T @ answer.drag
            strengths = np.linalg.solve(mobility, motion)
            reached = [fields @ strengths for fields in sent]
            matrix = matrix + link.motion.T @ strengths
            for answer, fields in zip(answers, reached, strict=True):
                matrix = matrix - answer.push @ fields
            matrix[: MOTIONS - 1, : MOTIONS - 1] += link.system.own
            lost = [answer.tractions @ fields for answer, fields in zip(answers, reached, strict=True)]
            even, odd = (moving - some for moving, some in zip(solids.moving, solids.families(lost), strict=True))
            tractions, lines = (even, odd), link.wires
            forces = np.asarray(strengths[: sum(line.points.size for line in lines)], dtype=np.float64)
    found = Strengths(solids, (_EIGHT_PI * tractions[0], _EIGHT_PI * tractions[1]), lines, _EIGHT_PI * forces)
    return _held(_EIGHT_PI * matrix, found)


def _wires_alone(link: _Link) -> UnitMotions:
    strengths = solve_wires(link.mobility, link.motion)
    matrix = link.motion.T @ strengths
    matrix[: MOTIONS - 1, : MOTIONS - 1] += link.system.own
    forces = strengths[: sum(line.points.size for line in link.wires)]
    nothing = np.zeros((0, MOTIONS))
    return _held(_EIGHT_PI * matrix, Strengths(link.solids, (nothing, nothing), link.wires, _EIGHT_PI * forces))


def turned_motions() -> Samples:
    """From the 13 motions in the axes used here to those in body axes, (13, 13)."""
    turn = np.eye(MOTIONS)
    quarter = axis_rotation(np.array([0.5 * np.pi]))[0]
    for first in range(0, MOTIONS - 1, 3):
        turn[first : first + 3, first : first + 3] = quarter
    return turn


def _held(full: Samples, strengths: Strengths) -> UnitMotions:
    turn = turned_motions()
    full = turn @ full @ turn.T
    matrix, load = full[:-1, :-1], 0.5 * (full[:-1, -1] + full[-1, :-1])
    return UnitMotions(0.5 * (matrix + matrix.T), load, float(full[-1, -1]), asymmetry_of(matrix), strengths)


@dataclass(frozen=True)
class _Link:
    """Equations of the wires in the tube, and what they send to the solids."""

    solids: Solids
    wires: tuple[Wire, ...]
    system: WireSystem
    mobility: Samples  #: Of the wires with the wall, the solids not there.
    motion: Samples  #: Velocities at the stations (and gradients along moments), (3 n + q n, 13).
    sent: list[Samples]
    """Fields on the solids from unit forces and moments at the stations, for each system, (fields, 3 n + q n)."""
    answers: tuple[Answers, ...]  #: Response of the solids to those fields; empty without solids.

    @classmethod
    def of(cls, solids: Solids, wires: Sequence[tuple[Wire, int]], drop: float) -> _Link:
        turned = [(_turned(wire), part) for wire, part in wires]
        system = wire_system(turned, solids.fineness.wire)
        lines = tuple(
            Wire(wire.points - np.array([0.0, drop, 0.0]), wire.tangents, wire.lengths, wire.radius)
            for wire, _ in turned
        )
        points = np.concatenate([wire.points for wire in lines])
        pose, forces = solids.pose, 3 * len(points)
        placed = pose.placed(points)
        distance = pose.radius - float(np.max(np.hypot(placed[:, 1], placed[:, 2])))
        own = solids.fineness.waves(pose.radius, placed[:, 0], distance, solids.fineness.wire_damping)
        # from forces in robot axes to those in the tube's
        along = np.asarray(np.kron(np.eye(len(points)), pose.rotation), dtype=np.float64)
        mobility = system.mobility.copy()
        mobility[:forces, :forces] -= along.T @ point_reflection(placed, own, solids.fineness.precision) @ along
        start = 0
        for wire in lines:
            here = slice(start, start + wire.points.size)
            mobility[here, here] += _near_wall(wire, pose)
            start = here.stop
        motion = np.zeros((len(system.motion), MOTIONS))
        motion[:, : MOTIONS - 1] = system.motion
        speed = 2.0 - 2.0 * (placed[:, 1] ** 2 + placed[:, 2] ** 2) / pose.radius**2
        motion[:forces, MOTIONS - 1] = (speed[:, None] * pose.rotation[0]).ravel()
        if solids.none:
            return cls(solids, lines, system, mobility, motion, [], ())
        sources = Sources.of(lines, system)
        reduced = _reduced(solids, sources)
        return cls(
            solids, lines, system, mobility, motion, reduced.coefficients(sources, placed, along), reduced.answers
        )


def share_basis(solids: Solids, tails: Sequence[Sequence[Wire]]) -> None:
    """Let tails of one or several wires have their basis in common, made when the first of them is solved for."""
    solids.tails = tuple(tuple(map(_turned, wires)) for wires in tails)


def _reduced(solids: Solids, sources: Sources) -> Reduced:
    """The last ones are kept: phases of a tail, and tails that share a basis, come one after the other."""
    kept = solids.kept.get("reduced")
    known: list[Reduced] = kept if isinstance(kept, list) else []
    served = [reduced for reduced in known if reduced.serves(sources)]
    if served:
        return served[0]
    together = [sources]
    for wires in solids.tails:
        other = Sources.of(wires, wire_system([(wire, 1) for wire in wires], solids.fineness.wire))
        if not any(other.sweep_same_circles(one) for one in together):
            together.append(other)
    found = Reduced.of(solids, together)
    solids.kept["reduced"] = found
    return found[0]


def _near_wall(wire: Wire, pose: TubePose) -> Samples:
    """Correction of a line of forces for the finite thickness of a wire at a wall, (3 n, 3 n), robot axes."""
    # A straight line at a height h over a plane has mobilities per length 4 log(2 h/a), 2 log(2 h/a) and
    # 2 log(2 h/a) - 2 along itself, sideways and towards the plane, without the factor 1/(8 pi mu); a cylinder has
    # arccosh(h/a) in place of the logarithm, and 2 sqrt(1 - (a/h)^2) in place of 2 (Jeffrey and Onishi, 1981). The
    # difference is spread over a length h of the wire, for shorter waves of force do not feel the wall.
    placed, tangents = pose.placed(wire.points), wire.tangents @ pose.rotation.T
    rho = np.hypot(placed[:, 1], placed[:, 2])
    height = pose.radius - rho
    ratio = height / wire.radius
    outward = placed * np.array([0.0, 1.0, 1.0]) / np.maximum(rho, 1e-300)[:, None]
    normal = outward - np.sum(outward * tangents, axis=1, keepdims=True) * tangents
    missing = np.arccosh(ratio) - np.log(2.0 * ratio)
    film = 1.0 - np.sqrt(1.0 - ratio**-2)
    local = missing[:, None, None] * (np.eye(3) + dyad(tangents)) + film[:, None, None] * dyad(normal)
    local = 2.0 * pose.rotation.T @ local @ pose.rotation
    apart = np.linalg.norm(wire.points[:, None] - wire.points, axis=-1)
    width = 0.5 * (height[:, None] + height)
    spread = np.exp(-0.5 * (apart / width) ** 2) / (np.sqrt(2.0 * np.pi) * width)
    both = 0.5 * spread[:, :, None, None] * (local[:, None] + local)
    matrix: Samples = both.swapaxes(1, 2).reshape(3 * len(placed), -1)
    return matrix


def _turned(wire: Wire) -> Wire:
    """In the axes used here: (x, y, z) of the body are (x, -z, y)."""
    swap = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
    return Wire(wire.points @ swap.T, wire.tangents @ swap.T, wire.lengths, wire.radius)
