"""What does the form of the wire cost the forward velocity in a tube: `standard` wires against `high` ones?

The paper's tails in its tubes at a prescribed rate, from the same coarse resolution of waves and modes with both forms
of the wire, averaged over three phases. The shipped tables, solved with `standard` wires, have their thrust multiplied
by these ratios; the largest of them is the error stated of a tail too long for `high` wires.

    OMP_NUM_THREADS=1 python benchmarks/tube_wires.py
"""

from __future__ import annotations

import json
from typing import Any

import numpy as np

import spirillum as sp
from spirillum.fluid.tube.tube import Tube
from spirillum.fluid.wire.stokeslets import Accuracy
from spirillum.swimming.preparation import prepared
from spirillum.swimming.steady import swim

TUBES = ("biorob2012-wide", "biorob2012-narrow")
TAILS = [(wavelength, amplitude) for wavelength in (25, 20, 15, 10) for amplitude in (1.5, 2.0, 2.5, 3.5)]
LEVEL = {"eccentricity": 0.3, "pitch": "0 deg"}
PLACES = [
    {"gap": "0.3 mm", "pitch": "0 deg"},
    {"gap": "0.5 mm", "pitch": "0 deg"},
    {"gap": "0.4 mm", "pitch": "1 deg"},
]
"""Other places of the paper's tail of 25 and 2.5 mm."""
COARSER = 10.0


def gained(tube: str, wavelength: float, amplitude: float, place: dict[str, Any]) -> float:
    """By how much `high` wires are faster than `standard` ones, percent."""
    robot = sp.load(tube, **{"tail.wavelength": f"{wavelength} mm", "tail.amplitude": f"{amplitude} mm"})
    speeds = []
    forms: tuple[Accuracy, ...] = ("standard", "high")
    for accuracy in forms:
        resolution = {"tolerance": 0.05, "phases": 3}
        _, _, batch = prepared(robot, "tube", resolution=resolution, placement=place)
        swum = swim(batch, Tube(COARSER, wire=accuracy), tail_rate=np.array([2.4 * np.pi]), friction="none")
        speeds.append(float(swum.forward_velocity[0]))
    return 100.0 * (speeds[1] / speeds[0] - 1.0)


def main() -> None:
    found = [
        {"tube": tube, "tail": [wavelength, amplitude], **place, "percent": gained(tube, wavelength, amplitude, place)}
        for tube in TUBES
        for wavelength, amplitude in TAILS
        for place in (LEVEL, *(PLACES if (wavelength, amplitude) == (25, 2.5) else []))
    ]
    print(json.dumps({"question": "speed with high wires over that with standard ones", "rows": found}, indent=1))


if __name__ == "__main__":
    main()
