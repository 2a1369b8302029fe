"""A robot's table: its resistance anywhere in its tube, at every phase of the tail, in microseconds.

The resistance is the film under the body (`film`) plus what is left without it (`rest`), interpolated over the places
of `places` and evaluated by `spirillum.kernels.tube_table`. It holds for viscosity 1 and any drive, weight, friction
and roughness; another tail, body or tube needs another table.

A packed table as bytes: whole multiples of small steps, their changes from node to node, compressed.
A logarithm on the diagonal of the rest's factor is kept to `_REST`, the entries of a row to that share of its diagonal.
The film's logarithms need less, and its triangular factors more, for a thin film's entries differ by orders. A
resistance is then off by less than 1e-4 of the roots of its diagonal: a hundredth of what interpolation costs.
"""

from __future__ import annotations

import hashlib
import json
import lzma
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from spirillum.arrays import Samples
from spirillum.errors import InputError
from spirillum.files import atomic_write, read_bytes
from spirillum.fluid.tube.cache import sealed, unsealed
from spirillum.fluid.tube.nodes import CHECKED_FROM
from spirillum.fluid.tube.stages import LARGEST_WIRE_ERROR, RESPONSES, SOLIDS_ERROR, STAGES, StageName
from spirillum.fluid.wire.robot_geometry import RobotGeometry
from spirillum.fluid.wire.slender import FINEST_WIRE_ERROR
from spirillum.kernels import core, tube_table
from spirillum.robot.tail_form import PLAIN

_REST = 3e-6
_FILM = np.where(np.arange(core.FILM_ENTRIES) < len(tube_table.ORDER), 2e-5, 1e-6)  # Quantum of the stored numbers.
_MOST_STEPS = 2.0**31 - 1.0
"""Bound of film coefficients: larger ones belong to angles at which no robot fits into its tube."""
_FILTER = {"id": lzma.FILTER_LZMA2, "preset": 6, "pb": 0, "lc": 4}
"""Single bytes, regrouped by their position in a word: those of a plane follow each other."""
BELOW = "a film with an extrapolated rest (level robots of the paper: 2.1 % off direct solutions down to 0.05 mm)"
"""What a table is at gaps below those of its check poses, in words."""
_LARGEST, _MOST_MEMORY = 2**23, 2**26  # bytes: not compressed, and to get there


def to_bytes(head: bytes, table: Samples) -> bytes:
    """A table as the content of its file."""
    return _compressed(head + b"\n" + _coded_outer(table) + film_code(table))


def film_code(table: Samples) -> bytes:
    """The film of a table, coded; the same for all tails of a body in its tube."""
    head, film = _film_of(tube_table.parts_of(table).film)
    return head.astype("<f8").tobytes() + _coded(film / _FILM)


def _coded_outer(table: Samples) -> bytes:
    """All of a table but its film, coded."""
    parts = tube_table.parts_of(table)
    rows = _rows_of(parts.rest)
    counts = np.array([parts.nodes.size, rows.size], dtype="<f8")
    exact = b"".join(part.astype("<f8").tobytes() for part in (counts, parts.nodes, rows))
    steps = _steps(rows)
    yawed = _times(tube_table.yaw_parts_at_nodes(), parts.yawed)
    return exact + _coded(parts.rest / steps) + _coded(yawed / steps)


def _compressed(content: bytes) -> bytes:
    return sealed(lzma.compress(content, filters=[_FILTER]))


def _opened(path: Path) -> bytes:
    """The content of a file of `_compressed`, or a ValueError."""
    content = unsealed(read_bytes(path, "a table", _LARGEST_FILE))
    if content is None:
        raise ValueError("damaged")
    try:
        return lzma.LZMADecompressor(memlimit=_MOST_MEMORY).decompress(content, _LARGEST)
    except lzma.LZMAError as error:
        raise ValueError("no table") from error


def packed_from(path: Path) -> tuple[dict[str, Any], Samples]:
    """Head and packed table from a file, and from the one beside it that has its film, or a ValueError."""
    words, _, coded = _opened(path).partition(b"\n")
    head = json.loads(words)
    film = head.pop("film", None)
    if film is not None:
        coded += _opened(path.with_name(Path(str(film)).name))
    return head, _Reader(coded).table()


