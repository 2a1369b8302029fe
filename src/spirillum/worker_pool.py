"""Work shared among processes: on this machine, or by the workers of a Dask cluster.

Answers come back to this process, which alone writes. The task of a worker that is killed is lost, and another one
does it again; where client or scheduler are killed, what was answered is kept, and the same call goes on from there.
"""

from __future__ import annotations

import logging
import multiprocessing
import os
import re
import signal
import sys
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, ThreadPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from hashlib import sha256
from itertools import islice
from multiprocessing import get_context
from pathlib import Path
from statistics import fmean
from threading import Lock, Thread, current_thread, main_thread
from time import monotonic, perf_counter, thread_time
from types import ModuleType
from typing import Any, Generic, TypeVar

from spirillum.errors import InputError
from spirillum.optional_dependencies import import_optional
from spirillum.version import package_version, versions

AHEAD = 3  #: Tasks that wait or are answered for each process: what is sent ahead or not yet taken stays in memory.

_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
_Task = TypeVar("_Task")
_Answer = TypeVar("_Answer")


def imap_unordered(
    work: Callable[[_Task], _Answer], tasks: Iterable[_Task], workers: int, *, besides: str = "", single: bool = False
) -> Iterator[tuple[_Task, _Answer]]:
    """Tasks with their answers: in order from this process, in any order from several."""
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
        with _start_of_processes():
            for task in first:
                waiting[pool.submit(work, task)] = task
        while waiting:
            done, _ = wait(waiting, return_when=FIRST_COMPLETED)
            for future in done:
                with _start_of_processes():
                    for task in islice(ahead, 1):
                        waiting[pool.submit(work, task)] = task
                task = waiting.pop(future)
                yield task, future.result()
            del done, future  # they hold the answers
        pool.shutdown()
    except BaseException as error:
        _give_up(pool, multiprocessing.active_children())  # what was answered is not lost
        if isinstance(error, BrokenProcessPool):
            raise InputError(
                f"a process of {workers} was ended from outside, as for want of memory; allowed: workers = 1, or more "
                f"memory{besides}"
            ) from error
        raise


def _give_up(pool: ProcessPoolExecutor, processes: Iterable[multiprocessing.process.BaseProcess]) -> None:
    """End a pool and its processes, whatever they are at."""
    thread = getattr(pool, "_executor_manager_thread", None)
    pool.shutdown(wait=False, cancel_futures=True)  # first: its thread fails at tasks that are cancelled later
    for process in processes:
        process.terminate()
    if thread is not None:  # else it may close its pipe while the end of the interpreter writes to it
        thread.join()


@contextmanager
def process_beside(start: Callable[[], object]) -> Iterator[ProcessPoolExecutor | None]:
    """A process beside this one that runs `start`, such as imports, at once; it ends with the block."""
    # None where other work leaves no core for it: its imports would take longer than what it does.
    if slowdown(2) > BUSY:
        yield None
        return
    pool = ProcessPoolExecutor(1, mp_context=get_context("spawn"), initializer=_begin, initargs=(True,))
    before = set(multiprocessing.active_children())
    try:
        with _start_of_processes():
            pool.submit(start)
        yield pool
    finally:
        _give_up(pool, set(multiprocessing.active_children()) - before)


BUSY = 1.5  #: Slowdown by other work from which on a machine counts as busy.
_MOMENT = 0.05  # time for which the slowdown is measured, s
_BLOCK = bytes(1 << 20)


def slowdown(workers: int) -> float:
    """Measure for a moment how many times longer so many threads take for their work now than on free cores."""
    with ThreadPoolExecutor(workers) as pool:
        return fmean(pool.map(_slowdown_of_thread, range(workers)))


