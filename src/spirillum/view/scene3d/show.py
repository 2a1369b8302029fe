"""A picture of a robot in three dimensions, off-screen or in a window."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from spirillum.argument_validation import as_pixels
from spirillum.arrays import Samples
from spirillum.display import DisplayMixin
from spirillum.dynamics.run_file import RobotPose
from spirillum.errors import check_choice
from spirillum.files import MARK, atomic_write, output_target
from spirillum.notes import Note
from spirillum.robot.load import load
from spirillum.robot.robot import Robot
from spirillum.units import KINDS, parse_option
from spirillum.view.figures.scene import tail_words
from spirillum.view.figures.style import in_words
from spirillum.view.scene3d.scenery import VIEWS, SceneCamera, fitted

if TYPE_CHECKING:
    from spirillum.view.scene3d.scene import DrawnRobot

SIZES = 64, 4096  #: Least and largest allowed widths and heights of a picture, pixels.
_FINER = 2  # rendered pixels per pixel of a picture, along width and height (supersampling)
_MOST_FINER = 5_000_000  # pixels of a picture above which supersampling is off: it would take gigabytes


@dataclass(frozen=True, repr=False)
class Picture3D(DisplayMixin):
    """A picture of a robot."""

    robot: Robot
    view: str
    phase: float  #: Phase of the tail, rad.
    pixels: np.ndarray  #: (height, width, 3) the picture, sRGB bytes.
    camera: SceneCamera  #: View: `camera.pixels(points, size)` gives the picture coordinates of points of the lab.
    pose: RobotPose  #: Pose of the robot: its body's mid-length, attitude, and the angle of its tail.
    path: Path | None  #: The file that was written.

    @property
    def warnings(self) -> tuple[Note, ...]:
        """Cautions of the robot."""
        return self.robot.warnings


def show(
    robot: str | Path | Mapping[str, Any] | Robot,
    path: str | Path | None = None,
    *,
    view: str = "perspective",
    phase: str | float = 0.0,
    size: str | tuple[int, int] = (1600, 900),
    channel: bool = True,
    window: bool = False,
) -> Picture3D:
    """Render a robot lying level on its channel's floor: computed geometry in three dimensions.

    Args:
        robot: a preset's name, a robot file, its tables, or a loaded robot.
        path: PNG file to write; None: none.
        view: `perspective`, or to scale `side`, `top`, `front`, `rear`.
        phase: phase of the tail, with its unit (``"90 deg"``) or a float in rad.
        size: width and height in pixels, or ``"1600x900"``.
        channel: draw the channel around the robot, where it has one.
        window: show it in a window too, until that is closed.

    Returns:
        The picture.

    Raises:
        InputError: for wrong input, a target that cannot be written, or a machine that cannot draw.
    """
    target = None if path is None else output_target(path, {".png": "a picture"}, "robot.png")
    check_choice("view", view, VIEWS)
    turned = parse_option("phase", phase, KINDS["angle"])
    pixels = as_pixels(size, *SIZES)
    loaded = load(robot)
    from PIL import Image

    from spirillum.view.scene3d.overlay import blended_into, scale_bar, words_on
    from spirillum.view.scene3d.scene import DrawnRobot, Scene, resting

    solids = DrawnRobot.of(loaded, fineness=2.0)
    pose = resting(solids, turned)
    glass = glass_around(solids, pose.position[0], pose.position[0]) if channel else None
    camera = fitted(view, scene_points(solids, pose, glass), pixels)
    if window:
        with Scene(solids, pixels, glass=glass, live=True) as scene:
            scene.place(pose)
            scene.look(camera)
            scene.plotter.show(title=f"spirillum: {loaded.name}", auto_close=False)
    finer = _FINER if pixels[0] * pixels[1] <= _MOST_FINER else 1
    with Scene(solids, (finer * pixels[0], finer * pixels[1]), glass=glass) as scene:
        scene.place(pose)
        scene.look(camera)
        image = np.array(Image.fromarray(scene.image()).reduce(finer))
    lines = ["computed geometry" + (", to scale" if camera.parallel else "")]
    if glass is not None and loaded.channel is not None:
        lines.append(f"a piece of its channel of {in_words(loaded.channel.diameter, 'm')} inner diameter")
    bar = scale_bar(camera, pixels, pose.position)
    image = blended_into(words_on(pixels, camera, bar, loaded.name, lines))(image)
    if target is not None:
        _write_png(image, target, loaded, view)
    return Picture3D(loaded, view, turned, image, camera, pose, target)


def glass_around(
    solids: DrawnRobot, rearmost: float, foremost: float, middle: float | None = None
) -> tuple[float, float] | None:
    """Ends of the piece of channel around a robot, x in m; None without a channel, or where it has left it."""
    if solids.robot.channel is None:
        return None
    x = np.concatenate([piece.vertices[:, 0] for piece in solids.pieces])
    spare = 0.16 * solids.length
    start, end = rearmost + float(x.min()) - spare, foremost + float(x.max()) + spare
    length = solids.robot.channel.length
    if middle is None or length is None:
        return start, end
    start, end = max(start, middle - 0.5 * length), min(end, middle + 0.5 * length)
    return (start, end) if start < end else None


def scene_points(solids: DrawnRobot, pose: RobotPose, glass: tuple[float, float] | None) -> Samples:
    """(n, 3) points that a picture has to hold: the robot at any angle of its tail, and the ends of the glass, m."""
    from spirillum.view.scene3d.scenery import WALL

    corners = solids.corners(pose)
    channel = solids.robot.channel
    if glass is None or channel is None:
        return corners
    angle = np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False)
    radius = 0.5 * channel.diameter * (1.0 + WALL)
    ring = np.stack([np.zeros(48), radius * np.cos(angle), radius * np.sin(angle)], axis=-1)
    return np.concatenate([corners, *(ring + np.array([end, 0.0, 0.0]) for end in glass)])


def _write_png(image: np.ndarray, path: Path, robot: Robot, view: str) -> None:
    from PIL import Image, PngImagePlugin

    words = f"{robot.name}, {view} view: a {tail_words(robot)}. Computed geometry, not a photograph."
    facts = PngImagePlugin.PngInfo()
    facts.add_itxt("Title", robot.name)
    facts.add_text("Software", MARK)
    facts.add_itxt("Description", words)  # alternative text
    with atomic_write(path) as temporary:
        Image.fromarray(image).save(temporary, format="png", optimize=True, pnginfo=facts)
