"""Record the program's own values of validation cases, from which their rows may not leave.

    OMP_NUM_THREADS=1 python tools/record_validation.py [--runs] NAME...

Writes `recorded.json` beside each `case.toml`; read the difference before it is committed. With `--runs` also the
tables of robots that are released, in `tables` beside it: those that are there stay, so delete what is to be made anew.
"""

import json
import sys
from pathlib import Path

import spirillum as sp
from spirillum.papers.case import Case, load_case, robot_of, values_at

PAPERS = Path(__file__).parent.parent / "src" / "spirillum" / "papers"


def main(names: list[str], *, runs: bool) -> None:
    """Compute and write the values of the named cases; those of runs stay as they are without `runs`."""
    for name in names:
        case, path = load_case(name), PAPERS / name / "recorded.json"
        if runs:
            ship_tables(case, PAPERS / name / "tables")
        before = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
        wanted: dict[str, list[str]] = {}
        for point, quantity in case.rows():
            wanted.setdefault(point.label, []).append(quantity)
        values: dict[str, dict[str, float]] = {}
        for label, quantities in wanted.items():
            point = case.point(label)
            if point.run and not runs:
                values[label] = before[label]
                continue
            found = values_at(case, point, quantities)
            values[label] = {name: float(f"{one.value:.5g}") for name, one in found.items()}
        path.write_text(json.dumps(values, indent=1) + "\n", encoding="utf-8")


def ship_tables(case: Case, folder: Path) -> None:
    """Make the tables of a case's released robots and write them into the package."""
    for point in case.points:
        if point.run:
            folder.mkdir(exist_ok=True)
            table = sp.prepare(robot_of(case, point), workers=2).table
            table.write(folder / f"{table.key}.table")


if __name__ == "__main__":
    main([name for name in sys.argv[1:] if name != "--runs"], runs="--runs" in sys.argv)
