"""Local resistance coefficients of a thin wire: force per arc length and velocity, along and across it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from spirillum.arrays import PerRobot
from spirillum.robot.batch import RobotBatch
from spirillum.robot.limits import Limit

__all__ = [
    "LocalCoefficients",
    "axis_height",
    "brennen_winet",
    "coefficient_domain",
    "gray_hancock",
    "lighthill",
    "local_coefficients",
    "printed",
]


class LocalCoefficients(NamedTuple):
    """Local resistance coefficients, N s/m^2."""

    tangential: PerRobot
    """c_t, along the wire."""
    normal: PerRobot
    """c_n = c_b, across the wire (near a floor: parallel to it)."""
    floor_normal: PerRobot | None = None
    """Across the wire and normal to the floor, where there is one."""


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
    """Height h of the tail's axis above the floor, m; unset: the body lies on the floor, h = D_b/2."""
    return np.where(np.isnan(batch.axis_height), 0.5 * batch.body_diameter, batch.axis_height)


def brennen_winet(batch: RobotBatch) -> LocalCoefficients:
    """Coefficients near a plane floor, a << h << L: log(2 h/a) in place of the wavelength's logarithm.

    Along the wire 2 pi mu/log(2h/a); across it, parallel to the floor 4 pi mu/log(2h/a) and normal to it
    4 pi mu/(log(2h/a) - 1) (Brennen and Winet, Annu. Rev. Fluid Mech. 9:339, 1977; Katz, Blake and
    Paveri-Fontana, J. Fluid Mech. 72:529, 1975). They are the thin limits of a cylinder's exact drag near
    a plane (Jeffrey and Onishi, Q. J. Mech. Appl. Math. 34:129, 1981). h is the axis's height for all of
    the wire.
    """
    log = np.log(4.0 * axis_height(batch) / batch.wire_diameter)
    mu = batch.viscosity
    return LocalCoefficients(2.0 * np.pi * mu / log, 4.0 * np.pi * mu / log, 4.0 * np.pi * mu / (log - 1.0))


_SETS = {
    "printed": printed,
    "gray-hancock": gray_hancock,
    "lighthill": lighthill,
    "brennen-winet": brennen_winet,
}


def local_coefficients(batch: RobotBatch) -> LocalCoefficients:
    """The set that `model.rft.coefficients` names, with its factors; meaningless outside `coefficient_domain`."""
    options = batch.options.rft
    with np.errstate(divide="ignore", invalid="ignore"):
        found = _SETS[options.coefficients](batch)
    floor = None if found.floor_normal is None else options.normal_factor * found.floor_normal
    return LocalCoefficients(options.tangential_factor * found.tangential, options.normal_factor * found.normal, floor)


def coefficient_domain(batch: RobotBatch) -> list[Limit]:
    """Where a set makes sense: 0 < c_t < c_n, else a wire would slip more easily across than along."""
    return _domain_of_the_set(batch) + _domain_of_the_factors(batch)


def _domain_of_the_factors(batch: RobotBatch) -> list[Limit]:
    """Fitted factors may not turn the order of both coefficients around."""
    options = batch.options.rft
    if options.normal_factor == 1.0 and options.tangential_factor == 1.0:
        return []
    c = local_coefficients(batch)
    across = c.normal if c.floor_normal is None else np.minimum(c.normal, c.floor_normal)
    why = "with these factors c_t exceeds c_n, which reverses the thrust"
    most = options.tangential_factor * across / c.tangential
    value = np.full(1, options.tangential_factor)
    return [Limit.of("model.rft.tangential_factor", value, "less than", most, "1", why, "factors-reverse-thrust")]


def _domain_of_the_set(batch: RobotBatch) -> list[Limit]:
    chosen = batch.options.rft.coefficients
    diameter = batch.wire_diameter
    if chosen == "brennen-winet":
        height = axis_height(batch)
        return [
            Limit.of(
                "model.rft.axis_height",
                height,
                "more than",
                batch.amplitude + 0.5 * diameter,
                "mm",
                "the wire may not touch the floor",
                "wire-touches-floor",
            ),
            Limit.of(
                "model.rft.axis_height",
                height,
                "more than",
                math.e * diameter / 4.0,
                "mm",
                "log(2 h/a) has to exceed 1",
                "wire-too-close-to-floor",
            ),
        ]
    least = {
        "printed": np.exp(1.5) * diameter,
        "gray-hancock": np.exp(1.5) / 4.0 * diameter,
        "lighthill": np.exp(0.5) / 0.36 * diameter * batch.arc_fraction,
    }[chosen]
    why = f"the '{chosen}' coefficients give c_t > c_n for a wire so thick (tail.wire_diameter), reversing the thrust"
    return [Limit.of("tail.wavelength", batch.wavelength, "more than", least, "mm", why, "wire-too-thick-for-rft")]
