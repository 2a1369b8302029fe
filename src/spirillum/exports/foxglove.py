"""Messages that Foxglove shows, as JSON: their schemas, and the parts that they are made of.

Names and fields are those of https://docs.foxglove.dev/docs/sdk/schemas; times are whole seconds and nanoseconds.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from spirillum.arrays import Samples
from spirillum.errors import InputError

Json = dict[str, Any]
_LATEST = 1e9
"""Latest time of a recording, s; seconds have 32 bits."""


def _object(**fields: Json) -> Json:
    return {"type": "object", "properties": fields}


def _list(item: Json) -> Json:
    return {"type": "array", "items": item}


_NUMBER: Json = {"type": "number"}
_WHOLE: Json = {"type": "integer"}
_TEXT: Json = {"type": "string"}
_TRUTH: Json = {"type": "boolean"}
_TIME = _object(sec=_WHOLE, nsec=_WHOLE)
_POINT = _object(x=_NUMBER, y=_NUMBER, z=_NUMBER)
_TURN = _object(x=_NUMBER, y=_NUMBER, z=_NUMBER, w=_NUMBER)
_POSE = _object(position=_POINT, orientation=_TURN)
_COLOUR = _object(r=_NUMBER, g=_NUMBER, b=_NUMBER, a=_NUMBER)
_TRIANGLES = _object(pose=_POSE, points=_list(_POINT), color=_COLOUR, colors=_list(_COLOUR), indices=_list(_WHOLE))
_CYLINDER = _object(pose=_POSE, size=_POINT, bottom_scale=_NUMBER, top_scale=_NUMBER, color=_COLOUR)
_NOTES = _list(_object(key=_TEXT, value=_TEXT))
_ENTITY = _object(
    timestamp=_TIME,
    frame_id=_TEXT,
    id=_TEXT,
    lifetime=_TIME,
    frame_locked=_TRUTH,
    metadata=_NOTES,
    cylinders=_list(_CYLINDER),
    triangles=_list(_TRIANGLES),
)

SCHEMAS: Mapping[str, Json] = {
    "foxglove.FrameTransform": _object(
        timestamp=_TIME, parent_frame_id=_TEXT, child_frame_id=_TEXT, translation=_POINT, rotation=_TURN
    ),
    "foxglove.PoseInFrame": _object(timestamp=_TIME, frame_id=_TEXT, pose=_POSE),
    "foxglove.SceneUpdate": _object(deletions=_list(_object(timestamp=_TIME, id=_TEXT)), entities=_list(_ENTITY)),
    "foxglove.CompressedImage": _object(
        timestamp=_TIME, frame_id=_TEXT, data={**_TEXT, "contentEncoding": "base64"}, format=_TEXT
    ),
    "foxglove.Log": _object(timestamp=_TIME, level=_WHOLE, message=_TEXT, name=_TEXT, file=_TEXT, line=_WHOLE),
}
"""JSON schemas by the names by which Foxglove knows them."""


def numbers_schema(meanings: Mapping[str, str]) -> Json:
    """Schema of a message of plain numbers."""
    return _object(timestamp=_TIME, **{name: {**_NUMBER, "description": text} for name, text in meanings.items()})


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
    """A surface, by one list of triangles for each of its colours.

    Args:
        vertices: (n, 3), m.
        faces: (m, 3).
        colours: sRGB of each triangle, (m, 3).
    """
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
    """A glass tube along x.

    Args:
        diameter: m.
        length: m.
        middle: x of its middle, m.
    """
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
