"""`export`: answers, files whole or not at all, one sentence for bad input."""

import importlib.util
import json
import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import spirillum as sp

WIDE = "biorob2012-wide"


def test_answer_agrees_with_the_file(run: Callable[..., Any], tmp_path: Path) -> None:
    outcome = run("export", WIDE, str(tmp_path / "robot.stl"), "--phase", "90deg", "--fineness", "0.5", "--json")
    assert (outcome.code, outcome.err) == (0, "")
    answer = json.loads(outcome.out)
    assert answer["schema"] == "spirillum.export/1"
    assert answer["phase"] == {"value": pytest.approx(1.5707963), "unit": "rad"}
    assert [item["file"] for item in answer["files"]] == [str(tmp_path / "robot.stl")]
    data = (tmp_path / "robot.stl").read_bytes()
    assert len(data) == 84 + 50 * answer["solid"]["triangles"]
    assert data[:80].decode().strip() == f"written by spirillum: {WIDE}, unit mm"
    assert answer["solid"]["watertight"]
    assert [piece["name"] for piece in answer["pieces"]] == ["body", "shaft", "coupling", "stub", "tail"]
    assert all(piece["watertight"] for piece in answer["pieces"])
    mass = sum(link["mass"]["value"] for link in answer["links"].values())
    assert mass == pytest.approx(sp.load(WIDE).derived()["mass"].value)


@pytest.mark.parametrize("ending", ["stl", "glb", "vtp"])
def test_one_file_and_nothing_else_is_written(run: Callable[..., Any], tmp_path: Path, ending: str) -> None:
    outcome = run("export", WIDE, str(tmp_path / f"robot.{ending}"))
    assert (outcome.code, outcome.err) == (0, "")
    assert [path.name for path in tmp_path.iterdir()] == [f"robot.{ending}"]


@pytest.mark.parametrize("ending", ["urdf", "mjcf", "xml"])
def test_a_description_refers_to_files_beside_it(run: Callable[..., Any], tmp_path: Path, ending: str) -> None:
    outcome = run("export", WIDE, str(tmp_path / f"robot.{ending}"), "--model", "rft", "--notes")
    assert outcome.code == 0
    beside = {f"robot.{ending}", "robot-meshes", "robot.resistance.json"}
    assert {path.name for path in tmp_path.iterdir()} == beside
    text = (tmp_path / f"robot.{ending}").read_text()
    named = {Path(name).name for name in re.findall(r'file(?:name)?="([^"]+)"', text)}
    assert named == {path.name for path in (tmp_path / "robot-meshes").iterdir()}
    assert str(tmp_path) not in text
    assert ("MuJoCo's own fluid" in outcome.out) == (ending != "urdf")


def test_own_files_are_replaced_and_others_stay(run: Callable[..., Any], tmp_path: Path) -> None:
    command = ("export", WIDE, str(tmp_path / "robot.urdf"), "--no-sidecar")
    assert run(*command).code == 0
    (tmp_path / "robot-meshes" / "mine.stl").write_text("mine")
    assert run(*command).code == 0
    assert (tmp_path / "robot-meshes" / "mine.stl").read_text() == "mine"
    for name in ("robot.urdf", "robot-meshes/body.stl"):
        whole = (tmp_path / name).read_bytes()
        (tmp_path / name).write_text("mine")
        outcome = run(*command)
        assert outcome.code == 2
        assert f"{name} is there and of unknown origin" in outcome.err
        assert (tmp_path / name).read_text() == "mine"
        (tmp_path / name).write_bytes(whole)


