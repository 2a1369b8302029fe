"""A posterior as labelled groups in the layout of ArviZ, with all that a later prediction needs in the attributes."""

from __future__ import annotations

import json
import warnings
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from spirillum.arrays import Samples
from spirillum.calibration.likelihood import LEAST_RELATIVE
from spirillum.fitted.posterior_file import SCHEMA, posterior_checksum
from spirillum.notes import note_attributes
from spirillum.version import versions

if TYPE_CHECKING:
    import xarray as xr

    from spirillum.calibration.calibrated import Calibrated
    from spirillum.calibration.experiment import Quantity
    from spirillum.calibration.posterior import Posterior


def posterior_tree(found: Calibrated) -> xr.DataTree:
    """Groups `posterior`, `log_likelihood` (robot by robot), `observed_data` and `sample_stats` of a posterior."""
    posterior = found.posterior
    assert posterior is not None  # noqa: S101 - the caller has asked
    density, problem, experiment = posterior.density, found.problem, found.experiment
    values = posterior.values()
    units = {item.label: item.parameter.unit or "1" for item in problem.coordinates}
    logs = np.concatenate([density.by_robot(block) for block in np.array_split(posterior.flat, 64)])
    observed = {name: problem.ratio(name).mean for name in problem.quantities}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # many walkers with few draws each are meant
        tree = _tree(posterior, logs, observed, experiment.labels())
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


def _tree(posterior: Posterior, logs: Samples, observed: Mapping[Quantity, Samples], tails: list[str]) -> xr.DataTree:
    from arviz_base import from_dict

    chains, draws, _ = posterior.z.shape
    tree: xr.DataTree = from_dict(
        {
            "posterior": posterior.values(),
            "log_likelihood": {"robot": logs.reshape(chains, draws, len(tails))},
            "sample_stats": {"lp": posterior.density(posterior.flat).reshape(chains, draws)},
            "observed_data": dict(observed),
        },
        dims={"robot": ["tail"], **{str(name): ["tail"] for name in observed}},
        coords={"tail": np.array(tails, dtype=str)},
    )
    return tree


def _tails(found: Calibrated) -> list[dict[str, Any]]:
    """What was observed of every robot, and how well."""
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
            if problem.ratio(name).seen[place]
        }
        tails.append(
            {
                "channel_diameter": robot.channel.diameter if robot.channel else None,
                "wavelength": robot.tail.wavelength,
                "amplitude": robot.tail.amplitude,
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
        {
            "channel_diameter": robot.channel.diameter if robot.channel else None,
            "wavelength": robot.tail.wavelength,
            "amplitude": robot.tail.amplitude,
            "value": item.value,
            "low": item.low,
            "high": item.high,
        }
        for robot, item in zip(found.experiment.robots, found.friction_given, strict=False)
        if np.isfinite(item.value)
    ]
