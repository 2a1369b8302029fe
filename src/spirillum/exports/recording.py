"""MCAP recordings of runs for Foxglove: poses, the robot, all numbers, events, a video.

Names and fields are those of https://docs.foxglove.dev/docs/sdk/schemas; times are whole seconds and nanoseconds.
"""

from __future__ import annotations

import base64
import heapq
import io
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from spirillum.argument_validation import as_number
from spirillum.arrays import Samples
from spirillum.display import DisplayMixin
from spirillum.dynamics.run_file import Poses, open_run, poses_of, robot_of, rolled
from spirillum.errors import InputError
from spirillum.files import MARK, atomic_write, guard_inputs, output_target
from spirillum.optional_dependencies import import_optional
from spirillum.robot.mesh import robot_mesh
from spirillum.robot.robot import Robot
from spirillum.version import package_version

if TYPE_CHECKING:
    import xarray as xr


Json = dict[str, Any]
_LATEST = 1e9  # latest time of a recording, s; seconds have 32 bits


SCHEMAS: Mapping[str, Json] = json.loads((Path(__file__).parent / "foxglove.json").read_text(encoding="utf-8"))
"""JSON schemas by the names by which Foxglove knows them."""
_TIME, _NUMBER = SCHEMAS["foxglove.Log"]["properties"]["timestamp"], {"type": "number"}


def nanoseconds(time: float) -> int:
    """A time of a run, s, in whole nanoseconds."""
    if not 0.0 <= time <= _LATEST:
        raise InputError(f"the run has something at {time:g} s; allowed: times from 0 to {_LATEST:g} s")
    return round(time * 1e9)


def stamp(time: float) -> Json:
    """A time of a run as messages have it."""
    seconds, rest = divmod(nanoseconds(time), 1_000_000_000)
    return {"sec": seconds, "nsec": rest}


def place(position: Samples) -> Json:
    """A point or vector, (3,)."""
    return {axis: float(value) for axis, value in zip("xyz", position, strict=True)}


def turn(quaternion: Samples) -> Json:
    """A unit quaternion w, x, y, z."""
    return {axis: float(value) for axis, value in zip("wxyz", quaternion, strict=True)}


def pose_of(position: Samples, quaternion: Samples) -> Json:
    """A position and an attitude (w, x, y, z)."""
    return {"position": place(position), "orientation": turn(quaternion)}


def colour(red: float, green: float, blue: float, opacity: float = 1.0) -> Json:
    """A colour, sRGB from 0 to 1."""
    return {"r": red, "g": green, "b": blue, "a": opacity}


def triangles(vertices: Samples, faces: np.ndarray, colours: Samples) -> list[Json]:
    """A surface, by one list of triangles for each of its sRGB colours, (m, 3)."""
    shades, which = np.unique(colours, axis=0, return_inverse=True)
    found = []
    for number, shade in enumerate(shades):
        used, indices = np.unique(faces[which.reshape(-1) == number], return_inverse=True)
        found.append(
            {
                "pose": pose_of(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])),
                "points": [place(point) for point in np.round(vertices[used], 9)],
                "color": colour(*shade.tolist()),
                "colors": [],
                "indices": indices.reshape(-1).tolist(),
            }
        )
    return found


def cylinder(diameter: float, length: float, middle: float) -> list[Json]:
    """A glass tube along x."""
    upright = np.array([np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0])  # its axis is z at first
    return [
        {
            "pose": pose_of(np.array([middle, 0.0, 0.0]), upright),
            "size": place(np.array([diameter, diameter, length])),
            "bottom_scale": 1.0,
            "top_scale": 1.0,
            "color": colour(0.75, 0.85, 0.95, 0.15),
        }
    ]


def entity(name: str, frame: str, shapes: Sequence[Json], kind: str) -> Json:
    """A part of a scene that moves with a frame and stays."""
    return {
        "timestamp": stamp(0.0),
        "frame_id": frame,
        "id": name,
        "lifetime": {"sec": 0, "nsec": 0},
        "frame_locked": True,
        "metadata": [],
        "cylinders": [],
        "triangles": [],
        kind: list(shapes),
    }


