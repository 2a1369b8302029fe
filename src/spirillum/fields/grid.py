"""Grids around a robot, and the flow on them as labelled data."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from spirillum.arrays import Samples
from spirillum.errors import InputError, check_choice, check_range
from spirillum.progress import Progress, tell
from spirillum.robot.robot import Robot
from spirillum.robot.tube_pose import TubePose
from spirillum.units import KINDS, Kind, parse_option, show

if TYPE_CHECKING:
    import xarray as xr

PLANES = {"xz": "y", "xy": "z", "yz": "x"}  #: Planes by the names of their axes, and the axis across each.
PLANE_RESOLUTION, VOLUME_RESOLUTION = 240, 80  #: Points along the longest side of a plane and of a box.
_OFFSET = Kind("length", "m", "5 mm", "-100 m", "100 m")
_AXES = "xyz"
_MOST_POINTS = 2_000_000
_LARGEST_RESOLUTION = 10_000
_BLOCK = 2048
_MARGIN = 1.2  # of the robot's largest diameter
_GLASS = 0.05  # what is shown of the glass, over the tube's radius
_WIDEST = 1.5  # a tube that is shown whole, over the box around the robot


@dataclass(frozen=True)
class PointGrid:
    """Evenly spaced points along x, y, z, m; an axis with one point is the position of a plane."""

    axes: tuple[Samples, Samples, Samples]  #: Coordinates along x, y, z.

    @property
    def shape(self) -> tuple[int, int, int]:
        """Points along x, y, z."""
        x, y, z = (axis.size for axis in self.axes)
        return x, y, z

    @property
    def size(self) -> int:
        """Number of points."""
        return int(np.prod(self.shape))

    def points(self, start: int, stop: int) -> Samples:
        """Points number `start` to `stop`, z fastest, (n, 3)."""
        indices = np.unravel_index(np.arange(start, stop), self.shape)
        return np.stack([axis[index] for axis, index in zip(self.axes, indices, strict=True)], axis=-1)


def plane_around(
    robot: Robot,
    plane: str = "xz",
    offset: str | float = 0.0,
    extent: str | float | None = None,
    resolution: int = PLANE_RESOLUTION,
    seat: TubePose | None = None,
) -> PointGrid:
    """The grid of `Flow.plane`; `seat` is the robot's pose in its tube, None in unbounded fluid."""
    plane = "".join(sorted(str(plane)))
    check_choice("plane", plane, PLANES)
    at = parse_option("offset", offset, _OFFSET)
    box, across = _box(robot, extent, seat), PLANES[plane]
    if seat is not None and across != "x":
        low, high = _glass(box["x"], seat, seat.radius)[across]
        if not low < at < high:
            raise InputError(
                f"offset = {show(at, 'mm')} with plane = '{plane}': the plane is outside the tube; allowed: "
                f"between {show(low, 'mm')} and {show(high, 'mm')}"
            )
    sides = {axis: side for axis, side in box.items() if axis in plane}
    return _grid(sides, {across: np.array([at])}, resolution, "resolution")


def box_around(
    robot: Robot, extent: str | float | None = None, resolution: int = VOLUME_RESOLUTION, seat: TubePose | None = None
) -> PointGrid:
    """The grid of `Flow.volume`; `seat` as for `plane_around`."""
    return _grid(_box(robot, extent, seat), {}, resolution, "volume resolution")


def _box(robot: Robot, extent: str | float | None, seat: TubePose | None) -> dict[str, tuple[float, float]]:
    """Both ends of the box along each axis, cut off a little outside of a tube's wall, m."""
    margin = None if extent is None else parse_option("extent", extent, KINDS["length or zero"])
    wire = 0.5 * robot.tail.wire_diameter
    coupling = 0.5 * robot.coupling.diameter if robot.coupling.length > 0 else 0.0
    radius = max(0.5 * robot.body.diameter, coupling, robot.tail.amplitude + wire)
    beyond = _MARGIN * 2.0 * radius if margin is None else margin
    nose = 0.5 * robot.body.length
    across = (-radius - beyond, radius + beyond)
    box = {
        "x": (-nose - robot.coupling.length - robot.tail.length - wire - beyond, nose + beyond),
        "y": across,
        "z": across,
    }
    if seat is None:
        return box
    reach = (1.0 + _GLASS) * seat.radius
    glass = _glass(box["x"], seat, reach)
    if margin is None and reach < _WIDEST * box["y"][1]:
        return {**box, **glass}
    return {**box, **{axis: (max(box[axis][0], low), min(box[axis][1], high)) for axis, (low, high) in glass.items()}}


