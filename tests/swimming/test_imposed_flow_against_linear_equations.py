"""Steady swimming in an imposed flow against its equations, written out and solved as they stand.

F = -R V + L, no net force, torque rows with the joint torque and each reading's friction, the motor's (17). R, L and
the mean flow are made up (fixture `walled`); nothing is taken from the code that eliminates the speed.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

from spirillum import InputError
from spirillum.fluid.model import SwimmerModel
from spirillum.robot.placement import Placement
from spirillum.swimming.balance import winding_resistance
from spirillum.swimming.steady import swim, swim_on_floor
from spirillum.units import Hz

K_M, K_B, B_M = 0.00045, 0.004, 7e-7  # Table II
B = 6e-6
READINGS = ["none", "rotor", "body", "paper"]
FLOWS = [-3e-3, pytest.param(-4e-4, marks=pytest.mark.slow), 2e-3]
FORWARD, REVERSE = {}, {"tail.handedness": "left", "motor.polarity": "reverse"}


@pytest.fixture
def placed(batch_of: Callable[..., Any]) -> Callable[..., Any]:
    def make(flow: float | None, **fields: Any) -> Any:
        batch = batch_of(**{"friction.effective": f"{B} N m s/rad", **fields})
        return batch.placed(Placement.of({"flow": flow}))

    return make


def first(swimming: Any, name: str) -> float:
    return float(getattr(swimming, name)[0])


def friction_matrix(reading: str, effective: float = B) -> np.ndarray:
    """(T_b, T_r) = -matrix (Omega, omega)."""
    joint = np.array([[1.0, -1.0], [-1.0, 1.0]])
    wall = np.array([[1.0, 0.0], [0.0, 0.0]])
    on_rotor = np.array([[0.0, 0.0], [-1.0, 1.0]])
    return {
        "none": 0 * joint,
        "rotor": effective * joint,
        "body": B_M * joint + effective * wall,
        "paper": effective * on_rotor,
    }[reading]


def rows(model: SwimmerModel, batch: Any, friction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Force row, body row, rotor row: matrix (U, Omega, omega, tau) = right-hand side."""
    r, load = (part[0] for part in model.axial_flow(batch)[:2])
    by_u, by_body, by_tail = r[:, 0] + r[:, 2], r[:, 1], r[:, 3]
    matrix = np.zeros((3, 4))
    for row, entries in enumerate(((0, 2), (1,), (3,))):
        for entry in entries:
            matrix[row, :3] += by_u[entry], by_body[entry], by_tail[entry]
    matrix[1:, 1:3] += friction
    matrix[:, 3] = 0.0, 1.0, -1.0
    return matrix, np.array([load[0] + load[2], load[1], load[3]])


def solved(model: SwimmerModel, batch: Any, friction: np.ndarray, more: list[float], value: float) -> np.ndarray:
    """(U, Omega, omega, tau) with one more row."""
    matrix, right = rows(model, batch, friction)
    # Rows and unknowns in their own units, so that the solver's rounding is that of each.
    scale = np.array([1.0, 1.0, 1.0, 1e-5])
    full = np.vstack([matrix, more]) * scale
    size = np.abs(full).max(axis=1, keepdims=True)
    return scale * np.linalg.solve(full / size, np.append(right, value) / size[:, 0])


def motor_current(batch: Any, slip_of: Callable[[float], float]) -> float:
    """Signed current of (17) by bisection."""
    motor, sense = batch.electrics, float(batch.electrics.polarity[0])

    def excess(own: float) -> float:
        winding = float(winding_resistance(motor, np.array([abs(own)]))[0])
        voltage = float(motor.duty[0]) * (3.7 - 0.8 * abs(own))
        return winding * own + K_B * sense * slip_of(sense * own) - voltage

    return sense * float(brentq(excess, -0.2, 1.0, xtol=1e-16))


def check(found: Any, U: float, Omega: float, omega: float, **more: float) -> None:
    assert found.valid[0]
    rate = max(abs(Omega), abs(omega))
    assert first(found, "forward_velocity") == pytest.approx(U, rel=1e-9)
    assert first(found, "body_rotation_rate") == pytest.approx(Omega, abs=1e-9 * rate)
    assert first(found, "tail_rotation_rate") == pytest.approx(omega, abs=1e-9 * rate)
    assert first(found, "motor_rotation_rate") == pytest.approx(omega - Omega, abs=1e-9 * rate)
    for name, value in more.items():
        assert first(found, name) == pytest.approx(value, rel=1e-7), name


