"""Swimming with what a calibration does not know: a posterior's draws, each swum, and the intervals over them.

A posterior file (`posterior.nc` of `spirillum calibrate`) holds draws of fitted parameters and of the model's
discrepancy, its relative misfit from tail to tail. Every draw is a robot of its own; a batch of them swims at once. The
discrepancy then goes onto speed and body rate, independently for each draw, for a tail that was not observed may be
missed by as much as those that were. An interval is of the robot's own motion, not of a single measured trial.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from spirillum.arrays import Axial, PerRobot, Samples
from spirillum.errors import InputError
from spirillum.hydrodynamics.model import SwimmerModel
from spirillum.motion.quantities import Swimming
from spirillum.motion.swimming import swim
from spirillum.robot.batch import CalibrationFactors, RobotBatch
from spirillum.robot.calibration_file import CalibrationFile, FittedFriction, FittedValues, calibrated_robot
from spirillum.robot.options import Calibration, FittedTo
from spirillum.robot.robot import Robot

__all__ = ["LEVEL", "Intervals", "PosteriorFile", "drawn_kinematics", "intervals_of", "read_posterior"]

LEVEL = 0.95
"""Level of the intervals."""
_SCHEMA = "spirillum.posterior/1"
_DRAWS = 1000
_WHAT = "posterior.nc of `spirillum calibrate --method posterior`"
_ELECTRIC = ("torque_constant", "back_emf_constant")
_COEFFICIENTS = ("normal_factor", "tangential_factor")
_WIRE_POINTS = 7
_TAIL = ("channel_diameter", "wavelength", "amplitude")


@dataclass(frozen=True)
class PosteriorFile:
    """Draws of a posterior, thinned, with what they were fitted to."""

    source: str
    sha256: str
    model: str
    observations: str
    synthetic: bool
    channels: tuple[float, ...]
    """Channel diameters, m."""
    body: tuple[float, float]
    """Diameter and length of the fitted body, m."""
    draws: Mapping[str, Samples]
    """Parameter to (draws, channels), or (draws, 1)."""
    discrepancy: Mapping[str, Samples]
    """Quantity to (draws,)."""
    error: Mapping[str, Samples]
    """Relative error of a trial, quantity to (draws,)."""
    friction: tuple[Mapping[str, float], ...]
    """B_eff tail by tail, with `low` and `high`."""

    def central(self, robot: Robot) -> Robot:
        """The robot with the middle of the posterior in place of its own values."""
        factors = [name for name in ("body_drag", "body_rotation") if name in self.draws]
        entries = []
        for place, diameter in enumerate(self.channels if factors else ()):
            middle = {name: float(np.median(self._column(name, place))) for name in factors}
            own = robot.calibration.get(self.model)
            kept = {name: getattr(own, name) for name in ("body_drag", "body_rotation")} if own else {}
            fitted_to = FittedTo.model_construct(
                channel_diameter=diameter, body_diameter=self.body[0], body_length=self.body[1]
            )
            entries.append(Calibration.model_construct(**(kept | middle), source=self.source, fitted_to=fitted_to))
        names = {"shared_friction": "friction"}
        values: dict[str, Any] = {
            names.get(name, name): float(np.median(self.draws[name]))
            for name in self.draws
            if names.get(name, name) in FittedValues.model_fields
        }
        file = CalibrationFile.model_construct(
            calibration={self.model: tuple(entries)} if entries else {},
            fitted=FittedValues.model_construct(**values),
            friction=self.frictions,
        )
        return calibrated_robot(robot, file)

    @property
    def frictions(self) -> tuple[FittedFriction, ...]:
        """The middle of B_eff, tail by tail."""
        tails: list[dict[str, Any]] = [
            {**{key: item[key] for key in _TAIL}, "effective": max(item["value"], 0.0)} for item in self.friction
        ]
        return tuple(FittedFriction.model_construct(**tail) for tail in tails)

    def _column(self, name: str, channel: int) -> Samples:
        columns = self.draws[name]
        return columns[:, min(channel, columns.shape[1] - 1)]

    def of(self, robot: Robot, rng: np.random.Generator) -> dict[str, Samples]:
        """Draws for one robot: those of the nearest channel, and its own tail's friction where that was fitted."""
        diameter = robot.channel.diameter if robot.channel else np.inf
        nearest = int(np.argmin([abs(np.log(diameter / channel)) for channel in self.channels]))
        found = {name: self._column(name, nearest) for name in self.draws}
        for item in self.friction:
            keys = (diameter, robot.tail.wavelength, robot.tail.amplitude)
            fitted = tuple(item[key] for key in _TAIL)
            if np.allclose(keys, fitted, rtol=1e-6, atol=0.0) and np.isfinite(item["high"] - item["low"]):
                spread = (item["high"] - item["low"]) / (2.0 * 1.96)
                size = next(iter(found.values())).size
                found["friction"] = np.maximum(item["value"] + spread * rng.normal(size=size), 0.0)
        return found


