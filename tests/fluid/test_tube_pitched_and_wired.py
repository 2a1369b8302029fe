"""Pitched bodies and wires in a tube: a turned sphere, no slip of the whole flow, wires on the axis and at the wall."""

from functools import lru_cache
from typing import Any, Literal

import numpy as np
import pytest

from spirillum.fluid.algebra import axis_rotation
from spirillum.fluid.tube.confined import UnitMotions, solve_unit_motions
from spirillum.fluid.tube.reduced import Reduced, _unbounded
from spirillum.fluid.tube.solids import Fineness, Solids
from spirillum.fluid.tube.wall import point_reflection, waves_between
from spirillum.fluid.wire.interaction import Discretisation, solve
from spirillum.fluid.wire.sources import Sources
from spirillum.fluid.wire.stokeslets import Wire, stations_along, wire_system
from spirillum.kernels.core import force_matrix
from spirillum.robot.outline import Arc, Outline, body_outline
from spirillum.robot.tube_pose import TubePose


def ball(x: float, radius: float) -> Outline:
    return Outline((Arc((x, 0.0), (radius, radius), (0.0, np.pi)),), ())


def capsule() -> Outline:
    return body_outline("capsule", 0.9, 1.75, 0.0, "hemisphere", "flat")


def straight(x: float, length: float, radius: float) -> Wire:
    along = np.linspace(x - 0.5 * length, x + 0.5 * length, 60)
    return stations_along(np.stack([along, 0 * along, 0 * along], axis=1), radius)


def coil(radius: float = 0.05) -> Wire:
    """A short coil behind a ball of radius 0.4, in body axes."""
    xi = np.linspace(0.0, 0.8, 140)
    turn = 2 * np.pi * xi / 0.8
    return stations_along(np.stack([-0.7 - xi, 0.15 * np.cos(turn), 0.15 * np.sin(turn)], axis=1), radius)


def turned(wire: Wire, phase: float) -> Wire:
    turn = axis_rotation(np.array([phase]))[0]
    return Wire(wire.points @ turn.T, wire.tangents @ turn.T, wire.lengths, wire.radius)


def near(wire: Wire) -> np.ndarray:
    return np.stack([wire.points[:, 0], np.hypot(*wire.points[:, 1:].T), np.full(len(wire.points), wire.blob)], axis=1)


@lru_cache(maxsize=8)
def swimmer(pitch: float, accuracy: Literal["standard", "high"]) -> UnitMotions:
    wire = coil()
    solids = Solids([(ball(0.0, 0.4), 0)], TubePose(1.0, 0.1, pitch), Fineness(accuracy, tolerance=1e-4), near(wire))
    return solve_unit_motions(solids, [(wire, 1)])


def thirteen(found: UnitMotions, size: int = 12) -> np.ndarray:
    """R, load and drag over the roots of the diagonal."""
    whole = np.empty((size + 1, size + 1))
    whole[:size, :size], whole[size, size] = found.matrix[:size, :size], found.drag
    whole[:size, size] = whole[size, :size] = found.load[:size]
    scale = np.sqrt(np.diag(whole))
    normal: np.ndarray = whole / np.outer(scale, scale)
    return normal


def in_tube_axes(pitch: float) -> np.ndarray:
    """Twists and wrenches of a body that is pitched nose up, from its axes to the tube's."""
    c, s = np.cos(pitch), np.sin(pitch)
    turn = np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]])
    return np.kron(np.eye(2), turn)


@pytest.mark.parametrize("pitch", [pytest.param(1e-9, marks=pytest.mark.slow), 0.4])
def test_a_pitched_sphere_is_a_sphere(pitch: float) -> None:
    """Rings about a pitched axis, other waves and other modes: in the tube's axes the same matrix and load."""
    fineness = Fineness(tolerance=1e-4, order=8)
    level, pitched = (
        solve_unit_motions(Solids([(ball(0.0, 0.4), 0)], TubePose(1.0, 0.4, p), fineness), []) for p in (0.0, pitch)
    )
    turn = in_tube_axes(pitch)
    matrix = turn @ pitched.matrix[:6, :6] @ turn.T
    scale = np.sqrt(np.diag(level.matrix)[:6])
    np.testing.assert_allclose(
        matrix / np.outer(scale, scale), level.matrix[:6, :6] / np.outer(scale, scale), atol=2e-5
    )
    load = turn @ pitched.load[:6]
    np.testing.assert_allclose(load / scale, level.load[:6] / scale, atol=1e-5 * abs(level.load[0] / scale[0]))
    np.testing.assert_allclose(pitched.drag, level.drag, rtol=1e-5)
    assert pitched.asymmetry < 1e-5


