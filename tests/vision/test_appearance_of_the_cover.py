"""The setup says whether the body's cover is opaque or glass; unset it is unknown."""

import tomllib

import numpy as np
import pytest

from spirillum.errors import InputError
from spirillum.measurement.setup_template import setup_answer, setup_text
from spirillum.vision.camera.optics import BodyPose, optics_of
from spirillum.vision.setup import Setup, load_setup
from spirillum.vision.track.lone_outline import appearance_of


def test_unset_it_is_unknown_and_the_template_offers_it(tmp_path):
    text = setup_text()
    assert Setup.model_validate(tomllib.loads(text)).robot.appearance == "unknown"
    (tmp_path / "a.toml").write_text(text.replace("# appearance", "appearance"))
    assert load_setup(tmp_path / "a.toml")[0].robot.appearance == "glass"


def test_another_word_is_refused(tmp_path):
    (tmp_path / "a.toml").write_text(setup_text().replace('# appearance = "glass"', 'appearance = "clear"'))
    with pytest.raises(InputError, match=r"robot\.appearance = 'clear'.*'opaque'"):
        load_setup(tmp_path / "a.toml")


def test_what_a_setup_names_is_refused_under_its_name(tmp_path):
    """Its robot, and the pictures of a checkerboard, as `measure` would refuse them."""
    path = tmp_path / "a.toml"
    path.write_text(setup_text().replace('file = "biorob2012-wide"', 'file = "none.toml"'))
    with pytest.raises(InputError, match=r"a\.toml: robot\.file: none\.toml does not exist"):
        load_setup(path)
    board = 'images = "board"\ncolumns = 9\nrows = 6\nsquare = "10 mm"'
    path.write_text(f"{setup_text()}\n[camera.checkerboard]\n{board}\n")
    with pytest.raises(InputError, match=r"a\.toml: camera\.checkerboard\.images: .*board is no folder"):
        setup_answer(path)
    (tmp_path / "board").mkdir()
    with pytest.raises(InputError, match=r"a\.toml: camera\.checkerboard\.images: .*board holds 0 pictures"):
        setup_answer(path)


@pytest.mark.parametrize(
    ("cover", "says"), [("paint", "opaque"), ("liner", "glass"), ("battery", "glass"), ("floor", "unknown")]
)
def test_covers_as_they_are_drawn_are_told(flat_pictures, tmp_path, cover, says):
    """Paint is a flat film; glass is drawn over it: a bright rim about a dark liner, or a battery in an empty cover."""
    floor = flat_pictures.Flat.floor
    flat = flat_pictures.Flat(frames=4, fps=2.0, noise=3.0, fine=3, body=floor if cover == "floor" else (70, 70, 72))
    (tmp_path / "setup.toml").write_text(flat.setup_text())
    setup, robot = load_setup(tmp_path / "setup.toml")
    v, u = np.mgrid[: flat.size[1], : flat.size[0]]
    samples = []
    for time, picture in flat.pictures():
        x = float(flat.truth(time)["x"])
        scale = flat.focal / (flat.camera_height - flat.axis_height)
        along = (u - 0.5 * (flat.size[0] - 1)) / scale - x
        across = -(v - 0.5 * (flat.size[1] - 1)) / scale
        inside = (along > -0.0055) & (np.hypot(np.maximum(along - 0.0085, 0.0), across) < 0.009)
        rim = inside & (np.hypot(np.maximum(along - 0.0085, 0.0), across) > 0.0078)
        if cover == "liner":
            picture[rim] = 225
        if cover == "battery":
            picture[inside] = floor
            picture[inside & (along < 0.006) & (np.abs(across) < 0.006)] = 60
        samples.append((picture, BodyPose(x, 0.0, 0.0)))
    assert appearance_of(robot, optics_of(setup, flat.size, flat.focal), samples) == says
