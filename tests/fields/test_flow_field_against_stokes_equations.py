"""Velocity and pressure around a robot against a sphere's exact flow, the Stokes equations, no slip, and the forces."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import spirillum as sp
from comparisons import flow_gradients
from spirillum.errors import InputError
from spirillum.fields.fluid_field import FlowField, flow_field
from spirillum.fluid.algebra import axis_rotation
from spirillum.fluid.registry import find_swimmer_model
from spirillum.fluid.wire.interaction import Discretisation, solve
from spirillum.robot.outline import Arc, Outline

MU = 3.5
BODY = np.array([0.01, 0.02, -0.01, 0.5, 1.0, -0.4])
ROTOR = np.array([0.01, -0.02, 0.015, 5.0, 1.0, 0.4])
PHASE = 0.7


@pytest.fixture(scope="module")
def moving(wide: Any) -> FlowField:
    """Body and rotor with unrelated twists."""
    return flow_field(wide, BODY, ROTOR, PHASE)


@pytest.fixture(scope="module")
def fine(batch_of: Callable[..., Any]) -> FlowField:
    """As before with one turn of the tail, at high accuracy."""
    return flow_field(batch_of(model__slender__accuracy="high", tail__length="25 mm"), BODY, ROTOR, PHASE)


def rigid(twist: np.ndarray, points: np.ndarray) -> np.ndarray:
    return twist[:3] + np.cross(twist[3:], points)


def outside(outline: Outline, distance: float, count: int = 25) -> np.ndarray:
    """Points at a distance outside of a surface, up to a fiftieth of a piece from its ends."""
    rng = np.random.default_rng(5)
    found = []
    for piece in outline.pieces:
        t = rng.uniform(0.02, 0.98, count)
        x, rho = piece.points(t)
        ahead, behind = piece.points(t + 1e-6), piece.points(t - 1e-6)
        tangent = np.stack([ahead[0] - behind[0], ahead[1] - behind[1]])
        tangent /= np.hypot(*tangent)
        x, rho = x + distance * tangent[1], rho - distance * tangent[0]
        theta = rng.uniform(0.0, 2 * np.pi, count)
        found.append(np.stack([x, rho * np.cos(theta), rho * np.sin(theta)], axis=1))
    return np.concatenate(found)


def sphere_alone(twist: np.ndarray, radius: float = 0.01) -> FlowField:
    outline = Outline((Arc((0.0, 0.0), (radius, radius), (0.0, np.pi)),), ())
    solution = solve([(outline, 0)], [], Discretisation(order=12))
    return FlowField(solution, (("body", outline),), np.concatenate([twist, np.zeros(6)]), 0.0, MU)


def test_exact_flow_of_a_sphere() -> None:
    """Stokes' flow of a sphere that moves, and the rotlet of one that turns, from its surface outwards."""
    a, field = 0.01, sphere_alone(BODY)
    rng = np.random.default_rng(1)
    x = rng.normal(size=(60, 3))
    x *= a * (1 + np.geomspace(1e-7, 100.0, 60))[:, None] / np.linalg.norm(x, axis=1, keepdims=True)
    r = np.linalg.norm(x, axis=1, keepdims=True)
    U, along = BODY[:3], x @ BODY[:3]
    exact = 0.75 * a * (U / r + x * along[:, None] / r**3) + 0.25 * a**3 * (U / r**3 - 3 * x * along[:, None] / r**5)
    exact += (a / r) ** 3 * np.cross(BODY[3:], x)
    velocity, pressure = field.fields(x)
    np.testing.assert_allclose(velocity, exact, atol=2e-7 * np.max(np.abs(exact)))
    stokes = 1.5 * MU * a * along / r[:, 0] ** 3
    np.testing.assert_allclose(pressure[10:], stokes[10:], atol=1e-5 * np.max(np.abs(stokes)))
    np.testing.assert_array_equal(field.velocity(x), velocity)
    np.testing.assert_array_equal(field.pressure(x), pressure)


@pytest.mark.parametrize("name", ["body", "coupling"])
def test_no_slip(moving: FlowField, name: str) -> None:
    """A millionth of the body's radius outside: mostly to 1e-4, worst next to edges and the thin film."""
    outline, twist = dict(moving.solids)[name], BODY if name == "body" else ROTOR
    points = outside(outline, 9e-9)
    points = points[~moving.inside(points)]  # the wire's end lies a little within its first station's reach
    slip = np.linalg.norm(moving.velocity(points) - rigid(twist, points), axis=1)
    slip /= np.max(np.linalg.norm(rigid(twist, points), axis=1))
    assert np.median(slip) < 1e-4
    assert np.max(slip) < (5e-4 if name == "body" else 1e-3)


