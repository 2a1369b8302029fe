"""SBT's axial block against Lighthill's theorem, integrated numerically on long thin helices.

Lighthill (SIAM Rev. 18:161, 1976): a wire with force f per arc length moves at

    u(s0) = f_n/(4 pi mu) + int_{|s - s0| > delta} G(s0, s) f(s) ds,   delta = a sqrt(e)/2,

where f_n is the part of f across the wire and G the Oseen tensor. On a helix with phase theta = k s the local frames
(e_x, e_theta) make G a function of the phase difference tau alone, even in it. For uniform (f_x, f_theta) the average
along a wire of total phase T therefore is one integral, int_eps^T (1 - tau/T) K(tau) dtau/(4 pi mu), in which K is
8 pi mu/k times G between these frames. None of the integrals A1, A2, A3 is used here.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from spirillum.fluid.closed.sbt import tail_axial

WAVELENGTH, WIRE, VISCOSITY = 20e-3, 5e-6, 3.5  # a wire so thin that terms of order eps^2 are below 1e-6
TURNS = (32, 64, 128)

PITCH_ANGLES = [15.0, 32.0, 55.0, 75.0]


def averaged_kernel(alpha: float, eps: float, turns: int) -> np.ndarray:
    """4 pi mu times the average velocity (u_x, u_theta) per uniform force (f_x, f_theta), 2x2."""
    beta = np.sqrt(1 - alpha**2)
    end = 2 * np.pi * turns
    edges = np.concatenate([np.geomspace(eps, 1, 40), np.linspace(1, end, 12 * turns)[1:]])
    nodes, weights = np.polynomial.legendre.leggauss(12)
    half = np.diff(edges)[:, None] / 2
    tau = edges[:-1, None] + half * (1 + nodes)
    measure = half * weights * (1 - tau / end)
    # From the point with phase tau to the one with phase 0, in units of 1/k.
    d = np.stack([-alpha * tau, beta * (1 - np.cos(tau)), -beta * np.sin(tau)])
    zero, one = np.zeros_like(tau), np.ones_like(tau)
    here = [np.stack([one, zero, zero]), np.stack([zero, zero, one])]
    there = [np.stack([one, zero, zero]), np.stack([zero, -np.sin(tau), np.cos(tau)])]
    r = np.sqrt((d**2).sum(axis=0))

    def entry(i: int, j: int) -> float:
        oseen = (here[i] * there[j]).sum(axis=0) / r + (here[i] * d).sum(axis=0) * (there[j] * d).sum(axis=0) / r**3
        return float((measure * oseen).sum())

    tangent = np.array([alpha, beta])
    near = np.eye(2) - np.outer(tangent, tangent)
    return near + np.array([[entry(i, j) for j in range(2)] for i in range(2)])


def mobility_of_the_block(batch: Any) -> np.ndarray:
    """The same 2x2 from the project's (B11, B14, B44)."""
    b11, b14, b44 = (float(entry[0]) for entry in tail_axial(batch))
    scale = np.diag([1.0, float(batch.amplitude[0])])
    block = np.array([[b11, b14], [b14, b44]])
    # Force per arc length is -B V/(l, l b) with V = (U, omega), velocity (u_x, u_theta) = (U, b omega).
    return 4 * np.pi * VISCOSITY * float(batch.arc_length[0]) * scale @ np.linalg.inv(block) @ scale


def extrapolated(values: list[np.ndarray]) -> np.ndarray:
    """Limit of a series in the reciprocal number of turns, from three numbers of turns that double."""
    first, second, third = values
    once = [2 * second - first, 2 * third - second]
    return (4 * once[1] - once[0]) / 3


@pytest.fixture(scope="module", params=PITCH_ANGLES, ids=lambda angle: f"{angle:g}deg")
def pairs(request: pytest.FixtureRequest, batch_of: Callable[..., Any]) -> list[tuple[np.ndarray, np.ndarray]]:
    """(numerical, project's) mobilities for each number of turns."""
    angle = np.deg2rad(request.param)
    alpha = np.cos(angle)
    amplitude = float(WAVELENGTH * np.tan(angle) / (2 * np.pi))
    eps = 2 * np.pi * alpha / WAVELENGTH * (WIRE / 2) * np.sqrt(np.e) / 2
    found = []
    for turns in TURNS:
        batch = batch_of(
            channel="none",
            tail__wavelength=f"{WAVELENGTH!r} m",
            tail__amplitude=f"{amplitude!r} m",
            tail__length=f"{turns * WAVELENGTH!r} m",
            tail__wire_diameter=f"{WIRE!r} m",
            tail__handedness="right",
            model__sbt__eps_constant="exact",
        )
        found.append((averaged_kernel(alpha, eps, turns), mobility_of_the_block(batch)))
    return found


def test_block_is_the_long_helix_limit_of_the_theorem(pairs: list[tuple[np.ndarray, np.ndarray]]) -> None:
    difference = extrapolated([numerical - block for numerical, block in pairs])
    scale = np.sqrt(np.outer(np.diag(pairs[-1][1]), np.diag(pairs[-1][1])))
    np.testing.assert_array_less(np.abs(difference) / scale, 1e-5)
    # The coupling is small against the diagonal for steep and flat coils: it has to be right in itself.
    assert difference[0, 1] == pytest.approx(0.0, abs=1e-4 * abs(pairs[-1][1][0, 1]))


def test_end_effects_decay_as_one_over_the_number_of_turns(pairs: list[tuple[np.ndarray, np.ndarray]]) -> None:
    errors = [np.linalg.norm(numerical - block) for numerical, block in pairs]
    rates = np.log2(np.array(errors[:-1]) / errors[1:])
    np.testing.assert_allclose(rates, 1.0, atol=0.05)
