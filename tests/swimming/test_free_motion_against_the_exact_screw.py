"""A free robot in unbounded fluid moves on a screw: seen from the tail its twist is constant."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import spirillum as sp
from spirillum.dynamics.free_robot import TwoLinks, two_links
from spirillum.dynamics.integration import Reach, integrate
from spirillum.dynamics.timing import Switch
from spirillum.fluid.registry import find_swimmer_model
from spirillum.kernels import core
from spirillum.swimming.motions import LINKS

NOWHERE = Reach(nose=0.0, tip=0.0, channel=np.inf, middle=0.0, charge=np.inf)


def robot(**overrides: Any) -> sp.Robot:
    return sp.load("biorob2012-wide", channel="none", **{"friction.effective": "1.1e-5 N m s/rad", **overrides})


def links_of(built: sp.Robot, model: str = "rft") -> TwoLinks:
    return two_links(sp.predict(built, model=model, friction="rotor", calibrated=False), None, weight=False)


@pytest.mark.parametrize("model", ["rft", "slender"])
def test_hundred_turns_end_where_the_screw_ends(model: str) -> None:
    built = robot()
    run = sp.simulate(
        built, model=model, weight=False, calibrated=False, timing={"turns": 100.0, "samples_per_turn": 40}
    )
    steady = sp.predict(built, model=model, motion="free", calibrated=False)
    settled = run.sel(time=slice(0.2, None))
    time, path = settled["time"].values, settled["position"].values
    # The tail comes back to its attitude after every turn about the screw's axis.
    spin = settled["angular_velocity"].values + settled["motor_rotation_rate"].values[:, None] * axis_of(settled)
    direction = spin / np.linalg.norm(spin, axis=1, keepdims=True)
    np.testing.assert_allclose(direction, np.broadcast_to(direction[0], direction.shape), atol=1e-6)
    advance = (path - path[0]) @ direction[0]
    np.testing.assert_allclose(advance[-1] / (time[-1] - time[0]), steady.forward_velocity, rtol=1e-6)
    axis = axis_of(settled)
    np.testing.assert_allclose(axis @ direction[0], np.cos(steady.wobble_angle), rtol=1e-8)
    across = path - np.outer(advance, direction[0])
    radius = np.linalg.norm(across - 0.5 * (across.max(axis=0) + across.min(axis=0)), axis=1)
    np.testing.assert_allclose(radius, steady.path_radius, rtol=2e-3)  # 40 samples a turn see the extremes so well


def axis_of(run: Any) -> np.ndarray:
    w, i, j, k = run["attitude"].values.T
    return np.stack([1 - 2 * (j * j + k * k), 2 * (i * j + k * w), 2 * (i * k - j * w)], axis=1)


def test_steady_rates_balance_all_forces_and_lateral_torques() -> None:
    built = robot()
    batch = sp.RobotBatch.of(built)
    r = find_swimmer_model("slender").resistance(batch, np.zeros(1))[0]
    found = sp.predict(built, model="slender", motion="free", calibrated=False)
    joint = np.zeros(7)
    joint[6] = found.drive_torque
    rates = np.linalg.solve(LINKS.T @ r @ LINKS, joint)
    assert found.body_rotation_rate == pytest.approx(rates[3], rel=1e-9)
    assert found.motor_rotation_rate == pytest.approx(rates[6], rel=1e-9)
    spin = np.array([rates[3] + rates[6], rates[4], rates[5]])
    assert found.forward_velocity == pytest.approx(rates[:3] @ spin / np.linalg.norm(spin), rel=1e-9)


def test_lateral_freedom_costs_a_little_speed() -> None:
    """Held lateral motion needs forces; released it can only dissipate less for the same rates."""
    held, free = (
        sp.swim(sp.RobotBatch.of(robot()), "slender", tail_rate=np.array([7.0]), motion=motion, calibrated=False)
        for motion in ("held", "free")
    )
    assert free.dissipated_power[0] < held.dissipated_power[0]
    assert 0.9 < free.forward_velocity[0] / held.forward_velocity[0] < 1.0


def test_reversed_tail_retraces_the_path() -> None:
    links = links_of(robot())
    drive = links.drive.copy()
    drive[core.DRIVE_KIND], drive[core.DRIVE_GIVEN] = core.RATE, 8.0
    there = replace(links, drive=drive)
    drive = drive.copy()
    drive[core.DRIVE_GIVEN] = -8.0
    back = replace(links, drive=drive)
    start = np.zeros(core.STATE_SIZE)
    start[core.STATE_ATTITUDE : core.STATE_ATTITUDE + 4] = (0.8, 0.3, -0.1, np.sqrt(1 - 0.74))
    time = np.linspace(0.0, 40.0, 801)
    forward = integrate(there, start, time, [Switch(0.0, 1.0)], NOWHERE)
    turned = forward.states[-1].copy()
    backward = integrate(back, turned, time, [Switch(0.0, 1.0)], NOWHERE)
    np.testing.assert_allclose(backward.states[::-1, :3], forward.states[:, :3], atol=1e-9)
    np.testing.assert_allclose(backward.states[::-1, 3:9], forward.states[:, 3:9], atol=1e-7)


def test_unbounded_fluid_has_no_direction() -> None:
    """The same run from another attitude is the same run, turned."""
    from scipy.spatial.transform import Rotation

    links = links_of(robot())
    time = np.linspace(0.0, 3.0, 61)
    level, turned = np.zeros(core.STATE_SIZE), np.zeros(core.STATE_SIZE)
    attitude = Rotation.from_euler("xyz", [0.4, -1.1, 2.0])
    level[3] = 1.0
    turned[3:7] = attitude.as_quat(scalar_first=True)
    paths = [integrate(links, start, time, [Switch(0.0, 1.0)], NOWHERE).states[:, :3] for start in (level, turned)]
    np.testing.assert_allclose(paths[1], attitude.apply(paths[0]), atol=1e-10)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: sp.predict("biorob2012-wide", motion="free", model="sbt"), "model 'sbt'"),
        (lambda: sp.predict("magnetic-helix", model="tube", motion="free"), "channel"),
        (lambda: sp.predict("biorob2012-wide", model="rft", motion="loose"), "motion = 'loose'"),
        (lambda: sp.predict("magnetic-helix", model="rft", motion="free"), "magnetic"),
    ],
)
def test_what_cannot_be_free_is_refused(call: Any, words: str) -> None:
    with pytest.raises(sp.InputError, match="allowed") as caught:
        call()
    assert words in str(caught.value)
