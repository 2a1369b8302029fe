"""The engine of motion in a tube on a stand-in table: orbits, films, contact, dry friction, energy, events, restart."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any
from unittest import mock

import numpy as np
import pytest

import spirillum as sp
from spirillum.dynamics import tube_simulation
from spirillum.dynamics.integration import Reach, integrate
from spirillum.dynamics.release import InTube, Release, read_flow, released_state, state_at_release
from spirillum.dynamics.rotating_field import Field
from spirillum.dynamics.run_summary import run_answer
from spirillum.dynamics.timing import Timing
from spirillum.dynamics.tube_robot import Surroundings, TubeRobot, tube_robot
from spirillum.dynamics.tube_run import tube_run
from spirillum.dynamics.tube_simulation import run_in_tube
from spirillum.errors import InputError
from spirillum.fluid.tube.table import TubeTable
from spirillum.kernels import core
from spirillum.robot.mesh import centreline_of
from spirillum.robot.placement import Placement
from spirillum.swimming.motions import LINKS
from spirillum.swimming.prediction import Prediction, predict_steady
from spirillum.swimming.steady import calibrated_resistance

LENGTH, MIDDLE = 0.026, -0.0045  # of the straight side of the paper's body
ROUGH = Surroundings(roughness=5e-5)
Made = tuple[Prediction, TubeRobot, Callable[..., Any]]


def at(azimuth: float = 0.0, **pose: float) -> tuple[Placement, float]:
    """Where a robot is released."""
    return Placement.of(pose), azimuth


@pytest.fixture(scope="module")
def made(stand_in: Any) -> Callable[..., Made]:
    """The paper's robot in its tube, and its runs from a start."""

    def make(
        around: Surroundings = ROUGH,
        overrides: dict[str, Any] | None = None,
        *,
        rest: float = 1.0,
        weight: bool = True,
        friction: str | None = None,
        model: str = "slender",
        **more: float,
    ) -> Made:
        robot = sp.load("biorob2012-wide", **(overrides or {}))
        steady = predict_steady(robot, model=model, friction=friction)
        matrix = np.zeros((8, 8))
        twelve = calibrated_resistance(steady.batch, steady.model, calibrated=False)[0]
        matrix[:7, :7] = rest * LINKS.T @ twelve @ LINKS / robot.fluid.viscosity
        matrix[0, 7] = matrix[7, 0] = 0.05
        matrix[7, 7] = 5.0
        table = stand_in.table(matrix, 0.02, 0.009, LENGTH, MIDDLE, **more)
        turn = 2.0 * np.pi / abs(steady.tail_rotation_rate)
        links = tube_robot(steady, table, around, turn=turn, weight=weight)

        def run(start: Any, duration: float, *, on: Any = None, samples: int = 20, **options: Any) -> Any:
            timing = Timing.of({"duration": duration, "on": on, "samples_per_turn": samples})
            begun = released_state(robot, links, *start) if isinstance(start, tuple) else start
            return tube_run(steady, links, begun, timing.timetable(turn, 1.0), **options)

        return steady, links, run

    return make


def events(run: Any) -> dict[str, float]:
    return {event["what"]: event["time"] for event in json.loads(run.attrs["events"])}


def left_of_energy(run: Any) -> float:
    """Largest error of the energy balance over the energy that was spent."""
    if "electrical_energy" in run:
        chemical = run["resistive_energy"] + run["magnetic_energy"] + run["conversion_energy"]
        given = run["electrical_energy"] - chemical
    else:
        given = run["drive_energy"]
    spent = run["friction_energy"] + run["dissipated_energy"] + run["contact_energy"]
    stored = run["potential_energy"] - run["potential_energy"][0]
    left = given + run["flow_energy"] - spent - stored
    return float(np.abs(left - left[0]).max() / max(np.abs(spent).max(), np.abs(given).max()))


def rolling(rate: float) -> dict[str, Any]:
    """A robot whose joint is fixed and that is turned from outside at a rate."""
    return {"drive": {"kind": "rate", "joint": "fixed", "rate": f"{rate} rad/s"}}


