"""An MP4 file gives its frames back at their times and in their colours, and plays before all of it is there."""

from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest

from spirillum.errors import InputError
from spirillum.formats.h264 import h264_writer
from spirillum.kernels.core import film_colours

SIZE = (64, 48)
FINE = {"crf": "8", "preset": "veryfast"}
HOW = {"quality": FINE, "instead": "something else", "extra": "video"}
COLOURS = ((255, 0, 0), (0, 255, 0), (0, 0, 255), (255, 220, 0), (128, 128, 128))


def even(colour: tuple[int, int, int]) -> np.ndarray:
    return np.full((SIZE[1], SIZE[0], 3), colour, dtype=np.uint8)


def decoded(path: Path) -> tuple[list[float], list[np.ndarray]]:
    with av.open(str(path)) as container:
        frames = list(container.decode(video=0))
        return [float(frame.time) for frame in frames], [frame.to_ndarray(format="rgb24") for frame in frames]


def test_frames_follow_each_other_at_the_rate(tmp_path: Path) -> None:
    path = tmp_path / "a.mp4"
    with h264_writer(path, SIZE, Fraction(25), {}, **HOW) as writer:
        for colour in COLOURS:
            writer.add(even(colour))
    assert decoded(path)[0] == pytest.approx([0.0, 0.04, 0.08, 0.12, 0.16])


@pytest.mark.parametrize("tick", [None, Fraction(1, 90_000)])
def test_frames_stand_at_the_ticks_that_they_are_given(tmp_path: Path, tick: Fraction | None) -> None:
    path, numbers = tmp_path / "a.mp4", [0, 1, 4, 900, 907]
    with h264_writer(path, SIZE, Fraction(30), {}, tick=tick, **HOW) as writer:
        for number, colour in zip(numbers, COLOURS, strict=True):
            writer.add(even(colour), number)
    assert decoded(path)[0] == pytest.approx([float(number * (tick or Fraction(1, 30))) for number in numbers])


def test_a_frame_without_a_number_follows_the_one_before(tmp_path: Path) -> None:
    path = tmp_path / "a.mp4"
    with h264_writer(path, SIZE, Fraction(10), {}, **HOW) as writer:
        writer.add(even(COLOURS[0]))
        writer.add(even(COLOURS[1]), 5)
        writer.add(even(COLOURS[2]))
    assert decoded(path)[0] == pytest.approx([0.0, 0.5, 0.6])


def test_colours_come_back_to_a_step_of_the_limited_range(tmp_path: Path) -> None:
    """219 steps of brightness for 255: a colour is off by a step or two, while a wrong matrix is off by tens."""
    path = tmp_path / "a.mp4"
    with h264_writer(path, SIZE, Fraction(10), {}, **HOW) as writer:
        for colour in COLOURS:
            writer.add(even(colour))
    with av.open(str(path)) as container:
        frames = list(container.decode(video=0))
    for frame, colour in zip(frames, COLOURS, strict=True):
        assert (frame.colorspace, frame.color_range) == (1, 1)  # BT.709, limited
        seen = frame.reformat(format="rgb24", src_colorspace="ITU709").to_ndarray().reshape(-1, 3)
        assert np.abs(seen.mean(axis=0) - colour).max() < 4


def test_colours_of_films_are_those_of_the_standard() -> None:
    """Rec. ITU-R BT.709-6, sections 3.2 to 3.4, in floating point, for a picture of even bands two rows high."""
    draw = np.random.default_rng(1)
    colours = draw.integers(0, 256, (24, 1, 3), dtype=np.uint8)
    image = np.broadcast_to(np.repeat(colours, 2, axis=0), (48, 64, 3))
    own = np.empty((72, 64), dtype=np.uint8)
    film_colours(np.ascontiguousarray(image), own)
    luma = colours[:, 0] / 255.0 @ (0.2126, 0.7152, 0.0722)
    blue, red = (colours[:, 0, 2] / 255.0 - luma) / 1.8556, (colours[:, 0, 0] / 255.0 - luma) / 1.5748
    chroma = own[48:].reshape(2, 24, 32)
    for found, true in ((own[:48:2], 16 + 219 * luma), (chroma[0], 128 + 224 * blue), (chroma[1], 128 + 224 * red)):
        assert np.abs(found - true[:, None]).max() < 0.51


def test_colours_of_films_are_those_of_the_library() -> None:
    """It takes chroma from more pixels: a smooth picture tells a wrong place of its samples, and not the number."""
    rows, columns = np.mgrid[: SIZE[1], : SIZE[0]]
    image = np.stack([128 + 100 * np.sin(0.05 * rows + k + 0.04 * columns) for k in range(3)], axis=2).astype(np.uint8)
    own = np.empty((3 * SIZE[1] // 2, SIZE[0]), dtype=np.uint8)
    film_colours(image, own)
    frame = av.VideoFrame.from_ndarray(image, format="rgb24").reformat(format="yuv420p", dst_colorspace="ITU709")
    off = own.astype(int) - frame.to_ndarray()
    assert np.abs(off).max() <= 2
    assert abs(off.mean()) < 0.05


def test_a_frame_of_another_size_is_refused(tmp_path: Path) -> None:
    with h264_writer(tmp_path / "a.mp4", SIZE, Fraction(10), {}, **HOW) as writer:
        writer.add(even(COLOURS[0]))
        with pytest.raises(ValueError, match=r"\(40, 64, 3\) in a film of frames of shape \(48, 64, 3\)"):
            writer.add(even(COLOURS[1])[:40])


def test_tags_are_kept_and_the_index_comes_first(tmp_path: Path) -> None:
    path = tmp_path / "a.mp4"
    with h264_writer(path, SIZE, Fraction(10), {"title": "a robot", "comment": "synthetic"}, **HOW) as writer:
        writer.add(even(COLOURS[0]))
    with av.open(str(path)) as container:
        assert {name: container.metadata[name] for name in ("title", "comment")} == {
            "title": "a robot",
            "comment": "synthetic",
        }
    content = path.read_bytes()
    assert content.index(b"moov") < content.index(b"mdat")


def test_no_encoder_is_said_with_what_can_be_had_instead(tmp_path: Path) -> None:
    writer = h264_writer(tmp_path / "a.mp4", SIZE, Fraction(10), {}, encoders=("none_such",), **HOW)
    with pytest.raises(InputError, match=r"a\.mp4 cannot be encoded: .*no none_such .*; allowed: something else"):
        writer.__enter__()
    assert list(tmp_path.iterdir()) == []
