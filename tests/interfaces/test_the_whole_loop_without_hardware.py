"""Plant, picture, tracker, controller and remote in one loop; what stops on the way leaves the motor off."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import spirillum as sp
from spirillum.controllers.lab import Lab
from spirillum.interfaces.bench import VIRTUAL, Bench

pytest.importorskip("serial")
WIDE = sp.load("biorob2012-wide", **{"friction.effective": "4.7e-6 N m s/rad"})
QUIET = {"unknown": {"friction_factor": 1.0}, "pulse": {"velocity": 0.0}, "remote": {"lost": 0.0}}
TASK = {"kind": "stop-at", "at": "2 mm", "tolerance": "0.5 mm", "duration": "2 s"}


def test_commands_through_a_port_do_what_modelled_ones_do() -> None:
    """On and off are exact in the protocol's steps of 0.001: the same run to the last bit."""
    plain, through = (
        sp.control(WIDE, TASK, lab=QUIET, bench=bench)
        for bench in (None, lambda *about: Bench(*about, tracked=False, port=VIRTUAL))
    )
    assert through.run.moments[-1].pose.position[0] == plain.run.moments[-1].pose.position[0]
    assert through.warnings == plain.warnings


def test_a_port_that_is_unplugged_ends_the_run_with_the_motor_off() -> None:
    benches: list[Bench] = []

    def bench(*about: Any) -> Bench:
        benches.append(Bench(*about, tracked=False, port=VIRTUAL))
        return benches[-1]

    def unplugged(_what: str, done: int, _of: int) -> None:
        if benches and done >= 100 and benches[0].virtual is not None:  # half of the run
            benches[0].virtual.unplug()

    answer = sp.control(WIDE, TASK, lab=QUIET, bench=bench, progress=unplugged)
    last = answer.run.moments[-1]
    assert "is gone" in answer.run.ended
    assert "watchdog switches the motor off" in answer.warnings[-1]
    assert 1.0 <= last.time < 1.5
    assert last.values["duty"] == 0.0
    assert not answer.score.good


@pytest.mark.slow
def test_the_tracker_stops_the_robot_where_the_modelled_camera_does() -> None:
    pytest.importorskip("av")
    task = {**TASK, "duration": "9 s"}
    lab = Lab.of({**QUIET, "camera": {"fps": 15.0}})
    answer = sp.control(WIDE, task, lab=lab, bench=lambda *about: Bench(*about, port=VIRTUAL))
    assert answer.score.good
    seen, when = answer.dataset["seen_position"], answer.dataset["frame_time"]
    true = np.interp(when, answer.dataset["time"], answer.dataset["position"][:, 0])
    errors = (seen - true).values[np.isfinite(seen)]
    assert errors.size > 60
    assert np.abs(errors).max() < 2e-4  # as for the tracker alone
    blind = lab.camera.model_copy(update={"fails_at": 5.0})
    stopped = sp.control(WIDE, {**task, "at": "4 mm"}, lab=lab.model_copy(update={"camera": blind}), bench=Bench)
    assert any("the camera was silent" in line for line in stopped.warnings)
    assert stopped.run.moments[-1].values["duty"] == 0.0
