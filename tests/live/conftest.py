"""Flat drawings of a robot for the trackers."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest


def _flat_pictures() -> ModuleType:
    name = "flat_pictures"
    if name not in sys.modules:
        spec = importlib.util.spec_from_file_location(name, Path(__file__).parents[1] / "vision" / "flat_pictures.py")
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        sys.modules[name] = module
        spec.loader.exec_module(module)
    return sys.modules[name]


@pytest.fixture(scope="session")
def flat_pictures() -> ModuleType:
    """The module `flat_pictures`: `flat_pictures.flat(velocity=1e-3, ...)` is a film."""
    return _flat_pictures()


@pytest.fixture(scope="session")
def swimmer(flat_pictures: ModuleType) -> Any:
    """A robot in 72 pictures of 6 s, not yet written: 4 mm/s, -0.9 rad/s, 5 rad/s."""
    turning = {"body_rate": -0.9, "tail_rate": 5.0}
    return flat_pictures.Flat(frames=72, fps=12.0, velocity=4e-3, start=(0.01, 0.0), noise=2.0, **turning)


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
