"""Tasks by their names."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from spirillum.controllers.axis_task import KeepAxisTask
from spirillum.controllers.course_tasks import HoldSpeedTask, RideOutTask, SaveBatteryTask
from spirillum.controllers.stop_task import StopAtTask
from spirillum.controllers.task import Task
from spirillum.errors import InputError, did_you_mean

__all__ = ["TASKS", "task_of"]

_TASKS: tuple[type[Task], ...] = (StopAtTask, HoldSpeedTask, RideOutTask, SaveBatteryTask, KeepAxisTask)
TASKS = {task.kind: task for task in _TASKS}
"""Tasks by their kinds."""


def task_of(value: Task | Mapping[str, Any]) -> Task:
    """A task from what a caller may give.

    Args:
        value: a task, or its `kind` and its fields by name.

    Raises:
        InputError: for an unknown kind or field, or a wrong value.
    """
    if isinstance(value, Task):
        return value
    if "kind" not in value:
        raise InputError(
            f"task = {str(value)[:60]!r}; allowed: kind ({', '.join(TASKS)}) and the task's fields, by name"
        )
    kind = str(value["kind"])
    if kind not in TASKS:
        raise InputError(f"task = {kind[:60]!r}{did_you_mean(kind, TASKS)}; allowed: {', '.join(TASKS)}")
    return TASKS[kind].of({name: item for name, item in value.items() if name != "kind"})
