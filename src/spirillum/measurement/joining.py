"""Several observation files, one a robot, as one file for `calibrate`."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path

from spirillum.errors import InputError
from spirillum.files import MARK, atomic_write, guard_inputs, output_target
from spirillum.measurement.observations import COLUMNS, observation_table, read_observations

_TABLES = {".csv": "an observations file"}


def join_observations(files: Sequence[str | Path], output: str | Path) -> int:
    """Write the rows of several observation files to one, with all their comments.

    Returns:
        Number of rows.
    """
    paths = [Path(file) for file in files]
    if len(paths) < 2:
        raise InputError(f"{len(paths)} file of observations; allowed: two or more to join")
    with guard_inputs(*paths):
        target = output_target(output, _TABLES, "observations.csv")
    rows: list[dict[str, str]] = []
    comments: list[str] = []
    for path in paths:
        read_observations(path)
        table = observation_table(path)
        comments += [line for line in table.comments if line not in comments]
        rows += [dict(zip(row.header, row.cells, strict=True)) for row in table.rows()]
    names = dict.fromkeys([*COLUMNS, *(name for row in rows for name in row if name)])
    used = [name for name in names if any(row.get(name) for row in rows)]
    text = io.StringIO()
    writer = csv.DictWriter(text, used, restval="", extrasaction="ignore", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    with guard_inputs(*paths), atomic_write(target) as temporary:
        own = [] if any(MARK in line for line in comments) else [f"# joined, {MARK}"]
        temporary.write_text("".join(f"{line}\n" for line in (*comments, *own)) + text.getvalue(), encoding="utf-8")
        try:
            read_observations(temporary)
        except InputError as error:
            raise InputError(str(error).replace(str(temporary), "the joined file")) from error
    return len(rows)
