"""From videos to speeds and rates: the request, each trial, and all of them together."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from spirillum.answer_entries import answer_of
from spirillum.display import DisplayMixin
from spirillum.errors import InputError
from spirillum.files import checked_path, file_name
from spirillum.measurement.flags import BY_HAND
from spirillum.measurement.imported import check_track, read_track
from spirillum.measurement.marks import (
    Marks,
    Untracked,
    check_pixels,
    check_times,
    corrected,
    frames_read,
    read_marks,
    track_of_marks,
    untracked,
)
from spirillum.measurement.outliers import GRUBBS_LEVEL, outlying_trial
from spirillum.measurement.setup_template import scale_confirmed, setup_remarks
from spirillum.measurement.statistics import NORMAL, mean_with_interval
from spirillum.measurement.trials import LEVEL, MEASURED, RATE_NAMES, WOBBLES, Measured, Trial, trial_of
from spirillum.notes import Note
from spirillum.robot.robot import Robot
from spirillum.units import KINDS, parse_option
from spirillum.vision.flag import Flag
from spirillum.vision.setup import Setup, load_setup
from spirillum.vision.track.assembly import Watcher, follow
from spirillum.vision.track.track import Track
from spirillum.vision.video.frames import Video

_LENGTHS = ("forward_velocity", "lateral_position")
_COPY = "copy-of-a-trial"


@dataclass(frozen=True)
class Summary:
    """Means over trials."""

    quantities: Mapping[str, Measured]  #: Means by the names of `MEASURED`.
    counts: Mapping[str, int]  #: Number of trials that entered each mean.
    trials: int  #: Number of all trials, without copies.
    scale_uncertainty: float  #: Relative standard uncertainty of lengths, common to all trials.

    def to_dict(self) -> dict[str, Any]:
        """As JSON."""
        found = {name: item.to_dict(n=self.counts[name]) for name, item in self.quantities.items()}
        return {"n": self.trials, **found, "scale_uncertainty": self.scale_uncertainty}


def summary_of(trials: Sequence[Trial]) -> Summary:
    """Means over trials, see `mean_with_interval`; that of a single trial is its own. A copy of a trial is none."""
    # The uncertainty of the scale is common to all trials: averaging does not reduce it.
    trials = [trial for trial in trials if not any(flag.name == _COPY for flag in trial.flags)]
    shared = max((trial.track.scale.relative_uncertainty for trial in trials), default=0.0)
    quantities, counts = {}, {}
    for name in MEASURED:
        measured = [trial.quantities[name] for trial in trials if math.isfinite(trial.quantities[name].value)]
        counts[name] = len(measured)
        quantities[name] = _mean(name, measured, trials, shared)
    return Summary(quantities, counts, len(trials), shared)


def _mean(name: str, measured: Sequence[Measured], trials: Sequence[Trial], shared: float) -> Measured:
    if not measured:
        first = trials[0].quantities[name]
        return replace(first, reason=first.reason or "no trial measured it")
    if len(measured) == 1:
        return measured[0]
    common = NORMAL * shared if name in _LENGTHS else 0.0
    # Half widths without the error that is common to all trials.
    squares = [(0.5 * (item.high - item.low)) ** 2 - (common * item.value) ** 2 for item in measured]
    own = [math.sqrt(max(square, 0.0)) for square in squares]
    mean = mean_with_interval([item.value for item in measured], LEVEL, own)
    reach = math.hypot(mean.half_width, common * mean.value)
    if name in WOBBLES:  # the error of tracking is common to all trials
        reach = max(reach, float(np.mean([item.high - item.value for item in measured])))
    low = mean.value - reach
    if name in WOBBLES:
        low = max(low, 0.0)  # an amplitude
    return Measured(mean.value, low, mean.value + reach, measured[0].unit)


def compared(trials: Sequence[Trial]) -> list[Trial]:
    """All trials, with flags on outliers (Grubbs' test) and on copies of another trial."""
    found = [_copy_flagged(trial, trials[:place]) for place, trial in enumerate(trials)]
    for name in RATE_NAMES:
        worst = outlying_trial([trial.quantities[name].value for trial in trials])
        if worst is None:
            continue
        both: dict[str, Any] = {"rate": name.replace("_", "-"), "words": name.replace("_", " ")}
        found[worst] = found[worst].flagged(Flag.named("outlier", level=100 * GRUBBS_LEVEL, **both))
    return found


def _copy_flagged(trial: Trial, others: Sequence[Trial]) -> Trial:
    """The trial, flagged if its track equals that of another one; readings by hand are coarse, and may agree."""
    x = trial.track.position[:, 0]
    twin = next((other for other in others if np.array_equal(other.track.position[:, 0], x, equal_nan=True)), None)
    if twin is None or not np.isfinite(x).any() or any(flag.name == BY_HAND for flag in trial.track.flags):
        return trial
    return trial.flagged(Flag.named(_COPY, name=twin.name))


Progress = Callable[[str, int, int], None]
TABLE = "observations.csv"  #: Name of the table that a measurement writes.


@dataclass(frozen=True, repr=False)
class Measurement(DisplayMixin):
    """What was measured of a robot in one or several trials."""

    trials: tuple[Trial, ...]  #: The trials, in the order of the videos.
    summary: Summary  #: Means over trials.
    robot: Robot = field(repr=False)  #: The robot.
    setup: str  #: The setup file.
    failures: tuple[tuple[str, str], ...] = ()  #: Videos that could not be measured, each with a sentence.
    files: tuple[str, ...] = ()  #: Files that were written.
    interrupted: bool = False  #: Whether it was interrupted before the last video.
    left: tuple[str, ...] = ()  #: Datasets of other measurements in the same folder.

    @property
    def warnings(self) -> tuple[Note, ...]:
        """What to be careful about."""
        found = [note for trial in self.trials for note in _notes(trial)]
        if any(math.isfinite(trial.track.scale.length_per_pixel) for trial in self.trials):
            confirmed = all(scale_confirmed(trial.track.scale.apparent_size, trial.flags) for trial in self.trials)
            found += setup_remarks(self.trials[0].track.setup, confirmed=confirmed)
        found += [Note("not-measured", f"{video}: not measured: {sentence}") for video, sentence in self.failures]
        total = self.summary.trials
        few = {name: count for name, count in self.summary.counts.items() if name in RATE_NAMES and 0 < count < total}
        found += [
            Note("not-measured", f"the mean {name.replace('_', ' ')} rests on {count} of {total} trials", (name,))
            for name, count in few.items()
        ]
        if self.summary.trials == 1:
            words = "one trial: intervals are its own and do not include how trials differ; measure more trials"
            found.append(Note("intervals-incomplete", words))
        two = [name for name in RATE_NAMES if self.summary.counts.get(name) == 2]
        if two:
            words = "means over two trials: one difference gives their intervals, which may be several times too wide"
            found.append(Note("intervals-incomplete", f"{words}; measure more trials", two))
        unlike = [name for name in RATE_NAMES if _differ([trial.quantities[name] for trial in self.trials])]
        if unlike:
            words = f"trials differ by over a quarter in {' and '.join(unlike[:2]).replace('_', ' ')}"
            found.append(Note("outlier", f"{words}: the mean takes them as repeats; measure unlike ones apart", unlike))
        if self.files and TABLE not in self.files:
            free = self.robot.channel is None
            why = f"the robot has no channel, which {TABLE} states" if free else "no trial gives a speed or a rate"
            found.append(Note("files", f"{why}: {TABLE} is not written"))
        if self.left:
            words = f"not of this measurement, and left in the folder from before: {', '.join(self.left)}"
            found.append(Note("files", words))
        return tuple(found)

    @property
    def lateral_shift(self) -> float:
        """By how much one degree of the camera's tilt moves the lateral position, m; in no interval.

        A ray that leaves the lens at an angle crosses the air, and below a surface the oil, where it is refracted.
        """
        setup = self.trials[0].track.setup
        surface = setup.robot.axis_height if setup.tank.surface is None else setup.tank.surface
        air, oil = setup.camera.height - surface, surface - setup.robot.axis_height
        return math.radians(1.0) * (air + oil / setup.tank.index)

    def to_dict(self) -> dict[str, Any]:
        """As JSON, SI with rates in rad/s."""
        measured = [{"name": trial.name, **trial.to_dict()} for trial in self.trials]
        failed = [{"video": video, "sentence": sentence} for video, sentence in self.failures]
        return answer_of(self, measured=measured, failed=failed)


_UNLIKE = 1.25  # ratio from which on trials of one robot are no repeats: those of one drive scatter by some per cent


def _differ(found: Sequence[Measured]) -> bool:
    """Whether the least and the largest of some values differ by more than their intervals and `_UNLIKE`."""
    known = sorted((item for item in found if math.isfinite(item.value)), key=lambda item: item.value)
    if len(known) < 2:
        return False
    least, most = known[0], known[-1]
    small, large = sorted((abs(least.value), abs(most.value)))
    return least.high < most.low and (least.value * most.value <= 0.0 or large > _UNLIKE * small)


def _notes(trial: Trial) -> list[Note]:
    """Flags of a trial, and why a rate is missing where no flag states it."""
    flags = [flag.note for flag in trial.flags]
    reasons: dict[str, list[str]] = {}
    for name in RATE_NAMES:
        item = trial.quantities[name]
        if not math.isfinite(item.value) and item.reason not in flags:
            reasons.setdefault(item.reason, []).append(name)
    missing = [
        Note("not-measured", f"{', '.join(names).replace('_', ' ')} not given: {reason}", names)
        for reason, names in reasons.items()
    ]
    return [note.prefixed(f"{trial.name}: ") for note in (*flags, *missing)]


class MeasurementRequest(NamedTuple):
    """Videos of one robot with one setup, checked: one trial each."""

    videos: tuple[Path, ...]  #: Videos or folders of images.
    names: tuple[str, ...]  #: Names of the trials.
    readings: tuple[Marks | None, ...]  #: Readings by hand of each video.
    setup: Setup  #: The setup, with the requested times.
    setup_file: str  #: The setup file.
    robot: Robot  #: The robot.
    track: Path | None  #: Table of positions that another program has found.
    tracking: bool  #: Whether the robot is looked for in the videos.

    @property
    def folder(self) -> Path:
        """Folder of the setup file, from which its other files are named."""
        return Path(self.setup_file).parent


def check_request(
    videos: str | Path | Sequence[str | Path],
    setup: str | Path,
    *,
    marks: str | Path | None = None,
    track: str | Path | None = None,
    tracking: bool = True,
    start: str | float | None = None,
    end: str | float | None = None,
    overrides: Mapping[str, Any] | None = None,
) -> MeasurementRequest:
    """Check what is to be measured, before any video is opened."""
    given = [videos] if isinstance(videos, (str, Path)) else list(videos)
    words = [*(("video", video) for video in given), ("marks", marks), ("track", track)]
    for what, word in words:
        if word is not None:
            checked_path(word, f"the name of a {what}")
    paths = [Path(video) for video in given]
    bounds = {name: value for name, value in (("start", start), ("end", end)) if value is not None}
    limits = {name: parse_option(name, value, KINDS["time"]) for name, value in bounds.items()}
    chosen, robot = _loaded(setup, overrides, limits.get("start"), limits.get("end"))
    readings = _readings(paths, marks, track, tracking=tracking)
    table = None if track is None else Path(track)
    return MeasurementRequest(
        tuple(paths), tuple(_names(paths)), tuple(readings), chosen, str(setup), robot, table, tracking
    )


def measured_trial(
    asked: MeasurementRequest,
    number: int,
    video: Path | Video,
    *,
    progress: Callable[[int, int | None], None] | None = None,
    on_frame: Watcher | None = None,
) -> Trial:
    """Speed, rates and wobble from one video."""
    path, name, marks = asked.videos[number], asked.names[number], asked.readings[number]
    if asked.tracking and asked.track is None:
        track = follow(video, asked.setup, asked.robot, folder=asked.folder, progress=progress, on_frame=on_frame)
        ruled = untracked(path, asked.setup, asked.folder).ruled if _in_pixels(marks) else None
    else:
        seen = untracked(path, asked.setup, asked.folder, needed=asked.track is not None or _in_pixels(marks))
        ruled = seen.ruled
        if marks is not None and ruled is not None:
            check_pixels(marks, ruled.size)
        track = replace(_of_tables(path, seen, marks, asked), words=seen.words)
        marks = marks if asked.track is not None else None
    read = None  # no frame was corrected
    if marks is not None:
        check_pixels(marks, track.size)
        read = frames_read(track, marks)
        track = corrected(track, marks, ruled)
    return trial_of(track, asked.robot, name, read)


def _of_tables(path: Path, seen: Untracked, marks: Marks | None, asked: MeasurementRequest) -> Track:
    if asked.track is not None:
        assert seen.ruled is not None  # noqa: S101 - requested
        assert seen.time_of is not None  # noqa: S101
        found = read_track(asked.track, asked.setup, path.name, seen.ruled, seen.time_of, seen.frame_of)
        doubts = check_track(found, asked.track, path, asked.setup, asked.robot, asked.folder)
        return replace(found, flags=(*found.flags, *seen.flags, *doubts))
    if marks is None:
        raise InputError(f"{path} has no readings by hand; allowed: some, or tracking")
    check_times(marks, seen.duration)
    track = track_of_marks(marks, asked.setup, path.name, seen.ruled, seen.time_of)
    if seen.seen:
        return track
    return replace(track, flags=(*track.flags, Flag.named("no-video", video=path.name)))


def measurement_of(
    asked: MeasurementRequest,
    trials: Sequence[Trial],
    failures: Sequence[tuple[str, str]] = (),
    *,
    interrupted: bool = False,
) -> Measurement:
    """All trials compared with each other, and their summary."""
    found = tuple(compared(trials))
    summary, failed = summary_of(found), tuple(failures)
    return Measurement(found, summary, asked.robot, asked.setup_file, failed, interrupted=interrupted)


def _loaded(
    setup: str | Path, overrides: Mapping[str, Any] | None, start: float | None, end: float | None
) -> tuple[Setup, Robot]:
    chosen, robot = load_setup(setup, overrides)
    first = chosen.start if start is None else float(start)
    last = chosen.end if end is None else float(end)
    if not (math.isfinite(first) and first >= 0):
        raise InputError(f"start = {first:g} s; allowed: 0 s or later")
    if last is not None and not last > first:
        raise InputError(f"end = {last:g} s; allowed: later than the start, {first:g} s")
    return chosen.model_copy(update={"start": first, "end": last}), robot


def _names(paths: Sequence[Path]) -> list[str]:
    """Names of the trials: those of their files, numbered where they are the same."""
    if not paths:
        raise InputError("no video; allowed: at least one, or --feasibility")
    found: list[str] = []
    real = [_resolved(path) for path in paths]
    for place, path in enumerate(paths):
        if real[place] in real[:place]:
            raise InputError(f"{path} is given twice; allowed: each video once, as trials are independent")
        stem = file_name((real[place].name if path.is_dir() else path.stem) or "trial")
        name, number = stem, 2
        while any(_clash(name, other) for other in found):
            name, number = f"{stem}-{number}", number + 1
        found.append(name)
    return found


def _resolved(path: Path) -> Path:
    try:
        return path.resolve()
    except (OSError, RuntimeError) as error:
        words = f"video = {str(path)[:200]!r} is a loop of links; allowed: a film, or a folder of images"
        raise InputError(words) from error


def _clash(one: str, other: str) -> bool:
    """Whether two trials would write files of the same name, also where capitals do not count."""
    one, other = one.casefold(), other.casefold()
    return bool({one, f"{one}.movement"} & {other, f"{other}.movement"})


def _readings(
    paths: Sequence[Path], marks: str | Path | None, track: str | Path | None, *, tracking: bool
) -> list[Marks | None]:
    if track is not None and len(paths) != 1:
        raise InputError(f"track = {track} with {len(paths)} videos; allowed: one video")
    if marks is None:
        if not tracking:
            raise InputError("--no-tracking without --marks; allowed: a table of readings by hand with it")
        return [None] * len(paths)
    found = read_marks(marks)
    if set(found) == {""}:
        if len(paths) > 1:
            raise InputError(f"{marks} has no column 'video'; allowed: one that names the video, as there are several")
        return [found[""]]
    known = {key: number for number, path in enumerate(paths) for key in (path.name, path.stem, str(path))}
    for name in found:
        if name not in known:
            raise InputError(f"{marks}, column video: '{name[:60]}'; allowed: {', '.join(path.name for path in paths)}")
    return [next((item for name, item in found.items() if known[name] == number), None) for number in range(len(paths))]


def _in_pixels(marks: Marks | None) -> bool:
    """Whether a reading is in pixels and needs a scale."""
    return marks is not None and bool(np.isfinite(marks.pixels[:, 0]).any())
