"""`predict --posterior`: intervals that hold the truth of tails that were not observed, and files that are refused."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import spirillum as sp
from spirillum import InputError
from spirillum.calibration.posterior import Sampling
from spirillum.results.calibration import write_calibration
from spirillum.robot.batch import RobotBatch
from spirillum.robot.load import load
from synthetic_experiments import SHORT

WIDE = "biorob2012-wide"


@pytest.fixture(scope="module")
def fitted(made: Callable[..., Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A posterior from tails of two amplitudes; the model misses each tail by 3 %."""
    small = {"presets": (WIDE,), "drag": (2.5,), "rotation": (0.8,), "amplitudes": (1.5, 2.5), "discrepancy": 0.03}
    found = sp.calibrate(made(**small, seed=4), WIDE, sampling=SHORT, model="sbt")
    assert found.converged
    folder = tmp_path_factory.mktemp("fitted")
    write_calibration(found, folder, figures=False)
    return folder


def test_intervals_hold_the_truth_of_tails_that_were_not_observed(fitted: Path) -> None:
    factors = load(WIDE).calibration["sbt"].model_copy(update={"body_drag": 2.5, "body_rotation": 0.8})
    rng = np.random.default_rng(0)
    inside = []
    for wavelength in np.linspace(12.0, 24.0, 12):
        robot = load(WIDE, **{"tail.wavelength": f"{wavelength} mm", "tail.amplitude": "2.0 mm"})
        truth = sp.swim(
            RobotBatch.of(robot.model_copy(update={"calibration": {"sbt": factors}})), tail_rate=np.array([7.0])
        )
        answer = sp.predict(robot, posterior=fitted / "posterior.nc", tail_rate=7.0)
        assert answer.intervals is not None
        own = float(truth.forward_velocity[0]) * (1.0 + 0.03 * rng.normal())
        inside.append(answer.intervals.low["forward_velocity"] <= own <= answer.intervals.high["forward_velocity"])
        assert answer.intervals.low["forward_velocity"] < answer.forward_velocity
        assert answer.forward_velocity < answer.intervals.high["forward_velocity"]
    assert sum(inside) >= 10


def test_middle_and_limits_are_those_of_predictions_one_by_one(fitted: Path) -> None:
    """Without discrepancy, each draw is a robot with its own factors, predicted by itself."""

    from spirillum.fitted.posterior_file import read_posterior
    from spirillum.fluid.registry import find_swimmer_model
    from spirillum.swimming.intervals import intervals_of

    posterior = read_posterior(fitted / "posterior.nc", "sbt")
    thin = {name: values[::50] for name, values in posterior.draws.items()}
    size = thin["body_drag"].shape[0]
    certain = posterior.model_copy(update={"draws": thin, "discrepancy": {}, "friction": ()})
    robot = certain.central(load(WIDE))
    found = intervals_of(robot, find_swimmer_model("sbt"), certain, tail_rate=None, friction="rotor")
    speeds = []
    for n in range(size):
        factors = {"body_drag": float(thin["body_drag"][n, 0]), "body_rotation": float(thin["body_rotation"][n, 0])}
        own = robot.calibration["sbt"].model_copy(update=factors)
        changed = robot.model_copy(update={"calibration": {"sbt": own}})
        speeds.append(sp.predict(changed, model="sbt").forward_velocity)
    low, high = np.quantile(speeds, [0.025, 0.975])
    assert found.low["forward_velocity"] == pytest.approx(low, rel=1e-12)
    assert found.high["forward_velocity"] == pytest.approx(high, rel=1e-12)


def test_posterior_and_calibration_file_have_the_same_middle(fitted: Path) -> None:
    one, other = (
        sp.predict(WIDE, tail_rate=7.0, posterior=fitted / "posterior.nc"),
        sp.predict(WIDE, tail_rate=7.0, calibration=fitted / "calibration.toml"),
    )
    assert one.forward_velocity == pytest.approx(other.forward_velocity, rel=1e-12)
    assert one.body_rotation_rate == pytest.approx(other.body_rotation_rate, rel=1e-12)


