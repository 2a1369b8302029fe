"""What a robot in a circular tube is held against: sphere, capsule and long cylinders by other methods.

Sphere: a sphere on the axis of an infinite tube, zero net flux, by Stokes multipoles about the sphere (Haberman
and Sayre, DTMB Report 1143, 1958, in 40 digits); each multipole's answer of the wall is a Fourier integral, all
of them by the double-exponential rule.
Capsule: the paper's capsule on the axis, by single layers on capsule and meshed wall (mode 0): a closed tube with
flat ends far away, which is an infinite tube with zero net flux, and open tubes of finite length in a bath.
Annulus, plane: long cylinders, per length, in an eccentric tube and beside a plane: closed forms, each held
against a collocation of Laurent series.
Near plane: published values of a sphere beside a plane.

Lengths in mm for the capsule and free elsewhere, viscosity 1: for SI multiply drag and torque of the capsule by
mu * 1e-3 and mu * 1e-9. Some two minutes in all.

    OMP_NUM_THREADS=1 python benchmarks/tube_reference.py --write
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import mpmath as mp  # type: ignore[import-untyped]
import numpy as np
from numpy.typing import NDArray

from spirillum.fluid.wire.sources import Panels, panels_of
from spirillum.robot.outline import Outline, Segment, body_outline, cylinder_outline

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Table = NDArray[np.object_]
"""Multiple-precision numbers."""
Row = dict[str, Any]

HERE = Path(__file__).parent
RATIOS = ("0.1", "0.2", "0.3", "0.4", "0.5", "0.6", "0.7", "0.8", "0.9")
"""Sphere to tube radius."""
DIGITS = 40
BODY_DIAMETER, BODY_LENGTH = 18.0, 35.0
END_LOSS = 3.0 * np.pi / 8.0
"""Pressure loss at both ends as a length of tube, in radii: ends in a plane wall (R. A. Sampson, Phil. Trans. R. Soc. A
182:449, 1891; Z. Dagan, S. Weinbaum and R. Pfeffer, J. Fluid Mech. 115:505, 1982)."""

# ---------------------------------------------------------------------------------------------------------------------
# Sphere on the axis
# ---------------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Moments:
    """Fourier integrals of the wall's answer to each multipole at the centre; tube of radius 1.

    Stream function psi with u_z = psi_rho/rho. Multipoles r^(1-n) C_n (kind 0) and r^(3-n) C_n (kind 1), n even, with
    Gegenbauer functions C_n of order -1/2 of cos(theta). Around the centre the answer is a sum of r^n C_n and
    r^(n+2) C_n.
    """

    low: Table
    """Coefficients of r^n C_n, (2 kinds, multipoles, n), without (-1)^(n/2-1)/(n-2)!."""
    high: Table
    """The same of r^(n+2) C_n, without it and without 1/(2n+1)."""
    swirl: Table
    """Answer to r^(-n-1) P_n^1, n odd: coefficients of r^n P_n^1, (multipoles, n), without (-1)^((n-1)/2)/(n+1)!."""


def _wall_moments(highest: int, step: float) -> Moments:
    """Integrals over k from 0 to infinity with k = exp(t - exp(-t)), trapezoidal in t.

    Args:
        highest: highest n, even.
        step: of t.
    """
    even = range(2, highest + 1, 2)
    count = len(even)
    low, high = (np.full((2, count, count), mp.mpf(0)) for _ in range(2))
    swirl = np.full((count, count), mp.mpf(0))
    for index in range(int(-3.7 / step), int(5.3 / step)):
        mp.mp.dps = 110  # near k = 0 the wall's equations are nearly dependent: of order k^3
        t = index * mp.mpf(step)
        k = mp.exp(t - mp.exp(-t))
        if k > 4 * highest + 40:
            break
        weight = step * k * (1 + mp.exp(-t)) * 2 / mp.pi
        mp.mp.dps = int(DIGITS + max(0, -4 * mp.log10(k)))
        i0, i1, k0, k1 = mp.besseli(0, k), mp.besseli(1, k), mp.besselk(0, k), mp.besselk(1, k)
        determinant = 2 * i0 * i1 + k * (i1 * i1 - i0 * i0)
        x, y = (np.empty((2, count), dtype=object) for _ in range(2))
        for j, n in enumerate(even):
            alpha = mp.mpf((-1) ** (n // 2 - 1)) / mp.factorial(n)
            fall = (n - 2) * (n - 3)
            value = (k ** (n - 1) * k1, (2 * n - 3) * k ** (n - 2) * k0 - fall * k ** (n - 3) * k1)
            slope = (-(k**n) * k0, k ** (n - 2) * ((2 * n - 3) * (2 * k0 - k * k1) + fall * k0))
            for kind in range(2):  # x rho I_1 + y rho^2 I_0 takes value and slope away at rho = 1
                v, s = -alpha * value[kind], -alpha * slope[kind]
                x[kind, j] = (v * (2 * i0 + k * i1) - s * i0) / determinant
                y[kind, j] = (s * i1 - v * k * i0) / determinant
        powers = np.array([k ** (n - 2) for n in even], dtype=object)
        share = np.array([mp.mpf(n * (n - 1)) / (2 * n - 3) for n in even], dtype=object)
        low += weight * (x[:, :, None] * (k * powers) + y[:, :, None] * (share * powers))
        high += weight * y[:, :, None] * (k * k * powers)
        odd = np.array([(-1) ** (n // 2 - 1) * k ** (n - 1) / mp.factorial(n - 2) for n in even], dtype=object)
        swirl -= weight * k1 / i1 * odd[:, None] * (k * powers)
    mp.mp.dps = DIGITS
    return Moments(low, high, swirl)


def _sphere(ratio: str, moments: Moments, highest: int) -> Array:
    """(drag, held, torque) factors of a sphere from multipoles up to order `highest`."""
    a = mp.mpf(ratio)
    even = range(2, highest + 1, 2)
    count = len(even)
    matrix, right = mp.matrix(2 * count, 2 * count), mp.matrix(2 * count, 2)
    for i, n in enumerate(even):
        factor = mp.mpf((-1) ** (n // 2 - 1)) / mp.factorial(n - 2) * a**n
        for kind in range(2):  # rows: psi and r psi_r at r = a; unknowns are scaled to 1 there
            matrix[2 * i, 2 * i + kind] += 1
            matrix[2 * i + 1, 2 * i + kind] += 1 - n + 2 * kind
            for j, m in enumerate(even):
                scale = factor * a ** (m - 1 - 2 * kind)
                low = scale * moments.low[kind, j, i]
                high = scale * moments.high[kind, j, i] * a * a / (2 * n + 1)
                matrix[2 * i, 2 * j + kind] += low + high
                matrix[2 * i + 1, 2 * j + kind] += n * low + (n + 2) * high
    right[0, 0], right[1, 0] = a**2, 2 * a**2
    fourth = a**4 * mp.mpf(4) / 5  # psi = rho^2 - rho^4/2 of the unit mean flow
    right[0, 1], right[1, 1] = 2 * a**2 - fourth, 4 * a**2 - 4 * fourth
    right[2, 1], right[3, 1] = fourth, 4 * fourth
    drag, held = (4 * mp.lu_solve(matrix, right[:, column])[1] / (6 * a * a) for column in range(2))
    spin = mp.matrix(count, count)
    for i in range(count):
        n = 2 * i + 1
        factor = mp.mpf((-1) ** i) / mp.factorial(n + 1) * a**n
        spin[i, i] += 1
        for j in range(count):
            spin[i, j] += factor * a ** (2 * j + 2) * moments.swirl[j, i]
    unit = mp.matrix(count, 1)
    unit[0] = a
    return np.array([float(drag), float(held), float(mp.lu_solve(spin, unit)[0] / a)])


def sphere_on_axis() -> Row:
    highest = 56
    fine, coarse = _wall_moments(highest, 0.05), _wall_moments(highest, 0.0625)
    rows, orders = [], (14, 28, highest)
    for ratio in RATIOS:
        levels = [_sphere(ratio, fine, order) for order in orders]
        best = levels[-1]
        x = float(ratio)
        faxen = 1.0 / (1.0 - 2.104443 * x + 2.08877 * x**3 - 0.94813 * x**5)
        rows.append(
            {
                "radius_ratio": x,
                "drag": best[0],
                "torque": best[2],
                "held_in_poiseuille": best[1],
                "difference_from_half_the_multipoles": float(np.abs(levels[1] / best - 1.0).max()),
                "difference_from_a_quarter": float(np.abs(levels[0] / best - 1.0).max()),
                "difference_from_coarser_integrals": float(np.abs(_sphere(ratio, coarse, highest) / best - 1.0).max()),
                "faxen_drag_over_this": faxen / best[0],
                "torque_series_over_this": (1.0 + 0.796824 * x**3) / best[2],
            }
        )
    return {
        "meaning": {
            "drag": "force over 6 pi mu a U, moving along the axis, infinite tube, zero net flux",
            "torque": "torque over 8 pi mu a^3 Omega, turning about the axis",
            "held_in_poiseuille": "force over 6 pi mu a Um on a sphere at rest in a flow of mean velocity Um; by "
            "reciprocity also pressure rise times pi R^2, over 6 pi mu a U, of a moving one with zero net flux",
            "faxen_drag_over_this": "1/(1 - 2.104443 x + 2.08877 x^3 - 0.94813 x^5), x = a/R, over drag",
            "torque_series_over_this": "(1 + 0.796824 x^3) over torque",
        },
        "source": "W. L. Haberman and R. M. Sayre, DTMB Report 1143, 1958: method; their table is 1 % only",
        "multipoles": list(orders),
        "digits_of_arithmetic": DIGITS,
        "rows": rows,
    }


# ---------------------------------------------------------------------------------------------------------------------
# Long cylinders: closed forms
# ---------------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Bipolar:
    """Bipolar coordinates of an eccentric annulus: inner circle xi = inner, outer xi = outer < inner, foci +-focus."""

    inner: float
    outer: float
    focus: float

    @property
    def between(self) -> float:
        """Difference of xi: arccosh((a^2 + R^2 - e^2)/(2 a R))."""
        return self.inner - self.outer


def bipolar(a: float, R: float, e: float) -> Bipolar:
    """Of a circle of radius a in one of radius R, centres 0 < e < R - a apart."""
    inner = float(np.arccosh((R * R - a * a - e * e) / (2.0 * a * e)))
    outer = float(np.arccosh((R * R - a * a + e * e) / (2.0 * R * e)))
    return Bipolar(inner, outer, a * float(np.sinh(inner)))


def annulus_axial_drag(a: float, R: float, e: float) -> float:
    """Force per length along the axis over mu U, no pressure gradient.

    A logarithmic potential: the capacitance of eccentric cylinders (W. R. Smythe, Static and Dynamic Electricity).
    """
    return float(2.0 * np.pi / np.arccosh((a * a + R * R - e * e) / (2.0 * a * R)))


def annulus_axial_drag_no_flux(a: float, R: float, e: float) -> float:
    """Force per length over mu U with zero net flux, on the side and by the pressure gradient on the ends.

    Drag + Q^2/P with the flux Q = pi e c/(alpha - beta) of inner cylinder and fluid for unit velocity (Green's theorem)
    and the flux P for a unit pressure gradient (Piercy, Hooper and Winny, Phil. Mag. 15:647, 1933).
    """
    if e == 0.0:
        return float(2.0 * np.pi / (np.log(R / a) - (R * R - a * a) / (R * R + a * a)))
    drag, poiseuille = annulus_axial_drag(a, R, e), annulus_poiseuille_flux(a, R, e)
    place = bipolar(a, R, e)
    return drag + (np.pi * e * place.focus / place.between) ** 2 / poiseuille


def annulus_poiseuille_flux(a: float, R: float, e: float) -> float:
    """Flux through an eccentric annulus times mu over the pressure gradient (Piercy, Hooper and Winny)."""
    place = bipolar(a, R, e)
    n = np.arange(1, int(40.0 / (2.0 * place.inner)) + 2)
    # exp(-n (alpha + beta))/sinh(n (alpha - beta)), without overflow
    terms = n * 2.0 * np.exp(-2.0 * n * place.inner) / -np.expm1(-2.0 * n * place.between)
    square = (e * place.focus) ** 2
    return float(np.pi / 8.0 * (R**4 - a**4 - 4.0 * square / place.between - 8.0 * square * np.sum(terms)))


def annulus_rotation(a: float, R: float, e: float) -> tuple[float, float]:
    """Force and torque per length over mu Omega of a cylinder turning about its own axis inside a fixed one.

    The pressure is single-valued: the fluid goes round freely. The force is across the line of centres: for a cylinder
    displaced to +x that turns from x to y, the force *on the cylinder* is along +y, the way its surface moves in the
    narrow gap. The torque is that against the rotation, about the cylinder's own axis. G. B. Jeffery, Proc. R. Soc. A
    101:169, 1922; G. H. Wannier, Q. Appl. Math. 8:1, 1950. Here the constants of Jeffery's stream function
    (1/h)[(A + B xi) cosh xi + (C + D xi) sinh xi + ...] are eliminated by hand; force and torque are 4 pi D and
    4 pi c (B + D coth alpha), up to sign.
    """
    if e == 0.0:
        return 0.0, 4.0 * np.pi * a * a * R * R / (R * R - a * a)
    place = bipolar(a, R, e)
    alpha, beta, d, c = place.inner, place.outer, place.between, place.focus
    s, gap = np.sinh(d), d - np.tanh(d)
    size = s * s - d * d
    # flow round the gap: c times this
    flow = -a * (d * np.sinh(alpha) - s * np.sinh(beta)) / (d + s * np.cosh(alpha + beta) + size / gap)
    B = -flow / gap
    D = (a * (s * np.cosh(beta) - d * np.cosh(alpha)) - flow * s * np.sinh(alpha + beta)) / size
    return float(-4.0 * np.pi * D), float(4.0 * np.pi * c * (B + D / np.tanh(alpha)))


def plane_resistances(a: float, h: float) -> dict[str, float]:
    """Per length and viscosity, of a cylinder whose axis is h from a plane.

    Across and about the axis: D. J. Jeffrey and Y. Onishi, Q. J. Mech. Appl. Math. 34:129, 1981. Turning exerts no
    force, and translation no torque.
    """
    xi = float(np.arccosh(h / a))
    return {
        "along_axis": 2.0 * np.pi / xi,
        "across_along_plane": 4.0 * np.pi / xi,
        "normal_to_plane": 4.0 * np.pi / (xi - float(np.tanh(xi))),
        "rotation": 4.0 * np.pi * a * a / float(np.sqrt(1.0 - (a / h) ** 2)),
    }


# ---------------------------------------------------------------------------------------------------------------------
# Long cylinders: collocation
# ---------------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Section:
    """A circle of radius a about 0 inside a circle of radius R about s, or above a plane y = Im(s)/2 (R = 0)."""

    a: float
    R: float
    s: complex
    terms: int

    @property
    def angles(self) -> Array:
        """Directions of the collocation points."""
        return np.asarray((np.arange(4 * self.terms) + 0.5) * (2.0 * np.pi / (4 * self.terms)), dtype=np.float64)

    @property
    def inner(self) -> Complex:
        """Points on the cylinder."""
        return np.asarray(self.a * np.exp(1j * self.angles))

    @property
    def outer(self) -> Complex:
        """Points on the wall."""
        if self.R:
            return np.asarray(self.s + self.R * np.exp(1j * self.angles))
        return np.asarray(-0.5 * self.s.imag * np.tan(0.5 * (self.angles - np.pi)) + 0.5 * self.s)

    def powers(self, z: Complex) -> list[tuple[Complex, Complex, Complex]]:
        """(z - centre, f, f') of Laurent terms about the cylinder's centre and the wall's, or its image's."""
        y = z - self.s
        found = []
        for k in range(1, self.terms + 1):
            f = (self.a / z) ** k
            found.append((z, f, -k * f / z))
            g = (y / self.R) ** k if self.R else (self.a / y) ** k
            found.append((y, g, (k if self.R else -k) * g / y))
        return found


def _fit(columns: list[Complex], right: list[Complex]) -> tuple[Array, float]:
    """Real coefficients by least squares, and the largest residual."""
    complex_matrix, complex_wanted = np.array(columns).T, np.array(right).T
    matrix = np.concatenate([complex_matrix.real, complex_matrix.imag])
    wanted = np.concatenate([complex_wanted.real, complex_wanted.imag])
    found = np.linalg.lstsq(matrix, wanted, rcond=1e-15)[0]
    return np.asarray(found), float(np.abs(matrix @ found - wanted).max())


def plane_flow(section: Section) -> tuple[Array, float]:
    """(force x, force y, torque) per length for unit motions along x, y and about the centre; residual.

    u + i v = f - z conj(f') + conj(g): Laurent series, and a point force in the cylinder.
    """
    z = np.concatenate([section.inner, section.outer])

    def point_force(q: complex, y: Complex) -> Complex:
        return np.asarray(2.0 * q * np.log(np.abs(y)) - np.conj(q) * y / np.conj(y))

    columns = [point_force(q, z) - (0.0 if section.R else point_force(q, z - section.s)) for q in (1.0, 1j)]
    for factor in (1.0, 1j):
        columns += [np.conj(factor * f) for _, f, _ in section.powers(z)]  # the first is the rotlet
        columns += [factor * f - y * np.conj(factor * slope) for y, f, slope in section.powers(z)]
    columns += [np.full(z.shape, constant) for constant in (1.0, 1j) if section.R]
    motions = [np.ones_like(section.inner), np.full_like(section.inner, 1j), 1j * section.inner]
    found, residual = _fit(columns, [np.concatenate([m, np.zeros_like(section.outer)]) for m in motions])
    rotlet = 2 + 4 * section.terms
    forces = -4.0 * np.pi * np.array([[2.0], [2.0], [section.a]]) * found[[0, 1, rotlet]]
    return forces, residual


def axial_flow(section: Section) -> tuple[float, float, float, float]:
    """Drag per length; with a circular wall flux per velocity and per pressure gradient; residual."""
    z = np.concatenate([section.inner, section.outer])

    def columns(z: Complex) -> list[Complex]:
        pole = np.log(np.abs(z)) - (0.0 if section.R else np.log(np.abs(z - section.s)))
        rest = [np.ones(z.shape)] if section.R else []
        rest += [
            f.real if section.R else (f * (-1j) ** (k // 2 + 1)).real for k, (_, f, _) in enumerate(section.powers(z))
        ]
        return [np.asarray(column + 0j) for column in (pole, *rest)]

    moving = np.concatenate([np.ones_like(section.inner), np.zeros_like(section.outer)])
    right = [moving, np.asarray(0.25 * np.abs(z) ** 2 + 0j)] if section.R else [moving]
    found, residual = _fit(columns(z), right)
    drag = -2.0 * np.pi * found[0, 0]
    if not section.R:
        return float(drag), 0.0, 0.0, residual
    # over the annulus: rays from the inner centre to the wall
    nodes, weights = np.polynomial.legendre.leggauss(4 * section.terms)
    turn = np.exp(1j * section.angles)
    along = (np.conj(section.s) * turn).real
    reach = along + np.sqrt(section.R**2 - abs(section.s) ** 2 + along**2)
    radius = section.a + (reach - section.a)[:, None] * 0.5 * (1.0 + nodes)
    element = radius * 0.5 * (reach - section.a)[:, None] * weights * (2.0 * np.pi / turn.size)
    field = np.array(columns((radius * turn[:, None]).ravel())).real.T @ found
    flux = element.ravel() @ (field - np.stack([0.0 * radius, 0.25 * radius**2], axis=-1).reshape(-1, 2))
    return float(drag), float(flux[0] + np.pi * section.a**2), float(flux[1]), residual


def eccentric_annulus() -> Row:
    rows = []
    for a, R, gap in ((9.0, 20.0, 8.0), (9.0, 20.0, 2.0), (9.0, 20.0, 0.5), (9.0, 15.0, 3.0), (9.0, 15.0, 0.5)):
        e = R - a - gap
        place = bipolar(a, R, e)
        section = Section(a, R, complex(-e), max(20, int(30.0 / place.between)))
        matrix, residual = plane_flow(section)
        drag, flux, poiseuille, axial_residual = axial_flow(section)
        force, torque = annulus_rotation(a, R, e)
        rows.append(
            {
                "a": a,
                "R": R,
                "gap": gap,
                "axial_drag": annulus_axial_drag(a, R, e),
                "axial_drag_no_flux": annulus_axial_drag_no_flux(a, R, e),
                "poiseuille_flux": annulus_poiseuille_flux(a, R, e),
                "rotation_force": force,
                "rotation_torque": torque,
                "collocation_over_closed_form_less_1": {
                    "axial_drag": drag / annulus_axial_drag(a, R, e) - 1.0,
                    "axial_drag_no_flux": (drag + flux**2 / poiseuille) / annulus_axial_drag_no_flux(a, R, e) - 1.0,
                    "poiseuille_flux": poiseuille / annulus_poiseuille_flux(a, R, e) - 1.0,
                    "rotation_force": -matrix[1, 2] / force - 1.0,
                    "rotation_torque": matrix[2, 2] / torque - 1.0,
                    "reciprocity": matrix[2, 1] / matrix[1, 2] - 1.0,
                },
                "collocation_residual": max(residual, axial_residual),
            }
        )
    c = 1e-4  # Sommerfeld's journal: clearance over radius, eccentricity half of it
    force, torque = annulus_rotation(1.0, 1.0 + c, 0.5 * c)
    long_bearing = 2.25 * np.sqrt(0.75)
    return {
        "meaning": {
            "axial_drag": "force per length over mu U along the axis, no pressure gradient: 2 pi/arccosh((a^2 + R^2 - "
            "e^2)/(2 a R)); difference of two long capsules at zero local pressure gradient",
            "axial_drag_no_flux": "the same at zero net flux through the whole tube, pressure on the ends included: "
            "difference of two long capsules in a closed tube",
            "poiseuille_flux": "flux times mu over pressure gradient",
            "rotation_force": "force per length over mu Omega on a cylinder that turns about its own axis, across the "
            "line of centres, the way its surface moves in the narrow gap; pressure single-valued",
            "rotation_torque": "torque per length over mu Omega against the rotation, about the cylinder's axis",
        },
        "source": "Smythe (capacitance); Piercy, Hooper and Winny, Phil. Mag. 15:647, 1933; Jeffery, Proc. R. Soc. A "
        "101:169, 1922; Wannier, Q. Appl. Math. 8:1, 1950",
        "lubrication_limit_over_closed_form_less_1": {
            "clearance_over_radius": c,
            "rotation_force": 12.0 * np.pi * 0.5 / long_bearing / c**2 / force - 1.0,
            "rotation_torque": 4.0 * np.pi * 1.5 / long_bearing / c / torque - 1.0,
        },
        "rows": rows,
    }


def plane_cylinder() -> Row:
    rows = []
    for h in (1.05, 1.2, 2.0, 5.0):
        closed = plane_resistances(1.0, h)
        section = Section(1.0, 0.0, -2j * h, max(20, int(30.0 / np.arccosh(h))))
        matrix, residual = plane_flow(section)
        drag, _, _, axial_residual = axial_flow(section)
        fitted = (drag, matrix[0, 0], matrix[1, 1], matrix[2, 2])
        rows.append(
            {
                "a": 1.0,
                "h": h,
                **closed,
                "collocation_over_closed_form_less_1": {
                    name: value / closed[name] - 1.0 for name, value in zip(closed, fitted, strict=True)
                },
                "coupling": float(np.abs(matrix - np.diag(np.diag(matrix))).max()),
                "collocation_residual": max(residual, axial_residual),
            }
        )
    return {
        "meaning": "per length and viscosity; axis at h from the plane. 2 pi/arccosh(h/a), 4 pi/arccosh(h/a), "
        "4 pi/(arccosh(h/a) - sqrt(1 - (a/h)^2)), 4 pi a^2/sqrt(1 - (a/h)^2); no coupling of rotation and translation",
        "source": "D. J. Jeffrey and Y. Onishi, Q. J. Mech. Appl. Math. 34:129, 1981",
        "rows": rows,
    }


# ---------------------------------------------------------------------------------------------------------------------
# Capsule on the axis
# ---------------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Mesh:
    """Panel sizes: nodes of a panel, largest panel beside the body in mm, distance of closed ends in tube radii."""

    order: int
    size: float
    beyond: float = 4.0


LEVELS = (Mesh(8, 4.0, 3.0), Mesh(12, 3.0), Mesh(16, 2.0))


@dataclass(frozen=True)
class Solved:
    """Works of the body's tractions in unit motion along and about the axis, and at rest in unit mean flow."""

    panels: Panels
    density: Array
    """(nodes, 3 components, 3 flows)."""
    works: Array
    """(3, 3)."""

    @property
    def drag(self) -> float:
        """Force over mu U, mm."""
        return float(self.works[0, 0])

    @property
    def held(self) -> float:
        """Force at rest over mu Um, mm."""
        return float(self.works[0, 2])

    @property
    def torque(self) -> float:
        """Torque over mu Omega, mm^3."""
        return float(self.works[1, 1])

    @property
    def added(self) -> float:
        """Pressure loss of the body at rest times the tube's section over mu Um, mm."""
        return float(self.works[2, 2])

    def mean_velocity(self, x: float, R: float) -> float:
        """Mean velocity through the tube's section at x while the body moves with unit velocity."""
        nodes, weights = np.polynomial.legendre.leggauss(32)
        rho = 0.5 * R * (1.0 + nodes)
        blocks = self.panels.velocities(np.full(rho.shape, x), rho, 1)[0]
        velocity = (blocks @ self.density[:, :, 0].ravel()).reshape(-1, 3)[:, 0] / (8.0 * np.pi)
        return float(np.sum(velocity * rho * weights) / R)


def _joined(parts: list[Panels]) -> Panels:
    solid = np.concatenate([np.full(part.solid.shape, number) for number, part in enumerate(parts)])
    return Panels(np.concatenate([p.x for p in parts]), np.concatenate([p.rho for p in parts]), solid)


def _solved(parts: list[Panels], closed: list[int], R: float) -> Solved:
    """Single layers on several surfaces; the first is the body, the others are at rest.

    Args:
        parts: panels of each.
        closed: those that enclose a volume: a density along their normal moves nothing.
        R: radius of the Poiseuille flow.
    """
    panels = _joined(parts)
    matrix = panels.velocities(panels.x.ravel(), panels.rho.ravel(), 1, on_nodes=True)[0]
    for number in closed:
        there = panels.solid_of_node == number
        null = np.zeros((panels.size, 3))
        null[there, :2] = panels.normal[there]
        dual = null * panels.area[:, None]
        matrix += 8.0 * np.pi / np.sum(null * dual) * np.outer(null.ravel(), dual.ravel())
    there, rho = panels.solid_of_node == 0, panels.rho.ravel()
    flows = np.zeros((panels.size, 3, 3))
    flows[there, 0, 0] = 1.0
    flows[there, 2, 1] = rho[there]
    flows[there, 0, 2] = 2.0 * (1.0 - (rho[there] / R) ** 2)
    density = np.linalg.solve(matrix, 8.0 * np.pi * flows.reshape(-1, 3)).reshape(flows.shape)
    works = 2.0 * np.pi * np.einsum("n,nci,ncj->ij", panels.area, flows, density)
    return Solved(panels, density, works)


def _capsule(mesh: Mesh, length: float = BODY_LENGTH) -> Panels:
    outline = body_outline("capsule", BODY_DIAMETER, length, 0.0, "hemisphere", "flat")
    return panels_of([outline], lambda _, x, rho: np.full(np.shape(x * rho), mesh.size), mesh.order)


def _growing(mesh: Mesh, R: float, half: float) -> Callable[[int, Array, Array], Array]:
    """Longest panel of a wall, growing away from a body from -half to half."""
    return lambda _, x, rho: mesh.size * (1.0 + np.maximum(np.abs(x) + 0.0 * rho - half, 0.0) / R)


def closed_tube(body: Panels, half: float, R: float, mesh: Mesh) -> Solved:
    """A body in a tube with flat ends `mesh.beyond` radii away from it."""
    end = half + mesh.beyond * R
    wall = panels_of([cylinder_outline(2.0 * R, end, -end)], _growing(mesh, R, half), mesh.order)
    return _solved([body, wall], [0, 1], R)


def _thin_wall(length: float, R: float, mesh: Mesh, half: float) -> Panels:
    """An open cylinder without thickness; at its edges the density is as the inverse root of the distance."""
    edges = [0.0, 0.5 * length]
    at = 0
    while at < len(edges) - 1:
        low, high = edges[at], edges[at + 1]
        allowed = mesh.size * (1.0 + max(0.0, min(low - half, 0.5 * length - high)) / R)
        if high - low > allowed:
            edges.insert(at + 1, 0.5 * (low + high))
        else:
            at += 1
    nodes = 0.5 * (1.0 + np.polynomial.legendre.leggauss(mesh.order)[0])
    x = [low + (high - low) * nodes for low, high in pairwise(edges[:-1])]
    x.append(edges[-1] - (edges[-1] - edges[-2]) * (1.0 - nodes) ** 4)
    both = np.concatenate([np.array(x), -np.array(x)])
    return Panels(both, np.full(both.shape, R), np.zeros(len(both), dtype=int))


def _thick_wall(length: float, R: float, thickness: float, mesh: Mesh, half: float) -> Panels:
    """A tube cut square, of a wall with a thickness."""
    end, outer = 0.5 * length, R + thickness
    corners = [(0.0, R), (-end, R), (-end, outer), (0.0, outer), (end, outer), (end, R), (0.0, R)]
    lines = tuple(Segment(start, stop) for start, stop in pairwise(corners))
    outline = Outline(lines, (True, True, False, True, True))

    def longest(_: int, x: Array, rho: Array) -> Array:
        near = np.minimum(np.maximum(np.abs(x) - half, 0.0), np.maximum(end - np.abs(x), 0.0))
        return mesh.size * (1.0 + (near + 0.0 * rho) / R)

    return panels_of([outline], longest, mesh.order)


def open_tube(length: float, R: float, thickness: float, mesh: Mesh) -> Solved:
    """The capsule in the middle of a tube in an unbounded bath."""
    half = 0.5 * BODY_LENGTH
    if thickness:
        return _solved([_capsule(mesh), _thick_wall(length, R, thickness, mesh, half)], [0, 1], R)
    return _solved([_capsule(mesh), _thin_wall(length, R, mesh, half)], [0], R)


def _change(levels: list[Solved]) -> dict[str, float]:
    """Relative difference of the last level from the one before."""
    before, last = levels[-2:]
    return {name: getattr(before, name) / getattr(last, name) - 1.0 for name in ("drag", "torque")}


def _open_row(diameter: float, length: float, thickness: float, closed: Solved, meshes: tuple[Mesh, ...]) -> Row:
    R = 0.5 * diameter
    levels = [open_tube(length, R, thickness, mesh) for mesh in meshes]
    solved = levels[-1]
    section = 0.5 * (0.5 * BODY_LENGTH + 0.5 * length)
    mean = [solved.mean_velocity(x, R) for x in (section, -section)]

    def balance(ends: float) -> tuple[float, float]:
        """(mean velocity, drag) of the one-scalar balance."""
        velocity = closed.held / (8.0 * np.pi * (length + ends * R) + closed.added)
        return velocity, closed.drag - closed.held * velocity

    ends = ((closed.held / mean[0] - closed.added) / (8.0 * np.pi) - length) / R
    return {
        "tube_diameter": diameter,
        "tube_length": length,
        "wall_thickness": thickness,
        "drag": solved.drag,
        "torque": solved.torque,
        "mean_velocity": mean[0],
        "relative_change_from_the_coarser_mesh": _change(levels),
        "mean_velocity_behind_over_ahead_less_1": mean[1] / mean[0] - 1.0,
        "balance": {
            "mean_velocity": balance(END_LOSS)[0],
            "drag": balance(END_LOSS)[1],
            "drag_over_this_less_1": balance(END_LOSS)[1] / solved.drag - 1.0,
        },
        "end_loss": ends,
        "balance_with_that_end_loss_drag_over_this_less_1": balance(ends)[1] / solved.drag - 1.0,
    }


def capsule_on_axis() -> Row:
    half = 0.5 * BODY_LENGTH
    free = [_solved([_capsule(mesh)], [0], 20.0) for mesh in LEVELS]
    closed_rows, open_rows = [], []
    for diameter in (40.0, 30.0):
        R = 0.5 * diameter
        levels = [closed_tube(_capsule(mesh), half, R, mesh) for mesh in LEVELS]
        closed = levels[-1]
        longer = [closed_tube(_capsule(LEVELS[1], length), 0.5 * length, R, LEVELS[1]) for length in (55.0, 75.0)]
        slope = annulus_axial_drag_no_flux(0.5 * BODY_DIAMETER, R, 0.0)
        closed_rows.append(
            {
                "tube_diameter": diameter,
                "drag": closed.drag,
                "torque": closed.torque,
                "held_in_poiseuille": closed.held,
                "added_pressure_loss": closed.added,
                "drag_over_unbounded": closed.drag / free[-1].drag,
                "torque_over_unbounded": closed.torque / free[-1].torque,
                "relative_change_from_the_coarser_mesh": _change(levels),
                "reciprocity": closed.works[2, 0] / closed.works[0, 2] - 1.0,
                "slope_over_closed_form_less_1": {
                    "drag": (longer[1].drag - longer[0].drag) / 20.0 / slope - 1.0,
                    "torque": (longer[1].torque - longer[0].torque)
                    / 20.0
                    / annulus_rotation(0.5 * BODY_DIAMETER, R, 0.0)[1]
                    - 1.0,
                },
            }
        )
        open_rows += [_open_row(diameter, length, 0.0, closed, LEVELS) for length in (100.0, 350.0)]
        if diameter == 40.0:
            open_rows += [_open_row(diameter, 1000.0, 0.0, closed, LEVELS[:2])]
            open_rows += [_open_row(diameter, 100.0, thickness, closed, LEVELS[:2]) for thickness in (2.0, 10.0, 40.0)]
    return {
        "body": "18 mm diameter, 35 mm long overall, hemisphere in front, flat behind with a sharp edge",
        "units": "mm, viscosity 1, unit velocity or rate",
        "meaning": {
            "drag": "force over mu U, mm",
            "torque": "torque over mu Omega, mm^3",
            "held_in_poiseuille": "force at rest in unit mean flow, and, by reciprocity, pressure rise times pi R^2 of "
            "the moving one, mm",
            "added_pressure_loss": "pressure loss of the body at rest in unit mean flow times pi R^2, mm",
            "slope_over_closed_form_less_1": "difference of capsules 75 and 55 mm long, per length, against the "
            "concentric annulus at zero net flux",
            "mean_velocity": "mean velocity through the tube over U while the body moves",
            "wall_thickness": "mm, 0: a sheet; otherwise the tube is cut square",
            "balance": "mean velocity Um from held - added Um = 8 pi Um (L + 3 pi R/8), drag = drag(closed) - held Um",
            "end_loss": "(L_eff - L)/R with which this balance gives the mean velocity found. 3 pi/8 = 1.178 holds for "
            "ends in a plane wall; a free tube loses less, the thinner its wall",
        },
        "unbounded": {
            "drag": free[-1].drag,
            "torque": free[-1].torque,
            "relative_change_from_the_coarser_mesh": _change(free),
        },
        "closed_tube_zero_net_flux": closed_rows,
        "open_tube_in_a_bath": open_rows,
        "sphere_check": _sphere_check(),
    }


def _sphere_check() -> Row:
    """The same panels for a sphere of half the tube's radius, against the multipoles."""
    sphere = body_outline("sphere", 20.0, 20.0, 0.0, None, None)
    mesh = LEVELS[-1]
    body = panels_of([sphere], lambda _, x, rho: np.full(np.shape(x * rho), mesh.size), mesh.order)
    solved = closed_tube(body, 10.0, 20.0, Mesh(mesh.order, mesh.size, 5.0))
    drag, held, torque = _sphere("0.5", _wall_moments(30, 0.0625), 28)
    return {
        "radius_ratio": 0.5,
        "panels_over_multipoles_less_1": {
            "drag": solved.drag / (60.0 * np.pi) / drag - 1.0,
            "held_in_poiseuille": solved.held / (60.0 * np.pi) / held - 1.0,
            "torque": solved.torque / (8000.0 * np.pi) / torque - 1.0,
        },
    }


# ---------------------------------------------------------------------------------------------------------------------


def sphere_near_plane() -> Row:
    """Published values, not computed here."""
    rows = (
        (1.003202, 4.0223, 0.38494, 0.51326, 2.6793),
        (1.005004, 3.7863, 0.34187, 0.45582, 2.5056),
        (1.1276, 2.1514, 0.073718, 0.098291, 1.3877),
    )
    names = ("h_over_a", "translation_force", "translation_torque", "rotation_force", "rotation_torque")
    return {
        "meaning": "published, for R to infinity at a fixed gap; centre at h from the plane, motion along it. Force of "
        "translation over 6 pi mu a U and of rotation over 6 pi mu a^2 Omega, torque over 8 pi mu a^2 U and over "
        "8 pi mu a^3 Omega; magnitudes: a free sphere is turned, or driven, as if it rolled on the plane",
        "source": "O'Neill, Mathematika 11:67, 1964; Dean and O'Neill, Mathematika 10:13, 1963; tabulated by Goldman, "
        "Cox and Brenner, Chem. Eng. Sci. 22:637, 1967",
        "rows": [dict(zip(names, row, strict=True)) for row in rows],
    }


CASES: dict[str, Callable[[], Row]] = {
    "sphere_on_axis": sphere_on_axis,
    "eccentric_annulus": eccentric_annulus,
    "plane_cylinder": plane_cylinder,
    "capsule_on_axis": capsule_on_axis,
    "sphere_near_plane": sphere_near_plane,
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", choices=list(CASES), action="append")
    parser.add_argument("--write", action="store_true", help="write the values into tube_reference.json, case by case")
    options = parser.parse_args()
    path = HERE / "tube_reference.json"
    answer: dict[str, Any] = json.loads(path.read_text(encoding="utf-8")) if options.write and path.exists() else {}
    answer["question"] = (
        "Stokes flow of solids in a circular tube, by methods other than the model's (tube_reference.py)"
    )
    for name, run in CASES.items():
        if options.only and name not in options.only:
            continue
        answer[name] = run()
        if options.write:
            path.write_text(json.dumps(answer, indent=1) + "\n", encoding="utf-8")
    print(json.dumps(answer, indent=1))


if __name__ == "__main__":
    main()
