"""Videos measured and written: `spirillum.measure`."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from threading import Thread
from typing import Any

import numpy as np

from spirillum.display import percent
from spirillum.errors import InputError
from spirillum.files import atomic_write, check_replaceable, guard_inputs, results_folder, write_text
from spirillum.formats.templates import rendered
from spirillum.measurement.flags import BY_HAND, says_synthetic
from spirillum.measurement.measure import (
    TABLE,
    Measurement,
    MeasurementRequest,
    Progress,
    check_request,
    measured_trial,
    measurement_of,
)
from spirillum.measurement.series import movement_of, observation_rows, series_of
from spirillum.measurement.statistics import measured_rows
from spirillum.measurement.trials import MEASURED, Trial
from spirillum.results.page import EmbeddedPicture, data_uri, draw_pictures
from spirillum.version import versions
from spirillum.view.annotate import annotated_video, video_frame
from spirillum.vision.camera.camera import opened
from spirillum.vision.flag import Flag
from spirillum.vision.setup import stripes_of
from spirillum.vision.track.colours import pattern_period


def write_measurement_report(
    measurement: Measurement,
    folder: Path,
    thumbnails: Mapping[str, bytes],
    on_progress: Callable[[str, int, int], None],
    *,
    vector: bool = False,
) -> list[str]:
    """Write `figures/` and `report.html`, each whole or not at all; return their names in the folder."""
    from spirillum.view.figures.measurement import measurement_figures

    pictures = measurement_figures(measurement)
    steps = len(pictures) + 1
    embedded = draw_pictures(
        pictures, folder, lambda _name, done: on_progress("figures and report", done, steps), vector=vector
    )
    write_text(folder / "report.html", _page(measurement, embedded, thumbnails))
    on_progress("figures and report", steps, steps)
    return [*(name for picture in embedded for name in picture.files), "report.html"]


def _page(measurement: Measurement, pictures: list[EmbeddedPicture], thumbnails: Mapping[str, bytes]) -> str:
    scale = max((trial.track.scale for trial in measurement.trials), key=lambda scale: scale.relative_uncertainty)
    sources = sorted(scale.sources.items(), key=lambda item: -item[1])
    return rendered(
        "results/measurement.html.jinja",
        escaped=True,
        title=f"{measurement.robot.name}: measured from video",
        setup=Path(measurement.setup).name,
        trials=[_trial_content(trial, pictures, thumbnails) for trial in measurement.trials],
        summary=measured_rows(measurement.summary.to_dict(), MEASURED),
        count=len(measurement.trials),
        failures=measurement.failures,
        interrupted=measurement.interrupted,
        synthetic=any(trial.synthetic for trial in measurement.trials),
        overview=[picture for picture in pictures if picture.name == "trials"],
        scale=percent(scale.relative_uncertainty),
        sources=[(name, percent(share)) for name, share in sources],
        aliasing=_aliasing(measurement),
        intervals=any(math.isfinite(item.low) for trial in measurement.trials for item in trial.quantities.values()),
        files=[name for name in measurement.files if not name.startswith("figures/")],
        versions=versions(),
    )


def _trial_content(trial: Trial, pictures: list[EmbeddedPicture], thumbnails: Mapping[str, bytes]) -> dict[str, Any]:
    data = thumbnails.get(trial.name)
    track = trial.track
    span = float(track.time[-1] - track.time[0]) if track.time.size else 0.0
    return {
        "name": trial.name,
        "video": trial.video,
        "size": f"{track.time.size} frames, {span:.4g} s",
        "rows": measured_rows(trial.to_dict(), MEASURED),
        "flags": trial.flags,
        "thumbnail": data_uri(data, "jpeg") if data else "",
        "shown": "A frame" if (flag := _flag_with_frame(trial)) is None else f"Frame {flag.frame} ({flag.name})",
        "pictures": [picture for picture in pictures if picture.name == f"series-{trial.name}"],
    }


def _flag_with_frame(trial: Trial) -> Flag | None:
    """The first flag that names a frame; the report shows that one."""
    return next((flag for flag in trial.flags if flag.frame is not None), None)


def _aliasing(measurement: Measurement) -> str:
    """Limits of a camera for a rate, with the numbers of these videos where all have the same."""
    angles = ("body_rotation_rate", "tail_rotation_rate")
    seen = [trial for trial in measurement.trials if any(trial.fits[name].frames > 2 for name in angles)]
    seen = [trial for trial in seen if all(flag.name != BY_HAND for flag in trial.flags)]
    if not seen:
        return ""
    pace = {f"{1.0 / np.median(np.diff(trial.track.time)):.4g}" for trial in seen}
    stripes = stripes_of(seen[0].track.setup, measurement.robot)
    tail, body = "the frame rate", "the frame rate times the turns after which the stripes look the same"
    if len(pace) == 1:
        (text,) = pace
        tail, body = f"{text} Hz", f"{float(text) * pattern_period(stripes or ('',)) / (2 * np.pi):.4g} Hz"
    also = f", and so does a body that turns faster or slower by whole multiples of {body}" if stripes else ""
    return (
        f"What no camera can tell: a tail that turns faster or slower by whole multiples of {tail} looks the same from "
        f"frame to frame{also}. Where a rate is given, no sign of that was seen."
    )


def measure(  # noqa: PLR0913 - the options of the command
    videos: str | Path | Sequence[str | Path],
    setup: str | Path,
    output: str | Path | None = None,
    *,
    marks: str | Path | None = None,
    track: str | Path | None = None,
    tracking: bool = True,
    annotated: bool = True,
    figures: bool = True,
    vector: bool = False,
    start: str | float | None = None,
    end: str | float | None = None,
    overrides: Mapping[str, Any] | None = None,
    progress: Progress | None = None,
) -> Measurement:
    """Measure forward velocity and rotation rates of a robot in videos, one video a trial.

    A video that cannot be measured does not stop the others.

    Args:
        videos: films or folders of images, each once; all of them with the same setup and robot.
        setup: the setup file.
        output: folder for the results; None writes nothing.
        marks: readings by hand (CSV), which replace the tracker's on their frames.
        track: positions of one video in pixels from trackpy, DeepLabCut or Tracker (CSV), instead of the tracker's.
        tracking: look for the robot in the videos; if not, the readings by hand are all there is.
        annotated: write an annotated video of each trial.
        figures: draw figures and write the report.
        vector: write figures as SVG beside PNG.
        start: time in the video from which to measure, with its unit or a float in s; None: the setup's.
        end: time until which to measure, with its unit or a float in s; None: the setup's.
        overrides: dotted fields of the robot, as for `spirillum.load`.
        progress: called with what is being done, steps done and steps in all.

    Raises:
        InputError: if setup, robot or a table is wrong, or no video could be measured.
        KeyboardInterrupt: if it was interrupted; the trials that were finished are written.
        OSError: if a file could not be written, for want of space, say; the trials that were finished are written.
    """
    asked = check_request(
        videos, setup, marks=marks, track=track, tracking=tracking, start=start, end=end, overrides=overrides
    )
    on_progress: Progress = progress or (lambda _what, _done, _total: None)
    if output is None:
        return _measured(asked, None, on_progress)
    inputs = (*asked.videos, setup, marks, track, asked.folder / asked.setup.robot.file)
    with results_folder(output) as path, guard_inputs(*inputs):
        folder = _Folder(path, annotated=annotated, figures=figures, vector=vector)
        folder.check(asked)
        Thread(target=_import_ahead, kwargs={"figures": figures}, daemon=True).start()
        return _measured(asked, folder, on_progress)


def _import_ahead(*, figures: bool) -> None:
    """Import what the camera's fit and the figures need, while the video is decoded and compiled loops run."""
    with suppress(ImportError):
        import scipy.optimize  # noqa: F401

        if figures:
            import spirillum.view.figures.measurement  # noqa: F401


