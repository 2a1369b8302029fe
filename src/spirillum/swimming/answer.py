"""The quantities of steady swimming, each with its unit, meaning and source."""

from __future__ import annotations

from dataclasses import dataclass, field

from spirillum.arrays import Flags, PerRobot

__all__ = ["Swimming"]


@dataclass(frozen=True)
class Swimming:
    """Steady motion of a batch, one value for each robot, SI, rates signed about +x; NaN where not `valid`."""

    forward_velocity: PerRobot = field(
        metadata={"unit": "m/s", "meaning": "forward velocity U_x", "source": "eqs (1), (8), (15)"}
    )
    advance_per_radian: PerRobot = field(
        metadata={"unit": "m/rad", "meaning": "forward velocity over tail rate", "source": "eqs (1), (15)"}
    )
    tail_rotation_rate: PerRobot = field(
        metadata={
            "unit": "rad/s",
            "meaning": "rotation rate omega of the tail (lab)",
            "source": "eqs (15), (18)",
        }
    )
    body_rotation_rate: PerRobot = field(
        metadata={"unit": "rad/s", "meaning": "rotation rate Omega_x of the body", "source": "eqs (2), (15)"}
    )
    motor_rotation_rate: PerRobot = field(
        metadata={"unit": "rad/s", "meaning": "motor rate omega_m = omega - Omega_x", "source": "Table II"}
    )
    tail_torque: PerRobot = field(
        metadata={
            "unit": "N m",
            "meaning": "hydrodynamic torque T_h on the rotor, magnitude",
            "source": "eqs (12), (18)",
        }
    )
    drive_torque: PerRobot = field(
        metadata={"unit": "N m", "meaning": "torque that turns the rotor against the fluid", "source": "eq. (18)"}
    )
    motor_current: PerRobot = field(metadata={"unit": "A", "meaning": "motor current I", "source": "eq. (17)"})
    battery_voltage: PerRobot = field(
        metadata={"unit": "V", "meaning": "battery voltage V(I) at the terminals", "source": "Table II"}
    )
    effective_friction: PerRobot = field(
        metadata={
            "unit": "N m s/rad",
            "meaning": "effective rotary friction B_eff (reading body: B of the wall)",
            "source": "eq. (18)",
        }
    )
    motor_residual_torque: PerRobot = field(
        metadata={
            "unit": "N m",
            "meaning": "motor torque that the friction reading leaves unexplained",
            "source": "eq. (18)",
        }
    )
    electrical_power: PerRobot = field(
        metadata={"unit": "W", "meaning": "electrical power at the battery's terminals", "source": "Table II"}
    )
    shaft_power: PerRobot = field(
        metadata={"unit": "W", "meaning": "drive torque times motor rate", "source": "eq. (18)"}
    )
    friction_power: PerRobot = field(
        metadata={"unit": "W", "meaning": "power lost to friction", "source": "eqs (18), (19)"}
    )
    dissipated_power: PerRobot = field(
        metadata={
            "unit": "W",
            "meaning": "viscous dissipation (in an imposed flow: what the robot adds to it)",
            "source": "eq. (9)",
        }
    )
    hydrodynamic_efficiency: PerRobot = field(
        metadata={
            "unit": "1",
            "meaning": "isolated uncalibrated body drag times U^2 over shaft power",
            "source": "eq. (16)",
        }
    )
    propulsive_power: PerRobot = field(
        metadata={
            "unit": "W",
            "meaning": "isolated uncalibrated body drag times U^2: towing the body alone",
            "source": "Chattopadhyay et al. 2006",
        }
    )
    overall_efficiency: PerRobot = field(
        metadata={
            "unit": "1",
            "meaning": "propulsive over electrical power",
            "source": "Chattopadhyay et al. 2006, Table II",
        }
    )
    cost_of_transport: PerRobot = field(
        metadata={
            "unit": "1",
            "meaning": "electrical power, else shaft power, over weight in vacuum times speed",
            "source": "Gabrielli and von Karman 1950",
        }
    )
    reynolds_number: PerRobot = field(
        metadata={"unit": "1", "meaning": "Reynolds number on the body's diameter", "source": "definition"}
    )
    tail_reynolds_number: PerRobot = field(
        metadata={
            "unit": "1",
            "meaning": "Reynolds number rho |omega| B_o^2/mu on the tail's amplitude",
            "source": "definition",
        }
    )
    battery_run_time: PerRobot = field(
        metadata={"unit": "s", "meaning": "time until the rated charge is spent", "source": "Table II"}
    )
    plug_velocity: PerRobot = field(
        metadata={
            "unit": "m/s",
            "meaning": "mean velocity of the fluid through the channel",
            "source": "models with a channel",
        }
    )
    wobble_angle: PerRobot = field(
        metadata={
            "unit": "rad",
            "meaning": "free motion: angle between the motor axis and the direction of swimming",
            "source": "eqs (8), (15) with all rows",
        }
    )
    path_radius: PerRobot = field(
        metadata={
            "unit": "m",
            "meaning": "free motion: radius of the helix on which the body's mid-length moves",
            "source": "eqs (8), (15) with all rows",
        }
    )
    step_out_rate: PerRobot = field(
        metadata={
            "unit": "rad/s",
            "meaning": "magnetic drive: fastest rotation of the field that the robot follows",
            "source": "m B over the resistance to rotation",
        }
    )
    phase_lag: PerRobot = field(
        metadata={
            "unit": "rad",
            "meaning": "magnetic drive: angle of the moment behind the field",
            "source": "torque m B sin(lag)",
        }
    )
    valid: Flags = field(
        metadata={
            "unit": "1",
            "meaning": "robot can be built and lies inside the model's domain",
            "source": "domain of the model",
        }
    )
