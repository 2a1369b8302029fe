"""Local resistance coefficients against the formulas of their sources and, near a floor, the exact cylinder.

A cylinder of radius a whose axis is at height h above a plane feels, per length and velocity (Jeffrey and Onishi, Q. J.
Mech. Appl. Math. 34:129, 1981), 4 pi mu/arccosh(h/a) across itself along the plane and
4 pi mu/(arccosh(h/a) - sqrt(h^2 - a^2)/h) normal to the plane. Along its own length the same conformal map gives
2 pi mu/arccosh(h/a).
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from spirillum.fluid.closed.rft import coefficient_domain, local_coefficients
from spirillum.robot.limits import all_hold

MU = 3.5


def chosen(batch_of: Callable[..., Any], name: str, **more: Any) -> Any:
    return batch_of(model__rft__coefficients=name, **more)


@pytest.mark.parametrize("wavelength", [10e-3, 25e-3])
def test_printed(batch_of: Callable[..., Any], wavelength: float) -> None:
    """Eqs (13) and (14)."""
    c_t, c_n, floor = local_coefficients(chosen(batch_of, "printed", tail__wavelength=f"{wavelength} m"))
    log = np.log(wavelength / 1e-3)
    assert c_t[0] == pytest.approx(2 * np.pi * MU / (log - 0.5), rel=1e-14)
    assert c_n[0] == pytest.approx(4 * np.pi * MU / (log + 0.5), rel=1e-14)
    assert floor is None


@pytest.mark.parametrize("wavelength", [10e-3, 25e-3])
def test_gray_and_hancock(batch_of: Callable[..., Any], wavelength: float) -> None:
    """J. Exp. Biol. 32:802 (1955), with the wire's radius under the logarithm."""
    c_t, c_n, floor = local_coefficients(chosen(batch_of, "gray-hancock", tail__wavelength=f"{wavelength} m"))
    log = np.log(2 * wavelength / 0.5e-3)
    assert c_t[0] == pytest.approx(2 * np.pi * MU / (log - 0.5), rel=1e-14)
    assert c_n[0] == pytest.approx(4 * np.pi * MU / (log + 0.5), rel=1e-14)
    assert floor is None


@pytest.mark.parametrize(("wavelength", "amplitude"), [(10e-3, 3.5e-3), (25e-3, 1.5e-3)])
def test_lighthill(batch_of: Callable[..., Any], wavelength: float, amplitude: float) -> None:
    """SIAM Rev. 18:161 (1976): the wavelength is measured along the wire, lambda/cos(pitch angle)."""
    batch = chosen(batch_of, "lighthill", tail__wavelength=f"{wavelength} m", tail__amplitude=f"{amplitude} m")
    c_t, c_n, floor = local_coefficients(batch)
    along_the_wire = np.hypot(wavelength, 2 * np.pi * amplitude)
    log = np.log(0.18 * along_the_wire / 0.5e-3)
    assert c_t[0] == pytest.approx(2 * np.pi * MU / log, rel=1e-13)
    assert c_n[0] == pytest.approx(4 * np.pi * MU / (log + 0.5), rel=1e-13)
    assert floor is None


def test_near_a_floor_the_thin_limit_of_the_exact_cylinder(batch_of: Callable[..., Any]) -> None:
    """The error falls as (a/h)^2 in the logarithms: it is the thin limit, with nothing of order a/h left out."""
    h, radii = 9e-3, np.array([0.8e-3, 0.4e-3, 0.2e-3, 0.1e-3])
    batch = chosen(batch_of, "brennen-winet").with_values({"tail.wire_diameter": 2 * radii})
    c = local_coefficients(batch)
    across = np.arccosh(h / radii)
    exact = {
        "along": 2 * np.pi * MU / across,
        "across": 4 * np.pi * MU / across,
        "normal": 4 * np.pi * MU / (across - np.sqrt(h**2 - radii**2) / h),
    }
    for name, found in zip(exact, c, strict=True):
        constant = (2 if name == "along" else 4) * np.pi * MU
        errors = np.abs(constant / found - constant / exact[name])
        np.testing.assert_allclose(np.log2(errors[:-1] / errors[1:]), 2.0, atol=0.02, err_msg=name)
        np.testing.assert_allclose(found, exact[name], rtol=3e-3, err_msg=name)


def test_height_of_the_axis_defaults_to_the_radius_of_a_body_on_the_floor(batch_of: Callable[..., Any]) -> None:
    lying = local_coefficients(chosen(batch_of, "brennen-winet"))
    given = local_coefficients(chosen(batch_of, "brennen-winet", model__rft__axis_height="9 mm"))
    higher = local_coefficients(chosen(batch_of, "brennen-winet", model__rft__axis_height="15 mm"))
    np.testing.assert_array_equal(np.array(lying), np.array(given))
    assert np.all(np.array(higher) < np.array(lying))


@pytest.mark.parametrize(
    ("name", "least"),
    [
        ("printed", np.exp(1.5)),
        ("gray-hancock", np.exp(1.5) / 4),
        ("lighthill", np.exp(0.5) / 0.36 / np.hypot(1, 2 * np.pi * 0.1)),
    ],
)
def test_domain_ends_where_thrust_would_reverse(batch_of: Callable[..., Any], name: str, least: float) -> None:
    """c_t = c_n at the limit: printed at lambda = exp(1.5) D_t; helices of B_o = lambda/10."""
    base = chosen(batch_of, name)
    ratio = least * np.array([1 - 1e-6, 1.0, 1 + 1e-6])
    batch = base.with_values({"tail.wire_diameter": 25e-3 / ratio, "tail.amplitude": 2.5e-3})
    c = local_coefficients(batch)
    assert (c.tangential[1] / c.normal[1]) == pytest.approx(1.0, rel=1e-9)
    np.testing.assert_array_equal(all_hold(coefficient_domain(batch))[[0, 2]], [False, True])
    assert c.tangential[0] > c.normal[0]
    assert c.tangential[2] < c.normal[2]


@pytest.mark.parametrize(("height", "fine"), [("2.99 mm", False), ("3.01 mm", True)])
def test_wire_stays_clear_of_the_floor(batch_of: Callable[..., Any], height: str, fine: bool) -> None:
    """Amplitude and half a wire, 2.5 + 0.5 mm."""
    batch = chosen(batch_of, "brennen-winet", model__rft__axis_height=height)
    assert all_hold(coefficient_domain(batch))[0] == fine


def test_floor_closer_than_the_logarithm_allows(batch_of: Callable[..., Any]) -> None:
    """log(2 h/a) > 1: h > e a/2, which counts for a straight wire."""
    batch = chosen(batch_of, "brennen-winet").with_values(
        {"tail.amplitude": 1e-6, "model.rft.axis_height": np.array([0.6795, 0.6797]) * 1e-3}
    )
    np.testing.assert_array_equal(all_hold(coefficient_domain(batch)), [False, True])
