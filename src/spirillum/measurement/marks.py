"""Manual readings, frame by frame, as in the paper: alone, or as corrections of a track."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from spirillum.arrays import Samples
from spirillum.errors import InputError
from spirillum.formats.tables import Table, TableRow, check_known, read_readings
from spirillum.measurement.flags import BY_HAND
from spirillum.vision.camera.scale import Scale
from spirillum.vision.flag import Flag
from spirillum.vision.setup import Setup
from spirillum.vision.track.track import Track
from spirillum.vision.video.frames import Video, open_video

_WHAT = "a table of readings by hand (CSV)"
_READINGS = ("x_px", "y_px", "x_mm", "y_mm", "body_angle_deg", "tail_phase_deg")
MARK_COLUMNS = ("video", "frame", "time_s", *_READINGS)
"""Columns of a table of manual readings; required are `frame` or `time_s`, and one reading."""
_NEAR = 0.51  # largest time between a reading and its frame, over the time between frames
_CLICK_ERROR = 1.0  # assumed standard error of a mouse click, pixels
_LENGTH_ERROR = 0.5e-3
"""Assumed standard error of a length read by eye where the scale is unknown, m: a quarter of the 2 mm marker spacing of
the paper's ruler."""
_APART = 0.75  # largest difference between the time of a row and that of its frame, s: times may be rounded to seconds
_ANGLE_ERROR = math.radians(5.0)  # assumed standard error of an angle read by eye, rad
EDGE = 0.5  #: Distance of the border from the centres of the outermost pixels, pixels; centres have integer coordinates
_LATER = 1.02  # latest time of a reading over the duration of the video, which is known to about a frame


@dataclass(frozen=True)
class Ruled:
    """The map from pixels to lengths."""

    scale: Scale  #: Scale of lengths.
    size: tuple[int, int]  #: Width and height of the picture, pixels.
    points: Callable[[Samples], Samples] = field(repr=False)
    """Maps pixels (k, 2) to (x, y) at the height of the axis, m, (k, 2)."""
    stretch: tuple[float, float] = (1.0, 1.0)
    """Shown over stored pixels along rows and columns: other programs count the stored ones."""

    @classmethod
    def plain(cls, scale: Scale, size: tuple[int, int], *, leftward: bool) -> Ruled:
        """A uniform scale without perspective and refraction."""
        sign = -1.0 if leftward else 1.0

        def points(pixels: Samples) -> Samples:
            middle = 0.5 * (np.array(size, dtype=float) - 1.0)
            return np.asarray((pixels - middle) * np.array([sign, -sign]) * scale.length_per_pixel)

        return cls(scale, size, points)


@dataclass(frozen=True)
class Marks:
    """Manual readings of one video, in SI units and pixels; NaN where nothing was read."""

    path: Path
    frame: Samples  #: Frame numbers, (k,).
    time: Samples  #: Time in the video, s, (k,).
    pixels: Samples  #: Pixel of the body's mid-length, (k, 2).
    position: Samples  #: Position (x, y) where it was read as a length, m, (k, 2).
    body_angle: Samples  #: rad, (k,).
    tail_phase: Samples  #: rad, (k,).
    lines: tuple[int, ...] = ()  #: Line number of each reading in the file.
    counted: tuple[str, ...] = ()  #: Columns whose angles were read modulo 2 pi and have been unwrapped.


def read_marks(path: str | Path) -> dict[str, Marks]:
    """Read a CSV table of manual readings by video; angles within one turn are unwrapped."""
    table = read_readings(path, _WHAT)
    check_known(table, MARK_COLUMNS)
    if not {"frame", "time_s"} & set(table.header):
        raise InputError(f"{table.path}: neither column 'frame' nor 'time_s' is there; allowed: at least one of them")
    if not set(_READINGS) & set(table.header):
        raise InputError(f"{table.path} holds no readings; allowed: at least one column of {', '.join(_READINGS)}")
    rows: dict[str, list[TableRow]] = {}
    place = table.column("video")
    for row in table.rows():
        rows.setdefault("" if place is None else row.text(place), []).append(row)
    return {video: _marks(table, chosen) for video, chosen in rows.items()}


