"""The first look at a video: whether the robot is there, where, and what its edges look like."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.errors import InputError
from spirillum.robot.robot import Robot
from spirillum.robust import least_squares_line
from spirillum.vision.camera.optics import BodyPose, Optics, opposite, positions_seen_by
from spirillum.vision.flag import Flag
from spirillum.vision.track.body import BodyFinder
from spirillum.vision.track.constants import DETECTION, SEAL, VISIBILITY
from spirillum.vision.track.search import PoseCandidate, Shape, close_places, most_likely, refined
from spirillum.vision.track.size import OutlineFit, apparent_outline, clearness, resized
from spirillum.vision.track.visibility import rivals_in, turned_flags
from spirillum.vision.video import opencv as cv2
from spirillum.vision.video.frames import Frame


class _Plane(NamedTuple):
    """A grid in the plane through the robot's axis, along and across the channel."""

    x: Samples  # positions along, m, (c,)
    y: Samples  # positions across, m, (r,)
    columns: Samples  # pixel column of each of its points, (r, c); outside of the picture where it is not looked at
    rows: Samples  # pixel row of each of its points, (r, c)


class SealSearch:
    """Looks for the seal of a robot in whole pictures."""

    def __init__(self, robot: Robot, optics: Optics, bounds: tuple[int, int, int, int]) -> None:
        """Lay out the grid in which the seal is looked for."""
        assert robot.seal is not None  # noqa: S101 - checked by the caller
        self._step = robot.body.diameter / SEAL.search_width
        nearer = 1.0 + 0.5 * robot.body.diameter / (optics.height - optics.axis_height)  # its top is what is seen
        self._long = max(3, round(nearer * robot.seal.length / self._step))
        self._wide = round(robot.body.diameter / self._step)
        self._middle = 0.5 * (robot.seal.length - robot.body.length)
        self._blur = max(0.5 * self._step / optics.length_per_pixel, SEAL.search_blur)
        self._plane = _plane(optics, bounds, self._step)

    def places(self, image: np.ndarray) -> list[PoseCandidate]:
        """Where a seal may be, at most three places, best first; scores are differences of colour, of 255."""
        score, found = self._score(image), []
        for _ in range(3):
            row, column = np.unravel_index(int(np.argmax(score)), score.shape)
            best = float(score[row, column])
            if best <= 0.0:
                break
            pose = BodyPose(float(self._plane.x[column] - self._middle), float(self._plane.y[row]), 0.0)
            found.append(PoseCandidate(pose, best))
            near = (slice(max(0, at - self._wide), at + self._wide + 1) for at in (row, column))
            score[tuple(near)] = 0.0
        return found

    def _score(self, image: np.ndarray) -> Samples:
        """Colour of a block around each place, over that of the most colourful of its four surroundings."""
        flat = cv2.GaussianBlur(image, (0, 0), self._blur)
        flat = cv2.remap(flat, self._plane.columns, self._plane.rows, cv2.INTER_LINEAR, borderValue=(0, 0, 0))
        red, green, blue = np.moveaxis(flat.astype(np.float32), -1, 0)
        colour = np.hypot(red - green, 0.5 * (red + green) - blue)
        long, wide, beside = self._long, self._wide, max(2, self._long // 3)

        def mean(across: int, down: int) -> Samples:
            return np.asarray(cv2.blur(colour, (across, down), borderType=cv2.BORDER_CONSTANT))

        ends, flanks = mean(beside, wide), mean(long, beside)
        far, high = (long + beside) // 2 + 1, (wide + beside) // 2 + 1
        around = [np.roll(ends, far, 1), np.roll(ends, -far, 1), np.roll(flanks, high, 0), np.roll(flanks, -high, 0)]
        return np.asarray(mean(long, round(0.9 * wide)) - np.maximum.reduce(around))


def _plane(optics: Optics, bounds: tuple[int, int, int, int], step: float) -> _Plane:
    """The grid in the plane through the axis that covers a part of the picture."""
    left, top, right, bottom = bounds
    corners = np.array([[u, v] for u in (left, right - 1) for v in (top, bottom - 1)], dtype=float)
    ends = optics.points(corners, optics.axis_height)[:, :2]
    x, y = (
        np.arange(low, high, step) for low, high in zip(np.nanmin(ends, axis=0), np.nanmax(ends, axis=0), strict=True)
    )
    grid = np.stack([*np.meshgrid(x, y), np.full((y.size, x.size), optics.axis_height)], axis=-1)
    pixels = np.nan_to_num(optics.pixels(grid.reshape(-1, 3)), nan=-9.0).reshape(y.size, x.size, 2)
    inside = np.all((pixels >= (left, top)) & (pixels < (right, bottom)), axis=2)
    columns, rows = np.moveaxis(np.where(inside[..., None], pixels, -9.0).astype(np.float32), -1, 0)
    return _Plane(x, y, np.ascontiguousarray(columns), np.ascontiguousarray(rows))


_THREADS = 2
_ALLOWED = "allowed: one that is in view, with the right robot.file, heights and scale, or a [region] around it"


@dataclass(frozen=True)
class Start:
    """Result of the initial detection."""

    body: BodyFinder = field(repr=False)  #: The trained body before a camera that shows it as large as it looks.
    size: float  #: How large it looks, over the body that was looked for.
    off: tuple[float, float]
    """From where its edges were learnt to where its outline lies, (x, y), m: the search takes a lit side and a shadow
    for a part of the body, by some tenths of a pixel, and edges are learnt where it has found them."""
    seen: list[tuple[np.ndarray, BodyPose]] = field(repr=False)  #: Frames with the robot, 8-bit RGB, and where it is.
    path: list[tuple[float, BodyPose]]  #: When it was where.
    score: float  #: How clear its edges usually are, grey per pixel.
    clearness: float  #: How clearly it stands out: `spirillum.vision.track.size.clearness`.
    rivals: list[tuple[np.ndarray, BodyPose]] = field(repr=False)  #: Frames with a false detection as clear, and where.
    flags: tuple[Flag, ...]
    search: SealSearch | None = field(default=None, repr=False)
    """What looks for the seal in whole pictures, where the robot was found by it."""

    def expected(self, time: float) -> BodyPose:
        """Where it should be at a time."""
        return pose_on_path(self.path, time)

    def close(self, frame: Frame, still: Samples, guess: BodyPose) -> BodyPose:
        """Where the body is near a guess, to a pixel."""
        if self.body.seal is not None:
            return self.body.place_by_seal(frame.image, guess).pose
        return close_place(frame, still, self.body, guess).pose


class _Learnt(NamedTuple):
    """Where the body is on the frames that it was learnt from."""

    frames: list[Frame]
    poses: list[BodyPose]
    score: float  # how clear its edges usually are, grey per pixel
    whole: list[bool]  # whether it is in full view

    @property
    def typical(self) -> BodyPose:
        """One of the places, from the middle."""
        return self.poses[len(self.poses) // 2]


class _InitialDetection(NamedTuple):
    """The robot on some frames, before its edges are learnt."""

    body: BodyFinder
    about: _Learnt
    clearness: float
    rivals: list[tuple[np.ndarray, BodyPose]]
    flags: tuple[Flag, ...]
    search: SealSearch | None


def detect_robot(name: str, body: BodyFinder, frames: Sequence[Frame], still: Samples, colours: int = 0) -> Start:
    """Find the robot on frames spread over the video; learn its size, within a tenth, and what its edges look like."""
    focal = body.optics.focal
    found = (_detect_by_seal(body, frames, colours) if colours else None) or _by_outline(name, body, frames, still)
    body, about = found.body, found.about
    learnt = _learnt(name, body, about)
    if body.colours:
        body, learnt = _by_whole_outline(body, learnt) or (body, learnt)
    outline = _outline_of(body, learnt)
    stated = True
    for _ in range(DETECTION.relearning):
        if outline.fits(body.optics.length_per_pixel, stated=stated):
            break
        resizes, stated = outline.resizes, stated and not outline.resizes
        body, about = _moved(body, learnt, outline, stated=stated)
        if resizes and not body.colours:
            # A body of the wrong size lay at one of its ends, now at this one, now at that.
            known = [(frame.time, pose) for frame, pose in zip(about.frames, about.poses, strict=True)]
            about = _roughly(body, known, frames, still)
        learnt = _learnt(name, body, about)
        outline = _outline_of(body, learnt)
    size = body.optics.focal / focal * outline.size
    every = range(len(learnt.poses))
    whole = [k for k in every if learnt.whole[k]]
    seen = [
        (learnt.frames[k].image, learnt.poses[k]) for k in (whole if len(whole) >= DETECTION.whole_frames else every)
    ]
    path = [(frame.time, pose) for frame, pose in zip(learnt.frames, learnt.poses, strict=True)]
    off = (outline.move.x, outline.move.y) if outline.fits(body.optics.length_per_pixel) else (0.0, 0.0)
    search = found.search and SealSearch(body.robot, body.optics, body.bounds)
    return Start(body, size, off, seen, path, learnt.score, found.clearness, found.rivals, found.flags, search)


def _by_outline(name: str, body: BodyFinder, frames: Sequence[Frame], still: Samples) -> _InitialDetection:
    """Find the robot by the outline of its body."""
    every = np.unique(
        np.linspace(0, len(frames) - 1, min(DETECTION.searched, len(frames))).round().astype(int)
    ).tolist()
    factor = frames[0].image.shape[1] // still.shape[1]
    images, shape = [frames[k].reduced(factor) for k in every], body.shape(factor)
    found = _places(shape, images, still)
    if not _clear(found):
        turned = _places(shape, images, still, turn=np.pi)
        if _clear(turned) and _is_one_object(turned, body.robot.body.length):
            side, other = body.optics.direction, opposite(body.optics.direction)
            raise InputError(
                f"{name}: robot.direction = '{side}', but a robot like '{body.robot.name}' is seen with its nose on "
                f"the other side; allowed: '{other}', if it points there; else heights and scale that fit: at a "
                "wrong one either end may look like the nose"
            )
        raise InputError(f"{name}: no robot like '{body.robot.name}' was found in its pictures; {_ALLOWED}")
    chosen = most_likely(found, body.robot.body.length)
    rivals = rivals_in(body, [frames[k].image for k in every], found, chosen)
    flags = turned_flags(shape, images, still, found, chosen)
    known = [(frames[k].time, one.pose) for k, one in zip(every, chosen, strict=True) if one is not None]
    return _InitialDetection(body, _roughly(body, known, frames, still), clearness(found), rivals, flags, None)


def _detect_by_seal(body: BodyFinder, frames: Sequence[Frame], colours: int) -> _InitialDetection | None:
    """Find the robot by the colours of its seal; None where no block of colour has its size on most frames."""
    if not body.contour.seal.any():
        return None
    search = SealSearch(body.robot, body.optics, body.bounds)
    found = [search.places(frame.image) for frame in frames]
    scores = np.array([[one.score for one in some[:2]] + [0.0] * (2 - len(some)) for some in found])
    best, clear = np.median(scores, axis=0)[0], float(np.median(scores[:, 0] / np.maximum(scores[:, 1], 1.0)))
    if best < SEAL.least_score or np.mean(scores[:, 0] > DETECTION.faint * best) < SEAL.clear_share:
        return None
    finder = BodyFinder(body.robot, body.optics, body.bounds, body.contour, colours=colours)
    guesses, size = [some[0].pose if some else None for some in found], 1.0
    for _ in range(SEAL.sizes):
        placed = [
            None if guess is None else finder.place_by_seal(frame.image, guess)
            for frame, guess in zip(frames, guesses, strict=True)
        ]
        seen = [k for k, one in enumerate(placed) if one is not None and one.known]
        if len(seen) < SEAL.clear_share * len(frames):
            return None
        poses = [one.pose for one in placed if one is not None and one.known]
        stated = finder.optics is body.optics
        off = finder.size_by_seal([frames[k].image for k in seen], poses, rough=stated)
        size *= off
        if not abs(np.log(size)) < SEAL.largest_difference:
            return None
        if stated and abs(off - 1.0) < SEAL.size_tolerance:
            break
        finder = resized(finder, off)
        if not stated and abs(off - 1.0) < SEAL.size_error:
            break
        search = SealSearch(body.robot, finder.optics, body.bounds)
        guesses = [next((one.pose for one in search.places(frame.image)), None) for frame in frames]
    rivals = _rivals_of_seal([frames[k] for k in seen], [found[k] for k in seen])
    about = _Learnt([frames[k] for k in seen], poses, float(best), [True] * len(seen))
    return _InitialDetection(finder, about, clear, rivals, (), search)


def _rivals_of_seal(frames: Sequence[Frame], found: Sequence[list[PoseCandidate]]) -> list[tuple[np.ndarray, BodyPose]]:
    """Frames on which a second block of colour is as clear as the seal, and where; empty unless they are frequent."""
    rivals = [
        (frame.image, some[1].pose)
        for frame, some in zip(frames, found, strict=True)
        if len(some) > 1 and some[1].score > VISIBILITY.second * some[0].score
    ]
    return rivals if len(rivals) > VISIBILITY.often * len(frames) else []


def _by_whole_outline(body: BodyFinder, learnt: _Learnt) -> tuple[BodyFinder, _Learnt] | None:
    """The body by its whole outline, which is more accurate; None unless it moves with the seal, and has its size."""
    # What stands still seems to move along where the robot hardly moves.
    poses, pixel = np.array(learnt.poses), body.optics.length_per_pixel
    if float(np.ptp(poses[:, 0])) < SEAL.far_enough * pixel or not body.outline_moves:
        return None
    images, times = [frame.image for frame in learnt.frames], np.array([frame.time for frame in learnt.frames])
    size = body.size_by_seal(images, learnt.poses)
    plain = BodyFinder(body.robot, body.optics, body.bounds, body.contour)
    found, start = plain.learn(images, learnt.poses, times), learnt.poses
    for _ in range(SEAL.moves):  # edges are learnt where the outline lies: compression shifts those of the seal
        move = apparent_outline(plain, found[len(found) // 2].pose).move
        start = [BodyPose(*row) for row in (np.array(start) + np.array(move)).tolist()]
        found = plain.learn(images, start, times)
    if not all(one.known for one in found):
        return None
    other = learnt._replace(poses=[one.pose for one in found])
    apart = np.array(other.poses)[:, 0] - poses[:, 0]
    outline = apparent_outline(plain, other.typical)
    settled = outline._replace(size=1.0).fits(pixel)  # it does not between the rims of a glass cover and a dark liner
    if not settled or abs(outline.size - size) > SEAL.agreement or float(np.std(apart)) > SEAL.apart * pixel:
        return None
    return plain, other._replace(whole=[one.inside >= VISIBILITY.full_view for one in found])


def _outline_of(body: BodyFinder, learnt: _Learnt) -> OutlineFit:
    """Size and place of the body by its outline; its size by its seal where that is what is followed."""
    if not body.colours:
        return apparent_outline(body, learnt.typical)
    size = body.size_by_seal([frame.image for frame in learnt.frames], learnt.poses)
    return OutlineFit(size if abs(size - 1.0) > SEAL.size_tolerance else 1.0, BodyPose(0.0, 0.0, 0.0))


def _places(
    body: Shape, images: Sequence[np.ndarray], still: Samples, *, turn: float = 0.0
) -> list[list[PoseCandidate]]:
    """The likeliest places on some frames, of a body that is turned by an angle in the picture's plane."""
    with ThreadPoolExecutor(_THREADS) as pool:  # the compiled loops run side by side
        return list(pool.map(lambda image: close_places(image, still, body, turn=turn), images))


def close_place(frame: Frame, still: Samples, body: BodyFinder, guess: BodyPose) -> PoseCandidate:
    """The body near a guess, to a pixel: in the reduced picture first, if the background was reduced."""
    factor, start = frame.image.shape[1] // still.shape[1], PoseCandidate(guess, 0.0)
    if factor > 1:
        start = refined(frame.reduced(factor), still, body.shape(factor), start)
    return refined(frame.image, still, body.shape(), start._replace(score=0.0))


def _roughly(body: BodyFinder, known: list[tuple[float, BodyPose]], frames: Sequence[Frame], still: Samples) -> _Learnt:
    """Frames on which the robot is clear, and to a pixel where it is, from a few known places."""
    if not known:
        return _Learnt([], [], 0.0, [])
    found = [close_place(frame, still, body, pose_on_path(known, frame.time)) for frame in frames]
    usual = float(np.quantile([one.score for one in found], 0.8))
    found = _search_unclear_frames(found, usual, body, frames, still)
    clear = [(frame, one.pose) for frame, one in zip(frames, found, strict=True) if one.score > DETECTION.faint * usual]
    return _Learnt([frame for frame, _ in clear], [pose for _, pose in clear], usual, [True] * len(clear))


def _search_unclear_frames(
    found: list[PoseCandidate], usual: float, body: BodyFinder, frames: Sequence[Frame], still: Samples
) -> list[PoseCandidate]:
    """Search again, at the poses of clear frames, on those that are less clear: they may show clutter for the body."""
    sure = {k: (frames[k].time, one.pose) for k, one in enumerate(found) if one.score > DETECTION.doubtful * usual}
    doubtful = [k for k in range(len(found)) if k not in sure]
    if len(sure) < DETECTION.whole_frames or not doubtful:
        return found
    found = list(found)
    for k in sorted(doubtful, key=lambda k: min(abs(k - other) for other in sure)):
        guess = pose_on_path(sorted(sure.values()), frames[k].time)
        better = close_place(frames[k], still, body, guess)
        if better.score > DETECTION.clearer * found[k].score:
            found[k], sure[k] = better, (frames[k].time, better.pose)
    return found


def _learnt(name: str, body: BodyFinder, about: _Learnt) -> _Learnt:
    """Learn from frames on which the places are known to a pixel or so."""
    times = np.array([frame.time for frame in about.frames])
    if not about.frames:
        raise InputError(f"{name}: no robot like '{body.robot.name}' can be followed in it; {_ALLOWED}")
    found = body.learn([frame.image for frame in about.frames], about.poses, times)
    good = [(frame, one) for frame, one in zip(about.frames, found, strict=True) if one.known]
    if not good:
        raise InputError(f"{name}: no robot like '{body.robot.name}' can be followed in it; {_ALLOWED}")
    whole = [one.inside >= VISIBILITY.full_view for _, one in good]
    return _Learnt([frame for frame, _ in good], [one.pose for _, one in good], about.score, whole)


def _moved(body: BodyFinder, learnt: _Learnt, outline: OutlineFit, *, stated: bool) -> tuple[BodyFinder, _Learnt]:
    """Where the outline lies, in front of a camera that shows it as large as it looks; a `stated` size is kept."""
    other = body if stated else resized(body, outline.size)
    moved = np.array(learnt.poses) + np.array(outline.move)
    there = positions_seen_by(other.optics, body.optics, moved[:, :2])
    poses = [BodyPose(*row) for row in np.column_stack([there, moved[:, 2]]).tolist()]
    return other, _Learnt(learnt.frames, poses, learnt.score, learnt.whole)


def _clear(found: Sequence[list[PoseCandidate]]) -> bool:
    """Whether something stands out of the pictures as a robot does."""
    clear = [len(some) > 0 and (len(some) < 3 or some[0].score > DETECTION.clearness * some[2].score) for some in found]
    return float(np.mean(clear)) >= DETECTION.clear_share


def _is_one_object(found: Sequence[list[PoseCandidate]], length: float) -> bool:
    """Whether what stands out is one thing that goes along, not clutter now here, now there."""
    places = np.array([(some[0].pose.x, some[0].pose.y) for some in found if some])
    bends = np.hypot(*np.diff(places, 2, axis=0).T) if len(places) > 2 else np.zeros(1)
    return float(np.median(bends)) < DETECTION.bend * length


def pose_on_path(known: list[tuple[float, BodyPose]], time: float) -> BodyPose:
    """Where the body should be at a time, by straight lines between and beyond known places."""
    times = np.array([at for at, _ in known])
    poses = np.array([pose for _, pose in known])
    if len(known) == 1:
        return BodyPose(*poses[0].tolist())
    if times[0] <= time <= times[-1]:
        return BodyPose(*(float(np.interp(time, times, poses[:, k])) for k in range(3)))
    few = slice(0, 4) if time < times[0] else slice(-4, None)
    slope = least_squares_line(times[few], poses[few]).slope
    edge = 0 if time < times[0] else -1
    there = poses[edge] + slope * (time - times[edge]) * np.array([1.0, 1.0, 0.0])
    return BodyPose(*there.tolist())
