"""Large pictures are looked at as a whole after they were reduced: where things lie, and which rulers survive it."""

from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

from spirillum.vision.camera.camera import background, ruler_of
from spirillum.vision.camera.optics import BodyPose, Optics
from spirillum.vision.camera.ruler import lines_in, resolved
from spirillum.vision.track.search import searched_at
from spirillum.vision.track.setup_free_detection import _walls
from spirillum.vision.video.frames import Frame
from spirillum.vision.video.pictures import reduced, reduction

pytest.importorskip("cv2")


@pytest.mark.parametrize(("size", "factor"), [((1280, 960), 1), ((960, 1281), 2), ((2880, 2160), 3)])
def test_usual_pictures_stay_as_they_are(size: tuple[int, int], factor: int) -> None:
    assert reduction(size) == factor


def test_a_reduced_picture_holds_the_means_of_whole_blocks() -> None:
    image = np.random.default_rng(0).integers(0, 256, (11, 14, 3), dtype=np.uint8)
    means = image[:9, :12].reshape(3, 3, 4, 3, 3).mean(axis=(1, 3))
    assert np.abs(reduced(image, 3) - means).max() <= 0.51
    frame = Frame(3, 0.1, image)
    assert frame.reduced(1) is image
    assert np.array_equal(frame.small(3).image, reduced(image, 3))


@pytest.mark.parametrize("centre", [None, (801.0, 590.0)])
def test_a_reduced_camera_sees_a_point_where_its_block_is(centre: tuple[float, float] | None) -> None:
    """Pixels count from 0 at their centres: the middle of block u of k pixels lies at k u + (k - 1) / 2."""
    camera = Optics((1601, 1200), 1800.0, 0.21, 0.0115, 0.06, 1.4, centre, 0.02, -0.01, 0.03, -0.02)
    points = np.random.default_rng(1).uniform((-0.06, -0.04, 0.0), (0.06, 0.04, 0.02), (20, 3))
    small = camera.reduced(3)
    assert small.size == (533, 400)
    assert 3.0 * small.pixels(points) + 1.0 == pytest.approx(camera.pixels(points), abs=1e-9)
    assert small.length_per_pixel == pytest.approx(3.0 * camera.length_per_pixel, rel=1e-4)


@pytest.mark.parametrize(("width", "factor"), [(300.0, 3), (100.0, 2), (30.0, 1)])
def test_a_small_body_is_looked_for_in_less_reduced_pictures(width: float, factor: int) -> None:
    assert searched_at(width, 3) == factor


@pytest.mark.parametrize("factor", [1, 3])
def test_walls_are_found_in_a_reduced_picture(factor: int) -> None:
    """Of a tube 40 mm wide, 1200 pixels of 0.1 mm across."""
    optics = Optics((1200, 900), 2000.0, 0.2, 0.0, 0.2, 1.0)
    pixel = optics.length_per_pixel
    picture = np.full((900, 1200, 3), 120, dtype=np.uint8)
    edges = [round(450 + side * 0.02 / pixel) for side in (-1, 1)]
    picture[edges[0] : edges[1]] = 180
    body = SimpleNamespace(optics=optics, robot=SimpleNamespace(body=SimpleNamespace(diameter=0.018)))
    path = [(0.1 * n, BodyPose(0.001 * n, 0.0, 0.0)) for n in range(5)]
    known = SimpleNamespace(start=SimpleNamespace(body=body, path=path))
    found = _walls(reduced(picture, factor).astype(float), known, None)
    assert found is not None
    assert found.distance * 0.018 == pytest.approx(0.04, abs=3.0 * factor * pixel)


def ruled(spacing: float) -> Frame:
    """A picture of 1440 by 240 pixels with two strips of lines, each half as wide as their distance."""
    fine = (np.arange(1440 * 8) + 0.5) / 8.0
    share = ((fine / spacing) % 1.0 < 0.5).reshape(1440, 8).mean(axis=1)
    picture = np.full((240, 1440), 200.0)
    picture[30:75] = picture[165:210] = 200.0 - 140.0 * share
    picture += np.random.default_rng(2).normal(0.0, 2.0, picture.shape)
    return Frame(0, 0.0, np.repeat(np.clip(picture, 0, 255).astype(np.uint8)[:, :, None], 3, axis=2))


@pytest.mark.parametrize(("spacing", "holds"), [(13.7, True), (4.5, False)])
def test_a_ruler_too_fine_for_a_reduced_picture_is_read_in_the_full_one(spacing: float, holds: bool) -> None:
    """In blocks of 3, lines 4.5 pixels apart show as lines 1 / (1 / 3 - 1 / 4.5) = 9 pixels apart."""
    frame, factor = ruled(spacing), 3
    found, at = ruler_of(background([frame], factor), (0, 0, 1440, 240), 0.0, factor, [frame])
    assert found is not None
    assert at == (factor if holds else 1)
    assert found.distance == pytest.approx(spacing, rel=5e-3)
    shown = lines_in(background([frame], factor), (0, 0, 480, 80))
    assert shown is not None
    shown = shown.enlarged(factor)
    assert shown.distance == pytest.approx(spacing if holds else 9.0, rel=5e-3)
    assert resolved(shown, frame.image, factor) is holds


def test_a_film_is_followed_alike_where_it_is_searched_in_reduced_pictures(
    flat_pictures: ModuleType, tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A film of 320 by 240 pixels stands for a large one: it is searched at half of that."""
    from dataclasses import replace

    from spirillum.vision.setup import load_setup
    from spirillum.vision.track import search
    from spirillum.vision.track.assembly import follow

    pytest.importorskip("av")
    path = tmp_path_factory.mktemp("reduced") / "a.mp4"
    film = flat_pictures.Flat(frames=8, fps=2.7, body_rate=-0.4, tail_rate=3.0, noise=2.0, spacing=4e-3)
    setup, robot = load_setup(film.write(path))
    monkeypatch.setattr("spirillum.vision.video.pictures._USUAL", 160)
    monkeypatch.setattr(search, "SEARCH", replace(search.SEARCH, reduced_width=8.0))
    track = follow(path, setup, robot)
    true = film.truth(track.time)
    assert np.ptp(track.position[:, 0] - true["x"]) < 0.2 * track.scale.length_per_pixel
    assert np.polyfit(track.time, track.body_angle, 1)[0] == pytest.approx(-0.4, rel=0.01)
    assert np.polyfit(track.time, track.tail_phase, 1)[0] == pytest.approx(3.0, rel=0.01)
    assert not [flag for flag in track.flags if flag.spoils]
