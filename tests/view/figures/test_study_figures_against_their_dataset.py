"""What the panels show is what the dataset holds, and what is not measured is said."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib import rcParams
from matplotlib.legend import Legend
from matplotlib.text import Text

import spirillum as sp
from spirillum.papers.registry import figures_of
from spirillum.view.figures.style import distinct_labels, look_of_model, save

MM, HZ = 1e-3, 2 * np.pi


def texts(figure: Any) -> list[str]:
    return [text.get_text() for text in figure.findobj(Text)]


def legend_entries(figure: Any) -> list[str]:
    return [text.get_text() for legend in figure.findobj(Legend) for text in legend.get_texts()]


def curves(axes: Any, model: str) -> list[Any]:
    return [line for line in axes.get_lines() if line.get_color() == look_of_model(model).colour]


def unplaced_figure(dataset: Any, name: str) -> Any:
    """One figure of a study for many tests, its panels and words where they are made, as with `unplaced`."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("spirillum.view.figures.sheet.lay_out", lambda _figure: None)
        return figures_of(dataset)[name].figure()


@pytest.fixture(scope="module")
def fig5(paper_study: Any) -> Any:
    return unplaced_figure(paper_study, "fig5-wide")


@pytest.fixture(scope="module")
def observed_fig5(observed_study: Any) -> Any:
    return unplaced_figure(observed_study, "fig5-wide")


def test_paper_study_has_the_papers_figures(paper_study: Any) -> None:
    assert list(figures_of(paper_study)) == ["fig5-wide", "fig6-narrow", "bound", "drop"]


@pytest.mark.usefixtures("unplaced")
def test_drop_equals_the_dataset_and_has_the_papers_mean(paper_study: Any) -> None:
    figure = figures_of(paper_study)["drop"].figure()
    free = paper_study.sel(friction="none")
    per_turn = free["forward_velocity"] / free["motor_rotation_rate"]
    loss = 100 * (1 - per_turn.sel(channel="narrow") / per_turn.sel(channel="wide"))
    for column, axes in enumerate(figure.axes):
        for model in ("sbt", "rft"):
            (drawn,) = curves(axes, model)
            np.testing.assert_allclose(drawn.get_ydata(), loss.sel(model=model).isel(wavelength=column))
        assert any(list(line.get_ydata()) == [38.9, 38.9] for line in axes.get_lines())
    assert {"SBT (Table III)", "RFT (Table III)", "paper: global mean 38.9 %"} <= set(legend_entries(figure))


def test_panels_are_lettered_in_the_papers_order(fig5: Any) -> None:
    assert [axes.get_title(loc="left") for axes in fig5.axes] == [f"{letter})" for letter in "abcdefghijkl"]
    columns = [axes.get_title(loc="center") for axes in fig5.axes[:4]]
    assert columns == [f"$\\lambda$ = {value} mm" for value in (10, 15, 20, 25)]


def test_axes_carry_units(fig5: Any) -> None:
    for row, unit in ((0, "(mm/turn)"), (4, "(Hz)"), (8, "(N m s/rad)")):
        assert unit in fig5.axes[row].get_ylabel()
        assert all(not axes.get_ylabel() for axes in fig5.axes[row + 1 : row + 4])
    assert all("$B_o$ (mm)" in axes.get_xlabel() for axes in fig5.axes[4:8])
    assert all("(Hz)" in axes.get_xlabel() for axes in fig5.axes[8:])


def test_rows_share_their_vertical_axis(fig5: Any) -> None:
    for row in (0, 4, 8):
        assert len({axes.get_ylim() for axes in fig5.axes[row : row + 4]}) == 1


def test_legend_tells_models_and_bounds_apart(fig5: Any) -> None:
    entries = legend_entries(fig5)
    assert {"SBT", "RFT"} <= set(entries)
    assert any("no contact friction" in entry for entry in entries)
    assert any("B_m" in entry and "upper bound" in entry for entry in entries)
    assert sum(entry.startswith("$B_o$ = ") for entry in entries) == 4
    sbt, rft = look_of_model("sbt"), look_of_model("rft")
    assert sbt.colour != rft.colour
    assert sbt.line != rft.line
    assert sbt.marker != rft.marker


