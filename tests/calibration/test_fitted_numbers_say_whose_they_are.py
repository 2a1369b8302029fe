"""B_eff of a tail that was not fitted: one rule for `predict` and `study`, with the spread from tail to tail."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import posteriors
import spirillum as sp
from spirillum import InputError
from spirillum.fitted.posterior_file import read_posterior
from spirillum.results.calibration import write_calibration
from spirillum.robot.load import load
from synthetic_experiments import SHORT

WIDE = "biorob2012-wide"
FITTED = (8e-6, 1e-5, 1.6e-5)


@pytest.fixture
def calibration(tmp_path: Path) -> Path:
    """B_eff of three tails, one of them that of the preset."""
    tail = load(WIDE).tail
    lines = ["[provenance]", 'observations = "o.csv"', 'friction_reading = "rotor"', "synthetic = true"]
    for wavelength, effective in zip((tail.wavelength, 0.011, 0.024), FITTED, strict=True):
        lines += ["[[friction]]", 'channel_diameter = "40 mm"', f'wavelength = "{wavelength!r} m"']
        lines += [f'amplitude = "{tail.amplitude!r} m"', f'effective = "{effective} N m s/rad"']
    path = tmp_path / "calibration.toml"
    path.write_text("\n".join(lines) + "\n")
    return path


def test_a_tail_that_was_not_fitted_has_the_middle_in_predict_and_in_study(calibration: Path) -> None:
    study = {
        "title": "t",
        "models": ["rft"],
        "friction": ["rotor", "paper"],
        "grid": {
            "channels": {"wide": WIDE},
            "wavelengths": ["13 mm", "11 mm"],
            "amplitudes": [f"{load(WIDE).tail.amplitude} m"],
        },
    }
    dataset = sp.study(study, calibration=calibration)
    for wavelength, effective in ((0.013, 1e-5), (0.011, 1e-5)):
        alone = sp.predict(load(WIDE, **{"tail.wavelength": f"{wavelength} m"}), model="rft", calibration=calibration)
        assert alone.robot.friction.effective == pytest.approx(effective)
        found = dataset["motor_rotation_rate"].sel(friction="rotor").sel(wavelength=wavelength, method="nearest")
        assert float(found.squeeze()) == pytest.approx(alone.motor_rotation_rate, rel=1e-12)
    assert "B_eff of 1 of 2 tails was not fitted" in dataset.attrs["warnings"]
    assert "inferred with friction 'rotor' and is another torque with 'paper'" in dataset.attrs["warnings"]
    assert "o.csv says that its numbers are synthetic" in dataset.attrs["warnings"]


@pytest.mark.parametrize(
    "command",
    [
        ("predict", WIDE, "--calibration", "calibration.toml"),
        ("predict", WIDE, "--calibration", "calibration.toml", "--tail-rate", "1 Hz"),
        ("predict", WIDE, "--posterior", "posterior.nc"),
        ("compare-models", WIDE, "--calibration", "calibration.toml"),
        ("simulate", WIDE, "-o", "run.nc", "--calibration", "calibration.toml"),
        ("settle", WIDE, "--calibration", "calibration.toml"),
        ("export", WIDE, "robot.urdf", "--calibration", "calibration.toml"),
        ("study", "-o", "study", "--calibration", "calibration.toml"),
        ("study", "-o", "study", "--posterior", "posterior.nc"),
        ("suggest", "posterior.nc"),
        ("design", WIDE, "--vary", "tail.wavelength=20mm:30mm", "--posterior", "posterior.nc"),
    ],
)
def test_a_field_that_is_set_is_not_replaced_by_a_file_without_a_word(
    run: Callable[..., Any], monkeypatch: pytest.MonkeyPatch, calibration: Path, command: tuple[str, ...]
) -> None:
    monkeypatch.chdir(calibration.parent)
    posteriors.write(Path("posterior.nc"))
    outcome = run(*command, "--set", "friction.effective=1e-9 N m s/rad")
    assert (outcome.code, outcome.out) == (2, "")
    file = next(word for word in command if word in ("calibration.toml", "posterior.nc"))
    assert f"friction.effective is set or varied, and replaced by what {file} has fitted; allowed: one" in outcome.err
    if file == "posterior.nc":
        outcome = run(*command, "--set", "calibration={sbt={body_drag=30}}")
        assert "calibration.sbt.body_drag is set or varied, and replaced by what posterior.nc" in outcome.err


@pytest.mark.parametrize("command", [("predict", WIDE), ("simulate", WIDE, "-o", "run.nc")])
def test_a_calibration_file_is_not_left_out_again(
    run: Callable[..., Any], monkeypatch: pytest.MonkeyPatch, calibration: Path, command: tuple[str, ...]
) -> None:
    monkeypatch.chdir(calibration.parent)
    outcome = run(*command, "--calibration", "calibration.toml", "--no-calibration")
    assert (outcome.code, outcome.out) == (2, "")
    assert "calibration together with no-calibration (--no-calibration); allowed: one of them" in outcome.err


def test_a_field_that_a_study_varies_is_not_replaced_by_a_file(calibration: Path) -> None:
    study = {"title": "t", "models": ["rft"], "robots": [WIDE]}
    both = {**study, "vary": {"friction.effective": ["1e-9 N m s/rad", "1e-8 N m s/rad"]}}
    with pytest.raises(InputError, match=r"friction\.effective is set or varied, and replaced by what .*calibration"):
        sp.study(both, calibration=calibration)


def test_a_fit_refuses_a_field_that_it_does_not_look_at(run: Callable[..., Any], tmp_path: Path) -> None:
    """The priors of the factors and B_eff know nothing of the robot's own; that of the viscosity does."""
    for setting, name in (("calibration.sbt.body_drag=30", "body_drag"), ("friction.effective=1e-9 N m s", "friction")):
        outcome = run("calibrate", str(tmp_path / "o.csv"), WIDE, "--set", setting)
        assert outcome.code == 2
        assert f"{setting.split('=')[0]} is set, and the fit of '{name}' ignores it" in outcome.err
    outcome = run("calibrate", str(tmp_path / "o.csv"), WIDE, "--set", "fluid.viscosity=3 Pa s")
    assert "o.csv does not exist" in outcome.err


