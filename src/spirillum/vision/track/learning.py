"""What a first look at some frames of a video tells: the camera and its scale, and the robot's appearance."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from spirillum.arrays import Samples
from spirillum.robot.robot import Robot
from spirillum.vision.camera.camera import background, bounds_of, sight_of
from spirillum.vision.camera.scale import Sight
from spirillum.vision.flag import Flag
from spirillum.vision.setup import Setup
from spirillum.vision.track.body import BodyFinder
from spirillum.vision.track.constants import SIZE
from spirillum.vision.track.glare import Glare, standing_glare
from spirillum.vision.track.identity import Identified, identify
from spirillum.vision.track.search import searched_at
from spirillum.vision.video.frames import Frame, Video
from spirillum.vision.video.pictures import reduction

__all__ = ["Learnt", "learnt_from"]


class Learnt(NamedTuple):
    """Camera, scale, and the robot as it looks."""

    sight: Sight
    """The calibrated camera."""
    known: Identified
    """The robot."""
    still: Samples
    """Static background of the pictures, (h, w, 3); reduced by a whole factor where they are large."""
    glare: Glare
    """Glare that stands still."""

    @property
    def flags(self) -> tuple[Flag, ...]:
        """All that is odd about the robot so far, also about what was read since."""
        known = self.known
        doubtful = bool(self.glare.flags) or abs(known.size - 1.0) > SIZE.tolerance[0]
        wire = known.wire.flags_beside(doubtful=doubtful)
        return (*known.start.flags, *known.flags, *known.stripes.flags, *wire, *self.glare.flags)


def learnt_from(
    video: Video, frames: list[Frame], setup: Setup, robot: Robot, folder: Path | None, *, by_seal: bool = True
) -> Learnt:
    """Learn from some frames.

    Args:
        video: the video, for its name and the size of its pictures.
        frames: frames spread over it.
        setup: its setup.
        robot: the robot in front of the camera.
        folder: folder of the setup file, to which the checkerboard's folder is relative.
        by_seal: whether the robot is looked for by its coloured seal first, else by its outline alone.

    Raises:
        InputError: if neither ruler nor robot is found.
    """
    factor = reduction(video.size)
    still = background(frames, factor)
    sight = sight_of(video, setup, still, folder, frames)
    finder = BodyFinder(robot, sight.optics, bounds_of(setup, video))
    searched = searched_at(finder.shape().width, factor)
    still = still if searched == factor else background(frames, searched)
    known = identify(video.name, setup, finder, frames, still, by_seal=by_seal)
    poses = [known.start.expected(frame.time) for frame in frames]
    glare = standing_glare([frame.image for frame in frames], poses, known.start.body)
    known = known._replace(start=replace(known.start, seen=[]))  # what was learnt from is not needed any longer
    return Learnt(sight, known, still, glare)
