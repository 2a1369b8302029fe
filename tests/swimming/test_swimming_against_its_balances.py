"""Steady swimming against the balances of force, torque and energy, for every drive and friction model.

The balances are written out here from the unknowns (U, Omega, omega, tau), the model's axial matrix and the friction
torques of each reading; nothing is taken from the code that eliminates the speed and solves for the rates.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from spirillum.fluid.closed.perrin import body_axial
from spirillum.fluid.registry import find_swimmer_model
from spirillum.swimming.balance import battery_voltage, winding_resistance
from spirillum.swimming.motions import STEADY
from spirillum.swimming.steady import swim
from spirillum.units import Hz

K_M, K_B, B_M = 0.00045, 0.004, 7e-7  # Table II
MODELS = ["sbt", "rft"]
READINGS = ["none", "rotor", "body", "paper"]
HANDS = [("right", "forward"), ("left", "forward"), ("right", "reverse"), ("left", "reverse")]
RATE = np.array([1.7 * Hz])


def calibrated_axial(batch: Any, model: str) -> np.ndarray:
    """The model's 4x4 with Table III's factors on the body's isolated drag."""
    r = np.array(find_swimmer_model(model).axial(batch)[0])
    factors, (drag, rotation) = batch.calibration[model], body_axial(batch)
    r[0, 0] += (factors.body_drag[0] - 1) * drag[0]
    r[1, 1] += (factors.body_rotation[0] - 1) * rotation[0]
    return r


def friction_on(reading: str, effective: float, body_rate: float, tail_rate: float) -> tuple[float, float]:
    """(T_r, T_b): torque of friction on rotor and body."""
    slip = tail_rate - body_rate
    return {
        "none": (0.0, 0.0),
        "rotor": (-effective * slip, effective * slip),
        "body": (-B_M * slip, B_M * slip - effective * body_rate),
        "paper": (-effective * slip, 0.0),
    }[reading]


def first(swimming: Any, name: str) -> float:
    return float(getattr(swimming, name)[0])


@pytest.mark.parametrize(("hand", "polarity"), HANDS)
@pytest.mark.parametrize("reading", READINGS)
@pytest.mark.parametrize("model", MODELS)
def test_motor_drives_force_and_torque_free(
    batch_of: Callable[..., Any], model: str, reading: str, hand: str, polarity: str
) -> None:
    batch = batch_of(tail__handedness=hand, motor__polarity=polarity, friction__effective="1.3e-5 N m s/rad")
    s = swim(batch, model, friction=reading)
    assert s.valid[0]
    U, Omega, omega = (first(s, f"{name}") for name in ("forward_velocity", "body_rotation_rate", "tail_rotation_rate"))
    current, effective = first(s, "motor_current"), 0.0 if reading == "none" else 1.3e-5
    force_torque = calibrated_axial(batch, model) @ [U, Omega, U, omega]
    T_r, T_b = friction_on(reading, effective, Omega, omega)
    tau = K_M * current
    size = abs(tau)
    assert force_torque[0] + force_torque[2] == pytest.approx(0, abs=1e-12 * abs(force_torque[0]))
    assert force_torque[3] == pytest.approx(tau + T_r, abs=1e-12 * size)
    assert force_torque[1] == pytest.approx(-tau + T_b, abs=1e-12 * size)
    # (17) at full throttle, and (18) for the readings that share it.
    i, slip = abs(current), omega - Omega
    R, V = 10.4 + 30 * np.exp(-54.6 * i) + np.exp(i) - 1.555 * i, 3.7 - 0.8 * i
    assert R * i == pytest.approx(V - K_B * abs(slip), rel=1e-12)
    if reading in ("rotor", "paper"):
        T_h = first(s, "tail_torque")
        assert (1.3e-5 + K_B * K_M / R) * abs(slip) == pytest.approx(V * K_M / R - T_h, rel=1e-11)
    assert first(s, "motor_rotation_rate") == pytest.approx(slip, rel=1e-14)
    # Signs: forward is forward for either hand, and the body turns against the tail.
    forward = 1 if polarity == "forward" else -1
    turns = forward * (1 if hand == "right" else -1)
    assert np.sign([U, omega, Omega, slip, current]).tolist() == [forward, turns, -turns, turns, turns]
    assert abs(slip) > abs(omega)


