"""A drive of torque against rate: where its curve meets the load, the same in every answer, and refusals."""

import tomllib
from typing import Any

import numpy as np
import pytest

import spirillum as sp
from spirillum.kernels.core import curve_torques
from spirillum.robot.robot import robot_text
from spirillum.robot.tables import TorqueCurve
from spirillum.swimming.balance import packed_curve

WIDE = "biorob2012-wide"
RATES, TORQUES = ["0 Hz", "2 Hz", "5 Hz"], ["0.2 mN m", "0.18 mN m", "0 N m"]
CURVE = {"drive.kind": "torque-speed", "drive.rates": RATES, "drive.torques": TORQUES}


def with_curve(**more: Any) -> sp.Robot:
    """The paper's robot with a curve for its motor."""
    return sp.load(WIDE, **(CURVE | {"friction.reading": "none"} | more))


@pytest.mark.parametrize("duty", [1.0, 0.4, 0.0])
def test_curve_and_load_meet_where_a_dense_search_finds_them(duty: float) -> None:
    """On every piece: turned backwards, before and behind each knee, and driven beyond the last rate."""
    curve = TorqueCurve((0.0, 10.0, 11.0, 40.0), (3.0, 3.0, 1.0, 0.0), 1.0)
    coasting, per_torque = (a.ravel() for a in np.meshgrid(np.linspace(-30, 60, 31), [1e-3, 0.5, 3.0, 40.0]))
    torque = np.empty(coasting.size)
    curve_torques(packed_curve(curve), coasting, per_torque, duty, torque)
    rate = coasting + per_torque * torque
    level = np.interp(rate, curve.rates, curve.torques)  # level before the first point, as the curve is
    beyond = np.where(rate > 40.0, (rate - 40.0) * -1.0 / 29.0, 0.0)
    np.testing.assert_allclose(torque, duty * (level + beyond), atol=1e-13)


@pytest.mark.parametrize("polarity", ["forward", "reverse"])
@pytest.mark.parametrize("hand", ["right", "left"])
def test_steady_motor_is_on_its_curve(polarity: str, hand: str) -> None:
    found = sp.predict(with_curve(**{"drive.polarity": polarity, "tail.handedness": hand}), model="rft")
    sense = (1.0 if polarity == "forward" else -1.0) * (1.0 if hand == "right" else -1.0)
    rate = sense * found.motor_rotation_rate / (2 * np.pi)
    assert sense * found.drive_torque == pytest.approx(1e-3 * np.interp(rate, [0, 2, 5], [0.2, 0.18, 0]), rel=1e-12)
    assert found.forward_velocity * (1.0 if polarity == "forward" else -1.0) > 0


def test_a_level_curve_is_a_torque_and_a_steep_one_a_rate() -> None:
    wide = {"drive.rates": ["0 Hz", "50 Hz", "60 Hz"], "drive.torques": ["0.1 mN m", "0.1 mN m", "0 N m"]}
    level = sp.predict(
        with_curve(**wide),
        model="rft",
    )
    given = {"drive.kind": "torque", "drive.torque": "0.1 mN m", "friction.reading": "none"}
    torque = sp.predict(sp.load(WIDE, **given), model="rft")
    assert level.forward_velocity == pytest.approx(torque.forward_velocity, rel=1e-12)
    steep = {"drive.rates": ["0 Hz", "1.2 Hz", "1.2000001 Hz"], "drive.torques": ["1 N m", "1 N m", "0 N m"]}
    found = sp.predict(with_curve(**steep), model="rft")
    assert found.motor_rotation_rate == pytest.approx(2 * np.pi * 1.2, rel=1e-6)


@pytest.mark.parametrize("model", ["slender", "tube"])
def test_a_released_robot_turns_at_the_steady_rate(model: str) -> None:
    """The links on their way are on the curve at every sample, and at first as `predict` says where nothing is near."""
    run = sp.simulate(with_curve(), model=model, motion="free", timing={"duration": 0.3})
    torque, rate = run["drive_torque"].values, run["motor_rotation_rate"].values / (2 * np.pi)
    np.testing.assert_allclose(torque, 1e-3 * np.interp(rate, [0, 2, 5], [0.2, 0.18, 0]), rtol=1e-9)
    if model == "slender":
        steady = sp.predict(with_curve(), model=model)
        assert rate[-1] * 2 * np.pi == pytest.approx(steady.motor_rotation_rate, rel=0.02)


def test_a_plant_follows_its_run_and_coasts_without_the_drive() -> None:
    plant = sp.Plant(with_curve(), model="slender")
    for _ in range(3):
        moment = plant.step(0.1)
    run = sp.simulate(with_curve(), model="slender", motion="free", timing={"duration": 0.3})
    assert moment.values["tail_rotation_rate"] == pytest.approx(float(run["tail_rotation_rate"][-1]), rel=1e-9)
    assert plant.step(0.01, remote=False).values["drive_torque"] == 0.0


def test_a_file_gives_the_curve_back() -> None:
    robot = with_curve()
    text = robot_text(robot)
    assert 'rates = ["0 Hz", "2 Hz", "5 Hz"]' in text
    assert sp.load(tomllib.loads(text)) == robot


