"""Resistive force theory, eqs (8)-(16): local force per length on each piece of wire, F = -C u.

With c_n = c_b the local matrix R C R' of (12) is c_n I + (c_t - c_n) t t', so no Frenet frame is needed.
The tail's matrix is constant in a frame that turns with it. Body and tail do not feel each other.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from spirillum.arrays import Axial, Matrix6, Matrix12, PerRobot, Tensors, Values
from spirillum.envelope import quantity
from spirillum.fluid.algebra import both_parts, dyad, joint_locked, skew, two_parts_axial
from spirillum.fluid.closed.perrin import body_axial, body_matrix
from spirillum.fluid.closed.sbt import thin_wire_cautions
from spirillum.fluid.model import SwimmerModel
from spirillum.fluid.reference_errors import CHECKED, SPEED_ERRORS, STATED, speed_note, validation_note, wall_clause
from spirillum.robot.batch import RobotBatch
from spirillum.robot.limits import Limit
from spirillum.robot.model_options import ModelOptions
from spirillum.robot.tail_form import centreline


class LocalCoefficients(NamedTuple):
    """Local resistance coefficients, N s/m^2."""

    tangential: PerRobot  #: c_t, along the wire.
    normal: PerRobot  #: c_n = c_b, across the wire (near a floor: parallel to it).
    floor_normal: PerRobot | None = None  #: Across the wire and normal to the floor, where there is one.


def printed(batch: RobotBatch) -> LocalCoefficients:
    """Eqs (13) and (14) as the paper prints them.

    (13)  c_t = 2 pi mu/(log(lambda/D_t) - 1/2)     along the wire
    (14)  c_n = 4 pi mu/(log(lambda/D_t) + 1/2)     across it
    """
    return _gray_hancock_form(batch.viscosity, np.log(batch.wavelength / batch.wire_diameter))


def gray_hancock(batch: RobotBatch) -> LocalCoefficients:
    """Gray and Hancock's own form with log(2 lambda/a), a = D_t/2 (J. Exp. Biol. 32:802, 1955)."""
    return _gray_hancock_form(batch.viscosity, np.log(4.0 * batch.wavelength / batch.wire_diameter))


def _gray_hancock_form(viscosity: PerRobot, log: PerRobot) -> LocalCoefficients:
    return LocalCoefficients(2.0 * np.pi * viscosity / (log - 0.5), 4.0 * np.pi * viscosity / (log + 0.5))


def lighthill(batch: RobotBatch) -> LocalCoefficients:
    """Lighthill's coefficients with log(0.18 Lambda/a), Lambda = lambda/alpha (SIAM Rev. 18:161, 1976)."""
    log = np.log(0.36 * batch.wavelength / (batch.arc_fraction * batch.wire_diameter))
    mu = batch.viscosity
    return LocalCoefficients(2.0 * np.pi * mu / log, 4.0 * np.pi * mu / (log + 0.5))


def axis_height(batch: RobotBatch) -> PerRobot:
    """Height h of the tail's axis above the floor, m; unset: the body rests on the floor, h = D_b/2."""
    return np.where(np.isnan(batch.axis_height), 0.5 * batch.body_diameter, batch.axis_height)


def brennen_winet(batch: RobotBatch) -> LocalCoefficients:
    """Coefficients near a plane floor, a << h << L: log(2 h/a) in place of the wavelength's logarithm."""
    # Along the wire 2 pi mu/log(2h/a); across it, parallel to the floor 4 pi mu/log(2h/a) and normal to it
    # 4 pi mu/(log(2h/a) - 1) (Brennen and Winet, Annu. Rev. Fluid Mech. 9:339, 1977; Katz, Blake and
    # Paveri-Fontana, J. Fluid Mech. 72:529, 1975). They are the thin limits of a cylinder's exact drag near
    # a plane (Jeffrey and Onishi, Q. J. Mech. Appl. Math. 34:129, 1981). h is the axis's height for all of the wire.
    log = np.log(4.0 * axis_height(batch) / batch.wire_diameter)
    mu = batch.viscosity
    return LocalCoefficients(2.0 * np.pi * mu / log, 4.0 * np.pi * mu / log, 4.0 * np.pi * mu / (log - 1.0))


_SETS = {"printed": printed, "gray-hancock": gray_hancock, "lighthill": lighthill, "brennen-winet": brennen_winet}


