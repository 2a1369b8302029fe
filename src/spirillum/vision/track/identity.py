"""Identification of the robot: its stripes or its tail have to match the detected object."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.errors import InputError
from spirillum.vision.camera.optics import BodyPose, Optics, opposite, project
from spirillum.vision.flag import Flag
from spirillum.vision.setup import Setup, stripes_of
from spirillum.vision.track.body import BodyFinder
from spirillum.vision.track.constants import DETECTION, IDENTITY, SIZE, STANDING
from spirillum.vision.track.initial_detection import Start, detect_robot
from spirillum.vision.track.search import close_places
from spirillum.vision.track.size import best_other_size, resized
from spirillum.vision.track.stripes import Stripes
from spirillum.vision.track.tail import TailWave
from spirillum.vision.video import opencv as cv2
from spirillum.vision.video.frames import Frame

_SIZES = (1.0, 0.3, 3.3)
"""Apparent sizes over the stated one, about which from half to twice is looked through, one after the other."""


class Identified(NamedTuple):
    """The detected object, with readers that have learnt the appearance of its stripes and tail."""

    start: Start
    stripes: Stripes
    wire: TailWave
    size: float  #: Apparent size over the size of the robot file at the stated scale.
    robot: bool
    """Whether stripes or tail match the robot; both have to where the size is unexpected, the whole tail where the
    contrast is."""
    stands: bool = False  #: Whether its stripes were found in the static background, without its tail.

    @property
    def whole(self) -> bool:
        """Whether the tail is where it should be, and as in the file: at a wrong scale chance shows a body alone."""
        wire = self.wire
        return wire.readable > IDENTITY.sure_share and not any(flag.spoils for flag in wire.flags)

    def tail_size(self, stated: Optics) -> float:
        """Apparent wavelength of the tail over that of the robot file at the stated scale; NaN where it is not sure."""
        return self.wire.stretch * self.start.body.optics.focal / stated.focal

    @property
    def flags(self) -> tuple[Flag, ...]:
        """Warnings on another object, or on a second robot."""
        flags = []
        if self.stands:
            flags.append(Flag.named("stripes-stand-still"))
        elif not self.robot:
            flags.append(Flag.named("not-the-robot"))
        rivals = self.start.rivals
        if rivals and np.mean([self._matches(image, pose) for image, pose in rivals]) > IDENTITY.least_share:
            flags.append(Flag.named("two-robots", count=len(rivals)))
        return tuple(flags)

    @property
    def stripes_read(self) -> float:
        """Share of the frames learnt from on which the stripes are read."""
        seen = self.start.seen
        return float(np.mean([np.isfinite(self.stripes.read(image, pose)[0]) for image, pose in seen])) if seen else 0.0

    def _matches(self, image: np.ndarray, pose: BodyPose) -> bool:
        """Whether stripes or tail match the robot at a pose."""
        return bool(np.isfinite(self.stripes.read(image, pose)[0])) or self.wire.reads(image, pose)


def identify(
    name: str, setup: Setup, stated: BodyFinder, frames: list[Frame], still: Samples, *, by_seal: bool = True
) -> Identified:
    """Find the robot at its stated size; if that object does not match, at any size, which takes some seconds."""
    found: Identified | InputError
    try:
        found, is_whole = _at_stated_size(name, setup, stated, frames, still, by_seal=by_seal)
        if is_whole:
            return found
    except InputError as error:
        found = error
    half = not isinstance(found, InputError) and found.robot  # its tail does not fit: another size has to fit wholly
    standing = None if half else _standing(name, setup, stated, frames, still)
    if standing is not None and standing.robot:
        return standing
    if standing is None and isinstance(found, InputError) and _is_noise_alone(frames, still):
        raise InputError(
            f"{name}: nothing moves in its pictures, and no robot like '{stated.robot.name}' stands in them: the tube "
            "seems to be empty; allowed: a robot in view, or one at rest with stripes and tail in view"
        ) from found
    other = _at_another_size(name, setup, stated, frames, still, half=half)
    if other is not None:
        return other
    if standing is not None:
        return standing
    if isinstance(found, InputError):
        raise found
    if found.robot or not found.start.flags or _turned_round(name, setup, stated, frames, still):
        return found
    return found._replace(start=replace(found.start, flags=()))


def _at_stated_size(
    name: str, setup: Setup, stated: BodyFinder, frames: list[Frame], still: Samples, *, by_seal: bool
) -> tuple[Identified, bool]:
    """What resembles the robot at its stated size, and whether seal or tail leave no doubt that it is the robot."""
    colours = len(set(stripes_of(setup, stated.robot))) if by_seal else 0
    found = identified_at(name, setup, stated, frames, still, 1.0, colours)
    if found.start.search is not None:
        if found.robot:
            return _with_nose(name, setup, stated, frames, still, found), True
        found = identified_at(name, setup, stated, frames, still, 1.0)  # another coloured thing
    return found, found.robot and found.whole


def _at_another_size(
    name: str, setup: Setup, stated: BodyFinder, frames: list[Frame], still: Samples, *, half: bool
) -> Identified | None:
    """The robot at a size that its file or the scale does not state; None where none fits."""
    images = [frame.reduced(frames[0].image.shape[1] // still.shape[1]) for frame in frames]
    for about in _SIZES[:1] if half else _SIZES:
        least = DETECTION.clearness if half else SIZE.clearness
        factor = best_other_size(stated, images, still, least, about)
        sizes = [] if factor is None else [about * factor]
        for size in sizes:
            with suppress(InputError):
                other = identified_at(name, setup, resized(stated, size), frames, still, size)
                if other.robot and (other.whole or not half):
                    return other
                # A part of the body, up to its seal, may look like a smaller one: its tail is looked for from there.
                if len(sizes) == 1 and abs(np.log(other.size / size)) > IDENTITY.next_size:
                    sizes.append(other.size)
    return None


def _standing(name: str, setup: Setup, stated: BodyFinder, frames: list[Frame], still: Samples) -> Identified | None:
    """The robot in the static background; None where its stripes are not there, no `robot` where its tail is not."""
    if not stripes_of(setup, stated.robot):
        return None  # a tail alone may be chance: all frames show the same background
    nothing, striped = np.zeros_like(still), None
    for body in _standing_bodies(stated, still):
        with suppress(InputError):
            for some in (frames[:: STANDING.stride], frames):  # what is no robot is found out sooner by few
                found = identified_at(name, setup, body, some, nothing, 1.0)
                if not (found.robot and found.whole and found.stripes.fits):
                    break
            else:
                found.start.body.look_within(stated.bounds)
                return found
            if striped is None and found.stripes.fits and found.stripes_read > IDENTITY.sure_share:
                striped = found._replace(robot=False, stands=True)
    return striped


def _is_noise_alone(frames: list[Frame], still: Samples) -> bool:
    """Whether the frames differ from their background by noise alone."""
    for frame in frames:
        image = frame.reduced(frame.image.shape[1] // still.shape[1])
        change = cv2.GaussianBlur(np.subtract(image, still, dtype=np.float32), (0, 0), STANDING.blur).mean(axis=2)
        if np.quantile(np.abs(change - np.median(change)), STANDING.at_rest) > STANDING.noise:
            return False
    return True


def _standing_bodies(stated: BodyFinder, still: Samples) -> list[BodyFinder]:
    """Untrained finders of a body at the places of a background where one may stand, most likely first."""
    # A robot that moves is found in what changes. One that stands belongs to the background, beside rulers and edges of
    # the tank that look as clear as its body. Only where stripes and the whole tail are read there too is it the robot:
    # an empty tube shows neither.
    shape = stated.shape(stated.optics.size[0] // still.shape[1])
    picture = np.clip(np.round(still), 0.0, 255.0).astype(np.uint8)
    found = []
    for place in close_places(picture, np.zeros_like(still), shape):
        bounds = _surroundings(stated, place.pose)
        if min(bounds[2] - bounds[0], bounds[3] - bounds[1]) >= shape.width:
            found.append(BodyFinder(stated.robot, stated.optics, bounds, stated.contour))
    return found


def _surroundings(body: BodyFinder, pose: BodyPose) -> tuple[int, int, int, int]:
    """Part of the picture about a robot, and about the path of one that hardly moves: left, top, right, bottom."""
    robot = body.robot
    half_width = STANDING.half_width * robot.body.diameter
    ahead = (0.5 + STANDING.ahead) * robot.body.length
    behind = ahead + robot.coupling.length + robot.tail.length
    corners = [[x, y, 0.0] for x in (-behind, ahead) for y in (-half_width, half_width)]
    pixels = project(np.array(corners), pose, body.optics)
    if not np.isfinite(pixels).all():
        return 0, 0, 0, 0
    low = np.maximum(np.floor(pixels.min(axis=0)), body.bounds[:2]).astype(int).tolist()
    high = np.minimum(np.ceil(pixels.max(axis=0)), body.bounds[2:]).astype(int).tolist()
    return low[0], low[1], high[0], high[1]


def _with_nose(
    name: str, setup: Setup, stated: BodyFinder, frames: list[Frame], still: Samples, found: Identified
) -> Identified:
    """A robot that was found by its seal, with a flag where its whole tail is at the other end."""
    if found.wire.readable > IDENTITY.sure_share or not _turned_round(name, setup, stated, frames, still):
        return found
    why = "turned round, it has the robot's tail"
    flag = Flag.named("nose-on-the-other-side", side=stated.optics.direction, why=why)
    return found._replace(start=replace(found.start, flags=(flag,)))


def _turned_round(name: str, setup: Setup, stated: BodyFinder, frames: list[Frame], still: Samples) -> bool:
    """Whether the robot is there with its whole tail, at its stated size, if its nose is at the other end."""
    # A body alone constrains its ends little where it is blurred, or looked for at a wrong scale.
    side = opposite(stated.optics.direction)
    turned = setup.model_copy(update={"robot": setup.robot.model_copy(update={"direction": side})})
    body = BodyFinder(stated.robot, replace(stated.optics, direction=side), stated.bounds)
    with suppress(InputError):
        other = identified_at(name, turned, body, frames, still, 1.0, len(set(stripes_of(setup, stated.robot))))
        return other.robot and other.whole
    return False


def identified_at(
    name: str, setup: Setup, body: BodyFinder, frames: list[Frame], still: Samples, size: float, colours: int = 0
) -> Identified:
    """Find the robot at one size over that at the stated scale, by its stripes if `colours` is not 0."""
    start = detect_robot(name, body, frames, still, colours)
    stripes, wire = Stripes(body.robot, setup, start.body.optics), TailWave(body.robot, setup, start.body.optics)
    with ThreadPoolExecutor(2) as pool:  # the compiled loops release the GIL
        list(pool.map(lambda reader: reader.learn(start.seen), (stripes, wire)))
    if wire.readable > IDENTITY.sure_share:  # the tail is at the expected end
        start = replace(start, flags=())
    total = size * start.size
    found = Identified(start, stripes, wire, total, robot=False)
    striped = found.stripes_read > IDENTITY.least_share and stripes.fits
    as_stated = abs(np.log(total)) <= IDENTITY.size_tolerance
    if as_stated and start.clearness > SIZE.clearness:
        return found._replace(robot=striped or wire.readable > IDENTITY.least_share)
    # A whole tail behind a body of the stated size is no chance, though glare or a bare seal hides the stripes.
    sure = wire.readable > IDENTITY.sure_share and (striped or not stripes.stripes)
    return found._replace(robot=sure or (as_stated and found.whole))
