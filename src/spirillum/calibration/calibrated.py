"""The result of a calibration: estimates and predictions for every robot, and its posterior as labelled groups."""

from __future__ import annotations

import json
import warnings
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from spirillum.answer_entries import answer_of
from spirillum.arrays import Samples
from spirillum.calibration.experiment import Experiment, Quantity
from spirillum.calibration.identifiability import Identifiability
from spirillum.calibration.least_squares import LeastSquares
from spirillum.calibration.likelihood import LEAST_RELATIVE
from spirillum.calibration.methods import Method
from spirillum.calibration.parameters import ASSUMABLE, Estimate
from spirillum.calibration.posterior import FEWEST_EFFECTIVE, LARGEST_RHAT, Posterior
from spirillum.calibration.problem import Problem
from spirillum.display import DisplayMixin
from spirillum.envelope import interval, quantity
from spirillum.fitted.posterior_file import SCHEMA, posterior_checksum
from spirillum.notes import Note, note_attributes
from spirillum.robot.robot import Robot
from spirillum.version import versions

if TYPE_CHECKING:
    import xarray as xr


MEANINGS: dict[Quantity, tuple[str, str]] = {
    "advance": ("m/rad", "advance per radian of the tail"),
    "turning": ("1", "body rate over tail rate"),
    "motor_rate": ("rad/s", "motor rate"),
}
"""Unit and meaning of what is compared."""


@dataclass(frozen=True, repr=False)
class Calibrated(DisplayMixin):
    """What a calibration found."""

    problem: Problem
    method: Method
    reading: str  #: Reading of the friction under which B_eff follows from (18).
    values: dict[str, Estimate]
    friction: tuple[Estimate, ...]
    """B_eff of every robot, N m s/rad; empty where it was not requested, NaN where no motor rate was observed. Without
    an interval where the error of the model's torque is not known.
    """
    friction_sensitivity: dict[str, Samples]
    """Change of B_eff of every robot per relative change of a constant of fluid or motor, N m s/rad, by its field."""
    friction_statement: str  #: What the intervals of B_eff take as exact, in a sentence; empty where there is no B_eff.
    predicted: dict[Quantity, tuple[Samples, Samples, Samples]]
    """Prediction for every robot with the limits of its 95 % interval, the discrepancy included."""
    error: dict[Quantity, float]  #: Relative error of one trial, from the scatter of trials.
    warnings: tuple[Note, ...]
    discrepancy: dict[Quantity, Estimate] = field(default_factory=dict)
    """Relative misfit of the model by robot, beyond the scatter of trials; empty by the method 'paper'."""
    least_squares: LeastSquares | None = None
    posterior: Posterior | None = None
    identifiability: Identifiability | None = None
    friction_given: tuple[Estimate, ...] = ()
    """B_eff of every robot with its constants as they are, on which predictions of these robots rest; empty where that
    is `friction`."""
    friction_within_model: tuple[Estimate, ...] = ()
    """B_eff of every robot with the stated uncertainties of its constants, were the model exact."""
    model_reason: str = ""  #: Why the model was fitted, in half a sentence; empty where it was named.
    folder: Path | None = None  #: Folder of the files that were written, if any were.
    files: tuple[str, ...] = ()

    @property
    def experiment(self) -> Experiment:
        """The observations."""
        return self.problem.experiment

    @property
    def typical_error(self) -> dict[Quantity, float]:
        """Relative error of one trial in the fit, at least what trials state: root mean square over the robots."""
        return {name: self.problem.ratio(name).typical_error(error) for name, error in self.error.items()}

    @property
    def friction_exact(self) -> dict[str, float]:
        """Fields that the intervals of B_eff take as exact, with its relative change per that of each."""
        if not self.friction_statement:
            return {}
        middle = np.nanmedian(np.abs([item.value for item in self.friction]))
        stated = [field for field, name in ASSUMABLE.items() if name in self.problem.assumed]
        changes = {field: float(np.nanmedian(by) / middle) for field, by in self.friction_sensitivity.items()}
        return {field: change for field, change in changes.items() if field not in stated}

    @property
    def converged(self) -> bool:
        """Whether a posterior may be used; True for the other methods."""
        return self.posterior is None or self.posterior.converged

    def to_dict(self) -> dict[str, Any]:
        """The answer of `spirillum calibrate --json`."""
        parameters = {
            item.label: self.values[item.label].quantity(
                item.parameter.unit,
                meaning=item.parameter.meaning,
                prior=item.prior.words(item.parameter.unit) if self.method == "posterior" else None,
            )
            for item in self.problem.coordinates
        }
        return answer_of(
            self,
            rows=sum(len(rows) for rows in self.experiment.rows),
            parameters=parameters,
            misses={name: size.quantity("1") for name, size in self.discrepancy.items()},
            tails=[_tail(self, place) for place in range(self.experiment.size)],
            largest=LARGEST_RHAT,
            fewest=FEWEST_EFFECTIVE,
        )


