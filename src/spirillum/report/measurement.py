"""The report of a measurement: one page that stands alone, and its figures."""

from __future__ import annotations

import base64
import math
from collections.abc import Callable, Mapping
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

from spirillum.files import output_folder, write_text
from spirillum.measurement.trials import MEASURED, Measured
from spirillum.report.write import EmbeddedPicture
from spirillum.units import Hz

if TYPE_CHECKING:
    from spirillum.measurement.measure import Measurement
    from spirillum.measurement.trials import Trial

__all__ = ["shown_quantities", "write_measurement_report"]

_UNITS = {"m/s": (1e-3, "mm/s"), "rad/s": (Hz, "Hz"), "m": (1e-3, "mm"), "rad": (math.pi / 180, "deg")}


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
    from spirillum.plots.measurement import measurement_figures
    from spirillum.plots.style import save

    pictures = measurement_figures(measurement)
    figures = output_folder(folder / "figures")
    embedded, written = [], []
    for done, (name, picture) in enumerate(pictures.items()):
        tell("figures and report", done, len(pictures) + 1)
        png, svg = save(picture.figure(), figures / name)
        source = f"data:image/png;base64,{base64.b64encode(png.read_bytes()).decode('ascii')}"
        embedded.append(EmbeddedPicture(name, picture.title, picture.caption, picture.alternative, source))
        written += [f"figures/{png.name}", f"figures/{svg.name}"]
    write_text(folder / "report.html", _page(measurement, embedded, thumbnails))
    tell("figures and report", len(pictures) + 1, len(pictures) + 1)
    return [*written, "report.html"]


def _page(measurement: Measurement, pictures: list[EmbeddedPicture], thumbnails: Mapping[str, bytes]) -> str:
    from jinja2 import Environment, StrictUndefined

    from spirillum.answer import versions

    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    template = (files("spirillum.report") / "measurement.html.jinja").read_text(encoding="utf-8")
    scale = measurement.trials[0].track.scale
    sources = sorted(scale.sources.items(), key=lambda item: -item[1])
    return environment.from_string(template).render(
        title=f"{measurement.robot.name}: measured from video",
        setup=Path(measurement.setup).name,
        trials=[_trial(trial, pictures, thumbnails) for trial in measurement.trials],
        summary=shown_quantities(measurement.summary.quantities, measurement.summary.counts),
        count=len(measurement.trials),
        failures=measurement.failures,
        interrupted=measurement.interrupted,
        synthetic=any(trial.synthetic for trial in measurement.trials),
        overview=[picture for picture in pictures if picture.name == "trials"],
        scale=f"{100 * scale.relative_uncertainty:.2g} %",
        sources=[(name, f"{100 * share:.2g} %") for name, share in sources],
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
        "rows": shown_quantities(trial.quantities),
        "flags": trial.flags,
        "thumbnail": f"data:image/jpeg;base64,{base64.b64encode(data).decode('ascii')}" if data else "",
        "pictures": [picture for picture in pictures if picture.name == f"series-{trial.name}"],
    }


def shown_quantities(
    quantities: Mapping[str, Measured], counts: Mapping[str, int] | None = None
) -> list[dict[str, str]]:
    """Rows of a table for people: name, value, low, high, unit, number of trials, and why a value is missing.

    Args:
        quantities: by the names of `MEASURED`.
        counts: trials that each rests on.
    """
    return [_row(name, quantities[name], counts[name] if counts else None) for name in MEASURED]


def _row(name: str, item: Measured, count: int | None) -> dict[str, str]:
    factor, unit = _UNITS[item.unit]
    decimals = _decimals(item, factor) if math.isfinite(item.value) else 0
    texts = [
        f"{value / factor:.{decimals}f}" if math.isfinite(value) else "-" for value in (item.value, item.low, item.high)
    ]
    return {
        "name": name.replace("_", " "),
        "value": texts[0],
        "low": texts[1],
        "high": texts[2],
        "unit": unit,
        "n": "" if count is None else str(count),
        "reason": item.reason if not math.isfinite(item.value) else "",
    }


def _decimals(item: Measured, factor: float) -> int:
    """Decimals down to a tenth of the interval's half width."""
    reach = 0.5 * (item.high - item.low) / factor
    if not math.isfinite(reach) or reach <= 0:
        reach = 1e-3 * abs(item.value) / factor or 1.0
    return min(max(1 - math.floor(math.log10(reach)), 0), 9)