def local_coefficients(batch: RobotBatch) -> LocalCoefficients:
    """The set that `model.rft.coefficients` names, with its factors; meaningless outside `coefficient_domain`."""
    options = batch.options.rft
    with np.errstate(divide="ignore", invalid="ignore"):
        found = _SETS[options.coefficients](batch)
    floor = None if found.floor_normal is None else options.normal_factor * found.floor_normal
    return LocalCoefficients(options.tangential_factor * found.tangential, options.normal_factor * found.normal, floor)


def coefficient_domain(batch: RobotBatch) -> list[Limit]:
    """Where a set makes sense: 0 < c_t < c_n, else a wire would slip more easily across than along."""
    limits, options = _domain_of_the_set(batch), batch.options.rft
    if options.normal_factor == 1.0 and options.tangential_factor == 1.0:
        return limits
    c = local_coefficients(batch)  # Fitted factors may not turn the order of both coefficients around.
    across = c.normal if c.floor_normal is None else np.minimum(c.normal, c.floor_normal)
    most = options.tangential_factor * across / c.tangential
    return [*limits, Limit.named("coefficient-factors", np.full(1, options.tangential_factor), most)]


def _domain_of_the_set(batch: RobotBatch) -> list[Limit]:
    chosen, diameter = batch.options.rft.coefficients, batch.wire_diameter
    if chosen == "brennen-winet":
        height = axis_height(batch)
        return [
            Limit.named("wire-off-floor", height, batch.amplitude + 0.5 * diameter),
            Limit.named("floor-logarithm", height, math.e * diameter / 4.0),
        ]
    least = {
        "printed": np.exp(1.5) * diameter,
        "gray-hancock": np.exp(1.5) / 4.0 * diameter,
        "lighthill": np.exp(0.5) / 0.36 * diameter * batch.arc_fraction,
    }[chosen]
    return [Limit.named("coefficients", batch.wavelength, least, chosen=chosen)]


_PANELS_PER_TURN = 7
_NODES_PER_PANEL = 16  # 112 nodes per wavelength; the paper uses at least 100 intervals
_FLOOR_PHASES = 32  # Phases over which entries near a floor are averaged for a wire without a closed form.
_ROOT_BREAKS = np.array([0.5, 1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 10.0, 13.0, 18.0, 26.0, 38.0])


def tail_matrix(batch: RobotBatch, phase: PerRobot) -> Matrix6:
    """B_t of eq. (12) about the origin, of all wires: they do not feel each other."""
    wires = [_wire_matrix(batch, phase + turn) for turn in batch.form.turns]
    return wires[0] if len(wires) == 1 else np.sum(wires, axis=0)


def _wire_matrix(batch: RobotBatch, phase: PerRobot) -> Matrix6:
    """Of one wire, by Gauss-Legendre quadrature along it."""
    fraction, weight = _along_the_wire(batch)
    b = batch
    columns = {
        "root": b.root,
        "wavelength": b.wavelength,
        "amplitude": b.amplitude,
        "length": b.tail_length,
        "taper": b.taper,
        "hand": b.hand,
        "phase": phase,
    }
    columns = {name: column[:, None] for name, column in columns.items()}
    line = centreline(fraction * columns["length"], form=b.form, **columns)
    own_arc = b.options.rft.arc_element == "true" or not b.form.is_helix  # (l/L_t) dx is that of one helix
    ds = weight * columns["length"] * (line.stretch if own_arc else 1.0 / b.arc_fraction[:, None])
    c = local_coefficients(batch)
    normal, tangential = c.normal[:, None, None, None], c.tangential[:, None, None, None]
    local: Tensors = normal * np.eye(3) + (tangential - normal) * dyad(line.tangent)
    if c.floor_normal is not None:
        up = np.array([0.0, 0.0, 1.0]) - line.tangent[..., 2:] * line.tangent
        across = up / np.linalg.norm(up, axis=-1, keepdims=True)
        local = local + (c.floor_normal[:, None, None, None] - normal) * dyad(across)
    arm = skew(line.position)
    upper = np.concatenate([local, -local @ arm], axis=-1)
    lower = arm @ upper
    if b.options.rft.spin:
        lower[..., 3:] += _spin_coefficient(b)[:, None, None, None] * dyad(line.tangent)
    total: Matrix6 = np.einsum("...i,...ijk->...jk", ds, np.concatenate([upper, lower], axis=-2))
    return total


