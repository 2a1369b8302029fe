"""Tracks that other programs have found: trackpy's and DeepLabCut's tables."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from spirillum.arrays import Samples
from spirillum.errors import InputError
from spirillum.files import read_text
from spirillum.files.limits import LARGEST_TABLE
from spirillum.formats.tables import Row, read_readings
from spirillum.measurement.flags import IMPORTED
from spirillum.measurement.marks import EDGE, Ruled
from spirillum.vision.flag import Flag
from spirillum.vision.setup import Setup
from spirillum.vision.track.track import Track

__all__ = ["read_track"]

_WHAT = "a track of trackpy or DeepLabCut (CSV)"
_LIKELY = 0.6
"""A point that DeepLabCut calls less likely than this is left out."""
_MIDDLES = ("centre", "center", "body", "middle")
_FRONTS = ("nose", "front")
_REARS = ("rear", "tail_base", "back")
_POINT_ERROR = 0.5
"""Standard error that is taken for a point, pixels."""


def read_track(
    path: str | Path, setup: Setup, video: str, ruled: Ruled, time_of: Callable[[Samples], Samples]
) -> Track:
    """A track from another program's table, in pixels.

    trackpy: columns `x`, `y`, `frame` and, with one particle, `particle`. DeepLabCut: three header rows (scorer,
    bodyparts, coords) and the points `nose` and `rear`, or `centre`. Body and tail angles are not in them.

    Args:
        path: the table.
        setup: the setup.
        video: name of the video.
        ruled: turns pixels into lengths.
        time_of: takes numbers of frames to times, s.

    Raises:
        InputError: if it is neither, or a cell is wrong; the sentence names row and column.
    """
    path = Path(path)
    first = read_text(path, _WHAT, LARGEST_TABLE).lstrip().split(",", 1)[0].strip().lower()
    frame, nose, rear, centre = (_deeplabcut if first == "scorer" else _trackpy)(path, ruled.size)
    order = np.argsort(frame, kind="stable")
    frame, nose, rear, centre = frame[order], nose[order], rear[order], centre[order]
    if np.any(np.diff(frame) <= 0):
        raise InputError(f"{path}: frame {frame[1:][np.diff(frame) <= 0][0]:g} stands twice; allowed: once a frame")
    front, back = ruled.points(nose), ruled.points(rear)
    both = np.isfinite(front[:, 0]) & np.isfinite(back[:, 0])
    position = np.where(both[:, None], 0.5 * (front + back), ruled.points(centre))
    along = front - back
    time = time_of(frame)
    inside = (time >= setup.start) & (time <= (setup.end or np.inf))
    nothing = np.full(frame.size, np.nan)
    error = nothing + _POINT_ERROR * ruled.scale.length_per_pixel
    middle = np.where(both[:, None], 0.5 * (nose + rear), centre)
    flag = Flag(IMPORTED, f"the positions are another program's, from {path.name}; it has no angles of body and tail")
    return Track(
        time=time[inside], frame=frame[inside], position=position[inside],
        heading=np.where(both, np.arctan2(along[:, 1], along[:, 0]), np.nan)[inside],
        body_angle=nothing[inside], tail_phase=nothing[inside], position_error=error[inside],
        body_angle_error=nothing[inside], tail_phase_error=nothing[inside],
        picture=np.concatenate([middle, nose], axis=1)[inside], size=ruled.size, scale=ruled.scale, setup=setup,
        video=video, flags=(flag,),
    )  # fmt: skip


def _check_inside(rows: Sequence[Row], points: Samples, names: tuple[str, str], size: tuple[int, int]) -> None:
    """Refuse points from outside the picture.

    Raises:
        InputError: if there is one; the sentence names row and column.
    """
    for name, values, pixels in zip(names, points.T, size, strict=True):
        for place in np.flatnonzero((values < -EDGE) | (values > pixels - 1 + EDGE)):
            raise rows[int(place)].error(name, f"{values[place]:g}", f"0 to {pixels - 1}, inside the picture")


_Points = tuple[Samples, Samples, Samples, Samples]


def _trackpy(path: Path, size: tuple[int, int]) -> _Points:
    table = read_readings(path, _WHAT)
    rows = table.rows()
    places = {name: table.column(name) for name in ("x", "y", "frame", "particle")}
    for name in ("x", "y", "frame"):
        if places[name] is None:
            raise InputError(
                f"{path}: column '{name}' is missing; needed: x, y, frame (trackpy), or DeepLabCut's table"
            )

    def column(name: str) -> Samples:
        place = places[name]
        assert place is not None  # noqa: S101 - checked above
        return np.array([row.number(place, name) for row in rows])

    for row, number in zip(rows, column("frame"), strict=True):
        if math.isnan(number) or number < 0:
            raise row.error("frame", f"{number:g}", "a whole number from 0")
    if places["particle"] is not None:
        particles = np.unique(column("particle"))
        if particles.size > 1:
            raise InputError(f"{path}, column particle: {particles.size} particles; allowed: the robot's alone")
    centre = np.stack([column("x"), column("y")], axis=1)
    _check_inside(rows, centre, ("x", "y"), size)
    return column("frame"), np.full_like(centre, np.nan), np.full_like(centre, np.nan), centre


def _deeplabcut(path: Path, size: tuple[int, int]) -> _Points:
    table = read_readings(path, _WHAT, headers=3)
    rows = table.rows()
    parts, coordinates = (tuple(cell.lower() for cell in head) for head in table.headers[1:3])
    if parts[0] == "individuals":
        raise InputError(f"{path} holds several individuals; allowed: a table of one")
    if parts[0] != "bodyparts" or coordinates[0] != "coords":
        raise InputError(
            f"{path}: header rows are '{parts[0][:20]}', '{coordinates[0][:20]}'; allowed: bodyparts, coords"
        )
    frame = np.array([row.number(0, "frame") for row in rows])

    def point(names: tuple[str, ...]) -> Samples | None:
        name = next((name for name in names if name in parts), None)
        if name is None:
            return None
        place = {c: i for i, (p, c) in enumerate(zip(parts, coordinates, strict=True)) if p == name}
        if not {"x", "y"} <= set(place):
            raise InputError(f"{path}: point '{name}' has no columns x and y; allowed: x, y, likelihood")
        found = np.array([[row.number(place[c], f"{name} {c}") for c in ("x", "y")] for row in rows])
        if "likelihood" in place:
            likely = np.array([row.number(place["likelihood"], f"{name} likelihood") for row in rows])
            found[~(likely >= _LIKELY)] = np.nan
        _check_inside(rows, found, (f"{name} x", f"{name} y"), size)
        return found

    nose, rear, centre = point(_FRONTS), point(_REARS), point(_MIDDLES)
    if (nose is None or rear is None) and centre is None:
        raise InputError(
            f"{path}: points {', '.join(dict.fromkeys(parts[1:]))[:100]}; allowed: nose and rear, or centre, among them"
        )
    missing = np.full((frame.size, 2), np.nan)
    return frame, *(missing if item is None else item for item in (nose, rear, centre))  # type: ignore[return-value]
