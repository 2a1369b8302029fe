"""Blocking work of a request in a thread of its own, for which nobody waits when the page ends."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from contextlib import suppress
from threading import Thread
from typing import Any, TypeVar

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
