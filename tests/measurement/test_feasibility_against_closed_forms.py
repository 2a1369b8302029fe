"""Before an experiment: Nyquist, sizes in the picture and the share of the depth, by hand."""

import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from spirillum import InputError, load
from spirillum.measurement.feasibility import feasibility
from spirillum.measurement.setup_template import apparent_distance, depth_shares, new_setup_file, setup_answer
from spirillum.swimming.prediction import predict_steady
from spirillum.vision.setup import load_setup

NEARER = (0.15 + (0.06 - 0.0115) / 1.4) / (0.15 + 0.06 / 1.4)
"""Apparent distance of the robot's axis over that of the ruler on the floor: lines look so much closer together."""
RATES = {"tail_rate": "1.2 Hz", "body_rate": "-0.1 Hz", "speed": "1 mm/s"}


@pytest.mark.parametrize(("rate", "feasible"), [("13.4 Hz", True), ("-13.4 Hz", True), ("13.6 Hz", False)])
def test_a_tail_needs_two_frames_a_turn(setup_file: Path, rate: str, feasible: bool) -> None:
    found = feasibility(setup_file, **{**RATES, "tail_rate": rate}, frames_per_second=30.0)
    assert found.feasible is feasible


@pytest.mark.parametrize(("rate", "feasible"), [("6.7 Hz", True), ("6.8 Hz", False)])
def test_stripes_that_repeat_after_half_a_turn_halve_the_limit(setup_file: Path, rate: str, feasible: bool) -> None:
    assert feasibility(setup_file, **{**RATES, "body_rate": rate}).feasible is feasible
    once = {"seal.stripes": ["red", "yellow", "green", "blue"]}
    assert feasibility(setup_file, **{**RATES, "body_rate": rate}, overrides=once).feasible


