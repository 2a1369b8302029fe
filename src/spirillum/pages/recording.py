"""What a robot of the page has done since it was laid down: for plots, for the replay file, for who looks in later."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from spirillum.pages.numbers import SERIES

if TYPE_CHECKING:
    from spirillum.dynamics.plant import Snapshot

MOST = 12_000
"""Samples that are kept; beyond it every other one is dropped."""
_DRAWN = 900
"""Samples of a plot's past, at most."""


class SampleRecording:
    """Samples in their order; its memory is bounded."""

    def __init__(self) -> None:
        self._rows: list[Snapshot] = []
        self._duties: list[float] = []
        self._every, self._count = 1, 0

    def __len__(self) -> int:
        return len(self._rows)

    def add(self, moment: Snapshot, duty: float) -> None:
        """Keep a moment."""
        self._count += 1
        if self._count % self._every:
            return
        self._rows.append(moment)
        self._duties.append(duty)
        if len(self._rows) > MOST:
            del self._rows[1::2], self._duties[1::2]
            self._every *= 2

    def data(self) -> dict[str, Any]:
        """All of it as lists: `time`, `position`, `attitude`, `tail_phase`, `duty`, `values` by name; SI."""
        return {
            "time": [row.time for row in self._rows],
            "position": [row.pose.position.tolist() for row in self._rows],
            "attitude": [row.pose.attitude.tolist() for row in self._rows],
            "tail_phase": [row.pose.tail_phase for row in self._rows],
            "duty": list(self._duties),
            "values": {
                name: [finite(row.values[name]) for row in self._rows]
                for name in SERIES
                if self._rows and name in self._rows[0].values
            },
        }

    def past(self) -> dict[str, Any]:
        """What plots need of it, thinned."""
        whole = self.data()
        every = slice(None, None, max(1, math.ceil(len(self) / _DRAWN)))
        path = [place[1:] for place in whole["position"][every]]
        return {
            "time": whole["time"][every],
            "path": path,
            "values": {name: column[every] for name, column in whole["values"].items()},
        }


def finite(value: float) -> float | None:
    """A number, or None where it has no value: JSON knows no NaN."""
    return float(value) if math.isfinite(value) else None


def thinned(count: int, most: int) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """Indices of at most so many samples of a run, the first and the last among them."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(np.int64))
