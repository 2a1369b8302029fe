"""Closed forms of the geometry against integration, differentiation and search by brute force."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from spirillum.robot import geometry, tail_form
from spirillum.robot.load import load

ENDS = ["hemisphere", "flat", "fillet"]
DIAMETER, LENGTH, FILLET = 0.018, 0.035, 0.0037


def profile(x: float, front: str, rear: str) -> float:
    """Radius of the body's outline at x from its mid-length."""

    def end(kind: str, depth: float) -> float:
        """Radius at a depth behind the tip of an end."""
        R = DIAMETER / 2
        if kind == "hemisphere" and depth < R:
            return float(np.sqrt(R**2 - (R - depth) ** 2))
        if kind == "fillet" and depth < FILLET:
            return float(R - FILLET + np.sqrt(FILLET**2 - (FILLET - depth) ** 2))
        return R

    return min(end(front, LENGTH / 2 - x), end(rear, x + LENGTH / 2))


@pytest.mark.parametrize("front", ENDS)
@pytest.mark.parametrize("rear", ENDS)
@pytest.mark.parametrize("shape", ["capsule", "cylinder"])
def test_volume_of_a_body(shape: str, front: str, rear: str) -> None:
    breaks = [-LENGTH / 2 + DIAMETER / 2, -LENGTH / 2 + FILLET, LENGTH / 2 - FILLET, LENGTH / 2 - DIAMETER / 2]

    edges = sorted([-LENGTH / 2, LENGTH / 2, *breaks])
    wanted = sum(
        quad(lambda x: np.pi * profile(x, front, rear) ** 2, low, high, epsabs=1e-19, epsrel=1e-11)[0]
        for low, high in pairwise(edges)
    )
    volume = geometry.body_volume(shape, *(np.array([value]) for value in (DIAMETER, LENGTH, FILLET)), front, rear)[0]
    assert volume == pytest.approx(wanted, rel=1e-10)


@pytest.mark.parametrize(("shape", "length"), [("sphere", DIAMETER), ("spheroid", LENGTH)])
def test_volume_of_a_spheroid(shape: str, length: float) -> None:
    diameter, length_, none = np.array([DIAMETER]), np.array([length]), np.zeros(1)
    volume = geometry.body_volume(shape, diameter, length_, none, None, None)[0]
    assert volume == pytest.approx(np.pi / 6 * DIAMETER**2 * length, rel=1e-14)


def test_a_fillet_as_large_as_the_radius_is_a_hemisphere() -> None:
    arguments = [np.array([value]) for value in (DIAMETER, LENGTH, DIAMETER / 2)]
    fillet, round_ = (
        geometry.body_volume("capsule", *arguments, front, "flat")[0] for front in ("fillet", "hemisphere")
    )
    assert fillet == pytest.approx(round_, rel=1e-13)


@settings(max_examples=100)
@given(wavelength=st.floats(0.01, 10), amplitude=st.floats(0.05, 5))
def test_coil_spacing(wavelength: float, amplitude: float) -> None:
    """Smallest distance from a turn of the centreline to the next, by search on a grid and on a finer one."""
    # Where turns only just stop to come near each other, search and formula may disagree.
    assume(abs((wavelength / (2 * np.pi * amplitude)) ** 2 / 0.21723 - 1) > 1e-3)

    def squared(t: np.ndarray) -> np.ndarray:
        return 4 * amplitude**2 * np.sin(t / 2) ** 2 + (wavelength * t / (2 * np.pi)) ** 2

    t = np.linspace(np.pi, 2.1 * np.pi, 20_001)
    d2 = squared(t)
    inner = np.flatnonzero((d2[1:-1] < d2[:-2]) & (d2[1:-1] <= d2[2:])) + 1
    found = float(tail_form.coil_spacing(np.array([wavelength]), np.array([amplitude]))[0])
    if inner.size == 0:
        assert np.isinf(found)
    else:
        near = np.linspace(t[inner[0] - 1], t[inner[0] + 1], 20_001)
        assert found == pytest.approx(np.sqrt(squared(near).min()), rel=1e-8)


def test_coil_spacing_of_flat_coils_is_the_pitch_across_the_wire() -> None:
    """A tight coil's neighbouring turns lie lambda cos(inclination) apart."""
    wavelength, amplitude = np.array([1e-3]), np.array([10e-3])
    inclination = np.arctan(wavelength / (2 * np.pi * amplitude))
    spacing = tail_form.coil_spacing(wavelength, amplitude)
    np.testing.assert_allclose(spacing, wavelength * np.cos(inclination), rtol=1e-6)