@pytest.mark.parametrize(
    ("offset", "tolerance", "allowed"),
    [
        (0.2, 1e-2, 2e-7),
        (0.45, 1e-2, 1e-4),
        pytest.param(0.2, 1e-3, 1e-8, marks=pytest.mark.slow),
        pytest.param(0.53, 1e-2, 1e-4, marks=pytest.mark.slow),
        pytest.param(0.53, 4e-3, 2e-4, marks=pytest.mark.slow),
    ],
)
def test_a_capsule_that_is_hardly_pitched_is_level(offset: float, tolerance: float, allowed: float) -> None:
    """On rings that meet every wave by themselves, however coarsely waves are cut; also over a thin film."""
    level, hardly = (
        solve_unit_motions(Solids([(capsule(), 0)], TubePose(1.0, offset, pitch), Fineness(tolerance=tolerance)), [])
        for pitch in (0.0, 1e-9)
    )
    np.testing.assert_allclose(thirteen(hardly, 6), thirteen(level, 6), atol=allowed)
    np.testing.assert_allclose(np.diag(hardly.matrix)[:6], np.diag(level.matrix)[:6], rtol=2.0 * allowed)


def test_a_pitched_capsule() -> None:
    """Symmetric, positive, even in the pitch on the axis."""
    fineness = Fineness(tolerance=1e-3)
    up, down = (
        solve_unit_motions(Solids([(capsule(), 0)], TubePose(1.0, 0.0, pitch), fineness), []) for pitch in (0.12, -0.12)
    )
    assert np.linalg.eigvalsh(thirteen(up, 6))[0] > 0.002
    assert up.asymmetry < 2e-4
    mirror = np.array([1, 1, -1, -1, -1, 1, 1.0])  # z to -z: the nose falls instead of rising
    np.testing.assert_allclose(thirteen(down, 6), mirror[:, None] * thirteen(up, 6) * mirror, atol=1e-8)
    assert abs(thirteen(up, 6)[0, 2]) > 0.01  # what moves along its pitched axis drifts


def velocities(found: UnitMotions, targets: np.ndarray, pose: TubePose, blob2: np.ndarray) -> np.ndarray:
    """Of everything in the tube, summed as point forces: modes become tractions on rings, the wall reflects them.

    Stations of wires, squares of blob radii `blob2`, feel others as those feel them; other targets have 0.

    Returns (n, 3, 13) at points on the robot's axes (x along, y up, z to the right), viscosity 1.
    """
    parts, solids = found.strengths, found.strengths.solids
    assert solids is not None
    panels, count = solids.panels, 24
    theta = 2 * np.pi * np.arange(count) / count
    densities = np.zeros((panels.size, 3, count, 13))  # (x, rho, theta)
    for rows, tractions in zip(solids.rows, parts.tractions, strict=True):
        for m, (start, stop) in enumerate(zip(rows.starts[:-1], rows.starts[1:], strict=True)):
            modes = np.zeros((3 * panels.size, 13))
            modes[rows.of_mode[m]] = tractions[start:stop]
            modes = modes.reshape(panels.size, 3, 1, 13)
            cos, sin = np.cos(m * theta)[:, None], np.sin(m * theta)[:, None]
            like, other = (cos, -sin) if rows.parity == 0 else (-sin, -cos)
            densities[:, :2] += modes[:, :2] * like
            densities[:, 2] += modes[:, 2] * other
    densities *= panels.area[:, None, None, None] * 2 * np.pi / count
    c, s = np.cos(theta)[:, None], np.sin(theta)[:, None]
    along, radial, around = np.moveaxis(densities, 1, 0)
    forces = np.stack([along, radial * c - around * s, radial * s + around * c], axis=2).reshape(-1, 3, 13)
    x, rho = (np.repeat(v.ravel(), count) for v in (panels.x, panels.rho))
    sources = np.stack(
        [x, rho * np.tile(np.cos(theta), panels.size), rho * np.tile(np.sin(theta), panels.size)], axis=1
    )
    e2 = np.zeros(len(sources))
    for wire in parts.wires:
        sources = np.concatenate([sources, wire.points])
        e2 = np.concatenate([e2, np.full(len(wire.points), wire.blob**2)])
    forces = np.concatenate([forces, parts.forces.reshape(-1, 3, 13)])
    d = targets[:, None] - sources
    e2 = np.maximum(e2, blob2[:, None])
    r = np.sqrt(np.sum(d**2, axis=-1) + e2)
    dot = np.einsum("tsi,sik->tsk", d, forces)
    total = np.einsum("ts,sik->tik", 1 / r + e2 / r**3, forces) + np.einsum("tsi,ts,tsk->tik", d, r**-3, dot)
    placed = [pose.placed(points) for points in (targets, sources)]
    lowest = [pose.radius - np.max(np.hypot(points[:, 1], points[:, 2])) for points in placed]
    both = np.concatenate(placed)
    waves = waves_between(pose.radius, float(np.ptp(both[:, 0])), float(np.mean(lowest)), 1e-5)
    turned = np.einsum("ij,sjk->sik", pose.rotation, forces)
    back = _reflected(placed[0], placed[1], turned, waves)
    total -= np.einsum("ij,tik->tjk", pose.rotation, back)
    result: np.ndarray = total / (8 * np.pi)
    return result