def _along_the_wire(batch: RobotBatch) -> tuple[Values, Values]:
    """Nodes and weights on [0, 1] of the axial length: even panels, finer where the tapered root bends."""
    turns = float(np.max(batch.tail_length / batch.wavelength))
    form = batch.form
    pieces = max(_PANELS_PER_TURN * turns, 0.5 * len(form.curve), 4 * len(form.amplitude + form.wavelength))
    breaks = [np.linspace(0.0, 1.0, int(np.ceil(pieces)) + 1)]
    breaks += [_ROOT_BREAKS / c for c in np.unique(batch.taper[np.isfinite(batch.taper)])]
    edges = np.unique(np.concatenate(breaks))
    edges = edges[edges <= 1.0]
    node, weight = np.polynomial.legendre.leggauss(_NODES_PER_PANEL)
    half = 0.5 * np.diff(edges)[:, None]
    return (edges[:-1, None] + half * (1.0 + node)).ravel(), (half * weight).ravel()


def _spin_coefficient(batch: RobotBatch) -> PerRobot:
    """4 pi mu a^2: torque per arc length and spin of a wire about its own tangent."""
    return np.pi * batch.viscosity * batch.wire_diameter**2


def tail_axial(batch: RobotBatch) -> tuple[PerRobot, PerRobot, PerRobot]:
    """(B11, B14, B44) of eq. (12), averaged over the tail's phase where a floor makes them depend on it."""
    if batch.form.is_helix:
        one = _helix_axial(batch)
    else:
        phases = _FLOOR_PHASES if batch.options.rft.coefficients == "brennen-winet" else 1
        turns = 2.0 * np.pi * np.arange(phases) / phases
        matrix = np.mean([_wire_matrix(batch, np.full(1, turn)) for turn in turns], axis=0)
        one = matrix[:, 0, 0], matrix[:, 0, 3], matrix[:, 3, 3]
    drag, coupling, rotation = (batch.form.starts * entry for entry in one)
    return drag, coupling, rotation


def _helix_axial(batch: RobotBatch) -> tuple[PerRobot, PerRobot, PerRobot]:
    """Entries of one helix: drag, coupling, and resistance to turning."""
    # Away from the root the tail is a plain helix, whose integrand is constant; what the taper changes is
    # integrated in w = exp(-c xi/L_t) by Gauss-Legendre nodes in tau, sinh(tau) = (B_o c/L_t) w, where the
    # integrand is smooth however steep the root is.
    plain = _axial_integrand(batch, np.zeros((1, 1)))
    far = [batch.tail_length * entry[:, 0] for entry in plain]
    tapered = np.isfinite(batch.taper)
    if not np.any(tapered):
        return far[0], far[1], far[2]
    c = np.where(tapered, batch.taper, 1.0)[:, None]
    steepness = batch.amplitude[:, None] * c / batch.tail_length[:, None]
    hard = float(np.max(steepness)) > 10.0 or batch.options.rft.coefficients == "brennen-winet"
    nodes = 64 if hard else 16
    node, weight = np.polynomial.legendre.leggauss(nodes)
    low, high = np.arcsinh(steepness * np.exp(-c)), np.arcsinh(steepness)
    tau = low + 0.5 * (high - low) * (1.0 + node)
    w = np.sinh(tau) / steepness
    # dxi = (L_t/c) dw/w and dw/w = dtau/tanh(tau)
    measure = np.where(tapered[:, None], batch.tail_length[:, None] / c, 0.0)
    measure = measure * 0.5 * (high - low) * weight / np.tanh(tau)
    near = _axial_integrand(batch, w)
    root = [np.sum(measure * (entry - limit), axis=-1) for entry, limit in zip(near, plain, strict=True)]
    return far[0] + root[0], far[1] + root[1], far[2] + root[2]