_ENDINGS = ("nc", "movement.nc")
_FILM = "annotated.mp4"


@dataclass
class _Folder:
    """The folder of a measurement while it is being written."""

    path: Path
    annotated: bool
    figures: bool
    vector: bool
    files: list[str] = field(default_factory=list)  # names of the files that were written
    thumbnails: dict[str, bytes] = field(default_factory=dict)  # JPEG of an annotated frame by the trial's name

    def check(self, asked: MeasurementRequest) -> None:
        """Look at all that will be written, before any video is measured."""
        names = [TABLE, *(["report.html"] if self.figures else [])]
        for name in asked.names:
            names += [f"{name}.{ending}" for ending in (*_ENDINGS, *([_FILM] if self.annotated else []))]
            names += [f"figures/series-{name}.{end}" for end in ("png", "svg") if self.figures]
        for name in names:
            check_replaceable(self.path / name)


def _measured(asked: MeasurementRequest, folder: _Folder | None, on_progress: Progress) -> Measurement:
    """Measure one video after the other; what is finished is written even if the next ones cannot be."""
    trials: list[Trial] = []
    failures: list[tuple[str, str]] = []
    count = len(asked.videos)
    for number, path in enumerate(asked.videos):
        words = path.name if count == 1 else f"{path.name} ({number + 1} of {count})"
        try:
            trials.append(_trial(asked, number, folder, partial(_tell_frames, on_progress, words)))
        except (KeyboardInterrupt, OSError) as error:
            with suppress(OSError):  # as far as there is room for it
                if trials:
                    _finished(asked, trials, failures, folder, on_progress, interrupted=True)
            if isinstance(error, OSError):
                raise
            kept = f" and kept in {folder.path}" if trials and folder is not None else ""
            raise KeyboardInterrupt(f"{len(trials)} of {count} trials are finished{kept}") from error
        except InputError as error:
            failures.append((str(path), str(error)))
    if not trials:
        sentences = [sentence for _, sentence in failures]
        more = "" if count == 1 else f" (and {count - 1} more)"
        raise InputError(f"{sentences[0]}{more}", sentences)
    return _finished(asked, trials, failures, folder, on_progress, interrupted=False)


