"""Videos are read with their true times; whatever is no video gets one sentence."""

import threading
import wave
import zlib
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from spirillum.errors import InputError
from spirillum.vision.video.frames import open_video

av = pytest.importorskip("av")
cv2 = pytest.importorskip("cv2")


def picture(index: int, size: tuple[int, int] = (64, 48)) -> np.ndarray:
    image = np.full((size[1], size[0], 3), 40, dtype=np.uint8)
    image[:, : 2 + index % 60] = 200
    return image


def film(path: Path, ticks: list[int], *, codec: str = "libx264", size: tuple[int, int] = (64, 48)) -> Path:
    """A film whose frames have the given time stamps in 1/600 s."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=30)
        stream.width, stream.height, stream.pix_fmt = *size, "yuv420p"
        stream.time_base = stream.codec_context.time_base = Fraction(1, 600)
        stream.codec_context.gop_size = 10
        for index, tick in enumerate(ticks):
            frame = av.VideoFrame.from_ndarray(picture(index, size), format="rgb24")
            frame.pts, frame.time_base = tick, Fraction(1, 600)
            for packet in stream.encode(frame):
                container.mux(packet)
        for packet in stream.encode():
            container.mux(packet)
    return path


@pytest.mark.parametrize("ending", [".mp4", ".mov", ".mkv"])
def test_true_times_with_gaps_and_a_variable_rate(tmp_path, ending):
    ticks = [0, 20, 40, 100, 120, 135, 155, 300, 320]
    frames = list(open_video(film(tmp_path / f"a{ending}", ticks)).frames())
    assert [frame.time for frame in frames] == pytest.approx(np.array(ticks) / 600, abs=6e-4)
    for index, frame in enumerate(frames):
        assert np.sum(frame.image[24, :, 0] > 120) == pytest.approx(2 + index, abs=1)
        assert frame.image.shape == (48, 64, 3)


def test_avi_and_a_given_rate(tmp_path):
    video = open_video(film(tmp_path / "a.avi", list(range(0, 200, 20)), codec="mpeg4"), frames_per_second=12.0)
    assert [frame.time for frame in video.frames()] == pytest.approx(np.arange(10) / 12.0)


def test_start_and_end(tmp_path):
    video = open_video(film(tmp_path / "a.mp4", list(range(0, 600, 20))))
    times = [frame.time for frame in video.frames(0.2, 0.5)]
    assert (times[0], times[-1]) == pytest.approx((0.2, 0.5), abs=1e-6)
    with pytest.raises(InputError, match="no frame from 5 s on"):
        list(video.frames(5.0))


def test_samples_are_the_first_frames_at_or_after_some_times(tmp_path):
    video = open_video(film(tmp_path / "a.mp4", list(range(0, 1200, 20))))
    assert [frame.time for frame in video.samples([0.0, 0.51, 1.0, 1.9])] == pytest.approx(
        [0.0, 16 / 30, 1.0, 1.9], abs=1e-3
    )
    given = open_video(tmp_path / "a.mp4", frames_per_second=10.0)
    assert [frame.time for frame in given.samples([0.0, 0.51, 1.0])] == pytest.approx([0.0, 0.6, 1.0])


def test_a_reader_that_stops_leaves_no_thread_behind(tmp_path):
    before = threading.active_count()
    frames = open_video(film(tmp_path / "a.mp4", list(range(0, 1200, 20)))).frames()
    next(frames)
    frames.close()
    assert threading.active_count() == before


def test_images_come_in_natural_order_and_their_numbers_count_dropped_frames(tmp_path):
    for number in (9, 10, 11, 13):
        cv2.imwrite(str(tmp_path / f"trial_{number}.png"), picture(number))
    frames = list(open_video(tmp_path, 10.0).frames())
    assert [frame.time for frame in frames] == pytest.approx([0.0, 0.1, 0.2, 0.4])
    assert [int(np.sum(frame.image[0, :, 0] > 120)) for frame in frames] == [11, 12, 13, 15]


def test_an_image_that_cannot_be_read_is_left_out_and_said(tmp_path):
    for number in range(4):
        cv2.imwrite(str(tmp_path / f"{number}.png"), picture(number))
    (tmp_path / "2.png").write_bytes(b"nothing")
    video = open_video(tmp_path, 10.0)
    assert len(list(video.frames())) == 3
    assert [flag.name for flag in video.flags] == ["unreadable-frames"]


def test_a_film_cut_off_in_the_middle_is_kept_as_far_as_it_goes(tmp_path):
    whole = film(tmp_path / "a.mkv", list(range(0, 3600, 20))).read_bytes()
    (tmp_path / "cut.mkv").write_bytes(whole[: len(whole) // 2])
    video = open_video(tmp_path / "cut.mkv")
    assert 20 < len(list(video.frames())) < 170
    assert "video-ends-early" in [flag.name for flag in video.flags]


def bad_files(folder: Path) -> dict[str, Path]:
    made = {name: folder / f"{name}.mp4" for name in ("missing", "empty", "text", "cut", "unknown", "sound", "tiny")}
    made["empty"].write_bytes(b"")
    made["text"].write_text("frame by frame\n" * 100)
    whole = film(folder / "whole.mp4", list(range(0, 600, 20))).read_bytes()
    made["cut"].write_bytes(whole[:700])
    made["unknown"].write_bytes(whole.replace(b"avc1", b"none"))
    with wave.open(str(folder / "sound.wav"), "wb") as sound:
        sound.setparams((1, 2, 8000, 0, "NONE", ""))
        sound.writeframes(b"\0\0" * 800)
    made["sound"] = folder / "sound.wav"
    film(made["tiny"], [0, 20], size=(16, 16))
    made["folder"] = folder / "nothing"
    made["folder"].mkdir()
    return made


def test_what_is_no_video_gets_one_sentence(tmp_path):
    words = {
        "missing": "does not exist",
        "empty": "is empty",
        "text": "cannot be read as a film",
        "cut": "cannot be read as a film",
        "unknown": "cannot be decoded",
        "sound": "has no pictures",
        "tiny": "16 x 16 pixels",
        "folder": "holds no images",
    }
    for name, path in bad_files(tmp_path).items():
        with pytest.raises(InputError, match=words[name]) as caught:
            open_video(path, 30.0)
        assert "\n" not in str(caught.value)
        assert "allowed" in str(caught.value)


@pytest.mark.skipif(not Path("/proc/self/mem").exists(), reason="needs a file whose first byte cannot be read")
def test_a_file_that_a_broken_disk_does_not_give_gets_one_sentence():
    with pytest.raises(InputError, match=r"/proc/self/mem'? cannot be read .*allowed"):
        open_video("/proc/self/mem")


def test_a_folder_of_images_needs_a_rate(tmp_path):
    cv2.imwrite(str(tmp_path / "1.png"), picture(1))
    with pytest.raises(InputError, match="frames_per_second is missing"):
        open_video(tmp_path)


def test_what_a_file_says_of_itself_is_kept(tmp_path):
    (tmp_path / "images").mkdir()
    (tmp_path / "images" / "README.txt").write_text("synthetic:\n a computed robot\n")
    cv2.imwrite(str(tmp_path / "images" / "1.png"), picture(1))
    plain = (tmp_path / "images" / "1.png").read_bytes()
    assert open_video(tmp_path / "images", 10.0).words == "synthetic: a computed robot"
    text = b"tEXtcomment\0of a virtual camera"
    chunk = (len(text) - 4).to_bytes(4, "big") + text + zlib.crc32(text).to_bytes(4, "big")
    (tmp_path / "images" / "1.png").write_bytes(plain[:33] + chunk + plain[33:])
    (tmp_path / "images" / "README.txt").unlink()
    assert "of a virtual camera" in open_video(tmp_path / "images", 10.0).words
    with av.open(str(tmp_path / "a.mp4"), "w") as container:
        container.metadata["title"] = "synthetic"
        stream = container.add_stream("libx264", rate=30)
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        for packet in stream.encode(av.VideoFrame.from_ndarray(picture(0), format="rgb24")):
            container.mux(packet)
        for packet in stream.encode():
            container.mux(packet)
    assert open_video(tmp_path / "a.mp4").words == "synthetic"


def test_a_folder_named_like_a_picture_is_no_frame(tmp_path):
    for number in (3, 4, 6):
        cv2.imwrite(str(tmp_path / f"f{number:05d}.png"), picture(number))
    (tmp_path / "f00005.png").mkdir()
    (tmp_path / "f00005b.png").mkdir()
    video = open_video(tmp_path, frames_per_second=10.0)
    assert [frame.time for frame in video.frames()] == pytest.approx([0.0, 0.1, 0.3])
    assert video.flags == []


@pytest.mark.parametrize("odd", [0, 14])
def test_an_image_of_another_size_is_named_with_both_sizes(tmp_path, odd):
    """When the folder is opened: those who look at a few frames of it only would not see the others."""
    for index in range(15):
        cv2.imwrite(str(tmp_path / f"{index:03d}.png"), np.full((40, 50 if index == odd else 60, 3), 90, np.uint8))
    with pytest.raises(InputError, match=rf"{odd:03d}\.png has 50 x 40 pixels, others in its folder 60 x 40"):
        open_video(tmp_path, 30.0)