@pytest.mark.parametrize("gap", [2e-3, 2e-4])
@pytest.mark.parametrize("rate", [3.0, -3.0])
def test_long_capsule_orbits_at_its_two_dimensional_law(made: Any, gap: float, rate: float) -> None:
    """Free of force and turning at Omega: around the tube at Omega lambda^2/(1 + lambda^2), at any offset."""
    _, _, run = made(overrides=rolling(rate), rest=1e-9, weight=False)
    found = run(at(gap=gap), 2.0)
    law = rate * 0.45**2 / (1.0 + 0.45**2)
    # The straight side does not lie about mid-length; the law is that of its middle, which is at the same offset.
    assert float(found["azimuth"][-1]) == pytest.approx(2.0 * law, rel=1e-6)
    assert float(found["wall_gap"][-1]) == pytest.approx(gap, rel=1e-6)


def test_driven_around_and_free_of_torque_it_turns_as_if_glued(made: Any, stand_in: Any) -> None:
    """From the matrix itself: Omega/v = 1/(R - a) at contact, where k e is all that its film takes."""
    _, links, _ = made(rest=1e-12, weight=False)
    out = stand_in.level_resistance(links.table, 0.011 - 1e-7)
    assert np.abs(out - out.T).max() < 1e-12 * out.max()
    turned = -out[3, 1] / out[3, 3]
    assert turned == pytest.approx(1.0 / 0.011, rel=1e-5)


def test_reversed_rotation_mirrors_the_azimuth(made: Any) -> None:
    """A body of revolution: y -> -y. The tail's phase phi mirrors to pi - phi, its hand too."""
    runs = []
    for hand, rate in (("right", 2.0), ("left", -2.0)):
        overrides = {"tail.handedness": hand, "drive": {"kind": "rate", "joint": "revolute", "rate": f"{rate} rad/s"}}
        _, _, run = made(overrides=overrides)
        sign = 1.0 if hand == "right" else -1.0
        runs.append(run(at(gap=4e-4, pitch=0.01, yaw=0.02 * sign, azimuth=0.3 * sign), 6.0))
    there, back = runs
    np.testing.assert_allclose(there["azimuth"], -back["azimuth"], atol=1e-8)
    np.testing.assert_allclose(there["wall_gap"], back["wall_gap"], rtol=1e-6)
    np.testing.assert_allclose(there["position"][:, 0], back["position"][:, 0], atol=1e-9)
    np.testing.assert_allclose(there["body_angle"], -back["body_angle"], atol=1e-7)


def test_film_and_dry_contact_carry_opposite_ways(made: Any) -> None:
    """Anticlockwise about +x at the bottom: the film carries to +y, dry contact rolls to -y."""
    thin = {**rolling(2.0), "fluid.viscosity": "0.1 Pa s"}
    _, _, on_film = made(Surroundings(roughness=1e-6, coefficient=0.3), rolling(2.0))
    _, _, on_tips = made(Surroundings(roughness=4e-4, coefficient=0.3), thin)
    film, tips = on_film(at(gap=3e-4), 1.0), on_tips(at(gap=3e-4), 1.0)
    assert float(film["azimuth"][-1]) > 0.01
    assert float(film["contact_force"].max()) == 0.0
    assert float(tips["azimuth"][-1]) < 0.0
    assert float(tips["contact_friction"].max()) > 1e-3


def test_level_body_drains_its_film_as_the_inverse_square_of_time(made: Any) -> None:
    """Weight W on R_n = c h^(-3/2): h^(-1/2) grows by W/(2 c) a second."""
    overrides = {"drive.duty": 0.0001, "tail.density": "985 kg/m^3"}
    steady, links, _ = made(Surroundings(roughness=1e-9), overrides, rest=1e-9)
    centred = np.zeros(8)  # weight in the middle of the straight side, so that it stays level
    centred[0] = 0.02
    centred[2] = 0.02 * MIDDLE
    links = type(links)(**{**vars(links), "weight": centred})
    time = np.linspace(0.0, 400.0, 21)
    from spirillum.dynamics.timing import Switch

    start = state_at_release(steady.robot, links, *at(gap=2e-4))
    found = integrate(links, start, time, [Switch(0.0, 0.0)], Reach(0.0, 0.0, np.inf, 0.0, np.inf))
    across = 0.009 * 0.02 / 0.011
    c = 3.5 * 3.0 * np.sqrt(2.0) * np.pi * across**1.5 * LENGTH
    law = (2e-4**-0.5 + 0.5 * 0.02 / c * time) ** -2
    np.testing.assert_allclose(found.observed[:, core.SEEN_FILM], law, rtol=2e-6)


