"""The figure of a design shows what was found: the best value, and grey where designs are refused."""

import numpy as np
import pytest
from matplotlib.legend import Legend
from matplotlib.patches import Rectangle

import spirillum as sp
from spirillum.view.figures.design import design_figure


@pytest.fixture(scope="module")
def bounded() -> sp.Design:
    """A design of two fields, most of whose ranges break a condition."""
    return sp.design(
        "biorob2012-narrow",
        {"tail.amplitude": ("1.4 mm", "3.4 mm"), "tail.wavelength": ("12 mm", "20 mm")},
        maximise="forward_velocity",
        subject_to=["motor_current <= 296 mA"],
        model="sbt",
    )


@pytest.mark.usefixtures("unplaced")
def test_what_breaks_a_condition_is_grey(bounded: sp.Design) -> None:
    figure = design_figure(bounded)
    for axes, profile in zip(figure.axes[1:3], bounded.profiles, strict=True):
        grey = [item.get_bbox() for item in axes.patches if isinstance(item, Rectangle) and item.get_zorder() == 0]
        spans = np.array([(box.x0, box.x1) for box in grey]) * 1e-3  # both fields are drawn in mm
        known = np.isfinite(profile.objective)
        assert 0 < known.sum() < known.size
        for value, good in zip(profile.values, known, strict=True):
            inside = np.any((spans[:, 0] <= value) & (value <= spans[:, 1]))
            assert inside != good
        assert axes.get_xlim() == pytest.approx(1e3 * profile.values[[0, -1]])
    words = [text.get_text() for legend in figure.findobj(Legend) for text in legend.get_texts()]
    assert "refused, or breaks a condition" in words
