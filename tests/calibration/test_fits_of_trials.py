"""Trials are fitted as such: a planted friction coefficient and effective friction are found again."""

from pathlib import Path

import numpy as np
import pytest

import spirillum as sp
from spirillum.calibration.fit import fit_model
from spirillum.errors import InputError
from spirillum.swimming.motions import ReleasedMotion

HEADER = (
    "channel_diameter_mm,wavelength_mm,amplitude_mm,trial,forward_velocity_mm_s,tail_rate_Hz,body_rate_Hz,motor_rate_Hz"
)
COEFFICIENT, FRICTION = 0.06, 1.2e-5


@pytest.fixture(scope="module")
def truth() -> dict[float, ReleasedMotion]:
    """Trials of two tails in the wide tube."""
    found = {}
    for wavelength in (25.0, 20.0):
        fields = {"tail.wavelength": f"{wavelength} mm", "friction.effective": f"{FRICTION} N m s/rad"}
        robot = sp.load("biorob2012-wide", **fields)
        found[wavelength] = sp.predict(robot, in_tube={"friction_coefficient": COEFFICIENT}).trial
    return found


@pytest.fixture(scope="module")
def observed(truth, tmp_path_factory: pytest.TempPathFactory) -> Path:  # type: ignore[no-untyped-def]
    """Five observations of each with 2 % of error."""
    rng, lines = np.random.default_rng(3), ["# synthetic", HEADER]
    for wavelength, trial in truth.items():
        for number in range(5):
            names = ("forward_velocity", "tail_rotation_rate", "body_rotation_rate", "motor_rotation_rate")
            u, tail, body, _ = (trial.values[name] * (1.0 + 0.02 * rng.normal()) for name in names)
            rates = ",".join(f"{value / (2.0 * np.pi):.6g}" for value in (tail, body, tail - body))
            lines.append(f"40,{wavelength:g},2.5,{number + 1},{1e3 * u:.6g},{rates}")
    path = tmp_path_factory.mktemp("trials") / "observed.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.mark.slow
def test_planted_numbers_are_found_and_predicted_again(truth, observed: Path, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    """Within their intervals; `predict --calibration` then gives the trials that were observed."""
    found = sp.calibrate(observed, "biorob2012-wide", tmp_path / "fit", answer="trial", figures=False)
    for name, planted in (("friction_coefficient", COEFFICIENT), ("shared_friction", FRICTION)):
        assert found.values[name].low < planted < found.values[name].high
    predicted = found.predicted["advance"]
    speeds = np.array([trial.values["forward_velocity"] for trial in truth.values()])
    rates = np.array([trial.values["tail_rotation_rate"] for trial in truth.values()])
    order = [truth_of(truth, robot) for robot in found.experiment.robots]
    assert np.all((predicted[1] < (speeds / rates)[order]) & ((speeds / rates)[order] < predicted[2]))
    text = (tmp_path / "fit" / "calibration.toml").read_text()
    assert 'answer = "trial"' in text
    tails = tmp_path / "tails.csv"
    tails.write_text("channel_diameter_mm,wavelength_mm,amplitude_mm\n40,25,2.5\n40,15,2.5\n")
    asked = {"candidates": tails, "answer": "trial"}
    suggested = sp.suggest(tmp_path / "fit" / "posterior.nc", "biorob2012-wide", **asked)
    assert suggested.to_dict()["answer"] == "trial"
    for one in suggested.candidates:
        assert one.gain > 0.0
        assert set(one.narrowing) == {"friction_coefficient", "shared_friction"}
        assert all(0.0 < share < 1.0 for share in one.narrowing.values())
    with pytest.raises(InputError, match="suggest --as trial"):
        sp.suggest(tmp_path / "fit" / "posterior.nc", "biorob2012-wide")
    with_draws = sp.predict("biorob2012-wide", posterior=tmp_path / "fit" / "posterior.nc", interval=True).trial
    assert with_draws is not None
    speed = with_draws.intervals["forward_velocity"]
    assert speed.low < truth[25.0].values["forward_velocity"] < speed.high
    assert not {"friction_coefficient", "friction.effective"} & {one["name"] for one in with_draws.basis["unknowns"]}
    again = sp.predict("biorob2012-wide", calibration=tmp_path / "fit" / "calibration.toml").trial
    assert again is not None
    assert again.values["forward_velocity"] == pytest.approx(truth[25.0].values["forward_velocity"], rel=0.15)


def truth_of(truth, robot: sp.Robot) -> int:  # type: ignore[no-untyped-def]
    """Which of the planted trials is of a robot."""
    return [round(robot.tail.wavelength * 1e3) == wavelength for wavelength in truth].index(True)


def test_what_a_trial_does_not_have_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "observed.csv"
    path.write_text(f"{HEADER}\n40,25,2.5,1,0.1,1.5,-0.01,1.51\n40,25,2.5,2,0.1,1.5,-0.01,1.51\n")
    with pytest.raises(InputError, match="free = 'gap' with answer = 'trial'"):
        fit_model(path, "biorob2012-wide", model="tube", free="gap", answer="trial")
    with pytest.raises(InputError, match="model 'sbt', which has no trials"):
        fit_model(path, "biorob2012-wide", model="sbt", free="body_drag", answer="trial")
    with pytest.raises(InputError, match="did you mean trial"):
        fit_model(path, "biorob2012-wide", answer="trail")
    with pytest.raises(InputError, match="without model 'tube'"):
        sp.rank_models(path, "biorob2012-wide", models=["sbt", "rft"], answer="trial")
