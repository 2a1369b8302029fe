"""Body, coupling and tail together: reciprocity, inclusion, mirror images, turned tails, scale, far apart."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from comparisons import assert_matrices_close
from spirillum.fluid.algebra import about_point, axial_entries, axis_rotation, joint_locked
from spirillum.fluid.registry import find_swimmer_model
from spirillum.fluid.wire.interaction import Discretisation, solve
from spirillum.fluid.wire.slender import robot_solution
from spirillum.fluid.wire.stokeslets import stations_along
from spirillum.robot.limits import all_hold, assembly_limits
from spirillum.robot.outline import Arc, Outline

MODEL: Any = find_swimmer_model("slender")
ZERO = np.zeros(1)
MIRROR = np.diag([1.0, 1.0, -1.0, -1.0, -1.0, 1.0])
LENGTHS = (
    "body.diameter",
    "body.length",
    "body.fillet",
    "coupling.diameter",
    "coupling.length",
    "coupling.clearance",
    "tail.wavelength",
    "tail.amplitude",
    "tail.length",
    "tail.wire_diameter",
)

robots = st.fixed_dictionaries(
    {
        "body.diameter": st.floats(8e-3, 30e-3),
        "body.length": st.floats(30e-3, 60e-3),
        "coupling.diameter": st.one_of(st.just(0.0), st.floats(3e-3, 12e-3)),
        "coupling.length": st.floats(5e-3, 15e-3),
        "coupling.clearance": st.floats(0.3e-3, 1.5e-3),
        "tail.wavelength": st.floats(10e-3, 60e-3),
        "tail.amplitude": st.floats(0.5e-3, 6e-3),
        "tail.wire_diameter": st.floats(0.8e-3, 2e-3),
        "tail.taper": st.one_of(st.just(np.inf), st.floats(0, 3).map(lambda power: 10.0**power)),
    }
)
turns = st.floats(0.5, 1.5)


def built(batch: Any, values: dict[str, float], turns: float) -> Any:
    """The batch as this robot, or the example is given up."""
    length = turns * values["tail.wavelength"]
    changed = batch.with_values({**values, "tail.length": length, "channel.diameter": np.inf, "channel.length": np.inf})
    assume(bool(all_hold(assembly_limits(changed) + MODEL.domain(changed))[0]))
    assume(float(changed.arc_length[0] / changed.wire_diameter[0]) < 200)
    return changed


def normal(matrix: np.ndarray) -> np.ndarray:
    scale = np.sqrt(np.diag(matrix))
    return matrix / np.outer(scale, scale)


def assert_dissipates_more(larger: np.ndarray, smaller: np.ndarray, slack: float = 0.0) -> None:
    """`larger` minus `smaller` is positive semidefinite: for every motion it takes more power."""
    scale = np.sqrt(np.diag(larger))
    assert np.linalg.eigvalsh((larger - smaller) / np.outer(scale, scale))[0] > -slack


@pytest.fixture(scope="module", params=["hemisphere", "flat"])
def any_rear(request: pytest.FixtureRequest, batch_of: Callable[..., Any]) -> Any:
    return batch_of(body__rear=request.param)


@settings(max_examples=4)  # of each rear
@given(values=robots, turns=turns)
def test_reciprocity_and_dissipation(any_rear: Any, values: dict[str, float], turns: float) -> None:
    """The matrix is symmetric before it is made so, and every motion of both parts takes power."""
    batch = built(any_rear, values, turns)
    solution = robot_solution(batch)
    assert solution.asymmetry < 5e-5  # what the standard order leaves of the flat end's edge
    np.testing.assert_array_equal(solution.matrix, solution.matrix.T)
    assert np.linalg.eigvalsh(normal(solution.matrix))[0] > 0
    motions = np.random.default_rng(1).normal(size=(20, 12))
    assert np.all(np.einsum("ni,ij,nj->n", motions, solution.matrix, motions) > 0)


@settings(max_examples=2)  # of each rear
@given(values=robots, turns=turns)
def test_more_robot_takes_more_power(any_rear: Any, values: dict[str, float], turns: float) -> None:
    """Least dissipation: a part with another one added, held or free to follow, resists every motion more."""
    batch = built(any_rear, values, turns)
    parts = {part: MODEL.part_matrix(batch, part, ZERO)[0] for part in ("body", "tail", "rotor", "robot")}
    full = MODEL.resistance(batch, ZERO)[0]
    slack = 3e-4  # a long flat-ended body alone has few panels at the standard order
    assert_dissipates_more(parts["rotor"], parts["tail"], slack)
    assert_dissipates_more(parts["robot"], parts["rotor"], slack)
    assert_dissipates_more(parts["robot"], parts["body"], slack)
    assert_dissipates_more(full[:6, :6], parts["body"], slack)
    free = full[:6, :6] - full[:6, 6:] @ np.linalg.solve(full[6:, 6:], full[6:, :6])
    assert_dissipates_more(free, parts["body"], slack)
    assert_dissipates_more(full[:6, :6], free, slack)
    assert_matrices_close(joint_locked(full), parts["robot"], 1e-12)
    # Both move alike through the water that the other drags along: the whole drags less than its parts.
    assert np.all(np.diag(parts["robot"])[:3] < (np.diag(parts["body"]) + np.diag(parts["rotor"]))[:3])
    if values["coupling.diameter"] == 0:
        assert_matrices_close(parts["rotor"], parts["tail"], 1e-12)
    else:
        coupling = MODEL.part_matrix(batch, "coupling", ZERO)[0]
        assert_dissipates_more(parts["rotor"], coupling, slack)
        assert parts["rotor"][0, 0] < coupling[0, 0] + parts["tail"][0, 0]


@settings(max_examples=2)  # of each rear
@given(values=robots, turns=turns, phase=st.floats(-7, 7), other=st.floats(-7, 7))
def test_phase(any_rear: Any, values: dict[str, float], turns: float, phase: float, other: float) -> None:
    """A tail at another phase is the robot turned, a body of revolution; entries about the axis do not feel it."""
    batch = built(any_rear, values, turns)
    found = MODEL.resistance(batch, np.array([phase]))[0]
    turned = np.kron(np.eye(4), axis_rotation(np.array([phase - other]))[0])
    assert_matrices_close(found, turned @ MODEL.resistance(batch, np.array([other]))[0] @ turned.T, 1e-12)
    assert_matrices_close(axial_entries(found[None])[0], MODEL.axial(batch)[0], 1e-12)
    for part in ("tail", "robot"):
        whole = MODEL.part_matrix(batch, part, np.array([phase]))[0]
        assert_matrices_close(
            whole, turned[:6, :6] @ MODEL.part_matrix(batch, part, np.array([other]))[0] @ turned[:6, :6].T, 1e-12
        )


def test_phase_against_a_tail_that_is_built_turned(batch_of: Callable[..., Any]) -> None:
    """Solved anew with every station turned about the axis."""
    phase, batch = 0.7, batch_of(tail__length="25 mm")
    solution = robot_solution(batch)
    turn = axis_rotation(np.array([phase]))[0]
    from spirillum.fluid.wire.robot_geometry import RobotGeometry

    wires = [(replace(w, points=w.points @ turn.T, tangents=w.tangents @ turn.T), 1) for w in solution.wires]
    solids = RobotGeometry.of(batch).solids("robot")
    anew = solve(solids, wires, Discretisation(order=8, tolerance=1e-4)).matrix
    found = MODEL.resistance(batch, np.array([phase]))[0] / float(batch.viscosity[0])
    assert_matrices_close(anew, found, 1e-10)


@settings(max_examples=2)  # of each rear
@given(values=robots, turns=turns)
def test_left_handed_is_the_mirror_image(any_rear: Any, values: dict[str, float], turns: float) -> None:
    right = built(any_rear, values, turns)
    left = replace(right, hand=-right.hand)
    mirror = np.kron(np.eye(2), MIRROR)
    found, wanted = MODEL.resistance(left, ZERO)[0], MODEL.resistance(right, ZERO)[0]
    assert_matrices_close(found, mirror @ wanted @ mirror, 1e-10)
    signs = np.array([[1, -1, 1, -1], [-1, 1, -1, 1], [1, -1, 1, -1], [-1, 1, -1, 1]])
    assert_matrices_close(MODEL.axial(left)[0], signs * MODEL.axial(right)[0], 1e-10)


@settings(max_examples=2)  # of each rear
@given(values=robots, turns=turns, power=st.integers(-14, 10), thicker=st.floats(0.01, 100.0))
def test_scale_and_viscosity(
    any_rear: Any, values: dict[str, float], turns: float, power: float, thicker: float
) -> None:
    """All lengths times s: forces times s, couplings s^2, torques s^3; everything in proportion to the viscosity.

    Nodes and panels are the same to rounding with powers of two, so that a hidden length would show.
    """
    s = 2.0**power
    small = built(any_rear, values, turns)
    columns = {"tail.wire_diameter": small.wire_diameter, "tail.length": small.tail_length}
    columns |= {name: np.array([value]) for name, value in values.items() if name in LENGTHS}
    large = small.with_values({name: s * column for name, column in columns.items()})
    large = replace(large, viscosity=thicker * large.viscosity)
    units = np.kron(np.eye(2), np.diag([1.0, 1, 1, s, s, s]))
    wanted = thicker * s * units @ MODEL.resistance(small, ZERO)[0] @ units
    assert_matrices_close(MODEL.resistance(large, ZERO)[0], wanted, 1e-12)


def test_far_apart(wide: Any) -> None:
    """A tail far behind (no coupling): the parts' own matrices, and a Stokeslet's flow between them, 1/distance."""
    distance = np.array([2.0, 4.0, 8.0])
    no_coupling = {"coupling.diameter": 0.0, "channel.length": np.inf}
    batch = wide.with_values({**no_coupling, "coupling.length": distance})
    full = MODEL.resistance(batch, np.zeros(3))
    body = MODEL.part_matrix(batch, "body", ZERO)
    tail = MODEL.part_matrix(batch, "tail", ZERO)
    centre = -batch.root - 0.5 * batch.tail_length
    to_tail = np.stack([centre, 0 * centre, 0 * centre], axis=1)
    between = full[:, :3, 6:9]
    mu = float(batch.viscosity[0])
    middle = np.linalg.norm(to_tail, axis=1)[:, None, None]
    oseen = np.diag([2.0, 1.0, 1.0]) / (8 * np.pi * mu * middle)
    alone = about_point(tail, to_tail)
    wanted = -body[:, :3, :3] @ oseen @ alone[:, :3, :3]
    scale = np.sqrt(body[:, 0, 0] * alone[:, 0, 0])[:, None, None]
    errors = np.max(np.abs(between - wanted) / scale, axis=(1, 2))
    np.testing.assert_array_less(errors, 0.1 * np.max(np.abs(wanted) / scale, axis=(1, 2)))
    assert np.all(np.log2(errors[:-1] / errors[1:]) > 1.7)
    np.testing.assert_allclose(np.log2(between[:-1, 0, 0] / between[1:, 0, 0]), 1.0, atol=0.04)
    # What comes back from the other part falls off with the square.
    gained = full[:, 0, 0] / body[:, 0, 0] - 1
    assert np.all(gained > 0)
    np.testing.assert_allclose(np.log2(gained[:-1] / gained[1:]), 2.0, atol=0.08)


def test_sphere_and_wire_against_faxen() -> None:
    """A sphere near a short far wire: with forces on the wire, the drift of a free sphere is Faxen's law."""
    outline = Outline((Arc((0.0, 0.0), (1.0, 1.0), (0.0, np.pi)),), ())
    x = np.linspace(-0.5, 0.5, 50)
    curve = np.array([-3.0, 4.0, 2.0]) + np.stack([x, 0.3 * x, 0 * x], axis=1)
    wire = stations_along(curve, 0.05)
    solution = solve([(outline, 0)], [(wire, 1)], Discretisation(order=12, tolerance=1e-10))
    assert solution.asymmetry < 1e-10
    unit = np.zeros(12)
    unit[7] = 1.0  # the wire moves along y, the sphere is free
    free = -np.linalg.solve(solution.matrix[:6, :6], solution.matrix[:6, 7])
    forces = (solution.forces @ (unit + np.concatenate([free, np.zeros(6)]))).reshape(-1, 3)
    d = -wire.points
    e2 = wire.blob**2
    r = np.sqrt(np.sum(d**2, axis=1, keepdims=True) + e2)
    dot = np.sum(d * forces, axis=1, keepdims=True)
    stokeslet = forces * (1 / r + e2 / r**3) + d * dot / r**3
    # a^2/6 of the Laplacian, whose blob terms are of order e^2/r^5 and left out
    faxen = (2 * forces / r**3 - 6 * d * dot / r**5) / 6
    np.testing.assert_allclose(free[:3], np.sum(stokeslet + faxen, axis=0) / (8 * np.pi), rtol=1e-4)
    curl = np.sum(np.cross(forces, d) * (2 / r**3 + 3 * e2 / r**5), axis=0) / (16 * np.pi)
    np.testing.assert_allclose(free[3:], curl, rtol=1e-6)


def test_more_modes_and_nodes_change_little(batch_of: Callable[..., Any]) -> None:
    """The error that a resolution announces by its tolerance is the one that it makes."""
    from spirillum.fluid.wire.robot_geometry import RobotGeometry

    geometry = RobotGeometry.of(batch_of(tail__length="25 mm", coupling__clearance="2 mm"))
    solids, wires = geometry.solids("robot"), [(geometry.wire(), 1)]
    fine = solve(solids, wires, Discretisation(order=16, tolerance=1e-9))
    errors = []
    for order, tolerance in ((6, 1e-3), (8, 1e-4), (12, 1e-6)):
        found = solve(solids, wires, Discretisation(order=order, tolerance=tolerance))
        scale = np.sqrt(np.outer(np.diag(fine.matrix), np.diag(fine.matrix)))
        errors.append(np.max(np.abs(found.matrix - fine.matrix) / scale))
    assert errors[0] < 1.5e-3
    assert errors[1] < 1e-4
    assert errors[2] < 2e-5
    assert errors[2] < errors[1] < errors[0]
    assert fine.asymmetry < 1e-6
