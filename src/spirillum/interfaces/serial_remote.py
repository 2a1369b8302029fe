"""The remote at a serial port: duties that go out, are confirmed, and end with the motor off; and a virtual far end.

The line protocol of a remote at a serial port: how lines are written and read, and what the far end has to do.
Every line is ASCII, ``BODY*HH`` and a line feed, HH the exclusive or of the bytes of BODY in hexadecimal, as in
NMEA 0183. `docs/serial-remote.md` describes it. Nothing here knows a port.
"""

from __future__ import annotations

import math
import os
import select
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import reduce
from operator import xor
from typing import Any, Self

from spirillum.argument_validation import as_duty, as_number, validate_arguments
from spirillum.display import DisplayMixin
from spirillum.errors import InputError, check_range, clipped
from spirillum.optional_dependencies import import_optional
from spirillum.units import KINDS, as_given, parse_option

LONGEST_LINE = 80  #: Bytes of a line, its end included; what is longer is thrown away.
WATCHDOG = 0.5  #: Without a valid command for so long the receiver switches the motor off, s.


def framed(body: str) -> bytes:
    """A line with its checksum."""
    return f"{body}*{_checksum(body.encode('ascii')):02X}\n".encode("ascii")


def unframed(line: bytes) -> str | None:
    """The body of a line; None where it is damaged."""
    body, star, checksum = line.rstrip(b"\r").rpartition(b"*")
    if not star or len(checksum) != 2 or checksum.upper() != f"{_checksum(body):02X}".encode():
        return None
    return body.decode("ascii", "replace")


def _checksum(body: bytes) -> int:
    return reduce(xor, body, 0)


class Receiver:
    """The far end: what a microcontroller beside the motor does. Its caller gives it the time."""

    def __init__(self, name: str = "spirillum", watchdog: float = WATCHDOG) -> None:
        """A motor that is off."""
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
        """Take bytes as they come, and give the answer."""
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


_BAUD = 115_200
_FASTEST = 100_000_000
_PATIENCE = 0.15  # time in which an answer has to come, s: three tries end before the far end's watchdog does
_TRIES = 3
_REPEAT = 0.1  # time after which a duty that is held is sent again, s
_LONGEST_HOLD = 86_400.0


class SerialRemote:
    """A remote at a serial port; leaving its `with` block switches the motor off, whatever happened inside."""

    @validate_arguments
    def __init__(self, port: str, *, baud: int = _BAUD) -> None:
        """Open the port, and request the name of the far end.

        Args:
            port: such as ``/dev/ttyUSB0`` or ``COM3``.
            baud: symbols a second.

        Raises:
            InputError: for wrong input, if pyserial is missing, the port is not there or is in use, or nobody answers.
        """
        serial = import_optional("serial", "a remote at a serial port", "control")
        check_range("baud", baud, 1, _FASTEST)
        self.port = str(port)  #: The port.
        self._gone: tuple[type[Exception], ...] = (serial.SerialException, OSError, TypeError)
        self._number, self._rest = 0, b""  # of the last command; bytes of a line that has not ended
        try:
            self._line: Any = serial.Serial(
                self.port, baud, timeout=0.02, write_timeout=_PATIENCE, exclusive=True if os.name == "posix" else None
            )
        except (*self._gone, ValueError) as error:
            raise InputError(f"{self.port[:80]} cannot be opened ({_reason(error)}); allowed: {_ports()}") from error
        try:
            answer = self._request("WHO").split(" ")
            self.name = "".join(letter for letter in answer[2] if letter.isprintable())[:40]
            self.watchdog = _number_in(answer[3], 1e4) * 1e-3
        except InputError:
            self._line.close()
            raise
        except (IndexError, ValueError) as error:
            self._line.close()
            raise InputError(f"{self.port[:80]} answers as no remote does; allowed: another port") from error

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def send(self, duty: float) -> float:
        """Set the duty of the motor; the watchdog switches it off after its time unless a duty is sent again.

        Args:
            duty: 0 (off) to 1.

        Returns:
            The duty as the far end has taken it, in steps of 0.001.

        Raises:
            InputError: for what is no duty (nothing is then sent), an unplugged port, or no answer.
        """
        answer = self._request("DUTY", f" {as_duty(duty):.3f}")
        try:
            return _number_in(answer.split(" ")[2], 1.0)
        except ValueError as error:
            raise InputError(f"{self.port[:80]} answers as no remote does; allowed: another port") from error

    def hold(self, duty: float, duration: float, told: Callable[[float], None] | None = None) -> None:
        """Keep a duty for a time, sent again every tenth of a second; then the motor is off.

        Args:
            duty: 0 to 1.
            duration: s.
            told: told how long it has been on, s.

        Raises:
            InputError: for what is no duty or no time, an unplugged port, or no answer.
        """
        _check_length(duration)
        start = time.monotonic()
        try:
            while (passed := time.monotonic() - start) < duration:
                self.send(duty)
                if told is not None:
                    told(passed)
                time.sleep(max(0.0, min(_REPEAT, duration - (time.monotonic() - start))))
        finally:
            self._off()

    def off(self) -> None:
        """Switch the motor off.

        Raises:
            InputError: for an unplugged port, or no answer.
        """
        self._request("OFF")

    def close(self) -> None:
        """Switch the motor off and leave the port; a port that is gone is left, and the watchdog does the rest."""
        self._off()
        with suppress(*self._gone):
            self._line.close()

    def _off(self) -> None:
        with suppress(InputError):
            if self._line.is_open:
                self.off()

    def _request(self, verb: str, more: str = "") -> str:
        """Send a command until it is answered, and give the answer."""
        self._number = self._number % 999_999_999 + 1
        line, wanted = framed(f"{verb} {self._number}{more}"), "WHO" if verb == "WHO" else "ACK"
        try:
            for _ in range(_TRIES):
                self._line.write(line)
                answer = self._answer(wanted)
                if answer is not None:
                    return answer
        except self._gone as error:
            raise InputError(
                f"{self.port[:80]} is gone ({_reason(error)}): the remote's watchdog switches the motor off; allowed: "
                "to plug it in again"
            ) from error
        raise InputError(
            f"{self.port[:80]} does not answer {verb} within {_TRIES * _PATIENCE:g} s: the remote's watchdog switches "
            "the motor off; allowed: a remote that speaks the protocol of docs/serial-remote.md"
        )

    def _answer(self, wanted: str) -> str | None:
        """The answer to the last line; None where none comes in time."""
        end = time.monotonic() + _PATIENCE
        while time.monotonic() < end:
            received = self._line.read(max(1, min(self._line.in_waiting, LONGEST_LINE)))
            *lines, self._rest = (self._rest + received).split(b"\n")
            self._rest = self._rest[-LONGEST_LINE:]
            for body in filter(None, map(unframed, lines)):
                if body.startswith(f"{wanted} {self._number} "):
                    return body
        return None


