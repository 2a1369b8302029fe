"""The figure of a run shows the run's numbers in its axes' units, and leaves out what the run does not have."""

import json
from typing import Any

import numpy as np
import pytest
from matplotlib.text import Text

import spirillum as sp
from spirillum.view.figures.trajectory import COLUMNS, trajectory_figure

TIME = np.linspace(0.0, 2.0, 101)


@pytest.fixture
def run() -> Any:
    """A made-up free run with a motor, in the place of a simulation."""
    import xarray as xr

    on = np.where(TIME < 1.0, 1.0, 0.0)
    series = {
        "forward_velocity": 1e-3 * on,
        "tail_rotation_rate": 8.0 * on,
        "body_rotation_rate": -1.0 * on,
        "motor_rotation_rate": 9.0 * on,
        "motor_current": 0.3 * on,
        "electrical_power": 1.0 * on,
        "shaft_power": 3e-4 * on,
        "dissipated_power": 2e-4 * on,
        "friction_power": 1e-4 * on,
        "electrical_energy": np.minimum(TIME, 1.0),
        "dissipated_energy": 2e-4 * np.minimum(TIME, 1.0),
        "wall_gap": 5e-4 - 1e-4 * TIME,
        "pitch": np.radians(0.5 * TIME),
        "yaw": np.radians(-0.2 * TIME),
    }
    path = np.stack([1e-3 * np.minimum(TIME, 1.0), 1e-5 * np.sin(TIME), -0.0105 - 1e-5 * TIME], axis=-1)
    return xr.Dataset(
        {"position": (("time", "axis"), path), **{name: ("time", values) for name, values in series.items()}},
        coords={"time": TIME, "axis": list("xyz")},
        attrs={
            "robot": "a robot with $ in its name",
            "model": "slender",
            "motion": "free",
            "events": json.dumps([{"time": 1.0, "what": "motor off"}, {"time": 9.0, "what": "after the end"}]),
        },
    )


def panels(dataset: Any) -> dict[str, Any]:
    return {axes.get_ylabel(): axes for axes in trajectory_figure(dataset).axes}


@pytest.mark.usefixtures("unplaced")
def test_path_from_the_side_and_from_above(run: Any) -> None:
    shown = panels(run)
    for label, axis in (("$z$ (mm)", 2), ("$y$ (mm)", 1)):
        line, start, end = shown[label].lines
        assert np.stack([line.get_xdata(), line.get_ydata()], axis=-1) == pytest.approx(
            1e3 * run["position"].values[:, [0, axis]]
        )
        assert start.get_xdata() == pytest.approx([0.0])
        assert end.get_xdata() == pytest.approx([1.0])
        assert shown[label].get_xlabel() == "$x$ (mm)"


@pytest.mark.usefixtures("unplaced")
def test_lines_over_time_show_the_run_in_readable_units(run: Any) -> None:
    shown = panels(run)
    expected = {
        "gap to the wall (mm)": [("wall_gap", 1e3)],
        "velocity $U_x$ (mm/s)": [("forward_velocity", 1e3)],
        "motor current (A)": [("motor_current", 1.0)],
        "rate (Hz)": [(f"{name}_rotation_rate", 0.5 / np.pi) for name in ("tail", "body", "motor")],
        "angle (deg)": [("pitch", 180 / np.pi), ("yaw", 180 / np.pi)],
    }
    for label, lines in expected.items():
        for line, (name, factor) in zip(shown[label].lines, lines, strict=False):
            assert line.get_ydata() == pytest.approx(factor * run[name].values), name
            assert line.get_xdata() == pytest.approx(TIME)
    assert [text.get_text() for text in shown["rate (Hz)"].get_legend().get_texts()] == ["tail", "body", "motor"]


@pytest.mark.usefixtures("unplaced")
def test_powers_that_differ_by_far_stand_on_a_logarithmic_axis(run: Any) -> None:
    shown = panels(run)
    assert shown["power (W)"].get_yscale() == "log"
    electrical = np.asarray(shown["power (W)"].lines[0].get_ydata(), dtype=float)
    assert np.nanmax(electrical) == pytest.approx(1.0)
    assert np.isnan(electrical[TIME > 1.0]).all()  # no power has no logarithm
    assert panels(run.drop_vars("electrical_power"))["power (mW)"].get_yscale() == "linear"


@pytest.mark.usefixtures("unplaced")
def test_time_axis_is_shared_and_spans_the_run(run: Any) -> None:
    over_time = [axes for label, axes in panels(run).items() if not label.startswith("$")]
    assert all(axes.get_xlim() == (0.0, 2.0) for axes in over_time)
    assert sum(axes.get_xlabel() == "time (s)" for axes in over_time) == 2


