"""The presets against Tables I to III of the paper in SI, and what follows from them against arithmetic done here."""

import numpy as np
import pytest

from spirillum.robot.batch import RobotBatch
from spirillum.robot.load import load, preset_names
from spirillum.robot.robot import Robot

PRESETS = ["biorob2012-narrow", "biorob2012-wide"]


def test_both_presets_are_there() -> None:
    assert set(PRESETS) <= set(preset_names())


@pytest.fixture(params=PRESETS)
def preset(request: pytest.FixtureRequest) -> Robot:
    return load(request.param)


def test_table_i(preset: Robot) -> None:
    """Lengths in m, viscosity in Pa s, density in kg/m^3, mass in kg."""
    assert preset.channel is not None
    assert preset.channel.diameter == {"biorob2012-wide": 0.040, "biorob2012-narrow": 0.030}[preset.name]
    assert preset.channel.length == 0.350
    assert (preset.body.diameter, preset.body.length) == (0.018, 0.035)
    assert (preset.coupling.diameter, preset.coupling.length) == (0.006, 0.010)
    assert (preset.tail.length, preset.tail.wire_diameter) == (0.060, 0.001)
    assert preset.body.mass == pytest.approx(0.0107, rel=1e-15)
    assert (preset.fluid.density, preset.fluid.viscosity) == (985.0, 3.5)
    # Section II-A and eq. (10): a hemispherical nose, a flat seal, a right-handed tail, c = 100.
    assert (preset.body.front_end, preset.body.rear_end) == ("hemisphere", "flat")
    assert (preset.tail.handedness, preset.tail.taper) == ("right", 100.0)
    # The tail of Fig. 5's caption.
    assert (preset.tail.wavelength, preset.tail.amplitude) == (0.025, 0.0025)


def test_table_ii(preset: Robot) -> None:
    motor, battery = preset.motor, preset.battery
    assert motor is not None
    assert battery is not None
    r = motor.resistance
    found = [r.constant, r.decay, r.decay_rate, r.growth, r.growth_rate, r.slope]
    np.testing.assert_allclose(found, [10.4, 30, 54.6, 1, 1, -1.555], rtol=1e-15)
    found = [motor.inductance, motor.torque_constant, motor.back_emf_constant, motor.rotor_friction]
    np.testing.assert_allclose(found, [0.082, 0.00045, 0.004, 7e-7], rtol=1e-15)
    assert battery.capacity is not None
    np.testing.assert_allclose(
        [battery.voltage, battery.internal_resistance, battery.capacity], [3.7, 0.8, 0.070 * 3600], rtol=1e-14
    )


def test_table_iii(preset: Robot) -> None:
    drag = {"biorob2012-wide": 1.95, "biorob2012-narrow": 3.6}[preset.name]
    diameter = {"biorob2012-wide": 0.040, "biorob2012-narrow": 0.030}[preset.name]
    for model, rotation in (("sbt", 0.6), ("rft", 1.0)):
        entry = preset.calibration[model]
        assert (entry.body_drag, entry.body_rotation) == (drag, rotation)
        fitted = entry.fitted_to
        assert (fitted.channel_diameter, fitted.body_diameter, fitted.body_length) == (diameter, 0.018, 0.035)


def test_presets_warn_of_nothing(preset: Robot) -> None:
    assert preset.warnings == ()


def test_derived_quantities() -> None:
    """Volumes in mm^3, then weight less buoyancy: some 0.03 N. A plain helix has them in closed form."""
    derived = load("biorob2012-wide", **{"tail.taper": "none"}).derived()
    alpha = 25 / np.hypot(25, 2 * np.pi * 2.5)
    arc = 60 / alpha
    body = 2 / 3 * np.pi * 9**3 + np.pi * 9**2 * 26
    coupling = np.pi * 3**2 * (10 - 2 * 0.5)
    wire = np.pi * 0.5**2 * arc
    volume = (body + coupling + wire) * 1e-9
    wire_mass = 8960 * wire * 1e-9
    wanted = {
        "arc_fraction": alpha,
        "pitch_angle": np.arctan(2 * np.pi * 2.5 / 25),
        "turns": 2.4,
        "arc_length": arc * 1e-3,
        "robot_length": 0.105,
        "body_volume": body * 1e-9,
        "coupling_volume": coupling * 1e-9,
        "wire_volume": wire * 1e-9,
        "displaced_volume": volume,
        "tail_mass": wire_mass,
        "mass": 0.0107 + wire_mass,
        "submerged_weight": (0.0107 + wire_mass - 985 * volume) * 9.80665,
    }
    for name, value in wanted.items():
        assert derived[name].value == pytest.approx(value, rel=1e-12), name
    assert derived["submerged_weight"].value == pytest.approx(0.028, abs=5e-4)
    # Moments about mid-length: the nose's centroid lies 3/8 R before its base, the cylinder's behind mid-length.
    nose, cylinder = 2 / 3 * np.pi * 9**3, np.pi * 9**2 * 26
    x_body = (nose * (8.5 + 3 / 8 * 9) + cylinder * (8.5 - 13)) / (nose + cylinder)
    x_coupling, x_wire = -17.5 - 5, -17.5 - 10 - 30
    main = (body * x_body + coupling * x_coupling) / (body + coupling)
    mass = (0.0107 * main + wire_mass * x_wire) / (0.0107 + wire_mass)
    buoyancy = (body * x_body + coupling * x_coupling + wire * x_wire) / (body + coupling + wire)
    assert derived["centre_of_mass"].value == pytest.approx(mass * 1e-3, rel=1e-12)
    assert derived["centre_of_buoyancy"].value == pytest.approx(buoyancy * 1e-3, rel=1e-12)


@pytest.mark.parametrize("unset", [{"body.mass": None}, {"tail.density": None}])
def test_weight_needs_mass_and_density(unset: dict[str, None]) -> None:
    derived = load("biorob2012-wide", **unset).derived()
    assert "displaced_volume" in derived
    assert not {"mass", "submerged_weight", "centre_of_mass"} & set(derived)


def test_batch_holds_the_same_numbers(preset: Robot) -> None:
    batch = RobotBatch.of(preset)
    assert preset.channel is not None
    assert batch.size == 1
    assert batch.wavelength[0] == preset.tail.wavelength
    assert batch.channel_diameter[0] == preset.channel.diameter
    assert batch.root[0] == pytest.approx(0.0275, rel=1e-15)
    assert np.isnan(batch.effective_friction[0])
    assert batch.electrics is not None
    assert batch.electrics.polarity[0] == 1.0
