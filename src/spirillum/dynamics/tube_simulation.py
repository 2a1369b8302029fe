"""A free run of a robot in its tube from what a user asks for: table, place, ends, flow, roughness, friction."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from spirillum.arrays import Samples
from spirillum.dynamics.earlier_run import earlier_run, weight_words
from spirillum.dynamics.integration import Progress
from spirillum.dynamics.start import start_phase, turning_rate
from spirillum.dynamics.table_check import held_against_check, held_by_friction
from spirillum.dynamics.timing import Timing
from spirillum.dynamics.tube_options import InTube, read_flow
from spirillum.dynamics.tube_robot import FRICTION_COEFFICIENT, Surroundings, TubeRobot, tube_robot
from spirillum.dynamics.tube_run import tube_run
from spirillum.dynamics.tube_start import StartPlace, check_roughness
from spirillum.dynamics.turning_field import Field, in_tilted_field
from spirillum.errors import InputError
from spirillum.fluid.tube.table import TubeTable
from spirillum.fluid.tube.tabled import TabledTube
from spirillum.fluid.tube.tube import END_LOSS
from spirillum.kernels import tube_motion as kernel
from spirillum.robot.placement import Placement
from spirillum.robot.robot import Robot
from spirillum.robot.seat import gap_of
from spirillum.swimming.prediction import Prediction, free_in_tube
from spirillum.swimming.preparation import check_usual_resolution
from spirillum.swimming.reynolds import check_stokes_flow, flow_limit, in_stokes_flow, motion_limits
from spirillum.units import show

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["check_in_tube", "links_in_tube", "run_in_tube"]

_STARTS = ("gap", "eccentricity", "pitch", "yaw")
"""Fields of a placement that say where a robot is laid down."""
_PLACES = {"gap": "wall_gap", "offset": "offset", "pitch": "wall_pitch", "yaw": "wall_yaw"}
"""Where a run says what a table is asked for."""


def run_in_tube(
    steady: Prediction,
    table: TubeTable,
    times: Timing,
    placed: Placement,
    asked: InTube,
    roughness: float | None,
    field: Field,
    weight: bool,  # noqa: FBT001 - one of the run's settings
    progress: Progress | None,
) -> xr.Dataset:
    """A run with six degrees of freedom in the robot's tube.

    Args:
        steady: the robot with friction and drive, by the model `tube`.
        table: the robot's table.
        times: length, sampling and remote.
        placed: where it is laid down, ends, and a constant flow.
        asked: azimuth, waiting time, dry friction, and a flow over time.
        roughness: height of the asperities, m; None: 1e-4 of the body's radius.
        field: axis about which the field of a robot with a magnet turns.
        weight: let weight and buoyancy act, if the masses are known.
        progress: told what is being computed, how much is done, and of how much.

    Raises:
        InputError: for a tail that does not turn, or a place where the robot cannot lie.
    """
    robot = steady.robot
    own = robot.drive.duty if robot.drive is not None else 1.0
    links, start = links_in_tube(steady, table, placed, asked, roughness, weight=weight)
    links = in_tilted_field(links, field)
    turn = links.turn
    timetable = times.timetable(turn, own)
    begun = start if asked.continued is None else earlier_run(asked.continued, steady, table, links, timetable.switches)
    dataset = tube_run(steady, links, begun, timetable, wait=asked.wait or 0.0, progress=progress)
    places = {name: dataset[of].values for name, of in _PLACES.items()}
    checked = held_against_check(links.table, **places, time=dataset["time"].values)
    said = [line for line in dataset.attrs["warnings"].split("\n") if line]
    limits = motion_limits(steady.batch, dataset["velocity"].values, dataset["tail_rotation_rate"].values)
    if asked.flow is not None:
        limits.append(flow_limit(steady.batch, float(np.abs(links.flow[:, 1]).max())))
        said += _flow_beyond(links.flow, float(dataset["time"][-1]), asked.flow)
    if weight and not links.weight.any():
        said.append("body.mass or tail.density is unset: the robot has no weight in the fluid")
    said += check_stokes_flow(steady.batch, limits).values()
    stuck = held_by_friction(
        links,
        forward=float(dataset["mean_forward_velocity_steady"]),
        turning=0.5 * robot.body.diameter * float(dataset["mean_body_rotation_rate_steady"]),
        contact_force=float(dataset["contact_force"][-1]),
    )
    error = in_stokes_flow(table.speed_error_at(1.0), *limits)
    said += stuck or (checked.said if np.isfinite(error) else [])
    return dataset.assign_attrs(
        warnings="\n".join(said),
        error_estimate=error if checked.known and not stuck else np.nan,
        known_error=free_in_tube(steady.fitted_by),
        table=table.key,
        weight=weight_words(links),
        error_against=TabledTube.error_against,
    )


def links_in_tube(
    steady: Prediction,
    table: TubeTable,
    placed: Placement,
    asked: InTube,
    roughness: float | None,
    *,
    weight: bool,
) -> tuple[TubeRobot, StartPlace]:
    """What a robot's rates in its tube follow from, and where it is laid down.

    Args:
        steady: the steady prediction of the robot.
        table: of the robot in its tube.
        placed: where it is laid down, as far as that is given.
        asked: of the motion in the tube: friction, contact, azimuth.
        roughness: height of the asperities of the wall, m; None: the usual one.
        weight: whether it has a weight.
    """
    turn = 2.0 * np.pi / turning_rate(steady)
    around = _around(steady.robot, placed, asked, roughness)
    links = tube_robot(steady, table.packed, around, turn=turn, weight=weight)
    start = StartPlace(
        gap=placed.gap,
        eccentricity=placed.eccentricity,
        pitch=placed.pitch or 0.0,
        yaw=placed.yaw,
        azimuth=asked.azimuth,
        phase=start_phase(steady.robot),
    )
    return links, start


def _flow_beyond(flow: Samples, end: float, source: str | Path) -> list[str]:
    """A sentence on a flow file of several rows whose times are not those of the run; none for any other."""
    first, last = float(flow[0, 0]), float(flow[-1, 0])
    if len(flow) == 1:
        return []
    if first >= end:
        return [
            f"{source} begins at {first:g} s, and the run ends at {end:.4g} s: the flow is that of its first row "
            "throughout"
        ]
    if last < end * (1.0 - 1e-9):
        return [f"{source} ends at {last:g} s, and the run at {end:.4g} s: from then on the flow is its last row's"]
    return []


def check_in_tube(robot: Robot, placed: Placement, asked: InTube, roughness: float | None) -> None:
    """Refuse what a run in a tube cannot be told, before minutes go into a table.

    Args:
        robot: the robot.
        placed: where it is laid down, ends, and a constant flow.
        asked: azimuth, waiting time, dry friction, and a flow over time.
        roughness: height of the asperities, m; None: 1e-4 of the body's radius.

    Raises:
        InputError: if there is something.
    """
    check_usual_resolution(robot.model)
    if placed.tail_drop:
        raise InputError(
            f"placement.tail_drop = {show(placed.tail_drop, 'mm')} is nothing that a free run knows; allowed: 0 mm"
        )
    _around(robot, placed, asked, roughness)
    if asked.continued is not None:
        _check_continued(placed, asked)
        return
    if roughness is not None and robot.channel is not None:
        gap = gap_of(placed, robot.body.diameter, 0.5 * robot.channel.diameter)
        check_roughness(roughness, gap, robot.body.diameter)


def _check_continued(placed: Placement, asked: InTube) -> None:
    """Refuse another start of a run that begins where another one ended.

    Raises:
        InputError: if there is one.
    """
    given = {f"placement.{name}" for name in placed.model_fields_set if getattr(placed, name) is not None}
    given |= {f"in_tube.{name}" for name in asked.model_fields_set}
    for name in (*(f"placement.{field}" for field in _STARTS), "in_tube.azimuth", "in_tube.wait"):
        if name in given:
            raise InputError(
                f"{name} is given together with in_tube.continued, which begins where that run ended; allowed: one of "
                "them"
            )


def _around(robot: Robot, placed: Placement, asked: InTube, roughness: float | None) -> Surroundings:
    channel = robot.channel
    length = np.inf if channel is None or channel.length is None else channel.length
    radius = np.nan if channel is None else 0.5 * channel.diameter
    if asked.flow is not None and (placed.flow is not None or placed.ends is not None):
        raise InputError(
            f"in_tube.flow = {str(asked.flow)[:80]} is given together with placement.flow or placement.ends; allowed: "
            "one of them, for an imposed flow leaves the ends no say"
        )
    ends = kernel.IMPOSED
    flow: Samples = np.zeros((1, 2))
    if asked.flow is not None:
        flow = read_flow(asked.flow)
    elif placed.flow is not None:
        flow = np.array([[0.0, placed.flow]])
    else:
        ends = kernel.OPEN if placed.ends_of(length) == "open" else kernel.CLOSED
    if ends == kernel.OPEN and not np.isfinite(length):
        raise InputError("placement.ends = 'open' needs channel.length; allowed: closed ends, or a channel.length")
    return Surroundings(
        ends=ends,
        length=length + END_LOSS * radius,
        flow=flow,
        roughness=roughness,
        coefficient=FRICTION_COEFFICIENT if asked.friction_coefficient is None else asked.friction_coefficient,
    )
