"""The figure of `settle` shows the way and the place that it is given."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from matplotlib.text import Text

from spirillum.view.figures.release import settling_figure

TIME = np.linspace(0.0, 30.0, 200)
WAY = {
    "time": TIME,
    "gap": 5e-4 / (1.0 + TIME) ** 2,
    "azimuth": -0.1 * (1.0 - np.exp(-TIME)),
    "pitch": 0.01 * np.exp(-TIME),
    "yaw": -0.02 * TIME / 30.0,
}


def settling(state: str, slow: float = 65.0) -> Any:
    """A made-up way in the place of an answer."""
    return SimpleNamespace(
        robot=SimpleNamespace(name="a robot with $ in its name"),
        prediction=SimpleNamespace(tail_rotation_rate=7.5),
        weight=0.028,
        roughness=1e-6,
        friction_coefficient=0.1,
        steady_state=SimpleNamespace(state=state, gap=6e-7, azimuth=-0.1, pitch=0.001, yaw=-0.03, approach_time=slow),
        trajectory=WAY.__getitem__,
    )


@pytest.mark.usefixtures("unplaced")
def test_panels_show_gap_azimuth_and_tilt() -> None:
    gap, azimuth, tilt = settling_figure(settling("steady")).axes
    assert gap.get_xlabel() == "time (s)"
    assert "(mm)" in gap.get_ylabel()
    assert gap.get_yscale() == "log"
    assert gap.lines[0].get_ydata() == pytest.approx(1e3 * WAY["gap"])
    assert azimuth.lines[0].get_ydata() == pytest.approx(np.rad2deg(WAY["azimuth"]))
    assert [line.get_label() for line in tilt.lines if not str(line.get_label()).startswith("_")] == ["pitch", "yaw"]
    assert gap.lines[1].get_ydata()[0] == pytest.approx(6e-4)
    assert azimuth.lines[1].get_ydata()[0] == pytest.approx(np.rad2deg(-0.1))


@pytest.mark.usefixtures("unplaced")
def test_no_place_is_drawn_where_none_was_found() -> None:
    gap, azimuth, tilt = settling_figure(settling("changing")).axes
    assert [len(panel.lines) for panel in (gap, azimuth, tilt)] == [1, 1, 2]


@pytest.mark.usefixtures("unplaced")
def test_a_way_that_ends_before_the_steady_motion_is_said_to() -> None:
    for made, said in (
        (settling("steady"), True),
        (settling("steady", 2.0), False),
        (settling("drains", np.nan), False),
    ):
        words = " ".join(text.get_text() for text in settling_figure(made).findobj(Text))
        assert ("The run ends at 30 s; the remaining path" in words.replace("\n", " ")) is said
