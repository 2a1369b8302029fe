"""Evidence for or against the paper's quantitative statements: of a study, and of released robots.

The paper's data points are lost, and with them the tails' rates. A statement is judged only where it follows
for any rates, from the geometry, or from an observations file; else it is undecidable, and the reason gives
the computed values. Robot, motor and fluid (Tables I and II) and the calibration factors (Table III) are in the
presets `biorob2012-wide` and `biorob2012-narrow`.

Nothing is fitted and nothing is observed: a robot's readings differ by how it was released, how long it waited, how
rough and how slippery its wall is, and over what its run is read. A statement that holds in all readings is predicted
to agree, one that holds in none to disagree. Otherwise it depends on the factor that moves it most.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from spirillum.arrays import Flags, Values
from spirillum.data_tables import rows_of
from spirillum.fluid.registry import SWIMMER_MODELS
from spirillum.papers.claim import Claim, PredictedVerdict, Verdict
from spirillum.robot.load import load
from spirillum.robot.robot import Robot
from spirillum.studies.columns import reference_pose
from spirillum.studies.released_robots import READ, WINDOWS, levels_of_readings, main_effects
from spirillum.units import show_height

if TYPE_CHECKING:
    import xarray as xr


class LargestReynolds(NamedTuple):
    """The largest Reynolds number of a channel, and the tail that has it."""

    value: float  #: Re_max; the paper does not state its length scale.
    wavelength_mm: float
    amplitude_mm: float
    figure: str  #: The figure whose caption states it.


LARGEST_REYNOLDS = {
    "wide": LargestReynolds(0.0058, 25.0, 2.5, "Fig. 5"),
    "narrow": LargestReynolds(0.0038, 20.0, 1.5, "Fig. 6"),
}
"""By channel; captions of Figs 5 and 6."""

GLOBAL_DROP = 0.389  #: Relative loss of the mean velocity of all tails in the narrow channel; text on Figs 5 and 6.

LOW_REYNOLDS = 0.1  #: Upper bound of low Reynolds number conditions; text.

BODY_ROTATION_ERROR = 0.5  #: Largest relative error of the predicted body rotation rates; text on Figs 5 and 6.

BODY_DRAG_FACTORS = {"wide": 1.95, "narrow": 3.6}  #: Factors on the isolated body's drag along the axis; Table III.

ROBOT_LENGTH = 0.1  #: Lower bound of the prototype's length, m; text.

NARROWER = 0.25  #: Relative reduction of the channel's radius from wide to narrow; text and Table I.

FRAME_RATE = 30.0  #: Frame rate of the camera, Hz; text on the experiments.


NO_RATES = "the observed rates are lost; give an observations file to decide"


STATEMENTS = {row["key"]: row for row in rows_of("papers/biorob2012/statements.csv")}
"""The paper's statements, each with what it states, by their keys."""


def claim_of(
    key: str, computed: str, verdict: Verdict | PredictedVerdict, reason: str, **numbers: float | str
) -> Claim:
    """A statement with its verdict; `numbers` fill its places."""
    row = STATEMENTS[key]
    return Claim(row["statement"].format(**numbers), row["paper"].format(**numbers), computed, verdict, reason)


def verdict_of(holds: bool) -> Verdict:  # noqa: FBT001 - a truth value is what it turns into words
    """The verdict on a statement that holds or does not."""
    return "agrees" if holds else "disagrees"


