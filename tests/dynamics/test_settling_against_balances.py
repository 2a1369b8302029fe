"""Where a robot comes to lie: closed forms on made-up films, and symmetries of the real one."""

from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
import pytest

import spirillum as sp
from spirillum.dynamics.resting_forces import (
    Film,
    contact_line,
    descent_of,
    film_of,
    lubrication_resistance,
    orbit_period,
    settled_azimuth,
    settling_time,
)
from spirillum.robot.outline import body_outline

WIDE = "biorob2012-wide"
WEIGHT = 0.02
QUICK: dict[str, Any] = {"resolution": {"tolerance": 0.05, "phases": 2}, "drain": ("8 mm", "2 mm"), "gaps": 2}


def film(gap: float, sideways: float = 0.0, normal: float = 0.0, along: float = 15.0, across: float = 200.0) -> Film:
    """A made-up film in a tube in which the gap on the axis is 11 mm."""
    resistances = np.array([[along, 0.0, 0.0], [0.0, across, -0.5], [0.0, -0.5, 0.02]])
    return Film(gap, 0.011 - gap, -0.2, np.array([[sideways, normal, 1e-5, 0.0]]), resistances)


def power_law(gaps: Any, sideways: float = 0.0) -> list[Film]:
    """Films whose resistance to sinking is 2.5e-3 h^(-3/2)."""
    return [film(h, sideways, across=2.5e-3 * h**-1.5) for h in gaps]


@lru_cache
def settled(**options: Any) -> Any:
    """The paper's robot with one turn of its tail, at a coarse resolution."""
    placement = {name: options.pop(name) for name in ("gap", "eccentricity") if name in options}
    overrides = {name: options.pop(name) for name in tuple(options) if "." in name}
    robot = sp.load(WIDE, **{"tail.length": "25 mm", **overrides})
    return sp.settle(robot, placement=placement or {"gap": "2 mm"}, **{**QUICK, "tail_rate": "1.2 Hz", **options})


def test_weight_holds_the_sideways_force_at_the_settled_azimuth() -> None:
    for force in (-0.013, 0.0, 0.019):
        assert WEIGHT * np.sin(settled_azimuth(force, WEIGHT)) == pytest.approx(force, abs=1e-17)
    assert np.isnan(settled_azimuth(0.021, WEIGHT))
    assert np.isnan(settling_time(film(5e-4, 0.021), WEIGHT))
    assert np.isnan(orbit_period(film(5e-4, 0.013), WEIGHT))


def test_distance_from_the_settled_azimuth_falls_by_e_in_the_settling_time() -> None:
    there = film(5e-4, sideways=0.012, across=1.6e9)  # sinks by 1 nm in 100 s
    path = descent_of([there, film(5e-4 - 1e-9, sideways=0.012, across=1.6e9)], WEIGHT)
    left = settled_azimuth(0.012, WEIGHT) - path.azimuth
    late = (path.time > 30.0) & (path.time < 80.0)
    slope = np.polyfit(path.time[late], np.log(left[late]), 1)[0]
    assert -1 / slope == pytest.approx(settling_time(there, WEIGHT), rel=0.01)


def test_once_around_takes_the_integral_of_the_inverse_rate() -> None:
    there, force = film(5e-4, sideways=0.025), 0.025
    chi = np.linspace(0.0, 2 * np.pi, 4001)[:-1]
    inverse = there.offset * there.sideways_resistance / (force - WEIGHT * np.sin(chi))
    assert orbit_period(there, WEIGHT) == pytest.approx(2 * np.pi * inverse.mean(), rel=1e-10)


def test_straight_fall_takes_the_closed_form_of_a_power_law() -> None:
    path = descent_of(power_law((1e-3, 5e-4, 2e-4)), WEIGHT)
    exact = 2 * 2.5e-3 / WEIGHT * (2e-4**-0.5 - path.gap[0] ** -0.5)
    assert path.drained
    assert path.time[-1] == pytest.approx(exact, rel=1e-7)
    middle = (path.gap[0] ** -0.5 + path.time * WEIGHT / (2 * 2.5e-3)) ** -2
    assert path.gap == pytest.approx(middle, rel=1e-6)
    assert np.all(path.azimuth == 0)


def test_sideways_force_slows_the_fall_and_turns_with_its_sign() -> None:
    gaps = (1e-3, 5e-4, 2e-4)
    straight, right, left = (descent_of(power_law(gaps, force), WEIGHT) for force in (0.0, 0.01, -0.01))
    assert right.time[-1] > straight.time[-1]
    assert right.time[-1] == pytest.approx(left.time[-1], rel=1e-9)
    assert right.azimuth == pytest.approx(-left.azimuth, rel=1e-7, abs=1e-12)
    assert np.all(np.diff(right.azimuth) > 0)


