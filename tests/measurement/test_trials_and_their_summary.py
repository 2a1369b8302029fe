"""What a trial measures, what a flag spoils, and what all trials share."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.stats import t

import spirillum as sp
from spirillum.measurement.measure import Measurement, compared, summary_of
from spirillum.measurement.outliers import without_codec_lag
from spirillum.measurement.series import observation_rows
from spirillum.measurement.trials import RATE_NAMES, WOBBLES, Trial, trial_of
from spirillum.units import Hz
from spirillum.virtual.optics import VirtualLens
from spirillum.vision.flag import Flag
from spirillum.vision.track.track import Track

Make = Callable[..., Track]
MakeTrial = Callable[..., Trial]
PIXEL = 0.25e-3
"""Length of a pixel of these tracks, m."""


def test_motor_rate_is_tail_less_body_and_truth_is_inside(make_trial: MakeTrial) -> None:
    trial = make_trial()
    truth = {
        "forward_velocity": 1e-3,
        "body_rotation_rate": -0.7,
        "tail_rotation_rate": 7.0,
        "motor_rotation_rate": 7.7,
    }
    for name, value in truth.items():
        item = trial.quantities[name]
        assert item.low <= value <= item.high
        assert item.value == pytest.approx(value, rel=2e-3)
    body, tail, motor = (trial.quantities[f"{part}_rotation_rate"].value for part in ("body", "tail", "motor"))
    assert motor == pytest.approx(tail - body, rel=1e-12)
    assert trial.flags == ()


def test_scale_widens_the_velocity_of_a_trial_and_not_its_rates(make_trial: MakeTrial) -> None:
    sure, unsure = (trial.quantities for trial in (make_trial(), make_trial(scale_error=0.07)))
    v, w = sure["forward_velocity"], unsure["forward_velocity"]
    assert w.value == v.value
    assert w.high - w.value == pytest.approx(np.hypot(v.high - v.value, 1.959964 * 0.07 * v.value), rel=1e-6)
    assert sure["tail_rotation_rate"] == unsure["tail_rotation_rate"]


def test_scale_does_not_shrink_with_the_number_of_trials(make_trial: MakeTrial) -> None:
    trials = [make_trial(f"{seed}", seed=seed, scale_error=0.07) for seed in range(3)]
    for count in (2, 3):
        item = summary_of(trials[:count]).quantities["forward_velocity"]
        values = np.array([trial.quantities["forward_velocity"].value for trial in trials[:count]])
        student = t.ppf(0.975, count - 1) * values.std(ddof=1) / np.sqrt(count)
        assert item.high - item.value == pytest.approx(np.hypot(student, 1.959964 * 0.07 * values.mean()), rel=1e-9)
        assert item.high - item.value >= 1.95 * 0.07 * values.mean()


def test_rates_over_trials_have_students_interval(make_trial: MakeTrial) -> None:
    trials = [make_trial(seed=k, tail=7.0 + 0.1 * k) for k in range(5)]
    item = summary_of(trials).quantities["tail_rotation_rate"]
    half = t.ppf(0.975, 4) * np.std(0.1 * np.arange(5), ddof=1) / np.sqrt(5)
    assert item.value == pytest.approx(7.2, rel=1e-3)
    assert item.high - item.value == pytest.approx(half, rel=5e-2)


@pytest.mark.parametrize(("tails", "unlike"), [((7.0, 7.2, 7.4), False), ((7.0, 9.5), True), ((7.0, -7.0), True)])
def test_trials_that_are_no_repeats_are_said_to_be_averaged(
    make_trial: MakeTrial, tails: tuple[float, ...], unlike: bool
) -> None:
    trials = [make_trial(f"{seed}", seed=seed, tail=tail) for seed, tail in enumerate(tails)]
    found = Measurement(tuple(trials), summary_of(trials), sp.load("biorob2012-wide"), "setup.toml").warnings
    assert [note.fields for note in found if "as repeats" in note] == (
        [("tail_rotation_rate", "motor_rotation_rate")] if unlike else []
    )


def test_one_trial_keeps_its_own_interval(make_trial: MakeTrial) -> None:
    trial = make_trial()
    assert summary_of([trial]).quantities["tail_rotation_rate"] == trial.quantities["tail_rotation_rate"]


def test_a_flag_spoils_its_quantity_and_what_follows_from_it(make_trial: MakeTrial) -> None:
    flag = Flag("aliased-tail", "the tail turns too fast for this camera", ("tail_rotation_rate",))
    trial = make_trial(flags=(flag,))
    answer = trial.to_dict()
    for name in ("tail_rotation_rate", "motor_rotation_rate", "lateral_wobble_at_tail_rate"):
        assert answer[name]["value"] is None
        assert answer[name]["reason"] == flag.sentence
        assert "low" not in answer[name]
    assert answer["body_rotation_rate"]["value"] is not None
    both = summary_of([trial, make_trial(seed=1)])
    assert both.counts["tail_rotation_rate"] == 1
    assert both.counts["body_rotation_rate"] == 2


def test_wobble_has_its_amplitude_at_the_rate_of_its_part_only(make_track: Make, robot: Any) -> None:
    found = trial_of(make_track(wobble=2e-4, body=-1.9), robot).quantities
    tail, body = found["lateral_wobble_at_tail_rate"], found["lateral_wobble_at_body_rate"]
    assert tail.low <= 2e-4 <= tail.high
    pixel = make_track().scale.length_per_pixel
    errors = np.hypot(0.03 * pixel, 0.12 * 2e-4)  # what tracking may add, and what edges beside the body hold back
    assert tail.high - tail.low == pytest.approx(2 * 1.959964 * errors, rel=0.05)
    assert body.low < 1e-5
    assert body.value < 1e-5


def test_a_seal_that_swings_beside_the_pose_widens_the_wobble(make_track: Make, robot: Any) -> None:
    """Lines of a grid under a glass cover hold the pose: 0.05 mm were found of 0.35."""
    track = make_track(wobble=5e-5)
    aside = 3e-4 * np.cos(track.tail_phase)
    held, steady = (trial_of(replace(track, sideways=one), robot).quantities for one in (aside, 0.0 * aside))
    name = "lateral_wobble_at_tail_rate"
    assert steady[name].high < 1e-4
    assert held[name].low == 0.0
    assert held[name].high == pytest.approx(5e-5 + 1.959964 * 3e-4, rel=0.02)
    assert held["forward_velocity"] == steady["forward_velocity"]


def test_a_body_that_hardly_turns_says_why_its_interval_is_wide(make_trial: MakeTrial) -> None:
    slow = make_trial(body=-0.02)
    assert "short-turn" in [flag.name for flag in slow.flags]
    item, fast = slow.quantities["body_rotation_rate"], make_trial().quantities["body_rotation_rate"]
    assert item.low <= -0.02 <= item.high
    assert item.high - item.low > fast.high - fast.low


def test_two_frames_of_a_camera_are_not_a_measurement(make_track: Make, robot: Any) -> None:
    trial = trial_of(make_track(span=2 / 30), robot)
    assert trial.track.time.size == 2
    assert [flag.name for flag in trial.flags] == ["too-few-frames"]
    answer = trial.to_dict()
    for name in RATE_NAMES:
        assert answer[name]["value"] is None
        assert answer[name]["reason"] == "only 2 frames were measured; a rate needs at least 4"


def test_a_flag_is_said_once_and_a_cause_without_its_consequence(make_track: Make, robot: Any) -> None:
    body = ("body_rotation_rate",)
    flags = (
        Flag("no-stripes", "the robot has no stripes", body),
        Flag("stripes-unreadable", "the stripes could be read on 0 of 300 frames", body),
        Flag("tail-does-not-fit", "one cause"),
        Flag("tail-does-not-fit", "one cause"),
        Flag("tail-does-not-fit", "another cause"),
        Flag("tail-unreadable", "the wire is not seen"),
        Flag("tail-unreadable", "the tail could be read on 0 of 300 frames"),
    )
    trial = trial_of(make_track(flags=flags), robot, "a")
    sentences = ["the robot has no stripes", "one cause", "another cause", "the wire is not seen"]
    assert [flag.sentence for flag in trial.flags] == sentences
    assert trial.quantities["body_rotation_rate"].reason == "the robot has no stripes"
    rows = observation_rows([trial], robot, "setup.toml")
    assert rows is not None
    assert "flags: no-stripes, tail-does-not-fit, tail-unreadable\n" in rows


def test_a_reason_names_one_thing_to_do(make_track: Make, robot: Any) -> None:
    """Of a tail that is another one, and of a mirrored film, what follows is not said beside the reason."""
    tail, body = ("tail_rotation_rate",), ("body_rotation_rate",)
    unread = Flag("tail-unreadable", "sharper pictures show more", tail)
    trial = trial_of(make_track(flags=(unread, Flag("tail-does-not-fit", "check the file", tail))), robot, "a")
    assert [flag.name for flag in trial.flags] == ["tail-does-not-fit"]
    order = Flag("stripe-order", "the stripes are seen in the reversed order", body)
    hand = Flag("handedness", "body and tail seem to turn the same way", (*tail, *body))
    mirrored = trial_of(make_track(flags=(order, hand)), robot, "a")
    assert [flag.name for flag in mirrored.flags] == ["mirrored"]
    for name in (*tail, *body, "motor_rotation_rate"):
        assert "mirror the film back" in mirrored.quantities[name].reason
    turned = Flag.named("nose-on-the-other-side", side="left", why="turned round, it has the robot's tail")
    round_about = trial_of(make_track(flags=(turned, order, hand)), robot, "a")
    assert [flag.name for flag in round_about.flags] == ["nose-on-the-other-side"]
    other = trial_of(make_track(flags=(replace(order, sentence="in another order"), hand)), robot, "a")
    assert [flag.name for flag in other.flags] == ["stripe-order", "handedness"]


def test_an_amplitude_over_trials_is_not_negative(make_trial: MakeTrial) -> None:
    trials = [make_trial(seed=seed, wobble=0.01 * PIXEL, body=-1.9) for seed in range(3)]
    found = summary_of(trials).quantities
    lows = [found[name].low for name in WOBBLES]
    assert min(lows) == 0.0
    assert all(np.isfinite(lows))


def test_an_outlying_trial_is_flagged_and_still_counts(make_trial: MakeTrial) -> None:
    trials = [make_trial(seed=k, tail=7.0 + 0.1 * k) for k in range(5)]
    trials.append(make_trial(seed=9, tail=12.0))
    judged = compared(trials)
    names = [[flag.name for flag in trial.flags] for trial in judged]
    assert "outlier-tail-rotation-rate" in names[5]
    assert not any("outlier-tail-rotation-rate" in found for found in names[:5])
    summary = summary_of(judged)
    assert summary.counts["tail_rotation_rate"] == 6
    assert summary.quantities["tail_rotation_rate"].value == pytest.approx((5 * 7.2 + 12.0) / 6, rel=1e-3)


def test_a_copy_of_a_trial_is_said(make_trial: MakeTrial) -> None:
    trials = compared([make_trial(name, seed=seed) for seed, name in ((1, "a"), (2, "b"), (1, "c"))])
    copies = [[flag for flag in trial.flags if flag.name == "copy-of-a-trial"] for trial in trials]
    assert [len(flags) for flags in copies] == [0, 0, 1]
    assert "the same as a," in copies[2][0].sentence
    assert summary_of(trials).to_dict() == summary_of(trials[:2]).to_dict()


def test_a_tilted_camera_moves_the_lateral_position_by_what_is_said(make_trial: MakeTrial) -> None:
    """Against the virtual camera, an independent lens: the pixel of a point, seen through a lens that is level."""
    trial = make_trial("a")
    found = Measurement((trial,), summary_of([trial]), sp.load("biorob2012-wide"), "setup.toml")
    setup, tilt = trial.track.setup, math.radians(0.2)
    assert setup.tank.surface is not None
    level = VirtualLens(setup.camera.height, setup.tank.surface, setup.tank.index, 740.0, (640, 480))
    height = setup.robot.axis_height
    pixel = replace(level, tilt=(tilt, 0.0)).project(np.array([[0.0, 0.0, height]]))[:, :2]
    moved = abs(float(level.points(pixel, height)[0, 1]))
    assert found.lateral_shift == pytest.approx(moved * math.radians(1.0) / tilt, rel=1e-3)


def test_tracking_alone_makes_no_wobble(make_trial: MakeTrial) -> None:
    trials = [make_trial(str(k), seed=k, wobble=0.01 * PIXEL, body=-1.9) for k in range(3)]
    assert all(trial.quantities["lateral_wobble_at_tail_rate"].low == 0.0 for trial in trials)
    assert summary_of(trials).quantities["lateral_wobble_at_tail_rate"].low == 0.0


def test_what_cannot_be_believed_at_all_gives_no_number(make_trial: MakeTrial) -> None:
    flag = Flag("turned", "all is wrong", RATE_NAMES[:3])
    trial = make_trial(flags=(flag,))
    assert all(np.isnan(item.value) and item.reason == flag.sentence for item in trial.quantities.values())


def test_a_stray_frame_of_the_tail_is_left_out_of_the_motor(make_track: Make, robot: Any) -> None:
    """It is far off for a tail, and not for a difference in which the body's errors are."""
    track = make_track(span=3.0)
    tail = track.tail_phase.copy()
    tail[-1] += 0.3
    body = track.body_angle + 0.1 * np.random.default_rng(1).normal(size=tail.size)
    found = trial_of(replace(track, tail_phase=tail, body_angle=body), robot)
    assert found.fits["tail_rotation_rate"].outliers == 1
    assert np.isnan(found.fits["motor_rotation_rate"].residual[-1])
    assert np.isfinite(found.fits["body_rotation_rate"].residual[-1])


