"""Mass, centre, inertia and buoyancy of body and rotor against closed forms, integration and symmetry."""

from typing import Any

import numpy as np
import pytest

from spirillum.robot.links import links_of, revolution_solid, robot_solids, wire_solid
from spirillum.robot.load import load
from spirillum.robot.outline import body_outline, cylinder_outline

R, L = 0.009, 0.035
WIRE: dict[str, float] = {
    "root": 0.0275,
    "wavelength": 0.025,
    "amplitude": 0.0025,
    "length": 0.06,
    "wire_diameter": 0.001,
    "taper": 100.0,
    "hand": 1.0,
}


def robot(**overrides: Any) -> Any:
    return load("biorob2012-wide", **overrides)


def test_cylinder() -> None:
    solid = revolution_solid(cylinder_outline(2 * R, 0.1, 0.1 - L))
    np.testing.assert_allclose(solid.volume, np.pi * R**2 * L, rtol=1e-14)
    np.testing.assert_allclose(solid.centroid, [0.1 - L / 2, 0, 0], rtol=1e-14)
    across = solid.volume * (R**2 / 4 + L**2 / 12)
    np.testing.assert_allclose(solid.inertia, np.diag([solid.volume * R**2 / 2, across, across]), rtol=1e-13)


@pytest.mark.parametrize(("shape", "length"), [("sphere", 2 * R), ("spheroid", L), ("spheroid", R / 3)])
def test_sphere_and_spheroid(shape: Any, length: float) -> None:
    solid = revolution_solid(body_outline(shape, 2 * R, length, 0.0, None, None))
    np.testing.assert_allclose(solid.volume, 4 / 3 * np.pi * R**2 * length / 2, rtol=1e-13)
    np.testing.assert_allclose(solid.centroid, 0.0, atol=1e-16)
    across = (R**2 + length**2 / 4) / 5
    np.testing.assert_allclose(
        solid.inertia, solid.volume * np.diag([2 / 5 * R**2, across, across]), rtol=1e-13, atol=1e-30
    )


def test_capsule_with_two_caps_and_with_one() -> None:
    """A hemisphere: centroid 3/8 R from its base, inertia about that base 2/5 m R^2 both ways."""
    straight, cap = L - 2 * R, 2 / 3 * np.pi * R**3
    side = np.pi * R**2 * straight
    two = revolution_solid(body_outline("capsule", 2 * R, L, 0.0, "hemisphere", "hemisphere"))
    np.testing.assert_allclose(two.volume, side + 2 * cap, rtol=1e-13)
    np.testing.assert_allclose(two.centroid, 0.0, atol=1e-16)
    own = cap * (2 / 5 * R**2 - (3 / 8 * R) ** 2)  # of a cap across the axis, about its own centroid
    along = side * R**2 / 2 + 2 * cap * 2 / 5 * R**2
    across = side * (R**2 / 4 + straight**2 / 12) + 2 * (own + cap * (straight / 2 + 3 / 8 * R) ** 2)
    np.testing.assert_allclose(two.inertia, np.diag([along, across, across]), rtol=1e-12, atol=1e-26)

    one = revolution_solid(body_outline("capsule", 2 * R, L, 0.0, "hemisphere", "flat"))
    length = L - R
    side = np.pi * R**2 * length
    middle = (side * -R / 2 + cap * (L / 2 - R + 3 / 8 * R)) / (side + cap)
    np.testing.assert_allclose(one.centroid, [middle, 0, 0], rtol=1e-12, atol=1e-18)
    across = side * (R**2 / 4 + length**2 / 12 + (-R / 2 - middle) ** 2)
    across += own + cap * (L / 2 - 5 / 8 * R - middle) ** 2
    np.testing.assert_allclose(one.inertia[1, 1], across, rtol=1e-12)


