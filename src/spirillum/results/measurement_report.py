"""The report of a measurement: one page that stands alone, and its figures."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from spirillum.files import write_text
from spirillum.measurement.flags import BY_HAND
from spirillum.measurement.shown import shown
from spirillum.measurement.trials import MEASURED, Measured
from spirillum.results.page import EmbeddedPicture, data_uri, draw_pictures, page
from spirillum.shown import percent
from spirillum.version import versions
from spirillum.view.figures.measurement import measurement_figures
from spirillum.vision.setup import stripes_of
from spirillum.vision.track.colours import pattern_period

if TYPE_CHECKING:
    from spirillum.measurement.measure import Measurement
    from spirillum.measurement.trials import Trial

__all__ = ["write_measurement_report"]


def write_measurement_report(
    measurement: Measurement, folder: Path, thumbnails: Mapping[str, bytes], tell: Callable[[str, int, int], None]
) -> list[str]:
    """Write `figures/` (PNG and SVG) and `report.html`, each whole or not at all.

    Args:
        measurement: what was measured.
        folder: existing folder.
        thumbnails: JPEG of an annotated frame by the trial's name.
        tell: called with what is being done, steps done and steps in all.

    Returns:
        Names of the files, as seen from the folder.

    Raises:
        InputError: if the folder cannot be written to.
    """
    pictures = measurement_figures(measurement)
    steps = len(pictures) + 1
    embedded = draw_pictures(pictures, folder, lambda _name, done: tell("figures and report", done, steps))
    write_text(folder / "report.html", _page(measurement, embedded, thumbnails))
    tell("figures and report", steps, steps)
    return [*(name for picture in embedded for name in picture.files), "report.html"]


def _page(measurement: Measurement, pictures: list[EmbeddedPicture], thumbnails: Mapping[str, bytes]) -> str:
    scale = max((trial.track.scale for trial in measurement.trials), key=lambda scale: scale.relative_uncertainty)
    sources = sorted(scale.sources.items(), key=lambda item: -item[1])
    return page(
        "measurement.html.jinja",
        title=f"{measurement.robot.name}: measured from video",
        setup=Path(measurement.setup).name,
        trials=[_trial(trial, pictures, thumbnails) for trial in measurement.trials],
        summary=_rows(measurement.summary.quantities, measurement.summary.counts),
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


def _trial(trial: Trial, pictures: list[EmbeddedPicture], thumbnails: Mapping[str, bytes]) -> dict[str, Any]:
    data = thumbnails.get(trial.name)
    track = trial.track
    span = float(track.time[-1] - track.time[0]) if track.time.size else 0.0
    return {
        "name": trial.name,
        "video": trial.video,
        "size": f"{track.time.size} frames, {span:.4g} s",
        "rows": _rows(trial.quantities),
        "flags": trial.flags,
        "thumbnail": data_uri(data, "jpeg") if data else "",
        "pictures": [picture for picture in pictures if picture.name == f"series-{trial.name}"],
    }


def _aliasing(measurement: Measurement) -> str:
    """What no camera can tell of a rate, with the numbers of these films where all have the same."""
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


def _rows(quantities: Mapping[str, Measured], counts: Mapping[str, int] | None = None) -> list[dict[str, str]]:
    """Rows of a table: name, value, low, high, unit, number of trials, and why value or interval is missing."""
    return [
        {
            "name": name.replace("_", " "),
            **shown(item.value, item.low, item.high, item.unit)._asdict(),
            "trials": str(counts[name]) if counts else "",
            "reason": item.reason,
        }
        for name, item in ((name, quantities[name]) for name in MEASURED)
    ]
