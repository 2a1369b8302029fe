"""The loop closes: a virtual experiment is filmed, measured from its pixels, calibrated, and predicts a new tail.

Everything here is synthetic. Two tails swim by `sbt` with planted factors on the body's drag and rotation; a virtual
camera films two trials of each. `measure` sees the films, the robot file and the heights of the camera, and nothing
else. `calibrate` has to find the planted factors in what it measured; a tail that was never filmed is then predicted.
"""

import tempfile
from pathlib import Path

import numpy as np

import spirillum as sp
from spirillum.measurement.observations import join_observations

TRUE_DRAG, TRUE_ROTATION = 2.4, 0.8
TAILS = ((15, 2.0), (25, 2.5))


def robot_file(folder: Path, wavelength: float, amplitude: float) -> str:
    """A robot with the planted factors and some tail, mm."""
    name = f"tail-{wavelength}-{amplitude:g}.toml"
    (folder / name).write_text(
        'extends = "biorob2012-wide"\n'
        f'name = "tail-{wavelength}-{amplitude:g}"\n'
        f'[tail]\nwavelength = "{wavelength} mm"\namplitude = "{amplitude} mm"\n'
        f"[calibration.sbt]\nbody_drag = {TRUE_DRAG}\nbody_rotation = {TRUE_ROTATION}\n"
        'source = "planted: synthetic"\n',
        encoding="utf-8",
    )
    return str(folder / name)


with tempfile.TemporaryDirectory() as name:
    folder = Path(name)
    study = {
        "title": "Loop",
        "models": ["sbt"],
        "friction": ["rotor"],
        "robots": [robot_file(folder, *t) for t in TAILS],
    }
    sp.virtual_experiment(
        study,
        folder / "films",
        trials=2,
        motion={"tail_rate": "1.2 Hz"},
        duration="5 s",
        camera={"size": "320x240", "fps": 10},
        seed=1,
    )

    files = []
    for robot in sorted(path for path in (folder / "films").iterdir() if path.is_dir()):
        films = sorted(robot.glob("trial-*.mp4"))
        measured = sp.measure(
            films, robot / "setup.toml", output=folder / "measured" / robot.name, annotated=False, figures=False
        )
        speed = measured.to_dict()["summary"]["forward_velocity"]
        print(f"{robot.name}: {1e3 * speed['value']:.4f} mm/s from {speed['n']} trials")
        files.append(folder / "measured" / robot.name / "observations.csv")
    observations = folder / "observations.csv"
    join_observations(files, observations)

    found = sp.calibrate(observations, "biorob2012-wide", folder, model="sbt", method="least-squares", figures=False)
    for parameter, item in found.values.items():
        print(f"{parameter}: {item.value:.4f} ({item.low:.4f} to {item.high:.4f})")

    new_tail = {"tail.wavelength": "20 mm", "tail.amplitude": "2.2 mm"}
    predicted = sp.predict(
        sp.load("biorob2012-wide", **new_tail), calibration=folder / "calibration.toml", tail_rate="1.2 Hz"
    )
    planted = sp.predict(sp.load(robot_file(folder, 25, 2.5), **new_tail), model="sbt", tail_rate="1.2 Hz")
    speeds = [answer.to_dict()["forward_velocity"]["value"] for answer in (predicted, planted)]
    print(f"a new tail: {1e3 * speeds[0]:.4f} mm/s predicted, {1e3 * speeds[1]:.4f} mm/s planted")

# Films of 50 frames at 320 x 240: speeds to a percent, and factors to what a percent of speed is worth.
assert abs(speeds[0] / speeds[1] - 1) < 0.01
for name, true in (("body_drag", TRUE_DRAG), ("body_rotation", TRUE_ROTATION)):
    assert np.isclose(found.values[name].value, true, rtol=0.03)