def _tail(found: Calibrated, place: int) -> dict[str, Any]:
    robot = found.experiment.robots[place]
    content: dict[str, Any] = {name: quantity(size, "m") for name, size in _geometry(robot).items()}
    content["rows"] = list(found.experiment.rows[place])
    if found.friction:
        content["effective_friction"] = found.friction[place].quantity("N m s/rad")
    for name, (values, low, high) in found.predicted.items():
        unit, _ = MEANINGS[name]
        content[f"{name}_observed"] = quantity(float(found.problem.ratio(name).mean[place]), unit)
        content[f"{name}_predicted"] = quantity(
            float(values[place]), unit, **interval(float(low[place]), float(high[place]))
        )
    if found.friction:
        content["effective_friction_per_percent"] = {
            field: quantity(0.01 * float(change[place]), "N m s/rad")
            for field, change in found.friction_sensitivity.items()
        }
    return content


def _geometry(robot: Robot) -> dict[str, float | None]:
    """Channel and tail of a robot, m."""
    channel = robot.channel.diameter if robot.channel else None
    return {"channel_diameter": channel, "wavelength": robot.tail.wavelength, "amplitude": robot.tail.amplitude}


def posterior_tree(found: Calibrated) -> xr.DataTree:
    """Groups `posterior`, `log_likelihood` (robot by robot), `observed_data` and `sample_stats` of a posterior."""
    from arviz_base import from_dict

    posterior = found.posterior
    assert posterior is not None  # noqa: S101 - checked by the caller
    density, problem, experiment = posterior.density, found.problem, found.experiment
    values = posterior.values()
    units = {item.label: item.parameter.unit or "1" for item in problem.coordinates}
    logs = np.concatenate([density.by_robot(block) for block in np.array_split(posterior.flat, 64)])
    observed = {name: problem.ratio(name).mean for name in problem.quantities}
    chains, draws, _ = posterior.z.shape
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # many walkers with few draws each are meant
        tree: xr.DataTree = from_dict(
            {
                "posterior": values,
                "log_likelihood": {"robot": logs.reshape(chains, draws, experiment.size)},
                "sample_stats": {"lp": density(posterior.flat).reshape(chains, draws)},
                "observed_data": observed,
            },
            dims={"robot": ["tail"], **{str(name): ["tail"] for name in observed}},
            coords={"tail": np.array(experiment.labels(), dtype=str)},
        )
    for name in values:
        tree["posterior"][name].attrs = {"units": units.get(name, "1"), "long_name": name.replace("_", " ")}
    tree.attrs = {
        **({} if problem.trials is None else {"answer": "trial"}),
        "schema": SCHEMA,
        "converged": int(posterior.converged),
        "observations": experiment.source,
        "sha256": experiment.sha256,
        "synthetic": int(experiment.synthetic),
        "model": problem.model.name,
        "free": json.dumps(list(problem.free)),
        "channels": json.dumps(list(experiment.channels)),
        "parameters": json.dumps(
            [{"label": c.label, "parameter": c.parameter.name, "channel": c.channel} for c in problem.coordinates]
        ),
        "friction_reading": found.reading,
        "friction": json.dumps(_friction(found)),
        "tails": json.dumps(_tails(found), allow_nan=False),
        "r_hat": json.dumps(posterior.rhat),
        "effective_draws": json.dumps(posterior.effective),
        "quantities": json.dumps(list(problem.quantities)),
        "settings": json.dumps([robot.model_dump() for robot in experiment.robots], allow_nan=False),
        "versions": versions(),
        **note_attributes(found.warnings),
    }
    tree.attrs["checksum"] = posterior_checksum({str(name): item for name, item in tree.attrs.items()}, values)
    return tree


def _tails(found: Calibrated) -> list[dict[str, Any]]:
    """Observations of every robot with their errors."""
    problem, experiment = found.problem, found.experiment
    tails = []
    for place, robot in enumerate(experiment.robots):
        seen = {
            name: {
                key: float(values[place])
                for key in ("mean", "trials", "scale", "stated")
                if np.isfinite(values := getattr(problem.ratio(name), key))[place]
            }
            for name in problem.quantities
            if problem.ratio(name).is_observed[place]
        }
        tails.append(
            {
                **_geometry(robot),
                "tail_rate": float(experiment.tail_rate[place]) if np.isfinite(experiment.tail_rate[place]) else None,
                "seen": seen,
                "by_motor": bool(experiment.by_motor[place]),
                "correlation": experiment.correlation,
                "floor": max(LEAST_RELATIVE, problem.interpolation_error),
            }
        )
    return tails


def _friction(found: Calibrated) -> list[dict[str, Any]]:
    return [
        {**_geometry(robot), "value": item.value, "low": item.low, "high": item.high}
        for robot, item in zip(found.experiment.robots, found.friction_given, strict=False)
        if np.isfinite(item.value)
    ]