def test_a_curve_is_shown_in_the_units_of_people(run: Any, tmp_path: Any) -> None:
    (tmp_path / "r.toml").write_text(robot_text(with_curve()))
    shown = run("robot", "show", str(tmp_path / "r.toml")).out
    assert "0, 2, 5" in shown
    assert "0.2, 0.18, 0" in shown


@pytest.mark.parametrize(
    ("fields", "sentence"),
    [
        ({"drive.rates": ["0 Hz", "2 Hz"]}, "drive.rates has 2 and drive.torques has 3 values"),
        ({"drive.rates": ["1 Hz", "2 Hz", "3 Hz"]}, "drive.rates must increase from 0"),
        ({"drive.rates": ["0 Hz", "3 Hz", "3 Hz"]}, "drive.rates must increase from 0"),
        ({"drive.torques": ["1 mN m", "2 mN m", "0 N m"]}, "drive.torques must fall"),
        ({"drive.torques": ["1 mN m", "0.5 mN m", "0.1 mN m"]}, "drive.torques must fall"),
        ({"drive.rates": [0, 1, 2]}, "has no unit"),
        ({"drive.rates": ["0 Hz", "nan Hz", "3 Hz"]}, "rates"),
        ({"drive.joint": "fixed"}, "drive.joint = 'fixed' with drive.kind = 'torque-speed'"),
        ({"drive.duty": 0.5}, "only for 'dc-motor'"),
        ({"drive.kind": "dc-motor"}, "exactly when drive.kind = 'torque-speed'"),
    ],
)
def test_wrong_curves_are_a_sentence(fields: dict[str, Any], sentence: str) -> None:
    with pytest.raises(sp.InputError) as caught:
        sp.load(WIDE, **(CURVE | fields))
    assert sentence in str(caught.value)


@pytest.mark.parametrize("hand", ["right", "left"])
def test_axial_motion_is_that_of_the_steady_states(hand: str) -> None:
    """A run, a batch and its switching: the torque follows the duty at once."""
    robot = with_curve(**{"tail.handedness": hand})
    steady = sp.predict(robot, model="rft")
    run = sp.simulate(robot, model="rft", motion="held", timing={"duration": 2.0, "on": [(0.0, 0.5)]})
    assert float(run.position[-1]) == pytest.approx(0.5 * steady.forward_velocity, rel=1e-9)
    assert float(run.drive_torque[0]) == pytest.approx(steady.drive_torque, rel=1e-12)
    assert float(run.dissipated_energy[-1]) == pytest.approx(0.5 * steady.dissipated_power, rel=1e-9)
    assert not {"motor_current", "electrical_energy", "battery_voltage"} & set(run.data_vars)
    batch = sp.AxialBatch(robot, 4, model="rft", ranges={"viscosity": (1.0, 5.0)}, seed=3)
    batch.step(0.5)
    found = batch.observe()
    factor = batch._viscosity
    for n in range(4):
        thick = with_curve(
            **{"tail.handedness": hand, "fluid.viscosity": f"{float(robot.fluid.viscosity * factor[n])!r} Pa s"}
        )
        one = sp.predict(thick, model="rft")
        for name in ("forward_velocity", "tail_rotation_rate", "body_rotation_rate", "drive_torque"):
            assert found[name][n] == pytest.approx(getattr(one, name), rel=1e-9), name
    batch.step(1.0, remote=False)
    assert batch.observe()["position"] == pytest.approx(found["position"], rel=1e-12)
    with pytest.raises(sp.InputError, match=r"ranges\.battery\.voltage is not a number that can be sampled"):
        sp.AxialBatch(robot, 2, model="rft", ranges={"battery.voltage": (1.0, 2.0)})


def test_speed_of_ecoli_against_viscosity_misses_the_measured_decay_as_stated() -> None:
    """Measured (V. A. Martinez et al., PNAS 111:17771, 2014): 0.84, 0.66 and 0.34 at 1.8, 4 and 12 times the viscosity.

    The preset's motor turns at 136 Hz in buffer, below its knee: more viscosity finds almost the same torque.
    """
    ratio = {}
    buffer = sp.predict("ecoli", model="slender")
    assert abs(buffer.motor_rotation_rate) / (2 * np.pi) == pytest.approx(136, rel=0.05)
    for factor in (1.8, 4.0, 12.0):
        thick = sp.predict(sp.load("ecoli", **{"fluid.viscosity": f"{0.93 * factor} mPa s"}), model="slender")
        ratio[factor] = thick.forward_velocity / buffer.forward_velocity
        assert 1.0 < ratio[factor] * factor < 1.1
    assert list(ratio.values()) == pytest.approx([0.57, 0.27, 0.09], abs=0.02)


def test_the_curve_of_a_preset_can_be_unset() -> None:
    other = {"drive.kind": "rate", "drive.rate": "100 Hz", "drive.rates": "none", "drive.torques": "none"}
    drive = sp.load("ecoli", **other).drive
    assert drive is not None
    assert (drive.kind, drive.curve) == ("rate", None)