MICRO = (
    *("--set", "body.diameter=1um", "--set", "body.length=2.5um", "--set", "body.mass=2pg", "--set", "seal=none"),
    *("--set", "coupling.diameter=0mm", "--set", "coupling.length=0.1um", "--set", "coupling.clearance=0um"),
    *("--set", "tail.wavelength=2um", "--set", "tail.amplitude=0.2um", "--set", "tail.length=6um"),
    *("--set", "tail.wire_diameter=40nm"),
)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["robot.step"], "does not end in .stl or .glb or .vtp or .urdf or .mjcf or .xml"),
        (["robot"], "does not end in"),
        (["no/such/folder/robot.stl"], "no such folder"),
        (["folder.stl"], "is not a regular file"),
        (["robot.glb", "--unit", "mm"], "unit = 'mm' for .glb; allowed: mm, um or m, only for .stl"),
        (["robot.stl", "--unit", "inch"], "unit = 'inch' for .stl"),
        (["robot.stl", "--phase", "1"], 'phase = "1" has no unit'),
        (["robot.stl", "--fineness", "0"], "fineness = 0.0; allowed: 0.1 to 20"),
        (["robot.stl", "--fineness", "nan"], "fineness = nan"),
        (["robot.stl", "--fineness", "fine"], "--fineness"),
        (["robot.stl", "--model", "rft"], "allowed: only with the sidecar"),
        (["robot.urdf", "--model", "rft", "--no-sidecar"], "allowed: only with the sidecar"),
        (["robot.urdf", "--sidecar", "--no-sidecar"], "allowed: one of them"),
        (["robot.urdf", "--model", "sbt"], "model = 'sbt' does not give the whole resistance"),
        (["robot.urdf", "--model", "tube"], "allowed: rft, slender"),
        (["robot.urdf", "--model", "slendr"], "did you mean slender"),
        (["robot.mjcf", *MICRO], "the least that MuJoCo takes; .urdf has no such bound"),
        (["robot.urdf", "--set", "body.mass=0g"], "body.mass"),
        (["robot.urdf", "--set", "coupling.length=0mm"], "with model 'slender': coupling.length = 0 mm; allowed"),
        (["robot.stl", "--set", "seal.length=30mm"], "seal.length = 30 mm; allowed: at most 26 mm"),
        (["robot.stl", "--set", "motor.shaft_diameter=0.8"], "has no unit"),
        (["taken.urdf", "--no-sidecar"], "taken-meshes cannot be written; allowed: a new name"),
        (["blocked.urdf"], "blocked.resistance.json is not a regular file; allowed: a new file"),
    ],
)
def test_bad_input_is_one_sentence_and_leaves_nothing(
    run: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str], words: str
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder.stl").mkdir()
    (tmp_path / "taken-meshes").write_text("a file where the folder should be")
    (tmp_path / "blocked.resistance.json").mkdir()
    before = sorted(path.name for path in tmp_path.rglob("*"))
    outcome = run("export", WIDE, *arguments)
    assert (outcome.code, outcome.out) == (2, "")
    assert words in outcome.err
    assert outcome.err.count("\n") == 1
    assert sorted(path.name for path in tmp_path.rglob("*")) == before


@pytest.mark.parametrize("unset", ["body.mass", "tail.density"])
@pytest.mark.parametrize("ending", ["urdf", "mjcf"])
def test_a_description_needs_masses(tmp_path: Path, unset: str, ending: str) -> None:
    robot = sp.load(WIDE, **{unset: None})
    with pytest.raises(sp.InputError, match=rf"{unset} is missing; allowed: body\.mass and tail\.density"):
        sp.export(robot, tmp_path / f"robot.{ending}")
    assert list(tmp_path.iterdir()) == []


def test_more_triangles_than_mujoco_reads_are_refused() -> None:
    from spirillum.exports.descriptions import MeshFile, check_triangles

    check_triangles([MeshFile("wire", "rotor", None, 200_000, b"")])
    with pytest.raises(sp.InputError, match=r"wire\.stl would have 200001 triangles; allowed: at most 200000"):
        check_triangles([MeshFile("body", "body", None, 5, b""), MeshFile("wire", "rotor", None, 200_001, b"")])


def test_a_failure_on_the_way_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    written = Path.write_bytes

    def full(self: Path, data: bytes) -> int:
        if self.name == "wire.stl":
            raise OSError(28, "No space left on device", str(self))
        return written(self, data)

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(OSError, match="No space left on device"):
        sp.export(WIDE, tmp_path / "robot.urdf", sidecar=False)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_closed_folder_is_named_before_any_work(run: Callable[..., Any], tmp_path: Path) -> None:
    closed = tmp_path / "closed"
    closed.mkdir(mode=0o500)
    outcome = run("export", WIDE, str(closed / "robot.stl"))
    assert outcome.code == 2
    assert "permission denied" in outcome.err


def test_the_example_of_the_help_runs(run: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")
    example = re.search(r"Example: spirillum (.*)", run("export", "--help").out)
    assert example
    assert run(*example[1].split()).code == 0


def test_the_library_that_joins_is_asked_for_only_where_it_is_used(tmp_path: Path) -> None:
    assert importlib.util.find_spec("manifold3d") is not None
    found: Any = sp.export(WIDE, tmp_path / "robot.vtp")
    assert found.solid is None
