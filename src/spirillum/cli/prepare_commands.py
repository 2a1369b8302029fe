"""The command `spirillum prepare`."""

from __future__ import annotations

from typing import Annotated

import typer

from spirillum.cli.inputs import loaded_robot
from spirillum.cli.options import Json, RobotArgument, Settings

__all__ = ["prepare"]


def prepare(
    robot: RobotArgument,
    workers: Annotated[int, typer.Option(min=1, max=64, help="Number of processes.")] = 2,
    settings: Settings = None,
    json: Json = False,
) -> None:
    """Make the table of a robot in its tube: minutes, once; then `predict` and `simulate` take it.

    An interrupted preparation goes on where it was.

    Example: `spirillum prepare biorob2012-wide`
    """
    from spirillum.cli import renderer
    from spirillum.swimming.preparation import prepare as answer

    loaded = loaded_robot(robot, settings)
    with renderer.progress_bar(quiet=json) as progress:
        found = answer(loaded, workers=workers, progress=progress)
    renderer.show(found.to_dict(), json=json)
