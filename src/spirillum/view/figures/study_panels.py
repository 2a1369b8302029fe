"""Labels, selections, axes and headings that figures over the tails of a study share."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from spirillum.arrays import Values
from spirillum.fluid.registry import SWIMMER_MODELS
from spirillum.studies.columns import reference_pose
from spirillum.units import Hz
from spirillum.view.figures.style import UnitPrefix, plain

if TYPE_CHECKING:
    import xarray as xr


NOTHING_MEASURED = "Computed only: this figure contains no measured data."


class PaperFigure(NamedTuple):
    """Layout of a study's figure of one channel after a figure of a paper."""

    file: str  #: Name of the study's figure.
    label: str  #: Name of the paper's figure.
    largest_reynolds: float  #: Re_max of its caption.


def spread(count: int, most: int) -> list[int]:
    """At most `most` indices out of `count`, evenly spread, including the first and the last."""
    if count <= most:
        return list(range(count))
    return sorted({int(index) for index in np.linspace(0, count - 1, most).round()})


@dataclass(frozen=True)
class StudyView:
    """A study's dataset, or a part of it, as figures read it."""

    dataset: xr.Dataset
    whole: xr.Dataset  #: The dataset from which scales are taken, so that all figures of a study share them.
    paper_figures: Mapping[str, PaperFigure] = field(default_factory=dict)  #: By channel, of a repeated paper.

    @classmethod
    def of(cls, dataset: xr.Dataset, paper_figures: Mapping[str, PaperFigure] | None = None) -> StudyView:
        """All of a study; `paper_figures` by channel, if it repeats a paper's."""
        return cls(dataset, dataset, paper_figures or {})

    def part(self, **indices: int | Sequence[int]) -> StudyView:
        """Select a part of the study by indices along dimensions."""
        return replace(self, dataset=self.dataset.isel(dict(indices.items())))

    @cached_property
    def models(self) -> tuple[str, ...]:
        """Names of the models."""
        return tuple(str(name) for name in self.whole["model"].values)

    @cached_property
    def readings(self) -> tuple[str, ...]:
        """All friction models."""
        return tuple(str(name) for name in self.whole["friction"].values)

    @cached_property
    def robots(self) -> list[dict[str, Any]]:
        """Settings of the robots, SI: one a channel of a grid, or one a robot of a list."""
        settings = json.loads(self.whole.attrs.get("settings", "{}"))
        found: list[dict[str, Any]] = settings.get("robots", [])
        return found

    @property
    def grid(self) -> bool:
        """Whether it is a grid of tails in channels, else a list of robots."""
        return "channel" in self.whole.dims

    @property
    def observed(self) -> bool:
        """Whether anything in it was measured."""
        return "observed_forward_velocity" in self.whole

    @property
    def source_line(self) -> str:
        """Line on the measured content of a figure."""
        if not self.observed:
            return NOTHING_MEASURED
        name = plain(str(self.whole.attrs.get("observations", "an observations file")), 40)
        return f"Observed: {name}, means with 95 % intervals. All else is computed."

    @cached_property
    def motor_driven(self) -> bool:
        """Whether a DC-motor drives every robot, so that frictionless rates are upper bounds."""
        drives = [robot.get("drive") or {} for robot in self.robots]
        return bool(drives) and all(drive.get("kind") == "dc-motor" for drive in drives)

    @property
    def upper_bound(self) -> bool:
        """Whether rates and speeds under the robots' own drive are upper bounds: a motor without contact friction."""
        return self.motor_driven and all(
            (robot.get("friction") or {}).get("effective") is None for robot in self.robots
        )

    @property
    def shaded(self) -> bool:
        """Whether values have a band or an interval, which reaches to either side of them."""
        return bool(self.banded or self.with_intervals)

    @property
    def bound_words(self) -> str:
        """Label of the value under the robots' own drive."""
        if not self.upper_bound:
            return "own drive"
        return "no contact friction" if self.shaded else "upper bound"

    def bound_sentence(self, what: str) -> str:
        """Note on the bound from the robots' own drive; empty without one."""
        if not self.upper_bound:
            return ""
        if not self.shaded:
            return f"{what} are upper bounds: no contact friction."
        return f"{what} are without contact friction, which slows a robot down; shades may reach above their marks."

    @property
    def settled(self) -> bool:
        """Whether released robots reached a steady state."""
        return "forward_velocity_settled" in self.whole and bool(
            np.isfinite(self.whole["forward_velocity_settled"]).any()
        )

    @cached_property
    def free_friction_models(self) -> tuple[str, ...]:
        """Readings shown for free swimming: without friction, and with friction in the joint."""
        return tuple(name for name in ("none", "rotor") if name in self.readings) or self.readings[:1]

    def friction_label(self, reading: str) -> str:
        """Legend label of a friction model."""
        if reading == "none":
            return (
                f"no contact friction{'' if self.shaded else ' (upper bound)'}" if self.motor_driven else "no friction"
            )
        if reading == "rotor" and self.upper_bound:
            return f"rotor friction $B_m$ only{'' if self.shaded else ' (upper bound)'}"
        return f"friction model '{reading}'"

    @cached_property
    def rotor_friction(self) -> float | None:
        """B_m, with a gear B_m G^2, if all robots share one, N m s/rad."""
        motors = [robot.get("motor") or {} for robot in self.robots]
        found = {m.get("rotor_friction", 0.0) * m.get("gear_ratio", 1.0) ** 2 for m in motors}
        value = found.pop() if len(found) == 1 else None
        return float(value) if value else None

    def values(self, name: str, **labels: str) -> Values:
        """A quantity of this part for some model or reading, SI."""
        return np.asarray(self.dataset[name].sel(labels).values, dtype=float)

    def scale(self, unit: str, *names: str, **labels: str | list[str]) -> UnitPrefix:
        """One scale for some quantities all over the study."""
        everything = [
            np.asarray(
                self.whole[name].sel({key: value for key, value in labels.items() if key in self.whole[name].dims})
            )
            for name in names
            if name in self.whole
        ]
        return UnitPrefix.of(np.concatenate([np.ravel(item) for item in everything]), unit)

    def advance_per_turn(self, model: str) -> Values:
        """Forward velocity over the tail's rate, m/turn; without friction, where readings differ."""
        return self.values("advance_per_radian", model=model, friction=self.free_friction_models[0]) * Hz

    @cached_property
    def banded(self) -> tuple[str, ...]:
        """Names of the models that have a band over unspecified poses."""
        return self._models_with("forward_velocity_low")

    @cached_property
    def with_intervals(self) -> tuple[str, ...]:
        """Names of the models that have intervals of a posterior."""
        return self._models_with("forward_velocity_interval_low")

    def _models_with(self, name: str) -> tuple[str, ...]:
        """Names of the models for which a quantity is finite anywhere."""
        if name not in self.whole:
            return ()
        return tuple(model for model in self.models if bool(np.isfinite(self.whole[name].sel(model=model)).any()))

    def band(self, name: str, model: str) -> tuple[Values, Values]:
        """Limits of a quantity of free swimming, of a posterior or over unspecified poses, SI; NaN without them."""
        reading = self.free_friction_models[0]
        if model in self.with_intervals:
            named = {"model": model, "friction": self.free_friction_models[-1]}
            return self.values(f"{name}_interval_low", **named), self.values(f"{name}_interval_high", **named)
        if model not in self.banded:
            unknown = np.full_like(self.values(name, model=model, friction=reading), np.nan)
            return unknown, unknown
        low, high = (self.values(f"{name}_{end}", model=model, friction=reading) for end in ("low", "high"))
        return low, high

    @property
    def pose_words(self) -> str:
        """Poses of the models that compute the walls, and the meaning of shades; empty without either."""
        computed = [name for name in self.models if name in SWIMMER_MODELS and SWIMMER_MODELS[name].placed]
        if not computed:
            return self._interval_words()
        where = f"{', '.join(computed)}: {reference_pose(json.loads(self.whole.attrs.get('settings', '{}')))}."
        return f"{where} {self._band_words()} {self._interval_words()}".strip()

    def _interval_words(self) -> str:
        if not self.with_intervals:
            return ""
        names, reading = ", ".join(self.with_intervals), self.free_friction_models[-1]
        return f"Shades: 95 % intervals of the posterior ({names}, friction model '{reading}'), discrepancy included."

    def _band_words(self) -> str:
        if not self.banded:
            return ""
        gaps = np.asarray(self.whole["gap_at_place"].values, dtype=float)
        pitches = np.degrees(np.asarray(self.whole["pitch_at_place"].values, dtype=float))
        reading = self.free_friction_models[0]
        friction = "without friction" if reading == "none" else f"friction model '{reading}'"
        return (
            f"Bands: the least to the largest value over gaps of {np.nanmin(gaps) * 1e3:.3g} to "
            f"{np.nanmax(gaps) * 1e3:.3g} mm and pitches of {np.nanmin(pitches):.3g} to {np.nanmax(pitches):.3g} deg "
            f"({friction}), none of them likelier than another."
        )

    def observed_motor_rate(self) -> tuple[Values, Values]:
        """Observed omega_m with the half width of its interval, rad/s; else tail less body rate."""
        # The half widths of tail and body then add up: not too narrow, however the two are correlated.
        rate, half = self.values("observed_motor_rate"), self.values("observed_motor_rate_ci95")
        tail, body = (self.values(f"observed_{name}_rate") for name in ("tail", "body"))
        halves = self.values("observed_tail_rate_ci95") + self.values("observed_body_rate_ci95")
        seen = np.isfinite(rate)
        return np.where(seen, rate, tail - body), np.where(seen, half, halves)

    def unanswered(self) -> str:
        """Note on robots of this part without a result; empty if there are none."""
        outside = self.dataset["outside"].sel(friction=list(self.free_friction_models))
        codes = np.asarray(outside.max("friction").values).ravel()
        missing = Counter(int(code) for code in codes if code)
        if not missing:
            return ""
        names = str(outside.attrs.get("flag_meanings", "")).split()
        reasons = [
            names[code].replace("-", " ") if code < len(names) else "other" for code, _ in missing.most_common(3)
        ]
        return (
            f"Gaps: {missing.total()} of {codes.size} results (a robot with a model) have no result "
            f"({', '.join(reasons)}{', …' if len(missing) > 3 else ''})."
        )

    def paper_speed(self, index: int) -> tuple[float, float] | None:
        """(Re_max, U) of the paper's caption for a channel; U = Re mu/(rho D_b), m/s."""
        channel = str(self.whole["channel"].values[index])
        if channel not in self.paper_figures or index >= len(self.robots):
            return None
        fluid, body = self.robots[index]["fluid"], self.robots[index]["body"]
        reynolds = self.paper_figures[channel].largest_reynolds
        return reynolds, reynolds * fluid["viscosity"] / (fluid["density"] * body["diameter"])


def head_column(axes: Axes, shown: StudyView, wavelength: int) -> None:
    """Title a column of panels with its wavelength, by its index in the study."""
    values = np.asarray(shown.whole["wavelength"].values, dtype=float)
    scale = UnitPrefix.of(values, "m")
    axes.set_title(f"$\\lambda$ = {values[wavelength] / scale.factor:.4g} {scale.unit}", loc="center", pad=3)


def tail_axis(axes: Axes, x: Values) -> None:
    """Horizontal axis of tails: ticks at the amplitudes themselves where they are few and apart."""
    span = float(x.max() - x.min())
    if 1 < x.size <= 6 and float(np.min(np.diff(np.sort(x)))) > 0.12 * span:
        axes.set_xticks(x, [f"{value:.3g}" for value in x])
    else:
        axes.xaxis.set_major_locator(MaxNLocator(5))
    margin = 0.08 * span if span > 0 else 0.5 * abs(float(x[0]))
    axes.set_xlim(float(x.min()) - margin, float(x.max()) + margin)