@pytest.mark.usefixtures("unplaced")
def test_figure_says_that_nothing_is_measured(paper_study: Any) -> None:
    for picture in figures_of(paper_study.isel(wavelength=[3])).values():
        assert "this figure contains no measured data" in picture.caption
        assert any("this figure contains no measured data" in text for text in texts(picture.figure()))


@pytest.mark.parametrize("model", ["sbt", "rft"])
@pytest.mark.parametrize("column", range(4))
def test_curves_equal_the_dataset(paper_study: Any, fig5: Any, model: str, column: int) -> None:
    part = paper_study.sel(channel="wide", model=model).isel(wavelength=column)
    (advance,) = curves(fig5.axes[column], model)
    np.testing.assert_allclose(advance.get_xdata(), part["amplitude"] / MM)
    np.testing.assert_allclose(advance.get_ydata(), part["advance_per_radian"].sel(friction="none") * HZ / MM)
    free, rotor = curves(fig5.axes[4 + column], model)
    for line, friction in ((free, "none"), (rotor, "rotor")):
        np.testing.assert_allclose(line.get_ydata(), part["motor_rotation_rate"].sel(friction=friction) / HZ)


def test_inferred_friction_equals_the_dataset_and_leaves_negative_values_out(paper_study: Any, fig5: Any) -> None:
    drawn = [line for line in fig5.axes[8].get_lines() if len(line.get_xdata()) > 2]
    part = paper_study["effective_friction_at_assumed_rate"].sel(channel="wide", friction="rotor").isel(wavelength=0)
    assert len(drawn) == 8
    for number, line in enumerate(drawn):
        expected = part.isel(amplitude=number // 2, model=number % 2).values
        np.testing.assert_allclose(line.get_xdata(), paper_study["assumed_motor_rate"] / HZ)
        np.testing.assert_allclose(line.get_ydata(), np.where(expected > 0, expected, np.nan))
    assert fig5.axes[8].get_yscale() == "log"


@pytest.mark.usefixtures("unplaced")
def test_bound_has_the_papers_largest_reynolds_number(paper_study: Any) -> None:
    figure = figures_of(paper_study)["bound"].figure()
    assert len(figure.axes) == 8
    assert "upper bound" in figure.axes[0].get_ylabel()
    assert "(mm/s)" in figure.axes[0].get_ylabel()
    for row, reynolds in ((0, 0.0058), (4, 0.0038)):
        speed = reynolds * 3.5 / (985 * 0.018) / MM
        heights = [
            np.ravel(line.get_ydata())[0] for line in figure.axes[row].get_lines() if line.get_color() == "black"
        ]
        np.testing.assert_allclose(heights, speed)
        assert any(f"{speed:.2f}" in entry for entry in legend_entries(figure))


@pytest.mark.usefixtures("unplaced")
def test_other_studies_do_not_borrow_the_papers_reynolds_number(paper_study: Any) -> None:
    other = paper_study.assign_attrs(claims="none")
    figures = figures_of(other)
    assert list(figures) == ["channel-wide", "channel-narrow", "bound"]
    assert not [line for line in figures["bound"].figure().axes[0].get_lines() if line.get_color() == "black"]


def test_observed_means_and_intervals_equal_the_dataset(observed_study: Any, observed_fig5: Any) -> None:
    figure = observed_fig5
    assert len(figure.axes) == 12
    assert figure.get_figwidth() <= 170.0 / 25.4  # of a page of a journal, inches
    assert "synthetic.csv" in figures_of(observed_study)["fig5-wide"].caption
    assert any("observed" in entry for entry in legend_entries(figure))
    seen = observed_study.sel(channel="wide").isel(wavelength=3)
    bars = figure.axes[3].containers[0]
    finite = np.isfinite(seen["observed_forward_velocity"].values)
    mean = seen["observed_forward_velocity"].values[finite] / MM
    half = seen["observed_forward_velocity_ci95"].values[finite] / MM
    np.testing.assert_allclose(bars[0].get_ydata(), mean)
    ends = np.array([segment[:, 1] for segment in bars[2][0].get_segments()])
    np.testing.assert_allclose(ends, np.stack([mean - half, mean + half], axis=-1))
    model = curves(figure.axes[3], "sbt")[0]
    expected = seen["forward_velocity_at_observed_rate"].sel(model="sbt", friction="rotor").values / MM
    np.testing.assert_allclose(model.get_ydata(), expected)


def test_motor_rate_is_observed_else_derived_else_a_models(observed_study: Any, observed_fig5: Any) -> None:
    figure = observed_fig5
    wide = observed_study.sel(channel="wide")
    derived = (wide["observed_tail_rate"] - wide["observed_body_rate"]).isel(wavelength=3, amplitude=0).item() / HZ
    assert figure.axes[7].containers[0][0].get_ydata()[0] == pytest.approx(derived)
    first = curves(figure.axes[4], "rft")[0].get_ydata()
    expected = wide["motor_rotation_rate_at_observed_rate"].sel(model="rft", friction="rotor").isel(wavelength=0)
    np.testing.assert_allclose(first, expected.values / HZ)
    assert figure.axes[4].containers[0][0].get_ydata().size == 0
    assert np.isnan(curves(figure.axes[7], "rft")[0].get_ydata()).all()


def test_inferred_friction_at_observed_rates_shows_both_readings(observed_study: Any, observed_fig5: Any) -> None:
    figure = observed_fig5
    part = observed_study["effective_friction_at_observed_rate"].sel(channel="wide", model="sbt").isel(wavelength=3)
    rotor, paper = curves(figure.axes[11], "sbt")
    factor = 1e-6 if "µN m s/rad" in figure.axes[8].get_ylabel() else 1.0
    np.testing.assert_allclose(rotor.get_ydata(), part.sel(friction="rotor") / factor)
    np.testing.assert_allclose(paper.get_ydata(), part.sel(friction="paper") / factor)


@pytest.mark.usefixtures("unplaced")
def test_unanswered_robots_leave_gaps_and_are_counted() -> None:
    study = {
        "models": ["sbt", "rft"],
        "grid": {"channels": {"one": "biorob2012-wide"}, "wavelengths": ["25 mm"], "amplitudes": ["2 mm", "25 mm"]},
    }
    picture = figures_of(sp.study(study))["channel-one"]
    assert "2 of 4 results" in picture.caption
    figure = picture.figure()
    assert np.isnan(curves(figure.axes[0], "sbt")[0].get_ydata()).tolist() == [False, True]
    assert len(figure.axes) == 2


def test_study_without_any_answer_still_has_its_figures() -> None:
    grid = {"channels": {"one": "biorob2012-wide"}, "wavelengths": ["25 mm"], "amplitudes": ["25 mm"]}
    for picture in figures_of(sp.study({"grid": grid, "assumed_motor_rates": ["1 Hz"]})).values():
        assert picture.figure().axes


@pytest.mark.usefixtures("unplaced")
def test_many_wavelengths_fill_several_figures_and_say_so() -> None:
    grid = {
        "channels": {"one": "biorob2012-wide"},
        "wavelengths": [f"{value} mm" for value in range(10, 40)],
        "amplitudes": ["2 mm"],
    }
    figures = figures_of(sp.study({"models": ["sbt"], "grid": grid}))
    parts = [name for name in figures if name.startswith("channel-one-part")]
    assert parts == [f"channel-one-part{number}" for number in (1, 2, 3, 4)]
    assert "20 of 30 wavelengths" in figures[parts[0]].caption
    assert len(figures[parts[0]].figure().axes) == 10


def test_hostile_channel_names_stay_file_names() -> None:
    names = ["../x", "a/b", "A\\b", "..", "$x_{", "中"]
    grid = {
        "channels": dict.fromkeys(names[:4], "biorob2012-wide") | dict.fromkeys(names[4:], "biorob2012-narrow"),
        "wavelengths": ["25 mm"],
        "amplitudes": ["2 mm"],
    }
    figures = figures_of(sp.study({"models": ["sbt"], "grid": grid}))
    assert all(re.fullmatch("[a-z0-9]+(-[a-z0-9]+)*", name) for name in figures)
    assert len(figures) == 5


@pytest.mark.usefixtures("unplaced")
def test_text_is_never_read_as_a_formula(tmp_path: Path) -> None:
    grid = {"channels": {"$x_{": "biorob2012-wide"}, "wavelengths": ["25 mm"], "amplitudes": ["2 mm"]}
    picture = figures_of(sp.study({"models": ["sbt"], "grid": grid}))["channel-x"]
    assert picture.title.startswith("$x_{")
    save(picture.figure(), tmp_path / "x")


@pytest.fixture(scope="module")
def robot_file(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str, str], str]:
    """A robot file of a name with another amplitude."""
    folder = tmp_path_factory.mktemp("robots")
    source = Path(sp.__file__).parent / "robot" / "presets" / "biorob2012-wide.toml"

    def make(name: str, amplitude: str) -> str:
        text = source.read_text().replace('name = "biorob2012-wide"', f'name = "{name}"')
        path = folder / f"{name}.toml"
        path.write_text(text.replace('amplitude = "2.5 mm"', f'amplitude = "{amplitude}"'))
        return str(path)

    return make


