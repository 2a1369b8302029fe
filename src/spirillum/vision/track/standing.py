"""Detection of a robot that stands still, or hardly moves, in the static background of a video.

A robot that moves is found in what changes. One that stands belongs to the background, beside rulers and edges of the
tank that look as clear as its body. Only where stripes and the whole tail are read there too is it the robot: an empty
tube shows neither.
"""

from __future__ import annotations

import numpy as np

from spirillum.arrays import Samples
from spirillum.vision.camera.optics import BodyPose, seen
from spirillum.vision.flag import Flag
from spirillum.vision.track.body import BodyFinder
from spirillum.vision.track.constants import STANDING
from spirillum.vision.track.motion import RobotMotion
from spirillum.vision.track.search import close_places


def standing_bodies(stated: BodyFinder, still: Samples) -> list[BodyFinder]:
    """Untrained finders of a body at the places of a background where one may stand, most likely first.

    Args:
        stated: the robot's body at the stated scale.
        still: static background of the frames, (h, w, 3), or reduced by a whole factor.
    """
    shape = stated.shape(stated.optics.size[0] // still.shape[1])
    picture = np.clip(np.round(still), 0.0, 255.0).astype(np.uint8)
    found = []
    for place in close_places(picture, np.zeros_like(still), shape):
        bounds = _surroundings(stated, place.pose)
        if min(bounds[2] - bounds[0], bounds[3] - bounds[1]) >= shape.width:
            found.append(BodyFinder(stated.robot, stated.optics, bounds, stated.contour))
    return found


def _surroundings(body: BodyFinder, pose: BodyPose) -> tuple[int, int, int, int]:
    """Part of the picture about a robot, and about the way of one that hardly moves: left, top, right, bottom."""
    robot = body.robot
    beside = STANDING.beside * robot.body.diameter
    ahead = (0.5 + STANDING.ahead) * robot.body.length
    behind = ahead + robot.coupling.length + robot.tail.length
    corners = [[x, y, 0.0] for x in (-behind, ahead) for y in (-beside, beside)]
    pixels = seen(np.array(corners), pose, body.optics)
    if not np.isfinite(pixels).all():
        return 0, 0, 0, 0
    low = np.maximum(np.floor(pixels.min(axis=0)), body.bounds[:2]).astype(int).tolist()
    high = np.minimum(np.ceil(pixels.max(axis=0)), body.bounds[2:]).astype(int).tolist()
    return low[0], low[1], high[0], high[1]


def stands_flag(motion: RobotMotion, length_per_pixel: float) -> tuple[Flag, ...]:
    """Flag a robot that neither advances nor turns, whose stripes or tail were read."""
    time, x, body_angle, tail_phase = motion
    limits = [(x, STANDING.moved * length_per_pixel), *((angle, STANDING.turned) for angle in (body_angle, tail_phase))]
    read = [(values[known], limit) for values, limit in limits if (known := np.isfinite(values)).any()]
    if len(read) < 2 or not np.isfinite(x).any() or any(_change(values) > limit for values, limit in read):
        return ()
    sentence = (
        f"the robot is in view and stands still: in {np.ptp(time):.3g} s it advances by less than {STANDING.moved:g} "
        f"pixels and turns by less than {np.degrees(STANDING.turned):.0f} degree; if it should move, check its motor, "
        "or film for longer"
    )
    return (Flag("robot-stands-still", sentence),)


def _change(values: Samples) -> float:
    """Change of a series from its first to its last fifth, by medians."""
    few = max(1, len(values) // 5)
    return float(abs(np.median(values[-few:]) - np.median(values[:few])))
