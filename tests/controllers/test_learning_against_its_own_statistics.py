"""The learner on a robot in closed form: intervals hold what they should, and what the data do not tell is not told."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from spirillum.controllers.estimators import Paths, interpolation, points
from spirillum.controllers.lab import Lab
from spirillum.controllers.learning import Learner, Learning, learnt
from spirillum.controllers.loop import run_loop
from spirillum.controllers.sensors import Detection, Message, MeterReading
from spirillum.dynamics.run_summary import DutyInterval

LAB = {"unknown": {"friction_factor": 3.0, "gap_factor": 2.0, "voltage_error": 0.01, "viscosity_error": 0.02}}
END = 8.0


def done(u: Any, v: Any, time: Any, voltage: float = 0.0, viscosity: float = 0.0, *, gap: float = 1.0) -> list[Any]:
    """Tail's phase, body's angle, current and voltage of a made-up robot: smooth in the unknown powers u and v."""
    rate = 7.5 * (1.0 - 0.25 * u - 0.03 * u**2) * (1.0 + 1.1 * voltage - (0.3 - 0.2 * u) * viscosity)
    body = (
        -0.12
        * (1.0 - 0.25 * u)
        * (1.0 + 0.2 * gap * v + 0.02 * gap * v**2)
        * (1.0 + 1.1 * voltage - (0.3 - 0.2 * u) * viscosity)
    )
    none = 0.0 * time
    return [rate * time, body * time, 0.3 * (1.0 + voltage) + none, 3.46 * (1.0 + voltage) + none]


def paths(*, gap: float = 1.0) -> Paths:
    time = np.arange(0.0, END + 0.2, 0.1)
    u, v = points(3.0), points(2.0)
    members = np.array([[done(one, two, time, gap=gap) for two in v] for one in u])
    small = 1e-6
    own = np.array([done(one, 0.0, time) for one in u])[:, None]
    changed = np.array([[done(one, 0.0, time, small, 0.0), done(one, 0.0, time, 0.0, small)] for one in u])
    with np.errstate(invalid="ignore"):
        sensitivity = np.nan_to_num((changed / own - 1.0) / small)
    return Paths(time, members, sensitivity)


def trial(lab: Lab, seed: int, *, gap: float = 1.0) -> tuple[tuple[float, float], list[Detection], list[MeterReading]]:
    """What camera and meter tell of a robot that was drawn as the lab says."""
    rng = np.random.default_rng(seed)
    u, v = rng.uniform(-1.0, 1.0, 2)
    errors = rng.standard_normal(2) * [lab.unknown.voltage_error, lab.unknown.viscosity_error]
    gains = 1.0 + lab.meter.gain_error * rng.standard_normal(2)
    camera, meter, sights = lab.camera, lab.meter, []
    slow = rng.standard_normal(2)
    kept = np.exp(-1.0 / (camera.fps * camera.memory))
    for number in range(int(END * camera.fps)):
        slow = kept * slow + np.sqrt(1 - kept**2) * rng.standard_normal(2)
        time = number / camera.fps
        tail, body, *_ = done(u, v, time, *errors, gap=gap)
        tail += camera.tail_phase_noise * rng.standard_normal() + camera.tail_phase_wander * slow[0]
        body += camera.body_angle_noise * rng.standard_normal() + camera.body_angle_wander * slow[1]
        sights.append(Detection(time, 0.0, 0.0, float(body) + 0.3, float(tail) - 2.0))
    readings = []
    for number in range(int(END * meter.rate)):
        *_, current, voltage = done(u, v, number / meter.rate, *errors, gap=gap)
        current = gains[0] * current + meter.current_noise * rng.standard_normal()
        voltage *= gains[1] * (1.0 + meter.voltage_noise * rng.standard_normal())
        readings.append(MeterReading(number / meter.rate, float(current), float(voltage)))
    return (float(3.0**u), float(2.0**v)), sights, readings


@pytest.mark.parametrize("trials", [40, pytest.param(80, marks=pytest.mark.slow)])
def test_intervals_hold_the_truth_as_often_as_they_say(trials: int) -> None:
    lab, bank = Lab.of(LAB), paths()
    held, widths = [], []
    for seed in range(trials):
        truth, sights, readings = trial(lab, seed)
        found = learnt(bank, lab, [DutyInterval(0.0, END)], sights, readings)
        assert found is not None
        factors = (found.friction, found.gap)
        held.append([one.low <= true <= one.high for one, true in zip(factors, truth, strict=True)])
        widths.append([np.log(one.high / one.low) for one in factors])
    share = np.mean(held, axis=0)
    assert np.all(share > 0.95 - 3 * np.sqrt(0.05 * 0.95 / len(held)))
    assert np.all(np.median(widths, axis=0) < [0.5 * np.log(3.0), 0.5 * np.log(2.0)])


def test_a_gap_that_changes_nothing_is_not_told() -> None:
    lab = Lab.of(LAB)
    _, sights, readings = trial(lab, 3, gap=0.0)
    found = learnt(paths(gap=0.0), lab, [DutyInterval(0.0, END)], sights, readings)
    assert found is not None
    assert found.friction.told
    assert not found.gap.told


def test_nothing_is_said_before_there_is_enough_to_see() -> None:
    lab = Lab.of(LAB)
    _, sights, readings = trial(lab, 3)
    assert learnt(paths(), lab, [DutyInterval(0.0, 1.0)], sights, readings) is None


def test_without_a_meter_the_interval_is_wider() -> None:
    lab, bank = Lab.of(LAB), paths()
    _, sights, readings = trial(lab, 5)
    wide, narrow = (learnt(bank, lab, [DutyInterval(0.0, END)], sights, told) for told in ([], readings))
    assert wide is not None
    assert narrow is not None
    assert wide.friction.high / wide.friction.low > narrow.friction.high / narrow.friction.low


def test_polynomials_are_interpolated_exactly() -> None:
    nodes, at = points(3.0), np.linspace(-1.0, 1.0, 17)
    assert interpolation(nodes, at) @ (nodes**4 - 2.0 * nodes**3) == pytest.approx(at**4 - 2.0 * at**3, abs=1e-12)
    assert interpolation(points(1.0), at[:1]).tolist() == [[1.0]]


class NoBank:
    """Notes what it is told to follow."""

    duty, current = 1.0, 0.3

    def __init__(self) -> None:
        self.time, self.followed = 0.0, []

    def follow(self, time: float, duty: float) -> None:
        self.followed.append((self.time, time, duty))
        self.time = time

    def paths(self) -> Paths:
        return paths()


class Late:
    """Asks for the drive from the third second on."""

    blind, knowing = True, False

    def decide(self, news: Message) -> float:
        return float(news.time > 3.0)

    def estimate(self) -> Mapping[str, float]:
        return {}


def test_the_meter_tells_when_a_command_has_arrived(toy: Any) -> None:
    """Nine of ten commands are lost; the bank is switched on when the robot was."""
    lab = Lab.of({**LAB, "remote": {"lost": 0.9}})
    bank = NoBank()
    run = run_loop(toy(1e-3), Learning(Late(), Learner(lab, bank)), lab, 7.0, seed=2)
    on = next(before.time for before, after in zip(run.moments, run.moments[1:], strict=False) if after.values["duty"])
    found = next(start for start, _, duty in bank.followed if duty > 0.0)
    assert on > 3.2
    assert found == pytest.approx(on, abs=0.051)