def test_robot_at_rest_lies_on_its_asperities_with_its_weight(made: Any) -> None:
    """Off, in a thin fluid, for long: the load is the weight, and nothing moves."""
    _, links, run = made(Surroundings(roughness=1e-4), {"fluid.viscosity": "0.01 Pa s", "model.beyond_stokes": True})
    found = run(at(gap=2e-4), 60.0, on=[(1e3, 2e3)], samples=1)
    heavy = float(links.weight[:2].sum())
    assert float(found["contact_force"][-1]) == pytest.approx(heavy * np.cos(float(found["azimuth"][-1])), rel=1e-4)
    assert float(found["wall_gap"][-1]) > 0.3e-4
    assert abs(float(found["forward_velocity"][-1])) < 1e-9
    assert found["contact_force"].values[0] == 0.0
    assert left_of_energy(found) < 1e-6


def test_load_and_energy_of_asperities() -> None:
    """W at half their height, none beyond, without bound below; the energy is its integral."""
    height, load = 3e-6, 0.02
    assert core.asperity_load(0.5 * height, height, load) == pytest.approx(load)
    assert core.asperity_load(height, height, load) == 0.0
    gaps = np.linspace(0.02, 1.0, 4001) * height
    loads = np.array([core.asperity_load(gap, height, load) for gap in gaps])
    assert np.all(np.diff(loads) <= 0)
    gained = np.array([core.asperity_energy(gap, height, load) for gap in gaps])
    slopes = -np.gradient(gained, gaps, edge_order=2)
    np.testing.assert_allclose(slopes[2000:-5], loads[2000:-5], rtol=2e-3, atol=1e-6 * load)


@pytest.mark.parametrize("coefficient", [0.0, 0.1, 0.3])
@pytest.mark.parametrize("drive", ["motor", "rate", "torque"])
def test_energy_is_balanced_with_contact(made: Any, coefficient: float, drive: str) -> None:
    kinds = {
        "motor": {},
        "rate": {"drive": {"kind": "rate", "joint": "revolute", "rate": "4 rad/s"}},
        "torque": {"drive": {"kind": "torque", "joint": "revolute", "torque": "2e-4 N m"}},
    }
    _, _, run = made(Surroundings(roughness=2e-4, coefficient=coefficient), kinds[drive])
    found = run(at(gap=1.5e-4, pitch=0.005), 8.0)
    assert left_of_energy(found) < 1e-6
    assert float(found["contact_force"].max()) > 0.01
    worked = float(found["contact_energy"][-1])
    assert worked == 0.0 if coefficient == 0 else worked > 0.0
    assert np.all(np.diff(found["contact_energy"]) >= -1e-16)
    assert np.all(found["contact_friction"] <= coefficient * found["contact_force"] * (1 + 1e-12))


def test_energy_is_balanced_in_a_flow_and_with_open_ends(made: Any) -> None:
    flow = np.array([[0.0, 0.0], [1.0, 2e-3], [2.5, -1e-3], [4.0, 1e-3]])
    _, _, run = made(Surroundings(roughness=2e-4, ends=core.IMPOSED, flow=flow))
    found = run(at(gap=1.5e-4), 5.0)
    np.testing.assert_allclose(found["mean_flow"], np.interp(found["time"], *flow.T), atol=1e-15)
    assert left_of_energy(found) < 1e-6
    assert abs(float(found["flow_energy"][-1])) > 1e-9
    _, _, run = made(Surroundings(roughness=2e-4, ends=core.OPEN, length=0.37))
    found = run(at(gap=1.5e-4), 3.0)
    assert left_of_energy(found) < 1e-6
    speed = float(found["forward_velocity"][-1])
    assert float(found["mean_flow"][-1]) == pytest.approx(0.05 * speed / (8 * np.pi * 0.37 + 5.0), rel=1e-2)


def test_ends_matter_as_the_condensed_matrix_says(made: Any) -> None:
    """Far longer than all else an open tube is a closed one."""
    speeds = []
    for around in (
        Surroundings(),
        Surroundings(ends=core.OPEN, length=1e9),
        Surroundings(ends=core.OPEN, length=0.0),
    ):
        _, links, _ = made(around)
        state = state_at_release(made()[0].robot, links, *at(gap=5e-4))
        state[core.STATE_CURRENT] = 0.05
        speeds.append(links.observe_state(state)[0])
    assert speeds[1] == pytest.approx(speeds[0], rel=1e-9)
    assert speeds[2] > speeds[0]


