"""Rows of a CSV text come with the numbers of their lines; what is no CSV gets a sentence."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from spirillum.errors import InputError
from spirillum.files import csv_rows

PATH = Path("table.csv")


def test_comments_and_empty_rows_are_counted_but_left_out() -> None:
    text = "# a comment\n\nx, y\n  # another\n1,2\n,,\n \t\n 3 ,4\n"
    assert csv_rows(text, PATH, "a table") == [(3, ["x", "y"]), (5, ["1", "2"]), (8, ["3", "4"])]


def test_a_cell_over_several_lines_does_not_shift_the_rows_behind_it() -> None:
    text = 'name,value\n"two\nlines",1\nlast,2\n'
    assert csv_rows(text, PATH, "a table") == [(1, ["name", "value"]), (2, ["two\nlines", "1"]), (4, ["last", "2"])]


@given(st.lists(st.sampled_from(["# words", "", ",,", "1,2", " 3 , 4 "]), max_size=12))
def test_every_row_with_a_cell_stands_once_at_its_line(lines: list[str]) -> None:
    found = csv_rows("\n".join(lines), PATH, "a table")
    kept = [number for number, line in enumerate(lines, 1) if line.strip(" ,") and not line.startswith("#")]
    assert [number for number, _ in found] == kept
    assert all(cells == [cell.strip() for cell in lines[number - 1].split(",")] for number, cells in found)


def test_nothing_but_comments_has_no_rows() -> None:
    assert csv_rows("# a\n# b\n", PATH, "a table") == []


@pytest.mark.parametrize("text", ['a,b\n"never closed,1\n', 'a,b\n"x"y,1\n', f"a,b\n{'1' * 200_000},2\n"])
def test_what_is_no_csv_gets_one_sentence(text: str) -> None:
    with pytest.raises(InputError, match=r"table\.csv is not CSV \(.*\); allowed: a table"):
        csv_rows(text, PATH, "a table")
