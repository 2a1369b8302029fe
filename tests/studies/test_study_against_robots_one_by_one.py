"""A study's Dataset: the same answers as robots one by one, labelled, and readable by xarray alone."""

import json
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import spirillum as sp
from spirillum.files import write_dataset


def test_every_entry_is_what_predict_says(small: dict[str, object]) -> None:
    dataset = sp.study(small)
    assert dataset["forward_velocity"].dims == ("channel", "wavelength", "amplitude", "model", "friction")
    for channel in ("wide", "narrow"):
        for wavelength, amplitude in ((0.020, 0.0015), (0.025, 0.0025), (0.020, 0.0025)):
            tail = {"tail.wavelength": f"{wavelength} m", "tail.amplitude": f"{amplitude} m"}
            robot = sp.load(f"biorob2012-{channel}", **tail)
            for model in ("sbt", "rft"):
                for friction in ("none", "rotor", "paper"):
                    place = {
                        "channel": channel,
                        "wavelength": wavelength,
                        "amplitude": amplitude,
                        "model": model,
                        "friction": friction,
                    }
                    one = sp.predict(robot, model=model, friction=friction)
                    for name in ("forward_velocity", "body_rotation_rate", "motor_current", "tail_torque"):
                        assert float(dataset[name].sel(place)) == pytest.approx(getattr(one, name), rel=1e-12)


def test_assumed_rates_give_the_inverse_friction(small: dict[str, object]) -> None:
    """At the assumed motor rate, (17) and (18) hold with the inferred friction."""
    dataset = sp.study(small).sel(friction="rotor")
    rate = dataset["motor_rotation_rate_at_assumed_rate"]
    np.testing.assert_allclose(rate, np.broadcast_to(dataset["assumed_motor_rate"], rate.shape), rtol=1e-12)
    torque = 0.00045 * dataset["motor_current_at_assumed_rate"]
    load = dataset["tail_torque_at_assumed_rate"] + dataset["effective_friction_at_assumed_rate"] * rate
    np.testing.assert_allclose(torque, load, rtol=1e-12)


def test_planted_friction_is_recovered_from_synthetic_observations(small: dict[str, object], planted) -> None:
    for friction in ("rotor", "paper"):
        observations = planted(small, "rft", friction, 1.1e-5)
        dataset = sp.study(small, observations=observations).sel(model="rft", friction=friction)
        np.testing.assert_allclose(dataset["effective_friction_at_observed_rate"], 1.1e-5, rtol=1e-9)
        np.testing.assert_allclose(
            dataset["forward_velocity_at_observed_rate"], dataset["observed_forward_velocity"], rtol=1e-9
        )
        assert int(dataset["trials"].min()) == 5


def test_listed_robots_stand_along_one_dimension(tmp_path: Path) -> None:
    (tmp_path / "left.toml").write_text('extends = "biorob2012-wide"\nname = "left"\ntail.handedness = "left"\n')
    study = tmp_path / "study.toml"
    study.write_text('title = "Two robots"\nmodels = ["sbt"]\nrobots = ["biorob2012-narrow", "left.toml"]\n')
    dataset = sp.study(study)
    assert dataset["forward_velocity"].dims == ("robot", "model", "friction")
    assert list(dataset["robot"].values) == ["biorob2012-narrow", "left"]
    rates = dataset["tail_rotation_rate"].sel(friction="none", model="sbt")
    assert float(rates[0]) > 0 > float(rates[1])


def test_robots_without_an_answer_say_why(small: dict[str, object]) -> None:
    small["grid"] = {**small["grid"], "amplitudes": ["2.5 mm", "17 mm"]}
    dataset = sp.study(small)
    why = dataset["outside"].sel(amplitude=0.017, channel="narrow", friction="none")
    meanings = dataset["outside"].attrs["flag_meanings"].split()
    assert {meanings[int(code)] for code in why.values.ravel()} == {"tail-wider-than-channel"}
    assert bool(np.isnan(dataset["forward_velocity"].sel(amplitude=0.017, channel="narrow")).all())
    assert bool(np.isfinite(dataset["forward_velocity"].sel(amplitude=0.0025)).all())


def test_file_is_labelled_and_opens_with_xarray_alone(small: dict[str, object], tmp_path: Path) -> None:
    dataset = sp.study(small)
    write_dataset(dataset, tmp_path / "dataset.nc")
    with xr.open_dataset(tmp_path / "dataset.nc") as stored:
        assert stored.load().identical(dataset)
        for name, variable in stored.variables.items():
            assert "long_name" in variable.attrs, name
            if variable.dtype.kind == "f":
                assert variable.attrs["units"], name
        for name in stored.data_vars:
            assert stored[name].attrs["source"], name
        assert json.loads(stored.attrs["settings"])["robots"][0]["body"]["diameter"] == 0.018
        assert "nothing in this dataset is measured" in stored.attrs["observations"]


def test_a_model_that_solves_brings_its_error_estimate_and_what_sets_it_apart(small: dict[str, object]) -> None:
    grid = {"wavelengths": ["25 mm"], "amplitudes": ["2.5 mm"], "channels": {"wide": "biorob2012-wide"}}
    dataset = sp.study({**small, "models": ["sbt", "slender"], "grid": grid}).isel(channel=0, wavelength=0, amplitude=0)
    for friction in ("none", "rotor"):
        place = {"model": "slender", "friction": friction}
        one = sp.predict("biorob2012-wide", **place)
        assert float(dataset["forward_velocity"].sel(place)) == pytest.approx(one.forward_velocity, rel=1e-12)
        assert float(dataset["error_estimate"].sel(place)) == pytest.approx(one.error_estimate, rel=1e-9)
    assert dataset["error_estimate"].sel(model="sbt").isnull().all()
    assert "drag factors are fitted for sbt and not for slender" in dataset.attrs["warnings"]
    assert "the coupling is modelled by slender and not by sbt" in dataset.attrs["warnings"]