def _marks(table: Table, rows: list[TableRow]) -> Marks:
    def column(name: str) -> Samples:
        place = table.column(name)
        return np.array([math.nan if place is None else row.number(place, name) for row in rows])

    frame, time = column("frame"), column("time_s")
    for row, number, moment in zip(rows, frame, time, strict=True):
        if math.isnan(number) and math.isnan(moment):
            raise InputError(f"{table.path}, row {row.line}: neither frame nor time_s; allowed: at least one of them")
        if math.isfinite(number) and (number < 0 or number != round(number)):
            raise row.error("frame", f"{number:g}", "a whole number from 0")
        if moment < 0:
            raise row.error("time_s", f"{moment:g}", "0 or later, the beginning of the video")
    order = np.lexsort((frame, time)) if np.isfinite(time).all() else np.argsort(frame, kind="stable")
    keys = time[order] if np.isfinite(time).all() else frame[order]
    twice = np.flatnonzero(np.diff(keys) == 0)
    if twice.size:
        first, second = sorted((rows[order[twice[0]]].line, rows[order[twice[0] + 1]].line))
        raise InputError(f"{table.path}, rows {first} and {second} are of the same frame; allowed: once a frame")
    pixels = np.stack([column("x_px"), column("y_px")], axis=1)
    position = 1e-3 * np.stack([column("x_mm"), column("y_mm")], axis=1)
    for place, axis in np.argwhere(np.isfinite(pixels) & np.isfinite(position)):
        name = "xy"[axis]
        raise InputError(
            f"{table.path}, row {rows[place].line}: {name}_px = {pixels[place, axis]:g} and {name}_mm = "
            f"{1e3 * position[place, axis]:g} in one row; allowed: one of them"
        )
    read = {name: np.radians(column(name)[order]) for name in ("body_angle_deg", "tail_phase_deg")}
    angles = {name: _unwrapped(values) for name, values in read.items()}
    counted = tuple(name for name in read if not np.array_equal(read[name], angles[name], equal_nan=True))
    return Marks(
        table.path, frame[order], time[order], pixels[order], position[order],
        angles["body_angle_deg"], angles["tail_phase_deg"],
        tuple(rows[index].line for index in order), counted,
    )  # fmt: skip


def _unwrapped(angle: Samples) -> Samples:
    """Angles modulo 2 pi, unwrapped; cumulative angles are returned unchanged."""
    known = np.isfinite(angle)
    values = angle[known]
    within = values.size > 1 and np.ptp(values) <= 2 * np.pi and np.abs(np.diff(values)).max() > np.pi
    if not within:
        return angle
    found = angle.copy()
    found[known] = np.unwrap(values)
    return found


def check_times(marks: Marks, duration: float | None) -> None:
    """Refuse readings after the end of a video."""
    if duration is None:
        return
    for place in np.flatnonzero(marks.time > duration * _LATER):
        row = f"row {marks.lines[place]}" if marks.lines else f"reading {place + 1}"
        raise InputError(
            f"{marks.path}, {row}, column time_s: {marks.time[place]:g}; allowed: 0 to {duration:.4g} s, its end"
        )


def check_pixels(marks: Marks, size: tuple[int, int]) -> None:
    """Refuse readings outside the picture."""
    for name, values, pixels in zip(("x_px", "y_px"), marks.pixels.T, size, strict=True):
        for place in np.flatnonzero((values < -EDGE) | (values > pixels - 1 + EDGE)):
            row = f"row {marks.lines[place]}" if marks.lines else f"reading {place + 1}"
            raise InputError(
                f"{marks.path}, {row}, column {name}: {values[place]:g}; allowed: 0 to {pixels - 1}, inside the picture"
            )


def _check_agreement(marks: Marks, time: Samples) -> None:
    """Refuse a reading whose time differs from the time of its frame, s, (k,); NaN where unknown."""
    for place in np.flatnonzero(np.abs(marks.time - time) > _APART):
        row = f"row {marks.lines[place]}" if marks.lines else f"reading {place + 1}"
        raise InputError(
            f"{marks.path}, {row}: frame {marks.frame[place]:g} is at {time[place]:.4g} s, but time_s is "
            f"{marks.time[place]:g}; allowed: one of them, or both alike"
        )


def _positions(marks: Marks, ruled: Ruled | None) -> Samples:
    """Positions of the body, m, (k, 2); a missing coordinate is replaced by that of the picture's centre."""
    position = marks.position.copy()
    known = np.isfinite(marks.pixels[:, 0])
    if ruled is not None and known.any():
        middle = 0.5 * (np.array(ruled.size, dtype=float) - 1.0)
        pixels = np.where(np.isfinite(marks.pixels[known]), marks.pixels[known], middle)
        found = ruled.points(pixels)
        found[~np.isfinite(marks.pixels[known, 1]), 1] = np.nan
        position[known] = np.where(np.isfinite(position[known]), position[known], found)
    return position


