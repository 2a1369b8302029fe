"""Interpolation nodes of a table: poses of a robot in its tube.

The coordinates are those of `spirillum.kernels.tube_table`: t runs from the floor (0) to the tube's axis (1), f from
level (0) to the largest pitch (1), at which the clearance of tail or coupling is the smallest that the model resolves.
The yaw is normalized by the largest yaw at the node, which has the same clearance of the tail.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from spirillum.arrays import Samples
from spirillum.errors import InputError
from spirillum.fluid.tube.domain import WIRE_FILM
from spirillum.fluid.tube.film_surface import FilmBody
from spirillum.fluid.tube.progress_messages import time_on_free_cores
from spirillum.fluid.tube.solids import Fineness
from spirillum.fluid.tube.stages import FINE, Stage
from spirillum.fluid.tube.tube import finest_wire
from spirillum.fluid.wire.robot_geometry import RobotGeometry
from spirillum.kernels.core import contact_offset, limited_yaw
from spirillum.kernels.tube_table import STEEPEST, YAW_SHARES, yaw_limit_of
from spirillum.robot.outline import Arc, Outline, Segment, Smooth
from spirillum.robot.tube_pose import TubePose, last_clear
from spirillum.units import show

_THINNEST_REST = 0.08  # Gap of the first nodes over the body's radius: the outer resistance is smooth below it.
CHECKED_FROM = 0.4  #: Least gap of a table's check poses over that of the first nodes.
_SWEPT = 121  # Points along the tail at which its clearance from the wall is computed.
_TAIL_FILM = 1.2  # Clearance of the tail at the first nodes over the least that the model resolves.
LARGEST_YAW = float(np.radians(11.0))
"""Largest yaw of a table, rad: at most nodes the wall limits the tail to a smaller one."""
_YAW_PITCHES = (-0.9, -0.5, 0.0, 0.5, 0.9)
_LEAST_PITCH = np.radians(0.2)
_SEARCH_YAW = (float(np.radians(44.0)), 45, 1e-6)
"""Largest yaw that is tried, steps, and accuracy of the search for the tail's contact, rad."""
_SEARCH = (31, 1e-6)  # Steps of the search for contact, and its accuracy, rad.


def rings_of(outline: Outline) -> Samples:
    """Rings whose hull a body of revolution is, for `contact_offset`: (x, rho, semi-axis along, across), m."""
    rows: list[tuple[float, float, float, float]] = []
    if any(isinstance(piece, Smooth) for piece in outline.pieces):
        found = FilmBody.of(outline).rings  # Of a profile those that can near the wall, as of its film.
        return np.array([(x, 0.0, half, ring) if half else (x, ring, ball, ball) for x, ring, half, ball in found])
    for piece in outline.pieces:
        if isinstance(piece, Arc):
            rows.append((*piece.centre, abs(piece.semi_axes[0]), abs(piece.semi_axes[1])))
        elif isinstance(piece, Segment):
            rows += [(*piece.start, 0.0, 0.0), (*piece.end, 0.0, 0.0)]
    kept = [row for row in dict.fromkeys(rows) if row[1] > 0 or row[2] > 0]
    return np.array(kept, dtype=float)


