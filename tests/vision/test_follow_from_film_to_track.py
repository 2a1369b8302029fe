"""Whole films: what is true of a drawn robot is measured, and what is wrong with a film is said."""

import numpy as np
import pytest

from spirillum.errors import InputError
from spirillum.vision.camera.camera import scale_of
from spirillum.vision.setup import Region, load_setup
from spirillum.vision.track.assembly import FrameDetection, follow

pytest.importorskip("av")
pytest.importorskip("cv2")

from bench_scenes import FPS, scene
from bench_troubles import Film
from comparisons import slope


def track(film, folder, *, name="a.mp4", **changes):
    setup, robot = load_setup(film.write(folder / name, **changes))
    return follow(folder / name, setup, robot)


@pytest.fixture(scope="module")
def swimmer(flat_pictures, tmp_path_factory):
    """11 pixels in 12 frames, with 2 frames a second; and its film."""
    turning = {"body_rate": -0.4, "tail_rate": 3.0}
    film = flat_pictures.Flat(
        frames=12, fps=2.0, velocity=1e-3, direction="left", view="side", lamp=0.1, noise=2.0, **turning
    )
    path = tmp_path_factory.mktemp("swimmer") / "a.mp4"
    film.write(path)
    return film, path


@pytest.fixture(scope="module")
def followed(swimmer):
    """Its track, what was seen on each frame, and the progress that was told."""
    _, path = swimmer
    setup, robot = load_setup(path.with_name("a.setup.toml"))
    setup = setup.model_copy(update={"end": 1000.0})  # beyond the film, which changes nothing
    seen: list[FrameDetection] = []
    done: list[int] = []
    found = follow(
        path,
        setup,
        robot,
        progress=lambda count, total: done.append(count),
        on_frame=lambda index, image, state: seen.append(state),
    )
    return found, seen, done


def test_speed_and_direction_from_the_side_and_to_the_left(swimmer, followed):
    film, _ = swimmer
    found, seen, done = followed
    true = film.truth(found.time)
    assert slope(found.time, found.position[:, 0]) == pytest.approx(1e-3, rel=5e-3)
    assert found.heading == pytest.approx(0.0, abs=0.02)
    pixel = found.scale.length_per_pixel
    assert found.position[:, 0] == pytest.approx(true["x"], abs=0.5 * pixel)  # the middle of the picture is x = 0
    assert found.position[:, 1].mean() == pytest.approx(0.0, abs=0.2 * pixel)
    assert np.nanmedian(found.position_error) < 0.1 * pixel
    assert pixel == pytest.approx((0.2 - 0.015) / 350.0, rel=1e-3)
    assert found.size == (320, 240)
    assert done == list(range(1, 13))
    assert [state.time for state in seen] == found.time.tolist()
    assert found.picture[0, 2] < found.picture[0, 0]  # the nose is on the left
    assert not [flag for flag in found.flags if flag.spoils]
    assert found.drift == 0.0  # a camera on a stand


def test_only_the_scale(swimmer):
    _, path = swimmer
    setup, _ = load_setup(path.with_name("a.setup.toml"))
    sight, video = scale_of(path, setup)
    assert sight.scale.length_per_pixel == pytest.approx((0.2 - 0.015) / 350.0, rel=1e-3)
    assert video.size == (320, 240)


def test_what_a_small_region_hides_is_said_to_be_looked_for_in_it_alone(swimmer):
    _, path = swimmer
    setup, robot = load_setup(path.with_name("a.setup.toml"))
    setup = setup.model_copy(update={"region": Region(left=0, top=0, width=80, height=60)})
    with pytest.raises(InputError, match="alone: make it larger, or leave it out"):
        follow(path, setup, robot)


def test_a_start_beyond_the_film_is_refused(swimmer):
    _, path = swimmer
    setup, robot = load_setup(path.with_name("a.setup.toml"))
    with pytest.raises(InputError, match=r"start = 8 s, but a.mp4 ends at 6 s; allowed: a start before its end"):
        follow(path, setup.model_copy(update={"start": 8.0}), robot)


def test_a_robot_that_leaves_is_kept_as_far_as_it_was_seen(flat_pictures, tmp_path):
    film = flat_pictures.Flat(frames=11, fps=2.0, start=(0.03, 0.0), velocity=0.02, body_rate=0.1, tail_rate=0.5)
    found = track(film, tmp_path)
    assert "robot-left-the-view" in [flag.name for flag in found.flags]
    seen = np.isfinite(found.position[:, 0])
    assert seen[:4].all()
    assert not seen[-3:].any()
    whole = seen & (film.truth(found.time)["x"] < 0.06)
    assert slope(found.time[whole], found.position[whole, 0]) == pytest.approx(0.02, rel=0.01)


@pytest.mark.slow
def test_a_nose_on_the_other_side_gives_no_numbers(flat_pictures, tmp_path):
    found = track(flat_pictures.Flat(frames=4), tmp_path, robot_direction='"left"')
    flag = next(flag for flag in found.flags if "forward_velocity" in flag.spoils)
    assert flag.name == "nose-on-the-other-side"  # the reason that is given


def test_a_robot_that_is_clear_only_the_other_way_round_names_the_direction(flat_pictures, tmp_path, monkeypatch):
    from spirillum.vision.track import initial_detection

    answers = iter([False, True])
    monkeypatch.setattr(initial_detection, "_detect_by_seal", lambda *given: None)
    monkeypatch.setattr(initial_detection, "_clear", lambda found: next(answers, False))
    monkeypatch.setattr("spirillum.vision.track.identity.best_other_size", lambda *given: None)
    with pytest.raises(InputError, match=r"robot.direction = 'right', but .* other side; allowed: 'left'"):
        track(flat_pictures.Flat(frames=2), tmp_path)