def _tell_frames(on_progress: Progress, words: str, done: int, frames: int | None) -> None:
    on_progress(words, done, max(done, frames or 0))


def _trial(
    asked: MeasurementRequest, number: int, folder: _Folder | None, on_progress: Callable[[int, int | None], None]
) -> Trial:
    """Measure one video and write what belongs to it alone."""
    path, name = asked.videos[number], asked.names[number]
    if folder is None:
        return measured_trial(asked, number, path, progress=on_progress)
    if folder.annotated and asked.tracking and asked.track is None:
        trial = _annotated_trial(asked, number, folder, on_progress)
    else:
        trial = measured_trial(asked, number, path, progress=on_progress)
    for ending, arrays in zip(_ENDINGS, (series_of(trial, asked.robot), movement_of(trial, asked.robot)), strict=True):
        arrays.write(folder.path / f"{name}.{ending}")
        folder.files.append(f"{name}.{ending}")
    return trial


def _annotated_trial(
    asked: MeasurementRequest, number: int, folder: _Folder, on_progress: Callable[[int, int | None], None]
) -> Trial:
    path, name = asked.videos[number], asked.names[number]
    thumbnail = partial(folder.thumbnails.__setitem__, name)
    target = folder.path / f"{name}.{_FILM}"
    video = opened(path, asked.setup)
    words = {"title": f"{path.name}, annotated"}
    if says_synthetic(video.words):
        words = {"title": f"{words['title']}, synthetic", "comment": "synthetic: made from a computed film"}
    period = pattern_period(stripes_of(asked.setup, asked.robot))
    film = partial(annotated_video, robot=asked.robot, words=words, period=period, waiting=video.waiting)
    with atomic_write(target) as temporary, film(temporary, thumbnail=thumbnail) as on_frame:
        trial = measured_trial(asked, number, video, progress=on_progress, on_frame=on_frame)
    if (flag := _flag_with_frame(trial)) is not None and flag.frame is not None:
        folder.thumbnails[name] = video_frame(target, flag.frame) or folder.thumbnails.get(name, b"")
    folder.files.append(target.name)
    return trial


def _finished(
    asked: MeasurementRequest,
    trials: Sequence[Trial],
    failures: Sequence[tuple[str, str]],
    folder: _Folder | None,
    on_progress: Progress,
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
    more = write_measurement_report(found, folder.path, folder.thumbnails, on_progress, vector=folder.vector)
    return replace(found, files=(*found.files, *more))
