"""The exported FMU: valid for FMPy, run by FMPy and by a plain C program as `simulate` runs the robot."""

import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import spirillum as sp
from spirillum.interfaces import fmu as build
from spirillum.interfaces.fmu import base_units
from spirillum.quantities import QUANTITIES, unit_of

fmpy: Any = pytest.importorskip("fmpy")

COMPILER = next((found for name in ("cc", "gcc", "clang") if (found := shutil.which(name))), None)
needs_compiler = pytest.mark.skipif(COMPILER is None, reason="no C compiler is installed")
WIDE = "biorob2012-wide"
FIELDS = {"tail.handedness": "left", "friction.effective": "2e-6 N m s/rad"}
TABLE_II = sp.load(WIDE, **FIELDS)
PLACED = {"gap": "0.5 mm", "pitch": 0.0, "flow": 1e-3}


@pytest.fixture(scope="module")
def units(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """FMUs of a robot without walls, and of one in an imposed flow."""
    folder = tmp_path_factory.mktemp("units")
    sp.export(TABLE_II, folder / "plain.fmu", model="rft")
    sp.export(WIDE, folder / "flow.fmu", model="tube", placement=PLACED)
    return {"plain": folder / "plain.fmu", "flow": folder / "flow.fmu"}


def simulated(path: Path, inputs: dict[str, list[Any]], *, stop: float, step: float, **more: Any) -> Any:
    """A run of an FMU by FMPy; inputs are rows by name, `time` among them."""
    kinds = [(name, bool if name == "remote" else float) for name in inputs]
    signals = np.array(list(zip(*inputs.values(), strict=True)), dtype=kinds)
    return fmpy.simulate_fmu(
        str(path), stop_time=stop, step_size=step, output_interval=step, input=signals, debug_logging=True, **more
    )


def check_kept_state(path: Path, outputs: list[int]) -> None:
    """A kept state, serialised and set again, goes on as the run did."""
    from fmpy import extract, instantiate_fmu, read_model_description

    description = read_model_description(str(path))
    folder = extract(str(path))
    robot = instantiate_fmu(folder, description, "CoSimulation")
    robot.enterInitializationMode(startTime=0.0)
    robot.exitInitializationMode()
    robot.doStep(0.0, 0.05)
    kept = robot.getFMUState()
    robot.doStep(0.05, 0.05)
    first = robot.getFloat64(outputs)
    robot.setFMUState(robot.deserializeFMUState(robot.serializeFMUState(kept)))
    robot.doStep(0.05, 0.05)
    np.testing.assert_array_equal(first, robot.getFloat64(outputs))
    robot.terminate()
    robot.freeInstance()
    shutil.rmtree(folder)


@needs_compiler
@pytest.mark.parametrize("name", ["plain", "flow"])
def test_fmpy_finds_no_problem(units: dict[str, Path], name: str) -> None:
    from fmpy.validation import validate_fmu

    assert validate_fmu(str(units[name])) == []
    description = fmpy.read_model_description(str(units[name]))
    inputs = [item.name for item in description.modelVariables if item.causality == "input"]
    assert inputs == ["remote", "duty", *(["mean_flow"] if name == "flow" else [])]
    for item in description.modelVariables:
        if item.name in QUANTITIES and item.name != "time":
            assert item.unit == unit_of(item.name)


@needs_compiler
def test_run_by_fmpy_is_that_of_simulate(units: dict[str, Path]) -> None:
    run = sp.simulate(TABLE_II, model="rft", motion="held", timing={"duration": 0.2, "on": [(0.0, 0.1)]})
    names = [str(name) for name in run.data_vars if name in {"position", "battery_voltage", "motor_rotation_rate"}]
    names += ["tail_angle", "body_angle", "motor_current", "motor_torque", "forward_velocity", "battery_charge_used"]
    switched = {"time": [0.0, 0.1, 0.1, 0.2], "remote": [True, True, False, False], "duty": [1.0] * 4}
    found = simulated(units["plain"], switched, stop=0.2, step=0.005, output=names)
    assert len(found) == 41
    for name in names:
        values = run[name].values
        scale = float(np.abs(values).max())
        assert found[name][-1] == pytest.approx(float(values[-1]), abs=1e-9 * scale), name


@needs_compiler
def test_a_motor_with_a_curve_runs_as_simulate_runs_it(tmp_path: Path) -> None:
    curve = {"drive.rates": ["0 Hz", "2 Hz", "5 Hz"], "drive.torques": ["0.2 mN m", "0.18 mN m", "0 N m"]}
    robot = sp.load(WIDE, **{"drive.kind": "torque-speed", "friction.reading": "none"}, **curve)
    sp.export(robot, tmp_path / "curve.fmu", model="rft")
    run = sp.simulate(robot, model="rft", motion="held", timing={"duration": 0.2, "on": [(0.0, 0.1)]})
    names = ["position", "tail_angle", "body_angle", "forward_velocity", "drive_torque"]
    switched = {"time": [0.0, 0.1, 0.1, 0.2], "remote": [True, True, False, False], "duty": [1.0] * 4}
    found = simulated(tmp_path / "curve.fmu", switched, stop=0.2, step=0.005, output=names)
    for name in names:
        scale = float(np.abs(run[name].values).max())
        assert found[name][-1] == pytest.approx(float(run[name].values[-1]), abs=1e-9 * scale), name
    described = fmpy.read_model_description(str(tmp_path / "curve.fmu"))
    assert not [item.name for item in described.modelVariables if item.name.startswith(("battery", "motor."))]


@needs_compiler
def test_steps_of_any_length_give_the_same_run(units: dict[str, Path]) -> None:
    on = {"time": [0.0, 0.2], "remote": [True, True], "duty": [0.6, 0.6]}
    many, few = (simulated(units["plain"], on, stop=0.2, step=step) for step in (0.001, 0.1))
    for name in ("position", "motor_current", "battery_charge_used", "body_angle"):
        assert many[name][-1] == pytest.approx(few[name][-1], rel=1e-8)


@needs_compiler
def test_steady_state_in_an_imposed_flow_is_that_of_predict(units: dict[str, Path]) -> None:
    steady = sp.predict(WIDE, model="tube", placement=PLACED)
    found = simulated(units["flow"], {"time": [0.0], "remote": [True]}, stop=0.5, step=0.1)
    for name in ("forward_velocity", "tail_rotation_rate", "body_rotation_rate", "motor_current", "electrical_power"):
        assert found[name][-1] == pytest.approx(getattr(steady, name), rel=1e-7), name


@needs_compiler
def test_parameters_can_be_set(units: dict[str, Path]) -> None:
    weak = sp.load(WIDE, **FIELDS, **{"battery.voltage": "3.2 V"})
    run = sp.simulate(weak, model="rft", motion="held", timing={"duration": 0.1})
    on = {"time": [0.0], "remote": [True]}
    found = simulated(units["plain"], on, stop=0.1, step=0.05, start_values={"battery.voltage": 3.2})
    assert found["position"][-1] == pytest.approx(float(run["position"][-1]), rel=1e-9)
    dead = simulated(units["plain"], on, stop=0.1, step=0.05, start_values={"battery.voltage": 0.0})
    assert not dead["position"].any()


@needs_compiler
@pytest.mark.skipif(sys.platform == "win32", reason="dlopen")
def test_plain_c_program_loads_it(units: dict[str, Path], tmp_path: Path) -> None:
    host = tmp_path / "host"
    source = Path(__file__).parent / "fmu_host.c"
    subprocess.run([str(COMPILER), "-std=gnu99", "-o", str(host), str(source), "-ldl", "-lm"], check=True)
    with zipfile.ZipFile(units["plain"]) as archive:
        library = next(name for name in archive.namelist() if name.startswith("binaries/"))
        archive.extract(library, tmp_path)
        description = archive.read("modelDescription.xml").decode()
    token = re.findall('instantiationToken="([^"]*)"', description)[0]
    done = subprocess.run([str(host), str(tmp_path / library), token], capture_output=True, text=True, check=True)
    first, *others = done.stdout.splitlines()
    time, position, tail_angle, current, charge = map(float, first.split())
    run = sp.simulate(TABLE_II, model="rft", motion="held", timing={"duration": 0.2, "on": [(0.0, 0.1)]})
    assert time == pytest.approx(0.2)
    assert position == pytest.approx(float(run["position"][-1]), rel=1e-9)
    assert tail_angle == pytest.approx(float(run["tail_angle"][-1]), rel=1e-9)
    assert current == pytest.approx(float(run["motor_current"][-1]), abs=1e-10)
    assert charge == pytest.approx(float(run["battery_charge_used"][-1]), rel=1e-9)
    assert others == [
        "3: an input or parameter is no number",
        "3: the step is no positive time",
        "3: the step does not begin where the last one ended",
        "3: the instantiation token is that of another FMU",
        "9",
    ]


@needs_compiler
def test_state_can_be_kept(units: dict[str, Path]) -> None:
    check_kept_state(units["plain"], [10, 18])


@needs_compiler
def test_same_robot_gives_the_same_bytes_of_text(units: dict[str, Path], tmp_path: Path) -> None:
    sp.export(TABLE_II, tmp_path / "again.fmu", model="rft")
    with zipfile.ZipFile(units["plain"]) as first, zipfile.ZipFile(tmp_path / "again.fmu") as second:
        assert first.namelist() == second.namelist()
        for name in first.namelist():
            if not name.startswith("binaries/"):
                assert first.read(name) == second.read(name), name


RELEASED = sp.load(WIDE, **{"battery.capacity": "0.1 mA h"})
"""Its battery is empty after 1.2 s."""


@pytest.fixture(scope="module")
def released(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The FMU of a robot released in its tube."""
    path = tmp_path_factory.mktemp("released") / "released.fmu"
    sp.export(RELEASED, path, motion="free")
    return path


def check_moment(found: Any, moment: Any, tolerance: float) -> None:
    """The end of a run of an FMU against a moment of a plant, over the largest value of each."""
    vectors = {"position": moment.pose.position, "attitude": moment.pose.attitude}
    pairs = [(f"{name}[{n + 1}]", float(value)) for name, of in vectors.items() for n, value in enumerate(of)]
    for name, value in (*pairs, *moment.values.items()):
        if name in found.dtype.names:
            scale = max(abs(value), float(np.abs(found[name]).max()))
            assert found[name][-1] == pytest.approx(value, abs=tolerance * scale), name


@needs_compiler
def test_released_robot_by_fmpy_is_that_of_a_plant(released: Path) -> None:
    from fmpy.validation import validate_fmu

    assert validate_fmu(str(released)) == []
    plant = sp.Plant(RELEASED)
    moment = plant.step(2.0)
    assert plant.state.spent
    for step in (0.05, 0.1):  # the run does not depend on the importer's steps
        found = simulated(released, {"time": [0.0], "remote": [True]}, stop=2.0, step=step)
        check_moment(found, moment, 1e-9)


@needs_compiler
def test_released_robot_takes_remote_and_duty(released: Path) -> None:
    plant = sp.Plant(RELEASED)
    plant.step(0.3)
    plant.step(0.2, remote=False)
    moment = plant.step(1.5, duty=0.9)
    switched = {
        "time": [0.0, 0.3, 0.3, 0.5, 0.5, 2.0],
        "remote": [True, True, False, False, True, True],
        "duty": [1.0] * 4 + [0.9] * 2,
    }
    found = simulated(released, switched, stop=2.0, step=0.05)
    check_moment(found, moment, 1e-6)  # rounding, which contact amplifies: ten tolerances of the integrator


@needs_compiler
def test_released_robot_ends_at_the_end_of_its_channel(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    quick = tuple(option for option in build._OPTIONS if option != "-O2")
    monkeypatch.setattr(build, "_OPTIONS", quick)
    short = sp.load(WIDE, **{"channel.length": "105.8 mm"})
    plant = sp.Plant(short)
    moment = plant.step(2.0)
    assert moment.ended == "end of the channel"
    sp.export(short, tmp_path / "short.fmu", motion="free")
    found = simulated(tmp_path / "short.fmu", {"time": [0.0], "remote": [True]}, stop=2.0, step=0.1)
    assert len(found) < 12
    assert found["position[1]"][-1] == pytest.approx(moment.pose.position[0], rel=1e-9)


@needs_compiler
def test_state_of_a_released_robot_can_be_kept(released: Path) -> None:
    check_kept_state(released, [10, 19])


def test_units_are_their_si_bases() -> None:
    assert base_units("m/(s N m)") == {"s": 1, "kg": -1, "m": -1}
    assert base_units("V s/rad") == {"kg": 1, "m": 2, "s": -2, "A": -1, "rad": -1}
    assert base_units("1") == {}


def test_without_a_compiler_nothing_is_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(build.shutil, "which", lambda _name: None)
    with pytest.raises(sp.InputError, match="no C compiler is installed"):
        sp.export(WIDE, tmp_path / "robot.fmu", model="rft")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"phase": 0.3}, "only for the robot's shape"),
        ({"sidecar": True}, "only for the robot's shape"),
        ({"model": "nonsense"}, "nonsense"),
        ({"motion": "nonsense"}, "held, free"),
        ({"motion": "free", "model": "rft"}, "allowed: 'tube', or 'auto'"),
        ({"model": "rft", "placement": {"flow": 1e-3}}, "does not compute the channel's walls"),
    ],
)
def test_wrong_options_are_a_sentence(tmp_path: Path, options: dict[str, Any], sentence: str) -> None:
    with pytest.raises(sp.InputError, match=sentence):
        sp.export(WIDE, tmp_path / "robot.fmu", **options)
    with pytest.raises(sp.InputError, match=r"only with \.fmu"):
        sp.export(WIDE, tmp_path / "robot.stl", friction="none")