def test_run_in_two_parts_is_the_run(made: Any) -> None:
    """Continued from where it ended, at any moment: to 1e-9 in all that a state holds."""
    _, _, run = made(Surroundings(roughness=1e-4, coefficient=0.2))
    start = at(gap=3e-4, azimuth=0.2, yaw=0.01)
    whole, first = run(start, 9.0, wait=3.0), run(start, 4.321, wait=3.0)
    second = run(first, 9.0)
    assert float(second["time"][0]) > float(first["time"][-1])
    for name in ("position", "attitude", "azimuth", "tail_angle", "body_angle", "tail_phase", "motor_current"):
        np.testing.assert_allclose(second[name][-1], whole[name][-1], atol=1e-9, err_msg=name)
    for name in ("electrical_energy", "contact_energy", "dissipated_energy"):
        np.testing.assert_allclose(second[name][-1], whole[name][-1], rtol=1e-9, err_msg=name)
    again = run(start, 9.0, wait=3.0)
    for name in ("position", "attitude", "contact_force"):
        np.testing.assert_array_equal(again[name], whole[name])
    with pytest.raises(InputError, match="already ends"):
        run(whole, 9.0)


def test_events_happen_at_their_times(made: Any) -> None:
    """The nose at the end of the tube; touching where the gap is the asperities' height; an empty battery."""
    _, links, run = made(Surroundings(roughness=2e-4), {"channel.length": "0.107 m"})
    found = run(at(gap=3e-4), 60.0)
    happened = events(found)
    end = happened["end of the channel"]
    assert float(found["time"][-1]) == end < 60.0
    place = abs(float(found["position"][-1, 0]) - float(found.attrs["channel_middle"]))
    nose = 0.0175 * float(np.cos(found["pitch"][-1]) * np.cos(found["yaw"][-1]))
    assert place + nose == pytest.approx(0.0535, abs=2e-7)
    touch = happened["body rear touches the wall"]
    state = [np.interp(touch, found["time"], found["contact_force"])]
    assert state[0] < 1e-3
    before, after = found["time"] < touch, found["time"] > touch
    assert float(found["contact_force"][before.values].max()) == 0.0
    assert float(found["contact_force"][after.values].min()) > 0.0
    assert links.names[1] == "body rear"

    _, _, run = made(overrides={"battery.capacity": "0.1 mA h"})
    found = run(at(gap=3e-4), 3.0)
    assert 0 < events(found)["battery empty"] < float(found["time"][-1])
    assert float(found["duty"][-1]) == 0.0
    assert float(found["battery_charge_used"][-1]) == pytest.approx(0.36, rel=1e-9)


def test_a_run_beyond_its_table_goes_on(made: Any) -> None:
    """The outer resistance is that of the nearest pose inside."""
    _, _, run = made(largest=0.005)
    found = run(at(gap=1e-3, pitch=0.01), 1.0)
    assert np.max(np.abs(found["wall_pitch"])) > 0.005
    assert np.isfinite(found["forward_velocity"]).all()
    assert float(found["time"][-1]) == 1.0


def test_rates_solve_the_balance(made: Any) -> None:
    """What the solution leaves of the forces, over a run with contact and dry friction, and for steep friction."""
    steady, links, _ = made(Surroundings(roughness=4e-4, coefficient=0.3))
    for gap in (3e-4, 1e-4, 3e-5):
        for current in (0.0, 1e-3, 0.05):
            state = state_at_release(steady.robot, links, *at(gap=gap, pitch=0.002, yaw=0.01))
            state[core.STATE_CURRENT] = current
            assert links.observe_state(state)[core.SEEN_BALANCE] < 1e-12
    rng = np.random.default_rng(3)
    for _ in range(300):
        half = rng.normal(size=(7, 7)) * 10.0 ** rng.uniform(-1, 1, 7)
        a, force = half.T @ half + np.diag(1e-6 + np.sum(half**2, axis=0)), rng.normal(size=7)
        loads, rows = 10.0 ** rng.uniform(-2, 0.5, 4), rng.normal(size=(4, 2, 7))
        q, r = np.zeros(7), np.empty(7)
        assert core.balanced(a, force, loads, rows, 1e-5, q, r) < 1e-10
        sliding = np.einsum("cdi,i->cd", rows, q)
        speed = np.sqrt(np.sum(sliding**2, axis=1) + 1e-5**2)
        left = a @ q + np.einsum("c,cd,cdi->i", loads / speed, sliding, rows) - force
        size, scale = np.sum(left**2 / np.diag(a)), np.sum((np.abs(force) + loads.sum()) ** 2 / np.diag(a))
        assert np.sqrt(size) < 1e-9 * np.sqrt(scale)


