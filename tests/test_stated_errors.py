"""The tables of docs/accuracy.md are what benchmarks/stated_errors.py computes."""

import runpy
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parent.parent
TOOL: dict[str, Any] = runpy.run_path(str(ROOT / "tools" / "write_tables.py"))
FUNCTIONS = TOOL["row_functions"]()
PAGE = {name: rows for name, _, rows in TOOL["TABLE"].findall((ROOT / "docs" / "accuracy.md").read_text("utf-8"))}
SLOW = "torus"  # thousands of stations: half a minute


def _cells(line: str) -> list[str]:
    return [cell.strip() for cell in line.strip().strip("|").split("|")]


def _rounding_only(cell: str) -> bool:
    """Errors of bodies with an exact answer, below 1e-8, are rounding: their digits differ between machines."""
    return "e-" in cell and abs(float(cell)) < 1e-8


def test_page_has_every_table() -> None:
    assert list(PAGE) == list(FUNCTIONS)


@pytest.mark.parametrize("name", [pytest.param(name, marks=[pytest.mark.slow] * (name == SLOW)) for name in FUNCTIONS])
def test_table_shows_what_is_computed(name: str) -> None:
    shown = [_cells(line) for line in PAGE[name].splitlines()[2:]]
    found = [TOOL["cells"](row) for row in FUNCTIONS[name]()]
    assert len(shown) == len(found)
    for before, now in zip(shown, found, strict=True):
        different = [(a, b) for a, b in zip(before, now, strict=True) if a != b]
        assert all(_rounding_only(a) and _rounding_only(b) for a, b in different), (
            f"{before} is now {now}; if that is meant: python tools/write_tables.py"
        )
