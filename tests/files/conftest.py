"""Commands run in this process, with what they did to the files around them."""

import os
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from commands import Outcome


@pytest.fixture
def refused(run: Callable[..., Outcome]) -> Callable[..., str]:
    """Run a command that has to be refused in one sentence, with exit code 2; returns the sentence."""

    def check(*arguments: str) -> str:
        outcome = run(*arguments)
        assert outcome.code == 2, outcome
        assert outcome.out == ""
        assert outcome.err.startswith("spirillum: ")
        assert outcome.err.count("\n") == 1
        assert outcome.err[:-1].isprintable()
        return outcome.err

    return check


@pytest.fixture
def pipe(tmp_path: Path) -> Path:
    """A named pipe that nobody writes to; who opens it waits for ever, unless this test does."""
    path = tmp_path / "pipe"
    os.mkfifo(path)
    return path


@pytest.fixture
def soon() -> Callable[[Callable[[], object]], object]:
    """Run a function in a thread that may be left behind, and fail where it does not come to its end."""

    def wait(function: Callable[[], object]) -> object:
        found: list[object] = []
        thread = threading.Thread(target=lambda: found.append(function()), daemon=True)
        thread.start()
        thread.join(60.0)
        assert found, "it waits for ever"
        return found[0]

    return wait
