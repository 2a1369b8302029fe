"""An earlier run in the tube that is to be continued: of the same robot, in the same surroundings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from spirillum.dynamics.remote import Switch
from spirillum.dynamics.run_file import numbers_of, open_run, robot_of
from spirillum.dynamics.tube_robot import TubeRobot
from spirillum.dynamics.tube_run import ENDS
from spirillum.errors import InputError
from spirillum.fluid.tube.table import TubeTable
from spirillum.kernels import tube_motion as kernel
from spirillum.swimming.prediction import Prediction

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["earlier_run", "weight_words"]


def earlier_run(
    path: str | Path, steady: Prediction, table: TubeTable, links: TubeRobot, switches: Sequence[Switch]
) -> xr.Dataset:
    """The run in a file that another one continues.

    Args:
        path: the file.
        steady: the robot as it is now, with friction and drive.
        table: its table.
        links: what its rates in the tube follow from now.
        switches: every switching of the remote, the first at 0.

    Raises:
        InputError: if the file is none, of another robot or tube, of other surroundings, or switched otherwise.
    """
    found = open_run(path)
    name, own, other = steady.robot.name, table.key, str(found.attrs.get("table", ""))
    if other != own:
        what = "no run in a tube" if not other else f"a run of another robot, tube or version than {name}'s"
        raise InputError(f"in_tube.continued = {str(path)[:80]}: {what}; allowed: an earlier run of this robot")
    for needed in ("time", "azimuth", "body_angle", "tail_phase", "tail_angle"):
        numbers_of(found, needed)
    if not found.sizes.get("time"):
        raise InputError(f"in_tube.continued = {str(path)[:80]} has no samples; allowed: an earlier run of this robot")
    if changed := _changed(found, steady, links) or _switched_otherwise(found, switches):
        raise InputError(
            f"in_tube.continued = {str(path)[:80]} is a run with {changed}; allowed: all as in that run, which is "
            "continued as if it had not ended"
        )
    return found


def _changed(before: xr.Dataset, steady: Prediction, links: TubeRobot) -> str:
    """What was otherwise in an earlier run: there, and now; empty where nothing was."""
    end = float(numbers_of(before, "time")[-1])
    flow = float(np.interp(end, *links.flow.T))
    weight = weight_words(links)
    pairs: dict[str, tuple[str | float, str | float]] = {
        "ends": (str(before.attrs.get("ends", "")), ENDS[float(links.tube[kernel.ENDS])]),
        "friction": (str(before.attrs.get("friction", "")), steady.friction),
        "weight": (str(before.attrs.get("weight", weight)), weight),
        "roughness": (_number(before, "roughness"), links.roughness),
        "friction coefficient": (_number(before, "friction_coefficient"), float(links.tube[kernel.COEFFICIENT])),
    }
    if pairs["ends"] == (ENDS[kernel.IMPOSED],) * 2:
        pairs["mean flow at its end"] = (float(numbers_of(before, "mean_flow")[-1]), flow)
    for what, (then, now) in pairs.items():
        if not _alike(then, now):
            return f"{what} {_said(then)}, and not {_said(now)}"
    fields = _other_fields(robot_of(before).model_dump(), steady.robot.model_dump())
    return f"another {fields[0]}" if fields else ""


def weight_words(links: TubeRobot) -> str:
    """Whether weight and buoyancy act on a robot, as a run's attribute `weight` says it."""
    return "acts" if links.weight.any() else "left out"


def _switched_otherwise(before: xr.Dataset, switches: Sequence[Switch]) -> str:
    """The first sample of an earlier run at which the remote would now stand otherwise; empty where none is."""
    times, then = numbers_of(before, "time"), numbers_of(before, "duty")
    starts = np.array([switch.time for switch in switches])
    now = np.array([switch.duty for switch in switches])[np.searchsorted(starts, times, side="right") - 1]
    at_switch = np.any(np.isclose(times[:, None], starts, rtol=1e-9, atol=1e-9), axis=1)
    other = np.flatnonzero((np.abs(then - now) > 1e-9) & ~at_switch & (times >= 0.0))
    if not other.size:
        return ""
    first = other[0]
    return f"duty {then[first]:.4g} at {times[first]:.4g} s, and not {now[first]:.4g}"


def _alike(then: Any, now: Any) -> bool:
    """Whether two values are the same, numbers to rounding."""
    if isinstance(then, float) and isinstance(now, float):
        return bool(np.isclose(then, now, rtol=1e-9, atol=1e-15, equal_nan=True))
    return bool(then == now)


def _said(value: str | float) -> str:
    return value if isinstance(value, str) else f"{value:.6g}"


def _other_fields(then: Mapping[str, Any], now: Mapping[str, Any], prefix: str = "") -> list[str]:
    """Dotted names of the fields in which two robots differ, but for rounding."""
    found = []
    for name, value in now.items():
        old = then.get(name)
        if isinstance(value, Mapping) and isinstance(old, Mapping):
            found += _other_fields(old, value, f"{prefix}{name}.")
        elif not _alike(old, value):
            found.append(f"{prefix}{name}")
    return found


def _number(dataset: xr.Dataset, name: str) -> float:
    """A number in a run's attributes.

    Raises:
        InputError: if it is none.
    """
    try:
        return float(dataset.attrs[name])
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(
            f"the run has no number {name!r} among its attributes; allowed: a run by `simulate`"
        ) from error
