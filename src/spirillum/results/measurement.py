"""Videos measured and written: `spirillum.measure`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

from spirillum.errors import InputError
from spirillum.files import check_replaceable, protected, results_folder, whole_file, write_text
from spirillum.measurement.flags import says_synthetic
from spirillum.measurement.measure import (
    TABLE,
    Asked,
    Measurement,
    Progress,
    asked_of,
    measured_trial,
    measurement_of,
)
from spirillum.measurement.rows import observation_rows
from spirillum.measurement.series import movement_of, series_of
from spirillum.measurement.trials import Trial
from spirillum.results.measurement_report import write_measurement_report
from spirillum.view.annotate import annotated_film
from spirillum.vision.camera.camera import opened
from spirillum.vision.setup import stripes_of
from spirillum.vision.track.colours import pattern_period

__all__ = ["measure"]


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
        track: table of trackpy, DeepLabCut or Tracker with the positions of one video in pixels, instead of our own
            tracking.
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
        OSError: if a file could not be written, for want of space, say; the trials that were finished are written.
    """
    asked = asked_of(
        videos, setup, marks=marks, track=track, tracking=tracking, start=start, end=end, overrides=overrides
    )
    tell: Progress = progress or (lambda _what, _done, _total: None)
    if output is None:
        return _measured(asked, None, tell)
    inputs = (*asked.videos, setup, marks, track, asked.folder / asked.setup.robot.file)
    with results_folder(output) as path, protected(*inputs):
        folder = _Folder(path, annotated=annotated, figures=figures)
        folder.check(asked)
        return _measured(asked, folder, tell)


_ENDINGS = ("nc", "movement.nc")
_FILM = "annotated.mp4"


@dataclass
class _Folder:
    """The folder of a measurement while it is being written."""

    path: Path
    annotated: bool
    figures: bool
    files: list[str] = field(default_factory=list)
    """Names of the files that were written."""
    thumbnails: dict[str, bytes] = field(default_factory=dict)
    """JPEG of an annotated frame by the trial's name."""

    def check(self, asked: Asked) -> None:
        """Look at all that will be written, before any video is measured.

        Raises:
            InputError: if a file is there that no measurement has written, or is one of the videos.
        """
        names = [TABLE, *(["report.html"] if self.figures else [])]
        for name in asked.names:
            names += [f"{name}.{ending}" for ending in (*_ENDINGS, *([_FILM] if self.annotated else []))]
            names += [f"figures/series-{name}.{end}" for end in ("png", "svg") if self.figures]
        for name in names:
            check_replaceable(self.path / name)


def _measured(asked: Asked, folder: _Folder | None, tell: Progress) -> Measurement:
    """Measure one video after the other; what is finished is written even if the next ones cannot be."""
    trials: list[Trial] = []
    failures: list[tuple[str, str]] = []
    count = len(asked.videos)
    for number, path in enumerate(asked.videos):
        words = path.name if count == 1 else f"{path.name} ({number + 1} of {count})"
        try:
            trials.append(_trial(asked, number, folder, _frames_told(tell, words)))
        except (KeyboardInterrupt, OSError):
            with suppress(OSError):  # as far as there is room for it
                if trials:
                    _finished(asked, trials, failures, folder, tell, interrupted=True)
            raise
        except InputError as error:
            failures.append((str(path), str(error)))
    if not trials:
        sentences = [sentence for _, sentence in failures]
        more = "" if count == 1 else f" (and {count - 1} more)"
        raise InputError(f"{sentences[0]}{more}", sentences)
    return _finished(asked, trials, failures, folder, tell, interrupted=False)


def _frames_told(tell: Progress, words: str) -> Callable[[int, int | None], None]:
    return lambda done, frames: tell(words, done, max(done, frames or 0))


def _trial(asked: Asked, number: int, folder: _Folder | None, tell: Callable[[int, int | None], None]) -> Trial:
    """Measure one video and write what belongs to it alone."""
    path, name = asked.videos[number], asked.names[number]
    if folder is None:
        return measured_trial(asked, number, path, progress=tell)
    if folder.annotated and asked.tracking and asked.track is None:
        trial = _annotated_trial(asked, number, folder, tell)
    else:
        trial = measured_trial(asked, number, path, progress=tell)
    for ending, arrays in zip(_ENDINGS, (series_of(trial, asked.robot), movement_of(trial, asked.robot)), strict=True):
        arrays.write(folder.path / f"{name}.{ending}")
        folder.files.append(f"{name}.{ending}")
    return trial


def _annotated_trial(asked: Asked, number: int, folder: _Folder, tell: Callable[[int, int | None], None]) -> Trial:
    path, name = asked.videos[number], asked.names[number]

    def thumbnail(picture: bytes) -> None:
        folder.thumbnails[name] = picture

    target = folder.path / f"{name}.{_FILM}"
    video = opened(path, asked.setup)
    words = {"title": f"{path.name}, annotated"}
    if says_synthetic(video.words):
        words = {"title": f"{words['title']}, synthetic", "comment": "synthetic: made from a computed film"}
    period = pattern_period(stripes_of(asked.setup, asked.robot))
    film = partial(annotated_film, robot=asked.robot, words=words, period=period, waiting=video.waiting)
    with whole_file(target) as temporary, film(temporary, thumbnail=thumbnail) as on_frame:
        trial = measured_trial(asked, number, video, progress=tell, on_frame=on_frame)
    folder.files.append(target.name)
    return trial


def _finished(
    asked: Asked,
    trials: Sequence[Trial],
    failures: Sequence[tuple[str, str]],
    folder: _Folder | None,
    tell: Progress,
    *,
    interrupted: bool,
) -> Measurement:
    """Compare the trials and write what belongs to all of them."""
    found = measurement_of(asked, trials, failures, interrupted=interrupted)
    if folder is None:
        return found
    rows = observation_rows(found.trials, asked.robot, Path(asked.setup_file).name)
    if rows is not None:
        write_text(folder.path / TABLE, rows)
        folder.files.append(TABLE)
    left = sorted(path.name for path in folder.path.glob("*.nc") if path.name not in folder.files)
    found = replace(found, files=tuple(folder.files), left=tuple(left))
    if not folder.figures:
        return found
    more = write_measurement_report(found, folder.path, folder.thumbnails, tell)
    return replace(found, files=(*found.files, *more))
