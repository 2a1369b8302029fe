"""The tracker's compiled loops against short NumPy references: edges, contours, stripes and the wave of the tail."""

import numpy as np
import pytest
from scipy.special import ndtr

from spirillum.kernels.core import (
    edge_places,
    edge_points,
    profile_of_rows,
    profiles_across,
    ridge_of,
    robust_change,
    sampled,
    shifts_of_profiles,
    stripe_edges,
    stripe_fit,
    stripes_at,
    sums_along,
    wave_fit,
    wave_scores,
)
from spirillum.vision.camera.optics import Optics


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(5)


def unit(rng: np.random.Generator, count: int) -> np.ndarray:
    angle = rng.uniform(0.0, 2.0 * np.pi, count)
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


def test_contours_are_chebyshev_series_of_the_lens(rng: np.random.Generator) -> None:
    factors, normals = rng.normal(size=(8, 5, 4, 150)) * 1e-3, unit(rng, 150)
    pose, reach, found = np.array([0.02, -0.01, 0.2]), np.array([0.1, 0.05]), np.empty((150, 2))
    edge_points(pose, factors, normals, reach, found)
    turn = np.array([[np.cos(0.2), np.sin(0.2)], [-np.sin(0.2), np.cos(0.2)]])
    points = np.polynomial.chebyshev.chebval2d(*(-turn @ pose[:2] / reach), factors)
    outer = (points[2] - points[0]) * normals[:, 0] > 0.0
    assert np.allclose(found, np.where(outer, points[2:], points[:2]).T, rtol=0.0, atol=1e-15)


def test_places_and_slopes_are_those_of_the_camera(rng: np.random.Generator) -> None:
    camera = Optics((640, 480), 740.0, 0.21, 0.0115, 0.06, 1.4, k1=-0.02)
    factors, normals, count = np.zeros((8, 5, 4, 60)), unit(rng, 60), 60
    factors[0, 0, :2] = rng.uniform(-0.02, 0.02, (2, 60))
    factors[0, 0, 2:] = factors[0, 0, :2]
    pose, reach = np.array([0.01, 0.005, 0.1]), np.ones(2)
    pixels, directions, size, slopes = np.empty((count, 2)), np.empty((count, 2)), np.empty(count), np.empty((count, 3))
    edge_places(pose, factors, normals, reach, 0.0115, camera.numbers, pixels, directions, size, slopes)

    def seen(moved: np.ndarray, local: np.ndarray) -> np.ndarray:
        cos, sin = np.cos(moved[2]), np.sin(moved[2])
        places = moved[:2] + local @ np.array([[cos, sin], [-sin, cos]])
        return camera.pixels(np.column_stack([places, np.full(count, 0.0115)]))

    local, step = factors[0, 0, :2].T, 1e-5
    assert np.allclose(pixels, seen(pose, local), rtol=0.0, atol=1e-9)
    along = (seen(pose, local + step * normals) - pixels) / step
    assert np.allclose(directions * size[:, None], along, rtol=1e-3)
    for number, change in enumerate(np.eye(3) * step):
        moved = np.sum((seen(pose + change, local) - pixels) * directions, axis=1) / step
        assert np.allclose(slopes[:, number], moved, atol=0.02 * np.abs(slopes[:, number]).max())


def test_profiles_follow_a_parabola_exactly_and_end_at_the_border(rng: np.random.Generator) -> None:
    v, u = np.mgrid[:40, :50]
    picture = np.stack([u**2 - u * v + 3 * v, 5 * u + v], axis=-1).astype(np.float32)
    pixels, normals, offsets = rng.uniform([0.0, 0.0], [60.0, 50.0], (80, 2)), unit(rng, 80), np.arange(-3.0, 4.0)
    found = np.empty((2, 80, 7))
    profiles_across(picture, np.array([5.0, 4.0]), pixels, normals, offsets, found)
    x, y = np.moveaxis(pixels[:, None] + offsets[:, None] * normals[:, None] - [5.0, 4.0], -1, 0)
    inside = (x >= 1.0) & (x < 48.0) & (y >= 1.0) & (y < 38.0)
    assert np.array_equal(np.isfinite(found), [inside, inside])
    assert np.allclose(found[0][inside], (x**2 - x * y + 3.0 * y)[inside], rtol=1e-12)
    assert np.allclose(found[1][inside], (5.0 * x + y)[inside], rtol=1e-12)


