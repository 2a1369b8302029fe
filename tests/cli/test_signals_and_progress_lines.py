"""Commands that are ended by a scheduler or at the terminal, and what a log file says of long work."""

from __future__ import annotations

import math
import os
import re
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from spirillum.cli import renderer
from spirillum.cli.progress import ProgressLines
from spirillum.fluid.tube.progress_messages import saved_state_message
from spirillum.worker_pool import imap_unordered

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="no such signals")

WIDE = "biorob2012-wide"
NEW = ["prepare", WIDE, "--set", "tail.wavelength=21mm", "--workers"]
LONG = {
    "a run": ["simulate", WIDE, "-o", "run.nc", "--duration", "5000s"],
    "a table by two processes": [*NEW, "2"],
    "a table by this process": [*NEW, "1"],
}


SAYS_WHEN = """
import sys
from spirillum.dynamics import integration
run = integration._stretch
def said(*of, **how):
    integration._stretch = run
    print("it is at work", file=sys.stderr, flush=True)
    return run(*of, **how)
integration._stretch = said
"""


def _ended(command: list[str], folder: Path, number: int, *, group: bool) -> tuple[int, str]:
    """Exit code and standard error of a command that gets a signal while it is at work."""
    environment = os.environ | {"SPIRILLUM_CACHE": str(folder / "cache"), "COLUMNS": "400"}
    script = (
        "import signal\nsignal.signal(signal.SIGINT, signal.default_int_handler)\n"  # background jobs ignore it
        f"{SAYS_WHEN if command[0] == 'simulate' else ''}from spirillum.cli import main\nmain()"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", script, *command],
        cwd=folder,
        env=environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    assert process.stderr is not None
    said = process.stderr.readline()  # it is at work
    time.sleep(0.2)
    (os.killpg if group else os.kill)(process.pid, number)
    _, rest = process.communicate(timeout=60)
    end = time.monotonic() + 20.0
    while (left := subprocess.run(["pgrep", "-s", str(process.pid)], check=False, capture_output=True).stdout) and (
        time.monotonic() < end
    ):
        time.sleep(0.1)
    assert not left
    return process.returncode, said + rest


@pytest.mark.parametrize(("number", "code"), [(signal.SIGTERM, 143), (signal.SIGINT, 130)])
@pytest.mark.parametrize(("name", "group"), [("a run", False), ("a table by two processes", True)])
def test_signal_ends_a_command_with_its_code(tmp_path: Path, name: str, group: bool, number: int, code: int) -> None:
    ended, said = _ended(LONG[name], tmp_path, number, group=group)
    *before, last = [line for line in said.splitlines() if " elapsed" not in line]
    assert ended == code, said
    assert last.startswith("spirillum: interrupted; ")
    if name == "a run":
        assert before == ["it is at work"]
    else:
        assert [
            line for line in before if not line.startswith(("no table of this tube yet", "poses of the table: "))
        ] == []
        places = re.search(r"from (\d+) poses", said)
        assert places is not None
        assert re.search(rf"\d+ of {places[1]} poses are saved; the same command resumes the computation$", last)


@pytest.mark.slow
def test_signal_ends_work_of_one_process_too(tmp_path: Path) -> None:
    ended, said = _ended(LONG["a table by this process"], tmp_path, signal.SIGTERM, group=False)
    assert (ended, "poses are saved" in said) == (143, True)


@pytest.mark.skipif(sys.platform == "win32", reason="no such signal, and no such process")
def test_a_killed_program_leaves_no_message_of_its_semaphores() -> None:
    script = (
        "import os, signal\n"
        "from multiprocessing import get_context\n"
        "from spirillum.cli import _prepare\n"
        "{}_prepare()\n"
        "held = get_context('spawn').Semaphore()\n"
        "os.kill(os.getpid(), signal.SIGKILL)"
    )
    plain, ours = (
        subprocess.run([sys.executable, "-c", script.format(mark)], capture_output=True, text=True, check=False)
        for mark in ("# ", "")
    )
    assert "leaked semaphore" in plain.stderr
    assert ours.stderr == ""


def test_a_library_that_fails_at_its_own_end_changes_no_exit_code() -> None:
    """As the pool of processes does where its thread closes a pipe to which the end of the interpreter writes."""
    script = (
        "import threading, time\n"
        "from spirillum.cli import _exit_despite_threads\n"
        "def fails():\n    raise OSError('handle is closed')\n"
        "threading._register_atexit(fails)\n"
        "threading.Thread(target=time.sleep, args=(60,), daemon=True).start()\n"
        "_exit_despite_threads(143)"
    )
    ended = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False, timeout=50)
    assert (ended.returncode, ended.stderr) == (143, "")


def test_a_pool_that_is_given_up_leaves_no_thread() -> None:
    """Its thread would run beside the end of the interpreter, which writes to the pipe that the thread closes."""
    answers = imap_unordered(math.sqrt, range(40), 2)
    next(answers)
    answers.close()
    assert not [thread for thread in threading.enumerate() if "Executor" in type(thread).__name__]


def test_what_is_kept_is_counted() -> None:
    assert saved_state_message(60, 12) == "12 of 60 poses are saved; the same command resumes the computation"


class _Clock:
    now = 0.0

    def __call__(self) -> float:
        return self.now


def test_lines_come_at_a_rate_that_can_be_read() -> None:
    """A place every 20 s of which 40 of 100 were kept from before: the rest takes 20 s each."""
    clock, lines = _Clock(), list[str]()
    progress = ProgressLines(lines.append, ("no table",), clock)
    progress("no table of this tube yet", 0, 100)
    progress("table", 40, 100)
    for done in range(41, 101):
        for _ in range(20):
            clock.now += 1.0
            progress.look()
        progress("table", done, 100)
    assert lines[0] == "no table of this tube yet"
    assert lines[1] == "table: 40 of 100, 15 s elapsed"
    assert "table: 41 of 100, 30 s elapsed" in lines  # several processes start together: one step tells no pace
    assert "table: 42 of 100, 45 s elapsed, about 19 min left" in lines
    assert any(re.search(r"elapsed, about \d min \d\d s left$", line) for line in lines)
    assert 25 < len(lines) < 60  # a line every 15 s, later every twentieth of the time
    assert clock.now == 1200.0


def test_piped_work_is_named_after_some_seconds(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("spirillum.cli.progress.FIRST", 5.0)
    clock, lines = _Clock(), list[str]()
    progress = ProgressLines(lines.append, ("no table",), clock)
    for _ in range(25):
        clock.now += 1.0
        progress.look()
    assert lines == ["at work, 5 s elapsed", "at work, 20 s elapsed"]


def test_short_work_prints_no_line(capsys: pytest.CaptureFixture[str]) -> None:
    with renderer.progress_bar(quiet=False) as progress:
        progress("looking", 1, 2)
    assert capsys.readouterr().err == ""
