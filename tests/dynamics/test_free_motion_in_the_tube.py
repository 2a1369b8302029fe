"""Free motion in the tube: its steady place against runs, laws, symmetries and balances; all answers agree."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
import pytest

import spirillum as sp
from spirillum.dynamics import tube_simulation
from spirillum.dynamics.free_motion import FreeMotion, free_motion
from spirillum.dynamics.return_map import STEPS, ReturnMap
from spirillum.dynamics.settling import lubrication_resistance
from spirillum.dynamics.tube_simulation import compare_with_check
from spirillum.fluid.tube.library import find_table
from spirillum.fluid.tube.table import least_checked_gap
from spirillum.fluid.wire.robot_geometry import RobotGeometry
from spirillum.kernels import core
from spirillum.kernels.core import largest_yaw
from spirillum.robot.batch import RobotBatch

ROUGH = "100 um"  # it comes to rest soon


@lru_cache
def robot() -> Any:
    return sp.load("biorob2012-wide", **{"friction.effective": "1.1e-5 N m s/rad"})


@lru_cache
def found(coefficient: float = 0.1, tail_rate: str | None = None) -> FreeMotion:
    in_tube = {"friction_coefficient": coefficient}
    return free_motion(robot(), roughness=ROUGH, in_tube=in_tube, tail_rate=tail_rate)


@lru_cache
def settled() -> Any:
    return sp.settle(robot(), roughness=ROUGH, in_tube={"friction_coefficient": 0.1}, until="0.2 mm")


def test_simulation_laid_down_at_the_steady_place_stays_there() -> None:
    """Within the ripple of the tail's phase: speed and body rate to 1 %, azimuth and yaw to 0.1 degrees."""
    motion = found().prediction
    lying = motion.steady_state
    assert lying is not None
    assert lying.state == "steady"
    place = {"gap": lying.gap, "pitch": lying.pitch, "yaw": lying.yaw}
    run = sp.simulate(
        robot(),
        model="tube",
        motion="free",
        roughness=ROUGH,
        placement=place,
        in_tube={"azimuth": lying.azimuth, "friction_coefficient": 0.1, "wait": 0.0},
        timing={"turns": 6.0},
    )
    assert float(run["mean_forward_velocity"]) == pytest.approx(motion.forward_velocity, rel=0.01)
    assert float(run["mean_body_rotation_rate"]) == pytest.approx(motion.body_rotation_rate, rel=0.01)
    assert np.degrees(float(run["azimuth"][-1])) == pytest.approx(np.degrees(lying.azimuth), abs=0.1)
    assert np.degrees(float(run["wall_yaw"][-1])) == pytest.approx(np.degrees(lying.yaw), abs=0.1)


def test_run_that_goes_on_nears_the_steady_place_as_its_multiplier_says() -> None:
    """From a tenth of a degree beside it: by e in the approach time, once the faster ways have died out."""
    motion = found()
    lying = motion.run.lying
    turns = ReturnMap(motion.robot, 1.0)
    state = motion.run.start.copy()
    rest = float(motion.robot.observe_state(state)[core.SEEN_AZIMUTH])
    cos, sin = np.cos(0.002), np.sin(0.002)
    state[1:3] = cos * state[1] - sin * state[2], sin * state[1] + cos * state[2]
    state[3:7] = _turned_about_x(state[3:7], 0.002)
    away, time = [], 0.0
    for _ in range(100):
        turn = turns.after(state)
        state, time = turn.state, time + turn.time
        away.append((time, float(motion.robot.observe_state(state)[core.SEEN_AZIMUTH]) - rest))
    late = np.array(away[75:])
    slope = np.polyfit(late[:, 0], np.log(np.abs(late[:, 1])), 1)[0]
    assert -1.0 / slope == pytest.approx(lying.approach_time, rel=0.02)


def test_a_mirror_image_nears_its_steady_place_as_fast() -> None:
    """A multiplier of 0.97 a turn makes an error of 1e-4 in it 0.3 % of that time."""
    mirrored = robot().model_copy(update={"tail": robot().tail.model_copy(update={"handedness": "left"})})
    there = free_motion(mirrored, roughness=ROUGH, in_tube={"friction_coefficient": 0.1}).run.lying
    assert there.approach_time == pytest.approx(found().run.lying.approach_time, rel=1e-3)
    assert there.azimuth == pytest.approx(-found().run.lying.azimuth, rel=1e-3)


def _turned_about_x(quaternion: np.ndarray, angle: float) -> np.ndarray:
    w, x, y, z = quaternion
    c, s = np.cos(0.5 * angle), np.sin(0.5 * angle)
    return np.array([c * w - s * x, c * x + s * w, c * y - s * z, c * z + s * y])


