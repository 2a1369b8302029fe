"""The command `spirillum settle`."""

from __future__ import annotations

from typing import Annotated

import typer

from spirillum.cli.inputs import loaded_robot, placement_from
from spirillum.cli.shared_options import (
    Calibration,
    Eccentricity,
    Ends,
    Friction,
    Gap,
    ImposedFlow,
    Json,
    Picture,
    Pitch,
    RobotArgument,
    Settings,
    TailRate,
    Yaw,
)


def settle(
    robot: RobotArgument,
    output: Picture = None,
    tail_rate: TailRate = None,
    friction: Friction = None,
    calibration: Calibration = None,
    gap: Gap = None,
    eccentricity: Eccentricity = None,
    pitch: Pitch = None,
    yaw: Yaw = None,
    azimuth: Annotated[
        str | None,
        typer.Option(
            metavar="ANGLE", help="Azimuth of the body's centre at the start, about +x from the lowest place."
        ),
    ] = None,
    ends: Ends = None,
    flow: ImposedFlow = None,
    no_weight: Annotated[bool, typer.Option("--no-weight", help="Leave weight and buoyancy out.")] = False,
    roughness: Annotated[
        str | None, typer.Option(metavar="LENGTH", help="Height of the asperities, else 1e-4 of the body's radius.")
    ] = None,
    friction_coefficient: Annotated[
        float | None, typer.Option(help="Coefficient of dry friction where asperities touch; else 0.1.")
    ] = None,
    until: Annotated[
        str | None,
        typer.Option(metavar="LENGTH", help="Gap to which draining is timed; else a fifth of that at the start."),
    ] = None,
    settings: Settings = None,
    json: Json = False,
) -> None:
    """Follow a robot laid down in its tube to where it comes to lie: its way, gap, azimuth, tilt, speed and body rate.

    Example: `spirillum settle biorob2012-wide --gap 0.5mm --roughness 20um`
    """
    from spirillum.cli import renderer
    from spirillum.dynamics.settling import settle as answer
    from spirillum.files import PICTURES, output_target

    target = None if output is None else output_target(output, PICTURES, "settling.png")
    loaded = loaded_robot(robot, settings, calibration)
    with renderer.progress_bar(quiet=json) as progress:
        found = answer(
            loaded,
            tail_rate=tail_rate,
            friction=friction,
            calibration=calibration,
            placement=placement_from(gap, eccentricity, pitch, None, ends, flow, yaw),
            weight=not no_weight,
            roughness=roughness,
            in_tube={"azimuth": azimuth, "friction_coefficient": friction_coefficient},
            until=until,
            progress=progress,
        )
    if target is not None:
        from spirillum.view.figures.release import settling_figure
        from spirillum.view.figures.style import save_as

        save_as(settling_figure(found), target)
    file = None if output is None else str(output)
    renderer.show(renderer.with_files(found.to_dict(), file=file), json=json)
