"""A run's recording, read back by MCAP's own reader: every message fits its schema, and holds what the run holds."""

import base64
import io
import json
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import spirillum as sp
from spirillum.cli import main
from spirillum.dynamics.run_file import poses_of

reader: Any = pytest.importorskip("mcap.reader")

KINDS = {"number": (int, float), "integer": int, "string": str, "boolean": bool, "array": list, "object": dict}


@pytest.fixture(scope="module")
def run() -> xr.Dataset:
    timing = {"duration": 0.3, "on": [(0.0, 0.2)], "samples_per_turn": 40}
    return sp.simulate("biorob2012-wide", model="rft", timing=timing)


def film_of(path: Path, frames: int, rate: int) -> Path:
    """A film whose pictures grow brighter."""
    import av

    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=rate, options={"crf": "10"})
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        for n in range(frames):
            picture = np.full((48, 64, 3), 20 * n, dtype=np.uint8)
            for packet in stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")):
                container.mux(packet)
        for packet in stream.encode():
            container.mux(packet)
    return path


def read(path: Path) -> tuple[dict[str, list[tuple[float, Any]]], dict[str, tuple[str, Any]]]:
    """Messages by topic with their times, and schemas by topic."""
    messages, schemas = defaultdict(list), {}
    with path.open("rb") as stream:
        for schema, channel, message in reader.make_reader(stream).iter_messages(log_time_order=False):
            assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
            schemas[channel.topic] = (schema.name, json.loads(schema.data))
            messages[channel.topic].append((message.log_time * 1e-9, json.loads(message.data)))
    return messages, schemas


def assert_fits(value: Any, schema: Any, where: str) -> None:
    assert isinstance(value, KINDS[schema["type"]]), where
    for name, item in value.items() if schema["type"] == "object" else ():
        assert name in schema["properties"], f"{where}.{name}"
        assert_fits(item, schema["properties"][name], f"{where}.{name}")
    for item in value if schema["type"] == "array" else ():
        assert_fits(item, schema["items"], where)


