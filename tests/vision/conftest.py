"""Flat drawings of a robot for the trackers."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import pytest


def _flat_pictures() -> ModuleType:
    name = "flat_pictures"
    if name not in sys.modules:
        spec = importlib.util.spec_from_file_location(name, Path(__file__).with_name("flat_pictures.py"))
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
