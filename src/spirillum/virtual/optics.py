"""Optics of the virtual camera: lens, refraction at the oil, background, and field of view.

Refraction is exact; the dimensions of the tank are assumed, but to scale.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.errors import InputError
from spirillum.kernels.core import project, sightlines, still_picture
from spirillum.notes import Note
from spirillum.robot.robot import Robot
from spirillum.robot.surface import linear_light
from spirillum.virtual.trajectory import TrialTrajectory
from spirillum.virtual.trial_options import CameraOptions


@dataclass(frozen=True)
class VirtualLens:
    """The lens of the camera, in its frame: x along the channel towards the nose, z towards the camera, y = z x x.

    Lengths are in m, positions in the picture in pixels.
    Heights z count from the reference plane (the tank's floor; for a view from the side its far wall). The lens stands
    at x = y = 0. Pixel centres are at whole numbers, u to the right, v downwards.
    """

    eye: float  #: Height of the lens, m.
    surface: float  #: Height of the surface between air and oil, m.
    index: float  #: Refractive index of the oil.
    focal: float  #: Focal length, pixels.
    size: tuple[int, int]  #: Width and height of the picture, pixels.
    leftwards: bool = False  #: Whether the nose points left: the camera is rotated by half a turn about its axis.
    tilt: tuple[float, float] = (0.0, 0.0)  #: Angle of the optical axis to the vertical about x, then about y, rad.
    distortion: tuple[float, float] = (0.0, 0.0)
    """Coefficients k1, k2 of radial distortion, r -> r (1 + k1 r^2 + k2 r^4), r over the focal length."""
    turn: Samples = field(init=False, repr=False, compare=False)  #: Rotation from frame to tilted camera, (3, 3).

    def __post_init__(self) -> None:
        (cx, sx), (cy, sy) = ((np.cos(angle), np.sin(angle)) for angle in self.tilt)
        about_x = np.array([[1.0, 0.0, 0.0], [0.0, cx, -sx], [0.0, sx, cx]])
        about_y = np.array([[cy, 0.0, sy], [0.0, 1.0, 0.0], [-sy, 0.0, cy]])
        object.__setattr__(self, "turn", about_y @ about_x)

    @property
    def centre(self) -> tuple[float, float]:
        """Pixel of the optical axis: the middle of the picture."""
        return 0.5 * (self.size[0] - 1), 0.5 * (self.size[1] - 1)

    @property
    def camera(self) -> Samples:
        """Its numbers, as `kernels.rendering` takes them."""
        focal = -self.focal if self.leftwards else self.focal
        head = self.eye, self.surface, self.index, focal, *self.centre, *self.distortion
        return np.array([*head, *self.turn.flat])

    def project(self, points: Samples) -> Samples:
        """Pixel u, v and height z (m) of points, (n, 3)."""
        points = np.ascontiguousarray(points, dtype=float)
        found = np.empty_like(points)
        project(points, self.camera, found)
        return found

    def sightlines(self, pixels: Samples) -> Samples:
        """Lines of sight below the surface, (n, 5): x and y at the surface, m, and the unit vector off the camera."""
        found = np.empty((len(pixels), 5))
        sightlines(pixels, self.camera, found)
        return found

    def points(self, pixels: Samples, height: float) -> Samples:
        """Points (n, 3), m, that are seen at pixels (n, 2), at a height z below the surface, m."""
        rays = self.sightlines(pixels)
        points = rays[:, :2] + rays[:, 2:4] * ((self.surface - height) / -rays[:, 4:])
        return np.column_stack([points, np.full(len(points), height)])


_SPACING = 2e-3  # from one line of the ruler to the next in the usual picture, m
_SPACINGS = tuple(digit * 10.0**power for power in range(-5, -1) for digit in (1.0, 2.0, 5.0))
"""Those that rulers have, down to a stage micrometer's, m."""
_SIDE_AXIS = 30e-3  # height of the tube's axis above the far wall in the view from the side, m; assumed
_GLASS = 2.0e-3  # thickness of the tube's wall, m; assumed
_LINE_WIDTH, _LINE_LENGTH, _RULER_DISTANCE, _PAPER = 0.5e-3, 8.0e-3, 5.0e-3, 1.0e-3
_OIL = (0.72, 0.90, 1.98)  # absorption coefficients of red, green and blue in the oil, 1/m: a faint tint, assumed
_GLASS_ABSORPTION = 38.0  # of the glass, 1/m; assumed
# Glass refracts nearly as oil does: lines of sight go straight through it.
_MOTTLE = (9.0, 14.0, 23.0, 37.0, 61.0, 90.0)  # wavenumbers of the floor's fine structure, 1/m; assumed
_SHEET = (0.90, 0.90, 0.88)
_FINE_LINES, _STRONG_LINES = (0.11, (0.47, 0.60, 0.84)), (0.16, (0.17, 0.18, 0.23))
"""Grid paper: sRGB of the sheet; width of a line over the spacing, and sRGB of its ink; assumed."""
_FINE = 6  # samples of a pixel along u and along v


@dataclass(frozen=True)
class Tank:
    """The still parts, in the camera's frame, m. Heights count from the floor (from the side: from the far wall)."""

    view: str  #: `top` or `side`.
    tube: float | None  #: Inner radius of the tube; None: there is none.
    tube_height: float  #: Height of the tube's axis; where the robot swims without one.
    tube_length: float  #: Length of the tube; its middle is at x = 0.
    spacing: float  #: From one line of the ruler to the next.
    ruler: float  #: |y| at which the lines of both strips begin; in the usual picture they are 8 mm long.
    shrunk: float = 1.0  #: Width of the picture over that of the usual one: ruler and floor are as much finer.
    grid: bool = False  #: Whether grid paper covers the floor, instead of the ruler's strips.

    @property
    def outside(self) -> float:
        """Outer radius of the tube, 0 without one."""
        return 0.0 if self.tube is None else self.tube + _GLASS


class Backdrop(NamedTuple):
    """The still parts as the camera sees them; linear light, single precision."""

    light: np.ndarray  #: Without the robot, (rows, columns, 3).
    over: np.ndarray  #: Transmission of the glass between robot and camera, (rows, columns).
    shine: np.ndarray  #: Light mirrored by the glass, (rows, columns).
    floor: np.ndarray  #: x and y of the floor behind each pixel, m, (rows, columns, 2).


def tank_of(robot: Robot, view: str, shrunk: float = 1.0, *, grid: bool = False) -> Tank:
    """Tank of a robot: its tube is on the floor; in a side view it is midway between the walls."""
    tube, length = None, 0.0
    if robot.channel is not None:
        tube, length = 0.5 * robot.channel.diameter, robot.channel.length or 1.0
    spacing = min(one for one in _SPACINGS if one >= _SPACING * shrunk * (1.0 - 1e-9))
    ruler = _reach(robot) + _RULER_DISTANCE * shrunk
    return Tank(view, tube, tube_height(robot, view), length, spacing, ruler, shrunk, grid)


def tube_height(robot: Robot, view: str) -> float:
    """Height of the tube's axis above the reference plane, m; of the robot's path where there is no tube."""
    return _SIDE_AXIS if view == "side" else _reach(robot)


def _reach(robot: Robot) -> float:
    """From the tube's axis to its outside, m; without a tube to a little beyond the body."""
    return 0.6 * robot.body.diameter if robot.channel is None else 0.5 * robot.channel.diameter + _GLASS


def spots(side: int) -> Samples:
    """Positions of side^2 samples in each of 4 x 4 neighbouring pixels, -0.5 to 0.5, (16, side^2, 2)."""
    # In every pixel one sample lies in each of side x side cells and in each of side^2 rows and columns (multi-jittered
    # samples: K. Chiu, P. Shirley, C. Wang, Graphics Gems IV, 1994). The neighbours differ, and are shifted against
    # each other, so that an edge of any direction moves in steps finer than one sample's.
    rng = np.random.default_rng(4)
    count = side * side
    found = np.empty((16, count, 2))
    for variant in range(16):
        row, column = np.divmod(np.arange(count), side)
        inner_u = np.array([rng.permutation(side) for _ in range(side)])
        inner_v = np.array([rng.permutation(side) for _ in range(side)])
        u, v = side * column + inner_u[column, row], side * row + inner_v[row, column]
        shift = (np.array(divmod(variant, 4)) - 1.5) / 4.0
        found[variant] = ((np.stack([u, v], axis=-1) + 0.5 + shift) / count - 0.5)[rng.permutation(count)]
    return found


def tint(depth: float) -> Samples:
    """(3,) transmission of red, green and blue by a depth of oil, m."""
    return np.asarray(np.exp(-depth * np.array(_OIL)))


@lru_cache(maxsize=4)
def backdrop(tank: Tank, lens: VirtualLens) -> Backdrop:
    """The still parts seen through a lens; cached, so that trials with one tank and camera share it."""
    width, height = lens.size
    light, over, shine, floor = (np.empty((height, width, *more), dtype=np.float32) for more in ((3,), (), (), (2,)))
    still = Backdrop(light, over, shine, floor)
    ground = (0.80, 0.81, 0.79) if tank.view == "top" else (0.74, 0.79, 0.83)
    if tank.grid:
        ground = _SHEET
    colours = linear_light(np.array([ground, (0.90, 0.90, 0.88), (0.10, 0.10, 0.12)]))  # ground, paper, ink
    end, paper = tank.ruler + _LINE_LENGTH * tank.shrunk, _PAPER * tank.shrunk
    line_width = min(_LINE_WIDTH, 0.25 * tank.spacing)
    start = math.inf if tank.grid else tank.ruler - paper
    ruler = np.array([start, tank.ruler, end, end + paper, tank.spacing, line_width])
    half_length = -1.0 if tank.tube is None else 0.5 * tank.tube_length
    tube = np.array([tank.tube_height, tank.tube or 1.0, tank.outside or 1.0, half_length, _GLASS_ABSORPTION])
    azimuth, phase = np.random.default_rng(0).uniform(0.0, 2.0 * np.pi, (len(_MOTTLE), 2)).T
    wavenumber = 2 * np.pi * np.array(_MOTTLE) / tank.shrunk
    amplitude = np.full(len(_MOTTLE), 0.012)
    waves = np.column_stack([wavenumber * np.cos(azimuth), wavenumber * np.sin(azimuth), phase, amplitude])
    still_picture(lens.camera, spots(_FINE), colours, ruler, tube, waves, np.array(_OIL), *still)
    if tank.grid:
        _print_grid(still, tank.spacing, colours[0])
    return still


def _print_grid(still: Backdrop, spacing: float, paper: Samples) -> None:
    """Print the lines of grid paper on the floor, each fifth a strong one; the light of `still` is changed."""
    ratio = np.ones_like(still.light)
    for apart, width, colour in ((1.0, *_FINE_LINES), (5.0, *_STRONG_LINES)):
        bare = np.ones(still.light.shape[:2])
        for axis in (0, 1):  # lines across x, then across y
            positions = still.floor[..., axis].astype(float)
            pixel = np.abs(np.gradient(positions, axis=1 - axis))
            bare *= 1.0 - _line_share(positions, pixel, apart * spacing, width * spacing)
        ratio *= bare[..., None]
        ratio += (1.0 - bare[..., None]) * (linear_light(np.array(colour)) / paper)
    shine = still.shine[..., None]
    still.light[:] = (still.light - shine) * ratio + shine


def _line_share(positions: Samples, pixel: Samples, spacing: float, width: float) -> Samples:
    """Share of each pixel that parallel lines cover, centred at multiples of the spacing; all in m."""
    low, high = (
        width * np.floor(edge / spacing + 0.5)
        + np.clip(edge - spacing * np.floor(edge / spacing + 0.5) + 0.5 * width, 0.0, width)
        for edge in (positions - 0.5 * pixel, positions + 0.5 * pixel)
    )
    return np.asarray((high - low) / pixel)


_SURFACE = 60e-3  # height of the oil's surface above the reference plane, m; assumed
_EYE = _SURFACE + 150e-3  # height of the lens: 150 mm above the oil, as the paper has its camera above the tank
_INDEX = 1.40  # refractive index of silicone oil
_FOCAL = 740.0 / 640.0  # focal length over the width of the usual picture; assumed
_SHORTEST, _LONGEST = 24, 2.0  # shortest robot in pixels, longest in widths of the picture
_LOOKS = 1001  # times at which the visibility of the robot is checked


def lens_of(camera: CameraOptions, tilt: tuple[float, float]) -> VirtualLens:
    """The lens of a camera."""
    focal, distortion = _FOCAL * camera.size[0] / camera.shrunk, (camera.distortion, 0.0)
    return VirtualLens(_EYE, _SURFACE, _INDEX, focal, camera.size, camera.leftwards, tilt, distortion)


def check_size(robot: Robot, tank: Tank, lens: VirtualLens) -> None:
    """The robot is large enough for this camera, and its tube small enough for the tank."""
    if tank.tube is not None and tank.tube_height + tank.outside >= lens.surface:
        most = 1e3 * (lens.surface - 2.0 * (tank.outside - tank.tube))
        raise InputError(
            f"channel.diameter = {2e3 * tank.tube:.4g} mm; allowed: less than {most:.4g} mm, a tube under the oil"
        )
    ends, (rear, nose) = _visible(lens, tank.tube_height), _extent(robot)
    width, length = ends[1] - ends[0], nose - rear
    low, high = _SHORTEST / lens.size[0] * width, _LONGEST * width
    if not low <= length <= high:
        wide = f"which a picture {1e3 * width:.4g} mm wide can show, or another field_of_view"
        allowed = f"{1e3 * low:.3g} to {1e3 * high:.4g} mm, {wide}"
        raise InputError(f"{robot.name} is {1e3 * length:.4g} mm long; allowed: {allowed}")


def swimming_range(robot: Robot, camera: CameraOptions) -> tuple[float, float]:
    """Smallest and largest x of the body's mid-length at which the whole robot is in the picture, m."""
    ideal = replace(lens_of(camera, (0.0, 0.0)), distortion=(0.0, 0.0))
    low, high = _visible(ideal, tube_height(robot, camera.view))
    rear, nose = _extent(robot)
    return low - rear, high - nose


def framed(trajectory: TrialTrajectory, robot: Robot, lens: VirtualLens, start: float | None) -> TrialTrajectory:
    """The trajectory from a first x, or centred in the picture."""
    _check_space_around_axis(trajectory, robot, lens)
    x = trajectory.position[:, 0]
    low, high = _visible(lens, float(trajectory.position[:, 2].mean()))
    rear, nose = _extent(robot)
    centred = 0.5 * (low - rear - float(x.min()) + high - nose - float(x.max()))
    shift = centred if start is None else start - float(x[0])
    if x.max() + shift + nose < low or x.min() + shift + rear > high:
        first = 1e3 * (float(x[0]) + shift)
        raise InputError(f"start = {first:.4g} mm: the robot is never in the picture; allowed: nearer to 0")
    return trajectory.shifted(shift)


def out_of_picture(trajectory: TrialTrajectory, robot: Robot, lens: VirtualLens) -> tuple[Note, ...]:
    """A note if the robot is beyond the left or the right edge of the picture for a part of the film."""
    times = np.linspace(trajectory.time[0], trajectory.time[-1], _LOOKS)
    x = np.interp(times, trajectory.time, trajectory.position[:, 0])
    low, high = _visible(lens, float(trajectory.position[:, 2].mean()))
    rear, nose = _extent(robot)
    seen = float(np.mean((x + nose > low) & (x + rear < high)))
    if seen == 1.0:
        return ()
    length = trajectory.duration
    return (Note.named("robot-swims-out", seen=seen * length, length=length),)


def _check_space_around_axis(trajectory: TrialTrajectory, robot: Robot, lens: VirtualLens) -> None:
    """Check that the robot stays between floor and oil surface, and between the picture's upper and lower edge."""
    radius = 0.5 * robot.body.diameter
    _, y, z = trajectory.position.T
    nearer = "allowed: a lateral nearer to 0, or a run that stays nearer to the axis"
    inside = (z > 0.0) & (z < lens.surface)
    if not inside.any():
        where = "under the floor" if z[0] <= 0.0 else "above the oil"
        raise InputError(f"the robot is {where} in this view ({1e3 * float(z[0]):.4g} mm above the floor); {nearer}")
    middle = 0.5 * (lens.size[0] - 1)
    rows = np.array([[middle, 0.0], [middle, lens.size[1] - 1.0]])
    edges = lens.points(rows, float(z[inside].mean()))[:, 1]
    if not np.any(inside & (y > edges.min() - radius) & (y < edges.max() + radius)):
        raise InputError(f"the robot is never in the picture, {1e3 * float(y[0]):.4g} mm beside its centre; {nearer}")


def _visible(lens: VirtualLens, height: float) -> tuple[float, float]:
    """Smallest and largest x in the picture's middle row at a height, m."""
    middle = 0.5 * (lens.size[1] - 1)
    ends = lens.points(np.array([[0.0, middle], [lens.size[0] - 1.0, middle]]), height)[:, 0]
    return float(ends.min()), float(ends.max())


def _extent(robot: Robot) -> tuple[float, float]:
    """Smallest and largest x of a robot from its body's mid-length, m."""
    half = 0.5 * robot.body.length
    return -half - robot.coupling.length - robot.tail.length, half
