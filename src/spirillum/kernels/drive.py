"""The law of a drive, (17) or a curve of torque against rate, and its steady states under a load: csrc/drive.c."""

from __future__ import annotations

from spirillum.kernels.native import Array, Float64, native

# A motor under a load: the 12 numbers of a motor as in `axial_motor`, then duty, back-emf, V, and its slope, V/A.
MOTOR, LOADED = 12, 15
MOST_POINTS = 12
"""Points of a curve at most."""


@native("out")
def steady_currents(cases: Float64[Array, "count 15"], out: Float64[Array, "count"]) -> None:
    """Fill the steady root of (17), A.

    Args:
        cases: motors under loads, (n, `LOADED`).
        out: to be filled, (n,): negative where the load drives the motor, NaN where it does so beyond any root, or
            beyond what the battery's voltage allows.
    """


@native("out")
def windings(
    motors: Float64[Array, "count 12"], currents: Float64[Array, "count"], out: Float64[Array, "count 2"]
) -> None:
    """Fill R(|I|), ohm, and dR/d|I|, ohm/A, of motors (n, `MOTOR`) at currents, A."""


@native("out")
def curve_torques(
    curve: Float64[Array, "25"],
    coasting: Float64[Array, "count"],
    per_torque: Float64[Array, "count"],
    duty: float,
    out: Float64[Array, "count"],
) -> None:
    """Fill the torques of a motor with a curve in its own sense, N m.

    Args:
        curve: number of points, then rate, rad/s, and torque, N m, of each; of 25 numbers.
        coasting: rate of the joint without a torque, rad/s, (n,).
        per_torque: what a torque adds to it, 1/(N m s), (n,).
        duty: 0 to 1; scales the torques.
        out: to be filled, (n,).
    """
