"""Reading users' files: regular files only, their size checked first, wrong ones refused in a sentence."""

from __future__ import annotations

import csv
import errno
import json
import math
import os
import re
import stat
import tomllib
from collections.abc import Collection, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO

from spirillum.errors import InputError
from spirillum.files.limits import LARGEST_TEXT, MOST_CELLS, MOST_LEVELS, MOST_ROWS, checked_path
from spirillum.scalars import plain_minus

DAMAGED = "is damaged, cut off, or of another program"  #: Why a file of results cannot be read.
_LINE = re.compile(r"at line (\d+)")
_STRING = re.compile(r'"((?:[^"\\\n]|\\.)*)("|$)')
_KEY = re.compile(r"\s*(?P<key>[\w.\"'-]+)\s*=\s*(?P<value>.*)")
_FILE_KEY = re.compile(r"\s*(?:[\w-]+\s*\.\s*)*(?:file|folder|extends|robots?|flow|duty|video|run)\s*=")
_NO_ESCAPE = re.compile(r"(?<!\\)(?:\\\\)*\\(?:[^\\\"]|\"?$)")
_ESCAPES = {"b": "\b", "t": "\t", "n": "\n", "f": "\f", "r": "\r", "\\": "\\", '"': '"'}
_ESCAPE = re.compile(r"\\([btnfr\\\"])")
_ENDING = r"\.(?:toml|csv|parquet|nc|mp4|avi|mov|mkv|png|jpe?g|tiff?)"
_PATH = re.compile(rf"[A-Za-z]:\\.*|\.{{1,2}}\\.*|\\\\.*|\S+\.\w{{1,5}}|.+{_ENDING}")
_QUANTITY = re.compile(r"[+-]?[\d.]+(?:[eE][+-]?\d+)?\s*[^\W\d_°%][^#\"']*")
_TYPOGRAPHIC = "“”„‟‘’‚«»″′"
_MINUS_SIGNS = tuple("\u2212\u2010\u2011\u2012\u2013\u2014")


def parse_hint(text: str, message: str) -> str:
    """The likely reason why a text is not TOML, as the end of a sentence; empty where none is known."""
    found = _LINE.search(message)
    lines = text.split("\n")
    if found is None or not 0 < int(found[1]) <= len(lines):
        return ""
    return next(_hints(lines[int(found[1]) - 1]), "")


def _hints(line: str) -> Iterator[str]:
    """Remedies of what is wrong in a line, the likeliest first."""
    given = _KEY.match(line)
    value = given["value"].split("#")[0].strip() if given else ""
    for content in _quoted(line):
        if _NO_ESCAPE.search(content):
            end = content.find('\\"')  # a backslash at the end of a path has taken its quote
            yield backslash_remedy(content if end < 0 else content[: end + 1])
    if any(sign in line for sign in _TYPOGRAPHIC):
        yield "quotation marks are typographic; allowed: straight ones, \" or '"
    if value.startswith(_MINUS_SIGNS):
        yield "a minus sign is a dash of Unicode; allowed: -"
    if re.fullmatch(r"[+-]?\d+,\d+", value):
        yield f"{value} has a decimal comma; allowed: {value.replace(',', '.')}"
    if given and _QUANTITY.fullmatch(value):
        yield f'a number with its unit is text; allowed: {given["key"]} = "{value}"'


def control_hint(text: str, values: Collection[str]) -> tuple[int, str] | None:
    """Line and remedy of the first Windows path whose backslashes TOML has read as control characters."""
    if not values:
        return None
    for number, line in enumerate(text.split("\n"), 1):
        is_file = _FILE_KEY.match(line)
        for content in _quoted(line):
            if not is_file and not _PATH.fullmatch(content):
                continue
            if _ESCAPE.sub(lambda found: _ESCAPES[found[1]], content) in values:
                return number, backslash_remedy(content)
    return None


def backslash_remedy(path: str) -> str:
    """The end of a sentence on a path with backslashes between double quotes."""
    shown = path if len(path) <= 80 else f"{path[:80]}…"
    return (
        f'"{shown}" holds backslashes, which TOML reads as escapes between double quotes; allowed: forward slashes, '
        f"\"{shown.replace(chr(92), '/')}\", or single quotes, '{shown}'"
    )


def _quoted(line: str) -> Iterator[str]:
    """What stands between double quotes in a value of a line; the last may lack its end."""
    given = _KEY.match(line)
    return (
        found[1] if found[2] else found[1].rstrip() for found in _STRING.finditer(given["value"] if given else line)
    )


