"""A run in the tube that is continued is one run: to rounding, with means of its own part."""

import json
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import xarray as xr

import spirillum as sp
from spirillum.errors import InputError

WIDE = "biorob2012-wide"


def simulated(
    duration: str, robot: Mapping[str, Any] | None = None, on: tuple[str, str] = ("0.1 s", "0.5 s"), **more: Any
) -> xr.Dataset:
    loaded = sp.load(WIDE, **(robot or {}))
    more.setdefault("in_tube", {"wait": 0.0})
    return sp.simulate(loaded, model="tube", timing={"duration": duration, "on": [on]}, **more)


@pytest.fixture(scope="module")
def early(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("runs") / "early.nc"
    simulated("0.3 s").to_netcdf(path)
    return path


def test_a_continued_run_is_the_run_that_had_not_ended(early: Path) -> None:
    whole, rest = simulated("0.6 s"), simulated("0.6 s", in_tube={"continued": early})
    begun = float(rest.time[0])
    assert 0.0 < begun - float(xr.open_dataset(early).time[-1]) < 0.01
    assert float(rest.time[-1]) == pytest.approx(float(whole.time[-1]))
    same = whole.sel(time=rest.time.values, method="nearest")
    assert np.allclose(same.time, rest.time, rtol=0.0, atol=1e-12)
    for name in ("position", "velocity", "wall_gap", "azimuth", "tail_angle", "body_angle", "electrical_energy"):
        assert np.allclose(same[name], rest[name], rtol=1e-9, atol=1e-9 * float(np.abs(whole[name]).max())), name
    assert float(rest.time_on) == pytest.approx(0.5 - begun)
    x = rest.position.values[:, 0]
    first = float(np.interp(begun + (0.6 - begun) / 3.0, rest.time, x))
    assert float(rest.mean_forward_velocity) == pytest.approx((x[-1] - first) / ((0.6 - begun) * 2.0 / 3.0), rel=0.02)


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"placement": {"gap": "1 mm"}}, "placement.gap is given together with in_tube.continued"),
        ({"in_tube": {"wait": "1 s"}}, "in_tube.wait is given together with in_tube.continued"),
        (
            {"motion": "held"},
            "in_tube.continued is given with motion 'held'; allowed: only with",
        ),
        ({"placement": {"eccentricity": 0.0}}, "placement.eccentricity is given together with in_tube.continued"),
        ({"placement": {"pitch": "0 deg"}}, "placement.pitch is given together with in_tube.continued"),
        ({"in_tube": {"azimuth": 0.0}}, "in_tube.azimuth is given together with in_tube.continued"),
    ],
    ids=str,
)
def test_a_continued_run_has_one_start(early: Path, more: dict[str, Any], words: str) -> None:
    settings = {"continued": early, **more.pop("in_tube", {})}
    with pytest.raises(InputError, match=words):
        simulated("0.6 s", in_tube=settings, **more)


def test_only_a_run_of_the_same_robot_is_continued(early: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="a run of another robot, tube or version than biorob2012-narrow's"):
        sp.simulate("biorob2012-narrow", model="tube", timing={"duration": "1 s"}, in_tube={"continued": early})
    held = tmp_path / "held.nc"
    sp.simulate(WIDE, model="sbt", motion="held", timing={"duration": "0.1 s"}).to_netcdf(held)
    with pytest.raises(InputError, match="no run in a tube; allowed: an earlier run of this robot"):
        simulated("0.6 s", in_tube={"continued": held})
    with pytest.raises(InputError, match="the run already ends at t = "):
        simulated("0.2 s", in_tube={"continued": early})


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"placement": {"flow": "1 mm/s"}}, "a run with ends open, and not imposed flow; allowed: all as in that run"),
        ({"roughness": "30 um"}, "a run with roughness 9e-07, and not 3e-05"),
        ({"in_tube": {"friction_coefficient": 0.2}}, r"a run with friction coefficient 0\.1, and not 0\.2"),
        ({"robot": {"fluid.viscosity": "1 Pa s"}}, r"a run with another fluid\.viscosity"),
        ({"weight": False}, "a run with weight acts, and not left out"),
        ({"on": ("0.2 s", "0.5 s")}, r"a run with duty 1 at 0\.\d+ s, and not 0"),
    ],
    ids=str,
)
def test_a_run_is_continued_in_the_same_surroundings(early: Path, more: dict[str, Any], words: str) -> None:
    """Else a flow or an oil would change at the seam, and nothing would say so."""
    settings = {"continued": early, **more.pop("in_tube", {})}
    with pytest.raises(InputError, match=words):
        simulated("0.6 s", in_tube=settings, **more)


