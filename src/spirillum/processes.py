"""Work shared out among processes, answers as they come."""

from __future__ import annotations

import multiprocessing
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import get_context
from types import ModuleType
from typing import TypeVar

from spirillum.errors import InputError

__all__ = ["as_they_come"]

_Task = TypeVar("_Task")
_Answer = TypeVar("_Answer")


def as_they_come(
    work: Callable[[_Task], _Answer], tasks: Sequence[_Task], workers: int, *, besides: str = ""
) -> Iterator[tuple[_Task, _Answer]]:
    """Tasks with their answers: in order from this process, in any order from several.

    Args:
        work: what is done; a function of a module of this package.
        tasks: what it is done to; they can be pickled.
        workers: number of processes; 1: this one.
        besides: what the sentence of an error says at its end, such as what is kept.

    Raises:
        InputError: if a process was ended from outside.
    """
    if workers == 1 or len(tasks) < 2:
        for task in tasks:
            yield task, work(task)
        return
    pool = ProcessPoolExecutor(min(workers, len(tasks)), mp_context=get_context("spawn"))
    try:
        with _no_main():
            waiting = {pool.submit(work, task): task for task in tasks}
        for future in as_completed(waiting):
            yield waiting[future], future.result()
    except BrokenProcessPool as error:
        raise InputError(
            f"a process of {workers} was ended from outside, as for want of memory; allowed: workers = 1, or more "
            f"memory{besides}"
        ) from error
    except BaseException:
        for process in multiprocessing.active_children():
            process.terminate()  # what they were at is lost, what was answered is not
        raise
    finally:
        pool.shutdown(wait=False, cancel_futures=True)


@contextmanager
def _no_main() -> Iterator[None]:
    """Processes that are started here do not run the caller's script again: what they do is in this package."""
    own = sys.modules["__main__"]
    sys.modules["__main__"] = ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = own
