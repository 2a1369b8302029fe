"""Work shared out among processes: every answer once, beside its task, and no copy of the caller's script."""

import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from spirillum import worker_pool
from spirillum.worker_pool import imap_unordered, slowdown


def test_answers_of_several_processes_are_those_of_one() -> None:
    tasks = [1.0, 4.0, 9.0]
    assert list(imap_unordered(math.sqrt, tasks, 1)) == [(1.0, 1.0), (4.0, 2.0), (9.0, 3.0)]
    assert sorted(imap_unordered(math.sqrt, tasks, 2)) == [(1.0, 1.0), (4.0, 2.0), (9.0, 3.0)]


@pytest.mark.skipif(not Path("/proc").exists(), reason="processes are looked up in /proc")
def test_processes_end_with_the_one_that_asked(tmp_path: Path) -> None:
    """A terminal's Ctrl-C reaches none of them; a parent that is killed cannot end them, but they notice."""
    script = (
        "import time; from spirillum.worker_pool import imap_unordered; list(imap_unordered(time.sleep, [60.0] * 4, 2))"
    )
    asking = subprocess.Popen([sys.executable, "-c", script])
    children = _waited_for(lambda: _workers_of(asking.pid), 2)
    held = [_holds(child, signal.SIGINT) for child in children]
    asking.send_signal(signal.SIGKILL)
    asking.wait()
    assert held == [True, True]
    assert _waited_for(lambda: [1] * (not any(map(_runs, children))), 1) == [1]


def _waited_for(found: Callable[[], list[int]], count: int) -> list[int]:
    """What is found once there is enough of it, or after half a minute."""
    end = time.monotonic() + 30.0
    while len(found()) < count and time.monotonic() < end:
        time.sleep(0.05)
    return found()


def _workers_of(pid: int) -> list[int]:
    """Processes that another one has started and that compute."""
    children = Path(f"/proc/{pid}/task/{pid}/children").read_text(encoding="ascii").split()
    words = {int(child): Path(f"/proc/{child}/cmdline").read_bytes() for child in children}
    return [child for child, command in words.items() if b"spawn_main" in command]


def _holds(pid: int, number: signal.Signals) -> bool:
    """Whether a process was started with a signal blocked."""
    status = Path(f"/proc/{pid}/status").read_text(encoding="ascii")
    blocked = next(line.split()[1] for line in status.splitlines() if line.startswith("SigBlk:"))
    return bool(int(blocked, 16) >> (number - 1) & 1)


def _runs(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def test_the_slowdown_is_that_of_threads_that_share_a_core(monkeypatch: pytest.MonkeyPatch) -> None:
    """A thread that has half of a core takes twice as long."""
    clock = iter([0.0, 0.0, 0.06, 0.06] * 9)
    monkeypatch.setattr(worker_pool, "perf_counter", lambda: next(clock))
    monkeypatch.setattr(worker_pool, "thread_time", iter([0.0, 0.03, 0.0, 0.06]).__next__)
    assert slowdown(1) == pytest.approx(2.0)
    assert slowdown(1) == pytest.approx(1.0)


@pytest.mark.parametrize("busy", [False, True])
def test_a_process_beside_needs_a_free_core(monkeypatch: pytest.MonkeyPatch, busy: bool) -> None:
    monkeypatch.setattr(worker_pool, "slowdown", lambda _: 4.0 if busy else 1.0)
    with worker_pool.process_beside(os.getpid) as beside:
        assert (beside is None) is busy
        assert beside is None or beside.submit(os.getpid).result() != os.getpid()


def test_an_interrupt_waits_until_a_process_has_what_it_starts_from() -> None:
    waited = []

    def started() -> None:
        with worker_pool._start_of_processes():
            os.kill(os.getpid(), signal.SIGINT)  # any thread may take it
            time.sleep(0.02)
            waited.append(True)

    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            started()
    finally:
        signal.signal(signal.SIGINT, before)
    assert waited == [True]