def test_no_slip_with_high_accuracy(fine: FlowField) -> None:
    field = fine
    outline = dict(field.solids)["body"]
    points = outside(outline, 9e-9)
    slip = np.linalg.norm(field.velocity(points) - rigid(BODY, points), axis=1)
    assert np.max(slip) < 3e-4 * np.max(np.linalg.norm(rigid(BODY, points), axis=1))
    assert np.median(slip) < 5e-5 * np.max(np.linalg.norm(rigid(BODY, points), axis=1))


def around_the_wire(field: FlowField, distance: float, count: int = 12) -> tuple[np.ndarray, np.ndarray]:
    """Circles about every tenth station, in the body's frame: (circles, points, 3), and their centres."""
    wire = field.solution.wires[0]
    inner = slice(5, -5, 10)
    tangents = wire.tangents[inner]
    first = np.cross(tangents, [0.3, 0.5, 0.8])
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(tangents, first)
    angle = np.linspace(0, 2 * np.pi, count, endpoint=False)[None, :, None]
    circles = wire.points[inner][:, None] + distance * (
        np.cos(angle) * first[:, None] + np.sin(angle) * second[:, None]
    )
    turn = axis_rotation(np.array([field.phase]))[0]
    return circles @ turn.T, wire.points[inner] @ turn.T


def test_slip_on_the_wire(moving: FlowField) -> None:
    """The field of a thin wire is its blobs': on its surface it lags by one part in 2 log(length/radius)."""
    circles, centres = around_the_wire(moving, 0.5001e-3)
    velocity = moving.velocity(circles.reshape(-1, 3)).reshape(circles.shape)
    wanted = rigid(ROTOR, centres)
    lag = np.linalg.norm(velocity.mean(axis=1) - wanted, axis=1) / np.linalg.norm(wanted, axis=1)
    assert np.all(lag < 0.1)
    slip = np.linalg.norm(velocity - rigid(ROTOR, circles), axis=-1)
    assert np.max(slip) < 0.2 * np.max(np.linalg.norm(wanted, axis=1))


def fluid_points(field: FlowField, count: int, clear: float = 2e-3) -> np.ndarray:
    """Random points around the robot, away from every surface."""
    points = np.random.default_rng(8).uniform([-0.1, -0.02, -0.02], [0.03, 0.02, 0.02], (40 * count, 3))
    x, rho = points[:, 0], np.hypot(points[:, 1], points[:, 2])
    free = ~field.inside(points)
    for _, outline in field.solids:
        free &= outline.distance(x, rho) > clear
    for step in clear * np.concatenate([np.eye(3), -np.eye(3)]):
        free &= ~field.inside(points + step)
    return points[free][:count]


def test_stokes_equations(moving: FlowField) -> None:
    """No divergence, and mu times the Laplacian of u is the gradient of p."""
    points = fluid_points(moving, 25)
    assert len(points) == 25
    slope, laplacian, push = flow_gradients(moving, points, 1e-4)
    size = np.max(np.abs(slope), axis=(1, 2))
    assert np.max(np.abs(np.trace(slope, axis1=1, axis2=2)) / size) < 1e-5
    balance = np.linalg.norm(MU * laplacian - push, axis=1)
    # The blobs spread their force a little into the fluid: 15 e^4/(8 pi r^7), seen only near the wire.
    wire = moving.solution.wires[0]
    far = wire.distance(points @ axis_rotation(np.array([PHASE]))[0]) > 8 * wire.blob
    assert np.sum(far) > 10
    assert np.max(balance[far] / (np.linalg.norm(push[far], axis=1) + MU * size[far] / 0.01)) < 1e-3


def test_body_alone_obeys_the_stokes_equations() -> None:
    """Without blobs to rounding of the differences."""
    field = sphere_alone(BODY)
    points = np.random.default_rng(2).normal(size=(20, 3))
    points *= 0.02 / np.linalg.norm(points, axis=1, keepdims=True)
    slope, laplacian, push = flow_gradients(field, points, 4e-4)
    assert np.max(np.abs(np.trace(slope, axis1=1, axis2=2))) < 1e-6 * np.max(np.abs(slope))
    np.testing.assert_allclose(MU * laplacian, push, atol=1e-5 * np.max(np.abs(push)))


def wrench_on_a_sphere(field: FlowField, radius: float, centre: np.ndarray) -> np.ndarray:
    """Force and torque (about the origin) that the fluid outside exerts through a sphere."""
    cosine, weight = np.polynomial.legendre.leggauss(8)
    theta = np.linspace(0, 2 * np.pi, 16, endpoint=False)
    c, angle = (grid.ravel() for grid in np.meshgrid(cosine, theta, indexing="ij"))
    area = np.repeat(weight, len(theta)) * 2 * np.pi / len(theta) * radius**2
    s = np.sqrt(1 - c**2)
    normal = np.stack([c, s * np.cos(angle), s * np.sin(angle)], axis=1)
    points = centre + radius * normal
    slope, _, _ = flow_gradients(field, points, 1e-3 * radius)
    pressure = field.pressure(points)
    stress = MU * (slope + slope.swapaxes(1, 2)) - pressure[:, None, None] * np.eye(3)
    traction = np.einsum("nij,nj->ni", stress, normal) * area[:, None]
    return np.concatenate([traction.sum(axis=0), np.cross(points, traction).sum(axis=0)])


