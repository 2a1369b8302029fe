"""Tracks that other programs have found: tables of trackpy, DeepLabCut and Tracker."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from spirillum.arrays import Samples
from spirillum.errors import InputError
from spirillum.files import read_text
from spirillum.files.limits import LARGEST_TABLE
from spirillum.formats.tables import Table, TableRow, read_readings
from spirillum.measurement.flags import IMPORTED
from spirillum.measurement.marks import EDGE, Ruled
from spirillum.robot.robot import Robot
from spirillum.vision.camera.camera import opened, samples_of
from spirillum.vision.camera.optics import project
from spirillum.vision.flag import Flag
from spirillum.vision.setup import Setup
from spirillum.vision.track.learning import learnt_from
from spirillum.vision.track.track import Track

_WHAT = "a track of trackpy, DeepLabCut or Tracker in pixels (CSV)"
_NEEDED = "x, y and frame (trackpy) or t (Tracker), or DeepLabCut's table"
_TIMES = ("t", "time", "time_s")  # columns of times in s, in place of `frame`
_OWNERS = "individuals"  # first cell of DeepLabCut's header row that is there in projects of several animals
_ALONE = "single"  # DeepLabCut's individual of points that belong to none
_LIKELY = 0.6  # a point that DeepLabCut calls less likely than this is left out
_MIDDLES = ("centre", "center", "body", "middle")
_FRONTS = ("nose", "front")
_REARS = ("rear", "tail_base", "back")
_POINT_ERROR = 0.5  # standard error that is taken for a point, pixels


def read_track(
    path: str | Path,
    setup: Setup,
    video: str,
    ruled: Ruled,
    time_of: Callable[[Samples], Samples],
    frame_of: Callable[[Samples], Samples] | None = None,
) -> Track:
    """A track from another program's table, in pixels of the stored picture from its upper left corner."""
    # trackpy: columns `x`, `y`, `frame` and, with one particle, `particle`. Tracker: columns `t`, `x`, `y`, below a
    # line with the track's name. DeepLabCut: header rows (scorer, individuals of which one has points, bodyparts,
    # coords) and the points `nose` and `rear`, or `centre`. Body and tail angles are not in them.
    path = Path(path)
    first = re.split(r"[,;\t]", read_text(path, _WHAT, LARGEST_TABLE).lstrip(), maxsplit=1)[0].strip().lower()
    size = round(ruled.size[0] / ruled.stretch[0]), round(ruled.size[1] / ruled.stretch[1])  # of the stored picture
    points = _deeplabcut(path, size) if first == "scorer" else _trackpy(path, size, frame_of)
    order = np.argsort(points[0], kind="stable")
    frame = points[0][order]
    nose, rear, centre = ((item[order] + 0.5) * np.array(ruled.stretch) - 0.5 for item in points[1:])
    if np.any(np.diff(frame) <= 0):
        raise InputError(f"{path}: frame {frame[1:][np.diff(frame) <= 0][0]:g} is a duplicate; allowed: once a frame")
    front, back = ruled.points(nose), ruled.points(rear)
    both = np.isfinite(front[:, 0]) & np.isfinite(back[:, 0])
    position = np.where(both[:, None], 0.5 * (front + back), ruled.points(centre))
    along = front - back
    time = time_of(frame)
    inside = (time >= setup.start) & (time <= (setup.end or np.inf))
    nothing = np.full(frame.size, np.nan)
    error = nothing + _POINT_ERROR * ruled.scale.length_per_pixel
    middle = np.where(both[:, None], 0.5 * (nose + rear), centre)
    flag = Flag.named(IMPORTED, table=path.name)
    return Track(
        time=time[inside], frame=frame[inside], position=position[inside],
        heading=np.where(both, np.arctan2(along[:, 1], along[:, 0]), np.nan)[inside],
        body_angle=nothing[inside], tail_phase=nothing[inside], position_error=error[inside],
        body_angle_error=nothing[inside], tail_phase_error=nothing[inside],
        picture=np.concatenate([middle, nose], axis=1)[inside], size=ruled.size, scale=ruled.scale, setup=setup,
        video=video, flags=(flag,),
    )  # fmt: skip


def _check_inside(rows: Sequence[TableRow], points: Samples, names: tuple[str, str], size: tuple[int, int]) -> None:
    for name, values, pixels in zip(names, points.T, size, strict=True):
        for place in np.flatnonzero((values < -EDGE) | (values > pixels - 1 + EDGE)):
            raise rows[int(place)].error(name, f"{values[place]:g}", f"0 to {pixels - 1}, inside the picture")


_Points = tuple[Samples, Samples, Samples, Samples]


