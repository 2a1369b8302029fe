"""NetCDF-4 files: made in memory and written whole; read once their declared sizes are known to be small enough."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from io import BytesIO
from math import prod
from pathlib import Path
from shutil import copyfileobj
from typing import TYPE_CHECKING, Any

from spirillum.errors import InputError
from spirillum.files.limits import LARGEST_NETCDF, MOST_VARIABLES
from spirillum.files.reading import DAMAGED, opened
from spirillum.files.writing import Replace, atomic_write

if TYPE_CHECKING:
    import h5netcdf
    import h5py
    import xarray as xr

_BEGINS = b"\x89HDF\r\n\x1a\n"
_DEEPEST = 6
_LONGEST_TEXTS = 64 << 20
_LARGEST_CHUNK = 64 << 20


@cache
def _hdf5() -> type[h5py.File]:
    """A file of HDF5 that opens each array of its root once, and where nothing is written those of its groups too."""
    # h5netcdf asks for the arrays of a file's dimensions some dozen times for every variable, and each time HDF5 opens
    # one anew: half of the time that writing takes.
    import h5py

    class Hdf5(h5py.File):  # type: ignore[misc]
        def __getitem__(self, name: Any) -> Any:
            if not isinstance(name, str) or ("/" in name.lstrip("/") and self.mode != "r"):
                return super().__getitem__(name)
            if not (own := name.lstrip("/")):
                return self
            kept = self.__dict__.setdefault("_kept", {})
            if own not in kept:
                kept[own] = super().__getitem__(own)
            return kept[own]

        def __delitem__(self, name: str) -> None:
            self.__dict__.get("_kept", {}).pop(name.lstrip("/"), None)
            super().__delitem__(name)

    return Hdf5


@contextmanager
def netcdf_file(path: Path, *, replace: Replace = "own") -> Iterator[h5netcdf.File]:
    """A new NetCDF-4 file, written whole or not at all when the block ends."""
    # It is made in memory: HDF5 takes the whole process down where it finds no space on a disk.
    import h5netcdf

    content = BytesIO()
    with _hdf5()(content, "w", track_order=True) as stored, h5netcdf.File(stored, "w") as file:
        yield file
    content.seek(0)
    with atomic_write(path, replace=replace) as temporary, temporary.open("wb") as target:
        copyfileobj(content, target)  # in parts: no view of the whole outlives it where the disk is full


def write_dataset(dataset: xr.Dataset, path: Path, *, replace: Replace = "own") -> None:
    """Write NetCDF-4, compressed, whole or not at all; what it may replace is that of `atomic_write`."""
    from xarray.backends import H5NetCDFStore

    encoding = {
        str(name): {"zlib": True, "complevel": 4} for name, variable in dataset.data_vars.items() if variable.ndim > 0
    }
    with netcdf_file(path, replace=replace) as file:
        dataset.dump_to_store(H5NetCDFStore(file), encoding=encoding)


@contextmanager
def open_netcdf(path: str | Path, what: str, largest: int = LARGEST_NETCDF) -> Iterator[h5netcdf.File]:
    """A NetCDF-4 file for reading, of which is known that all of it fits into memory."""
    # Refused are pipes and folders, files or arrays that are too large, also those whose values were never stored,
    # links into other files, and compressed pieces that are larger than they declare.
    with opened(path, what, largest) as stream:
        if stream.read(len(_BEGINS)) != _BEGINS:
            raise InputError(f"{path} is not a NetCDF-4 file; allowed: {what}")
    import h5netcdf

    class File(h5netcdf.File):  # type: ignore[misc]
        _writable = False  # the library asks for it when it closes a file that it could not open

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of a foreign file; what matters of it is checked
            with _hdf5()(path, "r") as stored:
                _check(stored, Path(path), what, largest)
                with File(stored, "r") as file:
                    yield file
    except (InputError, KeyboardInterrupt, SystemExit):
        raise
    except Exception as error:  # a damaged file raises whatever the libraries meet first
        raise InputError(f"{path} cannot be read: it {DAMAGED}; allowed: {what}") from error


def loaded_netcdf(path: str | Path, what: str, largest: int = LARGEST_NETCDF) -> xr.Dataset:
    """A dataset from its file, loaded whole."""
    with open_netcdf(path, what, largest) as file:
        return group_of(file)


def group_of(file: h5netcdf.File, group: str | None = None) -> xr.Dataset:
    """A group of an open file, or the file itself, as a dataset, loaded whole."""
    import xarray as xr
    from xarray.backends import H5NetCDFStore

    return xr.open_dataset(
        H5NetCDFStore(file if group is None else file[group]), decode_times=False, cache=False
    ).load()


def _check(stored: h5py.File, path: Path, what: str, largest: int) -> None:
    """Walk through all groups without reading a value."""
    import h5py

    ahead: list[tuple[h5py.Group, int]] = [(stored, 0)]
    count = total = 0
    while ahead:
        group, depth = ahead.pop()
        count += len(group)
        if count > MOST_VARIABLES or depth > _DEEPEST:
            raise InputError(f"{path} holds more than {MOST_VARIABLES} variables or deep groups; allowed: {what}")
        for name in group:
            if not isinstance(group.get(name, getlink=True), h5py.HardLink):
                raise InputError(f"{path} holds a link to another place; allowed: {what}")
            item = group[name]
            if isinstance(item, h5py.Group):
                ahead.append((item, depth + 1))
            elif isinstance(item, h5py.Dataset):
                total += _declared(item, path, what)
                if total > largest:
                    raise InputError(f"{path} declares arrays of more than {largest} bytes; allowed: {what}")


def _declared(item: Any, path: Path, what: str) -> int:
    """Bytes of a variable in memory, as it declares them; texts are counted as they are."""
    import h5py

    if item.external or item.is_virtual:
        raise InputError(f"{path} takes values from other files; allowed: {what}")
    size: int = prod(item.shape or ()) * item.dtype.itemsize
    if item.chunks is not None:
        chunk = prod(item.chunks) * item.dtype.itemsize
        if chunk > _LARGEST_CHUNK or any(
            item.id.get_chunk_info(number).size > 2 * chunk + 1024 for number in range(item.id.get_num_chunks())
        ):
            raise InputError(f"{path} holds pieces that are larger than they should be; allowed: {what}")
    if h5py.check_string_dtype(item.dtype) is not None and item.dtype.hasobject:
        size += _texts(item, path, what)
    return size


def _texts(item: Any, path: Path, what: str) -> int:
    count = prod(item.shape or ())
    if count * item.file.id.get_filesize() <= _LONGEST_TEXTS or item.ndim != 1:
        if item.ndim > 1 and count > MOST_VARIABLES:
            raise InputError(f"{path} holds {count} texts; allowed: {what}")
        return 64 * count
    total = 0
    for start in range(0, count, 64):
        total += sum(len(text) for text in item[start : start + 64])
        if total > _LONGEST_TEXTS:
            raise InputError(f"{path} holds texts of more than {_LONGEST_TEXTS} bytes; allowed: {what}")
    return total + 64 * count
