"""A robot that stands still, or hardly moves, is measured; an empty tube, or a body that is none, gives no number."""

import numpy as np
import pytest

import spirillum as sp
from spirillum.errors import InputError
from spirillum.vision.track import identity
from spirillum.vision.track.cuts import no_motion_flag
from spirillum.vision.track.track import RobotMotion

pytest.importorskip("av")
pytest.importorskip("cv2")
STILL = {"velocity": 0.0, "tail_rate": 0.0, "body_rate": 0.0, "noise": 3.0}
PIXEL = 0.25e-3


@pytest.fixture(scope="module")
def measured(flat_pictures, tmp_path_factory):
    """The trial of a flat film."""

    def measure(**flat):
        path = tmp_path_factory.mktemp("stands") / "a.mp4"
        setup = flat_pictures.Flat(**(STILL | flat)).write(path)
        return sp.measure(path, setup).trials[0]

    return measure


def test_speed_and_rates_of_a_standing_robot_are_zero_with_intervals(measured):
    trial = measured()
    for name in ("forward_velocity", "body_rotation_rate", "tail_rotation_rate"):
        item = trial.quantities[name]
        assert item.low < 0.0 < item.high
    assert trial.quantities["forward_velocity"].high < 0.1 * PIXEL  # a tenth of a pixel a second
    assert trial.quantities["tail_rotation_rate"].high < 2.0 * np.pi * 0.01
    assert [flag.name for flag in trial.flags if "still" in flag.name] == ["robot-stands-still"]


def test_a_robot_that_hardly_moves_is_measured(measured):
    """1.6 pixels in 20 s: less than the width of its edges."""
    truth = {"forward_velocity": 5e-5, "body_rotation_rate": -2 * np.pi * 0.004, "tail_rotation_rate": 2 * np.pi * 0.02}
    trial = measured(
        velocity=5e-5, body_rate=truth["body_rotation_rate"], tail_rate=truth["tail_rotation_rate"], fps=1.5, frames=30
    )
    for name, value in truth.items():
        item = trial.quantities[name]
        assert item.low < value < item.high
        assert item.high - item.low < abs(value)
    assert not any(flag.name == "robot-stands-still" for flag in trial.flags)


def _bare(flat_pictures):
    class Bare(flat_pictures.Flat):
        """A body alone: no tail behind it, no stripes on its seal."""

        def _draw_rotor(self, canvas, time):
            pass

    grey = dict.fromkeys(flat_pictures.PAINTS, (96, 70, 62))
    return Bare(**STILL, frames=6, paints=grey, size=(240, 180), focal=260.0, spacing=3e-3)


@pytest.mark.parametrize("what", ["empty", "bare"])
def test_an_empty_tube_or_another_thing_in_it_gives_no_number(flat_pictures, tmp_path, monkeypatch, what):
    monkeypatch.setattr(identity, "best_other_size", lambda *given: None)  # it takes a while
    empty = flat_pictures.Flat(**STILL, frames=6, start=(1.0, 0.0), size=(240, 180), focal=260.0, spacing=3e-3)
    path = tmp_path / "a.mp4"
    setup = (empty if what == "empty" else _bare(flat_pictures)).write(path)
    try:
        (trial,) = sp.measure(path, setup).trials
    except InputError as error:
        assert "no robot like 'biorob2012-wide'" in str(error)  # noqa: PT017 - either refusal is right
        assert what == "bare" or "nothing moves in its pictures" in str(error)  # noqa: PT017
    else:
        assert not any(np.isfinite(item.value) for item in trial.quantities.values())


def test_standing_is_told_from_small_motion():
    time = np.arange(60) / 15.0
    rng = np.random.default_rng(0)
    noise = rng.normal(0.0, 1.0, (3, 60)) * np.array([[0.02 * PIXEL], [0.002], [0.005]])
    still = RobotMotion(time, *noise)
    assert [flag.name for flag in no_motion_flag(still, PIXEL)] == ["robot-stands-still"]
    for moving in (
        still._replace(x=still.x + 0.1 * PIXEL * time),
        still._replace(body_angle=still.body_angle + 0.02 * time),
        still._replace(tail_phase=still.tail_phase - 0.02 * time),
    ):
        assert no_motion_flag(moving, PIXEL) == ()
    unread = np.full(60, np.nan)
    assert (
        no_motion_flag(RobotMotion(time, still.x, unread, unread), PIXEL) == ()
    )  # it may be anything that stands there
