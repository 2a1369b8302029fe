"""A rendered trial: its truth, its frames and their times, its setup; the same seed gives the same bytes."""

import json
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
import xarray as xr

import spirillum as sp
from spirillum.robot.load import load
from spirillum.units import Hz
from spirillum.virtual.artifacts import Degradation
from spirillum.virtual.motion import motion_of_run, steady_rates
from spirillum.virtual.optics import swimming_range
from spirillum.virtual.trajectory import lab_to_camera, run_trajectory, steady_trajectory
from spirillum.virtual.trial import render
from spirillum.virtual.trial_options import CameraOptions, MotionOptions, TrialOptions
from spirillum.vision.setup import load_setup

ROBOT = "biorob2012-wide"
SMALL: dict[str, Any] = {
    "motion": {"forward_velocity": "1 mm/s", "tail_rate": "1.2 Hz", "body_rate": "-0.1 Hz"},
    "trial": {"duration": "0.5 s"},
    "camera": {"size": (160, 120)},
}


def small(**options: Any) -> dict[str, Any]:
    """The options of a small trial, with others in their tables."""
    tables = {**SMALL, "setup_errors": {}}
    return tables | {name: {**tables[name], **fields} if name in tables else fields for name, fields in options.items()}


def frames_of(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Times and pictures of a video."""
    with av.open(str(path)) as container:
        found = [(frame.time, frame.to_ndarray(format="rgb24")) for frame in container.decode(video=0)]
    return np.array([time for time, _ in found]), np.stack([image for _, image in found])


@pytest.fixture(scope="module")
def trial(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """A short clean trial."""
    return render(ROBOT, tmp_path_factory.mktemp("trial") / "a.mp4", **SMALL)


def test_the_truth_says_what_was_asked_and_that_it_is_synthetic(trial: Any) -> None:
    truth = json.loads(trial.truth.read_text())
    assert truth["schema"] == "spirillum.truth/1"
    assert truth["synthetic"] is True
    assert truth["forward_velocity"] == {"value": pytest.approx(1e-3), "unit": "m/s"}
    assert truth["tail_rotation_rate"] == {"value": pytest.approx(1.2 * Hz), "unit": "rad/s"}
    assert truth["motor_rotation_rate"]["value"] == pytest.approx(1.3 * Hz)
    with av.open(str(trial.path)) as container:
        assert "synthetic" in container.metadata["comment"]
    assert "synthetic" in trial.setup.read_text()


def test_the_truth_of_every_frame_is_at_its_time(trial: Any) -> None:
    times, images = frames_of(trial.path)
    with xr.open_dataset(trial.path.with_name("a.truth.nc")) as truth:
        assert np.allclose(truth["time"], times, atol=1e-6)
        assert len(images) == trial.frames == 16
        assert np.allclose(np.diff(truth["x"]), 1e-3 / 30, rtol=1e-9)
        assert np.allclose(truth["y"], 0.0)
        assert np.allclose(np.diff(truth["tail_phase"]), 1.2 * Hz / 30)
        assert np.allclose(np.diff(truth["body_angle"]), -0.1 * Hz / 30)


@pytest.mark.parametrize("fps", [29.97, pytest.param(1000 / 33, marks=pytest.mark.slow), 12.3456789])
def test_odd_paces_keep_their_times(tmp_path: Path, fps: float) -> None:
    render(ROBOT, tmp_path / "a.mp4", **small(camera={"size": (96, 64), "fps": fps}))
    times, _ = frames_of(tmp_path / "a.mp4")
    with xr.open_dataset(tmp_path / "a.truth.nc") as truth:
        assert np.allclose(truth["time"], times, atol=2e-5)
        assert np.allclose(truth["x"] - truth["x"][0], 1e-3 * truth["time"], atol=1e-12)


def test_the_setup_is_one_and_knows_the_heights(trial: Any) -> None:
    setup, robot = load_setup(trial.setup)
    assert robot == load(ROBOT)
    assert setup.camera.height == pytest.approx(0.210)
    assert setup.tank.surface == pytest.approx(0.060)
    assert setup.robot.axis_height == pytest.approx(0.022 - 0.020 + 0.009 + 0.0005)


def test_a_setup_reads_back_the_name_of_its_robots_file(tmp_path: Path) -> None:
    found = render(ROBOT, tmp_path / 'q"b\\c.mp4', **small(camera={"size": (96, 64)}))
    assert load_setup(found.setup)[1] == load(ROBOT)


def test_a_film_shows_what_predict_says_where_no_model_is_named() -> None:
    """In its tube, also where it has no table: here of a short, thick tail, which is solved for in no time."""
    asked = MotionOptions.of({"tail_rate": "1.2 Hz"})
    rates, source, *_ = steady_rates(load(ROBOT), asked)
    said = sp.predict(ROBOT, tail_rate="1.2 Hz", band=False)
    assert source == said.model.name == "tube"
    assert rates["forward_velocity"] == pytest.approx(said.forward_velocity, rel=1e-9)
    small = {"coupling.diameter": "0 mm", "tail.length": "20 mm", "tail.wire_diameter": "1.5 mm"}
    _, source, *_ = steady_rates(load(ROBOT, **small, **{"model.tube.tolerance": 0.04, "model.tube.phases": 1}), asked)
    assert source == "tube"


def test_a_planted_wrong_depth_stands_in_the_setup_alone(trial: Any, tmp_path: Path) -> None:
    options = small(setup_errors={"depth_error": "-5 mm", "depth_uncertainty": "4 mm"})
    wrong = render(ROBOT, tmp_path / "a.mp4", **options)
    setup, true = load_setup(wrong.setup)[0], load_setup(trial.setup)[0]
    assert setup.robot.axis_height == pytest.approx(true.robot.axis_height - 5e-3)
    assert setup.robot.axis_height_uncertainty == pytest.approx(4e-3)
    assert wrong.path.read_bytes() == trial.path.read_bytes()


def test_lost_frames_leave_the_times_of_the_others_true(trial: Any, tmp_path: Path) -> None:
    what = Degradation(dropped=0.25)
    some = render(ROBOT, tmp_path / "a.mp4", **SMALL, degradation=what)
    times, images = frames_of(some.path)
    assert (some.frames, some.dropped) == (12, 4)
    with xr.open_dataset(tmp_path / "a.truth.nc") as truth:
        number = truth["frame"].values
        assert np.allclose(times, number / 30, atol=1e-6)
        assert np.allclose(truth["x"] - truth["x"][0], 1e-3 * times, atol=1e-12)
    assert number[0] == 0
    assert number[-1] == 15
    every = frames_of(trial.path)[1]
    assert np.abs(images.astype(int) - every[number]).mean() < 1.0  # the same pictures, but for compression


def test_the_same_seed_gives_the_same_bytes(tmp_path: Path) -> None:
    options = small(degradation={"preset": "degraded", "bubbles": 3, "hand": True}, trial={"duration": "0.1 s"})
    first, again, other = (
        render(ROBOT, tmp_path / f"{name}.mp4", **options, seed=seed) for name, seed in (("a", 5), ("b", 5), ("c", 6))
    )
    assert first.path.read_bytes() == again.path.read_bytes()
    assert first.path.read_bytes() != other.path.read_bytes()


def test_pngs_hold_their_numbers_and_the_setup_their_pace(tmp_path: Path) -> None:
    what = Degradation(dropped=0.2)
    found = render(ROBOT, tmp_path / "frames", **small(trial={"duration": "0.3 s"}), degradation=what)
    names = sorted(path.name for path in (tmp_path / "frames").iterdir())
    with xr.open_dataset(tmp_path / "frames.truth.nc") as truth:
        assert names == [f"{number:05d}.png" for number in truth["frame"].values]
    assert load_setup(found.setup)[0].camera.frames_per_second == 30.0
    assert json.loads(found.truth.read_text())["degradation"]["crf"] == 0


def test_a_released_robot_rests_on_assumed_contact_and_hardly_moves(tmp_path: Path) -> None:
    """Said of its video; a robot held at its pose swims four times as fast, and rests on nothing."""
    run, camera = sp.simulate("biorob2012-wide", timing={"duration": "0.5 s"}), {"size": (160, 120), "fps": 5.0}
    found = render(None, tmp_path / "a.mp4", run=run, camera=camera)
    assert found.to_dict()["assumption"] == "contact assumed, not validated"
    (said,) = (note for note in found.warnings if note.code == "slow-film")
    assert "in 0.5 s of video at real time; for a talk: `spirillum simulate`, then `film`" in said
    held = render("biorob2012-wide", tmp_path / "b.mp4", trial={"duration": "0.5 s"}, camera=camera)
    assert "assumption" not in held.to_dict()
    assert not any(note.code == "slow-film" for note in held.warnings)


def test_a_run_is_filmed_where_it_says(tmp_path: Path) -> None:
    run = sp.simulate(ROBOT, model="rft", motion="held", timing={"duration": "0.6 s"})
    found = render(None, tmp_path / "a.mp4", run=run, trial={"duration": "0.5 s"}, camera={"size": (160, 120)})
    assert found.robot == sp.load(ROBOT)
    with xr.open_dataset(tmp_path / "a.truth.nc") as truth:
        there = np.interp(truth["time"], run["time"], run["position"])
        assert np.allclose(truth["x"] - truth["x"][0], there - there[0], atol=1e-9)
        assert np.allclose(
            np.diff(truth["tail_phase"]), np.diff(np.interp(truth["time"], run["time"], run["tail_angle"]))
        )
    assert found.model.startswith("run")
    for option in ({"motion": {"tail_rate": "3 Hz"}}, {"trial": {"gap": "3 mm"}}):
        with pytest.raises(sp.InputError, match="with a run, which has its own"):
            render(None, tmp_path / "b.mp4", run=run, **option)
    whole = motion_of_run(sp.load(ROBOT), run, TrialOptions(), CameraOptions())
    few = motion_of_run(sp.load(ROBOT), run.isel(time=[0, -1]), TrialOptions(), CameraOptions())
    assert not found.warnings
    assert [line.startswith("the tail turns by up to") for line in few.warnings] == [True]
    assert whole.trajectory.duration == pytest.approx(0.6)
    with pytest.raises(sp.InputError, match=r"duration = 0\.7 s, but the run ends at 0\.6 s"):
        motion_of_run(sp.load(ROBOT), run, TrialOptions(duration="0.7 s"), CameraOptions())


def test_a_robot_that_its_loader_warned_of_is_filmed_in_its_own_run(tmp_path: Path) -> None:
    robot = sp.load(ROBOT, **{"body.diameter": "12 mm"})
    assert robot.warnings
    run = sp.simulate(robot, model="rft", motion="held", timing={"duration": "0.3 s"})
    short = {"trial": {"duration": "0.2 s"}, "camera": {"size": (160, 120)}}
    assert render(robot, tmp_path / "a.mp4", run=run, **short).robot == robot


@pytest.mark.parametrize("view", ["top", "side"])
@pytest.mark.parametrize("leftwards", [False, True])
def test_the_trajectory_of_a_free_run_is_its_rigid_motion(view: str, leftwards: bool) -> None:
    from spirillum.dynamics.run_file import rolled, rotation_matrix

    time = np.linspace(0.0, 3.0, 31)
    position = np.stack([1e-3 * time, 2e-4 * np.sin(time), -0.01 + 1e-4 * time], axis=-1)
    yaw, pitch = 0.1 * np.sin(time), 0.15 * np.cos(time)
    attitude = np.array(
        [_product(_about(2, a), _about(1, b), rolled(-4.0 * t)) for a, b, t in zip(yaw, pitch, time, strict=True)]
    )
    run = xr.Dataset(
        {
            "position": (("time", "axis"), position),
            "attitude": (("time", "quaternion"), attitude),
            "tail_phase": ("time", 7.0 * time),
        },
        {"time": time},
    )
    trajectory = run_trajectory(run, view, leftwards=leftwards, axis=0.022, level=0.0)
    turn = lab_to_camera(view, leftwards=leftwards)
    for place, moment in enumerate(time):
        now = trajectory.at(float(moment))
        body = turn @ rotation_matrix(attitude[place])
        assert np.allclose(now.body, body, atol=1e-12)
        assert np.allclose(now.rotor, body @ rotation_matrix(rolled(7.0 * moment)), atol=1e-12)
        assert np.allclose(now.position, turn @ position[place] + [0.0, 0.0, 0.022])
    assert np.ptp(trajectory.body_angle) == pytest.approx(12.0, abs=0.1)  # nearly two turns, unwrapped


def _about(axis: int, angle: float) -> np.ndarray:
    """Quaternion of a turn about an axis."""
    found = np.array([np.cos(0.5 * angle), 0.0, 0.0, 0.0])
    found[1 + axis] = np.sin(0.5 * angle)
    return found


def _product(*quaternions: np.ndarray) -> np.ndarray:
    """Product of quaternions w, x, y, z."""
    found = np.array([1.0, 0.0, 0.0, 0.0])
    for other in quaternions:
        vector = found[0] * other[1:] + other[0] * found[1:] + np.cross(found[1:], other[1:])
        found = np.concatenate([[found[0] * other[0] - found[1:] @ other[1:]], vector])
    return found


@pytest.mark.parametrize("view", ["top", "side"])
@pytest.mark.parametrize("direction", ["right", "left"])
def test_a_robot_aside_keeps_its_gap(tmp_path: Path, view: str, direction: str) -> None:
    trial = {"duration": "0.1 s", "lateral": "3 mm", "gap": "1 mm"}
    render(ROBOT, tmp_path / "a.mp4", **small(trial=trial, camera={"view": view, "direction": direction}))
    axis = 0.022 if view == "top" else 0.030
    with xr.open_dataset(tmp_path / "a.truth.nc") as truth:
        y, z = float(truth["y"][0]), float(truth["z"][0]) - axis
    assert np.hypot(y, z) == pytest.approx(0.020 - 0.009 - 0.001)
    aside = y if view == "top" else {"right": -z, "left": z}[direction]
    assert aside == pytest.approx(0.003)


def test_a_gap_is_that_of_the_motion_too(tmp_path: Path) -> None:
    """A model with walls answers at the gap that the picture shows; for a calibration that gap is the truth."""
    options = small(trial={"duration": "0.1 s"}) | {"motion": {"model": "tube"}}
    usual = render(ROBOT, tmp_path / "usual.mp4", **options)
    options["trial"]["gap"] = "0.2 mm"
    thin = render(ROBOT, tmp_path / "thin.mp4", **options)
    for found, gap in ((thin, "0.2 mm"), (usual, "0.5 mm")):
        there = sp.predict(ROBOT, model="tube", placement={"gap": gap, "pitch": 0.0})
        assert found.rates["forward_velocity"] == pytest.approx(there.forward_velocity, rel=1e-9)
        assert found.rates["body_rotation_rate"] == pytest.approx(there.body_rotation_rate, rel=1e-9)
    assert abs(thin.rates["body_rotation_rate"]) < 0.8 * abs(usual.rates["body_rotation_rate"])


def test_a_changed_robot_lies_beside_its_setup(tmp_path: Path) -> None:
    changed = load(ROBOT, **{"tail.wavelength": "20 mm"})
    found = render(changed, tmp_path / "a.mp4", **small(trial={"duration": "0.1 s"}))
    assert load_setup(found.setup)[1] == changed


def test_steady_trajectories_are_straight_and_wobbles_come_back() -> None:
    rates = {"forward_velocity": 1e-3, "body_rotation_rate": -0.5, "tail_rotation_rate": 4.0 * np.pi}
    trajectory = steady_trajectory(3.0, **rates, position=np.array([0.01, 0.0, 0.02]), wobble=2e-4, heading=0.02)
    times = np.linspace(0.0, 3.0, 7)  # every half turn, and whole ones
    series = trajectory.series(times)
    assert np.allclose(series["x"], 0.01 + 1e-3 * times)
    assert np.allclose(series["y"], 2e-4 * np.cos(4.0 * np.pi * times), atol=2e-7)
    assert trajectory.rates()["motor_rotation_rate"] == pytest.approx(4.0 * np.pi + 0.5)
    now = trajectory.at(1.3)
    assert np.allclose(now.body @ now.body.T, np.eye(3))
    assert np.arctan2(now.body[1, 0], now.body[0, 0]) == pytest.approx(0.02)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"camera": {"size": (161, 120)}}, "even numbers"),
        ({"camera": {"view": "front"}}, "allowed: top, side"),
        ({"camera": {"direction": "up"}}, "allowed: right, left"),
        ({"camera": {"fps": 0.0}}, "fps"),
        ({"camera": {"exposure": "1 s"}}, "exposure"),
        ({"trial": {"gap": "12 mm"}}, "allowed: 0 to 11 mm"),
        ({"trial": {"lateral": "11 mm"}}, "at most 10.5 mm"),
        ({"trial": {"wobble": "1 m"}}, "0 to 11 mm, the room in the channel"),
        ({"trial": {"start": "1 m"}}, "never in the picture"),
        ({"trial": {"duration": "0 s"}}, "makes 1 frames"),
        ({"seed": -1}, "seed"),
        ({"degradation": "bad"}, "allowed: clean, degraded"),
        ({"motion": {"tail_rate": "1.2"}}, "unit"),
    ],
)
def test_wrong_options_get_one_sentence_and_leave_nothing(tmp_path: Path, options: dict[str, Any], words: str) -> None:
    with pytest.raises(sp.InputError, match=words):
        render(ROBOT, tmp_path / "a.mp4", **small(**options))
    assert not list(tmp_path.iterdir())


def test_robots_that_this_camera_cannot_show_are_refused(tmp_path: Path) -> None:
    with pytest.raises(sp.InputError, match=r"which a picture 164\.8 mm wide can show"):
        render("ecoli", tmp_path / "a.mp4", **SMALL)
    with pytest.raises(sp.InputError, match="a tube under the oil"):
        render(load(ROBOT, **{"channel.diameter": "60 mm"}), tmp_path / "a.mp4", **SMALL)
    assert not list(tmp_path.iterdir())


def test_a_robot_that_swims_out_of_the_picture_is_said_to(tmp_path: Path) -> None:
    fast = {"forward_velocity": "600 mm/s", "tail_rate": "1.2 Hz", "body_rate": "-0.1 Hz"}
    camera = {**SMALL["camera"], "distortion": 0.0}
    found = render(ROBOT, tmp_path / "a.mp4", **small(motion=fast, trial={"duration": "1 s"}, camera=camera))
    (said,) = (line for line in found.warnings if "in the picture for" in line)
    length = load(ROBOT).body.length + load(ROBOT).coupling.length + load(ROBOT).tail.length
    low, high = swimming_range(load(ROBOT), CameraOptions.of(camera))
    # from the moment at which the nose comes in to that at which the tail is gone; lower in the tube more is in view
    wanted = (high - low + 2.0 * length) / 0.6
    assert float(said.split("for ")[1].split(" of")[0]) == pytest.approx(wanted, rel=0.04)
    still = render(ROBOT, tmp_path / "b.mp4", **small(trial={"duration": "0.1 s"}))
    assert not any("in the picture for" in line for line in still.warnings)


def test_an_interrupted_trial_leaves_nothing(tmp_path: Path) -> None:
    def interrupt(_what: str, done: int, _total: int) -> None:
        if done == 5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        render(ROBOT, tmp_path / "a.mp4", **SMALL, progress=interrupt)
    assert not list(tmp_path.iterdir())
    with pytest.raises(KeyboardInterrupt):
        render(ROBOT, tmp_path / "frames", **SMALL, progress=interrupt)
    assert not list(tmp_path.iterdir())


def test_a_seed_of_which_nothing_is_drawn_is_said_to_change_nothing(tmp_path: Path) -> None:
    short = {"trial": {"duration": "0.1 s"}, "camera": {"size": "320x240"}}
    for number, (more, said) in enumerate(
        (({"seed": 3}, True), ({"seed": 3, "degradation": {"noise": 2.0}}, False), ({}, False))
    ):
        found = sp.render("biorob2012-wide", tmp_path / f"{number}.mp4", **short, **more)
        assert any(line.startswith("seed = 3 has no effect") for line in found.warnings) is said
