"""The figure of a sweep shows what its dataset holds."""

from typing import Any

import numpy as np
import pytest

import spirillum as sp
from spirillum.view.figures.magnetic import magnetic_figure


@pytest.fixture(scope="module")
def sweep() -> Any:
    return sp.magnetic_sweep("magnetic-helix", ["0.5 Hz", "1 Hz", "3 Hz"], turns=8.0)


def test_panels_show_speed_rate_wobble_and_lag(sweep: Any) -> None:
    speed, rate, wobble, lag = magnetic_figure(sweep).axes
    assert speed.lines[1].get_xdata() == pytest.approx([0.5, 1.0, 3.0])
    factor = {"mm/s": 1e3, "µm/s": 1e6}[speed.get_ylabel().split("(")[1].rstrip(")")]
    assert speed.lines[1].get_ydata() == pytest.approx(factor * sweep["forward_velocity"].values)
    held = np.interp([0.5, 1.0, 3.0], rate.lines[0].get_xdata(), rate.lines[0].get_ydata())
    assert held == pytest.approx(sweep["held_tail_rotation_rate"].values / (2 * np.pi), rel=1e-4)
    assert wobble.lines[0].get_ydata() == pytest.approx(np.rad2deg(sweep["wobble_angle"].values))
    assert np.isnan(lag.lines[1].get_ydata()[2])
    assert lag.lines[2].get_xdata()[0] == pytest.approx(float(sweep["step_out_rate"]) / (2 * np.pi))
