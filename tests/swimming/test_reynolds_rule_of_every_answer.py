"""One rule for every answer that has a speed: above a Reynolds number of 0.1 a warning, above 10 a refusal."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import spirillum as sp

WATER = sp.load("biorob2012-wide", **{"fluid.viscosity": "1 mPa s"})
OIL = sp.load("biorob2012-wide", **{"fluid.viscosity": "1 Pa s"})
UNBOUND = sp.load("biorob2012-wide", **{"fluid.viscosity": "1 mPa s", "model.beyond_stokes": "on"})
HELIX = {
    "extends": "magnetic-helix",
    "fluid": {"viscosity": "1 mPa s", "density": "1000 kg/m^3"},
    "magnetic": {"moment": "3e-5 A m^2", "rotation_rate": "10 Hz"},
}
REFUSED = r"Reynolds number \(.*\) = .*[;,] allowed: at most 10, .*model\.beyond_stokes = on"
SHORT = {"timing": {"duration": "0.1 s"}}
RANGE = {"tail.wavelength": ("15 mm", "30 mm")}


def _observed(robot: sp.Robot, folder: Path) -> Path:
    """Two trials of two tails, as fast as the robot of Stokes flow is."""
    moved = sp.predict(robot, model="sbt", beyond_stokes=True)
    speed, tail = 1e3 * moved.forward_velocity, moved.tail_rotation_rate / (2 * np.pi)
    body = moved.body_rotation_rate / (2 * np.pi)
    rows = [
        f"40,{length},2.5,{trial},{speed * trial},{tail * trial},{body * trial}"
        for length in (20, 25)
        for trial in (1, 2)
    ]
    path = folder / "observed.csv"
    head = "channel_diameter_mm,wavelength_mm,amplitude_mm,trial,forward_velocity_mm_s,tail_rate_Hz,body_rate_Hz"
    path.write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
    return path


ANSWERS: dict[str, Callable[[sp.Robot, Path], Any]] = {
    "predict": lambda robot, _: sp.predict(robot),
    "predict-sbt": lambda robot, _: sp.predict(robot, model="sbt"),
    "compare": lambda robot, _: sp.compare_models(robot, models=["sbt", "rft"]),
    "simulate-held": lambda robot, _: sp.simulate(robot, model="sbt", motion="held", **SHORT),
    "simulate-free": lambda robot, _: sp.simulate(robot, model="rft", **SHORT),
    "simulate-tube": lambda robot, _: sp.simulate(robot, model="tube", **SHORT),
    "flow": lambda robot, _: sp.flow(robot, model="slender", resolution={"accuracy": "standard"}),
    "plant": lambda robot, _: sp.Plant(robot),
    "held-plants": lambda robot, _: sp.AxialBatch(robot, model="sbt"),
    "linear": lambda robot, _: sp.linear_system(robot, model="sbt"),
    "fmu": lambda robot, folder: sp.export(robot, folder / "robot.fmu", model="sbt"),
    "design": lambda robot, _: sp.design(robot, RANGE, maximise="forward_velocity", model="sbt"),
    "calibrate": lambda robot, folder: sp.calibrate(_observed(robot, folder), robot, model="sbt", method="paper"),
}


def _warnings(answer: Any) -> str:
    if hasattr(answer, "attrs"):
        return str(answer.attrs["warnings"])
    if isinstance(answer, sp.ModelComparison):
        return "\n".join(said for one in answer.predictions.values() for said in one.warnings)
    return "\n".join(answer.warnings)


@pytest.mark.parametrize("name", ANSWERS)
def test_far_outside_stokes_flow_every_answer_is_refused(name: str, tmp_path: Path) -> None:
    with pytest.raises(sp.InputError, match=REFUSED):
        ANSWERS[name](WATER, tmp_path)


@pytest.mark.parametrize("name", ANSWERS)
def test_somewhat_outside_every_answer_warns(name: str, tmp_path: Path) -> None:
    assert "accurate: at most 0.1, because inertia is neglected" in _warnings(ANSWERS[name](OIL, tmp_path))


@pytest.mark.parametrize("name", ["predict-sbt", "simulate-held", "linear", "plant", "calibrate"])
def test_asked_for_it_answers_with_a_warning(name: str, tmp_path: Path) -> None:
    assert "inertia is neglected" in _warnings(ANSWERS[name](UNBOUND, tmp_path))


def test_robots_of_a_batch_are_refused_one_by_one_and_keep_their_reynolds_numbers() -> None:
    batch = sp.RobotBatch.of(WATER).with_values({"fluid.viscosity": np.array([1e-3, 1.0])})
    found = sp.swim(batch, "sbt", tail_rate=np.array([6.0, 6.0]))
    assert found.valid.tolist() == [False, True]
    assert np.isnan(found.forward_velocity[0])
    np.testing.assert_allclose(found.tail_reynolds_number, 985 * 6.0 * 2.5e-3**2 / np.array([1e-3, 1.0]), rtol=1e-12)


CAUTIONS = ("inertia", "outside-validity", "calibration-outside")


@pytest.mark.parametrize(
    ("field", "values", "model"),
    [
        ("fluid.viscosity", (3.0, 0.3), "rft"),
        ("tail.wire_diameter", (0.001, 0.004), "rft"),
        ("tail.length", (0.06, 0.02), "sbt"),
        ("channel.diameter", (0.04, np.inf), "sbt"),
        ("channel.diameter", (0.04, 0.2), "sbt"),
        ("body.diameter", (0.018, 0.014), "rft"),
    ],
)
def test_a_batch_has_the_cautions_of_its_robots_and_counts_them(
    field: str, values: tuple[float, float], model: str
) -> None:
    usual, value = values
    wall = {"channel": "none"} if value == np.inf else {field: f"{value} {'Pa s' if 'viscosity' in field else 'm'}"}
    predicted = sp.predict(sp.load("biorob2012-wide", **wall), model=model).warnings
    cautions = [note for note in predicted if note.code in CAUTIONS]
    assert cautions
    one = sp.RobotBatch.of(sp.load("biorob2012-wide"))
    alone = sp.swim(one.with_values({field: value}), model).warnings
    assert [note for note in alone if note.code in CAUTIONS] == cautions
    column = np.full(100_000, usual)
    column[[7, 70_000]] = value
    together = sp.swim(one.with_values({field: column}), model).warnings
    several = [note for note in together if note.code in CAUTIONS]
    assert several == [note.prefixed(f"2 of 100000 robots ({model}), the first: ") for note in cautions]
    assert [note.fields for note in several] == [note.fields for note in cautions]


def test_cautions_are_of_robots_that_have_an_answer() -> None:
    batch = sp.RobotBatch.of(sp.load("biorob2012-wide")).with_values({"tail.wire_diameter": [0.004, np.nan, 0.001]})
    assert any(note.startswith("1 of 3 robots (rft), the first: eps") for note in sp.swim(batch, "rft").warnings)


def test_a_study_names_the_robots_that_it_refuses() -> None:
    vary = {"fluid.viscosity": ["1 mPa s", "3 Pa s"]}
    found = sp.study({"models": ["sbt"], "friction": ["rotor"], "robots": ["biorob2012-wide"], "vary": vary})
    assert np.isnan(found["forward_velocity"].values).sum() == 1
    assert (
        "1 of 2 robots have no answer (sbt), the first: Reynolds number (body diameter) = " in found.attrs["warnings"]
    )


def test_the_rates_of_a_sweep_decide_and_not_the_robots_own() -> None:
    sweep = {"turns": 4.0, "model": "rft"}
    with pytest.raises(sp.InputError, match=r"^at a field of 5 Hz \(--rate\) Reynolds number"):
        sp.magnetic_sweep(HELIX, ["0.1 Hz", "5 Hz"], **sweep)
    with pytest.raises(sp.InputError, match=REFUSED):
        sp.predict(HELIX, model="rft")
    slow = sp.magnetic_sweep(HELIX, ["0.1 Hz"], **sweep)
    assert "at a field of 0.1 Hz Reynolds number (tail amplitude) = " in slow.attrs["warnings"]


def test_a_step_that_leaves_stokes_flow_is_not_taken() -> None:
    """In oil at a small duty, then at full duty; and in a flow."""
    thin = sp.load("biorob2012-wide", **{"fluid.viscosity": "50 mPa s", "drive.duty": 0.05})
    plant = sp.Plant(thin, model="rft")
    plant.step(0.05)
    before = plant.state
    with pytest.raises(sp.InputError, match=REFUSED):
        plant.step(0.5, duty=1.0)
    assert plant.state == before
    plants = sp.AxialBatch(thin, 3, model="sbt", ranges={"viscosity": (0.1, 1.0)})
    with pytest.raises(sp.InputError, match=REFUSED):
        plants.step(1.0, duty=1.0)
    assert not plants.states.any()
    with pytest.raises(sp.InputError, match=REFUSED):
        sp.predict("biorob2012-wide", placement={"flow": "2 m/s"}, tail_rate="1 Hz", band=False)
