"""A placement from text and numbers, and what is said of wrong ones."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from spirillum import InputError
from spirillum.robot.batch import RobotBatch, batches
from spirillum.robot.load import load
from spirillum.robot.placement import Placement


def test_text_and_floats_are_the_same() -> None:
    text = Placement.of({"gap": "0.5 mm", "pitch": "2 deg", "tail_drop": "1 mm", "flow": "-2 mm/s"})
    numbers = Placement.of({"gap": 5e-4, "pitch": np.radians(2), "tail_drop": np.float64(1e-3), "flow": -2e-3})
    assert text == numbers
    assert (text.gap, text.tail_drop, text.flow) == (5e-4, 1e-3, -2e-3)
    assert Placement.of({"eccentricity": 1}) == Placement.of({"eccentricity": 1.0})
    assert Placement.of(text) is text
    assert Placement.of(None) == Placement.of({}) == Placement.of({"gap": None}) == Placement()
    assert not Placement().is_set
    assert all(Placement.of(given).is_set for given in ({"ends": "closed"}, {"flow": 0.0}, {"pitch": 0.0}))


def test_ends_in_force() -> None:
    assert Placement().ends_of(2.0) == "open"
    assert Placement().ends_of(np.inf) == Placement().ends_of(np.nan) == "closed"
    assert Placement.of({"ends": "closed"}).ends_of(2.0) == "closed"
    assert Placement.of({"flow": 0.0}).ends_of(2.0) is None


def test_level() -> None:
    assert Placement.of({"eccentricity": 0.5}).level
    assert Placement.of({"pitch": 0.0}).level
    assert not Placement.of({"gap": 1e-3}).level
    assert not Placement.of({"pitch": "1 deg"}).level
    assert not Placement.of({"pitch": "0 deg", "yaw": "1 deg"}).level


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"gap": "0 mm"}, ('placement.gap = "0 mm"', "1 nm to 100 m")),
        ({"gap": 0}, ("placement.gap = ", "1 nm to 100 m")),
        ({"gap": float("nan")}, ("placement.gap = ", "not finite")),
        ({"gap": "0.5 s"}, ('placement.gap = "0.5 s"', "a unit of length")),
        ({"gap": True}, ("placement.gap = True", "a number with its unit")),
        ({"gap": ["1 mm"]}, ("placement.gap = ", "a number with its unit")),
        ({"eccentricity": 1.2}, ("placement.eccentricity = 1.2", "allowed: 0 to 1")),
        ({"eccentricity": -0.1}, ("placement.eccentricity = -0.1", "allowed: 0 to 1")),
        ({"eccentricity": float("nan")}, ("placement.eccentricity = nan", "finite number")),
        ({"eccentricity": "0.5"}, ("placement.eccentricity = '0.5'", "number")),
        ({"pitch": "-46 deg"}, ('placement.pitch = "-46 deg"', "-45 deg to 45 deg")),
        ({"pitch": "46 deg"}, ('placement.pitch = "46 deg"', "-45 deg to 45 deg")),
        ({"yaw": "46 deg"}, ('placement.yaw = "46 deg"', "-45 deg to 45 deg")),
        ({"yaw": "-46 deg"}, ('placement.yaw = "-46 deg"', "-45 deg to 45 deg")),
        ({"tail_drop": "-1 mm"}, ('placement.tail_drop = "-1 mm"', "0 m to 100 m")),
        ({"ends": "opn"}, ("placement.ends = 'opn'", "did you mean open?", "'open' or 'closed'")),
        ({"flow": "nan mm/s"}, ('placement.flow = "nan mm/s"', "not finite")),
        ({"flow": "1 mm"}, ('placement.flow = "1 mm"', "a unit of velocity")),
        ({"gapp": "1 mm"}, ("placement.gapp is not a known field (did you mean gap?)", "gap, eccentricity, pitch")),
        ({"gap": "1 mm", "eccentricity": 0.5}, ("placement.eccentricity = 0.5", "placement.gap = 1 mm", "one of them")),
        ({"pitch": "2 deg", "eccentricity": 0.5}, ("placement.pitch = 2 deg", "placement.gap for a pitched robot")),
        ({"yaw": "-2 deg", "eccentricity": 0.5}, ("placement.yaw = -2 deg", "placement.gap for a yawed robot")),
        ({"flow": "2 mm/s", "ends": "open"}, ("placement.ends = 'open'", "placement.flow = 2 mm/s", "one of them")),
    ],
)
def test_wrong_placement_is_named(given: dict[str, Any], words: tuple[str, ...]) -> None:
    with pytest.raises(InputError) as caught:
        Placement.of(given)
    assert all(word in str(caught.value) for word in words), str(caught.value)


def test_every_problem_is_listed() -> None:
    with pytest.raises(InputError) as caught:
        Placement.of({"gap": "-1 mm", "ends": "shut", "flow": 1e9})
    assert len(caught.value.problems) == 3


@pytest.mark.parametrize("given", ["0.5 mm", 5e-4, ["gap"]])
def test_what_is_no_table_is_refused(given: Any) -> None:
    with pytest.raises(InputError, match="allowed: gap, eccentricity, pitch, yaw, tail_drop, ends, flow, each by name"):
        Placement.of(given)


def test_a_batch_carries_it(batch_of: Callable[..., Any]) -> None:
    robots = [load("biorob2012-wide", **{"tail.amplitude": amplitude}) for amplitude in ("2 mm", "3 mm")]
    low = Placement.of({"gap": "0.5 mm"})
    assert RobotBatch.of(robots).placement == Placement()
    batch = RobotBatch.of(robots, low)
    assert batch.placement is low
    assert batch.with_values({"tail.wavelength": 0.02}).placement is low
    assert all(block.placement is low for _, block in batch.blocks(1))
    assert all(each.placement is low for _, each in batches(robots, low))
    assert batch.placed(Placement()).placement == Placement()
    np.testing.assert_array_equal(batch.placed(Placement()).amplitude, batch.amplitude)
