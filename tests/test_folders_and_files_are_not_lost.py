"""A folder of results belongs to one question, and a file that a user may have edited is not overwritten."""

from pathlib import Path

import pytest

from spirillum.errors import InputError
from spirillum.files import claim_folder, new_file
from spirillum.files.reading import DAMAGED

MARK = {"fingerprint": "a", "title": "first"}


def test_a_new_file_is_written_whole_and_kept(tmp_path: Path) -> None:
    path = tmp_path / "new.toml"
    new_file(path, "first")
    with pytest.raises(InputError, match="exists; allowed: a new file, or --force to overwrite one"):
        new_file(path, "second")
    assert path.read_text() == "first"
    new_file(path, "second", overwrite=True)
    assert path.read_text() == "second"
    assert list(tmp_path.iterdir()) == [path]


def test_a_folder_in_the_place_of_a_new_file_stays(tmp_path: Path) -> None:
    for overwrite in (False, True):
        with pytest.raises(InputError, match="is not a regular file; allowed"):
            new_file(tmp_path, "text", overwrite=overwrite)


@pytest.mark.parametrize("name", ["x" * 300, "a\0b"])
def test_a_name_that_no_file_can_have_gets_a_sentence(tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError, match="allowed: a file name"):
        new_file(tmp_path / name, "text")


def test_the_same_question_resumes_and_another_is_refused(tmp_path: Path) -> None:
    folder = tmp_path / "out"
    claim_folder(folder, "mark.json", MARK, "study")
    (folder / "result").touch()
    before = (folder / "mark.json").read_bytes()
    claim_folder(folder, "mark.json", MARK, "study")
    with pytest.raises(InputError, match=r"holds another study \('first'\), or one with other settings; allowed"):
        claim_folder(folder, "mark.json", MARK | {"fingerprint": "b"}, "study")
    assert (folder / "mark.json").read_bytes() == before


@pytest.mark.parametrize("text", ["", "{", "[]", "{}", '"fingerprint"', '{"a": 1}'])
def test_a_damaged_or_foreign_mark_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "mark.json").write_text(text)
    with pytest.raises(InputError, match=rf"mark\.json {DAMAGED}; allowed: to move it away, or a new folder"):
        claim_folder(tmp_path, "mark.json", MARK, "study")


def test_results_of_unknown_origin_are_refused_and_named(tmp_path: Path) -> None:
    (tmp_path / "notes").touch()
    with pytest.raises(InputError, match="holds notes of unknown origin; allowed: a new folder"):
        claim_folder(tmp_path, "mark.json", MARK, "study")
    assert [path.name for path in tmp_path.iterdir()] == ["notes"]
    claim_folder(tmp_path, "mark.json", MARK, "study", results=("dataset.nc",))  # notes may stay
    (tmp_path / "mark.json").unlink()
    (tmp_path / "dataset.nc").touch()
    with pytest.raises(InputError, match=r"holds dataset\.nc of unknown origin"):
        claim_folder(tmp_path, "mark.json", MARK, "study", results=("dataset.nc",))
