"""MCAP recordings of runs for Foxglove: poses, the robot, all numbers, events, a video."""

from __future__ import annotations

import base64
import heapq
import io
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from spirillum.argument_validation import as_number
from spirillum.display import DisplayMixin
from spirillum.dynamics.poses import Poses, poses_of, rolled
from spirillum.dynamics.run_file import open_run, robot_of
from spirillum.envelope import envelope, quantity
from spirillum.errors import InputError
from spirillum.exports import foxglove
from spirillum.files import MARK, atomic_write, guard_inputs, output_target
from spirillum.optional_dependencies import import_optional
from spirillum.robot.mesh import robot_mesh
from spirillum.robot.robot import Robot
from spirillum.version import own_version

if TYPE_CHECKING:
    import xarray as xr

RECORDINGS = {".mcap": "a recording for Foxglove"}
"""Endings of the files that can be written."""
_LAB, _BODY, _ROTOR = "lab", "body", "rotor"
_TRANSFORM, _POSE, _SCENE, _IMAGE, _LOG = foxglove.SCHEMAS
_NUMBERS = "spirillum.Quantities"
_INFORMATION = 2
_FINENESS = 0.5
_QUALITY = 85
_SLOWEST, _FASTEST = 1e-6, 1e6
_LONGEST_TUBE = 2.0
"""Length of a tube of unspecified length, over that of the robot's path and the robot together."""

Message = tuple[str, str, float, dict[str, Any]]
"""Topic, name of the schema, time in s, content."""


@dataclass(frozen=True, repr=False)
class Recording(DisplayMixin):
    """Summary of a recording file."""

    path: Path
    """The file."""
    robot: Robot
    """The robot of the run."""
    duration: float
    """Length of the run, s."""
    topics: Mapping[str, int]
    """Number of messages by topic."""

    def to_dict(self) -> dict[str, Any]:
        """Content of `spirillum export run.nc run.mcap --json`."""
        content = {
            "robot": self.robot.name,
            "file": str(self.path),
            "duration": quantity(self.duration, "s"),
            "topics": dict(self.topics),
        }
        return envelope("recording", content, ())


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
        for message in _messages(dataset, robot, poses, film, speed):
            writer.add(message)
            counts[message[0]] = counts.get(message[0], 0) + 1
        writer.finish()
    return Recording(target, robot, poses.duration, counts)


class _Writer:
    """An MCAP file whose schemas and channels are added when they are first used."""

    def __init__(self, stream: io.BufferedWriter, dataset: xr.Dataset) -> None:
        from mcap.writer import Writer

        self._writer = Writer(stream)
        self._writer.start(library=f"{MARK} {own_version()}")
        self._schemas = {**foxglove.SCHEMAS, _NUMBERS: foxglove.numbers_schema(_meanings(dataset))}
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
        at = foxglove.nanoseconds(time)
        data = json.dumps(content, allow_nan=False).encode()
        self._writer.add_message(self._channels[topic], log_time=at, data=data, publish_time=at)

    def finish(self) -> None:
        """Write index and end."""
        self._writer.finish()


def _messages(
    dataset: xr.Dataset, robot: Robot, poses: Poses, film: str | Path | None, speed: float
) -> Iterator[Message]:
    yield "/scene", _SCENE, float(poses.time[0]), {"deletions": [], "entities": _scene(robot, poses)}
    films = [] if film is None else [_film(film, speed, float(poses.time[0]), float(poses.time[-1]))]
    yield from heapq.merge(_motion(dataset, poses), _events(dataset), *films, key=lambda message: message[2])


def _motion(dataset: xr.Dataset, poses: Poses) -> Iterator[Message]:
    names = _numbers_of(dataset)
    columns = {name: np.asarray(dataset[name].values, dtype=float) for name in names}
    for n, time in enumerate(poses.time.tolist()):
        when, position, attitude = foxglove.stamp(time), poses.position[n], poses.attitude[n]
        for parent, child, where, turned in (
            (_LAB, _BODY, position, attitude),
            (_BODY, _ROTOR, np.zeros(3), rolled(float(poses.tail_phase[n]))),
        ):
            yield (
                "/tf",
                _TRANSFORM,
                time,
                {
                    "timestamp": when,
                    "parent_frame_id": parent,
                    "child_frame_id": child,
                    "translation": foxglove.place(where),
                    "rotation": foxglove.turn(turned),
                },
            )
        pose = foxglove.pose_of(position, attitude)
        yield "/pose", _POSE, time, {"timestamp": when, "frame_id": _LAB, "pose": pose}
        known = {name: float(values[n]) for name, values in columns.items() if np.isfinite(values[n])}
        yield "/quantities", _NUMBERS, time, {"timestamp": when, **known}


def _numbers_of(dataset: xr.Dataset) -> list[str]:
    """Variables that are one number at each time."""
    return [
        str(name) for name, item in dataset.data_vars.items() if item.dims == ("time",) and item.dtype.kind in "fiu"
    ]


def _meanings(dataset: xr.Dataset) -> dict[str, str]:
    attributes = {name: dataset[name].attrs for name in _numbers_of(dataset)}
    return {name: f"{item.get('long_name', name)}, {item.get('units', '')}" for name, item in attributes.items()}


def _scene(robot: Robot, poses: Poses) -> list[dict[str, Any]]:
    """Robot and tube; the parts move with their frames."""
    pieces = robot_mesh(robot, fineness=_FINENESS)
    entities = [
        foxglove.entity(
            piece.name, piece.part, foxglove.triangles(piece.vertices, piece.faces, piece.colours), "triangles"
        )
        for piece in pieces
    ]
    if robot.channel is not None:
        low, high = (float(end) for end in (poses.position[:, 0].min(), poses.position[:, 0].max()))
        robot_length = robot.body.length + robot.coupling.length + robot.tail.length
        middle = -0.5 * (robot.coupling.length + robot.tail.length)
        length = robot.channel.length
        if length is None or not np.isfinite(length):
            length, middle = _LONGEST_TUBE * (high - low + robot_length), 0.5 * (low + high) + middle
        glass = foxglove.cylinder(robot.channel.diameter, length, middle)
        entities.append(foxglove.entity("tube", _LAB, glass, "cylinders"))
    return entities


def _events(dataset: xr.Dataset) -> Iterator[Message]:
    try:
        events = json.loads(dataset.attrs.get("events", "[]"))
        entries = [(float(event["time"]), str(event["what"])) for event in events]
    except (ValueError, TypeError, KeyError) as error:
        raise InputError("the run's attribute 'events' is no list of events; allowed: a run of simulate") from error
    for time, what in sorted(entries):
        yield (
            "/events",
            _LOG,
            time,
            {
                "timestamp": foxglove.stamp(time),
                "level": _INFORMATION,
                "message": what,
                "name": "spirillum",
                "file": "",
                "line": 0,
            },
        )


def _film(film: str | Path, speed: float, start: float, end: float) -> Iterator[Message]:
    """Frames of a video during the run."""
    from spirillum.vision.video.frames import open_video

    pictures = import_optional("PIL.Image", "a video in a recording", "video")
    for frame in open_video(film).frames():
        time = start + speed * frame.time
        if time > end + 1e-9:
            break
        encoded = io.BytesIO()
        pictures.fromarray(frame.image).save(encoded, "JPEG", quality=_QUALITY)
        yield (
            "/film",
            _IMAGE,
            time,
            {
                "timestamp": foxglove.stamp(time),
                "frame_id": "camera",
                "data": base64.b64encode(encoded.getvalue()).decode(),
                "format": "jpeg",
            },
        )
