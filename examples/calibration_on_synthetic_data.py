"""From observations to parameters and back: a planted truth is found again, with its uncertainty. Synthetic data.

A program makes an experiment of six tails and five trials each with `sbt` and planted factors, and errors of 2 %.
`calibrate` fits it; a tail that was not in the experiment is then predicted with an interval, which holds its truth.
"""

import tempfile
from pathlib import Path

import numpy as np

import spirillum as sp
from spirillum.robot.batch import RobotBatch

TRUE_DRAG, TRUE_ROTATION = 2.4, 0.8
ROBOT = "biorob2012-wide"


def truth(wavelength: float, amplitude: float) -> sp.Swimming:
    """The planted robot with some tail, mm."""
    robot = sp.load(ROBOT, **{"tail.wavelength": f"{wavelength} mm", "tail.amplitude": f"{amplitude} mm"})
    planted = {"body_drag": TRUE_DRAG, "body_rotation": TRUE_ROTATION}
    factors = {"sbt": robot.calibration["sbt"].model_copy(update=planted)}
    friction = robot.friction.model_copy(update={"effective": 1.1e-5})
    return sp.swim(RobotBatch.of(robot.model_copy(update={"calibration": factors, "friction": friction})), "sbt")


rng = np.random.default_rng(6)
rows = ["# synthetic: nothing here is measured"]
rows.append("channel_diameter_mm,wavelength_mm,amplitude_mm,trial,forward_velocity_mm_s,tail_rate_Hz,body_rate_Hz")
for wavelength, amplitude in ((10, 1.5), (10, 3.0), (15, 2.5), (20, 1.5), (25, 2.0), (25, 3.0)):
    swum = truth(wavelength, amplitude)
    for trial in range(1, 6):
        speed, rate, body = (
            values[0] * (1 + error * rng.normal())
            for values, error in (
                (1e3 * swum.forward_velocity, 0.02),
                (swum.tail_rotation_rate / (2 * np.pi), 0.005),
                (swum.body_rotation_rate / (2 * np.pi), 0.02),
            )
        )
        rows.append(f"40,{wavelength},{amplitude},{trial},{speed:.5g},{rate:.5g},{body:.5g}")

with tempfile.TemporaryDirectory() as folder:
    observations = Path(folder) / "observations.csv"
    observations.write_text("\n".join(rows) + "\n", encoding="utf-8")
    found = sp.calibrate(observations, ROBOT, folder, model="sbt", figures=False)
    for name, item in found.values.items():
        print(f"{name}: {item.value:.3f} ({item.low:.3f} to {item.high:.3f})")

    new_tail = sp.load(ROBOT, **{"tail.wavelength": "18 mm", "tail.amplitude": "2.2 mm"})
    own = truth(18, 2.2)
    answer = sp.predict(new_tail, posterior=Path(folder) / "posterior.nc", tail_rate=float(own.tail_rotation_rate[0]))

assert found.converged
# 99.9 % of such experiments: 3.3 standard deviations of the posterior's 1.96.
for name, planted in (("body_drag", TRUE_DRAG), ("body_rotation", TRUE_ROTATION)):
    item = found.values[name]
    assert abs(item.value - planted) < 3.3 / 1.96 * 0.5 * (item.high - item.low)
assert answer.intervals is not None
low, high = (1e3 * side["forward_velocity"] for side in (answer.intervals.low, answer.intervals.high))
true_speed = 1e3 * float(own.forward_velocity[0])
print(f"a new tail: {1e3 * answer.forward_velocity:.3f} mm/s ({low:.3f} to {high:.3f}), truth {true_speed:.3f} mm/s")
assert low < true_speed < high
