"""Films of micrometres under a short cylinder in a tube: against finite elements for Reynolds' equation.

Poses are those of runs of the paper's robot after waiting: level, pitched, and yawed, when it stands on its ends.
"""

import numpy as np
import pytest
from scipy.optimize import brentq
from tests.support.reynolds import ShortCylinder

from spirillum.fluid.tube.film import film_resistance
from spirillum.kernels.core import lift_of_cavitation
from spirillum.robot.outline import body_outline

BODY, TUBE, LENGTH = 9e-3, 20e-3, 17e-3
OIL = 3.5
OUTLINE = body_outline("capsule", 2.0 * BODY, LENGTH, 0.0, "flat", "flat")
Y, Z, ROLL, PITCH, YAW = 1, 2, 3, 4, 5


def offset_at(gap: float, pitch: float, yaw: float) -> float:
    """e at which the nearer end has a gap, m."""
    ends = 0.5 * LENGTH * np.array([-1.0, 1.0])
    return brentq(lambda e: float((TUBE - BODY - np.hypot(e - ends * pitch, ends * yaw)).min()) - gap, 5e-3, 12e-3)


def cylinder(gap: float, pitch: float, yaw: float, cells: tuple[int, int] = (90, 180)) -> ShortCylinder:
    return ShortCylinder(BODY, LENGTH, TUBE, offset_at(gap, pitch, yaw), pitch, yaw, cells)


@pytest.mark.parametrize(
    ("gap", "pitch", "yaw", "entries", "most"),
    [
        (1e-6, 0.0, 0.0, [(Z, Z), (PITCH, PITCH)], 0.002),
        (20e-6, 0.0, 0.0, [(Z, Z), (PITCH, PITCH)], 0.04),
        (0.5e-6, 0.0, 0.6, [(Z, Z), (PITCH, PITCH), (Z, YAW)], 0.005),
        (1e-6, 0.1, 0.0, [(Z, Z), (PITCH, PITCH), (Z, PITCH)], 0.015),
        (1e-6, 0.02, 0.3, [(Z, Z), (PITCH, PITCH), (Z, YAW), (Z, PITCH), (Z, Y)], 0.005),
    ],
)
def test_squeezed_films(gap: float, pitch: float, yaw: float, entries: list[tuple[int, int]], most: float) -> None:
    """A yaw of a cylinder that stands on its ends opens the middle, (Z, YAW): the film holds it down."""
    pose = (np.radians(pitch), np.radians(yaw))
    film, found = film_resistance(OUTLINE, TUBE, offset_at(gap, *pose), *pose), cylinder(gap, *pose)
    for motion, force in entries:
        assert found.solve({motion: 1.0}, 1.0)[0][force] == pytest.approx(-film[motion, force], rel=most)


@pytest.mark.parametrize(("pitch", "yaw", "most"), [(0.0, 0.0, 0.03), (0.0, 0.6, 0.03)])
def test_sliding_films(pitch: float, yaw: float, most: float) -> None:
    """The part that grows as the film thins: beyond it the film fades out, which is a matter of definition."""
    pose, films, found = (np.radians(pitch), np.radians(yaw)), [], []
    for gap in (0.5e-6, 20e-6):
        films.append(-film_resistance(OUTLINE, TUBE, offset_at(gap, *pose), *pose))
        numbers = cylinder(gap, *pose)
        rows = ({motion: 1.0} for motion in range(6))
        found.append(np.array([numbers.solve(row, 1.0)[0] + numbers.shear(row, 1.0) for row in rows]))
    for motion in (0, Y, ROLL, YAW):
        assert found[0][motion, motion] - found[1][motion, motion] == pytest.approx(
            films[0][motion, motion] - films[1][motion, motion], rel=most
        )


@pytest.mark.parametrize(
    ("gap", "pitch", "yaw", "turning", "bound", "most"),
    [
        (2e-6, 0.0, 0.0, 0.06, 1e4, 0.03),
        (1e-6, 0.0, 0.6, 0.02, 1e4, 0.03),
        (1e-6, 0.0, 2.5, 0.06, 1e4, 0.06),
        (1e-6, 0.1, 0.0, 0.06, 1e4, 0.07),
        (1e-6, 0.02, 0.0, 0.06, 1e5, 0.06),
    ],
)
def test_lift_of_a_rotating_cylinder(
    gap: float, pitch: float, yaw: float, turning: float, bound: float, most: float
) -> None:
    """Slices with less pressure near both ends, as csrc/slices.c has them."""
    pose = (np.radians(pitch), np.radians(yaw))
    found = cylinder(gap, *pose)
    linear, lifted = (found.solve({ROLL: turning}, OIL, p)[0][Z] for p in (np.inf, bound))
    x = np.linspace(-0.5, 0.5, 401) * LENGTH
    h = TUBE - BODY - np.hypot(offset_at(gap, *pose) - x * pose[0], x * pose[1])
    bend = BODY * TUBE / (TUBE - BODY)
    width = np.sqrt(2.0 * bend * h)
    steep = np.maximum(-np.sign(x) * np.gradient(h, x) * width / h, 0.0)
    from_end = (0.5 * LENGTH - np.abs(x)) / width / (1.0 + 0.26 * steep)
    sliced, out = np.empty(x.size), np.empty((1, 6))
    for n, share in enumerate(1.0 - np.exp(-1.85 * from_end)):
        numbers = (np.array([number]) for number in (h[n], bend, 0.0, 0.5 * BODY * turning))
        lift_of_cavitation(*numbers, share * OIL + 1e-12, bound, out)
        sliced[n] = out[0, 0]
    assert abs(linear) < 1e-6 * lifted
    assert float(np.trapezoid(sliced, x)) == pytest.approx(lifted, rel=most)


def test_the_grid_is_converged() -> None:
    coarse, fine = (cylinder(1e-6, 0.0, 0.0, cells) for cells in ((60, 60), (90, 90)))
    lifts = [numbers.solve({ROLL: 0.06}, OIL, 1e4)[0][Z] for numbers in (coarse, fine)]
    assert lifts[0] == pytest.approx(lifts[1], rel=0.01)
