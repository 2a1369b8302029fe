"""The paper's procedure: exact without noise, the readings of (18), and the same B_eff as `swim` infers."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import spirillum as sp
from spirillum.results.calibration import write_calibration
from spirillum.robot.batch import RobotBatch
from spirillum.robot.load import load

PRESETS = ["biorob2012-wide", "biorob2012-narrow"]


@pytest.mark.parametrize("model", ["sbt", "rft"])
def test_planted_factors_and_friction_come_back_to_rounding(made: Callable[..., Path], model: str) -> None:
    path = made(model=model, drag=(2.2, 4.1), rotation=(0.7, 1.3), error=0.0, trials=1)
    found = sp.calibrate(path, PRESETS, model=model, free="body_drag,body_rotation,friction", method="paper")
    planted = {
        "body_drag[40 mm]": 2.2,
        "body_drag[30 mm]": 4.1,
        "body_rotation[40 mm]": 0.7,
        "body_rotation[30 mm]": 1.3,
    }
    for name, value in planted.items():
        assert found.values[name].value == pytest.approx(value, rel=1e-9)
    assert [item.value for item in found.friction] == pytest.approx([1e-5] * 32, rel=1e-9)


def test_coupled_model_is_inverted_as_well(made: Callable[..., Path]) -> None:
    small = {"presets": PRESETS[:1], "wavelengths": (15.0, 25.0), "amplitudes": (2.5,)}
    path = made(model="slender", drag=(3.0,), rotation=(1.5,), error=0.0, trials=1, **small)
    found = sp.calibrate(path, PRESETS[0], model="slender", method="paper")
    assert found.values["body_drag"].value == pytest.approx(3.0, rel=1e-9)
    assert found.values["body_rotation"].value == pytest.approx(1.5, rel=1e-9)


def test_resistive_force_theory_keeps_the_rotation_as_in_table_3(made: Callable[..., Path]) -> None:
    path = made(model="rft", rotation=(1.0, 1.0), error=0.0, trials=1)
    found = sp.calibrate(path, PRESETS, model="rft", method="paper")
    assert set(found.values) == {"body_drag[30 mm]", "body_drag[40 mm]"}
    assert found.values["body_drag[40 mm]"].value == pytest.approx(1.95, rel=1e-9)


@pytest.mark.parametrize("reading", ["rotor", "paper"])
def test_friction_is_what_swim_infers_at_the_observed_rates(made: Callable[..., Path], reading: str) -> None:
    path = made(model="rft", rotation=(1.0, 1.0), trials=3, seed=5)
    found = sp.calibrate(path, PRESETS, model="rft", method="paper", friction=reading)
    experiment = found.experiment
    for place in (0, 7, 20, 31):
        robot = experiment.robots[place]
        assert robot.channel is not None
        drag = found.values[f"body_drag[{1e3 * robot.channel.diameter:g} mm]"].value
        factors = robot.calibration["rft"].model_copy(update={"body_drag": drag})
        batch = RobotBatch.of(robot.model_copy(update={"calibration": {"rft": factors}}))
        rates = {"tail_rate": experiment.tail_rate[[place]], "motor_rate": experiment.motor_rate.mean[[place]]}
        swum = sp.swim(batch, "rft", friction=reading, **rates)
        assert found.friction[place].value == pytest.approx(float(swum.effective_friction[0]), rel=1e-9)


def test_a_left_handed_tail_gives_the_same_factors(made: Callable[..., Path]) -> None:
    settings = {"error": 0.0, "trials": 1, "presets": PRESETS[:1], "drag": (1.7,), "rotation": (0.8,)}
    path = made(**settings, overrides={"tail.handedness": "left"})
    left = load(PRESETS[0], **{"tail.handedness": "left"})
    found = sp.calibrate(path, left, method="paper")
    assert found.values["body_drag"].value == pytest.approx(1.7, rel=1e-9)
    assert found.values["body_rotation"].value == pytest.approx(0.8, rel=1e-9)
    assert np.all(np.array([item.value for item in found.friction]) > 0)


def test_the_calibration_file_lets_predict_repeat_the_observations(made: Callable[..., Path], tmp_path: Path) -> None:
    path = made(error=0.0, trials=1, drag=(2.2, 4.1), rotation=(0.7, 1.3))
    found = sp.calibrate(path, PRESETS, method="paper")
    write_calibration(found, tmp_path, figures=False)
    robot = load(PRESETS[1], **{"tail.wavelength": "20 mm", "tail.amplitude": "1.5 mm"})
    answer = sp.predict(robot, calibration=tmp_path / "calibration.toml")
    row = next(
        line.split(",") for line in path.read_text().splitlines() if line.startswith("biorob2012-narrow,30,20,1.5")
    )
    assert answer.forward_velocity == pytest.approx(1e-3 * float(row[5]), rel=1e-9)
    assert answer.tail_rotation_rate == pytest.approx(2 * np.pi * float(row[6]), rel=1e-9)
    assert answer.effective_friction == pytest.approx(1e-5, rel=1e-9)
    assert not [warning for warning in answer.warnings if "outside its geometry" in warning]
