"""Versions of the program and of what it computes with."""

from __future__ import annotations

import platform
from functools import lru_cache
from importlib.metadata import version


@lru_cache(maxsize=1)
def package_version() -> str:
    """Version of the program."""
    return version("spirillum")


@lru_cache(maxsize=1)
def versions() -> str:
    """Versions of what a result was computed with."""
    packages = ("spirillum", "numpy", "scipy", "xarray")
    return ", ".join([f"python {platform.python_version()}", *(f"{name} {version(name)}" for name in packages)])
