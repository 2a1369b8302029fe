"""A picture's pixels are where projection puts the robot's geometry, and the stripes have their colours in order."""

import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import spirillum as sp
from spirillum.dynamics.run_file import RobotPose
from spirillum.view.scene3d.scene import DrawnRobot, Scene, level_height, resting
from spirillum.view.scene3d.scenery import VIEWS, fitted
from spirillum.view.scene3d.show import glass_around, scene_points

SIZE = (400, 226)
SAID = "robot.png: biorob2012-wide, 160x90 pixels, view perspective\n"
_TURN = np.array([0.96, 0.2, -0.12, 0.15])
TILTED = RobotPose(np.array([0.02, -0.01, 0.03]), _TURN / np.linalg.norm(_TURN), 2.0)


def drawn(solids: DrawnRobot, camera: Any, pose: RobotPose, size: tuple[int, int] = SIZE, **more: Any) -> np.ndarray:
    with Scene(solids, size, **more) as scene:
        scene.place(pose)
        scene.look(camera)
        return scene.image().copy()


def extent(mask: np.ndarray) -> np.ndarray:
    """Edges of what is drawn: left, top, right, bottom."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    return np.array([columns[0], rows[0], columns[-1] + 1, rows[-1] + 1])


@pytest.fixture(scope="module")
def tilted(free_robot: Any) -> Iterator[Scene]:
    """One scene for all views of a tilted robot: to make one takes longer than to look at it."""
    with Scene(DrawnRobot.of(free_robot), SIZE) as scene:
        scene.place(TILTED)
        yield scene


@pytest.mark.parametrize("view", VIEWS)
def test_silhouette_is_where_the_mesh_projects_to(free_robot: Any, tilted: Scene, view: str) -> None:
    points = DrawnRobot.of(free_robot).points(TILTED)
    camera = fitted(view, points, SIZE, (0.1, 0.1, 0.1))
    tilted.look(camera)
    mask = np.any(tilted.image() != 255, axis=2)
    pixels = camera.pixels(points, SIZE)
    assert extent(mask) == pytest.approx(np.concatenate([pixels.min(axis=0), pixels.max(axis=0)]), abs=1.6)


def test_rows_that_are_left_out_change_nothing(free_robot: Any) -> None:
    solids = DrawnRobot.of(free_robot)
    pose = resting(solids)
    camera = fitted("perspective", solids.corners(pose), SIZE)
    whole = drawn(solids, camera, pose)
    band = drawn(solids, camera, pose, rows=170)
    assert np.array_equal(band[:28], np.full_like(band[:28], 255))
    assert np.abs(whole.astype(int) - band).max(axis=2).mean() < 0.05


def test_robots_of_metres_and_micrometres_look_the_same() -> None:
    def similar(unit: str) -> Any:
        return sp.load(
            {
                "name": "similar",
                "body": {"shape": "spheroid", "length": f"2.5 {unit}", "diameter": f"0.9 {unit}"},
                "tail": {
                    "wavelength": f"2.2 {unit}",
                    "amplitude": f"0.2 {unit}",
                    "length": f"7 {unit}",
                    "wire_diameter": f"0.1 {unit}",
                },
                "coupling": {"clearance": f"0.1 {unit}"},
                "fluid": {"viscosity": "1e-3 Pa s", "density": "1000 kg/m^3"},
            }
        )

    pictures = [sp.show(similar(unit), size=SIZE, view="side").pixels[50:170] for unit in ("um", "mm")]
    assert np.abs(pictures[0].astype(int) - pictures[1]).max(axis=2).mean() < 0.2
    assert np.any(pictures[0] < 200)


ROLL, ROLLED_SIZE = 0.3, (960, 540)
ROLLED = RobotPose(np.zeros(3), np.array([np.cos(0.5 * ROLL), np.sin(0.5 * ROLL), 0.0, 0.0]), 0.0)


@pytest.fixture(scope="module")
def rolled(free_robot: Any) -> Iterator[Scene]:
    """One scene for all views of a robot that has rolled."""
    with Scene(DrawnRobot.of(free_robot), ROLLED_SIZE) as scene:
        scene.place(ROLLED)
        yield scene


@pytest.mark.parametrize("view", ["side", "top", "perspective"])
def test_stripes_have_their_colours_in_order(free_robot: Any, rolled: Scene, view: str) -> None:
    from spirillum.robot.mesh import STRIPE_COLOURS

    solids = DrawnRobot.of(free_robot)
    stripes = free_robot.seal.stripes
    radius, x = 0.5 * free_robot.body.diameter, -0.5 * free_robot.body.length + 0.5 * free_robot.seal.length
    camera = fitted(view, solids.corners(ROLLED), ROLLED_SIZE)
    rolled.look(camera)
    image = rolled.image().astype(float)
    names = list(dict.fromkeys(stripes))
    known = np.array([STRIPE_COLOURS[name] for name in names])
    known = known / np.linalg.norm(known, axis=1, keepdims=True)
    seen = 0
    for number, colour in enumerate(stripes):
        angle = 0.5 * np.pi + 2.0 * np.pi * number / len(stripes) + ROLL  # from +z on towards -y: positive about +x
        outwards = np.array([0.0, np.cos(angle), np.sin(angle)])
        if outwards @ camera.sight > -0.55:
            continue
        column, row = camera.pixels((np.array([x, 0, 0]) + radius * outwards)[None], ROLLED_SIZE)[0]
        found = image[int(row), int(column)]
        assert names[int(np.argmax(known @ (found / np.linalg.norm(found))))] == colour
        seen += 1
    assert seen >= 2


def test_channel_is_drawn_at_its_radius_and_the_robot_on_its_floor() -> None:
    robot = sp.load("biorob2012-wide")
    solids = DrawnRobot.of(robot)
    pose = resting(solids)
    assert level_height(solids) == pytest.approx(-0.5 * (0.040 - 0.018), abs=1e-6)
    glass = (-0.1, 0.04)
    camera = fitted("front", scene_points(solids, pose, glass), SIZE, (0.1, 0.1, 0.1))
    image = drawn(solids, camera, pose, glass=glass)
    rings = {}
    for share in (0.93, 1.017, 1.06):
        angle = np.linspace(0.1, np.pi - 0.1, 60)
        ring = 0.020 * share * np.stack([0 * angle, np.cos(angle), np.sin(angle)], axis=-1)
        columns, rows = camera.pixels(ring, SIZE).astype(int).T
        rings[share] = image[rows, columns].min(axis=1).mean()
    assert rings[1.017] < 215
    assert min(rings[0.93], rings[1.06]) > 240


def test_glass_ends_where_the_channel_ends() -> None:
    solids = DrawnRobot.of(sp.load("biorob2012-wide"))
    spare = 0.16 * solids.length
    nose, tip = 0.0175, -0.0875
    assert glass_around(solids, 0.0, 0.1) == pytest.approx((tip - spare, 0.1 + nose + spare), abs=1e-3)
    assert glass_around(solids, 0.0, 0.3, middle=0.02) == pytest.approx((tip - spare, 0.02 + 0.175), abs=1e-3)
    assert glass_around(solids, 1.0, 1.0, middle=0.02) is None


def test_tail_too_wide_for_its_body_lies_higher() -> None:
    robot = sp.load("biorob2012-wide", **{"tail.amplitude": "12 mm", "tail.wavelength": "30 mm"})
    solids = DrawnRobot.of(robot)
    assert level_height(solids) == pytest.approx(-(0.020 - 0.0125), abs=2e-5)


def test_png_says_what_it_shows(tmp_path: Path) -> None:
    from PIL import Image

    path = tmp_path / "robot.png"
    picture = sp.show("biorob2012-narrow", path, size="320x180", view="top", phase="90 deg")
    with Image.open(path) as image:
        assert image.size == (320, 180)
        assert np.array_equal(np.asarray(image), picture.pixels)
        assert image.info["Title"] == "biorob2012-narrow"
        assert "right-handed helical tail of 60 mm length" in image.info["Description"]
        assert "not a photograph" in image.info["Description"]
    assert [entry.name for entry in tmp_path.iterdir()] == ["robot.png"]


def test_turning_the_tail_leaves_the_body(free_robot: Any) -> None:
    first, second = (sp.show(free_robot, size=SIZE, view="side", phase=phase) for phase in (0.0, 2.0))
    changed = np.abs(first.pixels.astype(int) - second.pixels).max(axis=2) > 12
    columns = first.camera.pixels(np.array([[-0.5 * free_robot.body.length - 0.002, 0, 0]]), SIZE)[0, 0]
    assert changed.any()
    assert not changed[:, int(columns) + 2 :].any()


def test_command_says_its_own_words_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """Nothing of what the drawing libraries write past Python's streams is seen, either."""
    from spirillum.cli import main

    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as ended:
        main(["show", "biorob2012-wide", "--size", "160x90"])
    assert ended.value.code in (None, 0)
    assert capfd.readouterr() == (SAID, "")


@pytest.mark.slow
def test_command_in_a_fresh_process_says_its_own_words_and_nothing_else(tmp_path: Path) -> None:
    """What the drawing libraries say where they are loaded would be seen here."""
    command = [sys.executable, "-c", "from spirillum.cli import main; main()"]
    asked = ["show", "biorob2012-wide", "--size", "160x90"]
    done = subprocess.run([*command, *asked], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, re.sub(r"drawing .* elapsed\n", "", done.stderr)) == (0, SAID, "")
