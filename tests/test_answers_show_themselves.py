"""Answers in Python: text and HTML with units, tab completion, figures."""

import ast
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from matplotlib.text import Text

import spirillum as sp
from spirillum.answer_entries import ENTRIES
from spirillum.display import DisplayMixin, html_of, text_of

ANSWER = {
    "schema": "spirillum.some-kind/1",
    "robot": "<b>mine</b>",
    "forward_velocity": {"value": 2e-5, "unit": "m/s", "low": 1e-5, "high": 3e-5},
    "friction_power": {"value": 0.0, "unit": "W"},
    "shaft_power": {"value": 5e-16, "unit": "W"},
    "absent": {"value": None, "unit": "m"},
    "matrix": {"value": [[1.0]], "unit": [["N"]]},
    "trials": [{"name": "first", "advance": {"value": 1e-3, "unit": "m"}}],
    "notes": [{"code": "misfit", "severity": "caution", "sentence": "1 < 2", "fields": []}],
    "warnings": ["1 < 2"],
}


def test_text_has_units_ends_parts_and_warnings() -> None:
    lines = text_of(ANSWER).splitlines()
    assert lines[0] == "<b>mine</b>: some kind"
    assert lines[1] == "caution: 1 < 2"
    assert lines[2].split() == ["forward", "velocity", "20", "um/s", "(10", "to", "30)"]
    assert lines[3].split()[-2:] == ["0", "fW"]
    assert "  trials: first" in lines
    assert not any("absent" in line or "matrix" in line for line in lines)


def test_html_is_escaped() -> None:
    page = html_of(ANSWER)
    assert "&lt;b&gt;mine&lt;/b&gt;" in page
    assert "<b>mine" not in page
    assert "1 &lt; 2" in page
    assert page.count("<td>um/s</td>") == 1


def test_prediction_shows_five_quantities_and_completes_all() -> None:
    answer = sp.predict("biorob2012-wide", model="sbt")
    lines = str(answer).splitlines()
    assert repr(answer) == f"Prediction(biorob2012-wide, sbt, U_x = {1e3 * answer.forward_velocity:.4g} mm/s)"
    assert [line.split()[0] for line in lines if line.startswith("  ")][:5] == [
        "forward",
        "tail",
        "body",
        "motor",
        "hydrodynamic",
    ]
    assert any(f"forward velocity         {1e3 * answer.forward_velocity:.4g} mm/s" in line for line in lines)
    assert {"battery_run_time", "cost_of_transport", "to_dict"} <= set(dir(answer))
    assert "<table>" in answer._repr_html_()


def test_a_released_motion_prints_its_quantities_or_why_there_is_none() -> None:
    found = sp.predict("biorob2012-wide", interval=False)
    trial, none = found.trial, sp.predict("ecoli").trial
    assert trial is not None
    speed = f"{1e3 * trial.values['forward_velocity']:.4g} mm/s"
    assert repr(trial) == f"ReleasedMotion(U_x = {speed})"
    assert str(trial).splitlines()[:2] == ["released motion", f"  forward velocity     {speed}"]
    assert str(none) == "the robot has no channel in which it could be released"


def test_a_band_prints_the_limits_of_its_quantities() -> None:
    found = sp.predict("biorob2012-wide", motion="held").band
    assert found is not None
    speed, low, high = (
        1e3 * value for value in (found.reference.forward_velocity[0], *found.limits("forward_velocity"))
    )
    assert repr(found) == f"Band(U_x = {speed:.4g} mm/s)"
    lines = str(found).splitlines()
    assert lines[0] == "band"
    assert f"{speed:.4g} mm/s ({low:.4g} to {high:.4g})" in lines[1]
    assert lines[-2:] == ["  over: gap and pitch", "  poses: 9"]


def test_an_answer_in_a_line_is_never_empty() -> None:
    from spirillum.calibration.calibrated import Calibrated
    from spirillum.calibration.ranking import ModelRank, Ranking

    nothing, fit = np.empty(0), object.__new__(Calibrated)
    ranked = tuple(ModelRank(name, *(0.0,) * 4, nothing, nothing, fit) for name in ("rft", "sbt"))
    assert repr(Ranking(ranked, ())) == "Ranking(rft, sbt)"

    class Answer(DisplayMixin):
        def to_dict(self) -> dict[str, Any]:
            return {"schema": "spirillum.any/1", "folder": "out", "rows": 3}

    assert repr(Answer()) == "Answer(folder = out, rows = 3)"


def test_comparison_and_resistance_print_their_numbers() -> None:
    found = sp.compare_models("biorob2012-wide", models=["sbt", "rft"])
    assert str(found).count("mm/s") == 2
    matrix = sp.resistance("biorob2012-wide", part="body")
    assert f"{matrix.matrix[0, 0]:.4g}" in str(matrix)


def test_control_shows_its_verdict_and_the_scores_of_all_controllers() -> None:
    task = {"kind": "stop-at", "at": "0.2 mm", "tolerance": "0.1 mm"}
    found = sp.control("biorob2012-wide", task, plant={"model": "rft"}, seeds=1)
    text = str(found)
    assert f"verdict: {'good enough' if found.score.good else 'not good enough'}" in text
    assert all(f"controllers: {name}" in text for name in ("feedback", "nothing", "open-loop", "knowing"))
    assert "<table>" in found._repr_html_()


