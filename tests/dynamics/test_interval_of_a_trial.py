"""The interval of a trial over what nobody states, on laws that are known."""

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import posteriors
import spirillum as sp
from spirillum.cli.tables.parts import released_columns
from spirillum.dynamics.trial import (
    RUNS,
    UNKNOWNS,
    open_unknowns,
    samples_of,
    samples_of_draws,
    variance_shares,
    with_interval,
)
from spirillum.fitted.posterior_file import PosteriorFile
from spirillum.robot.links import links_of
from spirillum.swimming.motions import ReleasedMotion

WIDE = sp.load("biorob2012-wide")
NOTHING = dict.fromkeys(("wait", "roughness", "friction_coefficient"))
WEIGHT = 0.028


def motion(speed: float, state: str = "swimming") -> ReleasedMotion:
    basis = {"state": state, "wait": {"value": 60.0, "unit": "s"}, "duration": {"value": 20.0, "unit": "s"}}
    return ReleasedMotion({"forward_velocity": speed}, {**basis, "assumption": "assumed"})


def over(run: Any) -> ReleasedMotion:
    unknowns = open_unknowns(WIDE, WEIGHT, NOTHING)
    return with_interval(motion(1e-4), samples_of(WIDE, WEIGHT, unknowns), unknowns, run)


def test_a_power_law_of_the_waiting_time_gives_its_quantiles_and_the_whole_variance() -> None:
    found = over(lambda sample: motion(1e-3 / sample.wait))
    speed = found.intervals["forward_velocity"]
    assert found.values["forward_velocity"] == 1e-4  # that of nominal unknowns
    ends = [1e-3 / (10.0 * 60.0**share) for share in (0.5, 0.95, 0.05)]
    assert (speed.median, speed.low, speed.high) == pytest.approx(ends, rel=0.05)
    shares = {one["name"]: one["share"]["value"] for one in found.basis["unknowns"]}
    assert shares["wait"] == pytest.approx(1.0, abs=1e-9)
    assert sum(shares.values()) == pytest.approx(1.0, abs=1e-9)


def test_shares_of_a_sum_are_those_of_its_terms() -> None:
    points = np.random.default_rng(3).random((4000, 3))
    a, b = 2.0 * points[:, 0] - 1.0, 2.0 * points[:, 1] - 1.0
    found = variance_shares(points, 2.0 * a + b**2)  # variances 4/3 and 4/45
    assert found == pytest.approx([15.0 / 16.0, 1.0 / 16.0, 0.0], abs=0.01)


def test_robots_that_stand_or_are_lost_are_counted_and_told() -> None:
    def run(sample: Any) -> ReleasedMotion:
        if sample.friction_coefficient > 0.27:
            return motion(1e-9, "standing")
        return ReleasedMotion(reason="lost") if sample.wait > 500.0 else motion(1e-4 * sample.wait)

    found = over(run)
    assert 0 < found.basis["standing"] < 0.2 * RUNS
    assert 0 < found.basis["without_answer"] < 0.2 * RUNS
    assert found.intervals["forward_velocity"].low > 1e-4
    said = " ".join(str(line) for line in released_columns({"trial": found.to_dict(), "steady": {"reason": "none"}}))
    assert "trial, 90 % interval of the speed over what is not stated" in said
    assert "waiting time 1" in said
    none = over(lambda _: motion(0.0, "standing"))
    assert not none.intervals
    assert none.basis["standing"] == RUNS


def test_what_is_stated_is_not_varied() -> None:
    stated = {"wait": 5.0, "roughness": None, "friction_coefficient": 0.2}
    known = sp.load("biorob2012-wide", **{"friction.effective": "1e-5 N m s/rad"})
    fluid, center = "fluid.cavitation_pressure", ["body.center_of_mass.x", "body.center_of_mass.radial"]
    assert [one.name for one in open_unknowns(known, WEIGHT, stated)] == ["roughness", "weight", fluid, *center]
    assert [one.name for one in open_unknowns(known, 0.0, stated)] == ["roughness", fluid, *center]
    all_stated = sp.load("biorob2012-wide", **{"friction.effective": "1e-5 N m s/rad", fluid: "none"})
    assert [one.name for one in open_unknowns(all_stated, 0.0, stated)] == ["roughness", *center]
    balanced = sp.load("biorob2012-wide", **{"body.center_of_mass": {"x": "0 mm"}})
    assert not {*center} & {one.name for one in open_unknowns(balanced, WEIGHT, stated)}
    sample = samples_of(known, WEIGHT, open_unknowns(known, WEIGHT, stated))
    assert {one.wait for one in sample} == {None}
    assert {one.robot.friction.effective for one in sample} == {1e-5}
    masses = np.array([one.robot.body.mass for one in sample])
    assert np.ptp(masses) == pytest.approx(0.2 * WEIGHT / 9.81, rel=0.1)
    centers = [one.robot.body.center_of_mass for one in sample]
    along, aside = (np.array([getattr(one, name) for one in centers]) for name in ("x", "radial"))
    length, radius = known.body.length, 0.5 * known.body.diameter
    along = along - links_of(known).body.centre[0]  # of uniform density
    assert (along.min(), along.max()) == pytest.approx((-0.05 * length, 0.05 * length), rel=0.1)
    assert (aside.min(), aside.max()) == pytest.approx((0.0, 0.05 * radius), abs=0.005 * radius)


