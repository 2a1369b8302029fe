"""Frames, delays, losses and flow come exactly when they should; the drive is off at the end whatever happens."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import spirillum as sp
from spirillum.controllers.lab import Lab
from spirillum.controllers.loop import SILENCE, run_loop
from spirillum.controllers.sensors import FlowPulse, Message, draw
from spirillum.errors import InputError

SPEED = 1e-3


class Always:
    """A duty, always, and notes of what it was told."""

    blind = True
    knowing = False

    def __init__(self, duty: float = 1.0) -> None:
        self.duty, self.told = duty, []

    def decide(self, news: Message) -> float:
        self.told.append(news)
        return self.duty

    def estimate(self) -> Mapping[str, float]:
        return {}


def lab(**changes: Mapping[str, Any]) -> Lab:
    exact = Lab.exact()
    return exact.model_copy(
        update={name: getattr(exact, name).model_copy(update=fields) for name, fields in changes.items()}
    )


def test_a_command_acts_after_its_delay_to_rounding(toy: Any) -> None:
    plant = toy(SPEED)
    run = run_loop(plant, Always(), lab(remote={"delay": 0.0683, "period": 0.5}), 2.0)
    at_end = next(moment for moment in run.moments if moment.time == pytest.approx(2.0))
    assert at_end.pose.position[0] == pytest.approx(SPEED * (2.0 - 0.0683), rel=1e-12)


def test_flow_lies_between_its_edges_whatever_the_frames(toy: Any) -> None:
    plant = toy(SPEED, carried=0.8)
    run = run_loop(plant, Always(0.0), lab(camera={"fps": 7.0}), 3.0, flow=FlowPulse(0.911, 1.733, 2e-3))
    assert run.moments[-1].pose.position[0] == pytest.approx(0.8 * 2e-3 * (1.733 - 0.911), rel=1e-12)
    assert plant.state.flow is None


def test_what_was_seen_arrives_after_its_latency_in_order(toy: Any) -> None:
    watcher = Always()
    run_loop(toy(SPEED), watcher, lab(camera={"fps": 30.0, "latency": 0.1}, remote={"period": 0.05}), 2.0)
    seen = [(news.time, sight.time, sight.position) for news in watcher.told for sight in news.sights]
    now, taken, places = np.array(seen).T
    assert np.all(np.diff(taken) > 0)
    assert np.all(now - taken >= 0.1 - 1e-9)
    assert np.all(now - taken < 0.15 + 1e-9)
    assert places == pytest.approx(SPEED * taken, abs=1e-15)


def test_shares_of_lost_frames_and_commands_are_those_asked_for(toy: Any) -> None:
    settings = lab(camera={"dropped": 0.3}, remote={"lost": 0.2, "period": 0.01})
    run = run_loop(toy(SPEED), Always(), settings, 60.0, seed=3)
    frames = [sight is None for _, sight in run.frames]
    assert np.mean(frames) == pytest.approx(0.3, abs=4 * np.sqrt(0.3 * 0.7 / len(frames)))
    assert run.lost / len(run.decisions) == pytest.approx(0.2, abs=4 * np.sqrt(0.2 * 0.8 / len(run.decisions)))


def test_errors_of_frames_have_their_sizes_and_memory(toy: Any) -> None:
    settings = lab(camera={"position_noise": 1e-5, "position_wander": 3e-5, "memory": 0.5})
    run = run_loop(toy(0.0), Always(), settings, 300.0, seed=1)
    errors = np.array([sight.position for _, sight in run.frames if sight is not None])
    assert np.std(errors) == pytest.approx(np.hypot(1e-5, 3e-5), rel=0.1)
    after = np.corrcoef(errors[:-15], errors[15:])[0, 1]  # half a second
    assert after == pytest.approx(0.9 * np.exp(-1.0), abs=0.1)


def test_runs_of_one_seed_meet_the_same_errors_under_any_controller(toy: Any) -> None:
    settings, duration = Lab.of(None), 3.0
    on, off = (run_loop(toy(0.0), Always(duty), settings, duration, seed=5) for duty in (1.0, 0.0))
    assert [sight for _, sight in on.frames] == [sight for _, sight in off.frames]
    assert on.lost == off.lost
    again = run_loop(toy(0.0), Always(1.0), settings, duration, seed=5)
    assert again.readings == on.readings
    other = run_loop(toy(0.0), Always(1.0), settings, duration, seed=6)
    assert other.readings != on.readings


def test_draws_stay_within_their_factor() -> None:
    settings = Lab.of({"unknown": {"friction_factor": 3.0, "gap_factor": 2.0}})
    found = [draw(settings.unknown, settings.pulse, seed, 50.0) for seed in range(400)]
    for name, factor in (("friction", 3.0), ("gap", 2.0)):
        logs = np.log([getattr(one, name) for one in found]) / np.log(factor)
        assert np.abs(logs).max() <= 1.0
        assert np.std(logs) == pytest.approx(1 / np.sqrt(3), rel=0.1)
    signs = [np.sign(one.pulse.velocity) for one in found if one.pulse is not None]
    assert abs(np.mean(signs)) < 4 / np.sqrt(400)


@pytest.mark.parametrize("seed", range(40))
def test_the_drive_is_off_a_second_after_the_last_frame_has_arrived(toy: Any, seed: int) -> None:
    """At the latest; and not sooner than a period before, where the remote takes no more than half a second."""
    draw = np.random.default_rng(seed)
    fails, latency = draw.uniform(0.5, 3.0), draw.choice([0.0, draw.uniform(0.0, 0.4)])
    fps, period, delay = draw.uniform(5.0, 60.0), draw.uniform(0.02, 0.25), draw.uniform(0.0, 0.25)
    watching = Always()
    watching.blind = False
    camera, remote = {"fps": fps, "latency": latency, "fails_at": fails}, {"period": period, "delay": delay}
    plant = toy(SPEED)
    run = run_loop(plant, watching, lab(camera=camera, remote=remote), 10.0)
    last = max(time for time, sight in run.frames if sight is not None)
    off = max(moment.time for moment in run.moments if moment.values["duty"] > 0.0)
    assert last < fails
    assert off <= last + latency + SILENCE + 1e-9 <= fails + latency + SILENCE + 1e-9
    assert off >= last + latency + SILENCE - period - 1e-9
    assert run.silent == pytest.approx(off - delay)
    assert plant.state.x == pytest.approx(SPEED * (off - delay))
    assert run.moments[-1].values["duty"] == 0.0


def test_a_slow_remote_is_no_silent_camera(toy: Any) -> None:
    watching = Always()
    watching.blind = False
    run = run_loop(toy(SPEED), watching, lab(remote={"period": 0.4, "delay": 2.0}), 10.0)
    assert run.silent is None


@pytest.mark.parametrize("asked", [np.nan, 1.5, -0.1])
def test_a_wrong_command_ends_the_run_with_the_drive_off(toy: Any, asked: float) -> None:
    run = run_loop(toy(SPEED), Always(asked), lab(), 10.0)
    assert run.ended.startswith("the controller requested a duty of")
    assert run.moments[-1].values["duty"] == 0.0
    assert run.moments[-1].pose.position[0] == 0.0


class Broken(Always):
    """A controller that ends somehow after a second."""

    def __init__(self, how: type[BaseException]) -> None:
        super().__init__()
        self.how = how

    def decide(self, news: Message) -> float:
        if news.time > 1.0:
            raise self.how
        return 1.0


def test_a_number_without_unit_is_si_in_python_and_refused_in_a_file(tmp_path: Path) -> None:
    """As in a robot file."""
    tables = {"camera": {"latency": 0.05, "fps": 20.0}}
    assert Lab.of(tables).camera.latency == pytest.approx(0.05)
    file = tmp_path / "lab.toml"
    file.write_text("[camera]\nfps = 20.0\nlatency = 0.05\n")
    with pytest.raises(InputError, match=r"lab.toml: camera\.latency = 0.05 has no unit; allowed: a number"):
        Lab.of(file)
    file.write_text('[camera]\nfps = 20.0\nlatency = "50 ms"\n')
    assert Lab.of(file) == Lab.of(tables)
    with pytest.raises(InputError, match=r"^camera\.latency = "):  # which no file says
        Lab.read(file, {"camera.latency": "0.05"})


def test_an_interrupt_keeps_the_run_with_the_drive_off(toy: Any) -> None:
    run = run_loop(toy(SPEED), Broken(KeyboardInterrupt), lab(), 10.0)
    assert run.interrupted
    assert run.moments[-1].values["duty"] == 0.0
    assert 1.0 < run.moments[-1].time < 1.5


def test_an_error_of_a_controller_leaves_the_drive_off(toy: Any) -> None:
    plant = toy(SPEED)
    with pytest.raises(ZeroDivisionError):
        run_loop(plant, Broken(ZeroDivisionError), lab(), 10.0)
    assert plant.duty == 0.0


def test_the_end_of_the_channel_ends_the_run(toy: Any) -> None:
    run = run_loop(toy(SPEED, end=2e-3), Always(), lab(), 10.0)
    assert run.ended == "end of the channel"
    assert run.moments[-1].time == pytest.approx(2.0, abs=0.2)


def test_a_robot_without_walls_is_said_to_sink() -> None:
    task = {"kind": "stop-at", "at": "5 mm", "duration": "1 s"}
    robot = sp.load("biorob2012-wide", channel="none")
    answer = sp.control(robot, task, plant={"model": "slender"})
    height = answer.dataset["position"].values[:, 2]
    assert height[-1] < height[0] - 1e-3
    assert any(line.startswith("it sinks at ") for line in answer.warnings)
    assert "it sinks at " in answer.dataset.attrs["warnings"]


def test_pictures_that_come_after_the_end_are_said_to() -> None:
    task = {"kind": "stop-at", "at": "5 mm", "duration": "1 s"}
    for latency, said in (("10 s", True), ("100 ms", False)):
        answer = sp.control("biorob2012-wide", task, lab={"camera": {"latency": latency}}, plant={"model": "rft"})
        assert any(line.startswith("no picture reached the controller") for line in answer.warnings) is said
