"""A moment in a rotating field: phase lag, step-out, slip, tumbling and wobbling."""

from dataclasses import replace

import numpy as np
import pytest

import spirillum as sp
from spirillum.dynamics.free_robot import TwoLinks
from spirillum.dynamics.integration import Reach, integrate
from spirillum.dynamics.rotating_field import _settled
from spirillum.dynamics.timing import Switch
from spirillum.kernels import core

NOWHERE = Reach(nose=0.0, tip=0.0, channel=np.inf, middle=0.0, charge=np.inf)
MOMENT, FIELD = 1.0, 2.0


def rod(angle: float, along: float = 1.0, across: float = 3.0) -> TwoLinks:
    """A made-up body of revolution that feels nothing but its own rotation; SI."""
    drive = np.zeros(core.DRIVE_SIZE)
    drive[[core.DRIVE_KIND, core.DRIVE_FIXED, core.DRIVE_DUTY]] = core.MAGNETIC, 1.0, 1.0
    drive[core.DRIVE_MOMENT : core.DRIVE_FIELD] = MOMENT * np.cos(angle), 0.0, MOMENT * np.sin(angle)
    drive[core.DRIVE_FIELD] = FIELD
    drag = np.diag([1.0, 1.0, 1.0, along, across, across, 1.0])
    return TwoLinks(
        friction=np.zeros((7, 7)),
        weight=np.zeros(8),
        drive=drive,
        drag=drag,
        wall=np.array([np.inf, 1e-9, np.inf, 1.0]),
        spots=np.zeros((0, 6)),
        length=1.0,
        torque=MOMENT * FIELD,
        turn=np.pi * along,
    )


def run_at(links: TwoLinks, rate: float, turns: float) -> np.ndarray:
    """Angle of the moment behind the field about x."""
    drive = links.drive.copy()
    drive[core.DRIVE_FIELD_RATE] = rate
    here = replace(links, drive=drive)
    start = np.zeros(core.STATE_SIZE)
    start[core.STATE_ATTITUDE] = 1.0
    time = np.linspace(0.0, turns * 2 * np.pi / rate, int(20 * turns))
    run = integrate(here, start, time, [Switch(0.0, 1.0)], NOWHERE)
    return np.asarray(rate * run.time - run.states[:, core.STATE_ROLL])


@pytest.mark.parametrize(
    ("off", "turns"), [(1e-4, 150.0), pytest.param(1e-6, 1200.0, marks=pytest.mark.slow)], ids=["near", "nearer"]
)
def test_step_out_is_where_the_closed_form_says(off: float, turns: float) -> None:
    """Just below it the lag stays below 90 degrees, just above it grows without end."""
    links, step_out = rod(0.5 * np.pi), MOMENT * FIELD / 1.0
    below, above = (run_at(links, (1.0 + share) * step_out, turns) for share in (-off, off))
    assert below.max() < 0.5 * np.pi
    assert below[-1] == pytest.approx(np.arcsin(1.0 - off), abs=1e-4)
    assert above[-1] > np.pi


