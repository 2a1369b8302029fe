"""The robot that a run has drawn."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from spirillum.controllers.sensors import SampledErrors
from spirillum.dynamics.integration import Progress
from spirillum.dynamics.plant import Plant
from spirillum.errors import InputError
from spirillum.robot.placement import Placement
from spirillum.robot.robot import Robot
from spirillum.robot.tube_pose import gap_of


def plant_of(
    robot: Robot, arguments: Mapping[str, Any], drawn: SampledErrors, progress: Progress | None = None
) -> Plant:
    """The robot that a run has drawn, at rest where it starts."""
    arguments = dict(arguments)
    if drawn.gap != 1.0:
        if robot.channel is None:
            raise InputError("unknown.gap_factor is given for a robot without a channel; allowed: 1")
        placed = Placement.of(arguments.get("placement"))
        if placed.eccentricity is not None:
            raise InputError(
                "unknown.gap_factor is given together with an eccentricity; allowed: a gap, or a factor of 1"
            )
        gap = gap_of(placed, robot.body.diameter, 0.5 * robot.channel.diameter)
        arguments["placement"] = placed.model_copy(update={"gap": gap * drawn.gap})
    if drawn.friction != 1.0:
        robot = _with_friction(robot, drawn.friction)
    robot = _with_supply_and_fluid(robot, drawn)
    return Plant(robot, **arguments, progress=progress)


def _with_friction(robot: Robot, factor: float) -> Robot:
    """A robot whose friction, if it has any, is multiplied by a factor."""
    effective = robot.friction.effective
    if effective is None and robot.motor is not None:
        effective = robot.motor.joint_rotor_friction
    if not effective:
        return robot
    return robot.model_copy(update={"friction": robot.friction.model_copy(update={"effective": factor * effective})})


def _with_supply_and_fluid(robot: Robot, drawn: SampledErrors) -> Robot:
    """A robot whose battery and fluid have the voltage and viscosity that were drawn."""
    changes: dict[str, Any] = {}
    if drawn.viscosity != 1.0:
        fluid = robot.fluid
        changes["fluid"] = fluid.model_copy(update={"viscosity": fluid.viscosity * drawn.viscosity})
    if drawn.voltage != 1.0 and robot.battery is not None:
        battery = robot.battery
        changes["battery"] = battery.model_copy(update={"voltage": battery.voltage * drawn.voltage})
    return robot.model_copy(update=changes) if changes else robot
