"""Free runs in a channel: energy, weight, films, events, and the steady motion that they come to."""

import ast
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import spirillum as sp
from spirillum.dynamics.free_robot import films_of

QUIET = {"friction.effective": "1.1e-5 N m s/rad"}


def events(run: Any) -> dict[str, float]:
    return {event["what"]: event["time"] for event in json.loads(run.attrs["events"])}


@pytest.mark.parametrize("reading", ["none", "rotor", "body", "paper"])
def test_energy_is_balanced_along_the_trajectory(reading: str) -> None:
    robot = sp.load("biorob2012-narrow", **{"drive.duty": 0.7})
    run = sp.simulate(
        robot,
        friction=reading,
        placement={"pitch": "1 deg"},
        timing={"turns": 12.0, "on": [(0.0, 0.5), (0.7, 5.0)]},
        model="rft",
    )
    chemical = run["resistive_energy"] + run["magnetic_energy"] + run["conversion_energy"] + run["drive_energy"]
    scale = float(run["electrical_energy"][-1])
    np.testing.assert_allclose(run["electrical_energy"] / scale, chemical / scale, atol=1e-8)
    lifted = run["potential_energy"] - run["potential_energy"][0]
    spent = run["friction_energy"] + run["dissipated_energy"] + lifted
    scale = float(run["drive_energy"][-1])
    np.testing.assert_allclose(run["drive_energy"] / scale, spent / scale, atol=1e-7)
    for name, torque in (("drive_power", "motor_torque"), ("shaft_power", "drive_torque")):
        np.testing.assert_allclose(run[name], run[torque] * run["motor_rotation_rate"], rtol=1e-9, atol=1e-15)
        assert torque in run[name].attrs["long_name"]


def test_lying_robot_swims_between_held_and_free() -> None:
    """The floor holds lateral motion in part: a hundredth of the speed lies between held and free."""
    robot = sp.load("biorob2012-wide", **QUIET)
    run = sp.simulate(robot, timing={"turns": 10.0}, model="rft")
    held, free = (sp.predict(robot, model="rft", motion=motion) for motion in ("held", "free"))
    assert free.forward_velocity < float(run["mean_forward_velocity"]) < held.forward_velocity
    assert float(run["mean_tail_rotation_rate"]) == pytest.approx(held.tail_rotation_rate, rel=5e-3)
    assert float(run["mean_body_rotation_rate"]) == pytest.approx(held.body_rotation_rate, rel=1e-2)
    assert "wall effects are not modelled beyond the film" in run.attrs["warnings"]


def test_series_are_named_as_in_a_prediction() -> None:
    """Over the last turn torque and powers are those of the held robot, up to what lateral freedom changes."""
    robot = sp.load("biorob2012-wide", **QUIET)
    run, held = sp.simulate(robot, timing={"turns": 4.0}, model="rft"), sp.predict(robot, model="rft")
    for name in ("drive_torque", "shaft_power", "friction_power", "electrical_power", "motor_current"):
        assert float(run[name][-100:].mean()) == pytest.approx(getattr(held, name), rel=1e-2), name


def test_sphere_sinks_at_its_weight_over_its_drag() -> None:
    """Far from the walls, with a tail so small that Stokes' drag is all there is."""
    robot = sp.load(
        "biorob2012-wide",
        body={
            "shape": "sphere",
            "diameter": "18 mm",
            "length": "18 mm",
            "front": "none",
            "rear": "none",
            "mass": "4 g",
        },
        coupling={"length": "1 mm", "diameter": "0 mm", "clearance": "0.1 mm"},
        tail={
            "length": "0.05 mm",
            "amplitude": "0.002 mm",
            "wavelength": "0.05 mm",
            "wire_diameter": "0.002 mm",
            "taper": "none",
        },
        channel={"diameter": "1 m", "length": "1 m"},
    )
    run = sp.simulate(
        robot, placement={"eccentricity": 0.0}, calibrated=False, timing={"duration": "0.01 s"}, model="rft"
    )
    from spirillum.robot.robot import STANDARD_GRAVITY

    weight = (4e-3 - 985 * np.pi / 6 * 0.018**3) * STANDARD_GRAVITY
    speed = weight / (6 * np.pi * 3.5 * 0.009)
    assert -float(run["velocity"][0, 2]) == pytest.approx(speed, rel=2e-3)


