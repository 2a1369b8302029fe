"""A flat drawing of a robot for the live tracker."""

from collections.abc import Iterator
from copy import deepcopy
from pathlib import Path
from typing import Any

import pytest

from flat_pictures import Flat
from spirillum.live import tracker


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
def learnt_once() -> Iterator[None]:
    """The same frames are learnt from once; what is learnt changes while a robot is followed, so each has a copy."""
    learn, known = tracker.learnt_from, {}

    def learnt(video: Any, frames: list[Any], setup: Any, *more: Any, **how: Any) -> Any:
        key = repr(setup), repr(how), *(frame.image.tobytes() for frame in frames)
        if key not in known:
            known[key] = learn(video, frames, setup, *more, **how)
        return deepcopy(known[key])

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tracker, "learnt_from", learnt)
        yield
