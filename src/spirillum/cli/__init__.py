"""The command line: verbs over files, tables for people, `--json` for machines."""

from __future__ import annotations

import atexit
import errno
import gc
import os
import re
import signal
import sys
import threading
from _thread import interrupt_main
from collections.abc import Sequence
from contextlib import suppress
from io import TextIOBase, TextIOWrapper
from itertools import pairwise
from pathlib import Path
from types import FrameType
from typing import Any, TextIO

__all__ = ["main"]

_READING = ("calibrate", "film", "rank-models", "suggest")  # commands of a file, which look at their options themselves
_NAMING = (*_READING, "measure", "observations", "robot", "setup", "study", "virtual-experiment")
"""Commands whose arguments name files and folders."""
_INSTEAD = {
    ("simulate", "--tail-rate"): "--tail-rate is no option of simulate, in which the drive turns the tail; allowed: a "
    "drive that prescribes the rate, --set drive.kind=rate --set drive.rate=1.2Hz"
}
"""Sentences for options that only other commands have, by command and option."""
_PLACES = (errno.ENAMETOOLONG, errno.ELOOP, errno.EACCES, errno.EPERM, errno.EROFS, errno.ENOTDIR, errno.EISDIR)
"""Errors of a name or location, not of the program."""
_INTERRUPTED = 128 + signal.SIGINT
_TERMINATED = 128 + signal.SIGTERM  # exit code after SIGTERM, which schedulers expect, however the command ends then
_KEPT = "interrupted; finished files are kept"
_AGAIN = 0.02  # after this time an interrupt that was dropped comes again, s
_NOT_LEAKED = "ignore:resource_tracker:UserWarning"
"""For the process that removes semaphores after one that was killed: it need not say so."""
_OBJECTS = 50_000
"""New objects between two looks for garbage: imports make many that stay. The last look, at the end, is left out."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and leave with its exit code.

    0 done; 1 it ran and found the failure that it was asked to look for; 2 bad input or usage, one sentence on
    standard error; 130 interrupted (SIGINT); 143 terminated (SIGTERM).
    """
    own = arguments is None  # a process of its own, not a caller's
    try:
        if own:
            _prepare()
        code = _run(arguments)
    except KeyboardInterrupt:  # while errors were being explained
        code = _fail(_KEPT, _INTERRUPTED)
    if signal.SIGTERM in _interrupts:
        code = _TERMINATED
    if own:
        for ending in (signal.SIGINT, signal.SIGTERM):  # all is done but for the interpreter to leave
            signal.signal(ending, signal.SIG_IGN)
        gc.freeze()
        _exit_despite_threads(code)
    sys.exit(code)


def _exit_despite_threads(code: int) -> None:
    """Leave without the interpreter's own end where a thread is still at work: in compiled code that would abort it."""
    if not any(thread.daemon for thread in threading.enumerate()):
        return
    try:
        threading._shutdown()  # type: ignore[attr-defined]  # noqa: SLF001 - waits for the other threads
        atexit._run_exitfuncs()  # noqa: SLF001 - such as those that remove temporary folders
        for stream in (sys.stdout, sys.stderr):
            _flushed(stream)
    finally:  # a library that fails at its own end changes no exit code
        os._exit(code)


def _prepare() -> None:
    """Settings that only a separate process may change."""
    gc.set_threshold(_OBJECTS)
    sys.warnoptions.append(_NOT_LEAKED)
    for ending in (signal.SIGINT, signal.SIGTERM):  # both end as cleanly, with the work that was started
        if signal.getsignal(ending) != signal.SIG_IGN:
            signal.signal(ending, _interrupt)
    sys.unraisablehook = _not_lost
    # A user's settings of figures are not ours, and damaged ones stop the library.
    os.environ["MATPLOTLIBRC"] = str(Path(__file__).parents[1] / "view" / "figures" / "matplotlibrc")
    os.environ["MPLBACKEND"] = "agg"
    os.environ["PYDANTIC_DISABLE_PLUGINS"] = "__all__"  # else every installed package is searched for them
    os.environ.setdefault("OPENCV_LOG_LEVEL", "ERROR")  # what is wrong with a picture is said in a sentence
    try:
        Path.home()
    except RuntimeError:  # an unknown user, as in some containers: libraries ask for a home where they are imported
        os.environ["HOME"] = os.devnull
    for number in range(3):  # else a file that is opened could take the place of a closed stream
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
    if sys.stdout is None:  # else what is printed would be lost without a word
        sys.stdout = _Closed()


class _Closed(TextIOBase):
    """Standard output that was closed before the program began."""

    def write(self, _text: str) -> int:
        """Warn that an answer would be lost."""
        from spirillum.errors import InputError

        raise InputError("standard output is closed, and the answer is lost; allowed: a terminal, a file or a pipe")


_interrupts: list[int] = []  # signals that have come to end this process


class _Interrupt(KeyboardInterrupt):
    """A signal that ends this process. Python itself would replace the exit code after a plain KeyboardInterrupt."""


def _interrupt(number: int, _frame: FrameType | None) -> None:
    """End by an exception, and remember it: a library that is being imported may catch that, and fail later."""
    _interrupts.append(number)
    raise _Interrupt