def _named(path: Path) -> Table:
    """A table with one header row, which may stand below a line with the track's name, as Tracker writes."""
    table = read_readings(path, _WHAT, ragged=True)
    if len(table.header) == 1 and table.below and len(table.below[0][1]) > 1:
        table = replace(table, headers=[table.below[0][1]], below=table.below[1:]).trimmed(ragged=True)
    return replace(table, headers=[tuple(cell.lower() for cell in table.header)])


def _trackpy(path: Path, size: tuple[int, int], frame_of: Callable[[Samples], Samples] | None) -> _Points:
    table = _named(path)
    rows = table.rows()
    timed = next((name for name in _TIMES if name in table.header), None) if "frame" not in table.header else None
    for name in ("x", "y", timed or "frame"):
        if table.header.count(name) != 1:
            wrong = "is missing" if name not in table.header else "is a duplicate"
            raise InputError(f"{path}: column '{name}' {wrong}; needed: {_NEEDED}")

    def column(name: str) -> Samples:
        return np.array([row.number(name, name) for row in rows])

    frame = _frame_numbers(rows, column(timed or "frame"), timed, frame_of)
    if "particle" in table.header:
        particles = np.unique(column("particle"))
        if particles.size > 1:
            raise InputError(f"{path}, column particle: {particles.size} particles; allowed: the robot's alone")
    centre = np.stack([column("x"), column("y")], axis=1)
    _check_inside(rows, centre, ("x", "y"), size)
    return frame, np.full_like(centre, np.nan), np.full_like(centre, np.nan), centre


def _frame_numbers(
    rows: Sequence[TableRow], values: Samples, timed: str | None, frame_of: Callable[[Samples], Samples] | None
) -> Samples:
    """Numbers of frames, from a column of them or, with its name, from one of times."""
    for row, value in zip(rows, values, strict=True):
        if math.isnan(value) or value < 0:
            raise row.error(timed or "frame", f"{value:g}", "a time from 0 s" if timed else "a whole number from 0")
    if timed is None:
        return values
    if frame_of is None:
        raise InputError(f"{rows[0].path}: column 'frame' is missing; needed: {_NEEDED}")
    frame = frame_of(values)
    for row, time, number in zip(rows, values, frame, strict=True):
        if math.isnan(number):
            raise row.error(timed, f"{time:g}", "the time of a frame of the video, s")
    return frame


def _deeplabcut(path: Path, size: tuple[int, int]) -> _Points:
    table = read_readings(path, _WHAT, headers=3, ragged=True)
    if table.headers[1][0].lower() == _OWNERS:
        table = read_readings(path, _WHAT, headers=4, ragged=True)
    rows = table.rows()
    heads = {head[0].lower(): [cell.lower() for cell in head] for head in table.headers}
    if not {"bodyparts", "coords"} <= set(heads):
        shown = "', '".join(head[0][:20] for head in table.headers[1:])
        raise InputError(f"{path}: header rows are '{shown}'; allowed: bodyparts, coords")
    columns = _columns(heads, rows, path)
    frame = _frames(rows, heads["coords"])

    def point(names: tuple[str, ...]) -> Samples | None:
        name = next((name for name in names if (name, "x") in columns or (name, "y") in columns), None)
        if name is None:
            return None
        if (name, "x") not in columns or (name, "y") not in columns:
            raise InputError(f"{path}: point '{name}' has no columns x and y; allowed: x, y, likelihood")
        found = np.array([[row.number(columns[name, c], f"{name} {c}") for c in ("x", "y")] for row in rows])
        if (place := columns.get((name, "likelihood"))) is not None:
            likely = np.array([row.number(place, f"{name} likelihood") for row in rows])
            found[~(likely >= _LIKELY)] = np.nan
        _check_inside(rows, found, (f"{name} x", f"{name} y"), size)
        return found

    nose, rear, centre = point(_FRONTS), point(_REARS), point(_MIDDLES)
    if (nose is None or rear is None) and centre is None:
        parts = ", ".join(dict.fromkeys(part for part, _ in columns))
        raise InputError(f"{path}: points {parts[:100]}; allowed: nose and rear, or centre, among them")
    missing = np.full((frame.size, 2), np.nan)
    return frame, *(missing if item is None else item for item in (nose, rear, centre))  # type: ignore[return-value]


def _columns(heads: dict[str, list[str]], rows: Sequence[TableRow], path: Path) -> dict[tuple[str, str], int]:
    """Columns by point and coordinate, of the one individual that has points."""
    parts, coordinates = heads["bodyparts"], heads["coords"]
    places = [place for place, cell in enumerate(coordinates) if place > 0 and cell]
    owners = heads.get(_OWNERS, [""] * len(parts))
    named = dict.fromkeys((*_FRONTS, *_REARS, *_MIDDLES))
    seen = dict.fromkeys(
        owners[place] for place in places if parts[place] in named and any(row.text(place) for row in rows)
    )
    animals = [owner for owner in seen if owner != _ALONE]
    if len(animals) > 1:
        raise InputError(f"{path} holds several individuals ({', '.join(animals)[:100]}); allowed: a table of one")
    kept = {*animals, _ALONE} if seen else set(owners)
    return {(parts[place], coordinates[place]): place for place in places if owners[place] in kept}