def test_a_video_states_its_rate_and_length(setup_file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    film = SimpleNamespace(rate=25.0, duration=3.0, size=(640, 480))
    camera = SimpleNamespace(scale=SimpleNamespace(length_per_pixel=2.5e-4))
    monkeypatch.setattr("spirillum.measurement.feasibility.opened", lambda *_: film)
    monkeypatch.setattr("spirillum.measurement.feasibility.scale_of", lambda *_, **__: (camera, film))
    expected = feasibility(setup_file, **RATES, video="trial.mp4").expected
    assert (expected["frames_per_second"], expected["duration"]) == ((25.0, "video"), (3.0, "video"))
    assert feasibility(setup_file, **RATES, video="trial.mp4", duration="5 s").expected["duration"] == (5.0, "given")


def test_a_robot_without_stripes_cannot_show_its_rotation(setup_file: Path) -> None:
    found = feasibility(setup_file, **RATES, overrides={"seal.stripes": []})
    assert not found.feasible
    assert "no stripes" in found.warnings[0]


def test_sizes_and_time_in_view(setup_file: Path) -> None:
    """160 mm over 640 pixels: 0.25 mm each; the robot of 105 mm has 55 mm of room, the ruler lies below its axis."""
    checks = {c.name: c for c in feasibility(setup_file, **RATES, view_width="160 mm", duration="60 s").checks}
    assert checks["wire-pixels"].value == pytest.approx(4.0)
    assert checks["spacing-pixels"].value == pytest.approx(8.0 * NEARER)
    assert checks["stripe-pixels"].value == pytest.approx(np.pi * 18 / 8 / 0.25)
    assert checks["time-in-view"].value == pytest.approx(55.0)
    assert not checks["time-in-view"].passed
    coarse = feasibility(setup_file, **RATES, view_width="160 mm", picture_width=256)
    assert coarse.feasible  # small pictures warn
    assert "fewer than" in " ".join(coarse.warnings)


def test_lines_closer_than_three_pixels_and_a_robot_shorter_than_twenty_cannot_be_measured(
    setup_file: Path, setup_text: str
) -> None:
    """Lines 2 mm apart: 3 pixels at 240 over 160 mm at their own depth. Without a ruler, 105 mm of robot: 20 pixels at
    5.25 mm each."""
    for width, feasible in ((math.ceil(240 / NEARER), True), (math.floor(240 / NEARER), False)):
        found = feasibility(setup_file, **RATES, view_width="160 mm", picture_width=width)
        assert found.feasible is feasible
        assert bool(found.intervals) is feasible
    assert "its lines cannot be told apart" in " ".join(found.warnings)
    for pixel, feasible in (("5.2 mm", True), ("5.3 mm", False)):
        setup_file.write_text(setup_text.replace('spacing = "2 mm"\nheight = "0 mm"', f'length_per_pixel = "{pixel}"'))
        found = feasibility(setup_file, **RATES)
        assert found.feasible is feasible
        assert ("robot-pixels" in [check.name for check in found.checks]) is not feasible
    assert dict(found.intervals) == {}


def test_intervals_are_those_of_the_time_in_view(setup_file: Path) -> None:
    """At 10 mm/s the 55 mm of room last 5.5 s, whatever the trial's length."""
    common = {**RATES, "speed": "10 mm/s", "view_width": "160 mm"}
    long, short = (feasibility(setup_file, **common, duration=time) for time in ("20 s", "5.5 s"))
    assert long.measured == pytest.approx(5.5)
    assert short.measured == pytest.approx(5.5)
    assert long.feasible
    for name, (reach, _) in short.intervals.items():
        assert long.intervals[name][0] == pytest.approx(reach, rel=1e-9)


@pytest.mark.parametrize(
    ("view", "words"), [("60 mm", "never fits into a view of 60 mm"), ("105.05 mm", "fewer than the 4 frames")]
)
def test_a_robot_that_is_never_in_view_has_no_interval_and_no_verdict(setup_file: Path, view: str, words: str) -> None:
    found = feasibility(setup_file, **RATES, view_width=view)
    assert not found.feasible
    assert dict(found.intervals) == {}
    assert any(words in sentence for sentence in found.warnings)


def test_unknown_numbers_are_predicted_as_predict_does_or_left_out(setup_file: Path) -> None:
    found, said = (
        feasibility(setup_file, tail_rate="1.2 Hz"),
        predict_steady(load("biorob2012-wide"), tail_rate="1.2 Hz", band=False),
    )
    for name in ("forward_velocity", "body_rotation_rate"):
        assert found.expected[name] == (
            pytest.approx(getattr(said, name), rel=1e-9),
            "predicted by tube, held at its place",
        )
    assert dict(found.intervals) == {}
    assert "the size of a pixel is unknown" in found.warnings[-1]


def test_a_robot_without_a_table_is_predicted_in_its_tube(setup_file: Path) -> None:
    """A short, thick tail, around which the flow is solved for in a fraction of a second."""
    small = {"coupling.diameter": "0 mm", "tail.length": "20 mm", "tail.wire_diameter": "1.5 mm"}
    quick = {"model.tube.tolerance": 0.04, "model.tube.phases": 1}
    found = feasibility(setup_file, tail_rate="1.2 Hz", overrides={**small, **quick})
    assert found.expected["forward_velocity"][1] == "predicted by tube, held at its place"


def test_intervals_shrink_with_time_and_frames(setup_file: Path) -> None:
    def reach(**options: float) -> float:
        return feasibility(setup_file, **RATES, view_width=0.16, **options).intervals["tail_rotation_rate"][0]

    base = reach(duration=20.0, frames_per_second=30.0)
    assert reach(duration=40.0, frames_per_second=30.0) == pytest.approx(base / 2**1.5, rel=1e-9)
    assert reach(duration=20.0, frames_per_second=120.0) == pytest.approx(base / 2, rel=1e-9)


def test_ten_millimetres_of_depth_are_seven_per_cent_of_scale(tmp_path: Path, setup_text: str) -> None:
    """In air, at 150 mm: 10/150. Under oil a depth counts 1/n as much against the apparent distance."""
    path = tmp_path / "air.toml"
    text = setup_text.replace('[tank]\nsurface = "60 mm"\n', "").replace('"210 mm"', '"161.5 mm"')
    path.write_text(
        text.replace('_uncertainty = "1 mm"', '_uncertainty = "10 mm"').replace(
            '"2 mm"\n\n[markers]', '"0 mm"\n\n[markers]'
        )
    )
    shares = depth_shares(load_setup(path)[0])
    assert shares["robot.axis_height"] == pytest.approx(10.0 / 150.0, rel=1e-6)
    assert apparent_distance(0.0, 0.21, 0.06, 1.4) == pytest.approx(0.15 + 0.06 / 1.4)


def test_a_share_of_the_least_number_is_none(tmp_path: Path, setup_text: str) -> None:
    """Least number above 0 that a computer has: its step would be 0."""
    path = tmp_path / "setup.toml"
    path.write_text(setup_text.replace('_uncertainty = "1 mm"', '_uncertainty = "1e-320 mm"'))
    assert depth_shares(load_setup(path)[0])["robot.axis_height"] == 0.0


def test_shares_of_a_refracting_surface(setup_file: Path) -> None:
    shares = depth_shares(load_setup(setup_file)[0])
    axis, ruler = (0.15 + (0.06 - z) / 1.4 for z in (0.0115, 0.0))
    assert shares["robot.axis_height"] == pytest.approx(1e-3 / 1.4 / axis, rel=1e-6)
    assert shares["camera.height"] == pytest.approx(2e-3 * abs(1 / axis - 1 / ruler), rel=1e-5)


def test_a_new_setup_file_is_valid_and_is_not_overwritten(tmp_path: Path) -> None:
    path = tmp_path / "setup.toml"
    new_setup_file(path)
    answer = setup_answer(path)
    assert answer["schema"] == "spirillum.setup-check/1"
    assert answer["robot"] == "biorob2012-wide"
    assert 0.001 < answer["scale_uncertainty"] < 0.05
    assert "example of setup new, with its uncertainty: camera.height, tank.surface," in answer["warnings"][0]
    path.write_text(path.read_text().replace('"210 mm"', '"190 mm"').replace('"1 mm"', '"0.8 mm"'))
    assert "uncertainty: tank.index, markers.height; fill" in setup_answer(path)["warnings"][0]
    with pytest.raises(InputError, match="exists; allowed: a new file, or --force"):
        new_setup_file(path)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"duration": "0 s"}, "duration = 0 s"),
        ({"duration": "25 h"}, "duration = 90000 s; allowed: more than 0 s, at most 86400 s"),
        ({"frames_per_second": -1.0}, "fps = -1"),
        ({"frames_per_second": 0.0}, "fps = 0.0; allowed"),
        ({"tail_rate": "6 1/s"}, "expect-tail-rate"),
        ({"view_width": "3 s"}, "view-width"),
        ({"picture_width": 3}, "width = 3"),
    ],
)
def test_bad_expectations_are_one_sentence(setup_file: Path, options: dict, words: str) -> None:  # type: ignore[type-arg]
    with pytest.raises(InputError, match=words):
        feasibility(setup_file, **{**RATES, **options})
