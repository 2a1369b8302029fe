"""A flat drawing of a robot for the live tracker."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from flat_pictures import Flat
from learnt_once import learnt_once


@pytest.fixture(scope="session")
def swimmer() -> Any:
    """A robot in 60 pictures of 6 s, not yet written: 4 mm/s, -0.9 rad/s, 5 rad/s."""
    turning = {"body_rate": -0.9, "tail_rate": 5.0}
    return Flat(frames=60, fps=10.0, velocity=4e-3, start=(0.01, 0.0), noise=2.0, **turning)


@pytest.fixture(scope="session")
def pictures(swimmer: Any) -> list[tuple[float, Any]]:
    """Its pictures with their times."""
    return list(swimmer.pictures())


@pytest.fixture(scope="session")
def filmed(swimmer: Any, pictures: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Its film; the setup lies beside it."""
    object.__setattr__(swimmer, "pictures", lambda: iter(pictures))  # drawn once
    path = tmp_path_factory.mktemp("live") / "swimmer.mp4"
    swimmer.write(path)
    return path


@pytest.fixture(scope="session", autouse=True)
def shared_learning() -> Iterator[None]:
    """All tests of a worker learn from its frames once."""
    with learnt_once():
        yield
