"""A free run of a robot in its tube from a user's request: table, pose, ends, flow, roughness, friction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.dynamics.release import InTube, Release, check_roughness, read_flow, released_state, turning_rate
from spirillum.dynamics.rotating_field import Field, in_tilted_field
from spirillum.dynamics.run_file import numbers_of, open_run, robot_of
from spirillum.dynamics.run_summary import end_state
from spirillum.dynamics.timing import Switch, Timing
from spirillum.dynamics.tube_robot import FRICTION_COEFFICIENT, Surroundings, TubeRobot, tube_robot
from spirillum.dynamics.tube_run import ENDS, tube_run
from spirillum.errors import InputError
from spirillum.fluid.tube.library import TabledTube
from spirillum.fluid.tube.table import BELOW, TubeTable, least_checked_gap
from spirillum.fluid.tube.tube import END_LOSS
from spirillum.kernels import core
from spirillum.kernels.core import MOTIONS, largest_yaw, resistance_at
from spirillum.kernels.tube_table import range_of
from spirillum.notes import Note, note_attributes, notes_in
from spirillum.progress import Progress
from spirillum.robot.batch import RobotBatch
from spirillum.robot.fields import field_values
from spirillum.robot.limits import check_stokes_flow, flow_limit, in_stokes_flow, motion_limits
from spirillum.robot.placement import Placement
from spirillum.robot.robot import Robot
from spirillum.robot.tube_pose import gap_of
from spirillum.swimming.prediction import Prediction, free_in_tube
from spirillum.swimming.preparation import check_domain, check_usual_resolution, table_for
from spirillum.swimming.scenario import NO_WEIGHT
from spirillum.units import show, show_height

if TYPE_CHECKING:
    import xarray as xr


def earlier_run(
    path: str | Path, steady: Prediction, table: TubeTable, links: TubeRobot, switches: Sequence[Switch]
) -> xr.Dataset:
    """The run in a file that another one continues."""
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
        "ends": (str(before.attrs.get("ends", "")), ENDS[int(links.tube[core.TUBE_ENDS])]),
        "friction": (str(before.attrs.get("friction", "")), steady.friction),
        "weight": (str(before.attrs.get("weight", weight)), weight),
        "roughness": (_number(before, "roughness"), links.roughness),
        "friction coefficient": (_number(before, "friction_coefficient"), float(links.tube[core.TUBE_COEFFICIENT])),
    }
    if pairs["ends"] == (ENDS[core.IMPOSED],) * 2:
        pairs["mean flow at its end"] = (float(numbers_of(before, "mean_flow")[-1]), flow)
    for what, (then, now) in pairs.items():
        if not _equal_values(then, now):
            return f"{what} {_as_text(then)}, and not {_as_text(now)}"
    old, own = ({item.path: item.value for item in field_values(robot)} for robot in (robot_of(before), steady.robot))
    other = (path for path in own | old if not _equal_values(old.get(path), own.get(path)))
    return next((f"another {path}" for path in other), "")


def weight_words(links: TubeRobot) -> str:
    """Whether weight and buoyancy act on a robot, as the attribute `weight` of a run."""
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


def _equal_values(then: Any, now: Any) -> bool:
    """Whether two values are the same, numbers to rounding."""
    if isinstance(then, float) and isinstance(now, float):
        return bool(np.isclose(then, now, rtol=1e-9, atol=1e-15, equal_nan=True))
    return bool(then == now)


def _as_text(value: str | float) -> str:
    return value if isinstance(value, str) else f"{value:.6g}"


def _number(dataset: xr.Dataset, name: str) -> float:
    """A number in a run's attributes."""
    try:
        return float(dataset.attrs[name])
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(
            f"the run has no number {name!r} among its attributes; allowed: a run by `simulate`"
        ) from error


_STARTS = ("gap", "eccentricity", "pitch", "yaw")  # Fields of a placement that define the initial pose.
_POSES = {"gap": "wall_gap", "offset": "offset", "pitch": "wall_pitch", "yaw": "wall_yaw"}
"""Where a run names a missing table."""


