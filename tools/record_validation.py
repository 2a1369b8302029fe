"""Record the program's own values of validation cases, from which their rows may not leave.

    OMP_NUM_THREADS=1 python tools/record_validation.py [--runs] NAME...

Writes `recorded.json` beside each `case.toml`; read the difference before it is committed.
"""

import json
import sys
from pathlib import Path

from spirillum.papers.case import load_case
from spirillum.papers.case_values import values_at

PAPERS = Path(__file__).parent.parent / "src" / "spirillum" / "papers"


def main(names: list[str], *, runs: bool) -> None:
    """Compute and write the values of the named cases; those of runs stay as they are without `runs`."""
    for name in names:
        case, path = load_case(name), PAPERS / name / "recorded.json"
        before = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
        values: dict[str, dict[str, float]] = {}
        for point, quantity in case.rows():
            known = before.get(point.label, {}).get(quantity) if point.run and not runs else None
            value = known or values_at(case, point, [quantity])[quantity].value
            values.setdefault(point.label, {})[quantity] = float(f"{value:.5g}")
        path.write_text(json.dumps(values, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main([name for name in sys.argv[1:] if name != "--runs"], runs="--runs" in sys.argv)