def track_of_marks(
    marks: Marks, setup: Setup, video: str, ruled: Ruled | None, time_of: Callable[[Samples], Samples] | None
) -> Track:
    """A track of manual readings alone."""
    time = marks.time.copy()
    missing = ~np.isfinite(time)
    if missing.any():
        if time_of is None:
            raise InputError(
                f"{marks.path}: readings have no time; allowed: a column time_s, or camera.frames_per_second "
                "in the setup"
            )
        time[missing] = time_of(marks.frame[missing])
    numbered = np.isfinite(marks.frame)
    if setup.camera.frames_per_second is not None:
        _check_agreement(marks, marks.frame / setup.camera.frames_per_second)
    elif time_of is not None and numbered.any():
        of_frames = np.full(marks.frame.shape, np.nan)
        of_frames[numbered] = time_of(marks.frame[numbered])
        _check_agreement(marks, of_frames)
    order = np.argsort(time, kind="stable")
    if np.any(np.diff(time[order]) <= 0):
        raise InputError(f"{marks.path}: two readings are of the same time; allowed: rising times")
    inside = order[(time[order] >= setup.start) & (time[order] <= (setup.end or np.inf))]
    scale = ruled.scale if ruled else Scale(math.nan, 0.0, {}, 0, math.nan)
    nothing = np.full(inside.size, np.nan)
    picture = np.concatenate([marks.pixels[inside], np.full((inside.size, 2), np.nan)], axis=1)
    click = np.full(inside.size, _LENGTH_ERROR if ruled is None else _CLICK_ERROR * scale.length_per_pixel)
    angle_error = np.full(inside.size, _ANGLE_ERROR)
    few = {1: "the only reading was", 2: "both readings were"}
    readings = few.get(inside.size, f"all {inside.size} readings were")
    return Track(
        time=time[inside], frame=marks.frame[inside], position=_positions(marks, ruled)[inside], heading=nothing,
        body_angle=marks.body_angle[inside], tail_phase=marks.tail_phase[inside],
        position_error=click, body_angle_error=angle_error, tail_phase_error=angle_error,
        picture=picture, size=ruled.size if ruled else (0, 0), scale=scale, setup=setup, video=video,
        flags=(
            Flag.named(BY_HAND, readings=readings, table=marks.path.name),
            *_unwrapped_flag(marks),
        ),
    )  # fmt: skip


def _unwrapped_flag(marks: Marks) -> tuple[Flag, ...]:
    """The flag on angles that were unwrapped."""
    if not marks.counted:
        return ()
    verb = "was" if len(marks.counted) == 1 else "were"
    return (Flag.named("counted-within-a-turn", what=f"{' and '.join(marks.counted)} {verb}"),)


def corrected(track: Track, marks: Marks, ruled: Ruled | None) -> Track:
    """A track in which manual readings replace the automatic ones."""
    # To angles the multiple of 2 pi is added that brings them nearest to the track.
    index = _frames_of(track, marks)
    frames = "1 frame carries a reading" if index.size == 1 else f"{index.size} frames carry readings"
    position, body, tail = track.position.copy(), track.body_angle.copy(), track.tail_phase.copy()
    errors = [track.position_error.copy(), track.body_angle_error.copy(), track.tail_phase_error.copy()]
    read = _positions(marks, ruled)
    for axis in range(2):
        known = np.isfinite(read[:, axis])
        position[index[known], axis] = read[known, axis]
    known = np.isfinite(read[:, 0])
    errors[0][index[known]] = _CLICK_ERROR * track.scale.length_per_pixel
    for angle, by_hand, error in ((body, marks.body_angle, errors[1]), (tail, marks.tail_phase, errors[2])):
        known = np.isfinite(by_hand)
        angle[index[known]] = _nearest_turn(track.time, angle, index[known], by_hand[known])
        error[index[known]] = _ANGLE_ERROR
    flag = Flag.named("corrected-by-hand", frames=frames, table=marks.path.name)
    return replace(
        track, position=position, body_angle=body, tail_phase=tail, position_error=errors[0],
        body_angle_error=errors[1], tail_phase_error=errors[2], flags=(*track.flags, flag),
    )  # fmt: skip


def frames_read(track: Track, marks: Marks) -> np.ndarray:
    """Mask of the frames of a track that were read by hand, (n,)."""
    found = np.zeros(track.time.size, dtype=bool)
    found[_frames_of(track, marks)] = True
    return found