@pytest.mark.usefixtures("unplaced")
def test_listed_robots_have_a_point_each(robot_file: Callable[[str, str], str]) -> None:
    robots = [robot_file(f"r{number}", f"{number} mm") for number in (1, 2, 3)]
    dataset = sp.study({"robots": robots, "title": "three", "models": ["sbt", "rft"]})
    figures = figures_of(dataset)
    assert list(figures) == ["robots"]
    figure = figures["robots"].figure()
    assert len(figure.axes) == 3
    assert [label.get_text() for label in figure.axes[2].get_xticklabels()] == ["r1", "r2", "r3"]
    free = curves(figure.axes[2], "sbt")[0]
    np.testing.assert_allclose(
        free.get_ydata(), dataset["forward_velocity"].sel(model="sbt", friction="none").values / MM
    )
    assert free.get_linestyle() == "None"


@pytest.mark.usefixtures("unplaced")
def test_drawing_leaves_the_callers_settings_alone(paper_study: Any, tmp_path: Path) -> None:
    before = dict(rcParams)
    save(figures_of(paper_study.isel(wavelength=[3]))["bound"].figure(), tmp_path / "bound")
    assert dict(rcParams) == before


@pytest.mark.usefixtures("unplaced")
def test_files_come_out_the_same_every_time(paper_study: Any, tmp_path: Path) -> None:
    picture = figures_of(paper_study.isel(wavelength=[3]))["bound"]
    first, second = (save(picture.figure(), tmp_path / name, vector=True) for name in ("one", "two"))
    for one, two in zip(first, second, strict=True):
        assert one.read_bytes() == two.read_bytes()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["one.png", "one.svg", "two.png", "two.svg"]
    assert "<text" not in first[1].read_text()
    assert save(picture.figure(), tmp_path / "one") == [tmp_path / "one.png"]
    assert not (tmp_path / "one.svg").exists()  # of an earlier figure


