"""The figure of `settle` shows the path and the films that it is given."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from spirillum.dynamics.resting_forces import Film, descent_of
from spirillum.view.figures.settling import settling_figure


@pytest.fixture
def settling() -> Any:
    """Made-up films with a power law, in the place of an answer."""
    gaps = np.array([1e-3, 5e-4, 2e-4])
    films = [
        Film(h, 0.011 - h, -0.2, np.array([[-3e-3, 0.0, 0.0, 0.0]]), np.diag([15.0, 2.5e-3 * h**-1.5, 0.02]))
        for h in gaps
    ]
    return SimpleNamespace(
        robot=SimpleNamespace(name="a robot with $ in its name"),
        prediction=SimpleNamespace(tail_rotation_rate=7.5),
        weight=0.028,
        films=films,
        descent=descent_of(films, 0.028),
        lubrication_ratios=np.array([1.0, 0.9, 0.8]),
    )


def test_panels_show_gap_azimuth_and_resistance(settling: Any) -> None:
    gap, azimuth, resistance = settling_figure(settling).axes
    assert gap.get_xlabel() == "time (s)"
    assert "(mm)" in gap.get_ylabel()
    assert gap.lines[0].get_ydata() == pytest.approx(1e3 * settling.descent.gap)
    assert azimuth.lines[0].get_ydata() == pytest.approx(np.rad2deg(settling.descent.azimuth))
    thin, computed = resistance.lines
    assert computed.get_ydata() == pytest.approx([2.5e-6 * h**-1.5 for h in (1e-3, 5e-4, 2e-4)])
    assert np.asarray(computed.get_ydata()) / np.asarray(thin.get_ydata()) == pytest.approx([1.0, 0.9, 0.8])
    assert "(kN s/m)" in resistance.get_ylabel()


def test_body_without_a_straight_side_has_no_thin_film_line(settling: Any) -> None:
    settling.lubrication_ratios = np.full(3, np.nan)
    *_, resistance = settling_figure(settling).axes
    assert len(resistance.lines) == 1