@pytest.mark.parametrize(
    ("command", "sentence"),
    [
        (("calibrate", "--set", "tail.wavelength=20 mm"), "tail.wavelength is set, and the observations say the"),
        (("calibrate", "--prepare", "--model", "sbt"), "prepare with model 'sbt', which takes no tables"),
        (("calibrate", "--method", "paper", "--seed", "1"), "--seed with method 'paper', which samples no posterior"),
        (("rank-models", "--set", "tail.amplitude=2 mm"), "tail.amplitude is set, and the observations say the"),
        (("rank-models", "--set", "calibration.rft.body_drag=30"), "calibration.rft.body_drag is set, and the fit"),
        (("rank-models", "--prepare"), "prepare with models sbt, rft, which take no tables; allowed: with 'tube'"),
    ],
)
def test_a_fit_refuses_what_it_would_not_use(
    run: Callable[..., Any], tmp_path: Path, command: tuple[str, ...], sentence: str
) -> None:
    outcome = run(command[0], str(tmp_path / "o.csv"), WIDE, *command[1:])
    assert (outcome.code, outcome.out) == (2, "")
    assert sentence in outcome.err


def test_predict_says_whose_friction_it_takes_and_under_which_reading(calibration: Path) -> None:
    other = load(WIDE, **{"tail.wavelength": "13 mm"})
    found = sp.predict(other, model="rft", calibration=calibration, friction="paper").warnings
    assert any("the median of 3 fitted tails" in words and "8e-06 to 1.6e-05" in words for words in found)
    assert any("is another torque with 'paper'" in words for words in found)
    assert any("o.csv says that its numbers are synthetic" in words for words in found)
    own = sp.predict(WIDE, model="rft", calibration=calibration)
    assert own.robot.friction.effective == pytest.approx(8e-6)
    assert not any("B_eff" in words for words in own.warnings)
    driven = sp.predict(WIDE, model="rft", calibration=calibration, tail_rate="1 Hz").warnings
    assert not any("friction.effective is ignored" in words for words in driven)


def test_a_negative_friction_is_zero_and_said(calibration: Path) -> None:
    calibration.write_text(calibration.read_text().replace("8e-06", "0.0"))
    found = sp.predict(WIDE, model="rft", calibration=calibration)
    assert any("is negative; zero is used" in words for words in found.warnings)
    assert not any("unset" in words for words in found.warnings)


