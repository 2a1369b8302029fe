"""How far are tables of the tube off, at random places that are no nodes?

Truth is the flow solved for, more finely than at the nodes, at three phases of the tail. Places are spread evenly in
the logarithm of the distance from the floor, between half of that of the first nodes and the tube's axis, and over all
pitches and phases of a table; two of three are yawed, over all yaws of their place. Below a gap of 0.2 mm the film that
a table adds is the better truth (`tests/fluid/test_film_and_rest_of_a_long_body.py`). Tails of several wavelengths
share the work at each place.

    OMP_NUM_THREADS=1 python benchmarks/tube_tables.py [--places 24] [--wavelength 25 20 ...] [--tolerance 0.004] ROBOT

It takes about half a minute of one core a place; what was solved is kept in the cache. Robots need tables
(`spirillum prepare`).
"""

from __future__ import annotations

import argparse
from typing import NamedTuple

import numpy as np

import spirillum as sp
from spirillum.fluid.tube.nodes import CHECKED_FROM, Places
from spirillum.fluid.tube.outer_resistance import NodeSolution, solutions
from spirillum.fluid.tube.solids import Fineness
from spirillum.fluid.tube.stages import RESPONSES, response_errors
from spirillum.fluid.tube.table import TubeTable
from spirillum.kernels.core import INSIDE
from spirillum.robot.tube_pose import TubePose

_PHASES = 3


class Drawn(NamedTuple):
    """A place and the phases of the tail there, rad."""

    pose: TubePose
    phases: tuple[float, ...]


def drawn(places: Places, count: int, seed: int) -> list[Drawn]:
    """Random places of a table at which the tail is off the glass."""
    draw = np.random.default_rng(seed)
    found: list[Drawn] = []
    while len(found) < count:
        t, f = float(np.exp(draw.uniform(np.log(0.5 * places.gaps[0]), 0.0))), float(draw.uniform(-1.0, 1.0))
        share = float(draw.uniform(-1.0, 1.0)) if len(found) % 3 else 0.0
        pose = places.pose_between(t, f, share * places.largest_yaw(t, f))
        first = float(draw.uniform(0.0, 2.0 * np.pi))
        clear = places.tail_clearance(pose) > places.least_clearance
        if clear and pose.clearance(places.geometry.body) > CHECKED_FROM * places.thinnest:
            found.append(
                Drawn(pose, tuple((first + 2.0 * np.pi * k / _PHASES) % (2.0 * np.pi) for k in range(_PHASES)))
            )
    return found


def errors_of(table: TubeTable, place: Drawn, true: np.ndarray) -> np.ndarray:
    """Errors of `RESPONSES` at every phase of a place, percent, (phases, 6); infinite outside the table."""
    found = []
    for phase, matrix in zip(place.phases, true, strict=True):
        own, left = table.at(place.pose.offset, place.pose.pitch, place.pose.yaw, phase)
        found.append(100.0 * response_errors(own, matrix, true) if left == INSIDE else np.full(len(RESPONSES), np.inf))
    return np.stack(found)


def summary(errors: np.ndarray, yawed: np.ndarray) -> str:
    """A table of the largest and the median error, without yaw and with it.

    Args:
        errors: percent, (places, phases, 6).
        yawed: of each place whether it is.
    """
    lines = ["| quantity | straight: largest, median, % | yawed: largest, median, % |", "| --- | ---: | ---: |"]
    for column, name in enumerate(RESPONSES):
        of_it = errors[..., column]
        cells = [f"{np.max(some):.2g}, {np.median(some):.2g}" for some in (of_it[~yawed], of_it[yawed])]
        lines.append(f"| {name.replace('_', ' ')} | {' | '.join(cells)} |")
    return "\n".join(lines)


def main() -> None:
    """Draw places, solve, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("robot", metavar="ROBOT")
    parser.add_argument("--places", type=int, default=24)
    parser.add_argument(
        "--wavelength", type=float, nargs="+", default=[], metavar="MM", help="of the tails, for its own"
    )
    parser.add_argument("--amplitude", type=float, default=None, metavar="MM", help="of all tails, for the robot's own")
    parser.add_argument("--tolerance", type=float, default=0.004, help="of waves and modes")
    parser.add_argument("--seed", type=int, default=11)
    parser.add_argument("--workers", type=int, default=2)
    asked = parser.parse_args()
    of_all = {} if asked.amplitude is None else {"tail.amplitude": f"{asked.amplitude:g} mm"}
    changes = [of_all | {"tail.wavelength": f"{length:g} mm"} for length in asked.wavelength] or [of_all]
    tables = [sp.prepare(sp.load(asked.robot, **change)).table for change in changes]
    chosen = drawn(Places(tables[0].geometry, tables[0].radius), asked.places, asked.seed)
    fineness = Fineness("standard", asked.tolerance)
    questions = [
        NodeSolution(tuple((table.geometry, place.phases) for table in tables), place.pose, fineness)
        for place in chosen
    ]
    answers = solutions(questions, "held out", _tell, asked.workers)
    yawed = np.array([place.pose.yaw != 0.0 for place in chosen])
    for number, (table, change) in enumerate(zip(tables, changes, strict=True)):
        errors = [errors_of(table, place, answer[number]) for place, answer in zip(chosen, answers, strict=True)]
        print(f"\n{asked.robot} {' '.join(change.values())}: {len(chosen)} places, {_PHASES} phases each\n")
        print(summary(np.stack(errors), yawed))


def _tell(_what: str, done: int, total: int) -> None:
    print(f"{done} of {total}", flush=True)


if __name__ == "__main__":
    main()
