"""`calibration.toml`: what a calibration has found, as the file that `predict` and `study` take."""

from __future__ import annotations

import math

import numpy as np

from spirillum.calibration.calibrated import Calibrated
from spirillum.calibration.estimate import Estimate
from spirillum.robot.placement import gap_on_asperities
from spirillum.version import versions

__all__ = ["calibration_text"]


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
        lines.append(f'effective = "{_number(effective)} N m s/rad"' + _comment(item))
    return lines


def _comment(item: Estimate) -> str:
    words = [f"comes out as {item.value:.4g}"] if item.value < 0 else []
    words += [f"{item.low:.6g} to {item.high:.6g}"] if math.isfinite(item.low) else []
    return f"  # {', '.join(words)}" if words else ""