def _glass(ends: tuple[float, float], seat: TubePose, reach: float) -> dict[str, tuple[float, float]]:
    """Least and largest y and z in body axes of points at most `reach` from a tube's axis, between two ends along x."""
    start, forward = seat.offset * seat.across[0], seat.forward  # the tube's axis in body axes
    glass = {}
    for axis, index in (("y", 1), ("z", 2)):
        middles = [start[index] + (x - start[0]) * forward[index] / forward[0] for x in ends]
        half = reach / np.sqrt(1.0 - forward[index] ** 2)
        glass[axis] = (min(middles) - half, max(middles) + half)
    return glass


def _grid(box: dict[str, tuple[float, float]], fixed: dict[str, Samples], resolution: int, name: str) -> PointGrid:
    check_range(name, resolution, 2, _LARGEST_RESOLUTION, " points along the grid's longest side")
    spacing, counts, size = _sizes(box, resolution)
    if size > _MOST_POINTS:
        most = resolution
        while _sizes(box, most)[2] > _MOST_POINTS:
            most -= 1
        raise InputError(
            f"{name} = {resolution} makes {size} points; allowed: at most {_MOST_POINTS} points, here a {name} of "
            f"{most}"
        )
    # One spacing for all axes: no direction is resolved better than another.
    steps = {axis: spacing * (np.arange(count, dtype=np.float64) - 0.5 * (count - 1)) for axis, count in counts.items()}
    even = {axis: 0.5 * (low + high) + steps[axis] for axis, (low, high) in box.items()}
    x, y, z = ({**even, **fixed}[axis] for axis in _AXES)
    return PointGrid((x, y, z))


def _sizes(box: dict[str, tuple[float, float]], resolution: int) -> tuple[float, dict[str, int], int]:
    """Spacing (m), points along each axis, and points in all."""
    spacing = max(high - low for low, high in box.values()) / (resolution - 1)
    counts = {axis: max(round((high - low) / spacing), 1) + 1 for axis, (low, high) in box.items()}
    return spacing, counts, math.prod(counts.values())


def dataset_on(
    grid: PointGrid,
    inside: Callable[[Samples], np.ndarray],
    fields: Callable[[Samples], tuple[Samples, Samples]],
    frame: str,
    progress: Progress | None,
    seat: TubePose | None = None,
) -> xr.Dataset:
    """The flow on a grid, NaN inside solids; an axis with one point becomes a scalar."""
    import xarray as xr

    values = np.full((grid.size, 4), np.nan)
    solid = np.zeros(grid.size, dtype=bool)
    for start in range(0, grid.size, _BLOCK):
        tell(progress, "flow: points", start, grid.size)
        block = slice(start, min(start + _BLOCK, grid.size))
        points = grid.points(block.start, block.stop)
        solid[block] = inside(points)
        free = ~solid[block]
        if free.any():
            velocity, pressure = fields(points[free])
            values[block][free] = np.column_stack([velocity, pressure])
    tell(progress, "flow: points", grid.size, grid.size)
    dims = tuple(axis for axis, count in zip(_AXES, grid.shape, strict=True) if count > 1)
    shape = tuple(count for count in grid.shape if count > 1)
    columns = {
        **{f"velocity_{axis}": ("m/s", f"fluid velocity along {axis}, frame: {frame}") for axis in _AXES},
        "pressure": ("Pa", f"fluid pressure, {'zero far away' if seat is None else 'above the mean of both ends'}"),
    }
    data: dict[str, Any] = {
        name: (dims, values[:, column].reshape(shape), {"units": unit, "long_name": meaning})
        for column, (name, (unit, meaning)) in enumerate(columns.items())
    }
    solids = "body, coupling or tail" if seat is None else "body, coupling or tail, or outside the tube"
    meaning = f"whether the point is inside {solids}"
    data["inside"] = (dims, solid.reshape(shape), {"units": "1", "long_name": meaning})
    return xr.Dataset(data, coords=dict(_coordinates(grid)))


def _coordinates(grid: PointGrid) -> Iterator[tuple[str, Any]]:
    along = {"x": "forward, from the body's mid-length", "y": "to the left", "z": "up"}
    for axis, coordinates in zip(_AXES, grid.axes, strict=True):
        attributes = {"units": "m", "long_name": f"{axis}, {along[axis]}"}
        yield axis, (axis, coordinates, attributes) if coordinates.size > 1 else ((), float(coordinates[0]), attributes)