def test_stress_on_a_large_sphere_is_the_resistance(wide: Any, moving: FlowField) -> None:
    """Wrench on the whole robot from its flow, and from its 12x12."""
    matrix = find_swimmer_model("slender").resistance(wide, np.array([PHASE]))[0]
    both = -matrix @ np.concatenate([BODY, ROTOR])
    wanted = both[:6] + both[6:]
    found = wrench_on_a_sphere(moving, 0.3, np.array([-0.04, 0.0, 0.0]))
    np.testing.assert_allclose(found[:3], wanted[:3], atol=1e-5 * np.max(np.abs(wanted[:3])))
    # At standard accuracy the wire's own spin is a torque that its line of forces does not carry.
    own = 4 * np.pi * MU * 0.5e-3**2 * float(wide.arc_length[0]) * np.linalg.norm(ROTOR[3:])
    assert np.linalg.norm(found[3:] - wanted[3:]) < 1.05 * own + 1e-5 * np.linalg.norm(wanted[3:])


def test_stress_with_high_accuracy_holds_all_torques(fine: FlowField) -> None:
    """First moments carry the torque of spinning and tilting cross-sections."""
    found = wrench_on_a_sphere(fine, 0.3, np.array([-0.04, 0.0, 0.0]))
    for part in (slice(0, 3), slice(3, 6)):
        wanted = -fine.wrench()[part]
        np.testing.assert_allclose(found[part], wanted, atol=2e-5 * np.max(np.abs(wanted)))


def test_free_robot_exerts_no_force(wide: Any) -> None:
    """Swimming: the force on a large sphere is nothing against what body or rotor feel, and u falls off as 1/r^2."""
    answer = sp.swim(wide, "slender", tail_rate=np.array([6.0]), calibrated=False)
    speed, turn = float(answer.forward_velocity[0]), float(answer.body_rotation_rate[0])
    body, rotor = np.array([speed, 0, 0, turn, 0, 0]), np.array([speed, 0, 0, 6.0, 0, 0])
    field = flow_field(wide, body, rotor, 0.0)
    found = wrench_on_a_sphere(field, 0.3, np.array([-0.04, 0.0, 0.0]))
    thrust = float(sp.resistance("biorob2012-wide", part="body", model="slender").matrix[0, 0]) * speed
    assert abs(found[0]) < 1e-5 * thrust
    far = np.array([[-0.04 + r, 0.0, 0.0] for r in (2.0, 4.0)])
    along = field.velocity(far)[:, 0]
    assert abs(np.log2(abs(along[0] / along[1])) - 2.0) < 0.1


def test_far_field_is_the_stokeslet_of_the_force(moving: FlowField, wide: Any) -> None:
    """1/r, with what is left falling off as 1/r^2; pressure likewise."""
    matrix = find_swimmer_model("slender").resistance(wide, np.array([PHASE]))[0]
    both = matrix @ np.concatenate([BODY, ROTOR])
    force = both[:3] + both[6:9]
    direction = np.array([2.0, -1.0, 2.0]) / 3
    errors = []
    for r in (10.0, 20.0):
        velocity, pressure = moving.fields(r * direction[None])
        stokeslet = (force + direction * (direction @ force)) / (8 * np.pi * MU * r)
        errors.append(np.linalg.norm(velocity[0] - stokeslet) / np.linalg.norm(stokeslet))
        assert pressure[0] == pytest.approx(direction @ force / (4 * np.pi * r**2), rel=0.3 / r)
    assert errors[0] < 0.012  # the force acts some 0.05 m off the origin
    assert errors[0] / errors[1] == pytest.approx(2.0, rel=0.05)


def test_linear_in_the_twists_and_turned_with_the_phase(wide: Any, moving: FlowField) -> None:
    points = fluid_points(moving, 12)
    none = np.zeros(6)
    parts = [flow_field(wide, BODY, none, PHASE), flow_field(wide, none, ROTOR, PHASE)]
    together = sum(part.velocity(points) for part in parts)
    np.testing.assert_allclose(moving.velocity(points), together, atol=1e-12 * np.max(np.abs(together)))
    quarter = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    turned = flow_field(
        wide, *(np.concatenate([quarter @ t[:3], quarter @ t[3:]]) for t in (BODY, ROTOR)), PHASE + np.pi / 2
    )
    velocity, pressure = turned.fields(points @ quarter.T)
    np.testing.assert_allclose(velocity, moving.velocity(points) @ quarter.T, atol=1e-9 * np.max(np.abs(velocity)))
    np.testing.assert_allclose(pressure, moving.pressure(points), atol=1e-9 * np.max(np.abs(pressure)))


