"""The command `spirillum settle`."""

from __future__ import annotations

from spirillum.cli.function_command import Request, from_function
from spirillum.cli.shared_options import NO_START, Json, Picture


@from_function(
    "spirillum.dynamics.settling:settle",
    without={**NO_START, "placement.tail_drop": "no rigid tail moves with it"},
)
def settle(request: Request, *, output: Picture = None, json: Json = False) -> None:
    """Follow a robot released in its tube to its steady state: path, gap, azimuth, tilt, speed and body rate.

    Example: `spirillum settle biorob2012-wide --gap 0.5mm --roughness 20um`
    """
    from spirillum.cli import renderer

    draw = renderer.picture(output, "settling.png", "spirillum.view.figures.release:settling_figure")
    with renderer.progress_bar(quiet=json) as progress:
        found = request(progress=progress)
    renderer.show(renderer.with_files(found.to_dict(), file=draw(found)), json=json)
