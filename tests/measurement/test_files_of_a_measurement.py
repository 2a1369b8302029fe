"""What is written can be read: by `calibrate`, by xarray, and in the layout of the `movement` project."""

import errno
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from spirillum import InputError
from spirillum.files import write_dataset
from spirillum.formats.array_files import Labelled
from spirillum.measurement.measure import Measurement
from spirillum.measurement.observations import read_observations
from spirillum.measurement.series import movement_of, observation_rows, series_of
from spirillum.measurement.trials import trial_of
from spirillum.results.measurement import measure
from spirillum.vision.flag import Flag
from spirillum.vision.track.track import Track

Make = Callable[..., Track]
SHORT = 2.0
"""Enough of a track where only its files are looked at, s."""


def test_observations_are_read_back(tmp_path: Path, make_track: Make, robot: Any) -> None:
    flag = Flag("aliased-body", "too fast", ("body_rotation_rate",))
    trials = [
        trial_of(make_track(seed=1), robot, "one"),
        trial_of(make_track(seed=2, span=SHORT, flags=(flag,)), robot, "two"),
    ]
    text = observation_rows(trials, robot, "setup.toml")
    assert text is not None
    path = tmp_path / "observations.csv"
    path.write_text(text)
    first, second = read_observations(path)
    assert first.forward_velocity == pytest.approx(trials[0].quantities["forward_velocity"].value, rel=1e-6)
    assert first.motor_rate == pytest.approx(7.7, rel=2e-3)
    assert first.tail == (0.04, 0.025, 0.0025)
    assert (first.trial, second.trial) == ("one", "two")
    assert np.isnan(second.body_rate)
    rate = trials[0].quantities["tail_rotation_rate"]
    assert first.intervals[1] == pytest.approx(max(rate.high - rate.value, rate.value - rate.low), rel=1e-3)
    assert np.isnan(second.intervals[2])


def test_series_carry_units_and_come_back(tmp_path: Path, make_track: Make, robot: Any) -> None:
    track = make_track()
    path = tmp_path / "a.nc"
    series_of(trial_of(track, robot, "a"), robot).write(path)
    with xr.open_dataset(path, engine="h5netcdf") as found:
        assert dict(found.sizes) == {"time": 300, "space": 2}
        assert all("units" in variable.attrs for variable in found.data_vars.values())
        assert np.array_equal(found["position"].values, track.position)
        assert found["body_angle"].attrs["known_modulo"] == pytest.approx(np.pi)  # two times four colours
        assert found["tail_phase"].attrs["known_modulo"] == pytest.approx(2 * np.pi)
        line = found["position"].values[:, 0] - found["forward_velocity_residual"].values
        known = np.isfinite(line)
        slope = np.polyfit(track.time[known], line[known], 1)[0]
        assert slope == pytest.approx(float(found["forward_velocity"]), rel=1e-9)
        assert found["forward_velocity"].attrs["low"] < float(found["forward_velocity"])
        assert json.loads(found.attrs["setup"])["robot"]["axis_height"] == 0.0115


@pytest.mark.parametrize("layout", [series_of, movement_of])
def test_files_are_those_that_xarray_writes(tmp_path: Path, make_track: Make, robot: Any, layout: Any) -> None:
    arrays = layout(trial_of(make_track(span=SHORT), robot, "a"), robot)
    arrays.write(tmp_path / "a.nc")
    write_dataset(arrays.dataset(), tmp_path / "b.nc")
    with xr.open_dataset(tmp_path / "a.nc") as ours, xr.open_dataset(tmp_path / "b.nc") as theirs:
        xr.testing.assert_identical(ours, theirs)
        assert [variable.dtype for variable in ours.variables.values()] == [
            variable.dtype for variable in theirs.variables.values()
        ]


def test_layout_of_movement(tmp_path: Path, make_track: Make, robot: Any) -> None:
    """What its validator asks of poses: these dimensions and variables; and the attributes that its loaders set."""
    track = make_track(span=SHORT)
    path = tmp_path / "a.movement.nc"
    movement_of(trial_of(track, robot, "a"), robot).write(path)
    with xr.open_dataset(path, engine="h5netcdf") as found:
        assert found["position"].dims == ("time", "space", "keypoints", "individuals")
        assert found["confidence"].dims == ("time", "keypoints", "individuals")
        assert (found.attrs["ds_type"], found.attrs["time_unit"]) == ("poses", "seconds")
        assert found.attrs["fps"] == pytest.approx(30.0)
        nose = found["position"].sel(keypoints="nose", individuals=robot.name, space="x").values
        assert np.array_equal(nose, track.picture[:, 2])


