"""A robot's table: its resistance anywhere in its tube, at every phase of the tail, in microseconds.

The resistance is the film under the body (`film`) plus what is left without it (`rest`), interpolated over the places
of `places` and evaluated by `spirillum.kernels.tube_table`. It holds for viscosity 1 and any drive, weight, friction
and roughness; another tail, body or tube needs another table.
"""

from __future__ import annotations

import hashlib
import json
import time
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.errors import InputError
from spirillum.files import read_bytes, whole_file
from spirillum.fluid.tube.cache import sealed, unsealed
from spirillum.fluid.tube.domain import WIRE_FILM
from spirillum.fluid.tube.film import FilmTable
from spirillum.fluid.tube.on_axis import OnAxis
from spirillum.fluid.tube.places import Places
from spirillum.fluid.tube.rest import (
    Progress,
    Solution,
    even_phases,
    mirrored,
    rest_at,
    seen_in_mirror,
    solutions,
)
from spirillum.fluid.tube.solids import Fineness
from spirillum.fluid.wire.robot_geometry import RobotGeometry
from spirillum.kernels import tube_table as kernel
from spirillum.kernels.film_table import film_at
from spirillum.robot.seat import Seat

__all__ = ["TubeTable", "response_of"]

_FORMAT = "spirillum.tube-table/1"
_LARGEST_FILE, _LARGEST_TABLE = 2**21, 2**23  # bytes, compressed and not
_TOLERANCE, _LEVEL_TOLERANCE = 0.01, 0.002
"""How finely the flow is resolved at the places of a table; finer where that costs little, without pitch and yaw."""
_HELD_OUT = 6
_SEED = 20121


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
    """Largest relative error at places that were not used: `forward_velocity`, `body_rotation_rate`, ..."""
    places: int
    """Number of places that were solved."""
    seconds: float
    """Time that it took."""

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

    def write(self, path: Path) -> None:
        """Write it, whole or not at all: a digest, then its head and its numbers, compressed."""
        head = {
            "format": _FORMAT,
            "geometry": self.geometry._asdict(),
            "radius": self.radius,
            "error": dict(self.error),
            "places": self.places,
            "seconds": self.seconds,
        }
        start = kernel.film_start(self.packed)
        numbers = self.packed[:start].astype("<f4").tobytes() + self.packed[start:].astype("<f8").tobytes()
        content = zlib.compress(json.dumps(head | {"rest": start}).encode() + b"\n" + numbers, 9)
        with whole_file(path, replace="any") as temporary:
            temporary.write_bytes(sealed(content))

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

    @classmethod
    def of(
        cls, geometry: RobotGeometry, radius: float, *, workers: int = 2, progress: Progress | None = None
    ) -> TubeTable:
        """Solve for the flow at every place and make the table.

        Args:
            geometry: of the robot.
            radius: R of the tube, m.
            workers: number of processes.
            progress: told what is being solved, how much is done, and of how much.

        Raises:
            InputError: for a robot without a table, such as one whose tail is wider than its body.
        """
        start = time.perf_counter()
        places = Places(geometry, radius)
        steepest = 1.1 * float(places.most.max())
        film = FilmTable.of(geometry.body, radius, yaw=places.largest_yaw, pitch=steepest).packed
        level, yawed = _level(places), _yawed(places)
        own = geometry, even_phases()
        todo = [Solution((own,), place.seat, _fineness(place.seat)) for place in level]
        todo += [Solution((own, mirrored(*own)), place.seat, _fineness(place.seat)) for place in yawed]
        found = solutions(todo, "table of the tube", progress, workers)
        table = _assembled(places, film, [place[0] for place in found[: len(level)]], found[len(level) :])
        errors = _held_out(places, table, progress, workers)
        return cls(geometry, radius, table, errors, len(todo), time.perf_counter() - start)


