"""Orbit, decay, tilt and speed of the swimmer released in its tube, weightless and without friction.

Their contact cancels the radial force within 0.1 mm of the wall, without friction or film: here a roughness as high as
that carries the swimmer. Their field turns from the start: a swimmer without weight would not move while it waits.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from spirillum.arrays import Flags, Samples
from spirillum.dynamics.simulation import simulate
from spirillum.errors import InputError
from spirillum.progress import Progress
from spirillum.robot.robot import Robot

_SAMPLES = 24  # samples a turn


def released_motion(robot: Robot, run: Mapping[str, Any], progress: Progress | None = None) -> dict[str, float]:
    """Published quantities per turn: growth of log distance, orbits, mean radius (m), mean tilt (rad), advance (m)."""
    found = simulate(
        robot,
        model="tube",
        timing={"turns": run["turns"], "samples_per_turn": _SAMPLES},
        placement={"eccentricity": run["eccentricity"], "ends": "closed"},
        weight=False,
        roughness=run.get("roughness", 1e-4),
        in_tube={"friction_coefficient": 0.0, "wait": run.get("wait", 0.0)},
        progress=progress,
    )
    turns = found["body_angle"].values / (2.0 * np.pi)
    sense = float(np.sign(turns[-1] - turns[0]))
    turns = sense * turns
    if turns[-1] < 0.99 * run["turns"]:
        raise InputError(f"{robot.name}: the run ends after {turns[-1]:.3g} of {run['turns']} turns")
    growing, read = ((turns >= first) & (turns <= last) for first, last in (run["growth"], run["read"]))

    def slope(values: Samples, part: Flags) -> float:
        return float(np.polyfit(turns[part], values[part], 1)[0])

    radius, azimuth = found["offset"].values, np.unwrap(found["azimuth"].values)
    return {
        "growth": slope(np.log(radius), growing),
        "orbit": sense * slope(azimuth, read) / (2.0 * np.pi),
        "radius": float(radius[read].mean()),
        "tilt": float(np.hypot(found["pitch"].values, found["yaw"].values)[read].mean()),
        "advance": abs(slope(found["position"].values[:, 0], read)),
    }
