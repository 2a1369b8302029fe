"""What the files of a video say of themselves, such as that they are synthetic."""

from __future__ import annotations

import sys
from contextlib import suppress
from pathlib import Path

from spirillum.errors import InputError
from spirillum.files import opened, read_bytes
from spirillum.files.limits import LARGEST_PICTURE

_MOST_WORDS = 2000


def words_of_images(folder: Path, image: Path) -> str:
    """Texts in a PNG file, and of a README in its folder or beside it."""
    found = []
    if image.suffix.lower() == ".png":
        data = read_bytes(image, "an image", LARGEST_PICTURE)
        at = 8
        while at + 8 <= len(data):
            length, kind = int.from_bytes(data[at : at + 4], "big"), data[at + 4 : at + 8]
            if kind in (b"tEXt", b"iTXt"):
                found.append(data[at + 8 : at + 8 + min(length, _MOST_WORDS)].decode("utf-8", "replace"))
            at += 12 + length
    for place in (folder, folder.parent):
        for name in ("README", "README.txt", "README.md"):
            with suppress(InputError), opened(place / name, "a text", sys.maxsize) as file:
                found.append(file.read(_MOST_WORDS).decode("utf-8", "replace"))
    return one_line(" ".join(found))


def stated_size(image: Path) -> tuple[int, int] | None:
    """Width and height that a PNG file states at its start, pixels; None for any other file."""
    with suppress(InputError), opened(image, "an image", LARGEST_PICTURE) as file:
        start = file.read(24)
        if start[:8] == b"\x89PNG\r\n\x1a\n" and start[12:16] == b"IHDR" and len(start) == 24:
            return int.from_bytes(start[16:20], "big"), int.from_bytes(start[20:24], "big")
    return None


def one_line(text: str) -> str:
    """A text of a user's file in one line."""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())[:_MOST_WORDS]