@pytest.mark.parametrize("hand", [1.0, -1.0])
@pytest.mark.parametrize("taper", [np.inf, 0.3, 5.0, 100.0])
def test_centreline(hand: float, taper: float) -> None:
    """Position as in eq. (10); tangent and ds/dxi by complex-step differentiation of it."""
    L, wavelength, B, root, phase = 0.06, 0.025, 0.0025, 0.0275, 0.8

    def position(xi: np.ndarray) -> np.ndarray:
        r = B if np.isinf(taper) else B * (1 - np.exp(-taper * xi / L))
        x = -root - xi
        angle = hand * 2 * np.pi / wavelength * x + phase
        return np.stack([x, r * np.cos(angle), r * np.sin(angle)], axis=-1)

    xi = np.linspace(0, L, 37)
    line = tail_form.centreline(
        xi,
        root=np.array([root]),
        wavelength=np.array([wavelength]),
        amplitude=np.array([B]),
        length=np.array([L]),
        taper=np.array([taper]),
        hand=np.array([hand]),
        phase=np.array([phase]),
    )
    np.testing.assert_allclose(line.position, position(xi), atol=1e-17)
    slope = position(xi + 1e-30j).imag / 1e-30
    np.testing.assert_allclose(line.stretch, np.linalg.norm(slope, axis=-1), rtol=1e-13)
    np.testing.assert_allclose(line.tangent, slope / np.linalg.norm(slope, axis=-1)[:, None], atol=1e-14)


def test_right_handed_means_right_handed() -> None:
    """Positive torsion: (X' x X'') . X''' > 0, whichever way the curve is walked."""
    for hand, sign in ((1.0, 1), (-1.0, -1)):
        xi = np.linspace(0.02, 0.03, 7)
        one = {name: np.array([v]) for name, v in {"root": 0.0, "wavelength": 0.025, "amplitude": 0.0025}.items()}
        rest = {"length": np.array([0.06]), "taper": np.array([np.inf]), "phase": np.zeros(1)}
        p = tail_form.centreline(xi, hand=np.array([hand]), **one, **rest).position
        d1, d2, d3 = p[4] - p[2], p[4] - 2 * p[3] + p[2], p[5] - 2 * p[4] + 2 * p[2] - p[1]
        assert np.sign(np.cross(d1, d2) @ d3) == sign


@given(wavelength=st.floats(1e-6, 1), ratio=st.floats(1e-4, 10), turns=st.floats(0.1, 100))
def test_arc_fraction(wavelength: float, ratio: float, turns: float) -> None:
    """A helix unrolled: the hypotenuse of axial length and circumferences."""
    arc = turns * wavelength / tail_form.arc_fraction(np.array([wavelength]), np.array([ratio * wavelength]))[0]
    assert arc == pytest.approx(turns * np.hypot(wavelength, 2 * np.pi * ratio * wavelength), rel=1e-13)


@settings(max_examples=30)
@given(wavelength=st.floats(1.0, 60), amplitude=st.floats(0.6, 15), share=st.floats(0.2, 1.8))
def test_turns_that_touch_are_refused(wavelength: float, amplitude: float, share: float) -> None:
    """A wire fits exactly when it is thinner than the spacing of the coils and than the diameter of curvature."""
    from spirillum.errors import InputError

    lam, b = wavelength * 1e-3, amplitude * 1e-3
    spacing = float(tail_form.coil_spacing(np.array([lam]), np.array([b]))[0])
    k = 2 * np.pi / lam
    curvature = b * k**2 / (1 + (b * k) ** 2)
    largest = min(spacing, 2 / curvature)
    wire = share * largest
    assume(wire < 30e-3)
    options = {"tail.wavelength": f"{lam!r} m", "tail.amplitude": f"{b!r} m", "tail.wire_diameter": f"{wire!r} m"}
    assume(abs(share - 1) > 1e-6)
    if share < 1:
        load("biorob2012-wide", channel="none", **options)
    else:
        with pytest.raises(InputError, match=r"tail\.wire_diameter = .*; allowed: less than"):
            load("biorob2012-wide", channel="none", **options)
