"""Uneven stripes: edges are found where they were drawn, and the angle is that of the body."""

import numpy as np
import pytest

from spirillum.vision.track.widths import edge_shifts, evened

COUNT, PERIOD = 8, np.pi
EVEN = 2 * np.pi / COUNT
PLACES = np.radians([3.3, -3.4, -2.0, -3.3, -0.8, 5.5, -2.4, 3.1])


def planted(rate, frames=240, noise=0.0, places=PLACES):
    """Angles by an even pattern, as read, and edges' shifts, of a body with uneven stripes; and the true angle."""
    rng = np.random.default_rng(2)
    true = 0.4 + rate * np.arange(frames) / 30.0
    edge = (true[:, None] + EVEN * (np.arange(COUNT) - 0.5) + np.pi) % (2 * np.pi) - np.pi
    seen = np.abs(edge) < np.radians(52.0)
    shifts = np.where(seen, places, np.nan)
    weight = np.where(seen, np.cos(edge) ** 2, 0.0)
    own = np.sum(weight * places, axis=1) / weight.sum(axis=1)  # the fit follows the edges in view
    angle = true + own + noise * rng.standard_normal(frames)
    found = shifts - (angle - true)[:, None] + noise * rng.standard_normal(shifts.shape)
    turned = np.floor(angle / PERIOD).astype(int)
    which = (np.arange(COUNT)[None, :] + 4 * turned[:, None]) % COUNT
    return angle, angle % PERIOD, np.take_along_axis(found, which, axis=1), true


def slope(values):
    known = np.isfinite(values)
    return np.polyfit(np.arange(values.size)[known] / 30.0, values[known], 1)[0]


@pytest.mark.parametrize("rate", [-0.25, 0.25, -2.0])
def test_the_rate_is_that_of_the_body(rate):
    angle, read, edges, true = planted(rate, noise=np.radians(0.3))
    found = evened(angle, read, np.full(angle.size, 0.004), edges, PERIOD)
    off = found.angle - true
    assert np.nanstd(off) < np.radians(0.5)
    assert slope(found.angle) == pytest.approx(rate, rel=5e-3)
    if abs(rate) < 1.0:  # less than a turn: without the places it is wrong
        assert abs(slope(angle) / rate - 1.0) > 0.02
    assert [flag.name for flag in found.flags] == ["uneven-stripes"]
    assert not found.flags[0].spoils
    assert (found.error > 0.004).all()


def with_widths(*widths):
    """Edges' places of stripes of such widths, over even ones."""
    return np.cumsum([0.0, *(np.array(widths[:-1]) - 1.0)]) * EVEN


@pytest.mark.parametrize(
    ("rate", "places"),
    [
        (-0.25, with_widths(1.2, 1.2, 1.2, 1.2, 1.2, 1.2, 1.2, -0.4)),  # a wrong scale, or another number of stripes
        (0.08, with_widths(0.8, 0.82, 0.79, 2.4, 0.81, 0.8, 0.78, 0.8)),
        (-0.25, with_widths(1.0, 1.0, 1.35, 0.9, 1.0, 0.9, 0.95, 0.9)),
    ],
)
def test_widths_that_no_painter_leaves_are_not_believed(rate, places):
    angle, read, edges, _ = planted(rate, noise=np.radians(0.3), places=places)
    edges[np.abs(edges) > np.radians(14.0)] = np.nan  # farther away no edge is looked for
    found = evened(angle, read, np.full(angle.size, 0.004), edges, PERIOD)
    assert [flag.name for flag in found.flags] == ["stripes-do-not-fit"]
    assert found.flags[0].spoils == ("body_rotation_rate",)
    assert found.angle is angle


def test_stripes_by_hand_that_turn_by_a_part_of_a_turn_are_believed():
    """Widths evenly spread up to a fifth; by chance some are all to one side, one film in fifty."""
    doubted = 0
    for seed in range(60):
        widths = 1.0 + 0.2 * np.random.default_rng(seed).uniform(-1.0, 1.0, COUNT)
        places = with_widths(*(widths * COUNT / widths.sum()))
        angle, read, edges, _ = planted(0.05 + 0.004 * seed, noise=np.radians(0.3), places=places - places.mean())
        found = evened(angle, read, np.full(angle.size, 0.004), edges, PERIOD)
        doubted += "stripes-do-not-fit" in [flag.name for flag in found.flags]
    assert doubted <= 4


