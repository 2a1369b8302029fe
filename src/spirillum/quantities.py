"""The registry of quantities: name, symbol, units, meaning and source of what answers, datasets and figures hold.

A new quantity is one entry of `QUANTITIES`. Tables on the terminal, `--json`, the attributes of datasets, the labels of
figures and the documentation read it from here.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from spirillum.units import for_people


class Quantity(NamedTuple):
    """A quantity by its one definition."""

    name: str
    """Name in answers, datasets and Python."""
    symbol: str
    """Symbol as in the paper, in matplotlib's notation for formulas; empty where it has none."""
    unit: str
    """SI unit; rates in rad/s."""
    meaning: str
    """What it is, in half a sentence."""
    source: str
    """Equation, table or reference."""

    @property
    def display_unit(self) -> str:
        """The unit in which people read it, as long as it is neither very small nor very large."""
        return for_people(self.unit)


_STEADY = (
    Quantity("forward_velocity", "U_x", "m/s", "forward velocity U_x", "eqs (1), (8), (15)"),
    Quantity("advance_per_radian", r"U_x/\omega", "m/rad", "forward velocity over tail rate", "eqs (1), (15)"),
    Quantity("tail_rotation_rate", r"\omega", "rad/s", "rotation rate omega of the tail (lab)", "eqs (15), (18)"),
    Quantity("body_rotation_rate", r"\Omega_x", "rad/s", "rotation rate Omega_x of the body", "eqs (2), (15)"),
    Quantity("motor_rotation_rate", r"\omega_m", "rad/s", "motor rate omega_m = omega - Omega_x", "Table II"),
    Quantity("tail_torque", "T_h", "N m", "hydrodynamic torque T_h on the rotor, magnitude", "eqs (12), (18)"),
    Quantity(
        "drive_torque",
        "T_d",
        "N m",
        "torque that turns the rotor against the fluid, after friction in the joint",
        "eq. (18)",
    ),
    Quantity("motor_current", "I", "A", "motor current I", "eq. (17)"),
    Quantity("battery_voltage", "V", "V", "battery voltage V(I) at the terminals", "Table II"),
    Quantity(
        "effective_friction",
        "B_{eff}",
        "N m s/rad",
        "effective rotary friction B_eff (reading body: B of the wall)",
        "eq. (18)",
    ),
    Quantity(
        "motor_residual_torque", "", "N m", "motor torque that the friction model leaves unexplained", "eq. (18)"
    ),
    Quantity("electrical_power", "P_e", "W", "electrical power at the battery's terminals", "Table II"),
    Quantity("shaft_power", "P_s", "W", "drive_torque times motor rate", "eq. (18)"),
    Quantity("friction_power", "P_f", "W", "power lost to friction", "eqs (18), (19)"),
    Quantity(
        "dissipated_power",
        "P_d",
        "W",
        "viscous dissipation (in an imposed flow: what the robot adds to it)",
        "eq. (9)",
    ),
    Quantity(
        "hydrodynamic_efficiency",
        r"\eta",
        "1",
        "isolated uncalibrated body drag times U^2 over shaft power",
        "eq. (16)",
    ),
    Quantity(
        "propulsive_power",
        "P_p",
        "W",
        "isolated uncalibrated body drag times U^2: towing the body alone",
        "Chattopadhyay et al. 2006",
    ),
    Quantity(
        "overall_efficiency", "", "1", "propulsive over electrical power", "Chattopadhyay et al. 2006, Table II"
    ),
    Quantity(
        "cost_of_transport",
        "",
        "1",
        "electrical power, else shaft power, over weight in vacuum times speed",
        "Gabrielli and von Karman 1950",
    ),
    Quantity("reynolds_number", "Re", "1", "Reynolds number on the body's diameter", "definition"),
    Quantity(
        "tail_reynolds_number",
        "Re_t",
        "1",
        "Reynolds number rho |omega| B_o^2/mu on the tail's amplitude",
        "definition",
    ),
    Quantity("battery_run_time", "", "s", "time until the rated charge is spent", "Table II"),
    Quantity("plug_velocity", "", "m/s", "mean velocity of the fluid through the channel", "models with a channel"),
    Quantity(
        "wobble_angle",
        "",
        "rad",
        "free motion: angle between the motor axis and the direction of swimming",
        "eqs (8), (15) with all rows",
    ),
    Quantity(
        "path_radius",
        "",
        "m",
        "free motion: radius of the helix on which the body's mid-length moves",
        "eqs (8), (15) with all rows",
    ),
    Quantity(
        "step_out_rate",
        "",
        "rad/s",
        "magnetic drive: fastest rotation of the field that the robot follows",
        "m B over the resistance to rotation",
    ),
    Quantity(
        "phase_lag", "", "rad", "magnetic drive: angle of the moment behind the field", "torque m B sin(lag)"
    ),
    Quantity(
        "valid", "", "1", "robot can be built and lies inside the model's domain", "domain of the model"
    ),
)  # fmt: skip