RECORDINGS = {".mcap": "a recording for Foxglove"}  #: Endings of the files that can be written.
_LAB, _BODY, _ROTOR = "lab", "body", "rotor"
_TRANSFORM, _POSE_IN_FRAME, _SCENE, _IMAGE, _LOG = SCHEMAS
_NUMBERS = "spirillum.Quantities"
_INFORMATION = 2
_FINENESS = 0.5
_QUALITY = 85
_SLOWEST, _FASTEST = 1e-6, 1e6
_LONGEST_TUBE = 2.0  # length of a tube of unspecified length, over that of the robot's path and the robot together

Message = tuple[str, str, float, dict[str, Any]]  #: Topic, name of the schema, time in s, content.


@dataclass(frozen=True, repr=False)
class Recording(DisplayMixin):
    """Summary of a recording file."""

    path: Path  #: The file.
    robot: Robot  #: The robot of the run.
    duration: float  #: Length of the run, s.
    topics: Mapping[str, int]  #: Number of messages by topic.


def export_run(
    run: xr.Dataset | str | Path, path: str | Path, *, film: str | Path | None = None, speed: float = 1.0
) -> Recording:
    """Write a run as a recording (MCAP), which Foxglove opens; needs the extra `control`.

    Topics are `/tf` (body in the lab, rotor in the body), `/pose`, `/scene` (robot and tube, once), `/quantities` (all
    numbers of the run by their names, SI), `/events`, and `/film`. Messages are JSON and carry their schemas.

    Args:
        run: what `spirillum.simulate` returns, or the file with it.
        path: file to write, `.mcap`.
        film: a film of the run, or of the robot, that begins with it; its frames go into the recording as JPEG (extra
            `video`).
        speed: time of the run over time of that film, as `spirillum.film` was told.

    Raises:
        InputError: for wrong input, a run that holds no motion, or a missing library.
    """
    if not _SLOWEST <= as_number(speed) <= _FASTEST:
        raise InputError(f"speed = {str(speed)[:40]}; allowed: {_SLOWEST:g} to {_FASTEST:g}")
    inputs = [run] if isinstance(run, (str, Path)) else []
    with guard_inputs(*inputs, film):
        target = output_target(path, RECORDINGS, "run.mcap")
    import_optional("mcap", "a recording in the format MCAP", "control")
    dataset = open_run(run) if isinstance(run, (str, Path)) else run
    robot = robot_of(dataset)
    poses = poses_of(dataset)
    counts: dict[str, int] = {}
    with atomic_write(target) as temporary, temporary.open("wb") as stream:
        writer = _Writer(stream, dataset)
        start, end = float(poses.time[0]), float(poses.time[-1])
        scene: Message = ("/scene", _SCENE, start, {"deletions": [], "entities": _scene(robot, poses)})
        films = [] if film is None else [_film(film, speed, start, end)]
        moving = heapq.merge(_motion(dataset, poses), _events(dataset), *films, key=lambda message: message[2])
        for message in chain([scene], moving):
            writer.add(message)
            counts[message[0]] = counts.get(message[0], 0) + 1
        writer.finish()
    return Recording(target, robot, poses.duration, counts)


class _Writer:
    """An MCAP file whose schemas and channels are added when they are first used."""

    def __init__(self, stream: io.BufferedWriter, dataset: xr.Dataset) -> None:
        from mcap.writer import Writer

        self._writer = Writer(stream)
        self._writer.start(library=f"{MARK} {package_version()}")
        numbers = {name: {**_NUMBER, "description": text} for name, text in _meanings(dataset).items()}
        self._schemas = {
            **SCHEMAS,
            _NUMBERS: {"type": "object", "properties": {"timestamp": _TIME, **numbers}},
        }
        self._channels: dict[str, int] = {}
        names = ("robot", "model", "settings", "versions", "title")
        self._writer.add_metadata(
            "spirillum run", {name: str(dataset.attrs[name]) for name in names if name in dataset.attrs}
        )

    def add(self, message: Message) -> None:
        """Write one message."""
        topic, schema, time, content = message
        if topic not in self._channels:
            text = json.dumps({"title": schema, **self._schemas[schema]}).encode()
            number = self._writer.register_schema(name=schema, encoding="jsonschema", data=text)
            self._channels[topic] = self._writer.register_channel(topic, "json", number)
        at = nanoseconds(time)
        data = json.dumps(content, allow_nan=False).encode()
        self._writer.add_message(self._channels[topic], log_time=at, data=data, publish_time=at)

    def finish(self) -> None:
        """Write index and end."""
        self._writer.finish()


