"""The picture of models side by side shows the numbers of the comparison, for every robot."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.text import Text

import spirillum as sp
from spirillum.dynamics.comparison import ModelComparison
from spirillum.view.figures import comparison as module
from spirillum.view.figures.comparison import comparison_figure
from spirillum.view.figures.style import save_as

WIDE = "biorob2012-wide"


@pytest.fixture(scope="module")
def both() -> ModelComparison:
    """Two models at one rate."""
    return sp.compare_models(WIDE, models=["sbt", "rft"], tail_rate="1.2 Hz", calibrated=True)


def _marks(axes: Any) -> dict[float, float]:
    """Place of each model's mark, by line."""
    return {
        float(line.get_ydata()[0]): float(line.get_xdata()[0])
        for line in axes.get_lines()
        if line.get_marker() in ("o", "s", "^", "D", "v") and len(line.get_xdata()) == 1
    }


@pytest.mark.usefixtures("unplaced")
def test_marks_stand_at_the_predicted_numbers(both: ModelComparison) -> None:
    panels = comparison_figure(both).axes
    assert [text.get_text() for text in panels[0].get_yticklabels()] == ["sbt*", "rft*"]
    for place, answer in enumerate(both.predictions.values()):
        advance, counter, torque, efficiency = (_marks(axes)[place] for axes in panels)
        assert advance == pytest.approx(2 * np.pi * 1e3 * answer.advance_per_radian)  # mm
        assert counter == pytest.approx(-answer.body_rotation_rate / answer.tail_rotation_rate)
        assert torque == pytest.approx(1e6 * answer.tail_torque / answer.tail_rotation_rate)  # uN m s/rad
        assert efficiency == pytest.approx(100 * answer.hydrodynamic_efficiency)


@pytest.mark.usefixtures("unplaced")
def test_axes_have_names_and_units_and_start_at_zero(both: ModelComparison) -> None:
    panels = comparison_figure(both).axes
    for axes, words in zip(
        panels,
        ("advance per turn", "body counter-rotation", "tail torque per rate", "hydrodynamic efficiency"),
        strict=True,
    ):
        assert words in axes.get_xlabel()
        assert axes.get_xlim()[0] == 0
    units = [axes.get_xlabel() for axes in panels]
    assert ["(mm)" in units[0], "N m s/rad)" in units[2], "(%)" in units[3]] == [True, True, True]


@pytest.mark.usefixtures("unplaced")
def test_a_left_handed_robot_advances_too() -> None:
    left = sp.compare_models(sp.load(WIDE, **{"tail.handedness": "left"}), models=["sbt", "rft"], tail_rate=-7.5)
    right = sp.compare_models(WIDE, models=["sbt", "rft"], tail_rate=7.5)
    for mirrored, straight in zip(comparison_figure(left).axes, comparison_figure(right).axes, strict=True):
        assert _marks(mirrored) == pytest.approx(_marks(straight))


@pytest.mark.usefixtures("unplaced")
def test_a_bar_spans_a_models_own_error(both: ModelComparison, monkeypatch: pytest.MonkeyPatch) -> None:
    from matplotlib.container import ErrorbarContainer

    def bars() -> int:
        return sum(
            isinstance(item, ErrorbarContainer) for axes in comparison_figure(both).axes for item in axes.containers
        )

    assert bars() == 0
    monkeypatch.setattr(module, "estimated_error", lambda answer: 0.02 if answer.model.name == "rft" else None)
    assert bars() == 1  # the estimate is of the speed, which one panel shows
    words = " ".join(text.get_text() for text in comparison_figure(both).findobj(Text))
    assert "the model's own refinement (rft 2 %)" in words
    assert "No bar: sbt" in words


@pytest.mark.usefixtures("unplaced")
def test_a_model_without_an_answer_keeps_its_line_and_says_why() -> None:
    found = sp.compare_models(sp.load(WIDE, **{"tail.wire_diameter": "6 mm"}), models=["sbt", "rft"])
    figure = comparison_figure(found)
    assert all("no answer" in [text.get_text() for text in axes.texts] for axes in figure.axes)
    assert "reversing the thrust" in " ".join(text.get_text() for text in figure.findobj(Text))


@pytest.mark.parametrize(
    "fields",
    [
        {"drive.kind": "torque", "drive.torque": "1e-5 N m", "drive.joint": "fixed"},
        {"drive.kind": "rate", "drive.rate": "-2 Hz"},
        {"name": "$x_{1}$ of a very long name " * 6},
        {"body.diameter": "2 um", "body.length": "4 um", "tail.length": "20 um", "tail.wavelength": "5 um",
         "tail.amplitude": "0.8 um", "tail.wire_diameter": "100 nm", "coupling.length": "0 mm", "channel": "none"},
    ],
)  # fmt: skip
@pytest.mark.usefixtures("unplaced")
def test_any_robot_can_be_drawn(fields: dict[str, str], tmp_path: Path) -> None:
    found = sp.compare_models(sp.load(WIDE, **fields), models=["sbt", "rft"])
    figure = comparison_figure(found)
    save_as(figure, tmp_path / "models.png")
    assert (tmp_path / "models.png").stat().st_size > 5_000


def test_the_same_comparison_gives_the_same_file(both: ModelComparison, tmp_path: Path) -> None:
    contents: dict[str, list[bytes]] = {suffix: [] for suffix in ("pdf", "svg")}
    for name in ("a", "b"):
        figure = comparison_figure(both)
        for suffix, files in contents.items():
            save_as(figure, tmp_path / f"{name}.{suffix}")
            files.append((tmp_path / f"{name}.{suffix}").read_bytes())
    for one, other in contents.values():
        assert one == other
