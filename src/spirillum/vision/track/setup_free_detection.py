"""The first look at a video of which no setup is known: ruler, robot, direction and stripes, at any scale.

A provisional camera stands in for the unknown one: its lens is as far away as a usual one, and its scale is a guess
that the search for the robot corrects. Finding and learning are those of every video
(`spirillum.vision.track.identity`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import cached_property
from itertools import permutations
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.errors import InputError
from spirillum.robot.robot import Robot
from spirillum.robust import mad_scale
from spirillum.vision.camera.camera import background, bounds_of, ruler_of, samples_of
from spirillum.vision.camera.optics import DIRECTIONS, Optics, opposite
from spirillum.vision.camera.ruler import Lines
from spirillum.vision.camera.scale import camera_of_setup, first_rotation
from spirillum.vision.setup import Setup, stripes_of
from spirillum.vision.track.body import BodyFinder
from spirillum.vision.track.constants import IDENTITY, SETUP_FREE
from spirillum.vision.track.identity import Identified, identified_at
from spirillum.vision.track.lone_outline import Appearance, appearance_of
from spirillum.vision.track.search import searched_at
from spirillum.vision.track.size import best_other_size, resized
from spirillum.vision.track.stripes import Stripes
from spirillum.vision.video import opencv as cv2
from spirillum.vision.video.frames import Frame, Video
from spirillum.vision.video.pictures import reduction

_WRONG = 4.0  # ratio beyond the usual lengths per pixel at which a stated spacing is wrong


class Walls(NamedTuple):
    """Two edges along the channel on either side of the robot."""

    distance: float  #: Distance between them over the body's diameter.
    contrast: float  #: Step of the brightness at the fainter one over the usual step, from row to row.
    ends: Samples  #: Pixels of both ends of both edges, (2, 2, 2).


class SetupFreeDetection(NamedTuple):
    """Setup-free detection in a video."""

    lines: Lines | None  #: Lines of the ruler; None where none was found.
    known: Identified | None  #: The robot, in front of the provisional camera; None where none was found.
    direction: str  #: Where in the picture its nose points.
    stripes: tuple[str, ...]  #: Colours of its stripes in the order seen; empty where they could not be read.
    walls: Walls | None  #: Walls of its channel; None where none were found.
    frames: list[Frame]  #: Frames that were looked at.
    reduction: int  #: Factor by which they may be reduced to be looked at as a whole: the ruler is resolved in them.

    @property
    def optics(self) -> Optics:
        """The provisional camera, at the scale at which the robot was found."""
        assert self.known is not None  # noqa: S101 - checked by the caller
        return self.known.start.body.optics

    @property
    def appearance(self) -> Appearance:
        """Whether the cover of the robot looks opaque or like glass."""
        assert self.known is not None  # noqa: S101
        start = self.known.start
        return appearance_of(start.body.robot, self.optics, start.seen)

    @property
    def speed(self) -> float:
        """How fast the robot moves towards its nose, pixels a second."""
        assert self.known is not None  # noqa: S101
        path = self.known.start.path
        if len(path) < 2:
            return 0.0
        time, x = np.array([at for at, _ in path]), np.array([pose.x for _, pose in path])
        return float(np.polyfit(time - time.mean(), x, 1)[0]) / self.optics.length_per_pixel


def detect_without_setup(
    video: Video, robot: Robot, spacing: float | None = None, progress: Callable[[str, int, int], None] | None = None
) -> SetupFreeDetection:
    """Look at a video without a setup."""
    on_progress = progress or (lambda _what, _done, _total: None)
    anywhere = _setup(robot, video.size, 1e-4, "right")
    on_progress("reading frames", 0, 1)
    frames = samples_of(video, anywhere.start, anywhere.end)
    stills = _Stills(frames)
    _check_no_noise(stills.at(1), video)
    on_progress("looking for the ruler", 0, 1)
    (lines, factor), directions = _ruler(stills, bounds_of(anywhere, video), reduction(video.size))
    guesses = _guesses(robot, video.size, lines, spacing)[: None if stills.changes else 1]
    looks = (2 if stills.changes else 1) * len(guesses) * len(directions)
    on_progress("looking for the robot", 0, looks)
    for place, guess in enumerate(guesses):
        found = _search_near_scale(video, robot, (guess, lines, directions), stills)
        for done, (direction, known) in enumerate(found, 1 + 2 * len(directions) * place):
            on_progress("looking for the robot", done, looks)
            if known is None:
                continue
            stripes = _observed_stripes(robot, known)
            if lines is None and not stripes and len(known.start.path) < SETUP_FREE.alone:
                continue
            walls = _walls(stills.at(factor), known, lines)
            return SetupFreeDetection(lines, known, direction, stripes, walls, frames, factor)
    return SetupFreeDetection(lines, None, "right", (), None, frames, factor)


def _check_no_noise(still: Samples, video: Video) -> None:
    """Refuse pictures whose neighbouring pixels have nothing in common, before a robot is looked for at all scales."""
    grey = still.mean(axis=2) - still.mean()
    total = float(np.mean(grey**2))
    shared = 0.5 * float(np.mean(grey[1:] * grey[:-1]) + np.mean(grey[:, 1:] * grey[:, :-1]))
    if shared < SETUP_FREE.correlation * total:
        raise InputError(
            f"{video.name} shows noise alone: neighbouring pixels correlate by {shared / total:.2f}; allowed: a film "
            "in which all of the robot is in view"
        )


class _Stills:
    """Frames, and their static background, reduced by any factor."""

    def __init__(self, frames: list[Frame]) -> None:
        self.frames = frames
        self._at: dict[int, Samples] = {}

    @cached_property
    def changes(self) -> bool:
        """Whether anything moves, in pictures at most 640 pixels wide: an empty tube shows noise alone."""
        factor = -(-max(self.frames[0].image.shape) // SETUP_FREE.changing_width)
        stack = np.array([frame.reduced(factor).mean(axis=2, dtype=np.float32) for frame in self.frames])
        stack = np.array([cv2.GaussianBlur(grey, (0, 0), 1.0) for grey in stack])
        off = np.abs(stack - np.median(stack, axis=0))
        least = max(SETUP_FREE.changing * float(mad_scale(off)), SETUP_FREE.changing_least)
        return bool(np.mean(off > least) > SETUP_FREE.changing_share)

    def at(self, factor: int) -> Samples:
        """The background reduced by a factor."""
        if factor not in self._at:
            self._at[factor] = background(self.frames, factor)
        return self._at[factor]


def _ruler(
    stills: _Stills, bounds: tuple[int, int, int, int], most: int
) -> tuple[tuple[Lines | None, int], tuple[str, ...]]:
    """The ruler and a factor by which pictures may be reduced that show it, and where the nose may point."""
    still = stills.at(most)
    found = {side: ruler_of(still, bounds, -DIRECTIONS[side], most) for side in ("right", "down")}
    count = {side: 0 if lines is None else len(lines.number) for side, (lines, _) in found.items()}
    # A full picture takes long at all rolls: first the direction along which a reduced one shows more lines.
    for side in sorted(found, key=lambda one: -count[one]):
        lines, factor = found[side]
        if most > 1:
            lines, factor = ruler_of(still, bounds, -DIRECTIONS[side], most, stills.frames)
        if lines is not None:
            return (lines, factor), (side, opposite(side))
    left, top, right, bottom = bounds
    sides = ("right", "left", "up", "down")
    return (None, most), sides if right - left >= bottom - top else sides[::-1]


def _setup(robot: Robot, size: tuple[int, int], pixel: float, direction: str) -> Setup:
    """A provisional setup whose pixel shows a length at the height of the robot's axis, m."""
    far = SETUP_FREE.distance * size[0] * pixel
    deep = min(0.6 * robot.body.diameter, 0.2 * far)
    return Setup.model_validate(
        {
            "camera": {"height": f"{far + deep:.9g} m"},
            "markers": {"length_per_pixel": f"{pixel:.9g} m"},
            "robot": {"file": robot.name, "axis_height": f"{deep:.9g} m", "direction": direction},
        }
    )


