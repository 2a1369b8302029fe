"""Work shared out among processes: every answer once, beside its task, and no copy of the caller's script."""

import math

from spirillum.processes import as_they_come


def test_answers_of_several_processes_are_those_of_one() -> None:
    tasks = [1.0, 4.0, 9.0]
    assert list(as_they_come(math.sqrt, tasks, 1)) == [(1.0, 1.0), (4.0, 2.0), (9.0, 3.0)]
    assert sorted(as_they_come(math.sqrt, tasks, 2)) == [(1.0, 1.0), (4.0, 2.0), (9.0, 3.0)]
