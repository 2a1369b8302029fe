"""Reading users' files with care and writing results whole or not at all."""

from __future__ import annotations

import csv
import json
import os
import tempfile
import threading
import tomllib
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

from spirillum.answer import as_json
from spirillum.errors import InputError

if TYPE_CHECKING:
    import h5netcdf
    import xarray as xr

__all__ = [
    "PICTURES",
    "claim_folder",
    "csv_rows",
    "netcdf_file",
    "netcdf_target",
    "new_file",
    "output_folder",
    "output_target",
    "parse_toml",
    "read_text",
    "read_toml",
    "whole_file",
    "write_dataset",
    "write_text",
]

PICTURES = {".png": "a picture", ".pdf": "a picture", ".svg": "a picture"}
"""Endings of the pictures that can be written, for `output_target`."""
_LARGEST_TEXT = 1 << 20
_MASK_LOCK = threading.Lock()


def read_text(path: Path, what: str, largest: int = _LARGEST_TEXT) -> str:
    """Text of a user's file.

    Args:
        path: the file.
        what: what it should be, for the sentence of an error.
        largest: largest size, bytes.

    Raises:
        InputError: if it is missing, a folder, unreadable, empty, too large, or not UTF-8 text.
    """
    try:
        if path.is_dir():
            raise InputError(f"{path} is a folder; allowed: {what}")
        if not path.exists():
            raise InputError(f"{path} does not exist; allowed: {what}")
        if not path.is_file():
            raise InputError(f"{path} is not a regular file; allowed: {what}")
        size = path.stat().st_size
        if size > largest:
            raise InputError(f"{path} has {size} bytes; allowed: {what} of at most {largest} bytes")
        text = path.read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{path} is not text (byte {error.start} is not UTF-8); allowed: {what}") from error
    except (OSError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise InputError(f"{str(path)[:200]!r} cannot be read ({reason}); allowed: {what}") from error
    if not text.strip():
        raise InputError(f"{path} is empty; allowed: {what}")
    return text


def parse_toml(text: str, source: str, what: str) -> dict[str, Any]:
    """Tables of a TOML text.

    Raises:
        InputError: if it is not TOML; the sentence names source and line.
    """
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{source} is not TOML: {str(error)[:200]}; allowed: {what}") from error
    except (RecursionError, ValueError) as error:
        raise InputError(f"{source} holds values nested too deeply or too long; allowed: {what}") from error


def read_toml(path: Path, what: str) -> dict[str, Any]:
    """Tables of a user's TOML file.

    Raises:
        InputError: as `read_text` and `parse_toml`.
    """
    return parse_toml(read_text(path, what), str(path), what)


def csv_rows(text: str, path: Path, what: str) -> list[tuple[int, list[str]]]:
    """Rows of a CSV text, its header among them, each with the number of its line; cells without spaces around them.

    Lines that start with `#` are comments. They are left out, and so are rows of commas alone, as spreadsheets write.

    Args:
        text: what stands in the file.
        path: the file, for the sentence of an error.
        what: what it should be.

    Raises:
        InputError: if it is not CSV.
    """
    lines = [(number, line) for number, line in enumerate(text.splitlines(), 1) if line.strip(" ,\t")]
    lines = [(number, line) for number, line in lines if not line.lstrip().startswith("#")]
    reader = csv.reader((f"{line}\n" for _, line in lines), strict=True)
    found: list[tuple[int, list[str]]] = []
    first = 0
    try:
        for cells in reader:
            found.append((lines[first][0], [cell.strip() for cell in cells]))
            first = reader.line_num  # a cell in quotation marks may go over several lines
    except csv.Error as error:
        raise InputError(f"{path} is not CSV ({error}); allowed: {what}") from error
    return found


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Give a temporary path beside `path`; when the block ends well it takes the place of `path`.

    Raises:
        InputError: if the folder cannot be written to.
    """
    path = _regular(path)
    try:
        handle, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=path.suffix, dir=path.parent)
    except OSError as error:
        raise InputError(f"{path} cannot be written ({error.strerror}); allowed: a folder you may write to") from error
    os.close(handle)
    temporary = Path(name)
    temporary.unlink()  # some writers treat a file that is there, even an empty one, as one to add to
    try:
        yield temporary
        temporary.chmod(0o666 & ~_mask())
        try:
            temporary.replace(path)
        except OSError as error:
            raise InputError(f"{path} cannot be written ({error.strerror}); allowed: a file name") from error
    finally:
        temporary.unlink(missing_ok=True)


def _mask() -> int:
    """What new files may not allow; it can only be read by setting it, which two threads must not do at once."""
    with _MASK_LOCK:
        mask = os.umask(0)
        os.umask(mask)
    return mask


def _regular(path: Path) -> Path:
    """The file behind a path, links followed.

    Raises:
        InputError: if something is there that is no regular file, such as a folder or a device.
    """
    try:
        real = path.resolve()
        wrong = real.exists() and not real.is_file()
    except (OSError, RuntimeError, ValueError) as error:
        raise InputError(f"{str(path)[:200]!r} cannot be written; allowed: a file name") from error
    if wrong:
        raise InputError(f"{path} is not a regular file; allowed: a new file, or one to replace")
    return real


def netcdf_target(path: str | Path) -> Path:
    """The path of a NetCDF file to write, checked before any work is done.

    Raises:
        InputError: if it does not end in `.nc`, is no regular file, or its folder is not there.
    """
    return output_target(path, {".nc": "a NetCDF file"}, "run.nc")


def output_target(path: str | Path, kinds: Mapping[str, str], example: str) -> Path:
    """The path of a file to write, checked before any work is done.

    Args:
        path: the file.
        kinds: allowed endings, and what each of them is.
        example: a name that would do.

    Raises:
        InputError: if it has another ending, is no regular file, or its folder is not there or closed to you.
    """
    path = Path(path)
    if path.suffix not in kinds:
        endings, names = " or ".join(kinds), " or ".join(dict.fromkeys(kinds.values()))
        raise InputError(f"{str(path)[:200]!r} does not end in {endings}; allowed: {names}, for example {example}")
    real = _regular(path)
    if real.exists() and not os.access(real, os.W_OK):
        raise InputError(f"{path} is there and closed to writing (permission denied); allowed: a file you may replace")
    folder = real.parent
    if not folder.is_dir():
        raise InputError(f"{path} cannot be written (no such folder); allowed: a folder you may write to")
    if not os.access(folder, os.W_OK):
        raise InputError(f"{path} cannot be written (permission denied); allowed: a folder you may write to")
    return path


def write_text(path: Path, text: str) -> None:
    """Write a text file whole or not at all."""
    with whole_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def new_file(path: Path, text: str, *, overwrite: bool = False) -> None:
    """Write a text file that a user edits and would not lose: whole, and not over one that is there.

    Args:
        path: the file.
        text: what it holds.
        overwrite: replace a file that is there.

    Raises:
        InputError: if the file is there or cannot be written.
    """
    if _regular(path).exists() and not overwrite:
        raise InputError(f"{path} exists; allowed: a new file, or --force to overwrite one")
    write_text(path, text)


@contextmanager
def netcdf_file(path: Path) -> Iterator[h5netcdf.File]:
    """A new NetCDF-4 file, written whole or not at all when the block ends.

    It is made in memory: HDF5 takes the whole process down where it finds no space on a disk.
    """
    import h5netcdf

    content = BytesIO()
    with h5netcdf.File(content, "w") as file:
        yield file
    with whole_file(path) as temporary:
        temporary.write_bytes(content.getbuffer())


def write_dataset(dataset: xr.Dataset, path: Path) -> None:
    """Write NetCDF-4, compressed, whole or not at all."""
    from xarray.backends import H5NetCDFStore

    encoding = {
        str(name): {"zlib": True, "complevel": 4} for name, variable in dataset.data_vars.items() if variable.ndim > 0
    }
    with netcdf_file(path) as file:
        dataset.dump_to_store(H5NetCDFStore(file), encoding=encoding)


def output_folder(path: Path) -> Path:
    """Create the folder for results.

    Raises:
        InputError: if it is a file or cannot be created.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{path} cannot be a folder for results ({error.strerror}); allowed: a new folder") from error
    return path


def claim_folder(
    folder: Path, mark: str, content: Mapping[str, Any], what: str, results: Collection[str] | None = None
) -> None:
    """Mark a folder as the place of one question's results: a rerun resumes there, another question is refused.

    Args:
        folder: the folder, new, empty, or marked before.
        mark: name of the file in it that marks it.
        content: what the mark says: `fingerprint`, a hash of the question, and perhaps its `title`.
        what: what the results are of, for the sentence of an error.
        results: names that may not stand in a folder without the mark; None: any.

    Raises:
        InputError: if it holds results of another question or of unknown origin, or cannot be written to.
    """
    if (folder / mark).exists():
        try:
            found = json.loads((folder / mark).read_text(encoding="utf-8"))
            same, title = found["fingerprint"] == content["fingerprint"], str(found.get("title", ""))[:80]
        except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
            raise InputError(f"{folder / mark} is damaged; allowed: a new folder (-o DIR)") from error
        if not same:
            named = f" ('{title}')" if title else ""
            raise InputError(
                f"{folder} holds another {what}{named}, or one with other settings; allowed: the same {what}, to "
                "resume it, or a new folder (-o DIR)"
            )
        return
    there = sorted(path.name for path in folder.iterdir()) if folder.is_dir() else []
    stray = next((name for name in there if results is None or name in results), None)
    if stray is not None:
        raise InputError(f"{folder} holds {stray} of unknown origin; allowed: a new folder (-o DIR)")
    output_folder(folder)
    write_text(folder / mark, as_json(dict(content)) + "\n")
