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

from spirillum.calibration.calibrated import Calibrated, posterior_tree
from spirillum.calibration.fit import RobotSource, fit_model
from spirillum.calibration.parameters import Estimate
from spirillum.calibration.posterior import Sampling
from spirillum.calibration.problem import Progress
from spirillum.files import MARK, atomic_write_all, check_replaceable, guard_inputs, output_folder, results_folder
from spirillum.fitted.posterior_file import write_posterior
from spirillum.notes import Note
from spirillum.robot.placement import gap_on_asperities
from spirillum.robot.robot import Robot
from spirillum.swimming.model_choice import AUTO
from spirillum.version import versions


def _number(value: float) -> str:
    """A float in TOML, with all its digits."""
    text = repr(float(value))
    return text if "." in text or "e" in text else f"{text}.0"


def _length(value: float) -> str:
    """A length in TOML: millimetres, without the rounding of the last digit."""
    return f'"{1e3 * value:.15g} mm"'


def _words(item: Estimate) -> str:
    ends = f" ({item.low:.5g} to {item.high:.5g})" if math.isfinite(item.low) else ""
    return f"{item.value:.5g}{ends}"


def _quoted(text: str) -> str:
    kept = "".join(letter if letter.isprintable() and letter not in '"\\' else "'" for letter in text)
    return f'"{kept[:400]}"'


_FITTED = (
    "wire_diameter",
    "viscosity",
    "torque_constant",
    "back_emf_constant",
    "normal_factor",
    "tangential_factor",
    "shared_friction",
)


def calibration_text(found: Calibrated) -> str:
    """`calibration.toml`: factors for each channel, fitted fields, friction for each tail, and what they rest on."""
    lines = _head(found)
    lines += _factor_tables(found)
    lines += _fitted_table(found)
    lines += _placement_tables(found)
    lines += _contact_table(found)
    lines += _friction_tables(found)
    return "\n".join(lines) + "\n"


def _head(found: Calibrated) -> list[str]:
    problem, experiment = found.problem, found.experiment
    names = dict.fromkeys(robot.name for robot in experiment.robots)
    uncertainty = [f"{name} = {_words(item)}" for name, item in found.values.items()]
    uncertainty += [f"discrepancy of the {name} = {_words(item)}" for name, item in found.discrepancy.items()]
    lines = ["# Written by `spirillum calibrate`; `predict` and `study` take it as --calibration."]
    if experiment.synthetic:
        lines.append("# The observations say that they are synthetic: nothing here is measured.")
    if not found.converged:
        lines.append("# The sampler has not converged: do not use these values.")
    return [
        *lines,
        "",
        "[provenance]",
        f"observations = {_quoted(experiment.source)}",
        f'sha256 = "{experiment.sha256}"',
        f"rows = {sum(len(rows) for rows in experiment.rows)}",
        f"robots = [{', '.join(_quoted(name) for name in names)}]",
        f'model = "{problem.model.name}"',
        f'method = "{found.method}"',
        f"free = [{', '.join(_quoted(name) for name in problem.free)}]",
        *(['answer = "trial"'] if problem.trials is not None else []),
        f'friction_reading = "{found.reading}"',
        f"synthetic = {'true' if experiment.synthetic else 'false'}",
        "uncertainty = [  # 95 % intervals",
        *(f"    {_quoted(text)}," for text in uncertainty),
        "]",
        f"versions = {_quoted(versions())}",
    ]


def _source(found: Calibrated) -> str:
    synthetic = " (synthetic)" if found.experiment.synthetic else ""
    return f"{found.experiment.source}{synthetic}, spirillum calibrate --method {found.method}"


def _factor_tables(found: Calibrated) -> list[str]:
    problem = found.problem
    if problem.model.placed or not any(name in ("body_drag", "body_rotation") for name in problem.free):
        return []
    lines = []
    for place in range(len(found.experiment.channels)):
        robot = next(r for r, c in zip(found.experiment.robots, found.experiment.channel, strict=True) if c == place)
        own = {
            item.parameter.name: found.values[item.label].value for item in problem.coordinates if item.channel == place
        }
        lines += ["", f"[[calibration.{problem.model.name}]]"]
        kept = robot.calibration.get(problem.model.name)
        for name in ("body_drag", "body_rotation"):
            lines.append(f"{name} = {_number(own.get(name, getattr(kept, name, 1.0)))}")
        lines += [f"source = {_quoted(_source(found))}", "", f"[calibration.{problem.model.name}.fitted_to]"]
        sizes = {
            "channel_diameter": found.experiment.channels[place],
            "body_diameter": robot.body.diameter,
            "body_length": robot.body.length,
        }
        lines += [f"{name} = {_length(value)}" for name, value in sizes.items()]
    return lines