def _not_lost(found: sys.UnraisableHookArgs) -> None:
    """An interrupt that came while an object was being removed, where Python drops it, comes again."""
    if isinstance(found.exc_value, KeyboardInterrupt):
        again = threading.Timer(_AGAIN, interrupt_main)  # at once it would come in here, and be dropped too
        again.daemon = True
        again.start()
    else:
        sys.__unraisablehook__(found)


def _run(arguments: Sequence[str] | None) -> int:
    try:
        from spirillum.cli.app import command_line

        for stream in (sys.stdout, sys.stderr):
            if isinstance(stream, TextIOWrapper):
                stream.reconfigure(errors="replace")  # a terminal without box characters shows others instead
        _check_names(sys.argv[1:] if arguments is None else arguments)
        code = command_line()(args=arguments, prog_name="spirillum", standalone_mode=False)
        if sys.stdout is not None:
            sys.stdout.flush()
    except BrokenPipeError:  # the reader of our output has left, as `| head` does
        _to_nowhere(sys.stdout)
        return 0
    except BaseException as error:
        if isinstance(error, OSError):
            _flushed(sys.stdout)
        code = _explained(error, sys.argv[1:] if arguments is None else arguments)
        if code is None:
            raise
        return code
    if code == _INTERRUPTED and _interrupts:  # while the command line was read, where its library says nothing
        return _fail(_KEPT, _INTERRUPTED)
    return int(code or 0)


def _check_names(arguments: Sequence[str]) -> None:
    """Refuse empty names, which would else be taken for the folder one works in."""
    from spirillum.errors import InputError

    if not arguments or arguments[0] not in _NAMING:
        return
    for before, word in pairwise(arguments):
        if not word and not (arguments[0] in _READING and before.startswith("-")):
            raise InputError(f"an empty word after {before[:60]}; allowed: a name or a value")
        if word.startswith("--") and word.find("=") == len(word) - 1 and arguments[0] not in _READING:
            raise InputError(f"an empty word after {word[:60]}; allowed: a name or a value")


def _with_setting(sentence: str, arguments: Sequence[str]) -> str:
    """The sentence on a robot, naming `--set` where that gave the field that it blames."""
    words = [after for before, after in pairwise(arguments) if before == "--set"]
    words += [word.removeprefix("--set=") for word in arguments if word.startswith("--set=")]
    for field in {word.partition("=")[0].strip() for word in words} - {""}:
        if re.match(rf"\S[^:]*: {re.escape(field)}[^\w]", sentence):
            return f"--set over {sentence}"
    return sentence


def _explained(error: BaseException, arguments: Sequence[str] = ()) -> int | None:
    """Return the sentence of an error that is the user's; None for one that is ours."""
    from typer import Abort

    from spirillum.errors import TOO_LARGE, InputError

    if isinstance(error, (KeyboardInterrupt, Abort)) or _interrupts:
        kept = str(error) if isinstance(error, Abort) else ""
        return _fail(f"interrupted; {kept}" if kept else _KEPT, 130)
    if isinstance(error, InputError):
        return _fail(_with_setting(str(error), arguments), 2)
    if isinstance(error, MemoryError):
        return _fail(TOO_LARGE, 2)
    if isinstance(error, OSError) and (sentence := _of_place(error)):
        return _fail(sentence, 2)
    if hasattr(error, "format_message"):  # a usage error of the command-line library
        return _fail(str(InputError(_of_usage(error))), 2)
    return None


def _of_usage(error: Any) -> str:
    """What is wrong with the words of a command; where a value was refused, what is allowed instead."""
    from pydantic import ValidationError

    from spirillum.robot.fields import refused_value

    names = getattr(getattr(error, "param", None), "opts", None)
    if isinstance(error.__cause__, ValidationError) and names:
        return refused_value(error.__cause__, names[0])
    command = getattr(getattr(error, "ctx", None), "info_name", "")
    instead = _INSTEAD.get((command, getattr(error, "option_name", "")))
    return instead or str(error.format_message())


def _of_place(error: OSError) -> str:
    """Return what is wrong with a file's name or location; empty for any other error."""
    if error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
        target = "the output" if error.filename is None else str(error.filename)[:200]
        return f"no space is left for {target}; allowed: a place with space"
    if error.errno in _PLACES:
        return f"{str(error.filename)[:80]}: {error.strerror}; allowed: another name or place"
    return ""


def _fail(sentence: str, code: int) -> int:
    if sentence and sys.stderr is not None:
        from spirillum.cli.wrapping import wrapped

        with suppress(OSError, ValueError):  # nobody listens; the exit code still says it
            sys.stderr.write(wrapped(f"spirillum: {sentence}") + "\n")
        _flushed(sys.stderr)
    return code


def _flushed(stream: TextIO | None) -> None:
    """Write out what a stream still holds, or drop it: else the interpreter tries again and ends with another code."""
    try:
        if stream is not None:
            stream.flush()
    except (OSError, ValueError):
        _to_nowhere(stream)


def _to_nowhere(stream: TextIO | None) -> None:
    """What is still buffered goes nowhere."""
    if stream is None:
        return
    with suppress(OSError, ValueError):
        handle = os.open(os.devnull, os.O_WRONLY)
        os.dup2(handle, stream.fileno())
        os.close(handle)
