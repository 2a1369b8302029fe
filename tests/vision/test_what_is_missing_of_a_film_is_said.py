"""A film that ends before the length that its file states is flagged, whatever the container; and the film is found
among the streams of its file."""

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from spirillum.vision.video.frames import open_video

av = pytest.importorskip("av")

KINDS = {
    "a.avi": ("mpeg4", {}), "mjpeg.avi": ("mjpeg", {}), "h264.avi": ("libx264", {}),
    "a.mp4": ("libx264", {"movflags": "+faststart"}), "a.mov": ("libx264", {"movflags": "+faststart"}),
    "fragments.mp4": ("libx264", {"movflags": "frag_keyframe+empty_moov"}), "a.mkv": ("libx264", {}),
    "a.m4v": ("mpeg4", {"movflags": "+faststart"}), "a.webm": ("libvpx-vp9", {}),
}  # fmt: skip
"""Codec, and options that put what is stated at the beginning of the file."""


def noise(index: int, size: tuple[int, int]) -> np.ndarray:
    """Pictures that take about as many bytes each."""
    return np.random.default_rng(index).integers(0, 255, (size[1], size[0], 3), dtype=np.uint8)


def add(container, codec: str, size: tuple[int, int]):
    stream = container.add_stream(codec, rate=25)
    stream.width, stream.height, stream.pix_fmt = *size, "yuvj420p" if codec == "mjpeg" else "yuv420p"
    stream.codec_context.gop_size = 5
    return stream


def fill(container, stream, frames: int, size: tuple[int, int]) -> None:
    for index in range(frames):
        frame = av.VideoFrame.from_ndarray(noise(index, size), format="rgb24")
        frame.pts, frame.time_base = index, Fraction(1, 25)
        for packet in stream.encode(frame):
            container.mux(packet)
    for packet in stream.encode():
        container.mux(packet)


_ENCODED: dict[str, bytes] = {}


def film(path: Path) -> Path:
    """A film of 60 frames of the kind that its name says, encoded once."""
    if path.name not in _ENCODED:
        codec, options = KINDS[path.name]
        with av.open(str(path), "w", format="mp4" if path.suffix == ".m4v" else None, options=options) as container:
            fill(container, add(container, codec, (64, 48)), 60, (64, 48))
        _ENCODED[path.name] = path.read_bytes()
    path.write_bytes(_ENCODED[path.name])
    return path


@pytest.mark.parametrize("rate", [None, 10.0])
@pytest.mark.parametrize("name", KINDS)
def test_a_whole_film_is_not_flagged(tmp_path, name, rate):
    video = open_video(film(tmp_path / name), rate)
    assert len(list(video.frames())) == 60
    assert [flag.name for flag in video.flags] == ([] if rate is None else ["rate-replaced"])


@pytest.mark.parametrize("share", [0.5, 0.85])
@pytest.mark.parametrize("name", KINDS)
def test_a_film_that_was_cut_off_is_flagged(tmp_path, name, share):
    path = film(tmp_path / name)
    content = path.read_bytes()
    path.write_bytes(content[: int(share * len(content))])
    video = open_video(path)
    assert 5 < len(list(video.frames())) < 58
    assert [flag.name for flag in video.flags] == ["video-ends-early"]


@pytest.mark.parametrize("name", ["a.avi", "a.mp4", "a.mov"])
def test_frames_are_counted_where_the_setup_gives_the_rate(tmp_path, name):
    path = film(tmp_path / name)
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])
    video = open_video(path, 10.0)
    count = len(list(video.frames()))
    assert "video-ends-early" in [flag.name for flag in video.flags]
    assert count < 40


@pytest.mark.parametrize("ending", [".mp4", ".mkv"])
def test_a_thumbnail_before_the_film_is_passed_over(tmp_path, ending):
    """A stream of one picture comes first."""
    path = tmp_path / f"a{ending}"
    with av.open(str(path), "w") as container:
        thumbnail, stream = add(container, "mjpeg", (160, 120)), add(container, "libx264", (64, 48))
        fill(container, thumbnail, 1, (160, 120))
        fill(container, stream, 50, (64, 48))
    video = open_video(path)
    assert video.size == (64, 48)
    assert len(list(video.frames())) == 50
    assert [frame.time for frame in video.samples([0.0, 1.0])] == pytest.approx([0.0, 1.0])


def test_a_cover_is_passed_over(tmp_path):
    path = tmp_path / "a.mp4"
    with av.open(str(path), "w") as container:
        cover, stream = add(container, "mjpeg", (160, 120)), add(container, "libx264", (64, 48))
        cover.disposition = av.stream.Disposition.attached_pic
        fill(container, cover, 1, (160, 120))
        fill(container, stream, 50, (64, 48))
    video = open_video(path)
    assert (video.size, video.flags) == ((64, 48), [])
    assert len(list(video.frames())) == 50


def test_of_two_films_the_longer_is_taken_and_both_are_named(tmp_path):
    path = tmp_path / "a.mkv"
    with av.open(str(path), "w") as container:
        short, long = add(container, "libx264", (96, 64)), add(container, "libx264", (64, 48))
        fill(container, short, 12, (96, 64))
        fill(container, long, 50, (64, 48))
    video = open_video(path)
    assert video.size == (64, 48)
    assert len(list(video.frames())) == 50
    (flag,) = video.flags
    assert flag.name == "several-films"
    assert all(word in flag.sentence for word in ("0 (96 x 64, 0.48 s)", "1 (64 x 48, 2 s)", "stream 1 is measured"))
