"""Reading ahead: the next items are made by a thread while the last ones are worked on."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from queue import Full, Queue
from threading import Event, Thread
from typing import TypeVar

__all__ = ["ahead"]

T = TypeVar("T")


def ahead(items: Iterator[T], count: int) -> Iterator[T]:
    """Items of an iterable, taken by a thread of its own before they are asked for.

    Args:
        items: where they come from; what it raises is raised where the items are asked for.
        count: how many may wait at most.
    """
    queue: Queue[T | BaseException | None] = Queue(count)
    left = Event()

    def put(item: T | BaseException | None) -> None:
        while not left.is_set():
            with suppress(Full):
                queue.put(item, timeout=0.2)
                return

    def read() -> None:
        try:
            for item in items:
                put(item)
                if left.is_set():
                    return
            put(None)
        except BaseException as error:  # handed over to the thread that asked
            put(error)

    thread = Thread(target=read, name="decoding", daemon=True)
    thread.start()
    try:
        while (item := queue.get()) is not None:
            if isinstance(item, BaseException):
                raise item
            yield item
    finally:
        left.set()
        thread.join()
