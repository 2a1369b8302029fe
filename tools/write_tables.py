"""Write the tables of stated errors into docs/accuracy.md.

    OMP_NUM_THREADS=1 python tools/write_tables.py

Each stands between `<!-- table: NAME -->` and `<!-- end of table -->`, and holds the rows that `NAME_rows` of
`benchmarks/stated_errors.py` computes.
"""

import re
import runpy
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parent.parent
PAGE = ROOT / "docs" / "accuracy.md"
TABLE = re.compile(r"(?<=<!-- table: )(\w+)( -->\n\n)(.*?)(?=\n<!-- end of table -->)", re.S)
_TITLES = {"B11": "drag B11", "B14": "thrust B14", "B44": "torque B44", "body_rate": "body rate"}


def row_functions() -> dict[str, Any]:
    """Functions that compute the rows, by the tables' names."""
    found = runpy.run_path(str(ROOT / "benchmarks" / "stated_errors.py"))
    return {name.removesuffix("_rows"): value for name, value in found.items() if name.endswith("_rows")}


def error(value: float) -> str:
    """A relative error as the page shows it: two digits, in percent if it is not tiny."""
    if abs(value) < 1e-6:
        text = f"{value:.0e}"
    else:
        text = f"{100 * value:+#.2g} %" if abs(value) < 0.0995 else f"{100 * value:+.0f} %"
    return text.replace("-", "−") if value < 0 else text


def cells(row: dict[str, str | float]) -> list[str]:
    """Cells of a row."""
    return [value if isinstance(value, str) else error(value) for value in row.values()]


def table(rows: list[dict[str, str | float]]) -> str:
    """Rows as a Markdown table; numbers to the right."""
    header = [_TITLES.get(name, name) for name in rows[0]]
    rule = ["---" if isinstance(value, str) else "---:" for value in rows[0].values()]
    return "".join(f"| {' | '.join(line)} |\n" for line in (header, rule, *map(cells, rows)))


def main() -> None:
    """Compute all tables anew and write them."""
    functions = row_functions()
    text = PAGE.read_text(encoding="utf-8")
    written = TABLE.sub(lambda found: f"{found[1]}{found[2]}{table(functions[found[1]]())}", text)
    PAGE.write_text(written, encoding="utf-8")


if __name__ == "__main__":
    main()
