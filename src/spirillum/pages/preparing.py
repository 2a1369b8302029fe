"""A robot's table, made beside the page in a process of its own, with its progress."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
from collections.abc import Callable
from typing import Any

from spirillum.robot.robot import Robot
from spirillum.robot.text import robot_text

__all__ = ["Preparing"]


class Preparing:
    """A table on its way."""

    def __init__(self, robot: Robot, tell: Callable[[], None]) -> None:
        """Begin.

        Args:
            robot: whose table.
            tell: called from a thread when there is progress.
        """
        self.robot = robot
        self._tell = tell
        self._said: dict[str, Any] = {"what": "starting", "done_places": 0, "places": 0}
        self._process = subprocess.Popen(  # noqa: S603 - our own module, nothing from outside in the arguments
            [sys.executable, "-m", __name__], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        self._thread = threading.Thread(target=self._follow, name="page: table", daemon=True)
        self._thread.start()

    @property
    def running(self) -> bool:
        """Whether it still goes on."""
        return self._thread.is_alive()

    def progress(self) -> dict[str, Any] | None:
        """What is being solved, `done_places` of `places`; `done`, or `failed` with a sentence, at the end."""
        return dict(self._said)

    def stop(self) -> None:
        """Leave off; places that were solved for are kept."""
        self._process.terminate()

    def _follow(self) -> None:
        assert self._process.stdin is not None and self._process.stdout is not None  # noqa: S101, PT018
        try:
            self._process.stdin.write(robot_text(self.robot))
            self._process.stdin.close()
        except BrokenPipeError:
            pass
        for line in self._process.stdout:
            self._said = json.loads(line)
            self._tell()
        if self._process.wait() != 0 and "failed" not in self._said:
            self._said = {"failed": "making the table was left off; what is solved of it is kept"}
        self._tell()


def _main() -> None:
    """Make the table of the robot on standard input; progress in lines of JSON."""
    import tomllib

    from spirillum.errors import InputError
    from spirillum.swimming.preparation import prepare

    def tell(**said: Any) -> None:
        sys.stdout.write(json.dumps(said) + "\n")
        sys.stdout.flush()

    try:
        table = tomllib.loads(sys.stdin.read())
        prepare(table, progress=lambda what, done, total: tell(what=what, done_places=done, places=total))
    except InputError as error:
        tell(failed=str(error))
        sys.exit(2)
    tell(done=True)


if __name__ == "__main__":
    _main()