def run_in_tube(
    steady: Prediction,
    table: TubeTable,
    times: Timing,
    release: Release,
    field: Field,
    progress: Progress | None,
    tolerance: float = TubeRobot.tolerance,
) -> xr.Dataset:
    """A run with six degrees of freedom in the robot's tube."""
    robot, options = steady.robot, release.in_tube
    own = robot.drive.duty if robot.drive is not None else 1.0
    links = links_in_tube(steady, table.packed, release)
    links = replace(in_tilted_field(links, field), tolerance=tolerance)
    turn = links.turn
    timetable = times.timetable(turn, own)
    begun: Samples | xr.Dataset
    if options.continued is None:
        begun = released_state(robot, links, release.placement, options.azimuth)
    else:
        begun = earlier_run(options.continued, steady, table, links, timetable.switches)
    dataset = tube_run(steady, links, begun, timetable, wait=options.wait or 0.0, progress=progress)
    poses = {name: dataset[of].values for name, of in _POSES.items()}
    checked = compare_with_check(links.table, **poses, time=dataset["time"].values)
    notes = list(notes_in(dataset.attrs))
    limits = motion_limits(steady.batch, dataset["velocity"].values, dataset["tail_rotation_rate"].values)
    if options.flow is not None:
        limits.append(flow_limit(steady.batch, float(np.abs(links.flow[:, 1]).max())))
        notes += _flow_beyond(links.flow, float(dataset["time"][-1]), options.flow)
    if release.weight and not links.weight.any():
        notes.append(NO_WEIGHT)
    notes += check_stokes_flow(steady.batch, limits).values()
    stuck = sticking_notes(
        links,
        forward=float(dataset["mean_forward_velocity_steady"]),
        turning=0.5 * robot.body.diameter * float(dataset["mean_body_rotation_rate_steady"]),
        contact_force=float(dataset["contact_force"][-1]),
    )
    error = in_stokes_flow(table.speed_error_at(1.0), *limits)
    notes += stuck or (checked.notes if np.isfinite(error) else [])
    return dataset.assign_attrs(
        **note_attributes(notes),
        state=end_state(dataset, notes, float(links.tube[core.TUBE_SLIDING])),
        error_estimate=error if checked.known and not stuck else np.nan,
        known_error=free_in_tube(steady.fitted_by),
        table=table.key,
        weight=weight_words(links),
        error_against=table.error_against,
    )


def links_in_tube(steady: Prediction, table: Samples, release: Release) -> TubeRobot:
    """Coefficients of a robot's rates in its tube, by its packed table."""
    turn = 2.0 * np.pi / turning_rate(steady)
    return tube_robot(steady, table, _around(steady.robot, release), turn=turn, weight=release.weight)


def _flow_beyond(flow: Samples, end: float, source: str | Path) -> list[Note]:
    """A sentence on a flow file of several rows whose times are not those of the run; none for any other."""
    first, last = float(flow[0, 0]), float(flow[-1, 0])
    if len(flow) > 1 and first >= end:
        return [Note.named("flow-begins-late", source=source, first=first, end=end)]
    if len(flow) > 1 and last < end * (1.0 - 1e-9):
        return [Note.named("flow-ends-early", source=source, last=last, end=end)]
    return []


def table_of_run(robot: Robot, release: Release, progress: Progress | None) -> TubeTable:
    """The table of a robot that is released in its tube, made if there is none, once all else is known to be right."""
    batch = RobotBatch.of(robot, release.placement)
    check_domain(robot, TabledTube({}), batch)
    check_in_tube(robot, release)
    return table_for(batch, progress=progress)


def check_in_tube(robot: Robot, release: Release) -> None:
    """Refuse requests that a run in a tube does not support, before minutes go into a table."""
    placed, options, roughness, _ = release
    check_usual_resolution(robot.model)
    if placed.tail_drop:
        raise InputError(
            f"placement.tail_drop = {show(placed.tail_drop, 'mm')} has no effect in a free run; allowed: 0 mm"
        )
    _around(robot, release)
    if options.continued is not None:
        _check_continued(placed, options)
        return
    if roughness is not None and robot.channel is not None:
        gap = gap_of(placed, robot.body.diameter, 0.5 * robot.channel.diameter)
        check_roughness(roughness, gap, robot.body.diameter)


def _check_continued(placed: Placement, options: InTube) -> None:
    """Refuse another start of a run that begins where another one ended."""
    given = {f"placement.{name}" for name in placed.model_fields_set if getattr(placed, name) is not None}
    given |= {f"in_tube.{name}" for name in options.model_fields_set}
    for name in (*(f"placement.{field}" for field in _STARTS), "in_tube.azimuth", "in_tube.wait"):
        if name in given:
            raise InputError(
                f"{name} is given together with in_tube.continued, which begins where that run ended; allowed: one of "
                "them"
            )


