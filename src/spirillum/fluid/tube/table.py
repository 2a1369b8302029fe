"""A robot's table: its resistance anywhere in its tube, at every phase of the tail, in microseconds.

The resistance is the film under the body (`film`) plus what is left without it (`rest`), interpolated over the places
of `places` and evaluated by `spirillum.kernels.tube_table`. It holds for viscosity 1 and any drive, weight, friction
and roughness; another tail, body or tube needs another table.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from spirillum.arrays import Samples
from spirillum.errors import InputError
from spirillum.files import read_bytes, whole_file
from spirillum.fluid.tube.places import CHECKED_FROM
from spirillum.fluid.tube.responses import RESPONSES
from spirillum.fluid.tube.table_file import packed_from, to_bytes
from spirillum.fluid.tube.wire_error import SOLIDS_ERROR, at_any_place, wire_error
from spirillum.fluid.wire.robot_geometry import RobotGeometry
from spirillum.fluid.wire.slender import FINEST_WIRE_ERROR
from spirillum.kernels import tube_table as kernel

__all__ = ["TubeTable", "key_of", "least_checked_gap"]

_FORMAT = "spirillum.tube-table/6"
_LARGEST_FILE = 2**21  # bytes


@dataclass(frozen=True)
class TubeTable:
    """Table of one robot in one tube."""

    geometry: RobotGeometry
    """Everything of the robot that decides the table."""
    radius: float
    """R of the tube, m."""
    packed: Samples = field(repr=False)
    """For `spirillum.kernels.tube_table.resistance_at`."""
    error: Mapping[str, float]
    """Largest relative error at places that were not used, all yawed: `forward_velocity`, `body_rotation_rate`, ..."""
    error_without_yaw: Mapping[str, float]
    """Largest relative error at other such places, none of them yawed."""
    places: int
    """Number of places that were solved."""
    seconds: float
    """Time that it took."""
    wire: float | None = None
    """Relative error of the forward velocity by the form of the wire, compared when it was made; None: not compared."""

    @property
    def key(self) -> str:
        """What names the table: a digest of robot and tube."""
        return key_of(self.geometry, self.radius)

    def at(self, offset: float, pitch: float = 0.0, yaw: float = 0.0, phase: float = 0.0) -> tuple[Samples, int]:
        """The 8x8 at a place, viscosity 1, and how the table's range was left, see `resistance_at`.

        Args:
            offset: e of the body's mid-length from the tube's axis, m.
            pitch: nose up, rad.
            yaw: nose to the side, rad.
            phase: of the tail, rad.
        """
        out = np.empty((kernel.MOTIONS, kernel.MOTIONS))
        left = kernel.resistance_at(self.packed, offset, pitch, yaw, phase, out)
        return out, int(left)

    def error_at(self, yaw: float) -> Mapping[str, float]:
        """Largest relative errors at places with or without a yaw.

        Args:
            yaw: nose to the side, rad.
        """
        return self.error if yaw else self.error_without_yaw

    def speed_error_at(self, yaw: float) -> float:
        """Relative error of the forward velocity: of the interpolation, the wire and the solids together.

        Args:
            yaw: nose to the side, rad.
        """
        known = wire_error(self.geometry, self.radius) if self.wire is None else at_any_place(self.wire)
        return float(self.error_at(yaw)["forward_velocity"]) + known + FINEST_WIRE_ERROR + SOLIDS_ERROR

    def mirrored(self) -> TubeTable:
        """The table of the robot's mirror image, whose tail has the other hand."""
        geometry = self.geometry._replace(hand=-self.geometry.hand)
        return replace(self, geometry=geometry, packed=kernel.mirror_image(self.packed))

    def write(self, path: Path) -> None:
        """Write it, whole or not at all, its numbers rounded to some 1e-5; see `table_file`."""
        head = {
            "format": _FORMAT,
            "geometry": self.geometry._asdict(),
            "radius": self.radius,
            "error": dict(self.error),
            "error_without_yaw": dict(self.error_without_yaw),
            "places": self.places,
            "seconds": self.seconds,
            "wire": self.wire,
        }
        with whole_file(path, replace="any") as temporary:
            temporary.write_bytes(to_bytes(json.dumps(head).encode(), self.packed))

    @classmethod
    def read(cls, path: Path) -> TubeTable:
        """Read a table.

        Raises:
            InputError: if the file is none.
        """
        found = _read(path)
        if found is None:
            raise InputError(f"{path} is no table of this version of spirillum; allowed: one of `spirillum prepare`")
        return found


def _read(path: Path) -> TubeTable | None:
    """The table in a file; None for any other file."""
    try:
        words, packed = packed_from(read_bytes(path, "a table", _LARGEST_FILE))
        head = json.loads(words)
        if head.pop("format") != _FORMAT:
            return None
        geometry = RobotGeometry(**head.pop("geometry"))
        return _checked(TubeTable(geometry=geometry, packed=packed, **head))
    except (OSError, ValueError, KeyError, TypeError, AttributeError, IndexError, OverflowError, RecursionError):
        return None


def _checked(table: TubeTable) -> TubeTable:
    """A table that is whole, with errors that are numbers.

    Raises:
        ValueError: if it is not.
    """
    stated = [mapping[name] for mapping in (table.error, table.error_without_yaw) for name in RESPONSES]
    numbers = (0.0 if table.wire is None else table.wire, table.radius, table.seconds, table.places, *stated)
    if not all(math.isfinite(number) and number >= 0.0 for number in numbers) or table.radius <= 0.0:
        raise ValueError("not the numbers of a table")
    if not kernel.is_whole(table.packed, table.radius):
        raise ValueError("not the nodes of a table")
    return table


def key_of(geometry: RobotGeometry, radius: float) -> str:
    """A digest of robot and tube, numbers to ten digits."""
    words = [*(f"{value:.10g}" if isinstance(value, float) else str(value) for value in geometry), f"{radius:.10g}"]
    return hashlib.sha256(" ".join(words).encode()).hexdigest()[:24]


def least_checked_gap(packed: Samples) -> float:
    """Smallest gap of the places against which a packed table was checked, m."""
    return CHECKED_FROM * float(kernel.range_of(packed).gaps[0])
