"""Tails of several wires and of any curve against surfaces of regularised Stokeslets, and their symmetries."""

from typing import Any

import numpy as np
import pytest

from spirillum import load, resistance
from spirillum.errors import InputError
from spirillum.fluid.algebra import axis_rotation, rotated

WAVELENGTH, AMPLITUDE, LENGTH, RADIUS = 12.0, 3.0, 12.0, 0.5
"""Of the wires that are meshed, mm."""
PLAIN = {"taper": "none"}


def tail(model: str, form: dict[str, Any], **options: Any) -> np.ndarray:
    """The 6x6 of a tail alone."""
    robot = load("biorob2012-wide", tail=form, **options)
    return resistance(
        robot, model=model, part="tail", resolution={"accuracy": "high"} if model == "slender" else None
    ).matrix


def meshed_wire(around: int) -> tuple[np.ndarray, float]:
    """Points on a wire's surface with its cut ends, evenly spaced, and their spacing, mm."""
    k = 2.0 * np.pi / WAVELENGTH
    alpha = 1.0 / np.hypot(1.0, k * AMPLITUDE)
    step = 2.0 * np.pi * RADIUS / around
    rings = round(LENGTH / alpha / step)
    x = (np.arange(rings) + 0.5) / rings * LENGTH
    zero, cos, sin = np.zeros_like(x), np.cos(-k * x), np.sin(-k * x)
    line = np.stack([-x, AMPLITUDE * cos, AMPLITUDE * sin], axis=1)
    tangent = alpha * np.stack([zero - 1.0, AMPLITUDE * k * sin, -AMPLITUDE * k * cos], axis=1)
    out = np.stack([zero, cos, sin], axis=1)
    beside = np.cross(tangent, out)
    turn = 2.0 * np.pi * np.arange(around) / around
    points = [line + RADIUS * (np.cos(t) * out + np.sin(t) * beside) for t in turn]
    for end, outward in ((0, -0.5), (-1, 0.5)):
        middle = line[end] + outward * step * tangent[end]
        for r in np.arange(RADIUS - step, 0.0, -step):
            at = np.linspace(0.0, 2.0 * np.pi, max(1, round(2.0 * np.pi * r / step)), endpoint=False)[:, None]
            points.append(middle + r * (np.cos(at) * out[end] + np.sin(at) * beside[end]))
        points.append(middle[None])
    return np.concatenate(points), step


def stokeslets(at: np.ndarray, of: np.ndarray, blob: float) -> np.ndarray:
    """Velocity over force of Cortez's blobs, viscosity 1, (n, 3, m, 3)."""
    d = at[:, None] - of
    r2 = np.sum(d**2, axis=-1) + blob**2
    tensor = (r2 + blob**2)[..., None, None] * np.eye(3) + d[..., :, None] * d[..., None, :]
    return np.asarray((tensor / (8.0 * np.pi * r2**1.5)[..., None, None]).swapaxes(1, 2))


def meshed_tail(starts: int, around: int) -> np.ndarray:
    """Axial 2x2 (N s/m, N s, N m s in mm) of wires whose forces are turned copies of those on the first."""
    points, step = meshed_wire(around)
    mobility = np.zeros((points.size, points.size))
    for q in axis_rotation(2.0 * np.pi * np.arange(starts) / starts):
        mobility += (stokeslets(points, points @ q.T, 0.35 * step) @ q).reshape(points.size, -1)
    motion = np.stack([np.tile([1.0, 0.0, 0.0], (len(points), 1)), np.cross([1.0, 0.0, 0.0], points)], axis=-1)
    motion = motion.reshape(-1, 2)
    return np.asarray(starts * motion.T @ np.linalg.solve(mobility, motion))


@pytest.mark.parametrize("starts", [2, *(pytest.param(n, marks=pytest.mark.slow) for n in (1, 3, 4))])
def test_wires_agree_with_a_surface_of_regularised_stokeslets(starts: int) -> None:
    coarse, fine = (meshed_tail(starts, around) for around in (8, 12))
    reference = fine + 2.0 * (fine - coarse)  # the error goes with the spacing
    form = {"wavelength": "12 mm", "amplitude": "3 mm", "length": "12 mm", "wire_diameter": "1 mm", "starts": starts}
    found = tail("slender", PLAIN | form, **{"fluid.viscosity": "1 Pa s"})[np.ix_([0, 3], [0, 3])]
    found *= np.array([[1e3, 1e6], [1e6, 1e9]])
    size = np.sqrt(np.diag(found))
    assert np.max(np.abs(found - reference) / np.outer(size, size)) < 5e-3


@pytest.mark.parametrize("starts", [2, 3, 5])
def test_rft_gives_as_many_wires_as_there_are(starts: int) -> None:
    one, several = tail("rft", {}), tail("rft", {"starts": starts})
    turned = [rotated(one, q) for q in axis_rotation(2.0 * np.pi * np.arange(starts) / starts)]
    assert np.allclose(several, np.sum(turned, axis=0), rtol=0.0, atol=1e-12 * several[0, 0])
    assert np.allclose(several[[0, 0, 3], [0, 3, 3]], starts * one[[0, 0, 3], [0, 3, 3]], rtol=1e-12, atol=0.0)