@pytest.mark.parametrize("turns", [1, 3])
@pytest.mark.parametrize("hand", [1.0, -1.0])
def test_plain_helix_over_whole_turns(turns: int, hand: float) -> None:
    """A thick wire along a helix of radius b: int p p' and int t t' over whole turns, and the terms of its ends.

    At both ends t = (-alpha, 0, -h k b alpha) and y = b, z = 0; of the products off the diagonal only x z is left.
    """
    lam, b, a = 0.025, 0.0025, 0.0015
    length = turns * lam
    solid = wire_solid(
        root=0.0, wavelength=lam, amplitude=b, length=length, wire_diameter=2 * a, taper=np.inf, hand=hand
    )
    k = 2 * np.pi / lam
    alpha = 1 / np.hypot(1, k * b)
    np.testing.assert_allclose(solid.volume, np.pi * a**2 * length / alpha, rtol=1e-13)
    np.testing.assert_allclose(solid.centroid, [-length / 2, 0, 0], atol=1e-13 * length)
    transverse = b**2 / 2 + a**2 / 4 * (1 + (1 - alpha**2) / 2)
    axial = length**2 / 12 + a**2 / 4 * (1 + alpha**2) - a**2 / 4 * 2 * alpha**2
    xz = -hand * b / k - a**2 / 4 * hand * k * b * alpha**2
    np.testing.assert_allclose(solid.inertia[0, 0], solid.volume * 2 * transverse, rtol=1e-12)
    np.testing.assert_allclose(solid.inertia[1, 1], solid.volume * (transverse + axial), rtol=1e-12)
    assert solid.inertia[0, 1] == pytest.approx(0.0, abs=1e-12 * solid.inertia[0, 0])
    np.testing.assert_allclose(solid.inertia[0, 2], -solid.volume * xz, rtol=1e-10)


def brute(wire: dict[str, float], power: Any) -> float:
    """A moment of the tapered wire's volume, integrated over (section, length) in a frame of Frenet's."""
    L_, B, lam, h, c, a = (
        wire[name] for name in ("length", "amplitude", "wavelength", "hand", "taper", "wire_diameter")
    )
    a, k = a / 2, 2 * np.pi / lam
    node, weight = np.polynomial.legendre.leggauss(24)
    edges = L_ * np.linspace(0, 1, 61) ** 2  # dense at the root
    half = np.diff(edges)[:, None] / 2
    xi, weights = (edges[:-1, None] + half * (1 + node)).ravel(), (half * weight).ravel()
    x = -wire["root"] - xi
    e = np.exp(-c * xi / L_)
    phase = h * k * x
    turn, q = np.exp(1j * phase), -1j * h * k
    w = B * (1 - e) * turn  # y + i z, and its derivatives
    w1 = (B * c / L_ * e + q * B * (1 - e)) * turn
    w2 = (-B * (c / L_) ** 2 * e + 2 * q * B * c / L_ * e + q**2 * B * (1 - e)) * turn
    p = np.stack([x, w.real, w.imag], axis=-1)
    d1 = np.stack([-np.ones_like(x), w1.real, w1.imag], axis=-1)
    d2 = np.stack([np.zeros_like(x), w2.real, w2.imag], axis=-1)
    speed = np.linalg.norm(d1, axis=1)
    t = d1 / speed[:, None]
    curving = (d2 - np.sum(d2 * t, axis=1)[:, None] * t) / speed[:, None] ** 2  # kappa n
    kappa = np.linalg.norm(curving, axis=1)
    n = curving / kappa[:, None]
    b = np.cross(t, n)
    r, rw = np.polynomial.legendre.leggauss(6)
    r, rw = a * (1 + r) / 2, rw * a / 2
    angle = np.arange(8) * np.pi / 4
    u, v = r[:, None] * np.cos(angle), r[:, None] * np.sin(angle)
    points = p[:, None, None] + u[..., None] * n[:, None, None] + v[..., None] * b[:, None, None]
    volume = (weights * speed)[:, None, None] * (1 - kappa[:, None, None] * u) * (r * rw)[:, None] * np.pi / 4
    return float(np.sum(volume * power(*np.moveaxis(points, -1, 0))))


@pytest.mark.parametrize("hand", [1.0, -1.0])
def test_tapered_wire_against_integration_in_its_frenet_frame(hand: float) -> None:
    wire = {**WIRE, "hand": hand}
    solid = wire_solid(**wire)
    volume = brute(wire, lambda x, y, z: np.ones_like(x))
    np.testing.assert_allclose(solid.volume, volume, rtol=1e-12)
    centroid = np.array([brute(wire, lambda x, y, z, i=i: (x, y, z)[i]) for i in range(3)]) / volume
    np.testing.assert_allclose(solid.centroid, centroid, rtol=1e-10, atol=1e-13)
    X, Y, Z = centroid
    moments = {
        (0, 0): lambda x, y, z: (y - Y) ** 2 + (z - Z) ** 2,
        (1, 1): lambda x, y, z: (x - X) ** 2 + (z - Z) ** 2,
        (0, 1): lambda x, y, z: -(x - X) * (y - Y),
        (0, 2): lambda x, y, z: -(x - X) * (z - Z),
        (1, 2): lambda x, y, z: -(y - Y) * (z - Z),
    }
    for place, moment in moments.items():
        np.testing.assert_allclose(solid.inertia[place], brute(wire, moment), rtol=1e-9, err_msg=str(place))


