"""Every command's answer: a table for people, the contract's JSON for machines."""

import json
import math
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import spirillum as sp
from spirillum.cli.tables.motion import _events
from spirillum.robot.load import preset_names, shipped_robots

KEYS = (
    "robot",
    "model",
    "forward_velocity",
    "advance_per_radian",
    "tail_rotation_rate",
    "body_rotation_rate",
    "motor_rotation_rate",
    "tail_torque",
    "drive_torque",
    "motor_current",
    "battery_voltage",
    "effective_friction",
    "electrical_power",
    "shaft_power",
    "friction_power",
    "dissipated_power",
    "hydrodynamic_efficiency",
    "reynolds_number",
    "placement",
    "error_estimate",
    "warnings",
    "schema",
)


def quantities(answer: Any) -> Iterator[dict[str, Any]]:
    """All quantities of an answer."""
    if isinstance(answer, dict):
        if "unit" in answer:
            yield answer
        for value in answer.values():
            yield from quantities(value)


@pytest.mark.parametrize("preset", preset_names())
@pytest.mark.parametrize("model", ["sbt", "rft"])
def test_prediction_has_the_keys_of_the_contract(run: Callable[..., Any], preset: str, model: str) -> None:
    outcome = run("predict", preset, "--model", model, "--json")
    assert (outcome.code, outcome.err) == (0, "")
    answer = json.loads(outcome.out)
    assert set(KEYS) <= set(answer)
    assert answer["schema"] == "spirillum.prediction/1"
    assert answer["tail_rotation_rate"]["unit"] == "rad/s"
    assert answer["reynolds_number"]["length"] == "body diameter"
    expected = sp.predict(preset, model=model)
    assert answer["forward_velocity"] == {"value": expected.forward_velocity, "unit": "m/s"}
    for item in quantities(answer):
        assert item["value"] is None or math.isfinite(item["value"])


def test_table_shows_the_same_numbers_and_every_warning(run: Callable[..., Any]) -> None:
    changed = ("--set", "channel.diameter=35 mm", "--set", "body.diameter=17mm")
    outcome = run("predict", "biorob2012-wide", "--model", "sbt", "--notes", *changed)
    other = sp.load("biorob2012-wide", channel={"diameter": "35 mm"}, body={"diameter": "17 mm"})
    expected = sp.predict(other, model="sbt")
    assert outcome.code == 0
    assert f"{expected.forward_velocity * 1e3:.4g}" in outcome.out
    assert len(expected.warnings) == 3
    for warning in expected.warnings:
        assert warning in outcome.out.replace("\n", " ")


def test_resistance_of_an_axial_model_has_null_for_what_is_unknown(run: Callable[..., Any]) -> None:
    answer = json.loads(run("resistance", "biorob2012-wide", "--model", "sbt", "--json").out)
    matrix = answer["matrix"]["value"]
    known = {(i, j) for i in range(6) for j in range(6) if matrix[i][j] is not None}
    assert known == {(0, 0), (0, 3), (3, 0), (3, 3)}
    assert answer["matrix"]["unit"] == [["N s/m", "N s"], ["N s", "N m s"]]
    assert any("axis only" in warning for warning in answer["warnings"])


def test_resistance_about_the_tails_root_is_a_shift(run: Callable[..., Any]) -> None:
    about = [
        np.array(
            json.loads(run("resistance", "biorob2012-wide", "--part", "tail", "--about", a, "--json").out)["matrix"][
                "value"
            ]
        )
        for a in ("body", "tail-root")
    ]
    offset = np.array([[0, 0, 0], [0, 0, -0.0275], [0, 0.0275, 0]])  # S of the root's offset (-27.5 mm, 0, 0), negated
    np.testing.assert_allclose(about[1][:3, :3], about[0][:3, :3], rtol=1e-12)
    np.testing.assert_allclose(about[1][:3, 3:], about[0][:3, 3:] + about[0][:3, :3] @ offset.T, atol=1e-12)


def test_phase_turns_the_tail(run: Callable[..., Any]) -> None:
    angles = ("90deg", "0.25turn", "1.5707963267948966 rad")
    found = [json.loads(run("resistance", "biorob2012-wide", "--phase", a, "--json").out) for a in angles]
    for answer in found:
        np.testing.assert_allclose(answer["matrix"]["value"], found[0]["matrix"]["value"], rtol=1e-12)


def test_simulation_writes_what_it_says(run: Callable[..., Any], tmp_path: Path) -> None:
    import xarray as xr

    target = tmp_path / "run.nc"
    arguments = ("--model", "rft", "--duration", "0.5s", "--on", "0s:0.2s", "--on", "0.3 s:0.4 s", "--json")
    answer = json.loads(run("simulate", "biorob2012-wide", "-o", str(target), *arguments).out)
    with xr.open_dataset(target) as stored:
        assert answer["final_position"]["value"] == pytest.approx(stored["position"][-1].values)
        assert answer["motion"] == "free"
        assert [event["time"] for event in answer["events"]] == [0.0, 0.2, 0.3, 0.4]
        assert set(np.unique(stored["duty"].values)) == {0.0, 1.0}
    assert [path.name for path in tmp_path.iterdir()] == ["run.nc"]


