"""Pixel aspect ratio and orientation that a file states are applied and mentioned; a setup may replace the ratio."""

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from spirillum.errors import InputError
from spirillum.vision.video.display import frame_display
from spirillum.vision.video.frames import open_video

av = pytest.importorskip("av")
cv2 = pytest.importorskip("cv2")
Image = pytest.importorskip("PIL.Image")

DISC = (60.3, 40.7, 18.0)
"""Centre and radius of a disc as it is to be shown, pixels."""
SHOWN = (120, 80)


def disc(stored: tuple[int, int]) -> np.ndarray:
    """The disc as it is stored in other columns: an ellipse, its edges drawn to a tenth of a pixel."""
    fine = 8
    u = ((np.arange(stored[0] * fine) + 0.5) / fine) * SHOWN[0] / stored[0] - 0.5
    v = (np.arange(stored[1] * fine) + 0.5) / fine - 0.5
    inside = np.hypot(u[None, :] - DISC[0], v[:, None] - DISC[1]) < DISC[2]
    grey = 40 + 160 * inside.reshape(stored[1], fine, stored[0], fine).mean(axis=(1, 3))
    return np.repeat(grey[..., None], 3, axis=2).round().astype(np.uint8)


def film(path: Path, picture: np.ndarray, ratio: Fraction | None = None, matrix: list[int] | None = None) -> Path:
    with av.open(str(path), "w") as container:
        stream = container.add_stream("mpeg4" if path.suffix == ".avi" else "libx264", rate=25)
        stream.height, stream.width, stream.pix_fmt = *picture.shape[:2], "yuv420p"
        stream.bit_rate = 4_000_000
        if ratio is not None:
            stream.codec_context.sample_aspect_ratio = ratio
        if matrix is not None:
            stream.set_display_matrix(matrix)
        for _ in range(6):
            for packet in stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")):
                container.mux(packet)
        for packet in stream.encode():
            container.mux(packet)
    return path


def ellipse(picture: np.ndarray) -> tuple[float, float, float, float]:
    """Centre and half axes (by second moments) of what is bright, pixels."""
    weight = np.clip((picture.mean(axis=2) - 40.0) / 160.0, 0.0, 1.0)
    weight[weight < 0.1] = 0.0
    v, u = np.indices(weight.shape)
    u0, v0 = (float(np.average(w, weights=weight)) for w in (u, v))
    a, b = (2 * float(np.sqrt(np.average((w - c) ** 2, weights=weight))) for w, c in ((u, u0), (v, v0)))
    return u0, v0, a, b


@pytest.mark.parametrize("ending", [".mp4", ".mov", ".mkv", ".avi"])
@pytest.mark.parametrize(("stored", "ratio"), [(132, (10, 11)), (110, (12, 11)), (90, (4, 3)), (60, (2, 1))])
def test_a_disc_is_shown_round(tmp_path, ending, stored, ratio):
    path = film(tmp_path / f"a{ending}", disc((stored, SHOWN[1])), Fraction(*ratio))
    video = open_video(path)
    frame = next(iter(video.frames()))
    assert video.size == SHOWN == frame.image.shape[1::-1]
    assert ellipse(frame.image) == pytest.approx((*DISC[:2], DISC[2], DISC[2]), abs=0.35)
    assert [flag.name for flag in video.flags] == ["pixels-not-square"]
    assert f"{ratio[0] / ratio[1]:.6g}" in video.flags[0].sentence
    assert f"{stored} x 80" in video.flags[0].sentence
    assert video.stretch == pytest.approx((SHOWN[0] / stored, 1.0), rel=0.01)
    as_stored = open_video(path, pixel_aspect_ratio=1.0)
    assert as_stored.size == (stored, SHOWN[1])
    assert [flag.name for flag in as_stored.flags] == ["pixel-aspect-replaced"]


def test_what_the_container_states_goes_before_the_stream(tmp_path):
    """As players do: `pasp` of an MP4 file is changed, the stream inside goes on stating 2:1."""
    path = film(tmp_path / "a.mp4", disc((90, SHOWN[1])), Fraction(2, 1))
    content = path.read_bytes()
    assert content.count(b"pasp") == 1
    at = content.index(b"pasp") + 4
    path.write_bytes(content[:at] + (4).to_bytes(4, "big") + (3).to_bytes(4, "big") + content[at + 8 :])
    assert open_video(path).size == SHOWN


def test_a_setup_states_what_the_film_does_not(tmp_path):
    path = film(tmp_path / "a.mp4", disc((90, SHOWN[1])))
    assert open_video(path).flags == []
    video = open_video(path, pixel_aspect_ratio=4 / 3)
    assert video.size == SHOWN
    assert "the setup states a pixel aspect ratio of 1.33333" in video.flags[0].sentence


