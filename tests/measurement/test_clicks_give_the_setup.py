"""Clicks in a picture against what was planted there: spacing, scale, direction, order of the stripes."""

import re
import tomllib

import numpy as np
import pytest

from spirillum.errors import InputError
from spirillum.measurement.clicks import (
    across,
    length_per_pixel_between,
    nose_side,
    spacing_between,
    stripe_names,
    stripes_in_order,
)
from spirillum.measurement.setup_template import setup_fields, setup_file, setup_problems, setup_text, toml_value
from spirillum.robot.mesh import STRIPE_COLOURS
from spirillum.vision.camera.ruler import lines_in

RING = ("red", "yellow", "green", "blue") * 2
DISTANCE, FIRST = 6.4, 3.0
"""Of the drawn lines, pixels; column of the first."""


@pytest.fixture(scope="module")
def lines() -> object:
    """A strip of a ruler: a smooth wave, dark at each line."""
    pytest.importorskip("cv2")
    picture = np.full((120, 400, 3), 200.0)
    wave = 60.0 * np.cos(2 * np.pi * (np.arange(400) - FIRST) / DISTANCE)
    picture[40:70] -= wave[None, :, None]
    found = lines_in(picture, (0, 0, 400, 120))
    assert found is not None
    return found


@pytest.mark.parametrize("count", [5, 30, 55])
def test_spacing_is_the_length_over_the_lines_between(lines: object, count: int) -> None:
    one, other = (FIRST + DISTANCE, 50.0), (FIRST + DISTANCE * (1 + count), 58.0)
    for first, second in ((one, other), (other, one)):
        assert spacing_between(lines, first, second, count * 2e-3) == pytest.approx(2e-3)
    beside = (other[0] + 0.2 * DISTANCE, other[1])
    assert spacing_between(lines, one, beside, count * 2e-3) == pytest.approx(2e-3)


def test_clicks_that_are_no_marks_get_a_sentence(lines: object) -> None:
    with pytest.raises(InputError, match=r"20\.5 spacings.*whole number"):
        spacing_between(lines, (50.0, 50.0), (50.0 + 20.5 * DISTANCE, 50.0), 0.04)
    with pytest.raises(InputError, match="at least 4"):
        spacing_between(lines, (50.0, 50.0), (50.0 + DISTANCE, 50.0), 0.002)


def test_scale_at_the_axis_follows_similar_triangles() -> None:
    """In air a length looks smaller with its distance; under oil of index n the depth counts 1/n."""
    marks = {"one": (10.0, 5.0), "other": (110.0, 5.0), "length": 0.02, "heights": (0.0, 0.02), "camera": 0.2}
    air = length_per_pixel_between(**marks, surface=None, index=1.4)
    assert air == pytest.approx(0.02 / 100 * 0.18 / 0.2)
    oil = length_per_pixel_between(**marks, surface=0.06, index=1.5)
    assert oil == pytest.approx(0.02 / 100 * (0.14 + 0.04 / 1.5) / (0.14 + 0.06 / 1.5))


def test_nose_and_rear_say_the_direction() -> None:
    assert nose_side((200.0, 80.0), (100.0, 90.0)) == "right"
    assert nose_side((100.0, 90.0), (200.0, 80.0)) == "left"
    assert nose_side((100.0, 90.0), (110.0, 200.0)) == "up"
    assert nose_side((100.0, 200.0), (110.0, 90.0)) == "down"
    with pytest.raises(InputError, match="pixels apart"):
        nose_side((100.0, 90.0), (110.0, 92.0))


@pytest.mark.parametrize(("direction", "turn"), [("right", 0), ("down", 1), ("left", 2), ("up", 3)])
def test_stripes_keep_their_order_when_the_picture_is_turned(direction: str, turn: int) -> None:
    """Pixels count downwards: a quarter turn clockwise takes (u, v) to (-v, u)."""
    points = [(50.0, v) for v in (10.0, 20.0, 30.0)]
    for _ in range(turn):
        points = [(-v, u) for u, v in points]
    assert across(points[::-1], direction) == points


@pytest.mark.parametrize("direction", ["east", "", ["right"]])
def test_stripes_of_a_robot_that_points_nowhere_get_a_sentence(direction: str) -> None:
    with pytest.raises(InputError, match=r"robot\.direction = .*; allowed: right, left, up, down"):
        across([(50.0, 10.0)], direction)


@pytest.mark.parametrize("lamp", [0.6, 1.0])
def test_colours_are_named_under_a_dim_lamp(lamp: float) -> None:
    names = ["red", "yellow", "green", "blue"]
    image = np.zeros((9, 40, 3), dtype=np.uint8)
    for k, name in enumerate(names):
        image[:, 10 * k : 10 * k + 10] = np.round(255 * lamp * np.array(STRIPE_COLOURS[name]))
    clicks = [(10.0 * k + 5.0, 4.0) for k in range(4)]
    assert stripe_names(image, clicks, RING) == names


def test_stripes_in_view_say_the_order_of_all() -> None:
    assert stripes_in_order(["blue", "red", "yellow"], RING)[0] == ()
    turned, words = stripes_in_order(["yellow", "red", "blue"], RING)
    assert turned == RING[::-1]
    assert "opposite" in words
    other = ["red", "green", "yellow", "blue"]
    assert stripes_in_order(other, RING)[0] == tuple(other * 2)
    assert stripes_in_order(["cyan", "black", "cyan"], RING)[0] == ("cyan", "black") * 4
    for wrong, sentence in ((["red", "green"], "first comes again"), (["red"], "fewer than two")):
        with pytest.raises(InputError, match=sentence):
            stripes_in_order(wrong, RING)


def test_fields_are_their_file_and_back() -> None:
    fields = {
        "start": "2 s",
        "camera.height": "210 mm",
        "markers.spacing": "2 mm",
        "markers.height": "0 mm",
        "robot.file": "biorob2012-wide",
        "robot.axis_height": "11.5 mm",
        "robot.stripes": ["red", "blue"],
        "tank.index": 1.4,
    }
    assert setup_fields(setup_file(fields), "the file") == fields
    assert setup_problems(fields) == []
    assert setup_problems({"camera.height": "210 apples", "tank.index": "x"})[0].startswith("camera.height")


def test_no_clicks_name_no_stripes() -> None:
    seen = stripe_names(np.zeros((9, 9, 3), np.uint8), [], RING)
    with pytest.raises(InputError, match="fewer than two colours"):
        stripes_in_order(seen, RING)


@pytest.mark.parametrize("value", ['my "best" robot.toml', "back\\slash.toml", "Rührer.toml", ["red", "blue"], 0.25])
def test_values_of_a_setup_file_are_read_back(value):
    text = setup_text({"robot.file": (toml_value(value), "as asked for")})
    assert tomllib.loads(text)["robot"]["file"] == value


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"index": float("nan")}, "tank.index = nan; allowed: from 1 to 3"),
        ({"index": 0.0}, "tank.index = 0; allowed"),
        ({"index": -1.4}, "tank.index = -1.4; allowed"),
        ({"camera": 0.05}, "camera.height = 50 mm, with marks, axis or surface at 60 mm; allowed: a lens above"),
    ],
)
def test_optics_that_cannot_be_give_no_scale(changed: dict[str, float], words: str) -> None:
    """Nothing of a wrong index or height comes into a setup as a length per pixel."""
    right = {"heights": (0.0, 0.01), "camera": 0.5, "surface": 0.06, "index": 1.4}
    with pytest.raises(InputError, match=re.escape(words)):
        length_per_pixel_between((0.0, 0.0), (100.0, 0.0), 0.01, **(right | changed))
