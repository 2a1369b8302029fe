"""Notes have known codes, fit into few rows, and survive files and processes."""

import ast
import pickle
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest
import xarray as xr

import spirillum as sp
from spirillum.data_tables import rows_of
from spirillum.notes import KINDS, LONGEST, TRACKING, Note, headline_cautions, note_attributes, notes_in

ROOT = Path(__file__).parent.parent


@cache
def calls() -> list[tuple[str, list[ast.expr]]]:
    """Names and arguments of the calls of notes and flags in the package."""
    texts = (path.read_text(encoding="utf-8") for path in (ROOT / "src").rglob("*.py"))
    nodes = (node for text in texts if "Note(" in text or "Flag(" in text for node in ast.walk(ast.parse(text)))
    return [(getattr(node.func, "id", ""), node.args) for node in nodes if isinstance(node, ast.Call)]


def literals(name: str) -> Iterator[tuple[str, str]]:
    """Codes, and sentences where they are literal, of all calls of a class in the package."""
    for called, arguments in calls():
        if called == name and len(arguments) > 1:
            code, sentence = (item.value if isinstance(item, ast.Constant) else "" for item in arguments[:2])
            if code:
                yield code, sentence


def test_every_code_is_explained_and_every_explained_code_is_used() -> None:
    used = {code for code, _ in literals("Note")} | {row["code"] for row in rows_of("sentences.csv")}
    assert used <= set(KINDS)
    own = set(KINDS) - set(TRACKING)
    computed = {"inertia", "outside-validity", "remark", "misfit", "intervals-incomplete"}
    assert own - computed <= used | {"outlier"}
    for row in rows_of("vision/flags.csv"):
        for part, what in (("body", "stripes"), ("tail", "tail")):
            code = (row["code"] or row["name"]).format(part=part, what=what, rate="forward-velocity")
            assert Note(code, "").code in KINDS


def test_every_flag_of_the_table_is_raised() -> None:
    text = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "src").rglob("*.py"))
    assert [row["name"] for row in rows_of("vision/flags.csv") if f'"{row["name"]}"' not in text] == []


def test_sentences_are_short() -> None:
    assert [sentence for _, sentence in literals("Note") if len(sentence) > LONGEST] == []
    texts = [re.sub(r"\{.*?\}", "", row["sentence"]) for row in rows_of("sentences.csv")]
    assert [text for text in texts if len(text) > LONGEST] == []


def test_every_sentence_of_the_table_is_raised() -> None:
    names = {row["name"] for row in rows_of("sentences.csv")}
    source = "\n".join(path.read_text(encoding="utf-8") for path in (ROOT / "src").rglob("*.py"))
    chosen = {name for name in names if f'"{name}"' in source}
    assert set(re.findall(r'Note\.named\(\s*"([\w-]+)"', source)) <= names == chosen


def test_every_code_has_an_anchor_in_the_documentation() -> None:
    page = (ROOT / "docs" / "notes.md").read_text(encoding="utf-8")
    assert [code for code in KINDS if f"(note-{code})=\n" not in page] == []


def test_unknown_codes_are_refused_and_rates_share_a_code() -> None:
    with pytest.raises(KeyError, match="no code 'unheard-of'"):
        Note("unheard-of", "x")
    assert Note("not-steady-body-rotation-rate", "x").code == "not-steady"


def test_notes_survive_processes_prefixes_and_datasets() -> None:
    note = Note("misfit", "one misses", ("advance",))
    again = pickle.loads(pickle.dumps(note.prefixed("two: ")))
    assert (again, again.code, again.fields) == ("two: one misses", "misfit", ("advance",))
    dataset = xr.Dataset(attrs=note_attributes([note, again]))
    assert dataset.attrs["warnings"] == "one misses\ntwo: one misses"
    assert [found.to_dict() for found in notes_in(dataset.attrs)] == [note.to_dict(), again.to_dict()]
    assert [found.code for found in notes_in({"warnings": "of an earlier version"})] == ["remark"]


def test_the_three_weightiest_cautions_are_shown() -> None:
    codes = ("inertia", "outlier", "friction-unset", "outlier", "interpolated", "robot-floats", "pose-unknown")
    shown = [note.code for note in headline_cautions(Note(code, "w" * 150) for code in codes)]
    assert shown == ["pose-unknown", "robot-floats", "friction-unset"]
    video = [Note(code, "v") for code in ("setup-incomplete", "intervals-incomplete", "robot-stands-still")]
    assert headline_cautions(video)[0].code == "robot-stands-still"  # what it shows outweighs the rest


def test_a_robot_that_does_not_rest_on_the_floor_says_so_first() -> None:
    light = sp.predict(sp.load("biorob2012-wide", **{"body.mass": "6 g"}), model="tube", motion="held", band=False)
    assert [note.code for note in headline_cautions(light.warnings)] == ["robot-floats", "friction-unset"]
