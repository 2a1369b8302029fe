"""The flow at a moment of a run: solved for anew, its traction carries the robot's weight, wherever it lies."""

from __future__ import annotations

import re
from collections.abc import Callable
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
    force, pose = flow.field.wrench()[:3], flow.seat
    assert pose is not None
    up, right = pose.across @ force
    assert up == pytest.approx(-weight * np.cos(AZIMUTH), rel=0.03)
    assert abs(right) == pytest.approx(weight * np.sin(AZIMUTH), rel=0.03)
    assert abs(force @ pose.forward) < 1e-3 * weight
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


def test_the_force_of_a_film_that_is_drawn_thicker_is_not_given(run: xr.Dataset, monkeypatch: Any) -> None:
    """It is nearly all in the film. Nothing is solved here."""
    thin = run.isel(time=[0]).assign(wall_gap=("time", [1e-6]), wall_yaw=("time", [0.06]), offset=("time", [0.011]))
    monkeypatch.setattr("spirillum.dynamics.flow_of_run.tube_flow_field", lambda *_: None)
    flow = sp.flow_of_run(thin, 0.0)
    answer = flow.to_dict()
    assert answer["held_force"]["value"] is None
    assert answer["lifted"]["value"] == pytest.approx(0.02 * sp.load("biorob2012-wide").body.diameter - 1e-6)
    assert any("ignore film pressure and force" in line for line in flow.warnings)


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
    for times in (run.isel(time=slice(0, 0)), run.isel(time=slice(None, None, -1))):
        with pytest.raises(sp.InputError, match="time of the run has no values, or does not increase"):
            sp.flow_of_run(times, 0.05)
    with pytest.raises(sp.InputError, match="variable 'time' is not finite at sample 3"):
        sp.flow_of_run(run.assign_coords(time=time), 0.05)
    for name in ("velocity", "tail_phase", "angular_velocity"):
        with pytest.raises(sp.InputError, match=f"variable '{name}' is not finite at time = 0.05 s"):
            sp.flow_of_run(run.assign({name: run[name] * np.nan}), 0.05)
        with pytest.raises(sp.InputError, match=f"the run has no {name}"):
            sp.flow_of_run(run.drop_vars(name), 0.05)


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda run: run.assign(attitude=0.0 * run["attitude"]), "attitude at time = 0.05 s has the length 0"),
        (lambda run: run.assign(attitude=run["attitude"][0]), "'attitude' has the dimensions (quaternion: 4)"),
        (lambda run: run.assign(mean_flow=run["velocity"]), "'mean_flow' has the dimensions (time: 1, axis: 3)"),
        (lambda run: run.assign(tail_phase=run["tail_phase"].astype(str)), "'tail_phase' holds no numbers"),
        (lambda run: run.assign(motor_rotation_rate=run["time"] + 1e200), "holds 1e+200; allowed: at most 1e+09"),
        (lambda run: run.assign(wall_gap=run["time"] - 1.0), "'wall_gap' is -9.5e+05 um; allowed: at least 0"),
        (lambda run: run.assign(wall_pitch=run["time"] + 2.0), 'the run: wall_pitch = "2.05 rad" is out of range'),
        (lambda run: run.assign(wall_gap=run["time"] + 1.0), "wall_gap = 1050 mm; allowed: at most"),
        (lambda run: run.assign_attrs(friction="dry"), "the run: friction = 'dry'; allowed: none, rotor"),
        (lambda run: run.assign_attrs(warnings=3), "the run's attribute 'warnings' = 3; allowed: text"),
        (lambda run: run.assign_attrs(settings="{}"), "the run's settings: body is missing"),
    ],
)
def test_runs_changed_by_hand_are_refused_unannounced(
    run: xr.Dataset, monkeypatch: Any, spoil: Callable[[xr.Dataset], xr.Dataset], words: str
) -> None:
    monkeypatch.setattr("spirillum.dynamics.flow_of_run.tube_flow_field", lambda *_: pytest.fail("it was taken"))
    announced: list[str] = []
    with pytest.raises(sp.InputError, match=re.escape(words)):
        sp.flow_of_run(spoil(run), 0.05, progress=lambda what, *_: announced.append(what))
    assert not announced


def test_another_run_is_refused(run: xr.Dataset) -> None:
    with pytest.raises(sp.InputError, match="the run has no wall_yaw; allowed: a free run in a tube"):
        sp.flow_of_run(run.drop_vars("wall_yaw"), 0.0)
