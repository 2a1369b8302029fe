"""Synthetic experiments, made by a program with a seed: no number in these tests is measured."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

import spirillum as sp
from spirillum.calibration.posterior import Sampling
from spirillum.robot.batch import RobotBatch
from spirillum.robot.load import load

PRESETS = ("biorob2012-wide", "biorob2012-narrow")
HEADER = "robot,channel_diameter_mm,wavelength_mm,amplitude_mm,trial,forward_velocity_mm_s,tail_rate_Hz,body_rate_Hz"
WAVELENGTHS = (10.0, 15.0, 20.0, 25.0)
AMPLITUDES = (1.5, 2.0, 2.5, 3.5)
SHORT = Sampling(ensembles=2, walkers=160, warm_up=60, steps=120, kept=20, doublings=3)
"""A posterior that passes its own diagnostics: walkers of one step are computed together, many cost little more."""


def synthetic(
    path: Path,
    *,
    model: str = "sbt",
    drag: Sequence[float] = (1.95, 3.6),
    rotation: Sequence[float] = (0.6, 0.6),
    friction: float = 1e-5,
    error: float = 0.02,
    pace: float = 0.03,
    discrepancy: float = 0.0,
    trials: int = 5,
    seed: int = 1,
    presets: Sequence[str] = PRESETS,
    wavelengths: Sequence[float] = WAVELENGTHS,
    amplitudes: Sequence[float] = AMPLITUDES,
    overrides: dict[str, Any] | None = None,
) -> Path:
    """An observations file of the paper's size from a model with planted factors, mm and Hz."""
    rng = np.random.default_rng(seed)
    lines = [f"# synthetic: made by a program with model {model} and seed {seed}", HEADER]
    for number, preset in enumerate(presets):
        robot = load(preset, **{"friction.effective": f"{friction!r} N m s/rad", **(overrides or {})})
        factors = robot.calibration["sbt"].model_copy(
            update={"body_drag": drag[number], "body_rotation": rotation[number]}
        )
        batch = RobotBatch.of(robot.model_copy(update={"calibration": {model: factors}}))
        tails = [(w, a) for w in wavelengths for a in amplitudes]
        columns = {
            "tail.wavelength": [1e-3 * w for w, _ in tails],
            "tail.amplitude": [1e-3 * a for _, a in tails],
        }
        swum = sp.swim(batch.with_values(columns), model)
        assert robot.channel is not None
        for place, (wavelength, amplitude) in enumerate(tails):
            off = 1.0 + discrepancy * rng.normal(size=2)
            for trial in range(trials):
                faster = 1.0 + pace * rng.normal() if error else 1.0
                noise = 1.0 + error * rng.normal(size=2)
                speed = 1e3 * swum.forward_velocity[place] * faster * off[0] * noise[0]
                tail = swum.tail_rotation_rate[place] * faster / (2 * np.pi)
                body = swum.body_rotation_rate[place] * faster * off[1] * noise[1] / (2 * np.pi)
                lines.append(
                    f"{preset},{1e3 * robot.channel.diameter:g},{wavelength:g},{amplitude:g},{trial + 1},"
                    f"{speed:.17g},{tail:.17g},{body:.17g}"
                )
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path
