"""Tables of spreadsheets, word processors and other locales give the numbers that were meant, or a sentence."""

from pathlib import Path

import pytest

from spirillum import InputError
from spirillum.calibration.experiment import read_experiment
from spirillum.dynamics.release import read_flow
from spirillum.dynamics.timing import read_duty
from spirillum.files import csv_rows
from spirillum.files.reading import number_in
from spirillum.measurement.observations import join_observations, observations_answer, read_observations
from spirillum.robot.load import load

PLAIN = """\
channel_diameter_mm,wavelength_mm,amplitude_mm,trial,forward_velocity_mm_s,tail_rate_Hz,body_rate_Hz
40,15,1.5,1,0.7184,1.521,-0.06673
40,25,2.5,1,1.182,1.233,-0.1145
40,25,2.5,2,1.237,1.275,-0.117
"""
SEMICOLONS = PLAIN.replace(",", ";")
GERMAN = SEMICOLONS.replace(".", ",")


def quoted(text: str) -> str:
    """Decimal commas in quotation marks between commas."""
    return "\n".join(
        ",".join(f'"{cell}"' if "," in cell else cell for cell in line.split(";")) for line in text.split("\n")
    )


@pytest.mark.parametrize(
    "text",
    [
        PLAIN.replace("\n", ",\n"),
        PLAIN.replace("\n", ",,,\n"),
        PLAIN.replace("\n", ",\n", 1),
        PLAIN.replace("3\n", "3,\n", 1),
        PLAIN + ",,,,,,\n",
        *(PLAIN.replace(",-", f",{minus}") for minus in "\u2212\u2010\u2011\u2012\u2013\u2014\ufe63\uff0d"),
        PLAIN.replace(",", ", ").replace(" -", "\xa0-"),
        "\ufeff" + PLAIN,
        "# from two files\n\ufeff" + PLAIN,
        SEMICOLONS,
        GERMAN,
        GERMAN.replace(";-", ";\u2212"),
        GERMAN.replace("\n", ";\n"),
        GERMAN.replace(";", "\t"),
        PLAIN.replace(",", "\t"),
        f"sep=;\n{GERMAN}",
        f'"sep=,"\n{PLAIN}',
        quoted(GERMAN),
        PLAIN.replace("\n", "\r\n"),
        PLAIN.replace("\n", "\r"),
    ],
)
def test_the_same_numbers_in_other_notations(tmp_path: Path, text: str) -> None:
    (tmp_path / "plain.csv").write_text(PLAIN)
    (tmp_path / "other.csv").write_bytes(text.encode())
    plain, other = (
        [(i.tail, i.trial, i.forward_velocity, i.tail_rate, i.body_rate) for i in read_observations(tmp_path / name)]
        for name in ("plain.csv", "other.csv")
    )
    assert other == plain
    assert plain[0][4] == pytest.approx(-0.06673 * 6.283185307179586, rel=1e-15)


@pytest.mark.parametrize(("text", "value"), [("\u22120.5", -0.5), ("+.5", 0.5), ("1e\u22123", 1e-3), ("\u20132", -2.0)])
def test_signs_of_numbers(text: str, value: float) -> None:
    assert number_in(text) == value


@pytest.mark.parametrize("text", ["", "-", "\u2212", "1_0", "inf", "nan", "\u0661", "1,5", "0x10", "--1", "1\u22121"])
def test_what_is_no_number(text: str) -> None:
    assert number_in(text) != number_in(text)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('a,b\n"1,234",5\n', "1,234"),  # thousands or a decimal: nothing in the table tells
        ("a;b\n1,5;1.5\n", "1,5"),  # both marks
        ("a;b\n1.234,5;2\n", "1.234,5"),
    ],
)
def test_a_comma_that_may_mean_two_things_stays(text: str, words: str) -> None:
    assert words in csv_rows(text, Path("x.csv"), "a table")[1][1]


def test_a_comma_that_stays_is_refused_with_its_remedy(tmp_path: Path) -> None:
    (tmp_path / "o.csv").write_text(PLAIN.replace("0.7184", '"1,184"'))
    with pytest.raises(InputError, match=r"row 2, column forward_velocity_mm_s: '1,184'; .* with a decimal point"):
        read_observations(tmp_path / "o.csv")


def test_columns_of_notes_are_free_and_named(tmp_path: Path) -> None:
    head, *rows = PLAIN.splitlines()
    for name in ("notes", "Bemerkung", "note_speed_mm_s", "operator", "date", ""):
        lines = [f"{head},{name},", *(f'{row},"first, run; 1,5",' for row in rows)]
        (tmp_path / "o.csv").write_text("\n".join(lines) + "\n")
        (warning,) = observations_answer(tmp_path / "o.csv")["warnings"]
        assert warning == f"column {name or '(without a name)'}: not read, treated as comments"
        assert warning in read_experiment(tmp_path / "o.csv", [load("biorob2012-wide")]).doubts
    for name in ("tail_rate", "speed_mm_s", "Body rate", "forward_velocity_mm_s_ci", "amplitude"):
        (tmp_path / "o.csv").write_text("\n".join([f"{head},{name}", *(f"{row},1" for row in rows)]) + "\n")
        with pytest.raises(InputError, match=rf"column '{name}' is unknown.* notes, whose names begin with note"):
            read_observations(tmp_path / "o.csv")


def test_files_of_several_notations_are_joined_with_their_notes(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(PLAIN)
    head, *rows = GERMAN.replace("40;", "30;").splitlines()
    (tmp_path / "b.csv").write_text("\n".join([f"{head};note", *(f"{row};a; b".replace("; ", ", ") for row in rows)]))
    assert join_observations([tmp_path / "a.csv", tmp_path / "b.csv"], tmp_path / "c.csv") == 6
    assert '30,15,1.5,1,0.7184,1.521,-0.06673,"a, b"' in (tmp_path / "c.csv").read_text()


def test_duty_and_flow_files_are_read_likewise(tmp_path: Path) -> None:
    path = tmp_path / "x.csv"
    path.write_text("time_s;duty;note\n0;0,5;start\n1,5;1;\n")
    assert [tuple(switch) for switch in read_duty(path)] == [(0.0, 0.5), (1.5, 1.0)]
    path.write_text("time_s,flow_mm_s,\n0,\u22120.5,\n1,0.5,\n")
    assert read_flow(path).tolist() == [[0.0, -0.5e-3], [1.0, 0.5e-3]]
