"""The table of a robot in its tube: interpolation, its range, its file."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import spirillum as sp
from spirillum.errors import InputError
from spirillum.fluid.tube import library, tube
from spirillum.fluid.tube.building import OnAxis, _powers
from spirillum.fluid.tube.nodes import Places, rings_of
from spirillum.fluid.tube.outer_resistance import (
    HARMONICS,
    PHASES,
    NodeSolution,
    all_cached,
    even_phases,
    factor_of,
    fourier,
    matrices_at,
    matrix_of,
    mirror_image,
    mirrored,
    outer_coefficients,
    solutions,
)
from spirillum.fluid.tube.solids import Fineness
from spirillum.fluid.tube.stages import RESPONSES, response_errors, response_of
from spirillum.fluid.tube.table import TubeTable, key_of, packed_from, to_bytes
from spirillum.fluid.wire.robot_geometry import RobotGeometry
from spirillum.kernels import core
from spirillum.kernels import tube_table as kernel
from spirillum.kernels.core import film_at
from spirillum.robot.batch import RobotBatch
from spirillum.robot.outline import body_outline
from spirillum.robot.tube_pose import TubePose

R = 0.02


@pytest.fixture(scope="module")
def geometry() -> RobotGeometry:
    return RobotGeometry.of(RobotBatch.of(sp.load("biorob2012-wide")))


@lru_cache
def places_in(geometry: RobotGeometry, radius: float) -> Places:
    return Places(geometry, radius)


@pytest.fixture(scope="module")
def places(geometry: RobotGeometry) -> Places:
    return places_in(geometry, R)


@pytest.fixture(scope="module")
def film(geometry: RobotGeometry) -> np.ndarray:
    """That of the table that is shipped."""
    table = library.find_table(geometry, R)
    assert table is not None
    return kernel.parts_of(table.packed).film


def packed(places: Places, film: np.ndarray, coefficients, yawed=None) -> np.ndarray:
    """A table whose rest has given coefficients (t, signed f) -> (5, 36), and given derivatives with yaw."""
    pitches = [*places.up, *(-places.down[1:])]
    rest = np.array([[coefficients(t, f) for f in pitches] for t in places.gaps])
    none = np.zeros(0)
    turned = (none, none, places.yaw_limit, none)
    if yawed is not None:
        values = np.array([[yawed(t, f) for f in places.yaw_pitches] for t in places.yaw_gaps])
        turned = (places.yaw_gaps, places.yaw_pitches, places.yaw_limit, values)
    parts = (places.gaps, places.up, places.down, places.most, rest)
    return kernel.packed(R, places.rings, *parts, *turned, film)


def smooth(t: float, f: float, phases: int = 5) -> np.ndarray:
    """Something of low degree in sqrt(t) and log(1.3 - f) on either side of level."""
    draw = np.random.default_rng(3).normal(size=(4, phases, kernel.PARAMETERS))
    s, f = np.sqrt(t), np.log(1.3 - abs(f)) - np.log(1.3)
    return 0.2 * (draw[0] + draw[1] * s + draw[2] * s**2 * abs(f) + draw[3] * f**2)


def at(table: np.ndarray, e: float, pitch: float, yaw: float = 0.0, phase: float = 0.0) -> tuple[np.ndarray, int]:
    out = np.empty((8, 8))
    return out, core.resistance_at(table, e, pitch, yaw, phase, out)


def sum_at(coefficients: np.ndarray, phase: float) -> np.ndarray:
    turns = phase * np.arange(1, (len(coefficients) + 1) // 2)
    wave = np.concatenate([[1.0], np.stack([np.cos(turns), np.sin(turns)], axis=1).ravel()])
    return wave @ coefficients


def lower(coefficients: np.ndarray, phase: float) -> np.ndarray:
    found = np.zeros((8, 8))
    found[np.tril_indices(8)] = sum_at(coefficients, phase)
    found[np.diag_indices(8)] = np.exp(np.diag(found))
    return found


@pytest.mark.parametrize("phases", [5, PHASES])
def test_polynomials_are_reproduced_between_the_nodes(places: Places, film: np.ndarray, phases: int) -> None:
    """Of degree 2 in sqrt(t) and in log(1.3 - f), with all harmonics of the phase, and the film added back."""
    table = packed(places, film, lambda t, f: smooth(t, f, phases))
    draw = np.random.default_rng(0)
    for _ in range(40):
        t, row = draw.uniform(places.gaps[0], 1.0), places
        pitch = draw.uniform(-0.05, 0.05)
        e = (1.0 - t) * core.contact_offset(row.rings, R, pitch)
        side = 0 if pitch >= 0 else 1
        nodes = np.sqrt(places.gaps)
        most = sum(
            places.most[i, side]
            * np.prod([(np.sqrt(t) - nodes[m]) / (nodes[i] - nodes[m]) for m in range(6) if m != i])
            for i in range(6)
        )
        f = pitch / most
        phase = draw.uniform(0, 6)
        found, left = at(table, e, pitch, 0.0, phase)
        assert left == core.INSIDE
        thin = np.zeros((6, 6))
        film_at(film, e, pitch, 0.0, thin)
        factor = lower(smooth(t, f, phases), phase)
        expected = factor @ factor.T
        expected[:6, :6] += core.cut_of_film(t) * thin
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12 * np.abs(expected).max())


def test_positive_definite_and_symmetric_everywhere(places: Places, film: np.ndarray) -> None:
    """Also where the interpolated factor is wild, below the first node, and outside the range."""
    table = packed(
        places, film, lambda t, f: 3.0 * np.sin(9.0 * smooth(t, f)), lambda t, f: np.ones((kernel.YAW_ORDERS, 5, 36))
    )
    draw = np.random.default_rng(1)
    for _ in range(300):
        matrix, _ = at(table, draw.uniform(0, 0.01099), draw.uniform(-0.02, 0.02), draw.uniform(-0.1, 0.1), 1.0)
        scale = np.sqrt(np.diag(matrix))
        assert np.array_equal(matrix, matrix.T)
        assert np.linalg.eigvalsh(matrix / np.outer(scale, scale))[0] > 0


def test_the_rest_goes_on_linearly_below_the_first_node(places: Places, film: np.ndarray) -> None:
    table = packed(places, film, smooth)
    out = np.empty((3, 5, kernel.PARAMETERS))
    room = core.contact_offset(places.rings, R, 0.0)
    for n, t in enumerate((0.0, 0.5 * places.gaps[0], places.gaps[0])):
        core.outer_coefficients(table, (1.0 - t) * room, 0.0, out[n])
    np.testing.assert_allclose(out[1], 0.5 * (out[0] + out[2]), atol=1e-12)
    step = 1e-7 * places.gaps[0]
    above = np.empty_like(out[0])
    core.outer_coefficients(table, (1.0 - places.gaps[0] - step) * room, 0.0, above)
    np.testing.assert_allclose((above - out[2]) / step, (out[2] - out[0]) / places.gaps[0], rtol=1e-4, atol=1e-5)


def test_leaving_the_range_is_told(places: Places, film: np.ndarray) -> None:
    table = packed(places, film, smooth)
    assert at(table, 0.0, 0.5)[1] == core.TOO_FAR_PITCHED
    turned = packed(places, film, smooth, lambda t, f: np.zeros((kernel.YAW_ORDERS, 5, 36)))
    most = core.largest_yaw(turned, 0.0, 0.0)
    assert most == pytest.approx(places.largest_yaw(1.0, 0.0))
    assert at(turned, 0.0, 0.0, 1.02 * kernel.YAW_SLACK * most)[1] == core.TOO_FAR_YAWED
    assert at(turned, 0.0, 0.0, 0.98 * kernel.YAW_SLACK * most)[1] == core.INSIDE


def test_yaw_enters_as_powers_of_the_stretched_one(places: Places, film: np.ndarray) -> None:
    powers = np.array([0.5, -2.0, 0.3, 0.7, -0.4, 0.2])
    slope = np.broadcast_to(powers[:, None, None], (kernel.YAW_ORDERS, 5, 36))
    table, straight = packed(places, film, smooth, lambda t, f: slope), packed(places, film, smooth)
    yaw, e = 0.03, 0.006
    turned, level = at(table, e, 0.0, yaw)[0], at(straight, e, 0.0)[0]
    thin = np.zeros((2, 6, 6))
    film_at(film, e, 0.0, yaw, thin[0])
    film_at(film, e, 0.0, 0.0, thin[1])
    w = core.cut_of_film(1.0 - e / core.contact_offset(places.rings, R, 0.0))
    turned[:6, :6] -= w * thin[0]
    level[:6, :6] -= w * thin[1]
    s = core.stretched_yaw(yaw / core.largest_yaw(table, e, 0.0))
    more = 3.0 * float(powers @ s ** np.arange(1, 7))  # coefficients 1, cos and cos 2 at phase 0
    assert np.log(turned[0, 0] / level[0, 0]) == pytest.approx(2.0 * more, rel=1e-9)


def test_beyond_the_last_node_the_yaw_goes_on_by_its_tangent(places: Places, film: np.ndarray) -> None:
    """To either side, without a kink: the logarithm of the first entry of the rest is linear in the stretched yaw."""
    draw = np.random.default_rng(3).normal(size=(kernel.YAW_ORDERS, 5, 36))
    table = packed(places, film, smooth, lambda t, f: draw)
    most = core.largest_yaw(table, 0.0, 0.0)  # on the axis, where no film is added
    last = kernel.YAW_SHARES[-1]

    def logarithm(share: float) -> float:
        return float(np.log(at(table, 0.0, 0.0, share * most)[0][0, 0]))

    for side in (-1.0, 1.0):
        inside, node, beyond, far = (side * share for share in (last - 1e-4, last, 1.03, 1.09))
        slopes = [
            (logarithm(b) - logarithm(a)) / (core.stretched_yaw(b) - core.stretched_yaw(a))
            for a, b in ((inside, node), (node, beyond), (beyond, far))
        ]
        assert slopes[1] == pytest.approx(slopes[2], rel=1e-9)
        assert slopes[0] == pytest.approx(slopes[1], rel=2e-2)


@pytest.mark.parametrize("pitch", [-0.1, 0.0, 0.05])
@pytest.mark.parametrize(
    "shape", [("capsule", "hemisphere", "flat"), ("capsule", "fillet", "hemisphere"), ("spheroid", None, None)]
)
def test_contact_offset_is_where_the_body_touches(shape: tuple, pitch: float) -> None:
    outline = body_outline(shape[0], 0.018, 0.044, 0.003, shape[1], shape[2])
    offset = core.contact_offset(rings_of(outline), R, pitch)
    assert TubePose(R, offset, pitch).clearance(outline) == pytest.approx(0.0, abs=1e-8)


def test_places_keep_the_tail_off_the_glass(places: Places) -> None:
    wire = places.geometry.wire()
    for row, t in enumerate(places.gaps):
        for f in (-1.0, 1.0):
            pose = places.pose(float(t), f)
            assert pose.tail_clearance(wire.points, wire.radius).clearance > 0.7 * wire.radius
            assert pose.clearance(places.geometry.body) > 0
        assert places.most[row].min() > 0


@pytest.mark.parametrize("radius", [R, 0.015])
@pytest.mark.parametrize("t", [0.02, 0.2, 0.7, 1.0])
def test_largest_yaw_is_where_the_tail_nears_the_glass(geometry: RobotGeometry, radius: float, t: float) -> None:
    """Between its nodes, too, nose up and down: to 0.1 degrees."""
    places = places_in(geometry, radius)
    for f in (-0.9, -0.25, 0.0, 0.1, 0.6):
        pose = places.pose_between(t, f, places.largest_yaw(t, f))
        for turned, sign in ((-0.1, 1.0), (0.1, -1.0)):
            near = replace(pose, yaw=pose.yaw + np.radians(turned))
            assert sign * (places.tail_clearance(near) - places.least_clearance) > 0


@pytest.mark.parametrize("radius", [R, 0.015])
def test_yawed_places_keep_the_tail_off_the_glass(geometry: RobotGeometry, radius: float) -> None:
    yawed, wire = places_in(geometry, radius), geometry.wire()
    clear = [
        yawed.pose(float(t), float(f), float(most)).tail_clearance(wire.points, wire.radius).clearance
        for t, row in zip(yawed.yaw_gaps, yawed.most_yaw, strict=True)
        for f, most in zip(yawed.yaw_pitches, row, strict=True)
    ]
    assert min(clear) > 0.7 * wire.radius
    assert np.all(yawed.most_yaw > np.radians(2.0))


def test_a_tail_much_wider_than_its_body_has_no_table(geometry: RobotGeometry) -> None:
    with pytest.raises(sp.InputError, match="keeps the body far from the wall"):
        _ = Places(geometry._replace(amplitude=0.015), R).gaps
    assert Places(geometry._replace(amplitude=0.0095), R).gaps[0] > 0.1


@pytest.mark.parametrize("harmonics", [2, 3, HARMONICS])
def test_as_many_phases_as_it_has_coefficients_give_a_function_of_the_phase_back(harmonics: int) -> None:
    """What so few phases do not give is zero, and the function is met at any other phase, too."""
    planted = np.random.default_rng(2).normal(size=(2 * harmonics + 1, kernel.PARAMETERS))
    phases = even_phases(len(planted))
    found = fourier(np.stack([sum_at(planted, phase) for phase in phases]), PHASES)
    np.testing.assert_allclose(found[: len(planted)], planted, atol=1e-13)
    assert found.shape == (PHASES, kernel.PARAMETERS)
    assert not np.any(found[len(planted) :])


def test_a_node_gives_its_matrix_back_at_every_phase() -> None:
    """A factor of three harmonics and its film, from seven phases; five are not enough."""
    planted = 0.3 * np.random.default_rng(8).normal(size=(7, kernel.PARAMETERS))
    film, pose = np.diag(np.arange(1.0, 7.0)), TubePose(R, 0.004, 0.0)

    def full(phase: float) -> np.ndarray:
        factor = lower(planted, phase)
        matrix = factor @ factor.T
        matrix[:6, :6] += core.cut_of_film(0.3) * film
        return matrix

    for count, enough in ((5, False), (7, True), (PHASES, True)):
        found = outer_coefficients(np.stack([full(phase) for phase in even_phases(count)]), film, 0.3, pose)
        assert found.shape == (PHASES, kernel.PARAMETERS)
        back = matrices_at(found, np.array([1.234]))[0]
        back[:6, :6] += core.cut_of_film(0.3) * film
        assert np.allclose(back, full(1.234), rtol=1e-10, atol=1e-12) is enough


def test_yawed_nodes_are_met() -> None:
    """What is solved for at a node with yaw comes back to either side."""
    draw = np.random.default_rng(9)
    middle, sides = draw.normal(size=(5, 36)), draw.normal(size=(len(kernel.YAW_SHARES), 2, 5, 36))
    powers = _powers(middle, sides)
    for share, (left, right) in zip(kernel.YAW_SHARES, sides, strict=True):
        for sign, expected in ((1.0, left), (-1.0, right)):
            s = core.stretched_yaw(sign * share)
            found = middle + np.tensordot(s ** np.arange(1, 7), powers, axes=1)
            np.testing.assert_allclose(found, expected, atol=1e-12)


def test_factors_give_the_matrix_back_and_refuse_an_indefinite_one() -> None:
    a = np.random.default_rng(4).normal(size=(8, 8))
    matrix = a @ a.T
    factor = lower(np.concatenate([factor_of(matrix, "here")[None], np.zeros((4, 36))]), 0.0)
    np.testing.assert_allclose(factor @ factor.T, matrix, rtol=1e-10)
    with pytest.raises(sp.InputError, match="too coarsely here"):
        factor_of(matrix - 100.0 * np.eye(8), "here")


def test_the_mirror_image_of_a_mirror_image_is_the_robot(geometry: RobotGeometry) -> None:
    image, phases = mirrored(geometry, (0.3, 2.0))
    back, again = mirrored(image, phases)
    assert back == geometry
    assert again == pytest.approx((0.3, 2.0))
    a = np.random.default_rng(5).normal(size=(8, 8))
    np.testing.assert_array_equal(mirror_image(mirror_image(a)), a)
    # seen in the mirror, points of the wire are those of the image
    one, other = geometry.wire().points, image.wire().points
    np.testing.assert_allclose(one * [1, -1, 1], other @ rotation(np.pi).T, atol=1e-12)


def rotation(angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1, 0, 0], [0, c, -s], [0, s, c]])


def test_rates_of_a_table_are_twists_of_both_parts() -> None:
    full = np.random.default_rng(6).normal(size=(13, 13))
    full = full @ full.T
    rates = np.random.default_rng(7).normal(size=8)
    twists = np.concatenate([rates[:6], rates[:6], rates[7:]])
    twists[9] += rates[6]
    assert rates @ matrix_of(full) @ rates == pytest.approx(twists @ full @ twists)


def test_responses_of_a_diagonal_resistance_are_those_of_a_tail_that_drives_nothing() -> None:
    matrix = np.diag(np.arange(1.0, 9.0))
    found = response_of(matrix)
    # the body's own torque balance: 4 Omega = 0 x tail
    np.testing.assert_allclose(found, [0, 0, 0, 0, 0, 0, 3], atol=1e-12)


def test_response_errors_are_relative() -> None:
    a = np.random.default_rng(8).normal(size=(8, 8))
    matrix = a @ a.T
    np.testing.assert_allclose(
        response_errors(1.01 * matrix, matrix), [0, 0, 0.01, 0.01, 0.01, 0.01][: len(RESPONSES)], atol=0.011
    )
    assert np.all(response_errors(matrix, matrix) == 0)


def test_response_errors_over_a_turn_are_over_root_mean_squares() -> None:
    """Of sizes 1 to 3 times as large: over the root of (1 + 4 + 9)/3."""
    a = np.random.default_rng(9).normal(size=(8, 8))
    true = a @ a.T
    wrong = true + 0.01 * np.diag([0, 0, 1.0, 0, 0, 0, 0, 0])
    turn = np.stack([true, true, true])
    turn[1, 2, 2], turn[2, 2, 2] = 2.0 * true[2, 2], 3.0 * true[2, 2]
    found = response_errors(wrong, true, turn)
    assert found[5] == pytest.approx(0.01 / true[2, 2] / np.sqrt(14.0 / 3.0))
    np.testing.assert_allclose(found[:5], 0.0, atol=1e-12)


def test_a_table_is_written_and_read(
    tmp_path,
    geometry: RobotGeometry,
    places: Places,
    film: np.ndarray,  # type: ignore[no-untyped-def]
) -> None:
    table = TubeTable(
        geometry,
        R,
        packed(places, film, smooth),
        dict.fromkeys(RESPONSES, 0.004),
        dict.fromkeys(RESPONSES, 0.002),
        40,
        300.0,
    )
    assert table.wire is None
    table = replace(table, wire=0.0123)
    table.write(tmp_path / "robot.table")
    read = TubeTable.read(tmp_path / "robot.table")
    assert (read.geometry, read.radius, read.key, read.wire) == (geometry, R, table.key, 0.0123)
    assert (read.error_at(0.1)["sideways_force"], read.error_at(0.0)["sideways_force"]) == (0.004, 0.002)
    for offset, pitch in ((0.0101, 0.01), (0.003, -0.05), (0.0, 0.0)):
        kept, made = read.at(offset, pitch, 0.0, 0.4)[0], table.at(offset, pitch, 0.0, 0.4)[0]
        scale = np.sqrt(np.diag(made))
        assert np.abs((kept - made) / np.outer(scale, scale)).max() < 1e-4
    (tmp_path / "broken.table").write_bytes((tmp_path / "robot.table").read_bytes()[:3000])
    for path in ("broken.table", "missing.table"):
        with pytest.raises(sp.InputError, match="is no table of this version"):
            TubeTable.read(tmp_path / path)


def test_another_robot_or_tube_has_another_key(geometry: RobotGeometry) -> None:
    keys = {key_of(geometry, R), key_of(geometry, 0.015), key_of(geometry._replace(hand=-1.0), R)}
    assert len(keys) == 3
    assert key_of(geometry._replace(wavelength=geometry.wavelength * (1 + 1e-14)), R) == key_of(geometry, R)


def test_the_mirror_image_of_a_table_is_the_mirror_image_of_its_answers(places: Places, film: np.ndarray) -> None:
    table = packed(
        places, film, smooth, lambda t, f: np.stack([k * smooth(t, f) - k**2 for k in range(kernel.YAW_ORDERS)])
    )
    image = kernel.mirror_image(table)
    for e, pitch, yaw, phase in ((0.009, 0.02, 0.05, 0.3), (0.004, -0.04, -0.1, 2.0), (0.0, 0.01, 0.0, 5.0)):
        found = at(image, e, pitch, yaw, phase)[0]
        own = mirror_image(at(table, e, pitch, -yaw, np.pi - phase)[0])
        scale = np.sqrt(np.diag(found))
        np.testing.assert_allclose(found / np.outer(scale, scale), own / np.outer(scale, scale), atol=1e-9)
    again = kernel.parts_of(kernel.mirror_image(image))
    for found, own in zip(again, kernel.parts_of(table), strict=True):
        np.testing.assert_array_equal(found, own)


def test_tails_of_one_amplitude_have_all_places_in_common(geometry: RobotGeometry, places: Places) -> None:
    other = Places(geometry._replace(wavelength=0.01, hand=-1.0), R)
    np.testing.assert_array_equal(other.most, places.most)
    np.testing.assert_array_equal(other.most_yaw, places.most_yaw)
    wider = Places(geometry._replace(amplitude=0.0035), R)
    assert np.all(wider.most[:, 0] < places.most[:, 0])
    np.testing.assert_array_equal(wider.gaps, places.gaps)


def test_tails_solved_for_together_have_the_answers_that_each_has_alone(
    geometry: RobotGeometry, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SPIRILLUM_CACHE", "off")
    coarse = Fineness("standard", 0.05, order=4)
    short = geometry._replace(coupling_diameter=0.0, tail_length=0.02)
    tails = [short._replace(wavelength=w, amplitude=a) for w, a in ((0.02, 0.0025), (0.01, 0.002))]
    pose, elsewhere = TubePose(R, 0.0), TubePose(R, 0.002)
    want = [NodeSolution(((tail, (0.4,)),), pose, coarse) for tail in tails]
    told: list[int] = []
    together = solutions(
        [want[0], NodeSolution(((tails[0], (0.1,)),), elsewhere, coarse), want[1]],
        "places",
        lambda _what, _done, total: told.append(total),
        workers=1,
    )
    assert set(told) == {2}  # two places in all
    for place, found in zip(want, (together[0], together[2]), strict=True):
        tube._answer.cache_clear()
        (alone,) = solutions([place], "alone", workers=1)
        scale = np.sqrt(np.outer(np.diag(alone[0][0]), np.diag(alone[0][0])))
        np.testing.assert_allclose(found[0][0] / scale, alone[0][0] / scale, atol=1e-5)


def test_a_place_is_kept_once_all_phases_of_all_its_tails_are(
    geometry: RobotGeometry, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SPIRILLUM_CACHE", str(tmp_path))
    coarse = Fineness("standard", 0.05, order=4)
    tail = geometry._replace(coupling_diameter=0.0, tail_length=0.02, wavelength=0.02)
    one, more = (NodeSolution(((tail, phases),), TubePose(R, 0.0), coarse) for phases in ((0.4,), (0.4, 0.7)))
    assert not all_cached([one])
    tube._answer.cache_clear()
    solutions([one], "a place", workers=1)
    assert all_cached([one])
    assert not all_cached([one, more])
    monkeypatch.setenv("SPIRILLUM_CACHE", "off")
    assert not all_cached([one])


_UNGUARDED = """
from spirillum.worker_pool import imap_unordered
print("once")
print(min(answer for _, answer in imap_unordered(abs, [-1, -2], workers=2)))
"""


def test_a_script_without_a_guard_is_not_run_again_by_processes(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(_UNGUARDED)
    ended = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, check=False)
    assert ended.stdout.split() == ["once", "1"], ended.stderr


def test_on_the_axis_every_tilt_is_a_pitch() -> None:
    """A resistance that is made of invariants: of the tilt's size along it, and of a tail that turns about the axis."""

    def matrix(pitch: float, yaw: float, phase: float) -> np.ndarray:
        """In the frame F of a tilted axis, from what the tube and the wire define: X and two directions of the wire."""
        c, s = np.cos(pitch), np.sin(pitch)
        axis = np.array([c * np.cos(yaw), c * np.sin(yaw), s])
        side = np.array([-np.sin(yaw), np.cos(yaw), 0.0])
        frame = np.stack([axis, side, np.cross(axis, side)])  # rows
        along = frame @ np.array([1.0, 0.0, 0.0])
        wire = np.array([0.3, np.cos(phase), np.sin(phase)])
        rows = np.zeros((4, 8))
        rows[0, :3], rows[1, 3:6], rows[1, :3], rows[2, :3] = along, along, 0.2 * wire, np.cross(wire, along)
        rows[3, 3:6], rows[3, 6] = wire, 0.5
        return 2.0 * np.eye(8) + rows.T @ rows

    phases = np.array(even_phases(41))
    pitches = np.linspace(0.0, 0.2, 7)

    def coefficients(pitch: float, yaw: float) -> np.ndarray:
        return fourier(factor_of(np.stack([matrix(pitch, yaw, phase) for phase in phases]), "here"))

    raised = OnAxis.of(pitches, np.stack([coefficients(pitch, 0.0) for pitch in pitches]))
    for pitch, yaw in ((0.1, 0.0), (-0.13, 0.0), (0.05, 0.08), (-0.1, 0.06), (0.0, -0.07), (0.07, -0.1)):
        np.testing.assert_allclose(raised.coefficients(pitch, yaw), coefficients(pitch, yaw), atol=1e-6)


