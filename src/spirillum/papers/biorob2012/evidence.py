"""Evidence of a study for or against the paper's quantitative statements, and the numbers that the paper states.

The paper's data points are lost, and with them the tails' rates. A statement is judged only where it follows
for any rates, from the geometry, or from an observations file; else it is undecidable, and the reason gives
the computed values. Robot, motor and fluid (Tables I and II) and the calibration factors (Table III) are in the
presets `biorob2012-wide` and `biorob2012-narrow`.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from spirillum.arrays import Values
from spirillum.fluid.registry import SWIMMER_MODELS
from spirillum.robot.load import load
from spirillum.robot.robot import Robot
from spirillum.studies.band import reference_place
from spirillum.units import Hz

if TYPE_CHECKING:
    import xarray as xr


class LargestReynolds(NamedTuple):
    """The largest Reynolds number of a channel, and the tail that has it."""

    value: float
    """Re_max; the paper does not state its length scale."""
    wavelength_mm: float
    amplitude_mm: float
    figure: str
    """The figure whose caption states it."""


LARGEST_REYNOLDS = {
    "wide": LargestReynolds(0.0058, 25.0, 2.5, "Fig. 5"),
    "narrow": LargestReynolds(0.0038, 20.0, 1.5, "Fig. 6"),
}
"""By channel; captions of Figs 5 and 6."""

GLOBAL_DROP = 0.389
"""Relative loss of the mean velocity of all tails from the wide to the narrow channel; text on Figs 5 and 6."""

LOW_REYNOLDS = 0.1
"""Upper bound of low Reynolds number conditions; text."""

BODY_ROTATION_ERROR = 0.5
"""Largest relative error of the predicted body rotation rates; text on Figs 5 and 6."""

BODY_DRAG_FACTORS = {"wide": 1.95, "narrow": 3.6}
"""Factors on the isolated body's drag along the axis; Table III."""

ROBOT_LENGTH = 0.1
"""Lower bound of the prototype's length, m; text."""

NARROWER = 0.25
"""Relative reduction of the channel's radius from wide to narrow; text and Table I."""

FRAME_RATE = 30.0
"""Frame rate of the camera, Hz; text on the experiments."""


NO_RATES = "the observed rates are lost; give an observations file to decide"


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
        self.computed: tuple[str, ...] = tuple(computed)
        """Models that compute the channel's walls."""
        self.confined: tuple[str, ...] = tuple(name for name in self.models if name in computed or name in fitted)
        """Models that depend on the channel: those with walls, and those with factors that represent the walls."""

    def free(self, name: str, model: str, channel: str | None = None) -> Values:
        """A quantity of free swimming at the friction-free bound, (wavelength, amplitude) or both channels first."""
        chosen = self.dataset[name].sel(model=model, friction=self.bound)
        values: Values = chosen.sel(channel=channel or ["wide", "narrow"]).values
        return values

    def seen(self, name: str, channel: str | None = None) -> Values:
        """An observed quantity, (wavelength, amplitude) or with both channels first."""
        chosen = self.dataset[f"observed_{name}"]
        values: Values = chosen.sel(channel=channel or ["wide", "narrow"]).values
        return values

    def complete(self, *names: str) -> bool:
        """Whether these quantities were observed of every tail in both channels."""
        return self.observed and all(bool(np.all(np.isfinite(self.seen(name)))) for name in names)

    def lacking(self, *names: str) -> str:
        """Why a statement about all tails stays open: no observations, or not of all of them."""
        if not self.observed:
            return NO_RATES
        counts = []
        for name in names:
            seen = np.isfinite(self.seen(name))
            counts.append(f"{name.replace('_', ' ')} of {np.count_nonzero(seen)} of {seen.size} robots")
        return f"it speaks of all tails in both channels; the observations have {', '.join(counts)}"

    def tail(self, wavelength_mm: float, amplitude_mm: float) -> tuple[int, int] | None:
        """Indices of a tail in the grid, if it is there."""
        places = []
        for name, value in (("wavelength", wavelength_mm), ("amplitude", amplitude_mm)):
            near = np.flatnonzero(np.isclose(self.dataset[name].values, value * 1e-3, rtol=1e-6))
            if not near.size:
                return None
            places.append(int(near[0]))
        return places[0], places[1]

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
    def place(self) -> str:
        """Poses of the models that compute the walls, in words."""
        return reference_place(self._settings)


def fraction_between(values: Values) -> str:
    """A range of fractions in per cent."""
    return f"{100 * np.nanmin(values):.1f} to {100 * np.nanmax(values):.1f} %"


def in_hertz(rate: float) -> str:
    """A rate in Hz."""
    return f"{rate / Hz:.3g} Hz"
