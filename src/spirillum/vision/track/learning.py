"""Initial detection on some frames of a video: the camera and its scale, and the robot's appearance."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.errors import InputError
from spirillum.robot.robot import Robot
from spirillum.vision.camera.camera import background, bounds_of, sight_of
from spirillum.vision.camera.optics import BodyPose, project
from spirillum.vision.camera.scale import CalibratedCamera
from spirillum.vision.flag import Flag
from spirillum.vision.setup import Setup
from spirillum.vision.track.body import BodyFinder
from spirillum.vision.track.constants import OUTLINE, SIZE, STRIPES
from spirillum.vision.track.identity import Identified, identify
from spirillum.vision.track.search import searched_at
from spirillum.vision.video import opencv as cv2
from spirillum.vision.video.frames import Frame, Video
from spirillum.vision.video.pictures import reduction

_SMALLEST = 4  # Shortest body in a picture, pixels.
_LARGEST = 4  # Longest one, over the larger side of the picture.


@dataclass(frozen=True)
class GlareConstants:
    """Glare that stands still on the robot's path."""

    share: float = 0.9  #: Share of the frames on which a spot has to be white.
    covered: float = 0.95  #: Share of the body's diameter that surely hides what is behind it.
    least: float = 0.005  #: Least size of its part on the path, over what body and coupling cover.
    most: float = 1.0  #: Largest size of it all, over that: what is larger is an overexposed background.
    rim: float = 0.4  #: Width of its rim, over the radius of a disk as large as the spot.
    across: float = 0.5
    """Least sine of the angle between an edge and the path of the robot, of edges that show how far it has moved."""
    passes: float = 2.0  #: Least change of the distance of such an edge from a spot, within its rim, pixels.
    fewest: int = 3  #: Fewest edge points of which this is true.
    drift: float = 0.08  #: Standard error of the displacement from end to end, pixels.
    lateral_distances: tuple[float, float] = (0.6, 0.85)
    """Distances from the axis at which the edge of a mirrored lamp is looked for, over the body's diameter."""
    lines: int = 5  #: Lines along the path between these distances.
    veil_width: float = 0.3
    """Width of the stretches whose brightness is compared, over the body's diameter: wider than a ruler's lines."""
    veil_step: float = 30.0
    """Least step of the brightness at the edge of a mirrored lamp, of 255.

    On path-traced videos it was 60 there, and 17 at most where grids, shadows and caustics made one."""
    sharp: float = 0.4  #: Least share of the step within four pixels on either side of it.
    slant: int = 8  #: Largest distance along the path of the steps on both sides of the body, pixels.
    in_view: float = 0.5  #: Least share of the path that has to be in the picture.
    veil_drift: float = 0.5  #: Standard error of the total displacement under a mirrored lamp, pixels. Assumed.


GLARE = GlareConstants()


class Glare(NamedTuple):
    """What glare that stands still leaves in a track."""

    drift: float  #: Standard error of the displacement from end to end, pixels.
    flags: tuple[Flag, ...]


def standing_glare(images: Sequence[np.ndarray], poses: Sequence[BodyPose], body: BodyFinder) -> Glare:
    """Look for glare that stands still where edges pass that show how far the robot has moved."""
    veil = _veil(images, poses, body)
    if veil is not None:
        return veil
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
    return Glare(GLARE.drift, (Flag.named("standing-glare", u=u, v=v, size=size),))


