"""Whether a pose from the outline alone can be trusted: its cover, what lies under it, what moves.

Across the cover, an opaque one is of one brightness from rim to rim. Glass has a bright rim beside its contents, or
contents whose brightness changes along the axis. Over a grid or through glass, an outline may follow what is not the
body's: lines that stand still, or contents. What shows at the nose has to move along with it from frame to frame, and
not to stay where it was.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.robot.robot import Robot
from spirillum.robust import mad_scale
from spirillum.vision.camera.optics import BodyPose, Optics, project
from spirillum.vision.flag import Flag
from spirillum.vision.track.body import BodyFinder
from spirillum.vision.track.contour import GROUPS
from spirillum.vision.video import opencv as cv2
from spirillum.vision.video.frames import Frame


@dataclass(frozen=True)
class AppearanceConstants:
    """Whether the body's cover is opaque or glass."""

    places: int = 60  #: Places along the axis between the seal and the nose.
    lines: int = 61  #: Lines along the axis, from one side to the other.
    reach: float = 1.45  #: Outermost line, over the body's radius.
    core: float = 0.35  #: Outermost line of the middle of the cover, over the body's radius.
    beyond: float = 1.25  #: Innermost line of the background, over the body's radius.
    rim: float = 0.22  #: Distance from the outline within which a rim is looked for, over the body's radius.
    fewest: int = 3  #: Fewest pictures with all of the cover in view.
    least: float = 20.0  #: Least significant difference of brightness, of 255.
    white: float = 228.0  #: Brightness of glare, of 255.
    glare: float = 0.005  #: Share of the cover under glare from which on nothing is concluded.
    uneven: float = 0.5
    """Change of the brightness along the axis over that from the middle to the background from which on contents show.

    On path-traced videos it was 0.1 and less on paint and a liner, more than 1 where a battery lies inside."""
    bright_rim: float = 0.12
    """Brightness of the rim beyond that of middle and background, over their difference, of glass before a liner.

    It was 0.15 and more on path-traced videos of glass, below 0.02 on paint."""


APPEARANCE = AppearanceConstants()


Appearance = Literal["opaque", "glass", "unknown"]  #: As `robot.appearance` of a setup.


def appearance_of(robot: Robot, optics: Optics, samples: Sequence[tuple[np.ndarray, BodyPose]]) -> Appearance:
    """Return whether the cover before the seal looks opaque or like glass, `unknown` where it is not clear."""
    half, radius = 0.5 * robot.body.length, 0.5 * robot.body.diameter
    rear = -half + (robot.seal.length if robot.seal is not None else 0.0)
    along = np.linspace(rear + 0.15 * radius, half - 0.15 * radius, APPEARANCE.places)
    across = radius * np.linspace(-APPEARANCE.reach, APPEARANCE.reach, APPEARANCE.lines)
    pictures = [_brightness(image, pose, optics, along, across) for image, pose in samples]
    grey = np.array([picture for picture in pictures if picture is not None])
    if len(grey) < APPEARANCE.fewest:
        return "unknown"
    straight = along < half - radius
    share = np.abs(across) / radius
    glare = np.mean(grey[:, :, share < 1.0] > APPEARANCE.white)  # a highlight looks like contents
    if not straight.any() or glare > APPEARANCE.glare:
        return "unknown"
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
    pixels = np.nan_to_num(project(grid, pose, optics), nan=-1.0).round().astype(int)
    if np.any(pixels < 0) or np.any(pixels >= (image.shape[1], image.shape[0])):
        return None
    grey = image[pixels[:, 1], pixels[:, 0]].mean(axis=1)
    return np.asarray(grey.reshape(along.size, across.size))


@dataclass(frozen=True)
class LoneOutlineConstants:
    """A pose from the outline alone."""

    ahead: tuple[float, float] = (0.25, 2.0)
    """Stretch before the nose whose texture is that under the body, from the nose on, over the body's radius."""
    across: float = 0.8  #: Half its width, over the body's radius.
    lines: int = 15  #: Lines along it.
    in_view: float = 0.5  #: Least share of it that has to be in the picture.
    flat: float = 0.12  #: Half the width of the subtracted running mean along the lines, over the body's diameter.
    texture: float = 4.0
    """Texture of the background from which on it is not plain, of 255; a single cable or speck makes none.

    On path-traced and drawn videos it was 0.5 on plain floors, and 8 to 16 on grid and millimetre paper."""
    apart: float = 3.0  #: Least displacement between two frames that are compared, pixels.
    fewest: int = 3  #: Fewest pairs of frames for a test whether the edges at an end of the body move.
    steep: float = 0.6  #: Least sine of the angle between such an edge and the path of the robot.
    stands: float = 0.5
    """Share of the contrast across the edges at an end that stays where it was from which on it stands still."""
    drift: float = 0.3
    """Standard error of the displacement from end to end by an outline over a grid or of glass, pixels.

    On ten drawn and path-traced videos without a seal the way was off by up to 0.2 pixels."""


LONE_OUTLINE = LoneOutlineConstants()