def test_a_robot_that_sinks_is_said_to_and_its_speed_is_that_of_the_reynolds_number() -> None:
    """Without a channel; forward it swims far more slowly than it sinks."""
    run = sp.simulate(sp.load("biorob2012-wide", channel="none"), timing={"duration": "2 s"})
    said = run.attrs["warnings"]
    fastest = float(np.linalg.norm(run["velocity"].values, axis=-1).max())
    number = 985 * fastest * 18e-3 / 3.5
    assert number > 0.1
    assert f"{1e3 * fastest:.4g} mm/s) = {number:.4g}; accurate: at most 0.1" in said
    late = run.isel(time=slice(run.sizes["time"] // 3, None))
    sinking = float(late["position"][0, 2] - late["position"][-1, 2]) / float(late["time"][-1] - late["time"][0])
    assert f"it sinks at {1e3 * sinking:.4g} mm/s" in said
    free = sp.predict(sp.load("biorob2012-wide", channel="none"), motion="free")
    assert any("the submerged weight of" in line and "with which it sinks" in line for line in free.warnings)


def test_films_against_reynolds_equation() -> None:
    """Force of the film's pressure, integrated over the gap of a sphere in a tube, at two thicknesses."""
    from scipy.integrate import dblquad

    robot = sp.load(
        "biorob2012-wide",
        body={"shape": "sphere", "diameter": "18 mm", "length": "18 mm", "front": "none", "rear": "none"},
    )
    spot = films_of(robot, None, 1.0, 1.0)[1][0]
    along, across, viscosity = 0.009, 0.009 * 0.02 / 0.011, 3.5
    for film in (1e-4, 4e-4):

        def pressure(y: float, x: float, film: float = film) -> float:
            gap = film + x * x / (2 * along) + y * y / (2 * across)
            return 6 * viscosity / ((1 / along + 1 / across) * gap**2)

        reach = 60 * np.sqrt(along * film)
        force, _ = dblquad(pressure, 0.0, reach, 0.0, reach, epsrel=1e-6)
        law = spot[3] * (spot[5] / film) ** spot[4]
        assert law == pytest.approx(4 * force, rel=2e-3)


def test_capsule_drains_as_a_line_does() -> None:
    """h^(-1/2) grows with N/2c, c = 3 sqrt(2) pi mu R_2^(3/2) per length: only the films resist near the wall."""
    robot = sp.load(
        "biorob2012-wide",
        drive={"kind": "rate", "rate": "1e-3 Hz"},
        coupling={"length": "3 mm", "diameter": "0 mm"},
        tail={"density": "985 kg/m^3"},
        body={"rear": "hemisphere"},
    )
    run = sp.simulate(
        robot,
        placement={"gap": "0.02 mm"},
        roughness="1 nm",
        timing={"duration": "30 s", "samples_per_turn": 10_000},
        model="rft",
    )
    gap = run["wall_gap"].values
    assert gap[-1] < 0.5 * gap[0]
    links = 1.0 / np.sqrt(gap)
    slope = (links[-1] - links[len(links) // 2]) / float(run["time"][-1] - run["time"][len(links) // 2])
    from spirillum.dynamics.free_robot import weight_of

    length, across = 0.017, 0.009 * 0.02 / 0.011
    expected = weight_of(robot)[:2].sum() / (2 * 3 * np.sqrt(2) * np.pi * 3.5 * across**1.5 * length)
    assert slope == pytest.approx(expected, rel=0.1)


def test_start_is_where_the_placement_says() -> None:
    run = sp.simulate("biorob2012-wide", placement={"gap": "1.3 mm"}, timing={"turns": 0.1}, model="rft")
    assert float(run["wall_gap"][0]) == pytest.approx(1.3e-3, rel=1e-9)
    run = sp.simulate(
        "biorob2012-wide", placement={"gap": "1.3 mm", "pitch": "2 deg"}, timing={"turns": 0.1}, model="rft"
    )
    assert float(run["pitch"][0]) == pytest.approx(np.radians(2.0), rel=1e-9)
    assert float(run["wall_gap"][0]) == pytest.approx(1.3e-3, rel=2e-2)  # a ring's farthest point, to the tilt squared
    run = sp.simulate("biorob2012-wide", placement={"eccentricity": 0.0}, timing={"turns": 0.1}, model="rft")
    assert float(run["wall_gap"][0]) == pytest.approx(0.011, rel=1e-9)


@pytest.mark.parametrize(
    ("channel", "angle", "field"), [("6 mm", "40 deg", "1 mT"), ("8 mm", "10 deg", "5 mT")], ids=["weak", "strong"]
)
def test_pressed_robot_stays_off_the_wall_and_its_energy_balanced(channel: str, angle: str, field: str) -> None:
    """Roughness carries what films only slow down; its pressure is the gradient of the energy that it stores."""
    robot = sp.load(
        "magnetic-helix",
        **{"channel": {"diameter": channel}, "magnetic.moment_angle": angle, "magnetic.field": field},
    )
    run = sp.simulate(robot, timing={"turns": 4.0}, model="rft")
    assert "film as thin as the roughness" in events(run)
    assert float(run["wall_gap"].min()) > 1e-4 * 1.5e-3  # the roughness
    spent = run["dissipated_energy"] + run["potential_energy"] - run["potential_energy"][0]
    scale = float(run["drive_energy"][-1])
    np.testing.assert_allclose(run["drive_energy"] / scale, spent / scale, atol=1e-6)


def test_film_is_lost_as_its_gradient_says() -> None:
    """By finite differences of place and attitude, for a tilted sphere-ended, an edged and an ellipsoidal ring."""
    from scipy.spatial.transform import Rotation

    from spirillum.kernels import core

    wall = np.array([0.02, 1e-6, np.inf, 1.0])
    place, attitude = np.array([0.0, 2.1e-3, -8.5e-3]), Rotation.from_euler("xyz", [0.3, 0.1, -0.07])

    def film(step: np.ndarray, spot: np.ndarray, gradient: np.ndarray) -> float:
        state = np.zeros(core.STATE_SIZE)
        state[:3] = place + attitude.apply(step[:3])
        turned = attitude * Rotation.from_rotvec(step[3:])
        state[3:7] = turned.as_quat(scalar_first=True)
        return float(core.film_of(state, np.ascontiguousarray(turned.as_matrix()), wall, spot, gradient))

    for reach in (0.0, 0.009, 0.014):
        spot = np.array([0.008, 0.009, reach, 1.0, 1.0, 1.0])
        gradient, other = np.zeros(6), np.zeros(6)
        film(np.zeros(6), spot, gradient)
        for i in range(6):
            step = np.zeros(6)
            step[i] = 1e-6
            change = (film(step, spot, other) - film(-step, spot, other)) / 2e-6
            assert -change == pytest.approx(gradient[i], abs=1e-8)


@pytest.mark.parametrize(
    ("placement", "roughness", "words"),
    [
        ({"gap": "1 nm"}, None, "roughness = 0.9 um with a gap of 0.001 um"),
        ({"gap": "0.1 mm"}, "5 mm", "roughness = 5000 um"),
        ({"eccentricity": 1.0}, None, "a smaller placement.eccentricity"),
    ],
)
def test_start_at_the_wall_names_what_puts_it_there(placement: Any, roughness: Any, words: str) -> None:
    with pytest.raises(sp.InputError, match="allowed") as caught:
        sp.simulate("biorob2012-wide", placement=placement, roughness=roughness, model="rft")
    assert words in str(caught.value)


def test_battery_spent_before_the_first_sample_is_found() -> None:
    run = sp.simulate(sp.load("biorob2012-wide", **{"battery.capacity": "1e-9 C"}), timing={"turns": 1.0}, model="rft")
    assert 0 < events(run)["battery empty"] < 1e-3


def test_run_ends_where_the_tube_ends() -> None:
    robot = sp.load("biorob2012-wide", **{"channel.length": "120 mm"})
    run = sp.simulate(robot, timing={"duration": "60 s"}, model="rft")
    along = np.cos(float(run["pitch"][-1])) * np.cos(float(run["yaw"][-1]))
    nose = float(run["position"][-1, 0]) + 0.0175 * along
    assert nose - run.attrs["channel_middle"] == pytest.approx(0.06, abs=1e-9)
    assert events(run)["end of the channel"] == pytest.approx(float(run["time"][-1]), abs=1e-12)


def test_spent_battery_drives_no_longer() -> None:
    robot = sp.load("biorob2012-wide", **{"battery.capacity": "0.2 mA h"})
    run = sp.simulate(robot, timing={"duration": "4 s"}, model="rft")
    when = events(run)["battery empty"]
    after = run.sel(time=slice(when + 0.1, None))
    assert float(run["battery_charge_used"][-1]) == pytest.approx(0.72, rel=1e-6)
    assert float(abs(after["motor_current"]).max()) < 1e-3 * float(run["motor_current"].max())
    assert float(run["duty"][-1]) == 0.0


def test_duty_file_and_windows_are_one_thing(tmp_path: Path) -> None:
    table = tmp_path / "duty.csv"
    table.write_text("# the remote\ntime_s, duty\n0.1,1\n0.3,0\n", "utf-8")
    for motion in ("free", "held"):
        by_file = sp.simulate(
            "biorob2012-wide", motion=motion, timing={"duration": "0.5 s", "duty": table}, model="rft"
        )
        by_window = sp.simulate(
            "biorob2012-wide", motion=motion, timing={"duration": "0.5 s", "on": [(0.1, 0.3)]}, model="rft"
        )
        assert by_file.equals(by_window)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("time_s,duty\n0,1\n1,0\n0.5,1\n", "row 4: time_s = 0.5"),
        ("time_s,duty\n0,1\n1,1.01\n", "row 3: duty = 1.01"),
        ("time_s,duty\n0,nan\n", "row 2: duty = nan"),
        ("time_s,duty\n-1,1\n", "row 2: time_s = -1"),
        ("time_s,duty\n0\n", "row 2: 1 cells; allowed: 2"),
        ("time,duty\n0,1\n", "columns 'time, duty'"),
        ("time_s,duty\n", "no rows"),
        ("", "empty"),
    ],
)
def test_wrong_duty_files_are_refused(tmp_path: Path, text: str, words: str) -> None:
    table = tmp_path / "duty.csv"
    table.write_text(text, "utf-8")
    with pytest.raises(sp.InputError, match="allowed") as caught:
        sp.simulate("biorob2012-wide", timing={"duty": table}, model="rft")
    assert words in str(caught.value)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"motion": "loose"}, "motion = 'loose'"),
        ({"model": "sbt"}, "model 'sbt'"),
        ({"model": "tube", "placement": {"tail_drop": "1 mm"}}, "placement.tail_drop"),
        ({"model": "tube", "in_tube": {"flow": "missing.csv"}}, "missing.csv"),
        ({"model": "tube", "in_tube": {"flow": "a.csv"}, "placement": {"ends": "open"}}, "in_tube.flow"),
        ({"in_tube": {"wait": "1 s"}}, "in_tube.wait is given with model"),
        ({"in_tube": {"friction_coefficient": -0.1}}, "in_tube.friction_coefficient"),
        ({"placement": {"gap": "30 mm"}}, "placement.gap = 30 mm"),
        ({"placement": {"pitch": "40 deg"}}, "placement.pitch = 40 deg"),
        ({"placement": {"flow": "1 mm/s"}}, "placement.flow"),
        ({"roughness": "-1 um"}, "roughness"),
        ({"motion": "held", "weight": False}, "weight"),
        ({"motion": "held", "placement": {"gap": "1 mm"}}, "placement"),
        ({"timing": {"on": [(0.0, 1.0)], "duty": "duty.csv"}}, "together"),
        ({"timing": {"turns": 5e-324}}, "turns = 5e-324"),
        ({"timing": {"duration": 1e-12}}, "duration = 1e-12"),
        ({"timing": {"turns": float("nan")}}, "turns = nan"),
    ],
)
def test_wrong_runs_are_refused(options: dict[str, Any], words: str) -> None:
    with pytest.raises(sp.InputError, match="allowed") as caught:
        sp.simulate("biorob2012-wide", **{"model": "rft", **options})
    assert words in str(caught.value)