@pytest.mark.parametrize(("hand", "polarity"), HANDS)
@pytest.mark.parametrize("reading", ["rotor", "paper"])
@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("effective", [7e-7, 9e-6, 4e-5])
def test_observed_rates_give_the_friction_back(
    batch_of: Callable[..., Any], model: str, reading: str, hand: str, polarity: str, effective: float
) -> None:
    batch = batch_of(tail__handedness=hand, motor__polarity=polarity, friction__effective=f"{effective} N m s/rad")
    forward = swim(batch, model, friction=reading)
    observed = batch.with_values({"friction.effective": np.nan})
    for rates in (
        {"tail_rate": forward.tail_rotation_rate},
        {"motor_rate": forward.motor_rotation_rate},
        {"tail_rate": forward.tail_rotation_rate, "motor_rate": forward.motor_rotation_rate},
    ):
        back = swim(observed, model, friction=reading, **rates)
        assert first(back, "effective_friction") == pytest.approx(effective, rel=1e-9)
        for name in ("forward_velocity", "tail_rotation_rate", "body_rotation_rate", "motor_current", "tail_torque"):
            assert first(back, name) == pytest.approx(first(forward, name), rel=1e-9), name


@pytest.mark.parametrize(("hand", "polarity"), HANDS)
@pytest.mark.parametrize("model", MODELS)
def test_observed_rates_leave_no_residual_where_the_wall_holds_the_body(
    batch_of: Callable[..., Any], model: str, hand: str, polarity: str
) -> None:
    """Reading `body`: (18) cannot find the wall's coefficient, but with the right one the motor is explained."""
    batch = batch_of(tail__handedness=hand, motor__polarity=polarity, friction__effective="2e-5 N m s/rad")
    forward = swim(batch, model, friction="body")
    back = swim(batch, model, friction="body", tail_rate=forward.tail_rotation_rate)
    torque = K_M * abs(first(forward, "motor_current"))
    assert first(back, "motor_residual_torque") == pytest.approx(0, abs=1e-10 * torque)
    assert first(back, "body_rotation_rate") == pytest.approx(first(forward, "body_rotation_rate"), rel=1e-10)
    wrong = swim(batch, model, friction="body", tail_rate=0.8 * forward.tail_rotation_rate)
    assert abs(first(wrong, "motor_residual_torque")) > 1e-2 * torque


