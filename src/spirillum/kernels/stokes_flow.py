"""Stokes flow: regularised Stokeslets, rings and panels, waves in a tube, and the fields that they make.

The kernel is that of Cortez (SIAM J. Sci. Comput. 23:1204, 2001); factors 1/(8 pi mu) are left to the caller. A pair of
points takes the mean of the squares e2 of their blob radii. See csrc/blobs.c.

A ring carries a force density (f_x, f_rho, f_theta) that varies as exp(i m theta); with f_theta = i g and u_theta = i v
the 3x3 block between (f_x, f_rho, g) and the velocities (u_x, u_rho, v) at another ring is real. The Stokeslet is
regularised where e > 0; the factor 1/(8 pi mu) is left to the caller. A ring may have shrunk to the axis.
See csrc/rings.c, and csrc/panels.c for panels of an outline.

The wall's reflection of a force is -U S U', with the extension U from the wall to target and source, and the single
layer S of a cylinder in unbounded fluid. With f_theta = i g, u_theta = i v, f_x = i F and u_x = i X all matrices are
real. The even wave of order p has X and u_rho as cos(p theta), the odd one as -sin(p theta). See csrc/tube_waves.c.

Fields come without factors: velocity times 8 pi mu, pressure times 8 pi. All cores share the points; see csrc/field.c.

Fields in a tube add these waves: csrc/tube_field.c.
"""

from __future__ import annotations

from spirillum.kernels.native import Array, Complex128, Float32, Float64, Int64, native


@native("matrix")
def force_matrix(points: Float64[Array, "n 3"], e2: Float64[Array, " n"], matrix: Float64[Array, "n 3 n 3"]) -> None:
    """Fill in the velocities at points from unit forces at the same points, symmetric."""


@native("velocities", "gradients")
def moment_matrices(
    points: Float64[Array, "n 3"],  # m
    e2: Float64[Array, " n"],  # square of the blob radius of each point
    moments: Float64[Array, "n q 3 3"],  # trace-free tensors of the moments at each point, force by displacement
    velocities: Float64[Array, "n 3 n q"],
    gradients: Float64[Array, "n q n q"],  # of the velocities along the moments, symmetric; to be filled
) -> None:
    """Fill in what unit first moments at points do."""


@native("a", "b")
def ring_integrals(
    dx: float,  # axial distance of the rings
    delta: float,  # rho - rho_s, known better than the difference where the rings are close
    rho: float,  # radius of one ring, above 0
    rho_s: float,  # radius of the other, above 0
    e2: float,  # square of the blob radius; rings that coincide need one
    a: Float64[Array, " count"],  # to be filled, at least 2
    b: Float64[Array, " count"],
) -> None:
    """Fill a[n] = int cos(n phi)/r dphi and b[n] = int cos(n phi)/r^3 dphi."""


@native("blocks")
def ring_blocks(
    x: Float64[Array, " t"],
    rho: Float64[Array, " t"],
    x_s: Float64[Array, " s"],
    rho_s: Float64[Array, " s"],
    e2: float,
    blocks: Float64[Array, "modes t 3 s 3"],
) -> None:
    """Fill the blocks between all rings of two sets, from the sources (x_s, rho_s) to the targets (x, rho)."""


@native("blocks")
def layer_blocks(
    x: Float64[Array, " t"],  # targets
    rho: Float64[Array, " t"],  # targets
    own: Int64[Array, " t"],  # index of the node that a target is, panel by panel; -1 for a target off the outline
    x_p: Float64[Array, "panels p"],  # nodes of the panels
    rho_p: Float64[Array, "panels p"],  # nodes of the panels
    e2: float,  # square of the blob radius
    nodes: Float64[Array, " p"],  # on [-1, 1]
    barycentric: Float64[Array, " p"],  # weights of the nodes
    fine: Float64[Array, " f"],  # abscissas of a finer Gauss rule, for panels near a target
    fine_weights: Float64[Array, " f"],  # their weights
    weights: Float64[Array, " p"],  # Gauss weights of the nodes
    blocks: Float64[Array, "modes t 3 panels p 3"],
) -> None:
    """Fill the velocities of every mode at rings, from a single layer on the panels of outlines.

    The density is interpolated between the panel's nodes and multiplied by the length of du, so that the integrals
    are over rho du.
    """


@native("out")
def wave_extensions(
    k: float,  # wave number, above 0
    radius: float,  # of the cylinder on which the waves are one
    rho: Float64[Array, " n"],  # where
    out: Float64[Array, "n orders 3 3"],
) -> None:
    """Fill in the velocities (X, u_rho, v) at rho for unit velocities at the radius."""


@native("layers")
def wall_layers(
    z: float,  # k times the radius R
    first: float,  # K_1(z)/K_0(z)
    # velocities (X, u_rho, v) from densities (F, f_rho, g), symmetric; to be filled
    layers: Float64[Array, "orders 3 3"],
) -> None:
    """Fill in the single layer S on a cylinder in unbounded fluid, in units of 4 pi R/(8 pi mu)."""


@native("out")
def circle_waves(
    k: float,  # wave number, above 0
    radius: float,  # of the tube
    reference: float,  # radius of the cylinder about the second axis
    offset: float,  # of the second axis below the tube's
    theta: Float64[Array, " n"],  # angles about the second axis
    # to be filled: even, odd; component; point; order; wall component. u_x comes times i
    out: Float64[Array, "2 3 n orders 3"],
) -> None:
    """Velocities (x, rho, theta) of even and odd waves in cylindrical components about a second, parallel axis."""