def _frames(rows: Sequence[TableRow], coordinates: Sequence[str]) -> Samples:
    """Numbers of frames, by the first column; where labels are of images, by the numbers that end their names."""
    last = next((place for place, cell in enumerate(coordinates) if place > 0 and cell), 1) - 1
    if last == 0 and "." not in "".join(row.text(0) for row in rows[:1]):
        return np.array([row.number(0, "frame") for row in rows])
    found = []
    for row in rows:
        number = re.search(r"(\d+)(?:\.\w+)?$", row.text(last), re.ASCII)
        if number is None:
            raise row.error("image", row.text(last), "the name of an image that ends in the number of its frame")
        found.append(float(number[1]))
    return np.array(found)


_BESIDE = 0.5  # distance from the robot's axis from which on a track is not the robot's, body lengths
_OTHERWISE = 0.25  # relative difference of two velocities in the picture from which on they are not of one robot
_SMALL = 5.0  # way of the robot below which velocities are not compared, pixels
_PIXELS = "pixels of the stored picture from its upper left corner, y downwards, of the robot"


def check_track(track: Track, table: Path, video: Path, setup: Setup, robot: Robot, folder: Path) -> tuple[Flag, ...]:
    """Flags on a track that cannot be, or does not stand, compared with the robot that the first look finds."""
    film = opened(video, setup)
    try:
        known = learnt_from(film, samples_of(film, setup.start, setup.end), setup, robot, folder).known
    except InputError:
        return (_unchecked(table, "no robot was found in the video"),)
    middle = track.picture[:, :2]
    there = np.isfinite(middle[:, 0])
    path = [(time, pose) for time, pose in known.start.path if _covered(time, track.time[there])]
    if not known.robot or not path:
        why = "no frame of it shows the robot" if known.robot else "no robot was recognised in the video"
        return (_unchecked(table, why),)
    time = np.array([at for at, _ in path])
    stated = np.column_stack([np.interp(time, track.time[there], middle[there, axis]) for axis in range(2)])
    half, tail = 0.5 * robot.body.length, robot.coupling.length + robot.tail.length
    axis = np.array([[half, 0.0, 0.0], [-half, 0.0, 0.0], [-half - tail, 0.0, 0.0]])
    found = np.array([project(axis, pose, known.start.body.optics) for _, pose in path])
    length = float(np.median(np.hypot(*(found[:, 0] - found[:, 1]).T)))
    off = np.array([_distance(point, ends[0], ends[2]) for point, ends in zip(stated, found, strict=True)])
    if np.median(off) > _BESIDE * length:
        place = int(np.argsort(off)[off.size // 2])
        (u, v), (nose_u, nose_v), (rear_u, rear_v) = stated[place], found[place, 0], found[place, 1]
        sentence = (
            f"{table.name} places the robot at ({u:.0f}, {v:.0f}) pixels at {time[place]:.2f} s, but the picture shows "
            f"its body from ({rear_u:.0f}, {rear_v:.0f}) to ({nose_u:.0f}, {nose_v:.0f})"
        )
        if known.whole:
            raise InputError(f"{sentence}; allowed: {_PIXELS}")
        return (Flag.named("track-beside-the-robot", sentence=sentence, pixels=_PIXELS),)
    return _otherwise(table, time, stated, found[:, :2].mean(axis=1))


def _unchecked(table: Path, why: str) -> Flag:
    return Flag.named("track-not-checked", table=table.name, why=why, pixels=_PIXELS)


def _covered(time: float, times: Samples) -> bool:
    return bool(times.size) and times[0] <= time <= times[-1]


def _distance(point: Samples, one: Samples, other: Samples) -> float:
    """Distance of a point from a straight line between two others."""
    along = other - one
    share = np.clip((point - one) @ along / max(float(along @ along), 1e-12), 0.0, 1.0)
    return float(np.hypot(*(point - one - share * along)))


def _otherwise(table: Path, time: Samples, stated: Samples, found: Samples) -> tuple[Flag, ...]:
    """A flag where the track moves otherwise than the robot, both by their mean velocities in the picture."""
    span = float(np.ptp(time))
    if time.size < 3 or span == 0.0:
        return ()
    one, other = (np.polyfit(time - time.mean(), values, 1)[0] for values in (stated, found))
    if span * np.hypot(*other) < _SMALL or np.hypot(*(one - other)) < _OTHERWISE * np.hypot(*other):
        return ()
    ways = {"stated": span * np.hypot(*one), "found": span * np.hypot(*other)}
    return (Flag.named("track-moves-otherwise", table=table.name, pixels=_PIXELS, **ways),)
