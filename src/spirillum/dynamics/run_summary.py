"""Runs and sweeps as answers: averages, final values, the state at the end, and what happened."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.dynamics.integration import END_OF_CHANNEL, RANGE_LEFT
from spirillum.dynamics.timing import Switch
from spirillum.envelope import envelope, interval, quantity
from spirillum.notes import Note, notes_in
from spirillum.quantities import attributes
from spirillum.swimming.motions import SteadyState

if TYPE_CHECKING:
    import xarray as xr


_ENDS = (
    "position",
    "tail_angle",
    "body_angle",
    "pitch",
    "yaw",
    "wall_gap",
    "offset",
    "azimuth",
    "wall_pitch",
    "wall_yaw",
    "contact_force",
    "contact_energy",
    "wobble_angle",
    "phase_lag",
    "electrical_energy",
    "battery_charge_used",
)


def run_answer(dataset: xr.Dataset) -> dict[str, Any]:
    """Averages of a run, its final values, and what happened in it."""
    last, attrs = dataset.isel(time=-1), dataset.attrs
    content: dict[str, Any] = {
        **_known_attributes(attrs, "robot", "model", "model_reason", "friction", "motion"),
        "error_estimate": quantity(
            float(attrs["error_estimate"]),
            "1",
            **({"against": attrs["error_against"]} if "error_against" in attrs else {}),
            statement=attrs["known_error"],
        ),
        **({"placement": json.loads(attrs["placement"])} if "placement" in attrs else {}),
        **_in_the_tube(dataset),
        "events": json.loads(attrs["events"]),
        **_known_attributes(attrs, "state", "steady"),
        "duration": quantity(float(last["time"]), "s"),
    }
    if (begins := float(dataset["time"][0])) > 0.0:
        content["begins"] = quantity(begins, "s", meaning="first sample of a continued run; means are over this part")
    scalars = [str(name) for name, variable in dataset.data_vars.items() if variable.ndim == 0]
    content |= {
        name: quantity(float(dataset[name]), str(dataset[name].attrs["units"]), **_interval(dataset, name))
        for name in scalars
        if not name.endswith(("_low", "_high"))
    }
    if "draws" in dataset.attrs:
        content["draws"] = int(dataset.attrs["draws"])
    content |= {
        f"final_{name}": quantity(last[name].values.tolist(), str(last[name].attrs["units"]))
        for name in _ENDS
        if name in dataset
    }
    return envelope("simulation", content, notes_in(dataset.attrs))


def _known_attributes(attrs: Mapping[str, Any], *names: str) -> dict[str, Any]:
    """The attributes of these names that there are."""
    return {name: attrs[name] for name in names if name in attrs}


def _interval(dataset: xr.Dataset, name: str) -> dict[str, Any]:
    if f"{name}_low" not in dataset:
        return {}
    return interval(float(dataset[f"{name}_low"]), float(dataset[f"{name}_high"]), float(dataset.attrs["level"]))


def sweep_answer(dataset: xr.Dataset) -> dict[str, Any]:
    """Every quantity of a sweep as a list over the rates of the field."""
    content: dict[str, Any] = {
        **_known_attributes(dataset.attrs, "robot", "model", "model_reason"),
        "step_out_rate": quantity(float(dataset["step_out_rate"]), "rad/s"),
        "field_rate": quantity(dataset["field_rate"].values, "rad/s"),
    }
    content |= {
        str(name): quantity(variable.values, str(variable.attrs["units"]))
        for name, variable in dataset.data_vars.items()
        if variable.ndim == 1
    }
    return envelope("magnetic-sweep", content, notes_in(dataset.attrs))


def _in_the_tube(dataset: xr.Dataset) -> dict[str, Any]:
    """Under what a run in the tube was made."""
    if "table" not in dataset.attrs:
        return {}
    attrs = dataset.attrs
    found = {
        "ends": attrs["ends"],
        "gap": quantity(float(dataset["wall_gap"][0]), "m", meaning="of the body, when the run begins"),
        "roughness": quantity(float(attrs["roughness"]), "m"),
        "friction_coefficient": quantity(float(attrs["friction_coefficient"]), "1"),
        "wait": quantity(float(attrs["wait"]), "s"),
    }
    if attrs["ends"] == "imposed flow":
        time = dataset["time"].values
        mean = float(dataset["mean_flow"].integrate("time")) / float(time[-1] - time[0])
        found["mean_flow"] = quantity(mean, "m/s", meaning="through the tube, over the run")
    return {"in_tube": found}


_MOST_ALIKE = 4  # Events of one kind that are listed one by one.


class MergedEvent(NamedTuple):
    """An event, or the first of many that are alike; times in s."""

    time: float
    what: str
    times: int
    last: float  #: When for the last time, s.


def merged_events(events: Sequence[tuple[float, str]]) -> list[MergedEvent]:
    """Events in the order of time; those that come more than a few times, as where a contact bounces, are one."""
    moments_of: dict[str, list[float]] = {}
    for when, what in events:
        moments_of.setdefault(what, []).append(when)
    found = []
    for what, moments in moments_of.items():
        if len(moments) > _MOST_ALIKE:
            found.append(MergedEvent(min(moments), what, len(moments), max(moments)))
        else:
            found += [MergedEvent(when, what, 1, when) for when in moments]
    return sorted(found)


_WITHIN = 0.01  # Relative difference from the end of a stretch below which a motion is steady.
_LEAST_TURNS = 2  # Turns for which a motion that changes within a turn has to be steady.
_SINKS = 0.2  # Ratio of vertical to horizontal displacement from which on a robot is reported to sink or rise.
STEADY = (
    "from the time on at which speed and tail rate (of a free run: averaged over a turn of the tail) stay within 1 % "
    "of what they are at the end of their time on at constant duty, for at least half of that time (and two turns)"
)
"""What a steady motion is, in words."""


class DutyInterval(NamedTuple):
    """A time at constant duty, s."""

    start: float
    end: float


def stretches_on(switches: Sequence[Switch], end: float, begin: float = 0.0) -> list[DutyInterval]:
    """Times at constant duty in which the drive is on."""
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
    time: Samples, integrals: Mapping[str, tuple[Samples, str]], stretches: Sequence[DutyInterval], *, by_turn: bool
) -> dict[str, tuple[Any, ...]]:
    """Averages as scalars of a dataset, from integrals of quantities at the samples (and the averages' units)."""
    # `mean_...` is over the last two thirds of the run, the final two of the paper's three periods, `..._on` over the
    # times at which the drive is on, `..._steady` over those of them at which the motion is steady (see `STEADY`); NaN
    # where there are none. With `by_turn` speed and rate change within a turn of the tail.
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
            length = _length(over)
            gained = sum(float(np.diff(np.interp(stretch, time, values))[0]) for stretch in over)
            found[name + ending] = (
                (),
                (gained / length if length > 0 else float("nan")),
                {"units": unit, "long_name": words, "source": source},
            )
    found["time_on"] = ((), _length(stretches), attributes("time_on"))
    found["time_steady"] = ((), _length(steady), attributes("time_steady"))
    return found


def _length(stretches: Sequence[DutyInterval]) -> float:
    return float(sum(end - start for start, end in stretches))


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
    moves = "sinks" if upwards < 0 else "rises"
    return [Note.named("vertical-drift", moves=moves, speed=1e3 * abs(upwards), pitch=pitch)]


def end_state(run: xr.Dataset, notes: Iterable[Note], slow: float) -> str:
    """Return the key of `END_STATES` for a run in a tube."""
    events = str(run.attrs["events"])
    if END_OF_CHANNEL in events:
        return "reaches-end"
    if RANGE_LEFT in events:
        return "left-table"
    late = run[["position", "azimuth"]].isel(time=slice(run.sizes["time"] // 3, None))
    moved = np.abs(late["position"].values[-1] - late["position"].values[0]).max()
    is_slow = moved < slow * float(late["time"][-1] - late["time"][0]) and not float(run["duty"][-1]) > 0.0
    if is_slow or is_held(notes):
        return "standing"
    if np.ptp(late["azimuth"].values) > 2.0 * np.pi:
        return "orbit"
    if np.cos(late["azimuth"].values).mean() < 0.0:
        return "ceiling"
    return "steady" if float(run["time_steady"]) > 0.0 else "changing"


def state_of(lying: SteadyState, notes: Iterable[Note]) -> str:
    """Return the key of `END_STATES` for a motion that was followed to its steady state."""
    if is_held(notes):
        return "standing"
    if RANGE_LEFT in lying.ended:
        return "left-table"
    if lying.state == "steady" and np.cos(lying.azimuth) < 0.0:
        return "ceiling"
    return {"orbits": "orbit", "goes around": "orbit"}.get(lying.state, lying.state)


def is_held(notes: Iterable[Note]) -> bool:
    """Whether dry friction holds the robot."""
    return any(note.code == "held-by-friction" for note in notes)
