"""From a robot of one's own to a prediction, a small study, a figure, and the friction at an observed rate.

Run it with a folder for its files, or without one in a temporary folder: python examples/theory_in_python.py [FOLDER]
"""

import sys
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr

import spirillum as sp
from spirillum.fluid.closed.perrin import body_axial
from spirillum.fluid.closed.sbt import tail_axial

Hz = 2 * np.pi  # one turn per second in rad/s

ROBOT = """\
extends = "biorob2012-wide"
name = "long-wave"
description = "The robot of the paper with a tail of our own"

[tail]
wavelength = "30 mm"
amplitude = "2 mm"
"""


def a_robot_of_our_own(folder: Path) -> sp.Robot:
    """Write a robot file that changes a preset, and load it."""
    path = folder / "long-wave.toml"
    path.write_text(ROBOT, encoding="utf-8")
    robot = sp.load(path)
    for name, item in robot.derived().items():
        print(f"{name:20} {item.value:10.4g} {item.unit}")
    assert robot.tail.wavelength == 0.030  # SI inside
    return robot


def a_prediction(robot: sp.Robot) -> sp.Prediction:
    """Predict at a given tail rate, where no friction has to be known."""
    slow = sp.predict(robot, model="sbt", tail_rate="1.2 Hz")
    fast = sp.predict(robot, model="sbt", tail_rate="2.4 Hz")
    speed, body = 1e3 * slow.forward_velocity, slow.body_rotation_rate / Hz
    print(f"at 1.2 Hz: {speed:.3f} mm/s, body {body:.3f} Hz")
    # Stokes flow has no memory and no scale of speed: twice the rate is twice the speed.
    assert np.isclose(fast.forward_velocity, 2 * slow.forward_velocity, rtol=1e-12)
    return slow


def a_small_study() -> xr.Dataset:
    """Twenty-eight tails in both channels."""
    dataset = sp.study(
        {
            "title": "Wavelengths and amplitudes",
            "models": ["sbt", "rft"],
            "friction": ["none"],
            "grid": {
                "channels": {"wide": "biorob2012-wide", "narrow": "biorob2012-narrow"},
                "wavelengths": [f"{value} mm" for value in (10, 15, 20, 25, 30, 40, 60)],
                "amplitudes": ["1.5 mm", "2 mm", "2.5 mm", "3.5 mm"],
            },
        }
    )
    advance = dataset["advance_per_radian"].sel(friction="none")
    best = advance.sel(channel="wide", model="sbt").idxmax("wavelength")
    for amplitude, wavelength in zip(best["amplitude"].values, best.values, strict=True):
        print(f"{1e3 * amplitude:.1f} mm: farthest per turn at wavelength {1e3 * wavelength:.0f} mm")
    return dataset


def the_loss_in_the_narrow_channel(dataset: xr.Dataset) -> None:
    """At equal tail rates the calibrated drag decides alone, in closed form."""
    sbt = dataset.sel(friction="none", model="sbt")
    advance = sbt["advance_per_radian"].sel(wavelength=0.025, amplitude=0.0025)
    loss = 1 - float(advance.sel(channel="narrow") / advance.sel(channel="wide"))

    # (f D_x + B11) U + B14 omega = 0: U goes as 1/(f D_x + B11).
    batch = sp.RobotBatch.of(sp.load("biorob2012-wide"))
    body, tail = body_axial(batch)[0][0], tail_axial(batch)[0][0]
    expected = 1 - (1.95 * body + tail) / (3.6 * body + tail)
    print(f"slower by {100 * loss:.2f} %, in closed form {100 * expected:.2f} %")
    assert np.isclose(loss, expected, rtol=1e-10)


def a_figure(dataset: xr.Dataset, path: Path) -> None:
    """Plot with xarray's own labels, one panel a model."""
    advance = dataset["advance_per_radian"].sel(friction="none", channel="wide")
    per_turn = 1e3 * 2 * np.pi * advance
    for name in ("wavelength", "amplitude"):
        per_turn[name] = 1e3 * advance[name]
        per_turn[name].attrs = {"long_name": name, "units": "mm"}
    per_turn.attrs = {"long_name": "advance per turn of the tail", "units": "mm"}
    grid = per_turn.plot.line(x="wavelength", col="model", hue="amplitude", marker="o", figsize=(9, 3.4))
    grid.fig.savefig(path, dpi=110)
    plt.close(grid.fig)


def friction_at_an_observed_rate(folder: Path) -> None:
    """Infer B_eff from a synthetic rate, which was made with a known friction."""
    known = 1.1e-5  # N m s/rad, chosen for this example
    robot = sp.load("biorob2012-wide", **{"friction.effective": f"{known} N m s/rad"})
    rate = sp.predict(robot, model="sbt").tail_rotation_rate / Hz

    inferred = sp.predict("biorob2012-wide", model="sbt", tail_rate=f"{rate!r} Hz")
    print(f"at {rate:.3f} Hz (synthetic): {inferred.effective_friction:.4g} N m s/rad")
    assert np.isclose(inferred.effective_friction, known, rtol=1e-9)

    # The same for a whole study: an observations file, here with one synthetic row.
    observations = folder / "observations.csv"
    observations.write_text(
        "# SYNTHETIC: computed with B_eff = 1.1e-5 N m s/rad, not measured\n"
        "channel_diameter_mm,wavelength_mm,amplitude_mm,tail_rate_Hz\n"
        f"40,25,2.5,{rate!r}\n",
        encoding="utf-8",
    )
    dataset = sp.study(observations=observations)
    found = dataset["effective_friction_at_observed_rate"].sel(
        channel="wide",
        wavelength=0.025,
        amplitude=0.0025,
        model="sbt",
        friction="rotor",
    )
    assert np.isclose(float(found), known, rtol=1e-9)


def main(folder: Path) -> None:
    """Tell the story from start to end."""
    robot = a_robot_of_our_own(folder)
    a_prediction(robot)
    dataset = a_small_study()
    the_loss_in_the_narrow_channel(dataset)
    a_figure(dataset, folder / "advance-per-turn.png")
    friction_at_an_observed_rate(folder)


if __name__ == "__main__":
    if len(sys.argv) > 1:
        main(Path(sys.argv[1]))
    else:
        with tempfile.TemporaryDirectory() as temporary:
            main(Path(temporary))