COEFFICIENTS = (0.08, 0.1, 0.14)


def posterior() -> PosteriorFile:
    """Three draws of a fit of trials, made up."""
    draws = {"friction_coefficient": np.array([COEFFICIENTS]).T}
    return PosteriorFile(
        source="made up",
        sha256="",
        model="tube",
        observations="none",
        synthetic=True,
        channels=(0.04,),
        body=(0.018, 0.035),
        draws=draws,
        middle={name: np.median(values, axis=0) for name, values in draws.items()},
        discrepancy={},
        error={},
        friction=(),
        friction_reading="",
        answer="trial",
    )


def test_draws_of_a_fit_take_the_place_of_what_it_determines() -> None:
    unknowns = open_unknowns(WIDE, WEIGHT, {**NOTHING, "friction_coefficient": 0.1})
    found, plain = samples_of_draws(WIDE, WEIGHT, unknowns, posterior()), samples_of(WIDE, WEIGHT, unknowns)
    assert {one.friction_coefficient for one in found} == {None}  # that of the draw
    assert [one.draw for one in found] == [number % len(COEFFICIENTS) for number in range(RUNS)]
    assert [one.wait for one in found] == [one.wait for one in plain]
    assert [one.robot.body.mass for one in found] == [one.robot.body.mass for one in plain]


def test_a_discrepancy_widens_the_interval_of_what_it_acts_on() -> None:
    unknowns = open_unknowns(WIDE, WEIGHT, NOTHING)
    samples = samples_of(WIDE, WEIGHT, unknowns)
    factors, speeds = np.linspace(0.9, 1.1, RUNS), np.array([1e-3 / one.wait for one in samples if one.wait])
    found = with_interval(
        motion(1e-4),
        samples,
        unknowns,
        lambda sample: motion(1e-3 / (sample.wait or 1.0)),
        discrepancy=lambda _, runs: {"forward_velocity": factors[: len(runs)]},
    )
    ends = np.quantile(speeds * factors, [0.5, 0.05, 0.95])
    speed = found.intervals["forward_velocity"]
    assert (speed.median, speed.low, speed.high) == pytest.approx(ends, rel=1e-12)


def test_the_trial_of_a_posterior_is_the_run_of_its_median(tmp_path: Path) -> None:
    """`simulate` with draws 0; the held answer of a fit of trials has no interval, and says so."""
    free = {"friction_coefficient": 0.02, "shared_friction": 1.1e-5}
    path = posteriors.write_trials(tmp_path / "posterior.nc", free)
    found = sp.predict("biorob2012-wide", posterior=path, duration="1 s")
    run = sp.simulate("biorob2012-wide", posterior=path, draws=0, timing={"duration": "1 s"})
    assert found.trial is not None
    assert found.trial.values["forward_velocity"] == pytest.approx(float(run["mean_forward_velocity_on"]), rel=1e-9)
    assert run.attrs["friction_coefficient"] == pytest.approx(0.02, rel=0.05)
    assert found.intervals is None
    assert any("the held answer has its median and no interval" in str(note) for note in found.warnings)
    of_held = posteriors.write_trials(tmp_path / "held.nc", free, answer="held")
    beside = sp.predict("biorob2012-wide", posterior=of_held, duration="1 s")
    assert [note.code for note in beside.warnings].count("fit-other-motion") == 1
    assert any("compare its observations with the column held, not with trial" in note for note in beside.warnings)
    with pytest.raises(sp.InputError, match="which was fitted to trials; allowed: motion 'free'"):
        sp.simulate("biorob2012-wide", posterior=path, motion="held")