def _reflected(targets: np.ndarray, sources: np.ndarray, forces: np.ndarray, waves: Any) -> np.ndarray:
    """The wall's part from many sources, by the symmetric matrix between some of them and the targets at a time."""
    total = np.zeros((len(targets), 3, forces.shape[-1]))
    for chunk in np.array_split(np.arange(len(sources)), max(1, len(sources) // 100)):
        both = point_reflection(np.concatenate([targets, sources[chunk]]), waves)
        some = 3 * len(targets)
        total += (both[:some, some:] @ forces[chunk].reshape(-1, forces.shape[-1])).reshape(total.shape)
    return total


@pytest.mark.parametrize("pitch", [0.0, 0.15])
def test_no_slip_of_the_whole_flow(pitch: float) -> None:
    """Inside a rigid solid the flow of its tractions is its own motion, and at the wire's stations the wire's.

    The flow is summed in space, with no modes and no elimination. In the flow that is held back it is that flow.
    """
    found = swimmer(pitch, "standard")
    pose = found.strengths.solids.pose  # type: ignore[union-attr]
    wire = found.strengths.wires[0]
    picked = wire.points[:: max(1, len(wire.points) // 6)]
    inside = 0.16 * np.array([[0, 0, 0], [1.0, 0, 0], [0, -1, 0], [0.3, 0.4, 0.8], [-0.6, 0.2, -0.7]])
    targets = np.concatenate([inside, picked])
    wanted = np.zeros((len(targets), 3, 13))
    for rows, first in ((slice(0, len(inside)), 0), (slice(len(inside), None), 6)):
        for i in range(3):
            unit = np.eye(3)[i]
            wanted[rows, :, first + i] = unit
            wanted[rows, :, first + 3 + i] = np.cross(unit, targets[rows])
    placed = pose.placed(targets)
    speed = 2 - 2 * np.sum(placed[:, 1:] ** 2, axis=1)
    wanted[:, :, 12] = speed[:, None] * pose.rotation[0]
    blob2 = np.repeat([0.0, wire.blob**2], [len(inside), len(picked)])
    errors = np.abs(velocities(found, targets, pose, blob2) - wanted)
    assert np.max(errors[: len(inside)]) < 2e-4
    assert np.max(errors[len(inside) :]) < 2e-3  # the line of forces is corrected for the wire's thickness


@pytest.mark.parametrize("accuracy", ["standard", "high"])
def test_reciprocity_and_power_with_a_wire(accuracy: Literal["standard", "high"]) -> None:
    for pitch in (0.0, 0.15):
        found = swimmer(pitch, accuracy)
        assert found.asymmetry < 1e-6
        assert np.linalg.eigvalsh(thirteen(found))[0] > 0
        np.testing.assert_array_equal(found.matrix, found.matrix.T)


@pytest.mark.parametrize("accuracy", ["standard", "high"])
def test_in_a_wide_tube_nothing_is_confined(accuracy: Literal["standard", "high"]) -> None:
    """R to infinity: the matrix of unbounded fluid, by 1/R."""
    wire, solid = coil(), ball(0.0, 0.4)
    free = solve([(solid, 0)], [(wire, 1)], Discretisation(accuracy, order=8, tolerance=1e-7)).matrix
    scale = np.sqrt(np.outer(np.diag(free), np.diag(free)))
    errors = []
    for radius in (50.0, 200.0):
        found = solve_unit_motions(
            Solids([(solid, 0)], TubePose(radius, 0.0), Fineness(accuracy, tolerance=1e-6), near(wire)), [(wire, 1)]
        )
        errors.append(np.max(np.abs(found.matrix - free) / scale))
    assert errors[1] < 0.01
    np.testing.assert_allclose(errors[0] / errors[1], 4.0, rtol=0.1)


def slopes(
    radius: float, offset: float, shorter: float = 4.0, tolerance: float = 1e-5
) -> tuple[UnitMotions, UnitMotions]:
    """Straight wires, one longer by 1, at an offset below the axis of a tube of radius 1, far from a ball."""
    short, long = (
        solve_unit_motions(
            Solids([(ball(-3.0 - 0.5 * length, 0.3), 0)], TubePose(1.0, 0.0), Fineness(tolerance=tolerance)),
            [(straight(0.0, length, radius), 1)],
            offset,
        )
        for length in (shorter, shorter + 1.0)
    )
    return short, long


def no_gradient(short: UnitMotions, long: UnitMotions) -> float:
    """Axial drag per length at no pressure gradient."""
    drag, load = long.matrix[6, 6] - short.matrix[6, 6], long.load[6] - short.load[6]
    found: float = drag - load**2 / (8 * np.pi + long.drag - short.drag)
    return found


def test_a_thin_wire_on_the_axis() -> None:
    """Per length, with no pressure gradient, 2 pi/log(R/b), and with no flux 2 pi/(log(R/b) - (R^2 - b^2)/(R^2 + b^2)).

    Across, a thin cylinder in a tube has 4 pi/(log(R/b) - 1). A line of forces leaves parts in (b/R)^2.
    """
    errors = []
    for b in (0.08, 0.04):
        short, long = slopes(b, 0.0)
        np.testing.assert_allclose(no_gradient(short, long) * np.log(1 / b), 2 * np.pi, rtol=0.1 * b**2 + 1e-4)
        drag, across = (long.matrix[i, i] - short.matrix[i, i] for i in (6, 7))
        errors.append(drag * (np.log(1 / b) - (1 - b * b) / (1 + b * b)) / (2 * np.pi) - 1)
        np.testing.assert_allclose(across * (np.log(1 / b) - 1), 4 * np.pi, rtol=3e-3)
    assert 0 < errors[1] < 0.002
    assert errors[0] < 0.01
    assert errors[0] > 3 * errors[1]


@pytest.mark.parametrize(
    ("ratio", "error"),
    [
        *(pytest.param(*case, marks=pytest.mark.slow) for case in ((8.0, 1e-3), (4.0, 2e-3), (3.0, 3e-3), (2.0, 7e-3))),
        (1.76, 0.012),
    ],
)
def test_a_wire_along_the_glass(ratio: float, error: float) -> None:
    """Its axis 8 to 1.76 radii from the wall, per length: 2 pi/arccosh((b^2 + R^2 - e^2)/(2 b R))."""
    b = 0.04
    offset = 1.0 - ratio * b
    along = 2 * np.pi / np.arccosh((b**2 + 1 - offset**2) / (2 * b))
    np.testing.assert_allclose(no_gradient(*slopes(b, offset, 2.0, 1e-4)), along, rtol=error)


@pytest.mark.slow
def test_a_wire_near_the_glass_against_a_cylinder_resolved() -> None:
    """Across the tube, sideways and towards the wall, 2 radii from it: two long capsules and two long wires."""
    b, offset = 0.08, 0.84
    short, long = slopes(b, offset)
    bodies = [body_outline("capsule", 2 * b, length, 0.0, "hemisphere", "hemisphere") for length in (2.0, 3.0)]
    fineness = Fineness(tolerance=1e-2)
    solid = [solve_unit_motions(Solids([(body, 0)], TubePose(1.0, offset), fineness), []).matrix for body in bodies]
    for i, error in ((0, 0.04), (1, 0.07), (2, 0.15)):
        wanted = solid[1][i, i] - solid[0][i, i]
        np.testing.assert_allclose(long.matrix[6 + i, 6 + i] - short.matrix[6 + i, 6 + i], wanted, rtol=error)


def test_a_lowered_tail_turns_about_its_own_axis() -> None:
    """The surrogate of a dropped tail: a wire that is built lower, but for the axis of its rotation."""
    wire, solid = coil(), ball(0.0, 0.4)
    drop = np.array([0.0, 0.0, -0.3])
    lowered = Wire(wire.points + drop, wire.tangents, wire.lengths, wire.radius)
    solids = Solids([(solid, 0)], TubePose(1.0, 0.2), Fineness(tolerance=1e-4), near(wire))
    dropped, built = solve_unit_motions(solids, [(wire, 1)], 0.3), solve_unit_motions(solids, [(lowered, 1)])
    shift = np.eye(12)
    shift[6:9, 9:] = [[0, -drop[2], drop[1]], [drop[2], 0, -drop[0]], [-drop[1], drop[0], 0]]
    wanted = shift.T @ built.matrix @ shift
    scale = np.sqrt(np.outer(np.diag(wanted), np.diag(wanted)))
    np.testing.assert_allclose(dropped.matrix / scale, wanted / scale, atol=1e-6)
    level = solve_unit_motions(solids, [(wire, 1)])
    assert dropped.matrix[8, 8] > 1.1 * level.matrix[8, 8]  # nearer to the wall


LEVEL, PITCHED, YAWED = TubePose(1.0, 0.2), TubePose(1.0, 0.15, 0.1), TubePose(1.0, 0.15, -0.05, yaw=0.1)


@pytest.mark.parametrize(
    ("accuracy", "pose"),
    [
        ("high", LEVEL),
        ("standard", PITCHED),
        ("standard", YAWED),
        *(
            pytest.param(*case, marks=pytest.mark.slow)
            for case in (("standard", LEVEL), ("high", YAWED), ("high", PITCHED))
        ),
    ],
)
def test_reduced_basis_against_all_fields(pose: TubePose, accuracy: Literal["standard", "high"]) -> None:
    """What a coil sends to a body that it nearly touches, at a phase that is not in the basis: field by field."""
    solids = Solids([(ball(0.0, 0.4), 0)], pose, Fineness(accuracy, tolerance=1e-4), near(coil()))
    wire = turned(coil(), 1.0)
    found = solve_unit_motions(solids, [(wire, 1)])
    inner = Wire(
        wire.points[:, [0, 2, 1]] * [1, 1, -1], wire.tangents[:, [0, 2, 1]] * [1, 1, -1], wire.lengths, wire.radius
    )
    system = wire_system([(inner, 1)], accuracy)
    sources = Sources.of((inner,), system)
    kept = solids.kept["reduced"]
    assert isinstance(kept, list)
    (reduced,) = kept
    assert isinstance(reduced, Reduced)
    placed = pose.placed(inner.points)
    along = np.kron(np.eye(len(placed)), pose.rotation)
    away = float(np.min(pose.distances(sources.x, sources.rho)))
    wall = solids.rings.sent(reduced.waves, solids.systems, placed, along, away)
    free: list[list[np.ndarray]] = [[], []]
    for m, cross in enumerate(_unbounded(solids, sources)):
        for family, turn in zip(free, (np.real, np.imag), strict=True):
            family.append(sources.columns(cross * turn(sources.turn(m, cross.shape[1]))))
    fields = [rows.gathered(family) for rows, family in zip(solids.rows, free, strict=True)]
    fields = [np.concatenate(fields)] if len(wall) == 1 else fields
    for values, reflected in zip(fields, wall, strict=True):
        values[:, : reflected.shape[1]] -= reflected
    coefficients = reduced.coefficients(sources, placed, along)
    for number, (values, few, answers) in enumerate(zip(fields, coefficients, reduced.answers, strict=True)):
        tractions = solids.solve_system(number, values)
        dual = np.concatenate([family.dual for family in solids.systems[number]])
        work = values.T @ (dual[:, None] * tractions)
        scale = np.sqrt(np.diag(work).max())
        np.testing.assert_allclose(few.T @ answers.work @ few / scale**2, work / scale**2, atol=1e-6)
    assert found.asymmetry < 1e-5


def test_a_wire_alone_against_a_dense_matrix() -> None:
    """No solids, or one far away: forces from the matrix of blobs and reflections, solved directly."""
    wire = straight(-1.3, 1.2, 0.02)
    drag = []
    for solids in ([], [(ball(4.0, 0.4), 0)]):
        found = solve_unit_motions(Solids(solids, TubePose(1.0, 0.0), Fineness(tolerance=1e-8)), [(wire, 1)])
        drag.append(found.matrix[6:9, 6:9])
    waves = waves_between(1.0, float(np.ptp(wire.points[:, 0])), 1.0, 1e-8)
    count = len(wire.points)
    blobs = np.empty((count, 3, count, 3))
    force_matrix(wire.points, np.full(count, wire.blob**2), blobs)
    mobility = blobs.reshape(3 * count, -1) - point_reflection(wire.points, waves)
    rows = np.tile(np.eye(3), (len(wire.points), 1))
    wanted = 8 * np.pi * rows.T @ np.linalg.solve(mobility, rows)
    np.testing.assert_allclose(drag[0], wanted, atol=1e-3 * wanted[0, 0])  # thickness: (b/2R)^2
    np.testing.assert_allclose(drag[1], drag[0], atol=1e-6 * wanted[0, 0])
