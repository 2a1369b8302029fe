"""A robot that is held to its channel's axis as a handful of numbers: what other programs compute it from.

Held, a robot has two degrees of freedom and no inertia: its speed and rates follow the motor's torque and an imposed
flow at once and linearly, and the current (17) is the only state with dynamics of its own.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from spirillum.arrays import PerRobot, Samples
from spirillum.dynamics.held_equations import rates, steady_state
from spirillum.errors import InputError
from spirillum.fitted.fit import read_fit
from spirillum.quantities import unit_of
from spirillum.robot.batch import Electrics, RobotBatch
from spirillum.robot.placement import Placement
from spirillum.robot.robot import Robot
from spirillum.swimming.balance import coasting_rates, friction_torques, rates_per_torque
from spirillum.swimming.model_choice import AUTO
from spirillum.swimming.prediction import Prediction, predict
from spirillum.swimming.reynolds import body_reynolds, check_stokes_flow, flow_limit, reynolds_limits, tail_reynolds
from spirillum.swimming.steady import calibrated_balance


class ModelParameter(NamedTuple):
    """One number of the equations."""

    name: str
    """Field of the robot file, or quantity of the registry."""
    unit: str
    """SI."""
    meaning: str
    """What it is, in half a sentence."""


PARAMETERS = (
    ModelParameter("motor.torque_constant", "N m/A", "K_m: torque in the joint per current, gear included"),
    ModelParameter("motor.back_emf_constant", "V s/rad", "K_b: back-emf per rate of the joint, gear included"),
    ModelParameter("motor.inductance", "H", "L"),
    ModelParameter("motor.resistance.constant", "ohm", "R(I): constant part"),
    ModelParameter("motor.resistance.decay", "ohm", "R(I): part that decays with the current"),
    ModelParameter("motor.resistance.decay_rate", "1/A", "R(I): how fast it decays"),
    ModelParameter("motor.resistance.growth", "ohm", "R(I): part that grows with the current"),
    ModelParameter("motor.resistance.growth_rate", "1/A", "R(I): how fast it grows"),
    ModelParameter("motor.resistance.slope", "ohm/A", "R(I): part in proportion to the current"),
    ModelParameter("battery.voltage", "V", "V(I) without a current"),
    ModelParameter("battery.internal_resistance", "ohm", "V(I): loss per current"),
    ModelParameter("polarity", "1", "sense about +x in which the motor turns the tail: 1 or -1"),
    *(
        ModelParameter(f"{of}_per_{per}", unit_of(f"{of}_per_{per}"), f"{words} per {over}")
        for per, over in (("torque", "joint torque"), ("flow", "imposed mean flow"))
        for of, words in (
            ("forward_velocity", "forward velocity"),
            ("body_rotation_rate", "body rate"),
            ("tail_rotation_rate", "tail rate"),
        )
    ),
)
"""The numbers in the order of the compiled equations, which know them by their places."""
STATES = ("motor_current", "position", "tail_angle", "body_angle", "battery_charge_used")
"""The state in the order of the compiled equations; quantities of the registry."""


@dataclass(frozen=True)
class HeldModel:
    """The equations of a held robot, SI; rates and current signed about +x."""

    prediction: Prediction
    """The steady motion, with robot, model and friction."""
    values: tuple[float, ...]
    """Of `PARAMETERS`."""

    @property
    def robot(self) -> Robot:
        """The robot."""
        return self.prediction.robot

    @property
    def flow(self) -> float | None:
        """Mean flow that is imposed at the start, m/s; None: none is, and the equations have no such input."""
        return self.prediction.batch.placement.flow

    @property
    def duty(self) -> float:
        """The drive's own duty."""
        motor = self.prediction.batch.electrics
        return 1.0 if motor is None else float(motor.duty[0])

    @property
    def capacity(self) -> float:
        """Charge of the battery, C; infinite where it is unknown."""
        battery = self.robot.battery
        return np.inf if battery is None or battery.capacity is None else battery.capacity

    @property
    def parameters(self) -> dict[str, float]:
        """The numbers by name."""
        return dict(zip((item.name for item in PARAMETERS), self.values, strict=True))


