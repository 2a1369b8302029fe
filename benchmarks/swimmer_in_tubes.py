"""Does a one-piece swimmer move in its tube as others' computation says?

Caldag and Yesilyurt (J. Fluids Struct. 90:164, 2019) followed a magnetic swimmer in a closed tube of 3 mm by finite
volumes: a cylinder of 1.5 x 0.8 mm with a left-handed helix of four turns. The swimmer here has the same
dimensions, but a root of the tail of 0.12 mm, where theirs is joined to the head. A puller spirals to the tube's axis,
a pusher out to the wall and around it. Their contact cancels the radial force within 0.1 mm of the wall, without
friction or film: here a roughness as high as that carries the swimmer, without friction. Their values hold to 15 %.

    OMP_NUM_THREADS=1 python benchmarks/swimmer_in_tubes.py [--turns 60]

Speeds in wavelengths a turn, orbits in turns about the tube's axis a turn of the swimmer, in the sense of its rotation;
the decay is that of the logarithm of the distance from the axis. The table takes 50 minutes of one core, once. A run
ends where the swimmer leaves its table: it yaws by more than 11 degrees.
"""

from __future__ import annotations

import argparse
import json
import time
from typing import Any

import numpy as np
import xarray as xr

import spirillum as sp

WAVELENGTH, ROUGHNESS = 1e-3, 1e-4
_BEFORE_IT_TILTS = 16.0
"""Turns after which the puller, let go near the axis, has tilted by 5 degrees."""
PUBLISHED = {
    "puller, 3 mm": {"decay": -0.0198, "orbit": 0.0372},
    "puller, 3 mm, near the axis": {"decay": -0.0198, "orbit": 0.0372},
    "pusher, 3 mm": {"radius_mm": 0.998, "orbit": 0.0379, "tilt_deg": 5.8, "speed": 0.157},
}
"""As reduced from the files that the authors deposited."""


def swimmer(diameter: str, rate: str) -> dict[str, Any]:
    """Tables of the swimmer in a closed tube; weightless, for its density is not said to matter."""
    return {
        "name": f"swimmer-{diameter.replace(' ', '')}",
        "body": {
            "shape": "cylinder",
            "diameter": "0.8 mm",
            "length": "1.5 mm",
            "front": "fillet",
            "rear": "fillet",
            "fillet": "0.1 mm",
        },
        "coupling": {"diameter": "0.2 mm", "length": "0.12 mm", "clearance": "0.005 mm"},
        "tail": {
            "wavelength": "1 mm",
            "amplitude": "0.29 mm",
            "length": "4 mm",
            "wire_diameter": "0.2 mm",
            "handedness": "left",
            "taper": "none",
        },
        "fluid": {"viscosity": "1.412 Pa s", "density": "1261 kg/m^3"},
        "channel": {"diameter": diameter, "length": "30 mm"},
        "drive": {"kind": "rate", "joint": "fixed", "rate": rate},
    }


def run(diameter: str, rate: str, eccentricity: float, turns: float) -> xr.Dataset:
    """The swimmer's motion from a distance from the axis, over that at which it touches."""
    return sp.simulate(
        swimmer(diameter, rate),
        model="tube",
        timing={"turns": turns, "samples_per_turn": 24},
        placement={"eccentricity": eccentricity, "ends": "closed"},
        weight=False,
        roughness=ROUGHNESS,
        in_tube={"friction_coefficient": 0.0},
    )


def read(found: xr.Dataset, first: float, last: float) -> dict[str, float]:
    """What is compared, between two shares of a run.

    Args:
        found: the run.
        first: share of it from which on it is read.
        last: share of it up to which it is read.
    """
    moments = found["time"].values
    part = (moments >= first * moments[-1]) & (moments <= last * moments[-1])
    turns = found["body_angle"].values[part] / (2.0 * np.pi)
    turns = np.abs(turns - turns[0])
    sense = np.sign(found["body_angle"].values[-1] - found["body_angle"].values[0])
    radius, azimuth = found["offset"].values[part], np.unwrap(found["azimuth"].values[part])
    tilt = np.hypot(found["pitch"].values[part], found["yaw"].values[part])
    along = found["position"].values[part, 0]

    def slope(values: np.ndarray) -> float:
        return float(np.polyfit(turns, values, 1)[0])

    return {
        "decay": slope(np.log(radius)),
        "orbit": sense * slope(azimuth) / (2.0 * np.pi),
        "radius_mm": float(1e3 * radius.mean()),
        "tilt_deg": float(np.degrees(tilt.mean())),
        "speed": abs(slope(along)) / WAVELENGTH,
    }


def main() -> None:
    """Run, compare, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--turns", type=float, default=60.0)
    turns = parser.parse_args().turns
    cases = {
        "puller, 3 mm": ("3 mm", "8 Hz", 0.6, (0.1, 0.9), turns),
        "puller, 3 mm, near the axis": ("3 mm", "8 Hz", 0.2, (0.0, 1.0), min(turns, _BEFORE_IT_TILTS)),
        "pusher, 3 mm": ("3 mm", "-8 Hz", 0.6, (0.8, 1.0), turns),
    }
    answer = {}
    for name, (diameter, rate, eccentricity, share, length) in cases.items():
        start = time.process_time()
        found = read(run(diameter, rate, eccentricity, length), *share)
        answer[name] = {
            what: {"here": found[what], "published": value, "ratio": found[what] / value}
            for what, value in PUBLISHED[name].items()
        } | {"seconds": time.process_time() - start}
    print(json.dumps(answer, indent=2))


if __name__ == "__main__":
    main()