_QUOTED = re.compile(r'"(?:[^"\\\n]|\\.)*"|\'[^\'\n]*\'')
_LINE_ENDS = "\n\r\v\f\x1c\x1d\x1e\x85\u2028\u2029"  # where Python ends a line
_AROUND = " \t\r\n\v\f\xa0\u2007\u2009\u202f\ufeff"  # spaces and byte-order marks around a cell
_SEPARATOR_LINE = re.compile(r"\s*\"?sep=([,;\t])\"?\s*", re.I)  # first line by which spreadsheets state the separator
_DEEP_KEY = re.compile(rf"(?<![\w-])(?:[\w-]+[ \t]*\.[ \t]*){{{MOST_LEVELS}}}")


def opened(path: str | Path, what: str, largest: int) -> BinaryIO:
    """A user's file opened for reading: a regular file, whose kind is looked at once it is open."""
    path = checked_path(path, what)
    try:
        stream = open(path, "rb", opener=_at_once)  # noqa: SIM115 - the caller closes it
    except OSError as error:
        raise _refused(path, error, what) from error
    status = os.fstat(stream.fileno())
    wrong = ""
    if not stat.S_ISREG(status.st_mode):
        wrong = "is not a regular file"
    elif status.st_size > largest:
        wrong, what = f"has {status.st_size} bytes", f"{what} of at most {largest} bytes"
    if wrong:
        stream.close()
        raise InputError(f"{path} {wrong}; allowed: {what}")
    return stream


def _at_once(name: str, flags: int) -> int:
    """Open without waiting for somebody to write into a pipe."""
    return os.open(name, flags | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_NOCTTY", 0))


def _refused(path: Path, error: OSError, what: str) -> InputError:
    if isinstance(error, FileNotFoundError):
        return InputError(f"{path} does not exist; allowed: {what}")
    if str(path) == ".":  # what an empty name becomes
        return InputError(f"an empty name, or '.', is a folder; allowed: {what}")
    if isinstance(error, IsADirectoryError) or path.is_dir():
        return InputError(f"{path} is a folder; allowed: {what}")
    if error.errno == errno.ENXIO:  # a socket
        return InputError(f"{path} is not a regular file; allowed: {what}")
    return InputError(f"{str(path)[:200]!r} cannot be read ({error.strerror}); allowed: {what}")


def read_bytes(path: str | Path, what: str, largest: int = LARGEST_TEXT) -> bytes:
    """All of a user's file, at most `largest` bytes even if it grows while it is read."""
    with opened(path, what, largest) as stream:
        try:
            found = stream.read(largest + 1)
        except OSError as error:
            raise _refused(Path(path), error, what) from error
    if len(found) > largest:
        raise InputError(f"{path} has more than {largest} bytes; allowed: {what} of at most {largest} bytes")
    return found


def read_text(path: str | Path, what: str, largest: int = LARGEST_TEXT) -> str:
    """Text of a user's file."""
    try:
        text = read_bytes(path, what, largest).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(
            f"{path} is not text (byte {error.start} is not UTF-8); allowed: {what}, saved as UTF-8"
        ) from error
    if not text.strip():
        raise InputError(f"{path} is empty; allowed: {what}")
    return text


def read_json(path: str | Path, what: str) -> Any:
    """What a JSON file holds."""
    text = read_text(path, what)
    with suppress(ValueError, RecursionError):
        return json.loads(text)
    raise InputError(f"{path} {DAMAGED}; allowed: {what}")


def parse_toml(text: str, source: str, what: str) -> dict[str, Any]:
    """Tables of a TOML text."""
    if _DEEP_KEY.search(_QUOTED.sub("q", text)):  # the library's memory grows with the square of a key's parts
        raise InputError(f"{source} holds a key of more than {MOST_LEVELS} parts between dots; allowed: {what}")
    try:
        found = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        reason = parse_hint(text, str(error)) or f"allowed: {what}"
        raise InputError(f"{source} is not TOML: {str(error)[:200]}; {reason}") from error
    except (RecursionError, ValueError) as error:
        raise InputError(f"{source} holds values nested too deeply or too long; allowed: {what}") from error
    if (hint := control_hint(text, set(_with_controls(found)))) is not None:
        raise InputError(f"{source}, line {hint[0]}: {hint[1]}")
    return found


def _with_controls(value: Any) -> Iterator[str]:
    """Texts in tables and lists that hold a control character for which TOML has a letter."""
    if isinstance(value, str):
        if any(sign in value for sign in "\b\t\n\f\r"):
            yield value
    elif isinstance(value, dict | list):
        for item in value.values() if isinstance(value, dict) else value:
            yield from _with_controls(item)


def read_toml(path: str | Path, what: str) -> dict[str, Any]:
    """Tables of a user's TOML file."""
    return parse_toml(read_text(path, what), str(path), what)


def csv_rows(text: str, path: Path, what: str) -> list[tuple[int, list[str]]]:
    """Rows of a CSV text, its header among them, each with the number of its line; cells without spaces around them."""
    # Commas, semicolons or tabs separate columns; numbers come with a decimal point (`with_plain_numbers`). Lines that
    # start with `#` are comments. They are left out, and so are rows of separators alone, the line `sep=` and empty
    # columns at the end, as spreadsheets write.
    _check_extent(text, path, what)
    lines = [(number, line) for number, line in enumerate(text.splitlines(), 1) if line.strip(" ,;\t\ufeff")]
    lines = [(number, line) for number, line in lines if not line.lstrip(" \t\ufeff").startswith("#")]
    stated = _SEPARATOR_LINE.fullmatch(lines[0][1]) if lines else None
    separator = stated[1] if stated else separator_of([line for _, line in lines])
    lines = lines[1:] if stated else lines
    reader = csv.reader((f"{line}\n" for _, line in lines), strict=True, delimiter=separator)
    found: list[list[str]] = []
    numbers: list[int] = []
    first = 0
    try:
        for cells in reader:
            numbers.append(lines[first][0])
            found.append([cell.strip(_AROUND) for cell in cells])
            first = reader.line_num  # a cell in quotation marks may go over several lines
    except csv.Error as error:
        raise InputError(f"{path} is not CSV ({error}); allowed: {what}") from error
    return list(zip(numbers, with_plain_numbers(_without_empty_ends(found), separator), strict=True))


def _without_empty_ends(rows: list[list[str]]) -> list[list[str]]:
    """Rows without the columns at the end that are empty in all of them."""
    width = max((len(cells) for cells in rows), default=0)
    filled = max((place for cells in rows for place, cell in enumerate(cells, 1) if cell), default=0)
    return [cells[:filled] for cells in rows] if filled < width else rows


def _check_extent(text: str, path: Path, what: str) -> None:
    """Refuse a text that would make more rows or cells than fit into memory, before it is taken apart."""
    rows, cells = sum(map(text.count, _LINE_ENDS)), max(map(text.count, ",;\t"))
    if rows > 2 * MOST_ROWS or cells > MOST_CELLS:
        raise InputError(
            f"{path} has {rows} lines and {cells} commas; allowed: {what} of at most {MOST_ROWS} rows and "
            f"{MOST_CELLS} cells"
        )


_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d{1,3})?", re.ASCII)
_WITH_COMMA = re.compile(r"[+-]?\d*,\d+(?:[eE][+-]?\d{1,3})?", re.ASCII)
_WITH_POINT = re.compile(r"[+-]?\d*\.\d+(?:[eE][+-]?\d{1,3})?", re.ASCII)
_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2},\d{3}", re.ASCII)
_SEPARATORS = ",;\t"
_QUOTED_CELL = re.compile(r'"[^"]*"')