def held_model(
    robot: str | Path | Mapping[str, Any] | Robot,
    *,
    model: str = AUTO,
    friction: str | None = None,
    calibrated: bool = True,
    calibration: str | Path | None = None,
    placement: Placement | Mapping[str, Any] | None = None,
) -> HeldModel:
    """The equations of a robot that is held to its channel's axis, as in a run of `simulate` with motion `held`.

    Args:
        robot: a preset's name, a robot file, its tables, or a loaded robot, with a `dc-motor` drive.
        model: a hydrodynamic model, or `auto`.
        friction: reading of the friction; None: the robot's own.
        calibrated: apply the robot's calibration factors for this model.
        calibration: calibration file whose factors replace the robot's.
        placement: where the robot is held, for `tube`; with a `flow` the imposed flow is an input, which starts there.
    """
    placed = Placement.of(placement)
    steady = predict(
        robot,
        model=model,
        friction=friction,
        calibrated=calibrated,
        fit=read_fit(calibration),
        placement=placed if placed.is_given else None,
        band=False,
    )
    motor = steady.batch.electrics
    if steady.batch.drive != "dc-motor" or motor is None:
        raise InputError(f"drive.kind = '{steady.batch.drive}'; allowed: 'dc-motor', which alone has a motor to switch")
    response = responses(steady, steady.batch, np.array([steady.effective_friction]))[0]
    return HeldModel(steady, (*_of_motor(motor), *response.tolist()))


def check_steady(held: HeldModel, duty: float, flow: float) -> list[str]:
    """Refuse a held robot that moves far outside Stokes flow where a duty and a flow have become steady.

    Returns:
        A warning for each Reynolds number that is too large for an accurate answer.
    """
    numbers, batch = held.parameters, held.prediction.batch
    speed, tail, _ = rates(numbers, steady_state(numbers, duty, flow), duty, flow)[1:4]
    limits = reynolds_limits(batch, body_reynolds(batch, speed), tail_reynolds(batch, tail))
    return list(check_stokes_flow(batch, [*limits, flow_limit(batch, flow)]).values())


def responses(steady: Prediction, batch: RobotBatch, effective: PerRobot, viscosity: PerRobot | None = None) -> Samples:
    """(U, Omega, omega) per joint torque, then per imposed flow, of robots, (n, 6); the latter 0 without a flow.

    Args:
        steady: a prediction whose model, calibration, friction reading and place the robots share.
        batch: the robots, or one for all.
        effective: effective friction of each, N m s/rad, (n,).
        viscosity: factor of each; in Stokes flow all resistances, and the wrench of a flow, are in proportion to it.
    """
    place = steady.batch.placement
    batch = batch.placed(place if place.flow is None else place.model_copy(update={"flow": 1.0}))
    s = calibrated_balance(batch, steady.model, calibrated=steady.calibrated)
    if viscosity is not None:
        s = s._replace(**{name: getattr(s, name) * viscosity for name in ("bb", "br", "rb", "rr", "t_b", "t_r")})
    rotor = np.zeros(1) if batch.electrics is None else batch.electrics.joint_rotor_friction
    t = friction_torques(steady.friction, effective, rotor)
    body, tail = rates_per_torque(s, t)
    coasting_body, coasting_tail = coasting_rates(s, t)
    columns = [s._replace(u_0=np.zeros(1)).speed(body, tail), body, tail]
    columns += [s.speed(coasting_body, coasting_tail), coasting_body, coasting_tail]
    return np.stack([np.broadcast_to(column, effective.shape) for column in columns], axis=-1)


def _of_motor(motor: Electrics) -> tuple[float, ...]:
    columns = (
        motor.joint_torque_constant,
        motor.joint_back_emf_constant,
        motor.inductance,
        motor.constant,
        motor.decay,
        motor.decay_rate,
        motor.growth,
        motor.growth_rate,
        motor.slope,
        motor.voltage,
        motor.internal_resistance,
        motor.polarity,
    )
    return tuple(float(column[0]) for column in columns)