def _motion(dataset: xr.Dataset, poses: Poses) -> Iterator[Message]:
    names = _numbers_of(dataset)
    columns = {name: np.asarray(dataset[name].values, dtype=float) for name in names}
    for n, time in enumerate(poses.time.tolist()):
        when, position, attitude = stamp(time), poses.position[n], poses.attitude[n]
        for parent, child, where, turned in (
            (_LAB, _BODY, position, attitude),
            (_BODY, _ROTOR, np.zeros(3), rolled(float(poses.tail_phase[n]))),
        ):
            frames = {"timestamp": when, "parent_frame_id": parent, "child_frame_id": child}
            yield "/tf", _TRANSFORM, time, {**frames, "translation": place(where), "rotation": turn(turned)}
        pose = pose_of(position, attitude)
        yield "/pose", _POSE_IN_FRAME, time, {"timestamp": when, "frame_id": _LAB, "pose": pose}
        known = {name: float(values[n]) for name, values in columns.items() if np.isfinite(values[n])}
        yield "/quantities", _NUMBERS, time, {"timestamp": when, **known}


def _numbers_of(dataset: xr.Dataset) -> list[str]:
    return [
        str(name) for name, item in dataset.data_vars.items() if item.dims == ("time",) and item.dtype.kind in "fiu"
    ]


def _meanings(dataset: xr.Dataset) -> dict[str, str]:
    attributes = {name: dataset[name].attrs for name in _numbers_of(dataset)}
    return {name: f"{item.get('long_name', name)}, {item.get('units', '')}" for name, item in attributes.items()}


def _scene(robot: Robot, poses: Poses) -> list[dict[str, Any]]:
    pieces = robot_mesh(robot, fineness=_FINENESS)
    entities = [
        entity(piece.name, piece.part, triangles(piece.vertices, piece.faces, piece.colours), "triangles")
        for piece in pieces
    ]
    if robot.channel is not None:
        low, high = (float(end) for end in (poses.position[:, 0].min(), poses.position[:, 0].max()))
        robot_length = robot.body.length + robot.coupling.length + robot.tail.length
        middle = -0.5 * (robot.coupling.length + robot.tail.length)
        length = robot.channel.length
        if length is None or not np.isfinite(length):
            length, middle = _LONGEST_TUBE * (high - low + robot_length), 0.5 * (low + high) + middle
        glass = cylinder(robot.channel.diameter, length, middle)
        entities.append(entity("tube", _LAB, glass, "cylinders"))
    return entities


def _events(dataset: xr.Dataset) -> Iterator[Message]:
    """Events; those of the wait before the run, which a recording cannot hold, at its start."""
    try:
        wait = float(dataset.attrs.get("wait", 0.0))
        events = json.loads(dataset.attrs.get("events", "[]"))
        entries = [(float(event["time"]), str(event["what"])) for event in events]
    except (ValueError, TypeError, KeyError) as error:
        raise InputError("the run's attribute 'events' is no list of events; allowed: a run of simulate") from error
    for time, what in sorted(entries):
        if -wait <= time < 0.0:
            time, what = 0.0, f"{what} ({-time:.4g} s before)"  # noqa: PLW2901
        entry = {"timestamp": stamp(time), "level": _INFORMATION, "message": what}
        yield "/events", _LOG, time, {**entry, "name": "spirillum", "file": "", "line": 0}


def _film(film: str | Path, speed: float, start: float, end: float) -> Iterator[Message]:
    from spirillum.vision.video.frames import open_video

    pictures = import_optional("PIL.Image", "a video in a recording", "video")
    for frame in open_video(film).frames():
        time = start + speed * frame.time
        if time > end + 1e-9:
            break
        encoded = io.BytesIO()
        pictures.fromarray(frame.image).save(encoded, "JPEG", quality=_QUALITY)
        picture = {"data": base64.b64encode(encoded.getvalue()).decode(), "format": "jpeg"}
        yield "/film", _IMAGE, time, {"timestamp": stamp(time), "frame_id": "camera", **picture}
