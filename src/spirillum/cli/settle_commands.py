"""The command `spirillum settle`."""

from __future__ import annotations

from typing import Annotated

import typer

from spirillum.cli.inputs import gap_range, loaded_robot, placement_from
from spirillum.cli.options import (
    Accuracy,
    Eccentricity,
    Ends,
    Friction,
    Gap,
    Json,
    Phases,
    Picture,
    RobotArgument,
    Settings,
    TailDrop,
    TailRate,
    Tolerance,
)

__all__ = ["settle"]


def settle(
    robot: RobotArgument,
    output: Picture = None,
    tail_rate: TailRate = None,
    friction: Friction = None,
    gap: Gap = None,
    eccentricity: Eccentricity = None,
    tail_drop: TailDrop = None,
    ends: Ends = None,
    drain: Annotated[
        str | None,
        typer.Option(metavar="FROM:TO", help="Gaps between which the film drains, such as 1mm:0.2mm."),
    ] = None,
    gaps: Annotated[int, typer.Option(help="Number of gaps at which the film is computed, 2 to 32.")] = 5,
    accuracy: Accuracy = None,
    tolerance: Tolerance = None,
    phases: Phases = None,
    settings: Settings = None,
    json: Json = False,
) -> None:
    """Find where in its tube a robot comes to lie: azimuth, rest, and the draining of the film under it.

    Example: `spirillum settle biorob2012-wide --tail-rate 1.2Hz --gap 0.5mm`
    """
    from spirillum.cli import renderer
    from spirillum.dynamics.settling import settle as answer
    from spirillum.files import PICTURES, output_target

    target = None if output is None else output_target(output, PICTURES, "settling.png")
    loaded = loaded_robot(robot, settings)
    with renderer.progress_bar(quiet=json) as progress:
        found = answer(
            loaded,
            tail_rate=tail_rate,
            friction=friction,
            resolution={"accuracy": accuracy, "tolerance": tolerance, "phases": phases},
            placement=placement_from(gap, eccentricity, None, tail_drop, ends, None),
            drain=None if drain is None else gap_range(drain),
            gaps=gaps,
            progress=progress,
        )
    if target is not None:
        from spirillum.view.figures.settling import settling_figure
        from spirillum.view.figures.style import save_as

        save_as(settling_figure(found), target)
    file = None if output is None else str(output)
    renderer.show(renderer.with_files(found.to_dict(), file=file), json=json)