def test_shifts_are_those_of_linear_least_squares(rng: np.random.Generator) -> None:
    at = np.arange(13.0) - 6.0
    profiles, templates = rng.normal(size=(30, 13)), rng.normal(size=(30, 13))
    templates -= templates.mean(axis=1, keepdims=True)
    templates -= (templates @ at)[:, None] * at / (at @ at)
    slopes = np.gradient(templates, axis=1)
    profiles[0, 3], slopes[1] = np.nan, 2.0 * templates[1]
    shifts, strengths, residuals = (np.empty(30) for _ in range(3))
    shifts_of_profiles(profiles, templates, slopes, shifts, strengths, residuals)
    assert np.isnan(shifts[:2]).all()
    assert np.all(strengths[:2] == 0.0)
    for k in range(2, 30):
        design = np.stack([np.ones(13), at, templates[k], slopes[k]], axis=1)
        fit, rest, *_ = np.linalg.lstsq(design, profiles[k], rcond=None)
        assert (strengths[k], shifts[k]) == pytest.approx((fit[2], -fit[3] / fit[2]), rel=1e-9)
        assert residuals[k] == pytest.approx(np.sqrt(rest[0] / 9.0), rel=1e-9)


@pytest.mark.parametrize(("count", "least"), [(40, 0.0), (41, 1.0)])
def test_a_robust_change_is_that_of_reweighted_least_squares(
    rng: np.random.Generator, count: int, least: float
) -> None:
    slopes, weights = rng.normal(size=(count, 3)) * [700.0, 700.0, 20.0], rng.uniform(0.5, 2.0, count)
    shifts = slopes @ [1e-3, -5e-4, 0.01] + 0.3 * rng.normal(size=count)
    shifts[::9] += 20.0
    weights[::7] = 0.0
    used, change = np.empty(count), np.empty(3)
    level = robust_change(shifts, slopes, weights, least, np.empty((2, count)), used, change)
    known, now = weights > 0.0, weights * np.minimum(1.0, 0.5 / np.abs(shifts))
    for _ in range(6):
        root = np.sqrt(now)
        expected = np.linalg.lstsq(root[:, None] * slopes, root * shifts, rcond=None)[0]
        misses = np.abs(shifts - slopes @ expected) * np.sqrt(weights)
        scale = max(0.5, 1.4826 * np.median(misses[known]))
        now = weights * np.maximum(1.0 - (misses / (4.685 * max(least, scale))) ** 2, 0.0) ** 2
    assert change == pytest.approx(expected, rel=1e-6)
    assert level == pytest.approx(scale, rel=1e-6)
    assert used == pytest.approx(now, rel=1e-5, abs=1e-6)


def test_sides_that_fit_well_reject_no_end_within_its_error() -> None:
    """150 sides without any misfit, and 20 ends whose shifts are up to 2.6 of their errors from the mean of them."""
    slopes = np.repeat([[0.0, 1.0, 0.0], [1.0, 0.0, 1e-3]], (150, 20), axis=0)
    slopes[:150, 2] = np.linspace(-1.0, 1.0, 150)
    shifts = np.concatenate([np.zeros(150), 1.0 + np.linspace(-2.6, 2.6, 20)])
    used, change = np.empty(170), np.empty(3)
    level = robust_change(shifts, slopes, np.ones(170), 1.0, np.empty((2, 170)), used, change)
    assert level == 0.5
    assert change[0] == pytest.approx(1.0, abs=0.02)  # six steps
    assert used.min() > 0.4


