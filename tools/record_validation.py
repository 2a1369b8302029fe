"""Record the program's own values of validation cases, from which their rows may not leave.

    OMP_NUM_THREADS=1 python tools/record_validation.py NAME...

Writes `recorded.json` beside each `case.toml`; read the difference before it is committed.
"""

import json
import sys
from pathlib import Path

from spirillum.papers.case import load_case
from spirillum.papers.case_values import values_at

PAPERS = Path(__file__).parent.parent / "src" / "spirillum" / "papers"


def main(names: list[str]) -> None:
    """Compute and write the values of the named cases."""
    for name in names:
        case, values = load_case(name), {}
        for point, quantity in case.rows():
            value = values_at(case, point, [quantity])[quantity].value
            values.setdefault(point.label, {})[quantity] = float(f"{value:.5g}")
        (PAPERS / name / "recorded.json").write_text(json.dumps(values, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
