"""Access control of the page: key, address, origin, and limits of connections and messages.

The server listens on the loopback interface by default, but every web page that a browser shows can send
requests there. So each request needs the key, a `Host` that is an address and not a foreign name (against
DNS rebinding), and, if the browser sends an `Origin`, this page's own.

The key is the first part of every path. A cookie would not do: cookies ignore ports, and a browser sends them to every
other server on this machine too.
"""

from __future__ import annotations

import asyncio
import ipaddress
import secrets
import socket
import time
from collections.abc import Mapping
from typing import Any

from uvicorn.protocols.http.auto import AutoHTTPProtocol

_MOST = 64  # connections without a key; for another one the oldest is closed
_PATIENCE = 10.0  # time after which a connection without a key is closed, s
_Address = tuple[str, int]


class Strangers:
    """Open connections without a key, the oldest first; used by the server's one thread."""

    def __init__(self, most: int = _MOST, patience: float = _PATIENCE) -> None:
        self._most, self._patience = most, patience
        self._waiting: dict[_Address, tuple[asyncio.BaseTransport, asyncio.TimerHandle]] = {}

    def greet(self, transport: asyncio.BaseTransport) -> None:
        """Begin to wait for the key of a connection."""
        address: _Address = transport.get_extra_info("peername")[:2]
        self.admit(address)  # the port of a connection that was closed comes again
        timer = asyncio.get_running_loop().call_later(self._patience, self._close, address)
        self._waiting[address] = transport, timer
        if len(self._waiting) > self._most:
            self._close(next(iter(self._waiting)))

    def admit(self, address: _Address | None) -> None:
        """Wait no longer: this connection has shown the key, or is closed."""
        if address in self._waiting:
            self._waiting.pop(address)[1].cancel()

    def _close(self, address: _Address) -> None:
        transport, timer = self._waiting.pop(address)
        timer.cancel()
        if isinstance(transport, asyncio.Transport):
            transport.abort()


def protocol_for(strangers: Strangers) -> type[asyncio.Protocol]:
    """Return the server's HTTP protocol, which reports every new connection."""

    class Reporting(AutoHTTPProtocol):  # type: ignore[misc, valid-type]  # which one it is follows from what is installed
        def connection_made(self, transport: Any) -> None:
            super().connection_made(transport)
            strangers.greet(transport)

        def connection_lost(self, exc: Exception | None) -> None:
            super().connection_lost(exc)
            strangers.admit(getattr(self, "client", None))

    return Reporting


HEADERS: Mapping[str, str] = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; media-src 'self' blob:; "
        "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}
"""Headers of every response."""
LARGEST_MESSAGE = 4096  #: Bytes of a message from a client.
_KEY_BYTES = 24


class Guard:
    """Checks of a request's credentials."""

    def __init__(self, host: str, port: int) -> None:
        self.key = secrets.token_urlsafe(_KEY_BYTES)
        self._port = port
        self._names = {"localhost", host.lower()}
        self._loopback = is_loopback(host)
        if not self._loopback:
            self._names.add(socket.gethostname().lower())

    def is_own_host(self, host: str) -> bool:
        """Whether a `Host` header names this server: by its port, and an address or a name that is its own."""
        name, colon, port = host.rpartition(":")
        if not colon or port != str(self._port):
            return False
        name = name.strip("[]").lower()
        if name in self._names:
            return True
        try:
            address = ipaddress.ip_address(name)
        except ValueError:
            return False
        return address.is_loopback if self._loopback else True

    def right_key(self, key: str) -> bool:
        """Whether it is the key, in constant time."""
        return secrets.compare_digest(key.encode(), self.key.encode())


def is_loopback(host: str) -> bool:
    """Whether an address is reached from this machine alone."""
    if host.lower() == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


class MessageRate:
    """So many messages a second, and some more at once."""

    def __init__(self, each_second: float, at_once: float) -> None:
        self._rate, self._most = each_second, at_once
        self._left, self._last = at_once, time.monotonic()

    def allowed(self) -> bool:
        """Count one message; False if it is too many."""
        now = time.monotonic()
        self._left = min(self._most, self._left + (now - self._last) * self._rate)
        self._last = now
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True
