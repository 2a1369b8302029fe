"""Robots of a study that have no answer: counted by the requirement that they break, and told in its sentence."""

import json

import numpy as np
import pytest

import spirillum as sp
from spirillum.cli import main
from spirillum.errors import InputError
from spirillum.studies.work import REASONS

TAILS = """
models = ["rft"]
friction = ["none", "rotor"]
[grid]
channels = {{ wide = "biorob2012-wide" }}
wavelengths = ["20 mm"]
amplitudes = {amplitudes}
"""


def test_each_counts_for_the_first_requirement_that_it_breaks() -> None:
    tails = {"wavelengths": ["20 mm"], "amplitudes": ["2.5 mm", "24 mm", "25 mm"]}
    grid = {"channels": {"wide": "biorob2012-wide"}, **tails}
    found = sp.study({"models": ["rft"], "friction": ["none"], "grid": grid})
    (said,) = [line for line in found.attrs["warnings"].split("\n") if "have no answer" in line]
    assert said.startswith("2 of 3 robots have no answer (rft), the first: tail.amplitude = 24 mm")
    assert np.count_nonzero(found["outside"]) == 2


def test_drive_without_a_steady_motion_is_told_by_its_readings() -> None:
    question = {"models": ["rft"], "friction": ["none", "paper"], "robots": ["biorob2012-wide"]}
    found = sp.study(question, overrides={"friction.effective": "1 N m s/rad"})
    assert found["outside"].values.ravel().tolist() == [0, REASONS.index("other")]
    assert (
        "1 of 1 robots have no answer (rft), the first: no steady motion under 1 of 2 friction models"
        in (found.attrs["warnings"])
    )


def test_a_tail_that_does_not_fit_takes_no_walls_from_the_others() -> None:
    robots = {"robots": ["biorob2012-wide"], "friction": ["none"]}
    both = sp.study(robots | {"vary": {"tail.amplitude": ["2.5 mm", "12 mm"]}})
    alone = sp.study(robots)
    assert both["model"].values.tolist() == alone["model"].values.tolist() == ["tube"]
    assert np.isfinite(both["forward_velocity"].values).ravel().tolist() == [True, False]
    found, wanted = both["forward_velocity"].values.ravel()[0], alone["forward_velocity"].values.item()
    assert found == pytest.approx(wanted, rel=1e-12)
    short = {"tail.length": "10 mm"}  # solved for in less time
    (nobody,) = sp.study(robots | {"vary": {"tail.amplitude": ["12 mm"]}}, overrides=short)["model"].values.tolist()
    assert nobody == "tube"


def test_a_gap_that_no_channel_has_is_refused_before_the_work() -> None:
    robots = ["biorob2012-wide", "biorob2012-narrow"]
    words = r"placement\.gap = 11\.01 mm; allowed: at most 11 mm, because there is no more room in any channel"
    with pytest.raises(InputError, match=words):
        sp.study({"models": ["tube"], "robots": robots, "placement": {"gap": "11.01 mm"}})


def test_robots_with_and_without_a_channel_need_a_named_model() -> None:
    mixed = {"robots": ["biorob2012-wide", "ecoli"], "friction": ["none"]}
    with pytest.raises(InputError, match=r"ecoli has no channel, but others have; allowed: .* models = \["):
        sp.study(mixed)


@pytest.mark.parametrize(("amplitudes", "code"), [('["2.5 mm", "25 mm"]', 0), ('["25 mm"]', 2)])
def test_study_without_any_answer_ends_as_bad_input_does(
    amplitudes: str, code: int, tmp_path, capsys, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("spirillum.results.study.write_report", lambda *_, **__: None)
    (tmp_path / "study.toml").write_text(TAILS.format(amplitudes=amplitudes))
    with pytest.raises(SystemExit) as ended:
        main(["study", str(tmp_path / "study.toml"), "-o", str(tmp_path / "out"), "--json"])
    assert ended.value.code == code
    answer = json.loads(capsys.readouterr().out)
    assert (answer["results"], answer["unanswered"]) == (2 * (2 if code == 0 else 1), 2)
    assert any("have no answer" in line for line in answer["warnings"])
