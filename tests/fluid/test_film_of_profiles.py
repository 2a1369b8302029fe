"""Lubrication films of bodies of any profile: those of the bodies that the points are of, and what is refused."""

from typing import Any

import numpy as np
import pytest

import spirillum as sp
from spirillum.errors import InputError
from spirillum.fluid.tube.film import film_resistance
from spirillum.fluid.tube.film_surface import FilmBody
from spirillum.fluid.tube.nodes import rings_of
from spirillum.kernels import core
from spirillum.kernels.core import clearance, contact_offset, smallest_gap
from spirillum.robot.outline import Outline, body_outline, profile_outline
from spirillum.robot.tube_pose import TubePose

TUBE, A = 20e-3, 9e-3


def half_ellipse(along: float, across: float, count: int = 97) -> np.ndarray:
    """Points of a half spheroid from its pole to where it is widest, mm."""
    t = np.linspace(0.0, 0.5 * np.pi, count)
    rows = np.stack([along * np.cos(t), across * np.sin(t)], axis=1)
    rows[0, 1] = 0.0
    return rows


def ogive(radius: float, count: int = 61) -> np.ndarray:
    """Points of a nose that is an arc of a circle and joins a side of 9 mm tangentially, mm."""
    t = np.linspace(np.arccos((radius - 9.0) / radius), 0.0, count)
    rows = np.stack([radius * np.sin(t), radius * np.cos(t) - radius + 9.0], axis=1)
    rows[0, 1] = 0.0
    return rows


def body_of(front: np.ndarray, rear: np.ndarray, side: float) -> Outline:
    """A body with both ends and a side between them."""
    middle = np.array([0.5 * side, 0.0])
    points = [*(front + middle).tolist(), *(rear * [-1.0, 1.0] - middle)[::-1][0 if side else 1 :].tolist()]
    return profile_outline(tuple(map(tuple, points)))


FLAT = np.array([[0.0, 0.0], [0.0, 9.0]])
BODIES = {
    "capsule": body_of(half_ellipse(9.0, 9.0), half_ellipse(9.0, 9.0), 17.0),
    "ogive": body_of(ogive(27.0), FLAT, 20.0),
    "blunt": body_of(ogive(12.0), half_ellipse(9.0, 9.0), 20.0),
    "cone": body_of(np.array([[12.0, 0.0], [0.0, 9.0]]), half_ellipse(9.0, 9.0), 20.0),
    "spheroid": body_of(half_ellipse(17.5, 9.0), half_ellipse(17.5, 9.0), 0.0),
    "cut spheroid": body_of(half_ellipse(17.5, 9.0), np.array([[11.0, 0.0], *half_ellipse(17.5, 9.0)[55:]]), 0.0),
}


def head_of(body: FilmBody) -> np.ndarray:
    head = np.zeros(15)
    head[:7] = TUBE, body.radius, body.half, *body.rear, *body.front
    return head


@pytest.mark.parametrize("name", BODIES)
@pytest.mark.parametrize(("pitch", "yaw"), [(0.0, 0.0), (0.12, 0.0), (-0.1, 0.05), (0.03, -0.1)])
def test_gap_and_contact_are_those_of_the_outline(name: str, pitch: float, yaw: float) -> None:
    """To the tolerance with which circles and spheroids stand for it; of the film, the sites and the table's floor."""
    outline = BODIES[name]
    body = FilmBody.of(outline)
    allowed = 6e-4 * A
    pose = TubePose.at_gap(outline, TUBE, 1e-3, pitch, yaw=yaw)
    assert smallest_gap(head_of(body), pose.offset, pitch, yaw) == pytest.approx(1e-3, abs=allowed)
    state, (along, up, right) = np.zeros(core.STATE_SIZE), pose.rotation
    state[2] = -pose.offset
    flip = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])  # (x, up, right) to (x, left, up)
    rotation = np.ascontiguousarray(flip @ np.stack([along, up, right]) @ flip.T)
    normal, point, j = np.empty(3), np.empty(3), np.empty(7)
    gaps = []
    for ring in body.rings:
        gaps.append(core.ring_gap(state, rotation, TUBE, np.array([*ring, 0.0]), normal, point, j))
        touching = state[:3] + rotation @ point
        assert TUBE - np.hypot(*touching[1:]) == pytest.approx(gaps[-1], abs=1e-12)
    assert min(gaps) == pytest.approx(1e-3, abs=allowed)
    if yaw == 0.0:
        floor = TubePose.at_gap(outline, TUBE, 0.0, pitch).offset
        assert contact_offset(rings_of(outline), TUBE, pitch) == pytest.approx(floor, abs=allowed)
        lift = np.sin(pitch)
        depths = [
            clearance(head_of(body), x, half, ring, ball, pose.offset, lift, 0.0) for x, ring, half, ball in body.rings
        ]
        assert min(depths) == pytest.approx(floor - pose.offset, abs=2.0 * allowed)


@pytest.mark.parametrize("place", [(0.0101, 0.0, 0.0), (0.0098, 0.02, 0.01)])
def test_films_of_points_are_those_of_the_bodies(place: tuple[float, float, float]) -> None:
    known = {
        "capsule": body_outline("capsule", 2 * A, 35e-3, 0.0, "hemisphere", "hemisphere"),
        "spheroid": body_outline("spheroid", 2 * A, 35e-3, 0.0, None, None),
    }
    for name, outline in known.items():
        own, points = (film_resistance(one, TUBE, *place) for one in (outline, BODIES[name]))
        roots = np.sqrt(np.diag(own))
        assert np.abs((points - own) / np.outer(roots, roots)).max() < 0.02, name


def test_the_film_under_a_slender_nose_is_that_of_its_circle() -> None:
    """Nose down an ogive nears the wall at a point: the closed form of two curved surfaces."""
    outline, pitch = BODIES["ogive"], -0.05
    body = FilmBody.of(outline)
    head, ball, normal = head_of(body), body.front[1], np.array([np.sin(-pitch), 0.0, np.cos(pitch)])
    ring = (A - ball + ball * np.cos(pitch)) / np.cos(pitch)
    across = ring * TUBE / (TUBE - ring)
    for gap, allowed in ((1e-5, 0.1), (1e-6, 0.01)):
        offset = TUBE - A
        for _ in range(30):
            offset += smallest_gap(head, offset, pitch, 0.0) - gap
        resistance = film_resistance(outline, TUBE, offset, pitch, 0.0)
        point = 12 * np.pi * (ball * across) ** 1.5 / ((ball + across) * gap)
        assert normal @ resistance[:3, :3] @ normal == pytest.approx(point, rel=allowed)
        assert np.linalg.eigvalsh(resistance).min() > 0.0


@pytest.mark.parametrize(
    ("points", "words"),
    [
        ([[20, 0], [12, 9], [0, 6], [-12, 9], [-20, 0]], "its side has a waist"),
        ([[12, 0], [0, 9], [-12, 0]], "an edge where it is widest"),
        ([[20, 0], [15, 8], [-15, 9], [-20, 0]], "off circles beside a straight side, or off a spheroid"),
    ],
)
def test_what_has_no_film_is_a_sentence(points: Any, words: str) -> None:
    robot = sp.load("biorob2012-wide", seal="none", **{"body.profile": points})
    with pytest.raises(InputError, match=r"lubrication film of body\.profile is not known") as caught:
        sp.prepare(robot, stage="straight")
    assert words in str(caught.value)
