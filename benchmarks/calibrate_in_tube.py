"""How long do fits of gap, pitch and friction in the tube take, against solving for the flow at one place?

    OMP_NUM_THREADS=1 python benchmarks/calibrate_in_tube.py

Synthetic observations of both presets with the model `tube`; least squares, then the posterior. The baseline is one
place of one robot, solved without a table. Processor time, warm; the target is a minute for each fit.
"""

from __future__ import annotations

import json
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import spirillum as sp
from spirillum.robot.batch import RobotBatch
from spirillum.robot.load import PAPER_ROBOTS, load
from spirillum.robot.placement import Placement

FREE = "gap,pitch,friction"


def observations(path: Path) -> Path:
    """Five trials of each preset at a planted place, with errors of one per cent."""
    rng = np.random.default_rng(1)
    lines = [
        "# synthetic",
        "channel_diameter_mm,wavelength_mm,amplitude_mm,trial,forward_velocity_mm_s,tail_rate_Hz,body_rate_Hz",
    ]
    for name, channel in zip(PAPER_ROBOTS, (40, 30), strict=True):
        answer = sp.predict(name, model="tube", placement={"gap": "0.4 mm", "pitch": "1 deg"}, friction="rotor")
        tail = answer.tail_rotation_rate / (2 * np.pi)
        for trial in range(5):
            speed, body = (1.0 + 0.01 * rng.normal(size=2)) * [answer.forward_velocity, answer.body_rotation_rate]
            lines.append(f"{channel},25,2.5,{trial},{1e3 * speed:.6g},{tail:.6g},{body / (2 * np.pi):.6g}")
    path.write_text("\n".join(lines) + "\n")
    return path


def seconds(work: Callable[[], Any]) -> float:
    """Processor time of some work."""
    start = time.process_time()
    work()
    return time.process_time() - start


def main() -> None:
    batch = RobotBatch.of(load(PAPER_ROBOTS[0]), Placement.of({"gap": "0.4 mm", "pitch": "1 deg"}))
    with tempfile.TemporaryDirectory() as folder:
        path = observations(Path(folder) / "observations.csv")

        def fit(method: str) -> Any:
            return sp.calibrate(path, list(PAPER_ROBOTS), model="tube", free=FREE, method=method)

        fit("least-squares")  # compiles
        fast = seconds(lambda: fit("least-squares"))
        posterior = seconds(lambda: fit("posterior"))
    place = seconds(lambda: sp.swim(batch, "tube", tail_rate=np.ones(1), friction="none"))
    print(
        json.dumps(
            {
                "question": f"calibrate --model tube --free {FREE} on both presets, tables there",
                "one_place_solved_s": place,
                "least_squares_s": fast,
                "posterior_s": posterior,
                "posterior_over_one_place": posterior / place,
                "target_s": 60.0,
            },
            indent=2,
        )
    )


if __name__ == "__main__":
    main()
