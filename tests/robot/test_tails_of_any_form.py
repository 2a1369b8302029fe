"""Tails of several starts, cones, tables and centre lines: what their files mean, what is refused, and their solids."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.support.commands import run_command

import spirillum as sp
from spirillum import load
from spirillum.errors import InputError
from spirillum.pages.knobs import Settings
from spirillum.robot.batch import RobotBatch
from spirillum.robot.links import robot_solids
from spirillum.robot.mesh import robot_mesh
from spirillum.robot.robot import robot_text
from spirillum.robot.shape_input import read_points
from spirillum.robot.tail_form import strand_spacing

CONE = {"from": "1 mm", "to": "3 mm"}


def helix(count: int = 61) -> list[list[float]]:
    x = np.linspace(0.0, 60.0, count)
    return np.stack([x, 2.5 * np.cos(x / 4.0), 2.5 * np.sin(x / 4.0)], axis=1).tolist()  # type: ignore[no-any-return]


def written(path: Path, points: Any, header: str = "") -> Path:
    rows = "\n".join(", ".join(str(value) for value in point) for point in points)
    path.write_text(f"{header}{rows}\n")
    return path


FORMS: dict[str, dict[str, Any]] = {
    "starts": {"starts": 3},
    "cone": {"amplitude": CONE, "wavelength": {"cone": {"from": "20 mm", "to": "30 mm"}}},
    "table": {"amplitude": [["0 mm", "1 mm"], ["20 mm", "3 mm"], ["60 mm", "2 mm"]]},
    "curve": {"curve": helix(), "starts": 2},
    "smoothed": {"curve": helix(), "curve_tolerance": "10 um"},
}


@pytest.mark.parametrize("form", FORMS)
def test_a_written_robot_is_read_back_the_same(form: str, tmp_path: Path) -> None:
    robot = load("biorob2012-wide", tail=FORMS[form])
    (tmp_path / "robot.toml").write_text(robot_text(robot))
    assert load(tmp_path / "robot.toml") == robot


@pytest.mark.parametrize("form", FORMS)
def test_a_tail_from_json_has_the_same_form(form: str) -> None:
    tail = load("biorob2012-wide", tail=FORMS[form]).tail
    again = type(tail).model_construct(**json.loads(tail.model_dump_json()))
    assert again.form == tail.form
    assert hash(again.form) == hash(tail.form)


def test_a_curve_is_found_beside_its_robot_file(tmp_path: Path) -> None:
    written(tmp_path / "points.csv", helix(), "x_mm, y_mm, z_mm\n")
    (tmp_path / "robot.toml").write_text('extends = "biorob2012-wide"\n[tail]\ncurve = "points.csv"\n')
    robot = load(tmp_path / "robot.toml")
    assert robot.tail == load("biorob2012-wide", tail={"curve": helix()}).tail
    assert robot.tail.amplitude == pytest.approx(2.5e-3, rel=1e-3)
    assert robot.tail.wavelength == pytest.approx(8e-3 * np.pi, rel=1e-3)
    assert (robot.tail.length, robot.tail.handedness) == (pytest.approx(0.06), "right")


def test_sizes_of_a_cone_are_the_largest_amplitude_and_the_turns() -> None:
    tail = load("biorob2012-wide", tail=FORMS["cone"]).tail
    assert tail.amplitude == pytest.approx(3e-3)
    assert tail.length / tail.wavelength == pytest.approx(60.0 / 10.0 * np.log(1.5), rel=1e-6)
    assert load("biorob2012-wide", tail=FORMS["cone"] | {"amplitude": "2 mm"}).tail.amplitude_along is None


@pytest.mark.parametrize("form", FORMS)
def test_wires_have_the_volume_centroid_and_inertia_of_their_mesh(form: str) -> None:
    robot = load("biorob2012-wide", tail=FORMS[form] | ({} if "curve" in FORMS[form] else {"taper": "none"}))
    solid = robot_solids(robot)["tail"]
    wires = [piece for piece in robot_mesh(robot, fineness=4.0) if piece.name == "tail"]
    assert len(wires) == robot.tail.starts
    volume = sum(wire.volume for wire in wires)
    assert volume == pytest.approx(solid.volume, rel=2e-3)
    centroid = np.sum([wire.volume * wire.centroid for wire in wires], axis=0) / volume
    assert np.allclose(centroid, solid.centroid, rtol=0.0, atol=2e-5)
    across = solid.inertia[1, 1] + solid.inertia[2, 2] - solid.inertia[0, 0]  # 2 int x^2: the wire's length matters
    assert across == pytest.approx(2.0 * solid.volume * _variance(wires, centroid), rel=5e-3)


def _variance(wires: Any, centroid: np.ndarray) -> float:
    """Mean square axial distance of the wires from their centroid, by their triangles' tetrahedra."""
    total = volume = 0.0
    for wire in wires:
        a, b, c = np.moveaxis((wire.vertices - centroid)[wire.faces], 1, 0)
        six = np.sum(a * np.cross(b, c), axis=1)
        x = np.stack([a[:, 0], b[:, 0], c[:, 0]])
        total += float(np.sum(six * (np.sum(x**2, axis=0) + np.sum(x, axis=0) ** 2) / 120.0))
        volume += float(np.sum(six)) / 6.0
    return total / volume


