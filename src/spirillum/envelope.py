"""The form of every answer: quantities with units, a schema and notes, as JSON or as text."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from spirillum.notes import notes_of


def quantity(value: float | Iterable[float] | None, unit: str, **more: Any) -> dict[str, Any]:
    """``{"value": ..., "unit": ...}`` in SI with rates in rad/s; what is not finite becomes null."""
    return {"value": finite(value), "unit": unit, **more}


def interval(low: float, high: float, level: float = 0.95) -> dict[str, Any]:
    """Entries of a quantity that has an interval; none where its lower limit is not finite."""
    return {"low": low, "high": high, "kind": "interval", "level": level} if math.isfinite(low) else {}


def finite(value: Any) -> Any:
    """A number, or numbers in lists or arrays, with None for what is not finite."""
    if isinstance(value, (float, np.floating)):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, np.ndarray):
        return finite(value.tolist())
    if isinstance(value, (list, tuple)):
        return [finite(item) for item in value]
    return value


def envelope(kind: str, content: Mapping[str, Any], notes: Iterable[str]) -> dict[str, Any]:
    """An answer of one kind with its schema's name and its notes; `warnings` are their sentences."""
    found = notes_of(notes)
    return {
        "schema": f"spirillum.{kind}/1",
        **content,
        "notes": [note.to_dict() for note in found],
        "warnings": [note.sentence for note in found],
    }


def with_notes_last(answer: Mapping[str, Any], **more: Any) -> dict[str, Any]:
    """An answer with more entries, before its notes."""
    notes = {name: answer[name] for name in ("notes", "warnings")}
    return {**{name: item for name, item in answer.items() if name not in notes}, **more, **notes}


def as_json(answer: Mapping[str, Any]) -> str:
    """JSON text; refuses anything that is not valid JSON, such as NaN."""
    return json.dumps(answer, indent=2, allow_nan=False, ensure_ascii=False)
