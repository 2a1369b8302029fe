"""Libraries that come with an extra, and a sentence where one is missing."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType

from spirillum.errors import InputError


def installation_of(extra: str) -> str:
    """Return how an extra is installed, from the package's folder or by a project that requires the package."""
    return f"pip install '.[{extra}]' in the project's folder, or require spirillum[{extra}]"


def import_optional(name: str, purpose: str, extra: str = "3d") -> ModuleType:
    """A library that an extra installs."""
    try:
        return import_module(name)
    except ModuleNotFoundError as error:
        raise InputError(
            f"{purpose} needs {error.name or name}, which is not installed; allowed: {installation_of(extra)}"
        ) from error
    except ImportError as error:  # a library of the system that it needs is missing
        raise InputError(
            f"{purpose} needs {name}, which cannot be loaded ({str(error)[:150]}); allowed: install what it lacks"
        ) from error