def test_two_robots_give_no_numbers(flat_pictures, tmp_path):
    cv2 = pytest.importorskip("cv2")
    one = flat_pictures.Flat(frames=4, fps=5.0, start=(0.02, 0.012), velocity=2e-3)
    other = flat_pictures.Flat(frames=4, fps=5.0, start=(0.0, -0.012), velocity=5e-3)
    floor = flat_pictures.Flat(start=(1.0, 0.0)).draw(0.0).astype(int)
    for index, (time, picture) in enumerate(one.pictures()):
        second = other.draw(time)
        here = np.abs(second - floor).sum(axis=2) > 6
        picture[here] = second[here]
        (tmp_path / "film").mkdir(exist_ok=True)
        cv2.imwrite(str(tmp_path / "film" / f"{index}.png"), picture[:, :, ::-1])
    (tmp_path / "film.setup.toml").write_text(one.setup_text())
    setup, robot = load_setup(tmp_path / "film.setup.toml")
    found = follow(tmp_path / "film", setup, robot)
    flag = next(flag for flag in found.flags if flag.name == "two-robots")
    assert "forward_velocity" in flag.spoils


@pytest.mark.slow
def test_what_has_neither_stripes_nor_tail_of_the_robot_gives_no_numbers(flat_pictures, tmp_path):
    plain = {"stripes": ("white", "black") * 4, "wire": flat_pictures.Flat.floor}
    found = track(flat_pictures.Flat(frames=4, fps=2.0, **plain), tmp_path)
    (flag,) = [flag for flag in found.flags if flag.name == "not-the-robot"]
    assert {"forward_velocity", "body_rotation_rate", "tail_rotation_rate", "lateral_position"} <= set(flag.spoils)


def test_a_robot_in_full_view_for_a_while_is_measured_then(flat_pictures, tmp_path):
    film = flat_pictures.Flat(frames=18, fps=3.0, start=(0.035, 0.0), velocity=0.008, body_rate=-0.3, tail_rate=3.0)
    found = track(film, tmp_path)
    assert "they are left out" in next(f.sentence for f in found.flags if f.name == "robot-partly-out-of-view")
    seen = np.isfinite(found.position[:, 0])
    nose = film.truth(found.time)["x"] + 0.5 * film.robot.body.length
    edge = 0.5 * film.size[0] * (film.camera_height - film.axis_height) / film.focal
    assert not seen[nose > edge].any()
    assert seen[nose < edge - 0.006].all()  # edges are compared some pixels around
    assert slope(found.time, found.position[:, 0]) == pytest.approx(0.008, rel=2e-3)
    assert slope(found.time, found.tail_phase) == pytest.approx(3.0, rel=2e-3)


def test_no_robot_and_no_ruler_get_a_sentence(flat_pictures, tmp_path):
    empty = flat_pictures.Flat(frames=1, start=(1.0, 0.0), noise=4.0, size=(240, 120))
    with pytest.raises(InputError, match="no robot like 'biorob2012-wide'"):
        track(empty, tmp_path)
    bare = flat_pictures.Flat(frames=1, ruler=False, size=(240, 120))
    setup = bare.write(tmp_path / "b.mp4")
    setup.write_text(flat_pictures.Flat().setup_text())
    with pytest.raises(InputError, match="shows no ruler"):
        follow(tmp_path / "b.mp4", *load_setup(setup))


@pytest.mark.slow
def test_clutter_that_fits_the_other_way_round_does_not_name_the_direction(tmp_path):
    """A body in the floor's brightness is not found; what stands out instead is now here, now there."""
    scenery = scene("virtual", 0, "bare")
    frames = range(0, 76, 5)
    film = Film([scenery.draw(k / FPS) for k in frames], list(frames), [k / FPS for k in frames], dict(scenery.setup))
    path, setup = film.write(tmp_path, scenery.robot_text)
    with pytest.raises(InputError, match="no robot like"):
        follow(path, *load_setup(setup))


def test_after_a_gap_the_robot_is_found_where_it_went(tmp_path):
    """It went on over no more than a frame, though the times say that it should be three pixels further."""
    scenery = scene("flat", 7)
    frames = range(0, 72, 3)
    numbers = [k + (30 if k >= 36 else 0) for k in frames]
    film = Film([scenery.draw(k / FPS) for k in frames], numbers, [k / FPS for k in frames], dict(scenery.setup))
    path, setup = film.write(tmp_path, scenery.robot_text)
    found = follow(path, *load_setup(setup))
    step, pixel = np.diff(found.position[:, 0]), found.scale.length_per_pixel
    true = scenery.truth.velocity * 3 / FPS
    assert 11 * true > 3 * pixel
    assert step == pytest.approx(np.full(step.size, true), abs=0.25 * pixel)
    assert "times-do-not-fit" in [flag.name for flag in found.flags]


def test_a_robot_that_jumps_away_is_found_where_it_is(tmp_path):
    """Two films that were joined, 16 pixels: edges of the wrong place would fit well enough to be followed on."""
    scenery = scene("flat", 2)
    images = [scenery.draw(k / FPS) for k in range(0, 72, 3)]
    count = len(images)
    film = Film([*images, *images], list(range(2 * count)), [k / FPS for k in range(2 * count)], dict(scenery.setup))
    path, setup = film.write(tmp_path, scenery.robot_text)
    found = follow(path, *load_setup(setup))
    x, pixel = found.position[:, 0], found.scale.length_per_pixel
    assert x[count - 1] - x[0] > 10.0 * pixel
    assert x[count:] == pytest.approx(x[:count], abs=0.25 * pixel)
    assert [flag.name for flag in found.flags] == ["video-is-cut"]
