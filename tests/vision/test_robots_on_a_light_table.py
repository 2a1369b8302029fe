"""A third style of picture, written without a look at the tracker: what is true there is measured, too."""

from dataclasses import replace

import numpy as np
import pytest

from spirillum.vision.camera.camera import opened, samples_of
from spirillum.vision.setup import load_setup
from spirillum.vision.track.assembly import follow
from spirillum.vision.track.learning import learnt_from

pytest.importorskip("av")
pytest.importorskip("cv2")

from bench_scenes import FPS, Scene, scene
from bench_troubles import TROUBLES, Film
from comparisons import slope

FRAMES = np.arange(0, 76, 6)
HALF_TURN_OF_PATTERN = 180.0


@pytest.fixture(scope="module")
def drawn() -> tuple[Scene, Film]:
    """A robot that goes to the right at 1.2 mm/s, every sixth frame of three seconds."""
    scenery = scene("light-table", 0)
    images = [scenery.draw(index / FPS) for index in FRAMES]
    return scenery, Film(images, FRAMES.tolist(), (FRAMES / FPS).tolist(), dict(scenery.setup))


@pytest.fixture(scope="module")
def clean(drawn, tmp_path_factory):
    """The track of that film, with no trouble."""
    scenery, film = drawn
    return tracked(film, scenery, tmp_path_factory.mktemp("clean"))


def tracked(film, scenery, folder):
    path, setup = film.write(folder, scenery.robot_text)
    return follow(path, *load_setup(setup))


def with_trouble(name, film, scenery, seed=1):
    trouble = next(one for one in TROUBLES if one.name == name)
    return trouble.change(film, scenery, np.random.default_rng(seed))


def test_speed_rates_and_place_are_those_that_were_drawn(drawn, clean):
    scenery, found = drawn[0], clean
    true = scenery.truth
    assert slope(found.time, found.position[:, 0]) == pytest.approx(true.velocity, rel=0.01)
    assert slope(found.time, found.body_angle) == pytest.approx(true.body_rate, rel=0.01)
    assert slope(found.time, found.tail_phase) == pytest.approx(true.tail_rate, rel=0.002)
    assert np.mean(found.position[:, 1]) == pytest.approx(true.lateral, abs=0.25 / scenery.scale)
    assert not [flag.name for flag in found.flags if flag.spoils]


def test_the_first_stripe_is_where_the_drawing_has_it(drawn, clean):
    scenery, found = drawn[0], clean
    true = scenery.truth.body_angle + scenery.truth.body_rate * found.time
    off = np.degrees(found.body_angle - true) % HALF_TURN_OF_PATTERN
    assert np.minimum(off, HALF_TURN_OF_PATTERN - off).max() < 2.0
    phase = np.degrees(found.tail_phase - scenery.truth.tail_phase - scenery.truth.tail_rate * found.time) % 360.0
    assert np.minimum(phase, 360.0 - phase).max() < 4.0


def test_glare_on_the_seal_hides_the_stripes_and_not_the_robot(drawn, tmp_path):
    """The body stands out less, and no stripe is read: its whole tail says that it is the robot."""
    scenery, film = drawn
    name = "glare, moving"
    found = tracked(with_trouble(name, film, scenery, [1902, 0, sum(name.encode())]), scenery, tmp_path)
    names = {flag.name for flag in found.flags}
    assert "not-the-robot" not in names
    assert "stripes-unreadable" in names
    assert slope(found.time, found.position[:, 0]) == pytest.approx(scenery.truth.velocity, rel=0.02)


def test_with_a_wrong_spacing_the_body_is_learnt_as_large_as_it_looks(tmp_path):
    """To a part in 300: at one in 100, stripes at its rim are off by degrees and seem uneven."""
    scenery = scene("flat", 1)
    images, setup = [scenery.draw(k / FPS) for k in FRAMES], scenery.setup | {"markers.spacing": '"2.2 mm"'}
    path, file = Film(images, FRAMES.tolist(), (FRAMES / FPS).tolist(), setup).write(tmp_path, scenery.robot_text)
    stated, robot = load_setup(file)
    video = opened(path, stated)
    known = learnt_from(video, samples_of(video, stated.start, stated.end), stated, robot, tmp_path).known
    assert known.start.body.optics.focal == pytest.approx(1.15 * scenery.size[0], rel=3e-3)
    assert known.size == pytest.approx(1.1, abs=0.006)


def test_half_hidden_stripes_are_told_and_widen_the_rate(drawn, clean, tmp_path):
    scenery, film = drawn
    u, v = np.meshgrid(np.arange(scenery.size[0]), np.arange(scenery.size[1]))
    body, half = scenery.truth.robot.body, []
    for image, time in zip(film.images, film.times, strict=True):
        at = scenery.middle(time) - scenery.scale * np.array([0.35 * body.length, 0.3 * body.diameter])
        far = np.hypot((u - at[0]) / (0.3 * body.length), (v - at[1]) / (0.22 * body.diameter)) / scenery.scale
        half.append(np.clip(image + 340.0 * np.exp(-(far**4))[..., None], 0, 255).astype(np.uint8))
    found = tracked(replace(film, images=half), scenery, tmp_path)
    (flag,) = [flag for flag in found.flags if flag.name == "stripes-under-glare"]
    assert not flag.spoils  # the body turned by five stripes
    assert found.body_angle_drift == pytest.approx(np.radians(12.0))
    few = slice(0, 5)  # and here by less than two
    short = Film(half[few], film.numbers[few], film.times[few], film.setup)
    (flag,) = [flag for flag in tracked(short, scenery, tmp_path).flags if flag.name == "stripes-under-glare"]
    assert "body_rotation_rate" in flag.spoils
    assert clean.body_angle_drift == 0.0
    assert "stripes-under-glare" not in {flag.name for flag in clean.flags}


@pytest.mark.parametrize("name", ["frames lost, times even", "camera rolled", "frames missing"])
def test_troubles_change_films_as_they_say(drawn, name):
    scenery, film = drawn
    changed = with_trouble(name, film, scenery)
    if name == "camera rolled":
        assert changed.numbers == film.numbers
        assert not np.array_equal(changed.images[0], film.images[0])
        return
    kept = [film.times.index(time) for time in changed.times]
    assert 0 < len(film.images) - len(changed.images) < 4
    assert all(image is film.images[index] for image, index in zip(changed.images, kept, strict=True))
    even = list(range(len(kept)))
    assert changed.numbers == (even if "even" in name else [film.numbers[index] for index in kept])