def _guesses(robot: Robot, size: tuple[int, int], lines: Lines | None, spacing: float | None) -> list[float]:
    """Lengths per pixel to try: by the ruler, then by what share of the picture the robot may fill, m."""
    # A spacing by which the robot would be a dot, or far larger than the picture, is wrong and is not tried.
    length = robot.body.length + robot.coupling.length + robot.tail.length
    wide = [length / (share * max(size)) for share in SETUP_FREE.shares]
    guesses = []
    if lines is not None:
        by_ruler = SETUP_FREE.nearer * (SETUP_FREE.spacing if spacing is None else spacing) / lines.distance
        guesses += [by_ruler] if min(wide) / _WRONG < by_ruler < _WRONG * max(wide) else []
    return guesses + [guess for guess in wide if all(abs(np.log(guess / other)) > np.log(1.5) for other in guesses)]


def _search_near_scale(
    video: Video, robot: Robot, guess: tuple[float, Lines | None, tuple[str, ...]], stills: _Stills
) -> Iterator[tuple[str, Identified | None]]:
    """Look for the robot near a guessed scale, in each direction; then at half to twice of it, if anything moves."""
    finders = {}
    pixel, lines, directions = guess
    for direction in directions:
        setup = _setup(robot, video.size, pixel, direction)
        optics = camera_of_setup(setup, video.size).optics
        if lines is not None:
            optics = optics.moved({"rotation": first_rotation(optics, lines)})
        finders[direction] = setup, BodyFinder(robot, optics, bounds_of(setup, video))
    most = reduction(video.size)
    for sized in (False, True) if stills.changes else (False,):
        for direction, (setup, finder) in finders.items():
            factor = searched_at(finder.shape().width, most)
            images, still = [frame.reduced(factor) for frame in stills.frames], stills.at(factor)
            size = best_other_size(finder, images, still) if sized else 1.0
            body = None if size is None else resized(finder, size)
            yield direction, None if body is None else _looked(video, setup, body, stills, factor)