@pytest.fixture
def followed(monkeypatch: pytest.MonkeyPatch, make_track: Make) -> dict[str, Any]:
    """The tracker replaced by tracks made by hand: by the video's name a track, or what it raises."""
    tracks: dict[str, Any] = {}

    def follow(video: Path, *_: Any, **__: Any) -> Track:
        found = tracks[video.name]
        if isinstance(found, BaseException):
            raise found
        assert isinstance(found, Track)
        return found

    monkeypatch.setattr("spirillum.measurement.measure.follow", follow)
    return tracks


def test_what_a_video_says_of_itself_stays_with_its_numbers(
    tmp_path: Path, setup_file: Path, followed: dict[str, Any], make_track: Make
) -> None:
    flag = Flag("synthetic", "the video says of itself that it is synthetic: nothing here is measured")
    followed |= {"a.mp4": make_track(span=SHORT, flags=(flag,)), "b.mp4": make_track(span=SHORT, seed=1)}
    found = measure(["a.mp4", "b.mp4"], setup_file, tmp_path / "out", annotated=False, figures=False)
    assert "a: the video says of itself that it is synthetic: nothing here is measured" in found.warnings
    assert (tmp_path / "out" / "observations.csv").read_text().startswith("# SYNTHETIC: ")
    for name, synthetic in (("a", 1), ("b", 0)):
        with xr.open_dataset(tmp_path / "out" / f"{name}.nc", engine="h5netcdf") as series:
            assert series.attrs["synthetic"] == synthetic


def test_no_trial_writes_over_another(
    tmp_path: Path, setup_file: Path, followed: dict[str, Any], make_track: Make
) -> None:
    names = ["a.mp4", "a.movement.mp4", "A.avi"]
    followed |= {name: make_track(span=SHORT, seed=seed) for seed, name in enumerate(names)}
    found = measure(names, setup_file, tmp_path / "out", annotated=False, figures=False)
    series = [name for name in found.files if name.endswith(".nc")]
    assert len({name.casefold() for name in series}) == 6
    assert sorted(path.name for path in (tmp_path / "out").glob("*.nc")) == sorted(series)


def test_a_name_that_is_no_text_is_refused_at_once(tmp_path: Path, setup_file: Path) -> None:
    with pytest.raises(InputError, match=r"'a\\udcff.mp4' is not text; allowed: a name that is text"):
        measure(["b.mp4", "a\udcff.mp4"], setup_file, tmp_path / "out")


def test_one_bad_video_does_not_stop_the_others(
    tmp_path: Path, setup_file: Path, followed: dict[str, Any], make_track: Make
) -> None:
    followed |= {
        "a.mp4": make_track(span=SHORT),
        "b.mp4": InputError("b.mp4 is empty; allowed: a film"),
        "c.mp4": make_track(span=SHORT, seed=3),
    }
    folder = tmp_path / "out"
    found = measure([f"{name}.mp4" for name in "abc"], setup_file, folder, annotated=False, figures=False)
    assert isinstance(found, Measurement)
    answer = found.to_dict()
    assert [trial["name"] for trial in answer["trials"]] == ["a", "c"]
    assert answer["failures"] == [{"video": "b.mp4", "sentence": "b.mp4 is empty; allowed: a film"}]
    assert answer["summary"]["n"] == 2
    assert json.loads(json.dumps(answer, allow_nan=False))["schema"] == "spirillum.measurement/1"
    names = {path.name for path in folder.iterdir()}
    assert names == {"a.nc", "a.movement.nc", "c.nc", "c.movement.nc", "observations.csv"} == set(answer["files"])


def test_nothing_measured_is_an_error_with_the_first_sentence(
    tmp_path: Path, setup_file: Path, followed: dict[str, Any]
) -> None:
    followed |= {"a.mp4": InputError("a.mp4 shows no robot; allowed: one")}
    with pytest.raises(InputError, match=r"a\.mp4 shows no robot"):
        measure("a.mp4", setup_file, tmp_path / "out", annotated=False)
    assert not (tmp_path / "out").exists()


