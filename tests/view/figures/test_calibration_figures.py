"""Figures of a calibration show what was observed and fitted, and say what is synthetic."""

import os
import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.text import Text

import spirillum as sp
from spirillum.calibration.posterior import Sampling
from spirillum.results.calibration import write_calibration
from spirillum.results.page import load_figures
from spirillum.worker_pool import process_beside
from synthetic_experiments import synthetic

WIDE = "biorob2012-wide"


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """A posterior of a small synthetic experiment."""
    folder = tmp_path_factory.mktemp("figures")
    path = synthetic(folder / "o.csv", presets=(WIDE,), wavelengths=(15.0, 25.0), amplitudes=(1.5, 2.5))
    few = Sampling(ensembles=2, walkers=24, warm_up=100, steps=100, doublings=0)
    return sp.calibrate(path, WIDE, sampling=few, model="sbt")


@pytest.fixture(scope="module")
def drawn(found: Any) -> dict[str, Any]:
    """Two of its figures, their panels and words where they are made, as with `unplaced`."""
    from spirillum.view.figures.calibration import observed_figure, residual_figure

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("spirillum.view.figures.sheet.lay_out", lambda _figure: None)
        return {"observed": observed_figure(found, 0), "residuals": residual_figure(found)}


@pytest.mark.parametrize("ended", [False, True])
def test_figures_do_not_depend_on_the_number_of_processes(
    found: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ended: bool
) -> None:
    """Nor on whether the other process lives, as for want of memory."""
    monkeypatch.setattr("spirillum.worker_pool.slowdown", lambda _: 1.0)
    with process_beside(load_figures) as beside:
        assert beside is not None
        if ended:
            os.kill(beside.submit(os.getpid).result(), signal.SIGTERM)
        write_calibration(found, tmp_path / "two", beside=beside)
    write_calibration(found, tmp_path / "one")
    names = {path.name for path in (tmp_path / "one" / "figures").iterdir()}
    assert names == {path.name for path in (tmp_path / "two" / "figures").iterdir()} != set()
    for name in names:
        one, two = ((tmp_path / folder / "figures" / name).read_bytes() for folder in ("one", "two"))
        assert one == two, name


def _texts(figure: Any) -> str:
    return " ".join(text.get_text() for text in figure.findobj(Text))


@pytest.mark.usefixtures("unplaced")
def test_all_figures_are_written_and_say_that_the_data_are_synthetic(
    found: Any, drawn: dict[str, Any], tmp_path: Path
) -> None:
    written = {Path(name).name for name in write_calibration(found, tmp_path).files}
    names = ("observed-40mm", "residuals", "posterior", "profiles")
    assert written >= {f"{name}.png" for name in names} | {"calibration.toml", "predictions.csv", "posterior.nc"}
    for figure in drawn.values():
        assert "synthetic, no measured data" in _texts(figure)


def test_panels_draw_observed_and_predicted_speeds(found: Any, drawn: dict[str, Any]) -> None:
    figure = drawn["observed"]
    first = figure.axes[0]
    model, seen = first.lines[0], first.containers[0].lines[0]
    experiment = found.experiment
    here = [n for n, robot in enumerate(experiment.robots) if abs(robot.tail.amplitude - 1.5e-3) < 1e-9]
    speed = (experiment.tail_rate * experiment.advance.mean)[here]
    predicted = (experiment.tail_rate * found.predicted["advance"][0])[here]
    assert model.get_xdata() == pytest.approx([15.0, 25.0])
    factor = np.asarray(seen.get_ydata()) / speed
    assert factor == pytest.approx([1e3, 1e3])
    assert np.asarray(model.get_ydata()) == pytest.approx(1e3 * predicted)
    # Every figure has a row for speed, motor rate and friction, and a column for each amplitude.
    assert len(figure.axes) == 6


def test_a_model_is_seen_through_the_mark_of_what_was_observed(drawn: dict[str, Any]) -> None:
    axes = drawn["observed"].axes[0]
    model, seen = axes.lines[0], axes.containers[0].lines[0]
    assert seen.get_markerfacecolor() == "none"
    assert seen.get_markersize() > model.get_markersize()


def test_residuals_name_the_channel(drawn: dict[str, Any]) -> None:
    assert "channel of 40 mm" in _texts(drawn["residuals"])


def test_residuals_are_observed_over_predicted(found: Any, drawn: dict[str, Any]) -> None:
    axes = drawn["residuals"].axes[0]
    drawn = np.sort(axes.containers[0].lines[0].get_ydata())
    expected = 100 * (found.experiment.advance.mean / found.predicted["advance"][0] - 1)
    assert drawn == pytest.approx(np.sort(expected))
