"""A calibration fitted and written: `spirillum.calibrate`."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from math import isfinite, nan
from pathlib import Path
from typing import TYPE_CHECKING, Any

from spirillum.calibration.calibrated import Calibrated, posterior_tree
from spirillum.calibration.fit import RobotSource, fit_model
from spirillum.calibration.parameters import Estimate
from spirillum.calibration.posterior import Sampling
from spirillum.files import MARK, atomic_write_all, check_replaceable, guard_inputs, output_folder, results_folder
from spirillum.fitted.posterior_file import write_posterior
from spirillum.formats.templates import rendered
from spirillum.notes import Note
from spirillum.progress import Progress, tell
from spirillum.results.page import Drawings, draw_together, load_figures
from spirillum.robot.placement import gap_on_asperities
from spirillum.robot.robot import Robot
from spirillum.swimming.preparation import AUTO
from spirillum.version import versions
from spirillum.worker_pool import process_beside

if TYPE_CHECKING:
    from concurrent.futures import ProcessPoolExecutor


def _number(value: float) -> str:
    """A float in TOML, with all its digits."""
    text = repr(float(value))
    return text if "." in text or "e" in text else f"{text}.0"


def _quoted(text: str) -> str:
    kept = "".join(letter if letter.isprintable() and letter not in '"\\' else "'" for letter in text)
    return f'"{kept[:400]}"'


_FILTERS: dict[str, Callable[..., str]] = {
    "number": _number,
    "quoted": _quoted,
    "length_in_mm": lambda value: f'"{1e3 * value:.15g} mm"',  # without the rounding of the last digit
    "estimate": lambda item: (
        f"{item.value:.5g}" + (f" ({item.low:.5g} to {item.high:.5g})" if isfinite(item.low) else "")
    ),
}
_FITTED = ("wire_diameter", "viscosity", "torque_constant", "back_emf_constant", "normal_factor", "tangential_factor")


def calibration_text(found: Calibrated) -> str:
    """`calibration.toml`: factors for each channel, fitted fields, friction for each tail, and what they rest on."""
    experiment, model = found.experiment, found.problem.model
    fitted = [(item.parameter, item.channel, found.values[item.label].value) for item in found.problem.coordinates]
    everywhere = {parameter.name: value for parameter, _, value in fitted}
    factors: list[tuple[Any, ...]] = []
    placements: list[tuple[Any, ...]] = []
    frictions: list[tuple[Any, ...]] = []
    for place, diameter in enumerate(experiment.channels):
        here = {parameter.name: value for parameter, channel, value in fitted if channel in (None, place)}
        if model.placed and here.keys() & {"gap", "pitch", "roughness"}:
            gap = float(gap_on_asperities(here["roughness"])) if "roughness" in here else here.get("gap")
            placements.append((diameter, gap, here.get("pitch", 0.0)))  # else it was fitted level
        elif not model.placed and {"body_drag", "body_rotation"} & {*found.problem.free}:
            robot = experiment.robots[list(experiment.channel).index(place)]
            kept = robot.calibration.get(model.name)
            names = ("body_drag", "body_rotation")
            factors.append((robot, diameter, *(here.get(name, getattr(kept, name, 1.0)) for name in names)))
    for robot, item in zip(experiment.robots, found.friction, strict=False):
        if isfinite(item.value) and robot.channel is not None:
            words = [f"comes out as {item.value:.4g}"] if item.value < 0 else []
            words += [f"{item.low:.6g} to {item.high:.6g}"] if isfinite(item.low) else []
            frictions.append((robot, item, words))
    synthetic = " (synthetic)" if experiment.synthetic else ""
    return rendered(
        "results/calibration.toml.jinja",
        filters=_FILTERS,
        found=found,
        experiment=experiment,
        model=model,
        source=f"{experiment.source}{synthetic}, spirillum calibrate --method {found.method}",
        versions=versions(),
        factors=factors,
        fitted=[
            (parameter.name.removeprefix("shared_"), value, parameter.unit)
            for parameter, _, value in fitted
            if parameter.name in (*_FITTED, "shared_friction")
        ],
        placements=placements,
        roughness=everywhere.get("roughness"),
        friction_coefficient=everywhere.get("friction_coefficient"),
        frictions=frictions,
    )


_RESULTS = ("calibration.toml", "predictions.csv", "posterior.nc")
_FIGURES = ("observed-", "residuals", "posterior", "profiles")
_SYNTHETIC = f"# the observations say that they are synthetic: nothing here is measured; {MARK}\n"
_COLUMNS = ("channel_diameter_mm", "wavelength_mm", "amplitude_mm", "rows")
_HEADER = ",".join(_COLUMNS)  # what `predictions.csv` begins with, which other programs read and has no comments


def earlier_results(folder: Path) -> list[Path]:
    """Files of an earlier calibration in a folder, which a new one replaces."""
    named = [folder / name for name in _RESULTS if (folder / name).is_file()]
    return named + [
        path
        for path in sorted((folder / "figures").glob("*"))
        if path.is_file() and path.suffix in (".png", ".svg", ".pdf") and path.stem.startswith(_FIGURES)
    ]


def check_folder(folder: Path) -> None:
    """Refuse a folder for results before any work is done."""
    for path in (*(folder / name for name in _RESULTS), *earlier_results(folder)):
        check_replaceable(path, begins=_begins(path))


def _begins(path: Path) -> bytes:
    return _HEADER.encode() if path.name == "predictions.csv" else b""


def calibrate(  # noqa: PLR0913 - the options of the command
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
    answer: str = "held",
    figures: bool = True,
    vector: bool = False,
    workers: int = 1,
    progress: Progress | None = None,
) -> Calibrated:
    """Fit parameters of a model to observed speeds and rates.

    Args:
        observations: observations file, see `docs/commands`.
        robots: a robot for each channel (preset, file, mapping or robot); the tails are those of the rows.
        output: folder for `calibration.toml`, `predictions.csv`, figures and, for a posterior, `posterior.nc`; None:
            nothing is written.
        model: `sbt`, `rft`, `slender`, `tube`; or `auto`: `tube` where every robot has the table of its tube, or
            `prepare` makes it, and what is free is of that model; else `sbt`.
        free: free parameters; None: those that the paper fitted with this model, with `tube` gap,friction.
        method: `posterior`, `least-squares`, or `paper` (its inversion of (15) and (18)).
        friction: friction model for which B_eff follows from (18): `rotor` or `paper`.
        assume_uncertainty: field of the robot, `fluid.viscosity`, `motor.torque_constant` or
            `motor.back_emf_constant`, to half of its relative 95 % interval, such as ``"5%"``; what is not stated is
            taken as exact.
        sampling: how the posterior is sampled.
        prepare: compute missing tables of the model `tube`, minutes for each.
        answer: what is fitted: `held`, or `trial`, released in the tube as `predict` has it (free:
            `friction_coefficient`, `shared_friction`, `roughness`); a second for each of 32 trials of a robot.
        figures: draw figures, which takes some seconds.
        vector: write figures as SVG beside PNG.
        workers: number of processes; another one takes half of the work. Results do not depend on it.
        progress: called with stage, number done, and total.

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
            stack.enter_context(guard_inputs(*inputs))
            check_folder(folder)
        drawn, draws = figures and folder is not None, method == "posterior"
        shared = workers != 1 and (drawn or draws)
        needed = [*(["emcee"] if draws else []), *(["spirillum.view.figures.calibration"] if drawn else [])]
        beside = stack.enter_context(process_beside(partial(load_figures, *needed))) if shared else None
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
            answer=answer,
            progress=progress,
            beside=beside,
        )
        if folder is None:
            return found
        return write_calibration(found, folder, figures=figures, vector=vector, beside=beside, progress=progress)


