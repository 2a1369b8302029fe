"""Where pictures come from, what goes out, and what is said when something stops."""

import io
import json
import socket
import threading
import time

import numpy as np
import pytest

from spirillum.cli import main
from spirillum.errors import InputError
from spirillum.live import session, streams
from spirillum.live.session import at_own_pace, newest, track
from spirillum.live.streams import Arrived, Datagrams, source_of

av = pytest.importorskip("av")
pytest.importorskip("cv2")
RATES = {"forward_velocity": 4e-3, "body_rotation_rate": -0.9, "tail_rotation_rate": 5.0}


def setup_of(film):
    return film.with_name("swimmer.setup.toml")


def test_a_film_gives_a_line_for_every_frame_and_one_for_all(filmed, capsys):
    with pytest.raises(SystemExit) as left:
        main(["track", str(filmed), "--setup", str(setup_of(filmed)), "--pace", "fast", "--learn", "2.4s"])
    assert left.value.code == 0
    *lines, last = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [line["frame"] for line in lines] == list(range(60))
    assert lines[0]["state"] == "learning"
    assert lines[-1]["state"] == "tracking"
    assert lines[-1]["position"]["unit"] == "m"
    assert "latency" not in lines[-1]
    assert last["schema"] == "spirillum.track/1"
    assert last["frames"] == 60
    assert last["frames_dropped"] == 0
    for name, true in RATES.items():
        assert last[name]["low"] < true < last[name]["high"]


@pytest.mark.parametrize("pace", ["real", "fast"])
def test_what_is_proposed_for_a_film_too_short_to_learn_from_would_help(monkeypatch, filmed, pace):
    monkeypatch.setattr(session, "at_own_pace", lambda frames: frames)
    found = track(filmed, setup_of(filmed), pace=pace, learn=30.0)
    assert found.trial is None
    assert "a robot in view for longer than 30 s; a shorter --learn needs less of it" in found.stopped
    assert "--pace" not in found.stopped


def test_a_film_that_breaks_off_says_so(filmed, tmp_path):
    """A third of its bytes is gone; the header, which states the length, stands first."""
    copied, broken = tmp_path / "copied.mp4", tmp_path / "broken.mp4"
    with av.open(filmed) as source, av.open(copied, "w", options={"movflags": "+faststart"}) as target:
        stream = target.add_stream_from_template(source.streams.video[0])
        for packet in source.demux(video=0):
            if packet.dts is not None:
                packet.stream = stream
                target.mux(packet)
    content = copied.read_bytes()
    broken.write_bytes(content[: len(content) * 2 // 3])
    found = track(broken, setup_of(filmed), pace="fast", learn=2.4)
    assert any("could not be read to its end" in line for line in found.warnings), found.warnings


def test_lines_go_out_as_datagrams_to_this_computer(filmed):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(20.0)
        track(filmed, setup_of(filmed), pace="fast", udp=str(receiver.getsockname()[1]), duration=0.2)
        assert json.loads(receiver.recv(65536))["frame"] == 0
        assert json.loads(receiver.recv(65536))["frame"] == 1
    for word in ("0", "70000", "x", ":9", "host:", ""):
        with pytest.raises(InputError, match="allowed: PORT or HOST:PORT"):
            Datagrams(word)


def stream_of(pictures, fps):
    """Pictures as an MPEG transport stream, one packet each."""
    file = io.BytesIO()
    with av.open(file, "w", format="mpegts") as container:
        stream = container.add_stream("libx264", rate=round(fps), options={"crf": "14", "tune": "zerolatency"})
        stream.height, stream.width, stream.pix_fmt = *pictures[0][1].shape[:2], "yuv420p"
        for _, picture in pictures:
            container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))
        container.mux(stream.encode())
    return file.getvalue()


def served(listening, data, seconds):
    """Send bytes to the first who asks, spread over a time."""
    there, _ = listening.accept()
    with there:
        parts = np.array_split(np.frombuffer(data, np.uint8), 40)
        for part in parts:
            there.sendall(part.tobytes())
            time.sleep(seconds / len(parts))


