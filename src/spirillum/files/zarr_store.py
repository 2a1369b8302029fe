"""Zarr stores (format 3): encoded in memory by the library, written whole by this program, a region after the other.

A region is one chunk of every variable. The library writes any region that it is asked to, also one that shares a
chunk with another, and one of two writers then loses what it wrote: so regions are checked here.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from spirillum.errors import InputError
from spirillum.files.limits import checked_path
from spirillum.files.locks import private_folder
from spirillum.files.reading import DAMAGED
from spirillum.files.writing import synced

if TYPE_CHECKING:
    import xarray as xr

_SETTINGS = {"array.write_empty_chunks": True, "threading.max_workers": 1, "async.concurrency": 1}
_LEVEL = 1  # of compression: faster than a disk, and floats gain nothing from more
_CHECKSUM = 4  # bytes of the checksum at the end of a chunk

Place = Sequence[tuple[int, int]]  #: First index, and the one behind the last, along each dimension.


class Stored(NamedTuple):
    """A variable of a store."""

    dimensions: tuple[str, ...]
    shape: tuple[int, ...]
    chunk: tuple[int, ...]
    dtype: str  #: `float64`, `int8`, `int32` or `str`.
    attributes: Mapping[str, Any]


def store_target(path: str | Path) -> Path:
    """The folder of a store, by its name."""
    folder = checked_path(path, "a Zarr store, for example study.zarr")
    if folder.suffix != ".zarr":
        raise InputError(f"store = {str(path)[:200]!r}; allowed: a name that ends in .zarr, for example study.zarr")
    return folder


def store_files(
    variables: Mapping[str, Stored], values: Mapping[str, np.ndarray[Any, Any]], attributes: Mapping[str, Any]
) -> dict[str, bytes]:
    """Content of the files without regions by path (metadata, variables written whole); the root's comes last."""
    import zarr
    from zarr.storage import MemoryStore

    found: dict[str, Any] = {}
    store = MemoryStore(found)
    with zarr.config.set(_SETTINGS), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # metadata at one place: read by all, and not yet part of the format
        group = zarr.create_group(store=store, zarr_format=3, attributes=dict(attributes))
        for name, item in variables.items():
            array = _created(group, name, item)
            if name in values:
                given = values[name]
                array[...] = given.astype(object) if item.dtype == "str" else given
        zarr.consolidate_metadata(store)
    last = found.pop("zarr.json")
    return {key: buffer.to_bytes() for key, buffer in {**found, "zarr.json": last}.items()}


def region_files(
    variables: Mapping[str, Stored], values: Mapping[str, np.ndarray[Any, Any]], places: Mapping[str, Place]
) -> dict[str, bytes]:
    """Files of one region of some variables, in their order."""
    import zarr
    from zarr.storage import MemoryStore

    found: dict[str, Any] = {}
    with zarr.config.set(_SETTINGS):
        group = zarr.create_group(store=MemoryStore(found), zarr_format=3)
        for name, given in values.items():
            item, place = variables[name], places[name]
            for (start, stop), size, part in zip(place, item.shape, item.chunk, strict=True):
                if start % part or stop != min(start + part, size):
                    raise ValueError(f"{name}: places {start} to {stop} of {size} are no chunk of {part}")
            _created(group, name, item)[tuple(slice(*ends) for ends in place)] = given
    keys = [chunk_key(name, variables[name], places[name]) for name in values]
    return {key: found[key].to_bytes() for key in keys}


def chunk_key(name: str, item: Stored, place: Place) -> str:
    """Path within the store of the chunk that a region of a variable is."""
    return "/".join([name, "c", *(str(start // part) for (start, _), part in zip(place, item.chunk, strict=True))])


def is_whole(path: Path) -> bool:
    """Whether a chunk is there as it was written: its last four bytes are the CRC-32C of the others."""
    from google_crc32c import value  # of zarr

    with suppress(OSError):
        content = path.read_bytes()
        return len(content) > _CHECKSUM and value(content[:-_CHECKSUM]) == int.from_bytes(
            content[-_CHECKSUM:], "little"
        )
    return False


def _created(group: Any, name: str, item: Stored) -> Any:
    from zarr.codecs import Crc32cCodec, ZstdCodec

    if item.dtype == "str":
        kind: dict[str, Any] = {"dtype": str}
    else:
        kind = {"dtype": item.dtype, "fill_value": np.nan if item.dtype == "float64" else 0}
    plain = {key: one.tolist() if isinstance(one, np.ndarray) else one for key, one in item.attributes.items()}
    return group.create_array(
        name,
        shape=item.shape,
        chunks=tuple(max(part, 1) for part in item.chunk),
        dimension_names=item.dimensions,
        attributes=plain,
        compressors=[ZstdCodec(level=_LEVEL), Crc32cCodec()],
        **kind,
    )


def write_pieces(folder: Path, pieces: Mapping[str, bytes]) -> None:
    """Write files that belong together into a claimed folder: all are on the disk before the first is renamed."""
    for key in pieces:
        if (folder / key).is_dir():
            raise InputError(f"{folder / key} is a folder; allowed: a file of the store, or nothing: remove it")
    with private_folder(folder) as hidden:
        for number, content in enumerate(pieces.values()):
            with (hidden / str(number)).open("wb") as stream:
                stream.write(content)
                stream.flush()
                os.fsync(stream.fileno())
        *earlier, last = enumerate(pieces)
        for numbered in (earlier, [last]):
            for number, key in numbered:
                place = folder / key
                _make_folder(folder, place.parent)
                (hidden / str(number)).replace(place)
            for parent in {(folder / key).parent for _, key in numbered}:
                synced(parent)


def _make_folder(folder: Path, inner: Path) -> None:
    """Make a folder within another, no part of which may lead out of it."""
    for part in reversed([inner, *inner.parents][: len(inner.relative_to(folder).parts)]):
        if part.is_symlink():
            raise InputError(f"{part} is a link; allowed: a folder of its own in {folder}")
        with suppress(FileExistsError):
            part.mkdir()


def opened_store(folder: Path) -> xr.Dataset:
    """A store as a dataset, whose values are read on access."""
    import xarray as xr

    try:
        dataset: xr.Dataset = xr.open_zarr(folder, chunks=None, consolidated=True, decode_times=False)
    except Exception as error:  # a damaged store raises whatever the libraries meet first
        raise InputError(f"{folder} cannot be read: it {DAMAGED}; allowed: a store of this study") from error
    return dataset