def number_in(text: str) -> float:
    """A cell's text as a decimal number; NaN for all else, such as `inf`, `1_000` or digits of other scripts."""
    plain = plain_minus(text)
    return float(plain) if _NUMBER.fullmatch(plain) else math.nan


def separator_of(lines: Sequence[str]) -> str:
    """The character between columns, by the first line that holds one: comma, semicolon or tab."""
    for line in lines:
        counts = [_QUOTED_CELL.sub("", line).count(mark) for mark in _SEPARATORS]
        if any(counts):
            return _SEPARATORS[counts.index(max(counts))]
    return ","


def with_plain_numbers(rows: Sequence[Sequence[str]], separator: str) -> list[list[str]]:
    """Cells in which numbers have a decimal point and an ASCII minus sign; other texts stay as they are."""
    # Commas in numbers are decimal where the whole table leaves no other reading: columns that semicolons or tabs
    # separate, or some comma that cannot mark thousands. No number may have a point then. Else they stay.
    found = [[cell if cell.isascii() else _with_plain_minus(cell) for cell in cells] for cells in rows]
    with_comma = [cell for cells in found for cell in cells if "," in cell and _WITH_COMMA.fullmatch(cell)]
    if not with_comma or (separator == "," and all(map(_THOUSANDS.fullmatch, with_comma))):
        return found
    if any(_WITH_POINT.fullmatch(cell) for cells in found for cell in cells if "." in cell):
        return found
    return [[cell.replace(",", ".") if _WITH_COMMA.fullmatch(cell) else cell for cell in cells] for cells in found]


def number_hint(text: str) -> str:
    """What to change in a text that looks like a number, for the end of a sentence; empty where it does not."""
    if re.fullmatch(r"[+-]?[\d.,' ]+(?:[eE][+-]?\d+)?", text, re.ASCII) and "," in text:
        return ", with a decimal point and without other marks"
    return ""


def _with_plain_minus(cell: str) -> str:
    plain = plain_minus(cell)
    return plain if _NUMBER.fullmatch(plain) or _WITH_COMMA.fullmatch(plain) else cell
