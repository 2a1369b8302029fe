"""A calibration fitted and written: `spirillum.calibrate`."""

from __future__ import annotations

import csv
import hashlib
import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from spirillum.calibration.calibrated import Calibrated
from spirillum.calibration.fit import RobotSource, fit_model
from spirillum.calibration.posterior import Sampling
from spirillum.calibration.posterior_tree import posterior_tree
from spirillum.calibration.problem import Progress
from spirillum.errors import InputError
from spirillum.files import output_folder, write_text
from spirillum.fitted.posterior_file import write_posterior
from spirillum.results.calibration_file import calibration_text
from spirillum.view.figures.calibration import calibration_figures
from spirillum.view.figures.style import save

__all__ = ["calibrate", "predictions_text", "write_calibration"]

_RESULTS = ("calibration.toml", "predictions.csv", "posterior.nc")
_FIGURES = ("observed-", "residuals", "posterior", "profiles")
_RECORD = ".written-by-spirillum"
"""Checksums of the figures beside it: one with another checksum is the user's own."""
_SYNTHETIC = "# the observations say that they are synthetic: nothing here is measured\n"
_COLUMNS = ("channel_diameter_mm", "wavelength_mm", "amplitude_mm", "rows")
_MARKS: dict[str, str | tuple[str, ...]] = {
    "calibration.toml": "# Written by `spirillum calibrate`",
    "predictions.csv": (_SYNTHETIC, ",".join(_COLUMNS)),
}
"""What a file of ours begins with."""
_SCHEMA = "spirillum.posterior/"


def earlier_results(folder: Path) -> list[Path]:
    """Files of an earlier calibration in a folder, which a new one takes the place of."""
    named = [folder / name for name in _RESULTS if (folder / name).is_file()]
    return named + [
        path
        for path in sorted((folder / "figures").glob("*"))
        if path.is_file() and path.suffix in (".png", ".svg", ".pdf") and path.stem.startswith(_FIGURES)
    ]


def check_folder(folder: Path) -> None:
    """Refuse a folder for results before any work is done.

    Raises:
        InputError: if it is a file, or holds a file of the same name that no calibration has written.
    """
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder} is a file; allowed: a folder for the results (-o DIR)")
    known = _recorded(folder)
    for path in earlier_results(folder):
        if not _ours(path, known):
            raise InputError(
                f"{folder} holds {path.relative_to(folder)} of unknown origin; allowed: a new folder (-o DIR)"
            )


def _recorded(folder: Path) -> dict[str, str]:
    """Checksums of the figures that the calibration in a folder has drawn, by name."""
    try:
        lines = (folder / "figures" / _RECORD).read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError):
        return {}
    pairs = [line.split("  ", 1) for line in lines if "  " in line]
    return {name: checksum for checksum, name in pairs}


def _ours(path: Path, known: Mapping[str, str]) -> bool:
    """Whether a calibration has written a file, by what it says of itself, or by its checksum."""
    try:
        if path.name == "posterior.nc":
            return _is_posterior(path)
        if path.name in _MARKS:
            return path.read_text(encoding="utf-8").startswith(_MARKS[path.name])
        return known.get(path.name) == _checksum(path)
    except (OSError, UnicodeDecodeError):
        return False


def _is_posterior(path: Path) -> bool:
    import h5netcdf

    try:
        with h5netcdf.File(path, "r") as stored:
            return str(stored.attrs.get("schema", "")).startswith(_SCHEMA)
    except (OSError, ValueError, KeyError, TypeError, RuntimeError):
        return False