def test_robot_files_are_made_shown_and_checked(run: Callable[..., Any], tmp_path: Path) -> None:
    path = tmp_path / "my robot.toml"
    assert run("robot", "new", str(path), "--from", "biorob2012-narrow").code == 0
    assert run("robot", "check", str(path)).code == 0
    shown = json.loads(run("robot", "show", str(path), "--json").out)
    assert shown["robot"] == "my-robot"
    assert shown["fields"]["channel.diameter"] == {"value": 0.03, "unit": "m"}
    assert shown["derived"]["turns"]["value"] == pytest.approx(2.4)
    assert run("robot", "new", str(path)).code == 2
    assert run("robot", "new", str(path), "--force").code == 0
    path.write_text(path.read_text().replace('"18 mm"', '"18 kg"').replace("[body]", "[body]\nlenght = 3"))
    outcome = run("robot", "check", str(path), "--json")
    problems = json.loads(outcome.out)["problems"]
    assert outcome.code == 1
    assert len(problems) == 4  # two calibrations also hold the body's diameter
    assert any("did you mean length?" in problem for problem in problems)


def test_a_check_says_which_models_have_no_answer(run: Callable[..., Any]) -> None:
    outcome = run("robot", "check", "biorob2012-wide", "--set", "coupling.length=0mm", "--json")
    answer = json.loads(outcome.out)
    assert (outcome.code, answer["valid"]) == (0, True)
    said = [line.split(":")[0] for line in answer["warnings"] if line.startswith("model")]
    assert said == [f"model '{name}' has no answer for it" for name in ("slender", "tube")]
    water = "--set", "channel=none", "--set", "fluid.viscosity=0.00026Pas"
    said = json.loads(run("robot", "check", "biorob2012-wide", *water, "--json").out)["warnings"]
    assert [words.partition(": Reynolds number (body diameter) = ")[0] for words in said] == [
        f"model '{name}' has no answer for it" for name in ("sbt", "rft", "slender")
    ]
    assert json.loads(run("robot", "check", "biorob2012-wide", "--json").out)["warnings"] == []


@pytest.mark.parametrize("name", ["robot", "study", "calibration", "setup"])
def test_schemas_describe_the_files(run: Callable[..., Any], name: str) -> None:
    schema = json.loads(run("schema", name).out)
    assert schema["$schema"].startswith("https://json-schema.org/")
    assert schema["additionalProperties"] is False
    tables = [schema, *schema.get("$defs", {}).values()]
    fields = {field: content for table in tables for field, content in table.get("properties", {}).items()}
    assert fields
    assert [field for field, content in fields.items() if not content.get("description")] == []


def test_every_help_has_an_example_that_runs(run: Callable[..., Any], tmp_path: Path, monkeypatch) -> None:
    from spirillum.results import study as study_results

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(study_results, "write_report", lambda *_, **__: None)
    monkeypatch.setenv("COLUMNS", "200")
    commands = ["predict", "resistance", "study", "simulate", "schema", "citation", "robot new", "robot show"]
    for command in [*commands, "robot check"]:
        text = run(*command.split(), "--help").out
        example = re.search(r"Example: spirillum (.*)", text)
        assert example, command
        assert run(*example[1].split()).code == 0, example[0]


def test_calibration_files_replace_the_robots_factors(run: Callable[..., Any], tmp_path: Path) -> None:
    path = tmp_path / "calibration.toml"
    path.write_text(
        '[calibration.sbt]\nbody_drag = 1.0\nbody_rotation = 1.0\nsource = "test"\n'
        '[calibration.sbt.fitted_to]\nchannel_diameter = "40 mm"\nbody_diameter = "18 mm"\nbody_length = "35 mm"\n'
    )
    with_file = json.loads(run("predict", "biorob2012-wide", "--calibration", str(path), "--json").out)
    without = json.loads(run("predict", "biorob2012-wide", "--model", "sbt", "--no-calibration", "--json").out)
    assert with_file["forward_velocity"] == without["forward_velocity"]
    path.write_text("[calibration.sbt]\nbody_drag = -1\n")
    outcome = run("predict", "biorob2012-wide", "--calibration", str(path))
    assert outcome.code == 2
    assert "calibration.sbt.body_drag" in outcome.err


def test_completion_offers_presets(monkeypatch, capsys: pytest.CaptureFixture[str]) -> None:
    from spirillum.cli import shared_options
    from spirillum.fluid.registry import SWIMMER_MODELS

    assert shared_options.complete_presets("") == list(shipped_robots())
    assert shared_options.complete_presets("bio") == ["biorob2012-narrow", "biorob2012-wide"]
    assert shared_options.complete_parts("ro") == ["robot", "rotor"]
    assert shared_options.complete_auto_models("") == ["auto", *sorted(SWIMMER_MODELS)]
    assert shared_options.complete_resistance_models("p") == ["perrin"]


def test_events_in_the_wait_have_no_negative_times() -> None:
    events = [{"time": -52.52, "what": "touches"}, {"time": 1.0, "what": "duty 0"}]
    assert list(_events(events)) == ["52.52 s before the run, in the wait: touches", "1 s: duty 0"]
