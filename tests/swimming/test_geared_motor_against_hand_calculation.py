"""A gear between motor and joint: hand calculation of (17) and (18), equivalent motors, energy balance."""

from typing import Any

import numpy as np
import pytest

import spirillum as sp

WIDE = "biorob2012-wide"
LINEAR = {"constant": "10 ohm", "decay": "0 ohm", "growth": "0 ohm", "slope": "0 ohm/A"}


def geared(ratio: float, **changes: Any) -> Any:
    return sp.load(WIDE, **{"motor.gear_ratio": ratio, **changes})


def equivalent(ratio: float, **changes: Any) -> Any:
    """A motor without a gear that has the joint's constants: K_m G, K_b G and B_m G^2."""
    motor = sp.load(WIDE).motor
    assert motor is not None
    own = {
        "motor.torque_constant": f"{motor.torque_constant * ratio!r} N m/A",
        "motor.back_emf_constant": f"{motor.back_emf_constant * ratio!r} V s/rad",
        "motor.rotor_friction": f"{motor.rotor_friction * ratio**2!r} N m s/rad",
    }
    return sp.load(WIDE, **own, **changes)


@pytest.mark.parametrize("ratio", [0.5, 1.0, 4.0, 30.0])
@pytest.mark.parametrize("friction", [None, 1.1e-5])
def test_rate_of_a_linear_circuit_by_hand(ratio: float, friction: float | None) -> None:
    """K_m G I = (lambda + B) omega_m and (R + r) I = V - K_b G omega_m with the load lambda = T_h/omega_m."""
    more = {} if friction is None else {"friction.effective": f"{friction} N m s/rad"}
    robot = geared(ratio, **{"motor.resistance": LINEAR}, **more)
    motor, battery = robot.motor, robot.battery
    found = sp.predict(robot, model="rft")
    load = found.drive_torque / found.motor_rotation_rate
    joint = motor.rotor_friction * ratio**2 if friction is None else friction
    circuit = 10.0 + battery.internal_resistance
    torque, emf = motor.torque_constant * ratio, motor.back_emf_constant * ratio
    rate = torque * battery.voltage / (circuit * (load + joint) + torque * emf)
    assert found.motor_rotation_rate == pytest.approx(rate, rel=1e-9)
    assert found.motor_current == pytest.approx((battery.voltage - emf * rate) / circuit, rel=1e-9)
    assert found.friction_power == pytest.approx(joint * rate**2, rel=1e-9)
    shaft = motor.torque_constant * found.motor_current * ratio * rate  # torque and rate of the motor's own shaft
    assert shaft == pytest.approx(found.friction_power + found.shaft_power, rel=1e-9)


@pytest.mark.parametrize("reading", ["rotor", "body", "paper", "none"])
def test_a_gear_is_a_motor_with_the_joints_constants(reading: str) -> None:
    for options in ({}, {"tail_rate": "1 Hz"}):
        one, other = (sp.predict(make(3.0), model="rft", friction=reading, **options) for make in (geared, equivalent))
        for name in (
            "forward_velocity",
            "motor_rotation_rate",
            "motor_current",
            "friction_power",
            "effective_friction",
        ):
            assert getattr(one, name) == pytest.approx(getattr(other, name), rel=1e-9, nan_ok=True)


@pytest.mark.parametrize("motion", ["held", "free"])
def test_runs_of_a_geared_motor_balance_their_energy(motion: str) -> None:
    timing = {"duration": "0.5 s", "on": [("0 s", "0.3 s")]}
    one, other = (sp.simulate(make(4.0), motion=motion, timing=timing, model="rft") for make in (geared, equivalent))
    for name in ("tail_angle", "motor_current", "motor_torque", "electrical_energy", "conversion_energy"):
        np.testing.assert_allclose(one[name], other[name], rtol=1e-6, atol=1e-12)
    lost = one["resistive_energy"] + one["magnetic_energy"] + one["conversion_energy"] + one["friction_energy"]
    if motion == "free":
        lost = lost + one["potential_energy"] - one["potential_energy"][0]
    scale = float(one["electrical_energy"][-1])
    np.testing.assert_allclose((lost + one["dissipated_energy"]) / scale, one["electrical_energy"] / scale, atol=1e-7)


def test_constants_of_the_motors_shaft_are_what_is_fitted(tmp_path: Any) -> None:
    """K_m is the motor's own, whatever the gear: the fit gives it back, and its file is one for the geared robot."""
    truth = geared(3.0, **{"friction.effective": "4e-5 N m s/rad"})
    rows = [
        "robot,channel_diameter_mm,wavelength_mm,amplitude_mm,trial,forward_velocity_mm_s,tail_rate_Hz,body_rate_Hz"
    ]
    for wavelength in (15.0, 20.0, 25.0):
        for amplitude in (1.5, 2.5):
            tail = {"tail.wavelength": f"{wavelength} mm", "tail.amplitude": f"{amplitude} mm"}
            swum = sp.predict(geared(3.0, **{"friction.effective": "4e-5 N m s/rad"}, **tail), model="sbt")
            rates = [swum.tail_rotation_rate / (2 * np.pi), swum.body_rotation_rate / (2 * np.pi)]
            rows.append(f"{WIDE},40,{wavelength},{amplitude},1,{1e3 * swum.forward_velocity},{rates[0]},{rates[1]}")
    path = tmp_path / "o.csv"
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")
    found = sp.calibrate(path, truth, method="paper", free="body_drag,body_rotation,friction")
    for item in found.friction:
        assert item.value == pytest.approx(4e-5, rel=1e-9)
    fitted = sp.calibrate(path, truth, method="least-squares", free="torque_constant", model="sbt")
    assert truth.motor is not None
    assert fitted.values["torque_constant"].value == pytest.approx(truth.motor.torque_constant, rel=1e-3)


def test_ratios_that_are_none_are_refused() -> None:
    for value in (0, -3, "3 mm"):
        with pytest.raises(sp.InputError, match=r"motor\.gear_ratio"):
            sp.load(WIDE, **{"motor.gear_ratio": value})