@pytest.fixture(scope="module")
def fitted(made: Callable[..., Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    small = {"presets": (WIDE,), "wavelengths": (15.0, 25.0), "amplitudes": (1.5, 2.5), "discrepancy": 0.03}
    folder = tmp_path_factory.mktemp("fitted")
    free = "body_drag,friction"
    sp.calibrate(made(**small, seed=4), WIDE, folder, model="rft", free=free, sampling=SHORT, figures=False)
    return folder


def test_the_spread_from_tail_to_tail_is_in_the_interval(fitted: Path) -> None:
    posterior = read_posterior(fitted / "posterior.nc")
    known = load(WIDE, **{"tail.wavelength": "15 mm", "tail.amplitude": "1.5 mm"})
    other = load(WIDE, **{"tail.wavelength": "18 mm", "tail.amplitude": "1.5 mm"})
    draws = {name: posterior.of(robot, np.random.default_rng(1)) for name, robot in (("own", known), ("other", other))}
    logs = {name: np.log(found["friction"]) for name, found in draws.items()}
    between = np.std(np.log([item.effective for item in posterior.frictions]), ddof=1)
    assert np.quantile(logs["other"], 0.84) - np.quantile(logs["other"], 0.16) > 2 * between
    assert np.std(logs["own"]) < np.std(logs["other"])
    width = []
    for robot in (known, other):
        found = sp.predict(robot, model="rft", posterior=fitted / "posterior.nc").intervals
        assert found is not None
        width.append(found.high["motor_rotation_rate"] - found.low["motor_rotation_rate"])
    assert width[1] > width[0]


def test_a_quantity_on_which_nothing_acts_has_no_interval(fitted: Path) -> None:
    found = sp.predict(WIDE, model="rft", posterior=fitted / "posterior.nc", tail_rate="1 Hz").intervals
    assert found is not None
    for name, low in found.low.items():
        assert not np.isfinite(low) or low < found.high[name], name
    assert not found.of("tail_rotation_rate")
    assert found.of("forward_velocity")


def test_a_damaged_posterior_is_refused(fitted: Path, tmp_path: Path) -> None:
    import xarray as xr

    with xr.open_datatree(fitted / "posterior.nc", engine="h5netcdf") as tree:
        tree.load()
    tree["posterior"]["body_drag"][3, 7] *= -1.0
    tree.to_netcdf(tmp_path / "negative.nc", engine="h5netcdf")
    with pytest.raises(InputError, match=r"allowed: posterior\.nc"):
        read_posterior(tmp_path / "negative.nc")
    tree["posterior"]["body_drag"][3, 7] *= -1.001
    tree.to_netcdf(tmp_path / "changed.nc", engine="h5netcdf")
    with pytest.raises(InputError, match="its checksum is another"):
        read_posterior(tmp_path / "changed.nc")
    with pytest.raises(InputError, match="is a folder"):
        read_posterior(tmp_path)


def test_a_second_calibration_leaves_nothing_of_the_first(
    made: Callable[..., Path], fitted: Path, tmp_path: Path
) -> None:
    import shutil

    folder = tmp_path / "results"
    shutil.copytree(fitted, folder)
    (folder / "figures").mkdir(exist_ok=True)
    (folder / "figures" / "my-own.png").write_bytes(b"mine")
    small = {"presets": (WIDE,), "wavelengths": (15.0, 25.0), "amplitudes": (1.5, 2.5), "discrepancy": 0.03}
    write_calibration(
        sp.calibrate(made(**small, seed=4), WIDE, model="rft", method="least-squares"), folder, figures=False
    )
    found = {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}
    assert found == {"calibration.toml", "predictions.csv", "figures/my-own.png"}


def test_friction_of_another_models_torque_is_said(calibration: Path) -> None:
    calibration.write_text(calibration.read_text().replace("synthetic = true", 'synthetic = true\nmodel = "sbt"'))
    words = "B_eff was inferred with model 'sbt' and is another torque with 'rft'"
    found = {model: sp.predict(WIDE, model=model, calibration=calibration).warnings for model in ("sbt", "rft")}
    assert any(words in said for said in found["rft"])
    assert not any("was inferred with model" in said for said in found["sbt"])
    at_rate = sp.predict(WIDE, model="rft", calibration=calibration, tail_rate="1 Hz").warnings
    assert not any("was inferred with model" in said for said in at_rate)
    compared = sp.compare_models(WIDE, models=["sbt", "rft"], calibration=calibration).warnings
    assert any(said.startswith("rft: ") and words in said for said in compared)
    study = {"title": "t", "models": ["sbt", "rft"], "friction": ["rotor"], "robots": [WIDE]}
    assert words in sp.study(study, calibration=calibration).attrs["warnings"]


def test_a_calibration_that_does_nothing_says_so(tmp_path: Path) -> None:
    path = tmp_path / "gap.toml"
    path.write_text(
        '[provenance]\nobservations = "tube.csv"\nsynthetic = true\n[[placement]]\nchannel_diameter = "40 mm"\n'
        '[placement.placement]\ngap = "0.4 mm"\n'
    )
    found = sp.predict(WIDE, model="sbt", calibration=path, tail_rate="1 Hz").warnings
    assert any(f"nothing in {path} is for model 'sbt': the robot's own numbers are used" in said for said in found)
    assert not any("rests on no measurement" in said for said in found)
    study = {"title": "t", "models": ["sbt", "rft"], "friction": ["none"], "robots": [WIDE]}
    warnings = sp.study(study, calibration=path).attrs["warnings"]
    assert "is for model 'sbt'" in warnings
    assert "is for model 'rft'" in warnings
    path.write_text("[fitted]\nnormal_factor = 1.2\n")
    other = sp.predict(WIDE, model="sbt", calibration=path, tail_rate=6.0).warnings
    assert any("is for model 'sbt'" in said for said in other)
    served = sp.predict(WIDE, model="rft", calibration=path, tail_rate=6.0).warnings
    assert not any("nothing in" in said for said in served)


def test_friction_alone_is_idle_at_a_prescribed_rate(calibration: Path) -> None:
    """B_eff is inferred from the rate there, but where it brakes the body."""
    at_rate = {"model": "tube", "calibration": calibration, "tail_rate": "1 Hz", "band": False}
    idle = sp.predict(WIDE, **at_rate)
    assert idle.forward_velocity == pytest.approx(
        sp.predict(WIDE, model="tube", tail_rate="1 Hz", band=False).forward_velocity, rel=1e-12
    )
    assert any(f"nothing in {calibration} is for model 'tube'" in words for words in idle.warnings)
    assert not any("rests on no measurement" in words for words in idle.warnings)
    assert "fitted_by" not in idle.to_dict()
    braked = sp.predict(WIDE, **at_rate, friction="body")
    assert not any("nothing in" in words for words in braked.warnings)
    assert braked.to_dict()["fitted_by"] == "calibration.toml"
    assert not any("nothing in" in words for words in sp.predict(WIDE, **{**at_rate, "tail_rate": None}).warnings)


def test_limits_are_spoken_of_only_where_there_are_some(calibration: Path) -> None:
    study = {"title": "t", "models": ["rft"], "friction": ["rotor"], "robots": [WIDE, "biorob2012-narrow"]}
    other = {"tail.wavelength": "13 mm"}
    warnings = sp.study({**study, "robots": [WIDE]}, calibration=calibration, overrides=other).attrs["warnings"]
    assert "B_eff of 1 of 1 tails was not fitted" in warnings
    assert "intervals" not in warnings


def test_an_answer_names_the_file_that_was_fitted(tmp_path: Path) -> None:
    """A gap is no calibration factor, and yet it was fitted; a file that does not act on a model is not named."""
    path = tmp_path / "gap.toml"
    path.write_text('[[placement]]\nchannel_diameter = "40 mm"\n[placement.placement]\ngap = "0.4 mm"\n')
    found = sp.predict(WIDE, model="tube", calibration=path, tail_rate="1 Hz", band=False)
    assert str(found).splitlines()[0].endswith("friction rotor, fitted by gap.toml")
    assert found.to_dict()["fitted_by"] == "gap.toml"
    assert "nothing is fitted" not in found.known_error
    other = sp.predict(WIDE, model="sbt", calibration=path, tail_rate="1 Hz")
    assert str(other).splitlines()[0].endswith("friction rotor, calibrated")
    assert "fitted_by" not in other.to_dict()
    path.write_text('[contact]\nroughness = "1 um"\n')
    run = sp.simulate(WIDE, model="tube", calibration=path, timing={"duration": "0.05 s"})
    assert run.attrs["fitted_by"] == "gap.toml"
    assert "nothing is fitted" not in run.attrs["known_error"]
