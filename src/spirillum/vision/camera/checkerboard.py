"""Lens calibration from pictures of a checkerboard in air."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from spirillum.errors import InputError
from spirillum.optional_dependencies import import_optional
from spirillum.vision.setup import Checkerboard
from spirillum.vision.video.display import AS_STORED, Display
from spirillum.vision.video.pictures import IMAGES, bits_of, eight_bit, read_header, read_image

_FEWEST = 3
"""Fewest pictures with a detected board."""
_POOR_FIT = 2.0
"""Largest root mean square reprojection error, pixels."""


class Lens(NamedTuple):
    """A lens with radial distortion: a distance r from the optical axis becomes r (1 + k1 r^2 + k2 r^4)."""

    focal: float
    """Focal length, pixels."""
    focal_error: float
    """Standard error of the focal length, pixels."""
    centre: tuple[float, float]
    """Principal point, pixels."""
    k1: float
    """Radial distortion of second order."""
    k2: float
    """Radial distortion of fourth order."""
    residual: float
    """Root mean square reprojection error of the corners, pixels."""
    pictures: int
    """Number of pictures in which the board was detected."""


def lens_of(board: Checkerboard, folder: Path, size: tuple[int, int], display: Display = AS_STORED) -> Lens:
    """Calibrate a lens by OpenCV's pinhole model with square pixels and radial distortion.

    Args:
        board: the checkerboard; its `images` is a folder relative to that of the setup file.
        folder: folder of the setup file.
        size: width and height of the video and of the calibration pictures as shown, pixels.
        display: how the video's pictures are shown; so are pictures that have the size of the stored ones.
    """
    cv2 = import_optional("cv2", "a checkerboard", "video")
    images = folder / board.images
    if not images.is_dir():
        raise InputError(f"camera.checkerboard.images = {board.images!r} is no folder; allowed: a folder of pictures")
    names = sorted(entry for entry in images.iterdir() if entry.suffix.lower() in IMAGES)
    pattern, found = (board.columns, board.rows), []
    for name in names:
        stored, header = read_image(name, grey=True), read_header(name)
        if stored is None or header is None:
            raise InputError(f"camera.checkerboard: {name} cannot be read as an image; allowed: png, jpg, tif, bmp")
        stored = eight_bit(stored, bits_of(stored))
        grey = header.display.shown(stored)
        if grey.shape[::-1] != size and display.size(header.size) == size:
            grey = display.shown(stored)
        if grey.shape[::-1] != size:
            seen_size = f"{grey.shape[1]} x {grey.shape[0]} pixels"
            raise InputError(
                f"camera.checkerboard: {name} has {seen_size}; allowed: {size[0]} x {size[1]}, as the video"
            )
        seen, corners = cv2.findChessboardCornersSB(grey, pattern, flags=cv2.CALIB_CB_ACCURACY)
        if seen:
            found.append(corners.reshape(-1, 2).astype(np.float32))
    if len(found) < _FEWEST:
        raise InputError(
            f"camera.checkerboard: a board of {board.columns} x {board.rows} inner corners was found in {len(found)} "
            f"of {len(names)} pictures of {images}; allowed: at least {_FEWEST}, with the board tilted differently"
        )
    grid = np.zeros((board.columns * board.rows, 3), dtype=np.float32)
    grid[:, :2] = np.mgrid[0 : board.columns, 0 : board.rows].T.reshape(-1, 2) * board.square
    first = np.array([[size[0], 0.0, 0.5 * (size[0] - 1)], [0.0, size[0], 0.5 * (size[1] - 1)], [0.0, 0.0, 1.0]])
    flags = cv2.CALIB_FIX_ASPECT_RATIO | cv2.CALIB_ZERO_TANGENT_DIST | cv2.CALIB_FIX_K3 | cv2.CALIB_USE_INTRINSIC_GUESS
    try:
        residual, matrix, distortion, _, _, errors, *_ = cv2.calibrateCameraExtended(
            [grid] * len(found), found, size, first, None, flags=flags
        )
    except cv2.error as error:
        raise InputError(f"camera.checkerboard: no camera fits the pictures of {images} ({error.err})") from error
    distortion = np.ravel(distortion)
    focal, focal_error = float(matrix[0, 0]), float(np.ravel(errors)[:2].max())  # one of the two is fixed
    if not (np.isfinite(focal) and focal_error < 0.1 * focal and residual < _POOR_FIT):
        raise InputError(
            f"camera.checkerboard: the fit leaves {residual:.2g} pixels and a focal length of {focal:.4g} +- "
            f"{focal_error:.2g} pixels; allowed: under {_POOR_FIT:g} pixels and 10 %, of boards tilted differently"
        )
    centre = float(matrix[0, 2]), float(matrix[1, 2])
    return Lens(focal, focal_error, centre, float(distortion[0]), float(distortion[1]), float(residual), len(found))
