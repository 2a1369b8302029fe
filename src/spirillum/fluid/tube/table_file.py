"""A packed table as bytes: whole multiples of small steps, their changes from node to node, compressed.

A logarithm on the diagonal of the rest's factor is kept to `_REST`, the entries of a row to that share of its diagonal.
The film's logarithms need less, and its triangular factors more, for a thin film's entries differ by orders. A
resistance is then off by less than 1e-4 of the roots of its diagonal: a hundredth of what interpolation costs.
"""

from __future__ import annotations

import lzma

import numpy as np

from spirillum.arrays import Samples
from spirillum.fluid.tube.cache import sealed, unsealed
from spirillum.kernels import film_table
from spirillum.kernels import tube_table as kernel

__all__ = ["packed_from", "to_bytes"]

_REST = 3e-6
_FILM = np.where(np.arange(film_table.ENTRIES) < len(film_table.ORDER), 2e-5, 1e-6)
"""What numbers are multiples of."""
_MOST_STEPS = 2.0**31 - 1.0
"""Coefficients of a film beyond it belong to angles at which no robot fits into its tube."""
_FILTER = {"id": lzma.FILTER_LZMA2, "preset": 6, "pb": 0, "lc": 4}
"""Single bytes, whose place in a word says nothing: those of a plane follow each other."""
_LARGEST, _MOST_MEMORY = 2**23, 2**26  # bytes: not compressed, and to get there


def to_bytes(head: bytes, table: Samples) -> bytes:
    """A table as the content of its file.

    Args:
        head: a line of words about it.
        table: packed.
    """
    parts = kernel.parts_of(table)
    film_head, film = _film_of(parts.film)
    rows = _rows_of(parts.rest)
    counts = np.array([parts.nodes.size, rows.size], dtype="<f8")
    exact = b"".join(part.astype("<f8").tobytes() for part in (counts, parts.nodes, rows, film_head))
    steps = _steps(rows)
    yawed = _times(kernel.yaw_parts_at_nodes(), parts.yawed)
    coded = _coded(parts.rest / steps) + _coded(yawed / steps) + _coded(film / _FILM)
    return sealed(lzma.compress(head + b"\n" + exact + coded, filters=[_FILTER]))


def packed_from(stored: bytes) -> tuple[bytes, Samples]:
    """Head and packed table from the content of a file.

    Raises:
        ValueError: if it is none.
    """
    content = unsealed(stored)
    if content is None:
        raise ValueError("damaged")
    try:
        opened = lzma.LZMADecompressor(memlimit=_MOST_MEMORY).decompress(content, _LARGEST)
    except lzma.LZMAError as error:
        raise ValueError("no table") from error
    head, _, rest = opened.partition(b"\n")
    return head, _Reader(rest).table()


class _Reader:
    """Numbers one after the other."""

    def __init__(self, content: bytes) -> None:
        self._content, self._at = content, 0

    def table(self) -> Samples:
        """The packed table."""
        counts = self._exact(2).astype(int)
        nodes, rows = self._exact(int(counts[0])), self._exact(int(counts[1]))
        head = self._exact(film_table.HEAD)
        shapes = kernel.shapes_of(nodes)
        rest, yawed = (self._whole(shape) * _steps(rows) for shape in shapes)
        yawed = _times(np.asarray(np.linalg.inv(kernel.yaw_parts_at_nodes()), dtype=np.float64), yawed)
        film = (self._whole(film_table.shape_of(head)) * _FILM).astype(np.float32).ravel()
        packed = np.concatenate([head, np.pad(film, (0, film.size % 2)).view(np.float64)])
        return kernel.Parts(nodes, rest, yawed, packed).packed()

    def _exact(self, count: int) -> Samples:
        found = np.frombuffer(self._taken(8 * count), "<f8")
        return found.astype(np.float64)

    def _whole(self, shape: tuple[int, ...]) -> Samples:
        """What `_coded` has coded."""
        planes = np.frombuffer(self._taken(4 * int(np.prod(shape))), np.uint8).reshape(4, -1)
        changes = np.ascontiguousarray(planes.T).view("<i4").reshape(shape[-1], *shape[:-1])
        whole = np.moveaxis(changes, 0, -1).astype(np.int32)
        for axis in (0, 1):
            whole = np.cumsum(whole, axis=axis, dtype=np.int32)
        found: Samples = whole.astype(np.float64)
        return found

    def _taken(self, count: int) -> bytes:
        start, self._at = self._at, self._at + count
        if self._at > len(self._content):
            raise ValueError("cut short")
        return self._content[start : self._at]


def _coded(values: Samples) -> bytes:
    """Values, rounded, as changes along their first two axes: small ones, whose upper bytes are alike."""
    whole = np.rint(np.clip(values, -_MOST_STEPS, _MOST_STEPS)).astype(np.int32)
    for axis in (0, 1):
        whole = np.diff(whole, axis=axis, prepend=np.int32(0))
    ordered = np.ascontiguousarray(np.moveaxis(whole, -1, 0)).astype("<i4")
    return ordered.ravel().view(np.uint8).reshape(-1, 4).T.tobytes()


def _rows_of(rest: Samples) -> Samples:
    """Size of each row of the factor, (8,): the geometric mean of its diagonal."""
    row, column = np.tril_indices(kernel.MOTIONS)
    found: Samples = np.exp(np.mean(rest[:, :, 0][..., row == column], axis=(0, 1)))
    return found


def _times(matrix: Samples, yawed: Samples) -> Samples:
    """A matrix over the orders times (yaw gaps, yaw pitches, orders, phases, 36)."""
    found: Samples = np.moveaxis(np.tensordot(matrix, yawed, axes=(1, 2)), 0, 2)
    return found


def _steps(rows: Samples) -> Samples:
    """Steps of the rest and of what a yaw adds to it at its nodes, (36,)."""
    row, column = np.tril_indices(kernel.MOTIONS)
    found: Samples = _REST * np.where(row == column, 1.0, rows[row])
    return found


def _film_of(film: Samples) -> tuple[Samples, Samples]:
    """Head and coefficients of a packed film."""
    head, shape = film[: film_table.HEAD], film_table.shape_of(film)
    values = film[film_table.HEAD :].copy().view(np.float32)[: int(np.prod(shape))]
    return head, values.reshape(shape).astype(np.float64)
