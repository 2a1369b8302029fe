"""Where a robot touches the wall of its tube: columns of sites, wire and stations, and what carries there.

The equations stand in csrc/contacts.c and csrc/dry_friction.c.
"""

from __future__ import annotations

from spirillum.kernels.native import Array, Float64, native

# A site on body or coupling: ring of radius rho (semi-axis b along the motor axis) at x, with a ball of radius beta.
SITE_X, SITE_RING, SITE_HALF, SITE_BALL, SITE_ROTOR = 0, 1, 2, 3, 4  # m; last: 1 where it turns with the rotor
SITE = 5

# The wire: radius and amplitude, m; taper over length, 1/m (0: none); h k, rad/m (0: no helix of one size); x of the
# root and axial length, m.
WIRE_RADIUS, AMPLITUDE, TAPER, HAND_K, ROOT, LENGTH = 0, 1, 2, 3, 4, 5
WIRE = 6

# A station along a wire: distance from the root, m; its place at phase 0, m, and the derivative of that by it, both
# (x, y, z); the angle of its wire, rad.
STATION_XI, STATION_POINT, STATION_SLOPE, STATION_TURN = 0, 1, 4, 7
STATION = 8


@native()
def asperity_load(gap: float, height: float, load: float) -> float:
    """Return N(h), N, of asperities of a height, m, with a load at half of it, N."""


@native()
def asperity_energy(gap: float, height: float, load: float) -> float:
    """Return E(h), J."""


@native("normal", "point", "j")
def ring_gap(
    y: Float64[Array, "19"],  # the state
    rotation: Float64[Array, "3 3"],  # body axes to lab
    radius: float,  # R of the tube
    site: Float64[Array, "5"],  # row of sites
    normal: Float64[Array, "3"],  # result, the wall's normal at the nearest point in body axes
    point: Float64[Array, "3"],  # result, the touching point from the origin in body axes, m
    j: Float64[Array, "7"],  # result, (7,): the gap closes at j.q at the rates q
) -> float:
    """Return the gap between the wall and one site, m."""


@native("normal", "point", "j")
def crest(
    y: Float64[Array, "19"],
    rotation: Float64[Array, "3 3"],
    radius: float,
    wire: Float64[Array, "6"],
    stations: Float64[Array, "count 8"],
    bracket: Float64[Array, "3"],
    normal: Float64[Array, "3"],
    point: Float64[Array, "3"],
    j: Float64[Array, "7"],
) -> float:
    """Return the gap between the wall and the wire where it is farthest from the tube's axis, m.

    Arguments as of `ring_gap`; `bracket` is where along the wire to look: from, first guess, to; m from the root;
    `stations` are those that it spans, two or three.
    """


@native("force")
def crest_film(
    y: Float64[Array, "19"],  # state, as of `ring_gap`
    rotation: Float64[Array, "3 3"],
    radius: float,
    wire: Float64[Array, "6"],  # columns of the wire
    stations: Float64[Array, "count 8"],  # all those of one wire
    bracket: Float64[Array, "3"],  # as of `crest`
    viscosity: float,  # Pa s
    bound: float,  # p_c, Pa
    rates: Float64[Array, "7"],  # q
    force: Float64[Array, "7"],  # result against the rates, N and N m
) -> float:
    """Return the gap as `crest` does, and write the forces of the lubrication film there."""


@native("q", "left")
def balanced(
    a: Float64[Array, "7 7"],  # A
    force: Float64[Array, "7"],  # f
    loads: Float64[Array, "count"],  # mu_c N_c, at most 32
    rows: Float64[Array, "count 2 7"],  # J_c, sliding velocities along the tube and around it per rate
    slow: float,  # v_r, m/s
    q: Float64[Array, "7"],  # first guess, and the result
    left: Float64[Array, "7"],  # result, the remaining forces
) -> float:
    """Find the rates q at which A q and dry friction balance the force; return the rest of the forces, over them."""
