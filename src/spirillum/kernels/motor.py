"""The law of a drive, (17) or a curve of torque against rate, and robots in axial motion: csrc/drive.c, axial.c."""

from __future__ import annotations

from spirillum.kernels.native import Array, Float64, native

# A motor under a load: the 12 numbers of a motor as in `axial_motor`, then duty, back-emf, V, and its slope, V/A.
MOTOR, LOADED = 12, 15
MOST_POINTS = 12
"""Points of a curve at most."""


@native("out")
def steady_currents(
    cases: Float64[Array, "count 15"],  # motors under loads, (n, `LOADED`)
    # to be filled, (n,): negative where the load drives the motor, NaN where it does so beyond any root, or beyond what
    # the battery's voltage allows
    out: Float64[Array, "count"],
) -> None:
    """Fill the steady root of (17), A."""


@native("out")
def windings(
    motors: Float64[Array, "count 12"], currents: Float64[Array, "count"], out: Float64[Array, "count 2"]
) -> None:
    """Fill R(|I|), ohm, and dR/d|I|, ohm/A, of motors (n, `MOTOR`) at currents, A."""


@native("out")
def curve_torques(
    curve: Float64[Array, "25"],  # number of points, then rate, rad/s, and torque, N m, of each; of 25 numbers
    coasting: Float64[Array, "count"],  # rate of the joint without a torque, rad/s
    per_torque: Float64[Array, "count"],  # what a torque adds to it, 1/(N m s)
    duty: float,  # 0 to 1; scales the torques
    out: Float64[Array, "count"],
) -> None:
    """Fill the torques of a motor with a curve in its own sense, N m."""


# Parameters of one robot, SI; torques and rates at the joint.
TORQUE, EMF, INDUCTANCE = 0, 1, 2  # K_m, N m/A; K_b, V s/rad; L, H
CONSTANT, DECAY, DECAY_RATE, GROWTH, GROWTH_RATE, SLOPE = 3, 4, 5, 6, 7, 8  # R(I) of Table II
VOLTAGE, INTERNAL, POLARITY = 9, 10, 11  # V(I) of Table II; sign of the driven rate about +x
SPEED, BODY, TAIL = 12, 13, 14  # U, Omega, omega per joint torque
SPEED_FLOW, BODY_FLOW, TAIL_FLOW = 15, 16, 17  # U, Omega, omega per imposed mean flow
PARAMETERS = 18

# The state of one robot.
CURRENT, POSITION, TAIL_ANGLE, BODY_ANGLE, CHARGE = 0, 1, 2, 3, 4
SQUARE, HEAT = 5, 6  # integrals of I^2, A^2 s, and of R I^2, J
STATES = 7


@native("states", symbol="advance_axial")
def advance(
    parameters: Float64[Array, "count 18"],  # (n, `PARAMETERS`)
    states: Float64[Array, "count 7"],  # (n, `STATES`), changed in place; NaN where duty, flow or parameters are none
    dt: float,  # s, positive
    duty: Float64[Array, "count"],  # 0 to 1
    flow: Float64[Array, "count"],  # imposed mean flow, m/s
    fineness: float = 1.0,  # number of pieces, relative to the normal one
) -> None:
    """Take robots over a time, each at its own duty and flow."""


@native("states")
def advance_on_curve(
    parameters: Float64[Array, "count 18"],
    states: Float64[Array, "count 7"],
    dt: float,
    duty: Float64[Array, "count"],
    flow: Float64[Array, "count"],
    curve: Float64[Array, "25"],
) -> None:
    """Take robots whose motor has a curve over a time; arguments as of `advance` and `drive.curve_torques`.

    Their torque constant is 1, and the column of the current holds the torque, N m.
    """


@native("out", symbol="axial_rates")
def rates(parameters: Float64[Array, "18"], current: float, duty: float, flow: float, out: Float64[Array, "7"]) -> None:
    """Fill d/dt of the state of one robot at a current, A, a duty and an imposed mean flow, m/s."""


@native("out")
def contact_drag(
    r: Float64[Array, "count 3 3"],  # resistance of the whole robot against U, Omega and omega
    force: Float64[Array, "count"],  # mu_c N, N
    radius: Float64[Array, "count"],  # of the body, m
    rate: Float64[Array, "count"],  # omega of the tail, rad/s
    smooth: float,  # v_r over the speed of a body that turns as fast as its tail
    out: Float64[Array, "count"],
) -> None:
    """Fill the drag k = force/s of dry friction at a contact that slides at s, N s/m, see `swimming.dry_friction`."""
