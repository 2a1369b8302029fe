"""Lighthill's slender-body theory of a helix, eqs (1)-(7), as an axial resistance block.

For uniform axial and azimuthal forces per arc length (f_x, f_th), Lighthill's theorem averaged along the
wire gives (u_x, u_th) = M (f_x, f_th)/(4 pi mu) with

    M = [[Psi/1.5, alpha beta q], [alpha beta q, 1/chi]],   q = -1 - log(eps) + A1,   beta^2 = 1 - alpha^2.

Its inverse is the tail's symmetric block; the ordinary force balance with the body's D_x and E_x then
reproduces (1), (2), (4) and (5). `L_t` of the printed equations is the wire's arc length.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spirillum.arrays import Axial, Matrix6, Matrix12, PerRobot, Samples, Values
from spirillum.data_tables import rows_of
from spirillum.fluid.algebra import two_parts_axial
from spirillum.fluid.closed.perrin import body_axial
from spirillum.fluid.model import SwimmerModel
from spirillum.fluid.reference_errors import CHECKED, SPEED_ERRORS, STATED, speed_note, validation_note, wall_clause
from spirillum.robot.batch import RobotBatch
from spirillum.robot.limits import Limit

ALPHA_MIN = 0.05
"""Smallest axial length over arc length that the expansion covers; the largest is 1, a straight filament."""

COEFFICIENTS: Samples = np.array(
    [[float(value) for value in row.values()] for row in rows_of("fluid/closed/lighthill_integrals.csv")]
)
"""Chebyshev coefficients of alpha A_1, alpha A_2, alpha A_3 (columns) in log(alpha / (1 + alpha/2)), mapped from
[ALPHA_MIN, 1] to [-1, 1]; computed by tools/fit_lighthill_integrals.py."""

# Small enough for the recurrence to run within the processor's cache.
_BLOCK = 8192


def lighthill_integrals(alpha: Values) -> tuple[Values, Values, Values]:
    """Lighthill's integrals A_1, A_2, A_3 of a helix with axial length over arc length alpha.

    theta is the phase from one point to another point of the helix and rho their distance, in units of the
    arc length of one radian: rho^2 = alpha^2 theta^2 + 2 (1 - alpha^2) (1 - cos theta). Over theta::

        A_1 =  int_0^1 [theta sin(theta) / rho^3 - 1/theta] + int_1^inf theta sin(theta) / rho^3
        A_2 =  int_0^1 [sin^2(theta) / rho^3 - 1/theta]     + int_1^inf sin^2(theta) / rho^3
        A_3 = -int_0^1 [1/rho - 1/theta]                    - int_1^inf [1/rho - 1/(alpha theta)]

    At alpha = 1: A_1 = 1 - gamma, A_2 = 3/2 - gamma - log 2, A_3 = 0.

    Returns:
        A_1, A_2, A_3, each of the shape of ``alpha``, dimensionless; NaN outside [0.05, 1]. The error is below
        1e-13 max(1, abs(A)), found against a multiple-precision quadrature of the definitions.

    Reference: J. Lighthill, Flagellar hydrodynamics, SIAM Review 18 (1976) 161-230.
    """
    values = np.asarray(alpha, dtype=np.float64)
    flat = values.reshape(-1)
    integrals = np.empty((3, flat.size))
    for start in range(0, flat.size, _BLOCK):
        block = slice(start, start + _BLOCK)
        integrals[:, block] = _expansion(flat[block])
    a1, a2, a3 = (row.reshape(values.shape) for row in integrals)
    return a1, a2, a3


def _expansion(alpha: Samples) -> Samples:
    """The three integrals in rows; the factor alpha in the series takes away most of the growth at small alpha."""
    inside = np.where((alpha >= ALPHA_MIN) & (alpha <= 1.0), alpha, np.nan)
    low, high = _stretched(np.array([ALPHA_MIN, 1.0]))
    position = (2.0 * _stretched(inside) - low - high) / (high - low)
    series: Samples = np.polynomial.chebyshev.chebval(position, COEFFICIENTS)
    return series / inside


def _stretched(alpha: Samples) -> Samples:
    """The variable in which the expansion converges fast: singularities sit near alpha = 0, off the real axis."""
    return np.log(alpha / (1.0 + alpha / 2.0))


PRINTED_EPS_CONSTANT = 2.6  #: Constant of eps as the paper prints it.
EXACT_EPS_CONSTANT = 0.5 * np.pi * np.exp(0.5)
"""pi sqrt(e)/2 = 2.58981: Lighthill's cut-off delta = a sqrt(e)/2 (SIAM Rev. 18:161, 1976)."""

_LARGEST_EPS = 0.2
_FEWEST_TURNS = 1.0


def cutoff(batch: RobotBatch, constant: float) -> PerRobot:
    """Eps = k delta = constant alpha D_t/lambda, with k the wavenumber along the wire (Section II-B)."""
    return constant * batch.arc_fraction * batch.wire_diameter / batch.wavelength


def thin_wire_cautions(batch: RobotBatch, constant: float) -> list[Limit]:
    """Where what the theories neglect, of order eps^2, exceeds some 4 %, or the helix has no full turn."""
    return [
        Limit.named("thin-wire", cutoff(batch, constant), _LARGEST_EPS),
        Limit.named("whole-turns", batch.tail_length / batch.wavelength, _FEWEST_TURNS),
    ]


class HelixFunctions(NamedTuple):
    """Lighthill's dimensionless functions of a helix."""

    alpha: PerRobot
    q: PerRobot  #: -1 - log(eps) + A1, the bracket of (1) and (7).
    torque: PerRobot  #: 1/chi, the inverse of eq. (3).
    Psi: PerRobot  #: Velocity reduction of a towed helix, eq. (6).
    psi: PerRobot  #: Velocity reduction of a swimming helix, eq. (7).