@pytest.mark.usefixtures("unplaced")
def test_events_are_marked_and_named(run: Any) -> None:
    figure = trajectory_figure(run)
    words = " ".join(text.get_text() for text in figure.findobj(Text)).replace("\u00a0", " ")
    assert "1: motor off (1 s)" in words
    assert "after the end" not in words
    assert "computed, no measured data" in words
    for axes in figure.axes[2:]:
        assert [line.get_xdata()[0] for line in axes.lines if len(line.get_xdata()) == 2] == [1.0]


@pytest.mark.parametrize("events", ["", "not JSON", "[1, 2]", '{"time": 1}', '[{"time": "x", "what": 1}]'])
@pytest.mark.usefixtures("unplaced")
def test_events_that_cannot_be_read_cost_only_themselves(run: Any, events: str) -> None:
    run.attrs["events"] = events
    assert len(trajectory_figure(run).axes) == 9


@pytest.mark.usefixtures("unplaced")
def test_magnetic_run_shows_wobble_and_lag_but_no_motor(run: Any) -> None:
    gone = [name for name in run.data_vars if str(name).startswith(("motor", "electrical"))]
    run = run.drop_vars(gone).assign(wobble_angle=("time", 0.1 + 0 * TIME), phase_lag=("time", 0.5 + 0 * TIME))
    shown = panels(run.assign(friction_power=0.0 * run["friction_power"]))
    assert not {"motor current (A)", "motor current (mA)"} & set(shown)
    (power,) = (axes for label, axes in shown.items() if label.startswith("power"))
    assert [line.get_label() for line in power.lines[:2]] == ["shaft", "dissipated"]
    assert shown["wobble angle (deg)"].lines[0].get_ydata() == pytest.approx(np.degrees(0.1) + 0 * TIME)
    assert shown["phase lag (deg)"].lines[0].get_ydata() == pytest.approx(np.degrees(0.5) + 0 * TIME)


@pytest.fixture
def tube_run(run: Any) -> Any:
    """The same run with what one in a tube has: around the wall by 20 degrees, with a film of 500 to 5 micrometres."""
    robot = sp.load("biorob2012-wide")
    azimuth = np.radians(-20.0) * TIME / 2.0
    offset = 0.0105
    path = np.stack([1e-3 * TIME, offset * np.sin(azimuth), -offset * np.cos(azimuth)], axis=-1)
    turned = np.stack([np.cos(0.5 * azimuth), np.sin(0.5 * azimuth), 0 * TIME, 0 * TIME], axis=-1)
    more = {
        "azimuth": azimuth,
        "body_angle": -0.5 * TIME,
        "wall_gap": 5e-4 * 10.0**-TIME,
        "wall_pitch": np.radians(0.5 * TIME),
        "wall_yaw": np.radians(-0.2 * TIME),
        "contact_force": 0.02 * (TIME > 1.0),
        "contact_friction": 0.002 * (TIME > 1.0),
    }
    run = run.assign(
        position=(("time", "axis"), path),
        attitude=(("time", "quaternion"), turned),
        mean_forward_velocity=1e-3,
        **{name: ("time", values) for name, values in more.items()},
    )
    return run.assign_attrs(
        robot=robot.name, roughness=1e-5, ends="closed", settings=json.dumps(robot.model_dump(), sort_keys=True)
    )


@pytest.mark.parametrize("column", ["single", "double"])
@pytest.mark.usefixtures("unplaced")
def test_run_in_a_tube_shows_film_contact_and_cross_section(tube_run: Any, column: str) -> None:
    figure = trajectory_figure(tube_run, column)
    assert figure.get_figwidth() == COLUMNS[column]
    shown = {axes.get_ylabel().replace("\n", " "): axes for axes in figure.axes}
    gap = shown["gap (mm)"]
    assert gap.get_yscale() == "log"
    assert gap.lines[0].get_ydata() == pytest.approx(1e3 * tube_run["wall_gap"].values)
    assert list(gap.lines[1].get_ydata()) == pytest.approx([0.01, 0.01])  # the roughness
    assert shown["azimuth (deg)"].lines[0].get_ydata() == pytest.approx(-10.0 * TIME)
    assert shown["contact (mN)"].lines[0].get_ydata().max() == pytest.approx(20.0)
    assert shown["contact (mN)"].lines[1].get_ydata().max() == pytest.approx(2.0)
    section = figure.axes[0]
    path = section.lines[0]
    assert np.hypot(path.get_xdata(), path.get_ydata()) == pytest.approx(10.5 + 0 * TIME)
    assert float(path.get_xdata()[-1]) == pytest.approx(-10.5 * np.sin(np.radians(20.0)))
    end, start = (patch.get_xy() for patch in section.patches[:2])
    for outline, middle in ((start, (0.0, -10.5)), (end, (path.get_xdata()[-1], path.get_ydata()[-1]))):
        assert np.hypot(*(outline - middle).T) == pytest.approx(9.0 + 0 * outline[:, 0], rel=2e-3)
    assert section.patches[2].get_radius() == pytest.approx(20.0)  # the glass