def test_a_posterior_of_another_channel_is_flagged_or_left_out(tmp_path: Path) -> None:
    """A gap is that of its channel; a roughness acts in any, outside the geometry that it was fitted to."""
    narrow: Any = {"duration": "0.1 s", "interval": True, "in_tube": {"wait": "1 s"}}
    plain = sp.predict("biorob2012-narrow", **narrow).trial
    fitted = {name: posteriors.write_trials(tmp_path / f"{name}.nc", {name: 3e-5}) for name in ("gap", "roughness")}
    other = sp.predict("biorob2012-narrow", posterior=fitted["gap"], **narrow)
    assert other.trial is not None
    assert plain is not None
    assert other.trial.intervals == plain.intervals
    assert [note.code for note in other.warnings if note.code.startswith(("fit", "calibration"))] == ["fit-not-used"]
    run = sp.simulate("biorob2012-narrow", posterior=fitted["gap"], timing={"duration": "0.1 s"})
    assert "nothing in gap.nc" in str(run.attrs["notes"])
    assert "mean_forward_velocity_low" not in run
    acting = sp.simulate("biorob2012-narrow", posterior=fitted["roughness"], draws=0, timing={"duration": "0.1 s"})
    assert "outside its geometry, channel.diameter = 30 mm (fitted to 40 mm)" in str(acting.attrs["notes"])


def test_what_no_trial_can_have_is_refused() -> None:
    """The trial that a request describes is refused; one that was not described has a reason in its column."""
    for settings, words in (
        ({"roughness": "6 mm"}, r"roughness = 6000 um with a gap of 500 um at the start"),
        ({"roughness": "-1 mm"}, r'roughness = "-1 mm" is out of range; allowed: 1 nm to 100 m'),
        (
            {"duration": "1e9 s"},
            r"duration = 1e\+09 s .*; allowed: at most \d+ s, 2000 turns of the tail",
        ),
        ({"duration": 2.0, "motion": "held"}, "duration = 2 s is of released motion"),
        ({"in_tube": {"wait": "1 min"}, "motion": "held"}, r"in_tube\.wait = 60 s is of released motion"),
        ({"roughness": 1e-5, "motion": "held"}, "roughness = 1e-05 m is of released motion"),
        ({"duration": 1e-9}, r"duration = 1e-09 s; allowed: at least [\d.e-]+ s, a millionth of a turn"),
    ):
        with pytest.raises(sp.InputError, match=words):
            sp.predict("biorob2012-wide", **settings)


def test_a_trial_that_no_robot_or_model_has_is_refused_before_the_work(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("spirillum.dynamics.prediction.predict_steady", None)
    for robot, settings in (
        ("ecoli", {}),
        ("biorob2012-wide", {"model": "sbt"}),
        ("biorob2012-wide", {"tail_rate": 1.0}),
    ):
        with pytest.raises(sp.InputError, match="interval = True is of released motion in the tube"):
            sp.predict(robot, interval=True, **settings)


def test_the_page_of_unknowns_lists_all_of_them() -> None:
    page = (Path(__file__).parents[2] / "docs" / "unknowns.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `([\w.]+)` \| ([\w-]+) \| ([\d.e-]+) to ([\d.e-]+) \|", page, re.MULTILINE)
    listed = [(name, kind, float(low), float(high)) for name, kind, low, high in rows]
    assert listed == [(one.name, one.kind, one.low, one.high) for one in UNKNOWNS]
    assert math.log2(RUNS).is_integer()


@pytest.mark.slow
def test_planted_truths_lie_inside_as_often_as_stated() -> None:
    """A hundred robots that swim, each with unknowns drawn from the stated distributions: 85 to 95 inside.

    This tests the sampling, not the physics. At a rate of the drive, and over two seconds, a trial is quick.
    """
    robot = sp.load("biorob2012-wide", **{"drive.kind": "rate", "drive.rate": "1.2 Hz"})
    timing = {"duration": "2 s", "band": False}
    answer = sp.predict(robot, interval=True, **timing).trial
    assert answer is not None
    speed = answer.intervals["forward_velocity"]
    unknowns = open_unknowns(robot, WEIGHT, NOTHING)
    weight = robot.derived()["submerged_weight"].value
    rng, inside, swimming = np.random.default_rng(11), 0, 0
    while swimming < 100:
        (sample,) = samples_of(robot, weight, unknowns, rng.random((1, len(unknowns))))
        in_tube = {"wait": sample.wait, "friction_coefficient": sample.friction_coefficient}
        one = sp.predict(sample.robot, roughness=sample.roughness, in_tube=in_tube, **timing).trial
        assert one is not None
        if one.reason or one.basis["state"] == "standing" or one.values["forward_velocity"] <= 0.0:
            continue
        swimming += 1
        inside += speed.low <= one.values["forward_velocity"] <= speed.high
    assert 85 <= inside <= 95
