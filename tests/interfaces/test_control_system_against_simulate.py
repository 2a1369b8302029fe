"""The system of python-control against `simulate`, `predict`, and the library's own linearisation."""

from typing import Any

import numpy as np
import pytest

import spirillum as sp
from spirillum.quantities import QUANTITIES

control: Any = pytest.importorskip("control")

FINE = {"solve_ivp_kwargs": {"rtol": 1e-9, "atol": 1e-12}}
WIDE = "biorob2012-wide"


def outputs_of(system: Any, response: Any) -> dict[str, np.ndarray]:
    return dict(zip(system.output_labels, response.outputs, strict=True))


@pytest.mark.parametrize("reading", ["none", "rotor", "body", "paper"])
@pytest.mark.parametrize("hand", ["right", "left"])
def test_responses_are_runs_of_simulate(reading: str, hand: str) -> None:
    robot = sp.load(WIDE, **{"tail.handedness": hand, "drive.duty": 0.7})
    run = sp.simulate(robot, model="rft", motion="held", friction=reading, timing={"duration": 0.2})
    system = sp.control_system(robot, model="rft", friction=reading)
    time = run["time"].values
    found = outputs_of(system, control.input_output_response(system, time, np.full_like(time, 0.7), **FINE))
    for name, values in found.items():
        expected = run[name].values
        np.testing.assert_allclose(values, expected, atol=1e-6 * np.abs(expected).max(), rtol=0, err_msg=name)


def test_switching_off_and_on_is_a_run_of_simulate() -> None:
    """Two responses, the second from where the first one ends: an input between samples is a ramp in python-control."""
    run = sp.simulate(WIDE, model="rft", motion="held", timing={"duration": 0.2, "on": [(0.0, 0.1)]})
    system = sp.control_system(WIDE, model="rft")
    state: Any = 0.0
    for start, stop, duty in ((0.0, 0.1, 1.0), (0.1, 0.2, 0.0)):
        time = np.linspace(start, stop, 11)
        response = control.input_output_response(system, time, np.full(11, duty), state, **FINE)
        state = response.states[:, -1]
    for name, value in zip(system.state_labels, state, strict=True):
        scale = float(np.abs(run[name]).max())
        assert value == pytest.approx(float(run[name][-1]), abs=1e-6 * scale), name


@pytest.mark.parametrize("flow", [0.0, 1e-3, -2e-3])
def test_steady_motion_in_an_imposed_flow_is_that_of_predict(flow: float) -> None:
    steady = sp.predict(WIDE, model="tube", placement={"gap": "0.5 mm", "pitch": 0.0, "flow": flow})
    found = sp.linear_system(WIDE, model="tube", placement={"gap": "0.5 mm", "pitch": 0.0, "flow": flow})
    assert found.inputs == {"duty": 1.0, "mean_flow": flow}
    for name in ("forward_velocity", "tail_rotation_rate", "body_rotation_rate", "motor_current", "battery_voltage"):
        assert found.outputs[name] == pytest.approx(getattr(steady, name), rel=1e-7), name


@pytest.mark.parametrize("hand", ["right", "left"])
def test_linearisation_is_that_of_the_library(hand: str) -> None:
    robot = sp.load(WIDE, **{"tail.handedness": hand})
    placed = {"gap": "0.5 mm", "pitch": 0.0, "flow": 0.0}
    system = sp.control_system(robot, model="tube", placement=placed)
    point = sp.linear_system(robot, model="tube", placement=placed, duty=0.4, flow="0.5 mm/s")
    state = [point.outputs["motor_current"], 0.0, 0.0, 0.0, 0.0]
    differences = control.linearize(system, state, [0.4, 0.5e-3])
    for name in "ABCD":
        ours, theirs = getattr(point.system, name), getattr(differences, name)
        np.testing.assert_allclose(ours, theirs, atol=1e-5 * max(1e-9, np.abs(theirs).max()), err_msg=name)
    assert point.system.A[0, 0] == pytest.approx(-1.0 / point.time_constant)
    assert system.updfcn(0.0, np.array(state), np.array([0.4, 0.5e-3]), system.params)[0] == pytest.approx(
        0.0, abs=1e-9
    )


def test_duty_saturates_as_the_drive_does() -> None:
    system = sp.control_system(WIDE, model="rft")
    time = np.linspace(0.0, 0.05, 6)
    full, more = (control.input_output_response(system, time, np.full(6, duty), **FINE) for duty in (1.0, 3.0))
    np.testing.assert_array_equal(full.outputs, more.outputs)


def test_signals_are_quantities_of_the_registry() -> None:
    system = sp.control_system(WIDE, model="rft")
    assert {*system.input_labels, *system.state_labels, *system.output_labels} <= set(QUANTITIES)


def test_wrong_input_is_a_sentence() -> None:
    system = sp.control_system(WIDE, model="rft")
    with pytest.raises(sp.InputError, match="duty = nan; allowed: a number"):
        control.input_output_response(system, [0.0, 0.1], [np.nan, np.nan])
    with pytest.raises(sp.InputError, match=r"drive\.kind = 'rate'"):
        sp.control_system(sp.load(WIDE, drive={"kind": "rate", "rate": "1 Hz"}), model="rft")
    with pytest.raises(sp.InputError, match=r"duty = 1\.5; allowed"):
        sp.linear_system(WIDE, model="rft", duty=1.5)
    with pytest.raises(sp.InputError, match="without one in the placement"):
        sp.linear_system(WIDE, model="rft", flow=1e-3)


@pytest.mark.parametrize("reverse", [False, True])
def test_a_motor_with_a_curve_is_that_of_simulate_and_predict(reverse: bool) -> None:
    curve = {"drive.rates": ["0 Hz", "2 Hz", "5 Hz"], "drive.torques": ["0.2 mN m", "0.18 mN m", "0 N m"]}
    polarity = {"drive.polarity": "reverse"} if reverse else {}
    robot = sp.load(WIDE, **{"drive.kind": "torque-speed", "friction.reading": "none"}, **curve, **polarity)
    run = sp.simulate(robot, model="rft", motion="held", timing={"duration": 0.2})
    system = sp.control_system(robot, model="rft")
    time = run["time"].values
    found = outputs_of(system, control.input_output_response(system, time, np.ones_like(time), **FINE))
    for name, values in found.items():
        expected = run[name].values
        np.testing.assert_allclose(values, expected, atol=1e-6 * np.abs(expected).max(), rtol=0, err_msg=name)
    placed = {"gap": "0.5 mm", "pitch": 0.0, "flow": 1e-3}
    steady = sp.predict(robot, model="tube", placement=placed)
    at = sp.linear_system(robot, model="tube", placement=placed)
    for name in ("forward_velocity", "tail_rotation_rate", "drive_torque"):
        assert at.outputs[name] == pytest.approx(getattr(steady, name), rel=1e-7), name
    at = sp.linear_system(robot, model="tube", placement=placed, duty=0.8)
    whole = sp.control_system(robot, model="tube", placement=placed).linearize([0.0] * 3, [0.8, 1e-3], eps=1e-7)
    for name in ("A", "B", "C", "D"):
        own, other = getattr(at.system, name), getattr(whole, name)
        np.testing.assert_allclose(own, other, atol=1e-5 * max(np.abs(other).max(), 1e-12), err_msg=name)