_LINKS = "two rigid links, (15) with all rows"
_TUBE = "motion in the tube"

_RUNS = (
    Quantity("time", "t", "s", "time", "definition"),
    Quantity("position", "x", "m", "place of the body's mid-length; the channel's axis is y = z = 0", _LINKS),
    Quantity("velocity", "U", "m/s", "velocity of the body's mid-length in the lab", _LINKS),
    Quantity("angular_velocity", r"\Omega", "rad/s", "rotation rate of the body in the lab", _LINKS),
    Quantity("attitude", "q", "1", "unit quaternion, body axes to lab", _LINKS),
    Quantity("tail_phase", r"\phi", "rad", "angle of the tail against the body: phase of the wire's equation", "(10)"),
    Quantity("tail_angle", "", "rad", "integral of the tail's rate about the motor axis", _LINKS),
    Quantity("body_angle", "", "rad", "integral of the body's rate about the motor axis", _LINKS),
    Quantity("pitch", "", "rad", "angle by which the nose is raised", "definition"),
    Quantity("yaw", "", "rad", "angle of the motor axis to the left, towards +y", "definition"),
    Quantity("wall_gap", "", "m", "smallest distance of body and tail to the channel's wall", "geometry"),
    Quantity("duty", "", "1", "duty of the drive; 0 while the remote is off", "definition"),
    Quantity(
        "drive_power",
        "",
        "W",
        "torque of the drive before friction (of a motor: motor_torque, not drive_torque) times motor rate; of a robot "
        "in one piece times body rate, and torque of the field times rotation rate",
        "(18)",
    ),
    Quantity("motor_torque", "T_m", "N m", "motor torque K_m I, before friction", "(18)"),
    Quantity("motor_resistance", "R", "ohm", "equivalent resistance R(I)", "Table II"),
    Quantity("drive_energy", "", "J", "integral of drive_power", _LINKS),
    Quantity("friction_energy", "", "J", "energy lost to friction", _LINKS),
    Quantity("dissipated_energy", "", "J", "energy dissipated in the fluid", _LINKS),
    Quantity("electrical_energy", "", "J", "energy from the battery's terminals", _LINKS),
    Quantity("resistive_energy", "", "J", "energy lost in R(I)", "(17)"),
    Quantity("magnetic_energy", "", "J", "energy L I^2/2", "(17)"),
    Quantity(
        "conversion_energy", "", "J", "unmodelled conversion loss: integral of (K_b - K_m) omega_m I", "(17), (18)"
    ),
    Quantity("potential_energy", "", "J", "energy of weight and buoyancy, and of roughness that is pressed", _LINKS),
    Quantity("time_on", "", "s", "time for which the drive is on", "remote"),
    Quantity("time_steady", "", "s", "time for which the drive is on and the motion steady", "remote, and the motion"),
    Quantity("battery_charge_used", "", "C", "charge drawn from the battery", _LINKS),
    Quantity("offset", "e", "m", "distance of the body's mid-length from the tube's axis", "geometry"),
    Quantity("wall_pitch", "", "rad", "angle by which the nose is away from the nearest wall", "geometry"),
    Quantity(
        "wall_yaw", "", "rad", "angle of the nose across the plane of tube and body, to +y at the lowest place", _TUBE
    ),
    Quantity("tail_gap", "", "m", "smallest distance of the wire to the wall where it is near, else NaN", "geometry"),
    Quantity("contact_force", "N", "N", "load on asperities of the wall, summed over contacts", _TUBE),
    Quantity("contact_friction", "F_t", "N", "force of dry friction, summed over contacts", _TUBE),
    Quantity("weight_load", "", "N", "weight less buoyancy, towards the nearest wall", _TUBE),
    Quantity("film_load", "", "N", "force of the lubrication film towards the nearest wall", _TUBE),
    Quantity("outer_load", "", "N", "force of the fluid besides the film, most on the tail, towards the wall", _TUBE),
    Quantity("contact_load", "", "N", "force of asperities and dry friction towards the nearest wall", _TUBE),
    Quantity("lift", "", "N", "force away from the wall that cavitation of the film adds", _TUBE),
    Quantity("contact_power", "", "W", "power lost to dry friction at the wall", _TUBE),
    Quantity("contact_energy", "", "J", "energy lost to dry friction at the wall", _TUBE),
    Quantity("mean_flow", "U_m", "m/s", "mean velocity of the fluid through the tube", "model tube"),
    Quantity("flow_energy", "", "J", "work of the imposed flow on the robot", "model tube"),
)

