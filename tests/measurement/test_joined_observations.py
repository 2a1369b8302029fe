"""Several observation files become one that says the same."""

from pathlib import Path

import pytest

from spirillum.errors import InputError
from spirillum.measurement.observations import join_observations, read_observations

HEADER = "channel_diameter_mm,wavelength_mm,amplitude_mm,trial,forward_velocity_mm_s,tail_rate_Hz"


def made(path: Path, wavelength: float, comment: str, header: str = HEADER) -> Path:
    rows = "".join(f"40,{wavelength},2.5,{trial},{1 + 0.01 * trial},1.2\n" for trial in (1, 2))
    path.write_text(f"# {comment}\n{header}\n{rows}", encoding="utf-8")
    return path


def test_rows_and_comments_are_those_of_all_files(tmp_path: Path) -> None:
    files = [made(tmp_path / "a.csv", 15, "SYNTHETIC: a"), made(tmp_path / "b.csv", 25, "b")]
    target = tmp_path / "all.csv"
    assert join_observations(files, target) == 4
    read = [(item.wavelength, item.trial, item.forward_velocity) for item in read_observations(target)]
    assert read == [(i.wavelength, i.trial, i.forward_velocity) for file in files for i in read_observations(file)]
    text = target.read_text(encoding="utf-8")
    assert text.startswith("# SYNTHETIC: a\n# b\n# joined, written by spirillum\n")
    assert "body_rate_Hz" not in text


def test_what_contradicts_is_refused_and_nothing_is_written(tmp_path: Path) -> None:
    file, target = made(tmp_path / "a.csv", 15, "a"), tmp_path / "all.csv"
    with pytest.raises(InputError, match="the joined file, rows 5 and 7 are both trial 1"):
        join_observations([file, made(tmp_path / "b.csv", 15, "b")], target)
    with pytest.raises(InputError, match="is read by this command"):
        join_observations([file, file], file)
    with pytest.raises(InputError, match="two or more"):
        join_observations([file], target)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.csv", "b.csv"]