@pytest.mark.parametrize("hand", ["right", "left"])
@pytest.mark.parametrize("reading", READINGS)
@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("given_rate", ["no rate", "tail rate", "motor rate"])
def test_energy(batch_of: Callable[..., Any], model: str, reading: str, hand: str, given_rate: str) -> None:
    """Electrical power = R I^2 + (K_b - K_m) omega_m I + friction + dissipation (+ torque that is left unexplained)."""
    batch = batch_of(tail__handedness=hand, friction__effective="8e-6 N m s/rad", drive__duty=0.8)
    rate = RATE if hand == "right" else -RATE
    rates = {"no rate": {}, "tail rate": {"tail_rate": rate}, "motor rate": {"motor_rate": rate}}[given_rate]
    s = swim(batch, model, friction=reading, **rates)
    i, slip = first(s, "motor_current"), first(s, "motor_rotation_rate")
    winding = winding_resistance(batch.electrics, s.motor_current)[0] * i**2
    residual = first(s, "motor_residual_torque")
    unexplained = 0.0 if np.isnan(residual) else residual * slip
    losses = winding + (K_B - K_M) * slip * i + first(s, "friction_power") + first(s, "dissipated_power") + unexplained
    assert first(s, "electrical_power") == pytest.approx(losses, rel=1e-10)
    assert first(s, "electrical_power") == pytest.approx(0.8 * abs(i) * first(s, "battery_voltage"), rel=1e-12)
    assert first(s, "battery_voltage") == pytest.approx(3.7 - 0.8 * abs(i), rel=1e-12)
    # Dissipation is the quadratic form of the resistance matrix.
    twists = np.array([first(s, name) for name in ("forward_velocity", "body_rotation_rate") * 2])
    twists[3] = first(s, "tail_rotation_rate")
    assert first(s, "dissipated_power") == pytest.approx(twists @ calibrated_axial(batch, model) @ twists, rel=1e-11)
    if reading in ("rotor", "none") and given_rate == "no rate":
        # With friction inside the joint alone, what leaves the shaft is dissipated.
        assert first(s, "shaft_power") == pytest.approx(first(s, "dissipated_power"), rel=1e-11)
    drag, _ = body_axial(batch)
    efficiency = drag[0] * first(s, "forward_velocity") ** 2 / first(s, "shaft_power")
    assert first(s, "hydrodynamic_efficiency") == pytest.approx(efficiency, rel=1e-12)
    assert 0 < efficiency < 0.2


@pytest.mark.parametrize("model", MODELS)
def test_readings_none_and_rotor_move_alike_at_a_prescribed_rate(batch_of: Callable[..., Any], model: str) -> None:
    batch = batch_of(friction__effective="3e-5 N m s/rad")
    alike = ("forward_velocity", "body_rotation_rate", "motor_rotation_rate", "motor_current", "tail_torque")
    none, rotor = (swim(batch, model, tail_rate=RATE, friction=reading) for reading in ("none", "rotor"))
    for name in alike:
        assert first(none, name) == first(rotor, name), name
    # What `rotor` calls friction is what `none` leaves unexplained.
    friction = first(rotor, "effective_friction") * first(rotor, "motor_rotation_rate")
    assert first(none, "motor_residual_torque") == pytest.approx(friction, rel=1e-12)
    at_rate = {"drive": {"kind": "rate", "rate": "1.7 Hz", "joint": "revolute"}}
    driven = batch_of(friction__effective="3e-5 N m s/rad", **at_rate)
    for reading in ("none", "rotor"):
        for s in (swim(driven, model, friction=reading), swim(driven, model, friction=reading, tail_rate=RATE)):
            for name in alike[:3]:
                assert first(s, name) == pytest.approx(first(none, name), rel=1e-13), (reading, name)
            assert np.isnan(first(s, "motor_current"))


@pytest.mark.parametrize("hand", ["right", "left"])
@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("effective", [1e-6, 3e-5])
def test_paper_reading_as_printed(batch_of: Callable[..., Any], model: str, hand: str, effective: float) -> None:
    """(15) with (19): E Omega = -T_h - B_eff omega_m = -K_m I, with T_h signed about +x."""
    batch = batch_of(tail__handedness=hand, friction__effective=f"{effective} N m s/rad")
    E = calibrated_axial(batch, model)[1, 1]
    sign = 1 if hand == "right" else -1
    for s in (
        swim(batch, model, friction="paper"),
        swim(batch, model, friction="paper", tail_rate=sign * RATE),
        swim(batch, model, friction="paper", motor_rate=sign * RATE),
    ):
        Omega, slip = first(s, "body_rotation_rate"), first(s, "motor_rotation_rate")
        assert E * Omega == pytest.approx(-K_M * first(s, "motor_current"), rel=1e-11)
        T_h = sign * first(s, "tail_torque")
        assert E * Omega == pytest.approx(-T_h - first(s, "effective_friction") * slip, rel=1e-11)


