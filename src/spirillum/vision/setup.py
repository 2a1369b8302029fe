"""`SETUP.toml`: what the experimenter knows of camera, tank, markers and robot."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from spirillum.errors import led_by
from spirillum.files import read_toml
from spirillum.robot.fields import Length, LengthOrZero, Section, Text, Time, problems_in, refused_table
from spirillum.robot.geometry import Stripes
from spirillum.robot.load import load
from spirillum.robot.robot import Robot

WHAT = "a setup file (TOML, see `spirillum schema setup`)"
_Pixels = Annotated[int, Field(strict=True, ge=0, le=100_000)]
_Corners = Annotated[int, Field(strict=True, ge=3, le=50)]


class Checkerboard(Section):
    """Pictures of a checkerboard in air, from which the lens's distortion and focal length are found."""

    images: Annotated[Text, Field(min_length=1, max_length=1000)]  #: Folder of the pictures, beside the setup file.
    columns: _Corners  #: Inner corners along a row.
    rows: _Corners  #: Inner corners along a column.
    square: Length  #: Side of a square.


class CameraSetup(Section):
    """The camera. It looks straight down (`top`), or level at the channel (`side`)."""

    view: Literal["top", "side"] = "top"  #: `top`: from above; `side`: level, upright, at right angles to the channel.
    height: Length  #: Height of the lens above the reference plane: the tank's floor; for `side` its far wall.
    height_uncertainty: LengthOrZero = 0.0  #: Standard uncertainty of that height.
    frames_per_second: Annotated[float, Field(strict=True, ge=0.01, le=1e5, allow_inf_nan=False)] | None = None
    """Frames a second of a folder of images, or instead of a video's own time stamps."""
    pixel_aspect_ratio: Annotated[float, Field(strict=True, ge=0.2, le=5.0, allow_inf_nan=False)] | None = None
    """Width of a stored pixel over its height (1: square), instead of what the video states."""
    checkerboard: Checkerboard | None = None
    """Calibration of the lens; without it the lens is taken as free of distortion, beyond what the markers show."""


INDICES = (1.0, 3.0)  #: Least and largest refractive index.


class TankSetup(Section):
    """What the camera looks through."""

    surface: Length | None = None
    """Height of the flat surface between air and oil (`side`: of the tank's near wall); unset: nothing refracts."""
    surface_uncertainty: LengthOrZero = 0.0  #: Standard uncertainty of that height.
    index: Annotated[float, Field(strict=True, ge=INDICES[0], le=INDICES[1], allow_inf_nan=False)] = 1.4
    """Refractive index of the oil."""
    index_uncertainty: Annotated[float, Field(strict=True, ge=0.0, le=0.5, allow_inf_nan=False)] = 0.0
    """Standard uncertainty of that index."""


class Markers(Section):
    """What gives the scale: a ruler of equally spaced lines across the direction of swimming, or a known scale."""

    spacing: Length | None = None  #: Distance from each line of the ruler to the next (the paper: 2 mm).
    spacing_uncertainty: LengthOrZero = 0.0  #: Standard uncertainty of that distance.
    height: LengthOrZero | None = None  #: Height of the ruler above the reference plane.
    height_uncertainty: LengthOrZero = 0.0  #: Standard uncertainty of that height.
    length_per_pixel: Length | None = None
    """Instead of a ruler: length that one pixel shows at the height of the robot's axis."""
    length_per_pixel_uncertainty: LengthOrZero = 0.0  #: Standard uncertainty of that length.

    @model_validator(mode="after")
    def _one_scale(self) -> Self:
        problems = []
        if (self.spacing is None) == (self.length_per_pixel is None):
            problems.append("markers: allowed: exactly one of `spacing` (with `height`) and `length_per_pixel`")
        if self.spacing is not None and self.height is None:
            problems.append("markers.height is missing; it has to be given with `spacing`")
        if problems:
            raise PydanticCustomError("assembly", "{sentences}", {"sentences": "\n".join(problems)})
        return self


class RobotSetup(Section):
    """The robot in front of the camera."""

    file: Annotated[Text, Field(min_length=1, max_length=1000)]  #: A preset, or a robot file beside the setup file.
    axis_height: Length  #: Height of the robot's axis above the reference plane.
    axis_height_uncertainty: LengthOrZero = 0.0
    """Standard uncertainty of that height: 10 mm of depth can be 7 % of scale."""
    direction: Literal["right", "left", "up", "down"] = "right"  #: Where in the picture the nose points.
    appearance: Literal["opaque", "glass", "unknown"] = "unknown"
    """What the body's cover looks like: `opaque`, or `glass`, through which its contents and the background show."""
    stripes: Stripes | None = None
    """Colours of the stripes in their order, from the first one towards -y, if they are not those of the robot file."""


class Region(Section):
    """The part of the picture to look at, pixels from its upper left corner."""

    left: _Pixels = 0  #: First column.
    top: _Pixels = 0  #: First row.
    width: Annotated[int, Field(strict=True, ge=32, le=100_000)]  #: Number of columns.
    height: Annotated[int, Field(strict=True, ge=32, le=100_000)]  #: Number of rows.


class Setup(Section):
    """A setup: where camera, oil surface, ruler and robot are, and what each of them is."""

    camera: CameraSetup  #: The camera.
    tank: TankSetup = TankSetup()  #: What the camera looks through.
    markers: Markers  #: What gives the scale.
    robot: RobotSetup  #: The robot.
    region: Region | None = None  #: Part of the picture to look at; unset: all of it.
    start: Time = 0.0  #: Time in the video from which on to measure, as when the robot has started up.
    end: Time | None = None  #: Time in the video until which to measure; unset: its end.

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        top = self.camera.height if self.tank.surface is None else self.tank.surface
        bound = "camera.height" if self.tank.surface is None else "tank.surface"
        problems = []
        if self.tank.surface is not None and self.tank.surface >= self.camera.height:
            problems.append("tank.surface is not below camera.height; allowed: a surface below the lens")
        if self.robot.axis_height >= top:
            problems.append(f"robot.axis_height is not below {bound}; allowed: a robot under it")
        if self.markers.height is not None and self.markers.height >= top:
            problems.append(f"markers.height is not below {bound}; allowed: a ruler under it")
        if self.end is not None and self.end <= self.start:
            problems.append(f"end = {self.end:g} s is not after start = {self.start:g} s; allowed: a later time")
        if problems:
            raise PydanticCustomError("assembly", "{sentences}", {"sentences": "\n".join(problems)})
        return self


def load_setup(path: str | Path, overrides: Mapping[str, Any] | None = None) -> tuple[Setup, Robot]:
    """Read a setup file and the robot that it names, with dotted fields of the robot in place of its own."""
    path = Path(path)
    checked = problems_in(Setup, read_toml(path, WHAT))
    if isinstance(checked, list):
        raise refused_table(checked, str(path))
    beside = path.parent / checked.robot.file
    with led_by(f"{path}: robot.file"):
        robot = load(beside if beside.is_file() else checked.robot.file, **(overrides or {}))
        robot.check_body("the tracker, which follows the body's outline,")
    return checked, robot


def stripes_of(setup: Setup, robot: Robot) -> tuple[str, ...]:
    """Colours of the stripes in their order: the setup's, else the robot file's; empty where there are none."""
    if setup.robot.stripes is not None:
        return tuple(setup.robot.stripes)
    return tuple(robot.seal.stripes) if robot.seal else ()
