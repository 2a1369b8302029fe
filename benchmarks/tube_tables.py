"""How far are tables of the tube off, at random places that are no nodes?

Truth is `tube` itself, solved at its default tolerance, at the same place and phase. Places are spread evenly in the
logarithm of the distance from the floor, between a gap and the tube's axis, and over all pitches and phases of a table;
a share of them has a yaw, up to twice that of the nodes, which makes them four to eight times as expensive. Gaps below
0.2 mm are left out: there the film that a table adds is the better truth
(`tests/fluid/test_film_and_rest_of_a_long_body.py`). Tails of several wavelengths share the work at each
place.

    OMP_NUM_THREADS=1 python benchmarks/tube_tables.py [--places 40] [--yawed 0.25] [--gap 0.2 1] [--tolerance 0.005]
        [--wavelength 25 ...] [--rows ROWS.jsonl] ROBOT...
    OMP_NUM_THREADS=1 python benchmarks/tube_tables.py --grid ROBOT...

The grid lies in the upper part of the tube; it takes two minutes of the processor for each robot. Places that stand in
ROWS are not solved again. Robots need tables (`spirillum prepare`).
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

import spirillum as sp
from spirillum.fluid.tube.places import Places
from spirillum.fluid.tube.responses import RESPONSES, response_errors
from spirillum.fluid.tube.rest import matrix_of
from spirillum.fluid.tube.solids import Fineness
from spirillum.fluid.tube.table import TubeTable
from spirillum.fluid.tube.tube import Tube, solved
from spirillum.kernels.tube_table import INSIDE, contact_offset
from spirillum.robot.batch import RobotBatch
from spirillum.robot.seat import Seat

Row = dict[str, Any]
_MOST_PITCH = 0.97  # of the largest
_MOST_YAW = 1.0  # of the largest of all places, if the tail leaves room
_GRID = (
    *((0.4, f, 0.0) for f in (0.45, -0.5)),
    *((0.66, f, 0.0) for f in (0.0, 0.45, 0.73, -0.45, -0.85)),
    *((0.9, f, 0.0) for f in (0.0, 0.45, -0.5)),
    *((1.0, f, 0.0) for f in (0.15, 0.45, 0.73, 0.93)),
    *((0.66, 0.3, 0.7), (0.9, -0.4, -0.7), (0.4, 0.3, -0.7), (1.0, 0.5, 0.5), (0.4, -0.4, 0.9)),
)
"""Distance from the floor over that of the axis, pitch and yaw over the largest ones."""
_GRID_PHASE, _GRID_TOLERANCE = 0.8, 0.005


def drawn(places: Places, count: int, yawed: float, gaps: Sequence[float], seed: int) -> list[tuple[Seat, float]]:
    """Seats and phases.

    Args:
        places: of the table.
        count: how many.
        yawed: share of them that has a yaw.
        gaps: smallest and largest, of a level robot, m; the largest may be left out for the tube's axis.
        seed: of the draw.
    """
    draw = np.random.default_rng(seed)
    room = contact_offset(places.rings, places.radius, 0.0)
    least, most = gaps[0] / room, min(gaps[1] / room, 1.0) if len(gaps) > 1 else 1.0
    found: list[tuple[Seat, float]] = []
    most_yaw = _MOST_YAW * float(places.most_yaw.max())
    while len(found) < count:
        t, f = float(np.exp(draw.uniform(np.log(least), np.log(most)))), float(draw.uniform(-_MOST_PITCH, _MOST_PITCH))
        yaw, phase = most_yaw * float(draw.uniform(-1.0, 1.0)), float(draw.uniform(0.0, 2.0 * np.pi))
        # evenly among them, so that the first few have both
        turned = int((len(found) + 1) * yawed) > int(len(found) * yawed)
        seat = places.seat_between(t, f, yaw if turned else 0.0)
        clear = places.tail_clearance(seat) > places.least_clearance
        if clear and seat.clearance(places.geometry.body) >= gaps[0]:
            found.append((seat, phase))
    return found


def row_at(table: TubeTable, places: Places, seat: Seat, phase: float, fineness: Fineness) -> Row:
    """Errors of a table at a place."""
    start = time.process_time()
    true = matrix_of(solved(table.geometry, seat, fineness, phase))
    matrix, left = table.at(seat.offset, seat.pitch, seat.yaw, phase)
    errors = response_errors(matrix, true)
    return {
        "gap": seat.clearance(places.geometry.body),
        "pitch": seat.pitch,
        "yaw": seat.yaw,
        "phase": phase,
        "inside": left == INSIDE,
        "errors": dict(zip(RESPONSES, errors.tolist(), strict=True)),
        "seconds": time.process_time() - start,
    }


def summary(rows: list[Row]) -> list[str]:
    """Lines of a table: worst and median error of each quantity."""
    lines = ["| quantity | largest, % | median, % |", "| --- | ---: | ---: |"]
    for name in RESPONSES:
        values = 100.0 * np.array([row["errors"][name] for row in rows])
        lines.append(f"| {name.replace('_', ' ')} | {values.max():.2g} | {np.median(values):.2g} |")
    return lines


def tails_of(name: str, wavelengths: Sequence[float]) -> list[tuple[str, TubeTable, RobotBatch]]:
    """A robot, and the same with tails of other wavelengths, mm: a word for the tail, its table, the batch."""
    found = []
    for change in ({}, *({"tail.wavelength": f"{length:g} mm"} for length in wavelengths)):
        robot = sp.load(name, **change)
        found.append((" ".join(["", *change.values()]), sp.prepare(robot).table, RobotBatch.of(robot)))
    return found


def main() -> None:
    """Draw places, solve, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("robots", nargs="+", metavar="ROBOT")
    parser.add_argument("--places", type=int, default=40, help="of each robot")
    parser.add_argument("--yawed", type=float, default=0.25, help="share of the places that has a yaw")
    parser.add_argument("--gap", type=float, nargs="+", default=[0.2], metavar="MM", help="smallest, and largest")
    parser.add_argument("--tolerance", type=float, default=None, help="of waves and modes; default: that of `tube`")
    parser.add_argument("--wavelength", type=float, nargs="+", default=[], metavar="MM", help="of tails beside the own")
    parser.add_argument("--grid", action="store_true", help="the grid instead of random places")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--rows", type=Path, default=None, help="file of rows, to be read and gone on with")
    arguments = parser.parse_args()
    known: dict[str, Row] = {}
    if arguments.rows is not None and arguments.rows.exists():
        known = {row["key"]: row for row in map(json.loads, arguments.rows.read_text().splitlines())}
    rows: dict[str, list[Row]] = {name: [] for name in arguments.robots}
    asked = []
    for name in arguments.robots:
        tails = tails_of(name, arguments.wavelength)
        places = Places(tails[0][1].geometry, tails[0][1].radius)
        if arguments.grid:
            seats = [(places.seat_between(t, f, yaw * places.largest_yaw(t, f)), _GRID_PHASE) for t, f, yaw in _GRID]
        else:
            gaps = [1e-3 * gap for gap in arguments.gap]
            seats = drawn(places, arguments.places, arguments.yawed, gaps, arguments.seed)
        asked.append([(name, number, tails, places, *seat) for number, seat in enumerate(seats)])
    tolerance = _GRID_TOLERANCE if arguments.grid else arguments.tolerance
    asked_for = "grid" if arguments.grid else f"{arguments.seed} {arguments.gap} {arguments.yawed} {tolerance}"
    for name, number, tails, places, seat, phase in (place for turn in zip(*asked, strict=True) for place in turn):
        for tail, table, batch in tails:
            key = f"{name}{tail} {asked_for} {number}"
            row = known.get(key)
            if row is None:
                fineness = Tube().fineness(batch.options) if tolerance is None else Fineness("standard", tolerance)
                row = {"key": key} | row_at(table, places, seat, phase, fineness)
                if arguments.rows is not None:
                    with arguments.rows.open("a") as file:
                        file.write(json.dumps(row) + "\n")
            rows[name].append(row)
            print(name, tail, number, json.dumps(row), flush=True)
    for name, some in rows.items():
        print(f"\n{name}: {len(some)} answers, {sum(row['yaw'] != 0 for row in some)} of them with a yaw\n")
        print("\n".join(summary(some)))


if __name__ == "__main__":
    main()
