"""What is sent to the page: its size is stated first, and held against what all of it together may have."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from starlette.requests import Request

from spirillum.errors import InputError

_LARGEST_TOGETHER = 128 << 20
"""Bytes of all files and messages that are held in memory at once. Films go to the disk."""


class TooLargeError(InputError):
    """More is sent than there is room for."""


def stated_size(request: Request) -> int:
    """Bytes that a request is about to send; the server takes no more of it."""
    size = request.headers.get("content-length", "")
    if not size.isdecimal():
        raise InputError("a request without its size; allowed: one with a Content-Length")
    return int(size)


class Uploads:
    """Files and messages from when they are announced until they are read; used by the server's one thread."""

    def __init__(self) -> None:
        """Nothing is sent yet."""
        self._left = _LARGEST_TOGETHER

    @asynccontextmanager
    async def received(self, request: Request, largest: int) -> AsyncIterator[bytes]:
        """What a request sends, counted until the block ends.

        Raises:
            TooLargeError: if it is too large, by itself or with all that others are sending.
            InputError: if it does not state its size.
        """
        size = stated_size(request)
        if size > largest:
            raise TooLargeError(f"{size} bytes are too much; allowed: {largest} bytes")
        if size > self._left:
            raise TooLargeError(
                f"too much is sent at once; allowed: {_LARGEST_TOGETHER >> 20} MB in all, so try again soon"
            )
        self._left -= size
        try:
            yield await request.body()
        finally:
            self._left += size