def test_json_says_kind_and_level(fitted: Path) -> None:
    answer = sp.predict(WIDE, posterior=fitted / "posterior.nc", tail_rate="1 Hz").to_dict()
    item = answer["forward_velocity"]
    assert (item["kind"], item["level"]) == ("interval", 0.95)
    assert item["low"] < item["value"] < item["high"]
    assert "low" not in answer["motor_residual_torque"]
    json.dumps(answer, allow_nan=False)


@pytest.mark.parametrize(
    ("free", "model"),
    [
        ("body_drag,wire_diameter", "sbt"),
        ("normal_factor,tangential_factor,body_drag", "rft"),
        ("body_drag,viscosity,shared_friction", "sbt"),
        ("body_drag,torque_constant,back_emf_constant,shared_friction", "sbt"),
    ],
)
def test_every_parameter_reaches_the_prediction(
    made: Callable[..., Path], tmp_path: Path, free: str, model: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("spirillum.calibration.posterior.LARGEST_RHAT", 10.0)
    monkeypatch.setattr("spirillum.calibration.posterior.FEWEST_EFFECTIVE", 1.0)
    few = Sampling(ensembles=2, walkers=56, warm_up=30, steps=26, kept=13, doublings=0)
    small = {"presets": (WIDE,), "wavelengths": (15.0, 25.0), "amplitudes": (1.5, 2.5)}
    stated = {"motor.back_emf_constant": "20%"} if "back_emf" in free else None  # else B_eff stands for it as well
    found = sp.calibrate(made(**small, seed=4), WIDE, model=model, free=free, sampling=few, assume_uncertainty=stated)
    write_calibration(found, tmp_path, figures=False)
    robot = found.experiment.robots[3]
    answer = sp.predict(robot, model=model, posterior=tmp_path / "posterior.nc")
    assert answer.intervals is not None
    middle = np.median(found.posterior.flat, axis=0)[None, : len(found.problem.coordinates)]  # type: ignore[union-attr]
    advance = found.problem.predicted(middle)["advance"][0, 3]
    assert answer.advance_per_radian == pytest.approx(advance, rel=5e-3)
    assert answer.intervals.low["advance_per_radian"] < advance < answer.intervals.high["advance_per_radian"]
    again = sp.predict(robot, model=model, calibration=tmp_path / "calibration.toml")
    assert again.advance_per_radian == pytest.approx(answer.advance_per_radian, rel=1e-3)


@pytest.fixture(scope="module")
def damaged(fitted: Path) -> Path:
    """The folder of the posterior, with files beside it that are none."""
    import xarray as xr

    from spirillum.fitted.posterior_file import posterior_checksum

    whole = (fitted / "posterior.nc").read_bytes()
    (fitted / "cut.nc").write_bytes(whole[: len(whole) // 2])
    xr.Dataset({"x": ("x", [1.0])}).to_netcdf(fitted / "other.nc", engine="h5netcdf")
    with xr.open_datatree(fitted / "posterior.nc", engine="h5netcdf") as tree:
        tree.load()
        tree.attrs["converged"] = 0
        values = {str(name): item.values for name, item in tree["posterior"].data_vars.items()}
        tree.attrs["checksum"] = posterior_checksum(tree.attrs, values)
        tree.to_netcdf(fitted / "unmixed.nc", engine="h5netcdf")
    return fitted


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"posterior": "missing.nc"}, "missing.nc does not exist"),
        ({"posterior": "calibration.toml"}, "is not a NetCDF-4 file"),
        ({"posterior": "other.nc"}, "is no posterior of a calibration"),
        ({"posterior": "unmixed.nc"}, "unmixed.nc has not converged"),
        ({"posterior": "cut.nc"}, "cut.nc cannot be read: it is damaged, cut off, or of another program; allowed"),
        ({"posterior": "posterior.nc", "model": "rft"}, "is of model 'sbt', not 'rft'"),
        ({"posterior": "posterior.nc", "calibration": "calibration.toml"}, "a posterior alone"),
        ({"posterior": "posterior.nc", "calibrated": False}, "a posterior alone"),
    ],
)
def test_wrong_posteriors_are_refused(damaged: Path, settings: dict[str, Any], words: str) -> None:
    ready = {
        name: damaged / value if name in ("posterior", "calibration") else value for name, value in settings.items()
    }
    with pytest.raises(InputError, match="allowed") as caught:
        sp.predict(WIDE, tail_rate="1 Hz", **ready)
    assert words in str(caught.value)