def _around(robot: Robot, release: Release) -> Surroundings:
    channel, placed, options = robot.channel, release.placement, release.in_tube
    length = np.inf if channel is None or channel.length is None else channel.length
    radius = np.nan if channel is None else 0.5 * channel.diameter
    if options.flow is not None and (placed.flow is not None or placed.ends is not None):
        raise InputError(
            f"in_tube.flow = {str(options.flow)[:80]} excludes placement.flow and placement.ends; allowed: one of the "
            "three"
        )
    ends = core.IMPOSED
    flow: Samples = np.zeros((1, 2))
    if options.flow is not None:
        flow = read_flow(options.flow)
    elif placed.flow is not None:
        flow = np.array([[0.0, placed.flow]])
    else:
        ends = core.OPEN if placed.ends_of(length) == "open" else core.CLOSED
    if ends == core.OPEN and not np.isfinite(length):
        raise InputError("placement.ends = 'open' needs channel.length; allowed: closed ends, or a channel.length")
    return Surroundings(
        ends=ends,
        length=length + END_LOSS * radius,
        flow=flow,
        roughness=release.roughness,
        coefficient=FRICTION_COEFFICIENT if options.friction_coefficient is None else options.friction_coefficient,
    )


class Checked(NamedTuple):
    """Effect of the stated error of a table on a motion."""

    known: bool  #: Whether the motion keeps to yaws at which the table was checked.
    near: bool  #: Whether it comes nearer to the glass than where the flow around a whole robot was solved for.
    notes: list[Note]  #: Cautions about both, a sentence each.


def compare_with_check(
    table: Samples, *, gap: Samples, offset: Samples, pitch: Samples, yaw: Samples, time: Samples | None = None
) -> Checked:
    """Compare the poses of a motion, (n,), with those at which its table was checked; None: it repeats itself."""
    notes = []
    checked = np.array([largest_yaw(table, *pose) for pose in zip(offset, pitch, strict=True)])
    beyond = np.flatnonzero(np.abs(yaw) > checked)
    held = range_of(table)
    doubtful = (
        (np.abs(yaw) > checked) | (pitch > held.up.min(initial=np.inf)) | (-pitch > held.down.min(initial=np.inf))
    )
    outside = np.zeros(pitch.size, dtype=bool)
    for row in np.flatnonzero(doubtful):
        outside[row] = resistance_at(table, offset[row], pitch[row], yaw[row], 0.0, np.empty((MOTIONS, MOTIONS)))
    if outside.any():
        beyond = np.flatnonzero(outside)
        up, aside = (np.degrees(np.abs(angle[beyond]).max()) for angle in (pitch, yaw))
        notes.append(Note.named("beyond-table", since=_from(time, int(beyond[0])), pitch=up, yaw=aside))
    elif beyond.size:
        most = beyond[np.argmax(np.abs(yaw[beyond]))]
        reached, known = np.degrees(np.abs(yaw[most])), np.degrees(checked[most])
        notes.append(Note.named("beyond-checked-yaw", since=_from(time, int(beyond[0])), yaw=reached, checked=known))
    least = least_checked_gap(table)
    near = np.flatnonzero(gap < least)
    if near.size and not beyond.size:
        falls = "its least gap within a turn is" if time is None else f"{_from(time, int(near[0]))}its gap falls to"
        falls = f"{falls} {_length(float(gap[near].min()))}"
        notes.append(Note.named("below-checked-gap", gap=falls, least=_length(least), below=BELOW))
    return Checked(not beyond.size, bool(near.size), notes)


def sticking_notes(robot: TubeRobot, *, forward: float, turning: float, contact_force: float) -> list[Note]:
    """A sentence on a body that slides more slowly than dry friction is resolved; none on any other."""
    smoothed = float(robot.tube[core.TUBE_SLIDING])
    if not contact_force > 0.0 or not np.hypot(forward, turning) < smoothed:
        return []
    coefficient = float(robot.tube[core.TUBE_COEFFICIENT])
    return [Note.named("held-by-friction", coefficient=coefficient, speed=show(smoothed, "um/s"))]


def _from(time: Samples | None, first: int) -> str:
    return "" if time is None else f"from {float(time[first]):.3g} s on "


def _length(value: float) -> str:
    return show_height(float(f"{value:.2g}"))
