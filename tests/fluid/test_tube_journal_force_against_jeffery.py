"""The sideways force on a turning body off the tube's axis, per length, against the closed form of long cylinders."""

import numpy as np
import pytest
from tests.support.long_cylinders import rotation_in_a_tube

from spirillum.fluid.tube.confined import solve_unit_motions
from spirillum.fluid.tube.solids import Fineness, Solids
from spirillum.robot.outline import body_outline
from spirillum.robot.tube_pose import TubePose


@pytest.mark.slow  # the cheap form, to 2 %, is that of eccentric annuli
def test_force_and_torque_per_length_of_the_papers_body() -> None:
    """Difference of two capsules in the wide tube at a gap of 1 mm; mm, viscosity 1.

    The capsule lies below the axis. Turning about +x, its lowest line moves to +y and the fluid pushes it there.
    """
    a, R, gap = 9.0, 20.0, 1.0

    def matrix(length: float) -> np.ndarray:
        outline = body_outline("capsule", 2 * a, length, 0.0, "hemisphere", "hemisphere")
        return solve_unit_motions(
            Solids([(outline, 0)], TubePose(R, R - a - gap, 0.0), Fineness(tolerance=1e-3)), []
        ).matrix

    short, long = 75.0, 95.0
    slope = (matrix(long) - matrix(short)) / (long - short)
    force, torque = rotation_in_a_tube(a, R, R - a - gap)
    assert -slope[1, 3] == pytest.approx(force, rel=3e-3)
    assert slope[3, 3] == pytest.approx(torque, rel=1e-3)
    assert slope[3, 1] == slope[1, 3]


def test_closed_form_is_sommerfelds_in_a_thin_annulus() -> None:
    """12 pi mu a (a/c)^2 E/((2 + E^2) sqrt(1 - E^2)) for a clearance c << a and the eccentricity E = e/c."""
    a, c = 1.0, 1e-3
    for eccentricity in (0.2, 0.7):
        thin = 12 * np.pi * a * (a / c) ** 2 * eccentricity
        thin /= (2 + eccentricity**2) * np.sqrt(1 - eccentricity**2)
        force, _ = rotation_in_a_tube(a, a + c, eccentricity * c)
        assert force == pytest.approx(thin, rel=5e-3)