def test_force_beyond_the_weight_carries_the_robot_up_and_the_gap_opens_again() -> None:
    path = descent_of(power_law((1e-3, 5e-4, 1e-4), 0.1), WEIGHT)
    assert not path.drained
    assert path.gap.min() > 1e-4
    assert path.gap[-1] == pytest.approx(path.gap[0], rel=1e-4)
    assert path.azimuth[-1] == pytest.approx(np.pi, rel=1e-3)  # reversible: what it sinks before pi/2 it rises after


def random_matrices(count: int) -> np.ndarray:
    rng = np.random.default_rng(5)
    factors = rng.normal(size=(count, 12, 12))
    return factors @ factors.transpose(0, 2, 1) + np.eye(12)


@pytest.mark.parametrize("one_piece", [False, True])
def test_reduced_resistances_answer_a_pull_with_the_free_motions_left_free(one_piece: bool) -> None:
    matrices, motion = random_matrices(3), np.zeros(12)
    motion[[0, 3, 6, 9]] = 1e-3, -0.2, 1e-3, 7.0
    found = film_of(matrices, motion, 1e-3, 0.01, one_piece=one_piece, wall_friction=0.7)
    mean = matrices.mean(axis=0)
    moves = np.zeros((12, 5))  # U, Omega of the body, U_y, U_z, nose up
    moves[[0, 6], 0] = moves[3, 1] = 1.0
    moves[[1, 7], 2] = moves[[2, 8], 3] = 1.0
    moves[[4, 10], 4] = -1.0
    whole = moves.T @ mean @ moves
    whole[1, 1] += 0.7
    kept = [0, 2, 3, 4] if one_piece else [0, 1, 2, 3, 4]
    mobility = np.linalg.inv(whole[np.ix_(kept, kept)])[-3:, -3:]
    assert found.resistances == pytest.approx(np.linalg.inv(mobility), rel=1e-9)
    wrenches = -(matrices @ motion)
    assert found.forces[:, 0] == pytest.approx(wrenches[:, 1] + wrenches[:, 7])
    assert found.forces[:, 2] == pytest.approx(-wrenches[:, 4] - wrenches[:, 10])
    velocity, rate = found.sinking(-0.3, 0.2)
    assert found.resistances[1:, 1:] @ [velocity, rate] == pytest.approx([-0.3, 0.2])


def test_contact_line_is_the_straight_side_or_the_widest_place() -> None:
    capsule = body_outline("capsule", 18.0, 35.0, 0.0, "hemisphere", "flat")
    assert contact_line(capsule) == pytest.approx((-17.5, 8.5))
    filleted = body_outline("cylinder", 18.0, 35.0, 2.0, "fillet", "fillet")
    assert contact_line(filleted) == pytest.approx((-15.5, 15.5))
    assert contact_line(body_outline("spheroid", 18.0, 35.0, 0.0, None, None)) == pytest.approx((0.0, 0.0), abs=1e-6)


def test_thin_film_is_the_limit_of_a_cylinder_beside_a_plane() -> None:
    """4 pi mu L/(xi - tanh xi), cosh xi = 1 + h/a (Jeffrey and Onishi), as h/a -> 0 and R -> infinity."""
    a, h = 9e-3, 1e-7
    xi = np.arccosh(1 + h / a)
    exact = 4 * np.pi * 3.5 * 0.026 / (xi - np.tanh(xi))
    assert lubrication_resistance(3.5, 0.026, a, np.inf, h) == pytest.approx(exact, rel=1e-4)


def test_body_is_pushed_the_way_that_its_lowest_line_moves() -> None:
    answer = settled()
    body = answer.prediction.body_rotation_rate
    assert np.sign(answer.sideways_force) == np.sign(body) == -1  # the tail is right-handed
    assert answer.azimuth == pytest.approx(np.arcsin(answer.sideways_force / answer.weight))
    assert answer.descent.drained
    assert answer.rests == "level"


def test_opposite_tail_rate_pushes_to_the_opposite_side() -> None:
    forward, back = settled(), settled(tail_rate="-1.2 Hz")
    assert back.film.forces == pytest.approx(-forward.film.forces, rel=1e-9)
    assert back.azimuth == pytest.approx(-forward.azimuth)
    assert back.film.resistances == pytest.approx(forward.film.resistances)


