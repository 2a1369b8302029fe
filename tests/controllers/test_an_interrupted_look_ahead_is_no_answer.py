"""A look ahead that is interrupted says so; it does not blame the place or the time that were asked for."""

from dataclasses import replace
from typing import Any

import pytest

import spirillum as sp
from spirillum.dynamics.integration import INTERRUPTED
from spirillum.dynamics.plant import Plant


@pytest.mark.parametrize(
    "task",
    [{"kind": "stop-at", "at": "5 mm"}, {"kind": "hold-speed", "speed": "0.1 mm/s", "duration": "5 s"}],
)
def test_an_interrupted_look_ahead_is_an_interrupt(task: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(plant: Plant, dt: float, **how: Any) -> Any:
        return replace(plant.observe(), ended=INTERRUPTED)

    monkeypatch.setattr(Plant, "step", interrupted)
    with pytest.raises(KeyboardInterrupt):
        sp.control("biorob2012-wide", task, plant={"model": "rft"})