def test_another_flow_at_the_seam_is_refused(tmp_path: Path) -> None:
    simulated("0.2 s", placement={"flow": "1 mm/s"}).to_netcdf(tmp_path / "flowing.nc")
    after = {"continued": tmp_path / "flowing.nc"}
    with pytest.raises(InputError, match=r"a run with mean flow at its end 0\.001, and not 0\.002"):
        simulated("0.4 s", in_tube=after, placement={"flow": "2 mm/s"})
    assert float(simulated("0.4 s", in_tube=after, placement={"flow": "1 mm/s"}).time[-1]) == pytest.approx(0.4)


def test_the_run_that_is_read_is_not_written_over(early: Path, run: Any) -> None:
    before = early.read_bytes()
    same = run("simulate", "biorob2012-wide", "--duration", "0.6s", "--continue", str(early), "-o", str(early))
    assert same.code == 2
    assert "is read by this command and would be written over" in same.err
    assert early.read_bytes() == before


@pytest.mark.parametrize(
    "change",
    [
        lambda found: found | {"time": 5.0},
        lambda found: found | {"time": float("nan")},
        lambda found: found | {"step": 0.0},
        lambda found: found | {"state": [float("nan"), *found["state"][1:]]},
        lambda found: found | {"state": [*found["state"][:3], 5.0, *found["state"][4:]]},
        lambda found: found | {"state": [50.0, *found["state"][1:]]},
        lambda found: found | {"state": [*found["state"][:10], 1e200, *found["state"][11:]]},
        lambda found: found | {"state": [10**400, *found["state"][1:]]},
        lambda found: found | {"more": 1},
    ],
)
def test_a_checkpoint_that_was_changed_is_refused(early: Path, tmp_path: Path, change: Callable[[Any], Any]) -> None:
    path = shutil.copy(early, tmp_path / "changed.nc")
    with h5py.File(path, "r+") as changed:  # through xarray it would be 70 variables to read and to write
        changed.attrs["checkpoint"] = json.dumps(change(json.loads(changed.attrs["checkpoint"])))
    with pytest.raises(InputError, match=r"the run(.s checkpoint is not where the run ends| has no checkpoint)"):
        simulated("0.6 s", in_tube={"continued": tmp_path / "changed.nc"})


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda run: run.pop("azimuth"), "has no variable 'azimuth'"),
        (
            lambda run: run["body_angle"].write_direct(np.full(run["body_angle"].shape, np.nan)),
            "'body_angle' is not finite",
        ),
    ],
)
def test_a_damaged_run_is_not_continued(
    early: Path, tmp_path: Path, change: Callable[[h5py.File], None], words: str
) -> None:
    path = shutil.copy(early, tmp_path / "damaged.nc")
    with h5py.File(path, "r+") as run:
        change(run)
    with pytest.raises(InputError, match=words):
        simulated("0.6 s", in_tube={"continued": path})


def test_a_run_without_samples_is_not_continued(early: Path, tmp_path: Path) -> None:
    with xr.open_dataset(early) as run:
        needed = run[["azimuth", "body_angle", "tail_phase", "tail_angle"]]
        needed.isel(time=slice(0)).to_netcdf(tmp_path / "empty.nc")
    with pytest.raises(InputError, match="has no samples"):
        simulated("0.6 s", in_tube={"continued": tmp_path / "empty.nc"})


def test_a_duration_too_short_for_two_more_samples_is_named(early: Path) -> None:
    with xr.open_dataset(early) as dataset:
        end = float(dataset["time"][-1])
    with pytest.raises(
        InputError, match=f"already ends at t = {end:.6g} s, and less than 2 samples lie between it and"
    ):
        simulated(f"{end + 1e-7} s", in_tube={"continued": early})


def test_rows_of_a_flow_beyond_the_run_change_nothing(tmp_path: Path) -> None:
    """Only those about a step are handed to the equations: a log of an hour costs no more than its first seconds."""
    rows = ["time_s,flow_mm_s", "0,0", "0.02,1", "0.05,0.5", "0.3,0.5"]
    short, long = tmp_path / "short.csv", tmp_path / "long.csv"
    short.write_text("\n".join(rows))
    long.write_text("\n".join([*rows, *(f"{10 + k},{k % 3}" for k in range(500))]))
    one, other = (
        sp.simulate(WIDE, model="tube", timing={"duration": "0.1 s"}, in_tube={"flow": path}) for path in (short, long)
    )
    assert np.array_equal(one["position"].values, other["position"].values)
    assert np.allclose(one["mean_flow"], 1e-3 * np.interp(one["time"], [0.0, 0.02, 0.05], [0.0, 1.0, 0.5]), atol=1e-15)
