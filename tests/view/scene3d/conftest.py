"""Robots and made-up runs to draw; where nothing can be drawn these tests are skipped."""

import json
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import spirillum as sp


@pytest.fixture(scope="session", autouse=True)
def drawing() -> None:
    """Skip where the machine has no off-screen rendering at all; a missing package is a failure."""
    from spirillum.view.scene3d.rendering import new_plotter

    try:
        plotter = new_plotter((32, 32))
    except sp.InputError as error:
        if "cannot draw in 3D" in str(error):
            pytest.skip(str(error))
        raise
    plotter.close()


@pytest.fixture(scope="session")
def free_robot() -> Any:
    """The paper's robot without its channel."""
    return sp.load("biorob2012-wide", channel="none")


def roll(angle: np.ndarray) -> np.ndarray:
    """Quaternions of turns about x."""
    return np.stack([np.cos(0.5 * angle), np.sin(0.5 * angle), 0 * angle, 0 * angle], axis=-1)


@pytest.fixture(scope="session")
def run_of() -> Callable[..., Any]:
    """A made-up free run: even motion along x, even turns of body and tail."""

    def make(robot: Any, *, duration: float = 1.0, speed: float = 0.0, tail: float = 6.0, body: float = -0.5) -> Any:
        import xarray as xr

        time = np.linspace(0.0, duration, 41)
        position = np.stack([speed * time, 0 * time, 0 * time], axis=-1)
        return xr.Dataset(
            {
                "position": (("time", "axis"), position),
                "attitude": (("time", "quaternion"), roll(body * time)),
                "tail_phase": ("time", (tail - body) * time),
            },
            coords={"time": time, "axis": list("xyz"), "quaternion": list("wxyz")},
            attrs={
                "motion": "free",
                "robot": robot.name,
                "model": "slender",
                "settings": json.dumps(robot.model_dump()),
            },
        )

    return make