class _Reader:
    """Numbers one after the other."""

    def __init__(self, content: bytes) -> None:
        self._content, self._at = content, 0

    def table(self) -> Samples:
        """The packed table."""
        counts = self._exact(2).astype(int)
        nodes, rows = self._exact(int(counts[0])), self._exact(int(counts[1]))
        shapes = tube_table.shapes_of(nodes)
        rest, yawed = (self._whole(shape) * _steps(rows) for shape in shapes)
        head = self._exact(core.FILM_SIZE)
        yawed = _times(np.asarray(np.linalg.inv(tube_table.yaw_parts_at_nodes()), dtype=np.float64), yawed)
        film = (self._whole(tube_table.shape_of(head)) * _FILM).astype(np.float32).ravel()
        packed = np.concatenate([head, np.pad(film, (0, film.size % 2)).view(np.float64)])
        return tube_table.Parts(nodes, rest, yawed, packed).packed()

    def _exact(self, count: int) -> Samples:
        found = np.frombuffer(self._taken(8 * count), "<f8")
        return found.astype(np.float64)

    def _whole(self, shape: tuple[int, ...]) -> Samples:
        """Decode the result of `_coded`."""
        planes = np.frombuffer(self._taken(4 * int(np.prod(shape))), np.uint8).reshape(4, -1)
        folded = np.ascontiguousarray(planes.T).view("<u4").reshape(shape[-1], *shape[:-1])
        changes = (folded >> 1).astype(np.int32) ^ -(folded & 1).astype(np.int32)
        whole = np.moveaxis(changes, 0, -1).astype(np.int32)
        for axis in (0, 1):
            whole = np.cumsum(whole, axis=axis, dtype=np.int32)
        return whole.astype(np.float64)

    def _taken(self, count: int) -> bytes:
        start, self._at = self._at, self._at + count
        if self._at > len(self._content):
            raise ValueError("cut short")
        return self._content[start : self._at]


def _coded(values: Samples) -> bytes:
    """Values, rounded, as changes along their first two axes, sign last: small ones, whose upper bytes are zero."""
    whole = np.rint(np.clip(values, -_MOST_STEPS, _MOST_STEPS)).astype(np.int32)
    for axis in (0, 1):
        whole = np.diff(whole, axis=axis, prepend=np.int32(0))
    whole = (whole << 1) ^ (whole >> 31)
    ordered = np.ascontiguousarray(np.moveaxis(whole, -1, 0)).astype("<i4")
    return ordered.ravel().view(np.uint8).reshape(-1, 4).T.tobytes()


def _rows_of(rest: Samples) -> Samples:
    """Size of each row of the factor, (8,): the geometric mean of its diagonal."""
    row, column = np.tril_indices(core.MOTIONS)
    found: Samples = np.exp(np.mean(rest[:, :, 0][..., row == column], axis=(0, 1)))
    return found


def _times(matrix: Samples, yawed: Samples) -> Samples:
    """A matrix over the orders times (yaw gaps, yaw pitches, orders, phases, 36)."""
    return np.moveaxis(np.tensordot(matrix, yawed, axes=(1, 2)), 0, 2)


def _steps(rows: Samples) -> Samples:
    """Steps of the rest and of what a yaw adds to it at its nodes, (36,)."""
    row, column = np.tril_indices(core.MOTIONS)
    return _REST * np.where(row == column, 1.0, rows[row])


def _film_of(film: Samples) -> tuple[Samples, Samples]:
    """Unpack head and coefficients of a lubrication film."""
    head, shape = film[: core.FILM_SIZE], tube_table.shape_of(film)
    values = film[core.FILM_SIZE :].copy().view(np.float32)[: int(np.prod(shape))]
    return head, values.reshape(shape).astype(np.float64)


_FORMAT = "spirillum.tube-table/7"
_LARGEST_FILE = 2**21  # bytes