def test_gap_of_a_site_closes_as_its_gradient_says(made: Any) -> None:
    """By finite differences of place and attitude; so does the wire's crest, in the tail's phase too."""
    from scipy.spatial.transform import Rotation

    place, attitude = np.array([0.0, 2.1e-3, -8.5e-3]), Rotation.from_euler("xyz", [0.3, 0.1, -0.07])
    _, links, _ = made()

    def state_of(step: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        state = np.zeros(core.STATE_SIZE)
        state[:3] = place + attitude.apply(step[:3])
        turned = attitude * Rotation.from_rotvec(step[3:6])
        state[3:7] = turned.as_quat(scalar_first=True)
        state[7] = 0.7 + step[6]
        return state, np.ascontiguousarray(turned.as_matrix())

    normal, point = np.empty(3), np.empty(3)
    sites = [*links.sites, np.array([0.002, 0.006, 0.0, 0.003, 0.0]), np.array([0.0, 0.009, 0.014, 0.0, 0.0])]

    def gap(step: np.ndarray, j: np.ndarray, site: Any) -> float:
        state, rotation = state_of(step)
        if site is not None:
            return core.ring_gap(state, rotation, 0.02, site, normal, point, j)
        bracket = np.array([0.03, 0.035, 0.045])
        return core.crest(state, rotation, 0.02, links.wire, links.stations, bracket, normal, point, j)

    for site in (*sites, None):
        j = np.empty(7)
        gap(np.zeros(7), j, site)
        for i in range(7):
            step = np.zeros(7)
            step[i] = 1e-6
            found = (gap(step, np.empty(7), site) - gap(-step, np.empty(7), site)) / 2e-6
            assert found == pytest.approx(-j[i], abs=1e-8), (site, i)


def test_gap_of_a_site_is_that_of_its_points(made: Any) -> None:
    """Rings, edges with a fillet, hemispheres and spheroids, tilted and yawed, against all of their points."""
    from scipy.spatial.transform import Rotation

    _, links, _ = made()
    theta, latitude = np.linspace(0.0, 2 * np.pi, 4001), np.linspace(-0.5, 0.5, 401)
    sites = [*links.sites, np.array([0.002, 0.006, 0.0, 0.003, 0.0]), np.array([0.0, 0.009, 0.0175, 0.0, 0.0])]
    normal, point, j = np.empty(3), np.empty(3), np.empty(7)
    for x, ring, half, ball, turning in sites:
        for angles in ((0.4, 0.1, -0.07), (0.0, 0.02, 0.3), (2.0, -0.2, 0.05)):
            turned = Rotation.from_euler("xyz", angles)
            state = np.zeros(core.STATE_SIZE)
            state[:3] = (0.0, 4e-3, -6e-3)
            lat = latitude if half else np.zeros(1)
            across = ring * np.cos(lat)[:, None] * np.stack([np.cos(theta), np.sin(theta)])[:, None, :]
            along = np.broadcast_to((x + half * np.sin(lat))[:, None], across.shape[1:])
            points = state[:3] + turned.apply(np.stack([along, *across], axis=-1).reshape(-1, 3))
            dense = 0.02 - ball - np.hypot(points[:, 1], points[:, 2]).max()
            site = np.array([x, ring, half, ball, turning])
            found = core.ring_gap(state, turned.as_matrix(), 0.02, site, normal, point, j)
            assert found == pytest.approx(dense, abs=3e-8), site
            touching = state[:3] + turned.apply(point)
            assert 0.02 - np.hypot(*touching[1:]) == pytest.approx(found, abs=1e-14)


def test_tail_touches_at_its_crests_and_tip(made: Any) -> None:
    """Nose up until the tip is at the wall: its gap is that of points along the wire."""
    _, links, _ = made()
    robot = made()[0].robot
    for pitch in (0.07, 0.078):
        state = state_at_release(robot, links, *at(gap=3e-4, pitch=pitch))
        smallest = np.inf
        for phase in np.linspace(0.0, 2 * np.pi, 9):
            state[core.STATE_PHASE] = phase
            found = links.gaps(state)[-1]
            xi = np.linspace(0.0, 0.06, 20001)
            r = 0.0025 * (1 - np.exp(-100 * xi / 0.06))
            x = -0.0275 - xi
            angle = 2 * np.pi / 0.025 * x + phase
            side = r * np.cos(angle)
            up = state[2] + x * np.sin(pitch) + r * np.sin(angle) * np.cos(pitch)
            dense = 0.02 - 0.0005 - np.hypot(side, up).max()
            if np.isfinite(found):
                assert found == pytest.approx(dense, abs=1e-9)
            smallest = min(smallest, dense)
        assert smallest < 1.5e-3


def _curve() -> list[list[float]]:
    """A right-handed centre line that widens and bends off the axis, as one that was measured."""
    x = np.linspace(0.0, 60.0, 81)
    r = 1.0 + x / 40.0
    return np.stack([x, r * np.cos(x / 4.0) + 0.2 * np.sin(x / 20.0), r * np.sin(x / 4.0)], axis=1).tolist()  # type: ignore[no-any-return]


TAILS: dict[str, dict[str, Any]] = {
    "starts": {"starts": 3},
    "cone": {"amplitude": {"from": "1 mm", "to": "3 mm"}, "wavelength": {"from": "20 mm", "to": "30 mm"}, "starts": 2},
    "narrowing": {"amplitude": {"from": "3 mm", "to": "1 mm"}},
    "table": {"amplitude": [["0 mm", "1 mm"], ["20 mm", "3 mm"], ["60 mm", "2 mm"]], "handedness": "left"},
    "curve": {"curve": _curve()},
    "smoothed": {"curve": _curve(), "curve_tolerance": "10 um", "starts": 2},
}


@pytest.mark.parametrize("tail", TAILS)
@pytest.mark.parametrize("pitch", [0.02, 0.07])
def test_any_tail_touches_where_its_points_do(made: Any, tail: str, pitch: float) -> None:
    """Its gap is that of dense points of its wires, and closes as its gradient says."""
    steady, links, _ = made(overrides={"tail": TAILS[tail]}, model="rft")  # its geometry alone matters
    dense = [swept.position for swept in [centreline_of(steady.robot, np.linspace(0.0, 1.0, 40001) * 0.06)]]
    points = np.concatenate([dense[0] @ turn.T for turn in steady.robot.tail.form.rotations])
    state = state_at_release(steady.robot, links, *at(gap=3e-4, pitch=pitch))
    found, true = [], []
    for phase in np.linspace(0.0, 2 * np.pi, 7):
        state[core.STATE_PHASE] = phase
        y = points[:, 1] * np.cos(phase) - points[:, 2] * np.sin(phase)
        z = points[:, 1] * np.sin(phase) + points[:, 2] * np.cos(phase)
        up = state[2] + points[:, 0] * np.sin(pitch) + z * np.cos(pitch)
        true.append(0.02 - 0.0005 - np.hypot(y, up).max())
        found.append(links.gaps(state)[-1])
    seen = np.isfinite(found)
    assert np.asarray(found)[seen] == pytest.approx(np.asarray(true)[seen], abs=5e-9)


def near_the_wall(steady: Prediction, links: TubeRobot) -> tuple[Placement, float]:
    """Nose up until the tail's roughness is at the wall."""
    places = (at(gap=3e-4, pitch=pitch) for pitch in np.arange(0.06, 0.12, 1e-4))
    return next(p for p in places if links.gaps(state_at_release(steady.robot, links, *p))[-1] < ROUGH.roughness)


def test_a_tail_along_points_of_a_helix_touches_as_the_helix(made: Any) -> None:
    x = np.linspace(0.0, 60.0, 121)
    k = 2 * np.pi / 25.0
    points = np.stack([x, 2.5 * np.cos(k * x), 2.5 * np.sin(k * x)], axis=1).tolist()
    curve = made(overrides={"tail": {"curve": points}}, model="rft")
    helix = made(overrides={"tail.taper": "none"}, model="rft")
    gaps = []
    for steady, links, _ in (curve, helix):
        own = links.stations[np.argmin(links.stations[:, core.STATION_XI])]
        turn = np.arctan2(own[core.STATION_POINT + 2], own[core.STATION_POINT + 1])
        state = state_at_release(steady.robot, links, *near_the_wall(*curve[:2]))
        row = []
        for phase in np.linspace(0.0, 2 * np.pi, 9):
            state[core.STATE_PHASE] = phase - turn
            row.append(links.gaps(state)[-1])
        gaps.append(row)
    assert np.isfinite(gaps[0]).sum() > 2
    assert gaps[0] == pytest.approx(gaps[1], abs=1e-7)


@pytest.mark.parametrize("tail", ["cone", "curve"])
def test_energy_is_balanced_while_any_tail_touches(made: Any, tail: str) -> None:
    steady, links, run = made(overrides={"tail": TAILS[tail]})
    found = run(near_the_wall(steady, links), 1.0)
    assert float(found.contact_force.max()) > 0.0
    assert float(found.tail_gap.min()) < ROUGH.roughness
    assert left_of_energy(found) < 1e-5


def test_asperities_do_not_vanish_with_the_weight(made: Any) -> None:
    """A robot of nearly no weight stands on them as one of none does, a heavy one by its weight."""
    density = 985.0
    robot = sp.load("biorob2012-wide")
    heavy = made()[1]
    weight = float(heavy.weight[: core.WEIGHT_MOMENT_BODY].sum())
    assert heavy.tube[core.TUBE_LOAD] == pytest.approx(weight, rel=1e-9)
    floating = {"body.mass": f"{robot.body.mass - weight / 9.80665!r} kg", "fluid.density": f"{density} kg/m^3"}
    light, none = made(overrides=floating)[1], made(weight=False)[1]
    assert abs(float(light.weight[: core.WEIGHT_MOMENT_BODY].sum())) < 1e-4 * weight
    assert light.tube[core.TUBE_LOAD] == pytest.approx(none.tube[core.TUBE_LOAD], rel=1e-9)
    assert none.tube[core.TUBE_LOAD] > 0.1 * weight


def test_rates_forget_a_trial_inside_the_wall(made: Any, stand_in: Any) -> None:
    """A step that is tried too far leaves no number behind with which the next one begins."""
    steady, links, _ = made()
    state, data = state_at_release(steady.robot, links, *at(gap=3e-4)), links.data
    before, after, inside = np.empty((3, core.STATE_SIZE))
    stand_in.steps.rates(before, 0.0, state, data, links.table)
    beyond = state.copy()
    beyond[core.STATE_POSITION + 2] = np.nan
    stand_in.steps.rates(inside, 0.0, beyond, data, links.table)
    assert np.isnan(inside).any()
    stand_in.steps.rates(after, 0.0, state, data, links.table)
    np.testing.assert_allclose(after, before, rtol=1e-9, atol=1e-15)


def test_robot_on_the_axis_goes_on_smoothly(made: Any) -> None:
    """Where the azimuth is nothing, path and attitude do not depend on it."""
    _, _, run = made(weight=False)
    found = [run(at(eccentricity=e), 1.0) for e in (0.0, 1e-9)]
    np.testing.assert_allclose(found[0]["position"], found[1]["position"], atol=1e-9)
    assert left_of_energy(found[0]) < 1e-6


def test_interrupted_run_keeps_what_was_done(made: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    _, _, run = made()
    calls = []

    def stop(_what: str, done: int, _total: int) -> None:
        calls.append(done)
        if len(calls) == 4:
            raise KeyboardInterrupt

    whole = run(at(gap=3e-4), 20.0)
    part = run(at(gap=3e-4), 20.0, progress=stop)
    assert "interrupted" in events(part)
    assert 0 < float(part["time"][-1]) < 20.0
    rest = run(part, 20.0)
    np.testing.assert_allclose(rest["position"][-1], whole["position"][-1], atol=1e-9)


def test_start_has_the_gap_pitch_yaw_and_azimuth_asked_for(made: Any) -> None:
    steady, links, run = made()
    found = run(at(gap=4e-4, pitch=-0.02, yaw=0.015, azimuth=0.4), 0.01)
    for name, value in (("wall_gap", 4e-4), ("wall_pitch", -0.02), ("wall_yaw", 0.015), ("azimuth", 0.4)):
        assert float(found[name][0]) == pytest.approx(value, rel=1e-9), name
    with pytest.raises(InputError, match="does not fit"):
        state_at_release(steady.robot, links, *at(gap=0.02))
    with pytest.raises(InputError, match="cut"):
        state_at_release(steady.robot, links, *at(gap=5e-4, pitch=0.2))


def test_what_a_user_asks_for_reaches_the_engine(made: Any, tmp_path: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ends, flow over time, waiting, friction, and the table's error; the flow file is checked."""
    monkeypatch.setattr(tube_simulation, "largest_yaw", lambda *_: 1.0)  # the stand-in holds at any yaw and gap
    monkeypatch.setattr(tube_simulation, "least_checked_gap", lambda _: 0.0)
    steady, links, _ = made()
    table = mock.Mock(
        spec=TubeTable,
        packed=links.table,
        speed_error_at=lambda yaw: 0.02 if yaw else 0.01,
        key="name",
        error_against="solutions",
    )
    file = tmp_path / "flow.csv"
    file.write_text("# pulsating\ntime_s,flow_mm_s\n0,0\n1,2\n2,-1\n")
    asked = InTube.of({"azimuth": "20 deg", "wait": "2 s", "friction_coefficient": 0.2, "flow": file})
    placed = Placement.of({"gap": "0.3 mm", "yaw": "1 deg", "pitch": "-0.5 deg"})
    times = Timing.of({"duration": "2 s"})
    found = run_in_tube(steady, table, times, Release(placed, asked, 1e-4), Field(), None)
    np.testing.assert_allclose(found["mean_flow"], np.interp(found["time"], [0, 1, 2], [0, 2e-3, -1e-3]), atol=1e-15)
    assert found.attrs["ends"] == "imposed flow"
    assert run_answer(found)["in_tube"]["mean_flow"]["value"] == pytest.approx(0.75e-3, rel=1e-3)
    assert "its last row" not in found.attrs["warnings"]
    assert found.attrs["wait"] == 2.0
    assert found.attrs["friction_coefficient"] == 0.2
    assert found.attrs["roughness"] == 1e-4
    assert found.attrs["error_estimate"] == 0.02
    assert float(found["electrical_energy"][0]) == 0.0
    assert "Reynolds" not in found.attrs["warnings"]
    file.write_text("time_s,flow_mm_s\n0,0\n2,-40\n")
    fast = run_in_tube(
        steady, table, Timing.of({"duration": "0.01 s"}), Release(placed, InTube(flow=file)), Field(), None
    )
    assert "Reynolds number (imposed flow, body diameter) = 0.2" in fast.attrs["warnings"]
    assert "begins at" not in fast.attrs["warnings"]
    file.write_text("time_s,flow_mm_s\n1,0\n2,1\n")
    late = run_in_tube(
        steady, table, Timing.of({"duration": "0.01 s"}), Release(placed, InTube(flow=file)), Field(), None
    )
    assert f"{file} begins at 1 s, and the run ends at 0.01 s" in late.attrs["warnings"]
    file.write_text("time_s,flow_mm_s\n0,0\n0.005,1\n")
    early = run_in_tube(
        steady, table, Timing.of({"duration": "0.01 s"}), Release(placed, InTube(flow=file)), Field(), None
    )
    assert f"{file} ends at 0.005 s, and the run at 0.01 s: from then on" in early.attrs["warnings"]
    open_ended = run_in_tube(steady, table, times, Release(placed, InTube()), Field(), None)
    assert "mean_flow" not in run_answer(open_ended)["in_tube"]
    assert open_ended.attrs["ends"] == "open"  # the channel has a length
    for text, words in (
        ("time_s,flow\n0,1\n", "columns"),
        ("time_s,flow_mm_s\n", "no rows"),
        ("time_s,flow_mm_s\n0,x\n", "flow_mm_s = x"),
        ("time_s,flow_mm_s\n1,1\n1,2\n", "does not follow"),
    ):
        file.write_text(text)
        with pytest.raises(InputError, match=words):
            read_flow(file)