def _axial_integrand(batch: RobotBatch, w: Values) -> tuple[Values, Values, Values]:
    """(B11, B14, B44) per axial length where the envelope is r = B_o (1 - w)."""
    c = local_coefficients(batch)
    normal, difference = c.normal[:, None], (c.tangential - c.normal)[:, None]
    r = batch.amplitude[:, None] * (1.0 - w)
    taper = np.where(np.isfinite(batch.taper), batch.taper, 0.0)
    slope2 = ((batch.amplitude * taper / batch.tail_length)[:, None] * w) ** 2
    turning = (2.0 * np.pi / batch.wavelength)[:, None] * r
    turning2 = turning**2
    along2 = 1.0 / (1.0 + slope2 + turning2)  # t_x^2
    drag = normal + difference * along2
    coupling = difference * turning * along2  # c_xth with t_x t_th = h k r t_x^2
    rotation = normal + difference * turning2 * along2
    if c.floor_normal is not None:  # the floor's part, averaged over the phase in closed form
        extra = (c.floor_normal - c.normal)[:, None]
        along = np.sqrt(along2)
        across2 = np.maximum(slope2 + turning2, 1e-300)
        share = turning2 / across2
        drag = drag + extra * along * (1.0 - along)
        coupling = coupling - extra * turning * along2 * along / (1.0 + along)
        rotation = rotation + extra * (share * along2 * along + 1.0 - share) / (1.0 + along)
    spin = _spin_coefficient(batch)[:, None] * along2 if batch.options.rft.spin else 0.0
    arc = 1.0 / np.sqrt(along2) if batch.options.rft.arc_element == "true" else 1.0 / batch.arc_fraction[:, None]
    hand = batch.hand[:, None]
    return arc * drag, arc * hand * coupling * r, arc * (rotation * r**2 + spin)


class Rft(SwimmerModel):
    """Resistive force theory for the tail, Perrin's spheroid for the body."""

    name = "rft"
    title = "RFT"
    references = ("biorob2012", "gray1955", "lighthill1976", "brennen1977", "katz1975", "jeffrey1981", "perrin1934")
    known_error = STATED["rft"]
    known_speed_error = 0.01 * SPEED_ERRORS["rft"]
    parts = ("body", "tail", "rotor", "robot")

    def stated_error(self, options: ModelOptions) -> str:
        """See `ResistanceModel.stated_error`; the near-floor coefficients were not compared with a resolved wire."""
        return STATED["rft near a floor"] if options.rft.coefficients == "brennen-winet" else self.known_error

    def error_statement(self, batch: RobotBatch, fitted_by: str = "") -> str:
        """See `ResistanceModel.error_statement`; sets other than the printed one were compared with one tail only."""
        if batch.options.rft.coefficients != "printed":
            return self.stated_error(batch.options) + wall_clause(batch)
        return f"{validation_note(batch, CHECKED['rft'])}; {speed_note('rft')}{wall_clause(batch)}"

    def domain(self, batch: RobotBatch) -> list[Limit]:
        """0 < c_t < c_n, and a wire clear of the floor."""
        return coefficient_domain(batch)

    def cautions(self, batch: RobotBatch) -> list[Limit]:
        """A wire thin against its wave; with a floor, closer to it than the tail is long."""
        cautions = thin_wire_cautions(batch, 2.6)
        if batch.options.rft.coefficients == "brennen-winet":
            cautions.append(Limit.named("floor-near-tail", axis_height(batch), batch.tail_length))
        return cautions

    def placement_of(self, batch: RobotBatch) -> dict[str, Any]:
        """See `ResistanceModel.placement_of`; the near-floor coefficients know the height of the tail's axis."""
        if batch.options.rft.coefficients == "brennen-winet":
            return {"kind": "above a plane floor", "tail_axis_height": quantity(float(axis_height(batch)[0]), "m")}
        return super().placement_of(batch)

    def axial(self, batch: RobotBatch) -> Axial:
        """See `SwimmerModel.axial`; with `model.rft.row4 = "zeroed"` not symmetric, as (15) is printed."""
        drag, rotation = body_axial(batch)
        r = two_parts_axial((drag, np.zeros(1), rotation), tail_axial(batch))
        if batch.options.rft.row4 == "zeroed":
            r[..., 3, 2] = 0.0
        return r

    def resistance(self, batch: RobotBatch, phase: PerRobot) -> Matrix12:
        """See `SwimmerModel.resistance`."""
        return both_parts(body_matrix(batch), tail_matrix(batch, phase))

    def part_matrix(self, batch: RobotBatch, part: str, phase: PerRobot) -> Matrix6:
        """See `ResistanceModel.part_matrix`; the rotor is the tail, since RFT leaves the coupling out."""
        self.check_part(batch, part)
        if part == "body":
            return body_matrix(batch)
        return joint_locked(self.resistance(batch, phase)) if part == "robot" else tail_matrix(batch, phase)
