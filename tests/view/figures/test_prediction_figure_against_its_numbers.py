"""The figure of a prediction: a mark for each motion, a bar over its band, and why a motion is missing."""

import numpy as np
import pytest
from matplotlib.text import Text

import spirillum as sp
from spirillum.view.figures.comparison import prediction_figure


def test_marks_and_bars_are_those_of_the_answer() -> None:
    answer = sp.predict("biorob2012-wide")
    (axes,) = prediction_figure(answer).axes
    assert axes.get_xlabel() == "forward velocity (mm/s)"
    assert [label.get_text() for label in axes.get_yticklabels()] == ["held at a pose", "trial", "steady motion"]
    marks = [float(line.get_xdata()[0]) for line in axes.lines if len(line.get_xdata()) == 1]
    speeds = [answer.forward_velocity, *(one.values["forward_velocity"] for one in (answer.trial, answer.steady))]
    assert marks == pytest.approx(1e3 * np.array(speeds))
    ends = answer.band.of("forward_velocity")
    assert list(axes.lines[0].get_xdata()) == pytest.approx([1e3 * ends["low"], 1e3 * ends["high"]])


def test_missing_motions_have_their_reason() -> None:
    figure = prediction_figure(sp.predict("biorob2012-wide", tail_rate="1.2 Hz"))
    words = " ".join(text.get_text() for text in figure.findobj(Text))
    assert "No trial and no steady motion: a tail rate is prescribed" in words.replace("\n", " ")
    assert len(figure.axes[0].get_yticks()) == 1