def test_film_carries_the_body_and_dry_friction_rolls_it_back() -> None:
    """The tail is right-handed: the body turns to negative rates, and so does the azimuth in a film."""
    film, dry = found(0.0).run.lying, found(0.1).run.lying
    assert found(0.0).prediction.body_rotation_rate < 0
    assert film.azimuth < -0.1
    assert dry.azimuth > film.azimuth + 0.1


def test_asperities_carry_the_weight_less_what_the_film_does() -> None:
    weight = float(found().robot.weight[:2].sum())
    assert found().run.lying.contact_force == pytest.approx(weight, rel=0.1)
    assert found(0.0).run.lying.contact_force == pytest.approx(weight * np.cos(found(0.0).run.lying.azimuth), rel=0.1)


def test_powers_of_the_steady_motion_balance() -> None:
    """Of the motor: K_m I omega_m goes to friction and shaft; of the shaft: to the fluid, and to dry friction."""
    motion = found(0.0).prediction
    given = robot().motor.torque_constant * motion.motor_current * motion.motor_rotation_rate
    assert motion.shaft_power + motion.friction_power == pytest.approx(given, rel=2e-3)
    assert motion.shaft_power == pytest.approx(motion.dissipated_power, rel=2e-3)
    assert motion.tail_rotation_rate - motion.body_rotation_rate == pytest.approx(motion.motor_rotation_rate)


def test_friction_is_inferred_at_a_tail_rate_that_is_given() -> None:
    """At the rate at which the motor turns it: the friction that was put in, and the same place."""
    driven = found()
    rate = driven.prediction.tail_rotation_rate
    given = found(0.1, f"{rate!r} rad/s")
    assert given.prediction.effective_friction == pytest.approx(1.1e-5, rel=0.01)
    assert given.prediction.forward_velocity == pytest.approx(driven.prediction.forward_velocity, rel=0.01)
    assert given.run.lying.azimuth == pytest.approx(driven.run.lying.azimuth, abs=2e-3)


def test_predict_settle_and_the_engine_say_the_same() -> None:
    """With the robot's own roughness and friction; what `settle` adds is the way there."""
    answer = settled()
    motion = found()
    assert answer.prediction.forward_velocity == pytest.approx(motion.prediction.forward_velocity, rel=1e-9)
    assert answer.steady_state == motion.run.lying
    gap, time = answer.trajectory("gap"), answer.trajectory("time")
    assert np.interp(answer.drainage_time, time, gap) == pytest.approx(2e-4, rel=1e-2)
    run = sp.simulate(robot(), timing={"duration": "3 s"}, roughness=ROUGH, in_tube={"wait": 0.0})
    step = int(np.argmin(np.abs(time - answer.drainage_time)))
    for name, ours in (("wall_gap", "gap"), ("azimuth", "azimuth"), ("wall_pitch", "pitch"), ("wall_yaw", "yaw")):
        theirs = float(np.interp(time[step], run["time"], run[name]))
        assert float(answer.trajectory(ours)[step]) == pytest.approx(theirs, rel=0.01), name
    content = answer.to_dict()
    assert content["steady_state"]["azimuth"]["value"] == motion.run.lying.azimuth
    assert content["drainage_time"]["until"]["value"] == 2e-4


def test_film_under_the_level_robot_is_a_thin_one() -> None:
    """Over 3 sqrt(2) pi mu L (a_e/h)^(3/2) of the straight side: towards 1 as the gap falls."""
    ratios = settled().lubrication_ratios
    assert ratios == pytest.approx(np.ones(ratios.size), abs=0.05)
    a, h = 9e-3, 1e-7
    xi = np.arccosh(1 + h / a)
    exact = 4 * np.pi * 3.5 * 0.026 / (xi - np.tanh(xi))  # beside a plane (Jeffrey and Onishi), h/a -> 0
    assert lubrication_resistance(3.5, 0.026, a, np.inf, h) == pytest.approx(exact, rel=1e-4)


def test_a_robot_that_dry_friction_holds_has_no_speed() -> None:
    """A heavy robot's friction is more than its drive's forces: what is left is the smoothing of Coulomb's law."""
    heavy = sp.load("biorob2012-wide", **{"body.mass": "60 g"})
    held = sp.predict(heavy, motion="free")
    assert any("dry friction (coefficient 0.1) holds the robot" in said for said in held.warnings)
    assert np.isnan(held.error_estimate)
    heavier = sp.load("biorob2012-wide", **{"body.mass": "1 kg"})
    run = sp.simulate(heavier, model="tube", timing={"duration": "4 s"}, in_tube={"wait": "10 s"})
    assert "dry friction (coefficient 0.1) holds the robot" in run.attrs["warnings"]
    assert np.isnan(run.attrs["error_estimate"])
    slides = sp.predict(heavy, motion="free", in_tube={"friction_coefficient": 0.0})
    assert slides.forward_velocity > 20.0 * held.forward_velocity
    assert not any("holds the robot" in said for said in slides.warnings)


