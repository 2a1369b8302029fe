"""Statistics over trials: means with Student's t intervals, the common uncertainty of the scale, and outliers."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from spirillum.measurement.outliers import GRUBBS_LEVEL, outlying_trial
from spirillum.measurement.statistics import NORMAL, mean_with_interval
from spirillum.measurement.trials import LEVEL, MEASURED, RATE_NAMES, WOBBLES, Measured, Trial
from spirillum.vision.flag import Flag

__all__ = ["Summary", "compared", "summary_of"]

_LENGTHS = ("forward_velocity", "lateral_position")


@dataclass(frozen=True)
class Summary:
    """Means over trials."""

    quantities: Mapping[str, Measured]
    """Means by the names of `MEASURED`."""
    counts: Mapping[str, int]
    """Number of trials that entered each mean."""
    trials: int
    """Number of all trials."""
    scale_uncertainty: float
    """Relative standard uncertainty of lengths, common to all trials."""

    def to_dict(self) -> dict[str, Any]:
        """As JSON."""
        found = {name: item.to_dict(n=self.counts[name]) for name, item in self.quantities.items()}
        return {"n": self.trials, **found, "scale_uncertainty": self.scale_uncertainty}


def summary_of(trials: Sequence[Trial]) -> Summary:
    """Means over trials with Student's t intervals; that of a single trial is its own.

    The uncertainty of the scale is common to all trials: averaging does not reduce it.

    Args:
        trials: one or more.
    """
    shared = max((trial.track.scale.relative_uncertainty for trial in trials), default=0.0)
    quantities, counts = {}, {}
    for name in MEASURED:
        measured = [trial.quantities[name] for trial in trials if math.isfinite(trial.quantities[name].value)]
        counts[name] = len(measured)
        quantities[name] = _mean(name, measured, trials, shared)
    return Summary(quantities, counts, len(trials), shared)


def _mean(name: str, measured: Sequence[Measured], trials: Sequence[Trial], shared: float) -> Measured:
    if not measured:
        first = trials[0].quantities[name]
        return replace(first, reason=first.reason or "no trial measured it")
    if len(measured) == 1:
        return measured[0]
    mean = mean_with_interval([item.value for item in measured], LEVEL)
    reach = mean.half_width
    if name in _LENGTHS:
        reach = math.hypot(reach, NORMAL * shared * mean.value)
    if name in WOBBLES:  # the error of tracking is common to all trials
        reach = max(reach, float(np.mean([item.high - item.value for item in measured])))
    low = mean.value - reach
    if name in WOBBLES:
        low = max(low, 0.0)  # an amplitude
    return Measured(mean.value, low, mean.value + reach, measured[0].unit)


def compared(trials: Sequence[Trial]) -> list[Trial]:
    """All trials, with flags on outliers (Grubbs' test) and on copies of another trial."""
    found = [_copy_flagged(trial, trials[:place]) for place, trial in enumerate(trials)]
    for name in RATE_NAMES:
        worst = outlying_trial([trial.quantities[name].value for trial in trials])
        if worst is None:
            continue
        sentence = (
            f"its {name.replace('_', ' ')} does not fit in with the other trials (Grubbs' test, {100 * GRUBBS_LEVEL:g} "
            "%); it still counts in the means"
        )
        found[worst] = found[worst].flagged(Flag(f"outlier-{name.replace('_', '-')}", sentence))
    return found


def _copy_flagged(trial: Trial, others: Sequence[Trial]) -> Trial:
    """The trial, flagged if its track equals that of another one."""
    x = trial.track.position[:, 0]
    twin = next((other for other in others if np.array_equal(other.track.position[:, 0], x, equal_nan=True)), None)
    if twin is None or not np.isfinite(x).any():
        return trial
    sentence = (
        f"it shows the same as {twin.name}, frame by frame: a copy is no second trial, yet it counts in the means"
    )
    return trial.flagged(Flag("copy-of-a-trial", sentence))