@pytest.mark.parametrize(
    "drive",
    [
        {"kind": "dc-motor"},
        {"kind": "torque", "torque": "0.03 mN m"},
        {"kind": "rate", "rate": "2 Hz"},
    ],
    ids=lambda drive: drive["kind"],
)
@pytest.mark.parametrize("model", MODELS)
def test_paper_reading_has_no_answer_beyond_the_bodys_own_drag(
    batch_of: Callable[..., Any], model: str, drive: dict[str, str]
) -> None:
    """-B_eff omega_m on the rotor alone turns body and tail the same way once B_eff exceeds E_x."""
    robot = batch_of(drive={"joint": "revolute", **drive})
    E = calibrated_axial(robot, model)[1, 1]
    many = robot.with_values({"friction.effective": E * np.array([0.5, 0.999, 1.0, 1.001, 3.0])})
    s = swim(many, model, friction="paper")
    np.testing.assert_array_equal(s.valid, [True, True, False, False, False])
    np.testing.assert_array_equal(np.isfinite(s.forward_velocity), s.valid)
    np.testing.assert_array_equal(np.isfinite(s.body_rotation_rate), s.valid)


@pytest.mark.parametrize("reading", READINGS)
@pytest.mark.parametrize("model", MODELS)
def test_left_handed_robot_is_the_mirror_image(batch_of: Callable[..., Any], model: str, reading: str) -> None:
    """The motor's polarity follows the hand: the same speed, currents and powers, opposite rates."""
    right, left = (
        swim(batch_of(tail__handedness=hand, friction__effective="9e-6 N m s/rad"), model, friction=reading)
        for hand in ("right", "left")
    )
    signs = {"tail_rotation_rate": -1, "body_rotation_rate": -1, "motor_rotation_rate": -1, "motor_current": -1}
    signs |= {"drive_torque": -1, "advance_per_radian": -1}
    for name in (item.name for item in STEADY):
        wanted = signs.get(name, 1) * getattr(right, name)
        np.testing.assert_allclose(getattr(left, name), wanted, rtol=1e-12, err_msg=name)


