"""A one-piece swimmer in a rotating field: speed, rate, wobble and phase lag against the rate of the field."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from spirillum.arrays import Samples
from spirillum.units import Hz
from spirillum.view.figures.sheet import Sheet
from spirillum.view.figures.style import COLOURS, PATCH, UnitPrefix, plain, styled

if TYPE_CHECKING:
    import xarray as xr

_HELD: dict[str, Any] = {"color": "#555555", "linestyle": (0, (4, 2)), "label": "axial motion, closed form"}
_STEP_OUT: dict[str, Any] = {"color": "#999999", "linewidth": 0.8}
_POINTS: dict[str, Any] = {"marker": "o", "markersize": 3.5, "linewidth": 1.2}


def magnetic_figure(dataset: xr.Dataset) -> Figure:
    """Four panels over the rate of the field."""
    rate = dataset["field_rate"].values / Hz
    speed = dataset["forward_velocity"].values
    speeds = UnitPrefix.of(np.concatenate([speed, dataset["held_forward_velocity"].values]), "m/s")
    with styled():
        sheet = Sheet(
            f"{plain(dataset.attrs['robot'])} in a rotating field",
            f"model {dataset.attrs['model']} · free in unbounded fluid, without weight · field sped up step by step · "
            "computed, no measured data",
            heights=[1.9, 1.9],
            columns=2,
            sharex=True,
            sharey=False,
            legend=[
                Line2D([], [], color=COLOURS["blue"], **_POINTS, label="free"),
                Line2D([], [], color=COLOURS["green"], alpha=0.25, **PATCH, label="wobble, least to largest"),
                Line2D([], [], **_HELD),
                Line2D([], [], **_STEP_OUT, label="step-out in axial motion"),
            ],
        )
        panels = sheet.panels.ravel()
        fine, turning, lag = _constrained_response(dataset)
        advance = float(dataset["held_forward_velocity"][0] / dataset["held_tail_rotation_rate"][0])
        panels[0].plot(fine, speeds(advance * turning * Hz), **_HELD)
        panels[0].plot(rate, speeds(speed), color=COLOURS["blue"], **_POINTS)
        panels[0].set_ylabel(f"forward velocity ({speeds.unit})")
        panels[1].plot(fine, turning, **_HELD)
        panels[1].plot(rate, dataset["tail_rotation_rate"].values / Hz, color=COLOURS["vermillion"], **_POINTS)
        panels[1].set_ylabel("rate of the robot (Hz)")
        low, high = (np.rad2deg(dataset[f"{name}_wobble_angle"].values) for name in ("least", "largest"))
        panels[2].fill_between(rate, low, high, color=COLOURS["green"], alpha=0.25, linewidth=0)
        panels[2].plot(rate, np.rad2deg(dataset["wobble_angle"].values), color=COLOURS["green"], **_POINTS)
        panels[2].set_ylabel("wobble: robot's axis to field's (deg)")
        panels[2].set_ylim(0.0, max(1.0, 1.05 * float(high.max())))
        panels[3].plot(fine, np.rad2deg(lag), **_HELD)
        panels[3].plot(rate, np.rad2deg(dataset["phase_lag"].values), color=COLOURS["purple"], **_POINTS)
        panels[3].set_ylabel("moment behind field (deg)")
        panels[3].set_ylim(0.0, 95.0)
        for axes in panels:
            axes.axvline(float(dataset["step_out_rate"]) / Hz * float(np.sign(rate[0])), **_STEP_OUT)
        for axes in panels[2:]:
            axes.set_xlabel("rotation rate of the field (Hz)")
        return sheet.finished()


def _constrained_response(dataset: xr.Dataset) -> tuple[Samples, Samples, Samples]:
    """Rates of the field and of the constrained robot, Hz, and its phase lag, rad, in closed form."""
    rates, step_out = dataset["field_rate"].values / Hz, float(dataset["step_out_rate"]) / Hz
    sense = float(np.sign(rates[0]))
    size = np.unique(np.append(np.linspace(0.0, np.abs(rates).max(), 801), min(step_out, np.abs(rates).max())))
    follows = size <= step_out
    slipping = size - np.sqrt(np.where(follows, 0.0, size**2 - step_out**2))
    turning = np.where(follows, size, slipping)
    return sense * size, sense * turning, np.where(follows, np.arcsin(np.minimum(size / step_out, 1.0)), np.nan)
