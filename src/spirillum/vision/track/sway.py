"""What a camera that swayed leaves in a track whose pictures were moved back to where the first one lies."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.robust import least_squares_line
from spirillum.vision.camera.anchor import Steadied
from spirillum.vision.camera.scale import Sight
from spirillum.vision.flag import Flag
from spirillum.vision.setup import Setup
from spirillum.vision.track.constants import SWAY
from spirillum.vision.track.motion import Motion

__all__ = ["Swayed", "swayed_by"]


class Swayed(NamedTuple):
    """Uncertainty and flags by a camera that swayed."""

    drift: float
    """Standard uncertainty of the velocity, m/s."""
    flags: tuple[Flag, ...]


def swayed_by(still: Steadied, motion: Motion, setup: Setup, sight: Sight) -> Swayed:
    """How much a camera that swayed makes the velocity uncertain, and whether it may be given.

    A camera that turns moves all of its picture alike. One that is carried along the channel moves the robot, which is
    nearer than the background, by more: what is not known is the difference, for as much as the camera has drifted.

    Args:
        still: how the camera swayed.
        motion: the robot's motion in the pictures that were moved.
        setup: the setup, for the height of the background.
        sight: the calibrated camera.
    """
    optics, right, down = sight.optics, still.poses[:, 0], still.poses[:, 1]
    behind = 0.0 if setup.markers.height is None else setup.markers.height
    pixel = optics.length_per_pixel
    parallax = optics.moved({"axis_height": behind}).length_per_pixel / pixel - 1.0
    speed = math.hypot(*(float(least_squares_line(still.times, part).slope) for part in (right, down)))
    reach = max(float(np.ptp(right)), float(np.ptp(down)))
    jump = _largest_jump(motion.time, motion.x) / pixel
    sentence = (
        f"the camera swayed by {reach:.1f} pixels from end to end: all pictures were moved to where the first lies, "
        "by what stands still in them; put the camera on a stand to be sure"
    )
    drift, flags = abs(parallax) * speed * pixel, [Flag("camera-swayed", sentence)]
    if jump > SWAY.jump:
        words = (
            f"the camera swayed, and the robot jumps by {jump:.1f} pixels against what stands still: the pictures "
            "could not be moved back well enough; no speed is given: put the camera on a stand"
        )
        flags.append(Flag("camera-moved", words, ("forward_velocity", "lateral_position", *SWAY.lateral)))
    return Swayed(drift, tuple(flags))


def _largest_jump(time: Samples, x: Samples) -> float:
    """Largest lasting step of a position against the lines through some frames on either side, m."""
    known = np.isfinite(x)
    t, v, wide = time[known], x[known], SWAY.window
    if t.size < 2 * wide:
        return 0.0
    line = np.polynomial.polynomial.polyfit(t - t.mean(), v, 1)
    rest = v - np.polynomial.polynomial.polyval(t - t.mean(), line)
    windows = np.lib.stride_tricks.sliding_window_view(rest, wide)
    middle = np.median(windows, axis=1)
    return float(np.abs(middle[wide:] - middle[:-wide]).max())