def test_walls_that_a_model_leaves_out_are_said(batch_of: Callable[..., Any]) -> None:
    """In a channel, by every model without walls, also where calibration factors stand for them."""
    robot = batch_of()
    for model in MODELS:
        assert [note.code for note in swim(robot, model).notes] == ["walls-left-out"]
    assert swim(robot, "sbt", calibrated=False).notes != swim(robot, "sbt").notes
    assert swim(robot, "tube").notes == ()
    assert swim(batch_of(channel=None), "rft", calibrated=False).notes == ()


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("reading", READINGS)
def test_torque_drive_is_linear(batch_of: Callable[..., Any], model: str, reading: str) -> None:
    base = batch_of(drive={"kind": "torque", "torque": "0.02 mN m"}, friction__effective="9e-6 N m s/rad")
    torques = np.array([2e-5, 4e-5, -6e-5, 0.0])
    s = swim(base.with_values({"drive.torque": torques}), model, friction=reading)
    for name in ("forward_velocity", "body_rotation_rate", "tail_rotation_rate", "motor_rotation_rate", "drive_torque"):
        values = getattr(s, name)
        np.testing.assert_allclose(values, values[0] * torques / torques[0], rtol=1e-12, atol=1e-30, err_msg=name)
    for name in ("shaft_power", "dissipated_power", "friction_power"):
        values = getattr(s, name)
        np.testing.assert_allclose(
            values, values[0] * (torques / torques[0]) ** 2, rtol=1e-12, atol=1e-30, err_msg=name
        )
    U, Omega, omega = (first(s, name) for name in ("forward_velocity", "body_rotation_rate", "tail_rotation_rate"))
    T_r, T_b = friction_on(reading, 9e-6, Omega, omega)
    if reading == "body":  # no motor's B_m without a motor table is a robot of its own; here the table is there
        assert base.electrics is not None
    loads = calibrated_axial(base, model) @ [U, Omega, U, omega]
    assert loads[3] == pytest.approx(2e-5 + T_r, rel=1e-11)
    assert loads[1] == pytest.approx(-2e-5 + T_b, rel=1e-11)
    work = first(s, "dissipated_power") + first(s, "friction_power")
    assert 2e-5 * (omega - Omega) == pytest.approx(work, rel=1e-11)


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("hand", ["right", "left"])
def test_fixed_joint_turns_as_one_piece(batch_of: Callable[..., Any], model: str, hand: str) -> None:
    """An external torque on the whole: U = -B14 omega/(D + B11), torque = (E + B44 - B14^2/(D + B11)) omega."""
    rate = batch_of(drive={"kind": "rate", "joint": "fixed", "rate": "3 Hz"}, tail__handedness=hand)
    D, E, (B11, B14, B44) = (
        *np.diag(calibrated_axial(rate, model))[:2],
        (calibrated_axial(rate, model)[i, j] for i, j in ((2, 2), (2, 3), (3, 3))),
    )
    omega = 3 * Hz
    U, torque = -B14 * omega / (D + B11), float((E + B44 - B14**2 / (D + B11)) * omega)
    for s in (
        swim(rate, model),
        swim(rate, model, tail_rate=np.array([omega])),
        swim(
            batch_of(drive={"kind": "torque", "joint": "fixed", "torque": f"{torque!r} N m"}, tail__handedness=hand),
            model,
        ),
    ):
        assert first(s, "forward_velocity") == pytest.approx(U, rel=1e-12)
        assert first(s, "tail_rotation_rate") == pytest.approx(omega, rel=1e-12)
        assert first(s, "body_rotation_rate") == first(s, "tail_rotation_rate")
        assert first(s, "motor_rotation_rate") == 0
        assert first(s, "drive_torque") == pytest.approx(torque, rel=1e-12)
        assert first(s, "shaft_power") == pytest.approx(torque * omega, rel=1e-12)
        assert first(s, "dissipated_power") == pytest.approx(torque * omega, rel=1e-12)
        assert first(s, "friction_power") == 0
    assert np.sign(U) == (1 if hand == "right" else -1)


@pytest.mark.parametrize("reading", ["none", "rotor", "paper"])
def test_row_four_zeroed_as_15_is_printed(batch_of: Callable[..., Any], reading: str) -> None:
    """E Omega = -B44 omega + friction, without the torque that U itself makes on the tail."""
    options = {"friction__effective": "9e-6 N m s/rad", "drive": {"kind": "rate", "rate": "1.7 Hz"}}
    kept, zeroed = (batch_of(model__rft__row4=row4, **options) for row4 in ("kept", "zeroed"))
    r = calibrated_axial(kept, "rft")
    D, E, B11, B14, B44 = r[0, 0], r[1, 1], r[2, 2], r[2, 3], r[3, 3]
    omega = RATE[0]
    U = -B14 * omega / (D + B11)
    B = 9e-6 if reading == "paper" else 0.0
    s, whole = swim(zeroed, "rft", friction=reading), swim(kept, "rft", friction=reading)
    assert first(s, "forward_velocity") == pytest.approx(U, rel=1e-12)
    assert first(whole, "forward_velocity") == pytest.approx(U, rel=1e-12)
    assert first(s, "body_rotation_rate") == pytest.approx(-(B44 + B) * omega / (E - B), rel=1e-12)
    assert first(whole, "body_rotation_rate") == pytest.approx(
        -(B44 * omega + B14 * U + B * omega) / (E - B), rel=1e-12
    )
    assert first(s, "tail_torque") == pytest.approx(B44 * omega, rel=1e-12)


