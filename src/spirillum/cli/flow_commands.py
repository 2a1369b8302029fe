"""The command `spirillum flow`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from spirillum.cli.inputs import angle, given_options, loaded_robot, placement_from
from spirillum.cli.shared_options import (
    Eccentricity,
    Ends,
    Friction,
    Gap,
    ImposedFlow,
    Json,
    Pitch,
    Settings,
    TailDrop,
    TailRate,
    Tolerance,
    Yaw,
    complete_frames,
    complete_planes,
    complete_robots,
    starting,
)
from spirillum.errors import InputError

if TYPE_CHECKING:
    from spirillum.fields.flow import Flow

_OF_PLANES = ("plane", "offset", "resolution")
_OF_RUNS = (
    *("robot", "tail_rate", "friction", "settings", "phase"),
    *("gap", "eccentricity", "pitch", "yaw", "tail_drop", "ends", "imposed_flow"),
)
"""What a run says itself."""


def _complete_accuracies(incomplete: str) -> list[str]:
    return starting(("high", "standard"), incomplete)


def _complete_models(incomplete: str) -> list[str]:
    from spirillum.fields.flow import FLOW_MODELS

    return starting(("auto", *FLOW_MODELS), incomplete)


def flow(
    context: typer.Context,
    robot: Annotated[
        str | None,
        typer.Argument(autocompletion=complete_robots, help="A preset's name or a TOML file; none with --run."),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="FILE", help="The plane: .png, .pdf, .svg, or .nc with its numbers."),
    ] = None,
    volume: Annotated[
        Path | None, typer.Option(metavar="FILE", help="A box around the robot: .vti for ParaView, or .nc.")
    ] = None,
    plane: Annotated[
        str, typer.Option(autocompletion=complete_planes, help="xz (side), xy (from above) or yz (across).")
    ] = "xz",
    offset: Annotated[
        str, typer.Option(metavar="LENGTH", help="Place of the plane on the axis across it, such as -50mm.")
    ] = "0mm",
    extent: Annotated[
        str | None,
        typer.Option(metavar="LENGTH", help="How far plane and box reach beyond the robot; else 1.2 diameters."),
    ] = None,
    resolution: Annotated[int, typer.Option(help="Points along the plane's longer side.")] = 240,
    volume_resolution: Annotated[int, typer.Option(help="Points along the box's longest side.")] = 80,
    phase: Annotated[str, typer.Option(metavar="ANGLE", help="Phase of the tail, such as 90deg.")] = "0rad",
    frame: Annotated[
        str, typer.Option(autocompletion=complete_frames, help="lab, or body (moving with its forward velocity).")
    ] = "lab",
    model: Annotated[
        str,
        typer.Option(
            autocompletion=_complete_models,
            help="slender (unbounded fluid), tube (in the channel), or auto: tube where there is a channel.",
        ),
    ] = "auto",
    run: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="The flow at a moment of a free run in a tube instead, by `simulate`."),
    ] = None,
    time: Annotated[str | None, typer.Option(metavar="TIME", help="With --run: the moment, such as 0.5s.")] = None,
    tail_rate: TailRate = None,
    friction: Friction = None,
    accuracy: Annotated[
        str | None,
        typer.Option(
            autocompletion=_complete_accuracies,
            help="Of the models: standard or high; else high with slender, the robot's with tube.",
        ),
    ] = None,
    gap: Gap = None,
    eccentricity: Eccentricity = None,
    pitch: Pitch = None,
    yaw: Yaw = None,
    tail_drop: TailDrop = None,
    ends: Ends = None,
    imposed_flow: ImposedFlow = None,
    tolerance: Tolerance = None,
    settings: Settings = None,
    json: Json = False,
) -> None:
    """Compute velocity and pressure of the fluid around the swimming robot: a picture, or numbers on a grid.

    Example: `spirillum flow biorob2012-wide -o flow.png --tail-rate 1.2Hz`
    """
    from spirillum.cli import renderer
    from spirillum.fields.flow import box_around, plane_around, seat_in_tube
    from spirillum.fields.flow import flow as answer
    from spirillum.fields.flow_summary import flow_answer
    from spirillum.files import guard_inputs
    from spirillum.fluid.tube.domain import seat_of
    from spirillum.results.flow import check_targets, write_flow

    with guard_inputs(run):
        check_targets(output, volume)
    _check_options(context, output, volume, run, time, model)
    placement = placement_from(gap, eccentricity, pitch, tail_drop, ends, imposed_flow, yaw)
    fineness = {"accuracy": accuracy, "tolerance": tolerance}
    if run is None:
        if robot is None or time is not None:
            said = "no robot" if robot is None else f"time = {time} without a run"
            raise InputError(f"{said}; allowed: a preset's name or a robot file, or --run RUN.nc --time TIME")
        loaded = loaded_robot(robot, settings)
        seat = seat_in_tube(loaded, model, placement, fineness)

        def around() -> Flow:
            return answer(
                loaded,
                model=model,
                tail_rate=tail_rate,
                friction=friction,
                resolution=fineness,
                placement=placement,
                phase=angle(phase),
                frame=frame,
            )
    else:
        from spirillum.dynamics.flow_of_run import flow_of_run, moment_of_run

        moment = moment_of_run(run, str(time), fineness).prediction
        loaded, seat = moment.robot, seat_of(moment.batch)

        def around() -> Flow:
            return flow_of_run(run, str(time), frame=frame, resolution=fineness, progress=progress)

    plane_around(loaded, plane, offset, extent, resolution, seat)
    if volume is not None:
        box_around(loaded, extent, volume_resolution, seat)
    with renderer.progress_bar(quiet=json) as progress, guard_inputs(run):
        if run is None:
            progress("flow: forces on the robot", 0, 1)
        found = around()
        written = {}
        if output is not None:
            written[output] = found.plane(plane, offset=offset, extent=extent, resolution=resolution, progress=progress)
        if volume is not None:
            written[volume] = found.volume(extent=extent, resolution=volume_resolution, progress=progress)
        for path, dataset in written.items():
            write_flow(found, dataset, path)
    renderer.show(flow_answer(found, written), json=json)


def _check_options(
    context: typer.Context, output: Path | None, volume: Path | None, run: Path | None, time: str | None, model: str
) -> None:
    """Refuse options of a file that is not asked for, and what a run says itself.

    Args:
        context: of the command.
        output: file of the plane; None without one.
        volume: file of the box; None without one.
        run: the run; None for the flow around a robot.
        time: moment of the run; None without one.
        model: as it was asked for.
    """
    if output is None and (given := given_options(context, *_OF_PLANES)):
        raise InputError(f"{given[0]} without a plane (-o FILE), to which it belongs; allowed: both or neither")
    if volume is None and given_options(context, "volume_resolution"):
        raise InputError("--volume-resolution without --volume FILE, to which it belongs; allowed: both or neither")
    if run is None:
        return
    ours = () if model in ("auto", "tube") else ("model",)
    if given := given_options(context, *_OF_RUNS, *ours):
        raise InputError(f"{given[0]} together with a run, which says it; allowed: --run and --time alone")
    if time is None:
        raise InputError("no moment of the run; allowed: --time, such as 0.5s")