def test_study_shows_its_ranking_first_and_stays_a_dataset() -> None:
    robots = ["biorob2012-wide", "biorob2012-narrow"]
    dataset = sp.study({"models": ["sbt"], "friction": ["rotor"], "robots": robots})
    speeds = dataset["forward_velocity_held"].values
    best = robots[int(speeds.argmax())]
    lines = str(dataset).splitlines()
    lead = 100 * (1.0 - speeds.min() / speeds.max())
    error = 100 * dataset["error_estimate_held"].values.sum()
    fastest = f"Study: fastest at a fixed pose by tube: {best}, {1e3 * speeds.max():.4g} mm/s"
    assert lines[0] == f"{fastest}, the next is {lead:.0f} % behind, the model's error is {error:.2g} %"
    assert [line.split()[0] for line in lines[3:5]] == [robots[number] for number in (-speeds).argsort()]
    assert dataset._repr_html_().startswith("<table><caption>fastest at a fixed pose")
    part = dataset.sel(model="sbt")
    assert str(part) == repr(part)
    assert isinstance(part.mean(), xr.Dataset)


def test_robots_that_are_a_product_of_tails_unstack_to_wavelength_and_amplitude(tmp_path) -> None:
    files = []
    for wavelength, amplitude in ((20, 2), (20, 3), (25, 3), (25, 2)):
        files.append(tmp_path / f"{wavelength}-{amplitude}.toml")
        tail = f'wavelength = "{wavelength} mm"\namplitude = "{amplitude} mm"\n'
        files[-1].write_text(f'extends = "biorob2012-wide"\nname = "{files[-1].stem}"\n[tail]\n{tail}')
    study = {"models": ["rft"], "friction": ["rotor"], "robots": [str(file) for file in files]}
    dataset = sp.study(study)
    grid = dataset.unstacked()
    assert {name: grid.sizes[name] for name in ("wavelength", "amplitude")} == {"wavelength": 2, "amplitude": 2}
    one = grid.sel(wavelength=0.025, amplitude=0.002, method="nearest")
    assert str(one["robot_name"].item()) == "25-2"
    assert one["forward_velocity"].squeeze() == dataset["forward_velocity"].sel(robot="25-2").squeeze()
    with pytest.raises(sp.InputError, match="3 robots are not all combinations of their sizes"):
        sp.study({**study, "robots": study["robots"][:3]}).unstacked()


def test_batches_and_systems_print_their_numbers() -> None:
    batch = sp.RobotBatch.of(sp.load("biorob2012-wide")).with_values({"tail.wavelength": [0.010, 0.020, 0.030]})
    swum = sp.swim(batch, "sbt")
    low, middle, high = sorted(1e3 * swum.forward_velocity)
    assert f"{middle:.4g} mm/s ({low:.4g} to {high:.4g})" in str(swum)
    point = sp.linear_system("biorob2012-wide", model="rft", duty=0.5)
    assert f"{1e3 * point.outputs['forward_velocity']:.4g} mm/s" in str(point)


def test_every_public_answer_has_both_forms() -> None:
    """All that has `to_dict`, and the datasets of xarray, which have both."""
    public = [getattr(sp, name) for name in sp.__all__ if isinstance(getattr(sp, name), type)]
    answers = [kind for kind in public if hasattr(kind, "to_dict") and not issubclass(kind, str)]  # a note is text
    assert {"Control", "Flow", "LinearSystem", "Observation", "Swimming", "Tracked"} <= {a.__name__ for a in answers}
    assert [kind.__name__ for kind in answers if not issubclass(kind, DisplayMixin)] == []


def test_public_names_and_nothing_else() -> None:
    assert dir(sp) == sorted([*sp.__all__, "__version__"])
    assert all(getattr(sp, name) is not None for name in ("predict", "plot", "study"))


@pytest.mark.usefixtures("unplaced")
def test_plot_draws_by_the_kind_of_answer(tmp_path) -> None:
    drawn = sp.plot(sp.compare_models("biorob2012-wide", models=["sbt", "rft"]))
    assert drawn._repr_png_().startswith(b"\x89PNG")
    assert drawn.save(tmp_path / "models.pdf").read_bytes().startswith(b"%PDF")
    study = {"models": ["sbt"], "friction": ["rotor"], "robots": ["biorob2012-wide", "biorob2012-narrow"]}
    assert len(sp.plot(sp.study(study)).figure.axes) == 4
    assert sp.plot(sp.load("biorob2012-wide")).figure.axes
    speed = sp.plot(sp.predict("biorob2012-wide", model="rft")).figure
    assert "Speeds are upper bounds" in " ".join(text.get_text() for text in speed.findobj(Text))
    task = {"kind": "stop-at", "at": "0.2 mm", "tolerance": "0.1 mm"}
    assert len(sp.plot(sp.control("biorob2012-wide", task, plant={"model": "rft"})).figure.axes) == 3
    with pytest.raises(sp.InputError, match="answer = int has no figure"):
        sp.plot(3)


def test_entries_of_answers_are_declared_of_what_their_classes_have() -> None:
    source = Path(sp.__file__).parent
    nodes = [n for path in source.rglob("*.py") for n in ast.walk(ast.parse(path.read_text(encoding="utf-8")))]
    classes = {node.name: node for node in nodes if isinstance(node, ast.ClassDef)}
    calls = [n for n in nodes if isinstance(n, ast.Call) and ast.unparse(n.func) in ("answer_of", "content_of")]
    computed = {str(word.arg) for call in calls for word in call.keywords}
    for name, rows in ENTRIES.items():
        own = classes[name].body
        known = computed | {node.name for node in own if isinstance(node, ast.FunctionDef)}
        known |= {ast.unparse(node.target) for node in own if isinstance(node, ast.AnnAssign)}
        named = [row.attribute for row in rows] + [row.given for row in rows if row.given]
        named += [row.unit.strip("{}") for row in rows if row.unit.startswith("{")]
        assert {path.partition(".")[0] for path in named if not path.startswith("=")} - known == set(), name
