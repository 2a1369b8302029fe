"""The motor's transient: energy balance, the closed form of a linear circuit, and the steady state."""

from typing import Any

import numpy as np
import pytest

import spirillum as sp


def held(robot: Any, **options: Any) -> Any:
    """Two degrees of freedom, by the model that knows the axial entries only unless another is asked for."""
    return sp.simulate(robot, motion="held", **{"model": "sbt", **options})


LINEAR_CIRCUIT = {
    "motor": {"resistance": {"constant": "10 ohm", "decay": "0 ohm", "growth": "0 ohm", "slope": "0 ohm/A"}},
    "friction": {"effective": "2e-6 N m s/rad"},
}
ENERGIES = (
    "resistive_energy",
    "magnetic_energy",
    "conversion_energy",
    "friction_energy",
    "dissipated_energy",
)


@pytest.mark.parametrize("reading", ["none", "rotor", "body", "paper"])
@pytest.mark.parametrize("hand", ["right", "left"])
@pytest.mark.parametrize("model", ["sbt", "rft"])
def test_energy_is_balanced_at_every_sample(reading: str, hand: str, model: str) -> None:
    robot = sp.load("biorob2012-narrow", **{"tail.handedness": hand, "drive.duty": 0.7})
    run = held(robot, model=model, friction=reading, timing={"on": [(0.0, 0.1), (0.15, 1.0)]})
    spent = sum(run[name] for name in ENERGIES)
    scale = float(run["electrical_energy"][-1])
    assert scale > 0
    np.testing.assert_allclose(run["electrical_energy"] / scale, spent / scale, atol=1e-8)


def test_energies_are_the_integrals_of_their_powers() -> None:
    run = held("biorob2012-wide", model="rft", timing={"duration": "0.05 s", "samples_per_turn": 10_000})
    for name in ("electrical", "friction", "dissipated"):
        power, time = run[f"{name}_power"].values, run["time"].values
        integral = np.sum(0.5 * (power[1:] + power[:-1]) * np.diff(time))
        assert integral == pytest.approx(float(run[f"{name}_energy"][-1]), rel=1e-5)


def test_linear_circuit_rises_exponentially() -> None:
    """With constant R, L dI/dt = V - (R + r + K_b K_m dw/dtau) I has a closed form."""
    robot = sp.load("biorob2012-wide", **LINEAR_CIRCUIT)
    run = held(robot, model="rft", timing={"duration": "0.05 s", "samples_per_turn": 1000})
    steady = sp.predict(robot, model="rft")
    rate_per_current = steady.motor_rotation_rate / steady.motor_current
    resistance = 10.0 + 0.8 + 0.004 * rate_per_current
    expected = 3.7 / resistance * (1.0 - np.exp(-run["time"].values * resistance / 0.082))
    np.testing.assert_allclose(run["motor_current"].values, expected, atol=1e-8)


@pytest.mark.parametrize("model", ["sbt", "rft"])
def test_average_over_the_last_two_of_three_turns_is_the_steady_state(model: str) -> None:
    """The electrical transient lasts milliseconds, so that the paper's averages are steady values."""
    run, steady = held("biorob2012-wide", model=model), sp.predict("biorob2012-wide", model=model)
    assert float(run["mean_forward_velocity"]) == pytest.approx(steady.forward_velocity, rel=1e-7)
    assert float(run["mean_tail_rotation_rate"]) == pytest.approx(steady.tail_rotation_rate, rel=1e-7)
    assert float(run["mean_body_rotation_rate"]) == pytest.approx(steady.body_rotation_rate, rel=1e-7)
    turns = float(run["tail_angle"][-1]) / (2 * np.pi)
    assert 2.9 < turns < 3.0


