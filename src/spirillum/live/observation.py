"""What the live tracker has found: on one frame, and over a whole tracking."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from spirillum.answer_entries import answer_of
from spirillum.display import DisplayMixin
from spirillum.measurement.setup_template import scale_confirmed, setup_remarks
from spirillum.measurement.trials import RATE_NAMES, Measured, Trial
from spirillum.notes import Note
from spirillum.vision.flag import Flag

State = Literal["learning", "tracking", "lost"]
"""`learning`: the robot's appearance is not yet known; `lost`: it is not where it should be, or not in full view."""


@dataclass(frozen=True, repr=False)
class Observation(DisplayMixin):
    """A robot on one frame, from this frame and those before it; SI, NaN where it was not seen."""

    frame: int  #: Number of the frame, from 0; frames that were left out are counted.
    time: float  #: When it was taken, s.
    state: State  #: `learning`, `tracking` or `lost`.
    reason: str = ""  #: Why it is not tracking, in one sentence.
    x: float = math.nan  #: The body's mid-length along the channel, from the middle of the picture, towards the nose, m
    y: float = math.nan  #: Across the channel, m.
    heading: float = math.nan  #: Angle of the motor axis to the channel, rad.
    body_angle: float = math.nan
    """Angle by which the body has turned about +x, continuous, rad; all of it may be off by `body_period`."""
    tail_phase: float = math.nan
    """Phase of the tail about +x in the lab, continuous, rad; it may be off by whole turns."""
    position_error: float = math.nan  #: Standard error of x, m.
    heading_error: float = math.nan  #: Standard error of the heading, rad.
    body_angle_error: float = math.nan  #: Standard error of the body's angle, rad.
    tail_phase_error: float = math.nan  #: Standard error of the tail's phase, rad.
    body_period: float = 2.0 * math.pi  #: Angle after which the stripes look the same, rad.
    rates: Mapping[str, Measured] = field(default_factory=dict)
    """Speed and rates over the last seconds, by the names of `measure`, each with a 95 % interval or a reason."""
    pixel: tuple[float, float] = (math.nan, math.nan)  #: Pixel (u, v) of the body's mid-length.
    flags: tuple[Flag, ...] = ()  #: What to know about this frame's numbers.

    @property
    def seen(self) -> bool:
        """Whether the robot was seen on this frame."""
        return self.state == "tracking"

    @property
    def warnings(self) -> tuple[Note, ...]:
        """What to be careful about."""
        return tuple(flag.note for flag in self.flags)

    def to_dict(self) -> dict[str, Any]:
        """The observation as data, SI with rates in rad/s."""
        return answer_of(self, place=[self.x, self.y], learnt=self.state != "learning")


@dataclass(frozen=True, repr=False)
class Tracked(DisplayMixin):
    """A source that was tracked to its end."""

    source: str  #: Its name.
    pace: str  #: `real`: as the pictures come; `fast`: a video, as fast as it goes.
    frames: int  #: Frames that were looked at.
    tracked: int  #: Frames on which the robot was seen.
    dropped: int  #: Frames that came while the tracker was busy, most of them while it learnt.
    learnt: float  #: Time of the first frame after the robot was learnt, s; NaN if it never was.
    latencies: tuple[float, ...] = field(repr=False)
    """Time from each tracked picture's arrival to its observation, s; empty with the pace `fast`."""
    trial: Trial | None = field(repr=False)  #: Speed and rates over all frames; None if the robot was never learnt.
    source_notes: tuple[Note, ...] = ()  #: Cautions about the source.
    stopped: str = ""  #: Why it ended early, in a sentence; empty for a video that ended, or a requested duration.
    interrupted: bool = False  #: Whether it was interrupted.

    def latency(self, share: float) -> float:
        """Latency below which a share of the frames stays, s; NaN where none is known."""
        return float(np.quantile(self.latencies, share)) if self.latencies else math.nan

    @property
    def warnings(self) -> tuple[Note, ...]:
        """What to be careful about."""
        found = [*self.source_notes, *([Note("run-cut-short", self.stopped)] if self.stopped else [])]
        if self.trial is not None:
            said = [flag.note for flag in self.trial.flags]
            track = self.trial.track
            confirmed = scale_confirmed(track.scale.apparent_size, self.trial.flags)
            found += [*said, *setup_remarks(track.setup, confirmed=confirmed)]
            for name in RATE_NAMES:
                item = self.trial.quantities[name]
                if not math.isfinite(item.value) and item.reason not in said:
                    found.append(Note("not-measured", f"{name.replace('_', ' ')} not given: {item.reason}", (name,)))
        return tuple(found)

    def to_dict(self) -> dict[str, Any]:
        """The answer as data, SI with rates in rad/s."""
        rates = {} if self.trial is None else {name: self.trial.quantities[name] for name in RATE_NAMES}
        return answer_of(self, median=self.latency(0.5), percentile_95=self.latency(0.95), rates=rates)
