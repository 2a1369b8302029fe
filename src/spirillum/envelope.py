"""The form of every answer: quantities with units, a schema and warnings, as JSON or as text."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np


def quantity(value: float | Iterable[float] | None, unit: str, **more: Any) -> dict[str, Any]:
    """``{"value": ..., "unit": ...}`` in SI with rates in rad/s; what is not finite becomes null."""
    return {"value": _finite(value), "unit": unit, **more}


def _finite(value: Any) -> Any:
    if value is None:
        return None
    if isinstance(value, (float, np.floating)):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, np.ndarray):
        return _finite(value.tolist())
    if isinstance(value, (list, tuple)):
        return [_finite(item) for item in value]
    return value


def envelope(kind: str, content: Mapping[str, Any], warnings: Iterable[str]) -> dict[str, Any]:
    """An answer of one kind with its schema's name and its warnings."""
    return {"schema": f"spirillum.{kind}/1", **content, "warnings": list(warnings)}


def as_json(answer: Mapping[str, Any]) -> str:
    """JSON text; refuses anything that is not valid JSON, such as NaN."""
    return json.dumps(answer, indent=2, allow_nan=False, ensure_ascii=False)