def test_an_absurd_ratio_is_refused_with_the_field_that_replaces_it(tmp_path):
    path = film(tmp_path / "a.mkv", disc((90, SHOWN[1])), Fraction(40, 1))
    with pytest.raises(InputError, match=r"ratio of 40; allowed: 0\.2 to 5, or camera\.pixel_aspect_ratio"):
        open_video(path)
    assert open_video(path, pixel_aspect_ratio=4 / 3).size == SHOWN


TURNS = {
    "upright": ((1, 0, 0, 1), lambda p: p),
    "a quarter clockwise": ((0, 1, -1, 0), lambda p: np.rot90(p, -1)),
    "a quarter counterclockwise": ((0, -1, 1, 0), np.rot90),
    "upside down": ((-1, 0, 0, -1), lambda p: np.rot90(p, 2)),
    "mirrored across": ((-1, 0, 0, 1), np.fliplr),
    "mirrored down": ((1, 0, 0, -1), np.flipud),
    "transposed": ((0, 1, 1, 0), lambda p: p.swapaxes(0, 1)),
    "transposed the other way": ((0, -1, -1, 0), lambda p: np.rot90(p, 2).swapaxes(0, 1)),
}
"""a, b, c, d of a display matrix: x' = a x + c y, y' = b x + d y; and what it does to a picture."""


@pytest.mark.parametrize("turn", TURNS)
@pytest.mark.parametrize("ratio", [None, Fraction(3, 2)])
def test_orientations_of_films(tmp_path, turn, ratio):
    (a, b, c, d), shown = TURNS[turn]
    picture = np.full((80, 80, 3), 40, np.uint8)
    picture[:30, :50] = 200
    path = film(tmp_path / "a.mp4", picture, ratio, [a << 16, b << 16, 0, c << 16, d << 16, 0, 0, 0, 1 << 30])
    video = open_video(path)
    wide = picture if ratio is None else np.repeat(picture, 3, axis=1)[:, ::2]
    true = shown(wide).astype(float)
    image = next(iter(video.frames())).image
    assert image.shape == true.shape
    assert np.abs(image - true).mean() < 4.0
    names = [*([] if ratio is None else ["pixels-not-square"]), *([] if turn == "upright" else ["pictures-turned"])]
    assert [flag.name for flag in video.flags] == names


@pytest.mark.parametrize("quarters", range(4))
def test_an_unknown_kind_of_side_data_hides_no_rotation(quarters):
    """PyAV raises where it has no name for a kind, and still gives the rotation, against the clock."""

    class Frame:
        rotation = 90 * quarters if quarters < 3 else -90

        @property
        def side_data(self):
            raise ValueError("999 is not a valid Type")

    picture = np.arange(12, dtype=np.uint8).reshape(3, 4)
    display, _ = frame_display(Frame(), 1.0)
    assert np.array_equal(display.display_picture(picture), np.rot90(picture, quarters))


def test_a_turn_that_is_no_quarter_is_mentioned(tmp_path):
    one, side = (round(65536 * value) for value in (np.cos(0.1), np.sin(0.1)))
    path = film(tmp_path / "a.mp4", disc(SHOWN), None, [one, side, 0, -side, one, 0, 0, 0, 1 << 30])
    (flag,) = open_video(path).flags
    assert (flag.name, "5.73 deg" in flag.sentence) == ("slant-left-out", True)


@pytest.mark.parametrize("ending", ["tif", "png", "jpg"])
@pytest.mark.parametrize("orientation", range(1, 9))
def test_orientations_of_images(tmp_path, ending, orientation):
    """Pillow's own transposition is the truth."""
    from PIL import ImageOps

    picture = np.full((48, 64, 3), 40, np.uint8)
    picture[:16, :40] = 200
    image = Image.fromarray(picture)
    if ending == "tif":
        image.save(tmp_path / "1.tif", tiffinfo={274: orientation})
    else:
        exif = Image.Exif()
        exif[274] = orientation
        image.save(tmp_path / f"1.{ending}", exif=exif, **({"quality": 95} if ending == "jpg" else {}))
    with Image.open(tmp_path / f"1.{ending}") as stored:
        true = np.asarray(ImageOps.exif_transpose(stored)).astype(float)
    video = open_video(tmp_path, 25.0)
    (frame,) = video.frames()
    assert np.abs(frame.image - true).mean() < 3.0
    assert [flag.name for flag in video.flags] == ([] if orientation == 1 else ["pictures-turned"])