@pytest.mark.parametrize(
    "timing", [{}, {"duration": "0.5 s", "on": [(0.0, 0.11), (0.2, 0.43)]}], ids=["paper", "pulses"]
)
@pytest.mark.parametrize("hand", ["right", "left"])
def test_paper_s_adams_moulton_steps_give_the_same_run(timing: dict[str, Any], hand: str) -> None:
    """To 1e-7 of the largest value of every quantity, by default over the paper's three periods."""
    from spirillum.dynamics.timing import Timing
    from spirillum.papers.biorob2012.transient import paper_run

    robot = sp.load("biorob2012-wide", **{"tail.handedness": hand, "drive.duty": 0.8})
    ours, theirs = held(robot, model="rft", timing=timing), paper_run(sp.predict(robot, model="rft"), Timing.of(timing))
    assert "Adams" in theirs.attrs["integrator"]
    for name, values in ours.data_vars.items():
        expected = theirs[name].values
        np.testing.assert_allclose(values, expected, rtol=0, atol=1e-7 * np.abs(expected).max(), err_msg=str(name))


def test_long_run_is_the_steady_state_for_hours() -> None:
    """Four hours have two million time constants of the motor, and take no more steps than their samples."""
    run, steady = (
        held("biorob2012-wide", timing={"duration": "4 hours", "samples_per_turn": 1}),
        sp.predict("biorob2012-wide", model="sbt"),
    )
    assert float(run["position"][-1]) == pytest.approx(4 * 3600.0 * steady.forward_velocity, rel=1e-6)


def test_walls_hold_it_where_it_is_placed() -> None:
    """After some time constants a held run is what `predict` says at the same place."""
    there = {"gap": "0.2 mm", "pitch": "0 deg"}
    run = held("biorob2012-wide", model="tube", placement=there, timing={"duration": "1 s"})
    steady = sp.predict("biorob2012-wide", model="tube", placement=there)
    assert float(run["forward_velocity"][-1]) == pytest.approx(steady.forward_velocity, rel=1e-6)
    with pytest.raises(sp.InputError, match=r"a placement is given with motion = 'held'; .* or model 'tube'"):
        held("biorob2012-wide", model="rft", placement=there)


def test_left_handed_robot_is_the_mirror_image() -> None:
    right = held("biorob2012-wide", timing={"duration": "0.1 s"})
    left = held(sp.load("biorob2012-wide", **{"tail.handedness": "left"}), timing={"duration": "0.1 s"})
    np.testing.assert_allclose(left["position"], right["position"], rtol=1e-12)
    for name in ("tail_angle", "body_angle", "motor_current", "motor_torque"):
        np.testing.assert_allclose(left[name], -right[name], rtol=1e-12)


def test_switching_off_stops_the_robot() -> None:
    run = held("biorob2012-wide", timing={"duration": "1 s", "on": [(0.0, 0.4)]})
    late = run.sel(time=slice(0.6, None))
    assert float(abs(late["motor_current"]).max()) < 1e-9
    assert float(late["position"][-1] - late["position"][0]) == pytest.approx(0.0, abs=1e-12)
    assert float(run["position"][-1]) > 0


@pytest.mark.parametrize("ulps", [-1, 0, 1, 3])
@pytest.mark.parametrize("share", [1 / 3, 0.5, 0.1, 0.7])
def test_switching_off_at_a_sample_but_for_rounding(share: float, ulps: int) -> None:
    """A circuit of constant resistance charges and decays exponentially, however switch and samples are rounded."""
    robot = sp.load("biorob2012-wide", **LINEAR_CIRCUIT)
    steady = sp.predict(robot, model="rft")
    emf = 0.004 * steady.motor_rotation_rate / steady.motor_current
    on, off = (10.8 + emf) / 0.082, (10.0 + emf) / 0.082  # no battery is in the circuit while it is off
    for duration in (0.3, 0.9, 1.8):
        switch = duration * share + ulps * np.spacing(duration * share)
        run = held(robot, model="rft", timing={"duration": duration, "on": [(0.0, switch)]})
        time = run["time"].values
        at_switch = 3.7 / (10.8 + emf) * (1.0 - np.exp(-on * switch))
        expected = np.where(
            time <= switch,
            3.7 / (10.8 + emf) * (1.0 - np.exp(-on * time)),
            at_switch * np.exp(-off * np.maximum(time - switch, 0.0)),
        )
        np.testing.assert_allclose(run["motor_current"].values, expected, atol=1e-8)
        np.testing.assert_array_equal(run["duty"].values, time <= switch)