def test_a_short_straight_wire_is_a_rod() -> None:
    """A hundredth of a turn of a slight helix: pi a^2 L, and the inertia of a cylinder."""
    solid = wire_solid(
        root=0.0, wavelength=1.0, amplitude=1e-9, length=0.01, wire_diameter=0.002, taper=np.inf, hand=1.0
    )
    across = 0.001**2 / 4 + 0.01**2 / 12
    wanted = solid.volume * np.diag([0.001**2 / 2, across, across])
    np.testing.assert_allclose(solid.inertia, wanted, rtol=1e-8, atol=1e-6 * wanted[1, 1])


def test_links_hold_the_measured_mass_and_the_wires() -> None:
    """body.mass spread over body and coupling, the wire's own density; centres and inertias by parallel axes."""
    ready = robot()
    body, rotor = links_of(ready)
    solids = robot_solids(ready)
    main = solids["body"].volume + solids["coupling"].volume
    np.testing.assert_allclose(body.mass + rotor.mass, 0.0107 + 8960 * solids["tail"].volume, rtol=1e-14)
    np.testing.assert_allclose(body.mass / body.volume, 0.0107 / main, rtol=1e-14)
    np.testing.assert_allclose(body.centre, body.centroid, rtol=1e-14)
    np.testing.assert_allclose(rotor.volume, solids["coupling"].volume + solids["tail"].volume, rtol=1e-14)

    def second(inertia: np.ndarray, mass: float, centre: np.ndarray) -> np.ndarray:
        """Inertia about the origin."""
        return inertia + mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))

    parts = [(solids["coupling"], 0.0107 / main), (solids["tail"], 8960.0)]
    about_origin = sum(second(d * s.inertia, d * s.volume, s.centroid) for s, d in parts)
    np.testing.assert_allclose(second(rotor.inertia, rotor.mass, rotor.centre), about_origin, rtol=1e-12, atol=1e-20)
    first = sum(d * s.volume * s.centroid for s, d in parts)
    np.testing.assert_allclose(rotor.mass * rotor.centre, first, rtol=1e-13)
    assert np.all(np.linalg.eigvalsh(rotor.inertia) > 0)


def test_mirrored_tail_has_mirrored_links() -> None:
    """h = -1 is the reflection z -> -z."""
    mirror = np.diag([1.0, 1.0, -1.0])
    right, left = links_of(robot()), links_of(robot(**{"tail.handedness": "left"}))
    for one, other in zip(right, left, strict=True):
        np.testing.assert_allclose(one.mass, other.mass, rtol=1e-14)
        np.testing.assert_allclose(one.centre, mirror @ other.centre, rtol=1e-13, atol=1e-18)
        np.testing.assert_allclose(one.inertia, mirror @ other.inertia @ mirror, rtol=1e-12, atol=1e-20)


def test_lengths_scale() -> None:
    """A robot a thousandth as large of the same density: mass to the third, inertia to the fifth power."""
    small = {
        "body.diameter": "18 um",
        "body.length": "35 um",
        "body.mass": "1.07e-8 g",
        "coupling.diameter": "6 um",
        "coupling.length": "10 um",
        "coupling.clearance": "0.5 um",
        "tail.wavelength": "25 um",
        "tail.amplitude": "2.5 um",
        "tail.length": "60 um",
        "tail.wire_diameter": "1 um",
    }
    for large, little in zip(links_of(robot()), links_of(robot(**small)), strict=True):
        np.testing.assert_allclose(little.mass, 1e-9 * large.mass, rtol=1e-12)
        np.testing.assert_allclose(little.centre, 1e-3 * large.centre, rtol=1e-11, atol=1e-20)
        np.testing.assert_allclose(little.inertia, 1e-15 * large.inertia, rtol=1e-11, atol=1e-36)


@pytest.mark.parametrize(
    ("unset", "unknown"),
    [({"body.mass": None}, (True, True)), ({"tail.density": None}, (False, True)), ({}, (False, False))],
)
def test_what_is_not_known_is_nan_but_volumes_are_known(unset: dict[str, None], unknown: tuple[bool, bool]) -> None:
    for link, lacks in zip(links_of(robot(**unset)), unknown, strict=True):
        assert np.isnan(link.mass) == lacks
        assert np.isnan(link.inertia).all() == lacks
        assert link.volume > 0
        assert np.isfinite(link.centroid).all()


def test_without_coupling_the_wire_alone_turns() -> None:
    body, rotor = links_of(robot(**{"coupling.diameter": "0 mm", "body.mass": None}))
    assert np.isnan(body.mass)
    np.testing.assert_allclose(rotor.mass, 8960 * rotor.volume, rtol=1e-14)
    np.testing.assert_allclose(rotor.centre, rotor.centroid, rtol=1e-14)