def _fitted_table(found: Calibrated) -> list[str]:
    lines = []
    for item in found.problem.coordinates:
        name = item.parameter.name
        if name in _FITTED:
            value = _number(found.values[item.label].value)
            key = "friction" if name == "shared_friction" else name
            lines.append(f'{key} = "{value} {item.parameter.unit}"' if item.parameter.unit else f"{key} = {value}")
    return ["", "[fitted]", *lines] if lines else []


def _placement_tables(found: Calibrated) -> list[str]:
    if not found.problem.model.placed:
        return []
    lines = []
    for place, diameter in enumerate(found.experiment.channels):
        own = {
            item.parameter.name: found.values[item.label].value
            for item in found.problem.coordinates
            if item.parameter.name in _PLACE and item.channel in (None, place)
        }
        if "roughness" in own:
            own["gap"] = float(gap_on_asperities(own["roughness"]))
        if own:
            lines += ["", "[[placement]]", f"channel_diameter = {_length(diameter)}", "", "[placement.placement]"]
            if "gap" in own:
                lines.append(f'gap = "{_number(own["gap"])} m"')
            lines.append(f'pitch = "{_number(own.get("pitch", 0.0))} rad"')  # else it was fitted level
    return lines


_PLACE = ("gap", "pitch", "roughness")


def _contact_table(found: Calibrated) -> list[str]:
    values = {item.parameter.name: found.values[item.label].value for item in found.problem.coordinates}
    lines = []
    if "roughness" in values:
        lines.append(f'roughness = "{_number(values["roughness"])} m"')
    if "friction_coefficient" in values:
        lines.append(f"friction_coefficient = {_number(values['friction_coefficient'])}")
    return ["", "[contact]", *lines] if lines else []


def _friction_tables(found: Calibrated) -> list[str]:
    lines = ["", f"# {found.friction_statement}"] if found.friction_statement else []
    for robot, item in zip(found.experiment.robots, found.friction, strict=False):
        if not np.isfinite(item.value) or robot.channel is None:
            continue
        sizes = {
            "channel_diameter": robot.channel.diameter,
            "wavelength": robot.tail.wavelength,
            "amplitude": robot.tail.amplitude,
        }
        lines += ["", "[[friction]]", *(f"{name} = {_length(value)}" for name, value in sizes.items())]
        effective = max(item.value, 0.0)
        words = [f"comes out as {item.value:.4g}"] if item.value < 0 else []
        words += [f"{item.low:.6g} to {item.high:.6g}"] if math.isfinite(item.low) else []
        lines.append(f'effective = "{_number(effective)} N m s/rad"' + (f"  # {', '.join(words)}" if words else ""))
    return lines


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
    for path in earlier_results(folder):
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
        friction: reading under which B_eff follows from (18): `rotor` or `paper`.
        assume_uncertainty: field of the robot, `fluid.viscosity`, `motor.torque_constant` or
            `motor.back_emf_constant`, to half of its relative 95 % interval, such as ``"5%"``; what is not stated is
            taken as exact.
        sampling: how the posterior is sampled.
        prepare: compute missing tables of the model `tube`, minutes for each.
        answer: what is fitted: `held`, or `trial`, released in the tube as `predict` has it (free:
            `friction_coefficient`, `shared_friction`, `roughness`); a second for each of 32 trials of a robot.
        figures: draw figures, which takes some seconds.
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
        )
        return found if folder is None else write_calibration(found, folder, figures=figures, progress=progress)


def write_calibration(
    found: Calibrated, folder: Path, *, figures: bool = True, progress: Progress | None = None
) -> Calibrated:
    """Write all files of a calibration, the figures last, each whole or not at all; return it with their names."""
    # The numbers are all made before the first takes the place of an earlier calibration's, and what that one had more
    # goes afterwards: half of an older calibration beside a new one would be believed.
    check_folder(folder)
    output_folder(folder)
    earlier = earlier_results(folder)
    names = _RESULTS if found.posterior is not None else _RESULTS[:2]
    written = [folder / name for name in names]
    with atomic_write_all({path: _begins(path) for path in written}) as parts:
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
    said = [Note("files", f"{folder} held an earlier calibration: its {gone} are gone")] if gone else []
    return replace(found, folder=folder, files=tuple(files), warnings=(*found.warnings, *said))


def _gone(paths: Sequence[Path]) -> str:
    """Files of an earlier calibration that the new one does not have, in words."""
    pictures = sum(1 for path in paths if len(path.parts) > 1)
    names = [str(path) for path in paths if len(path.parts) == 1]
    names += [f"{pictures} figure{'s' if pictures > 1 else ''}"] if pictures else []
    return " and ".join(names)


def _drawn(found: Calibrated, folder: Path, progress: Progress | None) -> list[Path]:
    from spirillum.view.figures.calibration import calibration_figures
    from spirillum.view.figures.style import save

    on_progress = progress or (lambda _what, _done, _total: None)
    on_progress("figures", 0, 1)
    inside = output_folder(folder / "figures", folder)
    written: list[Path] = []
    for name, figure in calibration_figures(found).items():
        written += save(figure, inside / name)
    on_progress("figures", 1, 1)
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