def test_sums_take_the_nearest_sample_of_each_row(rng: np.random.Generator) -> None:
    rows, design, trials = rng.normal(size=(9, 20)), rng.normal(size=(9, 4)), rng.normal(size=(7, 4))
    found = np.empty(7)
    sums_along(rows, design, 9.5, trials, found)
    at = np.round(9.5 + trials @ design.T).astype(int)
    inside = (at >= 0) & (at < 20)
    values = np.where(inside, rows[np.arange(9), np.clip(at, 0, 19)], 0.0)
    assert np.allclose(found, values.sum(axis=1), rtol=1e-12)


def colours_at(image: np.ndarray, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Bilinear interpolation; NaN outside."""
    height, width, _ = image.shape
    inside = (u >= 0.0) & (u <= width - 1.0) & (v >= 0.0) & (v <= height - 1.0)
    j, i = (np.clip(np.floor(x), 0, size - 2).astype(int) for x, size in ((u, width), (v, height)))
    b, a = (u - j)[..., None], (v - i)[..., None]
    upper = image[i, j] * (1.0 - b) + image[i, j + 1] * b
    lower = image[i + 1, j] * (1.0 - b) + image[i + 1, j + 1] * b
    return np.where(inside[..., None], upper * (1.0 - a) + lower * a, np.nan)


def test_samples_are_bilinear_and_profiles_their_interquartile_means(rng: np.random.Generator) -> None:
    image = rng.integers(0, 256, (30, 40, 3), dtype=np.uint8)
    pixels, found = rng.uniform(-5.0, 45.0, (200, 2)), np.empty((200, 3))
    pixels[0] = 39.0, 29.0
    for shown in (image, image[::-1, :, ::-1]):  # a view with gaps too
        sampled(shown, pixels, found)
        assert np.allclose(found, colours_at(shown, *pixels.T), rtol=1e-12, equal_nan=True)
    first, last, colours = pixels[:50], pixels[50:100], np.empty((50, 3))
    profile_of_rows(image, first, last, np.empty((3, 12)), colours)
    on_line = first[:, None] + ((np.arange(12) + 0.5) / 12)[:, None] * (last - first)[:, None]
    samples = np.sort(colours_at(image, *np.moveaxis(on_line, -1, 0)), axis=1)  # NaN at the end
    for line, colour in zip(samples, colours, strict=True):
        seen = int(np.isfinite(line[:, 0]).sum())
        expected = line[seen // 4 : seen - seen // 4].mean(axis=0) if 2 * seen >= 12 else np.full(3, np.nan)
        assert colour == pytest.approx(expected, rel=1e-12, nan_ok=True)


ORDER, PALETTE = np.array([0, 1, 2, 3] * 2), np.array([[200.0, 40, 40], [220, 200, 30], [40, 150, 60], [40, 60, 180]])


def striped(angles: np.ndarray, blur: float, roll: float) -> np.ndarray:
    """Colours of blurred stripes: a stripe's share is the normal distribution's between its edges."""
    edges = roll + np.pi / 4.0 * (np.arange(-40, 41) - 0.5)
    share = np.diff(ndtr((angles[:, None] - edges) / blur), axis=1)
    return np.asarray(-share @ PALETTE[ORDER[np.arange(-40, 40) % 8]])


def test_stripes_are_blurred_by_a_normal_distribution() -> None:
    angles, found = np.linspace(-1.3, 1.3, 90), np.empty((90, 3))
    for roll in (0.3, -4.0):
        stripes_at(angles, np.full(90, 0.05), roll, ORDER, PALETTE, found)
        assert np.allclose(found, striped(angles, 0.05, roll), atol=0.02)  # beyond three blurs an edge is sharp


def test_the_fitted_angle_is_the_one_of_least_loss(rng: np.random.Generator) -> None:
    angles, roll = np.linspace(-1.3, 1.3, 105), 2.1
    profile = 1.2 * striped(angles, 0.05, roll) + rng.normal(size=(105, 3))
    profile[20:30] = np.nan
    scale, shade = 30.0 * np.cos(angles), np.column_stack([np.ones((105, 3)), np.zeros((105, 3))])
    losses, answer = np.empty(90), np.full(8, np.nan)
    settings = (np.pi, 3.0, 60.0, 1.0, 0.05 * 30.0)
    known = profile, scale, np.ones(105), angles, shade, ORDER, PALETTE
    stripe_fit(*known, *settings, np.empty((105, 17)), losses, answer)
    assert answer[0] == pytest.approx(roll, abs=5.0 * answer[1])
    assert answer[1] < 0.01
    assert answer[5:] == pytest.approx(1.2, rel=0.01)
    assert answer[2] < 0.05
    assert answer[4] > 0.9
    apart = np.abs((np.arange(90) - np.argmin(losses) + 45) % 90 - 45)
    assert answer[3] == losses[apart > 7].min()  # 0.35 of a stripe's width in steps of 2 degrees
    unseen = np.full(8, np.nan)
    stripe_fit(np.full((105, 3), np.nan), *known[1:], *settings, np.empty((105, 17)), losses, unseen)
    assert np.isnan(unseen).all()


STEP, XI = 1e-4, np.linspace(2e-3, 0.07, 150)
WAVE = np.array([-250.0, -3.0, 60.0, 4e-3])


def curve_of(phase: np.ndarray | float, tilt: np.ndarray) -> np.ndarray:
    """Lateral places of the wire in each row, by rows and phases."""
    e, f, g = tilt.T[..., None]
    at = XI[:, None]
    for _ in range(2):  # the height is that of the row's own place, then that of the place that it shows
        r, a = WAVE[3] * (1.0 - np.exp(-WAVE[2] * at)), WAVE[0] * at + WAVE[1] + phase
        y, z = r * np.cos(a), r * np.sin(a)
        at = XI[:, None] - e * z
    r, a = WAVE[3] * (1.0 - np.exp(-WAVE[2] * at)), WAVE[0] * at + WAVE[1] + phase
    y, z = r * np.cos(a), r * np.sin(a)
    return np.asarray(y + f * z + g * y * z)


def test_a_ridge_is_the_weaker_step_to_both_sides(rng: np.random.Generator) -> None:
    image = rng.integers(0, 256, (60, 80, 3), dtype=np.uint8)
    middle, across = np.linspace([10.0, 30.0], [75.0, 20.0], 40), np.tile([0.05, 0.4], (40, 1))
    contrast, found = np.array([-0.5, 0.6, -0.2]), np.empty((40, 61))
    ridge_of(image, middle, across, contrast, 2, np.empty((2, 61)), found)
    places = middle[:, None] + (np.arange(61) - 30.0)[:, None] * across[:, None]
    lines = colours_at(image, places[..., 0], places[..., 1]) @ contrast
    for line, ridge in zip(lines, found, strict=True):
        if np.isnan(line).any():
            assert np.isnan(ridge).all()
            continue
        for j in range(61):
            low, high = max(0, j - 2), min(61, j + 3)
            sides = [part.mean() for part in (line[max(0, low - 5) : low], line[high : high + 5]) if part.size]
            assert ridge[j] == pytest.approx(min(line[low:high].mean() - side for side in sides), abs=1e-9)


def test_scores_are_mean_ridges_along_the_wire(rng: np.random.Generator) -> None:
    ridge, tilt = rng.normal(size=(150, 131)), rng.normal(size=(150, 3)) * [0.0, 0.05, 1.0]
    ridge[:20] = np.nan
    phases, found = 2.0 * np.pi * np.arange(40) / 40, np.empty(40)
    wave_scores(ridge, XI, tilt, WAVE, STEP, 3, np.column_stack([np.cos(phases), np.sin(phases)]), found)
    at, rows = curve_of(phases, tilt) / STEP + 65.0, np.arange(21, 150, 3)
    expected = [np.mean([np.interp(at[i, n], np.arange(131), ridge[i]) for i in rows]) for n in range(40)]
    assert found == pytest.approx(expected, abs=1e-12)
    ridge[:140] = np.nan
    wave_scores(ridge, XI, tilt, WAVE, STEP, 3, np.column_stack([np.cos(phases), np.sin(phases)]), found)
    assert np.isnan(found).all()


def test_a_fitted_wave_has_the_phase_offset_and_tilt_of_its_ridge(rng: np.random.Generator) -> None:
    tilt = np.column_stack([np.full(150, 0.03), np.full(150, 0.05), np.full(150, 1.0)])
    lean = 0.01 * (XI - XI.mean())
    away = (np.arange(131) - 65.0) * STEP - (curve_of(1.0, tilt)[:, 0] + 2e-4 + lean)[:, None]
    ridge = 60.0 * np.exp(-0.5 * (away / 4e-4) ** 2) + 0.5 * rng.normal(size=(150, 131))
    answer = np.full(10, np.nan)
    wave_fit(ridge, XI, tilt, WAVE, 1.15, STEP, 9e-4, 30.0, 3e-4, 1.4e-3, np.empty((150, 10)), answer)
    assert answer[0] == pytest.approx(1.0, abs=5.0 * answer[1])
    assert 0.0 < answer[1] < 0.005
    assert answer[2] > 0.95
    assert answer[3:5] == pytest.approx([2e-4, 0.01], rel=0.1)
    assert abs(answer[5] / answer[6]) < 0.2  # the handedness is as assumed
    assert abs(answer[7] / answer[8]) < 0.02  # so is the amplitude
    unseen = np.full(10, np.nan)
    ridge[:] = np.nan
    wave_fit(ridge, XI, tilt, WAVE, 1.15, STEP, 9e-4, 30.0, 3e-4, 1.4e-3, np.empty((150, 10)), unseen)
    assert np.isnan(unseen).all()


def test_edges_between_stripes_are_those_of_the_least_squares(rng: np.random.Generator) -> None:
    count, width = 60, 2.0 * np.pi / 8
    angles, tried = np.linspace(-1.3, 1.3, count), np.linspace(-0.25, 0.25, 41)
    colours, blur = rng.uniform(0.0, 250.0, (8, 3)), rng.uniform(0.02, 0.06, count)
    colours[3] = colours[2]  # no edge to be seen
    shade = np.column_stack([rng.uniform(0.6, 1.0, (count, 3)), rng.uniform(0.0, 9.0, (count, 3))])
    levels, roll, found = np.empty((count, 3)), 2.6, np.empty(8)
    stripes_at(angles, blur, roll + 0.04, np.arange(8), colours, levels)
    levels = shade[:, :3] * levels + shade[:, 3:] + rng.normal(size=levels.shape)
    levels[-3, 1] = np.nan
    limits = tried[1] - tried[0], 0.9, 0.42, 40.0, 8
    stripe_edges(levels, angles, blur, shade, colours, roll, tried, *limits, np.empty(tried.size), found)
    for edge in range(8):
        place = np.remainder(roll + (edge - 0.5) * width + np.pi, 2.0 * np.pi) - np.pi
        near = np.abs(angles - place) < 0.42 * width
        if abs(place) > 0.9 or edge == 3 or not np.isfinite(levels[near]).all():
            assert np.isnan(found[edge])
            continue
        share = ndtr((angles[near] - place - tried[:, None]) / blur[near])[..., None]
        model = shade[near, :3] * (colours[edge - 1] + share * (colours[edge] - colours[edge - 1])) + shade[near, 3:]
        losses = np.sum((levels[near] - model) ** 2, axis=(1, 2))
        best = int(np.argmin(losses))
        low, middle, high = losses[best - 1 : best + 2]
        shift = tried[best] + 0.5 * limits[0] * (low - high) / (low - 2.0 * middle + high)
        assert found[edge] == pytest.approx(shift, abs=1e-9)
        assert shift == pytest.approx(0.04, abs=0.02)
    assert np.isfinite(found).sum() >= 2
