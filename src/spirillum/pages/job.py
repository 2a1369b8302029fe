"""Background work of the page: threads for blocking calls, processes that report progress in lines of JSON."""

from __future__ import annotations

import asyncio
import json
import os
import subprocess
import sys
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from threading import Thread
from typing import Any, TypeVar

from spirillum.errors import InputError, failure_sentence
from spirillum.pages.knobs import report_fault
from spirillum.progress import Progress

_Answer = TypeVar("_Answer")


async def run_in_background(work: Callable[..., _Answer], *arguments: Any) -> _Answer:
    """Return what a function returns, computed in a daemon thread.

    The threads of `asyncio.to_thread` are joined when the loop closes: a film that is being searched would keep the
    process alive for as long as it takes.

    Raises:
        BaseException: what the function raises.
    """
    loop = asyncio.get_running_loop()
    future: asyncio.Future[_Answer] = loop.create_future()

    def settle(setter: Callable[[Any], None], value: Any) -> None:
        if not future.done():  # done: cancelled, for the page ends
            setter(value)

    def run() -> None:
        outcome: tuple[Callable[[Any], None], Any]
        try:
            outcome = future.set_result, work(*arguments)
        except BaseException as error:
            outcome = future.set_exception, error
        with suppress(RuntimeError):  # the loop is closed
            loop.call_soon_threadsafe(settle, *outcome)

    Thread(target=run, name="page: request", daemon=True).start()
    return await future


class BackgroundJob:
    """Running module: its last progress message, and its state."""

    def __init__(self, module: str, request: Mapping[str, Any], announce: Callable[[], None] = lambda: None) -> None:
        self._tell, self._stopped = announce, False
        self._said: dict[str, Any] = {"what": "starting", "done_places": 0, "places": 0}
        self._process = subprocess.Popen(  # noqa: S603 - our own module, nothing from outside in the arguments
            [sys.executable, "-m", module],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            start_new_session=True,  # Ctrl-C in the terminal is for the page, which stops it
        )
        self._thread = threading.Thread(target=self._follow, args=(json.dumps(request),), name="page: job", daemon=True)
        self._thread.start()

    @property
    def running(self) -> bool:
        """Whether it is still running."""
        return self._thread.is_alive()

    def progress(self) -> dict[str, Any]:
        """Current stage, `done_places` of `places`; `done`, or `failed` with a sentence, at the end."""
        return dict(self._said)

    def stop(self) -> None:
        """Leave off."""
        self._stopped = True
        self._process.terminate()

    def _follow(self, request: str) -> None:
        assert self._process.stdin is not None and self._process.stdout is not None  # noqa: S101, PT018
        with suppress(BrokenPipeError):
            self._process.stdin.write(request)
            self._process.stdin.close()
        with self._process.stdout as lines:
            for line in lines:
                with suppress(ValueError, TypeError):  # what a library prints is no progress
                    self._said = dict(json.loads(line))
                self._tell()
        if self._process.wait() != 0 and "failed" not in self._said:
            lost = "the process was ended from outside, as for want of memory; allowed: a smaller request"
            self._said = {"failed": "it was left off" if self._stopped else lost}
        self._tell()


def worker(work: Callable[[dict[str, Any], Progress], Mapping[str, Any]]) -> None:
    """Run the task of standard input and report its progress."""
    # The process ends with 2 where the input was wrong or asks for too much, and with 1 after a fault of the program.

    def announce(**said: Any) -> None:
        try:
            sys.stdout.write(json.dumps(said) + "\n")
            sys.stdout.flush()
        except BrokenPipeError:  # the page was killed; what is not said yet goes nowhere
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            sys.exit(1)

    def progress(what: str, done: int, total: int) -> None:
        announce(what=what, done_places=done, places=total)

    try:
        found = work(json.loads(sys.stdin.read()), progress)
    except Exception as error:  # the client gets the reason
        report_fault(error)
        announce(failed=failure_sentence(error))
        sys.exit(2 if isinstance(error, (InputError, MemoryError)) else 1)
    announce(done=True, **found)
