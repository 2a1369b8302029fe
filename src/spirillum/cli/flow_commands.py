"""The command `spirillum flow`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from spirillum.cli.inputs import angle, loaded_robot, placement_from
from spirillum.cli.options import (
    Eccentricity,
    Ends,
    Friction,
    Gap,
    ImposedFlow,
    Json,
    Pitch,
    RobotArgument,
    Settings,
    TailDrop,
    TailRate,
    Tolerance,
    complete_frames,
    complete_planes,
    starting,
)

__all__ = ["flow"]


def _complete_accuracies(incomplete: str) -> list[str]:
    return starting(("high", "standard"), incomplete)


def _complete_models(incomplete: str) -> list[str]:
    return starting(("auto", "slender", "tube"), incomplete)


def flow(
    robot: RobotArgument,
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
    from spirillum.fields.answer import flow_answer
    from spirillum.fields.flow import box_around, plane_around, seat_in_tube
    from spirillum.fields.flow import flow as answer
    from spirillum.results.flow import check_targets, write_flow

    check_targets(output, volume)
    loaded = loaded_robot(robot, settings)
    placement = placement_from(gap, eccentricity, pitch, tail_drop, ends, imposed_flow)
    fineness = {"accuracy": accuracy, "tolerance": tolerance}
    seat = seat_in_tube(loaded, model, placement, fineness)
    plane_around(loaded, plane, offset, extent, resolution, seat)
    if volume is not None:
        box_around(loaded, extent, volume_resolution, seat)
    with renderer.progress_bar(quiet=json) as progress:
        progress("flow: forces on the robot", 0, 1)
        found = answer(
            loaded,
            model=model,
            tail_rate=tail_rate,
            friction=friction,
            resolution=fineness,
            placement=placement,
            phase=angle(phase),
            frame=frame,
        )
        written = {}
        if output is not None:
            written[output] = found.plane(plane, offset=offset, extent=extent, resolution=resolution, progress=progress)
        if volume is not None:
            written[volume] = found.volume(extent=extent, resolution=volume_resolution, progress=progress)
        for path, dataset in written.items():
            write_flow(found, dataset, path)
    renderer.show(flow_answer(found, written), json=json)
