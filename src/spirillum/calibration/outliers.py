"""Outliers among the trials of a tail."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from spirillum.arrays import Samples
from spirillum.measurement.observations import ObservationRow
from spirillum.notes import Note
from spirillum.robust import mad_scale

_LIMIT = 8.0  # robust standard deviations, pooled over all trials, beyond which a trial is an outlier
_LEAST = 0.15  # relative deviation below which no trial is an outlier
_FEWEST = 3
_COLUMNS = ("forward_velocity_mm_s", "body_rate_Hz")


def outlying_trials(
    groups: Sequence[Sequence[ObservationRow]], ratios: Sequence[tuple[Samples, Samples]]
) -> tuple[Note, ...]:
    """A sentence for each row whose advance or turning is an outlier among the trials of its tail."""
    found: list[Note] = []
    for number, column in enumerate(_COLUMNS):
        deviations = [_deviations(own[number]) for own in ratios]
        known = np.concatenate([own[np.isfinite(own)] for own in deviations]) if deviations else np.empty(0)
        if known.size == 0:
            continue
        scale = float(mad_scale(known))
        for group, own in zip(groups, deviations, strict=True):
            for item, off in zip(group, own.tolist(), strict=False):
                if np.isfinite(off) and abs(off) > max(_LIMIT * scale, _LEAST):
                    words = (
                        f"row {item.row}, column {column}: {1.0 + off:.3g} times the median of its tail's trials, each "
                        "over its own rate; check the number"
                    )
                    found.append(Note("outlier", words, (column,)))
    return tuple(found)


def _deviations(values: Samples) -> Samples:
    """Relative deviation of each trial from the median; NaN where there are too few."""
    known = values[np.isfinite(values)]
    if known.size < _FEWEST or np.median(known) == 0:
        return np.full(values.shape, np.nan)
    found: Samples = values / np.median(known) - 1.0
    return found
