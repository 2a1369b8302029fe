"""Work shared out among processes, answers as they come."""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from itertools import islice
from multiprocessing import get_context
from pathlib import Path
from threading import Thread
from types import ModuleType
from typing import TypeVar

from spirillum.errors import InputError

AHEAD = 3
"""Tasks that wait or are answered for each process: what is sent ahead and what is not yet taken stays in memory."""

_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
_Task = TypeVar("_Task")
_Answer = TypeVar("_Answer")


def imap_unordered(
    work: Callable[[_Task], _Answer], tasks: Iterable[_Task], workers: int, *, besides: str = "", single: bool = False
) -> Iterator[tuple[_Task, _Answer]]:
    """Tasks with their answers: in order from this process, in any order from several.

    Args:
        work: what is done; a function of a module of this package.
        tasks: what it is done to; they can be pickled. They are taken as they are needed.
        workers: number of processes; 1: this one.
        besides: what the sentence of an error says at its end, such as what is kept.
        single: whether every process keeps to one thread.
    """
    ahead = iter(tasks)
    first = list(islice(ahead, AHEAD * workers))
    if workers == 1 or len(first) < 2:
        for task in (*first, *ahead):
            yield task, work(task)
        return
    pool = ProcessPoolExecutor(
        min(workers, len(first)), mp_context=get_context("spawn"), initializer=_begin, initargs=(single,)
    )
    try:
        waiting: dict[Future[_Answer], _Task] = {}
        with _no_main():
            with _interrupts_held():  # the pool starts all its processes here
                waiting[pool.submit(work, first[0])] = first[0]
            for task in first[1:]:
                waiting[pool.submit(work, task)] = task
        while waiting:
            done, _ = wait(waiting, return_when=FIRST_COMPLETED)
            for future in done:
                with _no_main():
                    for task in islice(ahead, 1):
                        waiting[pool.submit(work, task)] = task
                task = waiting.pop(future)
                yield task, future.result()
            del done, future  # they hold the answers
        pool.shutdown()
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


def memory_in_use() -> float:
    """Memory of this process, bytes; 0 where the system does not report it."""
    try:
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    except (OSError, ValueError, IndexError):
        return 0.0
    return float(pages * os.sysconf("SC_PAGE_SIZE"))


def _begin(single: bool) -> None:  # noqa: FBT001 - called by the pool
    """Start of a worker process: it ends with its parent, and uses one thread where requested."""
    Thread(target=_end_with_parent, daemon=True).start()
    if single:  # for libraries that are loaded from here on
        os.environ.update(dict.fromkeys(_THREADS, "1"))


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)  # what it was at is lost, and nobody waits for more


@contextmanager
def _interrupts_held() -> Iterator[None]:
    """Processes that are started here never see Ctrl-C, which a terminal sends to them too: their parent ends them."""
    if not hasattr(signal, "pthread_sigmask"):  # pragma: no cover - Windows
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _no_main() -> Iterator[None]:
    """Processes that are started here do not run the caller's script again: what they do is in this package."""
    own = sys.modules["__main__"]
    sys.modules["__main__"] = ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = own
