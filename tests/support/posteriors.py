"""A posterior written by hand, true to its form or forged."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from spirillum.fitted.posterior_file import SCHEMA, posterior_checksum, write_posterior
from spirillum.robot.load import load

TAIL = {"channel_diameter": 0.04, "wavelength": 0.025, "amplitude": 0.0025}


def attributes() -> dict[str, Any]:
    """What a posterior of one robot with a free body drag says of itself."""
    seen = {name: {"mean": 0.001, "trials": 5.0, "scale": 0.001} for name in ("advance", "turning")}
    tail = {**TAIL, "seen": seen, "by_motor": False, "correlation": 0.5, "floor": 1e-3}
    return {
        "schema": SCHEMA,
        "converged": 1,
        "observations": "o.csv",
        "sha256": "0" * 64,
        "synthetic": 1,
        "model": "sbt",
        "free": json.dumps(["body_drag"]),
        "channels": json.dumps([0.04]),
        "parameters": json.dumps([{"label": "body_drag", "parameter": "body_drag", "channel": 0}]),
        "friction_reading": "rotor",
        "friction": json.dumps([{**TAIL, "value": 1e-5, "low": 0.9e-5, "high": 1.1e-5}]),
        "tails": json.dumps([tail]),
        "quantities": json.dumps(["advance", "turning"]),
        "settings": json.dumps([load("biorob2012-wide").model_dump()]),
    }


def write_trials(path: Path, free: dict[str, float], answer: str = "trial") -> Path:
    """Write a posterior of trials by `tube`, with draws a tenth about some numbers."""
    about = attributes() | {"model": "tube", "answer": answer, "friction": "[]", "free": json.dumps(list(free))}
    parameters = [{"label": name, "parameter": name, "channel": None} for name in free]
    rng = np.random.default_rng(4)
    draws = {name: rng.lognormal(np.log(middle), 0.1, (4, 100)) for name, middle in free.items()}
    return write(path, about | {"parameters": json.dumps(parameters)}, draws)


def write(path: Path, about: dict[str, Any] | None = None, draws: Any = None) -> Path:
    """Write a posterior with its checksum."""
    rng = np.random.default_rng(1)
    about = attributes() if about is None else about
    draws = rng.lognormal(0.6, 0.05, (4, 100)) if draws is None else draws
    values = dict(draws) if isinstance(draws, dict) else {"body_drag": draws}
    size = next(iter(values.values())).shape
    for name in ("advance", "turning"):
        values |= {f"{kind}_{name}": rng.lognormal(-3.0, 0.1, size) for kind in _KINDS}
    posterior = xr.Dataset({name: (("chain", "draw"), array) for name, array in values.items()})
    tree = xr.DataTree.from_dict({"/": xr.Dataset(), "/posterior": posterior})
    tree.attrs = {**about, "checksum": posterior_checksum(about, values)}
    write_posterior(tree, path)
    return path


_KINDS = ("discrepancy", "error")
