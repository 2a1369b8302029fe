"""The tail's RFT matrix against closed forms of a plain helix and against a second, dense quadrature of eq. (12).

The reference quadrature knows only the wire's equation: tangents come from complex-step derivatives, the matrix from
the forces and torques that the wire feels under six unit twists.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from comparisons import assert_matrices_close
from spirillum.fluid.algebra import axial_entries
from spirillum.fluid.closed.rft import Rft, local_coefficients, tail_axial, tail_matrix

SETS = ["printed", "gray-hancock", "lighthill", "brennen-winet"]
TAPERS = ["none", 0.1, 1.0, 3.7, 100.0, 1e4]


def wire(batch: Any, xi: np.ndarray, phase: float) -> np.ndarray:
    """The wire of eq. (10) in the project's frame, for complex xi too: rows x, y, z."""
    taper, length = float(batch.taper[0]), float(batch.tail_length[0])
    envelope = 1.0 if np.isinf(taper) else 1.0 - np.exp(-taper * xi / length)
    r = float(batch.amplitude[0]) * envelope
    x = -(0.5 * float(batch.body_length[0]) + float(batch.coupling_length[0])) - xi
    angle = float(batch.hand[0]) * 2 * np.pi / float(batch.wavelength[0]) * x + phase
    return np.stack([x, r * np.cos(angle), r * np.sin(angle)])


def dense_quadrature(batch: Any, phase: float) -> np.ndarray:
    """6x6 about the origin from unit twists."""
    length, turns = float(batch.tail_length[0]), float(batch.tail_length[0] / batch.wavelength[0])
    edges = (
        np.unique(np.concatenate([[0], np.geomspace(1e-7, 1, 150), np.linspace(0, 1, int(40 * turns) + 2)])) * length
    )
    nodes, weights = np.polynomial.legendre.leggauss(8)
    half = np.diff(edges)[:, None] / 2
    xi, weight = (edges[:-1, None] + half * (1 + nodes)).ravel(), (half * weights).ravel()
    step = 1e-30
    position = wire(batch, xi, phase)
    slope = wire(batch, xi + 1j * step, phase).imag / step
    stretch = np.linalg.norm(slope, axis=0)
    t = slope / stretch
    printed = batch.options.rft.arc_element == "printed"
    plain = np.sqrt(1 + (2 * np.pi * float(batch.amplitude[0]) / float(batch.wavelength[0])) ** 2)
    ds = weight * (plain if printed else stretch)
    c = local_coefficients(batch)
    across = np.array([[0.0], [0.0], [1.0]]) - t[2] * t
    across /= np.linalg.norm(across, axis=0)
    spin = np.pi * float(batch.viscosity[0]) * float(batch.wire_diameter[0]) ** 2 if batch.options.rft.spin else 0.0
    columns = []
    for twist in np.eye(6):
        velocity = twist[:3, None] + np.cross(twist[3:], position.T).T
        force = c.normal * velocity + (c.tangential - c.normal) * (t * velocity).sum(axis=0) * t
        if c.floor_normal is not None:
            force = force + (c.floor_normal - c.normal) * (across * velocity).sum(axis=0) * across
        torque = np.cross(position.T, force.T).T + spin * (twist[3:] @ t) * t
        columns.append(np.concatenate([force @ ds, torque @ ds]))
    return np.array(columns).T


