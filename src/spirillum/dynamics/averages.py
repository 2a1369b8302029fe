"""Averages of a run: over its last two thirds, while the drive is on, and while the motion is steady."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.dynamics.timing import Switch
from spirillum.notes import Note
from spirillum.quantities import attributes

if TYPE_CHECKING:
    import xarray as xr

_WITHIN = 0.01
"""Relative difference from the end of a stretch below which a motion is steady."""
_LEAST_TURNS = 2
"""Turns for which a motion that changes within a turn has to be steady."""
_SINKS = 0.2
"""Ratio of vertical to horizontal displacement from which on a robot is reported to sink or rise."""
STEADY = (
    "from the time on at which speed and tail rate (of a free run: averaged over a turn of the tail) stay within 1 % "
    "of what they are at the end of their time on at constant duty, for at least half of that time (and two turns)"
)
"""What a steady motion is, in words."""


class DutyInterval(NamedTuple):
    """A time at constant duty."""

    start: float
    """s."""
    end: float
    """s."""


def stretches_on(switches: Sequence[Switch], end: float, begin: float = 0.0) -> list[DutyInterval]:
    """Times at constant duty in which the drive is on.

    Args:
        switches: every switching, the first at 0.
        end: end of the run, or of its drive, s.
        begin: beginning of the run, s.
    """
    found: list[DutyInterval] = []
    before = 0.0
    ends = [*(switch.time for switch in switches[1:]), end]
    for (switched, duty), after in zip(switches, ends, strict=True):
        start, stop = max(switched, begin), min(after, end)
        if duty > 0 and stop > start:
            if found and before == duty and found[-1].end == start:
                found[-1] = DutyInterval(found[-1].start, stop)
            else:
                found.append(DutyInterval(start, stop))
            before = duty
    return found


def run_averages(
    time: Samples,
    integrals: Mapping[str, tuple[Samples, str]],
    stretches: Sequence[DutyInterval],
    *,
    by_turn: bool,
) -> dict[str, tuple[Any, ...]]:
    """Averages as scalars of a dataset.

    `mean_...` is over the last two thirds of the run, the final two of the paper's three periods, `..._on` over the
    times at which the drive is on, `..._steady` over those of them at which the motion is steady (see `STEADY`); NaN
    where there are none.

    Args:
        time: sample times that contain the ends of all stretches, s, (n,).
        integrals: name of each average to the integral of its quantity at the samples, (n,), and the average's unit;
            `mean_forward_velocity` and `mean_tail_rotation_rate` among them.
        stretches: times at constant duty in which the drive is on.
        by_turn: whether speed and rate change within a turn of the tail.
    """
    judged = [integrals[name][0] for name in ("mean_forward_velocity", "mean_tail_rotation_rate")]
    steady = [part for stretch in stretches if (part := _steady_part(time, judged, stretch, by_turn=by_turn))]
    whole = [DutyInterval(float(time[0] + (time[-1] - time[0]) / 3.0), float(time[-1]))]
    found: dict[str, tuple[Any, ...]] = {}
    for ending, over, note in (
        ("", whole, "average over the last two thirds of the run"),
        ("_on", stretches, "average while the drive is on"),
        ("_steady", steady, "average while the drive is on and the motion steady"),
    ):
        for name, (values, unit) in integrals.items():
            words = f"{name.replace('_', ' ')}, {note}"
            source = "Section III of BioRob 2012" if not ending else "integrals of the run"
            found[name + ending] = (
                (),
                _average(time, values, over),
                {"units": unit, "long_name": words, "source": source},
            )
    found["time_on"] = ((), _length(stretches), attributes("time_on"))
    found["time_steady"] = ((), _length(steady), attributes("time_steady"))
    return found


def _length(stretches: Sequence[DutyInterval]) -> float:
    return float(sum(end - start for start, end in stretches))


def _average(time: Samples, values: Samples, stretches: Sequence[DutyInterval]) -> float:
    length = _length(stretches)
    gained = sum(float(np.diff(np.interp(stretch, time, values))[0]) for stretch in stretches)
    return gained / length if length > 0 else float("nan")


def _steady_part(
    time: Samples, judged: Sequence[Samples], stretch: DutyInterval, *, by_turn: bool
) -> DutyInterval | None:
    """End of a stretch in which all compared quantities are steady; None without one."""
    inside = time[(time >= stretch.start) & (time <= stretch.end)]
    if inside.size < 3:
        return None
    window = _turn(time, judged[1], stretch) if by_turn else 0.0
    if not window < 0.5 * (stretch.end - stretch.start):
        return None
    if by_turn:
        starts = np.append(inside[inside < stretch.end - window], stretch.end - window)
        ends = starts + window
    else:
        starts, ends = inside[:-1], inside[1:]
    means = np.array([(np.interp(ends, time, v) - np.interp(starts, time, v)) / (ends - starts) for v in judged])
    off = np.any(np.abs(means - means[:, -1:]) > _WITHIN * np.abs(means[:, -1:]), axis=0)
    last_off = np.flatnonzero(off)
    start = float(starts[last_off[-1] + 1]) if last_off.size else stretch.start
    if stretch.end - start < max(0.5 * (stretch.end - stretch.start), _LEAST_TURNS * window):
        return None
    if by_turn:  # whole turns, back from the end
        start = stretch.end - window * np.floor((stretch.end - start) / window * (1.0 + 1e-12))
    return DutyInterval(start, stretch.end)


def _turn(time: Samples, angle: Samples, stretch: DutyInterval) -> float:
    """Time of a turn in the second half of a stretch, s; infinite where nothing turns."""
    middle = 0.5 * (stretch.start + stretch.end)
    turned = abs(float(np.diff(np.interp([middle, stretch.end], time, angle))[0])) / (2.0 * np.pi)
    return (stretch.end - middle) / turned if turned > 0 else float("inf")


def vertical_drift(run: xr.Dataset) -> list[Note]:
    """A sentence on a robot that sinks or rises over the last two thirds of a run; none where it hardly does."""
    late = run.isel(time=slice(run.sizes["time"] // 3, None))
    way = late["position"].values[-1] - late["position"].values[0]
    if not abs(way[2]) > _SINKS * np.hypot(way[0], way[1]):
        return []
    upwards = float(way[2]) / float(late["time"][-1] - late["time"][0])
    pitch = float(np.degrees(late["pitch"].values[-1]))
    words = (
        f"it {'sinks' if upwards < 0 else 'rises'} at {1e3 * abs(upwards):.4g} mm/s over the last two thirds of "
        "the run, "
        f"pitched by {pitch:.3g} deg at the end: velocities are those along x"
    )
    return [Note("velocity-along-x", words, ("mean_forward_velocity",))]
