"""Parquet holds the same observations as CSV, and a new file is empty until it is filled in."""

import math
from pathlib import Path
from typing import Any

import pytest

from spirillum import InputError
from spirillum.measurement.observations import COLUMNS, new_observations_file, observations_answer, read_observations

ROWS: list[dict[str, Any]] = [
    {"channel_diameter_mm": 40, "wavelength_mm": 25.0, "amplitude_mm": 2.5, "trial": 1, "tail_rate_Hz": 1.2},
    {"channel_diameter_mm": 40, "wavelength_mm": 25.0, "amplitude_mm": 2.5, "trial": 2, "tail_rate_Hz": 1.3},
]


def parquet(path: Path, rows: list[dict[str, Any]]) -> Path:
    import pyarrow as pa
    from pyarrow import parquet as files

    files.write_table(pa.Table.from_pylist(rows), path)
    return path


def test_parquet_gives_the_same_as_csv(tmp_path: Path) -> None:
    rows = [{**row, "body_rate_Hz": value} for row, value in zip(ROWS, (-0.1, None), strict=True)]
    found = read_observations(parquet(tmp_path / "o.parquet", rows))
    header = list(rows[0])
    lines = [",".join("" if row[name] is None else str(row[name]) for name in header) for row in rows]
    (tmp_path / "o.csv").write_text("\n".join([",".join(header), *lines]) + "\n")
    assert repr(found) == repr(read_observations(tmp_path / "o.csv"))
    assert math.isnan(found[1].body_rate)


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        ([{**ROWS[0], "amplitude_mm": -1.0}], "row 2, column amplitude_mm: '-1.0'"),
        ([{**ROWS[0], "tail_rate_Hz": float("inf")}], "row 2, column tail_rate_Hz: 'inf'"),
        ([{**ROWS[0], "robot": [1, 2]}], "column robot.list.element: a list"),
        ([ROWS[0], ROWS[0]], "rows 2 and 3 are both trial 1"),
        ([{"tail_rate_hz": 1.0}], "column 'tail_rate_hz' is unknown"),
    ],
)
def test_wrong_parquet_is_refused_with_row_and_column(tmp_path: Path, rows: list[dict[str, Any]], words: str) -> None:
    with pytest.raises(InputError, match="allowed") as caught:
        read_observations(parquet(tmp_path / "o.parquet", rows))
    assert words in str(caught.value)


def test_what_is_no_parquet_is_refused(tmp_path: Path) -> None:
    (tmp_path / "o.parquet").write_text("wavelength_mm\n")
    for name in ("o.parquet", "missing.parquet"):
        with pytest.raises(InputError, match=r"cannot be read|does not exist"):
            read_observations(tmp_path / name)


def test_a_template_has_every_column_and_no_row(tmp_path: Path) -> None:
    path = tmp_path / "new.csv"
    new_observations_file(path)
    text = path.read_text()
    assert text.splitlines()[-1] == ",".join(COLUMNS)
    with pytest.raises(InputError, match="holds no observations"):
        read_observations(path)
    with pytest.raises(InputError, match="exists"):
        new_observations_file(path)
    path.write_text(f"{text}a,40,25,2.5,1,1.0,1.2,-0.1,,,,,,\n")
    answer = observations_answer(path)
    assert (answer["rows"], answer["measured"]["tail_rate"], answer["measured"]["motor_rate"]) == (1, 1, 0)
