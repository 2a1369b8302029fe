"""From walls to a film and back: a run in the tube, seen by the virtual camera, is measured as what it was."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import spirillum as sp

RADIUS, START, LENGTH = 0.009, 4.0, 9.8
"""Of the body, m; begin and length of the film in the run, s."""
HELD = 5.3e-4
"""Speed of the robot held in its tube, m/s: on its film it is slower, and a camera resolves lengths, not shares."""


@pytest.fixture(scope="module")
def run() -> xr.Dataset:
    timing = {"duration": "14 s", "samples_per_turn": 40}
    return sp.simulate("biorob2012-wide", model="tube", timing=timing, in_tube={"wait": "0 s"})


@pytest.mark.slow
def test_run_in_the_tube_is_measured_within_the_stated_intervals(run: xr.Dataset, tmp_path: Path) -> None:
    """From above one sees the top of the body, which a nose that rises moves back by the radius (known limit L50)."""
    late = run.sel(time=slice(START, None))
    film = tmp_path / "film.mp4"
    sp.render("biorob2012-wide", film, run=late, trial={"duration": LENGTH}, camera={"size": "400x300", "fps": 10.0})
    found = sp.measure(film, film.with_suffix(".setup.toml"), annotated=False, figures=False).trials[0].quantities

    ends = float(late["time"][0]) + np.array([0.0, LENGTH])

    def rate(values: object) -> float:
        return float(np.diff(np.interp(ends, late["time"], values))[0]) / LENGTH

    seen = late["position"][:, 0] - RADIUS * np.sin(late["pitch"])
    truth = {
        "forward_velocity": rate(seen),
        "body_rotation_rate": rate(late["body_angle"]),
        "tail_rotation_rate": rate(late["tail_angle"]),
    }
    for name, value in truth.items():
        assert found[name].low < value < found[name].high, name
        narrow = {"forward_velocity": 0.02 * HELD, "body_rotation_rate": 0.2 * abs(value)}
        assert found[name].high - found[name].low < narrow.get(name, 0.02 * abs(value)), name
    assert rate(late["azimuth"]) < 0.0  # a film carries it the way in which its body turns
    assert truth["body_rotation_rate"] < 0.0


@pytest.mark.slow
def test_a_robot_that_settles_on_film_is_flagged_and_its_speed_lies_in_the_interval(
    run: xr.Dataset, tmp_path: Path
) -> None:
    """In its first four seconds its nose rises by a degree, which hides a tenth of its way, and its body slows down."""
    film, length = tmp_path / "film.mp4", 3.9
    sp.render("biorob2012-wide", film, run=run, trial={"duration": length})
    trial = sp.measure(film, film.with_suffix(".setup.toml"), annotated=False, figures=False).trials[0]
    assert {"ends-drift-apart", "not-steady-body-rotation-rate"} <= {flag.name for flag in trial.flags}
    speed = float(np.interp(length, run["time"], run["position"][:, 0])) / length
    found = trial.quantities["forward_velocity"]
    assert found.low < speed < found.high
    assert found.value < 0.96 * speed