def test_spacing_of_wires_against_brute_force() -> None:
    t = np.linspace(-10.0, 10.0, 4001)
    for wavelength, amplitude, starts in ((25.0, 2.5, 2), (25.0, 2.5, 3), (12.0, 4.0, 4), (6.0, 5.0, 3)):
        x, p = wavelength * t / (2.0 * np.pi), 2.0 * np.pi / starts
        other = np.stack([x, amplitude * np.cos(t + p), amplitude * np.sin(t + p)], axis=1)
        nearest = np.min(np.linalg.norm(other - np.array([0.0, amplitude, 0.0]), axis=1))
        assert strand_spacing(wavelength, amplitude, starts)[0] == pytest.approx(nearest, rel=1e-4)


def test_a_batch_scales_a_cone_and_keeps_a_curve() -> None:
    cone = RobotBatch.of(load("biorob2012-wide", tail=FORMS["cone"]))
    both = cone.with_values({"tail.amplitude": np.array([3e-3, 1.5e-3])})
    assert both.arc_length[0] == pytest.approx(float(cone.arc_length[0]), rel=1e-12)
    assert both.arc_length[1] < both.arc_length[0]
    with pytest.raises(InputError, match=r"tail\.amplitude follows from tail\.curve"):
        RobotBatch.of(load("biorob2012-wide", tail={"curve": helix()})).with_values({"tail.amplitude": 1e-3})


def crossing() -> list[list[float]]:
    """A loop whose end comes back through its beginning."""
    t = np.linspace(0.0, 1.9 * np.pi, 60)
    return np.stack([10.0 + 8.0 * np.sin(2.0 * t), 5.0 * np.cos(t), 0.0 * t], axis=1).tolist()  # type: ignore[no-any-return]


WRONG: dict[str, tuple[dict[str, Any], str]] = {
    "no wire": ({"starts": 0}, "tail.starts = 0"),
    "forty wires": ({"starts": 40}, "tail.starts = 40"),
    "part of a wire": ({"starts": 1.5}, "tail.starts = 1.5"),
    "wires that touch": ({"starts": 12, "amplitude": "1.5 mm"}, "wires (tail.starts) would touch"),
    "cone without units": ({"amplitude": {"from": 1, "to": "3 mm"}}, "tail.amplitude.from"),
    "half a cone": ({"amplitude": {"from": "1 mm"}}, "is no cone"),
    "table in disorder": ({"amplitude": [["0 mm", "1 mm"], ["0 mm", "2 mm"], ["60 mm", "3 mm"]]}, "distance 2"),
    "short table": ({"amplitude": [["0 mm", "1 mm"], ["30 mm", "2 mm"]]}, "not given from the root to the tip"),
    "one point": ({"curve": [[0.0, 2.5, 0.0]]}, "has 1 point"),
    "not a number": ({"curve": [*helix()[:30], [30.0, float("nan"), 0.0], *helix()[31:]]}, "point 31"),
    "two columns": ({"curve": [[0.0, 1.0]] * 5}, "is not 3 numbers"),
    "a repeated point": ({"curve": [*helix()[:30], helix()[29], *helix()[30:]]}, "points 30 and 31 are the same"),
    "points in disorder": ({"curve": [*helix()[:30], helix()[45], *helix()[30:]]}, "in order along the wire"),
    "a curve that cuts itself": ({"curve": crossing()}, "would touch"),
    "a curve through the tube": ({"curve": [[x, 8.0 * y, 8.0 * z] for x, y, z in helix(241)]}, "channel.diameter"),
    "a curve in the body": ({"curve": [[x - 5.0, y, z] for x, y, z in helix()]}, "before the root"),
    "a curve with a kink": (
        {"curve": [[x, 0.6 * np.sin(2.0 * x), 0.0] for x in np.linspace(0.0, 40.0, 401).tolist()]},
        "curve's radius",
    ),
    "a curve with a size of its own": (
        {"curve": helix(), "amplitude": "3 mm"},
        "tail.amplitude = 3 mm with tail.curve",
    ),
    "a tolerance alone": ({"curve_tolerance": "1 mm"}, "without tail.curve"),
}


