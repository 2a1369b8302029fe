"""What a live tracking was: how fast, how much was dropped, and the rates over all of it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from spirillum.display import DisplayMixin
from spirillum.envelope import envelope, quantity
from spirillum.measurement.setup_template import setup_remarks
from spirillum.measurement.trials import RATE_NAMES, Trial
from spirillum.notes import Note


@dataclass(frozen=True, repr=False)
class Tracked(DisplayMixin):
    """A source that was tracked to its end."""

    source: str
    """Its name."""
    pace: str
    """`real`: as the pictures come; `fast`: a video, as fast as it goes."""
    frames: int
    """Frames that were looked at."""
    tracked: int
    """Frames on which the robot was seen."""
    dropped: int
    """Frames that came while the tracker was busy, most of them while it learnt."""
    learnt: float
    """Time of the first frame after the robot was learnt, s; NaN if it never was."""
    latencies: tuple[float, ...] = field(repr=False)
    """Time from each tracked picture's arrival to its observation, s; empty with the pace `fast`."""
    trial: Trial | None = field(repr=False)
    """Speed and rates over all frames; None if the robot was never learnt."""
    source_notes: tuple[Note, ...] = ()
    """Cautions about the source."""
    stopped: str = ""
    """Why it ended early, in a sentence; empty for a video that ended, or a requested duration."""
    interrupted: bool = False
    """Whether it was interrupted."""

    def latency(self, share: float) -> float:
        """Latency below which a share of the frames stays, s; NaN where none is known."""
        return float(np.quantile(self.latencies, share)) if self.latencies else math.nan

    @property
    def warnings(self) -> tuple[Note, ...]:
        """What to be careful about."""
        found = [*self.source_notes, *([Note("run-cut-short", self.stopped)] if self.stopped else [])]
        if self.trial is not None:
            said = [flag.note for flag in self.trial.flags]
            found += [*said, *setup_remarks(self.trial.track.setup)]
            for name in RATE_NAMES:
                item = self.trial.quantities[name]
                if not math.isfinite(item.value) and item.reason not in said:
                    found.append(Note("not-measured", f"{name.replace('_', ' ')} not given: {item.reason}", (name,)))
        return tuple(found)

    def to_dict(self) -> dict[str, Any]:
        """The answer as data, SI with rates in rad/s."""
        content: dict[str, Any] = {
            "source": self.source,
            "pace": self.pace,
            "frames": self.frames,
            "frames_tracked": self.tracked,
            "frames_dropped": self.dropped,
            "learnt_at": quantity(self.learnt, "s"),
            "latency": {
                "median": quantity(self.latency(0.5), "s"),
                "percentile_95": quantity(self.latency(0.95), "s"),
            },
        }
        if self.trial is not None:
            content |= {name: self.trial.quantities[name].to_dict() for name in RATE_NAMES}
        return envelope("track", content, self.warnings)