@pytest.mark.usefixtures("unplaced")
@pytest.mark.parametrize(
    ("factor", "turned", "words"),
    [
        (1.0, 1.0, "goes 20° around the tube with its body's rotation"),
        (1.0, -1.0, "goes 20° around the tube against its body's rotation"),
        (0.0, 1.0, "stays at its azimuth"),
    ],
)
def test_headline_says_which_way_it_went(tube_run: Any, factor: float, turned: float, words: str) -> None:
    tube_run = tube_run.assign(azimuth=factor * tube_run["azimuth"], body_angle=turned * tube_run["body_angle"])
    texts = " ".join(text.get_text() for text in trajectory_figure(tube_run).findobj(Text))
    assert words in " ".join(texts.split())


@pytest.mark.usefixtures("unplaced")
def test_long_run_shows_means_over_a_turn_of_the_tail(tube_run: Any) -> None:
    """An oscillation at the tail's rate has none but its drift, whatever its amplitude."""
    long = tube_run.interp(time=np.linspace(0.0, 2.0, 2001))
    angle = 2.0 * np.pi * 20.0 * long["time"]  # 40 turns of 50 samples
    long = long.assign(tail_angle=angle, forward_velocity=1e-3 * (1.0 + np.sin(angle)) - 1e-4 * long["time"])
    figure = trajectory_figure(long)
    speed = next(axes for axes in figure.axes if axes.get_ylabel() == "velocity $U_x$ (mm/s)")
    time, mean = speed.lines[1].get_data()
    assert mean == pytest.approx(1.0 - 0.1 * np.asarray(time), abs=1e-6)
    assert any("means over a turn of the tail" in text.get_text() for text in figure.findobj(Text))
    short = long.assign(tail_angle=0.5 * angle)
    assert not any("means over a turn" in text.get_text() for text in trajectory_figure(short).findobj(Text))


@pytest.mark.usefixtures("unplaced")
def test_title_says_how_far_it_came_in_what_time(tube_run: Any) -> None:
    texts = " ".join(text.get_text() for text in trajectory_figure(tube_run).findobj(Text))
    assert "a robot swims 2 mm in 2 s " in " ".join(texts.split()).replace(str(tube_run.attrs.get("robot")), "a robot")
    fast = tube_run.assign(mean_forward_velocity_on=1.2345e-3).assign_attrs(roughness=9e-7)
    said = " ".join(" ".join(text.get_text() for text in trajectory_figure(fast).findobj(Text)).split())
    assert "mean velocity 1.234 mm/s with the drive on" in said
    assert "roughness 0.9 µm" in said


@pytest.mark.usefixtures("unplaced")
def test_robot_that_touches_nothing_has_no_panel_of_contact(tube_run: Any) -> None:
    tube_run = tube_run.assign(
        contact_force=0.0 * tube_run["contact_force"], contact_friction=0.0 * tube_run["azimuth"]
    )
    assert not [label for label in panels(tube_run) if label.startswith("contact")]


def test_unknown_width_is_named(run: Any) -> None:
    with pytest.raises(sp.InputError, match="column = 'triple'; allowed: single, double"):
        trajectory_figure(run, "triple")


@pytest.mark.usefixtures("unplaced")
def test_panel_of_nothing_but_nan_is_left_out(run: Any) -> None:
    run["wall_gap"][:] = np.nan
    assert not [label for label in panels(run) if label.startswith("gap")]


def test_robot_that_does_not_move_can_be_drawn(run: Any) -> None:
    for name in ("position", "forward_velocity", "pitch", "yaw"):
        run[name][:] = 0.0
    assert all(np.all(np.isfinite(axes.get_ylim())) for axes in trajectory_figure(run).axes)


@pytest.mark.usefixtures("unplaced")
def test_held_run_has_no_path_but_its_rates() -> None:
    run = sp.simulate("biorob2012-wide", motion="held", timing={"duration": 0.2, "samples_per_turn": 50}, model="rft")
    shown = panels(run)
    assert not [label for label in shown if label.startswith("$")]
    assert shown["rate (Hz)"].lines[0].get_ydata() == pytest.approx(run["tail_rotation_rate"].values / (2 * np.pi))


def test_run_without_data_is_named(run: Any) -> None:
    with pytest.raises(sp.InputError, match="the run has 1 samples of time; allowed: at least 2, increasing"):
        trajectory_figure(run.isel(time=[0]))
    with pytest.raises(sp.InputError, match="no variable to draw"):
        trajectory_figure(run[["time"]])


@pytest.mark.usefixtures("unplaced")
def test_short_figure_has_speed_and_gap(tube_run: Any) -> None:
    shown = [axes.get_ylabel().partition(" (")[0] for axes in trajectory_figure(tube_run, panels="main").axes]
    assert shown == ["velocity $U_x$", "gap"]
    with pytest.raises(sp.InputError, match="panels = 'some'; allowed: main, all"):
        trajectory_figure(tube_run, panels="some")