def _read(path: Path) -> TubeTable | None:
    """The table in a file; None for any other file."""
    try:
        content = unsealed(read_bytes(path, "a table", _LARGEST_FILE))
        if content is None:
            return None
        words, _, numbers = zlib.decompressobj().decompress(content, _LARGEST_TABLE).partition(b"\n")
        head = json.loads(words)
        if head.pop("format") != _FORMAT:
            return None
        start = 4 * int(head.pop("rest"))
        rest, film = np.frombuffer(numbers[:start], "<f4"), np.frombuffer(numbers[start:], "<f8")
        packed = np.concatenate([rest.astype(np.float64), film.astype(np.float64)])
        geometry = RobotGeometry(**head.pop("geometry"))
        return TubeTable(geometry=geometry, packed=packed, **head)
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError, zlib.error):
        return None


def key_of(geometry: RobotGeometry, radius: float) -> str:
    """A digest of robot and tube, numbers to ten digits."""
    words = [*(f"{value:.10g}" if isinstance(value, float) else str(value) for value in geometry), f"{radius:.10g}"]
    return hashlib.sha256(" ".join(words).encode()).hexdigest()[:24]


class _Place(NamedTuple):
    """A node."""

    t: float
    f: float
    seat: Seat


def _fineness(seat: Seat) -> Fineness:
    level = seat.pitch == 0 and seat.yaw == 0
    return Fineness("standard", _LEVEL_TOLERANCE if level else _TOLERANCE)


def _level(places: Places) -> list[_Place]:
    """Nodes without yaw that are solved for: for each t those nose up, then, off the axis, those nose down."""
    return [
        _Place(float(t), float(f), places.seat(float(t), float(f)))
        for t in places.gaps
        for f in (*places.up, *(-places.down[1:] if t < 1.0 else ()))
    ]


def _yawed(places: Places) -> list[_Place]:
    """Nodes with yaw that are solved for: those off the axis."""
    return [
        _Place(float(t), float(f), places.seat(float(t), float(f), places.yaw))
        for t in places.yaw_gaps
        if t < 1.0
        for f in places.yaw_pitches
    ]


def _film_of(film: Samples, seat: Seat) -> Samples:
    out = np.empty((6, 6))
    film_at(film, seat.offset, seat.pitch, seat.yaw, out)
    return out


def _assembled(places: Places, film: Samples, level: Sequence[Samples], yawed: Sequence[Sequence[Samples]]) -> Samples:
    """The packed table from the 8x8 at its nodes, and at those with yaw of the robot and of its mirror image."""
    rest = [rest_at(m, _film_of(film, n.seat), n.t, n.seat) for n, m in zip(_level(places), level, strict=True)]
    most = places.most[-1]
    on_axis = OnAxis.of(places.up * most[0], np.stack(rest[-len(places.up) :]))
    rest += [on_axis.coefficients(float(-f * most[1])) for f in places.down[1:]]
    shape = len(places.gaps), len(places.up) + len(places.down) - 1, *rest[0].shape
    parts = (places.gaps, places.up, places.down, places.most, np.reshape(rest, shape))
    none = np.zeros(0)
    straight = kernel.packed(places.radius, places.yaw, places.rings, *parts, none, none, none, film)
    sides = [_both_sides(film, place, *answers) for place, answers in zip(_yawed(places), yawed, strict=True)]
    for f in places.yaw_pitches:
        pitch = float(f * (most[0] if f >= 0 else most[1]))
        sides.append((on_axis.coefficients(pitch, places.yaw), on_axis.coefficients(pitch, -places.yaw)))
    turned = []
    for seat, (left, right) in zip(_yawed_seats(places), sides, strict=True):
        middle = _interpolated(straight, seat, len(left))
        turned.append([(left - right) / (2.0 * places.yaw), (0.5 * (left + right) - middle) / places.yaw**2])
    return kernel.packed(
        places.radius, places.yaw, places.rings, *parts, places.yaw_gaps, places.yaw_pitches, np.array(turned), film
    )


def _both_sides(film: Samples, place: _Place, own: Samples, image: Samples) -> tuple[Samples, Samples]:
    """Fourier coefficients of the rest's factor with the nose to the left and to the right."""
    back = replace(place.seat, yaw=-place.seat.yaw)
    left = rest_at(own, _film_of(film, place.seat), place.t, place.seat)
    return left, rest_at(seen_in_mirror(image), _film_of(film, back), place.t, back)


