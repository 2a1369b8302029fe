"""The program beside published experiments and computations, computed and written: `spirillum.validate`."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from spirillum.files import check_replaceable, results_folder, write_text
from spirillum.formats.templates import rendered
from spirillum.papers.case import case_names, load_case
from spirillum.papers.validation import CaseResult, Validation, compute_case
from spirillum.papers.validation_figure import case_picture
from spirillum.progress import Progress
from spirillum.results.page import draw_pictures

_RESULTS = ("validation.json", "figures", "report.html")
"""What a folder without the mark of a validation may not hold, for it would be replaced."""


def validate(
    names: Sequence[str] = (),
    *,
    runs: bool = False,
    output: str | Path | None = None,
    progress: Progress | None = None,
) -> Validation:
    """Compute published experiments and computations of other groups, with nothing fitted.

    Args:
        names: cases that ship, such as `rodenborn2013`; none: all of them, in some minutes.
        runs: also run robots, released in their tubes, whose table has to be made first (up to an hour; what is solved
            for is kept, so that an interrupted one goes on); else their rows are the recorded ones, and say so.
        output: folder for `validation.json`, `figures/` and `report.html`; None: nothing is written.
        progress: called with the name of a case, how much of it is done, and of how much.

    Returns:
        The cases with a row for each published number: published, ours, difference, the error that the program states,
        what each assumption makes of ours, and whether all of this covers the published value; and a verdict for
        each published statement.

    Raises:
        InputError: for an unknown case, or a folder that holds something else.
    """
    chosen = tuple(dict.fromkeys(names)) or case_names()
    for name in chosen:
        load_case(name)
    if output is None:
        return Validation(tuple(compute_case(name, progress, runs=runs) for name in chosen))
    mark = {"schema": "spirillum.validation-folder/1"}
    claim = {"mark": "validated.json", "content": mark, "what": "validation", "results": _RESULTS}
    with results_folder(output, claim=claim) as folder:
        for result in ("validation.json", "report.html"):
            check_replaceable(folder / result)
        found = Validation(tuple(compute_case(name, progress, runs=runs) for name in chosen), str(output))
        pictures = {case.name: case_picture(case) for case in found.cases if case.rows}
        embedded = {one.name: one for one in draw_pictures(pictures, folder, lambda _name, _done: None, vector=True)}
        text = json.dumps(replace(found, folder=None).to_dict(), indent=2, allow_nan=False, ensure_ascii=False)
        write_text(folder / "validation.json", text + "\n")
        cases = [(case, embedded.get(case.name), table_of(case)) for case in found.cases]
        text = rendered(
            "results/validation.html.jinja", escaped=True, cases=cases, header=HEADER, left=len(found.outside)
        )
        write_text(folder / "report.html", text)
    return found


HEADER = ("Row", "Quantity", "Published", "Ours", "Difference", "Stated error", "Ours under assumptions", "Covered by")
"""Columns of `table_of`."""


def table_of(case: CaseResult) -> list[tuple[str, ...]]:
    """Return the rows of a case as texts, in the unit of the publication; see `HEADER`."""
    found: list[tuple[str, ...]] = []
    for row in case.rows:
        unit = "" if row.quantity.unit == "1" else f" {row.quantity.unit}"
        spread = "" if row.uncertainty is None else f" ± {row.uncertainty:.3g}"
        published = "a trend" if row.published is None else f"{row.published:.4g}{spread}{unit}"
        low, high = row.ends
        ours = f"{row.ours:.4g}{unit}{'' if row.computed else ' (recorded)'}"
        cells = (
            "" if row.difference is None else _percent(row.difference),
            "" if row.stated_error is None else f"{100.0 * row.stated_error:.1f} %",
            f"{low:.3g} to {high:.3g}" if row.effects else "",
            row.covered_by or "",
        )
        found.append((row.point, row.quantity.label, published, ours, *cells))
    return found


def _percent(share: float) -> str:
    return f"{100.0 * share:+.{0 if abs(share) >= 0.0995 else 1}f} %".replace("-", "−")
