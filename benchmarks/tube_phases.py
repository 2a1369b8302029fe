"""How many phases of the tail does a node of a table need?

The flow is solved for at fifteen phases of tails of several wavelengths, at one place. From fewer phases, evenly spread
over the Fourier sum that all of them give, the resistance is found back as a table does it: printed are the largest
errors over a turn, in percent of what `spirillum.fluid.tube.stages` says.

    OMP_NUM_THREADS=1 python benchmarks/tube_phases.py [--t 0.065] [--f -0.5] [--yaw 0.95] [--wavelength 25 ...] ROBOT

The place is given as in `spirillum.fluid.tube.nodes`: the way from floor to axis, the share of the largest pitch, and
that of the largest yaw there. It takes a minute of the processor.
"""

from __future__ import annotations

import argparse

import numpy as np

import spirillum as sp
from spirillum.arrays import Samples
from spirillum.fluid.tube.domain import in_tube
from spirillum.fluid.tube.film import FilmTable
from spirillum.fluid.tube.nodes import LARGEST_YAW, STEEPEST, Places
from spirillum.fluid.tube.outer_resistance import (
    NodeSolution,
    even_phases,
    factor_of,
    fourier,
    matrices_at,
    outer_coefficients,
    solutions,
)
from spirillum.fluid.tube.solids import Fineness
from spirillum.fluid.tube.stages import RESPONSES, response_errors
from spirillum.fluid.wire.robot_geometry import RobotGeometry
from spirillum.kernels.core import cut_of_film, film_at
from spirillum.robot.batch import RobotBatch

_TRUE = 15
_COUNTS = (3, 5, 7, 9, 11)
_ASKED = np.linspace(0.0, 2.0 * np.pi, 60, endpoint=False)
_FINENESS = Fineness("standard", 0.01)  # of the nodes of tables


def largest_errors(true: Samples, film: Samples, count: int) -> Samples:
    """Largest errors over a turn of what `count` phases give.

    Args:
        true: Fourier coefficients of the rest's factor, (coefficients, 36).
        film: what is taken away and added, (6, 6).
        count: odd number of phases.
    """

    def whole(coefficients: Samples, phases: Samples) -> Samples:
        found = matrices_at(coefficients, phases)
        found[:, :6, :6] += film
        return found

    phases = np.array(even_phases(count))
    fewer = fourier(factor_of(matrices_at(true, phases), "at the place"))
    pairs = zip(whole(fewer, _ASKED), whole(true, _ASKED), strict=True)
    worst: Samples = np.max([response_errors(found, expected) for found, expected in pairs], axis=0)
    return worst


def main() -> None:
    """Solve, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("robot", metavar="ROBOT")
    parser.add_argument("--t", type=float, default=0.065, help="way from the floor to the axis")
    parser.add_argument("--f", type=float, default=-0.5, help="share of the largest pitch, negative nose down")
    parser.add_argument("--yaw", type=float, default=0.95, help="share of the largest yaw")
    parser.add_argument("--wavelength", type=float, nargs="+", default=[25.0, 20.0, 15.0, 10.0], metavar="MM")
    arguments = parser.parse_args()
    batches = [
        RobotBatch.of(sp.load(arguments.robot, **{"tail.wavelength": f"{length:g} mm"}))
        for length in arguments.wavelength
    ]
    places = Places(*in_tube(batches[0]))
    yaw = arguments.yaw * places.largest_yaw(arguments.t, arguments.f)
    pose = places.pose_between(arguments.t, arguments.f, yaw)
    film = np.empty((6, 6))
    table = FilmTable.of(places.geometry.body, places.radius, yaw=1.1 * LARGEST_YAW, pitch=1.1 * max(STEEPEST))
    film_at(table.packed, pose.offset, pose.pitch, pose.yaw, film)
    tails = tuple((RobotGeometry.of(batch), even_phases(_TRUE)) for batch in batches)
    (solved,) = solutions([NodeSolution(tails, pose, _FINENESS)], "phases", workers=1)
    print(f"pitch {np.degrees(pose.pitch):.2f} deg, yaw {np.degrees(yaw):.2f} deg")
    print("\n".join(["| wavelength, phases | " + " | ".join(RESPONSES) + " |", "| --- |" + " ---: |" * len(RESPONSES)]))
    for (geometry, _), matrices in zip(tails, solved, strict=True):
        true = outer_coefficients(matrices, film, arguments.t, pose)
        for count in _COUNTS:
            errors = largest_errors(true, cut_of_film(arguments.t) * film, count)
            words = " | ".join(f"{100.0 * error:.2g}" for error in errors)
            print(f"| {1e3 * geometry.wavelength:g} mm, {count} | {words} |")


if __name__ == "__main__":
    main()
