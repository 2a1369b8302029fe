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
    points: Float64[Array, "n 3"],
    e2: Float64[Array, " n"],
    moments: Float64[Array, "n q 3 3"],
    velocities: Float64[Array, "n 3 n q"],
    gradients: Float64[Array, "n q n q"],
) -> None:
    """Fill in what unit first moments at points do.

    Args:
        points: m.
        e2: square of the blob radius of each point.
        moments: trace-free tensors of the moments at each point, force by displacement.
        velocities: to be filled.
        gradients: of the velocities along the moments, symmetric; to be filled.
    """


@native("a", "b")
def ring_integrals(
    dx: float,
    delta: float,
    rho: float,
    rho_s: float,
    e2: float,
    a: Float64[Array, " count"],
    b: Float64[Array, " count"],
) -> None:
    """Fill a[n] = int cos(n phi)/r dphi and b[n] = int cos(n phi)/r^3 dphi.

    Args:
        dx: axial distance of the rings.
        delta: rho - rho_s, known better than the difference where the rings are close.
        rho: radius of one ring, above 0.
        rho_s: radius of the other, above 0.
        e2: square of the blob radius; rings that coincide need one.
        a: to be filled, at least 2.
        b: to be filled.
    """


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
    x: Float64[Array, " t"],
    rho: Float64[Array, " t"],
    own: Int64[Array, " t"],
    x_p: Float64[Array, "panels p"],
    rho_p: Float64[Array, "panels p"],
    e2: float,
    nodes: Float64[Array, " p"],
    barycentric: Float64[Array, " p"],
    fine: Float64[Array, " f"],
    fine_weights: Float64[Array, " f"],
    weights: Float64[Array, " p"],
    blocks: Float64[Array, "modes t 3 panels p 3"],
) -> None:
    """Fill the velocities of every mode at rings, from a single layer on the panels of outlines.

    The density is interpolated between the panel's nodes and multiplied by the length of du, so that the integrals
    are over rho du.

    Args:
        x: targets.
        rho: targets.
        own: index of the node that a target is, panel by panel; -1 for a target off the outline.
        x_p: nodes of the panels.
        rho_p: nodes of the panels.
        e2: square of the blob radius.
        nodes: on [-1, 1].
        barycentric: weights of the nodes.
        fine: abscissas of a finer Gauss rule, for panels near a target.
        fine_weights: their weights.
        weights: Gauss weights of the nodes.
        blocks: to be filled.
    """


@native("out")
def wave_extensions(k: float, radius: float, rho: Float64[Array, " n"], out: Float64[Array, "n orders 3 3"]) -> None:
    """Fill in the velocities (X, u_rho, v) at rho for unit velocities at the radius.

    Args:
        k: wave number, above 0.
        radius: of the cylinder on which the waves are one.
        rho: where.
        out: to be filled.
    """


@native("layers")
def wall_layers(z: float, first: float, layers: Float64[Array, "orders 3 3"]) -> None:
    """Fill in the single layer S on a cylinder in unbounded fluid, in units of 4 pi R/(8 pi mu).

    Args:
        z: k times the radius R.
        first: K_1(z)/K_0(z).
        layers: velocities (X, u_rho, v) from densities (F, f_rho, g), symmetric; to be filled.
    """


@native("out")
def circle_waves(
    k: float,
    radius: float,
    reference: float,
    offset: float,
    theta: Float64[Array, " n"],
    out: Float64[Array, "2 3 n orders 3"],
) -> None:
    """Velocities (x, rho, theta) of even and odd waves in cylindrical components about a second, parallel axis.

    Args:
        k: wave number, above 0.
        radius: of the tube.
        reference: radius of the cylinder about the second axis.
        offset: of the second axis below the tube's.
        theta: angles about the second axis.
        out: to be filled: even, odd; component; point; order; wall component. u_x comes times i.
    """


