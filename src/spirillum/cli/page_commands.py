"""The command `spirillum page`."""

from __future__ import annotations

import typer

from spirillum.cli.function_command import Request, from_function
from spirillum.cli.shared_options import optional_robot


@from_function(
    "spirillum.pages.launch:page",
    robot=optional_robot("A preset's name or a robot file (TOML); else that of --run, or biorob2012-wide."),
)
def page(request: Request) -> None:
    """Show a robot alive in the browser: it swims, its knobs turn, its numbers follow. Needs the extra `page`.

    Example: `spirillum page biorob2012-wide`
    """
    if not request.settings:
        request.robot = request.named_robot  # the page offers its name in commands
    request(tell=typer.echo)
