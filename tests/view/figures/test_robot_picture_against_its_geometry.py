"""The side view is to scale, the wire is a right-handed helix seen along +y, and every robot can be drawn."""

from pathlib import Path

import numpy as np
import pytest
from matplotlib.collections import LineCollection

import spirillum as sp
from spirillum.robot.batch import RobotBatch
from spirillum.robot.links import outlines_of
from spirillum.view.annotate import Annotator
from spirillum.view.figures.robot import robot_figure, robot_words
from spirillum.view.figures.scene import PHASE, crests
from spirillum.view.figures.style import save_as


def test_body_outline_encloses_the_bodys_volume() -> None:
    for fields in (
        {},
        {"body.rear": "hemisphere"},
        {"body.shape": "cylinder", "body.front": "fillet", "body.rear": "fillet", "body.fillet": "3 mm"},
    ):
        robot = sp.load("biorob2012-wide", **fields)
        x, radius = outlines_of(robot)["body"].line(np.linspace(0.0, 1.0, 60))
        volume = -np.sum(np.diff(x) * np.pi / 3 * (radius[1:] ** 2 + radius[1:] * radius[:-1] + radius[:-1] ** 2))
        assert volume == pytest.approx(RobotBatch.of(robot).body_volume[0], rel=1e-3)
        assert x.max() - x.min() == pytest.approx(robot.body.length)
        assert 2 * radius.max() == pytest.approx(robot.body.diameter)


def test_outline_over_a_film_has_the_bodys_fillets() -> None:
    fields = {"body.shape": "cylinder", "body.front": "fillet", "body.rear": "fillet", "body.fillet": "3 mm"}
    robot = sp.load("biorob2012-wide", **fields)
    x, y, _ = Annotator(robot)._outline.T
    area = 0.5 * abs(np.sum(x * np.roll(y, 1) - y * np.roll(x, 1)))
    expected = robot.body.length * robot.body.diameter - (4.0 - np.pi) * 0.003**2
    assert area == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("hand", ["right", "left"])
def test_crests_are_a_wavelength_apart_and_on_the_wire(hand: str) -> None:
    robot = sp.load("biorob2012-wide", **{"tail.handedness": hand, "tail.wavelength": "10 mm", "tail.taper": "none"})
    found = crests(robot, PHASE, 1.0)
    np.testing.assert_allclose(np.diff(found), -0.01)
    np.testing.assert_allclose(np.sin(robot.hand * 2 * np.pi / 0.01 * found + PHASE), 1.0)
    assert found.size == 6


@pytest.mark.parametrize(("hand", "slope"), [("right", -1.0), ("left", 1.0)])
def test_near_side_of_a_right_handed_tail_falls_to_the_right(hand: str, slope: float) -> None:
    figure = robot_figure(sp.load("biorob2012-wide", **{"tail.handedness": hand, "tail.taper": "none"}))
    (wire,) = [item for item in figure.axes[0].collections if isinstance(item, LineCollection)]
    nearest = np.asarray(wire.get_segments()[-1])  # drawn last: nearest to the viewer
    (x0, z0), (x1, z1) = nearest
    assert np.sign((z1 - z0) / (x1 - x0)) == slope


def test_picture_is_to_scale() -> None:
    figure = robot_figure(sp.load("biorob2012-wide"))
    axes = figure.axes[0]
    width, height = figure.get_size_inches()
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    assert (right - left) / width == pytest.approx((top - bottom) / height)
    (wire,) = [item for item in axes.collections if isinstance(item, LineCollection)]
    points = 72 * width / (right - left)
    unit = 0.105 / 105.0 if right - left > 10 else 1.0
    assert max(wire.get_linewidths()) == pytest.approx(0.001 / unit * points)


def test_dimensions_of_table_one_are_written() -> None:
    words = " ".join(text.get_text() for text in robot_figure(sp.load("biorob2012-wide")).axes[0].texts)
    for wanted in (
        "$D_{ch}$ = 40 mm",
        "$D_b$ = 18 mm",
        "$L_b$ = 35 mm",
        "$L_t$ = 60 mm",
        "$\\lambda$ = 25 mm",
        "$B_o$ = 2.5 mm",
        "$D_t$ = 1 mm",
        "computed geometry",
    ):
        assert wanted in words
    assert "$L_c$\n10 mm" in words


@pytest.mark.parametrize(
    "fields",
    [
        {"channel": "none", "coupling.length": "0 mm"},
        {"channel.diameter": "19 mm", "tail.wavelength": "80 mm"},
        {"channel.diameter": "2 m", "tail.amplitude": "8 mm", "tail.wavelength": "20 mm"},
        {"body.diameter": "0.9 m", "body.rear": "flat", "body.length": "1 m", "channel": "none"},
        {"body.diameter": "2 um", "body.length": "4 um", "tail.length": "20 um", "tail.wavelength": "5 um",
         "tail.amplitude": "0.8 um", "tail.wire_diameter": "100 nm", "coupling.length": "0 mm", "channel": "none"},
        {"tail.wavelength": "1 mm", "tail.amplitude": "1 mm", "tail.wire_diameter": "0.05 mm"},
    ],
)  # fmt: skip
def test_any_robot_can_be_drawn(fields: dict[str, str], tmp_path: Path) -> None:
    robot = sp.load("biorob2012-wide", **fields)
    figure = robot_figure(robot)
    assert figure.get_size_inches()[1] < 20
    png = tmp_path / "robot.png"
    save_as(figure, png)
    assert png.stat().st_size > 10_000
    assert "not a photograph" in robot_words(robot)


def test_reverse_motor_swims_to_the_left() -> None:
    assert "to the right" in robot_words(sp.load("biorob2012-wide"))
    assert "to the left" in robot_words(sp.load("biorob2012-wide", **{"motor.polarity": "reverse"}))