@pytest.mark.parametrize("deep", [False, True])
@pytest.mark.parametrize("orientation", range(2, 9))
def test_orientations_of_stacks(tmp_path, orientation, deep):
    """Each pixel by its place: the eight orientations of TIFF 6.0, section 8, tag 274."""
    picture = np.arange(48 * 64).reshape(48, 64)
    picture = picture.astype(np.uint16) if deep else (picture % 251).astype(np.uint8)
    pages = [Image.fromarray(picture), Image.fromarray(picture[::-1].copy())]
    pages[0].save(tmp_path / "a.tif", save_all=True, append_images=pages[1:], tiffinfo={274: orientation})
    video = open_video(tmp_path / "a.tif", 25.0)
    frames = list(video.frames())
    low = (picture >> 4).astype(np.uint8) if deep else picture
    for frame, page in zip(frames, (low, low[::-1]), strict=True):
        across, down = orientation in (2, 3, 6, 7), orientation in (3, 4, 7, 8)
        upright = (page.T if orientation > 4 else page)[:: -1 if down else 1, :: -1 if across else 1]
        assert np.array_equal(frame.image[..., 0], upright)
    assert video.size == ((48, 64) if orientation > 4 else (64, 48))


@pytest.mark.parametrize("ending", ["tif", "bmp", "png", "jpg"])
def test_densities_of_images(tmp_path, ending):
    """100 pixels an inch across and 150 down: a pixel is 1.5 times as wide as it is high."""
    Image.fromarray(disc((80, SHOWN[1]))).save(tmp_path / f"1.{ending}", dpi=(100, 150))
    video = open_video(tmp_path, 25.0)
    (frame,) = video.frames()
    assert ellipse(frame.image) == pytest.approx((*DISC[:2], DISC[2], DISC[2]), abs=0.35)
    assert [flag.name for flag in video.flags] == ["pixels-not-square"]


def test_densities_without_a_unit_are_asked_for(tmp_path):
    """Writers disagree on which of the two is the width."""
    path = tmp_path / "1.jpg"
    Image.fromarray(disc((90, SHOWN[1]))).save(path)
    content = bytearray(path.read_bytes())
    at = content.index(b"JFIF\0") + 7
    content[at : at + 5] = bytes([0, 0, 4, 0, 3])
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"1\.jpg states .* 4 and 3 without a unit.*camera\.pixel_aspect_ratio"):
        open_video(tmp_path, 25.0)
    assert open_video(tmp_path, 25.0, 4 / 3).size == SHOWN


@pytest.mark.usefixtures("learning_shared")
def test_rates_do_not_depend_on_the_shape_of_pixels(flat_pictures, tmp_path):
    """A drawn film, stored in a quarter more columns: planted speed and rates are in their intervals."""
    from spirillum.measurement.setup_template import setup_answer
    from spirillum.results.measurement import measure

    flat = flat_pictures.Flat(frames=40, fps=10.0, velocity=2e-3, tail_rate=5.0, body_rate=-1.0)
    setup, path = tmp_path / "setup.toml", tmp_path / "wide.mkv"
    setup.write_text(flat.setup_text())
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=10, options={"crf": "4"})
        stream.width, stream.height, stream.pix_fmt = 400, 240, "yuv444p"
        stream.codec_context.sample_aspect_ratio = Fraction(4, 5)
        for _, picture in flat.pictures():
            wide = cv2.resize(picture, (400, 240), interpolation=cv2.INTER_LANCZOS4)
            for packet in stream.encode(av.VideoFrame.from_ndarray(wide, format="rgb24")):
                container.mux(packet)
        for packet in stream.encode():
            container.mux(packet)
    (trial,) = measure(path, setup).trials
    for name, true in (("forward_velocity", 2e-3), ("body_rotation_rate", -1.0), ("tail_rotation_rate", 5.0)):
        item = trial.quantities[name]
        assert item.low <= true <= item.high
        assert item.value == pytest.approx(true, rel=0.02)
    assert [flag.name for flag in trial.flags if "pixel" in flag.name] == ["pixels-not-square"]
    assert any("ratio of 0.8:" in warning for warning in setup_answer(setup, path)["warnings"])


def test_images_of_two_orientations_are_refused(tmp_path):
    for number, orientation in ((1, 1), (2, 6)):
        Image.fromarray(disc((80, 80))).save(tmp_path / f"{number}.tif", tiffinfo={274: orientation})
    video = open_video(tmp_path, 25.0)
    assert len(list(video.frames())) == 1
    assert "2.tif" in video.flags[-1].sentence
