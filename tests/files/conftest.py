"""Commands run in this process, with what they did to the files around them."""

import contextlib
import io
import os
import threading
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest

from spirillum.cli import main


class Outcome(NamedTuple):
    """What a command printed and how it ended."""

    code: int
    out: str
    err: str


def outcome_of(*arguments: str) -> Outcome:
    """Run a command."""
    out, err = io.StringIO(), io.StringIO()
    code = 0
    with warnings.catch_warnings(), contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        warnings.simplefilter("default")
        try:
            main(list(arguments))
        except SystemExit as stopped:
            code = int(stopped.code or 0)
    return Outcome(code, out.getvalue(), err.getvalue())


@pytest.fixture
def run() -> Callable[..., Outcome]:
    """Run a command and return its exit code and output."""
    return outcome_of


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