def test_first_frames_that_are_ahead_do_not_slow_the_robot(make_track: Make, make_trial: MakeTrial, robot: Any) -> None:
    """As in a compressed film: a tenth of a millimetre and some degrees, gone within five frames."""
    track = make_track(span=3.0)
    ahead = np.exp(-np.arange(track.time.size) / 1.5)
    position = track.position.copy()
    position[:, 0] += 1e-4 * ahead
    lagging = replace(track, position=position, tail_phase=track.tail_phase + 0.2 * ahead)
    found, clean = trial_of(lagging, robot), make_trial(span=3.0)
    for name, true in (("forward_velocity", 1e-3), ("tail_rotation_rate", 7.0)):
        assert found.fits[name].frames == clean.fits[name].frames - 6
        assert found.quantities[name].low <= true <= found.quantities[name].high
        assert found.quantities[name].value == pytest.approx(true, rel=2e-3)
    assert np.isfinite(found.track.position[:3]).all()  # the series keep them


def test_a_track_that_begins_as_it_goes_on_keeps_its_first_frames(make_track: Make) -> None:
    kept = [without_codec_lag(track) is track for track in (make_track(seed=seed) for seed in range(100))]
    assert sum(kept) > 75  # chance leaves them out 14 times in 100
    assert without_codec_lag(short := make_track(span=0.9)) is short


