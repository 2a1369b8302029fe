"""The flow at a moment of a run: solved for anew, its traction carries the robot's weight, wherever it lies."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
import xarray as xr

import spirillum as sp

AZIMUTH = 0.4


@pytest.fixture(scope="module")
def run() -> xr.Dataset:
    """Far from the wall, above the lowest place and to the side: sinking, with its tail turning."""
    timing = {"duration": "0.1 s"}
    return sp.simulate(
        "biorob2012-wide", model="tube", placement={"gap": "6 mm"}, in_tube={"azimuth": AZIMUTH}, timing=timing
    )


@pytest.mark.slow
def test_traction_carries_the_weight_and_nothing_along_the_tube(run: xr.Dataset) -> None:
    """The table moved it, a coarse solution of the flow answers: to their errors."""
    flow = sp.flow_of_run(run, 0.0, resolution={"tolerance": 0.05})
    weight = sp.load("biorob2012-wide").derived()["submerged_weight"].value
    force, seat = flow.field.wrench()[:3], flow.seat
    assert seat is not None
    up, right = seat.across @ force
    assert up == pytest.approx(-weight * np.cos(AZIMUTH), rel=0.03)
    assert abs(right) == pytest.approx(weight * np.sin(AZIMUTH), rel=0.03)
    assert abs(force @ seat.forward) < 1e-3 * weight
    assert flow.held_force == pytest.approx(weight, rel=0.03)
    assert flow.prediction.tail_rotation_rate == float(run["tail_rotation_rate"][0])


@pytest.mark.slow
def test_near_the_glass_the_sideways_force_is_still_the_weight() -> None:
    """Yawed, pitched and moving at a gap of half a millimetre: with four nodes of a panel it is off by a quarter."""
    flow = sp.flow_of_run(sp.simulate("biorob2012-wide", model="tube", timing={"duration": "0.1 s"}), 0.1)
    weight = sp.load("biorob2012-wide").derived()["submerged_weight"].value
    assert flow.held_force == pytest.approx(weight, rel=0.03)


@pytest.mark.parametrize(
    ("time", "options", "words"),
    [
        ("1 s", {}, "time = 1 s is outside the run; allowed: 0 s to 0.1 s"),
        ("1", {}, 'time = "1" has no unit'),
        ("0 s", {"frame": "tail"}, "frame = 'tail'; allowed: lab, body"),
    ],
)
def test_wrong_moments_are_refused(run: xr.Dataset, time: str, options: dict[str, Any], words: str) -> None:
    with pytest.raises(sp.InputError, match=re.escape(words)):
        sp.flow_of_run(run, time, **options)


def test_a_thin_film_is_drawn_as_thick_as_a_fiftieth_of_the_body(run: xr.Dataset, monkeypatch: Any) -> None:
    """Of a yawed robot a thinner one takes many minutes; nothing is solved here."""
    lying = run.isel(time=[0]).assign(wall_gap=("time", [1e-6]), wall_yaw=("time", [0.06]), offset=("time", [0.011]))
    asked: list[Any] = []

    def field(batch: Any, *_: Any) -> None:
        asked.append(batch.placement)
        raise sp.InputError("enough")

    monkeypatch.setattr("spirillum.dynamics.flow_of_run.tube_flow_field", field)
    with pytest.raises(sp.InputError, match="enough"):
        sp.flow_of_run(lying, 0.0)
    assert asked[0].gap == pytest.approx(0.02 * sp.load("biorob2012-wide").body.diameter)
    assert asked[0].yaw == 0.06


def test_the_sample_that_is_taken_is_told(run: xr.Dataset, monkeypatch: Any) -> None:
    """Nothing is solved: what carries the warning is what is asked here."""
    monkeypatch.setattr("spirillum.dynamics.flow_of_run.tube_flow_field", lambda *_: None)
    monkeypatch.setattr("spirillum.dynamics.flow_of_run.Flow.with_held_force", lambda flow: flow)
    first, second = (float(time) for time in run["time"][:2])
    between = first + 0.4 * (second - first)
    assert "the flow is that at the nearest one, 0 s" in sp.flow_of_run(run, between).prediction.warnings[0]
    assert not any("no sample" in line for line in sp.flow_of_run(run, second).prediction.warnings)


def test_damaged_runs_are_refused(run: xr.Dataset) -> None:
    time = run["time"].to_numpy().copy()
    time[3] = np.nan
    for times in (run.isel(time=slice(0, 0)), run.isel(time=slice(None, None, -1)), run.assign_coords(time=time)):
        with pytest.raises(sp.InputError, match="time of the run has no values, or does not increase"):
            sp.flow_of_run(times, 0.05)
    for name in ("velocity", "tail_phase", "angular_velocity"):
        with pytest.raises(sp.InputError, match=f"{name} of the run at time = .* is no finite number"):
            sp.flow_of_run(run.assign({name: run[name] * np.nan}), 0.05)
        with pytest.raises(sp.InputError, match=f"the run has no {name}"):
            sp.flow_of_run(run.drop_vars(name), 0.05)


def test_another_run_is_refused(run: xr.Dataset) -> None:
    with pytest.raises(sp.InputError, match="the run has no wall_yaw; allowed: a free run in a tube"):
        sp.flow_of_run(run.drop_vars("wall_yaw"), 0.0)
