"""Connections that have not shown the key yet: a limited number for a limited time, so that they lock nobody out."""

from __future__ import annotations

import asyncio
from typing import Any

from uvicorn.protocols.http.auto import AutoHTTPProtocol

_MOST = 64
"""Connections without a key; for another one the oldest is closed."""
_PATIENCE = 10.0
"""Time after which a connection without a key is closed, s."""
_Address = tuple[str, int]


class Strangers:
    """Open connections without a key, the oldest first; used by the server's one thread."""

    def __init__(self, most: int = _MOST, patience: float = _PATIENCE) -> None:
        """No connection yet.

        Args:
            most: connections without a key that are open at once.
            patience: time in which a connection has to show the key, s.
        """
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