def rotor_torque(model: SwimmerModel, batch: Any, V: np.ndarray) -> float:
    """T_h: what turns the rotor against the fluid."""
    found = model.axial_flow(batch)
    return float(found.resistance[0][3] @ V - found.load[0][3])


@pytest.mark.parametrize("flow", FLOWS)
@pytest.mark.parametrize("reading", READINGS)
@pytest.mark.parametrize("duty", [1.0, 0.0])
@pytest.mark.parametrize("hand", [FORWARD, REVERSE])
def test_motor(
    placed: Callable[..., Any], walled: SwimmerModel, flow: float, reading: str, duty: float, hand: dict[str, str]
) -> None:
    """A motor that is switched off is driven by the flow."""
    batch = placed(flow, **{"drive.duty": duty, **hand})
    friction = friction_matrix(reading)

    def motion(current: float) -> np.ndarray:
        return solved(walled, batch, friction, [0, 0, 0, 1], K_M * current)

    current = motor_current(batch, lambda i: float(np.diff(motion(i)[1:3])[0]))
    U, Omega, omega, _ = motion(current)
    found = swim(batch, walled, friction=reading)
    torque = rotor_torque(walled, batch, np.array([U, Omega, U, omega]))
    check(found, U, Omega, omega, motor_current=current, tail_torque=abs(torque), drive_torque=torque)
    assert first(found, "shaft_power") == pytest.approx(torque * (omega - Omega), rel=1e-7)


@pytest.mark.parametrize("flow", FLOWS)
@pytest.mark.parametrize("reading", READINGS)
@pytest.mark.parametrize("torque", [3e-5, -1e-5, 0.0])
def test_prescribed_torque(
    placed: Callable[..., Any], walled: SwimmerModel, flow: float, reading: str, torque: float
) -> None:
    batch = placed(flow, drive={"kind": "torque", "torque": f"{torque} N m", "duty": 1.0})
    U, Omega, omega, _ = solved(walled, batch, friction_matrix(reading), [0, 0, 0, 1], torque)
    check(swim(batch, walled, friction=reading), U, Omega, omega)


@pytest.mark.parametrize("flow", FLOWS)
@pytest.mark.parametrize("reading", READINGS)
@pytest.mark.parametrize("rate", [7.5, -3.0, 0.0])
def test_prescribed_rate(
    placed: Callable[..., Any], walled: SwimmerModel, flow: float, reading: str, rate: float
) -> None:
    batch = placed(flow, drive={"kind": "rate", "rate": f"{rate} rad/s", "duty": 1.0})
    U, Omega, omega, tau = solved(walled, batch, friction_matrix(reading), [0, 0, 1, 0], rate)
    found = swim(batch, walled, friction=reading)
    on_rotor = friction_matrix(reading)[1] @ [Omega, omega]
    check(found, U, Omega, omega, drive_torque=tau - on_rotor)
    assert np.isnan(first(found, "advance_per_radian")) == (rate == 0)
    if rate:
        again = swim(placed(flow, drive=None), walled, friction=reading, tail_rate=np.array([rate]))
        check(again, U, Omega, omega)
    # The same at the motor rate that goes with it.
    if reading != "paper":
        slip = np.array([omega - Omega])
        check(swim(placed(flow, drive=None), walled, friction=reading, motor_rate=slip), U, Omega, omega)