def test_throttle_scales_an_ohmic_motor(batch_of: Callable[..., Any]) -> None:
    """With constant resistance and an ideal battery everything is linear in the duty."""
    ohmic = {"constant": "30 ohm", "decay": "0 ohm", "growth": "0 ohm", "slope": "0 ohm/A"}
    quarter, full = (
        swim(batch_of(drive__duty=duty, motor__resistance=ohmic, battery__internal_resistance="0 ohm"), "sbt")
        for duty in (0.25, 1.0)
    )
    for name in ("forward_velocity", "tail_rotation_rate", "body_rotation_rate", "motor_current", "tail_torque"):
        assert first(quarter, name) == pytest.approx(first(full, name) / 4, rel=1e-12), name
    for name in ("electrical_power", "dissipated_power", "friction_power"):
        assert first(quarter, name) == pytest.approx(first(full, name) / 16, rel=1e-12), name
    assert first(quarter, "battery_run_time") == pytest.approx(16 * first(full, "battery_run_time"), rel=1e-12)
    assert first(full, "battery_run_time") == pytest.approx(0.07 * 3600 / first(full, "motor_current"), rel=1e-12)
    # Motor alone: K_m I - B_m omega_m = T_h and 30 ohm I + K_b omega_m = 3.7 V.
    assert 30 * first(full, "motor_current") + K_B * first(full, "motor_rotation_rate") == pytest.approx(3.7, rel=1e-12)


def test_no_throttle_no_motion(batch_of: Callable[..., Any]) -> None:
    s = swim(batch_of(drive__duty=0.0), "sbt")
    for name in ("forward_velocity", "tail_rotation_rate", "motor_current", "electrical_power"):
        assert first(s, name) == 0, name


def test_reynolds_numbers(wide: Any) -> None:
    s = swim(wide, "sbt", tail_rate=RATE)
    assert first(s, "reynolds_number") == pytest.approx(985 * first(s, "forward_velocity") * 18e-3 / 3.5, rel=1e-12)
    assert first(s, "tail_reynolds_number") == pytest.approx(985 * RATE[0] * 2.5e-3**2 / 3.5, rel=1e-12)
    assert first(s, "advance_per_radian") == pytest.approx(first(s, "forward_velocity") / RATE[0], rel=1e-12)


def test_unset_friction_is_the_rotors_own(batch_of: Callable[..., Any], wide: Any) -> None:
    given = batch_of(friction__effective="7e-7 N m s/rad")
    for reading in ("rotor", "paper"):
        assert first(swim(wide, friction=reading), "tail_rotation_rate") == first(
            swim(given, friction=reading), "tail_rotation_rate"
        )
        assert first(swim(wide, friction=reading), "effective_friction") == 7e-7


@settings(max_examples=20)
@given(
    wavelength=st.floats(8e-3, 60e-3),
    amplitude=st.floats(0.5e-3, 6e-3),
    viscosity=st.floats(0.1, 100),
    effective=st.floats(1e-7, 5e-5),
    model=st.sampled_from(MODELS),
)
def test_motor_never_gives_more_than_the_battery(
    wide: Any, wavelength: float, amplitude: float, viscosity: float, effective: float, model: str
) -> None:
    """For every robot: dissipation and friction are positive and the balance of energy closes."""
    batch = wide.with_values(
        {
            "tail.wavelength": wavelength,
            "tail.amplitude": amplitude,
            "fluid.viscosity": viscosity,
            "friction.effective": effective,
        }
    )
    s = swim(batch, model)
    assume(bool(s.valid[0]))
    i, slip = first(s, "motor_current"), first(s, "motor_rotation_rate")
    assert first(s, "dissipated_power") > 0
    assert first(s, "friction_power") > 0
    winding = winding_resistance(batch.electrics, s.motor_current)[0] * i**2
    losses = winding + (K_B - K_M) * slip * i + first(s, "friction_power") + first(s, "dissipated_power")
    assert i * battery_voltage(batch.electrics, s.motor_current)[0] == pytest.approx(losses, rel=1e-10)
    assert first(s, "forward_velocity") > 0