@pytest.mark.parametrize("motion", ["free", "held"])
def test_messages_fit_their_schemas_and_hold_the_run(run: xr.Dataset, tmp_path: Path, motion: str) -> None:
    if motion == "held":
        run = sp.simulate("biorob2012-wide", model="rft", motion="held", timing={"duration": 0.3})
    answer = sp.export_run(run, tmp_path / "run.mcap")
    messages, schemas = read(answer.path)
    assert {topic: len(found) for topic, found in messages.items()} == answer.topics
    for topic, found in messages.items():
        for _, message in found:
            assert_fits(message, schemas[topic][1], topic)
    assert {name for name, _ in schemas.values()} == {
        "foxglove.FrameTransform",
        "foxglove.PoseInFrame",
        "foxglove.SceneUpdate",
        "foxglove.Log",
        "spirillum.Quantities",
    }
    poses, count = poses_of(run), run.sizes["time"]
    times = [time for time, _ in messages["/pose"]]
    np.testing.assert_allclose(times, run["time"], atol=1e-9)
    for n in (0, count // 2, count - 1):
        pose = messages["/pose"][n][1]["pose"]
        np.testing.assert_array_equal([pose["position"][axis] for axis in "xyz"], poses.position[n])
        np.testing.assert_array_equal([pose["orientation"][axis] for axis in "wxyz"], poses.attitude[n])
        numbers = messages["/quantities"][n][1]
        for name in ("forward_velocity", "motor_current", "tail_angle", "battery_charge_used"):
            assert numbers[name] == float(run[name][n])
        rotor = messages["/tf"][2 * n + 1][1]
        assert (rotor["parent_frame_id"], rotor["child_frame_id"]) == ("body", "rotor")
        turned = 2.0 * np.arctan2(rotor["rotation"]["x"], rotor["rotation"]["w"])
        assert np.cos(turned - poses.tail_phase[n]) == pytest.approx(1.0)


def test_times_never_go_back(run: xr.Dataset, tmp_path: Path) -> None:
    film = film_of(tmp_path / "film.mp4", 10, 25)
    path = sp.export_run(run, tmp_path / "run.mcap", film=film).path
    with path.open("rb") as stream:
        times = [found[2].log_time for found in reader.make_reader(stream).iter_messages(log_time_order=False)]
    assert times == sorted(times)


def test_scene_is_the_robot_in_its_tube(run: xr.Dataset, tmp_path: Path) -> None:
    messages, _ = read(sp.export_run(run, tmp_path / "run.mcap").path)
    entities = {item["id"]: item for item in messages["/scene"][0][1]["entities"]}
    assert {entities["body"]["frame_id"], entities["tail"]["frame_id"]} == {"body", "rotor"}
    points = [point for part in entities["body"]["triangles"] for point in part["points"]]
    robot = sp.load("biorob2012-wide")
    assert max(point["x"] for point in points) == pytest.approx(0.5 * robot.body.length, rel=1e-6)
    assert max(point["y"] for point in points) == pytest.approx(0.5 * robot.body.diameter, rel=1e-2)
    for entity in entities.values():
        assert entity["frame_locked"]
        for part in entity["triangles"]:
            assert max(part["indices"]) == len(part["points"]) - 1
    assert robot.channel is not None
    assert entities["tube"]["cylinders"][0]["size"]["x"] == robot.channel.diameter


def test_film_is_in_the_recording_at_the_time_of_the_run(run: xr.Dataset, tmp_path: Path) -> None:
    from PIL import Image

    film = film_of(tmp_path / "film.mp4", 10, 20)
    messages, schemas = read(sp.export_run(run, tmp_path / "run.mcap", film=film, speed=0.8).path)
    assert schemas["/film"][0] == "foxglove.CompressedImage"
    times = [time for time, _ in messages["/film"]]
    np.testing.assert_allclose(times, 0.8 * np.arange(8) / 20, atol=1e-6)  # the others lie behind the run's end
    for n, (_, message) in enumerate(messages["/film"]):
        picture = np.asarray(Image.open(io.BytesIO(base64.b64decode(message["data"]))))
        assert picture.shape == (48, 64, 3)
        assert picture.mean() == pytest.approx(20 * n, abs=4)


def test_file_tells_its_run_and_may_be_written_again(run: xr.Dataset, tmp_path: Path) -> None:
    for _ in range(2):
        path = sp.export_run(run, tmp_path / "run.mcap").path
    with path.open("rb") as stream:
        found = next(iter(reader.make_reader(stream).iter_metadata()))
    assert found.metadata["model"] == "rft"
    assert json.loads(found.metadata["settings"])["name"] == "biorob2012-wide"


def test_command_writes_what_python_writes(run: xr.Dataset, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run.to_netcdf(tmp_path / "run.nc", engine="h5netcdf")
    with pytest.raises(SystemExit) as stopped:
        main(["export", str(tmp_path / "run.nc"), str(tmp_path / "run.mcap"), "--json"])
    assert stopped.value.code in (0, None)
    answer = json.loads(capsys.readouterr().out)
    assert answer["schema"] == "spirillum.recording/1"
    assert answer["topics"]["/pose"] == run.sizes["time"]


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["run.nc", "run.mcap", "--gap", "1mm"], "--gap with .mcap; allowed: "),
        (["run.nc", "run.mcap", "--phase", "0rad"], "--phase with .mcap; allowed: "),
        (["run.nc", "run.mcap", "--fineness", "2"], "--fineness with .mcap; allowed: "),
        (["biorob2012-wide", "robot.stl", "--film", "x.mp4"], "--film with .stl; allowed: only with .mcap"),
        (["nowhere.nc", "run.mcap"], "nowhere.nc"),
    ],
)
def test_wrong_commands_are_a_sentence(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    sentence: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as stopped:
        main(["export", *arguments])
    assert stopped.value.code == 2
    assert sentence in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_wrong_input_leaves_nothing(run: xr.Dataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for arguments, sentence in (
        ({"speed": float("nan")}, "speed = nan"),
        ({"film": tmp_path / "no.mp4"}, r"no\.mp4"),
    ):
        with pytest.raises(sp.InputError, match=sentence):
            sp.export_run(run, tmp_path / "run.mcap", **arguments)
    with pytest.raises(sp.InputError, match=r"\.mcap"):
        sp.export_run(run, tmp_path / "run.bag")
    monkeypatch.setitem(__import__("sys").modules, "mcap", None)
    with pytest.raises(sp.InputError, match=r"pip install '\.\[control\]'"):
        sp.export_run(run, tmp_path / "run.mcap")
    assert list(tmp_path.iterdir()) == []


def test_events_of_the_wait_are_told_at_the_start(run: xr.Dataset, tmp_path: Path) -> None:
    waited = run.assign_attrs(wait=60.0, events=json.dumps([{"time": -52.5, "what": "touches the wall"}]))
    messages, _ = read(sp.export_run(waited, tmp_path / "run.mcap").path)
    assert [(time, one["message"]) for time, one in messages["/events"]] == [(0.0, "touches the wall (52.5 s before)")]


@pytest.mark.parametrize("time", [float("nan"), -1.0, 1e30])
def test_a_time_that_no_recording_holds_is_a_sentence(run: xr.Dataset, tmp_path: Path, time: float) -> None:
    damaged = run.assign_attrs(events=json.dumps([{"time": time, "what": "touches the wall"}]))
    with pytest.raises(sp.InputError, match=r"the run has something at .* s; allowed: times from 0"):
        sp.export_run(damaged, tmp_path / "run.mcap")
    assert not any(tmp_path.iterdir())
