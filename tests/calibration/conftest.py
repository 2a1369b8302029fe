"""Synthetic experiments, made by a program with a seed: no number in these tests is measured."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from synthetic_experiments import synthetic


@pytest.fixture(scope="session")
def made(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """Write a synthetic experiment; the same one once a session."""
    folder = tmp_path_factory.mktemp("synthetic")
    known: dict[str, Path] = {}

    def make(**settings: Any) -> Path:
        key = repr(sorted(settings.items()))
        if key not in known:
            known[key] = synthetic(folder / f"observations-{len(known)}.csv", **settings)
        return known[key]

    return make
