"""Film plus an extrapolated rest, per length of a long body, against the two-dimensional problem at small gaps.

This is how a table answers below its first nodes, down to the asperities. The values of the exact flow between
eccentric circles were computed for this package to six digits (force and torque: Jeffery 1922).
"""

import numpy as np
import pytest
from tests.support.long_cylinders import beside_a_plane, rotation_in_a_tube

from spirillum.fluid.tube.confined import solve_unit_motions
from spirillum.fluid.tube.film import film_resistance
from spirillum.fluid.tube.solids import Fineness, Solids
from spirillum.robot.outline import body_outline
from spirillum.robot.tube_pose import TubePose

A = 9.0
LENGTHS = (75.0, 95.0)


def per_length(resistance) -> np.ndarray:
    """Force of rotation over Omega a, R_t, R_n, and torque over 4 pi a^2 Omega, per length; viscosity 1, mm."""
    short, long = (
        resistance(body_outline("capsule", 2 * A, length, 0.0, "hemisphere", "hemisphere")) for length in LENGTHS
    )
    slope = (long - short) / (LENGTHS[1] - LENGTHS[0])
    return np.array([-slope[1, 3] / A, slope[1, 1], slope[2, 2], slope[3, 3] / (4 * np.pi * A**2)])


def film(tube: float, gap: float) -> np.ndarray:
    return per_length(lambda body: film_resistance(body, tube, tube - A - gap, 0.0, 0.0))


def rest(tube: float, gap: float, tolerance: float) -> np.ndarray:
    pose = TubePose(tube, tube - A - gap, 0.0)
    whole = per_length(
        lambda body: solve_unit_motions(Solids([(body, 0)], pose, Fineness(tolerance=tolerance)), []).matrix
    )
    return whole - film(tube, gap)


def film_and_rest(tube: float, gap: float, nodes: tuple[float, ...], tolerance: float) -> np.ndarray:
    """At a gap, with the rest as the polynomial through its values at the nodes."""
    found = np.linalg.solve(np.vander(nodes), np.array([rest(tube, node, tolerance) for node in nodes]))
    return film(tube, gap) + np.vander([gap], len(nodes))[0] @ found


@pytest.mark.slow
def test_narrow_tube_far_below_the_nodes() -> None:
    found = film_and_rest(15.0, 0.2, (0.8, 1.5, 2.88), 3e-3)
    assert found == pytest.approx([140.99, 826.51, 16460.0, 7.5116], rel=0.01)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("tube", "gap", "exact"),
    [
        (20.0, 2.0, (20.22, 120.07, 402.05, 2.1788)),
        (20.0, 0.5, (41.49, 211.16, 2664.1, 4.1272)),
        (15.0, 1.0, (61.46, 417.91, 1690.3, 3.3732)),
        (15.0, 0.2, (140.99, 826.51, 16460.0, 7.5116)),
    ],
)
def test_nodes_of_a_table(tube: float, gap: float, exact: tuple[float, ...]) -> None:
    """The first node of a table lies at 0.08 radii."""
    assert film_and_rest(tube, gap, (0.72, 1.44, 2.88), 1e-3) == pytest.approx(exact, rel=0.01)


MICROMETRES = (290.0, 100.0, 20.0, 5.0, 1.0, 0.5)


def extrapolated(exact, films, gap: float) -> np.ndarray:
    """At a gap, with the rest of closed forms as the polynomial through its values at a table's first nodes."""
    nodes = (0.72, 1.44, 2.88)
    rests = np.array([exact(node) - films(node) for node in nodes])
    return films(gap) + np.vander([gap], len(nodes))[0] @ np.linalg.solve(np.vander(nodes), rests)


@pytest.mark.parametrize("gap", MICROMETRES)
@pytest.mark.parametrize("tube", [20.0, 15.0, 12.0])
def test_a_turning_body_down_to_its_asperities(tube: float, gap: float) -> None:
    """Jeffery's force and torque of rotation; the first two tubes are the paper's."""

    def exact(h: float) -> np.ndarray:
        force, torque = rotation_in_a_tube(A, tube, tube - A - h)
        return np.array([force / A, torque / (4 * np.pi * A**2)])

    found = extrapolated(exact, lambda h: film(tube, h)[[0, 3]], 1e-3 * gap)
    np.testing.assert_allclose(found, exact(1e-3 * gap), rtol=0.01)


@pytest.mark.parametrize("gap", MICROMETRES)
def test_a_body_beside_a_plane_down_to_its_asperities(gap: float) -> None:
    """Sliding along itself and across, approach, rotation: Jeffrey's and Onishi's closed forms."""
    tube = 1e5

    def films(h: float) -> np.ndarray:
        short, long = (
            film_resistance(body_outline("capsule", 2 * A, length, 0.0, "flat", "flat"), tube, tube - A - h, 0.0, 0.0)
            for length in LENGTHS
        )
        return np.diag(long - short)[:4] / (LENGTHS[1] - LENGTHS[0]) / (1.0, 1.0, 1.0, A**2)

    found = extrapolated(lambda h: beside_a_plane(A, h), films, 1e-3 * gap)
    np.testing.assert_allclose(found, beside_a_plane(A, 1e-3 * gap), rtol=0.011)
