"""A camera that moves during the film is told from a robot that moves."""

import numpy as np
import pytest

from spirillum.vision.setup import load_setup
from spirillum.vision.track.assembly import follow
from spirillum.vision.track.steadiness import shift_between

cv2 = pytest.importorskip("cv2")


def scene(shift, disc):
    """Smooth random structure moved by a shift, (v, u) in pixels, and a strong disc where it likes."""
    rng = np.random.default_rng(5)
    rough = cv2.GaussianBlur(rng.normal(size=(200, 300)).astype(np.float32), (0, 0), 2.0)
    moved = cv2.warpAffine(rough, np.array([[1.0, 0.0, shift[1]], [0.0, 1.0, shift[0]]]), (300, 200))
    cv2.circle(moved, disc, 25, 0.5, -1)
    return moved[20:-20, 20:-20]


@pytest.mark.parametrize("shift", [(0.0, 0.0), (0.0, 0.4), (2.0, -3.3), (-1.0, 7.6)])
def test_shifts_of_what_stands_still_are_found_whatever_else_moves(shift):
    found = shift_between(scene((0.0, 0.0), (100, 90)), scene(shift, (140, 90)))
    assert found == pytest.approx(shift[1], abs=0.1)


@pytest.mark.parametrize(
    ("ruler", "pixels"),
    [(True, 6), (False, 0), *(pytest.param(*case, marks=pytest.mark.slow) for case in ((True, 0), (False, 6)))],
)
def test_a_bump_gives_no_numbers(flat_pictures, tmp_path, ruler, pixels):
    flat = flat_pictures.Flat(frames=12, fps=2.0, velocity=1e-3, ruler=ruler, noise=3.0)
    rng = np.random.default_rng(3)
    marks = cv2.GaussianBlur(rng.normal(0.0, 40.0, (*flat.size[::-1], 1)).astype(np.float32), (0, 0), 1.5)
    marks[70:170] = 0.0
    (tmp_path / "film").mkdir()
    for index, (_, picture) in enumerate(flat.pictures()):
        scratched = np.clip(picture + marks[..., None], 0, 255).astype(np.uint8)  # a tank is never quite clean
        if index >= 6:
            scratched = np.roll(scratched, pixels, axis=1)
        cv2.imwrite(str(tmp_path / "film" / f"{index:03d}.png"), scratched[..., ::-1])
    (tmp_path / "film.setup.toml").write_text(flat.setup_text())
    found = follow(tmp_path / "film", *load_setup(tmp_path / "film.setup.toml"))
    flags = {flag.name: flag for flag in found.flags}
    assert ("camera-moved" in flags) == (pixels > 0)
    if pixels:
        assert f"{pixels:.1f} pixels" in flags["camera-moved"].sentence
        assert "forward_velocity" in flags["camera-moved"].spoils