class OutlineCheck(NamedTuple):
    """What the cover of the body and the background leave open of its outline."""

    drift: float = 0.0  #: Standard error of the displacement from end to end by the outline alone, pixels.
    flags: tuple[Flag, ...] = ()  #: A flag that names the cue and a frame, where the outline alone gives the pose.
    suspect: str = ""  #: What the outline may follow in place of the body; empty for opaque bodies on plain ground.


def check_outline(
    frames: Sequence[Frame], poses: Sequence[BodyPose], body: BodyFinder, appearance: Appearance, *, alone: bool
) -> OutlineCheck:
    """Look whether the outline may follow glass, its contents, or a grid."""
    if len(frames) < LONE_OUTLINE.fewest:
        return OutlineCheck()
    factor = body.optics.size[0] // frames[0].image.shape[1]
    left, top, right, bottom = (at // factor for at in body.bounds)
    body = BodyFinder(body.robot, body.optics.reduced(factor), (left, top, right, bottom), body.contour)
    images = [frame.image for frame in frames]
    grid = _texture(images, poses, body) > LONE_OUTLINE.texture
    if appearance == "unknown":
        appearance = appearance_of(body.robot, body.optics, list(zip(images, poses, strict=True)))
    if not grid and appearance != "glass":
        return OutlineCheck()
    suspect = "a grid or texture under the tube" if grid else "the rim or the contents of a glass cover"
    if not alone:
        return OutlineCheck(suspect=suspect)
    stays = [_stays(images, poses, body, end) for end in ("front", "rear")]
    known = [shares for shares in stays if np.count_nonzero(np.isfinite(shares)) >= LONE_OUTLINE.fewest]
    worst = max(known, key=lambda shares: float(np.nanmedian(shares)), default=np.zeros(len(frames)))
    odd = frames[int(np.nanargmax(worst))]
    if grid and (not known or float(np.nanmedian(worst)) > LONE_OUTLINE.stands):
        why = "what it follows stands still" if known else "it hardly moves"
        flag = Flag.named("outline-alone-stands", odd.index, suspect=suspect, time=odd.time, why=why)
        return OutlineCheck(0.0, (flag,), suspect)
    flag = Flag.named("outline-alone", odd.index, suspect=suspect, time=odd.time)
    return OutlineCheck(LONE_OUTLINE.drift * factor, (flag,), suspect)


def _texture(images: Sequence[np.ndarray], poses: Sequence[BodyPose], body: BodyFinder) -> float:
    """Robust standard deviation of the still brightness before the nose, without what is wide; 0 out of view."""
    radius, half = 0.5 * body.robot.body.diameter, 0.5 * body.robot.body.length
    step = body.optics.length_per_pixel
    near, far = (half + at * radius for at in LONE_OUTLINE.ahead)
    across = radius * np.linspace(-LONE_OUTLINE.across, LONE_OUTLINE.across, LONE_OUTLINE.lines)
    foremost = max(poses, key=lambda pose: pose.x)
    grid = np.stack(np.meshgrid(np.arange(near, far, step), across, [0.0], indexing="ij"), axis=-1)
    pixels = np.nan_to_num(project(grid.reshape(-1, 3), foremost, body.optics), nan=-1.0).round().astype(int)
    left, top, right, bottom = body.bounds
    inside = np.all((pixels >= (left, top)) & (pixels < (right, bottom)), axis=1)
    if inside.mean() < LONE_OUTLINE.in_view:
        return 0.0
    columns, rows = np.clip(pixels, (left, top), (right - 1, bottom - 1)).T
    still = np.median([image[rows, columns].mean(axis=1) for image in images], axis=0).reshape(grid.shape[:2])
    wide = 2 * max(3, round(LONE_OUTLINE.flat * 2.0 * radius / step)) + 1
    return float(mad_scale(still - cv2.blur(still, (1, wide), borderType=cv2.BORDER_REPLICATE)))


def _stays(images: Sequence[np.ndarray], poses: Sequence[BodyPose], body: BodyFinder, end: str) -> Samples:
    """Share of the contrast across the edges at an end that stays where it was, (n,)."""
    # Each frame is compared with that on which the robot lies farthest ahead of the nose, or behind the rear: an opaque
    # body covers there what lay beside it. NaN where there is none.
    found, pixel = np.full(len(images), np.nan), body.optics.length_per_pixel
    x = np.array([pose.x for pose in poses])
    last = int(np.argmax(x) if end == "front" else np.argmin(x))
    for number in np.flatnonzero(np.abs(x - x[last]) > LONE_OUTLINE.apart * pixel).tolist():
        slopes = body.contour.places(poses[number], body.optics)[3]
        edges = (body.contour.group == GROUPS.index(end)) & (np.abs(slopes[:, 0]) * pixel > LONE_OUTLINE.steep)
        here, there = (np.gradient(body.profiles(images[k], poses[number])[edges], axis=1) for k in (number, last))
        found[number] = np.nansum(here * there) / max(float(np.nansum(here**2)), 1e-9)
    return found