class Evidence:
    """Quantities of a study's dataset in the notation of the paper (channels `wide` and `narrow`, tails in mm)."""

    def __init__(self, dataset: xr.Dataset) -> None:
        self.dataset = dataset
        self.models: tuple[str, ...] = tuple(str(name) for name in dataset["model"].values)
        self.observed = "observed_forward_velocity" in dataset
        readings = [str(name) for name in dataset["friction"].values]
        self.bound = next((name for name in ("none", "rotor") if name in readings), readings[0])
        self.robot: Robot = load("biorob2012-wide")
        settings = json.loads(str(dataset.attrs.get("settings", "{}")))
        self._settings: dict[str, Any] = settings
        computed = [name for name in self.models if SWIMMER_MODELS[name].placed]
        fitted = {name for robot in settings.get("robots", []) for name in robot.get("calibration") or {}}
        self.computed: tuple[str, ...] = tuple(computed)  #: Models that compute the channel's walls.
        self.confined: tuple[str, ...] = tuple(name for name in self.models if name in computed or name in fitted)
        """Models that depend on the channel: those with walls, and those with factors that represent the walls."""

    def free(self, name: str, model: str, channel: str | None = None) -> Values:
        """A quantity of free swimming at the friction-free bound, (wavelength, amplitude) or both channels first."""
        chosen = self.dataset[name].sel(model=model, friction=self.bound)
        return chosen.sel(channel=channel or ["wide", "narrow"]).values

    def observation(self, name: str, channel: str | None = None) -> Values:
        """An observed quantity, (wavelength, amplitude) or with both channels first."""
        chosen = self.dataset[f"observed_{name}"]
        return chosen.sel(channel=channel or ["wide", "narrow"]).values

    def complete(self, *names: str) -> bool:
        """Whether these quantities were observed of every tail in both channels."""
        return self.observed and all(bool(np.all(np.isfinite(self.observation(name)))) for name in names)

    def lacking(self, *names: str) -> str:
        """Why a statement about all tails stays open: no observations, or not of all of them."""
        if not self.observed:
            return NO_RATES
        counts = []
        for name in names:
            seen = np.isfinite(self.observation(name))
            counts.append(f"{name.replace('_', ' ')} of {np.count_nonzero(seen)} of {seen.size} robots")
        return f"it speaks of all tails in both channels; the observations have {', '.join(counts)}"

    def tail(self, wavelength_mm: float, amplitude_mm: float) -> tuple[int, int] | None:
        """Indices of a tail in the grid, if it is there."""
        indices = []
        for name, value in (("wavelength", wavelength_mm), ("amplitude", amplitude_mm)):
            near = np.flatnonzero(np.isclose(self.dataset[name].values, value * 1e-3, rtol=1e-6))
            if not near.size:
                return None
            indices.append(int(near[0]))
        return indices[0], indices[1]

    def speed_of(self, reynolds: float) -> float:
        """U = Re mu/(rho D_b), m/s: the speed behind a Reynolds number if its length is the body's diameter."""
        fluid = self.robot.fluid
        return reynolds * fluid.viscosity / (fluid.density * self.robot.body.diameter)

    def drop_per_motor_turn(self, model: str, ending: str = "") -> Values:
        """Relative loss of speed from wide to narrow at equal motor rates, for every tail."""
        per_turn = self.free(f"forward_velocity{ending}", model) / self.free(f"motor_rotation_rate{ending}", model)
        loss: Values = 1.0 - per_turn[1] / per_turn[0]
        return loss

    def drops_of_the_band(self, model: str) -> Values | None:
        """Relative losses at equal motor rates, of the reference pose and of a band (last axis)."""
        if model not in self.computed or "forward_velocity_at_place" not in self.dataset:
            return None
        return np.concatenate(
            [self.drop_per_motor_turn(model)[..., None], self.drop_per_motor_turn(model, "_at_place")], axis=-1
        )

    @property
    def pose(self) -> str:
        """Poses of the models that compute the walls, in words."""
        return reference_pose(self._settings)


def fraction_between(values: Values) -> str:
    """A range of fractions in per cent."""
    return f"{100 * np.nanmin(values):.1f} to {100 * np.nanmax(values):.1f} %"


_CLOSE = 0.05  # relative difference from a stated number within which it is met, as for observations
_AS_MUCH = 0.8  # A factor is named beside the first if it moves a statement this much of what the first does
_WORDS = {"friction_coefficient": "friction coefficient", "wait": "waiting time", "window": "time read over"}
_TEXTS: dict[str, Callable[[float], str]] = {"gap": show_height, "wait": "{:g} s".format, "roughness": show_height}


class Judgement(NamedTuple):
    """A verdict with its reason."""

    verdict: PredictedVerdict
    reason: str


class FrictionModelRuns:
    """Readings of a study's robots, one for each run and window of the design."""

    def __init__(self, evidence: Evidence) -> None:
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
        return np.where(known.any(axis=0), np.all((flat > 0) | ~known, axis=0), np.nan)

    def verdict_on(self, holds: Values) -> Judgement:
        """The verdict on a statement about all robots, 1, 0 or NaN in each reading; it stays open without a table."""
        known = np.isfinite(holds)
        count, total = int(np.nansum(holds)), int(known.sum())
        lacking = f"; {self.missing}" if self.missing else ""
        if total == 0:
            return Judgement("depends", self._undecided)
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

    def claim(self, key: str, computed: str, steps: Values) -> Claim:
        """A statement that holds where all steps are positive, with its verdict."""
        return claim_of(key, computed, *self.verdict_on(self.holds(steps)))

    def compare(self, values: Values, stated: float, unit: str, scale: float) -> Judgement:
        """The verdict on a stated number, SI; `scale` is the SI unit over the shown one."""
        known = values[np.isfinite(values)]
        if not known.size:
            return Judgement("depends", self._undecided)
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

    @property
    def _undecided(self) -> str:
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
        shown = _TEXTS.get(name, "{:g}".format)(value)
        return f"a {_WORDS.get(name, name)} of {shown}"


def _joined(names: list[str]) -> str:
    return " and ".join(_WORDS.get(name, name) for name in names)
