"""The virtual camera's compiled loops against short NumPy references: light on triangles, samples, films' bytes."""

import numpy as np
import pytest

from spirillum.kernels.core import blend, develop, draw, shade, still_picture
from spirillum.virtual.optics import VirtualLens, spots

EMPTY = np.float32(-1e30)
SPOTS = np.ascontiguousarray(np.swapaxes(spots(4), 1, 2))


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(8)


def unit(vectors: np.ndarray) -> np.ndarray:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def test_corners_reflect_by_blinn_and_phong(rng: np.random.Generator) -> None:
    normals, towards, strength = unit(rng.normal(size=(50, 3, 3))), unit(rng.normal(size=(2, 3))), np.array([0.6, 0.4])
    halfway, turn = unit(towards + np.array([0.0, 0.0, 1.0])), np.linalg.qr(rng.normal(size=(3, 3)))[0]
    materials, kind = np.array([[0.3, 0.7, 0.4, 60.0], [0.2, 0.5, 0.7, 25.0]]), rng.integers(0, 2, 50)
    diffuse, specular = np.empty((50, 3)), np.empty((50, 3))
    shade(normals, turn, towards, halfway, strength, materials, kind, diffuse, specular)
    ambient, matt, shiny, exponent = materials[kind].T[..., None]
    facing, half = normals @ turn.T @ towards.T, normals @ turn.T @ halfway.T
    assert np.allclose(diffuse, ambient + matt * (np.maximum(facing, 0.0) @ strength), rtol=1e-13)
    highlight = np.where(half > 0.6, np.maximum(half, 0.0) ** exponent[..., None], 0.0)
    assert np.allclose(specular, shiny * (highlight @ strength), rtol=1e-12, atol=1e-300)


@pytest.mark.parametrize(("first", "every"), [(0, 1), (1, 3)])
def test_the_highest_triangle_is_drawn_at_each_sample(rng: np.random.Generator, first: int, every: int) -> None:
    left, top, rows, columns, count = 2, 5, 20, 25, 12
    seen = np.column_stack([rng.uniform(0.0, 30.0, (3 * count, 2)), rng.uniform(0.0, 1.0, 3 * count)])
    faces, colour = np.arange(3 * count).reshape(-1, 3), rng.uniform(0.1, 1.0, (count, 3))
    depth, picture = np.full((rows, columns, 16), EMPTY), np.zeros((rows, columns, 16, 3), dtype=np.float32)
    none, full = np.zeros((count, 3)), np.ones((count, 3))
    draw(seen, faces, colour, none, full, none, SPOTS, first, every, left, top, depth, picture)
    v, u, k = np.meshgrid(np.arange(rows) + top, np.arange(columns) + left, np.arange(first, 16, every), indexing="ij")
    places = np.stack([u, v], axis=-1) + SPOTS[4 * (v & 3) + (u & 3), :, k]
    highest, colours = np.full(k.shape, -1e30), np.zeros((*k.shape, 3))
    for triangle, own in zip(seen[faces], colour, strict=True):
        corners, heights = triangle[:, :2], triangle[:, 2]
        edges = (corners[1:] - corners[0]).T
        if np.linalg.det(edges) >= 0.0:
            continue
        shares = np.moveaxis(np.linalg.solve(edges, (places - corners[0])[..., None])[..., 0], -1, 0)
        inside = np.minimum(shares.min(axis=0), 1.0 - shares.sum(axis=0)) >= 0.0
        height = heights[0] + np.tensordot(heights[1:] - heights[0], shares, 1)
        front = inside & (height > highest)
        highest[front], colours[front] = height[front], own
    mine = depth[..., first::every], picture[..., first::every, :]
    hit = highest > -1e29
    assert 0.2 < hit.mean() < 0.9
    assert np.allclose(mine[0][hit], highest[hit], rtol=1e-6)
    assert np.array_equal(mine[0] > -1e29, hit)
    assert np.allclose(mine[1][hit], colours[hit], rtol=1e-6)
    assert (depth > -1e29).sum() == hit.sum()  # other moments are as they were