@pytest.mark.parametrize("what", WRONG)
def test_wrong_tails_get_a_sentence(what: str) -> None:
    form, said = WRONG[what]
    with pytest.raises(InputError) as caught:
        load("biorob2012-wide", tail=form)
    assert any(said in problem for problem in caught.value.problems)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("header", "scale"),
    [("x_m,y_m,z_m", 1e-3), ("x [um],y [um],z [um]", 1e3), ("X (mm),Y (mm),Z (mm)", 1.0), ("x,y,z", 1.0)],
)
def test_a_header_may_name_another_unit(header: str, scale: float, tmp_path: Path) -> None:
    path = written(tmp_path / "points.csv", (scale * np.array(helix())).tolist(), f"{header}\n")
    assert np.allclose(read_points(path, ("x", "y", "z"), "tail.curve"), helix(), rtol=1e-12, atol=0.0)


def test_none_takes_nothing_away() -> None:
    plain = load("biorob2012-wide")
    for setting in ({"tail.curve": "none"}, {"body.profile": "none"}, {"tail": {"curve": "none"}}):
        assert load("biorob2012-wide", **setting) == plain
    assert load("biorob2012-wide", coupling="none").coupling.length == 0.0


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ("y,x,z\n0, 0, 0\n", "line 1: columns 'y, x, z'; allowed: "),
        ("x_kg,y_kg,z_kg\n0, 0, 0\n", "or in another length, as x_m"),
        ("x_m,y,z\n0, 0, 0\n", "or in another length, as x_m"),
        ("0 0 0\n1 0 1\n", "line 1: columns '0 0 0'"),
        ("0, 0, 0\n1, nan, 0\n", "line 2: '1, nan, 0' is no point"),
        ("x,y,z\n0,0\n", "line 2"),
        ("", "is empty"),
        ("1,2,3\n" * 2001, "at most 2000"),
    ],
)
def test_wrong_files_of_points_get_a_sentence(rows: str, said: str, tmp_path: Path) -> None:
    (tmp_path / "points.csv").write_text(rows)
    (tmp_path / "robot.toml").write_text('extends = "biorob2012-wide"\n[tail]\ncurve = "points.csv"\n')
    with pytest.raises(InputError) as caught:
        load(tmp_path / "robot.toml")
    assert said in str(caught.value)


def test_a_missing_file_of_points_ends_with_exit_code_2(tmp_path: Path) -> None:
    (tmp_path / "robot.toml").write_text('extends = "biorob2012-wide"\n[tail]\ncurve = "nowhere.csv"\n')
    outcome = run_command("predict", str(tmp_path / "robot.toml"))
    assert outcome.code == 2
    assert "nowhere.csv" in outcome.err


def test_what_follows_from_points_is_no_number_of_its_own() -> None:
    robot = load("biorob2012-wide", tail={"curve": helix()})
    assert robot.source_of("tail.wavelength") == "tail.curve"
    assert robot.source_of("tail.wire_diameter") is None
    fields = [knob["field"] for knob in Settings("biorob2012-wide").knob_data(robot)]
    assert "tail.amplitude" not in fields
    assert "tail.wire_diameter" in fields
    with pytest.raises(InputError, match=r"vary tail\.wavelength follows from tail\.curve"):
        sp.design(robot, vary={"tail.wavelength": ("15 mm", "30 mm")}, maximise="forward_velocity", model="rft")


def test_a_knob_of_the_page_scales_a_cone(tmp_path: Path) -> None:
    text = 'extends = "biorob2012-wide"\n[tail]\namplitude = { from = "1 mm", to = "3 mm" }\n'
    (tmp_path / "cone.toml").write_text(text)
    robot = Settings(tmp_path / "cone.toml").changed("tail.amplitude", "2.4 mm").robot()
    assert robot.tail.amplitude == pytest.approx(2.4e-3)
    assert robot.tail.amplitude_along == ((0.0, pytest.approx(1 / 3)), (1.0, 1.0))
