"""The live tracker says what `measure` says of the same film, and never looks ahead."""

import math

import numpy as np
import pytest

from spirillum.errors import InputError
from spirillum.live.tracker import LiveTracker
from spirillum.measurement.trials import trial_of
from spirillum.vision.setup import load_setup
from spirillum.vision.track.assembly import follow

pytest.importorskip("av")
pytest.importorskip("cv2")
RATES = {"forward_velocity": 4e-3, "body_rotation_rate": -0.9, "tail_rotation_rate": 5.0, "motor_rotation_rate": 5.9}


@pytest.fixture(scope="module")
def tracked(filmed, pictures):
    tracker = LiveTracker(filmed.with_name("swimmer.setup.toml"), learn="2.4 s")
    return tracker, [tracker.update(picture, time) for time, picture in pictures]


def test_speed_and_rates_are_those_of_the_whole_film(tracked, filmed):
    trial = tracked[0].summary()
    setup, robot = load_setup(filmed.with_name("swimmer.setup.toml"))
    whole = trial_of(follow(filmed, setup, robot), robot)
    for name, true in RATES.items():
        assert trial.quantities[name].value == pytest.approx(whole.quantities[name].value, rel=0.01)
        assert trial.quantities[name].low < true < trial.quantities[name].high


def test_every_frame_after_the_learning_is_where_the_robot_is(tracked, swimmer):
    seen = [one for one in tracked[1] if one.seen]
    assert [one.state for one in tracked[1][:10]] == ["learning"] * 10
    assert "first 2.4 s" in tracked[1][0].reason
    assert len(seen) > 30
    time = np.array([one.time for one in seen])
    true = swimmer.truth(time)
    assert [one.x for one in seen] == pytest.approx(true["x"], abs=4e-4)
    assert np.polyfit(time, [one.body_angle for one in seen], 1)[0] == pytest.approx(-0.9, rel=0.01)
    turned = np.array([one.tail_phase for one in seen]) - true["tail_phase"]
    assert np.ptp(turned) < 0.2  # continuous
    assert np.angle(np.exp(1j * turned)) == pytest.approx(0.0, abs=0.2)


def test_rates_of_the_last_seconds_hold_the_truth(tracked):
    for name, true in RATES.items():
        rates = [one.rates[name] for one in tracked[1] if one.seen and math.isfinite(one.rates[name].value)]
        assert len(rates) > 14
        assert np.mean([rate.low < true < rate.high for rate in rates]) > 0.9
        assert np.median([rate.value for rate in rates]) == pytest.approx(true, rel=0.02)


def test_what_is_said_of_a_frame_does_not_depend_on_later_ones(tracked, filmed, pictures):
    tracker = LiveTracker(filmed.with_name("swimmer.setup.toml"), learn="2.4 s")
    first = [tracker.update(picture, time) for time, picture in pictures[:30]]
    assert [one.to_dict() for one in first] == [one.to_dict() for one in tracked[1][:30]]


def test_a_robot_learnt_from_a_film_is_followed_from_the_first_frame_and_said_to_be_lost_once_it_is_gone(
    filmed, pictures, flat_pictures
):
    tracker = LiveTracker(filmed.with_name("swimmer.setup.toml"), learn_from=filmed)
    assert tracker.learnt
    seen = [tracker.update(picture, time) for time, picture in pictures[:4]]
    assert all(one.seen for one in seen)
    assert "too few readings" in seen[-1].rates["forward_velocity"].reason
    empty = flat_pictures.Flat(start=(1.0, 0.0)).draw(0.0)
    gone = tracker.update(empty, pictures[4][0])
    assert gone.state == "lost"
    assert "not seen" in gone.reason
    assert math.isnan(gone.x)
    assert gone.to_dict()["position"]["value"] == [None, None]


@pytest.mark.slow
def test_a_picture_without_the_robot_is_learnt_from_anew(filmed, flat_pictures):
    tracker = LiveTracker(filmed.with_name("swimmer.setup.toml"), learn=0.1)
    empty = flat_pictures.Flat(start=(1.0, 0.0), noise=4.0).draw(0.0)
    said = [tracker.update(empty, 0.01 * k).reason for k in range(30)]
    assert "no robot like 'biorob2012-wide'" in said[-1]
    assert not tracker.learnt
    with pytest.raises(InputError, match="no robot like"):
        tracker.summary()


def test_wrong_frames_are_refused_in_a_sentence(filmed, pictures):
    tracker = LiveTracker(filmed.with_name("swimmer.setup.toml"))
    picture = pictures[0][1]
    tracker.update(picture, 1.0)
    with pytest.raises(InputError, match=r"time = 1.0 s; allowed: later than the frame before, 1 s"):
        tracker.update(picture, 1.0)
    with pytest.raises(InputError, match=r"time = nan s; allowed: later"):
        tracker.update(picture, math.nan)
    with pytest.raises(InputError, match=r"a frame has 160 x 240 pixels; allowed: 320 x 240"):
        tracker.update(picture[:, ::2], 2.0)
    with pytest.raises(InputError, match="frame is no picture; allowed: 8-bit RGB"):
        tracker.update(picture.astype(float), 2.0)
    with pytest.raises(InputError, match=r"learn = 0.01 s; allowed: 0.1 s to 600 s"):
        LiveTracker(filmed.with_name("swimmer.setup.toml"), learn="10 ms")
