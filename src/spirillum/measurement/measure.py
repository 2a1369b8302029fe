"""From videos to speeds and rates: `spirillum.measure`."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from spirillum.answer import envelope
from spirillum.errors import InputError
from spirillum.files import output_folder, whole_file, write_text
from spirillum.formats.labelled import Labelled
from spirillum.measurement.flags import says_synthetic
from spirillum.measurement.imported import read_track
from spirillum.measurement.marks import (
    Marks,
    check_pixels,
    check_times,
    corrected,
    frames_read,
    read_marks,
    track_of_marks,
)
from spirillum.measurement.rows import observation_rows
from spirillum.measurement.series import movement_of, series_of
from spirillum.measurement.sight import Sighted, sighted
from spirillum.measurement.summary import Summary, compared, summary_of
from spirillum.measurement.trials import RATE_NAMES, Trial, trial_of
from spirillum.robot.load import load
from spirillum.robot.robot import Robot
from spirillum.view.annotate import annotated_film
from spirillum.vision.setup import Setup, load_setup
from spirillum.vision.track.track import Flag, Track

__all__ = ["Measurement", "measure"]

Progress = Callable[[str, int, int], None]
_TABLE = "observations.csv"


@dataclass(frozen=True)
class Measurement:
    """What was measured of a robot in one or several trials."""

    trials: tuple[Trial, ...]
    """The trials, in the order of the videos."""
    summary: Summary
    """Means over trials."""
    robot: Robot = field(repr=False)
    """The robot."""
    setup: str
    """The setup file."""
    failures: tuple[tuple[str, str], ...] = ()
    """Videos that could not be measured, each with a sentence."""
    files: tuple[str, ...] = ()
    """Files that were written."""
    interrupted: bool = False
    """Whether it was interrupted before the last video."""
    left: tuple[str, ...] = ()
    """Datasets of other measurements that lie in the same folder."""

    @property
    def warnings(self) -> tuple[str, ...]:
        """What to be careful about, a sentence each."""
        found = [sentence for trial in self.trials for sentence in _sentences(trial)]
        found += [f"{video}: not measured: {sentence}" for video, sentence in self.failures]
        total = self.summary.trials
        few = {name: count for name, count in self.summary.counts.items() if name in RATE_NAMES and 0 < count < total}
        found += [
            f"the mean {name.replace('_', ' ')} rests on {count} of {total} trials" for name, count in few.items()
        ]
        if len(self.trials) == 1:
            found.append("one trial: the intervals are its own, and say nothing of how trials differ")
        if self.files and _TABLE not in self.files:
            found.append(f"no trial gives a speed or a rate of a robot in a channel: {_TABLE} is not written")
        if self.left:
            found.append(f"not of this measurement, and left in the folder from before: {', '.join(self.left)}")
        return tuple(found)

    def to_dict(self) -> dict[str, Any]:
        """As JSON, SI with rates in rad/s."""
        content = {
            "robot": self.robot.name,
            "setup": self.setup,
            "trials": [{"name": trial.name, **trial.to_dict()} for trial in self.trials],
            "summary": self.summary.to_dict(),
            "failures": [{"video": video, "sentence": sentence} for video, sentence in self.failures],
            "files": list(self.files),
        }
        return envelope("measurement", content, self.warnings)


def _sentences(trial: Trial) -> list[str]:
    """Flags of a trial, and why a rate is missing where no flag says it."""
    flags = [flag.sentence for flag in trial.flags]
    reasons: dict[str, list[str]] = {}
    for name in RATE_NAMES:
        item = trial.quantities[name]
        if not math.isfinite(item.value) and item.reason not in flags:
            reasons.setdefault(item.reason, []).append(name.replace("_", " "))
    missing = [f"{', '.join(names)} not given: {reason}" for reason, names in reasons.items()]
    return [f"{trial.name}: {sentence}" for sentence in (*flags, *missing)]


def measure(
    videos: str | Path | Sequence[str | Path],
    setup: str | Path,
    output: str | Path | None = None,
    *,
    marks: str | Path | None = None,
    track: str | Path | None = None,
    tracking: bool = True,
    annotated: bool = True,
    figures: bool = True,
    start: float | None = None,
    end: float | None = None,
    overrides: Mapping[str, Any] | None = None,
    progress: Progress | None = None,
) -> Measurement:
    """Measure forward velocity and rotation rates of a robot in videos, one video a trial.

    A video that cannot be measured does not stop the others.

    Args:
        videos: films or folders of images, each once; all of them with the same setup and robot.
        setup: the setup file.
        output: folder for the results; None writes nothing.
        marks: table of readings by hand, which replace what is seen on their frames.
        track: table of trackpy or DeepLabCut with the positions of one video, instead of our own tracking.
        tracking: look for the robot in the videos; if not, the readings by hand are all there is.
        annotated: write an annotated video of each trial.
        figures: draw figures and write the report.
        start: time in the video from which on to measure, s, instead of the setup's.
        end: time until which to measure, s.
        overrides: dotted fields of the robot, as for `spirillum.load`.
        progress: called with what is being done, steps done and steps in all.

    Raises:
        InputError: if setup, robot or a table is wrong, or no video could be measured.
        KeyboardInterrupt: if it was interrupted; the trials that were finished are written.
        OSError: if a file could not be written, for want of space, say; the same.
    """
    given = [videos] if isinstance(videos, (str, Path)) else list(videos)
    words = [*(("video", video) for video in given), ("output", output), ("marks", marks), ("track", track)]
    for what, word in words:
        if word == "":  # else it would be the folder one works in
            raise InputError(f'{what} = ""; allowed: a name')
    paths = [Path(video) for video in given]
    chosen, robot = _loaded(setup, overrides, start, end)
    readings = _readings(paths, marks, track, tracking=tracking)
    names = _names(paths)
    folder = None if output is None else Path(output)
    fresh = folder is not None and not folder.exists()
    if folder is not None:
        _check_folder(output_folder(folder))
    work = _Work(chosen, robot, str(setup), folder, annotated=annotated, figures=figures, progress=progress)
    for number, (path, name) in enumerate(zip(paths, names, strict=True)):
        try:
            work.add(path, name, number, len(paths), readings[number], track, tracking=tracking)
        except (KeyboardInterrupt, OSError):
            work.keep()
            raise
        except InputError as error:
            work.failures.append((str(path), str(error)))
    if not work.trials:
        if folder is not None and fresh and not any(folder.iterdir()):
            folder.rmdir()
        more = "" if len(paths) == 1 else f" (and {len(paths) - 1} more)"
        sentences = [sentence for _, sentence in work.failures]
        raise InputError(f"{sentences[0]}{more}", sentences)
    return work.finish(interrupted=False)


def _check_folder(folder: Path) -> None:
    """Refuse to replace a table of observations that no measurement has written."""
    table = folder / _TABLE
    if table.exists() and not any(folder.glob("*.nc")):
        raise InputError(f"{table} is there and not from a measurement; allowed: another folder for the results")


def _loaded(
    setup: str | Path, overrides: Mapping[str, Any] | None, start: float | None, end: float | None
) -> tuple[Setup, Robot]:
    chosen, robot = load_setup(setup)
    if overrides:
        beside = Path(setup).parent / chosen.robot.file
        robot = load(beside if beside.is_file() else chosen.robot.file, **overrides)
    first, last = chosen.start if start is None else start, chosen.end if end is None else end
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
    real = [path.resolve() for path in paths]
    for place, path in enumerate(paths):
        if not _is_text(str(path)):
            raise InputError(f"video = {str(path)!a}; allowed: a name that is text in UTF-8, as results carry it")
        if real[place] in real[:place]:
            raise InputError(f"{path} is given twice; allowed: each video once, as trials are independent")
        stem = path.resolve().name if path.is_dir() else path.stem
        name, number = stem or "trial", 2
        while any(_clash(name, other) for other in found):
            name, number = f"{stem}-{number}", number + 1
        found.append(name)
    return found


def _is_text(name: str) -> bool:
    try:
        name.encode()
    except UnicodeEncodeError:
        return False
    return True


def _clash(one: str, other: str) -> bool:
    """Whether two trials would write files of the same name, also where capitals do not count."""
    one, other = one.casefold(), other.casefold()
    return bool({one, f"{one}.movement"} & {other, f"{other}.movement"})


def _readings(
    paths: Sequence[Path], marks: str | Path | None, track: str | Path | None, *, tracking: bool
) -> list[Marks | None]:
    """The readings by hand of each video.

    Raises:
        InputError: if the table is wrong, or names no video or another one.
    """
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


class _Work:
    """Trials as they are measured and written, one after the other."""

    def __init__(
        self,
        setup: Setup,
        robot: Robot,
        setup_file: str,
        folder: Path | None,
        *,
        annotated: bool,
        figures: bool,
        progress: Progress | None,
    ) -> None:
        self.setup, self.robot, self.setup_file, self.folder = setup, robot, setup_file, folder
        self.beside = Path(setup_file).parent
        self.annotated, self.figures = annotated and folder is not None, figures
        self.progress: Progress = progress or (lambda _what, _done, _total: None)
        self.trials: list[Trial] = []
        self.failures: list[tuple[str, str]] = []
        self.files: list[str] = []
        self.thumbnails: dict[str, bytes] = {}

    def add(
        self,
        path: Path,
        name: str,
        number: int,
        total: int,
        marks: Marks | None,
        table: str | Path | None,
        *,
        tracking: bool,
    ) -> None:
        """Measure one video and write what belongs to it alone."""
        words = path.name if total == 1 else f"{path.name} ({number + 1} of {total})"

        def tell(done: int, frames: int | None) -> None:
            self.progress(words, done, max(done, frames or 0))

        if tracking and table is None:
            track = self._followed(path, name, tell)
            ruled = sighted(path, self.setup, self.beside).ruled if _in_pixels(marks) else None
        else:
            sight = sighted(path, self.setup, self.beside, needed=table is not None or _in_pixels(marks))
            ruled = sight.ruled
            if marks is not None and ruled is not None:
                check_pixels(marks, ruled.size)
            track = replace(self._of_tables(path, sight, marks, table), words=sight.words)
            marks = marks if table is not None else None
        read = None  # no frame was corrected
        if marks is not None:
            check_pixels(marks, track.size)
            read = frames_read(track, marks)
            track = corrected(track, marks, ruled)
        trial = trial_of(track, self.robot, name, read)
        if self.folder is not None:
            self._write(self.folder / f"{name}.nc", series_of(trial, self.robot))
            self._write(self.folder / f"{name}.movement.nc", movement_of(trial, self.robot))
        self.trials.append(trial)

    def _followed(self, path: Path, name: str, tell: Callable[[int, int | None], None]) -> Track:
        from spirillum.vision.track.follow import follow
        from spirillum.vision.video.frames import open_video

        if not self.annotated or self.folder is None:
            return follow(path, self.setup, self.robot, folder=self.beside, progress=tell)
        target = self.folder / f"{name}.annotated.mp4"

        def thumbnail(picture: bytes) -> None:
            self.thumbnails[name] = picture

        video = open_video(path, self.setup.camera.frames_per_second)
        words = {"title": f"{path.name}, annotated"}
        if says_synthetic(video.words):
            words = {"title": f"{words['title']}, synthetic", "comment": "synthetic: made from a computed film"}
        with whole_file(target) as temporary, annotated_film(temporary, self.robot, words, thumbnail) as on_frame:
            track = follow(video, self.setup, self.robot, folder=self.beside, progress=tell, on_frame=on_frame)
        self.files.append(target.name)
        return track

    def _of_tables(self, path: Path, sight: Sighted, marks: Marks | None, table: str | Path | None) -> Track:
        if table is not None:
            assert sight.ruled is not None  # noqa: S101 - asked for
            assert sight.time_of is not None  # noqa: S101
            return read_track(table, self.setup, path.name, sight.ruled, sight.time_of)
        if marks is None:
            raise InputError(f"{path} has no readings by hand; allowed: some, or tracking")
        check_times(marks, sight.duration)
        track = track_of_marks(marks, self.setup, path.name, sight.ruled, sight.time_of)
        if sight.seen:
            return track
        unseen = Flag("no-video", f"{path.name} cannot be opened: the readings are taken as they are")
        return replace(track, flags=(*track.flags, unseen))

    def _write(self, path: Path, arrays: Labelled) -> None:
        arrays.write(path)
        self.files.append(path.name)

    def keep(self) -> None:
        """Write what belongs to the trials that are finished, as far as there is room for it."""
        with suppress(OSError):
            if self.trials:
                self.finish(interrupted=True)

    def finish(self, *, interrupted: bool) -> Measurement:
        """Compare the trials and write what belongs to all of them."""
        trials = compared(self.trials)
        rows = observation_rows(trials, self.robot, Path(self.setup_file).name)
        if self.folder is not None and rows is not None:
            write_text(self.folder / _TABLE, rows)
            self.files.append(_TABLE)
        found = Measurement(
            tuple(trials),
            summary_of(trials),
            self.robot,
            self.setup_file,
            tuple(self.failures),
            tuple(self.files),
            interrupted,
            self._left(),
        )
        if self.folder is None or not self.figures:
            return found
        from spirillum.results.measurement_report import write_measurement_report

        more = write_measurement_report(found, self.folder, self.thumbnails, self.progress)
        return replace(found, files=(*found.files, *more))

    def _left(self) -> tuple[str, ...]:
        if self.folder is None:
            return ()
        return tuple(sorted(path.name for path in self.folder.glob("*.nc") if path.name not in self.files))


def _in_pixels(marks: Marks | None) -> bool:
    """Whether a reading is in pixels and needs a scale."""
    import numpy as np

    return marks is not None and bool(np.isfinite(marks.pixels[:, 0]).any())
