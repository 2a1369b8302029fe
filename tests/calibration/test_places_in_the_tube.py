"""Gap, pitch, roughness and dry friction of robots in their tubes: recovered, refused, and used by what follows.

The observations are synthetic. In the slow tests they are computed by the model `tube` solved at one place, which
shares neither table nor interpolation with the fits; in the others by its table, which is held against such a place.
"""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import root

import spirillum as sp
from spirillum import InputError
from spirillum.calibration.calibrated import Calibrated
from spirillum.fluid.tube.library import tabled
from spirillum.results.calibration import write_calibration
from spirillum.robot.batch import RobotBatch
from spirillum.robot.load import load
from spirillum.robot.placement import Placement, gap_on_asperities
from spirillum.swimming.balance import joined
from spirillum.swimming.sampled_resistance import TubeResistance
from spirillum.swimming.steady import swim_on_floor, weights_in_fluid, with_dry_friction
from synthetic_experiments import SHORT

WIDE, NARROW = "biorob2012-wide", "biorob2012-narrow"
GAP = 5e-4

Speeds = tuple[float, float, float]
"""Forward velocity, m/s, rates of tail and body, rad/s."""


def written(path: Path, robots: dict[str, Speeds], *, error: float = 0.01, trials: int = 5, seed: int = 1) -> Path:
    """An observations file of robots with such speeds."""
    rng = np.random.default_rng(seed)
    lines = [
        "# synthetic",
        "channel_diameter_mm,wavelength_mm,amplitude_mm,trial,forward_velocity_mm_s,tail_rate_Hz,body_rate_Hz",
    ]
    for name, (speed, tail, body) in robots.items():
        channel = load(name).channel
        assert channel is not None
        for trial in range(trials):
            off = 1.0 + error * rng.normal(size=2)
            numbers = (1e3 * speed * off[0], tail / (2 * np.pi), body * off[1] / (2 * np.pi))
            lines.append(f"{1e3 * channel.diameter:g},25,2.5,{trial},{','.join(f'{n:.9g}' for n in numbers)}")
    path.write_text("\n".join(lines) + "\n")
    return path


def placed(gap: float, pitch: float = 0.0) -> Placement:
    return Placement.of({"gap": gap, "pitch": pitch})


def by_table(name: str, gap: float, pitch: float = 0.0) -> Speeds:
    answer = sp.predict(name, model="tube", placement={"gap": gap, "pitch": pitch}, tail_rate="1.3 Hz")
    return answer.forward_velocity, answer.tail_rotation_rate, answer.body_rotation_rate


def solved(name: str, gap: float, pitch: float = 0.0) -> Speeds:
    """Without any table."""
    robot = load(name, **{"model.tube.tolerance": 0.02})
    rate = 2.6 * np.pi
    swum = sp.swim(RobotBatch.of(robot, placed(gap, pitch)), "tube", tail_rate=np.array([rate]), friction="none")
    return float(swum.forward_velocity[0]), rate, float(swum.body_rotation_rate[0])


def on_asperities(name: str, roughness: float, coefficient: float, tail_rate: float) -> Speeds:
    robot = load(name)
    batch = RobotBatch.of(robot, placed(float(gap_on_asperities(roughness))))
    model = tabled(batch)
    assert model is not None
    swum = swim_on_floor(batch, model, [robot], coefficient, tail_rate=np.array([tail_rate]), friction="none")
    return float(swum.forward_velocity[0]), tail_rate, float(swum.body_rotation_rate[0])