def test_samples_and_shadow_are_blended_with_the_still_parts(rng: np.random.Generator) -> None:
    rows, columns, left, top = 6, 8, 2, 1
    depth = np.where(rng.random((rows, columns, 16)) < 0.5, np.float32(0.01), EMPTY)
    depth[0], depth[1] = EMPTY, 0.01
    hit = depth > -1e29
    samples = rng.uniform(0.0, 1.0, (rows, columns, 16, 3)).astype(np.float32)
    over, shine = rng.uniform(0.0, 1.0, (2, 9, 12)).astype(np.float32)
    floor = rng.uniform(-0.03, 0.03, (9, 12, 2)).astype(np.float32)
    picture, tint = rng.uniform(0.0, 1.0, (9, 12, 3)).astype(np.float32), np.array([0.9, 0.8, 0.7])
    x, y, c, s, half, radius, softness, darkness = shadow = np.array([0.003, 0.001, 0.8, 0.6, 0.01, 0.004, 1e-3, 0.3])
    expected, window = picture.astype(float), (slice(top, top + rows), slice(left, left + columns))
    a, b = np.moveaxis(floor[window].astype(float) - [x, y], -1, 0)
    far = np.hypot(np.maximum(np.abs(a * c + b * s) - half, 0.0), b * c - a * s) - radius
    share = hit.mean(axis=-1)[..., None]
    bare = (1.0 - share) * (1.0 - darkness / (1.0 + np.exp(far / softness)))[..., None]
    light = (samples * hit[..., None]).mean(axis=2) * over[window][..., None] * tint
    expected[window] = bare * expected[window] + light + shine[window][..., None] * share
    blend(depth, samples, left, top, over, shine, floor, shadow, tint, picture)
    assert np.allclose(picture, expected, rtol=1e-5)
    assert np.all(depth == EMPTY)


@pytest.mark.parametrize("sigma", [0.0, 3.0])
def test_light_is_developed_with_gain_curve_and_noise(rng: np.random.Generator, sigma: float) -> None:
    light = rng.uniform(-0.1, 1.3, (9, 11, 3)).astype(np.float32)
    lens, gain, curve = (
        rng.uniform(0.8, 1.0, (9, 11)),
        np.array([1.0, 0.9, 1.05]),
        255.0 * np.linspace(0.0, 1.0, 1001) ** 0.5,
    )
    grain, starts = rng.standard_normal(50, dtype=np.float32), rng.integers(0, 50, 9)
    image = np.empty((9, 11, 3), dtype=np.uint8)
    develop(light, lens, gain, curve, grain, starts, sigma, image)
    place = light * lens[..., None] * gain * 1000.0 + 0.5
    noise = sigma * grain[(starts[:, None] + np.arange(33)) % 50].reshape(9, 11, 3)
    expected = np.clip(curve[np.clip(place, 0.0, 1000.0).astype(int)] + 0.5 + noise, 0.0, 255.0)
    assert np.array_equal(image, expected.astype(np.uint8))


def test_the_still_picture_is_the_mean_of_its_sightlines() -> None:
    lens = VirtualLens(0.21, 0.06, 1.4, 90.0, (24, 16), tilt=(0.02, -0.03), distortion=(-0.05, 0.01))
    places, colours = spots(6), np.array([[0.8, 0.81, 0.79], [0.9, 0.9, 0.88], [0.1, 0.1, 0.12]])
    ruler, tube = np.array([0.012, 0.013, 0.021, 0.022, 4e-3, 1.5e-3]), np.array([0.013, 0.011, 0.013, 0.03, 38.0])
    waves, oil = np.array([[50.0, 20.0, 0.3, 0.01], [-10.0, 90.0, 1.3, 0.02]]), np.array([0.72, 0.9, 1.98])
    light, over, shine, floor = (np.empty((16, 24, *more), dtype=np.float32) for more in ((3,), (), (), (2,)))
    still_picture(lens.camera, places, colours, ruler, tube, waves, oil, light, over, shine, floor)
    v, u = np.mgrid[:16, :24]
    centres = np.column_stack([u.ravel(), v.ravel()])
    middle = lens.points(centres, 0.0).reshape(16, 24, 3)
    assert np.allclose(floor, middle[..., :2], atol=1e-8)
    pixels = centres[:, None] + places[(4 * (v & 3) + (u & 3)).ravel()]
    on_floor = lens.points(pixels.reshape(-1, 2), 0.0)[:, :2].reshape(16, 24, 36, 2)
    x, y = on_floor[..., 0], np.abs(on_floor[..., 1])
    off = np.abs(x - ruler[4] * np.round(x / ruler[4]))
    on_paper = (y > ruler[0]) & (y < ruler[3])
    inked = on_paper & (y > ruler[1]) & (y < ruler[2]) & (off < 0.5 * ruler[5])
    ink, paper = inked.mean(axis=-1), (on_paper & ~inked).mean(axis=-1)
    phase = middle[..., :2] @ waves[:, :2].T + waves[:, 2]
    ground = (1.0 - ink - paper) * (1.0 + np.sin(phase) @ waves[:, 3])
    seen = ground[..., None] * colours[0] + paper[..., None] * colours[1] + ink[..., None] * colours[2]
    seen *= np.exp(-oil * (lens.surface / -lens.sightlines(centres)[:, 4]).reshape(16, 24, 1))
    outside = (np.abs(floor[..., 1]) > 0.025) | (np.abs(floor[..., 0]) > 0.05)
    assert np.allclose(light[outside], seen[outside], rtol=1e-6)
    assert np.all(over[outside] == 1.0)
    assert np.all(shine[outside] == 0.0)
    assert over.min() < 0.95
    assert shine.max() > 0.01
    assert np.all(light[..., 1][~outside] < (seen[..., 1] + shine)[~outside] + 1e-6)  # the glass absorbs
