"""Tracks with a known truth, made by hand."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from spirillum.measurement.trials import Trial, trial_of
from spirillum.robot.load import load
from spirillum.vision.camera.scale import Scale
from spirillum.vision.flag import Flag
from spirillum.vision.setup import Setup
from spirillum.vision.track.track import Track

SETUP = """\
[camera]
height = "210 mm"
height_uncertainty = "2 mm"

[tank]
surface = "60 mm"

[markers]
spacing = "2 mm"
height = "0 mm"

[robot]
file = "biorob2012-wide"
axis_height = "11.5 mm"
axis_height_uncertainty = "1 mm"
"""
PIXEL = 0.25e-3


@pytest.fixture(scope="session")
def robot() -> Any:
    return load("biorob2012-wide")


@pytest.fixture
def setup_text() -> str:
    return SETUP


@pytest.fixture(scope="session")
def make_track() -> Callable[..., Track]:
    """A track of a steady robot with white errors."""
    import tomllib

    def make(
        *,
        velocity: float = 1e-3,
        body: float = -0.7,
        tail: float = 7.0,
        seed: int = 0,
        scale_error: float = 0.0,
        span: float = 10.0,
        video: str = "a.mp4",
        wobble: float = 0.0,
        flags: tuple[Flag, ...] = (),
    ) -> Track:
        rng = np.random.default_rng(seed)
        time = np.arange(round(30 * span)) / 30.0
        error = np.ones(time.size)
        position = np.stack([velocity * time, wobble * np.sin(tail * time)], axis=1)
        position += 1e-5 * rng.normal(size=position.shape)
        middle = np.stack([position[:, 0] / PIXEL, -position[:, 1] / PIXEL], axis=1) + np.array([319.5, 239.5])
        return Track(
            time=time,
            frame=np.arange(time.size, dtype=float),
            position=position,
            heading=1e-3 * rng.normal(size=time.size),
            body_angle=body * time + 5e-3 * rng.normal(size=time.size),
            tail_phase=tail * time + 0.02 * rng.normal(size=time.size),
            position_error=1e-5 * error,
            body_angle_error=5e-3 * error,
            tail_phase_error=0.02 * error,
            picture=np.concatenate([middle, middle + np.array([70.0, 0.0])], axis=1),
            size=(640, 480),
            scale=Scale(PIXEL, scale_error, {"robot.axis_height": scale_error} if scale_error else {}, 80, 0.05),
            setup=Setup.model_validate(tomllib.loads(SETUP)),
            video=video,
            flags=flags,
        )

    return make


@pytest.fixture(scope="session")
def make_trial(make_track: Callable[..., Track], robot: Any) -> Callable[..., Trial]:
    """The trial of a track; that of the same track is measured once."""
    known: dict[str, Trial] = {}

    def make(name: str = "", **track: Any) -> Trial:
        if (key := repr(sorted(track.items()))) not in known:
            known[key] = trial_of(make_track(**track), robot)
        return replace(known[key], name=name)

    return make


@pytest.fixture
def setup_file(tmp_path: Path, setup_text: str) -> Path:
    """A setup file."""
    path = tmp_path / "setup.toml"
    path.write_text(setup_text)
    return path
