"""Frequent mistakes in TOML files, with their remedies: Windows paths, typographic signs, numbers with bare units."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator

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
    """The likely reason why a text is not TOML, as the end of a sentence; empty where none is known.

    Args:
        text: the file.
        message: of the parser, which names a line.
    """
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
    """Line and remedy of the first Windows path whose backslashes TOML has read as control characters.

    Args:
        text: the file.
        values: its texts that hold control characters, as TOML reads them.
    """
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