def test_wrong_types_get_a_sentence_too() -> None:
    """In a process of its own, where annotations are not checked."""
    import subprocess
    import sys

    wrong: list[tuple[dict[str, Any], str]] = [
        ({"timing": {"turn": 3.0}}, "timing.turn is not a known field (did you mean turns?)"),
        ({"timing": 3.0}, "timing = 3.0; allowed: a Timing, a mapping of names or None"),
        ({"timing": {"turns": "many"}}, "turns = 'many'"),
        ({"timing": {"turns": 10**400}}, "turns = 1000"),
        ({"timing": {"duration": 10**400}}, 'duration = "inf s" is not finite'),
        ({"timing": {"duration": True}}, "duration = True"),
        ({"timing": {"on": "0s:1s"}}, "on = 0s:1s"),
        ({"timing": {"on": [1]}}, "on = [1]"),
        ({"timing": {"duty": 0.5}}, "duty = 0.5"),
        ({"timing": {"samples_per_turn": "x"}}, "samples_per_turn = 'x'"),
    ]
    script = f"""
import spirillum as sp
for options in {[options for options, _ in wrong]!r}:
    try: sp.simulate("biorob2012-wide", **options)
    except sp.InputError as error: print(repr(str(error)))
"""
    found = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    sentences = [ast.literal_eval(line) for line in found.stdout.splitlines()]
    assert [(words, words in sentence) for (_, words), sentence in zip(wrong, sentences, strict=True)] == [
        (words, True) for _, words in wrong
    ]


def test_powers_are_what_their_definitions_say() -> None:
    found = sp.predict("biorob2012-wide", tail_rate="1.2 Hz", calibrated=False)
    from spirillum.fluid.closed.perrin import body_axial

    robot = sp.load("biorob2012-wide")
    drag = float(body_axial(sp.RobotBatch.of(robot))[0][0])
    assert found.propulsive_power == pytest.approx(drag * found.forward_velocity**2)
    assert found.overall_efficiency == pytest.approx(found.propulsive_power / found.electrical_power)
    weight = robot.derived()["mass"].value * 9.80665
    transport = found.electrical_power / (weight * found.forward_velocity)
    assert found.cost_of_transport == pytest.approx(transport, rel=1e-3)  # the wire's bend at the root
