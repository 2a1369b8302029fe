"""Public names of earlier versions, and what they are called now."""

from __future__ import annotations

import warnings

RENAMED = {"HeldPlants": "AxialBatch"}  #: Old names in `spirillum` to new ones.


def current_name(name: str) -> str:
    """Return what an old name is called now, with a DeprecationWarning."""
    warnings.warn(f"spirillum.{name} is now spirillum.{RENAMED[name]}", DeprecationWarning, stacklevel=3)
    return RENAMED[name]
