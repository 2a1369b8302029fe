"""The tail's wavelength, measured without any outline, says whether the ruler or the body's outline is wrong."""

import numpy as np
import pytest

from spirillum.robot.load import load
from spirillum.vision.camera.optics import BodyPose, optics_of
from spirillum.vision.camera.scale import Scale
from spirillum.vision.flag import LENGTHS
from spirillum.vision.setup import load_setup
from spirillum.vision.track.body import BodyFinder
from spirillum.vision.track.size import checked_scale
from spirillum.vision.track.tail import TailWave

pytest.importorskip("cv2")
PIXEL = 0.25e-3
SCALE = Scale(PIXEL, 0.002, {}, 80, 0.05)


@pytest.fixture(scope="module")
def body(flat_pictures, tmp_path_factory):
    flat, path = flat_pictures.Flat(), tmp_path_factory.mktemp("size") / "setup.toml"
    path.write_text(flat.setup_text())
    setup, robot = load_setup(path)
    return BodyFinder(robot, optics_of(setup, flat.size, flat.focal), (0, 0, *flat.size))


@pytest.mark.parametrize("longer", [0.93, 1.0, 1.06])
def test_the_apparent_wavelength_is_that_of_the_drawn_tail(flat_pictures, tmp_path, longer):
    """To half a per cent, by a reader that knows the file's own tail; pictures are drawn with another one."""
    drawn = load("biorob2012-wide", **{"tail.wavelength": f"{25.0 * longer} mm"})
    flat = flat_pictures.Flat(robot=drawn, frames=12, noise=2.0, fine=4, tail_rate=5.0, fps=6.0)
    (tmp_path / "setup.toml").write_text(flat.setup_text())
    setup, robot = load_setup(tmp_path / "setup.toml")
    wave = TailWave(robot, setup, optics_of(setup, flat.size, flat.focal))
    wave.learn([(picture, BodyPose(float(flat.truth(at)["x"]), 0.0, 0.0)) for at, picture in flat.pictures()])
    assert wave.stretch == pytest.approx(longer, abs=0.005)


def test_a_ruler_is_doubted_where_body_and_tail_agree(body):
    found = checked_scale(SCALE, body, 0.95, 0.002, tail=0.951)
    assert [flag.name for flag in found.flags] == ["size-does-not-fit"]
    assert "markers.spacing = 2.11 mm in place of 2 mm" in found.flags[0].sentence
    assert found.scale.relative_uncertainty > 0.05
    assert found.roll_error == 0.0


def test_an_outline_is_doubted_where_the_tail_agrees_with_the_ruler(body):
    found = checked_scale(SCALE, body, 0.95, 0.002, tail=1.001)
    assert [flag.name for flag in found.flags] == ["outline-does-not-fit"]
    assert "spacing" not in found.flags[0].sentence
    assert found.flags[0].spoils == ()
    assert found.scale.relative_uncertainty == SCALE.relative_uncertainty
    assert found.roll_error > abs(np.log(0.95))


@pytest.mark.parametrize(
    ("size", "tail", "withheld"), [(0.97, np.nan, False), (0.92, np.nan, True), (0.92, 1.0, False), (1.2, 1.0, True)]
)
def test_lengths_are_withheld_the_sooner_the_less_is_known(body, size, tail, withheld):
    (flag,) = checked_scale(SCALE, body, size, 0.002, tail=tail).flags
    assert flag.name == "outline-does-not-fit"
    assert flag.spoils == ((*LENGTHS, "body_rotation_rate") if withheld else ())


def test_sizes_within_their_errors_are_not_doubted(body):
    assert checked_scale(SCALE, body, 1.005, 0.002, tail=np.nan).flags == ()


def test_a_file_is_not_blamed_where_outline_or_light_are_in_doubt(flat_pictures, tmp_path):
    """A tail of another wavelength is said to be one, but to be unseen where something else may be the reason."""
    drawn = load("biorob2012-wide", **{"tail.wavelength": "32 mm"})
    flat = flat_pictures.Flat(robot=drawn, frames=12, noise=2.0, fine=4, tail_rate=5.0, fps=6.0)
    (tmp_path / "setup.toml").write_text(flat.setup_text())
    setup, robot = load_setup(tmp_path / "setup.toml")
    wave = TailWave(robot, setup, optics_of(setup, flat.size, flat.focal))
    wave.learn([(picture, BodyPose(float(flat.truth(at)["x"]), 0.0, 0.0)) for at, picture in flat.pictures()])
    (sure,) = wave.flags_given_doubt(doubtful=False)
    assert sure.name == "tail-does-not-fit"
    assert "tail.wavelength looks like 3" in sure.sentence
    assert [flag.name for flag in wave.flags_given_doubt(doubtful=True)] == ["tail-unreadable"]