@dataclass(frozen=True)
class TubeTable:
    """Table of one robot in one tube."""

    geometry: RobotGeometry
    radius: float  #: R of the tube, m.
    packed: Samples = field(repr=False)  #: For `spirillum.kernels.tube_table.resistance_at`.
    error: Mapping[str, float]
    """Largest relative error at check poses with yaw: `forward_velocity`, `body_rotation_rate`, ..."""
    error_without_yaw: Mapping[str, float]  #: Largest relative error at check poses without yaw.
    places: int  #: Number of nodes that were solved for.
    seconds: float
    wire: float | None = None
    """Relative error of the forward velocity against the finest form of the wire; None: the largest measured one."""
    stage: StageName = "fine"

    @property
    def error_against(self) -> str:
        """Reference of the stated error of the forward velocity, in words."""
        return (
            "solutions with finer wires: the largest error at check poses between the nodes of its table, and that of "
            "the wire and the solids"
        )

    @property
    def key(self) -> str:
        """Key of the table: a digest of robot and tube."""
        return key_of(self.geometry, self.radius)

    def at(self, offset: float, pitch: float = 0.0, yaw: float = 0.0, phase: float = 0.0) -> tuple[Samples, int]:
        """The 8x8 at a pose (m, rad), viscosity 1, and how it leaves the table's range, see `resistance_at`."""
        out = np.empty((core.MOTIONS, core.MOTIONS))
        left = core.resistance_at(self.packed, offset, pitch, yaw, phase, out)
        return out, int(left)

    def error_at(self, yaw: float) -> Mapping[str, float]:
        """Largest relative errors at poses with or without a yaw."""
        return self.error if yaw else self.error_without_yaw

    def speed_error_at(self, yaw: float) -> float:
        """Relative error of the forward velocity: of the interpolation, the wire and the solids together."""
        known = LARGEST_WIRE_ERROR if self.wire is None else self.wire
        return float(self.error_at(yaw)["forward_velocity"]) + known + FINEST_WIRE_ERROR + SOLIDS_ERROR

    def mirrored(self) -> TubeTable:
        """The table of the robot's mirror image, whose tail has the other hand."""
        geometry = self.geometry._replace(hand=-self.geometry.hand)
        return replace(self, geometry=geometry, packed=tube_table.mirror_image(self.packed))

    def write(self, path: Path, film: str | None = None) -> None:
        """Write it, whole or not at all, its numbers rounded to some 1e-5."""
        head = {
            "format": _FORMAT,
            "geometry": self.geometry._asdict(),
            "radius": self.radius,
            "error": dict(self.error),
            "error_without_yaw": dict(self.error_without_yaw),
            "places": self.places,
            "seconds": self.seconds,
            "wire": self.wire,
            "stage": self.stage,
        }
        content = to_bytes(json.dumps(head).encode(), self.packed)
        if film is not None:
            words = json.dumps(head | {"film": film}).encode()
            content = _compressed(words + b"\n" + _coded_outer(self.packed))
            with atomic_write(path.with_name(film), replace="any") as temporary:
                temporary.write_bytes(_compressed(film_code(self.packed)))
        with atomic_write(path, replace="any") as temporary:
            temporary.write_bytes(content)

    @classmethod
    def read(cls, path: Path) -> TubeTable:
        """Read a table."""
        found = _read(path)
        if found is None:
            raise InputError(f"{path} is no table of this version of spirillum; allowed: one of `spirillum prepare`")
        return found


def _read(path: Path) -> TubeTable | None:
    """The table in a file; None for any other file."""
    try:
        head, packed = packed_from(path)
        if head.pop("format") != _FORMAT:
            return None
        geometry = RobotGeometry.read(head.pop("geometry"))
        return _checked(TubeTable(geometry=geometry, packed=packed, **head))
    except (OSError, ValueError, KeyError, TypeError, AttributeError, IndexError, OverflowError, RecursionError):
        return None


def _checked(table: TubeTable) -> TubeTable:
    """A table that is whole, with errors that are numbers, or a ValueError."""
    stated = [mapping[name] for mapping in (table.error, table.error_without_yaw) for name in RESPONSES]
    numbers = (0.0 if table.wire is None else table.wire, table.radius, table.seconds, table.places, *stated)
    if (
        not all(math.isfinite(number) and number >= 0.0 for number in numbers)
        or table.radius <= 0.0
        or table.stage not in STAGES
    ):
        raise ValueError("not the numbers of a table")
    if not tube_table.is_whole(table.packed, table.radius):
        raise ValueError("not the nodes of a table")
    return table


def key_of(geometry: RobotGeometry, radius: float) -> str:
    """A digest of robot and tube, numbers to ten digits."""
    *numbers, form, profile = geometry
    words = [*(f"{value:.10g}" if isinstance(value, float) else str(value) for value in numbers), f"{radius:.10g}"]
    words += [str(part) for part, usual in ((form, PLAIN), (profile, ())) if part != usual]
    return hashlib.sha256(" ".join(words).encode()).hexdigest()[:24]


def least_checked_gap(packed: Samples) -> float:
    """Smallest gap of a packed table's check poses, m."""
    return CHECKED_FROM * float(tube_table.range_of(packed).gaps[0])