@pytest.mark.parametrize("flow", FLOWS)
@pytest.mark.parametrize("reading", READINGS)
@pytest.mark.parametrize("kind", ["tail", "motor"])
@pytest.mark.parametrize("hand", [FORWARD, REVERSE])
def test_prescribed_rates_with_a_motor(
    placed: Callable[..., Any], walled: SwimmerModel, flow: float, reading: str, kind: str, hand: dict[str, str]
) -> None:
    """The current follows from (17); B_eff from (18), or what it leaves unexplained."""
    batch = placed(flow, **hand)
    rate = 8.0 * float(batch.electrics.polarity[0])
    row = [0, 0, 1, 0] if kind == "tail" else [0, -1, 1, 0]
    found = swim(batch, walled, friction=reading, **{f"{kind}_rate": np.array([rate])})
    if reading == "paper":
        # The body row holds -K_m I and the flow alone: find the current at which both rows and (17) agree.
        rest = rows(walled, batch, 0 * friction_matrix("none"))

        def motion(current: float) -> np.ndarray:
            matrix = np.vstack([rest[0][:2, :3], row[:3]]) / [[1], [1e-5], [1]]
            return np.linalg.solve(matrix, np.array([rest[1][0], (rest[1][1] - K_M * current) / 1e-5, rate]))

        current = motor_current(batch, lambda i: float(np.diff(motion(i)[1:3])[0]))
        U, Omega, omega = motion(current)
    else:
        wall = B * np.diag([1.0, 0.0]) if reading == "body" else 0 * friction_matrix("none")
        U, Omega, omega, _ = solved(walled, batch, wall, row, rate)
        current = motor_current(batch, lambda _: omega - Omega)
    spare = K_M * current - rotor_torque(walled, batch, np.array([U, Omega, U, omega]))
    slip = omega - Omega
    check(found, U, Omega, omega, motor_current=current)
    if reading in ("rotor", "paper"):
        assert first(found, "effective_friction") == pytest.approx(spare / slip, rel=1e-6)
    else:
        left = spare - (B_M * slip if reading == "body" else 0.0)
        assert first(found, "motor_residual_torque") == pytest.approx(left, rel=1e-6)


@pytest.mark.parametrize("flow", FLOWS)
@pytest.mark.parametrize("reading", ["rotor", "paper"])
@pytest.mark.parametrize("hand", [FORWARD, REVERSE])
def test_observed_rates_give_the_friction_back(
    placed: Callable[..., Any], walled: SwimmerModel, flow: float, reading: str, hand: dict[str, str]
) -> None:
    batch = placed(flow, **hand)
    forward = swim(batch, walled, friction=reading)
    tail, motor = forward.tail_rotation_rate, forward.motor_rotation_rate
    for rates in ({"tail_rate": tail}, {"motor_rate": motor}, {"tail_rate": tail, "motor_rate": motor}):
        back = swim(batch, walled, friction=reading, **rates)
        assert first(back, "effective_friction") == pytest.approx(B, rel=1e-8)
        assert first(back, "forward_velocity") == pytest.approx(first(forward, "forward_velocity"), rel=1e-9)


@pytest.mark.parametrize("flow", FLOWS)
@pytest.mark.parametrize("kind", ["torque", "rate"])
@pytest.mark.parametrize("value", [4e-5, -2e-5, 0.0])
def test_one_piece(placed: Callable[..., Any], walled: SwimmerModel, flow: float, kind: str, value: float) -> None:
    """Body and tail turn as one under an external torque or rate, with or against the flow."""
    number = value if kind == "torque" else 1e5 * value
    unit = "N m" if kind == "torque" else "rad/s"
    batch = placed(flow, drive={"kind": kind, kind: f"{number} {unit}", "joint": "fixed", "duty": 1.0})
    r, load = (part[0] for part in walled.axial_flow(batch)[:2])
    both = np.kron([[1.0, 1.0]], np.eye(2))  # wrench on the whole
    whole, pull = both @ r @ both.T, both @ load
    scale = np.array([1.0, 1e-4])
    if kind == "torque":
        U, omega = np.linalg.solve(whole / scale[:, None], (pull + np.array([0.0, number])) / scale)
    else:
        U, omega = (pull[0] - whole[0, 1] * number) / whole[0, 0], number
    external = whole[1] @ [U, omega] - pull[1]
    found = swim(batch, walled)
    assert found.valid[0]
    assert first(found, "forward_velocity") == pytest.approx(U, rel=1e-9)
    assert first(found, "tail_rotation_rate") == first(found, "body_rotation_rate") == pytest.approx(omega, rel=1e-9)
    assert first(found, "drive_torque") == pytest.approx(external, rel=1e-7, abs=1e-16)
    assert first(found, "shaft_power") == pytest.approx(external * omega, rel=1e-7, abs=1e-16)


@pytest.mark.parametrize("reading", READINGS)
@pytest.mark.parametrize("rates", [{}, {"tail_rate": np.array([7.0])}, {"motor_rate": np.array([9.0])}])
def test_energy(placed: Callable[..., Any], walled: SwimmerModel, reading: str, rates: dict[str, Any]) -> None:
    """What the battery gives is lost in motor and friction, or handed to the fluid."""
    s = swim(placed(-1e-3), walled, friction=reading, **rates)
    i, slip = first(s, "motor_current"), first(s, "motor_rotation_rate")
    winding = float(winding_resistance(placed(None).electrics, np.array([abs(i)]))[0]) * i**2
    residual = first(s, "motor_residual_torque")
    unexplained = 0.0 if np.isnan(residual) else residual * slip
    losses = winding + (K_B - K_M) * slip * i + first(s, "friction_power") + first(s, "dissipated_power") + unexplained
    assert first(s, "electrical_power") == pytest.approx(losses, rel=1e-9)


