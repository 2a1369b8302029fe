"""A study with a calibration or its posterior: every robot is predicted as `predict` does it alone."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import spirillum as sp
from spirillum import InputError
from spirillum.results.calibration import write_calibration
from spirillum.robot.load import load
from synthetic_experiments import SHORT, synthetic

WIDE, NARROW = "biorob2012-wide", "biorob2012-narrow"
GRID = {
    "channels": {"wide": WIDE, "narrow": NARROW},
    "wavelengths": ["15 mm", "20 mm"],
    "amplitudes": ["2.5 mm", "3 mm"],
}
STUDY: dict[str, Any] = {"title": "calibrated", "models": ["sbt"], "friction": ["rotor"], "grid": GRID}


@pytest.fixture(scope="module")
def fitted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A posterior of a synthetic experiment in both channels."""
    folder = tmp_path_factory.mktemp("fitted")
    path = synthetic(folder / "o.csv", wavelengths=(15.0, 20.0), amplitudes=(1.5, 2.5), discrepancy=0.02)
    found = sp.calibrate(path, [WIDE, NARROW], sampling=SHORT, model="sbt")
    assert found.converged
    write_calibration(found, folder, figures=False)
    return folder


def test_every_robot_is_predicted_as_alone(fitted: Path) -> None:
    dataset = sp.study(STUDY, calibration=fitted / "calibration.toml")
    for channel, preset in (("wide", WIDE), ("narrow", NARROW)):
        for wavelength, amplitude in ((15, 2.5), (20, 3.0)):
            robot = load(preset, **{"tail.wavelength": f"{wavelength} mm", "tail.amplitude": f"{amplitude} mm"})
            answer = sp.predict(robot, calibration=fitted / "calibration.toml")
            found = dataset["forward_velocity"].sel(
                channel=channel, wavelength=1e-3 * wavelength, amplitude=1e-3 * amplitude, model="sbt", friction="rotor"
            )
            assert float(found) == pytest.approx(answer.forward_velocity, rel=1e-12)


def test_intervals_are_those_of_predict(fitted: Path, tmp_path: Path) -> None:
    posterior = fitted / "posterior.nc"
    dataset = sp.study({**STUDY, "models": ["sbt", "rft"]}, posterior=posterior)
    robot = load(NARROW, **{"tail.wavelength": "20 mm", "tail.amplitude": "3 mm"})
    answer = sp.predict(robot, posterior=posterior)
    assert answer.intervals is not None
    here = {"channel": "narrow", "wavelength": 0.02, "amplitude": 0.003, "friction": "rotor"}
    for end in ("low", "high"):
        found = dataset[f"forward_velocity_interval_{end}"].sel(here)
        assert float(found.sel(model="sbt")) == pytest.approx(
            getattr(answer.intervals, end)["forward_velocity"], rel=1e-12
        )
        assert np.isnan(float(found.sel(model="rft")))
    from spirillum.view.figures.study_panels import StudyView

    shown = StudyView.of(dataset).part(channel=1)
    assert shown.with_intervals == ("sbt",)
    for end, limit in zip(("low", "high"), shown.band("forward_velocity", "sbt"), strict=True):
        stored = dataset[f"forward_velocity_interval_{end}"].sel(channel="narrow", model="sbt", friction="rotor")
        assert limit == pytest.approx(stored.values)
    assert "Shades: 95 % intervals of the posterior (sbt, friction model 'rotor')" in shown.pose_words
    low, high = (dataset[f"forward_velocity_interval_{end}"].sel(model="sbt") for end in ("low", "high"))
    middle = dataset["forward_velocity"].sel(model="sbt")
    assert bool(((low < middle) & (middle < high)).all())


def test_what_does_not_go_together_is_refused(fitted: Path) -> None:
    posterior, calibration = fitted / "posterior.nc", fitted / "calibration.toml"
    with pytest.raises(InputError, match="one of them"):
        sp.study(STUDY, posterior=posterior, calibration=calibration)
    with pytest.raises(InputError, match="is of model 'sbt', not 'rft'"):
        sp.study({**STUDY, "models": ["rft"]}, posterior=posterior)


def test_another_calibration_is_another_study(fitted: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "spirillum.results.study.write_report", lambda *_, **__: None
    )  # takes longest, and is not asked for
    sp.study(STUDY, output=tmp_path / "study")
    with pytest.raises(InputError, match="holds another study"):
        sp.study(STUDY, calibration=fitted / "calibration.toml", output=tmp_path / "study")


def test_robots_lie_where_the_calibration_places_those_of_their_channel(tmp_path: Path) -> None:
    """Each as `predict` places it; a place of the study's own goes before."""
    path = tmp_path / "calibration.toml"
    path.write_text(
        "".join(
            f'[[placement]]\nchannel_diameter = "{diameter} mm"\n[placement.placement]\n'
            f'gap = "{gap} mm"\npitch = "1 deg"\n'
            for diameter, gap in ((40, 0.4), (30, 0.7))
        )
    )
    study = {"title": "placed", "models": ["rft", "tube"], "friction": ["rotor"]}
    grid = {"channels": {"wide": WIDE, "narrow": NARROW}, "wavelengths": ["20 mm"], "amplitudes": ["2.5 mm"]}
    gridded = sp.study({**study, "grid": grid}, calibration=path)["forward_velocity"].sel(model="tube").values.ravel()
    listed = sp.study({**study, "robots": [NARROW, WIDE]}, calibration=path)
    backwards = listed["forward_velocity"].sel(model="tube").values.ravel()[::-1]
    robots = [load(name, **{"tail.wavelength": "20 mm", "tail.amplitude": "2.5 mm"}) for name in (WIDE, NARROW)]
    alone = [sp.predict(robot, model="tube", calibration=path, band=False).forward_velocity for robot in robots]
    assert gridded == pytest.approx(alone, rel=1e-12)
    presets = [sp.predict(name, model="tube", calibration=path, band=False).forward_velocity for name in (WIDE, NARROW)]
    assert backwards == pytest.approx(presets, rel=1e-12)
    own = sp.study({**study, "models": ["tube"], "robots": [WIDE], "placement": {"gap": "1 mm"}}, calibration=path)
    placed = sp.predict(WIDE, model="tube", placement={"gap": "1 mm"}, band=False)
    assert float(own["forward_velocity"].squeeze()) == pytest.approx(placed.forward_velocity, rel=1e-12)
    with pytest.raises(InputError, match="gives the robots' pose; allowed: the study without a band"):
        sp.study({**study, "models": ["tube"], "robots": [WIDE], "band": True}, calibration=path)


def test_dry_friction_that_a_study_does_not_know_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "calibration.toml"
    path.write_text('[contact]\nroughness = "20 um"\nfriction_coefficient = 0.2\n')
    with pytest.raises(InputError, match="has a friction_coefficient, and a study models no dry friction"):
        sp.study({"models": ["tube"], "robots": [WIDE]}, calibration=path)


def test_what_a_grid_varies_cannot_be_set() -> None:
    with pytest.raises(InputError, match=r"tail.amplitude is set and varied by grid.amplitudes of the study"):
        sp.study(STUDY, overrides={"tail.amplitude": "2 mm"})
