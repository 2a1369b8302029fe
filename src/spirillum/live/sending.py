"""One JSON object a line, as text or as UDP datagrams."""

from __future__ import annotations

import json
import socket
from collections.abc import Mapping
from typing import Any

from spirillum.errors import InputError
from spirillum.notes import Note

_LOOPBACK = "127.0.0.1"
_DIGITS = 5
_WHAT = "PORT or HOST:PORT, a port from 1 to 65535; without a host, this computer"


def line_of(answer: Mapping[str, Any]) -> str:
    """An answer as JSON in one line; refuses NaN."""
    return json.dumps(answer, allow_nan=False, ensure_ascii=False, separators=(",", ":"))


class Datagrams:
    """Sends each line as one datagram; a lost one is not repeated, as the next one is newer."""

    def __init__(self, address: str) -> None:
        """Find the receiver."""
        host, colon, port = address.rpartition(":")
        number = port.isascii() and port.isdigit() and len(port) <= _DIGITS
        if not number or not 1 <= int(port) <= 65535 or (colon and not host):
            raise InputError(f"udp = {address[:60]!r}; allowed: {_WHAT}")
        try:
            found = socket.getaddrinfo(host.strip("[]") or _LOOPBACK, int(port), type=socket.SOCK_DGRAM)[0]
        except (OSError, UnicodeError) as error:  # the latter for a name that can be none
            raise InputError(f"udp = {address[:60]!r}: the host is not known ({error}); allowed: {_WHAT}") from error
        self._socket, self._to = socket.socket(found[0], socket.SOCK_DGRAM), found[4]
        self._address, self._lines, self._unsent, self._reason = address, 0, 0, ""

    def send(self, line: str) -> None:
        """Send a line."""
        self._lines += 1
        try:
            self._socket.sendto(line.encode(), self._to)
        except OSError as error:
            self._unsent, self._reason = self._unsent + 1, error.strerror or str(error)

    @property
    def notes(self) -> tuple[Note, ...]:
        """A sentence if the network took some of the lines not."""
        if not self._unsent:
            return ()
        words = f"udp = {self._address}: {self._unsent} of {self._lines} lines could not be sent ({self._reason})"
        return (Note("lines-not-sent", words, ("udp",)),)

    def close(self) -> None:
        """No more lines."""
        self._socket.close()