@pytest.mark.parametrize("rate", [-0.08, 0.08, 0.05])
def test_a_body_that_looks_smaller_than_its_file_says_has_even_stripes_all_the_same(rate):
    """Angles are read with a radius that is 2 % too large, over a third to a half of a turn."""
    rng, t = np.random.default_rng(3), np.arange(240) / 30.0
    true = 0.4 + 2.0 * np.pi * rate * t
    edge = (true[:, None] + EVEN * (np.arange(COUNT) - 0.5) + np.pi) % (2 * np.pi) - np.pi
    read = np.arcsin(np.sin(edge) * np.where(np.abs(edge) < np.radians(52.0), 0.98, np.nan))
    shifts = read - edge  # against the true angle
    weight = np.where(np.isfinite(shifts), np.cos(edge) ** 2, 0.0)
    own = np.nansum(weight * shifts, axis=1) / weight.sum(axis=1)  # the fit follows the edges in view
    angle = true + own
    edges = shifts - own[:, None] + np.radians(0.1) * rng.standard_normal(shifts.shape)
    turned = np.floor(angle / PERIOD).astype(int)
    which = (np.arange(COUNT)[None, :] + 4 * turned[:, None]) % COUNT
    edges = np.take_along_axis(edges, which, axis=1)
    found = evened(angle, angle % PERIOD, np.full(angle.size, 0.004), edges, PERIOD)
    assert [flag.name for flag in found.flags] == ["stripes-of-another-size"]
    assert found.angle is angle
    assert abs(slope(found.angle) / (2.0 * np.pi * rate) - 1.0) < 0.01
    assert 0.005 < found.drift / np.ptp(angle) < 0.02  # paint would be as likely: twice that holds it


def test_what_paint_and_size_leave_open_is_in_the_uncertainty():
    """Stripes uneven by a twentieth to a fifth, of which parts are seen: the truth lies within three of the stated."""
    far = 0
    for seed in range(120):
        draw = np.random.default_rng(seed)
        widths = 1.0 + draw.choice([0.05, 0.1, 0.2]) * draw.uniform(-1.0, 1.0, COUNT)
        rate = draw.uniform(0.2, 0.6)
        places = with_widths(*(widths * COUNT / widths.sum()))
        angle, read, edges, true = planted(rate, noise=np.radians(0.3), places=places - places.mean())
        found = evened(angle, read, np.full(angle.size, 0.004), edges, PERIOD)
        if found.drift:
            far += abs(np.ptp(found.angle) - np.ptp(true)) > 3.0 * found.drift + np.radians(2.0)
    assert far <= 4


def test_even_stripes_are_left_as_they_are():
    angle, read, edges, _ = planted(-0.25, noise=np.radians(0.3), places=np.zeros(COUNT))
    found = evened(angle, read, np.full(angle.size, 0.004), edges, PERIOD)
    assert found.angle is angle
    assert not found.flags


def test_too_few_edges_change_nothing():
    angle, read, edges, _ = planted(-0.25)
    edges[:, 1:] = np.nan
    assert evened(angle, read, np.full(angle.size, 0.004), edges, PERIOD).angle is angle


def test_edges_are_found_where_they_are_drawn():
    from scipy.special import ndtr

    angles = np.radians(np.arange(-78.0, 78.1, 1.5))
    colours = np.array([[200, 30, 30], [210, 190, 40], [40, 130, 50], [40, 60, 190]] * 2, dtype=float)
    body, blur = 0.3, np.full(angles.size, 0.03)
    picture = np.repeat(colours[-1:], angles.size, axis=0)
    for turn in range(-COUNT, COUNT):
        edge = turn % COUNT
        at = body + (turn - 0.5) * EVEN + PLACES[edge]
        picture += (colours[edge] - colours[edge - 1]) * ndtr((angles - at) / blur)[:, None]
    shade = np.column_stack([np.full((angles.size, 3), 0.8), np.full((angles.size, 3), 5.0)])
    found = edge_shifts(0.8 * picture + 5.0, angles, blur, shade, colours, body)
    seen = np.isfinite(found)
    assert seen.sum() >= 2
    assert found[seen] == pytest.approx(PLACES[seen], abs=np.radians(0.4))


def test_one_frame_does_not_say_how_two_groups_of_edges_lie_to_each_other():
    """Even stripes, of which three were seen before a gap and three after it; one edge in between is misread."""
    edges = np.full((61, COUNT), np.nan)
    edges[:30, :3], edges[31:, 3:6] = 0.0, 0.0
    edges += np.radians(0.2) * np.random.default_rng(4).standard_normal(edges.shape)
    edges[30, 2:4] = 0.0, np.radians(5.0)
    angle = np.linspace(0.0, 0.4, 61)
    found = evened(angle, angle, np.full(61, 0.004), edges, PERIOD)
    assert found.flags == ()
    assert found.angle is angle