def write_calibration(
    found: Calibrated,
    folder: Path,
    *,
    figures: bool = True,
    vector: bool = False,
    beside: ProcessPoolExecutor | None = None,
    progress: Progress | None = None,
) -> Calibrated:
    """Write all files of a calibration, all or none of them; return it with their names."""
    # All are made before the first takes the place of an earlier calibration's, and what that one had more goes
    # afterwards: half of an older calibration beside a new one would be believed.
    drawings: Drawings = {}
    if figures:
        from spirillum.view.figures.calibration import calibration_drawings

        drawings = calibration_drawings(found)
        output_folder(output_folder(folder) / "figures", folder)
    check_folder(output_folder(folder))
    earlier = earlier_results(folder)
    names = _RESULTS if found.posterior is not None else _RESULTS[:2]
    endings = ("png", "svg") if vector else ("png",)
    pictures = [folder / "figures" / f"{name}.{ending}" for name in drawings for ending in endings]
    written = [*(folder / name for name in names), *pictures]
    with atomic_write_all({path: _begins(path) for path in written}, earlier=earlier) as parts:
        parts[written[0]].write_text(calibration_text(found), encoding="utf-8")
        parts[written[1]].write_text(predictions_text(found), encoding="utf-8")
        if found.posterior is not None:
            write_posterior(posterior_tree(found), parts[written[2]])
        if pictures:
            draw_together(
                drawings,
                parts[pictures[0]].parent,
                lambda name, done: tell(progress, f"figure {name}", done, len(drawings)),
                vector=vector,
                again=partial(calibration_drawings, found),
                beside=beside,
            )
    files = sorted(str(path.relative_to(folder)) for path in written)
    gone = _gone([path.relative_to(folder) for path in earlier if path not in written])
    said = [Note("files", f"{folder} held an earlier calibration: its {gone} are gone")] if gone else []
    return replace(found, folder=folder, files=tuple(files), warnings=(*found.warnings, *said))


def _gone(paths: Sequence[Path]) -> str:
    """Files of an earlier calibration that the new one does not have, in words."""
    pictures = sum(1 for path in paths if len(path.parts) > 1)
    names = [str(path) for path in paths if len(path.parts) == 1]
    names += [f"{pictures} figure{'s' if pictures > 1 else ''}"] if pictures else []
    return " and ".join(names)


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
        diameter = robot.channel.diameter if robot.channel else nan
        row = [_short(diameter * 1e3), _short(robot.tail.wavelength * 1e3), _short(robot.tail.amplitude * 1e3)]
        row.append(" ".join(str(number) for number in experiment.rows[place]))
        for name in names:
            seen = float(found.problem.ratio(name).mean[place])
            value, low, high = (float(column[place]) for column in found.predicted[name])
            row += [_short(number) for number in (seen, value, low, high, seen / value - 1.0)]
        friction = found.friction[place] if found.friction else Estimate(nan)
        row += [_short(number) for number in (friction.value, friction.low, friction.high)]
        table.writerow(row)
    return stream.getvalue()


def _short(value: float) -> str:
    return f"{value:.8g}" if isfinite(value) else ""