def test_flow_does_not_depend_on_the_viscosity(wide: Any, moving: FlowField) -> None:
    """For given motions; the pressure is in proportion to it."""
    points = fluid_points(moving, 5)
    thin = flow_field(replace(wide, viscosity=0.5 * wide.viscosity), BODY, ROTOR, PHASE)
    np.testing.assert_array_equal(thin.velocity(points), moving.velocity(points))
    np.testing.assert_allclose(thin.pressure(points), 0.5 * moving.pressure(points), rtol=1e-14)


def test_locked_robot_carries_the_fluid_along(wide: Any) -> None:
    """Moving as one piece, around the wire too, but for the wire's own slip."""
    field = flow_field(wide, BODY, BODY, 0.0)
    circles, centres = around_the_wire(field, 0.6e-3)
    mean = field.velocity(circles.reshape(-1, 3)).reshape(circles.shape).mean(axis=1)
    wanted = rigid(BODY, centres)
    assert np.max(np.linalg.norm(mean - wanted, axis=1)) < 0.1 * np.max(np.linalg.norm(wanted, axis=1))


INSIDE = [
    ([0.0, 0.0, 0.0], "body"),
    ([0.0174, 0.0, 0.0], "body"),
    ([-0.0174, 0.0, 0.0089], "body"),
    ([-0.022, 0.001, 0.002], "coupling"),
]


@pytest.mark.parametrize(("point", "part"), INSIDE, ids=str)
def test_point_inside(moving: FlowField, point: list[float], part: str) -> None:
    free = [[0.05, 0.0, 0.0]]
    assert moving.part_at(np.array([*free, point])).tolist() == ["", part]
    for ask in (moving.velocity, moving.pressure, moving.fields):
        with pytest.raises(InputError) as caught:
            ask(np.array([*free, point]))
        text = str(caught.value)
        assert "point 1 = (" in text
        assert f"mm is inside the {part}; allowed: points in the fluid" in text


def test_point_inside_the_tail_turns_with_it(moving: FlowField) -> None:
    circles, centres = around_the_wire(moving, 0.4e-3)
    assert np.all(moving.part_at(centres) == "tail")
    assert np.all(moving.part_at(circles.reshape(-1, 3)) == "tail")
    outer, _ = around_the_wire(moving, 0.52e-3)
    assert not np.any(moving.inside(outer.reshape(-1, 3)))
    with pytest.raises(InputError, match="is inside the tail"):
        moving.velocity(centres[:1])
    assert not np.all(moving.inside(centres * [1.0, -1.0, 1.0]))


def test_just_outside_is_fluid(moving: FlowField) -> None:
    free = [[0.01751, 0.0, 0.0], [0.0, 0.00901, 0.0], [-0.0177, 0.0, 0.0], [-0.022, 0.00301, 0.0]]
    assert not np.any(moving.inside(np.array(free)))
    assert np.all(np.isfinite(moving.fields(np.array(free))[0]))


@pytest.mark.parametrize(
    "points",
    [np.zeros(3), np.zeros((2, 2)), np.zeros((1, 2, 3)), np.array([[np.nan, 0, 0]]), np.array([[np.inf, 0, 0]])],
    ids=["row", "plane", "stack", "nan", "infinite"],
)
def test_wrong_points(moving: FlowField, points: np.ndarray) -> None:
    for ask in (moving.velocity, moving.pressure, moving.fields, moving.inside, moving.part_at):
        with pytest.raises(
            InputError, match=r"(points have shape|is not finite).*; allowed: (finite )?coordinates in m"
        ):
            ask(points)


def test_no_points_at_all(moving: FlowField) -> None:
    velocity, pressure = moving.fields(np.zeros((0, 3)))
    assert velocity.shape == (0, 3)
    assert pressure.shape == (0,)


def test_points_on_the_axis_and_far_away(moving: FlowField) -> None:
    """Nothing singular where theta has no meaning, and nothing lost far away."""
    axis = np.array([[0.05, 0.0, 0.0], [0.05, 1e-12, 0.0], [0.05, 0.0, -1e-12]])
    velocity, pressure = moving.fields(axis)
    np.testing.assert_allclose(velocity[1:], velocity[[0, 0]], rtol=1e-8)
    np.testing.assert_allclose(pressure[1:], pressure[0], rtol=1e-8)
    far = moving.velocity(np.array([[1e6, 1e6, 0.0]]))
    assert np.all(np.isfinite(far))
    assert np.max(np.abs(far)) < 1e-8