def _veil(images: Sequence[np.ndarray], poses: Sequence[BodyPose], body: BodyFinder) -> Glare | None:
    """Look beside the body for a lamp mirrored in the surface: a sharp step of the brightness across the robot's path.

    It need not be white, and adds to the brightness of body and background alike. Lines of a ruler or a grid are
    narrower than the medians that are compared; walls run along the way.
    """
    robot, pixel = body.robot, body.optics.length_per_pixel
    x = np.array([pose.x for pose in poses])
    middle = BodyPose(*np.median(np.array(poses), axis=0).tolist())
    behind = 0.5 * robot.body.length + robot.coupling.length + robot.tail.length
    first, last = x.min() - middle.x - behind, x.max() - middle.x + 0.5 * robot.body.length
    wide = max(4, round(GLARE.veil_width * robot.body.diameter / pixel))
    along = np.arange(first - wide * pixel, last + wide * pixel, pixel)
    sides = [side * np.linspace(*GLARE.lateral_distances, GLARE.lines) * robot.body.diameter for side in (1.0, -1.0)]
    profiles = [_brightness(images, middle, body, along, across) for across in sides]
    if any(profile is None or profile.size <= 4 * wide for profile in profiles):
        return None
    place, size = _common_step(*(_sharp_steps(profile, wide) for profile in profiles if profile is not None))
    if size < GLARE.veil_step:
        return None
    there, lateral = float(along[place]), float(sides[0].mean())
    u, v = project(np.array([[there, lateral, 0.0]]), middle, body.optics)[0]
    return Glare(GLARE.veil_drift, (Flag.named("standing-reflection", step=size, u=u, v=v),))


def _brightness(
    images: Sequence[np.ndarray], pose: BodyPose, body: BodyFinder, along: Samples, across: Samples
) -> Samples | None:
    """Median brightness at points along the path of a robot, of 255, (n,); None where much of it is out of view."""
    grid = np.stack(np.meshgrid(along, across, [0.0], indexing="ij"), axis=-1).reshape(-1, 3)
    pixels = np.nan_to_num(project(grid, pose, body.optics), nan=-1.0).round().astype(int)
    left, top, right, bottom = body.bounds
    inside = np.all((pixels >= (left, top)) & (pixels < (right, bottom)), axis=1).reshape(along.size, across.size)
    kept = inside.all(axis=1)
    if kept.sum() < GLARE.in_view * along.size:
        return None
    columns, rows = np.clip(pixels, (left, top), (right - 1, bottom - 1)).T
    grey = np.median([image[rows, columns].mean(axis=1) for image in images], axis=0).reshape(inside.shape)
    profile = np.median(grey, axis=1)
    return np.asarray(np.interp(np.arange(along.size), np.flatnonzero(kept), profile[kept]))


def _sharp_steps(profile: Samples, wide: int) -> Samples:
    """Step of a profile at each place, by the medians of both sides; 0 where it is not sharp, (n,)."""
    gap = 2
    windows = np.median(np.lib.stride_tricks.sliding_window_view(profile, wide), axis=1)
    places = np.arange(wide + gap, profile.size - wide - gap)
    steps = windows[places + gap] - windows[places - gap - wide]
    near = profile[places + 2 * gap] - profile[places - 2 * gap]
    out = np.zeros(profile.size)
    out[places] = np.where(near * steps > GLARE.sharp * steps**2, steps, 0.0)
    return out


def _common_step(one: Samples, other: Samples) -> tuple[int, float]:
    """Place and size of the largest step on both sides of the body at about the same place: what lies aside has one."""
    found = [(0, 0.0)]
    for sign in (1.0, -1.0):
        rises = [np.maximum(sign * steps, 0.0) for steps in (one, other)]
        around = [
            np.lib.stride_tricks.sliding_window_view(np.pad(rise, GLARE.slant), 2 * GLARE.slant + 1).max(axis=1)
            for rise in rises
        ]
        best = int(np.argmax(np.minimum(*around)))
        near = np.arange(max(0, best - GLARE.slant), min(one.size, best + GLARE.slant + 1))
        found.append((int(near[np.argmax((rises[0] + rises[1])[near])]), float(np.minimum(*around)[best])))
    return max(found, key=lambda step: step[1])


def _covered(body: BodyFinder, pose: BodyPose) -> Samples:
    """Corners of a part of the picture that body and coupling hide, but for what lies beside the coupling, (7, 2)."""
    robot = body.robot
    radius = GLARE.covered * 0.5 * robot.body.diameter
    rear, front = -0.5 * robot.body.length - robot.coupling.length, 0.5 * (robot.body.length - robot.body.diameter)
    nose = np.deg2rad([-90.0, -45.0, 0.0, 45.0, 90.0])
    x = np.concatenate([[rear], front + radius * np.cos(nose), [rear]])
    y = np.concatenate([[-radius], radius * np.sin(nose), [radius]])
    return project(np.column_stack([x, y, np.zeros(x.size)]), pose, body.optics)