def test_pause_of_a_rounding_error_is_none() -> None:
    whole = held("biorob2012-wide", timing={"duration": 1.8})
    cut = held("biorob2012-wide", timing={"duration": 1.8, "on": [(0.0, 0.9), (0.9000000000000001, 1.8)]})
    np.testing.assert_allclose(cut["motor_current"], whole["motor_current"], atol=1e-8)


def test_battery_gives_duty_times_the_motor_current() -> None:
    half = held(sp.load("biorob2012-wide", **{"drive.duty": 0.5}), timing={"duration": "0.5 s"})
    charge = np.trapezoid(0.5 * half["motor_current"].values, half["time"].values)
    assert float(half["battery_charge_used"][-1]) == pytest.approx(charge, rel=1e-3)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"timing": {"turns": 0.0}}, "turns = 0.0"),
        ({"timing": {"turns": float("nan")}}, "turns = nan"),
        ({"timing": {"duration": "2 m"}}, "duration"),
        ({"timing": {"duration": "0 s"}}, "duration = 0"),
        ({"timing": {"on": [(1.0, 0.5)]}}, "on = 1 s to 0.5 s"),
        ({"timing": {"on": [(0.0, 1.0), (0.5, 2.0)]}}, "on = 0.5 s to 2 s"),
        ({"timing": {"on": [(float("nan"), 1.0)]}}, 'on = "nan s"'),
        ({"timing": {"samples_per_turn": 0}}, "samples_per_turn"),
        ({"timing": {"turns": 1e5, "samples_per_turn": 10_000}}, "samples_per_turn"),
        ({"timing": {"duration": "1e6 s", "samples_per_turn": 1}}, "samples_per_turn = 1 makes"),
    ],
)
def test_wrong_runs_are_refused(options: dict[str, object], words: str) -> None:
    with pytest.raises(sp.InputError, match="allowed") as caught:
        held("biorob2012-wide", **options)
    assert words in str(caught.value)


def test_switching_times_are_quantities_too() -> None:
    in_words = held("biorob2012-wide", timing={"duration": "0.2 s", "on": [("0 s", "100 ms")]})
    in_seconds = held("biorob2012-wide", timing={"duration": 0.2, "on": [(0.0, 0.1)]})
    assert in_words.identical(in_seconds)
    assert in_words.attrs["switches"] == "duty 1 from 0 s, duty 0 from 0.1 s"


def test_only_a_motor_has_a_transient() -> None:
    robot = sp.load("biorob2012-wide", drive={"kind": "rate", "rate": "1 Hz"})
    with pytest.raises(sp.InputError, match="dc-motor"):
        held(robot)


def test_accuracy_reaches_the_model_and_its_error_the_dataset() -> None:
    settings = {"model": "slender", "timing": {"duration": "1 s"}}
    standard, high = (
        held("biorob2012-wide", resolution={"accuracy": accuracy}, **settings) for accuracy in ("standard", "high")
    )
    for dataset, accuracy in ((standard, "standard"), (high, "high")):
        alone = sp.predict("biorob2012-wide", model="slender", resolution={"accuracy": accuracy})
        assert dataset.attrs["error_estimate"] == alone.error_estimate
        assert dataset.attrs["known_error"] == alone.to_dict()["error_estimate"]["statement"]
    assert float(standard["mean_forward_velocity"]) != float(high["mean_forward_velocity"])
