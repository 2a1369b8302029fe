"""What a calibration leaves on disk."""

from __future__ import annotations

import csv
import io
import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from spirillum.calibration.answers import calibration_text
from spirillum.errors import InputError
from spirillum.files import output_folder, write_text

if TYPE_CHECKING:
    from spirillum.calibration.fit import Calibrated
    from spirillum.calibration.problem import Progress

__all__ = ["check_folder", "predictions_text", "write_calibration"]

_RESULTS = ("calibration.toml", "predictions.csv", "posterior.nc")
_FIGURES = ("observed-", "residuals", "posterior", "profiles")
_MARK = "# Written by `spirillum calibrate`"


def check_folder(folder: Path) -> None:
    """Refuse a folder for results before any work is done.

    Raises:
        InputError: if it is a file, or holds a calibration of unknown origin.
    """
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder} is a file; allowed: a folder for the results (-o DIR)")
    target = folder / "calibration.toml"
    if target.is_file():
        try:
            ours = target.read_text(encoding="utf-8").startswith(_MARK)
        except (OSError, UnicodeDecodeError):
            ours = False
        if not ours:
            raise InputError(f"{folder} holds calibration.toml of unknown origin; allowed: a new folder (-o DIR)")


def write_calibration(
    found: Calibrated, folder: Path, *, figures: bool = True, progress: Progress | None = None
) -> list[Path]:
    """Write all files of a calibration; each is whole or not there.

    Raises:
        InputError: if the folder cannot be written to.
    """
    check_folder(folder)
    output_folder(folder)
    _clear(folder)
    written = [folder / "predictions.csv"]
    write_text(written[0], predictions_text(found))
    if found.posterior is not None:
        from spirillum.calibration.netcdf import write_posterior

        written.append(write_posterior(found, folder / "posterior.nc"))
    if figures:
        written += _drawn(found, folder, progress)
    written.append(folder / "calibration.toml")
    write_text(written[-1], calibration_text(found))
    return written


def _clear(folder: Path) -> None:
    """Take away what an older calibration left: half of it beside a new one would be believed."""
    for name in _RESULTS:
        (folder / name).unlink(missing_ok=True)
    for path in (folder / "figures").glob("*"):
        if path.is_file() and path.suffix in (".png", ".svg", ".pdf") and path.stem.startswith(_FIGURES):
            path.unlink()


def _drawn(found: Calibrated, folder: Path, progress: Progress | None) -> list[Path]:
    from spirillum.plots.calibration import calibration_figures
    from spirillum.plots.style import save

    tell = progress or (lambda _what, _done, _total: None)
    tell("figures", 0, 1)
    inside = output_folder(folder / "figures")
    written = [path for name, figure in calibration_figures(found).items() for path in save(figure, inside / name)]
    tell("figures", 1, 1)
    return written


def predictions_text(found: Calibrated) -> str:
    """Observed against predicted of every tail, as CSV; speeds at the mean observed rate."""
    experiment = found.experiment
    stream = io.StringIO()
    if experiment.synthetic:
        stream.write("# the observations say that they are synthetic: nothing here is measured\n")
    names = list(found.predicted)
    table = csv.writer(stream, lineterminator="\n")
    header = ["channel_diameter_mm", "wavelength_mm", "amplitude_mm", "rows"]
    for name in names:
        header += [f"{name}_observed", f"{name}_predicted", f"{name}_low", f"{name}_high", f"{name}_residual"]
    table.writerow([*header, "effective_friction", "effective_friction_low", "effective_friction_high"])
    for place, robot in enumerate(experiment.robots):
        diameter = robot.channel.diameter if robot.channel else math.nan
        row = [_short(diameter * 1e3), _short(robot.tail.wavelength * 1e3), _short(robot.tail.amplitude * 1e3)]
        row.append(" ".join(str(number) for number in experiment.rows[place]))
        for name in names:
            seen = float(found.problem.ratio(name).mean[place])
            value, low, high = (float(column[place]) for column in found.predicted[name])
            row += [_short(number) for number in (seen, value, low, high, seen / value - 1.0)]
        friction = found.friction[place] if found.friction else None
        row += [
            _short(number) for number in ((friction.value, friction.low, friction.high) if friction else (np.nan,) * 3)
        ]
        table.writerow(row)
    return stream.getvalue()


def _short(value: float) -> str:
    return f"{value:.8g}" if math.isfinite(value) else ""