def test_a_seal_that_shows_no_stripes_widens_the_velocity(make_trial: MakeTrial) -> None:
    """Its edges hold the body's place: without them light and shade move it by a tenth of a pixel from end to end."""
    flag = Flag("stripes-do-not-fit", "no stripes", ("body_rotation_rate",))
    sure, unsure = (trial.quantities for trial in (make_trial(), make_trial(flags=(flag,))))
    half = unsure["forward_velocity"].high - unsure["forward_velocity"].value
    assert half > 1.95 * 0.1 * 0.25e-3 / 10.0  # a pixel shows a quarter of a millimetre, the film lasts 10 s
    assert half > 2.0 * (sure["forward_velocity"].high - sure["forward_velocity"].value)
    assert unsure["tail_rotation_rate"] == sure["tail_rotation_rate"]


def test_speeds_of_nose_and_rear_that_drift_apart_lie_both_in_the_interval(
    make_track: Make, make_trial: MakeTrial, robot: Any
) -> None:
    track = make_track(span=4.0)
    noise = 5e-6 * np.random.default_rng(1).normal(size=track.time.size)
    plain = make_trial(span=4.0).quantities["forward_velocity"]
    still = trial_of(replace(track, elongation=noise), robot)
    assert "ends-drift-apart" not in {flag.name for flag in still.flags}
    now = still.quantities["forward_velocity"]
    assert now.high - now.low < 1.2 * (plain.high - plain.low)
    drift = 0.2e-3 / float(np.ptp(track.time))
    apart = trial_of(replace(track, elongation=drift * track.time + noise), robot)
    assert any(flag.name == "ends-drift-apart" and "drift apart by 0.2 mm" in flag.sentence for flag in apart.flags)
    wide = apart.quantities["forward_velocity"]
    assert wide.value == pytest.approx(plain.value)
    assert wide.low < wide.value - 0.95 * drift < wide.value + 0.95 * drift < wide.high
    without_scale = replace(track, scale=replace(track.scale, length_per_pixel=np.nan), elongation=drift * track.time)
    assert "ends-drift-apart" not in {flag.name for flag in trial_of(without_scale, robot).flags}