@pytest.mark.parametrize("share", [1.05, 1.5, 4.0])
def test_slip_beyond_step_out_has_adlers_mean(share: float) -> None:
    links, step_out = rod(0.5 * np.pi), MOMENT * FIELD
    rate = share * step_out
    lag = run_at(links, rate, 400.0)
    # Between two slips the lag grows by 2 pi: the mean over whole ones.
    slips = int((lag[-1] - lag[len(lag) // 2]) // (2 * np.pi))
    time = np.linspace(0.0, 400.0 * 2 * np.pi / rate, len(lag))
    first = np.interp(lag[len(lag) // 2], lag, time)
    last = np.interp(lag[len(lag) // 2] + 2 * np.pi * slips, lag, time)
    assert 2 * np.pi * slips / (last - first) == pytest.approx(np.sqrt(rate**2 - step_out**2), rel=1e-3)


@pytest.mark.parametrize("angle", [50.0, *(pytest.param(angle, marks=pytest.mark.slow) for angle in (70.0, 85.0))])
def test_tumbling_wobbling_and_step_out_of_a_tilted_moment(angle: float) -> None:
    """Morozov and Leshansky, Nanoscale 6:1580 (2014): sin(wobble) = w_0 cos(angle)/w above w_0 cos(angle)."""
    tilt, along, across = np.radians(angle), 1.0, 3.0
    links = rod(tilt, along, across)
    slow = MOMENT * FIELD / across
    tumbles = slow * np.cos(tilt)
    step_out = slow * np.hypot(np.cos(tilt), across / along * np.sin(tilt))
    attitude = np.array([np.cos(0.05), 0.0, 0.0, np.sin(0.05)])
    for rate in (0.7 * tumbles, 1.3 * tumbles, 2.0 * tumbles, 0.9 * step_out):
        found, still = _settled(links, rate, attitude, 60.0)
        assert still
        expected = np.arcsin(min(1.0, tumbles / rate))
        assert found.wobble_angle == pytest.approx(expected, rel=1e-4)
        assert found.tail_rotation_rate == pytest.approx(rate, rel=1e-6)
    assert not _settled(links, 1.03 * step_out, attitude, 60.0)[0].follows


def test_held_robot_follows_until_its_load_is_too_large() -> None:
    torque = sp.load("magnetic-helix", **{"drive.kind": "rate", "drive.rate": "1 Hz", "magnetic": None})
    load = sp.predict(torque, model="rft").drive_torque / (2 * np.pi)
    step_out = 3e-3 * 1e-3 / load
    for share in (0.3, 0.999):
        found = sp.predict(
            sp.load("magnetic-helix", **{"magnetic.rotation_rate": f"{share * step_out} rad/s"}), model="rft"
        )
        assert found.step_out_rate == pytest.approx(step_out, rel=1e-9)
        assert found.phase_lag == pytest.approx(np.arcsin(share), rel=1e-6)
        assert found.tail_rotation_rate == pytest.approx(share * step_out, rel=1e-12)
    beyond = sp.predict(sp.load("magnetic-helix", **{"magnetic.rotation_rate": f"{-2 * step_out} rad/s"}), model="rft")
    assert beyond.tail_rotation_rate == pytest.approx(-(2 - np.sqrt(3)) * step_out, rel=1e-9)
    assert np.isnan(beyond.phase_lag)
    assert "step-out" in " ".join(beyond.warnings)


def test_energy_of_a_magnetic_run_is_balanced() -> None:
    run = sp.simulate(
        sp.load("magnetic-helix", **{"magnetic.rotation_rate": "3 Hz"}), model="rft", timing={"turns": 20.0}
    )
    spent = run["dissipated_energy"] + run["potential_energy"] - run["potential_energy"][0]
    scale = float(run["drive_energy"][-1])
    np.testing.assert_allclose(run["drive_energy"] / scale, spent / scale, atol=1e-7)
    assert float(run["phase_lag"][-1]) > 4 * np.pi  # beyond step-out it slips


def test_answer_of_a_sweep_does_not_hang_on_its_turns_or_rates() -> None:
    tilted = sp.load("magnetic-helix", **{"magnetic.moment_angle": "75 deg"})
    alone = sp.magnetic_sweep(tilted, ["1 Hz"], turns=80.0)
    among = sp.magnetic_sweep(tilted, ["0.4 Hz", "0.7 Hz", "1 Hz"], turns=20.0)
    for name in ("forward_velocity", "wobble_angle", "least_wobble_angle", "largest_wobble_angle", "phase_lag"):
        np.testing.assert_allclose(among[name][-1], alone[name][0], rtol=0.01, atol=2e-3)


def test_slipping_robot_dissipates_what_the_field_gives() -> None:
    """Mean of rate^2 is the field's rate times the mean rate: the mean of d(lag)/dt sin(lag) over a slip is zero."""
    robot = sp.load("magnetic-helix", **{"magnetic.rotation_rate": "3 Hz"})
    held = sp.predict(robot, model="rft")
    assert held.shaft_power == pytest.approx(held.drive_torque * 3 * 2 * np.pi)
    assert held.shaft_power == pytest.approx(held.dissipated_power)
    lag = np.linspace(0.0, 2 * np.pi, 200_001)
    rate, step_out = 6 * np.pi, held.step_out_rate
    dwell = 1.0 / (rate - step_out * np.sin(lag))
    load = held.drive_torque / held.tail_rotation_rate
    mean_square = np.trapezoid((step_out * np.sin(lag)) ** 2 * dwell, lag) / np.trapezoid(dwell, lag)
    assert held.shaft_power == pytest.approx(load * mean_square, rel=1e-8)


def test_sweep_finds_step_out_and_swims_like_the_held_robot_below() -> None:
    sweep = sp.magnetic_sweep("magnetic-helix", ["0.5 Hz", "1.5 Hz", "1.7 Hz", "3 Hz"], turns=30.0)
    follows = np.isfinite(sweep["phase_lag"].values)
    assert sweep["settled"][:3].values.tolist() == [1.0, 1.0, 1.0]
    assert follows.tolist() == [True, True, True, False]
    np.testing.assert_allclose(sweep["tail_rotation_rate"][:3], sweep["field_rate"][:3], rtol=1e-4)
    np.testing.assert_allclose(sweep["forward_velocity"][:3], sweep["held_forward_velocity"][:3], rtol=0.02)
    told = sp.predict("magnetic-helix").step_out_rate
    assert float(sweep["step_out_rate"]) == pytest.approx(told, rel=1e-9)
    back = sp.magnetic_sweep("magnetic-helix", ["-0.5 Hz", "-1.5 Hz"], turns=30.0)
    np.testing.assert_allclose(back["forward_velocity"], -sweep["forward_velocity"][:2], rtol=0.02)


def test_a_sweep_says_that_walls_are_left_out() -> None:
    channel = {"diameter": "20 mm", "length": "200 mm"}
    for robot, said in ((sp.load("magnetic-helix", channel=channel), True), (sp.load("magnetic-helix"), False)):
        sweep = sp.magnetic_sweep(robot, ["0.5 Hz"], turns=4.0, model="rft")
        assert ("wall effects are not modelled by 'rft'" in sweep.attrs["warnings"]) is said


@pytest.mark.parametrize(
    ("rates", "options", "words"),
    [
        (["2 Hz", "1 Hz"], {}, "does not increase"),
        (["0 Hz", "1 Hz"], {}, "does not increase"),
        (["-1 Hz", "2 Hz"], {}, "does not increase"),
        (["1 m"], {}, "rates"),
        ([], {}, "rates has 0 values"),
        (None, {"turns": 1.0}, "turns = 1.0"),
        (None, {"model": "sbt"}, "model 'sbt'"),
    ],
)
def test_wrong_sweeps_are_refused(rates: object, options: dict[str, object], words: str) -> None:
    with pytest.raises(sp.InputError, match="allowed") as caught:
        sp.magnetic_sweep("magnetic-helix", rates, **options)
    assert words in str(caught.value)
    along = sp.load("magnetic-helix", **{"magnetic.moment_angle": "0 deg"})
    with pytest.raises(sp.InputError, match=r"magnetic\.moment_angle = 0 deg"):
        sp.magnetic_sweep(along)
    with pytest.raises(sp.InputError, match="magnetic"):
        sp.magnetic_sweep("biorob2012-wide")


def test_ecoli_swims_as_measured() -> None:
    """Darnton et al. (2007): bundle 131 +- 31 Hz, body 23 +- 8 Hz, 29 +- 6 um/s, of which models give two thirds."""
    found = sp.predict("ecoli", model="rft")
    assert -found.tail_rotation_rate / (2 * np.pi) == pytest.approx(131, abs=31)
    assert found.body_rotation_rate / (2 * np.pi) == pytest.approx(23, abs=8)
    assert 15e-6 < found.forward_velocity < 35e-6


@pytest.mark.parametrize("model", ["rft", "slender"])
def test_ecolis_bundle_is_of_the_size_measured(model: str) -> None:
    """Chattopadhyay et al. (2006): A = 1.48e-8 N s/m, B = 7.9e-16 N s, D = 7e-22 N m s, of other cells."""
    b = sp.resistance("ecoli", part="tail", model=model).matrix
    for found, measured in ((b[0, 0], 1.48e-8), (abs(b[0, 3]), 7.9e-16), (b[3, 3], 7e-22)):
        assert 0.5 < found / measured < 2.0


@pytest.mark.parametrize("axis", ["z", [0.0, 0.0, 1.0], "10 deg"])
def test_a_field_about_another_axis_is_refused(axis: object) -> None:
    with pytest.raises(sp.InputError, match=r"magnetic\.axis = .* is not allowed; allowed: 'x'"):
        sp.load("magnetic-helix", **{"magnetic.axis": axis})
    assert sp.load("magnetic-helix", **{"magnetic.axis": "x"}) == sp.load("magnetic-helix")
