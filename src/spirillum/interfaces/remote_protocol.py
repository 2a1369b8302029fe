"""The line protocol of a remote at a serial port: how lines are written and read, and what the far end has to do.

Every line is ASCII, ``BODY*HH`` and a line feed, HH the exclusive or of the bytes of BODY in hexadecimal, as in
NMEA 0183. `docs/serial-remote.md` describes it. Nothing here knows a port.
"""

from __future__ import annotations

import math
from functools import reduce
from operator import xor

from spirillum.errors import InputError, clipped

__all__ = ["LONGEST_LINE", "WATCHDOG", "Receiver", "framed", "unframed"]

LONGEST_LINE = 80
"""Bytes of a line, its end included; what is longer is thrown away."""
WATCHDOG = 0.5
"""Without a valid command for so long the receiver switches the motor off, s."""


def framed(body: str) -> bytes:
    """A line with its checksum."""
    return f"{body}*{_checksum(body.encode('ascii')):02X}\n".encode("ascii")


def unframed(line: bytes) -> str | None:
    """The body of a line; None where it is damaged.

    Args:
        line: without its line feed.
    """
    body, star, checksum = line.rstrip(b"\r").rpartition(b"*")
    if not star or len(checksum) != 2 or checksum.upper() != f"{_checksum(body):02X}".encode():
        return None
    return body.decode("ascii", "replace")


def _checksum(body: bytes) -> int:
    return reduce(xor, body, 0)


class Receiver:
    """The far end: what a microcontroller beside the motor does. Its caller gives it the time."""

    def __init__(self, name: str = "spirillum", watchdog: float = WATCHDOG) -> None:
        """A motor that is off.

        Args:
            name: what it calls itself, without spaces.
            watchdog: time after which it switches off by itself, s.

        Raises:
            InputError: for a name that is no word, or a watchdog that is no positive time up to 10 s.
        """
        if not name.isprintable() or len(name.split()) != 1 or " " in name:
            raise InputError(f"name = {clipped(name)}; allowed: a word without spaces")
        if not 0.0 < watchdog <= 10.0:
            raise InputError(f"watchdog = {watchdog:g} s; allowed: above 0, at most 10 s")
        self.name, self.watchdog = name, watchdog
        self._duty, self._last_command, self._rest = 0.0, -math.inf, b""

    def duty(self, now: float) -> float:
        """Duty of the motor at a time, s; 0 once the last valid command is older than the watchdog allows."""
        return self._duty if now - self._last_command <= self.watchdog else 0.0

    def receive(self, data: bytes, now: float) -> bytes:
        """Take bytes as they come, and give the answer.

        Args:
            data: any piece of the stream.
            now: time, s.
        """
        *lines, self._rest = (self._rest + data).split(b"\n")
        if len(self._rest) > LONGEST_LINE:
            self._rest = self._rest[-LONGEST_LINE:]  # cannot become a valid line again
        return b"".join(self._answer(line, now) for line in lines if len(line) < LONGEST_LINE)

    def _answer(self, line: bytes, now: float) -> bytes:
        body = unframed(line)
        if body is None:
            return framed("NAK 0 damaged")
        verb, number, *words = [*body.split(" "), ""]
        if not (number.isascii() and number.isdigit() and len(number) <= 9):
            return framed("NAK 0 number")
        if verb == "WHO":
            return framed(f"WHO {number} {self.name} {round(1e3 * self.watchdog)}")
        duty = 0.0 if verb == "OFF" else _duty_of(words[0]) if verb == "DUTY" and words else None
        if duty is None:
            return framed(f"NAK {number} unknown")
        self._duty, self._last_command = duty, now
        return framed(f"ACK {number} {duty:.3f}")


def _duty_of(word: str) -> float | None:
    """A duty as the protocol writes it; None for anything else."""
    if not (len(word) == 5 and word[1] == "." and (word[0] + word[2:]).isdigit() and word.isascii()):
        return None
    duty = float(word)
    return duty if duty <= 1.0 else None
