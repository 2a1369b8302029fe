"""An estimated number with its interval."""

from __future__ import annotations

from dataclasses import dataclass

LEVEL = 0.95
"""Level of all intervals."""


@dataclass(frozen=True)
class Estimate:
    """A number with its 95 % interval, SI; NaN where the method gives none."""

    value: float
    low: float
    high: float
