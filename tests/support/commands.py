"""Run commands of the program in this process."""

import contextlib
import io
import warnings
from typing import NamedTuple

from spirillum.cli import main


class Outcome(NamedTuple):
    """Exit code and output of a command."""

    code: int
    out: str
    err: str


def run_command(*arguments: str) -> Outcome:
    """Run a command and return its exit code and output."""
    out, err = io.StringIO(), io.StringIO()
    code = 0
    with warnings.catch_warnings(), contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        warnings.simplefilter("default")
        try:
            main(list(arguments))
        except SystemExit as stopped:
            code = int(stopped.code or 0)
    return Outcome(code, out.getvalue(), err.getvalue())