def test_tables_of_others_stay_and_datasets_of_others_are_said(
    tmp_path: Path, setup_file: Path, followed: dict[str, Any], make_track: Make
) -> None:
    followed |= {"a.mp4": make_track(span=SHORT), "b.mp4": make_track(span=SHORT, seed=2)}
    folder = tmp_path / "out"
    folder.mkdir()
    (folder / "observations.csv").write_text("my own")
    with pytest.raises(InputError, match=r"observations\.csv is there and of unknown origin"):
        measure("a.mp4", setup_file, folder, annotated=False, figures=False)
    assert (folder / "observations.csv").read_text() == "my own"
    (folder / "observations.csv").unlink()
    measure("a.mp4", setup_file, folder, annotated=False, figures=False)
    found = measure("b.mp4", setup_file, folder, annotated=False, figures=False)
    assert found.left == ("a.movement.nc", "a.nc")
    assert any("left in the folder from before: a.movement.nc, a.nc" in sentence for sentence in found.warnings)


def test_an_interruption_keeps_what_was_finished(
    tmp_path: Path, setup_file: Path, followed: dict[str, Any], make_track: Make
) -> None:
    followed |= {"a.mp4": make_track(span=SHORT), "b.mp4": KeyboardInterrupt()}
    with pytest.raises(KeyboardInterrupt, match="1 of 2 trials are finished and kept in"):
        measure(["a.mp4", "b.mp4"], setup_file, tmp_path / "out", annotated=False, figures=False)
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"a.nc", "a.movement.nc", "observations.csv"}


def test_the_report_stands_alone_and_says_flags_and_failures(
    tmp_path: Path, setup_file: Path, followed: dict[str, Any], make_track: Make
) -> None:
    flag = Flag("robot-left-the-view", "the robot left the view at 8 s <b>&", ("tail_rotation_rate",))
    followed |= {
        "b.mp4": make_track(span=SHORT, seed=1, flags=(flag,)),
        "c.mp4": InputError("c.mp4 is no film"),
    }
    measure(["b.mp4", "c.mp4"], setup_file, tmp_path / "out", annotated=False)
    page = (tmp_path / "out" / "report.html").read_text()
    assert "the robot left the view at 8 s &lt;b&gt;&amp;" in page
    assert "c.mp4 is no film" in page
    assert "faster or slower by whole multiples of 30 Hz" in page
    assert "a body that turns faster or slower by whole multiples of 15 Hz" in page
    assert "http" not in page.replace("http-equiv", "")
    assert page.count("data:image/png;base64,") == 1
    assert (tmp_path / "out" / "figures" / "series-b.png").exists()
    assert 'src="figures' not in page


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"tracking": False}, "--no-tracking without --marks"),
        ({"start": 5.0, "end": 4.0}, "end = 4 s; allowed: later than the start, 5 s"),
        ({"end": 0.0}, "end = 0 s; allowed: later than the start, 0 s"),
        ({"start": -1.0}, 'start = "-1.0 s" is out of range; allowed: 0 s to 1e9 s'),
        ({"track": "t.csv"}, "track = t.csv with 2 videos; allowed: one video"),
        ({"overrides": {"tail.wavelength": "0 mm"}}, "tail.wavelength"),
    ],
)
def test_bad_options_are_one_sentence(setup_file: Path, options: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError) as caught:
        measure(["a.mp4", "b.mp4"], setup_file, **options)
    assert words in str(caught.value)


def test_a_full_disk_loses_no_finished_trial(
    tmp_path: Path, setup_file: Path, followed: dict[str, Any], make_track: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    followed |= {"a.mp4": make_track(span=SHORT), "b.mp4": make_track(span=SHORT, seed=1)}
    write = Labelled.write

    def full(self: Labelled, path: Path) -> None:
        if path.name == "b.nc":
            raise OSError(errno.ENOSPC, "No space left on device")
        write(self, path)

    monkeypatch.setattr(Labelled, "write", full)
    with pytest.raises(OSError, match="No space"):
        measure(["a.mp4", "b.mp4"], setup_file, tmp_path / "out", annotated=False, figures=False)
    (first,) = read_observations(tmp_path / "out" / "observations.csv")
    assert first.trial == "a"