def _looked(video: Video, setup: Setup, body: BodyFinder, stills: _Stills, factor: int) -> Identified | None:
    """The robot at about the size of a body, searched again at the size that was found; None where it is not there."""
    # First by the colours of its seal, which a cover of glass and a grid under it do not hide.
    by_seal = _by_seal(video, setup, body, stills, factor)
    if by_seal is not None:
        return by_seal
    for _ in range(SETUP_FREE.rounds):
        try:
            known = identified_at(video.name, setup, body, stills.frames, stills.at(factor), 1.0)  # no size is stated
        except InputError:
            return None
        tail = known.wire.readable
        if not known.start.flags and (tail > IDENTITY.sure_share or known.robot):
            return known
        if known.start.flags or tail < IDENTITY.least_share:
            return None
        body = resized(known.start.body, 1.0)  # it looks otherwise large: once more from there
    return None


def _by_seal(video: Video, setup: Setup, body: BodyFinder, stills: _Stills, factor: int) -> Identified | None:
    """The robot by its seal, at about the size of a body; None where its tail is not behind it."""
    colours = len(set(stripes_of(setup, body.robot)))
    for size in SETUP_FREE.seal_sizes if colours else ():
        with suppress(InputError):
            like = resized(body, size)
            known = identified_at(video.name, setup, like, stills.frames, stills.at(factor), 1.0, colours)
            tail = known.wire.readable
            if known.start.search is not None and known.robot and tail > IDENTITY.least_share:
                return known
            if known.start.search is None and not known.start.flags and tail > IDENTITY.sure_share:
                return known  # by its outline: the seal is of another size
    return None


def _observed_stripes(robot: Robot, known: Identified) -> tuple[str, ...]:
    """Colours of the stripes in the order seen: the file's own, else another one of the same colours."""
    reader = known.stripes
    own = reader.stripes
    if reader.fits or not own:
        return own if reader.fits else ()
    names, fitting = list(dict.fromkeys(own)), []
    repeats = len(own) // len(names)
    if own != tuple(names) * repeats or len(names) > SETUP_FREE.most_colours:
        return ()
    optics = known.start.body.optics
    for order in permutations(names[1:]):
        setup = _setup(robot, optics.size, 1e-4, "right")
        some = setup.model_copy(
            update={"robot": setup.robot.model_copy(update={"stripes": (names[0], *order) * repeats})}
        )
        other = Stripes(robot, some, optics)
        other.learn(known.start.seen)
        read = [np.isfinite(other.read(image, pose)[0]) for image, pose in known.start.seen]
        if other.fits and np.mean(read) > IDENTITY.least_share:
            fitting.append(stripes_of(some, robot))
    return fitting[0] if len(fitting) == 1 else ()


