"""Study files and observations that are wrong: one sentence each, and nothing written."""

from pathlib import Path

import pytest

import spirillum as sp
from spirillum.papers.biorob2012.published import paper_study
from spirillum.papers.studies import study_of

GRID = '[grid]\nwavelengths = ["20 mm"]\namplitudes = ["2 mm"]\n[grid.channels]\nwide = "biorob2012-wide"\n'


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "is empty"),
        ("title = 3\n" + GRID, "title = 3"),
        ('titel = "x"\n' + GRID, "did you mean title?"),
        ('title = "no robots"\n', "exactly one of a [grid] table and a `robots` list"),
        ('robots = ["biorob2012-wide"]\n' + GRID, "exactly one of"),
        ('models = ["cfd"]\n' + GRID, "models = 'cfd' is unknown"),
        ('models = ["sbt", "sbt"]\n' + GRID, "models holds a value twice"),
        ("models = []\n" + GRID, "models"),
        ('friction = ["ice"]\n' + GRID, "friction.0 = 'ice'"),
        ('assumed_motor_rates = ["1 1/s"]\n' + GRID, "does not say what turns"),
        ('assumed_motor_rates = ["0 Hz"]\n' + GRID, "assumed_motor_rates holds a rate out of range"),
        (GRID.replace("20 mm", "-20 mm"), "grid.wavelengths.0"),
        (GRID.replace('["20 mm"]', '["20 mm", "2 cm"]'), "grid.wavelengths holds a value twice"),
        (GRID.replace("biorob2012-wide", "biorob2012-wise"), "study.toml: 'biorob2012-wise' is neither a preset nor"),
        (GRID.replace("biorob2012-wide", "missing.toml"), "missing.toml does not exist"),
        ('robots = ["biorob2012-wide", "none.toml"]\n', "none.toml does not exist"),
        ("robots = []\n", "robots"),
        ('robots = ["biorob2012-wide", "biorob2012-wide"]\n', "biorob2012-wide are the same; allowed: each once"),
        (
            'robots = ["biorob2012-wide"]\nvary = {"tail.length" = ["40 mm", "4 cm"]}\n',
            "tail.length = 40 mm and biorob2012-wide, tail.length = 4 cm are the same",
        ),
        (
            'robots = ["biorob2012-wide"]\nvary = {"tail.length" = ["40 mm", "4 s"]}\n',
            'study.toml, with vary: preset biorob2012-wide: tail.length = "4 s": "s" is not a unit of length',
        ),
        ("settled = 1 \npredicted = 2\n" + GRID, "(and 1 more: settled)"),
        ("settled = 1\n" + GRID, "settled = 1 is not allowed; allowed: true or false"),
        ("a = [[[[", "is not TOML"),
        ("a = " + "[" * 5000 + "]" * 5000, "nested too deeply"),
    ],
)
def test_wrong_study_files_are_refused(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "study.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(sp.InputError) as caught:
        sp.study(path, output=tmp_path / "out")
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "out").exists()


def test_huge_grid_is_refused_at_once(tmp_path: Path) -> None:
    many = ", ".join(f'"{1 + i * 1e-3} mm"' for i in range(3000))
    path = tmp_path / "study.toml"
    path.write_text(GRID.replace('"20 mm"', many).replace('"2 mm"', many), encoding="utf-8")
    with pytest.raises(sp.InputError, match="at most 5000000"):
        sp.study(path)


def test_observations_have_to_belong_to_the_study(small: dict[str, object], tmp_path: Path) -> None:
    header = "channel_diameter_mm,wavelength_mm,amplitude_mm,tail_rate_Hz\n"
    path = tmp_path / "observations.csv"
    path.write_text(header + "40,25,2.5,1\n40,12,2.5,1\n")
    with pytest.raises(sp.InputError, match="row 3: no robot of the study has channel 40 mm, wavelength 12 mm"):
        sp.study(small, observations=path)
    path.write_text(header + "40,25,2.5,-1\n")
    with pytest.raises(sp.InputError, match="row 2, column tail_rate_Hz: -1; allowed: positive"):
        sp.study(small, observations=path)


def test_a_papers_study_goes_by_its_name() -> None:
    assert study_of(None) == study_of("biorob2012") == study_of(Path("biorob2012")) == paper_study()
    assert study_of("biorob2012.toml") == "biorob2012.toml"
    assert study_of({"robots": []}) == {"robots": []}
