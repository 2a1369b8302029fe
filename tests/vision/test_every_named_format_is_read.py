"""Every kind of film and image that help and documentation name is read: real small files, pixel by pixel."""

from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from spirillum.errors import InputError
from spirillum.vision.camera.scale import lens_of
from spirillum.vision.setup import Checkerboard
from spirillum.vision.video.frames import FILMS, open_video
from spirillum.vision.video.pictures import IMAGES

av = pytest.importorskip("av")
cv2 = pytest.importorskip("cv2")
Image = pytest.importorskip("PIL.Image")

SIZE = (64, 48)
GREY = (16 * (np.arange(48)[:, None] // 6) + 2 * (np.arange(64) // 4)).astype(np.uint8)
"""Steps of brightness, all even and below 160."""
RGB = np.stack([GREY, GREY[::-1], 255 - GREY], axis=2)

FILM_KINDS = {
    "h264.mp4": ("libx264", "yuv420p"), "h265.mp4": ("libx265", "yuv420p"), "mpeg4.m4v": ("mpeg4", "yuv420p"),
    "av1.mp4": ("libsvtav1", "yuv420p"), "h264.mov": ("libx264", "yuv420p"), "prores.mov": ("prores_ks", "yuv422p10le"),
    "mjpeg.mov": ("mjpeg", "yuvj420p"), "h264.mkv": ("libx264", "yuv420p"), "deep.mkv": ("libx264", "yuv420p10le"),
    "ffv1.mkv": ("ffv1", "yuv420p"), "ffv1-grey.mkv": ("ffv1", "gray"), "ffv1-12.mkv": ("ffv1", "gray12le"),
    "vp8.webm": ("libvpx", "yuv420p"), "vp9.webm": ("libvpx-vp9", "yuv420p"), "mpeg4.avi": ("mpeg4", "yuv420p"),
    "mjpeg.avi": ("mjpeg", "yuvj420p"), "h264.avi": ("libx264", "yuv420p"), "raw.avi": ("rawvideo", "bgr24"),
    "raw-yuv.avi": ("rawvideo", "yuv420p"), "huffyuv.avi": ("huffyuv", "rgb24"), "ffv1.avi": ("ffv1", "bgr0"),
    "utvideo.avi": ("utvideo", "gbrp"),
}  # fmt: skip
"""Codec and layout of pixels of each film."""

IMAGE_KINDS: dict[str, tuple[str, dict[str, Any]]] = {
    "grey.png": ("L", {}), "colours.png": ("RGB", {}), "palette.png": ("P", {}), "alpha.png": ("RGBA", {}),
    "grey.jpg": ("L", {"quality": 95}), "colours.jpg": ("RGB", {"quality": 95}),
    "progressive.jpeg": ("RGB", {"quality": 95, "progressive": True}),
    "several.jpg": ("RGB", {"format": "MPO", "quality": 95}),
    "grey.bmp": ("L", {}), "colours.bmp": ("RGB", {}), "palette.bmp": ("P", {}),
    "grey.tif": ("L", {}), "grey.tiff": ("L", {}), "colours.tif": ("RGB", {}), "palette.tif": ("P", {}),
    "lzw.tif": ("L", {"compression": "tiff_lzw"}), "deflate.tif": ("L", {"compression": "tiff_adobe_deflate"}),
    "packbits.tif": ("RGB", {"compression": "packbits"}), "large.tif": ("L", {"big_tiff": True}),
    "jpeg.tif": ("RGB", {"compression": "jpeg", "quality": 95}),
}  # fmt: skip
"""Mode and options of Pillow for each image."""


def even(index: int) -> np.ndarray:
    """A frame of one colour."""
    return np.full((SIZE[1], SIZE[0], 3), (20 + 20 * index, 120, 200 - 20 * index), np.uint8)


def film(path: Path, codec: str, layout: str, frames: int = 8) -> Path:
    with av.open(str(path), "w", format="mp4" if path.suffix == ".m4v" else None) as container:
        stream = container.add_stream(codec, rate=25)
        stream.width, stream.height, stream.pix_fmt = *SIZE, layout
        if codec != "libsvtav1":
            stream.bit_rate = 2_000_000
        for index in range(frames):
            frame = av.VideoFrame.from_ndarray(even(index), format="rgb24")
            frame.pts, frame.time_base = index, Fraction(1, 25)
            for packet in stream.encode(frame):
                container.mux(packet)
        for packet in stream.encode():
            container.mux(packet)
    return path


@pytest.mark.parametrize("name", FILM_KINDS)
def test_films(tmp_path, name):
    codec, layout = FILM_KINDS[name]
    if codec not in av.codecs_available:
        pytest.skip(f"no {codec} to write the film with")
    video = open_video(film(tmp_path / name, codec, layout))
    frames = list(video.frames())
    assert video.size == SIZE
    assert [frame.time for frame in frames] == pytest.approx(np.arange(8) / 25, abs=1e-3)
    for index, frame in enumerate(frames):
        true = even(index)[0, 0]
        if layout.startswith("gray"):
            true = np.full(3, true @ (0.299, 0.587, 0.114))
        assert np.abs(frame.image.mean(axis=(0, 1)) - true).max() < 6
    assert video.flags == []


def test_every_ending_of_a_film_is_among_them():
    assert {Path(name).suffix for name in FILM_KINDS} == set(FILMS)


def save(path: Path, values: np.ndarray, mode: str, **options: Any) -> Path:
    image = Image.fromarray(values)
    if mode == "RGBA":
        image.putalpha(255)
    image = image.quantize(256) if mode == "P" else image
    image.save(path, **options, **({"save_all": True, "append_images": [image]} if "format" in options else {}))
    return path


@pytest.mark.parametrize("name", IMAGE_KINDS)
def test_images_of_a_folder(tmp_path, name):
    mode, options = IMAGE_KINDS[name]
    values = GREY if mode == "L" else RGB
    for number in (1, 2, 3):
        save(tmp_path / f"{number}{Path(name).suffix}", np.roll(values, number, axis=1), mode, **options)
    video = open_video(tmp_path, 25.0)
    frames = list(video.frames())
    assert [frame.time for frame in frames] == pytest.approx([0.0, 0.04, 0.08])
    for number, frame in enumerate(frames, 1):
        true = np.roll(values, number, axis=1).astype(float)
        true = true if true.ndim == 3 else np.repeat(true[..., None], 3, axis=2)
        assert np.abs(frame.image - true).mean() < (6.0 if "jp" in name else 0.01)
    assert video.flags == []


def test_every_ending_of_an_image_is_among_them():
    assert {Path(name).suffix for name in IMAGE_KINDS} == set(IMAGES)


@pytest.mark.parametrize("ending", ["tif", "png"])
@pytest.mark.parametrize("colours", [False, True])
@pytest.mark.parametrize("bits", [10, 12, 16])
def test_deep_images_are_read_by_the_bits_that_they_fill(tmp_path, ending, colours, bits):
    values = (RGB if colours else GREY).astype(np.uint16) << (bits - 8)
    for number in range(3):
        assert cv2.imwrite(str(tmp_path / f"{number}.{ending}"), values + (1 << (bits - 9) if number else 0))
    video = open_video(tmp_path, 25.0)
    true = RGB[..., ::-1] if colours else np.repeat(GREY[..., None], 3, axis=2)
    filled = int(values.max() + (1 << (bits - 9))).bit_length()
    for frame in video.frames():
        assert np.array_equal(frame.image, true.astype(int) << (bits - filled))
    assert [flag.name for flag in video.flags] == ["sixteen-bit-images"]
    assert f"fill {filled} bits" in video.flags[0].sentence


@pytest.mark.parametrize("deep", [False, True])
def test_a_stack_is_its_pages(tmp_path, deep):
    """As microscopes write them: one file, a picture on each page."""
    pages = [np.roll(GREY, shift, axis=1) for shift in range(40)]
    images = [Image.fromarray(page.astype(np.uint16) << 4 if deep else page) for page in pages]
    images[0].save(tmp_path / "stack.tif", save_all=True, append_images=images[1:])
    video = open_video(tmp_path / "stack.tif", 10.0)
    frames = list(video.frames())
    drop = 0 if not deep or GREY.max() > 127 else 1
    assert [frame.time for frame in frames] == pytest.approx(np.arange(40) / 10)
    assert all(np.array_equal(frame.image[..., 0], page << drop) for frame, page in zip(frames, pages, strict=True))
    assert [frame.index for frame in video.samples([0.35, 2.0])] == [4, 20]
    assert [frame.index for frame in video.frames(3.7)] == [37, 38, 39]
    with pytest.raises(InputError, match=r"frames_per_second is missing, but .*stack\.tif is a TIFF file"):
        open_video(tmp_path / "stack.tif")


def test_images_that_are_not_read_are_named(tmp_path):
    """Also where all of a folder's images are so: the reason was swallowed."""
    images = {
        "float": (Image.fromarray(GREY.astype(np.float32)), {}, "holds 32-bit floating-point numbers; allowed: 8-bit"),
        "whole": (Image.fromarray(GREY.astype(np.int32)), {}, "holds 32-bit whole numbers; allowed: 8-bit"),
        "pages": (Image.fromarray(GREY), {"save_all": True, "append_images": [Image.fromarray(GREY)]},
                  "holds 2 pages; allowed: one picture a file, or the file as the video"),
    }  # fmt: skip
    for name, (image, options, words) in images.items():
        (tmp_path / name).mkdir()
        image.save(tmp_path / name / "1.tif", **options)
        with pytest.raises(InputError, match=words):
            open_video(tmp_path / name, 25.0)
    sizes = [Image.fromarray(GREY), Image.fromarray(GREY[:40])]
    sizes[0].save(tmp_path / "sizes.tif", save_all=True, append_images=sizes[1:])
    with pytest.raises(InputError, match="page 2 has 64 x 40 pixels, the first 64 x 48"):
        open_video(tmp_path / "sizes.tif", 25.0)
    (tmp_path / "text.tif").write_text("no picture")
    with pytest.raises(InputError, match=r"text\.tif cannot be read as a TIFF file"):
        open_video(tmp_path / "text.tif", 25.0)


@pytest.mark.parametrize("ending", [ending for ending in IMAGES if ending != ".png"])
def test_pictures_of_a_checkerboard(tmp_path, ending):
    """They are read, so that what is missing is the board."""
    for number in range(3):
        assert cv2.imwrite(str(tmp_path / f"{number}{ending}"), np.full((48, 64), 128, np.uint8))
    board = Checkerboard.model_validate({"images": ".", "columns": 4, "rows": 3, "square": "5 mm"})
    with pytest.raises(InputError, match="was found in 0 of 3 pictures"):
        lens_of(board, tmp_path, SIZE)
