"""Make the tables of the paper's robots anew and put them into the package.

Robots of one channel and amplitude share all places: some 25 to 30 min of one core for four tails. What
was solved for is kept in the cache, as for `spirillum prepare`, until the solver's source changes.

    OMP_NUM_THREADS=1 python tools/ship_tables.py [--channel wide] [--amplitude 2.5] [--wavelength 25]
"""

from __future__ import annotations

import argparse
from pathlib import Path

import spirillum
from spirillum.fluid.tube.building import built_tables
from spirillum.fluid.tube.domain import in_tube
from spirillum.fluid.wire.robot_geometry import RobotGeometry
from spirillum.papers.biorob2012.published import paper_study
from spirillum.robot.batch import RobotBatch
from spirillum.studies.study_loader import load_study

_FOLDER = Path(spirillum.__file__).parent / "fluid" / "tube" / "tables"


def main() -> None:
    """Solve, write, tell the errors."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--channel", choices=("wide", "narrow"), default=None, help="one channel only")
    parser.add_argument("--amplitude", type=float, default=None, help="one amplitude only, mm")
    parser.add_argument("--wavelength", type=float, nargs="+", default=None, help="these wavelengths only, mm")
    parser.add_argument("--workers", type=int, default=2)
    arguments = parser.parse_args()
    study = load_study(paper_study())
    groups: dict[tuple[str, float], list[tuple[RobotGeometry, float]]] = {}
    for index in range(study.count):
        robot = study.robot_at(index)
        if arguments.wavelength and round(1e3 * robot.tail.wavelength, 6) not in arguments.wavelength:
            continue
        batch = RobotBatch.of(robot)
        group = robot.name.removeprefix("biorob2012-"), round(1e3 * robot.tail.amplitude, 6)
        groups.setdefault(group, []).append(in_tube(batch))
    for (channel, amplitude), robots in groups.items():
        if arguments.channel not in (None, channel) or arguments.amplitude not in (None, amplitude):
            continue
        for table in built_tables(robots, workers=arguments.workers, progress=_tell):
            table.write(_FOLDER / f"{table.key}.table", f"{channel}.film")
            errors = ", ".join(f"{name.replace('_', ' ')} {100.0 * value:.2g} %" for name, value in table.error.items())
            print(f"{channel}, {1e3 * table.geometry.wavelength:g} x {amplitude:g} mm: {errors}")


def _tell(what: str, done: int, total: int) -> None:
    print(f"{what}: {done} of {total}", flush=True)


if __name__ == "__main__":
    main()
