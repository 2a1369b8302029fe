"""A wrong scale makes the body look too large or too small: speeds are doubted or withheld, rates are not touched."""

from types import SimpleNamespace

import numpy as np
import pytest

from comparisons import slope
from spirillum.errors import InputError
from spirillum.robot.load import load
from spirillum.vision.camera.camera import bounds_of, scale_of
from spirillum.vision.setup import load_setup
from spirillum.vision.track.assembly import follow
from spirillum.vision.track.body import BodyFinder
from spirillum.vision.track.learning import _check_scale
from spirillum.vision.track.size import checked_scale

pytest.importorskip("av")
pytest.importorskip("cv2")

FRAMES, FPS = 12, 2.0
SIZE = 2.0 * np.hypot(0.005, 0.2 / 35.0)
"""Two of the stated standard errors of the apparent size: half a body has 35 pixels here."""


@pytest.fixture(scope="module")
def film(flat_pictures, tmp_path_factory):
    """A drawn film, a function that tracks it with some lines of the setup changed, and its file."""
    flat = flat_pictures.Flat(frames=FRAMES, fps=FPS, velocity=1e-3, body_rate=-0.4, tail_rate=3.0, noise=2.0)
    path = tmp_path_factory.mktemp("size") / "a.mp4"
    setup = flat.write(path)

    def tracked(**changes):
        setup.write_text(flat.setup_text(**changes))
        return follow(path, *load_setup(setup))

    return flat, tracked, path


def flags(track):
    return {flag.name: flag for flag in track.flags}


@pytest.fixture(scope="module")
def resting(flat_pictures, tmp_path_factory):
    """The track of a robot at rest with a tail that turns, at the right scale."""
    flat = flat_pictures.Flat(frames=12, fps=2.0, velocity=0.0, body_rate=0.0, tail_rate=2.0)
    path = tmp_path_factory.mktemp("resting") / "a.mp4"
    return follow(path, *load_setup(flat.write(path)))


def test_the_right_scale_is_not_doubted(resting):
    assert resting.scale.apparent_size == pytest.approx(1.0, abs=SIZE)
    assert "size-does-not-fit" not in flags(resting)


@pytest.mark.parametrize(
    ("changes", "size"),
    [
        ({"markers_spacing": '"1.9 mm"'}, 0.95),
        pytest.param({"robot_axis_height": '"25 mm"'}, 175 / 185, marks=pytest.mark.slow),
    ],
    ids=["spacing", "depth"],
)
def test_a_scale_off_by_a_twentieth_widens_the_interval_beyond_its_error(film, changes, size):
    flat, tracked, _ = film
    found = tracked(**changes)
    assert found.scale.apparent_size == pytest.approx(size, abs=SIZE)
    flag = flags(found)["size-does-not-fit"]
    assert not flag.spoils
    off = abs(slope(found.time, found.position[:, 0]) / flat.velocity - 1.0)
    assert off == pytest.approx(1.0 - size, abs=0.01)
    assert off < 1.96 * found.scale.relative_uncertainty
    assert found.scale.sources["size of the body"] == pytest.approx(abs(np.log(size)), abs=SIZE)
    assert slope(found.time, found.body_angle) == pytest.approx(flat.body_rate, rel=5e-3)
    assert slope(found.time, found.tail_phase) == pytest.approx(flat.tail_rate, rel=5e-3)


def named_spacing(flag, spacing):
    """The one that would fit, mm, in place of that of the setup."""
    assert f"in place of {spacing:.3g} mm would fit" in flag.sentence
    return float(flag.sentence.partition("markers.spacing = ")[2].split(" ")[0])


@pytest.mark.slow
@pytest.mark.parametrize("factor", [0.8, 1.25])
def test_a_wrong_spacing_of_the_ruler_is_named(film, factor):
    flat, tracked, _ = film
    track = tracked(markers_spacing=f'"{2.0 * factor} mm"')
    flag = flags(track)["size-does-not-fit"]
    assert "forward_velocity" in flag.spoils
    assert named_spacing(flag, 2.0 * factor) == pytest.approx(2.0, rel=0.04)  # a pixel or so of a body of 70
    assert slope(track.time, track.tail_phase) == pytest.approx(flat.tail_rate, rel=2e-3)
    withheld = any("body_rotation_rate" in flag.spoils for flag in track.flags)  # stripes may seem uneven by the scale
    assert withheld or slope(track.time, track.body_angle) == pytest.approx(flat.body_rate, rel=0.02)


def test_a_stated_uncertainty_of_depth_explains_a_size(film, tmp_path):
    """Of a body that looks as it does where its axis is 10 mm lower than stated; to follow a film adds nothing."""
    path, judged = tmp_path / "setup.toml", []
    for uncertainty in ("0 mm", "10 mm"):
        path.write_text(
            film[0].setup_text(robot_axis_height='"25 mm"', robot_axis_height_uncertainty=f'"{uncertainty}"')
        )
        setup, robot = load_setup(path)
        sight, video = scale_of(film[2], setup)
        body = BodyFinder(robot, sight.optics, bounds_of(setup, video))
        judged.append([flag.name for flag in checked_scale(sight.scale, body, 175 / 185, tail=175 / 185).flags])
    assert judged == [["size-does-not-fit"], []]


@pytest.mark.slow
def test_a_stated_uncertainty_of_depth_explains_it(film):
    flat, tracked, _ = film
    found = tracked(robot_axis_height='"25 mm"', robot_axis_height_uncertainty='"10 mm"')
    assert "size-does-not-fit" not in flags(found)
    assert slope(found.time, found.tail_phase) == pytest.approx(flat.tail_rate, rel=5e-3)


@pytest.mark.parametrize(("spacing", "size"), [pytest.param(4, 2.0, marks=pytest.mark.slow), (1, 0.5)])
def test_a_scale_off_by_two_gives_rates_and_no_speed(film, spacing, size):
    flat, tracked, _ = film
    found = tracked(markers_spacing=f'"{spacing} mm"')
    assert found.scale.apparent_size == pytest.approx(size, rel=0.02)
    assert "forward_velocity" in flags(found)["size-does-not-fit"].spoils
    assert "lateral_position" in flags(found)["size-does-not-fit"].spoils
    assert named_spacing(flags(found)["size-does-not-fit"], spacing) == pytest.approx(2.0, rel=0.04)
    assert slope(found.time, found.body_angle) == pytest.approx(flat.body_rate, rel=5e-3)
    assert slope(found.time, found.tail_phase) == pytest.approx(flat.tail_rate, rel=5e-3)


def test_a_robot_at_rest_is_placed_by_its_outline_and_its_tail_is_read(resting):
    found = resting
    assert np.nanmedian(found.heading) == pytest.approx(0.0, abs=np.radians(0.6))
    assert slope(found.time, found.position[:, 0]) == pytest.approx(0.0, abs=2e-6)
    assert slope(found.time, found.tail_phase) == pytest.approx(2.0, rel=5e-3)
    assert not [flag for flag in found.flags if flag.spoils]


def test_a_scale_in_another_unit_is_refused_before_an_outline_is_computed() -> None:
    """What would take minutes, or more memory than there is."""
    video, robot = SimpleNamespace(name="video", size=(320, 240)), load("biorob2012-wide")
    for length_per_pixel in (2e-9, 0.52e-6, 10.0):
        with pytest.raises(InputError, match="pixels long; allowed: 4 to 1280 of this picture"):
            _check_scale(video, length_per_pixel, robot)
    _check_scale(video, 0.52e-3, robot)
