"""A reader that closes the pipe, as `| head` does, is no failure."""

import subprocess
import sys

import pytest


@pytest.mark.parametrize("more", [[], pytest.param(["--json"], marks=pytest.mark.slow)])
def test_closed_pipe_ends_quietly(more: list[str]) -> None:
    command = [sys.executable, "-m", "spirillum", "robot", "show", "biorob2012-wide", *more]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        process.stdout.close()  # before anything is written
        errors = process.stderr.read()
        code = process.wait(timeout=600)
    assert (code, errors) == (0, b"")