@native("out")
def point_waves(
    k: float,  # wave number, above 0
    radius: float,  # of the tube
    places: Float64[Array, "n 3"],  # points about the tube's axis
    first: int,  # the first order p
    # to be filled: order; even, odd; real, imaginary part; wall component; point; component
    out: Float64[Array, "orders 2 2 3 n 3"],
) -> None:
    """Velocities (x, y, z) of waves at points."""


@native("out")
def single_point_waves(
    k: float,
    radius: float,
    places: Float64[Array, "n 3"],
    first: int,
    out: Float32[Array, "orders 2 2 3 n 3"],
) -> None:
    """See `point_waves`; in single precision."""


@native("out")
def ring_waves(
    k: float,  # wave number, above 0
    radius: float,  # of the tube
    places: Float64[Array, "n angles 3"],  # points on the rings, about the tube's axis
    theta: Float64[Array, " angles"],  # angles about the rings' axis
    rotation: Float64[Array, "3 3"],  # from the rings' axes to the tube's
    first: int,  # the first order p
    # to be filled: even, odd; component; ring; order; real, imaginary part; wall component; angle
    out: Float64[Array, "2 3 n orders 2 3 angles"],
) -> None:
    """Velocities (x, rho, theta) of waves on rings about a tilted axis, in cylindrical components about it."""


@native("out")
def single_ring_waves(
    k: float,
    radius: float,
    places: Float64[Array, "n angles 3"],
    theta: Float64[Array, " angles"],
    rotation: Float64[Array, "3 3"],
    first: int,
    out: Float32[Array, "2 3 n orders 2 3 angles"],
) -> None:
    """See `ring_waves`; in single precision."""


@native("matrix")
def subtract_block(
    block: Float64[Array, "m n"],  # its columns, one after the other
    columns: Int64[Array, " m"],  # of the matrix
    rows: Int64[Array, " n"],  # of the matrix
    scale: Float64[Array, " size"],  # number of each column of the matrix
    matrix: Float64[Array, "size size"],  # its columns, one after the other
) -> None:
    """Subtract a block from rows and columns of a square matrix, times a number for each column of the matrix."""


@native("field", rows="n")
def add_blobs(
    points: Float64[Array, "n 3"],
    sources: Float64[Array, "s 3"],
    forces: Float64[Array, "s 3"],
    e2: Float64[Array, " s"],
    field: Float64[Array, "n 4"],
) -> None:
    """Add the flow of regularised Stokeslets to `field`, velocity and pressure; e2 are squares of the blob radii."""


@native("field", rows="n")
def add_moments(
    points: Float64[Array, "n 3"],
    sources: Float64[Array, "s 3"],
    moments: Float64[Array, "s 3 3"],
    e2: Float64[Array, " s"],
    field: Float64[Array, "n 4"],
) -> None:
    """Add the flow of first moments of forces, trace-free, force by displacement; e2 are squares of the blob radii."""


@native("field", rows="n")
def add_layer(
    points: Float64[Array, "n 3"],  # where
    x_p: Float64[Array, "panels p"],  # nodes of the panels
    rho_p: Float64[Array, "panels p"],  # nodes of the panels
    density: Complex128[Array, "panels p modes 3"],  # complex modes (f_x, f_rho, g) ds/du on the nodes
    nodes: Float64[Array, " p"],  # on [-1, 1]
    barycentric: Float64[Array, " p"],  # weights of the nodes
    fine: Float64[Array, " f"],  # abscissas of a finer Gauss rule, for panels near a point
    fine_weights: Float64[Array, " f"],  # their weights
    weights: Float64[Array, " p"],  # Gauss weights of the nodes
    field: Float64[Array, "n 4"],  # velocity and pressure to add to
) -> None:
    """Add the flow of a single layer on panels."""


@native("steps", "amplitudes", rows="waves")
def wave_amplitudes(
    wave_k: Float64[Array, " waves"],  # k of each wave
    weights: Float64[Array, " waves"],  # of the nodes in k
    orders: Int64[Array, " waves"],  # numbers of orders p
    bessel: Float64[Array, " waves"],  # K_1/K_0 at k radius
    radius: float,  # of the tube
    rho: Float64[Array, " columns"],  # distance of each column from the axis
    angle: Float64[Array, " columns"],  # polar angle of each column
    steepest: Float64[Array, " columns"],  # wave that matters for each column
    first: Int64[Array, " edges"],  # number of the first source of each column, and of all sources, (columns + 1,)
    x: Float64[Array, " n"],  # of the sources
    forces: Float64[Array, "n 2 3"],  # even and odd part, along x, rho and theta
    steps: Float64[Array, "waves most"],  # to be filled with I_{p+1}/I_p at the wall
    amplitudes: Float64[Array, "waves 2 2 most 3"],  # zeros, to be filled: even, odd; real, imaginary; order; flow
) -> None:
    """Add up the amplitudes of the flows of which each wave of the wall's reflection consists.

    Sources stand in columns along the tube. Of the forces the even part moves even waves, the odd part odd ones.
    """


@native("field", rows="n")
def add_waves(
    points: Float64[Array, "n 3"],  # (x, y, z) about the tube's axis, no farther from it than the radius
    steepest: Float64[Array, " n"],  # wave from which on nothing is added at each point; they are faded out towards it
    wave_k: Float64[Array, " waves"],  # k of each wave
    orders: Int64[Array, " waves"],  # numbers of orders p
    radius: float,  # of the tube
    steps: Float64[Array, "waves most"],  # of `wave_amplitudes`
    amplitudes: Float64[Array, "waves 2 2 most 3"],  # of `wave_amplitudes`
    field: Float64[Array, "n 4"],  # velocity (x, y, z) and pressure to add to
) -> None:
    """Add velocity (times 8 pi mu) and pressure (times 8 pi) of waves."""