@pytest.mark.parametrize(
    "change",
    [
        {"radius": -0.02},
        {"radius": 0.021},
        {"radius": "x"},
        {"error": {}},
        {"error": dict.fromkeys(RESPONSES, -5.0)},
        {"error_without_yaw": {"forward_velocity": "NaN"}},
    ],
)
def test_a_table_whose_head_is_wrong_is_none(change: dict[str, Any], tmp_path: Path) -> None:
    path = next((Path(library.__file__).parent / "tables").glob("*.table"))
    head, packed = packed_from(path)
    (tmp_path / "a.table").write_bytes(to_bytes(json.dumps(head | change).encode(), packed))
    with pytest.raises(InputError, match="no table"):
        TubeTable.read(tmp_path / "a.table")


def test_tables_that_share_a_film_are_read_as_they_were_written(tmp_path: Path) -> None:
    table = shipped()
    table.write(tmp_path / "whole.table")
    table.write(tmp_path / "shared.table", "body.film")
    whole, shared = (TubeTable.read(tmp_path / name) for name in ("whole.table", "shared.table"))
    np.testing.assert_array_equal(shared.packed, whole.packed)
    np.testing.assert_allclose(shared.packed, table.packed, rtol=1e-6, atol=1e-9)
    (tmp_path / "body.film").unlink()
    with pytest.raises(InputError, match="no table"):
        TubeTable.read(tmp_path / "shared.table")


