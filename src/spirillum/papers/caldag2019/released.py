"""Orbit, decay, tilt and speed of the swimmer released in its tube, weightless and without friction.

Their contact cancels the radial force within 0.1 mm of the wall, without friction or film: here a roughness as high as
that carries the swimmer. A run ends where the swimmer leaves its table: it yaws by more than 11 degrees.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from spirillum.arrays import Samples
from spirillum.dynamics.simulation import simulate
from spirillum.robot.robot import Robot

_ROUGHNESS, _SAMPLES = 1e-4, 24


def released_motion(robot: Robot, run: Mapping[str, Any]) -> dict[str, float]:
    """Return what was published of a run, over a share of it, per turn of the swimmer.

    Args:
        robot: the swimmer in its tube.
        run: `eccentricity` of the start, `turns`, and `first` and `last`, the share of the run that is read.

    Returns:
        `decay` of the logarithm of the distance from the axis; `orbit`, turns about the axis in the sense of the own
        rotation; mean `radius`, m; mean `tilt`, rad; `advance`, m.
    """
    found = simulate(
        robot,
        model="tube",
        timing={"turns": run["turns"], "samples_per_turn": _SAMPLES},
        placement={"eccentricity": run["eccentricity"], "ends": "closed"},
        weight=False,
        roughness=_ROUGHNESS,
        in_tube={"friction_coefficient": 0.0},
    )
    time, angle = found["time"].values, found["body_angle"].values
    part = (time >= run["first"] * time[-1]) & (time <= run["last"] * time[-1])
    sense = float(np.sign(angle[-1] - angle[0]))
    turns = sense * angle[part] / (2.0 * np.pi)

    def slope(values: Samples) -> float:
        return float(np.polyfit(turns, values, 1)[0])

    radius, azimuth = found["offset"].values[part], np.unwrap(found["azimuth"].values[part])
    return {
        "decay": -slope(np.log(radius)),
        "orbit": sense * slope(azimuth) / (2.0 * np.pi),
        "radius": float(radius.mean()),
        "tilt": float(np.hypot(found["pitch"].values[part], found["yaw"].values[part]).mean()),
        "advance": abs(slope(found["position"].values[part, 0])),
    }