@dataclass(frozen=True)
class Intervals:
    """Limits of the intervals of every quantity of one robot."""

    low: Mapping[str, float]
    high: Mapping[str, float]

    def of(self, name: str) -> dict[str, Any]:
        """Entries `low`, `high`, `kind` and `level` of a quantity's JSON; none for one that does not apply."""
        if not np.isfinite(self.low[name]):
            return {}
        return {"low": self.low[name], "high": self.high[name], "kind": "interval", "level": LEVEL}


def read_posterior(path: str | Path, *models: str) -> PosteriorFile:
    """Read a posterior that a calibration has written.

    Args:
        path: the file.
        models: models that are asked, of which it has to be one; none: any.

    Raises:
        InputError: if it is no such file, is damaged, has not converged, or is of another model.
    """
    import hashlib

    import xarray as xr

    path = Path(path)
    if not path.is_file():
        raise InputError(f"{path} does not exist; allowed: {_WHAT}")
    try:
        with xr.open_datatree(path, engine="h5netcdf") as tree:
            attributes = {str(name): item for name, item in tree.attrs.items()}
            if attributes.get("schema") != _SCHEMA:
                raise InputError(f"{path} is no posterior of a calibration; allowed: {_WHAT}")
            values = {str(name): np.asarray(item.values, float) for name, item in tree["posterior"].data_vars.items()}
        found = _read(path, attributes, values, hashlib.sha256(path.read_bytes()).hexdigest())
    except (OSError, ValueError, KeyError, TypeError, IndexError, RuntimeError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{path} is no posterior, or damaged; allowed: {_WHAT}") from error
    if not attributes.get("converged"):
        raise InputError(
            f"{path} has not converged, so that its intervals mean nothing; allowed: {_WHAT}, with exit code 0"
        )
    if "gap" in found.draws or "pitch" in found.draws:
        raise InputError(
            f"{path} is of a model that computes the walls, which cannot solve a thousand places; allowed: its "
            "calibration.toml as --calibration, or a posterior of sbt, rft or slender"
        )
    if models and found.model not in models:
        asked = ", ".join(f"'{name}'" for name in models)
        raise InputError(f"{path} is of model '{found.model}', not {asked}; allowed: --model {found.model}")
    return found


def _read(path: Path, attributes: Mapping[str, Any], values: Mapping[str, Samples], sha256: str) -> PosteriorFile:
    channels = tuple(float(item) for item in json.loads(attributes["channels"]))
    listed = json.loads(attributes["parameters"])
    flat = {name: array.reshape(-1) for name, array in values.items()}
    size = min(array.size for array in flat.values())
    kept = np.linspace(0, size - 1, min(size, _DRAWS)).round().astype(int)
    draws: dict[str, Samples] = {}
    for name in dict.fromkeys(item["parameter"] for item in listed):
        columns = sorted((item for item in listed if item["parameter"] == name), key=lambda item: item["channel"] or 0)
        draws[name] = np.stack([flat[item["label"]][kept] for item in columns], axis=1)
    quantities = json.loads(attributes["quantities"])
    body = json.loads(attributes["settings"])[0]["body"]
    if not (draws and channels and all(np.all(np.isfinite(array)) for array in draws.values())):
        raise InputError(f"{path} holds draws that are no numbers; allowed: {_WHAT}")
    return PosteriorFile(
        source=f"{path.name} ({attributes['observations']})",
        sha256=sha256,
        model=str(attributes["model"]),
        observations=str(attributes["observations"]),
        synthetic=bool(attributes["synthetic"]),
        channels=channels,
        body=(float(body["diameter"]), float(body["length"])),
        draws=draws,
        discrepancy={name: flat[f"discrepancy_{name}"][kept] for name in quantities},
        error={name: flat[f"error_{name}"][kept] for name in quantities},
        friction=tuple(json.loads(attributes["friction"])),
    )


def intervals_of(
    robot: Robot,
    model: SwimmerModel,
    posterior: PosteriorFile,
    *,
    tail_rate: float | None,
    friction: str,
) -> Intervals:
    """Swim every draw of a posterior and take the limits of 95 % intervals.

    Args:
        robot: the robot, as `PosteriorFile.central` gives it.
        model: the hydrodynamic model of the posterior.
        posterior: its draws.
        tail_rate: prescribed tail rate, rad/s; None: the robot's own drive.
        friction: reading of the friction.
    """
    rng = np.random.default_rng(1)
    draws = posterior.of(robot, rng)
    size = next(iter(draws.values())).size
    batch = _drawn_batch(robot, posterior.model, draws, size)
    drawn = _Drawn(model, _drawn_axial(robot, model, draws, size))
    rates = None if tail_rate is None else np.full(size, tail_rate)
    swum = swim(batch, drawn, tail_rate=rates, friction=friction)
    values = _with_discrepancy(swum, posterior, rng, own_drive=tail_rate is None)
    ends = [0.5 - 0.5 * LEVEL, 0.5 + 0.5 * LEVEL]
    limits = {name: np.quantile(column[np.isfinite(column)], ends) for name, column in values.items() if _known(column)}
    nan = float("nan")
    return Intervals(
        {name: float(limits[name][0]) if name in limits else nan for name in values},
        {name: float(limits[name][1]) if name in limits else nan for name in values},
    )


def drawn_kinematics(robot: Robot, model: SwimmerModel, posterior: PosteriorFile) -> dict[str, Samples]:
    """Advance per radian and body over tail rate of every draw, without the model's discrepancy, (draws,).

    Args:
        robot: the robot, as `PosteriorFile.central` gives it.
        model: the hydrodynamic model of the posterior.
        posterior: its draws.
    """
    draws = posterior.of(robot, np.random.default_rng(1))
    size = next(iter(draws.values())).size
    batch = _drawn_batch(robot, posterior.model, draws, size)
    drawn = _Drawn(model, _drawn_axial(robot, model, draws, size))
    swum = swim(batch, drawn, tail_rate=np.full(size, robot.hand), friction="none")
    return {"advance": swum.advance_per_radian, "turning": swum.body_rotation_rate / swum.tail_rotation_rate}


def _known(column: Samples) -> bool:
    """Whether at least nineteen of twenty draws have an answer."""
    return bool(np.mean(np.isfinite(column)) >= LEVEL)


def _drawn_batch(robot: Robot, model: str, draws: Mapping[str, Samples], size: int) -> RobotBatch:
    """A robot for each draw."""
    one = np.ones(size)
    columns: dict[str, np.ndarray] = {}
    own = robot.friction.effective
    columns["friction.effective"] = np.full(size, np.nan if own is None else own)
    for name, path in (
        ("wire_diameter", "tail.wire_diameter"),
        ("viscosity", "fluid.viscosity"),
        ("shared_friction", "friction.effective"),
        ("friction", "friction.effective"),
    ):
        if name in draws:
            columns[path] = draws[name]
    batch = RobotBatch.of(robot).with_values(columns)
    if batch.electrics is not None:
        motor = {name: draws[name] for name in _ELECTRIC if name in draws}
        batch = replace(batch, electrics=replace(batch.electrics, **motor))
    entry = robot.calibration.get(model)
    if entry is not None:
        factors = CalibrationFactors(
            body_drag=draws.get("body_drag", entry.body_drag * one),
            body_rotation=draws.get("body_rotation", entry.body_rotation * one),
            channel_diameter=entry.fitted_to.channel_diameter * one,
            body_diameter=entry.fitted_to.body_diameter * one,
            body_length=entry.fitted_to.body_length * one,
        )
        batch = replace(batch, calibration={model: factors})
    return batch


def _drawn_axial(robot: Robot, model: SwimmerModel, draws: Mapping[str, Samples], size: int) -> Axial:
    """Resistances of all draws, (draws, 4, 4), or (1, 4, 4) where they share it."""
    batch = RobotBatch.of(robot)
    if "wire_diameter" not in draws:
        found = _with_coefficients(batch, model, draws)
    elif model.closed_form:
        found = _with_coefficients(batch.with_values({"tail.wire_diameter": draws["wire_diameter"]}), model, draws)
    else:
        wires = np.log(draws["wire_diameter"])
        angle = (2.0 * np.arange(_WIRE_POINTS) + 1.0) * np.pi / (2.0 * _WIRE_POINTS)
        nodes = 0.5 * (wires.min() + wires.max()) + 0.5 * (wires.max() - wires.min()) * np.cos(angle)
        known = model.axial(batch.with_values({"tail.wire_diameter": np.exp(nodes)}))
        fit = np.polynomial.chebyshev.chebfit(np.cos(angle), known.reshape(_WIRE_POINTS, 16), _WIRE_POINTS - 1)
        at = (2.0 * wires - wires.min() - wires.max()) / (wires.max() - wires.min())
        found = np.polynomial.chebyshev.chebval(at, fit).T.reshape(size, 4, 4)
    if "viscosity" in draws:
        found = found * (draws["viscosity"] / robot.fluid.viscosity)[:, None, None]
    return found


def _with_coefficients(batch: RobotBatch, model: SwimmerModel, draws: Mapping[str, Samples]) -> Axial:
    """RFT is linear in both of its coefficients: what a factor adds is what doubling it adds, in proportion."""
    found = model.axial(batch)
    whole, own = found, batch.options.rft
    for name in _COEFFICIENTS:
        if name in draws:
            value = getattr(own, name)
            doubled = batch.options.model_copy(update={"rft": own.model_copy(update={name: 2.0 * value})})
            more = model.axial(replace(batch, options=doubled)) - whole
            found = found + (draws[name] / value - 1.0)[:, None, None] * more
    return found


class _Drawn(SwimmerModel):
    """A model whose resistances are known beforehand, one for each draw."""

    parts = ()

    def __init__(self, model: SwimmerModel, axial: Axial) -> None:
        self.name = model.name  # type: ignore[misc]
        self._model, self._axial = model, axial

    def domain(self, batch: RobotBatch) -> list[Any]:
        return self._model.domain(batch)

    def part_matrix(self, batch: RobotBatch, part: str, phase: PerRobot) -> Any:
        return self._model.part_matrix(batch, part, phase)

    def axial(self, batch: RobotBatch) -> Axial:  # noqa: ARG002 - one interface for all models
        return self._axial

    def resistance(self, batch: RobotBatch, phase: PerRobot) -> Any:
        return self._model.resistance(batch, phase)


def _with_discrepancy(
    swum: Swimming, posterior: PosteriorFile, rng: np.random.Generator, *, own_drive: bool
) -> dict[str, Samples]:
    """All quantities, (draws,), with the model's discrepancy on speed and rates."""
    values = {f.name: getattr(swum, f.name) for f in fields(Swimming) if f.name != "valid"}

    def off(name: str) -> Samples:
        tau = posterior.discrepancy.get(name)
        size = swum.forward_velocity.size
        return np.ones(size) if tau is None else 1.0 + tau * rng.normal(size=size)

    advance, turning, motor = off("advance"), off("turning"), off("motor_rate")
    pace = motor if own_drive else np.ones(motor.size)
    tail = values["tail_rotation_rate"] * pace
    body = values["body_rotation_rate"] * turning * pace
    values |= {
        "forward_velocity": values["forward_velocity"] * advance * pace,
        "advance_per_radian": values["advance_per_radian"] * advance,
        "reynolds_number": values["reynolds_number"] * np.abs(advance * pace),
        "hydrodynamic_efficiency": values["hydrodynamic_efficiency"] * advance**2,
        "tail_rotation_rate": tail,
        "body_rotation_rate": body,
        "motor_rotation_rate": tail - body,
    }
    return values
