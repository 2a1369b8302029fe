"""Curves of a trial beside those of its run, and a study's tails, against what was put in."""

import json

import numpy as np
import pytest
import xarray as xr

import spirillum as sp
from spirillum.errors import InputError
from spirillum.pages.page_robot import PageRobot
from spirillum.pages.replay import compared_series
from spirillum.pages.study_picture import StudyPicture, sent_study


def _series(time: np.ndarray, speed: float, tail: float, body: float, tail_name: str, offset: float) -> xr.Dataset:
    place = np.stack([offset + speed * time, 0.0 * time], axis=1)
    return xr.Dataset(
        {
            "position": (("time", "space"), place),
            tail_name: ("time", offset + tail * time),
            "body_angle": ("time", offset + body * time),
        },
        {"time": time},
    )


def test_both_curves_count_from_their_first_frame() -> None:
    run = _series(np.linspace(0.0, 2.0, 50), 1e-3, 2 * np.pi, -0.5 * np.pi, "tail_angle", 0.0)
    trial = _series(np.linspace(3.0, 5.0, 30), 2e-3, 4 * np.pi, -np.pi, "tail_phase", 7.0)
    trial["body_angle"][0] = np.nan
    way, tail, body = compared_series(trial, run)
    assert way["tracked"]["time"][0] == pytest.approx(0.0)
    ends = [
        (one["run"]["values"][-1] * one["factor"], one["tracked"]["values"][-1] * one["factor"]) for one in (way, tail)
    ]
    assert ends == [pytest.approx((2.0, 4.0)), pytest.approx((2.0, 4.0))]
    assert body["tracked"]["values"][0] is None
    assert body["tracked"]["values"][1] == pytest.approx(0.0)


@pytest.fixture(scope="module")
def study() -> xr.Dataset:
    return sp.study(models=["rft"])


def test_picture_of_a_study_holds_its_speeds(study: xr.Dataset) -> None:
    describe = StudyPicture(study).describe()
    assert json.loads(json.dumps(describe, allow_nan=False)) == describe
    found = study["forward_velocity"].sel(friction="rotor", wavelength=0.025, amplitude=0.0015, model="rft")
    assert describe["speeds"][1][0][0][3] == float(found.isel(channel=1))


def test_a_tail_that_is_pointed_at_swims_as_in_the_study(study: xr.Dataset) -> None:
    picture, swimmer = StudyPicture(study), PageRobot.of("biorob2012-wide")
    swimmer.swap(*picture.tail({"channel": 1, "wavelength": 3, "amplitude": 0}))
    found = sp.predict(swimmer.robot, model="rft", friction="rotor").forward_velocity
    assert found == pytest.approx(picture.describe()["speeds"][1][0][0][3], rel=1e-9)
    assert swimmer.settings.source == "biorob2012-narrow"  # a preset keeps its name for the command line
    with pytest.raises(InputError, match="allowed: 0 to 3"):
        picture.tail({"channel": 1, "wavelength": 4, "amplitude": 0})


def test_what_is_no_study_gets_a_sentence(study: xr.Dataset) -> None:
    with pytest.raises(InputError, match="the file"):
        sent_study(b"nothing")
    with pytest.raises(InputError, match="dimensions"):
        StudyPicture(study.isel(amplitude=0))
    with pytest.raises(InputError, match="settings"):
        StudyPicture(study.assign_attrs(settings="{}"))