def _frames_of(track: Track, marks: Marks) -> np.ndarray:
    step = float(np.median(np.diff(track.time))) if track.time.size > 1 else np.inf
    found = np.empty(marks.frame.size, dtype=np.int64)
    for number, (frame, time) in enumerate(zip(marks.frame, marks.time, strict=True)):
        by_frame = math.isfinite(frame)
        distance = np.abs(track.frame - frame) if by_frame else np.abs(track.time - time)
        nearest = int(np.argmin(distance)) if distance.size else 0
        if not distance.size or distance[nearest] > (0 if by_frame else _NEAR * step):
            line = marks.lines[number] if marks.lines else number
            what = f"frame {frame:g}" if by_frame else f"time_s {time:g}"
            raise InputError(f"{marks.path}, row {line}: {what} was not measured; allowed: a frame of the video")
        found[number] = nearest
    _check_agreement(marks, track.time[found])
    return found


def _nearest_turn(time: Samples, angle: Samples, index: np.ndarray, by_hand: Samples) -> Samples:
    known = np.isfinite(angle)
    if not known.any():
        return by_hand
    expected = np.interp(time[index], time[known], angle[known])
    return np.asarray(by_hand + 2 * np.pi * np.round((expected - by_hand) / (2 * np.pi)))


@dataclass(frozen=True)
class Untracked:
    """Scale and times of a video without tracking."""

    ruled: Ruled | None  #: Turns pixels into lengths; None where nothing gives a scale.
    time_of: Callable[[Samples], Samples] | None = field(repr=False)
    """Maps frame numbers to times, s; None where no times are known."""
    words: str = ""  #: Metadata of the video.
    duration: float | None = None  #: Length of the video, s; None where it is not known.
    seen: bool = True  #: Whether there was a video to open.
    frame_of: Callable[[Samples], Samples] | None = field(default=None, repr=False)
    """Takes times, s, to numbers of frames; NaN where none was taken."""
    flags: Sequence[Flag] = ()  #: What was odd about the video while it was read.


def untracked(path: Path, setup: Setup, folder: Path, *, needed: bool = True) -> Untracked:
    """Scale and times of a video."""
    from spirillum.vision.track.assembly import scale_of

    rate = setup.camera.frames_per_second
    try:
        video = open_video(path, rate, setup.camera.pixel_aspect_ratio)
    except InputError:
        if needed:
            raise
        return Untracked(None, None if rate is None else _Stamps(None, rate).time_of, seen=False)
    stamps = _Stamps(video, rate)
    if not needed:
        return Untracked(None, stamps.time_of, video.words, video.duration)
    found, video = scale_of(video, setup, folder=folder)
    optics = found.optics

    def points(pixels: Samples) -> Samples:
        return np.asarray((optics.points(pixels, optics.axis_height) - optics.origin)[:, :2])

    ruled = Ruled(found.scale, video.size, points, video.stretch)
    return Untracked(ruled, stamps.time_of, video.words, video.duration, frame_of=stamps.frame_of, flags=video.flags)


class _Stamps:
    """Times of frames by their numbers: at a given rate, else the video's own, read once on first use."""

    def __init__(self, video: Video | None, rate: float | None) -> None:
        self._video, self._rate = video, rate
        self._read: tuple[Samples, Samples] | None = None

    def time_of(self, frames: Samples) -> Samples:
        """Times of frames, s."""
        if self._rate is not None:
            return np.asarray(frames / self._rate)
        numbers, times = self._all()
        place = np.minimum(np.searchsorted(numbers, frames), numbers.size - 1)
        for frame in frames[numbers[place] != frames]:
            assert self._video is not None  # noqa: S101 - its stamps were read
            raise InputError(f"{self._video.name} has no frame {frame:g}; allowed: 0 to {numbers[-1]:g}")
        return np.asarray(times[place])

    def frame_of(self, times: Samples) -> Samples:
        """Numbers of the frames nearest to some times; NaN for a time that is half a step from all."""
        if self._rate is not None:
            return np.asarray(np.round(times * self._rate))
        numbers, stamps = self._all()
        place = np.clip(np.searchsorted(stamps, times), 1, max(1, stamps.size - 1))
        place = np.minimum(place, stamps.size - 1)
        before = np.maximum(place - 1, 0)
        nearest = np.where(times - stamps[before] < stamps[place] - times, before, place)
        step = float(np.median(np.diff(stamps))) if stamps.size > 1 else 1.0
        return np.where(np.abs(stamps[nearest] - times) < 0.5 * step, numbers[nearest], np.nan)

    def _all(self) -> tuple[Samples, Samples]:
        if self._read is None:
            assert self._video is not None  # noqa: S101 - without a video the rate is given
            found = [(frame.index, frame.time) for frame in self._video.frames()]
            self._read = np.array([index for index, _ in found], float), np.array([time for _, time in found])
        return self._read
