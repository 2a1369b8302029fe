"""Predictions of released robots for a statement, and the verdict that follows.

Nothing is fitted and nothing is observed: a robot's readings differ by how it was laid down, how long it waited, how
rough and how slippery its wall is, and over what its run is read. A statement that holds in all readings is predicted
to agree, one that holds in none to disagree. Otherwise it depends on the factor that moves it most.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spirillum.arrays import Flags, Values
from spirillum.papers.biorob2012.evidence import Evidence
from spirillum.papers.claim import Claim, PredictedVerdict
from spirillum.studies.factorial import main_effects
from spirillum.studies.released_robots import READ, WINDOWS, levels_of_readings
from spirillum.units import show

_CLOSE = 0.05
"""Relative difference from a stated number within which it is met, as for observations."""
_AS_MUCH = 0.8
"""A factor is named beside the first if it moves a statement this much of what the first does."""
_WORDS = {"friction_coefficient": "friction coefficient", "wait": "waiting time", "window": "time read over"}
_UNITS = {"gap": "mm", "wait": "s", "roughness": "um"}


class Judgement(NamedTuple):
    """A verdict with its reason."""

    verdict: PredictedVerdict
    reason: str


class FrictionModelRuns:
    """Readings of a study's robots, one for each run and window of the design."""

    def __init__(self, evidence: Evidence) -> None:
        """Read a study with released robots."""
        self.evidence = evidence
        self._dataset = evidence.dataset
        self._levels = levels_of_readings()
        speeds = self.of("forward_velocity")
        self.known: Flags = np.asarray(np.isfinite(speeds).any(axis=-1))
        """Whether a robot was released, (channel, wavelength, amplitude)."""
        self.both: Flags = np.asarray(self.known.all(axis=0))
        """Whether a tail was released in both channels, (wavelength, amplitude)."""

    def of(self, name: str, inferred_by: str | None = None) -> Values:
        """A quantity, (channels wide and narrow, wavelength, amplitude, readings)."""
        chosen = self._dataset[f"{name}_at_run"].sel(channel=["wide", "narrow"])
        if inferred_by is not None:
            chosen = chosen.sel(inferred_by=inferred_by)
        values: Values = chosen.values
        return values.reshape(*values.shape[:3], -1)

    @property
    def missing(self) -> str:
        """List the robots that were not released; empty if all were."""
        lacking = int(np.count_nonzero(~self.known))
        return f"{lacking} of {self.known.size} robots have no table of their tube" if lacking else ""

    def holds(self, steps: Values) -> Values:
        """Whether all steps are positive, in each reading: 1, 0, or NaN if none is finite, (readings,)."""
        flat = steps.reshape(-1, steps.shape[-1])
        known = np.isfinite(flat)
        found: Values = np.where(known.any(axis=0), np.all((flat > 0) | ~known, axis=0), np.nan)
        return found

    def judged(self, holds: Values, *, of_all: bool = True) -> Judgement:
        """The verdict on a statement that holds or does not, in each reading.

        Args:
            holds: 1, 0 or NaN, (readings,).
            of_all: whether it speaks of all robots, so that those without a table keep it open.
        """
        known = np.isfinite(holds)
        count, total = int(np.nansum(holds)), int(known.sum())
        lacking = f"; {self.missing}" if of_all and self.missing else ""
        if total == 0:
            return Judgement("depends", self._nothing)
        if count == 0:
            return Judgement("predicted-disagrees", f"it holds in none of {total} readings{lacking}")
        if count == total:
            if lacking:
                return Judgement(
                    "depends", f"no table: it holds in all {total} readings of the robots that have one{lacking}"
                )
            return Judgement("predicted-agrees", f"it holds in all {total} readings")
        names = self._movers(holds)
        shares = "; ".join(self._share(holds, name) for name in names)
        return Judgement("depends", f"{_joined(names)}: it holds in {count} of {total} readings, {shares}{lacking}")

    def against(self, values: Values, stated: float, unit: str, scale: float) -> Judgement:
        """The verdict on a stated number.

        Args:
            values: in each reading, (readings,), SI.
            stated: the number, SI.
            unit: in which both are shown.
            scale: SI unit over that.
        """
        known = values[np.isfinite(values)]
        if not known.size:
            return Judgement("depends", self._nothing)
        low, high = float(known.min()), float(known.max())
        if np.all(np.abs(known / stated - 1.0) < _CLOSE):
            return Judgement("predicted-agrees", f"all {known.size} readings are within {100 * _CLOSE:.0f} %")
        if stated * (1.0 + _CLOSE) < low:
            return Judgement(
                "predicted-disagrees", f"all readings are above, by a factor of {low / stated:.2g} at least"
            )
        if stated * (1.0 - _CLOSE) > high:
            by = f", by a factor of {stated / high:.2g} at least" if high > 0 else ""
            return Judgement("predicted-disagrees", f"all readings are below{by}")
        names = self._movers(values)
        means = "; ".join(self._means(values, name, unit, scale) for name in names)
        return Judgement("depends", f"{_joined(names)}: the readings are on both sides, on average {means}")

    def claim(self, statement: str, paper: str, computed: str, judgement: Judgement) -> Claim:
        """A statement with its verdict."""
        return Claim(statement, paper, computed, judgement.verdict, judgement.reason)

    @property
    def _nothing(self) -> str:
        """Reason why no reading decides."""
        if self.missing:
            return f"no table: {self.missing}"
        return "the study's tails: they do not show it, or no run reaches so far"

    def _movers(self, values: Values) -> list[str]:
        """Factors with the largest effect on a result."""
        effects = np.abs(np.nan_to_num(main_effects(values, self._levels)))
        return [READ[number] for number in np.argsort(-effects) if effects[number] >= _AS_MUCH * effects.max()][:2]

    def _at(self, values: Values, name: str, sign: int) -> Values:
        chosen = values[self._levels[:, READ.index(name)] == sign]
        found: Values = chosen[np.isfinite(chosen)]
        return found

    def _share(self, holds: Values, name: str) -> str:
        low, high = (self._at(holds, name, sign) for sign in (-1, 1))
        words = [
            f"{int(part.sum())} of {part.size} at {self._level(name, sign)}" for part, sign in ((low, 0), (high, 1))
        ]
        return " and ".join(words)

    def _means(self, values: Values, name: str, unit: str, scale: float) -> str:
        words = [
            f"{scale * self._at(values, name, sign).mean():.3g} {unit} at {self._level(name, sign > 0)}"
            for sign in (-1, 1)
        ]
        return " and ".join(word.replace("  ", " ") for word in words)

    def _level(self, name: str, high: bool | int) -> str:  # noqa: FBT001 - which of two
        """Format a level of a factor."""
        if name == "window":
            return f"the {WINDOWS[int(high)]}"
        if name == "pitch":
            return "a pitched start" if high else "a level start"
        ends = self._dataset[f"{name}_of_run"].values
        value = float(ends.max() if high else ends.min())
        shown = show(value, _UNITS[name]) if name in _UNITS else f"{value:g}"
        return f"a {_WORDS.get(name, name)} of {shown}"


def _joined(names: list[str]) -> str:
    return " and ".join(_WORDS.get(name, name) for name in names)