def test_mirrored_tail_pushes_to_the_opposite_side() -> None:
    right, left = settled(), settled(tail_rate="-1.2 Hz", **{"tail.handedness": "left"})
    assert left.prediction.forward_velocity == pytest.approx(right.prediction.forward_velocity, rel=1e-4)
    assert left.sideways_force == pytest.approx(-right.sideways_force, rel=1e-3)
    assert left.film.pitching_torque == pytest.approx(right.film.pitching_torque, abs=1e-6)


def test_forces_are_proportional_to_viscosity_and_rate_and_times_to_viscosity() -> None:
    reference = settled()
    thin, fast = settled(**{"fluid.viscosity": "0.35 Pa s"}), settled(tail_rate="2.4 Hz")
    assert thin.sideways_force == pytest.approx(0.1 * reference.sideways_force, rel=1e-9)
    assert fast.sideways_force == pytest.approx(2 * reference.sideways_force, rel=1e-9)
    slow = settled(tail_rate="0.12 Hz")  # the same force as in the thin fluid at the full rate
    assert 10 * thin.drainage_time == pytest.approx(slow.drainage_time, rel=1e-6)


def test_nothing_pushes_sideways_on_the_axis() -> None:
    answer = settled(eccentricity=0.0)
    assert abs(answer.sideways_force) < 1e-6 * answer.weight
    assert np.isnan(settling_time(answer.film, answer.weight))
    assert answer.film.sideways_resistance == pytest.approx(answer.film.normal_resistance, rel=0.02)


def test_force_beyond_the_weight_is_told() -> None:
    answer = settled(tail_rate="-300 Hz")
    assert np.isnan(answer.azimuth)
    assert answer.rests == "goes around"
    assert any("goes around the tube" in warning for warning in answer.warnings)
    content = answer.to_dict()
    assert content["azimuth"]["value"] is None
    assert content["orbit_period"]["value"] > 0
    assert not answer.descent.drained
    assert any("does not drain" in warning for warning in answer.warnings)


def test_weight_beyond_the_contact_line_tips_the_robot_onto_its_tail() -> None:
    answer = settled()
    rear, _ = answer.contact
    tipped = replace(answer, weight=1e-3 * answer.weight)  # the tail's own lift is then what turns it
    assert tipped.centre_of_load != pytest.approx(answer.centre_of_load)
    heavy_tail = settled(**{"body.shape": "sphere", "body.length": "18 mm", "body.front": None, "body.rear": None})
    assert heavy_tail.contact == pytest.approx((0.0, 0.0), abs=1e-8)
    assert heavy_tail.rests == "tail down"
    assert 0.01 < heavy_tail.resting_pitch < 0.3
    assert rear < answer.centre_of_load < 0


def test_centre_of_weight_balances_weight_and_buoyancy() -> None:
    answer = settled()
    derived = {name: item.value for name, item in answer.robot.derived().items()}
    g = 9.80665
    buoyancy = answer.robot.fluid.density * derived["displaced_volume"] * g
    moment = derived["mass"] * g * derived["centre_of_mass"] - buoyancy * derived["centre_of_buoyancy"]
    assert answer.centre_of_weight == pytest.approx(moment / (derived["mass"] * g - buoyancy))


@pytest.mark.parametrize(
    ("overrides", "options", "words"),
    [
        ({"body.mass": None}, {}, "no known weight; allowed: body.mass and tail.density"),
        ({"fluid.density": "2000 kg/m^3"}, {}, "floats: its submerged weight is -"),
        ({"channel": "none"}, {}, "channel"),
        ({}, {"placement": {"pitch": "2 deg"}}, "placement.pitch = 2 deg; allowed: 0 deg"),
        ({}, {"placement": {"flow": "2 mm/s"}}, "placement.flow = 2 mm/s; allowed: none"),
        ({}, {"placement": {"gap": "15 mm"}}, "placement.gap"),
        ({}, {"drain": ("1 mm", "2 mm")}, "drain = 1 mm to 2 mm; allowed"),
        ({}, {"drain": ("12 mm", "2 mm")}, "less than 11 mm"),
        ({}, {"drain": ("1", "2 mm")}, 'drain = "1" has no unit'),
        ({}, {"drain": ("1 mm", "1 nm")}, "placement.gap = 1e-06 mm; allowed"),
        ({}, {"gaps": 1}, "gaps = 1; allowed: 2 to 32"),
        ({}, {"tail_rate": "0 Hz"}, "a tail at rest"),
    ],
)
def test_bad_input_is_one_sentence(overrides: dict[str, Any], options: dict[str, Any], words: str) -> None:
    with pytest.raises(sp.InputError) as refused:
        sp.settle(sp.load(WIDE, **overrides), **{**QUICK, "tail_rate": "1.2 Hz", **options})
    assert words in str(refused.value)
    assert "\n" not in str(refused.value)