def _slowdown_of_thread(_: int) -> float:
    wall, own = perf_counter(), thread_time()
    while perf_counter() - wall < _MOMENT:
        sha256(_BLOCK)  # without the lock of the interpreter
    return max((perf_counter() - wall) / max(thread_time() - own, 1e-3), 1.0)


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
def _start_of_processes() -> Iterator[None]:
    """Tasks are handed to the pool here, and any of them may start a process."""
    # It does not run the caller's script again, for what it does is in this package; and it never sees Ctrl-C, which a
    # terminal sends to it too: its parent ends it. The parent sees signals once the process has what it starts from;
    # blocking them in this thread is not enough for that, as another thread may take them.
    own = sys.modules["__main__"]
    sys.modules["__main__"] = ModuleType("__main__")
    held = hasattr(signal, "pthread_sigmask")  # not on Windows
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT}) if held else set()
    caught: list[int] = []
    endings = (signal.SIGINT, signal.SIGTERM) if current_thread() is main_thread() else ()
    handlers = {ending: handler for ending in endings if callable(handler := signal.getsignal(ending))}
    for ending in handlers:
        signal.signal(ending, lambda number, _frame: caught.append(number))
    try:
        yield
    finally:
        sys.modules["__main__"] = own
        for ending, handler in handlers.items():
            signal.signal(ending, handler)
        if held:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
        if caught:
            handlers[signal.Signals(caught[0])](caught[0], None)


ESTIMATE = "estimate: "  #: Prefix of a progress message that estimates the work: a command prints it on its own line.
_ADDRESS = re.compile(r"(tcp|tls|ucx|ws|wss|inproc)://\S{1,200}")
_PATIENCE = 5.0  # time in which a scheduler has to answer, s
_LOOK = 1.0  # time between two looks whether the scheduler is still there, s
_LONGEST_TRANSFER = 120.0  # time in which an answer has to come from the worker that has it, s
_MOST_DEATHS = 100  # tasks given up because several workers ended at them before the tasks are taken for the cause
_MOST_WORKERS = 64
_alone = Lock()
Tell = Callable[[str], None]


@dataclass(frozen=True)
class WorkerPool:
    """Workers: processes of this machine, or those of a cluster."""

    workers: int = 1
    cluster: str | None = None  #: Address of a Dask scheduler; None: this machine.

    @property
    def size(self) -> int:
        """Number of workers; by default those of the cluster."""
        if self.cluster is None:
            return self.workers
        with _client(self.cluster) as client:
            return len(_workers(client, self.cluster))

    def check(self) -> None:
        """Check that the workers are there, before anything is written."""
        if self.cluster is not None:
            _ = self.size


def pool_of_workers(workers: int, cluster: str | None) -> WorkerPool:
    """A pool of so many workers, or of those of a cluster."""
    if not 1 <= workers <= _MOST_WORKERS:
        raise InputError(f"workers = {str(workers)[:40]}; allowed: a whole number of 1 to {_MOST_WORKERS}")
    if cluster is not None and not _ADDRESS.fullmatch(cluster):
        raise InputError(
            f"cluster = {str(cluster)[:80]!r}; allowed: the address of a Dask scheduler, as tcp://192.168.1.5:8786"
        )
    return WorkerPool(workers, cluster)


def map_tasks(
    work: Callable[[_Task], _Answer],
    tasks: Iterable[_Task],
    pool: WorkerPool,
    *,
    besides: str = "",
    on_progress: Tell | None = None,
) -> Iterator[tuple[_Task, _Answer]]:
    """Tasks with their answers, in any order but from this process alone."""
    if pool.cluster is None:
        yield from imap_unordered(work, tasks, pool.workers, besides=besides, single=True)
        return
    with _client(pool.cluster) as client:
        _workers(client, pool.cluster)
        yield from _on_cluster(_Hand(client, work, tasks, on_progress or (lambda _: None)), pool.cluster, besides)


def _client(address: str) -> Any:
    distributed = import_optional("distributed", "a study on a cluster", "cluster")
    for name in ("distributed", "distributed.core", "distributed.client", "distributed.comm"):
        logging.getLogger(name).setLevel(logging.CRITICAL)  # what is lost is said in a sentence
    try:
        return distributed.Client(address, timeout=_PATIENCE)
    except (OSError, TimeoutError, ValueError, TypeError, RuntimeError) as error:
        raise InputError(
            f"cluster = {address!r}: no scheduler answers there within {_PATIENCE:g} s; allowed: the address of a Dask "
            "scheduler that runs, as tcp://192.168.1.5:8786"
        ) from error


def _about() -> tuple[str, str]:
    return package_version(), versions()


