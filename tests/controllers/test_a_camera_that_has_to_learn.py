"""While it is learnt how a robot looks it swims on, but not for ever, and not when no pictures come."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from spirillum.controllers.lab import Lab
from spirillum.controllers.loop import SILENCE, run_loop
from spirillum.controllers.sensors import Senses
from spirillum.controllers.stop_task import StopController


class Learning(Senses):
    """A camera that is ready after a while, if pictures come."""

    ready = 3.0

    def not_ready(self, time: float) -> str:
        return "it is being learnt" if time < self.ready else ""

    def sight(self, moment: Any) -> Any:
        found = super().sight(moment)
        return found if moment.time >= self.ready else None


def test_the_robot_swims_while_its_look_is_learnt_and_not_when_the_camera_has_stopped(toy: Any) -> None:
    lab = Lab.exact()
    run = run_loop(toy(), StopController(lab, 1e-3, 1.0, 6e-3, 5e-4), lab, 10.0, senses=Learning(lab, 0))
    assert run.silent is None
    assert run.moments[-1].pose.position[0] == pytest.approx(6e-3, abs=5e-4)
    failing = lab.model_copy(update={"camera": lab.camera.model_copy(update={"fails_at": 1.0})})
    run = run_loop(toy(), StopController(failing, 1e-3, 1.0, 6e-3, 5e-4), failing, 10.0, senses=Learning(failing, 0))
    assert run.silent is not None
    assert run.moments[-1].pose.position[0] < 1e-3 * (1.0 + SILENCE + 0.05)
    slow = Learning(lab, 0)
    slow.ready = np.inf
    run = run_loop(toy(), StopController(lab, 1e-3, 1.0, 6e-3, 5e-4), lab, 30.0, senses=slow)
    assert run.ended.startswith("nothing is seen after 12")
    assert run.moments[-1].values["duty"] == 0.0
