"""Limits of what may be read and named: sizes of files and of what they declare, and users' names in paths."""

from __future__ import annotations

import os
import re
import unicodedata
from collections.abc import Collection
from pathlib import Path

from spirillum.errors import InputError

LARGEST_TEXT = 1 << 20  #: Robot, study, setup and calibration files, and marks of folders, bytes.
MOST_LEVELS = 24  #: Parts of a dotted key in a TOML file: tables in tables. Files of this program have at most five.
LARGEST_TABLE = 128 << 20  #: Tables in CSV or Parquet, bytes.
MOST_ROWS = 1_000_000  #: Rows of a table.
MOST_COLUMNS = 500  #: Columns of a table.
MOST_CELLS = 5_000_000  #: Cells of a table.
LONGEST_CELL = 10_000  #: A text in a cell of a Parquet file, characters.
LARGEST_NETCDF = 512 << 20  #: A run or a posterior, bytes: on disk, and as its arrays declare.
MOST_VARIABLES = 2000  #: Groups and variables in a NetCDF file.
MOST_PIXELS = 50_000_000  #: Pixels of a frame or an image.
SMALLEST_SIDE = 32  #: Pixels of a frame's shorter side.
LARGEST_PICTURE = 512 << 20  #: An image in a folder, bytes.
MOST_IMAGES = 1_000_000  #: Images in a folder.
LONGEST_PATH = 4096  #: A file's name with its folders, characters.
LONGEST_NAME = 255  #: A file or folder by itself, bytes: what the usual file systems hold.
MOST_POINTS = 2000  #: Points of a tail's centre line or of a body's outline.


_LONGEST_NAME = 100
_NOT_IN_NAMES = re.compile(r"[^\w.+-]+")
_FORMULAS = ("=", "+", "-", "@")  # with what a cell begins that a spreadsheet takes for a formula
_DEVICES = re.compile(r"(?i)(con|prn|aux|nul|com\d|lpt\d)(\..*)?")  # names that are devices on Windows


def is_text(name: str) -> bool:
    """Whether a name can be written as UTF-8: names of files may be any bytes."""
    try:
        name.encode()
    except UnicodeEncodeError:
        return False
    return True


def checked_path(path: str | os.PathLike[str], what: str) -> Path:
    """A path that results may name and libraries may open."""
    name = os.fspath(path)
    if not name:
        raise InputError(f"an empty name of a file; allowed: {what}")
    if "\0" in name or len(name) > LONGEST_PATH:
        wrong = "holds a null character" if "\0" in name else f"has {len(name)} characters"
        raise InputError(f"{name[:80]!r} {wrong}; allowed: {what}")
    if any(unicodedata.category(letter) == "Cc" for letter in name):
        raise InputError(f"{name[:80]!r} holds a control character; allowed: {what}")
    if not is_text(name):
        raise InputError(f"{name[:200]!a} is not text; allowed: a name that is text in UTF-8, as results carry it")
    longest = max(len(part.encode()) for part in Path(name).parts or ("",))
    if longest > LONGEST_NAME:
        raise InputError(
            f"{name[:80]!r} has a name of {longest} bytes; allowed: {what}, at most {LONGEST_NAME} bytes a name"
        )
    return Path(path)


def file_name(name: str, taken: Collection[str] = ()) -> str:
    """A name as part of a path: one folder or file, not hidden, other than others also where capitals do not count."""
    # Letters, digits, `_`, `.`, `+` and `-` stay; other signs become `-`. It is never `.` or `..`.
    safe = _NOT_IN_NAMES.sub("-", name).lstrip(".-")[:_LONGEST_NAME].rstrip(".") or "unnamed"
    if _DEVICES.fullmatch(safe):
        safe = f"{safe}-"
    lower = {other.casefold() for other in taken}
    found, number = safe, 2
    while found.casefold() in lower:
        found, number = f"{safe}-{number}", number + 1
    return found


def text_cell(text: str) -> str:
    """A text as a cell of a CSV file: one printable line that no spreadsheet takes for a formula."""
    line = "".join(c if c.isprintable() else " " for c in text).strip()
    return f"'{line}" if line.startswith(_FORMULAS) else line