@lru_cache
def shipped() -> TubeTable:
    return TubeTable.read(next((Path(library.__file__).parent / "tables").glob("*.table")))


@pytest.mark.parametrize("count", [-1.0, 0.0, 0.5, 5.0, 13.0, 1e9, np.nan])
@pytest.mark.parametrize("column", ["_RINGS", "_GAPS", "_UP", "_DOWN", "_PHASES", "_YAW_GAPS", "_YAW_PITCHES"])
def test_a_packed_table_with_a_wrong_count_is_not_whole(column: str, count: float) -> None:
    table = shipped()
    assert kernel.is_whole(table.packed, table.radius)
    changed = table.packed.copy()
    own = changed[getattr(kernel, column)]
    changed[getattr(kernel, column)] = count
    assert kernel.is_whole(changed, table.radius) == (count == own)


@pytest.mark.parametrize(("column", "value"), [(0, 0.03), (1, np.nan), (1, 0.03), (9, 14.0), (12, -1.0), (14, -3.0)])
def test_a_packed_table_with_a_wrong_film_is_not_whole(column: int, value: float) -> None:
    table = shipped()
    changed = table.packed.copy()
    changed[kernel.film_start(changed) + column] = value
    assert not kernel.is_whole(changed, table.radius)
    assert not kernel.is_whole(table.packed, 1.001 * table.radius)
    assert not any(kernel.is_whole(table.packed[:size], table.radius) for size in (0, 5, 60, table.packed.size - 1))


def test_a_table_with_an_even_number_of_phases_is_none(tmp_path: Path) -> None:
    table = shipped()
    nodes = table.packed.copy()
    nodes[kernel._PHASES] = 4.0
    parts = kernel.parts_of(table.packed)
    even = parts._replace(nodes=nodes[: parts.nodes.size], rest=parts.rest[:, :, :4], yawed=parts.yawed[:, :, :, :4])
    replace(table, packed=even.packed()).write(tmp_path / "a.table")
    with pytest.raises(InputError, match="no table"):
        TubeTable.read(tmp_path / "a.table")