@pytest.mark.parametrize("model", ["rft", "slender"])
def test_tails_with_three_starts_are_alike_after_a_third_of_a_turn(model: str) -> None:
    robot = load("biorob2012-wide", tail={"starts": 3})
    first, turned = (resistance(robot, model=model, part="tail", phase=phase).matrix for phase in ("0 deg", "120 deg"))
    assert np.allclose(first, turned, rtol=0.0, atol=1e-9 * first[0, 0])
    assert first[1, 1] == pytest.approx(first[2, 2], rel=1e-9)


def points_of_helix(count: int, hand: int = 1) -> list[list[float]]:
    x = np.linspace(0.0, 60.0, count)
    angle = 2.0 * np.pi * x / 25.0
    return np.stack([x, 2.5 * np.cos(angle), hand * 2.5 * np.sin(angle)], axis=1).tolist()  # type: ignore[no-any-return]


@pytest.mark.parametrize("model", ["rft", "slender"])
def test_a_curve_through_points_of_a_helix_is_the_helix(model: str) -> None:
    curve = tail(model, {"curve": points_of_helix(121)})
    phase = 2.0 * np.pi / 25.0 * 27.5  # the curve starts at +y, the helix at its place on the robot
    robot = load("biorob2012-wide", tail=PLAIN)
    accuracy = {"accuracy": "high"} if model == "slender" else None
    helix = resistance(robot, model=model, part="tail", phase=phase, resolution=accuracy).matrix
    size = np.sqrt(np.diag(helix))
    assert np.max(np.abs(curve - helix) / np.outer(size, size)) < 1e-4


@pytest.mark.parametrize("model", ["rft", "slender"])
@pytest.mark.parametrize("form", ["curve", "cone"])
def test_mirrored_tails_push_the_other_way(model: str, form: str) -> None:
    def of(hand: int) -> np.ndarray:
        if form == "curve":
            return tail(model, {"curve": points_of_helix(61, hand)})
        cone = {"amplitude": {"from": "1 mm", "to": "3 mm"}, "wavelength": {"from": "20 mm", "to": "30 mm"}}
        return tail(model, cone | {"handedness": "right" if hand > 0 else "left"})

    mirror = np.array([1.0, 1.0, -1.0, -1.0, -1.0, 1.0])  # in the plane z = 0, about the axis of the phase
    right, left = of(1), of(-1)
    axial = np.ix_([0, 3], [0, 3])
    assert np.allclose((mirror[:, None] * left * mirror)[axial], right[axial], rtol=1e-9, atol=0.0)
    assert right[0, 3] < 0.0


def test_smoothing_stays_within_its_tolerance() -> None:
    noisy = np.array(points_of_helix(121))
    noisy[:, 1:] += np.random.default_rng(58).normal(0.0, 0.02, (121, 2))
    smooth = tail("rft", {"curve": noisy.tolist(), "curve_tolerance": "0.03 mm"})
    helix = tail("rft", {"curve": points_of_helix(121)})
    assert np.allclose(smooth[[0, 3], [0, 3]], helix[[0, 3], [0, 3]], rtol=0.02)
    line = load("biorob2012-wide", tail={"curve": noisy.tolist(), "curve_tolerance": "0.03 mm"}).tail.form.centre
    along = 1e3 * line.at(np.linspace(0.0, 1.0, 4001))[0]
    apart = np.array([np.linalg.norm(along - point, axis=1).min() for point in noisy])
    assert np.sqrt(np.mean(apart**2)) < 0.03


@pytest.mark.parametrize(("tolerance", "loss"), [("0.05 mm", 0.0), ("0.5 mm", 0.12)])
def test_smoothing_that_takes_shape_away_says_how_much(tolerance: str, loss: float) -> None:
    noisy = np.array(points_of_helix(121))
    noisy[:, 1:] += np.random.default_rng(58).normal(0.0, 0.05, (121, 2))
    robot = load("biorob2012-wide", tail={"curve": noisy.tolist(), "curve_tolerance": tolerance})
    notes = [note for note in robot.warnings if note.code == "curve-smoothed"]
    assert len(notes) == (loss > 0.0)
    exact, smooth = tail("rft", {"curve": points_of_helix(121)}), resistance(robot, model="rft", part="tail").matrix
    assert smooth[0, 3] / exact[0, 3] == pytest.approx(1.0 - loss, abs=0.03)
    assert all("mean radius by -6.6 %" in note for note in notes)


def test_lighthills_theory_refuses_what_it_does_not_describe() -> None:
    for form, said in (({"starts": 2}, "tail.starts = 2"), ({"curve": points_of_helix(61)}, "no helix of one size")):
        with pytest.raises(InputError, match=said):
            resistance(load("biorob2012-wide", tail=form), model="sbt", part="tail")