def test_where_inertia_rules_no_motion_has_an_error_estimate() -> None:
    """The error is against other solutions of Stokes flow; `predict` refuses, held or free."""
    fast = sp.load("biorob2012-wide", **{"fluid.viscosity": "20 mPa s"})
    for motion in ("held", "free"):
        with pytest.raises(sp.InputError, match=r"Reynolds number .* allowed: at most 10"):
            sp.predict(fast, motion=motion)
    assert np.isnan(sp.predict(fast, beyond_stokes=True).error_estimate)
    fast = sp.load("biorob2012-wide", **{"fluid.viscosity": "20 mPa s", "model.beyond_stokes": "on"})
    run = sp.simulate(fast, model="tube", timing={"duration": "1 s"})
    assert "at the largest speed of the run" in run.attrs["warnings"]
    assert np.isnan(run.attrs["error_estimate"])
    assert np.isnan(sp.simulate(fast, model="slender", timing={"duration": "0.2 s"}).attrs["error_estimate"])


@pytest.mark.parametrize(
    ("overrides", "options", "words"),
    [
        ({"channel": "none"}, {}, "channel"),
        ({}, {"placement": {"gap": "15 mm"}}, "placement.gap"),
        ({}, {"placement": {"tail_drop": "1 mm"}}, "placement.tail_drop"),
        ({}, {"until": "1 mm"}, "until = 1 mm; allowed: less than 0.5 mm"),
        ({}, {"until": "1"}, 'until = "1" has no unit'),
        ({}, {"in_tube": {"wait": "1 s"}}, "in_tube.wait = 1 s has no steady motion"),
        ({}, {"tail_rate": "0 Hz"}, "a tail at rest"),
    ],
)
def test_bad_input_is_one_sentence(overrides: dict[str, Any], options: dict[str, Any], words: str) -> None:
    with pytest.raises(sp.InputError) as refused:
        sp.settle(sp.load("biorob2012-wide", **overrides), **options)
    assert words in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(("share", "known"), [(0.99, True), (-0.99, True), (1.01, False), (-1.01, False)])
def test_error_is_stated_up_to_the_yaw_at_which_the_table_was_checked(share: float, known: bool) -> None:
    """Up to the yaw at which the tail is near the glass where the robot lies."""
    motion = found()
    table, steps = motion.robot.table, motion.run.turn.steps
    gap, offset, pitch = (steps[:, STEPS.index(name)] for name in ("gap", "offset", "pitch"))
    yaw = share * np.array([largest_yaw(table, *place) for place in zip(offset, pitch, strict=True)])
    checked = compare_with_check(table, gap=np.maximum(gap, 1e-3), offset=offset, pitch=pitch, yaw=yaw)
    assert checked.known is known
    assert ("there is no error estimate" in " ".join(checked.notes)) is not known


def test_a_thin_film_is_told_from_the_places_at_which_the_table_was_checked() -> None:
    """0.08 of the radius is the gap of the first nodes, 0.4 of that the least of a place that is held out."""
    table = find_table(RobotGeometry.of(RobotBatch.of(sp.load("biorob2012-wide"))), 20e-3)
    assert table is not None
    assert least_checked_gap(table.packed) == pytest.approx(0.4 * 0.08 * 9e-3, rel=1e-4)
    thin, wide = (
        sp.simulate("biorob2012-wide", timing={"duration": "0.1 s"}, placement={"gap": gap}, in_tube={"wait": 0.0})
        for gap in ("0.2 mm", "0.5 mm")
    )
    assert "mm: below 0.29 mm its table is a film with an extrapolated rest" in thin.attrs["warnings"]
    assert "its gap falls" not in wide.attrs["warnings"]
    assert np.isfinite(thin.attrs["error_estimate"])


@pytest.mark.parametrize(("checked", "known"), [(3.2, True), (2.8, False)])
def test_run_states_an_error_up_to_the_yaw_at_which_the_table_was_checked(
    monkeypatch: pytest.MonkeyPatch, checked: float, known: bool
) -> None:
    monkeypatch.setattr(tube_simulation, "largest_yaw", lambda *_: np.radians(checked))
    place = {"gap": "1 mm", "yaw": "3 deg"}
    run = sp.simulate("biorob2012-narrow", timing={"duration": "0.1 s"}, placement=place, in_tube={"wait": 0.0})
    assert np.isfinite(run.attrs["error_estimate"]) == known
    assert ("there is no error estimate" in run.attrs["warnings"]) != known
    assert "roughness and dry friction are assumed" in run.attrs["known_error"]
    assert "not validated against an experiment" in run.attrs["known_error"]