@pytest.fixture(scope="module")
def observed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Observations of a robot at one gap."""
    return written(tmp_path_factory.mktemp("tube") / "o.csv", {WIDE: by_table(WIDE, GAP)})


@pytest.fixture(scope="module")
def fitted(observed: Path) -> Calibrated:
    """The gap that they give."""
    return sp.calibrate(observed, WIDE, model="tube", free="gap", sampling=SHORT)


@pytest.fixture(scope="module")
def one_gap(observed: Path, fitted: Calibrated) -> Path:
    """A folder with the observations, and the posterior of the gap."""
    write_calibration(fitted, observed.parent / "fitted", figures=False)
    return observed.parent


def test_a_gap_that_explains_nothing_is_not_said_to_matter_nowhere(tmp_path: Path) -> None:
    """A robot ten times as slow as at any gap: the fit ends where the range does, and a gap is seen elsewhere."""
    speed, tail, body = by_table(NARROW, 3e-4)
    path = written(tmp_path / "slow.csv", {NARROW: (0.1 * speed, tail, 0.1 * body)})
    with pytest.raises(
        InputError, match=r"free = 'gap': the fit drives it to the end of its range, 0\.1 mm, and no value"
    ):
        sp.calibrate(path, [NARROW], model="tube", free="gap", method="least-squares")


@pytest.mark.parametrize("ends", ["open", "closed"])
@pytest.mark.parametrize(("gap", "pitch", "yaw"), [(3e-4, 0.0, 0.0), (3e-4, 0.03, 0.0), (8e-4, -0.01, 0.02)])
def test_resistance_at_draws_is_that_of_the_model_at_each_place(
    gap: float, pitch: float, yaw: float, ends: str
) -> None:
    robots = [load(WIDE), load(NARROW)]
    placement = Placement.of({"gap": gap, "pitch": pitch, "yaw": yaw, "ends": ends})
    batches = [RobotBatch.of(robot, placement) for robot in robots]
    for batch in batches:
        model = tabled(batch)
        assert model is not None
        other = batch.placed(Placement.of({"yaw": yaw, "ends": ends}))
        draws = {
            "gap": np.array([[gap], [2.0 * gap]]),
            "pitch": np.full((2, 1), pitch),
            "viscosity": np.full((2, 1), 2.0 * float(batch.viscosity[0])),
        }
        found = TubeResistance.of(other, model).whole(draws)
        assert found[0, 0] == pytest.approx(2.0 * joined(model.axial(batch))[0], rel=1e-10)
        assert found[1, 0, 1, 1] < 0.95 * found[0, 0, 1, 1]  # a wider gap turns more easily


def test_dry_friction_balances_forces_and_torques() -> None:
    """Against a root of the equations as they stand in the documentation, with the direction of sliding in them."""
    robot = load(WIDE)
    batch = RobotBatch.of(robot, placed(2e-5))
    model = tabled(batch)
    assert model is not None
    r = joined(model.axial(batch))[0]
    a, rate = 9e-3, 8.0
    weight = float(weights_in_fluid([robot])[0])
    for coefficient in (0.05, 0.15):
        load_ = coefficient * weight

        def left(q: np.ndarray, load_: float = load_) -> np.ndarray:
            u, spin = q * [1e-4, 1e-2]
            s = np.sqrt(u**2 + (a * spin) ** 2 + (1e-4 * a * rate) ** 2)
            force = r[0] @ [u, spin, rate] + load_ * u / s
            torque = (r[1] + r[2]) @ [u, spin, rate] + load_ * a * a * spin / s
            return np.array([force, torque / a])

        swum = swim_on_floor(batch, model, [robot], coefficient, tail_rate=np.array([rate]), friction="none")
        found = np.array([swum.forward_velocity[0] / 1e-4, swum.body_rotation_rate[0] / 1e-2])
        exact = root(left, found * 1.05, options={"xtol": 1e-12})
        assert exact.success
        assert found == pytest.approx(exact.x, rel=1e-9)


def test_a_robot_that_friction_holds_hardly_moves_and_one_without_is_free() -> None:
    r = joined(tabled(RobotBatch.of(load(WIDE), placed(2e-5))).axial(RobotBatch.of(load(WIDE), placed(2e-5))))  # type: ignore[union-attr]
    rate, radius = np.array([8.0]), np.array([9e-3])
    assert with_dry_friction(r, np.zeros(1), radius, rate) == pytest.approx(r)
    stuck = with_dry_friction(r, np.full(1, 1.0), radius, rate)  # a newton on twenty millinewtons of thrust
    assert stuck[0, 0, 0] == pytest.approx(1.0 / (1e-4 * radius[0] * rate[0]), rel=1e-2)


def test_a_robot_solved_without_any_table_swims_as_by_its_table() -> None:
    """At a wide gap, which is solved for in less time."""
    speed, _, turning = by_table(WIDE, 4e-3)
    assert solved(WIDE, 4e-3) == pytest.approx((speed, 2.6 * np.pi, turning), rel=0.02)


@pytest.mark.slow
def test_a_gap_solved_without_any_table_lies_in_the_interval(tmp_path: Path) -> None:
    path = written(tmp_path / "o.csv", {WIDE: solved(WIDE, GAP)})
    found = sp.calibrate(path, WIDE, model="tube", free="gap", method="least-squares")
    assert found.values["gap"].low < GAP < found.values["gap"].high
    assert found.values["gap"].value == pytest.approx(GAP, rel=0.1)
    stated = tabled(RobotBatch.of(load(WIDE))).table_of(RobotBatch.of(load(WIDE)), 0).error_without_yaw  # type: ignore[union-attr]
    assert found.problem.interpolation_error == max(stated["forward_velocity"], stated["body_rotation_rate"])
    assert any("resistances are interpolated" in warning for warning in found.warnings)


def test_intervals_of_gap_and_pitch_hold_what_was_planted(tmp_path: Path) -> None:
    """Two means of one tail leave nothing to judge the model by: the intervals are wide, and not those of the prior."""
    path = written(tmp_path / "o.csv", {WIDE: by_table(WIDE, 4e-4, 0.03)})
    found = sp.calibrate(path, WIDE, model="tube", free="gap,pitch", method="least-squares")
    for name, truth in (("gap", 4e-4), ("pitch", 0.03)):
        assert found.values[name].low < truth < found.values[name].high
    assert not any("assumed level" in warning for warning in found.warnings)
    level = sp.calibrate(path, WIDE, model="tube", free="gap", method="least-squares")
    assert any("assumed level" in warning for warning in level.warnings)
    assert any("trade off" in warning for warning in found.warnings)
    assert any("as many free numbers as means of the speed" in warning for warning in found.warnings)


def test_a_posterior_that_piles_up_at_the_end_of_its_prior_says_so(fitted: Calibrated, tmp_path: Path) -> None:
    """A robot a twentieth slower than at the least gap that a fit tries; at a gap inside, nothing is said."""
    speed, tail, body = by_table(WIDE, 1e-4)
    path = written(tmp_path / "slow.csv", {WIDE: (0.95 * speed, tail, 1.05 * body)}, error=0.005)
    found = sp.calibrate(path, WIDE, model="tube", free="gap", sampling=SHORT)
    said = [sentence for sentence in found.warnings if "of the posterior lies at the" in sentence]
    assert len(said) == 1
    assert "gap" in said[0]
    assert "at the lower end of its prior (0.0001 m)" in said[0]
    assert not any("of the posterior lies" in sentence for sentence in fitted.warnings)


def test_planted_roughness_and_dry_friction_come_back(tmp_path: Path) -> None:
    truth = {WIDE: on_asperities(WIDE, 2e-5, 0.12, 5.0), NARROW: on_asperities(NARROW, 2e-5, 0.12, 9.0)}
    path = written(tmp_path / "o.csv", truth, trials=3)
    found = sp.calibrate(
        path, [WIDE, NARROW], model="tube", free="roughness,friction_coefficient", method="least-squares"
    )
    assert found.values["roughness"].low < 2e-5 < found.values["roughness"].high
    assert found.values["friction_coefficient"].low < 0.12 < found.values["friction_coefficient"].high
    assert found.values["friction_coefficient"].value == pytest.approx(0.12, rel=0.1)
    write_calibration(found, tmp_path / "fitted", figures=False)
    file = tmp_path / "fitted" / "calibration.toml"
    answer = sp.predict(WIDE, model="tube", calibration=file, tail_rate=5.0)
    assert answer.batch.placement.gap == pytest.approx(found.values["roughness"].value / (1.0 + np.sqrt(0.5)))
    assert answer.forward_velocity == pytest.approx(found.predicted["advance"][0][0] * 5.0, rel=1e-6)
    assert answer.body_rotation_rate == pytest.approx(found.predicted["turning"][0][0] * 5.0, rel=1e-6)
    run = sp.simulate(WIDE, calibration=file, timing={"duration": "0.05 s"})
    assert run.attrs["motion"] == "free"
    assert "dry friction is fitted and acts on a free robot: the run is a free motion" in run.attrs["warnings"]
    assert "the calibration was fitted to robots held at a pose" in run.attrs["warnings"]
    with pytest.raises(InputError, match="motion = 'held' has no dry friction"):
        sp.simulate(WIDE, calibration=file, motion="held", timing={"duration": "0.05 s"})


def test_predictions_with_a_posterior_lie_where_it_does(one_gap: Path) -> None:
    posterior = one_gap / "fitted" / "posterior.nc"
    answer = sp.predict(WIDE, model="tube", posterior=posterior, tail_rate="1.3 Hz")
    speed = by_table(WIDE, GAP)[0]
    assert answer.band is None
    assert answer.intervals is not None
    assert answer.batch.placement.gap == pytest.approx(GAP, rel=0.15)
    assert answer.intervals.low["forward_velocity"] < speed < answer.intervals.high["forward_velocity"]
    own = sp.predict(WIDE, model="tube", posterior=posterior, posterior_for="measured", tail_rate="1.3 Hz")
    assert own.forward_velocity == pytest.approx(speed, rel=0.02)
    given = sp.predict(
        WIDE, model="tube", posterior=posterior, placement={"gap": 1e-3, "pitch": 0.02}, tail_rate="1.3 Hz"
    )
    assert given.batch.placement.gap == pytest.approx(1e-3)
    assert given.intervals is not None
    middle = sp.predict(WIDE, model="tube", placement={"gap": 1e-3, "pitch": 0.02}, tail_rate="1.3 Hz")
    assert given.intervals.middle["forward_velocity"] == pytest.approx(middle.forward_velocity, rel=0.03)


def test_what_was_fitted_in_another_channel_is_not_said_to_be_used(one_gap: Path) -> None:
    """A gap is that of its channel: elsewhere the answer is that without the fit, and says so."""
    plain = sp.predict(NARROW, model="tube", tail_rate="1.3 Hz")
    for option, name in (("posterior", "posterior.nc"), ("calibration", "calibration.toml")):
        answer = sp.predict(NARROW, model="tube", tail_rate="1.3 Hz", **{option: one_gap / "fitted" / name})
        assert answer.forward_velocity == plain.forward_velocity
        assert (answer.fitted_by, answer.intervals) == ("", None)
        assert answer.known_error == plain.known_error
        assert answer.band is not None
        (said,) = [words for words in answer.warnings if "nothing in" in words]
        assert "is for the channel of this robot (it was fitted in 40 mm)" in said
        assert not any("synthetic" in words for words in answer.warnings)


def test_a_posterior_of_places_needs_a_table(one_gap: Path) -> None:
    with pytest.raises(InputError, match="has no table of its tube"):
        sp.predict(
            load(WIDE, **{"tail.wavelength": "21 mm"}),
            model="tube",
            posterior=one_gap / "fitted" / "posterior.nc",
            tail_rate="1 Hz",
        )


def test_a_study_does_not_take_draws_of_places(one_gap: Path) -> None:
    study = {"title": "one", "robots": [WIDE], "models": ["tube"]}
    with pytest.raises(InputError, match="has its own pose"):
        sp.study(study, posterior=one_gap / "fitted" / "posterior.nc")


def test_held_runs_begin_at_the_place_of_each_draw(one_gap: Path) -> None:
    run = sp.simulate(WIDE, posterior=one_gap / "fitted" / "posterior.nc", draws=20, timing={"duration": "0.3 s"})
    steady = sp.predict(WIDE, model="tube", posterior=one_gap / "fitted" / "posterior.nc")
    speed = float(run["mean_forward_velocity_steady"])
    assert speed == pytest.approx(steady.forward_velocity, rel=1e-3)
    assert float(run["mean_forward_velocity_steady_low"]) < speed < float(run["mean_forward_velocity_steady_high"])
    assert "draws = 20: a 95 % interval from so few" in run.attrs["warnings"]


def test_suggestions_ask_robots_with_tables_and_name_the_others(one_gap: Path) -> None:
    candidates = one_gap / "candidates.csv"
    candidates.write_text("channel_diameter_mm,wavelength_mm,amplitude_mm\n40,25,2.5\n40,21,2.5\n")
    found = sp.suggest(one_gap / "fitted" / "posterior.nc", WIDE, candidates=candidates)
    assert len(found.candidates) == 1
    assert 0.0 < found.candidates[0].narrowing["gap"] < 1.0
    assert any("21 x 2.5 mm is left out: it has no table" in warning for warning in found.warnings)


@pytest.mark.parametrize(
    ("free", "words"),
    [
        ("gap,roughness", "free = 'gap' together with 'roughness'"),
        ("friction_coefficient", "free = 'friction_coefficient' without 'roughness'"),
        ("body_drag", "free = 'body_drag' with model 'tube'"),
    ],
)
def test_what_cannot_be_told_apart_is_refused(one_gap: Path, free: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        sp.calibrate(one_gap / "o.csv", WIDE, model="tube", free=free)


def test_more_numbers_of_one_robot_than_it_has_means_are_refused(one_gap: Path) -> None:
    with pytest.raises(InputError, match="fewer than the 3 free numbers"):
        sp.calibrate(one_gap / "o.csv", WIDE, model="tube", free="roughness,friction_coefficient,pitch")


def test_robots_without_tables_are_named(made: Callable[..., Path]) -> None:
    path = made(presets=(WIDE,), wavelengths=(21.0, 25.0), amplitudes=(2.5,), trials=1)
    with pytest.raises(InputError, match=r"1 of 2 have none \(channel 40 mm, tail 21 x 2.5 mm\); allowed: --prepare"):
        sp.calibrate(path, WIDE, model="tube", free="gap")


def test_dry_friction_needs_the_tails_rate(tmp_path: Path) -> None:
    path = tmp_path / "o.csv"
    path.write_text(
        "channel_diameter_mm,wavelength_mm,amplitude_mm,trial,forward_velocity_mm_s,motor_rate_Hz\n"
        "40,25,2.5,1,0.5,1.5\n40,25,2.5,2,0.51,1.5\n40,25,2.5,3,0.49,1.5\n"
    )
    with pytest.raises(InputError, match="column tail_rate_Hz: empty"):
        sp.calibrate(path, WIDE, model="tube", free="roughness,friction_coefficient")


def _held(found: Sequence[bool]) -> float:
    return float(np.mean(found))


@pytest.mark.slow
def test_intervals_hold_the_truth_over_many_experiments(tmp_path: Path) -> None:
    """Of 60 experiments with gap, roughness and friction planted, about 95 % of the intervals hold each."""
    held: dict[str, list[bool]] = {"gap": [], "roughness": [], "friction_coefficient": []}
    rng = np.random.default_rng(4)
    for seed in range(60):
        gap = float(1e-4 * 10.0 ** rng.uniform(0.1, 0.9))
        path = written(tmp_path / "o.csv", {n: by_table(n, gap) for n in (WIDE, NARROW)}, seed=seed, trials=4)
        found = sp.calibrate(path, [WIDE, NARROW], model="tube", free="gap", method="least-squares")
        held["gap"] += [item.low < gap < item.high for item in found.values.values()]
        rough, mu = float(1e-6 * 10.0 ** rng.uniform(0.3, 1.6)), float(rng.uniform(0.05, 0.2))
        rubbed = {WIDE: on_asperities(WIDE, rough, mu, 7.0), NARROW: on_asperities(NARROW, rough, mu, 9.0)}
        path = written(tmp_path / "o.csv", rubbed, seed=seed, trials=4)
        found = sp.calibrate(
            path, [WIDE, NARROW], model="tube", free="roughness,friction_coefficient", method="least-squares"
        )
        for name, truth in (("roughness", rough), ("friction_coefficient", mu)):
            held[name].append(found.values[name].low < truth < found.values[name].high)
    assert all(_held(found) > 0.85 for found in held.values()), {name: _held(found) for name, found in held.items()}


@pytest.mark.slow
def test_tube_is_ranked_with_as_many_numbers_as_the_others(tmp_path: Path) -> None:
    truth = {WIDE: by_table(WIDE, 4e-4, 0.02), NARROW: by_table(NARROW, 3e-4, 0.02)}
    path = written(tmp_path / "o.csv", truth)
    ranking = sp.rank_models(path, [WIDE, NARROW], models=["tube", "sbt"], sampling=SHORT)
    counts = {item.model: len(item.fit.problem.coordinates) for item in ranking.ranked}
    assert counts == {"tube": 4, "sbt": 4}
    assert "2 tails are too few" in ranking.verdict()


@pytest.mark.slow
def test_a_pitched_place_solved_without_any_table_lies_in_the_intervals(tmp_path: Path) -> None:
    truth = {name: solved(name, 4e-4, 0.03) for name in (WIDE, NARROW)}
    path = written(tmp_path / "o.csv", truth)
    found = sp.calibrate(path, [WIDE, NARROW], model="tube", free="gap,pitch", method="least-squares")
    for channel in ("[40 mm]", "[30 mm]"):
        assert found.values[f"gap{channel}"].low < 4e-4 < found.values[f"gap{channel}"].high
        assert found.values[f"pitch{channel}"].low < 0.03 < found.values[f"pitch{channel}"].high


@pytest.mark.parametrize("name", [WIDE, NARROW])
def test_a_fitted_roughness_is_that_on_which_a_run_comes_to_rest(name: str) -> None:
    """At rest between its heavier and its lighter end, at mid-length; dry friction keeps it where its film has gone."""
    roughness = 2e-5
    run = sp.simulate(
        name,
        model="tube",
        placement=placed(roughness),
        roughness=roughness,
        in_tube={"wait": "300 s", "friction_coefficient": 0.3},
        timing={"duration": "0.1 s"},
    ).isel(time=0)
    length = load(name).body.length - load(name).body.diameter
    middle = float(run["wall_gap"]) + 0.5 * length * abs(np.sin(float(run["wall_pitch"])))
    assert middle == pytest.approx(float(gap_on_asperities(roughness)), rel=0.03)