def _walls(still: Samples, known: Identified, lines: Lines | None) -> Walls | None:
    """The outermost clear pair of edges along the robot's path, inside the ruler; None without one."""
    # Brightness is taken at lines along the way, as the median along each, so that robot, ruler and dust drop out.
    body = known.start.body
    optics, diameter = body.optics, body.robot.body.diameter
    poses = np.array([pose for _, pose in known.start.path])
    way = np.array([np.cos(heading := float(np.median(poses[:, 2]))), np.sin(heading)])
    if lines is not None:
        along = 50.0 * np.array([[-np.cos(lines.roll), -np.sin(lines.roll)], [np.cos(lines.roll), np.sin(lines.roll)]])
        first, last = optics.points(along + np.array(optics.picture_centre), optics.axis_height)[:, :2]
        way = (last - first) / np.linalg.norm(last - first)
    side = np.array([-way[1], way[0]])
    centre = np.median(poses[:, :2], axis=0)
    centre = centre + way * ((optics.origin[:2] - centre) @ way)
    factor = optics.size[0] // still.shape[1]
    step = factor * optics.length_per_pixel
    reach = SETUP_FREE.widest * diameter
    across = np.arange(-reach, reach, step)
    along = np.linspace(-0.5, 0.5, SETUP_FREE.along) * 0.9 * max(optics.size) * optics.length_per_pixel
    grid = centre + along[:, None, None] * way + across[None, :, None] * side
    points = np.concatenate([grid, np.full((*grid.shape[:2], 1), optics.axis_height)], axis=2)
    pixels = np.nan_to_num(optics.pixels(points.reshape(-1, 3)), nan=-9.0).round().astype(int)
    inside = np.all((pixels >= 0) & (pixels < np.array(optics.size)), axis=1)
    brightness = np.full(len(pixels), np.nan)
    rows, columns = np.minimum(pixels[inside, ::-1] // factor, np.array(still.shape[:2]) - 1).T
    brightness[inside] = still[rows, columns].mean(axis=1)
    table = brightness.reshape(grid.shape[:2])
    seen = np.isfinite(table).mean(axis=0) > SETUP_FREE.seen
    if not seen.any():
        return None
    profile = np.full(across.size, np.nan)
    profile[seen] = np.nanmedian(table[:, seen], axis=0)
    steps = np.abs(np.gradient(profile))
    if lines is not None:
        there = (optics.points(lines.pixels, optics.axis_height)[:, :2] - centre) @ side
        for sign in (1.0, -1.0):
            beyond = sign * there[sign * there > 0.5 * diameter]
            if beyond.size:
                steps[sign * across > float(beyond.min()) - SETUP_FREE.paper * diameter] = np.nan
    usual = float(np.nanmedian(steps)) + SETUP_FREE.faintest
    left, right = (
        np.flatnonzero((sign * across > SETUP_FREE.nearest_wall * diameter) & (steps > 0.0)) for sign in (-1.0, 1.0)
    )
    fainter = np.minimum(steps[left][:, None], steps[right]) / usual
    width, off = across[right] - across[left][:, None], np.abs(across[right] + across[left][:, None])
    fitting = (fainter > SETUP_FREE.clear) & (off < SETUP_FREE.off_axis * diameter)
    if not fitting.any():
        return None
    one, other = np.unravel_index(np.argmax(np.where(fitting, width, 0.0)), width.shape)
    i, j = left[one], right[other]
    ends = [[centre + far * way + across[k] * side for far in (along[0], along[-1])] for k in (i, j)]
    flat = np.concatenate([np.array(ends).reshape(4, 2), np.full((4, 1), optics.axis_height)], axis=1)
    return Walls(float(width[one, other]) / diameter, float(fainter[one, other]), optics.pixels(flat).reshape(2, 2, 2))