def _checksum(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def calibrate(
    observations: str | Path,
    robots: RobotSource | Sequence[RobotSource],
    output: str | Path | None = None,
    *,
    model: str = "sbt",
    free: str | Sequence[str] | None = None,
    method: str = "posterior",
    friction: str = "rotor",
    assume_uncertainty: Mapping[str, str | float] | None = None,
    sampling: Sampling | None = None,
    figures: bool = True,
    progress: Progress | None = None,
) -> Calibrated:
    """Fit parameters of a model to observed speeds and rates.

    Args:
        observations: observations file, see `docs/commands`.
        robots: a robot for each channel (preset, file, mapping or robot); the tails are those of the rows.
        output: folder for `calibration.toml`, `predictions.csv`, figures and, for a posterior, `posterior.nc`; None:
            nothing is written.
        model: hydrodynamic model.
        free: names of the free parameters, see `spirillum.calibration.parameters`; None: what the paper fitted.
        method: `paper` (its inversion of (15) and (18)), `least-squares`, or `posterior`.
        friction: reading under which B_eff follows from (18): `rotor` or `paper`.
        assume_uncertainty: field of the robot, `fluid.viscosity`, `motor.torque_constant` or
            `motor.back_emf_constant`, to half of its relative 95 % interval, such as ``"5%"``; what is not stated is
            taken as exact.
        sampling: how the posterior is sampled.
        figures: draw figures too, which takes some seconds.
        progress: told what is being done.

    Raises:
        InputError: for wrong input, or observations that cannot tell what is asked, or a folder that cannot be
            written to or holds files of the same names that no calibration has written.
    """
    if output is not None and not str(output).strip():
        raise InputError("output = ''; allowed: a folder for the results (-o DIR)")
    folder = None if output is None else Path(output)
    if folder is not None:
        check_folder(folder)
    found = fit_model(
        observations,
        robots,
        model=model,
        free=free,
        method=method,
        friction=friction,
        assume_uncertainty=assume_uncertainty,
        sampling=sampling,
        progress=progress,
    )
    return found if folder is None else write_calibration(found, folder, figures=figures, progress=progress)


def write_calibration(
    found: Calibrated, folder: Path, *, figures: bool = True, progress: Progress | None = None
) -> Calibrated:
    """Write all files of a calibration, the figures last; each is whole or not there.

    Returns:
        The calibration with the names of its files, and a warning where files of an earlier one are gone.

    Raises:
        InputError: if the folder cannot be written to, or holds files of the same names that no calibration has
            written.
    """
    check_folder(folder)
    output_folder(folder)
    earlier = earlier_results(folder)
    for path in earlier:  # half of an older calibration beside a new one would be believed
        path.unlink(missing_ok=True)
    (folder / "figures" / _RECORD).unlink(missing_ok=True)
    written = [folder / "calibration.toml", folder / "predictions.csv"]
    write_text(written[0], calibration_text(found))
    write_text(written[1], predictions_text(found))
    if found.posterior is not None:
        written.append(folder / "posterior.nc")
        write_posterior(posterior_tree(found), written[-1])
    if figures:
        written += _drawn(found, folder, progress)
    names = sorted(str(path.relative_to(folder)) for path in written)
    gone = _gone([path.relative_to(folder) for path in earlier if path not in written])
    said = [f"{folder} held an earlier calibration: its {gone} are gone"] if gone else []
    return replace(found, folder=folder, files=tuple(names), warnings=(*found.warnings, *said))


def _gone(paths: Sequence[Path]) -> str:
    """Files of an earlier calibration that the new one does not have, in words."""
    pictures = sum(1 for path in paths if len(path.parts) > 1)
    names = [str(path) for path in paths if len(path.parts) == 1]
    names += [f"{pictures} figure{'s' if pictures > 1 else ''}"] if pictures else []
    return " and ".join(names)


def _drawn(found: Calibrated, folder: Path, progress: Progress | None) -> list[Path]:
    tell = progress or (lambda _what, _done, _total: None)
    tell("figures", 0, 1)
    inside = output_folder(folder / "figures")
    written: list[Path] = []
    for name, figure in calibration_figures(found).items():
        try:
            save(figure, inside / name)
        finally:  # what an interrupted run has drawn may be replaced by the next one too
            written += [path for path in (inside / f"{name}.png", inside / f"{name}.svg") if path.is_file()]
            write_text(inside / _RECORD, "".join(f"{_checksum(path)}  {path.name}\n" for path in written))
    tell("figures", 1, 1)
    return written


def predictions_text(found: Calibrated) -> str:
    """Observed against predicted of every tail, as CSV; speeds at the mean observed rate."""
    experiment = found.experiment
    stream = io.StringIO()
    if experiment.synthetic:
        stream.write(_SYNTHETIC)
    names = list(found.predicted)
    table = csv.writer(stream, lineterminator="\n")
    header = list(_COLUMNS)
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
