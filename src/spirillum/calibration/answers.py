"""A calibration as JSON, and as the calibration file that `predict` and `study` take."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from spirillum.answer import envelope, quantity, versions
from spirillum.calibration.fit import LEVEL
from spirillum.calibration.posterior import FEWEST_EFFECTIVE, LARGEST_RHAT

if TYPE_CHECKING:
    from spirillum.calibration.experiment import Quantity
    from spirillum.calibration.fit import Calibrated, Fitted

__all__ = ["MEANINGS", "calibration_answer", "calibration_text"]

MEANINGS: dict[Quantity, tuple[str, str]] = {
    "advance": ("m/rad", "advance per radian of the tail"),
    "turning": ("1", "body rate over tail rate"),
    "motor_rate": ("rad/s", "motor rate"),
}
"""Unit and meaning of what is compared."""


def _interval(item: Fitted) -> dict[str, Any]:
    if not math.isfinite(item.low):
        return {}
    return {"low": item.low, "high": item.high, "kind": "interval", "level": LEVEL}


def calibration_answer(found: Calibrated) -> dict[str, Any]:
    """The answer of `spirillum calibrate --json`."""
    problem, experiment = found.problem, found.experiment
    parameters = {
        item.label: quantity(
            found.values[item.label].value,
            item.parameter.unit or "1",
            **_interval(found.values[item.label]),
            meaning=item.parameter.meaning,
            prior=item.prior.words(item.parameter.unit) if found.method == "posterior" else None,
        )
        for item in problem.coordinates
    }
    content: dict[str, Any] = {
        "observations": experiment.source,
        "synthetic": experiment.synthetic,
        "robots": experiment.size,
        "rows": sum(len(rows) for rows in experiment.rows),
        "model": problem.model.name,
        "method": found.method,
        "friction": found.reading,
        "parameters": parameters,
        "discrepancy": {name: quantity(v.value, "1", **_interval(v)) for name, v in found.discrepancy.items()},
        "error_of_a_trial": {name: quantity(value, "1") for name, value in found.error.items()},
        "tails": [_tail(found, place) for place in range(experiment.size)],
    }
    if found.least_squares is not None:
        fit = found.least_squares
        content["chi_squared"] = quantity(fit.chi2, "1", freedom=fit.freedom)
    if found.identifiability is not None:
        report = found.identifiability
        content["identifiability"] = {
            "labels": list(report.labels),
            "singular_values": quantity(report.singular, "1"),
            "directions": quantity(report.directions, "1"),
            "sensitivities": quantity(report.sensitivity, "1"),
        }
    if found.posterior is not None:
        posterior = found.posterior
        content["sampler"] = {
            "converged": posterior.converged,
            "draws": int(posterior.flat.shape[0]),
            "r_hat": posterior.rhat,
            "largest_r_hat": LARGEST_RHAT,
            "effective_draws": posterior.effective,
            "fewest_effective_draws": FEWEST_EFFECTIVE,
        }
    return envelope("calibration", content, found.warnings)


def _tail(found: Calibrated, place: int) -> dict[str, Any]:
    robot = found.experiment.robots[place]
    content: dict[str, Any] = {
        "channel_diameter": quantity(robot.channel.diameter if robot.channel else None, "m"),
        "wavelength": quantity(robot.tail.wavelength, "m"),
        "amplitude": quantity(robot.tail.amplitude, "m"),
        "rows": list(found.experiment.rows[place]),
    }
    for name, (values, low, high) in found.predicted.items():
        unit, _ = MEANINGS[name]
        ends = {}
        if math.isfinite(low[place]):
            ends = {"low": float(low[place]), "high": float(high[place]), "kind": "interval", "level": LEVEL}
        content[f"{name}_observed"] = quantity(float(found.problem.ratio(name).mean[place]), unit)
        content[f"{name}_predicted"] = quantity(float(values[place]), unit, **ends)
    if found.friction:
        item = found.friction[place]
        content["effective_friction"] = quantity(item.value, "N m s/rad", **_interval(item))
    return content


def _number(value: float) -> str:
    """A float in TOML, with all its digits."""
    text = repr(float(value))
    return text if "." in text or "e" in text else f"{text}.0"


def _words(item: Fitted) -> str:
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
        lines += [f'{name} = "{_number(value)} m"' for name, value in sizes.items()]
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
            item.parameter: found.values[item.label].value
            for item in found.problem.coordinates
            if item.channel == place
        }
        if own:
            lines += ["", "[[placement]]", f'channel_diameter = "{_number(diameter)} m"', "", "[placement.placement]"]
            lines += [f'{parameter.name} = "{_number(value)} {parameter.unit}"' for parameter, value in own.items()]
            if all(parameter.name != "pitch" for parameter in own):
                lines.append('pitch = "0 rad"')  # it was fitted level
    return lines


def _friction_tables(found: Calibrated) -> list[str]:
    lines = []
    for robot, item in zip(found.experiment.robots, found.friction, strict=False):
        if not np.isfinite(item.value) or robot.channel is None:
            continue
        sizes = {
            "channel_diameter": robot.channel.diameter,
            "wavelength": robot.tail.wavelength,
            "amplitude": robot.tail.amplitude,
        }
        lines += ["", "[[friction]]", *(f'{name} = "{_number(value)} m"' for name, value in sizes.items())]
        effective = max(item.value, 0.0)
        lines.append(f'effective = "{_number(effective)} N m s/rad"' + _comment(item))
    return lines


def _comment(item: Fitted) -> str:
    words = [f"comes out as {item.value:.4g}"] if item.value < 0 else []
    words += [f"{item.low:.4g} to {item.high:.4g}"] if math.isfinite(item.low) else []
    return f"  # {', '.join(words)}" if words else ""