def test_a_stream_of_the_network_is_tracked_by_its_own_times(filmed, pictures):
    data = stream_of(pictures, 10.0)
    with socket.create_server(("127.0.0.1", 0)) as listening:
        server = threading.Thread(target=served, args=(listening, data, 3.0), daemon=True)
        server.start()
        found = track(f"tcp://127.0.0.1:{listening.getsockname()[1]}", setup_of(filmed), learn_from=filmed)
        server.join(10.0)
    assert found.frames + found.dropped == len(pictures)
    assert found.trial.quantities["forward_velocity"].value == pytest.approx(4e-3, rel=0.03)
    assert any("this computer's" in note for note in found.notes)  # twice too fast


@pytest.fixture
def camera(monkeypatch, filmed):
    """`camera:swimmer` is the film, as a camera's driver would give it."""
    monkeypatch.setattr(streams, "_DEVICES", {"linux": ("lavfi", "movie={}")})
    monkeypatch.setattr(streams.sys, "platform", "linux")
    monkeypatch.chdir(filmed.parent)
    return "camera:swimmer.mp4"


def test_a_camera_that_stops_keeps_what_was_tracked(camera, filmed, capsys):
    with pytest.raises(SystemExit) as left:
        main(["track", camera, "--setup", str(setup_of(filmed)), "--learn-from", str(filmed)])
    out, err = capsys.readouterr()
    assert left.value.code == 2
    assert err == "spirillum: camera:swimmer.mp4 stopped after 60 frames: what was tracked is kept\n"
    last = json.loads(out.splitlines()[-1])
    assert last["frames_tracked"] > 0
    assert last["frames"] + last["frames_dropped"] == 60


def test_another_size_than_asked_for_is_said(monkeypatch, filmed):
    monkeypatch.setattr(streams, "_DEVICES", {"linux": ("lavfi", "testsrc=size=96x64:rate=30:{}")})
    monkeypatch.setattr(streams.sys, "platform", "linux")
    source = source_of("camera:duration=1")
    assert next(source.frames()).image.shape == (64, 96, 3)
    asked = streams.Source(source.name, "camera", {**source.options, "size": (64, 64)})
    with pytest.raises(InputError, match="pictures of 96 x 64 pixels in place of 64 x 64"):
        next(asked.frames())


def test_sources_that_are_not_there_get_a_sentence(filmed):
    setup = setup_of(filmed)
    for word, said in (
        ("camera:97", "camera:97 cannot be opened"),
        ("tcp://127.0.0.1:1", "cannot be opened"),
        ("ftp://somewhere/a.mp4", "allowed: a film, a folder of images, camera:0"),
        ("nowhere.mp4", "nowhere.mp4 does not exist"),
    ):
        with pytest.raises(InputError, match=said):
            track(word, setup)
    with pytest.raises(InputError, match="pace = 'slow'; allowed: real, fast"):
        track(filmed, setup, pace="slow")
    with pytest.raises(InputError, match="allowed: only with a camera"):
        track(filmed, setup, fps=30.0)
    with pytest.raises(InputError, match="'fast' with tcp"):
        track("tcp://127.0.0.1:1", setup, pace="fast")
    assert "secret" not in source_of("rtsp://me:secret@host/x").name
    assert "secret" not in source_of("rtsp://me:a@secret@host/x").name
    assert source_of("HTTP://127.0.0.1:1/X").options["file"] == "http://127.0.0.1:1/X"
    with pytest.raises(InputError, match="fps = nan; allowed: above 0"):
        source_of("camera:0", fps=float("nan"))
    for address in ("00000199999", "..:55", f"{'a' * 70}:55", "99999", ":5"):
        with pytest.raises(InputError, match=r"udp = .*allowed: PORT or HOST:PORT"):
            Datagrams(address)


def arrivals(count, step):
    for k in range(count):
        yield Arrived(k, step * k, np.zeros(0), time.perf_counter())


def test_the_newest_pictures_are_taken_and_the_last_ones_never_lost():
    taken = []
    for frame in newest(at_own_pace(arrivals(40, 0.005))):
        taken.append(frame.number)
        time.sleep(0.02)
    assert taken == sorted(taken)
    assert taken[-1] == 39
    assert len(taken) < 30  # four times too slow
    assert [frame.number for frame in newest(at_own_pace(arrivals(3, 0.0)))][-1] == 2


def test_what_a_source_raises_comes_after_its_pictures():
    def stops():
        yield from arrivals(2, 0.0)
        raise InputError("unplugged")

    seen = []
    with pytest.raises(InputError, match="unplugged"):
        seen.extend(frame.number for frame in newest(stops()))
    assert session.PACES == ("real", "fast")
