"""A robot's table, made beside the page with its progress; run by `spirillum.pages.job`."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from typing import Any

from spirillum.pages.job import Job, worker
from spirillum.robot.robot import Robot
from spirillum.robot.text import robot_text

__all__ = ["Preparing"]


class Preparing(Job):
    """A table on its way; places that were solved for are kept when it is left off."""

    def __init__(self, robot: Robot, tell: Callable[[], None]) -> None:
        """Begin.

        Args:
            robot: whose table.
            tell: called from a thread when there is progress.
        """
        super().__init__(__name__, {"robot": robot_text(robot)}, tell)
        self.robot = robot


def _prepared(request: dict[str, Any], progress: Callable[[str, int, int], None]) -> dict[str, Any]:
    from spirillum.swimming.preparation import prepare

    prepare(tomllib.loads(request["robot"]), progress=progress)
    return {}


if __name__ == "__main__":
    worker(_prepared)