def test_a_body_that_slows_down_by_a_third_is_told_with_its_rates(make_track: Callable[..., Track], robot: Any) -> None:
    """Four seconds, less than a stripe: at a rate that falls evenly from 1.2 to 0.8 of its mean."""
    track = make_track(span=4.0)
    time, span, mean = track.time, float(np.ptp(track.time)), -0.2
    errors = track.body_angle + 0.7 * time
    slowing = replace(track, body_angle=mean * time * (1.2 - 0.2 * time / span) + 0.4 * errors)
    trial = trial_of(slowing, robot)
    [flag] = [flag for flag in trial.flags if flag.name == "not-steady-body-rotation-rate"]
    first, second, last = (float(words.split(" Hz")[0]) * Hz for words in flag.sentence.split("video: ")[1].split(", "))
    assert first == pytest.approx(mean * (1.2 - 0.4 / 6.0), rel=0.05)
    assert second == pytest.approx(mean, rel=0.05)
    assert last == pytest.approx(mean * (0.8 + 0.4 / 6.0), rel=0.05)
    found = trial.quantities["body_rotation_rate"]
    assert found.low < mean < found.high


def test_the_first_frames_of_a_robot_whose_rate_changes_are_kept(make_track: Make, robot: Any) -> None:
    """They may be ahead because it starts, and not because the film is compressed."""
    track = make_track(span=4.0)
    time, position, tail = track.time, track.position.copy(), track.tail_phase.copy()
    position[0, 0] += 1e-4
    tail[0] += 0.2
    errors = track.body_angle + 0.7 * time
    slowing = -0.2 * time - 0.15 * (1.0 - np.exp(-time / 0.8)) + 0.2 * errors
    track = replace(track, position=position, tail_phase=tail, body_angle=slowing)
    assert without_codec_lag(track) is not track
    trial = trial_of(track, robot)
    assert np.isfinite(trial.fits["body_rotation_rate"].residual[:6]).all()
    found = trial.quantities["body_rotation_rate"]
    assert found.low < -0.2 - 0.15 * (1.0 - np.exp(-time[-1] / 0.8)) / time[-1] < found.high


def test_values_of_the_example_are_no_concern_where_a_video_confirms_the_scale(make_track: Make, robot: Any) -> None:
    def remarks(size: float, *flags: Flag) -> list[str]:
        track = make_track(span=2.0, flags=flags)
        trial = trial_of(replace(track, scale=replace(track.scale, apparent_size=size)), robot)
        found = Measurement((trial,), summary_of([trial]), robot, "setup.toml")
        return [note for note in found.warnings if "as in the example of setup new" in note]

    assert remarks(0.998) == []
    assert len(remarks(math.nan)) == 1  # by hand: nothing shows how large the robot looks
    assert len(remarks(1.06, Flag("size-does-not-fit", "too large"))) == 1


def test_means_over_two_trials_say_what_their_intervals_rest_on(make_trial: Any, robot: Any) -> None:
    def said(count: int) -> bool:
        trials = tuple(make_trial(seed=seed) for seed in range(count))
        found = Measurement(trials, summary_of(trials), robot, "setup.toml")
        return any("means over two trials: one difference" in note for note in found.warnings)

    assert [said(count) for count in (1, 2, 3)] == [False, True, False]
