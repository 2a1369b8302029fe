"""A calibration fitted and written: `spirillum.calibrate`."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import numpy as np

from spirillum.calibration.calibrated import Calibrated
from spirillum.calibration.fit import RobotSource, fit_model
from spirillum.calibration.posterior import Sampling
from spirillum.calibration.posterior_tree import posterior_tree
from spirillum.calibration.problem import Progress
from spirillum.files import MARK, check_replaceable, output_folder, protected, results_folder, whole_files
from spirillum.fitted.posterior_file import write_posterior
from spirillum.results.calibration_file import calibration_text
from spirillum.robot.robot import Robot
from spirillum.swimming.model_choice import AUTO
from spirillum.view.figures.calibration import calibration_figures
from spirillum.view.figures.style import save

__all__ = ["calibrate", "predictions_text", "write_calibration"]

_RESULTS = ("calibration.toml", "predictions.csv", "posterior.nc")
_FIGURES = ("observed-", "residuals", "posterior", "profiles")
_SYNTHETIC = f"# the observations say that they are synthetic: nothing here is measured; {MARK}\n"
_COLUMNS = ("channel_diameter_mm", "wavelength_mm", "amplitude_mm", "rows")
_HEADER = ",".join(_COLUMNS)
"""What `predictions.csv` begins with, which other programs read and has no comments."""


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
        InputError: if it holds a file of the same name that this program has not written.
    """
    for path in earlier_results(folder):
        check_replaceable(path, begins=_begins(path))


def _begins(path: Path) -> bytes:
    return _HEADER.encode() if path.name == "predictions.csv" else b""


def calibrate(
    observations: str | Path,
    robots: RobotSource | Sequence[RobotSource],
    output: str | Path | None = None,
    *,
    model: str = AUTO,
    free: str | Sequence[str] | None = None,
    method: str = "posterior",
    friction: str = "rotor",
    assume_uncertainty: Mapping[str, str | float] | None = None,
    sampling: Sampling | None = None,
    prepare: bool = False,
    figures: bool = True,
    progress: Progress | None = None,
) -> Calibrated:
    """Fit parameters of a model to observed speeds and rates.

    Args:
        observations: observations file, see `docs/commands`.
        robots: a robot for each channel (preset, file, mapping or robot); the tails are those of the rows.
        output: folder for `calibration.toml`, `predictions.csv`, figures and, for a posterior, `posterior.nc`; None:
            nothing is written.
        model: hydrodynamic model; or `auto`: `tube` where every robot has the table of its tube, or `prepare` makes it,
            and what is free is of that model; else `sbt`.
        free: names of the free parameters, see `spirillum.calibration.parameters`; None: what the paper fitted, or
            with `tube` the gap.
        method: `paper` (its inversion of (15) and (18)), `least-squares`, or `posterior`.
        friction: reading under which B_eff follows from (18): `rotor` or `paper`.
        assume_uncertainty: field of the robot, `fluid.viscosity`, `motor.torque_constant` or
            `motor.back_emf_constant`, to half of its relative 95 % interval, such as ``"5%"``; what is not stated is
            taken as exact.
        sampling: how the posterior is sampled.
        prepare: for `tube`, make the robots' tables that are not there, which takes minutes (see `prepare`).
        figures: draw figures too, which takes some seconds.
        progress: told what is being done.

    Raises:
        InputError: for wrong input, or observations that cannot tell what is asked, or a folder that cannot be
            written to or holds files of the same names that no calibration has written.
    """
    listed = [robots] if isinstance(robots, (str, Path, Mapping, Robot)) else list(robots)
    inputs = (observations, *(robot for robot in listed if isinstance(robot, (str, Path))))
    with ExitStack() as stack:
        folder = None
        if output is not None:
            folder = stack.enter_context(results_folder(output))
            stack.enter_context(protected(*inputs))
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
            prepare=prepare,
            progress=progress,
        )
        return found if folder is None else write_calibration(found, folder, figures=figures, progress=progress)


def write_calibration(
    found: Calibrated, folder: Path, *, figures: bool = True, progress: Progress | None = None
) -> Calibrated:
    """Write all files of a calibration, the figures last; each is whole or not there.

    The numbers are all made before the first takes the place of an earlier calibration's, and what that one had more
    goes afterwards: half of an older calibration beside a new one would be believed.

    Returns:
        The calibration with the names of its files, and a warning where files of an earlier one are gone.

    Raises:
        InputError: if the folder cannot be written to, or holds files of the same names that no calibration has
            written.
    """
    check_folder(folder)
    output_folder(folder)
    earlier = earlier_results(folder)
    names = _RESULTS if found.posterior is not None else _RESULTS[:2]
    written = [folder / name for name in names]
    with whole_files({path: _begins(path) for path in written}) as parts:
        parts[written[0]].write_text(calibration_text(found), encoding="utf-8")
        parts[written[1]].write_text(predictions_text(found), encoding="utf-8")
        if found.posterior is not None:
            write_posterior(posterior_tree(found), parts[written[2]])
    for path in earlier:
        if path not in written:
            path.unlink(missing_ok=True)
    if figures:
        written += _drawn(found, folder, progress)
    files = sorted(str(path.relative_to(folder)) for path in written)
    gone = _gone([path.relative_to(folder) for path in earlier if path not in written])
    said = [f"{folder} held an earlier calibration: its {gone} are gone"] if gone else []
    return replace(found, folder=folder, files=tuple(files), warnings=(*found.warnings, *said))


def _gone(paths: Sequence[Path]) -> str:
    """Files of an earlier calibration that the new one does not have, in words."""
    pictures = sum(1 for path in paths if len(path.parts) > 1)
    names = [str(path) for path in paths if len(path.parts) == 1]
    names += [f"{pictures} figure{'s' if pictures > 1 else ''}"] if pictures else []
    return " and ".join(names)


def _drawn(found: Calibrated, folder: Path, progress: Progress | None) -> list[Path]:
    tell = progress or (lambda _what, _done, _total: None)
    tell("figures", 0, 1)
    inside = output_folder(folder / "figures", folder)
    written: list[Path] = []
    for name, figure in calibration_figures(found).items():
        written += save(figure, inside / name)
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
