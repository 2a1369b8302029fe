"""A lens that drawn pictures of a checkerboard give back."""

import numpy as np
import pytest

from spirillum.errors import InputError
from spirillum.vision.camera.scale import lens_of
from spirillum.vision.setup import Checkerboard

cv2 = pytest.importorskip("cv2")

SIZE = (256, 192)
FOCAL, K1, K2 = 304.0, -0.12, 0.05
BOARD = Checkerboard.model_validate({"images": "board", "columns": 8, "rows": 6, "square": "10 mm"})


def drawn(turn: tuple[float, float], distance: float) -> np.ndarray:
    """A board of 9 x 7 squares, tilted, as the lens sees it, from 3 x 3 rays through each pixel."""
    fine = (np.arange(3) - 1.0) / 3.0
    u = (np.arange(SIZE[0])[:, None] + fine).ravel()
    v = (np.arange(SIZE[1])[:, None] + fine).ravel()
    pixels = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 1, 2)
    matrix = np.array([[FOCAL, 0.0, 127.5], [0.0, FOCAL, 95.5], [0.0, 0.0, 1.0]])
    rays = cv2.undistortPoints(pixels, matrix, np.array([K1, K2, 0.0, 0.0]), None, None, None)
    rays = np.concatenate([rays.reshape(-1, 2), np.ones((pixels.shape[0], 1))], axis=1)
    rotation = cv2.Rodrigues(np.array([*turn, 0.05]))[0]
    normal, origin = rotation[:, 2], np.array([0.0, 0.0, distance])
    points = rays * ((origin @ normal) / (rays @ normal))[:, None] - origin
    x, y = (points @ rotation[:, :2]).T / 0.01
    on_board = (np.abs(x) < 4.5) & (np.abs(y) < 3.5)
    dark = on_board & ((np.floor(x + 4.5) + np.floor(y + 3.5)) % 2 == 0)
    share = dark.reshape(SIZE[1], 3, SIZE[0], 3).mean(axis=(1, 3))
    return np.rint(235.0 - 200.0 * share).astype(np.uint8)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("lens")
    (place / "board").mkdir()
    turns = [(0.0, 0.0), (0.5, 0.0), (-0.5, 0.1), (0.0, 0.5), (0.1, -0.5), (0.4, 0.4), (-0.35, 0.4)]
    for index, turn in enumerate(turns):
        cv2.imwrite(str(place / "board" / f"{index}.png"), drawn(turn, 0.135 + 0.01 * (index % 3)))
    return place


def test_focal_length_and_distortion_are_found_again(folder):
    lens = lens_of(BOARD, folder, SIZE)
    assert lens.pictures >= 5
    assert abs(lens.focal - FOCAL) < 4.0 * lens.focal_error < 0.02 * FOCAL
    assert lens.centre == pytest.approx((127.5, 95.5), abs=1.5)
    for r in (0.1, 0.3, 0.45):  # what the distortion does within the picture
        true = r * (1.0 + K1 * r**2 + K2 * r**4)
        assert lens.focal * r * (1.0 + lens.k1 * r**2 + lens.k2 * r**4) == pytest.approx(FOCAL * true, abs=0.5)
    assert lens.residual < 0.2


def test_boards_that_are_not_there_get_a_sentence(folder, tmp_path):
    with pytest.raises(InputError, match="no folder"):
        lens_of(BOARD, tmp_path, SIZE)
    other = BOARD.model_copy(update={"columns": 11})
    with pytest.raises(InputError, match="11 x 6 inner corners was found in 0 of 7"):
        lens_of(other, folder, SIZE)
    with pytest.raises(InputError, match="256 x 192 pixels; allowed: 640 x 480"):
        lens_of(BOARD, folder, (640, 480))