@native("out")
def point_waves(
    k: float,
    radius: float,
    places: Float64[Array, "n 3"],
    first: int,
    out: Float64[Array, "orders 2 2 3 n 3"],
) -> None:
    """Velocities (x, y, z) of waves at points.

    Args:
        k: wave number, above 0.
        radius: of the tube.
        places: points about the tube's axis, in its axes.
        first: the first order p.
        out: to be filled: order; even, odd; real, imaginary part; wall component; point; component.
    """


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
    k: float,
    radius: float,
    places: Float64[Array, "n angles 3"],
    theta: Float64[Array, " angles"],
    rotation: Float64[Array, "3 3"],
    first: int,
    out: Float64[Array, "2 3 n orders 2 3 angles"],
) -> None:
    """Velocities (x, rho, theta) of waves on rings about a tilted axis, in cylindrical components about it.

    Args:
        k: wave number, above 0.
        radius: of the tube.
        places: points on the rings, about the tube's axis.
        theta: angles about the rings' axis.
        rotation: from the rings' axes to the tube's.
        first: the first order p.
        out: to be filled: even, odd; component; ring; order; real, imaginary part; wall component; angle.
    """


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
    block: Float64[Array, "m n"],
    columns: Int64[Array, " m"],
    rows: Int64[Array, " n"],
    scale: Float64[Array, " size"],
    matrix: Float64[Array, "size size"],
) -> None:
    """Subtract a block from rows and columns of a square matrix, times a number for each column of the matrix.

    Args:
        block: its columns, one after the other.
        columns: of the matrix.
        rows: of the matrix.
        scale: number of each column of the matrix.
        matrix: its columns, one after the other.
    """


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
    points: Float64[Array, "n 3"],
    x_p: Float64[Array, "panels p"],
    rho_p: Float64[Array, "panels p"],
    density: Complex128[Array, "panels p modes 3"],
    nodes: Float64[Array, " p"],
    barycentric: Float64[Array, " p"],
    fine: Float64[Array, " f"],
    fine_weights: Float64[Array, " f"],
    weights: Float64[Array, " p"],
    field: Float64[Array, "n 4"],
) -> None:
    """Add the flow of a single layer on panels.

    Args:
        points: where.
        x_p: nodes of the panels.
        rho_p: nodes of the panels.
        density: complex modes (f_x, f_rho, g) ds/du on the nodes.
        nodes: on [-1, 1].
        barycentric: weights of the nodes.
        fine: abscissas of a finer Gauss rule, for panels near a point.
        fine_weights: their weights.
        weights: Gauss weights of the nodes.
        field: velocity and pressure to add to.
    """


@native("steps", "amplitudes", rows="waves")
def wave_amplitudes(
    wave_k: Float64[Array, " waves"],
    weights: Float64[Array, " waves"],
    orders: Int64[Array, " waves"],
    bessel: Float64[Array, " waves"],
    radius: float,
    rho: Float64[Array, " columns"],
    angle: Float64[Array, " columns"],
    steepest: Float64[Array, " columns"],
    first: Int64[Array, " edges"],
    x: Float64[Array, " n"],
    forces: Float64[Array, "n 2 3"],
    steps: Float64[Array, "waves most"],
    amplitudes: Float64[Array, "waves 2 2 most 3"],
) -> None:
    """Add up the amplitudes of the flows of which each wave of the wall's reflection consists.

    Sources stand in columns along the tube. Of the forces the even part moves even waves, the odd part odd ones.

    Args:
        wave_k: k of each wave.
        weights: of the nodes in k.
        orders: numbers of orders p.
        bessel: K_1/K_0 at k radius.
        radius: of the tube.
        rho: distance of each column from the axis.
        angle: polar angle of each column.
        steepest: wave that matters for each column.
        first: number of the first source of each column, and of all sources, (columns + 1,).
        x: of the sources.
        forces: even and odd part, along x, rho and theta.
        steps: to be filled with I_{p+1}/I_p at the wall.
        amplitudes: zeros, to be filled: even, odd; real, imaginary; order; flow.
    """


@native("field", rows="n")
def add_waves(
    points: Float64[Array, "n 3"],
    steepest: Float64[Array, " n"],
    wave_k: Float64[Array, " waves"],
    orders: Int64[Array, " waves"],
    radius: float,
    steps: Float64[Array, "waves most"],
    amplitudes: Float64[Array, "waves 2 2 most 3"],
    field: Float64[Array, "n 4"],
) -> None:
    """Add velocity (times 8 pi mu) and pressure (times 8 pi) of waves.

    Args:
        points: (x, y, z) about the tube's axis, no farther from it than the radius.
        steepest: wave from which on nothing is added at each point; they are faded out towards it.
        wave_k: k of each wave.
        orders: numbers of orders p.
        radius: of the tube.
        steps: of `wave_amplitudes`.
        amplitudes: of `wave_amplitudes`.
        field: velocity (x, y, z) and pressure to add to.
    """