def test_cut_names_of_robots_still_differ() -> None:
    """Two tails of a study that differ in their last field are not given one label."""
    tails = [f"wavelength 20 mm, amplitude {size} mm" for size in (2, 2.5)]
    assert distinct_labels(tails, 28) == tails
    assert distinct_labels(["a" * 40, "b" * 40], 28) == ["a" * 27 + "…", "b" * 27 + "…"]


@pytest.mark.usefixtures("unplaced")
def test_speeds_with_a_band_are_no_upper_bound_and_settled_ones_are_drawn(tmp_path: Path) -> None:
    """A band over open places reaches above the value at one; a robot that is let go swims at neither."""
    dataset = sp.study({"models": ["tube"], "robots": ["biorob2012-wide"], "friction": ["none"], "band": True})
    there = dataset["forward_velocity"].isel(model=0, friction=0, drop=True)
    dataset = dataset.assign(forward_velocity_settled=0.1 * there)  # to let it go takes seconds
    high = float(dataset["forward_velocity_high"].max())
    assert high > float(dataset["forward_velocity"].max())
    picture = figures_of(dataset)["robots"]
    figure = picture.figure()
    assert not any("upper bound" in text for text in [*texts(figure), picture.caption, picture.alternative])
    assert any("no contact friction" in axes.get_ylabel() for axes in figure.axes)
    assert "released, steady state" in legend_entries(figure)
    (stars,) = [line for line in figure.axes[2].get_lines() if line.get_marker() == "*"]
    np.testing.assert_allclose(stars.get_ydata(), dataset["forward_velocity_settled"] / MM)
    save(figure, tmp_path / "robots.png")
    assert not any(
        "let go" in entry
        for entry in legend_entries(figures_of(dataset.drop_vars("forward_velocity_settled"))["robots"].figure())
    )