@pytest.fixture(params=["right", "left"])
def hand(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.mark.parametrize("coefficients", SETS[:3])
@pytest.mark.parametrize(
    ("wavelength", "amplitude", "turns"), [(25e-3, 2.5e-3, 2.4), (10e-3, 3.5e-3, 6), (60e-3, 1e-3, 1)]
)
@pytest.mark.parametrize("arc_element", ["printed", "true"])
def test_axial_block_of_a_plain_helix(
    batch_of: Callable[..., Any],
    hand: str,
    coefficients: str,
    wavelength: float,
    amplitude: float,
    turns: float,
    arc_element: str,
) -> None:
    """l [c_n + (c_t - c_n) alpha^2], l b (c_t - c_n) alpha beta, l b^2 [c_n + (c_t - c_n) beta^2]."""
    batch = batch_of(
        channel="none",
        tail__wavelength=f"{wavelength!r} m",
        tail__amplitude=f"{amplitude!r} m",
        tail__length=f"{turns * wavelength!r} m",
        tail__handedness=hand,
        tail__taper="none",
        model__rft__coefficients=coefficients,
        model__rft__arc_element=arc_element,
    )
    c_t, c_n = (float(c[0]) for c in local_coefficients(batch)[:2])
    alpha = 1 / np.sqrt(1 + (2 * np.pi * amplitude / wavelength) ** 2)
    beta = np.sqrt(1 - alpha**2)
    arc = turns * wavelength / alpha
    h = 1 if hand == "right" else -1
    drag = arc * (c_n + (c_t - c_n) * alpha**2)
    coupling = h * arc * amplitude * (c_t - c_n) * alpha * beta
    rotation = arc * amplitude**2 * (c_n + (c_t - c_n) * beta**2)
    assert h * coupling < 0  # positive thrust for a positive rate of a right-handed tail
    np.testing.assert_allclose(np.ravel(tail_axial(batch)), [drag, coupling, rotation], rtol=1e-12)
    matrix = tail_matrix(batch, np.array([0.3]))[0]
    np.testing.assert_allclose([matrix[0, 0], matrix[0, 3], matrix[3, 3]], [drag, coupling, rotation], rtol=1e-9)


@pytest.mark.parametrize("phase", [0.0, 1.1])
def test_lateral_entries_of_a_plain_helix_of_whole_turns(batch_of: Callable[..., Any], hand: str, phase: float) -> None:
    """Closed forms of the drag across the axis, and of the force in y under a rotation about z."""
    batch = batch_of(tail__taper="none", tail__wavelength="20 mm", tail__handedness=hand)
    c_t, c_n = (float(c[0]) for c in local_coefficients(batch)[:2])
    wavelength, b, length, root = 20e-3, 2.5e-3, 60e-3, 35e-3 / 2 + 10e-3
    alpha = 1 / np.sqrt(1 + (2 * np.pi * b / wavelength) ** 2)
    arc, beta2 = length / alpha, 1 - alpha**2
    matrix = tail_matrix(batch, np.array([phase]))[0]
    across = arc * (c_n + (c_t - c_n) * beta2 / 2)
    np.testing.assert_allclose([matrix[1, 1], matrix[2, 2]], across, rtol=1e-10)
    np.testing.assert_allclose([matrix[0, 1], matrix[0, 2], matrix[1, 2]], 0, atol=1e-10 * across)
    # f_y = x (c_n + d beta^2 sin^2) + d h alpha beta b sin cos with d = c_t - c_n; int x cos(2 angle) dx is elementary.
    k = (1 if hand == "right" else -1) * 2 * np.pi / wavelength
    first_moment = ((root) ** 2 - (root + length) ** 2) / 2
    wave = length * np.sin(2 * (-k * root + phase)) / (2 * k)
    lever = (c_n * first_moment + (c_t - c_n) * beta2 * (first_moment - wave) / 2) / alpha
    assert matrix[1, 5] == pytest.approx(lever, rel=1e-10)


@pytest.mark.parametrize("coefficients", SETS)
@pytest.mark.parametrize("taper", TAPERS)
@pytest.mark.parametrize("arc_element", ["printed", "true"])
def test_every_entry_against_a_dense_quadrature(
    batch_of: Callable[..., Any], coefficients: str, taper: str | float, arc_element: str
) -> None:
    batch = batch_of(
        tail__taper=taper,
        tail__wavelength="17 mm",
        tail__handedness="left",
        model__rft__coefficients=coefficients,
        model__rft__arc_element=arc_element,
        model__rft__spin=True,
    )
    assert_matrices_close(tail_matrix(batch, np.array([0.7]))[0], dense_quadrature(batch, 0.7), 1e-9)


def test_spin_adds_the_torque_of_a_turning_cylinder(batch_of: Callable[..., Any], hand: str) -> None:
    """4 pi mu a^2 alpha^2 l about the axis of a plain helix, and nothing along it."""
    options = {"tail__taper": "none", "tail__handedness": hand}
    without, with_spin = (batch_of(model__rft__spin=spin, **options) for spin in (False, True))
    alpha = 1 / np.sqrt(1 + (2 * np.pi * 2.5 / 25) ** 2)
    spin = 4 * np.pi * 3.5 * (0.5e-3) ** 2 * alpha**2 * 60e-3 / alpha
    difference = np.ravel(tail_axial(with_spin)) - np.ravel(tail_axial(without))
    np.testing.assert_allclose(difference, [0, 0, spin], rtol=1e-9, atol=1e-18)
    # Some 8 % of the axial torque of the paper's tail.
    assert 0.04 < spin / tail_axial(without)[2][0] < 0.12


@pytest.mark.parametrize("coefficients", SETS[:3])
@pytest.mark.parametrize("taper", TAPERS)
@pytest.mark.parametrize("arc_element", ["printed", "true"])
@pytest.mark.parametrize("wavelength", ["10 mm", pytest.param("25 mm", marks=pytest.mark.slow)])
def test_axial_form_is_the_matrix_at_any_phase(
    batch_of: Callable[..., Any], hand: str, coefficients: str, taper: str | float, arc_element: str, wavelength: str
) -> None:
    batch = batch_of(
        tail__taper=taper,
        tail__wavelength=wavelength,
        tail__handedness=hand,
        model__rft__coefficients=coefficients,
        model__rft__arc_element=arc_element,
        model__rft__spin=True,
    )
    axial = np.ravel(tail_axial(batch))
    for phase in (0.0, 2.0):
        matrix = tail_matrix(batch, np.array([phase]))[0]
        np.testing.assert_allclose([matrix[0, 0], matrix[0, 3], matrix[3, 3]], axial, rtol=1e-9)


@pytest.mark.parametrize("height", ["3.2 mm", pytest.param("9 mm", marks=pytest.mark.slow), "40 mm"])
@pytest.mark.parametrize("taper", ["none", 0.1, 1.0, 3.7, 100.0])
@pytest.mark.parametrize("arc_element", ["printed", "true"])
def test_axial_form_near_a_floor_is_the_average_over_a_turn(
    batch_of: Callable[..., Any], hand: str, height: str, taper: str | float, arc_element: str
) -> None:
    batch = near_a_floor(batch_of, height, taper, arc_element, hand)
    np.testing.assert_allclose(np.ravel(tail_axial(batch)), average_over_a_turn(batch, 64), rtol=1e-9)


@pytest.mark.parametrize("arc_element", [pytest.param("printed", marks=pytest.mark.slow), "true"])
def test_axial_form_near_a_floor_with_the_steepest_root(batch_of: Callable[..., Any], arc_element: str) -> None:
    """Where the root rises almost along z, its matrix changes so fast with phase that 64 phases are too few."""
    batch = near_a_floor(batch_of, "3.2 mm", 1e4, arc_element, "right")
    np.testing.assert_allclose(np.ravel(tail_axial(batch)), average_over_a_turn(batch, 2048), rtol=1e-6)


def near_a_floor(batch_of: Callable[..., Any], height: str, taper: str | float, arc_element: str, hand: str) -> Any:
    return batch_of(
        tail__taper=taper,
        tail__handedness=hand,
        model__rft__coefficients="brennen-winet",
        model__rft__axis_height=height,
        model__rft__arc_element=arc_element,
        model__rft__spin=True,
    )


def average_over_a_turn(batch: Any, phases: int) -> list[float]:
    """(B11, B14, B44) from the full matrix; half a turn changes y and z to -y and -z, which it does not feel."""
    angles = np.linspace(0, np.pi, phases // 2, endpoint=False)
    parts = [tail_matrix(batch, part).sum(axis=0) for part in np.array_split(angles, max(1, phases // 128))]
    average = sum(parts) / angles.size
    return [average[0, 0], average[0, 3], average[3, 3]]


def test_floor_makes_the_axial_entries_of_a_part_turn_depend_on_phase(batch_of: Callable[..., Any]) -> None:
    """Guards the test above: without such a dependence the average would prove nothing."""
    batch = batch_of(tail__length="6 mm", model__rft__coefficients="brennen-winet", model__rft__axis_height="3.2 mm")
    drags = [tail_matrix(batch, np.array([phase]))[0, 0, 0] for phase in (0.0, np.pi / 2)]
    assert abs(drags[1] / drags[0] - 1) > 1e-2


def test_a_short_root_leaves_the_plain_helix(batch_of: Callable[..., Any]) -> None:
    """The root is L_t/c long, times the logarithm of its steepness."""
    plain = np.ravel(tail_axial(batch_of(tail__taper="none")))
    tapers = np.array([100.0, 1000.0, 10000.0])
    changes = np.array([np.ravel(tail_axial(batch_of(tail__taper=float(c)))) / plain - 1 for c in tapers])
    root = np.log(2.5 / 60 * tapers + np.e) / tapers
    assert np.all(np.abs(changes) < 3 * root[:, None])
    assert np.all(np.abs(changes[2]) < np.abs(changes[1]))
    assert np.all(np.abs(changes[2]) > 1e-6)


def test_robots_of_a_batch_are_as_good_as_one_by_one(batch_of: Callable[..., Any], wide: Any) -> None:
    tapers, wavelengths = [0.5, 20.0, 100.0, 3000.0, np.inf], [8e-3, 12e-3, 25e-3, 30e-3, 60e-3]
    many = wide.with_values({"tail.taper": tapers, "tail.wavelength": wavelengths})
    together, axial = tail_matrix(many, np.array([0.4])), np.array(tail_axial(many))
    for i, (taper, wavelength) in enumerate(zip(tapers, wavelengths, strict=True)):
        one = wide.with_values({"tail.taper": taper, "tail.wavelength": wavelength})
        assert_matrices_close(together[i], tail_matrix(one, np.array([0.4]))[0], 1e-10)
        np.testing.assert_allclose(axial[:, i], np.ravel(tail_axial(one)), rtol=1e-10)


def test_the_whole_and_its_parts(wide: Any) -> None:
    model, phase = Rft(), np.array([0.9])
    body, tail, rotor, robot = (model.part_matrix(wide, part, phase)[0] for part in ("body", "tail", "rotor", "robot"))
    both = model.resistance(wide, phase)
    np.testing.assert_array_equal(both[0, :6, :6], body)
    np.testing.assert_array_equal(both[0, 6:, 6:], tail)
    np.testing.assert_array_equal(both[0, :6, 6:], 0)
    np.testing.assert_array_equal(rotor, tail)
    np.testing.assert_allclose(robot, body + tail, rtol=1e-15)
    np.testing.assert_allclose(model.axial(wide), axial_entries(both), rtol=1e-9, atol=1e-18)


def test_row_four_zeroed_takes_one_entry_out(batch_of: Callable[..., Any], wide: Any) -> None:
    kept, zeroed = Rft().axial(wide)[0], Rft().axial(batch_of(model__rft__row4="zeroed"))[0]
    assert zeroed[3, 2] == 0.0
    assert kept[3, 2] == kept[2, 3] != 0.0
    zeroed[3, 2] = kept[3, 2]
    np.testing.assert_array_equal(zeroed, kept)
