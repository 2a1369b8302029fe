"""Glare that stands still while the robot passes under it, and shifts the edges that come under its rim."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.extras import required
from spirillum.vision.camera.optics import BodyPose, seen
from spirillum.vision.flag import Flag
from spirillum.vision.track.body import BodyFinder
from spirillum.vision.track.constants import GLARE, OUTLINE, STRIPES

__all__ = ["Glare", "standing_glare"]


class Glare(NamedTuple):
    """What glare that stands still leaves in a track."""

    drift: float
    """Standard error of the way from the first frame to the last, pixels."""
    flags: tuple[Flag, ...]


def standing_glare(images: Sequence[np.ndarray], poses: Sequence[BodyPose], body: BodyFinder) -> Glare:
    """Look for glare that stands still where edges pass that tell how far the robot has moved.

    Args:
        images: frames spread over the video, 8-bit RGB, (h, w, 3) each.
        poses: where the robot is on each of them, to a pixel or so.
        body: the robot's body.
    """
    cv2 = required("cv2", "measuring a video", "video")
    bodies = np.array([_covered(body, pose) for pose in poses])
    (left, top, right, bottom), wide = body.bounds, int(np.ptp(bodies[0], axis=0).min())
    low = np.maximum(bodies.min(axis=(0, 1)).astype(int) - wide, (left, top))
    high = np.minimum(bodies.max(axis=(0, 1)).astype(int) + wide, (right, bottom))
    if np.any(high <= low):
        return Glare(0.0, ())
    around = slice(low[1], high[1]), slice(low[0], high[0])
    darkest = 3 * (float(np.ceil(STRIPES.white)),)
    white = [cv2.inRange(image[around], darkest, (255.0, 255.0, 255.0)) > 0 for image in images]
    spots = _standing(white, bodies - low)
    if not spots.any() or not _pass(body, poses, spots, low):
        return Glare(0.0, ())
    rows, columns = np.nonzero(spots)
    u, v = low[0] + 0.5 * (columns.min() + columns.max()), low[1] + 0.5 * (rows.min() + rows.max())
    size = f"{np.ptp(columns) + 1} by {np.ptp(rows) + 1} pixels"
    sentence = (
        f"glare stands still on the robot's way, about column {u:.0f} and row {v:.0f} of the picture ({size}): it "
        "shifts edges of the body that pass there, so that the interval of the speed is wider; move the lamp or soften "
        "its light until none lies there"
    )
    return Glare(GLARE.drift, (Flag("standing-glare", sentence),))


def _covered(body: BodyFinder, pose: BodyPose) -> Samples:
    """Corners of a part of the picture that body and coupling hide, but for what lies beside the coupling, (7, 2)."""
    robot = body.robot
    radius = GLARE.covered * 0.5 * robot.body.diameter
    rear, front = -0.5 * robot.body.length - robot.coupling.length, 0.5 * (robot.body.length - robot.body.diameter)
    nose = np.deg2rad([-90.0, -45.0, 0.0, 45.0, 90.0])
    x = np.concatenate([[rear], front + radius * np.cos(nose), [rear]])
    y = np.concatenate([[-radius], radius * np.sin(nose), [radius]])
    return seen(np.column_stack([x, y, np.zeros(x.size)]), pose, body.optics)


def _standing(white: Sequence[np.ndarray], bodies: Samples) -> np.ndarray:
    """Spots that stay white where they are, on the way of the body, (h, w).

    What is white and moves along is the body itself, or a highlight on it: more of it stays white in pictures that are
    shifted back by as much as the robot has moved. Both are counted on the same part of the picture, the whole way: a
    highlight that reaches over the body's rim would else lose there, and seem to stand.

    Args:
        white: what is white on each of n frames, (h, w).
        bodies: corners of what body and coupling cover on each frame, (n, k, 2).
    """
    cv2 = required("cv2", "measuring a video", "video")
    middle, shape = len(white) // 2, white[0].shape
    moved = np.round(bodies.mean(axis=1) - bodies[middle].mean(axis=0)).astype(int)
    covered, here = np.zeros(shape, dtype=np.uint8), np.zeros(shape, dtype=np.uint8)
    cv2.fillConvexPoly(here, np.round(bodies[middle]).astype(np.int32), 1)
    stays, moves = np.zeros(shape, dtype=np.uint16), np.zeros(shape, dtype=np.uint16)  # on how many frames
    for one, corners, (right, down) in zip(white, bodies, moved, strict=True):
        cv2.fillConvexPoly(covered, np.round(corners).astype(np.int32), 1)
        stays += one
        moves += np.roll(one, (-down, -right), axis=(0, 1))
    often = GLARE.share * len(white)
    (_, still), (_, along) = (cv2.connectedComponents((count >= often).astype(np.uint8)) for count in (stays, moves))
    way, body = covered > 0, np.count_nonzero(here)
    spots = np.zeros(way.shape, dtype=bool)
    for label in np.unique(still[way & (still > 0)]):
        spot = still == label
        moving = np.isin(along, np.setdiff1d(along[spot], [0])) & way
        inside = np.count_nonzero(spot & way)
        if inside > max(GLARE.least * body, np.count_nonzero(moving)) and np.count_nonzero(spot) < GLARE.most * body:
            spots |= spot
    return spots


def _pass(body: BodyFinder, poses: Sequence[BodyPose], spots: np.ndarray, low: np.ndarray) -> bool:
    """Whether edges that tell how far the robot has moved come nearer to spots, or farther away, within their rims."""
    cv2 = required("cv2", "measuring a video", "video")
    reach = OUTLINE.half_profile + GLARE.rim * np.sqrt(np.count_nonzero(spots) / np.pi)
    far = np.pad(cv2.distanceTransform((~spots).astype(np.uint8), cv2.DIST_L2, 5), 1, constant_values=reach)
    last, seen_at = np.array(far.shape) - 1, []
    for pose in poses:
        pixels, _, _, slopes = body.contour.places(pose, body.optics)
        row, column = np.clip(np.round(pixels - low).astype(int)[:, ::-1] + 1, 0, last).T
        across = np.abs(slopes[:, 0]) * body.optics.length_per_pixel > GLARE.across
        seen_at.append(np.where(across, np.minimum(far[row, column], reach), reach))
    return bool(np.count_nonzero(np.ptp(seen_at, axis=0) > GLARE.passes) >= GLARE.fewest)
