"""Intervals agree with one another: what is computed from a disturbed speed or rate is disturbed with it."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

import spirillum as sp
from spirillum.fitted.calibration_file import CalibrationFile, calibrated_robot
from spirillum.fitted.posterior_file import PosteriorFile
from spirillum.fluid.registry import find_swimmer_model
from spirillum.robot.load import load
from spirillum.robot.robot import Robot
from spirillum.swimming.intervals import intervals_of
from spirillum.swimming.motions import STEADY

WIDE = "biorob2012-wide"
NAMES = [item.name for item in STEADY]
SBT = find_swimmer_model("sbt")


def posterior(discrepancy: Mapping[str, float], size: int = 400, spread: float = 0.0) -> PosteriorFile:
    """Made-up draws of the factors of two channels, no number of which is measured."""
    rng = np.random.default_rng(5)
    middles = {"body_drag": np.array([3.6, 1.95]), "body_rotation": np.array([0.55, 0.62])}
    draws = {name: value * np.exp(spread * rng.normal(size=(size, 2))) for name, value in middles.items()}
    return PosteriorFile(
        source="made up",
        sha256="",
        model="sbt",
        observations="none",
        synthetic=True,
        channels=(0.03, 0.04),
        body=(0.018, 0.035),
        draws=draws,
        middle=middles,
        discrepancy={name: np.full(size, value) for name, value in discrepancy.items()},
        error={},
        friction=(),
        friction_reading="",
    )


def limits(
    robot: Robot, known: PosteriorFile, tail_rate: float | None = 7.0
) -> tuple[Mapping[str, float], Mapping[str, float]]:
    found = intervals_of(known.central(robot), SBT, known, tail_rate=tail_rate, friction="rotor")
    return found.low, found.high


@pytest.mark.parametrize(
    ("rate", "reading"),
    [(None, "rotor"), (None, "body"), (None, "paper"), (7.0, "rotor"), (7.0, "none"), (7.0, "paper")],
)
def test_without_discrepancy_every_quantity_is_that_of_a_prediction(rate: float | None, reading: str) -> None:
    known = posterior({}, size=12, spread=0.05)
    robot = known.central(load(WIDE, **{"friction.effective": "1e-5 N m s/rad"}))
    found = intervals_of(robot, SBT, known, tail_rate=rate, friction=reading)
    alone = []
    for drag, rotation in zip(known.draws["body_drag"][:, 1], known.draws["body_rotation"][:, 1], strict=True):
        factors = {"body_drag": float(drag), "body_rotation": float(rotation)}
        own = robot.model_copy(update={"calibration": {"sbt": robot.calibration["sbt"].model_copy(update=factors)}})
        alone.append(sp.predict(own, tail_rate=rate, friction=reading, model="sbt"))
    told = 0
    for name in NAMES:
        if np.isfinite(found.low[name]):
            told += 1
            ends = np.quantile([getattr(answer, name) for answer in alone], [0.025, 0.975])
            assert [found.low[name], found.high[name]] == pytest.approx(ends, rel=1e-6), name
    assert told > 10


def test_cost_and_efficiencies_follow_the_speed() -> None:
    low, high = limits(load(WIDE), posterior({"advance": 0.05}))
    assert high["forward_velocity"] / low["forward_velocity"] > 1.15
    spread = high["forward_velocity"] / low["forward_velocity"]
    # The power is known: the cost of transport is as uncertain as the speed, its square's ratios twice as much.
    assert high["cost_of_transport"] / low["cost_of_transport"] == pytest.approx(spread, rel=1e-2)
    for name in ("propulsive_power", "hydrodynamic_efficiency", "overall_efficiency"):
        assert high[name] / low[name] == pytest.approx(spread**2, rel=1e-2), name
    assert not np.isfinite(low["electrical_power"])


def test_torque_and_power_follow_the_rate_of_the_own_drive() -> None:
    robot = load(WIDE, **{"friction.effective": "1e-5 N m s/rad"})
    low, high = limits(robot, posterior({"motor_rate": 0.03}), tail_rate=None)
    spread = high["tail_rotation_rate"] / low["tail_rotation_rate"]
    assert spread > 1.08
    for name in ("tail_reynolds_number", "drive_torque", "reynolds_number", "motor_rotation_rate"):
        assert high[name] / low[name] == pytest.approx(spread, rel=1e-6), name
    for name in ("shaft_power", "friction_power", "dissipated_power"):
        assert high[name] / low[name] == pytest.approx(spread**2, rel=1e-2), name
    # The faster it turns the less current (17) leaves.
    assert low["motor_current"] < high["motor_current"]


def test_a_fixed_joint_stays_fixed() -> None:
    low, high = limits(load("magnetic-helix"), posterior({"advance": 0.05, "turning": 0.05}), tail_rate=None)
    for name in ("body_rotation_rate", "motor_rotation_rate", "tail_rotation_rate"):
        assert not np.isfinite(low[name]), name
    assert low["forward_velocity"] < high["forward_velocity"]


@pytest.mark.parametrize("robot", ["ecoli", "magnetic-helix", {"extends": WIDE, "channel": "none"}])
def test_a_robot_without_channel_has_its_value_inside_its_interval(robot: Any) -> None:
    known = posterior({"advance": 0.02, "turning": 0.02}, spread=0.01)
    own = known.central(load(robot))
    low, high = limits(load(robot), known, tail_rate=6.0)
    value = sp.predict(own, tail_rate=6.0, model="sbt").forward_velocity
    assert min(low["forward_velocity"], high["forward_velocity"]) < value
    assert value < max(low["forward_velocity"], high["forward_velocity"])
    # The rule of a calibration file: the widest channel is the nearest to an unbounded fluid.
    assert own.calibration["sbt"].body_drag == pytest.approx(1.95)
    entries = tuple(known.central(load(name)).calibration["sbt"] for name in (WIDE, "biorob2012-narrow"))
    file = CalibrationFile.model_construct(calibration={"sbt": entries})
    assert calibrated_robot(load(robot), file).calibration["sbt"].body_drag == pytest.approx(1.95)