def _workers(client: Any, address: str) -> list[str]:
    """Workers of a cluster, all of which can do the work."""
    known = client.scheduler_info(n_workers=-1)["workers"]
    if not known:
        raise InputError(f"cluster = {address!r} has no workers; allowed: one that has, by `dask worker {address}`")
    many = next((name for name, item in known.items() if item["nthreads"] > 1), None)
    if many is not None:
        raise InputError(
            f"cluster = {address!r}: worker {many} has {known[many]['nthreads']} threads; allowed: workers of one "
            "thread (`dask worker --nworkers auto --nthreads 1`)"
        )
    try:
        found = client.run(_about, on_error="return")
    except (OSError, TimeoutError) as error:
        raise _lost(address, "") from error
    for name, item in found.items():
        if item != _about():
            own = f"has {item[1]}" if isinstance(item, tuple) else "cannot load spirillum"
            raise InputError(f"cluster = {address!r}: worker {name} {own}; allowed: workers with {versions()}")
    return list(found)


def _lost(address: str, besides: str) -> InputError:
    return InputError(f"the scheduler at {address} was lost{besides}; allowed: the same again once one is there")


def _at_worker(work: Callable[[_Task], _Answer], task: _Task, expected: tuple[str, str]) -> _Answer:
    """One task, one at a time in this process."""
    if _about() != expected:
        raise InputError(f"a worker of the cluster has {versions()}; allowed: workers with {expected[1]}")
    with _alone:
        return work(task)


class _Hand(Generic[_Task, _Answer]):
    """Tasks that are with the workers of a cluster: a few for each of them at a time."""

    def __init__(
        self, client: Any, work: Callable[[_Task], _Answer], tasks: Iterable[_Task], on_progress: Tell
    ) -> None:
        self._client, self._work, self._ahead, self._tell = client, work, iter(tasks), on_progress
        self._waiting: dict[Any, _Task] = {}
        self._room, self._looked, self._deaths = 0, -_LOOK, 0

    def fill(self) -> bool:
        """Look which workers there are and send them their next tasks; whether any task is with them."""
        if monotonic() - self._looked >= _LOOK:
            known = self._client.scheduler_info(n_workers=-1)["workers"]
            machines = len({item["host"] for item in known.values()})
            self._tell(f"{len(known)} workers on {machines} machine{'' if machines == 1 else 's'}")
            self._room, self._looked = max(AHEAD * len(known), 1), monotonic()
        for task in islice(self._ahead, max(self._room - len(self._waiting), 0)):
            self._send(task)
        return bool(self._waiting)

    def _send(self, task: _Task) -> None:
        self._waiting[self._client.submit(_at_worker, self._work, task, _about(), pure=False)] = task

    def done(self) -> list[Any]:
        """Tasks that are done, or none after a while."""
        from distributed import wait

        try:
            return list(wait(list(self._waiting), timeout=_LOOK, return_when="FIRST_COMPLETED").done)  # type: ignore[no-untyped-call]
        except TimeoutError:
            if self._client.status != "running":
                raise OSError("no connection") from None
            return []

    def answer(self, future: Any) -> tuple[_Task, _Answer] | BaseException | None:
        """A task with its answer, or why there is none; None where it was sent again, for its worker had ended."""
        from distributed import KilledWorker

        task = self._waiting.pop(future)
        if future.status != "error":
            return task, future.result(timeout=_LONGEST_TRANSFER)
        error: BaseException = future.exception(timeout=_LONGEST_TRANSFER)
        if isinstance(error, KilledWorker) and self._deaths < _MOST_DEATHS:
            self._deaths += 1
            self._send(task)
            return None
        return error


def _on_cluster(hand: _Hand[_Task, _Answer], address: str, besides: str) -> Iterator[tuple[_Task, _Answer]]:
    """Tasks with their answers as they come."""
    from distributed import CancelledError

    try:
        while hand.fill():
            done = hand.done()
            while done:
                found = hand.answer(done.pop())
                if isinstance(found, BaseException):
                    raise _failed(address, found, besides)
                if found is not None:
                    yield found
    except (CancelledError, OSError) as error:
        raise _lost(address, besides) from error


def _failed(address: str, error: BaseException, besides: str) -> BaseException:
    """What is raised where a worker could not do its task."""
    from distributed import KilledWorker

    if isinstance(error, KilledWorker):
        return InputError(
            f"workers of {address} end at their tasks again and again, as for want of memory{besides}; allowed: "
            "workers with more memory"
        )
    if isinstance(error, OSError):
        return InputError(f"a worker of {address} could not do its task ({error}){besides}; allowed: workers that can")
    return error