def _yawed_seats(places: Places) -> list[Seat]:
    """Seats of all nodes with yaw, without it."""
    return [places.seat(float(t), float(f)) for t in places.yaw_gaps for f in places.yaw_pitches]


def _interpolated(straight: Samples, seat: Seat, count: int) -> Samples:
    """Fourier coefficients of the factor of the rest, as the table without yaw has them at a seat."""
    out = np.empty((count, kernel.PARAMETERS))
    kernel.rest_coefficients(straight, seat.offset, seat.pitch, out)
    return out


RESPONSES = {
    "forward_velocity": 0.01,
    "body_rotation_rate": 0.01,
    "sideways_force": 0.02,
    "pitching_torque": 0.03,
    "yawing_torque": 0.03,
    "normal_resistance": 0.05,
}
"""What a table is judged by, and the largest relative error that it should have."""


def response_of(matrix: Samples) -> Samples:
    """What a place does to a robot whose tail turns at 1 rad/s, held sideways and in tilt, closed ends, viscosity 1.

    Args:
        matrix: the 8x8.

    Returns:
        Forward velocity, body rate, forces y and z, torques y and z of the fluid, and the normal resistance, (7,).
    """
    free = [0, 3]
    tail = matrix[:, 6]  # the rotor's lab rate is Omega + omega_m = 1
    a = matrix[np.ix_(free, free)] - np.outer(tail[free], [0.0, 1.0])
    speed, roll = np.linalg.solve(a, -tail[free])
    rates = np.zeros(len(matrix))
    rates[[0, 3, 6]] = speed, roll, 1.0 - roll
    force = -matrix @ rates
    return np.array([speed, roll, force[1], force[2], force[4], force[5], matrix[2, 2]])


def _held_out(places: Places, table: Samples, progress: Progress | None, workers: int) -> dict[str, float]:
    """Largest relative error of `RESPONSES` at places that were not used, of a robot at random phases."""
    draw = np.random.default_rng(_SEED)
    chosen: list[tuple[Seat, float]] = []
    while len(chosen) < _HELD_OUT:
        t = float(np.exp(draw.uniform(np.log(0.5 * places.gaps[0]), np.log(0.5))))
        f, yaw = float(draw.uniform(-0.5, 1.0)), float(draw.uniform(-1.0, 1.0)) * places.yaw
        seat = places.seat_between(t, f, yaw)
        wire = places.geometry.wire()
        clear = seat.tail_clearance(wire.points, wire.radius).clearance > WIRE_FILM * wire.radius
        if clear and seat.clearance(places.geometry.body) > 0.4 * places.thinnest:
            chosen.append((seat, float(draw.uniform(0.0, 2.0 * np.pi))))
    todo = [Solution(((places.geometry, (phase,)),), seat, _fineness(seat)) for seat, phase in chosen]
    found = solutions(todo, "checking the table", progress, workers)
    errors = []
    for (seat, phase), answer in zip(chosen, found, strict=True):
        out = np.empty((kernel.MOTIONS, kernel.MOTIONS))
        kernel.resistance_at(table, seat.offset, seat.pitch, seat.yaw, phase, out)
        errors.append(response_errors(out, answer[0][0]))
    return dict(zip(RESPONSES, np.max(errors, axis=0).tolist(), strict=True))


def response_errors(matrix: Samples, true: Samples) -> Samples:
    """Relative errors of `RESPONSES`, sideways force and torques over the size of what acts on the robot in all.

    Args:
        matrix: the 8x8 judged.
        true: what it should be.
    """
    a, b = response_of(matrix), response_of(true)
    force, torque = np.hypot(b[2], b[3]), np.hypot(b[4], b[5])
    scale = np.array([abs(b[0]), abs(b[1]), force, torque, torque, b[6]])
    found: Samples = np.abs(a - b)[[0, 1, 2, 4, 5, 6]] / scale
    return found