_FIELDS = (
    Quantity("pressure", "p", "Pa", "fluid pressure", "Stokes equations"),
    Quantity("inside", "", "1", "whether the point lies inside a solid", "geometry"),
    Quantity("largest_speed", "", "m/s", "largest speed of the fluid on the grid", "Stokes equations"),
    Quantity("lowest_pressure", "", "Pa", "lowest pressure on the grid", "Stokes equations"),
    Quantity("highest_pressure", "", "Pa", "highest pressure on the grid", "Stokes equations"),
    Quantity("flow_rate_through_plane", "", "m^3/s", "flow rate through the plane", "integral of the velocity"),
)

_ROTATING_FIELD = (
    Quantity("field_rate", "", "rad/s", "rotation rate of the field", "definition"),
    Quantity("least_wobble_angle", "", "rad", "smallest angle between the motor axis and the field's axis", _LINKS),
    Quantity("largest_wobble_angle", "", "rad", "largest angle between the motor axis and the field's axis", _LINKS),
    Quantity("settled", "", "1", "1 where speed and wobble no longer change, 0 where they still do", _LINKS),
)

_IN_THE_TUBE = (
    Quantity("gap", "", "m", "smallest distance of body and glass", "geometry"),
    Quantity("azimuth", "", "rad", "azimuth of the body's centre about +x from the lowest place", "force balance"),
    Quantity(
        "approach_time",
        "",
        "s",
        "time constant with which a small distance from the steady motion decays",
        "motion in the tube",
    ),
    Quantity("sideways_force", "", "N", "force of the fluid along the wall, towards +y", "model tube"),
    Quantity("normal_force", "", "N", "force of the fluid away from the wall", "model tube"),
    Quantity("pitching_torque", "", "N m", "torque of the fluid about mid-length, nose up", "model tube"),
    Quantity("yawing_torque", "", "N m", "torque of the fluid about mid-length, nose to +y", "model tube"),
    Quantity("normal_resistance", "", "N s/m", "resistance to motion towards the wall", "model tube"),
    Quantity("over_lubrication", "", "1", "normal resistance over that of a lubrication film", "Jeffrey, Onishi 1981"),
    Quantity("exponent", "", "1", "exponent of the normal resistance in the gap", "model tube"),
)

_HELD = "linear response of the held robot, (8), (15)"

_RESPONSES = (
    Quantity("forward_velocity_per_torque", "", "m/(s N m)", "held robot: forward velocity per joint torque", _HELD),
    Quantity("body_rotation_rate_per_torque", "", "rad/(s N m)", "held robot: body rate per joint torque", _HELD),
    Quantity("tail_rotation_rate_per_torque", "", "rad/(s N m)", "held robot: tail rate per joint torque", _HELD),
    Quantity("forward_velocity_per_flow", "", "1", "held robot: forward velocity per imposed mean flow", _HELD),
    Quantity("body_rotation_rate_per_flow", "", "rad/m", "held robot: body rate per imposed mean flow", _HELD),
    Quantity("tail_rotation_rate_per_flow", "", "rad/m", "held robot: tail rate per imposed mean flow", _HELD),
)

_CONTROL = "control"