def _eps_constant(batch: RobotBatch) -> float:
    return EXACT_EPS_CONSTANT if batch.options.sbt.eps_constant == "exact" else PRINTED_EPS_CONSTANT


def helix_functions(batch: RobotBatch) -> HelixFunctions:
    """chi, Psi, psi of eqs (3), (6), (7); NaN for alpha outside the expansion of A1, A2, A3."""
    alpha = batch.arc_fraction
    a1, a2, a3 = lighthill_integrals(alpha)
    log_eps = np.log(cutoff(batch, _eps_constant(batch)))
    alpha2 = alpha * alpha
    log_kl = np.log(2.0 * np.pi * batch.tail_length / batch.wavelength)  # k L_t: 2 pi times the turns
    q = -1.0 - log_eps + a1
    torque = -(1.0 - alpha2) - (2.0 - alpha2) * log_eps + alpha2 * a1 + 2.0 * (1.0 - alpha2) * a2  # (3)
    big_psi = 1.5 * (
        2.0 - alpha2 - 3.0 / alpha + 2.0 / alpha * log_kl - (1.0 + alpha2) * log_eps - 2.0 * a3 - (1.0 - alpha2) * a1
    )  # (6)
    small_psi = big_psi - 1.5 * alpha2 * (1.0 - alpha2) * q * q / torque  # (7)
    return HelixFunctions(alpha, q, torque, big_psi, small_psi)


def tail_axial(batch: RobotBatch) -> tuple[PerRobot, PerRobot, PerRobot]:
    """(B11, B14, B44) of the tail: 4 pi mu l diag(1, B_o) M^-1 diag(1, B_o), optionally with the wire's own spin."""
    f = helix_functions(batch)
    towed = f.Psi / 1.5
    mixed = f.alpha * np.sqrt(1.0 - f.alpha**2) * f.q
    scale = 4.0 * np.pi * batch.viscosity * batch.arc_length / (towed * f.torque - mixed**2)
    b = batch.amplitude
    rotation = scale * b * b * towed
    if batch.options.sbt.spin:
        rotation = rotation + np.pi * batch.viscosity * (batch.wire_diameter * f.alpha) ** 2 * batch.arc_length
    return scale * f.torque, -batch.hand * scale * b * mixed, rotation


class Sbt(SwimmerModel):
    """Lighthill's slender-body theory for the tail, Perrin's spheroid for the body; axial entries only."""

    name = "sbt"
    title = "SBT"
    references = ("lighthill1976", "biorob2012", "perrin1934")
    known_error = STATED["sbt"]
    known_speed_error = 0.01 * SPEED_ERRORS["sbt"]
    parts = ("body", "tail", "rotor", "robot")
    axial_only = True

    def error_statement(self, batch: RobotBatch, fitted_by: str = "") -> str:
        """See `ResistanceModel.error_statement`."""
        spin = "" if batch.options.sbt.spin else " (the wire's own spin, some 8 % of the torque, is an option)"
        return f"{validation_note(batch, CHECKED['sbt'])}{spin}; {speed_note('sbt')}{wall_clause(batch)}"

    def domain(self, batch: RobotBatch) -> list[Limit]:
        """Alpha within the expansion; chi, q and psi positive, so that the block is positive definite."""
        with np.errstate(divide="ignore", invalid="ignore"):
            f = helix_functions(batch)
        limits = []
        if not batch.form.is_plain:
            varied = np.full(1, 0.0 if batch.form.is_helix else np.inf)
            starts = np.full(1, float(batch.form.starts))
            limits = [Limit.named("one-start", starts, 1.0), Limit.named("one-helix", varied, 1.0)]
        widest = batch.wavelength * np.sqrt(ALPHA_MIN**-2 - 1.0) / (2.0 * np.pi)
        limits.append(Limit.named("tabulated-alpha", batch.amplitude, widest, least=ALPHA_MIN))
        inside = limits[-1].holds
        for name, value in (("1/chi", f.torque), ("q", f.q), ("Psi", f.Psi), ("psi", f.psi)):
            limit = Limit.named("helix-function", value, 0.0, name=name)
            limits.append(limit._replace(holds=limit.holds | ~inside))
        return limits

    def cautions(self, batch: RobotBatch) -> list[Limit]:
        """A wire thin against its wave, and at least one turn."""
        return thin_wire_cautions(batch, _eps_constant(batch))

    def axial(self, batch: RobotBatch) -> Axial:
        """See `SwimmerModel.axial`."""
        drag, rotation = body_axial(batch)
        return two_parts_axial((drag, np.zeros(1), rotation), tail_axial(batch))

    def resistance(self, batch: RobotBatch, phase: PerRobot) -> Matrix12:
        """See `SwimmerModel.resistance`; all but the axial entries are NaN."""
        r = np.full((batch.size, 12, 12), np.nan)
        axial = np.array([0, 3, 6, 9])
        r[:, axial[:, None], axial] = self.axial(batch)
        return r

    def part_matrix(self, batch: RobotBatch, part: str, phase: PerRobot) -> Matrix6:
        """See `ResistanceModel.part_matrix`; all but the axial entries are NaN."""
        self.check_part(batch, part)
        drag, rotation = body_axial(batch)
        body = (drag, np.zeros(1), rotation)
        tail = tail_axial(batch)
        chosen = {"body": (body,), "robot": (body, tail)}.get(part, (tail,))
        b11, b14, b44 = (sum(entries) for entries in zip(*chosen, strict=True))
        matrix = np.full((batch.size, 6, 6), np.nan)
        matrix[:, 0, 0], matrix[:, 3, 3] = b11, b44
        matrix[:, 0, 3] = matrix[:, 3, 0] = b14
        return matrix
