"""Glare is told where edges pass under it, and only there: what is white and moves along, or lies aside, is not."""

from types import ModuleType
from typing import Any

import numpy as np
import pytest

from spirillum.vision.camera.optics import BodyPose, optics_of
from spirillum.vision.setup import load_setup
from spirillum.vision.track.body import BodyFinder
from spirillum.vision.track.learning import Glare, standing_glare

pytest.importorskip("cv2")
REAR, MIDDLE, NOSE, ASIDE, RIM = (-0.014, 0.0), (0.0, 0.0), (0.022, 0.003), (-0.014, 0.012), (0.018, 0.005)
"""Places of the glare from the body's mid-length halfway through the film, m."""


@pytest.fixture(scope="module")
def body(flat_pictures: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> BodyFinder:
    flat, path = flat_pictures.flat(), tmp_path_factory.mktemp("glare") / "setup.toml"
    path.write_text(flat.setup_text())
    setup, robot = load_setup(path)
    return BodyFinder(robot, optics_of(setup, flat.size, flat.focal), (0, 0, *flat.size))


def told(flat_pictures: ModuleType, finder: BodyFinder, at: Any = None, moves: float = 0.0, **look: Any) -> Glare:
    """What is told of a film in which the robot goes 10 pixels, and glare a share of that with it."""
    flat = flat_pictures.flat(**({"frames": 6, "fps": 2.0, "velocity": 2e-3, "noise": 3.0, "fine": 3} | look))
    x = flat.truth(flat.times)["x"]
    v, u = np.mgrid[: flat.size[1], : flat.size[0]]
    images, poses = [], []
    for (_, picture), place in zip(flat.pictures(), x, strict=True):
        shown = picture.copy()
        if at is not None:
            lies = x.mean() + at[0] + moves * (place - x.mean())
            column, row = flat.pixels(np.array([lies, at[1], flat.axis_height]))
            shown[(u - column) ** 2 / 1.6 + (v - row) ** 2 * 1.6 < 8.0**2] = 255
        images.append(shown)
        poses.append(BodyPose(float(place), 0.0, 0.0))
    return standing_glare(images, poses, finder)


@pytest.mark.parametrize("at", [REAR, NOSE])
def test_glare_under_which_an_end_passes_is_told_with_its_place(
    flat_pictures: ModuleType, body: BodyFinder, at: tuple[float, float]
) -> None:
    found = told(flat_pictures, body, at)
    flat = flat_pictures.flat(frames=6, fps=2.0, velocity=2e-3)
    column, row = flat.pixels(np.array([flat.truth(flat.times)["x"].mean() + at[0], at[1], flat.axis_height]))
    [flag] = found.flags
    assert found.drift > 0.0
    assert flag.name == "standing-glare"
    assert flag.spoils == ()
    assert f"at column {column:.0f}, row {row:.0f} " in flag.sentence


@pytest.mark.parametrize(
    ("at", "moves", "look"),
    [
        (None, 0.0, {}),
        (REAR, 1.0, {}),  # a highlight on the body
        (NOSE, 1.0, {}),
        (RIM, 1.0, {"velocity": 1.2e-3}),  # a slow robot, and a highlight that reaches over its rim
        (ASIDE, 0.0, {}),
        (MIDDLE, 0.0, {"velocity": 0.2e-3}),  # no edge comes there
        (None, 0.0, {"body": (250, 250, 250), "seal": (250, 250, 250)}),
        (None, 0.0, {"floor": (252, 252, 252)}),
    ],
)
def test_nothing_is_told_of_what_moves_along_or_lies_aside(
    flat_pictures: ModuleType, body: BodyFinder, at: Any, moves: float, look: dict[str, Any]
) -> None:
    assert told(flat_pictures, body, at, moves, **look) == (0.0, ())


@pytest.mark.parametrize(("brighter", "named"), [(60.0, True), (10.0, False)])
def test_a_lamp_mirrored_in_the_surface_is_told_by_its_edge(
    flat_pictures: ModuleType, body: BodyFinder, brighter: float, named: bool
) -> None:
    """It adds to robot and floor alike, is nowhere white, and covers the front of the body."""
    flat = flat_pictures.flat(
        frames=6, fps=2.0, velocity=2e-3, noise=3.0, fine=3, floor=(110, 120, 115), lines=(40, 30, 60)
    )
    x = flat.truth(flat.times)["x"]
    edge, _ = flat.pixels(np.array([x.mean() + 0.01, 0.0, flat.axis_height]))
    images = []
    for _, picture in flat.pictures():
        shown = picture.astype(float)
        shown[:, round(edge) :] += brighter
        images.append(np.clip(shown, 0, 255).astype(np.uint8))
    found = standing_glare(images, [BodyPose(float(place), 0.0, 0.0) for place in x], body)
    assert [flag.name for flag in found.flags] == (["standing-glare"] if named else [])
    if named:
        column = int(found.flags[0].sentence.partition("at column ")[2].split(",")[0])
        assert column == pytest.approx(edge, abs=4)  # a step over four pixels