_CONTROLLED = (
    Quantity("imposed_flow", "", "m/s", "mean flow that is imposed up to here; 0 without one", _CONTROL),
    Quantity("frame_time", "t", "s", "when a frame was taken", "camera"),
    Quantity("seen_position", "x", "m", "x of the body's mid-length as seen; NaN on lost frames", "camera"),
    Quantity("seen_heading", "", "rad", "yaw as seen from above", "camera"),
    Quantity("seen_body_angle", "", "rad", "the body's angle as seen", "camera"),
    Quantity("seen_tail_phase", r"\phi", "rad", "the tail's phase against the body as seen", "camera"),
    Quantity("seen_side", "y", "m", "y of the body's mid-length as seen from above", "camera"),
    Quantity("seen_height", "z", "m", "z of the body's mid-length as seen by a second camera, from the side", "camera"),
    Quantity("reading_time", "t", "s", "when the meter was read", "meter"),
    Quantity("read_current", "I", "A", "motor current as read", "meter"),
    Quantity("read_voltage", "V", "V", "battery voltage as read", "meter"),
    Quantity("decision_time", "t", "s", "when the controller decided", _CONTROL),
    Quantity("command", "", "1", "duty that was sent", _CONTROL),
    Quantity("estimated_position", "x", "m", "x of the body's mid-length as estimated at the decision", _CONTROL),
    Quantity("estimated_position_error", "", "m", "standard deviation of the estimated place", _CONTROL),
    Quantity("estimated_speed", "", "m/s", "estimated speed at the robot's own duty in fluid at rest", _CONTROL),
    Quantity("estimated_friction_factor", "", "1", "estimated friction over that of the robot file", _CONTROL),
    Quantity("estimated_gap_factor", "", "1", "estimated gap at the start over that of the robot file", _CONTROL),
    Quantity("estimated_side", "y", "m", "y of the body's mid-length as estimated at the decision", _CONTROL),
    Quantity("estimated_height", "z", "m", "z of the body's mid-length as estimated at the decision", _CONTROL),
    Quantity("field_yaw", "", "rad", "yaw of the field's axis that was sent", _CONTROL),
    Quantity("field_pitch", "", "rad", "pitch of the field's axis that was sent", _CONTROL),
    Quantity("estimated_drift", "", "m/s", "estimated speed at which the fluid carries the robot", _CONTROL),
)

_STUDIES = (
    Quantity("contact_share", "", "1", "share of the time in which asperities carry load", _TUBE),
    Quantity("body_drag_factor", "", "1", "factor on the isolated body's drag that an observed speed asks for", "(15)"),
    Quantity("roughness", "s", "m", "height of the asperities", "assumed"),
    Quantity("wait", "", "s", "time from laying down until the motor is switched on", "assumed"),
    Quantity("friction_coefficient", r"\mu_c", "1", "coefficient of dry friction", "assumed"),
    Quantity("channel_diameter", "D_{ch}", "m", "channel diameter D_ch", "Table I"),
    Quantity("wavelength", r"\lambda", "m", "tail wavelength lambda", "Table I"),
    Quantity("amplitude", "B_o", "m", "tail amplitude B_o", "Table I"),
    Quantity("assumed_motor_rate", r"\omega_m", "rad/s", "assumed motor rate omega_m", "input of the study"),
    Quantity(
        "error_estimate",
        "",
        "1",
        "relative difference of the forward velocity from another resolution, or of a table from the flow solved for",
        "models that solve for the flow; NaN for those in closed form",
    ),
)

_MEASURED = (
    Quantity("lateral_position", "y", "m", "mean place of the body's mid-length across the channel", "video"),
    Quantity("heading", "", "rad", "angle of the motor axis to x in the plane of the picture, about +z", "video"),
    Quantity("advance", r"U_x/\omega", "m/rad", "advance per radian of the tail", "eq. (15)"),
    Quantity("turning", r"\Omega_x/\omega", "1", "body rate over tail rate", "eq. (15)"),
)

QUANTITIES: dict[str, Quantity] = {
    item.name: item
    for item in (
        *_STEADY,
        *_RUNS,
        *_FIELDS,
        *_ROTATING_FIELD,
        *_IN_THE_TUBE,
        *_RESPONSES,
        *_CONTROLLED,
        *_STUDIES,
        *_MEASURED,
    )
}
"""Every quantity by its name."""


def unit_of(name: str) -> str:
    """SI unit of a quantity."""
    return QUANTITIES[name].unit


def attributes(name: str, *, meaning: str | None = None, source: str | None = None) -> dict[str, Any]:
    """Attributes of a dataset's variable: `units`, `long_name` and `source`, from the registry or as given."""
    item = QUANTITIES[name]
    return {"units": item.unit, "long_name": meaning or item.meaning, "source": source or item.source}