def _standing(white: Sequence[np.ndarray], bodies: Samples) -> np.ndarray:
    """Spots that stay white where they are, on the path of the body, (h, w)."""
    # What is white and moves along is the body itself, or a highlight on it: more of it stays white in pictures that
    # are shifted back by as much as the robot has moved. Both are counted on the same part of the picture, the whole
    # way: a highlight that reaches over the body's rim would else lose there, and seem to stand.
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
    """Whether edges that show how far the robot has moved come nearer to spots, or farther away, within their rims."""
    reach = OUTLINE.half_profile + GLARE.rim * np.sqrt(np.count_nonzero(spots) / np.pi)
    far = np.pad(cv2.distanceTransform((~spots).astype(np.uint8), cv2.DIST_L2, 5), 1, constant_values=reach)
    last, seen_at = np.array(far.shape) - 1, []
    for pose in poses:
        pixels, _, _, slopes = body.contour.places(pose, body.optics)
        row, column = np.clip(np.round(pixels - low).astype(int)[:, ::-1] + 1, 0, last).T
        across = np.abs(slopes[:, 0]) * body.optics.length_per_pixel > GLARE.across
        seen_at.append(np.where(across, np.minimum(far[row, column], reach), reach))
    return bool(np.count_nonzero(np.ptp(seen_at, axis=0) > GLARE.passes) >= GLARE.fewest)


class InitialDetection(NamedTuple):
    """Camera, scale, and the robot as it looks."""

    sight: CalibratedCamera  #: The calibrated camera.
    known: Identified  #: The robot.
    still: Samples  #: Static background of the pictures, (h, w, 3); reduced by a whole factor where they are large.
    glare: Glare  #: Glare that stands still.

    @property
    def flags(self) -> tuple[Flag, ...]:
        """All that is odd about the robot so far, also about what was read since."""
        known = self.known
        doubtful = bool(self.glare.flags) or abs(known.size - 1.0) > SIZE.tolerance[0] or not known.robot
        wire = known.wire.flags_given_doubt(doubtful=doubtful)
        return (*known.start.flags, *known.flags, *known.stripes.flags, *wire, *self.glare.flags)


def _check_scale(video: Video, length_per_pixel: float, robot: Robot) -> None:
    """Refuse a scale at which no body of this length can be looked for, before its outline is computed."""
    length = robot.body.length if robot.has_body else robot.tail.length
    pixels, most = length / length_per_pixel, _LARGEST * max(video.size)
    if not _SMALLEST <= pixels <= most:
        raise InputError(
            f"{video.name}: at {1e3 * length_per_pixel:.3g} mm a pixel '{robot.name}' would be {pixels:.3g} pixels "
            f"long; allowed: {_SMALLEST} to {most:.0f} of this picture: check [markers], and the unit of its lengths"
        )


@contextmanager
def _region_named(setup: Setup) -> Iterator[None]:
    """Name the region of the setup where what is looked for is not found in it."""
    try:
        yield
    except InputError as error:
        if setup.region is None:
            raise
        words = "looked for in the [region] of the setup alone: make it larger, or leave it out"
        raise InputError(f"{error} ({words})") from error


def learnt_from(
    video: Video, frames: list[Frame], setup: Setup, robot: Robot, folder: Path | None, *, by_seal: bool = True
) -> InitialDetection:
    """Learn from some frames."""
    factor = reduction(video.size)
    still = background(frames, factor)
    with _region_named(setup):
        sight = sight_of(video, setup, still, folder, frames)
    _check_scale(video, sight.optics.length_per_pixel, robot)
    finder = BodyFinder(robot, sight.optics, bounds_of(setup, video))
    searched = searched_at(finder.shape().width, factor)
    still = still if searched == factor else background(frames, searched)
    with _region_named(setup):
        known = identify(video.name, setup, finder, frames, still, by_seal=by_seal)
    poses = [known.start.expected(frame.time) for frame in frames]
    glare = standing_glare([frame.image for frame in frames], poses, known.start.body)
    known = known._replace(start=replace(known.start, seen=[]))  # what was learnt from is not needed any longer
    return InitialDetection(sight, known, still, glare)
