"""Frames that are left out of a line are grey in its figure, and its title says so."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from spirillum.measurement.outliers import without_codec_lag
from spirillum.measurement.trials import trial_of
from spirillum.view.figures.measurement import trial_figure
from spirillum.vision.track.track import Track


@pytest.mark.parametrize("ahead", [False, True])
def test_the_first_frames_of_a_film_that_is_ahead_are_grey(
    make_track: Callable[..., Track], robot: Any, ahead: bool
) -> None:
    track = make_track(span=3.0)
    if ahead:
        position, tail = track.position.copy(), track.tail_phase.copy()
        position[0, 0] += 1e-4
        tail[0] += 0.2
        track = replace(track, position=position, tail_phase=tail)
    assert (without_codec_lag(track) is not track) is ahead
    axes = trial_figure(trial_of(track, robot)).axes
    assert ("\ngrey, left out: first frames" in axes[0].get_title(loc="left")) is ahead
    grey = next(line for line in axes[0].lines if line.get_color() == "#999999")
    assert np.isfinite(np.asarray(grey.get_ydata(), dtype=float)).sum() == (6 if ahead else 0)


def test_stray_frames_are_named(make_track: Callable[..., Track], robot: Any) -> None:
    track = make_track(span=3.0)
    position = track.position.copy()
    position[40, 0] += 5e-3
    title = trial_figure(trial_of(replace(track, position=position), robot)).axes[0].get_title(loc="left")
    assert title.endswith("\ngrey, left out: stray frames")
