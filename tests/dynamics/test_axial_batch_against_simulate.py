"""Batches in axial motion: runs of `simulate`, convergence of order 4, and draws that are robots of their own."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import posteriors
import spirillum as sp
from spirillum.kernels import core

WIDE = "biorob2012-wide"
IN_FLOW: dict[str, Any] = {"gap": "0.5 mm", "pitch": 0.0, "flow": 0.0}
LINEAR_CIRCUIT = {
    "motor": {"resistance": {"constant": "10 ohm", "decay": "0 ohm", "growth": "0 ohm", "slope": "0 ohm/A"}},
    "friction": {"effective": "2e-6 N m s/rad"},
}


@pytest.mark.parametrize("hand", ["right", "left"])
@pytest.mark.parametrize("dt", [0.1, 1 / 30, 0.005])
def test_steps_are_a_run_of_simulate(hand: str, dt: float) -> None:
    robot = sp.load(WIDE, **{"tail.handedness": hand, "friction.effective": "2e-6 N m s/rad"})
    run = sp.simulate(robot, model="rft", motion="held", timing={"duration": 0.6, "on": [(0.1, 0.3), (0.4, 0.6)]})
    robots = sp.AxialBatch(robot, 3, model="rft")
    for n in range(round(0.6 / dt)):
        time = (n + 0.5) * dt
        robots.step(dt, remote=0.1 < time < 0.3 or 0.4 < time < 0.6)
    for name, values in robots.observe().items():
        expected = run[name].values
        np.testing.assert_allclose(values, expected[-1], rtol=0, atol=1e-6 * np.abs(expected).max(), err_msg=name)


def integrated(p: np.ndarray, cycles: list[tuple[float, float]]) -> np.ndarray:
    """States after times at duties: (17) and its integrals by the Dormand-Prince method of order 8, to 1e-11."""

    def winding(i: float) -> float:
        bends = p[core.AXIAL_DECAY] * np.exp(-p[core.AXIAL_DECAY_RATE] * i) + p[core.AXIAL_GROWTH] * np.exp(
            p[core.AXIAL_GROWTH_RATE] * i
        )
        return float(p[core.AXIAL_CONSTANT] + bends + p[core.AXIAL_SLOPE] * i)

    def rates(_time: float, y: np.ndarray, duty: float) -> list[float]:
        i, torque, supply = abs(y[0]), p[core.AXIAL_TORQUE_CONSTANT] * y[0], p[core.AXIAL_POLARITY] * duty
        voltage = supply * (p[core.AXIAL_VOLTAGE] - p[core.AXIAL_INTERNAL_RESISTANCE] * i)
        emf = p[core.AXIAL_BACK_EMF] * (p[core.AXIAL_TAIL] - p[core.AXIAL_BODY]) * torque
        of_current = (voltage - winding(i) * y[0] - emf) / p[core.AXIAL_INDUCTANCE]
        path = [p[name] * torque for name in (core.AXIAL_SPEED, core.AXIAL_TAIL, core.AXIAL_BODY)]
        return [of_current, *path, supply * y[0], y[0] ** 2, winding(i) * y[0] ** 2]

    state = np.zeros(core.AXIAL_STATE_SIZE)
    for time, duty in cycles:
        found = solve_ivp(
            rates, (0, time), state, "DOP853", args=(duty,), rtol=1e-11, atol=1e-20, first_step=1e-4 * time
        )
        state = found.y[:, -1]
    return state


CYCLES = {
    "a camera's frame off": [(0.02, 1.0), (1 / 30, 0.0)] * 6,
    "short pulses": [(0.0053, 0.69), (0.0217, 0.0)] * 6,
    "long pulses": [(0.1, 1.0), (0.1, 0.0)] * 3,
    "half the duty": [(0.02, 0.5), (1 / 30, 0.0)] * 6,
    "between duties": [(0.04, 0.3), (1 / 30, 0.9)] * 6,
    "from rest": [(0.01, 1.0)],
}


@pytest.mark.parametrize("cycles", CYCLES.values(), ids=CYCLES.keys())
@pytest.mark.parametrize("robot", [WIDE, "biorob2012-narrow"])
def test_switched_drives_agree_with_an_accurate_integration(robot: str, cycles: list[tuple[float, float]]) -> None:
    """All that is documented as good to 1e-6: the current relative to that at full duty, the others to themselves."""
    robots = sp.AxialBatch(
        robot, 3, model="rft", ranges={"friction": (1 / 3, 3), "battery.voltage": (3.2, 4.2)}, seed=2
    )
    for time, duty in cycles:
        robots.step(time, duty=duty)
    for state, numbers in zip(robots.states, robots.numbers, strict=True):
        expected = integrated(numbers, cycles)
        np.testing.assert_allclose(state[1:], expected[1:], rtol=1e-6)
        assert state[0] == pytest.approx(expected[0], abs=1e-6 * integrated(numbers, [(0.1, 1.0)])[0])


@pytest.mark.parametrize("dt", [0.001, 0.02, 0.1, 1.0])
def test_linear_circuit_rises_exponentially(dt: float) -> None:
    robot = sp.load(WIDE, **LINEAR_CIRCUIT)
    robots, steady = sp.AxialBatch(robot, 1, model="rft"), sp.predict(robot, model="rft")
    resistance = 10.0 + 0.8 + 0.004 * steady.motor_rotation_rate / steady.motor_current
    robots.step(dt)
    rest, constant = 3.7 / resistance, 0.082 / resistance
    found, risen = robots.observe(), -np.expm1(-dt / constant)
    assert found["motor_current"][0] == pytest.approx(rest * risen, rel=1e-6)
    assert found["battery_charge_used"][0] == pytest.approx(rest * (dt - constant * risen), rel=1e-6)


def test_error_falls_with_the_fourth_power_of_the_pieces() -> None:
    robots = sp.AxialBatch(WIDE, 1, model="rft")
    charges = []
    for fineness in (0.5, 1.0, 2.0, 16.0):
        state = np.zeros((1, core.AXIAL_STATE_SIZE))
        core.advance_axial(robots.numbers, state, 1 / 30, np.ones(1), np.zeros(1), fineness)
        charges.append(state[0, core.AXIAL_STATE_CHARGE])
    errors = np.abs(np.array(charges[:3]) / charges[3] - 1.0)
    assert errors[1] < 3e-6
    assert np.all(np.log2(errors[:-1] / errors[1:]) > 3.5)


def test_drawn_robots_are_robots_of_their_own() -> None:
    """Twice the friction and 1.1 times the viscosity, by a factor and in the robot file; in a flow, too."""
    options: dict[str, Any] = {"model": "tube", "placement": IN_FLOW}
    drawn = sp.AxialBatch(WIDE, 1, ranges={"friction": (2, 2), "viscosity": (1.1, 1.1)}, **options)
    own = sp.load(WIDE)
    fields = {"friction.effective": "1.4e-6 N m s/rad", "fluid.viscosity": f"{1.1 * own.fluid.viscosity!r} Pa s"}
    np.testing.assert_allclose(drawn.numbers, sp.AxialBatch(sp.load(WIDE, **fields), 1, **options).numbers, rtol=1e-12)


def test_flow_carries_robots_as_predict_says() -> None:
    robots = sp.AxialBatch(WIDE, 2, model="tube", placement={**IN_FLOW, "flow": 1e-3})
    robots.step(1.0)
    steady = sp.predict(WIDE, model="tube", placement={**IN_FLOW, "flow": 1e-3})
    assert robots.observe()["forward_velocity"][0] == pytest.approx(steady.forward_velocity, rel=1e-6)
    robots.step(1.0, remote=[True, False], flow=[0.0, -1e-3])
    robots.step(1.0)
    after = robots.observe()["forward_velocity"]
    still = sp.predict(WIDE, model="tube", placement=IN_FLOW)
    assert after[0] == pytest.approx(still.forward_velocity, rel=1e-6)
    assert -1e-3 < after[1] < -0.8e-3


def test_ranges_are_kept_and_seeds_repeat() -> None:
    ranges = {"battery.voltage": (3.3, 3.7), "friction": (0.5, 2.0)}
    first, again, other = (sp.AxialBatch(WIDE, 200, model="rft", ranges=ranges, seed=seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first.numbers, again.numbers)
    assert not np.array_equal(first.numbers, other.numbers)
    voltage = first.numbers[:, core.AXIAL_VOLTAGE]
    assert 3.3 <= voltage.min() < 3.35
    assert 3.65 < voltage.max() <= 3.7
    first.step(0.1)
    first.reset(np.arange(200) < 50)
    assert not first.states[:50].any()
    assert np.all(first.states[50:, core.AXIAL_STATE_POSITION] > 0)


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ({"dt": 0.0}, r"dt = 0\.0; allowed: above 0"),
        ({"dt": float("nan")}, "dt = nan"),
        ({"dt": 0.1, "duty": float("nan")}, "duty = nan; allowed"),
        ({"dt": 0.1, "duty": 10**400}, "duty is no array"),
        ({"dt": 0.1, "duty": [0.0, 1.5]}, r"duty = 1\.5; allowed"),
        ({"dt": 0.1, "duty": [0.0, 1.0, 1.0]}, "no array of 2 numbers"),
        ({"dt": 0.1, "duty": 1.0, "remote": True}, "given together"),
        ({"dt": 0.1, "remote": "no"}, "remote = 'no'; allowed: True or False"),
        ({"dt": 0.1, "remote": [[True], [True, False]]}, "remote = "),
        ({"dt": 0.1, "flow": 1e-3}, "flow without one in the placement"),
    ],
)
def test_nothing_moves_on_wrong_input(arguments: dict[str, Any], sentence: str) -> None:
    robots = sp.AxialBatch(WIDE, 2, model="rft")
    with pytest.raises(sp.InputError, match=sentence):
        robots.step(**arguments)
    with pytest.raises(sp.InputError, match="which = "):
        robots.reset(np.ones(3, dtype=bool))
    with pytest.raises(sp.InputError, match="which = "):
        robots.redraw(np.ones(3, dtype=bool))
    assert not robots.states.any()


@pytest.mark.parametrize(
    ("ranges", "sentence"),
    [
        ({"voltage": (3, 4)}, r"ranges\.voltage is not a number that can be sampled"),
        ({"friction": (0, 1)}, "allowed: factors above 0"),
        ({"friction": (1, 10**400)}, "allowed: low and high"),
        ({"viscosity": (-1, 1)}, r"ranges\.viscosity = -1; allowed: factors above 0"),
        ({"battery.voltage": (-3, 4)}, r'ranges\.battery\.voltage = "-3.0 V" is out of range; allowed: 1e-6 V to'),
        ({"motor.inductance": (0, 1)}, r'ranges\.motor\.inductance = "0.0 H" is out of range; allowed: '),
        ({"motor.resistance.slope": (-90, 0)}, r"ranges with motor\.resistance\.slope = -90: .* no single steady"),
        ({"friction": (2, 1)}, "allowed: low and high"),
        ({"battery.voltage": 3.7}, "allowed: low and high"),
    ],
)
def test_wrong_ranges_are_a_sentence(ranges: dict[str, Any], sentence: str) -> None:
    with pytest.raises(sp.InputError, match=sentence):
        sp.AxialBatch(WIDE, 2, model="rft", ranges=ranges)
    with pytest.raises(sp.InputError, match="seed = -1; allowed: a whole number from 0"):
        sp.AxialBatch(WIDE, 2, model="rft", seed=-1)


def test_robots_of_a_posterior_are_those_of_predict(tmp_path: Path) -> None:
    """A posterior without width gives one robot, which `predict` gives too; one with width spreads around it."""
    about = posteriors.attributes()
    (friction,) = json.loads(about["friction"])
    sure = {**about, "friction": json.dumps([{**friction, "low": friction["value"], "high": friction["value"]}])}
    posteriors.write(tmp_path / "sure.nc", sure, np.full((4, 100), 2.0))
    robots = sp.AxialBatch(WIDE, 5, model="sbt", posterior=tmp_path / "sure.nc")
    robots.step(1.0)
    steady = sp.predict(WIDE, model="sbt", posterior=tmp_path / "sure.nc")
    np.testing.assert_allclose(robots.observe()["forward_velocity"], steady.forward_velocity, rtol=1e-6)
    posteriors.write(tmp_path / "wide.nc")
    ranges = {"battery.voltage": (3.7, 3.7)}
    many = sp.AxialBatch(WIDE, 300, model="sbt", posterior=tmp_path / "wide.nc", ranges=ranges, seed=1)
    many.step(1.0)
    speeds = many.observe()["forward_velocity"]
    assert len(np.unique(speeds)) > 100
    assert 0.005 < speeds.std() / speeds.mean() < 0.2
    assert np.all(many.numbers[:, core.AXIAL_VOLTAGE] == 3.7)


def test_earlier_name_still_works_with_a_warning() -> None:
    with pytest.warns(DeprecationWarning, match=r"spirillum\.HeldPlants is now spirillum\.AxialBatch"):
        assert sp.HeldPlants is sp.AxialBatch


def test_days_in_one_step_are_the_steady_state() -> None:
    """Explicit steps alone would be unstable, or be millions."""
    robots, steady = sp.AxialBatch(WIDE, 2, model="rft"), sp.predict(WIDE, model="rft")
    robots.step(1e6)
    assert robots.observe()["position"][0] == pytest.approx(1e6 * steady.forward_velocity, rel=1e-6)