def _check_length(duration: Any) -> None:
    if not 0.0 < as_number(duration) <= _LONGEST_HOLD:
        raise InputError(f"duration = {as_given(duration, 's')}; allowed: above 0 s, at most {_LONGEST_HOLD:g} s")


def _number_in(word: str, high: float) -> float:
    """A number of an answer."""
    number = float(word)
    if not 0.0 <= number <= high:
        raise ValueError(word)
    return number


def _reason(error: Exception) -> str:
    return " ".join(str(getattr(error, "strerror", None) or error).split())[:100]


def _ports() -> str:
    from serial.tools.list_ports import comports

    found = sorted(str(item.device) for item in comports())
    return ", ".join(found[:8]) if found else "a serial port, of which this machine has none now"


@dataclass(frozen=True, repr=False)
class RemoteRun(DisplayMixin):
    """A motor that was on for a time, through a remote."""

    port: str  #: The port.
    name: str  #: What the far end calls itself.
    duty: float  #: Duty of the motor, in steps of 0.001.
    duration: float  #: How long it was on, s.
    watchdog: float  #: Time after which the far end switches off by itself, s.


def remote(port: str, *, duty: float = 1.0, duration: str | float = 1.0, baud: int = _BAUD) -> RemoteRun:
    """Switch a motor on through a remote at a serial port, for a time; then it is off. Needs the extra `control`.

    Args:
        port: such as ``/dev/ttyUSB0`` or ``COM3``.
        duty: duty of the motor, 0 to 1.
        duration: how long it is on, with its unit or a float in s.
        baud: symbols a second.

    Raises:
        InputError: for wrong input, a port that is not there, in use or unplugged, or a remote that does not answer.
    """
    length = parse_option("duration", duration, KINDS["time"])
    on = as_duty(duty)
    _check_length(length)
    with SerialRemote(port, baud=baud) as far_end:
        far_end.hold(on, length)
        return RemoteRun(far_end.port, far_end.name, round(on, 3), length, far_end.watchdog)


class VirtualRemote:
    """A remote without hardware: a pseudo-terminal with a receiver behind it, to try programs on; not on Windows."""

    @validate_arguments
    def __init__(self, name: str = "virtual", watchdog: float = WATCHDOG) -> None:
        """Open a pseudo-terminal.

        Args:
            name: what the remote calls itself.
            watchdog: time after which it switches off by itself, s.

        Raises:
            InputError: where the system has no pseudo-terminals.
        """
        if not hasattr(os, "openpty"):
            raise InputError("this system has no pseudo-terminals; allowed: Linux or macOS, or a real port")
        import tty

        self.receiver = Receiver(name, watchdog)  #: What is behind the port.
        self._near, self._far = os.openpty()
        tty.setraw(self._far)
        self.port = os.ttyname(self._far)  #: Port of the remote.
        self.deaf = False  #: Whether it hears nothing, as one out of reach.
        self._plugged = True
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.unplug()

    @property
    def duty(self) -> float:
        """Duty of the motor now."""
        return self.receiver.duty(time.monotonic())

    def unplug(self) -> None:
        """Take the port away."""
        if self._plugged:
            self._plugged = False
            self._thread.join()
            os.close(self._far)
            os.close(self._near)

    def _listen(self) -> None:
        while self._plugged:
            ready, _, _ = select.select([self._near], [], [], 0.01)
            if ready:
                with suppress(OSError):
                    data = os.read(self._near, 4096)
                    if not self.deaf:
                        os.write(self._near, self.receiver.receive(data, time.monotonic()))