@pytest.mark.parametrize("reading", READINGS)
@pytest.mark.parametrize("drive", [None, {"kind": "torque", "torque": "2e-5 N m", "duty": 1.0}])
def test_uniform_stream_only_carries_the_robot(
    placed: Callable[..., Any], walled: SwimmerModel, monkeypatch: pytest.MonkeyPatch, reading: str, drive: Any
) -> None:
    """L = R (u, 0, u, 0) is a change of frame: the speed grows by u, all else stays."""
    fields = {} if drive is None else {"drive": drive}
    still, stream = placed(None, **fields), placed(2e-3, **fields)
    before = swim(still, walled, friction=reading)
    push = np.array([2e-3, 0.0, 2e-3, 0.0])
    known = type(walled).axial_flow
    monkeypatch.setattr(
        type(walled), "axial_flow", lambda self, batch: known(self, batch)._replace(load=self.axial(batch) @ push)
    )
    after = swim(stream, walled, friction=reading)
    assert first(after, "forward_velocity") == pytest.approx(first(before, "forward_velocity") + 2e-3, rel=1e-12)
    for name in ("body_rotation_rate", "tail_rotation_rate", "tail_torque", "shaft_power", "dissipated_power"):
        assert first(after, name) == pytest.approx(first(before, name), rel=1e-9), name


def test_plug_velocity(placed: Callable[..., Any], walled: SwimmerModel, batch_of: Callable[..., Any]) -> None:
    from spirillum.robot.batch import RobotBatch

    for flow in (None, -1e-3):
        batch: RobotBatch = placed(flow)
        s = swim(batch, walled, tail_rate=np.array([1.2 * Hz]))
        U, Omega, omega = (first(s, n) for n in ("forward_velocity", "body_rotation_rate", "tail_rotation_rate"))
        assert first(s, "plug_velocity") == pytest.approx(
            0.35 * U + 1e-5 * Omega - 2e-5 * omega + 0.7 * (flow or 0.0), rel=1e-12
        )
    assert np.isnan(first(swim(batch_of(), "sbt"), "plug_velocity"))


def test_batch_against_one_by_one(placed: Callable[..., Any], walled: SwimmerModel) -> None:
    values = {"tail.wavelength": [0.01, 0.02, np.nan], "friction.effective": [1e-6, 1e-5, 1e-5]}
    together = swim(placed(-1e-3).with_values(values), walled)
    for index in range(2):
        alone = swim(placed(-1e-3).with_values({name: column[index] for name, column in values.items()}), walled)
        for name in ("forward_velocity", "motor_current", "plug_velocity", "body_rotation_rate"):
            assert getattr(together, name)[index] == pytest.approx(first(alone, name), rel=1e-13)
    assert not together.valid[2]


def test_dry_friction_that_vanishes_changes_nothing_in_a_flow(placed: Callable[..., Any], walled: SwimmerModel) -> None:
    """The flow pushes body and tail: both shares of its force stay where friction is added to the body."""
    from spirillum import load

    rates = {"tail_rate": np.array([1.2 * Hz]), "friction": "none"}
    free, rubbed = (swim_on_floor(placed(2e-3), walled, [load("biorob2012-wide")], mu, **rates) for mu in (0.0, 1e-14))
    for name in ("forward_velocity", "body_rotation_rate", "tail_torque", "plug_velocity"):
        assert first(rubbed, name) == pytest.approx(first(free, name), rel=1e-6), name


def test_run_in_time_refuses_a_flow(walled: SwimmerModel) -> None:
    import spirillum as sp
    from spirillum.dynamics.axial_robot import AxialRobot, axial_run
    from spirillum.dynamics.timing import Timing
    from spirillum.kernels.core import AXIAL_SPEED

    prediction = sp.predict("biorob2012-wide", model="walled", placement={"flow": "1 mm/s"})
    with pytest.raises(InputError, match=r"placement\.flow = 1 mm/s: a run in time starts from rest; allowed: no flow"):
        axial_run(prediction, Timing())
    still = sp.predict("biorob2012-wide", model="walled", placement={"gap": "1 mm"})
    assert AxialRobot.of(still).numbers[AXIAL_SPEED] > 0
