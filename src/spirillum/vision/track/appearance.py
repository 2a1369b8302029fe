"""Appearance of the body's cover on a video: opaque, or glass through which contents and background show.

Across the cover, an opaque one is of one brightness from rim to rim. Glass has a bright rim beside its contents, or
contents whose brightness changes along the axis.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from spirillum.arrays import Samples
from spirillum.robot.robot import Robot
from spirillum.vision.camera.optics import BodyPose, Optics, seen
from spirillum.vision.track.constants import APPEARANCE

__all__ = ["Appearance", "appearance_of"]

Appearance = Literal["opaque", "glass", "unknown"]
"""As `robot.appearance` of a setup."""


def appearance_of(robot: Robot, optics: Optics, samples: Sequence[tuple[np.ndarray, BodyPose]]) -> Appearance:
    """Return whether the cover before the seal looks opaque or like glass, `unknown` where it is not clear.

    Args:
        robot: the robot.
        optics: a camera that shows it as large as it looks.
        samples: pictures, 8-bit RGB (h, w, 3), and the pose of the body on each.
    """
    half, radius = 0.5 * robot.body.length, 0.5 * robot.body.diameter
    rear = -half + (robot.seal.length if robot.seal is not None else 0.0)
    along = np.linspace(rear + 0.15 * radius, half - 0.15 * radius, APPEARANCE.places)
    across = radius * np.linspace(-APPEARANCE.reach, APPEARANCE.reach, APPEARANCE.lines)
    pictures = [_brightness(image, pose, optics, along, across) for image, pose in samples]
    grey = np.array([picture for picture in pictures if picture is not None])
    if len(grey) < APPEARANCE.fewest:
        return "unknown"
    straight = along < half - radius
    if not straight.any():
        return "unknown"
    share = np.abs(across) / radius
    across_it = np.median(grey[:, straight], axis=(0, 1))
    along_it = np.median(grey[:, :, share < APPEARANCE.core], axis=(0, 2))
    core, outside = np.median(across_it[share < APPEARANCE.core]), np.median(across_it[share > APPEARANCE.beyond])
    step = float(abs(outside - core))
    low, high = np.quantile(along_it, [0.1, 0.9])
    rims = [_rim(across_it, share, side * across > 0.0, float(core), float(outside)) for side in (1.0, -1.0)]
    uneven = float(high - low)
    if uneven > max(APPEARANCE.least, APPEARANCE.uneven * step):
        return "glass"
    if step < APPEARANCE.least:
        return "unknown"
    if min(rims) > APPEARANCE.bright_rim * step:
        return "glass"
    even = max(rims) < 0.5 * APPEARANCE.bright_rim * step and uneven < 0.5 * APPEARANCE.uneven * step
    return "opaque" if even else "unknown"


def _rim(profile: Samples, share: Samples, side: np.ndarray, core: float, outside: float) -> float:
    """By how much the rim on one side is brighter than core and outside, of 255."""
    near = side & (np.abs(share - 1.0) < APPEARANCE.rim)
    return float(profile[near].max()) - max(core, outside)


def _brightness(image: np.ndarray, pose: BodyPose, optics: Optics, along: Samples, across: Samples) -> Samples | None:
    """Brightness on a grid in the plane through the body's axis, of 255, (n, k); None where it is not all in view."""
    grid = np.stack(np.meshgrid(along, across, [0.0], indexing="ij"), axis=-1).reshape(-1, 3)
    pixels = np.nan_to_num(seen(grid, pose, optics), nan=-1.0).round().astype(int)
    if np.any(pixels < 0) or np.any(pixels >= (image.shape[1], image.shape[0])):
        return None
    grey = image[pixels[:, 1], pixels[:, 0]].mean(axis=1)
    return np.asarray(grey.reshape(along.size, across.size))