@dataclass(frozen=True)
class Places:
    """Nodes of one robot's table in one tube; m and rad."""

    geometry: RobotGeometry
    radius: float
    stage: Stage = FINE

    @cached_property
    def rings(self) -> Samples:
        """See `rings_of`."""
        if self.geometry.shape == "none":
            said = "a bare tail (body = 'none') has no table in its tube, and no free motion there"
            raise InputError(f"{said}; allowed: `predict` at a pose (motion 'held'), or channel = 'none'")
        if self.geometry.shape == "profile":
            FilmBody.of(self.geometry.body)  # refuses one whose film is not known
        return rings_of(self.geometry.body)

    @cached_property
    def swept(self) -> Samples:
        """Points of the wire's centreline, at angle 0 about the axis: what it sweeps does not know its wavelength."""
        return self.geometry.swept(_SWEPT)

    def tail_clearance(self, pose: TubePose) -> float:
        """Smallest distance between the wire's surface and the glass over a turn of the tail, m."""
        return pose.tail_clearance(self.swept, 0.5 * self.geometry.wire_diameter).clearance

    @property
    def least_clearance(self) -> float:
        """Of the tail's wire that the model resolves, m."""
        return WIRE_FILM * 0.5 * self.geometry.wire_diameter

    @cached_property
    def gaps(self) -> Samples:
        """Nodes t, increasing."""
        thin = self.thinnest / contact_offset(self.rings, self.radius, 0.0)
        if thin > self.stage.upper[0]:
            raise InputError(
                f"tail.amplitude = {show(self.geometry.amplitude, 'mm')}: the tail keeps the body far from the wall "
                f"of a tube with channel.diameter = {show(2.0 * self.radius, 'mm')}; allowed: a smaller amplitude, or "
                "single poses without a table"
            )
        ratio = self.stage.upper[0] / thin
        count = max(round(np.log(ratio) / np.log(self.stage.growth)), 2 if ratio > 2.0 else 1)
        return np.array([*thin * ratio ** (np.arange(count) / count), *self.stage.upper])

    @property
    def up(self) -> Samples:
        """Nodes f nose up."""
        return np.array(self.stage.up)

    @property
    def down(self) -> Samples:
        """Nodes f nose down."""
        return np.array(self.stage.down)

    @property
    def solutions(self) -> int:
        """Number of poses that are solved for: nodes, those on the axis without the lowered ones, and check poses."""
        count = (len(self.gaps) - 1) * (len(self.up) + len(self.down) - 1) + len(self.up) + self.stage.held_out
        if self.stage.yawed:
            count += (len(self.yaw_gaps) - 1) * len(self.yaw_pitches) * len(YAW_SHARES) + self.stage.held_out
        return count

    def time_to_solve(self) -> str:
        """How long a fast and a slow machine need for them with two processes, in words."""
        fast, slow = self.stage.seconds
        return time_on_free_cores((self.solutions * fast, self.solutions * slow), workers=2)

    @cached_property
    def yaw_gaps(self) -> Samples:
        """Coordinates t of the nodes with yaw."""
        last = len(self.gaps) - 1
        return self.gaps[sorted({0, (last - 1) // 2, last - 1, last})]

    @property
    def yaw_pitches(self) -> Samples:
        """Coordinates of signed f of the nodes with yaw."""
        return np.array(_YAW_PITCHES)

    @cached_property
    def yaw_poses(self) -> list[TubePose]:
        """Poses of all nodes with yaw, with their yaw set to zero."""
        return [self.pose(float(t), float(f)) for t in self.yaw_gaps for f in self.yaw_pitches]

    @cached_property
    def yaw_limit(self) -> Samples:
        """Numbers of `limited_yaw`: the tail is then off the glass as elsewhere."""
        x, pitches = np.array([(pose.offset / self.radius, pose.pitch) for pose in self.yaw_poses]).T
        return yaw_limit_of(x, pitches, np.array([self._widest(pose) for pose in self.yaw_poses]), LARGEST_YAW)

    def fineness(self, t: float, pose: TubePose, *, check: bool = False, stage: Stage | None = None) -> Fineness:
        """Resolution of the flow at a node, or at a check pose, of this stage or of another one."""
        gap = t * contact_offset(self.rings, self.radius, 0.0)
        found = (stage or self.stage).fineness(gap, 0.5 * self.geometry.body_diameter, pose, check=check)
        return replace(found, wire=finest_wire(self.geometry))

    @cached_property
    def most_yaw(self) -> Samples:
        """Largest yaw at the nodes with yaw, (yaw gaps, yaw pitches), rad."""
        return np.array([[self.largest_yaw(float(t), float(f)) for f in self.yaw_pitches] for t in self.yaw_gaps])

    def largest_yaw(self, t: float, f: float) -> float:
        """Largest yaw at a node, rad."""
        pose = self.pose_between(t, f)
        return limited_yaw(self.yaw_limit, pose.offset / self.radius, pose.pitch)

    @cached_property
    def most(self) -> Samples:
        """Largest pitch nose up and nose down at each node t, (gaps, 2), rad."""
        return np.array([[self._steepest(float(t), sign) for sign in (1.0, -1.0)] for t in self.gaps])

    def pose(self, t: float, f: float, yaw: float = 0.0) -> TubePose:
        """Pose at a node; negative f is nose down."""
        row = int(np.argmin(np.abs(self.gaps - t)))
        pitch = f * (self.most[row, 0] if f >= 0 else self.most[row, 1])
        return self._pose(t, pitch, yaw)

    def pose_between(self, t: float, f: float, yaw: float = 0.0) -> TubePose:
        """Pose at any t; its largest pitch is that of the next node below."""
        row = max(int(np.searchsorted(self.gaps, t, side="right")) - 1, 0)
        pitch = f * (self.most[row, 0] if f >= 0 else self.most[row, 1])
        return self._pose(t, pitch, yaw)

    @cached_property
    def thinnest(self) -> float:
        """Gap of the first node of a level robot, m: body and tail have the smallest resolved clearance."""
        body = 0.5 * self.geometry.body_diameter
        tail = float(np.max(self.swept[:, 1])) + 0.5 * self.geometry.wire_diameter
        return max(_THINNEST_REST * body, tail - body + _TAIL_FILM * self.least_clearance)

    def _pose(self, t: float, pitch: float, yaw: float = 0.0) -> TubePose:
        return TubePose(self.radius, (1.0 - t) * contact_offset(self.rings, self.radius, pitch), pitch, yaw=yaw)

    def _steepest(self, t: float, sign: float) -> float:
        """Largest pitch in one sense at a node t."""
        outlines, film = self.geometry.outlines, self.least_clearance

        def spare(size: float) -> float:
            pose = self._pose(t, sign * size)
            if pose.offset < 0:
                return -self.radius
            floor = t / (1.0 - t) * pose.offset if t < 1 else contact_offset(self.rings, self.radius, sign * size)
            found = self.tail_clearance(pose) - film
            found = min(found, pose.clearance(outlines["body"]) - 0.5 * floor)
            if "coupling" in outlines:
                found = min(found, pose.clearance(outlines["coupling"]) - 0.5 * min(floor, film))
            return found

        return max(float(_LEAST_PITCH), last_clear(spare, STEEPEST[0 if sign > 0 else 1], *_SEARCH))

    def _widest(self, pose: TubePose) -> float:
        """Largest yaw of a pose, also beyond the largest of a table."""

        def spare(yaw: float) -> float:
            return self.tail_clearance(replace(pose, yaw=yaw)) - self.least_clearance

        return max(float(_LEAST_PITCH), last_clear(spare, *_SEARCH_YAW))
