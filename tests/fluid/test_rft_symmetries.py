"""What eq. (12) has to obey for every robot: definiteness, mirror images, turned frames, changes of scale."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from comparisons import assert_matrices_close
from spirillum.fluid.algebra import about_point, axis_rotation, rotated
from spirillum.fluid.closed.rft import Rft, coefficient_domain, tail_axial, tail_matrix
from spirillum.robot.limits import all_hold, assembly_limits

SETS = ["printed", "gray-hancock", "lighthill", "brennen-winet"]
FREE_SETS = SETS[:3]  # the floor of the last one does not turn with the tail

tails = st.fixed_dictionaries(
    {
        "tail.wavelength": st.floats(2e-3, 80e-3),
        "tail.amplitude": st.floats(1e-4, 8e-3),
        "tail.wire_diameter": st.floats(1e-5, 2e-3),
        "tail.taper": st.one_of(st.just(np.inf), st.floats(-1, 4).map(lambda power: 10.0**power)),
    }
)
turns = st.floats(0.4, 8.0)
phases = st.floats(0.0, 2 * np.pi).map(lambda phase: np.array([phase]))


def valid(batch: Any, tail: dict[str, float], turns: float) -> Any:
    """The batch with this tail, or the example is given up."""
    length = turns * tail["tail.wavelength"]
    changed = batch.with_values({**tail, "tail.length": length, "channel.diameter": np.inf, "channel.length": np.inf})
    assume(bool(all_hold(assembly_limits(changed) + coefficient_domain(changed))[0]))
    return changed


@pytest.fixture(scope="module", params=SETS)
def any_set(request: pytest.FixtureRequest, batch_of: Callable[..., Any]) -> Any:
    return batch_of(model__rft__coefficients=request.param)


@pytest.fixture(scope="module", params=FREE_SETS)
def free_set(request: pytest.FixtureRequest, batch_of: Callable[..., Any]) -> Any:
    return batch_of(model__rft__coefficients=request.param)


@settings(max_examples=12)
@given(tail=tails, turns=turns, phase=phases)
def test_symmetric_positive_definite(any_set: Any, tail: dict[str, float], turns: float, phase: np.ndarray) -> None:
    batch = valid(any_set, tail, turns)
    middle = -batch.root - 0.5 * batch.tail_length
    # About the tail's middle: far from it, lateral motion and tilt are nearly the same thing.
    matrix = about_point(tail_matrix(batch, phase), np.array([float(middle[0]), 0.0, 0.0]))[0]
    scale = np.sqrt(np.diag(matrix))
    normal = matrix / np.outer(scale, scale)
    np.testing.assert_allclose(normal, normal.T, atol=1e-12)
    # Dissipation is at least c_t |u|^2 ds everywhere, so no twist is free of resistance.
    assert np.linalg.eigvalsh(normal)[0] > 1e-9
    axial = Rft().axial(batch)[0]
    np.testing.assert_array_equal(axial, axial.T)
    np.linalg.cholesky(axial)


@settings(max_examples=6)
@given(tail=tails, turns=turns, phase=phases, turned=st.floats(-4, 4))
def test_constant_in_the_tails_own_frame(
    free_set: Any, tail: dict[str, float], turns: float, phase: np.ndarray, turned: float
) -> None:
    batch = valid(free_set, tail, turns)
    before, after = tail_matrix(batch, phase), tail_matrix(batch, phase + turned)
    assert_matrices_close(after[0], rotated(before, axis_rotation(np.array([turned])))[0], 1e-10)


@settings(max_examples=6)
@given(tail=tails, turns=turns, phase=phases)
def test_left_handed_is_the_mirror_image(any_set: Any, tail: dict[str, float], turns: float, phase: np.ndarray) -> None:
    """Mirrored in the plane z = 0 a right-handed tail at phi is a left-handed one at -phi; torque is axial."""
    from dataclasses import replace

    right = valid(any_set, tail, turns)
    left = replace(right, hand=-right.hand)
    mirror = np.diag([1.0, 1.0, -1.0, -1.0, -1.0, 1.0])
    assert_matrices_close(tail_matrix(left, -phase)[0], mirror @ tail_matrix(right, phase)[0] @ mirror, 1e-11)
    one, other = np.ravel(tail_axial(right)), np.ravel(tail_axial(left))
    np.testing.assert_allclose(other, one * [1, -1, 1], rtol=1e-14)


@settings(max_examples=6)
@given(tail=tails, turns=turns, phase=phases, power=st.floats(-3, 1))
def test_scale(any_set: Any, tail: dict[str, float], turns: float, phase: np.ndarray, power: float) -> None:
    """All lengths times s: forces times s, couplings times s^2, torques times s^3."""
    s = 10.0**power
    small = valid(any_set, tail, turns)
    lengths = ("wavelength", "amplitude", "length", "wire_diameter")
    values = {f"tail.{name}": s * getattr(small, "tail_length" if name == "length" else name) for name in lengths}
    values |= {"body.length": s * small.body_length, "body.diameter": s * small.body_diameter}
    values |= {"coupling.length": s * small.coupling_length, "coupling.diameter": s * small.coupling_diameter}
    large = small.with_values(values)
    units = np.diag([1.0, 1.0, 1.0, s, s, s])
    assert_matrices_close(tail_matrix(large, phase)[0], s * units @ tail_matrix(small, phase)[0] @ units, 1e-10)
    axial_units = np.diag([1.0, s, 1.0, s])
    np.testing.assert_allclose(Rft().axial(large)[0], s * axial_units @ Rft().axial(small)[0] @ axial_units, rtol=1e-10)


@settings(max_examples=6)
@given(tail=tails, turns=turns, phase=phases, factor=st.floats(1e-3, 1e3))
def test_linear_in_viscosity(
    any_set: Any, tail: dict[str, float], turns: float, phase: np.ndarray, factor: float
) -> None:
    thin = valid(any_set, tail, turns)
    thick = thin.with_values({"fluid.viscosity": factor * thin.viscosity})
    assert_matrices_close(tail_matrix(thick, phase)[0], factor * tail_matrix(thin, phase)[0], 1e-12)
    np.testing.assert_allclose(Rft().axial(thick), factor * Rft().axial(thin), rtol=1e-12)
